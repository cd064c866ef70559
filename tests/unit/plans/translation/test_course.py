"""What of a mission is flown and what follows it, by hand."""

from __future__ import annotations

from anafi_mav.plans.rules.parts import FlightPlanFile, GatewayStep, ItemSettings
from anafi_mav.plans.translation.translate import Course, Cursor

FILE = FlightPlanFile(b"QGC WPL 120\n", (0, 1), ((0,), (1,)))
ZOOM = GatewayStep(2, (2,))
BEHIND = FlightPlanFile(b"QGC WPL 120\n", (4, 5), ((3, 4), (5,)))
REST = Cursor(6, ((7, 40),), ItemSettings())


def test_part_after_part() -> None:
    course = Course((FILE, ZOOM, BEHIND), REST)
    seen = [(course.over, course.stepped, course.following)]
    said = []
    for _ in range(3):
        course = course.without_first()
        said.append(course.first)
        seen.append((course.over, course.stepped, course.following))
    assert said == [2, 4, 6]
    assert seen == [(False, True, 2), (False, True, 4), (False, True, 6), (False, True, 6)]


def test_the_end() -> None:
    course = Course((FILE,))
    assert (course.over, course.stepped, course.following) == (False, False, None)
    course = course.without_first()
    assert course.first is None
    assert (course.over, course.stepped, course.following) == (True, False, None)
    assert Course((ZOOM,)).stepped


def test_parts_absent_from_the_drone_wait_for_a_command() -> None:
    course = Course((FILE, ZOOM), REST).ending_with_this_part()
    assert (course.parts, course.following, course.later) == ((FILE,), 2, 2)
    course = course.ending_with_this_part()  # the link is lost once more
    assert course.later == 2
    course = course.without_first()
    assert course.first is None
    assert (course.over, course.later) == (True, 2)


def test_the_rest_alone_waits_too() -> None:
    """The link is lost while the gateway lays it out."""
    course = Course((), REST).ending_with_this_part()
    assert (course.over, course.later) == (True, 6)

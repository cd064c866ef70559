"""From a mission to the drone's files: each line by hand, and the simulated drone's own reader as the referee."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import chain
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.plan_samples import LAT, LON, action, waypoint

from anafi_mav import mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.plan import DO_JUMP, GLOBAL, GLOBAL_INT, MAX_ITEMS, RELATIVE, TERRAIN, Item, Loss
from anafi_mav.plans.rules.rule import Fidelity
from anafi_mav.plans.rules.rules import TABLE
from anafi_mav.plans.translation.translate import (
    MAX_LINES,
    FaultKind,
    FlightPlanFile,
    GatewayStep,
    Start,
    TranslatedMission,
    TranslationFault,
    examine,
    translate,
)
from anafi_mav.sim.plan import plan_file

GROUND = Start(LAT, LON, 0.0, flying=False, takeoff_amsl=35.0, heading=30.0)
AIR = Start(LAT, LON, 10.0, flying=True, takeoff_amsl=35.0, heading=30.0)

VERSIONS: tuple[Version, ...] = (1, 2)


def take_off(height: float | None, *place: float, heading: float | None = None) -> Item:
    latitude, longitude = place or (None, None)
    return Item(mav_enums.MAV_CMD_NAV_TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, heading, latitude, longitude, height))


def lines(flight: TranslatedMission, part: int = 0) -> list[str]:
    """The lines of a file, without what is the same in all: number, current and autocontinue."""
    leg = flight.parts[part]
    assert isinstance(leg, FlightPlanFile)
    header, *rows = leg.content.decode().splitlines()
    assert header == "QGC WPL 120"
    found = []
    for number, row in enumerate(rows):
        words = row.split("\t")
        assert (words[0], words[1], words[11]) == (str(number), "0", "1")
        found.append(" ".join(words[2:11]))
    assert len(leg.origins) == len(leg.done) == len(found)
    return found


def test_a_flight_of_version_1() -> None:
    """0.0001 degrees of longitude are 7.335 m here, of latitude 11.12 m."""
    items = [
        take_off(15.0),
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0, -1.0),
        waypoint(1, 0, 20.0, 3.0, 2.0, 0.0, 90.0),
        waypoint(1, 1, 25.0),
        action(mav_enums.MAV_CMD_NAV_DELAY, 10.0),
        action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    ]
    flight = translate(items, 1, GROUND)
    found = lines(flight)
    # A heading that is not set is towards the way point: east, less half the convergence of the meridians.
    heading = float(found[5].split()[5])
    assert heading == pytest.approx(90.0, abs=1e-4)
    assert found == [
        "3 22 0.0 0.0 0.0 0.0 0.0 0.0 0.0",
        f"3 16 0.0 1.0 0.0 30.0 {LAT} {LON} 15.0",
        "3 178 1.0 4.0 0.0 0.0 0.0 0.0 0.0",
        f"3 16 0.0 2.0 0.0 90.0 {LAT + 1e-4} {LON} 20.0",
        "3 112 3.0 0.0 0.0 0.0 0.0 0.0 0.0",
        f"3 16 0.0 1.0 0.0 {heading} {LAT + 1e-4} {LON + 1e-4} 25.0",
        "3 112 10.0 0.0 0.0 0.0 0.0 0.0 0.0",
        "3 20 0.0 0.0 0.0 0.0 0.0 0.0 0.0",
    ]
    (leg,) = flight.parts
    assert isinstance(leg, FlightPlanFile)
    assert leg.origins == (0, 0, 1, 2, 2, 3, 4, 5)
    assert leg.done == ((), (0,), (1,), (), (2,), (3,), (4,), (5,))
    assert (flight.notes, flight.rest) == ((), None)
    assert examine(items, 1).approximations == ()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("heading", "written"), [(-90.0, "270.0"), (360.0, "0.0"), (400.0, "40.0")])
def test_heading_is_written_as_the_drone_takes_it(version: Version, heading: float, written: str) -> None:
    items = [take_off(15.0, heading=heading), waypoint(1, 0, 20.0, 0.0, 0.0, 0.0, heading)]
    found = lines(translate(items, version, GROUND))
    assert [line.split()[5] for line in found if line.split()[1] == "16"] == [written, written]


def test_a_flight_of_version_2() -> None:
    items = [
        take_off(15.0),
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0, -1.0),
        waypoint(1, 0, 20.0, 3.0, 2.0, 0.0, 90.0),
        waypoint(1, 1, 25.0),
        action(mav_enums.MAV_CMD_NAV_LAND),
    ]
    assert lines(translate(items, 2, GROUND)) == [
        "3 22 nan nan nan nan nan nan nan",
        f"3 16 0.0 1.0 nan nan {LAT} {LON} 15.0",
        "2 178 1.0 4.0 -1.0 0.0 nan nan nan",
        f"3 16 0.0 2.0 nan 90.0 {LAT + 1e-4} {LON} 20.0",
        "2 93 3.0 nan nan nan nan nan nan",
        f"3 16 0.0 1.0 nan nan {LAT + 1e-4} {LON + 1e-4} 25.0",
        "3 21 nan nan nan nan nan nan nan",
    ]


def test_takeoff_at_a_place_climbs_before_moving() -> None:
    found = lines(
        translate(
            [take_off(15.0, LAT, LON + 1e-4, heading=45.0), action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)], 2, GROUND
        )
    )
    assert found[1:3] == [
        f"3 16 0.0 1.0 nan 45.0 {LAT} {LON} 15.0",
        f"3 16 0.0 1.0 nan 45.0 {LAT} {LON + 1e-4} 15.0",
    ]


def test_takeoff_in_the_air_climbs_and_never_descends() -> None:
    assert lines(translate([take_off(15.0), waypoint(1, 0)], 2, AIR))[0] == f"3 16 0.0 1.0 nan nan {LAT} {LON} 15.0"
    flight = translate([take_off(5.0), waypoint(1, 0)], 2, AIR)
    assert len(lines(flight)) == 1
    assert flight.parts[0].done == ((0, 1),)  # nothing was to be done for the take-off


def test_lone_takeoff_in_the_air_does_nothing() -> None:
    flight = translate([take_off(5.0)], 2, AIR)
    assert (flight.parts, flight.done, flight.rest) == ((), (0,), None)


def test_mission_without_takeoff_gets_one_in_front() -> None:
    items = [action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0), waypoint(1, 0, 20.0)]
    flight = translate(items, 1, GROUND)
    assert [line.split()[1] for line in lines(flight)] == ["22", "16", "178", "16"]
    assert lines(flight)[1] == f"3 16 0.0 1.0 0.0 30.0 {LAT} {LON} 20.0"  # straight up
    assert flight.parts[0].done == ((), (), (0,), (1,))
    assert flight.notes == (Loss("no take-off item: the drone climbs to 20 m above take-off first", 1),)
    assert examine(items, 1).approximations == flight.notes
    in_the_air = translate(items, 1, AIR)
    assert [line.split()[1] for line in lines(in_the_air)] == ["178", "16"]
    assert in_the_air.notes == ()


@pytest.mark.parametrize("frame", [GLOBAL, GLOBAL_INT])
def test_missing_takeoff_before_a_height_above_sea_level_is_reported_above_sea_level(frame: int) -> None:
    items = [waypoint(1, 0, 55.0, frame=frame)]  # 20 m above the take-off point, which examine does not know
    flight = translate(items, 1, GROUND)
    assert lines(flight)[1] == f"3 16 0.0 1.0 0.0 30.0 {LAT} {LON} 20.0"
    assert flight.notes == (Loss("no take-off item: the drone climbs to 55 m AMSL first", 0),)
    assert examine(items, 1).approximations == flight.notes


def test_waypoint_below_the_takeoff_height_needs_no_descent_first() -> None:
    flight = translate([waypoint(1, 0, -5.0)], 1, GROUND)
    assert [line.split()[1] for line in lines(flight)] == ["22", "16"]
    assert flight.notes == (Loss("no take-off item", 0),)


def test_on_the_ground_there_is_nothing_to_land() -> None:
    assert examine([action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)], 1).faults == ()
    assert [line.split()[1] for line in lines(translate([action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)], 1, AIR))] == [
        "20"
    ]
    with pytest.raises(PlanError, match="no place to fly to"):
        translate([action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)], 1, GROUND)


def test_landing_at_a_place_flies_there_first() -> None:
    land = Item(mav_enums.MAV_CMD_NAV_LAND, RELATIVE, (0.0, 0.0, 0.0, None, LAT, LON, 0.0))
    assert lines(translate([waypoint(1, 0, 20.0), land], 2, AIR))[1:] == [
        f"3 16 0.0 1.0 nan nan {LAT} {LON} 20.0",
        "3 21 nan nan nan nan nan nan nan",
    ]


def test_amsl_heights_count_from_the_takeoff_point() -> None:
    items = [waypoint(1, 0, 60.5, frame=GLOBAL)]
    assert examine(items, 1).faults == ()
    assert lines(translate(items, 1, AIR))[0].endswith(" 25.5")
    with pytest.raises(PlanError, match="that of the take-off point is unknown"):
        translate(items, 1, replace(AIR, takeoff_amsl=None))
    terrain = examine([waypoint(1, 0, 60.5, frame=TERRAIN)], 1).faults
    assert [(fault.item, fault.kind) for fault in terrain] == [(0, FaultKind.FRAME)]


@pytest.mark.parametrize("first", [0, 1])
def test_takeoff_to_below_the_ground_is_refused_from_any_item_on(first: int) -> None:
    """Upload does not know the ground; the item is read again for what it sets when a later one begins."""
    items = [Item(mav_enums.MAV_CMD_NAV_TAKEOFF, GLOBAL, (0.0, 0.0, 0.0, None, None, None, 20.0)), waypoint(1, 0)]
    assert examine(items, 1).faults == ()
    with pytest.raises(PlanError, match="item 0: NAV_TAKEOFF: invalid take-off height of -15 m above take-off"):
        translate(items, 1, GROUND, first)


def test_omitted_values_of_an_item_stay() -> None:
    here = Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (5.0, 0.0, 0.0, None, None, None, None))
    there = Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, LAT + 1e-4, LON, None))
    zeros = Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0,) * 7)
    found = lines(translate([waypoint(0, 1, 20.0), here, there, zeros], 2, AIR))
    places = [line.split()[6:] for line in found if line.split()[1] == "16"]
    assert places == [
        [str(LAT), str(LON + 1e-4), "20.0"],
        [str(LAT), str(LON + 1e-4), "20.0"],
        [str(LAT + 1e-4), str(LON), "20.0"],
        [str(LAT + 1e-4), str(LON), "20.0"],
    ]


def test_jumps_are_written_out() -> None:
    items = [waypoint(1, 0), waypoint(2, 0), action(DO_JUMP, 0.0, 2.0), action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)]
    flight = translate(items, 1, AIR)
    (leg,) = flight.parts
    assert isinstance(leg, FlightPlanFile)
    assert leg.origins == (0, 1, 0, 1, 0, 1, 3)
    assert leg.done == ((0,), (1, 2), (0,), (1, 2), (0,), (1, 2), (3,))
    assert examine(items, 1).stepped == ()


@pytest.mark.parametrize(
    ("often", "jumps", "height"),
    [(2.0, {}, 20.0), (2.0, {3: 1}, 20.0), (2.0, {3: 2}, 90.0), (-1.0, {3: 9}, 20.0), (0.0, {}, 90.0)],
)
def test_start_at_a_jump_climbs_to_the_way_point_that_is_flown_to(
    often: float, jumps: dict[int, int], height: float
) -> None:
    items = [take_off(15.0), waypoint(1, 0), waypoint(2, 0), action(DO_JUMP, 1.0, often), waypoint(3, 0, 90.0)]
    first = lines(translate(items, 1, GROUND, 3, jumps))[1].split()
    assert (first[0], float(first[-1])) == ("3", height)


def test_start_at_a_jump_to_the_return_rises_nowhere() -> None:
    items = [waypoint(1, 0), action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH), action(DO_JUMP, 1.0, 1.0)]
    with pytest.raises(PlanError, match="no place to fly to"):
        translate(items, 1, GROUND, 2)


def test_longest_mission_of_jumps_is_examined_at_once() -> None:
    """Each jump leads back to the begin; the items before it are not looked at again for each."""
    half = MAX_ITEMS // 2
    speed, back = action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 5.0, -1.0), action(DO_JUMP, 0.0, 1.0)
    items = [*[speed] * half, *[back] * (half - 1), waypoint(1, 0)]
    began = time.process_time()
    assert examine(items, 1).faults == ()
    assert time.process_time() - began < 2.0


def test_a_jump_without_end_is_flown_file_after_file() -> None:
    items = [
        take_off(20.0),
        waypoint(1, 0),
        waypoint(2, 0),
        action(DO_JUMP, 1.0, -1.0),
        action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    ]
    report = examine(items, 2)
    assert report.faults == ()
    assert report.approximations == (Loss("never reached", 4),)
    assert report.stepped == (Loss(f"flown in files of {MAX_LINES} lines because of the jump", 3),)
    flight = translate(items, 2, AIR)
    assert [len(lines(flight))] == [MAX_LINES]
    assert flight.rest is not None
    again = translate(items, 2, AIR, flight.rest)
    assert lines(again)[:2] == lines(flight)[2:4]  # the climb of the first file made it odd
    assert again.rest is not None


def test_long_mission_becomes_files_in_sequence() -> None:
    items = [take_off(20.0), *[waypoint(number % 9, 0) for number in range(MAX_LINES)]]
    items += [
        action(mav_enums.MAV_CMD_CONDITION_DELAY, 5.0),
        action(mav_enums.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0),
        action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
        action(mav_enums.MAV_CMD_DO_LAND_START),
    ]
    report = examine(items, 2)
    assert [(loss.item, loss.what[:9]) for loss in report.approximations] == [
        (MAX_LINES + 1, "the drone"),
        (MAX_LINES + 4, "never rea"),
    ]
    assert [loss.item for loss in report.stepped] == [MAX_LINES + 2, None]
    done: list[int] = []
    flight = translate(items, 2, GROUND)
    done += chain(*flight.parts[0].done)  # type: ignore[arg-type]
    assert flight.rest is not None
    flight = translate(items, 2, AIR, flight.rest)
    assert flight.rest is None
    for part in flight.parts:
        done += chain(*part.done) if isinstance(part, FlightPlanFile) else part.done
    assert done == list(range(MAX_LINES + 4))


def test_nested_loop_counts_for_the_whole_mission() -> None:
    """As in PX4 and ArduPilot: the inner jump is used up in the first round of the outer one."""
    items = [waypoint(1, 0), action(DO_JUMP, 0.0, 2.0), waypoint(2, 0), action(DO_JUMP, 0.0, 1.0)]
    (leg,) = translate(items, 1, AIR).parts
    assert isinstance(leg, FlightPlanFile)
    assert leg.origins == (0, 0, 0, 2, 0, 2)


def test_a_turn_in_place_is_flown_by_the_gateway() -> None:
    items = [
        waypoint(1, 0),
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 0.0, 3.0),
        action(mav_enums.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0),
        action(mav_enums.MAV_CMD_DO_LAND_START),
        waypoint(1, 1),
    ]
    report = examine(items, 1)
    assert [loss.item for loss in report.stepped] == [2]
    flight = translate(items, 1, AIR)
    first, step, last = flight.parts
    assert isinstance(first, FlightPlanFile)
    assert isinstance(last, FlightPlanFile)
    assert first.done == ((0,), (1,))
    assert step == GatewayStep(2, (2, 3))
    assert lines(flight, 2)[0] == "3 178 0.0 3.0 0.0 0.0 0.0 0.0 0.0"  # a new file: what holds is set again
    assert last.origins == (4, 4)
    assert last.done == ((), (4,))


def test_begin_in_the_middle() -> None:
    items = [
        take_off(15.0),
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 7.0),
        waypoint(1, 0, 20.0),
        waypoint(2, 0, 30.0),
        action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    ]
    assert [line.split()[1] for line in lines(translate(items, 1, AIR, 3))] == ["178", "16", "20"]
    flight = translate(items, 1, GROUND, 3)
    found = lines(flight)
    assert [line.split()[1] for line in found] == ["22", "178", "16", "16", "20"]
    assert found[2].endswith(f"{LAT} {LON} 30.0")
    assert flight.parts[0].origins == (3, 3, 3, 3, 4)
    assert flight.parts[0].done == ((), (), (), (3,), (4,))
    with pytest.raises(PlanError, match="the mission has 5 items"):
        translate(items, 1, AIR, 5)


WRONG = {
    "unknown": (
        [waypoint(0, 1), action(mav_enums.MAV_CMD_DO_VTOL_TRANSITION)],
        TranslationFault(1, "DO_VTOL_TRANSITION: unsupported in flight plans", FaultKind.COMMAND),
    ),
    "circle": (
        [Item(mav_enums.MAV_CMD_NAV_LOITER_TURNS, RELATIVE, (1.0, 0.0, 5.0, 0.0, LAT, LON, 9.0))],
        TranslationFault(
            0, "NAV_LOITER_TURNS: the drone flies straight lines: draw the circle as way points", FaultKind.COMMAND
        ),
    ),
    "latitude": (
        [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, 0.0, 91.0, LON, 9.0))],
        TranslationFault(0, "NAV_WAYPOINT: invalid latitude 91", FaultKind.PARAM, 5),
    ),
    "longitude": (
        [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, 0.0, LAT, None, 9.0))],
        TranslationFault(0, "NAV_WAYPOINT: no longitude", FaultKind.PARAM, 6),
    ),
    "infinite": ([waypoint(0, 1, float("inf"))], TranslationFault(0, "param7 is not a number", FaultKind.PARAM, 7)),
    "frame": (
        [waypoint(0, 1, frame=1)],
        TranslationFault(0, "NAV_WAYPOINT: frame 1 is not global", FaultKind.FRAME),
    ),
    "frame of a place without a height": (
        [waypoint(0, 1), Item(mav_enums.MAV_CMD_NAV_WAYPOINT, 1, (0.0, 0.0, 0.0, None, 8.0, 5.0, None))],
        TranslationFault(1, "NAV_WAYPOINT: frame 1 is not global", FaultKind.FRAME),
    ),
    "frame of a landing": (
        [waypoint(0, 1), Item(mav_enums.MAV_CMD_NAV_LAND, 1, (0.0, 0.0, 0.0, None, 8.0, 5.0, 0.0))],
        TranslationFault(1, "NAV_LAND: frame 1 is not global", FaultKind.FRAME),
    ),
    "frame of a region": (
        [waypoint(0, 1), Item(mav_enums.MAV_CMD_DO_SET_ROI_LOCATION, 1, (0.0, 0.0, 0.0, 0.0, 8.0, 5.0, None))],
        TranslationFault(1, "DO_SET_ROI_LOCATION: frame 1 is not global", FaultKind.FRAME),
    ),
    "waits": (
        [replace(waypoint(0, 1), autocontinue=False)],
        TranslationFault(0, "autocontinue 0 is unsupported", FaultKind.COMMAND),
    ),
    "speed": (
        [waypoint(0, 1), action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 0.0)],
        TranslationFault(1, "DO_CHANGE_SPEED: invalid speed of 0 m/s", FaultKind.PARAM, 2),
    ),
    "climbing": (
        [waypoint(0, 1), action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 2.0, 1.0)],
        TranslationFault(
            1,
            "DO_CHANGE_SPEED: climb and descent speeds cannot be set",
            FaultKind.PARAM,
            1,
        ),
    ),
    "clock": (
        [waypoint(0, 1), action(mav_enums.MAV_CMD_NAV_DELAY, -1.0, 12.0, 0.0, 0.0)],
        TranslationFault(1, "NAV_DELAY: waiting for a time of day is unsupported", FaultKind.PARAM, 1),
    ),
    "jump": (
        [waypoint(0, 1), action(DO_JUMP, 7.0, 1.0)],
        TranslationFault(1, "jump target does not exist", FaultKind.PARAM, 1),
    ),
    "jumps": (
        [waypoint(0, 1), action(DO_JUMP, 0.0, -2.0)],
        TranslationFault(1, "invalid jump count -2", FaultKind.PARAM, 2),
    ),
    "too many jumps": (
        [waypoint(0, 1), *[action(DO_JUMP, 0.0, 40000.0)] * 2],
        TranslationFault(2, "more than 65535 jumps in the mission", FaultKind.PARAM, 2),
    ),
    "for ever": (
        [waypoint(0, 1), action(mav_enums.MAV_CMD_NAV_DELAY, 0.0), action(DO_JUMP, 1.0, -1.0)],
        TranslationFault(2, "endless loop, no flight", FaultKind.PLAN),
    ),
    "for ever at one place": (
        [waypoint(0, 1), action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0), action(DO_JUMP, 1.0, -1.0)],
        TranslationFault(2, "endless loop, no flight", FaultKind.PLAN),
    ),
    "for ever at one way point": (
        [take_off(8.0), waypoint(0, 1), action(DO_JUMP, 1.0, -1.0)],
        TranslationFault(2, "endless loop, no flight", FaultKind.PLAN),
    ),
    "for ever with way points that are as wide as the way between them": (
        [waypoint(0, 1, 20.0, 0.0, 40.0), waypoint(0, 4, 20.0, 0.0, 40.0), action(DO_JUMP, 0.0, -1.0)],
        TranslationFault(2, "endless loop, no flight", FaultKind.PLAN),
    ),
    "for ever after more than is written at once": (
        [
            take_off(8.0),
            *[waypoint(n % 2 * 5, 1) for n in range(2 * MAX_LINES)],
            action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0),
            action(DO_JUMP, 2.0 * MAX_LINES + 1.0, -1.0),
        ],
        TranslationFault(2 * MAX_LINES + 2, "endless loop, no flight", FaultKind.PLAN),
    ),
    "for ever when the count is used up": (
        [
            waypoint(0, 1),
            action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0),
            action(DO_JUMP, 0.0, 3.0),
            action(DO_JUMP, 1.0, -1.0),
        ],
        TranslationFault(3, "endless loop, no flight", FaultKind.PLAN),
    ),
    "very often": (
        [take_off(8.0), waypoint(0, 1), action(mav_enums.MAV_CMD_DO_LAND_START), action(DO_JUMP, 2.0, 65535.0)],
        TranslationFault(3, "loop without flight", FaultKind.PLAN),
    ),
    "very often with a region": (
        [
            take_off(8.0),
            Item(mav_enums.MAV_CMD_DO_SET_ROI_LOCATION, RELATIVE, (0.0, 0.0, 0.0, None, LAT, LON, 9.0)),
            action(mav_enums.MAV_CMD_DO_SET_ROI_NONE),
            action(DO_JUMP, 1.0, 2000.0),
        ],
        TranslationFault(3, "loop without flight", FaultKind.PLAN),
    ),
    "after the landing": (
        [waypoint(0, 1), action(mav_enums.MAV_CMD_NAV_LAND), action(mav_enums.MAV_CMD_DO_LAND_START)],
        TranslationFault(2, "follows a landing, which ends the plan", FaultKind.PLAN),
    ),
    "nothing flies": (
        [action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0)],
        TranslationFault(0, "no item moves the drone", FaultKind.PLAN),
    ),
}


IDLE = {
    "speed": [action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0)],
    "region": [
        Item(mav_enums.MAV_CMD_DO_SET_ROI_LOCATION, RELATIVE, (0.0, 0.0, 0.0, None, LAT, LON, 9.0)),
        action(mav_enums.MAV_CMD_DO_SET_ROI_NONE),
    ],
    "gimbal": [action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -45.0, 0.0)],
    "take-off": [take_off(8.0)],
    "no wait": [action(mav_enums.MAV_CMD_NAV_DELAY, 0.0)],
    "photo": [action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0)],
    "photos": [
        action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 3.0, 0.0),
        action(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE),
    ],
    "video": [action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE), action(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE)],
    "zoom": [action(mav_enums.MAV_CMD_SET_CAMERA_ZOOM, 2.0, 40.0)],
    "turned already": [action(mav_enums.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0)],
    "no place": [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, 0.0, 0.0, 0.0))],
}
BUSY = {
    "wait": [action(mav_enums.MAV_CMD_NAV_DELAY, 0.5)],
    "wait at no place": [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (3.0, 0.0, 0.0, None, 0.0, 0.0, 0.0))],
    "turn": [action(mav_enums.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 1.0, 1.0)],
    "two turns": [
        action(mav_enums.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0),
        action(mav_enums.MAV_CMD_CONDITION_YAW, 0.0, 0.0, 0.0, 0.0),
    ],
    "panorama": [action(mav_enums.MAV_CMD_PANORAMA_CREATE, 360.0)],
    "up and down": [waypoint(0, 1, 20.0), waypoint(0, 1, 25.0)],
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("what", [*IDLE, *BUSY])
def test_endless_loop_is_refused_only_without_flight(what: str, version: Version) -> None:
    """A photo is nothing: that the drone waits until it is taken, no one says."""
    items = [take_off(8.0), *{**IDLE, **BUSY}[what]]
    report = examine([*items, action(DO_JUMP, 1.0, -1.0)], version)
    idle = TranslationFault(len(items), "endless loop, no flight", FaultKind.PLAN)
    assert report.faults == ((idle,) if what in IDLE else ())


def test_few_photos_at_one_place_are_a_finite_loop() -> None:
    flight = translate(
        [waypoint(0, 1), action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0), action(DO_JUMP, 1.0, 300.0)],
        2,
        AIR,
    )
    assert len([line for line in lines(flight) if line.startswith("2 2000 ")]) == 301


def test_loop_of_lineless_items_is_cut_by_item_count() -> None:
    """It is cut by the items that are come by, not by its lines: 2000 of them were ten million items."""
    items = [
        waypoint(0, 1),
        waypoint(5, 1),
        *[action(mav_enums.MAV_CMD_DO_LAND_START)] * 4000,
        action(DO_JUMP, 0.0, -1.0),
    ]
    flight = translate(items, 1, AIR)
    (leg,) = flight.parts
    assert isinstance(leg, FlightPlanFile)
    assert len(leg.origins) == 10
    assert flight.rest is not None
    again = translate(items, 1, AIR, flight.rest)
    assert isinstance(again.parts[0], FlightPlanFile)
    assert again.parts[0].origins == leg.origins
    assert again.rest is not None


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("items", "fault"), WRONG.values(), ids=WRONG)
def test_untranslatable_mission_item_is_refused(items: list[Item], fault: TranslationFault, version: Version) -> None:
    assert examine(items, version).faults == (fault,)
    with pytest.raises(PlanError):
        translate(items, version, AIR)


def test_an_empty_mission() -> None:
    assert examine([], 1).faults == ()
    with pytest.raises(PlanError):
        translate([], 1, AIR)


@pytest.mark.parametrize("version", VERSIONS)
def test_simulated_drone_reads_the_translated_file(version: Version) -> None:
    items = [
        take_off(15.0),
        waypoint(1, 0, 20.0, 3.0),
        waypoint(1, 1e-3, 25.0),
        action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    ]
    flight = translate(items, version, GROUND)
    (leg,) = flight.parts
    assert isinstance(leg, FlightPlanFile)
    read = plan_file.read(leg.content, version)
    assert [int(item.command) for item in read] == [22, 16, 16, {1: 112, 2: 93}[version], 16, 20]
    assert read[4].longitude == LON + 1e-7  # a centimetre is not lost


QGROUNDCONTROL = (
    16,
    17,
    19,
    20,
    21,
    22,
    31,
    93,
    115,
    4501,
    177,
    178,
    179,
    183,
    187,
    189,
    195,
    196,
    197,
    203,
    204,
    205,
    206,
    211,
    530,
    2000,
    2001,
    2500,
    2501,
    1000,
)
"""What it may put into a plan for a multicopter (PX4FirmwarePlugin.cc), and the gimbal of its surveys."""

PARROT = (16, 20, 21, 22, 93, 112, 178, 195, 197, 201, 205, 206, 214, 2000, 2001, 2500, 2501, 2800, 50000, 50001)
"""Its flight plan page."""


def test_command_table_covers_the_planners_commands() -> None:
    assert set(QGROUNDCONTROL) | set(PARROT) | {531, 1001} <= set(TABLE)
    assert all(TABLE[command].verdict is not Fidelity.REFUSED for command in PARROT)
    for row in TABLE.values():
        assert row.how.endswith(".")
        assert row.write is not None or row.verdict is Fidelity.REFUSED or row.command == DO_JUMP


@pytest.mark.parametrize("command", [row.command for row in TABLE.values() if row.verdict is Fidelity.REFUSED])
def test_command_refused_by_the_table_is_refused(command: int) -> None:
    (fault,) = examine([waypoint(0, 1), action(command)], 2).faults
    assert (fault.item, fault.kind) == (1, FaultKind.COMMAND)
    assert fault.reason == f"{TABLE[command].name}: {TABLE[command].why}"


def mission(seed: int) -> list[Item]:
    """A mission as people make them, always the same of the same number; now and then one that cannot be flown."""
    random = Random(seed)
    size = random.randint(1, 14)

    def place(frame: int = RELATIVE, height: float = 20.0) -> tuple[int, float, float, float]:
        return frame, LAT + random.uniform(-1e-3, 1e-3), LON + random.uniform(-1e-3, 1e-3), height

    def nav(command: int, one: float) -> Item:
        frame, *where = place(random.choice([RELATIVE, GLOBAL, 5, 6]), random.uniform(40.0, 60.0))
        heading = random.choice([None, 0.0, 123.0])
        return Item(command, frame, (one, random.choice([0.0, 2.0, None]), 0.0, heading, where[0], where[1], where[2]))

    makers: list[Callable[[], Item]] = [
        lambda: nav(mav_enums.MAV_CMD_NAV_WAYPOINT, random.choice([0.0, 2.5])),
        lambda: nav(mav_enums.MAV_CMD_NAV_LOITER_TIME, 4.0),
        lambda: nav(mav_enums.MAV_CMD_NAV_LOITER_TO_ALT, 0.0),
        lambda: nav(mav_enums.MAV_CMD_NAV_TAKEOFF, 0.0),
        lambda: action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
        lambda: nav(mav_enums.MAV_CMD_NAV_LAND, 0.0),
        lambda: action(mav_enums.MAV_CMD_NAV_DELAY, 3.0),
        lambda: action(mav_enums.MAV_CMD_CONDITION_DELAY, 2.0),
        lambda: action(mav_enums.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 1.0, random.choice([0.0, 1.0])),
        lambda: action(mav_enums.MAV_CMD_SET_CAMERA_ZOOM, 2.0, 40.0),
        lambda: action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, random.uniform(1.0, 10.0), -1.0),
        lambda: nav(mav_enums.MAV_CMD_DO_SET_ROI_LOCATION, 0.0),
        lambda: action(mav_enums.MAV_CMD_DO_SET_ROI_NONE),
        lambda: action(mav_enums.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET, 0.0, 0.0, 0.0, 0.0, -10.0, 0.0, 90.0),
        lambda: action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, random.uniform(-90.0, 0.0)),
        lambda: action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, random.choice([0.0, 15.0]), 0.0, 1.0),
        lambda: action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL, 2500.0),
        lambda: action(mav_enums.MAV_CMD_SET_CAMERA_MODE, 0.0, 1.0),
        lambda: action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -45.0, 0.0),
        lambda: action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, -2.0),
        lambda: action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0),
        lambda: action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 3.0, random.choice([0.0, 5.0])),
        lambda: action(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE),
        lambda: action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE),
        lambda: action(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE),
        lambda: action(mav_enums.MAV_CMD_PANORAMA_CREATE, 360.0),
        lambda: action(mav_enums.MAV_CMD_DO_LAND_START),
        lambda: action(50001, 1.0, 9.0, 13.0),
        lambda: action(DO_JUMP, float(random.randrange(size)), float(random.randrange(-1, 4))),
    ]
    return [random.choice(makers)() for _ in range(size)]


@settings(max_examples=120, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(VERSIONS), st.booleans())
def test_any_mission_is_refused_or_flown_whole(seed: int, version: Version, flying: bool) -> None:
    """What cannot be flown is left out until the rest can; then each item that is reached is done, in its order."""
    items = mission(seed)
    report = examine(items, version)
    while report.faults:
        assert all(0 <= fault.item < len(items) for fault in report.faults)
        items.pop(report.faults[0].item)
        items = [item for item in items if item.command != DO_JUMP or (item.params[0] or 0.0) < len(items)]
        report = examine(items, version)
    if not items or not any(item.command in (16, 19, 22, 31) for item in items):
        return
    start = replace(AIR if flying or items[0].command in (20, 21) else GROUND, takeoff_amsl=30.0)
    try:
        flight = translate(items, version, start)
    except PlanError as error:  # a return or a landing before all that flies
        assert (start.flying, error.problem) == (False, "no place to fly to from the ground")  # noqa: PT017
        return
    done = [
        item for part in flight.parts for item in chain(*part.done if isinstance(part, FlightPlanFile) else [part.done])
    ]
    assert bool(flight.parts) is not bool(flight.done)
    done += flight.done
    never = {loss.item for loss in report.approximations if loss.what == "never reached"}
    assert not never & set(done)
    if flight.rest is None:
        assert never | set(done) == set(range(len(items)))
    if not any(item.command == DO_JUMP for item in items):
        assert done == sorted(done)
        assert len(set(done)) == len(done)
        assert {part.item for part in flight.parts if isinstance(part, GatewayStep)} == {
            loss.item for loss in report.stepped
        }
    for part in flight.parts:
        if isinstance(part, FlightPlanFile):
            read = plan_file.read(part.content, version)
            assert len(read) == len(part.origins) == len(part.done)
    commands = [
        item.command
        for part in flight.parts
        if isinstance(part, FlightPlanFile)
        for item in plan_file.read(part.content, version)
    ]
    assert commands.count(plan_file.PlanCommand.TAKEOFF) == (not start.flying)
    assert start.flying or commands[0] is plan_file.PlanCommand.TAKEOFF


def test_missions_of_the_property_test_mostly_fly() -> None:
    """Else it would show nothing."""
    flown = [seed for seed in range(300) if not examine(mission(seed), 1).faults]
    assert len(flown) > 30


@pytest.mark.parametrize("version", VERSIONS)
def test_takeoff_above_sea_level_is_judged_by_the_takeoff_point(version: Version) -> None:
    """1 m below sea level is 5 m above a polder 6 m below it."""
    items = [replace(take_off(-1.0), frame=GLOBAL), waypoint(1, 0, 10.0)]
    assert examine(items, version).faults == ()
    polder = replace(GROUND, takeoff_amsl=-6.0)
    assert any(line.split()[1] == "16" and line.endswith(" 5.0") for line in lines(translate(items, version, polder)))
    with pytest.raises(PlanError, match="invalid take-off height of -36 m"):
        translate(items, version, GROUND)


@pytest.mark.parametrize("version", VERSIONS)
def test_later_turn_of_a_loop_begins_with_what_the_turn_before_has_set(version: Version) -> None:
    items = [
        take_off(10.0),
        waypoint(1, 0, 10.0),
        waypoint(2, 0, 10.0),
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 3.0, -1.0),
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 5.0, 0.0, 1.0),
        waypoint(2, 2, 10.0),
        action(DO_JUMP, 1.0, 2.0),
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 0.0),
    ]
    stays: list[str] = {1: [], 2: ["16"]}[version]  # an Ai would set everything above its first way point
    kinds = [line.split()[1] for line in lines(translate(items, version, AIR, 1, {6: 1}))]
    assert kinds[: len(stays) + 5] == [*stays, "178", "2001", "50001", "2000", "16"]
    assert lines(translate(items, version, AIR, 1))[0].split()[1] == "16"

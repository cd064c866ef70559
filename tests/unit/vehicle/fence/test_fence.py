"""Fences without a wire: geometry against numbers worked out by hand, the rules of items, and the watch.

On the ellipsoid of WGS 84 (a = 6378137 m, 1/f = 298.257223563) 0.001 degrees are, by the radii of curvature,
111.2074 m of latitude and 73.3490 m of longitude at 48.8789° north, 110.5743 m and 111.3195 m at the equator,
111.4123 m and 55.8000 m at 60° north.
"""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
from msgspec.structs import replace

from anafi_mav import geo
from anafi_mav.mavlink import dialect
from anafi_mav.plans.zones import CircleZone, Fence, PolygonZone
from anafi_mav.services.plan.fence_kind import FenceKind, summary
from anafi_mav.vehicle.fence.fence import fence_of
from anafi_mav.vehicle.fence.fence_watch import (
    ARDUPILOT_ACTIONS,
    BACK_INSIDE,
    CALM,
    CEILING,
    EVERYTHING,
    FLOOR,
    HOME_CIRCLE,
    PX4_ACTIONS,
    RETRY,
    STALE,
    TRANSITIONS,
    ZONES,
    Breach,
    Event,
    FenceWatch,
    OutsideFence,
    Reaction,
    Sight,
    State,
)
from anafi_mav.vehicle.fence.plan_items import PlanItem

LAT, LON = 48.8789, 2.3677
NORTH, EAST = 111.2074, 73.3490
"""m in 0.001 degrees there."""

INCLUSION, EXCLUSION = True, False


def square(
    lat: float = LAT, lon: float = LON, half: float = 0.001, kind: bool = INCLUSION, group: int = 0
) -> PolygonZone:
    corners = [(lat + half, lon + half), (lat - half, lon + half), (lat - half, lon - half), (lat + half, lon - half)]
    return PolygonZone("square", kind, group, corners)


@pytest.mark.parametrize(
    ("lat", "lon", "north", "east"),
    [
        (48.8789, 2.3677, 111.2074, 73.3490),
        (0.0, 179.9999, 110.5743, 111.3195),  # half of it on the other side of the antimeridian
        (60.0, -180.0, 111.4123, 55.8000),
        (-48.8789, -70.0, 111.2074, 73.3490),
    ],
)
def test_depth_in_a_square(lat: float, lon: float, north: float, east: float) -> None:
    def wrapped(longitude: float) -> float:
        return (longitude + 180.0) % 360.0 - 180.0

    corners = [(lat + n * 0.001, wrapped(lon + e * 0.001)) for n, e in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    zone = PolygonZone("square", INCLUSION, 0, corners)
    assert zone.depth((lat, lon), None) == pytest.approx(min(north, east), abs=0.01)
    # 0.0002 degrees inside the eastern side, and as far outside of it.
    assert zone.depth((lat, wrapped(lon + 0.0008)), None) == pytest.approx(0.2 * east, abs=0.01)
    assert zone.depth((lat, wrapped(lon + 0.0012)), None) == pytest.approx(-0.2 * east, abs=0.01)
    assert zone.depth((lat + 0.0011, lon), None) == pytest.approx(-0.1 * north, abs=0.01)
    # Beyond a corner it is the corner that is nearest.
    beyond = zone.depth((lat + 0.0013, wrapped(lon + 0.0014)), None)
    assert beyond == pytest.approx(-math.hypot(0.3 * north, 0.4 * east), abs=0.01)
    assert zone.area == pytest.approx(4.0 * north * east, rel=1e-4)


def test_depth_in_a_hollow() -> None:
    """A U that is open to the north: its middle is outside, between two arms."""
    u = [(1, -3), (1, -1), (-1, -1), (-1, 1), (1, 1), (1, 3), (-3, 3), (-3, -3)]
    zone = PolygonZone("U", INCLUSION, 0, [(LAT + n * 0.001, LON + e * 0.001) for n, e in u])
    assert zone.depth((LAT, LON), None) == pytest.approx(-EAST, abs=0.01)  # to the arms; the bottom is farther
    assert zone.depth((LAT, LON + 0.002), None) == pytest.approx(EAST, abs=0.01)  # in the middle of an arm
    assert zone.depth((LAT - 0.0015, LON), None) == pytest.approx(0.5 * NORTH, abs=0.01)


def test_depth_in_a_circle() -> None:
    zone = CircleZone("circle", INCLUSION, 0, (LAT, LON), 100.0)
    assert zone.depth((LAT, LON), None) == 100.0
    assert zone.depth((LAT + 0.0005, LON), None) == pytest.approx(100.0 - 0.5 * NORTH, abs=0.01)
    assert zone.depth((LAT, LON + 0.002), None) == pytest.approx(100.0 - 2.0 * EAST, abs=0.01)


def test_a_circle_around_home_is_where_home_is() -> None:
    zone = CircleZone("circle", INCLUSION, 0, None, 100.0)
    assert zone.depth((LAT, LON), (LAT, LON)) == 100.0
    assert zone.depth((LAT, LON), (LAT + 0.001, LON)) == pytest.approx(100.0 - NORTH, abs=0.01)
    assert zone.depth((LAT, LON), None) == math.inf


# Zones together.


def test_no_fence() -> None:
    fence = Fence()
    assert fence.margin((LAT, LON)).metres == math.inf
    assert fence.leaves((LAT, LON), (LAT + 1.0, LON)) is None


def test_inside_all_zones_of_one_group() -> None:
    """param2 0 or unset in all of them: what they have in common counts."""
    fence = Fence([square(), CircleZone("circle", INCLUSION, 0, (LAT + 0.001, LON), 150.0)])
    assert fence.margin((LAT, LON)).metres == pytest.approx(150.0 - NORTH, abs=0.01)
    assert fence.margin((LAT - 0.0005, LON)).zone == "circle"
    assert fence.margin((LAT - 0.0005, LON)).metres == pytest.approx(150.0 - 1.5 * NORTH, abs=0.01)
    assert fence.margin((LAT + 0.0015, LON)).zone == "square"
    assert fence.margin((LAT + 0.0015, LON)).metres == pytest.approx(-0.5 * NORTH, abs=0.01)


def test_inside_at_least_one_group() -> None:
    fence = Fence([square(group=1), square(lat=LAT + 0.01, group=2)])
    assert fence.margin((LAT, LON)).metres == pytest.approx(EAST, abs=0.01)
    assert fence.margin((LAT + 0.01, LON)).metres == pytest.approx(EAST - 0.0146, abs=0.01)  # a kilometre to the north
    assert fence.margin((LAT + 0.005, LON)).metres == pytest.approx(-4.0 * NORTH, abs=0.05)


def test_outside_every_exclusion_zone() -> None:
    hole = CircleZone("hole", EXCLUSION, 0, (LAT + 0.0005, LON), 20.0)
    fence = Fence([square(), hole])
    assert fence.margin((LAT, LON)).metres == pytest.approx(0.5 * NORTH - 20.0, abs=0.01)
    assert fence.margin((LAT, LON)).zone == "hole"
    assert fence.margin((LAT + 0.0005, LON)).metres == -20.0
    assert Fence([hole]).margin((LAT + 1.0, LON)).metres > 100_000.0  # without an inclusion zone all the rest is inside


def test_ways() -> None:
    hole = CircleZone("hole", EXCLUSION, 0, (LAT, LON), 20.0)
    fence = Fence([square(half=0.005), hole])
    west, east, north = (LAT, LON - 0.002), (LAT, LON + 0.002), (LAT + 0.001, LON)
    through = fence.leaves(west, east)
    assert through is not None
    assert through.zone == "hole"
    assert fence.leaves(west, north) is None
    assert fence.leaves(west, west) is None
    out = fence.leaves(west, (LAT, LON - 0.006))
    assert out is not None
    assert out.zone == "square"
    # Past the hole at 21 m, and at 19 m.
    for metres, free in ((21.0, True), (19.0, False)):
        shift = metres / NORTH * 0.001
        assert (fence.leaves((LAT + shift, LON - 0.002), (LAT + shift, LON + 0.002)) is None) is free
    # Both ends are in the U, and the way between its arms is not.
    u = [(1, -3), (1, -1), (-1, -1), (-1, 1), (1, 1), (1, 3), (-3, 3), (-3, -3)]
    hollow = Fence([PolygonZone("U", INCLUSION, 0, [(LAT + n * 0.001, LON + e * 0.001) for n, e in u])])
    assert hollow.leaves((LAT, LON - 0.002), (LAT, LON + 0.002)) is not None
    assert hollow.leaves((LAT - 0.002, LON - 0.002), (LAT - 0.002, LON + 0.002)) is None


def test_ways_between_groups() -> None:
    """Two zones that touch or overlap let through what two that do not, do not."""
    for gap, free in ((-5.0, True), (5.0, False)):
        shift = 100.0 + gap
        zones = [
            CircleZone("one", INCLUSION, 1, (LAT, LON), 50.0),
            CircleZone("two", INCLUSION, 2, geo.destination(LAT, LON, shift, 0.0), 50.0),
        ]
        fence = Fence(zones)
        assert (fence.leaves((LAT, LON), geo.destination(LAT, LON, shift, 0.0)) is None) is free


def test_a_way_is_looked_at_as_a_whole() -> None:
    """A wall of a hand's breadth, ten kilometres away."""
    wall = [(9000.0, -50.0), (9000.1, -50.0), (9000.1, 50.0), (9000.0, 50.0)]
    zone = PolygonZone("wall", EXCLUSION, 0, [geo.destination(LAT, LON, *corner) for corner in wall])
    fence = Fence([zone])
    assert fence.leaves((LAT, LON), geo.destination(LAT, LON, 10_000.0, 0.0)) is not None
    assert fence.leaves((LAT, LON), geo.destination(LAT, LON, 10_000.0, 2000.0)) is None
    assert sorted(zone.crossings((LAT, LON), geo.destination(LAT, LON, 10_000.0, 0.0), None)) == pytest.approx(
        [0.9, 0.90001], abs=1e-6
    )


def test_a_large_fence_is_looked_at_in_no_time() -> None:
    """5000 corners, which is the most: a way along all of them takes milliseconds."""
    turns = [2.0 * math.pi * n / 5000 for n in range(5000)]
    corners = [(LAT + 0.01 * math.cos(t), LON + 0.015 * math.sin(t)) for t in turns]
    fence = Fence([PolygonZone("round", INCLUSION, 0, corners)])
    assert fence.margin((LAT, LON)).metres == pytest.approx(1100.0, abs=15.0)
    began = time.process_time()
    for _ in range(100):
        assert fence.leaves((LAT - 0.009, LON), (LAT + 0.009, LON)) is None
    assert time.process_time() - began < 3.0


# Items.


def item(command: int, lat: float = LAT, lon: float = LON, *params: float, frame: int = 0) -> PlanItem:
    one, two, three, four = (*params, *([0.0] * (4 - len(params))))
    return PlanItem(command, frame, (one, two, three, four), round(lat * 1e7), round(lon * 1e7), 0.0)


def corners(command: int, count: int, group: float = 0.0, shift: float = 0.0) -> list[PlanItem]:
    turns = [2.0 * math.pi * n / count for n in range(count)]
    return [
        item(command, LAT + shift + 0.001 * math.cos(turn), LON + 0.001 * math.sin(turn), count, group)
        for turn in turns
    ]


def test_a_fence_of_items() -> None:
    items = [
        *corners(5001, 5, 1.0),
        *corners(5001, 3, math.nan),
        item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 50.0, 2.0),
        item(dialect.MAV_CMD_NAV_FENCE_RETURN_POINT),
        *corners(5002, 4, 9.0),
        item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, LAT, LON, 7.5),
        item(dialect.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION, 0.0, 0.0, 80.0, 3.0),
    ]
    assert FenceKind().check_plan(items) is None
    assert all(FenceKind().check_item(one) is None for one in items)
    zones = fence_of(items).zones
    assert [(type(zone), zone.inclusion) for zone in zones] == [
        (PolygonZone, True), (PolygonZone, True), (CircleZone, True),
        (PolygonZone, False), (CircleZone, False), (CircleZone, True),
    ]  # fmt: skip
    assert [zone.group for zone in zones if zone.inclusion] == [1, 0, 2, 3]
    assert zones[0].name == "inclusion 0-4"
    assert isinstance(zones[5], CircleZone)
    assert zones[5].centre is None
    assert summary(items) == (
        "Fence: 2 inclusion polygons, 2 inclusion circles, 1 exclusion polygon, 1 exclusion circle; return point unused"
    )
    assert "zones of a group" in summary([*corners(5001, 3), *corners(5001, 4)])


@pytest.mark.parametrize(
    ("bad", "result"),
    [
        (item(dialect.MAV_CMD_NAV_WAYPOINT), dialect.MAV_MISSION_UNSUPPORTED),
        (item(dialect.MAV_CMD_NAV_RALLY_POINT), dialect.MAV_MISSION_UNSUPPORTED),
        (item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, LAT, LON, 2.0), dialect.MAV_MISSION_INVALID_PARAM1),
        (item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, LAT, LON, 3.5), dialect.MAV_MISSION_INVALID_PARAM1),
        (
            item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, LAT, LON, math.inf),
            dialect.MAV_MISSION_INVALID_PARAM1,
        ),
        (
            item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION, LAT, LON, 6000.0),
            dialect.MAV_MISSION_INVALID_PARAM1,
        ),
        (item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, -0.5), dialect.MAV_MISSION_INVALID_PARAM1),
        (item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, math.nan), dialect.MAV_MISSION_INVALID_PARAM1),
        (item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, LAT, LON, math.inf), dialect.MAV_MISSION_INVALID_PARAM1),
        (item(dialect.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION, 0.0, 0.0, -1.0), dialect.MAV_MISSION_INVALID_PARAM1),
        (item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 5.0, 1.5), dialect.MAV_MISSION_INVALID_PARAM2),
        (item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 5.0, math.inf), dialect.MAV_MISSION_INVALID_PARAM2),
        (
            item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 5.0, frame=10),
            dialect.MAV_MISSION_UNSUPPORTED_FRAME,
        ),
        (
            item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 5.0, frame=1),
            dialect.MAV_MISSION_UNSUPPORTED_FRAME,
        ),
        (item(dialect.MAV_CMD_NAV_FENCE_RETURN_POINT, 0.0, 0.0), dialect.MAV_MISSION_INVALID_PARAM5_X),
        (
            PlanItem(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0, (5.0, 0.0, 0.0, 0.0), 900000001, 0, 0.0),
            dialect.MAV_MISSION_INVALID_PARAM5_X,
        ),
        (
            PlanItem(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0, (5.0, 0.0, 0.0, 0.0), 1, 1800000001, 0.0),
            dialect.MAV_MISSION_INVALID_PARAM6_Y,
        ),
    ],
)
def test_bad_items(bad: PlanItem, result: int) -> None:
    fault = FenceKind().check_item(bad)
    assert fault is not None
    assert fault.result == result


@pytest.mark.parametrize(
    ("items", "words"),
    [
        (corners(5001, 4)[:3], "item 0: not 4 corners"),
        (
            [item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 5.0), *corners(5001, 4)[:2], *corners(5002, 4)],
            "item 1: ",
        ),
        ([*corners(5001, 4)[:3], *corners(5001, 4, 1.0)[3:]], "item 0: "),
        ([*corners(5001, 4)[:3], *corners(5001, 5)], "item 0: "),
        (
            [item(dialect.MAV_CMD_NAV_FENCE_RETURN_POINT), item(dialect.MAV_CMD_NAV_FENCE_RETURN_POINT)],
            "more than one return point",
        ),
        ([item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, LAT, LON, 3.0)] * 3, "has no area"),
        (
            [item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, LAT + n * 1e-3, LON, 3.0) for n in range(3)],
            "has no area",
        ),
    ],
)
def test_bad_plans(items: list[PlanItem], words: str) -> None:
    fault = FenceKind().check_plan(items)
    assert fault is not None
    assert words in fault.reason


def test_an_exclusion_polygon_has_no_group() -> None:
    mixed = [*corners(5002, 4, 1.0)[:2], *corners(5002, 4, 2.0)[2:]]
    assert FenceKind().check_plan(mixed) is None


# The watch.

HERE = (LAT, LON)


def beside(north: float = 0.0, east: float = 0.0) -> tuple[float, float]:
    """m from the middle of the fence."""
    return geo.destination(LAT, LON, north, east)


def sight(north: float = 0.0, east: float = 0.0, speed: tuple[float, float] = (0.0, 0.0), **more: Any) -> Sight:
    seen = Sight(
        beside(north, east), 0.0, speed, 10.0, 150.0, HERE, airborne=True, flying=True, steering=True, orders=1
    )
    return replace(seen, **more)


def watching(action: Reaction = Reaction.HOLD, radius: float = 100.0) -> FenceWatch:
    watch = FenceWatch()
    watch.action = action
    watch.take([item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, radius)])
    return watch


SEEN = {
    Event.SAFE: sight(0.0),
    Event.AHEAD: sight(85.0, speed=(9.0, 0.0)),  # 9 m/s: 5.4 m until it brakes, 16.2 m until it stands
    Event.BREACH: sight(120.0),
}


@pytest.mark.parametrize("event", Event)
@pytest.mark.parametrize("state", State)
def test_every_event_in_every_state(state: State, event: Event) -> None:
    watch = watching()
    if state is State.LEAVING:
        watch.look(SEEN[Event.AHEAD], 0.0)
        watch.done(2)
    elif state is State.OUTSIDE:
        watch.look(SEEN[Event.BREACH], 0.0)
        watch.done(2)
    assert watch.state is state
    for now in (1.0, 1.0 + CALM):
        watch.look(SEEN[event], now)
    assert watch.state is TRANSITIONS[state].get(event, state)


def test_every_state_can_be_left_and_reached() -> None:
    assert set(TRANSITIONS) == set(State)
    assert {to for row in TRANSITIONS.values() for to in row.values()} == set(State)


def test_fence_rests_on_the_ground_only_when_nothing_is_left_of_a_breach() -> None:
    landed = sight(0.0, airborne=False, flying=False)
    watch = watching(Reaction.HOLD)
    watch.floor = 5.0
    assert watch.rests
    watch.look(sight(0.0), 0.0)
    assert not watch.rests  # the floor counts from now on
    watch.look(landed, 1.0)
    assert watch.rests
    assert watch.look(sight(120.0, ato=1.0), 2.0) is Reaction.HOLD
    assert not watch.rests  # the action is under way
    watch.done(2)
    for now in (3.0, 3.0 + CALM / 2.0):
        watch.look(landed, now)
        assert not watch.rests  # not calm for long enough
    watch.look(landed, 3.0 + CALM)
    assert watch.rests


@pytest.mark.parametrize("action", Reaction)
def test_a_breach_is_acted_upon_once(action: Reaction) -> None:
    watch = watching(action)
    assert watch.look(sight(99.0), 0.0) is None
    first = watch.look(sight(103.0), 1.0)
    assert first is (None if action is Reaction.NONE else action)
    assert (watch.breach, watch.breaches, watch.breached_at, watch.healthy) == (Breach.BOUNDARY, 1, 1.0, False)
    assert watch.verdict is not None
    assert watch.verdict.text == "3 m beyond inclusion 0"
    if first not in (None, Reaction.WARN):
        assert watch.look(sight(105.0), 1.5) is None  # under way
        watch.done(2)
    for now, metres, orders in ((2.0, 110.0, 2), (3.0, 120.0, 7), (4.0, 103.0, 7), (5.0, 99.0, 7), (6.0, 102.0, 7)):
        assert watch.look(sight(metres, orders=orders), now) is None
    assert watch.breaches == 1
    # Well inside it counts as back, and the next time is another time.
    inside = sight(100.0 - BACK_INSIDE - 0.1, orders=7)
    watch.look(inside, 7.0)
    watch.look(sight(99.0, orders=7), 7.5)  # not yet
    for now in (8.0, 8.0 + CALM):
        assert watch.state is State.OUTSIDE
        watch.look(inside, now)
    assert (watch.state, watch.verdict, watch.healthy) == (State.INSIDE, None, True)
    assert watch.look(sight(103.0, orders=7), 11.0) is (None if action is Reaction.NONE else action)
    assert watch.breaches == 2


def test_fence_acts_before_the_boundary() -> None:
    """At 10 m/s a drone goes 6 m before it brakes and 20 m until it stands."""
    watch = watching()
    assert watch.look(sight(73.0, speed=(10.0, 0.0)), 0.0) is None
    assert watch.look(sight(75.0, speed=(10.0, 0.0)), 0.2) is Reaction.HOLD
    assert watch.state is State.LEAVING
    assert watch.breaches == 0
    assert watch.healthy
    watch.done(2)
    # It brakes; no one has taken it over, so nothing is said again.
    assert watch.look(sight(90.0, speed=(6.0, 0.0), orders=2), 1.0) is None
    # It comes to rest two metres too far: nothing better can be done, but everybody hears of it.
    assert watch.look(sight(102.0, orders=2), 3.0) is Reaction.WARN
    assert watch.breaches == 1


def test_drone_continuing_outward_is_stopped_again() -> None:
    watch = watching()
    assert watch.look(sight(85.0, speed=(9.0, 0.0)), 0.0) is Reaction.HOLD
    watch.done(2)
    assert watch.look(sight(95.0, speed=(0.0, 0.0), orders=2), 1.0) is None
    assert watch.look(sight(95.0, speed=(6.0, 0.0), orders=3), 2.0) is Reaction.HOLD
    watch.done(4)
    assert watch.look(sight(101.0, speed=(6.0, 0.0), orders=5), 3.0) is Reaction.HOLD


def test_flickering_estimate_is_one_approach() -> None:
    """Each position corrects where the drone was thought to be."""
    watch = watching(Reaction.WARN)
    assert watch.look(sight(75.0, speed=(10.0, 0.0)), 0.0) is Reaction.WARN
    for now in (0.2, 0.4, 0.6, 0.8):
        assert watch.look(sight(72.0, speed=(10.0, 0.0)), now) is None
        assert watch.look(sight(75.0, speed=(10.0, 0.0)), now + 0.1) is None
    assert watch.look(sight(101.0, speed=(10.0, 0.0)), 3.0) is Reaction.WARN
    assert watch.state is State.OUTSIDE


def test_a_way_along_the_boundary_is_nobodys_business() -> None:
    watch = watching(radius=1000.0)
    assert watch.look(sight(0.0, 990.0, speed=(1.0, 0.0)), 0.0) is None
    assert watch.look(sight(0.0, 970.0, speed=(0.0, -15.0)), 0.0) is None


@pytest.mark.parametrize("more", [{"steering": False}, {"flying": False}])
def test_moves_and_returns_are_not_stopped_ahead(more: dict[str, bool]) -> None:
    watch = watching()
    assert watch.look(sight(90.0, speed=(15.0, 0.0), **more), 0.0) is None
    assert watch.state is State.INSIDE


def test_without_prediction() -> None:
    watch = watching()
    watch.predict = False
    assert watch.look(sight(99.0, speed=(15.0, 0.0)), 0.0) is None
    assert watch.look(sight(101.0, speed=(15.0, 0.0)), 0.2) is Reaction.HOLD


def test_return_or_landing_outside_is_reported_and_continues() -> None:
    watch = watching(Reaction.LAND)
    assert watch.look(sight(110.0, flying=False), 0.0) is Reaction.WARN
    assert watch.look(sight(120.0, flying=False), 1.0) is None
    assert watch.look(sight(120.0, flying=True), 2.0) is None  # it hovers where its return ended: once is once
    assert watch.breaches == 1


def test_breach_during_a_takeoff_is_acted_upon_when_the_drone_hovers() -> None:
    watch = watching(Reaction.LAND)
    assert watch.look(sight(110.0, flying=False, takes_off=True), 0.0) is Reaction.WARN
    assert watch.look(sight(110.0, flying=False, takes_off=True), 1.0) is None
    assert watch.look(sight(110.0), 2.0) is Reaction.LAND
    watch.done(orders=2)
    assert watch.look(sight(110.0, orders=2), 3.0) is None
    assert watch.rests is False
    assert watch.breaches == 1


@pytest.mark.parametrize("newer", [{"orders": 2}, {"flying": False}])
def test_breach_during_a_takeoff_ends_with_a_newer_command_or_a_landing(newer: dict[str, Any]) -> None:
    watch = watching(Reaction.LAND)
    assert watch.look(sight(110.0, flying=False, takes_off=True), 0.0) is Reaction.WARN
    assert watch.look(sight(110.0, **newer), 1.0) is None
    assert watch.look(sight(110.0, orders=2), 2.0) is None


def test_breach_during_a_takeoff_that_drifts_back_is_none() -> None:
    watch = watching(Reaction.LAND)
    assert watch.look(sight(110.0, flying=False, takes_off=True), 0.0) is Reaction.WARN
    for now in (1.0, 1.0 + CALM):
        assert watch.look(sight(0.0), now) is None
    assert watch.state is State.INSIDE


def test_on_the_ground_there_is_no_breach() -> None:
    watch = watching()
    assert watch.look(sight(500.0, airborne=False, flying=False), 0.0) is None
    assert watch.healthy
    assert watch.state is State.INSIDE


def test_positions_are_carried_on() -> None:
    """The newest position is 0.8 s old, and the drone has flown on at 10 m/s since."""
    watch = watching()
    watch.predict = False
    assert watch.look(sight(91.0, speed=(10.0, 0.0), age=0.8), 0.0) is None
    assert watch.look(sight(93.0, speed=(10.0, 0.0), age=0.8), 0.0) is Reaction.HOLD


def test_without_a_position_nothing_is_known() -> None:
    watch = watching()
    assert watch.look(sight(150.0, age=STALE + 0.1), 0.0) is None
    assert watch.blind
    assert not watch.healthy
    assert watch.look(replace(sight(), place=None), 1.0) is None
    assert watch.blind
    watch.look(sight(), 2.0)
    assert not watch.blind


def test_failed_action_is_repeated() -> None:
    watch = watching()
    assert watch.look(sight(110.0), 0.0) is Reaction.HOLD
    watch.failed(0.5)
    assert watch.look(sight(110.0), 0.5 + RETRY - 0.1) is None
    assert watch.look(sight(110.0), 0.5 + RETRY) is Reaction.HOLD
    watch.done(2)
    assert watch.look(sight(110.0), 10.0) is None
    assert watch.breaches == 1


def test_action_ended_by_a_command_is_not_repeated_outside() -> None:
    watch = watching()
    assert watch.look(sight(110.0), 0.0) is Reaction.HOLD
    watch.failed(0.5, replaced=True)
    assert watch.look(sight(110.0, orders=2), 0.5 + RETRY) is None
    assert watch.look(sight(110.0, orders=3), 60.0) is None
    for now in (70.0, 70.0 + CALM):
        assert watch.look(sight(50.0), now) is None
    assert watch.look(sight(110.0), 80.0) is Reaction.HOLD  # another breach


def test_action_ahead_ended_by_a_command_is_repeated() -> None:
    watch = watching()
    assert watch.look(sight(85.0, speed=(9.0, 0.0)), 0.0) is Reaction.HOLD
    watch.failed(0.5, replaced=True)
    assert watch.look(sight(87.0, speed=(8.0, 0.0), orders=2), 0.7) is None
    assert watch.look(sight(92.0, speed=(8.0, 0.0), orders=2), 0.5 + RETRY) is Reaction.HOLD


def test_failed_action_is_discarded_inside() -> None:
    watch = watching()
    watch.look(sight(110.0), 0.0)
    watch.failed(0.0)
    for now in (10.0, 10.0 + CALM):
        assert watch.look(sight(50.0), now) is None
    assert watch.state is State.INSIDE


def test_floor_counts_once_the_drone_was_above_it() -> None:
    watch = FenceWatch()
    watch.floor = 5.0
    assert watch.look(sight(ato=2.5), 0.0) is None
    assert watch.look(sight(ato=6.0), 1.0) is None
    assert watch.look(sight(ato=4.5), 2.0) is None  # within a metre
    assert watch.look(sight(ato=3.0), 3.0) is Reaction.HOLD
    assert watch.breach is Breach.FLOOR
    watch.done(2)
    watch.look(sight(ato=0.0, airborne=False, flying=False), 4.0)
    assert watch.look(sight(ato=2.5), 5.0) is None  # the next flight
    with pytest.raises(OutsideFence, match="floor"):
        watch.check_height(4.0)
    watch.check_height(5.0)


def test_the_ceiling_is_the_drones_to_keep() -> None:
    watch = watching(Reaction.LAND)
    assert watch.look(sight(ato=151.5), 0.0) is Reaction.WARN
    assert watch.breach is Breach.CEILING
    assert watch.look(sight(ato=150.5), 1.0) is None
    watch.disable(CEILING)
    assert watch.look(sight(ato=160.0), 2.0) is None


# More than one boundary: the zones are a circle of 100 m, the floor is at 10 m, the ceiling at 150 m.


def beyond(ato: float, action: Reaction = Reaction.HOLD, *, orders: int = 2) -> FenceWatch:
    """A person has flown to this height, which is beyond floor or ceiling, and what that brings about was done."""
    watch = watching(action)
    watch.floor = 10.0
    assert watch.look(sight(ato=12.0), 0.0) is None
    assert watch.look(sight(ato=ato), 1.0) is not None
    watch.done(orders)
    assert (watch.state, watch.breaches) == (State.OUTSIDE, 1)
    return watch


@pytest.mark.parametrize(("ato", "kind"), [(8.0, Breach.FLOOR), (152.0, Breach.CEILING)])
def test_beyond_floor_or_ceiling_the_zones_hold(ato: float, kind: Breach) -> None:
    watch = beyond(ato)
    assert watch.breach is kind
    assert watch.look(sight(75.0, speed=(10.0, 0.0), ato=ato, orders=3), 2.0) is Reaction.HOLD
    assert watch.verdict is not None
    assert (watch.verdict.ahead, watch.verdict.breach) == (True, Breach.BOUNDARY)
    assert (watch.state, watch.breach, watch.breaches) == (State.OUTSIDE, kind, 1)
    watch.done(4)
    assert watch.look(sight(90.0, speed=(5.0, 0.0), ato=ato, orders=4), 3.0) is None  # it brakes
    assert watch.look(sight(103.0, ato=ato, orders=5), 4.0) is Reaction.HOLD  # a person has flown on
    assert watch.verdict.text == "3 m beyond inclusion 0"
    assert not watch.verdict.ahead
    assert (watch.breach, watch.breaches, watch.breached_at) == (Breach.BOUNDARY, 2, 4.0)
    watch.done(6)
    assert watch.look(sight(110.0, ato=ato, orders=7), 5.0) is None  # he may fly back


@pytest.mark.parametrize("action", [Reaction.WARN, Reaction.RETURN, Reaction.LAND, Reaction.TERMINATE])
def test_each_boundary_has_the_action(action: Reaction) -> None:
    watch = beyond(8.0, action)
    assert watch.look(sight(103.0, ato=8.0, orders=3), 2.0) is action


def test_beyond_the_zones_the_floor_holds() -> None:
    watch = watching()
    watch.floor = 10.0
    assert watch.look(sight(103.0, ato=12.0), 0.0) is Reaction.HOLD
    watch.done(2)
    assert watch.look(sight(103.0, ato=8.0, orders=3), 1.0) is Reaction.HOLD
    assert (watch.breach, watch.breaches) == (Breach.FLOOR, 2)


def test_beyond_two_boundaries_nothing_is_done_again() -> None:
    """Both estimates go to and fro over their boundaries for two minutes, and a person flies it all the time."""
    watch = beyond(8.0)
    assert watch.look(sight(103.0, ato=8.0, orders=3), 2.0) is Reaction.HOLD
    watch.done(4)
    for n in range(240):
        metres, ato = (95.0, 103.0)[n % 2], (8.0, 9.5)[n // 2 % 2]
        assert watch.look(sight(metres, ato=ato, orders=5 + n), 3.0 + n / 2.0) is None
    assert (watch.state, watch.breaches) == (State.OUTSIDE, 2)


def test_zones_act_again_after_return_inside_below_the_floor() -> None:
    watch = beyond(8.0)
    assert watch.look(sight(103.0, ato=8.0, orders=3), 2.0) is Reaction.HOLD
    watch.done(4)
    for now in (3.0, 3.0 + CALM):
        assert watch.look(sight(50.0, ato=8.0, orders=5), now) is None
    assert watch.state is State.OUTSIDE  # below the floor
    assert watch.look(sight(103.0, ato=8.0, orders=5), 6.0) is Reaction.HOLD
    assert watch.breaches == 3
    watch.done(6)
    for now in (7.0, 7.0 + CALM):
        assert watch.look(sight(50.0, ato=12.0, orders=7), now) is None
    assert (watch.state, watch.verdict, watch.healthy) == (State.INSIDE, None, True)


def test_two_breaches_at_once_are_both_reported() -> None:
    watch = watching()
    watch.floor = 10.0
    watch.look(sight(ato=12.0), 0.0)
    assert watch.look(sight(103.0, ato=8.0), 1.0) is Reaction.HOLD
    assert watch.look(sight(104.0, ato=7.0), 1.2) is Reaction.WARN  # the hold is under way, and serves both
    assert watch.verdict is not None
    assert watch.verdict.breach is Breach.FLOOR
    assert watch.look(sight(105.0, ato=7.0), 1.4) is None
    watch.failed(2.0)
    assert watch.look(sight(106.0, ato=7.0), 2.0 + RETRY) is Reaction.HOLD
    watch.done(2)
    assert watch.look(sight(106.0, ato=7.0, orders=2), 10.0) is None
    assert watch.breaches == 2


def test_ceiling_with_action_warn_does_not_stop_the_drone() -> None:
    """So it does not pass for the hold that brakes a vehicle before the zones."""
    watch = watching()
    assert watch.look(sight(85.0, speed=(9.0, 0.0)), 0.0) is Reaction.HOLD
    watch.done(2)
    assert watch.look(sight(95.0, ato=152.0, orders=3), 1.0) is Reaction.WARN
    assert watch.look(sight(101.0, ato=152.0, orders=3), 2.0) is Reaction.HOLD


def test_fence_watch_present_in_force_and_enabled() -> None:
    watch = FenceWatch()
    assert (watch.present, watch.in_force, watch.is_on) == (False, False, True)
    watch.take(
        [
            item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 100.0),
            item(dialect.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION, 0.0, 0.0, 50.0, 0.0),
        ]
    )
    watch.floor = 3.0
    assert (watch.present, watch.in_force) == (True, True)
    assert len(watch.zones.zones) == 2
    watch.disable(HOME_CIRCLE)
    assert [zone.name for zone in watch.zones.zones] == ["inclusion 0"]
    watch.enable(HOME_CIRCLE)
    watch.disable(ZONES)
    assert [zone.name for zone in watch.zones.zones] == ["home circle 1"]
    watch.disable()
    assert (watch.present, watch.in_force, watch.is_on, watch.enabled) == (True, False, False, 0)
    assert watch.look(sight(500.0, ato=0.0), 0.0) is None
    watch.enable(FLOOR)
    assert (watch.in_force, watch.enabled) == (True, FLOOR)
    watch.enable()
    assert watch.enabled == EVERYTHING


def test_chosen_kinds_of_boundaries_and_the_switch_of_the_fence_are_independent() -> None:
    watch = FenceWatch()
    watch.floor = 3.0
    watch.disable()
    watch.choose(CEILING | FLOOR)
    assert (watch.is_on, watch.in_force, watch.enabled) == (False, False, 0)
    watch.enable()
    assert (watch.is_on, watch.in_force, watch.enabled) == (True, True, CEILING | FLOOR)


def test_places_are_asked_for_before() -> None:
    watch = watching()
    watch.check_place(beside(99.0), HERE)
    with pytest.raises(OutsideFence, match=r"^20 m beyond inclusion 0$"):
        watch.check_place(beside(120.0), HERE)
    with pytest.raises(OutsideFence, match="no GPS fix") as info:
        watch.check_place(None, HERE)
    assert not info.value.lasting
    watch.take(
        [
            item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 100.0),
            item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, LAT, LON, 20.0),
        ]
    )
    with pytest.raises(OutsideFence, match="path crosses exclusion 1"):
        watch.check_place(beside(50.0), HERE, beside(-50.0))
    watch.check_place(beside(50.0), HERE, beside(50.0, 30.0))
    watch.check_place(beside(50.0), HERE, beside(0.0))  # out of the hole, whichever way
    watch.action = Reaction.NONE
    watch.check_place(beside(500.0), HERE)
    FenceWatch().check_place(None, None)


def test_another_fence_is_another_matter() -> None:
    watch = watching()
    watch.look(sight(110.0), 0.0)
    watch.done(2)
    watch.take([item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, LAT, LON, 105.0)])
    assert watch.look(sight(110.0, orders=2), 1.0) is Reaction.HOLD


def test_numbers_of_actions() -> None:
    wanted = [Reaction.NONE, Reaction.WARN, Reaction.HOLD, Reaction.RETURN, Reaction.TERMINATE, Reaction.LAND]
    assert [PX4_ACTIONS[n] for n in range(6)] == wanted
    copter = [Reaction.WARN, Reaction.RETURN, Reaction.LAND, Reaction.HOLD]
    assert [ARDUPILOT_ACTIONS[n] for n in (0, 1, 2, 4)] == copter

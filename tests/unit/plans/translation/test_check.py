"""Lint of flight plans: what is found, by hand, and the sample missions."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.plan_samples import LAT, LON, action, waypoint

from anafi_mav import mav_enums
from anafi_mav.models import planned
from anafi_mav.plans.formats import files
from anafi_mav.plans.plan import GLOBAL, RELATIVE, FenceCircle, FencePolygon, Item, Plan, Point
from anafi_mav.plans.translation.check import Findings, FindingSeverity, FlightLimits, check
from anafi_mav.sim.world.model import MODELS as SIMULATED

MISSIONS = Path(__file__).parents[4] / "missions"
HOME = Point(LAT, LON, 35.0)
MODELS = planned()

UP = Item(mav_enums.MAV_CMD_NAV_TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, None, None, None, 20.0))
BACK = action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)


def found(*items: Item, model: str = "4k", limits: FlightLimits | None = None, **more: object) -> Findings:
    return check(Plan(tuple(items), **{"home": HOME, **more}), MODELS[model], limits)  # type: ignore[arg-type]


def observed(findings: Findings, severity: FindingSeverity = FindingSeverity.ERROR) -> list[str]:
    return [str(problem) for problem in findings.problems if problem.severity is severity]


def test_a_flight_by_hand() -> None:
    """5 s of take-off, up 20 m at 3 m/s, 111.2 m north at 4, 10 s there, a photo of 2 s, back at 4, down 20 m at 1."""
    findings = found(
        UP,
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0),
        waypoint(10, 0, 20.0, 10.0),
        action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0),
        BACK,
    )
    assert findings.problems == ()
    assert findings.distance == pytest.approx(20.0 + 2 * 111.2, abs=0.1)
    assert findings.seconds == pytest.approx(5.0 + 20.0 / 3.0 + 27.8 + 10.0 + 2.0 + 27.8 + 20.0, abs=0.1)


def test_planner_speed_counts_without_a_mission_speed() -> None:
    slow, fast = found(UP, waypoint(10, 0), BACK), found(UP, waypoint(10, 0), BACK, hover_speed=10.0)
    assert slow.seconds is not None
    assert fast.seconds is not None
    assert slow.seconds - fast.seconds == pytest.approx(2 * 111.2 * (1 / 5.0 - 1 / 10.0), abs=0.1)


def test_check_names_each_item_that_cannot_fly() -> None:
    findings = found(UP, action(mav_enums.MAV_CMD_DO_SET_SERVO, 1.0), waypoint(1, 0, frame=10))
    assert observed(findings) == [
        "item 1: DO_SET_SERVO: the drone has no actuator that a flight plan could move",
        "item 2: NAV_WAYPOINT: heights above terrain are unsupported",
    ]
    assert findings.errors
    assert (findings.distance, findings.seconds) == (None, None)
    assert observed(found()) == ["it has no mission"]


def test_heights() -> None:
    items = (UP, waypoint(1, 0, 120.0), waypoint(2, 0, -3.0), BACK)
    assert observed(found(*items)) == ["item 2: -3 m is below the take-off"]
    assert observed(found(*items, limits=FlightLimits(max_altitude=100.0))) == [
        "item 1: 120 m above take-off is higher than the limit of 100 m",
        "item 2: -3 m is below the take-off",
    ]
    assert observed(found(UP, waypoint(1, 0, 120.0), BACK, home=Point(LAT, LON, 4400.0))) == [
        "item 1: 4520 m above the sea is higher than an ANAFI 4K flies"
    ]
    assert observed(found(UP, waypoint(1, 0, 135.0, frame=GLOBAL), BACK, limits=FlightLimits(max_altitude=99.0))) == [
        "item 1: 100 m above take-off is higher than the limit of 99 m"
    ]


def test_check_without_home_has_no_amsl_heights() -> None:
    findings = found(UP, waypoint(1, 0, 60.0, frame=GLOBAL), BACK, home=None)
    assert observed(findings) == []
    assert observed(findings, FindingSeverity.WARNING) == [
        "item 1: height above mean sea level, but that of the take-off point is unknown: its path cannot be checked"
    ]


def test_the_fence() -> None:
    """The circle is 50 m wide; the way to item 2 leads through the forbidden square and ends outside of it."""
    circle = found(UP, waypoint(9, 0), BACK, zones=(FenceCircle(True, (LAT, LON), 50.0),))
    assert observed(circle) == ["item 1: the way there leaves the fence (inclusion circle 0)"]
    square = tuple((LAT + north * 1e-4, LON + east * 1e-4) for north, east in ((4, -1), (4, 1), (6, 1), (6, -1)))
    through = found(UP, waypoint(3, 0), waypoint(7, 0), waypoint(7, 5), BACK, zones=(FencePolygon(False, square),))
    assert observed(through) == ["item 2: the way there leaves the fence (exclusion polygon 0)"]
    outside = found(UP, waypoint(1, 0), BACK, zones=(FenceCircle(True, (LAT + 0.01, LON), 50.0),))
    assert "it begins outside the fence" in observed(outside)


def test_distances() -> None:
    assert observed(found(UP, waypoint(20, 0), BACK, limits=FlightLimits(max_distance=200.0))) == [
        "item 1: it is 222 m from home, the limit is 200 m"
    ]
    assert observed(found(UP, waypoint(540, 0), BACK))[0] == (
        "item 1: it is 6.0 km from home, where no setting lets the drone fly"
    )
    begins_there = found(waypoint(100, 0), BACK)
    assert observed(begins_there) == []
    far_take_off = Item(mav_enums.MAV_CMD_NAV_TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, None, None, None, 0.0))
    assert "item 1: it is 1112 m from home: the drone may refuse to begin so far away" in observed(
        found(far_take_off, waypoint(100, 0), BACK), FindingSeverity.WARNING
    )


def test_speeds() -> None:
    items = (UP, action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 15.5), waypoint(1, 0), BACK)
    assert observed(found(*items)) == ["item 1: 15.5 m/s is more than the 15 that an ANAFI 4K flies"]
    assert observed(found(*items, model="ai")) == []


def test_the_battery() -> None:
    assert observed(found(UP, action(mav_enums.MAV_CMD_NAV_DELAY, 1500.0), BACK)) == [
        "it takes 26 min of the 25 that an ANAFI 4K flies"
    ]
    findings = found(UP, action(mav_enums.MAV_CMD_NAV_DELAY, 1500.0), BACK, model="usa")
    assert (observed(findings), observed(findings, FindingSeverity.WARNING)) == (
        [],
        [],
    )
    assert observed(
        found(UP, action(mav_enums.MAV_CMD_NAV_DELAY, 1700.0), BACK, model="usa"), FindingSeverity.WARNING
    ) == ["it takes 29 min of the 32 that an ANAFI USA flies"]


def test_a_plan_without_an_end() -> None:
    findings = found(UP, waypoint(1, 0), waypoint(2, 0), action(mav_enums.MAV_CMD_DO_JUMP, 1.0, -1.0))
    assert not findings.errors
    assert "it is flown until the battery is low" in observed(findings, FindingSeverity.WARNING)
    assert findings.seconds is None
    assert observed(found(UP, waypoint(1, 0)), FindingSeverity.WARNING) == [
        "it ends in the air: the drone hovers there until the battery is low"
    ]


def test_how_an_ai_begins() -> None:
    """At its return height above the first way point, if that is lower (Parrot's flight plan page)."""
    low = Item(mav_enums.MAV_CMD_NAV_TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, None, None, None, 10.0))
    findings = found(low, waypoint(1, 0, 10.0), BACK, model="ai", limits=FlightLimits(return_height=30.0))
    assert observed(findings, FindingSeverity.WARNING) == [
        "item 0: an Ai begins at 30 m above take-off: it rises there first, goes over to above it and sinks"
    ]
    assert observed(found(low, waypoint(1, 0, 10.0), BACK), FindingSeverity.WARNING) == []
    high = found(
        low, waypoint(1, 0, 10.0), BACK, model="ai", limits=FlightLimits(max_altitude=25.0, return_height=30.0)
    )
    assert observed(high) == ["item 0: 30 m above take-off is higher than the limit of 25 m"]


def test_check_names_items_flown_by_the_gateway() -> None:
    findings = found(UP, action(mav_enums.MAV_CMD_SET_CAMERA_ZOOM, 2.0, 50.0), waypoint(1, 0), BACK)
    assert observed(findings, FindingSeverity.WARNING) == [
        "item 1: flown by the gateway: SET_CAMERA_ZOOM: the gateway zooms: a flight plan cannot"
    ]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.plan")), ids=lambda path: path.stem)
def test_the_samples_can_be_flown(path: Path, model: str) -> None:
    findings = check(files.load(path), MODELS[model])
    assert observed(findings) == []
    assert findings.distance is not None
    assert 100.0 < findings.distance < 1000.0


def test_the_figures_are_those_of_the_simulated_drones() -> None:
    """Two tables of one paper: the simulator flies by its own."""
    assert set(MODELS) == set(SIMULATED)
    for name, model in MODELS.items():
        simulated = SIMULATED[name]
        figures = model.plans()
        assert (figures.version, figures.max_speed) == (simulated.plan_version, simulated.airframe.max_speed)
        assert figures.flight_time == simulated.airframe.flight_time
        assert figures.ceiling == simulated.envelope.ceiling

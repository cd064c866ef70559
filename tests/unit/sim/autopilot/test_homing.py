"""Home and the return home of the simulated drone."""

from __future__ import annotations

import math

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, common, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MoveByError, MoveToStatus, NavigateHomeReason
from anafi_mav.arsdk.messages.rth import RthEndingBehavior, RthHomeType, RthState, StateReason

UNKNOWN = (500.0, 500.0, 500.0)


@pytest.fixture
def bench() -> Bench:
    """In the air, 30 m north of home, hovering, facing west."""
    bench = Bench()
    bench.take_off()
    bench.send(ardrone3.MoveBy(30.0, 0.0, -2.0, -math.pi / 2))
    bench.run_until(lambda: bool(bench.of(ardrone3.MoveByEnd)))
    bench.rest()
    bench.events.clear()
    return bench


def returns(bench: Bench) -> list[tuple[RthState, StateReason]]:
    return [(event.state, event.reason) for event in bench.of(rth.State)]


def finished(bench: Bench) -> bool:
    return (RthState.AVAILABLE, StateReason.FINISHED) in returns(bench)


def homes(bench: Bench) -> list[tuple[float, float, float]]:
    return [(event.latitude, event.longitude, event.altitude) for event in bench.of(ardrone3.HomeChanged)]


# -- places


def test_no_home_before_take_off() -> None:
    bench = Bench()
    assert homes_of_report(bench) == UNKNOWN
    bench.take_off()
    latitude, longitude, altitude = homes(bench)[-1]
    assert (latitude, longitude) == pytest.approx(HOME[:2], abs=1e-9)
    assert altitude == pytest.approx(0.0, abs=0.05)  # above take-off
    assert bench.of(rth.TakeoffLocation)[-1].fixed_before_takeoff == 1
    assert homes_of_report(bench) == homes(bench)[-1]


def homes_of_report(bench: Bench) -> tuple[float, float, float]:
    (event,) = bench.firmware.homing.settings_report()
    assert isinstance(event, ardrone3.HomeChanged)
    return event.latitude, event.longitude, event.altitude


def test_takeoff_without_gps_gets_home_with_first_fix() -> None:
    bench = Bench()
    bench.faults.gps = False
    bench.run(0.1)
    bench.take_off()
    assert homes(bench) == [UNKNOWN]
    assert bench.of(rth.State)[-1] == rth.State(RthState.UNAVAILABLE, StateReason.DISABLED)
    assert bench.send(rth.ReturnToHome()) == []
    bench.send(ardrone3.MoveBy(10.0, 0.0, 0.0, 0.0))
    bench.run_until(lambda: bool(bench.of(ardrone3.MoveByEnd)))
    bench.faults.gps = True
    bench.run(0.1)
    there = geo.offset(*HOME[:2], *homes(bench)[-1][:2])
    assert there == pytest.approx((10.0, 0.0), abs=0.2)
    assert bench.of(rth.TakeoffLocation)[-1].fixed_before_takeoff == 0
    assert returns(bench)[-1] == (RthState.AVAILABLE, StateReason.ENABLED)


def test_preferred_custom_home_is_used(bench: Bench) -> None:
    wanted = (*geo.destination(HOME[0], HOME[1], 0.0, 40.0), 0.0)
    bench.send(rth.SetCustomLocation(*wanted))
    assert bench.of(rth.CustomLocation)[-1] == rth.CustomLocation(*wanted)
    assert bench.of(rth.HomeType)[-1].type is RthHomeType.TAKEOFF
    bench.send(rth.SetPreferredHomeType(RthHomeType.CUSTOM))
    assert bench.of(rth.PreferredHomeType)[-1].type is RthHomeType.CUSTOM
    assert bench.of(rth.HomeType)[-1].type is RthHomeType.CUSTOM
    assert homes(bench)[-1] == wanted
    bench.send(rth.ReturnToHome())
    bench.run_until(lambda: finished(bench))
    assert (bench.pose.north, bench.pose.east) == pytest.approx((0.0, 40.0), abs=0.3)


def test_a_custom_home_out_of_reach_is_not_taken(bench: Bench) -> None:
    bench.send(rth.SetPreferredHomeType(RthHomeType.CUSTOM))
    far = geo.destination(HOME[0], HOME[1], -80.0, 0.0)  # 110 m from here, MaxDistance is 100 m
    bench.send(rth.SetCustomLocation(*far, 0.0))
    assert bench.of(rth.CustomLocation)[-1] == rth.CustomLocation(*UNKNOWN)
    assert bench.of(rth.HomeType)[-1].type is RthHomeType.TAKEOFF


def test_the_pilot_as_home(bench: Bench) -> None:
    bench.send(rth.SetPreferredHomeType(RthHomeType.PILOT))
    assert bench.of(rth.HomeType)[-1].type is RthHomeType.TAKEOFF  # where the pilot is no one knows yet
    pilot = geo.destination(HOME[0], HOME[1], 20.0, 20.0)
    answer = bench.send(ardrone3.SendControllerGPS(*pilot, 35.0, 2.0, 3.0))
    assert answer[0] == ardrone3.GPSFixStateChanged(1)  # what Parrot's XML promises
    assert bench.of(rth.HomeType)[-1].type is RthHomeType.PILOT
    assert homes(bench)[-1][:2] == pilot


def test_lost_fix_prevents_home_and_return(bench: Bench) -> None:
    bench.faults.gps = False
    bench.run(0.1)
    assert bench.of(rth.HomeType)[-1].type is RthHomeType.NONE
    assert returns(bench) == [(RthState.UNAVAILABLE, StateReason.DISABLED)]
    assert bench.send(rth.ReturnToHome()) == []
    bench.faults.gps = True
    bench.run(0.1)
    assert bench.of(rth.HomeType)[-1].type is RthHomeType.TAKEOFF
    assert returns(bench)[-1] == (RthState.AVAILABLE, StateReason.ENABLED)


def test_home_type_followee_falls_back_to_takeoff(bench: Bench) -> None:
    bench.send(rth.SetPreferredHomeType(RthHomeType.FOLLOWEE))
    assert bench.of(rth.PreferredHomeType)[-1].type is RthHomeType.TAKEOFF
    capabilities = next(
        event for event in bench.firmware.homing.states_report() if isinstance(event, rth.HomeTypeCapabilities)
    )
    assert capabilities.values == 1 << 1 | 1 << 3 | 1 << 4  # takeoff, custom, pilot


# -- the return


def test_climb_cruise_descend_hover(bench: Bench) -> None:
    answer = bench.send(rth.ReturnToHome())
    assert answer == [
        rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST),
        ardrone3.NavigateHomeStateChanged(ardrone3.NavigateHomeState.IN_PROGRESS, NavigateHomeReason.USER_REQUEST),
    ]
    bench.run_until(lambda: bench.pose.up > 19.5)
    assert bench.pose.north == pytest.approx(30.0, abs=0.3)  # straight up to min_altitude, 20 m
    bench.run_until(lambda: bench.pose.north < 10.0)
    assert bench.pose.up == pytest.approx(20.0, abs=0.3)
    assert abs(bench.pose.yaw) == pytest.approx(math.pi, abs=0.1)  # facing home
    bench.run_until(lambda: finished(bench))
    assert (bench.pose.north, bench.pose.east, bench.pose.up) == pytest.approx((0.0, 0.0, 10.0), abs=0.2)
    bench.rest()
    bench.run(3.0)
    assert bench.state is FlyingState.HOVERING
    assert returns(bench) == [
        (RthState.IN_PROGRESS, StateReason.USER_REQUEST),
        (RthState.AVAILABLE, StateReason.FINISHED),
    ]
    twin = bench.of(ardrone3.NavigateHomeStateChanged)
    assert [(int(event.state), int(event.reason)) for event in twin] == [(1, 0), (0, 3)]


def test_return_from_above_does_not_descend_first(bench: Bench) -> None:
    bench.climb(40.0)
    bench.send(rth.ReturnToHome())
    bench.run_until(lambda: bench.pose.north < 3.0)
    assert bench.pose.up == pytest.approx(40.0, abs=0.3)


def test_the_end_may_be_a_landing(bench: Bench) -> None:
    bench.send(rth.SetEndingBehavior(RthEndingBehavior.LANDING))
    bench.send(rth.ReturnToHome())
    bench.run_until(lambda: bench.state is FlyingState.LANDED, 120.0)
    assert finished(bench)
    assert (bench.pose.north, bench.pose.east, bench.pose.up) == pytest.approx((0.0, 0.0, 0.0), abs=0.2)


def test_a_return_while_flying_waits_for_the_hover(bench: Bench) -> None:
    bench.sticks(2.0, pitch=100)
    bench.send(ardrone3.PCMD(1, 0, 0, 0, 0, 0))
    bench.send(ardrone3.NavigateHome(1))
    assert returns(bench) == [(RthState.PENDING, StateReason.USER_REQUEST)]
    bench.run_until(lambda: len(returns(bench)) == 2)
    assert returns(bench)[1] == (RthState.IN_PROGRESS, StateReason.USER_REQUEST)
    assert bench.pose.ground_speed < 0.2


def test_abort(bench: Bench) -> None:
    assert bench.send(rth.Abort()) == []
    bench.send(ardrone3.NavigateHome(1))
    bench.run(3.0)
    answer = bench.send(ardrone3.NavigateHome(0))
    assert answer == [
        rth.State(RthState.AVAILABLE, StateReason.STOPPED),
        ardrone3.NavigateHomeStateChanged(ardrone3.NavigateHomeState.AVAILABLE, NavigateHomeReason.STOPPED),
    ]
    bench.rest()
    height = bench.pose.up
    bench.run(3.0)
    assert bench.pose.up == pytest.approx(height, abs=0.1)


def test_return_replaces_a_move_and_refuses_the_next(bench: Bench) -> None:
    bench.send(ardrone3.MoveBy(20.0, 0.0, 0.0, 0.0))
    bench.run(2.0)
    bench.send(rth.ReturnToHome())
    assert [event.error for event in bench.of(ardrone3.MoveByEnd)] == [MoveByError.INTERRUPTED]
    bench.send(ardrone3.MoveBy(1.0, 0.0, 0.0, 0.0))
    assert bench.of(ardrone3.MoveByEnd)[-1].error is MoveByError.BUSY
    bench.send(ardrone3.MoveTo(HOME[0], HOME[1], 5.0, ardrone3.OrientationMode.NONE, 0.0))
    assert bench.of(ardrone3.MoveToChanged)[-1].status is MoveToStatus.ERROR
    bench.run_until(lambda: finished(bench))


def test_sticks_do_not_touch_a_return(bench: Bench) -> None:
    bench.send(rth.ReturnToHome())
    bench.sticks(2.0, roll=100, yaw=100)
    assert (bench.pose.north, bench.pose.east) == pytest.approx((30.0, 0.0), abs=0.2)
    bench.run_until(lambda: finished(bench))


@pytest.mark.parametrize("command", [ardrone3.Landing(), ardrone3.Emergency()])
def test_return_is_ended_by_landing_and_emergency(bench: Bench, command: ardrone3.Landing | ardrone3.Emergency) -> None:
    bench.send(rth.ReturnToHome())
    bench.run(1.0)
    bench.send(command)
    assert returns(bench)[-1] == (RthState.AVAILABLE, StateReason.STOPPED)


def test_not_from_the_ground() -> None:
    bench = Bench()
    bench.events.clear()
    bench.send(rth.ReturnToHome())
    bench.send(ardrone3.NavigateHome(1))
    bench.run(1.0)
    assert bench.events == []


# -- the link


def test_lost_link_starts_a_return_after_the_delay(bench: Bench) -> None:
    bench.send(rth.SetDelay(5))
    bench.send(ardrone3.MoveTo(*geo.destination(HOME[0], HOME[1], 90.0, 0.0), 5.0, ardrone3.OrientationMode.NONE, 0.0))
    bench.run(2.0)
    bench.firmware.link_lost()
    assert bench.of(ardrone3.MoveToChanged)[-1].status is MoveToStatus.CANCELED
    assert bench.run_until(lambda: bool(returns(bench))) == pytest.approx(5.0, abs=0.05)
    assert returns(bench) == [(RthState.IN_PROGRESS, StateReason.CONNECTION_LOST)]
    bench.firmware.link_up()  # does not stop it
    bench.run_until(lambda: finished(bench), 120.0)


def test_link_restored_in_time_prevents_the_return(bench: Bench) -> None:
    bench.send(rth.SetDelay(5))
    bench.firmware.link_lost()
    bench.run(4.5)
    bench.firmware.link_up()
    bench.run(3.0)
    assert returns(bench) == []
    assert bench.state is FlyingState.HOVERING


def test_a_lost_link_on_the_ground_is_nothing() -> None:
    bench = Bench()
    bench.send(rth.SetDelay(0))
    bench.events.clear()
    bench.firmware.link_lost()
    bench.run(1.0)
    assert [event for event in bench.events if not isinstance(event, common.BatteryStateChanged)] == []

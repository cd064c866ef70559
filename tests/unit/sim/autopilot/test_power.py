"""What the simulated battery makes the drone do: announce, return, land; and the warnings beside it."""

from __future__ import annotations

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav import geo
from anafi_mav.arsdk.messages import alarms, ardrone3, rth
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType, Type
from anafi_mav.arsdk.messages.ardrone3 import (
    AlertState,
    BatteryCapacityStatus,
    FlyingState,
    ForcedLandingReason,
    LastMotorError,
    Motion,
    MotorError,
    WarningLevel,
)
from anafi_mav.arsdk.messages.rth import (
    AutoTriggerReason,
    RthAutoTriggerMode,
    RthHomeReachability,
    RthState,
    StateReason,
)
from anafi_mav.sim.autopilot.endurance import Endurance
from anafi_mav.sim.features.settings import DroneSettings
from anafi_mav.sim.states import all_settings, all_states
from anafi_mav.sim.world.model import MODELS
from anafi_mav.sim.world.motion import Pose

S = FlyingState
MODEL = MODELS["4k"]
RATE = 100.0 / 1500.0  # percent per second: 25 minutes


def at(north: float, up: float = 20.0) -> Pose:
    return Pose(north, 0.0, up, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def endurance() -> Endurance:
    return Endurance(MODEL, DroneSettings(MODEL, "x"))


def returns(bench: Bench) -> list[tuple[RthState, StateReason]]:
    return [(event.state, event.reason) for event in bench.of(rth.State)]


# -- the reckoning


@pytest.mark.parametrize(
    ("pose", "seconds"),
    [
        (at(0.0), 20.0),  # 20 m down at 2 m/s, 10 s of manoeuvres
        (at(400.0), 70.0),  # and 400 m at 8 m/s
        (at(400.0, 2.0), 76.0),  # and 18 m up to the return height at 3 m/s
        (at(400.0, 60.0), 90.0),  # from above the return height nothing up, but 60 m down
    ],
)
def test_charge_needed_for_the_return(pose: Pose, seconds: float) -> None:
    assert endurance().needed(pose, (0.0, 0.0)) == pytest.approx(seconds * RATE)


@pytest.mark.parametrize(
    ("charge", "reachability", "capacity"),
    [
        # 400 m away 70 s, that is 4.67 %, are needed, and the drone comes down at 4.5 %.
        (16.7, RthHomeReachability.REACHABLE, BatteryCapacityStatus.OK),  # 30.5 s before the return has to begin
        (16.6, RthHomeReachability.REACHABLE, BatteryCapacityStatus.WARNING),  # 29 s
        (11.2, RthHomeReachability.REACHABLE, BatteryCapacityStatus.WARNING),  # 6.7 % left for 6.67 %
        (11.1, RthHomeReachability.CRITICAL, BatteryCapacityStatus.WARNING),
        (9.2, RthHomeReachability.CRITICAL, BatteryCapacityStatus.WARNING),  # 4.7 % left
        (9.1, RthHomeReachability.NOT_REACHABLE, BatteryCapacityStatus.CRITICAL),  # 4.6 %
    ],
)
def test_is_home_in_reach(charge: float, reachability: RthHomeReachability, capacity: BatteryCapacityStatus) -> None:
    looked = endurance()
    messages = looked.tick(0.0, charge, at(400.0), (0.0, 0.0), flying=True, returning=False)
    assert rth.HomeReachability(reachability) in messages
    assert ardrone3.ReturnHomeBatteryCapacity(capacity) in messages
    assert looked.tick(0.5, charge, at(400.0), (0.0, 0.0), flying=True, returning=False) == []


def test_reachability_on_ground_or_without_home_is_unknown() -> None:
    looked = endurance()
    assert looked.tick(0.0, 100.0, at(400.0), None, flying=True, returning=False) == []
    said = looked.tick(1.0, 100.0, at(400.0), (0.0, 0.0), flying=True, returning=False)
    assert said[0] == rth.HomeReachability(RthHomeReachability.REACHABLE)
    said = looked.tick(2.0, 100.0, at(400.0, 0.0), (0.0, 0.0), flying=False, returning=False)
    assert said[0] == rth.HomeReachability(RthHomeReachability.UNKNOWN)
    assert said[1] == ardrone3.ReturnHomeBatteryCapacity(BatteryCapacityStatus.UNKNOWN)


def test_the_announcement_counts_down() -> None:
    looked = endurance()
    observed = []
    for second in range(40):
        charge = 10.0 + 70.0 * RATE + (35 - second) * RATE  # 35 s before it has to begin
        for message in looked.tick(float(second), charge, at(400.0), (0.0, 0.0), flying=True, returning=False):
            if isinstance(message, rth.RthAutoTrigger):
                observed.append((second, message.reason, message.delay))
        if looked.return_due:
            break
    soon = AutoTriggerReason.BATTERY_CRITICAL_SOON
    assert observed == [(second, soon, 35 - second) for second in range(5, 35)]
    assert second == 35
    assert looked.returned() == [rth.RthAutoTrigger(AutoTriggerReason.NONE, 0)]


def test_return_announcement_is_withdrawn_when_home_is_nearer() -> None:
    looked = endurance()
    charge = 10.0 + 70.0 * RATE + 20.0 * RATE
    first = looked.tick(0.0, charge, at(400.0), (0.0, 0.0), flying=True, returning=False)
    assert rth.RthAutoTrigger(AutoTriggerReason.BATTERY_CRITICAL_SOON, 20) in first
    near = looked.tick(1.0, charge, at(160.0), (0.0, 0.0), flying=True, returning=False)  # 30 s nearer
    assert rth.RthAutoTrigger(AutoTriggerReason.NONE, 0) in near


def test_an_overdue_return_leaves_ten_seconds() -> None:
    looked = endurance()
    first = looked.tick(0.0, 11.0, at(400.0), (0.0, 0.0), flying=True, returning=False)
    assert rth.RthAutoTrigger(AutoTriggerReason.BATTERY_CRITICAL_SOON, 10) in first
    looked.tick(9.9, 11.0, at(400.0), (0.0, 0.0), flying=True, returning=False)
    assert not looked.return_due
    looked.tick(10.0, 11.0, at(400.0), (0.0, 0.0), flying=True, returning=False)
    assert looked.return_due


# -- the flight


@pytest.fixture
def bench() -> Bench:
    """In the air, 60 m north of home, hovering at 20 m."""
    bench = Bench()
    bench.take_off()
    bench.send(ardrone3.MoveBy(60.0, 0.0, -19.0, 0.0))
    bench.run_until(lambda: bool(bench.of(ardrone3.MoveByEnd)))
    bench.rest()
    bench.events.clear()
    return bench


def test_low_battery_starts_a_return(bench: Bench) -> None:
    # 60 m: 7.5 s and 20 s more, 1.83 %; at 12 % there are 2.5 s left, so that the shortest notice counts.
    bench.faults.battery = 12
    waited = bench.run_until(lambda: bool(returns(bench)))
    assert waited == pytest.approx(10.5, abs=0.6)
    assert returns(bench) == [(RthState.IN_PROGRESS, StateReason.LOW_BATTERY)]
    delays = [event.delay for event in bench.of(rth.RthAutoTrigger)]
    assert delays == [10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0]
    assert bench.of(rth.RthAutoTrigger)[-1].reason is AutoTriggerReason.NONE
    bench.run_until(lambda: (RthState.AVAILABLE, StateReason.FINISHED) in returns(bench))
    bench.run(20.0)
    assert len(returns(bench)) == 2  # at home it has no reason to go home again


def test_even_with_the_sticks_held(bench: Bench) -> None:
    bench.faults.battery = 12
    bench.sticks(14.0, pitch=20)
    assert returns(bench) == [(RthState.IN_PROGRESS, StateReason.LOW_BATTERY)]


@pytest.mark.parametrize("when", ["before", "after"])
def test_the_pilot_has_the_last_word(bench: Bench, when: str) -> None:
    bench.faults.battery = 12
    bench.run(5.0)
    if when == "before":
        assert bench.send(rth.CancelAutoTrigger()) == [rth.RthAutoTrigger(AutoTriggerReason.NONE, 0)]
    else:
        bench.run_until(lambda: bool(returns(bench)))
        bench.send(rth.Abort())
        assert returns(bench)[-1] == (RthState.AVAILABLE, StateReason.STOPPED)
    observed = len(returns(bench))
    bench.run(30.0)
    assert len(returns(bench)) == observed
    assert bench.of(rth.RthAutoTrigger)[-1].reason is AutoTriggerReason.NONE


def test_there_is_nothing_to_cancel(bench: Bench) -> None:
    assert bench.send(rth.CancelAutoTrigger()) == []  # rth.xml: no effect
    bench.faults.battery = 12
    bench.run_until(lambda: bool(returns(bench)))


def test_a_return_may_be_switched_off(bench: Bench) -> None:
    bench.send(rth.SetAutoTriggerMode(RthAutoTriggerMode.OFF))
    bench.faults.battery = 12
    bench.run(30.0)
    assert returns(bench) == []
    assert bench.of(rth.RthAutoTrigger) == []


def test_announced_landing_happens(bench: Bench) -> None:
    bench.send(rth.SetAutoTriggerMode(RthAutoTriggerMode.OFF))
    bench.faults.battery = 5
    bench.run_until(lambda: bool(bench.of(ardrone3.ForcedLandingAutoTrigger)))  # it is looked at once a second
    bench.faults.battery = None
    bench.run_until(lambda: bench.state is S.EMERGENCY_LANDING)
    observed = bench.of(ardrone3.ForcedLandingAutoTrigger)
    # From 5 % to 4.5 % it takes 7.5 s.
    assert [event.delay for event in observed] == [8, 7, 6, 5, 4, 3, 2, 1, 0]
    assert {event.reason for event in observed} == {ForcedLandingReason.BATTERY_CRITICAL_SOON}
    bench.run(2.5)
    assert [event.delay for event in bench.of(ardrone3.ForcedLandingAutoTrigger)[len(observed) :]] == [0, 0]
    bench.run_until(lambda: bench.state is S.LANDED)
    assert bench.of(ardrone3.ForcedLandingAutoTrigger)[-1].reason is ForcedLandingReason.NONE
    assert bench.of(ardrone3.AlertStateChanged)[-1].state is AlertState.ALMOST_EMPTY_BATTERY


def test_report_of_all_states_has_the_return_values(bench: Bench) -> None:
    bench.faults.battery = 12
    bench.run(1.5)
    report = all_states(bench.firmware)
    assert rth.RthAutoTrigger(AutoTriggerReason.BATTERY_CRITICAL_SOON, bench.of(rth.RthAutoTrigger)[-1].delay) in report
    assert rth.HomeReachability(bench.firmware.endurance.reachability) in report
    assert ardrone3.ReturnHomeBatteryCapacity(BatteryCapacityStatus.WARNING) in report


def test_no_return_without_gps(bench: Bench) -> None:
    bench.faults.gps = False
    bench.faults.battery = 12
    bench.run(20.0)
    assert returns(bench) == [(RthState.UNAVAILABLE, StateReason.DISABLED)]
    assert bench.of(rth.HomeReachability)[-1].status is RthHomeReachability.UNKNOWN


# -- motors, vibration, and who carries it


def test_failed_motor_lands_the_drone(bench: Bench) -> None:
    bench.faults.motors = 0b0100
    bench.faults.motor_error = MotorError.ERROR_MOSFET
    bench.run(0.1)
    assert bench.state is S.EMERGENCY_LANDING
    assert bench.of(ardrone3.MotorErrorStateChanged) == [
        ardrone3.MotorErrorStateChanged(0b0100, MotorError.ERROR_MOSFET)
    ]
    assert bench.of(ardrone3.MotorErrorLastErrorChanged)[-1].motorError is LastMotorError.ERROR_MOSFET
    assert bench.of(ardrone3.AlertStateChanged)[-1].state is AlertState.CUT_OUT
    assert alarms.Alarms(Type.MOTOR_CUTOUT, alarms.State.ON, 0) in bench.events
    assert bench.of(ardrone3.ForcedLandingAutoTrigger) == []  # nothing announced it
    assert ardrone3.MotorErrorStateChanged(0b0100, MotorError.ERROR_MOSFET) in all_settings(bench.firmware)
    bench.run_until(lambda: bench.state is S.LANDED)
    assert bench.firmware.blockers() == {TakeoffChecklistType.MOTOR_DOWN}
    bench.send(ardrone3.TakeOff())
    assert bench.state is S.LANDED
    bench.faults.motor_error = MotorError.NO_ERROR
    bench.run(0.1)
    assert bench.of(ardrone3.MotorErrorStateChanged)[-1] == ardrone3.MotorErrorStateChanged(0, MotorError.NO_ERROR)
    assert bench.of(ardrone3.MotorErrorLastErrorChanged)[-1].motorError is LastMotorError.ERROR_MOSFET
    bench.take_off()


def test_motor_error_of_another_motor_is_reported(bench: Bench) -> None:
    bench.faults.motors = 0b0100
    bench.faults.motor_error = MotorError.ERROR_MOSFET
    bench.run(0.1)
    lasts = len(bench.of(ardrone3.MotorErrorLastErrorChanged))
    bench.faults.motors = 0b0101
    bench.run(0.1)
    assert bench.of(ardrone3.MotorErrorStateChanged) == [
        ardrone3.MotorErrorStateChanged(0b0100, MotorError.ERROR_MOSFET),
        ardrone3.MotorErrorStateChanged(0b0101, MotorError.ERROR_MOSFET),
    ]
    assert len(bench.of(ardrone3.MotorErrorLastErrorChanged)) == lasts  # the last error is the same
    assert ardrone3.MotorErrorStateChanged(0b0101, MotorError.ERROR_MOSFET) in all_settings(bench.firmware)


def test_vibration_is_reported() -> None:
    bench = Bench()
    bench.faults.vibration = WarningLevel.CRITICAL
    bench.run(0.1)
    assert bench.of(ardrone3.VibrationLevelChanged) == [ardrone3.VibrationLevelChanged(WarningLevel.CRITICAL)]
    assert ardrone3.VibrationLevelChanged(WarningLevel.CRITICAL) in all_states(bench.firmware)


def test_motion_state_of_a_carried_drone_is_moving() -> None:
    bench = Bench()
    bench.body.place(1.0, 0.0)
    bench.run(0.1)
    bench.body.place(2.0, 0.0)
    assert bench.run_until(lambda: len(bench.of(ardrone3.MotionState)) == 2) == pytest.approx(1.0, abs=0.1)
    assert [event.state for event in bench.of(ardrone3.MotionState)] == [Motion.MOVING, Motion.STEADY]
    bench.take_off()
    bench.sticks(2.0, pitch=100)
    bench.run(2.0)
    assert len(bench.of(ardrone3.MotionState)) == 2  # in the air it means nothing


@pytest.mark.parametrize("command", [ardrone3.TakeOff(), ardrone3.UserTakeOff(1)])
def test_refused_takeoff_leaves_the_drone_landed(command: ardrone3.TakeOff | ardrone3.UserTakeOff) -> None:
    bench = Bench()
    bench.faults.refuse_take_off = frozenset({TakeoffChecklistType.UPDATE_ONGOING})
    bench.run(0.1)
    said = [event.check for event in bench.of(alarms.TakeoffChecklist) if event.state is alarms.State.ON]
    assert said == [TakeoffChecklistType.UPDATE_ONGOING]
    bench.send(command)
    bench.run(2.0)
    assert bench.states() == []


def test_home_offset_follows_the_preferred_home(bench: Bench) -> None:
    assert bench.firmware.homing.home_offset == pytest.approx((0.0, 0.0), abs=1e-3)
    bench.send(rth.SetCustomLocation(*geo.destination(*HOME[:2], 30.0, 40.0), 0.0))
    bench.send(rth.SetPreferredHomeType(rth.RthHomeType.CUSTOM))
    assert bench.firmware.homing.home_offset == pytest.approx((30.0, 40.0), abs=1e-3)

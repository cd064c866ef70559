"""Take-off and landing of the simulated drone, what forbids or forces them, its battery, its reports."""

from __future__ import annotations

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.codec.wire import MessageId, UnknownMessage
from anafi_mav.arsdk.messages import alarms, ardrone3, battery, common
from anafi_mav.arsdk.messages.alarms import State, TakeoffChecklistType, Type
from anafi_mav.arsdk.messages.ardrone3 import AlertState, FlyingState, ForcedLandingReason
from anafi_mav.arsdk.messages.battery import AlertLevel
from anafi_mav.sim.states import all_settings, all_states

S = FlyingState


@pytest.fixture
def bench() -> Bench:
    return Bench()


def blocking(bench: Bench) -> set[TakeoffChecklistType]:
    found: dict[TakeoffChecklistType, State] = {}
    for event in bench.of(alarms.TakeoffChecklist):
        found[event.check] = event.state
    return {check for check, state in found.items() if state is State.ON}


# -- up and down


def test_a_flight(bench: Bench) -> None:
    bench.events.clear()
    bench.send(ardrone3.TakeOff())
    assert bench.run_until(lambda: bench.state is S.TAKINGOFF) == pytest.approx(1.0, abs=0.05)
    bench.rest()
    assert bench.pose.up == pytest.approx(1.0, abs=0.1)
    bench.run(5.0)
    assert bench.pose.up == pytest.approx(1.0, abs=0.1)
    assert bench.states() == [S.MOTOR_RAMPING, S.TAKINGOFF, S.HOVERING]  # it stays there
    (flight,) = bench.of(common.FlightId)
    assert len(flight.flightId) == 32
    assert bench.send(ardrone3.TakeOff()) == []
    bench.send(ardrone3.Landing())
    bench.run_until(lambda: bench.state is S.LANDED)
    assert bench.pose.up == 0.0
    assert bench.states()[3:] == [S.LANDING, S.LANDED]
    assert bench.of(common.FlightId)[-1].flightId == ""
    (flights,) = bench.of(ardrone3.MotorFlightsStatusChanged)
    assert (flights.nbFlights, flights.lastFlightDuration) == (1, pytest.approx(10, abs=3))
    bench.take_off()
    assert bench.of(common.FlightId)[-1].flightId not in ("", flight.flightId)


def test_a_landing_cancels_a_take_off(bench: Bench) -> None:
    bench.send(ardrone3.TakeOff())
    bench.run(1.5)
    bench.send(ardrone3.Landing())
    bench.run_until(lambda: bench.state is S.LANDED)
    assert S.HOVERING not in bench.states()


def test_hand_launch(bench: Bench) -> None:
    bench.send(ardrone3.UserTakeOff(1))
    bench.run(3.0)
    assert bench.states() == [S.MOTOR_RAMPING, S.USERTAKEOFF]
    assert bench.pose.up == 0.0
    bench.firmware.throw()
    bench.rest()
    assert bench.states() == [S.MOTOR_RAMPING, S.USERTAKEOFF, S.TAKINGOFF, S.HOVERING]


def test_cancelled_hand_launch_stops_the_motors(bench: Bench) -> None:
    bench.send(ardrone3.UserTakeOff(1))
    bench.run(3.0)
    bench.send(ardrone3.UserTakeOff(0))
    assert bench.state is S.LANDED
    bench.firmware.throw()  # no one throws a drone whose motors are off
    bench.run(1.0)
    assert bench.state is S.LANDED


def test_emergency_in_the_air(bench: Bench) -> None:
    bench.take_off()
    bench.climb(20.0)
    bench.send(ardrone3.Emergency())
    assert bench.states() == [S.EMERGENCY]
    assert [(event.type, event.state) for event in bench.of(alarms.Alarms)] == [(Type.USER_EMERGENCY, State.ON)]
    # It falls for 2.02 s, then a second passes.
    assert bench.run_until(lambda: bench.pose.up == 0.0) == pytest.approx(2.02, abs=0.05)
    assert bench.of(ardrone3.AlertStateChanged)[-1].state is AlertState.USER
    assert bench.run_until(lambda: bench.state is S.LANDED) == pytest.approx(1.0, abs=0.05)
    assert bench.of(alarms.Alarms)[-1].state is State.OFF
    bench.run(0.1)
    assert bench.of(ardrone3.AlertStateChanged)[-1].state is AlertState.NONE
    bench.take_off()


def test_emergency_on_the_ground(bench: Bench) -> None:
    bench.send(ardrone3.Emergency())
    bench.run_until(lambda: bench.state is S.LANDED)
    assert bench.states() == [S.EMERGENCY, S.LANDED]
    assert bench.of(ardrone3.MotorFlightsStatusChanged) == []  # no flight


# -- what forbids a take-off


@pytest.mark.parametrize("command", [ardrone3.TakeOff(), ardrone3.UserTakeOff(1), ardrone3.SmartTakeOffLand()])
def test_no_take_off_without_a_calibrated_magnetometer(
    bench: Bench, command: ardrone3.TakeOff | ardrone3.UserTakeOff | ardrone3.SmartTakeOffLand
) -> None:
    bench.faults.magneto_required = True
    bench.run(0.1)
    assert blocking(bench) == {TakeoffChecklistType.MAGNETO_CALIBRATION}
    assert bench.of(common.MagnetoCalibrationRequiredState)[-1].required == 1
    bench.send(command)
    bench.run(2.0)
    assert bench.states() == []


def test_calibration_allows_takeoff_again(bench: Bench) -> None:
    bench.faults.magneto_required = True
    bench.run(0.1)
    bench.send(common.MagnetoCalibration(1))
    assert bench.run_until(lambda: blocking(bench) == set()) == pytest.approx(6.0, abs=0.2)
    asked = [event.axis for event in bench.of(common.MagnetoCalibrationAxisToCalibrateChanged)]
    assert asked == list(common.CalibrationAxis)  # x, y, z, none
    assert [event.started for event in bench.of(common.MagnetoCalibrationStartedChanged)] == [1, 0]
    assert not bench.faults.magneto_required
    bench.take_off()


def test_no_take_off_with_an_empty_battery(bench: Bench) -> None:
    bench.faults.battery = 10
    bench.run(0.1)
    assert blocking(bench) == {TakeoffChecklistType.BATTERY_CRITICAL}
    bench.send(ardrone3.TakeOff())
    assert bench.states() == []
    bench.faults.battery = 11
    bench.run(0.1)
    assert blocking(bench) == set()
    bench.take_off()


# -- battery


def test_a_full_battery_lasts_for_the_models_flight_time(bench: Bench) -> None:
    bench.take_off()
    before = bench.firmware.battery.charge
    bench.run(30.0)
    # 25 minutes for 100 %: 2 % in half a minute
    assert before - bench.firmware.battery.charge == pytest.approx(2.0, abs=0.01)
    said = [event.percent for event in bench.of(common.BatteryStateChanged)]
    assert said == [99, 98]


@pytest.mark.parametrize(
    ("percent", "alert", "level"),
    [
        (21, AlertState.NONE, AlertLevel.NONE),
        (20, AlertState.LOW_BATTERY, AlertLevel.WARNING),
        (11, AlertState.LOW_BATTERY, AlertLevel.WARNING),
        (10, AlertState.CRITICAL_BATTERY, AlertLevel.CRITICAL),
        (5, AlertState.CRITICAL_BATTERY, AlertLevel.CRITICAL),
        (4, AlertState.ALMOST_EMPTY_BATTERY, AlertLevel.CRITICAL),
    ],
)
def test_alerts(bench: Bench, percent: int, alert: AlertState, level: AlertLevel) -> None:
    bench.faults.battery = percent
    bench.run(0.1)
    assert bench.of(common.BatteryStateChanged)[-1].percent == percent
    assert [event.state for event in bench.of(ardrone3.AlertStateChanged)] == [alert] * (alert is not AlertState.NONE)
    assert [event.level for event in bench.of(battery.Alert)] == [level] * (level is not AlertLevel.NONE)


def test_voltage_follows_the_charge(bench: Bench) -> None:
    assert bench.firmware.battery.millivolts == pytest.approx(8700, abs=1)
    bench.faults.battery = 50
    bench.run(0.1)
    assert bench.firmware.battery.millivolts == 7650  # half way from 8700 to 6600
    bench.take_off()
    assert bench.firmware.battery.millivolts == 7400  # under load


def test_empty_battery_lands_the_drone(bench: Bench) -> None:
    bench.take_off()
    bench.send(ardrone3.MoveBy(20.0, 0.0, -5.0, 0.0))
    bench.run(2.0)
    bench.faults.battery = 4
    bench.run(0.1)
    assert bench.states()[-1] is S.EMERGENCY_LANDING
    assert bench.of(ardrone3.MoveByEnd)[-1].error is ardrone3.MoveByError.INTERRUPTED
    said = ardrone3.ForcedLandingAutoTrigger(ForcedLandingReason.BATTERY_CRITICAL_SOON, 0)
    assert bench.of(ardrone3.ForcedLandingAutoTrigger) == [said]
    assert said in all_states(bench.firmware)
    bench.sticks(0.5, gaz=100)
    assert bench.state is S.EMERGENCY_LANDING  # not to be stopped by gaz, as a landing is
    bench.run_until(lambda: bench.state is S.LANDED)
    assert bench.of(ardrone3.ForcedLandingAutoTrigger)[-1].reason is ForcedLandingReason.NONE
    bench.send(ardrone3.TakeOff())
    assert bench.state is S.LANDED


# -- alarms


def test_ceiling_reached_is_reported(bench: Bench) -> None:
    bench.take_off()
    bench.send(ardrone3.MaxAltitude(5.0))
    bench.sticks(4.0, gaz=100)
    assert bench.pose.up == pytest.approx(5.0, abs=0.2)
    assert [(e.type, e.state) for e in bench.of(alarms.Alarms)] == [(Type.VERTICAL_GEOFENCE_REACHED, State.ON)]
    bench.sticks(2.0, gaz=-50)
    assert [e.state for e in bench.of(alarms.Alarms)] == [State.ON, State.OFF]


def test_geofence_reached_is_reported_and_holds(bench: Bench) -> None:
    bench.take_off()
    bench.send(ardrone3.MaxDistance(10.0))
    bench.send(ardrone3.NoFlyOverMaxDistance(1))
    bench.sticks(15.0, pitch=100)
    assert 8.5 < bench.pose.north <= 10.0
    assert [(e.type, e.state) for e in bench.of(alarms.Alarms)] == [(Type.HORIZONTAL_GEOFENCE_REACHED, State.ON)]


# -- words


def test_unknown_message_is_not_answered(bench: Bench) -> None:
    bench.events.clear()
    assert not bench.firmware.receive(UnknownMessage(MessageId(200, 1, 2), b"\x00"), bench.now)
    assert bench.events == []


def test_states_and_settings_report_each_key_once(bench: Bench) -> None:
    """A state that is reported twice would be two answers; lists have a last item."""
    for report in (all_states(bench.firmware), all_settings(bench.firmware)):
        packed = [(event.ID, event) for event in report]
        assert len(packed) == len({(id, repr(event)) for id, event in packed})
    flags = [event.list_flags for event in all_states(bench.firmware) if isinstance(event, alarms.TakeoffChecklist)]
    assert flags[0] & 1
    assert flags[-1] & 2
    assert not any(flags[1:-1])


def test_the_position_is_unknown_without_a_fix(bench: Bench) -> None:
    bench.faults.gps = False
    bench.run(0.1)
    nowhere = ardrone3.GpsLocationChanged(500.0, 500.0, 500.0, -1, -1, -1)
    assert nowhere in bench.firmware.position_report()
    assert nowhere in all_states(bench.firmware)
    assert bench.of(ardrone3.NumberOfSatelliteChanged)[-1].numberOfSatellite == 0
    assert bench.of(common.AvailabilityStateChanged)[-1].AvailabilityState == 0


def test_the_position_is_above_mean_sea_level(bench: Bench) -> None:
    bench.take_off()
    location = next(e for e in bench.firmware.position_report() if isinstance(e, ardrone3.GpsLocationChanged))
    assert location.altitude == pytest.approx(35.0 + bench.pose.up, abs=1e-6)

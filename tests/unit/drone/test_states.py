"""What each event does to the states: hand-computed values, Parrot's sentinels, lists, nonsense from a peer."""

from __future__ import annotations

import math
import random
import struct
from typing import Any

import pytest

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.messages import alarms, ardrone3, battery, common, move, rth, wifi
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.ardrone3 import (
    AlertState,
    FlyingState,
    ForcedLandingReason,
    MotorError,
    MoveToStatus,
    OrientationMode,
    PoiMode,
    PoiStatus,
)
from anafi_mav.arsdk.messages.battery import AlertLevel, BatteryAlert
from anafi_mav.arsdk.messages.camera import CameraCameraMode, Framerate
from anafi_mav.arsdk.messages.common import CalibrationAxis, Sensor
from anafi_mav.arsdk.messages.rth import AutoTriggerReason, RthEndingBehavior, RthHomeType, RthState, StateReason
from anafi_mav.drone import Position, Range
from anafi_mav.drone.element import MAX_ITEMS, Element, members
from anafi_mav.drone.payload.camera_enums import CameraMode, quantities, words
from anafi_mav.drone.piloting.motors import takeoff_blockers
from anafi_mav.drone.piloting.piloting import Piloting
from anafi_mav.drone.piloting.state import Attitude, PilotingState, Velocity
from anafi_mav.drone.status.alerts import Alerts, AlertsState
from anafi_mav.drone.status.battery import Battery, BatteryState
from anafi_mav.drone.status.calibration import Calibration, CalibrationState
from anafi_mav.drone.status.gps import Gps
from anafi_mav.drone.status.home import Home, HomeState
from anafi_mav.drone.status.link import Link
from anafi_mav.drone.status.product import MODELS, Product

ELEMENTS: list[type[Element[Any]]] = [Alerts, Battery, Calibration, Gps, Home, Link, Piloting, Product]

NAN, INF = math.nan, math.inf

# element, the events in their order, the fields that must result
CASES: list[tuple[type[Element[Any]], list[wire.Message], dict[str, Any]]] = [
    (Piloting, [], {"flying": None, "attitude": None, "altitude": None, "max_tilt": None, "in_air": None}),
    (Piloting, [ardrone3.FlyingStateChanged(FlyingState.LANDED)], {"in_air": False, "motors_on": False}),
    (Piloting, [ardrone3.FlyingStateChanged(FlyingState.MOTOR_RAMPING)], {"in_air": False, "motors_on": True}),
    (Piloting, [ardrone3.FlyingStateChanged(FlyingState.LANDING)], {"in_air": True, "motors_on": True}),
    (Piloting, [ardrone3.FlyingStateChanged(FlyingState.EMERGENCY)], {"in_air": False, "motors_on": False}),
    (Piloting, [ardrone3.AttitudeChanged(0.1, -0.2, 3.0)], {"attitude": Attitude(0.1, -0.2, 3.0)}),
    (Piloting, [ardrone3.AttitudeChanged(0.1, -0.2, 3.0), ardrone3.AttitudeChanged(0, NAN, 0)], {"attitude": None}),
    (Piloting, [ardrone3.SpeedChanged(1.0, -2.0, 0.5)], {"velocity": Velocity(1.0, -2.0, 0.5)}),
    (Piloting, [ardrone3.SpeedChanged(INF, -INF, 0.5)], {"velocity": None}),
    (
        Piloting,
        [ardrone3.AltitudeChanged(12.5), ardrone3.AltitudeAboveGroundChanged(3.5)],
        {"altitude": 12.5, "height": 3.5},
    ),
    (Piloting, [ardrone3.MotionState(ardrone3.Motion.STEADY)], {"steady": True}),
    (Piloting, [ardrone3.MotionState(ardrone3.Motion.MOVING)], {"steady": False}),
    (
        Piloting,
        [ardrone3.MoveToChanged(48.5, 2.5, 20.0, OrientationMode.NONE, 0.0, MoveToStatus.RUNNING)],
        {"move_to": MoveToStatus.RUNNING, "move_target": Position(48.5, 2.5, 20.0)},
    ),
    (
        Piloting,
        [ardrone3.PilotedPOIV2(500, 500, 500, PoiMode.LOCKED_GIMBAL, PoiStatus.AVAILABLE)],
        {"poi": PoiStatus.AVAILABLE},
    ),
    (Piloting, [move.Info(0b100001)], {"move_missing": 33}),
    (Piloting, [ardrone3.MaxTiltChanged(10, 1, 40)], {"max_tilt": Range(10, 1, 40)}),
    (Piloting, [ardrone3.MaxTiltChanged(10, 1, 40), ardrone3.MaxTiltChanged(NAN, 1, 40)], {"max_tilt": None}),
    (Piloting, [ardrone3.MaxVerticalSpeedChanged(3, 0.1, 4)], {"max_vertical_speed": Range(3, 0.1, 4)}),
    (Piloting, [ardrone3.MaxRotationSpeedChanged(40, 3, 200)], {"max_rotation_speed": Range(40, 3, 200)}),
    (Piloting, [ardrone3.MaxPitchRollRotationSpeedChanged(116, 40, 300)], {"max_tilt_speed": Range(116, 40, 300)}),
    (Piloting, [ardrone3.MaxAltitudeChanged(150, 0.5, 4000)], {"max_altitude": Range(150, 0.5, 4000)}),
    (Piloting, [ardrone3.MaxDistanceChanged(100, 10, 4000)], {"max_distance": Range(100, 10, 4000)}),
    (
        Piloting,
        [ardrone3.NoFlyOverMaxDistanceChanged(1), ardrone3.BankedTurnChanged(0)],
        {"geofence": True, "banked_turn": False},
    ),
    (Gps, [ardrone3.GPSFixStateChanged(1), ardrone3.NumberOfSatelliteChanged(14)], {"fixed": True, "satellites": 14}),
    (
        Gps,
        [ardrone3.GpsLocationChanged(48.8789, 2.3677, 65.5, 2, 3, 4)],
        {
            "location": Position(48.8789, 2.3677, 65.5),
            "latitude_accuracy": 2,
            "longitude_accuracy": 3,
            "altitude_accuracy": 4,
        },
    ),
    (
        Gps,
        [ardrone3.GpsLocationChanged(48.8789, 2.3677, 65.5, -1, -1, -1)],
        {"location": Position(48.8789, 2.3677, 65.5), "latitude_accuracy": None, "altitude_accuracy": None},
    ),
    (
        Gps,
        [
            ardrone3.NumberOfSatelliteChanged(14),
            ardrone3.GpsLocationChanged(48.8789, 2.3677, 65.5, 2, 3, 4),
            ardrone3.GpsLocationChanged(500.0, 500.0, 500.0, 2, 2, 2),
        ],
        {"location": None, "latitude_accuracy": None, "satellites": 14},
    ),
    # 500 m above the sea is a height like any other
    (Gps, [ardrone3.GpsLocationChanged(46.0, 7.0, 500.0, 1, 1, 1)], {"location": Position(46.0, 7.0, 500.0)}),
    (Battery, [common.BatteryStateChanged(73)], {"percent": 73}),
    (Battery, [battery.Voltage(7612), battery.Temperature(298)], {"voltage_mv": 7612, "temperature_k": 298}),
    (
        Battery,
        [battery.Health(96), battery.CycleCount(12), battery.Serial("B1")],
        {"health_percent": 96, "cycles": 12, "serial": "B1"},
    ),
    (Battery, [battery.Description("B2", "2023", 6800, 3, 3000, 4400)], {"serial": "B2", "cell_count": 3}),
    (Battery, [battery.Capacity(2700, 2100)], {"full_charge_mah": 2700, "remaining_mah": 2100}),
    (Battery, [battery.CellVoltage(0, 4100), battery.CellVoltage(2, 4090)], {"cell_voltages_mv": {0: 4100, 2: 4090}}),
    (
        Battery,
        [battery.Voltage(7612), battery.Voltage(0), battery.Temperature(298), battery.Temperature(0)],
        {"voltage_mv": None, "temperature_k": None},
    ),
    (Battery, [battery.CellVoltage(0, 4100), battery.CellVoltage(0, 0)], {"cell_voltages_mv": {}}),
    # First | Last = 3, Empty = 4, Remove = 8
    (
        Battery,
        [
            battery.Alert(BatteryAlert.TOO_HOT, AlertLevel.WARNING, 1),
            battery.Alert(BatteryAlert.POWER_LEVEL, AlertLevel.CRITICAL, 2),
        ],
        {"alerts": {BatteryAlert.TOO_HOT: AlertLevel.WARNING, BatteryAlert.POWER_LEVEL: AlertLevel.CRITICAL}},
    ),
    (
        Battery,
        [
            battery.Alert(BatteryAlert.TOO_HOT, AlertLevel.WARNING, 3),
            battery.Alert(BatteryAlert.TOO_COLD, AlertLevel.WARNING, 3),
        ],
        {"alerts": {BatteryAlert.TOO_COLD: AlertLevel.WARNING}},
    ),
    (
        Battery,
        [
            battery.Alert(BatteryAlert.TOO_HOT, AlertLevel.WARNING, 3),
            battery.Alert(BatteryAlert.POWER_LEVEL, AlertLevel.NONE, 4),
        ],
        {"alerts": {}},
    ),
    (
        Battery,
        [
            battery.Alert(BatteryAlert.TOO_HOT, AlertLevel.WARNING, 3),
            battery.Alert(BatteryAlert.LOST_COMM, AlertLevel.WARNING, 0),
            battery.Alert(BatteryAlert.TOO_HOT, AlertLevel.NONE, 8),
        ],
        {"alerts": {BatteryAlert.LOST_COMM: AlertLevel.WARNING}},
    ),
    (
        Battery,
        [battery.Alert(BatteryAlert.TOO_HOT, AlertLevel(3), 0)],
        {"alerts": {BatteryAlert.TOO_HOT: AlertLevel.CRITICAL}},
    ),
    # 0b1000_0011: perturbed, quality 3; 0b0100_0101: 4G interference, quality 5
    (Link, [common.LinkSignalQuality(0x83)], {"quality": 3, "perturbed": True, "interference_4g": False}),
    (Link, [common.LinkSignalQuality(0x45)], {"quality": 5, "perturbed": False, "interference_4g": True}),
    (Link, [common.LinkSignalQuality(0x00)], {"quality": None}),
    (Link, [common.LinkSignalQuality(0x0F)], {"quality": None}),
    (Link, [wifi.RssiChanged(-48)], {"rssi_dbm": -48}),
    (Link, [common.WifiSignalChanged(-61)], {"rssi_dbm": -61}),
    (Home, [ardrone3.HomeChanged(500.0, 500.0, 500.0)], {"location": None}),
    (Home, [ardrone3.HomeChanged(48.0, 2.0, 1.5)], {"location": Position(48.0, 2.0, 1.5)}),
    (Home, [rth.HomeLocation(48.0, 2.0, 0.0)], {"location": Position(48.0, 2.0, 0.0)}),
    (Home, [rth.TakeoffLocation(48.0, 2.0, 0.0, 1)], {"takeoff_location": Position(48.0, 2.0, 0.0)}),
    (Home, [rth.CustomLocation(500, 500, 500)], {"custom_location": None}),
    (
        Home,
        [rth.HomeType(RthHomeType.TAKEOFF), rth.PreferredHomeType(RthHomeType.PILOT)],
        {"type": 1, "preferred_type": 4},
    ),
    (
        Home,
        [rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST)],
        {"rth": RthState.IN_PROGRESS, "reason": 0, "returning": True, "returning_by_itself": False},
    ),
    (Home, [rth.State(RthState.PENDING, StateReason.LOW_BATTERY)], {"returning": True, "returning_by_itself": True}),
    (Home, [rth.State(RthState.IN_PROGRESS, StateReason.FLIGHTPLAN)], {"returning_by_itself": False}),
    (Home, [rth.State(RthState.IN_PROGRESS, StateReason.ENABLED)], {"returning": True, "returning_by_itself": False}),
    (Home, [rth.State(RthState.IN_PROGRESS, StateReason.STOPPED)], {"returning": True, "returning_by_itself": False}),
    (Home, [rth.State(RthState.PENDING, StateReason.ICING)], {"returning_by_itself": True}),
    (Home, [rth.State(RthState.IN_PROGRESS, StateReason(99))], {"returning_by_itself": True}),
    (Home, [rth.State(RthState.AVAILABLE, StateReason.FINISHED)], {"returning": False, "returning_by_itself": False}),
    (
        Home,
        [rth.RthAutoTrigger(AutoTriggerReason.BATTERY_CRITICAL_SOON, 42)],
        {"auto_trigger": AutoTriggerReason.BATTERY_CRITICAL_SOON, "auto_trigger_delay_s": 42},
    ),
    (Home, [rth.RthAutoTrigger(AutoTriggerReason.NONE, 7)], {"auto_trigger": 0, "auto_trigger_delay_s": None}),
    (Home, [rth.MinAltitude(20, 20, 100)], {"min_altitude": Range(20, 20, 100)}),
    (Home, [rth.EndingBehavior(RthEndingBehavior.HOVERING)], {"ending": RthEndingBehavior.HOVERING}),
    (
        Home,
        [rth.EndingHoveringAltitude(10, 1, 10), rth.Delay(30, 0, 120)],
        {"ending_altitude": Range(10, 1, 10), "delay_s": 30},
    ),
    (
        Product,
        [
            common.ProductNameChanged("ANAFI-H000001"),
            common.ProductVersionChanged("1.8.2", "HW_02"),
            common.ProductSerialHighChanged("PI04"),
        ],
        {"name": "ANAFI-H000001", "firmware": "1.8.2", "hardware": "HW_02", "serial": None},
    ),
    (
        Product,
        [common.ProductSerialHighChanged("PI04"), common.ProductSerialLowChanged("0416DA9H000001")],
        {"serial": "PI040416DA9H000001"},
    ),
    (Product, [common.FlightId("f1"), common.FlightId("")], {"flight_id": ""}),
    (Product, [common.BootId("b1"), common.RunIdChanged("r1")], {"boot_id": "b1", "run_id": "r1"}),
    (
        Product,
        [ardrone3.MotorFlightsStatusChanged(3, 65, 4000)],
        {"flights": 3, "last_flight_s": 65, "total_flight_s": 4000},
    ),
    (
        Calibration,
        [common.MagnetoCalibrationRequiredState(0)],
        {"magneto_required": False, "magneto_recommended": False},
    ),
    (
        Calibration,
        [common.MagnetoCalibrationRequiredState(1)],
        {"magneto_required": True, "magneto_recommended": False},
    ),
    (
        Calibration,
        [common.MagnetoCalibrationRequiredState(2)],
        {"magneto_required": False, "magneto_recommended": True},
    ),
    (Calibration, [], {"magneto_required": None, "sensors_ok": None}),
    (Calibration, [common.SensorsStatesListChanged(Sensor.IMU, 1)], {"sensors_ok": True}),
    (
        Calibration,
        [common.SensorsStatesListChanged(Sensor.IMU, 1), common.SensorsStatesListChanged(Sensor.GPS, 0)],
        {"sensors_ok": False, "sensors": {Sensor.IMU: True, Sensor.GPS: False}},
    ),
    (
        Calibration,
        [
            common.MagnetoCalibrationStartedChanged(1),
            common.MagnetoCalibrationAxisToCalibrateChanged(CalibrationAxis.Y_AXIS),
            common.MagnetoCalibrationStateChanged(1, 0, 0, 1),
        ],
        {"started": True, "axis": CalibrationAxis.Y_AXIS, "failed": True},
    ),
    (Alerts, [ardrone3.AlertStateChanged(AlertState.CUT_OUT)], {"alert": AlertState.CUT_OUT}),
    (
        Alerts,
        [
            alarms.Alarms(alarms.Type.MOTOR_CUTOUT, alarms.State.OFF, 1),
            alarms.Alarms(alarms.Type.VERTICAL_GEOFENCE_REACHED, alarms.State.ON, 2),
        ],
        {"alarms": {alarms.Type.MOTOR_CUTOUT: False, alarms.Type.VERTICAL_GEOFENCE_REACHED: True}},
    ),
    (
        Alerts,
        [ardrone3.ForcedLandingAutoTrigger(ForcedLandingReason.BATTERY_CRITICAL_SOON, 15)],
        {"forced_landing": ForcedLandingReason.BATTERY_CRITICAL_SOON, "forced_landing_delay_s": 15},
    ),
    (
        Alerts,
        [ardrone3.ForcedLandingAutoTrigger(ForcedLandingReason.NONE, 15)],
        {"forced_landing": 0, "forced_landing_delay_s": None},
    ),
    (Alerts, [ardrone3.MotorErrorStateChanged(4, MotorError.ERROR_MOTOR_STALLED)], {"motor_error": 2, "motors": 4}),
    (Alerts, [ardrone3.HoveringWarning(1, 0)], {"too_dark_to_hover": True, "too_high_to_hover": False}),
]


def reduce(element: type[Element[Any]], events: list[wire.Message]) -> Any:
    state = element.NOTHING
    for event in events:
        state = element.REDUCERS[type(event)](state, event)
    return state


@pytest.mark.parametrize(("element", "events", "expected"), CASES)
def test_events_make_states(element: type[Element[Any]], events: list[wire.Message], expected: dict[str, Any]) -> None:
    state = reduce(element, events)
    assert {name: getattr(state, name) for name in expected} == expected


def test_reducer_leaves_the_previous_state_unchanged() -> None:
    before = reduce(Battery, [battery.Alert(BatteryAlert.TOO_HOT, AlertLevel.WARNING, 3)])
    Battery.REDUCERS[battery.Alert](before, battery.Alert(BatteryAlert.TOO_COLD, AlertLevel.WARNING, 0))
    assert before.alerts == {BatteryAlert.TOO_HOT: AlertLevel.WARNING}
    assert BatteryState() == Battery.NOTHING


def test_reported_sets_of_values_are_shared_by_drones() -> None:
    types = {RthHomeType.TAKEOFF, RthHomeType.PILOT}
    bits = sum(1 << one for one in types)
    assert members(bits, RthHomeType) == types
    assert members(bits, RthHomeType) is members(bits, RthHomeType)
    modes = (CameraCameraMode.PHOTO, CameraCameraMode.RECORDING)
    assert words(CameraMode, modes) == {CameraMode.PHOTO, CameraMode.RECORDING}
    assert words(CameraMode, modes) is words(CameraMode, reversed(modes))
    rates = (Framerate.FPS_30, Framerate.FPS_24)
    assert quantities(rates) == (24.0, 30.0)
    assert quantities(rates) is quantities(reversed(rates))


def test_a_map_does_not_grow_without_end() -> None:
    state = reduce(Calibration, [common.SensorsStatesListChanged(Sensor(n), 1) for n in range(10 * MAX_ITEMS)])
    assert len(state.sensors) == MAX_ITEMS


def test_reducers_listen_to_events_only() -> None:
    for element in ELEMENTS:
        for message in element.REDUCERS:
            assert message.DIRECTION is wire.Direction.EVENT, message


def test_whatever_the_peer_sends_no_reducer_raises() -> None:
    """Any bytes that decode to an event make a state, whose properties can be read."""
    rng = random.Random(146)
    extremes = [0, 0xFF, 0x7F, 0x80]
    for element in ELEMENTS:
        state = element.NOTHING
        for _ in range(20):
            for message in element.REDUCERS:
                filler = rng.choice(extremes)
                body = bytes(rng.randrange(256) if rng.random() < 0.5 else filler for _ in range(64)) + b"\0\0"
                event = wire.decode(struct.pack("<BBH", *message.ID) + body)
                if event is not None:  # several strings, and too few ends in the noise
                    state = element.REDUCERS[message](state, event)
        for name in dir(type(state)):
            getattr(state, name)


CHECK = TakeoffChecklistType


@pytest.mark.parametrize(
    ("alerts", "power", "calibration", "expected"),
    [
        (AlertsState(), BatteryState(), CalibrationState(), []),
        (AlertsState(alert=AlertState.NONE), BatteryState(percent=80), CalibrationState(magneto_required=False), []),
        (
            AlertsState(checklist={CHECK.GYRO: False, CHECK.DRONE_INCLINATION_TOO_HIGH: True}),
            BatteryState(),
            CalibrationState(sensors={Sensor.IMU: False}),
            ["drone inclination too high"],
        ),
        (AlertsState(), BatteryState(), CalibrationState(magneto_required=True), ["magnetometer calibration required"]),
        (
            AlertsState(),
            BatteryState(),
            CalibrationState(sensors={Sensor.GPS: False, Sensor.IMU: False}),
            ["sensor imu"],
        ),
        (
            AlertsState(alert=AlertState.CRITICAL_BATTERY, motor_error=MotorError.ERROR_TEMPERATURE),
            BatteryState(alerts={BatteryAlert.TOO_COLD: AlertLevel.CRITICAL, BatteryAlert.TOO_HOT: AlertLevel.WARNING}),
            CalibrationState(),
            ["battery too cold", "alert critical battery", "motor error temperature"],
        ),
        (AlertsState(alert=AlertState.LOW_BATTERY), BatteryState(), CalibrationState(), []),
        # An emergency stop of before, and alerts that the drone's own list does not share.
        (AlertsState(alert=AlertState.USER), BatteryState(), CalibrationState(), []),
        (AlertsState(alert=AlertState.TOO_MUCH_ANGLE), BatteryState(), CalibrationState(), ["alert too much angle"]),
        (
            AlertsState(alert=AlertState.TOO_MUCH_ANGLE, checklist={CHECK.DRONE_INCLINATION_TOO_HIGH: False}),
            BatteryState(alerts={BatteryAlert.POWER_LEVEL: AlertLevel.CRITICAL}),
            CalibrationState(),
            ["battery critical"],
        ),
    ],
)
def test_reasons_against_a_takeoff(
    alerts: AlertsState, power: BatteryState, calibration: CalibrationState, expected: list[str]
) -> None:
    assert [str(blocker) for blocker in takeoff_blockers(alerts, power, calibration)] == expected


def test_the_models_are_those_of_the_family() -> None:
    # arsdk-ng libarsdk/inc/arsdk/arsdk_desc.h, and what each announces in discovery
    assert {id: model.key for id, model in MODELS.items()} == {
        2324: "4k",
        2329: "thermal",
        2330: "ai",
        2331: "ua",
        2334: "usa",
    }


def test_states_are_frozen() -> None:
    for state in (PilotingState(), HomeState()):
        with pytest.raises(AttributeError):
            state.flying = 1  # type: ignore[misc, union-attr]

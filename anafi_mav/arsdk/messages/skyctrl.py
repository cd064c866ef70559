"""Project 4, skyctrl: the Skycontroller itself.

What concerns its axes and buttons is in `mapper`, the drones it knows in `drone_manager`. Its old Wi-Fi, access point
and mapping classes are of controllers before the Skycontroller 3 and not declared.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, F32, F64, I16, STRING, U8, U16, Buffer, Message, OpenEnum, command, event


class Variant(OpenEnum):
    BEBOP = 0
    BEBOP2 = 1
    STANDARD = 2
    MISSION = 3
    MEE = 4


class BatteryStatus(OpenEnum):
    CHARGING = 0
    CHARGED = 1
    DISCHARGING = 2
    DISCHARGING_LOW = 3
    DISCHARGING_CRITICAL = 4


class Charger(OpenEnum):
    DISCONNECTED = 0
    SDP = 1
    CDP = 2
    DCP = 3
    POWER_DELIVERY = 4


class Source(OpenEnum):
    SKY_CONTROLLER = 0
    CONTROLLER = 1


class CalibrationStatus(OpenEnum):
    UNRELIABLE = 0
    ASSESSING = 1
    CALIBRATED = 2


class State(OpenEnum):
    NOT_CALIBRATED = 0
    CALIBRATING_X = 1
    CALIBRATING_Y = 2
    CALIBRATING_Z = 3
    CALIBRATED = 4


class ShutdownReason(OpenEnum):
    POWEROFF_BUTTON = 0
    UPDATE = 1
    LOW_BATTERY = 2
    FACTORY_RESET = 3


@command("skyctrl.Settings.AllSettings", 4, 4, 0)
class AllSettings(Message, frozen=True):
    pass


@command("skyctrl.Settings.Reset", 4, 4, 1)
class Reset(Message, frozen=True):
    pass


@event("skyctrl.SettingsState.AllSettingsChanged", 4, 5, 0)
class AllSettingsChanged(Message, frozen=True):
    pass


@event("skyctrl.SettingsState.ResetChanged", 4, 5, 1)
class ResetChanged(Message, frozen=True):
    pass


@event("skyctrl.SettingsState.ProductSerialChanged", 4, 5, 2)
class ProductSerialChanged(Message, frozen=True):
    serialNumber: Annotated[str, STRING]


@event("skyctrl.SettingsState.ProductVariantChanged", 4, 5, 3)
class ProductVariantChanged(Message, frozen=True):
    variant: Annotated[Variant, ENUM]


@event("skyctrl.SettingsState.ProductVersionChanged", 4, 5, 4)
class ProductVersionChanged(Message, frozen=True):
    software: Annotated[str, STRING]
    hardware: Annotated[str, STRING]


@event("skyctrl.SettingsState.CPUID", 4, 5, 5)
class CPUID(Message, frozen=True):
    id: Annotated[str, STRING]


@command("skyctrl.Common.AllStates", 4, 6, 0)
class AllStates(Message, frozen=True):
    pass


@command("skyctrl.Common.CurrentDateTime", 4, 6, 1)
class CurrentDateTime(Message, frozen=True):
    """ "YYYYMMDDTHHMMSS+hhmm"."""

    datetime: Annotated[str, STRING]


@event("skyctrl.CommonState.AllStatesChanged", 4, 7, 0)
class AllStatesChanged(Message, frozen=True):
    pass


@event("skyctrl.CommonState.CurrentDateTimeChanged", 4, 7, 1)
class CurrentDateTimeChanged(Message, frozen=True):
    datetime: Annotated[str, STRING]


@event("skyctrl.CommonState.ImminentShutdownChanged", 4, 7, 2)
class ImminentShutdownChanged(Message, frozen=True):
    duration: Annotated[int, I16]


@event("skyctrl.CommonState.BootId", 4, 7, 3)
class BootId(Message, frozen=True):
    bootId: Annotated[str, STRING]


@event("skyctrl.SkyControllerState.BatteryChanged", 4, 8, 0)
class BatteryChanged(Message, frozen=True):
    """255: charging."""

    percent: Annotated[int, U8]


@event("skyctrl.SkyControllerState.GpsFixChanged", 4, 8, 1)
class GpsFixChanged(Message, frozen=True):
    fixed: Annotated[int, U8]


@event("skyctrl.SkyControllerState.GpsPositionChanged", 4, 8, 2)
class GpsPositionChanged(Message, frozen=True):
    """Degrees (500: unknown), metres above the sea."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    heading: Annotated[float, F32]


@event("skyctrl.SkyControllerState.BatteryState", 4, 8, 3)
class BatteryState(Message, frozen=True):
    state: Annotated[BatteryStatus, ENUM]


@event("skyctrl.SkyControllerState.AttitudeChanged", 4, 8, 4, Buffer.NON_ACK)
class AttitudeChanged(Message, frozen=True):
    """A quaternion w, x, y, z from the controller to North-East-Down."""

    q0: Annotated[float, F32]
    q1: Annotated[float, F32]
    q2: Annotated[float, F32]
    q3: Annotated[float, F32]


@event("skyctrl.SkyControllerState.ChargerType", 4, 8, 5)
class ChargerType(Message, frozen=True):
    type: Annotated[Charger, ENUM]


@event("skyctrl.SkyControllerState.ChargeTimeLeft", 4, 8, 6)
class ChargeTimeLeft(Message, frozen=True):
    time: Annotated[int, U16]


@command("skyctrl.CoPiloting.setPilotingSource", 4, 20, 0)
class SetPilotingSource(Message, frozen=True):
    """Select the piloting source: the Skycontroller's sticks or the connected controller."""

    source: Annotated[Source, ENUM]


@event("skyctrl.CoPilotingState.pilotingSource", 4, 21, 0)
class PilotingSource(Message, frozen=True):
    source: Annotated[Source, ENUM]


@command("skyctrl.Calibration.enableMagnetoCalibrationQualityUpdates", 4, 22, 0)
class EnableMagnetoCalibrationQualityUpdates(Message, frozen=True):
    enable: Annotated[int, U8]


@command("skyctrl.Calibration.StartCalibration", 4, 22, 1)
class StartCalibration(Message, frozen=True):
    pass


@command("skyctrl.Calibration.AbortCalibration", 4, 22, 2)
class AbortCalibration(Message, frozen=True):
    pass


@event("skyctrl.CalibrationState.MagnetoCalibrationState", 4, 23, 0)
class MagnetoCalibrationState(Message, frozen=True):
    status: Annotated[CalibrationStatus, ENUM]
    X_Quality: Annotated[int, U8]
    Y_Quality: Annotated[int, U8]
    Z_Quality: Annotated[int, U8]


@event("skyctrl.CalibrationState.MagnetoCalibrationQualityUpdatesState", 4, 23, 1)
class MagnetoCalibrationQualityUpdatesState(Message, frozen=True):
    enabled: Annotated[int, U8]


@event("skyctrl.CalibrationState.MagnetoCalibrationStateV2", 4, 23, 2)
class MagnetoCalibrationStateV2(Message, frozen=True):
    state: Annotated[State, ENUM]


@command("skyctrl.Factory.Reset", 4, 25, 0)
class FactoryReset(Message, frozen=True):
    pass


@event("skyctrl.CommonEventState.Shutdown", 4, 26, 0)
class Shutdown(Message, frozen=True):
    reason: Annotated[ShutdownReason, ENUM]

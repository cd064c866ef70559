"""Project 0, common: connection, product, calibration, flight plan control."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import (
    ENUM,
    F64,
    I16,
    STRING,
    U8,
    U16,
    U32,
    U64,
    Buffer,
    Message,
    OpenEnum,
    command,
    event,
)


class DisconnectionCause(OpenEnum):
    OFF_BUTTON = 0
    UNKNOWN = 1
    RESET_FACTORY = 2


class Sensor(OpenEnum):
    IMU = 0
    BAROMETER = 1
    ULTRASOUND = 2
    GPS = 3
    MAGNETOMETER = 4
    VERTICAL_CAMERA = 5
    VERTICAL_TOF = 6


class MavlinkType(OpenEnum):
    FLIGHT_PLAN = 0
    MAP_MY_HOUSE = 1
    FLIGHT_PLAN_V2 = 2


class PlayingState(OpenEnum):
    """State of a flight plan (common.xml 0-12-0)."""

    PLAYING = 0
    STOPPED = 1
    PAUSED = 2
    LOADED = 3


class PlayError(OpenEnum):
    NONE = 0
    NOT_IN_OUT_DOOR_MODE = 1
    GPS_NOT_FIXED = 2
    NOT_CALIBRATED = 3


class CalibrationAxis(OpenEnum):
    X_AXIS = 0
    Y_AXIS = 1
    Z_AXIS = 2
    NONE = 3


class FlightPlanComponent(OpenEnum):
    GPS = 0
    CALIBRATION = 1
    MAVLINK_FILE = 2
    TAKE_OFF = 3
    WAYPOINTS_BEYOND_GEOFENCE = 4
    CAMERA_AVAILABLE = 5
    MAVLINK_STATE = 6
    MAVLINK_MEDIA = 7
    FIRST_WAYPOINT_TOO_FAR = 8


class PeerState(OpenEnum):
    CONNECTED = 0
    DISCONNECTED = 1


class PeerType(OpenEnum):
    UNKNOWN = 0
    NET = 1
    MUX = 2


class UpdateStatus(OpenEnum):
    SUCCESS = 0
    FAILURE_BAD_FILE = 1
    FAILURE_BAT_LEVEL_TOO_LOW = 2
    FAILURE = 3


@event("common.NetworkEvent.Disconnection", 0, 1, 0)
class Disconnection(Message, frozen=True):
    cause: Annotated[DisconnectionCause, ENUM]


@command("common.Settings.AllSettings", 0, 2, 0)
class AllSettings(Message, frozen=True):
    pass


@command("common.Settings.Reset", 0, 2, 1)
class Reset(Message, frozen=True):
    pass


@command("common.Settings.ProductName", 0, 2, 2)
class ProductName(Message, frozen=True):
    name: Annotated[str, STRING]


@event("common.SettingsState.AllSettingsChanged", 0, 3, 0)
class AllSettingsChanged(Message, frozen=True):
    pass


@event("common.SettingsState.ResetChanged", 0, 3, 1)
class ResetChanged(Message, frozen=True):
    pass


@event("common.SettingsState.ProductNameChanged", 0, 3, 2)
class ProductNameChanged(Message, frozen=True):
    name: Annotated[str, STRING]


@event("common.SettingsState.ProductVersionChanged", 0, 3, 3)
class ProductVersionChanged(Message, frozen=True):
    software: Annotated[str, STRING]
    hardware: Annotated[str, STRING]


@event("common.SettingsState.ProductSerialHighChanged", 0, 3, 4)
class ProductSerialHighChanged(Message, frozen=True):
    high: Annotated[str, STRING]


@event("common.SettingsState.ProductSerialLowChanged", 0, 3, 5)
class ProductSerialLowChanged(Message, frozen=True):
    low: Annotated[str, STRING]


@event("common.SettingsState.CountryChanged", 0, 3, 6)
class CountryChanged(Message, frozen=True):
    code: Annotated[str, STRING]


@event("common.SettingsState.AutoCountryChanged", 0, 3, 7)
class AutoCountryChanged(Message, frozen=True):
    automatic: Annotated[int, U8]


@event("common.SettingsState.BoardIdChanged", 0, 3, 8)
class BoardIdChanged(Message, frozen=True):
    id: Annotated[str, STRING]


@command("common.Common.AllStates", 0, 4, 0)
class AllStates(Message, frozen=True):
    pass


@command("common.Common.CurrentDate", 0, 4, 1)
class CurrentDate(Message, frozen=True):
    date: Annotated[str, STRING]


@command("common.Common.CurrentTime", 0, 4, 2)
class CurrentTime(Message, frozen=True):
    time: Annotated[str, STRING]


@command("common.Common.Reboot", 0, 4, 3)
class Reboot(Message, frozen=True):
    pass


@command("common.Common.CurrentDateTime", 0, 4, 4)
class CurrentDateTime(Message, frozen=True):
    """ "YYYYMMDDTHHMMSS+hhmm"."""

    datetime: Annotated[str, STRING]


@command("common.Common.PowerOff", 0, 4, 5)
class PowerOff(Message, frozen=True):
    pass


@event("common.CommonState.AllStatesChanged", 0, 5, 0)
class AllStatesChanged(Message, frozen=True):
    pass


@event("common.CommonState.BatteryStateChanged", 0, 5, 1)
class BatteryStateChanged(Message, frozen=True):
    percent: Annotated[int, U8]


@event("common.CommonState.CurrentDateChanged", 0, 5, 4)
class CurrentDateChanged(Message, frozen=True):
    date: Annotated[str, STRING]


@event("common.CommonState.CurrentTimeChanged", 0, 5, 5)
class CurrentTimeChanged(Message, frozen=True):
    time: Annotated[str, STRING]


@event("common.CommonState.WifiSignalChanged", 0, 5, 7, Buffer.NON_ACK)
class WifiSignalChanged(Message, frozen=True):
    rssi: Annotated[int, I16]


@event("common.CommonState.SensorsStatesListChanged", 0, 5, 8)
class SensorsStatesListChanged(Message, frozen=True):
    sensorName: Annotated[Sensor, ENUM]
    sensorState: Annotated[int, U8]


@event("common.CommonState.CurrentDateTimeChanged", 0, 5, 15)
class CurrentDateTimeChanged(Message, frozen=True):
    datetime: Annotated[str, STRING]


@event("common.CommonState.LinkSignalQuality", 0, 5, 16)
class LinkSignalQuality(Message, frozen=True):
    """Bits 0-3: quality 1..5; bit 6: 4G interference; bit 7: link perturbed."""

    value: Annotated[int, U8]


@event("common.CommonState.BootId", 0, 5, 17)
class BootId(Message, frozen=True):
    bootId: Annotated[str, STRING]


@event("common.CommonState.FlightId", 0, 5, 18)
class FlightId(Message, frozen=True):
    """A new id at each take-off, empty after landing."""

    flightId: Annotated[str, STRING]


@command("common.Mavlink.Start", 0, 11, 0)
class Start(Message, frozen=True):
    filepath: Annotated[str, STRING]
    type: Annotated[MavlinkType, ENUM]


@command("common.Mavlink.Pause", 0, 11, 1)
class Pause(Message, frozen=True):
    pass


@command("common.Mavlink.Stop", 0, 11, 2)
class Stop(Message, frozen=True):
    pass


@event("common.MavlinkState.MavlinkFilePlayingStateChanged", 0, 12, 0)
class MavlinkFilePlayingStateChanged(Message, frozen=True):
    state: Annotated[PlayingState, ENUM]
    filepath: Annotated[str, STRING]
    type: Annotated[MavlinkType, ENUM]


@event("common.MavlinkState.MavlinkPlayErrorStateChanged", 0, 12, 1)
class MavlinkPlayErrorStateChanged(Message, frozen=True):
    error: Annotated[PlayError, ENUM]


@event("common.MavlinkState.MissionItemExecuted", 0, 12, 2)
class MissionItemExecuted(Message, frozen=True):
    idx: Annotated[int, U32]


@command("common.FlightPlanSettings.ReturnHomeOnDisconnect", 0, 32, 0)
class ReturnHomeOnDisconnect(Message, frozen=True):
    value: Annotated[int, U8]


@event("common.FlightPlanSettingsState.ReturnHomeOnDisconnectChanged", 0, 33, 0)
class ReturnHomeOnDisconnectChanged(Message, frozen=True):
    state: Annotated[int, U8]
    isReadOnly: Annotated[int, U8]


@command("common.Calibration.MagnetoCalibration", 0, 13, 0)
class MagnetoCalibration(Message, frozen=True):
    calibrate: Annotated[int, U8]


@event("common.CalibrationState.MagnetoCalibrationStateChanged", 0, 14, 0)
class MagnetoCalibrationStateChanged(Message, frozen=True):
    xAxisCalibration: Annotated[int, U8]
    yAxisCalibration: Annotated[int, U8]
    zAxisCalibration: Annotated[int, U8]
    calibrationFailed: Annotated[int, U8]


@event("common.CalibrationState.MagnetoCalibrationRequiredState", 0, 14, 1)
class MagnetoCalibrationRequiredState(Message, frozen=True):
    """0 not required, 1 required, 2 recommended."""

    required: Annotated[int, U8]


@event("common.CalibrationState.MagnetoCalibrationAxisToCalibrateChanged", 0, 14, 2)
class MagnetoCalibrationAxisToCalibrateChanged(Message, frozen=True):
    axis: Annotated[CalibrationAxis, ENUM]


@event("common.CalibrationState.MagnetoCalibrationStartedChanged", 0, 14, 3)
class MagnetoCalibrationStartedChanged(Message, frozen=True):
    started: Annotated[int, U8]


@event("common.FlightPlanState.AvailabilityStateChanged", 0, 17, 0)
class AvailabilityStateChanged(Message, frozen=True):
    AvailabilityState: Annotated[int, U8]


@event("common.FlightPlanState.ComponentStateListChanged", 0, 17, 1)
class ComponentStateListChanged(Message, frozen=True):
    component: Annotated[FlightPlanComponent, ENUM]
    State: Annotated[int, U8]


@event("common.FlightPlanState.LockStateChanged", 0, 17, 2)
class LockStateChanged(Message, frozen=True):
    LockState: Annotated[int, U8]


@event("common.FlightPlanEvent.StartingErrorEvent", 0, 19, 0)
class StartingErrorEvent(Message, frozen=True):
    pass


@event("common.FlightPlanEvent.SpeedBridleEvent", 0, 19, 1)
class SpeedBridleEvent(Message, frozen=True):
    pass


@event("common.RunState.RunIdChanged", 0, 30, 0)
class RunIdChanged(Message, frozen=True):
    runId: Annotated[str, STRING]


@command("common.Network.Disconnect", 0, 0, 0)
class Disconnect(Message, frozen=True):
    pass


@command("common.Settings.Country", 0, 2, 3)
class Country(Message, frozen=True):
    code: Annotated[str, STRING]


@command("common.Settings.AutoCountry", 0, 2, 4)
class AutoCountry(Message, frozen=True):
    automatic: Annotated[int, U8]


@event("common.CommonState.MassStorageStateListChanged", 0, 5, 2)
class MassStorageStateListChanged(Message, frozen=True):
    mass_storage_id: Annotated[int, U8]
    name: Annotated[str, STRING]


@event("common.CommonState.MassStorageInfoStateListChanged", 0, 5, 3)
class MassStorageInfoStateListChanged(Message, frozen=True):
    mass_storage_id: Annotated[int, U8]
    size: Annotated[int, U32]
    used_size: Annotated[int, U32]
    plugged: Annotated[int, U8]
    full: Annotated[int, U8]
    internal: Annotated[int, U8]


@event("common.CommonState.MassStorageInfoRemainingListChanged", 0, 5, 6)
class MassStorageInfoRemainingListChanged(Message, frozen=True):
    free_space: Annotated[int, U32]
    rec_time: Annotated[int, U16]
    photo_remaining: Annotated[int, U32]


@event("common.CommonState.CountryListKnown", 0, 5, 10)
class CountryListKnown(Message, frozen=True):
    listFlags: Annotated[int, U8]
    countryCodes: Annotated[str, STRING]


@event("common.CommonState.MassStorageContent", 0, 5, 12)
class MassStorageContent(Message, frozen=True):
    mass_storage_id: Annotated[int, U8]
    nbPhotos: Annotated[int, U16]
    nbVideos: Annotated[int, U16]
    nbPuds: Annotated[int, U16]
    nbCrashLogs: Annotated[int, U16]
    nbRawPhotos: Annotated[int, U16]


@event("common.CommonState.MassStorageContentForCurrentRun", 0, 5, 13)
class MassStorageContentForCurrentRun(Message, frozen=True):
    mass_storage_id: Annotated[int, U8]
    nbPhotos: Annotated[int, U16]
    nbVideos: Annotated[int, U16]
    nbRawPhotos: Annotated[int, U16]


@event("common.CommonState.VideoRecordingTimestamp", 0, 5, 14)
class VideoRecordingTimestamp(Message, frozen=True):
    startTimestamp: Annotated[int, U64]
    stopTimestamp: Annotated[int, U64]


@command("common.Controller.isPiloting", 0, 8, 0)
class IsPiloting(Message, frozen=True):
    piloting: Annotated[int, U8]


@command("common.Controller.PeerStateChanged", 0, 8, 1)
class PeerStateChanged(Message, frozen=True):
    state: Annotated[PeerState, ENUM]
    type: Annotated[PeerType, ENUM]
    peerName: Annotated[str, STRING]
    peerId: Annotated[str, STRING]
    peerType: Annotated[str, STRING]


@command("common.GPS.ControllerPositionForRun", 0, 16, 0)
class ControllerPositionForRun(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]


@event("common.ARLibsVersionsState.ControllerLibARCommandsVersion", 0, 18, 0)
class ControllerLibARCommandsVersion(Message, frozen=True):
    version: Annotated[str, STRING]


@event("common.ARLibsVersionsState.SkyControllerLibARCommandsVersion", 0, 18, 1)
class SkyControllerLibARCommandsVersion(Message, frozen=True):
    version: Annotated[str, STRING]


@event("common.ARLibsVersionsState.DeviceLibARCommandsVersion", 0, 18, 2)
class DeviceLibARCommandsVersion(Message, frozen=True):
    version: Annotated[str, STRING]


@command("common.Factory.Reset", 0, 31, 0)
class FactoryReset(Message, frozen=True):
    pass


@event("common.UpdateState.UpdateStateChanged", 0, 34, 0)
class UpdateStateChanged(Message, frozen=True):
    sourceVersion: Annotated[str, STRING]
    targetVersion: Annotated[str, STRING]
    status: Annotated[UpdateStatus, ENUM]

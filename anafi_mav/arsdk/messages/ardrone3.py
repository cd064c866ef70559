"""Project 1, ardrone3: piloting, its states and settings, GPS, home.

Units and signs stand where they surprise.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import (
    ENUM,
    F32,
    F64,
    I8,
    STRING,
    U8,
    U16,
    U32,
    Buffer,
    Message,
    OpenEnum,
    command,
    event,
    value,
)


class OrientationMode(OpenEnum):
    NONE = 0
    TO_TARGET = 1
    HEADING_START = 2
    HEADING_DURING = 3


class PoiMode(OpenEnum):
    LOCKED_GIMBAL = 0
    LOCKED_ONCE_GIMBAL = 1
    FREE_GIMBAL = 2
    LOCKED_ONCE_GIMBAL_AND_EXIT = 3


class FlyingState(OpenEnum):
    """Flying state (ardrone3.xml 1-4-1)."""

    LANDED = 0
    TAKINGOFF = 1
    HOVERING = 2
    FLYING = 3
    LANDING = 4
    EMERGENCY = 5
    USERTAKEOFF = 6
    MOTOR_RAMPING = 7
    EMERGENCY_LANDING = 8


class AlertState(OpenEnum):
    NONE = 0
    USER = 1
    CUT_OUT = 2
    CRITICAL_BATTERY = 3
    LOW_BATTERY = 4
    TOO_MUCH_ANGLE = 5
    ALMOST_EMPTY_BATTERY = 6
    MAGNETO_PERTUBATION = 7
    MAGNETO_LOW_EARTH_FIELD = 8


class NavigateHomeState(OpenEnum):
    AVAILABLE = 0
    IN_PROGRESS = 1
    UNAVAILABLE = 2
    PENDING = 3


class NavigateHomeReason(OpenEnum):
    USER_REQUEST = 0
    CONNECTION_LOST = 1
    LOW_BATTERY = 2
    FINISHED = 3
    STOPPED = 4
    DISABLED = 5
    ENABLED = 6
    FLIGHTPLAN = 7
    ICING = 8


class LandingState(OpenEnum):
    LINEAR = 0
    SPIRAL = 1


class MoveToStatus(OpenEnum):
    RUNNING = 0
    DONE = 1
    CANCELED = 2
    ERROR = 3


class Motion(OpenEnum):
    STEADY = 0
    MOVING = 1


class PoiStatus(OpenEnum):
    UNAVAILABLE = 0
    AVAILABLE = 1
    PENDING = 2
    RUNNING = 3


class BatteryCapacityStatus(OpenEnum):
    OK = 0
    WARNING = 1
    CRITICAL = 2
    UNKNOWN = 3


class ForcedLandingReason(OpenEnum):
    NONE = 0
    BATTERY_CRITICAL_SOON = 1
    PROPELLER_ICING_CRITICAL = 2
    BATTERY_TOO_COLD = 3
    BATTERY_TOO_HOT = 4
    ESC_TOO_HOT = 5
    CELL_VOLTAGE_TOO_LOW = 6
    DEFECTIVE_SENSOR = 7
    FLYAWAY_DETECTED = 8


class WarningLevel(OpenEnum):
    OK = 0
    WARNING = 1
    CRITICAL = 2


class MoveByError(OpenEnum):
    OK = 0
    UNKNOWN = 1
    BUSY = 2
    NOT_AVAILABLE = 3
    INTERRUPTED = 4


class MotorError(OpenEnum):
    NO_ERROR = 0
    ERROR_EEPROM = 1
    ERROR_MOTOR_STALLED = 2
    ERROR_PROPELLER_SECURITY = 3
    ERROR_COMM_LOST = 4
    ERROR_RCEMERGENCY_STOP = 5
    ERROR_REAL_TIME = 6
    ERROR_MOTOR_SETTING = 7
    ERROR_TEMPERATURE = 8
    ERROR_BATTERY_VOLTAGE = 9
    ERROR_LIPO_CELLS = 10
    ERROR_MOSFET = 11
    ERROR_BOOTLOADER = 12
    ERROR_ASSERT = 13


class LastMotorError(OpenEnum):
    NO_ERROR = 0
    ERROR_EEPROM = 1
    ERROR_MOTOR_STALLED = 2
    ERROR_PROPELLER_SECURITY = 3
    ERROR_COMM_LOST = 4
    ERROR_RCEMERGENCY_STOP = 5
    ERROR_REAL_TIME = 6
    ERROR_MOTOR_SETTING = 7
    ERROR_BATTERY_VOLTAGE = 8
    ERROR_LIPO_CELLS = 9
    ERROR_MOSFET = 10
    ERROR_TEMPERATURE = 11
    ERROR_BOOTLOADER = 12
    ERROR_ASSERT = 13


class HomeTypeSetting(OpenEnum):
    TAKEOFF = 0
    PILOT = 1
    FOLLOWEE = 2


class GpsUpdateState(OpenEnum):
    UPDATED = 0
    IN_PROGRESS = 1
    FAILED = 2


class AvailableHomeType(OpenEnum):
    TAKEOFF = 0
    PILOT = 1
    FIRST_FIX = 2
    FOLLOWEE = 3


class AlertSoundState(OpenEnum):
    STOPPED = 0
    PLAYING = 1


class CircleDirection(OpenEnum):
    CW = 0
    CCW = 1
    DEFAULT = 2


class MoveByStatus(OpenEnum):
    RUNNING = 0
    DONE = 1
    CANCELED = 2
    ERROR = 3


@command("ardrone3.Piloting.TakeOff", 1, 0, 1)
class TakeOff(Message, frozen=True):
    """Motors on and up to about 1 m.

    Confirmed by FlyingStateChanged(takingoff); refused by silence.
    """


@command("ardrone3.Piloting.PCMD", 1, 0, 2, Buffer.NON_ACK)
class PCMD(Message, frozen=True):
    """Stick positions, in percent of the limits that the drone reports.

    The limits are MaxTilt, MaxRotationSpeed and MaxVerticalSpeed.

    Not acknowledged; Parrot sends one every 50 ms. `flag` 1 makes roll and pitch count, with 0 the drone
    brakes by itself. Signs: roll + right, pitch + nose DOWN (forward), yaw + clockwise, gaz + up, each
    -100..100. Positive gaz during a landing cancels the landing. `timestampAndSeqNum` carries a sequence
    number in its top byte and milliseconds below; the drone uses it for statistics only.
    """

    flag: Annotated[int, U8]
    roll: Annotated[int, I8]
    pitch: Annotated[int, I8]
    yaw: Annotated[int, I8]
    gaz: Annotated[int, I8]
    timestampAndSeqNum: Annotated[int, U32]


@command("ardrone3.Piloting.Landing", 1, 0, 3)
class Landing(Message, frozen=True):
    """Land here. Confirmed by FlyingStateChanged(landing)."""


@command("ardrone3.Piloting.Emergency", 1, 0, 4, Buffer.HIGH_PRIO)
class Emergency(Message, frozen=True):
    """Cut the motors at once, wherever the drone is: in the air it falls."""


@command("ardrone3.Piloting.NavigateHome", 1, 0, 5)
class NavigateHome(Message, frozen=True):
    start: Annotated[int, U8]


@command("ardrone3.Piloting.moveBy", 1, 0, 7)
class MoveBy(Message, frozen=True):
    """Fly relative to the body: front, right, DOWN in m, then turn clockwise by dPsi rad.

    Ends in moveByEnd.

    All zero cancels a running moveBy: it ends with error `interrupted`.
    """

    dX: Annotated[float, F32]
    dY: Annotated[float, F32]
    dZ: Annotated[float, F32]
    dPsi: Annotated[float, F32]


@command("ardrone3.Piloting.UserTakeOff", 1, 0, 8)
class UserTakeOff(Message, frozen=True):
    state: Annotated[int, U8]


@command("ardrone3.Piloting.moveTo", 1, 0, 10)
class MoveTo(Message, frozen=True):
    """Fly to a place: deg, deg, m above take-off; heading in deg clockwise from north.

    Answered by moveToChanged(RUNNING).
    """

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    orientation_mode: Annotated[OrientationMode, ENUM]
    heading: Annotated[float, F32]


@command("ardrone3.Piloting.CancelMoveTo", 1, 0, 11)
class CancelMoveTo(Message, frozen=True):
    pass


@command("ardrone3.Piloting.StartPilotedPOIV2", 1, 0, 15)
class StartPilotedPOIV2(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    mode: Annotated[PoiMode, ENUM]


@command("ardrone3.Piloting.StopPilotedPOI", 1, 0, 13)
class StopPilotedPOI(Message, frozen=True):
    pass


@command("ardrone3.Piloting.SmartTakeOffLand", 1, 0, 16)
class SmartTakeOffLand(Message, frozen=True):
    pass


@event("ardrone3.PilotingState.FlyingStateChanged", 1, 4, 1)
class FlyingStateChanged(Message, frozen=True):
    state: Annotated[FlyingState, ENUM]


@event("ardrone3.PilotingState.AlertStateChanged", 1, 4, 2)
class AlertStateChanged(Message, frozen=True):
    state: Annotated[AlertState, ENUM]


@event("ardrone3.PilotingState.NavigateHomeStateChanged", 1, 4, 3)
class NavigateHomeStateChanged(Message, frozen=True):
    state: Annotated[NavigateHomeState, ENUM]
    reason: Annotated[NavigateHomeReason, ENUM]


@value("ardrone3.PilotingState.PositionChanged", 1, 4, 4)
class PositionChanged(Message, frozen=True):
    """Deprecated twin of GpsLocationChanged. deg, deg (500 = unknown), m above mean sea level."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]


@value("ardrone3.PilotingState.SpeedChanged", 1, 4, 5)
class SpeedChanged(Message, frozen=True):
    """Ground speed in m/s along north, east and down."""

    speedX: Annotated[float, F32]
    speedY: Annotated[float, F32]
    speedZ: Annotated[float, F32]


@value("ardrone3.PilotingState.AttitudeChanged", 1, 4, 6)
class AttitudeChanged(Message, frozen=True):
    """Attitude in rad: roll + right wing down, pitch + nose up, yaw clockwise from north."""

    roll: Annotated[float, F32]
    pitch: Annotated[float, F32]
    yaw: Annotated[float, F32]


@value("ardrone3.PilotingState.AltitudeChanged", 1, 4, 8)
class AltitudeChanged(Message, frozen=True):
    """Height above the take-off point, m."""

    altitude: Annotated[float, F64]


@value("ardrone3.PilotingState.GpsLocationChanged", 1, 4, 9)
class GpsLocationChanged(Message, frozen=True):
    """GNSS position with accuracies.

    deg, deg (500 = unknown), m above mean sea level; accuracies are one standard deviation in m, -1 = unknown.
    """

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    latitude_accuracy: Annotated[int, I8]
    longitude_accuracy: Annotated[int, I8]
    altitude_accuracy: Annotated[int, I8]


@event("ardrone3.PilotingState.LandingStateChanged", 1, 4, 10)
class LandingStateChanged(Message, frozen=True):
    state: Annotated[LandingState, ENUM]


@event("ardrone3.PilotingState.moveToChanged", 1, 4, 12)
class MoveToChanged(Message, frozen=True):
    """Progress of a moveTo; the target fields repeat the command they answer."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    orientation_mode: Annotated[OrientationMode, ENUM]
    heading: Annotated[float, F32]
    status: Annotated[MoveToStatus, ENUM]


@event("ardrone3.PilotingState.MotionState", 1, 4, 13)
class MotionState(Message, frozen=True):
    state: Annotated[Motion, ENUM]


@event("ardrone3.PilotingState.PilotedPOIV2", 1, 4, 22)
class PilotedPOIV2(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    mode: Annotated[PoiMode, ENUM]
    status: Annotated[PoiStatus, ENUM]


@event("ardrone3.PilotingState.ReturnHomeBatteryCapacity", 1, 4, 15)
class ReturnHomeBatteryCapacity(Message, frozen=True):
    status: Annotated[BatteryCapacityStatus, ENUM]


@event("ardrone3.PilotingState.HoveringWarning", 1, 4, 17)
class HoveringWarning(Message, frozen=True):
    no_gps_too_dark: Annotated[int, U8]
    no_gps_too_high: Annotated[int, U8]


@event("ardrone3.PilotingState.ForcedLandingAutoTrigger", 1, 4, 18)
class ForcedLandingAutoTrigger(Message, frozen=True):
    reason: Annotated[ForcedLandingReason, ENUM]
    delay: Annotated[int, U32]


@event("ardrone3.PilotingState.WindStateChanged", 1, 4, 19)
class WindStateChanged(Message, frozen=True):
    state: Annotated[WarningLevel, ENUM]


@event("ardrone3.PilotingState.VibrationLevelChanged", 1, 4, 20)
class VibrationLevelChanged(Message, frozen=True):
    state: Annotated[WarningLevel, ENUM]


@value("ardrone3.PilotingState.AltitudeAboveGroundChanged", 1, 4, 21)
class AltitudeAboveGroundChanged(Message, frozen=True):
    """Distance to the ground below, m."""

    altitude: Annotated[float, F32]


@event("ardrone3.PilotingState.HeadingLockedStateChanged", 1, 4, 23)
class HeadingLockedStateChanged(Message, frozen=True):
    state: Annotated[WarningLevel, ENUM]


@event("ardrone3.PilotingState.IcingLevelChanged", 1, 4, 26)
class IcingLevelChanged(Message, frozen=True):
    state: Annotated[WarningLevel, ENUM]


@event("ardrone3.PilotingEvent.moveByEnd", 1, 34, 0)
class MoveByEnd(Message, frozen=True):
    """A moveBy ended after having flown these distances (m, rad; front, right, down, clockwise)."""

    dX: Annotated[float, F32]
    dY: Annotated[float, F32]
    dZ: Annotated[float, F32]
    dPsi: Annotated[float, F32]
    error: Annotated[MoveByError, ENUM]


@event("ardrone3.PilotingEvent.UserTakeoffReady", 1, 34, 1)
class UserTakeoffReady(Message, frozen=True):
    pass


@command("ardrone3.PilotingSettings.MaxAltitude", 1, 2, 0)
class MaxAltitude(Message, frozen=True):
    current: Annotated[float, F32]


@command("ardrone3.PilotingSettings.MaxTilt", 1, 2, 1)
class MaxTilt(Message, frozen=True):
    current: Annotated[float, F32]


@command("ardrone3.PilotingSettings.MaxDistance", 1, 2, 3)
class MaxDistance(Message, frozen=True):
    """The argument is `value` although the event says `current`: Parrot's own names."""

    value: Annotated[float, F32]


@command("ardrone3.PilotingSettings.NoFlyOverMaxDistance", 1, 2, 4)
class NoFlyOverMaxDistance(Message, frozen=True):
    shouldNotFlyOver: Annotated[int, U8]


@command("ardrone3.PilotingSettings.BankedTurn", 1, 2, 10)
class BankedTurn(Message, frozen=True):
    value: Annotated[int, U8]


@command("ardrone3.PilotingSettings.MaxHorizontalSpeed", 1, 2, 17)
class MaxHorizontalSpeed(Message, frozen=True):
    current: Annotated[float, F32]


@event("ardrone3.PilotingSettingsState.MaxAltitudeChanged", 1, 6, 0)
class MaxAltitudeChanged(Message, frozen=True):
    """Ceiling, m above take-off; always enforced."""

    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("ardrone3.PilotingSettingsState.MaxTiltChanged", 1, 6, 1)
class MaxTiltChanged(Message, frozen=True):
    """Largest tilt that PCMD can ask for, deg."""

    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("ardrone3.PilotingSettingsState.MaxDistanceChanged", 1, 6, 3)
class MaxDistanceChanged(Message, frozen=True):
    """Radius of the geofence round the take-off point, m.

    Enforced only with NoFlyOverMaxDistance.
    """

    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("ardrone3.PilotingSettingsState.NoFlyOverMaxDistanceChanged", 1, 6, 4)
class NoFlyOverMaxDistanceChanged(Message, frozen=True):
    shouldNotFlyOver: Annotated[int, U8]


@event("ardrone3.PilotingSettingsState.BankedTurnChanged", 1, 6, 10)
class BankedTurnChanged(Message, frozen=True):
    state: Annotated[int, U8]


@event("ardrone3.PilotingSettingsState.MaxHorizontalSpeedChanged", 1, 6, 17)
class MaxHorizontalSpeedChanged(Message, frozen=True):
    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@command("ardrone3.SpeedSettings.MaxVerticalSpeed", 1, 11, 0)
class MaxVerticalSpeed(Message, frozen=True):
    current: Annotated[float, F32]


@command("ardrone3.SpeedSettings.MaxRotationSpeed", 1, 11, 1)
class MaxRotationSpeed(Message, frozen=True):
    current: Annotated[float, F32]


@command("ardrone3.SpeedSettings.MaxPitchRollRotationSpeed", 1, 11, 4)
class MaxPitchRollRotationSpeed(Message, frozen=True):
    current: Annotated[float, F32]


@event("ardrone3.SpeedSettingsState.MaxVerticalSpeedChanged", 1, 12, 0)
class MaxVerticalSpeedChanged(Message, frozen=True):
    """m/s."""

    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("ardrone3.SpeedSettingsState.MaxRotationSpeedChanged", 1, 12, 1)
class MaxRotationSpeedChanged(Message, frozen=True):
    """deg/s."""

    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("ardrone3.SpeedSettingsState.MaxPitchRollRotationSpeedChanged", 1, 12, 4)
class MaxPitchRollRotationSpeedChanged(Message, frozen=True):
    """deg/s."""

    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("ardrone3.SettingsState.ProductMotorVersionListChanged", 1, 16, 0)
class ProductMotorVersionListChanged(Message, frozen=True):
    motor_number: Annotated[int, U8]
    type: Annotated[str, STRING]
    software: Annotated[str, STRING]
    hardware: Annotated[str, STRING]


@event("ardrone3.SettingsState.ProductGPSVersionChanged", 1, 16, 1)
class ProductGPSVersionChanged(Message, frozen=True):
    software: Annotated[str, STRING]
    hardware: Annotated[str, STRING]


@event("ardrone3.SettingsState.MotorErrorStateChanged", 1, 16, 2)
class MotorErrorStateChanged(Message, frozen=True):
    motorIds: Annotated[int, U8]
    motorError: Annotated[MotorError, ENUM]


@event("ardrone3.SettingsState.MotorSoftwareVersionChanged", 1, 16, 3)
class MotorSoftwareVersionChanged(Message, frozen=True):
    version: Annotated[str, STRING]


@event("ardrone3.SettingsState.MotorFlightsStatusChanged", 1, 16, 4)
class MotorFlightsStatusChanged(Message, frozen=True):
    nbFlights: Annotated[int, U16]
    lastFlightDuration: Annotated[int, U16]
    totalFlightDuration: Annotated[int, U32]


@event("ardrone3.SettingsState.MotorErrorLastErrorChanged", 1, 16, 5)
class MotorErrorLastErrorChanged(Message, frozen=True):
    motorError: Annotated[LastMotorError, ENUM]


@event("ardrone3.SettingsState.P7ID", 1, 16, 6)
class P7ID(Message, frozen=True):
    serialID: Annotated[str, STRING]


@event("ardrone3.SettingsState.CPUID", 1, 16, 7)
class CPUID(Message, frozen=True):
    id: Annotated[str, STRING]


@command("ardrone3.GPSSettings.SetHome", 1, 23, 0)
class SetHome(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]


@command("ardrone3.GPSSettings.ResetHome", 1, 23, 1)
class ResetHome(Message, frozen=True):
    pass


@command("ardrone3.GPSSettings.SendControllerGPS", 1, 23, 2)
class SendControllerGPS(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    horizontalAccuracy: Annotated[float, F64]
    verticalAccuracy: Annotated[float, F64]


@command("ardrone3.GPSSettings.HomeType", 1, 23, 3)
class HomeType(Message, frozen=True):
    type: Annotated[HomeTypeSetting, ENUM]


@command("ardrone3.GPSSettings.ReturnHomeDelay", 1, 23, 4)
class ReturnHomeDelay(Message, frozen=True):
    delay: Annotated[int, U16]


@command("ardrone3.GPSSettings.ReturnHomeMinAltitude", 1, 23, 5)
class ReturnHomeMinAltitude(Message, frozen=True):
    value: Annotated[float, F32]


@event("ardrone3.GPSSettingsState.HomeChanged", 1, 24, 0)
class HomeChanged(Message, frozen=True):
    """deg, deg, m; 500 = unknown."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]


@event("ardrone3.GPSSettingsState.ResetHomeChanged", 1, 24, 1)
class ResetHomeChanged(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]


@event("ardrone3.GPSSettingsState.GPSFixStateChanged", 1, 24, 2)
class GPSFixStateChanged(Message, frozen=True):
    fixed: Annotated[int, U8]


@event("ardrone3.GPSSettingsState.GPSUpdateStateChanged", 1, 24, 3)
class GPSUpdateStateChanged(Message, frozen=True):
    state: Annotated[GpsUpdateState, ENUM]


@event("ardrone3.GPSSettingsState.HomeTypeChanged", 1, 24, 4)
class HomeTypeChanged(Message, frozen=True):
    type: Annotated[HomeTypeSetting, ENUM]


@event("ardrone3.GPSSettingsState.ReturnHomeDelayChanged", 1, 24, 5)
class ReturnHomeDelayChanged(Message, frozen=True):
    delay: Annotated[int, U16]


@event("ardrone3.GPSSettingsState.GeofenceCenterChanged", 1, 24, 6)
class GeofenceCenterChanged(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]


@event("ardrone3.GPSSettingsState.ReturnHomeMinAltitudeChanged", 1, 24, 7)
class ReturnHomeMinAltitudeChanged(Message, frozen=True):
    value: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("ardrone3.GPSState.NumberOfSatelliteChanged", 1, 31, 0)
class NumberOfSatelliteChanged(Message, frozen=True):
    numberOfSatellite: Annotated[int, U8]


@event("ardrone3.GPSState.HomeTypeAvailabilityChanged", 1, 31, 1)
class HomeTypeAvailabilityChanged(Message, frozen=True):
    type: Annotated[AvailableHomeType, ENUM]
    available: Annotated[int, U8]


@event("ardrone3.GPSState.HomeTypeChosenChanged", 1, 31, 2)
class HomeTypeChosenChanged(Message, frozen=True):
    type: Annotated[AvailableHomeType, ENUM]


@command("ardrone3.Sound.StartAlertSound", 1, 35, 0)
class StartAlertSound(Message, frozen=True):
    pass


@command("ardrone3.Sound.StopAlertSound", 1, 35, 1)
class StopAlertSound(Message, frozen=True):
    pass


@event("ardrone3.SoundState.AlertSound", 1, 36, 0)
class AlertSound(Message, frozen=True):
    state: Annotated[AlertSoundState, ENUM]


@command("ardrone3.Piloting.Circle", 1, 0, 9)
class Circle(Message, frozen=True):
    """Fixed wing only: no ANAFI does it."""

    direction: Annotated[CircleDirection, ENUM]


@command("ardrone3.Piloting.StartPilotedPOI", 1, 0, 12)
class StartPilotedPOI(Message, frozen=True):
    """The form without a mode, before `StartPilotedPOIV2`."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]


@command("ardrone3.Piloting.CancelMoveBy", 1, 0, 14)
class CancelMoveBy(Message, frozen=True):
    """Not supported by the ANAFIs: they cancel with a move by nothing."""


@event("ardrone3.PilotingState.AirSpeedChanged", 1, 4, 11, Buffer.NON_ACK)
class AirSpeedChanged(Message, frozen=True):
    """m/s."""

    airSpeed: Annotated[float, F32]


@event("ardrone3.PilotingState.PilotedPOI", 1, 4, 14)
class PilotedPOI(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    status: Annotated[PoiStatus, ENUM]


@event("ardrone3.PilotingState.moveByChanged", 1, 4, 16)
class MoveByChanged(Message, frozen=True):
    dXAsked: Annotated[float, F32]
    dYAsked: Annotated[float, F32]
    dZAsked: Annotated[float, F32]
    dPsiAsked: Annotated[float, F32]
    dX: Annotated[float, F32]
    dY: Annotated[float, F32]
    dZ: Annotated[float, F32]
    dPsi: Annotated[float, F32]
    status: Annotated[MoveByStatus, ENUM]

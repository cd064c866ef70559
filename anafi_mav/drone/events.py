"""Public names of a drone's messages: its events, and the enums in its states.

They are Parrot's, declared in `anafi_mav.arsdk.messages`; users of a `Drone` import them from here and need not know
the wire format.
"""

from anafi_mav.arsdk.codec.wire import Message as Message
from anafi_mav.arsdk.messages.alarms import TakeoffChecklist as TakeoffChecklist
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType as TakeoffChecklistType
from anafi_mav.arsdk.messages.animation import PlayMode as PlayMode
from anafi_mav.arsdk.messages.animation import Type as AnimationType
from anafi_mav.arsdk.messages.animation import VertigoFinishAction as VertigoFinishAction
from anafi_mav.arsdk.messages.ardrone3 import AlertState as AlertState
from anafi_mav.arsdk.messages.ardrone3 import AlertStateChanged as AlertStateChanged
from anafi_mav.arsdk.messages.ardrone3 import AltitudeAboveGroundChanged as AltitudeAboveGroundChanged
from anafi_mav.arsdk.messages.ardrone3 import AltitudeChanged as AltitudeChanged
from anafi_mav.arsdk.messages.ardrone3 import AttitudeChanged as AttitudeChanged
from anafi_mav.arsdk.messages.ardrone3 import BankedTurnChanged as BankedTurnChanged
from anafi_mav.arsdk.messages.ardrone3 import FlyingState as FlyingState
from anafi_mav.arsdk.messages.ardrone3 import FlyingStateChanged as FlyingStateChanged
from anafi_mav.arsdk.messages.ardrone3 import ForcedLandingAutoTrigger as ForcedLandingAutoTrigger
from anafi_mav.arsdk.messages.ardrone3 import ForcedLandingReason as ForcedLandingReason
from anafi_mav.arsdk.messages.ardrone3 import GPSFixStateChanged as GPSFixStateChanged
from anafi_mav.arsdk.messages.ardrone3 import GpsLocationChanged as GpsLocationChanged
from anafi_mav.arsdk.messages.ardrone3 import HomeChanged as HomeChanged
from anafi_mav.arsdk.messages.ardrone3 import HoveringWarning as HoveringWarning
from anafi_mav.arsdk.messages.ardrone3 import IcingLevelChanged as IcingLevelChanged
from anafi_mav.arsdk.messages.ardrone3 import MaxAltitudeChanged as MaxAltitudeChanged
from anafi_mav.arsdk.messages.ardrone3 import MaxDistanceChanged as MaxDistanceChanged
from anafi_mav.arsdk.messages.ardrone3 import MaxHorizontalSpeedChanged as MaxHorizontalSpeedChanged
from anafi_mav.arsdk.messages.ardrone3 import MaxPitchRollRotationSpeedChanged as MaxPitchRollRotationSpeedChanged
from anafi_mav.arsdk.messages.ardrone3 import MaxRotationSpeedChanged as MaxRotationSpeedChanged
from anafi_mav.arsdk.messages.ardrone3 import MaxTiltChanged as MaxTiltChanged
from anafi_mav.arsdk.messages.ardrone3 import MaxVerticalSpeedChanged as MaxVerticalSpeedChanged
from anafi_mav.arsdk.messages.ardrone3 import MotorError as MotorError
from anafi_mav.arsdk.messages.ardrone3 import MotorErrorStateChanged as MotorErrorStateChanged
from anafi_mav.arsdk.messages.ardrone3 import MotorFlightsStatusChanged as MotorFlightsStatusChanged
from anafi_mav.arsdk.messages.ardrone3 import MoveToChanged as MoveToChanged
from anafi_mav.arsdk.messages.ardrone3 import MoveToStatus as MoveToStatus
from anafi_mav.arsdk.messages.ardrone3 import NoFlyOverMaxDistanceChanged as NoFlyOverMaxDistanceChanged
from anafi_mav.arsdk.messages.ardrone3 import NumberOfSatelliteChanged as NumberOfSatelliteChanged
from anafi_mav.arsdk.messages.ardrone3 import OrientationMode as OrientationMode
from anafi_mav.arsdk.messages.ardrone3 import PilotedPOIV2 as PilotedPOIV2
from anafi_mav.arsdk.messages.ardrone3 import PoiMode as PoiMode
from anafi_mav.arsdk.messages.ardrone3 import PoiStatus as PoiStatus
from anafi_mav.arsdk.messages.ardrone3 import SpeedChanged as SpeedChanged
from anafi_mav.arsdk.messages.ardrone3 import VibrationLevelChanged as VibrationLevelChanged
from anafi_mav.arsdk.messages.ardrone3 import WarningLevel as WarningLevel
from anafi_mav.arsdk.messages.ardrone3 import WindStateChanged as WindStateChanged
from anafi_mav.arsdk.messages.battery import Alert as BatteryAlertChanged
from anafi_mav.arsdk.messages.battery import AlertLevel as AlertLevel
from anafi_mav.arsdk.messages.battery import BatteryAlert as BatteryAlert
from anafi_mav.arsdk.messages.battery import Capacity as BatteryCapacity
from anafi_mav.arsdk.messages.battery import Description as BatteryDescription
from anafi_mav.arsdk.messages.common import CalibrationAxis as CalibrationAxis
from anafi_mav.arsdk.messages.common import FlightId as FlightId
from anafi_mav.arsdk.messages.common import FlightPlanComponent as FlightPlanComponent
from anafi_mav.arsdk.messages.common import MagnetoCalibrationRequiredState as MagnetoCalibrationRequiredState
from anafi_mav.arsdk.messages.common import MagnetoCalibrationStartedChanged as MagnetoCalibrationStartedChanged
from anafi_mav.arsdk.messages.common import MagnetoCalibrationStateChanged as MagnetoCalibrationStateChanged
from anafi_mav.arsdk.messages.common import MavlinkFilePlayingStateChanged as MavlinkFilePlayingStateChanged
from anafi_mav.arsdk.messages.common import MavlinkType as MavlinkType
from anafi_mav.arsdk.messages.common import MissionItemExecuted as MissionItemExecuted
from anafi_mav.arsdk.messages.common import PlayError as PlayError
from anafi_mav.arsdk.messages.common import PlayingState as PlayingState
from anafi_mav.arsdk.messages.common import ReturnHomeOnDisconnectChanged as ReturnHomeOnDisconnectChanged
from anafi_mav.arsdk.messages.common import Sensor as Sensor
from anafi_mav.arsdk.messages.common import SensorsStatesListChanged as SensorsStatesListChanged
from anafi_mav.arsdk.messages.flight_plan import Indicator as FlightPlanIndicator
from anafi_mav.arsdk.messages.flight_plan import WaypointSkipped as WaypointSkipped
from anafi_mav.arsdk.messages.follow_me import Mode as FollowMeMode
from anafi_mav.arsdk.messages.gimbal import Attitude as GimbalAttitudeChanged
from anafi_mav.arsdk.messages.gimbal import Axis as Axis
from anafi_mav.arsdk.messages.gimbal import Error as GimbalError
from anafi_mav.arsdk.messages.gimbal import FrameOfReference as FrameOfReference
from anafi_mav.arsdk.messages.gimbal import GimbalCalibrationState as GimbalCalibrationState
from anafi_mav.arsdk.messages.gimbal import MaxSpeed as GimbalMaxSpeed
from anafi_mav.arsdk.messages.mapper import GrabAxisEvent as GrabAxisEvent
from anafi_mav.arsdk.messages.mapper import GrabButtonEvent as GrabButtonEvent
from anafi_mav.arsdk.messages.mapper import GrabState as GrabState
from anafi_mav.arsdk.messages.mediastore import MediastoreState as MediastoreState
from anafi_mav.arsdk.messages.obstacle_avoidance import Mode as ObstacleAvoidanceMode
from anafi_mav.arsdk.messages.obstacle_avoidance import Status as ObstacleAvoidanceStatus
from anafi_mav.arsdk.messages.piloting_style import PilotingStyleStyle as PilotingStyleStyle
from anafi_mav.arsdk.messages.piloting_style import Style as PilotingStyle
from anafi_mav.arsdk.messages.precise_home import Mode as PreciseHomeModeChanged
from anafi_mav.arsdk.messages.precise_home import PreciseHomeMode as PreciseHomeMode
from anafi_mav.arsdk.messages.precise_home import PreciseHomeState as PreciseHomeState
from anafi_mav.arsdk.messages.rth import AutoTriggerMode as ReturnAutoTriggerMode
from anafi_mav.arsdk.messages.rth import AutoTriggerReason as AutoTriggerReason
from anafi_mav.arsdk.messages.rth import Delay as ReturnDelay
from anafi_mav.arsdk.messages.rth import EndingBehavior as ReturnEnding
from anafi_mav.arsdk.messages.rth import EndingHoveringAltitude as ReturnEndingAltitude
from anafi_mav.arsdk.messages.rth import MinAltitude as ReturnMinAltitude
from anafi_mav.arsdk.messages.rth import PreferredHomeType as PreferredHomeType
from anafi_mav.arsdk.messages.rth import RthEndingBehavior as RthEndingBehavior
from anafi_mav.arsdk.messages.rth import RthHomeReachability as HomeReachability
from anafi_mav.arsdk.messages.rth import RthHomeType as RthHomeType
from anafi_mav.arsdk.messages.rth import RthState as RthState
from anafi_mav.arsdk.messages.rth import State as ReturnStateChanged
from anafi_mav.arsdk.messages.rth import StateReason as ReturnReason
from anafi_mav.arsdk.messages.rth import TakeoffLocation as TakeoffLocation
from anafi_mav.arsdk.messages.skyctrl import AttitudeChanged as ControllerAttitudeChanged
from anafi_mav.arsdk.messages.skyctrl import BatteryState as ControllerBatteryChanged
from anafi_mav.arsdk.messages.skyctrl import BatteryStatus as ControllerBatteryStatus
from anafi_mav.arsdk.messages.skyctrl import PilotingSource as PilotingSource
from anafi_mav.arsdk.messages.skyctrl import Shutdown as ControllerShutdown
from anafi_mav.arsdk.messages.thermal import ColorizationMode as ColorizationMode
from anafi_mav.arsdk.messages.thermal import PaletteMode as PaletteMode
from anafi_mav.arsdk.messages.thermal import Range as ThermalSensitivity
from anafi_mav.arsdk.messages.thermal import RelativeRangeMode as RelativeRangeMode
from anafi_mav.arsdk.messages.thermal import RenderingMode as RenderingMode
from anafi_mav.arsdk.messages.thermal import ShutterTrigger as ShutterTrigger
from anafi_mav.arsdk.messages.thermal import SpotType as SpotType
from anafi_mav.arsdk.messages.thermal import ThermalMode as ThermalMode
from anafi_mav.arsdk.messages.user_storage import Feature as StorageFeature
from anafi_mav.arsdk.messages.user_storage import FormattingType as FormattingType
from anafi_mav.arsdk.messages.user_storage import FsState as FsState
from anafi_mav.arsdk.messages.user_storage import PhyState as PhyState
from anafi_mav.drone.piloting.motors import Blocker as Blocker
from anafi_mav.drone.piloting.motors import BlockerKind as BlockerKind

__all__ = [
    "AlertLevel",
    "AlertState",
    "AlertStateChanged",
    "AltitudeAboveGroundChanged",
    "AltitudeChanged",
    "AnimationType",
    "AttitudeChanged",
    "AutoTriggerReason",
    "Axis",
    "BankedTurnChanged",
    "BatteryAlert",
    "BatteryAlertChanged",
    "BatteryCapacity",
    "BatteryDescription",
    "Blocker",
    "BlockerKind",
    "CalibrationAxis",
    "ControllerAttitudeChanged",
    "ControllerBatteryChanged",
    "ControllerBatteryStatus",
    "ControllerShutdown",
    "FlightId",
    "FlightPlanComponent",
    "FlightPlanIndicator",
    "FlyingState",
    "FlyingStateChanged",
    "FollowMeMode",
    "ForcedLandingAutoTrigger",
    "ForcedLandingReason",
    "FormattingType",
    "FrameOfReference",
    "FsState",
    "GPSFixStateChanged",
    "GimbalAttitudeChanged",
    "GimbalCalibrationState",
    "GimbalError",
    "GimbalMaxSpeed",
    "GpsLocationChanged",
    "GrabAxisEvent",
    "GrabButtonEvent",
    "GrabState",
    "HomeChanged",
    "HomeReachability",
    "HoveringWarning",
    "IcingLevelChanged",
    "MagnetoCalibrationRequiredState",
    "MagnetoCalibrationStartedChanged",
    "MagnetoCalibrationStateChanged",
    "MavlinkFilePlayingStateChanged",
    "MavlinkType",
    "MaxAltitudeChanged",
    "MaxDistanceChanged",
    "MaxHorizontalSpeedChanged",
    "MaxPitchRollRotationSpeedChanged",
    "MaxRotationSpeedChanged",
    "MaxTiltChanged",
    "MaxVerticalSpeedChanged",
    "MediastoreState",
    "Message",
    "MissionItemExecuted",
    "MotorError",
    "MotorErrorStateChanged",
    "MotorFlightsStatusChanged",
    "MoveToChanged",
    "MoveToStatus",
    "NoFlyOverMaxDistanceChanged",
    "NumberOfSatelliteChanged",
    "ObstacleAvoidanceMode",
    "ObstacleAvoidanceStatus",
    "OrientationMode",
    "PaletteMode",
    "PhyState",
    "PilotedPOIV2",
    "PilotingSource",
    "PilotingStyle",
    "PilotingStyleStyle",
    "PlayError",
    "PlayMode",
    "PlayingState",
    "PoiMode",
    "PoiStatus",
    "PreciseHomeMode",
    "PreciseHomeModeChanged",
    "PreciseHomeState",
    "PreferredHomeType",
    "RenderingMode",
    "ReturnAutoTriggerMode",
    "ReturnDelay",
    "ReturnEnding",
    "ReturnEndingAltitude",
    "ReturnHomeOnDisconnectChanged",
    "ReturnMinAltitude",
    "ReturnReason",
    "ReturnStateChanged",
    "RthEndingBehavior",
    "RthHomeType",
    "RthState",
    "Sensor",
    "SensorsStatesListChanged",
    "ShutterTrigger",
    "SpeedChanged",
    "StorageFeature",
    "TakeoffChecklist",
    "TakeoffChecklistType",
    "TakeoffLocation",
    "ThermalMode",
    "ThermalSensitivity",
    "VertigoFinishAction",
    "VibrationLevelChanged",
    "WarningLevel",
    "WaypointSkipped",
    "WindStateChanged",
]

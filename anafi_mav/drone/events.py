"""The words of a drone that its users need: the events a subscriber hears, and the enums in its states.

They are Parrot's, declared in `anafi_mav.arsdk.messages`; who works with a `Drone` takes them from here and need not
know the wire.
"""

from anafi_mav.arsdk.messages.ardrone3 import AltitudeAboveGroundChanged as AltitudeAboveGroundChanged
from anafi_mav.arsdk.messages.ardrone3 import AltitudeChanged as AltitudeChanged
from anafi_mav.arsdk.messages.ardrone3 import AttitudeChanged as AttitudeChanged
from anafi_mav.arsdk.messages.ardrone3 import FlyingState as FlyingState
from anafi_mav.arsdk.messages.ardrone3 import FlyingStateChanged as FlyingStateChanged
from anafi_mav.arsdk.messages.ardrone3 import ForcedLandingAutoTrigger as ForcedLandingAutoTrigger
from anafi_mav.arsdk.messages.ardrone3 import ForcedLandingReason as ForcedLandingReason
from anafi_mav.arsdk.messages.ardrone3 import GPSFixStateChanged as GPSFixStateChanged
from anafi_mav.arsdk.messages.ardrone3 import GpsLocationChanged as GpsLocationChanged
from anafi_mav.arsdk.messages.ardrone3 import HomeChanged as HomeChanged
from anafi_mav.arsdk.messages.ardrone3 import MoveToChanged as MoveToChanged
from anafi_mav.arsdk.messages.ardrone3 import NumberOfSatelliteChanged as NumberOfSatelliteChanged
from anafi_mav.arsdk.messages.ardrone3 import SpeedChanged as SpeedChanged
from anafi_mav.arsdk.messages.battery import Alert as BatteryAlertChanged
from anafi_mav.arsdk.messages.battery import AlertLevel as AlertLevel
from anafi_mav.arsdk.messages.common import FlightId as FlightId
from anafi_mav.arsdk.messages.common import MagnetoCalibrationRequiredState as MagnetoCalibrationRequiredState
from anafi_mav.arsdk.messages.common import MavlinkFilePlayingStateChanged as MavlinkFilePlayingStateChanged
from anafi_mav.arsdk.messages.common import PlayingState as PlayingState
from anafi_mav.arsdk.messages.common import Sensor as Sensor
from anafi_mav.arsdk.messages.common import SensorsStatesListChanged as SensorsStatesListChanged
from anafi_mav.arsdk.messages.rth import RthEndingBehavior as RthEndingBehavior
from anafi_mav.arsdk.messages.rth import State as ReturnStateChanged
from anafi_mav.arsdk.messages.rth import TakeoffLocation as TakeoffLocation
from anafi_mav.arsdk.wire import Message as Message

__all__ = [
    "AlertLevel",
    "AltitudeAboveGroundChanged",
    "AltitudeChanged",
    "AttitudeChanged",
    "BatteryAlertChanged",
    "FlightId",
    "FlyingState",
    "FlyingStateChanged",
    "ForcedLandingAutoTrigger",
    "ForcedLandingReason",
    "GPSFixStateChanged",
    "GpsLocationChanged",
    "HomeChanged",
    "MagnetoCalibrationRequiredState",
    "MavlinkFilePlayingStateChanged",
    "Message",
    "MoveToChanged",
    "NumberOfSatelliteChanged",
    "PlayingState",
    "ReturnStateChanged",
    "RthEndingBehavior",
    "Sensor",
    "SensorsStatesListChanged",
    "SpeedChanged",
    "TakeoffLocation",
]

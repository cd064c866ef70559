"""Python API of an ANAFI: `connect` returns a `Drone` with elements.

Each element has a frozen state and some verbs.

    from anafi_mav.drone import FlyingState, connect

    async with connect("192.168.42.1") as drone:
        await drone.piloting.take_off()
        await drone.wait_for(FlyingState.HOVERING)

The names in `__all__` are stable, and so are those of `anafi_mav.drone.events`, which follow Parrot's.
docs/python-api.md is the guide, docs/python-api-reference.md the reference.
"""

from anafi_mav.arsdk.video.rtp_h264 import Picture
from anafi_mav.arsdk.video.video_metadata import FrameMetadata, Location, Ned, Quaternion, WifiLink
from anafi_mav.drone import events
from anafi_mav.drone.automatic.animations import Animations, AnimationsState
from anafi_mav.drone.automatic.flight_plan import FlightPlan, FlightPlanState, PlanOnDrone, Recovery
from anafi_mav.drone.automatic.follow_me import FollowMe, FollowMeState, Trajectory
from anafi_mav.drone.automatic.poi import Poi, PoiState
from anafi_mav.drone.connection import connect
from anafi_mav.drone.controller.controller import Controller
from anafi_mav.drone.controller.state import ControllerState, KnownDrone
from anafi_mav.drone.drone import Drone
from anafi_mav.drone.element import Position, Range
from anafi_mav.drone.events import FlyingState, PlayingState
from anafi_mav.drone.features import Feature, Support
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.camera_enums import (
    Antiflicker,
    Bracketing,
    Burst,
    CameraKind,
    CameraMode,
    ExposureMode,
    Metering,
    PhotoFile,
    PhotoFormat,
    PhotoMode,
    RecordingMode,
    Resolution,
    StoragePolicy,
    Streaming,
    Style,
    VideoCodec,
    WhiteBalance,
)
from anafi_mav.drone.payload.camera_state import (
    CamerasState,
    CameraState,
    ExposureSettings,
    PhotoOption,
    PhotoSettings,
    RecordingOption,
    RecordingSettings,
    StyleSettings,
)
from anafi_mav.drone.payload.flight_logs import FlightLog, FlightLogs
from anafi_mav.drone.payload.gimbal import Aim, Angles, Gimbal, GimbalAttitude, GimbalCalibration, GimbalState
from anafi_mav.drone.payload.media import Media, MediaItem, MediaState, Notification, Place, Resource
from anafi_mav.drone.payload.storage import Storage, StorageState
from anafi_mav.drone.payload.thermal import Colour, Palette, Thermal, ThermalState
from anafi_mav.drone.piloting.motors import Blocker, BlockerKind
from anafi_mav.drone.piloting.moves import Displacement, Move, MoveEnd
from anafi_mav.drone.piloting.piloting import Piloting
from anafi_mav.drone.piloting.state import Attitude, Avoidance, PilotingState, Velocity
from anafi_mav.drone.piloting.sticks import Limits, PilotingCommand
from anafi_mav.drone.status.alerts import Alerts, AlertsState
from anafi_mav.drone.status.battery import Battery, BatteryState
from anafi_mav.drone.status.calibration import Calibration, CalibrationState
from anafi_mav.drone.status.gps import Gps, GpsState
from anafi_mav.drone.status.home import Home, HomeState
from anafi_mav.drone.status.link import Link, LinkState
from anafi_mav.drone.status.product import MODELS, Identity, Product, ProductState
from anafi_mav.drone.status.sound import Sound, SoundState
from anafi_mav.drone.video.stream import Shown
from anafi_mav.drone.video.video import Video, VideoFrame, VideoState
from anafi_mav.errors import (
    AnafiMavError,
    CommandRejected,
    CommandTimeout,
    HandshakeRefused,
    LinkLost,
    LocalProtocolError,
    NotSupported,
    RemoteProtocolError,
)
from anafi_mav.models import Model

__all__ = [
    "MODELS",
    "Aim",
    "Alerts",
    "AlertsState",
    "AnafiMavError",
    "Angles",
    "Animations",
    "AnimationsState",
    "Antiflicker",
    "Attitude",
    "Avoidance",
    "Battery",
    "BatteryState",
    "Blocker",
    "BlockerKind",
    "Bracketing",
    "Burst",
    "Calibration",
    "CalibrationState",
    "Camera",
    "CameraKind",
    "CameraMode",
    "CameraState",
    "CamerasState",
    "Colour",
    "CommandRejected",
    "CommandTimeout",
    "Controller",
    "ControllerState",
    "Displacement",
    "Drone",
    "ExposureMode",
    "ExposureSettings",
    "Feature",
    "FlightLog",
    "FlightLogs",
    "FlightPlan",
    "FlightPlanState",
    "FlyingState",
    "FollowMe",
    "FollowMeState",
    "FrameMetadata",
    "Gimbal",
    "GimbalAttitude",
    "GimbalCalibration",
    "GimbalState",
    "Gps",
    "GpsState",
    "HandshakeRefused",
    "Home",
    "HomeState",
    "Identity",
    "KnownDrone",
    "Limits",
    "Link",
    "LinkLost",
    "LinkState",
    "LocalProtocolError",
    "Location",
    "Media",
    "MediaItem",
    "MediaState",
    "Metering",
    "Model",
    "Move",
    "MoveEnd",
    "Ned",
    "NotSupported",
    "Notification",
    "Palette",
    "PhotoFile",
    "PhotoFormat",
    "PhotoMode",
    "PhotoOption",
    "PhotoSettings",
    "Picture",
    "Piloting",
    "PilotingCommand",
    "PilotingState",
    "Place",
    "PlanOnDrone",
    "PlayingState",
    "Poi",
    "PoiState",
    "Position",
    "Product",
    "ProductState",
    "Quaternion",
    "Range",
    "RecordingMode",
    "RecordingOption",
    "RecordingSettings",
    "Recovery",
    "RemoteProtocolError",
    "Resolution",
    "Resource",
    "Shown",
    "Sound",
    "SoundState",
    "Storage",
    "StoragePolicy",
    "StorageState",
    "Streaming",
    "Style",
    "StyleSettings",
    "Support",
    "Thermal",
    "ThermalState",
    "Trajectory",
    "Velocity",
    "Video",
    "VideoCodec",
    "VideoFrame",
    "VideoState",
    "WhiteBalance",
    "WifiLink",
    "connect",
    "events",
]

"""Features of a drone, derived from the messages it sent when it connected.

They are never derived from its model's name.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from typing import Any, Protocol

from anafi_mav.arsdk.messages.ardrone3 import PoiStatus
from anafi_mav.arsdk.messages.gimbal import Axis
from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.arsdk.messages.obstacle_avoidance import Availability as AvoidanceAvailability
from anafi_mav.arsdk.messages.precise_home import PreciseHomeState
from anafi_mav.arsdk.messages.rth import RthState
from anafi_mav.drone.automatic.animations import Animations
from anafi_mav.drone.automatic.flight_plan import FlightPlan
from anafi_mav.drone.automatic.follow_me import FollowMe
from anafi_mav.drone.automatic.poi import Poi
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.gimbal import Gimbal
from anafi_mav.drone.payload.media import Media
from anafi_mav.drone.payload.storage import Storage
from anafi_mav.drone.payload.thermal import Thermal
from anafi_mav.drone.piloting.piloting import Piloting
from anafi_mav.drone.status.calibration import Calibration
from anafi_mav.drone.status.home import Home
from anafi_mav.drone.status.sound import Sound


class Elements(Protocol):
    """Elements of a drone from which its features are derived."""

    animations: Animations
    calibration: Calibration
    camera: Camera
    flight_plan: FlightPlan
    follow_me: FollowMe
    gimbal: Gimbal
    home: Home
    media: Media
    piloting: Piloting
    poi: Poi
    sound: Sound
    storage: Storage
    thermal: Thermal

    @property
    def connected(self) -> bool:
        """It has sent all its states."""
        ...


class Support(enum.Enum):
    """Availability of a feature."""

    UNKNOWN = "unknown"
    """Not connected."""
    ABSENT = "absent"
    """The drone did not report it when it connected: its verbs raise `NotSupported`."""
    UNAVAILABLE = "unavailable"
    """The drone has it and reports that it does not work now."""
    AVAILABLE = "available"


class Feature(enum.Enum):
    """A feature that not every model has; the value is its name in texts."""

    CAMERA = "camera"
    CAMERA_ZOOM = "zoom"
    CAMERA_HDR = "HDR"
    CAMERA_STREAMING_MODE = "streaming mode"
    CAMERA_EXPOSURE_LOCK = "exposure lock"
    CAMERA_WHITE_BALANCE_LOCK = "white balance lock"
    THERMAL = "thermal camera"
    GIMBAL = "gimbal"
    GIMBAL_YAW = "gimbal yaw"
    SECOND_GIMBAL = "second gimbal"
    STORAGE = "storage"
    SECOND_STORAGE = "second storage"
    MEDIA = "media"
    FLIGHT_PLAN = "flight plans"
    FLIGHT_PLAN_V2 = "flight plans of version 2"
    FLIGHT_PLAN_START_AT = "flight plans from the middle"
    RETURN_HOME = "return home"
    PRECISE_HOME = "precise return home"
    POI = "points of interest"
    FOLLOW_ME = "follow me"
    ANIMATIONS = "animations"
    OBSTACLE_AVOIDANCE = "obstacle avoidance"
    PILOTING_STYLE = "piloting style"
    MAX_HORIZONTAL_SPEED = "maximum horizontal speed"
    GEOFENCE = "geofence"
    MAGNETOMETER_CALIBRATION = "magnetometer calibration"
    ALERT_SOUND = "alert sound"


def _has(reported: object, works: bool | None = True) -> Support:
    if reported is None or reported is False or reported == {} or reported == frozenset() or reported == ():
        return Support.ABSENT
    return Support.UNAVAILABLE if works is False else Support.AVAILABLE


def features(drone: Elements) -> Mapping[Feature, Support]:
    """Every feature, and whether this drone has it. UNKNOWN before it has sent its states."""
    if not drone.connected:
        return dict.fromkeys(Feature, Support.UNKNOWN)
    camera, piloting, home, plan = drone.camera[0], drone.piloting.state, drone.home.state, drone.flight_plan.state
    storages: Mapping[int, Any] = drone.storage.state
    ready = any(one.ready for one in storages.values())
    found: dict[Feature, Support] = {
        Feature.CAMERA: _has(camera.mode, 0 in drone.camera.state.active),
        Feature.CAMERA_ZOOM: _has((camera.zoom_max or 1.0) > 1.0, camera.zoom_available),
        Feature.CAMERA_HDR: _has(camera.hdr is not None),
        Feature.CAMERA_STREAMING_MODE: _has(camera.streaming),
        Feature.CAMERA_EXPOSURE_LOCK: _has(camera.exposure_lockable),
        Feature.CAMERA_WHITE_BALANCE_LOCK: _has(camera.white_balance_lockable),
        Feature.THERMAL: _has(drone.thermal.state.mode),
        Feature.GIMBAL: _has(drone.gimbal[0].axes, not drone.gimbal[0].errors),
        Feature.GIMBAL_YAW: _has(Axis.YAW in (drone.gimbal[0].axes or ())),
        Feature.SECOND_GIMBAL: _has(len(drone.gimbal.state) > 1),
        Feature.STORAGE: _has(storages, ready),
        Feature.SECOND_STORAGE: _has(len(storages) > 1),
        Feature.MEDIA: _has(drone.media.state.index, drone.media.state.index == MediastoreState.INDEXED),
        Feature.FLIGHT_PLAN: _has(plan.is_reported, plan.available),
        Feature.FLIGHT_PLAN_V2: _has(plan.is_reported and drone.flight_plan.version == 2, plan.available),
        Feature.FLIGHT_PLAN_START_AT: _has(plan.capabilities),
        Feature.RETURN_HOME: _has(home.rth, home.rth != RthState.UNAVAILABLE),
        Feature.PRECISE_HOME: _has(home.precise_mode, home.precise != PreciseHomeState.UNAVAILABLE),
        Feature.POI: _has(drone.poi.state.status, drone.poi.state.status != PoiStatus.UNAVAILABLE),
        Feature.FOLLOW_ME: _has(drone.follow_me.state.mode, not all(drone.follow_me.state.missing.values())),
        Feature.ANIMATIONS: _has(drone.animations.state.running, bool(drone.animations.state.available)),
        Feature.OBSTACLE_AVOIDANCE: _has(
            piloting.avoidance,
            piloting.avoidance is not None and piloting.avoidance.availability != AvoidanceAvailability.UNAVAILABLE,
        ),
        Feature.PILOTING_STYLE: _has(piloting.style),
        Feature.MAX_HORIZONTAL_SPEED: _has(piloting.max_horizontal_speed),
        Feature.GEOFENCE: _has(piloting.geofence is not None),
        Feature.MAGNETOMETER_CALIBRATION: _has(drone.calibration.state.started is not None),
        Feature.ALERT_SOUND: _has(drone.sound.state.playing is not None),
    }
    return found

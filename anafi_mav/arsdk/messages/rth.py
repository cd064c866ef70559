"""Feature 146, rth: return to home."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, F32, F64, U8, U16, U32, Bits, Message, OpenEnum, command, event


class RthHomeType(OpenEnum):
    NONE = 0
    TAKEOFF = 1
    FOLLOWEE = 2
    CUSTOM = 3
    PILOT = 4
    VEHICLE = 5


class RthState(OpenEnum):
    AVAILABLE = 0
    IN_PROGRESS = 1
    UNAVAILABLE = 2
    PENDING = 3


class StateReason(OpenEnum):
    USER_REQUEST = 0
    CONNECTION_LOST = 1
    LOW_BATTERY = 2
    FINISHED = 3
    STOPPED = 4
    DISABLED = 5
    ENABLED = 6
    FLIGHTPLAN = 7
    BLOCKED = 8
    ICING = 9
    BATTERY_LOST_COMM = 10
    MOTOR_DOWN = 11
    BATTERY_TOO_HOT = 12
    VEHICLE_NOT_FOUND = 13
    LANDING_ZONE_NOT_FOUND = 14
    GEOFENCE_VIOLATION = 15


class RthHomeReachability(OpenEnum):
    UNKNOWN = 0
    REACHABLE = 1
    CRITICAL = 2
    NOT_REACHABLE = 3


class AutoTriggerReason(OpenEnum):
    NONE = 0
    BATTERY_CRITICAL_SOON = 1
    MOTOR_DOWN = 2


class RthAutoTriggerMode(OpenEnum):
    OFF = 0
    ON = 1


class RthEndingBehavior(OpenEnum):
    LANDING = 0
    HOVERING = 1


class Indicator(OpenEnum):
    DRONE_GPS = 0
    DRONE_MAGNETO = 1
    DRONE_GEOFENCE = 2
    DRONE_MIN_ALTITUDE = 3
    DRONE_MAX_ALTITUDE = 4
    DRONE_FLYING = 5
    TARGET_POSITION_ACCURACY = 6
    TARGET_IMAGE_DETECTION = 7
    DRONE_TARGET_DISTANCE_MIN = 8
    DRONE_TARGET_DISTANCE_MAX = 9
    TARGET_HORIZ_SPEED = 10
    TARGET_VERT_SPEED = 11
    TARGET_ALTITUDE_ACCURACY = 12
    DRONE_BATTERY = 13
    DRONE_STATE = 14


@event("rth.home_type_capabilities", 146, 0, 1)
class HomeTypeCapabilities(Message, frozen=True):
    values: Annotated[int, Bits(U32, RthHomeType)]


@event("rth.home_type", 146, 0, 2)
class HomeType(Message, frozen=True):
    type: Annotated[RthHomeType, ENUM]


@event("rth.preferred_home_type", 146, 0, 3)
class PreferredHomeType(Message, frozen=True):
    type: Annotated[RthHomeType, ENUM]


@command("rth.set_preferred_home_type", 146, 0, 4)
class SetPreferredHomeType(Message, frozen=True):
    type: Annotated[RthHomeType, ENUM]


@event("rth.takeoff_location", 146, 0, 5)
class TakeoffLocation(Message, frozen=True):
    """deg, deg, m; 500 = unknown."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]
    fixed_before_takeoff: Annotated[int, U8]


@command("rth.set_custom_location", 146, 0, 6)
class SetCustomLocation(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]


@event("rth.custom_location", 146, 0, 7)
class CustomLocation(Message, frozen=True):
    """deg, deg, m above take-off; 500 = none."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]


@event("rth.followee_location", 146, 0, 8)
class FolloweeLocation(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]


@command("rth.set_delay", 146, 0, 9)
class SetDelay(Message, frozen=True):
    delay: Annotated[int, U16]


@event("rth.delay", 146, 0, 10)
class Delay(Message, frozen=True):
    """s between losing the link and flying home."""

    delay: Annotated[int, U16]
    min: Annotated[int, U16]
    max: Annotated[int, U16]


@command("rth.return_to_home", 146, 0, 11)
class ReturnToHome(Message, frozen=True):
    """Fly home. Confirmed by rth.state in_progress or pending with reason user_request."""


@command("rth.abort", 146, 0, 12)
class Abort(Message, frozen=True):
    """Stop a return. Confirmed by rth.state available with reason stopped."""


@event("rth.state", 146, 0, 13)
class State(Message, frozen=True):
    state: Annotated[RthState, ENUM]
    reason: Annotated[StateReason, ENUM]


@event("rth.home_reachability", 146, 0, 14)
class HomeReachability(Message, frozen=True):
    status: Annotated[RthHomeReachability, ENUM]


@event("rth.rth_auto_trigger", 146, 0, 15)
class RthAutoTrigger(Message, frozen=True):
    reason: Annotated[AutoTriggerReason, ENUM]
    delay: Annotated[int, U32]


@command("rth.cancel_auto_trigger", 146, 0, 16)
class CancelAutoTrigger(Message, frozen=True):
    pass


@command("rth.set_min_altitude", 146, 0, 17)
class SetMinAltitude(Message, frozen=True):
    altitude: Annotated[float, F32]


@event("rth.min_altitude", 146, 0, 18)
class MinAltitude(Message, frozen=True):
    """Height above take-off (m) that a return climbs to first."""

    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@command("rth.set_auto_trigger_mode", 146, 0, 19)
class SetAutoTriggerMode(Message, frozen=True):
    mode: Annotated[RthAutoTriggerMode, ENUM]


@event("rth.auto_trigger_mode", 146, 0, 20)
class AutoTriggerMode(Message, frozen=True):
    mode: Annotated[RthAutoTriggerMode, ENUM]


@command("rth.set_ending_behavior", 146, 0, 21)
class SetEndingBehavior(Message, frozen=True):
    ending_behavior: Annotated[RthEndingBehavior, ENUM]


@event("rth.ending_behavior", 146, 0, 22)
class EndingBehavior(Message, frozen=True):
    ending_behavior: Annotated[RthEndingBehavior, ENUM]


@command("rth.set_ending_hovering_altitude", 146, 0, 23)
class SetEndingHoveringAltitude(Message, frozen=True):
    altitude: Annotated[float, F32]


@event("rth.ending_hovering_altitude", 146, 0, 24)
class EndingHoveringAltitude(Message, frozen=True):
    current: Annotated[float, F32]
    min: Annotated[float, F32]
    max: Annotated[float, F32]


@event("rth.info", 146, 0, 25)
class Info(Message, frozen=True):
    missing_inputs: Annotated[int, Bits(U32, Indicator)]


@event("rth.pilot_location", 146, 0, 26)
class PilotLocation(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]


@event("rth.home_location", 146, 0, 27)
class HomeLocation(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]

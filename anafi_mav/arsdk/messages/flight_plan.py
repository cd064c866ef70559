"""Feature 167, flight_plan: what the Ai adds to common.Mavlink."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, STRING, U8, U16, U32, Bits, Message, OpenEnum, command, event


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
    DRONE_BATTERY_TOO_HOT = 15


class MavlinkType(OpenEnum):
    FLIGHT_PLAN = 0
    MAP_MY_HOUSE = 1
    FLIGHT_PLAN_V2 = 2


class SupportedCapabilities(OpenEnum):
    START_AT = 0
    START_AT_V2 = 1


@event("flight_plan.info", 167, 0, 1)
class Info(Message, frozen=True):
    missing_inputs: Annotated[int, Bits(U32, Indicator)]


@event("flight_plan.waypoint_skipped", 167, 0, 2)
class WaypointSkipped(Message, frozen=True):
    item: Annotated[int, U32]


@command("flight_plan.start_at", 167, 0, 3)
class StartAt(Message, frozen=True):
    flightplan_id: Annotated[str, STRING]
    custom_id: Annotated[str, STRING]
    type: Annotated[MavlinkType, ENUM]
    item: Annotated[int, U32]


@event("flight_plan.capabilities", 167, 0, 4)
class Capabilities(Message, frozen=True):
    supported_capabilities: Annotated[int, Bits(U16, SupportedCapabilities)]


@event("flight_plan.recovery_info", 167, 0, 5)
class RecoveryInfo(Message, frozen=True):
    flightplan_id: Annotated[str, STRING]
    custom_id: Annotated[str, STRING]
    item: Annotated[int, U32]
    running_time: Annotated[int, U32]
    resource_id: Annotated[str, STRING]


@command("flight_plan.clear_recovery_info", 167, 0, 6)
class ClearRecoveryInfo(Message, frozen=True):
    pass


@command("flight_plan.start_at_v2", 167, 0, 7)
class StartAtV2(Message, frozen=True):
    flightplan_id: Annotated[str, STRING]
    custom_id: Annotated[str, STRING]
    type: Annotated[MavlinkType, ENUM]
    item: Annotated[int, U32]
    continue_on_disconnect: Annotated[int, U8]


@command("flight_plan.pre_config", 167, 0, 9)
class PreConfig(Message, frozen=True):
    pass


@event("flight_plan.supported_feature", 167, 0, 10)
class SupportedFeature(Message, frozen=True):
    value: Annotated[int, U8]

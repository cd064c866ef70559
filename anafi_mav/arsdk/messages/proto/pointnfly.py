"""pointnfly: look at, or fly to, a point.

Degrees, metres, m/s, degrees/s; headings clockwise from North.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, DOUBLE, ENUM, RECORD, Empty, Field, Submessage
from anafi_mav.arsdk.codec.wire import OpenEnum
from anafi_mav.arsdk.messages.proto import backuplink

COMMAND = ProtobufEnvelope("arsdk.pointnfly.Command", "pointnfly.Command")
EVENT = ProtobufEnvelope("arsdk.pointnfly.Event", "pointnfly.Event")


class ExecutionStatus(OpenEnum):
    SUCCESS = 0
    FAILED = 1
    INTERRUPTED = 2


class GimbalControlMode(OpenEnum):
    LOCKED = 0
    LOCKED_ONCE = 1
    FREE = 2


class UnavailabilityReason(OpenEnum):
    DRONE_GPS_INFO_INACCURATE = 0
    DRONE_NOT_CALIBRATED = 1
    DRONE_OUT_GEOFENCE = 2
    DRONE_TOO_CLOSE_TO_GROUND = 3
    DRONE_ABOVE_MAX_ALTITUDE = 4
    DRONE_INSUFFICIENT_BATTERY = 5
    DRONE_NOT_FLYING = 6


class Point(Submessage, frozen=True, kw_only=True):
    gimbal_control_mode: Annotated[GimbalControlMode, Field(1, ENUM)] = GimbalControlMode.LOCKED
    latitude: Annotated[float, Field(2, DOUBLE)] = 0.0
    longitude: Annotated[float, Field(3, DOUBLE)] = 0.0
    altitude: Annotated[float, Field(4, DOUBLE)] = 0.0


class Fly(Submessage, frozen=True, kw_only=True):
    gimbal_control_mode: Annotated[GimbalControlMode, Field(1, ENUM)] = GimbalControlMode.LOCKED
    latitude: Annotated[float, Field(2, DOUBLE)] = 0.0
    longitude: Annotated[float, Field(3, DOUBLE)] = 0.0
    altitude: Annotated[float, Field(4, DOUBLE)] = 0.0
    current: Annotated[Empty | None, Field(5, RECORD, "heading")] = None
    to_target_before: Annotated[Empty | None, Field(6, RECORD, "heading")] = None
    custom_before: Annotated[float | None, Field(7, DOUBLE, "heading")] = None
    custom_during: Annotated[float | None, Field(8, DOUBLE, "heading")] = None
    max_horizontal_speed: Annotated[float, Field(9, DOUBLE)] = 0.0
    max_vertical_speed: Annotated[float, Field(10, DOUBLE)] = 0.0
    max_yaw_rotation_speed: Annotated[float, Field(11, DOUBLE)] = 0.0
    enabled_links: Annotated[backuplink.EnabledLinks, Field(12, ENUM)] = backuplink.EnabledLinks.ALL


class StateUnavailable(Submessage, frozen=True, kw_only=True):
    reasons: Annotated[tuple[UnavailabilityReason, ...], Field(1, ENUM)] = ()


class StateIdle(Submessage, frozen=True, kw_only=True):
    pass


class StateActive(Submessage, frozen=True, kw_only=True):
    point: Annotated[Point | None, Field(1, RECORD, "current_directive")] = None
    fly: Annotated[Fly | None, Field(2, RECORD, "current_directive")] = None


class Capabilities(Submessage, frozen=True, kw_only=True):
    allowed_links: Annotated[tuple[backuplink.EnabledLinks, ...], Field(1, ENUM)] = ()


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    include_default_capabilities: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("Deactivate", 17)
class Deactivate(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("Execute", 18)
class Execute(ProtobufMessage, frozen=True, kw_only=True):
    point: Annotated[Point | None, Field(1, RECORD, "directive")] = None
    fly: Annotated[Fly | None, Field(2, RECORD, "directive")] = None


@EVENT.message("State", 16)
class State(ProtobufMessage, frozen=True, kw_only=True):
    unavailable: Annotated[StateUnavailable | None, Field(2, RECORD, "state")] = None
    idle: Annotated[StateIdle | None, Field(3, RECORD, "state")] = None
    active: Annotated[StateActive | None, Field(4, RECORD, "state")] = None
    capabilities: Annotated[Capabilities | None, Field(5, RECORD)] = None


@EVENT.message("Execution", 17)
class Execution(ProtobufMessage, frozen=True, kw_only=True):
    status: Annotated[ExecutionStatus, Field(1, ENUM)] = ExecutionStatus.SUCCESS

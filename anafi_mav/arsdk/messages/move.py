"""Feature 170, move: guided moves with speed limits."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, F32, F64, U32, Bits, Message, OpenEnum, command, event


class OrientationMode(OpenEnum):
    NONE = 0
    TO_TARGET = 1
    HEADING_START = 2
    HEADING_DURING = 3


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


@command("move.extended_move_to", 170, 0, 1)
class ExtendedMoveTo(Message, frozen=True):
    """moveTo with speed limits: m/s, m/s, deg/s. Answered by PilotingState.moveToChanged."""

    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F64]
    orientation_mode: Annotated[OrientationMode, ENUM]
    heading: Annotated[float, F32]
    max_horizontal_speed: Annotated[float, F32]
    max_vertical_speed: Annotated[float, F32]
    max_yaw_rotation_speed: Annotated[float, F32]


@command("move.extended_move_by", 170, 0, 2)
class ExtendedMoveBy(Message, frozen=True):
    """moveBy with speed limits: m/s, m/s, deg/s. Ends in PilotingEvent.moveByEnd."""

    d_x: Annotated[float, F32]
    d_y: Annotated[float, F32]
    d_z: Annotated[float, F32]
    d_psi: Annotated[float, F32]
    max_horizontal_speed: Annotated[float, F32]
    max_vertical_speed: Annotated[float, F32]
    max_yaw_rotation_speed: Annotated[float, F32]


@event("move.info", 170, 0, 3)
class Info(Message, frozen=True):
    missing_inputs: Annotated[int, Bits(U32, Indicator)]

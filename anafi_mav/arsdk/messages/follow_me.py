"""Feature 134, follow_me."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.wire import (
    ENUM,
    F32,
    F64,
    U8,
    U16,
    Bits,
    Buffer,
    Message,
    OpenEnum,
    command,
    event,
)


class Mode(OpenEnum):
    NONE = 0
    LOOK_AT = 1
    GEOGRAPHIC = 2
    RELATIVE = 3
    LEASH = 4


class Behavior(OpenEnum):
    IDLE = 0
    FOLLOW = 1
    LOOK_AT = 2


class Input(OpenEnum):
    DRONE_CALIBRATED = 0
    DRONE_GPS_GOOD_ACCURACY = 1
    TARGET_GPS_GOOD_ACCURACY = 2
    TARGET_BAROMETER_OK = 3
    DRONE_FAR_ENOUGH = 4
    DRONE_HIGH_ENOUGH = 5
    IMAGE_DETECTION = 6
    TARGET_GOOD_SPEED = 7
    DRONE_CLOSE_ENOUGH = 8


class Animation(OpenEnum):
    NONE = 0
    HELICOID = 1
    SWING = 2
    BOOMERANG = 3
    CANDLE = 4
    DOLLY_SLIDE = 5


@command("follow_me.start", 134, 0, 1)
class Start(Message, frozen=True):
    mode: Annotated[Mode, ENUM]


@command("follow_me.stop", 134, 0, 2)
class Stop(Message, frozen=True):
    pass


@event("follow_me.state", 134, 0, 3)
class State(Message, frozen=True):
    mode: Annotated[Mode, ENUM]
    behavior: Annotated[Behavior, ENUM]
    animation: Annotated[Animation, ENUM]
    animation_available: Annotated[int, Bits(U16, Animation)]


@event("follow_me.mode_info", 134, 0, 4)
class ModeInfo(Message, frozen=True):
    mode: Annotated[Mode, ENUM]
    missing_requirements: Annotated[int, Bits(U16, Input)]
    improvements: Annotated[int, Bits(U16, Input)]


@event("follow_me.target_trajectory", 134, 0, 10, Buffer.NON_ACK)
class TargetTrajectory(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]
    north_speed: Annotated[float, F32]
    east_speed: Annotated[float, F32]
    down_speed: Annotated[float, F32]


@event("follow_me.target_is_controller", 134, 0, 27)
class TargetIsController(Message, frozen=True):
    state: Annotated[int, U8]

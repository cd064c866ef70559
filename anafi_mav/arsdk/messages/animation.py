"""Feature 144, animation: what is available and what runs."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.wire import (
    ENUM,
    U8,
    U32,
    Bits,
    Message,
    OpenEnum,
    event,
)


class Type(OpenEnum):
    NONE = 0
    FLIP = 1
    HORIZONTAL_PANORAMA = 2
    DRONIE = 3
    HORIZONTAL_REVEAL = 4
    VERTICAL_REVEAL = 5
    SPIRAL = 6
    PARABOLA = 7
    CANDLE = 8
    DOLLY_SLIDE = 9
    VERTIGO = 10
    TWIST_UP = 11
    POSITION_TWIST_UP = 12
    HORIZONTAL_180_PHOTO_PANORAMA = 13
    VERTICAL_180_PHOTO_PANORAMA = 14
    SPHERICAL_PHOTO_PANORAMA = 15
    SUPER_WIDE_PHOTO_PANORAMA = 16


@event("animation.availability", 144, 0, 1)
class Availability(Message, frozen=True):
    values: Annotated[int, Bits(U32, Type)]


@event("animation.state", 144, 0, 2)
class State(Message, frozen=True):
    type: Annotated[Type, ENUM]
    percent: Annotated[int, U8]

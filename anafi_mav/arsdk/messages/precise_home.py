"""Feature 151, precise_home: landing by picture."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, U8, Bits, Message, OpenEnum, command, event


class PreciseHomeMode(OpenEnum):
    DISABLED = 0
    STANDARD = 1


class PreciseHomeState(OpenEnum):
    UNAVAILABLE = 0
    AVAILABLE = 1
    ACTIVE = 2


@event("precise_home.capabilities", 151, 0, 1)
class Capabilities(Message, frozen=True):
    modes: Annotated[int, Bits(U8, PreciseHomeMode)]


@event("precise_home.mode", 151, 0, 2)
class Mode(Message, frozen=True):
    mode: Annotated[PreciseHomeMode, ENUM]


@command("precise_home.set_mode", 151, 0, 3)
class SetMode(Message, frozen=True):
    mode: Annotated[PreciseHomeMode, ENUM]


@event("precise_home.state", 151, 0, 4)
class State(Message, frozen=True):
    state: Annotated[PreciseHomeState, ENUM]

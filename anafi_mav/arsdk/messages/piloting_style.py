"""Feature 155, piloting_style."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, U8, Bits, Message, OpenEnum, command, event


class PilotingStyleStyle(OpenEnum):
    STANDARD = 0
    CAMERA_OPERATED = 1


@event("piloting_style.style", 155, 0, 1)
class Style(Message, frozen=True):
    style: Annotated[PilotingStyleStyle, ENUM]


@command("piloting_style.set_style", 155, 0, 2)
class SetStyle(Message, frozen=True):
    style: Annotated[PilotingStyleStyle, ENUM]


@event("piloting_style.capabilities", 155, 0, 3)
class Capabilities(Message, frozen=True):
    styles: Annotated[int, Bits(U8, PilotingStyleStyle)]

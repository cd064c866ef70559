"""Feature 165, mission: the programs (AirSDK missions) aboard an Ai and their own messages."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import BINARY, ENUM, STRING, U8, U16, Bits, Message, OpenEnum, command, event
from anafi_mav.arsdk.messages.generic import ListFlags


class MissionState(OpenEnum):
    UNAVAILABLE = 0
    UNLOADED = 1
    IDLE = 2
    ACTIVE = 3


class UnavailabilityReason(OpenEnum):
    NONE = 0
    BROKEN = 1
    LOAD_FAILED = 2


@event("mission.capabilities", 165, 0, 1)
class Capabilities(Message, frozen=True):
    uid: Annotated[str, STRING]
    name: Annotated[str, STRING]
    desc: Annotated[str, STRING]
    version: Annotated[str, STRING]
    recipient_id: Annotated[int, U16]
    target_model_id: Annotated[int, U16]
    target_min_version: Annotated[str, STRING]
    target_max_version: Annotated[str, STRING]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("mission.state", 165, 0, 2)
class State(Message, frozen=True):
    uid: Annotated[str, STRING]
    state: Annotated[MissionState, ENUM]
    unavailability_reason: Annotated[UnavailabilityReason, ENUM]


@command("mission.load", 165, 0, 3)
class Load(Message, frozen=True):
    uid: Annotated[str, STRING]


@command("mission.activate", 165, 0, 4)
class Activate(Message, frozen=True):
    uid: Annotated[str, STRING]


@command("mission.unload", 165, 0, 5)
class Unload(Message, frozen=True):
    uid: Annotated[str, STRING]


@command("mission.custom_cmd", 165, 0, 6)
class CustomCmd(Message, frozen=True):
    recipient_id: Annotated[int, U16]
    service_id: Annotated[int, U16]
    msg_num: Annotated[int, U16]
    payload: Annotated[bytes, BINARY]


@event("mission.custom_evt", 165, 0, 7)
class CustomEvt(Message, frozen=True):
    recipient_id: Annotated[int, U16]
    service_id: Annotated[int, U16]
    msg_num: Annotated[int, U16]
    payload: Annotated[bytes, BINARY]


@event("mission.suggested_activation", 165, 0, 8)
class SuggestedActivation(Message, frozen=True):
    uid: Annotated[str, STRING]


@command("mission.custom_msg_enable", 165, 0, 9)
class CustomMsgEnable(Message, frozen=True):
    pass


@command("mission.custom_msg_disable", 165, 0, 10)
class CustomMsgDisable(Message, frozen=True):
    pass

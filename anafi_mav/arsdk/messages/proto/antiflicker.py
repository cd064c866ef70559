"""antiflicker: the exposure in the rhythm of the mains."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, ENUM, RECORD, Empty, Field, Submessage
from anafi_mav.arsdk.codec.wire import OpenEnum

COMMAND = ProtobufEnvelope("arsdk.antiflicker.Command", "antiflicker.Command")
EVENT = ProtobufEnvelope("arsdk.antiflicker.Event", "antiflicker.Event")


class Frequency(OpenEnum):
    _50_HZ = 0
    _60_HZ = 1


class Mode(OpenEnum):
    DISABLED = 0
    AUTOMATIC = 1
    _50_HZ = 2
    _60_HZ = 3


class Capabilities(Submessage, frozen=True, kw_only=True):
    supported_modes: Annotated[tuple[Mode, ...], Field(1, ENUM)] = ()


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    include_default_capabilities: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("SetMode", 17)
class SetMode(ProtobufMessage, frozen=True, kw_only=True):
    mode: Annotated[Mode, Field(1, ENUM)] = Mode.DISABLED


@EVENT.message("State", 16)
class State(ProtobufMessage, frozen=True, kw_only=True):
    default_capabilities: Annotated[Capabilities | None, Field(1, RECORD)] = None
    disabled: Annotated[Empty | None, Field(2, RECORD, "mode")] = None
    fixed: Annotated[Frequency | None, Field(3, ENUM, "mode")] = None
    automatic: Annotated[Frequency | None, Field(4, ENUM, "mode")] = None

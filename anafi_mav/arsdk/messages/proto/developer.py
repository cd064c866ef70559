"""developer: shell access and logs of missions."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, RECORD, STRING, Field, Submessage

COMMAND = ProtobufEnvelope("arsdk.developer.Command", "developer.Command")
EVENT = ProtobufEnvelope("arsdk.developer.Event", "developer.Event")


class Shell(Submessage, frozen=True, kw_only=True):
    enabled: Annotated[bool, Field(1, BOOL)] = False
    public_key: Annotated[str, Field(2, STRING)] = ""


class EventAirSdkLog(Submessage, frozen=True, kw_only=True):
    enabled: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("EnableShell", 17)
class EnableShell(ProtobufMessage, frozen=True, kw_only=True):
    public_key: Annotated[str, Field(1, STRING)] = ""


@COMMAND.message("DisableShell", 18)
class DisableShell(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("AirSdkLog", 19)
class AirSdkLog(ProtobufMessage, frozen=True, kw_only=True):
    enable: Annotated[bool, Field(1, BOOL)] = False


@EVENT.message("State", 16)
class State(ProtobufMessage, frozen=True, kw_only=True):
    shell: Annotated[Shell | None, Field(1, RECORD)] = None
    airsdklog: Annotated[EventAirSdkLog | None, Field(2, RECORD)] = None

"""logsync: identities in the chain of controllers and drone, to match their logs.

Both services go both ways: a drone sends the same requests.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import ENUM, STRING, UINT32, Field
from anafi_mav.arsdk.codec.wire import OpenEnum

COMMAND = ProtobufEnvelope("arsdk.logsync.Command", "logsync.Command")
EVENT = ProtobufEnvelope("arsdk.logsync.Event", "logsync.Event")


class Role(OpenEnum):
    CONTROLLER = 0
    SKY_CONTROLLER = 1
    DRONE = 2
    REMOTE_ANTENNA = 3


@COMMAND.message("SyncRequest", 16)
class SyncRequest(ProtobufMessage, frozen=True, kw_only=True):
    pass


@EVENT.message("Identifier", 16)
class Identifier(ProtobufMessage, frozen=True, kw_only=True):
    boot_id: Annotated[str, Field(1, STRING)] = ""
    model: Annotated[int, Field(2, UINT32)] = 0
    role: Annotated[Role, Field(3, ENUM)] = Role.CONTROLLER

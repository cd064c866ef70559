"""controllerNetwork (arsdk.controllernetwork): the links of a Skycontroller 4."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import RECORD, Field
from anafi_mav.arsdk.messages.proto import network

COMMAND = ProtobufEnvelope("arsdk.controllernetwork.Command", "controllerNetwork.Command")
EVENT = ProtobufEnvelope("arsdk.controllernetwork.Event", "controllerNetwork.Event")


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("SetEthernetIpConfig", 17)
class SetEthernetIpConfig(ProtobufMessage, frozen=True, kw_only=True):
    config: Annotated[network.IpConfig | None, Field(1, RECORD)] = None


@EVENT.message("State", 16)
class State(ProtobufMessage, frozen=True, kw_only=True):
    links_status: Annotated[network.LinksStatus | None, Field(4, RECORD)] = None
    ethernet_ip_config: Annotated[network.IpConfig | None, Field(5, RECORD)] = None

"""network: the active link of the Ai, Wi-Fi or 4G, and the quality of each.

Quality: 0 unknown, 1 worst to 5 best.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, ENUM, INT32, RECORD, STRING, Empty, Field, Submessage, Wrapped
from anafi_mav.arsdk.codec.wire import OpenEnum

COMMAND = ProtobufEnvelope("arsdk.network.Command", "network.Command")
EVENT = ProtobufEnvelope("arsdk.network.Event", "network.Event")


class CellularStatus(OpenEnum):
    UNKNOWN = 0
    MODEM_OFF = 1
    MODEM_OFFLINE = 2
    MODEM_FLASHING = 3
    MODEM_ONLINE = 4
    MODEM_ERROR = 5
    SIM_LOCKED = 6
    SIM_READY = 7
    SIM_ABSENT = 8
    SIM_ERROR = 9
    NETWORK_SEARCHING = 10
    NETWORK_HOME = 11
    NETWORK_ROAMING = 12
    NETWORK_REGISTRATION_DENIED = 13
    NETWORK_ACTIVATION_DENIED = 14
    SERVER_WAIT_APC_TOKEN = 15
    SERVER_CONNECTING = 16
    SERVER_CONNECTED = 17
    SERVER_UNREACHABLE_DNS = 18
    SERVER_UNREACHABLE_CONNECT = 19
    SERVER_UNREACHABLE_AUTH = 20
    CONNECTION_OFFLINE = 21
    CONNECTION_CONNECTING = 22
    CONNECTION_ESTABLISHED = 23
    CONNECTION_ERROR = 24
    CONNECTION_ERROR_COMM_LINK = 25
    CONNECTION_ERROR_TIMEOUT = 26
    CONNECTION_ERROR_MISMATCH = 27


class DirectConnectionMode(OpenEnum):
    LEGACY = 0
    SECURE = 1


class LinkError(OpenEnum):
    NONE = 0
    DNS = 1
    CONNECT = 2
    AUTHENTICATION = 3
    PUBLISH = 4
    COMM_LINK = 5
    TIMEOUT = 6
    INVITE = 7
    SETUP = 8
    PEER_OFFLINE = 9
    PEER_MISMATCH = 10


class LinkStatus(OpenEnum):
    DOWN = 0
    UP = 1
    RUNNING = 2
    READY = 3
    CONNECTING = 4
    ERROR = 5


class LinkType(OpenEnum):
    UNKNOWN = 0
    LO = 1
    LAN = 2
    WLAN = 3
    CELLULAR = 4


class RoutingLink(OpenEnum):
    ANY = 0
    WLAN = 1
    CELLULAR = 2
    DIRECT = 3


class RoutingPolicy(OpenEnum):
    ALL = 0
    WLAN = 1
    CELLULAR = 2
    HYBRID = 3


class IpConfig(Submessage, frozen=True, kw_only=True):
    automatic: Annotated[Empty | None, Field(1, RECORD, "mode")] = None
    static: Annotated[StaticIpConfig | None, Field(2, RECORD, "mode")] = None


class StaticIpConfig(Submessage, frozen=True, kw_only=True):
    address: Annotated[str, Field(1, STRING)] = ""
    mask: Annotated[str, Field(2, STRING)] = ""
    gateway: Annotated[str | None, Wrapped(3, STRING)] = None


class LinksStatus(Submessage, frozen=True, kw_only=True):
    links: Annotated[tuple[LinksStatusLinkInfo, ...], Field(1, RECORD)] = ()


class LinksStatusLinkInfo(Submessage, frozen=True, kw_only=True):
    type: Annotated[LinkType, Field(1, ENUM)] = LinkType.UNKNOWN
    status: Annotated[LinkStatus, Field(2, ENUM)] = LinkStatus.DOWN
    quality: Annotated[int, Field(3, INT32)] = 0
    error: Annotated[LinkError, Field(4, ENUM)] = LinkError.NONE
    cellular_status: Annotated[CellularStatus, Field(5, ENUM)] = CellularStatus.UNKNOWN


class Capabilities(Submessage, frozen=True, kw_only=True):
    """kbit/s."""

    cellular_min_bitrate: Annotated[int, Field(1, INT32)] = 0
    cellular_max_bitrate: Annotated[int, Field(2, INT32)] = 0
    supported_direct_connection_modes: Annotated[tuple[DirectConnectionMode, ...], Field(3, ENUM)] = ()


class RoutingInfo(Submessage, frozen=True, kw_only=True):
    policy: Annotated[RoutingPolicy, Field(1, ENUM)] = RoutingPolicy.ALL
    current_link: Annotated[RoutingLink, Field(2, ENUM)] = RoutingLink.ANY


class GlobalLinkQuality(Submessage, frozen=True, kw_only=True):
    quality: Annotated[int, Field(1, INT32)] = 0


class CellularMaxBitrate(Submessage, frozen=True, kw_only=True):
    """kbit/s, 0 for the default."""

    max_bitrate: Annotated[int, Field(1, INT32)] = 0


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    include_default_capabilities: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("SetRoutingPolicy", 17)
class SetRoutingPolicy(ProtobufMessage, frozen=True, kw_only=True):
    policy: Annotated[RoutingPolicy, Field(1, ENUM)] = RoutingPolicy.ALL


@COMMAND.message("SetCellularMaxBitrate", 18)
class SetCellularMaxBitrate(ProtobufMessage, frozen=True, kw_only=True):
    """kbit/s, 0 for the default."""

    max_bitrate: Annotated[int, Field(1, INT32)] = 0


@COMMAND.message("SetDirectConnection", 19)
class SetDirectConnection(ProtobufMessage, frozen=True, kw_only=True):
    mode: Annotated[DirectConnectionMode, Field(1, ENUM)] = DirectConnectionMode.LEGACY


@COMMAND.message("SetEthernetIpConfig", 20)
class SetEthernetIpConfig(ProtobufMessage, frozen=True, kw_only=True):
    config: Annotated[IpConfig | None, Field(1, RECORD)] = None


@EVENT.message("State", 19)
class State(ProtobufMessage, frozen=True, kw_only=True):
    """Changed parts of the network state; a None field has not changed."""

    default_capabilities: Annotated[Capabilities | None, Field(1, RECORD)] = None
    routing_info: Annotated[RoutingInfo | None, Field(2, RECORD)] = None
    global_link_quality: Annotated[GlobalLinkQuality | None, Field(3, RECORD)] = None
    links_status: Annotated[LinksStatus | None, Field(4, RECORD)] = None
    cellular_max_bitrate: Annotated[CellularMaxBitrate | None, Field(5, RECORD)] = None
    direct_connection_mode: Annotated[DirectConnectionMode, Field(6, ENUM)] = DirectConnectionMode.LEGACY
    ethernet_ip_config: Annotated[IpConfig | None, Field(7, RECORD)] = None

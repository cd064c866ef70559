"""connectivity: the radios of the Ai and their Wi-Fi."""

from __future__ import annotations

from typing import Annotated

import msgspec

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import (
    BOOL,
    BYTES,
    ENUM,
    INT32,
    RECORD,
    STRING,
    UINT32,
    Field,
    Map,
    Submessage,
    Wrapped,
)
from anafi_mav.arsdk.codec.wire import OpenEnum

COMMAND = ProtobufEnvelope("arsdk.connectivity.Command", "connectivity.Command")
EVENT = ProtobufEnvelope("arsdk.connectivity.Event", "connectivity.Event")


class Band(OpenEnum):
    _2_4_GHZ = 0
    _5_0_GHZ = 1
    _1_6_GHZ = 2
    _1_8_GHZ = 3
    _2_0_GHZ = 4
    _2_2_GHZ = 5
    _2_3_GHZ = 6
    _2_5_GHZ = 7
    _3_5_GHZ = 8
    _4_5_GHZ = 9
    _1_85_GHZ = 10
    _2_1_GHZ = 11
    _2_7_GHZ = 12
    _3_8_GHZ = 13
    _5_0_LOW_GHZ = 14


class ConnectionStatus(OpenEnum):
    DISCONNECTED = 0
    AUTH_FAILURE = 1
    FAILURE = 2
    CONNECTED = 3


class EncryptionType(OpenEnum):
    OPEN = 0
    WEP = 1
    WPA = 2
    WPA2 = 3
    WPA3 = 4
    AES_128 = 5
    AES_256 = 6


class Environment(OpenEnum):
    INDOOR = 0
    OUTDOOR = 1


class Mode(OpenEnum):
    AP = 0
    STA = 1
    IDLE = 2


class RadioType(OpenEnum):
    WIFI = 0
    MARS = 1


class StationConnectionState(OpenEnum):
    CONNECTING = 0
    CONNECTED = 1


class SystemState(OpenEnum):
    STOPPING = 0
    STARTING = 1
    RUNNING = 2


class AccessPointConfig(Submessage, frozen=True, kw_only=True):
    security: Annotated[NetworkSecurityMode | None, Field(1, RECORD)] = None
    ssid: Annotated[str | None, Wrapped(2, STRING)] = None
    hidden: Annotated[bool | None, Wrapped(3, BOOL)] = None
    hw_addr: Annotated[bytes | None, Wrapped(4, BYTES)] = None
    country: Annotated[str | None, Wrapped(5, STRING)] = None
    environment: Annotated[EnvironmentValue | None, Field(6, RECORD)] = None
    manual_channel: Annotated[Channel | None, Field(7, RECORD, "channel_selection_type")] = None
    automatic_channel: Annotated[AutomaticChannelSelection | None, Field(8, RECORD, "channel_selection_type")] = None
    frequency_hopping_list: Annotated[FrequencyHoppingList | None, Field(9, RECORD, "channel_selection_type")] = None
    backup_freqs: Annotated[BackupFreqs | None, Field(10, RECORD)] = None
    extra_infos: Annotated[ExtraInfos | None, Field(11, RECORD)] = None


class NetworkSecurityMode(Submessage, frozen=True, kw_only=True):
    encryption: Annotated[tuple[EncryptionType, ...], Field(1, ENUM)] = ()
    passphrase: Annotated[str, Field(2, STRING)] = ""


class EnvironmentValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[Environment, Field(1, ENUM)] = Environment.INDOOR


class Channel(Submessage, frozen=True, kw_only=True):
    radio_channel: Annotated[RadioChannel | None, Field(1, RECORD, "type")] = None


class RadioChannel(Submessage, frozen=True, kw_only=True):
    band: Annotated[Band, Field(1, ENUM)] = Band._2_4_GHZ
    id: Annotated[int, Field(2, UINT32)] = 0


class AutomaticChannelSelection(Submessage, frozen=True, kw_only=True):
    allowed_bands: Annotated[tuple[Band, ...], Field(1, ENUM)] = ()


class FrequencyHoppingList(Submessage, frozen=True, kw_only=True):
    tx_channels: Annotated[tuple[Channel, ...], Field(1, RECORD)] = ()
    rx_channels: Annotated[tuple[Channel, ...], Field(2, RECORD)] = ()


class BackupFreqs(Submessage, frozen=True, kw_only=True):
    rx_freqs: Annotated[tuple[int, ...], Field(1, UINT32)] = ()
    tx_freqs: Annotated[tuple[int, ...], Field(2, UINT32)] = ()


class ExtraInfos(Submessage, frozen=True, kw_only=True):
    real_country: Annotated[str, Field(1, STRING)] = ""
    active_cellular: Annotated[bool, Field(2, BOOL)] = False


class StationConfig(Submessage, frozen=True, kw_only=True):
    security: Annotated[NetworkSecurityMode | None, Field(1, RECORD)] = None
    ssid: Annotated[str | None, Wrapped(2, STRING)] = None
    hidden: Annotated[bool | None, Wrapped(3, BOOL)] = None
    hw_addr: Annotated[bytes | None, Wrapped(4, BYTES)] = None
    country: Annotated[str | None, Wrapped(5, STRING)] = None
    environment: Annotated[EnvironmentValue | None, Field(6, RECORD)] = None
    manual_channel: Annotated[Channel | None, Field(7, RECORD, "channel_selection_type")] = None
    automatic_channel: Annotated[AutomaticChannelSelection | None, Field(8, RECORD, "channel_selection_type")] = None
    frequency_hopping_list: Annotated[FrequencyHoppingList | None, Field(9, RECORD, "channel_selection_type")] = None
    backup_freqs: Annotated[BackupFreqs | None, Field(10, RECORD)] = None
    extra_infos: Annotated[ExtraInfos | None, Field(11, RECORD)] = None


class Capabilities(Submessage, frozen=True, kw_only=True):
    model: Annotated[str, Field(1, STRING)] = ""
    supported_modes: Annotated[tuple[Mode, ...], Field(2, ENUM)] = ()
    supported_encryption_types: Annotated[tuple[EncryptionType, ...], Field(3, ENUM)] = ()
    supported_countries: Annotated[tuple[str, ...], Field(4, STRING)] = ()


class IdleState(Submessage, frozen=True, kw_only=True):
    pass


class AccessPointState(Submessage, frozen=True, kw_only=True):
    system_state: Annotated[SystemState, Field(1, ENUM)] = SystemState.STOPPING


class StationState(Submessage, frozen=True, kw_only=True):
    system_state: Annotated[SystemState, Field(1, ENUM)] = SystemState.STOPPING
    connection_state: Annotated[StationConnectionState, Field(2, ENUM)] = StationConnectionState.CONNECTING


class AuthorizedChannels(Submessage, frozen=True, kw_only=True):
    channel: Annotated[tuple[ChannelDescriptor, ...], Field(1, RECORD)] = ()


class ChannelDescriptor(Submessage, frozen=True, kw_only=True):
    channel: Annotated[Channel | None, Field(1, RECORD)] = None
    frequency: Annotated[int, Field(3, UINT32)] = 0


class AuthorizedPackedChannels(Submessage, frozen=True, kw_only=True):
    channels: Annotated[tuple[PackedChannelDescriptor, ...], Field(1, RECORD)] = ()


class PackedChannelDescriptor(Submessage, frozen=True, kw_only=True):
    band: Annotated[Band, Field(1, ENUM)] = Band._2_4_GHZ
    number_of_channels: Annotated[int, Field(2, UINT32)] = 0
    first_id: Annotated[int, Field(3, UINT32)] = 0
    id_step: Annotated[int, Field(4, UINT32)] = 0
    first_frequency: Annotated[int, Field(5, UINT32)] = 0
    frequency_step: Annotated[int, Field(6, UINT32)] = 0


class Network(Submessage, frozen=True, kw_only=True):
    channel: Annotated[Channel | None, Field(1, RECORD)] = None
    encryption: Annotated[tuple[EncryptionType, ...], Field(2, ENUM)] = ()
    ssid: Annotated[str, Field(3, STRING)] = ""
    bie: Annotated[tuple[Bie, ...], Field(4, RECORD)] = ()


class Bie(Submessage, frozen=True, kw_only=True):
    oui: Annotated[bytes, Field(1, BYTES)] = b""
    data: Annotated[bytes, Field(2, BYTES)] = b""


@COMMAND.message("ListRadios", 16)
class ListRadios(ProtobufMessage, frozen=True, kw_only=True):
    type_filter: Annotated[tuple[RadioType, ...], Field(1, ENUM)] = ()


@COMMAND.message("GetState", 17)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    radio_id: Annotated[int, Field(1, UINT32)] = 0
    include_default_capabilities: Annotated[bool, Field(2, BOOL)] = False
    supports_packed_channels: Annotated[bool, Field(3, BOOL)] = False


@COMMAND.message("SetMode", 18)
class SetMode(ProtobufMessage, frozen=True, kw_only=True):
    radio_id: Annotated[int, Field(1, UINT32)] = 0
    mode: Annotated[Mode, Field(2, ENUM)] = Mode.AP


@COMMAND.message("Scan", 19)
class Scan(ProtobufMessage, frozen=True, kw_only=True):
    radio_id: Annotated[int, Field(1, UINT32)] = 0


@COMMAND.message("Configure", 20)
class Configure(ProtobufMessage, frozen=True, kw_only=True):
    radio_id: Annotated[int, Field(1, UINT32)] = 0
    access_point_config: Annotated[AccessPointConfig | None, Field(2, RECORD, "mode")] = None
    station_config: Annotated[StationConfig | None, Field(3, RECORD, "mode")] = None


@EVENT.message("RadioList", 16)
class RadioList(ProtobufMessage, frozen=True, kw_only=True):
    """Type by radio id."""

    radios: Annotated[dict[int, RadioType], Map(1, UINT32, ENUM)] = msgspec.field(default_factory=dict)


@EVENT.message("State", 17)
class State(ProtobufMessage, frozen=True, kw_only=True):
    """The key is `radio_id`; `rssi` is dBm."""

    radio_id: Annotated[int, Field(1, UINT32)] = 0
    default_capabilities: Annotated[Capabilities | None, Field(2, RECORD)] = None
    access_point_config: Annotated[AccessPointConfig | None, Field(3, RECORD)] = None
    station_config: Annotated[StationConfig | None, Field(4, RECORD)] = None
    idle: Annotated[IdleState | None, Field(5, RECORD, "mode")] = None
    access_point: Annotated[AccessPointState | None, Field(6, RECORD, "mode")] = None
    station: Annotated[StationState | None, Field(7, RECORD, "mode")] = None
    channel: Annotated[Channel | None, Field(8, RECORD)] = None
    authorized_channels: Annotated[AuthorizedChannels | None, Field(9, RECORD, "authorized_channels_type")] = None
    authorized_packed_channels: Annotated[
        AuthorizedPackedChannels | None, Field(11, RECORD, "authorized_channels_type")
    ] = None
    rssi: Annotated[int | None, Wrapped(10, INT32)] = None


@EVENT.message("Connection", 19)
class Connection(ProtobufMessage, frozen=True, kw_only=True):
    radio_id: Annotated[int, Field(1, UINT32)] = 0
    status: Annotated[ConnectionStatus, Field(2, ENUM)] = ConnectionStatus.DISCONNECTED


@EVENT.message("ScanResult", 20)
class ScanResult(ProtobufMessage, frozen=True, kw_only=True):
    radio_id: Annotated[int, Field(1, UINT32)] = 0
    networks: Annotated[tuple[Network, ...], Field(2, RECORD)] = ()

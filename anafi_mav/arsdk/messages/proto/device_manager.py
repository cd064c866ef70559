"""devicemanager: the drones a Skycontroller 4 sees and knows."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, ENUM, RECORD, SINT32, STRING, UINT32, Field, Submessage, Wrapped
from anafi_mav.arsdk.codec.wire import OpenEnum
from anafi_mav.arsdk.messages.proto import backuplink, microhard

COMMAND = ProtobufEnvelope("arsdk.devicemanager.Command", "devicemanager.Command")
EVENT = ProtobufEnvelope("arsdk.devicemanager.Event", "devicemanager.Event")


class ConnectionFailureReason(OpenEnum):
    PEER_LIMIT = 0
    AUTHENTICATION_FAILED = 1
    RADIO_NOT_READY = 2


class DiscoveryStatus(OpenEnum):
    SUCCESS = 0
    ERROR_RADIO_NOT_READY = 1
    ERROR_NO_DISCOVERABLE_DRONE = 2


class PairingFailureReason(OpenEnum):
    RADIO_NOT_READY = 0
    NO_REMOTE_ANTENNA = 1
    UNAUTHORIZED = 2


class Transport(OpenEnum):
    WIFI = 0
    CELLULAR = 1
    MICROHARD = 2
    MARS = 3
    BACKUP_LINK = 4


class WifiSecurity(OpenEnum):
    NONE = 0
    WPA2 = 1


class ConnectDeviceWifi(Submessage, frozen=True, kw_only=True):
    security_key: Annotated[str, Field(1, STRING)] = ""


class ConnectDeviceCellular(Submessage, frozen=True, kw_only=True):
    pass


class ConnectDeviceMicrohard(Submessage, frozen=True, kw_only=True):
    power: Annotated[int | None, Wrapped(1, UINT32)] = None


class ConnectDeviceMars(Submessage, frozen=True, kw_only=True):
    pass


class ChangeConnectionParametersWifi(Submessage, frozen=True, kw_only=True):
    pass


class ChangeConnectionParametersCellular(Submessage, frozen=True, kw_only=True):
    pass


class ChangeConnectionParametersMicrohard(Submessage, frozen=True, kw_only=True):
    power: Annotated[int | None, Wrapped(1, UINT32)] = None
    channel: Annotated[int | None, Wrapped(2, UINT32)] = None
    bandwidth: Annotated[microhard.BandwidthValue | None, Field(3, RECORD)] = None


class ChangeConnectionParametersMars(Submessage, frozen=True, kw_only=True):
    pass


class Capabilities(Submessage, frozen=True, kw_only=True):
    discovery_transports: Annotated[tuple[Transport, ...], Field(1, ENUM)] = ()
    microhard: Annotated[CapabilitiesMicrohard | None, Field(2, RECORD)] = None
    available_transports: Annotated[tuple[Transport, ...], Field(3, ENUM)] = ()


class CapabilitiesMicrohard(Submessage, frozen=True, kw_only=True):
    power_min: Annotated[int, Field(2, UINT32)] = 0
    power_max: Annotated[int, Field(3, UINT32)] = 0


class StateKnownDevices(Submessage, frozen=True, kw_only=True):
    devices: Annotated[tuple[KnownDevice, ...], Field(2, RECORD)] = ()


class KnownDevice(Submessage, frozen=True, kw_only=True):
    info: Annotated[DeviceInfo | None, Field(1, RECORD)] = None
    wifi: Annotated[WifiInfo | None, Field(2, RECORD)] = None
    cellular: Annotated[CellularInfo | None, Field(3, RECORD)] = None
    microhard: Annotated[MicrohardInfo | None, Field(4, RECORD)] = None
    mars: Annotated[MarsInfo | None, Field(5, RECORD)] = None
    backup_link: Annotated[BackupLinkInfo | None, Field(6, RECORD)] = None


class DeviceInfo(Submessage, frozen=True, kw_only=True):
    uid: Annotated[str, Field(1, STRING)] = ""
    model: Annotated[int, Field(2, UINT32)] = 0
    network_id: Annotated[str, Field(3, STRING)] = ""


class WifiInfo(Submessage, frozen=True, kw_only=True):
    security: Annotated[WifiSecurity, Field(1, ENUM)] = WifiSecurity.NONE
    saved_key: Annotated[bool, Field(2, BOOL)] = False


class CellularInfo(Submessage, frozen=True, kw_only=True):
    pass


class MicrohardInfo(Submessage, frozen=True, kw_only=True):
    power: Annotated[int, Field(1, UINT32)] = 0
    channel: Annotated[int, Field(2, UINT32)] = 0
    bandwidth: Annotated[microhard.Bandwidth, Field(3, ENUM)] = microhard.Bandwidth._1MHZ
    encryption_algorithm: Annotated[microhard.Encryption, Field(4, ENUM)] = microhard.Encryption.NONE


class MarsInfo(Submessage, frozen=True, kw_only=True):
    pass


class BackupLinkInfo(Submessage, frozen=True, kw_only=True):
    pass


class ConnectionStateIdle(Submessage, frozen=True, kw_only=True):
    pass


class ConnectionStateSearching(Submessage, frozen=True, kw_only=True):
    scanning_idle_devices: Annotated[bool, Field(1, BOOL)] = False


class ConnectionStateConnecting(Submessage, frozen=True, kw_only=True):
    device: Annotated[DeviceInfo | None, Field(1, RECORD)] = None
    transport: Annotated[Transport, Field(2, ENUM)] = Transport.WIFI
    sdk_ready: Annotated[bool, Field(3, BOOL)] = False
    backup_link: Annotated[backuplink.LinkState, Field(4, ENUM)] = backuplink.LinkState.OFF


class ConnectionStateConnected(Submessage, frozen=True, kw_only=True):
    device: Annotated[DeviceInfo | None, Field(1, RECORD)] = None
    transport: Annotated[Transport, Field(2, ENUM)] = Transport.WIFI
    backup_link: Annotated[backuplink.LinkState, Field(3, ENUM)] = backuplink.LinkState.OFF


class ConnectionStateDisconnecting(Submessage, frozen=True, kw_only=True):
    device: Annotated[DeviceInfo | None, Field(1, RECORD)] = None
    transport: Annotated[Transport, Field(2, ENUM)] = Transport.WIFI


class DiscoveredDevice(Submessage, frozen=True, kw_only=True):
    info: Annotated[DeviceInfo | None, Field(1, RECORD)] = None
    known: Annotated[bool, Field(2, BOOL)] = False
    wifi_visibility: Annotated[DiscoveredDeviceWifiVisibility | None, Field(3, RECORD)] = None
    cellular_visibility: Annotated[DiscoveredDeviceCellularVisibility | None, Field(4, RECORD)] = None
    backup_link_visibility: Annotated[DiscoveredDeviceBackupLinkVisibility | None, Field(5, RECORD)] = None


class DiscoveredDeviceWifiVisibility(Submessage, frozen=True, kw_only=True):
    transport_info: Annotated[WifiInfo | None, Field(1, RECORD)] = None
    rssi: Annotated[int, Field(2, SINT32)] = 0


class DiscoveredDeviceCellularVisibility(Submessage, frozen=True, kw_only=True):
    transport_info: Annotated[CellularInfo | None, Field(1, RECORD)] = None


class DiscoveredDeviceBackupLinkVisibility(Submessage, frozen=True, kw_only=True):
    drone_started: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    include_default_capabilities: Annotated[bool, Field(1, BOOL)] = False
    supports_fast_connection: Annotated[bool, Field(2, BOOL)] = False


@COMMAND.message("ConnectDevice", 17)
class ConnectDevice(ProtobufMessage, frozen=True, kw_only=True):
    uid: Annotated[str, Field(1, STRING)] = ""
    wifi: Annotated[ConnectDeviceWifi | None, Field(2, RECORD, "transport")] = None
    cellular: Annotated[ConnectDeviceCellular | None, Field(3, RECORD, "transport")] = None
    microhard: Annotated[ConnectDeviceMicrohard | None, Field(4, RECORD, "transport")] = None
    mars: Annotated[ConnectDeviceMars | None, Field(5, RECORD, "transport")] = None
    wake_idle: Annotated[bool, Field(6, BOOL)] = False


@COMMAND.message("ForgetDevice", 18)
class ForgetDevice(ProtobufMessage, frozen=True, kw_only=True):
    uid: Annotated[str, Field(1, STRING)] = ""


@COMMAND.message("DiscoverDevices", 19)
class DiscoverDevices(ProtobufMessage, frozen=True, kw_only=True):
    use_backup_radio: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("ChangeConnectionParameters", 20)
class ChangeConnectionParameters(ProtobufMessage, frozen=True, kw_only=True):
    uid: Annotated[str, Field(1, STRING)] = ""
    wifi: Annotated[ChangeConnectionParametersWifi | None, Field(2, RECORD, "transport")] = None
    cellular: Annotated[ChangeConnectionParametersCellular | None, Field(3, RECORD, "transport")] = None
    microhard: Annotated[ChangeConnectionParametersMicrohard | None, Field(4, RECORD, "transport")] = None
    mars: Annotated[ChangeConnectionParametersMars | None, Field(5, RECORD, "transport")] = None


@COMMAND.message("StopDiscovery", 21)
class StopDiscovery(ProtobufMessage, frozen=True, kw_only=True):
    pass


@EVENT.message("State", 16)
class State(ProtobufMessage, frozen=True, kw_only=True):
    default_capabilities: Annotated[Capabilities | None, Field(1, RECORD)] = None
    known_devices: Annotated[StateKnownDevices | None, Field(3, RECORD)] = None
    idle: Annotated[ConnectionStateIdle | None, Field(4, RECORD, "connection_state")] = None
    searching: Annotated[ConnectionStateSearching | None, Field(5, RECORD, "connection_state")] = None
    connecting: Annotated[ConnectionStateConnecting | None, Field(6, RECORD, "connection_state")] = None
    connected: Annotated[ConnectionStateConnected | None, Field(7, RECORD, "connection_state")] = None
    disconnecting: Annotated[ConnectionStateDisconnecting | None, Field(8, RECORD, "connection_state")] = None


@EVENT.message("ConnectionFailure", 17)
class ConnectionFailure(ProtobufMessage, frozen=True, kw_only=True):
    device: Annotated[DeviceInfo | None, Field(1, RECORD)] = None
    transport: Annotated[Transport, Field(2, ENUM)] = Transport.WIFI
    reason: Annotated[ConnectionFailureReason, Field(3, ENUM)] = ConnectionFailureReason.PEER_LIMIT


@EVENT.message("DiscoveredDevices", 18)
class DiscoveredDevices(ProtobufMessage, frozen=True, kw_only=True):
    devices: Annotated[tuple[DiscoveredDevice, ...], Field(1, RECORD)] = ()
    status: Annotated[DiscoveryStatus, Field(2, ENUM)] = DiscoveryStatus.SUCCESS


@EVENT.message("PairingDone", 19)
class PairingDone(ProtobufMessage, frozen=True, kw_only=True):
    paired_device: Annotated[KnownDevice | None, Field(1, RECORD)] = None


@EVENT.message("PairingFailed", 20)
class PairingFailed(ProtobufMessage, frozen=True, kw_only=True):
    reason: Annotated[PairingFailureReason, Field(1, ENUM)] = PairingFailureReason.RADIO_NOT_READY

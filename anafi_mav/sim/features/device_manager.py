"""Skycontroller 4's protobuf services devicemanager and controllernetwork.

They report its drone and its links. The older messages (drone_manager) report the same and are sent too. A drone that
is back in reach is reported as connected at once: the pause that a client may ask for (`supports_fast_connection`) is
not made.
"""

from __future__ import annotations

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.messages.proto import controller_network, network
from anafi_mav.arsdk.messages.proto import device_manager as words
from anafi_mav.sim.features.wireless import RSSI

QUALITY = 5
"""Of the link between controller and drone: 0 to 5."""

_SECRET = words.WifiInfo(security=words.WifiSecurity.WPA2, saved_key=True)


class DeviceManager:
    """One controller's. `drone` is the one drone that there is."""

    def __init__(self, drone: DeviceInfo) -> None:
        self._device = words.DeviceInfo(uid=drone.serial, model=drone.model_id, network_id=drone.name)

    def handle(self, message: Message, connected: bool, known: bool) -> list[Message] | None:
        """Return the answer to a command, or None when it belongs to another service.

        `known`: the drone is paired.
        """
        match message:
            case words.GetState():
                return [self.state(connected, known, message.include_default_capabilities)]
            case words.DiscoverDevices():
                seen = words.DiscoveredDevice(
                    info=self._device,
                    known=known,
                    wifi_visibility=words.DiscoveredDeviceWifiVisibility(transport_info=_SECRET, rssi=RSSI),
                )
                return [words.DiscoveredDevices(devices=(seen,) if connected else ())]
            case words.ConnectDevice() | words.ForgetDevice():
                return [self.state(connected, known)]
            case words.StopDiscovery() | words.ChangeConnectionParameters():
                return []
            case controller_network.GetState() | controller_network.SetEthernetIpConfig():
                link = network.LinksStatusLinkInfo(
                    type=network.LinkType.WLAN,
                    status=network.LinkStatus.RUNNING if connected else network.LinkStatus.UP,
                    quality=QUALITY if connected else 0,
                )
                return [controller_network.State(links_status=network.LinksStatus(links=(link,)))]
        return None

    def state(self, connected: bool, known: bool, default: bool = False) -> Message:
        """Of the connection to the drone."""
        wifi = (words.Transport.WIFI,)
        devices = (words.KnownDevice(info=self._device, wifi=_SECRET),) if known else ()
        return words.State(
            default_capabilities=words.Capabilities(discovery_transports=wifi, available_transports=wifi)
            if default
            else None,
            known_devices=words.StateKnownDevices(devices=devices),
            connected=words.ConnectionStateConnected(device=self._device, transport=wifi[0]) if connected else None,
            searching=None if connected else words.ConnectionStateSearching(),
        )

"""Wi-Fi of the drone: networks in reach and channels, in both of Parrot's message formats.

The networks are invented; the channels are those that are allowed nearly everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import wifi
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.proto import connectivity

RADIO = 0
"""Id of the one radio."""
RSSI = -40
"""dBm."""

COUNTRIES = ("FR", "US", "GB", "DE", "CH")

_NEIGHBOURS = (("neighbour", -71, wifi.Band._2_4_GHZ, 6), ("neighbour-5G", -78, wifi.Band._5_GHZ, 44))
"""Name, dBm, band, channel."""

_CHANNELS = {wifi.Band._2_4_GHZ: range(1, 12), wifi.Band._5_GHZ: range(36, 49, 4)}
_BANDS = {wifi.Band._2_4_GHZ: connectivity.Band._2_4_GHZ, wifi.Band._5_GHZ: connectivity.Band._5_0_GHZ}
_EVERYWHERE = 1 << wifi.Environment.INDOOR | 1 << wifi.Environment.OUTDOOR


def classic(message: Message) -> list[Message] | None:
    """Return the answer to a command of feature wifi that is not a setting.

    Returns None for any other message.
    """
    match message:
        case wifi.Scan():
            seen = [one for one in _NEIGHBOURS if message.band >> one[2] & 1]
            return [wifi.ScannedItem(*one, _flags(index, len(seen))) for index, one in enumerate(seen)] or [
                wifi.ScannedItem("", 0, wifi.Band._2_4_GHZ, 0, 1 << ListFlags.EMPTY)
            ]
        case wifi.UpdateAuthorizedChannels():
            all = [(band, channel) for band, channels in _CHANNELS.items() for channel in channels]
            return [
                wifi.AuthorizedChannel(band, channel, _EVERYWHERE, _flags(index, len(all)))
                for index, (band, channel) in enumerate(all)
            ]
    return None


def _flags(index: int, count: int) -> int:
    return (index == 0) << ListFlags.FIRST | (index == count - 1) << ListFlags.LAST


def _channel(band: wifi.Band, id: int) -> connectivity.Channel:
    return connectivity.Channel(radio_channel=connectivity.RadioChannel(band=_BANDS[band], id=id))


class Radio:
    """The Ai's, an access point."""

    def __init__(self, ssid: str) -> None:
        self._config = connectivity.AccessPointConfig(
            security=connectivity.NetworkSecurityMode(encryption=(connectivity.EncryptionType.WPA2,)),
            ssid=ssid,
            country=COUNTRIES[0],
            environment=connectivity.EnvironmentValue(value=connectivity.Environment.OUTDOOR),
            manual_channel=_channel(wifi.Band._5_GHZ, 36),
        )

    def handle(self, message: Message) -> Iterable[Message]:
        """The answer to a command of service connectivity."""
        if isinstance(message, connectivity.ListRadios):
            wanted = not message.type_filter or connectivity.RadioType.WIFI in message.type_filter
            yield connectivity.RadioList(radios={RADIO: connectivity.RadioType.WIFI} if wanted else {})
            return
        if getattr(message, "radio_id", RADIO) != RADIO:
            return
        match message:
            case connectivity.GetState():
                yield self._state(message.include_default_capabilities, message.supports_packed_channels)
            case connectivity.SetMode():  # an access point is all that it can be
                yield self._state()
            case connectivity.Configure():
                if message.access_point_config is not None:
                    self._configure(message.access_point_config)
                yield self._state()
            case connectivity.Scan():
                open = (connectivity.EncryptionType.WPA2,)
                yield connectivity.ScanResult(
                    radio_id=RADIO,
                    networks=tuple(
                        connectivity.Network(channel=_channel(band, channel), encryption=open, ssid=name)
                        for name, _, band, channel in _NEIGHBOURS
                    ),
                )

    def _configure(self, wanted: connectivity.AccessPointConfig) -> None:
        """Take what is named."""
        changes: dict[str, Any] = {
            name: getattr(wanted, name)
            for name in ("security", "ssid", "hidden", "environment")
            if getattr(wanted, name) is not None
        }
        if wanted.country in COUNTRIES:
            changes["country"] = wanted.country
        channel = wanted.manual_channel and wanted.manual_channel.radio_channel
        if channel and any(channel.id in ids for band, ids in _CHANNELS.items() if _BANDS[band] == channel.band):
            changes |= {"manual_channel": wanted.manual_channel, "automatic_channel": None}
        elif wanted.automatic_channel is not None:
            changes |= {"manual_channel": None, "automatic_channel": wanted.automatic_channel}
        self._config = replace(self._config, **changes)

    def _state(self, default: bool = False, packed: bool = False) -> Message:
        capabilities = connectivity.Capabilities(
            model="simulated",
            supported_modes=(connectivity.Mode.AP,),
            supported_encryption_types=(connectivity.EncryptionType.OPEN, connectivity.EncryptionType.WPA2),
            supported_countries=COUNTRIES,
        )
        lists = list(_CHANNELS.items())
        return connectivity.State(
            radio_id=RADIO,
            default_capabilities=capabilities if default else None,
            access_point_config=self._config,
            access_point=connectivity.AccessPointState(system_state=connectivity.SystemState.RUNNING),
            channel=self._config.manual_channel or _channel(wifi.Band._5_GHZ, 36),
            authorized_channels=None
            if packed
            else connectivity.AuthorizedChannels(
                channel=tuple(
                    connectivity.ChannelDescriptor(channel=_channel(band, id), frequency=_frequency(band, id))
                    for band, ids in lists
                    for id in ids
                )
            ),
            authorized_packed_channels=connectivity.AuthorizedPackedChannels(
                channels=tuple(
                    connectivity.PackedChannelDescriptor(
                        band=_BANDS[band],
                        number_of_channels=len(ids),
                        first_id=ids.start,
                        id_step=ids.step,
                        first_frequency=_frequency(band, ids.start),
                        frequency_step=5 * ids.step,
                    )
                    for band, ids in lists
                )
            )
            if packed
            else None,
            rssi=RSSI,
        )


def _frequency(band: wifi.Band, id: int) -> int:
    """MHz (IEEE 802.11 §17.3.8.4.2, §15.4.4.3)."""
    return (2407 if band is wifi.Band._2_4_GHZ else 5000) + 5 * id

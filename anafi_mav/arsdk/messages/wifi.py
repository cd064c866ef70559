"""Feature 135, wifi."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, I16, STRING, U8, Bits, Message, OpenEnum, command, event
from anafi_mav.arsdk.messages.generic import ListFlags


class Band(OpenEnum):
    _2_4_GHZ = 0
    _5_GHZ = 1


class SelectionType(OpenEnum):
    AUTO_ALL = 0
    AUTO_2_4_GHZ = 1
    AUTO_5_GHZ = 2
    MANUAL = 3


class SecurityType(OpenEnum):
    OPEN = 0
    WPA2 = 1


class SecurityKeyType(OpenEnum):
    PLAIN = 0


class Environment(OpenEnum):
    INDOOR = 0
    OUTDOOR = 1


class CountrySelection(OpenEnum):
    MANUAL = 0
    AUTO = 1


@command("wifi.scan", 135, 0, 1)
class Scan(Message, frozen=True):
    band: Annotated[int, Bits(U8, Band)]


@event("wifi.scanned_item", 135, 0, 2)
class ScannedItem(Message, frozen=True):
    ssid: Annotated[str, STRING]
    rssi: Annotated[int, I16]
    band: Annotated[Band, ENUM]
    channel: Annotated[int, U8]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@command("wifi.update_authorized_channels", 135, 0, 3)
class UpdateAuthorizedChannels(Message, frozen=True):
    pass


@event("wifi.authorized_channel", 135, 0, 4)
class AuthorizedChannel(Message, frozen=True):
    band: Annotated[Band, ENUM]
    channel: Annotated[int, U8]
    environment: Annotated[int, Bits(U8, Environment)]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@command("wifi.set_ap_channel", 135, 0, 5)
class SetApChannel(Message, frozen=True):
    type: Annotated[SelectionType, ENUM]
    band: Annotated[Band, ENUM]
    channel: Annotated[int, U8]


@event("wifi.ap_channel_changed", 135, 0, 6)
class ApChannelChanged(Message, frozen=True):
    type: Annotated[SelectionType, ENUM]
    band: Annotated[Band, ENUM]
    channel: Annotated[int, U8]


@command("wifi.set_security", 135, 0, 7)
class SetSecurity(Message, frozen=True):
    type: Annotated[SecurityType, ENUM]
    key: Annotated[str, STRING]
    key_type: Annotated[SecurityKeyType, ENUM]


@event("wifi.security_changed", 135, 0, 8)
class SecurityChanged(Message, frozen=True):
    type: Annotated[SecurityType, ENUM]
    key: Annotated[str, STRING]
    key_type: Annotated[SecurityKeyType, ENUM]


@command("wifi.set_country", 135, 0, 9)
class SetCountry(Message, frozen=True):
    selection_mode: Annotated[CountrySelection, ENUM]
    code: Annotated[str, STRING]


@event("wifi.country_changed", 135, 0, 10)
class CountryChanged(Message, frozen=True):
    selection_mode: Annotated[CountrySelection, ENUM]
    code: Annotated[str, STRING]


@command("wifi.set_environment", 135, 0, 11)
class SetEnvironment(Message, frozen=True):
    environment: Annotated[Environment, ENUM]


@event("wifi.environment_changed", 135, 0, 12)
class EnvironmentChanged(Message, frozen=True):
    environment: Annotated[Environment, ENUM]


@event("wifi.rssi_changed", 135, 0, 13)
class RssiChanged(Message, frozen=True):
    rssi: Annotated[int, I16]


@event("wifi.supported_countries", 135, 0, 14)
class SupportedCountries(Message, frozen=True):
    countries: Annotated[str, STRING]


@event("wifi.supported_security_types", 135, 0, 15)
class SupportedSecurityTypes(Message, frozen=True):
    types: Annotated[int, Bits(U8, SecurityType)]

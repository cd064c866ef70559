"""Element link: how good the radio between the controller and the drone is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common, wifi
from anafi_mav.drone.element import Element, Reducer

_QUALITY = 0x0F
_INTERFERENCE_4G = 1 << 6
_PERTURBED = 1 << 7


class LinkState(msgspec.Struct, frozen=True):
    """Quality of the radio link."""

    quality: int | None = None
    """1 (a disconnection is highly probable) to 5 (very good)."""
    interference_4g: bool | None = None
    """A phone's 4G probably disturbs the link."""
    perturbed: bool | None = None
    """The quality is low although the signal is strong."""
    rssi_dbm: int | None = None


def _quality(state: LinkState, message: common.LinkSignalQuality) -> LinkState:
    quality = message.value & _QUALITY
    return replace(
        state,
        quality=quality if 1 <= quality <= 5 else None,
        interference_4g=bool(message.value & _INTERFERENCE_4G),
        perturbed=bool(message.value & _PERTURBED),
    )


class Link(Element[LinkState]):
    """The radio link to the drone. No verbs."""

    NOTHING = LinkState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        common.LinkSignalQuality: _quality,
        common.WifiSignalChanged: lambda state, message: replace(state, rssi_dbm=message.rssi),
        wifi.RssiChanged: lambda state, message: replace(state, rssi_dbm=message.rssi),
    }

    SAMPLES: ClassVar[tuple[type[Message], ...]] = (common.WifiSignalChanged, wifi.RssiChanged)
    """Events that come all the time."""

"""Feature 137, drone_manager: the drones a Skycontroller sees and knows."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, I8, STRING, U8, U16, Bits, Message, OpenEnum, command, event
from anafi_mav.arsdk.messages.generic import ListFlags


class VisibleState(OpenEnum):
    WIFI_VISIBLE = 0
    CELLULAR_ONLINE = 1


class Security(OpenEnum):
    NONE = 0
    WPA2 = 1


class DroneManagerConnectionState(OpenEnum):
    IDLE = 0
    SEARCHING = 1
    CONNECTING = 2
    CONNECTED = 3
    DISCONNECTING = 4


@command("drone_manager.discover_drones", 137, 0, 1)
class DiscoverDrones(Message, frozen=True):
    """Answered by a list of `DroneListItem`."""


@event("drone_manager.drone_list_item", 137, 0, 2)
class DroneListItem(Message, frozen=True):
    serial: Annotated[str, STRING]
    model: Annotated[int, U16]
    name: Annotated[str, STRING]
    connection_order: Annotated[int, U8]
    active: Annotated[int, U8]
    visible: Annotated[int, Bits(U8, VisibleState)]
    security: Annotated[Security, ENUM]
    has_saved_key: Annotated[int, U8]
    rssi: Annotated[int, I8]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@command("drone_manager.connect", 137, 0, 3)
class Connect(Message, frozen=True):
    """`key` is the Wi-Fi passphrase, empty when the controller has it saved."""

    serial: Annotated[str, STRING]
    key: Annotated[str, STRING]


@command("drone_manager.forget", 137, 0, 4)
class Forget(Message, frozen=True):
    serial: Annotated[str, STRING]


@event("drone_manager.connection_state", 137, 0, 5)
class ConnectionState(Message, frozen=True):
    state: Annotated[DroneManagerConnectionState, ENUM]
    serial: Annotated[str, STRING]
    model: Annotated[int, U16]
    name: Annotated[str, STRING]


@event("drone_manager.authentication_failed", 137, 0, 6)
class AuthenticationFailed(Message, frozen=True):
    serial: Annotated[str, STRING]
    model: Annotated[int, U16]
    name: Annotated[str, STRING]


@event("drone_manager.connection_refused", 137, 0, 7)
class ConnectionRefused(Message, frozen=True):
    serial: Annotated[str, STRING]
    model: Annotated[int, U16]
    name: Annotated[str, STRING]


@event("drone_manager.known_drone_item", 137, 0, 8)
class KnownDroneItem(Message, frozen=True):
    serial: Annotated[str, STRING]
    model: Annotated[int, U16]
    name: Annotated[str, STRING]
    security: Annotated[Security, ENUM]
    has_saved_key: Annotated[int, U8]
    list_flags: Annotated[int, Bits(U8, ListFlags)]

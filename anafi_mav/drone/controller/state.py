"""State that a Skycontroller reports: its own, the drones it knows, its pilot's sticks.

The verbs are in `controller`.

A Skycontroller 4 reports its drones in protobuf (devicemanager), the older ones in drone_manager; it may use both.
Its own links it reports in controllernetwork.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import drone_manager, mapper, skyctrl
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.arsdk.messages.mapper import ButtonEvent
from anafi_mav.arsdk.messages.proto import controller_network, device_manager, network
from anafi_mav.arsdk.messages.skyctrl import BatteryStatus, CalibrationStatus, Source
from anafi_mav.drone.element import MAX_ITEMS, Position, Reducer, position, with_item

MAX_AXIS = 5
"""Highest number of an axis."""


class ControllerAttitude(msgspec.Struct, frozen=True):
    """A unit quaternion from the controller's axes (forward, right, down) to North-East-Down."""

    w: float
    x: float
    y: float
    z: float


class KnownDrone(msgspec.Struct, frozen=True):
    """A drone that the controller has seen or been paired with."""

    serial: str
    model: int
    name: str
    has_key: bool
    """The controller knows the passphrase of its Wi-Fi, or needs none."""
    active: bool = False
    """The controller is connected to it."""
    rssi_dbm: int | None = None
    """How well it is received; None: it is not in sight."""


class ControllerState(msgspec.Struct, frozen=True):
    """The Skycontroller, its pilot's controls and the drones it knows."""

    serial: str | None = None
    firmware: str | None = None
    hardware: str | None = None
    battery_percent: int | None = None
    """None while it is charging, too."""
    battery: BatteryStatus | None = None
    attitude: ControllerAttitude | None = None
    position: Position | None = None
    """Place of the controller, None without a fix; altitude above mean sea level."""
    magnetometer: CalibrationStatus | None = None
    link: Connection | None = None
    """To the drone."""
    drone_serial: str | None = None
    drone_name: str | None = None
    drone_model: int | None = None
    """Parrot's product number; 0 while there is no drone."""
    source: Source | None = None
    """Piloting source: whose sticks fly the drone."""
    grabbed_axes: int | None = None
    grabbed_buttons: int | None = None
    axes: Mapping[int, int] = {}
    """Grabbed axis -> percent, -100..100."""
    pressed: frozenset[int] = frozenset()
    """Grabbed buttons that are held down."""
    visible: Mapping[str, KnownDrone] = {}
    """By serial number, drones that the controller saw when it was last asked."""
    known: Mapping[str, KnownDrone] = {}
    """By serial number, drones that it will connect to."""
    links: Mapping[network.LinkType, network.LinkStatus] = {}
    """The controller's own ways to a drone. Skycontroller 4 only."""
    protobuf: bool = False
    """It manages its drones in protobuf."""


def _attitude(state: ControllerState, message: skyctrl.AttitudeChanged) -> ControllerState:
    norm = math.sqrt(message.q0**2 + message.q1**2 + message.q2**2 + message.q3**2)
    if not math.isfinite(norm) or norm < 0.5:
        return state
    parts = (message.q0, message.q1, message.q2, message.q3)
    return replace(state, attitude=ControllerAttitude(*(part / norm for part in parts)))


def _battery(state: ControllerState, message: skyctrl.BatteryChanged) -> ControllerState:
    return replace(state, battery_percent=message.percent if message.percent <= 100 else None)


def _place(state: ControllerState, message: skyctrl.GpsPositionChanged) -> ControllerState:
    return replace(state, position=position(message.latitude, message.longitude, message.altitude))


def _fix(state: ControllerState, message: skyctrl.GpsFixChanged) -> ControllerState:
    """A place without a fix is an old one; the next one that is reported counts."""
    return state if message.fixed else replace(state, position=None)


def _connection(state: ControllerState, message: drone_manager.ConnectionState) -> ControllerState:
    return replace(
        state, link=message.state, drone_serial=message.serial, drone_name=message.name, drone_model=message.model
    )


def _grabbed(state: ControllerState, message: mapper.GrabState) -> ControllerState:
    pressed = frozenset(button for button in range(32) if message.buttons_state >> button & 1)
    axes = {axis: value for axis, value in state.axes.items() if message.axes >> axis & 1}
    return replace(state, grabbed_axes=message.axes, grabbed_buttons=message.buttons, pressed=pressed, axes=axes)


def _axis(state: ControllerState, message: mapper.GrabAxisEvent) -> ControllerState:
    if message.axis > MAX_AXIS:
        return state
    return replace(state, axes={**state.axes, message.axis: message.value})


def _button(state: ControllerState, message: mapper.GrabButtonEvent) -> ControllerState:
    if message.button >= 32:
        return state
    held = {message.button}
    return replace(state, pressed=state.pressed | held if message.event == ButtonEvent.PRESS else state.pressed - held)


def _seen(state: ControllerState, message: drone_manager.DroneListItem) -> ControllerState:
    in_sight = message.visible & 1 << drone_manager.VisibleState.WIFI_VISIBLE
    drone = KnownDrone(
        message.serial,
        message.model,
        message.name,
        bool(message.has_saved_key) or message.security == drone_manager.Security.NONE,
        bool(message.active),
        message.rssi if in_sight else None,
    )
    return replace(state, visible=with_item(state.visible, message.serial, drone, message.list_flags))


def _known(state: ControllerState, message: drone_manager.KnownDroneItem) -> ControllerState:
    open_to_all = message.security == drone_manager.Security.NONE
    drone = KnownDrone(message.serial, message.model, message.name, bool(message.has_saved_key) or open_to_all)
    return replace(state, known=with_item(state.known, message.serial, drone, message.list_flags))


def _devices(state: ControllerState, message: device_manager.State) -> ControllerState:
    """Apply a device-manager state; fields that it does not carry have not changed."""
    if message.known_devices is not None:
        known = [_paired(one) for one in message.known_devices.devices[:MAX_ITEMS]]
        state = replace(state, known={one.serial: one for one in known if one is not None})
    state = replace(state, protobuf=True)
    link, device = state.link, None
    if message.connected is not None:
        link, device = Connection.CONNECTED, message.connected.device
    elif message.connecting is not None:
        link, device = Connection.CONNECTING, message.connecting.device
    elif message.disconnecting is not None:
        link, device = Connection.DISCONNECTING, message.disconnecting.device
    elif message.searching is not None:
        link = Connection.SEARCHING
    elif message.idle is not None:
        link = Connection.IDLE
    state = replace(state, link=link)
    if device is None:
        return state
    return replace(state, drone_serial=device.uid, drone_model=device.model, drone_name=device.network_id)


def _paired(device: device_manager.KnownDevice) -> KnownDrone | None:
    info, wifi = device.info, device.wifi
    if info is None:
        return None
    return KnownDrone(info.uid, info.model, info.network_id, wifi is None or _opens(wifi))


def _opens(wifi: device_manager.WifiInfo) -> bool:
    return wifi.saved_key or wifi.security == device_manager.WifiSecurity.NONE


def _discovered(state: ControllerState, message: device_manager.DiscoveredDevices) -> ControllerState:
    visible = {}
    for device in message.devices[:MAX_ITEMS]:
        info, wifi = device.info, device.wifi_visibility
        if info is None:
            continue
        opens = device.known if wifi is None or wifi.transport_info is None else _opens(wifi.transport_info)
        active = state.link == Connection.CONNECTED and info.uid == state.drone_serial
        rssi = None if wifi is None else wifi.rssi
        visible[info.uid] = KnownDrone(info.uid, info.model, info.network_id, opens, active, rssi)
    return replace(state, visible=visible)


def _links(state: ControllerState, message: controller_network.State) -> ControllerState:
    if message.links_status is None:
        return state
    return replace(state, links={link.type: link.status for link in message.links_status.links[:MAX_ITEMS]})


REDUCERS: Mapping[type[Message], Reducer] = {
    skyctrl.ProductSerialChanged: lambda state, message: replace(state, serial=message.serialNumber),
    skyctrl.ProductVersionChanged: lambda state, message: replace(
        state, firmware=message.software, hardware=message.hardware
    ),
    skyctrl.BatteryChanged: _battery,
    skyctrl.BatteryState: lambda state, message: replace(state, battery=message.state),
    skyctrl.AttitudeChanged: _attitude,
    skyctrl.GpsFixChanged: _fix,
    skyctrl.GpsPositionChanged: _place,
    skyctrl.MagnetoCalibrationState: lambda state, message: replace(state, magnetometer=message.status),
    skyctrl.PilotingSource: lambda state, message: replace(state, source=message.source),
    drone_manager.ConnectionState: _connection,
    drone_manager.DroneListItem: _seen,
    drone_manager.KnownDroneItem: _known,
    mapper.ActiveProduct: lambda state, message: replace(state, drone_model=message.product),
    mapper.GrabState: _grabbed,
    mapper.GrabAxisEvent: _axis,
    mapper.GrabButtonEvent: _button,
    device_manager.State: _devices,
    device_manager.DiscoveredDevices: _discovered,
    controller_network.State: _links,
}

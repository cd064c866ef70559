"""MAVLink service for standard modes: available modes, current mode, selection.

AVAILABLE_MODES, AVAILABLE_MODES_MONITOR, CURRENT_MODE, MAV_CMD_DO_SET_STANDARD_MODE (MAVLink standard_modes.md,
conformance A2, A3, C10).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav.drone import events
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.command.flight_service import change_mode
from anafi_mav.services.commands import Action, Altitude, Command, effect_of_mode
from anafi_mav.services.flavours import STANDARD_MODES, Flavour, flavour_of, mode_of_standard
from anafi_mav.services.service import Answer, Host, Request, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.subscriptions import Subscriptions
from anafi_mav.vehicle.vehicle import Vehicle

_BY_ITSELF = (FlightMode.ORBIT, FlightMode.TERMINATED)
"""Shown, but entered by a command only."""

_ADVANCED = (FlightMode.OFFBOARD, FlightMode.GUIDED)
_AUTOMATIC = (
    FlightMode.MISSION,
    FlightMode.RETURN,
    FlightMode.LAND,
    FlightMode.TAKEOFF,
    FlightMode.FOLLOW,
    FlightMode.ORBIT,
)


def properties(mode: FlightMode, vehicle: Vehicle) -> int:
    """MAV_MODE_PROPERTY bits of a mode, as things stand."""
    bits = 0
    if mode in _ADVANCED:
        bits |= dialect.MAV_MODE_PROPERTY_ADVANCED
    if mode in _BY_ITSELF or mode not in vehicle.enterable_modes:
        bits |= dialect.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE
    if mode in _AUTOMATIC:
        bits |= dialect.MAV_MODE_PROPERTY_AUTO_MODE
    return bits


def available(vehicle: Vehicle, flavour: Flavour) -> list[dialect.MAVLink_message]:
    """AVAILABLE_MODES of every mode."""
    listed = flavour.mode_names
    return [
        dialect.MAVLink_available_modes_message(
            len(listed),
            index,
            STANDARD_MODES.get(mode, dialect.MAV_STANDARD_MODE_NON_STANDARD),
            flavour.custom_mode(mode),
            properties(mode, vehicle),
            name.encode(),
        )
        for index, (mode, name) in enumerate(listed.items(), 1)
    ]


def current_mode(mode: FlightMode, intended: FlightMode, flavour: Flavour) -> dialect.MAVLink_message:
    """Return CURRENT_MODE."""
    return dialect.MAVLink_current_mode_message(
        STANDARD_MODES.get(mode, dialect.MAV_STANDARD_MODE_NON_STANDARD),
        flavour.custom_mode(mode),
        flavour.custom_mode(intended),
    )


class ModesService(Service):
    """Reports and sets modes; their effect is in the vehicle."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._intended = FlightMode.HOLD
        """The mode that the drone was in before it began to act by itself; otherwise its mode. Stations judge by it
        whether the drone can be armed (QGroundControl MAVLinkEventManager.cc, MAVSDK events_impl.cpp)."""
        self._offered: frozenset[FlightMode] | None = None
        self._sequence = 0
        self._sent: tuple[FlightMode, FlightMode] | None = None
        """Mode and intended mode of the last CURRENT_MODE that announced a change."""

    def requests(self) -> Mapping[int, Request]:
        return {dialect.MAVLINK_MSG_ID_AVAILABLE_MODES: self._available}

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_DO_SET_STANDARD_MODE: Action(
                self._set_standard,
                location=False,
                altitude=Altitude.UNUSED,
                effect=effect_of_mode,
                mode=lambda command: mode_of_standard(command.params[0]),
            )
        }

    def streams(self) -> Mapping[int, MessageStream]:
        return {
            # Both leave at each change, and stations of before 2024, whose dialect lacks them, count them as lost.
            dialect.MAVLINK_MSG_ID_CURRENT_MODE: MessageStream(self._current, every=5.0, flavoured=True),
            dialect.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: MessageStream(self._monitor, every=10.0),
        }

    def link_up(self) -> None:
        self._offered = self.host.vehicle.enterable_modes
        self._intended = self.host.vehicle.mode
        self._sent = None

    def subscriptions(self) -> Subscriptions:
        return {events.GpsLocationChanged: self._on_location}

    def _on_location(self, message: events.Message, now: float) -> None:
        if self._offered is None or FlightMode.FOLLOW not in self._offered:  # the place was unknown
            self.host.look_soon()

    def state_changed(self) -> None:
        self._announce()

    def _announce(self) -> None:
        """CURRENT_MODE once per change; the stream repeats it, rarely."""
        mode = self.host.vehicle.mode
        if not self.host.vehicle.acts_by_itself:
            self._intended = mode
        state = mode, self._intended
        if state != self._sent:
            self._sent = state
            self.host.send_by_flavour(lambda flavour: current_mode(*state, flavour))

    def _current(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        mode = vehicle.mode
        return current_mode(mode, self._intended if vehicle.acts_by_itself else mode, times.flavour)

    def tick(self, now: float) -> float:
        self._announce()
        vehicle = self.host.vehicle
        offered = vehicle.enterable_modes
        if offered != self._offered:
            self._offered = offered
            self._sequence = (self._sequence + 1) % 256
            self.host.send(self._monitor(vehicle, self.host.times()))
        return min(vehicle.position_expires_at(now), vehicle.mode_expires_at(now))

    def _monitor(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        return dialect.MAVLink_available_modes_monitor_message(self._sequence)

    def _available(self, inbound: Inbound, command: Command) -> Answer:
        """param2: which one, counted from 1; 0 or unset: all."""
        modes = available(self.host.vehicle, flavour_of(inbound.channel))
        index = command.params[1]
        if math.isnan(index) or index == 0:
            return modes
        if index not in range(1, len(modes) + 1):
            return dialect.MAV_RESULT_DENIED
        return modes[int(index) - 1]

    async def _set_standard(self, command: Command) -> None:
        """MAV_CMD_DO_SET_STANDARD_MODE: param1 MAV_STANDARD_MODE."""
        await change_mode(self.host.vehicle, command.mode, command.right)

"""Missions of clients: mode, commands, MISSION_CURRENT, MISSION_ITEM_REACHED.

The list itself is `plan_service`'s, how it is flown `vehicle.mission.flight`'s. Conformance A4, B2, C5 and items 49,
72 to 74, 122. Commands: MAVLink common.xml MAV_CMD_MISSION_START, MAV_CMD_DO_SET_MISSION_CURRENT.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Coroutine, Hashable, Mapping
from dataclasses import dataclass
from typing import Any

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import RESEND_WINDOW, Action, Altitude, Command, Effect, effect_of_mode
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.plan.mission_kind import offset
from anafi_mav.services.service import Host, MessageHandler, Service, channel_of
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueSubscriptions
from anafi_mav.vehicle.mission.machine import MAVLINK_STATES, State
from anafi_mav.vehicle.mission.record import MissionRecord
from anafi_mav.vehicle.vehicle import Vehicle

NO_TOTAL = 0xFFFF
"""`total` of a MISSION_CURRENT where there is no mission (common.xml)."""

KEEP = -1.0
"""The item of a MAV_CMD_DO_SET_MISSION_CURRENT that changes none."""

SAVE_EVERY = 5.0
"""s between two writings of how far a mission is: enough to know the drone's plan again, easy on a memory card."""

IN_MISSION_MODE, NOT_IN_MISSION_MODE = 1, 2
"""`mission_mode` of MISSION_CURRENT (common.xml)."""

RECORD = "mission"
"""Name of the record in the drone's file."""


@dataclass
class _Choice:
    """One MISSION_SET_CURRENT and what became of it."""

    client: Hashable
    item: int
    chosen: float = -math.inf
    """When the item became the current one; -inf: not yet, or refused."""
    task: asyncio.Task[None] | None = None


class MissionService(Service):
    """The mission of one system."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._flight = host.vehicle.mission
        self._flight.attach(self)
        self._saved = -math.inf
        self._unsaved = False
        self._sent: Mapping[bool, tuple[int, ...]] = {}
        """Value of `_fields` when MISSION_CURRENT last announced a change; empty: the next one is sent in any case."""
        self._sent_item: int | None = None
        self._choice: _Choice | None = None
        """The newest MISSION_SET_CURRENT."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_MISSION_SET_CURRENT: self._set_current}

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_MISSION_START: Action(
                self._start,
                location=False,
                altitude=Altitude.UNUSED,
                effect=effect_of_mode,
                mode=lambda command: FlightMode.MISSION,
            ),
            dialect.MAV_CMD_DO_SET_MISSION_CURRENT: Action(
                self._choose,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.CHANGE,
                still_holds=self._keeps_choice,
            ),
        }

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_MISSION_CURRENT: MessageStream(self._current, every=1.0, flavoured=True)}

    def link_up(self) -> None:
        memory = self.host.memory
        kept = memory.settings.get(RECORD)
        record = MissionRecord.read(kept, self._flight.machine.mission.items)
        if kept is not None and record is None:
            self.host.text(Severity.WARNING, texts.MISSION_RECORD_IGNORED.fill(path=memory.path))
        self._flight.link_up(record)

    def link_down(self) -> None:
        self._sent_item = None
        self._flight.link_down()  # before a client is notified that something has ended: the drone may fly on

    def subscriptions(self) -> Subscriptions:
        return self._flight.subscriptions()

    def value_subscriptions(self) -> ValueSubscriptions:
        return self._flight.value_subscriptions()

    def state_changed(self) -> None:
        self._flight.on_vehicle()
        self.mission_changed()

    def tick(self, now: float) -> float:
        if self._unsaved and now >= self._saved + SAVE_EVERY:
            self._unsaved, self._saved = False, now
            self.host.spawn(self._save())
        return self._saved + SAVE_EVERY if self._unsaved else NEVER

    # Orders.

    async def _start(self, command: Command) -> None:
        """MAV_CMD_MISSION_START: the mission begins or goes on, as by its mode.

        Only the whole of it.
        """
        if any(value not in (0.0, KEEP) and not math.isnan(value) for value in command.params[:2]):
            raise Refused(texts.MISSION, texts.MISSION_PART, lasting=True)
        await self.host.vehicle.set_mode(FlightMode.MISSION, command.right)

    async def _choose(self, command: Command) -> None:
        """MAV_CMD_DO_SET_MISSION_CURRENT: param1 the item or -1; -1 with param2 1 resets."""
        item, restart = command.params[:2]
        flight = self._flight
        await flight.storing.over()
        self._sent = {}
        if not flight.there:
            raise Refused(texts.CURRENT_ITEM, texts.NO_MISSION, lasting=True)
        if math.isinf(item) or (not math.isnan(item) and item != int(item)):
            raise Refused(texts.CURRENT_ITEM, texts.PARAM1_ITEM, lasting=True)
        if math.isnan(item) or item == KEEP:
            if restart == 1.0:
                await flight.reset(command.right)
            return
        await flight.choose(command.right, _ours(int(item), command.client))

    def _keeps_choice(self, command: Command) -> bool:
        """Return False when another item is current than this command has chosen.

        A mission that is flown goes on from it: the same command repeated must not take it back.
        """
        item = command.params[0]
        return math.isnan(item) or item == KEEP or self._holds(_ours(int(item), command.client))

    def _holds(self, item: int) -> bool:
        """Return False when another item is current than was chosen, and the mission is not flown."""
        return self._flight.flying or self._flight.machine.progress.current == item

    def _set_current(self, inbound: Inbound) -> None:
        """MISSION_SET_CURRENT: MISSION_CURRENT answers it, or a text.

        A retransmission restarts nothing: MAVSDK repeats the message until MISSION_CURRENT has its number.
        """
        client, number = inbound.client, inbound.message.seq
        item, choice = _ours(number, client), self._choice
        self._sent = {}
        if choice is not None and (choice.client, choice.item) == (client, item):
            if choice.task is not None and not choice.task.done():
                return
            if self.host.clock.monotonic() - choice.chosen < RESEND_WINDOW and self._holds(item):
                self._confirm(client, number)
                return
        choice = self._choice = _Choice(client, item)
        choice.task = self.host.run_action(
            client, self._carry_out(choice, number, self.host.vehicle.right(client, Extent.COMMANDED))
        )

    async def _carry_out(self, choice: _Choice, number: int, by: Right) -> None:
        await self._flight.choose(by, choice.item)
        choice.chosen = self.host.clock.monotonic()
        self._confirm(choice.client, number)

    def _confirm(self, client: Hashable, number: int) -> None:
        """Answer a choice with its number to its sender, then send all clients the current item.

        The two differ for ArduPilot's home, by which clients mean the first item, and where the drone has passed the
        item already. MAVSDK repeats MISSION_SET_CURRENT at once for each MISSION_CURRENT with another number, without
        end.
        """
        channel, vehicle = channel_of(client), self.host.vehicle
        if channel is not None:
            current, *same = _fields(vehicle, vehicle.mode)[flavour_of(channel).zero_home]
            if current != number:
                self.host.send(dialect.MAVLink_mission_current_message(number, *same), channel)
        self._sent = {}
        self.mission_changed()

    # MISSION_CURRENT and texts.

    def _current(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        return dialect.MAVLink_mission_current_message(*_fields(vehicle, vehicle.mode)[times.flavour.zero_home])

    def mission_changed(self) -> None:
        """Send MISSION_CURRENT to the clients for whom a field has changed.

        For a new item a HEARTBEAT follows. QGroundControl takes an item for flown to when a HEARTBEAT in mode Mission
        follows it (MissionManager::_handleHeartbeat). Without one it offers to resume a mission that is complete.
        """
        vehicle = self.host.vehicle
        current = vehicle.mission.machine.progress.current
        status = vehicle.status if current != self._sent_item else None
        mode, before = vehicle.mode if status is None else status.mode, self._sent
        fields = _fields(vehicle, mode)
        if fields == before:
            return
        self._sent = fields

        def changed(flavour: Flavour) -> dialect.MAVLink_message | None:
            its = fields[flavour.zero_home]
            return None if its == before.get(flavour.zero_home) else dialect.MAVLink_mission_current_message(*its)

        # To all: it answers MISSION_SET_CURRENT, and PX4 and ArduPilot send it whatever its interval is.
        self.host.send_by_flavour(changed, self.host.channels)
        if status is not None and mode is FlightMode.MISSION:
            self.host.send_heartbeat(status)
        self._sent_item = current

    def item_reached(self, item: int) -> None:
        """Send MISSION_ITEM_REACHED."""
        self.host.send_by_flavour(lambda flavour: dialect.MAVLink_mission_item_reached_message(item + offset(flavour)))

    def run_mission(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Run in the background, until the link goes down."""
        return self.host.spawn(work)

    # What outlives the gateway.

    def store_record(self, record: MissionRecord | None) -> None:
        """Store the record for a restarted gateway: at once when the mission is not flown."""
        settings = self.host.memory.settings
        if record is None:
            if settings.pop(RECORD, None) is None:
                return
        else:
            settings[RECORD] = record.written
        self._unsaved = True
        if not self._flight.machine.flying:  # the gateway may be about to end
            self._saved = -math.inf
            self.tick(self.host.clock.monotonic())

    async def _save(self) -> None:
        if (problem := await self.host.memory.save()) is not None:
            self.host.warn_throttled(problem)


def _fields(vehicle: Vehicle, mode: FlightMode) -> Mapping[bool, tuple[int, ...]]:
    """Return the fields of MISSION_CURRENT by `Flavour.zero_home` of its receivers."""
    machine = vehicle.mission.machine
    rest, current = machine.phase.rest, machine.progress.current
    there = rest is not State.NO_MISSION
    in_mission = mode is FlightMode.MISSION and machine.phase.state is not State.PAUSED
    same = (
        len(machine.mission.items) if there else NO_TOTAL,
        MAVLINK_STATES[rest],
        (IN_MISSION_MODE if in_mission else NOT_IN_MISSION_MODE) if there else 0,
        machine.mission.identity,
        vehicle.fence.items.identity,
        vehicle.rally.items.identity,
    )
    # ArduPilot is at home, its item 0, until the mission begins or a client sets another one.
    behind_home = current + 1 if there and not machine.is_untouched else 0
    return {False: (current if there else 0, *same), True: (behind_home, *same)}


def _first_number(client: Hashable) -> int:
    """Return the number that a client gives the first item."""
    channel = client[0] if isinstance(client, tuple) else None
    return offset(flavour_of(channel)) if isinstance(channel, Channel) else 0


def _ours(number: int, client: Hashable) -> int:
    """Return our number of the item that a client calls `number`.

    ArduPilot's home, with which its list begins, maps to the first item.
    """
    first = _first_number(client)
    return max(number - first, 0) if number >= 0 else number

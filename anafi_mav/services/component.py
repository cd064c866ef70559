"""One component of a MAVLink system: its own services, commands, streams and files.

A component answers with its own component id, and has its own history of flight commands. The history of commands to
camera and gimbal is the system's: one component may end what another began. So is everything else that exists once
in a system: drone, vehicle, clock, memory, channels, texts.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Coroutine, Hashable, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

from anafi_mav import texts
from anafi_mav.clock import Clock
from anafi_mav.drone import Drone
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import COMMANDS, Access
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import Batch, Packed
from anafi_mav.mavlink.node import Inbound
from anafi_mav.mavlink.router import EVERY_COMPONENT
from anafi_mav.services.command.command_service import CommandService, RunningActions
from anafi_mav.services.command.operator_need import ACKNOWLEDGEMENTS, need_of, stop_of
from anafi_mav.services.commands import Action, Effect
from anafi_mav.services.definition_link import DefinitionLink
from anafi_mav.services.dropped_inputs import InputStream
from anafi_mav.services.flavours import Flavour, by_flavour
from anafi_mav.services.ftp.ftp_service import FtpService
from anafi_mav.services.gateway_uris import GatewayUris
from anafi_mav.services.memory import Memory
from anafi_mav.services.payload_history import PayloadHistory
from anafi_mav.services.pose import UNKNOWN_POSE, VehiclePose
from anafi_mav.services.service import MessageHandler, Service, count_refusal
from anafi_mav.services.stream import Times
from anafi_mav.services.system_position import PositionOf
from anafi_mav.services.telemetry.message_service import MessageService
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.failsafe_settings import FailsafeLimits
from anafi_mav.vehicle.operator_control import Need
from anafi_mav.vehicle.vehicle import Vehicle, VehicleStatus

logger = logging.getLogger(__name__)

DENIED_EVERY = 5.0
"""s before a channel gets the text about its access again: setpoints arrive many times a second."""

GONE = 30.0
"""s of silence after which a client counts as a new one, for example when restarted."""

MAX_CLIENTS = 64
"""Clients that are remembered; there are a handful."""

NO_CLIENTS = (dialect.MAV_TYPE_CAMERA, dialect.MAV_TYPE_GIMBAL, dialect.MAV_TYPE_ADSB)
"""Types of components that send heartbeats and are no clients: parts of other vehicles."""

BY_MESSAGE = (
    dialect.MAV_CMD_REQUEST_MESSAGE,
    dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
    dialect.MAV_CMD_GET_MESSAGE_INTERVAL,
)
"""Commands that every component has; the message in param1 decides which one owns them."""

BY_AUTOPILOT = (dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,)
"""Messages that every component handles; one to component 0 is the autopilot's."""


class ComponentSystem(Protocol):
    """Interface of a system for its components."""

    sysid: int
    drone: Drone
    vehicle: Vehicle
    clock: Clock
    memory: Memory
    running: RunningActions
    download_folder: Path | None
    uris: GatewayUris
    position_of: PositionOf
    has_picture_pose: bool
    """True when the configuration allows pose from the live video."""
    failsafe_limits: FailsafeLimits
    payload_history: PayloadHistory
    notices: dict[OperatorText, None]

    @property
    def channels(self) -> Sequence[Channel]:
        """The open channels without the muted ones."""

    def owner(self, message: Any) -> Component:
        """Return the component that answers this message to component 0."""

    def send_as(
        self, compid: int, message: dialect.MAVLink_message, to: Channel | Sequence[Channel] | None, *, give_way: bool
    ) -> None:
        """Send as this component to one channel, to some, or to all (None)."""

    def send_batch(self, batch: Batch, to: Sequence[Channel]) -> None:
        """Send messages of streams to some channels."""

    def send_heartbeat(self, status: VehicleStatus | None = None) -> None:
        """Send one more HEARTBEAT of the autopilot to all.

        `status`: that of this moment, where it is known.
        """

    def text(self, severity: Severity, text: OperatorText, to: Channel | None = None) -> None:
        """A STATUSTEXT to all channels, and a line in the log; or to one channel alone."""

    def warn_throttled(self, text: OperatorText) -> None:
        """Send a warning on a frequent event."""

    def drop_input(self, client: Hashable, stream: InputStream, reason: OperatorText) -> None:
        """Note that an input of a stream is not flown."""

    def use_input(self, client: Hashable, stream: InputStream) -> None:
        """Note that an input of a stream is flown."""

    def spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Run in the background; cancelled when the drone's link goes down."""

    def look_soon(self) -> None:
        """Have the services tick soon."""

    def times(self, at: float | None = None, pose: VehiclePose = UNKNOWN_POSE) -> Times:
        """A moment of the monotonic clock (None: now) in the clock of this system's messages."""

    def set_muted(self, channel: Channel, *, muted: bool) -> None:
        """Send only answers on this channel; with False everything again."""


class Component:
    """One component of a system; the `Host` of its services."""

    __slots__ = (
        "_clients",
        "_denials",
        "_denied_at",
        "_ftp",
        "_handlers",
        "_receiving",
        "_system",
        "camera_flags",
        "capabilities",
        "clock",
        "commands",
        "compid",
        "definition",
        "download_folder",
        "drone",
        "drop_input",
        "end_others",
        "failsafe_limits",
        "has_picture_pose",
        "look_soon",
        "mark_updated",
        "memory",
        "messages",
        "notices",
        "own_commands",
        "payload_history",
        "position_of",
        "run_action",
        "send_heartbeat",
        "services",
        "set_muted",
        "show_picture",
        "spawn",
        "sysid",
        "telemetry",
        "text",
        "times",
        "uris",
        "use_input",
        "vehicle",
        "warn_throttled",
    )
    # Beyond 30 attributes Python gives each object a table of its own, of 1600 bytes.

    def __init__(self, system: ComponentSystem, compid: int, services: Iterable[type[Service]]) -> None:
        self.compid = compid
        self.sysid = system.sysid
        self.drone = system.drone
        self.vehicle = system.vehicle
        self.clock = system.clock
        self.memory = system.memory
        self.download_folder = system.download_folder
        self.uris = system.uris
        self.position_of = system.position_of
        self.has_picture_pose = system.has_picture_pose
        self.failsafe_limits = system.failsafe_limits
        self.payload_history = system.payload_history
        self.notices = system.notices
        self.definition = DefinitionLink()
        self._system = system
        # The system's part of `Host`, without a method here for each.
        self.text = system.text
        self.warn_throttled = system.warn_throttled
        self.drop_input = system.drop_input
        self.use_input = system.use_input
        self.send_heartbeat = system.send_heartbeat
        self.spawn = system.spawn
        self.look_soon = system.look_soon
        self.times = system.times
        self.set_muted = system.set_muted
        self.commands = CommandService(self, system.running)
        self.run_action = self.commands.run
        self.end_others = self.commands.end_others
        self.messages = MessageService(self)
        self.show_picture = self.messages.show_picture
        self.mark_updated = self.messages.mark_updated
        self._ftp = FtpService(self)
        self.services: list[Service] = [self.commands, self.messages, self._ftp]
        self.services += [kind(self) for kind in services]
        self.capabilities: int = 0
        self.camera_flags: int = 0
        for service in self.services:
            self.capabilities |= service.capabilities()
            self.camera_flags |= service.camera_flags()
        self.telemetry: frozenset[int] = frozenset()
        """Messages that the next one of their kind replaces: a full channel drops them rather than answers."""
        self._handlers: dict[int, MessageHandler] = {}
        self._denials: dict[int, MessageHandler] = {}
        self._denied_at: dict[Channel, float] = {}
        """When a channel last got the text about its access."""
        self._clients: dict[Hashable, tuple[float, Channel]] = {}
        """Client -> when its last message arrived, and where."""
        self.own_commands: frozenset[int] = frozenset()
        """The commands of this component's services."""
        self._receiving = [service for service in self.services if type(service).received is not Service.received]

    def take_tables(self, others: Mapping[int, Action]) -> None:
        """Join the tables of all services.

        `others`: actions that this component answers for others. Raises `ValueError` when two services claim the same.
        """
        streams = joined(service.streams() for service in self.services)
        self.telemetry = _shared(frozenset({*streams, dialect.MAVLINK_MSG_ID_HEARTBEAT}))
        self.messages.take_tables(streams, joined(service.requests() for service in self.services))
        queries = joined(service.queries() for service in self.services)
        actions = joined(service.actions() for service in self.services)
        self.own_commands = _shared(frozenset({*queries, *actions}))
        self.commands.take_tables(queries, joined([actions, others]))
        self._ftp.take_tables(
            joined(service.files() for service in self.services),
            joined(service.folders() for service in self.services),
        )
        self._handlers = chained(service.messages() for service in self.services)
        self._handlers[dialect.MAVLINK_MSG_ID_HEARTBEAT] = self._heard
        self._denials = joined(service.denials() for service in self.services)

    def owns(self, message: Any) -> bool:
        """True for a COMMAND_LONG or COMMAND_INT that is this component's own."""
        if message.command in BY_MESSAGE:
            return self.messages.has(message.param1)
        return message.command in self.own_commands

    # Host.

    @property
    def channels(self) -> Sequence[Channel]:
        """The open channels without the muted ones."""
        return self._system.channels

    def send(self, message: dialect.MAVLink_message, to: Channel | Sequence[Channel] | None = None) -> None:
        """Send as this component to one channel, to some, or to all but those where it is off.

        Nothing is sent while the link is down.
        """
        id = type(message).id
        is_streamed = id in self.telemetry
        if to is None and is_streamed:
            to = self.messages.intervals.without_off(self._system.channels, id)
        self._system.send_as(self.compid, message, to, give_way=is_streamed)

    def send_streams(self, messages: Sequence[Packed], to: Sequence[Channel]) -> None:
        """Send messages of streams as this component, together, to channels that have these streams.

        Nothing is sent while the link is down.
        """
        self._system.send_batch(Batch(messages, self.sysid, self.compid), to)

    def send_by_flavour(
        self, build: Callable[[Flavour], dialect.MAVLink_message | None], to: Sequence[Channel] | None = None
    ) -> None:
        """Send to each of these channels the message that `build` makes for its flavour.

        None: all that have not switched the message off. If `build` returns None, nothing is sent.
        """
        for flavour, channels in by_flavour(self._system.channels if to is None else to):
            message = build(flavour)
            if message is not None:
                id = type(message).id
                its = channels if to is not None else self.messages.intervals.without_off(channels, id)
                self._system.send_as(self.compid, message, its, give_way=id in self.telemetry)

    @property
    def replaced_by_order(self) -> bool:
        """True in an action that a newer order of a client has ended."""
        return self.commands.replaced_by_order

    @property
    def needs_pictures(self) -> bool:
        """True while a client requests pose more often than events are reported."""
        return self.messages.needs_pictures

    @property
    def needs_video(self) -> bool:
        """True while a client has a stream whose fields are in the live video only."""
        return self.messages.needs_video

    # What clients send.

    def heard_channels(self) -> list[Channel]:
        """Return the channels on which a client has been heard that is not gone."""
        now = self.clock.monotonic()
        return [channel for heard, channel in self._clients.values() if now - heard <= GONE]

    def channel_closed(self, channel: Channel) -> None:
        """Forget the clients of a channel that is gone."""
        self._clients = {client: known for client, known in self._clients.items() if known[1] is not channel}
        self._denied_at.pop(channel, None)
        for service in self.services:
            service.channel_closed(channel)

    def receive(self, inbound: Inbound) -> None:
        """Handle a message to this component, to its system, or to all."""
        message, id, operators = inbound.message, inbound.id, self.vehicle.operators
        handler = self._handlers.get(id)
        if handler is None:
            return
        if id != dialect.MAVLINK_MSG_ID_HEARTBEAT:
            self.look_soon()
        try:
            if getattr(message, "target_system", 0) == self.sysid:
                self._note(inbound)
                if operators.operator or inbound.channel.options.operator_control:
                    for service in self._receiving:
                        service.received(inbound)
            if id in COMMANDS or id in BY_AUTOPILOT:
                to_all = message.target_component == EVERY_COMPONENT
                if to_all and self._system.owner(message) is not self:
                    return
            if not inbound.is_permitted:
                self._deny(inbound)
            elif operators.operator not in (0, inbound.sysid) and (reason := self._objection(inbound)) is not None:
                self._refuse(inbound, reason)
            elif inbound.is_late and not self._may_be_late(inbound):
                self._answer_refused(inbound, dialect.MAV_RESULT_TEMPORARILY_REJECTED, texts.COMMAND_LATE)
                self.text(Severity.WARNING, texts.COMMAND_LATE, inbound.channel)
            else:
                handler(inbound)
        except AnafiMavError as error:  # the drone's link may just have died
            logger.debug("%s: %s not handled: %s", self.drone.name, message.get_type(), error)
        except Exception:
            logger.exception("%s: %s not handled", self.drone.name, message.get_type())

    def _note(self, inbound: Inbound) -> None:
        """Note a message of a client, and call the services that greet new ones."""
        client, channel = inbound.client, inbound.channel
        last = self._clients.pop(client, None)
        self._clients[client] = inbound.now, channel
        if len(self._clients) > MAX_CLIENTS:
            del self._clients[next(iter(self._clients))]
        if last is None or inbound.now - last[0] > GONE:
            for service in self.services:
                service.client_appeared(channel, inbound.now)

    def _heard(self, inbound: Inbound) -> None:
        beat = inbound.message
        if beat.autopilot == dialect.MAV_AUTOPILOT_INVALID and beat.type not in NO_CLIENTS:
            self._note(inbound)
        if inbound.channel.access is not Access.OBSERVE:
            for service in self.services:
                service.heartbeat(inbound)

    def _objection(self, inbound: Inbound) -> OperatorText | None:
        """Return the reason for which a message has no effect while another station is the operator."""
        return self.vehicle.operators.objection(inbound.sysid, need_of(inbound, self.commands.action_of))

    def _may_be_late(self, inbound: Inbound) -> bool:
        """Return True for a query and a stop of the flight, but not for cut motors.

        A person must always be able to stop the drone. Motors are cut for what is seen at that moment.
        """
        effect = stop_of(inbound, self.commands.action_of)
        if effect is not None:
            return effect is not Effect.KILL
        return inbound.id in COMMANDS and self.commands.action_of(inbound) is None

    def change_objection(self, inbound: Inbound) -> OperatorText | None:
        """Return the reason for which a change that takes effect now is refused, and count it.

        None: it may be made.
        """
        reason = self.vehicle.operators.objection(inbound.sysid, Need.COMMAND)
        if reason is not None:
            count_refusal(inbound)
            self.drop_input(inbound.client, InputStream.CHANGE, reason)
        return reason

    def _refuse(self, inbound: Inbound, reason: OperatorText) -> None:
        """Answer and count a message of a station without the role that it needs; it has no effect."""
        count_refusal(inbound)
        self._answer_refused(inbound, dialect.MAV_RESULT_NOT_IN_CONTROL, reason)
        self.drop_input(inbound.client, InputStream.CHANGE, reason)

    def _answer_refused(self, inbound: Inbound, result: int, reason: str = "") -> None:
        """Answer a message without effect, as its sender expects it; `result`: of a command."""
        id = inbound.id
        if id in COMMANDS:
            self.commands.refuse(inbound, result, reason)
        elif (answer := self._denials.get(id)) is not None:
            answer(inbound)

    def _deny(self, inbound: Inbound) -> None:
        """Answer a message that the access of its endpoint does not cover; it has no effect."""
        self._answer_refused(inbound, dialect.MAV_RESULT_DENIED)
        if inbound.id in ACKNOWLEDGEMENTS:
            return  # stations send them by themselves
        channel = inbound.channel
        if inbound.now - self._denied_at.get(channel, -math.inf) >= DENIED_EVERY:
            self._denied_at[channel] = inbound.now
            self.text(Severity.WARNING, texts.ACCESS_DENIED.fill(access=channel.options.access), channel)


@lru_cache(maxsize=64)
def _shared(numbers: frozenset[int]) -> frozenset[int]:
    """Return the first set of these ids: components of all drones have the same ones."""
    return numbers


def chained(tables: Iterable[Mapping[int, MessageHandler]]) -> dict[int, MessageHandler]:
    """One table of all services' handlers; a message of several services goes to each of them."""
    claims: dict[int, list[MessageHandler]] = {}
    for table in tables:
        for id, handler in table.items():
            claims.setdefault(id, []).append(handler)
    return {id: handlers[0] if len(handlers) == 1 else _each(handlers) for id, handlers in claims.items()}


def _each(handlers: Sequence[MessageHandler]) -> MessageHandler:
    def handle(inbound: Inbound) -> None:
        for handler in handlers:
            handler(inbound)

    return handle


def joined(tables: Any) -> dict[Any, Any]:
    """One table of all services'. Raises `ValueError` when two services claim the same."""
    result: dict[Any, Any] = {}
    for table in tables:
        if twice := result.keys() & table.keys():
            raise ValueError(f"two services claim {sorted(twice)}")
        result.update(table)
    return result

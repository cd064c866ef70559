"""One MAVLink system: the services of one drone on every channel, from link up to link down.

Messages come in from the node by their addressing, answers go back to the asking channel alone, streams go to
every channel at its own rate. While the drone's link is down the system does not exist: no heartbeat, no answer.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Coroutine, Hashable, Iterator, Sequence
from pathlib import Path
from typing import Any

from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import Drone
from anafi_mav.drone.events import Message
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.mavlink.router import EVERY_COMPONENT
from anafi_mav.services.command.calibration_service import CalibrationService
from anafi_mav.services.command.command_service import CommandService
from anafi_mav.services.command.compass_service import CompassService
from anafi_mav.services.command.guided_service import GuidedService
from anafi_mav.services.command.modes_service import ModesService
from anafi_mav.services.command.orbit_service import OrbitService
from anafi_mav.services.event.event_service import EventService
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.ftp.ftp_service import FtpService
from anafi_mav.services.ftp.log_service import LogService
from anafi_mav.services.ground_station.banner_service import BannerService
from anafi_mav.services.ground_station.identity_service import IdentityService
from anafi_mav.services.ground_station.node_status_service import NodeStatusService
from anafi_mav.services.ground_station.shell_service import ShellService
from anafi_mav.services.ground_station.time_service import TimeService
from anafi_mav.services.ground_station.tune_service import TuneService
from anafi_mav.services.memory import Memory
from anafi_mav.services.monitor import takeoff_point_service
from anafi_mav.services.monitor.aborted_return_service import AbortedReturnService
from anafi_mav.services.monitor.link_loss_service import LinkLossService
from anafi_mav.services.monitor.pilot_service import PilotService
from anafi_mav.services.monitor.roll_sign_service import RollSignService
from anafi_mav.services.monitor.takeoff_point_service import TakeoffPointService
from anafi_mav.services.monitor.warning_service import WarningService
from anafi_mav.services.parameter.parameter_service import ParameterService
from anafi_mav.services.plan.fence_service import FenceService
from anafi_mav.services.plan.mission_service import MissionService
from anafi_mav.services.plan.plan_service import PlanService
from anafi_mav.services.plan.rally_service import RallyService
from anafi_mav.services.service import MessageHandler, Service
from anafi_mav.services.setpoint.follow_service import FollowService
from anafi_mav.services.setpoint.manual_control_service import ManualControlService
from anafi_mav.services.setpoint.offboard_service import OffboardService
from anafi_mav.services.statustext import TextNumbers
from anafi_mav.services.stream import Times
from anafi_mav.services.telemetry.flight_record_service import FlightRecordService
from anafi_mav.services.telemetry.high_latency_service import HighLatencyService
from anafi_mav.services.telemetry.message_service import MessageService
from anafi_mav.services.telemetry.telemetry_service import CHANGES, TelemetryService
from anafi_mav.services.telemetry.video_service import VideoTelemetryService
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.height import TakeoffRecord
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import EventHandler, Subscriptions, in_order
from anafi_mav.vehicle.vehicle import Health, Landed, Vehicle

logger = logging.getLogger(__name__)

SERVICES: tuple[type[Service], ...] = (
    IdentityService,
    ModesService,
    GuidedService,
    CalibrationService,
    CompassService,
    OrbitService,
    TelemetryService,
    ParameterService,
    LinkLossService,
    EventService,
    PlanService,
    MissionService,
    FenceService,
    RallyService,
    RollSignService,
    OffboardService,
    ManualControlService,
    FollowService,
    TimeService,
    BannerService,
    WarningService,
    AbortedReturnService,
    HighLatencyService,
    LogService,
    ShellService,
    TuneService,
    NodeStatusService,
    FlightRecordService,
    TakeoffPointService,
    VideoTelemetryService,
    PilotService,
)
"""Services of a system, beside commands and messages themselves."""

AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1

ABSENT = frozenset({dialect.MAV_COMP_ID_WINCH})
"""Components that no ANAFI has and whose commands are answered all the same: MAVSDK sends DO_WINCH to the winch, waits
for an answer from there and repeats it for seconds. Not a camera or a gimbal: clients take an answer for its presence.
"""

COMMANDS = (dialect.MAVLINK_MSG_ID_COMMAND_LONG, dialect.MAVLINK_MSG_ID_COMMAND_INT)

HEARTBEAT_EVERY = 1.0
"""s (MAVLink heartbeat.md)."""

MISSION_OVER = 0.25
"""s after the end of a mission before a heartbeat says Hold. A return or landing that follows by itself, at the end of
the plan or for a low battery, is reported by then, and stations announce one change of mode instead of two."""

LOOK_EVERY = 0.1
"""s between looks at the other periodic messages; none of them is wanted more often."""

DESCENT_WAIT = 1.5
"""s that a landing or return may take to be confirmed when the gateway ends: it is not withdrawn."""

STATUS_EVERY = 5.0
"""s before the same throttled warning is repeated."""

MAX_WARNINGS = 100
"""Different throttled warnings whose age is remembered."""


class System:
    """The MAVLink side of one drone; the `Host` of its services."""

    def __init__(
        self,
        node: Node,
        drone: Drone,
        sysid: int,
        clock: Clock,
        started: float,
        *,
        allow_kill: bool,
        state: Path | None = None,
    ) -> None:
        self.sysid = sysid
        self.drone = drone
        self.clock = clock
        self.memory = Memory(state)
        self.active = False
        self._node = node
        self._started = started
        self._texts = TextNumbers()
        self._undo: Callable[[], None] | None = None
        self._ticker: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._last_state: tuple[FlightMode, bool, Health, Landed] | None = None
        self._next_heartbeat = 0.0
        self._mission_over = Alarm(self._show_mode)
        """Runs while heartbeats still say Mission."""
        self._warned_at: dict[str, float] = {}
        self._muted: set[Channel] = set()
        self._told: tuple[Sequence[Channel], Sequence[Channel]] = ([], [])
        """The open channels when it was last looked, and those of them that are not muted."""
        self.vehicle = Vehicle(
            drone,
            clock,
            allow_kill=allow_kill,
            text=self.text,
            changed=self._changed,
            end_others=lambda: self._commands.end_others(),
        )
        self._commands: CommandService = CommandService(self)
        self._messages = MessageService(self)
        self._ftp = FtpService(self)
        self.services: list[Service] = [self._commands, self._messages, self._ftp]
        self.services += [kind(self) for kind in SERVICES]
        self.capabilities: int = 0
        for service in self.services:
            self.capabilities |= service.capabilities()
        self._commands.take_tables(
            _joined(service.queries() for service in self.services),
            _joined(service.actions() for service in self.services),
        )
        streams = _joined(service.streams() for service in self.services)
        self._messages.take_tables(streams, _joined(service.requests() for service in self.services))
        self.telemetry: frozenset[int] = frozenset({*streams, dialect.MAVLINK_MSG_ID_HEARTBEAT})
        """Messages that the next one of their kind replaces: a full channel drops them rather than answers."""
        node.add_telemetry(self.telemetry)
        for service in self.services:
            if isinstance(service, PlanService):
                service.take_tables(_joined(service.item_commands() for service in self.services))
        self._ftp.take_tables(_joined(service.files() for service in self.services))
        self._handlers: dict[int, MessageHandler] = _joined(service.messages() for service in self.services)
        self._handlers[dialect.MAVLINK_MSG_ID_HEARTBEAT] = self._heard
        self._receiving = [service for service in self.services if type(service).received is not Service.received]
        self._ticking = [service for service in self.services if type(service).tick is not Service.tick]
        self._subscribed: dict[type[Message], tuple[EventHandler, ...]] = {}
        """The handlers of each kind of event, in the order in which they are called."""

    # Link up, link down.

    def link_up(self) -> None:
        """The drone is connected and has sent all its states: the system appears."""
        self.active = True
        self._undo = self.drone.subscribe(self._on_event)
        self._node.add_host(self.sysid, AUTOPILOT, self._receive)
        for component in ABSENT:
            self._node.add_host(self.sysid, component, self._refuse)
        self._last_state = None
        if (problem := self.memory.load(self.drone.identity.serial)) is not None:
            self.text(Severity.WARNING, problem)
        self.vehicle.link_up(TakeoffRecord.read(self.memory.settings.get(takeoff_point_service.KEY)))
        for service in self.services:
            service.link_up()
        self._subscribed = in_order(self.subscriptions())
        self._changed()
        self._next_heartbeat = self.clock.monotonic() + HEARTBEAT_EVERY
        self._ticker = asyncio.get_running_loop().create_task(self._tick())

    async def settle(self) -> None:
        """End the commands that wait for the drone: the link is lost, but the system still exists."""
        await self._commands.settle()

    def link_down(self) -> None:
        """Notify waiting clients that the link is lost, then make the system silent."""
        if not self.active:
            return
        if self._undo is not None:
            self._undo()
            self._undo = None
        if self._ticker is not None:
            self._ticker.cancel()
        self._mission_over.cancel()
        for service in self.services:
            service.link_down()
        for task in tuple(self._tasks):
            task.cancel()
        self.vehicle.link_down()
        self.active = False
        self._node.remove_hosts(self.sysid)

    async def let_go(self) -> None:
        """Prepare for the end of the gateway: leave a flying drone hovering, returning or landing.

        It returns or lands only where it does that already. Messages of clients must not be received any longer.
        """
        if not self.active:
            return
        if self.vehicle.descends:
            await self._commands.settle(DESCENT_WAIT)
        else:
            await self._commands.end_all()
        await self.vehicle.let_go()

    # Host.

    @property
    def channels(self) -> Sequence[Channel]:
        """The open channels without the muted ones."""
        if not self._muted:
            return self._node.channels
        everybody, told = self._told
        if everybody is not self._node.channels:  # a new list whenever they change
            told = [channel for channel in self._node.channels if channel not in self._muted]
            self._told = (self._node.channels, told)
        return told

    def is_streamed(self, id: int) -> bool:
        """Return True when this message is streamed on some channel."""
        return self._messages.is_streamed(id)

    def mark_updated(self, id: int, at: float) -> None:
        """Send a streamed message for a value that no event reports.

        `at`: when it was true (s, monotonic).
        """
        self._messages.mark_updated(id, at)

    def set_muted(self, channel: Channel, *, muted: bool) -> None:
        """Send only answers on this channel; with False everything again."""
        if muted:
            self._muted.add(channel)
        else:
            self._muted.discard(channel)
        self._told = ([], [])

    def send(self, message: dialect.MAVLink_message, to: Channel | Sequence[Channel] | None = None) -> None:
        """Send as the autopilot to one channel, to some, or to all.

        Nothing is sent while the link is down.
        """
        if self.active:
            channels = self.channels if to is None else to
            give_way = message.id in self.telemetry
            self._node.send(message, sysid=self.sysid, compid=AUTOPILOT, to=channels, give_way=give_way)

    def send_by_flavour(
        self, build: Callable[[Flavour], dialect.MAVLink_message | None], to: Sequence[Channel] | None = None
    ) -> None:
        """Send to each of these channels (None: all) the message that `build` makes for its flavour.

        If `build` returns None, nothing is sent.
        """
        groups: dict[str, tuple[Flavour, list[Channel]]] = {}
        for channel in self.channels if to is None else to:
            flavour = flavour_of(channel)
            groups.setdefault(flavour.name, (flavour, []))[1].append(channel)
        for flavour, channels in groups.values():
            message = build(flavour)
            if message is not None:
                self.send(message, channels)

    def text(self, severity: Severity, text: OperatorText, to: Channel | None = None) -> None:
        """A STATUSTEXT to everybody, and a line in the log; or to one channel alone."""
        if to is None:
            logger.log(
                logging.WARNING if severity <= Severity.WARNING else logging.INFO, "%s: %s", self.drone.name, text
            )
        if self.active:
            for message in self._texts.messages(severity, text):
                self.send(message, to)

    def announce(self, severity: Severity, text: OperatorText) -> None:
        """Send a STATUSTEXT about the drone's link to every client, also while that link is down."""
        for message in self._texts.messages(severity, text):
            self._node.send(message, sysid=self.sysid, compid=AUTOPILOT, to=self.channels)

    def warn_throttled(self, text: OperatorText) -> None:
        """Send a warning on a frequent event, at most every `STATUS_EVERY` seconds.

        Such an event arrives many times a second.
        """
        now = self.clock.monotonic()
        if now - self._warned_at.get(text, -math.inf) < STATUS_EVERY:
            return
        if len(self._warned_at) >= MAX_WARNINGS:
            self._warned_at.clear()
        self._warned_at[text] = now
        self.text(Severity.WARNING, text)

    def spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Run in the background; cancelled when the drone's link goes down."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def run_action(
        self, client: Hashable, work: Coroutine[Any, Any, None], *, is_order: bool = True
    ) -> asyncio.Task[None]:
        """Run an action that a message without COMMAND_ACK asks for."""
        return self._commands.run(client, work, is_order=is_order)

    @property
    def replaced_by_order(self) -> bool:
        """True in an action that a newer order of a client has ended."""
        return self._commands.replaced_by_order

    def times(self, at: float | None = None) -> Times:
        """A moment of the monotonic clock (None: now) in the clock of this system's messages."""
        ns = round(((self.clock.monotonic() if at is None else at) - self._started) * 1e9)
        return Times(ns, ns // 1_000, ns // 1_000_000 & 0xFFFFFFFF)

    # The heart.

    def send_heartbeat(self) -> None:
        """Send one more HEARTBEAT to all."""
        vehicle = self.vehicle
        base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if vehicle.armed:
            base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED
        mode = FlightMode.MISSION if self._mission_over.at is not None else vehicle.mode
        health = vehicle.health.value
        self.send_by_flavour(
            lambda flavour: dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_QUADROTOR, flavour.autopilot, base, flavour.custom_mode(mode), health, 3
            )
        )

    async def _tick(self) -> None:
        next_look = -math.inf
        while True:
            now = self.clock.monotonic()
            if now >= self._next_heartbeat:
                self._next_heartbeat = max(self._next_heartbeat + HEARTBEAT_EVERY, now + HEARTBEAT_EVERY / 2)
                self.send_heartbeat()
            if now >= next_look:
                next_look = now + LOOK_EVERY
                for service in self._ticking:
                    try:
                        service.tick(now)
                    except Exception:  # the heartbeat goes on whatever happens to one service
                        logger.exception("%s: %s failed", self.drone.name, type(service).__name__)
            await asyncio.sleep(max(0.0, min(self._next_heartbeat, next_look) - self.clock.monotonic()))

    # What the drone reports.

    def _on_event(self, message: Message, now: float) -> None:
        for handler in self._subscribed.get(type(message), ()):
            handler(message, now)

    def subscriptions(self) -> Iterator[Subscriptions]:
        """Yield all tables of event handlers, in the sequence in which the handlers are called.

        The vehicle is first, because services read its state. Services follow in their order in `self.services`.
        State messages that leave `on_change` are last, because they contain what the services make of the event.
        """
        yield self.vehicle.subscriptions()
        for service in self.services:
            yield service.subscriptions()
        yield dict.fromkeys(CHANGES, lambda message, now: self._changed(force=True))

    def _changed(self, *, force: bool = False) -> None:
        """Mode, armed state or health may have changed: clients wait for it, so tell them at once.

        The heartbeat is first, but for a disarming: QGroundControl believes a landing of an armed vehicle only
        (Vehicle::_setLanding), so EXTENDED_SYS_STATE and the landing event leave before it.
        """
        if not self.active:
            return
        vehicle, last = self.vehicle, self._last_state
        state = (vehicle.mode, vehicle.armed, vehicle.health, vehicle.landed)
        changed = state != last
        if not changed and not force:
            return
        self._last_state = state
        disarmed = last is not None and last[1] and not vehicle.armed
        if changed:
            self._hold_mode(last)
            if not disarmed:
                self.send_heartbeat()
        for service in self.services:
            service.state_changed()
        if disarmed:
            self.send_heartbeat()

    def _hold_mode(self, last: tuple[FlightMode, bool, Health, Landed] | None) -> None:
        """Keep the mode Mission in HEARTBEAT a little longer after a mission that ended in the air.

        This applies while the drone hovers.
        """
        vehicle = self.vehicle
        hovers = vehicle.armed and vehicle.mode in (FlightMode.HOLD, FlightMode.GUIDED)
        if self._mission_over.at is not None:
            if not hovers:
                self._mission_over.cancel()
        elif hovers and last is not None and last[0] is FlightMode.MISSION:
            self._mission_over.set_in(MISSION_OVER)

    def _show_mode(self) -> None:
        """The mission is over and nothing has followed."""
        if self.active:
            self.send_heartbeat()

    # What clients send.

    def listen(self, on_command: Callable[[Inbound], None] | None) -> None:
        """Call `on_command` with each command to the system while the system does not exist.

        Queries are excluded. None ends this. Commands to any of its components count, but not those to all systems.
        """
        assert not self.active

        def receive(inbound: Inbound) -> None:
            if on_command is not None and self._commands_us(inbound.message):
                on_command(inbound)

        self._node.remove_hosts(self.sysid)
        if on_command is not None:
            self._node.add_host(self.sysid, EVERY_COMPONENT, receive)

    def _commands_us(self, message: Any) -> bool:
        """Return True for a command to this system by its id that is no query."""
        if message.id == dialect.MAVLINK_MSG_ID_SET_MODE:
            return bool(message.target_system == self.sysid)
        known = message.id in COMMANDS and message.target_system == self.sysid
        return known and self._commands.acts_on(message.command)

    def _receive(self, inbound: Inbound) -> None:
        """Handle a message to our autopilot, to its system, or to all."""
        message = inbound.message
        handler = self._handlers.get(message.id)
        if handler is None:
            return
        try:
            if getattr(message, "target_system", 0) == self.sysid:
                for service in self._receiving:
                    service.received(inbound)
            handler(inbound)
        except AnafiMavError as error:  # the drone's link may just have died
            logger.debug("%s: %s not handled: %s", self.drone.name, message.get_type(), error)
        except Exception:
            logger.exception("%s: %s not handled", self.drone.name, message.get_type())

    def _refuse(self, inbound: Inbound) -> None:
        """Answer a command to one of the components in `ABSENT` alone: it is unsupported."""
        message = inbound.message
        if message.id in COMMANDS and message.target_system == self.sysid and message.target_component:
            answer = _unsupported(inbound)
            self._node.send(answer, sysid=self.sysid, compid=message.target_component, to=inbound.channel)

    def _heard(self, inbound: Inbound) -> None:
        for service in self.services:
            service.heartbeat(inbound)

    def channel_closed(self, channel: Channel) -> None:
        """A client's channel is gone."""
        self._muted.discard(channel)
        for service in self.services:
            service.channel_closed(channel)


def _unsupported(inbound: Inbound) -> dialect.MAVLink_command_ack_message:
    return dialect.MAVLink_command_ack_message(
        inbound.message.command,
        dialect.MAV_RESULT_UNSUPPORTED,
        target_system=inbound.sysid,
        target_component=inbound.compid,
    )


def _joined(tables: Any) -> dict[Any, Any]:
    """One table of all services'. Raises `ValueError` when two services claim the same."""
    result: dict[Any, Any] = {}
    for table in tables:
        if twice := result.keys() & table.keys():
            raise ValueError(f"two services claim {sorted(twice)}")
        result.update(table)
    return result

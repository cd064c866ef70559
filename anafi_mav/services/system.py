"""One MAVLink system: the services of one drone on every channel, from link up to link down.

Messages come in from the node by their addressing, answers go back to the asking channel alone, streams go to
every channel at its own rate. While the drone's link is down the system does not exist: no heartbeat, no answer.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

from anafi_mav.clock import Clock
from anafi_mav.drone import Drone, events
from anafi_mav.drone.events import Message
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, NotSupported
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.mavlink.streams import Streams
from anafi_mav.services import identity, plan_lists, telemetry
from anafi_mav.services.actions import ACTIONS, UnsupportedFrame, change_mode
from anafi_mav.services.commands import (
    PROGRESS_AFTER,
    PROGRESS_EVERY,
    Command,
    CommandDesk,
    Execution,
    from_int,
    from_long,
)
from anafi_mav.services.modes import FlightMode, from_px4_custom_mode, px4_custom_mode
from anafi_mav.services.offboard import attitude_setpoint
from anafi_mav.services.parameters import ParameterService, table
from anafi_mav.services.statustext import Severity, TextNumbers
from anafi_mav.services.vehicle import Health, Landed, Refused, Vehicle

logger = logging.getLogger(__name__)

AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1

HEARTBEAT_EVERY = 1.0
"""s (MAVLink heartbeat.md)."""

TICK = 0.05
"""s between looks at the heartbeat, which may be late by no more than a tenth of its second."""

LOOK_EVERY = 0.1
"""s between looks at the other periodic messages; none of them is wanted more often."""

STATUS_EVERY = 5.0
"""s before the same complaint about a setpoint is repeated as text."""

MAX_COMPLAINTS = 100
"""Different complaints whose age is remembered."""

MAX_WRITES = 16
"""PARAM_SETs under way at once: a client writes one after the other, several clients a few."""

_RESULT_BY_ERROR: tuple[tuple[type[AnafiMavError], int], ...] = (
    (UnsupportedFrame, dialect.MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME),
    (NotSupported, dialect.MAV_RESULT_UNSUPPORTED),
    (CommandRejected, dialect.MAV_RESULT_TEMPORARILY_REJECTED),
    (CommandTimeout, dialect.MAV_RESULT_FAILED),
)


@dataclass(frozen=True)
class _Action:
    """Something that changes what the vehicle does, under way."""

    client: Hashable
    answer: tuple[Inbound, Execution] | None
    """Whom to answer; None for SET_MODE, which has no answer."""


def _client(inbound: Inbound) -> Hashable:
    """Who sent this, told apart from everybody else."""
    return (inbound.channel, inbound.sysid, inbound.compid)


class System:
    """The MAVLink side of one drone."""

    def __init__(self, node: Node, drone: Drone, sysid: int, clock: Clock, started: float, *, allow_kill: bool) -> None:
        self.sysid = sysid
        self.drone = drone
        self.active = False
        self._node = node
        self._clock = clock
        self._started = started
        self._allow_kill = allow_kill
        self._streams: Streams[Channel] = Streams()
        self._texts = TextNumbers()
        self._desk = CommandDesk()
        self.vehicle = Vehicle(
            drone,
            clock,
            allow_kill=allow_kill,
            text=self.text,
            changed=self._changed,
            end_others=self._end_other_actions,
        )
        self._parameters = ParameterService(table(self.vehicle, sysid), self.text)
        self._undo: Callable[[], None] | None = None
        self._ticker: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._actions: dict[asyncio.Task[None], _Action] = {}
        """Under way, oldest first."""
        self._last_state: tuple[FlightMode, bool, Health, Landed] | None = None
        self._next_heartbeat = 0.0
        self._complained: dict[str, float] = {}
        self._writes = 0
        self._handlers: dict[int, Callable[[Inbound], None]] = {
            dialect.MAVLINK_MSG_ID_COMMAND_LONG: lambda inbound: self._command(
                inbound, from_long(inbound.message, _client(inbound))
            ),
            dialect.MAVLINK_MSG_ID_COMMAND_INT: lambda inbound: self._command(
                inbound, from_int(inbound.message, _client(inbound))
            ),
            dialect.MAVLINK_MSG_ID_SET_MODE: self._set_mode,
            dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: self._set_attitude_target,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._param_list,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._param_read,
            dialect.MAVLINK_MSG_ID_PARAM_SET: self._param_set,
            dialect.MAVLINK_MSG_ID_PING: self._ping,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._timesync,
            **dict.fromkeys(
                (
                    dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
                    dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
                    dialect.MAVLINK_MSG_ID_MISSION_COUNT,
                    dialect.MAVLINK_MSG_ID_MISSION_REQUEST,
                    dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
                    dialect.MAVLINK_MSG_ID_MISSION_ITEM,
                    dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT,
                    dialect.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST,
                ),
                self._plan_list,
            ),
        }
        self._queries: dict[int, Callable[[Inbound, Command], int]] = {
            dialect.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            dialect.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_message_interval,
            dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._legacy_request(
                dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            ),
            dialect.MAV_CMD_REQUEST_PROTOCOL_VERSION: self._legacy_request(dialect.MAVLINK_MSG_ID_PROTOCOL_VERSION),
            dialect.MAV_CMD_GET_HOME_POSITION: self._legacy_request(dialect.MAVLINK_MSG_ID_HOME_POSITION),
        }

    # Link up, link down.

    def link_up(self) -> None:
        """The drone is connected and has sent all its states: the system appears."""
        self.active = True
        self._undo = self.drone.subscribe(self._on_event)
        self._node.own(self.sysid)
        self.vehicle.on_flying_state()
        self.vehicle.on_position()
        self._last_state = None
        self._changed()
        self._next_heartbeat = self._clock.monotonic() + HEARTBEAT_EVERY
        self._ticker = asyncio.get_running_loop().create_task(self._tick())
        product = self.drone.identity
        self.text(Severity.INFO, f"{product.model.title} {product.serial} firmware {product.firmware}")

    def link_down(self) -> None:
        """The link is gone: whoever waits is told, then the system is silent."""
        if not self.active:
            return
        if self._undo is not None:
            self._undo()
            self._undo = None
        if self._ticker is not None:
            self._ticker.cancel()
        for action in tuple(self._actions.values()):
            if action.answer is not None:
                self._finish(*action.answer, dialect.MAV_RESULT_FAILED)
        for task in tuple(self._tasks):
            task.cancel()
        self.vehicle.link_down()
        self._desk.forget()
        self.active = False
        self._node.disown(self.sysid)

    async def let_go(self) -> None:
        """The gateway ends: nothing of ours goes on, a flying drone is left hovering. Clients must not be heard."""
        if not self.active:
            return
        for task in tuple(self._actions):
            task.cancel()
        if self._actions:
            await asyncio.wait(tuple(self._actions))
        await self.vehicle.let_go()

    # Sending.

    def text(self, severity: Severity, text: str) -> None:
        """A STATUSTEXT to everybody, and a line in the log."""
        logger.log(logging.WARNING if severity <= Severity.WARNING else logging.INFO, "%s: %s", self.sysid, text)
        if self.active:
            for message in self._texts.messages(severity, text):
                self._send(message)

    def _send(self, message: dialect.MAVLink_message, to: Channel | list[Channel] | None = None) -> None:
        if self.active:
            self._node.send(message, sysid=self.sysid, compid=AUTOPILOT, to=to)

    def _times(self) -> telemetry.Times:
        # An uint32 that wraps after 49.7 days, as on every autopilot.
        return telemetry.Times(round((self._clock.monotonic() - self._started) * 1000) & 0xFFFFFFFF)

    def _build(self, id: int) -> dialect.MAVLink_message | None:
        return telemetry.STREAMS[id].build(self.vehicle, self._times())

    def _stream(self, id: int, now: float) -> None:
        """Send a stream message to each channel on which it is due."""
        due = self._streams.due_on(self._node.channels, id, now)
        if not due:
            return
        try:
            message = self._build(id)
            if message is not None:
                self._send(message, due)
        except Exception as error:
            # A value of the drone's that nobody foresaw. The other messages, and the heartbeat, go on without it.
            self._log_rarely(f"message {id} of system {self.sysid} cannot be made: {error!r}")

    def _heartbeat(self) -> None:
        vehicle = self.vehicle
        base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if vehicle.armed:
            base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED
        self._send(
            dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_QUADROTOR,
                dialect.MAV_AUTOPILOT_PX4,
                base,
                px4_custom_mode(vehicle.mode),
                vehicle.health.value,
                3,
            )
        )

    async def _tick(self) -> None:
        periodic = [id for id, stream in telemetry.STREAMS.items() if not stream.news]
        next_look = -math.inf
        while True:
            now = self._clock.monotonic()
            if now >= self._next_heartbeat:
                self._next_heartbeat = max(self._next_heartbeat + HEARTBEAT_EVERY, now + HEARTBEAT_EVERY / 2)
                self._heartbeat()
            if now >= next_look:
                next_look = now + LOOK_EVERY
                for id in periodic:
                    self._stream(id, now)
            await asyncio.sleep(TICK)

    # What the drone reports.

    def _on_event(self, message: Message, now: float) -> None:
        kind = type(message)
        if kind is events.FlyingStateChanged:
            self.vehicle.on_flying_state()
        elif kind is events.GpsLocationChanged or kind is events.FlightId:
            self.vehicle.on_position()
        elif kind is events.AttitudeChanged:
            self.vehicle.on_attitude()
        elif kind is events.ReturnStateChanged:
            self.vehicle.on_return()
        for id in telemetry.BY_NEWS.get(kind, ()):
            self._stream(id, now)
        if kind in telemetry.CHANGES:
            self._changed(force=True)

    def _changed(self, *, force: bool = False) -> None:
        """Mode, armed state or health may have changed: clients wait for it, so tell them at once."""
        if not self.active:
            return
        vehicle = self.vehicle
        state = (vehicle.mode, vehicle.armed, vehicle.health, vehicle.landed)
        if state != self._last_state:
            self._last_state = state
            self._heartbeat()
        elif not force:
            return
        for id, stream in telemetry.STREAMS.items():
            if stream.on_change:
                try:
                    message = self._build(id)
                    if message is not None:
                        self._send(message)
                except Exception as error:
                    self._log_rarely(f"message {id} of system {self.sysid} cannot be made: {error!r}")

    # What clients send.

    def receive(self, inbound: Inbound) -> None:
        """A message from a client. Not addressed to our autopilot: not for us, and never answered."""
        if not self.active:
            return
        message = inbound.message
        handler = self._handlers.get(message.get_msgId())
        if handler is None or getattr(message, "target_system", 0) not in (0, self.sysid):
            return
        if getattr(message, "target_component", 0) not in (0, AUTOPILOT):
            return
        handler(inbound)

    def _command(self, inbound: Inbound, command: Command) -> None:
        query = self._queries.get(command.id)
        if query is not None:
            result = dialect.MAV_RESULT_FAILED
            try:
                result = query(inbound, command)
            finally:  # whatever went wrong, the client learns that it did
                self._acknowledge(inbound, command.id, result)
            return
        if command.id not in ACTIONS:
            self._acknowledge(inbound, command.id, dialect.MAV_RESULT_UNSUPPORTED)
            return
        repeated = self._desk.retransmission(command.client, command, self._clock.monotonic())
        if repeated is not None:
            self._acknowledge(inbound, command.id, repeated)
            return
        execution = self._desk.begin(command.client, command)
        self._spawn_action(self._execute(inbound, execution), _Action(command.client, (inbound, execution)))

    async def _execute(self, inbound: Inbound, execution: Execution) -> None:
        command = execution.command
        progress = self._spawn(self._report_progress(inbound, command.id))
        result = dialect.MAV_RESULT_FAILED
        try:
            await ACTIONS[command.id](self.vehicle, command)
            result = dialect.MAV_RESULT_ACCEPTED
        except AnafiMavError as error:
            result = self._explain(error)
        except asyncio.CancelledError:
            result = dialect.MAV_RESULT_CANCELLED
            raise
        except Exception:
            logger.exception("command %d of system %d", command.id, self.sysid)
        finally:
            progress.cancel()
            self._finish(inbound, execution, result)

    def _finish(self, inbound: Inbound, execution: Execution, result: int) -> None:
        """The one final acknowledgement of an action."""
        if execution.result == dialect.MAV_RESULT_IN_PROGRESS:
            execution.result, execution.ended = result, self._clock.monotonic()
            self._acknowledge(inbound, execution.command.id, result)

    def _end_other_actions(self) -> list[asyncio.Task[None]]:
        """What begins now replaces what was under way; whoever waits for that learns that it was cancelled.

        A newer action than this one goes on: it has come to replace this one.
        """
        current = asyncio.current_task()
        others = list(itertools.takewhile(lambda task: task is not current, self._actions))
        for task in others:
            task.cancel()
        action = None if current is None else self._actions.get(current)
        self._desk.supersede(None if action is None else action.client)
        return others

    def _spawn_action(self, work: Any, action: _Action) -> None:
        task = self._spawn(work)
        self._actions[task] = action
        task.add_done_callback(self._action_done)

    def _action_done(self, task: asyncio.Task[None]) -> None:
        action = self._actions.pop(task, None)
        if action is not None and action.answer is not None:
            # It has answered by itself, unless it was cancelled before it began.
            self._finish(*action.answer, dialect.MAV_RESULT_CANCELLED)

    def _explain(self, error: AnafiMavError) -> int:
        """Tell everybody why something was refused; the MAV_RESULT that says so."""
        critical = isinstance(error, Refused) and error.critical
        self.text(Severity.CRITICAL if critical else Severity.WARNING, str(error))
        for kind, result in _RESULT_BY_ERROR:
            if isinstance(error, kind):
                return result
        if isinstance(error, Refused):
            return dialect.MAV_RESULT_DENIED if error.lasting else dialect.MAV_RESULT_TEMPORARILY_REJECTED
        return dialect.MAV_RESULT_FAILED

    async def _report_progress(self, inbound: Inbound, command: int) -> None:
        await asyncio.sleep(PROGRESS_AFTER)
        while True:
            self._acknowledge(inbound, command, dialect.MAV_RESULT_IN_PROGRESS)
            await asyncio.sleep(PROGRESS_EVERY)

    def _acknowledge(self, inbound: Inbound, command: int, result: int) -> None:
        self._send(
            dialect.MAVLink_command_ack_message(
                command, result, 255, 0, target_system=inbound.sysid, target_component=inbound.compid
            ),
            inbound.channel,
        )

    def _spawn(self, work: Any) -> asyncio.Task[None]:
        task: asyncio.Task[None] = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _set_mode(self, inbound: Inbound) -> None:
        """SET_MODE has no acknowledgement: the heartbeat shows the mode, a text the refusal."""
        client = _client(inbound)
        self._desk.forget(client)
        mode = from_px4_custom_mode(inbound.message.custom_mode)
        self._spawn_action(self._change_mode(mode, client), _Action(client, None))

    async def _change_mode(self, mode: FlightMode | None, client: Hashable) -> None:
        try:
            await change_mode(self.vehicle, mode, client)
        except AnafiMavError as error:
            self._explain(error)

    def _set_attitude_target(self, inbound: Inbound) -> None:
        setpoint = attitude_setpoint(inbound.message)
        if isinstance(setpoint, str):
            self._complain(f"Setpoint refused: {setpoint}")
        elif not self.vehicle.setpoint(_client(inbound), setpoint):
            self._complain("Setpoints refused: another program flies")

    def _complain(self, text: str) -> None:
        """A text about something that arrives many times a second."""
        if self._is_news(text):
            self.text(Severity.WARNING, text)

    def _log_rarely(self, text: str) -> None:
        if self._is_news(text):
            logger.error("%s", text)

    def _is_news(self, text: str) -> bool:
        """It was not said within the last `STATUS_EVERY` seconds."""
        now = self._clock.monotonic()
        if now - self._complained.get(text, -math.inf) < STATUS_EVERY:
            return False
        if len(self._complained) >= MAX_COMPLAINTS:
            self._complained.clear()
        self._complained[text] = now
        return True

    # Queries: answered at once, every time.

    def _request_message(self, inbound: Inbound, command: Command) -> int:
        message = self._requested(command.params[0])
        if isinstance(message, int):
            return message
        self._send(message, inbound.channel)
        return dialect.MAV_RESULT_ACCEPTED

    def _requested(self, id: float) -> dialect.MAVLink_message | int:
        """The message that a client asks for, or the MAV_RESULT that says why not."""
        if id == dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return identity.autopilot_version(self.drone, allow_kill=self._allow_kill)
        if id == dialect.MAVLINK_MSG_ID_PROTOCOL_VERSION:
            return identity.protocol_version()
        if id in telemetry.STREAMS:
            message = self._build(int(id))
            return dialect.MAV_RESULT_TEMPORARILY_REJECTED if message is None else message
        return dialect.MAV_RESULT_UNSUPPORTED

    def _legacy_request(self, id: int) -> Callable[[Inbound, Command], int]:
        def request(inbound: Inbound, command: Command) -> int:
            message = self._requested(id)
            if isinstance(message, int):
                return message
            self._send(message, inbound.channel)
            return dialect.MAV_RESULT_ACCEPTED

        return request

    def _set_message_interval(self, inbound: Inbound, command: Command) -> int:
        id, interval = command.params[0], command.params[1]
        if id not in telemetry.STREAMS:
            return dialect.MAV_RESULT_UNSUPPORTED
        if math.isinf(interval) or interval < -1:
            return dialect.MAV_RESULT_DENIED
        if math.isnan(interval) or interval == 0:
            self._streams.reset(inbound.channel, int(id))
        else:
            # An interval is told as an INT32 of microseconds: a longer one is as long as that can say.
            self._streams.set(inbound.channel, int(id), None if interval < 0 else min(interval, 2**31 - 1) / 1e6)
        return dialect.MAV_RESULT_ACCEPTED

    def _get_message_interval(self, inbound: Inbound, command: Command) -> int:
        id = command.params[0]
        if not 0 <= id <= 0xFFFF:
            return dialect.MAV_RESULT_DENIED
        microseconds = 0
        if id in telemetry.STREAMS:
            interval = self._streams.interval(inbound.channel, int(id))
            microseconds = -1 if interval is None else round(interval * 1e6)
        self._send(dialect.MAVLink_message_interval_message(int(id), microseconds), inbound.channel)
        return dialect.MAV_RESULT_ACCEPTED

    def _param_list(self, inbound: Inbound) -> None:
        for message in self._parameters.all_values():
            self._send(message, inbound.channel)

    def _param_read(self, inbound: Inbound) -> None:
        self._send(self._parameters.read(inbound.message, inbound.sysid, inbound.compid), inbound.channel)

    def _param_set(self, inbound: Inbound) -> None:
        if self._writes < MAX_WRITES:  # otherwise the client says it again
            self._writes += 1
            self._spawn(self._write_param(inbound))

    async def _write_param(self, inbound: Inbound) -> None:
        try:
            answers, changed = await self._parameters.write(inbound.message, inbound.sysid, inbound.compid)
        finally:
            self._writes -= 1
        for message in answers:
            self._send(message, None if changed else inbound.channel)

    def _plan_list(self, inbound: Inbound) -> None:
        for message in plan_lists.answer(inbound.message, inbound.sysid, inbound.compid):
            self._send(message, inbound.channel)

    def _ping(self, inbound: Inbound) -> None:
        ping = inbound.message
        if ping.target_system == 0 and ping.target_component == 0:  # otherwise it is somebody's answer
            self._send(
                dialect.MAVLink_ping_message(ping.time_usec, ping.seq, inbound.sysid, inbound.compid), inbound.channel
            )

    def _timesync(self, inbound: Inbound) -> None:
        if inbound.message.tc1 == 0:
            now = round((self._clock.monotonic() - self._started) * 1e9)
            self._send(
                dialect.MAVLink_timesync_message(now, inbound.message.ts1, inbound.sysid, inbound.compid),
                inbound.channel,
            )

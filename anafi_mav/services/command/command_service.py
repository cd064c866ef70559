"""The command protocol's service: runs commands, informs their senders, ends replaced ones.

The aircraft, the camera and its zoom exist once, whichever component a command is addressed to: an action of the camera
component that moves the aircraft ends older flight commands to the autopilot, and newer ones end it.

The table of actions holds the meaning of a command; `CommandHistory` knows whether it is a new one (both without I/O).
Rules: conformance R5-R10, C2, MAVLink command.md.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine, Hashable, Mapping
from functools import partial
from typing import Any

from msgspec.structs import replace

from anafi_mav import texts
from anafi_mav.clock import Alarm
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, NotSupported
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import (
    IN_ORDER,
    LATE_PROGRESS_AFTER,
    PROGRESS_AFTER,
    PROGRESS_EVERY,
    QUERY,
    Action,
    ActionGroup,
    Command,
    CommandHistory,
    CommandLog,
    CommandRefusal,
    Definition,
    Effect,
    Execution,
    ProgressPolicy,
    from_int,
    from_long,
)
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.service import Host, MessageHandler, Query, Service, channel_of
from anafi_mav.vehicle.base.bounds import UnsupportedFrame
from anafi_mav.vehicle.base.flight_task import FlightAction, FlightActions
from anafi_mav.vehicle.base.refusal import NotInControl, Refused, Unsupported, text_of
from anafi_mav.vehicle.base.right import Extent
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.operator_control import Need

logger = logging.getLogger(__name__)

SETTLE = 0.1
"""s that commands have to end by themselves when the link is lost.

They wait for the drone, whose loss they learn at once.
"""

MAX_WAITING = 32
"""Actions of one group that run one after another: a drone that answers none of them takes seconds for each."""

_Decode = Callable[[Any, Definition, Hashable, Flavour], Command]

_RESULT_BY_ERROR: tuple[tuple[type[AnafiMavError], int], ...] = (
    (UnsupportedFrame, dialect.MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME),
    (Unsupported, dialect.MAV_RESULT_UNSUPPORTED),
    (NotSupported, dialect.MAV_RESULT_UNSUPPORTED),
    (NotInControl, dialect.MAV_RESULT_NOT_IN_CONTROL),
    (CommandRejected, dialect.MAV_RESULT_TEMPORARILY_REJECTED),
    (CommandTimeout, dialect.MAV_RESULT_FAILED),
)


class RunningAction(FlightAction, eq=False):
    """A running action that changes the vehicle's state, of a command or another message."""

    answer: tuple[Inbound, Execution] | None = None
    """Client and command to acknowledge; None for messages without acknowledgement."""
    group: ActionGroup = ActionGroup.FLIGHT


class RunningActions:
    """Running actions of one system, and the histories of its components."""

    def __init__(self, actions: FlightActions | None = None) -> None:
        """`actions`: those of the vehicle, whose control ends the ones that fly."""
        self.actions = actions or FlightActions()
        self.actions.on_begun(self.forget)
        self.actions.on_replaced(self._supersede)
        self.histories: list[CommandHistory] = []

    def is_full(self, group: ActionGroup) -> bool:
        """Return True when a group whose actions run in order takes no further one."""
        return group in IN_ORDER and self.actions.count(_of(group)) >= MAX_WAITING

    def end_others(self, group: ActionGroup) -> list[asyncio.Task[None]]:
        """Cancel all actions of a group that are older than the calling one.

        Their senders get CANCELLED.
        """
        if group is ActionGroup.FLIGHT:
            return self.actions.end_older()
        return self.actions.cancel_older(_of(group))

    def _supersede(self, client: Hashable) -> None:
        """Note in all components that an action of this client has replaced those of all others."""
        for history in self.histories:
            history.supersede(client)

    def forget(self, client: Hashable) -> None:
        """Forget this client's newest action of the flight in all components."""
        for history in self.histories:
            history.forget(client)


def _of(group: ActionGroup) -> Callable[[FlightAction], bool]:
    """Return the test for actions of a group."""
    return lambda action: isinstance(action, RunningAction) and action.group is group


class CommandService(Service):
    """COMMAND_LONG, COMMAND_INT and COMMAND_CANCEL of one component."""

    def __init__(self, host: Host, running: RunningActions) -> None:
        """`running`: those of all components of the system."""
        super().__init__(host)
        self._history = CommandHistory()
        self.log = CommandLog()
        """Results, for the status of the gateway."""
        self._all = running
        running.histories.append(self._history)
        self._queries: Mapping[int, Query] = {}
        self._actions: Mapping[int, Action] = {}
        self._running: dict[asyncio.Task[None], RunningAction] = {}
        """Those of this component, oldest first."""

    def take_tables(self, queries: Mapping[int, Query], actions: Mapping[int, Action]) -> None:
        """Register the commands of all services.

        Raises `ValueError` when a row contradicts MAVLink or another row.
        """
        if twice := queries.keys() & actions.keys():
            raise ValueError(f"{sorted(twice)} are both queries and actions")
        for id in queries:
            QUERY.check(id)
        for id, action in actions.items():
            action.check(id)
        self._queries, self._actions = queries, actions

    def acts_on(self, command: int) -> bool:
        """True for a command that changes the vehicle's state, and is no query."""
        return command in self._actions

    def owns(self, command: int) -> bool:
        """True for a command that this component has."""
        return command in self._queries or command in self._actions

    def capabilities(self) -> int:
        return dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_COMMAND_LONG: partial(self._receive, from_long),
            dialect.MAVLINK_MSG_ID_COMMAND_INT: partial(self._receive, from_int),
            dialect.MAVLINK_MSG_ID_COMMAND_CANCEL: self._cancel,
        }

    def refuse(self, inbound: Inbound, result: int, reason: str = "") -> None:
        """Answer a command that has no effect because of its sender."""
        self._acknowledge(inbound, inbound.message.command, result)
        if reason:
            self._note(inbound, inbound.message.command, result, reason)

    def action_of(self, inbound: Inbound) -> Command | None:
        """Decode a command that changes something.

        Returns None for a query, and for a command that this component does not have.
        """
        action = self._actions.get(inbound.message.command)
        if action is None:
            return None
        is_long = inbound.id == dialect.MAVLINK_MSG_ID_COMMAND_LONG
        decode: _Decode = from_long if is_long else from_int
        return decode(inbound.message, action, inbound.client, flavour_of(inbound.channel))

    async def settle(self, limit: float = SETTLE) -> None:
        """Wait until running commands have ended after the link is lost, `limit` s at most.

        A restart, for one, has succeeded then.
        """
        if self._running:
            await asyncio.wait(tuple(self._running), timeout=limit)

    def channel_closed(self, channel: Channel) -> None:
        self._history.forget_clients(lambda client: channel_of(client) is channel)

    def link_down(self) -> None:
        """Send FAILED and a text to each client that waits for an acknowledgement.

        The tasks end with the host's. They wait for something else than the drone, whose loss has ended the others: a
        start of a mission that is being stored waits for the disk.
        """
        for running in tuple(self._running.values()):
            if running.answer is not None and running.answer[1].result == dialect.MAV_RESULT_IN_PROGRESS:
                inbound, execution = running.answer
                self.host.text(Severity.WARNING, texts.COMMAND_WITHOUT_DRONE, inbound.channel)
                self._finish(inbound, execution, dialect.MAV_RESULT_FAILED, texts.COMMAND_WITHOUT_DRONE)
        self._history.forget()
        self.host.payload_history.forget()

    async def end_all(self) -> None:
        """Cancel all running actions, and wait for their end."""
        for task in tuple(self._running):
            task.cancel()
        if self._running:
            await asyncio.wait(tuple(self._running))

    def run(
        self,
        client: Hashable,
        work: Coroutine[Any, Any, None],
        *,
        is_order: bool = True,
        group: ActionGroup = ActionGroup.FLIGHT,
    ) -> asyncio.Task[None]:
        """Run an action of a message that has no acknowledgement; its refusal is sent as a text.

        Or the rest of a command that is acknowledged: it calls from its own action.
        """
        if group is ActionGroup.FLIGHT and self._all.actions.current is None:
            self._all.forget(client)  # it used other means than its newest command
        running = RunningAction(client, is_order, flies=group is ActionGroup.FLIGHT, group=group)
        task = self._spawn(self._explained(work), running)
        # Cancelled before it began, `work` would complain that nothing awaited it.
        task.add_done_callback(lambda _: work.close())
        return task

    @property
    def replaced_by_order(self) -> bool:
        """True in an action that a newer order of a client has ended."""
        action = self._all.actions.current
        return action is not None and action.replaced_by_order

    def end_others(self, group: ActionGroup = ActionGroup.FLIGHT) -> list[asyncio.Task[None]]:
        """Cancel all older running actions of a group, of every component.

        Their senders get CANCELLED.
        """
        return self._all.end_others(group)

    def _receive(self, decode: _Decode, inbound: Inbound) -> None:
        id, flavour = inbound.message.command, flavour_of(inbound.channel)
        definition: Definition | None = QUERY if id in self._queries else self._actions.get(id)
        if definition is None or not definition.offered(flavour):
            self._acknowledge(inbound, id, dialect.MAV_RESULT_UNSUPPORTED)
            self._note(inbound, id, dialect.MAV_RESULT_UNSUPPORTED)
            return
        command = decode(inbound.message, definition, inbound.client, flavour)
        if definition is QUERY:
            result = dialect.MAV_RESULT_FAILED
            try:
                result = self._queries[id](inbound, command)
            finally:  # whatever went wrong, the client learns that it did
                self._acknowledge(inbound, id, result)
                self.log.accept(result)  # an answer, whatever it is: clients try messages that an ANAFI does not have
            return
        self._act(inbound, command)

    def _act(self, inbound: Inbound, command: Command) -> None:
        now, effect, vehicle = self.host.clock.monotonic(), command.effect, self.host.vehicle
        # Before it is known whether it is a retransmission: a program that repeats its Hold is to be noticed.
        counted = effect is not Effect.HOLD or vehicle.holds.arrive(command.client, now)
        right = vehicle.right(command.client, Extent.ALL, counted=counted)
        command = replace(command, right=right, component=self.host.compid)
        group = command.group
        flies = group is ActionGroup.FLIGHT
        if flies:
            mode = vehicle.mode if effect is Effect.LAPSING else None
            ended_at = vehicle.flight_facts.landing_ended_at
            repeated = self._history.retransmission(command.client, command, now, mode, ended_at)
        else:
            repeated = self.host.payload_history.retransmission(command, now)
        if repeated is not None:
            quiet = command.progress in (ProgressPolicy.LATE, None)  # IN_PROGRESS is sent later, or not at all
            if not (quiet and repeated == dialect.MAV_RESULT_IN_PROGRESS):
                self._acknowledge(inbound, command.id, repeated)
            return
        if self._all.is_full(group):
            self._acknowledge(inbound, command.id, dialect.MAV_RESULT_TEMPORARILY_REJECTED)
            self._note(inbound, command.id, dialect.MAV_RESULT_TEMPORARILY_REJECTED, "too many commands wait")
            return
        execution = self._history.begin(command.client, command) if flies else self.host.payload_history.begin(command)
        running = RunningAction(command.client, flies=flies, answer=(inbound, execution), group=group)
        self._spawn(self._execute(inbound, execution), running)

    async def _execute(self, inbound: Inbound, execution: Execution) -> None:
        command = execution.command
        policy = command.progress
        if policy is ProgressPolicy.EARLY and self.host.vehicle.takeoff.rises:
            self._acknowledge(inbound, command.id, dialect.MAV_RESULT_IN_PROGRESS)  # it waits for the climb's end

        def report() -> None:
            self._acknowledge(inbound, command.id, dialect.MAV_RESULT_IN_PROGRESS)
            progress.set_in(PROGRESS_EVERY)

        progress = Alarm(report)
        if policy is not None:
            progress.set_in(LATE_PROGRESS_AFTER if policy is ProgressPolicy.LATE else PROGRESS_AFTER)
        result, reason = dialect.MAV_RESULT_FAILED, ""
        try:
            group, handler = command.group, self._actions[command.id].handler
            if group in IN_ORDER:
                async with self.host.payload_history.turn(group):
                    self._require_role(inbound)
                    await handler(command)
            else:
                await handler(command)
            result = dialect.MAV_RESULT_ACCEPTED
        except AnafiMavError as error:
            result, reason = self._explain(error), str(error)
        except asyncio.CancelledError:
            result = dialect.MAV_RESULT_CANCELLED
            raise
        except Exception:
            logger.exception("%s: command %d failed", self.host.drone.name, command.id)
        finally:
            progress.cancel()
            self._finish(inbound, execution, result, reason)

    def _finish(self, inbound: Inbound, execution: Execution, result: int, reason: str = "") -> None:
        """Send the one final acknowledgement of an action."""
        if execution.result == dialect.MAV_RESULT_IN_PROGRESS:
            execution.result, execution.ended = result, self.host.clock.monotonic()
            self._acknowledge(inbound, execution.command.id, result)
            if result == dialect.MAV_RESULT_ACCEPTED:
                self.log.accept(result, execution.ended - inbound.now)
            else:
                self._note(inbound, execution.command.id, result, reason)

    def _note(self, inbound: Inbound, command: int, result: int, reason: str = "") -> None:
        """Note a command that was not accepted."""
        client = inbound.channel.name
        now = self.host.clock.monotonic()
        self.log.refuse(CommandRefusal(now, inbound.sysid, inbound.compid, client, command, result, reason))

    def _require_role(self, inbound: Inbound) -> None:
        """Raise `NotInControl` when another station has become the operator meanwhile."""
        reason = self.host.vehicle.operators.objection(inbound.sysid, Need.COMMAND)
        if reason is not None:
            raise NotInControl(texts.FLIGHT_COMMAND, reason)

    def _spawn(self, work: Coroutine[Any, Any, None], running: RunningAction) -> asyncio.Task[None]:
        task = self.host.spawn(work)
        self._running[task] = running
        self._all.actions.add(task, running)
        task.add_done_callback(self._done)
        return task

    def _done(self, task: asyncio.Task[None]) -> None:
        running = self._running.pop(task, None)
        if running is not None and running.answer is not None:
            # It has answered by itself, unless it was cancelled before it began.
            self._finish(*running.answer, dialect.MAV_RESULT_CANCELLED)

    def _cancel(self, inbound: Inbound) -> None:
        """COMMAND_CANCEL: cancel the sender's running action of that number.

        If the sender has none, any client's is cancelled. The action's sender gets CANCELLED. Without such an action
        nothing is sent (MAVLink command.md). An accepted command is not withdrawn, and an action that cannot honestly
        be cancelled continues to its own acknowledgement. Another client may wait with the same command for the end of
        the sender's: that one continues, also when the sender repeats its COMMAND_CANCEL.
        """
        id, now = inbound.message.command, self.host.clock.monotonic()
        alike = [
            (task, running)
            for task, running in self._running.items()
            if running.answer is not None and running.answer[1].command.id == id
        ]
        own = [(task, running) for task, running in alike if running.client == inbound.client]
        if not own and self._history.was_cancelled(inbound.client, id, now):
            return
        for task, running in own or alike:
            if running.answer is not None and running.answer[1].command.is_revocable:
                task.cancel()
                if running.flies and self.host.vehicle.may_rise:  # the drone may have received it
                    self.host.warn_throttled(texts.CANCEL_MAY_RISE)

    def _explain(self, error: AnafiMavError) -> int:
        """Send the reason of a refusal as a text; return its MAV_RESULT."""
        critical = isinstance(error, Refused) and error.critical
        self.host.text(Severity.CRITICAL if critical else Severity.WARNING, text_of(error))
        for kind, result in _RESULT_BY_ERROR:
            if isinstance(error, kind):
                return result
        if isinstance(error, Refused):
            return dialect.MAV_RESULT_DENIED if error.lasting else dialect.MAV_RESULT_TEMPORARILY_REJECTED
        return dialect.MAV_RESULT_FAILED

    async def _explained(self, work: Coroutine[Any, Any, None]) -> None:
        try:
            await work
        except AnafiMavError as error:
            self._explain(error)

    def _acknowledge(self, inbound: Inbound, command: int, result: int) -> None:
        self.host.send(
            dialect.MAVLink_command_ack_message(
                command, result, 255, 0, target_system=inbound.sysid, target_component=inbound.compid
            ),
            inbound.channel,
        )

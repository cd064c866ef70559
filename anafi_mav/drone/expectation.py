"""Sending a command and waiting for what the drone says about it.

ARSDK has no replies: a command is acknowledged by the transport, and what came of it is an event like any other.
A judge looks at every event of the kinds it is interested in and says: not mine (None), done (any other value), or
refused (an error of ours). Silence is a timeout.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import weakref
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Generic, Protocol, TypeVar

from anafi_mav.arsdk.codec.secret_fields import without_secrets
from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link.transport import Rank
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.drone.sent_commands import AUTOMATIC, QUIET, Event, Phase, SentCommand, SentCommands, Slot
from anafi_mav.errors import (
    AnafiMavError,
    CommandRejected,
    CommandTimeout,
    Disconnected,
    LinkLost,
    LocalProtocolError,
    NotSupported,
)

logger = logging.getLogger(__name__)
message_log = logging.getLogger("anafi_mav.message")

T = TypeVar("T")

BLOCKED = 0
"""The token of a command that the gate kept back; the transport's begin at 1."""

ANSWER_TIMEOUT = 5.0
"""s. A drone answers within tens of milliseconds, over a bad link within a few retransmissions of 150 ms; Parrot's
own SDK waits 10 s, too long for a ground station that repeats its command every second."""


def require_number(timeout: float | None) -> None:
    """Raise `LocalProtocolError` for a timeout of NaN, and for one that no float holds.

    NaN is neither before nor after another time: in asyncio's heap of timers it would hold back those of others, among
    them the one that centres the sticks.
    """
    try:
        if timeout is None or not math.isnan(timeout):
            return
    except OverflowError:
        pass
    raise LocalProtocolError("expected a timeout in s")


def loop_time() -> float:
    """Now, s, on the clock of the running loop: what verbs count their time by."""
    return asyncio.get_running_loop().time()


class Wire(Protocol):
    """Interface that is needed of a session: see `arsdk.session.Session`."""

    on_delivered: Callable[[int, bool], None]

    def send(self, message: Message | UnknownMessage, rank: Rank = Rank.NORMAL, *, at_once: bool = False) -> int: ...

    def cancel(self, token: int) -> None: ...


class Expectation(Generic[T]):
    """One awaited answer.

    It starts to listen when it is made, so make it before the command is sent.
    """

    __slots__ = ("_commander", "_judge", "_timer", "answers", "future", "token")

    def __init__(
        self, commander: Commander, answers: Sequence[type[Message]], judge: Callable[[Any], T | AnafiMavError | None]
    ) -> None:
        self._commander = commander
        self._judge = judge
        self._timer: asyncio.TimerHandle | None = None
        self.answers = answers
        self.future: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        self.token: int | None = None
        """Our command's name in the transport, once it is sent."""

    def offer(self, message: Message) -> None:
        """Let the judge look at an event."""
        if self.future.done():
            return
        try:
            verdict = self._judge(message)
        except Exception as error:  # a caller's predicate; the link must survive it
            self.fail(error)
            return
        if isinstance(verdict, AnafiMavError):
            self.fail(verdict)
        elif verdict is not None:
            self.succeed(verdict)

    def succeed(self, value: T) -> None:
        """End the wait with this result, unless it has ended."""
        if not self.future.done():
            self.future.set_result(value)

    def fail(self, error: Exception) -> None:
        """End the wait with this error, unless it has ended."""
        if not self.future.done():
            self.future.set_exception(error)

    def expire_after(self, seconds: float, what: str) -> None:
        """(Re)start the clock: the wait fails with `CommandTimeout` about `what` after this time.

        Raises `LocalProtocolError` for a time that is not a number, and stops listening.
        """
        try:
            is_number = not math.isnan(seconds)
        except OverflowError:
            is_number = False
        if not is_number:
            self.close()
            raise LocalProtocolError("expected a timeout in s")
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self.future.get_loop().call_later(seconds, self._expire, what, seconds)

    def _expire(self, what: str, seconds: float) -> None:
        self.fail(CommandTimeout(what, seconds))

    async def wait(self) -> T:
        """Return the judge's result.

        Raises what the judge returned, `CommandTimeout` or `LinkLost`. When it fails or is cancelled, the command is
        withdrawn: it must not be carried out after it has been reported as failed.
        """
        try:
            return await self.future
        except BaseException:
            self._commander.cancel(self.token)
            raise
        finally:
            self.close()

    async def wait_or_quiet(self, delivery: asyncio.Future[None], what: str, timeout: float) -> bool:
        """Wait for an answer that may be absent; return True when it was received.

        False when the drone has received the command and then reported nothing. Raises `CommandTimeout` when neither
        is known in time, `LinkLost`.
        """
        self.expire_after(timeout, what)
        either: set[asyncio.Future[Any]] = {self.future, delivery}
        await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
        if not self.future.done():
            delivery.result()  # raises LinkLost
            await asyncio.wait({self.future}, timeout=QUIET)
            if not self.future.done():
                return False
        self.future.result()
        return True

    def close(self) -> None:
        """Stop listening."""
        if self._timer is not None:
            self._timer.cancel()
        self._commander.forget(self)
        if self.future.cancel() or self.future.cancelled():
            return  # an error that it is given later needs no reader
        self.future.exception()  # nothing may wait for it any longer; asyncio would complain


class Commander:
    """Sender of commands to the drone, and registry of the answers that are awaited."""

    def __init__(self) -> None:
        self.name = ""
        """Of the drone, for the log."""
        self._wire: Wire | None = None
        self.on_command: Callable[[Message], None] | None = None
        """Called with each command that is sent."""
        self.gate: Callable[[Message], bool] | None = None
        """Asked before each command; False: it is not sent, as if it were lost on the way. May raise."""
        self._open: set[Expectation[Any]] = set()
        self.waiting: dict[type[Message], list[Expectation[Any]]] = {}
        """Expectations by the kinds of events that they wait for."""
        self._deliveries: dict[int, asyncio.Future[None]] = {}
        self.pending_stops: set[asyncio.Future[None]] = set()
        """Stop commands from any task that the drone may not have received yet."""
        self._retired: weakref.WeakSet[asyncio.Task[Any]] = weakref.WeakSet()
        """Tasks that newer commands have replaced: they send nothing but what stops something."""
        self._silenced: weakref.WeakSet[asyncio.Task[Any]] = weakref.WeakSet()
        """Tasks that send nothing at all."""
        self.sent = SentCommands()

    @property
    def connected(self) -> bool:
        return self._wire is not None

    @property
    def begins(self) -> bool:
        """An automatic flight waits for its confirmation."""
        return bool(self.sent.awaited(*AUTOMATIC))

    @property
    def launches(self) -> bool:
        """A take-off or hand launch waits for its confirmation."""
        return bool(self.sent.awaited(Slot.LAUNCH))

    def require_link(self) -> None:
        """Raise `LinkLost` without a link."""
        if self._wire is None:
            raise Disconnected("not connected")

    def require_feature(self, reported: object, feature: str) -> None:
        """Raise `LinkLost` without a link, `NotSupported` for an absent feature.

        It is absent when `reported`, a state that drones with the feature report, is None or empty.
        """
        self.require_link()
        if reported is None or reported == frozenset() or reported == {}:
            raise NotSupported(feature)

    def attach(self, wire: Wire) -> None:
        """Commands go out here from now on."""
        self._wire = wire
        wire.on_delivered = self._delivered

    def detach(self, reason: str) -> None:
        """The link is gone: every wait ends with `LinkLost`."""
        self._wire = None
        for expectation in tuple(self._open):
            expectation.fail(Disconnected(reason))
        for delivery in self._deliveries.values():
            if not delivery.done():
                delivery.set_exception(Disconnected(reason))
                delivery.exception()  # it may have no waiter; asyncio would complain
        self._deliveries.clear()
        self.sent.abandon(loop_time())

    def retire(self, tasks: Iterable[asyncio.Task[Any]]) -> None:
        """From now on let these tasks send only commands that stop something.

        Other commands of theirs must not collide with those of the tasks that replaced them.
        """
        self._retired.update(tasks)

    def silence(self, tasks: Iterable[asyncio.Task[Any]]) -> None:
        """Let these tasks send nothing at all: what stops something could end what replaced them."""
        self._silenced.update(tasks)

    def _require_current(self, *, stops: bool) -> None:
        """Raise `CommandRejected` in a task that may not send (any more)."""
        if not (self._retired or self._silenced):
            return
        task = asyncio.current_task()
        if task is not None and (task in self._silenced or (task in self._retired and not stops)):
            raise CommandRejected("replaced by a newer command")

    def send(self, message: Message, *, stops: bool = False, is_setting: bool = False, at_once: bool = False) -> int:
        """Hand a command to the transport; stops and landings go before settings there.

        Raises `LinkLost` when there is no link, or what the gate raises.

        `stops`: it stops something. Raises `CommandRejected` in a task that may not send it (see `retire`). `at_once`:
        it leaves in this event-loop iteration, because nothing follows that could share its frame.
        """
        if self._wire is None:
            raise Disconnected("not connected")
        self._require_current(stops=stops)
        if self.gate is not None and not self.gate(message):
            return BLOCKED
        if message_log.isEnabledFor(logging.DEBUG):
            message_log.debug("%s: sent %r", self.name, without_secrets(message))
        is_urgent = stops or type(message) is ardrone3.Landing
        rank = Rank.URGENT if is_urgent else Rank.SETTING if is_setting else Rank.NORMAL
        token = self._wire.send(message, rank, at_once=at_once)
        if self.on_command is not None:
            try:
                self.on_command(message)
            except Exception:  # what listens must not keep a command from the drone
                logger.exception("%s: %s not recorded", self.name, type(message).__name__)
        return token

    def deliver(self, message: Message, *, stops: bool = False) -> asyncio.Future[None]:
        """Send an acknowledged command; the future is done when the drone has received it.

        The command is not meant to be withdrawn (but see `withdraw`). The future fails with `LinkLost`, or
        `CommandTimeout` when the transport drops the command. Do not await it bare, a cancelled wait would cancel it:
        use `asyncio.wait`.
        """
        return self.delivery(self.send(message, stops=stops))

    def delivery(self, token: int) -> asyncio.Future[None]:
        """Return a future that is done when the drone has received a command; see `deliver`."""
        delivery: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._deliveries[token] = delivery
        return delivery

    def send_stop(self, message: Message) -> asyncio.Future[None]:
        """`deliver` a stop command and add it to `pending_stops`.

        A task that has to confirm a stop waits for `pending_stops`.
        """
        delivery = self.deliver(message, stops=True)
        self.pending_stops.add(delivery)
        delivery.add_done_callback(self.pending_stops.discard)
        return delivery

    def send_stop_if_connected(self, message: Message) -> None:
        """`send_stop` for a verb that aborts; ignores a lost link and a newer command.

        Both are reported elsewhere.
        """
        with contextlib.suppress(LinkLost, CommandRejected):
            self.send_stop(message)

    async def stops_delivered(self, what: str, timeout: float) -> None:
        """Return when the drone has received every stop command, at once when none is pending.

        Raises `CommandTimeout` about `what`, or the error of a stop command that failed.
        """
        require_number(timeout)
        pending_stops = list(self.pending_stops)
        if not pending_stops:
            return
        _, late = await asyncio.wait(pending_stops, timeout=max(timeout, 0.0))
        self.require_link()
        if late:
            raise CommandTimeout(what, timeout)
        for delivery in pending_stops:
            delivery.result()

    def withdraw(self, delivery: asyncio.Future[None], error: AnafiMavError) -> None:
        """Withdraw what `deliver` sent, if the drone has not received it yet.

        The delivery fails with this error.
        """
        for token, other in tuple(self._deliveries.items()):
            if other is delivery:
                del self._deliveries[token]
                self.cancel(token)
        if not delivery.done():
            delivery.set_exception(error)
            delivery.exception()  # it may have no waiter; asyncio would complain

    def _delivered(self, token: int, arrived: bool) -> None:
        if arrived:
            self.sent.deliver(token, loop_time())
        delivery = self._deliveries.pop(token, None)
        if delivery is None or delivery.done():
            return
        if arrived:
            delivery.set_result(None)
        else:
            delivery.set_exception(CommandTimeout("its receipt", 0.75))  # version 1: five retransmissions of 150 ms
            delivery.exception()

    def cancel(self, token: int | None) -> None:
        """Withdraw a command that has not been delivered; None: it was not sent."""
        if token is None:
            return
        if (delivery := self._deliveries.pop(token, None)) is not None:
            delivery.cancel()
        if self._wire is not None:
            self._wire.cancel(token)

    def expect(
        self, answers: Sequence[type[Message]], judge: Callable[[Any], T | AnafiMavError | None]
    ) -> Expectation[T]:
        """Listen for an answer among these kinds of events. Raises `LinkLost` when there is no link."""
        self.require_link()
        expectation = Expectation(self, answers, judge)
        self._open.add(expectation)
        for answer in answers:
            self.waiting.setdefault(answer, []).append(expectation)
        return expectation

    def forget(self, expectation: Expectation[Any]) -> None:
        """Stop showing events to this one."""
        self._open.discard(expectation)
        for answer in expectation.answers:
            listening = self.waiting.get(answer, [])
            if expectation in listening:
                listening.remove(expectation)
            if not listening:
                self.waiting.pop(answer, None)

    async def confirm(
        self,
        command: Message,
        answers: Sequence[type[Message]],
        judge: Callable[[Any], T | AnafiMavError | None],
        timeout: float = ANSWER_TIMEOUT,
        *,
        stops: bool = False,
        is_setting: bool = False,
    ) -> T:
        """Send a command and return what the judge makes of the answer.

        `stops` and `is_setting`: see `send`.
        """
        expectation = self.expect(answers, judge)
        self.dispatch(expectation, command, timeout, stops=stops, is_setting=is_setting)
        return await expectation.wait()

    async def begin(
        self,
        sent: SentCommand,
        command: Message,
        answers: Sequence[type[Message]],
        judge: Callable[[Any], T | AnafiMavError | None],
        timeout: float,
    ) -> T:
        """`confirm` for a command that flies the drone until something ends it.

        When this times out or is cancelled, the command is withdrawn and undone. `abort_pending` ends it, and so does
        a newer one that replaces it: both raise `CommandRejected` here.
        """

        def judged(message: Any) -> T | AnafiMavError | None:
            verdict = judge(message)
            if verdict is not None:
                sent.apply(Event.REFUSED if isinstance(verdict, AnafiMavError) else Event.EXECUTED)
            return verdict

        answer = self.expect(answers, judged)
        sent.answer = answer
        self.dispatch(answer, command, timeout)
        for older in self.sent.place(sent, loop_time()):
            older.answer.fail(CommandRejected("replaced by a newer command"))
        try:
            return await answer.wait()
        except BaseException:
            begins = sent.awaited or sent.phase is Phase.CONFIRMED
            refused = sent.undo_refused and sent.phase is Phase.REFUSED
            if (begins or refused) and self.sent.is_newest(sent):  # else it would end the newer one
                self._withdraw(sent)
            raise

    def abort_pending(self, why: str, *slots: Slot) -> None:
        """Withdraw and undo the unanswered commands of these slots, by default of `AUTOMATIC`."""
        for sent in self.sent.awaited(*(slots or AUTOMATIC)):
            sent.answer.fail(CommandRejected(why))
            self.cancel(sent.answer.token)
            self._withdraw(sent)

    def _withdraw(self, sent: SentCommand) -> None:
        if (undo := self.sent.withdraw(sent, loop_time())) is not None:
            self.send_stop_if_connected(undo)

    def dispatch(
        self,
        expectation: Expectation[Any],
        command: Message,
        timeout: float,
        *,
        stops: bool = False,
        is_setting: bool = False,
    ) -> None:
        """Send the command whose answer is expected, at once. `stops` and `is_setting`: see `send`."""
        try:
            expectation.expire_after(timeout, command.NAME)
            expectation.token = self.send(command, stops=stops, is_setting=is_setting, at_once=True)
        except BaseException:
            expectation.close()
            raise

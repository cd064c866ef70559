"""Elements whose verbs change a setting and return what the drone made of it.

A drone answers a setting with an event that carries the value it now has: the one asked for, one clamped to its range,
or the old one when it did not want the new. There is no other answer, so that the event's value is the result of the
verb. Another value than the one asked for is the result if no event with that one follows. A setting that the drone did
not report when it connected does not exist: `NotSupported`. `Commanding._change` is the only place with these rules.
"""

from __future__ import annotations

import asyncio
import math
from collections import Counter
from collections.abc import Callable, Hashable
from typing import Any, TypeAlias, TypeVar

import msgspec

from anafi_mav.arsdk.codec.wire import Buffer, Message
from anafi_mav.arsdk.messages import common
from anafi_mav.drone.element import Element, Range, StateT, setting
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, Expectation
from anafi_mav.errors import AnafiMavError, CommandRejected, LocalProtocolError
from anafi_mav.units import clip, is_finite

T = TypeVar("T")

Question: TypeAlias = tuple[Message, type[Message], Callable[[Any], bool | None]]
"""Something to ask after connecting: the question, the kind of event that answers it, and its judge."""

ANSWERED_WITHIN = 1.5
"""s after the drone's receipt of a change in which it has answered. Events may be a second late, and need a few
retransmissions of 150 ms."""

REPEAT = 0.5
"""s after which an unacknowledged target is sent again while no event shows its effect.

Attitude and zoom are reported five times a second.
"""


def number(value: float, what: str) -> float:
    """The value.

    Raises `LocalProtocolError` for NaN, infinities and what no float holds, which ask a drone for nothing.
    """
    if not is_finite(value):
        raise LocalProtocolError(f"{what}: expected a finite number")
    return value


def is_same(one: object, other: object) -> bool:
    """Return True for equal values.

    Numbers in them are compared to three digits: the drone may round.
    """
    if isinstance(one, msgspec.Struct) and isinstance(other, msgspec.Struct):
        one, other = msgspec.structs.astuple(one), msgspec.structs.astuple(other)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(is_same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-3, abs_tol=1e-6)
    return one == other


def same_as(value: T) -> Callable[[T], bool]:
    """Return the check for this value."""
    return lambda result: is_same(result, value)


def is_limited(setting: Range, wanted: float) -> bool:
    """Return True for the wanted value, or the end of the setting's range that is nearest to it."""
    return is_same(setting.current, float(clip(wanted, setting.min, setting.max)))


class Commanding(Element[StateT]):
    """An element that sends commands."""

    def __init__(self, commander: Commander) -> None:
        super().__init__()
        self._commander = commander
        self._setting_locks: dict[type[Message], asyncio.Lock] = {}
        self._changes: dict[type[Message], object] = {}
        """The newest change of each kind of answer, until the drone has answered it."""
        self._orders: Counter[Hashable] = Counter()
        """Targets given so far, by what they are for: a verb that repeats its own sees that there is a newer one."""

    def reset(self) -> None:
        super().reset()
        self._changes.clear()

    @property
    def is_settled(self) -> bool:
        """True when the drone has answered the newest change of each setting."""
        return not self._changes

    async def _change(
        self,
        command: Message | Callable[[], Message],
        answer: type[Message],
        judge: Callable[[Any], T | AnafiMavError | None],
        is_wanted: Callable[[T], bool] = lambda result: True,
        *,
        timeout: float = ANSWER_TIMEOUT,
        stops: bool = False,
        silence: AnafiMavError | None = None,
    ) -> T:
        """Send a change and return the judge's result of its answer.

        Changes with the same kind of answer are sent one after the other. A result counts at once if `is_wanted`.
        Another one counts `ANSWERED_WITHIN` after the drone's receipt of the command, if no wanted one has followed:
        before that it may be of an older event. An answer of a kind that the link does not acknowledge may be lost: the
        command is sent once more first. `command` is called when it is its turn: a command of several settings repeats
        those that the change before it has left. `stops`: it ends something that goes on. `silence`: the error if the
        drone has reported nothing by then; without it, it may still answer until `timeout`. Its report may be lost, so
        it is requested to report everything again. Raises `CommandTimeout`, too, if the drone has not received the
        command by then.
        """
        change = self._changes[answer] = object()
        async with self._setting_locks.setdefault(answer, asyncio.Lock()):  # else whose answer would it be
            sent = command if isinstance(command, Message) else command()
            kept: list[T] = []
            has_answered = False
            is_answer_losable = answer.BUFFER is Buffer.NON_ACK

            def listen(message: Any) -> T | AnafiMavError | None:
                result = judge(message)
                if result is None or isinstance(result, AnafiMavError) or has_answered or is_wanted(result):
                    return result
                kept[:] = [result]
                return None

            def watch_delivery() -> None:
                assert expectation.token is not None
                self._commander.delivery(expectation.token).add_done_callback(delivered)

            def delivered(delivery: asyncio.Future[None]) -> None:
                if not delivery.cancelled() and delivery.exception() is None:
                    delivery.get_loop().call_later(ANSWERED_WITHIN, settle)

            def settle() -> None:
                nonlocal has_answered, is_answer_losable
                if is_answer_losable and not expectation.future.done():
                    is_answer_losable = False
                    expectation.token = self._commander.send(sent, stops=stops, is_setting=not stops)
                    watch_delivery()
                    return
                has_answered = True
                if kept:
                    expectation.succeed(kept[0])
                elif not expectation.future.done():
                    for query in self._queries():
                        self._commander.send(query, is_setting=True)
                    if silence is not None:
                        expectation.fail(silence)

            expectation = self._commander.expect((answer,), listen)
            self._commander.dispatch(expectation, sent, timeout, stops=stops, is_setting=not stops)
            watch_delivery()
            result = await expectation.wait()
            if self._changes.get(answer) is change:
                del self._changes[answer]
            return result

    def _queries(self) -> list[Message]:
        """Return the queries that the drone answers with the values of this element."""
        return [common.AllSettings(), common.AllStates()]

    def _order(self, subject: Hashable, command: Message) -> int:
        """Send a target that is not acknowledged; every older one for the same subject is over."""
        self._commander.send(command)
        self._orders[subject] += 1
        return self._orders[subject]

    async def _insist(self, subject: Hashable, command: Message, answer: Expectation[T], timeout: float) -> T:
        """Send a target that is not acknowledged and repeat it until the answer has arrived.

        Raises `CommandRejected` when the subject is given another target meanwhile.
        """
        answer.expire_after(timeout, command.NAME)
        try:
            order = self._order(subject, command)
            while not (await asyncio.wait({answer.future}, timeout=REPEAT))[0]:
                if self._orders[subject] != order:
                    raise CommandRejected("replaced by a newer target")
                self._commander.send(command)
            return await answer.wait()
        finally:
            answer.close()

    async def _set(self, command: Message, answer: type[Message], reported: object) -> float:
        """Change a setting with a range and return its value then.

        The command has one argument; the answer has `current`, `min` and `max`.
        """
        (value,) = (getattr(command, name) for name in command.__struct_fields__)
        number(value, command.NAME)
        self._commander.require_feature(reported, command.NAME)
        return (await self._change(command, answer, setting, lambda result: is_limited(result, value))).current

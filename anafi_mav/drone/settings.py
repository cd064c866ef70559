"""Elements whose verbs change a setting and return what the drone made of it.

A drone answers a setting with an event that carries the value it now has: the one asked for, one clamped to its range,
or the old one when it did not want the new. There is no other answer, so that the event's value is the result of the
verb. Another value than the one asked for is the result if no event with that one follows. A setting that the drone did
not report when it connected does not exist: `NotSupported`.
"""

from __future__ import annotations

import asyncio
import math
from collections import Counter
from collections.abc import Callable, Hashable
from typing import Any, TypeAlias, TypeVar

import msgspec

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.drone.element import Element, StateT
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, Expectation
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, LocalProtocolError, NotSupported
from anafi_mav.units import is_finite

T = TypeVar("T")

Question: TypeAlias = tuple[Message, type[Message], Callable[[Any], bool | None]]
"""Something to ask after connecting: the question, the kind of event that answers it, and its judge."""

KEPT_AFTER = 0.5
"""s until an answer with another value than the wanted one counts, after it and the drone's receipt of the change: the
drone may have sent that event before."""

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


class Commanding(Element[StateT]):
    """An element that sends commands."""

    def __init__(self, commander: Commander) -> None:
        super().__init__()
        self._commander = commander
        self._setting_locks: dict[type[Message], asyncio.Lock] = {}
        self._orders: Counter[Hashable] = Counter()
        """Targets given so far, by what they are for: a verb that repeats its own sees that there is a newer one."""

    def _require(self, reported: object, feature: str) -> None:
        """Raise `LinkLost` without a link, `NotSupported` for an absent feature.

        It is absent when `reported`, a state that drones with the feature report, is None or empty.
        """
        self._commander.require_link()
        if reported is None or reported == frozenset() or reported == {}:
            raise NotSupported(feature)

    async def _change(
        self,
        command: Message,
        answer: type[Message],
        judge: Callable[[Any], T | AnafiMavError | None],
        timeout: float = ANSWER_TIMEOUT,
        *,
        stops: bool = False,
        wanted: T | None = None,
        is_done: Callable[[T], bool] | None = None,
    ) -> T:
        """Send a setting and return what the judge makes of its answer.

        `stops`: it ends something that goes on. `wanted`: another result counts if this one does not follow; or one for
        which `is_done` is True.
        """
        async with self._setting_lock(answer):
            return await self._answered(
                command,
                answer,
                judge,
                is_done or (lambda result: wanted is None or is_same(wanted, result)),
                timeout,
                stops=stops,
                is_setting=not stops,
            )

    async def _answered(
        self,
        command: Message,
        answer: type[Message],
        judge: Callable[[Any], T | AnafiMavError | None],
        is_done: Callable[[T], bool],
        timeout: float = ANSWER_TIMEOUT,
        *,
        stops: bool = False,
        is_setting: bool = False,
    ) -> T:
        """Send a change and return the judge's result.

        One that is not done counts if no other follows.
        """
        kept: list[T] = []

        def listen(message: Any) -> T | AnafiMavError | None:
            result = judge(message)
            if result is None or isinstance(result, AnafiMavError) or is_done(result):
                return result
            if not kept and delivery.done():
                expectation.expire_after(KEPT_AFTER, command.NAME)
            kept[:] = [result]
            return None

        def delivered(delivery: asyncio.Future[None]) -> None:
            if kept and not delivery.cancelled() and not expectation.future.done():
                expectation.expire_after(KEPT_AFTER, command.NAME)

        expectation = self._commander.expect((answer,), listen)
        self._commander.dispatch(expectation, command, timeout, stops=stops, is_setting=is_setting)
        assert expectation.token is not None
        delivery = self._commander.delivery(expectation.token)
        delivery.add_done_callback(delivered)
        try:
            return await expectation.wait()
        except CommandTimeout:
            if not kept:
                raise
            return kept[0]

    def _setting_lock(self, answer: type[Message]) -> asyncio.Lock:
        """Return the lock that allows one change at a time.

        The answers of two changes could not be distinguished.
        """
        return self._setting_locks.setdefault(answer, asyncio.Lock())

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

        The command has one argument; the answer has `current`.
        """
        (value,) = (getattr(command, name) for name in command.__struct_fields__)
        number(value, command.NAME)
        self._require(reported, command.NAME)
        async with self._setting_lock(answer):
            return await self._answered(
                command,
                answer,
                lambda message: float(message.current) if math.isfinite(message.current) else None,
                lambda result: is_same(result, value),
                is_setting=True,
            )

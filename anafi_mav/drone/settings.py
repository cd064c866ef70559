"""Elements whose verbs change a setting and return what the drone made of it.

A drone answers a setting with an event that carries the value it now has: the one asked for, one clamped to its range,
or the old one when it did not want the new. There is no other answer, so that the event's value is the result of the
verb. A setting that the drone did not report when it connected does not exist: `NotSupported`.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any, TypeVar

from anafi_mav.arsdk.wire import Message
from anafi_mav.drone.element import Element, StateT
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander
from anafi_mav.errors import AnafiMavError, LinkLost, LocalProtocolError, NotSupported

T = TypeVar("T")


class Commanding(Element[StateT]):
    """An element that sends commands."""

    def __init__(self, commander: Commander) -> None:
        super().__init__()
        self._commander = commander
        self._setting_locks: dict[type[Message], asyncio.Lock] = {}

    def _require(self, reported: object, feature: str) -> None:
        """Raise `LinkLost` without a link, `NotSupported` when what the drone should have reported is None or empty."""
        if not self._commander.connected:
            raise LinkLost("not connected")
        if reported is None or reported == frozenset() or reported == {}:
            raise NotSupported(feature)

    async def _change(
        self,
        command: Message,
        answer: type[Message],
        judge: Callable[[Any], T | AnafiMavError | None],
        timeout: float = ANSWER_TIMEOUT,
    ) -> T:
        """Send a setting and return what the judge makes of its answer."""
        # One at a time: the answers of two could not be told apart.
        async with self._setting_locks.setdefault(answer, asyncio.Lock()):
            return await self._commander.confirm(command, (answer,), judge, timeout)

    async def _set(self, command: Message, answer: type[Message], reported: object) -> float:
        """Change a setting with a range (one argument, answered with `current`) and return what it is then."""
        (value,) = (getattr(command, name) for name in command.__struct_fields__)
        if not math.isfinite(value):
            raise LocalProtocolError(f"{command.NAME}: the value is not a number")
        self._require(reported, command.NAME)
        return await self._change(
            command, answer, lambda message: float(message.current) if math.isfinite(message.current) else None
        )

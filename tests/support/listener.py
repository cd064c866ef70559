"""A listener: keeps what it receives, and waits until that is enough."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Generic, TypeVar

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage

T = TypeVar("T")


class Listener(Generic[T]):
    """`hear` receives each thing; `heard` has all of them, oldest first."""

    def __init__(self) -> None:
        self.heard: list[T] = []
        self._updated = asyncio.Event()

    def hear(self, thing: T) -> None:
        self.heard.append(thing)
        self._updated.set()

    async def until(self, happened: Callable[[], bool], timeout: float = 5.0) -> None:
        """Wait until this is true; it is looked at whenever something is heard."""

        async def wait() -> None:
            while not happened():
                self._updated.clear()
                await self._updated.wait()

        await asyncio.wait_for(wait(), timeout)


class MessageListener(Listener[Message | UnknownMessage]):
    """Receives the messages of a session: `on_message`."""

    def __call__(self, message: Message | UnknownMessage, now: float) -> None:
        self.hear(message)

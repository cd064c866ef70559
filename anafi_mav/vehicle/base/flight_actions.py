"""Running actions of one vehicle, in the sequence of their arrival.

An action of a client that acquires control ends all older ones. A newer one continues: it will replace this one.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable, Hashable

from msgspec import Struct


class FlightAction(Struct, eq=False):
    """A running action: a command, a stream's engagement, a reaction of the gateway."""

    client: Hashable
    is_order: bool = True
    """A client has commanded it; neither the gateway began it, nor a stream of setpoints."""
    flies: bool = True
    """It may fly the drone; False: of camera or gimbal, whose place in the sequence counts."""
    is_of_core: bool = False
    """The flight core runs it, no service: it ends with the link."""
    replaced_by_order: bool = False
    """A newer command of a client has ended it."""
    replaced_by: Hashable = None
    """Client whose action has ended it; None: the gateway's, or none."""

    @property
    def is_replaced_by_another_client(self) -> bool:
        """True when the action of another client has ended it."""
        return self.replaced_by not in (None, self.client)


class FlightActions:
    """The running actions of one vehicle."""

    def __init__(self) -> None:
        self._tasks: dict[asyncio.Task[None], FlightAction] = {}
        """In the sequence of their arrival, which is not that of their first steps."""
        self._begun: list[Callable[[Hashable], None]] = []
        self._replaced: list[Callable[[Hashable], None]] = []

    @property
    def current(self) -> FlightAction | None:
        """The action that calls; None outside of them."""
        task = asyncio.current_task()
        return None if task is None else self._tasks.get(task)

    @property
    def is_idle(self) -> bool:
        """True when no action runs, or has arrived, that may fly the drone."""
        return not any(action.flies for action in self._tasks.values())

    def add(self, task: asyncio.Task[None], action: FlightAction) -> None:
        """Note an action that has arrived, until it ends."""
        self._tasks[task] = action
        task.add_done_callback(lambda ended: self._tasks.pop(ended, None))

    def announce(self, client: Hashable) -> None:
        """Notify the subscribers that an action without acknowledgement of this client begins."""
        for call in self._begun:
            call(client)

    def on_begun(self, call: Callable[[Hashable], None]) -> None:
        """Call this each time an action without acknowledgement begins, with its client."""
        self._begun.append(call)

    def on_replaced(self, call: Callable[[Hashable], None]) -> None:
        """Call this each time an action replaces the others, with its client; None: the gateway's."""
        self._replaced.append(call)

    def end_older(self) -> list[asyncio.Task[None]]:
        """Cancel all actions that are older than the calling one; all of them outside of an action."""
        task, current = asyncio.current_task(), self.current
        before = itertools.takewhile(lambda other: other is not task, self._tasks)
        older = [other for other in before if self._tasks[other].flies]
        for other in older:
            if current is not None:
                self._tasks[other].replaced_by = current.client
            if current is not None and current.is_order:
                self._tasks[other].replaced_by_order = True
            other.cancel()
        for call in self._replaced:
            call(None if current is None else current.client)
        return older

    def link_down(self) -> None:
        """Cancel the actions of the flight core; a service cancels its own."""
        for task, action in tuple(self._tasks.items()):
            if action.is_of_core:
                task.cancel()

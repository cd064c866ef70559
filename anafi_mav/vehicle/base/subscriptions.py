"""Handlers of the drone's events, by kind of event. No I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

from anafi_mav.drone.events import Message
from anafi_mav.drone.values import ValueLayout, Values

EventHandler = Callable[[Any, float], None]
"""Handle an event (message, event-loop time in s). The drone's states contain it already."""

Subscriptions = Mapping[type[Message], EventHandler]

ValueHandler = Callable[[Values, float], None]
"""Handle events of values that arrived together (values, event-loop time in s).

The drone's states contain them already. They are decoded when a state is read, so that a handler with nothing to do
reads none.
"""


class ValueInterest:
    """Kinds of values that a handler is called for while it `is_on`.

    It is called once for those that arrived together. Most handlers have nothing to do most of the time: those of a
    flight task while it is not active.
    """

    __slots__ = ("_switched", "is_on", "kinds")

    def __init__(self, kinds: Iterable[type[Message]], *, is_on: bool = True) -> None:
        self.kinds = _shared(frozenset(kinds))
        self.is_on = is_on
        self._switched: Callable[[], None] = lambda: None

    def switch(self, is_on: bool) -> None:
        """Have the handler called from the next values on, or not."""
        if is_on != self.is_on:
            self.is_on = is_on
            self._switched()

    def on_switch(self, call: Callable[[], None]) -> None:
        """Call a function whenever it is switched on or off, in place of an earlier one."""
        self._switched = call


@lru_cache(maxsize=256)
def _shared(kinds: frozenset[type[Message]]) -> frozenset[type[Message]]:
    """Return the first set of these kinds: every drone's handlers have the same ones."""
    return kinds


ValueSubscriptions = Mapping[ValueHandler, ValueInterest]
"""The interest of each handler."""

MAX_REMEMBERED = 64
"""Layouts of values that arrive together of which the handlers are remembered; a drone in operation sends a few."""


def in_order(tables: Iterable[Subscriptions]) -> dict[type[Message], tuple[EventHandler, ...]]:
    """Join tables into one; handlers of an event are called in the sequence of their tables.

    Events with the same handlers share a tuple: a drone has 150 of them, and a fifth as many tuples.
    """
    handlers: dict[type[Message], tuple[EventHandler, ...]] = {}
    for table in tables:
        for kind, handler in table.items():
            handlers[kind] = (*handlers.get(kind, ()), handler)
    shared: dict[tuple[EventHandler, ...], tuple[EventHandler, ...]] = {}
    return {kind: shared.setdefault(together, together) for kind, together in handlers.items()}


class ValueHandlers:
    """Handlers of values, called in the sequence of their tables."""

    def __init__(self, tables: Iterable[ValueSubscriptions]) -> None:
        self._all = [(handler, interest) for table in tables for handler, interest in table.items()]
        self._of: dict[ValueLayout, list[ValueHandler]] = {}
        for _, interest in self._all:
            interest.on_switch(self._of.clear)

    def call(self, values: Values, now: float) -> None:
        """Call each handler of one of these values."""
        layout = values.layout
        handlers = self._of.get(layout)
        if handlers is None:
            if len(self._of) >= MAX_REMEMBERED:
                self._of.clear()
            handlers = self._of[layout] = [
                handler
                for handler, interest in self._all
                if interest.is_on and not interest.kinds.isdisjoint(layout.kinds)
            ]
        for handler in handlers:
            handler(values, now)

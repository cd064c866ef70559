"""Handlers of the drone's events, by kind of event. No I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from anafi_mav.drone.events import Message
from anafi_mav.drone.values import Values

EventHandler = Callable[[Any, float], None]
"""Handle an event (message, event-loop time in s). The drone's states contain it already."""

Subscriptions = Mapping[type[Message], EventHandler]

ValueHandler = Callable[[Values, float], None]
"""Handle events of values that arrived together (values by kind, event-loop time in s).

The drone's states contain them already. They are decoded when a state is read, so that a handler with nothing to do
reads none.
"""

ValueSubscriptions = Mapping[ValueHandler, Iterable[type[Message]]]
"""Kinds of values that each handler is called for, once for those that arrived together."""

MAX_SETS = 64
"""Sets of values that arrive together of which the handlers are remembered; a drone in operation sends a few."""


def in_order(tables: Iterable[Subscriptions]) -> dict[type[Message], tuple[EventHandler, ...]]:
    """Join tables into one; handlers of an event are called in the sequence of their tables."""
    handlers: dict[type[Message], tuple[EventHandler, ...]] = {}
    for table in tables:
        for kind, handler in table.items():
            handlers[kind] = (*handlers.get(kind, ()), handler)
    return handlers


class ValueHandlers:
    """Handlers of values, called in the sequence of their tables."""

    def __init__(self, tables: Iterable[ValueSubscriptions]) -> None:
        self._all = [(handler, frozenset(kinds)) for table in tables for handler, kinds in table.items()]
        self._of: dict[tuple[type[Message], ...], list[ValueHandler]] = {}

    def call(self, values: Values, now: float) -> None:
        """Call each handler of one of these values."""
        kinds = tuple(values)
        handlers = self._of.get(kinds)
        if handlers is None:
            if len(self._of) >= MAX_SETS:
                self._of.clear()
            handlers = self._of[kinds] = [handler for handler, wanted in self._all if not wanted.isdisjoint(kinds)]
        for handler in handlers:
            handler(values, now)

"""Handlers of the drone's events, by kind of event. No I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from anafi_mav.drone.events import Message

EventHandler = Callable[[Any, float], None]
"""Handle an event (message, event-loop time in s). The drone's states contain it already."""

Subscriptions = Mapping[type[Message], EventHandler]


def in_order(tables: Iterable[Subscriptions]) -> dict[type[Message], tuple[EventHandler, ...]]:
    """Join tables into one; handlers of an event are called in the sequence of their tables."""
    handlers: dict[type[Message], tuple[EventHandler, ...]] = {}
    for table in tables:
        for kind, handler in table.items():
            handlers[kind] = (*handlers.get(kind, ()), handler)
    return handlers

"""Events of values as they arrive, in bytes that are decoded when they are read. No I/O.

A drone sends attitude, speed and height again and again, and most of them are replaced before they are read. All that
are in a frame wait together, as one object, and are the same few in the same places each time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias, final

import msgspec

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import HEADER, Message, MessageT, UnknownMessage

ValueReader: TypeAlias = Callable[[bytes], Any]
"""Decodes an event at a known place in bytes."""

MAX_LAYOUTS = 512
"""Layouts of one event, or of joined ones, that are remembered; a drone in operation sends a dozen."""


class ValueLayout:
    """Places of events of values in some bytes, one of each kind.

    One object serves all bytes with these events in the same places.
    """

    __slots__ = ("_readers", "kinds", "places")

    def __init__(self, places: Mapping[type[Message], slice]) -> None:
        """`places`: the command bytes of each kind, in their sequence."""
        self.places = places
        self.kinds = tuple(places)
        self._readers: dict[int, tuple[Mapping[type[Message], Any], Sequence[tuple[Any, ValueReader]]]] = {}

    def shares(self, other: ValueLayout) -> bool:
        """Return True if both have events of one kind."""
        return not self.places.keys().isdisjoint(other.kinds)

    def readers(self, table: Mapping[type[Message], Any]) -> Sequence[tuple[Any, ValueReader]]:
        """Return the entries of a table for these events, each with the reader of its event."""
        known = self._readers.get(id(table))
        if known is None:
            entries = [
                (table[kind], wire.value_reader(kind, place.start))
                for kind, place in self.places.items()
                if kind in table
            ]
            known = self._readers[id(table)] = table, entries  # a kept table keeps its identity
        return known[1]


@final
class Values(msgspec.Struct, frozen=True, gc=False):
    """Events of values that arrived together, one of each kind, not decoded yet."""

    layout: ValueLayout
    data: bytes

    def __contains__(self, kind: object) -> bool:
        return kind in self.layout.places

    def command(self, kind: type[Message]) -> bytes:
        """Return the command bytes of a kind that is among them, as for `decode`."""
        return self.data[self.layout.places[kind]]

    def message(self, kind: type[MessageT]) -> MessageT:
        """Decode the event of a kind that is among them."""
        return wire.value_reader(kind, self.layout.places[kind].start)(self.data)

    def messages(self) -> Iterator[Message]:
        """Decode them."""
        return map(self.message, self.layout.kinds)

    def split(self) -> Iterator[Values]:
        """Return them one by one."""
        return (Values(_layout_of(command), command) for command in map(self.command, self.layout.kinds))


Received: TypeAlias = Message | UnknownMessage | Values

_layouts: dict[tuple[bytes, int], ValueLayout] = {}
"""Layouts of one event, by the bytes that say what it replaces, and its length."""

_joined: dict[tuple[ValueLayout, ...], ValueLayout] = {}
"""By the layouts of each."""


def receive(commands: Iterable[bytes]) -> list[Received]:
    """Decode the messages in these command bytes, but for events of values.

    Those that are too short are left out, as `decode` returns None for them.
    """
    messages: list[Received] = []
    known = wire.value_events()
    for data in commands:
        value = known.get(data[: HEADER.size])
        if value is None:
            if (message := wire.decode(data)) is not None:
                messages.append(message)
        elif len(data) >= value.size:
            messages.append(Values(_layout_of(data), data))
    return messages


def join(values: Sequence[Values]) -> Values:
    """Return events that arrived one after another, of which no kind is repeated, as one object."""
    if len(values) == 1:
        return values[0]
    layouts = tuple(each.layout for each in values)
    layout = _joined.get(layouts)
    if layout is None:
        places: dict[type[Message], slice] = {}
        begin = 0
        for each in values:
            for kind, place in each.layout.places.items():
                places[kind] = slice(begin + place.start, begin + place.stop)
            begin += len(each.data)
        if len(_joined) >= MAX_LAYOUTS:
            _joined.clear()
        layout = _joined[layouts] = ValueLayout(places)
    return Values(layout, b"".join([each.data for each in values]))


def unpacked(received: Iterable[Received]) -> Iterator[Message | UnknownMessage]:
    """Return received messages, decoded."""
    for message in received:
        if isinstance(message, Values):
            yield from message.messages()
        else:
            yield message


def _layout_of(command: bytes) -> ValueLayout:
    """Return the layout of one event of values."""
    value = wire.value_events()[command[: HEADER.size]]
    key = command[: value.name_size], len(command)
    layout = _layouts.get(key)
    if layout is None:
        if len(_layouts) >= MAX_LAYOUTS:
            _layouts.clear()
        layout = _layouts[key] = ValueLayout({value.kind: slice(0, len(command))})
    return layout

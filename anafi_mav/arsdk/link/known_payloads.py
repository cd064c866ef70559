"""Payloads of events of values that are read as a whole. No I/O.

A drone's telemetry is the same events in the same places of each frame: they are known by their fixed bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.value_events import Received, ValueLayout, Values
from anafi_mav.arsdk.codec.wire import HEADER
from anafi_mav.arsdk.link.frame import VERSIONS

MAX_OF_SIZE, MAX_PAYLOADS = 4, 256
"""Payloads that are remembered: of one size, and altogether. A drone in operation sends a dozen."""


class _KnownPayload:
    """A payload of events of values, without the values.

    Fixed are lengths, headers and the numbers of cameras or gimbals.
    """

    __slots__ = ("fixed", "layout", "unpack")

    def __init__(self, payload: bytes, places: Sequence[tuple[int, int]]) -> None:
        """`places`: where each command begins and ends."""
        values = wire.value_events()
        found, format, position = {}, "<", 0
        for begin, end in places:
            value = values[payload[begin : begin + HEADER.size]]
            found[value.kind] = slice(begin, end)
            named = begin + value.name_size
            format += f"{named - position}s{end - named}x"
            position = end
        self.layout = ValueLayout(found)
        self.unpack = struct.Struct(format).unpack
        self.fixed = self.unpack(payload)


class KnownPayloads:
    """Payloads of unacknowledged events of values, which are read as a whole.

    The first one with the same events is read command by command.
    """

    def __init__(self) -> None:
        self._by_size: dict[int, list[_KnownPayload]] = {}
        self._count = 0

    def read(self, payload: bytes) -> Values | None:
        """Return the values of a payload whose like has arrived before; None for any other."""
        for known in self._by_size.get(len(payload), ()):
            if known.unpack(payload) == known.fixed:
                return Values(known.layout, payload)
        return None

    def learn(self, payload: bytes, commands: Sequence[bytes], messages: Sequence[Received]) -> None:
        """Remember a payload that `read` did not know.

        Its commands have to be values of which none is repeated.
        """
        kinds = {kind for message in messages if type(message) is Values for kind in message.layout.kinds}
        if not commands or len(kinds) < len(commands) or self._count >= MAX_PAYLOADS:
            return
        gap = (len(payload) - sum(map(len, commands))) // len(commands)  # the length before each command
        places, position = [], 0
        for command in commands:
            position += gap
            places.append((position, position + len(command)))
            position += len(command)
        same = self._by_size.setdefault(len(payload), [])
        is_found = position == len(payload) and [payload[slice(*place)] for place in places] == list(commands)
        if is_found and len(same) < MAX_OF_SIZE:
            same.append(_KnownPayload(payload, places))
            self._count += 1


KNOWN_PAYLOADS = {version: KnownPayloads() for version in VERSIONS}
"""By protocol version: all drones send the same."""

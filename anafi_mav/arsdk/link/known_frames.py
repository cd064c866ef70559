"""Datagrams with one frame of events of values, which are read as a whole. No I/O.

A drone's telemetry is the same events in the same places of each frame: they are known by their fixed bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import HEADER, Received, ValueLayout, Values
from anafi_mav.arsdk.link.frame import Frame, sequence_number

MAX_OF_SIZE, MAX_FRAMES = 4, 256
"""Frames that are remembered: of one size, and altogether. A drone in operation sends a dozen."""


class _KnownFrame:
    """A frame of events of values, without its sequence number and the values.

    Fixed are its type and queue, lengths, headers, and the numbers of cameras or gimbals.
    """

    __slots__ = ("fixed", "id", "layout", "unpack")

    def __init__(self, data: bytes, id: int, number: slice, places: Sequence[tuple[int, int]]) -> None:
        """`id`: of its queue, `number`: place of its sequence number, `places`: of its commands."""
        values = wire.value_events()
        found = {}
        format, position = f"<{number.start}s{number.stop - number.start}x", number.stop
        for begin, end in places:
            value = values[data[begin : begin + HEADER.size]]
            found[value.kind] = slice(begin - number.stop, end - number.stop)
            named = begin + value.name_size
            format += f"{named - position}s{end - named}x"
            position = end
        self.id = id
        self.layout = ValueLayout(found)
        self.unpack = struct.Struct(format).unpack
        self.fixed = self.unpack(data)


class KnownFrames:
    """Unacknowledged frames of events of values, each alone in its datagram.

    They are read as a whole. The first one with the same events is read command by command.
    """

    def __init__(self, version: int) -> None:
        """`version`: of the protocol."""
        self._number = sequence_number(version)
        self._unpack_number = struct.Struct("<" + f"{self._number.start}x" + ("B" if version == 1 else "H")).unpack_from
        self._by_size: dict[int, list[_KnownFrame]] = {}
        self._count = 0

    def read(self, data: bytes) -> tuple[int, int, Values] | None:
        """Return queue, sequence number and values of a frame.

        None if none like it has arrived before.
        """
        for known in self._by_size.get(len(data), ()):
            if known.unpack(data) == known.fixed:
                # A copy: what a socket has read lies in the memory of a longest datagram, and would divide it.
                values = Values(known.layout, data[self._number.stop :])
                return known.id, self._unpack_number(data)[0], values
        return None

    def learn(self, data: bytes, frame: Frame, commands: Sequence[bytes], messages: Sequence[Received]) -> None:
        """Remember a datagram of this one frame that `read` did not know.

        Its commands have to be values of which none is repeated.
        """
        kinds = {kind for message in messages if type(message) is Values for kind in message.layout.kinds}
        if not commands or len(kinds) < len(commands) or self._count >= MAX_FRAMES:
            return
        payload = frame.payload
        gap = (len(payload) - sum(map(len, commands))) // len(commands)  # the length before each command
        places, position = [], len(data) - len(payload)
        for command in commands:
            position += gap
            places.append((position, position + len(command)))
            position += len(command)
        same = self._by_size.setdefault(len(data), [])
        is_found = position == len(data) and [data[slice(*place)] for place in places] == list(commands)
        if is_found and len(same) < MAX_OF_SIZE:
            same.append(_KnownFrame(data, frame.id, self._number, places))
            self._count += 1

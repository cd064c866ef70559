"""Packs commands into payloads of frames and back, in three protocol versions. No I/O.

Version 1 puts one command into a frame. Version 2 packs ``u16 length, command`` pairs, version 3 ``varint length,
command`` pairs, and splits an acknowledged command that is longer than a frame: the next frame of that queue then
begins with its rest, without a length (arsdk-ng libarsdk/src/cmd_itf/arsdk_cmd_itf{1,2,3}.c).
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.value_events import Received, ValueLayout, Values
from anafi_mav.arsdk.codec.wire import HEADER
from anafi_mav.arsdk.link.frame import VERSIONS, decode_varint, encode_varint

PACK_LIMIT = {1: 65_000, 2: 1400, 3: 1000}
"""Most payload bytes of a frame. v2, v3: ARSDK_PACK_MAX_SIZE of cmd_itf2 and 3; v1: what a UDP datagram can carry."""

MAX_COMMAND = 65_535
"""Longest split command that is sent or put together. No command of Parrot's comes near."""

SMALLEST_COMMAND = 4
"""Bytes of a command without arguments."""

_U16 = struct.Struct("<H")
_SHORT = [encode_varint(length) for length in range(128)]
"""Nearly every command is shorter than this."""


def with_length(version: int, command: bytes) -> bytes:
    """A command as it lies in a payload."""
    if version == 1:
        return command
    length = len(command)
    if version == 2:
        return _U16.pack(length) + command
    return (_SHORT[length] if length < len(_SHORT) else encode_varint(length)) + command


def longest_command(version: int, acknowledged: bool) -> int:
    """Most bytes of a command that can be sent."""
    if version == 3 and acknowledged:
        return MAX_COMMAND
    return PACK_LIMIT[version] - (0 if version == 1 else 2)


class Waiting:
    """An acknowledged command that is not yet completely in frames.

    `packed` counts the bytes that already are.
    """

    __slots__ = ("command", "forever", "packed", "token", "yields")

    def __init__(self, token: int, command: bytes, forever: bool, *, yields: bool = False) -> None:
        self.token = token
        self.command = command
        self.forever = forever
        """True when it is repeated until the link is down."""
        self.yields = yields
        """True when an urgent command that is sent later goes before it."""
        self.packed = 0


class Piece(NamedTuple):
    """A command, or a part of a split one, in a frame; `last` says that it ends here."""

    source: Waiting
    data: bytes
    last: bool


def pack(version: int, waiting: deque[Waiting]) -> list[Piece]:
    """Take from `waiting` what the next frame carries.

    Only a command too long for any frame is split.
    """
    if version == 1:
        first = waiting.popleft()
        return [Piece(first, first.command, True)]
    pieces: list[Piece] = []
    room = PACK_LIMIT[version]
    while waiting:
        first = waiting[0]
        data = first.command[first.packed :] if first.packed else with_length(version, first.command)
        if len(data) <= room:
            pieces.append(Piece(first, data, True))
            waiting.popleft()
            room -= len(data)
        elif pieces:
            break
        else:
            pieces.append(Piece(first, data[:room], False))
            first.packed = len(first.command) - len(data) + room
            break
    return pieces


class Unpacker:
    """Finds the commands in the payloads that arrive, and puts split ones together."""

    def __init__(self, version: int) -> None:
        self._version = version
        self._partial: dict[int, tuple[int, bytearray]] = {}
        """Queue id -> (length, bytes so far) of a split command; bounded by `MAX_COMMAND` and the few ids."""

    def unpack(self, id: int, acknowledged: bool, payload: bytes) -> tuple[list[bytes], bool]:
        """Return the complete commands of a payload from queue `id`, and a success flag.

        The flag is False when the rest of the payload is unreadable.
        """
        if self._version == 1:
            return [payload], True
        commands: list[bytes] = []
        position, end = 0, len(payload)
        if acknowledged and id in self._partial:
            size, collected = self._partial.pop(id)
            position = min(end, size - len(collected))
            collected += payload[:position]
            if len(collected) < size:
                self._partial[id] = (size, collected)
                return commands, True
            commands.append(bytes(collected))
        while position < end:
            size = payload[position]
            if size < 0x80 and self._version == 3:  # nearly every command
                position += 1
            else:
                read = self._length(payload, position)
                if read is None:
                    return commands, False
                size, position = read
            if size < SMALLEST_COMMAND:
                return commands, False
            if size > end - position:
                if self._version == 2 or not acknowledged or size > MAX_COMMAND:
                    return commands, False
                self._partial[id] = (size, bytearray(payload[position:]))
                return commands, True
            commands.append(payload[position : position + size])
            position += size
        return commands, True

    def _length(self, payload: bytes, position: int) -> tuple[int, int] | None:
        """(length of the next command, where it begins)."""
        if self._version == 3:
            return decode_varint(payload, position)
        if len(payload) - position < _U16.size:
            return None
        return _U16.unpack_from(payload, position)[0], position + _U16.size


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

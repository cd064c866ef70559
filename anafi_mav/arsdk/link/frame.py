"""Frames of the ARSDK transport, in three protocol versions, and their commands. No I/O.

A datagram is a row of frames. A frame has a type, the id of a queue, a sequence number and a payload; everything is
little-endian (arsdk-ng libarsdk/src/net/arsdk_transport_net.c). Who sends which queue and when is in `transport`.

A payload holds commands. Version 1 puts one command into a frame. Version 2 packs ``u16 length, command`` pairs,
version 3 ``varint length, command`` pairs, and splits an acknowledged command that is longer than a frame: the next
frame of that queue then begins with its rest, without a length (arsdk-ng libarsdk/src/cmd_itf/arsdk_cmd_itf{1,2,3}.c).
"""

from __future__ import annotations

import enum
import math
import struct
from typing import NamedTuple

from anafi_mav.errors import LocalProtocolError

VERSIONS = (1, 2, 3)
"""Protocol versions spoken here."""

VERSION_OFFSET = 10
"""Versions 2 and 3 begin a frame with varint(version + 10); lower first bytes are the type of a v1 frame."""

MAX_VARINT_BYTES = 5
"""A u32 in groups of 7 bits."""

_V1_HEADER = struct.Struct("<BBBI")
_V2_FIXED = struct.Struct("<BBBH")
_V2_SMALLEST = 6


class FrameType(enum.IntEnum):
    """Type of a frame: data, data with acknowledgement, low-latency data or acknowledgement.

    It states how the receiver has to handle the frame (arsdk-ng ARSDK_TRANSPORT_DATA_TYPE_*).
    """

    ACK = 1
    NOACK = 2
    LOWLAT = 3
    WITHACK = 4


_TYPES = frozenset(int(member) for member in FrameType)


class Frame(NamedTuple):
    """One frame; `type` is one of `FrameType`, `seq` has 8 bits in version 1 and 16 in 2 and 3."""

    type: int
    id: int
    seq: int
    payload: bytes


def encode_varint(value: int) -> bytes:
    """LEB128: seven bits per byte, lowest first."""
    if value < 0x80:
        return bytes((value,))
    pieces = bytearray()
    while value >= 0x80:
        pieces.append(value & 0x7F | 0x80)
        value >>= 7
    pieces.append(value)
    return bytes(pieces)


def decode_varint(data: bytes, position: int) -> tuple[int, int] | None:
    """(value, position behind it); None when it is cut off or wider than 32 bits."""
    value = 0
    for count in range(MAX_VARINT_BYTES):
        if position >= len(data):
            return None
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << (7 * count)
        if byte < 0x80:
            return (value, position) if value < 1 << 32 else None
    return None


def encode_frame(version: int, type: int, id: int, seq: int, payload: bytes) -> bytes:
    """One frame. Raises `LocalProtocolError` when a number does not fit its header field."""
    size = len(payload)
    try:
        if version == 1:
            return _V1_HEADER.pack(type, id, seq, size + _V1_HEADER.size) + payload
        length = _SHORT[size] if size < len(_SHORT) else encode_varint(size)
        return _V2_FIXED.pack(version + VERSION_OFFSET, type, id, seq) + length + payload
    except struct.error as error:
        raise LocalProtocolError(f"frame type {type} id {id} seq {seq}: {error}") from error


def frame_type(version: int) -> slice:
    """Return where a frame has its type."""
    return slice(0, 1) if version == 1 else slice(1, 2)


def sequence_number(version: int) -> slice:
    """Return where a frame has its sequence number."""
    return slice(2, 3) if version == 1 else slice(3, 5)


def decode_frames(version: int, data: bytes) -> tuple[list[Frame], str | None]:
    """The frames of a datagram, and why the rest of it is unreadable (None: all of it was read)."""
    return _decode_v1(data) if version == 1 else _decode_v2(version, data)


def _decode_v1(data: bytes) -> tuple[list[Frame], str | None]:
    frames: list[Frame] = []
    position = 0
    while position < len(data):
        if len(data) - position < _V1_HEADER.size:
            return frames, "header"
        type, id, seq, size = _V1_HEADER.unpack_from(data, position)
        if type not in _TYPES:
            return frames, "type"
        end = position + size
        if size < _V1_HEADER.size or end > len(data):
            return frames, "size"
        frames.append(Frame(type, id, seq, data[position + _V1_HEADER.size : end]))
        position = end
    return frames, None


def _decode_v2(version: int, data: bytes) -> tuple[list[Frame], str | None]:
    frames: list[Frame] = []
    position = 0
    while position < len(data):
        if len(data) - position < _V2_SMALLEST:
            return frames, "header"
        mark, type, id, seq = _V2_FIXED.unpack_from(data, position)
        if mark != version + VERSION_OFFSET:
            return frames, "version"
        if type not in _TYPES:
            return frames, "type"
        size, start = data[position + _V2_FIXED.size], position + _V2_SMALLEST
        if size >= 0x80:
            length = decode_varint(data, position + _V2_FIXED.size)
            if length is None:
                return frames, "header"
            size, start = length
        end = start + size
        if end > len(data):
            return frames, "size"
        frames.append(Frame(type, id, seq, data[start:end]))
        position = end
    return frames, None


# Commands in payloads.

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

    __slots__ = ("command", "packed", "sendings", "stops_from", "token", "yields")

    def __init__(
        self,
        token: int,
        command: bytes,
        sendings: float = math.inf,
        *,
        yields: bool = False,
        stops_from: float = -math.inf,
    ) -> None:
        self.token = token
        self.command = command
        self.sendings = sendings
        """How often its frame is sent without an acknowledgement; infinite: until the link is down."""
        self.yields = yields
        """True when an urgent command that is sent later goes before it."""
        self.stops_from = stops_from
        """When it was given (s), of a command that stops something; -inf: it stops nothing."""
        self.packed = 0


class Piece(NamedTuple):
    """A command, or a part of a split one, in a frame; `last` says that it ends here."""

    source: Waiting
    data: bytes
    last: bool


def pack(version: int, waiting: list[Waiting]) -> list[Piece]:
    """Take from `waiting` what the next frame carries.

    Only a command too long for any frame is split.
    """
    if version == 1:
        first = waiting.pop(0)
        return [Piece(first, first.command, True)]
    pieces: list[Piece] = []
    room = PACK_LIMIT[version]
    while waiting:
        first = waiting[0]
        data = first.command[first.packed :] if first.packed else with_length(version, first.command)
        if len(data) <= room:
            pieces.append(Piece(first, data, True))
            waiting.pop(0)
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

"""Frames of the ARSDK transport, in the three protocol versions. No I/O.

A datagram is a row of frames. A frame has a type, the id of a queue, a sequence number and a payload; everything is
little-endian (arsdk-ng libarsdk/src/net/arsdk_transport_net.c). What payloads hold is in `packing`, who sends which
queue and when in `transport`.
"""

from __future__ import annotations

import enum
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
        return _V2_FIXED.pack(version + VERSION_OFFSET, type, id, seq) + encode_varint(size) + payload
    except struct.error as error:
        raise LocalProtocolError(f"frame type {type} id {id} seq {seq}: {error}") from error


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

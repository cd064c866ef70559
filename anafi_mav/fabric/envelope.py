"""Attachments of the fabric's samples in bytes, and frames in a sample. No I/O.

All numbers are little-endian. Times are µs of the sender's monotonic clock: they mean nothing to another computer
without the offset that pings measure.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

from typing_extensions import Self

from anafi_mav.mavlink.frames import CHECKSUM, HEADER_1, HEADER_2, MAGIC_1, MAGIC_2, SIGNATURE, SIGNED

ENVELOPE_VERSION = 1

MAX_SAMPLE = 1400
"""Bytes of frames in one sample: with zenoh's header one packet of an Ethernet network or a tunnel."""

_UP = struct.Struct("<BQQq")
_PING = struct.Struct("<BQq")
_PONG = struct.Struct("<BQqq")


def micros(seconds: float) -> int:
    """Return a time of a monotonic clock as it is sent, µs."""
    return round(seconds * 1e6)


class UpEnvelope(NamedTuple):
    """Beside the frames of a station."""

    session: int
    """Of its ground process."""
    number: int
    """One more in each sample of the station to the same system."""
    sent: int
    """When the frames arrived at the ground process, µs of its clock."""

    def encode(self) -> bytes:
        """Return the attachment."""
        return _UP.pack(ENVELOPE_VERSION, *self)

    @classmethod
    def decode(cls, data: bytes) -> Self | None:
        """Return the envelope in an attachment; None: there is none of this version."""
        return None if not _is_version(data, _UP) else cls(*_UP.unpack(data)[1:])


class Ping(NamedTuple):
    """Payload of a gateway's ping."""

    session: int
    """Of the gateway."""
    sent: int
    """µs of the gateway's clock."""

    def encode(self) -> bytes:
        """Return the payload."""
        return _PING.pack(ENVELOPE_VERSION, *self)

    @classmethod
    def decode(cls, data: bytes) -> Self | None:
        """Return the ping in a payload; None: there is none of this version."""
        return None if not _is_version(data, _PING) else cls(*_PING.unpack(data)[1:])


class Pong(NamedTuple):
    """Payload of a station's answer to a ping."""

    session: int
    """Of the gateway, repeated."""
    ping_sent: int
    """µs of the gateway's clock, repeated."""
    answered: int
    """µs of the station's clock."""

    def encode(self) -> bytes:
        """Return the payload."""
        return _PONG.pack(ENVELOPE_VERSION, *self)

    @classmethod
    def decode(cls, data: bytes) -> Self | None:
        """Return the pong in a payload; None: there is none of this version."""
        return None if not _is_version(data, _PONG) else cls(*_PONG.unpack(data)[1:])


def _is_version(data: bytes, form: struct.Struct) -> bool:
    return len(data) == form.size and data[0] == ENVELOPE_VERSION


def split_frames(sample: bytes) -> Iterator[bytes]:
    """Yield the whole frames of a sample, by their lengths alone.

    The rest behind anything else is dropped.
    """
    position = 0
    while position < len(sample):
        head = sample[position : position + HEADER_2]
        if len(head) < HEADER_1 or head[0] not in (MAGIC_1, MAGIC_2):
            return
        if head[0] == MAGIC_1:
            length = HEADER_1 + head[1] + CHECKSUM
        else:
            length = HEADER_2 + head[1] + CHECKSUM + (SIGNATURE if head[2] & SIGNED else 0)
        if position + length > len(sample):
            return
        yield sample[position : position + length]
        position += length


class FrameNumbers:
    """Counts the frames missing between those that arrive, by MAVLink sequence numbers."""

    def __init__(self) -> None:
        self._newest: dict[bytes, int] = {}
        """Of each system and component."""

    def missing(self, raw: bytes) -> int:
        """Return how many frames of its sender are missing before a frame.

        256 at once look like none.
        """
        at = 4 if raw[0] == MAGIC_2 else 2
        number, sender = raw[at], raw[at + 1 : at + 3]
        newest = self._newest.get(sender)
        self._newest[sender] = number
        return 0 if newest is None else (number - newest - 1) & 0xFF


def sender_of(raw: bytes) -> int:
    """Return the system id of a frame's sender."""
    return raw[5 if raw[0] == MAGIC_2 else 3]

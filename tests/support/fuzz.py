"""Frames that no one would send: any message with random content, damaged ones among them."""

from __future__ import annotations

import itertools
import random
import struct
from collections.abc import Iterator, Sequence
from typing import Any

from pymavlink.generator.mavcrc import x25crc

from anafi_mav.mavlink import dialect

LONGEST = 280
"""Bytes of a frame with the longest payload and a signature (MAVLink serialization.md)."""


def framed(id: int, payload: bytes, sequence: int) -> bytes:
    """A frame of MAVLink 2 with a right checksum (MAVLink serialization.md)."""
    head = struct.pack("<BBBBBBB", len(payload), 0, 0, sequence, 255, 190, id & 0xFF) + struct.pack("<H", id >> 8)
    crc = x25crc(head + payload)
    crc.accumulate(bytes([dialect.mavlink_map[id].crc_extra]))
    return b"\xfd" + head + payload + struct.pack("<H", crc.crc)


SIZES = {"char": 1, "int8_t": 1, "uint8_t": 1, "int16_t": 2, "uint16_t": 2, "int32_t": 4, "uint32_t": 4, "float": 4}
SIZES |= {"int64_t": 8, "uint64_t": 8, "double": 8, "uint8_t_mavlink_version": 1}


def offset(kind: Any, name: str) -> int:
    """Where a field of one byte stands in the payload."""
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    place = 0
    for field, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
        if field == name:
            return place
        place += SIZES[types[field]] * (length or 1)
    raise KeyError(name)


EVERY = tuple(sorted(dialect.mavlink_map.keys() - {dialect.MAVLINK_MSG_ID_SETUP_SIGNING}))
"""Without the message that locks out a client without its key, as it should: test_signing_setup.py has random ones."""


def random_frames(source: random.Random, ids: Sequence[int] = EVERY, component: int | None = None) -> Iterator[bytes]:
    """Well-formed frames of these messages, two thirds of them to our system, and damaged ones.

    `component`: all of them are to it, so that none is a command to the autopilot.
    """
    for count in itertools.count():
        id = source.choice(ids)
        kind = dialect.mavlink_map[id]
        size = struct.calcsize(kind.unpacker.format)
        payload = bytearray(source.randbytes(size))
        for name, target in (("target_system", 1), ("target_component", source.choice((1, 1, 100)))):
            if name in kind.ordered_fieldnames and source.random() < 0.67:
                payload[offset(kind, name)] = target
        if component is not None and "target_component" in kind.ordered_fieldnames:
            payload[offset(kind, "target_component")] = component
        frame = framed(id, bytes(payload).rstrip(b"\0") or b"\0", count % 256)
        if source.random() < 0.2:
            damaged = bytearray(frame)
            for _ in range(source.randint(1, 3)):
                damaged[source.randrange(len(damaged))] = source.randrange(256)
            frame = bytes(damaged[: source.randint(1, len(damaged))])
        yield frame

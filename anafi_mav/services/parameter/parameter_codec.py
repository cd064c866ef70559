"""Encodings of parameters: PARAM_VALUE's float, QGroundControl's hash, packed files.

No I/O. The meaning of the parameters is elsewhere.
"""

from __future__ import annotations

import enum
import math
import struct
from collections.abc import Iterable, Sequence

from anafi_mav.mavlink import dialect
from anafi_mav.services.checksum import crc32

NAME_LENGTH = 16
"""Characters of a param_id: a name of this length fills the field, without a NUL (MAVLink parameter.md)."""

NO_INDEX = 0xFFFF
"""param_index of a PARAM_VALUE that stands in no list."""

HASH_NAME = "_HASH_CHECK"

PACKED_MAGIC = 0x671B
"""First word of a packed parameter file without defaults (ArduPilot AP_Filesystem README.md)."""


class ParamType(enum.Enum):
    """The type of a value: MAV_PARAM_TYPE, its struct code, and its number in a packed file."""

    INT8 = (dialect.MAV_PARAM_TYPE_INT8, "b", 1)
    INT16 = (dialect.MAV_PARAM_TYPE_INT16, "h", 2)
    INT32 = (dialect.MAV_PARAM_TYPE_INT32, "i", 3)
    REAL32 = (dialect.MAV_PARAM_TYPE_REAL32, "f", 4)
    UINT32 = (dialect.MAV_PARAM_TYPE_UINT32, "I", 0)
    """Of the hash only."""

    def __init__(self, mav: int, code: str, packed: int) -> None:
        self.mav = mav
        self.packed = packed
        self.whole = code != "f"
        """Values are integers."""
        self._struct = struct.Struct("<" + code)
        bits = 8 * self._struct.size
        self.limits: tuple[float, float] = (-math.inf, math.inf)
        """The smallest and the largest value that the type can hold."""
        if self.whole:
            self.limits = (0, 2**bits - 1) if code == "I" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)

    def to_bytes(self, value: float) -> bytes:
        """The value as it lies in memory, little endian.

        Raises `struct.error` for one that does not fit.
        """
        return self._struct.pack(round(value) if self.whole else value)

    def is_same(self, one: float, other: float) -> bool:
        """Return True for two values that are equal on the wire.

        0.45 is another number in single precision.
        """
        return one == other if self.whole else self.to_bytes(one) == self.to_bytes(other)

    def from_bytes(self, data: bytes) -> float:
        """The value that lies at the beginning of these bytes."""
        (value,) = self._struct.unpack_from(data)
        return float(value)


class ParamValue(dialect.MAVLink_param_value_message):
    """PARAM_VALUE whose `param_value` is the 32 bits of the field.

    A Python float cannot carry them all: on its way through a double the bits of a signalling NaN change, and the bits
    of an integer, or of a hash, can look like one.
    """

    unpacker = struct.Struct("<IHH16sB")


def carrier(value: float, kind: ParamType, *, bytewise: bool) -> int:
    """The 32 bits of the float field that carries a value.

    Bytewise (PX4): the value's own bytes. Otherwise (ArduPilot) the float of equal value. MAVLink parameter.md
    §Parameter Encoding.
    """
    data = kind.to_bytes(value) if bytewise else struct.pack("<f", round(value) if kind.whole else value)
    return int.from_bytes(data, "little")


def carried(field: float, kind: ParamType, *, bytewise: bool) -> float:
    """The value in the float field of a PARAM_SET.

    NaN for a whole number that the field does not hold.
    """
    if bytewise:
        return kind.from_bytes(struct.pack("<f", field))
    if kind.whole:
        return float(round(field)) if math.isfinite(field) else math.nan
    return field


def param_value(
    name: str, value: float, kind: ParamType, *, count: int, index: int, bytewise: bool
) -> dialect.MAVLink_message:
    """A PARAM_VALUE."""
    bits = carrier(value, kind, bytewise=bytewise)
    return ParamValue(name.encode(), bits, kind.mav, count, index)


def name_of(param_id: str | bytes) -> str:
    """The name in a param_id field."""
    text = param_id.decode(errors="replace") if isinstance(param_id, bytes) else param_id
    return text.split("\0", 1)[0]


def hash_check(values: Iterable[tuple[str, float, ParamType]]) -> int:
    """The hash by which QGroundControl knows that its cache is still true.

    CRC-32 over name and raw value of one parameter after the other, sorted by name; those whose metadata calls them
    volatile are left out (QGroundControl ParameterManager.cc _tryCacheHashLoad).
    """
    crc = 0
    for name, value, kind in sorted(values, key=lambda item: item[0]):
        crc = crc32(name.encode() + kind.to_bytes(value), crc)
    return crc


def packed_file(values: Sequence[tuple[str, float, ParamType]], start: int = 0, count: int | None = None) -> bytes:
    """Return ArduPilot's `@PARAM/param.pck` of these values.

    Of all, or of `count` of them from `start` on. The values keep their sequence. Header: magic, number of values in
    the file, number of all. Each value: type and flags, number of characters in common with the name before (low
    nibble) and of others less one (high nibble), those others, the value (AP_Filesystem README.md). ArduPilot pads,
    lest a value that changes between two reads of a block is torn; this file is read as it was when it was opened,
    and needs no padding. Defaults are not included: a drone does not report its own.
    """
    chosen = values[start:] if count is None else values[start : start + count]
    parts = [struct.pack("<HHH", PACKED_MAGIC, len(chosen), len(values))]
    before = ""
    for name, value, kind in chosen:
        common = 0
        while common < min(len(before), len(name) - 1, 15) and before[common] == name[common]:
            common += 1
        rest = name[common:].encode()
        parts.append(bytes((kind.packed, common | len(rest) - 1 << 4)) + rest + kind.to_bytes(value))
        before = name
    return b"".join(parts)

"""Values of extended parameters: their types, 128-byte fields, and texts in a file. No I/O."""

from __future__ import annotations

import enum
import math
import struct

from anafi_mav.mavlink import dialect

VALUE_LENGTH = 128
"""Bytes of a param_value; a value lies at its beginning, little endian (MAVLink parameter_ext.md)."""

NAME_LENGTH = 15
"""Longest name. A param_id has 16 characters and needs no NUL, but QGroundControl writes one all the same
(QGCCameraIO.cc _sendParameter)."""

FIELD_LENGTH = 16
"""Characters of a param_id."""

DECIMALS = 6
"""Of a number in the definition file. MAVSDK prints a float with as many and looks the text up among the options: a
value with more digits would not be found again (param_value.cpp get_string)."""


class ExtType(enum.Enum):
    """Type of a value: MAV_PARAM_EXT_TYPE, its struct code, and its name in a definition file."""

    CHOICE = (dialect.MAV_PARAM_EXT_TYPE_INT32, "i", "int32", True)
    """Number of a named option. A byte would hold it, but MAVSDK notices changes of int32 and float only ("Type and
    callback mismatch" for others, mavlink_parameter_subscription.cpp): it kept showing the value of before."""
    INT32 = (dialect.MAV_PARAM_EXT_TYPE_INT32, "i", "int32")
    UINT32 = (dialect.MAV_PARAM_EXT_TYPE_UINT32, "I", "uint32")
    REAL32 = (dialect.MAV_PARAM_EXT_TYPE_REAL32, "f", "float")

    def __init__(self, mav: int, code: str, xml: str, is_choice: bool = False) -> None:
        self.mav = mav
        self.xml = xml
        self.is_choice = is_choice
        self._struct = struct.Struct("<" + code)

    @property
    def is_whole(self) -> bool:
        """Values are integers."""
        return self is not ExtType.REAL32

    def normalise(self, value: float) -> float:
        """Return the value as both ends hold it: a whole number, or a float of `DECIMALS` decimals.

        Raises `ValueError` for one that the type cannot hold.
        """
        try:
            (held,) = self._struct.unpack(self._struct.pack(self._number(value)))
        except (struct.error, OverflowError, ValueError) as error:
            raise ValueError(f"{value} is no {self.xml}") from error
        return float(held)

    def held(self, value: float) -> float | None:
        """Return a reported value as both ends hold it; None for one that the type cannot hold."""
        try:
            return self.normalise(value) if math.isfinite(value) else None
        except ValueError:
            return None

    def encode(self, value: float) -> bytes:
        """Return the field of a message."""
        return self._struct.pack(self._number(value)).ljust(VALUE_LENGTH, b"\0")

    def decode(self, field: bytes) -> float | None:
        """Return the value in a field as both ends hold it; None for NaN and infinities."""
        (value,) = self._struct.unpack(field[: self._struct.size].ljust(self._struct.size, b"\0"))
        return self.normalise(value) if math.isfinite(value) else None

    def text(self, value: float) -> str:
        """Return the value as the definition file has it."""
        return str(round(value)) if self.is_whole else f"{value:.{DECIMALS}f}"

    def _number(self, value: float) -> float:
        return round(value) if self.is_whole else round(value, DECIMALS)

"""MAVLink's CRC-32 of files and parameters. No I/O."""

from __future__ import annotations

import zlib


def crc32(data: bytes, crc: int = 0) -> int:
    """Return MAVLink's CRC-32 (MAVLink crc.md).

    It is the common one without its inversions at the beginning and at the end.
    """
    return zlib.crc32(data, crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF

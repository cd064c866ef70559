"""Size of the pictures of an H.264 stream, by its sequence parameter set. No I/O.

Syntax: ITU-T H.264 7.3.2.1.1.
"""

from __future__ import annotations

MAX_BYTES = 256
"""Of a parameter set that is read: one with all scaling lists has some 200."""
MAX_SIDE = 16384
"""Pixels of a side: level 6.2, the largest of the standard."""
MAX_ZEROS = 31
"""Leading zeros of an Exp-Golomb number: its values are below 2^32."""

_MACROBLOCK = 16
_WITH_CHROMA = frozenset({100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135})
"""profile_idc of the profiles that name their chroma format."""


class _Bits:
    """Reads a NAL unit's payload bit by bit. Raises `IndexError` at its end."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._at = 0

    def u(self, count: int) -> int:
        value = 0
        for _ in range(count):
            value = value << 1 | self._payload[self._at >> 3] >> (7 - (self._at & 7)) & 1
            self._at += 1
        return value

    def ue(self) -> int:
        zeros = 0
        while not self.u(1):
            zeros += 1
            if zeros > MAX_ZEROS:
                raise IndexError
        return (1 << zeros) - 1 + self.u(zeros)

    def se(self) -> int:
        number = self.ue()
        return (number + 1) // 2 if number & 1 else -(number // 2)


def picture_size(sps: bytes) -> tuple[int, int] | None:
    """Return width and height of the pictures, or None when the unit is none or cannot be read."""
    if not 4 <= len(sps) <= MAX_BYTES or sps[0] & 0x1F != 7:
        return None
    try:
        width, height = _size(_Bits(sps[1:].replace(b"\0\0\3", b"\0\0")))
    except IndexError:
        return None
    return (width, height) if 0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE else None


def _size(bits: _Bits) -> tuple[int, int]:
    profile = bits.u(8)
    bits.u(16)  # constraints and level
    bits.ue()  # id
    chroma = 1
    if profile in _WITH_CHROMA:
        chroma = bits.ue()
        if chroma == 3 and bits.u(1):  # three separate planes
            chroma = 0
        bits.ue()
        bits.ue()
        bits.u(1)
        if bits.u(1):
            _skip_scaling_lists(bits, 12 if chroma == 3 else 8)
    bits.ue()
    order = bits.ue()
    if order == 0:
        bits.ue()
    elif order == 1:
        bits.u(1)
        bits.se()
        bits.se()
        for _ in range(bits.ue()):
            bits.se()
    bits.ue()
    bits.u(1)
    columns, rows = bits.ue() + 1, bits.ue() + 1
    fields = 1 if bits.u(1) else 2
    if fields == 2:
        bits.u(1)
    bits.u(1)
    left = right = top = bottom = 0
    if bits.u(1):
        left, right, top, bottom = (bits.ue() for _ in range(4))
    across, down = {1: (2, 2), 2: (2, 1)}.get(chroma, (1, 1))
    return (
        columns * _MACROBLOCK - across * (left + right),
        rows * fields * _MACROBLOCK - down * fields * (top + bottom),
    )


def _skip_scaling_lists(bits: _Bits, count: int) -> None:
    for number in range(count):
        if not bits.u(1):
            continue
        last = following = 8
        for _ in range(16 if number < 6 else 64):
            if following:
                following = (last + bits.se()) % 256
            last = following or last

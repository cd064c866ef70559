"""Simulated camera picture, sky above ground, as an H.264 stream of a few kB a second.

Constrained baseline (ITU-T H.264), one slice a picture, CAVLC. A key picture is predicted from its first macroblock
and from the one at the left end of the horizon, the only two with a residual; every other macroblock takes 7 or 8
bits. The pictures between repeat the one before: a slice that skips all macroblocks, some ten bytes.
"""

from __future__ import annotations

from functools import cached_property, lru_cache

from anafi_mav.errors import LocalProtocolError

KEY_INTERVAL = 30
"""Pictures from one key picture to the next: a second."""
FRAME_RATE = 30
"""Pictures a second, as the stream says of itself."""

_LEVELS = ((99, 10), (396, 11), (1620, 30), (3600, 31), (8192, 40), (36864, 51))
"""Largest picture in macroblocks -> level_idc that has it 30 times a second (H.264 table A-1)."""
_FRAME_NUM_BITS = 4
"""Of frame_num: it counts to 16."""
_KEY, _BETWEEN, _SPS, _PPS = 5, 1, 7, 8
"""Types of NAL units."""
_QP_DELTA = 10
"""Quantiser 36: one step of a DC coefficient is 2.5 steps of brightness."""
_SKY, _GROUND = 16, -32
"""Residuals in those steps: 128 + 40 for the sky, 80 less for the ground."""


class _Bits:
    """A row of bits, first the highest."""

    def __init__(self) -> None:
        self._text: list[str] = []

    def u(self, bits: int, value: int) -> None:
        self._text.append(f"{value:0{bits}b}")

    def ue(self, value: int) -> None:
        """Exp-Golomb."""
        code = f"{value + 1:b}"
        self._text.append("0" * (len(code) - 1) + code)

    def se(self, value: int) -> None:
        """Signed Exp-Golomb."""
        self.ue(2 * value - 1 if value > 0 else -2 * value)

    def raw(self, text: str) -> None:
        self._text.append(text)

    def unit(self, importance: int, kind: int) -> bytes:
        """A NAL unit: the stop bit, and a 3 where two zeros would be taken for a start code."""
        text = "".join(self._text) + "1"
        text += "0" * (-len(text) % 8)
        payload = int(text, 2).to_bytes(len(text) // 8, "big")
        escaped = bytearray((importance << 5 | kind,))
        zeros = 0
        for byte in payload:
            if zeros == 2 and byte <= 3:
                escaped.append(3)
                zeros = 0
            escaped.append(byte)
            zeros = zeros + 1 if byte == 0 else 0
        return bytes(escaped)


def _residual(level: int) -> str:
    """Intra16x16DCLevel with `level` as its only coefficient, the first (H.264 9.2)."""
    if level == 0:
        return "1"  # coeff_token: none
    # coeff_token: one coefficient, no trailing ones, no coefficients around; total_zeros: none.
    token, zeros = "000101", "1"
    # The first level without trailing ones counts from 2 on (9.2.2.1).
    code = (2 * level - 2 if level > 0 else -2 * level - 1) - 2
    if code < 14:
        return token + "0" * code + "1" + zeros
    if code < 30:
        return token + "0" * 14 + "1" + f"{code - 14:04b}" + zeros
    return token + "0" * 15 + "1" + f"{code - 30:012b}" + zeros


class Pictures:
    """The pictures of one size."""

    def __init__(self, width: int, height: int) -> None:
        """Pixels, even. Raises `LocalProtocolError` for a size that no level has."""
        self.width, self.height = width, height
        self._columns, self._rows = -(-width // 16), -(-height // 16)
        blocks = self._columns * self._rows
        level = next((level for largest, level in _LEVELS if blocks <= largest), None)
        if level is None or blocks == 0 or width % 2 or height % 2:
            raise LocalProtocolError(f"no picture has {width} x {height} pixels")
        self._level = level

    @cached_property
    def sps(self) -> bytes:
        """The sequence parameter set."""
        bits = _Bits()
        bits.u(8, 66)  # baseline
        bits.u(8, 0b11000000)  # constrained
        bits.u(8, self._level)
        bits.ue(0)
        bits.ue(_FRAME_NUM_BITS - 4)
        bits.ue(2)  # pictures are shown in the order they are sent
        bits.ue(1)  # one reference picture
        bits.u(1, 0)
        bits.ue(self._columns - 1)
        bits.ue(self._rows - 1)
        bits.u(1, 1)  # frames, no fields
        bits.u(1, 1)
        right, below = self._columns * 16 - self.width, self._rows * 16 - self.height
        bits.u(1, int(bool(right or below)))
        if right or below:
            for crop in (0, right // 2, 0, below // 2):
                bits.ue(crop)
        bits.u(1, 1)  # video usability information
        bits.u(4, 0)  # no aspect ratio, overscan, signal type or chroma place
        bits.u(1, 1)  # timing: two ticks a picture, at a fixed rate
        bits.u(32, 1)
        bits.u(32, 2 * FRAME_RATE)
        bits.u(1, 1)
        bits.u(3, 0)  # no buffering parameters, no picture structure
        bits.u(1, 1)  # bitstream restriction: nothing is reordered, one picture is kept
        bits.u(1, 1)
        for value in (0, 0, 16, 16, 0, 1):
            bits.ue(value)
        return bits.unit(3, _SPS)

    @cached_property
    def pps(self) -> bytes:
        """The picture parameter set."""
        bits = _Bits()
        bits.ue(0)
        bits.ue(0)
        bits.u(2, 0)  # CAVLC
        bits.ue(0)
        bits.ue(0)
        bits.ue(0)
        bits.u(3, 0)
        bits.se(0)
        bits.se(0)
        bits.se(0)
        bits.u(1, 1)  # each slice says whether it is deblocked
        bits.u(2, 0)
        return bits.unit(3, _PPS)

    def units(self, number: int) -> list[bytes]:
        """The NAL units of picture `number` of a stream, which begins with a key picture."""
        gop, place = divmod(number, KEY_INTERVAL)
        if place == 0:
            return [self.sps, self.pps, self._key(gop % 2)]
        return [self._between(place % (1 << _FRAME_NUM_BITS))]

    @lru_cache(maxsize=2)  # noqa: B019 # sizes are few and live as long as the process
    def _key(self, id: int) -> bytes:
        bits = _Bits()
        self._slice(bits, 7, 0)
        bits.ue(id)
        bits.u(2, 0)
        self._quality(bits)
        horizon = self._rows // 2
        starts = {horizon: _macroblock(2, _GROUND)} | {0: _macroblock(2, _SKY)}
        for row in range(self._rows):
            # Below the first, rows are like the one above, the ground's first like its own left end.
            pattern = _macroblock(1 if row in (0, horizon) else 0, 0)
            left = starts.get(row, pattern)
            bits.raw(left + pattern * (self._columns - 1))
        return bits.unit(3, _KEY)

    @lru_cache(maxsize=1 << _FRAME_NUM_BITS)  # noqa: B019
    def _between(self, frame_num: int) -> bytes:
        bits = _Bits()
        self._slice(bits, 5, frame_num)
        bits.u(3, 0)  # the parameter set's number of references, their order, no marking
        self._quality(bits)
        bits.ue(self._columns * self._rows)  # as many macroblocks are skipped
        return bits.unit(2, _BETWEEN)

    def _slice(self, bits: _Bits, kind: int, frame_num: int) -> None:
        bits.ue(0)
        bits.ue(kind)
        bits.ue(0)
        bits.u(_FRAME_NUM_BITS, frame_num)

    def _quality(self, bits: _Bits) -> None:
        bits.se(_QP_DELTA)
        bits.ue(1)  # no deblocking


def _macroblock(prediction: int, level: int) -> str:
    """Encode an intra 16x16 macroblock with one DC coefficient.

    Prediction is from above (0), from the left (1) or from both (2).
    """
    bits = _Bits()
    bits.ue(1 + prediction)
    bits.ue(0 if prediction == 2 else 2 - prediction)  # chroma likewise: 2 is from above, 1 from the left
    bits.se(0)
    bits.raw(_residual(level))
    return "".join(bits._text)


@lru_cache(maxsize=16)
def pictures(width: int, height: int) -> Pictures:
    """The pictures of a size, made once."""
    return Pictures(width, height)

"""H.264 encoder for pictures of coloured cells, in pure Python.

Constrained baseline (ITU-T H.264), one slice a picture, CAVLC, no deblocking. A cell has 4 x 4 pixels of one colour of
`PALETTE`, so that a macroblock is 16 numbers: their differences to its neighbour are the Intra16x16 DC coefficients,
the only ones that are coded. The colours are chosen so that these are whole numbers and a decoder shows the palette
exactly: nothing is rounded, and no error adds up.

A key picture codes every macroblock. A picture between codes those that have changed and skips the others (P_Skip).
"""

from __future__ import annotations

import re
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from anafi_mav.errors import LocalProtocolError
from anafi_mav.sim.video.camera_view import FRAME_RATE
from anafi_mav.sim.video.cavlc import chroma_dc, luma_dc, se, ue

CELL = 4
"""Pixels of a cell's side."""

Cells = npt.NDArray[np.uint8]
"""A picture as rows of cells: numbers of colours."""
Blocks = npt.NDArray[np.uint8]
"""A picture as macroblocks of 16 cells, row by row; shape (macroblocks, 16)."""


class CellColour(NamedTuple):
    """A colour, in whole steps of the quantiser from the middle, 128: 40 of luma, 16 of chroma."""

    luma: int
    blue: int
    red: int


SKY, GROUND, DARK, LIGHT, HORIZON, COLD, WARM = range(7)
"""Numbers of colours: sky, ground, text's background, text, the line between sky and ground, and sky and ground of a
thermal picture."""

PALETTE = (
    *(CellColour(1, 2, -1), CellColour(-1, -1, 0), CellColour(-2, 0, 0), CellColour(2, 0, 0), CellColour(3, 0, 0)),
    *(CellColour(-2, 2, 1), CellColour(1, -3, 2)),
)

_LEVELS = ((99, 10), (396, 11), (1620, 30), (3600, 31), (8192, 40), (36864, 51))
"""Largest picture in macroblocks -> level_idc that has it 30 times a second (H.264 table A-1)."""
_FRAME_NUM_BITS = 4
"""Of frame_num: it counts to 16."""
_KEY, _BETWEEN, _SPS, _PPS = 5, 1, 7, 8
"""Types of NAL units."""
_QP_DELTA = 10
"""Quantiser 36: one step of a luma DC coefficient is 2.5 steps of brightness, of chroma (34) 4 (8.5.10, 8.5.11)."""
_INTRA_IN_P = 5
"""mb_type of the first intra macroblock of a P slice (table 7-13)."""

_VERTICAL, _HORIZONTAL, _DC = 0, 1, 2
"""Intra16x16PredMode (table 8-4)."""
_CHROMA_MODE = {_VERTICAL: 2, _HORIZONTAL: 1, _DC: 0}
"""intra_chroma_pred_mode (table 8-5)."""
_ZIGZAG = (0, 1, 4, 8, 5, 2, 3, 6, 9, 12, 13, 10, 7, 11, 14, 15)
_HADAMARD = np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1]], dtype=np.int32)
_HADAMARD_2 = np.array([[1, 1], [1, -1]], dtype=np.int32)
_STEPS = np.array(PALETTE, dtype=np.int32)

MAX_KNOWN = 1 << 14
"""Macroblocks whose code is kept, with the neighbour that they are predicted from: 3 MB. A flight in every attitude
has some thousand."""

_START_CODE = re.compile(rb"\0\0(?=[\0-\3])")


def _unit(importance: int, kind: int, text: str) -> bytes:
    """Return a NAL unit: the stop bit, and a 3 where two zeros would be taken for a start code."""
    text += "1"
    text += "0" * (-len(text) % 8)
    payload = int(text, 2).to_bytes(len(text) // 8, "big")
    return bytes((importance << 5 | kind,)) + _START_CODE.sub(b"\0\0\3", payload)


class PictureEncoder:
    """Encodes pictures of one size."""

    def __init__(self, width: int, height: int) -> None:
        """Pixels, even. Raises `LocalProtocolError` for a size that no level has."""
        self.width, self.height = width, height
        self._columns, self._rows = -(-width // 16), -(-height // 16)
        blocks = self._columns * self._rows
        level = next((level for largest, level in _LEVELS if blocks <= largest), None)
        if level is None or blocks == 0 or width % 2 or height % 2:
            raise LocalProtocolError(f"no picture has {width} x {height} pixels")
        self._level = level
        self.cells = (self._rows * 4, self._columns * 4)
        """Rows and columns of cells; those at the lower and right edge may be cropped."""

    @cached_property
    def sps(self) -> bytes:
        """The sequence parameter set."""
        right, below = self._columns * 16 - self.width, self._rows * 16 - self.height
        crop = "1" + "".join(map(ue, (0, right // 2, 0, below // 2))) if right or below else "0"
        return _unit(
            3,
            _SPS,
            f"{66:08b}11000000{self._level:08b}"  # baseline, constrained
            + ue(0)
            + ue(_FRAME_NUM_BITS - 4)
            + ue(2)  # pictures are shown in the order they are sent
            + ue(1)  # one reference picture
            + "0"
            + ue(self._columns - 1)
            + ue(self._rows - 1)
            + "11"  # frames, no fields
            + crop
            + "10000"  # video usability information; no aspect ratio, overscan, signal type or chroma place
            + f"1{1:032b}{2 * FRAME_RATE:032b}1"  # timing: two ticks a picture, at a fixed rate
            + "000"  # no buffering parameters, no picture structure
            + "11"  # bitstream restriction: nothing is reordered, one picture is kept
            + "".join(map(ue, (0, 0, 16, 16, 0, 1))),
        )

    @cached_property
    def pps(self) -> bytes:
        """The picture parameter set."""
        return _unit(
            3,
            _PPS,
            ue(0)
            + ue(0)
            + "00"  # CAVLC
            + ue(0)
            + ue(0)
            + ue(0)
            + "000"
            + se(0)
            + se(0)
            + se(0)
            + "100",  # each slice says whether it is deblocked
        )

    def blocks(self, cells: Cells) -> Blocks:
        """Return a picture as the macroblocks that `key` and `between` take."""
        rows, columns = self._rows, self._columns
        fours = np.ascontiguousarray(cells).view(np.uint32).reshape(rows, 4, columns)
        blocks: Blocks = fours.transpose(0, 2, 1).copy().view(np.uint8).reshape(rows * columns, 16)
        return blocks

    def key(self, blocks: Blocks, id: int) -> bytes:
        """Return a key picture; `id` differs from that of the key picture before it."""
        head = ue(0) + ue(7) + ue(0) + "0" * _FRAME_NUM_BITS + ue(id) + "00" + _quality()
        coded = self._coded(blocks, range(len(blocks)))
        return _unit(3, _KEY, head + "".join([intra for intra, _ in coded]))

    def between(self, blocks: Blocks, before: Blocks, frame_num: int) -> bytes:
        """Return a picture that changes `before` into `blocks`.

        `frame_num` counts from the key picture.
        """
        head = ue(0) + ue(5) + ue(0) + f"{frame_num % (1 << _FRAME_NUM_BITS):0{_FRAME_NUM_BITS}b}000" + _quality()
        changed = np.flatnonzero((blocks.view(np.uint64) != before.view(np.uint64)).any(axis=1)).tolist()
        text, next_block = [head], 0
        for block, (_, inter) in zip(changed, self._coded(blocks, changed), strict=True):
            text += ue(block - next_block), inter
            next_block = block + 1
        if next_block < len(blocks):
            text.append(ue(len(blocks) - next_block))
        return _unit(2, _BETWEEN, "".join(text))

    def _coded(self, blocks: Blocks, numbers: range | list[int]) -> list[tuple[str, str]]:
        """Return the codes of macroblocks, for key pictures and for those between."""
        data, columns = blocks.tobytes(), self._columns
        coded = []
        for number in numbers:
            at = 16 * number
            own = data[at : at + 16]
            if number % columns:
                coded.append(_macroblock(_HORIZONTAL, data[at - 16 : at], own))
            elif number:
                above = at - 16 * columns
                coded.append(_macroblock(_VERTICAL, data[above : above + 16], own))
            else:
                coded.append(_macroblock(_DC, b"", own))
        return coded


def _quality() -> str:
    """Return the end of a slice header: quantiser, no deblocking."""
    return se(_QP_DELTA) + ue(1)


@lru_cache(maxsize=MAX_KNOWN)
def _macroblock(prediction: int, neighbour: bytes, own: bytes) -> tuple[str, str]:
    """Encode an intra 16x16 macroblock of 16 cells, predicted from its neighbour.

    The first one of a picture has no neighbour: it is predicted as grey.
    """
    cells = _steps(own)
    difference = cells.copy()
    if prediction == _HORIZONTAL:
        difference -= _steps(neighbour)[:, 3:, :]
        beside = _steps(neighbour)[::2, 2:3, 1:]
    elif prediction == _VERTICAL:
        difference -= _steps(neighbour)[3:, :, :]
        beside = _steps(neighbour)[2:3, ::2, 1:]
    else:
        beside = np.zeros((1, 1, 2), dtype=np.int32)
    # A cell is 16 steps of the coefficients times its difference, and the transform's gain is 16.
    luma = (_HADAMARD @ difference[:, :, 0] @ _HADAMARD).ravel().tolist()
    # Chroma has half as many cells in each direction: the upper left one of four counts. Its gain is 4, as is its step.
    chroma = [
        (_HADAMARD_2 @ plane @ _HADAMARD_2).ravel().tolist()
        for plane in np.moveaxis(cells[::2, ::2, 1:] - beside, 2, 0)
    ]
    coloured = any(map(any, chroma))
    kind = 1 + prediction + (4 if coloured else 0)
    rest = ue(_CHROMA_MODE[prediction]) + se(0) + luma_dc([luma[place] for place in _ZIGZAG])
    if coloured:
        rest += "".join(map(chroma_dc, chroma))
    return ue(kind) + rest, ue(_INTRA_IN_P + kind) + rest


def _steps(cells: bytes) -> npt.NDArray[np.int32]:
    """Return the colours of 16 cells in steps; shape (4, 4, 3)."""
    steps: npt.NDArray[np.int32] = _STEPS[np.frombuffer(cells, np.uint8)].reshape(4, 4, 3)
    return steps


@lru_cache(maxsize=16)
def encoder(width: int, height: int) -> PictureEncoder:
    """Return the encoder of a size, made once."""
    return PictureEncoder(width, height)

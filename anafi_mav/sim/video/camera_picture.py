"""The simulated camera's picture, drawn for people and tests.

From top to bottom: the name, the time and the number of the picture; the compass; sky, horizon and ground; heading,
pitch and roll of the camera; and a strip of 32 blocks, light or dark. The blocks are the bits of one number, the
highest first: 12 of the picture's number, then 20 of its time in ms. A small picture has number, horizon and strip.

All of it is drawn in the cells of `h264`, 4 x 4 pixels each.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from anafi_mav.arsdk.video.video_metadata import Quaternion
from anafi_mav.sim.video.camera_view import CameraView
from anafi_mav.sim.video.h264 import CELL, COLD, DARK, GROUND, HORIZON, LIGHT, SKY, WARM, Blocks, Cells, encoder
from anafi_mav.units import DEG_PER_RAD, euler_from_quaternion, wrap_360

STRIP_BITS, NUMBER_BITS, TIME_BITS = 32, 12, 20
"""Blocks of the strip: of the number, which counts to 4096, and of the time in ms, which counts to 17 minutes."""

TOP, COMPASS, BOTTOM, STRIP = 12, 12, 12, 8
"""Height of the bands, cells."""
SMALL_STRIP = 3
WIDE = 200
"""Cells of a picture's width from which it has text."""
TICK, LABEL = 10, 30
"""deg between ticks and between labels of the compass."""

COLOURS = {"visible": (SKY, GROUND), "thermal": (COLD, WARM), "blended": (SKY, WARM)}
"""Spectrum: colours of sky and ground."""

_GLYPH_WIDTH, _GLYPH_HEIGHT = 5, 7
_GLYPHS = {
    " ": "00000000000000",
    "0": "0E11131519110E", "1": "040C040404040E", "2": "0E11010608101F", "3": "1F02040201110E",
    "4": "02060A121F0202", "5": "1F101E0101110E", "6": "0608101E11110E", "7": "1F010204080808",
    "8": "0E11110E11110E", "9": "0E11110F01020C",
    "A": "0E11111F111111", "B": "1E11111E11111E", "C": "0E11101010110E", "D": "1E11111111111E",
    "E": "1F10101E10101F", "F": "1F10101E101010", "G": "0E11101711110F", "H": "1111111F111111",
    "I": "0E04040404040E", "J": "0702020202120C", "K": "11121418141211", "L": "1010101010101F",
    "M": "111B1515111111", "N": "11191513111111", "O": "0E11111111110E", "P": "1E11111E101010",
    "Q": "0E11111115120D", "R": "1E11111E141211", "S": "0F10100E01011E", "T": "1F040404040404",
    "U": "1111111111110E", "V": "11111111110A04", "W": "11111115151B11", "X": "11110A040A1111",
    "Y": "11110A04040404", "Z": "1F01020408101F",
    ".": "00000000000C0C", "-": "0000001F000000", "+": "0004041F040400", "_": "0000000000001F",
    "#": "0A0A1F0A1F0A0A", "?": "0E110102040004",
}  # fmt: skip
"""Rows of a letter from the top, a byte each, its leftmost cell the highest of five bits."""


class CameraPicture:
    """Draws the pictures of one stream. What has not changed is not drawn again."""

    def __init__(self, width: int, height: int, spectrum: str = "visible") -> None:
        """Pixels, and a key of `COLOURS`."""
        self._sky, self._ground = COLOURS[spectrum]
        self._encoder = encoder(width, height)
        self._width, self._height = width // CELL, height // CELL
        self._columns = (np.arange(self._encoder.cells[1], dtype=np.float32) + 0.5) - width / CELL / 2.0
        self._rows = (np.arange(self._encoder.cells[0], dtype=np.float32) + 0.5) - height / CELL / 2.0
        cells = np.arange(self._encoder.cells[1])
        self._blocks_of_strip = (2 * cells + 1) * STRIP_BITS // (2 * self._width)
        """Of each column, by its middle."""
        self._view: tuple[Quaternion, float] | None = None
        """Of the background."""
        self._background: Cells = np.full(self._encoder.cells, SKY, dtype=np.uint8)

    def draw(self, view: CameraView) -> Blocks:
        """Return the picture of a moment, ready for the encoder."""
        if self._view != (view.quat, view.hfov):
            self._view = view.quat, view.hfov
            self._background = self._landscape(view)
        cells = self._background.copy()
        wide = self._width >= WIDE
        number = f"#{view.number % 1_000_000:06d}"
        if wide:
            seconds = f"{view.milliseconds // 1000}.{view.milliseconds % 1000:03d} S"
            self._write(cells, f"{seconds}  {number}", 3, right=self._width - 4)
            self._write(cells, view.name.upper()[: self._width // 12], 3, left=4)
        else:
            self._write(cells, number, 1, left=1)
        self._stripe(cells, view, STRIP if wide else SMALL_STRIP)
        return self._encoder.blocks(cells)

    def _landscape(self, view: CameraView) -> Cells:
        """Return the picture without what changes with each one."""
        w, x, y, z = view.quat
        # How far down the world is along the camera's axes: the last row of the rotation.
        forward, right, down = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        focal = self._width / 2.0 / math.tan(view.hfov / 2.0)
        below = np.add.outer(down * self._rows + forward * focal, right * self._columns)
        cells: Cells = np.where(below > 0.0, self._ground, self._sky).astype(np.uint8)
        half = 0.5 * math.hypot(right, down)
        cells[(below >= -half) & (below < half)] = HORIZON
        if self._width < WIDE:
            return cells
        try:
            roll, pitch, yaw = (DEG_PER_RAD * angle for angle in euler_from_quaternion(*view.quat))
        except ValueError:  # no rotation
            return cells
        cells[: TOP + COMPASS] = DARK
        self._compass(cells, yaw, view.hfov * DEG_PER_RAD)
        first = self._height - STRIP - BOTTOM
        cells[first : first + BOTTOM] = DARK
        text = f"HEADING {round(wrap_360(yaw)) % 360:03d}  PITCH {round(pitch):+03d}  ROLL {round(roll):+04d}"
        self._write(cells, text, first + 3, left=4)
        middle, centre = self._height // 2, self._width // 2
        for columns in (slice(centre - 12, centre - 3), slice(centre + 4, centre + 13)):
            cells[middle, columns] = LIGHT
        return cells

    def _compass(self, cells: Cells, yaw: float, hfov: float) -> None:
        """Draw the azimuths that the camera sees, as wide as it sees them."""
        scale, middle = self._width / hfov, self._width / 2.0
        first = math.ceil((yaw - hfov / 2.0) / TICK) * TICK
        for azimuth in range(first, math.floor(yaw + hfov / 2.0) + 1, TICK):
            at = int(middle + (azimuth - yaw) * scale)
            if not 0 <= at < self._width:
                continue
            long = azimuth % LABEL == 0
            cells[TOP + COMPASS - (4 if long else 2) : TOP + COMPASS, at] = LIGHT
            if long:
                label = {0: "N", 90: "E", 180: "S", 270: "W"}.get(azimuth % 360, f"{azimuth % 360:03d}")
                self._write(cells, label, TOP, left=at - (6 * len(label) - 1) // 2)
        cells[TOP + COMPASS : TOP + COMPASS + 4, self._width // 2] = LIGHT

    def _stripe(self, cells: Cells, view: CameraView, height: int) -> None:
        """Draw the strip along the lower edge."""
        value = (view.number % (1 << NUMBER_BITS)) << TIME_BITS | view.milliseconds % (1 << TIME_BITS)
        bits = [LIGHT if value >> place & 1 else DARK for place in range(STRIP_BITS - 1, -1, -1)]
        bits.append(DARK)  # the columns that are cropped
        strip = np.array(bits, dtype=np.uint8)[np.minimum(self._blocks_of_strip, STRIP_BITS)]
        cells[self._height - height :] = strip

    def _write(self, cells: Cells, text: str, row: int, *, left: int = 0, right: int | None = None) -> None:
        """Write a line of text whose background is drawn already; what does not fit is cut off."""
        letters = _letters(text)
        column = left if right is None else right - letters.shape[1]
        begin, end = max(0, column), min(self._width, column + letters.shape[1])
        if begin < end:
            cells[row : row + _GLYPH_HEIGHT, begin:end] = letters[:, begin - column : end - column]


@lru_cache(maxsize=512)
def _letters(text: str) -> npt.NDArray[np.uint8]:
    """Return a line of text as cells."""
    return np.concatenate([_letter(letter) for letter in text] or [_letter(" ")], axis=1)


@lru_cache(maxsize=128)
def _letter(letter: str) -> npt.NDArray[np.uint8]:
    rows = bytes.fromhex(_GLYPHS.get(letter, _GLYPHS["?"]))
    # Twice the row: the lowest bit is the gap to the next letter.
    shown = [[LIGHT if 2 * row >> place & 1 else DARK for place in range(_GLYPH_WIDTH, -1, -1)] for row in rows]
    return np.array(shown, dtype=np.uint8)

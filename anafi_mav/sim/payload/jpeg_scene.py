"""The files that the simulated cameras write: small, but what their names say.

A photo is a baseline JPEG with Exif and XMP, one flat colour for each block of 8 x 8 pixels: sky above the horizon,
ground below, tilted as the camera saw it. A DNG is a TIFF with the same picture in linear samples. A video is an MP4
whose track holds one such JPEG a second (ISO 14496-1 object type 0x6C), so that any player shows it.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from anafi_mav.units import RAD_PER_DEG, wrap_360

WIDTH, HEIGHT = 160, 120
"""Pixels of a picture."""
THUMB_WIDTH, THUMB_HEIGHT = 80, 64
RAW_WIDTH, RAW_HEIGHT = 40, 30
"""Pixels of a DNG: they are not compressed."""
FRAME_TIME = 1.0
"""s of video per frame."""

_BLOCK = 8
_VFOV = 43.0
"""deg from the lower to the upper edge."""
_HFOV = 55.4
"""deg from the left to the right edge."""
_SHADE = 60.0
"""How much darker the sky is in the south."""
_SKY, _GROUND = (190, 150, 110), (100, 115, 130)
"""Y, Cb, Cr."""
UNKNOWN = 500.0
"""Coordinate that is not known, as everywhere in ARSDK."""

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Scene:
    """Scene that the camera sees: position and viewing direction."""

    latitude: float = UNKNOWN
    """deg; 500: not known, as everywhere in ARSDK."""
    longitude: float = UNKNOWN
    altitude: float = UNKNOWN
    """m above mean sea level"""
    pitch: float = 0.0
    """deg of the camera against the horizon, up."""
    roll: float = 0.0
    """deg, clockwise seen from behind"""
    north: float = 0.0
    """m from the simulator's origin, true also without GPS."""
    east: float = 0.0
    heading: float = 0.0
    """deg clockwise from north that the camera looks to."""


def blocks(scene: Scene, mark: int, width: int, height: int) -> Iterator[Colour]:
    """Yield the colours of the blocks, row by row.

    `mark` (a shot's number) is written in binary along the lower edge.
    """
    columns, rows = width // _BLOCK, height // _BLOCK
    slope = math.tan(max(-80.0, min(80.0, scene.roll)) * RAD_PER_DEG)
    middle = rows / 2.0 + scene.pitch / _VFOV * rows
    skies = [_sky(scene.heading + ((column + 0.5) / columns - 0.5) * _HFOV) for column in range(columns)]
    for row in range(rows):
        for column in range(columns):
            if row == rows - 1:
                yield (220, 128, 128) if mark >> (columns - 1 - column) & 1 else (30, 128, 128)
            else:
                # Rolled to the right, the horizon falls to the left.
                horizon = middle - slope * (column + 0.5 - columns / 2.0)
                yield skies[column] if row + 0.5 < horizon else _GROUND


def _sky(azimuth: float) -> Colour:
    """The sky is darkest in the south, so that a picture shows where the camera looked."""
    light, blue, red = _SKY
    return round(light - _SHADE * (1.0 - math.cos(azimuth * RAD_PER_DEG)) / 2.0), blue, red


# -- JPEG (ITU T.81)

_DC_BITS = bytes((0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0))
"""How many codes of 1, 2, … 16 bits; the table for luminance of T.81 annex K."""
_DC_CODES = ("00", "010", "011", "100", "101", "110", "1110", "11110", "111110", "1111110", "11111110", "111111110")
_END_OF_BLOCK = "0"
"""The one code of our table for the other coefficients, which are all zero."""
_QUANTUM = 8
"""Step of the quantisation: the first coefficient is eight times the mean, so what is left is the mean."""


def _segment(marker: int, payload: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(payload) + 2) + payload


def jpeg(
    scene: Scene,
    mark: int = 0,
    *,
    width: int = WIDTH,
    height: int = HEIGHT,
    exif: bytes | None = None,
    xmp: bytes | None = None,
) -> bytes:
    """A picture; sizes are multiples of 8.

    `xmp` is the payload of an APP1 segment of its own, behind that of Exif.
    """
    bits: list[str] = []
    before = [0, 0, 0]
    for colour in blocks(scene, mark, width, height):
        for component, value in enumerate(colour):
            level = value - 128
            difference, before[component] = level - before[component], level
            size = abs(difference).bit_length()
            bits.append(_DC_CODES[size])
            if size:
                number = difference if difference > 0 else difference + (1 << size) - 1
                bits.append(f"{number:0{size}b}")
            bits.append(_END_OF_BLOCK)
    text = "".join(bits)
    text += "1" * (-len(text) % 8)
    scan = int(text, 2).to_bytes(len(text) // 8, "big").replace(b"\xff", b"\xff\0")
    components = b"".join(bytes((id, 0x11, 0)) for id in (1, 2, 3))
    head = _segment(0xE0, b"JFIF\0\1\1\0\0\1\0\1\0\0") if exif is None else _segment(0xE1, b"Exif\0\0" + exif)
    if xmp is not None:
        head += _segment(0xE1, xmp)
    return b"".join(
        (
            b"\xff\xd8",
            head,
            _segment(0xDB, b"\0" + bytes([_QUANTUM]) * 64),
            _segment(0xC0, struct.pack(">BHHB", 8, height, width, 3) + components),
            _segment(0xC4, b"\x00" + _DC_BITS + bytes(range(12))),
            _segment(0xC4, b"\x10" + bytes((1, *[0] * 15)) + b"\0"),
            _segment(0xDA, b"\3" + b"".join(bytes((id, 0)) for id in (1, 2, 3)) + b"\0\x3f\0"),
            scan,
            b"\xff\xd9",
        )
    )


def thumbnail(scene: Scene, mark: int = 0) -> bytes:
    return jpeg(scene, mark, width=THUMB_WIDTH, height=THUMB_HEIGHT)


# -- TIFF, for Exif and DNG

_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL = 1, 2, 3, 4, 5
Entry = tuple[int, int, int, bytes]
"""Tag, type, count, value."""


def _text(tag: int, text: str) -> Entry:
    data = text.encode("ascii", "replace") + b"\0"
    return tag, _ASCII, len(data), data


def _long(tag: int, value: int) -> Entry:
    return tag, _LONG, 1, struct.pack("<I", value)


def _short(tag: int, *values: int) -> Entry:
    return tag, _SHORT, len(values), struct.pack(f"<{len(values)}H", *values)


def _rationals(tag: int, *values: float) -> Entry:
    numbers = [number for value in values for number in (round(value * 10_000), 10_000)]
    return tag, _RATIONAL, len(values), struct.pack(f"<{len(numbers)}I", *numbers)


def _directory(entries: Sequence[Entry], offset: int) -> bytes:
    """An image file directory that begins at `offset`, its longer values behind it."""
    table, values = [], b""
    place = offset + 2 + 12 * len(entries) + 4
    for tag, kind, count, data in sorted(entries):
        if len(data) <= 4:
            table.append(struct.pack("<HHI4s", tag, kind, count, data))
        else:
            table.append(struct.pack("<HHII", tag, kind, count, place + len(values)))
            values += data + b"\0" * (len(data) % 2)
    return struct.pack("<H", len(entries)) + b"".join(table) + bytes(4) + values


_HEADER = struct.pack("<2sHI", b"II", 42, 8)


def _degrees(tag: int, angle: float) -> Entry:
    degrees, rest = divmod(abs(angle) * 60.0, 60.0)
    minutes, seconds = divmod(rest * 60.0, 60.0)
    return _rationals(tag, degrees, minutes, seconds)


def exif(scene: Scene, make_model: str, date: str) -> bytes:
    """Return the TIFF block of a photo's APP1: model, date and, if known, position.

    `date` is "YYYY:MM:DD HH:MM:SS".
    """
    entries = [_text(0x010F, "Parrot"), _text(0x0110, make_model), _text(0x0132, date)]
    if scene.latitude == UNKNOWN:
        return _HEADER + _directory(entries, 8)
    place = [
        (0x0000, _BYTE, 4, b"\2\3\0\0"),
        _text(0x0001, "N" if scene.latitude >= 0 else "S"),
        _degrees(0x0002, scene.latitude),
        _text(0x0003, "E" if scene.longitude >= 0 else "W"),
        _degrees(0x0004, scene.longitude),
        (0x0005, _BYTE, 1, b"\1" if scene.altitude < 0 else b"\0"),
        _rationals(0x0006, abs(scene.altitude)),
        _text(0x0010, "T"),
        _rationals(0x0011, wrap_360(scene.heading)),
    ]
    pointer = 8 + len(_directory([*entries, _long(0x8825, 0)], 8))
    return _HEADER + _directory([*entries, _long(0x8825, pointer)], 8) + _directory(place, pointer)


def dng(scene: Scene, mark: int, make_model: str, date: str, xmp: bytes) -> bytes:
    """A raw picture: linear samples, uncompressed."""
    colours = list(blocks(scene, mark, RAW_WIDTH * _BLOCK, RAW_HEIGHT * _BLOCK))
    samples = b"".join(bytes(_rgb(colour)) for colour in colours)

    def head(offset: int) -> bytes:
        entries = [
            _long(0x00FE, 0),
            _long(0x0100, RAW_WIDTH),
            _long(0x0101, RAW_HEIGHT),
            _short(0x0102, 8, 8, 8),
            _short(0x0103, 1),
            _short(0x0106, 34892),  # LinearRaw
            _text(0x010F, "Parrot"),
            _text(0x0110, make_model),
            _long(0x0111, offset),
            _short(0x0112, 1),
            _short(0x0115, 3),
            _long(0x0116, RAW_HEIGHT),
            _long(0x0117, len(samples)),
            _text(0x0132, date),
            (0x02BC, _BYTE, len(xmp), xmp),
            (0xC612, _BYTE, 4, b"\1\4\0\0"),
            _text(0xC614, make_model),
            _rationals(0xC628, 1.0, 1.0, 1.0),
        ]
        return _HEADER + _directory(entries, 8)

    return head(len(head(0))) + samples


def _rgb(colour: Colour) -> tuple[int, int, int]:
    y, cb, cr = colour[0], colour[1] - 128, colour[2] - 128
    red, green, blue = y + 1.402 * cr, y - 0.344 * cb - 0.714 * cr, y + 1.772 * cb
    return tuple(max(0, min(255, round(part))) for part in (red, green, blue))  # type: ignore[return-value]


# -- MP4 (ISO 14496-12)


def _box(kind: bytes, *parts: bytes) -> bytes:
    payload = b"".join(parts)
    return struct.pack(">I4s", len(payload) + 8, kind) + payload


def _full(kind: bytes, *parts: bytes, flags: int = 0) -> bytes:
    return _box(kind, struct.pack(">I", flags), *parts)


_MATRIX = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
_FTYP = _box(b"ftyp", b"isom", struct.pack(">I", 0x200), b"isommp41")
_ESDS = _full(
    b"esds",
    # ES descriptor, decoder configuration (object type 0x6C: JPEG, stream type 4: visual), SL configuration.
    bytes((0x03, 21, 0, 1, 0, 0x04, 13, 0x6C, 0x11)) + bytes(11) + bytes((0x06, 1, 2)),
)


def _moov(frames: int, size: int, duration_ms: int, offset: int) -> bytes:
    last = max(1, duration_ms - (frames - 1) * round(FRAME_TIME * 1000))
    entry = _box(
        b"mp4v",
        bytes(6) + struct.pack(">H", 1) + bytes(16) + struct.pack(">HHII", WIDTH, HEIGHT, 0x480000, 0x480000),
        bytes(4) + struct.pack(">H", 1) + bytes(32) + struct.pack(">Hh", 24, -1),
        _ESDS,
    )
    table = _box(
        b"stbl",
        _full(b"stsd", struct.pack(">I", 1), entry),
        _full(b"stts", struct.pack(">5I", 2, frames - 1, round(FRAME_TIME * 1000), 1, last)),
        _full(b"stsc", struct.pack(">4I", 1, 1, frames, 1)),
        _full(b"stsz", struct.pack(">2I", size, frames)),
        _full(b"stco", struct.pack(">2I", 1, offset)),
    )
    media = _box(
        b"mdia",
        _full(b"mdhd", struct.pack(">4IHH", 0, 0, 1000, duration_ms, 0x55C4, 0)),
        _full(b"hdlr", bytes(4), b"vide", bytes(12), b"\0"),
        _box(
            b"minf",
            _full(b"vmhd", bytes(8), flags=1),
            _box(b"dinf", _full(b"dref", struct.pack(">I", 1), _full(b"url ", flags=1))),
            table,
        ),
    )
    header = struct.pack(">4I", 0, 0, 1000, duration_ms) + struct.pack(">IH", 0x10000, 0x100) + bytes(10)
    track = struct.pack(">5I", 0, 0, 1, 0, duration_ms) + bytes(16) + _MATRIX
    return _box(
        b"moov",
        _full(b"mvhd", header, _MATRIX, bytes(24), struct.pack(">I", 2)),
        _box(b"trak", _full(b"tkhd", track, struct.pack(">II", WIDTH << 16, HEIGHT << 16), flags=7), media),
    )


def _mdat(size: int) -> bytes:
    """Return the header of `size` bytes of pictures.

    Over 4 GiB their number has 64 bits (ISO 14496-12 §4.2).
    """
    if size + 8 < 1 << 32:
        return struct.pack(">I4s", size + 8, b"mdat")
    return struct.pack(">I4sQ", 1, b"mdat", size + 16)


_BEFORE_MDAT = len(_FTYP) + len(_moov(1, 0, 0, 0))

_UNKNOWN_DURATION = (1 << 32) - 1
"""ms of a video that is too long for 32 bits (ISO 14496-12 §8.2.2)."""


def frames_in(seconds: float) -> int:
    """Frames of a video of this length."""
    return max(1, math.ceil(seconds / FRAME_TIME))


def mp4_size(scene: Scene, seconds: float) -> int:
    """Bytes of `mp4` without making it."""
    size = frames_in(seconds) * len(_frame(scene))
    return _BEFORE_MDAT + len(_mdat(size)) + size


def mp4(scene: Scene, seconds: float, offset: int = 0, size: int | None = None) -> bytes:
    """Bytes of a video of this length, from `offset` on; all of them without a `size`.

    Only these are made: a video may be larger than the memory.
    """
    frame, count = _frame(scene), frames_in(seconds)
    mdat = _mdat(count * len(frame))
    duration = min(round(seconds * 1000.0), _UNKNOWN_DURATION)
    head = _FTYP + _moov(count, len(frame), duration, _BEFORE_MDAT + len(mdat)) + mdat
    end = len(head) + count * len(frame)
    end = end if size is None else min(end, offset + size)
    made = head[offset:end]
    start = max(offset, len(head)) - len(head)
    if (left := end - len(head) - start) > 0:
        skipped = start % len(frame)
        made += (frame * ((skipped + left) // len(frame) + 1))[skipped : skipped + left]
    return made


@lru_cache(maxsize=64)
def _frame(scene: Scene) -> bytes:
    return jpeg(scene)

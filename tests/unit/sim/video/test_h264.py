"""The encoder of the simulated camera: codes by hand, and what ffmpeg decodes of its streams."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from support.pictures import decode

from anafi_mav.errors import LocalProtocolError
from anafi_mav.sim.video import cavlc
from anafi_mav.sim.video.camera_view import KEY_INTERVAL
from anafi_mav.sim.video.cavlc import chroma_dc, luma_dc, se, ue
from anafi_mav.sim.video.h264 import CELL, PALETTE, SKY, Cells, PictureEncoder

LUMA = np.array([128 + 40 * colour.luma for colour in PALETTE])


def stream(encoder: PictureEncoder, pictures: list[Cells]) -> list[list[bytes]]:
    """The NAL units of pictures."""
    units: list[list[bytes]] = []
    before = None
    for number, cells in enumerate(pictures):
        blocks, (gop, place) = encoder.blocks(cells), divmod(number, KEY_INTERVAL)
        if before is None or place == 0:
            units.append([encoder.sps, encoder.pps, encoder.key(blocks, gop % 2)])
        else:
            units.append([encoder.between(blocks, before, place)])
        before = blocks
    return units


def test_exp_golomb_codes_are_those_of_the_standard() -> None:
    assert [ue(value) for value in range(5)] == ["1", "010", "011", "00100", "00101"]  # table 9-2
    assert [se(value) for value in (0, 1, -1, 2, -2)] == ["1", "010", "011", "00100", "00101"]  # table 9-3


def test_blocks_of_coefficients_are_coded_as_by_hand() -> None:
    assert luma_dc([0] * 16) == "1"
    # One coefficient, a trailing one, negative, no zeros before it.
    assert luma_dc([-1] + [0] * 15) == "01" + "1" + "1"
    # One coefficient -32: level code 2 * 32 - 1 - 2 = 61, escaped as 61 - 30 in 12 bits.
    assert luma_dc([-32] + [0] * 15) == "000101" + "0" * 15 + "1" + f"{31:012b}" + "1"
    # Five coefficients with three trailing ones, as in Iain Richardson's paper on CAVLC.
    assert luma_dc([0, 3, 0, 1, -1, -1, 0, 1] + [0] * 8) == "000010001110010111101101"
    assert chroma_dc([0, 0, 0, 0]) == "01"


@pytest.mark.parametrize("name", ["_TOKEN", "_CHROMA_TOKEN"])
def test_tokens_have_no_common_beginning(name: str) -> None:
    codes = [cavlc._bits(code) for row in getattr(cavlc, name) for code in row]
    assert not [(a, b) for a in codes for b in codes if a is not b and b.startswith(a)]


@pytest.mark.parametrize("name", ["_ZEROS", "_CHROMA_ZEROS", "_RUN"])
def test_codes_of_zeros_have_no_common_beginning(name: str) -> None:
    for row in getattr(cavlc, name):
        codes = [cavlc._bits(code) for code in row]
        assert not [(a, b) for a in codes for b in codes if a is not b and b.startswith(a)]


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (1920, 1080), (960, 720), (176, 90), (16, 16), (34, 18)])
def test_decoder_shows_every_cell_as_it_was_drawn(width: int, height: int, tmp_path: Path) -> None:
    """Random cells, each second a key picture, a few changed between."""
    encoder, chance = PictureEncoder(width, height), random.Random(1)
    rows, columns = encoder.cells
    noisy = min(rows * columns, 4000)
    cells = np.full(encoder.cells, SKY, dtype=np.uint8)
    cells.reshape(-1)[:noisy] = [chance.randrange(len(PALETTE)) for _ in range(noisy)]
    drawn = []
    for _ in range(KEY_INTERVAL + 10):
        for _ in range(5):
            row, column = chance.randrange(rows), chance.randrange(columns)
            cells[row, column : column + 9] = chance.randrange(len(PALETTE))
        drawn.append(cells.copy())
    shown = decode(tmp_path / "stream.264", stream(encoder, drawn), luma=True)
    assert len(shown) == len(drawn)
    for image, wanted in zip(shown, drawn, strict=True):
        samples = np.kron(LUMA[wanted], np.ones((CELL, CELL), dtype=int))[:height, :width]
        assert np.array_equal(image, samples)


def test_decoder_shows_the_colours_of_the_palette(tmp_path: Path) -> None:
    encoder = PictureEncoder(16 * len(PALETTE), 16)
    cells = np.repeat(np.arange(len(PALETTE), dtype=np.uint8), 4)[None, :].repeat(4, axis=0)
    (image,) = decode(tmp_path / "stream.264", stream(encoder, [cells]))
    for number, (luma, blue, red) in enumerate(PALETTE):
        # ITU-R BT.601, 16..235 stretched to 0..255.
        y, b, r = 1.164 * (128 + 40 * luma - 16), 16 * blue, 16 * red
        wanted = [y + 2.017 * b, y - 0.392 * b - 0.813 * r, y + 1.596 * r]
        assert image[8, 16 * number + 8] == pytest.approx(np.clip(wanted, 0, 255), abs=3)


def test_picture_without_change_skips_all_macroblocks() -> None:
    encoder = PictureEncoder(1280, 720)
    cells = np.full(encoder.cells, SKY, dtype=np.uint8)
    blocks = encoder.blocks(cells)
    assert len(encoder.between(blocks, blocks, 1)) < 12
    cells[0, 0] = 0 if SKY else 1
    assert len(encoder.between(encoder.blocks(cells), blocks, 1)) < 40


def test_sequence_is_constrained_baseline() -> None:
    assert PictureEncoder(1280, 720).sps[1:4] == bytes((66, 0xC0, 31))
    assert PictureEncoder(1920, 1080).sps[1:4] == bytes((66, 0xC0, 40))


@pytest.mark.parametrize("size", [(0, 16), (1281, 720), (16, 15), (16000, 16000)])
def test_size_without_level_is_refused(size: tuple[int, int]) -> None:
    with pytest.raises(LocalProtocolError):
        PictureEncoder(*size)

"""Picture sizes in sequence parameter sets of other encoders and of the simulator's."""

from __future__ import annotations

import random

import pytest

from anafi_mav.arsdk.video.h264_sps import picture_size
from anafi_mav.sim.video.h264 import encoder

HIGH_1080P = bytes.fromhex("67640028acd940780227e5c044000003000400000300f03c60c658")
"""Of x264, High profile level 4, with emulation prevention: 68 rows of macroblocks, 8 lines cropped."""


def test_size_of_a_high_profile_is_read() -> None:
    assert picture_size(HIGH_1080P) == (1920, 1080)


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1080), (960, 720), (176, 90)])
def test_size_of_a_simulated_stream_is_read(size: tuple[int, int]) -> None:
    assert picture_size(encoder(*size).sps) == size


def test_broken_parameter_set_has_no_size() -> None:
    chance = random.Random(264)
    assert picture_size(b"") is None
    assert picture_size(b"\x68" + HIGH_1080P[1:]) is None  # a picture parameter set
    assert picture_size(HIGH_1080P[:8]) is None
    for _ in range(2000):
        unit = bytearray(HIGH_1080P)
        for _ in range(chance.randrange(1, 6)):
            unit[chance.randrange(len(unit))] = chance.randrange(256)
        size = picture_size(bytes(unit[: chance.randrange(len(unit) + 1)]))
        assert size is None or all(0 < side <= 16384 for side in size)

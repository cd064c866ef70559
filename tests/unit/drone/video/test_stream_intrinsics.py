"""Pinhole models of the shown stream; focal lengths by hand."""

from __future__ import annotations

import pytest

from anafi_mav.drone.video.stream import Shown
from anafi_mav.drone.video.stream_choice import OfferedStream, StreamKind
from anafi_mav.drone.video.stream_intrinsics import IntrinsicsSource, shown_intrinsics
from anafi_mav.models import Intrinsics

LENS = Intrinsics(1280, 720, 950.0, 948.0, 642.0, 345.0, 0.02, -0.02, 0.001, 0.002, 0.003)
VISIBLE = OfferedStream(1, StreamKind.VISIBLE, 1280, 720)
THERMAL = OfferedStream(2, StreamKind.THERMAL, 960, 720)
RIGHT_ANGLE = (90.0, 53.13010)
"""deg: the tangents of the halves are 1 and 1/2."""


def test_model_counts_while_no_video_plays() -> None:
    found = shown_intrinsics(None, VISIBLE, LENS)
    assert found is not None
    assert (found.lens, found.camera, found.source) == (LENS, 0, IntrinsicsSource.MODEL)
    assert shown_intrinsics(None, THERMAL, LENS) is None
    assert shown_intrinsics(None, VISIBLE, None) is None


def test_description_of_the_stream_comes_before_the_model() -> None:
    shown = Shown("Front camera", (), RIGHT_ANGLE, (0.51, 0.48), (0.1, 0.2, 0.3, 0.4, 0.5))
    found = shown_intrinsics(shown, VISIBLE, LENS)
    assert found is not None
    assert found.source is IntrinsicsSource.STREAM
    lens = found.lens
    assert (lens.fx, lens.fy, lens.cx, lens.cy) == pytest.approx((640.0, 720.0, 652.8, 345.6), abs=1e-3)
    assert (lens.k1, lens.k2, lens.k3, lens.p1, lens.p2) == (0.1, 0.2, 0.3, 0.4, 0.5)


def test_model_is_scaled_to_the_size_of_the_stream() -> None:
    found = shown_intrinsics(Shown("DefaultVideo", ()), OfferedStream(1, StreamKind.VISIBLE, 1920, 1080), LENS)
    assert found is not None
    assert found.source is IntrinsicsSource.MODEL
    assert (found.lens.width, found.lens.fx, found.lens.cy, found.lens.k1) == (1920, 1425.0, 517.5, 0.02)


def test_field_of_view_alone_gives_an_ideal_lens() -> None:
    found = shown_intrinsics(Shown("ParrotThermalVideo", (), RIGHT_ANGLE), THERMAL, LENS)
    assert found is not None
    assert (found.camera, found.source) == (1, IntrinsicsSource.FOV)
    assert (found.lens.fx, found.lens.fy) == pytest.approx((480.0, 720.0), abs=1e-3)
    assert (found.lens.cx, found.lens.cy, found.lens.k1) == (480.0, 360.0, 0.0)
    for angle in (0.0, 180.0, -3.0):
        assert shown_intrinsics(Shown("ParrotThermalVideo", (), (angle, 50.0)), THERMAL, LENS) is None


def test_stereo_stream_has_no_numbered_camera() -> None:
    found = shown_intrinsics(
        Shown("Disparity map", (), RIGHT_ANGLE), OfferedStream(4, StreamKind.DISPARITY, 176, 90), LENS
    )
    assert found is not None
    assert found.camera is None

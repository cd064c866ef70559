"""What the simulated camera draws, read from decoded pictures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.pictures import decode, horizon, strip

from anafi_mav.arsdk.video.video_metadata import Quaternion
from anafi_mav.sim.video.camera_picture import CameraPicture
from anafi_mav.sim.video.camera_view import KEY_INTERVAL, CameraView
from anafi_mav.sim.video.h264 import encoder
from anafi_mav.units import quaternion_from_euler

HFOV = math.radians(69.0)


def seen(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, number: int = 0, milliseconds: int = 0) -> CameraView:
    """A moment; angles in deg."""
    quat = Quaternion(*quaternion_from_euler(math.radians(roll), math.radians(pitch), math.radians(yaw)))
    return CameraView("alpha", number, milliseconds, quat, HFOV)


def shown(path: Path, *views: CameraView, width: int = 1280, height: int = 720, spectrum: str = "visible") -> list[Any]:
    """The decoded pictures of moments, as one stream."""
    picture, coder = CameraPicture(width, height, spectrum), encoder(width, height)
    units, before = [], None
    for number, view in enumerate(views):
        blocks = picture.draw(view)
        if before is None or number % KEY_INTERVAL == 0:
            units.append([coder.sps, coder.pps, coder.key(blocks, number // KEY_INTERVAL % 2)])
        else:
            units.append([coder.between(blocks, before, number % KEY_INTERVAL)])
        before = blocks
    return decode(path / "stream.264", units)


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (1920, 1080), (960, 720), (176, 90)])
def test_strip_has_number_and_time_of_each_picture(width: int, height: int, tmp_path: Path) -> None:
    moments = [(0, 0), (1, 33), (4095, (1 << 20) - 1), (4096, 1 << 20), (0xA5A, 0xA5A5A), (70_001, 123_456_789)]
    images = shown(tmp_path, *(seen(number=n, milliseconds=t) for n, t in moments), width=width, height=height)
    assert [strip(image) for image in images] == [(n % 4096, t % (1 << 20)) for n, t in moments]


def test_horizon_follows_pitch_and_roll_of_the_camera(tmp_path: Path) -> None:
    """The height by hand: the tangent of the angle, against that of half the view."""
    level, up, right = shown(tmp_path, seen(), seen(pitch=10.0), seen(roll=10.0))
    half = 1280 / 2 / math.tan(HFOV / 2.0)
    middle = 0.5
    assert horizon(level, 0.3) == pytest.approx(middle, abs=0.01)
    # A camera that looks up has the horizon below the middle.
    assert horizon(up, 0.3) == pytest.approx(middle + half * math.tan(math.radians(10.0)) / 720, abs=0.01)
    # Rolled to the right it sees more ground on the right.
    rise = math.tan(math.radians(10.0)) * 0.3 * 1280 / 720
    assert horizon(right, 0.8) == pytest.approx(middle - rise, abs=0.01)
    assert horizon(right, 0.2) == pytest.approx(middle + rise, abs=0.01)


def test_camera_that_looks_straight_down_sees_ground_alone(tmp_path: Path) -> None:
    (down,) = shown(tmp_path, seen(pitch=-90.0, yaw=30.0))
    assert horizon(down, 0.3) is None
    assert down[300, 300, 0] < down[300, 300, 2] + 20  # no blue


def test_text_and_compass_change_with_what_they_say(tmp_path: Path) -> None:
    bands = {"text": slice(0, 48), "compass": slice(48, 96), "angles": slice(640, 688)}
    views = [seen(), seen(milliseconds=1), seen(yaw=90.0), seen(pitch=3.0)]
    plain, later, east, raised = shown(tmp_path, *views)
    changed = [
        {name for name, rows in bands.items() if not np.array_equal(plain[rows], other[rows])}
        for other in (later, east, raised)
    ]
    assert changed == [{"text"}, {"compass", "angles"}, {"angles"}]


def test_thermal_pictures_have_colours_of_their_own(tmp_path: Path) -> None:
    places = (slice(150, 160), 300), (slice(600, 610), 300)
    found = {
        spectrum: [
            shown(tmp_path, seen(), width=960, spectrum=spectrum)[0][place].mean(axis=0).round() for place in places
        ]
        for spectrum in ("visible", "thermal", "blended")
    }
    assert not np.allclose(found["visible"], found["thermal"], atol=20)
    assert np.allclose(found["blended"], [found["visible"][0], found["thermal"][1]])


def test_picture_of_a_quaternion_that_is_no_rotation_is_drawn() -> None:
    view = CameraView("a", 0, 0, Quaternion(0.0, 0.0, 0.0, 0.0), HFOV)
    assert CameraPicture(1280, 720).draw(view).shape == (3600, 16)


def test_name_with_other_letters_is_drawn() -> None:
    for name in ("", "é\n€", "x" * 500):
        CameraPicture(1280, 720).draw(seen()._replace(name=name))

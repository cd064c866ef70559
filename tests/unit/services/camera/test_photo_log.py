"""History of photos by index."""

from __future__ import annotations

from functools import partial

import pytest

from anafi_mav.services.camera.photo_log import KEPT, CapturedImage, PhotoLog, renumbered


def make(capture: int, number: int, index: int) -> CapturedImage:
    return CapturedImage(index, 1.0, 0, capture, number, True)


def log(photos: int, count: int = 0) -> PhotoLog:
    found = PhotoLog(count)
    for number in range(1, photos + 1):
        found.add(partial(make, 1, number))
    return found


@pytest.mark.parametrize(
    ("first", "last", "found"),
    [
        (0, 0, [0]),
        (1, 0, [1]),
        (1, 2, [1, 2]),
        (1, -1, [1, 2, 3]),
        (-1, 0, [0, 1, 2, 3]),
        (-1, 2, [0, 1, 2, 3]),
        (4, 0, []),
        (3, 1, []),
        (-2, 0, []),
    ],
)
def test_range_returns_the_requested_photos(first: int, last: int, found: list[int]) -> None:
    assert [image.index for image in log(4).range(first, last)] == found


def test_index_continues_from_a_stored_count() -> None:
    assert [image.index for image in log(2, 7).range(-1, 0)] == [7, 8]


@pytest.mark.parametrize("count", [None, -1, 2**31, True, 1.5, "3"])
def test_stored_count_without_sense_is_zero(count: object) -> None:
    assert PhotoLog.stored_count({"camera_images": count}) == 0
    assert PhotoLog.stored_count({"camera_images": 12}) == 12


def test_oldest_photos_are_forgotten() -> None:
    kept = log(KEPT + 3)
    assert len(kept.range(-1, 0)) == KEPT
    assert kept.find(2) is None
    assert kept.count == KEPT + 3


def test_change_and_format() -> None:
    photos = log(2)
    photos.change(1, url="mftp://x")
    photos.change(9, url="y")
    image = photos.find(1)
    assert image is not None
    assert image.url == "mftp://x"
    assert renumbered(image, 3, 2).url == ""
    assert [one.number for one in photos.of_capture(1)] == [1, 2]
    photos.reset()
    assert (photos.count, photos.range(-1, 0)) == (0, [])

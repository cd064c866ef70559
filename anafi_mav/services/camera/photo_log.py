"""History of the photos of a camera: CAMERA_IMAGE_CAPTURED by index. No I/O.

Every picture has an index, which counts from 0 and goes on after a restart of the gateway; it begins again after a
format only. A picture that the drone could not store has one, too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
from msgspec.structs import replace

KEPT = 2000
"""Photos whose message can be requested again; a survey has some hundreds."""

KEY = "camera_images"
"""Name of the count in the drone's file."""

MOST = 2**31 - 1
"""An index is an INT32."""


class CapturedImage(msgspec.Struct, frozen=True):
    """One picture, as its message reports it. None: unknown."""

    index: int
    at: float
    """s, monotonic."""
    utc_us: int
    capture: int
    number: int
    """Number of the photo, burst or series, and of the picture within it."""
    is_saved: bool
    latitude: float | None = None
    """deg."""
    longitude: float | None = None
    amsl: float | None = None
    """m."""
    height: float | None = None
    """m above take-off."""
    quaternion: tuple[float, float, float, float] | None = None
    url: str = ""


def renumbered(image: CapturedImage, number: int, index: int) -> CapturedImage:
    """Return another picture of the same burst, whose own time was not reported."""
    return replace(image, index=index, number=number, url="")


class PhotoLog:
    """The photos by index; the oldest are forgotten."""

    def __init__(self, count: int = 0) -> None:
        self.count = count
        """Index of the next photo."""
        self._images: dict[int, CapturedImage] = {}

    @staticmethod
    def stored_count(settings: dict[str, Any]) -> int:
        """Return the count in a drone's file; 0 when there is none that makes sense."""
        count = settings.get(KEY)
        return count if isinstance(count, int) and not isinstance(count, bool) and 0 <= count <= MOST else 0

    def reset(self) -> None:
        """Begin again: the storage was formatted."""
        self.count = 0
        self._images.clear()

    def add(self, make: Callable[[int], CapturedImage]) -> CapturedImage:
        """Add the next photo, made for its index."""
        image = make(self.count)
        self._images[image.index] = image
        self.count = min(self.count + 1, MOST)
        if len(self._images) > KEPT:
            del self._images[next(iter(self._images))]
        return image

    def find(self, index: int) -> CapturedImage | None:
        """Return the photo with this index; None when it is forgotten."""
        return self._images.get(index)

    def change(self, index: int, **changes: Any) -> None:
        """Change what is known of a photo, unless it is forgotten."""
        if (image := self._images.get(index)) is not None:
            self._images[index] = replace(image, **changes)

    def of_capture(self, capture: int) -> list[CapturedImage]:
        """Return the pictures of a photo, burst or series, in their sequence."""
        return [image for image in self._images.values() if image.capture == capture]

    def range(self, first: int, last: int) -> list[CapturedImage]:
        """Return the photos that are asked for with the params 2 and 3 of MAV_CMD_REQUEST_MESSAGE.

        `first` -1: all. `last` 0: `first` alone, -1: `first` and all that follow.
        """
        if first == -1:
            first, last = 0, -1
        end = first if last == 0 else MOST if last == -1 else last
        return [image for index, image in self._images.items() if first <= index <= end]

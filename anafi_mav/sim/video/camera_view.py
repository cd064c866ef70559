"""View of the camera in one picture, and the rate of pictures.

`h264` and `camera_picture` draw it with numpy, which is imported for the first viewer only.
"""

from __future__ import annotations

from typing import NamedTuple

from anafi_mav.arsdk.video.video_metadata import Quaternion

KEY_INTERVAL = 30
"""Pictures from one key picture to the next: a second."""

FRAME_RATE = 30
"""Pictures a second, as the stream says of itself."""


class CameraView(NamedTuple):
    """Contents of one picture: name, number and time, attitude and field of view of the camera."""

    name: str
    number: int
    """Of the picture."""
    milliseconds: int
    """Time of the picture."""
    quat: Quaternion
    """Attitude of the camera, from north, east, down to forward, right, down."""
    hfov: float
    """rad, from the left to the right edge."""

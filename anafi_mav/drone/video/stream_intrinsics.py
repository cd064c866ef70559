"""Pinhole model of the live video that is shown. No I/O."""

from __future__ import annotations

import enum
import math

import msgspec

from anafi_mav.arsdk.video.h264_sps import picture_size
from anafi_mav.drone.video.stream import Shown
from anafi_mav.drone.video.stream_choice import BLENDED_THERMAL, DISPARITY_MAP, RAW_THERMAL, OfferedStream, StreamKind
from anafi_mav.models import Intrinsics
from anafi_mav.units import RAD_PER_DEG

SAME_SHAPE = 0.01
"""Share by which the shapes of two pictures may differ when one is the other in another size."""

CAMERAS = {RAW_THERMAL: 1, BLENDED_THERMAL: 2, DISPARITY_MAP: None}
"""Parrot's number of the camera of a stream, by its title; None: it has none. Other titles show the main camera, 0."""


class IntrinsicsSource(enum.Enum):
    """Origin of the values."""

    MODEL = enum.auto()
    """Measured on one drone of the model."""
    STREAM = enum.auto()
    """The drone's description of the stream."""
    FOV = enum.auto()
    """The stream's field of view; the principal point is taken as the centre, and no distortion."""


class ShownIntrinsics(msgspec.Struct, frozen=True):
    """Pinhole model of a stream."""

    lens: Intrinsics
    camera: int | None
    """Parrot's number of the camera; None: it has none."""
    source: IntrinsicsSource


def shown_intrinsics(shown: Shown | None, stream: OfferedStream, lens: Intrinsics | None) -> ShownIntrinsics | None:
    """Return the pinhole model of the shown stream; None where nothing is known of it.

    `shown` is the description of the stream that plays, None while none plays. `stream` is the one that the drone
    shows, or would show. `lens` is the model's main camera.
    """
    if shown is None:
        if lens is None or stream.kind is not StreamKind.VISIBLE:
            return None
        return ShownIntrinsics(lens, 0, IntrinsicsSource.MODEL)
    width, height = picture_size(shown.sps) or (stream.width, stream.height)
    camera = CAMERAS.get(shown.title, 0)
    focal = _focal_lengths(shown.fov_deg, width, height)
    if focal is not None and shown.principal_point is not None and shown.distortion is not None:
        x, y = shown.principal_point
        k1, k2, k3, p1, p2 = shown.distortion
        described = Intrinsics(width, height, *focal, x * width, y * height, k1, k2, p1, p2, k3)
        return ShownIntrinsics(described, camera, IntrinsicsSource.STREAM)
    if camera == 0 and lens is not None and (scaled := _scaled(lens, width, height)) is not None:
        return ShownIntrinsics(scaled, camera, IntrinsicsSource.MODEL)
    if focal is None:
        return None
    ideal = Intrinsics(width, height, *focal, width / 2, height / 2, 0.0, 0.0, 0.0, 0.0, 0.0)
    return ShownIntrinsics(ideal, camera, IntrinsicsSource.FOV)


def _focal_lengths(fov_deg: tuple[float, float] | None, width: int, height: int) -> tuple[float, float] | None:
    """Return fx and fy, pixels."""
    if fov_deg is None or not all(0.0 < angle < 180.0 for angle in fov_deg):
        return None
    across, down = (math.tan(angle * RAD_PER_DEG / 2.0) for angle in fov_deg)
    return width / 2.0 / across, height / 2.0 / down


def _scaled(lens: Intrinsics, width: int, height: int) -> Intrinsics | None:
    """Return the same lens for another size of picture, or None for another shape."""
    x, y = width / lens.width, height / lens.height
    if abs(x / y - 1.0) > SAME_SHAPE:
        return None
    return msgspec.structs.replace(
        lens, width=width, height=height, fx=lens.fx * x, fy=lens.fy * y, cx=lens.cx * x, cy=lens.cy * y
    )

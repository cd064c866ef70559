"""The lens of each model's main camera, as data: what a program needs that measures in its pictures.

Parrot publishes no calibration. These are the ones that anafi_ros carries (camera/camera_info of its paper), each
measured on one drone of its model; another of the same model differs by about a percent.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec


class Intrinsics(msgspec.Struct, frozen=True):
    """Pinhole model of the live video at zoom 1, in pixels; distortion as in OpenCV's five-parameter model."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float
    k3: float


INTRINSICS: Mapping[str, Intrinsics] = {
    "4k": Intrinsics(1280, 720, 953.87, 948.50, 642.81, 345.59, 0.028871, -0.024042, 0.004109, 0.001563, 0.0),
    "thermal": Intrinsics(1280, 720, 947.10, 949.49, 649.16, 365.35, 0.003086, 0.018344, 0.000088, 0.004435, 0.0),
    "usa": Intrinsics(1280, 720, 927.10, 923.18, 646.77, 362.74, 0.006502, -0.012889, -0.001738, 0.002491, -0.01654),
    "ai": Intrinsics(1920, 1080, 1505.94, 1492.49, 997.28, 504.10, 0.05074, -0.046698, 0.001345, 0.007041, 0.0),
}
"""By `Model.key`."""

"""What a decoded picture of the simulated camera shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

STRIP_BITS, TIME_BITS = 32, 20

Image = npt.NDArray[np.uint8]
"""As OpenCV has it: rows, columns, and blue, green, red."""


def decode(path: Path, units: list[list[bytes]], *, luma: bool = False) -> list[Any]:
    """The pictures of an H.264 stream, decoded by ffmpeg; `luma`: the samples as they are in the stream."""
    path.write_bytes(b"".join(b"\0\0\0\1" + unit for picture in units for unit in picture))
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if luma:
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    images = []
    while True:
        ok, image = capture.read()
        if not ok:
            return images
        images.append(image)


def strip(image: Image) -> tuple[int, int]:
    """The picture's number (mod 4096) and its time in ms (mod 2^20) in the strip along the lower edge."""
    height, width = image.shape[:2]
    row = image[height - max(2, height // 60)].mean(axis=1)
    bits = "".join("1" if row[int((block + 0.5) * width / STRIP_BITS)] > 128 else "0" for block in range(STRIP_BITS))
    value = int(bits, 2)
    return value >> TIME_BITS, value & (1 << TIME_BITS) - 1


def horizon(image: Image, column: float) -> float | None:
    """The height of the horizon in a column (share of the width), as a share of the height from the top.

    Sky is blue, ground is not. None: no horizon in this column.
    """
    height, width = image.shape[:2]
    line = image[height // 7 : int(height * 0.86), int(column * (width - 1))].astype(int)
    sky = line[:, 0] > line[:, 2] + 40
    if sky.all() or not sky.any():
        return None
    return (height // 7 + int(np.count_nonzero(sky))) / height

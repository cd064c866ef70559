"""Settings of photos and recordings that go together: what a change takes with it. No I/O.

A camera accepts certain combinations. The setting that a client changes stays as wished; those below it in its group
keep their value if it still fits, and take the nearest one otherwise. The drone would refuse the whole change.
"""

from __future__ import annotations

import enum
from collections.abc import Set
from typing import TypeVar

from msgspec.structs import replace

from anafi_mav.drone import CameraState, PhotoFile, PhotoFormat, PhotoSettings, RecordingSettings, Resolution

WordT = TypeVar("WordT", bound=enum.Enum)


def fitting_photo(camera: CameraState, wish: PhotoSettings) -> PhotoSettings:
    """Return the wish with a projection and a file that go with it.

    Mode, projection, file: each narrows those after it.
    """
    now = camera.photo or PhotoSettings()
    mode = wish.mode or now.mode
    fits = [one for one in camera.photos if mode in one.modes]
    formats = {format for one in fits for format in one.formats}
    format = wish.format or now.format
    if wish.mode is not None and format not in formats and formats:
        format = _first(PhotoFormat, formats)
        wish = replace(wish, format=format)
    files = {file for one in fits if format in one.formats for file in one.files}
    if wish.file is None and (wish.mode or wish.format) is not None and now.file not in files and files:
        wish = replace(wish, file=_first(PhotoFile, files))
    return wish


def fitting_recording(camera: CameraState, wish: RecordingSettings) -> RecordingSettings:
    """Return the wish with a resolution and a frame rate that go with it.

    Mode, resolution, frame rate: each narrows those after it.
    """
    now = camera.recording or RecordingSettings()
    mode = wish.mode or now.mode
    fits = [one for one in camera.recordings if mode in one.modes]
    resolution = wish.resolution or now.resolution
    if wish.mode is not None and not any(resolution in one.resolutions for one in fits) and fits:
        resolution = _first(Resolution, {one for fit in fits for one in fit.resolutions}) or resolution
        wish = replace(wish, resolution=resolution)
    rates = {rate for one in fits if resolution in one.resolutions for rate in one.framerates}
    changed = wish.mode is not None or wish.resolution is not None
    if wish.framerate is None and changed and rates and now.framerate not in rates:
        wanted = now.framerate or max(rates)
        wish = replace(wish, framerate=min(rates, key=lambda rate: (abs(rate - wanted), rate)))
    return wish


def _first(kind: type[WordT], accepted: Set[WordT]) -> WordT | None:
    """Return the accepted value that its vocabulary lists first; None without one."""
    return next((word for word in kind if word in accepted), None)

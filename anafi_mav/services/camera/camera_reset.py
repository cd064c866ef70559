"""Settings of one camera as after a factory reset.

ARSDK resets all settings of a drone or none, so that each is set. Mode and storage stay.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import NamedTuple

from anafi_mav.drone import Camera, CameraState
from anafi_mav.drone.payload.camera_enums import (
    ExposureMode,
    Metering,
    PhotoFile,
    PhotoFormat,
    PhotoMode,
    Style,
    WhiteBalance,
)
from anafi_mav.drone.payload.camera_state import ExposureSettings, PhotoSettings
from anafi_mav.errors import NotSupported

AUTOMATIC = ExposureSettings(mode=ExposureMode.AUTOMATIC, metering=Metering.STANDARD)
SINGLE = PhotoSettings(mode=PhotoMode.SINGLE, format=PhotoFormat.FULL_FRAME, file=PhotoFile.JPEG)

ZOOM_RESET = 0.02
"""Of the zoom factor; the drone reports single precision."""

Read = Callable[[CameraState], object]


class DefaultSetting(NamedTuple):
    """A setting, how it is reset, and how the reset is confirmed."""

    read: Read
    """None: this camera does not report it."""
    is_default: Callable[[CameraState], bool]
    restore: Callable[[Camera, int], Awaitable[object]]


def _exposure_is_default(state: CameraState) -> bool:
    now = state.exposure
    return now is not None and now.mode is AUTOMATIC.mode and now.metering in (None, AUTOMATIC.metering)


def _photo_is_default(state: CameraState) -> bool:
    now = state.photo
    return (
        now is not None
        and now.mode is SINGLE.mode
        and now.format in (None, SINGLE.format)
        and now.file in (None, SINGLE.file)
    )


def _zoom_is_reset(state: CameraState) -> bool:
    return state.zoom is None or abs(state.zoom - 1.0) <= ZOOM_RESET


DEFAULTS = (
    DefaultSetting(
        lambda state: state.exposure, _exposure_is_default, lambda camera, id: camera.set_exposure(AUTOMATIC, id)
    ),
    DefaultSetting(
        lambda state: state.exposure_locked,
        lambda state: not state.exposure_locked,
        lambda camera, id: camera.lock_exposure(False, id=id),
    ),
    DefaultSetting(lambda state: state.ev, lambda state: state.ev == 0.0, lambda camera, id: camera.set_ev(0.0, id)),
    DefaultSetting(
        lambda state: state.white_balance,
        lambda state: state.white_balance is WhiteBalance.AUTOMATIC,
        lambda camera, id: camera.set_white_balance(WhiteBalance.AUTOMATIC, id=id),
    ),
    DefaultSetting(
        lambda state: state.white_balance_locked,
        lambda state: not state.white_balance_locked,
        lambda camera, id: camera.lock_white_balance(False, id),
    ),
    DefaultSetting(lambda state: state.hdr, lambda state: not state.hdr, lambda camera, id: camera.set_hdr(False, id)),
    DefaultSetting(
        lambda state: state.style,
        lambda state: state.style is not None and state.style.style is Style.STANDARD,
        lambda camera, id: camera.set_style(Style.STANDARD, id),
    ),
    DefaultSetting(
        lambda state: state.photo if state.photos else None,
        _photo_is_default,
        lambda camera, id: camera.set_photo(SINGLE, id),
    ),
    DefaultSetting(
        lambda state: state.autorecord,
        lambda state: not state.autorecord,
        lambda camera, id: camera.set_autorecord(False, id),
    ),
    DefaultSetting(lambda state: state.zoom_max, _zoom_is_reset, lambda camera, id: camera.reset_zoom(id)),
)
"""The other settings stay: ranges and presets that count in other modes only."""


async def reset_camera(camera: Camera, id: int) -> bool:
    """Reset the settings that this camera has; return True if the drone confirms all."""
    restored: list[DefaultSetting] = []
    for setting in DEFAULTS:
        if setting.read(camera[id]) is None:
            continue
        try:
            await setting.restore(camera, id)
        except NotSupported:
            continue
        restored.append(setting)
    return all(setting.is_default(camera[id]) for setting in restored)

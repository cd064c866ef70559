"""Photos and series of the active camera by command of a client.

A command starts or ends them after the one before it has been answered, so that a stop never overtakes a start.
"""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass

from msgspec.structs import replace

from anafi_mav import texts
from anafi_mav.drone.payload.camera_enums import CameraMode, PhotoMode
from anafi_mav.drone.payload.camera_state import CameraState, CaptureProgress, CaptureUpdate, PhotoSettings
from anafi_mav.errors import AnafiMavError, CommandTimeout, LinkLost
from anafi_mav.services.camera.camera_targets import enter_mode, require_free, require_storage
from anafi_mav.services.service import Host
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity

SERIES = (PhotoMode.TIME_LAPSE, PhotoMode.GPS_LAPSE)


@dataclass
class PhotoSeries:
    """A series that a command began, or begins."""

    camera: int
    """The camera that takes it."""
    limit: int | None
    """Pictures after which it is ended."""
    restore: PhotoSettings | None
    """Photo settings to restore at its end; None: none, or they are restored."""
    generation: int
    """Of the host's memory: which drone takes it."""
    has_begun: bool = False
    """The drone has reported its begin; an end before that is another photo's."""
    is_active: bool = False
    """The camera's state has reported it; an end by the state before that is another photo's."""
    ending: asyncio.Task[None] | None = None
    """Ends it when it has all its pictures; tried again with the next picture."""
    restoring: asyncio.Task[None] | None = None
    """Restores the photo settings once it has ended; the next photo waits for it."""


class PhotoControl:
    """The photos of one drone."""

    def __init__(self, host: Host) -> None:
        self.host = host
        self._commands = asyncio.Lock()
        self._series: PhotoSeries | None = None
        self._ended: PhotoSeries | None = None
        """The last one that has ended."""

    def link_up(self) -> None:
        """Go on with the series of an earlier connection.

        Restore its settings if it has ended meanwhile, or has ended as the link was lost.
        """
        self._commands = asyncio.Lock()
        under_way, ended, self._series, self._ended = self._series, self._ended, None, None
        unrestored = None if ended is None or ended.restore is None else ended
        series = under_way or unrestored
        if series is None or series.generation != self.host.memory.generation:
            return
        camera = self.host.drone.camera[series.camera]
        if camera.photo is None or camera.photo.mode not in SERIES:
            return
        if not camera.taking:
            self._restore(series)
        elif series is under_way or not series.has_begun:  # else another one
            series.has_begun, series.is_active, self._series = True, True, series

    @property
    def camera(self) -> CameraState:
        """The active camera."""
        return self.host.drone.camera[self.host.drone.camera.active_id]

    @property
    def is_series(self) -> bool:
        """True when a photo of the camera is a series that lasts until it is stopped."""
        photo = self.camera.photo
        return photo is not None and photo.mode in SERIES

    def receive(self, update: CaptureUpdate, taken: int, *, is_present: bool) -> None:
        """Handle an event about a photo; `taken`: pictures of the series so far.

        `is_present`: media or failure of the event are those of the photo or series under way, or of the last one.
        """
        series = self._series
        if series is None or update.is_refused:
            return
        is_own = update.camera == series.camera  # else another camera takes photos, and the series is over
        if is_own and update.progress in (CaptureProgress.STARTED, CaptureProgress.TAKEN):
            series.has_begun, series.is_active = True, series.is_active or update.is_state
        is_full = is_own and series.limit is not None and taken >= series.limit
        if is_full and update.progress is CaptureProgress.TAKEN and (series.ending is None or series.ending.done()):
            series.ending = self.host.spawn(self._end_series(series))
        is_saved = update.progress is CaptureProgress.SAVED and update.is_last and is_present
        has_ended = update.progress is CaptureProgress.ENDED and (series.is_active or not update.is_state)
        ended = not is_own or is_saved or has_ended
        if (ended and series.has_begun) or (is_own and is_present and update.progress is CaptureProgress.FAILED):
            self._series = None
            self._restore(series)

    # Commands.

    async def take(self) -> None:
        """Take a photo as the camera is set; return when it has begun.

        Of a series it is the first picture.
        """
        async with self._commands:
            await self._restored()
            self._require_photo()
            if self.is_series:
                require_free(self.host.vehicle, texts.PHOTO)
                await self._shoot_series(1, None)
            else:
                await self._shoot(self.host.drone.camera.active_id)

    async def begin_series(self, mode: PhotoMode, interval: float | None, limit: int | None) -> None:
        """Begin a series; the settings are restored at its end.

        `interval`: s or m between two pictures; None: as the camera is set. `limit`: pictures after which it ends;
        None: when it is stopped.
        """
        async with self._commands:
            await self._restored()
            require_free(self.host.vehicle, texts.PHOTO)
            self._require_photo()
            before = self.camera.photo
            is_set = before is not None and before.mode is mode and interval in (None, before.interval)
            if not is_set:
                unbegun = PhotoSeries(self.host.drone.camera.active_id, None, before, self.host.memory.generation)
                try:
                    await self._set_series(mode, interval)
                except (LinkLost, CommandTimeout):  # the drone may have set it
                    self._restore(unbegun)
                    raise
            await self._shoot_series(limit, None if is_set else before)

    async def follow_distance(self, distance: float) -> None:
        """Take a photo each `distance` m, in place of a series under way."""
        photo = self.camera.photo
        if self.camera.taking and photo is not None and (photo.mode, photo.interval) == (PhotoMode.GPS_LAPSE, distance):
            return
        await self.stop_series()
        await enter_mode(self.host, CameraMode.PHOTO, texts.PHOTO)
        await self.begin_series(PhotoMode.GPS_LAPSE, distance, None)

    async def stop(self) -> None:
        """End a series, or a panorama with its flight; does nothing without one."""
        drone = self.host.drone
        if not drone.animations.state.is_panorama:
            await self.stop_series()
            return
        if drone.controller.pilot_acquired_control:
            raise Refused(texts.PANORAMA, texts.PILOT)
        await drone.animations.cancel()

    async def stop_series(self) -> None:
        """End a series; does nothing without one."""
        async with self._commands:
            if not self.camera.taking:
                return
            require_free(self.host.vehicle, texts.PHOTO)
            photo = self.camera.photo
            if photo is not None and photo.mode is PhotoMode.SINGLE:
                return  # it ends by itself, at once
            if not self.is_series:
                raise Refused(texts.PHOTO, texts.NO_SERIES)
            await self.host.drone.camera.stop_photo(self.host.drone.camera.active_id)

    async def _restored(self) -> None:
        """Wait until the settings of before the last series are restored."""
        if self._ended is not None and self._ended.restoring is not None:
            await asyncio.wait({self._ended.restoring})

    def _require_photo(self) -> None:
        """Refuse a photo that cannot be taken in this mode, or not be stored."""
        camera = self.camera
        if camera.mode is None:
            raise Refused(texts.PHOTO, texts.CAMERA_UNKNOWN)
        if camera.mode is not CameraMode.PHOTO:
            raise Refused(texts.PHOTO, texts.CAMERA_IN_VIDEO_MODE)
        if camera.taking:
            raise Refused(texts.PHOTO, texts.CAMERA_TAKES_PHOTOS)
        require_storage(self.host.drone, texts.PHOTO)

    async def _shoot(self, camera: int) -> None:
        await self.host.drone.camera.take_photo(camera, until_saved=False)

    async def _shoot_series(self, limit: int | None, restore: PhotoSettings | None) -> None:
        """Begin a series; its pictures, and its end, may be reported before this returns."""
        camera = self.host.drone.camera.active_id
        series = self._series = PhotoSeries(camera, limit, restore, self.host.memory.generation)
        try:
            await self._shoot(camera)
        except AnafiMavError:
            if self._series is series:
                self._series = None
                self._restore(series)
                await self._restored()
            raise

    async def _set_series(self, mode: PhotoMode, interval: float | None) -> None:
        camera = self.host.drone.camera
        settings = await camera.set_photo(PhotoSettings(mode=mode, interval=interval), camera.active_id)
        if settings is None or settings.mode is not mode:
            raise Refused(texts.PHOTO, texts.CAMERA_MODE_KEPT)
        if interval is None or settings.interval is None or math.isclose(interval, settings.interval, rel_tol=1e-3):
            return
        if mode is PhotoMode.GPS_LAPSE:
            self.host.text(Severity.NOTICE, texts.PHOTO_DISTANCE.fill(metres=settings.interval))
        else:
            self.host.text(Severity.NOTICE, texts.PHOTO_INTERVAL.fill(seconds=settings.interval))

    async def _end_series(self, series: PhotoSeries) -> None:
        """End the series that has all its pictures, after the command that begins it."""
        try:
            async with self._commands:
                if self._series is series:
                    await self.host.drone.camera.stop_photo(series.camera)
        except AnafiMavError as error:
            self.host.text(Severity.WARNING, texts.PHOTO_SERIES_FAILED.fill(error=texts.from_below(error)))

    def _restore(self, series: PhotoSeries) -> None:
        """Restore the settings of before a series that has ended."""
        self._ended = series
        if series.restore is not None:
            series.restoring = self.host.spawn(self._restore_photo(series, series.restore))

    async def _restore_photo(self, series: PhotoSeries, settings: PhotoSettings) -> None:
        """Restore photo settings.

        Without a link they are left to be restored at the next connection. A drone that keeps its mode may take photos:
        the end of another photo has then been taken for that of the series, which goes on.
        """
        camera = self.host.drone.camera
        try:
            restored = await camera.set_photo(replace(settings, megapixels=None), series.camera)
            if restored is None or restored.mode is not settings.mode:
                if camera[series.camera].taking and self._series is None:
                    self._series = series
                    return
                raise Refused(texts.PHOTO, texts.CAMERA_MODE_KEPT)
        except LinkLost:
            return
        except AnafiMavError as error:
            self.host.text(Severity.WARNING, texts.PHOTO_MODE_KEPT.fill(error=texts.from_below(error)))
        series.restore = None

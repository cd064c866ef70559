"""Photos and recordings: the commands, CAMERA_CAPTURE_STATUS, and CAMERA_IMAGE_CAPTURED for every photo.

Whoever takes a photo (a client, a mission, the pilot) and however: one message per picture leaves when the drone has
stored it, with place and orientation of the camera when its shutter opened (MAVLink camera.md; conformance C6).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Callable, Mapping
from typing import Any

from msgspec.structs import replace

from anafi_mav import texts, units
from anafi_mav.drone import events
from anafi_mav.drone.events import FlyingState
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.camera_enums import CameraMode, PhotoMode
from anafi_mav.drone.payload.camera_state import CameraState, CaptureProgress, PhotoSettings
from anafi_mav.drone.payload.media import MediaItem
from anafi_mav.drone.payload.storage import Storage
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.errors import AnafiMavError, CommandRejected
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.camera.camera_messages import MODES
from anafi_mav.services.camera.camera_pose import add_frame, add_states
from anafi_mav.services.camera.camera_targets import (
    is_at_autopilot,
    require_camera,
    require_free,
    require_idle,
    require_storage,
)
from anafi_mav.services.camera.photo_log import KEY, CapturedImage, PhotoLog
from anafi_mav.services.camera.pose_track import Pose, PoseTrack
from anafi_mav.services.camera.shot_tracker import Picture, ShotTracker, named
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect
from anafi_mav.services.service import Answer, Host, Request, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import EventHandler, Subscriptions
from anafi_mav.vehicle.vehicle import Vehicle

logger = logging.getLogger(__name__)

SERIES = (PhotoMode.TIME_LAPSE, PhotoMode.GPS_LAPSE)

LATCH = 0.5
"""s after the shutter by which the pose of a photo is taken: events arrive five times a second."""

ADDRESS = 0.6
"""s for which CAMERA_IMAGE_CAPTURED waits for the name of the file: it leaves within a second of the photo's end."""

LISTED = 10.0
"""s in which the drone may list a photo; the address is then filled in for those who request it again."""

FASTEST_STATUS = 10.0
"""Hz of CAMERA_CAPTURE_STATUS while recording, at most."""

MAX_SHOWN = 100
"""Photos that one request may send."""

MEBIBYTE = 1024.0 * 1024.0

PANORAMA_TYPES = (
    (360.0, events.AnimationType.SPHERICAL_PHOTO_PANORAMA),
    (180.0, events.AnimationType.HORIZONTAL_180_PHOTO_PANORAMA),
)
"""The panorama of an angle (deg, at least), largest first."""


class CaptureService(Service):
    """Photos, series, panoramas and recordings of the active camera."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._log = PhotoLog()
        self._serial = ""
        self._shots = ShotTracker()
        self._track = PoseTrack()
        self._poses: dict[float, Pose] = {}
        """Poses of photos whose shutter has opened, by that time."""
        self._undo: Callable[[], None] | None = None
        self._recording_since: float | None = None
        """When the recording under way began (s, monotonic)."""
        self._sent: tuple[Any, ...] = ()
        """What the last CAMERA_CAPTURE_STATUS to all said."""
        self._reports: dict[Channel, tuple[float, float]] = {}
        """Channels that get the status while recording: interval (s), and when it is due."""
        self._limit: int | None = None
        """Pictures after which the series under way is ended."""
        self._restore: PhotoSettings | None = None
        """Photo settings to restore after the series under way."""
        self._saving: asyncio.Task[None] | None = None

    # Link up, link down.

    def link_up(self) -> None:
        drone, now = self.host.drone, self.host.clock.monotonic()
        if drone.identity.serial != self._serial:
            self._serial = drone.identity.serial
            self._log = PhotoLog(PhotoLog.stored_count(self.host.memory.settings))
        self._shots, self._poses, self._limit, self._restore = ShotTracker(), {}, None, None
        self._undo = drone.video.subscribe(lambda frame: self._on_frame(frame))
        self._recording_since = self._found_recording(now)
        self._sent = self._state()

    def link_down(self) -> None:
        if self._undo is not None:
            self._undo()
            self._undo = None
        self._track.clear()
        self._reports.clear()
        self._saving = None

    def channel_closed(self, channel: Channel) -> None:
        self._reports.pop(channel, None)

    def _found_recording(self, now: float) -> float | None:
        """Return when the recording began that runs at connection; None: none runs.

        The drone reports the time by its own clock, which the gateway set, or a duration.
        """
        for camera in self.host.drone.camera.state.cameras.values():
            if camera.recording_now:
                elapsed = 0.0
                if camera.recording_since_ms is not None:
                    elapsed = self.host.clock.time() - camera.recording_since_ms / 1e3
                elif camera.recording_for_ms is not None:
                    elapsed = camera.recording_for_ms / 1e3
                return now - max(elapsed, 0.0)
        return None

    # What the drone reports.

    def subscriptions(self) -> Subscriptions:
        handlers: dict[type[events.Message], EventHandler] = {
            events.AttitudeChanged: lambda message, now: self._on_state(now),
            events.GimbalAttitudeChanged: lambda message, now: self._on_state(now),
            events.SpeedChanged: lambda message, now: self._on_state(now),
            events.AltitudeChanged: lambda message, now: self._on_state(now),
            events.GpsLocationChanged: lambda message, now: self._on_state(now, located=True),
        }
        handlers |= dict.fromkeys(Camera.PHOTO_EVENTS, self._on_photo)
        handlers |= dict.fromkeys(Camera.RECORDING_EVENTS, self._on_recording)
        handlers |= dict.fromkeys(Storage.RESULT_EVENTS, self._on_formatted)
        return handlers

    def _on_state(self, now: float, *, located: bool = False) -> None:
        add_states(self._track, self.host.drone, now, located=located)

    def _on_frame(self, frame: VideoFrame) -> None:
        add_frame(self._track, frame)

    def _on_photo(self, message: events.Message, now: float) -> None:
        update = Camera.photo_update(message)
        if update is None or update.camera != self.host.drone.camera.active:
            return
        pictures = self._shots.receive(update, now)
        if update.progress is CaptureProgress.FAILED and pictures:
            self.host.text(Severity.WARNING, texts.PHOTO_NOT_STORED.fill(reason=update.reason))
        self._report(pictures, update.media, now)
        if update.progress is CaptureProgress.TAKEN and self._limit is not None and self._shots.taken >= self._limit:
            self._limit = None
            self.host.spawn(self._end_series())
        over = update.progress in (CaptureProgress.ENDED, CaptureProgress.FAILED) or (
            update.progress is CaptureProgress.SAVED and not self.host.drone.camera[update.camera].taking
        )
        if over:
            self._limit = None
            if self._restore is not None:
                restore, self._restore = self._restore, None
                self.host.spawn(self._restore_photo(restore, update.camera))
        self._send_changed()

    def _on_recording(self, message: events.Message, now: float) -> None:
        update = Camera.recording_update(message)
        if update is None:
            return
        if update.progress is CaptureProgress.STARTED and self._recording_since is None:
            self._recording_since = now
        elif update.progress is CaptureProgress.ENDED:
            if update.reason and self._recording_since is not None:
                self.host.text(Severity.WARNING, texts.RECORDING_ENDED.fill(reason=update.reason))
            self._recording_since = None
        elif update.progress is CaptureProgress.FAILED and self._recording_since is not None:
            self.host.text(Severity.WARNING, texts.RECORDING_ENDED.fill(reason=update.reason))
        self._send_changed()

    def _on_formatted(self, message: events.Message, now: float) -> None:
        """The index begins again when the storage for media was formatted, whoever did it."""
        if Storage.formatted(message) == self.host.drone.storage.main:
            self._log.reset()
            self._remember()
            self._send_changed()

    def tick(self, now: float) -> None:
        for at in self._shots.pending:
            if at not in self._poses and (self._track.is_complete(at) or now - at >= LATCH):
                self._poses[at] = self._track.pose(at)
        if self._shots.pending:
            self._report(self._shots.expire(now, is_series=self._is_series), "", now)
        if self._recording_since is None and self._camera.recording_now:
            self._recording_since = self._found_recording(now)
        elif self._recording_since is not None and not self._records:
            self._recording_since = None
        self._send_changed()
        for channel, (interval, due) in tuple(self._reports.items()):
            if not self._records:
                del self._reports[channel]
            elif now >= due:
                self._reports[channel] = interval, max(due + interval, now)
                self.host.send(self._status(self.host.vehicle, self.host.times()), channel)

    @property
    def _camera(self) -> CameraState:
        return self.host.drone.camera[self.host.drone.camera.active]

    @property
    def _records(self) -> bool:
        return any(camera.recording_now for camera in self.host.drone.camera.state.cameras.values())

    @property
    def _is_series(self) -> bool:
        photo = self._camera.photo
        return photo is not None and photo.mode in SERIES

    # Photos.

    def _report(self, pictures: list[Picture], media: str, now: float) -> None:
        """Send the messages of these pictures, with the names of their files if the drone lists them in time."""
        images = [self._log.add(lambda index, picture=picture: self._image(picture, index)) for picture in pictures]
        if images:
            self._remember()
        if media and self.host.drone.media.state.index is not None:
            self.host.spawn(self._send_named(images, media))
        else:
            for image in images:
                self.host.send(image_captured(self.host, image))

    def _image(self, picture: Picture, index: int) -> CapturedImage:
        host = self.host
        pose = self._poses.pop(picture.at, None) or self._track.pose(picture.at)
        height = None if pose.height is None else host.vehicle.height.amsl(pose.height)
        if height is None and (location := host.drone.gps.state.location) is not None:
            height = location.altitude
        age = host.clock.monotonic() - picture.at
        return CapturedImage(
            index=index,
            at=picture.at,
            utc_us=round((host.clock.time() - age) * 1e6),
            capture=picture.capture,
            number=picture.number,
            is_saved=picture.is_saved,
            latitude=None if pose.place is None else pose.place[0],
            longitude=None if pose.place is None else pose.place[1],
            amsl=height,
            height=pose.height,
            quaternion=pose.quaternion,
        )

    async def _send_named(self, images: list[CapturedImage], media: str) -> None:
        """Send the pictures once the names of their files are known, or after `ADDRESS` without them."""
        capture = self._shots.capture
        listing = asyncio.ensure_future(self._named(media, capture))
        try:
            await asyncio.wait({listing}, timeout=ADDRESS)
            for image in images:
                self.host.send(image_captured(self.host, self._log.find(image.index) or image))
            await listing
        except AnafiMavError as error:
            logger.debug("%s: files of %s not known: %s", self.host.drone.name, media, error)
        finally:
            listing.cancel()

    async def _named(self, media: str, capture: int) -> None:
        """Fill in file and place of the pictures of a media, as the drone lists them."""
        item: MediaItem | None = None
        async with _limited(LISTED):
            while item is None:
                with contextlib.suppress(CommandRejected):  # not indexed yet
                    item = await self.host.drone.media.get(media)
                if item is None:
                    await asyncio.sleep(ADDRESS / 3.0)
        assert item is not None
        urls = named((file.resource_id, file_url(file.datetime, file.resource_id)) for file in item.resources)
        places = {file_url(file.datetime, file.resource_id): file.gps or item.gps for file in item.resources}
        for image in tuple(self._log.unnamed(capture)):
            if not 0 < image.number <= len(urls):
                continue
            url = urls[image.number - 1]
            place, changes = places[url], dict[str, Any](url=url)
            if place is not None and abs(place.latitude) <= 90.0 and abs(place.longitude) <= 180.0:
                changes |= {"latitude": place.latitude, "longitude": place.longitude}
            self._log.change(capture, image.number, **changes)

    def _remember(self) -> None:
        """Store the index: it goes on after a restart of the gateway."""
        self.host.memory.settings[KEY] = self._log.count
        if self._saving is None or self._saving.done():
            self._saving = self.host.spawn(self._save())

    async def _save(self) -> None:
        count = -1
        while count != self._log.count:
            count = self._log.count
            await self.host.memory.save()

    # Messages.

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS: MessageStream(self._status)}

    def requests(self) -> Mapping[int, Request]:
        return {dialect.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED: self._images}

    def _images(self, inbound: Inbound, command: Command) -> Answer:
        first, last = command.params[1], command.params[2]
        if not math.isfinite(first):
            return dialect.MAV_RESULT_DENIED
        found = self._log.range(int(first), int(last) if math.isfinite(last) else 0)
        if not found:
            return dialect.MAV_RESULT_DENIED
        return [image_captured(self.host, image) for image in found[:MAX_SHOWN]]

    def _state(self) -> tuple[Any, ...]:
        camera = self._camera
        taking, series = bool(camera.taking), bool(camera.taking) and self._is_series
        photo = camera.photo
        interval = photo.interval if series and photo is not None and photo.mode is PhotoMode.TIME_LAPSE else None
        status = 0 if not taking else 1 if not series else 3 if self._shots.pending else 2
        return status, int(self._records), interval or 0.0, self._log.count

    def _status(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        status, records, interval, count = self._state()
        since = self._recording_since
        elapsed = 0 if since is None or not records else max(1, round((self.host.clock.monotonic() - since) * 1e3))
        free = self.host.drone.storage[self.host.drone.storage.main].available
        return dialect.MAVLink_camera_capture_status_message(
            times.boot_ms,
            status,
            records,
            interval,
            elapsed & 0xFFFFFFFF,
            math.nan if free is None else free / MEBIBYTE,
            count,
            0,
        )

    def _send_changed(self) -> None:
        """Send CAMERA_CAPTURE_STATUS to all when it says something else than the last one."""
        state = self._state()
        if state != self._sent:
            self._sent = state
            self.host.send(self._status(self.host.vehicle, self.host.times()))

    # Commands.

    def actions(self) -> Mapping[int, Action]:
        return {
            **self._capture_actions(),
            dialect.MAV_CMD_PANORAMA_CREATE: Action(
                self._panorama,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.IRREVOCABLE,
                group=ActionGroup.PHOTO,
            ),
        }

    def _capture_actions(self) -> dict[int, Action]:
        def action(handler: Any, effect: Any, group: ActionGroup) -> Action:
            return Action(handler, location=False, altitude=Altitude.UNUSED, effect=effect, group=group)

        return {
            dialect.MAV_CMD_IMAGE_START_CAPTURE: action(self._start_capture, _effect_of_capture, ActionGroup.PHOTO),
            dialect.MAV_CMD_IMAGE_STOP_CAPTURE: action(self._stop_capture, Effect.STOP, ActionGroup.PHOTO),
            dialect.MAV_CMD_VIDEO_START_CAPTURE: action(
                self._start_video, Effect.IRREVOCABLE, ActionGroup.RECORDING
            ),
            dialect.MAV_CMD_VIDEO_STOP_CAPTURE: action(self._stop_video, Effect.STOP, ActionGroup.RECORDING),
        }

    def autopilot_actions(self) -> Mapping[int, Action]:
        """Return the commands of before the camera protocol, and its own for clients of ArduPilot's family."""

        def action(handler: Any, effect: Any, group: ActionGroup) -> Action:
            return Action(handler, location=False, altitude=Altitude.UNUSED, effect=effect, group=group)

        own = {
            dialect.MAV_CMD_IMAGE_START_CAPTURE: (self._start_capture_in_any_mode, _effect_of_capture),
            dialect.MAV_CMD_IMAGE_STOP_CAPTURE: (self._stop_capture, Effect.STOP),
            dialect.MAV_CMD_VIDEO_START_CAPTURE: (self._start_video_in_any_mode, Effect.IRREVOCABLE),
            dialect.MAV_CMD_VIDEO_STOP_CAPTURE: (self._stop_video, Effect.STOP),
        }
        groups = {id: row.group for id, row in self._capture_actions().items()}
        return {
            **{
                id: Action(
                    handler,
                    location=False,
                    altitude=Altitude.UNUSED,
                    effect=effect,
                    group=groups[id],
                    offered=is_at_autopilot,
                )
                for id, (handler, effect) in own.items()
            },
            dialect.MAV_CMD_DO_DIGICAM_CONTROL: action(self._digicam, Effect.EACH, ActionGroup.PHOTO),
            dialect.MAV_CMD_DO_CONTROL_VIDEO: action(self._control_video, Effect.STOP, ActionGroup.RECORDING),
            dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST: action(self._trigger_by_distance, Effect.STOP, ActionGroup.PHOTO),
        }

    # Commands: photos.

    async def _start_capture(self, command: Command) -> None:
        """MAV_CMD_IMAGE_START_CAPTURE: param2 interval (s), param3 pictures (0: until stopped).

        One picture without an interval is what the camera's photo mode says: single, burst, bracketing, or a series
        that goes on until it is stopped. An interval, or another number, makes a time-lapse for as long as it lasts.
        """
        require_camera(texts.PHOTO, command.params[0])
        interval, count = _number(command.params[1]), command.params[2]
        if math.isnan(count):
            count = 0.0 if interval > 0.0 else 1.0
        if interval < 0.0 or not math.isfinite(interval) or count < 0.0 or not math.isfinite(count):
            raise Refused(texts.PHOTO, texts.NEGATIVE, lasting=True)
        self._require_photo()
        if count == 1.0:
            await self._take()
            return
        require_free(self.host.vehicle, texts.PHOTO)
        photo = self._camera.photo or PhotoSettings()
        is_own = photo.mode in SERIES and interval == 0.0
        wish = PhotoSettings() if is_own else PhotoSettings(mode=PhotoMode.TIME_LAPSE, interval=interval or None)
        await self._begin_series(wish, int(count) or None)

    async def _start_capture_in_any_mode(self, command: Command) -> None:
        require_camera(texts.PHOTO, command.params[0])
        await self._enter(CameraMode.PHOTO, texts.PHOTO)
        await self._start_capture(command)

    async def _take(self) -> None:
        """Take a photo as the camera is set; returns when it has begun."""
        drone = self.host.drone
        id = drone.camera.active
        if drone.camera[id].taking:
            raise Refused(texts.PHOTO, texts.CAMERA_TAKES_PHOTOS)
        await drone.camera.take_photo(id, until_saved=False)

    async def _begin_series(self, wish: PhotoSettings, limit: int | None) -> None:
        """Begin a series; the settings of before are restored at its end."""
        drone = self.host.drone
        id = drone.camera.active
        before = drone.camera[id].photo
        if drone.camera[id].taking:
            raise Refused(texts.PHOTO, texts.CAMERA_TAKES_PHOTOS)
        if wish.mode is not None:
            settings = await drone.camera.set_photo(wish, id)
            if settings is None or settings.mode is not wish.mode:
                raise Refused(texts.PHOTO, texts.CAMERA_MODE_KEPT)
            if wish.interval is not None and settings.interval is not None:
                self._tell_interval(wish, settings.interval)
        try:
            await drone.camera.take_photo(id, until_saved=False)
        except AnafiMavError:
            if wish.mode is not None and before is not None:
                await drone.camera.set_photo(_settings_to_restore(before), id)
            raise
        self._limit = limit
        self._restore = before if wish.mode is not None else None

    def _tell_interval(self, wish: PhotoSettings, interval: float) -> None:
        if wish.interval is None or math.isclose(wish.interval, interval, rel_tol=1e-3):
            return
        if wish.mode is PhotoMode.GPS_LAPSE:
            self.host.text(Severity.NOTICE, texts.PHOTO_DISTANCE.fill(metres=interval))
        else:
            self.host.text(Severity.NOTICE, texts.PHOTO_INTERVAL.fill(seconds=interval))

    async def _stop_capture(self, command: Command) -> None:
        """MAV_CMD_IMAGE_STOP_CAPTURE: end a series; accepted when none is taken."""
        require_camera(texts.PHOTO, command.params[0])
        await self._stop_series()

    async def _stop_series(self) -> None:
        drone = self.host.drone
        id = drone.camera.active
        ended = self.host.end_others(ActionGroup.PHOTO)
        if ended:
            await asyncio.wait(ended)
        if not drone.camera[id].taking:
            return
        if not self._is_series:
            raise Refused(texts.PHOTO, texts.NO_SERIES)
        require_free(self.host.vehicle, texts.PHOTO)
        await drone.camera.stop_photo(id)

    async def _end_series(self) -> None:
        """End the series that has all its pictures."""
        try:
            await self.host.drone.camera.stop_photo(self.host.drone.camera.active)
        except AnafiMavError as error:
            self.host.text(Severity.WARNING, texts.PHOTO_SERIES_FAILED.fill(error=error))

    async def _restore_photo(self, settings: PhotoSettings, camera: int) -> None:
        try:
            await self.host.drone.camera.set_photo(_settings_to_restore(settings), camera)
        except AnafiMavError as error:
            self.host.text(Severity.WARNING, texts.PHOTO_MODE_KEPT.fill(error=error))

    def _require_photo(self) -> None:
        """Refuse a photo that cannot be taken in this mode, or not be stored."""
        camera = self._camera
        if camera.mode is None:
            raise Refused(texts.PHOTO, texts.CAMERA_UNKNOWN)
        if camera.mode is not CameraMode.PHOTO:
            raise Refused(texts.PHOTO, texts.CAMERA_IN_VIDEO_MODE)
        require_storage(self.host.drone, texts.PHOTO)

    async def _enter(self, mode: CameraMode, what: texts.Subject) -> None:
        """Change the mode for a command whose clients know no modes."""
        drone = self.host.drone
        id = drone.camera.active
        state = drone.camera[id]
        if state.mode is mode:
            return
        if mode not in (state.modes or ()):
            raise Refused(what, texts.CAMERA_MODE_KEPT, lasting=True)
        require_free(self.host.vehicle, what)
        require_idle(drone, what)
        if await drone.camera.set_mode(mode, id) is not mode:
            raise Refused(what, texts.CAMERA_MODE_KEPT)

    async def _digicam(self, command: Command) -> None:
        """MAV_CMD_DO_DIGICAM_CONTROL: param2 zoom (%), param3 steps of zoom, param5 1 takes a photo."""
        zoom, steps, shoot = _number(command.params[1]), _number(command.params[2]), _number(command.x)
        drone = self.host.drone
        id = drone.camera.active
        if zoom > 0.0 or steps != 0.0:
            require_free(self.host.vehicle, texts.ZOOM)
            camera = drone.camera[id]
            factor = zoom_factor(camera, zoom) if zoom > 0.0 else (camera.zoom or 1.0) * ZOOM_STEP**steps
            await drone.camera.zoom(factor, id)
        if shoot == 1.0:
            await self._enter(CameraMode.PHOTO, texts.PHOTO)
            self._require_photo()
            await self._take()

    async def _trigger_by_distance(self, command: Command) -> None:
        """MAV_CMD_DO_SET_CAM_TRIGG_DIST: param1 m between two photos, 0 ends it."""
        distance = _number(command.params[0])
        require_camera(texts.PHOTO, command.params[3])
        if distance < 0.0 or not math.isfinite(distance):
            raise Refused(texts.PHOTO, texts.NEGATIVE, lasting=True)
        if distance == 0.0:
            await self._stop_series()
            return
        require_free(self.host.vehicle, texts.PHOTO)
        await self._enter(CameraMode.PHOTO, texts.PHOTO)
        self._require_photo()
        await self._begin_series(PhotoSettings(mode=PhotoMode.GPS_LAPSE, interval=distance), None)

    async def _panorama(self, command: Command) -> None:
        """MAV_CMD_PANORAMA_CREATE: a photo panorama of Parrot's, by its horizontal angle; it turns the drone.

        No other flight may be active: an animation would end it.
        """
        drone, vehicle = self.host.drone, self.host.vehicle
        wide, high = _number(command.params[0]), _number(command.params[1])
        require_free(vehicle, texts.PANORAMA)
        if drone.piloting.state.flying is not FlyingState.HOVERING or vehicle.is_busy:
            raise Refused(texts.PANORAMA, texts.DRONE_NOT_HOVERING)
        await self._enter(CameraMode.PHOTO, texts.PANORAMA)
        require_storage(drone, texts.PANORAMA)
        require_idle(drone, texts.PANORAMA)
        kind = next((kind for angle, kind in PANORAMA_TYPES if abs(wide) >= angle), None)
        if kind is None:
            vertical = events.AnimationType.VERTICAL_180_PHOTO_PANORAMA
            kind = vertical if abs(high) > abs(wide) else events.AnimationType.SUPER_WIDE_PHOTO_PANORAMA
        await drone.animations.photo_panorama(kind)

    # Commands: recordings.

    async def _start_video(self, command: Command) -> None:
        """MAV_CMD_VIDEO_START_CAPTURE: param1 stream (0: the one that is shown), param2 Hz of the status meanwhile."""
        require_camera(texts.RECORDING, command.params[2])
        self._require_stream(command.params[0])
        if self._camera.mode is not CameraMode.RECORDING:
            raise Refused(texts.RECORDING, texts.CAMERA_IN_PHOTO_MODE)
        await self._record()
        self._report_at(command, command.params[1])

    async def _start_video_in_any_mode(self, command: Command) -> None:
        require_camera(texts.RECORDING, command.params[2])
        await self._enter(CameraMode.RECORDING, texts.RECORDING)
        await self._start_video(command)

    def _require_stream(self, number: float) -> None:
        shown = self.host.drone.streams.shown.number
        if not math.isnan(number) and number not in (0.0, float(shown)):
            raise Refused(texts.RECORDING, texts.NO_SUCH_STREAM, lasting=True)

    async def _record(self) -> None:
        drone = self.host.drone
        if self._camera.mode is None:
            raise Refused(texts.RECORDING, texts.CAMERA_UNKNOWN)
        if not self._records:
            require_storage(drone, texts.RECORDING)
        await drone.camera.start_recording(drone.camera.active)

    def _report_at(self, command: Command, rate: float) -> None:
        """Send the status at this rate (Hz) while the recording runs, to the channel of the command."""
        if rate > 0.0 and math.isfinite(rate) and isinstance(command.client, tuple):
            channel = command.client[0]
            interval = 1.0 / min(rate, FASTEST_STATUS)
            self._reports[channel] = interval, self.host.clock.monotonic() + interval

    async def _stop_video(self, command: Command) -> None:
        """MAV_CMD_VIDEO_STOP_CAPTURE: accepted when nothing is recorded."""
        require_camera(texts.RECORDING, command.params[1])
        await self._stop_record()

    async def _stop_record(self) -> None:
        drone = self.host.drone
        ended = self.host.end_others(ActionGroup.RECORDING)
        if ended:
            await asyncio.wait(ended)
        id = next((id for id, camera in drone.camera.state.cameras.items() if camera.recording_now), None)
        if id is None:
            return
        require_free(self.host.vehicle, texts.RECORDING)
        await drone.camera.stop_recording(id)

    async def _control_video(self, command: Command) -> None:
        """MAV_CMD_DO_CONTROL_VIDEO: param4 1 records, 0 ends it; the stream (param2, param3) needs no command."""
        camera, record = command.params[0], command.params[3]
        if camera != -1.0:
            require_camera(texts.RECORDING, camera)
        if math.isnan(record) or record == 0.0:
            await self._stop_record()
            return
        await self._enter(CameraMode.RECORDING, texts.RECORDING)
        await self._record()


def _number(value: float) -> float:
    """Return a parameter; 0 when it is unset."""
    return 0.0 if math.isnan(value) else value


def _effect_of_capture(command: Command) -> Effect:
    """A sequence number makes a command unique; one without counts each time it is sent."""
    return Effect.IRREVOCABLE if command.params[3] >= 1.0 else Effect.EACH


def _settings_to_restore(settings: PhotoSettings) -> PhotoSettings:
    """Return what `Camera.set_photo` restores these settings with."""
    return replace(settings, megapixels=None)


def file_url(date: str, name: str) -> str:
    """Return the address of a file of the drone's in the component's FTP tree; `date` is ISO 8601 basic."""
    day = f"{date[:4]}-{date[4:6]}-{date[6:8]}"
    return f"mftp://[;comp={dialect.MAV_COMP_ID_CAMERA}]/media/{day}/{name}"


def image_captured(host: Host, image: CapturedImage) -> dialect.MAVLink_message:
    """Return CAMERA_IMAGE_CAPTURED. It has no value for an unknown position: 0."""
    return dialect.MAVLink_camera_image_captured_message(
        host.times(image.at).boot_ms,
        image.utc_us,
        0,
        0 if image.latitude is None else units.deg_e7(image.latitude),
        0 if image.longitude is None else units.deg_e7(image.longitude),
        0 if image.amsl is None else units.millimetres(image.amsl),
        0 if image.height is None else units.millimetres(image.height),
        list(image.quaternion or (math.nan,) * 4),
        image.index,
        int(image.is_saved),
        image.url.encode(),
    )

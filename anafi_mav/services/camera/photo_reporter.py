"""CAMERA_IMAGE_CAPTURED for every photo of the active camera, and its history.

One message per picture leaves when the drone has stored it, whether a client, a mission or the pilot took it. Its
place and orientation are those of the camera when the shutter opened (MAVLink camera.md; conformance C6).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Callable
from functools import partial
from typing import Any

from msgspec.structs import replace

from anafi_mav import texts, units
from anafi_mav.drone.events import PlayingState
from anafi_mav.drone.payload.camera_enums import PhotoMode
from anafi_mav.drone.payload.camera_state import CaptureProgress, CaptureUpdate
from anafi_mav.drone.payload.media import MediaItem
from anafi_mav.drone.payload.media_file import Resource
from anafi_mav.errors import AnafiMavError, CommandRejected
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.camera.camera_pose import EventSamples, add_frame
from anafi_mav.services.camera.photo_log import KEY, CapturedImage, PhotoLog, renumbered
from anafi_mav.services.camera.pose_track import CameraPose, PoseTrack
from anafi_mav.services.camera.shot_tracker import CapturedShot, ShotTracker, named
from anafi_mav.services.commands import Command
from anafi_mav.services.service import Answer, Host
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import ValueInterest, ValueSubscriptions

logger = logging.getLogger(__name__)

LATCH = 0.5
"""s after the shutter by which the pose of a photo is taken: events arrive five times a second."""

ADDRESS = 0.6
"""s for which CAMERA_IMAGE_CAPTURED waits for the name of the file: it leaves within a second of the photo's end."""

LISTED = 10.0
"""s in which the drone may list a photo; the address is then filled in for clients that request it again."""

RETRY = 0.2
"""s after which a photo that is not listed yet is requested again."""

GROWTH = 1.1
"""Ratio by which a series grows until the drone lists it again. A list names all its pictures, some 400 bytes each: one
of a thousand pictures with each of them would be more than all other files may take in flight."""

MAX_SHOWN = 100
"""Photos that one request may send; a client requests the others by range."""


class PhotoReporter:
    """Photos of one drone, from the shutter to the message."""

    def __init__(self, host: Host) -> None:
        self.host = host
        self._log = PhotoLog()
        self._generation = -1
        self._shots = ShotTracker()
        self._samples = EventSamples()
        self._track = PoseTrack(self._samples)
        self._poses: dict[float, CameraPose] = {}
        """Poses of photos whose shutter has opened, by that time."""
        self._undo: Callable[[], None] | None = None
        self._saving: asyncio.Task[None] | None = None
        self._turn = asyncio.Lock()
        """Photos are sent in the sequence of their index."""

    @property
    def count(self) -> int:
        """Index of the next photo: the photos since the last format."""
        return self._log.count

    @property
    def taken(self) -> int:
        """Pictures of the photo, burst or series under way; 0 without one."""
        return self._shots.taken

    @property
    def camera(self) -> int | None:
        """Camera of the photo under way, or whose pictures are not all reported; None: none."""
        return self._shots.camera

    @property
    def is_saving(self) -> bool:
        """True while a picture is taken that is not reported yet."""
        return bool(self._shots.pending)

    # Link up, link down.

    def link_up(self) -> None:
        """Continue the index of this drone."""
        drone = self.host.drone
        before = self._shots
        if self.host.memory.generation != self._generation:
            self._generation = self.host.memory.generation
            self._log, before = PhotoLog(PhotoLog.stored_count(self.host.memory.settings)), ShotTracker(before.capture)
        self._shots, self._poses = ShotTracker(before.capture), {}
        id = drone.camera.active_id
        if drone.camera[id].taking:
            known = max(before.taken, drone.camera[id].photo_count or 0)
            is_same = before.is_open and before.camera == id
            self._shots.join(id, known, before.since if is_same else self.host.clock.monotonic())
        self._turn = asyncio.Lock()
        self._undo = drone.video.subscribe(lambda frame: add_frame(self._track, frame))

    def link_down(self) -> None:
        """Forget what is under way: its end will not be reported."""
        if self._undo is not None:
            self._undo()
            self._undo = None
        self._track.clear()
        self._saving = None

    # What the drone reports.

    def value_subscriptions(self) -> ValueSubscriptions:
        """Return the handler of the values that change the camera's pose."""
        return {self._samples.add: ValueInterest(EventSamples.KINDS)}

    def receive(self, update: CaptureUpdate, now: float) -> bool:
        """Handle an event about a photo of the active camera.

        Return False for the failure, or the media, of a photo before the one under way or the last one.
        """
        is_earlier = update.progress is CaptureProgress.FAILED and self._shots.awaits_capture_before
        shots = self._shots.receive(update, now, self._most(update.camera), self._interval(update.camera))
        if update.progress is CaptureProgress.FAILED and shots:
            self.host.text(Severity.WARNING, texts.PHOTO_NOT_STORED.fill(reason=update.reason))
        stored_as = self._shots.media_of(shots[-1].capture) if shots and update.media else update.media
        if stored_as != update.media:  # that of the last photo had been taken for its own
            self._name_later([], update.media, is_last=update.is_last)
        self._report(shots, stored_as, is_last=update.is_last)
        if update.progress is CaptureProgress.ENDED:
            self._name_rest()
        return not is_earlier and (not update.media or self._shots.capture_of(update.media) == self._shots.capture)

    def _most(self, camera: int) -> int | None:
        """Return the pictures of a photo of this camera; None: not known.

        The drone may report its shutter twice. A panorama, of a plan or by itself, has many pictures in mode SINGLE.
        """
        drone = self.host.drone
        photo, playing = drone.camera[camera].photo, drone.flight_plan.state.playing
        if photo is None or drone.animations.state.is_running or playing is PlayingState.PLAYING:
            return None
        match photo.mode:
            case PhotoMode.SINGLE:
                return 1
            case PhotoMode.BURST:
                return None if photo.burst is None else photo.burst.pictures
            case PhotoMode.BRACKETING:
                return None if photo.bracketing is None else photo.bracketing.pictures
        return None

    def _interval(self, camera: int) -> float | None:
        """Return the time between two pictures of this camera, s; None: not known."""
        photo = self.host.drone.camera[camera].photo
        return photo.interval if photo is not None and photo.mode is PhotoMode.TIME_LAPSE else None

    def reset(self) -> None:
        """Begin the index again: the storage was formatted."""
        self._log.reset()
        self._remember()

    def tick(self, now: float, *, is_series: bool) -> None:
        """Latch poses, and report the pictures that are not waited for any longer."""
        pending = self._shots.pending
        self._poses = {at: pose for at, pose in self._poses.items() if at in pending}
        for at in pending:
            if at not in self._poses and (self._track.is_complete(at) or now - at >= LATCH):
                self._poses[at] = self._track.pose(at)
        self._report(self._shots.expire(now, is_series=is_series), "")

    # Messages.

    def images(self, inbound: Inbound, command: Command) -> Answer:
        """Return the photos that MAV_CMD_REQUEST_MESSAGE names by index or range."""
        first, last = command.params[1], command.params[2]
        if not math.isfinite(first):
            return dialect.MAV_RESULT_DENIED
        found = self._log.range(int(first), int(last) if math.isfinite(last) else 0)
        if not found:
            return dialect.MAV_RESULT_DENIED
        return [image_captured(self.host, image) for image in found[:MAX_SHOWN]]

    def _report(self, shots: list[CapturedShot], media: str, *, is_last: bool = False) -> None:
        """Send the messages of these pictures, with the names of their files if known in time.

        `is_last`: the drone has reported the end of the media as well. It may have more pictures than were reported.
        """
        images = [self._log.add(partial(self._image, shot)) for shot in shots]
        if images:
            self._remember()
        numbers = [shot.number for shot in shots] or [image.number for image in self._unnamed(media)]
        is_due = self._shots.is_over(media) or any(map(is_listed, numbers))
        self._name_later(images, media if is_due else "", is_last=is_last)

    def _name_rest(self) -> None:
        """Name the last pictures of a series, which has ended."""
        if self._unnamed(self._shots.media):
            self._name_later([], self._shots.media, is_last=False)

    def _unnamed(self, media: str) -> list[CapturedImage]:
        """Return the pictures of a media whose files are not known: they may be reported before it."""
        capture = self._shots.capture_of(media)
        images = self._log.of_capture(capture) if capture else []
        return [image for image in images if image.is_saved and not image.url]

    def _name_later(self, images: list[CapturedImage], media: str, *, is_last: bool) -> None:
        """Send the messages of these pictures.

        The names of all pictures of a media are filled in, if one is given.
        """
        capture = self._shots.capture_of(media)
        listed = media if capture and self.host.drone.media.state.index is not None else ""
        if images or listed:
            self.host.spawn(self._finish(images, listed, capture, is_last=is_last))

    def _send(self, images: list[CapturedImage]) -> None:
        for image in images:
            self.host.send(image_captured(self.host, self._log.find(image.index) or image))

    def _image(self, shot: CapturedShot, index: int) -> CapturedImage:
        host = self.host
        age = host.clock.monotonic() - shot.at
        image = CapturedImage(
            index=index,
            at=shot.at,
            utc_us=round((host.clock.time() - age) * 1e6),
            capture=shot.capture,
            number=shot.number,
            is_saved=shot.is_saved,
        )
        return replace(image, **self._pose(shot.at))

    def _pose(self, at: float) -> dict[str, Any]:
        """Return the fields of a photo that are the camera's pose at a moment."""
        host = self.host
        pose = self._poses.pop(at, None) or self._track.pose(at)
        amsl = None if pose.height is None else host.vehicle.height.amsl(pose.height)
        if amsl is None and (location := host.drone.gps.state.location) is not None:
            amsl = location.altitude
        return {
            "latitude": None if pose.place is None else pose.place[0],
            "longitude": None if pose.place is None else pose.place[1],
            "amsl": amsl,
            "height": pose.height,
            "quaternion": pose.quaternion,
        }

    # Names of files.

    async def _finish(self, images: list[CapturedImage], media: str, capture: int, *, is_last: bool) -> None:
        """Send pictures once their pose and files are known; without files after `ADDRESS`."""
        async with self._turn:
            _, item = await asyncio.gather(self._settle(images), self._listed(media, ADDRESS))
            added = [] if item is None else self._name(item, capture, is_last=is_last)
            self._send([*images, *added])
        if item is None and (item := await self._listed(media, LISTED)) is not None:
            self._send(self._name(item, capture, is_last=is_last))

    async def _settle(self, images: list[CapturedImage]) -> None:
        """Correct poses by what the drone reports just after the shutter."""
        recent = [image for image in images if self.host.clock.monotonic() - image.at < LATCH]
        if not recent:
            return
        last = max(image.at for image in recent)
        await asyncio.sleep(last + LATCH - self.host.clock.monotonic())
        for image in recent:
            self._log.change(image.index, **self._pose(image.at))

    async def _listed(self, media: str, timeout: float) -> MediaItem | None:
        """Return a media as the drone lists it; None when it does not list it in time."""
        if not media:
            return None
        try:
            return await asyncio.wait_for(self._find(media), timeout)
        except (AnafiMavError, asyncio.TimeoutError) as error:
            logger.debug("%s: files of %s not known: %r", self.host.drone.name, media, error)
            return None

    async def _find(self, media: str) -> MediaItem:
        """Return a media as soon as the drone lists it."""
        while True:
            with contextlib.suppress(CommandRejected):  # not indexed yet
                return await self.host.drone.media.get(media)
            await asyncio.sleep(RETRY)

    def _name(self, item: MediaItem, capture: int, *, is_last: bool) -> list[CapturedImage]:
        """Fill in file and place of the pictures of a media; return pictures that were not reported."""
        files = named((file.resource_id, file) for file in item.resources)
        capture = self._shots.capture_of(item.media_id) or capture  # it may have been taken for that of the next photo
        known = self._log.of_capture(capture)
        added: list[CapturedImage] = []
        if is_last and known:
            last = known[-1]
            missing = range(last.number + 1, min(len(files), MAX_SHOWN) + 1)
            added = [self._log.add(partial(renumbered, last, number)) for number in missing]
        if added:
            self._remember()
        for image in (*known, *added):
            file = files[image.number - 1] if 0 < image.number <= len(files) else None
            if image.is_saved and file is not None and image.url != file_url(file):
                changes: dict[str, Any] = {"url": file_url(file)}
                place = file.gps or item.gps
                if place is not None and abs(place.latitude) <= 90.0 and abs(place.longitude) <= 180.0:
                    changes |= {"latitude": place.latitude, "longitude": place.longitude}
                self._log.change(image.index, **changes)
        return added

    # Index.

    def _remember(self) -> None:
        """Store the index: it continues after a restart of the gateway."""
        self.host.memory.settings[KEY] = self._log.count
        if self._saving is None or self._saving.done():
            self._saving = self.host.spawn(self._save())

    async def _save(self) -> None:
        count = -1
        while count != self._log.count:
            count = self._log.count
            if (problem := await self.host.memory.save()) is not None:
                self.host.warn_throttled(problem)


def is_listed(number: int) -> bool:
    """Return True when a media is listed after its picture of this number."""
    return number <= 1 or math.floor(math.log(number, GROWTH)) > math.floor(math.log(number - 1, GROWTH))


def file_url(file: Resource) -> str:
    """Return the address of one of the drone's files in the component's FTP tree."""
    return f"mftp://[;comp={dialect.MAV_COMP_ID_CAMERA}]/media/{file.date}/{file.resource_id}"


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

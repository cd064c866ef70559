"""Commands for photos and recordings, and CAMERA_CAPTURE_STATUS.

MAVLink camera.md; conformance C6. `photo_control` takes photos, `photo_reporter` reports them. A recording that the
pilot, a mission or the drone began is shown as one of a client.
"""

from __future__ import annotations

import asyncio
import dataclasses
import math
from collections.abc import Awaitable, Callable, Mapping

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone import events
from anafi_mav.drone.payload.camera import BEGUN, Camera
from anafi_mav.drone.payload.camera_enums import CameraMode, PhotoMode
from anafi_mav.drone.payload.camera_state import CaptureProgress, CaptureUpdate
from anafi_mav.drone.payload.storage import Storage
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.services.camera.camera_messages import MEBIBYTE, stepped_zoom, zoom_factor
from anafi_mav.services.camera.camera_targets import (
    enter_mode,
    is_at_autopilot,
    media_storage,
    require_free,
    require_storage,
)
from anafi_mav.services.camera.photo_control import PhotoControl
from anafi_mav.services.camera.photo_reporter import PhotoReporter
from anafi_mav.services.camera.shot_tracker import REPEATED
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect, require_camera
from anafi_mav.services.service import LOOK_EVERY, Host, Request, Service, channel_of
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import EventHandler, Subscriptions, ValueSubscriptions
from anafi_mav.vehicle.vehicle import Vehicle

FASTEST_STATUS = 10.0
"""Hz of CAMERA_CAPTURE_STATUS while recording, at most."""

IDLE, SHOOTING, WAITING, SHOOTING_SERIES = range(4)
"""Values of CAMERA_CAPTURE_STATUS.image_status."""

_Status = tuple[int, bool, float, int]
"""image_status, recording, interval of a series (s), photos."""


class CaptureService(Service):
    """Photos, series and recordings of the active camera."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._reporter = PhotoReporter(host)
        self._photos = PhotoControl(host)
        self._recordings = asyncio.Lock()
        """A stop waits for the answer to the start before it."""
        self._recording_since: float | None = None
        """When the recording under way began (s, monotonic)."""
        self._recording_failure = ""
        """Reason that the drone reported last; the recording may continue nevertheless."""
        self._recorded: tuple[str, ...] = ()
        """Media ids of the last recordings whose end is reported."""
        self._is_formatting = False
        """The drone formats the storage for media, and reports the end by its state alone."""
        self._sent: _Status | None = None
        """Content of the last CAMERA_CAPTURE_STATUS to all."""
        self._rates: dict[Channel, tuple[float, float]] = {}
        """Channels that get the status while recording: interval (s), and when it is due."""

    # Link up, link down.

    def link_up(self) -> None:
        self._reporter.link_up()
        self._photos.link_up()
        self._recordings = asyncio.Lock()
        self._recording_since, self._recording_failure = self._found_recording(self.host.clock.monotonic()), ""
        self._recorded = ()
        if self._sent is None:
            self._sent = self._status()
        self._send_changed()  # without a link the pilot, or the drone itself, may have changed it

    def link_down(self) -> None:
        self._reporter.link_down()
        self._rates.clear()

    def channel_closed(self, channel: Channel) -> None:
        self._rates.pop(channel, None)

    def _found_recording(self, now: float) -> float | None:
        """Return when the recording began that the drone reports; None: none runs.

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

    # Events of the drone.

    def subscriptions(self) -> Subscriptions:
        handlers: dict[type[events.Message], EventHandler] = dict.fromkeys(Camera.PHOTO_EVENTS, self._on_photo)
        handlers |= dict.fromkeys(Camera.RECORDING_EVENTS, self._on_recording)
        handlers |= dict.fromkeys(Storage.RESULT_EVENTS, self._on_formatted)
        handlers |= dict.fromkeys(Storage.STATE_EVENTS, self._on_storage_state)
        return handlers

    def value_subscriptions(self) -> ValueSubscriptions:
        return self._reporter.value_subscriptions()

    def _on_photo(self, message: events.Message, now: float) -> None:
        update = Camera.photo_update(message)
        if update is None or not self._is_of_photo(update):
            return
        is_present = self._reporter.receive(update, now)
        self._photos.receive(update, self._reporter.taken, is_present=is_present)
        self._send_changed()

    def _is_of_photo(self, update: CaptureUpdate) -> bool:
        """Return True for an event of the camera whose photo is under way.

        Without one it is the active camera. A thermal mode changes the active camera, and ends a photo; the drone may
        report that afterwards.
        """
        camera = None if update.progress in BEGUN else self._reporter.camera
        return update.camera == (self.host.drone.camera.active_id if camera is None else camera)

    def _on_recording(self, message: events.Message, now: float) -> None:
        update = Camera.recording_update(message)
        if update is not None and update.progress is CaptureProgress.STARTED:
            self._recording_failure = ""
            if self._recording_since is None:
                self._recording_since = now
        elif update is not None and update.media not in self._recorded:
            # The state decides whether it runs: this may be a late report about the one before.
            if update.media:
                self._recorded = (*self._recorded, update.media)[-REPEATED:]
            self._recording_failure = update.reason
            if update.media and self._recording_since is None and not self._records:
                self._end_recording()  # the state was reported first
        self._follow_recording(now)
        self._send_changed()

    def _follow_recording(self, now: float) -> None:
        """Note the begin and the end of a recording by the reported state."""
        if self._recording_since is None:
            self._recording_since = self._found_recording(now)
        elif not self._records:
            self._end_recording()

    def _end_recording(self) -> None:
        """Note the end of the recording; one that no command has ended is a text."""
        reason = self._recording_failure
        if reason:
            self.host.text(Severity.WARNING, texts.RECORDING_ENDED.fill(reason=reason))
        self._recording_since, self._recording_failure = None, ""

    def _on_formatted(self, message: events.Message, now: float) -> None:
        """Begin the index again when the storage for media was formatted."""
        formatted = Storage.formatted(message)
        if formatted is not None and formatted == media_storage(self.host.drone):
            self._begin_index()

    def _on_storage_state(self, message: events.Message, now: float) -> None:
        """Do the same for a storage whose format has no result event."""
        id = media_storage(self.host.drone)
        if id is None or self.host.drone.storage[id].has_format_result:
            return
        state = self.host.drone.storage[id].file_system
        if state == events.FsState.FORMATTING:
            self._is_formatting = True
        elif self._is_formatting and state in (events.FsState.READY, events.FsState.ERROR):  # after a check
            self._is_formatting = False
            if state == events.FsState.READY:
                self._begin_index()

    def _begin_index(self) -> None:
        """The storage for media is empty: ids of media may be those of before."""
        self._reporter.reset()
        self._recorded = ()
        self._send_changed()

    def tick(self, now: float) -> float:
        self._reporter.tick(now, is_series=self._photos.is_series)
        self._follow_recording(now)
        self._send_changed()
        for channel, (interval, due) in tuple(self._rates.items()):
            if not self._records:
                del self._rates[channel]
            elif now >= due:
                self._rates[channel] = interval, max(due + interval, now)
                self.host.send(self._message(self.host.vehicle, self.host.times()), channel)
        if self._reporter.is_saving:
            return now + LOOK_EVERY
        return min((due for _, due in self._rates.values()), default=NEVER)

    @property
    def _records(self) -> bool:
        return self.host.drone.camera.state.is_recording

    # Messages.

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS: MessageStream(self._message)}

    def requests(self) -> Mapping[int, Request]:
        return {dialect.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED: self._reporter.images}

    def _status(self) -> _Status:
        camera = self._photos.camera
        photo, status, interval = camera.photo, IDLE, 0.0
        if camera.taking:
            status = SHOOTING
            if self._photos.is_series:
                status = SHOOTING_SERIES if self._reporter.is_saving else WAITING
            if photo is not None and photo.mode is PhotoMode.TIME_LAPSE:
                interval = photo.interval or 0.0
        return status, self._records, interval, self._reporter.count

    def _message(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        status, records, interval, count = self._status()
        since, elapsed = self._recording_since, 0
        if since is not None and records:
            elapsed = max(1, round((self.host.clock.monotonic() - since) * 1e3)) & 0xFFFFFFFF
        id = media_storage(vehicle.drone)
        storage = None if id is None else vehicle.drone.storage[id]
        free = 0 if storage is None or storage.physical == events.PhyState.UNDETECTED else storage.available
        available = math.nan if free is None else free / MEBIBYTE
        return dialect.MAVLink_camera_capture_status_message(
            times.boot_ms, status, int(records), interval, elapsed, available, count, 0
        )

    def _send_changed(self) -> None:
        """Send CAMERA_CAPTURE_STATUS to all when its content differs from the last one."""
        status = self._status()
        if status != self._sent:
            self._sent = status
            self.host.send(self._message(self.host.vehicle, self.host.times()))

    # Commands.

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_IMAGE_START_CAPTURE: _action(self._start_capture, _effect_of_capture, ActionGroup.PHOTO),
            dialect.MAV_CMD_IMAGE_STOP_CAPTURE: _action(self._stop_capture, Effect.STOP, ActionGroup.PHOTO),
            dialect.MAV_CMD_VIDEO_START_CAPTURE: _action(self._start_video, Effect.TARGET, ActionGroup.RECORDING),
            dialect.MAV_CMD_VIDEO_STOP_CAPTURE: _action(self._stop_video, Effect.STOP, ActionGroup.RECORDING),
        }

    def autopilot_actions(self) -> Mapping[int, Action]:
        """Return older commands, and those of the camera for clients of ArduPilot's family."""
        own = {
            dialect.MAV_CMD_IMAGE_START_CAPTURE: _action(
                self._start_capture_in_any_mode, _effect_of_capture, ActionGroup.PHOTO
            ),
            dialect.MAV_CMD_IMAGE_STOP_CAPTURE: _action(self._stop_capture, Effect.STOP, ActionGroup.PHOTO),
            dialect.MAV_CMD_VIDEO_START_CAPTURE: _action(
                self._start_video_in_any_mode, Effect.TARGET, ActionGroup.RECORDING
            ),
            dialect.MAV_CMD_VIDEO_STOP_CAPTURE: _action(self._stop_video, Effect.STOP, ActionGroup.RECORDING),
        }
        return {
            **{id: dataclasses.replace(row, offered=is_at_autopilot) for id, row in own.items()},
            dialect.MAV_CMD_DO_DIGICAM_CONTROL: _action(self._digicam, Effect.EACH, ActionGroup.PHOTO),
            dialect.MAV_CMD_DO_CONTROL_VIDEO: _action(self._control_video, _effect_of_recording, ActionGroup.RECORDING),
            dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST: _action(
                self._trigger_by_distance, _effect_of_distance, ActionGroup.PHOTO
            ),
        }

    # Commands: photos.

    async def _start_capture(self, command: Command) -> None:
        """MAV_CMD_IMAGE_START_CAPTURE: param2 interval (s), param3 pictures (0: until stopped).

        One picture is what the camera's photo mode means by it: single, burst, bracketing, or the first picture of a
        series. Any other number is a time-lapse for as long as it lasts.
        """
        require_camera(texts.PHOTO, command.params[0])
        interval, count = _number(command.params[1]), command.params[2]
        if math.isnan(count):
            count = 0.0 if interval > 0.0 else 1.0
        _require_amount(interval)
        if count < 0.0 or not count.is_integer():  # infinity is none
            raise Refused(texts.PHOTO, texts.NO_COUNT, lasting=True)
        if count == 1.0:
            await self._photos.take()
            return
        photo = self._photos.camera.photo
        by_distance = interval == 0.0 and photo is not None and photo.mode is PhotoMode.GPS_LAPSE
        mode = PhotoMode.GPS_LAPSE if by_distance else PhotoMode.TIME_LAPSE
        await self._photos.begin_series(mode, interval or None, int(count) or None)

    async def _start_capture_in_any_mode(self, command: Command) -> None:
        require_camera(texts.PHOTO, command.params[0])
        await enter_mode(self.host, CameraMode.PHOTO, texts.PHOTO)
        await self._start_capture(command)

    async def _stop_capture(self, command: Command) -> None:
        """MAV_CMD_IMAGE_STOP_CAPTURE: end a series or a panorama; accepted without one."""
        require_camera(texts.PHOTO, command.params[0])
        await self._photos.stop()

    async def _digicam(self, command: Command) -> None:
        """MAV_CMD_DO_DIGICAM_CONTROL: param2 zoom (%), param3 steps of zoom, param5 1 takes a photo."""
        zoom, steps, shoot = _number(command.params[1]), _number(command.params[2]), _number(command.x)
        if not (math.isfinite(zoom) and math.isfinite(steps)):
            raise Refused(texts.ZOOM, texts.NUMBER_MISSING, lasting=True)
        drone = self.host.drone
        id = drone.camera.active_id
        if zoom > 0.0 or steps != 0.0:
            require_free(self.host.vehicle, texts.ZOOM)
            camera = drone.camera[id]
            factor = zoom_factor(camera, zoom) if zoom > 0.0 else stepped_zoom(camera, steps)
            await drone.camera.zoom(factor, id)
        if shoot == 1.0:
            await enter_mode(self.host, CameraMode.PHOTO, texts.PHOTO)
            await self._photos.take()

    async def _trigger_by_distance(self, command: Command) -> None:
        """MAV_CMD_DO_SET_CAM_TRIGG_DIST: param1 m between two photos, 0 ends it."""
        distance = _number(command.params[0])
        require_camera(texts.PHOTO, command.params[3])
        _require_amount(distance)
        if distance == 0.0:
            await self._photos.stop()
        else:
            await self._photos.follow_distance(distance)

    # Commands: recordings.

    async def _start_video(self, command: Command) -> None:
        """MAV_CMD_VIDEO_START_CAPTURE: param1 stream (0: the shown one), param2 Hz of the status."""
        require_camera(texts.RECORDING, command.params[2])
        shown = self.host.drone.streams.shown.number
        if not math.isnan(command.params[0]) and command.params[0] not in (0.0, float(shown)):
            raise Refused(texts.RECORDING, texts.NO_SUCH_STREAM, lasting=True)
        await self._record()
        self._report_at(command, command.params[1])

    async def _start_video_in_any_mode(self, command: Command) -> None:
        require_camera(texts.RECORDING, command.params[2])
        await enter_mode(self.host, CameraMode.RECORDING, texts.RECORDING)
        await self._start_video(command)

    async def _record(self) -> None:
        drone = self.host.drone
        async with self._recordings:
            mode = self._photos.camera.mode
            if mode is None:
                raise Refused(texts.RECORDING, texts.CAMERA_UNKNOWN)
            if mode is not CameraMode.RECORDING:
                raise Refused(texts.RECORDING, texts.CAMERA_IN_PHOTO_MODE)
            if not self._records:
                require_storage(drone, texts.RECORDING)
                await drone.camera.start_recording(drone.camera.active_id)

    def _report_at(self, command: Command, rate: float) -> None:
        """Send the status at this rate (Hz) while the recording runs, to the channel of the command."""
        channel = channel_of(command.client)
        if rate > 0.0 and math.isfinite(rate) and channel is not None and channel.is_open:
            interval = 1.0 / min(rate, FASTEST_STATUS)
            self._rates[channel] = interval, self.host.clock.monotonic() + interval

    async def _stop_video(self, command: Command) -> None:
        """MAV_CMD_VIDEO_STOP_CAPTURE: end the recording; accepted without one."""
        require_camera(texts.RECORDING, command.params[1])
        await self._stop_recording()

    async def _stop_recording(self) -> None:
        drone = self.host.drone
        async with self._recordings:
            for id, camera in drone.camera.state.cameras.items():
                if camera.recording_now:
                    require_free(self.host.vehicle, texts.RECORDING)
                    await drone.camera.stop_recording(id)
                    return

    async def _control_video(self, command: Command) -> None:
        """MAV_CMD_DO_CONTROL_VIDEO: param4 1 records, 0 ends it; the live stream needs no command."""
        camera, record = command.params[0], _number(command.params[3])
        if camera != -1.0:
            require_camera(texts.RECORDING, camera)
        if record not in (0.0, 1.0):
            raise Refused(texts.RECORDING, texts.PARAM4_BINARY, lasting=True)
        if record == 0.0:
            await self._stop_recording()
            return
        await enter_mode(self.host, CameraMode.RECORDING, texts.RECORDING)
        await self._record()


def _action(
    handler: Callable[[Command], Awaitable[None]], effect: Effect | Callable[[Command], Effect], group: ActionGroup
) -> Action:
    return Action(handler, location=False, altitude=Altitude.UNUSED, effect=effect, group=group)


def _number(value: float) -> float:
    """Return a parameter; 0 when it is unset."""
    return 0.0 if math.isnan(value) else value


def _require_amount(value: float) -> None:
    """Refuse an interval or a distance that is infinite or negative."""
    if not math.isfinite(value):
        raise Refused(texts.PHOTO, texts.NUMBER_MISSING, lasting=True)
    if value < 0.0:
        raise Refused(texts.PHOTO, texts.NEGATIVE, lasting=True)


def _effect_of_capture(command: Command) -> Effect:
    """A sequence number makes a command unique; one without counts each time it is sent."""
    return Effect.NUMBERED if command.params[3] >= 1.0 else Effect.EACH


def _effect_of_distance(command: Command) -> Effect:
    return Effect.STOP if _number(command.params[0]) == 0.0 else Effect.TARGET


def _effect_of_recording(command: Command) -> Effect:
    return Effect.STOP if _number(command.params[3]) == 0.0 else Effect.TARGET

"""Telemetry that only the live video has.

Exposure, gains, white balance, fields of view, goodput, and the pose 30 times a second. The video costs the radio some
Mbit/s, so it runs while a client needs it and not longer: a stream of ANAFI_CAMERA_EXPOSURE or ANAFI_PICTURE, or a
pose message at more than ten times a second. When it runs for another reason, e.g. because a viewer watches it,
exposure and link are sent all the same.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence

from anafi_mav import texts, units
from anafi_mav.clock import NEVER
from anafi_mav.drone import events
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.status.link import Link, LinkState
from anafi_mav.drone.values import Values
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.services.pose import picture_pose
from anafi_mav.services.service import Host, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.services.telemetry.height_track import HeightTrack
from anafi_mav.vehicle.base.subscriptions import ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.vehicle import Vehicle

NAN = math.nan
UNKNOWN_U8, UNKNOWN_I16, UNKNOWN_U16, UNKNOWN_U32, UNKNOWN_U64 = 0xFF, 0x7FFF, 0xFFFF, 0xFFFFFFFF, (1 << 64) - 1

RETRY = 10.0
"""s until a video that did not come is tried again."""


def _number(value: float | None, factor: float = 1.0) -> float:
    return NAN if value is None else value * factor


def camera_exposure(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ANAFI_CAMERA_EXPOSURE of the main camera.

    By the newest picture, without pictures by the camera's state.
    """
    camera, frame = vehicle.drone.camera[0], vehicle.drone.video.state.frame
    if camera.mode is None:
        return None
    if frame is None:
        light = (_number(camera.shutter_s), _number(camera.iso), NAN, NAN)
        view = (_number(camera.hfov_deg), NAN)
    else:
        metadata = frame.metadata
        light = (
            _number(metadata.exposure_time, 1e-3),
            _number(metadata.iso_gain),
            _number(metadata.awb_r_gain),
            _number(metadata.awb_b_gain),
        )
        view = (_number(metadata.hfov, units.DEG_PER_RAD), _number(metadata.vfov, units.DEG_PER_RAD))
    return dialect.MAVLink_anafi_camera_exposure_message(
        times.boot_ms,
        *light,
        _number(camera.ev),
        _number(camera.zoom),
        *view,
        0,
        dialect.ANAFI_EXPOSURE_SOURCE_STEPS if frame is None else dialect.ANAFI_EXPOSURE_SOURCE_FRAME,
    )


def _link_flags(state: LinkState) -> int:
    if state.perturbed is None:
        return 0
    return int(
        dialect.ANAFI_LINK_FLAGS_REPORTED
        | (dialect.ANAFI_LINK_FLAGS_4G_INTERFERENCE if state.interference_4g else 0)
        | (dialect.ANAFI_LINK_FLAGS_PERTURBED if state.perturbed else 0)
    )


def link(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ANAFI_LINK.

    The drone's events have priority: the video reports the same, and goodput besides.
    """
    state, frame = vehicle.drone.link.state, vehicle.drone.video.state.frame
    wifi = None if frame is None else frame.metadata.wifi
    starfish = None if frame is None else frame.metadata.starfish
    quality, rssi = state.quality, state.rssi_dbm
    if quality is None:
        quality = wifi.quality if wifi is not None else starfish.quality if starfish is not None else None
    if rssi is None and wifi is not None:
        rssi = wifi.rssi
    return dialect.MAVLink_anafi_link_message(
        times.boot_ms,
        UNKNOWN_U32 if wifi is None else min(wifi.goodput * 1000, UNKNOWN_U32 - 1),
        UNKNOWN_I16 if rssi is None else units.saturate(rssi, 16),
        UNKNOWN_U8 if quality is None or quality < 0 else min(quality, 5),
        _link_flags(state),
    )


def _quaternion(quat: Sequence[float] | None) -> list[float]:
    return [NAN] * 4 if quat is None else list(quat)


def picture(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ANAFI_PICTURE of a picture; None without one."""
    frame = times.pose.frame
    if frame is None:
        return None
    metadata = frame.metadata
    return dialect.MAVLink_anafi_picture_message(
        UNKNOWN_U64 if metadata.timestamp is None else metadata.timestamp,
        times.boot_ms,
        frame.timestamp,
        _quaternion(frame.camera_rotation),
        _quaternion(frame.rotation),
        _number(metadata.hfov, units.DEG_PER_RAD),
        _number(metadata.vfov, units.DEG_PER_RAD),
        min(round((frame.arrived - frame.shot) * 1e3), UNKNOWN_U16 - 1),
        dialect.ANAFI_PICTURE_CLOCK_REPORT if frame.is_clock_known else dialect.ANAFI_PICTURE_CLOCK_ARRIVAL,
    )


class VideoTelemetryService(Service):
    """Watches the video for as long as a client needs what only its pictures report."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._altitudes = HeightTrack()
        """Above the take-off point."""
        self._heights = HeightTrack()
        """Above the ground below."""
        self._interest = ValueInterest((events.AltitudeChanged, events.AltitudeAboveGroundChanged), is_on=False)
        self._undo: Callable[[], None] | None = None
        self._watch: asyncio.Task[None] | None = None
        self._retry_at = 0.0

    def streams(self) -> Mapping[int, MessageStream]:
        return {
            dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE: MessageStream(
                camera_exposure, tuple(Camera.REDUCERS), repeated=True, needs_video=True
            ),
            dialect.MAVLINK_MSG_ID_ANAFI_PICTURE: MessageStream(picture, from_pictures=True, needs_video=True),
            dialect.MAVLINK_MSG_ID_ANAFI_LINK: MessageStream(link, tuple(Link.REDUCERS), repeated=True),
        }

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_heights: self._interest}

    def _on_heights(self, values: Values, now: float) -> None:
        """Keep the heights for pictures: they are older than the newest events."""
        drone = self.host.drone
        if events.AltitudeChanged in values:
            self._note(self._altitudes, drone.piloting.state.altitude, now)
        if events.AltitudeAboveGroundChanged in values:
            self._note(self._heights, drone.piloting.state.height, now)

    @staticmethod
    def _note(track: HeightTrack, height: float | None, now: float) -> None:
        if height is None:
            track.clear()
        else:
            track.add(now, height)

    def link_up(self) -> None:
        self._undo = self.host.drone.video.subscribe(self._frame)

    def link_down(self) -> None:
        if self._undo is not None:
            self._undo()
            self._undo = None
        self._watch = None  # cancelled with all that the host has spawned
        self._retry_at = 0.0
        self._altitudes.clear()
        self._heights.clear()

    def tick(self, now: float) -> float:
        needs_pictures = self.host.needs_pictures
        wanted = self.host.needs_video or needs_pictures
        self._interest.switch(needs_pictures)
        if self._watch is not None and (self._watch.done() or not wanted):
            self._watch.cancel()
            self._watch = None
        if not wanted:
            self._retry_at = 0.0
        if wanted and self._watch is None and now >= self._retry_at:
            self._retry_at = now + RETRY
            self._watch = self.host.spawn(self._stay())
        return self._retry_at if wanted and self._watch is None else NEVER

    async def _stay(self) -> None:
        try:
            async with self.host.drone.video.watching():
                await asyncio.Event().wait()  # until it is cancelled
        except AnafiMavError as error:
            if self.host.needs_pictures:
                self.host.warn_throttled(texts.NO_PICTURES.fill(error=error))
            else:
                self.host.warn_throttled(texts.NO_EXPOSURE.fill(error=error))

    def _frame(self, frame: VideoFrame) -> None:
        self.host.mark_updated(dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE, frame.arrived)
        self.host.mark_updated(dialect.MAVLINK_MSG_ID_ANAFI_LINK, frame.arrived)
        if self.host.needs_pictures:
            speed = frame.metadata.speed
            climb = 0.0 if speed is None else -speed.down
            altitude, height = self._altitudes.at(frame.shot, climb), self._heights.at(frame.shot, climb)
            pose = picture_pose(self.host.vehicle, frame, altitude, height)
            self.host.show_picture(pose, frame.shot, frame.arrived)

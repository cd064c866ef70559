"""Pose of the camera by the drone's states, and its samples for the geotags."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from typing import TypeAlias, TypeVar

from anafi_mav.drone import Drone, events
from anafi_mav.drone.element import position
from anafi_mav.drone.payload.gimbal import MAIN
from anafi_mav.drone.values import ValueLayout, Values
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.services.camera.pose_track import DEGREES, CameraPose, PoseSource, PoseTrack, ValueTrack
from anafi_mav.units import LARGEST, RAD_PER_DEG
from anafi_mav.vehicle.vehicle import Vehicle

Sample: TypeAlias = tuple[float, ...]

MessageT = TypeVar("MessageT", bound=events.Message)

KEPT, MOST = 3.0, 256
"""s for which samples of events are kept, a photo's pose is taken within half a second, and how many at most."""

SPACING = 0.05
"""s between two samples of events that are kept. An ANAFI reports five times a second; between samples at this distance
the way of a drone or gimbal is straight."""

MAX_LAYOUTS = 64
"""Layouts of values whose last sample is remembered; a drone in operation sends a dozen."""


def camera_angles(drone: Drone) -> tuple[float, float, float] | None:
    """Return roll, pitch and yaw of the camera to the horizon and true north, rad.

    The gimbal's own yaw is to magnetic north, so that the drone's heading is used instead.
    """
    gimbal, body = drone.gimbal[MAIN].attitude, drone.piloting.state.attitude
    if gimbal is None or body is None:
        return None
    return (
        gimbal.absolute.roll * RAD_PER_DEG,
        gimbal.absolute.pitch * RAD_PER_DEG,
        body.yaw + gimbal.relative.yaw * RAD_PER_DEG,
    )


def current_pose(vehicle: Vehicle) -> CameraPose:
    """Return the newest pose; without a place while that of the vehicle is unknown or old."""
    drone = vehicle.drone
    return CameraPose(vehicle.place, drone.piloting.state.altitude, camera_angles(drone))


def _heading(message: events.AttitudeChanged) -> Sample:
    return (message.yaw,)


def _gimbal(message: events.GimbalAttitudeChanged) -> Sample | None:
    if message.gimbal_id != MAIN:
        return None
    angles = message.roll_absolute, message.pitch_absolute, message.yaw_relative
    return tuple(angle * RAD_PER_DEG for angle in angles)


def _velocity(message: events.SpeedChanged) -> Sample:
    return message.speedX, message.speedY


def _height(message: events.AltitudeChanged) -> Sample:
    return (message.altitude,)


def _place(message: events.GpsLocationChanged) -> Sample | None:
    place = position(message.latitude, message.longitude, message.altitude)
    return None if place is None else (place.latitude, place.longitude)


class _EventTrack(ValueTrack):
    """Samples that are read from events when a moment is looked up: photos are rare."""

    def __init__(
        self,
        kept: deque[tuple[float, Values]],
        kind: type[MessageT],
        read: Callable[[MessageT], Sample | None],
        turn: float = math.inf,
    ) -> None:
        """`read` returns the values of an event of this kind; None: they are unknown."""
        super().__init__(turn)
        self._kept = kept
        self._kind, self._read = kind, read

    def latest_first(self) -> Iterator[tuple[float, Sample]]:
        for at, values in reversed(self._kept):
            if self._kind in values:
                sample = self._read(values.message(self._kind))
                if sample is not None and sum(map(abs, sample)) <= LARGEST:
                    yield at, sample


class EventSamples(PoseSource):
    """Samples of the drone's events: what arrived together is kept as it is."""

    KINDS = (
        events.AttitudeChanged,
        events.GimbalAttitudeChanged,
        events.SpeedChanged,
        events.AltitudeChanged,
        events.GpsLocationChanged,
    )
    """The values of which samples are kept."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, Values]] = deque(maxlen=MOST)
        """With the times of their arrival (s)."""
        self._next: dict[ValueLayout, float] = {}
        """When the next values of a layout are kept (s)."""
        self.headings = _EventTrack(self._kept, events.AttitudeChanged, _heading, math.tau)
        self.gimbals = _EventTrack(self._kept, events.GimbalAttitudeChanged, _gimbal, math.tau)
        self.velocities = _EventTrack(self._kept, events.SpeedChanged, _velocity)
        self.heights = _EventTrack(self._kept, events.AltitudeChanged, _height)
        self.places = _EventTrack(self._kept, events.GpsLocationChanged, _place, DEGREES)

    def clear(self) -> None:
        self._kept.clear()
        self._next.clear()

    def add(self, values: Values, now: float) -> None:
        """Keep what the drone's events report, unless the like of them has just been kept."""
        if now <= self._next.get(values.layout, -math.inf):
            return
        if len(self._next) >= MAX_LAYOUTS:
            self._next.clear()
        self._next[values.layout] = now + SPACING
        kept = self._kept
        while kept and now - kept[0][0] > KEPT:
            kept.popleft()
        kept.append((now, values))


def add_frame(track: PoseTrack, frame: VideoFrame) -> None:
    """Add what a picture of the live video reports."""
    pictures, metadata, at = track.pictures, frame.metadata, frame.shot
    if metadata.location is not None:
        pictures.places.add(at, metadata.location.latitude, metadata.location.longitude)
    if metadata.speed is not None:
        pictures.velocities.add(at, metadata.speed.north, metadata.speed.east)
    if metadata.altitude_ato is not None:
        pictures.heights.add(at, metadata.altitude_ato)
    if (attitude := frame.camera_attitude) is not None:
        pictures.gimbals.add(at, attitude.roll, attitude.pitch, attitude.yaw)
        pictures.headings.add(at, 0.0)

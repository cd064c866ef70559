"""Pose of the camera by the drone's states, and its samples for the geotags."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from anafi_mav.drone import Drone, events
from anafi_mav.drone.element import position
from anafi_mav.drone.payload.gimbal import MAIN
from anafi_mav.drone.values import SIZES, Values, unpack
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.services.camera.pose_track import SPACING, CameraPose, EventTrack, PoseSource, PoseTrack
from anafi_mav.units import RAD_PER_DEG

Sample: TypeAlias = tuple[float, ...]


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


def current_pose(drone: Drone) -> CameraPose:
    """Return the newest pose."""
    location = drone.gps.state.location
    place = None if location is None else (location.latitude, location.longitude)
    return CameraPose(place, drone.piloting.state.altitude, camera_angles(drone))


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


def _track(kind: type[events.Message], sample: Callable[[Any], Sample | None], *, turn: float = math.inf) -> EventTrack:
    return EventTrack(SIZES[kind], lambda data: sample(unpack(data)), turn=turn, spacing=SPACING)


class EventSamples(PoseSource):
    """Samples of the drone's events."""

    KINDS = (
        events.AttitudeChanged,
        events.GimbalAttitudeChanged,
        events.SpeedChanged,
        events.AltitudeChanged,
        events.GpsLocationChanged,
    )
    """The values of which samples are kept."""

    def __init__(self) -> None:
        super().__init__(SPACING)
        self.headings = heading = _track(events.AttitudeChanged, _heading, turn=math.tau)
        self.gimbals = gimbal = _track(events.GimbalAttitudeChanged, _gimbal, turn=math.tau)
        self.velocities = velocity = _track(events.SpeedChanged, _velocity)
        self.heights = height = _track(events.AltitudeChanged, _height)
        self._tracks: Mapping[type[events.Message], EventTrack] = {
            events.AttitudeChanged: heading,
            events.GimbalAttitudeChanged: gimbal,
            events.SpeedChanged: velocity,
            events.AltitudeChanged: height,
        }

        self._next = -math.inf
        """When the next sample of some kind may be added, but for places (s)."""

    def clear(self) -> None:
        """Forget all samples."""
        super().clear()
        self._next = -math.inf

    def add(self, values: Values, now: float) -> None:
        """Add what the drone's events report."""
        if now < self._next and events.GpsLocationChanged not in values:
            return
        for kind, track in self._tracks.items():
            if kind in values:
                track.add_event(now, values.command(kind))
        if events.GpsLocationChanged in values:
            self._add_place(values.message(events.GpsLocationChanged), now)
        self._next = min(track.newest for track in self._tracks.values()) + SPACING

    def _add_place(self, message: events.GpsLocationChanged, now: float) -> None:
        place = position(message.latitude, message.longitude, message.altitude)
        if place is not None:  # else no place is the newest one
            self.places.add(now, place.latitude, place.longitude)


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

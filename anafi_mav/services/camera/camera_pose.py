"""Pose of the camera by the drone's states, and its samples for the geotags."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from anafi_mav.drone import Drone, events
from anafi_mav.drone.element import position
from anafi_mav.drone.payload.gimbal import MAIN
from anafi_mav.drone.values import Values
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.services.camera.pose_track import CameraPose, PoseSource, PoseTrack, SampleTrack
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


def _place(message: events.GpsLocationChanged) -> Sample | None:
    known = position(message.latitude, message.longitude, message.altitude)
    return None if known is None else (known.latitude, known.longitude)


_SAMPLES: Mapping[type[events.Message], tuple[Callable[[PoseSource], SampleTrack], Callable[[Any], Sample | None]]] = {
    events.AttitudeChanged: (lambda source: source.headings, _heading),
    events.GimbalAttitudeChanged: (lambda source: source.gimbals, _gimbal),
    events.SpeedChanged: (lambda source: source.velocities, _velocity),
    events.AltitudeChanged: (lambda source: source.heights, _height),
    events.GpsLocationChanged: (lambda source: source.places, _place),
}
"""Track of each kind of values, and its sample; None: it is none of the camera, or unknown."""

SAMPLED = tuple(_SAMPLES)
"""The kinds of values of which samples are kept."""


def add_values(source: PoseSource, values: Values, now: float) -> None:
    """Add what the drone's events report."""
    for kind, packed in values.items():
        if kind in _SAMPLES:
            track_of, sample_of = _SAMPLES[kind]
            track = track_of(source)
            if track.is_due(now) and (sample := sample_of(packed.unpack())) is not None:
                track.add(now, *sample)


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

"""Pose of the camera by the drone's states, and its samples for the geotags."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from anafi_mav.drone import Drone, events
from anafi_mav.drone.payload.gimbal import MAIN
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.services.camera.pose_track import CameraPose, PoseTrack
from anafi_mav.units import RAD_PER_DEG


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


def add_attitude(track: PoseTrack, drone: Drone, message: events.Message, now: float) -> None:
    """Add the heading that an event has reported."""
    if (attitude := drone.piloting.state.attitude) is not None:
        track.events.headings.add(now, attitude.yaw)


def add_gimbal(track: PoseTrack, drone: Drone, message: events.Message, now: float) -> None:
    """Add the attitude of the gimbal that an event has reported."""
    if (attitude := drone.gimbal[MAIN].attitude) is not None:
        roll, pitch = attitude.absolute.roll * RAD_PER_DEG, attitude.absolute.pitch * RAD_PER_DEG
        track.events.gimbals.add(now, roll, pitch, attitude.relative.yaw * RAD_PER_DEG)


def add_velocity(track: PoseTrack, drone: Drone, message: events.Message, now: float) -> None:
    """Add the velocity that an event has reported."""
    if (velocity := drone.piloting.state.velocity) is not None:
        track.events.velocities.add(now, velocity.north, velocity.east)


def add_height(track: PoseTrack, drone: Drone, message: events.Message, now: float) -> None:
    """Add the height that an event has reported."""
    if (height := drone.piloting.state.altitude) is not None:
        track.events.heights.add(now, height)


def add_place(track: PoseTrack, drone: Drone, message: events.Message, now: float) -> None:
    """Add the position that an event has reported."""
    if (location := drone.gps.state.location) is not None:
        track.events.places.add(now, location.latitude, location.longitude)


Sampler = Callable[[PoseTrack, Drone, events.Message, float], None]

SAMPLERS: Mapping[type[events.Message], Sampler] = {
    events.AttitudeChanged: add_attitude,
    events.GimbalAttitudeChanged: add_gimbal,
    events.SpeedChanged: add_velocity,
    events.AltitudeChanged: add_height,
    events.GpsLocationChanged: add_place,
}
"""By event. Each adds what its event reports: other values are older than it."""


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

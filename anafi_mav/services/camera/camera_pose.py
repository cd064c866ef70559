"""Pose of the camera by the drone's states, and its samples for the geotags."""

from __future__ import annotations

from anafi_mav.drone import Drone
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


def add_states(track: PoseTrack, drone: Drone, now: float, *, located: bool) -> None:
    """Add what an event has changed; `located`: it was a position."""
    events, state = track.events, drone.piloting.state
    location = drone.gps.state.location
    if located and location is not None:
        events.places.add(now, location.latitude, location.longitude)
    if state.velocity is not None:
        events.velocities.add(now, state.velocity.north, state.velocity.east)
    if state.altitude is not None:
        events.heights.add(now, state.altitude)
    if (angles := camera_angles(drone)) is not None:
        events.cameras.add(now, *angles)


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
        pictures.cameras.add(at, attitude.roll, attitude.pitch, attitude.yaw)

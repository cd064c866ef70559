"""Motion of the drone at one moment, by its events or by a picture of the live video.

Events arrive five times a second. A picture's metadata arrive thirty times a second, a tenth of a second late, with a
time of their own. A message is made of one of the two, never of both: its fields belong to one moment.
"""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from anafi_mav.drone.piloting.state import Attitude, Velocity
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.roll_sign import RollSign
from anafi_mav.vehicle.vehicle import Vehicle


class VehiclePose(msgspec.Struct, frozen=True):
    """Attitude, motion, place and heights of the drone at one moment. None: unknown."""

    attitude: Attitude | None
    """rad, right wing down +, also of a drone whose events report roll inverted."""
    velocity: Velocity | None
    """m/s over ground."""
    altitude: float | None
    """m above the take-off point."""
    height: float | None
    """m above the ground below."""
    place: GeoPoint | None
    gps_altitude: float | None
    """m above sea level, of the satellite receiver."""
    frame: VideoFrame | None = None
    """The picture; None: made of events."""

    def amsl(self, vehicle: Vehicle) -> float | None:
        """Return the height above sea level, m.

        It is the height above the latched take-off point, without a latch the plain GPS altitude.
        """
        height = None if self.altitude is None else vehicle.height.amsl(self.altitude)
        return self.gps_altitude if height is None else height


UNKNOWN_POSE = VehiclePose(None, None, None, None, None, None)


def reported_pose(vehicle: Vehicle) -> VehiclePose:
    """Return the motion as the newest events report it."""
    state, location = vehicle.drone.piloting.state, vehicle.drone.gps.state.location
    attitude = state.attitude
    if attitude is not None and vehicle.roll.sign is RollSign.INVERTED:
        attitude = replace(attitude, roll=-attitude.roll)
    gps_altitude = None if location is None else location.altitude
    return VehiclePose(attitude, state.velocity, state.altitude, state.height, vehicle.place, gps_altitude)


def picture_pose(vehicle: Vehicle, frame: VideoFrame, altitude: float | None, height: float | None) -> VehiclePose:
    """Return the motion as the metadata of a picture report it.

    `altitude` and `height` are the events' heights (m) at the moment of the picture. They stand in for what the
    metadata lack: version 3 has no height above the take-off point, and a protocol buffer does not distinguish zero
    from unknown.
    The sign of roll is that of a quaternion from forward, right, down to north, east, down; `roll_sign` concerns the
    angle of AttitudeChanged only.
    """
    metadata = frame.metadata
    speed, location = metadata.speed, metadata.location
    is_placed = location is not None and vehicle.drone.gps.state.fixed is True
    return VehiclePose(
        frame.attitude,
        None if speed is None else Velocity(speed.north, speed.east, speed.down),
        altitude if metadata.altitude_ato is None else metadata.altitude_ato,
        height if metadata.ground_distance is None else metadata.ground_distance,
        GeoPoint(location.latitude, location.longitude) if location is not None and is_placed else None,
        None if location is None else location.altitude_amsl,
        frame,
    )

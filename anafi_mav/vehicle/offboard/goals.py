"""Positions of setpoints, resolved at their first arrival, and the resulting control demand.

A position may count from the drone's position or from its heading. It is resolved once: the same setpoint again means
the same place, for it is repeated in case one gets lost, not to make the drone fly on for ever.
"""

from __future__ import annotations

import math

from msgspec import Struct

from anafi_mav import geo, texts
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import amsl_to_ato, check_estimate, check_height, check_place
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.velocity_loop import Axis, Demand, MotionEstimate
from anafi_mav.vehicle.offboard.setpoints import MotionSetpoint, PositionReference, Vector


class Goal(Struct, frozen=True):
    """A setpoint's position, resolved."""

    origin: PositionReference
    body: bool
    position: Vector
    """As the setpoint said it."""
    place: GeoPoint | None = None
    """Place on the map.

    None without both horizontal parts, or while the drone's position is unknown.
    """
    x: float | None = None
    """m along the first axis, as `MotionEstimate.north` counts; None: not said, or no GPS location has come."""
    y: float | None = None
    turn: float = 0.0
    """rad from north to the first axis, clockwise."""
    height: float | None = None
    """m above take-off; None: not said."""
    offset: tuple[float, float, float] | None = None
    """m front, right and down, for a position that counts from where the drone is."""

    def is_of(self, setpoint: MotionSetpoint) -> bool:
        """Does a setpoint ask for this position?"""
        return (self.origin, self.body, self.position) == (setpoint.origin, setpoint.body, setpoint.position)


def resolve(setpoint: MotionSetpoint, vehicle: Aircraft, motion: MotionEstimate) -> Goal:
    """The goal of a setpoint that has a position.

    Raises `Refused` for one that the drone may not or cannot fly to.
    """
    if setpoint.origin is PositionReference.VEHICLE:
        return _from_vehicle(setpoint, vehicle, motion)
    x, y, z = setpoint.position
    height = None if z is None else -z if setpoint.origin is PositionReference.LOCAL else z
    if height is not None:
        if setpoint.origin is PositionReference.SEA:
            height = amsl_to_ato(vehicle, height)
            check_estimate(vehicle, height)
        check_height(vehicle, height)
    place: GeoPoint | None = None
    north = east = None
    if x is not None or y is not None:
        if setpoint.origin is PositionReference.LOCAL:
            if vehicle.origin is None:
                raise Refused(texts.SETPOINT, texts.TAKEOFF_POINT_UNKNOWN)
            place = _local_place(vehicle.origin, x, y, vehicle.place)
        else:
            place = GeoPoint(x or 0.0, y or 0.0)
        check_place(vehicle, place, start=vehicle.place)
        if motion.reference is not None:
            north, east = geo.offset(*motion.reference, place.latitude, place.longitude)
    return Goal(
        setpoint.origin,
        setpoint.body,
        setpoint.position,
        place=None if x is None or y is None else place,
        x=None if x is None else north,
        y=None if y is None else east,
        height=height,
    )


def _local_place(origin: GeoPoint, x: float | None, y: float | None, here: GeoPoint | None) -> GeoPoint:
    """A place of the local frame. Of a half that is not said the drone keeps its own."""
    if (x is None or y is None) and here is not None:
        north, east = geo.offset(origin.latitude, origin.longitude, here.latitude, here.longitude)
        x, y = north if x is None else x, east if y is None else y
    return GeoPoint(*geo.destination(origin.latitude, origin.longitude, x or 0.0, y or 0.0))


def _from_vehicle(setpoint: MotionSetpoint, vehicle: Aircraft, motion: MotionEstimate) -> Goal:
    x, y, z = setpoint.position
    ahead, aside, down = x or 0.0, y or 0.0, z or 0.0
    if motion.yaw is None:
        raise Refused(texts.SETPOINT, texts.HEADING_UNKNOWN)
    present, here = vehicle.drone.piloting.state.altitude, vehicle.place
    height = None
    if z is not None:
        if present is None:
            raise Refused(texts.SETPOINT, texts.HEIGHT_UNKNOWN)
        height = present - down
        if down != 0.0:
            check_height(vehicle, height)
    cos, sin = math.cos(motion.yaw), math.sin(motion.yaw)
    if setpoint.body:
        front, right = ahead, aside
        north, east = front * cos - right * sin, front * sin + right * cos
    else:
        north, east = ahead, aside
        front, right = north * cos + east * sin, east * cos - north * sin
    place: GeoPoint | None = None
    if here is not None:
        place = GeoPoint(*geo.destination(here.latitude, here.longitude, north, east))
        if north != 0.0 or east != 0.0:
            check_place(vehicle, place, start=here)
    turn = motion.yaw if setpoint.body else 0.0
    along = motion.north * math.cos(turn) + motion.east * math.sin(turn)
    across = motion.east * math.cos(turn) - motion.north * math.sin(turn)
    known = motion.reference is not None
    return Goal(
        setpoint.origin,
        setpoint.body,
        setpoint.position,
        place=place,
        x=along + ahead if x is not None and known else None,
        y=across + aside if y is not None and known else None,
        turn=turn,
        height=height,
        offset=(front, right, down),
    )


def demand(setpoint: MotionSetpoint, goal: Goal | None, yaw: float | None, *, located: bool) -> Demand:
    """Return the control demand of a setpoint with this goal and heading.

    Raises `Refused` for a horizontal position while the drone is not `located` by GPS.
    """
    x = y = height = None
    turn = 0.0
    if goal is not None:
        wanted = (goal.position[0] is not None, goal.position[1] is not None)
        x, y, height, turn = goal.x, goal.y, goal.height, goal.turn
        if any(wanted) and not (located and (x is not None) == wanted[0] and (y is not None) == wanted[1]):
            raise Refused(texts.SETPOINT, texts.NO_FIX)
    return Demand(
        x=Axis(setpoint.velocity[0], setpoint.acceleration[0], x),
        y=Axis(setpoint.velocity[1], setpoint.acceleration[1], y),
        body=setpoint.body,
        turn=turn,
        down_velocity=setpoint.velocity[2],
        down_acceleration=setpoint.acceleration[2],
        height=height,
        yaw=yaw,
        yaw_rate=setpoint.yaw_rate,
    )

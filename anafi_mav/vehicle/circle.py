"""Circling a place: demands on the loops of `velocity_loop`. No I/O.

A position on the circle abreast of the drone corrects the radius, the velocity along the circle goes with it as a
feed-forward, and the acceleration that a circle takes points to its centre.

Angles are bearings from the centre, clockwise from north (rad); a radius is positive, the direction is a sign of its
own: +1 clockwise seen from above, as a positive radius of MAV_CMD_DO_ORBIT (MAVLink common.xml).
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from anafi_mav import geo, units
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.velocity_loop import Axis, Demand, G, MotionEstimate

SMALLEST = 2.0
"""m of radius. On a smaller circle GPS does not show on which side of it the drone is."""

LARGEST = 5000.0
"""m of radius: more is a number in the wrong field."""

SHARE_OF_TILT = 0.5
"""Share of the thrust at full tilt that the circle itself may use.

The rest is for drag, wind and corrections.
"""

DEFAULT_RADIUS = 10.0
"""m, clockwise, when the command gives no radius."""

DEFAULT_SPEED = 3.0
"""m/s along the circle when the command gives no speed."""

LOOKS = 32
"""Number of straight pieces of a circle that must lead where the drone may fly.

Between the ends of one the circle is 0.5 % of the radius further out.
"""

ON_IT = 5.0
"""m from the circle within which the drone begins to circle; from further away it flies there first."""


class Facing(enum.Enum):
    """Heading of the nose on the circle.

    Values of ORBIT_YAW_BEHAVIOUR; 5, "as it is", is the first.
    """

    CENTRE = 0
    KEEP = 1
    FREE = 2
    TANGENT = 3


@dataclass(frozen=True)
class Circle:
    """An orbit in the values that are flown."""

    centre: GeoPoint
    radius: float
    """m."""
    direction: int
    """+1 clockwise, -1 counter-clockwise."""
    speed: float
    """m/s along it."""
    height: float
    """m above take-off."""
    facing: Facing = Facing.CENTRE
    heading: float = 0.0
    """rad from north, for `Facing.KEEP`."""
    angle: float | None = None
    """rad to fly along it; None: until another command."""

    @property
    def signed_radius(self) -> float:
        """m, + clockwise: radius and direction in one, as MAVLink writes them."""
        return self.radius * self.direction


def fastest(radius: float, tilt_deg: float) -> float:
    """Return the speed (m/s) along a circle that full tilt allows."""
    return math.sqrt(SHARE_OF_TILT * G * math.tan(tilt_deg * units.RAD_PER_DEG) * radius)


def entry(circle: Circle, here: GeoPoint) -> GeoPoint:
    """Return the point of the circle that is nearest to a place.

    From the centre itself it is the point north of the centre.
    """
    north, east = geo.offset(*circle.centre, *here)
    distance = math.hypot(north, east)
    north, east = (1.0, 0.0) if distance < 1e-3 else (north / distance, east / distance)
    return GeoPoint(*geo.destination(*circle.centre, north * circle.radius, east * circle.radius))


def outline(circle: Circle) -> list[GeoPoint]:
    """Return the corners of the circle's outline, to be checked. The last is the first again."""
    corners = (2.0 * math.pi * n / LOOKS for n in range(LOOKS + 1))
    centre, radius = circle.centre, circle.radius
    return [GeoPoint(*geo.destination(*centre, math.cos(a) * radius, math.sin(a) * radius)) for a in corners]


def heading_at(circle: Circle, bearing: float) -> float | None:
    """Return the heading (rad from north) at a bearing from the centre; None: any heading."""
    if circle.facing is Facing.CENTRE:
        return units.wrap_pi(bearing + math.pi)
    if circle.facing is Facing.TANGENT:
        return units.wrap_pi(bearing + circle.direction * math.pi / 2.0)
    return circle.heading if circle.facing is Facing.KEEP else None


class Lap:
    """Progress of one drone on one circle."""

    def __init__(self, circle: Circle) -> None:
        self.circle = circle
        self.flown = 0.0
        """rad along it, backwards counted negative."""
        self._bearing: float | None = None

    @property
    def done(self) -> bool:
        return self.circle.angle is not None and self.flown >= self.circle.angle

    def demand(self, motion: MotionEstimate) -> Demand | None:
        """Return the present demand for the loops; None while the drone's position is unknown."""
        circle = self.circle
        if motion.reference is None:
            return None
        north, east = geo.offset(*motion.reference, *circle.centre)
        away_north, away_east = motion.north - north, motion.east - east
        bearing = math.atan2(away_east, away_north)
        if self._bearing is not None:
            self.flown += circle.direction * units.wrap_pi(bearing - self._bearing)
        self._bearing = bearing
        along = circle.direction * circle.speed
        inwards = circle.speed**2 / circle.radius
        out = circle.radius - math.hypot(away_north, away_east)
        velocity = (-math.sin(bearing) * along, math.cos(bearing) * along)
        bearing += along / circle.radius * motion.round_trip.seconds  # where the drone is when the sticks arrive
        cos, sin = math.cos(bearing), math.sin(bearing)
        turning = circle.facing in (Facing.CENTRE, Facing.TANGENT)
        return Demand(
            x=Axis(velocity=velocity[0], acceleration=-cos * inwards, position=motion.north + cos * out),
            y=Axis(velocity=velocity[1], acceleration=-sin * inwards, position=motion.east + sin * out),
            height=circle.height,
            yaw=heading_at(circle, bearing),
            yaw_rate=along / circle.radius if turning else None,
        )

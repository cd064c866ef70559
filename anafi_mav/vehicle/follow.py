"""Following a target: its place, and the drone's place beside it. No I/O.

Parrot's own follow me (feature follow_me) looks for its target in the picture of a controller that shows it, which a
MAVLink client cannot do. So the gateway follows: FOLLOW_TARGET says where the target is, the geometry is PX4's
(parameters FLW_TGT_*), and the drone is flown there by the loop of `velocity_loop`, nose to the target.

Between two reports the target goes on as it did, for `FORESIGHT` at most; a repeated one does not prolong that. Its
course is that of its motion; while it stands the last one counts, and before the first one the drone keeps to the side
of the target that it is on.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from anafi_mav import units
from anafi_mav.vehicle.base.velocity_loop import Axis, Demand

SILENCE = 2.5
"""s without a report of the target until the drone hovers.

MAVSDK sends one a second, and one may be lost.
"""

PATIENCE = 10.0
"""s that a drone in mode Follow waits for its target to appear."""

FORESIGHT = 1.5
"""s for which the target is assumed to continue its motion."""

MOVING = 0.5
"""m/s from which the direction of the target's motion counts as its course."""

REACH = 500.0
"""m beyond which a target is not followed.

It is a mistake, most likely, and too far to look at in any case.
"""

FASTEST = 20.0
"""m/s beyond which a target is not followed."""

BASELINE = 0.5
"""s between two positions from which a velocity is measured.

Two that arrive at once would give a walker the speed of a rocket.
"""

SLUGGISH = 0.1
"""Lowest weight of a new position, however smooth the target's motion must be."""


class AltitudeMode(enum.IntEnum):
    """Reference of the drone's height (FLW_TGT_ALT_M)."""

    TAKEOFF = 0
    TERRAIN = 1
    TARGET = 2


@dataclass
class FollowSettings:
    """Wanted position relative to the target, in PX4's terms and with its defaults."""

    height: float = 8.0
    """m above the reference of `altitude_mode` (FLW_TGT_HT)."""
    distance: float = 8.0
    """m over ground (FLW_TGT_DST)."""
    angle: float = 180.0
    """deg clockwise from the target's course: 0 ahead of it, 90 to its right, 180 behind it (FLW_TGT_FA)."""
    responsiveness: float = 0.1
    """0..1: low follows every move of the target, high smoothes them (FLW_TGT_RS)."""
    altitude_mode: AltitudeMode = AltitudeMode.TAKEOFF
    """FLW_TGT_ALT_M."""
    tangential_speed: float = 5.0
    """m/s at most around the target when its course changes (FLW_TGT_MAX_VEL)."""


@dataclass(frozen=True)
class Sighting:
    """Content of one FOLLOW_TARGET."""

    latitude: float
    longitude: float
    altitude: float | None
    """m above mean sea level."""
    velocity: tuple[float, float] | None
    """m/s north and east; None: not reported."""


class TargetFollower:
    """The target of one vehicle, in metres north and east of the reference of `Motion`."""

    def __init__(self, settings: FollowSettings) -> None:
        self.settings = settings
        self.altitude: float | None = None
        """m above mean sea level, as last reported."""
        self._place: tuple[float, float] | None = None
        self._velocity = (0.0, 0.0)
        self._at = self._heard_at = -math.inf
        self._report: tuple[float, float, tuple[float, float] | None] | None = None
        """The newest report that differs from the one before: north, east, velocity."""
        self._mark = (0.0, 0.0)
        """The position from which the velocity is measured."""
        self._report_at = self._mark_at = -math.inf
        self._side: float | None = None
        """Direction (rad from north) from the target to the wanted position of the drone."""
        self._course: float | None = None
        self._aimed_at = -math.inf

    @property
    def known(self) -> bool:
        """True when a target has been reported."""
        return self._place is not None

    @property
    def speed(self) -> float:
        """m/s."""
        return math.hypot(*self._velocity)

    def see(
        self, north: float, east: float, altitude: float | None, velocity: tuple[float, float] | None, now: float
    ) -> None:
        """Take a reported position; without a reported velocity it is measured from the positions."""
        believed = max(SLUGGISH, 1.0 - self.settings.responsiveness)
        expected = self.target(now)
        heard_of, self.altitude = self._heard_at, altitude
        self._heard_at = now
        is_repeated = (north, east, velocity) == self._report
        if not is_repeated:
            self._report, self._report_at = (north, east, velocity), now
        if self._place is None or expected is None or now - heard_of > SILENCE:
            self._begin(north, east, velocity or (0.0, 0.0), now)
        elif is_repeated:
            # QGroundControl and MAVSDK repeat the last report until their receiver has another one. If that takes
            # longer, the target stands, whatever its velocity was: its receiver may have lost the satellites.
            if now - self._report_at > FORESIGHT:
                self._begin(north, east, (0.0, 0.0), now)
        else:
            if velocity is None:
                velocity = self._read_off(north, east, now)
            if velocity is not None:
                self._velocity = (
                    self._velocity[0] + believed * (velocity[0] - self._velocity[0]),
                    self._velocity[1] + believed * (velocity[1] - self._velocity[1]),
                )
            self._place = (
                expected[0] + believed * (north - expected[0]),
                expected[1] + believed * (east - expected[1]),
            )
            self._at = now
        if self.speed >= MOVING:
            self._course = math.atan2(self._velocity[1], self._velocity[0])

    def _begin(self, north: float, east: float, velocity: tuple[float, float], now: float) -> None:
        """Start with a new position and velocity; earlier ones no longer count."""
        self._place = self._mark = (north, east)
        self._velocity = velocity
        self._at = self._mark_at = now

    def _read_off(self, north: float, east: float, now: float) -> tuple[float, float] | None:
        """Return the velocity (m/s) since the last mark; None while the mark is too recent."""
        elapsed = now - self._mark_at
        if elapsed < BASELINE:
            return None
        velocity = (north - self._mark[0]) / elapsed, (east - self._mark[1]) / elapsed
        self._mark, self._mark_at = (north, east), now
        share = min(1.0, FASTEST / max(math.hypot(*velocity), FASTEST))
        return velocity[0] * share, velocity[1] * share

    def target(self, now: float) -> tuple[float, float] | None:
        """Return the estimated position of the target (north, east); None before its first report."""
        if self._place is None:
            return None
        ahead = min(max(now - self._at, 0.0), FORESIGHT)
        return self._place[0] + self._velocity[0] * ahead, self._place[1] + self._velocity[1] * ahead

    def aim(self, north: float, east: float, height: float, now: float) -> Demand | None:
        """Return the demand for a drone at (north, east); None without a target.

        `height` is the height to fly at, in m above take-off.
        """
        target = self.target(now)
        if target is None:
            return None
        settings = self.settings
        bearing = math.atan2(east - target[1], north - target[0])
        if self._side is None:
            self._side = bearing
        wanted = self._side
        if self._course is not None:
            wanted = self._course + settings.angle * units.RAD_PER_DEG
        elapsed = min(max(now - self._aimed_at, 0.0), 1.0)
        most = settings.tangential_speed / max(settings.distance, 1.0) * elapsed
        self._side = units.wrap_pi(self._side + units.clip(units.wrap_pi(wanted - self._side), -most, most))
        self._aimed_at = now
        moves = now - self._at < FORESIGHT
        return Demand(
            x=Axis(self._velocity[0] if moves else 0.0, None, target[0] + settings.distance * math.cos(self._side)),
            y=Axis(self._velocity[1] if moves else 0.0, None, target[1] + settings.distance * math.sin(self._side)),
            height=height,
            yaw=units.wrap_pi(bearing + math.pi),
        )

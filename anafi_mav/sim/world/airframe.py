"""One drone of the fleet that `motion` moves: what its autopilot can tell it to do."""

from __future__ import annotations

import math

from anafi_mav.sim.world.motion import NO_FENCE, G, Mode, Motion, Turn
from anafi_mav.units import wrap_pi


class Airframe:
    """One drone's place in a `Motion`: the verbs of its autopilot. Metres, m/s, rad."""

    def __init__(self, motion: Motion, index: int) -> None:
        self._motion = motion
        self._index = index

    @property
    def mode(self) -> Mode:
        return Mode(int(self._motion.mode[self._index]))

    @property
    def heading(self) -> float:
        """Yaw without wrapping, rad."""
        return float(self._motion.yaw[self._index])

    def nearest(self, heading: float) -> float:
        """`heading` (rad) as the unwrapped yaw that takes the shortest turn to reach."""
        return self.heading + wrap_pi(heading - self.heading)

    def _enter(self, mode: Mode) -> None:
        self._motion.mode[self._index] = mode
        self._motion.stale = True
        if mode is not Mode.STICKS and mode is not Mode.LAND:
            self.sticks(0.0, 0.0, 0.0, 0.0)

    def off(self) -> None:
        """Motors off or idle. Forgets what was still on its way to them."""
        self._enter(Mode.OFF)
        self._motion.yaw_line.clear(self._index)
        self._motion.climb_line.clear(self._index)

    def hover(self) -> None:
        """Stop and stay, ready for `sticks`."""
        self._enter(Mode.STICKS)
        self.sticks(0.0, 0.0, 0.0, 0.0)

    def take_off(self) -> None:
        self._enter(Mode.TAKE_OFF)

    def land(self) -> None:
        self._enter(Mode.LAND)

    def fall(self) -> None:
        self._enter(Mode.FALL)

    def sticks(self, roll: float, pitch: float, yaw_rate: float, climb: float) -> None:
        """Set the tilt, yaw rate and climb rate that the sticks command.

        Tilt in rad (roll + right, pitch + nose up), yaw rate in rad/s, climb rate in m/s up. A zero roll or pitch
        asks that axis to stop. Takes effect in STICKS, partly in MOVE (yaw) and LAND (tilt, yaw).
        """
        motion, i = self._motion, self._index
        motion.stick_push[0, i] = -G * math.tan(pitch)
        motion.stick_push[1, i] = G * math.tan(roll)
        motion.stick_yaw[i] = yaw_rate
        motion.stick_climb[i] = climb
        motion.stale = True

    def stick_yaw(self, yaw_rate: float) -> None:
        """The yaw stick alone (rad/s)."""
        self._motion.stick_yaw[self._index] = yaw_rate
        self._motion.stale = True

    def move(
        self,
        north: float,
        east: float,
        up: float,
        *,
        yaw: float | None = None,
        turn: Turn = Turn.DURING,
        speed: float,
        climb: float,
        yaw_rate: float,
    ) -> None:
        """Fly to a point, no faster than `speed` and `climb` (m/s) and `yaw_rate` (rad/s).

        `yaw` is an unwrapped heading (see `nearest`); None keeps the present one.
        """
        self._enter(Mode.MOVE)
        motion, i = self._motion, self._index
        motion.target[:, i] = north, east, -up
        motion.target_yaw[i] = self.heading if yaw is None else yaw
        motion.turn[i] = turn
        motion.move_speed[i] = speed
        motion.move_climb[i] = climb
        motion.move_yaw[i] = yaw_rate

    def limits(self, *, tilt_rate: float, ceiling: float) -> None:
        """How fast it may tilt (rad/s) and how high it may go (m)."""
        self._motion.tilt_rate_limit[self._index] = tilt_rate
        self._motion.ceiling[self._index] = ceiling

    def fence(self, radius: float | None, centre: tuple[float, float] = (0.0, 0.0)) -> None:
        """Keep within `radius` m of `centre` (north, east); None removes the fence."""
        self._motion.fence_radius[self._index] = NO_FENCE if radius is None else radius
        self._motion.fence_centre[:, self._index] = centre
        self._motion.stale = True

    def blow(self, north: float, east: float) -> None:
        """Wind: the air moves with this velocity (m/s) where the drone is."""
        motion = self._motion
        motion.wind[:, self._index] = north, east
        motion.windy = motion.windy or north != 0.0 or east != 0.0

    @property
    def windy(self) -> bool:
        """Somewhere in the fleet the air moves, or has moved."""
        return self._motion.windy

    @property
    def wind(self) -> float:
        """m/s of the air over ground."""
        return math.hypot(*self._motion.wind[:, self._index].tolist()) if self._motion.windy else 0.0

    def place(self, north: float, east: float, yaw: float = 0.0) -> None:
        """Put the drone on the ground somewhere, at rest."""
        motion, i = self._motion, self._index
        motion.position[:, i] = north, east, 0.0
        motion.velocity[:, i] = 0.0
        motion.yaw[i] = yaw
        motion.stale = True

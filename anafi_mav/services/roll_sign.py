"""Verifies the sign of AttitudeChanged.roll against how the drone's speed changes. No I/O; time is handed in.

arsdk.md and anafi_ros have roll positive with the right wing down, GroundSDK's documentation says left. A velocity loop
that believes the wrong one pushes the drone the wrong way. A multicopter that leans accelerates to that side, so each
interval in which it leans clearly and its speed changes speaks for one of the two signs.

rad, m/s; speeds are north and east.
"""

from __future__ import annotations

import enum
import math

from anafi_mav import units

LEAST_ROLL = 4.0 * units.RAD_PER_DEG
"""rad of roll below which wind and drag decide where the drone accelerates."""

LEAST_ACCELERATION = 0.3
"""m/s2 to the side below which a speed is steady, or noise: 4 degrees push with 0.7."""

INTERVAL, LONGEST = 0.15, 0.6
"""s between the two speeds of a sample. An ANAFI reports its speed every 0.2 s."""

SAMPLES, ODDS = 20, 3
"""Samples that a verdict needs, and how many have to fit one sign for each that fits the other."""

MOST = 200
"""Samples at which old ones begin to fade."""


ROLL_INVERTED = "roll sign inverted"
"""Why a loop over velocity is refused."""

INVERTED = "Roll sign inverted: velocity control refused"
"""Text to every client."""


class Sign(enum.Enum):
    """What is known of the sign of AttitudeChanged.roll."""

    UNKNOWN = "unknown"
    RIGHT = "positive with the right wing down, as assumed"
    LEFT = "positive with the left wing down"


class RollCheck:
    """The evidence on one drone's sign of roll, from moves of any kind."""

    def __init__(self, sign: Sign = Sign.UNKNOWN) -> None:
        self.sign = sign
        self._fits = {Sign.RIGHT: 0, Sign.LEFT: 0}
        self._yaw: float | None = None
        self._side = 0
        """Side that every roll of the present interval was on, +1 or -1; 0 when it did not lean clearly to one."""
        self._since: tuple[float, float, float] | None = None
        """Begin of the interval and the speed then."""

    @property
    def trusted(self) -> bool:
        """True when loops may use the roll that the drone reports."""
        return self.sign is Sign.RIGHT

    @property
    def inverted(self) -> bool:
        """True when the drone reports roll with the opposite sign."""
        return self.sign is Sign.LEFT

    def recall(self, sign: Sign) -> None:
        """Begin with what is known of this drone and firmware."""
        self.sign, self._fits = sign, {Sign.RIGHT: 0, Sign.LEFT: 0}
        self.forget_motion()

    def forget_motion(self) -> None:
        """The drone reports no attitude or speed: the present interval says nothing."""
        self._yaw, self._since, self._side = None, None, 0

    def on_attitude(self, roll: float, yaw: float) -> None:
        """AttitudeChanged."""
        side = int(math.copysign(1.0, roll)) if abs(roll) > LEAST_ROLL else 0
        if self._yaw is None or side != self._side:
            # An interval that has begun with another lean is none; the next speed begins one.
            self._since = None
        self._yaw, self._side = yaw, side

    def on_velocity(self, north: float, east: float, now: float) -> bool:
        """SpeedChanged. Return True when the verdict changes."""
        if self._yaw is None or not self._side:
            self._since = None
            return False
        if self._since is None or not 0.0 <= now - self._since[0] <= LONGEST:
            self._since = now, north, east
            return False
        began, north_then, east_then = self._since
        elapsed = now - began
        if elapsed < INTERVAL:
            return False
        self._since = now, north, east
        right = (math.cos(self._yaw) * (east - east_then) - math.sin(self._yaw) * (north - north_then)) / elapsed
        if abs(right) < LEAST_ACCELERATION:
            return False
        self._fits[Sign.RIGHT if right * self._side > 0.0 else Sign.LEFT] += 1
        return self._judge()

    def _judge(self) -> bool:
        right, left = self._fits[Sign.RIGHT], self._fits[Sign.LEFT]
        if right + left < SAMPLES:
            return False
        if max(right, left) < ODDS * min(right, left):
            if right + left >= MOST:
                self._fits = {Sign.RIGHT: right // 2, Sign.LEFT: left // 2}
            return False
        # Counting begins again, so that a wrong verdict does not last.
        self._fits = {Sign.RIGHT: 0, Sign.LEFT: 0}
        before, self.sign = self.sign, Sign.RIGHT if right > left else Sign.LEFT
        return self.sign is not before

"""Verifies the sign of AttitudeChanged.roll against how the drone's speed changes.

No I/O; time is handed in.

arsdk.md and anafi_ros have roll positive with the right wing down, GroundSDK's documentation says left. A velocity
loop
that believes the wrong one pushes the drone the wrong way. A multicopter that leans more to one side accelerates more
to that side. Wind and drag push as well, and can outweigh the lean while it slows down or holds its place, but they
change slowly: so a sample is the change of lean and of acceleration within little more than half a second.

rad, m/s; speeds are north and east.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from anafi_mav import units

LEAST_ROLL = 4.0 * units.RAD_PER_DEG
"""rad of roll that a sample needs, in one of its two intervals."""

LEAST_CHANGE, LEAST_RESPONSE = 0.5, 0.3
"""m/s2 by which the push of the lean, g tan(roll), and the acceleration to the side have to change: 3 degrees, and more
than the noise of the speeds."""

MOST_TURN = 10.0 * units.RAD_PER_DEG
"""rad of yaw between two intervals beyond which "to the side" is another direction."""

SPAN = 0.65
"""s between the ends of the two intervals of a sample, at most: three reports."""

INTERVAL, LONGEST = 0.15, 0.6
"""s between the two speeds of a sample. An ANAFI reports its speed every 0.2 s."""

SAMPLES, ODDS = 20, 3
"""Samples that a verdict needs, and how many have to fit one sign for each that fits the other."""

OVERTURN = 3 * SAMPLES
"""Samples that another verdict than the present one needs: a firmware does not change its sign in the air."""

MOST = 200
"""Samples at which old ones begin to fade."""

MOST_ROLLS = 64
"""Reports of an interval that are kept: 30 a second for `LONGEST`, and room."""

G = 9.81
"""m/s2."""


class RollSign(enum.Enum):
    """Knowledge of the sign of AttitudeChanged.roll."""

    UNKNOWN = "unknown"
    NORMAL = "positive with the right wing down, as assumed"
    INVERTED = "positive with the left wing down"


@dataclass(frozen=True)
class _Interval:
    """The time between two reported speeds."""

    end: float
    push: float
    """m/s2 to the right that the reported roll makes, if it is positive to the right; mean of the interval."""
    right: float
    """m/s2, measured acceleration to the right."""
    roll: float
    """rad, the largest absolute value."""
    yaw: float


class RollCheck:
    """The evidence on one drone's sign of roll, from moves of any kind."""

    def __init__(self, sign: RollSign = RollSign.UNKNOWN) -> None:
        self.sign = sign
        self._fits = {RollSign.NORMAL: 0, RollSign.INVERTED: 0}
        self._rolls: list[float] = []
        """rad, reported since the present interval began, and the last one before."""
        self._yaw = 0.0
        self._since: tuple[float, float, float] | None = None
        """Begin of the present interval and the speed then."""
        self._recent: list[_Interval] = []
        """Intervals without a gap that ended within `SPAN`."""

    def recall(self, sign: RollSign) -> None:
        """Begin with what is known of this drone and firmware."""
        self.sign, self._fits = sign, {RollSign.NORMAL: 0, RollSign.INVERTED: 0}
        self.forget_motion()

    def forget_motion(self) -> None:
        """The drone reports no attitude or speed: the present interval says nothing."""
        self._since = None
        self._recent.clear()
        self._rolls.clear()

    def on_attitude(self, roll: float, yaw: float) -> None:
        """AttitudeChanged."""
        if len(self._rolls) == MOST_ROLLS:
            del self._rolls[0]
        self._rolls.append(roll)
        self._yaw = yaw

    def on_velocity(self, north: float, east: float, now: float) -> bool:
        """SpeedChanged. Return True when the verdict changes."""
        if not self._rolls:
            return False
        if self._since is None or not 0.0 <= now - self._since[0] <= LONGEST:
            self._since = now, north, east
            self._recent.clear()
            del self._rolls[:-1]
            return False
        began, north_then, east_then = self._since
        elapsed = now - began
        if elapsed < INTERVAL:
            return False
        self._since = now, north, east
        right = (math.cos(self._yaw) * (east - east_then) - math.sin(self._yaw) * (north - north_then)) / elapsed
        push = G * sum(map(math.tan, self._rolls)) / len(self._rolls)
        interval = _Interval(now, push, right, max(map(abs, self._rolls)), self._yaw)
        del self._rolls[:-1]
        self._recent = [one for one in self._recent if now - one.end <= SPAN]
        before = max(self._recent, key=lambda one: abs(push - one.push), default=None)
        self._recent.append(interval)
        return before is not None and self._compare(before, interval)

    def _compare(self, before: _Interval, after: _Interval) -> bool:
        """Take the change between two intervals as a sample. Return True when the verdict changes."""
        push, response = after.push - before.push, after.right - before.right
        turned = abs(units.wrap_pi(after.yaw - before.yaw))
        if max(before.roll, after.roll) <= LEAST_ROLL or turned > MOST_TURN:
            return False
        if abs(push) < LEAST_CHANGE or abs(response) < LEAST_RESPONSE:
            return False
        self._fits[RollSign.NORMAL if push * response > 0.0 else RollSign.INVERTED] += 1
        return self._judge()

    def _judge(self) -> bool:
        right, left = self._fits[RollSign.NORMAL], self._fits[RollSign.INVERTED]
        ahead = RollSign.NORMAL if right > left else RollSign.INVERTED
        if right + left < (SAMPLES if self.sign in (RollSign.UNKNOWN, ahead) else OVERTURN):
            return False
        if max(right, left) < ODDS * min(right, left):
            if right + left >= MOST:
                self._fits = {RollSign.NORMAL: right // 2, RollSign.INVERTED: left // 2}
            return False
        # Counting begins again, so that a wrong verdict does not last.
        self._fits = {RollSign.NORMAL: 0, RollSign.INVERTED: 0}
        before, self.sign = self.sign, ahead
        return self.sign is not before

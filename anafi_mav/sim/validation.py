"""Validation of a simulated flight against the measurements of the anafi_ros paper.

Section IV of the paper contains them. A series is a list of (seconds since the drone received the first command,
value). The paper gives its results in words and figures; the bounds here are those words. "Approximately 100 ms" is
taken as within 50 ms, "almost 7 m" as within half a metre, "around 0" as within 1 deg, 0.1 m/s or 2 deg/s.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from anafi_mav.arsdk.video.video_metadata import FrameMetadata, Quaternion
from anafi_mav.units import DEG_PER_RAD, euler_from_quaternion, wrap_pi

Series: TypeAlias = Sequence[tuple[float, float]]

HOLD = 2.0
"""s that each command is held: one way, the other way, then nothing."""

AFTER = 5.0
"""s that are watched after it."""

TILT, CLIMB, SPIN = 40.0, 4.0, 200.0
"""deg, m/s, deg/s: what is commanded, the limits set to the same."""

_REST = (2 * HOLD + AFTER - 1.0, 2 * HOLD + AFTER)
"""The last second, in which everything has to be at rest."""


@dataclass
class MeasuredTrack:
    """Video metadata of one test, against seconds since its first command."""

    attitude: list[tuple[float, float, float, float]] = field(default_factory=list)
    """t, roll, pitch, yaw in rad"""
    speed: list[tuple[float, float, float, float]] = field(default_factory=list)
    """t, north, east, down in m/s"""
    height: list[tuple[float, float]] = field(default_factory=list)
    gimbal: list[tuple[float, float, float]] = field(default_factory=list)
    """t, pitch, roll in deg, to the horizon"""

    def add(self, t: float, said: FrameMetadata) -> None:
        """Add the metadata of the picture taken at `t`; absent fields are left out."""
        if said.drone_quat is not None:
            roll, pitch, yaw = euler_from_quaternion(*said.drone_quat)
            self.attitude.append((t, roll, pitch, yaw))
            if said.quat is not None:
                pitch, roll = _looks(said.quat, yaw)
                self.gimbal.append((t, pitch * DEG_PER_RAD, roll * DEG_PER_RAD))
        if said.speed is not None:
            self.speed.append((t, *said.speed))
        if said.ground_distance is not None:
            self.height.append((t, said.ground_distance))

    def roll(self) -> Series:
        return [(t, roll * DEG_PER_RAD) for t, roll, _, _ in self.attitude]

    def pitch(self) -> Series:
        """deg, nose down positive as in the paper."""
        return [(t, -pitch * DEG_PER_RAD) for t, _, pitch, _ in self.attitude]

    def turned(self) -> Series:
        """deg turned since the first sample, without wrapping."""
        total, before, found = 0.0, None, []
        for t, _, _, yaw in self.attitude:
            total += 0.0 if before is None else wrap_pi(yaw - before)
            before = yaw
            found.append((t, total * DEG_PER_RAD))
        return found

    def yaw_rate(self) -> Series:
        """deg/s, over `RATE_WINDOW`."""
        return derivative(self.turned(), RATE_WINDOW)

    def ground_speed(self) -> Series:
        return [(t, math.hypot(north, east)) for t, north, east, _ in self.speed]

    def climb(self) -> Series:
        return [(t, -down) for t, _, _, down in self.speed]


def _looks(quat: Quaternion, heading: float) -> tuple[float, float]:
    """Return pitch and roll (rad) of a camera that looks along the drone's heading (rad).

    Valid until the camera looks backwards.
    """
    w, x, y, z = quat
    north, east, down = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    ahead = north * math.cos(heading) + east * math.sin(heading)
    return math.atan2(-down, ahead), math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))


RATE_WINDOW = 0.1
"""s over which a rate is taken."""


def derivative(series: Series, window: float) -> Series:
    """Rate of change at the middle of each `window` s."""
    found, first = [], 0
    for t, value in series:
        while t - series[first][0] > window:
            first += 1
        since, before = series[first]
        if t > since:
            found.append(((t + since) / 2.0, (value - before) / (t - since)))
    return found


def between(series: Series, start: float, end: float) -> Iterator[float]:
    return (value for t, value in series if start <= t <= end)


def passes(series: Series, value: float) -> float:
    """When the series first passes `value`, seen from zero; infinite if never."""
    sign = math.copysign(1.0, value)
    before: tuple[float, float] | None = None
    for t, now in series:
        if t >= 0.0 and sign * now >= sign * value:
            if before is None or now == before[1]:
                return t
            return before[0] + (t - before[0]) * (value - before[1]) / (now - before[1])
        before = (t, now)
    return math.inf


def at(series: Series, time: float) -> float:
    """The value at a time, between the two samples around it."""
    before: tuple[float, float] | None = None
    for t, now in series:
        if t >= time:
            if before is None:
                return now
            return before[1] + (now - before[1]) * (time - before[0]) / (t - before[0])
        before = (t, now)
    return math.nan if before is None else before[1]


@dataclass(frozen=True)
class Comparison:
    """One number beside what the paper says."""

    what: str
    measured: float
    unit: str
    published: str
    low: float
    high: float

    @property
    def agrees(self) -> bool:
        return self.low <= self.measured <= self.high


def _peak(series: Series) -> float:
    return max((abs(value) for value in between(series, 0.0, 2 * HOLD + AFTER)), default=math.nan)


def _rest(series: Series) -> float:
    values = list(between(series, *_REST))
    return max(map(abs, values)) if values else math.nan


def tilt_results(name: str, angle: Series, track: MeasuredTrack, fastest: float) -> Iterable[Comparison]:
    """Pitch or roll: both ways to 40 deg, a top speed, and level in the end."""
    one = max(between(angle, 0.0, HOLD + 0.3), default=math.nan)
    other = min(between(angle, HOLD, 2 * HOLD + 0.3), default=math.nan)
    yield Comparison(f"{name} reached", one, "deg", f"{TILT:g}", TILT - 1.0, TILT + 3.0)
    yield Comparison(f"{name} reached the other way", other, "deg", f"-{TILT:g}", -TILT - 3.0, -TILT + 1.0)
    yield Comparison(f"{name}: top speed", _peak(track.ground_speed()), "m/s", f"> {fastest:g}", fastest, math.inf)
    yield Comparison(f"{name} in the end", _rest(angle), "deg", "around 0", 0.0, 1.0)


def climb_results(track: MeasuredTrack) -> Iterable[Comparison]:
    climb, start = track.climb(), at(track.height, 0.0)
    # 2.5 % of the step: above what a hover does, below what a human eye takes for motion in a figure.
    yield Comparison("climb: delay", passes(climb, 0.1), "s", "0.1 to 0.2", 0.1, 0.2)
    up = max(between(climb, 0.0, HOLD + 0.3), default=math.nan)
    down = min(between(climb, HOLD, 2 * HOLD + 0.3), default=math.nan)
    yield Comparison("climb: speed up", up, "m/s", f"{CLIMB:g}", CLIMB - 0.2, CLIMB + 0.4)
    yield Comparison("climb: speed down", down, "m/s", f"-{CLIMB:g}", -CLIMB - 0.4, -CLIMB + 0.2)
    yield Comparison("climb: height in 2 s", at(track.height, HOLD) - start, "m", "almost 7", 6.5, 7.5)
    yield Comparison("climb in the end", _rest(climb), "m/s", "around 0", 0.0, 0.1)


def yaw_results(track: MeasuredTrack, delay: float) -> Iterable[Comparison]:
    rate, turned = track.yaw_rate(), track.turned()
    yield Comparison("yaw: delay", passes(turned, 1.0), "s", f"about {delay:g}", delay - 0.05, delay + 0.07)
    fast = (at(turned, HOLD) - at(turned, HOLD - 1.0)) / 1.0
    yield Comparison("yaw: rate", fast, "deg/s", f"{SPIN:g}", SPIN - 5.0, SPIN + 5.0)
    yield Comparison("yaw: one turn", passes([(t, a) for t, a in turned], 360.0), "s", "< 2.5", 0.0, 2.5)
    yield Comparison("yaw rate in the end", _rest(rate), "deg/s", "around 0", 0.0, 2.0)


def gimbal_results(
    name: str, position: Series, velocity: Series, span: tuple[float, float], speed: float
) -> Iterable[Comparison]:
    """Yield the results of turning the gimbal from limit to limit in both modes.

    The paper gives figures and no numbers, the limit is the aircraft's.
    """
    low, high = span
    way = high - low
    reached = max(between(position, 0.0, math.inf), default=math.nan)
    yield Comparison(f"gimbal {name}: position reached", reached, "deg", f"limit {high:g}", high - 1.0, high + 1.0)
    ideal = way / speed
    took = passes([(t, value - low) for t, value in position], 0.99 * way)
    yield Comparison(f"gimbal {name}: limit to limit", took, "s", f"{ideal:.2f} at the limit", 0.9 * ideal, ideal + 0.3)
    # Between a tenth and nine tenths of the way.
    turned = [(t, value - low) for t, value in velocity]
    rate = 0.8 * way / max(passes(turned, 0.9 * way) - passes(turned, 0.1 * way), 1e-6)
    yield Comparison(f"gimbal {name}: velocity", rate, "deg/s", f"limit {speed:g}", 0.9 * speed, 1.1 * speed)

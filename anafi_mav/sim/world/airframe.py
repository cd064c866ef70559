"""Motion of one simulated drone: commands of its autopilot, and 60 steps a second.

The model is small on purpose and fitted to the measurements in section IV of the anafi_ros paper:

- tilt follows its command as a second-order system (10 rad/s, damping 0.9) no faster than MaxPitchRollRotationSpeed;
- horizontal acceleration is g tan(tilt) minus a quadratic drag that makes full tilt end at the model's top speed;
- a stick at 0 % is a wish to stop: the axis is braked with up to 3 m/s2;
- all that is relative to the air, so that wind carries the drone away unless it tilts against it; a hover keeps its
  place against the wind as far as `FULL_TILT` allows;
- yaw rate and climb rate follow first-order after a pure delay (0.1 s each for yaw, 0.15 s and 0.12 s for climb),
  which gives 360 degrees in 2.0 s and 6.9 m in the first 2 s at 4 m/s.

Tilt, yaw and climb are linear as long as no limit is reached: a step solves them in closed form for a command that is
constant meanwhile. The drag is that of the mean speed. The push is that of the tilt at the end of the step: the half
step that this is early makes up for the half step that a command waits, and for the lead that the semi-implicit steps
of 5 ms had with which the flights in tests/support/sim_flights.json were recorded. The delays are whole steps.

Plain floats: with one array per quantity and a column per drone a step cost a dozen times as much for one drone.
"""

from __future__ import annotations

import math
from collections import deque

from anafi_mav.sim.world.model import AirframeModel
from anafi_mav.sim.world.motion import (
    FLOOR,
    FULL_TILT,
    NO_FENCE,
    STEP,
    TAKE_OFF_HEIGHT,
    G,
    Mode,
    Pose,
    Turn,
)
from anafi_mav.units import RAD_PER_DEG, wrap_pi

_TILT_OMEGA, _TILT_DAMPING = 10.0, 0.9
_YAW_TAU, _CLIMB_TAU = 0.1, 0.12


def _second_order(omega: float, damping: float, step: float) -> tuple[float, float, float, float]:
    """Solve x'' = -omega^2 x - 2 damping omega x' over a step, for a damping below 1.

    Returns the matrix ((a, b), (c, d)) of x, x' at its end over x, x' at its beginning.
    """
    decay, turn = damping * omega, omega * math.sqrt(1.0 - damping**2)
    fade = math.exp(-decay * step)
    cos, sin = fade * math.cos(turn * step), fade * math.sin(turn * step) / turn
    return cos + decay * sin, sin, -(omega**2) * sin, cos - decay * sin


def _first_order(tau: float, step: float) -> tuple[float, float]:
    """Solve x' = -x / tau over a step, with x = 1 at its beginning.

    Returns (x at its end, integral of x).
    """
    kept = math.exp(-step / tau)
    return kept, tau * (1.0 - kept)


_TILT_KEPT, _TILT_GAINED, _RATE_GAINED, _RATE_KEPT = _second_order(_TILT_OMEGA, _TILT_DAMPING, STEP)
_YAW_KEPT, _YAW_PASSED = _first_order(_YAW_TAU, STEP)
_CLIMB_KEPT, _CLIMB_PASSED = _first_order(_CLIMB_TAU, STEP)
_BRAKING = 3.0
"""m/s2 at most when stopping; the measured range is 2 to 4."""
_APPROACH = 1.8
"""m/s2 that an approach to a point is planned with, below `_BRAKING` so that it does not overshoot."""
_SPEED_GAIN = 2.5
"""1/s from a velocity error to an acceleration."""
_PLACE_GAIN = 0.9
"""1/s from a position error to a velocity, for the last metre."""
_CLIMB_GAIN = 1.2
_YAW_GAIN = 2.0
_ALIGNED = 3.0 * RAD_PER_DEG
"""A turn that has to come first is done when this close."""

_TURNED_OUT = 2.0 * RAD_PER_DEG
"""rad/s: a faster turn passes its end, the Ai's by a dozen degrees."""

_REACHED = 0.1
"""m from its target: a move is over when it is this close and still."""
_STILL = 0.15
"""m/s: slower than this is no motion to speak of."""
_RUSH = 3.0
"""m/s over ground above which the drag may brake alone; below it a drone may need to push into the wind."""
_HOLD_BELOW = 0.3
"""m/s over ground below which a hover in wind takes its place to keep."""
_HOLD_SPEED = 2.0
"""m/s at most back to a place that a gust has blown the drone from."""
_UNREST = 0.06
"""Share of the wind's speed that counts as no motion: gusts shake a drone that keeps its place."""
_LAND_SPEED = 2.0
"""m/s at most in a landing."""


def _bounded(value: float, low: float, high: float) -> float:
    return max(min(value, high), low)


def _shortened(north: float, east: float, length: float) -> tuple[float, float]:
    """The vector, shortened to at most `length`."""
    norm = math.hypot(north, east)
    return (north, east) if norm <= length else (north * length / norm, east * length / norm)


def _delay_line(delay: float) -> deque[float]:
    """Values on their way for `delay` s: the oldest leaves when one is appended."""
    steps = max(1, round(delay / STEP))
    return deque([0.0] * steps, maxlen=steps)


class Airframe:
    """One drone that flies: the verbs of its autopilot, and `step`. Metres, m/s, rad."""

    def __init__(self, model: AirframeModel) -> None:
        self.mode = Mode.OFF
        self.north = self.east = self.down = 0.0
        self.vn = self.ve = self.vd = 0.0
        self._roll = self._pitch = self._roll_rate = self._pitch_rate = 0.0
        self.heading = 0.0
        """Yaw, rad. Not wrapped: two turns clockwise are 4 pi, so that a moveBy of two turns makes two."""
        self._yaw_rate = 0.0
        self.stick_push = 0.0, 0.0
        """Acceleration (forward, right) that the roll and pitch sticks ask for; 0 asks to stop."""
        self._stick_yaw = self._stick_climb = 0.0
        """rad/s clockwise, m/s up."""
        self._target = 0.0, 0.0, 0.0
        self._target_yaw = 0.0
        self._turn = Turn.STICK
        self._move_speed = self._move_climb = self._move_yaw = 0.0
        self._tilt_rate_limit = 116.0 * RAD_PER_DEG
        self._ceiling = 150.0
        self._fence_radius = NO_FENCE
        self._fence_centre = 0.0, 0.0
        self._wind = 0.0, 0.0
        """Velocity of the air towards north and east."""
        self._windy = False
        self._hold: tuple[float, float] | None = None
        """A hover in wind keeps this place."""
        self._drag = G * math.tan(FULL_TILT) / model.max_speed**2
        self._yaw_line = _delay_line(model.yaw_delay)
        self._climb_line = _delay_line(model.climb_delay)
        self._pose: Pose | None = None
        """None: the drone has moved since it was made."""

    def nearest(self, heading: float) -> float:
        """`heading` (rad) as the unwrapped yaw that takes the shortest turn to reach."""
        return self.heading + wrap_pi(heading - self.heading)

    def _enter(self, mode: Mode) -> None:
        self.mode = mode
        if mode is not Mode.STICKS and mode is not Mode.LAND:
            self.sticks(0.0, 0.0, 0.0, 0.0)

    def off(self) -> None:
        """Motors off or idle. Forgets what was still on its way to them."""
        self._enter(Mode.OFF)
        for line in (self._yaw_line, self._climb_line):
            line.extend([0.0] * len(line))
        self._rest()

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
        self.stick_push = -G * math.tan(pitch), G * math.tan(roll)
        self._stick_yaw, self._stick_climb = yaw_rate, climb

    def stick_yaw(self, yaw_rate: float) -> None:
        """The yaw stick alone (rad/s)."""
        self._stick_yaw = yaw_rate

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
        self._target = north, east, -up
        self._target_yaw = self.heading if yaw is None else yaw
        self._turn = turn
        self._move_speed, self._move_climb, self._move_yaw = speed, climb, yaw_rate

    def limits(self, *, tilt_rate: float, ceiling: float) -> None:
        """How fast it may tilt (rad/s) and how high it may go (m)."""
        self._tilt_rate_limit, self._ceiling = tilt_rate, ceiling

    def fence(self, radius: float | None, centre: tuple[float, float] = (0.0, 0.0)) -> None:
        """Keep within `radius` m of `centre` (north, east); None removes the fence."""
        self._fence_radius = NO_FENCE if radius is None else radius
        self._fence_centre = centre

    def blow(self, north: float, east: float) -> None:
        """Wind: the air moves with this velocity (m/s) where the drone is."""
        self._wind = north, east
        self._windy = self._windy or north != 0.0 or east != 0.0

    @property
    def windy(self) -> bool:
        """True since the air moves."""
        return self._windy

    @property
    def wind(self) -> float:
        """m/s of the air over ground."""
        return math.hypot(*self._wind)

    def place(self, north: float, east: float, yaw: float = 0.0) -> None:
        """Put the drone on the ground somewhere, at rest."""
        self.north, self.east, self.down = north, east, 0.0
        self.heading = yaw
        self._rest()

    # -- the motion

    def step(self) -> None:
        """Advance by `STEP`. What lies on the ground without flying does not move."""
        mode = self.mode
        if mode is Mode.OFF:
            return
        self._pose = None
        up = -self.down
        wanted_n = wanted_e = climb = turn = 0.0
        if mode is Mode.MOVE:
            wanted_n, wanted_e, climb, turn = self._follow(up)
        elif mode is Mode.STICKS:
            climb, turn = self._stick_climb, self._stick_yaw
        elif mode is Mode.LAND:
            climb, turn = -min(_LAND_SPEED, 0.5 + 0.3 * up), self._stick_yaw
        elif mode is Mode.TAKE_OFF:
            climb = _bounded(1.5 * (TAKE_OFF_HEIGHT - up), -0.5, 1.0)
        if self._windy and (place := self._kept_place()) is not None:
            back = _PLACE_GAIN * (place[0] - self.north), _PLACE_GAIN * (place[1] - self.east)
            wanted_n, wanted_e = _shortened(*back, _HOLD_SPEED)
        climb = min(climb, max(_CLIMB_GAIN * (self._ceiling - up), 0.0))
        if mode is Mode.MOVE or mode is Mode.STICKS:
            climb = max(climb, min(_CLIMB_GAIN * (FLOOR - up), 0.0))

        turning = self._yaw_line[0]
        self._yaw_line.append(turn)
        lag = self._yaw_rate - turning
        turned = turning * STEP + lag * _YAW_PASSED
        self._yaw_rate = turning + lag * _YAW_KEPT
        self._tilt_and_push(wanted_n, wanted_e, self.heading + 0.5 * turned)
        self.heading += turned

        sinking = -self._climb_line[0]
        self._climb_line.append(climb)
        if mode is Mode.FALL:
            self.down += (self.vd + 0.5 * G * STEP) * STEP
            self.vd += G * STEP
        else:
            lag = self.vd - sinking
            self.down += sinking * STEP + lag * _CLIMB_PASSED
            self.vd = sinking + lag * _CLIMB_KEPT
        if self.down > 0.0:
            self._touch_ground()

    def _follow(self, up: float) -> tuple[float, float, float, float]:
        """Return velocity (north, east), climb and yaw rate of a move to the target."""
        off = self._target_yaw - self.heading
        if self._turn is Turn.STICK:
            turn = self._stick_yaw
        else:
            turn = _bounded(_YAW_GAIN * off, -self._move_yaw, self._move_yaw)
        if self._turn is Turn.FIRST:
            if abs(off) > _ALIGNED:
                return 0.0, 0.0, 0.0, turn
            self._turn = Turn.DURING
        north, east, down = self._target
        north, east = north - self.north, east - self.east
        distance = math.hypot(north, east)
        speed = min(self._move_speed, _PLACE_GAIN * distance, math.sqrt(2.0 * _APPROACH * distance))
        share = speed / max(distance, 1e-9)
        climb = _bounded(_CLIMB_GAIN * (-down - up), -self._move_climb, self._move_climb)
        return north * share, east * share, climb, turn

    def _kept_place(self) -> tuple[float, float] | None:
        """Return the place (north, east) that a hover in wind keeps; None without a hover."""
        if self.mode is Mode.TAKE_OFF:
            hovering = True
        else:
            hovering = self.mode in (Mode.STICKS, Mode.LAND) and self.stick_push == (0.0, 0.0)
        if not hovering:
            self._hold = None
        elif self._hold is None and self.vn**2 + self.ve**2 < _HOLD_BELOW**2:
            self._hold = self.north, self.east
        return self._hold

    def _tilt_and_push(self, wanted_n: float, wanted_e: float, yaw: float) -> None:
        """Tilt towards the wanted velocity, and accelerate by the tilt.

        `yaw` is that of the middle of the step.
        """
        vn, ve = air_n, air_e = self.vn, self.ve
        if self._windy and self.down < 0.0:
            air_n, air_e = vn - self._wind[0], ve - self._wind[1]
        drag = self._drag * math.hypot(air_n, air_e)
        resistance = drag * air_n, drag * air_e
        north, east = _shortened(_SPEED_GAIN * (wanted_n - vn), _SPEED_GAIN * (wanted_e - ve), _BRAKING)
        north, east = north + resistance[0], east + resistance[1]
        # Braking never needs to push onwards: at high speed the drag alone stops faster than `_BRAKING`.
        is_onwards = north * vn + east * ve > 0.0 and wanted_n == wanted_e == 0.0
        if is_onwards and (not self._windy or vn * vn + ve * ve > _RUSH**2):
            north = east = 0.0
        cos, sin = math.cos(yaw), math.sin(yaw)
        forward, right = north * cos + east * sin, east * cos - north * sin
        if self.mode is Mode.STICKS or self.mode is Mode.LAND:
            forward, right = self.stick_push[0] or forward, self.stick_push[1] or right
        if self._fence_radius < NO_FENCE:
            forward, right = self._fenced(forward, right, cos, sin, resistance)

        if self.mode is Mode.FALL:
            roll = pitch = 0.0
        else:  # a push to the right needs a roll to the right, a push forward a pitch down
            roll = _bounded(math.atan(right / G), -FULL_TILT, FULL_TILT)
            pitch = _bounded(math.atan(-forward / G), -FULL_TILT, FULL_TILT)
        self._roll, self._roll_rate = self._tilted(roll, self._roll, self._roll_rate)
        self._pitch, self._pitch_rate = self._tilted(pitch, self._pitch, self._pitch_rate)

        if self.mode is Mode.FALL:
            forward = right = 0.0
        else:
            forward, right = -G * math.tan(self._pitch), G * math.tan(self._roll)
        # The drag is that of the mean of both speeds through the air, to first order in the step.
        share = STEP / (1.0 + 0.5 * STEP * drag)
        gained_n = (forward * cos - right * sin - resistance[0]) * share
        gained_e = (forward * sin + right * cos - resistance[1]) * share
        self.north += (vn + 0.5 * gained_n) * STEP
        self.east += (ve + 0.5 * gained_e) * STEP
        self.vn, self.ve = vn + gained_n, ve + gained_e

    def _tilted(self, command: float, angle: float, rate: float) -> tuple[float, float]:
        """Return an angle and its rate a step later."""
        off, fastest = angle - command, self._tilt_rate_limit
        tilted = command + _TILT_KEPT * off + _TILT_GAINED * rate - angle
        later = _bounded(_RATE_GAINED * off + _RATE_KEPT * rate, -fastest, fastest)
        return angle + _bounded(tilted, -STEP * fastest, STEP * fastest), later

    def _fenced(
        self, forward: float, right: float, cos: float, sin: float, resistance: tuple[float, float]
    ) -> tuple[float, float]:
        """Take from the push (forward, right) what would carry the drone over its fence."""
        out_n, out_e = self.north - self._fence_centre[0], self.east - self._fence_centre[1]
        distance = max(math.hypot(out_n, out_e), 1e-9)
        out_n, out_e = out_n / distance, out_e / distance
        margin = max(self._fence_radius - distance - 0.5, 0.0)
        allowed = min(_PLACE_GAIN * margin, math.sqrt(2.0 * _APPROACH * margin))
        most = _bounded(_SPEED_GAIN * (allowed - (self.vn * out_n + self.ve * out_e)), -_BRAKING, G)
        most += resistance[0] * out_n + resistance[1] * out_e
        north, east = forward * cos - right * sin, forward * sin + right * cos
        excess = max(north * out_n + east * out_e - most, 0.0)
        north, east = north - excess * out_n, east - excess * out_e
        return north * cos + east * sin, east * cos - north * sin

    def _touch_ground(self) -> None:
        """Nothing goes through the ground, and what came down on it stays."""
        self.down = 0.0
        self.vd = min(self.vd, 0.0)
        if self.mode is Mode.LAND or self.mode is Mode.FALL:
            self._rest()

    def _rest(self) -> None:
        self.vn = self.ve = self.vd = 0.0
        self._roll = self._pitch = self._roll_rate = self._pitch_rate = self._yaw_rate = 0.0
        self._pose = None

    # -- what it has come to

    @property
    def pose(self) -> Pose:
        if self._pose is None:
            place = self.north, self.east, 0.0 - self.down  # not -0.0 for a drone on the ground
            attitude = self._roll, self._pitch, wrap_pi(self.heading)
            self._pose = Pose(*place, *attitude, self.vn, self.ve, self.vd)
        return self._pose

    @property
    def is_still(self) -> bool:
        """True below 0.15 m/s, more in wind."""
        limit = _STILL + self._unrest()
        return self.vn * self.vn + self.ve * self.ve + self.vd * self.vd < limit * limit

    @property
    def has_arrived(self) -> bool:
        """True at the end of what the present mode does; always for OFF and STICKS."""
        mode = self.mode
        if mode is Mode.MOVE:
            if self._turn is Turn.FIRST or not self.is_still:
                return False
            north, east, down = self._target
            gap = (self.north - north) ** 2 + (self.east - east) ** 2 + (self.down - down) ** 2
            off = self._target_yaw - self.heading
            is_aligned = abs(off) < _ALIGNED / 2.0 and abs(self._yaw_rate) < _TURNED_OUT
            is_aligned = is_aligned or self._turn is Turn.STICK
            return is_aligned and gap < (_REACHED + self._unrest()) ** 2
        if mode is Mode.TAKE_OFF:
            return self.down <= 0.05 - TAKE_OFF_HEIGHT and self.is_still
        if mode is Mode.LAND or mode is Mode.FALL:
            return self.down >= 0.0
        return True

    def _unrest(self) -> float:
        return _UNREST * self.wind if self._windy else 0.0

"""Velocities, accelerations and positions as sticks: the loops that an ANAFI does not have.

No I/O; time is a parameter.

ARSDK knows tilt, climb rate and turn rate (PCMD), and nothing in between these and a whole move. So the loop over the
horizontal velocity is closed here, on the drone's own speed, which it reports five times a second:

- the push (m/s2) that the drone's tilt gives is known from its attitude; any further acceleration is the air's: drag
  and wind. `MotionEstimate` keeps that estimate all the time, in a hover as well, so that a loop that begins in wind
  does not have to learn it first, and one that runs into the limit of its tilt does not wind up;
- a velocity needs a push in proportion to the error, against the air's, and on top of it the acceleration that the
  setpoint names. The error is the one that will be left when the tilt has followed: it lags by `TILT_LAG`;
- a position needs a velocity; the position of the drone is its GPS location carried on by its speed;
- the link delays reports and commands. A gain that the round trip does not permit is lowered (`MotionEstimate.gain`),
  and the heading is carried on to the time when the sticks arrive;
- until the sign of the reported roll is verified (`roll_sign`) nothing is derived from the tilt: the loop knows the
  last speed alone, counts with calm air, and leans by `CAUTIOUS_TILT` at most.

The climb rate loop is the drone's own; heights command a rate by their error. Nothing here limits more than the
drone's own MaxTilt, MaxVerticalSpeed and MaxRotationSpeed do.

Axes: north, east, down over ground; x front, y right in the body's; rad, m, m/s, m/s2. Heights above take-off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from anafi_mav import geo, units
from anafi_mav.clock import RoundTrip
from anafi_mav.drone import Limits, PilotingCommand
from anafi_mav.vehicle.base.roll_sign import RollCheck, RollSign

G = 9.81

VELOCITY_GAIN = 1.8
"""1/s: acceleration per velocity error. A speed that is 0.2 s old when the next one comes, and tilt that follows within
0.2 s, would bear half as much again before it overshoots."""

TILT_LAG = 0.25
"""s that an ANAFI's tilt takes to follow its stick, near enough (10 rad/s, damping 0.9: anafi_ros paper IV)."""

AIR_GAIN = 0.5
"""Share of a surprise in the speed that is believed to be the air's doing, at each look: it is known after half a
second, and one odd report does not tilt the drone."""

LOOK = 0.15
"""s, minimum between two updates of the air estimate.

An ANAFI reports its speed every 0.2 s. The difference of two speeds that arrive faster is noise.
"""

MOST_AIR = 8.0
"""m/s2 that the air may seem to push: as much as full tilt. More is a mistake of the estimate."""

PLACE_GAIN = 0.7
"""1/s: velocity per position error."""

PLACE_SPEED = 5.0
"""m/s at most towards a position, as fast as an ANAFI's own moveTo; a velocity that the setpoint names comes on top,
and what it has away from the position, so that this is held."""

PLACE_BRAKING = 1.5
"""m/s2 that an approach to a position is planned with; an ANAFI brakes with 2 to 4 (anafi_ros paper IV)."""

GPS_TRUST = 0.6
"""Share of the difference between a GPS location and the place carried on by speed that is believed at once. GPS comes
once a second and is some tenths of a second old, speed drifts."""

GPS_LEAP = 10.0
"""m beyond which GPS is believed altogether: it was gone for a while."""

HEIGHT_GAIN = 1.0
"""1/s: climb rate per height error."""

YAW_GAIN = 1.5
"""1/s: turn rate per heading error. Attitude comes at 5 Hz and answers after 0.1-0.2 s, which stays well damped."""

LOOP_DELAY_SHARE = 0.5
"""Largest product of a gain and the round trip of the link. A loop sees the effect of its sticks one round trip later,
and swings if it has corrected too much until then: with pi/2 for ever, with a third of that hardly."""

STALE = 1.0
"""s after which what the drone reported five times a second is not known any more. A loop that closes on an older
heading turns for ever, one that closes on an older speed accelerates for ever."""

STILL = 0.05
"""m/s: a velocity below it is a wish to stand, which the drone does better by itself: level sticks."""

LEAST_TILT = 0.01
"""Share of full tilt that an axis keeps while it is to move. An ANAFI takes a stick at zero as the wish to stop and
brakes hard (arsdk 2.1), which a velocity that needs no push at the moment does not mean."""

CAUTIOUS_TILT, CAUTIOUS_GAIN = 10.0 * units.RAD_PER_DEG, 1.2
"""rad, and acceleration per velocity error (1/s), while the sign of roll is not verified: without the speed that the
tilt leads to, a speed is some tenths of a second old."""

SATURATED_FOR = 1.5
"""s at the limit of the tilt after which that is worth a word: any step in speed leans on it for a moment."""

WIND = 5.0
"""m/s of headwind that a speed is to be held against when it is judged whether MaxTilt is enough."""

FASTEST, FULL_TILT = 15.0, 40.0 * units.RAD_PER_DEG
"""m/s at full tilt in calm air: what the drag is derived from, for that judgement alone (anafi_ros paper, table I)."""

_DRAG = G * math.tan(FULL_TILT) / FASTEST**2


def tilt_for(speed: float, wind: float = WIND) -> float:
    """Tilt (rad) that holds a ground speed (m/s) against this much headwind."""
    return math.atan(_DRAG * (speed + wind) ** 2 / G)


@dataclass(frozen=True)
class Axis:
    """Setpoint along one axis; None: unset."""

    velocity: float | None = None
    acceleration: float | None = None
    position: float | None = None
    """m along this axis as `MotionEstimate.north` counts; a velocity is a feed-forward then."""


@dataclass(frozen=True)
class Demand:
    """Goal of the stick control. An axis without a setpoint holds still."""

    x: Axis = Axis()
    y: Axis = Axis()
    body: bool = False
    """Velocities and accelerations are front and right of the nose wherever it points; otherwise north and east."""
    turn: float = 0.0
    """rad from north to the first axis of positions, clockwise."""
    down_velocity: float | None = None
    down_acceleration: float | None = None
    height: float | None = None
    """m above take-off."""
    yaw: float | None = None
    yaw_rate: float | None = None
    """rad/s, clockwise; with `yaw` a feed-forward."""

    @property
    def placed(self) -> bool:
        """A horizontal position is asked for."""
        return self.x.position is not None or self.y.position is not None


class MotionEstimate:
    """Estimated motion of the drone, from its reports, and the effect of the air on it."""

    def __init__(self, roll: RollCheck | None = None) -> None:
        self._roll = roll or RollCheck(RollSign.NORMAL)
        self.round_trip = RoundTrip()
        """Of the link: so long after a command its effect is reported."""
        self.yaw: float | None = None
        """rad, clockwise from north, as last reported; None: unknown."""
        self.height: float | None = None
        """m above take-off, as last reported."""
        self.north = self.east = 0.0
        """m from `reference`, carried on by speed between GPS locations."""
        self.reference: tuple[float, float] | None = None
        """deg, deg: where `north` and `east` count from; None before the first location."""
        self.air = (0.0, 0.0)
        """m/s2 north and east that is not the tilt's doing."""
        self.turning = 0.0
        """rad/s, clockwise."""
        self._tilt = (0.0, 0.0)
        self._attitude_at = self._velocity_at = self._height_at = -math.inf
        self._velocity = (0.0, 0.0, 0.0)
        self._push_then = (0.0, 0.0)
        """The push when the speed was last reported."""
        self._looked = (0.0, 0.0)
        self._looked_at = -math.inf
        self._pushed_north = self._pushed_east = 0.0

    def on_attitude(self, roll: float, pitch: float, yaw: float, now: float) -> None:
        """AttitudeChanged."""
        elapsed = now - self._attitude_at
        self.turning = 0.0
        if self.yaw is not None and 0.0 < elapsed < STALE:
            self.turning = units.wrap_pi(yaw - self.yaw) / elapsed
        self._tilt, self.yaw, self._attitude_at = (roll, pitch), yaw, now

    def on_velocity(self, north: float, east: float, down: float, now: float) -> None:
        """SpeedChanged."""
        elapsed = now - self._velocity_at
        push = self.push()
        if 0.0 < elapsed < STALE:
            before, then = self._velocity, self._push_then
            self.north += (north + before[0]) / 2.0 * elapsed
            self.east += (east + before[1]) / 2.0 * elapsed
            # What the tilt has done since the last look (m/s).
            self._pushed_north += (push[0] + then[0]) / 2.0 * elapsed
            self._pushed_east += (push[1] + then[1]) / 2.0 * elapsed
            if now - self._looked_at >= LOOK:
                self._look(north, east, now)
        else:
            self._looked_at, self._looked = now, (north, east)
            self._pushed_north = self._pushed_east = 0.0
        self._velocity, self._velocity_at, self._push_then = (north, east, down), now, push

    def _look(self, north: float, east: float, now: float) -> None:
        """Update the air estimate: change of the speed beyond the change caused by the tilt."""
        elapsed = now - self._looked_at
        air_north, air_east = self.air
        air_north += AIR_GAIN * ((north - self._looked[0] - self._pushed_north) / elapsed - air_north)
        air_east += AIR_GAIN * ((east - self._looked[1] - self._pushed_east) / elapsed - air_east)
        size = math.hypot(air_north, air_east)
        shrink = min(1.0, MOST_AIR / size) if size > 0.0 else 1.0
        self.air = (air_north * shrink, air_east * shrink)
        self._looked_at, self._looked = now, (north, east)
        self._pushed_north = self._pushed_east = 0.0

    def on_height(self, ato: float, now: float) -> None:
        """AltitudeChanged."""
        self.height, self._height_at = ato, now

    def forget_attitude(self) -> None:
        """The drone says that it does not know its attitude."""
        self._attitude_at, self.yaw, self.turning = -math.inf, None, 0.0

    def forget_velocity(self) -> None:
        """The drone says that it does not know its speed."""
        self._velocity_at = -math.inf

    def forget_height(self) -> None:
        """The drone says that it does not know its height."""
        self._height_at = -math.inf

    def on_place(self, latitude: float, longitude: float) -> None:
        """GpsLocationChanged."""
        if self.reference is None:
            self.reference = (latitude, longitude)
        north, east = geo.offset(*self.reference, latitude, longitude)
        trust = GPS_TRUST if math.hypot(north - self.north, east - self.east) < GPS_LEAP else 1.0
        self.north += trust * (north - self.north)
        self.east += trust * (east - self.east)

    def air_at(self, north: float, east: float) -> tuple[float, float]:
        """Return the acceleration (m/s2) that the air would cause at another ground speed (m/s).

        Drag grows with the square of the speed through the air. The estimate gives the present speed through the air;
        only the difference is the model's. Without a roll to trust there is no estimate, and the air counts as calm.
        """
        if not self.trusts_tilt:
            speed = math.hypot(north, east)
            return -_DRAG * speed * north, -_DRAG * speed * east
        strength = math.sqrt(_DRAG * math.hypot(*self.air))
        through = (0.0, 0.0) if strength == 0.0 else (-self.air[0] / strength, -self.air[1] / strength)
        there = (through[0] + north - self._velocity[0], through[1] + east - self._velocity[1])
        speed = math.hypot(*there)
        return -_DRAG * speed * there[0], -_DRAG * speed * there[1]

    @property
    def trusts_tilt(self) -> bool:
        """True when the sign of the reported roll is verified."""
        return self._roll.sign is RollSign.NORMAL

    def push(self) -> tuple[float, float]:
        """m/s2 north and east that the drone's tilt gives."""
        if self.yaw is None:
            return (0.0, 0.0)
        roll, pitch = self._tilt
        return _turned(-G * math.tan(pitch), G * math.tan(roll), self.yaw)

    def knows_heading(self, now: float) -> bool:
        return self.yaw is not None and now - self._attitude_at < STALE

    def knows_velocity(self, now: float) -> bool:
        return now - self._velocity_at < STALE and self.knows_heading(now)

    def knows_height(self, now: float) -> bool:
        return self.height is not None and now - self._height_at < STALE

    def heading(self, now: float) -> float:
        """Return the heading (rad) when a command of now arrives. Only after `knows_heading`.

        It is carried on by the turn since the last report.
        """
        return (self.yaw or 0.0) + self.turning * min(now - self._attitude_at + self.round_trip.seconds, STALE)

    def gain(self, gain: float) -> float:
        """Return a gain (1/s) that the delay of the link permits: the given one, or less."""
        delay = self.round_trip.seconds
        return gain if gain * delay <= LOOP_DELAY_SHARE else LOOP_DELAY_SHARE / delay

    def velocity(self, at: float) -> tuple[float, float]:
        """Return m/s north and east, extrapolated to a moment by tilt and air.

        As last reported while roll is not verified.
        """
        if not self.trusts_tilt:
            return self._velocity[0], self._velocity[1]
        ahead = max(0.0, min(at - self._velocity_at, STALE))
        north, east = (v + (p + a) * ahead for v, p, a in zip(self._velocity, self.push(), self.air, strict=False))
        return north, east

    @property
    def down_velocity(self) -> float:
        return self._velocity[2]


class VelocityController:
    """Makes sticks of demands. One per session: what it remembers belongs to the demands before."""

    def __init__(self, motion: MotionEstimate) -> None:
        self.motion = motion
        self._climb: float | None = None
        """m/s up that vertical accelerations have added up to."""
        self._at = -math.inf
        self._saturated_since: float | None = None
        self.short_of: float | None = None
        """m/s of horizontal velocity that the tilt limit has been costing for a while; None: it does not."""

    def sticks(self, demand: Demand, limits: Limits, now: float) -> PilotingCommand | None:
        """Return the sticks for this moment; None if they need a value that is no longer reported."""
        roll, pitch = 0.0, 0.0
        if not self._stands(demand):
            if not self.motion.knows_velocity(now):
                return None
            roll, pitch = self._tilt(demand, limits, now)
        else:
            self._saturated_since = self.short_of = None
        if demand.height is not None and not self.motion.knows_height(now):
            return None
        climb = self._climb_rate(demand, limits, now)
        self._at = now
        return PilotingCommand(
            roll_deg=roll * units.DEG_PER_RAD,
            pitch_deg=pitch * units.DEG_PER_RAD,
            yaw_rate_dps=self._turn(demand, now) * units.DEG_PER_RAD,
            climb_mps=climb,
        )

    def _stands(self, demand: Demand) -> bool:
        """No horizontal motion is wanted: level sticks, and the drone keeps its place by itself."""
        if demand.placed:
            return False
        accelerated = bool(demand.x.acceleration or demand.y.acceleration)
        return not accelerated and math.hypot(demand.x.velocity or 0.0, demand.y.velocity or 0.0) < STILL

    def _tilt(self, demand: Demand, limits: Limits, now: float) -> tuple[float, float]:
        motion = self.motion
        heading = motion.heading(now)
        frame = heading if demand.body else 0.0
        velocity = _turned(*motion.velocity(now + TILT_LAG), -frame)
        towards = _turned(*self._approach(demand, frame), -frame)
        wish, push = [0.0, 0.0], [0.0, 0.0]
        closed = [False, False]
        for i, axis in enumerate((demand.x, demand.y)):
            # A push alone is given as it is: drag limits what becomes of it, as on any multicopter.
            closed[i] = axis.velocity is not None or axis.acceleration is None or demand.placed
            wish[i] = (axis.velocity or 0.0) + towards[i] if closed[i] else velocity[i]
            push[i] = axis.acceleration or 0.0
        air = _turned(*motion.air_at(*_turned(wish[0], wish[1], frame)), -frame)
        gain = motion.gain(VELOCITY_GAIN if motion.trusts_tilt else CAUTIOUS_GAIN)
        for i in range(2):
            if closed[i]:
                push[i] += gain * (wish[i] - velocity[i]) - air[i]
        if demand.body:  # axes that turn take the velocity along, which is an acceleration
            push = [push[0] - motion.turning * wish[1], push[1] + motion.turning * wish[0]]
        most = G * math.tan(tilt_limit(limits, motion))
        size = math.hypot(*push)
        self._note_saturation(size > most, math.hypot(wish[0] - velocity[0], wish[1] - velocity[1]), now)
        if size > most:
            push = [part * most / size for part in push]
        front, right = _turned(push[0], push[1], frame - heading)
        wish_front, wish_right = _turned(wish[0], wish[1], frame - heading)
        full = limits.tilt_deg * units.RAD_PER_DEG
        pitch = -_kept(math.atan(front / G), wish_front, full)
        return _kept(math.atan(right / G), wish_right, full), pitch

    def _approach(self, demand: Demand, frame: float) -> tuple[float, float]:
        """Return the velocity (north, east) towards the demanded position.

        `frame`: rad from north to the first axis of velocities. One that leads away from the position is a mistake in
        one of the two, and the position holds.
        """
        along, across = _turned(self.motion.north, self.motion.east, -demand.turn)
        x = 0.0 if demand.x.position is None else demand.x.position - along
        y = 0.0 if demand.y.position is None else demand.y.position - across
        north, east = _turned(x, y, demand.turn)
        distance = math.hypot(north, east)
        if distance == 0.0:
            return 0.0, 0.0
        north, east = north / distance, east / distance
        ahead = _turned(demand.x.velocity or 0.0, demand.y.velocity or 0.0, frame)
        most = PLACE_SPEED + max(0.0, -(ahead[0] * north + ahead[1] * east))
        gain = PLACE_GAIN / VELOCITY_GAIN * self.motion.gain(VELOCITY_GAIN)  # the loop around that over velocity
        speed = min(gain * distance, math.sqrt(2.0 * PLACE_BRAKING * distance), most)
        return north * speed, east * speed

    def _note_saturation(self, saturated: bool, short: float, now: float) -> None:
        if not saturated:
            self._saturated_since = self.short_of = None
            return
        if self._saturated_since is None:
            self._saturated_since = now
        self.short_of = short if now - self._saturated_since >= SATURATED_FOR else None

    def _climb_rate(self, demand: Demand, limits: Limits, now: float) -> float:
        if demand.height is None and demand.down_velocity is None and demand.down_acceleration is not None:
            if self._climb is None:
                self._climb = -self.motion.down_velocity if self.motion.knows_velocity(now) else 0.0
            elapsed = min(now - self._at, STALE) if self._at > -math.inf else 0.0
            self._climb -= demand.down_acceleration * elapsed
            self._climb = units.clip(self._climb, -limits.climb_mps, limits.climb_mps)
            return self._climb
        self._climb = None
        # A faster one cannot be flown, and would only shift the height that is held.
        climb = -units.clip(demand.down_velocity or 0.0, -limits.climb_mps, limits.climb_mps)
        if demand.height is not None and self.motion.height is not None:
            climb += self.motion.gain(HEIGHT_GAIN) * (demand.height - self.motion.height)
        return units.clip(climb, -limits.climb_mps, limits.climb_mps)

    def _turn(self, demand: Demand, now: float) -> float:
        rate = demand.yaw_rate or 0.0
        if demand.yaw is not None and self.motion.knows_heading(now):
            return turn_towards(demand.yaw, self.motion.heading(now), rate, self.motion.gain(YAW_GAIN))
        return rate


def tilt_limit(limits: Limits, motion: MotionEstimate) -> float:
    """Return the tilt (rad) that a loop may ask for."""
    tilt = limits.tilt_deg * units.RAD_PER_DEG
    return tilt if motion.trusts_tilt else min(tilt, CAUTIOUS_TILT)


def turn_towards(yaw: float, heading: float, feed_forward: float = 0.0, gain: float = YAW_GAIN) -> float:
    """Turn rate (rad/s, clockwise +) that brings a drone's heading (rad) to `yaw` the short way."""
    return feed_forward + gain * units.wrap_pi(yaw - heading)


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    """Rotate a vector from axes that are turned clockwise by `angle` into the unturned axes."""
    cos, sin = math.cos(angle), math.sin(angle)
    return x * cos - y * sin, x * sin + y * cos


def _kept(tilt: float, wish: float, full: float) -> float:
    """A tilt that is not zero while the axis is to move with `wish` m/s."""
    least = LEAST_TILT * full
    if abs(wish) < 4.0 * STILL or abs(tilt) >= least:
        return tilt
    return math.copysign(least, tilt if tilt != 0.0 else wish)

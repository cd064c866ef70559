"""How the drones move: one array per quantity, one column per drone, 60 steps a second.

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

Frames: position and velocity are north, east, down in metres from the place the simulator was given as home; attitude
is roll (right wing down), pitch (nose up), yaw (clockwise from north) in rad. The ground is a plane at down = 0.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anafi_mav.sim.world.model import AirframeModel
from anafi_mav.sim.world.vector_math import Array, DelayLine, bounded, limit
from anafi_mav.units import RAD_PER_DEG, wrap_pi

STEP = 1.0 / 60.0
"""s. 0.1, 0.15 and 0.2 s are whole numbers of steps, and so is the time between two pictures at 30 Hz."""

G = 9.81
FULL_TILT = 40.0 * RAD_PER_DEG
"""The largest tilt the family flies; MaxTilt cannot be set higher."""

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

TAKE_OFF_HEIGHT = 1.0
"""m above ground at which a take-off ends."""
FLOOR = 0.3
"""m above ground that neither sticks nor moves go below; only a landing does. Assumed."""
_REACHED = 0.1
"""m from its target: a move is over when it is this close and still."""
_STILL = 0.15
"""m/s: slower than this is no motion to speak of."""
NO_FENCE = 1e9
"""m: the radius of a fence that is off."""
_RUSH = 3.0
"""m/s over ground above which the drag may brake alone; below it a drone may need to push into the wind."""
_HOLD_BELOW = 0.3
"""m/s over ground below which a hover in wind takes its place to keep."""
_HOLD_SPEED = 2.0
"""m/s at most back to a place that a gust has blown the drone from."""
_UNREST = 0.06
"""Share of the wind's speed that counts as no motion: gusts shake a drone that keeps its place."""

_TILT_SIGNS: Array = np.array([[1.0], [-1.0]]) / G
"""A push to the right needs a roll to the right, a push forward a pitch down."""
_PUSH_SIGNS: Array = np.array([[G], [-G]])


class Mode(enum.IntEnum):
    """Motion mode of one drone."""

    OFF = 0
    """Motors off or idle, on the ground."""
    STICKS = 1
    """`sticks` say where to; all zero is a hover."""
    MOVE = 2
    """To `target`, then stay there."""
    TAKE_OFF = 3
    """Up to `TAKE_OFF_HEIGHT`, sticks ignored."""
    LAND = 4
    """Down to the ground; the sticks still steer sideways."""
    FALL = 5
    """Motors cut in the air."""


class Turn(enum.IntEnum):
    """Control of the heading in a MOVE."""

    STICK = 0
    """As the yaw stick says."""
    FIRST = 1
    """To the wanted heading before the move begins."""
    DURING = 2
    """To the wanted heading on the way."""


@dataclass(frozen=True)
class Pose:
    """True pose of a drone: metres, m/s, rad. `up` is the height above the take-off plane."""

    north: float
    east: float
    up: float
    roll: float
    pitch: float
    yaw: float
    vn: float
    ve: float
    vd: float

    @property
    def ground_speed(self) -> float:
        return math.hypot(self.vn, self.ve)

    def bearing(self, north: float, east: float) -> tuple[float, float]:
        """(direction in rad, distance in m) of a point."""
        north, east = north - self.north, east - self.east
        return math.atan2(east, north), math.hypot(north, east)


_STICK, _FIRST, _DURING = int(Turn.STICK), int(Turn.FIRST), int(Turn.DURING)
"""As numpy compares them: looking up a member of an enum costs more than the comparison, in every step."""


class _Orders:
    """Commanded motion of all drones, computed once and not in every step.

    Contains masks over the fleet, and flags of the masks that are empty.
    """

    def __init__(self, motion: Motion) -> None:
        mode = motion.mode
        off, sticks = mode == int(Mode.OFF), mode == int(Mode.STICKS)
        steered = sticks | (mode == int(Mode.LAND))
        self.moving = mode == int(Mode.MOVE)
        self.take_off = mode == int(Mode.TAKE_OFF)
        self.land = mode == int(Mode.LAND)
        self.fall = mode == int(Mode.FALL)
        self.floored = self.moving | sticks
        airborne = ~(off | self.fall)
        self.thrust = airborne.astype(np.float64)
        self.resting = off
        self.aimless = off | sticks
        """Nowhere to arrive."""
        self.dropping = self.land | self.fall
        self.climb: Array = np.where(sticks, motion.stick_climb, 0.0)
        self.turn: Array = np.where(steered, motion.stick_yaw, 0.0)
        self.by_stick = motion.turn == _STICK
        self.pushed = steered & (motion.stick_push != 0.0)
        self.hovering = self.take_off | (steered & ~self.pushed.any(axis=0))
        self.any = not off.all()
        self.any_resting = bool(off.any())
        self.any_moving = bool(self.moving.any())
        self.any_first = bool((self.moving & (motion.turn == _FIRST)).any())
        self.any_take_off = bool(self.take_off.any())
        self.any_land = bool(self.land.any())
        self.any_fall = bool(self.fall.any())
        self.any_dropping = self.any_fall or self.any_land
        self.any_pushed = bool(self.pushed.any())
        self.any_fence = bool((motion.fence_radius < NO_FENCE).any())
        self.all_floored = bool(self.floored.all())
        self.all_airborne = bool(airborne.all())


class Motion:
    """The fleet's motion.

    `step()` advances all of it; `airframe.Airframe` is the handle of one drone."""

    def __init__(self, airframes: Sequence[AirframeModel]) -> None:
        count = len(airframes)
        self.count = count
        self.mode: NDArray[np.int8] = np.zeros(count, np.int8)
        self.position: Array = np.zeros((3, count))
        self.velocity: Array = np.zeros((3, count))
        self.tilt: Array = np.zeros((2, count))
        """roll, pitch"""
        self.tilt_rate: Array = np.zeros((2, count))
        self.yaw: Array = np.zeros(count)
        """Not wrapped: two turns clockwise are 4 pi, so that a moveBy of two turns makes two."""
        self.yaw_rate: Array = np.zeros(count)
        self.stick_push: Array = np.zeros((2, count))
        """Acceleration (forward, right) that the roll and pitch sticks ask for; 0 asks to stop."""
        self.stick_yaw: Array = np.zeros(count)
        """rad/s clockwise"""
        self.stick_climb: Array = np.zeros(count)
        """m/s up"""
        self.target: Array = np.zeros((3, count))
        self.target_yaw: Array = np.zeros(count)
        self.turn: NDArray[np.int8] = np.zeros(count, np.int8)
        self.move_speed: Array = np.zeros(count)
        self.move_climb: Array = np.zeros(count)
        self.move_yaw: Array = np.zeros(count)
        self.land_speed: Array = np.full(count, 2.0)
        self.tilt_rate_limit: Array = np.full(count, 116.0 * RAD_PER_DEG)
        self.ceiling: Array = np.full(count, 150.0)
        self.fence_radius: Array = np.full(count, NO_FENCE)
        self.fence_centre: Array = np.zeros((2, count))
        self.wind: Array = np.zeros((2, count))
        """Velocity of the air towards north and east."""
        self.windy = False
        """Somewhere the air moves. A calm fleet is spared the arithmetic."""
        self.hold: Array = np.zeros((2, count))
        self.holding: NDArray[np.bool_] = np.zeros(count, np.bool_)
        """A hover in wind keeps the place `hold`."""
        self.drag: Array = np.array([G * math.tan(FULL_TILT) / frame.max_speed**2 for frame in airframes])
        self._body_push: Array = np.zeros((2, count))
        """Forward and right, while a step is worked out."""
        self._orders = _Orders(self)
        self.stale = False
        """True after a command: the commanded motion of the fleet must be computed again."""
        self._poses: list[Pose] | None = None
        """None: a drone has moved since they were made."""
        self.yaw_line = DelayLine([frame.yaw_delay for frame in airframes], STEP)
        self.climb_line = DelayLine([frame.climb_delay for frame in airframes], STEP)

    def _current_orders(self) -> _Orders:
        if self.stale:
            self._orders, self.stale, self._poses = _Orders(self), False, None
        return self._orders

    def step(self) -> None:
        """Advance every drone by `STEP`. A fleet that stands on the ground costs nothing."""
        orders = self._current_orders()
        if not orders.any:
            return
        self._poses = None
        velocity = self.velocity
        horizontal = velocity[:2]
        up = -self.position[2]

        wanted: Array | None = None
        climb, turn = orders.climb, orders.turn
        if orders.any_moving:
            wanted, climb, turn = self._follow(orders, up)
        if self.windy:
            wanted = self._keep_place(orders, wanted)
        if orders.any_take_off:
            climb = np.where(orders.take_off, bounded(1.5 * (TAKE_OFF_HEIGHT - up), -0.5, 1.0), climb)
        if orders.any_land:
            climb = np.where(orders.land, -np.minimum(self.land_speed, 0.5 + 0.3 * up), climb)
        climb = np.minimum(climb, np.maximum(_CLIMB_GAIN * (self.ceiling - up), 0.0))
        lowest = np.minimum(_CLIMB_GAIN * (FLOOR - up), 0.0)
        climb = np.maximum(climb, lowest if orders.all_floored else np.where(orders.floored, lowest, climb))

        turn = self.yaw_line.push(turn)
        lag = self.yaw_rate - turn
        turned = turn * STEP + lag * _YAW_PASSED
        self.yaw_rate = turn + lag * _YAW_KEPT
        self._tilt_and_push(orders, wanted, horizontal, self.yaw + 0.5 * turned)
        self.yaw += turned

        sinking = -self.climb_line.push(climb)
        lag = velocity[2] - sinking
        sunk = sinking * STEP + lag * _CLIMB_PASSED
        sinking += lag * _CLIMB_KEPT
        if orders.any_fall:
            sunk = np.where(orders.fall, (velocity[2] + 0.5 * G * STEP) * STEP, sunk)
            sinking = np.where(orders.fall, velocity[2] + G * STEP, sinking)
        velocity[2] = sinking
        self.position[2] += sunk
        self._touch_ground(orders)

    def _follow(self, orders: _Orders, up: Array) -> tuple[Array, Array, Array]:
        """Return the velocity, climb and yaw rate that bring the moving drones to their targets.

        For the other drones the velocity is zero, climb and yaw rate are the commanded ones.
        """
        moving = going = orders.moving
        way = self.target[:2] - self.position[:2]
        distance = np.hypot(way[0], way[1])
        heading_error = self.target_yaw - self.yaw
        if orders.any_first:
            first = self.turn == _FIRST
            waiting = first & (np.abs(heading_error) > _ALIGNED)
            self.turn[first & ~waiting] = _DURING
            going = moving & ~waiting
            orders.any_first = bool(waiting.any())
        speed = np.minimum(self.move_speed, np.minimum(_PLACE_GAIN * distance, np.sqrt(2.0 * _APPROACH * distance)))
        wanted = np.where(going, way / np.maximum(distance, 1e-9) * speed, 0.0)
        rise = bounded(_CLIMB_GAIN * (-self.target[2] - up), -self.move_climb, self.move_climb)
        climb = np.where(going, rise, orders.climb)
        turning = bounded(_YAW_GAIN * heading_error, -self.move_yaw, self.move_yaw)
        turn = np.where(moving, np.where(orders.by_stick, self.stick_yaw, turning), orders.turn)
        return wanted, climb, turn

    def _keep_place(self, orders: _Orders, wanted: Array | None) -> Array:
        """Velocity that brings hovering drones back to where they began to hover."""
        hovering = orders.hovering
        slow = (self.velocity[:2] ** 2).sum(axis=0) < _HOLD_BELOW**2
        fresh = hovering & slow & ~self.holding
        self.hold = np.where(fresh, self.position[:2], self.hold)
        self.holding = hovering & (self.holding | slow)
        back = limit(_PLACE_GAIN * (self.hold - self.position[:2]), _HOLD_SPEED)
        return np.where(self.holding, back, 0.0 if wanted is None else wanted)

    def _tilt_and_push(self, orders: _Orders, wanted: Array | None, horizontal: Array, yaw: Array) -> None:
        """Turn wishes into a tilt command, let the tilt follow it, and accelerate by it.

        `wanted` None: everybody wants to stop. `yaw` is that of the middle of the step.
        """
        through_air = horizontal
        if self.windy:
            through_air = horizontal - np.where(self.position[2] < 0.0, self.wind, 0.0)
        drag = self.drag * np.hypot(through_air[0], through_air[1])
        resistance = drag * through_air
        wish = horizontal * -_SPEED_GAIN if wanted is None else _SPEED_GAIN * (wanted - horizontal)
        push = limit(wish, _BRAKING) + resistance
        # Braking never needs to push onwards: at high speed the drag alone stops faster than `_BRAKING`.
        onwards = push[0] * horizontal[0] + push[1] * horizontal[1] > 0.0
        if wanted is not None:
            onwards &= (wanted[0] == 0.0) & (wanted[1] == 0.0)
        if self.windy:
            onwards &= (horizontal**2).sum(axis=0) > _RUSH**2
        if np.count_nonzero(onwards):
            push = np.where(onwards, 0.0, push)
        cos, sin = np.cos(yaw), np.sin(yaw)
        body = self._body_push
        body[0] = push[0] * cos + push[1] * sin
        body[1] = push[1] * cos - push[0] * sin
        if orders.any_pushed:
            np.copyto(body, self.stick_push, where=orders.pushed)
        if orders.any_fence:
            self._fenced(body, cos, sin, horizontal, resistance)

        command = np.arctan(body[::-1] * _TILT_SIGNS)
        command = bounded(command, -FULL_TILT, FULL_TILT)
        if not orders.all_airborne:
            command = command * orders.thrust
        off, rate = self.tilt - command, self.tilt_rate
        fastest = self.tilt_rate_limit
        tilted = command + _TILT_KEPT * off + _TILT_GAINED * rate - self.tilt
        tilted = bounded(tilted, -STEP * fastest, STEP * fastest)
        self.tilt_rate = bounded(_RATE_GAINED * off + _RATE_KEPT * rate, -fastest, fastest)
        self.tilt += tilted

        right, forward = np.tan(self.tilt) * _PUSH_SIGNS
        if not orders.all_airborne:
            right, forward = right * orders.thrust, forward * orders.thrust
        gained = body
        gained[0] = forward * cos - right * sin
        gained[1] = forward * sin + right * cos
        gained -= resistance
        # The drag is that of the mean of both speeds through the air, to first order in the step.
        gained *= STEP / (1.0 + 0.5 * STEP * drag)
        self.position[:2] += (horizontal + 0.5 * gained) * STEP
        horizontal += gained

    def _fenced(self, push: Array, cos: Array, sin: Array, horizontal: Array, resistance: Array) -> None:
        """Take from the push (forward, right) what would carry a drone over its fence."""
        out = self.position[:2] - self.fence_centre
        distance = np.maximum(np.hypot(out[0], out[1]), 1e-9)
        out = out / distance
        margin = np.maximum(self.fence_radius - distance - 0.5, 0.0)
        allowed = np.minimum(_PLACE_GAIN * margin, np.sqrt(2.0 * _APPROACH * margin))
        speed_out = horizontal[0] * out[0] + horizontal[1] * out[1]
        most = bounded(_SPEED_GAIN * (allowed - speed_out), -_BRAKING, G)
        most += resistance[0] * out[0] + resistance[1] * out[1]
        forward, right = push
        north, east = forward * cos - right * sin, forward * sin + right * cos
        excess = np.maximum(north * out[0] + east * out[1] - most, 0.0)
        north, east = north - excess * out[0], east - excess * out[1]
        push[0] = north * cos + east * sin
        push[1] = east * cos - north * sin

    def _touch_ground(self, orders: _Orders) -> None:
        """Nothing goes through the ground; what lies on it without flying does not move."""
        below = self.position[2] > 0.0
        if not orders.any_resting and not np.count_nonzero(below):
            return
        self.position[2] = np.where(below, 0.0, self.position[2])
        resting = orders.resting | (below & orders.dropping)
        if resting.any():
            self.velocity[:, resting] = 0.0
            self.tilt[:, resting] = 0.0
            self.tilt_rate[:, resting] = 0.0
            self.yaw_rate[resting] = 0.0
        sinking = below & (self.velocity[2] > 0.0)
        self.velocity[2] = np.where(sinking, 0.0, self.velocity[2])

    def still(self) -> list[bool]:
        """Per drone: no motion to speak of (0.15 m/s, more in wind)."""
        slow: list[bool] = self._slow().tolist()
        return slow

    def _slow(self) -> Any:
        north, east, down = self.velocity
        return north * north + east * east + down * down < (_STILL + self._unrest()) ** 2

    def _unrest(self) -> Any:
        return _UNREST * np.hypot(self.wind[0], self.wind[1]) if self.windy else 0.0

    def arrived(self) -> list[bool]:
        """Per drone: the present mode has got where it wanted to (always true for OFF and STICKS)."""
        orders = self._current_orders()
        done: Any = orders.aimless
        if orders.any_moving:
            gap = self.position - self.target
            there = ((gap**2).sum(axis=0) < (_REACHED + self._unrest()) ** 2) & self._slow()
            aligned = orders.by_stick | (np.abs(self.target_yaw - self.yaw) < _ALIGNED / 2.0)
            done = np.where(orders.moving, there & aligned & (self.turn != _FIRST), done)
        if orders.any_take_off:
            high = self.position[2] <= 0.05 - TAKE_OFF_HEIGHT
            done = np.where(orders.take_off, high & self._slow(), done)
        if orders.any_dropping:
            done = np.where(orders.dropping, self.position[2] >= 0.0, done)
        result: list[bool] = done.tolist()
        return result

    def poses(self) -> list[Pose]:
        """Return every drone's pose, in the sequence of the airframes."""
        if self._poses is None or self.stale:
            columns = np.concatenate((self.position, self.tilt, [self.yaw], self.velocity))
            columns[2] = 0.0 - columns[2]  # not -0.0 for a drone on the ground
            self._poses = [
                Pose(n, e, up, roll, pitch, wrap_pi(yaw), vn, ve, vd)
                for n, e, up, roll, pitch, yaw, vn, ve, vd in columns.T.tolist()
            ]
        return self._poses

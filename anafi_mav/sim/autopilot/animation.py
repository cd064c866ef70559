"""Feature animation: figures that the drone flies by itself to make a picture or a film.

Changes of the available figures are reported. A figure is available in the air, with a fix and a calibrated
magnetometer, while neither a flight plan nor a return is active; the figures around a target also need a target.
While one runs all piloting commands are ignored (animation.xml); that a landing, a return, a flight plan and the loss
of the link end it is assumed. The start of a figure that is not available is ignored, as for Parrot's other guided
flights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import animation
from anafi_mav.arsdk.messages.animation import AnimationState, Indicator, Mode, Type
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.sim.autopilot.animation_paths import NEEDS_TARGET, Figure, Leg, Stage, Target, figure
from anafi_mav.sim.payload.camera_operator import CameraOperator
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.model import AircraftModel
from anafi_mav.sim.world.motion import Pose
from anafi_mav.units import clip, wrap_pi

STALL = 4.0
"""s without progress after which a leg counts as out of reach."""

LOOK_LIMIT = 4.0
"""s that the camera is waited for before a picture is taken all the same."""

PERCENT_STEP = 5
"""Percent between two reports of how far it is."""

_MOVED = 0.05
_TURNED = 0.02
"""m and rad: less than this is no progress."""
_LOOKS = 1.0
"""deg: the camera looks where it should."""

_ALONE = frozenset(Type) - NEEDS_TARGET - {Type.NONE, Type.FLIP}
"""No ANAFI makes a flip."""


class _Begun(NamedTuple):
    """State of the drone at the start of a leg."""

    pose: Pose
    heading: float
    tilt: float
    zoom: float


class Animations:
    """One drone's. `emit` takes the events, `body` does the flying."""

    def __init__(
        self, model: AircraftModel, body: Airframe, operator: CameraOperator, emit: Callable[[Message], None]
    ) -> None:
        types = set(_ALONE) if model.modern else _ALONE - {Type.SUPER_WIDE_PHOTO_PANORAMA}  # animation.xml: 091a
        self._model = model
        self._alone = frozenset(types)
        self._body = body
        self._operator = operator
        self._emit = emit
        self._figure: Figure | None = None
        self._state = AnimationState.IDLE
        self._index = 0
        self._begun: _Begun | None = None
        """None: the present leg has not begun."""
        self._zoom = 1.0
        self._waits: float | None = None
        """Until when the camera is waited for at the end of the present leg."""
        self._progress: tuple[float, Pose] | None = None
        self._percent = 0
        self._available: frozenset[Type] = frozenset()
        self._missing = _bits(Indicator.DRONE_FLYING)
        self._aimed = False
        """There is something to fly around."""
        self._sensed: tuple[bool, ...] = ()
        """Arguments of the last call of `sensors`."""

    @property
    def running(self) -> bool:
        """It has the drone."""
        return self._figure is not None

    # -- commands

    def start(self, command: Message, pose: Pose, target: Target | None, fastest: float) -> bool:
        """Begin a figure, in place of one that runs; False when it is ignored."""
        stage = Stage(pose, self._body.heading, self._operator.tilt, target, fastest, self._model.zoom_max)
        wanted = figure(command, stage)
        if wanted is None or wanted.type not in self._available:
            return False
        self.end()
        self._figure, self._index, self._begun, self._percent, self._zoom = wanted, 0, None, 0, 1.0
        self._set(AnimationState.RUNNING)
        self._emit(animation.State(wanted.type, 0))
        if wanted.panorama:
            self._operator.panorama_begin(wanted.panorama, sum(leg.photo for leg in wanted.legs))
        return True

    def cancel(self) -> None:
        """animation.cancel: stop, then say that nothing runs; that it does not if nothing does."""
        if self._figure is None:
            self._emit(animation.State(Type.NONE, 0))
        elif self._state is AnimationState.RUNNING:
            self._set(AnimationState.CANCELING)
            self._body.hover()

    def end(self) -> None:
        """Something else takes the drone, or it is over."""
        ended = self._figure
        if ended is None:
            return
        if ended.panorama:
            self._operator.panorama_end()
        self._set(AnimationState.IDLE)
        self._figure = None
        self._emit(animation.State(Type.NONE, 0))

    def _set(self, state: AnimationState) -> None:
        assert self._figure is not None, "only a figure has a state"
        self._state = state
        self._emit(_STATES[self._figure.type](state, *self._figure.values.values()))

    # -- time

    def tick(self, time: float, pose: Pose, arrived: bool, still: bool) -> None:
        """Go on; called while it has the drone."""
        figure = self._figure
        assert figure is not None, "nothing runs"
        if self._state is AnimationState.CANCELING:
            if still:
                self.end()
            return
        leg = figure.legs[self._index]
        if self._begun is None:
            self._begin(leg, pose)
            return
        share = self._share(leg, self._begun, pose)
        self._look(leg, self._begun, 1.0 if leg.photo or arrived else share)
        if not self._over(leg, pose, time, arrived):
            self._tell(figure, share)
            return
        if leg.photo:
            self._operator.panorama_shot()
        self._begun = None
        self._index += 1
        if self._index == len(figure.legs):
            self._body.hover()
            self.end()

    def _begin(self, leg: Leg, pose: Pose) -> None:
        self._begun = _Begun(pose, self._body.heading, self._operator.tilt, self._zoom)
        self._progress = self._waits = None
        self._body.move(
            leg.north, leg.east, leg.up, yaw=leg.yaw, speed=leg.speed, climb=leg.climb, yaw_rate=leg.yaw_rate
        )

    def _look(self, leg: Leg, begun: _Begun, share: float) -> None:
        """Turn and zoom the camera as far as the drone has come."""
        if leg.tilt is not None:
            self._operator.aim(begun.tilt + (leg.tilt - begun.tilt) * share)
        if leg.zoom is not None:
            self._zoom = begun.zoom + (leg.zoom - begun.zoom) * share
            self._operator.zoom(self._zoom)

    def _over(self, leg: Leg, pose: Pose, time: float, arrived: bool) -> bool:
        if leg.radius and _way(leg, pose) <= leg.radius:
            return True
        if not arrived and not self._stalled(pose, time):
            return False
        if self._waits is None:
            self._waits = time + LOOK_LIMIT
        low, high = self._model.gimbals[0].pitch
        looks = leg.tilt is None or abs(clip(leg.tilt, low, high) - self._operator.tilt) < _LOOKS
        return looks or time >= self._waits

    def _stalled(self, pose: Pose, time: float) -> bool:
        if self._progress is None:
            self._progress = (time, pose)
        since, before = self._progress
        if _way(before, pose) > _MOVED or abs(wrap_pi(pose.yaw - before.yaw)) > _TURNED:
            self._progress = (time, pose)
        return time - since > STALL

    def _share(self, leg: Leg, begun: _Begun, pose: Pose) -> float:
        """How much of a leg is flown, or turned where it goes nowhere, 0 to 1."""
        whole, left = _way(leg, begun.pose), _way(leg, pose)
        if whole < _MOVED:
            whole, left = abs(leg.yaw - begun.heading), abs(leg.yaw - self._body.heading)
        return clip(1.0 - left / whole, 0.0, 1.0) if whole > _TURNED else 1.0

    def _tell(self, figure: Figure, share: float) -> None:
        percent = int(100.0 * (self._index + share) / len(figure.legs))
        if percent >= self._percent + PERCENT_STEP:
            self._percent = percent
            self._emit(animation.State(figure.type, min(percent, 100)))

    # -- what can be flown

    def sensors(self, fix: bool, magneto: bool, guided: bool, free: bool, target: bool) -> None:
        """Update the conditions that figures need, and report the figures available if they changed.

        `guided`: the drone is in the air and takes commands; `free`: no other flight task is active.
        """
        sensed = (fix, magneto, guided, free, target)
        if sensed == self._sensed:
            return
        self._sensed = sensed
        needs = {
            Indicator.DRONE_GPS: fix,
            Indicator.DRONE_MAGNETO: magneto,
            Indicator.DRONE_FLYING: guided,
            Indicator.DRONE_STATE: free,
        }
        missing = _bits(*(need for need, met in needs.items() if not met))
        changed = (missing, target) != (self._missing, self._aimed)
        self._missing, self._aimed = missing, target
        if changed and self._model.modern:
            for message in self._infos():
                self._emit(message)
        available = frozenset() if missing else self._alone | (NEEDS_TARGET if target else frozenset())
        if available != self._available:
            self._available = available
            self._emit(self._availability())

    def _availability(self) -> Message:
        return animation.Availability(_bits(*self._available))

    def _infos(self) -> list[Message]:
        types = sorted(self._alone | NEEDS_TARGET)
        aim = 0 if self._aimed else _bits(Indicator.TARGET_POSITION_ACCURACY)
        return [
            animation.Info(type, self._missing | (aim if type in NEEDS_TARGET else 0), _flags(index, len(types)))
            for index, type in enumerate(types)
        ]

    def states_report(self) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        type = Type.NONE if self._figure is None else self._figure.type
        report: list[Message] = [self._availability(), animation.State(type, self._percent)]
        if self._figure is not None:
            report.append(_STATES[type](self._state, *self._figure.values.values()))
        if not self._model.modern:
            return report
        around = self._alone | NEEDS_TARGET
        modes = {Mode.MANUAL: self._alone, Mode.FOLLOW_ME: around, Mode.POI: around, Mode.LOOK_AT: around}
        capabilities = [
            animation.Capabilities(mode, _bits(*types), _flags(index, len(modes)))
            for index, (mode, types) in enumerate(modes.items())
        ]
        return [*report, *capabilities, *self._infos()]


def _bits(*values: int) -> int:
    return sum(1 << value for value in values)


def _flags(index: int, count: int) -> int:
    """Of the entry `index` of a list of `count`."""
    first = 1 << ListFlags.FIRST if index == 0 else 0
    return first | (1 << ListFlags.LAST if index == count - 1 else 0)


def _way(to: Pose | Leg, pose: Pose) -> float:
    return math.dist((pose.north, pose.east, pose.up), (to.north, to.east, to.up))


_STATES: dict[Type, Callable[..., Message]] = {
    Type.HORIZONTAL_PANORAMA: animation.HorizontalPanoramaState,
    Type.DRONIE: animation.DronieState,
    Type.HORIZONTAL_REVEAL: animation.HorizontalRevealState,
    Type.VERTICAL_REVEAL: animation.VerticalRevealState,
    Type.SPIRAL: animation.SpiralState,
    Type.PARABOLA: animation.ParabolaState,
    Type.CANDLE: animation.CandleState,
    Type.DOLLY_SLIDE: animation.DollySlideState,
    Type.VERTIGO: animation.VertigoState,
    Type.TWIST_UP: animation.TwistUpState,
    Type.POSITION_TWIST_UP: animation.PositionTwistUpState,
    Type.HORIZONTAL_180_PHOTO_PANORAMA: animation.Horizontal180PhotoPanoramaState,
    Type.VERTICAL_180_PHOTO_PANORAMA: animation.Vertical180PhotoPanoramaState,
    Type.SPHERICAL_PHOTO_PANORAMA: animation.SphericalPhotoPanoramaState,
    Type.SUPER_WIDE_PHOTO_PANORAMA: animation.SuperWidePhotoPanoramaState,
}
"""State message of a figure; its values have the order of the command's."""

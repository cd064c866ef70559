"""Element animations: automatic flights that make a film or a panorama of photos.

A value that is left out is the drone's own default. Angles are rad (clockwise seen from above is positive), distances
m, speeds m/s and rad/s (animation.xml). While an animation runs the drone ignores all piloting commands; a setpoint
and `piloting.hover` cancel it first. No ANAFI flips.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message, OpenEnum
from anafi_mav.arsdk.messages import animation
from anafi_mav.arsdk.messages.animation import AnimationState, Indicator, Mode, PlayMode, Type, VertigoFinishAction
from anafi_mav.drone.element import Reducer, members, with_item
from anafi_mav.drone.expectation import ANSWER_TIMEOUT
from anafi_mav.drone.sent_commands import SentCommand, Slot
from anafi_mav.drone.settings import Commanding, number
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, NotSupported

FIGURE_TIMEOUT = 60.0
"""s between two reports of a running animation.

The drone reports its progress every few percent.
"""

_FIGURES: Mapping[Type, type[Message]] = {
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


class AnimationsState(msgspec.Struct, frozen=True):
    """The animation that the drone flies, and those it could begin."""

    available: frozenset[Type] | None = None
    """Animations that can start now; empty on the ground."""
    running: Type | None = None
    """The animation under way; NONE: none is flown."""
    percent: int | None = None
    """Progress, %."""
    phase: AnimationState | None = None
    """Of the current or most recent animation."""
    canceled: bool = False
    """The current or most recent animation was not completed."""
    values: Message | None = None
    """Last event of the current or most recent animation; holds the values in effect."""
    modes: Mapping[Mode, frozenset[Type]] = {}
    """Animations of this drone by piloting mode. Ai only."""
    missing: Mapping[Type, frozenset[Indicator]] = {}
    """Requirements that each animation lacks; empty: available. Ai only."""

    @property
    def is_running(self) -> bool:
        """True while an animation is flown, from the first of the two events that report its begin."""
        return self.running not in (None, Type.NONE) or self.phase == AnimationState.RUNNING

    @property
    def is_panorama(self) -> bool:
        """True while a photo panorama is flown."""
        return self.running in _PANORAMAS


def _figure(state: AnimationsState, m: Any) -> AnimationsState:
    canceled = m.state == AnimationState.CANCELING or (state.canceled and m.state != AnimationState.RUNNING)
    return replace(state, phase=m.state, canceled=canceled, values=m)


class Animations(Commanding[AnimationsState]):
    """Figures of Parrot that the drone flies by itself.

    None for a number leaves it to the drone.

    Speeds are in m/s, turn speeds in rad/s, distances in m, angles in rad (animation.xml). Every figure returns when
    the drone has begun it; `finished` waits for its end.
    """

    NOTHING = AnimationsState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        animation.Availability: lambda state, m: replace(state, available=members(m.values, Type)),
        animation.State: lambda state, m: replace(state, running=m.type, percent=m.percent),
        animation.Capabilities: lambda state, m: replace(
            state, modes=with_item(state.modes, m.mode, members(m.type, Type), m.list_flags)
        ),
        animation.Info: lambda state, m: replace(
            state, missing=with_item(state.missing, m.type, members(m.missing_inputs, Indicator), m.list_flags)
        ),
        **dict.fromkeys(_FIGURES.values(), _figure),
    }

    # -- figures

    async def horizontal_panorama(self, angle: float | None = None, speed: float | None = None) -> None:
        """Turn on the spot.

        As all figures: raises `CommandRejected` with what is missing, `NotSupported` where the model has no such
        figure. A start that times out or is cancelled is withdrawn.
        """
        await self._start(
            Type.HORIZONTAL_PANORAMA,
            animation.StartHorizontalPanorama,
            animation.HorizontalPanoramaConfigParam,
            (angle, speed),
        )

    async def dronie(
        self, speed: float | None = None, distance: float | None = None, play: PlayMode | None = None
    ) -> None:
        """Fly away backwards and up."""
        await self._start(Type.DRONIE, animation.StartDronie, animation.DronieConfigParam, (speed, distance, play))

    async def horizontal_reveal(
        self, speed: float | None = None, distance: float | None = None, play: PlayMode | None = None
    ) -> None:
        """Look down, then fly forward and look up to the horizon."""
        await self._start(
            Type.HORIZONTAL_REVEAL,
            animation.StartHorizontalReveal,
            animation.HorizontalRevealConfigParam,
            (speed, distance, play),
        )

    async def vertical_reveal(
        self,
        speed: float | None = None,
        vertical_distance: float | None = None,
        angle: float | None = None,
        turn_speed: float | None = None,
        play: PlayMode | None = None,
    ) -> None:
        """Look down, then rise and look up to the horizon, then turn."""
        await self._start(
            Type.VERTICAL_REVEAL,
            animation.StartVerticalReveal,
            animation.VerticalRevealConfigParam,
            (speed, vertical_distance, angle, turn_speed, play),
        )

    async def spiral(
        self,
        speed: float | None = None,
        radius_variation: float | None = None,
        vertical_distance: float | None = None,
        turns: float | None = None,
        play: PlayMode | None = None,
    ) -> None:
        """Circle around the target.

        `radius_variation` 2 ends twice as far away, -2 half as far, 1 as far.
        """
        await self._start(
            Type.SPIRAL,
            animation.StartSpiral,
            animation.SpiralConfigParam,
            (speed, radius_variation, vertical_distance, turns, play),
        )

    async def parabola(
        self, speed: float | None = None, vertical_distance: float | None = None, play: PlayMode | None = None
    ) -> None:
        """Fly over the target to its other side."""
        await self._start(
            Type.PARABOLA,
            animation.StartParabola,
            animation.ParabolaConfigParam,
            (speed, vertical_distance, play),
        )

    async def candle(
        self, speed: float | None = None, vertical_distance: float | None = None, play: PlayMode | None = None
    ) -> None:
        """Fly towards the target, then up."""
        await self._start(
            Type.CANDLE, animation.StartCandle, animation.CandleConfigParam, (speed, vertical_distance, play)
        )

    async def dolly_slide(
        self,
        speed: float | None = None,
        angle: float | None = None,
        horizontal_distance: float | None = None,
        play: PlayMode | None = None,
    ) -> None:
        """Fly straight past the target; `angle` is the one between drone, target and destination."""
        await self._start(
            Type.DOLLY_SLIDE,
            animation.StartDollySlide,
            animation.DollySlideConfigParam,
            (speed, angle, horizontal_distance, play),
        )

    async def vertigo(
        self,
        duration: float | None = None,
        max_zoom_level: float | None = None,
        finish: VertigoFinishAction | None = None,
        play: PlayMode | None = None,
    ) -> None:
        """Fly away from the subject while zooming in on it; `duration` in s."""
        await self._start(
            Type.VERTIGO,
            animation.StartVertigo,
            animation.VertigoConfigParam,
            (duration, max_zoom_level, finish, play),
        )

    async def twist_up(
        self,
        speed: float | None = None,
        vertical_distance: float | None = None,
        angle: float | None = None,
        turn_speed: float | None = None,
        play: PlayMode | None = None,
        *,
        above_target: bool = False,
    ) -> None:
        """Rise while turning; with `above_target` above the target."""
        await self._start(
            Type.POSITION_TWIST_UP if above_target else Type.TWIST_UP,
            animation.StartPositionTwistUp if above_target else animation.StartTwistUp,
            animation.TwistUpConfigParam,
            (speed, vertical_distance, angle, turn_speed, play),
        )

    async def photo_panorama(self, type: Type = Type.SPHERICAL_PHOTO_PANORAMA) -> None:
        """Take a photo panorama, one media of many pictures.

        It is horizontal, vertical, spherical or super wide.
        """
        command = _PANORAMAS.get(type)
        if command is None:
            raise NotSupported(f"a photo panorama {spoken(type)}")
        await self._start(type, command, None, ())

    # -- their end

    async def finished(self, timeout: float = FIGURE_TIMEOUT) -> bool:
        """Wait until no animation runs; return True if the last one was completed.

        False when it was cancelled. Raises `CommandTimeout` after `timeout` s without progress.
        """
        self._commander.require_feature(self.state.running, "animations")
        if self.state.running == Type.NONE:
            return not self.state.canceled
        what = "the end of an animation"

        def judge(message: Any) -> bool | AnafiMavError | None:
            if message.type == Type.NONE:
                return True
            answer.expire_after(timeout, what)
            return None

        answer = self._commander.expect((animation.State,), judge)
        answer.expire_after(timeout, what)
        await answer.wait()
        return not self.state.canceled

    async def cancel(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """End the animation; returns when none is flown, at once when none is running or starting."""
        self._commander.require_feature(self.state.running, "animations")
        self._commander.abort_pending("stopped", Slot.ANIMATION)
        await self._commander.stops_delivered(animation.Cancel.NAME, timeout)
        if not self.state.is_running:
            return
        await self._commander.confirm(
            animation.Cancel(),
            (animation.State,),
            lambda m: True if m.type == Type.NONE else None,
            timeout,
            stops=True,
        )

    async def _start(
        self,
        type: Type,
        command: type[Message],
        params: type[OpenEnum] | None,
        values: tuple[float | OpenEnum | None, ...],
    ) -> None:
        if params is None:
            order = command()
        else:
            provided = sum(1 << param for param, value in zip(params, values, strict=True) if value is not None)
            order = command(provided, *(_argument(value, params(bit)) for bit, value in enumerate(values)))
        state = self.state
        self._commander.require_feature(state.running, "animations")
        known = frozenset().union(*state.modes.values(), state.missing)
        if known and type not in known:
            raise NotSupported(f"animation {spoken(type)}")
        if type not in (state.available or ()):
            raise CommandRejected(self._why(type))
        try:
            await self._commander.begin(
                SentCommand(Slot.ANIMATION, undo=animation.Cancel()),
                order,
                (_FIGURES[type],),
                lambda m: True if m.state == AnimationState.RUNNING else None,
                ANSWER_TIMEOUT,
            )
        except CommandTimeout:
            if type not in (self.state.available or ()):
                raise CommandRejected(self._why(type)) from None
            raise

    def _why(self, type: Type) -> str:
        lacks = ", ".join(spoken(one) for one in sorted(self.state.missing.get(type, ())))
        return f"{spoken(type)} is not available now" + (f": it lacks {lacks}" if lacks else "")


_PANORAMAS: Mapping[Type, type[Message]] = {
    Type.HORIZONTAL_180_PHOTO_PANORAMA: animation.StartHorizontal180PhotoPanorama,
    Type.VERTICAL_180_PHOTO_PANORAMA: animation.StartVertical180PhotoPanorama,
    Type.SPHERICAL_PHOTO_PANORAMA: animation.StartSphericalPhotoPanorama,
    Type.SUPER_WIDE_PHOTO_PANORAMA: animation.StartSuperWidePhotoPanorama,
}


def _argument(value: float | OpenEnum | None, param: OpenEnum) -> float | OpenEnum:
    """Return the argument for the command; zero for a value that is left out."""
    if param.name == "PLAY_MODE":
        return PlayMode.NORMAL if value is None else value
    if param.name == "FINISH_ACTION":
        return VertigoFinishAction.NONE if value is None else value
    return 0.0 if value is None else number(value, spoken(param))

"""Element follow me: the drone follows a target, or looks at it.

The controller reports the motion of the target.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import controller_info, follow_me
from anafi_mav.arsdk.messages.follow_me import Behavior, Input, Mode
from anafi_mav.drone.element import Position, Reducer, members, position, with_item
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, loop_time
from anafi_mav.drone.sent_commands import SentCommand, Slot
from anafi_mav.drone.settings import Commanding, number, same_as
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.errors import (
    AnafiMavError,
    CommandRejected,
    CommandTimeout,
    LocalProtocolError,
    NotSupported,
)
from anafi_mav.units import LARGEST


class Trajectory(msgspec.Struct, frozen=True):
    """Place and velocity (m/s) of the target, as the drone estimates them."""

    position: Position
    """Altitude above mean sea level."""
    north: float
    east: float
    down: float


class FollowMeState(msgspec.Struct, frozen=True):
    """The target and how the drone follows it."""

    mode: Mode | None = None
    """NONE: no target is followed."""
    behavior: Behavior | None = None
    missing: Mapping[Mode, frozenset[Input]] = {}
    """By mode, the requirements that it lacks."""
    improvements: Mapping[Mode, frozenset[Input]] = {}
    """By mode, what would improve it."""
    target_is_controller: bool | None = None
    target: Trajectory | None = None


def _mode_info(state: FollowMeState, m: follow_me.ModeInfo) -> FollowMeState:
    return replace(
        state,
        missing=with_item(state.missing, m.mode, _lacking(m.missing_requirements), 0),
        improvements=with_item(state.improvements, m.mode, _lacking(m.improvements), 0),
    )


def _lacking(bits: int) -> frozenset[Input]:
    """followme.xml mode_info: "Bit is 0 if the input is missing, 1 if the input is ok"."""
    return members(~bits, Input)


def _trajectory(state: FollowMeState, m: follow_me.TargetTrajectory) -> FollowMeState:
    place = position(m.latitude, m.longitude, m.altitude)
    if place is None or not abs(m.north_speed) + abs(m.east_speed) + abs(m.down_speed) <= LARGEST:
        return replace(state, target=None)
    return replace(state, target=Trajectory(place, m.north_speed, m.east_speed, m.down_speed))


class FollowMe(Commanding[FollowMeState]):
    """Parrot's own follow me. The drone finds the target in the picture, or is sent its place."""

    NOTHING = FollowMeState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        follow_me.State: lambda state, m: replace(state, mode=m.mode, behavior=m.behavior),
        follow_me.ModeInfo: _mode_info,
        follow_me.TargetIsController: lambda state, m: replace(state, target_is_controller=m.state != 0),
        follow_me.TargetTrajectory: _trajectory,
    }

    async def start(self, mode: Mode, timeout: float = ANSWER_TIMEOUT) -> None:
        """Follow the target or look at it; returns when the drone does.

        Raises `CommandRejected` with what is missing.

        A start that times out or is cancelled is withdrawn: a drone that lacks something would begin once it has it.
        """
        if mode == Mode.NONE:
            raise LocalProtocolError("NONE is no way to follow")
        self._commander.require_feature(self.state.mode, "follow me")
        if mode not in self.state.missing:
            raise NotSupported(f"follow me: {spoken(mode)}")

        def judge(message: Any) -> bool | AnafiMavError | None:
            if message.mode != mode:
                return None
            return CommandRejected(self._why(mode)) if message.behavior == Behavior.IDLE else True

        sent = SentCommand(Slot.FOLLOW, undo=follow_me.Stop(), undo_refused=True)
        try:
            await self._commander.begin(sent, follow_me.Start(mode), (follow_me.State,), judge, timeout)
        except CommandTimeout:
            if self.state.missing.get(mode):
                raise CommandRejected(self._why(mode)) from None
            raise

    def _why(self, mode: Mode) -> str:
        lacks = ", ".join(spoken(one) for one in sorted(self.state.missing.get(mode, ())))
        return f"cannot follow: it lacks {lacks}" if lacks else "cannot follow"

    async def stop(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """End following; returns when the drone has stopped.

        Returns at once when the drone is neither following nor about to.
        """
        self._commander.require_feature(self.state.mode, "follow me")
        self._commander.abort_pending("stopped", Slot.FOLLOW)
        await self._commander.stops_delivered(follow_me.Stop.NAME, timeout)
        if self.state.mode == Mode.NONE:
            return
        await self._commander.confirm(
            follow_me.Stop(), (follow_me.State,), lambda m: True if m.mode == Mode.NONE else None, timeout
        )

    def tell_target(
        self, place: Position, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0), accuracy: float = 1.0
    ) -> None:
        """Send the place of the controller.

        Altitude above mean sea level; velocity north, east, down in m/s; `accuracy` in m. It is the target while
        `target_is_controller`. Send it once a second at least: it is not acknowledged.
        """
        self._commander.require_feature(self.state.mode, "follow me")
        north, east, down = (number(speed, "speed of the target") for speed in velocity)
        self._commander.send(
            controller_info.Gps(
                place.latitude,
                place.longitude,
                number(place.altitude, "altitude of the target"),
                number(accuracy, "accuracy of the target"),
                accuracy,
                north,
                east,
                down,
                loop_time() * 1000.0,
            )
        )

    async def set_target_is_controller(self, on: bool) -> bool:
        """Choose the target: the controller, or what the picture's `target_image_detection` reports."""
        self._commander.require_feature(self.state.target_is_controller, "follow me")
        return await self._change(
            follow_me.SetTargetIsController(int(on)),
            follow_me.TargetIsController,
            lambda m: bool(m.state),
            same_as(on),
        )

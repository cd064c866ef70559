"""Movement of the gimbal: the target in force, its end, and repetitions of lost targets.

The drone acknowledges no target, and turns an axis with a rate until its next target. So a command is confirmed by the
reported attitude, the angles of a message are sent several times, a rate in force with every tick, and a stop until the
gimbal stands. An axis that may turn by an earlier rate, and that a newer target does not aim, is stopped.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Mapping
from typing import TypeAlias, TypedDict

from anafi_mav import texts
from anafi_mav.drone import Aim, GimbalAttitude, GimbalState
from anafi_mav.drone.events import Axis, FrameOfReference, GimbalCalibrationState
from anafi_mav.drone.payload.gimbal import main_frames
from anafi_mav.drone.values import Values
from anafi_mav.errors import AnafiMavError, LinkLost
from anafi_mav.services.gimbal import targets
from anafi_mav.services.gimbal.control import ClientId, Heartbeats
from anafi_mav.services.gimbal.rates import MESSAGE_SILENCE, GimbalRates
from anafi_mav.services.gimbal.roi import RegionOfInterest
from anafi_mav.services.gimbal.targets import GimbalTarget
from anafi_mav.services.service import Host
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.refusal import Refused, Unsupported, reason_of
from anafi_mav.vehicle.base.severity import Severity

STOPS = 4
"""Zero rates sent after a stop is confirmed. Targets are not acknowledged by the drone, and a gimbal that turns slowly
looks as if it stood."""

STANDS = 0.1
"""deg between two reported attitudes of an axis that stands."""

REFERENCE_LEFT = 1.0
"""deg from the reference orientation at which the gimbal has left it."""

REPEATS = 3
"""Times that the angles of a message are sent again: the drone may have lost the first."""

REPEAT_EVERY = 0.3
"""s between them; not while further messages arrive."""


class _ByAxis(TypedDict):
    """Arguments of the gimbal's verbs."""

    yaw: Aim | None
    pitch: Aim | None
    roll: Aim | None


def _by_axis(aims: Mapping[Axis, Aim]) -> _ByAxis:
    return {"yaw": aims.get(Axis.YAW), "pitch": aims.get(Axis.PITCH), "roll": aims.get(Axis.ROLL)}


Drop: TypeAlias = "Callable[[OperatorText], None]"
"""Receives the reason for which the target of a message is not carried out."""


class GimbalMotion:
    """The movement of one vehicle's gimbal."""

    def __init__(self, host: Host, heartbeats: Heartbeats, roi: RegionOfInterest) -> None:
        self.is_neutral = False
        """The last target was the reference orientation, and the gimbal has not left it since."""
        self._reference: GimbalAttitude | None = None
        """Attitude that the drone reported in the reference orientation; None before it has reached it."""
        self._neutral_at = -math.inf
        """When the last message that requests the reference orientation arrived."""
        self._host = host
        self._rates = GimbalRates(heartbeats)
        self._roi = roi
        self._client: ClientId | None = None
        """Sender of the newest target; None: the drone aims the gimbal."""
        self._command: asyncio.Task[None] | None = None
        """The command that has not been answered yet, or what frees the gimbal from a region for a message."""
        self._waiting: tuple[ClientId, GimbalTarget, Drop] | None = None
        """The newest target of a message, while the gimbal is freed for it."""
        self._halt: asyncio.Task[None] | None = None
        """Stops the gimbal or resets its orientation, for a message or by itself."""
        self._is_stopping = False
        """A stop of all axes is not confirmed yet."""
        self._zeros = 0
        """Zero rates that are still to be sent."""
        self._still: frozenset[Axis] = frozenset()
        """Axes that an earlier rate may still turn, and the target in force does not aim."""
        self._still_zeros = 0
        """Zero rates of these that are still to be sent."""
        self._seen: GimbalAttitude | None = None
        """While some axes are to stand, the attitude reported last."""
        self._frames = b""
        """The frames of reference reported last, as on the wire."""
        self._repeat: tuple[Mapping[Axis, Aim], int, float] | None = None
        """Angles of a message, how often they are to be sent again, and when next."""
        self._was_turning = False
        """The gimbal may have turned when the link was lost, and then turns still."""

    @property
    def turner(self) -> ClientId | None:
        """Sender of the rate in force; None without one."""
        return self._rates.client

    @property
    def is_calibrating(self) -> bool:
        """True while the drone calibrates the gimbal and ignores targets."""
        return self._gimbal.calibration == GimbalCalibrationState.IN_PROGRESS

    @property
    def is_active(self) -> bool:
        """True while `tick` may have something to send or to end."""
        return self._rates.turns or self._zeros > 0 or bool(self._still) or self._repeat is not None

    @property
    def _gimbal(self) -> GimbalState:
        return self._host.drone.gimbal.main

    # Targets.

    def require_ready(self) -> frozenset[Axis]:
        """Return the gimbal's axes. Raises `Refused` when it has none, or the drone calibrates it."""
        if self._gimbal.axes is None:
            raise Unsupported(texts.GIMBAL, texts.NO_GIMBAL)
        if self.is_calibrating:
            raise Refused(texts.GIMBAL, texts.GIMBAL_CALIBRATES)
        return self._gimbal.axes

    async def move(self, client: ClientId, target: GimbalTarget) -> None:
        """Carry out the target of a command; return when the drone turns the gimbal.

        Raises `Refused` when it has none, or calibrates it.
        """
        gimbal = self._host.drone.gimbal
        target = target.on(self.require_ready())
        if target.is_empty:
            return  # yaw alone, of a gimbal without this axis
        self._begin(target)
        self._client = client
        task = self._command = asyncio.current_task()
        try:
            await self._roi.free_gimbal()
            self.is_neutral, self._reference = target.neutral, None
            self._turn(self._zero_rates())
            if target.rates:
                self._rates.take(client, target.rates, self._host.clock.monotonic(), by_message=False)
            else:
                self._rates.replace_by_angles()
            if target.neutral:
                self._reference = await gimbal.reset_orientation()
            elif target.is_zero_rate:
                self._is_stopping = True
                await gimbal.stop()
                self._is_stopping = False
            else:
                if target.angles:
                    await gimbal.steer(**_by_axis(target.angles))
                if self._rates.turns:
                    await gimbal.sweep(**_by_axis(self._rates.rates))
        except BaseException:
            if self._command is task:
                self.is_neutral = False
            if self._command is task and self._rates.end():  # nothing newer, and it has not been confirmed
                self._command = None
                self._stop_turning()
            raise
        finally:
            if self._command is task:
                self._command = None
                self._zeros = STOPS if target.is_zero_rate else 0

    def stream(self, client: ClientId, target: GimbalTarget, drop: Drop) -> None:
        """Carry out the target of a message, without waiting.

        `drop` receives the reason when that fails later. Raises `Unsupported` when the gimbal has none of its axes.
        """
        named, target = target, target.on(self._gimbal.axes or frozenset())
        if target.is_empty:
            if named.is_zero_rate:
                return
            raise Unsupported(texts.GIMBAL, texts.NO_GIMBAL if self._gimbal.axes is None else texts.NO_SUCH_AXIS)
        self._client = client
        if self._roi.holds_gimbal:
            is_freeing = self._waiting is not None
            self._waiting = client, target, drop
            if not is_freeing:
                if self._command is not None:
                    self._command.cancel()  # a newer target replaces it
                self._command = self._host.spawn(self._free())
            return
        self._roi.free_prepared()
        self._apply(client, target, drop)

    def _apply(self, client: ClientId, target: GimbalTarget, drop: Drop) -> None:
        now = self._host.clock.monotonic()
        if target.neutral:
            is_repeated = self.is_neutral and now - self._neutral_at < MESSAGE_SILENCE
            self._neutral_at = now
            if not is_repeated:
                self._begin()
                self._rates.replace_by_angles()
                self.is_neutral, self._reference = True, None
                self._halt = self._host.spawn(self._reset(drop))
            return
        self.is_neutral = False
        if target.is_zero_rate:
            is_stopping = self._is_stopping or self._zeros > 0
            self._rates.take(client, target.rates, now, by_message=True)
            if not is_stopping:
                self._stop_turning()
            return
        before, still = self._rates.rates, self._still
        self._begin(target)
        if not self._still <= still:
            self._turn(self._zero_rates())
        if target.rates:
            self._rates.take(client, target.rates, now, by_message=True)
        else:
            self._rates.replace_by_angles()
        if target.angles:
            self._host.drone.gimbal.aim(**_by_axis(target.angles))
            self._repeat = (target.angles, REPEATS, now + REPEAT_EVERY)
        if self._rates.turns and self._rates.rates != before:
            self._turn(self._rates.rates)

    async def _free(self) -> None:
        """Free the gimbal from a region; then carry out the newest target that waited for it."""
        task = asyncio.current_task()
        try:
            await self._roi.free_gimbal()
            if self._command is task and self._waiting is not None:
                waiting, self._command, self._waiting = self._waiting, None, None
                self._apply(*waiting)
        except AnafiMavError as error:
            if self._waiting is not None:
                self._waiting[2](reason_of(error))
        finally:
            if self._command is task:
                self._command = self._waiting = None

    async def _reset(self, drop: Drop) -> None:
        task = asyncio.current_task()
        try:
            self._reference = await self._host.drone.gimbal.reset_orientation()
        except AnafiMavError as error:
            self.is_neutral = False
            drop(reason_of(error))
        finally:
            if self._halt is task:
                self._halt = None

    def _begin(self, target: GimbalTarget | None = None) -> None:
        """End what moves the gimbal: a newer target replaces it.

        Zero rates are sent for axes that may turn and that the new target does not aim. Without one the drone aims the
        gimbal, or all axes are stopped.
        """
        turned = set(self._still) | self._rates.rates.keys()
        if self._is_stopping:
            turned |= self._gimbal.axes or frozenset()
        if target is None or target.neutral:
            still: frozenset[Axis] = frozenset()
        else:
            still = frozenset((turned - target.angles.keys() - target.rates.keys()) | target.held)
        if not still <= self._still:
            self._still_zeros = STOPS
        self._still = still
        self._seen = self._gimbal.attitude if still else None
        if self._command is not None and self._command is not asyncio.current_task():
            self._command.cancel()
            self._command = self._waiting = None
        if self._halt is not None:
            self._halt.cancel()
            self._halt = None
        self._zeros, self._repeat, self._is_stopping = 0, None, False

    def _turn(self, rates: Mapping[Axis, Aim]) -> None:
        if rates:
            self._host.drone.gimbal.turn(**_by_axis(rates))

    def _zero_rates(self) -> Mapping[Axis, Aim]:
        """Return zero rates of the axes that are to stand, in the frames that they hold."""
        attitude = self._gimbal.attitude
        frames = {} if attitude is None else attitude.frames
        return {axis: Aim(0.0, frames.get(axis, FrameOfReference.RELATIVE)) for axis in self._still}

    # Ends.

    def end_rates(self) -> None:
        """End a rate in force, and stop the gimbal."""
        if self._rates.end():
            self._stop_turning()

    def end_unless(self, allows: Callable[[ClientId], bool]) -> None:
        """End what a client has begun that may not move the gimbal any longer."""
        if self._client is None or allows(self._client):
            return
        self._client = None
        if self._rates.end() or self._is_stopping:
            self._stop_turning()
            return
        if self._command is not None:
            self._command.cancel()
            self._command = None
        self._repeat = self._waiting = None

    async def rest(self) -> None:
        """End what moves the gimbal, before the drone aims it: a stop sent later could end that."""
        may_turn = self._end()
        if may_turn:
            await self._host.drone.gimbal.stop()

    def leave_to_mission(self) -> None:
        """End what moves the gimbal.

        All zero rates leave now: later ones would stop the gimbal on the way to the mission's first angle.
        """
        may_turn, self._zeros = self._end(), 0
        with contextlib.suppress(AnafiMavError):
            for _ in range(STOPS if may_turn else 0):
                self._host.drone.gimbal.halt()

    def _end(self) -> bool:
        """End what moves the gimbal; return True when it may turn by a rate."""
        may_turn = self._rates.end() or self._is_stopping or bool(self._still)
        self._begin()
        self._client, self.is_neutral = None, False
        return may_turn

    def _stop_turning(self) -> None:
        """Stop the gimbal in the background, until the drone reports that it stands."""
        self._begin()
        self._is_stopping = True
        self._halt = self._host.spawn(self._stop())

    async def _stop(self) -> None:
        task = asyncio.current_task()
        try:
            await self._host.drone.gimbal.stop()
            self._is_stopping = False
        except LinkLost:
            return
        except AnafiMavError as error:
            self._host.text(Severity.WARNING, texts.GIMBAL_STOP_FAILED.fill(error=error))
        finally:
            if self._halt is task:
                self._halt, self._zeros = None, STOPS

    # The link and time.

    def link_up(self) -> None:
        """Stop a gimbal that may have turned since the link was lost."""
        if self._was_turning:
            self._was_turning = False
            self._stop_turning()

    def link_down(self) -> None:
        """Forget the target in force: the drone is disconnected."""
        rates = self._rates.rates
        self._was_turning = self._rates.end() or self._is_stopping or bool(self._still)
        with contextlib.suppress(AnafiMavError):
            for _ in range(STOPS if rates else 0):  # the gateway ends, and the drone is still connected
                self._turn({axis: Aim(0.0, aim.frame) for axis, aim in rates.items()})
        self._command = self._halt = self._repeat = self._waiting = self._seen = self._client = None
        self._frames = b""
        self._zeros, self._still_zeros, self._still = 0, 0, frozenset()
        self.is_neutral = self._is_stopping = False

    def add_stall(self, seconds: float) -> None:
        """Leave out a time in which the host could not receive heartbeats."""
        self._rates.add_stall(seconds)

    def tick(self, now: float) -> None:
        """End a rate whose time is over, and repeat what the drone may have lost."""
        self._watch_rates(now)
        with contextlib.suppress(AnafiMavError):
            self._send_again(now)

    def watch_attitude(self, values: Values) -> bool:
        """Notice a gimbal that leaves the reference orientation, and an axis that turns on.

        To an axis that is to stand further zero rates are sent: earlier ones may be lost. Returns True when flags of
        the gimbal may have changed. The attitude is decoded only where its angles matter.
        """
        frames = main_frames(values)
        if frames is None:
            return False
        before, self._frames = self._frames, frames
        has_left = self.is_neutral and self._has_left_reference()
        if has_left:
            self.is_neutral, self._reference = False, None
        if self._still:
            self._watch_still()
        return has_left or frames != before

    def _watch_still(self) -> None:
        last, attitude = self._seen, self._gimbal.attitude
        self._seen = attitude
        if last is None or attitude is None:
            return
        for axis in self._still:
            frame = attitude.frames[axis]
            if abs(targets.wrap_180(attitude.angle(axis, frame) - last.angle(axis, frame))) > STANDS:
                self._still_zeros = STOPS

    def _has_left_reference(self) -> bool:
        """True when another controller, or the drone, has moved the gimbal since it was reset."""
        reference, attitude = self._reference, self._gimbal.attitude
        if reference is None or attitude is None:
            return False
        for axis in self._gimbal.axes or ():
            frame = reference.frames[axis]
            if attitude.frames[axis] != frame:
                return True
            if abs(targets.wrap_180(attitude.angle(axis, frame) - reference.angle(axis, frame))) > REFERENCE_LEFT:
                return True
        return False

    def _watch_rates(self, now: float) -> None:
        client, is_by_command = self._rates.client, self._rates.is_by_command
        if client is not None and self._rates.expire(now):
            self._stop_turning()
            if is_by_command:
                reason = texts.RATE_CLIENT_SILENT.fill(system=client[0])
                self._host.text(Severity.NOTICE, texts.GIMBAL_STOPPED.fill(reason=reason))
            return
        if self._command is not None:
            return  # the command ends when the gimbal turns, or is at the end of its range
        gimbal = self._gimbal
        at_end = [axis for axis, aim in self._rates.rates.items() if aim.value and gimbal.is_at_end(axis, aim.value)]
        if at_end and self._rates.limit(at_end):
            self._stop_turning()

    def _send_again(self, now: float) -> None:
        """Repeat what the drone may have lost: rates in force, a stop, the angles of a message."""
        if self._command is not None or self._halt is not None:
            return  # they repeat it themselves
        if self._rates.turns or self._still_zeros > 0:
            self._turn({**self._zero_rates(), **self._rates.rates})
            self._still_zeros = max(self._still_zeros - 1, 0)
            if self._still_zeros == 0:
                self._still = frozenset()
        elif self._zeros > 0:
            self._zeros -= 1
            self._host.drone.gimbal.halt()
        if self._repeat is not None and now >= self._repeat[2]:
            angles, left, _ = self._repeat
            self._host.drone.gimbal.aim(**_by_axis(angles))
            self._repeat = (angles, left - 1, now + REPEAT_EVERY) if left > 1 else None

"""End a landing by positive gaz (ardrone3.xml 1-0-3), and by a take-off command on request.

Gaz starts nothing on the ground. A TakeOff does, so it is withdrawn when the drone reports that it has landed, and a
firmware that executes it all the same is made to land again (`Motors.on_flying_state`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.drone.element import Element
from anafi_mav.drone.expectation import Commander, loop_time
from anafi_mav.drone.piloting.motors import Motors
from anafi_mav.drone.piloting.state import PilotingState
from anafi_mav.drone.piloting.stick_stream import StickStream
from anafi_mav.drone.piloting.sticks import PERIOD, Percent
from anafi_mav.drone.sent_commands import Event, SentCommand, Slot
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout

GAZ_FOR = 1.0
"""s of gaz at most; then the sticks are centred, whatever the drone reports."""

FULL_GAZ = Percent(0, 0, 0, 100)

ALREADY_LANDED = "already landed"
"""The reason of a refusal: LANDED was reported before the landing was ended."""

STILL_LANDING = "drone still landing"
"""The reason of a failure: neither the end of the landing nor LANDED was reported in time."""

MOTORS_CUT, FORCED = "motors cut", "forced landing"
"""The reasons of a refusal: what the landing has become."""

_UNENDABLE: Mapping[FlyingState | None, str] = {
    FlyingState.LANDED: ALREADY_LANDED,
    FlyingState.EMERGENCY: MOTORS_CUT,
    FlyingState.EMERGENCY_LANDING: FORCED,
}
"""States in which no landing is ended, with the reason."""

SMART_WAIT = 1.5
"""s for SmartTakeOffLand alone to end a landing, before gaz is tried."""


class LandingEnd:
    """Ends landings. `Piloting.end_landing` says what it promises."""

    def __init__(
        self,
        commander: Commander,
        flight: Element[PilotingState],
        sticks: StickStream,
        motors: Motors,
        is_modern: Callable[[], bool],
    ) -> None:
        """`is_modern` returns True for an Ai, which takes SmartTakeOffLand (GroundSDK)."""
        self._commander = commander
        self._flight = flight
        self._sticks = sticks
        self._motors = motors
        self._is_modern = is_modern

    async def end(self, timeout: float, *, take_off: bool) -> None:
        self._commander.require_link()
        self._require_endable()
        if self._flight.state.flying != FlyingState.LANDING:
            return
        answer = self._commander.expect((ardrone3.FlyingStateChanged,), _judge)
        answer.expire_after(timeout, "the end of the landing")
        self._motors.landing_doubtful()
        sent, smart = SentCommand(Slot.LANDING_END), take_off and self._is_modern()
        try:
            if take_off:
                command = ardrone3.SmartTakeOffLand() if smart else ardrone3.TakeOff()
                sent.answer, answer.token = answer, self._commander.send(command)
                self._commander.sent.place(sent, loop_time())
            if smart:
                # It toggles: were the landing ended by gaz before it arrives, it would begin another one.
                await asyncio.wait({answer.future}, timeout=SMART_WAIT)
                self._commander.cancel(answer.token)
            await self._hold_gaz(answer.future)
            await answer.wait()
            self._require_endable()  # the drone may have begun another landing before this was resumed
            sent.apply(Event.EXECUTED)
        except BaseException as error:
            sent.apply(Event.WITHDRAWN, loop_time())
            if isinstance(error, CommandTimeout):
                raise CommandRejected(STILL_LANDING) from None
            raise
        finally:
            self._commander.cancel(answer.token)  # whatever ended this: it must not arrive on the ground
            answer.close()
            self._sticks.centre_in_landing()

    def _require_endable(self) -> None:
        """Raise `CommandRejected` in a state in which no landing is ended."""
        if (reason := _UNENDABLE.get(self._flight.state.flying)) is not None:
            raise CommandRejected(reason)

    async def _hold_gaz(self, ended: asyncio.Future[bool]) -> None:
        """Send full gaz every 50 ms until the drone reports another state than a landing.

        For `GAZ_FOR` s at most.
        """
        until = loop_time() + GAZ_FOR
        while not ended.done() and loop_time() < until:
            self._sticks.send_now(FULL_GAZ)
            await asyncio.wait({ended}, timeout=PERIOD)


def _judge(message: ardrone3.FlyingStateChanged) -> bool | AnafiMavError | None:
    if message.state == FlyingState.LANDING:
        return None
    reason = _UNENDABLE.get(message.state)
    return True if reason is None else CommandRejected(reason)

"""Switch of one aircraft between the Skycontroller's pilot and programs.

`flight_policy` has its states; this part hands sticks and piloting source over, and ends what flies when the aircraft
is given to the pilot. Without a Skycontroller it refuses nothing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from anafi_mav import texts
from anafi_mav.drone.controller.controller import Controller
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.control import Request
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.flight_policy import TRANSITIONS, Event, State, refusal_of


class PilotSwitch:
    """The explicit choice between the pilot at the Skycontroller and programs."""

    def __init__(self, aircraft: Aircraft, controller: Controller, stop: Callable[[], Awaitable[None]]) -> None:
        """`stop` ends all flight tasks and the motion, and never raises.

        It returns once the drone hovers or stands, or does not confirm it.
        """
        self._aircraft = aircraft
        self._controller = controller
        self._stop = stop
        self._state = State.AUTOMATIC
        self._takeovers = controller.takeovers
        self._giving = 0
        """Requests that give the pilot the aircraft, not confirmed yet: nothing new flies meanwhile."""
        self._given = asyncio.Event()
        """No such request runs."""
        self._given.set()

    @property
    def state(self) -> State:
        """State of the switch; a stick that the pilot has moved counts at once."""
        self._note_stick()
        return self._state

    def refusal(self, request: Request) -> Refused | None:
        """Return the refusal of a flight task behind a Skycontroller; None: permitted."""
        return refusal_of(self._in_force, request)

    @property
    def objection(self) -> OperatorText | None:
        """The reason for which sticks of clients do not fly the drone; None: they may."""
        return texts.PILOT_SWITCH if self._controller.present and self._in_force is State.PILOT else None

    @property
    def _in_force(self) -> State:
        return State.PILOT if self._giving else self.state

    async def request(self, wanted: State) -> None:
        """Give the aircraft to the pilot or to programs; return once this is confirmed.

        To the pilot: what flies is ended and the drone stops, unless it lands or returns. The switch is at Pilot also
        when the Skycontroller has not confirmed it. Another request waits for the end of that one, so that the newest
        counts. Raises `NotSupported` without a Skycontroller, and `CommandRejected` to take it while the pilot moves a
        stick.
        """
        self._note_stick()
        while self._giving and wanted is not State.PILOT:
            await self._given.wait()
        if wanted is State.PROGRAM:
            await self._controller.keep()
            self._enter(Event.TAKE)
        elif wanted is State.AUTOMATIC:
            self._enter(Event.FREE)
            self._controller.keep_no_longer()
        else:
            self._giving += 1
            self._given.clear()
            try:
                await self._stop()
                await self._controller.hand_back()  # also of a drone that has not confirmed its stop
            finally:
                self._controller.give_back()  # cancelled before, the sticks would stay those of programs
                self._giving -= 1
                if not self._giving:
                    self._given.set()
                self._enter(Event.GIVE)

    def link_down(self) -> None:
        """The connection ended: the Skycontroller has sticks and source again."""
        self._enter(Event.LINK_DOWN)

    def _note_stick(self) -> None:
        if self._controller.takeovers != self._takeovers:
            self._takeovers = self._controller.takeovers
            self._enter(Event.STICK)

    def _enter(self, event: Event) -> None:
        before, self._state = self._state, TRANSITIONS[self._state][event]
        if self._state is not before:
            self._aircraft.changed()

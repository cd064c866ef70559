"""Initiator of a landing or return: a client, the drone, or the pilot at the Skycontroller.

The drone does not report it. It is concluded from the commands sent through the gateway, from the reported reasons of
a return, and from whether there is a Skycontroller at all. No I/O; time is passed in.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

REPORTED_WITHIN = 15.0
"""s after a Landing was sent in which a landing that begins is attributed to it.

It is repeated for 10 s.
"""

ENDS_IN_LANDING = 3.0
"""s after the end of a return, or of a plan that lands, in which a landing that begins counts as its end."""


class Initiator(enum.Enum):
    """Initiator of a landing or return."""

    CLIENT = "a client, or the gateway for it"
    DRONE = "the drone"
    PILOT = "the pilot at the Skycontroller"
    UNSEEN = "the pilot, or a plan: a landing that was found under way"


@dataclass(frozen=True)
class _Landing:
    """A landing under way."""

    initiator: Initiator
    if_stopped: Initiator | None = None
    """Its initiator if the return before it is reported as stopped; None: the same."""


class Initiators:
    """Keeps the initiator of the present landing, and of the present or last return."""

    def __init__(self) -> None:
        self._landing: _Landing | None = None
        self.returning: Initiator | None = None
        """None while the drone does not return."""
        self._land_sent = -math.inf
        self._return_sent = -math.inf
        self._returned: tuple[Initiator, float] | None = None
        """Initiator of the return that ended last, and its end time; None if it was stopped."""
        self._plan_ended = -math.inf
        """End time of the newest plan whose last line lands the drone."""

    @property
    def landing(self) -> Initiator | None:
        """Initiator of the present landing; None while the drone does not land."""
        return None if self._landing is None else self._landing.initiator

    @property
    def last_return(self) -> Initiator | None:
        """Initiator of the return that ended last; None without one, and if it was stopped."""
        return None if self._returned is None else self._returned[0]

    def recall(self, landing: Initiator | None, returning: Initiator | None) -> None:
        """Note the stored initiators of a landing and a return that were found; None: not known."""
        self._landing = None if landing is None else _Landing(landing)
        self.returning = returning

    def land_commanded(self, now: float) -> None:
        """Note that a Landing is about to be sent."""
        self._land_sent = now

    def return_commanded(self, now: float) -> None:
        """Note that a return is about to be commanded."""
        self._return_sent = now

    def plan_ended(self, now: float) -> None:
        """Note that a flight plan has ended whose last line lands the drone."""
        self._plan_ended = now
        if self.landing is Initiator.UNSEEN:
            self._landing = _Landing(Initiator.DRONE)

    def on_landing(self, now: float, *, plan_lands: bool, pilot_may_land: bool, unseen: bool = False) -> None:
        """Note that the drone has begun to land.

        `plan_lands`: its flight plan ends so. `pilot_may_land`: there is a Skycontroller, and no plan that lands here.
        `unseen`: a new connection has found it landing.
        """
        unexplained = Initiator.PILOT if pilot_may_land else Initiator.DRONE
        if now - self._land_sent <= REPORTED_WITHIN or plan_lands:
            self._landing = _Landing(Initiator.CLIENT)
        elif self.returning is not None:
            self._landing = _Landing(self.returning, unexplained)
        elif now - self._plan_ended <= ENDS_IN_LANDING:
            self._landing = _Landing(Initiator.DRONE)
        elif self._returned is not None and now - self._returned[1] <= ENDS_IN_LANDING:
            self._landing = _Landing(self._returned[0])
        else:
            self._landing = _Landing(Initiator.UNSEEN if unseen and pilot_may_land else unexplained)

    def on_landing_over(self, *, unsent: bool) -> None:
        """Note that the drone does not land: it stands, or flies again.

        `unsent`: no Landing waits for its answer.
        """
        if self._landing is not None and unsent:
            self._land_sent = -math.inf
        self._landing = None

    def on_return(self, now: float, *, by_itself: bool, by_plan: bool, skycontroller: bool) -> None:
        """Note that the drone returns; `by_itself` and `by_plan` are its reported reason."""
        if by_itself:
            self.returning = Initiator.DRONE
        elif by_plan or not skycontroller or now - self._return_sent <= REPORTED_WITHIN:
            self.returning = Initiator.CLIENT
        elif self.returning is not Initiator.CLIENT:
            self.returning = Initiator.PILOT

    def on_return_over(self, now: float, *, stopped: bool) -> None:
        """Note that the drone does not return.

        `stopped`: by a command, a landing by the pilot's button for example.
        """
        if self.returning is not None:
            self._returned = None if stopped else (self.returning, now)
            if stopped and self._landing is not None and self._landing.if_stopped is not None:
                self._landing = _Landing(self._landing.if_stopped)
            self.returning = None
            self._return_sent = -math.inf

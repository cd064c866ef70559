"""Send the present stick position as PCMDs when they are due, and block them when needed.

The due times are computed in `sticks`, without I/O; this is its timer and its connection to the drone.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from anafi_mav.arsdk.messages.ardrone3 import PCMD, FlyingState
from anafi_mav.arsdk.messages.common import PlayingState
from anafi_mav.clock import Alarm
from anafi_mav.drone.element import Element
from anafi_mav.drone.expectation import Commander, loop_time
from anafi_mav.drone.piloting.state import PilotingState, in_state
from anafi_mav.drone.piloting.sticks import CENTRED, Percent, StickSchedule, is_deflected
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.drone.status.home import BY_ITSELF, Home
from anafi_mav.errors import CommandRejected, LinkLost

log = logging.getLogger("anafi_mav")

RELEASES = 3
"""Centred PCMDs that precede a return; they are not acknowledged."""

_STICKS_DEAD = frozenset(
    {FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY, FlyingState.EMERGENCY_LANDING}
)
"""States in which no PCMD is sent: positive gaz cancels a landing (ardrone3.xml 1-0-3)."""


class StickStream:
    """Sends PCMDs while there are any to send.

    All of it acts at once; a dead stream sends and keeps nothing.
    """

    def __init__(
        self,
        commander: Commander,
        flight: Element[PilotingState],
        home: Home,
        pilot_has_source: Callable[[], bool] = lambda: False,
    ) -> None:
        """Store the sources of flight state, home and piloting source.

        `pilot_has_source` returns True while the pilot at a Skycontroller has the piloting source.
        """
        self._commander = commander
        self._pilot_has_source = pilot_has_source
        self._flight = flight
        self._home = home
        self._sticks = StickSchedule()
        self._next = Alarm(self.pump)
        self._levels = False
        """Centred PCMDs are sent although the drone is said to land: they follow a deflection."""
        self.landings_asked = 0
        """Landings that were ordered and have not been answered: nothing is sent that could cancel one."""

    @property
    def blocked(self) -> str | None:
        """Why no setpoint is sent at present; None when the sticks work."""
        if self._flight.state.plan == PlayingState.PLAYING:
            return "a flight plan plays"
        return self.dead

    @property
    def held(self) -> bool:
        """A setpoint holds the sticks, level or not."""
        return self._sticks.held

    @property
    def dead(self) -> str | None:
        """Why no PCMD at all is sent at present, not even one that centres the sticks."""
        flying = self._flight.state.flying
        if not self._commander.connected:
            return "not connected"
        if flying is None or flying in _STICKS_DEAD:
            return in_state(flying)
        if self.landings_asked:
            return "the drone is about to land"
        if self._home.state.returning_by_itself and self._home.state.reason is not None:
            return f"{BY_ITSELF}: {spoken(self._home.state.reason)}"
        return None

    def hold(self, position: Percent, age: float) -> None:
        """Hold this position, set `age` s ago, from now on: see `Piloting.pilot`.

        The caller has checked `blocked`.
        """
        now = loop_time()
        self._levels = False
        self._sticks.command(position, now, now - age)
        self._next.cancel()
        self._send_due(now, at_once=True)

    def centre(self) -> None:
        """Centred from now on, for two seconds, whether there was anything to send or not."""
        self._sticks.centre(loop_time())
        self.pump()

    def send_now(self, position: Percent) -> None:
        """Send one PCMD in a landing, outside of the 20 Hz grid.

        The caller repeats it, and then centres.
        """
        if self._flight.state.flying == FlyingState.LANDING and not self.landings_asked:
            self._send(self._sticks.single(position, loop_time()))

    def centre_in_landing(self) -> None:
        """Centre for two seconds, in a landing too.

        A firmware that keeps the last PCMD must keep neither the gaz against the landing nor the tilt before it.
        """
        self._levels = True
        self.centre()

    def landing_begun(self) -> None:
        """Centre sticks that are deflected when a landing begins that this program did not command."""
        if self._sticks.active and self._sticks.deflected and not self.landings_asked and not self._pilot_has_source():
            self.centre_in_landing()

    def pump(self) -> None:
        """Send the PCMD that is due and come back for the next."""
        self._next.cancel()
        lands = self._flight.state.flying == FlyingState.LANDING and not self.landings_asked
        if self.dead is not None and not (lands and self._levels and self._commander.connected):
            self._sticks.stop()
        self._send_due(loop_time())

    def _send_due(self, now: float, *, at_once: bool = False) -> None:
        """Send the PCMD that is due, and set the timer for the next."""
        pcmd = self._sticks.due(now)
        if pcmd is not None:
            self._send(pcmd, at_once=at_once)
        deadline = self._sticks.deadline
        if deadline is not None:
            self._next.set(deadline)

    def let_go(self) -> None:
        """Let go of what deflection there is.

        What begins now may be refused; the sticks must not stay as they are.
        """
        if self._sticks.active:
            self.centre()

    def silence(self) -> None:
        """Stop sending PCMDs: something else flies the drone now."""
        self._levels = False
        self._sticks.stop()
        self._next.cancel()

    def release(self) -> None:
        """Send centred PCMDs, then none.

        A return waits for flag 0 (rth.xml 146-0-11), from any controller. Nothing is sent while the pilot at a
        Skycontroller has the piloting source: the sticks that count are the pilot's.
        """
        if self.dead is None and not self._pilot_has_source():
            for _ in range(RELEASES):
                self._commander.send(self._sticks.single(CENTRED, loop_time()))
        self.silence()

    def _send(self, message: PCMD, *, at_once: bool = False) -> None:
        """For what is worth sending only while there is a link; its loss is reported elsewhere.

        So is a newer command, which lets the task that it has replaced centre nothing more.
        """
        try:
            self._commander.send(message, stops=not is_deflected(message), at_once=at_once)
        except LinkLost as error:
            log.debug("%s not sent: %s", message.NAME, error)
            self._sticks.stop()
        except CommandRejected as error:
            if is_deflected(message):
                raise
            log.debug("%s not sent: %s", message.NAME, error)

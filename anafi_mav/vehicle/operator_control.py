"""Operator control of one aircraft among several stations, after mavlink#2313. No I/O.

Time is passed in.

At most one station is the operator (`gcs_main` of CONTROL_STATUS). Only its sticks, setpoints and targets fly the
aircraft. It and the secondaries may command; other stations read, and stop. Without an operator every client may do
all of it, as if this did not exist. A stop and the gimbal are never asked about here.

- A station requests control and gets it at once, unless there is an operator that has not allowed a takeover. Then the
  request fails, the operator is notified, and decides: it releases, allows the takeover, or does nothing.
- An operator that is silent for `SILENT` is none any longer: a lost station must not lock the aircraft. mavlink#2313
  keeps the role while any secondary is heard; that would leave the sticks with a station that has none.
- A station is its system id, as in CONTROL_STATUS: what has the id of the operator is the operator.

The flight tasks of stations without the role are refused by a policy of `Control`, which comes after the pilot's and
never concerns what the gateway does by itself.

Secondaries are those of the endpoint's option, and those in the range of system ids that the operator has named in
param4 and param5 of its request (QGroundControl in mavlink/qgroundcontrol#14560 until July 2026; mavlink#2535 has
removed param5 since, and 0 stands for no range).
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

from anafi_mav import texts
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.control import Request
from anafi_mav.vehicle.base.refusal import NotInControl, Refused
from anafi_mav.vehicle.base.right import Right

SILENT = 5.0
"""s without a message after which an operator is lost: five heartbeats of a station, ArduPilot's FS_GCS_TIMEOUT."""

SHORTEST, LONGEST, USUAL = 3.0, 60.0, 10.0
"""s that a request may wait for the operator (param3 of the command); the last where a station names none."""

REPEAT_EVERY, REPEATS = 1.0, 3
"""s between notifications of one request to an operator that does not acknowledge them, and how many are sent."""

MAX_WAITING = 8
"""Stations whose request waits for the operator. Others get the same answer, and the operator no notification."""

MAX_SHOWN = 10
"""Secondaries that CONTROL_STATUS has room for."""


class State(enum.Enum):
    """State of the control of one aircraft."""

    FREE = "no operator: each client may command and fly"
    HELD = "an operator, which decides about each request of another station"
    OFFERED = "an operator, which allows every takeover"


class Event(enum.Enum):
    """Event that changes the state."""

    CLAIM = "a request is granted, or the operator's own; takeovers are not allowed"
    OFFER = "a request is granted, or the operator's own; takeovers are allowed"
    ASK = "another station requests control that is held"
    RELEASE = "the operator releases control"
    SILENCE = "the operator has been silent for too long"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.FREE: {Event.CLAIM: State.HELD, Event.OFFER: State.OFFERED},
    State.HELD: {
        Event.CLAIM: State.HELD,
        Event.OFFER: State.OFFERED,
        Event.ASK: State.HELD,
        Event.RELEASE: State.FREE,
        Event.SILENCE: State.FREE,
    },
    State.OFFERED: {
        Event.CLAIM: State.HELD,
        Event.OFFER: State.OFFERED,
        Event.RELEASE: State.FREE,
        Event.SILENCE: State.FREE,
    },
}
"""The pairs that are missing cannot happen: without an operator, or with its permission, each request is granted."""


class Need(enum.Enum):
    """Role that a message of a station needs while there is an operator."""

    NOTHING = "it reads, it stops, or something else decides about it"
    COMMAND = "operator or secondary"
    FLY = "operator: sticks, setpoints, targets"


class RequestOutcome(enum.Enum):
    """Answer to a request or release."""

    GRANTED = "the sender is the operator from now on"
    KEPT = "the sender has been the operator; what it allows is changed"
    RELEASED = "there is no operator any longer, or was none"
    ASKED = "another station is the operator, which is notified or has been"
    NOT_OPERATOR = "another station is the operator, and only that can release control"


@dataclass(frozen=True)
class ControlRequest:
    """One request of a station for control."""

    system: int
    allows_takeover: bool = False
    timeout: float = USUAL
    """s that it waits for the operator."""
    secondaries: range = range(0)
    """Further system ids that may command."""


@dataclass
class WaitingRequest:
    """A request that waits for the operator's decision."""

    request: ControlRequest
    until: float
    notify_at: float
    """When the operator is notified next."""
    sent: int = 0
    """Notifications so far."""


@dataclass(frozen=True)
class Tick:
    """Consequences of the time that has passed."""

    notify: tuple[WaitingRequest, ...] = ()
    """Requests of which the operator is notified now; `sent` counts this one."""
    expired: tuple[int, ...] = ()
    """Systems whose requests the operator has not answered in time."""
    lost: int = 0
    """The system that was the operator and is silent; 0: none."""


_NOTHING = Tick()


class OperatorControl:
    """The operator of one aircraft, its secondaries, and the requests that wait."""

    def __init__(self) -> None:
        self.own = 0
        """System id of the aircraft. Its own components may do what its operator may."""
        self.operator = 0
        """System id; 0: none."""
        self.state = State.FREE
        self._named = range(0)
        """Secondaries by the operator's request."""
        self._heard: dict[int, float] = {}
        """When a system was heard last. There are at most 255."""
        self._configured: set[int] = set()
        """Secondaries by the option of the endpoint on which they were heard last."""
        self._waiting: dict[int, WaitingRequest] = {}

    @property
    def is_free(self) -> bool:
        """True without an operator: nothing is refused."""
        return self.state is State.FREE

    @property
    def grants_requests(self) -> bool:
        """True while each request is granted at once."""
        return self.state is not State.HELD

    def objection(self, system: int, need: Need) -> OperatorText | None:
        """Return the reason for which a station may not do something; None: it may."""
        if self.operator in (0, system) or need is Need.NOTHING or system == self.own != 0:
            return None
        if need is Need.COMMAND and self._is_secondary(system):
            return None
        return texts.OTHER_OPERATOR.fill(system=self.operator)

    def shown_secondaries(self, now: float) -> list[int]:
        """Return the secondaries that are heard, at most as many as CONTROL_STATUS holds."""
        heard = (system for system, at in self._heard.items() if now - at < SILENT)
        return sorted(system for system in heard if self._is_secondary(system))[:MAX_SHOWN]

    def _is_secondary(self, system: int) -> bool:
        return system not in (0, self.operator) and (system in self._configured or system in self._named)

    # Stations.

    def hear(self, system: int, now: float, *, is_secondary: bool = False) -> None:
        """Note a message of a station; `is_secondary` by the option of its endpoint."""
        self._heard[system] = now
        if is_secondary:
            self._configured.add(system)
        else:
            self._configured.discard(system)

    def request(self, asked: ControlRequest, now: float) -> RequestOutcome:
        """Handle a station's request for control."""
        if asked.system != self.operator and not self.grants_requests:
            self._enter(Event.ASK)
            known = self._waiting.get(asked.system)
            if known is None and len(self._waiting) < MAX_WAITING:
                self._waiting[asked.system] = WaitingRequest(asked, now + asked.timeout, now)
            return RequestOutcome.ASKED
        outcome = RequestOutcome.KEPT if asked.system == self.operator else RequestOutcome.GRANTED
        self._enter(Event.OFFER if asked.allows_takeover else Event.CLAIM)
        self.operator, self._named = asked.system, asked.secondaries
        self._heard[asked.system] = now
        if outcome is RequestOutcome.GRANTED:
            self._waiting.clear()
        return outcome

    def release(self, system: int) -> RequestOutcome:
        """Handle a station's release of control."""
        if self.is_free:
            return RequestOutcome.RELEASED
        if system != self.operator:
            return RequestOutcome.NOT_OPERATOR
        self._leave(Event.RELEASE)
        return RequestOutcome.RELEASED

    def acknowledge(self, system: int) -> None:
        """Note an acknowledged notification: those to the operator are not repeated."""
        if system == self.operator:
            for waiting in self._waiting.values():
                waiting.sent = REPEATS

    def take_offered(self) -> list[int]:
        """Return the systems whose requests wait and would be granted now, once."""
        if not self.grants_requests:
            return []
        offered = [*self._waiting]
        self._waiting.clear()
        return offered

    # Time.

    def tick(self, now: float) -> Tick:
        """Return the consequences of the time until now."""
        if self.is_free:
            return _NOTHING
        if now - self._heard.get(self.operator, now) >= SILENT:
            lost = self.operator
            self._leave(Event.SILENCE)
            return Tick(lost=lost)
        expired = tuple(system for system, waiting in self._waiting.items() if now >= waiting.until)
        for system in expired:
            del self._waiting[system]
        due = [one for one in self._waiting.values() if one.sent < REPEATS and now >= one.notify_at]
        for waiting in due:
            waiting.sent += 1
            waiting.notify_at = now + REPEAT_EVERY
        return Tick(tuple(due), expired)

    def restart(self, now: float) -> None:
        """Note that stations can be heard again, after a time without the drone."""
        if not self.is_free:
            self._heard[self.operator] = now

    def skip(self, seconds: float) -> None:
        """Leave out a time in which no station could be heard."""
        self._heard = {system: at + seconds for system, at in self._heard.items()}

    def _leave(self, event: Event) -> None:
        self._enter(event)
        self.operator, self._named = 0, range(0)
        self._waiting.clear()

    def _enter(self, event: Event) -> None:
        self.state = TRANSITIONS[self.state][event]


def operator_refusal_of(control: OperatorControl, request: Request) -> Refused | None:
    """Return the refusal of a request while another station than its client's is the operator.

    None: it is permitted.
    """
    if control.is_free or not isinstance(request.by, Right) or not request.rules.is_flight:
        return None
    need = Need.FLY if request.rules.needs_operator else Need.COMMAND
    reason = control.objection(request.by.system, need)
    return None if reason is None else NotInControl(request.rules.what, reason)

"""Commands sent to the drone, and the one that an event is about. No I/O.

ARSDK has no replies: a later event reports the effect of a command, and does not name the command. A command that was
withdrawn may have reached the drone all the same, so it is remembered for as long as the drone may still execute it.
Every fact about one sending is in its `SentCommand`; which of them an event is about is decided in
`SentCommands.attribute` alone. Times are those of the event loop, s.
"""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Mapping
from operator import attrgetter
from typing import Any, NamedTuple

import msgspec

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.common import PlayingState

KEPT = 8
"""Commands of one kind that are remembered. Two overlap at most; the others have been answered or expire in seconds."""

TAKE_OFF_MEMORY = 10.0
"""s after a start was withdrawn in which the drone may still take off, or takes off and could not report it."""

QUIET = 1.0
"""s after the drone received a command in which it would have said what it did; silence means that there was nothing to
do. Its acknowledgement came through, so its events do too, a few retransmissions of 150 ms later at most."""

STAYS_DOWN = 3.0
"""s after LANDED in which a TakeOff that was to end the landing may still be executed."""

PLAN_MEMORY = 20.0
"""s in which a flight plan may begin; as Olympe (common.Mavlink.Start): the drone reads the whole file before it
reports anything."""

LATE_LINES = 2.0
"""s after the end of a flight plan in which lines of it may still be reported."""

UNKNOWN_LINE = -2
"""Newest line of a plan that this program has not started, or that began before the session, until one is reported."""

TAKEN_OFF = frozenset({FlyingState.TAKINGOFF, FlyingState.HOVERING, FlyingState.FLYING})
RISING = TAKEN_OFF | {FlyingState.MOTOR_RAMPING}


class Slot(enum.Enum):
    """Kind of a command, by the thing that it starts."""

    LAUNCH = "launch"
    """TakeOff, and UserTakeOff of a hand launch."""
    LANDING_END = "landing end"
    """TakeOff or SmartTakeOffLand against a landing."""
    PLAN = "flight plan"
    POI = "point of interest"
    FOLLOW = "follow me"
    ANIMATION = "animation"


AUTOMATIC = (Slot.PLAN, Slot.POI, Slot.FOLLOW, Slot.ANIMATION)
"""What hover and every newer flight end."""

STARTS_MOTORS = (Slot.LAUNCH, Slot.LANDING_END, Slot.PLAN)


class Expiry(NamedTuple):
    """How long a command that is no longer awaited counts, s."""

    may_begin: float = 0.0
    """The drone may still leave the ground by it."""
    reported: float = 0.0
    """Its effect may still be reported; that of a withdrawn one is then undone."""


EXPIRY: Mapping[Slot, Expiry] = {
    Slot.LAUNCH: Expiry(TAKE_OFF_MEMORY),
    Slot.LANDING_END: Expiry(STAYS_DOWN),
    Slot.PLAN: Expiry(TAKE_OFF_MEMORY, PLAN_MEMORY),
}


class Phase(enum.Enum):
    """Progress of a command that was sent."""

    QUEUED = "queued"
    """The drone has not acknowledged its receipt."""
    DELIVERED = "delivered"
    """The drone has received it, and no event has reported its effect."""
    CONFIRMED = "confirmed"
    """An event has reported its effect."""
    ENDED = "ended"
    """Its effect is over."""
    REFUSED = "refused"
    """An event has reported that the drone does not execute it."""
    WITHDRAWN = "withdrawn"
    """This program has withdrawn it; the drone may have received it, and may still execute it."""
    ABANDONED = "abandoned"
    """Its answer is not awaited, as the link was lost or a newer one replaced it. Its effect is not undone: a plan goes
    on without a link."""


class Event(enum.Enum):
    """Fact that changes the phase of a command."""

    DELIVERED = "delivered"
    EXECUTED = "executed"
    OVER = "over"
    REFUSED = "refused"
    WITHDRAWN = "withdrawn"
    ABANDONED = "abandoned"


_UNANSWERED = {
    Event.EXECUTED: Phase.CONFIRMED,
    Event.REFUSED: Phase.REFUSED,
    Event.WITHDRAWN: Phase.WITHDRAWN,
    Event.ABANDONED: Phase.ABANDONED,
}

TRANSITIONS: Mapping[Phase, Mapping[Event, Phase]] = {
    Phase.QUEUED: {Event.DELIVERED: Phase.DELIVERED, **_UNANSWERED},
    Phase.DELIVERED: _UNANSWERED,
    # Withdrawn: its verb was cancelled in the event-loop iteration that confirmed it.
    Phase.CONFIRMED: {Event.OVER: Phase.ENDED, Event.WITHDRAWN: Phase.WITHDRAWN},
    Phase.ENDED: {},
    Phase.REFUSED: {},
    Phase.WITHDRAWN: {Event.OVER: Phase.ENDED, Event.REFUSED: Phase.REFUSED},
    Phase.ABANDONED: {
        Event.EXECUTED: Phase.CONFIRMED,
        Event.OVER: Phase.ENDED,
        Event.REFUSED: Phase.REFUSED,
        Event.WITHDRAWN: Phase.WITHDRAWN,
    },
}
"""An event that a phase does not list leaves it as it is: late and doubled events are normal."""


class SentCommand(msgspec.Struct, eq=False):
    """One sending of a command."""

    slot: Slot
    target: Any = None
    """Its name in events: the id of the plan, the flying states that confirm a launch."""
    undo: Message | None = None
    """Command that ends what it starts. A newer command of its slot replaces one that has it."""
    undo_refused: bool = False
    """It is undone when the drone refuses it, too: the drone would execute it later."""
    plan_before: str | None = None
    """Id of the plan that the drone reported when this start was sent."""
    cause: Any = None
    """The caller's value for what it starts, by which it recognises reports of that."""
    answered: bool = False
    """An event was about it: its motors ramped up, say, or its withdrawn plan began."""
    line: int = -1
    """Newest line of its plan that was reported as executed, from 0; first the line before the one it begins with."""
    begun_at: float = -math.inf
    """When its plan was reported to play."""
    ended_at: float = math.inf
    """When the end of that was reported, or the beginning of another plan."""
    answer: Any = None
    """The wait of its verb, an `expectation.Expectation`."""
    phase: Phase = Phase.QUEUED
    delivered: bool = False
    delivered_at: float = math.inf
    """When the drone acknowledged its receipt."""
    is_in_effect: bool = False
    """An event has reported its effect, and none the end of it; also of a withdrawn one."""
    may_begin_until: float = -math.inf
    reported_until: float = -math.inf

    @property
    def awaited(self) -> bool:
        """True while neither an event nor this program has decided on it."""
        return self.phase in (Phase.QUEUED, Phase.DELIVERED)

    def may_begin(self, now: float) -> bool:
        """Return True when the drone may still execute it."""
        closed = self.phase in (Phase.WITHDRAWN, Phase.ABANDONED)
        return self.awaited or (closed and now < self.may_begin_until)

    def lasts(self, now: float) -> bool:
        """Return True while its effect is reported, or may still begin."""
        return self.phase is Phase.CONFIRMED or self.is_in_effect or self.may_begin(now)

    def is_ignored(self, now: float) -> bool:
        """Return True for a launch of before that the drone has received and has not reacted to.

        A drone refuses a take-off by silence. Motors that start now are another controller's.
        """
        closed = self.phase in (Phase.WITHDRAWN, Phase.ABANDONED)
        return self.slot is Slot.LAUNCH and closed and not self.answered and now > self.delivered_at + QUIET

    def may_be_reported(self, now: float) -> bool:
        """Return True when an event may still report its effect, or repeat that."""
        closed = self.phase in (Phase.WITHDRAWN, Phase.ABANDONED)
        return self.awaited or self.phase is Phase.CONFIRMED or (closed and now < self.reported_until)

    def continues(self, line: int, now: float) -> bool:
        """Return True for a line that repeats or follows the newest one.

        Any line does that while the newest one is unknown. False once its plan has ended `LATE_LINES` ago.
        """
        follows = self.line == UNKNOWN_LINE or self.line <= line <= self.line + 1
        return follows and now < self.ended_at + LATE_LINES

    def apply(self, event: Event, now: float = -math.inf) -> None:
        """Change the phase. `now` is needed for WITHDRAWN and ABANDONED."""
        self.delivered = self.delivered or event is Event.DELIVERED
        self.answered = self.answered or event in (Event.EXECUTED, Event.REFUSED, Event.OVER)
        if event in (Event.EXECUTED, Event.REFUSED, Event.OVER):
            self.is_in_effect = event is Event.EXECUTED and self.phase not in (Phase.ENDED, Phase.REFUSED)
        phase = TRANSITIONS[self.phase].get(event, self.phase)
        if phase is not self.phase and phase in (Phase.WITHDRAWN, Phase.ABANDONED):
            expiry = EXPIRY.get(self.slot, Expiry())
            undone = expiry.reported if self.undo is None else max(expiry)  # what is undone once may be so again
            self.may_begin_until, self.reported_until = now + expiry.may_begin, now + undone
        self.phase = phase


class SentCommands:
    """The newest commands of each slot."""

    def __init__(self) -> None:
        self._slots: dict[Slot, tuple[SentCommand, ...]] = dict.fromkeys(Slot, ())
        """Oldest first. Tuples: an empty deque takes 700 bytes, and every drone has one for each slot."""
        self._foreign: SentCommand | None = None
        """The newest start of a plan by another controller, or by this program in an earlier session: its lines may be
        reported after the start of the next plan."""

    def place(self, sent: SentCommand, now: float) -> list[SentCommand]:
        """Add a command; return those that it replaces, whose verbs are not to wait any longer."""
        commands = self._slots[sent.slot]
        replaced = [one for one in commands if one.awaited and one.undo is not None]
        for one in replaced:
            one.apply(Event.ABANDONED, now)
        if sent.slot in STARTS_MOTORS:
            self._slots[Slot.LANDING_END] = ()  # motors that start from now on are wanted
        self._slots[sent.slot] = (*self._slots[sent.slot], sent)[-KEPT:]
        return replaced

    def awaited(self, *slots: Slot) -> list[SentCommand]:
        """Return the undecided commands of these slots, of all without an argument."""
        return [one for slot in slots or Slot for one in self._slots[slot] if one.awaited]

    def may_start_motors(self, now: float) -> bool:
        """Return True when a drone that stands may still begin to fly."""
        return any(one.may_begin(now) for slot in STARTS_MOTORS for one in self._slots[slot])

    def has_started_motors(self, now: float) -> bool:
        """Return True when motors that start now are, or may be, started by one of these commands."""
        sent = (one for slot in STARTS_MOTORS for one in self._slots[slot])
        return any(one.may_begin(now) and not one.is_ignored(now) for one in sent)

    def has_failed_launch(self, now: float) -> bool:
        """Return True while a launch that the drone seems to have ignored or refused may begin.

        LANDED is taken for a refusal after motors that ramped up; both may be late events about an earlier launch.
        """
        launches = self._slots[Slot.LAUNCH]
        is_refused = any(
            one.phase is Phase.REFUSED and one.delivered and now < one.delivered_at + TAKE_OFF_MEMORY
            for one in launches
        )
        return is_refused or any(one.may_begin(now) and one.is_ignored(now) for one in launches)

    def is_unwanted(self, sent: SentCommand, now: float) -> bool:
        """Return True when the effect of this command, which an event has reported, is to be undone.

        Not while a newer one of its slot may be in force: what undoes the older one would end the newer.
        """
        newer = itertools.takewhile(lambda one: one is not sent, reversed(self._slots[sent.slot]))
        in_force = any(
            one.awaited or one.phase is Phase.CONFIRMED or (one.phase is Phase.ABANDONED and one.may_begin(now))
            for one in newer
        )
        return sent.phase is Phase.WITHDRAWN and not in_force and now < sent.reported_until

    def withdraw(self, sent: SentCommand, now: float) -> Message | None:
        """Withdraw a command and those that it has replaced; return the command against them.

        A hand launch that a take-off has replaced may still start the motors when the take-off has failed.
        """
        replaced = [one for one in self._slots[sent.slot] if one.phase is Phase.ABANDONED and one.may_begin(now)]
        undo = next((one.undo for one in (sent, *replaced) if one.undo is not None), None)
        for one in (sent, *replaced):
            one.apply(Event.WITHDRAWN, now)
        return undo

    def newest(self, slot: Slot) -> SentCommand | None:
        """Return the newest command of a slot, whatever has become of it."""
        commands = self._slots[slot]
        return commands[-1] if commands else None

    def is_newest(self, sent: SentCommand) -> bool:
        """Return True while no newer command of its slot was sent."""
        return self.newest(sent.slot) is sent

    def is_executed(self, slot: Slot) -> bool:
        """Return True when the reported effect of a command of this slot has not ended."""
        return any(one.phase is Phase.CONFIRMED for one in self._slots[slot])

    def in_effect(self, slot: Slot) -> SentCommand | None:
        """Return the command of this slot whose reported effect has not ended, also a withdrawn one."""
        return next((one for one in self._slots[slot] if one.is_in_effect), None)

    def is_undecided(self, plan: str, now: float) -> bool:
        """Return True when a report of this plan may still be that of an earlier start."""
        named = (one for one in self._slots[Slot.PLAN] if one.target == plan)
        return any(one.phase is not Phase.CONFIRMED and one.may_be_reported(now) for one in named)

    def newest_line(self, plan: str) -> int:
        """Return the newest line of this plan that was reported as executed, from 0; -1: none."""
        starts = (self._plan_named(plan), self._foreign)
        return max([-1, *(one.line for one in starts if one is not None and one.target == plan)])

    def rule_out(self) -> None:
        """Note that no withdrawn command starts the motors any more.

        The drone has received a command behind it that keeps it on the ground, and reports nothing.
        """
        for slot in STARTS_MOTORS:
            for one in self._slots[slot]:
                one.may_begin_until = -math.inf

    def deliver(self, token: int, now: float) -> None:
        """The drone has received the command with this token."""
        for one in self.awaited():
            if one.answer.token == token:
                one.delivered_at = now
                one.apply(Event.DELIVERED)

    def abandon(self, now: float) -> None:
        """The link is lost: no answer is awaited."""
        for one in self.awaited():
            one.apply(Event.ABANDONED, now)

    def clear(self) -> None:
        """Forget all: the commands of an earlier session do not count in a new one."""
        self._slots = dict.fromkeys(Slot, ())
        self._foreign = None

    # -- what the drone reports

    def attribute(self, message: Message, now: float) -> SentCommand | None:
        """Return the command that this event is about, in its new phase.

        None: no command of this program explains it. Commands are executed in the order of their sending, and the
        events of one type arrive in the order of their effects; beyond that nothing is promised.
        """
        match message:
            case ardrone3.FlyingStateChanged():
                return self._attribute_flying(message.state, now)
            case common.MavlinkFilePlayingStateChanged(state=PlayingState.PLAYING):
                return self._attribute_playing(message.filepath, now)
            case common.MavlinkFilePlayingStateChanged():
                return self._attribute_stopped(message.filepath, now)
            case common.StartingErrorEvent():
                return self._attribute_start_error(now)
        return None

    def _attribute_flying(self, state: FlyingState, now: float) -> SentCommand | None:
        """A flying state names nothing.

        - LANDED is a refusal only once the motors have turned: a drone refuses a take-off by silence, so a LANDED
          before that is an older one, repeated.
        - Motors that ramp up are those of the oldest launch that was withdrawn and not reported yet: the LANDED that
          follows them ends that one, and is no refusal of a newer TakeOff.
        - A launch that was withdrawn after the drone had received and ignored it explains nothing (`is_ignored`).
        - A TakeOff against a landing that reaches the drone on the ground starts the motors there. LANDED and the
          motors that ramp up may arrive together, so its effect is unwanted from LANDED on.
        """
        newest, is_older = None, False
        for one in self._slots[Slot.LAUNCH]:
            if one.is_ignored(now):
                continue
            newest = one
            if state in one.target:
                one.apply(Event.EXECUTED)
            elif state == FlyingState.EMERGENCY or (state == FlyingState.LANDED and one.answered):
                one.apply(Event.REFUSED if one.awaited else Event.OVER)
            elif state != FlyingState.LANDED and not is_older:
                is_older = not one.answered and one.phase is Phase.WITHDRAWN and one.may_begin(now)
                one.answered = True
        for one in self._slots[Slot.LANDING_END]:
            if state == FlyingState.LANDED and one.may_begin(now):
                one.apply(Event.WITHDRAWN, now)
                one.may_begin_until = one.reported_until = now + STAYS_DOWN
            if state in RISING and self.is_unwanted(one, now):
                newest = one
        return newest

    def _attribute_playing(self, uid: str, now: float) -> SentCommand | None:
        """PLAYING names the plan as the upload did; some firmware may name it otherwise.

        - A plan is not started again while an earlier start of it is undecided (`is_undecided`), so a known name is
          that of its newest start.
        - A name that is not known is that of the newest start, while the drone may still begin that.
        - A withdrawn start begins late when it took the drone so long to read the plan that the command against it
          arrived before its beginning.
        """
        plans = self._slots[Slot.PLAN]
        sent, newest = self._plan_named(uid), plans[-1] if plans else None
        if sent is None and newest is not None and not (uid and uid == newest.plan_before):
            is_open = newest.awaited or (newest.phase is Phase.WITHDRAWN and not newest.is_in_effect)
            sent = newest if is_open else None
        if sent is not None and not sent.may_be_reported(now):
            sent = None
        for one in plans:
            if one is not sent and one.is_in_effect:
                one.ended_at = now
                one.apply(Event.OVER)  # the drone plays one plan at a time
        foreign = self._foreign
        if sent is not None:
            sent.target = uid or sent.target
            if not sent.is_in_effect:
                sent.begun_at = now
            sent.apply(Event.EXECUTED)
            if foreign is not None:
                foreign.ended_at = min(foreign.ended_at, now)
        elif foreign is None or foreign.target != uid or foreign.ended_at < math.inf:
            is_unknown = self._plan_named(uid) is None and (foreign is None or foreign.target != uid)
            line = UNKNOWN_LINE if is_unknown else self.newest_line(uid)
            self._foreign = SentCommand(Slot.PLAN, uid, phase=Phase.ENDED, line=line, begun_at=now)
        return sent

    def attribute_line(self, line: int, now: float) -> tuple[SentCommand | None, bool]:
        """Note an executed line; return the start whose plan it is of, and whether it is late.

        See `plan_of_line`.
        """
        sent, is_late = self.plan_of_line(line, now)
        if sent is not None:
            sent.line = max(sent.line, line)
        return sent, is_late

    def plan_of_line(self, line: int, now: float) -> tuple[SentCommand | None, bool]:
        """Return the start whose plan a reported line is of, and whether the line is late.

        None: no start of this program. A late line is of the plan before the newest one.

        The events have the number of the line alone. Lines of a plan are reported in their order, maybe after
        the next plan has begun. One that repeats or follows the newest line of the plan before, and does not follow
        that of the plan that plays, is therefore one of the plan before. One that neither repeats nor follows it, and
        that the newest start begins with, precedes the report that the plan of that start plays. So does one that the
        newest start begins with after the end of a plan of which no line was reported.
        """
        plans, foreign = self._slots[Slot.PLAN], self._foreign
        started = [one for one in plans if one.begun_at > -math.inf]
        begun = sorted([*started, *([foreign] if foreign is not None else [])], key=attrgetter("begun_at"))
        before, sent = [None, None, *begun][-2:]
        unbegun = plans[-1] if plans and plans[-1].begun_at == -math.inf else None
        if unbegun is not None and line == unbegun.line + 1:
            has_lineless_end = sent is not None and sent.line == UNKNOWN_LINE and sent.ended_at < math.inf
            if sent is None or has_lineless_end or not sent.continues(line, now):
                return unbegun, False
        if sent is None or before is None or sent.line == UNKNOWN_LINE or line == sent.line + 1:
            return sent, False
        return (before, True) if before.continues(line, now) else (sent, False)

    def _attribute_stopped(self, uid: str, now: float) -> SentCommand | None:
        """PAUSED and STOPPED name the plan or nothing.

        - One that names another plan of this program than the one that plays is an older one.
        - Without a plan that plays it answers the command against a withdrawn start. That start may still begin.
        """
        plans, named, foreign = self._slots[Slot.PLAN], self._plan_named(uid), self._foreign
        playing = next((one for one in plans if one.is_in_effect), None)
        if foreign is not None and (playing is None or uid == foreign.target != playing.target):
            foreign.ended_at = min(foreign.ended_at, now)
        if playing is not None:
            if named is not None and named.target != playing.target:
                return named
            playing.ended_at = now
            playing.apply(Event.OVER)
            return playing
        for one in plans:
            one.answered = one.answered or one.phase is Phase.WITHDRAWN
        sent = named or (plans[-1] if plans else None)
        return None if sent is None or sent.awaited else sent

    def _attribute_start_error(self, now: float) -> SentCommand | None:
        """StartingErrorEvent names nothing.

        Starts are answered in their order, so it is the oldest's that the drone has received and not answered.
        Taken for the newer's, it would report a plan as refused that flies a moment later.
        """
        plans = self._slots[Slot.PLAN]
        open_ones = [one for one in plans if one.awaited or (not one.answered and now < one.reported_until)]
        sent = next((one for one in open_ones if one.delivered), open_ones[-1] if open_ones else None)
        if sent is not None:
            sent.apply(Event.REFUSED)
        return sent

    def _plan_named(self, uid: str) -> SentCommand | None:
        return next((one for one in reversed(self._slots[Slot.PLAN]) if one.target == uid), None)

"""The flight of a mission as a state machine. No I/O.

Everything that changes the flight of a mission is an event here: clients' requests, reports of the drone, the results
of what `MissionFlight`, the shell, does for the machine, and time. Each event method returns the effects that the
shell has to perform, in their order. `TRANSITIONS` is the law: an event that a state has no row for changes nothing.

A start is an `MissionAttempt`, a value that is compared by identity. What becomes of it (prepared, granted, playing,
confirmed, failed) is reported with the attempt, and counts only while that attempt is the machine's: what an older
attempt still reports changes nothing. What another controller starts has no attempt: ARSDK reports the name of the file
alone, so the mission's own file is recognised by that.

In the states of a start, `MissionPhase.rest` is the state of the mission meanwhile, and after the start has failed.
"""

from __future__ import annotations

import enum
import functools
import math
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Concatenate, ParamSpec, TypeAlias

from anafi_mav import geo, mav_enums, texts
from anafi_mav.drone.events import AltitudeChanged, GpsLocationChanged, Message
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import Course, FlightPlanFile, GatewayStep
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.mission.effects import (
    Acquire,
    Announce,
    DroneReport,
    Effect,
    Failure,
    FlyItem,
    MissionAttempt,
    Persist,
    Prepare,
    Prepared,
    Reached,
    Release,
    Select,
    SendText,
    StartFile,
    Suspend,
)
from anafi_mav.vehicle.mission.path import WayPoint, seconds_of_last_line, way_points
from anafi_mav.vehicle.mission.progress import ENDINGS, Mission, MissionProgress
from anafi_mav.vehicle.mission.record import MissionRecord

ARM_WAIT = 10.0
"""s that a mission waits for arming.

QGroundControl chooses the mode first and arms when it is shown.
"""

END_WAIT = 2.0
"""s within which a drone whose plan has ended has reported its lines, or begun its landing or return.

Or the other way round, within which one that has executed the last line has reported that its plan has ended. A last
line that takes time may be reported when it begins: that time is added.
"""

POSITION_WAIT = 10.0
"""s after that end within which a position must be received that proves the drone at its last way point.

An ANAFI reports its location once a second, and no report is repeated. Of ten, a link that loses half of them loses all
in one case of a thousand.
"""

PROOF: frozenset[type[Message]] = frozenset({GpsLocationChanged, AltitudeChanged})
"""Reports of which the drone's position is made."""

GPS_MARGIN = 2.0
"""m beyond the radius of a way point at which a drone that has stopped there may report itself."""


class State(enum.Enum):
    NO_MISSION = "no mission stored"
    READY = "not begun"
    AWAIT_ARM = "mode Mission is chosen on the ground, and its client has to arm"
    PREPARING = "that client has armed, and the files are translated and uploaded"
    TAKING_OVER = "the files are on the drone, and control is acquired"
    STARTING = "the drone is commanded to fly a file, and has not confirmed it"
    FLYING_FILE = "the drone flies a file"
    FLYING_ITEM = "the gateway flies an item, or loads the next file"
    ENDING = "the drone has stopped its file, lands or returns, without a report of the last line"
    PAUSED = "begun and then stopped"
    COMPLETE = "flown completely"


class Event(enum.Enum):
    UPLOADED = "another mission is uploaded"
    CLEARED = "the mission is deleted"
    UPLOADED_AGAIN = "the same mission is uploaded again"
    CHOSEN = "a client sets the current item"
    ENGAGED = "a client chooses mode Mission on the ground, disarmed"
    ARMED = "that client arms"
    PREPARED = "the files of a start are on the drone"
    GRANTED = "control is acquired"
    CONFIRMED = "the command that starts the file is confirmed"
    FAILED = "a start or an item fails, is cancelled, or is not confirmed in time"
    PLAYING = "the drone reports that it flies the file of this start"
    RESUMED = "the drone reports that another controller lets it fly the mission's file"
    OTHER_PLAYING = "the drone reports that it flies another plan"
    HALTED = "the drone reports its plan as paused or stopped"
    EXECUTED = "the drone reports an executed line"
    SKIPPED = "the drone leaves a line out"
    ITEM_FLOWN = "the gateway has flown an item"
    REPORTED = "the drone reports its position, a landing or a return"
    CONTROL_LOST = "another flight task, a landing or a return is active"
    TIMEOUT = "the state has lasted too long"
    LINK_DOWN = "the link is lost"
    LINK_UP = "the link is there again, or the gateway is a new one"


S, E = State, Event
_REST = (S.READY, S.PAUSED, S.COMPLETE)
_ANY_REST = (S.NO_MISSION, *_REST)
_NEXT = (S.FLYING_ITEM, S.COMPLETE, S.PAUSED)
"""After a file or an item: the next one, the end, or a stop before what the drone cannot fly alone."""


def _common(state: State) -> dict[Event, tuple[State, ...]]:
    """Return the events that each state with a mission has, most of them with these results."""
    return {
        E.UPLOADED: (S.READY,),
        E.CLEARED: (S.NO_MISSION,),
        E.UPLOADED_AGAIN: (state,),
        E.PREPARED: (S.TAKING_OVER,),
    }


TRANSITIONS: dict[State, dict[Event, tuple[State, ...]]] = {
    S.NO_MISSION: {
        E.UPLOADED: (S.READY,),
        E.CLEARED: (S.NO_MISSION,),
        E.OTHER_PLAYING: (S.NO_MISSION,),
        E.LINK_DOWN: (S.NO_MISSION,),
    },
    S.READY: {
        **_common(S.READY),
        E.CHOSEN: (S.READY,),
        E.ENGAGED: (S.AWAIT_ARM,),
        E.RESUMED: (S.FLYING_FILE,),
        E.OTHER_PLAYING: (S.READY,),
        E.LINK_DOWN: (S.READY,),
        E.LINK_UP: (S.READY, S.FLYING_FILE, S.PAUSED, S.COMPLETE),
    },
    S.AWAIT_ARM: {
        **_common(S.AWAIT_ARM),
        E.CHOSEN: (S.AWAIT_ARM,),
        E.ENGAGED: (S.AWAIT_ARM,),
        E.ARMED: (S.PREPARING,),
        E.RESUMED: (S.FLYING_FILE,),
        E.OTHER_PLAYING: (S.AWAIT_ARM,),
        E.CONTROL_LOST: _REST,
        E.TIMEOUT: _REST,
        E.LINK_DOWN: _REST,
    },
    S.PREPARING: {
        **_common(S.PREPARING),
        E.UPLOADED: (S.PREPARING, S.READY),
        E.FAILED: _REST,
        E.OTHER_PLAYING: (S.PREPARING,),
        E.CONTROL_LOST: _REST,
        E.LINK_DOWN: _REST,
    },
    S.TAKING_OVER: {
        **_common(S.TAKING_OVER),
        E.GRANTED: (S.STARTING, S.FLYING_ITEM),
        E.FAILED: _REST,
        E.LINK_DOWN: _REST,
    },
    S.STARTING: {
        **_common(S.STARTING),
        E.FAILED: _REST,
        E.PLAYING: (S.FLYING_FILE,),
        E.CONTROL_LOST: _REST,
        E.LINK_DOWN: _REST,
    },
    S.FLYING_FILE: {
        **_common(S.FLYING_FILE),
        E.CONFIRMED: (S.FLYING_FILE,),
        E.FAILED: (S.PAUSED,),
        E.OTHER_PLAYING: (S.PAUSED,),
        E.HALTED: (*_NEXT, S.ENDING),
        E.EXECUTED: (S.FLYING_FILE,),
        E.SKIPPED: (S.FLYING_FILE,),
        E.REPORTED: (S.FLYING_FILE, S.ENDING, S.COMPLETE),
        E.CONTROL_LOST: (S.PAUSED, S.COMPLETE),
        E.TIMEOUT: (S.FLYING_FILE, *_NEXT),
        E.LINK_DOWN: (S.PAUSED,),
    },
    S.FLYING_ITEM: {
        **_common(S.FLYING_ITEM),
        E.PREPARED: (S.STARTING, S.FLYING_ITEM, S.TAKING_OVER),
        E.FAILED: (S.PAUSED,),
        E.OTHER_PLAYING: (S.PAUSED,),
        E.ITEM_FLOWN: (S.FLYING_ITEM, S.COMPLETE),
        E.CONTROL_LOST: (S.PAUSED,),
        E.LINK_DOWN: (S.PAUSED,),
    },
    S.ENDING: {
        **_common(S.ENDING),
        E.RESUMED: (S.FLYING_FILE,),
        E.OTHER_PLAYING: (S.PAUSED,),
        E.EXECUTED: (S.ENDING, *_NEXT),
        E.SKIPPED: (S.ENDING,),
        E.REPORTED: (S.ENDING, *_NEXT),
        E.CONTROL_LOST: (S.PAUSED,),
        E.TIMEOUT: (S.ENDING, *_NEXT),
        E.LINK_DOWN: (S.PAUSED,),
    },
    S.PAUSED: {
        **_common(S.PAUSED),
        E.UPLOADED_AGAIN: (S.READY,),
        E.CHOSEN: (S.PAUSED,),
        E.ENGAGED: (S.AWAIT_ARM,),
        E.RESUMED: (S.FLYING_FILE,),
        E.OTHER_PLAYING: (S.PAUSED,),
        E.HALTED: (S.PAUSED,),
        E.EXECUTED: (S.PAUSED, S.COMPLETE),
        E.LINK_DOWN: (S.PAUSED,),
        E.LINK_UP: (S.FLYING_FILE, S.PAUSED, S.COMPLETE),
    },
    S.COMPLETE: {
        **_common(S.COMPLETE),
        E.UPLOADED_AGAIN: (S.READY,),
        E.CHOSEN: (S.READY,),
        E.ENGAGED: (S.AWAIT_ARM,),
        E.OTHER_PLAYING: (S.COMPLETE,),
        E.LINK_DOWN: (S.COMPLETE,),
    },
}
"""The states that an event may lead to. A missing pair is ignored: it reports what no longer counts."""

FLYING = frozenset({S.FLYING_FILE, S.FLYING_ITEM, S.ENDING})

MAVLINK_STATES = {
    S.NO_MISSION: mav_enums.MISSION_STATE_NO_MISSION,
    S.READY: mav_enums.MISSION_STATE_NOT_STARTED,
    **dict.fromkeys(FLYING, mav_enums.MISSION_STATE_ACTIVE),
    S.PAUSED: mav_enums.MISSION_STATE_PAUSED,
    S.COMPLETE: mav_enums.MISSION_STATE_COMPLETE,
}


@dataclass(frozen=True)
class MissionPhase:
    """The state, and the facts that live as long as it."""

    state: State
    rest: State
    """What the mission is during a start, and when it fails; in the other states the state itself."""
    attempt: MissionAttempt | None = None
    """The start or continuation under way."""
    prepared: Prepared | None = None
    client: Hashable = None
    """AWAIT_ARM: who has to arm."""
    until: float = math.inf
    """When TIMEOUT is due."""
    interrupts: bool = False
    """The start has interrupted the flight of the mission."""
    again: bool = False
    """The same mission was uploaded during the start: if it fails, nothing of that mission has been flown."""
    has_landed: bool = False
    """ENDING: the drone has begun to land."""
    missing: frozenset[type[Message]] = frozenset()
    """ENDING: parts of the position that have not been received since the drone stopped."""
    waits_for_position: bool = False
    """ENDING: only a position is missing for the decision."""
    plays: str | None = None
    """The plan that another controller lets the drone fly."""
    may_end_late: bool = False
    """PAUSED: the drone stopped its plan. Its lines still count, and the last one completes the mission."""
    stops: bool = False
    """PAUSED: the drone has been commanded to pause its file, and has not reported that. Lines count until then."""


P = ParamSpec("P")
_Steps: TypeAlias = Iterator[Effect]


def _on(
    event: Event,
) -> Callable[
    [Callable[Concatenate[MissionMachine, P], _Steps]], Callable[Concatenate[MissionMachine, P], list[Effect]]
]:
    """Run a method as this event: not at all where the state has no such event."""

    def wrap(
        method: Callable[Concatenate[MissionMachine, P], _Steps],
    ) -> Callable[Concatenate[MissionMachine, P], list[Effect]]:
        @functools.wraps(method)
        def step(self: MissionMachine, /, *args: P.args, **kwargs: P.kwargs) -> list[Effect]:
            if event not in TRANSITIONS[self.phase.state]:
                return []
            before, flew = self.progress, self.phase.rest in FLYING
            effects = [*method(self, *args, **kwargs)]
            # What the drone flies alone while the link is lost is not known yet.
            return effects if event is E.LINK_DOWN else effects + self._kept(before, flew)

        return step

    return wrap


class MissionMachine:
    """The mission of one vehicle, how far it is, and what becomes of it."""

    def __init__(self) -> None:
        self.mission = Mission()
        self.progress = MissionProgress()
        self.phase = MissionPhase(S.NO_MISSION, S.NO_MISSION)
        self._flown_plan: str | None = None
        """The newest plan that is flown completely, also if the drone has not reported its end; None: none.

        That is no progress of the mission, which may have been replaced since.
        """

    @property
    def state(self) -> State:
        return self.phase.state

    @property
    def rest(self) -> State:
        """The state without a start under way: NO_MISSION, READY, PAUSED, COMPLETE or flown."""
        return self.phase.rest

    @property
    def flying(self) -> bool:
        """The mission is flown, by the drone or by the gateway."""
        return self.phase.rest in FLYING

    @property
    def is_untouched(self) -> bool:
        """True while the mission has not begun and no client has set its current item."""
        return self.phase.rest is S.READY and not self.progress.chosen

    @property
    def first(self) -> int:
        """The item that a start begins with: the current one, and the first again after the end."""
        return 0 if self.rest is S.COMPLETE else self.progress.current

    def is_at(self, item: int) -> bool:
        """Return True while this item is flown, with all turns of every loop to come.

        False in a plan that the drone was found flying, or that another controller has resumed: it may be further.
        """
        is_flown = self.state in (S.FLYING_FILE, S.FLYING_ITEM) and self.phase.plays is None
        return is_flown and self.progress.current == item and not self.progress.jumps

    @property
    def ending(self) -> bool:
        """The drone is at the line that lands or returns, or has executed it.

        Not on the way to the place of a landing: a landing or return that begins there is not the plan's.
        """
        return self.begins_with_landing or (self.flying and self._ends_with(*ENDINGS))

    @property
    def begins_with_landing(self) -> bool:
        """The drone is commanded to fly a file that lands where it is.

        It may report the landing before it reports that it flies the file.
        """
        prepared = self.phase.prepared
        if self.state is not S.STARTING or prepared is None:
            return False
        leg = prepared.course.parts[0]
        if not isinstance(leg, FlightPlanFile) or any(way_points(leg, prepared.line)):
            return False
        return self.mission.items[leg.origins[-1]].command == mav_enums.MAV_CMD_NAV_LAND

    @property
    def returning(self) -> bool:
        """The same, and that line is a return."""
        return self.flying and self._ends_with(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def _ends_with(self, *commands: int) -> bool:
        """The file's last line is the present one, or is executed, and is of one of these commands."""
        progress, leg = self.progress, self.progress.leg
        if leg is None or not (progress.leg_done or progress.at_last_line):
            return False
        return self.mission.items[leg.origins[-1]].command in commands

    @property
    def returned(self) -> bool:
        """The drone has executed the whole file, and its last line was a return."""
        leg = self.progress.leg
        if leg is None or not self.progress.leg_done or not (self.flying or self.rest is S.COMPLETE):
            return False
        return self.mission.items[leg.origins[-1]].command == mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH

    def has_flown(self, uid: str | None) -> bool:
        """Return True for a plan that is over, though the drone has not reported its end.

        Such a drone goes on reporting that it flies it. False once that plan is started again.
        """
        return uid is not None and uid == self._flown_plan

    @property
    def leads_home(self) -> bool:
        """The file that is flown, or about to be, has a return as its last line."""
        return self._ends_in(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def may_land(self, place: GeoPoint | None) -> bool:
        """Return True if a landing that begins at this place may be that of the file's last line.

        Lines may be reported after it, and the start of the file, too: until then only a landing where the file lands.
        """
        prepared, leg = self.phase.prepared, self._file
        if leg is None or not self._leads_down:
            return False
        if self.state is not S.STARTING or prepared is None:
            return True
        return all(_is_above(point, place) for point in way_points(leg, prepared.line))

    def lands_at(self, place: GeoPoint | None) -> bool:
        """Return True if the file that is flown, or about to be, lands at this place.

        Not on the way to its last way point.
        """
        return self._file_lands_at(self._file, place)

    def _file_lands_at(self, leg: FlightPlanFile | None, place: GeoPoint | None) -> bool:
        if leg is None or self.mission.items[leg.origins[-1]].command != mav_enums.MAV_CMD_NAV_LAND:
            return False
        points = [*way_points(leg)]
        return not points or _is_above(points[-1], place)

    @property
    def _leads_down(self) -> bool:
        """The file that is flown, or about to be, has a landing as its last line."""
        return self._ends_in(mav_enums.MAV_CMD_NAV_LAND)

    @property
    def _file(self) -> FlightPlanFile | None:
        """The file that is flown, or about to be."""
        leg: object = self.progress.leg if self.state in (S.FLYING_FILE, S.ENDING) else None
        if self.state is S.STARTING and self.phase.prepared is not None:
            leg = self.phase.prepared.course.parts[0]
        return leg if isinstance(leg, FlightPlanFile) else None

    def _ends_in(self, command: int) -> bool:
        """Return True if the file that is flown, or about to be, ends with this command."""
        leg = self._file
        return leg is not None and self.mission.items[leg.origins[-1]].command == command

    @property
    def needs_gimbal(self) -> bool:
        """True while the mission is flown and an item to come needs the gimbal."""
        return self.flying and self.mission.payload.needs_gimbal(self.progress.current, self.progress.jumps)

    @property
    def needs_camera(self) -> bool:
        """True while the mission is flown and an item to come needs the camera."""
        return self.flying and self.mission.payload.needs_camera(self.progress.current, self.progress.jumps)

    def deadline(self) -> float | None:
        """Return when `timeout` is due (s, monotonic); None: never."""
        return None if self.phase.until == math.inf else self.phase.until

    def attempt(self, item: int | None = None) -> MissionAttempt:
        """Return a new attempt: from an item on with its loops restarted; None: the current item."""
        if item is None:
            return MissionAttempt(self.mission, self.first, self.progress.jumps)
        return MissionAttempt(self.mission, item, {})

    # Requests of clients.

    def upload(self, items: Sequence[Item], identity: int) -> list[Effect]:
        """Another mission was uploaded, or the mission was deleted. One that is flown is stopped."""
        mission = Mission(items, identity)
        return self._uploaded(mission) if mission.items else self._cleared(mission)

    @_on(E.UPLOADED)
    def _uploaded(self, mission: Mission) -> _Steps:
        yield from self._replace(mission, S.READY, texts.MISSION_REPLACED)

    @_on(E.CLEARED)
    def _cleared(self, mission: Mission) -> _Steps:
        yield from self._replace(mission, S.NO_MISSION, texts.MISSION_CLEARED)

    def _replace(self, mission: Mission, rest: State, why: OperatorText) -> _Steps:
        phase, flew, paused = self.phase, self.flying, self._paused_text(why)
        known = self.mission.identity != 0  # else it has just been read, and the stored record has not been looked at
        self.mission, self.progress = mission, MissionProgress()
        if known:
            yield Persist(None)
        attempt = phase.attempt
        if phase.state is S.PREPARING and attempt is not None and attempt.awaits_upload and mission.items:
            attempt = replace(self.attempt(), unattended=True)
            self.phase = replace(phase, rest=rest, attempt=attempt)
            yield Prepare(attempt)
            return
        if flew:
            yield paused
        elif phase.state is S.AWAIT_ARM or (attempt is not None and attempt.unattended):
            yield SendText(Severity.WARNING, texts.MISSION_NOT_STARTED.fill(reason=why))
        self._be(rest)
        if flew or phase.state is S.STARTING:
            yield Suspend(starting=phase.state is S.STARTING)
        if phase.state not in _ANY_REST:
            yield Release()

    @_on(E.UPLOADED_AGAIN)
    def upload_again(self) -> _Steps:
        """The same mission was uploaded once more: a flight or a start goes on.

        Otherwise it is a new mission, of which nothing has been flown.
        """
        phase = self.phase
        if not (self.flying or phase.attempt is not None):
            if self.mission.items:
                self._renew()
                self._rest_at(S.READY)
                yield Persist(None)
            return
        current = self.progress.current
        if phase.prepared is not None and phase.state is not S.FLYING_FILE:
            current = _head_item(phase.prepared)
        elif not self.flying and phase.attempt is not None:
            current = phase.attempt.item
        self.phase = replace(phase, again=not self.flying)
        yield SendText(Severity.INFO, texts.MISSION_SAME.fill(item=current + texts.FIRST_LABEL))

    @_on(E.CHOSEN)
    def choose(self, item: int) -> _Steps:
        """Make an item the current one of a mission that does not fly.

        Raises `ValueError` on wrong arguments of ours: `item` must be one of the mission's.
        """
        if not 0 <= item < len(self.mission.items):
            raise ValueError(f"the mission has no item {item}")
        self.progress = MissionProgress(item, chosen=True, left=self._paused_file(), kept=self.progress.kept)
        self._rest_at(S.READY if self.rest is S.COMPLETE else self.rest)
        yield from ()

    @_on(E.ENGAGED)
    def await_arm(self, client: Hashable, now: float) -> _Steps:
        """Control was acquired on the ground: wait until this client arms."""
        self.phase = MissionPhase(S.AWAIT_ARM, self.rest, client=client, until=now + ARM_WAIT)
        yield Select()

    def armed(self, client: Hashable, *, storing: bool = False) -> list[Effect]:
        """A client has armed. `storing`: a new mission is being stored, which is meant."""
        return self._armed(storing) if client == self.phase.client else []

    @_on(E.ARMED)
    def _armed(self, storing: bool) -> _Steps:
        attempt = replace(self.attempt(), unattended=True, awaits_upload=storing)
        self.phase = MissionPhase(S.PREPARING, self.rest, attempt)
        yield Prepare(attempt)

    # Results of work.

    def holds(self, attempt: MissionAttempt) -> bool:
        """True while what becomes of this attempt counts."""
        asked = attempt.course is None and not attempt.unattended and attempt.mission is self.mission
        return asked or self.phase.attempt is attempt

    def prepared(self, attempt: MissionAttempt, prepared: Prepared) -> list[Effect]:
        """The parts of an attempt are laid out, and its first file is on the drone."""
        return self._prepared(attempt, prepared) if self.holds(attempt) else []

    @_on(E.PREPARED)
    def _prepared(self, attempt: MissionAttempt, prepared: Prepared) -> _Steps:
        phase = self.phase
        if attempt.course is not None:
            yield from self._begin_part(attempt, prepared)
            return
        if self.flying or phase.state is S.STARTING:
            yield Suspend(starting=phase.state is S.STARTING)
        self.phase = MissionPhase(
            S.TAKING_OVER,
            S.PAUSED if self.flying else self.rest,
            attempt,
            prepared,
            interrupts=self.flying or phase.interrupts,
            again=phase.again and phase.attempt is attempt,
        )
        yield Acquire(attempt, prepared)

    def granted(self, attempt: MissionAttempt) -> list[Effect]:
        """Control is acquired, and the drone hovers or stands."""
        return self._granted(attempt) if self.phase.attempt is attempt else []

    @_on(E.GRANTED)
    def _granted(self, attempt: MissionAttempt) -> _Steps:
        prepared = self.phase.prepared
        assert prepared is not None, "TAKING_OVER has it"
        self.progress = replace(self.progress, left=None)
        yield Select()
        yield from self._begin_part(attempt, prepared)

    def _begin_part(self, attempt: MissionAttempt, prepared: Prepared) -> _Steps:
        """Begin with the first part: the drone with a file, or the gateway with an item."""
        head = prepared.course.parts[0]
        if isinstance(head, FlightPlanFile):
            self.phase = replace(self.phase, state=S.STARTING, attempt=attempt, prepared=prepared)
            yield StartFile(attempt, prepared)
            return
        self.progress = replace(self.progress.at_item(head.item), course=prepared.course, jumps=attempt.jumps)
        self.phase = MissionPhase(S.FLYING_ITEM, S.FLYING_ITEM, attempt)
        if attempt.course is None:
            yield Announce(head.item, resumes=False, stepped=True)
        yield FlyItem(attempt, head.item)

    def confirmed(self, attempt: MissionAttempt) -> list[Effect]:
        """The command that starts the file was confirmed, after `playing`."""
        return self._confirmed(attempt) if self.phase.attempt is attempt else []

    @_on(E.CONFIRMED)
    def _confirmed(self, attempt: MissionAttempt) -> _Steps:
        prepared = self.phase.prepared
        self.phase = MissionPhase(S.FLYING_FILE, S.FLYING_FILE, until=self.phase.until)
        if attempt.course is None and prepared is not None:
            yield Announce(_head_item(prepared), prepared.resumes, prepared.course.stepped)

    def failed(self, attempt: MissionAttempt, failure: Failure | None) -> list[Effect]:
        """The work of an attempt has failed, or was cancelled (None).

        `drone` stops what the drone begins of it late.
        """
        return self._failed(failure) if self.phase.attempt is attempt else []

    @_on(E.FAILED)
    def _failed(self, failure: Failure | None) -> _Steps:
        yield from self._end(failure)
        yield Release()

    def _end(self, failure: Failure | None = None) -> _Steps:
        """End a start, a flight or a wait: a flown mission is paused, another is as before."""
        phase, rest, flew = self.phase, self.rest, self.flying
        if phase.again and not flew:
            self._renew()
            rest = S.READY
        self._be(S.PAUSED if flew else rest)
        if failure is not None and phase.attempt is not None and phase.attempt.unattended:
            yield SendText(Severity.ERROR, failure.text)
        if flew or phase.interrupts:
            yield self._paused_text(failure.reason if flew and failure is not None else None)

    def item_flown(self, attempt: MissionAttempt) -> list[Effect]:
        """The gateway has flown the item of an attempt."""
        return self._item_flown() if self.phase.attempt is attempt else []

    @_on(E.ITEM_FLOWN)
    def _item_flown(self) -> _Steps:
        head = self.progress.course.parts[0]
        assert isinstance(head, GatewayStep), "an item of the gateway was flown"
        self.progress = self.progress.with_done(self.mission.items, head.done)
        for item in head.done:
            yield Reached(item)
        yield from self._part_over()

    # Reports of the drone.

    def playing(
        self, uid: str, attempt: MissionAttempt | None, now: float = math.inf, *, line: int = -1
    ) -> list[Effect]:
        """The drone flies the plan of this name; it may report that twice.

        `attempt` has started it; None: another controller. `line`: the newest one that it has reported already.
        """
        if attempt is not None and attempt is not self.phase.attempt:
            return []
        self._flown_plan = None
        if attempt is not None:
            return self._playing(attempt, line, now)
        if uid == self.phase.plays:
            return []
        known = self._paused_file()
        return self._other_playing(uid) if known is None or uid != known.uid else self._resumed(known, now)

    @_on(E.PLAYING)
    def _playing(self, attempt: MissionAttempt, line: int, now: float) -> _Steps:
        prepared = self.phase.prepared
        assert prepared is not None, "STARTING has it"
        leg = prepared.course.parts[0]
        assert isinstance(leg, FlightPlanFile), "STARTING begins a file"
        jumps = self.progress.jumps if prepared.resumes else attempt.jumps
        progress = self.progress.in_file(prepared.uid, leg, prepared.line)
        self.progress = replace(progress, course=prepared.course, jumps=jumps)
        self.phase = MissionPhase(S.FLYING_FILE, S.FLYING_FILE, attempt, prepared)
        for executed in range(prepared.line + 1, min(line + 1, len(leg.origins))):
            yield from self._execute(executed)
            self._limit(now)

    @_on(E.RESUMED)
    def _resumed(self, known: MissionProgress, now: float) -> _Steps:
        """Show the mission as flown: a client that looks at it has to see that."""
        self.progress = replace(known, left=None, kept=self.progress.kept)
        self.phase = MissionPhase(S.FLYING_FILE, S.FLYING_FILE, plays=known.uid)
        self._limit(now)
        yield Select()
        yield SendText(Severity.NOTICE, texts.MISSION_RESUMED_ELSEWHERE)

    @_on(E.OTHER_PLAYING)
    def _other_playing(self, uid: str) -> _Steps:
        if self.flying:
            yield from self._stop(texts.MISSION_OTHER_PLAN)
        else:
            yield SendText(Severity.NOTICE, texts.OTHER_PLAN)
        self.phase = replace(self.phase, may_end_late=False, stops=False, plays=uid)

    def halted(self, *, stopped: bool, report: DroneReport, now: float) -> list[Effect]:
        """The drone reports its plan as paused, or as `stopped`."""
        self.phase, self._flown_plan = replace(self.phase, plays=None, stops=False), None
        return self._halted(stopped=stopped, report=report, now=now)

    @_on(E.HALTED)
    def _halted(self, *, stopped: bool, report: DroneReport, now: float) -> _Steps:
        if self.phase.state is S.PAUSED:
            return  # by a client's command, which the drone has carried out now
        descends = report.returns_by_plan or (self.ending and self.progress.at_last_line)
        if self.progress.leg_done:
            yield from self._part_over()
        elif report.pilot and not (stopped and descends):
            yield from self._stop(texts.MISSION_PILOT)
        elif stopped:
            yield from self._await_end(report, now)
        else:
            yield from self._stopped_by_drone(stopped=False)

    @_on(E.EXECUTED)
    def executed(self, line: int, now: float = math.inf) -> _Steps:
        """The drone reports that it has executed a line of its file."""
        leg, state = self.progress.leg, self.phase.state
        late = state is S.PAUSED
        is_last = leg is not None and line == len(leg.origins) - 1
        if late and (self.phase.stops or self.phase.may_end_late) and not is_last:
            yield from self._execute(line)  # before the drone has heard of the pause, or stopped
            return
        if late and not (self.phase.may_end_late and is_last):
            return
        yield from self._execute(line)
        if late:  # and no other mode: another flight task may be active by now
            yield from self._complete()
        elif state is S.ENDING and self.progress.leg_done:
            yield from self._part_over()
        elif is_last and state is S.FLYING_FILE:
            self._limit(now)

    def _limit(self, now: float) -> None:
        """Set the deadline for the end of a file whose lines are all executed."""
        leg = self.progress.leg
        if leg is not None and self.progress.leg_done and not self.ending:
            self.phase = replace(self.phase, until=now + END_WAIT + seconds_of_last_line(leg))

    def _execute(self, line: int) -> _Steps:
        self.progress, done = self.progress.with_executed(self.mission.items, line)
        for item in done:
            yield Reached(item)

    @_on(E.SKIPPED)
    def skipped(self, line: int) -> _Steps:
        """The drone has left out a line of its file."""
        self.progress, item = self.progress.with_skipped(line)
        if item is not None:
            yield SendText(Severity.WARNING, texts.MISSION_OUT_OF_REACH.fill(item=item + texts.FIRST_LABEL))

    @_on(E.REPORTED)
    def reported(self, report: DroneReport, now: float, kind: type[Message] | None = None) -> _Steps:
        """The drone has reported a landing, a return, an alert, or (`kind`) a part of its position."""
        phase = self.phase
        if phase.state is S.FLYING_FILE:
            if self.progress.leg_done:  # its last line may be executed before the drone reports its plan as stopped
                if self.ending and report.lands_or_returns:
                    yield from self._part_over()
            elif (report.lands and self._leads_down) or (report.returns_by_plan and self.leads_home):
                yield from self._await_end(report, now)
            return
        if kind is None:
            self.phase = replace(phase, has_landed=phase.has_landed or report.lands)
            yield from self._look(report)
            return
        self.phase = replace(phase, missing=phase.missing - {kind})
        if phase.waits_for_position and not self.phase.missing:
            yield from self._look(report, last=True)

    @_on(E.CONTROL_LOST)
    def control_lost(self, *, lands: bool = False) -> _Steps:
        """Another flight task, a landing or a return is active.

        In TAKING_OVER it is our own acquisition. Another one cancels that work, and its end is an event. `lands`: the
        drone lands, and no client has commanded that. Lines of the file may be reported late: the last one shows then
        that the landing was the plan's.
        """
        state, flew, course = self.state, self.flying, self.progress.course
        is_last_part = course.following is None and course.later is None
        if state is S.FLYING_FILE and self.progress.leg_done and is_last_part and not self.ending:
            self._flown_plan = self.progress.uid  # only the end of its plan was not reported yet
            yield from self._complete()
            yield Suspend(starting=False)
            return
        yield from self._end()
        if state is S.FLYING_FILE:
            late = lands and self.progress.course.following is None
            self.phase = replace(self.phase, stops=True, may_end_late=late)
        if flew or state is S.STARTING:
            yield Suspend(starting=state is S.STARTING)

    # Time and the link.

    @_on(E.TIMEOUT)
    def timeout(self, report: DroneReport) -> _Steps:
        """The deadline has passed."""
        phase = self.phase
        match phase.state:
            case S.AWAIT_ARM:
                self._be(self.rest)
                why = texts.NOT_ARMED_WITHIN.fill(seconds=ARM_WAIT)
                yield Release()
                yield SendText(Severity.WARNING, texts.MISSION_NOT_STARTED.fill(reason=why))
            case S.ENDING if self._flown(report) is None and not phase.waits_for_position:
                self.phase = replace(phase, waits_for_position=True, until=phase.until + POSITION_WAIT - END_WAIT)
            case S.FLYING_FILE:  # its plan has ended, but that was not reported
                self.phase = replace(phase, until=math.inf)
                if self.progress.leg_done:
                    yield from self._part_over()
            case _:
                yield from self._look(report, last=True)

    @_on(E.LINK_DOWN)
    def link_down(self) -> _Steps:
        """The drone may fly on with the file that it has. What the gateway flies itself ends here."""
        self.progress = replace(self.progress, course=self.progress.course.ending_with_this_part())
        self._be(S.PAUSED if self.flying else self.rest)
        yield from ()

    @_on(E.LINK_UP)
    def link_up(
        self,
        record: MissionRecord | None,
        uid: str | None,
        now: float,
        *,
        plays: bool,
        in_air: bool,
        landing: GeoPoint | None = None,
    ) -> _Steps:
        """The drone is connected and reports its newest plan, and if it flies that.

        `record` is the stored one, `landing` where the drone lands, maybe by the plan; None: it does not.
        """
        if self.progress.leg is None and record is not None and record.mission == self.mission.identity:
            if uid != record.uid and not in_air:
                return
            progress = MissionProgress(self.progress.current).in_file(record.uid, record.leg, record.line)
            course = Course((record.leg,), later=record.next)
            self.progress = replace(progress, course=course, jumps=dict(record.jumps), kept=record)
            self._be(S.PAUSED)
        progress = self.progress
        if self.state is not S.PAUSED or progress.leg is None:
            return
        later = progress.course.later
        if progress.leg_done and later is not None:
            progress = self.progress = replace(progress, current=later)
        current = progress.current + texts.FIRST_LABEL
        lands = landing is not None and self._file_lands_at(progress.leg, landing)
        if plays and uid == progress.uid:
            self.phase = MissionPhase(S.FLYING_FILE, S.FLYING_FILE, plays=uid)
            self._limit(now)
            yield Select()
            yield SendText(Severity.NOTICE, texts.MISSION_FOUND_FLYING.fill(item=current))
        elif progress.leg_done and later is None:
            yield from self._complete()
        elif lands and later is None and uid in (None, "", progress.uid):
            self._flown_plan = progress.uid  # a plan that has stopped may have no name
            yield from self._complete()
            yield Release(lands=True)
        else:
            yield SendText(Severity.NOTICE, texts.MISSION_FOUND_PAUSED.fill(item=current))

    # Steps of several events.

    def _be(self, state: State) -> None:
        """Enter a state that has no further facts."""
        self.phase = MissionPhase(state, state)

    def _paused_file(self) -> MissionProgress | None:
        """Return the progress in a stopped file, which another controller may resume."""
        in_file = self.rest in (S.PAUSED, S.ENDING) and self.progress.leg is not None
        return self.progress if in_file else self.progress.left

    def _renew(self) -> None:
        """Nothing of the mission has been flown, but for a file that the drone has paused."""
        self.progress = MissionProgress(left=self._paused_file())

    def _rest_at(self, rest: State) -> None:
        """Let the mission be READY or PAUSED, also in a state that keeps this for later."""
        if self.state in _REST:
            self._be(rest)
        else:
            self.phase = replace(self.phase, rest=rest)

    def _paused_text(self, why: OperatorText | None) -> SendText:
        item = self.progress.current + texts.FIRST_LABEL
        if why is None:
            return SendText(Severity.INFO, texts.MISSION_PAUSED.fill(item=item))
        return SendText(Severity.WARNING, texts.MISSION_PAUSED_REASON.fill(item=item, reason=why))

    def _stop(self, why: OperatorText | None) -> _Steps:
        """Pause the mission for a reason that no client has commanded."""
        self._be(S.PAUSED)
        yield self._paused_text(why)
        yield Release()

    def _stopped_by_drone(self, *, stopped: bool) -> _Steps:
        """Pause the mission: the drone has stopped its plan, as far as its reports go."""
        yield from self._stop(texts.MISSION_STOPPED)
        late = stopped and self.progress.course.following is None
        self.phase = replace(self.phase, may_end_late=late)

    def _part_over(self) -> _Steps:
        """The first part is flown: begin the next one, or end the mission."""
        progress = self.progress
        self._flown_plan = progress.uid
        course = progress.course.without_first()
        following = course.first
        if following is None and course.later is not None:
            kept = progress.record(self.mission.identity)  # with the whole file
            ended = MissionProgress(course.later, jumps=progress.jumps, chosen=True, kept=kept)
            self.progress = ended
            yield from self._stop(texts.MISSION_LINK_LOST)
        elif following is None:
            lands = self._ends_with(mav_enums.MAV_CMD_NAV_LAND)
            yield from self._complete()
            yield Release(lands=lands)
        else:
            # When the mission is paused before the next part begins, the part before is not flown again.
            kept = progress.record(self.mission.identity)
            progress = self.progress = replace(progress.at_item(following), course=course, kept=kept)
            attempt = MissionAttempt(self.mission, following, progress.jumps, course)
            self.phase = MissionPhase(S.FLYING_ITEM, S.FLYING_ITEM, attempt)
            if course.parts and isinstance(course.parts[0], GatewayStep):
                yield FlyItem(attempt, following)
            else:
                yield Prepare(attempt)

    def _complete(self) -> _Steps:
        self.progress = replace(self.progress, jumps={}, left=None, kept=None, course=Course())
        self._be(S.COMPLETE)
        yield Persist(None)
        yield SendText(Severity.INFO, texts.MISSION_COMPLETE)

    def _kept(self, before: MissionProgress, flew: bool) -> list[Effect]:
        """Return the effect that stores the progress, if it has changed or the flight has ended."""
        rest = self.phase.rest
        stopped = flew and rest not in FLYING
        if rest not in FLYING and rest is not S.PAUSED and self.progress.kept is None:
            return []
        if self.progress is before and not stopped:
            return []
        record = self.progress.record(self.mission.identity)
        if record is None:
            return []
        self.progress = replace(self.progress, kept=record)
        return [Persist(record)] if record != before.kept or stopped else []

    # The end of a plan whose last line the drone has not reported.
    #
    # Parrot does not document if the last MissionItemExecuted precedes the state stopped, a landing or a return. All
    # lines may be late, and the last one absent. A last line that lands or returns is done when the drone has begun
    # that; one of another cause is not the mission's. Any other last line is done when the drone is at the last way
    # point and nothing is wrong. A position that was received before the drone stopped proves nothing: over a bad link
    # it may be seconds old.

    def _last_way_point(self) -> WayPoint | None:
        """Return the way point that a file ends at; None while other way points are left."""
        leg = self.progress.leg
        if leg is None:
            return None
        points, left = [*way_points(leg)], [*way_points(leg, self.progress.line)]
        return None if len(left) > 1 or not points else points[-1]

    def _await_end(self, report: DroneReport, now: float) -> _Steps:
        """Wait for late reports of lines, and judge the end of the file."""
        missing = PROOF
        if self.leads_home:
            missing = frozenset()
        elif self._leads_down:
            missing = frozenset({GpsLocationChanged})  # its height changes
        self.phase = MissionPhase(S.ENDING, S.ENDING, until=now + END_WAIT, has_landed=report.lands, missing=missing)
        yield from self._look(report)

    def _flown(self, report: DroneReport) -> bool | None:
        """Return True if the drone ends its file as planned; None: a position is missing for that."""
        at_last_line, lands = self.progress.at_last_line, self._leads_down
        if self.leads_home:
            return report.returns_by_plan or (at_last_line and report.lands_or_returns)
        if lands and at_last_line:
            return report.lands_or_returns
        if not self.phase.has_landed if lands else report.is_in_trouble:
            return False
        if (target := self._last_way_point()) is None:
            return False
        if self.phase.missing:
            return None
        return _is_above(target, report.place) if lands else _is_at(target, report)

    def _look(self, report: DroneReport, *, last: bool = False) -> _Steps:
        """Decide if the plan is complete. `last`: with what is known now."""
        flown, leg = self._flown(report), self.progress.leg
        if flown and leg is not None and (last or self.progress.at_last_line):
            yield from self._execute(len(leg.origins) - 1)
            yield from self._part_over()
        elif last or (report.is_in_trouble and not (self.leads_home or self._leads_down)):
            yield from self._stopped_by_drone(stopped=True)


def _is_at(target: WayPoint, report: DroneReport) -> bool:
    if report.place is None or report.ato is None:
        return False
    away = math.hypot(geo.distance(*report.place, *target.place), report.ato - target.ato)
    return away <= target.radius + GPS_MARGIN


def _is_above(target: WayPoint, place: GeoPoint | None) -> bool:
    """Return True above or below the way point."""
    return place is not None and geo.distance(*place, *target.place) <= target.radius + GPS_MARGIN


def _head_item(prepared: Prepared) -> int:
    """Return the item that a start begins with."""
    head = prepared.course.parts[0]
    return head.item if isinstance(head, GatewayStep) else head.origins[min(prepared.line + 1, len(head.origins) - 1)]

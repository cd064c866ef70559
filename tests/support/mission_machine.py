"""A mission machine in each of its states, and each event as a call of it."""

from __future__ import annotations

import random
from collections.abc import Callable

from anafi_mav import mav_enums, texts
from anafi_mav.drone.events import GpsLocationChanged
from anafi_mav.plans.plan import Item
from anafi_mav.plans.rules.parts import FlightPlanFile, GatewayStep
from anafi_mav.plans.translation.translate import Course
from anafi_mav.vehicle.mission.effects import (
    Acquire,
    DroneReport,
    Effect,
    Failure,
    FlyItem,
    MissionAttempt,
    Prepare,
    Prepared,
    StartFile,
    Work,
)
from anafi_mav.vehicle.mission.machine import Event, MissionMachine, State

NOW = 100.0
PLACE = "0\t3\t16\t0\t0\t0\t0\t48.0\t2.0\t10.0\t1"


def item(command: int) -> Item:
    return Item(command, 3, (None, None, None, None, 48.0, 2.0, 10.0))


JUMP = Item(mav_enums.MAV_CMD_DO_JUMP, 2, (1.0, 3.0, None, None, None, None, None))
ITEMS = (item(22), item(16), item(16), item(115), item(16), item(16))
"""A take-off, way points, a turn that the gateway flies, way points."""


def file(*origins: int) -> FlightPlanFile:
    """A file with a way point for each of these items."""
    lines = "".join(f"{line}\t{PLACE}\n" for line in range(len(origins)))
    return FlightPlanFile(f"QGC WPL 120\n{lines}".encode(), origins, tuple((origin,) for origin in origins))


LEG, TURN, REST = file(0, 1, 2), GatewayStep(3, (3,)), file(4, 5)
COURSE = Course((LEG, TURN, REST))
START, TURNS_FIRST, LAST = Prepared(COURSE, "a"), Prepared(Course((TURN, REST))), Prepared(Course((REST,)), "b")
FAILURE = Failure(texts.NO_MISSION_STORED, texts.NO_MISSION)
GONE, TROUBLE = DroneReport(), DroneReport(is_in_trouble=True)


def loaded() -> MissionMachine:
    machine = MissionMachine()
    machine.upload(ITEMS, 7)
    return machine


def taking_over(
    prepared: Prepared = START, machine: MissionMachine | None = None
) -> tuple[MissionMachine, MissionAttempt]:
    machine = machine or loaded()
    attempt = machine.attempt(3 if prepared is TURNS_FIRST else 4 if prepared is LAST else 0)
    machine.prepared(attempt, prepared)
    return machine, attempt


def starting(
    prepared: Prepared = START, machine: MissionMachine | None = None
) -> tuple[MissionMachine, MissionAttempt]:
    machine, attempt = taking_over(prepared, machine)
    machine.granted(attempt)
    return machine, attempt


def flying(prepared: Prepared = START, machine: MissionMachine | None = None) -> MissionMachine:
    """The drone flies the first file, or the gateway the first item."""
    machine, attempt = starting(prepared, machine)
    machine.playing(prepared.uid, attempt)
    machine.confirmed(attempt)
    return machine


def in_state(state: State) -> MissionMachine:
    """Return a machine in this state.

    In READY and AWAIT_ARM the drone has a file of the mission paused, in FLYING_FILE the start is not confirmed yet.
    """
    machine = MissionMachine() if state is State.NO_MISSION else loaded()
    match state:
        case State.READY:
            machine = in_state(State.PAUSED)
            machine.upload_again()
        case State.AWAIT_ARM | State.PREPARING:
            machine = in_state(State.READY)
            machine.await_arm("client", NOW)
            if state is State.PREPARING:
                machine.armed("client")
        case State.TAKING_OVER:
            taking_over(machine=machine)
        case State.STARTING:
            starting(machine=machine)
        case State.FLYING_FILE | State.PAUSED:
            _, attempt = starting(machine=machine)
            machine.playing("a", attempt)
            if state is State.PAUSED:
                machine.control_lost()
        case State.FLYING_ITEM:
            flying(TURNS_FIRST, machine)
        case State.ENDING | State.COMPLETE:
            flying(LAST, machine)
            machine.executed(0)
            if state is State.COMPLETE:
                machine.executed(1)
            machine.halted(stopped=True, report=GONE, now=NOW)
    assert machine.state is state, machine.state
    return machine


def calls(machine: MissionMachine) -> dict[Event, Callable[[], list[Effect]]]:
    """Return a call for each event, as it would usually follow."""
    attempt = machine.phase.attempt or machine.attempt()
    known = machine.progress.left or machine.progress
    new = machine.phase.attempt is None or machine.state in (State.STARTING, State.FLYING_FILE)
    start = machine.attempt(0) if new else attempt
    return {
        Event.UPLOADED: lambda: machine.upload((*ITEMS, item(16)), 8),
        Event.CLEARED: lambda: machine.upload((), 0),
        Event.UPLOADED_AGAIN: machine.upload_again,
        Event.CHOSEN: lambda: machine.choose(1),
        Event.ENGAGED: lambda: machine.await_arm("client", NOW),
        Event.ARMED: lambda: machine.armed("client"),
        Event.PREPARED: lambda: machine.prepared(start, LAST),
        Event.GRANTED: lambda: machine.granted(attempt),
        Event.CONFIRMED: lambda: machine.confirmed(attempt),
        Event.FAILED: lambda: machine.failed(attempt, FAILURE),
        Event.PLAYING: lambda: machine.playing("a", machine.phase.attempt),
        Event.RESUMED: lambda: machine.playing(known.uid, None),
        Event.OTHER_PLAYING: lambda: machine.playing("other", None),
        Event.HALTED: lambda: machine.halted(stopped=True, report=GONE, now=NOW),
        Event.EXECUTED: lambda: machine.executed(machine.progress.line + 1),
        Event.SKIPPED: lambda: machine.skipped(machine.progress.line + 1),
        Event.ITEM_FLOWN: lambda: machine.item_flown(attempt),
        Event.REPORTED: lambda: machine.reported(TROUBLE, NOW),
        Event.CONTROL_LOST: machine.control_lost,
        Event.TIMEOUT: lambda: machine.timeout(GONE),
        Event.LINK_DOWN: machine.link_down,
        Event.LINK_UP: lambda: machine.link_up(None, machine.progress.uid, NOW, plays=True, in_air=True),
    }


class RandomFlight:
    """Random events for a machine: reports of the drone, and results of work, also of attempts that no longer count."""

    def __init__(self, chance: random.Random, begin: MissionMachine) -> None:
        self.machine = MissionMachine()
        self.machine.mission, self.machine.progress, self.machine.phase = begin.mission, begin.progress, begin.phase
        self.now = NOW
        self._chance = chance
        self._works: list[Work] = []
        """Work under way, newest last."""
        if (attempt := begin.phase.attempt) is not None:
            works = {
                State.PREPARING: Prepare(attempt),
                State.TAKING_OVER: Acquire(attempt, START),
                State.STARTING: StartFile(attempt, START),
                State.FLYING_FILE: StartFile(attempt, START),
                State.FLYING_ITEM: FlyItem(attempt, 3),
            }
            self._works += [works[begin.state]] if begin.state in works else []

    def step(self) -> tuple[Event, list[Effect]]:
        """Let one event happen; return it and its effects."""
        event = self._chance.choice(_EVENTS)
        self.now += 0.5
        effects = self._happen(event)
        self._works = [*self._works[-3:], *(effect for effect in effects if isinstance(effect, Work))]
        return event, effects

    def _happen(self, event: Event) -> list[Effect]:
        chance, machine, now = self._chance, self.machine, self.now
        match event:
            case Event.UPLOADED:
                return machine.upload(ITEMS, 7)
            case Event.CHOSEN:
                return machine.choose(chance.randrange(6)) if machine.mission.items else []
            case Event.ENGAGED:
                return machine.await_arm("client", now)
            case Event.ARMED:
                return machine.armed(chance.choice(["client", "other"]), storing=chance.random() < 0.2)
            case Event.PLAYING | Event.RESUMED | Event.OTHER_PLAYING:
                begun = [work.attempt for work in self._works if isinstance(work, StartFile)]
                return machine.playing(chance.choice(["a", "b", "other"]), chance.choice([None, *begun]), now)
            case Event.HALTED:
                report = DroneReport(pilot=chance.random() < 0.1)
                return machine.halted(stopped=chance.random() < 0.7, report=report, now=now)
            case Event.EXECUTED:
                return machine.executed(chance.randrange(-1, 4), now)
            case Event.SKIPPED:
                return machine.skipped(chance.randrange(-1, 4))
            case Event.REPORTED:
                return machine.reported(chance.choice(REPORTS), now, chance.choice([None, GpsLocationChanged]))
            case Event.CONTROL_LOST:
                return machine.control_lost()
            case Event.TIMEOUT:
                return machine.timeout(chance.choice(REPORTS))
            case Event.LINK_UP:
                uid, plays = chance.choice(["a", "b", "other", None]), chance.random() < 0.5
                return machine.link_up(machine.progress.kept, uid, now, plays=plays, in_air=chance.random() < 0.5)
            case Event.PREPARED | Event.GRANTED | Event.CONFIRMED | Event.ITEM_FLOWN | Event.FAILED:
                return self._result(event)
        return calls(machine)[event]()

    def _result(self, event: Event) -> list[Effect]:
        """Report the result of work: mostly of the newest, sometimes of a start that a client has just requested."""
        chance, machine = self._chance, self.machine
        if not self._works or chance.random() < 0.3:
            attempt = machine.attempt(chance.choice([None, 1]))
            return machine.prepared(attempt, chance.choice(STARTS)) if machine.mission.items else []
        work = self._works.pop(-1 if chance.random() < 0.8 else 0)
        if event is Event.FAILED:
            return machine.failed(work.attempt, chance.choice([None, FAILURE]))
        match work:
            case Prepare():
                course = work.attempt.course
                parts = course is not None and course.parts
                return machine.prepared(work.attempt, Prepared(course, "b") if course and parts else LAST)
            case Acquire():
                return machine.granted(work.attempt)
            case StartFile():
                return machine.confirmed(work.attempt)
        return machine.item_flown(work.attempt)


REPORTS = (GONE, TROUBLE, DroneReport(lands=True, lands_or_returns=True), DroneReport(pilot=True))
STARTS = (START, TURNS_FIRST, LAST, Prepared(COURSE, "a", 1, resumes=True))
_RARE = frozenset({Event.CLEARED, Event.UPLOADED, Event.LINK_DOWN, Event.LINK_UP, Event.FAILED, Event.OTHER_PLAYING})
_OFTEN = frozenset({Event.PREPARED, Event.GRANTED, Event.CONFIRMED, Event.PLAYING, Event.HALTED, Event.EXECUTED})
_EVENTS = [event for event in Event for _ in range(1 if event in _RARE else 6 if event in _OFTEN else 2)]

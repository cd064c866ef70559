"""Scenario of faults: a YAML file of steps, each with a trigger and its changes.

    steps:
      - at: 20                  # simulated seconds after the start
        gps: false
        for: 15                 # then as it was before
      - when: {state: flying, height_above: 10}
        after: 3
        drone: 127.0.42.1       # without it: every drone, each in its own time
        link: {both: {loss: 0.2, delay: 0.05}}

A step happens once for each of its drones. docs/simulator.md lists all keys. Any error in a file raises one
`ConfigError` with the key's path, like "steps[1].link.up.loss: expected `float` <= 1.0".
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Protocol

import msgspec
from msgspec import UNSET, Meta, UnsetType

from anafi_mav import documents
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MotorError, WarningLevel
from anafi_mav.arsdk.messages.common import FlightPlanComponent
from anafi_mav.errors import ConfigError
from anafi_mav.sim.autopilot.power import Battery
from anafi_mav.sim.world import quirks
from anafi_mav.sim.world.faults import Faults, Impairment
from anafi_mav.sim.world.motion import Pose
from anafi_mav.sim.world.wind import GUSTS, Wind, WindSpec

MAX_STEPS = 1000
"""Steps are looked at every turn of the world."""

Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Seconds = Annotated[float, Meta(ge=0.0, le=1e6)]
Percent = Annotated[int, Meta(ge=0, le=100)]
Motor = Annotated[int, Meta(ge=1, le=4)]
Height = Annotated[float, Meta(ge=-1e4, le=1e4)]
Distance = Annotated[float, Meta(ge=0.0, le=1e6)]


class When(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of it must be true."""

    state: str | None = None
    height_above: Height | None = None
    """m above take-off"""
    distance_beyond: Distance | None = None
    """m from where the simulated world has its origin, which is where the drone stood first"""
    battery_below: Percent | None = None


class LinkDirection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    loss: Share = 0.0
    delay: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.0
    jitter: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.0
    duplicate: Share = 0.0
    reorder: Share = 0.0

    def impairment(self) -> Impairment:
        return Impairment(self.loss, self.delay, self.jitter, self.duplicate, self.reorder)


class LinkConditions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    up: LinkDirection | None = None
    """From the controller to the drone."""
    down: LinkDirection | None = None
    both: LinkDirection | None = None


class Blow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    speed: Annotated[float, Meta(ge=0.0, le=40.0)]
    direction: Annotated[float, Meta(ge=0.0, le=360.0)] = 0.0
    gusts: Share = GUSTS


class ScenarioStep(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"for_": "for"}):
    at: Seconds | None = None
    when: str | When | None = None
    after: Seconds = 0.0
    for_: Seconds | None = None
    drone: str | None = None
    gps: bool | UnsetType = UNSET
    silence: bool | UnsetType = UNSET
    link: LinkConditions | UnsetType = UNSET
    battery: Percent | UnsetType | None = UNSET
    motor_error: str | UnsetType = UNSET
    motors: Annotated[list[Motor], Meta(min_length=1)] | UnsetType = UNSET
    vibration: str | UnsetType = UNSET
    calibration_required: bool | UnsetType = UNSET
    refuse_take_off: list[str] | UnsetType = UNSET
    refuse_plan: list[str] | UnsetType = UNSET
    storage_full: bool | UnsetType = UNSET
    firmware_quirks: list[str] | UnsetType = UNSET
    wind: Blow | UnsetType = UNSET
    throw: bool | UnsetType = UNSET


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    steps: Annotated[list[ScenarioStep], Meta(min_length=1, max_length=MAX_STEPS)]


class Actor(Protocol):
    """Interface of a simulated drone that a scenario reads and changes."""

    faults: Faults
    wind: Wind

    @property
    def address(self) -> str: ...

    @property
    def time(self) -> float: ...

    @property
    def flying_state(self) -> FlyingState: ...

    @property
    def pose(self) -> Pose: ...

    @property
    def battery(self) -> Battery: ...

    def throw(self) -> None: ...

    def note(self, name: str, args: dict[str, Any]) -> None: ...


@dataclass(eq=False)
class _Change:
    """An attribute that a step has set."""

    owner: Any
    name: str
    before: Any

    def concerns(self, other: _Change) -> bool:
        """Return True when both set the same attribute."""
        return self.owner is other.owner and self.name == other.name


class _AppliedChanges:
    """The changes of one drone that are in effect, oldest first.

    The newest one of an attribute counts. One that is undone below a newer one leaves its value to that, so that the
    attribute is as before both when both are undone, in whatever sequence.
    """

    def __init__(self) -> None:
        self._changes: list[_Change] = []

    def put(self, owner: Any, name: str, value: Any) -> _Change:
        """Set an attribute."""
        change = _Change(owner, name, getattr(owner, name))
        self._changes.append(change)
        setattr(owner, name, value)
        return change

    def undo(self, change: _Change) -> None:
        """Set the attribute as it was before a change, unless a newer one has set it."""
        place = self._changes.index(change)
        del self._changes[place]
        newer = next((other for other in self._changes[place:] if other.concerns(change)), None)
        if newer is None:
            setattr(change.owner, change.name, change.before)
        else:
            newer.before = change.before


@dataclass
class _Cue:
    """One step for one drone."""

    index: int
    step: ScenarioStep
    due: float | None = None
    """When it happens, once its trigger is met."""
    undo: list[_Change] | None = None
    undo_at: float = 0.0
    done: bool = False


class Scenario:
    """The steps, and how far each drone has come in them."""

    def __init__(self, steps: Iterable[ScenarioStep]) -> None:
        """Raises `ConfigError` for steps that make no sense."""
        self.steps = tuple(steps)
        for index, step in enumerate(self.steps):
            _check(f"steps[{index}]", step)
        self._cues: dict[str, list[_Cue]] = {}
        self._changes: dict[str, _AppliedChanges] = {}

    def check_drones(self, addresses: Collection[str]) -> None:
        """Raises `ConfigError` when a step names a drone that is not there."""
        for index, step in enumerate(self.steps):
            if step.drone is not None and step.drone not in addresses:
                known = ", ".join(sorted(addresses)[:5])
                raise ConfigError(
                    f"steps[{index}].drone", f"expected the address of a drone ({known}), got {step.drone!r}"
                )

    def tick(self, drone: Actor) -> None:
        """Let happen what is due for this drone."""
        cues = self._cues.get(drone.address)
        if cues is None:
            cues = [_Cue(i, step) for i, step in enumerate(self.steps) if step.drone in (None, drone.address)]
            self._cues[drone.address] = cues
        if not cues:
            return
        for cue in cues:
            self._advance(cue, drone)
        if any(cue.done for cue in cues):
            self._cues[drone.address] = [cue for cue in cues if not cue.done]

    def _advance(self, cue: _Cue, drone: Actor) -> None:
        step = cue.step
        if cue.undo is not None:
            if drone.time >= cue.undo_at:
                drone.note("step", {"step": cue.index, "ends": True})
                for change in cue.undo:
                    self._changes[drone.address].undo(change)
                cue.done = True
            return
        if cue.due is None and _triggered(step, drone):
            cue.due = drone.time + step.after if step.at is None else step.at
        if cue.due is None or drone.time < cue.due:
            return
        drone.note("step", {"step": cue.index, "ends": False})
        undo = _apply(step, drone, self._changes.setdefault(drone.address, _AppliedChanges()))
        if step.for_ is None:
            cue.done = True
        else:
            cue.undo, cue.undo_at = undo, drone.time + step.for_


def _triggered(step: ScenarioStep, drone: Actor) -> bool:
    if step.at is not None:
        return drone.time >= step.at
    when = When(state=step.when) if isinstance(step.when, str) else step.when
    assert when is not None, "checked"
    pose = drone.pose
    return (
        (when.state is None or drone.flying_state is _STATES[when.state])
        and (when.height_above is None or pose.up > when.height_above)
        and (when.distance_beyond is None or (pose.north**2 + pose.east**2) ** 0.5 > when.distance_beyond)
        and (when.battery_below is None or drone.battery.percent < when.battery_below)
    )


def _apply(step: ScenarioStep, drone: Actor, changes: _AppliedChanges) -> list[_Change]:
    """Make the changes of a step; return them, so that they can be undone."""
    made = [changes.put(drone.faults, name, value) for name, value in _changes(step)]
    if step.wind is not UNSET:
        made.append(changes.put(drone.wind, "spec", WindSpec(step.wind.speed, step.wind.direction, step.wind.gusts)))
    if step.throw is True:
        drone.throw()
    return made


def _changes(step: ScenarioStep) -> Iterable[tuple[str, Any]]:
    """The attributes of `Faults` that a step sets."""
    plain = {
        "gps": step.gps,
        "mute": step.silence,
        "battery": step.battery,
        "magneto_required": step.calibration_required,
        "storage_full": step.storage_full,
    }
    yield from ((name, value) for name, value in plain.items() if value is not UNSET)
    if step.motors is not UNSET:
        yield "motors", sum(1 << (motor - 1) for motor in set(step.motors))
    if step.motor_error is not UNSET:
        yield "motor_error", _MOTOR_ERRORS[step.motor_error]
    if step.vibration is not UNSET:
        yield "vibration", _LEVELS[step.vibration]
    if step.refuse_take_off is not UNSET:
        yield "refuse_take_off", frozenset(_CHECKS[name] for name in step.refuse_take_off)
    if step.refuse_plan is not UNSET:
        yield "refuse_plan", frozenset(_PARTS[name] for name in step.refuse_plan)
    if step.firmware_quirks is not UNSET:
        yield "quirks", quirks.named(step.firmware_quirks, "firmware_quirks")
    if step.link is not UNSET:
        for name, direction in (("up", step.link.up), ("down", step.link.down)):
            chosen = direction or step.link.both
            if chosen is not None:
                yield name, chosen.impairment()


_STATES = {state.name.lower(): state for state in FlyingState}
_MOTOR_ERRORS = {error.name.lower().removeprefix("error_"): error for error in MotorError}
_LEVELS = {level.name.lower(): level for level in WarningLevel}
_CHECKS = {check.name.lower(): check for check in TakeoffChecklistType}
_PARTS = {part.name.lower(): part for part in FlightPlanComponent}
_TRIGGERS = ("at", "when", "after", "for_", "drone")


def _check(path: str, step: ScenarioStep) -> None:
    if (step.at is None) == (step.when is None):
        raise ConfigError(path, "expected one trigger, at or when")
    if step.at is not None and step.after:
        raise ConfigError(f"{path}.after", "expected only with when")
    state = step.when.state if isinstance(step.when, When) else step.when
    _one_of(f"{path}.when" + ("" if isinstance(step.when, str) else ".state"), state, _STATES)
    if isinstance(step.when, When) and step.when == When():
        raise ConfigError(f"{path}.when", "expected a condition")
    actions = [name for name in step.__struct_fields__ if name not in _TRIGGERS]
    if all(getattr(step, name) is UNSET for name in actions):
        raise ConfigError(path, f"expected something to happen: {', '.join(actions)}")
    if step.motors is not UNSET and step.motor_error is UNSET:
        raise ConfigError(f"{path}.motors", "expected only with motor_error")
    if step.link == LinkConditions():
        raise ConfigError(f"{path}.link", "expected up, down or both")
    if step.throw is False:
        raise ConfigError(f"{path}.throw", "expected true")
    for name, known in (("motor_error", _MOTOR_ERRORS), ("vibration", _LEVELS)):
        value = getattr(step, name)
        _one_of(f"{path}.{name}", None if value is UNSET else value, known)
    for key, chosen, choice in (
        ("refuse_take_off", step.refuse_take_off, _CHECKS),
        ("refuse_plan", step.refuse_plan, _PARTS),
    ):
        for index, name in enumerate([] if chosen is UNSET else chosen):
            _one_of(f"{path}.{key}[{index}]", name, choice)
    for index, name in enumerate([] if step.firmware_quirks is UNSET else step.firmware_quirks):
        quirks.named([name], f"{path}.firmware_quirks[{index}]")


def _one_of(path: str, value: str | None, known: Collection[str]) -> None:
    if value is not None and value not in known:
        raise ConfigError(path, f"expected one of {', '.join(known)}, got {value[:60]!r}")


def load(path: Path) -> Scenario:
    """The scenario in a file. Raises `ConfigError`."""
    return _from_document(documents.read(path), str(path))


def from_text(text: str | bytes, source: str) -> Scenario:
    """The scenario in YAML `text`; `source` names it in messages. Raises `ConfigError`."""
    return _from_document(documents.parse(text, source), source)


def _from_document(document: object, source: str) -> Scenario:
    try:
        return Scenario(msgspec.convert(document, _File).steps)
    except msgspec.ValidationError as error:
        problem, _, place = str(error).partition(" - at `$")
        place = re.sub(r"^\.|`$", "", place)
        raise ConfigError(place or source, documents.one_line(problem[:1].lower() + problem[1:])) from error

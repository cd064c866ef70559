"""Effects of the mission machine, and the values that they and its events carry. No I/O."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from anafi_mav.plans.translation.translate import Course
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.mission.progress import Mission
from anafi_mav.vehicle.mission.record import MissionRecord


@dataclass(frozen=True, eq=False)
class MissionAttempt:
    """One try to fly a mission from an item on, or to continue it; compared by identity."""

    mission: Mission
    item: int
    jumps: Mapping[int, int]
    course: Course | None = None
    """The remaining parts between two files; None: a start, whose parts are laid out from `item`."""
    unattended: bool = False
    """The command was answered when the mode was chosen: a failure is sent as a text."""
    awaits_upload: bool = False
    """Armed while a new mission was being stored: that one is meant."""


@dataclass(frozen=True)
class Prepared:
    """A start that can fly: its parts, of which the first file is on the drone."""

    course: Course
    uid: str = ""
    """The drone's name of the first file; empty when a step of the gateway is first."""
    line: int = -1
    """The line of that file behind which it begins."""
    resumes: bool = False
    """The drone has it paused, and resumes it."""


@dataclass(frozen=True)
class DroneReport:
    """Facts of the drone that decide if a plan has ended."""

    pilot: bool = False
    """The Skycontroller's pilot has acquired control."""
    is_in_trouble: bool = False
    """It may have stopped for another reason than the end of its plan."""
    lands: bool = False
    """It lands now, and nothing forces it to."""
    lands_or_returns: bool = False
    """It lands, has landed or returns, and the plan may be the cause."""
    returns_by_plan: bool = False
    """It returns, and names its plan as the reason."""
    place: GeoPoint | None = None
    ato: float | None = None
    """m above take-off."""


@dataclass(frozen=True)
class Prepare:
    """Lay out the parts, check them and upload the first file; then `prepared`."""

    attempt: MissionAttempt


@dataclass(frozen=True)
class Acquire:
    """Acquire control and hover; then `granted`."""

    attempt: MissionAttempt
    prepared: Prepared


@dataclass(frozen=True)
class StartFile:
    """Command the drone to fly a file; then `playing` and `confirmed`."""

    attempt: MissionAttempt
    prepared: Prepared


@dataclass(frozen=True)
class FlyItem:
    """Fly one item; then `item_flown`."""

    attempt: MissionAttempt
    item: int


@dataclass(frozen=True)
class Select:
    """Show mode Mission: the mission is flown, or waits for arming."""


@dataclass(frozen=True)
class Release:
    """Release control: the drone hovers in mode Hold, unless it lands or returns."""

    lands: bool = False
    """The plan lands the drone, which may report that later."""


@dataclass(frozen=True)
class Suspend:
    """Command the drone to pause its file and not to begin another one."""

    starting: bool = False
    """It has not reported that it flies the file, so a landing or return is not that file's."""


@dataclass(frozen=True)
class Announce:
    """Send a text that the mission begins or resumes, with the drone's link-loss behaviour."""

    item: int
    resumes: bool
    stepped: bool


@dataclass(frozen=True)
class SendText:
    """Send a text to all clients."""

    severity: Severity
    text: OperatorText


@dataclass(frozen=True)
class Reached:
    """Report an item as reached."""

    item: int


@dataclass(frozen=True)
class Persist:
    """Store the record of the drone's plan for a restarted gateway; None: there is none."""

    record: MissionRecord | None


@dataclass(frozen=True)
class Failure:
    """An error, for texts."""

    text: OperatorText
    """The whole of it."""
    reason: OperatorText
    """Without its subject."""


Work: TypeAlias = Prepare | Acquire | StartFile | FlyItem
"""An effect that takes time; its result is an event."""

Effect: TypeAlias = Work | Select | Release | Suspend | Announce | SendText | Reached | Persist

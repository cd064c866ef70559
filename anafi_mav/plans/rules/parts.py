"""Records of a translated mission and of its faults.

`flight_plan_writer` writes them and `translate` returns them.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

from anafi_mav.errors import PlanError
from anafi_mav.plans.plan import Point


class FaultKind(enum.Enum):
    """Reasons for refusing a mission, as MISSION_ACK reports them."""

    COMMAND = "the drone cannot do it: UNSUPPORTED"
    FRAME = "its height counts from what the drone does not know: UNSUPPORTED_FRAME"
    PARAM = "a parameter: INVALID_PARAMn"
    PLAN = "its place among the others: INVALID"


@dataclass(frozen=True)
class TranslationFault:
    """Why a mission is refused."""

    item: int
    reason: str
    """A clause for people."""
    kind: FaultKind
    param: int | None = None
    """1..7, with PARAM."""

    def __str__(self) -> str:
        return f"item {self.item}: {self.reason}"


class TranslationRefused(Exception):
    """Raised by a rule; `fault` is why."""

    def __init__(self, fault: TranslationFault) -> None:
        super().__init__(str(fault))
        self.fault = fault


class UnknownHeight(PlanError):
    """A height above mean sea level cannot be had without that of the take-off point."""


@dataclass(frozen=True)
class Start:
    """State of the drone at the start of a mission."""

    latitude: float
    longitude: float
    ato: float
    """m above the take-off; 0 on the ground."""
    flying: bool
    takeoff_amsl: float | None = None
    """m: the height of the take-off point above mean sea level. Without it items in such frames cannot be flown."""
    heading: float = 0.0
    """deg from north: version 1 has a heading in each way point, and keeps this one where nothing says another."""
    is_assumed: bool = False
    """True when `takeoff_amsl` stands for one that is unknown: heights above sea level are not judged by it."""


@dataclass(frozen=True)
class FlightPlanFile:
    """A file that the drone flies by itself."""

    content: bytes
    origins: tuple[int, ...]
    """Index of the mission item that each line is made from.

    MissionItemExecuted reports the index of the line.
    """
    done: tuple[tuple[int, ...], ...]
    """For each line: the items of the mission that are done when it is executed, in their order. An item that needs no
    line, such as a label, is done with the line before it."""


@dataclass(frozen=True)
class GatewayStep:
    """An item that the gateway flies."""

    item: int
    done: tuple[int, ...]
    """The items that are done with it: itself, and what needs no line before or after it."""


@dataclass(frozen=True)
class ItemSettings:
    """Settings made by items, which hold until other items change them."""

    speed: tuple[float, float] | None = None
    """Type and m/s."""
    gimbal: tuple[float | None, float | None, float | None] | None = None
    """Pitch (deg, up +), roll, yaw from the nose."""
    roi: Point | None = None
    """Height above take-off."""
    beside: float | None = None
    """deg: the nose points so much to the right of the way to each way point."""
    view: tuple[float | None, float | None, float | None] | None = None
    """Of SET_VIEW_MODE, where a mission has such items itself."""
    still: tuple[float, float, float] | None = None
    """Of SET_STILL_MODE, where a mission has such items itself: mode, step, format."""
    photos: tuple[float, float] | None = None
    """Photos that are taken without end: mode and step of SET_STILL_MODE."""
    films: bool = False

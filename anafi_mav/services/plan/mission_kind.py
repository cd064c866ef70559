"""Rules of missions for the plan transfer: valid items and their numbering. No I/O.

A mission is kept verbatim, in one numbering: the first real item is 0. ArduPilot's clients count home as item 0, so
their lists, the targets of their jumps and every other number of an item are one higher for them (MAVLink
mission.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.plan import HEADED, NORTH, Item, Loss
from anafi_mav.plans.translation.translate import FaultKind, TranslationReport, examine
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.services.plan.item_messages import from_wire
from anafi_mav.services.plan.plan_transfer import PlanKind
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.fence.plan_items import PlanFault, PlanItem

_RESULTS = {
    FaultKind.COMMAND: dialect.MAV_MISSION_UNSUPPORTED,
    FaultKind.FRAME: dialect.MAV_MISSION_UNSUPPORTED_FRAME,
    FaultKind.PLAN: dialect.MAV_MISSION_INVALID,
}

_NOTHING = TranslationReport((), (), ())


def offset(flavour: Flavour) -> int:
    """Return the seq of our item 0 in messages to clients of this flavour."""
    return 1 if flavour.zero_home else 0


def _with_param(item: PlanItem, number: int, value: float) -> PlanItem:
    params = list(item.params)
    params[number - 1] = value
    one, two, three, four = params
    return msgspec.structs.replace(item, params=(one, two, three, four))


def _shifted(item: PlanItem, by: int) -> PlanItem:
    """An item in a list that counts `by` more before it."""
    if item.command != dialect.MAV_CMD_DO_JUMP or not math.isfinite(item.params[0]):
        return item
    return _with_param(item, 1, item.params[0] + by)


@dataclass(frozen=True)
class Examined:
    """A mission, and what it is to the drone."""

    items: Sequence[PlanItem]
    neutral: tuple[Item, ...]
    report: TranslationReport

    @property
    def words(self) -> OperatorText:
        """A text on how the mission is flown."""
        if not self.items:
            return texts.NO_MISSION_STORED
        report = self.report
        words = texts.MISSION_ITEMS.fill(count=len(self.items))
        if report.stepped:
            words = texts.MISSION_STEPS.fill(mission=words, steps=_some(report.stepped))
        if report.approximations:
            words = texts.MISSION_APPROXIMATE.fill(mission=words, losses=_some(report.approximations))
        return words


def _some(losses: Sequence[Loss]) -> str:
    loss = losses[0]
    where = "" if loss.item is None else f"item {loss.item + texts.FIRST_LABEL}: "
    more = f" and {len(losses) - 1} more" if len(losses) > 1 else ""
    return f"{where}{loss.what}{more}"


class MissionKind(PlanKind):
    """The list of mission items.

    `home` makes ArduPilot's item 0, `version` is of the file that the drone flies.
    """

    mission_type = dialect.MAV_MISSION_TYPE_MISSION
    name = "mission"

    def __init__(self, home: Callable[[], PlanItem], version: Callable[[], Version]) -> None:
        self._home = home
        self._version = version
        self._known = Examined((), (), _NOTHING)

    def examine(self, items: Sequence[PlanItem], flavour: Flavour = PX4) -> PlanFault | None:
        """Return the fault of a list whose items are valid by themselves.

        Its reason numbers items as clients of this flavour do. This is no `check_plan`: 5 000 items take half a
        second, which is for a thread.
        """
        report = self.examined(items).report
        if not report.faults:
            return None
        fault = report.faults[0]
        result = _RESULTS.get(fault.kind)
        if result is None:
            result = dialect.MAV_MISSION_INVALID_PARAM1 - 1 + (fault.param or 1)
        return PlanFault(result, texts.ITEM_REASON.fill(number=fault.item + texts.FIRST_LABEL, reason=fault.reason))

    def examined(self, items: Sequence[PlanItem]) -> Examined:
        """A mission, and what it is to the drone; the last one is known, whichever thread asked."""
        known = self._known
        if known.items is not items:
            neutral = tuple(map(from_wire, items))
            known = Examined(items, neutral, examine(neutral, self._version()) if items else _NOTHING)
            self._known = known
        return known

    def shown(self, items: Sequence[PlanItem], flavour: Flavour) -> Sequence[PlanItem]:
        if not items or not flavour.zero_home:
            return items
        return (self._home(), *(_shifted(_with_zero(item), 1) for item in items))

    def taken(self, items: Sequence[PlanItem], flavour: Flavour) -> Sequence[PlanItem]:
        if flavour.always_continues:
            items = [msgspec.structs.replace(item, autocontinue=1) for item in items]
        if not flavour.zero_home:
            return items
        return [_shifted(_without_zero(item), -1) for item in items[1:]]

    def label(self, seq: int, flavour: Flavour) -> int:
        return seq - offset(flavour) + texts.FIRST_LABEL

    def always_shown(self, seq: int, flavour: Flavour) -> PlanItem | None:
        """Return home as item 0, for ArduPilot's clients, also of an empty list.

        dronekit reads home as item 0 and waits for it when the list is empty; ArduCopter always has it.
        """
        return self._home() if flavour.zero_home and seq == 0 else None


def _without_zero(item: PlanItem) -> PlanItem:
    """Undo `_with_zero`."""
    heading = item.params[3]
    if item.command not in HEADED or heading not in (0.0, NORTH):
        return item
    return _with_param(item, 4, math.nan if heading == 0.0 else 0.0)


def _with_zero(item: PlanItem) -> PlanItem:
    """An item whose heading is 0 if it is not set, and not 0 if it is north."""
    if item.command not in HEADED:
        return item
    heading = item.params[3]
    return _with_param(item, 4, 0.0 if math.isnan(heading) else heading or NORTH)

"""`anafi-mav plan upload|download`: plans to and from any MAVLink vehicle."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from anafi_mav.cli import interrupts, plan_files, plan_options
from anafi_mav.cli.ground_client import Ground, Texts, connected
from anafi_mav.cli.terminal import progress, say, say_later
from anafi_mav.errors import AnafiMavError, PlanError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.mavlink.plan_client import Download, Outcome, Upload
from anafi_mav.plans.formats.lists import fence_items, points_of, rally_items, zones_of
from anafi_mav.plans.plan import (
    GLOBAL,
    HEADED,
    NORTH,
    WAYPOINT,
    Item,
    Plan,
    Point,
    shifted,
    with_heading,
    without_zero_heading,
)
from anafi_mav.services.memory import NOT_KEPT
from anafi_mav.services.plan.item_messages import from_wire, item_int, item_of, to_wire
from anafi_mav.units import counted
from anafi_mav.vehicle.fence.plan_items import PlanFault, PlanItem

MISSION, FENCE, RALLY = (
    dialect.MAV_MISSION_TYPE_MISSION,
    dialect.MAV_MISSION_TYPE_FENCE,
    dialect.MAV_MISSION_TYPE_RALLY,
)
NAMES = {MISSION: "mission", FENCE: "fence", RALLY: "rally points"}

HEIGHT_STEP = 0.0101
"""m by which a height may differ from the uploaded one: an ArduPilot keeps whole cm, some of them cut off."""


class TransferRefused(AnafiMavError):
    """The vehicle did not take a list, or did not give it."""


@dataclass(frozen=True)
class Lists:
    """A plan as the lists that a vehicle keeps."""

    mission: tuple[Item, ...]
    home: Point | None
    fence: tuple[Item, ...]
    rally: tuple[Item, ...]

    @classmethod
    def of(cls, plan: Plan) -> Lists:
        return cls(plan.items, plan.home, tuple(fence_items(plan)), tuple(rally_items(plan)))

    def wire(self, kind: int, source: str, *, with_home: bool) -> list[PlanItem]:
        """One of them as messages carry it; with home as item 0 as an ArduPilot wants it.

        Raises `PlanError`.
        """
        items = {MISSION: self.mission, FENCE: self.fence, RALLY: self.rally}[kind]
        carried = []
        for number, item in enumerate(items):
            try:
                mine = _without_none(shifted(item, int(kind == MISSION))) if with_home else item
                carried.append(to_wire(mine))
            except ValueError as error:
                raise PlanError(source, str(error), number) from error
        if with_home and kind == MISSION and items:
            home = self.home or Point(0.0, 0.0)
            carried.insert(
                0, to_wire(Item(WAYPOINT, GLOBAL, (0.0, 0.0, 0.0, 0.0, home.latitude, home.longitude, home.height)))
            )
        return carried


def _without_none(item: Item) -> Item:
    """Replace parameters that are not set by 0, as ArduPilot requires, and heading 0 by 360.

    It refuses NaN (AP_Mission.cpp sanity_check_params).
    """
    if item.command in HEADED and item.params[3] == 0.0:
        item = with_heading(item, NORTH)
    one, two, three, four, five, six, seven = (0.0 if value is None else value for value in item.params)
    return replace(item, params=(one, two, three, four, five, six, seven))


def upload(arguments: argparse.Namespace) -> int:
    """Hand it over; 1 when the gateway took it and cannot store it.

    Raises `TransferRefused` with the vehicle's reason.
    """
    plan, sysid = plan_options.load(arguments), plan_options.sysid_of(arguments)
    texts = interrupts.run(_upload(arguments, sysid, plan))
    return 1 if NOT_KEPT in texts else 0


async def _upload(arguments: argparse.Namespace, sysid: int | None, plan: Plan) -> list[str]:
    async with connected(arguments.endpoint, sysid) as ground:
        return await give(ground, plan, arguments.file.name)


async def give(ground: Ground, plan: Plan, source: str) -> list[str]:
    """Upload the lists that a plan has and return the vehicle's texts.

    Other lists stay as the vehicle has them. Raises `TransferRefused` and `PlanError`.
    """
    lists = Lists.of(plan)
    parts = {kind: lists.wire(kind, source, with_home=ground.first_item_is_home) for kind in NAMES}
    if not any(parts.values()):
        raise PlanError(source, "it is empty: nothing to upload")
    with collect_texts(ground) as texts:
        for kind, items in parts.items():
            if items:
                await give_list(ground, kind, items, texts)
        return texts


@contextlib.contextmanager
def collect_texts(ground: Ground) -> Iterator[list[str]]:
    """Print what the vehicle says meanwhile; also a list of it."""
    said: list[str] = []
    texts = Texts()

    def hear(inbound: Inbound) -> None:
        if isinstance(inbound.message, dialect.MAVLink_statustext_message):
            text = texts.add(inbound.message)
            if text:
                said.append(text)
                severe = inbound.message.severity <= dialect.MAV_SEVERITY_WARNING
                say_later(f"system {inbound.sysid}: {text}", "yellow" if severe else "")

    before, ground.on_message = ground.on_message, hear
    try:
        yield said
    finally:
        ground.on_message = before


async def give_list(ground: Ground, kind: int, items: Sequence[PlanItem], said: Sequence[str] = ()) -> None:
    """Upload one list. Raises `TransferRefused`."""
    sysid, compid = ground.target
    transfer = Upload(
        [lambda seq, item=item: item_int(item, seq, sysid, compid, kind) for item in items],  # type: ignore[misc]
        sysid, compid, kind,
    )  # fmt: skip
    with progress(f"{NAMES[kind]} to system {sysid}", len(items)) as step:
        await ground.run(transfer, step)
    assert transfer.result is not None, "run ends with one"
    count = counted(len(items) - int(kind == MISSION and ground.first_item_is_home), "item")
    if transfer.result.outcome is Outcome.UNCONFIRMED and await _has(ground, kind, items):
        say_later(f"{NAMES[kind]}: {count} on system {sysid}; the acknowledgement was lost, they were read back")
    elif transfer.result.outcome is Outcome.DONE:
        say_later(f"{NAMES[kind]}: {count} on system {sysid}", "green")
    else:
        why = f"; system {sysid} said: {said[-1]}" if said else ""
        raise TransferRefused(f"{NAMES[kind]} not taken: {transfer.result.reason}{why}")


async def _has(ground: Ground, kind: int, items: Sequence[PlanItem]) -> bool:
    """Read the list back and return True when the vehicle has these items."""
    transfer = Download(*ground.target, kind)
    await ground.run(transfer, lambda done, total: None)
    if transfer.result is None or transfer.result.outcome is not Outcome.DONE:
        return False
    there = [item_of(message) for message in transfer.items]
    # Item 0 of an ArduPilot's mission is its own home, whatever was uploaded.
    first = int(kind == MISSION and ground.first_item_is_home)
    return len(items) == len(there) and all(map(_is_same, items[first:], there[first:]))


def _is_same(wanted: PlanItem, found: PlanItem | PlanFault) -> bool:
    """Return True for the same item, with a height that a vehicle has rounded."""
    if isinstance(found, PlanFault):
        return False
    if wanted.has_place and abs(wanted.z - found.z) <= HEIGHT_STEP:
        found = msgspec.structs.replace(found, z=wanted.z)
    return from_wire(wanted) == from_wire(found)


def download(arguments: argparse.Namespace) -> int:
    """Fetch mission, fence and rally points into one file. Raises `TransferRefused`."""
    sysid = plan_options.sysid_of(arguments)
    plan_options.target_format(arguments.out, arguments.model)
    plan_files.may_replace(arguments.out, force=arguments.force)
    arguments.force = True  # it has been asked, before the vehicle was
    plan = interrupts.run(_download(arguments, sysid))
    plan_files.store(plan, arguments, Path("the vehicle's plan"))
    return 0


async def _download(arguments: argparse.Namespace, sysid: int | None) -> Plan:
    async with connected(arguments.endpoint, sysid) as ground:
        return await take(ground)


async def take(ground: Ground) -> Plan:
    """Download the plan of a vehicle.

    Raises `TransferRefused` when it does not send its mission; fence and rally points may be missing.
    """
    source = f"system {ground.target[0]}"
    items = await _take_list(ground, MISSION, needed=True)
    home = None
    if ground.first_item_is_home and items:
        first, *items = items
        latitude, longitude, height = first.params[4:]
        if latitude and longitude:
            home = Point(latitude, longitude, height or 0.0)
        items = [without_zero_heading(shifted(item, -1)) for item in items]
    zones, back = zones_of(await _take_list(ground, FENCE), f"{source}: fence")
    rally = points_of(await _take_list(ground, RALLY), f"{source}: rally points")
    return Plan(tuple(items), home, zones, back, rally)


async def _take_list(ground: Ground, kind: int, *, needed: bool = False) -> list[Item]:
    sysid, compid = ground.target
    transfer = Download(sysid, compid, kind)
    with progress(f"{NAMES[kind]} from system {sysid}", None) as step:
        await ground.run(transfer, step)
    assert transfer.result is not None, "run ends with one"
    if transfer.result.outcome is Outcome.DONE:
        items = [item_of(message) for message in transfer.items]
        for number, item in enumerate(items):
            if isinstance(item, PlanFault):
                raise TransferRefused(f"{NAMES[kind]} of system {sysid}, item {number}: {item.reason}")
        return [from_wire(item) for item in items if isinstance(item, PlanItem)]
    if needed:
        raise TransferRefused(f"{NAMES[kind]} of system {sysid}: {transfer.result.reason}")
    say(f"no {NAMES[kind]} from system {sysid}: {transfer.result.reason}", "yellow")
    return []

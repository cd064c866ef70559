"""Which file a mission is flown from, and what its lines stand for: uploaded to a simulated Ai."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest
from support.simulated import connected

from anafi_mav import mav_enums
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import FlightPlanFile, Start, translate
from anafi_mav.vehicle.mission.path import FilesOnDrone
from anafi_mav.vehicle.mission.progress import MissionProgress


def way(latitude: float, command: int = 16) -> Item:
    return Item(command, 3, (0.0, None, None, None, latitude, 2.0, 20.0))


UP, A, B, C, D = way(48.0, 22), way(48.0), way(48.001), way(48.002), way(48.003)
X = Item(mav_enums.MAV_CMD_NAV_WAYPOINT, 3, (0.0, None, None, None, 48.0005, 2.001, 20.0))
WHOLE = (UP, A, B, C, D)
GROUND = Start(48.0, 2.0, 0.0, flying=False, takeoff_amsl=0.0)
AIR = Start(48.0002, 2.0, 20.0, flying=True, takeoff_amsl=0.0)


def leg(mission: tuple[Item, ...], start: Start, first: int = 0) -> FlightPlanFile:
    head = translate(mission, 2, start, first).parts[0]
    assert isinstance(head, FlightPlanFile)
    return head


@pytest.fixture
async def files() -> AsyncIterator[FilesOnDrone]:
    async with connected("ai") as pair:
        yield FilesOnDrone(pair.drone.flight_plan)


def observed(mission: tuple[Item, ...], flown: FlightPlanFile, after: int) -> list[tuple[int, ...]]:
    """What is done with the lines that the drone flies."""
    progress, found = MissionProgress().in_file("", flown, after), []
    for line in range(after + 1, len(flown.origins)):
        progress, done = progress.with_executed(mission, line)
        found.append(done)
    assert progress.leg_done
    return found


async def test_same_mission_continues_inside_its_file(files: FilesOnDrone) -> None:
    whole, name, _ = await files.beginning_with(leg(WHOLE, GROUND), WHOLE)
    flown, again, line = await files.beginning_with(leg(WHOLE, AIR, 3), WHOLE)
    assert flown is whole
    assert again == name
    assert observed(WHOLE, flown, line) == [(3,), (4,)]


@pytest.mark.parametrize(
    ("mission", "first", "done"),
    [((UP, A, X, B, C, D), 3, [(3,), (4,), (5,)]), ((B, C, D), 0, [(0,), (1,), (2,)])],
    ids=["an item more", "two items fewer"],
)
async def test_an_edited_mission_has_the_new_numbers(
    files: FilesOnDrone, mission: tuple[Item, ...], first: int, done: list[tuple[int, ...]]
) -> None:
    """The lines that are left are word for word those of the old file, but they stand for other items."""
    _, name, _ = await files.beginning_with(leg(WHOLE, GROUND), WHOLE)
    flown, again, line = await files.beginning_with(leg(mission, AIR, first), mission)
    assert again != name
    assert line == -1
    assert observed(mission, flown, line) == done


async def test_file_of_an_earlier_mission_is_not_reused(files: FilesOnDrone) -> None:
    """Also where the rest is the same and has the same numbers: the file's first lines are the old mission's."""
    mission = (UP, A, X, C, D)
    await files.beginning_with(leg(WHOLE, GROUND), WHOLE)
    rest = leg(mission, AIR, 3)
    assert rest == leg(WHOLE, AIR, 3)
    assert (await files.beginning_with(rest, mission))[2] == -1
    # And the old one again is in the middle of nothing: the newest file is the other's.
    assert (await files.beginning_with(leg(WHOLE, AIR, 3), WHOLE))[2] == -1


async def test_equal_file_of_other_items_is_not_continued(files: FilesOnDrone) -> None:
    """A place that a mission has twice: lines alone do not say which item they are."""
    mission = (UP, A, B, C, B, C)
    long, short = leg(mission[:4], GROUND), leg(mission, AIR, 4)
    assert long.content.splitlines()[-1].split(b"\t")[1:] == short.content.splitlines()[-1].split(b"\t")[1:]
    await files.beginning_with(long, mission)
    flown, _, line = await files.beginning_with(short, mission)
    assert line == -1
    assert observed(mission, flown, line) == [(4,), (5,)]

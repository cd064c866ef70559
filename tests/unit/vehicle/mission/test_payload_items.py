"""Which items of a mission need the gimbal or the camera, by hand."""

from __future__ import annotations

import pytest

from anafi_mav import mav_enums
from anafi_mav.plans.formats.parrot import SET_STILL_MODE, SET_VIEW_MODE
from anafi_mav.plans.plan import DO_JUMP, Item
from anafi_mav.plans.rules.parts import GatewayStep
from anafi_mav.plans.translation.translate import Course
from anafi_mav.vehicle.mission.effects import Prepared
from anafi_mav.vehicle.mission.machine import MissionMachine
from anafi_mav.vehicle.mission.progress import PayloadItems

UP, WAY, SPEED = 22, 16, 178
AIM = mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
OWNER = mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
PHOTO = mav_enums.MAV_CMD_IMAGE_START_CAPTURE
ROI, NO_ROI = mav_enums.MAV_CMD_DO_SET_ROI_LOCATION, mav_enums.MAV_CMD_DO_SET_ROI_NONE


def item(command: int, *params: float | None) -> Item:
    one, two, three, four, five, six, seven = (*params, *[None] * (7 - len(params)))
    return Item(command, 3, (one, two, three, four, five, six, seven))


def gimbal(*commands: int) -> list[bool]:
    """Whether the gimbal is needed at each item of a mission of these commands."""
    items = PayloadItems([item(command) for command in commands])
    return [items.needs_gimbal(first, {}) for first in range(len(commands))]


def test_gimbal_is_needed_until_its_last_item() -> None:
    assert gimbal(UP, WAY, AIM, WAY) == [True, True, True, False]


def test_configuring_the_gimbal_needs_none() -> None:
    assert gimbal(UP, OWNER, WAY, OWNER) == [False, False, False, False]


def test_region_in_force_needs_the_gimbal_until_it_ends() -> None:
    assert gimbal(ROI, WAY, WAY, NO_ROI, WAY) == [True, True, True, True, False]
    assert gimbal(ROI, WAY, WAY) == [True, True, True]
    assert gimbal(ROI, AIM, WAY) == [True, True, False]


@pytest.mark.parametrize(
    ("look", "in_force"),
    [
        (item(SET_VIEW_MODE, 2.0, 0.0), True),
        (item(SET_VIEW_MODE, 1.0), False),
        (item(mav_enums.MAV_CMD_DO_SET_ROI, 3.0, None, None, None, 48.0, 2.0, 0.0), True),
        (item(mav_enums.MAV_CMD_DO_SET_ROI, 0.0, None, None, None, 48.0, 2.0, 0.0), True),
        (item(mav_enums.MAV_CMD_DO_SET_ROI, 0.0, None, None, None, 0.0, 0.0, 0.0), False),
        (item(mav_enums.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET), True),
    ],
)
def test_region_begins_by_the_parameters(look: Item, in_force: bool) -> None:
    assert PayloadItems([look, item(WAY)]).needs_gimbal(1, {}) is in_force


def test_camera_is_needed_until_its_last_item() -> None:
    items = PayloadItems([item(command) for command in (UP, SET_STILL_MODE, AIM, PHOTO, WAY, AIM)])
    assert [items.needs_camera(first, {}) for first in range(6)] == [True, True, True, True, False, False]


@pytest.mark.parametrize(
    ("repetitions", "done", "needed"), [(2.0, 0, True), (2.0, 1, True), (2.0, 2, False), (-1.0, 9, True)]
)
def test_jump_with_repetitions_left_brings_items_back(repetitions: float, done: int, needed: bool) -> None:
    mission = [item(UP), item(PHOTO), item(AIM), item(WAY), item(DO_JUMP, 1.0, repetitions), item(WAY)]
    items = PayloadItems(mission)
    assert items.needs_gimbal(3, {4: done}) is needed
    assert items.needs_camera(3, {4: done}) is needed
    assert not items.needs_camera(5, {})  # the jump is behind it


def test_jump_within_the_repeated_items_is_followed() -> None:
    mission = [item(PHOTO), item(WAY), item(DO_JUMP, 0.0, 1.0), item(WAY), item(DO_JUMP, 1.0, 1.0)]
    items = PayloadItems(mission)
    assert items.needs_camera(3, {})
    assert not items.needs_camera(3, {2: 1})


def test_paused_mission_frees_gimbal_and_camera() -> None:
    items, later = [item(UP), item(AIM), item(PHOTO), item(WAY)], Course((GatewayStep(2, (2,)), GatewayStep(3, (3,))))
    machine = MissionMachine()
    machine.upload(items, 7)
    seen = [(machine.needs_gimbal, machine.needs_camera)]

    def fly(first: int, course: Course) -> None:
        attempt = machine.attempt(first)
        machine.prepared(attempt, Prepared(course))
        machine.granted(attempt)

    def finish() -> None:
        assert machine.phase.attempt is not None
        machine.item_flown(machine.phase.attempt)

    steps = (
        lambda: fly(0, Course((GatewayStep(0, (0,)),))),
        machine.control_lost,
        lambda: fly(2, later),
        finish,
    )
    for step in steps:
        step()
        seen.append((machine.needs_gimbal, machine.needs_camera))
    assert seen == [(False, False), (True, True), (False, False), (False, True), (False, False)]

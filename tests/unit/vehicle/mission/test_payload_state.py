"""Payload that the executed lines of a translated file have set."""

from __future__ import annotations

import pytest

from anafi_mav import mav_enums
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.plan import MISSION, RELATIVE, WAYPOINT, Item
from anafi_mav.plans.translation.translate import FlightPlanFile, Start, translate
from anafi_mav.vehicle.mission.payload_state import PayloadState, payload_after

AIR = Start(48.8789, 2.3677, 10.0, flying=True, takeoff_amsl=35.0)


def way(north: float) -> Item:
    return Item(WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, 48.8789 + north * 1e-5, 2.3677, 10.0))


def action(command: int, *params: float) -> Item:
    one, two, three, four, *_ = (*params, 0.0, 0.0, 0.0, 0.0)
    return Item(command, MISSION, (one, two, three, four, 0.0, 0.0, 0.0))


def after_each_item(items: list[Item], version: Version) -> dict[int, PayloadState]:
    """Return the state after the last line of each item."""
    (leg,) = translate(items, version, AIR).parts
    assert isinstance(leg, FlightPlanFile)
    assert payload_after(leg, -1, version) == PayloadState()
    return {item: payload_after(leg, line, version) for line, item in enumerate(leg.origins)}


@pytest.mark.parametrize("version", [1, 2])
def test_payload_after_lines_is_what_they_have_set_and_not_ended(version: Version) -> None:
    found = after_each_item(
        [
            way(10.0),
            action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, -60.0),
            action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 2.0, 0.0),
            way(20.0),
            action(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE),
            action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0),
            action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE),
            way(30.0),
            action(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE),
            way(40.0),
        ],
        version,
    )
    photos, idle = PayloadState(-60.0, takes_photos=True), PayloadState(-60.0)
    video = PayloadState(-60.0, records=True)
    wanted = {0: PayloadState(), 1: idle, 2: photos, 3: photos, 4: idle, 5: idle, 6: video, 7: video, 8: idle, 9: idle}
    assert found == wanted


@pytest.mark.parametrize("version", [1, 2])
def test_pitch_beside_a_region_of_interest_is_the_drones(version: Version) -> None:
    region = Item(mav_enums.MAV_CMD_DO_SET_ROI_LOCATION, RELATIVE, (0.0, 0.0, 0.0, 0.0, 48.88, 2.368, 0.0))
    items = [way(10.0), action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, -60.0), region, way(20.0)]
    found = after_each_item([*items, action(mav_enums.MAV_CMD_DO_SET_ROI_NONE), way(30.0)], version)
    assert [found[item].pitch for item in (1, 2, 3, 4, 5)] == [-60.0, None, None, 0.0, 0.0]

"""What a mission photographs, films and looks at, in the drone's files: each line by hand."""

from __future__ import annotations

import pytest
from support.plan_samples import LAT, LON, PARROTS_EXAMPLE, action, waypoint

from anafi_mav import mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats import files, parrot
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.plan import GLOBAL, RELATIVE, Item, Loss
from anafi_mav.plans.translation.translate import (
    FaultKind,
    FlightPlanFile,
    GatewayStep,
    Start,
    TranslationFault,
    examine,
    translate,
)
from anafi_mav.sim.plan import plan_file
from anafi_mav.sim.plan.plan_file import PlanCommand

AIR = Start(LAT, LON, 10.0, flying=True, takeoff_amsl=35.0, heading=30.0)

VERSIONS: tuple[Version, ...] = (1, 2)

GO = waypoint(1, 0)


def read(items: list[Item], version: Version, start: Start = AIR) -> list[plan_file.PlanLine]:
    """The mission as the simulated drone reads its translation."""
    assert examine(items, version).faults == ()
    (leg,) = translate(items, version, start).parts
    assert isinstance(leg, FlightPlanFile)
    return list(plan_file.read(leg.content, version))


def observed(items: list[Item], version: Version, start: Start = AIR) -> list[tuple[float, ...]]:
    """Command and what it says: of version 1 all seven, of version 2 those that are set."""
    return [
        (int(item.command), *(value for value in item[2:] if value == value))
        if version == 2
        else (int(item.command), *item[2:])
        for item in read(items, version, start)
    ]


def roi(
    latitude: float | None = LAT,
    longitude: float | None = LON,
    height: float = 5.0,
    command: int = 195,
    mode: float = 0.0,
    frame: int = RELATIVE,
) -> Item:
    return Item(command, frame, (mode, 0.0, 0.0, 0.0, latitude, longitude, height))


def test_parrots_own_example() -> None:
    """Parrot's flight plan page: it says with words what it does, and so does its translation."""
    items = list(files.parse(PARROTS_EXAMPLE, "sample.mavlink", 2).items)
    start = Start(48.878601, 2.366549, 0.0, flying=False, heading=30.0)
    assert observed(items, 2, start) == [
        (22,),
        (16, 0.0, 1.0, 48.878601, 2.366549, 15.0),
        (16, 0.0, 1.0, 0.0, 48.879, 2.366549, 20.0),
        (50001, 0.0, 2.0, 12.0),
        (2000, 0.0, 1.0, 1.0),
        (93, 10.0),
        (2001,),
        (16, 0.0, 1.0, 0.0, 48.879139, 2.367296, 0.0),
        (21,),
    ]
    assert examine(items, 2).approximations == ()
    one = observed(items, 1, start)
    assert one[0] == (22, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert one[1] == (16, 0.0, 1.0, 0.0, 30.0, 48.878601, 2.366549, 15.0)
    assert one[3:5] == [(50001, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0), (2000, 0.0, 1.0, 12.0, 0.0, 0.0, 0.0, 0.0)]
    # What is translated is a plan that is translated to itself, but for the take-off that is in it already.
    (leg,) = translate(items, 2, start).parts
    assert isinstance(leg, FlightPlanFile)
    again = parrot.read(leg.content.decode(), "x", 2).items
    (second,) = translate(again, 2, start).parts
    assert isinstance(second, FlightPlanFile)
    assert second.content == leg.content


@pytest.mark.parametrize("version", VERSIONS)
def test_photos(version: Version) -> None:
    items = [
        GO,
        action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0, 7.0),
        action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 5.0, 0.0),
        waypoint(2, 0),
        action(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE),
        action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 3.0, 10.0),
    ]
    found = observed(items, version)[1:]
    if version == 1:
        zeros = (0.0,) * 4
        assert [row for row in found if row[0] != 16] == [
            (50001, 0.0, 2.0, 0.0, *zeros),
            (2000, 0.0, 1.0, 12.0, *zeros),
            (50001, 0.0, 5.0, 0.0, *zeros),
            (2000, 5.0, 0.0, 12.0, *zeros),
            (2001, 0.0, 0.0, 0.0, *zeros),
            (50001, 0.0, 3.0, 0.0, *zeros),
            (2000, 3.0, 10.0, 12.0, *zeros),
        ]
    else:
        assert [row for row in found if row[0] != 16] == [
            (50001, 0.0, 2.0, 12.0),
            (2000, 0.0, 1.0, 1.0),
            (50001, 0.0, 5.0, 12.0),
            (2000, 5.0, 0.0),
            (2001,),
            (50001, 0.0, 3.0, 12.0),
            (2000, 3.0, 10.0),
        ]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_survey_as_qgroundcontrol_writes_it(version: Version) -> None:
    """Camera mode, gimbal, photos by distance with one at the beginning and one at the end."""
    items = [
        action(mav_enums.MAV_CMD_SET_CAMERA_MODE, 0.0, 2.0),
        action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -90.0, 0.0, None, None, 0.0, None, 0.0),
        GO,
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 25.0, 0.0, 1.0),
        waypoint(3, 0),
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 0.0, 0.0, 1.0),
    ]
    assert examine(items, version).approximations == (
        Loss("no take-off item: the drone climbs to 20 m above take-off first", 2),
    )
    found = read(items, version)
    assert [int(item.command) for item in found] == [205, 16, 50001, 2000, 16, 2001, 50001, 2000]
    assert found[0].p1 == -90.0
    assert (found[2].p1, found[2].p2) == (1.0, 25.0)
    counts = [item.p2 if version == 1 else item.p3 for item in found if item.command is PlanCommand.START_PHOTO]
    assert counts == [0.0, 1.0]
    (leg,) = translate(items, version, AIR).parts
    assert isinstance(leg, FlightPlanFile)
    assert leg.origins == (1, 2, 3, 3, 4, 5, 5, 5)
    assert leg.done == ((0, 1), (2,), (), (3,), (4,), (), (), (5,))


@pytest.mark.parametrize("version", VERSIONS)
def test_mavsdks_items(version: Version) -> None:
    """MAVSDK mission_impl.cpp: way point, speed, gimbal of no one in particular, delay, camera action."""
    items = [
        waypoint(1, 0, 20.0, 0.0, 1.0, 0.0, None),
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 5.0, -1.0),
        action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, -2.0, -2.0, -1.0, -1.0),
        action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -45.0, 0.0, None, None, 0.0, None, 0.0),
        action(mav_enums.MAV_CMD_NAV_DELAY, 2.0),
        action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE, 0.0),
        action(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE, 0.0),
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL, 2000.0, 0.0),
        action(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE, 0.0),
        action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    ]
    found = read(items, version)
    assert [int(item.command) for item in found] == [
        16,
        178,
        205,
        112 if version == 1 else 93,
        2500,
        2501,
        50001,
        2000,
        2001,
        20,
    ]
    interval = found[7].p1 if version == 1 else found[7].p2
    assert interval == 2.0


def test_a_region_of_interest_of_version_1() -> None:
    """It is numbered, and the view mode looks at its number; the same one is not numbered twice."""
    items = [
        roi(),
        GO,
        action(mav_enums.MAV_CMD_DO_SET_ROI_NONE),
        roi(height=45.0, frame=GLOBAL),
        waypoint(2, 0),
        roi(),
        waypoint(3, 0),
        action(mav_enums.MAV_CMD_DO_SET_ROI_NONE),
    ]
    assert [row[:3] if row[0] != 201 else (201, row[1], row[7]) for row in observed(items, 1) if row[0] != 16] == [
        (201, 3.0, 5.0),
        (50000, 2.0, 0.0),
        (50000, 0.0, 0.0),
        (205, 0.0, 0.0),
        (201, 3.0, 10.0),
        (50000, 2.0, 1.0),
        (50000, 2.0, 0.0),
        (50000, 0.0, 0.0),
        (205, 0.0, 0.0),
    ]


def test_a_region_of_interest_of_version_2() -> None:
    items = [
        roi(command=mav_enums.MAV_CMD_DO_SET_ROI, mode=3.0),
        waypoint(1, 0, 20.0, 0.0, 0.0, 0.0, 90.0),
        action(mav_enums.MAV_CMD_DO_SET_ROI, 0.0),
        waypoint(2, 0),
    ]
    assert observed(items, 2) == [
        (195, LAT, LON, 5.0),
        (16, 0.0, 1.0, LAT + 1e-4, LON, 20.0),  # its heading does not count
        (197,),
        (205, 0.0, 2.0),
        (16, 0.0, 1.0, LAT + 2e-4, LON, 20.0),
    ]


def test_where_a_view_mode_numbers_regions_they_are_only_numbered() -> None:
    """Parrot's version 1; the number is that of the whole mission."""
    items = [
        roi(command=mav_enums.MAV_CMD_DO_SET_ROI, mode=3.0),
        roi(height=9.0, command=mav_enums.MAV_CMD_DO_SET_ROI, mode=3.0),
        GO,
        action(50000, 2.0, 1.0),
        waypoint(2, 0),
        action(50000, 1.0, 0.0),
        waypoint(3, 0),
    ]
    assert [(row[0], row[1], row[-1]) for row in observed(items, 1) if row[0] != 16] == [
        (201, 3.0, 9.0),
        (50000, 2.0, 0.0),
        (50000, 1.0, 0.0),
    ]


@pytest.mark.parametrize("version", VERSIONS)
def test_looking_beside_the_way(version: Version) -> None:
    """QGroundControl's structure scan: the camera looks right and 5 degrees down, on the way north and east."""
    items = [
        action(mav_enums.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET, 0.0, 0.0, 0.0, 0.0, -5.0, 0.0, 90.0),
        waypoint(1, 0),
        waypoint(1, 1),
        action(mav_enums.MAV_CMD_DO_SET_ROI_NONE),
        waypoint(2, 1),
    ]
    found = read(items, version)
    assert [int(item.command) for item in found] == [205, 16, 16, 205, 16]
    assert found[0].p1 == -5.0
    assert [found[1].p4, found[2].p4] == pytest.approx([90.0, 180.0], abs=1e-3)
    assert found[4].p4 == pytest.approx(0.0, abs=1e-3) if version == 1 else found[4].p4 != found[4].p4


@pytest.mark.parametrize("version", VERSIONS)
def test_aiming_the_gimbal_ends_looking_at_something(version: Version) -> None:
    found = read(
        [roi(), GO, action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, -30.0, 0.0, 0.0, None, None, None, 2.0), waypoint(2, 0)],
        version,
    )
    ends = PlanCommand.SET_VIEW_MODE if version == 1 else PlanCommand.SET_ROI_NONE
    assert [item.command for item in found][-3:] == [ends, PlanCommand.MOUNT_CONTROL, PlanCommand.WAYPOINT]


def test_gimbal_axes_that_an_item_leaves_out_keep_their_angle() -> None:
    """Version 1 has no word for it: a line with 0 would be an order to look ahead."""
    items = [GO, action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, None, 0.0, None, None, 0.0, None, 0.0)]
    assert [row[0] for row in observed(items, 1)] == [16]
    assert translate(items, 1, AIR).parts[0].done == ((0, 1),)


def test_zooming_is_flown_by_the_gateway() -> None:
    items = [
        GO,
        action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, -30.0, 0.0, 0.0, None, None, None, 2.0),
        action(mav_enums.MAV_CMD_SET_CAMERA_ZOOM, 2.0, 50.0),
        waypoint(2, 0),
    ]
    first, step, last = translate(items, 1, AIR).parts
    assert isinstance(first, FlightPlanFile)
    assert isinstance(last, FlightPlanFile)
    assert step == GatewayStep(2, (2,))
    assert [item.command for item in plan_file.read(last.content, 1)] == [
        PlanCommand.MOUNT_CONTROL,
        PlanCommand.WAYPOINT,
    ]
    assert [loss.item for loss in examine(items, 1).stepped] == [2]


def test_an_ai_takes_a_photo_where_it_is_to_be_taken() -> None:
    """It begins a file by going to above its first way point: a photo before that one is kept here by a way point."""
    items = [
        GO,
        action(mav_enums.MAV_CMD_SET_CAMERA_ZOOM, 2.0, 40.0),
        action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0),
        waypoint(5, 0),
    ]
    first, step, last = translate(items, 2, AIR).parts
    assert step == GatewayStep(1, (1,))
    assert isinstance(first, FlightPlanFile)
    assert isinstance(last, FlightPlanFile)
    assert [row.command for row in plan_file.read(first.content, 2)] == [16]
    rows = plan_file.read(last.content, 2)
    assert [row.command for row in rows] == [16, 50001, 2000, 16]
    assert (rows[0].latitude, rows[0].altitude) == (LAT + 1e-4, 20.0)
    assert rows[0].p4 == pytest.approx(0.0, abs=1e-6)  # it has flown north
    assert last.done == ((), (), (2,), (3,))
    # Nothing has to be kept here when only settings stand before the way point, nor on the others.
    (leg,) = translate([action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0), GO], 2, AIR).parts
    assert isinstance(leg, FlightPlanFile)
    assert [row.command for row in plan_file.read(leg.content, 2)] == [178, 16]
    last = translate(items, 1, AIR).parts[2]
    assert isinstance(last, FlightPlanFile)
    assert [row.command for row in plan_file.read(last.content, 1)] == [50001, 2000, 16]


def test_beginning_in_the_middle_begins_what_runs_there() -> None:
    """As PX4 does when it resumes a survey: else it would be flown without a photo, and no one would know."""
    items = [
        action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, -90.0),
        roi(),
        GO,
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 25.0, 0.0, 1.0),
        waypoint(2, 0),
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 0.0),
    ]
    (leg,) = translate(items, 1, AIR, 4).parts
    assert isinstance(leg, FlightPlanFile)
    assert [int(item.command) for item in plan_file.read(leg.content, 1)] == [
        205,
        201,
        50000,
        2001,
        50001,
        2000,
        16,
        2001,
    ]
    assert set(leg.origins) == {4, 5}
    video = [
        GO,
        action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE),
        waypoint(2, 0),
        action(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE),
    ]
    (leg,) = translate(video, 1, AIR, 2).parts
    assert isinstance(leg, FlightPlanFile)
    assert [int(item.command) for item in plan_file.read(leg.content, 1)] == [2500, 16, 2501]


def test_camera_mode_without_effect_is_reported() -> None:
    items = [action(mav_enums.MAV_CMD_SET_CAMERA_MODE, 0.0, 1.0), GO]
    assert examine(items, 2).approximations[-1] == Loss(
        "the camera mode changes only with a photo or video, and none follows", 0
    )


def test_photos_that_are_stopped_twice_are_stopped_once() -> None:
    """QGroundControl ends photos by both commands."""
    items = [
        GO,
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 10.0, 0.0, 1.0),
        waypoint(2, 0),
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 0.0),
        action(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE),
        waypoint(3, 0),
        action(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE),
    ]
    flight = translate(items, 1, AIR)
    assert [row[0] for row in observed(items, 1)] == [16, 50001, 2000, 16, 2001, 16]
    assert flight.parts[0].done[-2:] == ((3, 4), (5, 6))


def test_a_panorama() -> None:
    assert observed([GO, action(mav_enums.MAV_CMD_PANORAMA_CREATE, 360.0, 30.0, 20.0, 10.0)], 2)[1] == (
        2800,
        360.0,
        30.0,
        20.0,
        10.0,
    )
    assert observed([GO, action(mav_enums.MAV_CMD_PANORAMA_CREATE, 360.0)], 1)[1] == (
        2800,
        360.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )


def test_old_names_of_a_photo() -> None:
    assert [
        row[0]
        for row in observed(
            [
                GO,
                action(mav_enums.MAV_CMD_DO_DIGICAM_CONTROL, 0.0, 0.0, 0.0, 0.0, 1.0),
                action(mav_enums.MAV_CMD_DO_MOUNT_CONFIGURE, 2.0, 1.0, 1.0, 1.0),
            ],
            2,
        )
    ] == [
        16,
        50001,
        2000,
    ]


WRONG = {
    "no interval": (
        [action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 0.0)],
        "no interval",
        FaultKind.PARAM,
        2,
    ),
    "too often": (
        [action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 1.0, 0.0)],
        "the camera needs 2 s between photos, not 1",
        FaultKind.PARAM,
        2,
    ),
    "too near": (
        [action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 0.5)],
        "the camera needs 1 m between photos, not 0.5",
        FaultKind.PARAM,
        1,
    ),
    "camera": (
        [action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 101.0, 0.0, 1.0)],
        "only the main camera, component 100, is supported (101)",
        FaultKind.PARAM,
        1,
    ),
    "both": (
        [action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE), action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0)],
        "photo during a video: the camera does one at a time",
        FaultKind.PLAN,
        None,
    ),
    "both again": (
        [action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 10.0), action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE)],
        "video during photos: the camera does one at a time",
        FaultKind.PLAN,
        None,
    ),
    "no place": ([roi(None, None)], "no place", FaultKind.PARAM, 5),
    "a target": (
        [roi(command=mav_enums.MAV_CMD_DO_SET_ROI, mode=4.0)],
        "only a place can be a region of interest",
        FaultKind.PARAM,
        1,
    ),
    "a region": ([action(50000, 2.0, 3.0)], "unknown region of interest", FaultKind.PARAM, 2),
    "north": (
        [action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, 0.0, 90.0, None, None, 16.0)],
        "the camera",
        FaultKind.PARAM,
        2,
    ),
    "rate": (
        [action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, 0.0, 0.0, 5.0)],
        "gimbal rates are unsupported (5)",
        FaultKind.PARAM,
        3,
    ),
    "zoom": (
        [action(mav_enums.MAV_CMD_SET_CAMERA_ZOOM, 1.0, 5.0)],
        "only a zoom range in percent is supported",
        FaultKind.PARAM,
        1,
    ),
    "tilt": (
        [action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, -120.0)],
        "pitch of -120 deg, the camera has",
        FaultKind.PARAM,
        1,
    ),
    "nothing": ([action(mav_enums.MAV_CMD_PANORAMA_CREATE, 0.0, 0.0)], "no angles", FaultKind.PARAM, 1),
    "panorama": (
        [action(mav_enums.MAV_CMD_PANORAMA_CREATE, 360.0, 3600.0)],
        "invalid angle of 3600 deg",
        FaultKind.PARAM,
        2,
    ),
    "beside": (
        [action(mav_enums.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET, None, None, None, None, -10.0, 0.0, 5000.0)],
        "invalid angle of 5000 deg",
        FaultKind.PARAM,
        7,
    ),
    "servo": (
        [action(mav_enums.MAV_CMD_DO_SET_SERVO, 5.0, 1500.0)],
        "the drone has no actuator that a flight plan could move",
        FaultKind.COMMAND,
        None,
    ),
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("items", "reason", "kind", "param"), WRONG.values(), ids=WRONG)
def test_camera_item_that_cannot_be_translated_is_refused(
    items: list[Item], reason: str, kind: FaultKind, param: int | None, version: Version
) -> None:
    (fault,) = examine([GO, *items], version).faults
    assert isinstance(fault, TranslationFault)
    assert (fault.item, fault.kind, fault.param) == (len(items), kind, param)
    assert reason in fault.reason
    with pytest.raises(PlanError):
        translate([GO, *items], version, AIR)


@pytest.mark.parametrize(
    ("item", "param"),
    [
        (action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, 0.0, 5000.0, 0.0), 2),
        (action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, 0.0, 0.0, -5000.0), 3),
        (action(mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, 0.0, 5000.0), 2),
    ],
)
def test_gimbal_angle_of_an_ai_beyond_two_turns_is_refused(item: Item, param: int) -> None:
    (fault,) = examine([GO, item], 2).faults
    assert "invalid angle" in fault.reason
    assert fault.param == param


def test_video_restarted_by_a_jump_during_photos_is_refused() -> None:
    """The video is begun a second time with photos being taken, which the list does not show."""
    items = [
        GO,
        action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE),
        waypoint(2, 0),
        action(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE),
        action(mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 10.0),
        action(mav_enums.MAV_CMD_DO_JUMP, 1.0, 1.0),
    ]
    (fault,) = examine(items, 1).faults
    assert (fault.item, fault.kind) == (1, FaultKind.PLAN)
    with pytest.raises(PlanError, match="video during photos"):
        translate(items, 1, AIR)


def test_the_versions_differ_in_what_the_gimbal_can() -> None:
    tilted = [GO, action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, 100.0)]
    turned = [GO, action(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, 0.0, 0.0, 20.0)]
    for items in (tilted, turned):
        assert [fault.kind for fault in examine(items, 1).faults] == [FaultKind.PARAM]
        assert examine(items, 2).faults == ()

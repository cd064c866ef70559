"""Plan files: read, written, and what they cannot hold. pymavlink and the simulator's own reader are the referees."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from pymavlink import mavutil, mavwp
from pymavlink.dialects.v20 import common
from support.plan_samples import (
    FLIGHT,
    LAT,
    LON,
    action,
    altitude,
    document,
    encoded,
    plans,
    simple,
    structure_scan,
    survey,
    waypoint,
)

from anafi_mav import geo, mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats import files, parrot, qgc_plan, waypoints
from anafi_mav.plans.formats.files import Format
from anafi_mav.plans.plan import (
    DO_JUMP,
    MAX_ITEMS,
    MISSION,
    NORTH,
    RELATIVE,
    FenceCircle,
    FencePolygon,
    Item,
    Loss,
    Plan,
    Point,
)
from anafi_mav.sim.plan import plan_file

# QGroundControl.


def test_a_plan_of_qgroundcontrol() -> None:
    stored = document(
        simple(1, 22, 15, 0, 0, None, LAT, LON, 50, **altitude(50)),
        simple(2, 16, 0, 0, 0, None, LAT + 0.001, LON, 50, **altitude(50)),
        simple(3, 177, 2, 5, frame=2),
        survey(4),
        simple(8, 177, 4, 1, frame=2),
        simple(9, 20, frame=2),
    )
    plan = qgc_plan.read(encoded(stored), "x.plan")
    assert [item.command for item in plan.items] == [22, 16, 177, 16, 206, 16, 206, 177, 20]
    assert plan.items[0] == Item(mav_enums.MAV_CMD_NAV_TAKEOFF, RELATIVE, (15.0, 0.0, 0.0, None, LAT, LON, 50.0))
    assert plan.items[2].params[:2] == (1.0, 5.0)  # the item with doJumpId 2 is the second
    assert plan.items[7].params[0] == 3.0  # an item of the survey
    assert plan.home == Point(LAT, LON, 35.25)
    assert plan.zones == (
        FencePolygon(False, ((LAT, LON), (LAT + 0.001, LON), (LAT, LON + 0.001))),
        FenceCircle(True, (LAT, LON), 80.5),
    )
    assert plan.breach_return == Point(LAT, LON, 30.0)
    assert plan.rally == (Point(LAT, LON, 50.0),)
    assert (plan.cruise_speed, plan.hover_speed) == (15.0, 5.0)
    assert [(block.kind, block.first, block.count) for block in plan.blocks] == [("survey", 3, 4)]
    # Written again it is the same document, with everything that only an editor needs.
    data, losses = qgc_plan.write(plan)
    assert json.loads(data) == stored
    assert losses == []


def test_block_with_changed_items_is_written_item_by_item() -> None:
    plan = qgc_plan.read(encoded(document(survey(1))), "x")
    changed = replace(plan, items=(plan.items[0], action(mav_enums.MAV_CMD_NAV_DELAY, 5.0), *plan.items[1:]))
    data, losses = qgc_plan.write(changed)
    assert [str(loss) for loss in losses] == [
        "item 0: its items are not those of the survey any more: written one by one"
    ]
    again = qgc_plan.read(data, "x")
    assert again.items == changed.items
    assert again.blocks == ()


def test_numbers_in_a_block_follow_its_position() -> None:
    """An item more in front of a survey: it is a survey still."""
    plan = qgc_plan.read(encoded(document(survey(1))), "x")
    (block,) = plan.blocks
    moved = replace(
        plan, items=(action(mav_enums.MAV_CMD_NAV_DELAY, 5.0), *plan.items), blocks=(replace(block, first=1),)
    )
    data, losses = qgc_plan.write(moved)
    assert losses == []
    stored = json.loads(data)["mission"]["items"][1]
    assert [inner["doJumpId"] for inner in stored["TransectStyleComplexItem"]["Items"]] == [2, 3, 4, 5]


def test_a_structure_scan() -> None:
    """0.0002 degrees of latitude are 22.2415 m here, 0.0003 of longitude 22.0047 m; the flight is 20 m outside.

    From the top, 30 m: the first layer of 10 m is flown at 25 m, the second at 15 m.
    """
    plan = qgc_plan.read(encoded(document(structure_scan())), "x")
    commands = [16, 196, *[16, 206, 16, 16, 16, 16, 206] * 2, 197, 16]
    assert [item.command for item in plan.items] == commands
    heights = [item.params[6] for item in plan.items if item.command == 16]
    assert heights == [40.0, *[25.0] * 5, *[15.0] * 5, 40.0]
    places = [(item.params[4] or 0.0, item.params[5] or 0.0) for item in plan.items if item.command == 16]
    assert len(set(places)) == 4
    assert places[0] == places[1] == places[5] == places[6] == places[-1]
    middle = (LAT + 0.0001, LON + 0.00015)
    offsets = [geo.offset(*middle, *place) for place in places[1:5]]
    for north, east in offsets:
        assert (abs(north), abs(east)) == pytest.approx((11.1207 + 20.0, 11.0023 + 20.0), abs=0.01)
    turns = [a[0] * b[1] - a[1] * b[0] for a, b in pairwise(offsets)]
    assert all(turn > 0.0 for turn in turns)  # clockwise, although it was drawn the other way round
    triggers = [item.params[:3] for item in plan.items if item.command == 206]
    assert triggers == [(5.0, 0.0, 1.0), (0.0, 0.0, 0.0)] * 2
    (look,) = [item for item in plan.items if item.command == 196]
    assert look.params[4:] == (-5.0, 0.0, 90.0)
    data, losses = qgc_plan.write(plan)
    assert json.loads(data) == document(structure_scan())
    assert losses == []


def test_the_older_form_of_an_item() -> None:
    stored = simple(1, 16, 1, 2, 3, 4)
    stored["params"], stored["coordinate"] = [1, 2, 3, 4], [LAT, LON, 20]
    assert qgc_plan.read(encoded(document(stored)), "x").items[0].params == (1.0, 2.0, 3.0, 4.0, LAT, LON, 20.0)


WRONG: dict[str, tuple[Any, str]] = {
    "no JSON": (b'{"fileType": "Plan"', "no JSON"),
    "deep": (b'{"a":' * 100_000, "no JSON"),
    "another file": (encoded({"fileType": "Parameters"}), "it is no QGroundControl plan"),
    "another version": (encoded(document(version=2)), "the plan is of version 2, not 1"),
    "no mission": (encoded(document(mission=None)), "mission is no object"),
    "items": (encoded(document(mission={"version": 2, "items": 5})), "mission.items is no list"),
    "an item": (encoded(document(5)), "item 0: an item is no object"),  # type: ignore[arg-type]
    "its type": (encoded(document(simple(1, 16, type="Other"))), "item 0: an item of type 'Other'"),
    "its params": (encoded(document(simple(1, 16, 0, 0, 0, 0, 0, 0, 0, 0))), "item 0: 8 params, expected 7"),
    "a param": (encoded(document(simple(1, 16), simple(2, 16, params=["1"] * 7))), "item 1: params: 1 is no number"),
    "its command": (encoded(document(simple(1, 70000))), "item 0: 70000 is no command"),
    "its frame": (encoded(document(simple(1, 16, frame=-1))), "item 0: -1 is no frame"),
    "a huge param": (encoded(document(simple(1, 16, 10**400))), "item 0: params: 10000000000000000000 is no number"),
    "a jump": (
        encoded(document(simple(1, 16), simple(2, 177, 9))),
        "item 1: it jumps to doJumpId 9, which",
    ),
    "a survey": (
        encoded(document({"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {}})),
        "item 0: the survey stores no items",
    ),
    "an aeroplane": (
        encoded(document({"type": "ComplexItem", "complexItemType": "fwLandingPattern"})),
        "item 0: items of type 'fwLandingPattern' are not for a multicopter",
    ),
    "a scan": (encoded(document({**structure_scan(), "polygon": [[1, 2]]})), "item 0: the structure scan"),
    "a scan's corner": (
        encoded(document({**structure_scan(), "polygon": [[10**400, 2]] * 3})),
        "item 0: the structure scan",
    ),
    "a scan's layers": (encoded(document({**structure_scan(), "Layers": 10**6})), "item 0: the structure scan"),
    "a fence": (encoded(document(geoFence={"version": 1})), "the fence is of version 1, not 2"),
    "a corner": (
        encoded(document(geoFence={"version": 2, "polygons": [{"polygon": [[91, 0]] * 3}], "circles": []})),
        "a corner is no place",
    ),
    "too few corners": (
        encoded(document(geoFence={"version": 2, "polygons": [{"polygon": [[9, 0]] * 2}], "circles": []})),
        "a polygon of the fence has 2 corners",
    ),
    "a circle": (
        encoded(document(geoFence={"version": 2, "circles": [{"circle": {"center": [1, 2], "radius": 0}}]})),
        "a circle of the fence has a radius of 0 m",
    ),
    "a rally point": (encoded(document(rallyPoints={"version": 2, "points": [[1]]})), "a rally point is no place"),
    "too many": (encoded(document(*[simple(1, 16)] * (MAX_ITEMS + 1))), f"more than {MAX_ITEMS} items"),
    "text": (b"hello", "it is no QGroundControl plan, does not begin with QGC WPL"),
    "binary": (bytes(range(256)), "it is no text"),
    "nothing": (b"", "it is empty"),
    "columns": (b"QGC WPL 110\n0\t1\t0\t16\t0\n", "item 0: 5 columns, expected 12"),
    "a command": (b"QGC WPL 110\n0\t1\t0\tx\t0\t0\t0\t0\t0\t0\t0\t1\n", "item 0: 'x' is no command"),
    "a huge command": (
        b"QGC WPL 110\n0\t1\t0\t" + b"9" * 5000 + b"\t0\t0\t0\t0\t0\t0\t0\t1\n",
        "item 0: '99999999999999999999' is no command",
    ),
    "a number": (b"QGC WPL 110\n0\t1\t0\t16\tinf\t0\t0\t0\t0\t0\t0\t1\n", "item 0: 'inf' is no number"),
    "a fence of a file": (
        b"QGC WPL 110\n0\t1\t0\t5001\t3\t0\t0\t0\t1\t1\t0\t1\n",
        "item 0: the polygon that begins here has not its 3 corners",
    ),
    "none of Parrot's": (
        b"QGC WPL 120\n0\t0\t3\t16\t0\t0\t0\t0\t1\t1\t9\t1\n1\t0\t3\t530\t0\t0\t0\t0\t0\t0\t0\t1\n",
        "item 1: command 530 is none of version 2",
    ),
    "a header": (b"QGC WPL x\n", "'QGC WPL x' is not the first line of a plan"),
}


@pytest.mark.parametrize(("data", "words"), WRONG.values(), ids=WRONG)
def test_invalid_file_is_one_line_with_item_and_reason(data: bytes, words: str) -> None:
    with pytest.raises(PlanError) as info:
        files.parse(data, "bad.plan")
    text = str(info.value)
    assert text.startswith("bad.plan: ")
    assert words in text
    assert "\n" not in text
    assert len(text) < 200


# WPL 110.


def test_waypoints_agree_with_pymavlinks_reader_and_writer(tmp_path: Path) -> None:
    theirs = mavwp.MAVWPLoader()
    ours, losses = waypoints.write(FLIGHT)
    (tmp_path / "ours.txt").write_bytes(ours)
    assert theirs.load(str(tmp_path / "ours.txt")) == len(FLIGHT.items) + 1
    assert [theirs.wp(n).command for n in range(theirs.count())] == [16, *[item.command for item in FLIGHT.items]]
    home, first = theirs.wp(0), theirs.wp(1)
    assert (home.frame, home.x, home.y, home.z, home.current) == (0, LAT, LON, 35.0, 1)
    assert (first.param1, first.x, first.z, first.frame) == (15.0, LAT, 15.0, 3)
    assert math.isnan(first.param4)
    jump = theirs.wp(7)
    assert (jump.command, jump.param1) == (DO_JUMP, 3)  # home is 0 there
    theirs.save(str(tmp_path / "theirs.txt"))
    again = files.load(tmp_path / "theirs.txt")  # six decimals
    assert [item.command for item in again.items] == [item.command for item in FLIGHT.items]
    assert again.items[6].params[0] == 2.0
    assert again.items[5].params[4:] == pytest.approx(FLIGHT.items[5].params[4:], abs=1e-6)
    assert again.home == FLIGHT.home
    assert {str(loss) for loss in losses} == {
        "the fence of 2 zones: a file of its own would hold it",
        "2 rally points: a file of their own would hold them",
        "the speeds that the planner assumed",
    }


def test_fences_and_rally_points_agree_with_mavproxys_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAVLINK20", "1")
    monkeypatch.setattr(mavutil, "mavlink", common)
    fence = Plan(zones=(*FLIGHT.zones, FenceCircle(True, None, 90.0, 2)), breach_return=FLIGHT.breach_return)
    data, losses = waypoints.write(fence)
    (tmp_path / "fence.txt").write_bytes(data)
    theirs = mavwp.MissionItemProtocol_Fence()
    assert theirs.load(str(tmp_path / "fence.txt")) == 3 + 1 + 1 + 1
    assert [theirs.item(n).command for n in range(6)] == [5001, 5001, 5001, 5004, 5005, 5000]
    assert (files.load(tmp_path / "fence.txt"), losses) == (fence, [])
    rally = Plan(rally=FLIGHT.rally)
    data, losses = waypoints.write(rally)
    assert (waypoints.read(data.decode(), "x"), losses) == (rally, [])


def test_a_file_without_home() -> None:
    """As MAVProxy saves the mission of a PX4: the first item is no waypoint, so it is no home."""
    text = "QGC WPL 110\n# a comment\n0\t1\t3\t22\t0\t0\t0\t0\t1\t2\t9\t1\n\n1\t0\t3\t16\t0 0 0 nan\t1\t2\t9\t0\n"
    plan = waypoints.read(text, "x")
    assert plan.home is None
    assert [(item.command, item.autocontinue) for item in plan.items] == [(22, True), (16, False)]
    assert plan.items[1].params[3] is None


@pytest.mark.parametrize(
    ("written", "read"),
    [
        (["0", "0.000000", "0"], [None, None, None]),  # by Mission Planner
        (["0", "nan", "0"], [0.0, None, 0.0]),  # by MAVProxy, from a PX4
        (["0", "90", "0"], [0.0, 90.0, 0.0]),
        (["0", "360", "0"], [None, 0.0, None]),
    ],
)
def test_heading_of_zero_is_not_set_in_a_file_without_headings(written: list[str], read: list[float | None]) -> None:
    lines = [f"{n}\t0\t3\t16\t0\t0\t0\t{heading}\t48.1\t2.1\t9\t1" for n, heading in enumerate(written, 1)]
    delay = "4\t0\t2\t93\t5\t0\t0\t0\t0\t0\t0\t1"
    home = "0\t1\t0\t16\t0\t0\t0\t0\t48.0\t2.0\t35\t1"
    plan = waypoints.read("\n".join(["QGC WPL 110", home, *lines, delay]), "x")
    assert [item.params[3] for item in plan.items] == [*read, 0.0]


def test_unset_value_is_spelled_as_its_readers_take_it() -> None:
    """.NET, Mission Planner's, knows NaN alone: with another spelling it drops the line and flies the others."""
    plan = Plan((waypoint(0, 0, 20.0), waypoint(1, 0, 20.0, 0.0, 0.0, 0.0, 90.0)), Point(LAT, LON))
    assert [item.params[3] for item in plan.items] == [None, 90.0]
    data, losses = waypoints.write(plan)
    words = [line.split(b"\t") for line in data.splitlines()[2:]]
    assert [line[7] for line in words] == [b"NaN", b"90.0"]
    assert (waypoints.read(data.decode(), "x"), losses) == (plan, [])
    drone, _ = parrot.write(plan, 2)
    assert [line.split(b"\t")[7] for line in drone.splitlines()[1:]] == [b"nan", b"90.0"]


@pytest.mark.parametrize("other", [0.0, NORTH])
def test_plan_with_headings_north_keeps_them_through_the_waypoint_format(other: float) -> None:
    first, second = waypoint(0, 0, 20.0, 0.0, 0.0, 0.0, 0.0), waypoint(1, 0, 20.0, 0.0, 0.0, 0.0, other)
    data, losses = waypoints.write(Plan((first, second), Point(LAT, LON)))
    read = waypoints.read(data.decode(), "x")
    assert ([item.params[3] for item in read.items], losses) == ([0.0, 0.0], [])  # 360 is the same


# Parrot's.


@pytest.mark.parametrize("version", [1, 2])
def test_parrot_file_is_accepted_by_the_simulated_drone(version: parrot.Version) -> None:
    data, losses = parrot.write(FLIGHT, version)
    assert data.startswith(b"QGC WPL 120\n0\t0\t3\t22\t")
    items = plan_file.read(data, version)
    lost = {loss.item for loss in losses if "none such" in loss.what}
    assert lost == ({6, 8} if version == 1 else {6})  # the jump; version 1 has no height above the sea
    kept = [item for number, item in enumerate(FLIGHT.items) if number not in lost]
    assert [int(item.command) for item in items] == [item.command for item in kept]
    first = next(item for item in items if item.command == 16)
    assert (first.latitude, first.longitude, first.altitude) == (LAT + 1e-4, LON, 20.0)
    assert (first.p2, first.p4) == (2.0, 90.0)
    photo = next(item for item in items if item.command == 2000)
    count = photo.p2 if version == 1 else photo.p3
    assert count == 1.0
    if version == 1:
        assert {item.frame for item in items} == {RELATIVE}
        assert Loss("its heading is not set: written as 0, which is north", 5) in losses
        assert Loss("param7 of 15 means nothing to the drone", 0) in losses
    else:
        assert [int(item.frame) for item in items] == [3, 2, 3, 2, 2, 3, 3, 0, 2, 2, 2]
        assert math.isnan(items[0].p4)


def test_numbers_have_all_digits_and_no_exponent() -> None:
    """Readers that take `%f` only would stop at an e; six decimals of a degree are 0.11 m."""
    data, _ = parrot.write(
        Plan((Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, 0.0, 48.878900123, -1.25e-05, 1e16)),)), 1
    )
    assert data.split(b"\t")[8:11] == [b"48.878900123", b"-0.0000125", b"10000000000000000"]


def test_formats_of_photos_in_version_1() -> None:
    """There they stand with IMAGE_START_CAPTURE; MAVLink has no word for them, Parrot's version 2 has a command."""
    lines = [
        "0\t0\t3\t2000\t5\t10\t12\t0\t0\t0\t0\t1",
        "1\t0\t3\t2000\t0\t1\t12\t0\t0\t0\t0\t1",
        "2\t0\t3\t50001\t1\t7\t0\t0\t0\t0\t0\t1",
        "3\t0\t3\t2000\t0\t0\t14\t0\t0\t0\t0\t1",
        "4\t0\t3\t2000\t2\t3\t0\t0\t0\t0\t0\t1",
    ]
    plan = parrot.read("\n".join(["QGC WPL 120", *lines, ""]), "x", 1)
    assert [(item.command, item.params[:3]) for item in plan.items] == [
        (50001, (0.0, 5.0, 12.0)),
        (2000, (None, 5.0, 10.0)),
        (2000, (None, 0.0, 1.0)),
        (50001, (1.0, 7.0, 14.0)),
        (2000, (None, 0.0, 0.0)),
        (50001, (0.0, 2.0, 0.0)),
        (2000, (None, 2.0, 3.0)),
    ]
    data, losses = parrot.write(plan, 1)
    assert losses == []
    assert parrot.read(data.decode(), "x", 1) == plan
    starts = [line.split("\t")[4:7] for line in data.decode().splitlines() if line.split("\t")[3:4] == ["2000"]]
    assert starts == [["5.0", "10.0", "12.0"], ["0.0", "1.0", "12.0"], ["0.0", "0.0", "14.0"], ["2.0", "3.0", "0.0"]]


def test_parrot_format_reports_its_losses() -> None:
    plan = Plan(
        (
            waypoint(0, 0, 20.0, frame=10),
            action(mav_enums.MAV_CMD_SET_CAMERA_MODE, 0.0, 2.0),
            Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 3.0, 0.0, None, None, 20.0)),
            Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 3.0, 0.0, LAT, LON, 20.0), autocontinue=False),
        ),
        home=Point(LAT, LON),
        rally=(Point(LAT, LON),),
    )
    data, losses = parrot.write(plan, 2)
    assert [str(loss) for loss in losses] == [
        "item 0: its height is in frame 10: version 2 has none such",
        "item 1: command 530: version 2 has none such",
        "item 2: it has no place",
        "item 3: param3 of 3 means nothing to the drone",
        "item 3: that it waits to be continued",
        "the planned home: the drone returns to where it took off",
        "1 rally point",
    ]
    assert len(data.splitlines()) == 2


# All of them.


def test_file_format_is_recognised_by_content(tmp_path: Path) -> None:
    for form in Format:
        path = tmp_path / "anything"
        files.save(FLIGHT, path, form)
        plan = files.load(path, 1 if form is Format.PARROT_1 else 2)
        assert plan.items[0].command == 22
        assert [entry.name for entry in tmp_path.iterdir()] == ["anything"]


def test_missing_and_unwritable_files_are_reported(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=r"^none\.plan: No such file or directory$"):
        files.load(tmp_path / "none.plan")
    with pytest.raises(PlanError, match="Is a directory"):
        files.load(tmp_path)
    with pytest.raises(PlanError, match=r"^x\.plan: No such file or directory$"):
        files.save(FLIGHT, tmp_path / "no" / "x.plan", Format.QGC)
    large = tmp_path / "large.plan"
    with large.open("wb") as file:
        file.truncate(100 * 1024 * 1024)
    with pytest.raises(PlanError, match="larger than 16 MiB: no flight plan"):
        files.load(large)


@settings(max_examples=150, deadline=None)
@given(plans())
def test_any_plan_through_qgroundcontrols_format(plan: Plan) -> None:
    data, losses = qgc_plan.write(plan)
    again = qgc_plan.read(data, "x")
    said = " ".join(map(str, losses))
    assert again.items == plan.items
    assert again.rally == plan.rally
    assert again.breach_return == plan.breach_return
    if plan.home is not None:
        assert again.home == plan.home
    else:
        assert "no planned home" in said
    if plan.hover_speed is None or plan.cruise_speed is None:
        assert "no speeds" in said
    else:
        assert (again.hover_speed, again.cruise_speed) == (plan.hover_speed, plan.cruise_speed)
    around_home = [zone for zone in plan.zones if isinstance(zone, FenceCircle) and zone.centre is None]
    grouped = [zone for zone in plan.zones if zone.inclusion and zone.group]
    assert said.count("around home") == len(around_home)
    assert said.count("of group") == len(grouped)
    assert [replace(zone, group=0) for zone in plan.zones if zone not in around_home] == list(again.zones)
    # What has been through once comes back as it is.
    assert qgc_plan.read(qgc_plan.write(again)[0], "x") == again


@settings(max_examples=150, deadline=None)
@given(plans())
def test_any_plan_through_the_waypoint_format(plan: Plan) -> None:
    data, losses = waypoints.write(plan)
    again = waypoints.read(data.decode(), "x")
    said = " ".join(map(str, losses))
    if plan.items:
        assert again.items == plan.items
        assert ("the fence" in said) is bool(plan.zones or plan.breach_return)
        assert ("rally point" in said) is bool(plan.rally)
        if plan.home is not None and (plan.home.latitude, plan.home.longitude) != (0.0, 0.0):
            assert again.home == plan.home
    elif plan.zones:
        assert again.zones == plan.zones
        assert ("rally point" in said) is bool(plan.rally)
    elif plan.rally:
        assert again.rally == plan.rally
    assert ("speeds" in said) is not (plan.hover_speed is plan.cruise_speed is None)


@settings(max_examples=200, deadline=None)
@given(plans())
def test_any_plan_through_parrots_formats(plan: Plan) -> None:
    """Each item is there again, or reported; of one that is there, each parameter."""
    versions: tuple[parrot.Version, ...] = (1, 2)
    for version in versions:
        data, losses = parrot.write(plan, version)
        again = list(parrot.read(data.decode(), "x", version).items)
        if version == 1:  # the format of photos stands elsewhere
            again = [item for item in again if item.command != parrot.SET_STILL_MODE]
        observed: dict[int, str] = {}
        for loss in losses:
            if loss.item is not None:
                observed[loss.item] = observed.get(loss.item, "") + loss.what
        for number, item in enumerate(plan.items):
            if version == 1 and item.command == parrot.SET_STILL_MODE:
                continue
            dropped = any(words in observed.get(number, "") for words in ("none such", "no place"))
            if dropped:
                continue
            kept = again.pop(0)
            assert kept.command == item.command
            for place, (before, after) in enumerate(zip(item.params, kept.params, strict=True), 1):
                same = before == after or (before in (None, 0.0, -1.0) and after in (None, 0.0))
                assert same or f"param{place} of" in observed[number] or "heading" in observed[number], (
                    place,
                    item,
                    kept,
                )
            assert item.autocontinue or "continued" in observed[number]
        assert again == []


def test_unset_and_zero_are_not_the_same() -> None:
    """Heading "not set" and heading north: only version 1 confuses them, and says so."""
    one = Plan((waypoint(0, 0, 20.0, 0.0, 0.0, 0.0, None), waypoint(0, 0, 20.0, 0.0, 0.0, 0.0, 0.0)))
    for form in (Format.QGC, Format.WAYPOINTS, Format.PARROT_2):
        data, _ = files.encode(one, form)
        assert [item.params[3] for item in files.parse(data, "x", 2).items] == [None, 0.0]
    data, losses = files.encode(one, Format.PARROT_1)
    assert [loss.item for loss in losses] == [0]


def test_commands_are_mavlinks() -> None:
    for table in parrot.COMMANDS.values():
        for command in table:
            assert command in common.enums["MAV_CMD"] or command in (50000, 50001)
    assert MISSION == common.MAV_FRAME_MISSION

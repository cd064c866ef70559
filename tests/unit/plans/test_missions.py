"""The sample missions of `missions/`: through every format and back, and the wrong ones."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest

from anafi_mav.cli import main
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats import files, parrot
from anafi_mav.plans.formats.files import Format
from anafi_mav.plans.path import place_of
from anafi_mav.plans.plan import WAYPOINT, Item, Loss, Plan
from anafi_mav.plans.translation.parrot_export import export_parrot
from anafi_mav.sim.plan import plan_file

MISSIONS = Path(__file__).parents[3] / "missions"
SAMPLES = sorted(MISSIONS.glob("*.plan"))
WRONG = MISSIONS / "wrong"

FORMS = (Format.WAYPOINTS, Format.PARROT_1, Format.PARROT_2)


def test_there_are_samples_of_each_kind() -> None:
    names = {path.stem for path in SAMPLES}
    assert names >= {
        "survey",
        "corridor",
        "structure",
        "orbit",
        "inspection",
        "timelapse",
        "panorama",
        "delivery",
        "loop",
    }
    kinds = {block.kind for path in SAMPLES for block in files.load(path).blocks}
    assert kinds == {"survey", "CorridorScan", "StructureScan"}


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_sample_mission_is_written_as_it_was_read(path: Path) -> None:
    data, losses = files.encode(files.load(path), Format.QGC)
    assert losses == []
    assert json.loads(data) == json.loads(path.read_bytes())


def said(losses: list[Loss], item: int | None) -> str:
    return "; ".join(loss.what for loss in losses if loss.item == item)


def differences(before: Plan, after: Plan) -> set[str]:
    """What of a plan, apart from its items, is not the same."""
    pairs = {
        "home": (before.home, after.home),
        "fence": ((before.zones, before.breach_return), (after.zones, after.breach_return)),
        "rally": (before.rally, after.rally),
        "speeds": ((before.cruise_speed, before.hover_speed), (after.cruise_speed, after.hover_speed)),
    }
    return {name for name, (one, two) in pairs.items() if one != two}


def same(before: Item, after: Item) -> bool:
    """Not set, zero and -1 mean the same in a parameter that means nothing; no heading is not north."""
    nothing = (None, 0.0, -1.0)
    params = all(
        one == two or (one in nothing and two in nothing and (before.command, number) != (WAYPOINT, 4))
        for number, (one, two) in enumerate(zip(before.params, after.params, strict=True), 1)
    )
    return params and (before.command, before.autocontinue) == (after.command, after.autocontinue)


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_converted_sample_differs_by_its_listed_losses_only(path: Path, form: Format) -> None:
    """Each difference has a loss, and each loss is a difference."""
    plan = files.load(path)
    data, losses = files.encode(plan, form)
    version: parrot.Version = 1 if form is Format.PARROT_1 else 2
    again = files.parse(data, path.name, version)
    of_plan = said(losses, None)
    observed = {"home": "home", "fence": "the fence", "rally": "rally point", "speeds": "speeds"}
    assert differences(plan, again) == {name for name, words in observed.items() if words in of_plan}
    assert again.blocks == ()
    left = list(again.items)
    for number, item in enumerate(plan.items):
        words = said(losses, number)
        if "none such" in words or "no place" in words:
            continue
        kept = left.pop(0)
        edited = "can no longer be edited" in words
        assert same(item, kept) is (not words or (edited and words.count(";") == 0)), (number, words, item, kept)
        assert kept.frame == item.frame or parrot.COMMANDS[version][item.command] < {5, 6, 7}
    assert left == []
    assert len([loss for loss in losses if "edited" in loss.what]) == len(plan.blocks)
    # From there it goes through QGroundControl's format, and back to the same file.
    through, _ = files.encode(again, Format.QGC)
    assert files.parse(through, "x").items == again.items
    assert files.encode(replace(files.parse(through, "x"), home=again.home), form)[0] == data


WRONG_FILES = {
    "cut-off.plan": "no JSON: Input data was truncated",
    "empty.plan": "it is empty",
    "packed.plan": "it is no text",
    "letter.txt": "it is no QGroundControl plan, does not begin with QGC WPL, and is no KML or GeoJSON",
    "other-json.plan": "it is no QGroundControl plan",
    "other-version.plan": "the plan is of version 2, not 1",
    "no-mission.plan": "mission is no object",
    "items-no-list.plan": "mission.items is no list",
    "item-no-object.plan": "item 2: an item is no object",
    "item-type.plan": "item 1: an item of type 'Waypoint'",
    "six-params.plan": "item 1: 6 params, expected 7",
    "text-param.plan": "item 1: params: north is no number",
    "command-number.plan": "item 1: 70000 is no command",
    "frame-number.plan": "item 1: -1 is no frame",
    "jump-nowhere.plan": "item 2: it jumps to doJumpId 9, which is not there",
    "survey-without-items.plan": "item 1: the survey stores no items: save the plan with a newer QGroundControl",
    "aeroplane-landing.plan": "item 1: items of type 'fwLandingPattern' are not for a multicopter, or not known",
    "structure-version.plan": "item 1: the structure scan cannot be understood: its version is 2, not 3",
    "fence-two-corners.plan": "a polygon of the fence has 2 corners",
    "fence-no-radius.plan": "a circle of the fence has a radius of 0 m",
    "fence-corner-nowhere.plan": "a corner is no place",
    "rally-nowhere.plan": "a rally point is no place",
    "columns.waypoints": "item 1: 11 columns, expected 12",
    "command.waypoints": "item 1: 'takeoff' is no command",
    "infinite.waypoints": "item 1: 'inf' is no number",
    "comma.waypoints": "item 1: '48,8789' is no number",
    "fence.waypoints": "item 0: the polygon that begins here has not its 4 corners",
    "header.mavlink": "'QGC WPL one' is not the first line of a plan",
    "command.mavlink": "item 1: command 530 is none of version 2",
    "no-line.kml": "it has no lines, expected one",
    "document-type.kml": "it declares a document type: no KML",
    "swapped.geojson": "point 1 of its line is no place",
}
"""What cannot be read."""


@pytest.mark.parametrize("action", ["show", "check"])
@pytest.mark.parametrize("name", WRONG_FILES)
def test_a_wrong_file_is_one_line(name: str, action: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", action, str(WRONG / name), "--model", "ai", "--height", "20"]) == 1
    assert capsys.readouterr() == ("", f"anafi-mav: {name}: {WRONG_FILES[name]}\n")


@pytest.mark.parametrize("content", [b"\0" * 4096, b"QGC WPL 110\n" + b"0\t1\t" * 4096, b'{"fileType":"Plan",' * 4096])
def test_a_hundred_megabytes_are_refused_quickly(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "huge.plan"
    with path.open("wb") as file:
        for _ in range(100 * 2**20 // len(content) + 1):
            file.write(content)
    begun = time.process_time()
    with pytest.raises(PlanError, match=r"^huge\.plan: it is larger than 16 MiB: no flight plan$"):
        files.load(path)
    assert time.process_time() - begun < 1.0


def test_failed_conversion_leaves_the_old_file(tmp_path: Path) -> None:
    """Nothing is half-stored: neither the file that was there is touched nor another one left behind."""
    out = tmp_path / "out.plan"
    out.write_text("the old one")
    for name in WRONG_FILES:
        assert main(["plan", "convert", str(WRONG / name), str(out), "--model", "ai", "--height", "20"]) == 1
    assert out.read_text() == "the old one"
    assert list(tmp_path.iterdir()) == [out]


GATEWAYS = {"inspection": 8}
"""Samples that a gateway has to fly, and the first item for which it has to."""

TWINS = [(path, version) for path in SAMPLES if path.stem not in GATEWAYS for version in (1, 2)]


@pytest.mark.parametrize(("path", "version"), TWINS, ids=lambda value: getattr(value, "stem", None))
def test_a_samples_twin_is_current(path: Path, version: parrot.Version, tmp_path: Path) -> None:
    """Made again by the command that made it (missions/README.md); the drone's own reader takes it as it is meant."""
    kept, made = path.with_name(f"{path.stem}.v{version}.mavlink"), tmp_path / "twin.mavlink"
    model = "4k" if version == 1 else "ai"
    assert main(["plan", "convert", str(path), str(made), "--model", model]) == 0
    one, two = files.load(kept, version).items, files.load(made, version).items
    assert [(item.command, item.frame) for item in one] == [(item.command, item.frame) for item in two]
    for before, after in zip(one, two, strict=True):
        assert before.params == pytest.approx(after.params, abs=1e-7)
    read = plan_file.read(kept.read_bytes(), version)
    ways = [item for item in read if item.command == plan_file.PlanCommand.WAYPOINT]
    places = [(item.latitude, item.longitude) for item in ways]
    wanted = [place_of(item) for item in files.load(path).items if item.command == WAYPOINT]
    assert [place for place in wanted if place is not None and place not in places] == []
    assert all(0.0 < item.altitude <= 30.0 for item in ways)


@pytest.mark.parametrize(("path", "version"), TWINS, ids=lambda value: getattr(value, "stem", None))
def test_parrot_export_of_a_sample_survives_rewriting(path: Path, version: parrot.Version) -> None:
    """Through Parrot's file, QGroundControl's and Parrot's again, as often as a person converts it."""
    kept = path.with_name(f"{path.stem}.v{version}.mavlink").read_bytes()
    plan = files.parse(kept, path.name, version)
    for _ in range(3):
        editable = files.encode(plan, Format.QGC)[0]
        again, _ = export_parrot(files.parse(editable, path.name), version, path.name)
        assert again == kept
        plan = files.parse(again, path.name, version)


def test_parrot_export_of_gateway_items_does_not_exist(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, item in GATEWAYS.items():
        out = tmp_path / "out.mavlink"
        assert main(["plan", "convert", str(MISSIONS / f"{name}.plan"), str(out), "--model", "4k"]) == 1
        said = capsys.readouterr().err
        assert said == f"anafi-mav: {name}.plan: item {item}: a gateway has to fly it: no file for the drone alone\n"
        assert not out.exists()


def test_every_wrong_file_is_expected() -> None:
    assert {path.name for path in WRONG.iterdir()} == {*WRONG_FILES, *WRONG_MISSIONS}


WRONG_MISSIONS = {
    "servo.plan": "item 2: DO_SET_SERVO: the drone has no actuator that a flight plan could move",
    "terrain.plan": "item 1: NAV_WAYPOINT: heights above terrain are unsupported",
    "latitude.plan": "item 1: NAV_WAYPOINT: invalid latitude 148.879",
    "waypoint-nowhere.plan": "item 1: NAV_WAYPOINT: no longitude",
    "negative-hold.plan": "item 1: NAV_WAYPOINT: invalid wait of -5 s",
    "no-speed.plan": "item 1: DO_CHANGE_SPEED: invalid speed of 0 m/s",
    "relative-speed.plan": "item 1: DO_CHANGE_SPEED: relative speeds are unsupported",
    "circles.plan": "item 1: NAV_LOITER_TURNS: the drone flies straight lines: draw the circle as way points",
    "time-of-day.plan": "item 2: NAV_DELAY: waiting for a time of day is unsupported",
    "after-landing.plan": "item 3: follows a landing, which ends the plan",
    "round-and-round.plan": "item 2: endless loop, no flight",
    "nothing-flies.plan": "item 0: no item moves the drone",
    "waits.plan": "item 1: autocontinue 0 is unsupported",
    "jump-too-far.waypoints": "item 2: jump target does not exist",
    "beyond-fence.plan": "item 1: the way there leaves the fence (inclusion circle 0)",
    "too-high.plan": "item 1: 450 m above take-off is higher than the limit of 150 m",
    "too-fast.plan": "item 1: 40 m/s is more than the 15 that an ANAFI 4K flies",
    "too-far.plan": "item 2: it is 4.5 km from home, where no setting lets the drone fly",
    "below-ground.plan": "item 1: -10 m is below the take-off",
}
"""What can be read and cannot be flown."""

NOT_WITHOUT_LIMITS = ("beyond-fence.plan", "too-high.plan", "too-fast.plan", "too-far.plan", "below-ground.plan")
"""What only the drone's limits and the fence forbid."""


@pytest.mark.parametrize("name", [name for name in WRONG_MISSIONS if name not in NOT_WITHOUT_LIMITS])
@pytest.mark.parametrize("model", ["4k", "ai"])
def test_a_wrong_mission_becomes_no_file(
    name: str, model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.mavlink"
    assert main(["plan", "convert", str(WRONG / name), str(out), "--model", model]) == 1
    assert capsys.readouterr() == ("", f"anafi-mav: {name}: {WRONG_MISSIONS[name]}\n")
    assert not out.exists()


@pytest.mark.parametrize("name", WRONG_MISSIONS)
def test_a_wrong_mission_is_one_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "check", str(WRONG / name), "--model", "4k"]) == 1
    assert capsys.readouterr() == (f"{name}: error: {WRONG_MISSIONS[name]}\n", "")


@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_a_sample_is_good(path: Path, model: str, capsys: pytest.CaptureFixture[str]) -> None:
    """By the lint's own estimate each is flown in two minutes."""
    assert main(["plan", "check", str(path), "--model", model]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith(f"{path.name}: an ANAFI ")
    assert " in about 1 min " in last

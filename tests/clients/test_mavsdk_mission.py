"""Unmodified MAVSDK: plugins mission and mission_raw (conformance 47, 49, 73, 74, 116)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.flavours import both
from support.plans import ACCEPTED, MISSION, download, mission, upload
from support.product import program
from support.world import HOME, World, world

from anafi_mav.plans.formats import files
from anafi_mav.services.plan.item_messages import to_wire

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_mission.py")
SAMPLES = sorted((Path(__file__).parents[2] / "missions").glob("*.plan"))


def script(w: World, *paths: Path) -> tuple[str, ...]:
    url = f"tcpout://{w.address}:5760"
    return (sys.executable, "-u", str(SCRIPT), url, str(HOME[0]), str(HOME[1]), *map(str, paths))


async def test_conf_116_a_mission_of_mavsdks_own_kind() -> None:
    """Up, down, flown, held, gone on with and finished; the drone did what the items say, in their order."""
    async with world(web=True) as w, program(*script(w)) as mavsdk:
        await mavsdk.line(lambda line: line == "done", timeout=150.0)
        assert mavsdk.said("read") == mavsdk.said("sent")
        assert mavsdk.said("mode") == ["MISSION", "HOLD", "MISSION", "RETURN_TO_LAUNCH"]
        assert mavsdk.said("finished") == ["False", "True"]
        counted = [tuple(map(int, line.split())) for line in mavsdk.said("progress")]
        assert [number for number, total in counted] == sorted(number for number, total in counted)
        assert {number for number, total in counted} >= {1, 2, 3, 4}
        assert {total for number, total in counted} == {4}
        assert mavsdk.said("current") == ["2"]
        assert len(mavsdk.said("no item")) == len(mavsdk.said("left")) == 1

        # What the drone itself has done: the way point that it was held on the way to is begun twice.
        names = [entry.args["command"] for entry in w.drone.log if entry.name == "item"]
        lines = [name.removeprefix("condition_") for name in names]
        assert [line for line in lines if line not in ("change_speed", "set_still_mode")] == [
            "takeoff", "waypoint", "waypoint", "waypoint", "delay", "mount_control", "delay", "start_photo",
            "waypoint", "mount_control", "start_video", "waypoint", "stop_video", "return_to_launch",
        ]  # fmt: skip
        done = [entry.args["command"].rpartition(".")[2] for entry in w.drone.log if entry.name == "payload"]
        modes = ("set_camera_mode", "set_photo_mode")
        assert [name for name in done if name not in modes] == ["take_photo", "start_recording", "stop_recording"]


@both
async def test_conf_116_raw_missions(flavour: str) -> None:
    """What QGroundControl has stored is imported, uploaded and read back; another client's upload is reported."""
    async with world(flavour=flavour, web=True) as w, program(*script(w, *SAMPLES)) as mavsdk:
        await mavsdk.line(lambda line: line == "yours", timeout=120.0)
        found = {name: words for name, *words in map(str.split, mavsdk.said("import"))}
        assert set(found) == {path.name for path in SAMPLES}
        for name, words in found.items():
            if name in ("corridor.plan", "structure.plan"):  # survey items that MAVSDK's reader does not know
                assert words == ["FAILED_TO_PARSE_QGC_PLAN"]
            else:
                # An ArduPilot's item 0 is home, which no client sets.
                assert words[1] == ("differs:0" if flavour == "ardupilot" else "equal"), (name, words)
        other = await w.connect(254)
        seen = await download(other, MISSION)
        wanted = [to_wire(item) for item in files.load(SAMPLES[-1]).items]
        home = 1 if flavour == "ardupilot" else 0
        assert [(m.command, m.x, m.y, m.z) for m in seen[home:]] == [(i.command, i.x, i.y, i.z) for i in wanted]
        ours = mission(HOME, 7)
        assert (await upload(other, ours, MISSION)).type == ACCEPTED
        await mavsdk.line(lambda line: line == "done", timeout=30.0)
        assert mavsdk.said("changed to") == mavsdk.said("kept") == ["7"]
        assert mavsdk.said("refused") == ["UNSUPPORTED"]

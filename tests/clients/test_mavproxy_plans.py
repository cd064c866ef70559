"""Unmodified MAVProxy without a terminal: its `fence`, `rally` and `wp` (conformance D1, 76, 77, 119, 142)."""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.flavours import both
from support.plans import FENCE, MISSION, RALLY, Item, around, circle, download, rally, square, upload
from support.product import Process, program
from support.world import HOME, World, world

from anafi_mav import mav_enums
from anafi_mav.mavlink import dialect as newer

pytestmark = pytest.mark.third_party

MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"
PLACE = (HOME[0], HOME[1])


def waypoint_file(path: Path, items: list[Item]) -> Path:
    """As MAVProxy and Mission Planner store them: QGC WPL 110."""
    lines = [
        f"{seq}\t0\t{item.frame}\t{item.command}\t{item.p1}\t{item.p2}\t{item.p3}\t{item.p4}"
        f"\t{item.latitude:.8f}\t{item.longitude:.8f}\t{item.z}\t1"
        for seq, item in enumerate(items)
    ]
    path.write_text("\n".join(["QGC WPL 110", *lines, ""]))
    return path


async def typed(mavproxy: Process, command: str, pattern: str, timeout: float = 15.0) -> str:
    """Type a command; the line that follows and has the pattern in it, behind MAVProxy's prompt perhaps."""
    since = len(mavproxy.lines)
    mavproxy.say(command)
    return await mavproxy.line(lambda line: re.search(pattern, line) is not None, since=since, timeout=timeout)


async def listed(mavproxy: Process, what: str, how: str = "list") -> list[int]:
    """The commands that `fence list`, `rally list`, `wp list` or `wp ftp` prints."""
    since = len(mavproxy.lines)
    await typed(mavproxy, f"{what} {how}", r"Saved \d+ waypoints to |Saved \w+ items to ")
    rows = [re.search(r"\b(\d+) \d+ -?\d+\.\d{10} ", line) for line in mavproxy.lines[since:]]
    return [int(row[1]) for row in rows if row is not None]


async def changed(w: World, kind: int, command: str, mavproxy: Process) -> list[Any]:
    """Type a command that changes a list; what another client reads once the vehicle has reported that it has changed.

    Not sooner: who uploads while another client downloads is refused, and MAVProxy does not try again.
    """
    before = ids(await w.client.wait("MISSION_CURRENT"))[kind]
    mark = w.client.mark()
    mavproxy.say(command)
    await w.client.wait("MISSION_CURRENT", lambda m: ids(m)[kind] != before, since=mark, timeout=10.0)
    return await download(w.client, kind)


def ids(message: Any) -> dict[int, int]:
    """Which fence and rally points there are, by MISSION_CURRENT: fields that pymavlink's own dialect has not yet."""
    (whole,) = newer.MAVLink(None).parse_buffer(message.get_msgbuf())
    return {MISSION: whole.mission_id, FENCE: whole.fence_id, RALLY: whole.rally_points_id}


def same(seen: list[Any], wanted: list[Item]) -> bool:
    """MAVProxy cuts degrees times 1e7 off instead of rounding them."""
    for message, item in zip(seen, wanted, strict=True):
        assert (message.command, message.param1, message.z, message.frame) == (
            item.command,
            item.p1,
            item.z,
            item.frame,
        )
        place = (message.x / 1e7, message.y / 1e7)
        assert place == pytest.approx((item.latitude, item.longitude), abs=1.01e-7)
    return True


@both
async def test_conf_119_fence_and_rally(flavour: str, tmp_path: Path) -> None:
    async with world(flavour=flavour) as w:
        words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{w.address}:5760", f"--state-basedir={tmp_path}")
        async with program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy:
            await mavproxy.line(lambda line: "online system 1" in line)
            await mavproxy.line(lambda line: re.search(r"Received \d+ parameters", line) is not None, timeout=30.0)

            # A fence: from a file, reported, listed, disabled, enabled, cleared.
            fence = [*square(PLACE, 50.0), circle(PLACE, 5.5, inclusion=False)]
            since = len(mavproxy.lines)
            command = f"fence load {waypoint_file(tmp_path / 'fence.txt', fence)}"
            assert same(await changed(w, FENCE, command, mavproxy), fence)
            await mavproxy.line(lambda line: "Loaded 5 fence items in" in line, since=since)
            await mavproxy.line(lambda line: "fence present" in line, since=since)
            await mavproxy.line(lambda line: "fence enabled" in line, since=since)
            assert await listed(mavproxy, "fence") == [5001] * 4 + [5004]
            await typed(mavproxy, "fence disable", "fence disabled")
            await typed(mavproxy, "fence enable", "fence enabled")
            since = len(mavproxy.lines)
            assert await changed(w, FENCE, "fence clear", mavproxy) == []
            await mavproxy.line(lambda line: "fence removed" in line, since=since)
            await typed(mavproxy, "fence list", "Requesting 0 fence items")
            # One that is around home, drawn without a map.
            (home,) = await changed(w, FENCE, "fence addhomecircle 70", mavproxy)
            assert (home.command, home.param1) == (5005, 70.0)

            # Rally points; another client's are listed, too.
            points = [rally(PLACE, 20.0), rally((PLACE[0] + 0.001, PLACE[1]), 25.0)]
            command = f"rally load {waypoint_file(tmp_path / 'rally.txt', points)}"
            assert same(await changed(w, RALLY, command, mavproxy), points)
            other = [rally(PLACE, 31.0), rally(PLACE, 32.0), rally(PLACE, 33.0)]
            assert (await upload(w.client, other, RALLY)).type == 0
            assert await listed(mavproxy, "rally") == [5100] * 3
            heights = [31.0, 32.0, 33.0]
            if flavour == "ardupilot":  # points edited in place; PX4 has no such thing
                for number, height in ((3, 44.0), (1, 41.0)):
                    heights[number - 1] = height
                    edited = await changed(w, RALLY, f"rally changealt {number} {height}", mavproxy)
                    assert [m.z for m in edited] == heights
            rest = await changed(w, RALLY, "rally remove 2", mavproxy)
            assert [m.z for m in rest] == [heights[0], heights[2]]
            assert await changed(w, RALLY, "rally clear", mavproxy) == []
            assert not [line for line in mavproxy.lines if re.search("Traceback|ERROR|fence breach", line)], mavproxy


async def test_conf_119_142_missions(tmp_path: Path) -> None:
    """From a file, listed, edited in place, saved, its current item set, flown, and cleared."""
    async with world(flavour="ardupilot", web=True) as w:
        words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{w.address}:5760", f"--state-basedir={tmp_path}")
        async with program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy:
            await mavproxy.line(lambda line: "online system 1" in line)
            await mavproxy.line(lambda line: re.search(r"Received \d+ parameters", line) is not None, timeout=30.0)

            north, corner = around(PLACE, (15.0, 0.0), (15.0, 12.0))
            wanted = [
                Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME),
                Item(mav_enums.MAV_CMD_NAV_TAKEOFF, *PLACE, z=6.0, frame=3),
                Item(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=4.0, frame=3),
                Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *north, z=6.0, frame=3),
                Item(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, 0.0, 0.0, p1=-60.0, z=2.0, frame=3),
                Item(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, p3=1.0, frame=3),
                Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *corner, z=6.0, p1=1.0, frame=3),
                Item(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, 0.0, frame=3),
            ]
            command = f"wp load {waypoint_file(tmp_path / 'way.txt', wanted)}"
            assert same(await changed(w, MISSION, command, mavproxy), wanted)
            await mavproxy.line(lambda line: "Loaded 8 waypoints in" in line)
            assert await listed(mavproxy, "wp") == [item.command for item in wanted]

            # As a file over MAVLink FTP, both ways.
            assert await listed(mavproxy, "wp", "ftp") == [item.command for item in wanted]
            higher = [replace(item, z=7.0) if item.command == 16 and item.frame == 3 else item for item in wanted]
            load = f"wp ftpload {waypoint_file(tmp_path / 'higher.txt', higher)}"
            assert same(await changed(w, MISSION, load, mavproxy), higher)
            await mavproxy.line(lambda line: "Sent waypoint of length 8 in" in line)
            command = f"wp load {waypoint_file(tmp_path / 'lower.txt', wanted)}"  # MAVProxy has written way.txt since
            assert same(await changed(w, MISSION, command, mavproxy), wanted)

            # Edited in place, by MISSION_WRITE_PARTIAL_LIST: one item, two items, a parameter.
            edited = await changed(w, MISSION, "wp changealt 6 9", mavproxy)
            assert [m.z for m in edited] == [item.z if seq != 6 else 9.0 for seq, item in enumerate(wanted)]
            edited = await changed(w, MISSION, "wp param 6 1 2", mavproxy)
            assert [m.param1 for m in edited] == [item.p1 if seq != 6 else 2.0 for seq, item in enumerate(wanted)]
            edited = await changed(w, MISSION, "wp remove 5", mavproxy)
            assert [m.command for m in edited] == [16, 22, 178, 16, 205, 16, 20]
            await typed(mavproxy, f"wp save {tmp_path / 'again.txt'}", "Saved 7 waypoints to ")
            again = (tmp_path / "again.txt").read_text().splitlines()[1:]
            assert [line.split("\t")[3] for line in again] == ["16", "22", "178", "16", "205", "16", "20"]

            # The current item, and the flight from there.
            mark = w.client.mark()
            mavproxy.say("wp set 5")
            await w.client.wait("MISSION_CURRENT", lambda m: m.seq == 5, since=mark)
            mavproxy.say("wp set 1")
            await w.client.wait("MISSION_CURRENT", lambda m: m.seq == 1, since=mark)
            for word, ack in (("arm throttle", "COMPONENT_ARM_DISARM"), ("mode auto", "DO_SET_MODE")):
                await typed(mavproxy, word, f"Got COMMAND_ACK: {ack}: ACCEPTED")
            await mavproxy.line(lambda line: re.search(r"Mode AUTO", line) is not None)
            reached = [
                (await w.client.wait("MISSION_ITEM_REACHED", lambda m, n=n: m.seq == n, since=mark, timeout=40.0)).seq
                for n in range(1, 7)
            ]
            assert reached == [1, 2, 3, 4, 5, 6]
            assert [entry.args["command"] for entry in w.drone.log if entry.name == "item"][-1] == "return_to_launch"
            assert await changed(w, MISSION, "wp clear", mavproxy) == []
            assert not [line for line in mavproxy.lines if re.search("Traceback|ERROR", line)], mavproxy

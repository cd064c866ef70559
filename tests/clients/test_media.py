"""Unmodified MAVSDK and MAVProxy: the drone's photos and videos over FTP (conformance 113, 116)."""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
from functools import partial
from pathlib import Path

import pytest
from support.media import DAY, add_photo, add_video
from support.product import program
from support.world import world

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_media.py")
MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"
VIDEO = 400_000


async def test_conf_116_mavsdk_lists_downloads_and_removes_media(tmp_path: Path) -> None:
    async with world(web=True) as w:
        photo, video = add_photo(w.drone), add_video(w.drone, VIDEO)
        path = f"/media/{DAY}/{video.id}"
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760", str(tmp_path), path)
        async with program(*words, env={"HOME": str(tmp_path)}) as script:
            await script.line(lambda line: line == "done", timeout=60.0)
            assert script.said("day") == [DAY]
            assert script.said("files") == [f"{photo.id} {video.id}"]
            assert script.said("identical") == [f"{photo.id} True", f"{video.id} True"]
            assert script.said("removed") == ["FILE_DOES_NOT_EXIST"]
        assert (tmp_path / photo.id).read_bytes() == photo.content()
        assert (tmp_path / video.id).read_bytes() == video.content()
        assert w.drone.firmware.payload.media.resource(video.id) is None


async def test_conf_113_mavproxy_lists_downloads_and_removes_media(tmp_path: Path) -> None:
    async with world(web=True) as w:
        photo = add_photo(w.drone)
        added = w.drone.log[-1].t
        path = f"/media/{DAY}/{photo.id}"
        words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{w.address}:5760", f"--state-basedir={tmp_path}")
        async with program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy:
            await mavproxy.line(lambda line: "online system 1" in line, timeout=30.0)
            steps = (
                ("set target_component 100", ""),
                (f"ftp list /media/{DAY}", rf"{photo.id}\s+{photo.size}"),
                (f"ftp get {path} {tmp_path}/copy.jpg", rf"Wrote {photo.size} bytes"),
                (f"ftp rm {path}", "Removing"),
            )
            for command, pattern in steps:
                since = len(mavproxy.lines)
                mavproxy.say(command)
                if pattern:
                    expected = partial(re.search, pattern)
                    await mavproxy.line(lambda line, find=expected: bool(find(line)), since=since, timeout=20.0)
            await w.drone.wait_log(
                lambda entry: entry.name == "mediastore.counters" and entry.args["photo_media_count"] == 0,
                timeout=20.0,
                since=added,
            )
            assert w.drone.firmware.payload.media.resource(photo.id) is None
            mavproxy.say("ftp list /")
            await mavproxy.line(lambda line: "D media" in line, timeout=10.0)
        assert (tmp_path / "copy.jpg").read_bytes() == photo.content()

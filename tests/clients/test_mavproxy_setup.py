"""Unmodified MAVProxy without a terminal: its `param` and `ftp`, in both flavours (conformance D1, 114)."""

from __future__ import annotations

import asyncio
import json
import lzma
import re
import shutil
import sys
import zlib
from pathlib import Path

import pytest
from support.flavours import both
from support.params import fetch
from support.product import Process, program
from support.world import World, world

pytestmark = pytest.mark.third_party

MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"


async def typed(mavproxy: Process, command: str, pattern: str, timeout: float = 15.0) -> str:
    """Type a command; the line that follows and has the pattern in it, behind MAVProxy's prompt perhaps."""
    since = len(mavproxy.lines)
    mavproxy.say(command)
    return await mavproxy.line(lambda line: re.search(pattern, line) is not None, since=since, timeout=timeout)


async def setup(w: World, mavproxy: Process, flavour: str, folder: Path) -> None:
    count = len(await fetch(w.client))
    await mavproxy.line(lambda line: "online system 1" in line)
    # PX4's clients find no packed file and take the list; ArduPilot's load the file.
    how = r"(?! \(ftp\))" if flavour == "px4" else r" \(ftp\)"
    await mavproxy.line(lambda line: re.search(f"Received {count} parameters{how}", line) is not None, timeout=30.0)

    await typed(mavproxy, "param show ANF_MODEL", r"ANF_MODEL\s+2324")
    await typed(mavproxy, "param show ANF_MAX_TILT", r"ANF_MAX_TILT\s+10\.0")
    name, value, tilt = ("MPC_TILTMAX_AIR", "25", 25.0) if flavour == "px4" else ("ANGLE_MAX", "2500", 25.0)
    mavproxy.say(f"param set {name} {value}")
    await w.drone.wait_log(lambda entry: entry.kind == "command" and entry.name.endswith("MaxTilt"), 10.0)
    assert w.commands("ardrone3.PilotingSettings.MaxTilt")[-1].args == {"current": tilt}
    await typed(mavproxy, f"param fetch {name}", rf"{name} = {value}\.0")
    await typed(mavproxy, "param fetch ANF_MAX_TILT", r"ANF_MAX_TILT = 25\.0")
    # A whole number by its own encoding.
    name, value, ending = ("ANF_RTH_END", "0", 0) if flavour == "px4" else ("FENCE_TYPE", "3", None)
    mavproxy.say(f"param set {name} {value}")
    if ending is not None:
        await w.drone.wait_log(lambda entry: entry.name == "rth.set_ending_behavior", 10.0)
        assert w.commands("rth.set_ending_behavior")[-1].args == {"ending_behavior": 0}
    else:
        await w.drone.wait_log(lambda entry: entry.name.endswith("NoFlyOverMaxDistance"), 10.0)
    await typed(mavproxy, f"param fetch {name}", rf"{name} = {value}")

    await typed(mavproxy, "ftp list", r"general\.json\.xz\s+\d+")
    await typed(mavproxy, f"ftp get /parameter.json.xz {folder}/parameter.json.xz", r"Wrote \d+ bytes")
    crc = await typed(mavproxy, "ftp crc /parameter.json", r"crc: /parameter.json 0x")
    await typed(mavproxy, "ftp get /nothing", "ftp open failed")
    # MAVProxy says that it wrote before it closes the file; by now it has.
    content = lzma.decompress((folder / "parameter.json.xz").read_bytes())
    assert len(json.loads(content)["parameters"]) == count
    assert f" 0x{zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF:08x} " in crc
    assert not [line for line in mavproxy.lines if "Traceback" in line], mavproxy


@both
async def test_conf_114_mavproxy_param_and_ftp(flavour: str, tmp_path: Path) -> None:
    async with world(flavour=flavour) as w:
        # HOME: no start-up script of the user who runs the tests.
        words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{w.address}:5760", f"--state-basedir={tmp_path}")
        async with program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy:
            await setup(w, mavproxy, flavour, tmp_path)

"""Unmodified MAVProxy without a terminal: its commands come through a pipe, its words are read from another.

MAVProxy's own `mode` does not work with vehicles of the PX4 flavour (it packs the mode wrongly); landing is ordered by
its `long` instead.
"""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
from pathlib import Path

import pytest
from support.product import Process, Product, product, program
from support.world import loopback

from anafi_mav import geo

pytestmark = pytest.mark.third_party

HOME = (48.8789, 2.3677, 35.0)
MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"


async def shown(mavproxy: Process, command: str, pattern: str) -> None:
    """Type a command that shows something, again and again until it shows the pattern: telemetry has its own times."""
    for _ in range(20):
        since = len(mavproxy.lines)
        mavproxy.say(command)
        if await mavproxy.look(lambda line: bool(re.search(pattern, line)), since=since, timeout=0.5) is not None:
            return
    raise AssertionError(f"{command} does not show {pattern}: {mavproxy}")


async def accepted(mavproxy: Process, command: str, name: str) -> None:
    """Type a command that makes MAVProxy send something; its word that the vehicle accepted it."""
    since = len(mavproxy.lines)
    mavproxy.say(command)
    await mavproxy.line(lambda line: line.endswith(f"Got COMMAND_ACK: {name}: ACCEPTED"), since=since, timeout=15.0)


async def at_rest(p: Product, *place: float) -> None:
    """The drone's true pose is at latitude, longitude and height."""
    latitude, longitude, height = place
    await p.entry(
        "pose",
        "",
        lambda pose: (
            geo.distance(latitude, longitude, pose["lat"], pose["lon"]) < 1.0 and abs(pose["ato"] - height) < 0.5
        ),
    )


async def test_connect_look_and_fly(tmp_path: Path) -> None:
    address = loopback()
    config = f"""
        endpoints: ["tcpin://{address}:5760"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 3}}}}]
    """
    # HOME: no start-up script of the user who runs the tests.
    words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{address}:5760", f"--state-basedir={tmp_path}")
    async with (
        product(tmp_path, config) as p,
        program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy,
    ):
        await mavproxy.line(lambda line: "online system 1" in line)

        # What it shows: mode, GPS, battery.
        await mavproxy.line(lambda line: "Mode LOITER" in line)
        await mavproxy.line(lambda line: re.search(r"GPS lock at 35 met(er|re)s", line) is not None)
        await shown(mavproxy, "status GPS_RAW_INT", "fix_type : 3, lat : 488789000, lon : 23677000, alt : 35000,")
        await shown(mavproxy, "bat", "Flight battery: +100%")
        await shown(mavproxy, "status BATTERY_STATUS", "battery_remaining : 100,")

        # What it can do. Each word of the gateway is held against the simulator's own log.
        await accepted(mavproxy, "arm throttle", "COMPONENT_ARM_DISARM")
        await accepted(mavproxy, "takeoff 5", "NAV_TAKEOFF")
        await at_rest(p, *HOME[:2], 5.0)
        assert len(p.entries("command", "Piloting.TakeOff")) == 1

        place = geo.destination(*HOME[:2], 20.0, 10.0)
        await accepted(mavproxy, f"guided {place[0]:.7f} {place[1]:.7f} 8", "DO_REPOSITION")
        await at_rest(p, *place, 8.0)
        (move,) = p.entries("command", "Piloting.moveTo")
        assert (move["args"]["latitude"], move["args"]["longitude"]) == pytest.approx(place, abs=1e-6)
        assert move["args"]["altitude"] == pytest.approx(8.0, abs=0.01)

        since = len(mavproxy.lines)
        await accepted(mavproxy, "long MAV_CMD_NAV_LAND", "NAV_LAND")
        await p.flying_state("landed")
        assert len(p.entries("command", "Piloting.Landing")) == 1
        await mavproxy.line(lambda line: line.endswith("DISARMED"), since=since)

        alarming = re.compile("Traceback|ERROR|fence breach|PreArm")
        assert not [line for line in mavproxy.lines if alarming.search(line)], mavproxy


async def test_conf_119_the_ardupilot_flavour(tmp_path: Path) -> None:
    """Its own words: mode, arm, takeoff, guided, setspeed, changealt, setyaw, and mode again."""
    address = loopback()
    config = f"""
        endpoints: ["tcpin://{address}:5760?flavour=ardupilot"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 3}}}}]
    """
    words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{address}:5760", f"--state-basedir={tmp_path}")
    async with (
        product(tmp_path, config) as p,
        program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy,
    ):

        async def mode(name: str, shown_as: str = "") -> None:
            since = len(mavproxy.lines)
            mavproxy.say(f"mode {name}")
            await mavproxy.line(lambda line: f"Mode {shown_as or name}" in line, since=since, timeout=5.0)

        await mavproxy.line(lambda line: "online system 1" in line)
        await mavproxy.line(lambda line: "Mode BRAKE" in line)
        await mode("GUIDED")
        await accepted(mavproxy, "arm throttle", "COMPONENT_ARM_DISARM")
        await accepted(mavproxy, "takeoff 5", "NAV_TAKEOFF")
        await at_rest(p, *HOME[:2], 5.0)

        place = geo.destination(*HOME[:2], 20.0, 10.0)
        await accepted(mavproxy, "setspeed 5", "DO_CHANGE_SPEED")
        await accepted(mavproxy, f"guided {place[0]:.7f} {place[1]:.7f} 8", "DO_REPOSITION")
        move = await p.entry("command", "move.extended_move_to")
        assert move["args"]["max_horizontal_speed"] == 5.0
        assert move["args"]["orientation_mode"] == 0  # its heading of 0 is no heading
        await at_rest(p, *place, 8.0)

        mavproxy.say("changealt 12")
        await at_rest(p, *place, 12.0)
        await accepted(mavproxy, "setyaw 90 0 0", "CONDITION_YAW")
        await p.entry("pose", "", lambda pose: abs(pose["yaw"] - 1.5708) < 0.1)

        await mode("LOITER")
        await mode("RTL")
        await p.entry("command", "rth.return_to_home")
        await mode("LAND")
        await p.flying_state("landed")
        assert len(p.entries("command", "Piloting.Landing")) == 1
        assert not [line for line in mavproxy.lines if re.search("Traceback|ERROR|fence breach", line)], mavproxy

"""`anafi-mav plan upload` and `download` as they are called: with the gateway, and with another vehicle."""

from __future__ import annotations

import ast
import signal
import sys
from dataclasses import replace
from pathlib import Path

from support.flavours import both
from support.mav import Client
from support.plans import download
from support.product import Process, product, program
from support.world import loopback

from anafi_mav import mav_enums
from anafi_mav.plans.formats import files
from anafi_mav.plans.plan import Plan
from anafi_mav.services.plan.item_messages import as_carried, to_wire

MISSIONS = Path(__file__).parents[2] / "missions"


async def plan(*words: str | Path) -> Process:
    """Run `anafi-mav plan` to its end."""
    async with program(sys.executable, "-m", "anafi_mav", "plan", *map(str, words)) as held:
        await held.end(timeout=90.0)
        return held


def fleet(address: str, drone: str, flavour: str = "px4") -> str:
    return f"""
        endpoints: ["tcpin://{address}:5760?flavour={flavour}", "tcpin://{address}:5761"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {drone}}}}}]
    """


def carried(wanted: Plan) -> Plan:
    """What a vehicle can give back of a plan: nothing of its editor, and no speeds."""
    items = tuple(as_carried(item) for item in wanted.items)
    return replace(wanted, items=items, blocks=(), cruise_speed=15.0, hover_speed=5.0)


@both
async def test_a_plan_is_uploaded_and_fetched_again(tmp_path: Path, flavour: str) -> None:
    """Mission, fence and rally points; what another client sees is what the file says."""
    address = loopback()
    url = f"tcpout://{address}:5760"
    wanted = files.load(MISSIONS / "delivery.plan")
    async with product(tmp_path, fleet(address, loopback(), flavour)):
        up = await plan("upload", MISSIONS / "delivery.plan", "--endpoint", url)
        assert up.process.returncode == 0, str(up)
        assert "mission: 12 items on system 1" in up.lines
        assert "fence: 2 items on system 1" in up.lines
        assert "rally points: 1 item on system 1" in up.lines
        other = await Client().connect(5761, address)
        seen = await download(other, 0)
        await other.close()
        assert [(m.command, m.frame, m.x, m.y) for m in seen] == [
            (item.command, item.frame, to_wire(item).x, to_wire(item).y) for item in wanted.items
        ]
        down = await plan("download", tmp_path / "down.plan", "--endpoint", url, "--sysid", "1")
        assert down.process.returncode == 0, str(down)
        got = files.load(tmp_path / "down.plan")
        # An ArduPilot keeps home with the mission; of others it is not known.
        assert replace(got, home=wanted.home) == carried(wanted)
        assert (got.home == wanted.home) or flavour == "px4"
        again = await plan("upload", tmp_path / "down.plan", "--endpoint", url)
        assert again.process.returncode == 0, str(again)


async def test_upload_of_an_impossible_plan_prints_the_vehicles_reason(tmp_path: Path) -> None:
    address = loopback()
    url = f"tcpout://{address}:5760"
    async with product(tmp_path, fleet(address, loopback())):
        first = await plan("upload", MISSIONS / "loop.plan", "--endpoint", url)
        assert first.process.returncode == 0, str(first)
        refused = await plan("upload", MISSIONS / "wrong" / "servo.plan", "--endpoint", url)
        assert refused.process.returncode == 1
        (line,) = refused.complaints
        assert line.startswith("anafi-mav: mission not taken: UNSUPPORTED; system 1 said: ")
        assert "item 3" in line  # as on a station's map, where home is 0
        other = await Client().connect(5761, address)
        assert len(await download(other, 0)) == len(files.load(MISSIONS / "loop.plan").items)  # the old one
        await other.close()


async def test_plans_with_a_vehicle_of_mavsdk(tmp_path: Path) -> None:
    """MAVSDK's own mission server takes every sample and gives it back."""
    address = loopback()
    url = f"udpin://{address}:14550"
    script = Path(__file__).with_name("mavsdk_vehicle.py")
    async with program(sys.executable, str(script), f"udpout://{address}:14550") as vehicle:
        await vehicle.line(lambda line: line == "ready")
        for path in sorted(MISSIONS.glob("*.plan"))[:3]:
            mark = len(vehicle.lines)
            wanted = replace(files.load(path), zones=(), breach_return=None, rally=())
            files.save(wanted, tmp_path / "mission.plan", files.Format.QGC)
            up = await plan("upload", tmp_path / "mission.plan", "--endpoint", url)
            assert up.process.returncode == 0, (str(up), str(vehicle))
            line = await vehicle.line(lambda line: line.startswith("mission "), since=mark)
            got = ast.literal_eval(line.removeprefix("mission ").replace("nan", "None"))
            expected = [to_wire(item) for item in wanted.items]
            assert [(c, f, x, y) for _, f, c, _, _, _, _, x, y, _ in got] == [
                (item.command, item.frame, item.x, item.y) for item in expected
            ]


async def test_plan_download_without_a_vehicle_fails(tmp_path: Path) -> None:
    out = tmp_path / "none.plan"
    alone = await plan("download", out, "--endpoint", f"udpin://{loopback()}:0")
    assert alone.process.returncode == 1
    (line,) = alone.complaints
    assert line.startswith("anafi-mav: no vehicle within 6 s on udpin://")
    assert not out.exists()
    wrong = await plan("download", out, "--endpoint", "udp:14550")
    assert wrong.process.returncode == 2
    assert wrong.complaints[0].startswith("anafi-mav: --endpoint: 'udp:14550': expected a URL")
    number = await plan("upload", MISSIONS / "loop.plan", "--sysid", "300")
    assert (number.process.returncode, number.complaints) == (
        2,
        ["anafi-mav: --sysid: expected a system id from 1 to 255, got 300"],
    )


async def test_a_plan_is_flown_and_followed(tmp_path: Path) -> None:
    address = loopback()
    config = fleet(address, loopback()).replace("sim: {", "sim: {speed: 8, ")
    async with product(tmp_path, config) as p:
        flight = await plan("fly", MISSIONS / "loop.plan", "--endpoint", f"tcpout://{address}:5760")
        assert flight.process.returncode == 0, str(flight)
        lines = flight.lines
        assert lines.index("mission: 9 items on system 1") < lines.index("arming")
        observed = [line for line in lines if line.startswith(("at ", "done: "))]
        assert [line for line in observed if line.startswith("done: ")] == [
            "done: item 0 NAV_TAKEOFF",
            "done: item 1 DO_CHANGE_SPEED",
            "done: item 2 NAV_WAYPOINT",
            "done: item 3 NAV_WAYPOINT",
            "done: item 4 IMAGE_START_CAPTURE",
            "done: item 5 NAV_WAYPOINT",
            "done: item 6 DO_JUMP",
            "done: item 7 NAV_WAYPOINT",
            "done: item 8 NAV_RETURN_TO_LAUNCH",
        ]
        assert observed.count("at item 4 IMAGE_START_CAPTURE") == 3
        assert lines[-1] == "mission complete"
        # The drone's own word: a photo each time round.
        items = [entry["args"]["command"] for entry in p.entries("plan", "item")]
        assert items.count("start_photo") == 3
        assert items[-1] == "return_to_launch"


async def test_interrupted_plan_fly_leaves_the_flight_alone(tmp_path: Path) -> None:
    address = loopback()
    url = f"tcpout://{address}:5760"
    config = fleet(address, loopback()).replace("sim: {", "sim: {speed: 2, ")
    async with product(tmp_path, config) as p:
        words = (sys.executable, "-m", "anafi_mav", "plan", "fly", str(MISSIONS / "orbit.plan"), "--endpoint", url)
        async with program(*words) as flight:
            await flight.line(lambda line: line.startswith("at item 2 "), timeout=90.0)
            other = await Client().connect(5761, address)
            mark = len(flight.lines)
            assert (await other.command(mav_enums.MAV_CMD_DO_PAUSE_CONTINUE, 0)).result == 0
            await flight.line(lambda line: line.startswith("paused at item 2 NAV_WAYPOINT"), since=mark)
            assert (await other.command(mav_enums.MAV_CMD_DO_PAUSE_CONTINUE, 1)).result == 0
            await flight.line(lambda line: line == "goes on", since=mark)
            flight.process.send_signal(signal.SIGINT)
            assert await flight.end() == 130
            assert flight.lines[-1].startswith("the flight goes on without this program, at item ")
            assert flight.complaints == []
            await other.wait("MISSION_ITEM_REACHED", lambda m: m.seq >= 2, since=0, timeout=60.0)
            assert [entry["args"]["state"] for entry in p.entries("plan", "plan")][-1] == "playing"
            # On the ground again the flight is over before the mission is.
            async with program(*words) as second:
                await second.line(lambda line: line.startswith("begun"), timeout=90.0)
                assert (await other.command(mav_enums.MAV_CMD_NAV_LAND, timeout=60.0)).result == 0
                await second.line(lambda line: line.startswith("paused at "))
                assert await second.end(timeout=90.0) == 1
                assert "the flight is over and the mission is not" in second.complaints[-1]
            await other.close()


async def test_nothing_to_fly(tmp_path: Path) -> None:
    empty = tmp_path / "fence.waypoints"
    files.save(Plan(zones=files.load(MISSIONS / "delivery.plan").zones), empty, files.Format.WAYPOINTS)
    flight = await plan("fly", empty)
    assert (flight.process.returncode, flight.complaints) == (
        1,
        ["anafi-mav: fence.waypoints: it has no mission: nothing to fly"],
    )

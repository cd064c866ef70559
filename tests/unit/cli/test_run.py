"""`anafi-mav run` as users meet it: a process that is started, read, interrupted and killed."""

from __future__ import annotations

import asyncio
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
from support.mav import Client
from support.process import simulator_process
from support.product import Product, free_udp_port, product
from support.world import HOLD, HOME, loopback

from anafi_mav import geo, mav_enums
from anafi_mav.cli import main
from anafi_mav.cli.addresses import Reservations
from anafi_mav.cli.run import ASKED_FOR, StopSignals, configuration, place
from anafi_mav.cli.sim import Fleet
from anafi_mav.cli.terminal import STDOUT_WRITER
from anafi_mav.config import Config, load
from anafi_mav.drone import FlyingState, connect
from anafi_mav.mavlink.key_ring import write_key
from anafi_mav.sim.world.wind import WindSpec

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it waits for processes by pidfd")


def fleet(address: str, drone: str) -> str:
    """One simulated drone, one TCP endpoint."""
    return f"""
        endpoints: ["tcpin://{address}:5760"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {drone}, home: {list(HOME)}, speed: 4}}}}]
    """


async def gone(pid: int, timeout: float = 10.0) -> None:
    """Wait until a process that is not our child runs no more."""
    try:
        process = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    try:
        assert (await asyncio.to_thread(select.select, [process], [], [], timeout))[0], f"process {pid} still runs"
    finally:
        os.close(process)


def free(address: str, port: int, kind: socket.SocketKind = socket.SOCK_STREAM) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # old connections may fade
        try:
            probe.bind((address, port))
        except OSError:
            return False
        return True


@asynccontextmanager
async def under_way(folder: Path) -> AsyncIterator[tuple[Product, Client, str, str]]:
    """The product with its drone on the way to a place 200 m north, 5 m high; addresses of endpoint and drone."""
    address, drone = loopback(), loopback()
    async with product(folder, fleet(address, drone)) as p:
        client = await Client().connect(5760, address)
        assert (await client.command(mav_enums.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == 0
        assert (await client.command(mav_enums.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0)).result == 0
        await client.heartbeat(lambda beat: beat.custom_mode == HOLD, timeout=20.0)
        place = geo.destination(*HOME[:2], 200.0, 0.0)
        assert (
            await client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0, frame=6, x=place[0], y=place[1], z=5.0)
        ).result == 0
        await p.entry("pose", "", lambda pose: pose["vn"] > 3.0)
        yield p, client, address, drone
        await client.close()


def left_hovering(p: Product) -> None:
    """Before the link ended the drone was commanded to stop, and it did."""
    (end,) = (entry for entry in p.entries("session") if entry["name"] == "lost")
    (move,) = p.entries("command", "Piloting.moveTo")
    after = [entry for entry in p.entries("command") if entry["t"] > move["t"]]
    assert all(entry["t"] <= end["t"] for entry in after)
    names = {entry["name"].removeprefix("ardrone3.Piloting.") for entry in after}
    assert "CancelMoveTo" in names or "moveBy" in names
    assert "Landing" not in names
    sticks = [entry["args"] for entry in after if entry["name"].endswith("PCMD")]
    assert 25 <= len(sticks) <= 41  # 20 Hz for 2 s, less what a busy machine lets slip: none of them is acknowledged
    assert all((s["roll"], s["pitch"], s["yaw"], s["gaz"]) == (0, 0, 0, 0) for s in sticks)
    pose = [entry["args"] for entry in p.entries("pose") if entry["t"] <= end["t"]][-1]
    assert abs(pose["vn"]) < 0.5


# Start.


async def test_simulated_drone_uses_wind_card_and_scenario_of_configuration(tmp_path: Path) -> None:
    address, alpha, bravo = loopback(), loopback(), loopback()
    (tmp_path / "days").mkdir()
    (tmp_path / "days" / "bad.yaml").write_text(
        f"steps: [{{at: 0.5, gps: false, drone: {bravo}}}, {{at: 0.5, battery: 9}}]"
    )
    config = f"""
        endpoints: ["tcpin://{address}:5760"]
        drones:
          - {{name: alpha, sysid: 1, sim: {{address: {alpha}, scenario: days/bad.yaml}}}}
          - {{name: bravo, sysid: 2, sim: {{address: {bravo}, storage: 500k, wind: {{speed: 6, direction: 90}}}}}}
    """
    async with product(tmp_path, config) as p:
        step = await p.entry("scenario", "step")
        assert (step["drone"], step["args"]["step"]) == (alpha, 1)  # not the step for bravo, nor any at bravo
        battery = await p.entry("event", "BatteryStateChanged", lambda args: args["percent"] == 9)
        assert battery["drone"] == alpha
        assert [entry["drone"] for entry in p.entries("scenario")] == [alpha]


def test_simulator_arguments_of_a_configured_drone(tmp_path: Path) -> None:
    path = tmp_path / "fleet.yaml"
    path.write_text(
        f"drones: [{{name: a, sysid: 1, sim: {{address: {loopback()}, storage: 500k, skycontroller: 4,"
        " wind: {speed: 6, direction: 90}, firmware_quirks: [no-flight-id]}}]"
    )
    with Reservations() as reservations:
        seen, fleet = place(load(path), reservations)
    (drone,) = msgspec.json.decode(msgspec.json.encode(fleet), type=Fleet).drones
    assert (drone.storage, drone.skycontroller) == (500_000, 4)
    assert drone.wind == WindSpec(6.0, 90.0)
    assert drone.firmware_quirks == ("no-flight-id",)
    # The gateway looks for the servers where they are, also where this user may not open the aircraft's ports.
    assert (seen.drones[0].http_port, seen.drones[0].rtsp_port) == (drone.http_port, drone.rtsp_port)
    assert (drone.http_port, drone.rtsp_port) in ((80, 554), (8080, 8554))


UNPRIVILEGED = Path("/proc/sys/net/ipv4/ip_unprivileged_port_start")


@pytest.mark.skipif(
    not UNPRIVILEGED.exists() or int(UNPRIVILEGED.read_text()) <= 554, reason="here anybody may open ports 80 and 554"
)
async def test_ordinary_user_gets_substitutes_for_privileged_ports() -> None:
    script = """
import os, sys
from anafi_mav.cli.addresses import Reservations
if os.geteuid() == 0:
    os.setuid(65534)
with Reservations() as reservations:
    print(*reservations.take(sys.argv[1], 44445, None, None))
    print(*reservations.take(sys.argv[2], 44445, 8081, 8555))
"""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", script, loopback(), loopback()), stdout=asyncio.subprocess.PIPE
    )
    out, _ = await asyncio.wait_for(process.communicate(), 30.0)
    assert out.decode().splitlines() == ["44445 8080 8554", "44445 8081 8555"]


def test_run_without_configuration_flies_the_default_fleet() -> None:
    assert configuration(None, None, None, False) == Config()
    assert configuration(None, ["192.168.42.1"], None, True).drones[0].sysid == 1


def test_drone_option_outside_the_system_ids_of_the_file_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The ids outside belong to another gateway of the same zenoh network."""
    fleet = tmp_path / "fleet.yaml"
    fleet.write_text("sysids: 2-5\ndrones: [{name: alpha, sysid: 2, address: 192.168.42.1}]\n")
    assert main(["run", "-c", str(fleet), "--drone", "192.168.42.1"]) == 2
    assert capsys.readouterr().err == "anafi-mav: --drone: expected one of sysids, 2-5, got 1\n"


async def test_run_prints_each_drone_and_endpoint_before_ready(tmp_path: Path) -> None:
    address, first, second, absent = loopback(), loopback(), loopback(), loopback()
    port = free_udp_port(address)
    config = f"""
        endpoints: ["tcpin://{address}:5760", "udpout://{address}:{port}"]
        drones:
          - {{name: alpha, sysid: 1, sim: {{address: {first}}}}}
          - {{name: bravo, sysid: 245, sim: {{address: {second}}}}}
          - {{name: charlie, sysid: 3, address: {absent}}}
    """
    async with product(tmp_path, config) as p:
        alpha, bravo, charlie, tcp, udp, video, page, ready = p.lines
        assert alpha.startswith(f"drone alpha: system 1 at {first}: ANAFI 4K PI04")
        assert bravo.startswith(f"drone bravo: system 245 at {second}: ANAFI 4K PI04")
        assert charlie.startswith(f"drone charlie: system 3 at {absent}: not connected (")
        assert charlie.endswith("), retrying")
        assert tcp == f"endpoint tcpin://{address}:5760: 0 clients"
        assert udp == f"endpoint udpout://{address}:{port}"
        assert video.startswith("video rtsp://127.0.0.1:")
        assert video.endswith("/SYSTEM/STREAM: 0 viewers")
        assert page.startswith("web page http://127.0.0.1:")
        assert ready.startswith("ready")
        # 245 is MAVSDK's own: a warning, and it flies.
        (warning,) = (line for line in p.complaints if "warning" in line)
        assert warning.startswith("anafi-mav: warning: drones[1].sysid: 245 is the default system id of MAVSDK")


# End.


async def test_ctrl_c_on_the_ground(tmp_path: Path) -> None:
    address, drone = loopback(), loopback()
    async with product(tmp_path, fleet(address, drone)) as p:
        child = p.child()
        assert child is not None
        client = await Client().connect(5760, address)
        await client.heartbeat(lambda beat: True)
        began = time.monotonic()
        p.process.send_signal(signal.SIGINT)
        assert await p.end(10.0) == 0
        assert time.monotonic() - began < 5.0
        await gone(child, 0.0)  # it has waited for it
        assert free(address, 5760)
        assert all(free(drone, port) for port in (44444, 44445))
        assert free(drone, 2233, socket.SOCK_DGRAM)
        assert p.complaints == []
        assert p.lines[-1].startswith("ready")
        assert [entry["name"] for entry in p.entries("session")] == ["up", "lost"]
        await client.close()


async def test_ctrl_c_in_the_air_asks_first(tmp_path: Path) -> None:
    async with under_way(tmp_path) as (p, client, address, _):
        child = p.child()
        assert child is not None
        said = len(p.lines)
        p.process.send_signal(signal.SIGINT)
        await p.line(lambda line: line.startswith("Ctrl-C once more"), since=said)
        (sentence,) = (line for line in p.lines[said:] if "in the air" in line)
        assert sentence.startswith("alpha is in the air: it will hover and fly home ")
        # It goes on, and so does the drone.
        for _ in range(2):
            await client.heartbeat(lambda beat: True)
        assert p.entries("pose")[-1]["args"]["vn"] > 3.0

        p.process.send_signal(signal.SIGINT)
        assert await p.end(15.0) == 0
        left_hovering(p)
        await gone(child, 0.0)
        assert free(address, 5760)
        assert p.complaints == []


async def test_ctrl_c_in_the_air_asks_again_after_a_while(capsys: pytest.CaptureFixture[str]) -> None:
    signals = StopSignals()
    signals.flying = lambda: ["alpha is in the air"]
    signals.receive(signal.SIGINT)
    await asyncio.sleep(ASKED_FOR)
    signals.receive(signal.SIGINT)
    assert not signals.stop.is_set()
    assert await STDOUT_WRITER.drain(5.0)
    assert capsys.readouterr().out.count("alpha is in the air") == 2
    await asyncio.sleep(ASKED_FOR - 1.0)
    assert signals.unsaid() == []
    signals.receive(signal.SIGINT)
    assert signals.stop.is_set()


async def test_service_manager_hears_ready_and_log_file_is_json(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.setblocking(False)
        loop = asyncio.get_running_loop()
        log = tmp_path / "gateway.log"
        env = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "200000"}
        options = ("-v", "--log-file", str(log), "--log-format", "json")
        async with product(tmp_path, fleet(loopback(), loopback()), *options, env=env) as p:
            assert await asyncio.wait_for(loop.sock_recv(manager, 100), 10.0) == b"READY=1\nSTATUS=1 drone"
            assert await asyncio.wait_for(loop.sock_recv(manager, 100), 10.0) == b"WATCHDOG=1"
            p.process.send_signal(signal.SIGTERM)
            assert await p.end(15.0) == 0
        while (word := await asyncio.wait_for(loop.sock_recv(manager, 100), 10.0)) == b"WATCHDOG=1":
            pass
        assert word == b"STOPPING=1"
    entries = [msgspec.json.decode(line) for line in log.read_bytes().splitlines()]
    assert any(entry["drone"] == "alpha" and entry["level"] == "INFO" for entry in entries)


async def test_sigterm_does_not_ask(tmp_path: Path) -> None:
    async with under_way(tmp_path) as (p, _, address, _):
        child = p.child()
        assert child is not None
        said = len(p.lines)
        p.process.send_signal(signal.SIGTERM)
        assert await p.end(15.0) == 0
        (sentence,) = p.lines[said:]
        assert sentence.startswith("alpha is in the air: it will hover and fly home ")
        left_hovering(p)
        await gone(child, 0.0)
        assert free(address, 5760)


async def test_ctrl_c_before_ready_ends_cleanly(tmp_path: Path) -> None:
    """A drone that takes the connection and says nothing keeps the start waiting, not the end."""
    address, silent = loopback(), loopback()
    accepted = asyncio.Event()
    held: list[asyncio.StreamWriter] = []

    def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        held.append(writer)
        accepted.set()

    server = await asyncio.start_server(take, silent, 44445)
    config = f"""
        endpoints: ["tcpin://{address}:5760"]
        drones:
          - {{name: alpha, sysid: 1, sim: {{address: {loopback()}}}}}
          - {{name: bravo, sysid: 2, address: {silent}}}
    """
    async with product(tmp_path, config, ready=False) as p:
        await asyncio.wait_for(accepted.wait(), 30.0)
        child = p.child()
        assert child is not None
        p.process.send_signal(signal.SIGINT)
        assert await p.end(10.0) == 0
        await gone(child, 0.0)
        assert p.lines == []
        assert p.complaints == []
    for writer in held:
        writer.close()
    server.close()


@asynccontextmanager
async def starting_in_the_air(folder: Path) -> AsyncIterator[Product]:
    """A gateway that waits for its silent drone bravo while its clients see alpha, which flies."""
    address, flying, silent = loopback(), loopback(), loopback()
    accepted = asyncio.Event()
    server = await asyncio.start_server(lambda reader, writer: accepted.set(), silent, 44445)
    config = f"""
        endpoints: ["tcpin://{address}:5760"]
        drones:
          - {{name: alpha, sysid: 1, address: {flying}}}
          - {{name: bravo, sysid: 2, address: {silent}}}
    """
    async with simulator_process(flying, folder / "sim.jsonl", "--http-port", "0", "--rtsp-port", "0"):
        async with connect(flying) as drone:
            await drone.piloting.take_off()
            await drone.wait_for(FlyingState.HOVERING)
        async with product(folder, config, ready=False) as p:
            await asyncio.wait_for(accepted.wait(), 30.0)
            client = await Client().connect(5760, address)
            await client.heartbeat(lambda beat: beat.base_mode & mav_enums.MAV_MODE_FLAG_SAFETY_ARMED)
            yield p
            await client.close()
    server.close()


async def test_ctrl_c_before_ready_asks_first_about_a_drone_in_the_air(tmp_path: Path) -> None:
    async with starting_in_the_air(tmp_path) as p:
        p.process.send_signal(signal.SIGINT)
        await p.line(lambda line: line.startswith("Ctrl-C once more"))
        (sentence,) = (line for line in p.lines if "in the air" in line)
        assert sentence.startswith("alpha is in the air: it will hover and fly home ")
        await p.line(lambda line: line.startswith("ready"))  # it goes on
        p.process.send_signal(signal.SIGINT)
        assert await p.end(15.0) == 0


async def test_sigterm_before_ready_reports_a_drone_in_the_air(tmp_path: Path) -> None:
    async with starting_in_the_air(tmp_path) as p:
        p.process.send_signal(signal.SIGTERM)
        assert await p.end(15.0) == 0
        (sentence,) = (line for line in p.lines if "in the air" in line)
        assert sentence.startswith("alpha is in the air: it will hover and fly home ")


async def test_a_killed_gateway_leaves_no_simulator(tmp_path: Path) -> None:
    drone = loopback()
    async with product(tmp_path, fleet(loopback(), drone)) as p:
        child = p.child()
        assert child is not None
        p.process.kill()
        await p.process.wait()
        await gone(child)
        assert free(drone, 44445)


async def test_killed_simulator_is_reported_and_survived(tmp_path: Path) -> None:
    async with product(tmp_path, fleet(loopback(), loopback())) as p:
        child = p.child()
        assert child is not None
        os.kill(child, signal.SIGKILL)
        await gone(child)
        deadline = time.monotonic() + 10.0
        observed = "anafi-mav: the simulator ended by signal 9; with it went alpha"
        while observed not in p.complaints:
            assert time.monotonic() < deadline, p
            await asyncio.sleep(0.02)  # stderr is read by another task
        p.process.send_signal(signal.SIGINT)
        assert await p.end(10.0) == 0


# Mistakes: one line with the place and what was expected, status 2, nothing started.

SIM = "sim: {address: DRONE}"


@pytest.mark.parametrize(
    ("config", "line"),
    [
        ("endpoint: []", "endpoint: unknown key; did you mean endpoints?"),
        (
            f"drones: [{{name: a, sysid: 1, {SIM}, colour: red}}]",
            "drones[0].colour: unknown key; expected one of name,",
        ),
        (
            f"drones: [{{name: a, sysid: one, {SIM}}}]",
            "drones[0].sysid: expected a whole number from 1 to 250, got 'one'",
        ),
        ("endpoints: tcpin://HOST:5760", "endpoints: expected a list of 1 to 32 URLs, got 'tcpin://"),
        (
            f"drones: [{{name: a, sysid: 7, {SIM}}}, {{name: b, sysid: 7, address: 10.0.0.1}}]",
            "drones[1].sysid: expected a sysid of its own, 7 is already at drones[0].sysid",
        ),
        (
            f"drones: [{{name: a, sysid: 0, {SIM}}}]",
            "drones[0].sysid: expected a whole number from 1 to 250, got 0",
        ),
        (
            f"drones: [{{name: a, sysid: 251, {SIM}}}]",
            "drones[0].sysid: expected a whole number from 1 to 250, got 251",
        ),
    ],
)
def test_configuration_with_a_mistake_is_refused_with_one_line(
    tmp_path: Path, config: str, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """In this process: a configuration is read before anything is started."""
    host, log = loopback(), tmp_path / "sim.jsonl"
    config, line = (text.replace("HOST", host).replace("DRONE", loopback()) for text in (config, line))
    (tmp_path / "fleet.yaml").write_text(config)
    assert main(["run", "-c", str(tmp_path / "fleet.yaml"), "--sim-log", str(log)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (complaint,) = err.splitlines()
    assert complaint.startswith("anafi-mav: ")
    assert line in complaint
    assert not log.exists()  # a simulator begins with its log


@pytest.mark.parametrize(
    ("config", "line"),
    [
        (
            f"{{endpoints: ['udp://HOST:1'], drones: [{{name: a, sysid: 1, {SIM}}}]}}",
            "endpoints[0]: 'udp://HOST:1': expected a URL that begins with one of udpout://,",
        ),
        (
            f"{{endpoints: ['tcpin://HOST:5761', 'tcpin://HOST:BUSY'], drones: [{{name: a, sysid: 1, {SIM}}}]}}",
            "endpoints[1]: cannot open tcpin://HOST:BUSY: Address already in use",
        ),
        (
            f"{{endpoints: ['udpin://HOST:UDPBUSY'], drones: [{{name: a, sysid: 1, {SIM}}}]}}",
            "endpoints[0]: cannot open udpin://HOST:UDPBUSY: Address already in use",
        ),
        (
            "{endpoints: ['tcpin://HOST:5761'], drones: [{name: a, sysid: 1, sim: {address: TAKEN}}]}",
            "drones[0].sim.address: expected an address of this machine with free ports 44445, 44444, 2233, 80 "
            "and 554, "
            "got TAKEN: Address already in use",
        ),
        ("drones: [", "fleet.yaml, line 1, column"),
        (
            f"{{endpoints: ['tcpin://HOST:5761'], drones: [{{name: a, sysid: 1, {SIM[:-1]}, scenario: none.yaml}}}}]}}",
            "drones[0].sim.scenario: cannot read FOLDER/none.yaml: No such file or directory",
        ),
        (
            f"{{endpoints: ['tcpin://HOST:5761'], drones: [{{name: a, sysid: 1, {SIM[:-1]}, scenario: bad.yaml}}}}]}}",
            "drones[0].sim.scenario: FOLDER/bad.yaml: steps[0].gps: expected `bool`, got `str`",
        ),
    ],
)
async def test_a_mistake_is_one_line_and_nothing_is_started(tmp_path: Path, config: str, line: str) -> None:
    host, taken = loopback(), loopback()
    with (
        socket.create_server((host, 0)) as busy,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as busy_too,
        socket.create_server((taken, 44445)),
    ):
        busy_too.bind((host, 0))
        words = {
            "UDPBUSY": str(busy_too.getsockname()[1]),
            "BUSY": str(busy.getsockname()[1]),
            "HOST": host,
            "DRONE": loopback(),
            "TAKEN": taken,
            "FOLDER": str(tmp_path),
        }
        (tmp_path / "bad.yaml").write_text("steps: [{at: 1, gps: maybe}]")
        for word, value in words.items():
            config, line = config.replace(word, value), line.replace(word, value)
        async with product(tmp_path, config, ready=False) as p:
            assert await p.end() == 2
            assert p.lines == []
            (complaint,) = p.complaints
            assert complaint.startswith("anafi-mav: ")
            assert line in complaint
            assert not p.log.exists()  # a simulator begins with its log
            assert free(host, 5761)


async def test_endpoint_open_to_the_network_warns_at_start(tmp_path: Path) -> None:
    """192.0.2.1 is an address of no computer (RFC 5737): nothing is opened by this test."""
    config = f"""
        endpoints: ["tcpin://{loopback()}:5760", "tcpin://192.0.2.1:5760"]
        drones: [{{name: a, sysid: 1, address: {loopback()}}}]
    """
    async with product(tmp_path, config, ready=False) as p:
        assert await p.end() == 2
        warning, error = p.complaints
        assert warning.startswith("anafi-mav: warning: endpoints[1]: tcpin://192.0.2.1:5760 is open to the network")
        assert error.startswith(f"anafi-mav: {tmp_path / 'fleet.yaml'}: endpoints[1]: cannot open")


async def test_endpoint_whose_key_is_off_warns_at_start(tmp_path: Path) -> None:
    write_key(tmp_path / "state" / "keys", "field", bytes(40))
    write_key(tmp_path / "state" / "keys", "good", bytes(range(40)))
    config = f"""
        state: {tmp_path / "state"}
        endpoints: ["tcpin://192.0.2.1:5760?signing=field", "tcpin://192.0.2.1:5761?signing=good"]
        drones: [{{name: a, sysid: 1, address: {loopback()}}}]
    """
    async with product(tmp_path, config, ready=False) as p:
        assert await p.end() == 2
        warnings = [line for line in p.complaints if "is open to the network" in line]
        assert [line.partition(": tcpin")[0] for line in warnings] == ["anafi-mav: warning: endpoints[0]"]


async def test_error_of_an_option_names_the_option(tmp_path: Path) -> None:
    config = fleet(loopback(), loopback())
    async with product(tmp_path, config, "--endpoint", "tcpin://192.0.2.1:5760", ready=False) as p:
        assert await p.end() == 2
        assert p.complaints[-1].startswith("anafi-mav: --endpoint: cannot open tcpin://192.0.2.1:5760")
    async with product(tmp_path, config, "--drone", "192.168.42.300", ready=False) as p:
        assert await p.end() == 2
        assert p.complaints[-1].startswith("anafi-mav: --drone: expected an IPv4 address or a host name")


async def test_unwritable_log_is_reported(tmp_path: Path) -> None:
    config = fleet(loopback(), loopback())
    async with product(tmp_path, config, "--sim-log", str(tmp_path), ready=False) as p:
        assert await p.end() == 2
        assert p.lines == []
        (complaint,) = p.complaints
        assert complaint == f"anafi-mav: --sim-log: expected a file that can be written, got {tmp_path}: Is a directory"


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["sim", "--help"], ["--version"]])
def test_help(words: list[str], capsys: Any) -> None:
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 0
    assert "anafi-mav" in capsys.readouterr().out


def test_gateway_without_simulated_drones_does_not_load_the_simulator() -> None:
    program = (
        "import sys; from anafi_mav.cli.run import place; from anafi_mav.config import Config, DroneConfig; "
        "assert place(Config(drones=[DroneConfig(name='a', sysid=1, address='192.168.42.1')]), None)[1] is None; "
        "print([name for name in sys.modules if name.startswith('anafi_mav.sim')])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"

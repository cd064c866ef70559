"""`anafi-mav doctor` and the consent that it and `info` need, against simulated devices in several broken states."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
from support.product import Process
from support.world import WEB_PORT, loopback, world

from anafi_mav.arsdk.link import interface
from anafi_mav.arsdk.link.handshake import ConnectReply, DeviceInfo, format_discovery, format_reply
from anafi_mav.cli import doctor, main
from anafi_mav.cli.doctor import DroneAddress, Finding, before_handshake, with_handshake
from anafi_mav.drone import Drone
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from anafi_mav.state_lock import HeldDrone, StateLock, state_folder

HTTP, RTSP = 8080, 8554


@contextlib.asynccontextmanager
async def simulated(model: str = "4k", skycontroller: int | None = None) -> AsyncIterator[SimulatedDrone]:
    spec = DroneSpec(model=model, address=loopback(), http_port=HTTP, rtsp_port=RTSP, skycontroller=skycontroller)
    async with Simulator([spec], seed=1) as simulator:
        yield simulator.drones[0]


def place(address: str) -> DroneAddress:
    return DroneAddress(address, None, HTTP, RTSP)


def faults(findings: list[Finding]) -> dict[str, str]:
    """What is wrong, by check."""
    return {finding.check: str(finding) for finding in findings if finding.wrong}


def sessions(drone: SimulatedDrone) -> int:
    return len([entry for entry in drone.log if entry.kind == "session"])


@contextlib.asynccontextmanager
async def command(*arguments: str) -> AsyncIterator[Process]:
    held = await Process.start(sys.executable, "-m", "anafi_mav", *arguments)
    try:
        yield held
    finally:
        await held.put_away()


@contextlib.asynccontextmanager
async def device(answers: dict[int, Callable[[], bytes]]) -> AsyncIterator[str]:
    """TCP servers at one address: each answers each client that connects, and keeps the connection."""
    address, held = loopback(), []
    servers = []
    for port, answer in answers.items():

        async def serve(
            reader: asyncio.StreamReader, writer: asyncio.StreamWriter, answer: Callable[[], bytes] = answer
        ) -> None:
            held.append(writer)
            writer.write(answer())

        servers.append(await asyncio.start_server(serve, address, port))
    try:
        yield address
    finally:
        for writer in held:
            writer.close()
        for server in servers:
            server.close()


def introduction(model_id: int) -> Callable[[], bytes]:
    return lambda: format_discovery(DeviceInfo(model_id, "PI040416DA9H000001", 44444, "SKYCTRL"))


# What is right.


@pytest.mark.parametrize(("model", "skycontroller"), [("4k", None), ("usa", 3), ("ai", 4)])
async def test_doctor_with_a_healthy_drone_reports_no_problem(model: str, skycontroller: int | None) -> None:
    async with simulated(model, skycontroller) as drone:
        before = sessions(drone)
        findings, seen = await before_handshake(place(drone.address))
        assert faults(findings) == {}
        assert seen is not None
        assert {"adapter", "route", "model", "port 44445", "port 44444", "port 4321"} <= {f.check for f in findings}
        assert sessions(drone) == before
        more = await with_handshake(place(drone.address))
        assert faults(more) == {}
        assert [finding.check for finding in more] == ["controller", "firmware", "settings", "failsafes"]


# What is wrong, before the handshake.


async def test_doctor_without_any_device_names_the_ports() -> None:
    address = loopback()
    findings, seen = await before_handshake(place(address))
    assert seen is None
    assert list(faults(findings)) == ["ports"]
    assert f"{address} answers, and none of 44445, 44444, 4321, {HTTP}, {RTSP} is open" in faults(findings)["ports"]


async def test_doctor_with_a_mute_drone_reports_no_discovery_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "ANSWER_LIMIT", 0.5)
    async with device({44445: lambda: b"", 44444: lambda: b""}) as address:
        findings, seen = await before_handshake(place(address))
    assert seen is None
    assert "no introduction: no answer" in faults(findings)["model"]


async def test_doctor_with_closed_servers_names_each_port() -> None:
    async with Simulator([DroneSpec(address=loopback(), http_port=None, rtsp_port=None)], seed=1) as simulator:
        findings, _ = await before_handshake(place(simulator.drones[0].address))
    assert list(faults(findings)) == [f"port {HTTP}", f"port {RTSP}"]
    assert "web server: refused; media and missions need it" in faults(findings)[f"port {HTTP}"]
    assert "live video: refused; only video needs it" in faults(findings)[f"port {RTSP}"]


async def test_doctor_with_another_skycontroller_names_the_supported_ones() -> None:
    async with device(
        {44445: introduction(0x0913), 44444: lambda: b"", HTTP: lambda: b"", RTSP: lambda: b""}
    ) as address:
        findings, _ = await before_handshake(place(address))
    wrong = faults(findings)["model"]
    assert "0x0913 (SKYCTRL) is not supported" in wrong
    assert "ANAFI 4K" in wrong
    assert "Skycontroller 3" in wrong


ROUTES = """\
Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT
{}"""
IN_42 = "{}\t002AA8C0\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0\n"


@pytest.mark.skipif(sys.byteorder != "little", reason="the table is one of a little-endian machine")
@pytest.mark.parametrize(
    ("adapters", "wanted", "words"),
    [
        ([], True, "no network adapter of this machine is in the network of 192.168.42.1; join the drone's Wi-Fi"),
        (["wlan1"], False, "adapter: ok: wlan1"),
        (
            ["wlan1", "wlan2"],
            True,
            "wlan1 and wlan2 are both in the network of 192.168.42.1; name one: 192.168.42.1%wlan1",
        ),
    ],
)
def test_doctor_adapter_is_judged_by_the_networks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, adapters: list[str], wanted: bool, words: str
) -> None:
    other = "eth0\t000014AC\t00000000\t0001\t0\t0\t0\t0000FFFF\t0\t0\t0\n"
    (tmp_path / "route").write_text(ROUTES.format(other + "".join(map(IN_42.format, adapters))))
    monkeypatch.setattr(interface, "ROUTES", tmp_path / "route")
    finding = doctor.adapter(DroneAddress("192.168.42.1"))
    assert finding.wrong is wanted
    assert words in str(finding)


async def test_doctor_with_an_unknown_adapter_stops_there() -> None:
    findings, _ = await before_handshake(DroneAddress("127.0.0.1", "nosuchif0"))
    assert "there is no network adapter nosuchif0; expected one of" in faults(findings)["adapter"]
    assert not [finding for finding in findings if finding.check.startswith("port")]


async def test_doctor_without_a_route_reports_it() -> None:
    findings, _ = await before_handshake(DroneAddress("255.255.255.255"))  # no socket is let send there unasked
    assert faults(findings)["route"].startswith("route: WRONG: none to 255.255.255.255: ")


# With the handshake.


async def test_doctor_refused_by_the_drone_names_another_controller() -> None:
    reply = format_reply(ConnectReply(status=-3, c2d_port=0))
    async with device({44445: introduction(0x0914), 44444: lambda: reply}) as address:
        findings = await with_handshake(place(address))
    (line,) = faults(findings).values()
    assert "refused the connection (status -3); another controller has the drone" in line


async def test_doctor_displaced_by_another_controller_names_it() -> None:
    async with simulated() as drone:
        rival = Drone(drone.address)

        async def take() -> None:
            await drone.wait_log(lambda entry: entry.kind == "session" and entry.name == "up", 10.0)
            await asyncio.sleep(0.7)  # the doctor has connected and listens
            await rival.connect()

        taking = asyncio.create_task(take())
        findings = await with_handshake(place(drone.address))
        await taking
        await rival.close()
    assert "lost at once" in faults(findings)["controller"]
    assert "another controller has the drone" in faults(findings)["controller"]


async def test_doctor_names_another_gateway_that_takes_the_drone_back() -> None:
    """That gateway waits for the end of a silence before its next handshake."""
    async with world(web=True) as w:
        findings = await with_handshake(DroneAddress(w.drone.address, None, WEB_PORT, RTSP))
    assert "another controller has the drone" in faults(findings)["controller"]


async def test_doctor_reports_the_reasons_against_takeoff() -> None:
    async with simulated() as drone:
        drone.faults.magneto_required = True
        findings = await with_handshake(place(drone.address))
    assert "take-off is refused: magneto" in faults(findings)["settings"]


async def test_doctor_reports_dangerous_settings_with_their_mend() -> None:
    async with simulated() as drone:
        drone.firmware.settings.set("rth_delay", 0.0)
        findings = await with_handshake(place(drone.address))
    line = "failsafes: WRONG: Return delay 0 s: each link loss is a return; raise the parameter ANF_RTH_DELAY"
    assert faults(findings)["failsafes"] == line


@pytest.mark.parametrize(
    ("version", "is_wrong"),
    [
        ("1.8.2", False),
        ("1.6.0", True),
        ("1.10.0-rc1", False),
        ("", True),
        ("7", False),
        ("7.²", False),
        (f"1.{'9' * 5000}", False),
    ],
)
async def test_doctor_firmware_is_compared_by_numbers(version: str, is_wrong: bool) -> None:
    async with simulated() as simulated_drone:
        drone = Drone(simulated_drone.address)
        await drone.connect()
        drone.product.set_state(type(drone.product.state)(firmware=version))
        assert doctor.firmware(drone).wrong is is_wrong
        await drone.close()


# Consent.


async def test_doctor_without_terminal_skips_controller_firmware_and_settings() -> None:
    async with simulated() as drone:
        options = ("--http-port", str(HTTP), "--rtsp-port", str(RTSP))
        async with command("doctor", drone.address, *options) as held:
            assert await held.end() == 0, str(held)
        assert held.lines[-1].startswith("controller, firmware, settings, failsafes: not asked")
        assert f"port {HTTP}: ok: open, web server" in held.lines
        assert sessions(drone) == 0
        async with command("doctor", drone.address, *options, "--take", "--json") as held:
            assert await held.end() == 0, str(held)
        report = json.loads("\n".join(held.lines))
        assert report["not_asked"] == []
        checks = [found["check"] for found in report["findings"]]
        assert checks[-4:] == ["controller", "firmware", "settings", "failsafes"]
        assert sessions(drone) > 0


async def test_info_without_a_terminal_or_take_is_refused() -> None:
    async with simulated() as drone:
        async with command("info", drone.address) as held:
            assert await held.end() == 2
        assert held.lines == []
        (line,) = held.complaints
        assert line.startswith("anafi-mav: --take: expected it, because connecting takes the drone from any controller")
        assert sessions(drone) == 0


@pytest.mark.parametrize("address", ["", "a..b", "\u00fc" * 64])
@pytest.mark.parametrize("name", ["info", "doctor"])
def test_address_that_no_name_server_can_be_asked_for_is_refused(
    name: str, address: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([name, address, "--take"]) == 2
    expected = f"anafi-mav: ADDRESS: expected an IPv4 address or a host name, like 192.168.42.1, got {address!r}"
    assert capsys.readouterr().err.strip() == expected


@pytest.mark.parametrize(("name", "status"), [("info", 1), ("doctor", 0)])
async def test_drone_of_a_gateway_is_left_alone_with_take(name: str, status: int) -> None:
    folder = state_folder(None)
    assert folder is not None
    lock = StateLock(folder)
    assert lock.acquire() is None
    async with simulated() as drone:
        lock.write([HeldDrone("alpha", drone.address, None, drone.identity.serial)])
        ports = ("--http-port", str(HTTP), "--rtsp-port", str(RTSP)) if name == "doctor" else ()
        async with command(name, drone.address, "--take", *ports) as held:
            assert await held.end() == status
        said = "\n".join([*held.lines, *held.complaints])
        assert f"the gateway with process id {os.getpid()} holds it as alpha" in said
        assert sessions(drone) == 0
        # The same aircraft at another address is known by its serial number, which its introduction says.
        lock.write([HeldDrone("alpha", "192.168.42.1", None, drone.identity.serial)])
        async with command(name, drone.address, "--take", *ports) as held:
            assert await held.end() == status
        assert "holds it as alpha" in "\n".join([*held.lines, *held.complaints])
        # One that tries and has not got it is something to look at.
        lock.write([HeldDrone("alpha", drone.address)])
        async with command(name, drone.address, "--take", *ports) as held:
            assert await held.end() == 1
        assert "holds it as alpha (not connected, trying)" in "\n".join([*held.lines, *held.complaints])
        assert sessions(drone) == 0
    lock.release()


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="opens a terminal by os.openpty, which Windows does not have")
@pytest.mark.parametrize(("answer", "connects"), [(b"y\n", True), (b"n\n", False), (b"\n", False), (b"\x04", False)])
async def test_info_at_a_terminal_confirms_before_connecting(answer: bytes, connects: bool) -> None:
    async with simulated() as drone:
        parent, child = os.openpty()
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "anafi_mav", "info", drone.address, "--json"),
            stdin=child,
            stdout=asyncio.subprocess.PIPE,
            stderr=child,
        )
        os.close(child)
        question = b""
        while b"[y/N]" not in question:
            question += await asyncio.to_thread(os.read, parent, 1000)
        assert sessions(drone) == 0
        assert b"takes the drone from any controller that has it" in question
        os.write(parent, answer)
        assert process.stdout is not None
        out = await asyncio.wait_for(process.stdout.read(), 30.0)
        assert await process.wait() == (0 if connects else 1)
        os.close(parent)
        assert (sessions(drone) > 0) is connects
        if connects:
            assert json.loads(out)["serial"] == drone.identity.serial

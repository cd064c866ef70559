"""`anafi-mav discover` and `anafi-mav info`, on simulated devices."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import json
import re
import socket
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from support.product import Process
from support.world import loopback

from anafi_mav.arsdk.link import interface
from anafi_mav.arsdk.link.controller import look
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.cli.discover import Find, SearchAddress, configuration, places
from anafi_mav.config import from_text
from anafi_mav.errors import LinkLost
from anafi_mav.sim import DroneSpec, Simulator, states


@contextlib.asynccontextmanager
async def words(*arguments: str) -> AsyncIterator[Process]:
    held = await Process.start(sys.executable, "-m", "anafi_mav", *arguments)
    try:
        yield held
    finally:
        await held.put_away()


def spec(model: str, skycontroller: int | None = None) -> DroneSpec:
    return DroneSpec(model=model, address=loopback(), http_port=None, skycontroller=skycontroller)


async def test_discover_prints_a_valid_configuration() -> None:
    async with Simulator([spec("4k"), spec("usa", 3), spec("ai", 4)], seed=1) as simulator:
        direct, behind, modern = simulator.drones
        async with words("discover", *(one.address for one in simulator.drones), "--timeout", "5") as held:
            assert await held.end() == 0, str(held)
        text = "\n".join(held.lines)
        found = {drone.address: drone for drone in from_text(text, "stdout").drones}
        assert set(found) == {direct.address, behind.address, modern.address}
        assert found[direct.address].name == direct.identity.name
        assert sorted(drone.sysid for drone in found.values()) == [1, 2, 3]
        assert f"# ANAFI 4K {direct.identity.serial}, found at {direct.address}" in text
        assert re.search(rf"# Skycontroller 3 with the drone behind it, PI\w+, found at {behind.address}", text)
        # By Parrot's mux, which is all that a Skycontroller 4 speaks.
        assert re.search(rf"# Skycontroller 4 with the drone behind it, PI\w+, found at {modern.address}", text)
        async with words("discover", direct.address, "--timeout", "5", "--json") as held:
            assert await held.end() == 0, str(held)
        assert {
            "address": direct.address,
            "interface": None,
            "kind": "drone",
            "model": "ANAFI 4K",
            "model_id": 0x0914,
            "name": direct.identity.name,
            "serial": direct.identity.serial,
        } in json.loads("\n".join(held.lines))
        # No one was disturbed: no session was begun.
        assert not [entry for drone in simulator.drones for entry in drone.log.find("session")]


async def test_nothing_is_there() -> None:
    async with words("discover", loopback(), "--timeout", "0.5") as held:
        assert await held.end() == 1
    assert held.lines == []
    assert held.complaints[0].startswith("anafi-mav: nothing found")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["discover", "here"], "ADDRESS: expected an IPv4 address like 192.168.42.1, got 'here'"),
        (["discover", "--timeout", "x"], "--timeout: expected seconds up to 60, got 'x'"),
        (["discover", "--timeout", "-1"], "--timeout: expected seconds up to 60, got '-1'"),
    ],
)
async def test_mistakes(arguments: list[str], line: str) -> None:
    async with words(*arguments) as held:
        assert await held.end() == 2
    assert held.complaints == [f"anafi-mav: {line}"]


NET42, NET53 = ipaddress.IPv4Network("192.168.42.0/24"), ipaddress.IPv4Network("192.168.53.0/24")


def test_search_covers_known_addresses_on_each_interface() -> None:
    here = [("eth0", ipaddress.IPv4Network("10.0.0.0/24")), ("wlan1", NET42), ("wlan2", NET42), ("usb0", NET53)]
    assert places([], here) == [
        SearchAddress("192.168.42.1", "wlan1"),
        SearchAddress("192.168.42.1", "wlan2"),
        SearchAddress("192.168.53.1", "usb0"),
    ]
    # What was asked for is tried as the routes say, and on the interfaces that are in its network.
    assert places([SearchAddress("10.0.0.7"), SearchAddress("10.9.9.9", "eth0")], here)[:2] == [
        SearchAddress("10.0.0.7"),
        SearchAddress("10.9.9.9", "eth0"),
    ]
    assert SearchAddress("10.0.0.7", "eth0") in places([SearchAddress("10.0.0.7")], here)
    assert SearchAddress("192.168.42.1") in places([], [])


def test_discover_names_the_interface_of_ambiguous_addresses() -> None:
    def find(address: str, on: str, serial: str, name: str = "ANAFI") -> Find:
        return Find(SearchAddress(address, on), DeviceInfo(0x0914, serial, 44444, name))

    lines = configuration(
        [find("192.168.42.1", "wlan1", "A"), find("192.168.42.1", "wlan2", "B"), find("192.168.43.1", "usb0", "C")]
    )
    drones = from_text("\n".join(lines), "lines").drones
    assert [drone.interface for drone in drones] == ["wlan1", "wlan2", None]
    assert [drone.name for drone in drones] == ["ANAFI", "ANAFI-2", "ANAFI-3"]


@pytest.mark.parametrize("name", ["", "no", "007", "2026-01-01", '"}\n- evil: {', "ÄÖÜ", "-", "a" * 300, "x: y # z"])
def test_unusual_device_name_makes_valid_configuration(name: str) -> None:
    device = DeviceInfo(0x1234, name, 44444, name)
    lines = configuration([Find(SearchAddress("192.168.42.1"), device)])
    (drone,) = from_text("\n".join(lines), "lines").drones
    assert drone.address == "192.168.42.1"


async def test_info_of_a_drone_without_a_takeoff_checklist_promises_no_takeoff(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is known then of most reasons: the drone may refuse."""
    monkeypatch.setattr(states, "checklist", lambda blockers: [])
    async with Simulator([spec("4k")], seed=1) as simulator:
        async with words("info", simulator.drones[0].address, "--take") as held:
            assert await held.end() == 0, str(held)
        async with words("doctor", simulator.drones[0].address, "--take") as doctor:
            await doctor.end()
    assert "take-off: no reason against it reported" in held.lines
    assert any("settings: ok: no reason against a take-off reported" in line for line in doctor.lines), str(doctor)


async def test_info_prints_the_drone() -> None:
    async with Simulator([spec("thermal", 3)], seed=1) as simulator:
        drone = simulator.drones[0]
        async with words("info", drone.address, "--take") as held:
            assert await held.end() == 0, str(held)
        text = "\n".join(held.lines)
        for line in (
            "model: ANAFI Thermal",
            f"name: {drone.identity.name}",
            f"serial: {drone.identity.serial}",
            "take-off: possible",
            "  max tilt: 10, 1 to 40",
            "  max vertical speed: 3, 0.1 to 4",
        ):
            assert line in held.lines, text
        assert re.search(r"^firmware: \d[\w.]*, hardware ", text, re.M)
        assert re.search(r"^battery: \d+ %, [\d.]+ V", text, re.M)
        assert re.search(r"^GPS: fix, \d+ satellites$", text, re.M)
        assert re.search(r"^features: .*\bbattery, .*\bgimbal\b.*\brth\b.*\bthermal\b", text, re.M)
        assert re.search(r"^controller: PI\w+, firmware 1.8.2, battery 87 %$", text, re.M)


async def test_info_json_has_the_same_facts() -> None:
    async with Simulator([spec("usa", 3)], seed=1) as simulator:
        drone = simulator.drones[0]
        async with words("info", drone.address, "--take", "--json") as held:
            assert await held.end() == 0, str(held)
    facts = json.loads("\n".join(held.lines))
    assert (facts["model"], facts["serial"], facts["firmware"]) == ("ANAFI USA", drone.identity.serial, "1.8.2")
    assert facts["limits"]["max tilt"] == {"value": 10.0, "min": 1.0, "max": 40.0}
    assert facts["takeoff_blockers"] == []
    assert facts["controller"]["battery_percent"] == 87


async def test_escapes_of_a_drone_reach_no_terminal() -> None:
    one = DroneSpec(address=loopback(), http_port=None, rtsp_port=None, name="\x1b]0;owned\x07 drone")
    async with Simulator([one], seed=1) as simulator:
        for command in (("info", one.address, "--take"), ("discover", one.address, "--timeout", "5")):
            async with words(*command) as held:
                assert await held.end() == 0, str(held)
            assert not {"\x1b", "\x07"} & set("".join(held.lines))
            if command[0] == "info":
                assert r"name: \x1b]0;owned\x07 drone" in held.lines
    assert simulator.drones[0].identity.name.startswith("\x1b")


async def test_info_without_a_drone_fails() -> None:
    address = loopback()
    async with words("info", address, "--take") as held:
        assert await held.end() == 1
    assert held.complaints == [f"anafi-mav: cannot connect to {address}:44445: Connection refused"]


async def test_looking_hears_the_introduction_only() -> None:
    async with Simulator([spec("4k")], seed=1) as simulator:
        drone = simulator.drones[0]
        assert await look(drone.address) == DeviceInfo(0x0914, drone.identity.serial, 44444, drone.identity.name)
    with pytest.raises(LinkLost):
        await look(drone.address)
    # A server that says nothing.
    with socket.create_server(("127.0.0.1", 0)) as mute:
        with pytest.raises(LinkLost, match=r"no answer from 127.0.0.1 within 0.2 s"):
            await look("127.0.0.1", discovery_port=mute.getsockname()[1], timeout=0.2)
        await asyncio.sleep(0)


ROUTES = """\
Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT
eth0\t00000000\t010200C0\t0003\t0\t0\t0\t00000000\t0\t0\t0
wlan1\t002AA8C0\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0
eth0\t000014AC\t010200C0\t0003\t0\t0\t0\t0000FFFF\t0\t0\t0
"""


@pytest.mark.skipif(sys.byteorder != "little", reason="the table is one of a little-endian machine")
def test_networks_are_those_without_a_router(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = tmp_path / "route"
    table.write_text(ROUTES)
    monkeypatch.setattr(interface, "ROUTES", table)
    assert interface.networks() == [("wlan1", NET42)]
    monkeypatch.setattr(interface, "ROUTES", tmp_path / "none")
    assert interface.networks() == []

"""What a service manager hears, at a real Unix datagram socket."""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from anafi_mav.cli.service_manager import ServiceManager


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as held:
        held.bind(str(tmp_path / "notify"))
        held.setblocking(False)
        yield held


def environment(manager: socket.socket, **more: str) -> dict[str, str]:
    return {"NOTIFY_SOCKET": str(manager.getsockname()), **more}


async def heard(manager: socket.socket, count: int) -> list[str]:
    loop = asyncio.get_running_loop()
    return [(await asyncio.wait_for(loop.sock_recv(manager, 100), 5.0)).decode() for _ in range(count)]


async def test_service_manager_hears_ready_life_and_stopping(manager: socket.socket) -> None:
    with ServiceManager(environment(manager, WATCHDOG_USEC="100000", WATCHDOG_PID=str(os.getpid()))) as service:
        assert await heard(manager, 0) == []
        service.ready("2 drones")
        begun = asyncio.get_running_loop().time()
        lines = await heard(manager, 4)
        assert asyncio.get_running_loop().time() - begun >= 0.1  # at 0, 50 and 100 ms
        assert lines == ["READY=1\nSTATUS=2 drones", "WATCHDOG=1", "WATCHDOG=1", "WATCHDOG=1"]
        service.stopping()
        later = await heard(manager, 4)
        # One that was due before may arrive first, and they go on behind it.
        assert "STOPPING=1" in later[:3]
        assert later[-1] == "WATCHDOG=1"


@pytest.mark.parametrize(
    "more", [{}, {"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": "x"}, {"WATCHDOG_USEC": "100000", "WATCHDOG_PID": "1"}]
)
async def test_service_manager_without_watchdog_hears_no_life(manager: socket.socket, more: dict[str, str]) -> None:
    with ServiceManager(environment(manager, **more)) as service:
        service.ready("")
        service.stopping()
    assert await heard(manager, 2) == ["READY=1\nSTATUS=", "STOPPING=1"]


async def test_absent_or_vanished_service_manager_is_survived(tmp_path: Path) -> None:
    for place in ("", str(tmp_path / "gone"), "@anafi-mav-no-listener"):
        with ServiceManager({"NOTIFY_SOCKET": place, "WATCHDOG_USEC": "100000"}) as service:
            service.ready("")


@pytest.mark.skipif(not hasattr(socket, "AF_UNIX") or os.uname().sysname != "Linux", reason="abstract addresses")
async def test_abstract_address_of_a_service_manager_is_reached() -> None:
    name = f"anafi-mav-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as held:
        held.bind("\0" + name)
        held.setblocking(False)
        with ServiceManager({"NOTIFY_SOCKET": "@" + name}) as service:
            service.ready("x")
            service.stopping()
        assert await heard(held, 2) == ["READY=1\nSTATUS=x", "STOPPING=1"]

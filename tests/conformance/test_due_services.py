"""Services are called when something is due: rarely while nothing happens, and soon after something has."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.world import world

from anafi_mav.services.parameter.parameter_service import ParameterService

WATCHED = 10.0
"""s."""


def ticks(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the times of the ticks from now on of a service that only looks for changes."""
    found: list[float] = []
    tick = ParameterService.tick

    def counted(self: ParameterService, now: float) -> float:
        found.append(now)
        return tick(self, now)

    monkeypatch.setattr(ParameterService, "tick", counted)
    return found


async def test_idle_drone_ticks_a_few_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """With each heartbeat, and after the location that the drone reports once a second."""
    async with world(speed=1.0, telemetry_rate=30.0) as w:
        await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        found = ticks(monkeypatch)
        await asyncio.sleep(WATCHED)
        assert WATCHED - 1.0 <= len(found) <= 3.0 * WATCHED


async def test_messages_of_a_client_tick_ten_times_a_second_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    async with world(speed=1.0) as w:
        found = ticks(monkeypatch)
        for _ in range(100):
            w.client.send(dialect.MAVLink_param_request_read_message(1, 1, b"MAV_SYS_ID", -1))
            await asyncio.sleep(0.02)
        assert 10 <= len(found) <= 26  # in two seconds, with those of heartbeats and locations


async def test_zoom_by_the_pilot_is_reported_at_once() -> None:
    """No client has asked for it, and the event that reports it arrives many times a second."""
    async with world(speed=1.0, telemetry_rate=20.0) as w:
        main, loop = w.drone.firmware.payload.cameras[0], asyncio.get_running_loop()
        delays = []
        for number in range(1, 9):
            mark, began = w.client.mark(), loop.time()
            main.zoom = 1.0 + number / 10
            await w.client.wait("CAMERA_SETTINGS", since=mark)
            delays.append(loop.time() - began)
            await asyncio.sleep(0.13)
        assert max(delays) < 0.4

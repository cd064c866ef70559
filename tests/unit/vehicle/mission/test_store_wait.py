"""The wait for a mission that is being stored: a newer command ends it at every moment."""

from __future__ import annotations

import asyncio

import pytest

from anafi_mav.vehicle.mission.flight import StoreWait


@pytest.mark.parametrize("iterations", range(4))
async def test_cancellation_when_a_mission_has_just_been_stored_is_not_lost(iterations: int) -> None:
    """A Hold that ends the wait must not be followed by the mission's start."""
    wait = StoreWait()
    with wait.going_on():
        waiting = asyncio.get_running_loop().create_task(wait.over())
        await asyncio.sleep(0)
        await asyncio.sleep(0)
    for _ in range(iterations):
        await asyncio.sleep(0)
    is_cancelled = waiting.cancel()
    await asyncio.wait({waiting})
    assert waiting.cancelled() is is_cancelled

"""A move that is refused before it is sent: nothing of it stays, no future whose error no one retrieves."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any

import pytest
from support.scripted_device import ScriptedDevice

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.drone import Drone
from anafi_mav.errors import CommandRejected

VERBS: dict[str, Callable[[Drone], Coroutine[Any, Any, Any]]] = {
    "moveTo": lambda drone: drone.piloting.move_to(48.0, 2.0, 10.0),
    "moveBy": lambda drone: drone.piloting.move_by(1.0, 0.0, 0.0, 0.0),
    "return": lambda drone: drone.piloting.return_home(),
}


@pytest.fixture
async def complaints() -> AsyncIterator[list[dict[str, Any]]]:
    """What asyncio logs by itself."""
    found: list[dict[str, Any]] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda loop, context: found.append(context))
    yield found
    loop.set_exception_handler(None)


@pytest.mark.parametrize("name", VERBS)
async def test_move_refused_by_the_gate_leaves_no_unretrieved_error(
    device: ScriptedDevice, drone: Drone, complaints: list[dict[str, Any]], name: str
) -> None:
    """The gate refuses while the pilot at a Skycontroller flies."""

    def gate(message: object) -> bool:
        raise CommandRejected("the pilot flies")

    device.say(ardrone3.FlyingStateChanged(FlyingState.HOVERING))
    await drone.expect(ardrone3.FlyingStateChanged)
    drone._commander.gate = gate
    with pytest.raises(CommandRejected, match="the pilot flies"):
        await VERBS[name](drone)
    drone._commander.gate = None
    gc.collect()
    await asyncio.sleep(0)
    assert complaints == []
    assert drone.moves_started == ()

"""Whatever was begun, aborted or replaced, in whatever air: once `stop` has returned, nothing moves and nothing comes.

The commands that begin something are drawn from a seed, and so is the weather; the simulated drone's own log is the
judge.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from support.flight_plans import V1
from support.simulated import HOME, Pair, connected, take_off

from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.errors import AnafiMavError, CommandRejected, LinkLost
from anafi_mav.sim.world.faults import Impairment

ROUNDS = 8

STALE = 0.7
"""s in which what was withdrawn would have come: several retransmissions, and whatever the air held back."""

BEGIN = {
    "moveTo",
    "Start",
    "StartPilotedPOIV2",
    "return_to_home",
    "start_horizontal_panorama",
}
"""Last parts of the names of the commands that begin something; a moveBy of nothing does not."""

AIR = [
    (Impairment(), Impairment()),
    (Impairment(loss=1.0), Impairment()),
    (Impairment(), Impairment(loss=1.0)),
    (
        Impairment(loss=0.5, delay=0.05, jitter=0.15, duplicate=0.3),
        Impairment(loss=0.5, delay=0.05, jitter=0.15),
    ),
]
"""To the drone, and from it."""


def begins(entry: Any) -> bool:
    name = entry.name.rpartition(".")[2]
    if name == "moveBy":
        return any(entry.args[axis] for axis in ("dX", "dY", "dZ", "dPsi"))
    return entry.kind == "command" and name in BEGIN


async def weather(pair: Pair, chance: random.Random) -> None:
    faults = pair.real.faults
    up, down = chance.choice(AIR)
    await asyncio.sleep(chance.choice([0.0, 0.0, 0.01, 0.1, 0.4]))
    faults.up, faults.down = up, down
    await asyncio.sleep(chance.uniform(0.1, 1.8))
    faults.up = faults.down = Impairment()


async def flies(pair: Pair) -> None:
    """Connected, and hovering or flying."""
    while True:
        try:
            if not pair.drone.connected:
                await pair.drone.connect()
            if pair.drone.piloting.state.flying not in (FlyingState.HOVERING, FlyingState.FLYING):
                await take_off(pair.drone)
            return
        except (LinkLost, CommandRejected):
            await asyncio.sleep(0.3)


@pytest.mark.parametrize("seed", range(3))
async def test_drone_after_stop_neither_moves_nor_reports(seed: int) -> None:
    chance = random.Random(seed)
    async with connected("4k", speed=3.0) as pair:
        drone, real = pair

        async def fly_plan() -> None:
            uid = await drone.flight_plan.upload(V1)
            await drone.flight_plan.start(uid, timeout=chance.choice([0.3, 2.0]))

        verbs: list[Callable[[], Awaitable[Any]]] = [
            lambda: drone.piloting.move_to(HOME[0] + 0.0006, HOME[1], 8.0, timeout=chance.choice([0.3, 2.0])),
            lambda: drone.piloting.move_by(
                chance.uniform(-20.0, 20.0), 0.0, 0.0, 0.0, timeout=chance.choice([0.3, 8.0])
            ),
            fly_plan,
            lambda: drone.poi.start(HOME[0] + 0.0003, HOME[1], 2.0, timeout=chance.choice([0.3, 2.0])),
            lambda: drone.piloting.return_home(timeout=chance.choice([0.3, 2.0])),
            lambda: drone.animations.horizontal_panorama(),
        ]
        for _ in range(ROUNDS):
            await flies(pair)
            blowing = asyncio.ensure_future(weather(pair, chance))
            tasks = []
            for _ in range(chance.choice([1, 1, 2, 3])):
                tasks.append(asyncio.ensure_future(chance.choice(verbs)()))
                await asyncio.sleep(chance.choice([0.0, 0.005, 0.05, 0.3]))
            for task in tasks:
                if chance.random() < 0.4:
                    task.cancel()
            await asyncio.sleep(chance.choice([0.0, 0.01, 0.2, 0.8]))
            try:
                await drone.piloting.stop()
                await drone.piloting.cancel_return_home()
            except AnafiMavError:
                stopped = None  # it is said that it was not confirmed
            else:
                stopped = asyncio.get_running_loop().time()
            await blowing
            done, hanging = await asyncio.wait(tasks, timeout=10.0)
            assert not hanging
            for task in done:
                assert task.cancelled() or isinstance(task.exception(), AnafiMavError | None)
            if stopped is None:
                continue
            await asyncio.sleep(STALE)
            assert [entry for entry in real.log if begins(entry) and entry.t > stopped] == []
            if drone.connected:  # a drone that has lost its link goes home by itself
                firmware = real.firmware
                assert not firmware.flight_plan.playing
                assert not firmware.guidance.busy
                assert not firmware.poi.running

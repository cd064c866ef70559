"""moveBy to moveByEnd: our controller beside Olympe's, on the same simulated drone.

    .venv/bin/python tests/bench/moves.py [MOVES]

Both fly the same moves one after the other, each in a process of its own. The simulator's log says how long the drone
took from the command's arrival to its moveByEnd; what a controller needed beyond that is its own: sending, the way
there and back, and waking up its caller. Without Olympe (it exists for x86-64 Linux and Python < 3.12) only ours flies.
"""

from __future__ import annotations

import asyncio
import importlib.util
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import msgspec
from common import loopback, machine, product, quantile

MOVE = (0.5, 0.0, 0.0, 0.0)
"""m forward, right, down, and rad to the right."""


def main() -> None:
    moves = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    drone = loopback()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "sim.jsonl"
        with product("sim", "--address", drone, "--log", str(log), "--http-port", "8080"):
            taken = {"ours": _fly("--ours", drone, moves)}
            if importlib.util.find_spec("olympe") is not None:
                taken["Olympe"] = _fly("--olympe", drone, moves)
        entries = [msgspec.json.decode(line) for line in log.read_bytes().splitlines()]
    flown = _flown(entries)
    print(machine())
    own = {}
    for number, (name, times) in enumerate(taken.items()):
        mine = flown[number * moves : (number + 1) * moves]
        own[name] = [total - flight for total, flight in zip(times, mine, strict=True)]
        print(
            f"{name}: moveBy to moveByEnd {quantile(times, 0.5):.3f} s (median of {moves}), of which the controller's "
            f"own {1000 * quantile(own[name], 0.5):.2f} ms, largest {1000 * max(own[name]):.2f} ms"
        )
    if "Olympe" in own:
        print(f"ratio ours to Olympe's: {quantile(own['ours'], 0.5) / quantile(own['Olympe'], 0.5):.2f}")


def _fly(who: str, drone: str, moves: int) -> list[float]:
    run = subprocess.run(
        [sys.executable, __file__, who, drone, str(moves)], stdout=subprocess.PIPE, text=True, timeout=300, check=True
    )
    times: list[float] = json.loads(run.stdout.splitlines()[-1])
    return times


def _flown(entries: list[dict]) -> list[float]:
    """s from each moveBy's arrival to its moveByEnd, by the drone's own log."""
    began, flown = 0.0, []
    for entry in entries:
        if entry["name"] == "ardrone3.Piloting.moveBy":
            began = entry["t"]
        elif entry["name"] == "ardrone3.PilotingEvent.moveByEnd" and began:
            flown.append(entry["t"] - began)
            began = 0.0
    return flown


async def ours(drone: str, moves: int) -> list[float]:
    from anafi_mav.arsdk.messages.ardrone3 import FlyingState, FlyingStateChanged
    from anafi_mav.drone import Drone

    taken = []
    anafi = Drone(drone)
    await anafi.connect()
    await anafi.piloting.take_off()
    await anafi.expect(FlyingStateChanged, lambda message: message.state == FlyingState.HOVERING, timeout=20.0)
    for number in range(moves):
        began = time.monotonic()
        await anafi.piloting.move_by(*(part if number % 2 else -part for part in MOVE))
        taken.append(time.monotonic() - began)
    await anafi.piloting.land()
    await anafi.close()
    return taken


def olympes(address: str, moves: int) -> list[float]:
    import olympe
    import olympe.log
    from olympe.messages.ardrone3.Piloting import Landing, TakeOff, moveBy
    from olympe.messages.ardrone3.PilotingState import FlyingStateChanged

    olympe.log.update_config({"loggers": {"olympe": {"level": "CRITICAL"}, "ulog": {"level": "CRITICAL"}}})
    taken = []
    drone = olympe.Drone(address)
    assert drone.connect()
    assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=20)).wait().success()
    for number in range(moves):
        began = time.monotonic()
        # Olympe's expectation of moveBy is its moveByEnd
        assert drone(moveBy(*(part if number % 2 else -part for part in MOVE), _timeout=20)).wait().success()
        taken.append(time.monotonic() - began)
    assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=20)).wait().success()
    drone.disconnect()
    return taken


if __name__ == "__main__":
    if sys.argv[1:2] == ["--ours"]:
        print(json.dumps(asyncio.run(ours(sys.argv[2], int(sys.argv[3])))))
    elif sys.argv[1:2] == ["--olympe"]:
        print(json.dumps(olympes(sys.argv[2], int(sys.argv[3]))))
    else:
        main()

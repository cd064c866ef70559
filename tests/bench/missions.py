"""An upload of 1 000 mission items by MAVSDK: to the gateway, to MAVSDK's own mission_raw server, to bare servers.

    .venv/bin/python tests/bench/missions.py [ITEMS] [ROUNDS]

One MAVSDK client uploads the same items to each, in turns, over UDP on the loopback; each is a process of its own. A
figure is the time that `upload_mission` takes. The floor is what Python takes for the round trips alone: two servers
that answer with bytes made beforehand (`bare_vehicle.py`).
"""

from __future__ import annotations

import asyncio
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from common import loopback, machine, product, quantile

BARE = Path(__file__).parent / "bare_vehicle.py"
SERVER = Path(__file__).parents[1] / "clients" / "mavsdk_vehicle.py"


def main() -> None:
    items = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    print(machine(), flush=True)
    with ExitStack() as stack:
        ours, theirs, drone = f"{loopback()}:14550", f"{loopback()}:14550", loopback()
        urls = {"gateway": ours, "MAVSDK's server": theirs}
        config = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "fleet.yaml"
        config.write_text(
            f'endpoints: ["udpout://{ours}"]\ndrones: [{{name: alpha, sysid: 1, sim: {{address: {drone}}}}}]\n'
        )
        stack.enter_context(product("run", "-c", str(config)))
        servers = [[str(SERVER), f"udpout://{theirs}"]]
        for kind, title in (("asyncio", "bare asyncio"), ("blocking", "bare socket")):
            host = loopback()
            urls[title] = f"{host}:14550"
            servers.append([str(BARE), host, "14550", str(items), kind])
        for words in servers:
            server = stack.enter_context(
                subprocess.Popen([sys.executable, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            )
            stack.callback(server.terminate)
        times: dict[str, list[float]] = {name: [] for name in urls}
        for _ in range(rounds):
            for name, url in urls.items():
                words = [sys.executable, __file__, "--upload", f"udpin://{url}", str(items)]
                run = subprocess.run(
                    words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, timeout=300, check=True
                )
                times[name].append(float(run.stdout.splitlines()[-1]))
    for name, taken in times.items():
        print(
            f"{name}: {items} items in {quantile(taken, 0.5):.3f} s "
            f"(median of {rounds}, {min(taken):.3f} to {max(taken):.3f})"
        )
    yardstick = times.pop("MAVSDK's server")
    for name, taken in times.items():
        ratio, best = quantile(taken, 0.5) / quantile(yardstick, 0.5), min(taken) / min(yardstick)
        print(f"ratio of {name} to MAVSDK's server: {ratio:.2f} (of the quickest: {best:.2f})")


async def upload(url: str, count: int) -> float:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.mission_raw import MissionItem, MissionRawAsync

    items = [
        MissionItem(
            seq, 3, 16, int(seq == 0), 1, 0.0, 1.0, 0.0, float("nan"),
            488789000 + 30 * seq, 23677000, 10.0 + seq % 40, 0,
        )
        for seq in range(count)
    ]  # fmt: skip
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(url)
        drone = await mavsdk.first_autopilot(timeout_s=30.0)
        assert drone is not None
        mission = MissionRawAsync(drone)
        began = time.monotonic()
        await mission.upload_mission(items)
        return time.monotonic() - began


if __name__ == "__main__":
    if sys.argv[1:2] == ["--upload"]:
        print(asyncio.run(upload(sys.argv[2], int(sys.argv[3]))))
    else:
        main()

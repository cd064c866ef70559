"""Rate, age and processor time of pose at 30 Hz, from the metadata of the live video.

    .venv/bin/python tests/bench/pose.py [SECONDS] [MODEL]

One client requests every pose message and ANAFI_PICTURE 30 times a second from one hovering drone. Client, gateway
and simulator are three processes. The age of a message is the time from the picture to its arrival here, by
SYSTEM_TIME. The simulated camera has no delay of its own: the figure is what the gateway and two journeys on loopback
add. The cost is compared with that of the same messages from events, five times a second.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from subprocess import Popen

from common import Client, loopback, machine, product, quantile, usage

sys.path.insert(0, str(Path(__file__).parents[2]))

from anafi_mav.mavlink import dialect

IN_MS = ("ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED")
IN_US = ("ALTITUDE", "ODOMETRY")
OTHERS = ("VFR_HUD", "GIMBAL_DEVICE_ATTITUDE_STATUS", "ANAFI_PICTURE")
IDS = {kind.msgname: id for id, kind in dialect.mavlink_map.items()}
SETTLE = 3.0
"""s for the video to begin, and for what came before to leave."""


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    model = sys.argv[2] if len(sys.argv) > 2 else "4k"
    drone, address = loopback(), loopback()
    print(f"{machine()}; {model}", flush=True)
    with ExitStack() as stack:
        simulator = stack.enter_context(
            product("sim", "--address", drone, "--model", model, "--http-port", "0", "--rtsp-port", "8554")
        )
        path = stack.enter_context(_configuration(drone, address))
        gateway = stack.enter_context(product("run", "-c", path))
        client = Client(f"udpin:{address}:14550")
        client.take_off(10.0)
        for title, hz in (("events", 5.0), ("pictures", 30.0)):
            for name in (*IN_MS, *IN_US, *OTHERS):
                if hz == 30.0 or name != "ANAFI_PICTURE":
                    client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, IDS[name], 1e6 / hz)
            print(f"{title}:")
            _measure(client, gateway, simulator, seconds)


def _measure(client: Client, gateway: Popen[str], simulator: Popen[str], seconds: float) -> None:
    end = time.monotonic() + SETTLE
    while time.monotonic() < end:
        client.link.recv_match(blocking=True, timeout=0.1)
    before, began = (usage(gateway)[0], usage(simulator)[0]), time.monotonic()
    arrivals: dict[str, list[float]] = defaultdict(list)
    stamps: list[tuple[float, float]] = []
    clock: float | None = None
    while (now := time.monotonic()) < began + seconds:
        message = client.link.recv_match(blocking=True, timeout=began + seconds - now)
        if message is None:
            continue
        kind = message.get_type()
        arrivals[kind].append(time.monotonic())
        if kind == "SYSTEM_TIME":
            clock = message.time_unix_usec / 1e6 - message.time_boot_ms / 1e3
        elif kind in IN_MS:
            stamps.append((time.time(), message.time_boot_ms / 1e3))
        elif kind in IN_US:
            stamps.append((time.time(), message.time_usec / 1e6))
    elapsed = time.monotonic() - began
    costs = [usage(process)[0] - cost for process, cost in zip((gateway, simulator), before, strict=True)]
    for name in (*IN_MS, *IN_US, *OTHERS):
        times = arrivals[name] or arrivals[f"UNKNOWN_{IDS[name]}"]
        if len(times) > 1:
            gaps = [b - a for a, b in itertools.pairwise(times)]
            print(f"  {name}: {len(times) / elapsed:.1f} Hz, largest gap {1000 * max(gaps):.0f} ms")
    if clock is not None and stamps:
        ages = [1000 * (at - clock - stamp) for at, stamp in stamps]
        print(f"  age: p50 {quantile(ages, 0.5):.1f} ms, p99 {quantile(ages, 0.99):.1f} ms")
    print(f"  gateway {100 * costs[0] / elapsed:.1f} %, simulator {100 * costs[1] / elapsed:.1f} % of a core")


@contextmanager
def _configuration(drone: str, address: str) -> Iterator[str]:
    """The path of a configuration with one drone, whose video port every user may open."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fleet.yaml"
        path.write_text(
            f"endpoints: ['udpout://{address}:14550']\n"
            f"state: {folder}\n"
            f"drones: [{{name: anafi, sysid: 1, address: {drone}, rtsp_port: 8554}}]\n"
        )
        yield str(path)


if __name__ == "__main__":
    main()

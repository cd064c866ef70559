"""MAVLink in, ARSDK out: how long the gateway takes, for a setpoint and for a command.

    .venv/bin/python tests/bench/latency.py [SETPOINTS] [COMMANDS] [DRONES] [many]

Client, gateway and simulator are three processes. The client notes the monotonic clock before its send; the
simulator's log has the same clock at the moment its socket was read. So the figures hold two hops over loopback and
the waking up of two processes besides the gateway's own work. A setpoint is SET_ATTITUDE_TARGET, which becomes PCMD;
each leans to the other side than the one before. A command is DO_REPOSITION, which becomes moveTo, found by its height.
`many`: with several MAVLink frames per datagram (`frames=many`). DRONES (0): as many others send attitude, speed and
height 30 times a second, and the gateway streams all of it to a second endpoint.

The last row has the same setpoints at the same intervals, but in the places of gateway and simulator two programs of
asyncio that do nothing else: one sends on each datagram that it reads, the other notes the time. No gateway in Python
is faster than that on this machine.
"""

from __future__ import annotations

import json
import math
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec
import yaml
from common import Client, consecutive, frames_option, loopback, machine, product, quantile
from pymavlink import mavutil

WARM_UP = 40
"""Setpoints that are not counted: a vehicle takes Offboard only while setpoints arrive."""


PAUSE = 0.03
"""s from one setpoint to the next."""

BARE = """
import asyncio, json, sys, time

class Bare(asyncio.DatagramProtocol):
    def datagram_received(self, data, address):
        if onward:
            onward.sendto(data)
        elif data != b"end":
            times.append(time.monotonic())
        if data == b"end":
            asyncio.get_running_loop().call_later(0.1, done.set)

async def main():
    global onward, done, times
    onward, done, times = None, asyncio.Event(), []
    loop = asyncio.get_running_loop()
    if len(sys.argv) > 2:
        onward, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, remote_addr=(sys.argv[2], 14550))
    await loop.create_datagram_endpoint(Bare, local_addr=(sys.argv[1], 14550))
    print("ready", flush=True)
    await done.wait()
    print(json.dumps(times))

asyncio.run(main())
"""
"""Reads datagrams at an address, and sends them on to another or notes when they came."""


def quaternion(roll: float) -> list[float]:
    return [math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0]


def main() -> None:
    words, query = frames_option(sys.argv[1:])
    setpoints = int(words[0]) if words else 1000
    commands = int(words[1]) if len(words) > 1 else 100
    others = int(words[2]) if len(words) > 2 else 0
    drone, address = loopback(), loopback()
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        log, config = Path(folder) / "sim.jsonl", Path(folder) / "fleet.yaml"
        endpoints, drones = [f"udpout://{address}:14550{query}"], [drone]
        if others:
            drones += consecutive(loopback(), others)
            station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # its buffer fills: nothing reads it
            station.bind((loopback(), 0))
            host, port = stack.enter_context(station).getsockname()
            endpoints = [f"{endpoints[0]}{'&' if query else '?'}systems=1", f"udpout://{host}:{port}{query}"]
            fleet = ("--count", str(others), "--telemetry-rate", "30", "--http-port", "0")
            stack.enter_context(product("sim", "--address", drones[1], *fleet))
        entries = [{"name": f"d{number}", "sysid": number, "address": at} for number, at in enumerate(drones, 1)]
        config.write_text(yaml.safe_dump({"endpoints": endpoints, "drones": entries}))
        with (
            product("sim", "--address", drone, "--log", str(log), "--http-port", "0"),
            product("run", "-c", str(config)),
        ):
            client = Client(f"udpin:{address}:14550")
            client.take_off(5.0)
            rolls = _setpoints(client, setpoints)
            heights = _commands(client, commands)
        entries = [msgspec.json.decode(line) for line in log.read_bytes().splitlines()]
    received = [entry for entry in entries if entry["kind"] == "command"]
    print(machine(), query, f"beside {others} drones" if others else "")
    _say("SET_ATTITUDE_TARGET -> PCMD", _pcmd_delays(rolls, received))
    _say("DO_REPOSITION -> moveTo", _move_delays(heights, received))
    _say("SET_ATTITUDE_TARGET through a program that only sends it on", _bare_delays(setpoints))


def _setpoints(client: Client, count: int) -> list[tuple[float, int]]:
    """Send setpoints that lean 5 degrees to one side and to the other in turns: (when, 1 or -1)."""
    sent = []
    for number in range(-WARM_UP, count):
        if number == -WARM_UP // 2:
            client.link.mav.command_long_send(1, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0)  # PX4's Offboard
        side = 1 if number % 2 else -1
        lean = quaternion(math.radians(5.0 * side))
        sent.append((time.monotonic(), side))
        client.link.mav.set_attitude_target_send(0, 1, 1, 0b00000111, lean, 0, 0, 0, 0.5)
        client.drain()
        time.sleep(PAUSE)
    client.command(mavutil.mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 3)  # PX4's Hold
    return sent[WARM_UP:]


def _pcmd_delays(sent: list[tuple[float, int]], received: list[dict]) -> list[float]:
    """Of each setpoint the time to the first PCMD that leans to its side, if that came before the next setpoint."""
    pcmds = [(entry["t"], entry["args"]["roll"]) for entry in received if entry["name"] == "ardrone3.Piloting.PCMD"]
    delays = []
    ends = [at for at, _ in sent[1:]] + [sent[-1][0] + PAUSE]
    for (at, side), end in zip(sent, ends, strict=True):
        found = next((t for t, roll in pcmds if at <= t < end and roll * side > 0), None)
        if found is not None:
            delays.append(found - at)
    print(f"{len(delays)} of {len(sent)} setpoints found in the simulator's log")
    return delays


def _commands(client: Client, count: int) -> list[tuple[float, float]]:
    """Send the vehicle up in small steps, each to a height of its own: (when, height)."""
    sent = []
    position = client.expect("GLOBAL_POSITION_INT", 5.0)
    for number in range(count):
        height = 10.0 + 0.25 * number
        sent.append((time.monotonic(), height))
        client.link.mav.command_int_send(1, 1, 6, 192, 0, 0, -1, 1, 0, float("nan"), position.lat, position.lon, height)
        client.expect("COMMAND_ACK", 5.0, lambda ack: ack.command == 192 and ack.result == 0)
    return sent


def _move_delays(sent: list[tuple[float, float]], received: list[dict]) -> list[float]:
    moves = {
        round(entry["args"]["altitude"], 2): entry["t"]
        for entry in received
        if entry["name"].endswith(("Piloting.moveTo", "move.extended_move_to"))
    }
    delays = [moves[height] - at for at, height in sent if height in moves]
    print(f"{len(delays)} of {len(sent)} commands found in the simulator's log")
    return delays


def _bare_delays(count: int) -> list[float]:
    """Of each setpoint the time until a program has read it that another has sent it on to."""
    last, first = loopback(), loopback()
    receiver, forwarder = _bare(last), _bare(first, last)
    link: Any = mavutil.mavlink_connection(f"udpout:{first}:14550", source_system=255, source_component=190)
    sent = []
    for number in range(count):
        lean = quaternion(math.radians(5.0 if number % 2 else -5.0))
        sent.append(time.monotonic())
        link.mav.set_attitude_target_send(0, 1, 1, 0b00000111, lean, 0, 0, 0, 0.5)
        time.sleep(PAUSE)
    link.write(b"end")
    received = json.loads(receiver.communicate(timeout=10.0)[0])
    forwarder.communicate(timeout=10.0)
    return [came - at for at, came in zip(sent, received, strict=True)]


def _bare(*arguments: str) -> subprocess.Popen[str]:
    process = subprocess.Popen([sys.executable, "-c", BARE, *arguments], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    return process


def _say(what: str, delays: list[float]) -> None:
    p50, p99 = (1000 * quantile(delays, share) for share in (0.5, 0.99))
    print(f"{what}: p50 {p50:.2f} ms, p99 {p99:.2f} ms, largest {1000 * max(delays):.2f} ms")


if __name__ == "__main__":
    main()

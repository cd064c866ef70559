"""Clients that take places and time: 40 idle ones, and one that requests a file's CRC 2 000 times a second.

    .venv/bin/python tests/bench/hostile_clients.py [SECONDS] [RATE]

Gateway, simulator, station and flooding client are four processes. The idle clients are 40 connections to a `tcpin`
that send nothing, and 40 peers of a `udpin` that send three heartbeats and are silent. Then ten stations join each
endpoint in turn and send a command: how many are served, and the longest time from the first datagram to the
acknowledgement.

The flood is the MAVLink FTP request for the CRC of `@PARAM/param.pck`, which ArduPilot's clients read. The station
sends a command every 20 ms, before the flood and during it, and measures the time to its acknowledgement. A flood below
99 % of its rate voids the run. Exit status 1 if a station was locked out, or the p99 beside the flood is 20 ms or more.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from common import Client, loopback, machine, product, quantile, usage
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as stock

IDLE, STATIONS = 40, 10
SILENT = 6.0
"""s: a client that has been silent for 5 s gives way."""
CRC, PATH = 14, b"@PARAM/param.pck"
EVERY = 0.02
"""s between the station's commands."""
LIMIT = 0.020
"""s: most of the p99."""


def flood(address: str, seconds: float, rate: float) -> None:
    """Request the CRC at a rate, and print how many requests were sent and answered."""
    link: Any = mavutil.mavlink_connection(f"tcp:{address}:5760", source_system=250, source_component=1)
    sent = answered = 0
    began = time.monotonic()
    while (now := time.monotonic() - began) < seconds:
        while sent < now * rate:
            payload = bytes((sent & 0xFF, sent >> 8 & 0xFF, 0, CRC, len(PATH), 0, 0, 0, 0, 0, 0, 0)) + PATH
            link.mav.file_transfer_protocol_send(0, 1, 1, payload.ljust(251, b"\0"))
            sent += 1
        while (message := link.recv_msg()) is not None:
            answered += message.get_msgId() == stock.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL and message.payload[3] == 128
        time.sleep(0.001)
    print(json.dumps({"rate": sent / (time.monotonic() - began), "sent": sent, "answered": answered}))


def idle(address: str) -> list[socket.socket]:
    """Take places on both endpoints."""
    beats = stock.MAVLink(None, 10, 190)
    sockets = []
    for _ in range(IDLE):
        connection = socket.create_connection((address, 5760))
        peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        peer.connect((address, 14550))
        for _ in range(3):
            peer.send(stock.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(beats))
            time.sleep(0.01)
        sockets += [connection, peer]
    return sockets


def acknowledge(link: Any) -> float:
    """Send a command, again each second; s until its acknowledgement. Raises `TimeoutError` after 10 s.

    The gateway drops what arrives while its host stalls, which happens on a busy machine.
    """
    began = time.monotonic()
    for confirmation in range(10):
        link.mav.command_long_send(
            *(1, 1, stock.MAV_CMD_REQUEST_MESSAGE, confirmation, stock.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
            *(0, 0, 0, 0, 0, 0),
        )
        if link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1.0) is not None:
            return time.monotonic() - began
    raise TimeoutError


def join(url: str, system: int) -> float | None:
    """Join an endpoint as a station; s until its first command is answered, None when it is locked out."""
    began = time.monotonic()
    try:
        link: Any = mavutil.mavlink_connection(url, source_system=system, source_component=190)
        if url.startswith("udpout"):
            for _ in range(3):
                link.mav.heartbeat_send(6, 8, 0, 0, 0)
                time.sleep(0.05)
        link.recv_match(type="HEARTBEAT", blocking=True, timeout=10.0)
        acknowledge(link)
    except OSError:
        return None
    link.close()
    return time.monotonic() - began


def round_trips(client: Client, seconds: float) -> list[float]:
    """Commands every `EVERY` s."""
    found, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        found.append(acknowledge(client.link))
        client.drain()
        time.sleep(max(EVERY - found[-1], 0.0))
    return found


def say(title: str, values: list[float]) -> None:
    milliseconds = [1000.0 * quantile(values, share) for share in (0.5, 0.99, 1.0)]
    print("{}: {} commands, p50 {:.1f} ms, p99 {:.1f} ms, largest {:.1f} ms".format(title, len(values), *milliseconds))


def main() -> int:
    if sys.argv[1:2] == ["flood"]:
        flood(sys.argv[2], float(sys.argv[3]), float(sys.argv[4]))
        return 0
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    rate = float(sys.argv[2]) if len(sys.argv) > 2 else 2000.0
    drone, address = loopback(), loopback()
    tcp, udp = f"tcpin://{address}:5760?flavour=ardupilot", f"udpin://{address}:14550"
    endpoints = ("--endpoint", tcp, "--endpoint", udp)
    print(machine())
    is_good = True
    with (
        product("sim", "--address", drone, "--http-port", "0"),
        product("run", "--drone", drone, *endpoints) as gateway,
    ):
        places = idle(address)
        time.sleep(SILENT)
        for scheme, url in (("tcpin", f"tcp:{address}:5760"), ("udpin", f"udpout:{address}:14550")):
            times = [join(url, 20 + number) for number in range(STATIONS)]
            served = [one for one in times if one is not None]
            is_good = is_good and len(served) == STATIONS
            longest = f"{1000.0 * max(served):.0f} ms" if served else "-"
            print(f"{IDLE} idle clients of {scheme}: {len(served)} of {STATIONS} stations served, longest {longest}")
        for place in places:
            place.close()
        client = Client(f"tcp:{address}:5760")
        say("before the flood", round_trips(client, seconds / 4))
        words = [sys.executable, str(Path(__file__)), "flood", address, str(seconds + 2.0), str(rate)]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
            time.sleep(1.0)
            before, began = usage(gateway)[0], time.monotonic()
            found = round_trips(client, seconds)
            busy = (usage(gateway)[0] - before) / (time.monotonic() - began)
            result = json.loads(process.communicate()[0])
        say("beside the flood", found)
    share = result["rate"] / rate
    answered = result["answered"] / result["sent"]
    print(f"flood: {result['rate']:.0f} requests/s ({share:.1%} of its rate), {answered:.1%} answered")
    print(f"gateway beside the flood: {busy:.0%} of a core")
    if share < 0.99:
        print("VOID: the flood was too slow")
    return int(not is_good or share < 0.99 or quantile(found, 0.99) >= LIMIT)


if __name__ == "__main__":
    sys.exit(main())

"""How steady the heartbeat is, and how soon a command is answered, while four clients keep the gateway busy.

    .venv/bin/python tests/bench/heartbeat.py [SECONDS]

The drone hovers in Offboard. Each of four clients, at an endpoint of its own, sends a setpoint and a command that is
not supported 50 times a second; only the first one's setpoints fly. Once a second a person at the first one's endpoint
sends a burst of random and damaged frames besides. Clients, gateway and simulator are three processes. A gap is that
between two heartbeats of the vehicle as a client reads them, a delay that from a client's send to its COMMAND_ACK.

A machine that lets this script wait shows in both. The script knows when it went on too late, and says so: the figures
come once more without the gaps and delays into which that fell.
"""

from __future__ import annotations

import itertools
import math
import random
import select
import sys
import time
from collections.abc import Collection
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from common import Client, loopback, machine, product, quantile

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.fuzz import LONGEST, random_frames

CLIENTS, EVERY = 4, 0.02
BURST, DATAGRAM = 500, 20
"""Frames a second that make no sense, and in one datagram, which stays below 1500 bytes on the average."""

NOBODYS, IDS = 50_000, 1000
"""A range of command numbers that MAVLink does not use: each answer differs from the next one's."""

LATE = 0.02
"""s from which this script has gone on too late: a turn of its own."""

LEVEL = [1.0, 0.0, 0.0, 0.0]

Span = tuple[float, float]
"""From when to when, s of the monotonic clock."""


@dataclass
class Heard:
    """What one client has heard."""

    beats: list[float] = field(default_factory=list)
    waiting: dict[int, float] = field(default_factory=dict)
    """Commands that are not answered yet, and when they were sent."""
    answers: list[Span] = field(default_factory=list)

    @property
    def gaps(self) -> list[Span]:
        return list(itertools.pairwise(self.beats))


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    drone, addresses = loopback(), [loopback() for _ in range(CLIENTS)]
    endpoints = [word for address in addresses for word in ("--endpoint", f"udpout://{address}:14550")]
    print(machine(), flush=True)
    with ExitStack() as stack:
        stack.enter_context(product("sim", "--address", drone, "--http-port", "0"))
        stack.enter_context(product("run", "--drone", drone, *endpoints))
        clients = [Client(f"udpin:{address}:14550", 254 - number) for number, address in enumerate(addresses)]
        clients[0].take_off(10.0)
        heard, still = _storm(clients, seconds)
    gaps = [span for one in heard for span in one.gaps]
    answers = [span for one in heard for span in one.answers]
    asked = len(answers) + sum(len(one.waiting) for one in heard)
    longest = max((end - begin for begin, end in still), default=0.0)
    print(
        f"this script went on too late by more than {1000 * LATE:.0f} ms {len(still)} times, by {longest:.3f} s at most"
    )
    print(f"{len(answers)} of {asked} commands answered")
    _say("heartbeat to heartbeat", gaps, still)
    _say("unsupported command -> COMMAND_ACK", answers, still)


def _storm(clients: list[Client], seconds: float) -> tuple[list[Heard], list[Span]]:
    """What each client heard, and when this script was late."""
    heard = [Heard() for _ in clients]
    still: list[Span] = []
    frames = random_frames(random.Random("anafi heartbeat"))
    due = time.monotonic()
    for turn in range(round(seconds / EVERY)):
        id = NOBODYS + turn % IDS
        for client, one in zip(clients, heard, strict=True):
            client.link.mav.set_attitude_target_send(0, 1, 1, 0b111, LEVEL, 0, 0, 0, 0.5)
            one.waiting[id] = time.monotonic()
            client.link.mav.command_long_send(1, 1, id, 0, *[math.nan] * 7)
        if turn == 10:
            clients[0].link.mav.command_long_send(1, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0)  # PX4's Offboard
        if turn % round(1 / EVERY) == 0:
            for _ in range(BURST // DATAGRAM):
                clients[0].link.write(b"".join(itertools.islice(frames, DATAGRAM)) + bytes(LONGEST))
        due += EVERY
        _listen(clients, heard, due)
        if (now := time.monotonic()) > due + LATE:
            still.append((due, now))
            due = now  # clients that stood still do not make up for it
    _listen(clients, heard, due + 1.0)
    return heard, still


def _listen(clients: list[Client], heard: list[Heard], until: float) -> None:
    """Read what comes."""
    sockets = {client.link.port: (client, one) for client, one in zip(clients, heard, strict=True)}
    while (left := until - time.monotonic()) > 0:
        for socket in select.select(list(sockets), [], [], left)[0]:
            client, one = sockets[socket]
            while (message := client.link.recv_match(blocking=False)) is not None:
                now, kind = time.monotonic(), message.get_type()
                if kind == "HEARTBEAT" and message.get_srcComponent() == 1:
                    one.beats.append(now)
                elif kind == "COMMAND_ACK" and message.command in one.waiting:
                    one.answers.append((one.waiting.pop(message.command), now))


def _say(what: str, spans: list[Span], still: list[Span]) -> None:
    _figures(what, spans)
    apart = [span for span in spans if not any(begin < span[1] and end > span[0] for begin, end in still)]
    if len(apart) < len(spans):
        _figures(f"{what}, without {len(spans) - len(apart)} in which this script was late", apart)


def _figures(what: str, spans: Collection[Span]) -> None:
    if not spans:
        print(f"{what}: none")
        return
    times = [1000 * (end - begin) for begin, end in spans]
    p50, p99 = (quantile(times, share) for share in (0.5, 0.99))
    print(f"{what}: p50 {p50:.1f} ms, p99 {p99:.1f} ms, largest {max(times):.1f} ms ({len(times)})")


if __name__ == "__main__":
    main()

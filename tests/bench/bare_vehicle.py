"""The least that a Python process does for an upload: a vehicle that answers each item with bytes made beforehand.

    bare_vehicle.py HOST PORT ITEMS asyncio|blocking

It looks at message ids alone: no checksum, no items, no plan. What it takes is the floor of the one-at-a-time mission
protocol in Python, over asyncio's own datagram transport or over a blocking socket without any event loop.
"""

from __future__ import annotations

import asyncio
import socket
import sys
import threading
from typing import Any

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import frame, pack

COUNT, ITEM = dialect.MAVLINK_MSG_ID_MISSION_COUNT, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT


class Answers:
    """What to send for a datagram that holds one frame."""

    def __init__(self, items: int) -> None:
        request, ack = dialect.MAVLink_mission_request_int_message, dialect.MAVLink_mission_ack_message
        self._frames = [frame(pack(request(245, 190, seq, 0)), seq & 0xFF, 1, 1) for seq in range(items)]
        self._frames.append(frame(pack(ack(245, 190, dialect.MAV_MISSION_ACCEPTED, 0)), items & 0xFF, 1, 1))
        self._next = 0

    def to(self, data: bytes) -> bytes | None:
        id = data[7]
        if id == COUNT:
            self._next = 0
        elif id == ITEM:
            self._next += 1
        else:
            return None
        return self._frames[self._next]


def heartbeat() -> bytes:
    """That of a quadrotor with PX4, as MAVSDK's client needs it to see an autopilot."""
    message = dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_PX4, dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 0, 3, 3
    )
    return frame(pack(message), 0, 1, 1)


class Datagrams(asyncio.DatagramProtocol):
    """The asyncio one."""

    def __init__(self, answers: Answers) -> None:
        self._answers = answers
        self._transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport
        self._beat()

    def datagram_received(self, data: bytes, addr: Any) -> None:
        if (answer := self._answers.to(data)) is not None:
            self._transport.sendto(answer)

    def _beat(self) -> None:
        self._transport.sendto(heartbeat())
        asyncio.get_running_loop().call_later(0.5, self._beat)


async def over_asyncio(address: tuple[str, int], answers: Answers) -> None:
    await asyncio.get_running_loop().create_datagram_endpoint(lambda: Datagrams(answers), remote_addr=address)
    await asyncio.Event().wait()


def over_socket(address: tuple[str, int], answers: Answers) -> None:
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.connect(address)

    def beat() -> None:
        while not stop.wait(0.5):
            line.send(heartbeat())

    stop = threading.Event()
    threading.Thread(target=beat, daemon=True).start()
    while True:
        try:
            data = line.recv(2048)
        except ConnectionRefusedError:  # no one listens yet
            continue
        if (answer := answers.to(data)) is not None:
            line.send(answer)


def main() -> None:
    host, port, items, kind = sys.argv[1:]
    # asyncio reads into 256 KiB, which in a fresh process glibc maps and unmaps for each datagram: 20 us. It stops that
    # when something larger has been freed, as in any program that has imported a few modules.
    _ = bytearray(4 << 20)
    del _
    address = (host, int(port))
    if kind == "asyncio":
        asyncio.run(over_asyncio(address, Answers(int(items))))
    else:
        over_socket(address, Answers(int(items)))


if __name__ == "__main__":
    main()

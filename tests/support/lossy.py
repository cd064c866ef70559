"""A bad radio link between MAVLink clients and the gateway: of the frames in either direction some are lost."""

from __future__ import annotations

import asyncio
import random
import socket
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

Address = tuple[str, int]

MAX_DATAGRAM = 65536
"""bytes: any fits."""

_TRANSFER = {
    dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST, dialect.MAVLINK_MSG_ID_MISSION_COUNT,
    dialect.MAVLINK_MSG_ID_MISSION_REQUEST, dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    dialect.MAVLINK_MSG_ID_MISSION_ITEM, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT,
    dialect.MAVLINK_MSG_ID_MISSION_ACK,
}  # fmt: skip


class LossyLink:
    """UDP to UDP: each client that sends to `address` has a way of its own to the gateway.

    Of the messages of a mission transfer it depends on the seed, the direction, the content, and how often the same has
    been said before, whether one is lost: not on what else is on the air meanwhile, nor on the machine's speed. So a
    transfer goes the same way each time. Of all others it depends on the seed and on their order.
    """

    def __init__(self, gateway: Address, loss: float, seed: int) -> None:
        self.loss = loss
        """Share of the frames."""
        self.frames: Counter[str] = Counter()
        """By "up" and "down", and of transfers alone by "up mission" and "down mission"."""
        self.lost: Counter[str] = Counter()
        self._gateway, self._seed, self._random = gateway, seed, random.Random(seed)
        self._said: Counter[bytes] = Counter()
        self._ways: dict[Address, socket.socket] = {}
        self._door = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._door.bind((gateway[0], 0))
        self._listen(self._door, self._up)
        self.address: Address = self._door.getsockname()

    @staticmethod
    def _listen(end: socket.socket, hear: Callable[..., None], *arguments: Any) -> None:
        end.setblocking(False)
        asyncio.get_running_loop().add_reader(end, hear, *arguments)

    def close(self) -> None:
        for end in (self._door, *self._ways.values()):
            asyncio.get_running_loop().remove_reader(end)
            end.close()

    def _up(self) -> None:
        data, client = self._door.recvfrom(MAX_DATAGRAM)
        if client not in self._ways:
            way = self._ways[client] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            way.connect(self._gateway)
            self._listen(way, self._down, way, client)
        if left := self._left(data, "up"):
            self._ways[client].send(left)

    def _down(self, way: socket.socket, client: Address) -> None:
        if left := self._left(way.recv(MAX_DATAGRAM), "down"):
            self._door.sendto(left, client)

    def _left(self, datagram: bytes, way: str) -> bytes:
        """What is left of a datagram of MAVLink 2 frames."""
        left, position = b"", 0
        while position < len(datagram):
            assert datagram[position] == 0xFD, datagram[position:]
            size = 12 + datagram[position + 1] + (13 if datagram[position + 2] & 1 else 0)
            frame = datagram[position : position + size]
            position += size
            if not self._is_lost(frame, way):
                left += frame
        return left

    def _is_lost(self, frame: bytes, way: str) -> bool:
        kind = int.from_bytes(frame[7:10], "little")
        words = [way]
        if kind in _TRANSFER:
            words.append(f"{way} mission")
            said = way.encode() + frame[5:-2]  # sender, message and content
            self._said[said] += 1
            chance = random.Random(f"{self._seed} {self._said[said]} {said.hex()}").random()
        else:
            chance = self._random.random()
        lost = chance < self.loss
        for word in words:
            self.frames[word] += 1
            self.lost[word] += lost
        return lost

    def check(self, least: int) -> None:
        """As much was lost as was asked for, each way, of no fewer than so many messages of transfers."""
        for way in ("up", "down"):
            number, share = self.frames[f"{way} mission"], self.lost[f"{way} mission"] / self.frames[f"{way} mission"]
            deviation = (self.loss * (1.0 - self.loss) / number) ** 0.5
            assert number >= least, (way, number)
            assert abs(share - self.loss) < 5.0 * deviation, (way, number, share)


@asynccontextmanager
async def lossy_link(gateway: Address, loss: float, seed: int = 1) -> AsyncIterator[LossyLink]:
    """A port of the gateway's host with a bad link behind it."""
    link = LossyLink(gateway, loss, seed)
    try:
        yield link
    finally:
        link.close()

"""Senders of many messages on a slow line: its share is one for all of them."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, cast

import pytest

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.address_proof import AddressProof
from anafi_mav.mavlink.channel import Channel
from anafi_mav.services.paced_sender import SHARE, PacedSender
from anafi_mav.services.service import Host

RATE = 5760.0
"""Bytes in a second of 57600 baud: a start and a stop bit for each."""

NUMBER = 20

FRAME = 254 + 12
"""Bytes of a FILE_TRANSFER_PROTOCOL: three of its header, 251 of its payload, 12 around them."""


class Component:
    """The part of a host that a sender needs."""

    def __init__(self, compid: int) -> None:
        self.compid = compid

    def send(self, message: dialect.MAVLink_message, channel: Channel) -> None:
        channel.send(message, 1, self.compid)

    def spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        return asyncio.get_running_loop().create_task(work)


@pytest.mark.parametrize("components", [(1,), (1, 100), (1, 100, 154)])
async def test_slow_line_share_is_divided_among_senders(components: tuple[int, ...]) -> None:
    clock = asyncio.get_running_loop().time
    left: list[tuple[float, int, int]] = []
    done = asyncio.Event()

    def write(data: bytes) -> None:
        left.append((clock(), data[6], len(data)))
        if len(left) == NUMBER * len(components):
            done.set()

    channel = Channel("line", write, bytes_per_second=RATE)
    message = dialect.MAVLink_file_transfer_protocol_message(0, 255, 190, bytes([1]) * 251)
    senders = [PacedSender(cast(Host, Component(compid))) for compid in components]
    for sender in senders:
        sender.start(channel, "burst", iter([message] * NUMBER), 12_000.0)
    await done.wait()
    assert {size for _, _, size in left} == {FRAME}
    expected = FRAME * (len(left) - 1) / (SHARE * RATE)
    assert left[-1][0] - left[0][0] == pytest.approx(expected, rel=0.1)
    # In turn.
    assert [compid for _, compid, _ in left] == list(components) * NUMBER
    for sender in senders:
        sender.clear()


class Watched(Channel):
    """A channel that counts how often it is asked whether it is ready."""

    looks = 0

    @property
    def ready(self) -> bool:
        self.looks += 1
        return super().ready


@pytest.mark.parametrize("rate", [None, RATE])
async def test_list_waits_for_the_proof_without_polling(rate: float | None) -> None:
    written: list[bytes] = []
    channel = Watched("from 192.0.2.7", written.append, datagrams=True, bytes_per_second=rate)
    channel.proof = AddressProof()
    sender = PacedSender(cast(Host, Component(1)))
    sender.start(channel, "list", iter([dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)] * NUMBER))
    await asyncio.sleep(10.0)
    assert (channel.looks, written) == (0, [])
    channel.prove()
    await asyncio.sleep(2.0)
    assert len(written) == NUMBER
    assert not channel.when_proved


async def test_closed_channel_without_proof_leaves_no_waiting_list() -> None:
    channel = Channel("from 192.0.2.7", lambda data: None, datagrams=True)
    channel.proof = AddressProof()
    sender = PacedSender(cast(Host, Component(1)))
    sender.start(channel, "list", iter([]))
    await asyncio.sleep(0.1)
    sender.closed(channel)
    await asyncio.sleep(0.1)
    assert not channel.when_proved

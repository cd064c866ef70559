"""Our address as a peer sees it, for the URIs that a client can open; and when frames leave."""

from __future__ import annotations

import asyncio

import pytest

from anafi_mav.mavlink.base import Outbox, routed_host, seen_host


@pytest.mark.parametrize(
    ("own", "peer", "host"),
    [
        (("192.168.1.5", 14550), ("192.168.1.9", 40000), "192.168.1.5"),
        (("127.0.0.1", 5760), ("127.0.0.1", 40000), "127.0.0.1"),
        (("127.0.7.1", 5760), ("127.0.0.1", 40000), "127.0.7.1"),
        (("192.168.1.5", 14550), ("192.168.1.5", 40000), "127.0.0.1"),
        (("::1", 5760, 0, 0), ("::1", 40000, 0, 0), "::1"),
        (("fe80::1%eth0", 5760, 0, 2), ("fe80::9%eth0", 40000, 0, 2), "fe80::1"),
        (None, None, None),
        ("", "/dev/ttyUSB0", None),
    ],
)
def test_own_address_is_that_of_the_peers_link(own: object, peer: object, host: str | None) -> None:
    assert seen_host(own, peer) == host


def test_route_to_a_peer_names_our_address() -> None:
    assert routed_host(("127.0.0.1", 40000)) == "127.0.0.1"
    assert routed_host(("nonsense", 40000)) is None


async def test_frames_leave_together_once_in_a_pause() -> None:
    loop = asyncio.get_running_loop()
    lots: list[tuple[float, bytes]] = []
    outbox = Outbox(lambda data: lots.append((loop.time(), data)), 10, pause=0.005)
    outbox.add(b"a")
    outbox.add(b"b")
    await asyncio.sleep(0.001)
    outbox.add(b"c")
    await asyncio.sleep(0.001)
    outbox.add(b"d")
    assert [data for _, data in lots] == [b"ab"]
    await asyncio.sleep(0.02)
    assert [data for _, data in lots] == [b"ab", b"cd"]
    assert lots[1][0] - lots[0][0] == pytest.approx(0.005, abs=0.001)
    outbox.add(b"e")  # long after the last lot
    await asyncio.sleep(0)
    assert [data for _, data in lots] == [b"ab", b"cd", b"e"]


async def test_frames_of_a_batch_fill_lots_and_leave_alone_without_a_limit() -> None:
    lots: list[bytes] = []
    outbox = Outbox(lots.append, 4)
    outbox.add_all([b"aa", b"bb", b"cc", b"dd", b"ee"])
    assert lots == [b"aabb", b"ccdd"]
    await asyncio.sleep(0)
    assert lots == [b"aabb", b"ccdd", b"ee"]
    Outbox(lots.append, 0).add_all([b"ff", b"gg"])
    assert lots[3:] == [b"ff", b"gg"]


async def test_full_lot_and_answer_leave_within_a_pause() -> None:
    lots: list[bytes] = []
    outbox = Outbox(lots.append, 4, pause=60.0)
    outbox.add(b"aa")
    await asyncio.sleep(0)
    for frame in (b"bb", b"cc", b"dd"):
        outbox.add(frame)
    assert lots == [b"aa", b"bbcc"]
    with outbox:
        outbox.add(b"ee")
    assert lots == [b"aa", b"bbcc", b"ddee"]

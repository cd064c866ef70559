"""Declarations and ends that a `udp` link of the fabric loses: zenoh never repeats them, and the looks find them."""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import NamedTuple

import pytest
import zenoh
from support.fabric import router
from support.poor_link import LossyRelay

from anafi_mav.fabric import zenoh_session
from anafi_mav.fabric.arrivals import Arrival, FabricSample, ReadersChange, SampleQueue, TokenChange
from anafi_mav.fabric.declaration_check import LOOKS_TO_END, AgreedLooks
from anafi_mav.fabric.keys import FabricKeys
from anafi_mav.fabric.settings import session_settings
from anafi_mav.fabric.zenoh_session import ZenohSession
from anafi_mav.mavlink.endpoint import parse_endpoint

KEYS = FabricKeys("anafi")
DOWN = KEYS.down(1)
OURS, THEIRS = KEYS.drone_token(1, f"{1:016x}"), KEYS.drone_token(2, f"{2:016x}")


class Reports:
    """What zenoh's threads report, for the event loop to wait for."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._all: list[Arrival | bytes] = []
        self._more = asyncio.Event()

    def add(self, report: Arrival | bytes) -> bool:
        self._loop.call_soon_threadsafe(self._add, report)
        return True

    def _add(self, report: Arrival | bytes) -> None:
        self._all.append(report)
        self._more.set()

    async def wait(self, report: Arrival | bytes) -> None:
        """Wait for a report; those up to it are not found again."""
        while report not in self._all:
            self._more.clear()
            await asyncio.wait_for(self._more.wait(), 60.0)
        del self._all[: self._all.index(report) + 1]


class Fabric(NamedTuple):
    """A session of ours over a relay, and another program's, at the same router."""

    relay: LossyRelay
    ours: ZenohSession
    queue: SampleQueue
    reports: Reports
    theirs: zenoh.Session


@pytest.fixture(autouse=True)
def frequent_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_session, "CHECK_FIRST", 0.1)
    monkeypatch.setattr(zenoh_session, "CHECK_EVERY", 0.1)


@asynccontextmanager
async def fabric() -> AsyncIterator[Fabric]:
    async with router(also="udp") as node:
        relay = LossyRelay(node.other, loss=0.0, delay=0.0)
        url = parse_endpoint(f"zenoh://127.0.0.1:{await relay.start()}?link=udp")
        reports = Reports()
        queue = SampleQueue(8, Counter())
        config = zenoh.Config()
        for key, value in session_settings(parse_endpoint(node.url)).items():
            config.insert_json5(key, json.dumps(value))
        ours = ZenohSession(session_settings(url), queue, reports.add, retries=True, is_lossy=True)
        ours.start()
        theirs = await asyncio.to_thread(zenoh.open, config)
        try:
            yield Fabric(relay, ours, queue, reports, theirs)
        finally:
            ours.stop()
            await asyncio.to_thread(ours.ended.wait, 10.0)
            await asyncio.to_thread(theirs.close)  # type: ignore[arg-type]
            await relay.close()


async def test_lost_ends_of_tokens_are_found() -> None:
    """Of another program's: it is reported. Of our own: another session ends it."""
    async with fabric() as (relay, ours, _, reports, theirs):
        seen = Reports()

        def see(sample: zenoh.Sample) -> None:
            seen.add(TokenChange(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))

        await asyncio.to_thread(lambda: theirs.liveliness().declare_subscriber(OURS, see))
        token = await asyncio.to_thread(theirs.liveliness().declare_token, THEIRS)
        ours.watch_tokens(KEYS.drone_token("*", "*"))
        await reports.wait(TokenChange(THEIRS, True))
        relay.is_cut = True
        await asyncio.to_thread(token.undeclare)  # type: ignore[arg-type]
        await asyncio.wait_for(relay.has_cut["down"].wait(), 60.0)
        relay.is_cut = False
        await reports.wait(TokenChange(THEIRS, False))

        ours.declare_token(OURS)
        await seen.wait(TokenChange(OURS, True))
        relay.has_cut["up"].clear()
        relay.is_cut = True
        ours.end(OURS)
        await asyncio.wait_for(relay.has_cut["up"].wait(), 60.0)
        relay.is_cut = False
        await seen.wait(TokenChange(OURS, False))


async def test_declarations_that_a_session_in_use_loses_are_made_beside_it() -> None:
    """Its other token does not end meanwhile, and that which was lost ends with `end`."""
    async with fabric() as (relay, ours, _, reports, theirs):
        seen, second, up = Reports(), KEYS.drone_token(3, f"{1:016x}"), KEYS.up(1, f"{2:016x}-1")
        changes: list[TokenChange] = []

        def see(sample: zenoh.Sample) -> None:
            changes.append(TokenChange(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))
            seen.add(changes[-1])

        async def use() -> None:
            while True:
                ours.note_heard(is_in_use=True)
                await asyncio.to_thread(theirs.put, up, b"frames")
                await asyncio.sleep(0.02)

        # With history: the router may hear of our token first.
        tokens = KEYS.drone_token("*", "*")
        await asyncio.to_thread(lambda: theirs.liveliness().declare_subscriber(tokens, see, history=True))
        ours.declare_token(OURS)
        await seen.wait(TokenChange(OURS, True))
        using = asyncio.create_task(use())
        try:
            relay.lose_next = second.encode()
            ours.declare_token(second)
            await seen.wait(TokenChange(second, True))
            relay.lose_next = b"anafi/1/up"
            ours.subscribe(KEYS.up(1, "**"))
            await reports.wait(FabricSample(up, b"frames", b""))
            assert relay.lost == 2
            ours.end(second)
            await seen.wait(TokenChange(second, False))
        finally:
            using.cancel()
        assert changes == [TokenChange(OURS, True), TokenChange(second, True), TokenChange(second, False)]


async def test_reader_is_found_and_served_when_a_declaration_of_its_key_is_lost() -> None:
    async with fabric() as (relay, ours, queue, reports, theirs):
        relay.lose_next = DOWN.encode()
        ours.publish_on(DOWN)
        received = Reports()

        def receive(sample: zenoh.Sample) -> None:
            received.add(sample.payload.to_bytes())

        reader = await asyncio.to_thread(lambda: theirs.declare_subscriber(KEYS.down("*"), receive))
        await reports.wait(ReadersChange(DOWN, True))
        assert relay.lost == 1
        queue.add_sample(FabricSample(DOWN, b"frames", b""), is_urgent=False)
        await received.wait(b"frames")
        await asyncio.to_thread(reader.undeclare)  # type: ignore[arg-type]
        await reports.wait(ReadersChange(DOWN, False))


def test_end_is_agreed_on_by_looks_in_turn() -> None:
    assert LOOKS_TO_END == 2
    looks = AgreedLooks()
    assert looks.add({"a", "b"}) == set()
    assert looks.add({"b"}) == {"b"}
    assert looks.add({"a", "b"}) == set()
    assert looks.add({"a"}) == {"a"}

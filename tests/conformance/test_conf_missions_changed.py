"""Conformance items 66 and 74: missions that are refused, and others that are uploaded while one is flown.

What is flown is taken from the simulator's own log.
"""

from __future__ import annotations

from typing import Any

import pytest
from support.flavours import both
from support.mav import Client
from support.missions import first, takeoff, way
from support.plans import MISSION, REQUESTS, UNSUPPORTED, Item, download, send_count, send_item, upload
from support.world import HOME, World, world

INVALID = 5

SERVO = [takeoff(6.0), way(10.0, 0.0, 6.0), Item(183, 0.0, 0.0, p1=1.0, p2=1500.0, frame=2)]
NOTHING = [Item(178, 0.0, 0.0, p1=1.0, p2=4.0, p3=-1.0, frame=2), Item(189, 0.0, 0.0, frame=2)]
"""No item of it flies."""

ROUND_AND_ROUND = [takeoff(6.0), Item(178, 0.0, 0.0, p1=1.0, p2=4.0, p3=-1.0, frame=2)]
"""Nothing of what a jump back to its last item repeats flies."""


class AckLost(Client):
    """A client that does not get its first MISSION_ACK."""

    lost: Any = None

    def feed(self, data: bytes) -> None:
        before = self.mark()
        super().feed(data)
        for place in range(before, self.mark()):
            if self.lost is None and self.received[place][1].get_type() == "MISSION_ACK":
                self.lost = self.received.pop(place)[1]
                return


async def without_its_ack(w: World, items: list[Item]) -> tuple[AckLost, list[Item]]:
    """Another client has uploaded a mission, and its acknowledgement is lost; what it listed."""
    client = AckLost(254, 190)
    await client.connect(5760, w.address)
    w.clients.append(client)
    listed = [Item(16, *HOME), *items] if first(w) else items
    mark = send_count(client, len(listed), MISSION)
    for seq, item in enumerate(listed):
        await client.wait(REQUESTS, lambda m, seq=seq: m.seq == seq, since=mark)  # type: ignore[misc]
        send_item(client, item, seq, MISSION)
    return client, listed


@both
@pytest.mark.parametrize("often", [-1.0, 60000.0])
async def test_conf_066_a_loop_in_which_nothing_is_flown_is_refused_at_upload(flavour: str, often: float) -> None:
    async with world(flavour=flavour) as w:
        jump = Item(177, 0.0, 0.0, p1=1.0 + first(w), p2=often, frame=2)
        listed = [*([Item(16, *HOME)] if first(w) else []), *ROUND_AND_ROUND, jump]
        assert (await upload(w.client, listed, MISSION)).type == INVALID
        how = "for ever" if often < 0.0 else "and round"
        words = f"Mission refused: item {2 + first(w)}: it goes round {how} and flies nowhere"
        await w.client.wait("STATUSTEXT", lambda m: m.text == words[:50], since=0)
        assert len(await download(w.client, MISSION)) == 0


@both
@pytest.mark.parametrize(("items", "result"), [(SERVO, UNSUPPORTED), (NOTHING, INVALID)], ids=["item", "plan"])
async def test_conf_066_a_refusal_that_was_lost_is_heard_when_the_last_item_comes_again(
    flavour: str, items: list[Item], result: int
) -> None:
    """As MAVSDK does after half a second: the same result, and one text in all."""
    async with world(flavour=flavour) as w:
        client, listed = await without_its_ack(w, items)
        await client.wait("STATUSTEXT", lambda m: m.text.startswith("Mission refused: item"), since=0)
        for _ in range(3):
            mark = client.mark()
            send_item(client, listed[-1], len(listed) - 1, MISSION)
            assert (await client.wait("MISSION_ACK", since=mark)).type == result
        assert client.lost.type == result
        await client.heartbeat(lambda beat: True, since=client.mark())
        texts = [m.text for _, m in client.since(0, "STATUSTEXT") if "refused" in m.text]
        assert len(texts) == 1, texts

"""A ground station that counts as MAVSDK does when it uploads, for `plan_wire.Wire`.

From MAVSDK's mavlink_mission_transfer_client (158e33932): it counts how often it has sent an item, and each half second
in which nothing was requested. A request beyond five, or a half second beyond five, ends the upload. Only a request of
exactly the item after the one that it has sent last lets it count again; an earlier item is sent again and is from then
on the last that was sent; a later one is not answered. An acknowledgement is good only when the last item that was sent
is the last of all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from anafi_mav.mavlink import dialect
from anafi_mav.services.plan.item_messages import item_int
from anafi_mav.services.plan.plan_transfer import Peer
from anafi_mav.vehicle.fence.plan_items import PlanItem
from support.plan_wire import FENCE

LIMIT, TIMEOUT = 5, 0.5


@dataclass
class CountingClient:
    peer: Peer
    plan: tuple[PlanItem, ...]
    kind: int = FENCE
    limit: int = LIMIT
    why: str = ""
    """How it failed."""
    result: int | None = None
    done: bool = False
    highest: int = 0
    """Of its count."""
    _begun: bool = False
    _next: int = 0
    _count: int = 0
    _due: float = 0.0

    def upload(self, now: float) -> list[Any]:
        self._count, self._due = 1, now + TIMEOUT
        return [dialect.MAVLink_mission_count_message(1, 1, len(self.plan), self.kind)]

    def _fail(self, why: str) -> list[Any]:
        self.why, self.done = why, True
        return []

    def receive(self, message: Any, now: float) -> list[Any]:
        if self.done:
            return []
        if message.get_type() == "MISSION_ACK":
            if message.type == 0 and self._next != len(self.plan):
                return self._fail("an acknowledgement too early")
            self.result, self.done = message.type, True
            return []
        assert message.get_type() == "MISSION_REQUEST_INT"
        seq, self._begun = message.seq, True
        if seq > self._next:
            return []
        if seq < self._next and self._count >= self.limit:
            return self._fail(f"item {seq} requested too often")
        if seq == self._next:
            self._count = 0
        self._due, self._next = now + TIMEOUT, seq + 1
        self._count += 1
        self.highest = max(self.highest, self._count)
        return [item_int(self.plan[seq], seq, 1, 1, self.kind)]

    def deadline(self) -> float:
        return 1e9 if self.done else self._due

    def expire(self, now: float) -> list[Any]:
        if self.done or now < self._due:
            return []
        if self._count >= self.limit:
            if self._next == len(self.plan):
                return self._fail("no acknowledgement")
            return self._fail(f"silence after item {self._next - 1}" if self._begun else "no first request")
        if not self._begun:
            return self.upload_again(now)
        self._count += 1
        self._due = now + TIMEOUT
        return []

    def upload_again(self, now: float) -> list[Any]:
        self._count, self._due = self._count + 1, now + TIMEOUT
        return [dialect.MAVLink_mission_count_message(1, 1, len(self.plan), self.kind)]

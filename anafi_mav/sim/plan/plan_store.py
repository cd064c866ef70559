"""Flight plans uploaded to a drone: written by the web server, read by the flight plan task."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

MAX_PLANS = 100
"""Plans kept; the oldest goes when another comes, so that a client that uploads for ever fills no memory."""


@dataclass(frozen=True)
class StoredPlan:
    uid: str
    """Name in `common.Mavlink.Start`."""
    date: str
    """ISO 8601 basic, as the drone's clock had it when the plan came."""
    data: bytes
    """The file as it was uploaded."""


class FlightPlanStore:
    """Plans by uid, oldest first."""

    def __init__(self) -> None:
        self.refuses: Callable[[], bool] = lambda: False
        """True while the firmware takes no file."""
        self._plans: dict[str, StoredPlan] = {}
        self._count = 0

    def put(self, data: bytes, date: str = "") -> str:
        """Keep a file; its uid, a new one for each upload even of the same bytes."""
        self._count += 1
        uid = hashlib.md5(b"%d " % self._count + data, usedforsecurity=False).hexdigest()
        self._plans[uid] = StoredPlan(uid, date, bytes(data))
        if len(self._plans) > MAX_PLANS:
            del self._plans[next(iter(self._plans))]
        return uid

    def clear(self) -> None:
        self._plans.clear()

    def get(self, uid: str) -> bytes | None:
        """The file; None when there is no such plan."""
        plan = self._plans.get(uid)
        return None if plan is None else plan.data

    def find(self, uid: str) -> StoredPlan | None:
        return self._plans.get(uid)

    def list(self) -> Sequence[StoredPlan]:
        return tuple(self._plans.values())

    def remove(self, uid: str) -> bool:
        """False when there was none."""
        return self._plans.pop(uid, None) is not None

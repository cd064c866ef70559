"""Claims of a gateway to system ids on the fabric. No I/O.

Time is passed in.

Each gateway holds its ids by liveliness tokens. It claims an id only when it sees no other token for it. Two that claim
an id at the same moment see each other's token afterwards: the one with the lower session id keeps it.

Tokens end with the link of their gateway, also when a router is restarted. So an id that a gateway was refused must be
free for a while before it is claimed, and it goes back to the gateway that had it before.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from enum import Enum
from typing import NamedTuple

FREE_FOR = 10.0
"""s for which an id must be free before a gateway claims it that was refused it. One whose link was lost, or whose
router was restarted, tries to connect every 2 s."""

SPREAD = 5.0
"""s more, by the session id: two that wait for one id do not claim it at the same moment."""

SIMULTANEOUS = 5.0
"""s after a claim. The token of another gateway that appears within them was claimed at the same moment; a later one is
of a network that was parted, or of a gateway that was away."""

SETTLE = 5.0
"""s that a gateway with an older claim waits for the other one to release the id."""


class ClaimStep(Enum):
    """Step of a gateway about a system id."""

    HOLD = "hold"
    """Declare its token and publish it."""
    KEEP_OFF = "keep off"
    """Another gateway has it: report it. It was not held."""
    CLASH = "clash"
    """Another gateway holds it, too: report it."""
    RELEASE = "release"
    """Another gateway has it: end its token, and report it."""


class ClaimChange(NamedTuple):
    """A step about one system id."""

    step: ClaimStep
    sysid: int
    holder: str = ""
    """Session of the other gateway."""


class SystemClaims:
    """The system ids that one gateway wants."""

    def __init__(self, session: str, wanted: Iterable[int]) -> None:
        self.held: set[int] = set()
        self.refused: dict[int, str] = {}
        """Ids that another gateway has, with its session."""
        self.is_settled = False
        """True when each id has been claimed or refused."""
        self._session = session
        self._patience = FREE_FOR + int(session, 16) % 1000 * SPREAD / 1000.0
        self._wanted = sorted(set(wanted))
        self._others: dict[int, set[str]] = defaultdict(set)
        self._earlier: dict[int, set[str]] = defaultdict(set)
        """Gateways that have had an id while this one was refused it."""
        self._held_since: dict[int, float] = {}
        self._free_since: dict[int, float] = {}
        self._clash_since: dict[int, float] = {}

    @property
    def taken(self) -> set[int]:
        """The ids that another gateway has, whether this one holds them, too, or not."""
        return self.refused.keys() | self._clash_since.keys()

    def token(self, sysid: int, holder: str, *, is_alive: bool) -> None:
        """Note the token of a gateway for an id."""
        if holder == self._session:
            return
        if is_alive:
            self._others[sysid].add(holder)
        else:
            self._others[sysid].discard(holder)

    def decide(self, now: float, *, is_listed: bool, can_claim: Callable[[int], bool]) -> list[ClaimChange]:
        """Return the steps that are due.

        `is_listed`: all tokens that exist are known. `can_claim` returns False for an id whose drone is in flight:
        it is then neither claimed once refused, nor released once held.
        """
        steps = []
        for sysid in self._wanted:
            if sysid in self.held:
                steps += self._of_held(sysid, now, can_claim)
            else:
                steps += self._of_wanted(sysid, now, can_claim, is_listed=is_listed)
        self.is_settled = self.is_settled or is_listed
        return steps

    def _of_held(self, sysid: int, now: float, can_claim: Callable[[int], bool]) -> list[ClaimChange]:
        others = self._others[sysid]
        if not others:
            self._clash_since.pop(sysid, None)
            return []
        begins = sysid not in self._clash_since
        since = self._clash_since.setdefault(sysid, now)
        earlier, lowest = others & self._earlier[sysid], min(others)
        is_decided = since - self._held_since[sysid] <= SIMULTANEOUS or now - since >= SETTLE
        rival = min(earlier) if earlier else lowest if lowest < self._session and is_decided else None
        if rival is None or not can_claim(sysid):
            return [ClaimChange(ClaimStep.CLASH, sysid, lowest)] if begins else []
        self.held.discard(sysid)
        del self._clash_since[sysid]
        self.refused[sysid] = rival
        return [ClaimChange(ClaimStep.RELEASE, sysid, rival)]

    def _of_wanted(
        self, sysid: int, now: float, can_claim: Callable[[int], bool], *, is_listed: bool
    ) -> list[ClaimChange]:
        others = self._others[sysid]
        if others:
            self._free_since.pop(sysid, None)
            self._earlier[sysid] |= others
            if sysid in self.refused:
                return []
            self.refused[sysid] = min(others)
            return [ClaimChange(ClaimStep.KEEP_OFF, sysid, min(others))]
        if not is_listed:
            self._free_since.pop(sysid, None)
            return []
        since = self._free_since.setdefault(sysid, now)
        if sysid in self.refused and (now - since < self._patience or not can_claim(sysid)):
            return []
        del self._free_since[sysid]
        self.refused.pop(sysid, None)
        self.held.add(sysid)
        self._held_since[sysid] = now
        return [ClaimChange(ClaimStep.HOLD, sysid)]

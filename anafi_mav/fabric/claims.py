"""Claims of a gateway to system ids on the fabric. No I/O.

Each gateway holds its ids by liveliness tokens. It claims an id only when it sees no other token for it. Two that claim
an id at the same moment see each other's token afterwards: the one with the lower session id keeps it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from enum import Enum
from typing import NamedTuple


class ClaimStep(Enum):
    """Step of a gateway about a system id."""

    HOLD = "hold"
    """Declare its token and publish it."""
    KEEP_OFF = "keep off"
    """Another gateway has it: report it. It was not held."""
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
        self._wanted = sorted(set(wanted))
        self._others: dict[int, set[str]] = defaultdict(set)

    def token(self, sysid: int, holder: str, *, is_alive: bool) -> None:
        """Note the token of a gateway for an id."""
        if holder == self._session:
            return
        if is_alive:
            self._others[sysid].add(holder)
        else:
            self._others[sysid].discard(holder)

    def decide(self, *, is_listed: bool, can_claim: Callable[[int], bool]) -> list[ClaimChange]:
        """Return the steps that are due.

        `is_listed`: all tokens that exist are known. `can_claim` returns False for an id whose drone is in flight:
        it is then neither claimed once refused, nor released once held.
        """
        steps = []
        for sysid in self._wanted:
            others = self._others[sysid]
            if sysid in self.held:
                if others and min(others) < self._session and can_claim(sysid):
                    self.held.discard(sysid)
                    self.refused[sysid] = min(others)
                    steps.append(ClaimChange(ClaimStep.RELEASE, sysid, min(others)))
            elif others:
                if sysid not in self.refused:
                    self.refused[sysid] = min(others)
                    steps.append(ClaimChange(ClaimStep.KEEP_OFF, sysid, min(others)))
            elif is_listed and (sysid not in self.refused or can_claim(sysid)):
                self.refused.pop(sysid, None)
                self.held.add(sysid)
                steps.append(ClaimChange(ClaimStep.HOLD, sysid))
        self.is_settled = self.is_settled or is_listed
        return steps

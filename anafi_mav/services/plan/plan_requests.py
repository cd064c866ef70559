"""Requests of the receiver of a list of items, and their times. No I/O.

Rules: MAVLink mission.md; conformance A7, C5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

REQUEST_EVERY = 0.2
"""s after which the expected item is requested again. mission.md says 0.25 s at most; MAVSDK counts each half second in
which it hears no request as an attempt, so two repetitions have to fit into it, late ones too. QGroundControl gives up
after 1.5 s without a word."""

MAX_TRIES = 25
"""Requests of one item: five seconds. With a quarter lost each way it fails to come so often in a row once in 10^9."""

PLAIN_TRIES, PLAIN_TRIES_OF_LAST = 2, 5
"""Number of requests of an item that ask for nothing else.

MAVSDK sends an item five times and aborts the upload at the sixth request, but its count restarts at a request of the
very item after the one that it has sent last. So further requests ask for items before the missing one, too
(`AGAIN`), which any client sends again. The last item is requested alone for longer: where a message takes most of a
second there and back, the acknowledgement would reach a client that is at an earlier item again.
"""

AGAIN = ((-2, -1, 0), (-1, 0, 0))
"""Items of further requests, in turns, relative to the missing item.

Of short sequences of items that the client has sent already this is the one with which MAVSDK lasts longest
(tests/bench/lossy_uploads.py). Items that it has not sent yet would do better still, but Mission Planner takes a
request of the next item for the receipt of this one, and MAVProxy leaves after its last.
"""

AGAIN_EVERY = 0.02
"""s between the requests of one repetition, so that they do not overtake each other on their way."""


def asked_for(tries: int, *, is_last: bool) -> Sequence[int]:
    """Return the items to request at this try, relative to the missing item; the first try is 1."""
    plain = PLAIN_TRIES_OF_LAST if is_last else PLAIN_TRIES
    return (0,) if tries <= plain else AGAIN[(tries - plain - 1) % len(AGAIN)]


@dataclass
class Requests:
    """Of one list: item after item from `first` to `last`, each until it has come."""

    first: int
    last: int
    expected: int = field(init=False)
    tries: int = 0
    due: float = 0.0
    """When to call `again`."""
    _wanted: list[int] = field(default_factory=list)
    """Items of this try that are not requested yet."""
    _next_try: float = 0.0

    def __post_init__(self) -> None:
        self.expected = self.first

    @property
    def between_tries(self) -> bool:
        """The next request begins another try."""
        return not self._wanted

    @property
    def in_vain(self) -> bool:
        """All tries to get the expected item are over."""
        return self.between_tries and self.tries >= MAX_TRIES

    def came(self) -> bool:
        """The expected item is here; whether there is another one."""
        if self.expected == self.last:
            return False
        self.expected += 1
        self.tries = 0
        self._wanted.clear()
        return True

    def again(self, now: float) -> int:
        """The number of the item to ask for now.

        Call it at the beginning, when an item has come, and when `due`.
        """
        if not self._wanted:
            self.tries += 1
            steps = (0,) if self.expected == self.first else asked_for(self.tries, is_last=self.expected == self.last)
            self._wanted = [seq for step in steps if (seq := self.expected + step) >= self.first]
            self._next_try = now + REQUEST_EVERY
        seq = self._wanted.pop(0)
        self.due = now + AGAIN_EVERY if self._wanted else self._next_try
        return seq

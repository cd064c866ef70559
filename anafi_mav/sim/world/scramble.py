"""Events of one drone in another legal order, later or twice: the quirk `scramble:<seed>`.

ARSDK promises no order between events of different types, no time, and no single delivery. So each event has one of
four fates: sent at once, late, sent again later, or sent after the next event of another feature. Events of one type
keep their order, and none is sent before its cause. Messages of the unacknowledged buffer are dropped or sent at once.

It acts before the transport numbers the messages, so the frames stay legal. The n-th event of a type has the same fate
in every run with the same seed, whatever other types do meanwhile. No I/O; time is passed in, in simulated seconds.
"""

from __future__ import annotations

import enum
import heapq
import math
import random
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common

LATEST = 1.0
"""s after its time that an event, or its repetition, is sent at the latest."""

DROPPED = 0.2
"""Share of messages of the unacknowledged buffer that is not sent, where the one before was. Never two of a type in a
row: longer gaps are the link's, and a drone whose one GPS location in a second is absent for three has no position."""

MAX_HELD = 2000
"""Events held at a time; a connection needs some 500 states. Beyond that they are sent at once, in their order."""

CAUSES: dict[type[Message], type[Message]] = {
    common.MissionItemExecuted: common.MavlinkFilePlayingStateChanged,
}
"""An event of the first type is about something that an earlier event of the second has begun: never overtakes it."""

ENDS_OF_LISTS = (common.AllStatesChanged, common.AllSettingsChanged)
"""They say that everything before them was sent."""


class Fate(enum.Enum):
    """How an event is sent."""

    AT_ONCE = enum.auto()
    LATE = enum.auto()
    TWICE = enum.auto()
    SWAPPED = enum.auto()
    """After the next event of another feature."""


FATES = {Fate.AT_ONCE: 0.4, Fate.LATE: 0.3, Fate.TWICE: 0.15, Fate.SWAPPED: 0.15}
"""Share of each."""

Send = Callable[[Message], object]


@dataclass(eq=False)
class _Held:
    """An event that is not sent yet."""

    message: Message
    send: Send
    due: float
    earliest: float
    """Time at which everything that must be sent before it is sent."""
    serial: int
    swapped: bool = False
    sent: bool = False


class Scrambler:
    """Holds the events of one drone until each is due."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self._chances: dict[str, random.Random] = {}
        self._lanes: dict[type[Message], deque[_Held]] = {}
        """Held events of each type, oldest first; no one is due before the one in front of it."""
        self._order: list[tuple[float, int, _Held]] = []
        """A heap; an event whose time was changed is in it twice."""
        self._swapped: list[_Held] = []
        self._dropped: set[type[Message]] = set()
        """Types whose newest message was dropped."""
        self._serial = 0
        self.fates: Counter[Fate] = Counter()
        """Events of each fate so far."""

    @property
    def next(self) -> float:
        """Simulated time at which `advance` has something to send; infinite when nothing is held."""
        return self._order[0][0] if self._order else math.inf

    def keeps(self, message: Message) -> bool:
        """Return False when a message of the unacknowledged buffer is dropped."""
        kind = type(message)
        if self._chance(message).random() >= DROPPED or kind in self._dropped:
            self._dropped.discard(kind)
            return True
        self._dropped.add(kind)
        return False

    def add(self, message: Message, send: Send, now: float) -> None:
        """Take an event; `advance` sends it when it is due."""
        if len(self._order) >= MAX_HELD:
            self.flush()
        chance = self._chance(message)
        (fate,) = chance.choices(list(FATES), list(FATES.values()))
        delay = chance.uniform(0.0, LATEST)
        self.fates[fate] += 1
        first = self._hold(message, send, now, now + delay if fate is Fate.LATE else now)
        if fate is Fate.TWICE:
            self._hold(message, send, now, now + delay)
        elif fate is Fate.SWAPPED:
            first.swapped, first.due = True, now + LATEST
            heapq.heappush(self._order, (first.due, first.serial, first))
            self._swapped.append(first)

    def advance(self, now: float) -> None:
        """Send what is due, in the order of its time."""
        while self._order and self._order[0][0] <= now:
            due, _, held = heapq.heappop(self._order)
            if not held.sent and due == held.due:
                self._send(held, now)

    def flush(self) -> None:
        """Send everything that is held now."""
        self.advance(math.inf)

    def _hold(self, message: Message, send: Send, now: float, due: float) -> _Held:
        kind = type(message)
        lane = self._lanes.setdefault(kind, deque())
        before = [lane]
        if kind in CAUSES:
            before.append(self._lanes.get(CAUSES[kind], deque()))
        if kind in ENDS_OF_LISTS:
            before += self._lanes.values()
        earliest = max([now, *(other[-1].due for other in before if other)])
        due = max(due, earliest)
        self._serial += 1
        held = _Held(message, send, due, earliest, self._serial)
        lane.append(held)
        heapq.heappush(self._order, (due, held.serial, held))
        return held

    def _send(self, held: _Held, now: float) -> None:
        lane = self._lanes[type(held.message)]
        assert lane[0] is held
        lane.popleft()
        held.sent = True
        held.send(held.message)
        if held.swapped:
            self._swapped.remove(held)
        feature = _feature(held.message)
        for other in self._swapped[:]:
            if _feature(other.message) != feature and self._lanes[type(other.message)][0] is other:
                self._swapped.remove(other)
                other.swapped, other.due = False, min(other.due, max(now, other.earliest))
                heapq.heappush(self._order, (other.due, other.serial, other))

    def _chance(self, message: Message) -> random.Random:
        name = message.NAME
        if name not in self._chances:
            self._chances[name] = random.Random(f"{self.seed} {name}")
        return self._chances[name]


def _feature(message: Message) -> str:
    return message.NAME.partition(".")[0]

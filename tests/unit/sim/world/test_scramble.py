"""The quirk `scramble:SEED`: what it does to events, and what it never does."""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter
from dataclasses import dataclass

import pytest

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.common import PlayingState
from anafi_mav.sim.world.scramble import DROPPED, FATES, LATEST, MAX_HELD, Fate, Scrambler

SEEDS, EVENTS = range(8), 400


@dataclass(frozen=True)
class Report:
    """An event, and when it was emitted and sent (s)."""

    message: Message
    emitted: float
    sent: float


def number(message: Message) -> int:
    """Return the number that `event` has put into an event."""
    return int(float(getattr(message, message.__struct_fields__[0])))


def event(chance: random.Random, number: int) -> Message:
    """Return an event of one of four types of three features, with a number in it."""
    kind = chance.randrange(4)
    if kind == 0:
        return ardrone3.MoveByEnd(float(number), 0.0, 0.0, 0.0, ardrone3.MoveByError.OK)
    if kind == 1:
        return common.FlightId(str(number))
    return common.MissionItemExecuted(number) if kind == 2 else rth.HomeReachability(rth.RthHomeReachability(number))


class Bench:
    """A scrambler with a clock."""

    def __init__(self, seed: int) -> None:
        self.scrambler = Scrambler(seed)
        self.now = 0.0
        self.reports: list[Report] = []
        """In the order of sending."""

    def emit(self, message: Message) -> None:
        emitted = self.now
        self.scrambler.add(message, lambda m: self.reports.append(Report(m, emitted, self.now)), self.now)

    def run(self, seconds: float = math.inf) -> None:
        """Let time pass, or as much of it as there is something to send."""
        end = self.now + seconds
        while self.scrambler.next <= end and self.scrambler.next < math.inf:
            self.now = max(self.now, self.scrambler.next)
            self.scrambler.advance(self.now)
        self.now = max(self.now, end) if end < math.inf else self.now


def scrambled(seed: int) -> list[Report]:
    """Return the reports of a busy minute."""
    chance, bench = random.Random(1), Bench(seed)
    for count in range(EVENTS):
        bench.run(chance.choice([0.0, 0.0, 0.3]))
        bench.emit(event(chance, count))
    bench.run()
    return bench.reports


@pytest.mark.parametrize("seed", SEEDS)
def test_scrambled_types_keep_their_order_within_one_second(seed: int) -> None:
    reports = scrambled(seed)
    for kind in {type(r.message) for r in reports}:
        numbers = [number(r.message) for r in reports if type(r.message) is kind]
        assert numbers == sorted(numbers)
    assert all(0.0 <= r.sent - r.emitted <= LATEST + 1e-9 for r in reports)
    assert Counter(Counter(number(r.message) for r in reports).values()).keys() == {1, 2}
    assert {number(r.message) for r in reports} == set(range(EVENTS)), "none is lost"


def test_scrambled_events_of_different_features_overtake() -> None:
    reports = scrambled(3)
    assert sum(a.emitted > b.emitted for a, b in itertools.pairwise(reports)) > 40


def test_scrambled_events_depend_on_seed_alone() -> None:
    assert scrambled(1) == scrambled(1)
    assert scrambled(1) != scrambled(2)


def test_scrambled_type_is_independent_of_other_types() -> None:
    """A run in which another type has one event more has the same fates in all other types."""

    def late(extra: int) -> list[float]:
        bench = Bench(5)
        for _ in range(extra):
            bench.emit(common.MissionItemExecuted(1))
        bench.run()
        bench.reports.clear()
        for _ in range(100):
            bench.run(10.0)
            bench.emit(common.FlightId("x"))
        bench.run()
        return [round(report.sent - report.emitted, 6) for report in bench.reports]

    assert late(0) == late(7)


def test_scrambled_item_never_overtakes_start_of_its_plan() -> None:
    for seed in range(50):
        scrambler, sent = Scrambler(seed), list[Message]()
        playing = common.MavlinkFilePlayingStateChanged(PlayingState.PLAYING, "x", common.MavlinkType.FLIGHT_PLAN)
        scrambler.add(playing, sent.append, 0.0)
        scrambler.add(common.MissionItemExecuted(0), sent.append, 0.0)
        scrambler.flush()
        assert isinstance(sent[0], common.MavlinkFilePlayingStateChanged)


def test_scrambled_end_of_states_is_last() -> None:
    for seed in range(50):
        scrambler, sent, chance = Scrambler(seed), list[Message](), random.Random(seed)
        for number in range(30):
            scrambler.add(event(chance, number), sent.append, 0.0)
        scrambler.add(common.AllStatesChanged(), sent.append, 0.0)
        while scrambler.next < 10.0:
            scrambler.advance(scrambler.next)
        first = next(i for i, m in enumerate(sent) if isinstance(m, common.AllStatesChanged))
        assert {type(m) for m in sent[first:]} == {common.AllStatesChanged}


def test_unacknowledged_messages_are_dropped_or_kept() -> None:
    scrambler = Scrambler(1)
    message = ardrone3.AltitudeChanged(1.0)
    kept = [scrambler.keeps(message) for _ in range(1000)]
    assert sum(kept) == pytest.approx(1000 / (1.0 + DROPPED), abs=40)
    assert not any(not a and not b for a, b in itertools.pairwise(kept)), "never two in a row"


def test_fates_have_their_shares() -> None:
    scrambler = Scrambler(1)
    for _ in range(1000):
        scrambler.add(ardrone3.FlyingStateChanged(FlyingState.HOVERING), lambda m: None, 0.0)
    assert {fate: scrambler.fates[fate] for fate in Fate} == pytest.approx(
        {fate: 1000 * share for fate, share in FATES.items()}, abs=60
    )


def test_scrambler_holds_a_limited_number_of_events() -> None:
    scrambler, sent = Scrambler(1), list[Message]()
    for number in range(3 * MAX_HELD):
        scrambler.add(common.MissionItemExecuted(number), sent.append, 0.0)
    assert len(sent) >= 2 * MAX_HELD
    scrambler.flush()
    numbers = [m.idx for m in sent if isinstance(m, common.MissionItemExecuted)]
    assert numbers == sorted(numbers)

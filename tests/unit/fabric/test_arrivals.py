"""The queues between zenoh's threads and the event loop: bounds, order, what is dropped and counted."""

from __future__ import annotations

from collections import Counter

from anafi_mav.fabric.arrivals import (
    MAX_CHANGES,
    MAX_SAMPLES,
    MAX_URGENT,
    ArrivalQueue,
    FabricSample,
    SampleQueue,
    TokenChange,
)


def sample(number: int) -> FabricSample:
    return FabricSample("key", b"%d" % number, b"")


def test_arrivals_are_taken_in_their_order_and_wake_once() -> None:
    woken: list[int] = []
    queue = ArrivalQueue(lambda: woken.append(1), Counter())
    arrivals = [TokenChange("a", True), sample(1), TokenChange("a", False), sample(2)]
    for arrival in arrivals:
        queue.put(arrival)
    assert queue.take() == arrivals
    assert queue.take() == []
    assert len(woken) == 1
    queue.put(sample(3))
    assert len(woken) == 2


def test_full_arrival_queue_drops_the_oldest_sample_and_no_token() -> None:
    counters: Counter[str] = Counter()
    queue = ArrivalQueue(lambda: None, counters)
    queue.put(TokenChange("a", True))
    for number in range(MAX_SAMPLES + 2):
        queue.put(sample(number))
    taken = queue.take()
    assert taken[:2] == [TokenChange("a", True), sample(2)]
    assert len(taken) == 1 + MAX_SAMPLES
    assert counters == {"dropped_arrivals": 2}
    queue.put(sample(0))
    assert queue.take() == [sample(0)]


def test_report_without_room_is_refused_and_counted() -> None:
    counters: Counter[str] = Counter()
    queue = ArrivalQueue(lambda: None, counters)
    assert all(queue.put(TokenChange("a", True)) for _ in range(MAX_CHANGES))
    assert not queue.put(TokenChange("b", True))
    assert counters == {"dropped_arrivals": 1}
    assert queue.put(sample(1))


def test_full_sample_queue_drops_the_oldest_and_counts_it() -> None:
    counters: Counter[str] = Counter()
    queue = SampleQueue(2, counters)
    for number in (1, 22, 333):
        queue.add_sample(sample(number))
    assert [queue.next(0.0), queue.next(0.0), queue.next(0.0)] == [sample(22), sample(333), None]
    assert counters == {"dropped_samples": 1, "dropped_sample_bytes": 1}


def test_work_comes_before_samples_and_is_kept() -> None:
    counters: Counter[str] = Counter()
    queue, work = SampleQueue(2, counters), lambda session: None
    queue.add_sample(sample(1))
    queue.add_work(work)
    queue.clear_samples()
    assert [queue.next(0.0), queue.next(0.0)] == [work, None]
    assert counters == {"dropped_samples": 1}


def test_arrivals_beyond_the_limit_wait_and_wake_nothing() -> None:
    woken: list[int] = []
    queue = ArrivalQueue(lambda: woken.append(1), Counter())
    for number in range(3):
        queue.put(sample(number))
    assert queue.take(2) == [sample(0), sample(1)]
    assert queue.is_waiting
    queue.put(sample(3))
    assert len(woken) == 1
    assert queue.take(2) == [sample(2), sample(3)]
    assert not queue.is_waiting
    queue.put(sample(4))
    assert len(woken) == 2


def test_pings_come_before_samples_and_are_bounded() -> None:
    counters: Counter[str] = Counter()
    queue = SampleQueue(2, counters)
    queue.add_sample(sample(1))
    for number in range(MAX_URGENT + 1):
        queue.add_sample(sample(number), is_urgent=True)
    assert [queue.next(0.0) for _ in range(MAX_URGENT + 1)] == [*map(sample, range(1, MAX_URGENT + 1)), sample(1)]
    assert counters == {"dropped_samples": 1, "dropped_sample_bytes": 1}

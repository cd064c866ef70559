"""Reports of a zenoh session, and the bounded queues between its threads and the event loop."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, NamedTuple

MAX_SAMPLES = 4096
"""Samples that may wait for the event loop: a second of a large fleet."""

MAX_CHANGES = 10_000
"""Other reports that may wait: tokens of more programs than a network has."""


MAX_URGENT = 256
"""Pings and pongs that may wait to be published: behind telemetry they would measure its queue."""


class FabricSample(NamedTuple):
    """Bytes that another program has published."""

    key: str
    payload: bytes
    attachment: bytes


class TokenChange(NamedTuple):
    """A liveliness token that appeared or ended."""

    key: str
    is_alive: bool


class ReadersChange(NamedTuple):
    """A key of ours that has subscribers now, or none."""

    key: str
    has_readers: bool


class LinkChange(NamedTuple):
    """The session has a link to another program now, or none."""

    is_up: bool
    problem: str


class TokensListed(NamedTuple):
    """All tokens that the router has named have been reported."""


class StateQuery(NamedTuple):
    """A query for the key of a state. `query` is zenoh's, to be answered by the session."""

    key: str
    query: Any


Arrival = FabricSample | TokenChange | TokensListed | ReadersChange | LinkChange | StateQuery


class ArrivalQueue:
    """Hands reports of other threads to the event loop, in their order.

    When it is full, the oldest sample is dropped and counted.
    """

    def __init__(self, wake: Callable[[], None], counters: Counter[str]) -> None:
        """Create it, empty. Counts dropped_arrivals.

        `wake` is called in the other thread when the loop has to call `take`.
        """
        self._counters = counters
        counters["dropped_arrivals"] = 0  # another thread adds to it: it must not change the size meanwhile
        self._wake = wake
        self._lock = threading.Lock()
        self._waiting: deque[Arrival] = deque()
        self._samples = 0

    def put(self, arrival: Arrival) -> bool:
        """Add a report; return False when there is no room for it. In any thread."""
        with self._lock:
            is_sample = isinstance(arrival, FabricSample)
            if is_sample and self._samples >= MAX_SAMPLES:
                self._drop_oldest()
            elif not is_sample and len(self._waiting) - self._samples >= MAX_CHANGES:
                self._counters["dropped_arrivals"] += 1
                return False
            self._samples += is_sample
            self._waiting.append(arrival)
            is_first = len(self._waiting) == 1
        if is_first:
            self._wake()
        return True

    def take(self, limit: int = MAX_SAMPLES + MAX_CHANGES) -> list[Arrival]:
        """Return what waits, oldest first, `limit` reports at most.

        While `is_waiting`, `wake` is not called for the rest: the caller takes it later.
        """
        with self._lock:
            found = [self._waiting.popleft() for _ in range(min(limit, len(self._waiting)))]
            self._samples -= sum(isinstance(one, FabricSample) for one in found)
        return found

    @property
    def is_waiting(self) -> bool:
        """True while there is more to take."""
        return bool(self._waiting)

    def _drop_oldest(self) -> None:
        for index, waiting in enumerate(self._waiting):
            if isinstance(waiting, FabricSample):
                del self._waiting[index]
                self._samples -= 1
                self._counters["dropped_arrivals"] += 1
                return


class SampleQueue:
    """Samples for the thread that publishes them, and work that does not give way.

    When it is full, the oldest sample is dropped and counted.
    """

    def __init__(self, limit: int, counters: Counter[str]) -> None:
        """Counts dropped_samples and dropped_sample_bytes."""
        self._counters = counters
        self._limit = limit
        self._ready = threading.Condition()
        self._samples: deque[FabricSample] = deque()
        self._urgent: deque[FabricSample] = deque()
        self._works: deque[Callable[[Any], None]] = deque()

    def add_sample(self, sample: FabricSample, *, is_urgent: bool = False) -> None:
        """Add a sample. Never blocks for long.

        `is_urgent`: a ping or pong, which comes before the others.
        """
        with self._ready:
            samples, limit = (self._urgent, MAX_URGENT) if is_urgent else (self._samples, self._limit)
            if len(samples) >= limit:
                dropped = samples.popleft()
                self._counters["dropped_samples"] += 1
                self._counters["dropped_sample_bytes"] += len(dropped.payload)
            samples.append(sample)
            self._ready.notify()

    def add_work(self, work: Callable[[Any], None]) -> None:
        """Add work, which comes before samples."""
        with self._ready:
            self._works.append(work)
            self._ready.notify()

    def clear_samples(self) -> None:
        """Forget the samples that wait."""
        with self._ready:
            for samples in (self._samples, self._urgent):
                self._counters["dropped_samples"] += len(samples)
                samples.clear()

    def next(self, timeout: float) -> FabricSample | Callable[[Any], None] | None:
        """Return what is next, or None after `timeout` s without any. In the publishing thread."""
        with self._ready:
            if not (self._works or self._urgent or self._samples):
                self._ready.wait(timeout)
            if self._works:
                return self._works.popleft()
            if self._urgent:
                return self._urgent.popleft()
            return self._samples.popleft() if self._samples else None

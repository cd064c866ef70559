"""Tracks for each message whether it has updates, since when, and how often. No I/O.

Time is a parameter.

An ANAFI sends attitude, speed and height in one datagram: all updates that are read together form one bundle, so
that a message made of all three is sent once, with all three.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping

WINDOW = 10.0
"""s. How often something is news is counted over the present window and the one before."""

MAX_BUNDLES = 256
"""Different bundles that are remembered; a drone in operation sends a dozen."""


class Bundle:
    """Sources that were updated together."""

    __slots__ = ("at", "before", "count", "ids")

    def __init__(self, ids: tuple[int, ...]) -> None:
        self.ids = ids
        """The messages that they make new."""
        self.at = 0.0
        """When it came last."""
        self.count = 0
        """How often in this window."""
        self.before = 0
        """And in the one before."""

    def add(self, at: float) -> None:
        """Count an update of all these sources."""
        self.count += 1
        self.at = at


class UpdateTracker:
    """Updates of one drone's messages.

    A source is anything hashable: a kind of event, the number of a message.
    """

    def __init__(self, ids: Mapping[Hashable, tuple[int, ...]]) -> None:
        """`ids`: the messages that an update from each source affects."""
        self._ids = ids
        self._updated: dict[Hashable, None] = {}
        """The sources that had news in this turn, in their order."""
        self._at = 0.0
        self._bundles: dict[tuple[Hashable, ...], Bundle] = {}
        self._since = self._window = 0.0
        """When the window before this one began, and this one."""

    def reset(self, now: float) -> None:
        """Forget all updates and intervals."""
        self._updated = {}
        self._bundles.clear()
        self._since = self._window = now

    def mark(self, source: Hashable, at: float) -> bool:
        """Record an update of a registered source.

        Returns True for the first update since `take`, which is to be called when all are marked.
        """
        first = not self._updated
        self._updated[source] = None
        self._at = at
        return first

    def mark_all(self, sources: Iterable[Hashable], at: float) -> bool:
        """Record updates from several sources, in their sequence; otherwise as `mark`."""
        first = not self._updated
        self._updated.update(dict.fromkeys(sources))
        self._at = at
        return first

    def take(self) -> tuple[tuple[int, ...], float]:
        """Return the messages updated since the last call, and when.

        They are empty if `reset` was called meanwhile.
        """
        if not self._updated:
            return (), self._at
        key = tuple(self._updated)
        bundle = self._bundles.get(key) or self._new_bundle(key)
        self._updated = {}
        bundle.add(self._at)
        return bundle.ids, self._at

    @property
    def has_updates(self) -> bool:
        """True when `take` would return updates."""
        return bool(self._updated)

    def bundle(self, sources: tuple[Hashable, ...]) -> Bundle:
        """Return what is known of updates from all these sources."""
        return self._bundles.get(sources) or self._new_bundle(sources)

    def at(self, id: int) -> float | None:
        """When something was new for this message last; None: never."""
        return max((bundle.at for bundle in self._with(id)), default=None)

    def interval(self, id: int, now: float) -> float | None:
        """Return the mean time (s) between two updates for this message; None before two."""
        count = sum(bundle.count + bundle.before for bundle in self._with(id))
        return (now - self._since) / count if count > 1 and now > self._since else None

    def pass_time(self, now: float) -> None:
        """To be called now and then: a new window begins when it is time."""
        if now - self._window < WINDOW:
            return
        self._since, self._window = self._window, now
        for bundle in self._bundles.values():
            bundle.before, bundle.count = bundle.count, 0

    def _new_bundle(self, key: tuple[Hashable, ...]) -> Bundle:
        if len(self._bundles) >= MAX_BUNDLES:
            self.reset(self._at)
        bundle = Bundle(tuple(dict.fromkeys(id for source in key for id in self._ids.get(source, ()))))
        self._bundles[key] = bundle
        return bundle

    def _with(self, id: int) -> Iterator[Bundle]:
        """Yield the bundles with this message. There are a dozen in all, and it is seldom asked for."""
        return (bundle for bundle in self._bundles.values() if id in bundle.ids)

"""Arithmetic on one column per drone, for a fleet of one as for a fleet of a hundred.

With few drones a call of numpy costs more than its work, so what is called in every step makes few of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class DelayLine:
    """A pure delay per drone, in whole steps."""

    def __init__(self, delays: Sequence[float], step: float) -> None:
        """`delays` in s, one per drone; `step`: s between two values."""
        steps = np.array([max(1, round(delay / step)) for delay in delays])
        self._first, *others = sorted(set(steps.tolist())) or [1]
        self._others = [(delay, steps == delay) for delay in others]
        """The models of a fleet have two or three different delays: a row of the ring for each is cheap to take."""
        self._ring: Array = np.zeros((int(steps.max(initial=1)) + 1, len(delays)))
        self._now = 0

    def clear(self, column: int) -> None:
        """Nothing is on its way any more."""
        self._ring[:, column] = 0.0

    def push(self, values: Array) -> Array:
        """Store the current command and return the one of `delay` ago.

        The array returned is valid until the next call.
        """
        ring, now = self._ring, self._now
        ring[now] = values
        self._now = (now + 1) % len(ring)
        out: Array = ring[now - self._first]
        for delay, column in self._others:
            out = np.where(column, ring[now - delay], out)
        return out


def bounded(values: Array, low: Array | float, high: Array | float) -> Array:
    """`np.clip` at a third of its price for few drones."""
    bounded: Array = np.maximum(np.minimum(values, high), low)
    return bounded


def limit(vectors: Array, length: float) -> Array:
    """Each column shortened to at most `length`."""
    norms = np.maximum(np.hypot(vectors[0], vectors[1]), 1e-12)
    shortened: Array = vectors * np.minimum(1.0, length / norms)
    return shortened

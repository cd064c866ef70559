"""Selections of test combinations in which each possible pair of values of two factors occurs."""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterator, Sequence
from typing import TypeVar

Row = TypeVar("Row", bound=tuple[Hashable, ...])


def pairs(row: tuple[Hashable, ...]) -> Iterator[tuple[tuple[int, Hashable], tuple[int, Hashable]]]:
    """Each two values of a row, with the numbers of their factors."""
    return itertools.combinations(enumerate(row), 2)


def selection(possible: Sequence[Row]) -> list[Row]:
    """Return few of the possible rows that have between them every pair of values that any of them has.

    Greedy and without chance: always the first of the rows that add the most pairs, until no pair is missing; then rows
    whose pairs all occur elsewhere are dropped. The order is that of `possible`.
    """
    missing = {pair for row in possible for pair in pairs(row)}
    chosen: list[Row] = []
    while missing:
        chosen.append(max(possible, key=lambda row: len(missing.intersection(pairs(row)))))
        missing.difference_update(pairs(chosen[-1]))
    for row in list(chosen):
        rest = {pair for other in chosen if other is not row for pair in pairs(other)}
        if rest.issuperset(pairs(row)):
            chosen.remove(row)
    return [row for row in possible if row in chosen]

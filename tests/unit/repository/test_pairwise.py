"""Pairwise selections: nothing that can occur together is left out, and little is chosen twice."""

from __future__ import annotations

import itertools

from support.olympe import COMBINATIONS, SELECTED
from support.pairwise import pairs, selection


def test_selection_of_two_factors_is_every_combination() -> None:
    possible = [("a", 1), ("a", 2), ("b", 1)]
    assert selection(possible) == possible


def test_pairwise_selection_of_three_binary_factors_has_four_rows() -> None:
    """The orthogonal array L4: no fewer than four rows have the four pairs of two factors."""
    possible = list(itertools.product("ab", "cd", "ef"))
    assert len(selection(possible)) == 4


def test_selection_with_an_excluded_pair_has_all_others() -> None:
    possible = [row for row in itertools.product("ab", "cd", "ef") if row[:2] != ("b", "d")]
    chosen = selection(possible)
    assert set(chosen) <= set(possible)
    assert {pair for row in chosen for pair in pairs(row)} == {pair for row in possible for pair in pairs(row)}


def test_default_olympe_run_has_every_possible_pair() -> None:
    assert len(COMBINATIONS) == 29 + 20 + 2 + 2, "visits, videos, media, twins"
    assert {pair for row in SELECTED for pair in pairs(row)} == {pair for row in COMBINATIONS for pair in pairs(row)}
    assert len(SELECTED) <= 15

"""Flights while the drone's events are late, repeated and in another order, each with a firmware quirk in turn.

A flight is a take-off, a goto, an orbit, a mission, a return and a landing; `support.scramble` judges it.
`tests/bench/scramble.py` flies all quirks with all seeds, and one of these alone.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.scramble import SEEDS, flown, quirk_of

GROUP = 5

KNOWN: dict[int, str] = {}
"""Seeds whose flight shows a known defect, with the reason."""


@pytest.mark.parametrize("first", range(0, SEEDS, GROUP))
async def test_scrambled_flights_end_as_without_scramble(
    first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = []
    for seed in range(first, first + GROUP):
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / str(seed)))
        found = await flown(seed, quirk_of(seed), tmp_path / str(seed))
        wrong += [] if seed in KNOWN else found
    assert wrong == [], "\n" + "\n".join(wrong)

"""A hundred rounds of random flight through MAVLink, judged by the simulated drone's log (`support.soak`).

The seeds are fixed: a red suite is no matter of luck. The default run flies the first half. `tests/bench/soak.py` flies
other seeds, and one of these alone.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.soak import AFTER_CANCEL, BLAMED, Draw, Step, draw, fly, known, rounds_flown

from anafi_mav.sim.world.faults import CLEAR, Impairment

pytestmark = pytest.mark.soak

ROUNDS, GROUP = 100, 10

BY_DEFAULT = 50
"""Rounds of the default run: some 20 s of processor time."""

GROUPS = [
    pytest.param(first, marks=[pytest.mark.full] if first >= BY_DEFAULT else []) for first in range(0, ROUNDS, GROUP)
]

KNOWN: dict[int, str] = {}
"""Seeds whose round shows a defect that `support.soak.DEFECTS` cannot recognise, with the reason."""


@pytest.mark.timeout(300)
@pytest.mark.parametrize("first", GROUPS)
async def test_rounds_of_random_flight_keep_every_promise(
    first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = []
    for seed in range(first, first + GROUP):
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / str(seed)))
        wrong = [text for text in await rounds_flown(seed) if known(text) is None]
        if wrong and seed not in KNOWN:
            failed += [*wrong, str(draw(seed))]
    assert failed == [], "\n" + "\n".join(failed)


@pytest.mark.parametrize(("cancel_after", "defect"), [(0.6, AFTER_CANCEL), (1.75, BLAMED)])
async def test_restart_cancelled_with_late_answers_shows_known_defect(cancel_after: float, defect: str) -> None:
    """Defects 3 and 2 of issue CONTROL, as a round's judge sees them. Issue CONTROL turns this into `wrong == []`."""
    late = Impairment(delay=0.5)
    restart = Step(0.5, 0, "withdraw", (1.0, 1.0, 4.0 * cancel_after))
    wrong = await fly(Draw(0, "4k", ("px4", "ardupilot"), None, "mission", CLEAR, late, (restart,)))
    assert wrong
    assert [text for text in wrong if defect not in text] == []

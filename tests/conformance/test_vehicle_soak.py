"""Two hundred rounds of random flight through MAVLink, judged by the simulated drone's log (`support.soak`).

Each run flies other rounds: `--fuzz-seed`, which the run prints, repeats them. `tests/bench/soak.py` flies as many as
wanted, and one of these alone.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.soak import Draw, Step, draw, fly, rounds_flown

from anafi_mav.sim.world.faults import CLEAR, Impairment

pytestmark = pytest.mark.soak

ROUNDS, GROUP = 200, 10
"""Rounds of a run: at most 90 s of processor time."""


@pytest.mark.parametrize("first", range(0, ROUNDS, GROUP))
async def test_rounds_of_random_flight_keep_every_promise(
    first: int, fuzz_seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = []
    for seed in range(fuzz_seed * ROUNDS + first, fuzz_seed * ROUNDS + first + GROUP):
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / str(seed)))
        wrong = await rounds_flown(seed)
        if wrong:
            failed += [*wrong, str(draw(seed))]
    assert failed == [], "\n" + "\n".join(failed)


@pytest.mark.parametrize("cancel_after", [0.6, 1.75])
async def test_restart_cancelled_with_late_answers_keeps_every_promise(cancel_after: float) -> None:
    """The moments of defects 3 and 2 of issue CONTROL: control is acquired, and the start is on its way."""
    late = Impairment(delay=0.5)
    restart = Step(0.5, 0, "withdraw", (1.0, 1.0, 4.0 * cancel_after))
    assert await fly(Draw(0, "4k", ("px4", "ardupilot"), None, "mission", CLEAR, late, (restart,))) == []

"""Every row of the anafi_ros paper's appendix, on every model of the simulator, over real sockets (see `seed_rows`)."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from support.seed_rows import MODELS, ROWS, Row
from support.simulated import connected

from anafi_mav.errors import NotSupported

REACHABLE = [row for row in ROWS if row.drive is not None]


def test_the_table_has_every_row_of_the_appendix() -> None:
    assert Counter(row.kind for row in ROWS) == {
        "subscribed topic": 5,
        "published topic": 29,
        "service": 24,
        "parameter": 25,
    }
    assert len({(row.kind, row.name) for row in ROWS}) == len(ROWS)
    for row in ROWS:
        assert row.how
        assert set(row.models) <= set(MODELS)


def test_seed_page_equals_the_generated_table() -> None:
    generate = Path(__file__).parents[3] / "docs" / "generate.py"
    page = subprocess.run([sys.executable, generate, "--check"], capture_output=True, text=True, check=False)
    assert "seed.md" not in page.stderr, page.stderr


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("row", REACHABLE, ids=[row.name for row in REACHABLE])
async def test_a_row(row: Row, model: str) -> None:
    async with connected(model, speed=3.0) as pair:
        assert row.drive is not None
        if model in row.models:
            result = await row.drive(pair)
            assert result is not None
            assert result is not False
        else:
            with pytest.raises(NotSupported):
                await row.drive(pair)

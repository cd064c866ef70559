"""`tests/bench/suite.py`: what is left of a run that was not green."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from support.product import program

ROOT = Path(__file__).parents[3]

TESTS = """
import logging

def test_good():
    print("good output")

def test_bad():
    logging.getLogger("x").warning("line of the log" + 30_000 * " ")
    print("seed 4711")
    assert 1 == 2

def test_worse(absent_fixture):
    pass
"""


def outputs(folder: Path) -> list[Path]:
    """Files with the output of a run."""
    return [*folder.glob("suite_output_*")]


async def test_output_of_a_failed_run_is_kept_and_its_failures_are_printed(tmp_path: Path) -> None:
    (tmp_path / "test_fails.py").write_text(TESTS)
    tally = tmp_path / "runs.jsonl"
    words = ("--tally", str(tally), "--", "-n0", "-c", "/dev/null", "--rootdir", str(tmp_path), str(tmp_path))
    async with program(sys.executable, str(ROOT / "tests" / "bench" / "suite.py"), *words) as held:
        assert await held.end() == 1
    row = json.loads(tally.read_text())
    assert outputs(tmp_path) == [tmp_path / row["output"]]
    kept = (tmp_path / row["output"]).read_text()
    assert "1 failed, 1 passed, 1 error" in kept
    for text in ("seed 4711", "line of the log", "assert 1 == 2", "fixture 'absent_fixture' not found"):
        assert text in kept
        assert any(text in line for line in held.lines), text
    assert not any("1 passed" in line or "short test summary" in line for line in held.lines)
    assert (ROOT / ".gitignore").read_text().count("tests/bench/suite_output_*.txt") == 1


async def test_output_of_a_green_run_is_not_kept(tmp_path: Path) -> None:
    (tmp_path / "test_good.py").write_text("def test_good():\n    pass\n")
    tally = tmp_path / "runs.jsonl"
    words = ("--tally", str(tally), "--", "-n0", "-c", "/dev/null", "--rootdir", str(tmp_path), str(tmp_path))
    async with program(sys.executable, str(ROOT / "tests" / "bench" / "suite.py"), *words) as held:
        assert await held.end() == 0
    assert json.loads(tally.read_text())["output"] is None
    assert outputs(tmp_path) == []

"""The seed of a run with random input: printed at its start and with a failure, and given by option or environment."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[2]

TEST = """
def test_wrong(fuzz_seed):
    assert fuzz_seed < 0

def test_right():
    pass
"""


def run(folder: Path, *arguments: str, **environment: str) -> str:
    """Return what a quiet run prints, in a process of its own."""
    (folder / "test_one.py").write_text(TEST)
    inherited = {name: value for name, value in os.environ.items() if name != "FUZZ_SEED" and "PYTEST" not in name}
    words = [sys.executable, "-m", "pytest", "-q", "-p", "support.fuzz_seed", "-c", os.devnull]
    done = subprocess.run(
        [*words, "--rootdir", str(folder), *arguments, str(folder)],
        env=inherited | {"PYTHONPATH": str(TESTS)} | environment,
        stdout=subprocess.PIPE,
        check=False,
        text=True,
    )
    assert done.returncode == 1, done.stdout
    return done.stdout


def test_seed_is_printed_first_and_with_each_failure(tmp_path: Path) -> None:
    said = run(tmp_path, "-n", "1")  # in the worker, too
    first, again = re.findall(r"fuzz seed (\d+): --fuzz-seed \1 repeats it", said)
    assert said.startswith(f"fuzz seed {first}")
    assert again == first
    assert f"assert {first} < 0" in said


def test_given_seed_is_used(tmp_path: Path) -> None:
    assert "assert 4711 < 0" in run(tmp_path, "-n", "0", "--fuzz-seed", "4711", FUZZ_SEED="12")
    assert "assert 12 < 0" in run(tmp_path, "-n", "0", FUZZ_SEED="12")

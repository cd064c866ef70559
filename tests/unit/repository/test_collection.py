"""Workers begin to collect at different files and return the same tests, by a pytest of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from support.collection import WORKER
from support.order import WORKERS

TESTS = Path(__file__).resolve().parents[2]

SAMPLE = """
from pathlib import Path

with Path({imported!r}).open("a") as file:
    file.write("{name}\\n")

def test_second():
    pass

def test_first():
    pass
"""


def test_second_worker_of_two_imports_other_files_first_and_returns_the_same_order(tmp_path: Path) -> None:
    imported = tmp_path / "imported"
    names = ["a/test_a", "a/test_b", "b/c/test_c", "test_d"]
    for name in names:
        file = tmp_path / "tests" / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(SAMPLE.format(imported=str(imported), name=name))
    words = ("-m", "pytest", "-p", "support.order", "-p", "support.collection", "--collect-only", "-q")
    done = subprocess.run(
        [sys.executable, *words, "--import-mode=importlib", "-c", os.devnull, "--rootdir", str(tmp_path), "tests"],
        capture_output=True, text=True, timeout=120, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(TESTS), "PYTEST_ADDOPTS": "", WORKER: "gw1", WORKERS: "2"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert imported.read_text().split() == ["b/c/test_c", "test_d", "a/test_b", "a/test_a"]
    collected = [line.partition("tests/")[2] for line in done.stdout.splitlines() if "::" in line]
    assert collected == [f"{name}.py::{test}" for name in names for test in ("test_second", "test_first")]

"""The suite's own rule for repetitions, run by a pytest of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[2]

FAILS_ONCE = """
from pathlib import Path
import pytest

def attempt(name):
    file = Path(__file__).with_name(name)
    file.write_text((file.read_text() if file.exists() else "") + "x")
    return len(file.read_text())

@pytest.mark.third_party
def test_foreign_fails_once():
    assert attempt("once") == 2

@pytest.mark.third_party
def test_foreign_fails_always():
    assert attempt("always") == 0

def test_own_fails_once():
    assert attempt("own") == 2
"""


def test_only_third_party_test_is_repeated_once_and_printed(tmp_path: Path) -> None:
    file = tmp_path / "test_sample.py"
    file.write_text(FAILS_ONCE)
    words = ("-m", "pytest", "-p", "support.repeats", "-n", "2", "-q", "-c", os.devnull, str(file))
    environment = {**os.environ, "PYTHONPATH": str(TESTS)}
    environment.pop("PYTEST_ADDOPTS", None)  # options of the suite's own run
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 1, done.stdout + done.stderr
    repeated = [line.rpartition("::")[2] for line in done.stdout.splitlines() if line.startswith("repeated: ")]
    assert sorted(repeated) == ["test_foreign_fails_always", "test_foreign_fails_once"]
    assert 'assert attempt("once") == 2' in done.stdout  # the first failure, though the repetition passed
    assert {name: len((tmp_path / name).read_text()) for name in ("once", "always", "own")} == {
        "once": 2,
        "always": 2,
        "own": 1,
    }
    assert "2 failed, 1 passed, 2 rerun" in done.stdout


def test_third_party_marker_is_used_for_foreign_programs_only() -> None:
    marked = [path for path in TESTS.rglob("test_*.py") if "mark.third_party" in path.read_text(encoding="utf-8")]
    marked.remove(Path(__file__).resolve())
    assert {path.parent.name for path in marked} == {"clients", "interop"}

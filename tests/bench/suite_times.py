"""Runs the suite once and prints its processor time, and processor and wall time per test file, the dearest first.

    python tests/bench/suite_times.py [--top N] [-- ARGUMENTS OF PYTEST]

The first line has the processor time of all processes of the run: pytest, its workers, and what the tests start, also
those that outlive the process that started them (on Linux; elsewhere these are missing). The times of files are of
their tests, without collection and imports. Wall times of files add up to more than the run takes, for tests run side
by side.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import machine

ROOT = Path(__file__).resolve().parents[2]


PR_SET_CHILD_SUBREAPER = 36
"""Of prctl(2): orphans among the descendants become children of this process."""


def adopt_orphans() -> None:
    """Let the processor time of processes whose parent did not wait for them count here."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def spent() -> float:
    """Return the processor time of all processes that have ended below this one, s."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG) != (0, 0):
            continue
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--top", type=int, default=30, metavar="N")
    parser.add_argument("arguments", nargs="*", help="for pytest, after --")
    options = parser.parse_args()
    began = time.monotonic()
    adopt_orphans()
    with tempfile.TemporaryDirectory() as folder:
        costs = Path(folder) / "costs.json"
        words = [sys.executable, "-m", "pytest", "-p", "support.costs", *options.arguments]
        environment = {**os.environ, "COSTS_FILE": str(costs)}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT / "tests"), os.environ.get("PYTHONPATH"))))
        status = subprocess.run(words, cwd=ROOT, env=environment, check=False).returncode
        whole = spent()
        files: dict[str, list[float]] = json.loads(costs.read_text(encoding="utf-8"))
    rows = sorted(((cpu, wall, int(tests), name) for name, (tests, wall, cpu) in files.items()), reverse=True)
    print(machine())
    total_cpu, total_tests = sum(row[0] for row in rows), sum(row[2] for row in rows)
    print(
        f"{total_tests} tests in {time.monotonic() - began:.0f} s: {whole / 60:.1f} minutes of processor time in all, "
        f"{total_cpu / 60:.1f} of them in tests"
    )
    print(f"{'cpu s':>8} {'wall s':>8} {'tests':>6}  file")
    for cpu, wall, tests, name in rows[: options.top]:
        print(f"{cpu:8.1f} {wall:8.1f} {tests:6}  {name}")
    return status


if __name__ == "__main__":
    sys.exit(main())

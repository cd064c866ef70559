"""Runs the suite once and prints processor and wall time per test file, the dearest first.

    python tests/bench/suite_times.py [--top N] [-- ARGUMENTS OF PYTEST]

Wall times of files add up to more than the run takes, for tests run side by side.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import machine

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--top", type=int, default=30, metavar="N")
    parser.add_argument("arguments", nargs="*", help="for pytest, after --")
    options = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        costs = Path(folder) / "costs.json"
        words = [sys.executable, "-m", "pytest", "-p", "support.costs", *options.arguments]
        environment = {**os.environ, "COSTS_FILE": str(costs)}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT / "tests"), os.environ.get("PYTHONPATH"))))
        status = subprocess.run(words, cwd=ROOT, env=environment, check=False).returncode
        files: dict[str, list[float]] = json.loads(costs.read_text(encoding="utf-8"))
    rows = sorted(((cpu, wall, int(tests), name) for name, (tests, wall, cpu) in files.items()), reverse=True)
    print(machine())
    total_cpu, total_tests = sum(row[0] for row in rows), sum(row[2] for row in rows)
    print(f"{total_tests} tests in {time.monotonic() - began:.0f} s, {total_cpu / 60:.1f} minutes of processor time")
    print(f"{'cpu s':>8} {'wall s':>8} {'tests':>6}  file")
    for cpu, wall, tests, name in rows[: options.top]:
        print(f"{cpu:8.1f} {wall:8.1f} {tests:6}  {name}")
    return status


if __name__ == "__main__":
    sys.exit(main())

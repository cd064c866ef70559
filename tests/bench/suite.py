"""Runs the whole suite several times, unattended, and keeps a tally of what failed or was repeated.

    python tests/bench/suite.py --runs 6
    python tests/bench/suite.py --runs 3 --busy 2     # beside that many processes that keep a core busy
    python tests/bench/suite.py --runs 1 --beside 2   # beside so many that run already, soak.py for example

Each run appends a line of JSON to the tally (tests/bench/suite_runs.jsonl unless `--tally` names another file): date,
commit, machine, busy processes, wall and processor time, counts, failed and repeated tests. The summary at the end is
of the whole tally: runs of several days and landings add up. Exit status 1 when a run of this call was not green.

The whole output of a run that was not green, with the logs and seeds of its failures, is kept beside the tally in the
file that its row names. Its failures are printed.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from common import machine

ROOT = Path(__file__).resolve().parents[2]
TALLY = Path(__file__).with_name("suite_runs.jsonl")

KEPT = "suite_output_{}.txt"
"""Name of the output of a run; ignored by git."""

FAILURES = re.compile(
    r"^=+ (?:FAILURES|ERRORS) =+$.*?(?=^=+ (?!FAILURES|ERRORS)[^=]* =+$|\Z)", re.MULTILINE | re.DOTALL
)

REPEATED = re.compile(r"^repeated: (\S+)", re.MULTILINE)

BURN = """
import os, sys, threading
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0))).start()
while True:
    pass
"""
# It ends with this script, however that ends: its stdin closes.

LIMIT = 3 * 3600.0
"""s that one run may take before it is ended and counts as failed."""


@contextmanager
def burner() -> Iterator[None]:
    """A process that keeps one core busy until the end of the block."""
    with subprocess.Popen([sys.executable, "-c", BURN], stdin=subprocess.PIPE) as process:
        try:
            yield
        finally:
            process.kill()


def commit() -> str:
    """The commit that is tested, marked when the work tree differs from it."""
    words = ["git", "-C", str(ROOT)]
    head = subprocess.run([*words, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    dirty = subprocess.run([*words, "status", "--porcelain", "-uno"], capture_output=True, text=True, check=True)
    return head.stdout.strip() + ("+" if dirty.stdout.strip() else "")


def processor_time() -> float:
    """s of processor time of all ended children."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(busy: int, beside: int, arguments: list[str], folder_of_outputs: Path) -> dict[str, Any]:
    """One run of pytest; its line of the tally."""
    date = datetime.datetime.now(datetime.timezone.utc)
    began, used = time.monotonic(), processor_time()
    with tempfile.TemporaryDirectory() as folder, ExitStack() as burning:
        report = Path(folder) / "report.xml"
        for _ in range(busy):
            burning.enter_context(burner())
        words = [sys.executable, "-m", "pytest", f"--junitxml={report}", *arguments]
        try:
            done = subprocess.run(
                words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LIMIT, check=False
            )
            status, output = done.returncode, done.stdout
        except subprocess.TimeoutExpired as error:
            status, output = -1, error.stdout or b""
        out = output.decode(errors="replace")
        wall, cpu = time.monotonic() - began, processor_time() - used
        cases = list(ElementTree.parse(report).iter("testcase")) if report.exists() else []
    failed = sorted({_name(case) for case in cases if any(case.find(tag) is not None for tag in ("failure", "error"))})
    kept = None
    if status or failed:
        kept = KEPT.format(date.strftime("%Y%m%dT%H%M%S.%fZ"))
        (folder_of_outputs / kept).write_text(out, encoding="utf-8")
        print("".join(FAILURES.findall(out)) or out[-20_000:])
    return {
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "commit": commit(),
        "machine": machine(),
        "busy": busy + beside,
        "arguments": arguments,
        "status": status,
        "wall": round(wall),
        "cpu": None if busy + beside else round(cpu),
        "tests": len(cases),
        "skipped": sum(case.find("skipped") is not None for case in cases),
        "failed": failed,
        "repeated": sorted(set(REPEATED.findall(out))),
        "output": kept,
    }


def _name(case: ElementTree.Element) -> str:
    return f"{case.get('classname')}::{case.get('name')}"


def summary(rows: list[dict[str, Any]]) -> Iterator[str]:
    """The whole tally in lines."""
    for busy in sorted({row["busy"] for row in rows}):
        those = [row for row in rows if row["busy"] == busy]
        walls = sorted(row["wall"] for row in those)
        green = sum(row["status"] == 0 for row in those)
        beside = f" beside {busy} busy processes" if busy else ""
        yield f"{len(those)} runs{beside}: {green} green, {walls[0]} to {walls[-1]} s"
    for kind in ("failed", "repeated"):
        for name, count in Counter(name for row in rows for name in row[kind]).most_common():
            defect = ": a defect to be found" if kind == "failed" or count > 1 else ""
            yield f"{kind} in {count} of {len(rows)} runs{defect}: {name}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=1, metavar="N")
    parser.add_argument("--busy", type=int, default=0, metavar="N", help="processes that keep a core busy meanwhile")
    parser.add_argument("--beside", type=int, default=0, metavar="N", help="such processes that run already")
    parser.add_argument("--tally", type=Path, default=TALLY, metavar="FILE")
    parser.add_argument("arguments", nargs="*", help="for pytest, after --")
    options = parser.parse_args()
    rows = []
    for number in range(options.runs):
        row = run(options.busy, options.beside, options.arguments, options.tally.parent)
        rows.append(row)
        with options.tally.open("a", encoding="utf-8") as tally:
            tally.write(json.dumps(row) + os.linesep)
        failed = ", ".join(row["failed"]) or "none"
        print(f"run {number + 1}: status {row['status']}, {row['tests']} tests in {row['wall']} s, failed: {failed}")
    print(machine())
    lines = options.tally.read_text(encoding="utf-8").splitlines()
    print("\n".join(summary([row for row in map(json.loads, lines) if not row["arguments"]])))
    return int(any(row["status"] != 0 for row in rows))


if __name__ == "__main__":
    sys.exit(main())

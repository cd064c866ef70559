"""Latency, capacity and start-up of another commit and of this work tree, side by side in one run.

    .venv/bin/python tests/bench/against.py COMMIT [--rounds N] [--drones N] [--only latency fleet start]

Each round measures both, in turns of A B and B A, so that what the machine does meanwhile meets both. The scripts are
this work tree's (`latency.py`, `fleet.py`), gateway and simulator are the measured commit's. A figure is the median of
its rounds, with the lowest and the highest; worse is marked where even the best round of now is above the highest of
then. Start-up is `anafi-mav run` with one simulated drone until it prints that it is ready: its processor time and
that of its simulator.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from common import ROOT, loopback, machine, tree_of

BENCH = Path(__file__).resolve().parent

Figures = dict[str, float]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit")
    parser.add_argument("--rounds", type=int, default=5, metavar="N")
    parser.add_argument("--drones", type=int, default=100, metavar="N")
    parser.add_argument("--only", nargs="*", choices=list(MEASURES), default=list(MEASURES))
    options = parser.parse_args()
    print(machine())
    with tree_of(options.commit) as old:
        found: dict[str, tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
        for number in range(options.rounds):
            sides = [(0, old), (1, ROOT)]
            for side, root in sides if number % 2 == 0 else reversed(sides):
                for name in options.only:
                    for figure, value in MEASURES[name](root, options.drones).items():
                        found[figure][side].append(value)
            print(f"round {number + 1} of {options.rounds}", file=sys.stderr, flush=True)
    print(f"| figure | {options.commit} | this work tree | change | |\n|---|---|---|---|---|")
    for figure, (then, now) in found.items():
        print(row(figure, then, now))
    return 0


def row(figure: str, then: list[float], now: list[float]) -> str:
    """One row of the table."""
    before, after = statistics.median(then), statistics.median(now)
    change = f"{(after - before) / before:+.0%}" if before else ""
    cells = [f"{statistics.median(side):.3g} ({min(side):.3g} to {max(side):.3g})" for side in (then, now)]
    return f"| {figure} | {cells[0]} | {cells[1]} | {change} | {'worse' if min(now) > max(then) else ''} |"


def environment(root: Path) -> dict[str, str]:
    """The environment in which `python -m anafi_mav` is that of a tree."""
    return {**os.environ, "PYTHONPATH": str(root), "PYTHONSAFEPATH": "1"}


def script(root: Path, *words: str) -> str:
    """What a script of this folder prints; the product that it starts is a tree's."""
    with tempfile.TemporaryDirectory() as state:
        variables = {**environment(root), "XDG_STATE_HOME": state}
        variables["PYTHONPATH"] = os.pathsep.join((str(root), str(BENCH)))
        command = [sys.executable, str(BENCH / words[0]), *words[1:]]
        done = subprocess.run(command, cwd=state, env=variables, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


def latency(root: Path, drones: int) -> Figures:
    """ms from a client's send to the simulator's read."""
    text = script(root, "latency.py", "300", "60")
    figures = {}
    for name, middle, high in re.findall(r"^(\S+ -> \S+): p50 ([\d.]+) ms, p99 ([\d.]+) ms", text, re.MULTILINE):
        figures[f"{name}, median, ms"], figures[f"{name}, 99 %, ms"] = float(middle), float(high)
    return figures


def fleet(root: Path, drones: int) -> Figures:
    """Share of a core and memory with a fleet."""
    last = script(root, "fleet.py", "10", str(drones)).strip().splitlines()[-1]
    _, gateway, memory, simulator, messages = (cell.strip() for cell in last.strip("|").split("|"))
    return {
        f"gateway with {drones} drones, % of a core": float(gateway.rstrip("%")),
        f"gateway with {drones} drones, MiB": float(memory),
        f"simulator of {drones} drones, % of a core": float(simulator.rstrip("%")),
        f"s per {1000 * drones} messages of {drones} drones": 1000 * drones / float(messages),
    }


def start(root: Path, drones: int) -> Figures:
    """Processor time until the gateway is ready."""
    before = _children()
    with tempfile.TemporaryDirectory() as state:
        words = ["run", "--endpoint", f"udpout://{loopback()}:14550"]
        with subprocess.Popen(
            [sys.executable, "-m", "anafi_mav", *words],
            cwd=state,
            env={**environment(root), "XDG_STATE_HOME": state},
            stdout=subprocess.PIPE,
            text=True,
        ) as process:
            assert process.stdout is not None
            for line in process.stdout:
                if line.startswith("ready"):
                    break
            else:
                raise SystemExit("anafi-mav run ended before it was ready")
            process.terminate()
    return {"start-up and end of gateway and simulator, s of processor time": _children() - before}


def _children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


MEASURES = {"latency": latency, "fleet": fleet, "start": start}
"""By the names of --only."""


if __name__ == "__main__":
    sys.exit(main())

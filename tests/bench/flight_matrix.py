"""What is flying, and what arrives meanwhile: all cells of the matrix, with answer, mode and the drone's log.

    python tests/bench/flight_matrix.py                                   # both flavours, 1400 cells
    python tests/bench/flight_matrix.py --flying climb goto --arriving YAW ROI --flavour px4
    python tests/bench/flight_matrix.py --findings                        # only the cells with a finding

A line: what is flying, what arrives, answer, modes, height and speed, commands to the drone, texts. Exit status 1 when
`support.flight_matrix` finds a cell wrong. Virtual time; half a second of CPU for a cell.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import logging
import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from support import clock

clock.install()

from support.flight_matrix import ARRIVALS, SITUATIONS, fly  # noqa: E402 (the clock comes first)

from anafi_mav.arsdk.link import watchdog  # noqa: E402

watchdog.LIMIT = None


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--flying", nargs="*", choices=list(SITUATIONS), default=list(SITUATIONS))
    options.add_argument("--arriving", nargs="*", choices=list(ARRIVALS), default=list(ARRIVALS))
    options.add_argument("--flavour", nargs="*", choices=["px4", "ardupilot"], default=["px4", "ardupilot"])
    options.add_argument("--findings", action="store_true")
    given = options.parse_args()
    logging.disable(logging.CRITICAL)
    gc.freeze()
    cells = [(s, a, f) for f in given.flavour for s in given.flying for a in given.arriving]
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for number, cell in enumerate(cells):
            os.environ["XDG_STATE_HOME"] = f"{folder}/{number}"
            with asyncio.Runner(loop_factory=clock.Loop) as runner:
                try:
                    line, findings = runner.run(fly(*cell))
                except Exception as error:  # a cell that cannot be flown is a finding; the others go on
                    line, findings = " | ".join(cell), [f"{type(error).__name__}: {error}"]
            wrong += bool(findings)
            if findings or not given.findings:
                print(cell[2], line, *(f"!! {one}" for one in findings), sep=" | ", flush=True)
    print(f"{len(cells)} cells, {wrong} with a finding")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

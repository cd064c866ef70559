"""Flights while the simulated firmware scrambles its events, each quirk with each seed, and a tally.

    python tests/bench/scramble.py                        # all quirks, seeds 0 to 49
    python tests/bench/scramble.py --seeds 7 --quirks no-flight-id roll-inverted
    python tests/bench/scramble.py --in-turn              # the flights of the suite: a quirk for each seed

`--seeds A-B` or `--seeds A`. Exit status 1 when a flight has another end than `support.scramble.ENDS` says.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from support import clock

clock.install()

from support.scramble import SEEDS, flown, quirk_of  # noqa: E402 (the clock comes first)

from anafi_mav.arsdk.link import watchdog  # noqa: E402
from anafi_mav.sim.world.quirks import QUIRKS  # noqa: E402

watchdog.LIMIT = None


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", default=f"0-{SEEDS - 1}")
    options.add_argument("--quirks", nargs="*", choices=list(QUIRKS), default=list(QUIRKS))
    options.add_argument("--in-turn", action="store_true")
    given = options.parse_args()
    first, _, last = given.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    if given.in_turn:
        flights = [(quirk_of(seed), seed) for seed in seeds]
    else:
        flights = [(QUIRKS[name], seed) for name in given.quirks for seed in seeds]
    tally: Counter[str] = Counter()
    began, cpu = time.perf_counter(), time.process_time()
    gc.freeze()  # to collect is cheap then
    with tempfile.TemporaryDirectory() as folder:
        for number, (quirk, seed) in enumerate(flights):
            os.environ["XDG_STATE_HOME"] = f"{folder}/{number}"
            with asyncio.Runner(loop_factory=clock.Loop) as runner:
                wrong = runner.run(flown(seed, quirk, Path(folder) / str(number)))
            tally["failed" if wrong else "passed"] += 1
            print("\n".join(wrong) or ".", end="\n" if wrong else "", flush=True)
    spent = time.process_time() - cpu
    print(f"\n{dict(tally)}, {spent:.0f} s of CPU, {time.perf_counter() - began:.0f} s")
    return 1 if tally["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())

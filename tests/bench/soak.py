"""Rounds of random flight through MAVLink from a new seed each time, and a tally.

    python tests/bench/soak.py                  # 100 rounds from a printed seed
    python tests/bench/soak.py --rounds 5000    # 40 min of an idle core; the figures of docs/performance.md
    python tests/bench/soak.py --seed 4711 --rounds 1     # one round once more

Exit status 1 when a round of this call fails. The suite flies 200 rounds from its own seed, which a run prints:
tests/conformance/test_vehicle_soak.py.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import os
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from support import clock

clock.install()

from support.soak import draw, rounds_flown  # noqa: E402 (the clock comes first)

from anafi_mav.arsdk.link import watchdog  # noqa: E402

watchdog.LIMIT = None

REPORT_EVERY = 100
"""Rounds between two lines of progress."""


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=100)
    options.add_argument("--seed", type=int, default=None, help="of the first round, the others follow")
    options.add_argument("--brief", action="store_true", help="one line per failed round, without its steps")
    given = options.parse_args()
    first = random.SystemRandom().randrange(10**6, 10**9) if given.seed is None else given.seed
    print(f"seeds {first} to {first + given.rounds - 1}", flush=True)
    tally: Counter[str] = Counter()
    began, cpu = time.perf_counter(), time.process_time()
    gc.freeze()  # to collect is cheap then
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + given.rounds):
            os.environ["XDG_STATE_HOME"] = f"{folder}/{seed}"
            with asyncio.Runner(loop_factory=clock.Loop) as runner:
                wrong = runner.run(rounds_flown(seed))
            tally["failed" if wrong else "passed"] += 1
            if wrong:
                print("\n".join([f"{seed}:", *(f"  {text}" for text in wrong)]), flush=True)
            if wrong and not given.brief:
                print(draw(seed), flush=True)
            if (done := seed - first + 1) % REPORT_EVERY == 0:
                left = (given.rounds - done) * (time.perf_counter() - began) / done
                each = (time.process_time() - cpu) / done
                print(f"{done} rounds, {dict(tally)}, {each:.2f} s of CPU each, {left / 60.0:.0f} min left", flush=True)
    spent = time.process_time() - cpu
    print(dict(tally), f"{spent:.0f} s of CPU, {time.perf_counter() - began:.0f} s")
    return 1 if tally["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())

"""How well the velocity loop flies: a step of 5 m/s on every model at MaxTilt 35 degrees, in several winds.

    python tests/bench/velocity.py [--tilt 35] [--speed 5] [--pictures 0.1]

The product flies the simulated models in this process; the figures are from the simulator's true poses. With --pictures
the loop knows attitude and speed from the live video, whose pictures are so many seconds old, and not from events. It
runs on the clock of the tests, so that the figures do not depend on the machine.
"""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from support import clock
from support.steps import velocity_step

from anafi_mav.sim.world.wind import WindSpec

WINDS = {
    "calm": WindSpec(),
    "5 m/s from ahead, steady": WindSpec(5.0, 0.0, gusts=0.0),
    "5 m/s from ahead, gusts of 15 %": WindSpec(5.0, 0.0),
    "5 m/s from behind, gusts of 15 %": WindSpec(5.0, 180.0),
    "5 m/s from the side, gusts of 15 %": WindSpec(5.0, 90.0),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tilt", type=float, default=35.0, help="MaxTilt in degrees")
    parser.add_argument("--speed", type=float, default=5.0, help="the step in m/s")
    parser.add_argument("--pictures", type=float, default=None, metavar="AGE", help="s of a picture's age")
    arguments = parser.parse_args()
    logging.disable(logging.CRITICAL)
    clock.install()
    for name, wind in WINDS.items():
        print(name)
        loop = clock.Loop()
        step = velocity_step(wind, speed=arguments.speed, tilt=arguments.tilt, pictures=arguments.pictures)
        for figures in loop.run_until_complete(step):
            print(f"  {figures}")
        loop.close()


if __name__ == "__main__":
    main()

"""How well the velocity loop flies: a step of 5 m/s on every model at MaxTilt 35 degrees, in several winds.

    python tests/bench/velocity.py [--tilt 35] [--speed 5]

The product flies the simulated models in this process; the figures are from the simulator's true poses.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

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
    arguments = parser.parse_args()
    logging.disable(logging.CRITICAL)
    for name, wind in WINDS.items():
        print(name)
        for figures in asyncio.run(velocity_step(wind, speed=arguments.speed, tilt=arguments.tilt)):
            print(f"  {figures}")


if __name__ == "__main__":
    main()

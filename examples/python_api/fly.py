"""Take off, fly to a place and back, land: a whole flight with `anafi_mav.drone`.

    anafi-mav sim                          # a simulated ANAFI at 127.0.42.1, in one terminal
    python examples/python_api/fly.py      # in another

A real ANAFI is at 192.168.42.1: `python examples/python_api/fly.py 192.168.42.1`, propellers off first.
"""

from __future__ import annotations

import argparse
import asyncio
import math

from anafi_mav.drone import AnafiMavError, Drone, FlyingState, MoveEnd, connect

METRES_PER_DEGREE = 111_195.0
"""m of latitude on a sphere of 6371 km; good to 0.5 % anywhere."""


def report(drone: Drone, what: str) -> None:
    altitude = drone.piloting.state.altitude
    height = "height unknown" if altitude is None else f"{altitude:.1f} m above take-off"
    print(f"{what}: {height}", flush=True)


async def fly(address: str, distance: float, height: float) -> None:
    async with connect(address) as drone:
        print(f"connected: {drone.identity.model.title}, battery {drone.battery.state.percent} %", flush=True)
        if drone.takeoff_blockers():
            raise SystemExit(f"the drone cannot take off: {', '.join(drone.takeoff_blockers())}")

        await drone.piloting.take_off()  # returns when the motors have lifted it
        await drone.wait_for(FlyingState.HOVERING)
        report(drone, "taken off")

        # A relative move: m to the front, to the right and down; the last number turns the drone (rad, clockwise).
        await drone.piloting.move_by(0.0, 0.0, -2.0, 0.0)
        report(drone, "climbed")

        # A place: degrees, degrees, m above the take-off point. It starts and ends in its own time.
        here = drone.gps.state.location
        if here is None:
            raise SystemExit("the drone does not know where it is")
        north = here.latitude + distance / METRES_PER_DEGREE
        move = await drone.piloting.move_to(north, here.longitude, height)
        if await move.result() is not MoveEnd.DONE:
            raise SystemExit("the drone did not reach the place")
        report(drone, f"{distance:g} m north")

        # A half turn, and back.
        await drone.piloting.move_by(0.0, 0.0, 0.0, math.pi)
        move = await drone.piloting.move_to(here.latitude, here.longitude, height)
        if await move.result() is not MoveEnd.DONE:
            raise SystemExit("the drone did not come back")
        report(drone, "back")

        await drone.piloting.land()
        await drone.wait_for(FlyingState.LANDED, timeout=60.0)
        print("landed", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Take off, fly north and back, land.")
    parser.add_argument("address", nargs="?", default="127.0.42.1", help="of the drone (%(default)s, a simulated one)")
    parser.add_argument("--distance", type=float, default=20.0, metavar="M", help="metres to fly (%(default)s)")
    parser.add_argument("--height", type=float, default=8.0, metavar="M", help="above take-off (%(default)s)")
    arguments = parser.parse_args()
    try:
        asyncio.run(fly(arguments.address, arguments.distance, arguments.height))
    except AnafiMavError as error:
        raise SystemExit(f"{type(error).__name__}: {error}") from None


if __name__ == "__main__":
    main()

"""Fly four drones at once, each at a height of its own, from one program.

    anafi-mav sim --count 4                        # 127.0.42.1 to 127.0.42.4, in one terminal
    python examples/python_api/four_drones.py      # in another

Real ANAFIs all have the address 192.168.42.1 in their own Wi-Fi. Give each a Wi-Fi adapter and name it (Linux):
`python examples/python_api/four_drones.py 192.168.42.1%wlan1 192.168.42.1%wlan2`.
"""

from __future__ import annotations

import argparse
import asyncio

from anafi_mav.drone import AnafiMavError, FlyingState, connect

ADDRESSES = ["127.0.42.1", "127.0.42.2", "127.0.42.3", "127.0.42.4"]
LOWEST, STEP = 4.0, 3.0
"""m above take-off of the first drone, and from one drone to the next."""


async def fly(name: str, address: str, height: float) -> None:
    """One drone's flight; the others do the same meanwhile."""
    host, _, interface = address.partition("%")
    async with connect(host, interface=interface or None, name=name) as drone:
        print(f"{name}: connected to {drone.identity.model.title} at {address}", flush=True)
        await drone.piloting.take_off()
        await drone.wait_for(FlyingState.HOVERING)
        here = drone.gps.state.location
        if here is None:
            raise AnafiMavError("the drone does not know where it is")
        climb = await drone.piloting.move_to(here.latitude, here.longitude, height)  # m above its take-off point
        print(f"{name}: climb to {height:g} m: {(await climb.result()).value}", flush=True)
        await drone.piloting.land()
        await drone.wait_for(FlyingState.LANDED, timeout=60.0)
        print(f"{name}: landed", flush=True)


async def fly_all(addresses: list[str]) -> bool:
    """Fly all of them; a failure of one does not end the flights of the others. True when all have landed."""
    names = [f"drone {number}" for number in range(1, len(addresses) + 1)]
    flights = [
        fly(name, address, LOWEST + STEP * index)
        for index, (name, address) in enumerate(zip(names, addresses, strict=True))
    ]
    results = await asyncio.gather(*flights, return_exceptions=True)
    for name, result in zip(names, results, strict=True):
        if isinstance(result, AnafiMavError):
            print(f"{name}: {type(result).__name__}: {result}", flush=True)
        elif isinstance(result, BaseException):
            raise result
    return not any(results)


def main() -> None:
    parser = argparse.ArgumentParser(description="Fly several drones at once.")
    parser.add_argument("addresses", nargs="*", default=ADDRESSES, metavar="ADDRESS", help="of a drone, %%INTERFACE")
    if not asyncio.run(fly_all(parser.parse_args().addresses)):
        raise SystemExit(1)


if __name__ == "__main__":
    main()

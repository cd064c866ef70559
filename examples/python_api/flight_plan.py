"""Upload a flight plan in Parrot's format, fly it and report each item.

    anafi-mav sim --http-port 8080                                 # in one terminal
    python examples/python_api/flight_plan.py --http-port 8080     # in another

`anafi-mav plan convert survey.plan survey.mavlink --model 4k` makes such a file of a plan of QGroundControl. A plan
contains places: the sample flies around the home of the simulated drone, so that another drone needs a file of its own.
"""

from __future__ import annotations

import argparse
import asyncio
from pathlib import Path

from anafi_mav.drone import AnafiMavError, FlyingState, PlayingState, connect
from anafi_mav.drone.events import Message, MissionItemExecuted

SAMPLES = Path(__file__).parents[2] / "missions"
LIMIT = 600.0
"""s for the whole plan."""


async def fly(address: str, http_port: int, file: Path | None) -> None:
    async with connect(address, http_port=http_port) as drone:
        plan = drone.flight_plan
        print(f"connected: {drone.identity.model.title}, flies plans of version {plan.version}", flush=True)
        if file is None:
            file = SAMPLES / f"delivery.v{plan.version}.mavlink"

        uid = await plan.upload(file.read_bytes())
        print(f"uploaded {file.name} as {uid}", flush=True)

        def executed(message: Message, now: float) -> None:
            if isinstance(message, MissionItemExecuted):
                print(f"item {message.idx} done", flush=True)

        drone.subscribe(executed)
        await plan.start(uid)  # returns when the drone flies it
        print("started", flush=True)
        await drone.wait_until(lambda: plan.state.playing == PlayingState.STOPPED, "end of the plan", LIMIT)
        print("plan ended", flush=True)

        if drone.piloting.state.flying not in (FlyingState.LANDING, FlyingState.LANDED):
            await drone.piloting.land()
        await drone.wait_for(FlyingState.LANDED, timeout=120.0)
        print("landed", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Upload a flight plan and fly it.")
    parser.add_argument("address", nargs="?", default="127.0.42.1", help="of the drone (%(default)s, a simulated one)")
    parser.add_argument("file", nargs="?", type=Path, help="in Parrot's format (default: missions/delivery)")
    parser.add_argument("--http-port", type=int, default=80, metavar="PORT", help="of its web server (%(default)s)")
    arguments = parser.parse_args()
    if arguments.file is None and not arguments.address.startswith("127."):
        parser.error("FILE is required: the sample flies around the home of the simulated drone")
    try:
        asyncio.run(fly(arguments.address, arguments.http_port, arguments.file))
    except AnafiMavError as error:
        raise SystemExit(f"{type(error).__name__}: {error}") from None


if __name__ == "__main__":
    main()

"""`anafi-mav ground`: leads ground stations to the drones on a zenoh network.

Each peer of its endpoints is a station of its own there.
"""

from __future__ import annotations

import argparse
import asyncio

from anafi_mav.cli import interrupts, log
from anafi_mav.cli.start_warnings import warnings_of_ground
from anafi_mav.cli.terminal import complain, say_later
from anafi_mav.clock import SystemClock
from anafi_mav.errors import ConfigError
from anafi_mav.fabric.ground import FabricGround
from anafi_mav.mavlink.base import EndpointUrl
from anafi_mav.mavlink.endpoint import parse_endpoint

DEFAULT_ENDPOINT = "udpout://127.0.0.1:14550"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav ground`."""
    parser.add_argument(
        "--zenoh", required=True, metavar="URL", help="the router, as zenoh://HOST:PORT (docs/fabric.md)"
    )
    parser.add_argument(
        "--endpoint", action="append", metavar="URL", help=f"for a ground station ({DEFAULT_ENDPOINT}); repeatable"
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="log more")


def run(arguments: argparse.Namespace) -> int:
    """Run until Ctrl-C or SIGTERM. Raises `ConfigError` before anything is opened."""
    log.set_up(20 if arguments.verbose else 30)
    fabric = _parsed("--zenoh", arguments.zenoh)
    stations = [_parsed("--endpoint", text) for text in arguments.endpoint or [DEFAULT_ENDPOINT]]
    for warning in warnings_of_ground(fabric, stations):
        complain(f"warning: {warning.text}", warning.style)
    interrupts.run(_serve(fabric, stations))
    return 0


def _parsed(option: str, text: str) -> EndpointUrl:
    try:
        return parse_endpoint(text)
    except ConfigError as error:
        raise ConfigError(option, error.problem) from error


async def _serve(fabric: EndpointUrl, stations: list[EndpointUrl]) -> None:
    ground = FabricGround(fabric, stations, SystemClock(), on_systems=_say_systems)
    stop = asyncio.Event()
    interrupts.listen(lambda number: stop.set(), "SIGINT", "SIGTERM")
    await ground.start()
    try:
        for line in ground.lines():
            say_later(line)
        say_later("ready, Ctrl-C ends", "green")
        await stop.wait()
    finally:
        await ground.close()


def _say_systems(sysids: list[int]) -> None:
    say_later(f"systems on the fabric: {', '.join(map(str, sysids)) or 'none'}")

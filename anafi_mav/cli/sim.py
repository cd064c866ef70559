"""`anafi-mav sim`: simulated drones alone, one process for all of them."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import ipaddress
import os
import stat
import sys
import threading
from dataclasses import fields, replace
from pathlib import Path

import msgspec

from anafi_mav.cli import interrupts, log, open_files, options
from anafi_mav.cli.options import integer, number
from anafi_mav.cli.scenarios import load as load_scenario
from anafi_mav.cli.terminal import say
from anafi_mav.errors import ConfigError
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from anafi_mav.sim.scenario import Scenario
from anafi_mav.sim.world import quirks
from anafi_mav.sim.world.model import MODELS
from anafi_mav.sim.world.wind import CALM, WindSpec

MAX_SEED = 2**32 - 1
"""Also of a configuration."""

MAX_COUNT = 254
"""Drones of one process: the hosts of one /24, where their addresses live."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav sim`. Their values are checked by `run`, for one clear line each."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="instead of simulating")
    purpose = "fly the tests of the anafi_ros paper and print measured beside published"
    _add_validate_arguments(actions.add_parser("validate", help=purpose, description=purpose))
    default = DroneSpec()
    parser.add_argument("--model", default=default.model, help=f"which ANAFI: {', '.join(MODELS)} (%(default)s)")
    parser.add_argument("--address", default=default.address, help="of the first drone (%(default)s)")
    parser.add_argument("--count", default="1", metavar="N", help="drones, on consecutive addresses (%(default)s)")
    parser.add_argument(
        "--home",
        default=",".join(f"{part:g}" for part in default.home),
        metavar="LAT,LON,ALT",
        help="where they stand: degrees, degrees, metres above sea level (%(default)s)",
    )
    parser.add_argument("--speed", default="1.0", metavar="FACTOR", help="simulated seconds per second (%(default)s)")
    parser.add_argument("--seed", metavar="N", help="start of the random numbers; same seed, same ids")
    parser.add_argument(
        "--telemetry-rate", default="5", metavar="HZ", help="attitude, speed, altitude per second (%(default)s)"
    )
    parser.add_argument("--protocol", metavar="1|2|3", help="offer only this version of Parrot's transport")
    parser.add_argument("--http-port", default="80", metavar="PORT", help="of each drone's web server (%(default)s)")
    parser.add_argument("--rtsp-port", default="554", metavar="PORT", help="of each drone's video (%(default)s)")
    parser.add_argument(
        "--storage", metavar="SIZE", help="bytes of the memory card, also with k, M or G behind: small ones fill soon"
    )
    parser.add_argument(
        "--skycontroller", metavar="3|4", help="a Skycontroller in front of each drone, which has the address instead"
    )
    parser.add_argument(
        "--wind",
        metavar="SPEED,DIRECTION",
        help="m/s and degrees where it comes from; a third number is the gusts' share",
    )
    parser.add_argument(
        "--firmware-quirk",
        action="append",
        default=[],
        metavar="NAME",
        help=f"let the firmware differ, can be repeated: {quirks.EXPECTED}",
    )
    parser.add_argument("--scenario", type=Path, metavar="FILE", help="YAML: what goes wrong, and when")
    parser.add_argument("--log", type=Path, metavar="FILE", help="write what happens to FILE, one JSON object a line")
    parser.add_argument("--stdin-watch", action="store_true", help="end when stdin closes")
    # For `anafi-mav run`: a JSON object {speed, seed, drones: [{model, address, …}]}, one line on stdin for "-".
    parser.add_argument("--fleet", metavar="FILE", help=argparse.SUPPRESS)


def _add_validate_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav sim validate`."""
    parser.add_argument("--model", default="all", help=f"{', '.join(MODELS)} or all (%(default)s)")
    parser.add_argument(
        "--speed",
        default="1.0",
        metavar="FACTOR",
        help="simulated seconds per second; below 1 a busy machine disturbs less (%(default)s)",
    )
    parser.add_argument(
        "--plots", type=Path, metavar="DIR", help="draw the figures of the paper into DIR (needs matplotlib)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Simulate until SIGINT or SIGTERM. Raises `ConfigError` before anything is started."""
    log.set_up()
    open_files.allow_many()
    if arguments.action == "validate":
        from anafi_mav.cli import sim_validate  # which loads the drone's side too

        return sim_validate.run(arguments)
    if arguments.fleet is not None:
        asyncio.run(_run(_from_fleet(arguments.fleet), arguments.log, arguments.stdin_watch))
        return 0
    fleet = _from_options(arguments)
    try:
        asyncio.run(_run(fleet, arguments.log, arguments.stdin_watch))
    except ConfigError as error:
        if error.key_path.startswith("drones"):  # the only thing about one of them that is found out so late
            raise ConfigError("--address", error.problem) from error
        raise
    return 0


class Fleet(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Drones to be simulated; also the JSON of `--fleet`."""

    drones: list[DroneSpec]
    speed: float = 1.0
    seed: int | None = None
    scenarios: dict[str, str] = {}
    """Path of a scenario file by the address of the drone that it is for."""


def _from_options(arguments: argparse.Namespace) -> Fleet:
    count = integer("--count", arguments.count, f"a number from 1 to {MAX_COUNT}")
    if not 1 <= count <= MAX_COUNT:
        raise ConfigError("--count", f"expected a number from 1 to {MAX_COUNT}, got {count}")
    speed = options.speed(arguments.speed)
    versions = (1, 3)
    if arguments.protocol is not None:
        version = integer("--protocol", arguments.protocol, "1, 2 or 3")
        if version not in (1, 2, 3):
            raise ConfigError("--protocol", f"expected 1, 2 or 3, got {version}")
        versions = (version, version)
    seed = None if arguments.seed is None else _seed(arguments.seed)
    try:
        first = DroneSpec(
            model=arguments.model,
            address=arguments.address,
            home=_home(arguments.home),
            http_port=integer("--http-port", arguments.http_port, "a port from 0 to 65535"),
            rtsp_port=integer("--rtsp-port", arguments.rtsp_port, "a port from 0 to 65535"),
            versions=versions,
            telemetry_rate=number("--telemetry-rate", arguments.telemetry_rate, "events per second"),
            skycontroller=None
            if arguments.skycontroller is None
            else integer("--skycontroller", arguments.skycontroller, "the generation of a Skycontroller, 3 or 4"),
            wind=CALM if arguments.wind is None else _wind(arguments.wind),
            firmware_quirks=tuple(arguments.firmware_quirk),
            storage=None if arguments.storage is None else options.size("--storage", arguments.storage),
        )
    except ConfigError as error:
        raise ConfigError(_flag(error.key_path), error.problem) from None
    try:
        addresses = [str(ipaddress.IPv4Address(first.address) + index) for index in range(count)]
    except ValueError:
        raise ConfigError("--count", f"expected room for {count} addresses from {first.address} on") from None
    paths = {} if arguments.scenario is None else dict.fromkeys(addresses, str(arguments.scenario))
    return Fleet([replace(first, address=address) for address in addresses], speed, seed, paths)


def _seed(text: str) -> int:
    """Return a seed within the bounds of a configuration. Raises `ConfigError`.

    Of a negative one Python would use the amount, so that -1 is 1.
    """
    wanted = f"a whole number from 0 to {MAX_SEED}"
    seed = integer("--seed", text, wanted)
    if not 0 <= seed <= MAX_SEED:
        raise ConfigError("--seed", f"expected {wanted}, got {seed}")
    return seed


def _flag(key_path: str) -> str:
    """The option that a key of `DroneSpec` comes from."""
    return key_path if key_path.startswith("--") else "--" + key_path.replace("_", "-")


def _from_fleet(source: str) -> Fleet:
    try:
        text = sys.stdin.buffer.readline() if source == "-" else Path(source).read_bytes()
        fleet = msgspec.json.decode(text)
        result = msgspec.convert(fleet, Fleet)
    except (OSError, msgspec.DecodeError) as error:
        raise ConfigError("--fleet", f"expected a JSON object with drones in {source}: {error}") from error
    unknown = {key for drone in fleet["drones"] for key in drone} - {field.name for field in fields(DroneSpec)}
    if unknown:
        raise ConfigError("--fleet", f"expected keys of DroneSpec, got {', '.join(sorted(unknown))}")
    return result


def _home(text: str) -> tuple[float, float, float]:
    try:
        latitude, longitude, altitude = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError("--home", f"expected LAT,LON,ALT like 48.8789,2.3677,35, got {text!r}") from None
    return latitude, longitude, altitude


def _wind(text: str) -> WindSpec:
    wanted = "SPEED,DIRECTION or SPEED,DIRECTION,GUSTS like 8,270,0.15"
    parts = text.split(",")
    if len(parts) not in (2, 3):
        raise ConfigError("--wind", f"expected {wanted}, got {text!r}")
    try:
        return WindSpec(*(number("--wind", part, wanted) for part in parts))
    except ConfigError as error:
        raise ConfigError("--wind", error.problem) from None


def _scenarios(fleet: Fleet) -> dict[str, Scenario]:
    """Return the scenario of each drone by its address.

    A file that several drones share is read once.
    """
    addresses = {drone.address for drone in fleet.drones}
    read = {
        path: load_scenario("--scenario", Path(path), addresses) for path in dict.fromkeys(fleet.scenarios.values())
    }
    return {address: read[path] for address, path in fleet.scenarios.items()}


async def _run(fleet: Fleet, log: Path | None, stdin_watch: bool) -> None:
    scenarios = _scenarios(fleet)
    stop = asyncio.Event()
    interrupts.listen(lambda number: stop.set(), "SIGINT", "SIGTERM")
    if stdin_watch:
        _watch_stdin(stop)
    try:
        simulator = Simulator(
            fleet.drones, speed=fleet.speed, seed=fleet.seed, log=log, remember=False, scenarios=scenarios
        )
    except OSError as error:
        raise ConfigError("--log", f"expected a file that can be written, got {log}: {error.strerror}") from error
    async with simulator:
        for drone in simulator.drones:
            say(_line(drone))
        say("ready, Ctrl-C ends", "green")
        ended = asyncio.create_task(simulator.wait())
        stopped = asyncio.create_task(stop.wait())
        await asyncio.wait({ended, stopped}, return_when=asyncio.FIRST_COMPLETED)
        for task in (ended, stopped):
            task.cancel()
        if not stopped.done():
            ended.result()  # raises what went wrong


def _line(drone: SimulatedDrone) -> str:
    """Return the line that describes a drone before a client connects."""
    low, high = drone.spec.versions
    protocol = f"protocol {low}" if low == high else f"protocol {low} to {high}"
    web = drone.http_problem or ("no HTTP" if drone.http_port is None else f"HTTP {drone.http_port}")
    video = drone.rtsp_problem or ("no video" if drone.rtsp_port is None else f"RTSP {drone.rtsp_port}")
    name = f"{drone.identity.name} ({drone.spec.model}, {drone.identity.serial})"
    if drone.spec.skycontroller is not None:
        name += f" behind a Skycontroller {drone.spec.skycontroller}"
    return f"{name} at {drone.address}: discovery {drone.discovery_port}, {protocol}, {web}, {video}"


def _watch_stdin(stop: asyncio.Event) -> None:
    """Set `stop` when stdin ends, so that a parent that dies leaves no simulator behind.

    A thread reads it: not every system's event loop can wait for a pipe.
    """
    loop = asyncio.get_running_loop()
    stdin = sys.stdin.fileno()
    mode = os.fstat(stdin).st_mode
    if not (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(stdin)):
        raise ConfigError("--stdin-watch", "expected stdin to be a pipe or a terminal")  # a file has no end to wait for

    def read() -> None:
        with contextlib.suppress(OSError, RuntimeError):  # RuntimeError: the loop has ended before
            while os.read(stdin, 4096):
                pass
            loop.call_soon_threadsafe(stop.set)

    threading.Thread(target=read, name="stdin", daemon=True).start()

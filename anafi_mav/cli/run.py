"""`anafi-mav run`: the gateway, with a simulator for the configuration's simulated drones."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import math
import os
import signal
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any

import msgspec

from anafi_mav.cli import event_loop, interrupts, log, open_files, run_check, start_warnings
from anafi_mav.cli.addresses import Reservations, spot
from anafi_mav.cli.child import SimulatorProcess
from anafi_mav.cli.heap_freezer import HeapFreezer, frozen_afterwards
from anafi_mav.cli.service_manager import ServiceManager
from anafi_mav.cli.terminal import complain, complain_later, say, say_later
from anafi_mav.config import Config, from_mapping, load
from anafi_mav.errors import ConfigError
from anafi_mav.gateway import Gateway, state_in_use
from anafi_mav.state_lock import read_holder, state_folder
from anafi_mav.units import counted

READY_LIMIT = 15.0
"""s after which "ready" is said though a drone has not answered: its connection takes 3 s at most, its settings and
its states 5 s each."""

ASKED_FOR = 60.0
"""s after a SIGINT in which a second one ends the gateway though drones fly. One of an hour later may be a mistake,
too."""

CLOSE_LIMIT = 9.0
"""s for the last hover (5 s until the drone has confirmed it, 2 s of centred sticks) and the closing of the sockets; a
drone that does not answer must not keep us here."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav run`."""
    parser.add_argument("-c", "--config", type=Path, metavar="FILE", help="the fleet, see docs/configuration.md")
    parser.add_argument(
        "--drone",
        action="append",
        metavar="ADDRESS",
        help="a drone, instead of those of FILE; 192.168.42.1%%wlan1 names the network interface too; repeatable",
    )
    parser.add_argument(
        "--endpoint", action="append", metavar="URL", help="a MAVLink endpoint, instead of those of FILE; repeatable"
    )
    parser.add_argument("--allow-kill", action="store_true", help="let clients cut the motors in the air")
    parser.add_argument(
        "--sim-log", type=Path, metavar="FILE", help="what simulated drones go through, one JSON object a line"
    )
    parser.add_argument("-v", "--verbose", action="count", default=0, help="log more; twice: each message")
    parser.add_argument("--log-file", type=Path, metavar="FILE", help="write the log to FILE, too; 60 MB at most")
    parser.add_argument(
        "--log-format", choices=log.FORMATS, default=log.TEXT, help="of the log: lines for people, or JSON objects"
    )
    parser.add_argument(
        "--check", action="store_true", help="check configuration, keys, ports and folders, and end: exit status 0 or 1"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the gateway until SIGINT or SIGTERM.

    Returns 1 when something could not be kept in the state folder. Raises `ConfigError` before anything is started.
    """
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(arguments.verbose, 2)]
    if arguments.check:
        log.set_up(level, kind=arguments.log_format)
        return _check(arguments)
    log.set_up(level, path=arguments.log_file, kind=arguments.log_format)
    open_files.allow_many()
    try:
        return _serve(arguments)
    except ConfigError as error:
        raise _located(error, arguments) from error


def _check(arguments: argparse.Namespace) -> int:
    """Print a line for each thing that a start needs; 1 when one of them is wrong."""
    try:
        if arguments.log_file is not None:
            log.check("--log-file", arguments.log_file)
        config = configuration(arguments.config, arguments.drone, arguments.endpoint, arguments.allow_kill)
        if arguments.sim_log is not None and any(drone.sim is not None for drone in config.drones):
            log.check("--sim-log", arguments.sim_log)
        findings = asyncio.run(run_check.findings(config, place, lambda error: _located(error, arguments)))
    except ConfigError as error:
        located = _located(error, arguments)
        findings = [run_check.wrong("configuration", str(located), "mend it at that key")]
    for finding in findings:
        say(str(finding), "red" if finding.wrong else "")
    return 1 if any(finding.wrong for finding in findings) else 0


def _located(error: ConfigError, arguments: argparse.Namespace) -> ConfigError:
    """Return the error with the option or the file that its key path is from."""
    for key, option, given in (("drones", "--drone", arguments.drone), ("endpoints", "--endpoint", arguments.endpoint)):
        if given and error.key_path.startswith(key) and not error.source:
            return ConfigError(option, error.problem)
    if arguments.config is None or error.source or not error.key_path or error.key_path.startswith("--"):
        return error
    return ConfigError(error.key_path, error.problem, str(arguments.config))


def _serve(arguments: argparse.Namespace) -> int:
    config = configuration(arguments.config, arguments.drone, arguments.endpoint, arguments.allow_kill)
    for warning in start_warnings.warnings_of(config):
        complain(f"warning: {warning.text}", warning.style)
    problems = event_loop.run(_run(config, arguments.sim_log.absolute() if arguments.sim_log else None))
    for problem in problems:
        complain_later(f"not kept: {problem}")
    return 1 if problems else 0


def configuration(
    path: Path | None, drones: Sequence[str] | None, endpoints: Sequence[str] | None, allow_kill: bool
) -> Config:
    """The file at `path`, or the defaults, with what the command line says instead.

    Raises `ConfigError`.
    """
    config = load(path) if path is not None else Config()
    if drones:
        entries = [{"name": f"drone{sysid}", "sysid": sysid, **spot(text)} for sysid, text in enumerate(drones, 1)]
        ids = {} if config.sysids is None else {"sysids": config.sysids}
        config = msgspec.structs.replace(config, drones=from_mapping({"drones": entries, **ids}).drones)
    if endpoints:
        config = msgspec.structs.replace(config, endpoints=from_mapping({"endpoints": endpoints}).endpoints)
    return msgspec.structs.replace(config, allow_kill=True) if allow_kill else config


class StopSignals:
    """Signal handling: SIGINT, SIGTERM and SIGHUP set `stop`.

    While drones fly a second SIGINT is required.
    """

    def __init__(self) -> None:
        self.stop = asyncio.Event()
        self.flying: Callable[[], list[str]] = list
        self._asked = -math.inf
        """Time of the SIGINT that was answered with the drones in the air, s."""

    def install(self) -> None:
        interrupts.listen(self.receive, "SIGINT", "SIGTERM")
        hang_up = getattr(signal, "SIGHUP", None)  # Windows has none
        if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:  # nohup
            interrupts.listen(self.receive, "SIGHUP")

    def unsaid(self) -> list[str]:
        """Return what drones in the air do after the gateway ends, unless already shown.

        A first SIGINT shows it.
        """
        return [] if self._has_asked else self.flying()

    def receive(self, number: signal.Signals) -> None:
        sentences = self.flying() if number == signal.SIGINT and not self._has_asked else []
        if not sentences:
            self.stop.set()
            return
        self._asked = asyncio.get_running_loop().time()
        for sentence in sentences:
            say_later(sentence, "yellow")
        say_later(f"Ctrl-C once more within {ASKED_FOR:.0f} s ends the gateway all the same", "yellow")

    @property
    def _has_asked(self) -> bool:
        return asyncio.get_running_loop().time() - self._asked < ASKED_FOR


async def _run(config: Config, sim_log: Path | None) -> list[str]:
    """Run the gateway; return what was wrong with its state folder at the end."""
    signals = StopSignals()
    signals.install()
    folder = state_folder(config.state)
    holder = read_holder(folder)
    if folder is not None and holder is not None:  # before its simulated drones are found in the way
        raise state_in_use(folder, holder)
    async with contextlib.AsyncExitStack() as stack:
        manager = stack.enter_context(ServiceManager(os.environ))  # signs of life go on while the gateway closes
        gateway_config, fleet = place(config, stack.enter_context(Reservations()))
        freezer = stack.enter_context(contextlib.closing(HeapFreezer()))
        gateway = Gateway(gateway_config, on_first_connection=freezer.request)
        signals.flying = gateway.drones_in_air  # it serves clients before it is ready, and a drone may fly already
        if await _unless(signals.stop, _start(gateway, fleet, sim_log, stack)):
            for line in gateway.lines():
                say_later(line)
            say_later("ready, Ctrl-C ends", "green")
            manager.ready(counted(len(gateway.systems), "drone"))
            await signals.stop.wait()
        manager.stopping()
        for sentence in signals.unsaid():
            say_later(sentence, "yellow")
        problems = gateway.state_problems()  # while its drones are there
    # What is last written is written while the gateway closes.
    return [*problems, *(problem for problem in gateway.state_problems() if problem not in problems)]


async def _start(
    gateway: Gateway, fleet: dict[str, Any] | None, sim_log: Path | None, stack: contextlib.AsyncExitStack
) -> None:
    await gateway.open()  # first, so that a busy port is reported before a simulator has been started
    stack.push_async_callback(_close, gateway)
    if fleet is not None:
        if sim_log is not None:
            _check_log(sim_log)
        simulator = SimulatorProcess()
        stack.push_async_callback(simulator.close)
        await simulator.start(fleet, sim_log)
        names = ", ".join(drone["name"] for drone in fleet["drones"])
        death = asyncio.create_task(_tell_death(simulator, names))
        stack.callback(death.cancel)
        stack.push_async_callback(_close, gateway)  # before the simulator: the last hover has to reach it
    with frozen_afterwards():
        await gateway.start()
    await gateway.ready(READY_LIMIT)


def _check_log(path: Path) -> None:
    """Raises `ConfigError` for a file that the simulator could not write."""
    try:
        path.open("wb").close()
    except OSError as error:
        raise ConfigError("--sim-log", f"expected a file that can be written, got {path}: {error.strerror}") from error


async def _unless(stop: asyncio.Event, work: Coroutine[Any, Any, None]) -> bool:
    """Do `work`; when `stop` is set before it is done, abandon it and return False."""
    doing, stopped = asyncio.create_task(work), asyncio.create_task(stop.wait())
    try:
        await asyncio.wait({doing, stopped}, return_when=asyncio.FIRST_COMPLETED)
        if doing.done():
            doing.result()
        return doing.done()
    finally:
        doing.cancel()
        stopped.cancel()
        await asyncio.gather(doing, stopped, return_exceptions=True)


async def _close(gateway: Gateway) -> None:
    try:
        await asyncio.wait_for(gateway.close(), CLOSE_LIMIT)
    except asyncio.TimeoutError:
        complain_later(f"the gateway did not close within {CLOSE_LIMIT:g} s, leaving it")


async def _tell_death(simulator: SimulatorProcess, names: str) -> None:
    status = await simulator.wait()
    how = f"by signal {-status}" if status < 0 else f"with status {status}"
    complain_later(f"the simulator ended {how}; with it went {names}")


def place(config: Config, reservations: Reservations) -> tuple[Config, dict[str, Any] | None]:
    """Give each simulated drone an address. Raises `ConfigError`.

    Returns the configuration for the gateway, which knows addresses only, and the fleet for the simulator, if any.
    """
    if all(drone.sim is None for drone in config.drones):
        return config, None
    from anafi_mav.cli import simulated_drones  # with the simulator: a tenth of the gateway's memory

    return simulated_drones.place(config, reservations)

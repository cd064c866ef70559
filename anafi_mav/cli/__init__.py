"""Command line: one small module for each subcommand.

Each module has `add_arguments(parser)` and `run(arguments)`. It is imported when its command is called, so that a
simulator does not load the MAVLink side.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Sequence
from typing import Protocol, cast

from anafi_mav import __version__
from anafi_mav.cli.terminal import END_LIMIT, STDOUT_WRITER, complain, has_lost_output
from anafi_mav.errors import AnafiMavError, ConfigError

DONE, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130
"""Exit statuses. 2 is also argparse's for a wrong option; 130 is a shell's for "ended by Ctrl-C"."""

COMMANDS = {
    "run": "be the gateway: real and simulated drones become MAVLink systems (the default)",
    "sim": "simulated drones alone, on Parrot's own wire protocol",
    "discover": "look for drones and Skycontrollers on every network interface; prints a configuration",
    "plan": "check, convert, show and draw flight plans; upload, download and fly them",
    "media": "list, download and delete the photos and videos of a drone",
    "status": "show the drones, clients, rates and refused commands of a running gateway",
    "replay": "play a recorded session, or any tlog, to a ground station",
    "ground": "lead ground stations to the drones of all gateways on a zenoh network",
    "info": "connect to one drone and print model, battery, features and limits",
    "keygen": "make a key for signed endpoints, show it, or return to the one before it",
    "doctor": "examine the way to one drone: what is wrong, and how to mend it",
}
"""Name of a command, which is the name of its module in this folder, and what it does."""


class Subcommand(Protocol):
    """Interface of each subcommand's module."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the options of the command."""

    def run(self, arguments: argparse.Namespace) -> int:
        """Do it; returns the exit status.

        Raises `AnafiMavError` for what one line on stderr explains.
        """


def main(argv: Sequence[str] | None = None, *, imported: Callable[[], None] = lambda: None) -> int:
    """Run the command line `argv` (without the program's name); returns the exit status.

    `imported` is called when the command is imported, before it runs.
    """
    words = _with_command(list(sys.argv[1:] if argv is None else argv))
    parser = argparse.ArgumentParser(prog="anafi-mav", description="Parrot ANAFI drones as MAVLink systems.")
    parser.add_argument("--version", action="version", version=f"anafi-mav {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    command: Subcommand | None = None
    for name, purpose in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=purpose, description=purpose[0].upper() + purpose[1:] + ".")
        if name == words[0]:
            command = cast(Subcommand, importlib.import_module(f"{__name__}.{name}"))
            command.add_arguments(subparser)
    arguments = parser.parse_args(words)
    assert command is not None, "argparse has ended the program"
    imported()
    try:
        try:
            status = command.run(arguments)
        finally:
            STDOUT_WRITER.wait(END_LIMIT)
        return FAILED if status == DONE and has_lost_output() else status
    except ConfigError as error:
        complain(str(error))
        return MISUSED
    except AnafiMavError as error:
        complain(str(error))
        return FAILED
    except KeyboardInterrupt:  # before the command could make its own arrangements
        return INTERRUPTED


def _with_command(words: list[str]) -> list[str]:
    """Without a command it is `run`: `anafi-mav`, `anafi-mav -c fleet.yaml`."""
    asks_for_help = words and words[0] in ("-h", "--help", "--version")
    if not words or (words[0].startswith("-") and not asks_for_help):
        return ["run", *words]
    return words

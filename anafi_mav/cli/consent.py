"""Permission to connect to a drone, because a handshake disconnects its present controller.

This happens in the air too. Whether another controller is connected cannot be known before the handshake. So `info`
and `doctor` ask first, and without a terminal they connect only with `--take`. They never connect to a drone that a
gateway of this host holds.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from typing import NamedTuple

from anafi_mav.errors import ConfigError
from anafi_mav.state_lock import HeldDrone, Holder, find_holder, state_folder

WARNING = "connecting takes the drone from any controller that has it, in the air too"

GATEWAY_RETRIES = "; end that gateway first, or ask it by MAVLink"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of a command that may connect."""
    parser.add_argument("--take", action="store_true", help=f"connect without asking: {WARNING}")
    parser.add_argument(
        "--state", metavar="FOLDER", help="state folder of a gateway on this machine, whose drones are left to it"
    )


class Held(NamedTuple):
    """A gateway of this machine holds the drone."""

    holder: Holder
    drone: HeldDrone

    def __str__(self) -> str:
        doing = f"connected to {self.drone.serial}" if self.drone.serial else "not connected, trying"
        return f"{self.holder.title} holds it as {self.drone.name} ({doing})"


def holder_of(state: str | None) -> Holder | None:
    """Return the gateway that holds a state folder now; None where none does.

    Raises `ConfigError` where that cannot be known.
    """
    folder = state_folder(state)
    try:
        return None if folder is None else find_holder(folder)
    except OSError as error:
        problem = f"expected a folder that this user can read, got {folder}: {error.strerror}"
        raise ConfigError("--state", problem) from error


def gateway_of(state: str | None, address: str, interface: str | None, serial: str = "") -> Held | None:
    """Return the gateway of a state folder that has the drone with this address or serial.

    Raises `ConfigError` where it cannot be known which drones the gateway has.
    """
    holder = holder_of(state)
    if holder is not None and holder.pid == 0:
        raise ConfigError("--state", f"{holder.title} runs here, and its drones are not known; end it first")
    drone = None if holder is None else holder.find(address, interface, serial)
    return None if holder is None or drone is None else Held(holder, drone)


def may_connect(address: str, *, take: bool) -> bool | None:
    """Return whether the user wants to connect; None where there is no terminal to ask at."""
    if take:
        return True
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return None
    return confirmed(f"{WARNING}. Connect to {address}?")


def confirmed(question: str) -> bool:
    """Return whether the user answers yes at the terminal."""
    print(f"anafi-mav: {question} [y/N] ", end="", file=sys.stderr, flush=True)
    with contextlib.suppress(EOFError):
        return input().strip().lower() in ("y", "yes")
    return False

"""`anafi-mav media`: photos and videos of a drone, listed, downloaded and deleted.

They are requested from the web server of the running gateway, because a drone has one controller and its gateway
shares the drone's small web server among all readers.
"""

from __future__ import annotations

import argparse
import asyncio
import importlib
import logging
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, cast

from anafi_mav.cli import interrupts, log
from anafi_mav.cli.plan_options import json_argument

GATEWAY = "127.0.0.1:8088"
"""Web server of a gateway with the default configuration."""


class MediaAction(NamedTuple):
    """One thing to do with media: the coroutine function of its name in `media_transfer`."""

    purpose: str
    add_arguments: Callable[[argparse.ArgumentParser], None]


def drone_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that name the drone."""
    parser.add_argument("--gateway", metavar="HOST:PORT", help=f"web server of the gateway ({GATEWAY})")
    parser.add_argument("--sysid", metavar="N", help="system id of the drone; left out: the only one that is connected")


def choice_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the names of files."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="file, or day as 2026-11-22; left out: everything")


def list_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav media list`."""
    choice_arguments(parser)
    drone_arguments(parser)
    json_argument(parser)


def download_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav media download`."""
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="files become FOLDER/<day>/<file>")
    choice_arguments(parser)
    drone_arguments(parser)


def delete_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav media delete`."""
    choice_arguments(parser)
    parser.add_argument("--all", action="store_true", help="delete everything; needs no NAME")
    parser.add_argument("--yes", action="store_true", help="delete without asking")
    drone_arguments(parser)


ACTIONS = {
    "list": MediaAction("list photos and videos", list_arguments),
    "download": MediaAction(
        "copy photos and videos to a folder, each with a JSON file of its time and place", download_arguments
    ),
    "delete": MediaAction("delete photos and videos on the drone", delete_arguments),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav media`."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, action in ACTIONS.items():
        purpose = f"{action.purpose[0].upper()}{action.purpose[1:]}."
        action.add_arguments(actions.add_parser(name, help=action.purpose, description=purpose))


def run(arguments: argparse.Namespace) -> int:
    """Run the action.

    Raises `ConfigError` for a wrong option, other errors of ours when the drone is out of reach.
    """
    log.set_up(logging.ERROR)
    module = importlib.import_module("anafi_mav.cli.media_transfer")
    action = cast(Callable[[argparse.Namespace], asyncio.Future[int]], getattr(module, f"{arguments.action}_media"))
    return interrupts.run(_awaited(action, arguments))


async def _awaited(action: Callable[[argparse.Namespace], asyncio.Future[int]], arguments: argparse.Namespace) -> int:
    return await action(arguments)

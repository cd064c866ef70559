"""`anafi-mav plan`: flight plans in files and on vehicles.

Files: `plan_files`; vehicles: `plan_link`, `plan_fly`.
"""

from __future__ import annotations

import argparse
import importlib
import logging
from collections.abc import Callable
from typing import NamedTuple, cast

from anafi_mav.cli import interrupts, log, plan_options


class PlanAction(NamedTuple):
    """One thing to do with a plan: the function of its name in a module of this folder."""

    purpose: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    module: str


ACTIONS = {
    "check": PlanAction("say what would go wrong with a plan on a drone", plan_options.check_arguments, "plan_files"),
    "show": PlanAction("print a plan as a table", plan_options.show_arguments, "plan_files"),
    "convert": PlanAction(
        "write a plan in another format and list what that cannot hold", plan_options.convert_arguments, "plan_files"
    ),
    "plot": PlanAction("draw a plan: a map, and its heights", plan_options.plot_arguments, "plan_files"),
    "upload": PlanAction("hand a plan to a vehicle", plan_options.upload_arguments, "plan_link"),
    "download": PlanAction(
        "fetch mission, fence and rally points of a vehicle", plan_options.download_arguments, "plan_link"
    ),
    "fly": PlanAction(
        "hand a plan to a vehicle, begin it and follow it; starts the motors", plan_options.upload_arguments, "plan_fly"
    ),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan`."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, action in ACTIONS.items():
        purpose = f"{action.purpose[0].upper()}{action.purpose[1:]}."
        action.add_arguments(actions.add_parser(name, help=action.purpose, description=purpose))


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Raises `PlanError` for an invalid plan, `ConfigError` for a wrong option."""
    log.set_up(logging.ERROR)  # the state of an endpoint is printed when it matters
    name = ACTIONS[arguments.action].module
    module = importlib.import_module(f"anafi_mav.cli.{name}")
    if name == "plan_files":  # the others run a loop, which has its own arrangements
        interrupts.raise_on_interrupt()
    return cast(Callable[[argparse.Namespace], int], getattr(module, arguments.action))(arguments)

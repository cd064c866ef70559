"""`anafi-mav plan`: flight plans as files (`plan_files`) and on vehicles (`plan_link`)."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

from anafi_mav.cli import plan_files


class Action(NamedTuple):
    """One thing to do with a plan."""

    purpose: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


ACTIONS = {
    "show": Action("print a plan as a table", plan_files.show_arguments, plan_files.show),
    "convert": Action(
        "write a plan in another format and tell what that cannot hold",
        plan_files.convert_arguments,
        plan_files.convert,
    ),
    "plot": Action("draw a plan: a map, and its heights", plan_files.plot_arguments, plan_files.plot),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan`."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, action in ACTIONS.items():
        purpose = f"{action.purpose[0].upper()}{action.purpose[1:]}."
        action.add_arguments(actions.add_parser(name, help=action.purpose, description=purpose))


def run(arguments: argparse.Namespace) -> int:
    """Do it. Raises `PlanError` for a plan that is none, `ConfigError` for a wrong option."""
    return ACTIONS[arguments.action].run(arguments)

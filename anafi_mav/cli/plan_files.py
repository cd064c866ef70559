"""`anafi-mav plan check|convert|show|plot`: plans as files, without a drone."""

from __future__ import annotations

import argparse
from pathlib import Path

from anafi_mav.cli.plan_options import PARROT, limits, load, target_format, version
from anafi_mav.cli.terminal import say
from anafi_mav.errors import ConfigError
from anafi_mav.plans import files, table
from anafi_mav.plans import plot as drawing
from anafi_mav.plans.check import Severity
from anafi_mav.plans.check import check as lint
from anafi_mav.plans.files import Format
from anafi_mav.plans.models import MODELS
from anafi_mav.plans.plan import Plan
from anafi_mav.plans.twin import twin


def show(arguments: argparse.Namespace) -> int:
    """Print what is in it."""
    plan = load(arguments)
    say(f"{arguments.file.name}: {table.summary(plan)}")
    for line in table.lines(plan) if plan.items else ():
        say(line)
    return 0


def check(arguments: argparse.Namespace) -> int:
    """Say what would go wrong with it; 1 when it would."""
    if version(arguments.model) is None:
        raise ConfigError("--model", f"expected the drone that is to fly it, one of {', '.join(MODELS)}")
    model, plan, name = MODELS[arguments.model], load(arguments), arguments.file.name
    findings = lint(plan, model, limits(arguments))
    for problem in findings.problems:
        style = "red" if problem.severity is Severity.ERROR else "yellow"
        say(f"{name}: {problem.severity.value}: {problem}", style)
    if findings.errors:
        return 1
    way = "" if findings.distance is None else f", {findings.distance:.0f} m"
    time = "" if findings.seconds is None else f" in about {_time(findings.seconds)}"
    say(f"{name}: an {model.name} flies it{way}{time}", "green")
    return 0


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def convert(arguments: argparse.Namespace) -> int:
    """Write it anew. What is lost by that is no error: it is said."""
    target_format(arguments.out, arguments.model)
    store(load(arguments), arguments, arguments.file)
    return 0


def store(plan: Plan, arguments: argparse.Namespace, source: Path) -> None:
    """Write a plan to `arguments.out` and say what that does not hold. Raises `PlanError` and `ConfigError`.

    A drone gets what it can fly, translated, unless it is one of its own files already.
    """
    out, form = arguments.out, target_format(arguments.out, arguments.model)
    model = version(arguments.model)
    if form in (Format.PARROT_1, Format.PARROT_2) and model is not None and source.suffix.lower() != PARROT:
        data, losses = twin(plan, model, source.name)
    else:
        data, losses = files.encode(plan, form)
    files.put(data, out)
    for loss in losses:
        say(f"not kept: {loss}", "yellow")
    say(f"{out.name}: {table.summary(files.parse(data, out.name, model or 2))}")


def plot(arguments: argparse.Namespace) -> int:
    """Draw it."""
    plan = load(arguments)
    try:
        drawing.draw(plan, arguments.file.name, arguments.output)
    except ImportError as error:
        raise ConfigError("plot", "expected matplotlib to be installed: pip install 'anafi-mav[plots]'") from error
    say(f"drawn {arguments.output}")
    return 0

"""`anafi-mav plan check|convert|show|plot`: plans as files, without a drone."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from anafi_mav import config
from anafi_mav.cli.consent import confirmed
from anafi_mav.cli.plan_options import PARROT, height_of, limits, load, target_format, version
from anafi_mav.cli.terminal import say, say_json, say_table
from anafi_mav.errors import ConfigError, PlanError
from anafi_mav.models import Model, planned
from anafi_mav.plans import plot as drawing
from anafi_mav.plans import table
from anafi_mav.plans.formats import files
from anafi_mav.plans.formats.files import Format
from anafi_mav.plans.plan import FenceCircle, Plan
from anafi_mav.plans.translation.check import Findings, FindingSeverity
from anafi_mav.plans.translation.check import check as lint
from anafi_mav.plans.translation.parrot_export import export_parrot


def show(arguments: argparse.Namespace) -> int:
    """Print what is in it."""
    plan = load(arguments)
    if arguments.json:
        say_json({"file": arguments.file.name, **_facts(plan)})
        return 0
    say(f"{arguments.file.name}: {table.summary(plan)}")
    if plan.items:
        rows = [row.columns() for row in table.rows_of(plan)]
        say_table(table.HEAD.columns(), rows, right=table.NUMBERS)
    return 0


def _facts(plan: Plan) -> dict[str, Any]:
    """A plan as plain values; heights as its formats have them."""
    return {
        "items": [
            {
                "item": number,
                "command": item.command,
                "name": table.name_of(item.command),
                "frame": item.frame,
                "params": item.params,
                "autocontinue": item.autocontinue,
            }
            for number, item in enumerate(plan.items)
        ],
        "home": None if plan.home is None else asdict(plan.home),
        "fence": [
            {"kind": "circle" if isinstance(zone, FenceCircle) else "polygon", **asdict(zone)} for zone in plan.zones
        ],
        "breach_return": None if plan.breach_return is None else asdict(plan.breach_return),
        "rally": [asdict(point) for point in plan.rally],
        "drawn": [{"kind": block.kind, "first": block.first, "count": block.count} for block in plan.blocks],
    }


def check(arguments: argparse.Namespace) -> int:
    """Report the problems of a plan on one model, on those of a fleet, or on all.

    Returns 1 when one of them has an error. A Parrot file is for one kind of drone and does not name it: 1 when
    none of the models flies it.
    """
    name, plans, settings = arguments.file.name, _plans(arguments), limits(arguments)
    findings = {model: lint(plan, model, settings) for model, plan in plans.items()}
    if arguments.json:
        say_json({"file": name, "models": {model.title: _result(found) for model, found in findings.items()}})
    else:
        _tell(name, findings)
    wrong = [found.errors for found in findings.values()]
    return int(all(wrong) if arguments.file.suffix.lower() == PARROT else any(wrong))


def _plans(arguments: argparse.Namespace) -> dict[Model, Plan]:
    """The plan as each model would read it. Raises `PlanError` when none can, `ConfigError`."""
    data, source = files.read(arguments.file), arguments.file.name
    height, models = height_of(arguments), _models(arguments)
    if arguments.file.suffix.lower() != PARROT:
        plan = files.parse(data, source, models[0].plans().version, height)
        return dict.fromkeys(models, plan)
    plans, problems = {}, []
    for model in models:
        try:
            plans[model] = files.parse(data, source, model.plans().version, height)
        except PlanError as error:
            problems.append(error)
    if not plans:
        raise problems[0]
    return plans


def _models(arguments: argparse.Namespace) -> list[Model]:
    """The models that a plan is checked for. Raises `ConfigError`."""
    if version(arguments.model) is not None:
        return [planned()[arguments.model]]
    if arguments.config is None:
        return list(planned().values())
    fleet = config.load(arguments.config)
    keys = {drone.sim.model for drone in fleet.drones if drone.sim is not None}
    if any(drone.sim is None for drone in fleet.drones):  # of a real one only its address is known
        return list(planned().values())
    return [model for key, model in planned().items() if key in keys]


def _result(found: Findings) -> dict[str, Any]:
    return {
        "flies": not found.errors,
        "distance_m": found.distance,
        "seconds": found.seconds,
        "problems": [
            {"severity": problem.severity.value, "item": problem.item, "what": problem.what}
            for problem in found.problems
        ],
    }


def _tell(name: str, findings: dict[Model, Findings]) -> None:
    """Each problem once, with the models that have it unless all have."""
    problems = dict.fromkeys(problem for found in findings.values() for problem in found.problems)
    for problem in sorted(problems, key=lambda one: (one.item is None, one.item or 0)):
        having = [model.title for model, found in findings.items() if problem in found.problems]
        which = "" if len(having) == len(findings) else f"{', '.join(having)}: "
        style = "red" if problem.severity is FindingSeverity.ERROR else "yellow"
        say(f"{name}: {which}{problem.severity.value}: {problem}", style)
    for model, found in findings.items():
        if not found.errors:
            way = "" if found.distance is None else f", {found.distance:.0f} m"
            time = "" if found.seconds is None else f" in about {_time(found.seconds)}"
            say(f"{name}: an {model.title} flies it{way}{time}", "green")


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def convert(arguments: argparse.Namespace) -> int:
    """Write it in another format. Losses are printed, and are no error."""
    plan = load(arguments)
    target_format(arguments.out, arguments.model)
    store(plan, arguments, arguments.file)
    return 0


def store(plan: Plan, arguments: argparse.Namespace, source: Path) -> None:
    """Write a plan to `arguments.out` and say what that does not hold.

    Raises `PlanError` and `ConfigError`.

    A drone gets what it can fly, translated, unless it is one of its own files already.
    """
    out, form = arguments.out, target_format(arguments.out, arguments.model)
    model = version(arguments.model)
    if form in (Format.PARROT_1, Format.PARROT_2) and model is not None and source.suffix.lower() != PARROT:
        data, losses = export_parrot(plan, model, source.name)
    else:
        data, losses = files.encode(plan, form)
    may_replace(out, force=arguments.force)
    files.put(data, out)
    for loss in losses:
        say(f"not kept: {loss}", "yellow")
    say(f"{out.name}: {table.summary(files.parse(data, out.name, model or 2))}")


def may_replace(out: Path, *, force: bool) -> None:
    """Ask before a file is replaced.

    Raises `ConfigError` where there is no terminal to ask at, or the answer is no.
    """
    if not out.exists() or force:
        return
    if not out.is_file():
        raise ConfigError("OUT", f"expected the name of a file, got {out}")
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise ConfigError("OUT", f"{out} exists: --force replaces it")
    if not confirmed(f"{out} exists. Replace it?"):
        raise ConfigError("OUT", f"{out} is left as it was")


def plot(arguments: argparse.Namespace) -> int:
    """Draw it."""
    plan = load(arguments)
    if arguments.output is None:
        raise ConfigError("--output", f"expected the picture's file, one of {', '.join(drawing.SUFFIXES)}")
    try:
        drawing.draw(plan, arguments.file.name, arguments.output)
    except ImportError as error:
        raise ConfigError("plot", "expected matplotlib to be installed: pip install 'anafi-mav[plots]'") from error
    say(f"drawn {arguments.output}")
    return 0

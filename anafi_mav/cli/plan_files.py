"""`anafi-mav plan show|convert|plot`: plans as files, without a drone."""

from __future__ import annotations

import argparse
from pathlib import Path

from anafi_mav.cli import options
from anafi_mav.cli.terminal import say
from anafi_mav.errors import ConfigError
from anafi_mav.plans import files, table
from anafi_mav.plans import plot as drawing
from anafi_mav.plans.files import Format
from anafi_mav.plans.parrot import Version
from anafi_mav.plans.plan import Plan

VERSIONS: dict[str, Version] = {"4k": 1, "thermal": 1, "usa": 1, "ai": 2}
"""Of Parrot's files, by the model that flies them."""

PARROT = ".mavlink"

MAX_HEIGHT = 1000.0
"""m above take-off that a line may be flown at; the drones' own ceilings are far below."""


def source_arguments(parser: argparse.ArgumentParser) -> None:
    """The plan that is read, and what its file may leave open."""
    parser.add_argument("file", type=Path, metavar="FILE", help=".plan, .waypoints, .mavlink, .kml or .geojson")
    parser.add_argument(
        "--model",
        metavar="MODEL",
        help=f"the ANAFI that a .mavlink file is for: {', '.join(VERSIONS)}; the file itself does not say",
    )
    parser.add_argument("--height", metavar="M", help="above take-off, of a line that was drawn on a map")


def load(arguments: argparse.Namespace) -> Plan:
    """The plan that the arguments name. Raises `PlanError` and `ConfigError`."""
    model = version(arguments.model)
    if model is None and arguments.file.suffix.lower() == PARROT:
        raise ConfigError("--model", f"expected one of {', '.join(VERSIONS)}: a {PARROT} file does not say its drone")
    height = None
    if arguments.height is not None:
        wanted = f"metres above take-off, up to {MAX_HEIGHT:g}"
        height = options.number("--height", arguments.height, wanted)
        if not 0.0 < height <= MAX_HEIGHT:
            raise ConfigError("--height", f"expected {wanted}, got {arguments.height}")
    return files.load(arguments.file, model or 2, height)


def version(model: str | None) -> Version | None:
    """Of the files that a model flies. Raises `ConfigError`."""
    if model is None:
        return None
    if model not in VERSIONS:
        raise ConfigError("--model", f"expected one of {', '.join(VERSIONS)}, got {model!r}")
    return VERSIONS[model]


def show_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan show`."""
    source_arguments(parser)


def show(arguments: argparse.Namespace) -> int:
    """Print what is in it."""
    plan = load(arguments)
    say(f"{arguments.file.name}: {table.summary(plan)}")
    for line in table.lines(plan) if plan.items else ():
        say(line)
    return 0


def convert_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan convert`."""
    source_arguments(parser)
    parser.add_argument("out", type=Path, metavar="OUT", help="its ending says the format")


def convert(arguments: argparse.Namespace) -> int:
    """Write it anew. What is lost by that is no error: it is said."""
    form = target_format(arguments.out, arguments.model)
    plan = load(arguments)
    losses = files.save(plan, arguments.out, form)
    for loss in losses:
        say(f"not kept: {loss}", "yellow")
    say(f"{arguments.out.name}: {table.summary(files.load(arguments.out, version(arguments.model) or 2))}")
    return 0


def target_format(path: Path, model: str | None) -> Format:
    """What a file of this name is to be. Raises `ConfigError`."""
    suffix = path.suffix.lower()
    if suffix == PARROT:
        found = version(model)
        if found is None:
            raise ConfigError("--model", f"expected one of {', '.join(VERSIONS)}, for a {PARROT} file is for one drone")
        return Format.PARROT_1 if found == 1 else Format.PARROT_2
    if suffix not in files.SUFFIXES:
        endings = ", ".join([*files.SUFFIXES, PARROT])
        raise ConfigError("OUT", f"expected a file that ends in one of {endings}, got {path.name!r}")
    return files.SUFFIXES[suffix]


def plot_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan plot`."""
    source_arguments(parser)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help=f"one of {', '.join(drawing.SUFFIXES)}"
    )


def plot(arguments: argparse.Namespace) -> int:
    """Draw it."""
    plan = load(arguments)
    try:
        drawing.draw(plan, arguments.file.name, arguments.output)
    except ImportError as error:
        raise ConfigError("plot", "expected matplotlib to be installed: pip install 'anafi-mav[plots]'") from error
    say(f"drawn {arguments.output}")
    return 0

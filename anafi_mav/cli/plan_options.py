"""Options of the actions of `anafi-mav plan`, and the files that they name.

Apart from the actions, so that a table of a file does not wait for MAVLink's dialect to be loaded.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from anafi_mav.cli import options
from anafi_mav.errors import ConfigError
from anafi_mav.models import planned
from anafi_mav.plans import plot
from anafi_mav.plans.formats import files
from anafi_mav.plans.formats.files import Format
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.plan import Plan
from anafi_mav.plans.translation.check import FlightLimits

PARROT = ".mavlink"

MAX_HEIGHT = 1000.0
"""m above take-off that a line may be flown at; the drones' own ceilings are far below."""


ENDPOINT = "tcpout://127.0.0.1:5760"
"""Endpoint at which a gateway with the default configuration serves any number of clients."""

FAR = 10_000.0
"""m: more is no setting of a drone."""

MAX_SYSID = 255


def source_arguments(parser: argparse.ArgumentParser) -> None:
    """The plan that is read, and what its file may leave open."""
    parser.add_argument("file", type=Path, metavar="FILE", help=".plan, .waypoints, .mavlink, .kml or .geojson")
    model_argument(parser)
    parser.add_argument("--height", metavar="M", help="above take-off, of a line that was drawn on a map")


def model_argument(parser: argparse.ArgumentParser) -> None:
    """The drone that a Parrot file is for."""
    parser.add_argument(
        "--model",
        metavar="MODEL",
        help=f"the ANAFI that a .mavlink file is for: {', '.join(planned())}; the file itself does not say",
    )


def load(arguments: argparse.Namespace) -> Plan:
    """The plan that the arguments name.

    Raises `PlanError`, and only then `ConfigError` for an option.
    """
    data = files.read(arguments.file)
    model = version(arguments.model)
    if model is None and arguments.file.suffix.lower() == PARROT:
        raise ConfigError("--model", f"expected one of {', '.join(planned())}: a {PARROT} file does not say its drone")
    return files.parse(data, arguments.file.name, model or 2, height_of(arguments))


def height_of(arguments: argparse.Namespace) -> float | None:
    """The height of a line on a map, m above take-off. Raises `ConfigError`."""
    height = None
    if arguments.height is not None:
        wanted = f"metres above take-off, up to {MAX_HEIGHT:g}"
        height = options.number("--height", arguments.height, wanted)
        if not 0.0 < height <= MAX_HEIGHT:
            raise ConfigError("--height", f"expected {wanted}, got {arguments.height}")
    return height


def version(model: str | None) -> Version | None:
    """Of the files that a model flies. Raises `ConfigError`."""
    if model is None:
        return None
    known = planned()
    if model not in known:
        raise ConfigError("--model", f"expected one of {', '.join(known)}, got {model!r}")
    return known[model].plans().version


def out_argument(parser: argparse.ArgumentParser) -> None:
    """The file that is written."""
    parser.add_argument("out", type=Path, metavar="OUT", help="its ending says the format")


def target_format(path: Path, model: str | None) -> Format:
    """Return the format of a file by its name. Raises `ConfigError`."""
    suffix = path.suffix.lower()
    if suffix == PARROT:
        found = version(model)
        if found is None:
            raise ConfigError(
                "--model", f"expected one of {', '.join(planned())}, for a {PARROT} file is for one drone"
            )
        return Format.PARROT_1 if found == 1 else Format.PARROT_2
    if suffix not in files.SUFFIXES:
        endings = ", ".join([*files.SUFFIXES, PARROT])
        raise ConfigError("OUT", f"expected a file that ends in one of {endings}, got {path.name!r}")
    return files.SUFFIXES[suffix]


def check_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan check`."""
    usual = FlightLimits()
    source_arguments(parser)
    parser.add_argument(
        "-c", "--config", type=Path, metavar="FILE", help="check for the models of this fleet; left out: for all"
    )
    json_argument(parser)
    parser.add_argument(
        "--max-altitude",
        default=f"{usual.max_altitude:g}",
        metavar="M",
        help="what the drone is set to, above take-off (%(default)s)",
    )
    parser.add_argument("--max-distance", metavar="M", help="of the drone's own geofence; left out: it is off")
    parser.add_argument(
        "--return-height",
        default=f"{usual.return_height:g}",
        metavar="M",
        help="that the drone returns home at, above take-off (%(default)s)",
    )


def limits(arguments: argparse.Namespace) -> FlightLimits:
    """Return the limits that are set on the drone. Raises `ConfigError`."""

    def metres(flag: str, text: str) -> float:
        wanted = f"metres, above 0 and up to {FAR:g}"
        value = options.number(flag, text, wanted)
        if not 0.0 < value <= FAR:
            raise ConfigError(flag, f"expected {wanted}, got {text}")
        return value

    return FlightLimits(
        metres("--max-altitude", arguments.max_altitude),
        None if arguments.max_distance is None else metres("--max-distance", arguments.max_distance),
        metres("--return-height", arguments.return_height),
    )


def link_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that name the vehicle and its endpoint."""
    parser.add_argument(
        "--endpoint",
        default=ENDPOINT,
        metavar="URL",
        help="where the vehicle is (%(default)s)",
    )
    parser.add_argument("--sysid", metavar="N", help="its system id; left out: the only vehicle there is")


def sysid_of(arguments: argparse.Namespace) -> int | None:
    """Which vehicle, None: the only one. Raises `ConfigError`."""
    if arguments.sysid is None:
        return None
    wanted = f"a system id from 1 to {MAX_SYSID}"
    sysid = options.integer("--sysid", arguments.sysid, wanted)
    if not 0 < sysid <= MAX_SYSID:
        raise ConfigError("--sysid", f"expected {wanted}, got {sysid}")
    return sysid


def json_argument(parser: argparse.ArgumentParser) -> None:
    """The same for programs."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def force_argument(parser: argparse.ArgumentParser) -> None:
    """Permission to replace a file."""
    parser.add_argument("--force", action="store_true", help="replace OUT without asking")


def show_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan show`."""
    source_arguments(parser)
    json_argument(parser)


def convert_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan convert`."""
    source_arguments(parser)
    out_argument(parser)
    force_argument(parser)


def plot_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan plot`."""
    source_arguments(parser)
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help=f"required; one of {', '.join(plot.SUFFIXES)}"
    )


def upload_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan upload`."""
    source_arguments(parser)
    link_arguments(parser)


def download_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav plan download`."""
    out_argument(parser)
    force_argument(parser)
    model_argument(parser)
    link_arguments(parser)

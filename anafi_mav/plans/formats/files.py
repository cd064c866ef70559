"""Plan files on disk: which format one has, reading, and writing whole or not at all."""

from __future__ import annotations

import contextlib
import enum
import os
import tempfile
from pathlib import Path

from anafi_mav.documents import open_file
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats import lines, parrot, qgc_plan, waypoints
from anafi_mav.plans.plan import MAX_BYTES, Loss, Plan


class Format(enum.Enum):
    """File formats of a plan."""

    QGC = ".plan"
    WAYPOINTS = ".waypoints"
    PARROT_1 = ".mavlink, version 1"
    PARROT_2 = ".mavlink, version 2"


SUFFIXES = {".plan": Format.QGC, ".waypoints": Format.WAYPOINTS, ".txt": Format.WAYPOINTS, ".wpl": Format.WAYPOINTS}
"""By the ending of a file that is to be written. Of a `.mavlink` one has to say for which drone it is."""


def load(path: Path, version: parrot.Version = 2, height: float | None = None) -> Plan:
    """The plan in a file, whatever it is called. Raises `PlanError`.

    `version` is that of a Parrot file, `height` (m above take-off) that of a line on a map: these files do not say.
    """
    return parse(read(path), path.name, version, height)


def read(path: Path) -> bytes:
    """The content of a file, for `parse`.

    Raises `PlanError`, also for what is no file: a pipe would be waited for.
    """
    source = path.name
    try:
        with open_file(path) as file:
            return file.read(MAX_BYTES + 1)
    except OSError as error:
        raise PlanError(source, error.strerror or str(error)) from error


def parse(data: bytes, source: str, version: parrot.Version = 2, height: float | None = None) -> Plan:
    """The plan in the content of a file, as `load`. Raises `PlanError`."""
    if len(data) > MAX_BYTES:
        raise PlanError(source, f"it is larger than {MAX_BYTES // 2**20} MiB: no flight plan")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise PlanError(source, "it is no text") from error
    if not text.strip():
        raise PlanError(source, "it is empty")
    first = text.split("\n", 1)[0].strip()
    if text.lstrip().startswith("{"):
        if lines.is_geojson(text):
            return lines.read_geojson(text, source, height)
        return qgc_plan.read(text, source)
    if lines.is_kml(text):
        return lines.read_kml(text, source, height)
    if first == waypoints.HEADER:
        return waypoints.read(text, source)
    if first.startswith("QGC WPL"):
        return parrot.read(text, source, version)
    raise PlanError(source, "it is no QGroundControl plan, does not begin with QGC WPL, and is no KML or GeoJSON")


def encode(plan: Plan, form: Format) -> tuple[bytes, list[Loss]]:
    """The content of a file of this format, and what of the plan it does not hold."""
    match form:
        case Format.QGC:
            return qgc_plan.write(plan)
        case Format.WAYPOINTS:
            return waypoints.write(plan)
        case Format.PARROT_1:
            return parrot.write(plan, 1)
        case Format.PARROT_2:
            return parrot.write(plan, 2)


def save(plan: Plan, path: Path, form: Format) -> list[Loss]:
    """Write a file, replacing what was there as a whole; what of the plan it does not hold.

    Raises `PlanError`.
    """
    data, losses = encode(plan, form)
    put(data, path)
    return losses


def put(data: bytes, path: Path) -> None:
    """Write the content of a file whole or not at all. Raises `PlanError`."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            Path(name).chmod(0o644)
            Path(name).replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(name).unlink()
            raise
    except OSError as error:
        raise PlanError(path.name, error.strerror or str(error)) from error

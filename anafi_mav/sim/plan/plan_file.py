"""Drone's reader of an uploaded flight plan.

Sources: Parrot's developer pages, GroundSDK's reader and writer. A first line ``QGC WPL <n>``, then one item a
line, twelve columns: index, current, frame, command, p1 to p4, latitude, longitude, altitude, autocontinue. Parrot
documents tabs and shows blanks; both are accepted. A command that the version of the file does not have, or a
malformed number, makes the whole file invalid (assumed: Parrot says only that such items are not supported).
"""

from __future__ import annotations

import enum
import math
import re
from typing import NamedTuple

MAX_ITEMS = 5000
"""Items of a plan that are read; ten times what an hour's flight has."""

COLUMNS = 12

_HEADER = re.compile(r"QGC WPL \d+")


class PlanCommand(enum.IntEnum):
    """MAV_CMD numbers that the drone flies."""

    WAYPOINT = 16
    RETURN_TO_LAUNCH = 20
    LAND = 21
    TAKEOFF = 22
    DELAY = 93
    CONDITION_DELAY = 112
    CHANGE_SPEED = 178
    SET_ROI_LOCATION = 195
    SET_ROI_NONE = 197
    SET_ROI = 201
    MOUNT_CONTROL = 205
    TRIGGER_DISTANCE = 206
    TRIGGER_INTERVAL = 214
    START_PHOTO = 2000
    STOP_PHOTO = 2001
    START_VIDEO = 2500
    STOP_VIDEO = 2501
    PANORAMA = 2800
    SET_VIEW_MODE = 50000
    SET_STILL_MODE = 50001


class PlanFrame(enum.IntEnum):
    GLOBAL = 0
    """Height above mean sea level."""
    MISSION = 2
    """No position."""
    RELATIVE = 3
    """Height above take-off."""


ONLY_V2 = frozenset(
    {PlanCommand.SET_ROI_LOCATION, PlanCommand.SET_ROI_NONE, PlanCommand.TRIGGER_DISTANCE, PlanCommand.TRIGGER_INTERVAL}
)

_PLACED = frozenset({PlanCommand.WAYPOINT, PlanCommand.SET_ROI_LOCATION})
"""Items that are nothing without a position."""


class PlanFileError(Exception):
    """Invalid flight-plan file; the text names the line and the reason."""


class PlanLine(NamedTuple):
    command: PlanCommand
    frame: PlanFrame
    p1: float
    p2: float
    p3: float
    p4: float
    latitude: float
    longitude: float
    altitude: float

    @property
    def placed(self) -> bool:
        """It names a position: neither zeros nor NaN, as version 2 has it for take-off and landing."""
        place = (self.latitude, self.longitude, self.altitude)
        return all(math.isfinite(value) for value in place) and any(place[:2])

    def up(self, ground: float) -> float:
        """Height above take-off, m; `ground` is that of the take-off above mean sea level."""
        return self.altitude - ground if self.frame is PlanFrame.GLOBAL else self.altitude


def read(data: bytes, version: int) -> tuple[PlanLine, ...]:
    """The items of a file of version 1 or 2. Raises `PlanFileError`."""
    try:
        lines = data.decode("utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise PlanFileError("not a text") from error
    if not lines or _HEADER.fullmatch(lines[0].strip()) is None:
        raise PlanFileError("line 1: no QGC WPL header")
    rows = [(number, line) for number, line in enumerate(lines[1:], 2) if line.strip()]
    if not 0 < len(rows) <= MAX_ITEMS:
        raise PlanFileError(f"{len(rows)} items")
    return tuple(_item(number, line.split(), version) for number, line in rows)


def _item(number: int, words: list[str], version: int) -> PlanLine:
    if len(words) != COLUMNS:
        raise PlanFileError(f"line {number}: {len(words)} columns")
    try:
        frame, command = PlanFrame(int(words[2])), PlanCommand(int(words[3]))
        values = [float(word) for word in words[4:11]]
    except ValueError as error:
        raise PlanFileError(f"line {number}: {error}") from error
    item = PlanLine(command, frame, *values)
    if version == 1 and command in ONLY_V2:
        raise PlanFileError(f"line {number}: command {command} in a file of version 1")
    if any(math.isinf(value) for value in values):
        raise PlanFileError(f"line {number}: an infinite number")
    if command in _PLACED and not _on_earth(item):
        raise PlanFileError(f"line {number}: no position")
    return item


def _on_earth(item: PlanLine) -> bool:
    return abs(item.latitude) <= 90.0 and abs(item.longitude) <= 180.0 and math.isfinite(item.altitude)

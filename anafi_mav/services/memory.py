"""Stores the data that outlives the gateway: one file per drone.

A file holds the plans of a drone and the gateway's own settings for it. It is replaced as a whole, never half: a
reader finds the old or the new one. A file that cannot be read is moved to another name and reported in one line;
nothing of it is lost, and the drone starts without stored data. One that cannot be moved is not replaced.
"""

from __future__ import annotations

import asyncio
import logging
import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from anafi_mav import texts
from anafi_mav.disk_writer import HANGS
from anafi_mav.documents import open_file
from anafi_mav.state_lock import STATE_WRITER, replace_file
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.fence.plan_items import MAX_ITEMS, PlanItem

logger = logging.getLogger(__name__)

NOT_KEPT = texts.PLANS_NOT_KEPT
"""Text to each client that uploads a plan which the gateway cannot store. The log has file and reason."""

VERSION = 1

MAX_BYTES = 4 * 1024 * 1024
"""Of a file: three full lists take 1.5 MB."""

MAX_ASIDE = 100
"""Unreadable files of one drone that are moved to another name."""

LARGEST = 10**18
"""Largest whole number in settings, either way: JSON has no bound, and floats take none of more than 308 digits."""

_SERIAL = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""Parrot's are 18 letters and digits. It comes from the drone and becomes the name of a file."""

DISK_LIMIT = 3.0
"""s that a client waits for the disk, and a drone for its stored data. A memory card may take one; behind a disk that
hangs the client gets its answer, and the drone is a system without stored data until its next connection."""

Number = Annotated[float, Meta(ge=-3.5e38, le=3.5e38)] | Literal["inf", "-inf"] | None
"""A single-precision number as JSON can have it; None is NaN."""


class _Item(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A `PlanItem` as it stands in the file."""

    command: Annotated[int, Meta(ge=0, le=0xFFFF)]
    frame: Annotated[int, Meta(ge=0, le=0xFF)]
    params: tuple[Number, Number, Number, Number]
    x: Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]
    y: Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]
    z: Number
    autocontinue: Annotated[int, Meta(ge=0, le=0xFF)]
    current: Annotated[int, Meta(ge=0, le=0xFF)]


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    version: int
    serial: str
    plans: dict[int, Annotated[list[_Item], Meta(max_length=MAX_ITEMS)]]
    """By MAV_MISSION_TYPE."""
    settings: dict[str, Any] = {}


def _written(value: float) -> Number:
    if math.isfinite(value):
        return value
    if math.isnan(value):
        return None
    return "inf" if value > 0 else "-inf"


def _read(value: Number) -> float:
    return math.nan if value is None else float(value)


def _stored(item: PlanItem) -> _Item:
    one, two, three, four = map(_written, item.params)
    return _Item(
        item.command, item.frame, (one, two, three, four), item.x, item.y, _written(item.z), item.autocontinue,
        item.current,
    )  # fmt: skip


def _loaded(item: _Item) -> PlanItem:
    one, two, three, four = map(_read, item.params)
    return PlanItem(
        item.command, item.frame, (one, two, three, four), item.x, item.y, _read(item.z), item.autocontinue,
        item.current,
    )  # fmt: skip


class _Stored(msgspec.Struct, frozen=True):
    """Content of a drone's file, and the line for people when something is wrong with it."""

    plans: dict[int, tuple[PlanItem, ...]] = {}
    settings: dict[str, Any] = {}
    problem: OperatorText | None = None
    is_unreadable: bool = False
    """The file is there and cannot be read now."""


def _read_file(path: Path, serial: str) -> _Stored:
    """Read a drone's file in the thread of files; put one aside that nothing can be read of."""
    try:
        with open_file(path) as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise ValueError(f"it is larger than {MAX_BYTES} bytes")
        content = msgspec.json.decode(data, type=_File)
        if content.version != VERSION:
            raise ValueError(f"it is of version {content.version}, not {VERSION}")
        if content.serial != serial:
            raise ValueError("it is of another drone")
        if not _fits(content.settings):
            raise ValueError(f"a number in its settings is larger than {LARGEST:.0e}")
    except FileNotFoundError:
        return _Stored()
    except OSError as error:
        return _Stored(problem=texts.MEMORY_UNREADABLE.fill(path=path, error=error.strerror), is_unreadable=True)
    except (ValueError, RecursionError) as error:
        aside = _put_aside(path)
        if aside is None:
            return _Stored(problem=texts.MEMORY_UNREADABLE.fill(path=path, error=error), is_unreadable=True)
        return _Stored(problem=texts.MEMORY_INVALID.fill(path=path, error=error, aside=aside))
    return _Stored({kind: tuple(map(_loaded, items)) for kind, items in content.plans.items()}, content.settings)


def _fits(value: Any) -> bool:
    """Return True if no whole number in a JSON value is too large for arithmetic with floats."""
    if isinstance(value, dict):
        return all(map(_fits, value.values()))
    if isinstance(value, list):
        return all(map(_fits, value))
    return not isinstance(value, int) or abs(value) <= LARGEST


def _put_aside(path: Path) -> str | None:
    """Rename an unreadable file; return its new name, or None if it keeps its name."""
    for number in range(1, MAX_ASIDE + 1):
        aside = path.with_suffix(f".unreadable-{number}")
        if not aside.exists():
            try:
                path.rename(aside)
            except OSError:
                return None
            return aside.name
    return None


class Memory:
    """The file of one drone. `folder` None: nothing outlives the gateway."""

    def __init__(self, folder: Path | None, on_late: Callable[[OperatorText], None] = lambda text: None) -> None:
        """Create it, empty.

        `on_late` is called with a text when the disk delivers a file after its drone has become a system.
        """
        self.generation = 0
        """Grows whenever `load` has read stored data: of another drone, or late."""
        self.plans: dict[int, tuple[PlanItem, ...]] = {}
        """By MAV_MISSION_TYPE."""
        self.settings: dict[str, Any] = {}
        """Plain JSON values by name. Who reads one looks whether it makes sense: people can write files."""
        self.problem: OperatorText | None = None
        """Why what is here could not be read or written; None while all is well."""
        self._folder = folder
        self._on_late = on_late
        self._serial = ""
        self._reading: asyncio.Future[_Stored] | None = None
        """Reads an unreadable file; done when the disk has delivered it late."""
        self._unreadable = False
        """The file is there and cannot be read now: it may be another time, and must not be replaced."""

    @property
    def path(self) -> Path | None:
        """Return the drone's file; None without a folder or a valid serial number."""
        return self._path_of(self._serial)

    def _path_of(self, serial: str) -> Path | None:
        if self._folder is None or not _SERIAL.fullmatch(serial):
            return None
        return self._folder / f"{serial}.json"

    async def load(self, serial: str) -> OperatorText | None:
        """Read what is remembered of a drone. Returns a line for people when that could not be read.

        Of a drone that is back after a loss of the link there is nothing to read: what is here is as new as its file,
        or newer, if that could not be written. A file that the disk does not deliver in time counts as unreadable.

        An unreadable file is read at the next connection: there it is added to what has been set meanwhile.
        """
        is_back = bool(serial) and serial == self._serial
        if is_back and not self._unreadable:
            return None
        reading, stored, path = self._reading if is_back else None, _Stored(), self._path_of(serial)
        if path is not None:
            if reading is None:
                reading = asyncio.get_running_loop().run_in_executor(STATE_WRITER, _read_file, path, serial)
                await asyncio.wait([reading], timeout=DISK_LIMIT)
            if reading.done():
                stored, reading = reading.result(), None
            elif not is_back:
                problem = texts.MEMORY_UNREADABLE.fill(path=path, error=HANGS)
                stored = _Stored(problem=problem, is_unreadable=True)
                reading.add_done_callback(partial(self._arrived, serial))
            else:
                stored = _Stored(is_unreadable=True)
        self._reading = reading
        if is_back and stored.is_unreadable:
            return None  # as it was reported
        self.generation += is_back or serial != self._serial
        self._serial = serial
        self.plans = {**stored.plans, **self.plans} if is_back else stored.plans
        self.settings = {**stored.settings, **self.settings} if is_back else stored.settings
        self._unreadable = stored.is_unreadable
        self.problem = stored.problem if stored.is_unreadable else None
        return stored.problem

    def _arrived(self, serial: str, reading: asyncio.Future[_Stored]) -> None:
        """Report a file that the disk delivered late."""
        if reading is self._reading and serial == self._serial and not reading.result().is_unreadable:
            self._on_late(texts.MEMORY_LATE)

    def put(self, mission_type: int, items: Sequence[PlanItem]) -> None:
        """Remember a plan; `save` writes it."""
        self.plans[mission_type] = tuple(items)

    async def save(self) -> OperatorText | None:
        """Write the file as things are now. Returns a line for people when that failed.

        It failed, too, when the disk does not answer in time; what it writes later counts all the same.
        """
        path = self.path
        if path is None:
            return None
        if self._unreadable:
            return self.problem
        plans = {kind: list(map(_stored, items)) for kind, items in self.plans.items() if items}
        content = _File(VERSION, self._serial, plans, dict(self.settings))
        data = msgspec.json.encode(content)
        writing = asyncio.get_running_loop().run_in_executor(STATE_WRITER, replace_file, path, data)
        try:
            if not writing.done():
                await asyncio.wait([writing], timeout=DISK_LIMIT)
        finally:
            if writing.done():
                self._note(path, writing)
            else:
                writing.add_done_callback(partial(self._note, path))
        if not writing.done():
            self.problem = texts.MEMORY_UNWRITABLE.fill(path=path, error=HANGS)
        return self.problem

    def _note(self, path: Path, writing: asyncio.Future[None]) -> None:
        """Note how the writing ended, which may be after its client has got its answer."""
        error = None if writing.cancelled() else writing.exception()
        reason = getattr(error, "strerror", None) or error
        self.problem = None if error is None else texts.MEMORY_UNWRITABLE.fill(path=path, error=reason)

"""One parameter: its name, its type, and the place of its value.

The tables of them are `parameter_table*`.

A value is stored in one place: in the drone, in the gateway, or nowhere (a fact). Names are many: a native one that
every client sees, and aliases by which PX4's and ArduPilot's clients know the same thing. An alias converts; it
stores nothing.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field, replace

from anafi_mav.drone import Drone, Range
from anafi_mav.drone.events import Message
from anafi_mav.services.parameter.parameter_codec import NAME_LENGTH, ParamType
from anafi_mav.services.service import Host

Limits = tuple[float, float]
"""The smallest and the largest value that may be written."""

UNKNOWN = -1
"""The value of a parameter that is not known. Never NaN: stations show it, compare it, and write it back."""

TOLERANCE = 1e-4
"""Of a limit, relative to its unit: one that went through single precision and was scaled is still itself."""


@dataclass(frozen=True)
class Parameter:
    """One named value. `read` never fails."""

    name: str
    kind: ParamType
    short: str
    """Short description, for a line in a list."""
    read: Callable[[Host], float]
    """NaN: not known, and shown as `UNKNOWN`."""
    write: Callable[[Host, float], Awaitable[object]] | None = None
    """Sets it; returns when the drone confirmed, or raises an `AnafiMavError`. None: read only."""
    limits: Callable[[Host], Limits | None] | None = None
    """None: the limits of the type. Returns None while the drone has not reported them."""
    tolerance: float = 0.0
    """A value so little beyond a limit may be written, too; `write` keeps to the limit."""
    values: Mapping[int, str] = field(default_factory=dict)
    """The values that may be written, with their meaning, for a parameter with a fixed choice."""
    updates: tuple[type[Message], ...] = ()
    """The drone's events that may change it."""
    polled: bool = False
    """A setting of the gateway's that others may change, too: looked at with each tick."""
    present: Callable[[Drone], bool] = lambda drone: True
    """Does this drone have it? Asked once, when it first connects."""
    unit: str = ""
    step: float | None = None
    decimals: int | None = None
    group: str = "ANAFI"
    long: str = ""
    default: float | None = None
    """Default of a setting of the gateway; a drone does not report those of its own settings."""
    put: Callable[[Host, float], None] | None = None
    """Sets it without further ado: of the gateway's own settings that outlive it."""
    volatile: bool = False
    """It changes by itself: left out of the hash."""
    derived: bool = False
    """Computed from its native: it has changed only if that has."""
    native: str = ""
    """The native name of the same value; empty for one that is native itself, or a fact."""
    source: str = ""
    """Source of value and range, for the docs."""
    models: str = "all"
    """Which models have it, for the docs."""

    def __post_init__(self) -> None:
        if len(self.name) > NAME_LENGTH:
            raise ValueError(f"{self.name} is longer than {NAME_LENGTH} characters")

    def value(self, host: Host) -> float:
        """Return the value for the wire: finite, fits the type, whole where the type is."""
        value = self.read(host)
        if not math.isfinite(value):
            return UNKNOWN
        if not self.kind.whole:
            return value
        low, high = self.kind.limits
        return min(max(round(value), low), high)

    def accepts(self, host: Host, value: float) -> bool:
        """Return True if the value may be written, as far as this is known without asking the drone."""
        low, high = self.kind.limits
        if not math.isfinite(value) or not low <= value <= high:
            return False
        if self.values:
            return value in self.values
        limits = None if self.limits is None else self.limits(host)
        return limits is None or limits[0] - self.tolerance <= value <= limits[1] + self.tolerance


def own(put: Callable[[Host, float], None]) -> Callable[[Host, float], Awaitable[None]]:
    """Return the `write` of a setting that needs no consent of the drone."""

    async def write(host: Host, value: float) -> None:
        put(host, value)

    return write


def fact(name: str, value: float, short: str, kind: ParamType = ParamType.INT32, **more: object) -> Parameter:
    """Something that is so and does not change."""
    return Parameter(name, kind, short, lambda host: value, source="fact", **more)  # type: ignore[arg-type]


def alias(
    native: Parameter, name: str, kind: ParamType = ParamType.REAL32, *, scale: float = 1.0, **more: object
) -> Parameter:
    """The same value by another name, `scale` times the native one (cm for m: 100)."""

    def read(host: Host) -> float:
        return native.read(host) * scale

    def limits(host: Host) -> Limits | None:
        assert native.limits is not None
        found = native.limits(host)
        if found is None:
            return None
        low, high = found[0] * scale, found[1] * scale
        if kind.whole:
            return math.ceil(low - TOLERANCE), math.floor(high + TOLERANCE)
        return low, high

    def write(host: Host, value: float) -> Awaitable[object]:
        assert native.write is not None
        wanted = value / scale
        if scale != 1.0 and (found := limits_of(native, host)) is not None:
            wanted = min(max(wanted, found[0]), found[1])  # no further off than TOLERANCE
        return native.write(host, wanted)

    return replace(
        native,
        name=name,
        kind=kind,
        read=read,
        write=None if native.write is None else write,
        limits=None if native.limits is None else limits,
        tolerance=0.0 if scale == 1.0 or kind.whole else TOLERANCE,
        step=None if native.step is None else native.step * scale,
        default=None if native.default is None else native.default * scale,
        native=native.name,
        derived=True,
        **more,  # type: ignore[arg-type]
    )


def mapped(
    native: Parameter,
    name: str,
    kind: ParamType,
    values: Mapping[int, str],
    to_native: Mapping[int, int],
    **more: object,
) -> Parameter:
    """Return an alias of a choice with another name and other numbers.

    `to_native` has the native number of each.
    """
    from_native = {ours: theirs for theirs, ours in to_native.items()}

    def read(host: Host) -> float:
        value = native.read(host)
        return from_native.get(int(value), math.nan) if math.isfinite(value) else math.nan

    def write(host: Host, value: float) -> Awaitable[object]:
        assert native.write is not None
        return native.write(host, to_native[int(value)])

    default = None if native.default is None else from_native.get(int(native.default))
    return replace(
        native,
        name=name,
        kind=kind,
        read=read,
        write=None if native.write is None else write,
        limits=None,
        values=values,
        default=default,
        native=native.name,
        derived=True,
        **more,  # type: ignore[arg-type]
    )


def limits_of(parameter: Parameter, host: Host) -> Limits | None:
    """The limits of a parameter that may have none."""
    return None if parameter.limits is None else parameter.limits(host)


def current(setting: Range | None) -> float:
    """Return the value of a drone's setting; NaN while it is not reported."""
    return math.nan if setting is None else setting.current


def bounds(setting: Range | None) -> Limits | None:
    """Return the range that the drone reported with its setting."""
    return None if setting is None else (setting.min, setting.max)


def number(value: bool | int | float | None) -> float:
    """The value as a number; NaN for None."""
    return math.nan if value is None else float(value)

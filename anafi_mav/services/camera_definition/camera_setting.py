"""One setting of the camera: name, type and options, and how it is read and written. No I/O.

The tables of them are `setting_table` and `thermal_table`. Options and ranges are what the drone reports for each of
its cameras, so that a row has functions of a camera's state in their place. A value is stored in the drone alone.
"""

from __future__ import annotations

import enum
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from anafi_mav.drone import CamerasState, CameraState, Drone, ThermalState
from anafi_mav.services.camera_definition.param_ext_codec import NAME_LENGTH, ExtType


class Option(NamedTuple):
    """A value to choose, and its text."""

    value: float
    text: str


class ValueLimits(NamedTuple):
    """Range of a setting without options."""

    low: float
    high: float
    step: float | None = None


class View(NamedTuple):
    """One camera and what all cameras share, as the drone reports them."""

    camera: CameraState
    cameras: CamerasState
    thermal: ThermalState


Read = Callable[[View], float | None]
Write = Callable[[Drone, int, float], Awaitable[object]]
"""Sets the value on the camera with this id; returns when the drone has answered. Raises `AnafiMavError`."""


class Guard(enum.Enum):
    """Reason for which a change can be refused before the drone is asked."""

    NONE = enum.auto()
    PICTURE = enum.auto()
    """It changes the pictures: refused while the flown mission needs the camera."""
    CAPTURE = enum.auto()
    """It would end a recording or a series of photos as well: refused while one is running."""


@dataclass(frozen=True)
class CameraSetting:
    """One extended parameter."""

    name: str
    kind: ExtType
    title: str
    """Label in a ground station's list of settings."""
    read: Read
    """None: this camera does not report it."""
    write: Write
    options: Callable[[View], tuple[Option, ...]] | None = None
    """Values that this camera accepts; empty: it has no such setting. None: see `limits`."""
    limits: Callable[[View], ValueLimits | None] | None = None
    """Range that this camera accepts; None: it has no such setting."""
    unit: str = ""
    decimals: int | None = None
    default: float = 0.0
    """For the definition file, which requires one; the nearest possible value is shown. Drones report none."""
    guard: Guard = Guard.PICTURE
    is_listed: bool = True
    """False: stations have a control of their own for it, and leave it out of their list."""
    resolution: float = 0.0
    """Difference from a written value at which a reported one is still that value: the drone's unit is another one."""
    only_in: Mapping[str, frozenset[int]] = field(default_factory=dict)
    """Values of other settings in which it counts; stations hide it in all others."""

    def __post_init__(self) -> None:
        if len(self.name) > NAME_LENGTH:
            raise ValueError(f"{self.name} is longer than {NAME_LENGTH} characters")
        if (self.options is None) == (self.limits is None):
            raise ValueError(f"{self.name}: expected either options or limits")

    def options_of(self, view: View) -> tuple[Option, ...]:
        """Return the options that this camera accepts, as both ends hold their values.

        Those that the type cannot hold are left out.
        """
        if self.options is None:
            return ()
        held = ((self.kind.held(value), text) for value, text in self.options(view))
        return tuple(Option(value, text) for value, text in held if value is not None)

    def limits_of(self, view: View) -> ValueLimits | None:
        """Return the range that this camera accepts; None without one that the type can hold."""
        found = None if self.limits is None else self.limits(view)
        if found is None or not found.low <= found.high:
            return None
        low, high = self.kind.held(found.low), self.kind.held(found.high)
        return None if low is None or high is None else ValueLimits(low, high, found.step)

    def is_set(self, reported: float | None, written: float) -> bool:
        """Return True when a reported value shows that the written one is in effect."""
        return reported is not None and abs(reported - written) <= self.resolution

    def is_of(self, view: View) -> bool:
        """Return True when this camera has the setting."""
        return bool(self.options_of(view)) or self.limits_of(view) is not None

    def value_of(self, view: View) -> float | None:
        """Return the value as both ends hold it; None when this camera does not report it."""
        value = self.read(view)
        return None if value is None else self.kind.held(value)

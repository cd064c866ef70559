"""Base of every element of a drone: a frozen state, and a table of event reducers.

An element is one noun of the aircraft (battery, link, home, ...). Its state is the last one reported by the drone;
`None` means that it has not been reported since the connection was made. The table gives for each event how it
changes the state. States hold ARSDK's own units and signs, which the field names give; they are converted where they
meet MAVLink.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from operator import is_
from typing import Any, ClassVar, Final, Generic, TypeAlias, TypeVar

import msgspec

from anafi_mav.arsdk.codec.wire import Message, ValueLayout, Values
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.units import LARGEST

StateT = TypeVar("StateT")
KeyT = TypeVar("KeyT")
ValueT = TypeVar("ValueT")
EnumT = TypeVar("EnumT", bound=enum.IntEnum)

MAX_ITEMS = 64
"""Items kept of a map that the drone reports. The longest we declare has 25 keys; more is a confused peer."""

Reducer: TypeAlias = Callable[[Any, Any], Any]
"""(state, message) -> state. Pure; must accept whatever a peer can put on the wire."""

FIRST, LAST, EMPTY, REMOVE = (
    1 << flag for flag in (ListFlags.FIRST, ListFlags.LAST, ListFlags.EMPTY, ListFlags.REMOVE)
)


class Range(msgspec.Struct, frozen=True):
    """A setting as the drone reports it, with the range it accepts."""

    current: float
    min: float
    max: float


class Position(msgspec.Struct, frozen=True):
    """A known place; the field that holds it states the zero of `altitude`."""

    latitude: float
    """deg, -90..90."""
    longitude: float
    """deg, -180..180."""
    altitude: float
    """m."""


class Element(Generic[StateT]):
    """One part of the aircraft. Subclasses declare `NOTHING` and `REDUCERS`; some add verbs.

    Events of values wait undecoded until the state is read, only as long as none with the same layout follow. The
    result is that of reducing each at once: such an event replaces what an earlier one reported, and nothing else.
    """

    NOTHING: ClassVar[Any]
    """The state in which nothing has been reported."""
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]]

    def __init__(self) -> None:
        self.settled: StateT = self.NOTHING
        """The state without the events that wait, for fields that no value changes."""
        self.deferred: Final[dict[ValueLayout, Values]] = {}
        """Events of values to reduce when the state is read, in their sequence; always the same table."""

    def reset(self) -> None:
        """Forget everything the drone reported."""
        self.set_state(self.NOTHING)

    @cached_property
    def state(self) -> StateT:
        """The last state reported by the drone: an attribute once it was read.

        The first look reduces the events that wait. `defer` removes it. It is replaced by `set_state` alone, for
        `settled` and `deferred` belong to it.
        """
        reducers, state = self.REDUCERS, self.settled
        for values in self.deferred.values():
            data = values.data
            for reducer, read in values.layout.readers(reducers):
                state = reducer(state, read(data))
        self.deferred.clear()
        self.settled = state
        return state

    def set_state(self, state: StateT) -> None:
        """Replace the state; events that wait are lost."""
        self.deferred.clear()
        self.settled = self.state = state


def defer(element: Element[Any], values: Values) -> None:
    """Let events of values wait in an element until its state is read."""
    layout, deferred = values.layout, element.deferred
    if len(deferred) > 1 and any(other is not layout and other.shares(layout) for other in deferred):
        _ = element.state  # reduces them in their sequence: they replace one another's
    deferred[layout] = values
    vars(element).pop("state", None)


class StateWatch:
    """Notices that one of some elements has another state than at the last look."""

    def __init__(self, *elements: Element[Any]) -> None:
        self._elements = elements
        self._seen: list[object] = []
        """The states themselves: each update makes another object."""

    def has_changed(self) -> bool:
        """Return True at the first look, and at each look after an update of one of the elements."""
        states = [element.state for element in self._elements]
        if len(states) == len(self._seen) and all(map(is_, states, self._seen)):
            return False
        self._seen = states
        return True

    def reset(self) -> None:
        """Make the next look the first."""
        self._seen = []


def finite(value: float) -> float | None:
    """The number, or None for NaN, infinities and what is beyond `LARGEST`."""
    return value if abs(value) <= LARGEST else None


def field_of_view(deg: float | None) -> float | None:
    """Return the angle in degrees; None, unknown, for NaN and what no lens has."""
    return deg if deg is not None and 0.0 < deg <= 360.0 else None


def setting(message: Any) -> Range | None:
    """The current, min and max of a setting event; None when one of them is not a number."""
    if not math.isfinite(message.current + message.min + message.max):
        return None
    return Range(message.current, message.min, message.max)


def position(latitude: float, longitude: float, altitude: float) -> Position | None:
    """A reported place; None when the drone does not know it (Parrot says so with 500 degrees)."""
    if not (-90.0 <= latitude <= 90.0 and -180.0 <= longitude <= 180.0 and abs(altitude) <= LARGEST):
        return None
    return Position(latitude, longitude, altitude)


def members(bits: int, names: type[EnumT]) -> frozenset[EnumT]:
    """The values whose bit is set; bits that we have no name for are left out."""
    return _members(bits, names)


@lru_cache(maxsize=512)
def _members(bits: int, names: type[enum.IntEnum]) -> frozenset[Any]:
    """Return one set for all drones that report it: it takes 200 to 2000 bytes."""
    return frozenset(value for value in names if bits >> value & 1)


def with_item(items: Mapping[KeyT, ValueT] | None, key: KeyT, value: ValueT, flags: int) -> dict[KeyT, ValueT]:
    """Return a map after one MAP_ITEM event.

    `flags` is its `list_flags` (generic.xml list_flags): First restarts the list, Empty is a list without items,
    Remove removes the item. Events that belong to no list (keyed, but without `list_flags`) pass 0.
    """
    if flags & EMPTY:
        return {}
    changed = {} if items is None or flags & FIRST else dict(items)
    if flags & REMOVE:
        changed.pop(key, None)
    elif len(changed) < MAX_ITEMS or key in changed:
        changed[key] = value
    return changed

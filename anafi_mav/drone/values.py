"""Events of values: attitude, speed, heights, place, gimbal and zoom.

A drone sends them again and again, and each replaces the one before. They are kept undecoded until a state is read, and
those that arrive together are reported with one call: of thirty a second most are read by nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

import anafi_mav.arsdk.messages  # noqa: F401  # declares them
from anafi_mav.arsdk.codec.value_events import ValueLayout as ValueLayout
from anafi_mav.arsdk.codec.value_events import Values as Values
from anafi_mav.arsdk.codec.wire import Message, decode, value_events

SIZES: Mapping[type[Message], int] = {value.kind: value.size for value in value_events().values()}
"""Bytes of the command of each kind; later firmware may append more."""

VALUES = frozenset(SIZES)
"""The kinds of all of them."""

unpack = decode
"""Return the message in the bytes of `Values.command`."""

OnValues: TypeAlias = Callable[[Values, float], None]
"""(values, loop time of their arrival)."""

"""Events of values: attitude, speed, heights, place, gimbal and zoom.

A drone sends them again and again, and each replaces the one before. They are kept undecoded until a state is read, and
those that arrive together are reported with one call: of thirty a second most are read by nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import anafi_mav.arsdk.messages  # noqa: F401  # declares them
from anafi_mav.arsdk.codec.wire import Message, value_events
from anafi_mav.arsdk.codec.wire import ValueLayout as ValueLayout
from anafi_mav.arsdk.codec.wire import Values as Values

VALUES: frozenset[type[Message]] = frozenset(value.kind for value in value_events().values())
"""The kinds of all of them."""

OnValues: TypeAlias = Callable[[Values, float], None]
"""(values, loop time of their arrival)."""

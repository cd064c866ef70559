"""Objects that live as long as the gateway are kept out of the garbage collector.

Python's collector of the oldest generation scans every object that it knows, and everything waits for it: with 250
drones for 0.3 to 0.6 s. `gc.freeze` exempts all objects that exist at that moment, without a look at them: it takes the
same few microseconds with one drone and with 250.

Exempt garbage is never collected. So the heap is frozen after the systems are made and after each drone's first
connection, never after a later one: objects of lost sessions remain the collector's, however often a drone leaves and
returns. Garbage is not collected before a freeze. The start makes one or two such objects for each drone, and a full
collection would be the pause that is to be avoided.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from anafi_mav.clock import Alarm

DELAY = 0.5
"""s from the first connection of a drone to the freeze: what the connection makes exists then.

Drones that connect meanwhile share the freeze.
"""


@contextmanager
def frozen_afterwards() -> Iterator[None]:
    """Collect no garbage within the block, and freeze the heap at its end."""
    gc.disable()
    try:
        yield
        gc.freeze()
    finally:
        gc.enable()


class HeapFreezer:
    """Freezes the heap after first connections of drones."""

    def __init__(self, freeze: Callable[[], None] = gc.freeze) -> None:
        self._alarm = Alarm(freeze)

    def request(self) -> None:
        """Freeze in `DELAY` s, once for all requests until then."""
        if not self._alarm.is_set:
            self._alarm.set_in(DELAY)

    def close(self) -> None:
        """Withdraw the request. Closing twice does no harm."""
        self._alarm.cancel()

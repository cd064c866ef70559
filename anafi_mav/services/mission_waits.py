"""What a mission waits for without being flown: that it is stored, that somebody arms, and what a drone does that has
stopped its plan."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager

from anafi_mav.drone.events import FlyingState, ForcedLandingReason
from anafi_mav.services.aircraft import Aircraft
from anafi_mav.services.mission_progress import Progress
from anafi_mav.services.refusal import Refused

ARM_WAIT = 10.0
"""s that a mission waits for somebody to arm: QGroundControl chooses the mode first and arms when it is shown."""

END_WAIT = 2.0
"""s within which a drone whose plan has ended with a landing or a return has begun it."""


STORE_WAIT = 5.0
"""s that an order waits for a mission to be stored, which takes a thread some milliseconds and a disk its time."""


class StoreWait:
    """A mission has come and is being stored: what its client orders meanwhile is meant for it, not for the old one.

    Clients like dronekit do not wait for the acknowledgement of their last item.
    """

    def __init__(self) -> None:
        self._stored: asyncio.Event | None = None

    @contextmanager
    def going_on(self) -> Iterator[None]:
        """For as long as a mission is being stored, and until it is the one of the vehicle."""
        stored = self._stored = asyncio.Event()
        try:
            yield
        finally:
            stored.set()
            if self._stored is stored:
                self._stored = None

    async def over(self) -> None:
        """Return when no mission is being stored: at once if that is so. Raises `Refused` when it takes too long."""
        while self._stored is not None:
            try:
                await asyncio.wait_for(self._stored.wait(), STORE_WAIT)
            except asyncio.TimeoutError:
                raise Refused("Mission refused: it is still being stored") from None


class ArmWait:
    """A client has chosen the mission on the ground, and is to arm now."""

    def __init__(self, lapsed: Callable[[], None]) -> None:
        """`lapsed` is called when it did not."""
        self._lapsed = lapsed
        self._client: Hashable = None
        self._timer: asyncio.TimerHandle | None = None

    def begin(self, client: Hashable) -> None:
        """It has been chosen; whoever was waited for before is not any more."""
        self.end()
        self._client = client
        self._timer = asyncio.get_running_loop().call_later(ARM_WAIT, self._lapse)

    def ends_with(self, client: Hashable) -> bool:
        """This client has armed: was it waited for? If so that is over."""
        return self._client == client and self.end()

    def end(self) -> bool:
        """Wait no more; whether anybody was waited for."""
        waited, self._client = self._timer is not None, None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        return waited

    def _lapse(self) -> None:
        self.end()
        self._lapsed()


class EndWatch:
    """The plan's last line lands or returns, and the drone has stopped without a word on it: has it begun that?

    A landing or a return of another cause is none of the mission's.
    """

    def __init__(self, vehicle: Aircraft, progress: Progress, ended: Callable[[bool], None]) -> None:
        """`ended` is called with whether it has."""
        self._vehicle = vehicle
        self._progress = progress
        self._ended = ended
        self._timer: asyncio.TimerHandle | None = None

    @property
    def running(self) -> bool:
        """It is watched."""
        return self._timer is not None

    def begin(self) -> None:
        """The drone has stopped its plan before the last line."""
        self.end()
        late = functools.partial(self.look, last=True)
        self._timer = asyncio.get_running_loop().call_later(END_WAIT, late)
        self.look()

    def look(self, *, last: bool = False) -> None:
        """Landing, return or flying state may have changed."""
        if self._timer is None:
            return
        begun = self._progress.at_last_line and self._lands_or_returns
        if begun or last:
            self.end()
            self._ended(begun)

    def end(self) -> None:
        """Watch no more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    @property
    def _lands_or_returns(self) -> bool:
        vehicle = self._vehicle
        if vehicle.drone.alerts.state.forced_landing not in (None, ForcedLandingReason.NONE):
            return False
        down = vehicle.flying_state in (FlyingState.LANDING, FlyingState.LANDED)
        return down or (vehicle.returning and not vehicle.returning_by_itself)

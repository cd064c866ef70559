"""Waits of a mission that is not being flown: for storage, for arming, and after a stop.

After a stop of its plan by the drone: for the drone's state that shows whether the plan is complete.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager

from anafi_mav import geo, texts
from anafi_mav.clock import Alarm
from anafi_mav.drone.events import (
    AlertState,
    AltitudeChanged,
    FlyingState,
    ForcedLandingReason,
    GpsLocationChanged,
    Message,
    PlayError,
)
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.mission.path import WayPoint
from anafi_mav.vehicle.mission.progress import MissionProgress

ARM_WAIT = 10.0
"""s that a mission waits for arming.

QGroundControl chooses the mode first and arms when it is shown.
"""

END_WAIT = 2.0
"""s within which a drone whose plan has ended has reported the last line, or begun its landing or return."""

POSITION_WAIT = 10.0
"""s after that end within which a position must be received that proves the drone at its last way point.

An ANAFI reports its location once a second, and no report is repeated. Of ten, a link that loses half of them loses all
in one case of a thousand.
"""

PROOF: frozenset[type[Message]] = frozenset({GpsLocationChanged, AltitudeChanged})
"""Reports of which the drone's position is made."""

GPS_MARGIN = 2.0
"""m beyond the radius of a way point at which a drone that has stopped there may report itself."""

STORE_WAIT = 5.0
"""s that an order waits for a mission to be stored, which takes a thread some milliseconds and a disk its time."""


class StoreWait:
    """Delays the commands of a client while its new mission is being stored.

    They are meant for that mission, not for the old one: clients like dronekit do not wait for the acknowledgement of
    their last item.
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
        """Return when no mission is being stored: at once if that is so.

        Raises `Refused` when it takes too long.
        """
        while self._stored is not None:
            try:
                await asyncio.wait_for(self._stored.wait(), STORE_WAIT)
            except asyncio.TimeoutError:
                raise Refused(texts.MISSION, texts.MISSION_STORING) from None


class ArmWait:
    """A client has chosen the mission on the ground, and is to arm now."""

    def __init__(self, lapsed: Callable[[], None]) -> None:
        """`lapsed` is called when it did not."""
        self._lapsed = lapsed
        self._client: Hashable = None
        self._alarm = Alarm(self._lapse)

    def begin(self, client: Hashable) -> None:
        """Start waiting until this client arms; an earlier wait for another client ends."""
        self.end()
        self._client = client
        self._alarm.set_in(ARM_WAIT)

    def ends_with(self, client: Hashable) -> bool:
        """This client has armed: was it waited for? If so that is over."""
        return self._client == client and self.end()

    def end(self) -> bool:
        """Stop waiting for arming; returns True if a wait was active."""
        self._client = None
        if self._alarm.at is None:
            return False
        self._alarm.cancel()
        return True

    def _lapse(self) -> None:
        self.end()
        self._lapsed()


class EndWatch:
    """Decides whether a plan that stopped without a report of its last line is complete.

    Parrot does not document whether the last MissionItemExecuted precedes the state stopped. A last line that lands or
    returns is done when the drone has begun that; one of another cause is not the mission's. Any other last line is
    done when the drone is at the last way point and nothing is wrong. The report itself may also be late. A position
    that was received before the drone stopped proves nothing: over a bad link it may be seconds old.
    """

    def __init__(self, vehicle: Aircraft, progress: MissionProgress, ended: Callable[[bool], None]) -> None:
        """`ended` is called with whether it has."""
        self._vehicle = vehicle
        self._progress = progress
        self._ended = ended
        self._target: WayPoint | None = None
        self._alarm = Alarm(self._on_alarm)
        self._running = False
        self._missing: frozenset[type[Message]] = frozenset()
        """Parts of the position that have not been received since the drone stopped."""
        self._waits_for_position = False
        """Only a position is missing for the decision."""

    @property
    def running(self) -> bool:
        """It is watched."""
        return self._running

    def begin(self, target: WayPoint | None = None) -> None:
        """The drone has stopped its plan before the last line.

        `target`: the last way point of a plan that ends there, None when the last line lands or returns.
        """
        self.end()
        self._target = target
        self._running = True
        self._missing = frozenset() if target is None else PROOF
        self._alarm.set_in(END_WAIT)
        self.look()

    def on_position(self, kind: type[Message]) -> None:
        """Process the arrival of a part of the drone's position."""
        self._missing -= {kind}
        if self._waits_for_position and not self._missing:
            self.look(last=True)

    def _on_alarm(self) -> None:
        if self._missing and not self._waits_for_position:
            self._waits_for_position = True
            self._alarm.set_in(POSITION_WAIT - END_WAIT)
        else:
            self.look(last=True)

    def look(self, *, last: bool = False) -> None:
        """Landing, return or flying state may have changed."""
        if not self._running:
            return
        target = self._target
        if target is None:
            begun = self._progress.at_last_line and self._lands_or_returns
            if begun or last:
                self.end()
                self._ended(begun)
        elif last or self._is_in_trouble:
            self.end()
            self._ended(not self._is_in_trouble and not self._missing and self._is_at(target))

    def end(self) -> None:
        """Stop watching."""
        self._running = self._waits_for_position = False
        self._alarm.cancel()

    @property
    def _is_in_trouble(self) -> bool:
        """True when the drone may have stopped for another reason than the plan's end."""
        vehicle, alerts = self._vehicle, self._vehicle.drone.alerts.state
        return (
            not vehicle.in_air
            or vehicle.drone.home.state.returning
            or vehicle.drone.controller.pilot_acquired_control
            or alerts.alert not in (None, AlertState.NONE)
            or alerts.forced_landing not in (None, ForcedLandingReason.NONE)
            or vehicle.drone.flight_plan.state.error not in (None, PlayError.NONE)
        )

    def _is_at(self, target: WayPoint) -> bool:
        place, ato = self._vehicle.place, self._vehicle.drone.piloting.state.altitude
        if place is None or ato is None:
            return False
        away = math.hypot(geo.distance(*place.point, *target.place.point), ato - target.ato)
        return away <= target.radius + GPS_MARGIN

    @property
    def _lands_or_returns(self) -> bool:
        vehicle = self._vehicle
        if vehicle.drone.alerts.state.forced_landing not in (None, ForcedLandingReason.NONE):
            return False
        down = vehicle.flying_state in (FlyingState.LANDING, FlyingState.LANDED)
        return down or (vehicle.returning and not vehicle.returning_by_itself)

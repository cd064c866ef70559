"""Rally points in use: while the drone flies, the chosen one is its custom home.

So a return needs no gateway. This applies only where RTL_TYPE is set to it. The drone's former preference is restored
when it has landed, and when the rally points are removed. A home that a client or another controller chose is left
alone: a custom one until another kind is preferred, each other kind until the landing.
"""

from __future__ import annotations

import asyncio
import math

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone import Position, events
from anafi_mav.drone.events import RthHomeType
from anafi_mav.errors import AnafiMavError
from anafi_mav.services.service import Host, Service
from anafi_mav.vehicle.base.bounds import home_height
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions
from anafi_mav.vehicle.fence.rally import RallyPoint, RallyPoints, Return

LOOK_EVERY = 0.9
"""s, at least, between two choices. The services tick once a second, and the drone's place comes as often."""

REJECTED_FOR = 30.0
"""s for which a point that the drone did not accept is not proposed again: it may be too far away only for now."""

SAME_PLACE = 1e-6
"""deg, 0.1 m: what a drone repeats of a place that it was given is closer to it than that."""

MIRROR = "rally_home"
"""In the drone's memory: the home type that the drone preferred before a rally point became its home."""


class RallyService(Service):
    """MAVLink service that sets the end of a return, as far as rally points decide it."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._looked = -math.inf
        self._task: asyncio.Task[None] | None = None
        self._chosen: RallyPoint | None = None
        """The drone's custom home by our doing."""
        self._given: Position | None = None
        """Custom home that was last set by us.

        A different place is another controller's choice since.
        """
        self._preferred: tuple[RthHomeType | None, int] | None = None
        """Kind of home that was chosen in this flight instead of a rally point, also on an earlier connection.

        With the memory's generation: which drone flies.
        """
        self._rejected: dict[RallyPoint, float] = {}
        """Until when they are not proposed again."""

    @property
    def _rally(self) -> RallyPoints:
        return self.host.vehicle.rally

    def link_up(self) -> None:
        self._chosen, self._given = None, self.host.drone.home.state.custom_location
        self._rally.is_home = self._before() is not None
        if self.host.vehicle.on_ground:
            self._preferred = None

    def link_down(self) -> None:
        self._task = self._chosen = self._given = None
        self._rejected.clear()
        self._looked = -math.inf

    def subscriptions(self) -> Subscriptions:
        return {events.FlyingStateChanged: self._on_flying_state}

    def _on_flying_state(self, message: events.FlyingStateChanged, now: float) -> None:
        if self.host.vehicle.on_ground:
            self._preferred = None

    def tick(self, now: float) -> float:
        if now >= self._looked + LOOK_EVERY:
            self._looked = now
            self._look(now)
        return NEVER

    def _look(self, now: float) -> None:
        if self._task is not None and not self._task.done():
            return
        vehicle = self.host.vehicle
        if self._taken_over():
            self._task = self.host.spawn(self._leave())
            return
        if vehicle.mode is FlightMode.RETURN or not (vehicle.in_air or vehicle.on_ground):
            return  # a return under way, or a landing, keeps its end
        chosen = self._choose(now) if vehicle.in_air else None
        if chosen is not None:
            if chosen != self._chosen and self._may_choose():
                self._task = self.host.spawn(self._use(chosen, now))
        elif self._before() is not None:
            self._task = self.host.spawn(self._leave())

    def _choose(self, now: float) -> RallyPoint | None:
        vehicle = self.host.vehicle
        if self._rally.purpose is Return.HOME or not self._rally.items or vehicle.place is None:
            return None
        takeoff = self.host.drone.home.state.takeoff_location
        home = None if takeoff is None else (takeoff.latitude, takeoff.longitude)
        self._rejected = {point: until for point, until in self._rejected.items() if now < until}
        zones = vehicle.fence.zones

        def usable(point: RallyPoint) -> bool:
            inside = zones.margin((point.latitude, point.longitude), home).metres >= 0.0
            return inside and point not in self._rejected

        return self._rally.choose(vehicle.place, home, vehicle.height.takeoff_amsl, self._chosen, usable)

    def _may_choose(self) -> bool:
        """Return True if the drone can have a custom home, and no other one was chosen."""
        state = self.host.drone.home.state
        if state.preferred_type is None or state.types is None or RthHomeType.CUSTOM not in state.types:
            return False
        is_custom = state.preferred_type == RthHomeType.CUSTOM and self._before() is None
        if is_custom or self._preference == self._preferred:
            self.host.warn_throttled(texts.RALLY_HOME_SET)
            return False
        return True

    @property
    def _preference(self) -> tuple[RthHomeType | None, int]:
        """The kind of home that this drone prefers."""
        return self.host.drone.home.state.preferred_type, self.host.memory.generation

    def _taken_over(self) -> bool:
        """Return True if a client or another controller has chosen a home since we did."""
        state, given = self.host.drone.home.state, self._given
        chosen = state.custom_location
        if self._before() is None:
            return False
        if state.preferred_type != RthHomeType.CUSTOM or chosen is None:
            return self._chosen is not None and state.preferred_type is not None
        return (
            given is None
            or max(abs(chosen.latitude - given.latitude), abs(chosen.longitude - given.longitude)) > SAME_PLACE
        )

    async def _use(self, point: RallyPoint, now: float) -> None:
        home = self.host.drone.home
        async with self.host.vehicle.home_choice:
            if self._taken_over() or not self._may_choose():
                return  # while we waited; the next look makes something of it
            is_sent = False
            try:
                if self._before() is None:
                    assert home.state.preferred_type is not None
                    self._given = home.state.custom_location
                    await self._remember(home.state.preferred_type.name)
                at = home_height(self.host.vehicle, point.ato)
                self._given = await home.set_custom_location(point.latitude, point.longitude, at)
                is_sent = True
                await home.set_preferred_type(RthHomeType.CUSTOM)  # after the place: before it, home is an older one
            except AnafiMavError as error:
                self._rejected[point] = now + REJECTED_FOR
                self._chosen = None
                self.host.text(Severity.WARNING, texts.RALLY_FAILED.fill(number=point.number, error=error))
                # Not at the next tick: a return in between would go to the custom home of some other day.
                await self._restore(is_sent=is_sent)
            else:
                self._chosen = point
                self.host.vehicle.return_end.set_home(self._given, texts.RALLY_POINT.fill(number=point.number))
                self.host.text(Severity.NOTICE, texts.RETURNS_TO_RALLY.fill(number=point.number))

    async def _leave(self) -> None:
        async with self.host.vehicle.home_choice:
            await self._restore()

    async def _restore(self, *, is_sent: bool = False) -> None:
        """Restore the home type that the drone preferred before us.

        A home that another controller has chosen since is kept. `is_sent`: our choice may be in force without a report.
        """
        home, before = self.host.drone.home, self._before()
        if before is None:
            return
        taken_over = self._taken_over()
        self._chosen = None
        if taken_over:
            self._preferred = self._preference
        try:
            if (is_sent or home.state.preferred_type == RthHomeType.CUSTOM) and not taken_over:
                await home.set_preferred_type(before)
        except AnafiMavError as error:
            self.host.warn_throttled(texts.HOME_TYPE_NOT_RESTORED.fill(error=error))
            return
        await self._remember(None)
        if not (taken_over or self.host.vehicle.on_ground):
            self.host.text(Severity.NOTICE, texts.RETURNS_TO_HOME)

    def _before(self) -> RthHomeType | None:
        """Return the home type that the drone preferred before our change; None without one."""
        name = self.host.memory.settings.get(MIRROR)
        return RthHomeType.__members__.get(name) if isinstance(name, str) else None

    async def _remember(self, name: str | None) -> None:
        settings = self.host.memory.settings
        if name is None:
            settings.pop(MIRROR, None)
        else:
            settings[MIRROR] = name
        self._rally.is_home = name is not None
        await self._save()

    async def _save(self) -> None:
        if (problem := await self.host.memory.save()) is not None:
            self.host.warn_throttled(problem)

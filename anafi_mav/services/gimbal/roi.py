"""Region of interest: a place, or another system, that nose and camera follow.

It is Parrot's piloted POI. The nose follows the place in either case; the gimbal is locked on it, or free for angles
and rates of clients. The drone needs a hover to begin, and waits for one. Whatever else flies the drone ends it.
"""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass

from anafi_mav import geo, texts
from anafi_mav.drone.events import PoiMode, PoiStatus
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host
from anafi_mav.vehicle.base.bounds import amsl_to_ato, check_on_earth
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.refusal import Refused, reason_of
from anafi_mav.vehicle.base.severity import Severity

MAX_SYSTEMS = 64
"""Systems whose position is remembered; a fleet is smaller, and an address is easily made up."""

POSITION_OLD = 5.0
"""s after which the position of a system is no position to look at. It is sent once a second or more often."""

MOVED = 1.0
"""m that a system moves before the drone is commanded to look at its new place."""

SAME_PLACE = 0.05
"""m. Places closer together are one."""

UPDATE_EVERY = 1.0
"""s between two such commands: each is a new POI for the drone."""

_LOOKING = (PoiStatus.RUNNING, PoiStatus.PENDING)


@dataclass(frozen=True)
class SystemPosition:
    """Position of another system, as its GLOBAL_POSITION_INT reported it last."""

    place: GeoPoint
    amsl: float
    """m."""
    at: float
    """s, monotonic."""


class RegionOfInterest:
    """The region of interest of one vehicle."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._systems: dict[int, SystemPosition] = {}
        self._system: int | None = None
        """The system that is looked at; None: a place, or nothing."""
        self._looked: SystemPosition | None = None
        """Its position when the drone was last commanded to look at it."""
        self._update: asyncio.Task[None] | None = None
        self._is_lost = False
        """A text has reported that its positions have stopped."""

    @property
    def holds_gimbal(self) -> bool:
        """True while the drone aims the gimbal at the region by itself."""
        state = self._host.drone.poi.state
        return state.status in _LOOKING and state.mode != PoiMode.FREE_GIMBAL

    def is_locked_on(self, where: GeoPoint, ato: float) -> bool:
        """Return True while the drone aims the gimbal at this place (height: m above take-off)."""
        target = self._host.drone.poi.state.target
        if not self.holds_gimbal or target is None:
            return False
        apart = geo.distance(target.latitude, target.longitude, *where.point)
        return math.hypot(apart, target.altitude - ato) < SAME_PLACE

    async def look_at(self, where: GeoPoint, ato: float) -> None:
        """Look at a place (height: m above take-off), with the gimbal locked on it."""
        self.forget_system()
        await self._start(where, ato, PoiMode.LOCKED_GIMBAL)

    async def look_at_system(self, system: float) -> None:
        """Look at another system, and follow it as far as it reports its position."""
        seen = self._systems.get(int(system)) if math.isfinite(system) else None
        if seen is None or self._host.clock.monotonic() - seen.at > POSITION_OLD:
            raise Refused(texts.ROI, texts.ROI_NO_SYSTEM.fill(system=system))
        self.forget_system()
        await self._start(seen.place, amsl_to_ato(self._host.vehicle, seen.amsl), PoiMode.LOCKED_GIMBAL)
        self._system, self._looked, self._is_lost = int(system), seen, False

    async def stop(self) -> None:
        """Look at nothing in particular."""
        self.forget_system()
        await self._host.drone.poi.stop()

    async def free_gimbal(self) -> None:
        """Let the nose follow the region alone; returns when the gimbal takes angles and rates."""
        target = self._host.drone.poi.state.target
        if not self.holds_gimbal or target is None:
            return
        poi = self._host.drone.poi
        await poi.start(target.latitude, target.longitude, target.altitude, PoiMode.FREE_GIMBAL)

    def forget_system(self) -> None:
        """Follow no system any longer; the drone looks at its last place."""
        self._system = self._looked = None
        if self._update is not None:
            self._update.cancel()
            self._update = None

    def link_down(self) -> None:
        """Forget the systems: the drone is disconnected."""
        self.forget_system()
        self._systems.clear()

    def receive(self, inbound: Inbound) -> None:
        """Note the position that another system reports."""
        message = inbound.message
        place = GeoPoint(message.lat / 1e7, message.lon / 1e7)
        if inbound.sysid == self._host.sysid or place == GeoPoint(0.0, 0.0):
            return
        self._systems.pop(inbound.sysid, None)
        self._systems[inbound.sysid] = SystemPosition(place, message.alt / 1e3, inbound.now)
        if len(self._systems) > MAX_SYSTEMS:
            del self._systems[next(iter(self._systems))]

    def tick(self, now: float) -> None:
        """Look at the new place of the system that is followed."""
        if self._system is None or self._looked is None or self._update is not None:
            return
        if self._host.drone.poi.state.status not in _LOOKING:
            self.forget_system()  # something else flies the drone, or another controller has ended it
            return
        seen = self._systems.get(self._system, self._looked)
        is_lost = now - seen.at > POSITION_OLD
        if is_lost and not self._is_lost:
            self._host.text(Severity.WARNING, texts.ROI_LOST.fill(system=self._system))
        self._is_lost = is_lost
        moved = geo.distance(*seen.place.point, *self._looked.place.point)
        if now - self._looked.at >= UPDATE_EVERY and math.hypot(moved, seen.amsl - self._looked.amsl) >= MOVED:
            mode = PoiMode.LOCKED_GIMBAL if self.holds_gimbal else PoiMode.FREE_GIMBAL
            self._looked = SystemPosition(seen.place, seen.amsl, now)
            self._update = self._host.spawn(self._look_again(seen, mode))

    async def _look_again(self, seen: SystemPosition, mode: PoiMode) -> None:
        try:
            await self._start(seen.place, amsl_to_ato(self._host.vehicle, seen.amsl), mode)
        except AnafiMavError as error:
            self._system = None
            self._host.text(Severity.WARNING, texts.ROI_ENDED.fill(reason=reason_of(error)))
        finally:
            self._update = None

    async def _start(self, where: GeoPoint, ato: float, mode: PoiMode) -> None:
        check_on_earth(where, texts.ROI)
        if not self._host.vehicle.in_air:
            raise Refused(texts.ROI, texts.NOT_IN_AIR)
        await self._host.drone.poi.start(where.latitude, where.longitude, ato, mode)

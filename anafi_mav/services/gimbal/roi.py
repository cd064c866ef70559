"""Region of interest: a place, or another system, that nose and camera follow.

It is Parrot's piloted POI. The nose follows the place in either case; the gimbal is locked on it, or free for angles
and rates of clients. The drone needs a hover to begin. It is a flight task of the vehicle: each takeover, landing and
return ends it at once, and nothing is sent for it from then on, although the drone reports its end later.
"""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass, replace

from anafi_mav import geo, texts
from anafi_mav.drone.events import PilotedPOIV2, PoiMode, PoiStatus
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host
from anafi_mav.services.system_position import SystemPosition
from anafi_mav.vehicle.base.bounds import amsl_to_ato, check_on_earth
from anafi_mav.vehicle.base.flight_task import Needs, PlainTask, Preparation, TaskRules
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, reason_of
from anafi_mav.vehicle.base.requester import By
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


def _holds(status: PoiStatus | None, mode: PoiMode | None) -> bool:
    """Return True for a region that the drone aims the gimbal at."""
    return status in _LOOKING and mode != PoiMode.FREE_GIMBAL


@dataclass
class Region:
    """One attempt to look at places.

    It has ended when another one, or none, is the region in force.
    """

    mode: PoiMode
    """Relation of the gimbal to the place that is wanted."""
    by: By | None = None
    """Requester; None: it was found."""
    is_confirmed: bool = False
    """The drone has reported it."""
    starting: asyncio.Future[None] | None = None
    """Done when the drone has answered the start under way."""
    freeing: asyncio.Task[None] | None = None
    """Frees the gimbal; one task for all targets that wait for it."""


class RegionOfInterest(PlainTask):
    """The region of interest of one vehicle: one of its flight tasks."""

    rules = TaskRules(texts.ROI, needs=Needs.NO_DESCENT | Needs.IN_AIR, keeps_below=True, follows=True)
    mode = None
    """The drone looks there in any hovering mode."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._region: Region | None = None
        """The region in force; None as soon as its end is commanded."""
        self._prepared: Region | None = None
        """The newest region that is about to begin, while earlier movements end."""
        self._systems: dict[int, SystemPosition] = {}
        """What systems of other gateways and autopilots have reported."""
        self._system: int | None = None
        """The system that is looked at; None: a place, or nothing."""
        self._looked: SystemPosition | None = None
        """Its position when the drone was last commanded to look at it."""
        self._update: asyncio.Task[None] | None = None
        self._is_lost = False
        """A text has reported that its positions have stopped."""

    @property
    def holds_gimbal(self) -> bool:
        """True while the drone aims the gimbal at the region by itself, or is commanded to."""
        region = self._region
        is_commanded = region is not None and region.starting is not None and region.mode != PoiMode.FREE_GIMBAL
        return is_commanded or self._is_aimed

    @property
    def _is_aimed(self) -> bool:
        """True while the drone reports that it aims the gimbal at the region."""
        state = self._host.drone.poi.state
        return _holds(state.status, state.mode)

    def is_locked_on(self, where: GeoPoint, ato: float) -> bool:
        """Return True while the drone aims the gimbal at this place (height: m above take-off)."""
        region, target = self._region, self._host.drone.poi.state.target
        if region is None or region.starting is not None or region.freeing is not None or self._update is not None:
            return False  # a newer start is under way
        if not self._is_aimed or target is None:
            return False
        apart = geo.distance(target.latitude, target.longitude, *where)
        return math.hypot(apart, target.altitude - ato) < SAME_PLACE

    @property
    def is_active(self) -> bool:
        """True while a region is in force or begins, and its end is not commanded."""
        return self._region is not None

    def prepare(self, by: By) -> Region:
        """Return an attempt for `look_at`; a newer one, or `stop`, withdraws it.

        Raises `Refused` when no region can begin: landing, return, mission, ground.
        """
        self._require_no_mission()
        self._host.vehicle.control.check(self, by)
        self._prepared = Region(PoiMode.LOCKED_GIMBAL, by)
        return self._prepared

    async def takeoff_over(self) -> None:
        """Wait for the end of a take-off under way, which a region would end.

        Raises `Refused` during a mission, and `Unfinished` when the take-off fails.
        """
        self._require_no_mission()
        await self._host.vehicle.takeoff.over(self.rules)

    def _require_no_mission(self) -> None:
        vehicle = self._host.vehicle
        if vehicle.control.active is vehicle.mission or vehicle.mode is FlightMode.MISSION:
            raise Refused(texts.ROI, texts.GIMBAL_OF_MISSION)

    async def look_at(self, region: Region, where: GeoPoint, ato: float) -> Region | None:
        """Look at a place (height: m above take-off), with the gimbal locked on it.

        Returns the region that looks there: the one in force where it does so already. It replaces what flies the
        drone, as every flight command. A region in force moves to the new place.
        """
        check_on_earth(where, texts.ROI)
        self._require_prepared(region)
        is_locked = self.is_locked_on(where, ato)
        self.forget_system()
        if is_locked:
            return self._region
        if self._region is not None or region.by is None:
            self._region, self._prepared = region, None
            await self._start(region, where, ato)
        else:
            await self._begin_region(region, region.by, where, ato)
        region.is_confirmed = True
        return region

    async def _begin_region(self, region: Region, by: By, where: GeoPoint, ato: float) -> None:
        """Acquire the drone for a region, and stop it."""
        vehicle = self._host.vehicle
        rules = replace(self.rules, start=Preparation.STOP) if vehicle.drone.piloting.moving else self.rules
        goto = vehicle.guided.goto
        async with vehicle.control.acquire(
            self, by=by, rules=rules, condition=lambda: self._require_prepared(region)
        ) as grant:
            self._region, self._prepared = region, None  # no await from the checks to the start
            grant.begin()
            if goto is not None:  # the mode shown stays the same
                self._host.text(Severity.NOTICE, texts.TASK_ENDED.fill(what=texts.GOTO, reason=texts.REGION_INSTEAD))
            failure: BaseException | None = None
            try:
                await self._start(region, where, ato)
            except BaseException as error:
                if self._region is None or self._region is region:
                    raise
                failure = error
        if failure is not None:  # outside: a newer region has the task, which must not end with this one
            raise failure

    def _require_prepared(self, region: Region) -> None:
        if self._prepared is not region:
            raise Refused(texts.ROI, texts.MISSION_DISPLACED)

    def position_of(self, system: float) -> SystemPosition:
        """Return the position of another system. Raises `Refused` without a recent one."""
        if system not in range(1, 256):
            raise Refused(texts.ROI, texts.ROI_SYSTEM_NUMBER)
        seen = self._newest(int(system))
        if seen is None or self._host.clock.monotonic() - seen.at > POSITION_OLD:
            raise Refused(texts.ROI, texts.ROI_NO_SYSTEM.fill(system=system))
        return seen

    def _newest(self, system: int) -> SystemPosition | None:
        """Return the newest position of another system; None: unknown, or it is this one."""
        if system == self._host.sysid:
            return None
        return self._host.position_of(system) or self._systems.get(system)

    async def look_at_system(self, region: Region, system: float) -> None:
        """Look at another system, and follow it as far as it reports its position."""
        seen = self.position_of(system)
        looking = await self.look_at(region, seen.place, amsl_to_ato(self._host.vehicle, seen.amsl))
        if looking is not None and self._region is looking:  # else a newer region, or none, has replaced it
            self._system, self._looked, self._is_lost = int(system), seen, False

    async def stop(self) -> None:
        """Look at nothing in particular."""
        self._prepared = None
        self._drop_region()
        self.forget_system()
        await self._host.drone.poi.stop()

    async def free_gimbal(self) -> None:
        """Let the nose follow the region alone; returns when the gimbal takes angles and rates.

        Sends nothing for a region that ends: the drone frees the gimbal by itself, and until it has reported that, the
        gimbal would turn to the region and look as if it obeyed.
        """
        self.free_prepared()
        if self._update is not None:
            await asyncio.wait({self._update})
        while (region := self._region) is not None and region.starting is not None and region.freeing is None:
            await asyncio.wait({region.starting})
        if not self._is_aimed:
            return
        vehicle = self._host.vehicle
        if region is None or vehicle.descent is not None or not vehicle.in_air:
            await self._released()
            return
        if region.freeing is None:
            region.freeing = self._host.spawn(self._free(region))
            region.freeing.add_done_callback(lambda task: task.cancelled() or task.exception())
        try:
            await asyncio.shield(region.freeing)  # a newer target waits for the same
        except AnafiMavError:
            if self._region is not None:
                raise
            await self._released()

    def free_prepared(self) -> None:
        """Let the region that is about to begin leave the gimbal to a newer target."""
        if self._prepared is not None:
            self._prepared.mode = PoiMode.FREE_GIMBAL

    async def _released(self) -> None:
        """Return when the drone reports that it does not aim the gimbal. Raises `CommandTimeout`."""
        if self._is_aimed:
            await self._host.drone.expect(PilotedPOIV2, lambda message: not _holds(message.status, message.mode))

    async def _free(self, region: Region) -> None:
        target = self._host.drone.poi.state.target
        try:
            if target is not None and self._region is region:
                region.mode = PoiMode.FREE_GIMBAL
                await self._start(region, GeoPoint(target.latitude, target.longitude), target.altitude)
        finally:
            region.freeing = None

    async def _start(self, region: Region, where: GeoPoint, ato: float) -> None:
        """Command the region in force. A start that fails is undone by a stop, so it ends then."""
        starting = region.starting = asyncio.get_running_loop().create_future()
        try:
            await self._host.drone.poi.start(where.latitude, where.longitude, ato, region.mode)
        except BaseException:
            if self._region is region:
                self._drop_region()
            raise
        finally:
            starting.set_result(None)
            if region.starting is starting:
                region.starting = None

    def _drop_region(self) -> None:
        """The region is over, and nothing is to be sent for it."""
        self._region = None
        self._host.vehicle.control.release(self)

    # The flight task.

    def end(self) -> list[asyncio.Task[None]]:
        """End the region: something else flies the drone now."""
        region, self._region = self._region, None
        if region is None:
            return []
        ended = [task for task in (self._update, region.freeing) if task is not None]
        self.forget_system()
        self._host.drone.poi.abort()
        return ended

    def link_up(self) -> None:
        """Adopt the region that the drone reports, of an earlier connection or another controller."""
        state = self._host.drone.poi.state
        if state.status in _LOOKING:
            self._region = Region(state.mode or PoiMode.LOCKED_GIMBAL, is_confirmed=True)
            control = self._host.vehicle.control
            if control.active is control.below:  # no task: a plan looks at places of its own
                control.adopt(self, keeps_below=True)

    def forget_system(self) -> None:
        """Follow no system any longer; the drone looks at its last place."""
        self._system = self._looked = None
        if self._update is not None:
            self._update.cancel()
            self._update = None

    def link_down(self) -> None:
        """Forget the region and the systems: the drone is disconnected."""
        self._region = self._prepared = None
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

    @property
    def follows(self) -> bool:
        """True while the region is the place of another system."""
        return self._region is not None and self._system is not None

    def looks_at(self, sysid: int) -> bool:
        """Return True while the region is the place of this system."""
        return self.follows and self._system == sysid

    def tick(self, now: float) -> None:
        """Look at the new place of the system that is followed."""
        region = self._region
        if region is None or not region.is_confirmed or region.freeing is not None or self._update is not None:
            return
        if self._host.drone.poi.state.status not in _LOOKING:
            self._drop_region()  # the drone, or another controller, has ended it
            self.forget_system()
            return
        if self._system is None or self._looked is None:
            return
        seen = self._newest(self._system) or self._looked
        is_lost = now - seen.at > POSITION_OLD
        if is_lost and not self._is_lost:
            self._host.text(Severity.WARNING, texts.ROI_LOST.fill(system=self._system))
        self._is_lost = is_lost
        moved = geo.distance(*seen.place, *self._looked.place)
        if now - self._looked.at >= UPDATE_EVERY and math.hypot(moved, seen.amsl - self._looked.amsl) >= MOVED:
            self._looked = SystemPosition(seen.place, seen.amsl, now)
            self._update = self._host.spawn(self._look_again(region, seen))

    async def _look_again(self, region: Region, seen: SystemPosition) -> None:
        task = asyncio.current_task()
        try:
            if self._region is region:
                check_on_earth(seen.place, texts.ROI)
                await self._start(region, seen.place, amsl_to_ato(self._host.vehicle, seen.amsl))
        except AnafiMavError as error:
            if self._update is task:  # else its end was commanded
                self._system = None
                self._host.text(Severity.WARNING, texts.ROI_ENDED.fill(reason=reason_of(error)))
        finally:
            if self._update is task:
                self._update = None

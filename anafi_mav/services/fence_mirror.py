"""A circle around the take-off point, handed to the drone as its own geofence: so it holds without the gateway, too.

An ANAFI knows one fence: not farther from its take-off point than MaxDistance, while NoFlyOverMaxDistance is on. It is
set when a client's fence says the same, and what was set before comes back when the fence is gone or disabled, unless
somebody has changed it meanwhile. Zones that the drone cannot express are the gateway's to watch; so is this one.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from typing import Any

from anafi_mav import geo
from anafi_mav.drone import Range
from anafi_mav.errors import AnafiMavError
from anafi_mav.plans.zones import Circle, LatLon
from anafi_mav.services.fence_watch import Reaction
from anafi_mav.services.service import Host
from anafi_mav.services.statustext import Severity

NEAR, FAR = 5.0, 10.0
"""m between the take-off point and the middle of a circle that count as the same place, and as another one: readings
of GPS on the ground differ by some metres."""

SAME = 0.5
"""m by which the drone's radius may differ from the one that was set."""

RETRY = 30.0
"""s until what the drone did not accept is tried again."""

KEY = "fence_mirror"
"""In the drone's memory: what was set, and what had been set before."""


class FenceMirror:
    """The drone's own geofence as far as the uploaded fence goes."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._task: asyncio.Task[None] | None = None
        self._failed: tuple[float | None, float] | None = None
        """What was wanted when it failed, and when."""

    def link_down(self) -> None:
        self._task = self._failed = None

    def update(self, now: float) -> None:
        """See whether the drone's geofence has to change."""
        if self._task is not None and not self._task.done():
            return
        known, wanted = self.wanted()
        mirrored = self._remembered()
        present = None if mirrored is None else mirrored["radius"]
        if not known or wanted == present:
            return
        if self._failed is not None and self._failed[0] == wanted and now - self._failed[1] < RETRY:
            return
        self._task = self._host.spawn(self._change(wanted, mirrored, now))

    def wanted(self) -> tuple[bool, float | None]:
        """(known, radius): the radius that says what the fence says, None for none. Not known: leave all as it is."""
        vehicle = self._host.vehicle
        watch, state = vehicle.fence, self._host.drone.piloting.state
        zones = [zone for zone in watch.zones.zones if zone.inclusion]
        circle = zones[0] if len(zones) == 1 else None
        if not isinstance(circle, Circle) or watch.action is Reaction.NONE:
            return True, None
        setting = state.max_distance
        if setting is None or state.geofence is None or not setting.min <= circle.radius <= setting.max:
            return True, None
        middle = vehicle.home.point if circle.centre is None and vehicle.home is not None else circle.centre
        start = self._takeoff_point()
        if start is None or middle is None:
            return False, None
        away = geo.distance(*start, *middle)
        limit = NEAR if self._remembered() is None else FAR
        return True, circle.radius if away <= limit else None

    def _takeoff_point(self) -> LatLon | None:
        """The middle of the drone's geofence: where it took off, on the ground where it will."""
        vehicle = self._host.vehicle
        if vehicle.on_ground:
            return None if vehicle.place is None else vehicle.place.point
        location = self._host.drone.home.state.takeoff_location
        if location is not None:
            return location.latitude, location.longitude
        return None if vehicle.origin is None else vehicle.origin.point

    async def _change(self, radius: float | None, mirrored: Mapping[str, Any] | None, now: float) -> None:
        try:
            if radius is None:
                assert mirrored is not None
                await self._restore(mirrored)
            else:
                await self._set(radius, mirrored)
            self._failed = None
        except AnafiMavError as error:
            self._failed = radius, now
            self._host.text(Severity.WARNING, f"The drone's own geofence could not be changed: {error}")

    async def _set(self, radius: float, mirrored: Mapping[str, Any] | None) -> None:
        piloting = self._host.drone.piloting
        setting = piloting.state.max_distance
        assert setting is not None
        before = mirrored or {"distance": setting.current, "geofence": bool(piloting.state.geofence)}
        # Remembered first: should the gateway end in between, the next one knows what to put back.
        await self._remember({"radius": radius, "distance": before["distance"], "geofence": before["geofence"]})
        confirmed = await piloting.set_max_distance(radius)
        await piloting.set_geofence(True)
        self._host.text(
            Severity.NOTICE, f"Fence: the drone keeps to {confirmed:g} m around its take-off point by itself, too"
        )

    async def _restore(self, mirrored: Mapping[str, Any]) -> None:
        piloting = self._host.drone.piloting
        state = piloting.state
        setting: Range | None = state.max_distance
        ours = setting is not None and abs(setting.current - mirrored["radius"]) < SAME and state.geofence
        if ours:
            if not mirrored["geofence"]:
                await piloting.set_geofence(False)
            await piloting.set_max_distance(mirrored["distance"])
            word = "on" if mirrored["geofence"] else "off"
            text = f"The drone's own geofence is what it was: {mirrored['distance']:g} m, {word}"
        else:
            text = "The drone's own geofence stays as it is: somebody has changed it"
        await self._remember(None)
        self._host.text(Severity.NOTICE, text)

    def _remembered(self) -> Mapping[str, Any] | None:
        entry = self._host.memory.settings.get(KEY)
        if not isinstance(entry, dict):
            return None
        numbers = (entry.get("radius"), entry.get("distance"))
        if not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
            return None
        return entry if isinstance(entry.get("geofence"), bool) else None

    async def _remember(self, entry: dict[str, Any] | None) -> None:
        settings = self._host.memory.settings
        if entry is None:
            settings.pop(KEY, None)
        else:
            settings[KEY] = entry
        if (problem := await self._host.memory.save()) is not None:
            self._host.complain(problem)

"""Sets a fence circle as the drone's own geofence, so that it holds without the gateway.

An ANAFI knows one fence: not farther from its centre than MaxDistance, while NoFlyOverMaxDistance is on. The centre
is the controller's GPS, or else the take-off point. The radius is set while a client's fence is the same circle. The
previous radius is restored when that fence is removed or disabled, or when the centre moves away from it, unless
another controller has changed it meanwhile. The gateway watches all zones: those that the drone cannot express, and
this one, too.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from typing import Any

from anafi_mav import geo, texts
from anafi_mav.drone import Range
from anafi_mav.errors import AnafiMavError
from anafi_mav.plans.zones import CircleZone
from anafi_mav.services.service import Host
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.fence.fence_watch import Reaction

NEAR, FAR = 5.0, 10.0
"""m between two centres, the drone's and a circle's, that count as the same place.

While the drone stands its centre is a GPS reading that drifts by some metres: FAR ends what NEAR began; later NEAR
counts alone.
"""

SETTLED = 30.0
"""s that a centre must be near again before the circle is set once more.

A pilot who walks has GPS, too.
"""

SAME = 0.5
"""m by which the drone's radius may differ from the one that was set."""

RETRY = 30.0
"""s until a value that the drone did not accept is set again."""

KEY = "fence_mirror"
"""Key in the drone's memory: the value that was set, and the one before."""


class FenceMirror:
    """Sets the drone's own geofence to the uploaded fence, as far as it can express it."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._task: asyncio.Task[None] | None = None
        self._failed: tuple[float | None, float] | None = None
        """The wanted value that could not be set, and the time of the failure."""
        self._moved_at = -math.inf
        """When the centre was last seen elsewhere while the circle was the drone's."""

    def link_down(self) -> None:
        self._task = self._failed = None
        self._moved_at = -math.inf

    def update(self, now: float) -> None:
        """Check whether the drone's geofence must change."""
        if self._task is not None and not self._task.done():
            return
        known, wanted, away = self.wanted()
        mirrored = self._remembered()
        present = None if mirrored is None else mirrored["radius"]
        if not known or wanted == present:
            return
        if self._failed is not None and self._failed[0] == wanted and now - self._failed[1] < RETRY:
            return
        if wanted is not None and now - self._moved_at < SETTLED:
            return
        if away is not None:
            self._moved_at = now
            self._host.text(Severity.WARNING, texts.GEOFENCE_ENDS.fill(distance=away))
        self._task = self._host.spawn(self._change(wanted, mirrored, now))

    def wanted(self) -> tuple[bool, float | None, float | None]:
        """Return (known, radius, away): the radius that equals the fence, None without one.

        Not known: leave all as it is. `away` is the distance of the drone's centre from the circle's (m), when that
        is why the radius is None.
        """
        vehicle = self._host.vehicle
        watch, state = vehicle.fence, self._host.drone.piloting.state
        zones = [zone for zone in watch.zones.zones if zone.inclusion]
        circle = zones[0] if len(zones) == 1 else None
        if not isinstance(circle, CircleZone) or watch.action is Reaction.NONE:
            return True, None, None
        setting = state.max_distance
        if setting is None or state.geofence is None or not setting.min <= circle.radius <= setting.max:
            return True, None, None
        middle = circle.centre or vehicle.fence_home
        centre = vehicle.geofence_centre
        if centre is None or middle is None:
            return False, None, None
        away = geo.distance(*centre, *middle)
        wanders = vehicle.on_ground and centre == vehicle.place
        limit = FAR if wanders and self._remembered() is not None else NEAR
        return (True, circle.radius, None) if away <= limit else (True, None, away)

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
            self._host.text(Severity.WARNING, texts.GEOFENCE_FAILED.fill(error=error))

    async def _set(self, radius: float, mirrored: Mapping[str, Any] | None) -> None:
        piloting = self._host.drone.piloting
        setting = piloting.state.max_distance
        assert setting is not None
        before = mirrored or {"distance": setting.current, "geofence": bool(piloting.state.geofence)}
        # Remembered first: should the gateway end in between, the next one knows what to put back.
        await self._remember({"radius": radius, "distance": before["distance"], "geofence": before["geofence"]})
        confirmed = await piloting.set_max_distance(radius)
        await piloting.set_geofence(True)
        self._host.text(Severity.NOTICE, texts.GEOFENCE_SET.fill(radius=confirmed))

    async def _restore(self, mirrored: Mapping[str, Any]) -> None:
        piloting = self._host.drone.piloting
        state = piloting.state
        setting: Range | None = state.max_distance
        ours = setting is not None and abs(setting.current - mirrored["radius"]) < SAME and state.geofence
        if ours:
            if not mirrored["geofence"]:
                await piloting.set_geofence(False)
            await piloting.set_max_distance(mirrored["distance"])
            word = texts.ON if mirrored["geofence"] else texts.OFF
            text = texts.GEOFENCE_RESTORED.fill(radius=mirrored["distance"], state=word)
        else:
            text = texts.GEOFENCE_KEPT
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
            self._host.warn_throttled(problem)

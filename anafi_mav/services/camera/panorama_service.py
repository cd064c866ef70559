"""MAV_CMD_PANORAMA_CREATE: Parrot's photo panoramas, which turn the drone.

A panorama is a flight task: it begins only while the drone hovers, and whatever flies the drone next ends it.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Container, Mapping

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone.events import AnimationType, FlyingState
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.services.camera.camera_targets import enter_mode, require_free, require_idle, require_storage
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect
from anafi_mav.services.service import Service
from anafi_mav.vehicle.base.flight_task import PlainTask, TaskRules
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused

TURNED = 360.0
"""deg from which a panorama is spherical: Parrot's only one around the whole horizon."""

HALF = 180.0
"""deg from which it is Parrot's horizontal or vertical one; the Ai has a smaller one, the super wide."""

HOVERING = (FlightMode.HOLD, FlightMode.GUIDED, FlightMode.POSITION)


def panorama_type(wide: float, high: float, available: Container[AnimationType]) -> AnimationType:
    """Return the panorama for these angles (deg); `available` are those that the drone offers."""
    if abs(wide) >= TURNED:
        return AnimationType.SPHERICAL_PHOTO_PANORAMA
    small = AnimationType.SUPER_WIDE_PHOTO_PANORAMA
    if max(abs(wide), abs(high)) < HALF and small in available:
        return small
    is_wide = abs(wide) >= abs(high)
    return AnimationType.HORIZONTAL_180_PHOTO_PANORAMA if is_wide else AnimationType.VERTICAL_180_PHOTO_PANORAMA


class PanoramaService(Service, PlainTask):
    """Takes panoramas; the vehicle's flight task while it does."""

    rules = TaskRules(texts.PANORAMA)
    mode = FlightMode.HOLD

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_PANORAMA_CREATE: Action(
                self._create,
                still_holds=lambda command: self._is_active,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.IRREVOCABLE,
                group=ActionGroup.FLIGHT,
            )
        }

    def tick(self, now: float) -> float:
        if self.host.vehicle.control.active is self and not self._is_active:
            self.host.vehicle.control.release(self)
        return NEVER

    # Flight task.

    @property
    def _is_active(self) -> bool:
        return self.host.vehicle.control.active is self and self.host.drone.animations.state.is_running

    def end(self) -> list[asyncio.Task[None]]:
        """End this flight task: something else flies the drone now."""
        return [self.host.spawn(self._cancel())] if self.host.drone.animations.state.is_running else []

    async def _cancel(self) -> None:
        with contextlib.suppress(AnafiMavError):
            await self.host.drone.animations.cancel()

    # The command.

    async def _create(self, command: Command) -> None:
        """MAV_CMD_PANORAMA_CREATE: param1 and param2 angles (deg). Returns when the drone has begun."""
        drone, vehicle = self.host.drone, self.host.vehicle
        wide, high = (0.0 if math.isnan(angle) else angle for angle in command.params[:2])
        if not (math.isfinite(wide) and math.isfinite(high)):
            raise Refused(texts.PANORAMA, texts.NUMBER_MISSING, lasting=True)
        self._require_hovering()
        async with self.host.payload_history.turn(ActionGroup.PHOTO):  # an IMAGE_STOP_CAPTURE of now has to find it
            await enter_mode(self.host, CameraMode.PHOTO, texts.PANORAMA)
            async with vehicle.control.acquire(self, by=command.right, condition=self._require_hovering):
                await drone.animations.photo_panorama(panorama_type(wide, high, drone.animations.state.available or ()))

    def _require_hovering(self) -> None:
        """Refuse a panorama while something else uses the aircraft or the camera.

        Checked again after each wait: newer flight commands cancel the action, but the pilot and the drone itself send
        none.
        """
        drone, vehicle = self.host.drone, self.host.vehicle
        require_free(vehicle, texts.PANORAMA)
        if not vehicle.in_air:
            raise Refused(texts.PANORAMA, texts.NOT_IN_AIR)
        if drone.controller.pilot_acquired_control:
            raise Refused(texts.PANORAMA, texts.PILOT)
        hovers = drone.piloting.state.flying is FlyingState.HOVERING and vehicle.mode in HOVERING
        if not hovers or drone.piloting.moving or drone.piloting.sticks_held:
            raise Refused(texts.PANORAMA, texts.PANORAMA_MOVING)
        require_storage(drone, texts.PANORAMA)
        require_idle(drone, texts.PANORAMA)

"""Mission items that the gateway flies itself between two files.

A flight plan of Parrot's cannot express them.
"""

from __future__ import annotations

import math

from anafi_mav import mav_enums, texts, units
from anafi_mav.plans.plan import Item
from anafi_mav.plans.rules.rules_flight import is_relative
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.refusal import Rejected
from anafi_mav.vehicle.base.yaw import heading_of

FULL = 100.0
"""ZOOM_TYPE_RANGE: a share of what the camera can, %."""


async def fly_step(vehicle: Aircraft, item: Item) -> None:
    """Fly one item; returns when the drone has done it, or raises what kept it from that."""
    if not vehicle.in_air or vehicle.returning:
        raise Rejected(vehicle.activity)
    match item.command:
        case mav_enums.MAV_CMD_CONDITION_YAW:
            await _turn(vehicle, item)
        case mav_enums.MAV_CMD_SET_CAMERA_ZOOM:
            await _zoom(vehicle, item)
        case _:
            raise Rejected(texts.COMMAND_UNSUPPORTED.fill(command=item.command))


async def _turn(vehicle: Aircraft, item: Item) -> None:
    """Turn by MAV_CMD_CONDITION_YAW.

    param1 deg, param2 deg/s, param3 direction, param4 not 0: relative to the present heading. param2 unset or 0: the
    drone's own rate.
    """
    angle, rate, way, reference = item.params[:4]
    attitude = vehicle.drone.piloting.state.attitude
    if attitude is None:
        raise Rejected(texts.HEADING_UNKNOWN)
    turn = heading_of(angle or 0.0, way or 0.0, is_relative(reference), attitude.yaw * units.DEG_PER_RAD)
    await vehicle.drone.piloting.move_by(0.0, 0.0, 0.0, turn * units.RAD_PER_DEG, turn_rate_dps=rate or None)


async def _zoom(vehicle: Aircraft, item: Item) -> None:
    """param1 ZOOM_TYPE, param2 its value: RANGE is a share of the camera's range in %."""
    kind, value = item.params[:2]
    if kind != mav_enums.ZOOM_TYPE_RANGE or value is None or not math.isfinite(value):
        raise Rejected(texts.STEP_ZOOM_KIND)
    camera = vehicle.drone.camera
    largest = camera[0].zoom_max
    if largest is None:
        raise Rejected(texts.STEP_ZOOM_UNKNOWN)
    share = min(max(value / FULL, 0.0), 1.0)
    await camera.zoom(1.0 + (largest - 1.0) * share)

"""What stops, holds or ends something without the right of a client: none of it may end a landing or a return."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from anafi_mav.arsdk.messages.common import MavlinkFilePlayingStateChanged, MavlinkType, PlayingState
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.requester import Source
from anafi_mav.vehicle.link_loss import LossAction
from support.world import World


def system_of(w: World) -> Any:
    """The gateway's system of the one drone."""
    return w.gateway.systems[0]


def _service(system: Any, name: str) -> Any:
    return next(service for service in system.services if type(service).__name__ == name)


async def _call(function: Callable[..., Any], *args: Any) -> None:
    function(*args)


async def _ended(tasks: list[asyncio.Task[None]]) -> None:
    if tasks:
        await asyncio.wait(tasks)


OTHER_PLAN = MavlinkFilePlayingStateChanged(PlayingState.PLAYING, "other", MavlinkType.FLIGHT_PLAN)

CALLERS: dict[str, Callable[[Any], Awaitable[None]]] = {
    "link loss hold": lambda system: _service(system, "LinkLossService")._act(LossAction.HOLD),
    "link loss return": lambda system: _service(system, "LinkLossService")._act(LossAction.RETURN),
    "fence hold": lambda system: system.vehicle.hold(FlightMode.HOLD, Source.FENCE),
    "fence return": lambda system: _service(system, "FenceService")._return_or_hold(),
    "guided end": lambda system: _ended(system.vehicle.offboard.end()),
    "follow end": lambda system: _ended(system.vehicle.follow.end()),
    "orbit end": lambda system: _ended(_service(system, "OrbitService").end()),
    "mission end": lambda system: _ended(system.vehicle.mission.end()),
    "mission break": lambda system: _call(system.vehicle.mission._on_playing, OTHER_PLAN, 0.0),
    "setpoints silent": lambda system: _call(system.vehicle.offboard._expired),
    "target silent": lambda system: _call(system.vehicle.follow._expired),
    "sticks silent": lambda system: _call(system.vehicle.manual._expired),
    "gateway end": lambda system: system.let_go(),
}

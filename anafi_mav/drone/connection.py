"""`connect`: a connection to a drone for the length of an `async with` block.

A drone in the air is left hovering when the block ends.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from anafi_mav.arsdk.link.handshake import DISCOVERY_PORT
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.video.rtsp import DEFAULT_PORT as RTSP_PORT
from anafi_mav.drone.drone import Drone
from anafi_mav.drone.rest import HTTP_PORT
from anafi_mav.errors import AnafiMavError

log = logging.getLogger("anafi_mav")

HOVER_TIME = 2.0
"""s that leaving the block stays with a flying drone: centred sticks are not acknowledged, so they are repeated."""

_STANDING = frozenset({FlyingState.LANDED, FlyingState.EMERGENCY})
_STARTING = frozenset({FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF})
_LANDING = frozenset({FlyingState.LANDING, FlyingState.EMERGENCY_LANDING})


@asynccontextmanager
async def connect(
    address: str,
    *,
    interface: str | None = None,
    http_port: int = HTTP_PORT,
    rtsp_port: int = RTSP_PORT,
    discovery_port: int = DISCOVERY_PORT,
    name: str = "",
) -> AsyncIterator[Drone]:
    """Connect to the drone or Skycontroller at an IPv4 address; yield a connected `Drone`.

    A drone has one controller: connecting displaces the previous one. `interface` names the network interface to use
    (Linux). `name` is used in the log. The ports are Parrot's unless a simulator has others.

    When the block ends, by an exception too, everything that it started is stopped: motors that idle are stopped, and
    a drone in the air hovers, with two exceptions: a landing and a return home continue. Without a link the drone
    then returns home after `HomeState.delay_s` if it knows home. A drone that the pilot at a Skycontroller flies is
    left alone.

    Raises `LinkLost` when nothing answers or the connection is refused, `RemoteProtocolError` when what answers is no
    drone, `CommandTimeout` when the drone does not report its states, `LocalProtocolError` for a port that is none.
    """
    drone = Drone(
        address,
        interface=interface,
        http_port=http_port,
        rtsp_port=rtsp_port,
        discovery_port=discovery_port,
        name=name,
    )
    await drone.connect()
    try:
        yield drone
    finally:
        try:
            await _settle(drone)
        except AnafiMavError as error:
            log.warning("%s: state unknown when the connection ended: %s", drone.name, error)
        finally:
            await drone.close()


async def _settle(drone: Drone) -> None:
    """Stop idling motors, or hover; a landing and a return continue."""
    piloting, home = drone.piloting, drone.home
    if not drone.connected:
        return
    is_pilots = drone.controller.pilot_has_source and not piloting.has_launched
    if piloting.about_to_fly or (piloting.state.flying in _STARTING and not is_pilots):
        await piloting.land()
    flying = piloting.state.flying
    if flying in _STANDING or flying in _LANDING:
        return
    if home.state.returning or drone.controller.pilot_has_source:
        doing = "returns home" if home.state.returning else "the Skycontroller's pilot flies"
        log.warning("%s: left in the air: %s", drone.name, doing)
        return
    try:
        await piloting.stop()
        delay = home.state.delay_s
        after = "its own delay" if delay is None else f"{delay} s"
        log.warning("%s: left in the air: hovers, returns home after %s if it knows home", drone.name, after)
    finally:
        if drone.connected:
            await asyncio.wait([drone.lost], timeout=HOVER_TIME)

"""PCMDs before a return: flag 0 whatever was sent before, none while the Skycontroller pilot has the source."""

from __future__ import annotations

import asyncio

from support.scripted_device import ScriptedDevice

from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.rth import RthState, StateReason
from anafi_mav.drone import Drone


async def flying(drone: Drone, device: ScriptedDevice) -> None:
    heard = asyncio.ensure_future(drone.expect(ardrone3.FlyingStateChanged))
    await asyncio.sleep(0)
    device.say(ardrone3.FlyingStateChanged(FlyingState.FLYING))
    await heard


async def test_return_home_after_silent_sticks_sends_flag_zero_first(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.PENDING, StateReason.USER_REQUEST)]
    await drone.piloting.return_home()
    await device.until(ardrone3.PCMD, 3)
    assert [(p.flag, p.roll, p.pitch, p.yaw, p.gaz) for p in device.got(ardrone3.PCMD)] == 3 * [(0, 0, 0, 0, 0)]


async def test_return_home_with_pilot_in_control_sends_no_pcmd(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    drone.piloting.pilot_has_source = lambda: True
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.PENDING, StateReason.USER_REQUEST)]
    await drone.piloting.return_home()
    assert device.got(ardrone3.PCMD) == []

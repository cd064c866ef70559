"""The sign of the reported roll, found out while the drone is flown, and what is refused when it is the other one."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.roll_records import remember_roll
from support.setpoints import POSITION_ONLY, VELOCITY_ONLY, allow_speed, engage, local, streaming
from support.world import HOLD, HOME, World, loopback, world

from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.sim.world.wind import WindSpec
from anafi_mav.texts import ROLL_SIGN_INVERTED as INVERTED
from anafi_mav.texts import ROLL_SIGN_VERIFIED as VERIFIED
from anafi_mav.vehicle.base.roll_sign import RollSign

SET_MODE, ORBIT = dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_DO_ORBIT
ACCEPTED, REJECTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_TEMPORARILY_REJECTED
INVERT = frozenset({Quirk.ROLL_INVERTED})


def east_and_west(w: World) -> Any:
    """Setpoints with the nose to the north that turn round every time the drone has flown 3 m to one side."""
    speed = [3.0]

    def setpoint() -> Any:
        if w.drone.pose.east > 3.0:
            speed[0] = -3.0
        elif w.drone.pose.east < -3.0:
            speed[0] = 3.0
        return local(VELOCITY_ONLY & ~0x400, v=(0.0, speed[0], 0.0))

    return setpoint


def texts(w: World, since: int = 0) -> list[str]:
    return [m.text for _, m in w.client.since(since, "STATUSTEXT")]


def most_tilt(w: World, since: float, until: float = math.inf) -> float:
    """deg: the drone's own, by its poses."""
    poses = [e.args for e in w.drone.log if e.kind == "pose" and since <= e.t <= until]
    return max(math.degrees(math.hypot(pose["roll"], pose["pitch"])) for pose in poses)


async def said(w: World, text: str, since: int = 0, timeout: float = 60.0) -> None:
    await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=since, timeout=timeout)


async def test_velocity_setpoints_with_normal_roll_verify_its_sign() -> None:
    async with world(speed=1.0) as w:
        allow_speed(w)
        await w.take_off()
        began = w.drone.log[-1].t
        async with streaming(w.client, east_and_west(w)):
            await engage(w.client, "px4")
            await said(w, VERIFIED)
        assert most_tilt(w, began) < 12.0
        assert "Tilt limit 10 deg: roll sign not verified" in texts(w)


async def test_velocity_setpoints_with_inverted_roll_hover_and_are_refused() -> None:
    async with world(speed=1.0) as w:
        w.drone.faults.quirks = INVERT
        allow_speed(w)
        await w.take_off()
        async with streaming(w.client, east_and_west(w)):
            await engage(w.client, "px4")
            await said(w, INVERTED)
            known = w.drone.log[-1].t
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
            await said(w, "Offboard ended: roll sign inverted")
            await w.drone.wait_log(lambda e: math.hypot(w.drone.pose.vn, w.drone.pose.ve) < 0.3, 10.0)
            mark = w.client.mark()
            assert (await w.client.command(SET_MODE, 1, 6, 0)).result == REJECTED
            await said(w, "Offboard refused: roll sign inverted", since=mark)
        assert most_tilt(w, 0.0, known) < 12.0
        assert (await w.client.command(ORBIT, 10.0, 2.0, 0, 0, x=HOME[0], y=HOME[1])).result == REJECTED
        await said(w, "Orbit refused: roll sign inverted")
        assert (await w.client.command(SET_MODE, 1, 4, 8)).result == REJECTED
        await said(w, "Follow refused: roll sign inverted")
        # Sticks need no sign, and ATTITUDE has the right one now.
        assert (await w.client.command(SET_MODE, 1, 3, 0)).result == ACCEPTED
        stick = dialect.MAVLink_manual_control_message(1, 0, 500, 500, 0, 0)
        async with streaming(w.client, stick):
            await w.client.wait("ATTITUDE", lambda m: m.roll > 0.05 and w.drone.pose.roll > 0.05)
        # A position is a move of the drone's own.
        async with streaming(w.client, local(POSITION_ONLY, at=(6.0, 0.0, -5.0))):
            await engage(w.client, "px4")
            await w.drone.wait_log(lambda e: math.dist((w.drone.pose.north, w.drone.pose.east), (6.0, 0.0)) < 0.7, 20.0)


@pytest.mark.parametrize("quirks", [frozenset(), INVERT], ids=["assumed", "inverted"])
async def test_velocity_setpoints_with_unverified_roll_stay_bounded(quirks: frozenset[Quirk]) -> None:
    """200 ms and a quarter of the datagrams lost, both ways, in 3 m/s of wind from the side."""
    async with world(speed=1.0) as w:
        w.drone.faults.quirks = quirks
        allow_speed(w)
        await w.take_off()
        w.drone.wind.spec = WindSpec(3.0, 90.0)
        w.drone.faults.up = w.drone.faults.down = Impairment(loss=0.25, delay=0.2)
        began = w.drone.log[-1].t
        async with streaming(w.client, east_and_west(w)):
            await engage(w.client, "px4")
            await said(w, INVERTED if quirks else VERIFIED)
            known = w.drone.log[-1].t
        assert most_tilt(w, began, known) < 13.0
        speeds = [
            math.hypot(e.args["vn"], e.args["ve"]) for e in w.drone.log if e.kind == "pose" and began < e.t < known
        ]
        assert max(speeds) < 5.5


@pytest.mark.parametrize("firmware", ["1.8.2", "1.8.1"])
async def test_inverted_roll_is_kept_for_the_same_firmware_only(tmp_path: Path, firmware: str) -> None:
    drone, address = loopback(), loopback()
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone),),
        state=str(tmp_path),
    )
    async with Simulator([DroneSpec(address=drone, home=HOME, http_port=None)], speed=3.0, seed=1) as simulator:
        remember_roll(tmp_path, simulator.drones[0], RollSign.INVERTED, firmware)
        async with Gateway(config) as gateway:
            w = World(simulator, gateway, address)
            await w.connect()
            assert await gateway.ready(10.0)
            await w.client.wait("GLOBAL_POSITION_INT", since=0)
            await w.take_off()
            ack = await w.client.command(ORBIT, 10.0, 2.0, 0, 0, x=HOME[0], y=HOME[1])
            assert ack.result == (REJECTED if firmware == "1.8.2" else ACCEPTED)
            await w.client.close()
            await simulator.close()

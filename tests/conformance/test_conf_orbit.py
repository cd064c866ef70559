"""Orbits: conformance items 78 and 79, and what ends them. Judged by the drone's true pose."""

from __future__ import annotations

import asyncio
import itertools
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.mav import NAN
from support.plans import ACCEPTED as TAKEN
from support.plans import FENCE, circle, upload
from support.setpoints import allow_speed, motion, said
from support.world import HOLD, HOME, World, world

from anafi_mav import geo, units
from anafi_mav.arsdk.messages import piloting_style
from anafi_mav.sim.world.faults import Impairment

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
ORBIT = dialect.MAV_CMD_DO_ORBIT
CIRCLING = {"px4": 0x01030000, "ardupilot": 7}
GLOBAL, RELATIVE = dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT

AWAY = (0.0, 20.0)
"""m north and east of where the drone takes off: the centre."""
CENTRE = geo.destination(*HOME[:2], *AWAY)


def around(pose: dict[str, Any]) -> tuple[float, float]:
    """(distance from the centre in m, bearing from it in rad) of a true pose."""
    north, east = pose["north"] - AWAY[0], pose["east"] - AWAY[1]
    return math.hypot(north, east), math.atan2(east, north)


async def lap(w: World, radius: float, seconds: float) -> list[dict[str, Any]]:
    """The true poses of so many simulated seconds, from when the drone is on the circle."""
    began = await w.drone.wait_log(
        lambda e: (
            e.kind == "pose"
            and abs(around(e.args)[0] - abs(radius)) < 1.5
            and math.hypot(e.args["vn"], e.args["ve"]) > 2.0
        ),
        60.0,
        since=w.drone.log[-1].t,
    )
    ended = await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > began.t + seconds, seconds + 10.0)
    return [e.args for e in w.drone.log if e.kind == "pose" and began.t <= e.t <= ended.t]


@pytest.mark.parametrize(
    ("flavour", "frame", "z", "radius"),
    [
        ("px4", GLOBAL, HOME[2] + 10.0, 10.0),  # QGroundControl
        ("px4", RELATIVE, HOME[2] + 10.0, -10.0),  # MAVSDK says AMSL in this frame
        ("ardupilot", RELATIVE, 10.0, 10.0),
    ],
)
async def test_conf_078_orbit(flavour: str, frame: int, z: float, radius: float) -> None:
    async with world(flavour=flavour, speed=1.0) as w:  # the loops are closed in real time
        await w.take_off(10.0)
        ack = await w.client.command(ORBIT, radius, 3.0, 5, NAN, frame=frame, x=CENTRE[0], y=CENTRE[1], z=z)
        assert ack.result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == CIRCLING[flavour])
        poses = await lap(w, radius, 14.0)
        assert all(abs(around(pose)[0] - 10.0) < 2.0 for pose in poses), [round(around(p)[0], 1) for p in poses]
        assert all(abs(pose["up"] - 10.0) < 1.0 for pose in poses)
        turned = sum(units.wrap_pi(around(b)[1] - around(a)[1]) for a, b in itertools.pairwise(poses))
        assert turned * math.copysign(1.0, radius) > 3.0  # of the 3.6 rad that 14 s at 2.6 m/s on 10 m are
        # The nose looks at the centre.
        looks = [abs(units.wrap_pi(pose["yaw"] - around(pose)[1] - math.pi)) for pose in poses[len(poses) // 2 :]]
        assert max(looks) < 0.5
        assert (await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.hold)
        await w.drone.wait_log(
            lambda e: e.kind == "pose" and math.hypot(e.args["vn"], e.args["ve"]) < 0.3, 10.0, since=w.drone.log[-1].t
        )


async def test_orbit_over_a_late_link_stays_on_its_circle() -> None:
    """0.7 s from a stick to the report of its effect, and a tenth of all datagrams lost: the drone must not swing."""
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        allow_speed(w)
        late = Impairment(loss=0.1, delay=0.35)
        w.drone.faults.up, w.drone.faults.down = late, late
        z = HOME[2] + 10.0
        command = w.client.command(ORBIT, 10.0, 3.0, 5, NAN, frame=GLOBAL, x=CENTRE[0], y=CENTRE[1], z=z, timeout=30.0)
        assert (await command).result == ACCEPTED
        poses = (await lap(w, 10.0, 45.0))[-600:]
        assert all(abs(around(pose)[0] - 10.0) < 2.0 for pose in poses), [round(around(p)[0], 1) for p in poses]
        assert all(abs(pose["up"] - 10.0) < 1.0 for pose in poses)
        assert max(math.hypot(pose["vn"], pose["ve"]) for pose in poses) < 4.5


@both
async def test_conf_079_execution_status(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(10.0)
        assert w.client.since(0, "ORBIT_EXECUTION_STATUS") == []
        z = HOME[2] + 12.0
        mark = w.client.mark()
        ack = await w.client.command(ORBIT, -10.0, 2.0, 5, NAN, frame=GLOBAL, x=CENTRE[0], y=CENTRE[1], z=z)
        assert ack.result == ACCEPTED
        for _ in range(3):
            observed = await w.client.wait("ORBIT_EXECUTION_STATUS", timeout=1.0)
        assert (observed.radius, observed.frame, observed.z) == (-10.0, GLOBAL, pytest.approx(z, abs=0.1))
        assert (observed.x, observed.y) == (round(CENTRE[0] * 1e7), round(CENTRE[1] * 1e7))
        assert w.client.since(mark, "ORBIT_EXECUTION_STATUS")
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, w.modes.hold)).result == ACCEPTED
        mark = w.client.mark()
        for _ in range(2):
            await w.client.wait("HEARTBEAT")
        assert w.client.since(mark, "ORBIT_EXECUTION_STATUS") == []


async def test_an_orbit_of_so_many_radians_ends_in_hold() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        ack = await w.client.command(
            ORBIT, 8.0, 3.0, 0, math.pi / 2, frame=GLOBAL, x=CENTRE[0], y=CENTRE[1], z=HOME[2] + 10.0
        )
        assert ack.result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == CIRCLING["px4"])
        mark = w.client.mark()
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark, timeout=40.0)
        await w.client.wait("STATUSTEXT", lambda m: "angle flown" in m.text, since=mark)


@pytest.mark.parametrize("bearing", [0.1, 3.0, 5.6])
async def test_orbit_through_an_exclusion_zone_is_refused(bearing: float) -> None:
    """A zone of 3 m on a circle of 60 m, at a bearing in rad."""
    async with world() as w:
        at = geo.destination(*HOME[:2], 60.0 * math.cos(bearing), 60.0 * math.sin(bearing))
        assert (await upload(w.client, [circle(at, 3.0, inclusion=False)], FENCE)).type == TAKEN
        await w.take_off(10.0)
        mark = w.client.mark()
        ack = await w.client.command(ORBIT, 60.0, 3.0, frame=GLOBAL, x=HOME[0], y=HOME[1], z=HOME[2] + 10.0)
        assert ack.result == DENIED
        await said(w.client, "path crosses exclusion", mark)


async def test_orbit_that_has_ended_is_flown_when_sent_again() -> None:
    """The same command within the time of a retransmission, after the orbit has ended for want of GPS."""
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        place = {"x": HOME[0], "y": HOME[1], "z": HOME[2] + 10.0}
        assert (await w.client.command(ORBIT, 4.0, 2.0, frame=GLOBAL, **place)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and (e.args["roll"] or e.args["pitch"]), 10.0)
        mark = w.client.mark()
        w.drone.faults.gps = False
        await said(w.client, "Orbit ended", mark)
        w.drone.faults.gps = True
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type >= dialect.GPS_FIX_TYPE_3D_FIX, since=w.client.mark())
        mark = w.client.mark()
        assert (await w.client.command(ORBIT, 4.0, 2.0, frame=GLOBAL, **place)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == CIRCLING["px4"], since=mark, timeout=3.0)


async def test_without_gps_the_orbit_ends_in_a_hover() -> None:
    async with world() as w:
        await w.take_off(10.0)
        ack = await w.client.command(ORBIT, 8.0, 3.0, frame=GLOBAL, x=HOME[0], y=HOME[1], z=HOME[2] + 10.0)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(
            lambda e: e.name == "ardrone3.Piloting.PCMD" and (e.args["roll"], e.args["pitch"]) != (0, 0), 30.0
        )
        w.drone.faults.gps = False
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, timeout=10.0)
        flown = len(w.commands("ardrone3.Piloting.PCMD"))
        await w.drone.wait_log(lambda e: len(w.commands("ardrone3.Piloting.PCMD")) > flown + 5)
        last = w.commands("ardrone3.Piloting.PCMD")[flown:]
        assert {(e.args["roll"], e.args["pitch"]) for e in last} == {(0, 0)}


async def test_orbit_with_camera_relative_sticks_is_ended_and_refused() -> None:
    """Ahead would be where the camera looks: the orbit ends in a hover, and there is no other while that is so."""
    orbit: dict[str, Any] = {"frame": GLOBAL, "x": HOME[0], "y": HOME[1], "z": HOME[2] + 10.0}
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        assert (await w.client.command(ORBIT, 8.0, 3.0, **orbit)).result == ACCEPTED
        await w.drone.wait_log(
            lambda e: e.name == "ardrone3.Piloting.PCMD" and (e.args["roll"], e.args["pitch"]) != (0, 0), 30.0
        )
        mark = w.client.mark()
        style = piloting_style.SetStyle(piloting_style.PilotingStyleStyle.CAMERA_OPERATED)
        w.drone.firmware.receive(style, asyncio.get_running_loop().time())
        await said(w.client, "Orbit ended: sticks relative to camera", mark)
        ended = asyncio.get_running_loop().time()
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark)
        await w.drone.wait_log(
            lambda e: e.kind == "pose" and math.hypot(e.args["vn"], e.args["ve"]) < 0.3, 10.0, since=ended
        )
        assert (await w.client.command(ORBIT, 8.0, 3.0, **orbit)).result == REJECTED
        await said(w.client, "Orbit refused: sticks relative to camera", mark)
        assert motion(w, ended) == []


@pytest.mark.parametrize(
    ("parameters", "result"),
    [
        ((1.0, 3.0, 5, NAN), DENIED),  # too small
        ((1e5, 3.0, 5, NAN), DENIED),
        ((math.inf, 3.0, 5, NAN), DENIED),
        ((10.0, -3.0, 5, NAN), DENIED),
        ((10.0, math.inf, 5, NAN), DENIED),
        ((10.0, 3.0, 9, NAN), DENIED),
        ((10.0, 3.0, 5, -1.0), DENIED),
    ],
)
async def test_invalid_orbits_are_refused(parameters: tuple[float, ...], result: int) -> None:
    async with world() as w:
        await w.take_off(5.0)
        ack = await w.client.command(ORBIT, *parameters, frame=GLOBAL, x=CENTRE[0], y=CENTRE[1], z=HOME[2] + 10.0)
        assert ack.result == result
        assert w.commands("ardrone3.Piloting.moveTo") == []


async def test_no_orbit_on_the_ground() -> None:
    async with world() as w:
        ack = await w.client.command(ORBIT, 10.0, frame=GLOBAL, x=CENTRE[0], y=CENTRE[1], z=HOME[2] + 10.0)
        assert ack.result == REJECTED

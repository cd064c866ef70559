"""Item 107 of the conformance list: following a target, in both flavours, by where the drone truly went."""

from __future__ import annotations

import asyncio
import math
import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.mav import NAN, Client
from support.params import read
from support.setpoints import allow_speed, heard, idle_mode, motion, said, streaming
from support.world import HOLD, HOME, World, world

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.messages import ardrone3, piloting_style

SET_MODE = mav_enums.MAV_CMD_DO_SET_MODE
PX4_FOLLOW, COPTER_FOLLOW = 0x08040000, 23
REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED


def now() -> float:
    return asyncio.get_running_loop().time()


def target(
    north: float, east: float, velocity: tuple[float, float] | None = None, altitude: float = HOME[2], **more: Any
) -> Any:
    """FOLLOW_TARGET, m from where the drone took off."""
    latitude, longitude = more.get("place") or geo.destination(*HOME[:2], north, east)
    vel = [NAN] * 3 if velocity is None else [*velocity, 0.0]
    return dialect.MAVLink_follow_target_message(
        0,
        1 if velocity is None else 3,
        round(latitude * 1e7),
        round(longitude * 1e7),
        altitude,
        vel,
        [NAN] * 3,
        [1.0, NAN, NAN, NAN],
        [NAN] * 3,
        [NAN] * 3,
        0,
    )


async def follow(client: Client, flavour: str) -> int:
    """Ask for mode Follow; the result."""
    parameters = (1, 4, 8) if flavour == "px4" else (1, COPTER_FOLLOW)
    return int((await client.command(SET_MODE, *parameters)).result)


def mode(flavour: str) -> int:
    return PX4_FOLLOW if flavour == "px4" else COPTER_FOLLOW


async def write(w: World, name: str, value: float, kind: int = 9) -> None:
    mark = w.client.mark()
    w.client.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), value, kind))
    assert (await w.client.wait("PARAM_VALUE", lambda m: m.param_id == name, since=mark)).param_value == value


@both
async def test_conf_107_a_target_leads(flavour: str) -> None:
    """It walks to the north-east; the drone comes behind it, as high and as far as commanded, and looks at it."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        allow_speed(w)
        prefix = ("FLW_TGT_HT", "FLW_TGT_DST") if flavour == "px4" else ("ANF_FOLLOW_HT", "ANF_FOLLOW_DST")
        await write(w, prefix[0], 10.0)
        await write(w, prefix[1], 6.0)
        mark = w.client.mark()
        assert await follow(w.client, flavour) == 0
        await w.client.heartbeat(lambda beat: beat.custom_mode == mode(flavour), since=mark)
        began = now()

        def where() -> tuple[float, float]:
            walked = 1.5 * (now() - began) * math.sqrt(0.5)
            return 5.0 + walked, walked

        async with streaming(w.client, lambda: target(*where(), (1.5 * math.sqrt(0.5), 1.5 * math.sqrt(0.5))), 0.5):
            await asyncio.sleep(12.0)
            pose, (north, east) = w.drone.pose, where()
        assert math.hypot(pose.north - north, pose.east - east) == pytest.approx(6.0, abs=1.0)
        assert math.degrees(math.atan2(east - pose.east, north - pose.north)) == pytest.approx(45.0, abs=12.0)
        assert math.degrees(pose.yaw) == pytest.approx(45.0, abs=12.0)
        assert pose.up == pytest.approx(10.0, abs=0.5)
        assert (pose.vn, pose.ve) == pytest.approx((1.06, 1.06), abs=0.4)


async def test_ardupilot_offsets_place_the_drone() -> None:
    """4 m behind a target that walks to the north-east and 3 m to its right: 5 m at 143 deg from its course."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        allow_speed(w)
        for name, value in (("FOLL_OFS_X", -4.0), ("FOLL_OFS_Y", 3.0), ("ANF_FOLLOW_HT", 10.0)):
            await write(w, name, value)
        for name, value in (("FOLL_OFS_X", -4.0), ("ANF_FOLLOW_DST", 5.0), ("ANF_FOLLOW_ANG", 143.13)):
            assert (await read(w.client, name)).param_value == pytest.approx(value, abs=0.01)
        began, half = now(), math.sqrt(0.5)

        def where() -> tuple[float, float]:
            walked = 1.5 * (now() - began) * half
            return 5.0 + walked, walked

        def is_as_fast() -> bool:
            pose = w.drone.pose
            return now() - began > 5.0 and (pose.vn, pose.ve) == pytest.approx((1.06, 1.06), abs=0.1)

        assert await follow(w.client, "ardupilot") == 0
        async with streaming(w.client, lambda: target(*where(), (1.5 * half, 1.5 * half)), 0.5):
            await w.client.wait("GLOBAL_POSITION_INT", lambda _: is_as_fast(), timeout=30.0)
            pose, (north, east) = w.drone.pose, where()
        assert pose.north - north == pytest.approx((-4.0 - 3.0) * half, abs=1.0)
        assert pose.east - east == pytest.approx((-4.0 + 3.0) * half, abs=1.0)
        assert pose.up == pytest.approx(10.0, abs=0.5)


async def test_ardupilot_offset_at_the_target_is_refused() -> None:
    async with world(flavour="ardupilot") as w:
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_set_message(1, 1, b"FOLL_OFS_X", 0.0, 9))
        kept = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "FOLL_OFS_X", since=mark)
        assert kept.param_value == -8.0
        text = "FOLL_OFS_X not set: 1-100 m from target"
        await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=mark)


async def test_follow_height_below_1_m_keeps_the_present_height() -> None:
    """MAVSDK's example sends an altitude of 0, which above sea level is far below the ground."""
    async with world(speed=1.0) as w:
        await w.take_off(6.0)
        allow_speed(w)
        target_mode = struct.unpack("<f", struct.pack("<i", 2))[0]  # an INT32 travels as the bits of a float
        await write(w, "FLW_TGT_ALT_M", target_mode, dialect.MAV_PARAM_TYPE_INT32)
        await w.client.wait("GLOBAL_POSITION_INT", lambda m: abs(m.relative_alt / 1000 - w.drone.pose.up) < 0.1)
        assert await follow(w.client, "px4") == 0
        mark = w.client.mark()
        async with streaming(w.client, target(30.0, 0.0, altitude=0.0), 0.5):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 15.0, 20.0)
            await w.client.wait(
                "STATUSTEXT", lambda m: "Follow height kept: target asks for -27 m" in m.text, since=mark
            )
        assert w.drone.pose.up == pytest.approx(6.0, abs=0.5)


@both
async def test_a_target_that_falls_silent_is_hovered_for(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        assert await follow(w.client, flavour) == 0
        async with streaming(w.client, target(40.0, 0.0), 0.5) as sent:
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
        mark, last = w.client.mark(), sent[-1]
        hold = HOLD if flavour == "px4" else 17
        await w.client.heartbeat(lambda beat: beat.custom_mode == hold, since=mark)
        assert now() - last < 3.0
        await said(w.client, "target lost")
        ended = now()
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.2, 10.0, since=ended)
        assert [e for e in motion(w, ended) if e.t > ended + 0.1] == []
        assert idle_mode(flavour)


@both
async def test_target_whose_receiver_is_lost_stands_at_its_last_position(flavour: str) -> None:
    """A station whose receiver has lost its satellites repeats the last position and velocity."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        allow_speed(w)
        assert await follow(w.client, flavour) == 0
        began = now()

        def place() -> float:
            return 10.0 + 4.0 * (now() - began)

        async with streaming(w.client, lambda: target(place(), 0.0, (4.0, 0.0)), 0.25):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 20.0, 20.0)
        last, mark = place(), now()
        async with streaming(w.client, target(last, 0.0, (4.0, 0.0)), 0.25):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] < -0.5, 20.0, since=mark)
            turned = now()
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.02, 20.0, since=turned)
        assert w.drone.pose.north == pytest.approx(last - 8.0, abs=1.0)


async def test_follow_target_of_the_first_sender_leads() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        assert await follow(w.client, "px4") == 0
        async with streaming(w.client, target(0.0, 8.0), 0.5), streaming(other, target(0.0, -80.0), 0.2):
            await asyncio.sleep(3.0)
        assert w.drone.pose.east > -2.0


async def test_without_a_target_it_hovers_and_gives_up() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        mark = w.client.mark()
        assert await follow(w.client, "px4") == 0
        began = now()
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark, timeout=15.0)
        await said(w.client, "no target received", mark)
        assert now() - began > 8.0
        assert motion(w, began) == []


@both
async def test_conf_107_denied_on_the_ground_and_without_gps(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        assert await follow(w.client, flavour) == REJECTED
        await said(w.client, "Follow refused: take off first")
        await w.take_off(8.0)
        w.drone.faults.gps = False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2)
        assert await follow(w.client, flavour) == REJECTED
        await said(w.client, "Follow refused: no GPS fix")


def position(north: float, east: float) -> Any:
    """GLOBAL_POSITION_INT as QGroundControl sends it for an ArduPilot: its own place at the height of home."""
    latitude, longitude = geo.destination(*HOME[:2], north, east)
    return dialect.MAVLink_global_position_int_message(
        0, round(latitude * 1e7), round(longitude * 1e7), round(HOME[2] * 1e3), 0, 0, 0, 0, 0
    )


async def test_conf_107_position_of_an_ardupilot_station_leads() -> None:
    """The station that chose the mode leads; another one, and a system that it passes on, do not."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        other = await w.connect(sysid=250)
        system = Client(9, 1)

        def positions() -> Any:
            w.client.send_raw(system.pack(position(0.0, -60.0)))
            return position(40.0, 0.0)

        await w.take_off(8.0)
        async with streaming(other, position(0.0, -80.0), 0.25):
            assert await follow(w.client, "ardupilot") == 0
            async with streaming(w.client, positions, 0.25):
                await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 31.0, 30.0)
                assert w.drone.pose.east == pytest.approx(0.0, abs=1.0)
            mark = w.client.mark()
            await w.client.heartbeat(lambda beat: beat.custom_mode == 17, since=mark)
            await said(w.client, "target lost")


async def test_position_of_a_px4_station_is_no_target() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        mark, began = w.client.mark(), now()
        assert await follow(w.client, "px4") == 0
        async with streaming(w.client, position(40.0, 0.0), 0.25):
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark, timeout=15.0)
        await said(w.client, "no target received", mark)
        assert motion(w, began) == []


async def test_where_it_may_not_fly_it_does_not_follow() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        w.drone.firmware.receive(ardrone3.NoFlyOverMaxDistance(1), now())
        w.drone.firmware.receive(ardrone3.MaxDistance(30.0), now())
        await w.client.wait("ATTITUDE")
        assert await follow(w.client, "px4") == 0
        began = now()
        for seen, text in [
            (target(60.0, 0.0), " m > geofence "),
            (target(0.0, 0.0, place=(0.0, 0.0)), "latitude and longitude are 0"),
            (target(900.0, 0.0), "900 m away"),
            (target(10.0, 0.0, (60.0, 0.0)), "60 m/s"),
        ]:
            async with streaming(w.client, seen, 0.3):
                await said(w.client, text)
        assert motion(w, began) == []
        await write(w, "FLW_TGT_HT", 400.0)
        assert await follow(w.client, "px4") == 0
        async with streaming(w.client, target(10.0, 0.0), 0.3):
            await said(w.client, "ceiling")
        assert motion(w, began) == []


@both
async def test_sticks_that_follow_the_camera_follow_no_target(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        assert await follow(w.client, flavour) == 0
        async with streaming(w.client, target(60.0, 0.0), 0.3):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
            mark = w.client.mark()
            style = piloting_style.SetStyle(piloting_style.PilotingStyleStyle.CAMERA_OPERATED)
            w.drone.firmware.receive(style, now())
            await said(w.client, "Follow ended: sticks relative to camera", mark)
            ended = now()
            hold = HOLD if flavour == "px4" else 17
            await w.client.heartbeat(lambda beat: beat.custom_mode == hold, since=mark)
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.2, 10.0, since=ended)
            assert await follow(w.client, flavour) == REJECTED
            assert motion(w, ended) == []


async def test_another_order_ends_following() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        assert await follow(w.client, "px4") == 0
        async with streaming(w.client, target(40.0, 0.0), 0.3):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
            assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == 0
            began = now()
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)
        assert [e for e in heard(w, "PCMD", since=began) if any(e.args[a] for a in ("roll", "pitch", "gaz"))] == []


async def test_the_height_of_the_target() -> None:
    """FLW_TGT_ALT_M 2: the target stands 6 m above the take-off point."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        await write(w, "FLW_TGT_HT", 9.0)
        w.client.send(dialect.MAVLink_param_set_message(1, 1, b"FLW_TGT_ALT_M", _int32(2), 6))
        await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "FLW_TGT_ALT_M")
        assert await follow(w.client, "px4") == 0
        async with streaming(w.client, target(8.0, 0.0, altitude=HOME[2] + 6.0), 0.4):
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["up"] - 15.0) < 0.3, 15.0)


def _int32(value: int) -> float:
    """An INT32 in the bits of a float, as PX4's parameters travel."""
    packed: float = struct.unpack("<f", struct.pack("<i", value))[0]
    return packed

"""Items 105 and 106 of the conformance list: setpoints of programs, in both flavours, judged by what the drone did."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import watched
from support.flavours import both
from support.setpoints import (
    NO_ACCELERATION,
    NO_POSITION,
    NO_VELOCITY,
    NO_YAW,
    NO_YAW_RATE,
    POSITION_ONLY,
    VELOCITY_ONLY,
    allow_speed,
    arrived,
    attitude,
    earth,
    engage,
    heard,
    idle_mode,
    local,
    motion,
    said,
    streaming,
    texts,
    turn_to,
)
from support.world import HOLD, HOME, World, world

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.messages import ardrone3, piloting_style
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.vehicle.base.aircraft import FlightSettings
from anafi_mav.vehicle.offboard.stream import LATE_AFTER_STREAM

REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
SET_MODE, GOTO = mav_enums.MAV_CMD_DO_SET_MODE, mav_enums.MAV_CMD_DO_REPOSITION
NAN = math.nan

HOVER_WITHIN = 0.5
"""s after the last setpoint within which the drone has been commanded to hover (the issue)."""


STEERS = local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))


def now() -> float:
    return asyncio.get_running_loop().time()


# Item 105: engaging, and what silence does.


async def test_conf_105_refused_without_setpoints() -> None:
    async with world() as w:
        await w.take_off()
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, 1, 6, 0)).result == REJECTED
        await said(w.client, "no setpoints received", mark)
        await w.client.wait("HEARTBEAT")
        assert {beat.custom_mode for _, beat in w.client.since(mark, "HEARTBEAT")} == {HOLD}


@both
@pytest.mark.parametrize(
    "setpoint",
    [
        attitude(pitch=-0.1),
        STEERS,
        local(NO_POSITION | NO_VELOCITY | NO_YAW | NO_YAW_RATE, a=(1.0, 0.0, 0.0)),
        local(NO_ACCELERATION | NO_YAW | NO_YAW_RATE, at=(60.0, 0.0, -8.0), v=(2.0, 0.0, 0.0)),
    ],
    ids=["attitude", "velocity", "acceleration", "position and velocity"],
)
async def test_conf_105_silence_of_sticks(flavour: str, setpoint: Any) -> None:
    """The sticks are level within half a second of the last setpoint, and mode Hold shows half a second later.

    A velocity of ArduPilot's Guided lasts for GUID_TIMEOUT instead.
    """
    limit = FlightSettings.guided_timeout if flavour == "ardupilot" and setpoint is STEERS else HOVER_WITHIN
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        async with streaming(w.client, setpoint) as sent:
            await engage(w.client, flavour)
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] > 0, 5.0)
        mark, last = w.client.mark(), sent[-1]
        await w.client.heartbeat(lambda beat: beat.custom_mode == idle_mode(flavour), since=mark)
        if limit == HOVER_WITHIN:  # ArduPilot's number is the same before and after
            assert now() - last < 1.0
        # Zeros are repeated.
        await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] == 0, 5.0, since=now())
        # By their order: a repetition that was due when the silence ended may arrive together with the first zeros.
        sticks = heard(w, "PCMD")
        level = max(number for number, e in enumerate(sticks) if e.args["pitch"] != 0) + 1
        assert sticks[level].t - last <= limit
        assert limit == HOVER_WITHIN or sticks[level - 1].t - last > HOVER_WITHIN


@both
@pytest.mark.parametrize(
    ("setpoint", "command", "cancels"),
    [
        (local(POSITION_ONLY, at=(60.0, 0.0, -8.0)), "moveTo", "CancelMoveTo"),
        (earth(POSITION_ONLY, 6, 60.0, 0.0, 8.0), "moveTo", "CancelMoveTo"),
        (local(POSITION_ONLY, 12, at=(60.0, 0.0, 0.0)), "moveBy", "moveBy"),
    ],
    ids=["local", "global", "offset"],
)
async def test_conf_105_silence_of_a_move(flavour: str, setpoint: Any, command: str, cancels: str) -> None:
    """A move whose sender dies ends in a hover within half a second."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        async with streaming(w.client, setpoint) as sent:
            await engage(w.client, flavour)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 10.0)
            assert len(heard(w, command)) == (1 if command == "moveTo" else 2)  # the climb was a moveBy
        last, mark = sent[-1], w.client.mark()
        halt = await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith(cancels), 5.0, since=last)
        assert halt.t - last <= HOVER_WITHIN
        if command == "moveBy":
            assert set(halt.args.values()) == {0.0}
        await w.client.heartbeat(lambda beat: beat.custom_mode == idle_mode(flavour), since=mark)
        assert now() - last < 1.0
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.2, 10.0, since=halt.t)
        assert w.drone.pose.north < 30.0


async def test_conf_105_late_position_of_an_ended_stream_is_dropped() -> None:
    """In Guided a lone position is flown to its end, but not one that a bad link delivers when its sender is dead."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        place = local(POSITION_ONLY, at=(60.0, 0.0, -8.0))
        async with streaming(w.client, place) as sent:
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 10.0)
        await w.drone.wait_log(lambda e: e.name.endswith("CancelMoveTo"), 5.0, since=sent[-1])
        await asyncio.sleep(1.0)  # as late as that
        late = now()
        w.client.send(place)
        await w.drone.wait_log(lambda e: e.name.endswith(".moveTo"), 5.0, since=late)
        halt = await w.drone.wait_log(lambda e: e.name.endswith("CancelMoveTo"), 5.0, since=late)
        assert halt.t - late <= HOVER_WITHIN
        # When the stream is long over, the same words are an order of their own.
        await asyncio.sleep(LATE_AFTER_STREAM)
        again = now()
        w.client.send(place)
        await arrived(w, again)
        assert w.drone.pose.north == pytest.approx(60.0, abs=0.5)
        assert heard(w, "CancelMoveTo", since=again) == []


async def test_setpoints_of_ardupilots_clients_fly_in_guided_only() -> None:
    async with world(flavour="ardupilot") as w:
        await w.take_off(8.0)
        assert (await w.client.command(SET_MODE, 1, 17)).result == 0  # Brake
        began = now()
        async with streaming(w.client, local(POSITION_ONLY, at=(20.0, 0.0, -8.0))):
            await said(w.client, ", not Guided")
            await asyncio.sleep(0.3)
        assert motion(w, began) == []


async def test_setpoints_of_px4s_clients_do_not_fly_in_guided() -> None:
    async with world(flavour="ardupilot", also="px4") as w:
        await w.take_off(8.0)
        other = await w.connect(sysid=250, port=5761)
        await other.wait("HEARTBEAT")
        began = now()
        async with streaming(other, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await asyncio.sleep(0.5)
        assert motion(w, began) == []


@both
async def test_setpoint_is_flown_on_arrival(flavour: str) -> None:
    """Not at the next of the 20 per second, and not at the drone's next report."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        pitch = [-0.1]
        async with streaming(w.client, lambda: attitude(pitch=pitch[0]), every=0.2):
            await engage(w.client, flavour)
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] > 0, 5.0)
            delays = []
            for lean in (0.1, -0.1, 0.1, -0.1, 0.1):
                pitch[0] = lean
                began = now()
                w.client.send(attitude(pitch=lean))
                answer = await w.drone.wait_log(
                    lambda e, lean=lean: e.name.endswith(".PCMD") and e.args["pitch"] * lean < 0, 2.0, since=began
                )
                delays.append(answer.t - began)
            began = now()
            await watched(1.0)
            assert 17 <= len(heard(w, "PCMD", since=began)) <= 30  # 20 a second, and one with each setpoint that moves
        assert sorted(delays)[2] < 0.025


# Item 106: frames, masks, headings.

LOOKS_EAST = 90.0

Placed = tuple[Any, tuple[float, float, float]]

PLACES: list[Placed] = [
    (local(POSITION_ONLY, 1, at=(12.0, -6.0, -10.0)), (12.0, -6.0, 10.0)),
    (earth(POSITION_ONLY, 5, -3.0, 6.0, HOME[2] + 7.0), (-3.0, 6.0, 7.0)),
    (earth(POSITION_ONLY, 6, 8.0, 0.0, 12.0), (8.0, 0.0, 12.0)),
    (earth(POSITION_ONLY, 0, 2.0, -4.0, HOME[2] + 9.0), (2.0, -4.0, 9.0)),
    (earth(POSITION_ONLY, 3, -2.0, 3.0, 10.0), (-2.0, 3.0, 10.0)),
]
"""Setpoints and where they lead: north, east, up."""

OFFSETS: list[Placed] = [
    (local(POSITION_ONLY, 7, at=(8.0, -4.0, -2.0)), (8.0, -4.0, 2.0)),
    # With the nose to the east, front is east and right is south.
    (local(POSITION_ONLY, 8, at=(8.0, 4.0, 3.0)), (-4.0, 8.0, -3.0)),
    (local(POSITION_ONLY, 9, at=(-8.0, 0.0, -2.0)), (0.0, -8.0, 2.0)),
    (local(POSITION_ONLY, 12, at=(3.0, -4.0, 1.0)), (4.0, 3.0, -1.0)),
]
"""Setpoints and what they lead by: north, east, up."""


async def flown_to(w: World, setpoint: Any, flavour: str, place: tuple[float, float, float]) -> None:
    began = now()
    async with streaming(w.client, setpoint):
        await engage(w.client, flavour)
        await arrived(w, began)
        await asyncio.sleep(0.5)  # it is repeated, and stays there
        pose = w.drone.pose
    assert (pose.north, pose.east, pose.up) == pytest.approx(place, abs=1.0), setpoint
    assert len([e for e in motion(w, began) if not e.name.endswith("PCMD")]) == 1
    await w.client.heartbeat(lambda beat: beat.custom_mode == idle_mode(flavour))


@both
async def test_conf_106_positions(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(8.0)
        await turn_to(w, LOOKS_EAST)
        for setpoint, place in PLACES:
            await flown_to(w, setpoint, flavour, place)
        pose = w.drone.pose
        height = local(POSITION_ONLY | 0x003, 1, at=(50.0, 50.0, -9.0))
        await flown_to(w, height, flavour, (pose.north, pose.east, 9.0))
        await flown_to(w, earth(POSITION_ONLY | 0x004, 6, 2.0, -3.0, 100.0), flavour, (2.0, -3.0, 9.0))


@both
async def test_conf_106_offsets(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(8.0)
        await turn_to(w, LOOKS_EAST)
        for setpoint, (north, east, up) in OFFSETS:
            pose = w.drone.pose
            await flown_to(w, setpoint, flavour, (pose.north + north, pose.east + east, pose.up + up))


@both
async def test_conf_106_velocities(flavour: str) -> None:
    """What is wanted (x, y) in each frame, and where it leads (north, east) with the nose to the east."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        allow_speed(w)
        await turn_to(w, LOOKS_EAST)
        for frame, (x, y), (north, east) in [
            (1, (2.0, 0.0), (2.0, 0.0)),
            (7, (0.0, 2.0), (0.0, 2.0)),
            (8, (2.0, 0.0), (0.0, 2.0)),
            (9, (0.0, 2.0), (-2.0, 0.0)),
            (12, (-2.0, 0.0), (0.0, -2.0)),
            (5, (-2.0, 0.0), (-2.0, 0.0)),
            (6, (0.0, -2.0), (0.0, -2.0)),
        ]:
            v = (x, y, -0.2)
            setpoint = earth(VELOCITY_ONLY, frame, v=v) if frame in (5, 6) else local(VELOCITY_ONLY, frame, v=v)
            async with streaming(w.client, setpoint):
                await engage(w.client, flavour)
                await asyncio.sleep(2.5)
                pose = w.drone.pose
            assert (pose.vn, pose.ve, pose.vd) == pytest.approx((north, east, -0.2), abs=0.3), frame
            assert pose.yaw == pytest.approx(math.radians(LOOKS_EAST), abs=0.1)


@both
async def test_conf_106_headings(flavour: str) -> None:
    """In the frames of the body a heading counts from where the nose is, and repeating it turns no further."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        w.drone.firmware.receive(ardrone3.MaxRotationSpeed(90.0), now())
        await w.client.wait("ATTITUDE")
        for setpoint, heading in [
            (local(VELOCITY_ONLY & ~NO_YAW, 1, yaw=math.pi / 2), 90.0),
            (local(VELOCITY_ONLY & ~NO_YAW, 8, yaw=math.pi / 4), 135.0),
            (local(VELOCITY_ONLY & ~NO_YAW, 12, yaw=-math.pi / 2), 45.0),
            (local(VELOCITY_ONLY & ~NO_YAW, 7, yaw=-math.pi / 4), -45.0),
            (local(POSITION_ONLY & ~NO_YAW, 1, at=(3.0, 0.0, -8.0), yaw=0.0), 0.0),
            (local(POSITION_ONLY & ~NO_YAW, 12, at=(3.0, 0.0, 0.0), yaw=math.pi / 2), 90.0),
            (earth(POSITION_ONLY & ~NO_YAW, 6, 0.0, 0.0, 8.0, yaw=math.pi), 180.0),
            (local(POSITION_ONLY & ~NO_YAW | NO_POSITION, 9, yaw=-math.pi / 2), 90.0),
        ]:

            def off(yaw: float, heading: float = heading) -> float:
                return abs(math.remainder(yaw - math.radians(heading), 2.0 * math.pi))

            def there(entry: Any, off: Any = off) -> bool:
                return entry.kind == "pose" and off(entry.args["yaw"]) < 0.1

            async with streaming(w.client, setpoint):
                await engage(w.client, flavour)
                await w.drone.wait_log(
                    lambda e, off=off: e.kind == "pose" and off(e.args["yaw"]) < 0.1, 15.0, since=now()
                )
                await asyncio.sleep(1.0)
                assert off(w.drone.pose.yaw) < 0.1, heading


@both
async def test_conf_106_yaw_rates(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        for frame, rate in ((1, 0.5), (8, -0.5), (12, 0.3)):
            async with streaming(w.client, local(VELOCITY_ONLY & ~NO_YAW_RATE, frame, yaw_rate=rate)):
                await engage(w.client, flavour)
                await asyncio.sleep(1.0)
                poses = [e for e in w.drone.log if e.kind == "pose"]
                began = poses[-1]
                await asyncio.sleep(1.5)
                ended = [e for e in w.drone.log if e.kind == "pose"][-1]
            turned = math.remainder(ended.args["yaw"] - began.args["yaw"], 2.0 * math.pi)
            assert turned / (ended.t - began.t) == pytest.approx(rate, rel=0.15)


@both
async def test_conf_106_other_frames_are_refused(flavour: str) -> None:
    """Each by a sender of its own: to one sender the same reason is sent once."""
    async with world(flavour=flavour) as w:
        await w.take_off(8.0)
        began = now()
        for frame in (0, 2, 3, 4, 5, 6, 10, 11, 13, 20, 255):
            sender = await w.connect(sysid=100)
            sender.send(local(POSITION_ONLY, frame, at=(9.0, 0.0, -9.0)))
            await said(sender, f"frame {frame}")
        for frame in (1, 7, 8, 9, 12, 14, 21):
            sender = await w.connect(sysid=100)
            sender.send(earth(POSITION_ONLY, frame, 9.0, 0.0, 9.0))
            await said(sender, f"frame {frame} unsupported")
        assert motion(w, began) == []


async def test_conf_106_a_global_setpoint_above_terrain_is_refused() -> None:
    async with world() as w:
        await w.take_off()
        w.client.send(earth(POSITION_ONLY, 11, 9.0, 0.0, 9.0))
        await said(w.client, "Setpoint refused: terrain frame 11 unsupported")
        assert (await w.client.command(SET_MODE, 1, 6, 0)).result == REJECTED


# Mixed masks.


@both
async def test_a_velocity_and_a_height(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        allow_speed(w)
        mask = NO_ACCELERATION | NO_YAW | NO_YAW_RATE | 0x003 | 0x020  # x and y as velocities, z as a position
        async with streaming(w.client, local(mask, at=(0.0, 0.0, -11.0), v=(0.0, 3.0, 9.0))):
            await engage(w.client, flavour)
            await asyncio.sleep(5.0)
            pose = w.drone.pose
        assert pose.up == pytest.approx(11.0, abs=0.4)
        assert (pose.vn, pose.ve) == pytest.approx((0.0, 3.0), abs=0.3)


async def test_a_place_and_a_climb_rate() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        allow_speed(w)
        mask = NO_ACCELERATION | NO_YAW | NO_YAW_RATE | 0x004 | 0x018  # x and y as positions, z as a velocity
        async with streaming(w.client, local(mask, at=(6.0, -4.0, 0.0), v=(0.0, 0.0, -0.5))):
            await engage(w.client, "px4")
            await asyncio.sleep(6.0)
            pose = w.drone.pose
        assert (pose.north, pose.east) == pytest.approx((6.0, -4.0), abs=0.7)
        assert pose.up == pytest.approx(11.0, abs=0.6)


async def test_position_with_velocity_feed_forward_is_followed_without_lag() -> None:
    """MAVSDK's set_position_velocity_ned: a target that moves is followed without the lag of a position alone."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        allow_speed(w)
        mask = NO_ACCELERATION | NO_YAW | NO_YAW_RATE
        began = now()
        async with streaming(w.client, lambda: local(mask, at=(2.0 * (now() - began), 0.0, -8.0), v=(2.0, 0.0, 0.0))):
            await engage(w.client, "px4")
            await asyncio.sleep(6.0)
            pose, target = w.drone.pose, 2.0 * (now() - began)
        assert pose.vn == pytest.approx(2.0, abs=0.4)
        assert pose.north == pytest.approx(target, abs=1.5)


async def test_setpoint_with_position_and_body_velocity_axes() -> None:
    """Keep 3 m to the right of the line, and fly along it: front is east here, right is south."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        allow_speed(w)
        await turn_to(w, LOOKS_EAST)
        mask = NO_ACCELERATION | NO_YAW | NO_YAW_RATE | 0x001 | 0x004 | 0x010
        async with streaming(w.client, local(mask, 12, at=(0.0, 3.0, 0.0), v=(1.5, 0.0, 0.0))):
            await engage(w.client, "px4")
            await asyncio.sleep(6.0)
            pose = w.drone.pose
        assert pose.north == pytest.approx(-3.0, abs=0.6)
        assert pose.ve == pytest.approx(1.5, abs=0.3)
        assert pose.up == pytest.approx(8.0, abs=0.3)


async def test_an_acceleration() -> None:
    """1 m/s2 to the west; drag takes the more the faster it flies, and silence ends it."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        # The climb rate begins with the drone's own, which is still rising a little.
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vd"]) < 0.02, 10.0, since=now())
        mask = NO_POSITION | NO_VELOCITY | NO_YAW | NO_YAW_RATE
        async with streaming(w.client, local(mask, a=(0.0, -1.0, 0.0))):
            await engage(w.client, "px4")
            began = now()
            await asyncio.sleep(2.0)
            pose = w.drone.pose
        assert -1.15 < pose.ve / (now() - began) < -0.6
        assert pose.vn == pytest.approx(0.0, abs=0.2)
        assert pose.up == pytest.approx(8.0, abs=0.3)


# Repetition and change.


async def test_moving_position_setpoint_is_followed_in_steps() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        began = now()
        async with streaming(w.client, lambda: local(POSITION_ONLY, at=(3.0 * (now() - began), 0.0, -8.0))):
            await engage(w.client, "px4")
            began_flying = now()
            await asyncio.sleep(3.0)
            moves = heard(w, "moveTo", since=began_flying)
            assert 5 <= len(moves) <= 3.0 / 0.2 + 2
        assert w.drone.pose.north > 2.0
        final = geo.offset(*HOME[:2], moves[-1].args["latitude"], moves[-1].args["longitude"])
        assert final[0] == pytest.approx(3.0 * (moves[-1].t - began), abs=0.6)


async def test_speed_command_changes_the_move_to_a_streamed_position() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        async with streaming(w.client, local(POSITION_ONLY, at=(60.0, 0.0, -8.0))):
            await engage(w.client, "px4")
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 4.0, 20.0)
            assert (await w.client.command(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1, 2.0, -1)).result == 0
            move = await w.drone.wait_log(lambda e: e.name == "move.extended_move_to", 5.0)
            assert move.args["max_horizontal_speed"] == 2.0
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] == pytest.approx(2.0, abs=0.2), 10.0)
            assert w.drone.pose.north < 50.0


async def test_from_a_position_to_a_velocity_and_back() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        allow_speed(w)
        setpoint = [local(POSITION_ONLY, at=(40.0, 0.0, -8.0))]
        async with streaming(w.client, lambda: setpoint[0]):
            await engage(w.client, "px4")
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
            setpoint[0] = local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["ve"] > 1.5 and e.args["vn"] < 0.5, 10.0)
            assert len(heard(w, "CancelMoveTo")) == 1
            setpoint[0] = local(POSITION_ONLY, at=(5.0, 5.0, -8.0))
            began = now()
            await arrived(w, began)
        assert (w.drone.pose.north, w.drone.pose.east) == pytest.approx((5.0, 5.0), abs=1.0)


async def test_late_end_of_a_move_is_not_that_of_its_successor() -> None:
    """The drone reports the cancelled move when the same place has been commanded again."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        allow_speed(w)
        place = local(POSITION_ONLY, at=(40.0, 0.0, -8.0))
        setpoint = [place]
        async with streaming(w.client, lambda: setpoint[0]):
            await engage(w.client, "px4")
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
            w.drone.faults.down = Impairment(delay=0.4)
            began, mark = now(), w.client.mark()
            setpoint[0] = local(VELOCITY_ONLY, v=(1.0, 0.0, 0.0))
            await w.drone.wait_log(lambda e: e.name.endswith("CancelMoveTo"), 5.0, since=began)
            setpoint[0] = place
            again = await w.drone.wait_log(
                lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 0, 5.0, since=now()
            )
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > again.t + 1.0, 5.0)
            assert [text for text in texts(w.client, mark) if text.startswith("Setpoint")] == []


# Refusals: with a text, never clamped.


WRONG = [
    (local(POSITION_ONLY, at=(5.0, 0.0, -0.5)), "0.5 m < 1.0 m"),
    (local(POSITION_ONLY, at=(5.0, 0.0, 3.0)), "-3.0 m < 1.0 m"),
    (local(POSITION_ONLY, at=(5.0, 0.0, -151.0)), "151.0 m > ceiling 150 m"),
    (local(POSITION_ONLY, 7, at=(0.0, 0.0, 7.9)), " m < 1.0 m"),
    (local(POSITION_ONLY, 12, at=(0.0, 0.0, -250.0)), "ceiling"),
    (local(POSITION_ONLY, at=(150.0, 0.0, -8.0)), "150 m > geofence 100 m"),
    (local(POSITION_ONLY, 8, at=(160.0, 0.0, 0.0)), "160 m > geofence 100 m"),
    (earth(POSITION_ONLY, 6, 170.0, 0.0, 8.0), "170 m > geofence 100 m"),
    (local(POSITION_ONLY, at=(NAN, 0.0, -8.0)), "a value is not a number"),
    (local(VELOCITY_ONLY, v=(500.0, 0.0, 0.0)), "500 m/s is too fast"),
    (local(VELOCITY_ONLY & ~NO_YAW_RATE, yaw_rate=30.0), "30 rad/s is too fast"),
    (earth(POSITION_ONLY, 6, height=8.0, place=(0.0, 0.0)), "latitude and longitude are 0"),
    (earth(POSITION_ONLY, 6, height=8.0, place=(91.0, 2.0)), "not a place on earth"),
    (earth(POSITION_ONLY, 5, 5.0, 0.0, HOME[2] + 0.7), "0.7 m < 1.0 m"),
    (local(0xDFF), "all fields are ignored"),
    (local(0x207, a=(1.0, 0.0, 0.0)), "forces are unsupported"),
]
"""Setpoints, and why they are not flown."""


@both
async def test_conf_106_invalid_setpoints_are_dropped_with_a_text(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(8.0)
        w.drone.firmware.receive(ardrone3.NoFlyOverMaxDistance(1), now())
        await w.client.wait("ATTITUDE")
        began = now()
        for setpoint, text in WRONG:
            sender = await w.connect(sysid=100)
            sender.send(setpoint)
            await said(sender, text)
            sender.send(setpoint)
        if flavour == "px4":
            assert (await w.client.command(SET_MODE, 1, 6, 0)).result == REJECTED
        assert motion(w, began) == []
        await w.client.wait("HEARTBEAT")
        for client in w.clients:  # a repetition is not reported again, and nothing of it to others
            refusals = [line for line in texts(client) if line.startswith("Setpoint refused")]
            assert len(refusals) == (client is not w.client)


async def test_a_wrong_setpoint_among_right_ones_changes_nothing() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        async with streaming(w.client, local(POSITION_ONLY, at=(30.0, 0.0, -8.0))):
            await engage(w.client, "px4")
            w.client.send(local(POSITION_ONLY, at=(30.0, 0.0, -500.0)))
            await said(w.client, "ceiling")
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 15.0)
            assert len(heard(w, "moveTo")) == 1


async def test_tilt_of_ten_degrees_cannot_hold_five_m_s() -> None:
    """The factory's MaxTilt: it is said, and not raised."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(5.0, 0.0, 0.0))):
            await engage(w.client, "px4")
            await said(w.client, "MaxTilt 10: ")
            await asyncio.sleep(1.0)
        assert heard(w, "MaxTilt") == []
        assert max(e.args["pitch"] for e in heard(w, "PCMD")) == 100


# What setpoints never fight.


@both
@pytest.mark.parametrize("how", ["ordered", "forced"])
async def test_thrust_does_not_stop_a_landing(flavour: str, how: str) -> None:
    """A positive gaz would cancel it (ardrone3.xml 1-0-3)."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(4.0)
        async with streaming(w.client, attitude(thrust=1.0)):
            await engage(w.client, flavour)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 4.5, 10.0)
            began = now()
            if how == "ordered":
                assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == 0
            else:
                w.drone.faults.battery = 1
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0, since=began)
            assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 245)).result == 0
        landing = next(e for e in w.drone.log if e.name == "flying" and "landing" in e.args["to"] and e.t > began)
        assert heard(w, "PCMD", since=landing.t + 0.1) == []  # one may have been on its way when it began by itself
        assert w.drone.flying_state.name == "LANDED"


@both
async def test_velocities_do_not_fight_the_drones_own_return(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(3.0, 0.0, 0.0))):
            await engage(w.client, flavour)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 10.0)
            w.drone.faults.battery = 12
            home = await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["state"] == 1, 90.0)
            await asyncio.sleep(1.0)
            assert heard(w, "abort") == []
            assert {e.args["pitch"] for e in heard(w, "PCMD", since=home.t + 0.1)} <= {0}


# ArduPilot's single setpoints.


async def test_single_offset_is_flown_to_its_end() -> None:
    """QGroundControl's "change altitude" for ArduPilot is one message; silence does not end it."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        began = now()
        w.client.send(local(POSITION_ONLY | 0x003, 7, at=(0.0, 0.0, -4.0)))
        await arrived(w, began)
        assert w.drone.pose.up == pytest.approx(12.0, abs=0.4)
        assert now() - began > 1.0  # longer than any silence
        beats = {beat.custom_mode for _, beat in w.client.since(0, "HEARTBEAT")[-2:]}
        assert beats == {4}


async def test_single_position_is_flown_to_its_end() -> None:
    """Mission Planner's "fly to here" is one SET_POSITION_TARGET_GLOBAL_INT."""
    async with world(flavour="ardupilot") as w:
        await w.take_off(8.0)
        began = now()
        w.client.send(earth(POSITION_ONLY, 6, 20.0, 10.0, 12.0))
        await arrived(w, began)
        assert (w.drone.pose.north, w.drone.pose.east, w.drone.pose.up) == pytest.approx((20.0, 10.0, 12.0), abs=1.0)


async def test_second_setpoint_begins_a_stream_ended_by_silence() -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        setpoint = local(POSITION_ONLY, at=(60.0, 0.0, -8.0))
        w.client.send(setpoint)
        await w.drone.wait_log(lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 0, 5.0)
        w.client.send(setpoint)
        last = now()
        halt = await w.drone.wait_log(lambda e: e.name.endswith("CancelMoveTo"), 2.0, since=last)
        assert halt.t - last <= HOVER_WITHIN
        assert len(heard(w, "moveTo")) == 1


async def test_another_order_ends_a_single_setpoint() -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        w.client.send(local(POSITION_ONLY, at=(60.0, 0.0, -8.0)))
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
        assert (await w.client.command(SET_MODE, 1, 17)).result == 0
        assert heard(w, "CancelMoveTo") != []
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.2, 10.0, since=now())
        assert w.drone.pose.north < 30.0


async def test_a_setpoint_does_not_overtake_a_newer_order() -> None:
    """Both in one segment: the landing is flown."""
    async with world(flavour="ardupilot") as w:
        await w.take_off(8.0)
        client = w.client
        data = client.pack(local(POSITION_ONLY, at=(20.0, 0.0, -8.0)))
        data += client.pack(dialect.MAVLink_command_long_message(1, 1, dialect.MAV_CMD_NAV_LAND, 0, *[NAN] * 7))
        mark = client.mark()
        client.send_raw(data)
        ack = await client.wait("COMMAND_ACK", lambda m: m.command == 21 and m.result != 5, since=mark)
        assert ack.result == 0
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


@both
async def test_setpoints_with_camera_relative_sticks_are_refused(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        style = piloting_style.SetStyle(piloting_style.PilotingStyleStyle.CAMERA_OPERATED)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await engage(w.client, flavour)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 0.5, 10.0)
            w.drone.firmware.receive(style, now())
            await said(w.client, "relative to camera")
            began = now()
            if flavour == "px4":
                assert (await w.client.command(SET_MODE, 1, 6, 0)).result == REJECTED
            await asyncio.sleep(0.5)
        assert motion(w, began + 0.1) == []


async def test_repeated_offboard_command_does_not_interrupt_offboard() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with streaming(w.client, attitude(pitch=-0.1)):
            await engage(w.client, "px4")
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] > 0, 5.0)
            began = now()
            for _ in range(3):
                w.client.send(dialect.MAVLink_set_mode_message(1, 1, 0x00060000))
                await asyncio.sleep(0.2)
            assert {e.args["pitch"] for e in heard(w, "PCMD", since=began)} == {57}


# One pilot.


@both
async def test_setpoints_have_one_pilot(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        other = await w.connect(sysid=250)
        await w.take_off(8.0)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await engage(w.client, flavour)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 0.5, 10.0)
            async with streaming(other, local(POSITION_ONLY, at=(-50.0, 0.0, -8.0))):
                await said(other, "another program flies")
            assert heard(w, "moveTo") == []


# What is being flown is reported back.


async def test_flown_setpoint_is_reported_as_position_target() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        await turn_to(w, LOOKS_EAST)
        mark = w.client.mark()
        await w.client.wait("EXTENDED_SYS_STATE", since=mark)
        assert w.client.since(mark, "POSITION_TARGET_LOCAL_NED") == []
        setpoint = [local(POSITION_ONLY, 12, at=(10.0, 0.0, -1.0))]
        async with streaming(w.client, lambda: setpoint[0]):
            await engage(w.client, "px4")
            target = await w.client.wait("POSITION_TARGET_LOCAL_NED")
            assert (target.coordinate_frame, target.type_mask) == (1, POSITION_ONLY)
            assert (target.x, target.y, target.z) == pytest.approx((0.0, 10.0, -9.0), abs=0.7)
            place = await w.client.wait("POSITION_TARGET_GLOBAL_INT")
            assert place.coordinate_frame == 6
            assert geo.offset(*HOME[:2], place.lat_int / 1e7, place.lon_int / 1e7) == pytest.approx((0, 10.0), abs=0.7)
            assert place.alt == pytest.approx(9.0, abs=0.3)
            setpoint[0] = local(VELOCITY_ONLY & ~NO_YAW_RATE, 8, v=(1.0, 0.0, 0.5), yaw_rate=0.1)
            target = await w.client.wait("POSITION_TARGET_LOCAL_NED", lambda m: m.type_mask & NO_POSITION)
            assert target.type_mask == VELOCITY_ONLY & ~NO_YAW_RATE
            assert (target.vx, target.vy, target.vz) == pytest.approx((0.0, 1.0, 0.5), abs=0.2)
            assert target.yaw_rate == pytest.approx(0.1)
            lean = await w.client.wait("ATTITUDE_TARGET")
            assert lean.thrust < 0.5
            assert lean.body_yaw_rate == pytest.approx(0.1, abs=0.01)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        mark = w.client.mark()
        for _ in range(2):
            await w.client.wait("HEARTBEAT")
        assert w.client.since(mark, "ATTITUDE_TARGET") == []


async def test_goto_is_reported_as_position_target() -> None:
    async with world() as w:
        await w.take_off()
        place = geo.destination(*HOME[:2], 30.0, -10.0)
        assert (await w.client.command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=9.0)).result == 0
        observed = await w.client.wait("POSITION_TARGET_GLOBAL_INT")
        assert (observed.lat_int / 1e7, observed.lon_int / 1e7) == pytest.approx(place, abs=1e-6)
        assert observed.alt == pytest.approx(9.0)
        near = await w.client.wait("POSITION_TARGET_LOCAL_NED")
        assert (near.x, near.y, near.z) == pytest.approx((30.0, -10.0, -9.0), abs=0.1)


@pytest.mark.parametrize("frame", [1, 8])
async def test_position_is_held_against_a_velocity_that_leads_away(frame: int) -> None:
    """A program that keeps a velocity of 9 m/s with the position where the drone is; in frame 8 to the right."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        allow_speed(w)
        at, v = ((0.0, 0.0, -8.0), (9.0, 0.0, 0.0)) if frame == 1 else ((0.0, 0.0, 0.0), (0.0, 9.0, 0.0))
        async with streaming(w.client, local(NO_ACCELERATION | NO_YAW | NO_YAW_RATE, frame, at=at, v=v)):
            await engage(w.client, "px4")
            began = now()
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > began + 30.0, 40.0)
            # Where 9 m/s and the approach are equal: the root of 3 times the distance is 9.
            assert math.hypot(w.drone.pose.north, w.drone.pose.east) == pytest.approx(27.0, abs=3.0)
            assert math.hypot(w.drone.pose.vn, w.drone.pose.ve) < 1.0


async def test_height_is_held_against_a_climb_that_leads_away() -> None:
    """A climb of 20 m/s, far beyond the drone's own limit, with a height of 8 m."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        fastest = w.drone.firmware.settings.number("max_vertical_speed")
        setpoint = local(NO_ACCELERATION | NO_YAW | NO_YAW_RATE, at=(0.0, 0.0, -8.0), v=(0.0, 0.0, -20.0))
        async with streaming(w.client, setpoint):
            await engage(w.client, "px4")
            began = now()
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > began + 30.0, 40.0)
            assert w.drone.pose.up == pytest.approx(8.0 + fastest, abs=0.5)  # the height loop has 1 /s


async def test_velocity_levels_the_sticks_at_once_when_the_drone_no_longer_reports_its_own() -> None:
    """Without it the loop has no sticks for the setpoint: those of before would tilt the drone until they expire."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await engage(w.client, "px4")
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 10.0)
            mark = w.client.mark()
            report, unknown = w.drone.firmware.motion_report, ardrone3.SpeedChanged(NAN, NAN, NAN)
            w.drone.firmware.motion_report = lambda: [  # type: ignore[method-assign]
                unknown if isinstance(message, ardrone3.SpeedChanged) else message for message in report()
            ]
            await said(w.client, "velocity unknown", mark)
            began = now()
            await watched(1.0)
        assert [e for e in heard(w, "PCMD", since=began + 0.05) if e.args["pitch"]] == []


async def test_offboard_chosen_by_another_streaming_client_flies_its_setpoints() -> None:
    """An acceptance that left the setpoints of the client before in force would be untrue."""
    async with world(speed=1.0, clients=2) as w:
        await w.take_off(5.0)
        first, second = w.clients
        async with streaming(first, STEERS):
            await engage(first, "px4")
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
            async with streaming(second, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
                assert (await second.command(SET_MODE, 1, 6, 0)).result == dialect.MAV_RESULT_ACCEPTED
                await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["ve"] > 1.0 > e.args["vn"], 10.0)

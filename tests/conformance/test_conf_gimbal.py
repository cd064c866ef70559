"""Gimbal manager (conformance A9, C7, items 98-103), judged by the simulator's own gimbal."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.gimbal import (
    CONFIGURE,
    EARTH_FRAME,
    LEVEL,
    NAN,
    PITCHYAW,
    VEHICLE_FRAME,
    YAW_LOCK,
    beat,
    euler,
    looks,
    next_truth,
    rate,
    request,
    send_rates,
    truth,
)
from support.mav import Client
from support.world import World, world

from anafi_mav import units
from anafi_mav.arsdk.messages.gimbal import Axis, AxisLockState
from anafi_mav.drone import Aim
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim.world.faults import Impairment

ACCEPTED, DENIED, REJECTED, UNSUPPORTED = (
    dialect.MAV_RESULT_ACCEPTED,
    dialect.MAV_RESULT_DENIED,
    dialect.MAV_RESULT_TEMPORARILY_REJECTED,
    dialect.MAV_RESULT_UNSUPPORTED,
)
INFORMATION, STATUS, DEVICE, ATTITUDE = (
    dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION,
    dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS,
    dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_INFORMATION,
    dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS,
)
CAPABILITY = dialect.MAV_PROTOCOL_CAPABILITY_COMPONENT_IMPLEMENTS_GIMBAL_MANAGER
MODELS = [("4k", "px4"), ("thermal", "ardupilot"), ("usa", "px4"), ("ai", "ardupilot")]


async def angles(w: World, pitch: float, yaw: float = NAN, flags: int = LEVEL, device: float = 1) -> int:
    ack = await w.client.command(PITCHYAW, pitch, yaw, NAN, NAN, x=flags, y=0, z=device)
    return int(ack.result)


async def rates(w: World, pitch: float, yaw: float = NAN, flags: int = LEVEL) -> int:
    ack = await w.client.command(PITCHYAW, NAN, NAN, pitch, yaw, x=flags, y=0, z=1)
    return int(ack.result)


@pytest.mark.parametrize(("model", "flavour"), MODELS)
async def test_conf_098_gimbal_is_device_1_of_the_autopilot(model: str, flavour: str) -> None:
    async with world(model=model, flavour=flavour, speed=1.0) as w:
        version = await request(w.client, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION, "AUTOPILOT_VERSION")
        assert version.capabilities & CAPABILITY
        manager = await request(w.client, INFORMATION, "GIMBAL_MANAGER_INFORMATION")
        device = await request(w.client, DEVICE, "GIMBAL_DEVICE_INFORMATION")
        status = await request(w.client, STATUS, "GIMBAL_MANAGER_STATUS")
        attitude = await request(w.client, ATTITUDE, "GIMBAL_DEVICE_ATTITUDE_STATUS")
        for message in (manager, device, status, attitude):
            assert (message.get_srcComponent(), message.gimbal_device_id) == (1, 1)
        turns = bool(manager.cap_flags & dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS)
        assert turns is (model == "ai")
        assert manager.cap_flags & 0xFFFF == device.cap_flags
        assert not manager.cap_flags & dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_RETRACT
        wanted = (-36, 36, -116, 176, -48, 48) if model == "ai" else (-38, 38, -90, 90, 0, 0)
        for message in (manager, device):
            limits = (message.roll_min, message.roll_max, message.pitch_min, message.pitch_max)
            seen = [round(math.degrees(limit)) for limit in (*limits, message.yaw_min, message.yaw_max)]
            assert seen == list(wanted)
        assert (status.primary_control_sysid, status.primary_control_compid) == (0, 0)
        assert math.isnan(attitude.angular_velocity_y)

        # Angles and rates of every model; what it cannot turn is ignored (QGroundControl always sends yaw).
        assert await angles(w, -30.0, 20.0) == ACCEPTED
        await looks(w, pitch_absolute=-30.0, yaw_relative=20.0 if turns else 0.0)
        shown = euler(await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS"))
        assert shown == pytest.approx((0.0, -30.0, 20.0 if turns else 0.0), abs=2.0)
        assert await rates(w, 8.0, -4.0) == ACCEPTED
        assert await rate(w, "pitch_absolute") == pytest.approx(8.0, rel=0.1)
        if turns:
            assert await rate(w, "yaw_relative") == pytest.approx(-4.0, rel=0.1)
        assert await rates(w, 0.0, 0.0) == ACCEPTED
        assert await rate(w, "pitch_absolute") == 0.0
        assert await angles(w, NAN, 45.0) == ACCEPTED
        assert truth(w).pitch_absolute != 45.0


async def test_conf_101_command_as_long_and_int_moves_the_pitch() -> None:
    async with world(speed=1.0) as w:
        for device in (0, NAN, 1, 154):
            assert await angles(w, -20.0, device=device) == ACCEPTED
        assert await angles(w, -20.0, device=2) == DENIED
        await looks(w, pitch_absolute=-20.0)
        # MAVSDK's COMMAND_INT: x holds the flags as a whole number.
        mark = w.client.mark()
        params = (1, 1, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, PITCHYAW, 0, 0, -45.0, NAN, NAN, NAN, LEVEL, 0, 1.0)
        w.client.send(dialect.MAVLink_command_int_message(*params))
        await w.client.wait("COMMAND_ACK", lambda ack: ack.result == ACCEPTED, since=mark)
        await looks(w, pitch_absolute=-45.0)
        assert await angles(w, -170.0) == ACCEPTED  # clipped
        await looks(w, pitch_absolute=-90.0)
        assert await angles(w, -100.0) == ACCEPTED  # there already
        assert await angles(w, 4500.0) == DENIED  # centidegrees
        assert await angles(w, NAN) == DENIED
        assert await angles(w, 0.0, 0.0, flags=VEHICLE_FRAME | EARTH_FRAME) == DENIED
        assert await angles(w, 0.0, flags=dialect.GIMBAL_MANAGER_FLAGS_RETRACT) == UNSUPPORTED
        await looks(w, pitch_absolute=-90.0)
        mark = w.client.mark()
        ack = await w.client.command(PITCHYAW, x=dialect.GIMBAL_MANAGER_FLAGS_NEUTRAL)
        assert ack.result == ACCEPTED
        await looks(w, pitch_absolute=0.0)
        neutral = dialect.GIMBAL_DEVICE_FLAGS_NEUTRAL
        await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS", lambda m: m.flags & neutral, since=mark)
        assert await angles(w, -10.0) == ACCEPTED
        await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS", lambda m: not m.flags & neutral)


async def test_gimbal_command_for_a_locked_axis_is_rejected() -> None:
    async with world(speed=1.0) as w:
        w.drone.inject(AxisLockState(0, 1 << Axis.PITCH))
        await next_truth(w)
        assert await angles(w, -20.0) == REJECTED
        assert w.commands("gimbal.set_target") == []


# -- control


def control(status: Any) -> tuple[int, int, int, int]:
    return (
        status.primary_control_sysid,
        status.primary_control_compid,
        status.secondary_control_sysid,
        status.secondary_control_compid,
    )


async def configure(client: Client, *ids: float) -> int:
    ack = await client.command(CONFIGURE, *ids, z=1)
    return int(ack.result)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_conf_100_control_is_taken_stolen_and_released(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        station, program = w.client, await w.connect(245, 190)

        async def shows(*ids: int) -> None:
            await program.wait("GIMBAL_MANAGER_STATUS", lambda m: control(m) == ids, since=mark, timeout=1.0)

        # Without an owner every client moves it.
        for client, pitch in ((station, -5.0), (program, -10.0)):
            assert (await client.command(PITCHYAW, pitch, x=LEVEL)).result == ACCEPTED
        beat(station)
        mark = program.mark()
        assert await configure(station, 255, 190, -1, -1) == ACCEPTED
        await shows(255, 190, 0, 0)
        mark = program.mark()
        assert (await program.command(PITCHYAW, 30.0, x=LEVEL)).result == REJECTED
        await program.wait("STATUSTEXT", lambda m: m.text == "Gimbal refused: system 255 has control", since=mark)
        send_rates(program, 30.0)
        ack = await program.command(dialect.MAV_CMD_DO_SET_ROI_NONE)
        assert ack.result == REJECTED
        assert (await station.command(PITCHYAW, -15.0, x=LEVEL)).result == ACCEPTED
        await looks(w, pitch_absolute=-15.0)

        # MAVSDK takes both controls, and QGroundControl takes the first back: the program moves nothing any longer.
        beat(program)
        mark = program.mark()
        assert await configure(program, 245, 190, 245, 190) == ACCEPTED
        await shows(245, 190, 245, 190)
        assert (await station.command(PITCHYAW, 0.0, x=LEVEL)).result == REJECTED
        mark = program.mark()
        assert await configure(station, -2, -2, -1, -1) == ACCEPTED
        await shows(255, 190, 0, 0)
        assert (await program.command(PITCHYAW, 0.0, x=LEVEL)).result == REJECTED

        # A secondary client moves it, too. Who is not in control releases nothing.
        mark = program.mark()
        assert await configure(station, -1, -1, 245, 190) == ACCEPTED
        await shows(255, 190, 245, 190)
        assert (await program.command(PITCHYAW, -20.0, x=LEVEL)).result == ACCEPTED
        stranger = await w.connect(7, 1)
        assert await configure(stranger, -3, -3, -3, -3) == ACCEPTED
        assert await configure(stranger, 300, 1, -1, -1) == DENIED
        assert await configure(stranger, 7, 0, -1, -1) == DENIED
        assert (await stranger.command(PITCHYAW, 0.0, x=LEVEL)).result == REJECTED
        mark = program.mark()
        assert await configure(station, -3, -3, -1, -1) == ACCEPTED
        await shows(0, 0, 0, 0)
        assert (await stranger.command(PITCHYAW, -5.0, x=LEVEL)).result == ACCEPTED


async def test_control_ends_without_heartbeats_of_the_owner() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(245, 190)
        beat(w.client)
        assert await configure(w.client, 255, 190, -1, -1) == ACCEPTED
        mark = other.mark()
        free = await other.wait("GIMBAL_MANAGER_STATUS", lambda m: control(m)[0] == 0, since=mark, timeout=8.0)
        taken = [m for _, m in other.since(mark, "GIMBAL_MANAGER_STATUS") if control(m)[0] == 255]
        assert 4.0 < (free.time_boot_ms - taken[0].time_boot_ms) / 1e3 + 1.0 < 6.5
        await other.wait("STATUSTEXT", lambda m: m.text == "Gimbal free: system 255 is silent", since=mark)
        assert (await other.command(PITCHYAW, -5.0, x=LEVEL)).result == ACCEPTED


async def test_takeover_cancels_the_command_of_another_client() -> None:
    async with world() as w:
        other = await w.connect(245, 190)
        assert await angles(w, 0.0) == ACCEPTED
        w.drone.faults.unreported = frozenset({"gimbal.attitude"})  # so that it is not confirmed
        mark = w.client.mark()
        w.client.send_command(PITCHYAW, -40.0, NAN, NAN, NAN, x=LEVEL)
        await w.drone.wait_log(lambda e: e.name == "gimbal.set_target" and e.args["pitch"] == -40.0, 3.0)
        assert await configure(other, -2, -2, -1, -1) == ACCEPTED
        ack = await w.client.wait("COMMAND_ACK", since=mark)
        assert (ack.command, ack.result) == (PITCHYAW, newer.MAV_RESULT_CANCELLED)


# -- rates


async def test_conf_102_rates_by_message_end_a_second_after_the_last() -> None:
    async with world(speed=1.0) as w:
        send_rates(w.client, -10.0)
        assert await rate(w, "pitch_absolute", 2) == pytest.approx(-10.0, rel=0.1)
        send_rates(w.client, -10.0)
        sent = w.drone.firmware.time
        await stands(w)
        assert 1.0 <= w.drone.firmware.time - sent < 1.9
        assert truth(w).pitch_absolute == pytest.approx(-15.0, abs=4.0)
        # Zero ends it at once, also of an axis that is not named any longer.
        send_rates(w.client, 10.0)
        await next_truth(w)
        send_rates(w.client, 0.0)
        await stands(w, 3)
        # The other two messages, and angles in between.
        params = (1, 1, LEVEL, 1, NAN, NAN, 0.1, NAN)
        w.client.send(dialect.MAVLink_gimbal_manager_set_pitchyaw_message(*params))
        assert await rate(w, "pitch_absolute", 2) == pytest.approx(math.degrees(0.1), rel=0.1)
        w.client.send(dialect.MAVLink_gimbal_manager_set_pitchyaw_message(1, 1, LEVEL, 1, -0.5, NAN, NAN, NAN))
        await looks(w, pitch_absolute=math.degrees(-0.5))
        w.client.send(dialect.MAVLink_gimbal_manager_set_manual_control_message(1, 1, LEVEL, 1, NAN, NAN, 0.1, NAN))
        assert await rate(w, "pitch_absolute", 2) == pytest.approx(9.0, rel=0.1)  # a tenth of 90 deg/s
        w.client.send(dialect.MAVLink_gimbal_manager_set_manual_control_message(1, 1, LEVEL, 1, -0.5, NAN, NAN, NAN))
        await looks(w, pitch_absolute=-45.0)
        quaternion = units.quaternion_from_euler(math.radians(5.0), math.radians(-30.0), 0.0)
        w.client.send(dialect.MAVLink_gimbal_manager_set_attitude_message(1, 1, LEVEL, 0, quaternion, NAN, NAN, NAN))
        await looks(w, pitch_absolute=-30.0, roll_absolute=5.0)
        bad = [2.0, 0.0, 0.0, 0.0]
        w.client.send(dialect.MAVLink_gimbal_manager_set_attitude_message(1, 1, LEVEL, 0, bad, NAN, NAN, NAN))
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Gimbal refused: "), since=0)


async def stands(w: World, reports: int = 12) -> None:
    """Wait until the simulated gimbal does not turn from one report to the next."""
    before = await next_truth(w)
    for _ in range(reports):
        after = await next_truth(w)
        if after == before:
            return
        before = after
    raise AssertionError(f"it turns on: {truth(w)}")


async def test_rate_by_command_goes_on_until_its_client_is_silent() -> None:
    """MAVSDK's example sends one rate and waits five seconds; a client that never sends heartbeats is not missed."""
    async with world(speed=1.0) as w:
        silent = await w.connect(44, 191)
        ack = await silent.command(PITCHYAW, NAN, NAN, -3.0, NAN, x=LEVEL)
        assert ack.result == ACCEPTED
        began = w.drone.firmware.time
        while w.drone.firmware.time < began + 5.0:
            assert await rate(w, "pitch_absolute") == pytest.approx(-3.0, rel=0.1)
        beat(w.client)
        assert await rates(w, 3.0) == ACCEPTED
        began, mark = w.drone.firmware.time, w.client.mark()
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Gimbal stopped: system 255 is silent", timeout=5.0)
        assert 2.5 < w.drone.firmware.time - began < 4.0
        await stands(w, 4)
        assert w.client.since(mark, "COMMAND_ACK") == []


async def test_rate_ends_at_the_limit_by_release_and_by_takeover() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(245, 190)
        assert await angles(w, -80.0) == ACCEPTED
        await looks(w, pitch_absolute=-80.0)
        assert await rates(w, -20.0) == ACCEPTED
        await looks(w, pitch_absolute=-90.0)
        await w.drone.wait_log(
            lambda e: e.name == "gimbal.set_target" and e.args["control_mode"] == 1 and e.args["pitch"] == 0.0, 3.0
        )
        assert await rates(w, -20.0) == ACCEPTED  # at the limit already
        for taker, ids in ((w.client, (-3, -3, -3, -3)), (other, (-2, -2, -1, -1))):
            assert await configure(w.client, -2, -2, -1, -1) == ACCEPTED
            assert await rates(w, 5.0) == ACCEPTED
            assert await configure(taker, *ids) == ACCEPTED
            await stands(w, 4)


@pytest.mark.parametrize("loss", [0.0, 0.5])
async def test_axis_without_a_newer_target_does_not_turn_on(loss: float) -> None:
    """An Ai turns by rates of both axes; then one gets an angle, and the other one is named no longer, or held.

    The drone may lose targets: it acknowledges none.
    """
    async with world(model="ai", speed=1.0) as w:
        for by_message, hold in ((False, NAN), (False, 0.0), (True, NAN)):
            assert await angles(w, 0.0, 0.0) == ACCEPTED
            await looks(w, pitch_absolute=0.0, yaw_relative=0.0)
            if by_message:
                send_rates(w.client, 5.0, 5.0)
                await next_truth(w)
            else:
                assert await rates(w, 5.0, 5.0) == ACCEPTED
            w.drone.faults.up = Impairment(loss=loss)
            ack = await w.client.command(PITCHYAW, -30.0, NAN, NAN, hold, x=LEVEL)
            assert ack.result == ACCEPTED
            await looks(w, pitch_absolute=-30.0)
            for _ in range(12):
                before, after = await next_truth(w), await next_truth(w)
                if after == before:
                    break
            w.drone.faults.up = Impairment()
            assert after == before
            assert abs(after.yaw_relative) < 40.0  # not by the end of its range


# -- frames


async def test_conf_103_yaw_has_one_frame_and_agrees_with_the_heading() -> None:
    """An Ai that heads east: yaw to the nose and to north, each held while the nose turns."""
    async with world(model="ai", speed=2.0) as w:
        await w.take_off(5.0)

        async def turn_to(degrees: float, way: float) -> None:
            # An Ai rests 2.7 deg past a quarter turn: its yaw rate follows 0.2 s late. The second turn is that small.
            for direction in (way, 0.0):
                turn = await w.client.command(dialect.MAV_CMD_CONDITION_YAW, degrees, NAN, direction, 0.0)
                assert turn.result == ACCEPTED
            await w.drone.wait_log(
                lambda e: e.kind == "pose" and abs(math.degrees(e.args["yaw"]) - degrees) < 1.0,
                20.0,
                since=w.drone.log[-1].t,
            )

        async def shown(frame: int) -> Any:
            both = VEHICLE_FRAME | EARTH_FRAME
            return await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS", lambda m: m.flags & both == frame)

        await turn_to(90.0, 1.0)
        assert await angles(w, -20.0, 30.0, LEVEL) == ACCEPTED
        await looks(w, yaw_relative=30.0, pitch_absolute=-20.0)
        status = await shown(VEHICLE_FRAME)
        assert euler(status) == pytest.approx((0.0, -20.0, 30.0), abs=2.0)
        assert math.degrees(status.delta_yaw) == pytest.approx(math.degrees(w.drone.pose.yaw), abs=2.0)
        assert not status.flags & YAW_LOCK

        # To north, given to north and given to the nose.
        assert await angles(w, -20.0, 70.0, LEVEL | YAW_LOCK) == ACCEPTED
        await looks(w, yaw_absolute=70.0)
        assert await angles(w, -20.0, 10.0, LEVEL | YAW_LOCK | VEHICLE_FRAME) == ACCEPTED
        locked = math.degrees(w.drone.pose.yaw) + 10.0
        await looks(w, yaw_absolute=locked)
        status = await shown(EARTH_FRAME)
        assert euler(status) == pytest.approx((0.0, -20.0, locked), abs=2.0)
        assert status.flags & YAW_LOCK
        await turn_to(70.0, -1.0)
        await looks(w, yaw_absolute=locked)

        # To north, given as a share of the range from the nose: half of 48 deg to the right.
        half = dialect.MAVLink_gimbal_manager_set_manual_control_message(1, 1, LEVEL | YAW_LOCK, 1, NAN, 0.5, NAN, NAN)
        w.client.send(half)
        await looks(w, yaw_relative=24.0, yaw_absolute=math.degrees(w.drone.pose.yaw) + 24.0)

        # To the nose, given to north.
        assert await angles(w, -20.0, 60.0, LEVEL | EARTH_FRAME) == ACCEPTED
        await looks(w, yaw_absolute=60.0)
        assert (await shown(VEHICLE_FRAME)).flags & LEVEL == LEVEL

        # Pitch follows the body without its lock in this flavour.
        assert await angles(w, -20.0, 0.0, 0) == ACCEPTED
        pitch_lock = dialect.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
        await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS", lambda m: not m.flags & pitch_lock)
        assert truth(w).pitch_relative == pytest.approx(-20.0, abs=0.5)


async def test_neutral_is_carried_out_again_after_the_gimbal_has_left_it() -> None:
    async with world() as w:

        def neutral() -> None:
            flags = LEVEL | dialect.GIMBAL_MANAGER_FLAGS_NEUTRAL
            w.client.send(dialect.MAVLink_gimbal_manager_set_attitude_message(1, 1, flags, 1, [NAN] * 4, *[NAN] * 3))

        async def flagged(expected: bool) -> None:
            bit = dialect.GIMBAL_DEVICE_FLAGS_NEUTRAL
            await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS", lambda m: bool(m.flags & bit) is expected)

        assert await angles(w, -30.0) == ACCEPTED
        neutral()
        await looks(w, pitch_absolute=0.0)
        neutral()  # one of a stream
        await flagged(True)
        for _ in range(5):  # until the drone has reported that it rests
            await next_truth(w)
        assert len(w.commands("gimbal.reset_orientation")) == 1
        await w.gateway.systems[0].drone.gimbal.point(pitch=Aim(-40.0))  # by other means than MAVLink
        await flagged(False)
        neutral()
        await looks(w, pitch_absolute=0.0)
        assert len(w.commands("gimbal.reset_orientation")) == 2


async def test_secondary_client_and_mount_mode_need_control() -> None:
    async with world() as w:
        other = await w.connect(254, 190)
        assert (await w.client.command(CONFIGURE, -1, -1, -2, -2)).result == REJECTED
        status = await request(w.client, STATUS, "GIMBAL_MANAGER_STATUS")
        assert (status.primary_control_sysid, status.secondary_control_sysid) == (0, 0)
        beat(w.client)
        assert (await w.client.command(CONFIGURE, -2, -2, -1, -1)).result == ACCEPTED
        other.send(dialect.MAVLink_mount_configure_message(1, 1, dialect.MAV_MOUNT_MODE_GPS_POINT, 1, 1, 1))
        await other.wait("STATUSTEXT", lambda m: m.text == "Gimbal refused: system 255 has control", since=0)
        # The owner's MOUNT_CONTROL still means angles.
        w.client.send(dialect.MAVLink_mount_control_message(1, 1, -1500, 0, 0, 0))
        await looks(w, pitch_absolute=-15.0)

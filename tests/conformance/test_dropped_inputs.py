"""Inputs of streams that are not flown: their sender alone gets a text, once for each cause and episode."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.gimbal import LEVEL, NO_ATTITUDE, beat, send_rates
from support.mav import NAN, Client
from support.setpoints import (
    NO_POSITION,
    NO_VELOCITY,
    NO_YAW,
    NO_YAW_RATE,
    POSITION_ONLY,
    VELOCITY_ONLY,
    earth,
    engage,
    local,
    motion,
    said,
    streaming,
)
from support.world import HOME, World, world

from anafi_mav import geo, texts
from anafi_mav.services.dropped_inputs import EPISODE_GAP, MODE_GRACE, REPORT_EVERY, InputStream

SET_MODE, ARM = dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_COMPONENT_ARM_DISARM
ACCEPTED = dialect.MAV_RESULT_ACCEPTED
SETPOINT, STICKS, TARGET, GIMBAL, REGION, _ = InputStream


def now() -> float:
    return asyncio.get_running_loop().time()


def reports(client: Client, part: str, mark: int = 0) -> list[float]:
    """When a client received texts with this part."""
    return [at for at, text in client.since(mark, "STATUSTEXT") if part in text.text]


def refusals(client: Client, mark: int = 0) -> list[str]:
    """Texts of inputs that are not flown."""
    return [
        text.text
        for _, text in client.since(mark, "STATUSTEXT")
        if any(word in text.text for word in ("refused:", "ignored:", "dropped:"))
    ]


def manual(x: int = 0, y: int = 0, z: int = 500, r: int = 0) -> Any:
    return dialect.MAVLink_manual_control_message(1, x, y, z, r, 0)


def velocity(north: float = 0.0, down: float = 0.0) -> Any:
    return local(VELOCITY_ONLY, v=(north, 0.0, down))


# Setpoints.


async def test_setpoint_beside_another_program_is_reported_to_its_sender() -> None:
    """Once for as long as it lasts; again when it begins again; the pilot's program hears nothing of it."""
    async with world(speed=1.0) as w:
        other, part = await w.connect(sysid=250), "another program flies"
        await w.take_off()
        async with streaming(w.client, velocity()):
            await engage(w.client, "px4")
            began = now()
            for episode in (1, 2):
                async with streaming(other, velocity(2.0), 0.2):
                    while len(reports(other, part)) < episode:
                        await other.wait("STATUSTEXT", timeout=REPORT_EVERY)
                    await asyncio.sleep(1.0)
                await asyncio.sleep(EPISODE_GAP)
        first, second = reports(other, part)
        assert second - first >= REPORT_EVERY - 0.01
        assert refusals(w.client) == []
        assert motion(w, began) == []


async def test_setpoint_refused_now_and_then_is_reported_every_ten_seconds() -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off()
        async with streaming(w.client, velocity(), 0.2):
            began, wrong = now(), velocity(500.0)
            while now() - began < 2 * REPORT_EVERY + 0.5:
                w.client.send(wrong)
                await asyncio.sleep(0.5)
        times = reports(w.client, "Setpoint refused: 500 m/s is too fast")
        assert [round(at - began) for at in times] == [0, 10, 20]


async def test_setpoints_in_mode_hold_are_reported_after_their_grace() -> None:
    """Programs begin to stream before they choose Offboard; without motion they may do so for ever."""
    async with world(speed=1.0) as w:
        other, part = await w.connect(sysid=250), "Setpoint refused: mode Hold, not Offboard"
        await w.take_off()
        async with streaming(other, velocity()), streaming(w.client, velocity(1.0)) as sent:
            await said(w.client, part)
            assert reports(w.client, part)[0] - sent[0] == pytest.approx(MODE_GRACE, abs=0.1)
            await engage(w.client, "px4")
        assert len(reports(w.client, part)) == 1
        assert refusals(other) == []


async def test_setpoint_before_its_mode_is_chosen_is_silent() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with streaming(w.client, velocity(1.0)):
            await asyncio.sleep(MODE_GRACE / 2)
            await engage(w.client, "px4")
            await asyncio.sleep(MODE_GRACE)
        assert refusals(w.client) == []


async def test_setpoint_in_guided_during_a_landing_reports_the_landing() -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(10.0)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        async with streaming(w.client, velocity(2.0)):
            await w.client.wait("STATUSTEXT", lambda m: "Setpoint refused" in m.text, since=mark)
        assert refusals(w.client, mark) == ["Setpoint refused: drone is landing"]


async def test_follow_chosen_during_a_landing_reports_the_landing() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        ack = await w.client.command(SET_MODE, 1, 4, 8)
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        assert refusals(w.client, mark) == ["Follow refused: drone is landing"]


async def test_climb_in_a_mode_of_another_client_is_reported() -> None:
    """The station arms and chooses Offboard: the program has to do both by itself."""
    async with world() as w:
        program = await w.connect(sysid=250)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        async with streaming(program, velocity()):
            await engage(w.client, "px4")
            async with streaming(program, velocity(down=-1.0)):
                await said(program, "Setpoint refused: mode not chosen by this client")
        assert refusals(w.client) == []


async def test_setpoint_on_the_ground_without_climb_is_reported() -> None:
    async with world() as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        async with streaming(w.client, velocity(1.0)):
            await engage(w.client, "px4")
            await said(w.client, "Setpoint refused: on the ground, no climb")


@pytest.mark.parametrize("newer", ["setpoint", "command"])
async def test_single_setpoint_replaced_at_once_is_reported_to_its_sender(newer: str) -> None:
    """Two clients in one event-loop iteration: the newer one flies, the older one's sender is notified."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        await w.take_off(8.0)
        first, second = w.clients
        place = geo.destination(*HOME[:2], 0.0, 20.0)
        first.send(earth(POSITION_ONLY, 6, 20.0, 0.0, 8.0))
        if newer == "setpoint":
            second.send(earth(POSITION_ONLY, 6, place=place, height=8.0))
            await said(first, "Setpoint refused: another program flies")
        else:
            second.send_command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)
            await said(first, "Setpoint refused: another command meanwhile")
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["east"] > 10.0, 20.0)
        assert abs(w.drone.pose.north) < 1.0
        assert refusals(second) == []


# Sticks.


@pytest.mark.parametrize("sticks", [manual(), manual(z=0), manual(z=1000), manual(x=100, y=-100, r=100)])
async def test_stick_at_rest_is_not_reported(sticks: Any) -> None:
    """Neither in another mode nor beside another joystick."""
    async with world(speed=4.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        async with streaming(other, sticks, 0.1):
            await asyncio.sleep(1.0)
            assert (await w.client.command(SET_MODE, 1, 3, 0)).result == ACCEPTED
            async with streaming(w.client, manual(x=500), 0.1):
                await asyncio.sleep(1.0)
        assert refusals(other) == []


async def test_stick_is_reported_to_its_sender_in_each_place() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        async with streaming(w.client, manual(y=500), 0.1):
            await said(w.client, "Sticks ignored: take off first")
        await w.take_off()
        async with streaming(w.client, manual(), 0.1):
            await w.client.wait("HEARTBEAT")
            async with streaming(w.client, manual(z=900), 0.1):  # a throttle that returns to the middle by itself
                await said(w.client, "Sticks ignored: mode Hold, not Position")
        assert refusals(other) == []


# Every cause.

PLACE = geo.destination(*HOME[:2], 20.0, 0.0)
ALL_BUT_X = 0x1FF & ~1 | NO_YAW | NO_YAW_RATE
ALL_IGNORED = 0x1FF | NO_YAW | NO_YAW_RATE
FORCE = NO_POSITION | NO_VELOCITY | NO_YAW | NO_YAW_RATE


def quaternion(*q: float, thrust: float = 0.5, mask: int = 0b111) -> Any:
    return dialect.MAVLink_set_attitude_target_message(0, 1, 1, mask, list(q), 0.0, 0.0, 0.0, thrust)


def channels(*values: int) -> Any:
    return dialect.MAVLink_rc_channels_override_message(1, 1, *values, *[0xFFFF] * (8 - len(values)))


def follow(place: tuple[float, float], capabilities: int = 1, speed: float = 0.0) -> Any:
    unset = [NAN] * 3
    at = round(place[0] * 1e7), round(place[1] * 1e7)
    vel = [speed, 0.0, 0.0]
    return dialect.MAVLink_follow_target_message(
        0, capabilities, *at, HOME[2], vel, unset, [1.0, NAN, NAN, NAN], unset, unset, 0
    )


def pitch_yaw(pitch: float = NAN, yaw: float = NAN, rate: float = NAN, *, flags: int = LEVEL, device: int = 1) -> Any:
    return dialect.MAVLink_gimbal_manager_set_pitchyaw_message(1, 1, flags, device, pitch, yaw, rate, NAN)


def gimbal_attitude(*q: float) -> Any:
    return dialect.MAVLink_gimbal_manager_set_attitude_message(1, 1, LEVEL, 1, list(q), NAN, NAN, NAN)


def gimbal_share(pitch: float) -> Any:
    return dialect.MAVLink_gimbal_manager_set_manual_control_message(1, 1, LEVEL, 1, pitch, NAN, NAN, NAN)


def mount_mode(mode: int) -> Any:
    return dialect.MAVLink_mount_configure_message(1, 1, mode, 0, 0, 0)


BOTH_YAW = dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME | dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME

MESSAGES: list[tuple[InputStream, Any, Any]] = [
    (SETPOINT, texts.ATTITUDE_RATES, quaternion(1.0, 0.0, 0.0, 0.0, mask=0b10000111)),
    (SETPOINT, texts.ATTITUDE_NO_ROTATION, quaternion(0.0, 0.0, 0.0, 0.0)),
    (SETPOINT, texts.ATTITUDE_LENGTH, quaternion(2.0, 0.0, 0.0, 0.0)),
    (SETPOINT, texts.ATTITUDE_UPSIDE_DOWN, quaternion(0.0, 1.0, 0.0, 0.0)),
    (SETPOINT, texts.THRUST_RANGE, quaternion(1.0, 0.0, 0.0, 0.0, thrust=2.0)),
    (SETPOINT, texts.FRAME_UNSUPPORTED, local(VELOCITY_ONLY, 2, v=(1.0, 0.0, 0.0))),
    (SETPOINT, texts.TERRAIN_UNSUPPORTED, earth(POSITION_ONLY, 11, 20.0, height=8.0)),
    (SETPOINT, texts.HALF_PLACE, earth(ALL_BUT_X, 6, 20.0)),
    (SETPOINT, texts.FORCES, local(FORCE | 0x200, a=(1.0, 0.0, 0.0))),
    (SETPOINT, texts.NOTHING_ASKED, local(ALL_IGNORED)),
    (SETPOINT, texts.NOT_ALL_NUMBERS, velocity(NAN)),
    (SETPOINT, texts.TOO_FAST, velocity(100.0)),
    (SETPOINT, texts.TOO_MUCH_ACCELERATION, local(FORCE, a=(100.0, 0.0, 0.0))),
    (SETPOINT, texts.TURNS_TOO_FAST, local(ALL_IGNORED & ~NO_YAW_RATE, yaw_rate=100.0)),
    (SETPOINT, texts.NOT_ON_EARTH, local(POSITION_ONLY, at=(2e6, 0.0, -8.0))),
    (SETPOINT, texts.AT_NULL, earth(POSITION_ONLY, 6, place=(0.0, 0.0), height=8.0)),
    (SETPOINT, texts.TOO_LOW, local(POSITION_ONLY, at=(5.0, 0.0, 20.0))),
    (SETPOINT, texts.ABOVE_CEILING, local(POSITION_ONLY, at=(5.0, 0.0, -900.0))),
    (SETPOINT, texts.TOO_FAR, local(POSITION_ONLY, at=(9000.0, 0.0, -8.0))),
    (SETPOINT, texts.NOT_OFFBOARD, velocity(1.0)),
    (STICKS, texts.AXIS_RANGE, manual(x=2000)),
    (STICKS, texts.THROTTLE_RANGE, manual(z=-5)),
    (STICKS, texts.CHANNEL_RANGE, channels(100)),
    (STICKS, texts.STICKS_IGNORED_MODE, manual(x=900)),
    (GIMBAL, texts.NO_SUCH_GIMBAL, pitch_yaw(0.1, device=7)),
    (GIMBAL, texts.ATTITUDE_LENGTH, gimbal_attitude(2.0, 0.0, 0.0, 0.0)),
    (GIMBAL, texts.NO_RETRACT, pitch_yaw(0.1, flags=dialect.GIMBAL_MANAGER_FLAGS_RETRACT)),
    (GIMBAL, texts.TWO_YAW_FRAMES, pitch_yaw(0.1, flags=BOTH_YAW)),
    (GIMBAL, texts.NOTHING_ASKED, gimbal_attitude(*NO_ATTITUDE)),
    (GIMBAL, texts.GIMBAL_ANGLE, pitch_yaw(7.0)),
    (GIMBAL, texts.GIMBAL_RATE, pitch_yaw(rate=20.0)),
    (GIMBAL, texts.GIMBAL_SHARE, gimbal_share(2.0)),
    (GIMBAL, texts.GIMBAL_MODE, mount_mode(dialect.MAV_MOUNT_MODE_RC_TARGETING)),
    (GIMBAL, texts.NO_SUCH_AXIS, pitch_yaw(yaw=0.5)),
]
"""Inputs that a hovering drone does not fly, in mode Hold."""

TARGETS: list[tuple[InputStream, Any, Any]] = [
    (TARGET, texts.TARGET_NO_POSITION, follow(PLACE, 0)),
    (TARGET, texts.TARGET_NO_VELOCITY, follow(PLACE, 3, NAN)),
    (TARGET, texts.TARGET_FAST, follow(PLACE, 3, 500.0)),
    (TARGET, texts.TARGET_FAR, follow(geo.destination(*HOME[:2], 9000.0, 0.0))),
    (TARGET, texts.NOT_ON_EARTH, follow((95.0, 0.0))),
    (TARGET, texts.AT_NULL, follow((0.0, 0.0))),
]
"""Targets that are not followed, in mode Follow."""


async def each_reported(w: World, inputs: list[tuple[InputStream, Any, Any]]) -> None:
    """Send the inputs; each one's cause is reported to its sender alone."""
    sender, mark = await w.connect(sysid=250), w.client.mark()
    for _, reason, message in inputs:
        part, since = reason.pattern.partition("{")[0], sender.mark()
        if reason is texts.NOT_OFFBOARD:
            async with streaming(sender, message, 0.2):
                await said(sender, part, since)
        else:
            sender.send(message)
            await said(sender, part, since)
    assert refusals(w.client, mark) == []


async def test_every_input_that_a_hovering_drone_ignores_is_reported() -> None:
    async with world() as w:
        await w.take_off()
        await each_reported(w, MESSAGES)


async def test_every_target_that_is_ignored_is_reported_to_its_sender() -> None:
    async with world() as w:
        await w.take_off(8.0)
        sender = w.client
        sender.send(follow(PLACE, 0))  # in mode Hold it asks for nothing
        assert (await w.client.command(SET_MODE, 1, 4, 8)).result == ACCEPTED
        assert refusals(sender) == []
        await each_reported(w, TARGETS)
        other = await w.connect(sysid=240)
        async with streaming(w.client, follow(PLACE), 0.3):
            await w.client.wait("HEARTBEAT")
            async with streaming(other, follow(PLACE), 0.3):
                await said(other, "Target ignored: another target is followed")
        assert refusals(w.client) == []


async def test_gimbal_rate_without_control_is_reported_to_its_sender() -> None:
    async with world() as w:
        other = await w.connect(sysid=250)
        beat(w.client)
        ack = await w.client.command(dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, 255, 190, -1, -1, z=1)
        assert ack.result == ACCEPTED
        send_rates(other, 0.0)  # a centred stick
        await other.wait("HEARTBEAT")
        assert refusals(other) == []
        for _ in range(3):
            send_rates(other, 30.0)
        await said(other, "Gimbal refused: system 255 has control")
        await other.wait("HEARTBEAT")
        assert len(refusals(other)) == 1
        assert refusals(w.client) == []


async def test_place_of_a_mount_is_reported_to_its_sender() -> None:
    async with world() as w:
        other = await w.connect(sysid=250)
        other.send(mount_mode(dialect.MAV_MOUNT_MODE_GPS_POINT))
        place = round(PLACE[0] * 1e7), round(PLACE[1] * 1e7)
        other.send(dialect.MAVLink_mount_control_message(1, 1, *place, 0, 0))
        await said(other, "ROI refused: drone is not in the air")
        assert refusals(w.client) == []

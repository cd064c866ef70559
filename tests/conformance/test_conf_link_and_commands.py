"""Items 1-18 of the conformance list: heartbeats, frames, addressing, the command protocol, arming."""

from __future__ import annotations

import asyncio
import itertools
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import CAMERA, NAN, kind_of
from support.world import ARMED, world

from anafi_mav.mavlink import dialect as newer

ACCEPTED, UNSUPPORTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_UNSUPPORTED
IN_PROGRESS = dialect.MAV_RESULT_IN_PROGRESS
ARM, TAKE_OFF, REPOSITION, SET_MODE = (
    dialect.MAV_CMD_COMPONENT_ARM_DISARM,
    dialect.MAV_CMD_NAV_TAKEOFF,
    dialect.MAV_CMD_DO_REPOSITION,
    dialect.MAV_CMD_DO_SET_MODE,
)
FLAVOURS = ("px4", "ardupilot")
AUTOPILOTS = {"px4": dialect.MAV_AUTOPILOT_PX4, "ardupilot": dialect.MAV_AUTOPILOT_ARDUPILOTMEGA}


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_001_heartbeat(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.client.wait("HEARTBEAT")
        mark = w.client.mark()
        for _ in range(4):
            await w.client.wait("HEARTBEAT", since=w.client.mark())
        beats = w.client.since(mark, "HEARTBEAT")
        gaps = [later[0] - earlier[0] for earlier, later in itertools.pairwise(beats)]
        assert all(0.9 <= gap <= 1.1 for gap in gaps), gaps
        for _, beat in beats:
            assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)
            assert (beat.type, beat.autopilot) == (dialect.MAV_TYPE_QUADROTOR, AUTOPILOTS[flavour])
            assert beat.base_mode & dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_002_heartbeat_on_change(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for _ in range(3):  # a periodic heartbeat cannot be within 100 ms three times by chance
            for param, armed in ((1, True), (0, False)):
                mark = w.client.mark()
                await w.client.command(ARM, param)
                acknowledged = time.monotonic()
                await w.client.heartbeat(lambda beat, armed=armed: bool(beat.base_mode & ARMED) is armed, since=mark)
                assert time.monotonic() - acknowledged < 0.1


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_003_camera_heartbeat_is_of_no_autopilot(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for _ in range(2):
            beat = await w.client.wait("CAMERA_HEARTBEAT")
            assert (beat.type, beat.autopilot) == (dialect.MAV_TYPE_CAMERA, dialect.MAV_AUTOPILOT_INVALID)
            assert (beat.base_mode, beat.custom_mode) == (0, 0)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_004_autopilot_heartbeat_ends_each_burst(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for _ in range(2):
            await w.client.wait("CAMERA_HEARTBEAT")
        await w.client.wait("HEARTBEAT")
        beats = [(kind_of(m), at, m) for at, m in w.client.received if m.get_type() == "HEARTBEAT"]
        following = [(one, next) for one, next in itertools.pairwise(beats) if one[0] == "CAMERA_HEARTBEAT"]
        assert len(following) >= 2
        for (_, at, _), (kind, later, _) in following:
            assert kind == "HEARTBEAT"
            assert later - at < 0.1


async def test_conf_004_first_heartbeat_of_a_connection_is_the_autopilots() -> None:
    """Six clients connect at different times of the second."""
    async with world() as w:
        for sysid in range(241, 247):
            for _ in range(2):
                await w.client.wait("ATTITUDE")
            client = await w.connect(sysid)
            first = await client.wait(("HEARTBEAT", "CAMERA_HEARTBEAT"), since=0)
            assert (first.get_srcComponent(), first.autopilot) == (1, dialect.MAV_AUTOPILOT_PX4)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_009_camera_answers_for_itself(flavour: str) -> None:
    """It refuses what it does not have; the autopilot answers for component 0, and no one for one that is absent."""
    async with world(flavour=flavour) as w:
        for command in (TAKE_OFF, SET_MODE, dialect.MAV_CMD_DO_WINCH):
            mark = w.client.mark()
            ack = await w.client.command(command, 1, target=(1, CAMERA))
            assert (ack.get_srcComponent(), ack.result) == (CAMERA, UNSUPPORTED)
            w.client.send_command(dialect.MAV_CMD_DO_WINCH, target=(1, 0))
            await w.client.wait("COMMAND_ACK", lambda m: m.get_srcComponent() == 1)
            assert len(w.client.since(mark, "COMMAND_ACK")) == 2


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_005_frames(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.client.command(ARM, 1)
        await w.client.command(ARM, 0)
        await w.client.wait("HEARTBEAT")
        frames = [message.get_msgbuf() for _, message in w.client.received]
        assert len(frames) > 30
        assert {frame[0] for frame in frames} == {0xFD}
        for component in (1, CAMERA):
            sequence = [frame[4] for frame in frames if frame[6] == component]
            assert sequence
            assert all(b == (a + 1) % 256 for a, b in itertools.pairwise(sequence))
        assert w.client.bad == 0


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_006_silence_after_link_loss(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        w.drone.faults.mute = True
        lost = time.monotonic()
        await asyncio.sleep(3.0)  # the interval under test
        mark = w.client.mark()
        await asyncio.sleep(1.5)  # and one heartbeat period of silence after it
        assert w.client.received[mark:] == []
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle, timeout=5.0)
        position = await w.client.wait("GLOBAL_POSITION_INT", since=mark)
        assert position.time_boot_ms / 1000 > lost - w.client.received[0][0]


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_007_acknowledgement_addresses(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for sysid, compid in ((245, 190), (255, 230), (1, 191)):
            client = await w.connect(sysid, compid)
            ack = await client.command(ARM, 0)
            assert (ack.get_srcSystem(), ack.get_srcComponent()) == (1, 1)
            assert (ack.target_system, ack.target_component) == (sysid, compid)


@pytest.mark.parametrize("target", [(1, 0), (0, 0), (1, 1), (0, 1)])
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_008_one_acknowledgement(target: tuple[int, int], flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        ack = await w.client.command(ARM, 0, target=target)
        assert ack.result == ACCEPTED
        await w.client.wait("HEARTBEAT")
        await w.client.wait("HEARTBEAT")
        assert len(w.client.since(mark, "COMMAND_ACK")) == 1


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_009_unsupported_at_once(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for id in (31000, 211, 60000, 183):
            began = time.monotonic()
            ack = await w.client.command(id)
            assert ack.result == UNSUPPORTED
            assert time.monotonic() - began < 0.2


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_009_other_components_are_not_ours(flavour: str) -> None:
    """No one answers for components that do not exist: a second camera, a gimbal device."""
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        for component in (101, 154, 190):
            w.client.send_command(dialect.MAV_CMD_WAYPOINT_USER_1, target=(1, component))
        w.client.send_command(dialect.MAV_CMD_WAYPOINT_USER_1, target=(2, 1))
        assert (await w.client.command(dialect.MAV_CMD_DO_GRIPPER)).result == UNSUPPORTED
        assert [ack.command for _, ack in w.client.since(mark, "COMMAND_ACK")] == [211]


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_010_nan_everywhere(flavour: str) -> None:
    """Every command that MAVLink has."""
    known = (ACCEPTED, UNSUPPORTED, dialect.MAV_RESULT_DENIED, dialect.MAV_RESULT_TEMPORARILY_REJECTED)
    async with world(flavour=flavour) as w:
        for id in sorted(newer.enums["MAV_CMD"]):
            for frame in (None, 0, 5, 6):
                ack = await w.client.command(id, NAN, NAN, NAN, NAN, frame=frame)
                assert ack.result in known, ack
        # Nothing moved: arming stayed off, so at most a take-off waits for it.
        assert w.drone.flying_state.name == "LANDED"
        await w.client.wait("HEARTBEAT")


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_011_progress(flavour: str) -> None:
    async with world(flavour=flavour, speed=0.5) as w:  # half speed: the motors take two seconds to ramp up
        await w.client.command(ARM, 1)
        mark, began = w.client.mark(), time.monotonic()
        ack = await w.client.command(TAKE_OFF, timeout=15.0)
        assert ack.result == ACCEPTED
        acks = [(at, a.result) for at, a in w.client.since(mark, "COMMAND_ACK")]
        assert [result for _, result in acks[:-1]] == [IN_PROGRESS] * (len(acks) - 1)
        assert len(acks) >= 2
        times = [began, *(at for at, _ in acks)]
        assert max(b - a for a, b in itertools.pairwise(times)) <= 1.0
        assert w.drone.flying_state.name != "LANDED"


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_012_resent_command(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        mark = w.client.mark()
        for _ in range(4):
            w.client.send_command(REPOSITION, -1, 1, 0, NAN, frame=6, x=48.8790, y=2.3677, z=5.0)
            await w.client.wait("COMMAND_ACK")
        await w.client.wait("HEARTBEAT")
        assert {a.result for _, a in w.client.since(mark, "COMMAND_ACK")} <= {ACCEPTED, IN_PROGRESS}
        moves = w.commands("ardrone3.Piloting.moveTo") + w.commands("move.extended_move_to")
        assert len(moves) == 1


@pytest.mark.parametrize("frame", [None, 0, 3])
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_013_long_and_int(frame: int | None, flavour: str) -> None:
    async with world(flavour=flavour) as w:
        z = 12.0 if frame == 3 else 12.0 + 35.0
        place = {"x": 0.0, "y": 0.0, "z": 12.0} if frame is None else {"x": NAN, "y": NAN, "z": z}
        assert (await w.client.command(ARM, 1, frame=frame)).result == ACCEPTED
        assert (await w.client.command(TAKE_OFF, NAN, NAN, NAN, NAN, frame=frame, **place)).result == ACCEPTED
        await w.client.wait("ALTITUDE", lambda m: abs(m.altitude_relative - 12.0) < 0.5, timeout=20.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle, timeout=10.0)
        position = (3, 0) if flavour == "px4" else (5,)
        assert (await w.client.command(SET_MODE, 1, *position, frame=frame)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.position)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_014_autopilot_version(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
        version = await w.client.wait("AUTOPILOT_VERSION", since=mark)
        serial = bytes(version.uid2).rstrip(b"\0").decode()
        assert serial == w.drone.identity.serial
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1)).result == ACCEPTED
        await w.client.wait("AUTOPILOT_VERSION", since=mark)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 300)).result == ACCEPTED
        assert (await w.client.wait("PROTOCOL_VERSION", since=mark)).max_version == 200


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_015_capabilities(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        bits = (await w.client.wait("AUTOPILOT_VERSION", since=mark)).capabilities
        # MISSION_FLOAT 1, MISSION_INT 4, COMMAND_INT 8, FTP 32, SET_ATTITUDE_TARGET 64, SET_POSITION_TARGET_LOCAL_NED
        # 128 and _GLOBAL_INT 256, MAVLINK2 8192, FENCE 16384, RALLY 32768, COMPONENT_IMPLEMENTS_GIMBAL_MANAGER 262144;
        # PARAM_ENCODE_BYTEWISE 16 or _C_CAST 131072
        served = 1 | 4 | 8 | 32 | 64 | 128 | 256 | 8192 | 16384 | 32768 | 262144
        encoding = 16 if flavour == "px4" else 131072
        assert bits == served | encoding
    async with world(flavour=flavour, allow_kill=True) as w:
        mark = w.client.mark()
        await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        bits = (await w.client.wait("AUTOPILOT_VERSION", since=mark)).capabilities
        assert bits == served | encoding | 2048


async def test_conf_016_version_number() -> None:
    async with world() as w:
        mark = w.client.mark()
        await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        version = (await w.client.wait("AUTOPILOT_VERSION", since=mark)).flight_sw_version
        assert version & 0xFF == 0
        assert (version >> 24, version >> 16 & 0xFF) >= (1, 14)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_017_arm(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        # The change is sent at once; arming what is armed changes nothing, so its heartbeat is the next regular one.
        for limit in (1.0, 1.5):
            mark = w.client.mark()
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
            await w.client.heartbeat(lambda beat: bool(beat.base_mode & ARMED), since=mark, timeout=limit)
        assert w.drone.flying_state.name == "LANDED"  # armed, and nothing turns


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_018_disarm(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.client.command(ARM, 1)
        assert (await w.client.command(ARM, 0)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED)
        await w.take_off()
        mark = w.client.mark()
        assert (await w.client.command(ARM, 0)).result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        assert "in the air" in (await w.client.wait("STATUSTEXT", since=mark)).text
        assert (await w.client.command(ARM, 0, 21196)).result == dialect.MAV_RESULT_DENIED
        critical = await w.client.wait("STATUSTEXT", lambda m: m.severity == 2, since=mark)
        assert critical.text.startswith("Motor cut refused")
        assert w.commands("ardrone3.Piloting.Emergency") == []
        assert w.drone.flying_state.name in ("HOVERING", "FLYING")


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_motor_cut_with_allow_kill(flavour: str) -> None:
    async with world(flavour=flavour, allow_kill=True) as w:
        await w.take_off()
        assert (await w.client.command(ARM, 0, 21196)).result == ACCEPTED
        assert len(w.commands("ardrone3.Piloting.Emergency")) == 1

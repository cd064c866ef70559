"""Access, systems and filter of an endpoint, by what the drone received and the clients saw."""

from __future__ import annotations

import asyncio
import random
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import Client
from support.params import write
from support.plans import RALLY, begin_download, rally, upload
from support.world import HOME, OPTIONS_PORT, World, world

from anafi_mav.mavlink import dialect as own
from anafi_mav.mavlink.frames import unpack

DENIED, ACCEPTED = dialect.MAV_RESULT_DENIED, dialect.MAV_RESULT_ACCEPTED
FTP_NAK, PROTECTED = 129, 9
BEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def addressed(id: int, chance: random.Random) -> Any:
    """A message of any kind to system 1 with random fields."""
    kind = own.mavlink_map[id]
    message = unpack(id, chance.randbytes(kind.unpacker.size))
    for field in ("target_system", "target"):
        if hasattr(message, field):
            setattr(message, field, 1)
    if hasattr(message, "target_component"):
        message.target_component = chance.choice((0, 1, 100))
    return message


def received(w: World, since: int) -> list[str]:
    """Names of the commands that the drone has received since."""
    return [entry.name for entry in list(w.drone.log)[since:] if entry.kind == "command"]


async def test_observer_moves_nothing_by_any_message() -> None:
    chance = random.Random(14)
    async with world(options=["access=observe"]) as w:
        observer = await w.connect(250, port=OPTIONS_PORT)
        await w.take_off(5.0)
        mark, start = len(w.drone.log), w.client.mark()
        (memory,) = [system.memory for system in w.gateway.systems]
        plans = dict(memory.plans)
        packer = own.MAVLink(None, 250, 190)
        for id in own.mavlink_map:
            observer.send_raw(addressed(id, chance).pack(packer))
            packer.seq = (packer.seq + 1) % 256
        for command in sorted(own.enums["MAV_CMD"]):
            if command <= 0xFFFF:
                observer.send_command(command, 1, 1, 1, 1, x=0.0, y=0.0, z=5.0, target=(1, chance.choice((0, 1, 100))))
                await asyncio.sleep(0.002)
        assert (await observer.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
        await asyncio.sleep(3.0)
        assert received(w, mark) == []
        assert memory.plans == plans
        beats = [beat for _, beat in w.client.since(start, "HEARTBEAT") if beat.get_srcSystem() == 1]
        modes = {beat.custom_mode for beat in beats}
        assert modes == {w.modes.hold}
        texts = [message.text for _, message in observer.since(0, "STATUSTEXT")]
        assert "Message refused: access of endpoint is observe" in texts
        counters = w.gateway.counters()
        for name in ("SET_POSITION_TARGET_LOCAL_NED", "MANUAL_CONTROL", "PARAM_SET", "MISSION_COUNT", "SET_MODE"):
            assert counters[f"refused_access.{name}"] == 1
        assert counters["refused_access.COMMAND_LONG"] > 100


async def test_refused_request_of_an_observer_is_answered() -> None:
    async with world(options=["access=observe", "access=control"]) as w:
        observer = await w.connect(250, port=OPTIONS_PORT)
        pilot = await w.connect(251, port=OPTIONS_PORT + 1)
        assert (await observer.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == DENIED
        assert (await observer.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 1e6)).result == ACCEPTED
        assert (await pilot.command(dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)).result == DENIED
        for client in (observer, pilot):
            mark = client.mark()
            client.send(dialect.MAVLink_param_set_message(1, 1, b"ANF_RTH_ALT", 77.0, 9))
            error = await client.wait("PARAM_ERROR", since=mark)
            assert error.error == own.MAV_PARAM_ERROR_PERMISSION_DENIED
        mark = observer.mark()
        observer.send(dialect.MAVLink_mission_count_message(1, 1, 1))
        assert (await observer.wait("MISSION_ACK", since=mark)).type == dialect.MAV_MISSION_DENIED
        for client, opcode in ((observer, own.MAV_FTP_OPCODE_CREATEFILE), (pilot, own.MAV_FTP_OPCODE_REMOVEFILE)):
            mark = client.mark()
            path = b"@MISSION/mission.dat"
            payload = bytes((7, 0, 0, opcode, len(path), 0, 0, 0, 0, 0, 0, 0)) + path
            client.send(dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, payload.ljust(251, b"\0")))
            answer = bytes((await client.wait("FILE_TRANSFER_PROTOCOL", since=mark)).payload)
            assert (answer[3], answer[12]) == (FTP_NAK, PROTECTED)
        mark = pilot.mark()
        pilot.send(dialect.MAVLink_mission_clear_all_message(1, 1))
        assert (await pilot.wait("MISSION_ACK", since=mark)).type == dialect.MAV_MISSION_ACCEPTED
        mark = observer.mark()
        observer.send(dialect.MAVLink_param_request_read_message(1, 1, b"ANF_RTH_ALT", -1))
        await observer.wait("PARAM_VALUE", since=mark)
        assert (await pilot.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED


async def test_checks_of_an_observer_do_not_flood_the_others() -> None:
    """A report of the checks is for all, and the log of events holds 128 of them."""
    async with world(options=["access=observe"]) as w:
        observer = await w.connect(250, port=OPTIONS_PORT)
        mark = w.client.mark()
        for _ in range(30):
            assert (await observer.command(own.MAV_CMD_RUN_PREARM_CHECKS)).result == ACCEPTED
        seconds = w.client.received[-1][0] - w.client.received[mark - 1][0]
        assert len(w.client.since(mark, "EVENT")) <= 4 + 2 * seconds  # of a report: arming checks and their groups
        assert w.client.since(mark, "STATUSTEXT") == []


async def test_download_of_an_observer_does_not_keep_a_pilot_from_an_upload() -> None:
    points = [rally(HOME[:2], 20.0), rally((HOME[0] + 0.001, HOME[1]), 25.0)]
    async with world(options=["access=observe"]) as w:
        observer = await w.connect(250, port=OPTIONS_PORT)
        for _ in range(2):
            assert (await upload(w.client, points, RALLY)).type == dialect.MAV_MISSION_ACCEPTED
            await begin_download(observer, RALLY)
            assert (await upload(w.client, points[:1], RALLY)).type == dialect.MAV_MISSION_ACCEPTED


async def test_acknowledgement_of_an_observer_draws_no_text() -> None:
    async with world(options=["access=observe"]) as w:
        observer = await w.connect(250, port=OPTIONS_PORT)
        observer.send(dialect.MAVLink_command_ack_message(dialect.MAV_CMD_REQUEST_MESSAGE, ACCEPTED, 0, 0, 1, 1))
        assert (await observer.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
        assert "refused" not in "".join(message.text for _, message in observer.since(0, "STATUSTEXT"))
        assert w.gateway.counters()["refused_access.COMMAND_ACK"] == 1


async def test_heartbeats_of_observers_do_not_replace_a_station() -> None:
    async with world(options=["access=observe"]) as w:
        observer = await w.connect(250, port=OPTIONS_PORT)
        mark = w.client.mark()
        await write(w.client, "ANF_GCS_LOSS", 2, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 5.0)
        w.client.send(BEAT)
        for _ in range(10):
            observer.send(BEAT)
            await asyncio.sleep(1.0)
        assert any("No ground station" in message.text for _, message in w.client.since(mark, "STATUSTEXT"))


async def test_endpoint_shows_its_systems_and_messages_only() -> None:
    async with world(options=["systems=2-9", "allow_messages=ATTITUDE", "block_messages=ATTITUDE"]) as w:
        other = await w.connect(250, port=OPTIONS_PORT)
        allowed = await w.connect(251, port=OPTIONS_PORT + 1)
        blocked = await w.connect(252, port=OPTIONS_PORT + 2)

        async def answer(client: Client, id: int) -> int:
            result: int = (await client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, id, 2e5)).result
            return result

        other.send_command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        assert await answer(allowed, dialect.MAVLINK_MSG_ID_ATTITUDE) == ACCEPTED
        assert await answer(allowed, dialect.MAVLINK_MSG_ID_VFR_HUD) == DENIED
        assert await answer(blocked, dialect.MAVLINK_MSG_ID_ATTITUDE) == DENIED
        for client in (allowed, blocked):
            await client.heartbeat(lambda beat: True)
            assert (await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)).result == ACCEPTED
        await w.client.wait("SYSTEM_TIME", timeout=10.0)
        assert other.received == []
        assert w.gateway.status().endpoints[1].refused == {"message to a system that the endpoint does not reach": 1}
        streamed = {message.get_type() for _, message in allowed.received}
        assert "ATTITUDE" in streamed
        assert not streamed & {"VFR_HUD", "SYS_STATUS", "GLOBAL_POSITION_INT", "EXTENDED_SYS_STATE"}
        streamed = {message.get_type() for _, message in blocked.received}
        assert "ATTITUDE" not in streamed
        assert {"VFR_HUD", "SYS_STATUS"} <= streamed

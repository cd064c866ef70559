"""Operator control (mavlink#2313) by what stations receive and what the simulated drone was commanded.

The teacher (255) and the student (254) are QGroundControls, and ask as those of mavlink/qgroundcontrol#14560 do.
"""

from __future__ import annotations

import asyncio
import random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import ext_params
from support.cameras import VIDEO, enter
from support.fault_scenarios import ACCEPTED, DENIED, FAILED, watched
from support.flavours import both
from support.ftp import ACK, NAK, PROTECTED, REMOVE, TERMINATE, Ftp, taken_apart
from support.gimbal import LEVEL, NAN, PITCHYAW, looks
from support.mav import CAMERA, Client
from support.media import DAY, add_photo
from support.params import read, send_set, write
from support.plans import RALLY, begin_download, rally, upload
from support.setpoints import COPTER_GUIDED, VELOCITY_ONLY, engage, local, motion, said, streaming, texts
from support.world import HOLD, HOME, OPTIONS_PORT, World, world

from anafi_mav.mavlink import dialect as own
from anafi_mav.mavlink.frames import unpack
from anafi_mav.services.command.operator_need import GIMBAL_COMMANDS, GIMBAL_MESSAGES
from anafi_mav.services.plan.plan_files import PATHS, pack_plan
from anafi_mav.vehicle.fence.plan_items import PlanItem
from anafi_mav.vehicle.operator_control import SILENT

REQUEST_CONTROL = own.MAV_CMD_REQUEST_OPERATOR_CONTROL
CONTROL_STATUS = own.MAVLINK_MSG_ID_CONTROL_STATUS
NOT_IN_CONTROL, UNSUPPORTED = own.MAV_RESULT_NOT_IN_CONTROL, dialect.MAV_RESULT_UNSUPPORTED
MANAGER, TAKEOVER = own.GCS_CONTROL_STATUS_FLAGS_SYSTEM_MANAGER, own.GCS_CONTROL_STATUS_FLAGS_TAKEOVER_ALLOWED
SET_MODE, ARM, TAKEOFF = dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_NAV_TAKEOFF
PAUSE, LAND, RETURN = dialect.MAV_CMD_DO_PAUSE_CONTINUE, dialect.MAV_CMD_NAV_LAND, dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH
TEACHER, STUDENT = 255, 254
ON = "operator_control=true"
PITCH_STICK = 3
BEAT = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
REFUSED = "operator is system 255"
STICK = dialect.MAVLink_manual_control_message(1, 700, 0, 500, 0, 0)
CENTRED = dialect.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0)
NORTH = local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))
POINT = PlanItem(
    dialect.MAV_CMD_NAV_RALLY_POINT, 3, (0.0, 0.0, 0.0, 0.0), round(HOME[0] * 1e7), round(HOME[1] * 1e7), 20.0
)
CREATE, WRITE = 6, 7


def now() -> float:
    return asyncio.get_running_loop().time()


async def beats(*clients: Client) -> None:
    """Stations send a heartbeat a second."""
    while True:
        for client in clients:
            client.send(BEAT)
        await asyncio.sleep(1.0)


async def stations(w: World, *ports: int, ids: tuple[int, ...] = (TEACHER, STUDENT)) -> list[Client]:
    """Stations that send heartbeats until the end of the test."""
    clients = [await w.connect(sysid, port=port) for sysid, port in zip(ids, ports, strict=True)]
    BEATING.append(asyncio.ensure_future(beats(*clients)))
    return clients


BEATING: list[asyncio.Future[None]] = []


@pytest.fixture(autouse=True)
async def _silence_at_the_end() -> Any:
    yield
    while BEATING:
        BEATING.pop().cancel()


def control_request(client: Client, *, takeover: int = 0, timeout: int = 10, low: int = 0, high: int = 0) -> Any:
    """MAV_CMD_REQUEST_OPERATOR_CONTROL as QGroundControl sends it: param4 its own id, the others 0."""
    fields = (1.0, float(takeover), float(timeout), float(low or client.sysid), float(high), 0.0, 0.0)
    return dialect.MAVLink_command_long_message(1, 1, REQUEST_CONTROL, 0, *fields)


def control_release(client: Client) -> Any:
    return dialect.MAVLink_command_long_message(1, 1, REQUEST_CONTROL, 0, 0.0, 0.0, 0.0, float(client.sysid), 0, 0, 0)


async def sent(client: Client, message: Any) -> int:
    """Send a request or release; return its result."""
    mark = client.mark()
    client.send(message)
    ack = await client.wait("COMMAND_ACK", lambda ack: ack.command == REQUEST_CONTROL, since=mark)
    return int(ack.result)


async def shown(client: Client, mark: int = 0) -> tuple[int, int, list[int]]:
    """Flags, operator and secondaries of the next CONTROL_STATUS."""
    message = await client.wait("CONTROL_STATUS", since=mark or client.mark(), timeout=3.0)
    assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 1)
    return message.flags, message.gcs_main, [system for system in message.gcs_secondary if system]


async def fast(w: World, since: float) -> None:
    """The drone itself flies north after a moment."""
    await w.drone.wait_log(lambda entry: entry.kind == "pose" and entry.args["vn"] > 1.0, 20.0, since=since)


async def slow(w: World, since: float) -> None:
    """The drone itself has stopped after a moment at which it flew."""
    await w.drone.wait_log(lambda entry: entry.kind == "pose" and abs(entry.args["vn"]) < 0.2, 20.0, since=since)


async def result(client: Client, command: int, *params: float, **place: Any) -> int:
    return int((await client.command(command, *params, **place)).result)


async def test_operator_control_that_is_off_does_not_exist() -> None:
    async with world() as w:
        assert await sent(w.client, control_request(w.client)) == UNSUPPORTED
        assert await result(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, CONTROL_STATUS) == UNSUPPORTED
        assert await result(w.client, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, CONTROL_STATUS, 1e5) == UNSUPPORTED
        await w.client.wait("SYSTEM_TIME")
        await w.client.wait("SYSTEM_TIME")
        assert w.client.since(0, "CONTROL_STATUS") == []
        assert await result(w.client, ARM, 1) == ACCEPTED


async def test_control_status_is_sent_once_a_second_and_at_each_change() -> None:
    async with world(options=[ON]) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        assert await shown(teacher) == (MANAGER | TAKEOVER, 0, [])
        began = now()
        await shown(teacher)
        await shown(teacher)
        assert now() - began < 3.0
        mark = teacher.mark()
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        assert await shown(teacher, mark) == (MANAGER, TEACHER, [])
        assert await result(teacher, dialect.MAV_CMD_REQUEST_MESSAGE, CONTROL_STATUS) == ACCEPTED
        mark = teacher.mark()
        assert await sent(teacher, control_release(teacher)) == ACCEPTED
        assert await shown(teacher, mark) == (MANAGER | TAKEOVER, 0, [])
        await said(w.client, "Operator: none, released by system 255")
        assert w.client.since(0, "CONTROL_STATUS") == []


@pytest.mark.parametrize(
    "fields",
    [
        (2.0, 0.0, 10.0, 255.0, 0.0),
        (NAN, 0.0, 10.0, 255.0, 0.0),
        (1.0, 2.0, 10.0, 255.0, 0.0),
        (1.0, 0.0, 10.0, 254.0, 0.0),
        (1.0, 0.0, 10.0, 250.0, 254.0),
        (1.0, 0.0, 10.0, 255.0, 300.0),
        (1.0, 0.0, 10.0, -1.0, 255.0),
        (1.0, 0.0, 10.0, 254.5, 255.0),
    ],
)
async def test_request_without_sense_is_denied(fields: tuple[float, ...]) -> None:
    async with world(options=[ON]) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        message = dialect.MAVLink_command_long_message(1, 1, REQUEST_CONTROL, 0, *fields, 0.0, 0.0)
        assert await sent(teacher, message) == DENIED
        await said(teacher, "Control request refused: ")
        assert await shown(teacher) == (MANAGER | TAKEOVER, 0, [])


async def test_request_with_unset_parameters_is_granted() -> None:
    async with world(options=[ON]) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        assert await result(teacher, REQUEST_CONTROL, 1) == ACCEPTED
        assert await result(teacher, REQUEST_CONTROL, 1, NAN, NAN, frame=0) == ACCEPTED
        assert await shown(teacher) == (MANAGER, TEACHER, [])


async def test_other_stations_are_refused_with_the_answer_of_each_protocol() -> None:
    """Also on an endpoint without operator control: else the operator would be one in name only."""
    async with world(options=[ON, ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT + 1)
        outsider = await w.connect(250)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        for client in (student, outsider):
            mark = client.mark()
            assert await result(client, ARM, 1) == NOT_IN_CONTROL
            assert await result(client, TAKEOFF, x=0.0, y=0.0, z=5.0) == NOT_IN_CONTROL
            await said(client, f"Message refused: {REFUSED}", mark)
            mark = client.mark()
            client.send(dialect.MAVLink_param_set_message(1, 1, b"ANF_RTH_ALT", 77.0, 9))
            error = await client.wait("PARAM_ERROR", since=mark)
            assert error.error == own.MAV_PARAM_ERROR_PERMISSION_DENIED
            client.send(dialect.MAVLink_mission_count_message(1, 1, 1))
            assert (await client.wait("MISSION_ACK", since=mark)).type == dialect.MAV_MISSION_DENIED
            assert await result(client, dialect.MAV_CMD_REQUEST_MESSAGE, 148) == ACCEPTED
            assert await result(client, dialect.MAV_CMD_RUN_PREARM_CHECKS) == ACCEPTED
            client.send(dialect.MAVLink_param_request_read_message(1, 1, b"ANF_RTH_ALT", -1))
            await client.wait("PARAM_VALUE", since=mark)
        assert [text for text in texts(teacher) if "refused" in text] == []
        counters = w.gateway.counters()
        assert counters["refused_operator"] == 8
        assert counters["refused_operator.COMMAND_LONG"] == 4
        refusals = [one for system in w.gateway.systems for one in system.components[0].commands.log.refusals]
        assert {(one.sysid, one.result, str(one.reason)) for one in refusals} == {
            (system, NOT_IN_CONTROL, REFUSED) for system in (STUDENT, 250)
        }
        assert await result(teacher, ARM, 1) == ACCEPTED
        assert not w.drone.firmware.pose.up


@both
async def test_stop_is_taken_from_every_station(flavour: str) -> None:
    async with world(options=[f"{ON}&flavour={flavour}"], flavour=flavour, speed=4.0) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        await w.take_off(8.0)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        outsider = await w.connect(250)
        hold, land = ((1, 4, 3), (1, 4, 6)) if flavour == "px4" else ((1, 17), (1, 9))
        for stop in ((SET_MODE, *hold), (PAUSE, 0), (RETURN,), (SET_MODE, *hold), (LAND,), (SET_MODE, *hold)):
            assert await result(outsider, *stop) == ACCEPTED, stop
        mark = outsider.mark()
        outsider.send(dialect.MAVLink_set_mode_message(1, 1, w.modes.land))
        await outsider.heartbeat(lambda beat: beat.custom_mode == w.modes.land, since=mark)
        outsider.send(dialect.MAVLink_set_mode_message(1, 1, HOLD if flavour == "px4" else 17))
        await outsider.heartbeat(lambda beat: beat.custom_mode != w.modes.land, since=mark)
        assert await result(outsider, SET_MODE, *land) == ACCEPTED
        await w.drone.wait_log(lambda entry: w.drone.pose.up < 0.1, 40.0)
        assert await result(outsider, ARM, 0) == ACCEPTED
        assert w.gateway.counters()["refused_operator"] == 0


async def test_other_station_moves_nothing_by_any_message() -> None:
    """But for stops, and for the gimbal, which has a manager of its own."""
    chance = random.Random(2313)
    stops = {SET_MODE, own.MAV_CMD_DO_SET_STANDARD_MODE, LAND, RETURN, dialect.MAV_CMD_DO_FLIGHTTERMINATION}
    async with world(options=[ON]) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        await w.take_off(5.0)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        outsider = await w.connect(250)
        (memory,) = [system.memory for system in w.gateway.systems]
        plans, mark, start = dict(memory.plans), len(w.drone.log), teacher.mark()
        packer = own.MAVLink(None, 250, 190)
        left_out = GIMBAL_MESSAGES | {own.MAVLINK_MSG_ID_SET_MODE}
        for id in own.mavlink_map.keys() - left_out:
            kind = own.mavlink_map[id]
            message = unpack(id, chance.randbytes(kind.unpacker.size))
            for field in ("target_system", "target"):
                if hasattr(message, field):
                    setattr(message, field, 1)
            if hasattr(message, "target_component"):
                message.target_component = chance.choice((0, 1, 100))
            if id in (own.MAVLINK_MSG_ID_COMMAND_LONG, own.MAVLINK_MSG_ID_COMMAND_INT):
                message.command = ARM
            outsider.send_raw(message.pack(packer))
            packer.seq = (packer.seq + 1) % 256
        for command in sorted(own.enums["MAV_CMD"].keys() - stops - GIMBAL_COMMANDS):
            if command <= 0xFFFF:
                outsider.send_command(command, 1, 1, 1, 1, x=1.0, y=1.0, z=5.0, target=(1, chance.choice((0, 1, 100))))
                await asyncio.sleep(0.002)
        assert await result(outsider, dialect.MAV_CMD_REQUEST_MESSAGE, 148) == ACCEPTED
        await watched(3.0)
        assert [entry.name for entry in list(w.drone.log)[mark:] if entry.kind == "command"] == []
        assert memory.plans == plans
        vehicle = [beat for _, beat in teacher.since(start, "HEARTBEAT") if beat.get_srcSystem() == 1]
        assert {beat.custom_mode for beat in vehicle} == {HOLD}
        assert await sent(outsider, control_request(outsider)) == UNSUPPORTED
        assert await shown(teacher) == (MANAGER, TEACHER, [])


async def test_file_of_a_plan_that_others_have_begun_to_write_changes_nothing() -> None:
    """Its last request ends a session, which every client may."""
    async with world(options=[ON], flavour="ardupilot") as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        outsider = await w.connect(250)
        ftp, content = Ftp(outsider), pack_plan([POINT], RALLY)
        assert (await ftp.ask(CREATE, PATHS[RALLY].encode())).opcode == ACK
        assert (await ftp.ask(WRITE, content)).opcode == ACK
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        assert (await ftp.ask(TERMINATE)).opcode == NAK
        await said(outsider, "Message refused: operator is system 255", 0)
        (memory,) = [system.memory for system in w.gateway.systems]
        assert not memory.plans.get(RALLY)
        assert w.gateway.counters()["refused_operator.FILE_TRANSFER_PROTOCOL"] == 1


async def test_download_of_another_station_does_not_keep_the_operator_from_an_upload() -> None:
    async with world(options=[ON]) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        outsider = await w.connect(250)
        points = [rally(HOME[:2], 20.0), rally((HOME[0] + 0.001, HOME[1]), 25.0)]
        assert (await upload(teacher, points, RALLY)).type == dialect.MAV_MISSION_ACCEPTED
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        await begin_download(outsider, RALLY)
        assert (await upload(teacher, points, RALLY)).type == dialect.MAV_MISSION_ACCEPTED


@both
async def test_sticks_and_setpoints_of_a_secondary_are_not_flown(flavour: str) -> None:
    """By the endpoint's option and by the range of the operator's request; it commands all the same."""
    options = [f"{ON}&flavour={flavour}", f"{ON}&secondaries=250-252&flavour={flavour}"]
    async with world(options=options, flavour=flavour) as w:
        await w.take_off(8.0)
        ids = (STUDENT, 253, 251)
        teacher, named, listed = await stations(w, OPTIONS_PORT, OPTIONS_PORT, OPTIONS_PORT + 1, ids=ids)
        assert await sent(teacher, control_request(teacher, low=253, high=254)) == ACCEPTED
        await teacher.wait("CONTROL_STATUS", lambda m: list(m.gcs_secondary[:3]) == [251, 253, 0], since=0)
        reason = "operator is system 254"
        for client in (named, listed):
            assert await result(client, SET_MODE, *((1, 3, 0) if flavour == "px4" else (1, 5))) == ACCEPTED
            began, mark = now(), client.mark()
            async with streaming(client, CENTRED, 0.1):
                await watched(1.0)
            assert texts(client, mark) == []
            async with streaming(client, STICK, 0.1):
                await said(client, f"Sticks ignored: {reason}", mark)
            async with streaming(client, NORTH, 0.1):
                await said(client, f"Setpoint refused: {reason}", mark)
                if flavour == "px4":
                    assert await result(client, SET_MODE, 1, 6, 0) != ACCEPTED
            assert motion(w, began) == []
        if flavour == "px4":
            async with streaming(teacher, NORTH, 0.1):
                await watched(0.5)
                began = now()
                assert await result(named, SET_MODE, 1, 6, 0) == NOT_IN_CONTROL
                assert motion(w, began) == []
        began = now()
        assert await result(named, dialect.MAV_CMD_CONDITION_YAW, 30.0, 0.0, 0.0, 1.0) == ACCEPTED
        assert motion(w, began)
        assert w.gateway.counters()["refused_operator.MANUAL_CONTROL"] > 20


async def test_takeover_is_asked_for_granted_and_announced() -> None:
    """The whole way of two QGroundControls: asked, notified, acknowledged, offered, granted."""
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        await said(w.client, "Operator: system 255")
        mark = teacher.mark()
        assert await sent(student, control_request(student, takeover=0, timeout=20)) == FAILED
        await said(student, f"Control request refused: {REFUSED}")
        asked = await teacher.wait("COMMAND_LONG", since=mark)
        assert (asked.target_system, asked.target_component, asked.command) == (TEACHER, 190, REQUEST_CONTROL)
        assert (asked.param1, asked.param2, asked.param3, asked.param4, asked.param5) == (1.0, 0.0, 20.0, 254.0, 0.0)
        await said(teacher, "Control requested: system 254 waits 20 s")
        teacher.send(dialect.MAVLink_command_ack_message(REQUEST_CONTROL, ACCEPTED, 0, 0, 1, 1))
        assert await sent(student, control_request(student)) == FAILED
        await watched(4.0)
        assert len(teacher.since(mark, "COMMAND_LONG")) == 1
        mark = student.mark()
        assert await sent(teacher, control_request(teacher, takeover=1)) == ACCEPTED
        assert await shown(student, mark) == (MANAGER | TAKEOVER, TEACHER, [])
        await said(student, "Control offered by system 255: request again", mark)
        assert await sent(student, control_request(student)) == ACCEPTED
        await said(w.client, "Operator: system 254, was system 255")
        assert (await shown(teacher))[:2] == (MANAGER, STUDENT)
        assert await result(teacher, ARM, 1) == NOT_IN_CONTROL
        assert await sent(teacher, control_release(teacher)) == NOT_IN_CONTROL
        assert await result(student, ARM, 1) == ACCEPTED


async def test_request_that_is_not_acknowledged_is_repeated_and_expires() -> None:
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        mark = student.mark()
        assert await sent(student, control_request(student, timeout=3)) == FAILED
        await said(student, f"Control request expired: {REFUSED}", mark)
        notified = [message for _, message in teacher.since(0, "COMMAND_LONG")]
        assert [message.confirmation for message in notified] == [0, 1, 2]
        assert texts(teacher).count("Control requested: system 254 waits 3 s") == 1


@both
async def test_takeover_ends_the_setpoints_of_the_operator_before(flavour: str) -> None:
    async with world(options=[f"{ON}&flavour={flavour}"], flavour=flavour, speed=1.0) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        await w.take_off(8.0)
        assert await sent(teacher, control_request(teacher, takeover=1)) == ACCEPTED
        began = now()
        async with streaming(teacher, NORTH):
            await engage(teacher, flavour)
            await fast(w, began)
            mark, began = teacher.mark(), now()
            assert await sent(student, control_request(student)) == ACCEPTED
            await said(teacher, "Offboard ended: operator is system 254", mark)
            await said(teacher, "Setpoint refused: operator is system 254", mark)
            await slow(w, began)
        after = [entry for entry in motion(w, began) if entry.t > began + 0.2]
        assert after == []
        began = now()
        if flavour == "ardupilot":
            assert await result(student, SET_MODE, 1, COPTER_GUIDED) == ACCEPTED
        async with streaming(student, NORTH):
            await engage(student, flavour)
            await fast(w, began)


async def test_takeover_centres_the_sticks_of_the_operator_before() -> None:
    async with world(options=[ON], speed=1.0) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        await w.take_off(8.0)
        assert await result(teacher, SET_MODE, 1, 3, 0) == ACCEPTED
        assert await sent(teacher, control_request(teacher, takeover=1)) == ACCEPTED
        began = now()
        async with streaming(teacher, STICK, 0.1):
            await fast(w, began)
            began = now()
            assert await sent(student, control_request(student)) == ACCEPTED
            await said(teacher, "Sticks ignored: operator is system 254")
            await slow(w, began)
        assert "Sticks silent: hovering" not in texts(teacher)  # they were centred before they were missed


async def test_lost_operator_does_not_lock_the_aircraft() -> None:
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        BEATING.pop().cancel()
        BEATING.append(asyncio.ensure_future(beats(student)))
        await teacher.close()
        lost, mark = now(), student.mark()
        assert await result(student, ARM, 1) == NOT_IN_CONTROL
        await student.wait("CONTROL_STATUS", lambda m: m.gcs_main == 0, since=mark, timeout=SILENT + 3.0)
        assert SILENT - 1.5 < now() - lost < SILENT + 1.0
        await said(student, "Operator: none, system 255 is silent", mark)
        assert await result(student, ARM, 1) == ACCEPTED
        assert await sent(student, control_request(student)) == ACCEPTED


async def test_operator_keeps_control_across_a_loss_of_the_drones_link() -> None:
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        w.drone.faults.mute = True
        await watched(SILENT + 6.0)
        assert not [system for system in w.gateway.systems if system.active]
        w.drone.faults.mute = False
        await teacher.wait("CONTROL_STATUS", lambda m: m.gcs_main == TEACHER, timeout=20.0)
        assert await result(student, ARM, 1) == NOT_IN_CONTROL
        assert await result(teacher, ARM, 1) == ACCEPTED


async def test_gimbal_of_another_station_is_decided_by_its_manager() -> None:
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        await w.take_off(8.0)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        assert await result(student, PITCHYAW, -40.0, 0.0, NAN, NAN, x=LEVEL, z=0.0) == ACCEPTED
        await looks(w, pitch_absolute=-40.0)
        began = now()
        roi = {"x": 48.8795, "y": 2.3677, "z": 35.0}
        assert await result(student, dialect.MAV_CMD_DO_SET_ROI_LOCATION, **roi) == NOT_IN_CONTROL
        await said(student, f"ROI refused: {REFUSED}")
        assert motion(w, began) == []
        assert await result(student, dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, 0, 0, NAN, NAN) == ACCEPTED
        assert await result(teacher, dialect.MAV_CMD_DO_SET_ROI_LOCATION, **roi) == ACCEPTED
        mark = len(w.drone.log)
        for command in (dialect.MAV_CMD_DO_SET_ROI_NONE, dialect.MAV_CMD_DO_SET_ROI):
            assert await result(student, command) == NOT_IN_CONTROL
        assert "ardrone3.Piloting.StopPilotedPOI" not in {entry.name for entry in list(w.drone.log)[mark:]}
        assert await result(teacher, dialect.MAV_CMD_DO_SET_ROI_NONE) == ACCEPTED


async def test_components_of_the_drones_own_system_are_not_refused() -> None:
    async with world(options=[ON]) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        companion = await w.connect(1, 191)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        assert await result(companion, ARM, 1) == ACCEPTED


async def test_sticks_of_the_skycontroller_are_above_the_operator() -> None:
    async with world(options=[ON], skycontroller=3, speed=1.0) as w:
        (teacher,) = await stations(w, OPTIONS_PORT, ids=(TEACHER,))
        await w.take_off(8.0)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        began = now()
        async with streaming(teacher, NORTH):
            await engage(teacher, "px4")
            await fast(w, began)
            mark = teacher.mark()
            assert w.drone.skycontroller is not None
            w.drone.skycontroller.stick(PITCH_STICK, 40)
            await said(teacher, "Offboard ended: Skycontroller pilot in control", mark)
        assert await shown(teacher) == (MANAGER, TEACHER, [])


async def test_parameter_of_a_secondary_is_written_and_its_flight_begins() -> None:
    async with world(options=[f"{ON}&secondaries=254"]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        (drone,) = w.gateway.status().drones
        assert (drone.operator, drone.secondaries) == (TEACHER, (STUDENT,))
        assert await shown(teacher) == (MANAGER, TEACHER, [STUDENT])
        assert (await write(student, "ANF_RTH_ALT", 77.0)).param_value == 77.0
        assert await result(student, ARM, 1) == ACCEPTED
        assert await result(student, TAKEOFF, x=0.0, y=0.0, z=5.0) == ACCEPTED
        assert await sent(student, control_request(student)) == FAILED


async def test_parameter_write_that_waits_is_refused_once_another_station_is_the_operator() -> None:
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        before = await read(student, "ANF_RTH_ALT")
        w.drone.faults.mute = True  # the first write waits for its answer
        send_set(student, "ANF_RTH_ALT", 77.0, before.param_type)
        await read(student, "ANF_RTH_ALT")  # once it is answered the write before it is under way
        mark = student.mark()
        send_set(student, "ANF_RTH_ALT", 88.0, before.param_type)
        await read(student, "ANF_RTH_ALT")
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        w.drone.faults.mute = False
        error = await student.wait("PARAM_ERROR", since=mark)
        assert error.error == own.MAV_PARAM_ERROR_PERMISSION_DENIED
        assert (await read(teacher, "ANF_RTH_ALT")).param_value == 77.0


async def test_camera_command_that_waits_is_refused_once_another_station_is_the_operator() -> None:
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        await enter(student, VIDEO)
        w.drone.faults.mute = True  # the start waits for its answer, and the end for its turn
        mark, stop = student.mark(), dialect.MAV_CMD_VIDEO_STOP_CAPTURE
        student.send_command(dialect.MAV_CMD_VIDEO_START_CAPTURE, target=(1, CAMERA))
        student.send_command(stop, target=(1, CAMERA))
        await watched(0.2)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        w.drone.faults.mute = False
        ack = await student.wait(
            "COMMAND_ACK",
            lambda m: m.command == stop and m.result != dialect.MAV_RESULT_IN_PROGRESS,
            since=mark,
            timeout=10.0,
        )
        assert ack.result == NOT_IN_CONTROL
        assert not w.commands("camera.stop_recording")


async def test_removal_of_a_photo_that_waits_is_refused_once_another_station_is_the_operator() -> None:
    async with world(options=[ON], web=True) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        photo = add_photo(w.drone)
        assert w.drone.web is not None
        w.drone.web.mute = True  # the list of the media is awaited first
        path, mark = f"/media/{DAY}/{photo.id}".encode(), student.mark()
        Ftp(student, component=CAMERA).send(REMOVE, path, seq=8)
        await watched(0.2)
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        w.drone.web.mute = False
        reply = await student.wait(
            "FILE_TRANSFER_PROTOCOL", lambda m: taken_apart(m).seq == 9, since=mark, timeout=15.0
        )
        assert taken_apart(reply).error == PROTECTED
        assert w.drone.firmware.payload.media.resource(photo.id) is not None


async def test_camera_setting_that_waits_is_refused_once_another_station_is_the_operator() -> None:
    async with world(options=[ON]) as w:
        teacher, student = await stations(w, OPTIONS_PORT, OPTIONS_PORT)
        before = ext_params.value_of(await ext_params.read(student, "CAM_EV"))
        kind = dialect.MAV_PARAM_EXT_TYPE_REAL32
        w.drone.faults.mute = True  # the first write waits for its answer
        ext_params.send_set(student, "CAM_SATURATION", 1.0, kind)
        mark = student.mark()
        ext_params.send_set(student, "CAM_EV", 1.0, kind)
        await ext_params.read(student, "CAM_EV")  # once it is answered both writes have arrived
        assert await sent(teacher, control_request(teacher)) == ACCEPTED
        w.drone.faults.mute = False
        final = ext_params.FINAL
        ack = await student.wait(
            "PARAM_EXT_ACK", lambda m: m.param_id == "CAM_EV" and m.param_result in final, since=mark, timeout=8.0
        )
        assert ack.param_result == dialect.PARAM_ACK_FAILED
        assert ext_params.value_of(await ext_params.read(teacher, "CAM_EV")) == before

"""What ground stations that are not in this suite send, in their order and with their patience: QGroundControl and
Mission Planner (conformance A1-A5, D3, reference streams). And several of them at once, and noise.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import lzma
import random
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from MAVProxy.modules.lib.param_ftp import ftp_param_decode
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import clock
from support.ftp import Ftp
from support.mav import NAN, Client
from support.params import fetch
from support.plans import REQUESTS, content, mission, send_item
from support.world import ARMED, HOME, World, loopback, world

from anafi_mav import geo, mav_enums
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator

ACCEPTED, UNSUPPORTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_UNSUPPORTED
ARM, TAKE_OFF, REPOSITION, SET_MODE, REQUEST = (
    mav_enums.MAV_CMD_COMPONENT_ARM_DISARM,
    mav_enums.MAV_CMD_NAV_TAKEOFF,
    mav_enums.MAV_CMD_DO_REPOSITION,
    mav_enums.MAV_CMD_DO_SET_MODE,
    mav_enums.MAV_CMD_REQUEST_MESSAGE,
)
FLAVOURS = ("px4", "ardupilot")


async def requested(client: Client, message: str, id: int, *parameters: float, patience: float = 1.0) -> Any:
    """REQUEST_MESSAGE as QGroundControl sends it: acknowledged in 1.2 s, the message within a second of that."""
    mark = client.mark()
    assert (await client.command(REQUEST, id, *parameters, timeout=1.2)).result == ACCEPTED
    return await client.wait(message, since=mark, timeout=patience)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_051_qgroundcontrol_connects(flavour: str) -> None:
    """What was recorded of it, in that order (reference streams), and what newer ones ask besides (conformance A2)."""
    async with world(flavour=flavour) as w:
        client = w.client
        began = time.monotonic()
        mark = client.mark()
        # Its first word to a PX4 vehicle is a frame of MAVLink 1.
        frame = dialect.MAVLink_command_long_message(1, 1, REQUEST, 0, 148, 0, 0, 0, 0, 0, 0)
        client.send_raw(frame.pack(dialect.MAVLink(None, 255, 190), force_mavlink1=flavour == "px4"))
        if flavour == "ardupilot":  # it does not wait for the first answer
            assert (
                await client.command(mav_enums.MAV_CMD_SET_MESSAGE_INTERVAL, 242, 1e6, timeout=1.2)
            ).result == ACCEPTED
        version = await client.wait("AUTOPILOT_VERSION", since=mark, timeout=1.0)
        assert version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_FTP
        if flavour == "px4":
            assert (await requested(client, "PROTOCOL_VERSION", 300)).max_version == 200
        first = await requested(client, "AVAILABLE_MODES", 435, 1)
        names = [first.mode_name]
        for index in range(2, first.number_modes + 1):
            names.append((await requested(client, "AVAILABLE_MODES", 435, index)).mode_name)
        assert len(set(names)) == first.number_modes
        where = await requested(client, "COMPONENT_METADATA", 397)
        if flavour == "px4":
            await metadata(client, where.uri)
            assert (await client.command(mav_enums.MAV_CMD_RUN_PREARM_CHECKS, timeout=1.2)).result == ACCEPTED
            values = await fetch(client, flavour)
            assert len(values) == next(iter(values.values())).param_count
        else:
            assert (await requested(client, "COMPONENT_INFORMATION", 395)).general_metadata_uri == where.uri
            packed = ftp_param_decode(await Ftp(client).download("@PARAM/param.pck")).params
            assert len({name for name, _, _ in packed}) == len(packed) > 100
        async with data_streams(client if flavour == "ardupilot" else None):
            for _ in range(2):
                client.send(dialect.MAVLink_system_time_message(int(time.time() * 1e6), 1000))
            for kind in (0, 1, 2):
                mark = client.mark()
                client.send(dialect.MAVLink_mission_request_list_message(1, 1, kind))
                count = await client.wait(
                    "MISSION_COUNT", lambda m, kind=kind: m.mission_type == kind, since=mark, timeout=0.5
                )
                assert (count.count, count.target_system, count.target_component) == (0, 255, 190)
            await client.wait("HOME_POSITION", since=0, timeout=2.0)
            assert time.monotonic() - began < 10.0
            if flavour == "ardupilot":
                for kind in ("SYS_STATUS", "RC_CHANNELS", "GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD"):
                    await client.wait(kind, timeout=2.0)
        assert not [m for _, m in client.since(0, "STATUSTEXT") if m.severity <= dialect.MAV_SEVERITY_WARNING]


async def metadata(client: Client, uri: str) -> None:
    """It loads the general document, then what that says of parameters and events."""
    general = await loaded(client, uri)
    types = {entry["type"]: entry for entry in general["metadataTypes"]}
    for type in (1, 4):  # COMP_METADATA_TYPE_PARAMETER and _EVENTS, which the stock dialect does not have
        assert (await loaded(client, types[type]["uri"]))["version"] >= 1


async def loaded(client: Client, uri: str) -> Any:
    assert uri.startswith("mftp:///")
    return json.loads(lzma.decompress(await Ftp(client).download(uri.removeprefix("mftp://"))))


@asynccontextmanager
async def data_streams(client: Client | None) -> AsyncIterator[None]:
    """It asks ArduPilot's groups of streams at 2 Hz, all of them every half a second."""

    async def ask() -> None:
        while client is not None:
            for stream in (1, 2, 3, 6, 10, 11, 12):
                client.send(dialect.MAVLink_request_data_stream_message(1, 1, stream, 2, 1))
            await asyncio.sleep(0.5)

    task = asyncio.ensure_future(ask())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_051_qgroundcontrol_flies(flavour: str) -> None:
    """Take-off, go to, another height, pause, return, land by its buttons; each shown within its 1.3 s."""
    async with world(flavour=flavour) as w:
        client = w.client
        north = geo.destination(*HOME[:2], 25.0, 0.0)
        if flavour == "ardupilot":
            await mode(w, 4)
            assert (await client.command(ARM, 1, timeout=1.2)).result == ACCEPTED
            assert (await client.command(TAKE_OFF, -1, z=8.0)).result == ACCEPTED
        else:
            assert (await client.command(TAKE_OFF, -1, z=HOME[2] + 8.0, timeout=1.2)).result == ACCEPTED
            assert (await client.command(ARM, 1, timeout=1.2)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveByEnd"), 20.0)
        ack = await client.command(REPOSITION, -1, 1, 0, NAN, frame=0, x=north[0], y=north[1], z=HOME[2] + 8.0)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 1, 30.0)
        assert abs(w.drone.pose.north - 25.0) < 1.0
        if flavour == "px4":
            assert (await client.command(REPOSITION, -1, 1, 0, NAN)).result == ACCEPTED
            assert (await client.command(REPOSITION, -1, 1, 0, NAN, z=HOME[2] + 12.0)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["up"] - 12.0) < 0.5, 20.0)
            for number in (w.modes.returning, w.modes.land):
                mark = client.mark()
                client.send(dialect.MAVLink_set_mode_message(1, 1, number))
                await client.heartbeat(lambda beat, n=number: beat.custom_mode == n, since=mark, timeout=1.3)
        else:
            for number in (17, w.modes.returning, w.modes.land):
                await mode(w, number)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)


async def mode(w: World, number: int) -> None:
    """A mode by DO_SET_MODE, shown within what QGroundControl waits for it."""
    mark = w.client.mark()
    assert (await w.client.command(SET_MODE, 1, number, timeout=1.2)).result == ACCEPTED
    await w.client.heartbeat(lambda beat: beat.custom_mode == number, since=mark, timeout=1.3)


async def test_same_flight_ends_at_same_place_in_both_flavours() -> None:
    """Each in the words of its own clients: up, over there, another height, a turn, back down where it is."""
    places = []
    for flavour in FLAVOURS:
        async with world(flavour=flavour) as w:
            client, there = w.client, geo.destination(*HOME[:2], 18.0, -12.0)
            await w.take_off(6.0)
            heading = NAN if flavour == "px4" else 0.0  # what each family sends for none
            ack = await client.command(REPOSITION, -1, 1, 0, heading, frame=3, x=there[0], y=there[1], z=9.0)
            assert ack.result == ACCEPTED
            await w.drone.wait_log(lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 1, 30.0)
            if flavour == "px4":
                assert (await client.command(REPOSITION, NAN, 1, NAN, NAN, z=HOME[2] + 5.0)).result == ACCEPTED
            else:
                client.send(dialect.MAVLink_mission_item_message(1, 1, 0, 3, 16, 3, 1, 0, 0, 0, 0, 0, 0, 5.0))
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["up"] - 5.0) < 0.2, 20.0)
            if flavour == "px4":
                assert (await client.command(REPOSITION, NAN, 1, NAN, 1.0)).result == ACCEPTED
            else:
                degrees = 180.0 / 3.141592653589793
                assert (
                    await client.command(mav_enums.MAV_CMD_CONDITION_YAW, degrees, 0, 0, 0, timeout=20.0)
                ).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["yaw"] - 1.0) < 0.05, 20.0)
            client.send(dialect.MAVLink_set_mode_message(1, 1, w.modes.land))
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)
            pose = w.drone.pose
            places.append((pose.north, pose.east, pose.up, pose.yaw))
    assert places[0] == pytest.approx(places[1], abs=0.7)
    assert places[0][:2] == pytest.approx((18.0, -12.0), abs=1.0)


async def test_conf_120_mission_planner() -> None:
    """Its connection, its buttons, and its requests to camera and gimbal."""
    async with world(flavour="ardupilot") as w:
        client = w.client
        for _ in range(2):
            await client.wait("HEARTBEAT", timeout=2.0)
        mark = client.mark()
        client.send(dialect.MAVLink_autopilot_version_request_message(1, 1))
        await client.wait("AUTOPILOT_VERSION", since=mark, timeout=1.0)
        await requested(client, "AUTOPILOT_VERSION", 148)
        mark = client.mark()
        assert (await client.command(mav_enums.MAV_CMD_DO_SEND_BANNER)).result == ACCEPTED
        await client.wait("STATUSTEXT", lambda m: m.text.startswith("ArduCopter V4.5"), since=mark)
        values = await fetch(client, "ardupilot")
        assert {"SYSID_THISMAV", "RTL_ALT"} <= set(values)
        for target, message, result in (
            ((1, 1), 259, UNSUPPORTED),
            ((0, 0), 259, ACCEPTED),
            ((1, 1), 280, ACCEPTED),
            ((0, 0), 280, ACCEPTED),
        ):
            began = time.monotonic()
            assert (await client.command(REQUEST, message, target=target)).result == result
            assert time.monotonic() - began < 0.2
        mark = client.mark()
        client.send_command(mav_enums.MAV_CMD_GET_HOME_POSITION)
        await client.wait("HOME_POSITION", since=mark, timeout=0.7)

        # It sets a mode by the command, then twice by the message, and does not look.
        client.send_command(SET_MODE, 1, 4)
        for _ in range(2):
            client.send(dialect.MAVLink_set_mode_message(1, 1, 4))
        await client.heartbeat(lambda beat: beat.custom_mode == 4)
        assert (await client.command(ARM, 1, timeout=10.0)).result == ACCEPTED
        assert (await client.command(TAKE_OFF, 0, 0, 0, 0, x=0.0, y=0.0, z=6.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveByEnd"), 20.0)
        mark = client.mark()
        client.send(
            dialect.MAVLink_mission_item_message(1, 1, 0, 3, 16, 3, 1, 0, 0, 0, 0, 0, 0, 9.0)  # current 3: altitude
        )
        assert (await client.wait("MISSION_ACK", since=mark)).type == dialect.MAV_MISSION_ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["up"] - 9.0) < 0.4, 20.0)
        client.send_command(SET_MODE, 1, 9)
        await client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=30.0)


async def test_conf_120_mission_planner_writes_and_reads_a_mission() -> None:
    """Its patience: 700 ms for a list's answer, 450 ms for the request after an item, 2.5 s for an item. It hears what
    is addressed to it alone, and counts home as the first item."""
    items = mission(HOME, 12)
    async with world(flavour="ardupilot") as w:
        client = w.client
        version = await requested(client, "AUTOPILOT_VERSION", 148)
        assert version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        mark = client.mark()
        client.send(dialect.MAVLink_mission_count_message(1, 1, len(items), 0))
        for seq, item in enumerate(items):
            asked = await to_us(client, REQUESTS, mark, 0.7 if seq == 0 else 0.45)
            assert asked.seq == seq
            mark = client.mark()
            send_item(client, item, seq, 0)
        assert (await to_us(client, ("MISSION_ACK",), mark, 0.45)).type == dialect.MAV_MISSION_ACCEPTED

        mark = client.mark()
        client.send(dialect.MAVLink_mission_request_list_message(1, 1, 0))
        assert (await to_us(client, ("MISSION_COUNT",), mark, 0.7)).count == len(items)
        for seq, item in enumerate(items):
            mark = client.mark()
            client.send(dialect.MAVLink_mission_request_int_message(1, 1, seq, 0))
            observed = await to_us(client, ("MISSION_ITEM_INT",), mark, 2.5)
            assert observed.seq == seq
            if seq:  # home is the vehicle's own
                assert content(observed) == pytest.approx(item.content)
        client.send(dialect.MAVLink_mission_ack_message(1, 1, 0, 0))
        assert not [m for _, m in client.since(0, "STATUSTEXT") if m.severity <= dialect.MAV_SEVERITY_WARNING]


async def to_us(client: Client, kinds: tuple[str, ...], since: int, patience: float) -> Any:
    """The first message of a mission transfer, which must be one of these, with our address on it."""
    message = await client.wait(
        (*REQUESTS, "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT"), since=since, timeout=patience
    )
    assert message.get_type() in kinds, message
    assert (message.target_system, message.target_component, message.mission_type) == (255, 190, 0)
    return message


async def test_conf_118_dronekit_on_px4s_flavour() -> None:
    """What dronekit sends there (pymavlink, component 0): armed, off the ground, Position, Return. Its script is run
    with ArduPilot's flavour, the only one for which it knows its modes by name (conformance D2)."""
    async with world() as w:
        client = await w.connect(255, 0)
        mark = client.mark()
        client.send(dialect.MAVLink_param_request_read_message(1, 0, b"MPC_TILTMAX_AIR", -1))
        value = await client.wait("PARAM_VALUE", lambda m: m.param_id == "MPC_TILTMAX_AIR", since=mark)
        assert value.param_value == pytest.approx(10.0)
        assert (await client.command(ARM, 1, target=(1, 0))).result == ACCEPTED
        assert (await client.command(TAKE_OFF, 0, 0, 0, 0, x=0.0, y=0.0, z=5.0, target=(1, 0))).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveByEnd"), 20.0)
        for main, sub, number in ((3, 0, w.modes.position), (4, 5, w.modes.returning)):
            ack = await client.command(SET_MODE, 1, main, sub, target=(1, 0))
            assert ack.result == ACCEPTED
            await client.heartbeat(lambda beat, n=number: beat.custom_mode == n)


async def test_conf_050_the_cut_obeys_the_policy() -> None:
    for flavour, allowed in itertools.product(FLAVOURS, (False, True)):
        async with world(flavour=flavour, allow_kill=allowed) as w:
            await w.take_off()
            mark = w.client.mark()
            ack = await w.client.command(ARM, 0, 21196)
            assert ack.result == (ACCEPTED if allowed else dialect.MAV_RESULT_DENIED)
            assert len(w.commands("ardrone3.Piloting.Emergency")) == int(allowed)
            if not allowed:
                text = await w.client.wait("STATUSTEXT", since=mark)
                assert text.severity == dialect.MAV_SEVERITY_CRITICAL
                assert "allow_kill" in text.text or "Motor cut refused" in text.text
                assert w.drone.flying_state.name in ("HOVERING", "FLYING")


async def test_conf_156_the_standard_flavour() -> None:
    """MAVSDK's way for an autopilot it does not know: heights of take-off are relative, modes are standard ones."""
    async with world(flavour="standard") as w:
        beat = await w.client.heartbeat(lambda beat: True)
        assert beat.autopilot == dialect.MAV_AUTOPILOT_GENERIC
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKE_OFF, z=6.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["up"] - 6.0) < 0.3, 20.0)
        land = dialect.MAV_STANDARD_MODE_LAND
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_STANDARD_MODE, land)).result == ACCEPTED
        assert w.drone.flying_state.name == "LANDING"


async def test_conf_121_two_vehicles_and_two_ground_stations() -> None:
    """Each asks another vehicle the same things at the same time; no one hears an answer that is not theirs."""
    address, places = loopback(), [loopback(), loopback()]
    config = Config(
        endpoints=(f"tcpin://{address}:5760", f"tcpin://{address}:5761?flavour=ardupilot"),
        drones=tuple(DroneConfig(name=f"d{n}", sysid=n + 1, address=place) for n, place in enumerate(places)),
    )
    specs = [DroneSpec(address=place, home=HOME, http_port=None) for place in places]
    async with Simulator(specs, speed=3.0, seed=1) as simulator, Gateway(config) as gateway:
        assert await gateway.ready(10.0)
        clients = [await Client(255, 190).connect(5760, address), await Client(254, 190).connect(5761, address)]
        try:
            for client in clients:
                for sysid in (1, 2):
                    await client.heartbeat(lambda beat, s=sysid: beat.get_srcSystem() == s, since=0)
            marks = [client.mark() for client in clients]
            acks = await asyncio.gather(
                *(
                    client.command(id, *parameters, target=(sysid, 1))
                    for id, *parameters in ((ARM, 1), (REQUEST, 148), (510, 30))
                    for client, sysid in zip(clients, (1, 2), strict=True)
                )
            )
            assert {ack.result for ack in acks} == {ACCEPTED}
            for client, sysid, mark in zip(clients, (1, 2), marks, strict=True):
                heard = client.since(mark, "COMMAND_ACK")
                assert [m.get_srcSystem() for _, m in heard] == [sysid] * 3
                assert {m.target_system for _, m in heard} == {client.sysid}
                for kind in ("AUTOPILOT_VERSION", "MESSAGE_INTERVAL"):
                    assert {m.get_srcSystem() for _, m in client.since(mark, kind)} == {sysid}
            for drone in simulator.drones:
                assert drone.flying_state.name == "LANDED"
        finally:
            for client in clients:
                await client.close()


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_146_noise_changes_nothing(flavour: str) -> None:
    """Frames that are cut, changed, too long or of nothing, between good ones."""
    noise = random.Random(146)
    async with world(flavour=flavour) as w, clock.stalls() as stalls:
        good = dialect.MAVLink_command_long_message(1, 1, 31000, 0, *[0.0] * 7).pack(dialect.MAVLink(None, 255, 190))
        mark = w.client.mark()
        for _ in range(300):
            bad = bytearray(good)
            for _ in range(noise.randint(1, 4)):
                bad[noise.randrange(len(bad))] = noise.randrange(256)
            w.client.send_raw(bytes(bad[: noise.randint(1, len(bad))]))
            w.client.send_raw(noise.randbytes(noise.randint(0, 400)))
        assert (await w.client.command(mav_enums.MAV_CMD_DO_GRIPPER)).result == UNSUPPORTED
        beats = [at for at, _ in w.client.since(mark, "HEARTBEAT")]
        assert all(b - a < 1.2 + stalls.longest for a, b in itertools.pairwise(beats))
        await w.client.wait("ATTITUDE")
        assert w.drone.flying_state.name == "LANDED"


async def test_conf_147_a_storm_of_clients() -> None:
    """Four clients ping and steer at 50 Hz each: the heartbeat's time does not move by a tenth of a second."""
    async with world(clients=4) as w, clock.stalls() as stalls:
        mark = w.client.mark()
        for count in range(250):
            for client in w.clients:
                client.send(dialect.MAVLink_ping_message(count, count, 0, 0))
                client.send(dialect.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0))
            await asyncio.sleep(0.02)  # the clients' own rate
        beats = [at for at, _ in w.client.since(mark, "HEARTBEAT")]
        gaps = [b - a for a, b in itertools.pairwise(beats)]
        assert len(gaps) >= 3
        late = 0.1 + stalls.longest
        assert all(abs(gap - 1.0) <= late for gap in gaps), (gaps, stalls.longest)
        answers = [m for client in w.clients for _, m in client.since(0, "PING")]
        assert len(answers) > 900  # of a thousand, the last of which are still on their way

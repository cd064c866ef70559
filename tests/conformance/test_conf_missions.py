"""Conformance items 49, 72 to 74, 122 and 141: missions as clients fly them, over real sockets, in both flavours.

Where the drone went and what it did is taken from the simulator, never from the gateway's word.
"""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import return_by_itself
from support.flavours import both
from support.mav import Client
from support.missions import (
    ACTIVE,
    COMPLETE,
    CORNERS,
    LAND,
    MISSION_MODE,
    NOT_STARTED,
    PAUSED,
    PLACE,
    ROUND,
    first,
    flown,
    mode,
    on_the_way,
    put,
    reached,
    said,
    settled,
    start,
    state,
    takeoff,
    way,
    whole,
)
from support.plans import ACCEPTED, FENCE, MISSION, UNSUPPORTED_FRAME, Item, around, square, upload
from support.setpoints import said as text_said
from support.world import ARMED, world

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.mavlink import dialect as newer

# Flown to the end.


@both
async def test_conf_049_073_mission_from_the_ground_is_flown_completely(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        assert (await state(w, NOT_STARTED, since=0)).seq == 0  # for ArduPilot that is home
        mark = w.client.mark()
        await start(w)
        await mode(w, MISSION_MODE[flavour], since=mark)
        for seq in (1, 2):
            await state(w, ACTIVE, seq=seq, since=mark)
        await said(w, "link loss: return home", since=mark)  # what becomes of it without the gateway
        end = await state(w, COMPLETE, since=mark)
        assert whole(end).total == len(ROUND)
        assert reached(w) == [0, 1, 2, 3, 4]
        assert flown(w)[-3:] == ["waypoint", "condition_delay", "return_to_launch"]
        await mode(w, w.modes.returning, since=mark)
        # It stays complete, and nothing of it is reported again.
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle, timeout=40.0)
        await state(w, COMPLETE)
        assert reached(w) == [0, 1, 2, 3, 4]


@both
@pytest.mark.parametrize("end", ["land", "hover"])
async def test_conf_073_other_ends(flavour: str, end: str) -> None:
    """One that lands is over when it lands; one without an end leaves the drone hovering at its last way point."""
    async with world(flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), way(10.0, 5.0, 6.0), *([LAND] if end == "land" else [])])
        mark = w.client.mark()
        await start(w)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2][: 3 if end == "land" else 2]
        if end == "land":
            await mode(w, w.modes.land, since=mark)
            await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=30.0)
        else:
            await mode(w, w.modes.idle, since=mark)
            await settled(w, (10.0, 5.0, 6.0))
        assert math.dist((w.drone.pose.north, w.drone.pose.east), (10.0, 5.0)) < 1.5


@both
async def test_conf_027_059_mode_mission_by_every_way(flavour: str) -> None:
    """It is offered when there is a mission; asked for again in flight, by any client, it changes nothing."""
    async with world(flavour=flavour, web=True) as w:
        other = await w.connect(254)
        number = MISSION_MODE[flavour]
        monitor = await w.client.wait("AVAILABLE_MODES_MONITOR", since=0)
        await put(w, [takeoff(6.0), way(60.0, 0.0, 6.0)])
        await w.client.wait("AVAILABLE_MODES_MONITOR", lambda m: m.seq != monitor.seq)
        await w.take_off(5.0)
        commands = [
            (dialect.MAV_CMD_DO_SET_MODE, 1, *((number,) if first(w) else (4, 4))),
            (dialect.MAV_CMD_DO_SET_MODE, 1, 0x04040000),
            (newer.MAV_CMD_DO_SET_STANDARD_MODE, newer.MAV_STANDARD_MODE_MISSION),
            (dialect.MAV_CMD_MISSION_START, 0, 0),
            None,
        ]
        for starts, command in enumerate(commands, 1):
            mark = w.client.mark()
            if command is None:
                w.client.send(dialect.MAVLink_set_mode_message(1, 1, number))
            else:
                assert (await w.client.command(*command)).result == dialect.MAV_RESULT_ACCEPTED, command
            await mode(w, number, since=mark)
            await state(w, ACTIVE, since=mark)
            ack = await other.command(newer.MAV_CMD_DO_SET_STANDARD_MODE, newer.MAV_STANDARD_MODE_MISSION)
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
            assert len(w.commands("common.Mavlink.Start")) == starts
            mark = w.client.mark()
            assert (await other.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
            await state(w, PAUSED, since=mark)
            await mode(w, w.modes.hold, since=mark)


async def test_conf_049_qgroundcontrols_order_the_mode_first_and_then_arm() -> None:
    """SET_MODE while disarmed is shown within 1.3 s; arming begins it, another client's arming does not."""
    async with world(web=True) as w:
        other = await w.connect(254)
        await put(w, ROUND)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_set_mode_message(1, 1, 0x04040000))
        await w.client.heartbeat(lambda beat: beat.custom_mode == 0x04040000, since=mark, timeout=1.3)
        assert (await other.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        assert (await other.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)).result == dialect.MAV_RESULT_ACCEPTED
        assert w.commands("common.Mavlink.Start") == []
        w.client.send(dialect.MAVLink_set_mode_message(1, 1, 0x04040000))
        await mode(w, 0x04040000)
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=1, since=mark)
        assert len(w.commands("common.Mavlink.Start")) == 1


async def test_conf_049_mission_waiting_for_arming_expires() -> None:
    async with world(web=True, speed=1.0) as w:
        await put(w, ROUND)
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)).result == dialect.MAV_RESULT_ACCEPTED
        await mode(w, 0x04040000)
        await w.client.wait("STATUSTEXT", lambda m: "not armed within" in m.text, timeout=12.0)
        await mode(w, w.modes.hold)
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)).result == dialect.MAV_RESULT_ACCEPTED
        assert w.commands("common.Mavlink.Start") == []


async def test_conf_049_start_at_arming_without_loadable_file_leaves_mission() -> None:
    """The drone's web server is not reached: a text says so, and the mode no longer says that a mission is flown."""
    async with world() as w:
        await put(w, ROUND)
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)).result == dialect.MAV_RESULT_ACCEPTED
        await mode(w, 0x04040000)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        await w.client.wait("STATUSTEXT", lambda m: m.severity == dialect.MAV_SEVERITY_ERROR, since=mark, timeout=20.0)
        await mode(w, w.modes.hold, since=mark)
        await state(w, NOT_STARTED)
        assert w.commands("common.Mavlink.Start") == []


async def test_conf_049_start_at_arming_ended_by_disarm_leaves_mission() -> None:
    """The file is on its way to the drone when the client disarms: nothing begins, and no mode says that it does."""
    async with world(web=True) as w:
        await put(w, ROUND)
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)).result == dialect.MAV_RESULT_ACCEPTED
        await mode(w, 0x04040000)
        mark = w.client.mark()
        w.client.send_command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        w.client.send_command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)
        await w.client.heartbeat(
            lambda beat: beat.custom_mode == w.modes.hold and not beat.base_mode & ARMED, since=mark
        )
        await state(w, NOT_STARTED)
        assert w.commands("common.Mavlink.Start") == []


@both
async def test_conf_049_mission_refused_by_the_gateway_names_the_reason(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        number = MISSION_MODE[flavour]
        params = (1, number) if first(w) else (1, 4, 4)
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_MODE, *params)
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        await said(w, "no mission")
        await put(w, [takeoff(8.0), way(30.0, 0.0, 400.0)])
        await w.take_off(5.0)
        mark = w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_MODE, *params)
        assert ack.result == dialect.MAV_RESULT_DENIED
        await said(w, "Item 2 refused: 400.0 m > ceiling", since=mark)
        await put(w, ROUND[:-1])
        w.drone.faults.gps = False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 3, timeout=10.0)
        mark = w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        await said(w, "no GPS fix", since=mark)
        assert flown(w) == [] == reached(w)


async def test_conf_049_mission_with_items_outside_the_fence_is_refused() -> None:
    """Also the straight way to one: nothing is armed, uploaded or flown."""
    async with world(web=True) as w:
        assert (await upload(w.client, square(PLACE, 20.0), FENCE)).type == ACCEPTED
        await put(w, [takeoff(6.0), way(10.0, 0.0, 6.0), way(40.0, 0.0, 6.0)])
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        mark = w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
        assert ack.result == dialect.MAV_RESULT_DENIED
        await said(w, "Item 3 refused: ", since=mark)
        assert w.commands("common.Mavlink.Start") == []


async def test_missing_takeoff_before_height_above_sea_level_is_reported_so_at_upload() -> None:
    there = around(PLACE, (20.0, 0.0))[0]
    async with world(web=True) as w:
        await put(w, [Item(dialect.MAV_CMD_NAV_WAYPOINT, *there, z=55.0, p4=math.nan)])
        await text_said(w.client, "no take-off item: the drone climbs to 55 m AMSL first")


# Stopped, and gone on with.


@both
async def test_conf_074_pause_and_resume_at_the_same_item(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        before, mark = reached(w), w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2, since=mark)
        await mode(w, w.modes.hold, since=mark)
        for _ in range(2):  # nothing goes on by itself
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.hold, since=w.client.mark())
        assert reached(w) == before
        uploads = len(w.commands("common.Mavlink.Start"))
        mark = w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=2, since=mark)
        await mode(w, MISSION_MODE[flavour], since=mark)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2, 3, 4]
        starts = w.commands("common.Mavlink.Start")
        assert len(starts) == uploads + 1
        assert starts[-1].args["filepath"] == starts[0].args["filepath"], "the same file goes on"


@both
async def test_conf_074_paused_flown_elsewhere_and_resumed_by_the_mode(flavour: str) -> None:
    """Hold, a goto, and mode Mission again: the mission goes on at the item that it was at."""
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        assert (await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2)
        x, y = around(PLACE, (5.0, 0.0))[0]
        ack = await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, frame=6, x=x, y=y, z=6.0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await settled(w, (5.0, 0.0, 6.0))
        await state(w, PAUSED, seq=2)
        mark = w.client.mark()
        params = (1, 3) if first(w) else (1, 4, 4)
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, *params)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=2, since=mark)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2, 3, 4]


@both
@pytest.mark.parametrize("order", ["land", "return", "goto"])
async def test_conf_074_mission_is_paused_by_other_flight_commands(flavour: str, order: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["command"] == "waypoint", timeout=20.0)
        mark = w.client.mark()
        if order == "land":
            ack = await w.client.command(dialect.MAV_CMD_NAV_LAND)
        elif order == "return":
            ack = await w.client.command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH)
        else:
            x, y = around(PLACE, (0.0, -15.0))[0]
            ack = await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, frame=6, x=x, y=y, z=6.0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED, ack
        await state(w, PAUSED, since=mark)
        if order == "goto":
            await settled(w, (0.0, -15.0, 6.0))
        elif order == "land":
            await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=40.0)
        else:
            await mode(w, w.modes.returning, since=mark)
        assert set(reached(w)) <= {0, 1}
        await state(w, PAUSED)
        assert len(w.commands("common.Mavlink.Start")) == 1


@both
async def test_conf_074_return_begun_by_the_drone_pauses_the_mission(flavour: str) -> None:
    """The battery sends it home in mid-mission: paused, nothing is sent against it, and the mission does not begin."""
    async with world(flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), way(60.0, 0.0, 6.0), way(60.0, 5.0, 6.0)])
        await start(w)
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["command"] == "waypoint", timeout=20.0)
        mark, before = w.client.mark(), len(w.drone.log)
        return_by_itself(w)
        await mode(w, w.modes.returning, since=mark)
        await state(w, PAUSED, since=mark)
        ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        await said(w, "drone is returning by itself", since=mark)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=w.client.mark())
        sent = {e.name for e in list(w.drone.log)[before:] if e.kind == "command"}
        assert not {name for name in sent if name.rpartition(".")[2] in ("Pause", "Stop", "Start", "Abort", "moveTo")}
        assert set(reached(w)) <= {0}


async def test_conf_074_the_pilot_at_the_skycontroller_takes_over() -> None:
    """His stick pauses the mission, and it does not go on when he lets go."""
    async with world(web=True, skycontroller=3, speed=1.0) as w:
        await put(w, ROUND)
        await start(w)
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["command"] == "waypoint", timeout=20.0)
        pilot = w.drone.skycontroller
        assert pilot is not None
        mark = w.client.mark()
        pilot.stick(1, -50)
        await state(w, PAUSED, since=mark)
        await said(w, "Mission paused", since=mark)
        pilot.stick(1, 0)
        for _ in range(4):  # longer than he keeps the drone after his last touch
            await mode(w, w.modes.idle, since=w.client.mark())
        await state(w, PAUSED)
        assert len(w.commands("common.Mavlink.Start")) == 1


# The current item.


@both
async def test_conf_072_the_current_item(flavour: str) -> None:
    """By message and by command, before the start and in the air; the drone goes there, and leaves out the others."""
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_mission_set_current_message(1, 1, 2 + first(w)))
        await state(w, NOT_STARTED, seq=2, since=mark)
        assert (
            await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 1 + first(w), 0)
        ).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, NOT_STARTED, seq=1)
        for wrong in (len(ROUND) + first(w), 99, math.inf, 1.5, -7):
            assert (
                await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, wrong, 0)
            ).result == dialect.MAV_RESULT_DENIED
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_mission_set_current_message(1, 1, 77))
        await said(w, f"no item {78 - first(w)}", since=mark)
        await start(w)
        await state(w, ACTIVE, seq=1, since=mark)
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["command"] == "waypoint", timeout=20.0)
        mark = w.client.mark()
        assert (
            await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 3 + first(w), 0)
        ).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=3, since=mark)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [3, 4], "what was not flown is not reached"


@both
async def test_conf_072_repeated_set_current_starts_the_file_once(flavour: str) -> None:
    """MAVSDK repeats MISSION_SET_CURRENT every 0.5 s: neither a start under way nor a flown item begins again."""
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 1)
        chosen = dialect.MAVLink_mission_set_current_message(1, 1, 2 + first(w))
        mark, before = w.client.mark(), len(w.commands("common.Mavlink.Start"))
        w.client.send(chosen)
        w.client.send(chosen)  # while the drone pauses the first file
        await state(w, ACTIVE, seq=2, since=mark)
        for _ in range(3):  # while it flies the second one; each is answered before the next regular message
            mark = w.client.mark()
            w.client.send(chosen)
            await state(w, ACTIVE, seq=2, since=mark, timeout=0.2)
        await state(w, COMPLETE, since=mark)
        assert len(w.commands("common.Mavlink.Start")) == before + 1


@pytest.mark.parametrize("flown", [False, True], ids=["ground", "air"])
async def test_conf_072_set_current_to_home_is_answered_with_its_number(flown: bool) -> None:
    """MAVSDK repeats MISSION_SET_CURRENT for each MISSION_CURRENT with another number than the one it has sent."""
    async with world(flavour="ardupilot", web=True) as w:
        speed = Item(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=3.0, p3=-1.0, frame=2)
        await put(w, [speed, *CORNERS])  # the first item is over at once, so that the drone is never seen at it
        if flown:
            await start(w)
            await state(w, ACTIVE, seq=3, since=0)
        again = dialect.MAVLink_mission_set_current_message(1, 1, 0)
        before, answered, place = len(w.commands("common.Mavlink.Start")), 0, w.client.mark() - 1
        w.client.send(again)
        while w.client.received[place := await w.client.place("MISSION_CURRENT", since=place + 1)][1].seq != 0:
            answered += 1
            assert answered < 20
            w.client.send(again)
        mark = w.client.mark()
        w.client.send(again)  # as if it had been on its way
        if not flown:
            await w.client.wait("MISSION_CURRENT", lambda m: m.seq == 1, since=mark)  # the item that it begins with
            return
        await state(w, COMPLETE, since=mark)
        assert len(w.commands("common.Mavlink.Start")) == before + 1


@both
async def test_conf_072_a_reset_in_flight_keeps_the_item(flavour: str) -> None:
    """param1 -1, param2 1: a mission without loops is flown on as it is, and begins again only after its end."""
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        mark = w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, -1, 1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await state(w, COMPLETE, since=mark)
        assert {m.seq - first(w) for _, m in w.client.since(mark, "MISSION_CURRENT")} <= {2, 3, 4}
        assert reached(w) == [0, 1, 2, 3, 4]
        assert len(w.commands("common.Mavlink.Start")) == 1
        other, mark = await w.connect(254), w.client.mark()
        ack = await other.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, -1, 1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await state(w, NOT_STARTED, seq=0, since=mark)


@both
@pytest.mark.parametrize("paused", [False, True])
async def test_conf_072_reset_restores_loop_count_at_the_same_item(flavour: str, paused: bool) -> None:
    """Between the two ways of the second turn: the drone flies on to the second one, and then a third turn."""
    async with world(flavour=flavour, web=True) as w:
        jump = Item(dialect.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=1.0 + first(w), p2=1.0, frame=2)
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), way(9.0, 9.0, 6.0), jump, way(0.0, 9.0, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        mark = w.client.mark()
        await state(w, ACTIVE, seq=1, since=mark)
        mark = w.client.mark()
        await state(w, ACTIVE, seq=2, since=mark)
        if paused:
            ack = await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, -1, 1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        if paused:
            await state(w, PAUSED, seq=2)
            ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2, 3, 1, 2, 3, 1, 2, 3, 4]
        assert flown(w).count("takeoff") == 1


async def test_conf_072_ai_resumes_inside_its_stored_file() -> None:
    async with world(web=True, model="ai") as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0), way(12.0, 12.0, 6.0), way(0.0, 12.0, 6.0)])
        await start(w)
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["command"] == "waypoint", timeout=20.0)
        mark = w.client.mark()
        assert (
            await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 3, 0)
        ).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=3, since=mark)
        await state(w, COMPLETE, since=mark)
        before, again = w.commands("flight_plan.start_at_v2")
        assert before.args["flightplan_id"] == again.args["flightplan_id"]
        assert (before.args["item"], again.args["item"]) == (0, 4), "lines: the take-off has two"
        assert reached(w)[-1] == 3
        assert 2 not in reached(w)


# Items that are orders.


async def order(client: Client, current: int, x: float, y: float, z: float, *, frame: int = 3, as_int: bool) -> Any:
    """A mission item that belongs to no mission; its MISSION_ACK."""
    mark = client.mark()
    fields = (1, 1, 0, frame, 16, current, 1, 0.0, 0.0, 0.0, 0.0)
    if as_int:
        client.send(dialect.MAVLink_mission_item_int_message(*fields, round(x * 1e7), round(y * 1e7), z, MISSION))
    else:
        client.send(dialect.MAVLink_mission_item_message(*fields, x, y, z, MISSION))
    return await client.wait("MISSION_ACK", since=mark)


@both
@pytest.mark.parametrize("as_int", [False, True])
async def test_conf_141_guided_items_move_the_drone_without_changing_the_plan(flavour: str, as_int: bool) -> None:
    """current 2 goes to a place (dronekit's simple_goto), 3 changes the height (MAVProxy's); the plan is untouched."""
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        place = around(PLACE, (20.0, -10.0))[0]
        ack = await order(w.client, 2, *place, 8.0, as_int=as_int)
        assert (ack.type, ack.target_system, ack.target_component) == (ACCEPTED, 255, 190)
        await settled(w, (20.0, -10.0, 8.0))
        assert (await order(w.client, 3, 0.0, 0.0, 12.0, as_int=as_int)).type == ACCEPTED
        await settled(w, (20.0, -10.0, 12.0))
        assert (await order(w.client, 2, *place, 8.0, frame=10, as_int=as_int)).type == UNSUPPORTED_FRAME
        current = await w.client.wait("MISSION_CURRENT")
        assert current.seq == 0


@pytest.mark.parametrize("current", [2, 3])
@pytest.mark.parametrize("number", [17, 5], ids=["brake", "loiter"])
async def test_conf_141_outside_guided_an_item_moves_nothing(number: int, current: int) -> None:
    """ArduCopter flies them in Guided only: neither a drone that is held nor one that a stick may fly goes anywhere."""
    async with world(flavour="ardupilot") as w:
        await w.take_off(5.0)
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, number)).result == dialect.MAV_RESULT_ACCEPTED
        mark = w.client.mark()
        place = around(PLACE, (20.0, -10.0))[0]
        assert (await order(w.client, current, *place, 8.0, as_int=True)).type == dialect.MAV_MISSION_DENIED
        await said(w, "not in Guided", since=mark)
        await mode(w, number, since=w.client.mark())
        assert [e for e in w.drone.log if e.kind == "command" and e.name.endswith("Piloting.moveTo")] == []
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4)).result == dialect.MAV_RESULT_ACCEPTED
        assert (await order(w.client, current, *place, 8.0, as_int=True)).type == ACCEPTED


@both
async def test_conf_141_height_sent_as_command_and_item_moves_once(flavour: str) -> None:
    """MAVProxy's changealt says both at once. Both are answered by the one move that the drone is asked for."""
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        height = dialect.MAV_CMD_DO_CHANGE_ALTITUDE
        w.client.send_command(height, 12.0, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT)
        assert (await order(w.client, 3, 0.0, 0.0, 12.0, as_int=False)).type == ACCEPTED
        ack = await w.client.wait("COMMAND_ACK", lambda ack: ack.command == height, since=mark)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await settled(w, (0.0, 0.0, 12.0))
        assert len([e for e in w.drone.log if e.kind == "command" and e.name.endswith("Piloting.moveTo")]) == 1


@both
async def test_conf_141_a_height_behind_a_landing_is_refused(flavour: str) -> None:
    """The same height again, behind a landing that has replaced the first one: no goto ends a landing."""
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        height, frame = dialect.MAV_CMD_DO_CHANGE_ALTITUDE, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
        w.client.send_command(height, 12.0, frame)
        w.client.send_command(dialect.MAV_CMD_NAV_LAND)
        assert (await order(w.client, 3, 0.0, 0.0, 12.0, as_int=False)).type == dialect.MAV_MISSION_DENIED
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=40.0)
        acks = {ack.command: ack.result for _, ack in w.client.since(mark, "COMMAND_ACK")}
        assert acks == {height: newer.MAV_RESULT_CANCELLED, dialect.MAV_CMD_NAV_LAND: dialect.MAV_RESULT_ACCEPTED}
        sent = [e.name.rpartition(".")[2] for e in w.drone.log if e.kind == "command"]
        assert "moveTo" not in sent[sent.index("Landing") :]  # one of the command may have left before


@both
async def test_conf_141_height_refused_by_drone_rejects_command_and_item(flavour: str) -> None:
    """What the first order was refused for, the second is refused for as well, after the drone was asked again."""
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        w.drone.faults.unreported = frozenset({ardrone3.MaxAltitudeChanged.NAME})  # else the gateway refuses it itself
        w.drone.firmware.receive(ardrone3.MaxAltitude(10.0), asyncio.get_running_loop().time())
        height = dialect.MAV_CMD_DO_CHANGE_ALTITUDE
        w.client.send_command(height, 12.0, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT)
        assert (await order(w.client, 3, 0.0, 0.0, 12.0, as_int=False)).type != ACCEPTED
        ack = await w.client.wait("COMMAND_ACK", lambda ack: ack.command == height, since=mark)
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        asked = [e.args for e in w.drone.log if e.kind == "command" and e.name.endswith("Piloting.moveTo")]
        assert [round(args["altitude"], 1) for args in asked] == [12.0, 12.0]

"""QGroundControl's pages and its window: what its sources ask for and act on, played as messages.

The names are in `support/qgroundcontrol.json`, page by page.
"""

from __future__ import annotations

import itertools
import json
import math
import struct
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.ftp import Ftp
from support.mav import Client, kind_of
from support.missions import ACTIVE, COMPLETE, MISSION_MODE, ROUND, first, mode, put, said, start, state, takeoff, way
from support.params import fetch, read, send_set, value_of
from support.world import ARMED, HOLD, HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.mavlink import dialect as newer

PAGES: list[dict[str, Any]] = json.loads((Path(__file__).parents[1] / "support" / "qgroundcontrol.json").read_text())[
    "pages"
]


def pages_of(flavour: str) -> list[dict[str, Any]]:
    return [page for page in PAGES if page["flavour"] == flavour]


async def open_page(client: Client, page: dict[str, Any], flavour: str) -> dict[str, float]:
    """Request each name of a page as its refresh does, and return the answers. PARAM_ERROR fails."""
    mark = client.mark()
    names = page["names"]
    for name in names:
        client.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    values = {}
    for name in names:
        value = await client.wait("PARAM_VALUE", lambda m, name=name: m.param_id == name, since=mark)
        values[name] = value_of(value, flavour)
    assert not client.since(mark, "PARAM_ERROR"), page["page"]
    return values


@pytest.mark.parametrize(
    ("flavour", "model"), [("px4", "4k"), ("px4", "ai"), ("ardupilot", "4k"), ("ardupilot", "usa")]
)
async def test_conf_052_each_page_of_qgroundcontrol_is_answered(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model) as w:
        listed = await fetch(w.client, flavour)
        for page in pages_of(flavour):
            missing = set(page["names"]) - listed.keys()
            assert not missing, (page["page"], page["source"])
            values = await open_page(w.client, page, flavour)
            assert all(math.isfinite(value) for value in values.values()), (page["page"], values)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_no_parameter_is_nan(flavour: str) -> None:
    """Neither in PARAM_VALUE nor in the packed file; -1 stands for what is not known."""
    async with world(flavour=flavour) as w:
        values = {name: value_of(message, flavour) for name, message in (await fetch(w.client, flavour)).items()}
        assert all(math.isfinite(value) for value in values.values())
        if flavour == "px4":
            assert values["BAT_LOW_THR"] == values["MPC_LAND_SPEED"] == -1
        else:
            assert values["INS_ACCOFFS_X"] == values["COMPASS_OFS_X"] == -1
            packed = await Ftp(w.client).download("/@PARAM/param.pck")
            assert struct.pack("<f", math.nan) not in packed


@pytest.mark.parametrize(("model", "cells"), [("4k", 2), ("usa", 3)])
async def test_battery_page_shows_the_cells_of_the_model(model: str, cells: int) -> None:
    async with world(model=model) as w:
        assert value_of(await read(w.client, "BAT1_N_CELLS")) == cells
        assert value_of(await read(w.client, "BAT1_SOURCE")) == 1


async def test_ardupilot_compass_is_first_by_priority() -> None:
    """Otherwise QGroundControl's summary calls it unused (APMSensorsComponentSummary.qml)."""
    async with world(flavour="ardupilot") as w:
        first = await read(w.client, "COMPASS_PRIO1_ID")
        assert first.param_value == (await read(w.client, "COMPASS_DEV_ID")).param_value != 0


async def test_obstacle_avoidance_is_off_on_models_without_it() -> None:
    async with world() as w:
        assert value_of(await read(w.client, "COM_OBS_AVOID")) == 0


async def test_unknown_name_is_answered_by_param_error_alone() -> None:
    async with world() as w:
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_request_read_message(1, 1, b"CAL_MAG7_ROT", -1))
        error = await w.client.wait("PARAM_ERROR", since=mark)
        assert (error.param_id, error.error) == ("CAL_MAG7_ROT", 1)
        await w.client.wait("HEARTBEAT", timeout=3.0)
        assert not [m for _, m in w.client.since(mark, "PARAM_VALUE") if m.param_id == "CAL_MAG7_ROT"]


async def test_compass_calibration_turns_three_of_qgroundcontrols_pictures() -> None:
    """SensorsComponentController::_handleUASTextMessage: CAL_MAG_SIDES says which pictures there are, each turns from
    its "orientation detected" to its "side done"."""
    nose, left, down = 1 << 1, 1 << 2, 1 << 5
    async with world() as w:
        assert value_of(await read(w.client, "CAL_MAG_SIDES")) == nose | left | down
        mark = w.client.mark()
        calibrate = dialect.MAV_CMD_PREFLIGHT_CALIBRATION
        ack = await w.client.command(calibrate, 0, 1, 0, 0, x=0.0, y=0.0, z=0.0, timeout=20.0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        done = "[cal] calibration done: mag"
        await w.client.wait("STATUSTEXT", lambda m: m.text == done, since=mark, timeout=20.0)
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        sides = [
            text for text in said if text.endswith(("orientation detected", "side done, rotate to a different side"))
        ]
        assert sides == [
            f"[cal] {side} {what}"
            for side in ("front", "left", "down")
            for what in ("orientation detected", "side done, rotate to a different side")
        ]
        assert said[-1] == done


class Toolbar:
    """What QGroundControl's toolbar makes of events: HealthAndArmingCheckReport, over the groups of events.json."""

    def __init__(self, document: dict[str, Any]) -> None:
        (component,) = document["components"].values()
        groups = component["navigation_mode_groups"]["groups"]
        self.group = {mode: int(number) for number, modes in groups.items() for mode in modes}
        self.summary = next(
            1 << 24 | int(number)
            for number, event in component["event_groups"]["arming_check"]["events"].items()
            if event["name"] == "arming_check_summary"
        )

    def can_arm(self, event: Any, mode: int) -> bool:
        """libevents Results::canArm: is the group of the mode among those that can be armed?"""
        can_arm: int = struct.unpack_from("<BIIII", bytes(event.arguments))[3]
        return bool(can_arm >> self.group[mode] & 1)


async def test_toolbar_is_not_red_in_an_orbit() -> None:
    """Red is an armed vehicle in a mode whose group cannot be armed (MainStatusIndicator.qml)."""
    orbit = 0x01030000
    async with world() as w:
        toolbar = Toolbar(json.loads(await Ftp(w.client).download("/events.json")))
        mark = w.client.mark()
        await w.take_off(8.0)
        place = geo.destination(*HOME[:2], 0.0, 15.0)
        height = HOME[2] + 8.0
        ack = await w.client.command(dialect.MAV_CMD_DO_ORBIT, 10, 3, 0, 0, frame=0, x=place[0], y=place[1], z=height)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == orbit, since=mark)
        again = w.client.mark()
        w.drone.inject(ardrone3.AlertStateChanged(ardrone3.AlertState.NONE))  # a report is made once more
        await w.client.heartbeat(lambda beat: True, since=again)
        reports = [m for _, m in w.client.since(0, "EVENT") if m.id == toolbar.summary]
        assert reports
        assert all(toolbar.can_arm(event, mode) for event in reports for mode in (orbit, HOLD))


def position_of(w: World, mark: int, kind: str, true: Any) -> int:
    """The place of the first such message among all that arrived."""
    return next(
        index
        for index, (_, message) in enumerate(w.client.received[mark:])
        if kind_of(message) == kind and true(message)
    )


async def test_landing_is_reported_before_disarming() -> None:
    """Vehicle::_setLanding believes an armed vehicle only."""
    async with world() as w:
        await w.take_off(3.0)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == dialect.MAV_RESULT_ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=20.0)
        await w.client.wait("EVENT", lambda m: m.id == 1 << 24 | 101, since=mark)
        ground = position_of(w, mark, "EXTENDED_SYS_STATE", lambda m: m.landed_state == 1)
        landed = position_of(w, mark, "EVENT", lambda m: m.id == 1 << 24 | 103)
        disarmed = position_of(w, mark, "HEARTBEAT", lambda m: not m.base_mode & ARMED)
        event = position_of(w, mark, "EVENT", lambda m: m.id == 1 << 24 | 101)
        assert max(ground, landed) < disarmed < event


def resume_index(messages: list[Any], mode: int, items: int, home: int) -> int:
    """The item that QGroundControl offers to resume at: MissionManager::_updateMissionIndex and _handleHeartbeat,
    MissionController::resumeMissionIndex.

    `home` is 1 when the list on the vehicle begins with home. 0: nothing is offered.
    """
    cached, last = -1, -1
    for message in messages:
        if message.get_type() == "MISSION_CURRENT":
            if message.seq not in (last, cached):
                cached = message.seq
        elif kind_of(message) == "HEARTBEAT" and cached != -1 and message.custom_mode == mode:
            cached, last = -1, cached
    index = last + (0 if home else 1)
    return index - 1 if index > 1 and index != items else 0


@both
async def test_complete_mission_is_not_offered_for_resuming(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        mark = w.client.mark()
        await start(w)
        await state(w, COMPLETE, since=mark)
        await mode(w, w.modes.returning, since=mark)
        messages = [message for _, message in w.client.received[mark:]]
        assert resume_index(messages, MISSION_MODE[flavour], len(ROUND), first(w)) == 0
        # One change of mode, from Mission to Return, and not by way of Hold.
        modes = [message.custom_mode for message in messages if kind_of(message) == "HEARTBEAT"]
        begun = modes.index(MISSION_MODE[flavour])
        assert [number for number, _ in itertools.groupby(modes[begun:])] == [MISSION_MODE[flavour], w.modes.returning]


@both
async def test_mission_current_leaves_once_per_change(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        stop = dialect.MAV_CMD_SET_MESSAGE_INTERVAL  # what is left are the changes
        ack = await w.client.command(stop, dialect.MAVLINK_MSG_ID_MISSION_CURRENT, -1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await put(w, ROUND)
        mark = w.client.mark()
        await start(w)
        await state(w, COMPLETE, since=mark)
        await mode(w, w.modes.returning, since=mark)
        sent = [bytes(m.get_payload()) for _, m in w.client.since(mark, "MISSION_CURRENT")]
        assert len(sent) == len(list(itertools.groupby(sent)))
        # To ask for the item that is the current one already is answered all the same.
        mark = w.client.mark()
        current = len(ROUND) - 1 + first(w)
        w.client.send(dialect.MAVLink_mission_set_current_message(1, 1, current))
        await w.client.wait("MISSION_CURRENT", lambda m: m.seq == current, since=mark)


@both
async def test_mission_current_without_mission_ignores_mode_changes(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        stop = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
        ack = await w.client.command(stop, dialect.MAVLINK_MSG_ID_MISSION_CURRENT, -1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        mark = w.client.mark()
        await w.take_off()
        assert w.client.since(mark, "MISSION_CURRENT") == []


async def test_item_numbers_in_texts_are_those_of_the_map() -> None:
    """The first item is 1, for home is 0 on QGroundControl's map of either family."""
    for flavour in ("px4", "ardupilot"):
        async with world(flavour=flavour, web=True) as w:
            mark = w.client.mark()
            await put(w, ROUND)
            await start(w)
            await said(w, "Mission starts: item 1", since=mark)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_repeated_messages_carry_the_time_of_sending(flavour: str) -> None:
    """MAVProxy takes a time that lags 5 s behind the newest one for a restart of the autopilot."""
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        stamps: dict[str, list[float]] = {}
        newest = 0.0
        while newest < 8.0:
            await w.client.wait("SYSTEM_TIME", timeout=3.0)
            stamps.clear()
            newest = 0.0
            for _, message in w.client.received[mark:]:
                at = getattr(message, "time_boot_ms", None)
                at = at / 1e3 if at is not None else getattr(message, "time_usec", 0) / 1e6
                if 0.0 < at < 1e6:  # not a time of day
                    stamps.setdefault(message.get_type(), []).append(at)
                    newest = max(newest, at)
                    assert at > newest - 1.0, message
        repeated = {"RC_CHANNELS", "HOME_POSITION"} if flavour == "px4" else {"RC_CHANNELS"}
        assert repeated <= stamps.keys()
        for kind, times in stamps.items():
            assert times == sorted(times), kind


async def test_refused_write_of_a_parameter_gets_a_text() -> None:
    async with world(clients=2) as w:
        mark, other = w.client.mark(), w.clients[1].mark()
        send_set(w.client, "COM_RC_LOSS_T", 3.0, 9)
        await w.client.wait("PARAM_ERROR", since=mark)
        text = await w.client.wait("STATUSTEXT", since=mark)
        assert text.text == "COM_RC_LOSS_T not set: read only"
        assert value_of(await read(w.client, "COM_RC_LOSS_T")) == pytest.approx(0.45)
        # A program that loads a whole file is not answered with a page of texts, nor is any other client.
        mark = w.client.mark()
        for name in ("SYS_AUTOSTART", "CAL_MAG_SIDES", "SDLOG_MODE", "BAT1_SOURCE", "BAT1_N_CELLS"):
            send_set(w.client, name, 7, 6)
        await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "BAT1_N_CELLS", since=mark)
        assert len(w.client.since(mark, "STATUSTEXT")) <= 1
        assert not w.clients[1].since(other, "STATUSTEXT")


async def test_critical_battery_is_one_line_of_the_arming_report() -> None:
    """A drone reports it as a check, as an alert of its battery and as an alert of its own."""
    async with world() as w:
        document = json.loads(await Ftp(w.client).download("/events.json"))
        (component,) = document["components"].values()
        checks = {
            1 << 24 | int(number): event["name"]
            for number, event in component["event_groups"]["arming_check"]["events"].items()
            if event.get("type") != "summary"
        }
        mark = w.client.mark()
        w.drone.faults.battery = 8
        await said(w, "Battery critical (8 %)", since=mark)
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & 0x10000000, since=mark)
        await w.client.wait("HEARTBEAT")
        await w.client.wait("HEARTBEAT")
        mark = w.client.mark()
        assert (await w.client.command(newer.MAV_CMD_RUN_PREARM_CHECKS)).result == dialect.MAV_RESULT_ACCEPTED
        await w.client.wait("HEARTBEAT")
        named = [checks[m.id] for _, m in w.client.since(mark, "EVENT") if m.id in checks]
        assert len(named) == 1
        texts = [m.text for _, m in w.client.since(mark, "STATUSTEXT") if m.text.startswith("PreArm")]
        assert len(texts) == 1


async def test_battery_return_in_a_mission_changes_mode_once() -> None:
    """The drone stops its plan and then begins to return; QGroundControl announces each heartbeat's mode."""
    async with world(web=True, speed=4.0) as w:
        await put(w, [takeoff(8.0), way(60.0, 0.0, 8.0), way(200.0, 0.0, 8.0)])
        mark = w.client.mark()
        await start(w)
        await state(w, ACTIVE, seq=2, since=mark)
        w.drone.faults.battery = 12
        await mode(w, w.modes.returning, since=mark)
        modes = [m.custom_mode for _, m in w.client.since(mark, "HEARTBEAT")]
        begun = modes.index(MISSION_MODE["px4"])
        assert [number for number, _ in itertools.groupby(modes[begun:])] == [MISSION_MODE["px4"], w.modes.returning]


async def test_paused_mission_shows_hold() -> None:
    """Heartbeats say Mission for a quarter of a second more, and not longer."""
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(100.0, 0.0, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        mark = w.client.mark()
        pause = dialect.MAV_CMD_DO_REPOSITION
        assert (await w.client.command(pause, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark, timeout=1.3)

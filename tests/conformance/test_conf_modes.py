"""Modes in both flavours, by every way that a client uses: conformance items 27, 28, 56-60, ArduCopter's numbers."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.world import HOLD, LAND, POSITION, RETURN, World, world

from anafi_mav.arsdk.messages import rth
from anafi_mav.mavlink import dialect as newer

FLAVOURS = ("px4", "ardupilot")

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
DENIED = dialect.MAV_RESULT_DENIED
SET_MODE = dialect.MAV_CMD_DO_SET_MODE
REQUEST = dialect.MAV_CMD_REQUEST_MESSAGE
AVAILABLE_MODES, CURRENT_MODE, MONITOR = 435, 436, 437

COPTER = {"auto": 3, "guided": 4, "loiter": 5, "rtl": 6, "land": 9, "brake": 17}
"""ArduCopter's numbers (conformance A4)."""


@pytest.mark.parametrize(
    ("name", "parameters"),
    [(name, (1, number, 0)) for name, number in COPTER.items() if name not in ("auto", "guided")]
    + [("guided", (1, 4, math.nan)), ("brake", (1, HOLD, 0))],  # Mission Planner puts PX4's packed number into param2
)
async def test_conf_027_copter_modes_by_command(name: str, parameters: tuple[float, ...]) -> None:
    async with world(flavour="ardupilot") as w:
        await w.take_off()
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, *parameters)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == COPTER[name], since=mark, timeout=1.3)


@pytest.mark.parametrize(("flavour", "number"), [("px4", LAND), ("ardupilot", COPTER["land"])])
async def test_conf_027_land_by_the_message(flavour: str, number: int) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_set_mode_message(1, 1, number))
        await w.client.heartbeat(lambda beat: beat.custom_mode == number, since=mark, timeout=1.3)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


@pytest.mark.parametrize("number", [0, 1, 2, 7])  # STABILIZE, ACRO, ALT_HOLD, CIRCLE
async def test_conf_028_unsupported_mode_is_refused(number: int) -> None:
    async with world(flavour="ardupilot") as w:
        before = (await w.client.heartbeat(lambda beat: True)).custom_mode
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, 1, number)).result == DENIED
        await w.client.wait("STATUSTEXT", lambda m: "not a mode" in m.text, since=mark)
        assert (await w.client.heartbeat(lambda beat: True)).custom_mode == before


async def modes(w: World, index: float) -> list[Any]:
    mark = w.client.mark()
    assert (await w.client.command(REQUEST, AVAILABLE_MODES, index)).result == ACCEPTED
    first = await w.client.wait("AVAILABLE_MODES", since=mark)
    if index not in (0, 0.0) and not math.isnan(index):
        return [first]
    await w.client.wait("AVAILABLE_MODES", lambda m: m.mode_index == m.number_modes, since=mark)
    return [m for _, m in w.client.since(mark, "AVAILABLE_MODES")]


async def selectable(w: World) -> set[str]:
    hidden = newer.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE
    return {m.mode_name for m in await modes(w, 0) if not m.properties & hidden}


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_056_available_modes(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        every = await modes(w, 0)
        count = len(every)
        assert [m.mode_index for m in every] == list(range(1, count + 1))
        assert {m.number_modes for m in every} == {count}
        assert len({m.custom_mode for m in every}) == len({m.mode_name for m in every}) == count
        assert [m.mode_name for m in await modes(w, math.nan)] == [m.mode_name for m in every]
        assert (await modes(w, 2))[0].mode_name == every[1].mode_name
        by_name = {m.mode_name: m for m in every}
        land, back = ("Land", "Return") if flavour == "px4" else ("Land", "RTL")
        assert by_name[land].custom_mode == (LAND if flavour == "px4" else 9)
        assert by_name[land].standard_mode == dialect.MAV_STANDARD_MODE_LAND
        assert by_name[back].standard_mode == dialect.MAV_STANDARD_MODE_SAFE_RECOVERY
        for index in (count + 1, -1, 1.5):
            assert (await w.client.command(REQUEST, AVAILABLE_MODES, index)).result == DENIED


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_057_current_mode(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        hold = POSITION if flavour == "px4" else COPTER["loiter"]
        mark = w.client.mark()
        parameters = (1, 3, 0) if flavour == "px4" else (1, hold)
        assert (await w.client.command(SET_MODE, *parameters)).result == ACCEPTED
        observed = await w.client.wait("CURRENT_MODE", lambda m: m.custom_mode == hold, since=mark, timeout=1.0)
        assert observed.standard_mode == dialect.MAV_STANDARD_MODE_POSITION_HOLD
        assert observed.intended_custom_mode == hold
        beat = await w.client.heartbeat(lambda beat: True)
        assert beat.custom_mode == hold
        # It is announced once, and repeated rarely: stations that do not know it count each as lost.
        mark = w.client.mark()
        first = await w.client.wait("CURRENT_MODE", timeout=5.5)
        second = await w.client.wait("CURRENT_MODE", timeout=5.5)
        assert len(w.client.since(mark, "CURRENT_MODE")) == 2
        assert first.custom_mode == second.custom_mode == hold


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_057_intended_mode_is_another_only_while_the_drone_acts_by_itself(flavour: str) -> None:
    """QGroundControl and MAVSDK judge by the intended mode whether the drone is ready: one of long ago is not."""
    position, hold, land, back = (
        (POSITION, HOLD, LAND, RETURN)
        if flavour == "px4"
        else (COPTER["loiter"], COPTER["brake"], COPTER["land"], COPTER["rtl"])
    )
    async with world(flavour=flavour, speed=4.0) as w:

        async def reports(mode: int, intended: int) -> None:
            await w.client.wait("CURRENT_MODE", lambda m: (m.custom_mode, m.intended_custom_mode) == (mode, intended))

        await w.take_off()
        parameters = (1, 3, 0) if flavour == "px4" else (1, position)
        assert (await w.client.command(SET_MODE, *parameters)).result == ACCEPTED
        w.drone.inject(rth.State(rth.RthState.IN_PROGRESS, rth.StateReason.LOW_BATTERY))
        await reports(back, position)
        w.drone.inject(rth.State(rth.RthState.AVAILABLE, rth.StateReason.STOPPED))
        await reports(hold, hold)
        w.drone.inject(rth.EndingBehavior(rth.RthEndingBehavior.LANDING))
        w.drone.inject(rth.State(rth.RthState.IN_PROGRESS, rth.StateReason.LOW_BATTERY))
        await reports(back, hold)
        mark = w.client.mark()
        w.drone.inject(rth.State(rth.RthState.AVAILABLE, rth.StateReason.FINISHED))
        await reports(hold, hold)  # no landing follows
        assert {m.intended_custom_mode for _, m in w.client.since(mark, "CURRENT_MODE")} == {hold}
        w.client.send_command(dialect.MAV_CMD_NAV_LAND)
        await reports(land, land)
        await reports(hold, hold)
        assert w.drone.flying_state.name == "LANDED"


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_058_modes_monitor_counts_changes_of_the_list(flavour: str) -> None:
    stop, home = ("Hold", "Return") if flavour == "px4" else ("Brake", "RTL")
    async with world(flavour=flavour) as w:
        selectable = {
            m.mode_name: m.properties & newer.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE for m in await modes(w, 0)
        }
        assert selectable["Follow"] == 0
        before = await w.client.wait("AVAILABLE_MODES_MONITOR", since=0)
        mark = w.client.mark()
        w.drone.faults.gps = False
        after = await w.client.wait("AVAILABLE_MODES_MONITOR", lambda m: m.seq != before.seq, since=mark)
        assert after.seq == (before.seq + 1) % 256
        selectable = {
            m.mode_name: m.properties & newer.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE for m in await modes(w, 0)
        }
        assert selectable["Follow"] != 0
        assert selectable[stop] == selectable[home] == 0


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_059_standard_modes(flavour: str) -> None:
    standard = dialect.MAV_CMD_DO_SET_STANDARD_MODE
    async with world(flavour=flavour) as w:
        for unknown in (0, 2, 99, 1.5, math.nan):  # 2: an orbit has to be described
            assert (await w.client.command(standard, unknown)).result == DENIED
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        assert (await w.client.command(standard, dialect.MAV_STANDARD_MODE_TAKEOFF)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 2.2, 20.0)
        returning, landing = (RETURN, LAND) if flavour == "px4" else (6, 9)
        assert (await w.client.command(standard, dialect.MAV_STANDARD_MODE_SAFE_RECOVERY)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == returning)
        assert (await w.client.command(standard, dialect.MAV_STANDARD_MODE_LAND)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == landing)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_060_protocol_version(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        assert (await w.client.command(REQUEST, 300)).result == ACCEPTED
        version = await w.client.wait("PROTOCOL_VERSION", since=mark)
        assert (version.min_version, version.max_version) == (100, 200)


async def test_conf_001_the_copters_heartbeat() -> None:
    async with world(flavour="ardupilot") as w:
        beat = await w.client.heartbeat(lambda beat: True)
        assert (beat.type, beat.autopilot) == (dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA)
        assert beat.base_mode & dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        assert beat.custom_mode == COPTER["brake"]

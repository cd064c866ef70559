"""Items 42-45 and 52-55 of the conformance list: parameters, in both flavours. What a write did is read off the
simulator's own log."""

from __future__ import annotations

import asyncio
import contextlib
import json
import lzma
import os
import struct
import time
import zlib
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.ftp import Ftp
from support.lines import SerialClient, pseudo_terminal
from support.mav import Client
from support.params import fetch, read, send_set, value_of, write
from support.world import HOLD, HOME, LAND, RETURN, World, loopback, world

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.services.parameter.parameter_service import NATIVE_NAMES
from anafi_mav.sim import DroneSpec, Simulator

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
DOES_NOT_EXIST, OUT_OF_RANGE, READ_ONLY, TYPE_MISMATCH = 1, 2, 5, 7


def words(text: str) -> list[str]:
    return text.split()


# conformance A5: absent, QGroundControl complains or demands a setup
A5_PX4 = words(
    """
    SYS_AUTOSTART CAL_GYRO0_ID CAL_ACC0_ID CAL_MAG0_ID CAL_MAG1_ID CAL_MAG2_ID COM_RC_IN_MODE
    COM_LOW_BAT_ACT BAT_LOW_THR BAT_CRIT_THR BAT_EMERGEN_THR RTL_RETURN_ALT RTL_DESCEND_ALT RTL_LAND_DELAY GF_ACTION
    GF_MAX_HOR_DIST GF_MAX_VER_DIST NAV_DLL_ACT COM_DL_LOSS_T COM_RC_LOSS_T NAV_RCL_ACT MAV_SYS_ID
    RC_MAP_ROLL RC_MAP_PITCH RC_MAP_YAW RC_MAP_THROTTLE RC_MAP_FLTMODE COM_FLTMODE1 COM_FLTMODE2 COM_FLTMODE3
    COM_FLTMODE4 COM_FLTMODE5 COM_FLTMODE6 RC_MAP_FLAPS RC_MAP_AUX1 RC_MAP_AUX2
    CP_DIST MPC_LAND_SPEED COM_DISARM_LAND
    MIS_TAKEOFF_ALT MPC_XY_VEL_MAX MPC_XY_CRUISE SYS_HITL MPC_Z_VEL_MAX_UP MPC_Z_VEL_MAX_DN MPC_MAN_Y_MAX
    MPC_TILTMAX_AIR LND_FLIGHT_T_HI LND_FLIGHT_T_LO SYS_HAS_MAG SYS_HAS_BARO
    """
)

# QGroundControl's APM setup components and Mission Planner's initial setup look for these.
WANTED_ARDUPILOT = words(
    """
    FRAME_CLASS FRAME_TYPE ARMING_CHECK RCMAP_ROLL RCMAP_PITCH RCMAP_THROTTLE RCMAP_YAW RC1_MIN RC1_MAX RC1_TRIM RC4_MIN
    COMPASS_DEV_ID COMPASS_USE COMPASS_OFS_X COMPASS_OFS2_Y COMPASS_OFS3_Z INS_ACCOFFS_X BATT_MONITOR BATT_CAPACITY
    FS_THR_ENABLE FS_THR_VALUE FS_GCS_ENABLE FENCE_ENABLE FENCE_TYPE FENCE_ACTION FENCE_ALT_MAX FENCE_RADIUS
    FENCE_MARGIN RTL_ALT RTL_ALT_FINAL RTL_LOIT_TIME LAND_SPEED WPNAV_SPEED ANGLE_MAX PILOT_SPEED_UP PILOT_SPEED_DN
    FLTMODE1 FLTMODE6 FLTMODE_CH SIMPLE SUPER_SIMPLE SYSID_THISMAV
    """
)

NATIVE = words(
    """
    ANF_MAX_TILT ANF_TILT_RATE ANF_YAW_RATE ANF_VERT_SPEED ANF_MAX_ALT ANF_MAX_DIST ANF_GEOFENCE ANF_BANKED_TURN
    ANF_RTH_ALT ANF_RTH_END_ALT ANF_RTH_END ANF_RTH_DELAY ANF_RTH_AUTO ANF_RTH_PRECISE ANF_HOME_TYPE ANF_GMB_SPEED
    ANF_MIS_RTH ANF_TKOFF_ALT ANF_HAND_LAUNCH ANF_CRUISE_SPEED ANF_GCS_LOSS ANF_GCS_LOSS_T ANF_MODEL
    """
)


@both
async def test_conf_042_parameter_list(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark, began = w.client.mark(), time.monotonic()
        await fetch(w.client)
        assert time.monotonic() - began < 1.0
        values = [m for _, m in w.client.since(mark, "PARAM_VALUE") if m.param_id != "_HASH_CHECK"]
        count = len(values)
        assert [m.param_index for m in values] == list(range(count))
        assert {m.param_count for m in values} == {count}
        assert len({m.param_id for m in values}) == count
        assert {m.get_srcComponent() for m in values} == {1}
        assert {m.param_id for m in values} >= {*NATIVE, *(A5_PX4 if flavour == "px4" else WANTED_ARDUPILOT)}
        # Settings of a later generation, and what only the Ai has, are nothing that a 4K would show.
        assert not {m.param_id for m in values} & {"ANF_HORI_SPEED", "ANF_OBS_AVOID"}


@both
async def test_conf_042_the_list_is_the_same_after_a_reconnect(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        before = await fetch(w.client)
        mark = w.client.mark()
        assert w.drone.session is not None
        await w.drone.session.close()
        await w.client.wait("STATUSTEXT", lambda m: "ANAFI" in m.text, since=mark, timeout=20.0)
        after = await fetch(w.client)
        assert [(m.param_id, m.param_index, m.param_count) for m in after.values()] == [
            (m.param_id, m.param_index, m.param_count) for m in before.values()
        ]


@both
async def test_conf_043_parameter_read(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        by_name = await read(w.client, "ANF_RTH_ALT")
        assert by_name.param_value == 20.0  # the firmware's default
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_request_read_message(1, 1, b"", by_name.param_index))
        assert (await w.client.wait("PARAM_VALUE", since=mark)).param_id == "ANF_RTH_ALT"
        assert (await read(w.client, "ANF_CRUISE_SPEED")).param_id == "ANF_CRUISE_SPEED"  # 16 characters, no NUL
        for name, index in ((b"SIXTEEN_LETTERS_", -1), (b"", by_name.param_count), (b"", 32767)):
            mark = w.client.mark()
            w.client.send(dialect.MAVLink_param_request_read_message(1, 1, name, index))
            error = await w.client.wait("PARAM_ERROR", since=mark)
            assert (error.param_id, error.param_index, error.error) == (name.decode(), index, DOES_NOT_EXIST)
            assert (error.target_system, error.target_component) == (255, 190)


async def test_conf_044_parameter_set() -> None:
    async with world(clients=2) as w:
        marks = [client.mark() for client in w.clients]
        began = time.monotonic()
        send_set(w.client, "RTL_RETURN_ALT", 33.0, REAL32)
        for client, mark in zip(w.clients, marks, strict=True):  # every client learns it, by both names
            for name in ("RTL_RETURN_ALT", "ANF_RTH_ALT"):
                value = await client.wait("PARAM_VALUE", lambda m, name=name: m.param_id == name, since=mark)
                assert (value.param_value, value.param_type) == (33.0, REAL32)
        assert time.monotonic() - began < 0.5
        assert w.commands("rth.set_min_altitude")[-1].args == {"altitude": 33.0}
        for name, number, kind, expected in (
            ("RTL_RETURN_ALT", 33.0, INT32, TYPE_MISMATCH),
            ("RTL_RETURN_ALT", 1000.0, REAL32, OUT_OF_RANGE),
            ("RTL_RETURN_ALT", float("nan"), REAL32, OUT_OF_RANGE),
            ("ANF_RTH_END", 7, INT32, OUT_OF_RANGE),
            ("SYS_AUTOSTART", 0, INT32, READ_ONLY),
            # Values of the listed range that are refused all the same.
            ("GF_MAX_HOR_DIST", 0.5, REAL32, OUT_OF_RANGE),
            ("RTL_LAND_DELAY", -0.5, REAL32, OUT_OF_RANGE),
            ("MPC_XY_CRUISE", 0.05, REAL32, OUT_OF_RANGE),
            ("GF_ACTION", 4, INT32, OUT_OF_RANGE),  # cuts the motors, without allow_kill
        ):
            mark = w.client.mark()
            send_set(w.client, name, number, kind)
            assert (await w.client.wait("PARAM_ERROR", since=mark)).error == expected
            held = await w.client.wait("PARAM_VALUE", since=mark)  # what holds instead
            assert held.param_id == name
        assert len(w.commands("rth.set_min_altitude")) == 1
        mark = w.client.mark()
        send_set(w.client, "NO_SUCH_PARAM", 1.0, REAL32)
        assert (await w.client.wait("PARAM_ERROR", since=mark)).error == DOES_NOT_EXIST
        await read(w.client, "ANF_RTH_ALT")  # and nothing else came between
        assert [m.param_id for _, m in w.client.since(mark, "PARAM_VALUE")] == ["ANF_RTH_ALT"]


async def test_conf_044_parameter_set_ardupilot() -> None:
    """Centimetres and small integers; the type in the message counts for nothing."""
    async with world(flavour="ardupilot") as w:
        for kind in (REAL32, INT16):
            value = await write(w.client, "RTL_ALT", 3300 + kind, kind, "ardupilot")
            assert (value.param_value, value.param_type) == (3300.0 + kind, INT32)
            assert w.commands("rth.set_min_altitude")[-1].args == {"altitude": pytest.approx(33.0 + kind / 100)}
        value = await write(w.client, "ANGLE_MAX", 3500, INT16, "ardupilot")
        assert (value.param_value, value.param_type) == (3500.0, INT16)
        assert w.commands("ardrone3.PilotingSettings.MaxTilt")[-1].args == {"current": 35.0}
        value = await write(w.client, "PILOT_SPEED_UP", 10, INT16, "ardupilot")  # the drone's lowest, 0.1 m/s
        assert value.param_value == 10.0
        for name, number, expected in (
            ("RTL_ALT", 100000.0, OUT_OF_RANGE),
            ("ANGLE_MAX", float("nan"), OUT_OF_RANGE),
            ("FRAME_CLASS", 2.0, READ_ONLY),
            ("WPNAV_SPEED", 5.0, OUT_OF_RANGE),
        ):
            mark = w.client.mark()
            send_set(w.client, name, number, REAL32, "ardupilot")
            assert (await w.client.wait("PARAM_ERROR", since=mark)).error == expected
            assert (await w.client.wait("PARAM_VALUE", since=mark)).param_id == name


@both
async def test_conf_044_present_values_are_written_back_without_an_error(flavour: str) -> None:
    """A station that loads a file of values writes the read-only ones, too."""
    async with world(flavour=flavour) as w:
        values = await fetch(w.client, flavour)
        mark = w.client.mark()
        for name, message in values.items():
            await write(w.client, name, value_of(message, flavour), message.param_type, flavour)
        assert [str(m) for _, m in w.client.since(mark, "PARAM_ERROR")] == []


@both
async def test_conf_045_encoding(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        values = await fetch(w.client)
        system, tilt = values["MAV_SYS_ID" if flavour == "px4" else "SYSID_THISMAV"], values["ANF_MAX_TILT"]
        model = values["ANF_MODEL"]
        assert value_of(system, flavour) == 1
        assert value_of(model, flavour) == 2324
        assert model.get_msgbuf()[10:14] == struct.pack("<i" if flavour == "px4" else "<f", 2324)
        assert tilt.get_msgbuf()[10:14] == struct.pack("<f", 10.0)
        if flavour == "px4":
            assert value_of(values["COM_FLTMODE1"]) == -1
            assert values["COM_FLTMODE1"].get_msgbuf()[10:14] == b"\xff\xff\xff\xff"


FENCE = "ardrone3.PilotingSettings.NoFlyOverMaxDistance"

TWINS_PX4 = [
    # name, value, type; native name and value; Parrot's command and its arguments
    ("MPC_TILTMAX_AIR", 25.0, REAL32, "ANF_MAX_TILT", 25.0, "ardrone3.PilotingSettings.MaxTilt", {"current": 25.0}),
    ("MPC_MAN_Y_MAX", 90.0, REAL32, "ANF_YAW_RATE", 90.0, "ardrone3.SpeedSettings.MaxRotationSpeed", {"current": 90.0}),
    (
        "MPC_Z_VEL_MAX_DN", 2.0, REAL32, "ANF_VERT_SPEED", 2.0,
        "ardrone3.SpeedSettings.MaxVerticalSpeed", {"current": 2.0},
    ),
    (
        "MC_ROLLRATE_MAX", 200.0, REAL32, "ANF_TILT_RATE", 200.0,
        "ardrone3.SpeedSettings.MaxPitchRollRotationSpeed", {"current": 200.0},
    ),
    ("GF_MAX_VER_DIST", 80.0, REAL32, "ANF_MAX_ALT", 80.0, "ardrone3.PilotingSettings.MaxAltitude", {"current": 80.0}),
    ("GF_MAX_HOR_DIST", 500.0, REAL32, "ANF_GEOFENCE", 1.0, FENCE, {"shouldNotFlyOver": 1}),
    ("RTL_DESCEND_ALT", 5.0, REAL32, "ANF_RTH_END_ALT", 5.0, "rth.set_ending_hovering_altitude", {"altitude": 5.0}),
    ("COM_LOW_BAT_ACT", 2, INT32, "ANF_RTH_AUTO", 0.0, "rth.set_auto_trigger_mode", {"mode": 0}),
]  # fmt: skip

TWINS_ARDUPILOT = [
    ("ANGLE_MAX", 2500, INT16, "ANF_MAX_TILT", 25.0, "ardrone3.PilotingSettings.MaxTilt", {"current": 25.0}),
    ("PILOT_Y_RATE", 90.0, REAL32, "ANF_YAW_RATE", 90.0, "ardrone3.SpeedSettings.MaxRotationSpeed", {"current": 90.0}),
    ("PILOT_SPEED_DN", 200, INT16, "ANF_VERT_SPEED", 2.0, "ardrone3.SpeedSettings.MaxVerticalSpeed", {"current": 2.0}),
    ("FENCE_ALT_MAX", 80.0, REAL32, "ANF_MAX_ALT", 80.0, "ardrone3.PilotingSettings.MaxAltitude", {"current": 80.0}),
    ("FENCE_RADIUS", 500.0, REAL32, "ANF_MAX_DIST", 500.0, "ardrone3.PilotingSettings.MaxDistance", {"value": 500.0}),
    ("FENCE_TYPE", 3, INT8, "ANF_GEOFENCE", 1.0, FENCE, {"shouldNotFlyOver": 1}),
    ("RTL_ALT", 4000, INT32, "ANF_RTH_ALT", 40.0, "rth.set_min_altitude", {"altitude": 40.0}),
    ("BATT_FS_LOW_ACT", 0, INT8, "ANF_RTH_AUTO", 0.0, "rth.set_auto_trigger_mode", {"mode": 0}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("flavour", "row"),
    [*(("px4", row) for row in TWINS_PX4), *(("ardupilot", row) for row in TWINS_ARDUPILOT)],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
async def test_alias_and_native_parameter_are_one_value(flavour: str, row: tuple[Any, ...]) -> None:
    name, number, kind, native, expected, command, args = row
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        assert value_of(await write(w.client, name, number, kind, flavour), flavour) == number
        value = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == native, since=mark)
        assert value_of(value, flavour) == expected
        assert args.items() <= w.commands(command)[-1].args.items()


NATIVE_WRITES = [
    ("ANF_BANKED_TURN", 0, INT32, "ardrone3.PilotingSettings.BankedTurn", {"value": 0}),
    ("ANF_CAM_RELATIVE", 1, INT32, "piloting_style.set_style", {"style": 1}),
    ("ANF_RTH_DELAY", 30, INT32, "rth.set_delay", {"delay": 30}),
    ("ANF_RTH_PRECISE", 0, INT32, "precise_home.set_mode", {"mode": 0}),
    ("ANF_HOME_TYPE", 3, INT32, "rth.set_preferred_home_type", {"type": 3}),
    ("ANF_GMB_SPEED", 60.0, REAL32, "gimbal.set_max_speed", {"yaw": 60.0, "pitch": 60.0, "roll": 60.0}),
]


@pytest.mark.parametrize(("name", "number", "kind", "command", "args"), NATIVE_WRITES)
async def test_native_settings_reach_the_drone(
    name: str, number: float, kind: int, command: str, args: dict[str, Any]
) -> None:
    async with world() as w:
        assert value_of(await write(w.client, name, number, kind)) == number
        assert args.items() <= w.commands(command)[-1].args.items()


async def test_the_ai_avoids_obstacles_by_parameter() -> None:
    async with world(model="ai") as w:
        assert value_of(await read(w.client, "ANF_OBS_AVOID")) in (0, 1)
        for number in (0, 1):
            mark = w.client.mark()
            assert value_of(await write(w.client, "COM_OBS_AVOID", number, INT32)) == number
            await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_OBS_AVOID", since=mark)
            assert w.commands("obstacle_avoidance.set_mode")[-1].args == {"mode": number}


@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
async def test_model_has_the_parameters_of_its_documentation(model: str) -> None:
    """docs/parameters.md lists which models have a parameter; the drone's own events decide."""
    async with world(model=model) as w:
        names = {name for name in await fetch(w.client) if name.startswith("ANF_")}
    assert names == {one.name for one in NATIVE_NAMES if one.models == "all" or model in one.models.split(", ")}


async def test_two_flavours_see_one_value() -> None:
    """A write on a PX4 channel reaches the clients of an ArduPilot channel under their own name."""
    async with world(also="ardupilot") as w:
        other = await w.connect(sysid=254, port=5761)
        await other.wait("HEARTBEAT")
        mark = other.mark()
        await write(w.client, "MPC_TILTMAX_AIR", 20.0)
        value = await other.wait("PARAM_VALUE", lambda m: m.param_id == "ANGLE_MAX", since=mark)
        assert (value.param_value, value.param_type) == (2000.0, INT16)


async def test_value_changed_by_the_drone_is_pushed() -> None:
    """Another client, as Parrot's app on the same Skycontroller, changes a setting: only the drone's event shows it."""
    async with world() as w:
        mark = w.client.mark()
        w.drone.firmware.receive(ardrone3.MaxTilt(18.0), asyncio.get_running_loop().time())
        value = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_MAX_TILT", since=mark)
        assert value.param_value == 18.0
        twin = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "MPC_TILTMAX_AIR", since=mark)
        assert twin.param_value == 18.0


async def test_many_writes_at_once_are_all_carried_out() -> None:
    """A client that loads a file does not wait between its writes."""
    async with world() as w:
        mark = w.client.mark()
        for number in range(20, 60):
            send_set(w.client, "RTL_RETURN_ALT", float(number), REAL32)
            send_set(w.client, "MPC_TILTMAX_AIR", float(number - 19), REAL32)
        await w.client.wait(
            "PARAM_VALUE", lambda m: (m.param_id, m.param_value) == ("RTL_RETURN_ALT", 59.0), since=mark
        )
        await w.client.wait(
            "PARAM_VALUE", lambda m: (m.param_id, m.param_value) == ("MPC_TILTMAX_AIR", 40.0), since=mark
        )
        # In their order; what was overtaken while it waited need not have reached the drone.
        heights = [entry.args["altitude"] for entry in w.commands("rth.set_min_altitude")]
        assert heights == sorted(heights)
        assert heights[-1] == 59.0


async def test_unconfirmed_parameter_write_changes_nothing() -> None:
    """A mode of home that this drone does not have: the value that holds comes back, and a text says why."""
    async with world() as w:
        before = value_of(await read(w.client, "ANF_HOME_TYPE"))
        mark = w.client.mark()
        value = await write(w.client, "ANF_HOME_TYPE", 2, INT32)
        if value_of(value) == 2:
            assert w.commands("rth.set_preferred_home_type")  # this model has it
        else:
            assert value_of(value) == before
            await w.client.wait("STATUSTEXT", lambda m: "ANF_HOME_TYPE not set" in m.text, since=mark)


async def test_unconfirmed_parameter_write_is_reported_to_its_client_alone() -> None:
    """As a write that is refused at once. The value that holds is the answer."""
    async with world() as w:
        other = await w.connect(sysid=250)
        before = value_of(await read(w.client, "RTL_RETURN_ALT"))
        w.drone.faults.unreported = frozenset({"rth.min_altitude"})
        mark, elsewhere = w.client.mark(), other.mark()
        value = await write(w.client, "RTL_RETURN_ALT", 33.0, REAL32, timeout=20.0)
        assert value_of(value) == before
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("RTL_RETURN_ALT not set"), since=mark)
        await read(other, "RTL_RETURN_ALT")
        assert [m.text for _, m in other.since(elsewhere, "STATUSTEXT") if "RTL_RETURN_ALT" in m.text] == []


async def qgroundcontrol_setup(values: dict[str, Any]) -> dict[str, bool]:
    """What QGroundControl's PX4 setup components make of the parameters (conformance A5)."""
    get = {name: value_of(message) for name, message in values.items()}
    return {
        "airframe": get["SYS_AUTOSTART"] != 0,
        "radio": get["COM_RC_IN_MODE"] == 1 or all(get[f"RC_MAP_{axis}"] for axis in ("ROLL", "PITCH", "YAW")),
        "sensors": all(get[name] != 0 for name in ("CAL_GYRO0_ID", "CAL_ACC0_ID", "CAL_MAG0_ID")),
    }


async def test_conf_052_no_missing_parameter() -> None:
    """Every name that QGroundControl's pages and indicators look up is answered, by name as well."""
    async with world() as w:
        assert not set(A5_PX4) - set(await fetch(w.client))
        for name in A5_PX4:
            assert (await read(w.client, name)).param_index != 65535


async def test_conf_052_no_missing_parameter_ardupilot() -> None:
    async with world(flavour="ardupilot") as w:
        assert not set(WANTED_ARDUPILOT) - set(await fetch(w.client))


async def test_conf_053_setup_complete() -> None:
    async with world() as w:
        assert set((await qgroundcontrol_setup(await fetch(w.client))).values()) == {True}


async def test_conf_053_setup_complete_ardupilot() -> None:
    """QGroundControl's APM components: a frame, mapped sticks with limits not at their defaults, a compass and an
    accelerometer with offsets other than 0, a battery with a capacity."""
    async with world(flavour="ardupilot") as w:
        get = {name: value_of(message, "ardupilot") for name, message in (await fetch(w.client)).items()}
        assert get["FRAME_CLASS"] != 0
        channels = [int(get[f"RCMAP_{axis}"]) for axis in ("ROLL", "PITCH", "YAW", "THROTTLE")]
        assert all(channel > 0 for channel in channels)
        assert any(get[f"RC{channel}_MIN"] != 1100 for channel in channels)
        assert all(get[f"COMPASS_OFS_{axis}"] != 0.0 for axis in "XYZ")
        assert not all(get[f"INS_ACCOFFS_{axis}"] == 0.0 for axis in "XYZ")
        assert get["BATT_CAPACITY"] != 0


async def test_conf_053_setup_is_incomplete_while_the_magnetometer_is() -> None:
    async with world(also="ardupilot") as w:
        other = await w.connect(sysid=254, port=5761)
        await other.wait("HEARTBEAT")
        marks = w.client.mark(), other.mark()
        w.drone.faults.magneto_required = True
        value = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "CAL_MAG0_ID", since=marks[0])
        assert value_of(value) == 0
        value = await other.wait("PARAM_VALUE", lambda m: m.param_id == "COMPASS_OFS_X", since=marks[1])
        assert value.param_value == 0.0


def hash_by_qgroundcontrol(values: dict[str, Any]) -> int:
    """Its own words (ParameterManager.cc): the cache is a map by name; over each name and raw value, volatile ones
    left out; CRC-32 that begins with 0 and is not inverted."""
    crc = 0
    for name in sorted(values):
        if name in ("LND_FLIGHT_T_HI", "LND_FLIGHT_T_LO"):
            continue
        data = name.encode() + values[name].get_msgbuf()[10:14]
        crc = zlib.crc32(data, crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
    return crc


async def test_conf_054_hash_check() -> None:
    async with world() as w:
        values = await fetch(w.client)
        hashed = await read(w.client, "_HASH_CHECK")
        assert (hashed.param_type, hashed.param_index, hashed.param_count) == (5, 65535, len(values))
        assert int(value_of(hashed)) == hash_by_qgroundcontrol(values)
        # The second connection finds the same hash, and the list begins with it.
        again = await w.connect(sysid=253)
        mark = again.mark()
        again.send(dialect.MAVLink_param_request_list_message(1, 0))
        first = await again.wait("PARAM_VALUE", since=mark)
        assert (first.param_id, value_of(first)) == ("_HASH_CHECK", value_of(hashed))
        # A value changed, and so does the hash.
        await write(w.client, "MPC_TILTMAX_AIR", 22.0)
        assert value_of(await read(w.client, "_HASH_CHECK")) != value_of(hashed)


async def test_conf_054_no_hash_for_ardupilot() -> None:
    async with world(flavour="ardupilot") as w:
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_request_read_message(1, 1, b"_HASH_CHECK", -1))
        assert (await w.client.wait("PARAM_ERROR", since=mark)).error == DOES_NOT_EXIST
        await fetch(w.client)
        assert not [m for _, m in w.client.since(mark, "PARAM_VALUE") if m.param_id == "_HASH_CHECK"]


async def list_until_stopped(w: World, client: Client) -> list[Any]:
    mark = client.mark()
    client.send(dialect.MAVLink_param_request_list_message(1, 0))
    first = await client.wait("PARAM_VALUE", since=mark)
    send_set(client, "_HASH_CHECK", value_of(first), 5)
    await client.wait("HEARTBEAT", timeout=3.0)
    await client.wait("HEARTBEAT", timeout=3.0)
    return [m for _, m in client.since(mark, "PARAM_VALUE")]


async def test_conf_055_the_hash_stops_the_stream() -> None:
    async with world(clients=2) as w:
        stopped = await list_until_stopped(w, w.client)
        count = stopped[0].param_count
        assert len(stopped) < count  # some had left before the word arrived
        # Another client's list is not his to stop.
        w.clients[1].send(dialect.MAVLink_param_request_list_message(1, 0))
        send_set(w.client, "_HASH_CHECK", 0, 5)
        await w.clients[1].wait("PARAM_VALUE", lambda m: m.param_index == count - 1)


class Radio(SerialClient):
    """A ground station behind a telemetry radio: of what waits at its end of the line it gets 5760 bytes a second."""

    def __init__(self, master: int) -> None:
        super().__init__(master)
        loop = asyncio.get_running_loop()
        loop.remove_reader(master)
        self._carrying = loop.create_task(self._carry())

    async def _carry(self) -> None:
        while True:
            await asyncio.sleep(0.02)
            with contextlib.suppress(BlockingIOError):
                self.feed(os.read(self._master, 115))

    async def close(self) -> None:
        self._carrying.cancel()


async def test_a_list_fits_through_a_radio() -> None:
    """57600 baud: nothing is dropped, and telemetry comes meanwhile."""
    drone = loopback()
    async with pseudo_terminal() as (master, name):
        config = Config(
            endpoints=(f"serial://{name}:57600",), drones=(DroneConfig(name="alpha", sysid=1, address=drone),)
        )
        spec = DroneSpec(address=drone, home=HOME, http_port=None)
        async with Simulator([spec], seed=1), Gateway(config) as gateway:
            radio = Radio(master)
            await radio.wait("HEARTBEAT", timeout=10.0)
            mark = radio.mark()
            values = await fetch(radio, timeout=15.0)
            counts = {m.param_count for m in values.values()}
            assert counts == {len(values)}
            assert gateway.counters()["dropped_frames"] == 0
            assert len(radio.since(mark, "ATTITUDE")) >= 2
            # So does a file, and QGroundControl fetches this one before the list.
            mark = radio.mark()
            described = json.loads(lzma.decompress(await Ftp(radio).download("/parameter.json.xz")))
            assert {one["name"] for one in described["parameters"]} == set(values)
            assert gateway.counters()["dropped_frames"] == 0
            assert radio.since(mark, "ATTITUDE")
            assert radio.bad == 0
            await radio.close()


async def lost_ground_station(w: World, action: int) -> Client:
    """A flying drone with a policy, whose one ground station has sent its last heartbeat; another one looks on."""
    onlooker = await w.connect(sysid=254)
    await write(onlooker, "NAV_DLL_ACT", action, INT32)
    await write(onlooker, "ANF_GCS_LOSS_T", 2.0)
    await w.take_off(8.0)
    w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
    return onlooker


@pytest.mark.parametrize(
    ("action", "mode", "command"),
    [
        (2, RETURN, "rth.return_to_home"),
        (3, LAND, "ardrone3.Piloting.Landing"),
        (1, HOLD, "ardrone3.Piloting.CancelMoveTo"),
    ],
    ids=["return", "land", "hold"],
)
async def test_nav_dll_act_is_executed_at_link_loss(action: int, mode: int, command: str) -> None:
    """conformance E11; the drone is on its way somewhere when the ground station falls silent."""
    async with world() as w:
        onlooker = await lost_ground_station(w, action)
        place = geo.destination(*HOME[:2], 200.0, 0.0)
        assert (
            await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0, frame=6, x=place[0], y=place[1], z=8.0)
        ).result == 0
        assert not w.commands(command)
        mark = onlooker.mark()
        await onlooker.wait("STATUSTEXT", lambda m: "No ground station for 2 s" in m.text, timeout=5.0)
        await onlooker.heartbeat(lambda beat: beat.custom_mode == mode, since=mark)
        await w.drone.wait_log(lambda entry: entry.kind == "command" and entry.name == command, 5.0)
        # It is done once, and the ground station's return is reported.
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        await onlooker.wait("STATUSTEXT", lambda m: "is back" in m.text)
        assert len(w.commands(command)) == 1


async def test_gateway_parameters_outlive_a_restart(tmp_path: Path) -> None:
    """By drone. Not what makes motors turn, and not what MAV_CMD_DO_CHANGE_SPEED changes in passing."""
    mine = {"ANF_TKOFF_ALT": (4.5, REAL32, 2.5), "ANF_GCS_LOSS": (2, INT32, 0), "ANF_GCS_LOSS_T": (7.0, REAL32, 10.0)}
    passing = {"ANF_HAND_LAUNCH": (1, INT32, 0), "ANF_CRUISE_SPEED": (3.0, REAL32, 0.0)}
    address = loopback()
    async with world(drone_address=address) as w:
        for name, (value, kind, _) in {**mine, **passing}.items():
            assert value_of(await write(w.client, name, value, kind)) == value
        folder = tmp_path / "state" / "anafi-mav"
        until = time.monotonic() + 5.0
        while not any(b'"ANF_GCS_LOSS_T":7.0' in file.read_bytes() for file in folder.glob("*.json")):
            assert time.monotonic() < until
            await asyncio.sleep(0.05)
        w.drone.faults.mute = True
        await asyncio.sleep(4.0)
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=15.0)
        for name, (value, _, _) in {**mine, **passing}.items():
            assert value_of(await read(w.client, name)) == value
    async with world(drone_address=address) as w:
        for name, (value, _, _) in mine.items():
            assert value_of(await read(w.client, name)) == value
        for name, (_, _, default) in passing.items():
            assert value_of(await read(w.client, name)) == default
    (file,) = folder.glob("*.json")
    spoiled = file.read_text().replace('"ANF_GCS_LOSS":2', '"ANF_GCS_LOSS":9').replace("4.5", '"high"')
    file.write_text(spoiled)
    async with world(drone_address=address) as w:
        assert value_of(await read(w.client, "ANF_GCS_LOSS")) == 0
        assert value_of(await read(w.client, "ANF_TKOFF_ALT")) == 2.5
        assert value_of(await read(w.client, "ANF_GCS_LOSS_T")) == 7.0
    async with world() as w:
        assert value_of(await read(w.client, "ANF_GCS_LOSS_T")) == 10.0, "another drone"


async def test_without_a_policy_silence_of_the_ground_means_nothing() -> None:
    async with world() as w:
        assert value_of(await read(w.client, "NAV_DLL_ACT")) == 0
        await write(w.client, "COM_DL_LOSS_T", 2, INT32)
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        await w.take_off(5.0)
        mark = w.client.mark()
        for _ in range(3):
            await w.client.wait("HEARTBEAT", timeout=2.0)
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if "ground station" in m.text]
        assert w.drone.flying_state.name == "HOVERING"

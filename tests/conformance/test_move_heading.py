"""Heading of a goto without a heading, by MPC_YAW_MODE and WP_YAW_BEHAVIOR, judged by the simulator's true poses."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import NAN
from support.params import send_set, value_of, write
from support.world import HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages.ardrone3 import MoveToStatus, OrientationMode

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
INT8, INT32 = dialect.MAV_PARAM_TYPE_INT8, dialect.MAV_PARAM_TYPE_INT32
REPOSITION, RELATIVE = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
EAST = geo.destination(HOME[0], HOME[1], 0.0, 30.0)
"""30 m east of the take-off point: to the right of a drone that looks north."""
NONE, TO_TARGET = OrientationMode.NONE, OrientationMode.TO_TARGET
START, DURING = OrientationMode.HEADING_START, OrientationMode.HEADING_DURING
KINDS = {"MPC_YAW_MODE": INT32, "WP_YAW_BEHAVIOR": INT8}


async def flown(w: World, since: float) -> tuple[int, list[tuple[float, float]]]:
    """Orientation of the only moveTo, then distance (m) and heading (deg) of the true poses until its end."""
    done = await w.drone.wait_log(
        lambda e: e.name.endswith("moveToChanged") and e.args["status"] == MoveToStatus.DONE, 40.0
    )
    log = [e for e in w.drone.log if since < e.t <= done.t]
    [move] = [e for e in log if e.kind == "command" and e.name.endswith("Piloting.moveTo")]
    poses = [e.args for e in log if e.kind == "pose"]
    return int(move.args["orientation_mode"]), [
        (math.hypot(p["north"], p["east"]), math.degrees(p["yaw"]) % 360.0) for p in poses
    ]


@pytest.mark.parametrize(
    ("flavour", "name", "value", "native", "yaw", "orientation", "end"),
    [
        ("px4", "MPC_YAW_MODE", 5, 0, NAN, NONE, 0.0),
        ("px4", "MPC_YAW_MODE", 0, 1, NAN, DURING, 90.0),
        ("px4", "MPC_YAW_MODE", 4, 2, NAN, TO_TARGET, 90.0),
        ("px4", "MPC_YAW_MODE", 4, 2, math.pi, START, 180.0),  # the heading of the command, but first
        ("ardupilot", "WP_YAW_BEHAVIOR", 2, 1, NAN, DURING, 90.0),
    ],
)
async def test_goto_turns_as_the_parameter_demands(
    flavour: str, name: str, value: int, native: int, yaw: float, orientation: int, end: float
) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(10.0)
        mark = w.client.mark()
        assert value_of(await write(w.client, name, value, KINDS[name], flavour), flavour) == value
        if value != 5:  # the default: nothing changes
            twin = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_YAW_MODE", since=mark)
            assert value_of(twin, flavour) == native
        since = w.drone.log[-1].t
        ack = await w.client.command(REPOSITION, -1, 1, 0, yaw, frame=RELATIVE, x=EAST[0], y=EAST[1], z=10.0)
        assert ack.result == ACCEPTED
        mode, poses = await flown(w, since)
        assert mode == orientation
        assert poses[-1][0] == pytest.approx(30.0, abs=1.0)
        assert abs((poses[-1][1] - end + 180.0) % 360.0 - 180.0) < 3.0
        if end:
            left = next(heading for distance, heading in poses if distance > 2.0)
            is_first = orientation in (TO_TARGET, START)
            assert (abs(left - end) < 10.0) == is_first


async def test_guided_place_without_heading_turns_to_it() -> None:
    """One SET_POSITION_TARGET_GLOBAL_INT with a place and nothing else."""
    async with world(flavour="ardupilot") as w:
        await w.take_off(10.0)
        assert value_of(await write(w.client, "WP_YAW_BEHAVIOR", 2, INT8, "ardupilot"), "ardupilot") == 2
        since = w.drone.log[-1].t
        w.client.send(
            dialect.MAVLink_set_position_target_global_int_message(
                0, 1, 1, RELATIVE, 0b110111111000, int(EAST[0] * 1e7), int(EAST[1] * 1e7), 10.0, *[0.0] * 8
            )
        )
        mode, poses = await flown(w, since)
        assert mode == DURING
        assert poses[-1] == pytest.approx((30.0, 90.0), abs=2.0)


@pytest.mark.parametrize(
    ("flavour", "name", "value"),
    [("px4", "MPC_YAW_MODE", 1), ("px4", "MPC_YAW_MODE", 3), ("ardupilot", "WP_YAW_BEHAVIOR", 1)],
)
async def test_heading_rule_that_is_not_flown_cannot_be_written(flavour: str, name: str, value: int) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        send_set(w.client, name, value, KINDS[name], flavour)
        await w.client.wait("PARAM_ERROR", lambda m: m.param_id == name, since=mark)

"""What one client wanted is over when another client or a landing has ended it; what was refused is not flown later."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from support.fault_scenarios import (
    ACCEPTED,
    CANCELLED,
    GOTO,
    LAND_CMD,
    PX4_HOLD,
    REJECTED,
    RTL,
    another_controller,
    goto,
    heard,
    now_mute,
    until,
)
from support.mav import NAN
from support.world import HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.mavlink import dialect
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.vehicle.link_loss import LossAction

PAUSE, SET_HOME, ALTITUDE, ROI_NONE, TURN = (
    dialect.MAV_CMD_DO_PAUSE_CONTINUE,
    dialect.MAV_CMD_DO_SET_HOME,
    dialect.MAV_CMD_DO_CHANGE_ALTITUDE,
    dialect.MAV_CMD_DO_SET_ROI_NONE,
    dialect.MAV_CMD_CONDITION_YAW,
)


async def leaves(w: World, north: float) -> None:
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > north, 20.0, since=w.drone.log[-1].t)


async def lands(w: World) -> None:
    await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)


def moves(w: World) -> list[dict[str, Any]]:
    """Places that the drone was sent to."""
    names = ("ardrone3.Piloting.moveTo", "move.extended_move_to")
    return [e.args for e in w.drone.log if e.kind == "command" and e.name in names]


# -- pause and continue


async def test_second_pause_stops_a_goto_of_another_client() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        place = geo.destination(*HOME[:2], 60.0, 0.0)
        assert (await other.command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=10.0)).result == ACCEPTED
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        assert heard(w, "moveTo", "CancelMoveTo") == ["moveTo", "CancelMoveTo"]


@pytest.mark.parametrize("since", ["hold", "landing", "landing by somebody else"])
async def test_a_pause_is_not_continued_after_something_else(since: str) -> None:
    """A place from before a landing has its height above another take-off point."""
    async with world() as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        assert await goto(w, 80.0, 10.0) == ACCEPTED
        await leaves(w, 3.0)
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        if since == "hold":
            assert (await other.command(PAUSE, 0)).result == ACCEPTED
            assert (await other.command(GOTO, -1, 1, 0, 1.0)).result == ACCEPTED
        else:
            if since == "landing":
                assert (await other.command(LAND_CMD)).result == ACCEPTED
            else:
                another_controller(w, ardrone3.Landing())
            await lands(w)
            await w.take_off()
        before = len(moves(w))
        assert (await w.client.command(PAUSE, 1)).result == REJECTED
        assert len(moves(w)) == before


async def test_two_pauses_are_continued_like_one() -> None:
    async with world() as w:
        await w.take_off()
        assert await goto(w, 80.0, 10.0) == ACCEPTED
        await leaves(w, 3.0)
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        assert (await w.client.command(PAUSE, 1)).result == ACCEPTED
        first, last = moves(w)[0], moves(w)[-1]
        assert last["altitude"] == pytest.approx(first["altitude"], abs=0.01)  # a little lower than the paused move
        assert {**last, "altitude": 0.0} == {**first, "altitude": 0.0}


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_pause_then_the_shown_mode_is_continued_with_the_goto(flavour: str) -> None:
    """Choosing the mode that a pause shows keeps the pause (docs/setpoints.md), so also what it goes on with."""
    async with world(flavour=flavour, clients=2) as w:
        await w.take_off()
        assert await goto(w, 80.0, 10.0) == ACCEPTED
        await leaves(w, 3.0)
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        shown = PX4_HOLD if flavour == "px4" else (1, 4)
        assert (await w.clients[1].command(dialect.MAV_CMD_DO_SET_MODE, *shown)).result == ACCEPTED
        count = len(moves(w))
        assert (await w.client.command(PAUSE, 1)).result == ACCEPTED
        assert len(moves(w)) == count + 1
        await leaves(w, 70.0)


async def test_two_pauses_over_a_slow_link_are_continued_with_the_goto() -> None:
    """The second one arrives before the drone has answered the first."""
    async with world(speed=1.0, clients=2) as w:
        await w.take_off()
        assert await goto(w, 80.0, 10.0) == ACCEPTED
        await leaves(w, 3.0)
        w.drone.faults.down = w.drone.faults.up = Impairment(delay=0.3)
        marks = [client.mark() for client in w.clients]
        began = asyncio.get_running_loop().time()
        w.clients[1].send_command(PAUSE, 0)
        await w.drone.wait_log(lambda e: e.name.endswith("CancelMoveTo"), 2.0, since=began)
        w.client.send_command(PAUSE, 0)  # the drone's answer is on its way
        assert (await until(w.clients[1], marks[1], 1))[0] == (PAUSE, CANCELLED)
        assert (await until(w.client, marks[0], 1))[0] == (PAUSE, ACCEPTED)
        count = len(moves(w))
        assert (await w.clients[1].command(PAUSE, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: len(moves(w)) > count, 5.0)


async def test_continue_before_a_pause_has_begun_is_not_accepted_without_effect() -> None:
    """ACCEPTED would say that setpoints fly the drone again, and a moment later the pause would hold them off."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        await w.take_off()
        w.drone.faults.down = w.drone.faults.up = Impairment(delay=0.3)
        w.clients[1].send_command(TURN, 180.0, 0, 1, 1)
        await w.drone.wait_log(lambda e: e.name.endswith(".moveBy") and e.args["dPsi"] != 0.0, 5.0)
        mark, began = w.client.mark(), asyncio.get_running_loop().time()
        w.client.send_command(PAUSE, 0)
        await w.drone.wait_log(lambda e: e.kind == "command" and "PCMD" not in e.name, 2.0, since=began)
        assert (await w.clients[1].command(PAUSE, 1)).result == REJECTED
        assert (await until(w.client, mark, 1))[0] == (PAUSE, ACCEPTED)
        assert (await w.client.command(PAUSE, 1)).result == ACCEPTED


# -- what was refused


async def test_altitude_change_does_not_fly_to_a_refused_position() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        assert await goto(w, 80.0, 10.0) == ACCEPTED
        w.drone.faults.magneto_required = True
        await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["state"] == rth.RthState.UNAVAILABLE)
        south = geo.destination(*HOME[:2], -80.0, 0.0)
        ack = await w.client.command(GOTO, -1, 1, 0, NAN, frame=6, x=south[0], y=south[1], z=10.0)
        assert ack.result == REJECTED
        w.drone.faults.magneto_required = False
        await w.drone.wait_log(
            lambda e: e.name == "rth.state" and e.args["state"] == rth.RthState.AVAILABLE, since=w.drone.log[-1].t
        )
        assert (await w.client.command(ALTITUDE, 20.0, 3.0)).result == ACCEPTED
        north = geo.destination(*HOME[:2], 80.0, 0.0)
        assert moves(w)[-1]["latitude"] == pytest.approx(north[0], abs=1e-6)


# -- home


@pytest.mark.parametrize("how", ["a return", "cancel"])
@pytest.mark.parametrize("step", [rth.SetCustomLocation.NAME, rth.SetPreferredHomeType.NAME])
async def test_cancelled_home_leaves_the_old_one(step: str, how: str) -> None:
    """The drone prefers a custom home only once it has the place, and no longer when that was cancelled."""
    async with world(speed=1.0) as w:
        await w.take_off()
        muted = now_mute(w, step, 0.5)
        mark = w.client.mark()
        w.client.send_command(SET_HOME, 0, frame=6, x=HOME[0] + 0.0003, y=HOME[1], z=NAN)
        await muted
        if how == "cancel":
            w.client.send(dialect.MAVLink_command_cancel_message(1, 1, SET_HOME))
        else:
            other = await w.connect(sysid=250)
            assert (await other.command(RTL)).result == ACCEPTED
        assert await until(w.client, mark, 1) == [(SET_HOME, CANCELLED)]
        types = [e.args["type"] for e in w.drone.log if e.kind == "command" and e.name == "rth.set_preferred_home_type"]
        has_place = step == rth.SetPreferredHomeType.NAME
        assert types == ([rth.RthHomeType.CUSTOM, rth.RthHomeType.TAKEOFF] if has_place else [])
        if how != "cancel":
            assert heard(w, "set_preferred_home_type", "return_to_home")[-1] == "return_to_home"


@pytest.mark.parametrize("how", ["a return", "cancel"])
@pytest.mark.parametrize(
    ("step", "report"),
    [
        (rth.SetCustomLocation.NAME, rth.CustomLocation.NAME),
        (rth.SetPreferredHomeType.NAME, rth.PreferredHomeType.NAME),
    ],
)
async def test_cancelled_place_of_a_custom_home_leaves_the_old_one(step: str, report: str, how: str) -> None:
    """It is home as soon as the drone has it: the one before is sent again, before the drone returns."""
    async with world(speed=1.0) as w:
        await w.take_off()
        first, other = HOME[0] + 0.0001, await w.connect(sysid=250)
        assert (await w.client.command(SET_HOME, 0, frame=6, x=first, y=HOME[1], z=NAN)).result == ACCEPTED
        w.drone.faults.unreported = frozenset({report})
        mark, began = w.client.mark(), asyncio.get_running_loop().time()
        w.client.send_command(SET_HOME, 0, frame=6, x=HOME[0] + 0.0003, y=HOME[1], z=NAN)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == step, 5.0, since=began)
        w.drone.faults.unreported = frozenset()
        if how == "cancel":
            w.client.send(dialect.MAVLink_command_cancel_message(1, 1, SET_HOME))
        else:
            assert (await other.command(RTL)).result == ACCEPTED
        assert await until(w.client, mark, 1) == [(SET_HOME, CANCELLED)]
        custom = w.drone.firmware.homing.custom
        assert custom is not None
        assert custom.latitude == pytest.approx(first, abs=1e-6)
        if how != "cancel":
            assert heard(w, "set_custom_location", "return_to_home")[-1] == "return_to_home"


# -- the ground station is back


async def test_returning_clients_command_ends_the_link_loss_action() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=254)
        await w.take_off(8.0)
        policy = w.gateway.systems[0].vehicle.gcs_loss
        policy.action, policy.after = LossAction.RETURN, 1.0
        muted = now_mute(w, "rth.return_to_home", 0.5)
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        await muted
        assert (await other.command(dialect.MAV_CMD_DO_SET_MODE, *PX4_HOLD)).result == ACCEPTED
        place = geo.destination(*HOME[:2], 40.0, 0.0)
        assert (await other.command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)).result == ACCEPTED
        await leaves(w, 10.0)
        assert heard(w, "CancelMoveTo") == []

"""Item 104 of the conformance list: the sticks of ground stations, in both flavours, by what the drone heard."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.setpoints import COPTER_GUIDED, attitude, earth, engage, heard, motion, said, streaming, texts
from support.world import HOLD, HOME, POSITION, World, world

from anafi_mav import geo, mav_enums

SET_MODE, GOTO = mav_enums.MAV_CMD_DO_SET_MODE, mav_enums.MAV_CMD_DO_REPOSITION
COPTER_LOITER = 5

CENTRED_WITHIN = 0.5
"""s of silence until the sticks are centred."""


def now() -> float:
    return asyncio.get_running_loop().time()


def manual(x: int = 0, y: int = 0, z: int = 500, r: int = 0, buttons: int = 0, target: int = 1) -> Any:
    return dialect.MAVLink_manual_control_message(target, x, y, z, r, buttons)


def override(*channels: int) -> Any:
    return dialect.MAVLink_rc_channels_override_message(1, 1, *channels, *[0xFFFF] * (8 - len(channels)))


async def by_sticks(w: World, flavour: str) -> None:
    """Mode Position, or Loiter."""
    number = (1, 3, 0) if flavour == "px4" else (1, COPTER_LOITER)
    assert (await w.client.command(SET_MODE, *number)).result == 0


def stick(entry: Any) -> tuple[int, int, int, int]:
    """Of a PCMD: roll right, pitch forward (nose down), yaw clockwise, gaz up."""
    return tuple(entry.args[axis] for axis in ("roll", "pitch", "yaw", "gaz"))  # type: ignore[return-value]


@both
async def test_conf_104_axes_and_silence(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        await by_sticks(w, flavour)
        for message, expected in [
            (manual(x=600), (0, 60, 0, 0)),
            (manual(x=-1000), (0, -100, 0, 0)),
            (manual(y=500), (50, 0, 0, 0)),
            (manual(r=250), (0, 0, 25, 0)),
            (manual(z=1000), (0, 0, 0, 100)),
            (manual(z=250), (0, 0, 0, -50)),
            (override(1600, 1300, 1750, 1450), (20, 40, -10, 50)),
            (override(0, 0, 1250, 0), (0, 0, 0, -50)),
            (manual(x=300, buttons=0xFFFF), (0, 30, 0, 0)),
        ]:
            began = now()
            async with streaming(w.client, message, 0.04) as sent:
                await w.drone.wait_log(
                    lambda e, expected=expected: e.name.endswith(".PCMD") and stick(e) == expected, 5.0, since=began
                )
            last = sent[-1]
            level = await w.drone.wait_log(
                lambda e: e.name.endswith(".PCMD") and stick(e) == (0, 0, 0, 0), 2.0, since=last
            )
            assert level.t - last <= CENTRED_WITHIN
        assert heard(w, "Landing", "TakeOff", "Emergency") == heard(w, "TakeOff")  # no button did anything


@both
async def test_the_drone_goes_where_the_stick_points(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        await by_sticks(w, flavour)
        async with streaming(w.client, manual(x=700, y=700, z=600, r=0), 0.04):
            await asyncio.sleep(2.0)
            pose = w.drone.pose
        assert pose.vn > 0.5
        assert pose.ve > 0.5
        assert pose.vd < -0.3
        async with streaming(w.client, manual(r=-800), 0.04):
            await asyncio.sleep(1.0)
        assert -math.pi < w.drone.pose.yaw < -0.1


@both
async def test_a_joystick_on_the_table_ends_nothing(flavour: str) -> None:
    """It is streamed all the time once it is enabled; a goto goes on, and nothing is sent for it."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        async with streaming(w.client, manual(), 0.04):
            place = geo.destination(*HOME[:2], 12.0, 0.0)
            ack = await w.client.command(GOTO, -1, 1, 0, math.nan, frame=6, x=place[0], y=place[1], z=8.0)
            assert ack.result == 0
            await w.drone.wait_log(
                lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 1, 30.0, since=now()
            )
            assert heard(w, "CancelMoveTo") == []
            await asyncio.sleep(2.5)
            began = now()
            await asyncio.sleep(0.5)
            assert heard(w, "PCMD", since=began) == []
        assert w.drone.pose.north == pytest.approx(12.0, abs=0.7)


@both
async def test_a_stick_flies_in_mode_position_only(flavour: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        began, mark = now(), w.client.mark()
        async with streaming(w.client, manual(x=1000, z=0), 0.04):
            await said(w.client, "not Position", mark)
            await asyncio.sleep(0.3)
        assert motion(w, began) == []
        beats = {beat.custom_mode for _, beat in w.client.since(mark, "HEARTBEAT")}
        assert beats <= {HOLD if flavour == "px4" else COPTER_GUIDED}


@both
async def test_throttle_at_rest_sends_no_text(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        async with streaming(w.client, manual(z=0), 0.04):
            await w.client.wait("HEARTBEAT")
        assert [text for text in texts(w.client, mark) if "Sticks" in text] == []


@both
@pytest.mark.parametrize("order", ["land", "return"])
async def test_sticks_do_not_fight_a_landing_or_a_return(flavour: str, order: str) -> None:
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(4.0)
        await by_sticks(w, flavour)
        async with streaming(w.client, manual(x=800, z=900), 0.04):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 10.0)
            assert (await w.client.command(21 if order == "land" else 20)).result == 0
            began = now()
            if order == "land":
                await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)
            else:
                await asyncio.sleep(1.5)
        assert [e for e in motion(w, began) if e.name.endswith("PCMD")] == []


@both
async def test_the_ground_is_not_left_by_sticks(flavour: str) -> None:
    """Neither by arming with throttle down and yaw right, nor by pushing the throttle."""
    async with world(flavour=flavour) as w:
        await by_sticks(w, flavour)
        mark = w.client.mark()
        async with streaming(w.client, manual(z=0, r=1000), 0.04):
            await said(w.client, "arm by command", mark)
            await asyncio.sleep(0.5)
        async with streaming(w.client, manual(z=1000), 0.04):
            await asyncio.sleep(0.5)
        assert heard(w, "TakeOff", "UserTakeOff", "PCMD") == []
        assert not any(beat.base_mode & 128 for _, beat in w.client.since(mark, "HEARTBEAT"))


async def test_fifty_messages_a_second_do_not_flood_the_drone() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        await by_sticks(w, "px4")
        async with streaming(w.client, manual(x=500), 0.02) as sent:
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] == 50, 5.0)
            began, count = now(), len(sent)
            await asyncio.sleep(2.0)
            took = now() - began
            assert len(sent) - count > 70
            assert len(heard(w, "PCMD", since=began)) <= 21 * took + 2


async def test_sticks_have_one_holder() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        await by_sticks(w, "px4")
        async with streaming(w.client, manual(x=500), 0.04):
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] == 50, 5.0)
            began = now()
            async with streaming(other, manual(y=-1000), 0.04):
                await said(other, "another joystick flies")
            async with streaming(other, manual(), 0.04):
                await asyncio.sleep(0.3)
            assert {stick(e)[:2] for e in heard(w, "PCMD", since=began)} == {(0, 50)}
        # He lets go: now the other one may.
        await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] == 0, 2.0, since=now())
        async with streaming(other, manual(y=-1000), 0.04):
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["roll"] == -100, 5.0, since=now())


async def test_released_channels_of_another_client_leave_the_holders_sticks() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        await by_sticks(w, "px4")
        async with streaming(w.client, manual(x=500), 0.2):
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] == 50, 5.0)
            began = now()
            async with streaming(other, override(0, 0, 0, 0), 0.1):
                await asyncio.sleep(0.5)
            assert {stick(e)[:2] for e in heard(w, "PCMD", since=began)} == {(0, 50)}


async def test_sticks_are_refused_with_a_text_while_the_pilot_moves_one() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off()
        await by_sticks(w, "px4")
        async with streaming(w.client, manual(x=500), 0.1):
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] == 50, 5.0)
            mark = w.client.mark()
            assert w.drone.skycontroller is not None
            w.drone.skycontroller.stick(3, -60)
            await said(w.client, "Sticks ignored: Skycontroller pilot", mark)


async def test_sticks_for_another_system_are_not_ours() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        await by_sticks(w, "px4")
        began = now()
        async with streaming(w.client, manual(x=1000, target=2), 0.04):
            await asyncio.sleep(0.5)
        assert motion(w, began) == []


async def test_another_mode_ends_the_sticks() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        await by_sticks(w, "px4")
        async with streaming(w.client, manual(x=1000), 0.04):
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] == 100, 5.0)
            assert (await w.client.command(SET_MODE, 1, 4, 3)).result == 0
            began = now()
            await asyncio.sleep(0.5)
        assert motion(w, began) == []
        assert w.client.since(0, "HEARTBEAT")[-1][1].custom_mode in (HOLD, POSITION)


async def test_centred_sticks_of_a_station_leave_the_setpoints_of_a_program() -> None:
    async with world(speed=1.0, clients=2) as w:
        await w.take_off()
        station, program = w.clients
        async with streaming(station, manual(), 0.04), streaming(program, attitude(pitch=-0.2)):
            await engage(program, "px4")
            await w.drone.wait_log(lambda e: e.name.endswith(".PCMD") and e.args["pitch"] > 20, 5.0)
            began = now()
            await asyncio.sleep(1.0)
            assert {stick(e)[1] > 20 for e in heard(w, "PCMD", since=began)} == {True}


async def test_setpoints_and_sticks_do_not_mix() -> None:
    """In mode Position a program's setpoints move nothing."""
    async with world(speed=1.0) as w:
        await w.take_off()
        await by_sticks(w, "px4")
        began = now()
        async with streaming(w.client, earth(0xDC7, 6, v=(3.0, 0.0, 0.0))):
            await asyncio.sleep(0.5)
        assert motion(w, began) == []

"""COM_RC_OVERRIDE: a joystick of PX4's clients takes the drone over, by what the drone received and flew."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, LAND_CMD, PX4_OFFBOARD, RTL, SET_MODE, goto, heard, return_by_itself
from support.missions import CORNERS, put, start
from support.params import write
from support.world import HOLD, LAND, POSITION, RETURN, World, world

from anafi_mav.units import quaternion_from_euler

TEXT = "Joystick override by system 255: Position"


class Joystick:
    """Streams its sticks 25 times a second, as a ground station does once it is enabled."""

    def __init__(self, w: World) -> None:
        self._w = w
        self.x = self.y = self.r = 0
        self.z = 500

    async def run(self) -> None:
        while True:
            message = dialect.MAVLink_manual_control_message(1, self.x, self.y, self.z, self.r, 0)
            self._w.client.send(message)
            await asyncio.sleep(0.04)


@asynccontextmanager
async def joystick(w: World, **sticks: int) -> AsyncIterator[Joystick]:
    """A joystick that has rested for a second, with sticks that were elsewhere from the beginning."""
    held = Joystick(w)
    for name, value in sticks.items():
        setattr(held, name, value)
    task = asyncio.ensure_future(held.run())
    try:
        await asyncio.sleep(1.0)
        yield held
    finally:
        task.cancel()
        await asyncio.wait([task])


def taken(w: World) -> bool:
    return any(m.text == TEXT for client in w.clients for _, m in client.since(0, "STATUSTEXT"))


async def overridden(w: World) -> None:
    """Every client gets the text and the mode."""
    for client in w.clients:
        await client.wait("STATUSTEXT", lambda m: m.text == TEXT, since=0)
        await client.heartbeat(lambda beat: beat.custom_mode == POSITION)


async def flies_right(w: World) -> None:
    await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["roll"] > 30)


async def set_out(w: World, way: str) -> None:
    """Have something fly that the override ends with its default."""
    if way == "mission":
        await put(w, CORNERS)
        await start(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 40.0)
        return
    await w.take_off(10.0)
    assert await goto(w, 100.0, 10.0) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 10.0, 20.0)
    if way == "return":
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
    elif way == "land":
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
    elif way == "orbit":
        assert (await w.client.command(dialect.MAV_CMD_DO_ORBIT, 8.0, 2.0)).result == ACCEPTED
    else:
        assert way == "goto"


@pytest.mark.parametrize("way", ["goto", "mission", "return", "land", "orbit"])
async def test_stick_acquires_control_from_a_clients_command(way: str) -> None:
    async with world(speed=1.0, web=True, clients=2) as w, joystick(w) as stick:
        await set_out(w, way)
        assert not taken(w)
        stick.y = 500
        await overridden(w)
        await flies_right(w)
        assert w.drone.flying_state.name in ("FLYING", "HOVERING")
        stick.y = 0
        await w.client.heartbeat(lambda beat: beat.custom_mode == POSITION)


@pytest.mark.parametrize("sticks", [{}, {"x": 1000}, {"z": 0}, {"z": 1000, "x": 90}])
async def test_joystick_on_the_table_does_nothing(sticks: dict[str, int]) -> None:
    async with world(speed=1.0) as w:
        async with joystick(w, **sticks):
            await set_out(w, "goto")
            await asyncio.sleep(3.0)
        assert not taken(w)
        assert heard(w, "CancelMoveTo") == []


async def test_throttle_alone_does_not_override_before_passing_the_middle() -> None:
    async with world(speed=1.0) as w, joystick(w, z=0) as stick:
        await set_out(w, "goto")
        began = w.drone.pose.up
        stick.z = 1000
        await asyncio.sleep(1.0)
        assert not taken(w)
        stick.z = 0
        await asyncio.sleep(1.0)
        stick.y = 500
        await overridden(w)
        await flies_right(w)
        await asyncio.sleep(1.0)
        assert {e.args["gaz"] for e in w.commands("ardrone3.Piloting.PCMD")} == {0}
        assert abs(w.drone.pose.up - began) < 1.0
        stick.z = 900
        await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["gaz"] > 50)


@pytest.mark.parametrize(
    ("bits", "way", "ends"),
    [(0, "goto", False), (2, "goto", False), (1, "offboard", False), (2, "offboard", True), (3, "offboard", True)],
)
async def test_override_bits_select_the_commands(bits: int, way: str, ends: bool) -> None:
    async with world(speed=1.0) as w:
        await write(w.client, "COM_RC_OVERRIDE", bits, dialect.MAV_PARAM_TYPE_INT32)
        program = await w.connect(sysid=250) if way == "offboard" else w.client

        async def stream() -> None:
            while True:
                rotation = list(quaternion_from_euler(0.0, -0.1, 0.0))
                program.send(dialect.MAVLink_set_attitude_target_message(0, 1, 1, 0b111, rotation, 0.0, 0.0, 0.0, 0.5))
                await asyncio.sleep(0.05)

        sender: asyncio.Task[Any] | None = None
        try:
            async with joystick(w) as stick:
                if way == "goto":
                    await set_out(w, way)
                else:
                    await w.take_off(8.0)
                    sender = asyncio.ensure_future(stream())
                    await asyncio.sleep(0.3)
                    assert (await program.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
                stick.y = 800
                await asyncio.sleep(1.5)
                assert taken(w) is ends
        finally:
            if sender is not None:
                sender.cancel()


async def test_return_of_the_drones_own_is_not_overridden() -> None:
    async with world(speed=1.0) as w:
        async with joystick(w) as stick:
            await set_out(w, "goto")
            return_by_itself(w)
            await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
            stick.y = 800
            await asyncio.sleep(2.0)
        assert not taken(w)
        assert heard(w, "abort") == []


async def test_joystick_of_an_ardupilot_client_does_not_take_over() -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        async with joystick(w) as stick:
            await set_out(w, "goto")
            stick.y = 800
            await asyncio.sleep(2.0)
        assert not taken(w)
        assert heard(w, "CancelMoveTo") == []


async def test_hovering_in_hold_is_not_overridden() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with joystick(w) as stick:
            stick.y = 800
            await asyncio.sleep(1.0)
        assert not taken(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)


async def test_joystick_takes_over_again_after_another_rest() -> None:
    async with world(speed=1.0) as w, joystick(w) as stick:
        await set_out(w, "goto")
        stick.y = 800
        await overridden(w)
        assert await goto(w, 150.0, 10.0) == ACCEPTED
        await asyncio.sleep(1.0)  # the stick is still deflected: no edge
        assert len(heard(w, "CancelMoveTo")) == 1
        stick.y = 0
        await asyncio.sleep(1.0)
        stick.x = 800
        await w.drone.wait_log(lambda e: len(heard(w, "CancelMoveTo")) == 2)


async def test_joystick_does_not_end_a_return_while_the_aircraft_is_the_pilots() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(10.0)
        assert await goto(w, 60.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 20.0, 20.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await write(w.client, "ANF_SC_OFFBOARD", 0, dialect.MAV_PARAM_TYPE_INT32)
        async with joystick(w) as held:
            held.x = 1000
            await asyncio.sleep(1.0)
        assert heard(w, "abort") == []
        assert w.drone.firmware.homing.active
        assert not taken(w)

"""No command is left without an answer: each MAV_CMD to the autopilot, and those that MAVSDK sends elsewhere."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.world import World, world

from anafi_mav.mavlink import dialect as newer

UNSUPPORTED, IN_PROGRESS = dialect.MAV_RESULT_UNSUPPORTED, dialect.MAV_RESULT_IN_PROGRESS
ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
WINCH, GRIPPER = dialect.MAV_CMD_DO_WINCH, dialect.MAV_CMD_DO_GRIPPER
CALIBRATE = dialect.MAV_CMD_PREFLIGHT_CALIBRATION

LAST = newer.MAV_CMD_ENUM_END
LASTING = {dialect.MAV_CMD_PREFLIGHT_CALIBRATION, dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN}
"""Played by tests of their own: with these parameters the one takes seconds, the other ends the link."""

COMMANDS = sorted(id for id in newer.enums["MAV_CMD"] if id < LAST and id not in LASTING)


async def finals(w: World, sent: Counter[int], mark: int) -> Counter[int]:
    """Wait until each command has its final answer; how many of them there are, by MAV_CMD."""

    def answered() -> Counter[int]:
        acks = [m for _, m in w.client.since(mark, "COMMAND_ACK") if m.result != IN_PROGRESS]
        return Counter(ack.command for ack in acks)

    while sent - answered():
        await w.client.wait("COMMAND_ACK", timeout=20.0)
    return answered()


@pytest.mark.parametrize("value", [math.nan, 0.0, 3.0])
@both
async def test_every_command_to_the_autopilot_is_answered_once(flavour: str, value: float) -> None:
    """On the ground, one after the other, so that none replaces the one before."""
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        for command in COMMANDS:
            since = w.client.mark()
            target = (1, 0) if command % 2 else (1, 1)
            w.client.send_command(command, value, value, value, value, x=value, y=value, z=value, target=target)
            await w.client.wait(
                "COMMAND_ACK",
                lambda m, command=command: m.command == command and m.result != IN_PROGRESS,
                since=since,
                timeout=20.0,
            )
        sent = Counter(COMMANDS)
        assert await finals(w, sent, mark) == sent
        assert w.drone.flying_state.name == "LANDED"


@both
async def test_winch_and_gripper_commands_are_unsupported(flavour: str) -> None:
    """MAVSDK sends DO_WINCH to the winch and believes an answer from there alone; DO_GRIPPER to every component."""
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        winch = dialect.MAV_COMP_ID_WINCH
        assert (await w.client.command(WINCH, 1, 0, target=(1, winch))).result == UNSUPPORTED
        assert (await w.client.command(WINCH, 1, 0, x=1.0, y=1.0, frame=0, target=(1, winch))).result == UNSUPPORTED
        acks: list[Any] = [m for _, m in w.client.since(mark, "COMMAND_ACK")]
        assert [(m.get_srcSystem(), m.get_srcComponent(), m.command) for m in acks] == [(1, winch, WINCH)] * 2
        assert [(m.target_system, m.target_component) for m in acks] == [(255, 190)] * 2
        for target in ((1, 0), (1, 1)):
            for command in (WINCH, GRIPPER):
                ack = await w.client.command(command, 1, 0, target=target)
                assert (ack.result, ack.get_srcComponent()) == (UNSUPPORTED, 1)


async def test_commands_to_another_system_or_component_are_not_answered() -> None:
    async with world() as w:
        mark = w.client.mark()
        for target in ((2, 1), (2, 169), (0, 169), (1, 101), (1, 154)):
            w.client.send_command(WINCH, 1, 0, target=target)
        assert (await w.client.command(GRIPPER, 1, 0)).result == UNSUPPORTED  # all before it were read
        assert [m.command for _, m in w.client.since(mark, "COMMAND_ACK")] == [GRIPPER]


async def test_level_calibration_of_an_ardupilot_client_is_answered_once() -> None:
    async with world(flavour="ardupilot", speed=1.0) as w:
        mark = w.client.mark()
        level = {"x": 2.0, "y": 0.0, "z": 0.0}
        w.client.send_command(CALIBRATE, 0, 0, 0, 0, **level)
        w.client.send_command(CALIBRATE, 0, 0, 0, 0, **level)  # as a client that repeats does
        await w.client.wait("STATUSTEXT", lambda m: "calibration done" in m.text, since=mark, timeout=20.0)
        await w.client.heartbeat(lambda beat: True)
        answers = [m.result for _, m in w.client.since(mark, "COMMAND_ACK") if m.command == CALIBRATE]
        assert answers == [ACCEPTED]
        assert len(w.commands("gimbal.calibrate")) == 1

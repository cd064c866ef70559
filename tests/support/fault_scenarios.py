"""Trouble for a flight: bad air at a chosen moment, another controller's orders, a drone with a will of its own; and
what became of the commands meanwhile."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.messages import rth
from anafi_mav.arsdk.messages.rth import StateReason
from anafi_mav.sim.world.faults import Impairment
from support.mav import NAN, Client
from support.world import HOME, World

ACCEPTED, REJECTED, DENIED, FAILED, IN_PROGRESS, CANCELLED = 0, 1, 2, 4, 5, 6
ARM, TAKEOFF_CMD, LAND_CMD, RTL, GOTO, SET_MODE = (
    mav_enums.MAV_CMD_COMPONENT_ARM_DISARM,
    mav_enums.MAV_CMD_NAV_TAKEOFF,
    mav_enums.MAV_CMD_NAV_LAND,
    mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mav_enums.MAV_CMD_DO_REPOSITION,
    mav_enums.MAV_CMD_DO_SET_MODE,
)
PX4_HOLD = (1, 4, 3)
PX4_OFFBOARD = (1, 6, 0)


def results(client: Client, mark: int) -> list[tuple[int, int]]:
    """(command, final result) of every acknowledgement since a mark, in order."""
    acks = [message for _, message in client.since(mark, "COMMAND_ACK")]
    return [(ack.command, ack.result) for ack in acks if ack.result != IN_PROGRESS]


async def until(client: Client, mark: int, count: int, timeout: float = 10.0) -> list[tuple[int, int]]:
    """The first `count` final acknowledgements since a mark."""
    while len(results(client, mark)) < count:
        await client.wait("COMMAND_ACK", since=client.mark(), timeout=timeout)
    return results(client, mark)[:count]


async def watched(seconds: float) -> None:
    """A time in which something may not happen. There is no event of what does not."""
    await asyncio.sleep(seconds)


async def being_tried(client: Client, mark: int, command: int) -> None:
    """The gateway says that it is at it, and has no answer yet."""
    await client.wait("COMMAND_ACK", lambda m: (m.command, m.result) == (command, IN_PROGRESS), since=mark)


def now_mute(w: World, command: str, seconds: float) -> asyncio.Future[Any]:
    """From the moment the drone hears this command, the air is gone for a while: its answer comes late."""
    loop = asyncio.get_running_loop()

    def heard(entry: Any) -> bool:
        if (entry.kind, entry.name) != ("command", command):
            return False
        w.drone.faults.mute = True
        loop.call_later(seconds, setattr, w.drone.faults, "mute", False)
        return True

    return asyncio.ensure_future(w.drone.wait_log(heard, 10.0))


def on_command(w: World, command: str, do: Callable[[], Any]) -> asyncio.Future[Any]:
    """Do something in the moment in which the drone hears this command."""

    def heard(entry: Any) -> bool:
        if (entry.kind, entry.name) != ("command", command):
            return False
        do()
        return True

    return asyncio.ensure_future(w.drone.wait_log(heard, 10.0))


def return_by_itself(w: World) -> None:
    """The battery sends the drone home."""
    firmware = w.drone.firmware
    firmware.flight_plan.stop(hover=True)  # the firmware breaks a plan off before it returns
    assert firmware.homing.request(StateReason.LOW_BATTERY, firmware.pose, False)


def another_controller(w: World, message: Any) -> None:
    """Another controller, a Skycontroller's keys for instance, commands the drone."""
    w.drone.firmware.receive(message, asyncio.get_running_loop().time())


def heard(w: World, *names: str) -> list[str]:
    """Which of these commands the drone heard, by the last part of their names, in order."""
    all_names = [e.name.rpartition(".")[2] for e in w.drone.log if e.kind == "command"]
    return [name for name in all_names if name in names]


async def goto(w: World, north: float, height: float) -> int:
    place = geo.destination(*HOME[:2], north, 0.0)
    ack = await w.client.command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=height)
    return int(ack.result)


def deaf(w: World, seconds: float) -> None:
    """The drone hears nothing for a while, and goes on telling how it flies: the link looks alive."""
    w.drone.faults.up = Impairment(loss=1.0)
    asyncio.get_running_loop().call_later(seconds, setattr, w.drone.faults, "up", Impairment())


async def home_being_undone(w: World) -> None:
    """Begin to set the home; whatever replaces that has to wait for 5 s until it is undone."""
    w.drone.faults.unreported = frozenset({rth.PreferredHomeType.NAME})
    w.client.send_command(mav_enums.MAV_CMD_DO_SET_HOME, 0, frame=0, x=HOME[0], y=HOME[1], z=HOME[2])
    await w.drone.wait_log(lambda e: e.kind == "command" and e.name == rth.SetPreferredHomeType.NAME, 5.0)

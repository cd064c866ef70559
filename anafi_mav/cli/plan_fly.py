"""`anafi-mav plan fly`: uploads a plan to a vehicle, starts it and reports its progress.

Heartbeats leave from the same event loop. A terminal that is stopped (Ctrl-S) delays neither them nor Ctrl-C.
"""

from __future__ import annotations

import argparse
import asyncio
from typing import Any

from anafi_mav.cli import interrupts, plan_options
from anafi_mav.cli.ground_client import Ground, Texts, connected
from anafi_mav.cli.plan_link import give
from anafi_mav.cli.terminal import say_later
from anafi_mav.errors import AnafiMavError, LinkLost, PlanError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.plans import table
from anafi_mav.plans.plan import Plan

SILENCE = 10.0
"""s without a heartbeat after which a vehicle is no longer followed."""


class Ended(AnafiMavError):
    """The flight is over and the mission is not."""


def fly(arguments: argparse.Namespace) -> int:
    """Fly it. Raises `TransferRefused`, `CommandRejected`, `LinkLost` and `Ended`."""
    plan, sysid = plan_options.load(arguments), plan_options.sysid_of(arguments)
    if not plan.items:
        raise PlanError(arguments.file.name, "it has no mission: nothing to fly")
    interrupts.run(_fly(arguments, sysid, plan))
    return 0


async def _fly(arguments: argparse.Namespace, sysid: int | None, plan: Plan) -> None:
    async with connected(arguments.endpoint, sysid) as ground:
        await give(ground, plan, arguments.file.name)
        follower = MissionFollower(ground, plan)
        if not ground.heartbeat.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED:
            say_later("arming")
            await ground.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
        await ground.command(dialect.MAV_CMD_MISSION_START)
        follower.begin()
        say_later("begun; Ctrl-C ends this program, not the flight", "green")
        try:
            await follower.follow()
        except asyncio.CancelledError:
            say_later(f"the flight goes on without this program, at {follower.where()}", "yellow")
            raise


class MissionFollower:
    """Reads the mission progress that the vehicle reports, and prints it."""

    def __init__(self, ground: Ground, plan: Plan) -> None:
        self._ground = ground
        self._plan = plan
        self._first = int(ground.first_item_is_home)
        self._texts = Texts()
        self._current: int | None = None
        self._reached: set[int] = set()
        self._state = dialect.MISSION_STATE_UNKNOWN
        self._begun = False
        """False: reports may still be of an earlier mission."""
        self._armed = False
        self._heard = asyncio.get_running_loop().time()
        self._problem: AnafiMavError | None = None
        self._over = False
        ground.on_message = self._hear

    def where(self) -> str:
        """The item that is flown."""
        return "its beginning" if self._current is None else self._name(self._current)

    def begin(self) -> None:
        """The vehicle has accepted to fly it."""
        self._begun = True

    async def follow(self) -> None:
        """Until it is complete. Raises `Ended` and `LinkLost`."""
        while not self._over and self._problem is None:
            await self._ground.wait_for_update(1.0)
            if asyncio.get_running_loop().time() - self._heard > SILENCE:
                raise LinkLost(f"nothing heard of the vehicle for {SILENCE:g} s, at {self.where()}")
        if self._problem is not None:
            raise self._problem
        say_later("mission complete", "green")

    def _name(self, number: int) -> str:
        items = self._plan.items
        return f"item {number} {table.name_of(items[number].command)}" if number < len(items) else f"item {number}"

    def _hear(self, inbound: Inbound) -> None:
        message = inbound.message
        match message.get_msgId():
            case dialect.MAVLINK_MSG_ID_HEARTBEAT:
                self._beat(message)
            case dialect.MAVLINK_MSG_ID_MISSION_CURRENT:
                self._tell_current(message)
            case dialect.MAVLINK_MSG_ID_MISSION_ITEM_REACHED:
                self._tell_reached(message.seq - self._first)
            case dialect.MAVLINK_MSG_ID_STATUSTEXT:
                text = self._texts.add(message)
                if text:
                    severe = message.severity <= dialect.MAV_SEVERITY_WARNING
                    say_later(f"system {inbound.sysid}: {text}", "yellow" if severe else "")

    def _beat(self, message: Any) -> None:
        self._heard = asyncio.get_running_loop().time()
        armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        if self._armed and not armed and not self._over:
            self._problem = Ended(f"the flight is over and the mission is not: it was at {self.where()}")
        self._armed = armed

    def _tell_current(self, message: Any) -> None:
        number, state = message.seq - self._first, message.mission_state
        if state != self._state:
            if state == dialect.MISSION_STATE_PAUSED and self._begun:
                say_later(f"paused at {self._name(number)}: it resumes when a station commands it", "yellow")
            elif state == dialect.MISSION_STATE_ACTIVE and self._state == dialect.MISSION_STATE_PAUSED:
                say_later("goes on")
            self._state = state
        if number != self._current and 0 <= number < len(self._plan.items):
            self._current = number
            if state in (dialect.MISSION_STATE_ACTIVE, dialect.MISSION_STATE_UNKNOWN):
                say_later(f"at {self._name(number)}")
        if state == dialect.MISSION_STATE_COMPLETE and self._begun:
            self._over = True

    def _tell_reached(self, number: int) -> None:
        if number in self._reached:
            return
        self._reached.add(number)
        say_later(f"done: {self._name(number)}")
        # A vehicle without a state of the mission is watched to its last item.
        if self._state == dialect.MISSION_STATE_UNKNOWN and number == len(self._plan.items) - 1:
            self._over = True

"""`anafi-mav plan upload` when the last MISSION_ACK is lost: the plan is read back from the vehicle."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import Client
from support.world import loopback

from anafi_mav import mav_enums
from anafi_mav.cli.ground_client import Ground
from anafi_mav.cli.plan_link import TransferRefused, give
from anafi_mav.plans.plan import RELATIVE, WAYPOINT, Item, Plan, Point

HOME = Point(48.8789, 2.3677, 35.0)
OWN_HOME = (487000000, 23000000, 51.37)
"""x, y, z of the place where the vehicle stands."""

PLAN = Plan(
    (
        Item(mav_enums.MAV_CMD_NAV_TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 12.0)),
        Item(WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, 0.0, 48.8791, 2.3677, 12.34)),
    ),
    HOME,
)


@dataclass
class ArduCopter:
    """Stores a mission as ArduPilot does (AP_Mission), and never acknowledges one.

    Item 0 stays its own home. Heights are kept in whole cm, cut off.
    """

    client: Client
    lost: Sequence[int] = ()
    """Items that are stored with another place."""
    count: int = 0
    items: list[tuple[Any, ...]] = field(default_factory=list)
    is_over: bool = False
    """Set at the end of a test; the station's next heartbeat ends `run`."""

    def answer(self, message: Any) -> None:
        to = (message.get_srcSystem(), message.get_srcComponent())
        match message.get_type():
            case "MISSION_COUNT":
                self.count, self.items = message.count, []
                self._request(to)
            case "MISSION_ITEM_INT" if message.seq == len(self.items):
                m = message
                place = (*OWN_HOME[:2], OWN_HOME[2]) if m.seq == 0 else (m.x, m.y, int(m.z * 100.0) / 100.0)
                if m.seq in self.lost:
                    place = (m.x + 100, m.y, m.z)
                self.items.append((m.frame, m.command, 0, 1, m.param1, m.param2, m.param3, m.param4, *place, 0))
                self._request(to)
            case "MISSION_REQUEST_LIST":
                self.client.send(dialect.MAVLink_mission_count_message(*to, len(self.items), 0))
            case "MISSION_REQUEST_INT":
                fields = self.items[message.seq]
                self.client.send(dialect.MAVLink_mission_item_int_message(*to, message.seq, *fields))

    def _request(self, to: tuple[int, int]) -> None:
        if len(self.items) < self.count:
            self.client.send(dialect.MAVLink_mission_request_int_message(*to, len(self.items), 0))

    async def run(self) -> None:
        """Answer every message, with a heartbeat after each."""
        position = 0
        while not self.is_over:
            self.client.send(dialect.MAVLink_heartbeat_message(2, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, 81, 0, 3, 3))
            await self.client.wait(
                ("HEARTBEAT", "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT"),
                since=position,
                timeout=60.0,
            )
            while position < len(self.client.received):
                position += 1
                self.answer(self.client.received[position - 1][1])


async def upload(lost: Sequence[int] = ()) -> None:
    """Upload the plan to an ArduCopter of its own."""
    address = loopback()
    async with Ground(f"tcpin://{address}:5760") as ground:
        vehicle = ArduCopter(await Client(1, 1).connect(5760, address), lost)
        running = asyncio.create_task(vehicle.run())
        try:
            await ground.vehicle(1)
            await give(ground, PLAN, "flight.plan")
        finally:
            vehicle.is_over = True
            await running
            await vehicle.client.close()


async def test_plan_on_an_arducopter_is_confirmed_without_its_home(capsys: pytest.CaptureFixture[str]) -> None:
    await upload()
    assert "mission: 2 items on system 1; the acknowledgement was lost, they were read back" in capsys.readouterr().out


@pytest.mark.parametrize("seq", [1, 2])
async def test_plan_with_another_item_on_the_vehicle_is_not_confirmed(seq: int) -> None:
    with pytest.raises(TransferRefused, match="mission not taken: the vehicle has had everything"):
        await upload([seq])

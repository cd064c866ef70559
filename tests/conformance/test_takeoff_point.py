"""The take-off point, which all heights above sea level count from."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.world import HOME, World, world

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3

TEXT = "Take-off altitude inaccurate: GPS +-12 m"


async def report(w: World, event: Message) -> None:
    """Let the drone report this five times a second."""
    while w.drone.session is not None:
        w.drone.session.send(event)
        await asyncio.sleep(0.2)  # the drone's own rate


@pytest.mark.parametrize("accuracy", [5, 12])
async def test_takeoff_with_inaccurate_gps_altitude_is_reported(accuracy: int) -> None:
    async with world() as w:
        w.drone.faults.unreported = frozenset({ardrone3.GpsLocationChanged.NAME})
        reporting = asyncio.ensure_future(report(w, ardrone3.GpsLocationChanged(*HOME, 1, 1, accuracy)))
        await w.client.wait("GPS_RAW_INT", lambda m: m.v_acc == accuracy * 1000)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        ack = await w.client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        texts = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert (TEXT in texts) is (accuracy == 12)
        reporting.cancel()


async def test_rise_that_is_reported_late_does_not_raise_the_takeoff_point() -> None:
    async with world(speed=1.0) as w:
        w.drone.faults.late = {ardrone3.FlyingStateChanged.NAME: 2.0}
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        ack = await w.client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0, timeout=20.0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        above = await w.client.wait("GLOBAL_POSITION_INT", lambda m: m.relative_alt > 3000, timeout=20.0)
        assert above.alt - above.relative_alt == pytest.approx(1000.0 * HOME[2], abs=100.0)

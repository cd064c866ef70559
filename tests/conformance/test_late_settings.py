"""Answers to settings that arrive late or twice: what a client receives is what the simulated drone has."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support.ext_params import CHOICE, value_of, write
from support.sim_settings import sim_value
from support.world import HOME, world

from anafi_mav.arsdk.messages import camera, rth
from anafi_mav.mavlink import dialect

PREFER_ISO = 2.0
"""Of CAM_EXPMODE, an option of all models."""

SET_HOME, GLOBAL = stock.MAV_CMD_DO_SET_HOME, stock.MAV_FRAME_GLOBAL

LATE = 1.15
"""s, the latest event of the quirk `scramble`, and one retransmission."""


@pytest.mark.parametrize("model", ["4k", "usa"])
async def test_setting_whose_late_answer_follows_an_older_report_is_accepted(model: str) -> None:
    async with world(model=model) as w:
        older = next(
            event
            for event in w.drone.firmware.payload.cameras[0].settings_report()
            if isinstance(event, camera.ExposureSettings)
        )
        w.drone.faults.late = {camera.ExposureSettings.NAME: 0.2}
        w.drone.inject(older)
        w.drone.faults.late = {camera.ExposureSettings.NAME: LATE}
        ack = await write(w.client, "CAM_EXPMODE", PREFER_ISO, CHOICE)
        assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, PREFER_ISO)
        assert sim_value(w.drone, "CAM_EXPMODE") == PREFER_ISO


async def test_home_that_the_drone_reports_late_is_accepted() -> None:
    async with world() as w:
        await w.take_off()
        w.drone.faults.late = {rth.CustomLocation.NAME: LATE}
        north = HOME[0] + 1e-4
        ack = await w.client.command(SET_HOME, frame=GLOBAL, x=north, y=HOME[1], z=HOME[2])
        custom = w.drone.firmware.homing.custom
        assert custom is not None
        assert (ack.result, custom.latitude) == (stock.MAV_RESULT_ACCEPTED, pytest.approx(north, abs=1e-6))


async def test_exposure_lock_whose_report_is_lost_is_accepted() -> None:
    """The report is not acknowledged, so that a lost one is not sent again."""
    async with world(model="thermal") as w:
        w.drone.faults.unreported = frozenset({camera.Exposure.NAME})
        setting = asyncio.ensure_future(write(w.client, "CAM_AELOCK", 1.0, CHOICE))
        await w.drone.wait_log(lambda e: e.name == camera.LockExposure.NAME)
        w.drone.faults.unreported = frozenset()
        ack = await setting
        assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, 1.0)
        assert sim_value(w.drone, "CAM_AELOCK") == 1.0

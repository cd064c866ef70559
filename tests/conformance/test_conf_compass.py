"""ArduPilot's compass calibration: MAV_CMD_DO_START_MAG_CAL, DO_ACCEPT_MAG_CAL, DO_CANCEL_MAG_CAL."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.world import World, world

from anafi_mav.arsdk.messages import common

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
START = dialect.MAV_CMD_DO_START_MAG_CAL
ACCEPT = dialect.MAV_CMD_DO_ACCEPT_MAG_CAL
CANCEL = dialect.MAV_CMD_DO_CANCEL_MAG_CAL


def asked(w: World) -> list[int]:
    """The starts (1) and ends (0) of a calibration that the drone received."""
    return [entry.args["calibrate"] for entry in w.commands("common.Calibration.MagnetoCalibration")]


@both
async def test_compass_calibration_is_accepted_and_its_progress_reported(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        assert (await w.client.command(ACCEPT)).result == REJECTED
        assert (await w.client.command(START, 0, 1, 1, 0)).result == ACCEPTED
        assert asked(w) == [1]
        report = await w.client.wait("MAG_CAL_REPORT", since=mark, timeout=20.0)
        assert (report.compass_id, report.cal_mask, report.cal_status, report.autosaved) == (0, 1, 4, 1)
        progress = [m.completion_pct for _, m in w.client.since(mark, "MAG_CAL_PROGRESS")]
        assert sorted(set(progress)) == [0, 33, 66, 100]
        assert progress == sorted(progress)
        turns = [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "turn the drone" in m.text]
        assert [text.rpartition("drone ")[2] for text in turns] == [
            "about its long axis",
            "nose over tail",
            "about its vertical axis",
        ]
        assert (await w.client.command(ACCEPT)).result == ACCEPTED
        answers = [m.result for _, m in w.client.since(mark, "COMMAND_ACK") if m.command == START]
        assert answers == [ACCEPTED]


async def test_compass_calibration_is_cancelled_by_its_cancel_command() -> None:
    async with world(flavour="ardupilot") as w:
        assert (await w.client.command(CANCEL)).result == ACCEPTED  # nothing to cancel, as in ArduPilot
        mark = w.client.mark()
        assert (await w.client.command(START)).result == ACCEPTED
        assert (await w.client.command(ACCEPT)).result == REJECTED
        assert (await w.client.command(CANCEL)).result == ACCEPTED
        assert asked(w) == [1, 0]
        report = await w.client.wait("MAG_CAL_REPORT", since=mark)
        assert report.cal_status == dialect.MAG_CAL_NOT_STARTED
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Compass calibration cancelled", since=mark)
        assert (await w.client.command(ACCEPT)).result == REJECTED


async def test_repeated_start_of_a_compass_calibration_goes_on() -> None:
    """A client sends it again when the acknowledgement is lost."""
    async with world(flavour="ardupilot") as w:
        mark = w.client.mark()
        for _ in range(2):
            assert (await w.client.command(START)).result == ACCEPTED
        report = await w.client.wait("MAG_CAL_REPORT", since=mark, timeout=20.0)
        assert report.cal_status == dialect.MAG_CAL_SUCCESS
        assert asked(w) == [1]


async def test_compass_calibration_forbids_arming_until_it_is_ended() -> None:
    async with world(flavour="ardupilot", speed=1.0) as w:
        mark = w.client.mark()
        assert (await w.client.command(START)).result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == REJECTED
        zeros = {"x": 0.0, "y": 0.0, "z": 0.0}
        assert (await w.client.command(dialect.MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, **zeros)).result == ACCEPTED
        await w.client.wait("MAG_CAL_REPORT", since=mark)
        assert asked(w) == [1, 0]


@pytest.mark.parametrize("mask", [2, 256, -1, 0.5])
async def test_compass_calibration_of_another_compass_is_denied(mask: float) -> None:
    async with world(flavour="ardupilot") as w:
        assert (await w.client.command(START, mask)).result == DENIED
        assert asked(w) == []


async def test_compass_calibration_in_flight_is_refused() -> None:
    async with world(flavour="ardupilot") as w:
        await w.take_off(5.0)
        assert (await w.client.command(START)).result == REJECTED
        assert asked(w) == []


@both
@pytest.mark.parametrize("required", [True, False])
async def test_compass_calibration_that_another_controller_aborts_has_failed(flavour: str, required: bool) -> None:
    """The drone reports its end alike, and still requires a calibration, or has that of before."""
    async with world(flavour=flavour, speed=1.0) as w:
        mark = w.client.mark()
        if required:
            w.drone.faults.magneto_required = True
            await w.client.wait("STATUSTEXT", lambda m: m.text == "Magnetometer calibration required", since=mark)
        if flavour == "px4":
            ack = await w.client.command(dialect.MAV_CMD_PREFLIGHT_CALIBRATION, 0, 1, 0, 0, x=0.0, y=0.0, z=0.0)
        else:
            ack = await w.client.command(START)
        assert ack.result == ACCEPTED
        compass = w.drone.firmware.compass
        for report in compass.handle(common.MagnetoCalibration(0), 0.0) or ():
            w.drone.inject(report)
        await w.client.wait("STATUSTEXT", lambda m: "calibration failed: failed or aborted" in m.text, since=mark)
        assert not [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "calibration done" in m.text]
        assert compass.required is required
        if flavour == "ardupilot":
            report = await w.client.wait("MAG_CAL_REPORT", since=mark)
            assert report.cal_status == dialect.MAG_CAL_FAILED
            assert (await w.client.command(ACCEPT)).result == REJECTED

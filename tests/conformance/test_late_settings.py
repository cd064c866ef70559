"""Answers to settings that arrive late or twice: what a client receives is what the simulated drone has."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support.ext_params import CHOICE, value_of, write
from support.ext_params import send_set as send_write
from support.mav import CAMERA
from support.params import read as param_read
from support.params import send_set
from support.params import write as param_write
from support.sim_settings import sim_value
from support.world import HOME, world

from anafi_mav.arsdk.messages import ardrone3, camera, rth
from anafi_mav.arsdk.messages import thermal as thermal_messages
from anafi_mav.arsdk.messages.proto import camera2
from anafi_mav.arsdk.messages.thermal import ThermalMode
from anafi_mav.mavlink import dialect

PREFER_ISO = 2.0
"""Of CAM_EXPMODE, an option of all models."""

REAL32, INT8 = stock.MAV_PARAM_TYPE_REAL32, stock.MAV_PARAM_TYPE_INT8
CIRCLE = 2
"""Bit of FENCE_TYPE."""
SET_HOME, GLOBAL = stock.MAV_CMD_DO_SET_HOME, stock.MAV_FRAME_GLOBAL
SET_CAMERA_MODE = stock.MAV_CMD_SET_CAMERA_MODE

LATE = 1.15
"""s, the latest event of the quirk `scramble`, and one retransmission."""


def reports(name: str, value: float, message: Any) -> bool:
    """Return True for a PARAM_VALUE of this parameter with this value."""
    return bool(message.param_id == name and message.param_value == value)


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


async def test_parameter_that_its_client_repeats_does_not_undo_the_newer_one_of_another() -> None:
    """MAVSDK repeats PARAM_SET every 0.5 s until the value is reported."""
    async with world(clients=2) as w:
        first, second = w.clients
        w.drone.faults.late = {ardrone3.MaxAltitudeChanged.NAME: 0.8}
        send_set(first, "ANF_MAX_ALT", 66.0, REAL32)
        await w.drone.wait_log(lambda e: e.name == ardrone3.MaxAltitude.NAME)
        send_set(second, "ANF_MAX_ALT", 55.0, REAL32)
        send_set(first, "ANF_MAX_ALT", 66.0, REAL32)
        for client in w.clients:
            await client.wait("PARAM_VALUE", partial(reports, "ANF_MAX_ALT", 55.0), since=0)
        await param_write(first, "ANF_YAW_RATE", 30.0)
        assert [entry.args["current"] for entry in w.commands(ardrone3.MaxAltitude.NAME)] == [66.0, 55.0]


async def test_parameter_that_its_client_sets_back_while_two_writes_wait_is_set_back() -> None:
    async with world() as w:
        w.drone.faults.late = {ardrone3.MaxAltitudeChanged.NAME: 0.8}
        for value in (66.0, 70.0, 66.0):
            send_set(w.client, "ANF_MAX_ALT", value, REAL32)
            await param_write(w.client, "ANF_YAW_RATE", value / 2.0)  # the write before is under way
        place = 0
        for value in (70.0, 66.0):
            place = await w.client.place("PARAM_VALUE", partial(reports, "ANF_MAX_ALT", value), since=place)
        assert [entry.args["current"] for entry in w.commands(ardrone3.MaxAltitude.NAME)] == [66.0, 70.0, 66.0]


@pytest.mark.parametrize("mode", [ThermalMode.STANDARD, ThermalMode.BLENDED])
async def test_setting_after_a_thermal_mode_is_that_of_the_camera_at_work(mode: ThermalMode) -> None:
    async with world(model="thermal") as w:
        w.drone.faults.late = {camera.CameraStates.NAME: 0.8}
        for thermal in (mode, ThermalMode.DISABLED):
            ack = await write(w.client, "CAM_THERMAL", float(thermal), CHOICE)
            assert ack.param_result == dialect.PARAM_ACK_ACCEPTED
            ack = await write(w.client, "CAM_EV", 1.0, REAL32)
            assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, 1.0)
            assert sim_value(w.drone, "CAM_EV") == 1.0


async def test_setting_set_back_after_an_unreported_change_is_sent_to_the_drone() -> None:
    async with world() as w:
        w.drone.faults.unreported = frozenset({camera.EvCompensation.NAME})
        ack = await write(w.client, "CAM_EV", 1.0, REAL32)
        assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_FAILED, 0.0)
        w.drone.faults.unreported = frozenset()
        ack = await write(w.client, "CAM_EV", 0.0, REAL32)
        assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, 0.0)
        assert sim_value(w.drone, "CAM_EV") == 0.0


async def test_fence_type_set_back_after_an_unreported_change_is_sent_to_the_drone() -> None:
    async with world(flavour="ardupilot") as w:
        before = (await param_read(w.client, "FENCE_TYPE")).param_value
        w.drone.faults.unreported = frozenset({ardrone3.NoFlyOverMaxDistanceChanged.NAME})
        await param_write(w.client, "FENCE_TYPE", before + CIRCLE, INT8, "ardupilot", timeout=8.0)
        assert w.drone.firmware.settings["geofence"] == 1
        w.drone.faults.unreported = frozenset()
        answer = await param_write(w.client, "FENCE_TYPE", before, INT8, "ardupilot")
        assert (answer.param_value, w.drone.firmware.settings["geofence"]) == (before, 0)


async def test_camera_mode_set_back_after_an_unreported_change_is_sent_to_the_drone() -> None:
    async with world() as w:
        simulated = w.drone.firmware.payload.cameras[0]
        assert simulated.mode is camera.CameraCameraMode.RECORDING
        w.drone.faults.unreported = frozenset({camera.CameraMode.NAME})
        ack = await w.client.command(SET_CAMERA_MODE, 0, stock.CAMERA_MODE_IMAGE, target=(1, CAMERA))
        assert ack.result == stock.MAV_RESULT_FAILED
        w.drone.faults.unreported = frozenset()
        ack = await w.client.command(SET_CAMERA_MODE, 0, stock.CAMERA_MODE_VIDEO, target=(1, CAMERA))
        assert ack.result == stock.MAV_RESULT_ACCEPTED
        assert simulated.mode is camera.CameraCameraMode.RECORDING


async def test_setting_after_a_change_between_thermal_modes_is_that_of_the_camera_at_work() -> None:
    """The pictures of each of the two modes are another camera's."""
    async with world(model="thermal") as w:
        ack = await write(w.client, "CAM_THERMAL", float(ThermalMode.STANDARD), CHOICE)
        assert ack.param_result == dialect.PARAM_ACK_ACCEPTED
        for mode in (ThermalMode.BLENDED, ThermalMode.STANDARD):
            w.drone.faults.late = {camera.CameraStates.NAME: 0.8}
            ack = await write(w.client, "CAM_THERMAL", float(mode), CHOICE)
            assert ack.param_result == dialect.PARAM_ACK_ACCEPTED
            ack = await write(w.client, "CAM_EV", 1.0, REAL32)
            assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, 1.0)
            assert sim_value(w.drone, "CAM_EV") == 1.0


SET_SOURCE, DIGICAM = stock.MAV_CMD_SET_CAMERA_SOURCE, stock.MAV_CMD_DO_DIGICAM_CONTROL


async def test_camera_source_of_before_is_shown_after_a_change_that_is_not_reported_yet() -> None:
    async with world(model="thermal", clients=2) as w:
        first, second = w.clients
        w.drone.faults.late = {thermal_messages.Mode.NAME: 0.8}
        send_write(first, "CAM_THERMAL", float(ThermalMode.BLENDED), CHOICE)
        await w.drone.wait_log(lambda e: e.name == thermal_messages.SetMode.NAME)
        ack = await second.command(SET_SOURCE, 0, dialect.CAMERA_SOURCE_RGB, 0, target=(1, CAMERA))
        assert ack.result == stock.MAV_RESULT_ACCEPTED
        assert sim_value(w.drone, "CAM_THERMAL") == ThermalMode.DISABLED


async def test_thermal_mode_of_before_is_set_after_a_source_that_is_not_reported_yet() -> None:
    async with world(model="thermal", clients=2) as w:
        first, second = w.clients
        w.drone.faults.late = {thermal_messages.Mode.NAME: 0.8}
        first.send_command(SET_SOURCE, 0, dialect.CAMERA_SOURCE_IR, 0, target=(1, CAMERA))
        await w.drone.wait_log(lambda e: e.name == thermal_messages.SetMode.NAME)
        ack = await write(second, "CAM_THERMAL", float(ThermalMode.DISABLED), CHOICE)
        assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, ThermalMode.DISABLED)
        assert sim_value(w.drone, "CAM_THERMAL") == ThermalMode.DISABLED


async def test_photo_at_the_autopilot_enters_photo_mode_although_a_change_is_not_reported_yet() -> None:
    async with world(clients=2, web=True) as w:
        first, second = w.clients
        ack = await first.command(SET_CAMERA_MODE, 0, stock.CAMERA_MODE_IMAGE, target=(1, CAMERA))
        assert ack.result == stock.MAV_RESULT_ACCEPTED
        w.drone.faults.late = {camera.CameraMode.NAME: 0.8}
        first.send_command(SET_CAMERA_MODE, 0, stock.CAMERA_MODE_VIDEO, target=(1, CAMERA))
        await w.drone.wait_log(lambda e: len(w.commands(camera.SetCameraMode.NAME)) == 2)
        ack = await second.command(DIGICAM, x=1.0)
        assert ack.result == stock.MAV_RESULT_ACCEPTED
        assert w.drone.firmware.payload.cameras[0].mode is camera.CameraCameraMode.PHOTO


@pytest.mark.parametrize("is_mute", [False, True], ids=["unanswered", "without a link"])
async def test_text_about_a_setting_without_an_answer_is_one_statustext(is_mute: bool) -> None:
    async with world() as w:
        mark = w.client.mark()
        if is_mute:
            w.drone.faults.mute = True
        else:
            w.drone.faults.unreported = frozenset({ardrone3.MaxAltitudeChanged.NAME})
        send_set(w.client, "ANF_MAX_ALT", 66.0, REAL32)
        text = await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("ANF_MAX_ALT"), since=mark, timeout=8.0)
        why = "link lost" if is_mute else "no answer in 5 s"
        assert (text.text, text.id) == (f"ANF_MAX_ALT not set: {why}", 0)


async def test_text_about_a_command_without_an_answer_names_nothing_of_parrot() -> None:
    async with world() as w:
        w.drone.faults.unreported = frozenset({camera.CameraMode.NAME})
        mark = w.client.mark()
        ack = await w.client.command(SET_CAMERA_MODE, 0, stock.CAMERA_MODE_IMAGE, target=(1, CAMERA))
        assert ack.result == stock.MAV_RESULT_FAILED
        texts = [message.text for _, message in w.client.since(mark, "STATUSTEXT")]
        assert "Command failed: no answer in 5 s" in texts


@pytest.mark.parametrize(
    ("model", "command", "report"),
    [
        ("4k", camera.SetEvCompensation.NAME, camera.EvCompensation.NAME),
        ("ai", camera2.Configure.NAME, camera2.State.NAME),
    ],
)
async def test_camera_setting_whose_report_is_absent_is_requested(model: str, command: str, report: str) -> None:
    async with world(model=model) as w:
        w.drone.faults.unreported = frozenset({report})
        setting = asyncio.ensure_future(write(w.client, "CAM_EV", 1.0, REAL32))
        await w.drone.wait_log(lambda e: e.name == command)
        w.drone.faults.unreported = frozenset()
        ack = await setting
        assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, 1.0)


async def test_parameter_whose_report_is_absent_is_requested() -> None:
    async with world() as w:
        w.drone.faults.unreported = frozenset({ardrone3.MaxAltitudeChanged.NAME})
        setting = asyncio.ensure_future(param_write(w.client, "ANF_MAX_ALT", 66.0, REAL32, timeout=8.0))
        await w.drone.wait_log(lambda e: e.name == ardrone3.MaxAltitude.NAME)
        w.drone.faults.unreported = frozenset()
        assert (await setting).param_value == 66.0
        assert not [m.text for _, m in w.client.since(0, "STATUSTEXT") if "not set" in m.text]

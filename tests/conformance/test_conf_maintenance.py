"""What is done on the ground: conformance items 129, 130, 148, launch by hand, and the two calibrations."""

from __future__ import annotations

import itertools
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.mav import Client
from support.world import ARMED, World, world

from anafi_mav.mavlink import dialect as newer

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
REJECTED, CANCELLED = dialect.MAV_RESULT_TEMPORARILY_REJECTED, 6
IN_PROGRESS = dialect.MAV_RESULT_IN_PROGRESS
CALIBRATE = dialect.MAV_CMD_PREFLIGHT_CALIBRATION
REBOOT = dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
ARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
MAGNETOMETER = {"x": 0.0, "y": 0.0, "z": 0.0}


def texts(w: World, mark: int) -> list[str]:
    return [m.text for _, m in w.client.since(mark, "STATUSTEXT") if m.text.startswith("[cal]")]


@both
async def test_conf_130_the_magnetometer(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        assert (await w.client.command(CALIBRATE, 0, 1, 0, 0, **MAGNETOMETER)).result == ACCEPTED
        await w.client.wait("STATUSTEXT", lambda m: m.text == "[cal] calibration done: mag", since=mark, timeout=20.0)
        said = texts(w, mark)
        assert said[0] == "[cal] calibration started: 2 mag"
        assert said[-1] == "[cal] calibration done: mag"
        assert [t for t in said if "progress" in t] == [f"[cal] progress <{n}>" for n in (0, 33, 66, 100)]
        assert [t[6:].split(":")[0] for t in said if "turn it" in t] == ["roll", "pitch", "yaw"]


@both
async def test_conf_130_the_gimbal(flavour: str) -> None:
    """PX4 accepts the start of a calibration, ArduPilot its end. Each answers once."""
    async with world(flavour=flavour) as w:
        mark, done = w.client.mark(), "[cal] calibration done: level"
        assert (await w.client.command(CALIBRATE, 0, 0, 0, 0, x=2.0, y=0.0, z=0.0, timeout=20.0)).result == ACCEPTED
        assert (texts(w, mark)[-1] == done) is (flavour == "ardupilot")
        await w.client.wait("STATUSTEXT", lambda m: m.text == done, since=mark, timeout=20.0)
        assert len(w.commands("gimbal.calibrate")) == 1
        assert [m.result for _, m in w.client.since(mark, "COMMAND_ACK")] == [ACCEPTED]
        ask = dialect.MAV_CMD_GIMBAL_REQUEST_AXIS_CALIBRATION
        mark = w.client.mark()
        assert (await w.client.command(ask, timeout=20.0)).result == ACCEPTED
        assert texts(w, mark)[-1] == done
        assert len(w.commands("gimbal.calibrate")) == 2


@pytest.mark.parametrize("numbers", [(1, 0, 0, 0), (0, 0, 1, 0), (0, 1, 1, 0), (0, math.inf, 0, 0)])
async def test_conf_130_calibration_of_unsupported_sensors_is_refused(numbers: tuple[float, ...]) -> None:
    async with world() as w:
        assert (await w.client.command(CALIBRATE, *numbers, **MAGNETOMETER)).result == DENIED


async def test_conf_130_not_in_flight() -> None:
    async with world() as w:
        await w.take_off()
        assert (await w.client.command(CALIBRATE, 0, 1, 0, 0, **MAGNETOMETER)).result == REJECTED
        assert (await w.client.command(REBOOT, 1)).result == REJECTED
        assert w.commands("common.Calibration.MagnetoCalibration") == []
        assert w.commands("common.Common.Reboot") == []


async def cancel(client: Client, mark: int) -> None:
    """Cancel the calibration that began after a mark: the text follows the acknowledgement."""
    cancelled = client.mark()
    client.send_command(CALIBRATE, 0, 0, 0, 0, **MAGNETOMETER)
    ack = await client.place("COMMAND_ACK", lambda m: m.command == CALIBRATE, since=cancelled)
    assert client.received[ack][1].result == ACCEPTED
    text = await client.place("STATUSTEXT", lambda m: m.text == "[cal] calibration cancelled", since=mark)
    assert ack < text  # MAVSDK hangs when the text arrives first


async def test_conf_129_calibration_of_the_compass_is_cancelled() -> None:
    """QGroundControl and MAVSDK cancel by the same command, and send it once the first one is answered."""
    async with world() as w:
        mark = w.client.mark()
        assert (await w.client.command(CALIBRATE, 0, 1, 0, 0, **MAGNETOMETER)).result == ACCEPTED
        await w.client.wait("STATUSTEXT", lambda m: "turn it" in m.text, since=mark)
        await cancel(w.client, mark)
        asked = "common.Calibration.MagnetoCalibration"
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == asked and e.args["calibrate"] == 0)


async def test_refused_calibration_is_no_failure_of_another_clients() -> None:
    async with world() as w:
        other = await w.connect(sysid=250)
        mark, failed = w.client.mark(), "[cal] calibration failed: only compass and gimbal"
        assert (await w.client.command(CALIBRATE, 0, 1, 0, 0, **MAGNETOMETER)).result == ACCEPTED
        refused = other.mark()
        assert (await other.command(CALIBRATE, 1, 0, 0, 0, **MAGNETOMETER)).result == DENIED
        await other.wait("STATUSTEXT", lambda m: m.text == failed, since=refused)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "[cal] calibration done: mag", since=mark, timeout=20.0)
        assert failed not in texts(w, mark)


async def test_repeated_calibration_of_the_compass_goes_on() -> None:
    """MAVSDK sends it again when the acknowledgement is lost."""
    async with world() as w:
        mark = w.client.mark()
        for _ in range(2):
            assert (await w.client.command(CALIBRATE, 0, 1, 0, 0, **MAGNETOMETER)).result == ACCEPTED
        await w.client.wait("STATUSTEXT", lambda m: m.text == "[cal] calibration done: mag", since=mark, timeout=20.0)
        assert len(w.commands("common.Calibration.MagnetoCalibration")) == 1
        assert "[cal] calibration cancelled" not in texts(w, mark)


@pytest.mark.parametrize(("magnetometer", "horizon"), [(1, 0.0), (0, 2.0)])
async def test_link_lost_in_an_accepted_calibration_is_reported_once(magnetometer: int, horizon: float) -> None:
    async with world(speed=1.0) as w:
        mark = w.client.mark()
        ack = await w.client.command(CALIBRATE, 0, magnetometer, 0, 0, x=horizon, y=0.0, z=0.0)
        assert ack.result == ACCEPTED
        assert w.drone.session is not None
        w.drone.session.end("closed")
        await w.client.wait("STATUSTEXT", lambda m: m.text == "[cal] calibration failed: link lost", since=mark)
        await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert [text for text in said if "failed" in text] == ["[cal] calibration failed: link lost"]


@pytest.mark.parametrize("way", ["COMMAND_CANCEL", "zeros"])
async def test_conf_129_calibration_of_the_gimbal_is_cancelled(way: str) -> None:
    async with world(flavour="ardupilot") as w:
        mark = w.client.mark()
        w.client.send_command(CALIBRATE, 0, 0, 0, 0, x=2.0, y=0.0, z=0.0)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "[cal] calibration started: 2 level", since=mark)
        if way == "COMMAND_CANCEL":
            w.client.send(newer.MAVLink_command_cancel_message(1, 1, CALIBRATE))
        else:
            w.client.send_command(CALIBRATE, 0, 0, 0, 0, **MAGNETOMETER)
        await w.client.wait("COMMAND_ACK", lambda m: (m.command, m.result) == (CALIBRATE, CANCELLED), since=mark)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "[cal] calibration cancelled", since=mark)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == "gimbal.cancel_calibration")


async def test_conf_129_calibration_of_the_gimbal_is_cancelled_by_px4_clients() -> None:
    """As that of the compass: the command that cancels has the same number, and is sent after the first answer."""
    async with world() as w:
        mark = w.client.mark()
        assert (await w.client.command(CALIBRATE, 0, 0, 0, 0, x=2.0, y=0.0, z=0.0)).result == ACCEPTED
        assert len(w.commands("gimbal.calibrate")) == 1
        await cancel(w.client, mark)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == "gimbal.cancel_calibration")


@both
async def test_conf_148_reboot(flavour: str) -> None:
    """Accepted once, within dronekit's half a second, then silence, then a vehicle that identifies itself again."""
    async with world(flavour=flavour, speed=1.0) as w:
        for wrong in (2, 3, 0, math.nan):
            assert (await w.client.command(REBOOT, wrong)).result == DENIED
        mark = w.client.mark()
        assert (await w.client.command(REBOOT, 1)).result == ACCEPTED
        assert len(w.commands("common.Common.Reboot")) == 1
        w.simulator.speed = 3.0
        power = await w.drone.wait_log(lambda e: e.name == "power", 20.0)
        assert power.args["on"] is False
        await w.drone.wait_log(lambda e: e.name == "power" and e.args["on"], 40.0)
        silent = w.client.mark()
        beat = await w.client.heartbeat(lambda beat: True, since=silent, timeout=40.0)
        assert not beat.base_mode & ARMED
        beats = [at for at, _ in w.client.since(0, "HEARTBEAT")]
        assert max(after - before for before, after in itertools.pairwise(beats)) > 1.5  # regular ones were missing
        assert [m.result for _, m in w.client.since(mark, "COMMAND_ACK") if m.command == REBOOT] == [ACCEPTED]
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
        await w.client.wait("AUTOPILOT_VERSION", since=mark)


async def test_a_launch_by_hand() -> None:
    async with world() as w:
        mark = w.client.mark()
        one = 1.401298464324817e-45  # the float whose bits are the INT32 1
        w.client.send(dialect.MAVLink_param_set_message(1, 1, b"ANF_HAND_LAUNCH", one, dialect.MAV_PARAM_TYPE_INT32))
        await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_HAND_LAUNCH", since=mark)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert w.drone.flying_state.name == "USERTAKEOFF"
        await w.client.heartbeat(lambda beat: beat.base_mode & ARMED)
        assert (await w.client.command(ARM, 0)).result == ACCEPTED
        assert w.drone.flying_state.name == "LANDED"
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.throw()
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)


async def test_end_of_a_calibration_in_the_air_disturbs_no_orbit() -> None:
    """MAVSDK's cancel of a calibration; in the air none can run."""
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        circling = 0x01030000
        assert (await w.client.command(dialect.MAV_CMD_DO_ORBIT, 8.0, 3.0)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == circling)
        none = dialect.MAV_CMD_PREFLIGHT_CALIBRATION
        assert (await w.client.command(none, 0, 0, 0, 0, x=0.0, y=0.0, z=0.0)).result == ACCEPTED
        mark = w.client.mark()
        for _ in range(3):
            await w.client.wait("HEARTBEAT")
        assert {beat.custom_mode for _, beat in w.client.since(mark, "HEARTBEAT")} == {circling}

"""Unmodified MAVSDK: action and calibration (conformance B2, 116)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.product import program
from support.world import world

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_action.py")


async def test_conf_116_mavsdk_action_and_calibration() -> None:
    async with (
        world(speed=2.0) as w,
        program(sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760") as script,
    ):
        await script.line(lambda line: line == "up", timeout=90.0)
        assert [line.split()[1:3] for line in script.lines[:3]] == [
            ["magnetometer", "SUCCESS"],
            ["horizon", "SUCCESS"],
            ["gyro", "FAILED"],
        ]
        assert "[100]" in script.lines[0]
        assert len(w.commands("gimbal.calibrate")) == 1
        asked = [entry.args["calibrate"] for entry in w.commands("common.Calibration.MagnetoCalibration")]
        assert asked == [1]
        assert script.lines[3] == "altitudes 6.0 25.0"
        assert w.commands("rth.set_min_altitude")[-1].args == {"altitude": 25.0}
        await script.line(lambda line: line == "there", timeout=60.0)
        assert [line for line in script.lines if line.startswith("tried")] == [
            "tried disarm COMMAND_DENIED",
            "tried kill COMMAND_DENIED",
            "tried terminate COMMAND_DENIED",
            "tried reboot COMMAND_DENIED",
            "tried set_actuator UNSUPPORTED",
        ]
        assert w.commands("ardrone3.Piloting.Emergency") == []
        move = w.commands("move.extended_move_to")[-1].args
        assert (move["altitude"], move["max_horizontal_speed"]) == (pytest.approx(9.0, abs=0.05), 5.0)
        await script.line(lambda line: line == "home set", timeout=30.0)
        assert len(w.commands("rth.set_custom_location")) == 1
        await script.line(lambda line: line == "returning", timeout=30.0)
        assert len(w.commands("rth.return_to_home")) == 1
        await script.line(lambda line: line == "landed", timeout=60.0)
        assert w.drone.flying_state.name == "LANDED"

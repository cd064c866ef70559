"""Parrot's Olympe does everything at the simulated models, directly and through a Skycontroller, in one connection.

The default run takes a pairwise selection of model, controller and version (`olympe.SELECTED`), `full` every one.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support import olympe
from support.check_controller import check_controller
from support.check_flight import check_flight
from support.check_look import check_look
from support.check_payload import BROKEN, check_payload
from support.check_plan import check_plan

SPEED = "5"
"""Simulated seconds per second."""

HARMLESS = {
    r"olympe\.flightplan - step - |Traceback \(most recent call last\)": "what BROKEN is about; they are counted",
}
"""Lines at WARNING and above that Olympe writes without the drone's fault."""

UNHEARD = {
    "c1671000050000008201020801": "arsdk.microhard.Command.GetState, said to every Skycontroller: the radio of another",
}
"""Payloads of the commands of Olympe that are nothing to the simulated aircraft and controllers."""

pytestmark = [pytest.mark.third_party, olympe.needed]


@pytest.mark.parametrize("on", olympe.combinations("visit"))
async def test_olympe_does_everything(on: olympe.Combination, tmp_path: Path) -> None:
    _, model, kind, version = on
    # The telemetry is as frequent as the simulator logs where the drone is.
    options = ("--speed", SPEED, "--telemetry-rate", "10")
    report, err, log = await olympe.visit("olympe_visit.py", on, tmp_path, timeout=200.0, options=options)

    assert olympe.failed(report["connection"]["steps"]) == {}
    assert olympe.failed(report["end"]["steps"]) == {}
    # Nor did Olympe say anything that the simulator has no word for: such a command is logged by its numbers.
    unheard = {entry["args"]["payload"] for entry in log if entry["kind"] == "command" and entry["name"][0].isdigit()}
    assert unheard <= (set() if kind == "Drone" else set(UNHEARD)), unheard
    assert next(entry["args"]["version"] for entry in log if entry["kind"] == "session") == version

    if kind == "Drone":
        check_flight(report["flight"], model, log)
    else:
        check_controller(report["controller"], kind, model, log)
    # Without the right to listen on 554 no one looks through a Skycontroller 3.
    if kind != "SkyController3" or olympe.rtsp_of_a_skycontroller_3():
        check_look(report["look"], model, log)
    check_payload(report["payload"], model, tmp_path / "downloads", log)
    check_plan(report["plan"], log)

    observed = olympe.complaints(err, olympe.HARMLESS_WITH_VIDEO, HARMLESS)
    assert not observed, err
    assert err.count("Traceback") == err.count(BROKEN)

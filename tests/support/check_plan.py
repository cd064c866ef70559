"""The flight plan of `olympe_plan.py`, judged by the simulator's own log."""

from __future__ import annotations

from typing import Any

import pytest

from support.olympe import during, failed


def check_plan(report: dict[str, Any], log: list[dict[str, Any]]) -> None:
    """It was played, paused and ended."""
    assert failed(report["steps"]) == {}
    log = during(log, report)
    executed = [e["args"]["idx"] for e in log if e["kind"] == "event" and e["name"].endswith("MissionItemExecuted")]
    assert executed[:8] == list(range(8))
    north = max(entry["args"]["north"] for entry in log if entry["kind"] == "pose")
    assert north == pytest.approx(20.0, abs=1.5)  # 0.00018 deg of latitude
    done = [entry["args"]["command"] for entry in log if entry["kind"] == "plan" and entry["name"] == "payload"]
    assert [name.rpartition(".")[2] for name in done[:3]] == ["set_camera_mode", "start_recording", "stop_recording"]

"""The flight of `olympe_flight.py`, judged by the simulator's own log."""

from __future__ import annotations

import itertools
import math
import re
from typing import Any

import pytest

from anafi_mav import geo
from anafi_mav.arsdk.messages.ardrone3 import MoveToStatus
from support.olympe import failed
from support.world import HOME

FAILS = {
    "beyond the range": "the drone takes MaxTilt(60) to 40, as the aircraft does, and Olympe waits for the 60 it sent",
}
"""Steps whose expectation is not met, and why that is right."""

TITLES = {"4k": "ANAFI", "thermal": "ANAFI-Thermal", "usa": "ANAFI-USA", "ai": "ANAFI-Ai"}


class Record:
    """What Olympe reported and what the simulator logged, on one clock."""

    def __init__(self, report: dict[str, Any], log: list[dict[str, Any]]) -> None:
        self.report = report
        self.steps: dict[str, dict[str, Any]] = report["steps"]
        self.log = log
        self.poses = [entry for entry in log if entry["kind"] == "pose"]

    def pose(self, step: str, end: str) -> dict[str, float]:
        """The true pose when a step began ("from") or just after it ended ("to")."""
        instant = self.steps[step][end]
        if end == "from":
            pose: dict[str, float] = [entry["args"] for entry in self.poses if entry["t"] <= instant][-1]
        else:
            pose = next(entry["args"] for entry in self.poses if entry["t"] >= instant)
        return pose

    def flown(self, step: str) -> tuple[float, float, float, float]:
        """North, east, up in m and the turn in rad of a step."""
        before, after = self.pose(step, "from"), self.pose(step, "to")
        yaws = [entry["args"]["yaw"] for entry in self.during(step) if entry["kind"] == "pose"]
        turns = itertools.pairwise([before["yaw"], *yaws, after["yaw"]])
        return (
            after["north"] - before["north"],
            after["east"] - before["east"],
            after["up"] - before["up"],
            sum(math.remainder(two - one, math.tau) for one, two in turns),
        )

    def fastest(self, step: str, axis: str) -> float:
        """The greatest rate of a coordinate, m/s or rad/s of the simulation's own time."""
        poses = [entry["args"] for entry in self.during(step) if entry["kind"] == "pose"]
        rates = [
            math.remainder(after[axis] - before[axis], math.tau) / (after["time"] - before["time"])
            for before, after in itertools.pairwise(poses)
        ]
        return max(rates)

    def during(self, step: str) -> list[dict[str, Any]]:
        first, last = self.steps[step]["from"], self.steps[step]["to"]
        return [entry for entry in self.log if first <= entry["t"] <= last]


def check_flight(report: dict[str, Any], model: str, log: list[dict[str, Any]]) -> None:
    """It flew as it was commanded."""
    record = Record(report, log)
    assert set(observed := failed(record.steps)) == set(FAILS), observed
    check_what_olympe_knows(report, model)
    check_moves(record)
    check_sticks(record)
    check_return(record)


def check_what_olympe_knows(report: dict[str, Any], model: str) -> None:
    assert not (missing := report["missing"]), missing
    known = report["known"]
    serial = known["serial_high"]["high"] + known["serial_low"]["low"]
    assert re.fullmatch(r"PI0404[0-9A-Z]{6}\d{6}", serial)
    assert known["name"] == {"name": f"{TITLES[model]}-{serial[-7:]}"}
    assert 95 <= known["battery"]["percent"] <= 100  # full, and some simulated minutes on the ground
    assert known["fix"] == {"fixed": 1}
    assert known["satellites"]["numberOfSatellite"] >= 10
    assert known["flying"] == {"state": "landed"}
    assert known["tilt"] == {"current": 10.0, "min": 1.0, "max": 40.0}
    # Parrot's "not known", until the take-off.
    assert known["home"] == {"latitude": 500.0, "longitude": 500.0, "altitude": 500.0}
    assert report["clamped"] == {"current": 40.0, "min": 1.0, "max": 40.0}
    assert report["home"] == pytest.approx({"latitude": HOME[0], "longitude": HOME[1], "altitude": 0.0}, abs=1e-7)
    assert report["flights"]["nbFlights"] == 1


def check_moves(record: Record) -> None:
    assert record.pose("take off", "to")["up"] == pytest.approx(1.0, abs=0.1)
    # Heading north, so front is north; the move's third number is down.
    assert record.flown("moveBy") == pytest.approx((5.0, 0.0, 1.0, 0.0), abs=0.15)
    assert_moved_by(record.report["moveBy"], (5.0, 0.0, -1.0, 0.0))

    latitude, longitude, height = record.report["target"]
    assert math.hypot(*geo.offset(HOME[0], HOME[1], latitude, longitude)) == pytest.approx(15.0, abs=0.1)
    arrived = record.pose("moveTo", "to")
    assert math.hypot(*geo.offset(arrived["lat"], arrived["lon"], latitude, longitude)) < 0.5
    assert arrived["up"] == pytest.approx(height, abs=0.3)
    # The nose was turned to where the target lay, about from (5, 0) to (9, 12).
    began = record.pose("moveTo", "from")
    north, east = geo.offset(began["lat"], began["lon"], latitude, longitude)
    assert math.degrees(arrived["yaw"]) == pytest.approx(math.degrees(math.atan2(east, north)), abs=3.0)
    assert math.degrees(math.atan2(12.0, 4.0)) == pytest.approx(math.degrees(arrived["yaw"]), abs=5.0)

    back = record.pose("extended_move_to", "to")
    assert math.hypot(*geo.offset(back["lat"], back["lon"], HOME[0], HOME[1])) < 0.5
    assert (back["up"], math.degrees(back["yaw"])) == pytest.approx((4.0, 90.0), abs=2.0)
    fastest = max(
        math.hypot(entry["args"]["vn"], entry["args"]["ve"])
        for entry in record.during("extended_move_to")
        if entry["kind"] == "pose"
    )
    assert fastest < 4.3

    # Heading east now: front is east, right is south.
    assert record.flown("extended_move_by") == pytest.approx((-2.0, 4.0, 1.0, math.pi / 2), abs=0.15)
    assert_moved_by(record.report["extended_move_by"], (4.0, 2.0, -1.0, math.pi / 2))
    # It was commanded to go 60 m.
    assert 1.0 < record.pose("cancel", "to")["north"] - record.pose("far", "from")["north"] < 30.0
    ends = [entry["args"]["status"] for entry in record.during("cancel") if entry["name"].endswith(".moveToChanged")]
    assert ends == [MoveToStatus.CANCELED]


def assert_moved_by(end: dict[str, Any], wanted: tuple[float, float, float, float]) -> None:
    assert end["error"] == "ok"
    assert [end[name] for name in ("dX", "dY", "dZ", "dPsi")] == pytest.approx(wanted, abs=0.1)


def check_sticks(record: Record) -> None:
    # Heading south: forward is south, right is west.
    north, east, up, turn = record.flown("forward")
    assert (north < -2.0, abs(east) < 0.3, abs(up) < 0.3, abs(turn) < 0.05) == (True,) * 4
    tilts = [entry["args"]["pitch"] for entry in record.during("forward") if entry["kind"] == "pose"]
    # Half of MaxTilt(20), nose down.
    assert math.degrees(min(tilts)) == pytest.approx(-10.0, abs=0.5)
    north, east, up, turn = record.flown("right")
    assert (abs(north) < 0.3, east < -2.0, abs(up) < 0.3, abs(turn) < 0.05) == (True,) * 4
    # Half of 90 degrees/s and half of 3 m/s, and no more when the sticks are back.
    north, east, up, turn = record.flown("clockwise")
    assert math.degrees(record.fastest("clockwise", "yaw")) == pytest.approx(45.0, rel=0.02)
    assert turn > 1.0
    assert max(abs(north), abs(east), abs(up)) < 0.3
    north, east, up, turn = record.flown("up")
    assert record.fastest("up", "up") == pytest.approx(1.5, rel=0.02)
    assert up > 2.0
    stopped = record.steps["stop_piloting"]["to"]
    assert [entry for entry in record.log if entry["name"].endswith(".PCMD") and entry["t"] > stopped + 0.05] == []


def check_return(record: Record) -> None:
    assert record.report["rth"] == {"state": "available", "reason": "finished"}
    heights = [entry["args"]["up"] for entry in record.during("NavigateHome") if entry["kind"] == "pose"]
    assert max(heights) == pytest.approx(max(25.0, record.pose("NavigateHome", "from")["up"]), abs=0.5)
    home = record.pose("NavigateHome", "to")
    assert (home["north"], home["east"], home["up"]) == pytest.approx((0.0, 0.0, 10.0), abs=0.5)
    assert record.pose("land", "to")["up"] == 0.0

"""The validation report: what it reads off a flight, worked out by hand; and the command as a process."""

from __future__ import annotations

import asyncio
import math
import re
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from anafi_mav.arsdk.video.video_metadata import FrameMetadata, Ned, Quaternion
from anafi_mav.cli import main, sim_validate
from anafi_mav.sim.validation import (
    Comparison,
    MeasuredTrack,
    at,
    climb_results,
    derivative,
    gimbal_results,
    passes,
    tilt_results,
    yaw_results,
)
from anafi_mav.sim.world.model import MODELS

ROOT = Path(__file__).parents[3]

RAMP = [(n / 10, n * 2.0) for n in range(-5, 91)]  # 20 a second


def by_name(results: object) -> dict[str, Comparison]:
    return {result.what: result for result in results}  # type: ignore[attr-defined]


def test_when_a_value_is_passed() -> None:
    assert passes(RAMP, 3.0) == pytest.approx(0.15)  # half way between 0.1 s and 0.2 s
    assert passes([(t, -v) for t, v in RAMP], -3.0) == pytest.approx(0.15)
    assert passes(RAMP, 1000.0) == math.inf
    assert passes([(0.3, 5.0)], 3.0) == 0.3


def test_the_value_at_a_time() -> None:
    assert at(RAMP, 1.05) == pytest.approx(21.0)
    assert at(RAMP, 100.0) == 180.0
    assert math.isnan(at([], 1.0))


def test_the_rate_over_a_window() -> None:
    rates = derivative(RAMP, 0.35)
    assert [rate for _, rate in rates] == pytest.approx([20.0] * len(rates))
    assert rates[-1][0] == pytest.approx(8.85)


def test_a_turn_is_counted_through() -> None:
    track = MeasuredTrack()
    track.attitude = [(n * 0.5, 0.0, 0.0, (n * math.pi / 2 + math.pi) % (2 * math.pi) - math.pi) for n in range(9)]
    assert [angle for _, angle in track.turned()] == pytest.approx([90.0 * n for n in range(9)])
    results = by_name(yaw_results(track, 0.1))
    assert results["yaw: one turn"].measured == pytest.approx(2.0)
    assert results["yaw: rate"].measured == pytest.approx(180.0)
    assert not results["yaw: rate"].agrees  # 200 were asked for


def test_metadata_of_a_picture_is_read() -> None:
    # Turned right by 90 deg, tilted right by 20; the camera looks along the heading, 176 deg up: over the top and back
    # down to 4 deg above the horizon behind. Quaternions as turns about down, right and forward, one after the other.
    half = math.radians(45.0)
    heading = np.array([math.cos(half), 0.0, 0.0, math.sin(half)])
    roll, pitch = math.radians(10.0), math.radians(88.0)
    track = MeasuredTrack()
    track.add(
        0.5,
        FrameMetadata(
            drone_quat=Quaternion(*turned(heading, [math.cos(roll), math.sin(roll), 0.0, 0.0])),
            quat=Quaternion(*turned(heading, [math.cos(pitch), 0.0, math.sin(pitch), 0.0])),
            speed=Ned(3.0, 4.0, -1.5),
            ground_distance=12.0,
        ),
    )
    assert track.roll() == [(0.5, pytest.approx(20.0))]
    assert track.attitude[0][3] == pytest.approx(math.pi / 2)
    assert track.gimbal[0][:2] == (0.5, pytest.approx(176.0))
    assert track.ground_speed() == [(0.5, 5.0)]
    assert track.climb() == [(0.5, 1.5)]
    assert track.height == [(0.5, 12.0)]
    # The camera 38 deg to the right, the drone level and to the north.
    roll = math.radians(19.0)
    level = Quaternion(1.0, 0.0, 0.0, 0.0)
    track.add(0.6, FrameMetadata(drone_quat=level, quat=Quaternion(math.cos(roll), math.sin(roll), 0.0, 0.0)))
    assert track.gimbal[1] == (0.6, pytest.approx(0.0), pytest.approx(38.0))
    track.add(0.7, FrameMetadata())
    assert len(track.attitude) == 2
    assert len(track.speed) == 1


def turned(first: Sequence[float], then: Sequence[float]) -> tuple[float, ...]:
    """The product of two quaternions."""
    a, b = np.asarray(first), np.asarray(then)
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return (float(a[0] * b[0] - a[1:] @ b[1:]), *map(float, vector))


def flight(speed: float, angle: float) -> MeasuredTrack:
    """A tilt to both sides, with this top speed."""
    track = MeasuredTrack()
    for n in range(91):
        t = n / 10
        sign = 1 if 0.5 < t < 2.2 else -1 if 2.7 < t < 4.2 else 0
        track.attitude.append((t, 0.0, -sign * math.radians(angle), 0.0))
        track.speed.append((t, 0.6 * speed * abs(sign), 0.8 * speed * abs(sign), -4.0 * sign))
        track.height.append((t, 30.0 + min(t, 2.0) * 3.5))
    return track


def test_validation_distinguishes_agreeing_and_deviating_flights() -> None:
    good = flight(8.5, 40.0)
    results = by_name(tilt_results("pitch", good.pitch(), good, 8.0))
    assert results["pitch: top speed"].measured == pytest.approx(8.5)
    assert all(result.agrees for result in results.values())
    slow = flight(7.9, 35.0)
    results = by_name(tilt_results("pitch", slow.pitch(), slow, 8.0))
    assert [name for name, result in results.items() if not result.agrees] == [
        "pitch reached",
        "pitch reached the other way",
        "pitch: top speed",
    ]


def test_a_climb() -> None:
    results = by_name(climb_results(flight(0.0, 0.0)))
    assert results["climb: height in 2 s"].measured == pytest.approx(7.0)
    # Nothing at 0.5 s, 4 m/s at 0.6 s: 0.1 m/s is passed after 0.5025 s, which is too late.
    assert results["climb: delay"].measured == pytest.approx(0.5025)
    assert not results["climb: delay"].agrees
    assert results["climb: speed up"].agrees


def test_a_gimbal() -> None:
    # 180 deg at 180 deg/s: a second.
    turn = [(n / 100, min(-90.0 + 1.8 * n, 90.0)) for n in range(200)]
    results = by_name(gimbal_results("pitch", turn, turn, (-90.0, 90.0), 180.0))
    assert results["gimbal pitch: position reached"].measured == 90.0
    assert results["gimbal pitch: limit to limit"].measured == pytest.approx(0.99)
    assert results["gimbal pitch: velocity"].measured == pytest.approx(180.0)
    assert all(result.agrees for result in results.values())


def test_nothing_heard_does_not_agree() -> None:
    results = [
        *tilt_results("roll", [], MeasuredTrack(), 10.0),
        *climb_results(MeasuredTrack()),
        *yaw_results(MeasuredTrack(), 0.2),
    ]
    assert not any(result.agrees for result in results)


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What the command prints to stderr when it refuses its arguments."""
    status = main(["sim", "validate", *words])
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    return err


def test_bad_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = "--model: expected one of 4k, thermal, usa, ai or all, got 'bebop'"
    assert wrong in refused(capsys, "--model", "bebop")
    (tmp_path / "file").write_text("")
    assert "--speed: expected a number from 0.1 to 20, got 0" in refused(capsys, "--speed", "0")
    assert "--plots: expected " in refused(capsys, "--model", "4k", "--plots", str(tmp_path / "file"))


async def test_all_models_fly_and_are_drawn_like_the_paper(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In this process and in virtual time: pictures come 30 times a simulated second on any machine."""
    folder = tmp_path / "figures"
    folder.mkdir()
    status = await sim_validate.validate(list(MODELS), 1.0, folder)
    out, err = capsys.readouterr()
    assert "DIFFERS" not in out
    assert (status, err) == (0, "")
    assert out.count("agrees") == 4 * 23
    assert "from the frame metadata of the video, 30 times a simulated second" in out
    names = [line.split(",")[0] for line in out.splitlines() if line.endswith("section IV of the anafi_ros paper")]
    delays = dict(zip(names, map(float, re.findall(r"yaw: delay +([0-9.]+) s", out)), strict=True))
    assert list(delays) == ["4k", "thermal", "usa", "ai"]
    assert delays["ai"] > max(delays[name] for name in names[:3]) + 0.05  # twice theirs, says the paper
    drawn = {path.name: path.read_text() for path in folder.iterdir()}
    assert set(drawn) == {path.name for path in (ROOT / "docs" / "validation").iterdir()}
    assert len(drawn) == 8
    for figure in drawn.values():
        assert [name for name in ("commanded", *names) if f"<!-- {name} -->" not in figure] == []


async def test_validation_flights_on_a_stalled_host_are_invalid() -> None:
    """It stops for longer than the sticks are held, again and again: every 0.3 s, and a test holds them for 0.57 s."""
    words = ("-m", "anafi_mav", "sim", "validate", "--model", "4k", "--speed", "7")
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(sys.executable, *words, stdout=pipe, stderr=pipe)
    ending = asyncio.create_task(process.communicate())
    try:
        with suppress(ProcessLookupError):  # it may end between the wait and the signal
            while not (await asyncio.wait({ending}, timeout=0.3))[0]:
                process.send_signal(signal.SIGSTOP)
                await asyncio.wait({ending}, timeout=0.6)
                process.send_signal(signal.SIGCONT)
        out, err = await ending
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert process.returncode == 1
    assert b"the flights are invalid: this machine was too slow for them, the host stalled for" in err
    assert b"agrees" not in out

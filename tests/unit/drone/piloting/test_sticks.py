"""Sticks: percentages against the drone's own limits, and the rhythm of the PCMDs."""

from __future__ import annotations

import math

import pytest

from anafi_mav.arsdk.messages.ardrone3 import PCMD
from anafi_mav.drone.piloting.sticks import CENTRED, Limits, Percent, PilotingCommand, StickSchedule, percent
from anafi_mav.errors import LocalProtocolError

LIMITS = Limits(tilt_deg=40.0, yaw_rate_dps=200.0, climb_mps=4.0)

# Parrot's signs: roll + right, pitch + nose DOWN, yaw + clockwise, gaz + up (ardrone3.xml 1-0-2)
PERCENTAGES = [
    (PilotingCommand(), Percent(0, 0, 0, 0)),
    (PilotingCommand(roll_deg=10.0), Percent(25, 0, 0, 0)),
    (PilotingCommand(roll_deg=-40.0), Percent(-100, 0, 0, 0)),
    (PilotingCommand(pitch_deg=10.0), Percent(0, -25, 0, 0)),
    (PilotingCommand(pitch_deg=-20.0), Percent(0, 50, 0, 0)),
    (PilotingCommand(yaw_rate_dps=50.0), Percent(0, 0, 25, 0)),
    (PilotingCommand(climb_mps=-1.0), Percent(0, 0, 0, -25)),
    # clipped: 45/40 = 112.5 %, 300/200 = 150 %, 9/4 = 225 %
    (PilotingCommand(45.0, -45.0, 300.0, -9.0), Percent(100, 100, 100, -100)),
    (PilotingCommand(math.inf, math.inf, -math.inf, math.inf), Percent(100, -100, -100, 100)),
    # rounded, not cut off: 3.1/40 = 7.75 %, -3.1/40 = -7.75 %, 2.9/40 = 7.25 %
    (PilotingCommand(roll_deg=3.1), Percent(8, 0, 0, 0)),
    (PilotingCommand(roll_deg=-3.1), Percent(-8, 0, 0, 0)),
    (PilotingCommand(roll_deg=2.9), Percent(7, 0, 0, 0)),
]


@pytest.mark.parametrize(("command", "expected"), PERCENTAGES)
def test_percent(command: PilotingCommand, expected: Percent) -> None:
    assert percent(command, LIMITS) == expected


def test_percent_follows_the_limits_of_the_drone() -> None:
    assert percent(PilotingCommand(roll_deg=5.0), Limits(10.0, 40.0, 3.0)) == Percent(50, 0, 0, 0)
    assert percent(PilotingCommand(5.0, 5.0, 5.0, 5.0), Limits(0.0, 0.0, 0.0)) == CENTRED


@pytest.mark.parametrize("field", ["roll_deg", "pitch_deg", "yaw_rate_dps", "climb_mps"])
def test_setpoint_with_nan_raises(field: str) -> None:
    with pytest.raises(LocalProtocolError):
        percent(PilotingCommand(**{field: math.nan}), LIMITS)


def run(sticks: StickSchedule, start: float, end: float) -> list[tuple[float, PCMD]]:
    """Serve the sticks as their shell does, always in time."""
    sent = []
    now = start
    while True:
        pcmd = sticks.due(now)
        if pcmd is not None:
            sent.append((now, pcmd))
        deadline = sticks.deadline
        if deadline is None or deadline > end:
            return sent
        now = deadline


def test_nothing_is_sent_before_the_first_command() -> None:
    assert StickSchedule().deadline is None
    assert StickSchedule().due(10.0) is None


def test_setpoint_leaves_immediately_and_repeats_at_20_hz() -> None:
    sticks = StickSchedule()
    sticks.command(Percent(10, -20, 30, -40), 100.0)
    assert sticks.deadline == 100.0
    sent = run(sticks, 100.0, 100.49)
    assert [round(t - 100.0, 6) for t, _ in sent] == [round(0.05 * n, 6) for n in range(10)]
    assert all((p.flag, p.roll, p.pitch, p.yaw, p.gaz) == (1, 10, -20, 30, -40) for _, p in sent)


def test_a_newer_setpoint_does_not_wait_for_the_rhythm() -> None:
    sticks = StickSchedule()
    sticks.command(Percent(10, 0, 0, 0), 1.0)
    assert sticks.due(1.0) is not None
    sticks.command(Percent(20, 0, 0, 0), 1.01)
    pcmd = sticks.due(1.01)
    assert pcmd is not None
    assert pcmd.roll == 20
    assert sticks.deadline == pytest.approx(1.06)


def test_setpoints_faster_than_20_hz_send_the_newest() -> None:
    sticks = StickSchedule()
    for now, roll in ((1.0, 10), (1.005, 11)):  # two may follow each other at once
        sticks.command(Percent(roll, 0, 0, 0), now)
        assert sticks.due(now) is not None
    sticks.command(Percent(20, 0, 0, 0), 1.010)
    sticks.command(Percent(30, 0, 0, 0), 1.015)
    assert sticks.due(1.015) is None
    assert sticks.deadline == pytest.approx(1.02)
    pcmd = sticks.due(1.0201)
    assert pcmd is not None
    assert pcmd.roll == 30


def test_unchanged_setpoint_leaves_with_the_next_repetition() -> None:
    """A joystick that is held still is streamed fifty times a second; the drone hears it twenty times."""
    sticks = StickSchedule()
    sent = []
    for number in range(50):
        now = 3.0 + 0.02 * number
        sticks.command(Percent(10, 0, 0, 0), now)
        if (pcmd := sticks.due(now)) is not None:
            sent.append(pcmd.roll)
    assert sent == [10] * len(sent)
    assert 17 <= len(sent) <= 20
    # Each of them renewed it.
    assert {p.roll for t, p in run(sticks, 4.0, 4.47)} == {10}
    assert {p.roll for t, p in run(sticks, 4.49, 4.6)} == {0}


def test_expired_setpoint_centres_the_sticks() -> None:
    sticks = StickSchedule()
    sticks.command(Percent(10, 0, 0, 0), 0.0)
    sent = run(sticks, 0.0, 60.0)
    assert {p.roll for t, p in sent if t < 0.5} == {10}
    assert [p.roll for t, p in sent if t > 0.5] == [0] * 40
    assert not sticks.active


def test_centred_sticks_are_sent_for_two_seconds() -> None:
    sticks = StickSchedule()
    sticks.command(Percent(50, 0, 0, 0), 5.0)
    sticks.due(5.0)
    sticks.centre(5.02)
    sent = run(sticks, 5.02, 60.0)
    assert len(sent) == 40
    assert sent[0][0] == 5.02
    assert sent[-1][0] == pytest.approx(5.02 + 1.95)
    assert all((p.flag, p.roll, p.pitch, p.yaw, p.gaz) == (0, 0, 0, 0, 0) for _, p in sent)
    assert not sticks.active


# GroundSDK PilotingCommand, Olympe: 1 only while the drone is asked to tilt
FLAGS = [
    (Percent(1, 0, 0, 0), 1),
    (Percent(0, -1, 0, 0), 1),
    (Percent(5, -5, 100, 100), 1),
    (Percent(0, 0, 100, 0), 0),
    (Percent(0, 0, 0, -100), 0),
    (CENTRED, 0),
]


@pytest.mark.parametrize(("position", "flag"), FLAGS)
def test_pcmd_flag_is_one_while_roll_or_pitch_deflected(position: Percent, flag: int) -> None:
    sticks = StickSchedule()
    sticks.command(position, 1.0)
    pcmd = sticks.due(1.0)
    assert pcmd is not None
    assert (pcmd.flag, pcmd.roll, pcmd.pitch, pcmd.yaw, pcmd.gaz) == (flag, *position)


def test_a_command_ends_the_centring_and_stop_ends_all() -> None:
    sticks = StickSchedule()
    sticks.centre(0.0)
    sticks.command(Percent(1, 2, 3, 4), 0.5)
    assert len(run(sticks, 0.5, 0.99)) == 10
    sticks.stop()
    assert sticks.deadline is None
    assert sticks.due(11.0) is None


def test_late_timer_keeps_the_grid_and_skips_missed_periods() -> None:
    sticks = StickSchedule()
    sticks.command(CENTRED, 0.0)
    sticks.due(0.0)
    assert sticks.due(0.058) is not None  # 8 ms late
    assert sticks.deadline == pytest.approx(0.1)
    assert sticks.due(0.5) is not None  # the loop was busy
    assert sticks.deadline == pytest.approx(0.55)
    assert sticks.due(0.5) is None


def test_pcmd_stamp_has_counter_and_milliseconds() -> None:
    sticks = StickSchedule()
    sticks.command(CENTRED, 1.0)
    stamps = [p.timestampAndSeqNum for _, p in run(sticks, 1.0, 1.11)]
    # sequence 1, 2, 3 in the top byte; 1000, 1050, 1100 ms below
    assert stamps == [0x01000000 + 1000, 0x02000000 + 1050, 0x03000000 + 1100]
    # 24 bits of milliseconds wrap after 16777.216 s, the counter after 255
    sticks.command(CENTRED, 16777.217)
    pcmd = sticks.due(16777.217)
    assert pcmd is not None
    assert pcmd.timestampAndSeqNum == 0x04000000 + 1


def test_single_pcmd_of_centred_sticks_has_flag_zero() -> None:
    pcmd = StickSchedule().single(CENTRED, 0.0)
    assert (pcmd.flag, pcmd.roll, pcmd.pitch, pcmd.yaw, pcmd.gaz) == (0, 0, 0, 0, 0)

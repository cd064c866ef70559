"""Inputs that are not flown: episodes by sender and cause, and the table of causes against the code."""

from __future__ import annotations

import ast
import itertools
from pathlib import Path

import pytest

from anafi_mav import texts
from anafi_mav.services.dropped_inputs import (
    CAUSES,
    EPISODE_GAP,
    MAX_SENDERS,
    MODE_GRACE,
    REPORT_EVERY,
    DropCause,
    DroppedInputs,
    InputStream,
    cause_of,
)
from anafi_mav.services.setpoint.stick_intent import MAX_CLIENTS, StickIntent
from anafi_mav.texts import REASON_BYTES, STATUSTEXT_BYTES, OperatorText, Reason, ReasonTemplate
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.manual_flight import Sticks

SETPOINT, STICKS, TARGET, GIMBAL, REGION, CHANGE = InputStream
PACKAGE = Path(texts.__file__).parent


def dropped(inputs: DroppedInputs, times: list[float], reason: OperatorText = texts.OTHER_PROGRAM) -> list[float]:
    """When a sender whose setpoints are dropped at these times gets a text."""
    return [now for now in times if inputs.drop("a", SETPOINT, reason, now) is not None]


# Episodes.


def test_lasting_drop_is_reported_once() -> None:
    assert dropped(DroppedInputs(), [n * 0.05 for n in range(2000)]) == [0.0]


def test_drop_after_a_flown_input_is_reported_every_ten_seconds() -> None:
    inputs, reported = DroppedInputs(), []
    for now in range(35):
        inputs.use("a", SETPOINT)
        reported += dropped(inputs, [float(now)])
    assert reported == [0.0, 10.0, 20.0, 30.0]


def test_drop_after_a_gap_is_another_episode() -> None:
    assert dropped(DroppedInputs(), [0.0, 4.9, 9.8, 14.7, 19.8]) == [0.0, 19.8]  # the last one after 5.1 s


def test_episode_within_ten_seconds_is_reported_once_they_are_over() -> None:
    assert dropped(DroppedInputs(), [0.0, 6.0, 8.0, 9.9, 10.0, 12.0, 14.0, 18.0, 22.0]) == [0.0, 10.0]


def test_flown_setpoint_does_not_end_an_episode_of_sticks() -> None:
    inputs = DroppedInputs()
    assert inputs.drop("a", STICKS, texts.OTHER_STICKS, 0.0) is not None
    inputs.use("a", SETPOINT)
    assert [inputs.drop("a", STICKS, texts.OTHER_STICKS, float(now)) for now in range(1, 15)] == [None] * 14


def test_causes_and_senders_have_episodes_of_their_own() -> None:
    inputs = DroppedInputs()
    for client, reason in itertools.product("ab", (texts.OTHER_PROGRAM, texts.PAUSED_BY_CLIENT)):
        report = inputs.drop(client, SETPOINT, reason, 1.0)
        assert report == (Severity.WARNING, f"Setpoint refused: {reason}")
        assert inputs.drop(client, SETPOINT, reason, 2.0) is None


def test_reason_with_another_value_is_the_same_cause() -> None:
    inputs = DroppedInputs()
    first, second = (texts.TOO_FAST.fill(speed=speed) for speed in (500.0, 600.0))
    report = inputs.drop("a", SETPOINT, first, 0.0)
    assert report is not None
    assert report.text == "Setpoint refused: 500 m/s is too fast"
    assert inputs.drop("a", SETPOINT, second, 1.0) is None


def test_reason_of_the_drone_is_reported_in_its_words() -> None:
    report = DroppedInputs().drop("a", SETPOINT, texts.from_below("no answer in 5 s"), 0.0)
    assert report is not None
    assert report.text == "Setpoint dropped: no answer in 5 s"


def test_setpoint_in_another_mode_is_reported_after_its_grace() -> None:
    inputs, reason = DroppedInputs(), texts.NOT_OFFBOARD.fill(mode="Hold")
    assert dropped(inputs, [0.0, 0.5, 1.0, 1.5, 1.99], reason) == []
    report = inputs.drop("a", SETPOINT, reason, MODE_GRACE)
    assert report == (Severity.NOTICE, "Setpoint refused: mode Hold, not Offboard")
    inputs.use("a", SETPOINT)
    assert dropped(inputs, [20.0, 21.0, 21.99, 22.0, 23.0], reason) == [22.0]


# Bounds.


def test_senders_beyond_the_bound_get_no_flood_of_texts() -> None:
    inputs = DroppedInputs()
    reports = [inputs.drop(client, SETPOINT, texts.OTHER_PROGRAM, client / 1000) for client in range(1000)]
    assert [report is not None for report in reports] == [True] * MAX_SENDERS + [False] * (1000 - MAX_SENDERS)
    assert inputs.drop("late", SETPOINT, texts.OTHER_PROGRAM, REPORT_EVERY) is not None  # the oldest makes room


def test_sender_of_a_closed_channel_is_forgotten() -> None:
    inputs = DroppedInputs()
    assert dropped(inputs, [0.0, 1.0]) == [0.0]
    inputs.forget(lambda client: client == "b")
    assert dropped(inputs, [2.0]) == []
    inputs.forget(lambda client: client == "a")
    assert dropped(inputs, [3.0]) == [3.0]


# The table.


@pytest.mark.parametrize("stream", [stream for stream in InputStream if stream is not CHANGE])
def test_every_stream_reports_reasons_of_the_drone(stream: InputStream) -> None:
    assert cause_of(stream, texts.from_below("battery is on fire")).reason is None


@pytest.mark.parametrize("cause", CAUSES, ids=lambda one: f"{one.stream.name}-{getattr(one.reason, 'pattern', '')}")
def test_text_of_a_cause_fits_a_statustext(cause: DropCause) -> None:
    if cause.reason is None:
        reason: OperatorText = Reason("r" * REASON_BYTES)
    elif isinstance(cause.reason, OperatorText):
        reason = cause.reason
    else:
        reason = cause.reason.fill(**cause.reason.longest)
        assert cause_of(cause.stream, reason) is cause
    assert len(cause.text(reason).encode()) <= STATUSTEXT_BYTES
    assert cause.grace < EPISODE_GAP


def test_no_cause_is_listed_twice() -> None:
    rows = [(cause.stream, getattr(cause.reason, "pattern", None)) for cause in CAUSES]
    assert len(set(rows)) == len(rows)


SOURCES: dict[InputStream, tuple[str, ...]] = {
    SETPOINT: (
        "services/setpoint/setpoint_messages.py",
        *("vehicle/offboard/flight.py", "vehicle/offboard/goals.py", "vehicle/offboard/moves.py"),
        *("vehicle/base/aircraft.py", "vehicle/base/bounds.py"),
    ),
    STICKS: ("services/setpoint/stick_messages.py", "vehicle/manual_flight.py"),
    TARGET: ("services/setpoint/target_messages.py", "vehicle/follow_flight.py", "vehicle/base/bounds.py"),
    GIMBAL: ("services/gimbal/targets.py", "services/gimbal/motion.py", "services/gimbal/gimbal_service.py"),
    REGION: ("services/gimbal/roi.py",),
    CHANGE: ("vehicle/operator_control.py",),
}
"""Modules whose reasons can be those of a dropped input."""

OF_COMMANDS = {
    SETPOINT: {"NO_SETPOINTS", "SETPOINTS_STOPPED", "NOT_ITS_TAKEOFF", "NOT_ON_GROUND"},
    STICKS: set[str](),
    TARGET: {"TAKE_OFF_FIRST", "TARGET_LOST", "NO_TARGET", "FRAME_UNSUPPORTED"},
    GIMBAL: {
        *("GIMBAL_IDS", "GIMBAL_NO_PRIMARY", "ROI_KINDS", "NO_PLACE", "ROI_NO_WAYPOINT", "POSITION_UNKNOWN"),
        *("RATE_CLIENT_SILENT", "DRONE_FLIES"),
    },
    REGION: {"REGION_INSTEAD", "ROI_NO_SYSTEM", "ROI_SYSTEM_NUMBER"},
    CHANGE: set(),
}
"""Reasons in these modules of commands, of the end of a mode, or of another stream."""


def reasons(path: str) -> set[str]:
    """Names of the reasons in a module."""
    tree = ast.parse((PACKAGE / path).read_text(encoding="utf-8"))
    named = {ast.unparse(node).removeprefix("texts.") for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    return {name for name in named if isinstance(getattr(texts, name, None), Reason | ReasonTemplate)}


@pytest.mark.parametrize("stream", InputStream)
def test_reasons_in_the_code_are_listed(stream: InputStream) -> None:
    found = set[str]().union(*map(reasons, SOURCES[stream]))
    assert found
    listed = {getattr(cause.reason, "pattern", None) for cause in CAUSES if cause.stream is stream}
    unlisted = {name for name in found if getattr(texts, name).pattern not in listed}
    assert unlisted - {"TILT_SHORT"} == OF_COMMANDS[stream]


# Sticks that a person means.


def meant(intent: StickIntent, *climbs: float, every: float = 0.1) -> list[bool]:
    return [intent.is_meant("a", Sticks(climb=climb), n * every) for n, climb in enumerate(climbs)]


@pytest.mark.parametrize(
    ("climbs", "expected"),
    [
        ([-1.0, -1.0], [False, False]),  # at rest at the lower end
        ([1.0, 1.0], [False, False]),
        ([-1.0, 0.5, 0.0, -1.0], [False, True, False, False]),
        ([0.0, 0.5, -0.5, 0.1], [False, True, True, False]),  # it returns to the middle by itself
    ],
)
def test_throttle_is_meant_off_its_rest(climbs: list[float], expected: list[bool]) -> None:
    assert meant(StickIntent(), *climbs) == expected


def test_throttle_rest_is_learned_again_after_a_gap() -> None:
    assert meant(StickIntent(), 0.0, 0.5, 0.5, every=6.0) == [False, False, False]


@pytest.mark.parametrize("sticks", [Sticks(forward=0.2), Sticks(right=-0.2), Sticks(turn=1.0)])
def test_other_stick_is_meant_from_a_fifth_on(sticks: Sticks) -> None:
    assert StickIntent().is_meant("a", sticks, 0.0)


def test_touched_stick_is_not_meant() -> None:
    assert not StickIntent().is_meant("a", Sticks(forward=0.19, right=-0.19, turn=0.19), 0.0)


def test_throttles_are_bounded_in_clients() -> None:
    intent = StickIntent()
    for client in range(MAX_CLIENTS + 1):
        intent.is_meant(client, Sticks(), 0.0)
    assert not intent.is_meant(0, Sticks(climb=1.0), 0.0)  # forgotten: this is its rest
    assert intent.is_meant(MAX_CLIENTS, Sticks(climb=1.0), 0.0)

"""Age of samples and the rules for late and repeated ones; the clocks of both sides by hand."""

from __future__ import annotations

import pytest

from anafi_mav.fabric.envelope import Pong, UpEnvelope
from anafi_mav.fabric.sample_age import ClockOffset, StationInput, StopKind, refusal_of
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import Parser, ReceivedFrame, frame, pack

SESSION = 7


def received(message: dialect.MAVLink_message, *, sysid: int = 255) -> ReceivedFrame:
    """Return a message as a station's frame."""
    (found,) = Parser().receive(frame(pack(message), 0, sysid, 190))
    return found


def command(confirmation: int = 0, height: float = 5.0) -> ReceivedFrame:
    """Return a command to take off."""
    return received(
        dialect.MAVLink_command_long_message(1, 1, dialect.MAV_CMD_NAV_TAKEOFF, confirmation, 0, 0, 0, 0, 0, 0, height)
    )


VELOCITY = received(dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0xDC7, *[0.0] * 9, 0, 0))
HEARTBEAT = received(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))


def test_age_is_measured_by_the_middle_of_a_ping() -> None:
    offset = ClockOffset()
    assert offset.age(50.0, 100.0) is None
    # Sent at 100.0, back at 100.2: the station's 50.0 was at 100.1 of the gateway, give or take 0.1.
    offset.answered(100.0, 50.0, 100.2)
    assert offset.age(50.5, 101.0) == pytest.approx(0.4)


def test_quickest_ping_counts_and_not_the_newest() -> None:
    offset = ClockOffset()
    offset.answered(100.0, 50.01, 100.02)  # offset 50.0
    offset.answered(101.0, 51.9, 103.0)  # 2 s on the way: offset 50.1 ± 1.0
    assert offset.age(53.0, 104.0) == pytest.approx(1.0)


def test_ping_counts_for_a_minute() -> None:
    offset = ClockOffset()
    offset.answered(100.0, 50.0, 100.0)
    assert offset.age(110.0, 160.0) == pytest.approx(0.0)
    assert offset.age(110.1, 160.1) is None


def test_clock_that_jumped_is_measured_again() -> None:
    offset = ClockOffset()
    offset.answered(100.0, 50.0, 100.0)
    # The station was suspended for 20 s, in which its clock did not run.
    offset.answered(130.0, 60.05, 130.1)
    assert offset.age(60.05, 130.05) == pytest.approx(0.0, abs=0.051)


def test_answer_from_the_future_is_ignored() -> None:
    offset = ClockOffset()
    offset.answered(100.0, 50.0, 99.0)
    assert offset.age(50.0, 100.0) is None


def test_station_sample_must_be_newer_and_of_its_session() -> None:
    station = StationInput(SESSION)
    assert station.is_next(1, UpEnvelope(SESSION, 5, 0))
    assert not station.is_next(1, UpEnvelope(SESSION, 5, 0))
    assert not station.is_next(1, UpEnvelope(SESSION, 4, 0))
    assert station.is_next(2, UpEnvelope(SESSION, 4, 0))
    assert not station.is_next(1, UpEnvelope(SESSION + 1, 6, 0))
    assert station.is_next(1, UpEnvelope(SESSION, 6, 0))


def test_lost_samples_are_the_numbers_left_out() -> None:
    station = StationInput(SESSION)
    assert station.is_next(1, UpEnvelope(SESSION, 40, 0))  # the gateway is younger than the station
    assert station.is_next(1, UpEnvelope(SESSION, 41, 0))
    assert station.lost == 0
    assert station.is_next(1, UpEnvelope(SESSION, 44, 0))
    assert not station.is_next(1, UpEnvelope(SESSION, 43, 0))
    assert station.is_next(2, UpEnvelope(SESSION, 1, 0))
    assert station.is_next(2, UpEnvelope(SESSION, 3, 0))
    assert station.lost == 3


def test_station_age_is_that_of_its_pongs() -> None:
    station = StationInput(SESSION)
    assert station.ping(9, 100.0) == (9, 100_000_000)
    assert not station.pong(Pong(9, 99_000_000, 0), 1, 100.0)
    assert not station.pong(Pong(8, 100_000_000, 0), 1, 100.0)
    assert station.pong(Pong(9, 100_000_000, 50_000_000), 1, 100.0)
    assert not station.pong(Pong(9, 100_000_000, 0), 1, 100.0)
    assert station.age(UpEnvelope(SESSION, 1, 51_000_000), 101.25) == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("frame", "age", "late"),
    [
        (VELOCITY, 0.29, False),
        (VELOCITY, 0.31, True),
        (HEARTBEAT, 1.9, False),
        (HEARTBEAT, 2.1, True),
        (HEARTBEAT, None, True),
        (VELOCITY, None, True),
        (command(), 1.9, False),
        (command(), 2.1, True),
        (command(), None, True),
    ],
)
def test_frame_beyond_its_limit_is_late(frame: ReceivedFrame, age: float | None, late: bool) -> None:
    assert StationInput(SESSION).is_late(frame, age, 100.0) is late


@pytest.mark.parametrize(
    "message",
    [
        dialect.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0),
        dialect.MAVLink_rc_channels_override_message(1, 1, *[1500] * 8),
        dialect.MAVLink_set_attitude_target_message(0, 1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0.5),
        dialect.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 0xDC7, 0, 0, *[0.0] * 9),
        dialect.MAVLink_gimbal_manager_set_pitchyaw_message(1, 1, 0, 0, 0, 0, 0.1, 0),
        dialect.MAVLink_gimbal_manager_set_attitude_message(1, 1, 0, 0, [1, 0, 0, 0], 0, 0.1, 0),
        dialect.MAVLink_gimbal_manager_set_manual_control_message(1, 1, 0, 0, 0, 0, 0.1, 0),
        dialect.MAVLink_mount_control_message(1, 1, -3000, 0, 0, 0),
        dialect.MAVLink_follow_target_message(
            0, 0, 0, 0, 0.0, *[[0.0] * 3] * 2, [1.0, 0.0, 0.0, 0.0], *[[0.0] * 3] * 2, 0
        ),
    ],
)
def test_each_message_that_moves_is_late_after_three_tenths(message: dialect.MAVLink_message) -> None:
    assert StationInput(SESSION).is_late(received(message), 0.31, 100.0)


def test_repetition_of_a_refused_command_is_refused_until_its_sender_could_know() -> None:
    station = StationInput(SESSION)
    assert station.is_late(command(0), 4.0, 100.0)
    # Sent at 99.5, before the refusal left at 100.0: the same attempt.
    assert station.is_late(command(1), 0.6, 100.1)
    # Another command in the same queue is its own.
    assert not station.is_late(command(0, height=9.0), 0.6, 100.1)
    # Sent at 100.2, after the last refusal at 100.1.
    assert not station.is_late(command(0), 0.1, 100.3)


LAND = received(dialect.MAVLink_command_long_message(1, 1, dialect.MAV_CMD_NAV_LAND, *[0] * 8))
RETURN = received(dialect.MAVLink_command_long_message(1, 1, dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, *[0] * 8))
SET_MODE = received(dialect.MAVLink_set_mode_message(1, 1, 0x03040000))


@pytest.mark.parametrize("age", [0.1, 1.9, 2.1, 60.0, None])
@pytest.mark.parametrize("stop", [LAND, SET_MODE])
def test_stop_in_place_is_taken_at_any_age(stop: ReceivedFrame, age: float | None) -> None:
    assert not StationInput(SESSION).is_late(stop, age, 100.0, StopKind.IN_PLACE)


@pytest.mark.parametrize(("age", "late"), [(1.9, False), (2.1, True), (None, False)])
def test_return_is_taken_unless_it_is_known_to_be_old(age: float | None, late: bool) -> None:
    assert StationInput(SESSION).is_late(RETURN, age, 100.0, StopKind.HOME) is late


@pytest.mark.parametrize(("age", "late"), [(1.9, False), (2.1, True), (None, True)])
def test_set_mode_that_stops_nothing_is_late_as_a_command(age: float | None, late: bool) -> None:
    assert StationInput(SESSION).is_late(SET_MODE, age, 100.0) is late


def test_repetition_of_a_refused_set_mode_is_refused() -> None:
    station = StationInput(SESSION)
    assert station.is_late(SET_MODE, 4.0, 100.0)
    assert station.is_late(SET_MODE, 0.6, 100.1)  # sent at 99.5, before the refusal left
    assert not station.is_late(SET_MODE, 0.1, 100.3)


def test_time_in_the_future_is_of_unknown_age() -> None:
    offset = ClockOffset()
    offset.answered(100.0, 50.1, 100.2)  # offset 50.0 ± 0.1
    assert offset.age(51.1, 101.0) == pytest.approx(-0.1)
    assert offset.age(51.19, 101.0) == pytest.approx(-0.19)
    assert offset.age(51.21, 101.0) is None


def test_refusal_answers_commands_only() -> None:
    answer = refusal_of(command())
    assert answer is not None
    assert answer.command == dialect.MAV_CMD_NAV_TAKEOFF
    assert answer.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
    assert (answer.target_system, answer.target_component) == (255, 190)
    assert refusal_of(HEARTBEAT) is None
    assert refusal_of(SET_MODE) is None


def test_pings_try_each_system_until_one_is_answered() -> None:
    station, held = StationInput(SESSION), {2, 5, 9}
    assert [station.ping_system(held) for _ in range(4)] == [2, 5, 9, 2]
    station.ping(9, 100.0)
    assert station.pong(Pong(9, 100_000_000, 50_000_000), 5, 100.0)
    assert [station.ping_system(held) for _ in range(2)] == [5, 5]
    assert station.ping_system({2, 9}) == 9


def test_pings_go_over_the_system_that_the_station_sent_to() -> None:
    station, held = StationInput(SESSION), {2, 5, 9}
    station.hear(9)
    assert [station.ping_system(held) for _ in range(2)] == [9, 9]
    assert station.ping_system({2, 5}) == 2

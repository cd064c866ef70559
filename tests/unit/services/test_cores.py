"""The I/O-free cores of services/: modes, texts, heights, the command history."""

from __future__ import annotations

import math
from typing import Any

import pytest

from anafi_mav.mavlink import dialect
from anafi_mav.services import commands
from anafi_mav.services.command.flight_service import FlightService
from anafi_mav.services.command.guided_service import GuidedService
from anafi_mav.services.command.modes_service import ModesService
from anafi_mav.services.flavours import ARDUPILOT, PX4
from anafi_mav.services.statustext import TextNumbers
from anafi_mav.vehicle.base.height import HeightReference, TakeoffRecord
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.link_loss import GcsWatch

NAN = math.nan

# Numbers of conformance A3, as QGroundControl's table has them.
PACKED = {
    FlightMode.POSITION: 0x00030000,
    FlightMode.TAKEOFF: 0x02040000,
    FlightMode.HOLD: 0x03040000,
    FlightMode.MISSION: 0x04040000,
    FlightMode.RETURN: 0x05040000,
    FlightMode.LAND: 0x06040000,
    FlightMode.OFFBOARD: 0x00060000,
    FlightMode.TERMINATED: 0x000A0000,
}


@pytest.mark.parametrize(("mode", "number"), PACKED.items())
def test_px4_numbers(mode: FlightMode, number: int) -> None:
    assert PX4.custom_mode(mode) == number
    assert PX4.mode_of_number(number) is mode
    assert PX4.mode_of_parameters(float(number), NAN) is mode


@pytest.mark.parametrize(
    ("main", "sub", "mode"),
    [
        (4.0, 3.0, FlightMode.HOLD),
        (6.0, NAN, FlightMode.OFFBOARD),
        (3.0, 0.0, FlightMode.POSITION),
        (5.0, 0.0, None),  # ACRO
        (4.0, 99.0, None),
        (4.5, 3.0, None),
        (NAN, NAN, None),
        (math.inf, 0.0, None),
        (-1.0, 0.0, None),
        (4.0, math.inf, None),
    ],
)
def test_modes_by_parameters(main: float, sub: float, mode: FlightMode | None) -> None:
    assert PX4.mode_of_parameters(main, sub) is mode


# ArduCopter/mode.h by conformance A4; Brake is our Hold.
COPTER = {
    FlightMode.MISSION: 3,
    FlightMode.GUIDED: 4,
    FlightMode.POSITION: 5,
    FlightMode.RETURN: 6,
    FlightMode.LAND: 9,
    FlightMode.HOLD: 17,
    FlightMode.FOLLOW: 23,
}


@pytest.mark.parametrize(("mode", "number"), COPTER.items())
def test_copter_numbers(mode: FlightMode, number: int) -> None:
    assert ARDUPILOT.custom_mode(mode) == number
    assert ARDUPILOT.mode_of_number(number) is mode
    assert ARDUPILOT.mode_of_parameters(float(number), 0.0) is mode
    assert ARDUPILOT.mode_of_parameters(float(number), NAN) is mode


@pytest.mark.parametrize(
    ("main", "mode"),
    [
        (0.0, None),  # STABILIZE
        (1.0, None),  # ACRO
        (7.0, None),  # CIRCLE is begun by an orbit
        (16.0, FlightMode.POSITION),  # POSHOLD
        (21.0, FlightMode.RETURN),  # SMART_RTL
        (float(0x03040000), FlightMode.HOLD),  # PX4's packed number
        (4.5, None),
        (NAN, None),
    ],
)
def test_copter_modes_by_parameter(main: float, mode: FlightMode | None) -> None:
    assert ARDUPILOT.mode_of_parameters(main, NAN) is mode


def texts(text: str) -> list[tuple[int, int, bytes]]:
    return [(m.id, m.chunk_seq, bytes(m._text_raw)) for m in TextNumbers().messages(Severity.WARNING, text)]


def test_a_short_text_is_one_message() -> None:
    assert texts("x" * 50) == [(0, 0, b"x" * 50)]


def test_a_long_text_is_chunked() -> None:
    assert texts("a" * 50 + "b" * 20) == [(1, 0, b"a" * 50), (1, 1, b"b" * 20)]


def test_text_of_full_chunks_ends_in_an_empty_one() -> None:
    assert [chunk for _, _, chunk in texts("a" * 100)] == [b"a" * 50, b"a" * 50, b""]


def test_chunks_of_a_text_hold_whole_characters() -> None:
    """QGroundControl reads each chunk by itself; one shorter than 50 bytes would end the text."""
    chunks = [chunk for _, _, chunk in texts("a" * 9 + " " + "b" * 39 + "é" * 52)]
    assert [chunk.decode() for chunk in chunks] == ["a" * 9 + "  " + "b" * 39, "é" * 25, "é" * 25, "é" * 2]
    assert [chunk.decode() for _, _, chunk in texts("x" + "é" * 26)] == ["x" + "é" * 24 + " ", "é" * 2]


def test_height_is_latched_on_the_ground() -> None:
    height = HeightReference()
    assert height.ato(100.0) is None
    height.on_ground(35.0, 0.0)
    height.take_off()
    assert height.takeoff_amsl == 35.0
    assert height.ato(65.0) == 30.0
    assert height.amsl(30.0) == 65.0


def test_height_counts_from_the_last_landing_place() -> None:
    """It took off at 45 m and stands 10 m lower: what it says now is -10, and counts from 0 again when it flies."""
    height = HeightReference()
    height.on_ground(45.0, 0.0)
    height.take_off()
    height.in_flight("first", 45.0, 0.0)
    height.on_ground(35.0, -10.0)
    assert height.amsl(-10.0) == 35.0  # where it stands
    assert height.ato(55.0) == 20.0  # of a target for the next flight
    height.take_off()
    height.in_flight("second", 35.0, 0.0)
    assert height.amsl(0.0) == 35.0
    assert height.ato(55.0) == 20.0


def record(flight_id: str = "flight 1", *, estimated: bool = False) -> TakeoffRecord:
    return TakeoffRecord(flight_id, 35.0, estimated)


def test_height_kept_of_the_same_flight_counts() -> None:
    height = HeightReference()
    height.on_ground(35.0, 0.0)
    height.in_flight("", 36.0, 1.0)
    height.in_flight("flight 1", 39.0, 1.0)
    assert (height.takeoff_amsl, height.estimated, height.flight_id) == (35.0, False, "flight 1")
    height.link_down()
    assert height.takeoff_amsl is None
    height.recall(record())
    assert not height.in_flight("flight 1", 60.0, 20.0)
    assert (height.takeoff_amsl, height.estimated) == (35.0, False)


@pytest.mark.parametrize(
    ("kept", "flight"), [(record("flight 1"), "flight 2"), (record("flight 1"), ""), (None, "flight 1"), (None, None)]
)
def test_height_kept_of_another_flight_is_estimated_once(kept: TakeoffRecord | None, flight: str | None) -> None:
    height = HeightReference()
    height.recall(kept)
    assert not height.in_flight(flight, None, 20.0)
    assert height.takeoff_amsl is None
    assert height.in_flight(flight, 60.0, 20.0)
    assert (height.takeoff_amsl, height.estimated) == (40.0, True)
    assert not height.in_flight(flight, 75.0, 20.0)
    assert height.takeoff_amsl == 40.0
    height.on_ground(36.0, 0.5)
    assert (height.takeoff_amsl, height.estimated) == (35.5, False)


def test_height_estimate_is_replaced_after_a_late_flight_id() -> None:
    height = HeightReference()
    height.recall(record("flight 1"))
    assert height.in_flight("", 60.0, 20.0)
    assert not height.in_flight("flight 1", 61.0, 20.0)
    assert (height.takeoff_amsl, height.estimated) == (35.0, False)


def test_stored_height_estimate_stays_an_estimate() -> None:
    height = HeightReference()
    height.recall(record(estimated=True))
    assert not height.in_flight("flight 1", 60.0, 20.0)
    assert (height.takeoff_amsl, height.estimated) == (35.0, True)


def test_height_of_seen_takeoff_survives_late_flight_id() -> None:
    """A firmware may still report the id of the flight before when this one has begun."""
    height = HeightReference()
    height.on_ground(35.0, 0.0)
    height.take_off()
    height.in_flight("flight 1", 40.0, 2.0)
    height.in_flight("flight 2", 41.0, 3.0)
    assert (height.takeoff_amsl, height.estimated, height.flight_id) == (35.0, False, "flight 2")


def test_height_after_landing_without_fix_uses_drone_height() -> None:
    height = HeightReference()
    height.on_ground(45.0, 0.0)
    height.take_off()
    height.on_ground(None, -10.0)
    height.take_off()
    assert height.takeoff_amsl == 35.0


@pytest.mark.parametrize(
    "kept",
    [
        None,
        7,
        {"flight_id": "", "amsl": 1.0, "estimated": False},
        {"flight_id": "a", "amsl": float("inf"), "estimated": False},
        {"flight_id": "a", "amsl": 1.0, "estimated": False, "latitude": 2.0},
        {"flight_id": "a", "amsl": 1.0, "estimated": False, "latitude": 91.0, "longitude": 0.0},
        {"flight_id": "a", "amsl": 1.0, "estimated": False, "latitude": float("nan"), "longitude": 0.0},
    ],
)
def test_invalid_takeoff_record_is_not_read(kept: object) -> None:
    assert TakeoffRecord.read(kept) is None


def test_takeoff_record_is_read_as_written() -> None:
    whole = TakeoffRecord("a", 35.0, True, 48.0, 2.0)
    assert TakeoffRecord.read(whole.written) == whole
    assert TakeoffRecord.read(record().written) == record()


def test_a_silence_on_the_ground_ends_the_latch() -> None:
    height = HeightReference()
    height.on_ground(35.0, 0.0)
    height.link_down()
    assert height.takeoff_amsl is None


def named(id: int) -> commands.Definition:
    """The row by which a system knows this MAV_CMD. Nothing is flown: no handler is called."""
    nothing: Any = None
    tables = (FlightService(nothing).actions(), ModesService(nothing).actions(), GuidedService(nothing).actions())
    return next(table[id] for table in tables if id in table)


def command(id: int = dialect.MAV_CMD_COMPONENT_ARM_DISARM, p1: float = 1.0) -> commands.Command:
    return commands.Command(id, named(id), (p1, NAN, NAN, NAN), NAN, NAN, NAN, None)


MISSION_START = commands.Definition(
    location=False,
    altitude=commands.Altitude.UNUSED,
    effect=commands.effect_of_mode,
    mode=lambda command: FlightMode.MISSION,
)


def mode_command(id: int, *params: float) -> commands.Command:
    definition = MISSION_START if id == dialect.MAV_CMD_MISSION_START else named(id)
    return commands.Command(id, definition, (*params, *[NAN] * (4 - len(params))), NAN, NAN, NAN, None)


def test_resent_command_is_recognised_during_and_shortly_after_execution() -> None:
    history = commands.CommandHistory()
    assert history.retransmission("a", command(), 0.0) is None
    execution = history.begin("a", command())
    assert history.retransmission("a", command(), 60.0) == dialect.MAV_RESULT_IN_PROGRESS
    execution.result, execution.ended = dialect.MAV_RESULT_ACCEPTED, 60.0
    assert history.retransmission("a", command(), 63.4) == dialect.MAV_RESULT_ACCEPTED
    assert history.retransmission("a", command(), 63.5) is None


def test_a_refusal_is_soon_forgotten() -> None:
    history = commands.CommandHistory()
    execution = history.begin("a", command())
    execution.result, execution.ended = dialect.MAV_RESULT_TEMPORARILY_REJECTED, 10.0
    assert history.retransmission("a", command(), 10.9) == dialect.MAV_RESULT_TEMPORARILY_REJECTED
    assert history.retransmission("a", command(), 11.0) is None


def test_replaced_command_of_another_client_is_not_repeated() -> None:
    history = commands.CommandHistory()
    for client in ("a", "b"):
        execution = history.begin(client, command())
        execution.result, execution.ended = dialect.MAV_RESULT_ACCEPTED, 0.0
    stop = command(dialect.MAV_CMD_DO_REPOSITION, NAN)
    stopped = history.begin("c", stop)
    stopped.result, stopped.ended = dialect.MAV_RESULT_ACCEPTED, 0.0
    history.supersede("b")
    assert history.retransmission("a", command(), 1.0) == dialect.MAV_RESULT_CANCELLED
    assert history.retransmission("b", command(), 1.0) == dialect.MAV_RESULT_ACCEPTED
    assert history.retransmission("c", stop, 1.0) is None  # an order to stop is always carried out


def test_actions_of_gone_clients_are_forgotten() -> None:
    history = commands.CommandHistory()
    history.begin("a", command())
    history.begin("b", command())
    history.forget_clients(lambda client: client == "a")
    assert history.retransmission("a", command(), 1.0) is None
    assert history.retransmission("b", command(), 1.0) == dialect.MAV_RESULT_IN_PROGRESS


def test_repeated_refused_command_keeps_its_refusal_though_another_client_commanded() -> None:
    history = commands.CommandHistory()
    execution = history.begin("a", command())
    execution.result, execution.ended = dialect.MAV_RESULT_DENIED, 0.0
    history.supersede("b")
    assert history.retransmission("a", command(), 0.5) == dialect.MAV_RESULT_DENIED


def test_repeated_return_runs_again_unless_another_client_commanded() -> None:
    history = commands.CommandHistory()
    execution = history.begin("a", command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH))
    execution.result, execution.ended = dialect.MAV_RESULT_ACCEPTED, 0.0
    assert history.retransmission("a", command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH), 1.0) is None
    history.supersede("b")
    assert (
        history.retransmission("a", command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH), 1.0) == dialect.MAV_RESULT_CANCELLED
    )


def test_repeated_target_runs_again_unless_another_client_commanded() -> None:
    definition = commands.Definition(location=True, altitude=commands.Altitude.AMSL, effect=commands.Effect.TARGET)
    look = commands.Command(dialect.MAV_CMD_DO_SET_ROI_LOCATION, definition, (NAN,) * 4, 48.0, 2.0, NAN, None)
    history = commands.CommandHistory()
    execution = history.begin("a", look)
    execution.result, execution.ended = dialect.MAV_RESULT_ACCEPTED, 0.0
    assert history.retransmission("a", look, 1.0) is None
    history.supersede("b")
    assert history.retransmission("a", look, 1.0) == dialect.MAV_RESULT_CANCELLED
    assert history.retransmission("a", look, 3.5) is None


def test_repeated_offboard_command_after_its_end_is_executed() -> None:
    history = commands.CommandHistory()
    offboard = mode_command(dialect.MAV_CMD_DO_SET_MODE, 1.0, 6.0, 0.0)
    execution = history.begin("a", offboard)
    execution.result, execution.ended = dialect.MAV_RESULT_ACCEPTED, 0.0
    assert history.retransmission("a", offboard, 1.0, FlightMode.OFFBOARD) == dialect.MAV_RESULT_ACCEPTED
    assert history.retransmission("a", offboard, 1.0, FlightMode.HOLD) is None
    history.supersede("b")
    assert history.retransmission("a", offboard, 1.0, FlightMode.HOLD) == dialect.MAV_RESULT_CANCELLED


@pytest.mark.parametrize(
    "mission",
    [
        mode_command(dialect.MAV_CMD_MISSION_START, 0.0, 0.0),
        mode_command(dialect.MAV_CMD_DO_SET_MODE, 1.0, 4.0, 4.0),
        mode_command(dialect.MAV_CMD_DO_SET_STANDARD_MODE, 6.0),
    ],
)
def test_repeated_mission_start_after_its_end_is_not_confirmed(mission: commands.Command) -> None:
    history = commands.CommandHistory()
    execution = history.begin("a", mission)
    execution.result, execution.ended = dialect.MAV_RESULT_ACCEPTED, 0.0
    assert history.retransmission("a", mission, 1.0, FlightMode.MISSION) == dialect.MAV_RESULT_ACCEPTED
    assert history.retransmission("a", mission, 1.0, FlightMode.RETURN) is None
    history.supersede("b")
    assert history.retransmission("a", mission, 1.0, FlightMode.HOLD) == dialect.MAV_RESULT_CANCELLED


def test_command_with_other_values_is_no_retransmission() -> None:
    history = commands.CommandHistory()
    history.begin("a", command())
    assert history.retransmission("b", command(), 0.1) is None
    assert history.retransmission("a", command(p1=0.0), 0.1) is None
    assert history.retransmission("a", command(dialect.MAV_CMD_NAV_TAKEOFF), 0.1) is None
    # arm, disarm, arm: the third is no repetition of the first
    history.begin("a", command(p1=0.0))
    assert history.retransmission("a", command(), 0.3) is None


def test_command_history_is_bounded_in_clients() -> None:
    history = commands.CommandHistory()
    for client in range(commands.MAX_CLIENTS + 1):
        history.begin(client, command())
    assert history.retransmission(0, command(), 0.0) is None
    assert history.retransmission(1, command(), 0.0) == dialect.MAV_RESULT_IN_PROGRESS


@pytest.mark.parametrize(
    ("id", "params", "place", "stops"),
    [
        (dialect.MAV_CMD_DO_REPOSITION, (-1.0, 1.0, 0.0, NAN), (NAN, NAN, NAN), True),
        (dialect.MAV_CMD_DO_REPOSITION, (-1.0, 1.0, 0.0, NAN), (NAN, NAN, 10.0), False),
        (dialect.MAV_CMD_DO_REPOSITION, (-1.0, 1.0, 0.0, 0.0), (NAN, NAN, NAN), False),
        (dialect.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 3.0, NAN), (NAN, NAN, NAN), True),
        (dialect.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 5.0, NAN), (NAN, NAN, NAN), False),
        (dialect.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 6.0, NAN), (NAN, NAN, NAN), True),
        (dialect.MAV_CMD_NAV_LAND, (NAN, NAN, NAN, NAN), (NAN, NAN, NAN), True),
        (dialect.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, NAN, NAN, NAN), (NAN, NAN, NAN), True),
        (dialect.MAV_CMD_COMPONENT_ARM_DISARM, (1.0, NAN, NAN, NAN), (NAN, NAN, NAN), False),
        (dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, (NAN, NAN, NAN, NAN), (NAN, NAN, NAN), False),
    ],
)
def test_orders_to_stop(id: int, params: Any, place: tuple[float, float, float], stops: bool) -> None:
    assert commands.Command(id, named(id), params, *place, None).effect.stops is stops


def test_command_int_scales_places_only() -> None:
    def message(id: int, x: int, y: int) -> commands.Command:
        return commands.from_int(dialect.MAVLink_command_int_message(1, 1, 5, id, 0, 0, 1, 2, 3, 4, x, y, 7), named(id))

    goto = message(dialect.MAV_CMD_DO_REPOSITION, 488789000, -23677000)
    assert (goto.x, goto.y, goto.z, goto.frame) == (48.8789, -2.3677, 7, 5)
    unset = message(dialect.MAV_CMD_DO_REPOSITION, 2**31 - 1, -(2**31))
    assert math.isnan(unset.x)
    assert math.isnan(unset.y)
    assert message(dialect.MAV_CMD_CONDITION_YAW, 12, 0).x == 12


def test_a_ground_station_is_lost_once_for_each_silence() -> None:
    watch = GcsWatch()
    assert not watch.expire(100.0, 10.0)  # who was never there cannot be lost
    assert not watch.heard(100.0)
    assert [watch.expire(now, 10.0) for now in (109.9, 110.0, 120.0)] == [False, True, False]
    assert watch.heard(121.0)
    assert not watch.heard(122.0)


def test_station_whose_end_is_certain_is_lost_at_once_if_it_was_the_last() -> None:
    watch = GcsWatch()
    watch.heard(100.0, "fabric")
    watch.heard(101.0, "udp")
    assert watch.closed("fabric", 102.0, 10.0, is_certain=True) is None  # the other one is there
    watch.heard(103.0, "fabric")
    assert watch.closed("udp", 104.0, 10.0, is_certain=False) is None  # it may return: silence decides
    assert watch.closed("other", 104.0, 10.0, is_certain=True) is None  # no station was heard on it
    assert watch.closed("fabric", 104.5, 10.0, is_certain=True) == 1.5
    assert not watch.expire(120.0, 10.0)  # it is one loss
    assert watch.heard(121.0, "fabric")


def test_silence_before_a_watch_restart_does_not_count() -> None:
    watch = GcsWatch()
    watch.restart(50.0)
    assert not watch.expire(100.0, 10.0)
    watch.heard(100.0)
    watch.restart(130.0)
    assert [watch.expire(now, 10.0) for now in (130.0, 139.9, 140.0)] == [False, False, True]
    # What was to be done for the first loss may have been lost with the link: the next silence is a loss again.
    watch.restart(150.0)
    assert [watch.expire(now, 10.0) for now in (159.9, 160.0)] == [False, True]
    watch.restart(170.0)
    assert not watch.heard(171.0)


def test_refusals_and_durations_of_commands_are_bounded() -> None:
    log = commands.CommandLog()
    for number in range(3 * commands.MAX_DURATIONS):
        log.accept(dialect.MAV_RESULT_ACCEPTED, float(number))
        log.refuse(commands.CommandRefusal(float(number), 255, 190, "", 0, dialect.MAV_RESULT_DENIED, ""))
    last = 3 * commands.MAX_DURATIONS
    assert log.durations == [float(number) for number in range(last - commands.MAX_DURATIONS, last)]
    assert [refusal.at for refusal in log.refusals] == [*range(last - commands.MAX_REFUSALS, last)]
    assert log.results == {dialect.MAV_RESULT_ACCEPTED: last, dialect.MAV_RESULT_DENIED: last}

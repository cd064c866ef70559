"""The I/O-free cores of offboard: what setpoint messages ask for, whose setpoints fly, and when they no longer do."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from msgspec.structs import replace

from anafi_mav.mavlink import dialect
from anafi_mav.services.setpoint.setpoint_messages import attitude_setpoint, global_setpoint, local_setpoint
from anafi_mav.vehicle.base.velocity_loop import turn_towards
from anafi_mav.vehicle.offboard.setpoints import AttitudeSetpoint, MotionSetpoint, PositionReference, Setpoint
from anafi_mav.vehicle.offboard.silence import SILENCE
from anafi_mav.vehicle.offboard.stream import (
    LATE_AFTER_STREAM,
    MAX_PILOTS,
    TOGETHER,
    TRANSITIONS,
    Engagement,
    Event,
    OffboardStream,
    State,
    lasts,
)

NAN = math.nan


IN_THE_AIR = {Event.ENGAGE, Event.ENGAGE_SINGLE, Event.JOIN, Event.LIFT, Event.DISENGAGE}


def test_every_offboard_state_has_its_events() -> None:
    own = {
        State.IDLE: {Event.CLIMB},
        State.COUNTING: {Event.CLIMB, Event.STAY, Event.SILENCE},
        State.ENGAGED: {Event.CLIMB, Event.SILENCE},
        State.CLIMBING: {Event.CLIMB, Event.STAY, Event.SILENCE},
        State.LIFTING: {Event.RISEN, Event.SILENCE},
        State.JOINED: {Event.RISEN, Event.SILENCE},
        State.SINGLE: set(),
    }
    assert {state: set(row) - IN_THE_AIR for state, row in TRANSITIONS.items()} == own
    assert all(row.keys() >= IN_THE_AIR for row in TRANSITIONS.values())


@pytest.mark.parametrize(("state", "event"), list(itertools.product(State, Event)))
def test_engagement_exists_unless_idle(state: State, event: Event) -> None:
    """Whatever happens: no state without a pilot, and none of its facts after its end."""
    stream = OffboardStream().receive("a", LEVEL, 0.0)
    if state is not State.IDLE:
        stream = replace(stream, engagement=Engagement("a", state, chosen_by="a"))
    after = stream.after(event, Engagement("a") if event is not Event.DISENGAGE else None)
    assert after.state is TRANSITIONS[state].get(event, state)
    assert (after.engagement is None) is (after.state is State.IDLE)
    assert (after.setpoint is None) is not after.flying
    assert (after.deadline is None) is (after.state in (State.IDLE, State.SINGLE))


def attitude_target(mask: int, q: tuple[float, ...], thrust: float, yaw_rate: float = 0.0) -> object:
    return dialect.MAVLink_set_attitude_target_message(0, 1, 1, mask, list(q), 0.0, 0.0, yaw_rate, thrust)


def test_offboard_attitude() -> None:
    # yaw 90 degrees, nothing else: q = (cos 45, 0, 0, sin 45)
    half = math.sqrt(0.5)
    setpoint = attitude_setpoint(attitude_target(7, (half, 0, 0, half), 0.75))
    assert isinstance(setpoint, AttitudeSetpoint)
    assert setpoint.yaw == pytest.approx(math.pi / 2)
    assert setpoint.climb == pytest.approx(0.5)
    # heading west of north by 170, target east by 90: the short way is counter-clockwise, -100 degrees
    assert turn_towards(setpoint.yaw, math.radians(-170)) == pytest.approx(1.5 * math.radians(-100))


@pytest.mark.parametrize(
    ("mask", "thrust", "climb"), [(7, 0.5, 0.0), (7, 0.0, -1.0), (7, 1.0, 1.0), (7, NAN, 0.0), (7 | 64, 1.0, 0.0)]
)
def test_thrust_is_vertical_speed(mask: int, thrust: float, climb: float) -> None:
    setpoint = attitude_setpoint(attitude_target(mask, (1, 0, 0, 0), thrust))
    assert isinstance(setpoint, AttitudeSetpoint)
    assert setpoint.climb == climb


@pytest.mark.parametrize(
    ("mask", "q", "reason"),
    [
        (128, (1, 0, 0, 0), "body rates without attitude"),
        (7, (0, 0, 0, 0), "not a rotation"),
        (7, (NAN, 0, 0, 0), "not a rotation"),
        (7, (0, 1, 0, 0), "upside down"),
        (7, (1.2, 0, 0, 0), "length is not 1"),
        (7, (1e30, 0, 1e30, 0), "length is not 1"),
    ],
)
def test_unusable_attitude_setpoint_names_its_reason(mask: int, q: tuple[float, ...], reason: str) -> None:
    refusal = attitude_setpoint(attitude_target(mask, q, 0.5))
    assert isinstance(refusal, str)
    assert reason in refusal


@pytest.mark.parametrize("thrust", [-5.0, -0.01, 1.01, 100.0])
def test_thrust_of_another_unit_is_not_full_thrust(thrust: float) -> None:
    assert attitude_setpoint(attitude_target(7, (1, 0, 0, 0), thrust)) == "thrust is not 0 to 1"


LEVEL = AttitudeSetpoint(0, 0, 0, 0, 0)
NOSE_DOWN = AttitudeSetpoint(0, -0.1, 0, 0, 0)


def test_offboard_session_ends_with_its_setpoints() -> None:
    stream = OffboardStream()
    assert stream.candidate("a", 0.0) is None
    stream = stream.receive("a", LEVEL, 10.0)
    assert stream.candidate("a", 10.4) == "a"
    assert stream.candidate("a", 10.0 + SILENCE) is None
    stream = stream.engage(Event.ENGAGE, "a", "a").receive("a", LEVEL, 10.4)
    assert stream.expire(10.4 + SILENCE - 0.01) is stream
    ended = stream.expire(10.4 + SILENCE)
    assert ended.state is State.IDLE
    assert (ended.setpoint, ended.pilot, ended.engagement) == (None, None, None)
    assert ended.expire(99.0) is ended


@pytest.mark.parametrize(
    ("setpoint", "guided", "seconds"),
    [
        (MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0)), 1.5, 1.45),
        (MotionSetpoint(PositionReference.LOCAL, yaw_rate=0.3), 3.0, 2.95),
        (MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0), yaw=1.0), 0.5, 0.45),
        (MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0)), None, 0.45),
        (MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0), acceleration=(1.0, 0.0, 0.0)), 1.5, 0.45),
        (MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0), position=(9.0, 0.0, 0.0)), 1.5, 0.45),
        (MotionSetpoint(PositionReference.LOCAL, acceleration=(1.0, 0.0, 0.0)), 1.5, 0.45),
        (MotionSetpoint(PositionReference.LOCAL, yaw=1.0), 1.5, 0.45),
        (LEVEL, 1.5, 0.45),
    ],
)
def test_silence_limit_is_longer_for_guided_velocities_alone(
    setpoint: Setpoint, guided: float | None, seconds: float
) -> None:
    assert lasts(setpoint, guided) == pytest.approx(seconds)


def test_sticks_of_a_velocity_last_until_shortly_before_end() -> None:
    """The layer below centres sticks of half a second: it must not before a velocity of 1.5 s is over."""
    velocity = MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0))
    stream = OffboardStream().receive("a", velocity, 10.0, 1.45).engage(Event.ENGAGE, "a")
    assert [round(stream.stick_age(10.0 + age), 2) for age in (0.0, 0.5, 1.0, 1.2, 1.45)] == [0.0, 0.0, 0.0, 0.2, 0.45]
    stream = stream.receive("b", LEVEL, 11.4)
    assert stream.objection("b") == "another program flies"  # the pilot's velocity still does
    assert stream.expire(11.44) is stream
    assert stream.expire(11.45).state is State.IDLE


def test_silence_of_an_idle_stream_changes_nothing() -> None:
    stream = OffboardStream().receive("a", LEVEL, 0.0)
    assert stream.deadline is None
    assert stream.expire(5.0) is stream


def test_a_session_has_one_pilot_and_ends_with_him() -> None:
    stream = OffboardStream().receive("a", LEVEL, 0.0).receive("b", NOSE_DOWN, 0.1)
    assert stream.candidate("a", 0.2) == "a"  # who asks flies, not who sent last
    assert stream.candidate("c", 0.2) == "b"
    stream = stream.engage(Event.ENGAGE, "a")
    assert stream.setpoint == LEVEL
    stream = stream.receive("b", NOSE_DOWN, 0.3)
    assert (stream.objection("a"), stream.objection("b")) == (None, "another program flies")
    assert stream.setpoint == LEVEL
    assert stream.deadline == SILENCE
    stream = stream.expire(SILENCE)  # b streams on, and flies nothing
    assert (stream.state, stream.setpoint) == (State.IDLE, None)
    assert stream.objection("b") is None
    assert stream.candidate("a", 0.3 + SILENCE - 0.01) == "b"
    assert stream.candidate("a", 0.3 + SILENCE) is None


def crowd() -> OffboardStream:
    stream = OffboardStream()
    for number in range(MAX_PILOTS):
        stream = stream.receive(number, LEVEL, 0.0)
    return stream


def test_a_crowd_of_senders_is_bounded() -> None:
    stream = crowd()
    assert {stream.objection(number) for number in range(MAX_PILOTS)} == {None}
    refused = stream.receive("one more", LEVEL, 0.1)
    assert refused.objection("one more") == "too many programs stream"
    assert stream.receive("one more", LEVEL, SILENCE).objection("one more") is None  # the others have fallen silent


def test_setpoints_of_a_known_sender_count_in_a_crowd() -> None:
    stream = crowd().engage(Event.ENGAGE, 3).receive(3, NOSE_DOWN, 0.1)
    assert stream.setpoint == NOSE_DOWN
    assert stream.deadline == 0.1 + SILENCE
    assert len(stream.received) == MAX_PILOTS  # what others have sent stays


def test_pilot_whose_silence_is_noticed_late_is_not_crowded_out() -> None:
    """The timer of a busy host is late: what flies has a setpoint, and a deadline, until it is ended."""
    stream = crowd().engage(Event.ENGAGE, 3).receive("one more", LEVEL, SILENCE + 0.1)
    assert stream.setpoint == LEVEL
    assert stream.deadline == SILENCE
    assert stream.expire(SILENCE + 0.1).state is State.IDLE


PLACE = MotionSetpoint(PositionReference.LOCAL, position=(1.0, 2.0, -3.0))
ELSEWHERE = MotionSetpoint(PositionReference.LOCAL, position=(5.0, 6.0, -7.0))


def is_single(stream: OffboardStream, setpoint: Setpoint, now: float, sender: str = "a") -> bool:
    return stream.receive(sender, setpoint, now).received[sender].is_single


def test_a_single_setpoint_ends_by_no_silence() -> None:
    stream = OffboardStream().receive("a", PLACE, 0.0).engage(Event.ENGAGE_SINGLE, "a")
    assert stream.deadline is None
    assert stream.expire(60.0) is stream
    assert stream.setpoint == PLACE
    ended = stream.after(Event.DISENGAGE)
    assert (ended.setpoint, ended.state) == (None, State.IDLE)


def test_newest_of_single_setpoints_is_flown() -> None:
    """The first one waits for what flies to end; by then its sender wants to be elsewhere."""
    stream = OffboardStream().receive("a", PLACE, 0.0).receive("a", ELSEWHERE, TOGETHER)
    assert stream.received["a"].is_single
    assert stream.engage(Event.ENGAGE_SINGLE, "a").setpoint == ELSEWHERE


def test_a_second_setpoint_makes_a_stream_of_the_first() -> None:
    assert is_single(OffboardStream(), PLACE, 0.0)
    assert not is_single(OffboardStream(), LEVEL, 0.0)  # it has no end
    velocity = MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0))
    assert not is_single(OffboardStream(), velocity, 0.0)
    stream = OffboardStream().receive("a", PLACE, 0.0).engage(Event.ENGAGE_SINGLE, "a")
    assert not is_single(stream, PLACE, TOGETHER - 0.01)
    assert is_single(stream, PLACE, TOGETHER)
    assert is_single(stream, PLACE, 0.1, sender="b")
    stream = stream.receive("a", PLACE, 0.4).after(Event.ENGAGE)
    assert not is_single(stream, PLACE, 0.8)
    assert stream.expire(0.4 + SILENCE).state is State.IDLE


def test_a_position_straggles_after_the_silence_of_positions_alone() -> None:
    stream = OffboardStream().receive("a", PLACE, 0.0).engage(Event.ENGAGE, "a").expire(SILENCE)
    assert not is_single(stream, PLACE, SILENCE + LATE_AFTER_STREAM - 0.01)
    assert is_single(stream, PLACE, SILENCE + LATE_AFTER_STREAM)
    assert is_single(stream, PLACE, SILENCE + 0.1, sender="b")
    stream = stream.receive("b", LEVEL, 10.0).engage(Event.ENGAGE, "b").expire(10.0 + SILENCE)
    assert is_single(stream, PLACE, 10.0 + SILENCE + TOGETHER, sender="b")


def climbing(*times: float, engaged: bool = False) -> OffboardStream:
    """A client asks to climb at these times."""
    stream = OffboardStream().receive("a", UP, times[0])
    if engaged:
        stream = stream.engage(Event.ENGAGE, "a", "a")
    for now in times:
        stream = stream.receive("a", UP, now).climb("a", now)
    return stream


UP = AttitudeSetpoint(0, 0, 0, 0, 0.4)


@pytest.mark.parametrize("engaged", [False, True])
def test_climb_is_counted_for_a_second_without_a_gap(engaged: bool) -> None:
    counted = climbing(0.0, 0.4, 0.8, 0.99, engaged=engaged)
    assert counted.state is (State.CLIMBING if engaged else State.COUNTING)
    assert (counted.climbs_since, counted.flying) == (0.0, engaged)
    assert climbing(0.0, 0.4, 0.8, 1.0, engaged=engaged).state is State.LIFTING
    again = climbing(0.0, 0.4, 0.86, 1.0, engaged=engaged)
    assert (again.state, again.climbs_since) == (counted.state, 0.86)
    stayed = counted.after(Event.STAY)
    assert stayed.state is (State.ENGAGED if engaged else State.IDLE)
    assert climbing(0.0, 0.4, engaged=engaged).expire(0.4 + SILENCE).state is State.IDLE


def test_gap_of_the_whole_silence_begins_the_second_again() -> None:
    assert climbing(0.0, SILENCE).climbs_since == SILENCE
    assert climbing(0.0, SILENCE - 0.01).climbs_since == 0.0


@pytest.mark.parametrize("engaged", [False, True])
def test_setpoint_that_stays_begins_the_second_again(engaged: bool) -> None:
    stream = climbing(0.0, 0.4, 0.8, engaged=engaged).receive("a", LEVEL, 0.9).after(Event.STAY)
    again = stream.receive("a", UP, 1.0).climb("a", 1.0)
    assert (again.state, again.climbs_since) == (State.CLIMBING if engaged else State.COUNTING, 1.0)


def test_engagement_that_asks_to_climb_remains_of_the_client_that_chose_offboard() -> None:
    """Mode Offboard chosen by a client does not become ArduPilot's Guided by a setpoint that climbs."""
    stream = OffboardStream().receive("a", LEVEL, 0.0).engage(Event.ENGAGE, "a", "chooser")
    assert stream.climbs_since is None
    lifting = stream.receive("a", UP, 0.2).climb("a", 0.2).climb("a", 0.6).climb("a", 1.0).climb("a", 1.2)
    assert lifting.state is State.LIFTING
    assert lifting.climbs_since is None
    assert lifting.engagement is not None
    assert (lifting.pilot, lifting.engagement.chosen_by) == ("a", "chooser")


def test_facts_of_an_engagement_are_noted_while_it_lasts() -> None:
    idle = OffboardStream().receive("a", LEVEL, 0.0)
    assert idle.note(chosen_by="b") == idle
    noted = idle.engage(Event.ENGAGE, "a").note(chosen_by="b").engagement
    assert noted is not None
    assert (noted.pilot, noted.state, noted.chosen_by) == ("a", State.ENGAGED, "b")


def test_climb_of_another_client_does_not_count() -> None:
    stream = climbing(0.0, 0.4, 0.8)
    assert stream.climb("b", 1.1) is stream
    later = stream.climb("b", 1.3)
    assert (later.pilot, later.climbs_since, later.state) == ("b", 1.3, State.COUNTING)


IGNORE_POSITION, IGNORE_VELOCITY, IGNORE_ACCELERATION = 0x007, 0x038, 0x1C0
IGNORE_YAW, IGNORE_YAW_RATE, FORCE = 0x400, 0x800, 0x200


def local(mask: int, frame: int = 1, **values: float) -> Any:
    message = dialect.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, 1.0, 2.0, -3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.5, 0.25
    )
    for name, value in values.items():
        setattr(message, name, value)
    return message


def on_earth(mask: int, frame: int = 6, **values: float) -> Any:
    message = dialect.MAVLink_set_position_target_global_int_message(
        0, 1, 1, frame, mask, 488789000, 23677000, 30.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.5, 0.25
    )
    for name, value in values.items():
        setattr(message, name, value)
    return message


def masked(first: int, mask: int, values: tuple[float, float, float]) -> tuple[float | None, ...]:
    """What is left of three values; the mask's bits are written out here, not computed as the code does."""
    bits = {0: (0x001, 0x002, 0x004), 3: (0x008, 0x010, 0x020), 6: (0x040, 0x080, 0x100)}[first]
    return tuple(None if mask & bit else value for bit, value in zip(bits, values, strict=True))


def test_each_type_mask_selects_its_fields() -> None:
    """All 4096 of them."""
    refused = set()
    for mask in range(0x1000):
        setpoint = local_setpoint(local(mask))
        if isinstance(setpoint, str):
            refused.add((mask & 0xDFF == 0xDFF, bool(mask & FORCE) and mask & IGNORE_ACCELERATION != 0x1C0, setpoint))
            continue
        assert setpoint.position == masked(0, mask, (1.0, 2.0, -3.0))
        assert setpoint.velocity == masked(3, mask, (4.0, 5.0, 6.0))
        assert setpoint.acceleration == masked(6, mask, (7.0, 8.0, 9.0))
        assert setpoint.yaw == (None if mask & IGNORE_YAW else 0.5)
        assert setpoint.yaw_rate == (None if mask & IGNORE_YAW_RATE else 0.25)
    assert refused == {
        (True, False, "all fields are ignored"),
        (False, True, "forces are unsupported"),
    }


@pytest.mark.parametrize(
    ("frame", "origin", "body"),
    [
        (1, PositionReference.LOCAL, False),
        (7, PositionReference.VEHICLE, False),
        (8, PositionReference.VEHICLE, True),
        (9, PositionReference.VEHICLE, True),
        (12, PositionReference.VEHICLE, True),
    ],
)
def test_local_frames(frame: int, origin: PositionReference, body: bool) -> None:
    setpoint = local_setpoint(local(0, frame))
    assert isinstance(setpoint, MotionSetpoint)
    assert (setpoint.origin, setpoint.body) == (origin, body)


@pytest.mark.parametrize(("frame", "origin"), [(5, PositionReference.SEA), (6, PositionReference.TAKEOFF)])
def test_global_frames(frame: int, origin: PositionReference) -> None:
    setpoint = global_setpoint(on_earth(0, frame))
    assert isinstance(setpoint, MotionSetpoint)
    assert (setpoint.origin, setpoint.body) == (origin, False)
    assert setpoint.position == pytest.approx((48.8789, 2.3677, 30.0))


def test_all_other_frames_are_refused_by_name() -> None:
    for frame in range(256):
        if frame not in (1, 7, 8, 9, 12):
            assert isinstance(local_setpoint(local(0, frame)), str)
        if frame not in (0, 3, 5, 6):
            assert isinstance(global_setpoint(on_earth(0, frame)), str)
    assert "terrain" in str(global_setpoint(on_earth(0, 11)))
    assert "terrain" in str(local_setpoint(local(0, 11)))


@pytest.mark.parametrize("value", [NAN, math.inf, -math.inf])
def test_nan_in_a_used_setpoint_field_is_refused(value: float) -> None:
    for name, bit in [("x", 0x001), ("vz", 0x020), ("afy", 0x080), ("yaw", IGNORE_YAW), ("yaw_rate", IGNORE_YAW_RATE)]:
        assert local_setpoint(local(0, **{name: value})) == "a value is not a number"
        assert isinstance(local_setpoint(local(bit, **{name: value})), MotionSetpoint)
    assert isinstance(global_setpoint(on_earth(0, alt=value)), str)


@pytest.mark.parametrize(
    ("name", "value"), [("vx", 500.0), ("vz", -21.0), ("afx", 981.0), ("yaw_rate", 30.0), ("x", 1e30)]
)
def test_another_unit_is_not_flown(name: str, value: float) -> None:
    assert isinstance(local_setpoint(local(0, **{name: value})), str)


def test_position_with_one_coordinate_is_refused() -> None:
    assert global_setpoint(on_earth(0x001)) == global_setpoint(on_earth(0x002)) == "latitude without longitude"
    height = global_setpoint(on_earth(0x003))
    assert isinstance(height, MotionSetpoint)
    assert height.position == (None, None, 30.0)


@pytest.mark.parametrize(
    ("mask", "moves"),
    [
        (IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW | IGNORE_YAW_RATE, True),  # 3576 of MAVProxy's position
        (IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW_RATE, True),
        (IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW_RATE | 0x003, True),  # a height alone
        (IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW_RATE | 0x004, True),  # no height
        (IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW_RATE | 0x001, False),
        (IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW, False),
        (IGNORE_ACCELERATION | IGNORE_YAW_RATE, False),
        (IGNORE_VELOCITY | IGNORE_YAW_RATE, False),
        (IGNORE_POSITION | IGNORE_ACCELERATION | IGNORE_YAW_RATE, False),  # 4039 without yaw: MAVProxy's velocity
    ],
)
def test_setpoint_moves_by_type_mask(mask: int, moves: bool) -> None:
    setpoint = local_setpoint(local(mask))
    assert isinstance(setpoint, MotionSetpoint)
    assert setpoint.moves is moves

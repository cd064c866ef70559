"""Control of the gimbal and the end of rates, by time that the test hands in."""

from __future__ import annotations

import itertools
import math

import pytest

from anafi_mav.drone import Aim
from anafi_mav.drone.events import Axis
from anafi_mav.services.gimbal import control, rates
from anafi_mav.services.gimbal.control import (
    MAX_CLIENTS,
    NO_CLIENT,
    OWNER_SILENCE,
    Answer,
    GimbalControl,
    Heartbeats,
    State,
)
from anafi_mav.services.gimbal.rates import COMMAND_SILENCE, MESSAGE_SILENCE, GimbalRates, RateEvent, RateState

STATION, PROGRAM, STRANGER = (255, 190), (245, 191), (7, 1)
NAN = math.nan
TAKE, RELEASE = (-2.0, -2.0, -1.0, -1.0), (-3.0, -3.0, -1.0, -1.0)


def made() -> tuple[GimbalControl, Heartbeats]:
    heartbeats = Heartbeats()
    return GimbalControl(heartbeats), heartbeats


def test_free_gimbal_is_moved_by_every_client() -> None:
    gimbal, _ = made()
    assert all(gimbal.allows(client) for client in (STATION, PROGRAM))


@pytest.mark.parametrize("ids", [TAKE, (255.0, 190.0, -1.0, -1.0), (255.0, 190.0, NAN, NAN)])
def test_control_taken_excludes_other_clients(ids: tuple[float, ...]) -> None:
    gimbal, _ = made()
    assert gimbal.configure(STATION, ids, 0.0) is Answer.DONE
    assert (gimbal.primary, gimbal.secondary) == (STATION, NO_CLIENT)
    assert (gimbal.allows(STATION), gimbal.allows(PROGRAM)) == (True, False)


def test_control_stolen_ends_both_controls_of_the_former_owner() -> None:
    gimbal, _ = made()
    gimbal.configure(PROGRAM, (-2.0, -2.0, -2.0, -2.0), 0.0)
    assert (gimbal.primary, gimbal.secondary) == (PROGRAM, PROGRAM)
    assert gimbal.configure(STATION, TAKE, 1.0) is Answer.DONE
    assert (gimbal.primary, gimbal.secondary) == (STATION, NO_CLIENT)


def test_release_by_a_stranger_changes_nothing() -> None:
    gimbal, _ = made()
    gimbal.configure(STATION, TAKE, 0.0)
    assert gimbal.configure(STRANGER, RELEASE, 1.0) is Answer.DONE
    assert gimbal.primary == STATION
    assert gimbal.configure(STATION, RELEASE, 2.0) is Answer.DONE
    assert gimbal.state is State.FREE


@pytest.mark.parametrize(
    "ids", [(300.0, 1.0, -1.0, -1.0), (7.0, 0.0, -1.0, -1.0), (0.5, 1.0, -1.0, -1.0), (math.inf, 1.0, -1.0, -1.0)]
)
def test_ids_that_are_none_are_refused(ids: tuple[float, ...]) -> None:
    gimbal, _ = made()
    assert gimbal.configure(STATION, ids, 0.0) is Answer.INVALID
    assert gimbal.state is State.FREE


def test_control_expires_with_the_heartbeats_of_its_owner() -> None:
    gimbal, heartbeats = made()
    gimbal.configure(STATION, TAKE, 0.0)
    heartbeats.receive(STATION, 3.0)
    heartbeats.receive(PROGRAM, 7.0)
    assert gimbal.expire(3.0 + OWNER_SILENCE - 0.1) is None
    assert gimbal.expire(3.0 + OWNER_SILENCE) == STATION
    assert gimbal.state is State.FREE


def test_silent_secondary_loses_its_control_alone() -> None:
    gimbal, heartbeats = made()
    gimbal.configure(STATION, (*TAKE[:2], *map(float, PROGRAM)), 0.0)
    heartbeats.receive(STATION, 5.0)
    assert gimbal.expire(5.5) == PROGRAM
    assert (gimbal.primary, gimbal.secondary) == (STATION, NO_CLIENT)


def test_stall_of_the_host_is_no_silence() -> None:
    gimbal, heartbeats = made()
    gimbal.configure(STATION, TAKE, 0.0)
    heartbeats.receive(STATION, 1.0)
    heartbeats.add_stall(10.0)
    gimbal.add_stall(10.0)
    assert gimbal.expire(15.0) is None
    assert gimbal.expire(16.0) == STATION


def test_mission_has_control_before_clients_and_frees_it() -> None:
    gimbal, _ = made()
    gimbal.configure(STATION, TAKE, 0.0)
    assert gimbal.mission(needs_gimbal=True)
    assert not gimbal.mission(needs_gimbal=True)
    assert gimbal.configure(STATION, TAKE, 1.0) is Answer.MISSION
    assert not gimbal.allows(STATION)
    assert gimbal.mission(needs_gimbal=False)
    assert gimbal.allows(PROGRAM)


def test_heartbeats_of_invented_clients_are_bounded() -> None:
    heartbeats = Heartbeats()
    for number in range(MAX_CLIENTS + 5):
        heartbeats.receive((number % 256, 1 + number // 256), float(number))
    assert heartbeats.last((0, 1)) is None
    assert heartbeats.last(((MAX_CLIENTS + 4) % 256, 1)) == MAX_CLIENTS + 4


def test_heartbeats_of_clients_in_control_are_kept() -> None:
    gimbal, heartbeats = made()
    gimbal.configure(STATION, TAKE, 0.0)
    heartbeats.receive(STATION, 9.9, {STATION, PROGRAM})
    heartbeats.receive(PROGRAM, 9.9, {STATION, PROGRAM})
    for number in range(MAX_CLIENTS):
        heartbeats.receive((1 + number, 7), 10.0, {STATION, PROGRAM, None})
    assert (heartbeats.last(STATION), heartbeats.last(PROGRAM)) == (9.9, 9.9)
    assert heartbeats.last((1, 7)) is None
    assert gimbal.expire(10.0) is None


def test_sender_without_an_id_neither_moves_nor_takes() -> None:
    gimbal, _ = made()
    assert not gimbal.allows(NO_CLIENT)
    assert gimbal.configure(NO_CLIENT, TAKE, 0.0) is Answer.INVALID
    gimbal.configure(STATION, TAKE, 0.0)
    assert not gimbal.allows(NO_CLIENT)
    assert gimbal.configure(NO_CLIENT, TAKE, 1.0) is Answer.INVALID
    assert gimbal.primary == STATION


def test_secondary_client_needs_a_primary_one() -> None:
    gimbal, _ = made()
    assert gimbal.configure(PROGRAM, (-1.0, -1.0, -2.0, -2.0), 0.0) is Answer.NO_PRIMARY
    assert (gimbal.state, gimbal.secondary) == (State.FREE, NO_CLIENT)
    gimbal.configure(STATION, TAKE, 0.0)
    assert gimbal.configure(PROGRAM, (-1.0, -1.0, -2.0, -2.0), 1.0) is Answer.DONE
    assert gimbal.configure(STATION, RELEASE, 2.0) is Answer.DONE
    assert (gimbal.state, gimbal.secondary) == (State.FREE, NO_CLIENT)


def test_tables_of_transitions_name_only_states_and_events() -> None:
    for table, states, events in (
        (control.TRANSITIONS, control.State, control.Event),
        (rates.TRANSITIONS, RateState, RateEvent),
    ):
        assert set(table) == set(states)
        for state, event in itertools.product(states, events):
            assert table[state].get(event, state) in states  # type: ignore[index]


# Rates.

DOWN, LEFT = {Axis.PITCH: Aim(-10.0)}, {Axis.YAW: Aim(-5.0)}
ZERO = {Axis.PITCH: Aim(0.0)}


def test_rate_by_message_ends_with_the_messages() -> None:
    turning = GimbalRates(Heartbeats())
    turning.take(STATION, DOWN, 0.0, by_message=True)
    turning.take(STATION, DOWN, 1.1, by_message=True)  # a sender of one a second is late
    assert not turning.expire(1.1 + MESSAGE_SILENCE - 0.01)
    assert turning.expire(1.1 + MESSAGE_SILENCE + 0.01)
    assert not turning.turns


def test_rate_by_command_outlives_messages_but_no_heartbeats() -> None:
    heartbeats = Heartbeats()
    turning = GimbalRates(heartbeats)
    turning.take(STATION, DOWN, 0.0, by_message=False)
    assert not turning.expire(60.0)  # it sends no heartbeats
    heartbeats.receive(STATION, 60.0)
    assert not turning.expire(60.0 + COMMAND_SILENCE - 0.1)
    assert turning.expire(60.0 + COMMAND_SILENCE)


def test_newer_rates_replace_all_earlier_ones() -> None:
    turning = GimbalRates(Heartbeats())
    turning.take(STATION, {**DOWN, **LEFT}, 0.0, by_message=False)
    turning.take(PROGRAM, DOWN, 1.0, by_message=True)
    assert (turning.rates, turning.client, turning.is_by_command) == (DOWN, PROGRAM, False)


@pytest.mark.parametrize("end", ["zero", "angle", "limit", "control"])
def test_rate_ends_by_each_other_event(end: str) -> None:
    turning = GimbalRates(Heartbeats())
    turning.take(STATION, DOWN, 0.0, by_message=False)
    if end == "zero":
        turning.take(STATION, ZERO, 1.0, by_message=False)
    elif end == "angle":
        turning.replace_by_angles()
    elif end == "limit":
        assert turning.limit([Axis.PITCH])
    else:
        assert turning.end()
        assert not turning.end()
    assert (turning.turns, turning.client, turning.rates) == (False, None, {})


def test_limit_of_one_axis_leaves_the_other_turning() -> None:
    turning = GimbalRates(Heartbeats())
    turning.take(STATION, {**DOWN, **LEFT}, 0.0, by_message=False)
    assert not turning.limit([Axis.PITCH])
    assert turning.rates == {Axis.PITCH: Aim(0.0), **LEFT}

"""When a Hold counts against the drone's own return, and what cancels an announced one."""

from __future__ import annotations

import pytest

from anafi_mav.vehicle.hold_rule import ANSWER, APART, MAX_CLIENTS, HoldRule


def test_hold_counts_five_seconds_after_the_clients_previous_hold() -> None:
    rule = HoldRule()
    assert rule.arrive("a", 100.0)
    assert not rule.arrive("a", 104.0)
    assert not rule.arrive("a", 108.0)  # 4 s after the one that did not count
    assert rule.arrive("a", 113.0)
    assert rule.arrive("b", 113.1)


def test_hold_at_one_hertz_counts_once() -> None:
    rule = HoldRule()
    assert [rule.arrive("program", float(second)) for second in range(60)] == [True] + [False] * 59


@pytest.mark.parametrize(("after", "cancels"), [(4.9, False), (APART, True), (ANSWER, True), (15.1, False)])
def test_second_hold_counts_5_to_15_s_after_offer(after: float, cancels: bool) -> None:
    rule = HoldRule()
    rule.offer("a", 50.0)
    assert rule.answers("a", 50.0 + after) is cancels
    assert not rule.answers("b", 50.0 + after)


def test_withdrawn_offer_is_not_answered() -> None:
    rule = HoldRule()
    rule.offer("a", 50.0)
    rule.withdraw()
    assert not rule.answers("a", 56.0)


def test_holds_of_gone_clients_are_forgotten() -> None:
    rule = HoldRule()
    for client in ("a", "b"):
        rule.arrive(client, 100.0)
        rule.offer(client, 100.0)
    rule.forget_clients(lambda client: client == "a")
    assert [rule.arrive(client, 101.0) for client in ("a", "b")] == [True, False]
    assert [rule.answers(client, 106.0) for client in ("a", "b")] == [False, True]


def test_remembered_clients_are_bounded() -> None:
    rule = HoldRule()
    for number in range(3 * MAX_CLIENTS):
        rule.arrive(number, float(number))
        rule.offer(number, float(number))
    assert len(rule._newest) == len(rule._offered) == MAX_CLIENTS

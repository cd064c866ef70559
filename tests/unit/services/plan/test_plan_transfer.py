"""The transfer machine of missions, fences and rally points: conformance 46, 48, 61-72, without sockets."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.plan_wire import (
    FENCE,
    MISSION,
    RALLY,
    Client,
    Kind,
    Wire,
    an_item,
    items,
    mission_protocol,
    peer,
    replies,
    texts,
)

from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import ARDUPILOT, PX4, STANDARD, Flavour
from anafi_mav.services.plan.item_messages import item_float, item_int, item_of
from anafi_mav.services.plan.plan_protocol import ALL, MAX_WAITING, MissionProtocol
from anafi_mav.services.plan.plan_requests import MAX_TRIES, REQUEST_EVERY
from anafi_mav.services.plan.plan_transfer import (
    ECHOES,
    PATIENCE,
    RECENT,
    TRANSITIONS,
    Changed,
    Commit,
    Event,
    Peer,
    PlanKind,
    Reply,
    State,
)
from anafi_mav.vehicle.fence.plan_items import MAX_ITEMS, PlanFault, PlanItem, opaque_id

ACCEPTED, ERROR, UNSUPPORTED = dialect.MAV_MISSION_ACCEPTED, dialect.MAV_MISSION_ERROR, dialect.MAV_MISSION_UNSUPPORTED
DENIED, NO_SPACE = dialect.MAV_MISSION_DENIED, dialect.MAV_MISSION_NO_SPACE
CANCELLED, INVALID_SEQUENCE = dialect.MAV_MISSION_OPERATION_CANCELLED, dialect.MAV_MISSION_INVALID_SEQUENCE

ME, OTHER = peer(), peer(254, 191, channel="b")


def count(number: int, kind: int = FENCE) -> Any:
    return dialect.MAVLink_mission_count_message(1, 1, number, kind)


def item(seq: int, content: PlanItem | None = None, kind: int = FENCE) -> Any:
    return item_int(content or an_item(seq), seq, 1, 1, kind)


def ack(result: int, kind: int = FENCE) -> Any:
    return dialect.MAVLink_mission_ack_message(1, 1, result, kind)


def clear(kind: int = FENCE) -> Any:
    return dialect.MAVLink_mission_clear_all_message(1, 1, kind)


def ask(seq: int, kind: int = FENCE) -> Any:
    return dialect.MAVLink_mission_request_int_message(1, 1, seq, kind)


def ask_list(kind: int = FENCE) -> Any:
    return dialect.MAVLink_mission_request_list_message(1, 1, kind)


def partial(first: int, last: int, kind: int = FENCE) -> Any:
    return dialect.MAVLink_mission_write_partial_list_message(1, 1, first, last, kind)


def commit_of(effects: Any) -> Commit:
    (commit,) = (effect for effect in effects if isinstance(effect, Commit))
    return commit


def uploaded(plans: MissionProtocol, number: int, who: Peer = ME, kind: int = FENCE, now: float = 0.0) -> Any:
    """Upload and store; the final acknowledgement."""
    plans.receive(count(number, kind), who, now)
    for seq in range(number):
        effects = plans.receive(item(seq, kind=kind), who, now)
    (final,) = replies(plans.stored(commit_of(effects), now))
    return final


# The table.


class Bench:
    """A transfer in a state of one's choice, and each event done to it."""

    def __init__(self, state: State) -> None:
        self.plans = mission_protocol()
        self.transfer = self.plans.transfers[FENCE]
        self.transfer.put(items(3))
        self.commit: Commit | None = None
        if state is not State.IDLE:
            self.plans.receive(count(2), ME, 0.0)
        if state is State.STORING:
            self.plans.receive(item(0), ME, 0.0)
            self.commit = commit_of(self.plans.receive(item(1), ME, 0.0))
        assert self.transfer.state is state

    def do(self, event: Event) -> None:
        receive = self.plans.receive
        match event:
            case Event.BEGIN:
                receive(count(2), ME, 0.1)
            case Event.ITEM:
                receive(item(0), ME, 0.1)
            case Event.LAST_ITEM:
                if self.transfer.state is State.RECEIVING:
                    receive(item(0), ME, 0.1)
                receive(item(1), ME, 0.1)
            case Event.CLEAR:
                receive(clear(), ME, 0.1)
            case Event.REFUSE:
                receive(item(0, an_item(0, 666)), ME, 0.1)
            case Event.CANCEL:
                receive(ack(CANCELLED), ME, 0.1)
            case Event.SILENCE:
                for step in range(MAX_TRIES + 2):
                    self.plans.expire(step * 2.0 * REQUEST_EVERY)
            case Event.STORED:
                commit = self.commit or Commit({FENCE: items(1)}, ME, FENCE)
                self.plans.stored(commit, 0.1)


@pytest.mark.parametrize("event", Event)
@pytest.mark.parametrize("state", State)
def test_every_event_in_every_state(state: State, event: Event) -> None:
    """What the table has happens; what it has not changes neither state nor plan."""
    bench = Bench(state)
    bench.do(event)
    assert bench.transfer.state is TRANSITIONS[state].get(event, state)
    if (state, event) == (State.STORING, Event.STORED):
        assert bench.transfer.items == items(2)
    else:
        assert bench.transfer.items == items(3)  # the old plan, until the new one is stored


def test_every_state_can_be_left_and_reached() -> None:
    assert set(TRANSITIONS) == set(State)
    assert {to for row in TRANSITIONS.values() for to in row.values()} == set(State)
    assert {event for row in TRANSITIONS.values() for event in row} == set(Event)


# Uploads.


def test_upload_step_by_step() -> None:
    plans = mission_protocol()
    (request,) = replies(plans.receive(count(3), ME, 0.0))
    assert (request.get_type(), request.seq, request.mission_type) == ("MISSION_REQUEST_INT", 0, FENCE)
    assert (request.target_system, request.target_component) == (255, 190)
    for seq in range(2):
        (request,) = replies(plans.receive(item(seq), ME, 0.0))
        assert request.seq == seq + 1
    effects = plans.receive(item(2), ME, 0.0)
    assert replies(effects) == []  # nothing is accepted that is not stored
    assert plans.transfers[FENCE].items == ()
    commit = commit_of(effects)
    assert commit.plans == {FENCE: items(3)}
    changed, reply = plans.stored(commit, 0.0)
    assert changed == Changed(FENCE)  # the plan is in force when its acknowledgement leaves
    assert isinstance(reply, Reply)
    assert (reply.message.type, reply.message.mission_type) == (ACCEPTED, FENCE)
    assert reply.message.opaque_id == opaque_id(items(3)) == plans.transfers[FENCE].opaque_id
    assert plans.transfers[FENCE].items == items(3)
    assert plans.deadline() is None


@pytest.mark.parametrize(
    ("flavour", "compid", "forms"),
    [
        (PX4, 190, ["MISSION_REQUEST_INT"] * 4),
        (STANDARD, 230, ["MISSION_REQUEST_INT"] * 4),
        (ARDUPILOT, 190, ["MISSION_REQUEST"] * 4),
        (ARDUPILOT, 0, ["MISSION_REQUEST"] * 4),
        (PX4, 0, ["MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_REQUEST"]),
    ],
)
def test_the_form_of_requests(flavour: Flavour, compid: int, forms: list[str]) -> None:
    plans, client = mission_protocol(), peer(255, compid, flavour)
    seen = replies(plans.receive(count(2), client, 0.0))
    for step in range(1, 4):
        seen += replies(plans.expire(step * REQUEST_EVERY))
    assert [message.get_type() for message in seen] == forms
    assert {message.seq for message in seen} == {0}


def test_answered_request_form_is_kept() -> None:
    """dronekit on a PX4 endpoint: only its first item costs a second request."""
    plans, client = mission_protocol(), peer(255, 0)
    plans.receive(count(3), client, 0.0)
    (request,) = replies(plans.expire(REQUEST_EVERY))
    assert request.get_type() == "MISSION_REQUEST"
    (request,) = replies(plans.receive(item_float(an_item(0), 0, 1, 1, FENCE), client, 0.3))
    assert (request.get_type(), request.seq) == ("MISSION_REQUEST", 1)


def test_request_repeats_within_250_ms_until_abort() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(1))
    plans.receive(count(5), ME, 10.0)
    times = []
    while (deadline := plans.deadline()) is not None:
        assert plans.expire(deadline - 0.001) == []
        effects = plans.expire(deadline)
        times.append(deadline)
    assert times == pytest.approx([10.0 + REQUEST_EVERY * (n + 1) for n in range(MAX_TRIES)])
    (final,) = replies(effects)
    assert (final.get_type(), final.type) == ("MISSION_ACK", CANCELLED)
    assert texts(effects) == ["Fence upload aborted: no item 0"]
    assert plans.transfers[FENCE].items == items(1)


def test_duplicate_items_are_ignored_and_the_expected_one_requested() -> None:
    plans = mission_protocol()
    plans.receive(count(4), ME, 0.0)
    plans.receive(item(0), ME, 0.0)
    for stray in (0, 3, 0, 77):
        assert plans.receive(item(stray), ME, 0.1) == []
    (request,) = replies(plans.expire(REQUEST_EVERY))
    assert request.seq == 1
    assert uploaded_rest(plans, 1, 4) == items(4)


def uploaded_rest(plans: MissionProtocol, first: int, end: int) -> Any:
    for seq in range(first, end):
        effects = plans.receive(item(seq), ME, 0.3)
    plans.stored(commit_of(effects), 0.3)
    return plans.transfers[FENCE].items


def test_refused_items_and_plans() -> None:
    plans = mission_protocol()
    uploaded(plans, 2)
    plans.receive(count(3), ME, 1.0)
    plans.receive(item(0), ME, 1.0)
    effects = plans.receive(item(1, an_item(1, 666)), ME, 1.0)
    assert [m.type for m in replies(effects)] == [UNSUPPORTED]
    assert texts(effects) == ["Fence refused: item 1: nobody wants it"]
    assert plans.receive(item(0), ME, 1.1) == []  # a copy on its way when it was refused
    plans.receive(count(1), ME, 2.0)
    effects = plans.receive(item(0, an_item(0, 667)), ME, 2.0)
    assert [m.type for m in replies(effects)] == [dialect.MAV_MISSION_INVALID]
    assert texts(effects) == ["Fence refused: it ends badly"]
    assert plans.transfers[FENCE].items == items(2)
    assert plans.deadline() is None


def test_capacity() -> None:
    plans = mission_protocol()
    (final,) = replies(plans.receive(count(MAX_ITEMS + 1), ME, 0.0))
    assert final.type == NO_SPACE
    (request,) = replies(plans.receive(count(MAX_ITEMS), ME, 0.0))
    assert request.seq == 0


def test_closed_kind_refuses_every_upload() -> None:
    class Closed(Kind):
        refusal = PlanFault(UNSUPPORTED, "not yet")

    plans = MissionProtocol([Closed(MISSION, "mission")])
    effects = plans.receive(count(3, MISSION), ME, 0.0)
    assert [m.type for m in replies(effects)] == [UNSUPPORTED]
    assert texts(effects) == ["Mission refused: not yet"]
    (final,) = replies(plans.stored(commit_of(plans.receive(count(0, MISSION), ME, 0.0)), 0.0))
    assert (final.type, final.opaque_id) == (ACCEPTED, 0)
    assert [m.type for m in replies(plans.receive(partial(0, 0, MISSION), peer(flavour=ARDUPILOT), 0.0))] == [
        UNSUPPORTED
    ]


def test_plan_refused_during_storing_is_reported() -> None:
    plans = mission_protocol()
    uploaded(plans, 2)
    plans.receive(count(1), ME, 1.0)
    commit = commit_of(plans.receive(item(0), ME, 1.0))
    (final,) = replies(plans.stored(commit, 1.0, PlanFault(dialect.MAV_MISSION_INVALID, "")))
    assert (final.type, final.opaque_id) == (dialect.MAV_MISSION_INVALID, 0)
    assert plans.transfers[FENCE].items == items(2)


def test_upload_restarted_by_a_second_count() -> None:
    """Nothing of the first one is in the second."""
    plans = mission_protocol()
    plans.receive(count(3), ME, 0.0)
    plans.receive(item(0, an_item(99)), ME, 0.0)
    (request,) = replies(plans.receive(count(2), ME, 0.1))
    assert request.seq == 0
    assert uploaded_rest(plans, 0, 2) == items(2)


@pytest.mark.parametrize("result", [CANCELLED, UNSUPPORTED, ERROR])
def test_the_client_cancels(result: int) -> None:
    plans = mission_protocol()
    uploaded(plans, 2)
    plans.receive(count(3), ME, 1.0)
    plans.receive(item(0), ME, 1.0)
    assert plans.receive(ack(result), ME, 1.0) == []
    assert plans.transfers[FENCE].state is State.IDLE
    assert plans.receive(item(1), ME, 1.1) == []
    assert plans.deadline() is None
    assert plans.transfers[FENCE].items == items(2)


def test_closed_channel_ends_its_clients_transfers() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(2))
    plans.receive(count(3), ME, 0.0)
    plans.receive(ask_list(RALLY), ME, 0.0)
    plans.leave(lambda client: client == OTHER.client)
    assert plans.transfers[FENCE].state is State.RECEIVING
    plans.leave(lambda client: client == ME.client)
    assert plans.transfers[FENCE].state is State.IDLE
    assert plans.deadline() is None
    assert replies(plans.receive(count(1), OTHER, 0.1))[0].get_type() == "MISSION_REQUEST_INT"


# Two clients.


def test_a_second_client_during_an_upload_is_refused() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(3))
    plans.receive(count(2), ME, 0.0)
    for message in (count(4), count(0), clear()):
        effects = plans.receive(message, OTHER, 0.1)
        (final,) = replies(effects)
        assert (final.type, final.target_system, final.target_component) == (DENIED, 254, 191)
        assert texts(effects) == ["Fence refused: another client transfers"]
    assert [m.type for m in replies(plans.receive(item(0, an_item(7)), OTHER, 0.1))] == [DENIED]
    assert replies(plans.receive(clear(ALL), OTHER, 0.1))[0].type == DENIED
    assert plans.receive(ack(CANCELLED), OTHER, 0.1) == []
    assert replies(plans.receive(count(1, RALLY), OTHER, 0.1))[0].seq == 0  # another list is another transfer
    assert replies(plans.receive(ask(2), OTHER, 0.1))[0].x == items(3)[2].x  # the old plan holds, and can be read
    assert uploaded_rest(plans, 0, 2) == items(2)


@pytest.mark.parametrize("late", [clear(), count(0), clear(ALL)], ids=["clear", "count 0", "clear all"])
def test_late_copy_of_a_clearing_over_another_link_deletes_no_newer_plan(late: Any) -> None:
    """MAVProxy clears a list before it uploads another."""
    plans, copy = mission_protocol(), peer(channel="b")
    plans.stored(commit_of(plans.receive(clear(), ME, 0.0)), 0.0)
    plans.receive(count(2), ME, 0.1)
    assert [m.type for m in replies(plans.receive(late, copy, 0.2))] == [DENIED]
    assert uploaded_rest(plans, 0, 2) == items(2)
    assert [m.type for m in replies(plans.receive(late, copy, PATIENCE - 0.1))] == [DENIED]
    assert plans.transfers[FENCE].items == items(2)
    commit = commit_of(plans.receive(late, copy, PATIENCE))  # of another program with the same ids
    assert commit.plans[FENCE] == ()


@pytest.mark.parametrize("message", [clear(), count(0), clear(ALL)], ids=["clear", "count 0", "clear all"])
def test_two_programs_with_the_same_ids_that_clear_are_both_answered(message: Any) -> None:
    plans = mission_protocol()
    for who in (ME, peer(channel="b")):
        effects = plans.stored(commit_of(plans.receive(message, who, 0.0)), 0.0)
        assert [m.type for m in replies(effects)] == [ACCEPTED]


def test_client_clears_its_new_plan_although_a_copy_of_its_first_clearing_was_later() -> None:
    plans = mission_protocol()
    for who in (ME, peer(channel="b")):
        plans.stored(commit_of(plans.receive(clear(), who, 0.0)), 0.0)
    uploaded(plans, 2, now=0.1)
    assert commit_of(plans.receive(clear(), ME, 0.2)).plans[FENCE] == ()


def test_clearing_that_could_not_be_stored_is_tried_again_over_another_link() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(2))
    plans.stored(commit_of(plans.receive(clear(), ME, 0.0)), 0.0, PlanFault(ERROR, ""))
    assert commit_of(plans.receive(clear(), peer(channel="b"), 0.1)).plans[FENCE] == ()


def test_list_that_replaces_another_as_a_file_is_no_clearing() -> None:
    plans = mission_protocol()
    plans.stored(commit_of(plans.transfers[FENCE].replace(items(2), ME, 0.0)), 0.0)
    assert commit_of(plans.receive(clear(), peer(channel="b"), 0.1)).plans[FENCE] == ()


def test_upload_is_cancelled_by_a_file_of_its_client() -> None:
    """The file has no MISSION_ACK, and the upload had none either: its client waited for the next request."""
    plans = mission_protocol()
    plans.receive(count(2), ME, 0.0)
    effects = plans.transfers[FENCE].replace(items(2), ME, 0.1)
    assert isinstance(effects, list)
    assert [message.type for message in replies(effects)] == [CANCELLED]
    assert replies(plans.stored(commit_of(effects), 0.1)) == []


@pytest.mark.parametrize("kind", [FENCE, ALL])
def test_upload_of_a_silent_client_is_cancelled_by_the_clearing_of_another(kind: int) -> None:
    plans = mission_protocol()
    plans.receive(count(2), ME, 0.0)
    effects = plans.receive(clear(kind), OTHER, PATIENCE)
    assert [(reply.peer, reply.message.type) for reply in effects if isinstance(reply, Reply)] == [(ME, CANCELLED)]


def test_a_silent_client_gives_way_to_another() -> None:
    plans = mission_protocol()
    plans.receive(count(2), ME, 0.0)
    assert replies(plans.receive(count(1), OTHER, PATIENCE - 0.01))[0].type == DENIED
    first, second = plans.receive(count(1), OTHER, PATIENCE)
    assert isinstance(first, Reply)
    assert (first.peer, first.message.type) == (ME, CANCELLED)
    assert isinstance(second, Reply)
    assert (second.peer, second.message.seq) == (OTHER, 0)


def test_an_upload_during_another_clients_download_is_refused() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(3))
    plans.receive(ask_list(), ME, 0.0)
    plans.receive(ask(0), ME, 1.0)
    assert replies(plans.receive(count(1), OTHER, 1.0))[0].type == DENIED
    assert replies(plans.receive(count(1), ME, 1.0))[0].seq == 0  # its own is abandoned
    plans.receive(ack(CANCELLED), ME, 1.0)
    plans.receive(ask_list(), ME, 2.0)
    plans.receive(ask(0), ME, 2.0)
    assert replies(plans.receive(count(1), OTHER, 2.0 + PATIENCE))[0].seq == 0  # it fell silent


def test_list_request_alone_does_not_block_other_clients() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(3))
    plans.receive(ask_list(), ME, 0.0)
    assert replies(plans.receive(count(1), OTHER, 0.0))[0].seq == 0


def test_finished_download_does_not_block_other_clients() -> None:
    """MAVProxy does not say that it is done."""
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(2))
    plans.receive(ask_list(), ME, 0.0)
    for seq in range(2):
        plans.receive(ask(seq), ME, 0.0)
    assert replies(plans.receive(count(1), OTHER, 0.0))[0].seq == 0


def test_a_download_is_of_one_plan() -> None:
    """An upload that comes between its items does not show in it; a new list does."""
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(3))
    plans.receive(ask_list(), ME, 0.0)
    plans.receive(ask(0), ME, 0.0)
    uploaded(plans, 1, OTHER, now=PATIENCE)
    (second,) = replies(plans.receive(ask(1), ME, PATIENCE + 0.1))
    assert second.x == items(3)[1].x
    (total,) = replies(plans.receive(ask_list(), ME, PATIENCE + 0.2))
    assert total.count == 1
    plans.receive(ask(0), ME, PATIENCE + 0.3)
    (final,) = replies(plans.receive(ask(1), ME, PATIENCE + 0.4 + RECENT))
    assert final.type == INVALID_SEQUENCE


# Downloads.


def test_download_in_any_order_again_and_pipelined() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(6))
    (total,) = replies(plans.receive(ask_list(), ME, 0.0))
    assert (total.count, total.opaque_id, total.mission_type) == (6, opaque_id(items(6)), FENCE)
    for seq in (5, 0, 1, 2, 3, 4, 4, 0):
        (message,) = replies(plans.receive(ask(seq), ME, 0.0))
        assert (message.get_type(), message.seq, item_of(message)) == ("MISSION_ITEM_INT", seq, an_item(seq))
        assert (message.x, message.y, message.z) == (488789000 + seq, -23677000, 12.5)
        assert (message.target_system, message.target_component) == (255, 190)
    assert replies(plans.receive(ask(6), ME, 0.0))[0].type == INVALID_SEQUENCE
    old = dialect.MAVLink_mission_request_message(1, 1, 2, FENCE)
    (message,) = replies(plans.receive(old, ME, 0.0))
    assert message.get_type() == "MISSION_ITEM"
    assert (message.x, message.y) == pytest.approx((48.8789002, -2.3677), abs=1e-9)
    assert plans.receive(ack(ACCEPTED), ME, 0.0) == []


def test_empty_lists_and_unknown_ones() -> None:
    plans = mission_protocol()
    for kind in (MISSION, FENCE, RALLY):
        (total,) = replies(plans.receive(ask_list(kind), ME, 0.0))
        assert (total.get_type(), total.count, total.opaque_id, total.mission_type) == ("MISSION_COUNT", 0, 0, kind)
        assert replies(plans.receive(ask(0, kind), ME, 0.0))[0].type == INVALID_SEQUENCE
    for message in (ask_list(7), count(1, 7), ask(0, 9), clear(9), partial(0, 0, 9), item(0, kind=9), ask_list(ALL)):
        (final,) = replies(plans.receive(message, ME, 0.0))
        assert (final.type, final.mission_type) == (UNSUPPORTED, message.mission_type)
    assert plans.receive(ack(ACCEPTED, 9), ME, 0.0) == []
    never = dialect.MAVLink_mission_request_partial_list_message(1, 1, 0, 1, FENCE)
    assert replies(plans.receive(never, ME, 0.0))[0].type == UNSUPPORTED


def test_many_downloads_are_bounded() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(2))
    for sysid in range(1, 200):
        plans.receive(ask_list(), peer(sysid), 0.0)
    assert len(plans.transfers[FENCE]._downloads) == 16


# Clear.


@pytest.mark.parametrize("empty", [False, True])
@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY, ALL])
def test_clear(kind: int, empty: bool) -> None:
    plans = mission_protocol()
    if not empty:
        for other in (MISSION, FENCE, RALLY):
            uploaded(plans, 2, kind=other)
    effects = plans.stored(commit_of(plans.receive(clear(kind), ME, 1.0)), 1.0)
    (final,) = replies(effects)
    assert (final.type, final.mission_type, final.opaque_id) == (ACCEPTED, kind, 0)
    for other in (MISSION, FENCE, RALLY):
        gone = empty or kind in (other, ALL)
        assert plans.transfers[other].items == (() if gone else items(2))


def test_messages_during_storing_wait() -> None:
    """MAVProxy does not wait for the acknowledgement of a clear before it uploads."""
    plans = mission_protocol()
    commit = commit_of(plans.receive(clear(), ME, 0.0))
    (total,) = replies(plans.receive(ask_list(RALLY), OTHER, 0.0))  # another list does not
    assert total.count == 0
    assert plans.receive(count(2), ME, 0.0) == []
    assert plans.receive(clear(ALL), OTHER, 0.0) == []
    effects = plans.stored(commit, 0.0)
    final, request, denied = replies(effects)
    assert (final.get_type(), final.type) == ("MISSION_ACK", ACCEPTED)
    assert (request.get_type(), request.seq) == ("MISSION_REQUEST_INT", 0)
    assert (denied.type, denied.mission_type) == (DENIED, ALL)
    assert uploaded_rest(plans, 0, 2) == items(2)


def test_list_request_during_storing_gets_the_new_plan() -> None:
    """dronekit asks as soon as it has sent its last item."""
    plans = mission_protocol()
    plans.receive(count(1), ME, 0.0)
    commit = commit_of(plans.receive(item(0), ME, 0.0))
    assert plans.receive(ask_list(), ME, 0.0) == []
    final, total = replies(plans.stored(commit, 0.0))
    assert (final.get_type(), final.type) == ("MISSION_ACK", ACCEPTED)
    assert (total.get_type(), total.count) == ("MISSION_COUNT", 1)


def test_waiting_client_that_cancels_receives_no_requests() -> None:
    plans = mission_protocol()
    commit = commit_of(plans.receive(clear(), ME, 0.0))
    assert plans.receive(count(2), OTHER, 0.0) == []
    assert plans.receive(ask_list(), ME, 0.0) == []
    assert plans.receive(ack(CANCELLED), OTHER, 0.0) == []
    assert [message.get_type() for message in replies(plans.stored(commit, 0.0))] == ["MISSION_ACK", "MISSION_COUNT"]
    assert plans.deadline() is None


def test_number_of_waiting_messages_is_bounded() -> None:
    plans = mission_protocol()
    plans.receive(clear(), ME, 0.0)
    for _ in range(MAX_WAITING):
        assert plans.receive(count(2), OTHER, 0.0) == []
    assert replies(plans.receive(count(2), OTHER, 0.0))[0].type == ERROR


def test_the_link_is_lost_while_a_plan_is_stored() -> None:
    plans = mission_protocol()
    commit = commit_of(plans.receive(clear(), ME, 0.0))
    plans.reset()
    assert plans.stored(commit, 0.0) == []
    assert plans.transfers[FENCE].state is State.IDLE


# Partial lists.

AP = peer(flavour=ARDUPILOT)


@pytest.mark.parametrize(
    ("first", "last", "changed", "total"),
    [(1, 1, {1}, 4), (0, 3, {0, 1, 2, 3}, 4), (2, 4, {2, 3}, 4), (4, 4, {4}, 5)],
)
def test_partial_write(first: int, last: int, changed: set[int], total: int) -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(4))
    effects = plans.receive(partial(first, last), AP, 0.0)
    while requests := replies(effects):
        (request,) = requests
        effects = plans.receive(item(request.seq, an_item(100 + request.seq)), AP, 0.0)
    plans.stored(commit_of(effects), 0.0)
    now = plans.transfers[FENCE].items
    assert [one.x for one in now] == [488789000 + n + (100 if n in changed else 0) for n in range(total)]


@pytest.mark.parametrize(("first", "last"), [(5, 5), (2, 1), (0, 6), (-1, 0), (-3, -1), (3, 5)])
def test_partial_write_of_missing_items_is_refused(first: int, last: int) -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(4))
    (final,) = replies(plans.receive(partial(first, last), AP, 0.0))
    assert final.type == INVALID_SEQUENCE
    assert plans.transfers[FENCE].state is State.IDLE


def test_partial_write_is_not_px4s() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(4))
    assert replies(plans.receive(partial(0, 0), ME, 0.0))[0].type == UNSUPPORTED


def test_cancelled_partial_write_changes_nothing() -> None:
    plans = mission_protocol()
    plans.transfers[FENCE].put(items(4))
    plans.receive(partial(0, 1), AP, 0.0)
    plans.receive(item(0, an_item(100)), AP, 0.0)
    plans.receive(ack(CANCELLED), AP, 0.0)
    assert plans.transfers[FENCE].items == items(4)


class WithHome(Kind):
    """As missions are in the ArduPilot flavour: item 0 is home and not part of the plan."""

    def shown(self, items: Any, flavour: Flavour) -> Any:
        return (an_item(-1), *items) if flavour.zero_home and items else items

    def taken(self, items: Any, flavour: Flavour) -> Any:
        return items[1:] if flavour.zero_home else items


def test_list_with_home_item_is_shifted_for_one_flavour() -> None:
    plans = MissionProtocol([WithHome()])
    effects = plans.receive(count(3), AP, 0.0)
    for seq, number in enumerate((-1, 0, 1)):
        effects = plans.receive(item(seq, an_item(number)), AP, 0.0)
    plans.stored(commit_of(effects), 0.0)
    assert plans.transfers[FENCE].items == items(2)
    assert [replies(plans.receive(ask_list(), who, 1.0))[0].count for who in (AP, OTHER)] == [3, 2]
    plans.receive(ack(ACCEPTED), AP, 1.0)
    plans.receive(ack(ACCEPTED), OTHER, 1.0)
    plans.receive(partial(2, 2), AP, 1.0)
    effects = plans.receive(item(2, an_item(50)), AP, 1.0)
    plans.stored(commit_of(effects), 1.0)
    assert [one.x - 488789000 for one in plans.transfers[FENCE].items] == [0, 50]


# The final acknowledgement.


def test_one_acknowledgement_where_nothing_was_lost() -> None:
    plans = mission_protocol()
    uploaded(plans, 3)
    assert plans.deadline() is None


def test_the_acknowledgement_is_repeated_after_losses() -> None:
    plans = mission_protocol()
    plans.receive(count(1), ME, 0.0)
    plans.expire(REQUEST_EVERY)
    commit = commit_of(plans.receive(item(0), ME, 0.3))
    plans.stored(commit, 0.3)
    seen = []
    while (deadline := plans.deadline()) is not None:
        seen += replies(plans.expire(deadline))
    assert [(m.type, m.opaque_id) for m in seen] == [(ACCEPTED, opaque_id(items(1)))] * ECHOES


@pytest.mark.parametrize("next_message", [count(2), ask_list(), ask(0), clear(), ack(ACCEPTED)])
def test_no_repetition_follows_the_clients_next_message(next_message: Any) -> None:
    plans = mission_protocol()
    plans.receive(count(1), ME, 0.0)
    plans.expire(REQUEST_EVERY)
    plans.stored(commit_of(plans.receive(item(0), ME, 0.3)), 0.3)
    plans.receive(next_message, ME, 0.31)
    assert [m for m in replies(plans.expire(1.0)) if m.get_type() == "MISSION_ACK"] == []


def test_the_last_item_again_is_acknowledged_again() -> None:
    """Mission Planner says it again until it has heard."""
    plans = mission_protocol()
    uploaded(plans, 2)
    assert replies(plans.receive(item(1), ME, 0.5))[0].type == ACCEPTED
    assert plans.receive(item(0), ME, 0.5) == []
    assert replies(plans.receive(item(1), OTHER, 0.5))[0].type == ERROR
    assert replies(plans.receive(item(1), ME, RECENT + 0.5))[0].type == ERROR


@pytest.mark.parametrize("at_fault", ["item", "plan", "plan, found in a thread"])
def test_repeated_upload_gets_the_lost_refusal_again(at_fault: str) -> None:
    """Same result and no second text, also with the link as it is repeated; another upload has nothing of it."""
    plans = mission_protocol()
    uploaded(plans, 1)
    plans.receive(count(3), ME, 1.0)
    plans.receive(item(0), ME, 1.0)
    plans.expire(1.0 + REQUEST_EVERY)  # something was lost
    last = 1 if at_fault == "item" else 2
    if at_fault != "item":
        plans.receive(item(1), ME, 1.3)
    command = {"item": 666, "plan": 667}.get(at_fault, 5001)
    effects = plans.receive(item(last, an_item(last, command)), ME, 1.3)
    result = UNSUPPORTED if at_fault == "item" else dialect.MAV_MISSION_INVALID
    if command == 5001:
        effects = plans.stored(commit_of(effects), 1.3, PlanFault(result, "said by who found it"))
    else:
        assert len(texts(effects)) == 1
    assert [m.type for m in replies(effects)] == [result]
    again = plans.receive(item(last), ME, 1.4)
    assert ([m.type for m in replies(again)], texts(again)) == ([result], [])
    assert plans.receive(item(0), ME, 1.4) == []
    assert [m.type for m in replies(plans.receive(item(last), OTHER, 1.4))] == [ERROR]
    repeated: list[Any] = []
    while (deadline := plans.deadline()) is not None:
        repeated += plans.expire(deadline)
    assert ([m.type for m in replies(repeated)], texts(repeated)) == ([result] * ECHOES, [])
    assert plans.transfers[FENCE].items == items(1)
    assert plans.transfers[FENCE].state is State.IDLE
    plans.receive(count(2), ME, 4.0)
    assert uploaded_rest(plans, 0, 2) == items(2)
    assert [m.type for m in replies(plans.receive(item(1), ME, 4.1))] == [ACCEPTED]
    assert [m.type for m in replies(plans.receive(item(1), ME, 4.1 + RECENT))] == [ERROR]


# Bad links.


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    number=st.integers(1, 60),
    loss=st.floats(0.0, 0.25),
    duplicate=st.floats(0.0, 0.3),
    slow=st.floats(0.001, 0.4),
    as_float=st.booleans(),
)
def test_upload_over_a_bad_link(
    seed: int, number: int, loss: float, duplicate: float, slow: float, as_float: bool
) -> None:
    """Whatever is lost, doubled or overtaken: what the client holds for accepted is the plan, item by item."""
    plans = mission_protocol()
    who = peer(255, 0 if as_float else 190)
    client = Client(who, items(number), as_float)
    wire = Wire(plans, [client], seed=seed, loss=loss, duplicate=duplicate, delay=(0.001, slow))
    wire.to_protocol(client, client.upload(0.0))
    wire.run()
    stored = plans.transfers[FENCE].items
    if client.result is not None:
        assert client.result == ACCEPTED
        assert client.opaque == opaque_id(stored)
        assert [one.x for one in stored] == pytest.approx([one.x for one in items(number)], abs=25 if as_float else 0)
    assert len(stored) in (0, number)


def test_500_items_with_a_quarter_lost_both_ways() -> None:
    for seed in range(4):
        plans = mission_protocol()
        client = Client(ME, items(500))
        wire = Wire(plans, [client], seed=seed, loss=0.25)
        wire.to_protocol(client, client.upload(0.0))
        wire.run()
        assert client.result == ACCEPTED, seed
        assert plans.transfers[FENCE].items == items(500)
        reader = Client(ME)
        wire = Wire(plans, [reader], seed=seed, loss=0.25)
        wire.to_protocol(reader, reader.download(0.0))
        wire.run()
        assert tuple(reader.downloaded.values()) == items(500), seed


def test_copies_do_not_multiply() -> None:
    """On a link slower than the repetition every request is made several times, and no more than that."""
    plans = mission_protocol()
    client = Client(ME, items(30), patience=10.0, repeat=1.0)
    wire = Wire(plans, [client], duplicate=0.5, delay=(0.25, 0.25), seed=7)
    wire.to_protocol(client, client.upload(0.0))
    wire.run()
    assert client.result == ACCEPTED
    requests = [m for m in wire.sent if m.get_type() == "MISSION_REQUEST_INT"]
    # 0.5 s there and back: at 0, 0.2 and 0.4 s, then with two before it; and once for the copy of MISSION_COUNT.
    assert len(requests) <= 30 * (1 + 1 + 3) + 1


def test_two_clients_at_once_on_a_bad_link() -> None:
    """Different lists; each hears its own answers only (`Client.receive` looks at every address)."""
    plans = mission_protocol()
    clients = [Client(ME, items(40)), Client(OTHER, items(25), kind=RALLY)]
    wire = Wire(plans, clients, loss=0.1, seed=3)
    for client in clients:
        wire.to_protocol(client, client.upload(0.0))
    wire.run()
    assert [client.result for client in clients] == [ACCEPTED, ACCEPTED]
    assert [len(plans.transfers[kind].items) for kind in (FENCE, RALLY)] == [40, 25]


# Nonsense.

NUMBER = st.one_of(st.integers(-3, 8), st.integers(-(2**15), 2**16 - 1))
KIND = st.sampled_from([MISSION, FENCE, FENCE, RALLY, ALL, 3, 254])
WHOLE16 = st.integers(0, 2**16 - 1) | st.integers(0, 6)


def some_message(draw: Any) -> Any:
    """Any message of the mission protocol with anything in it."""
    kind = draw(KIND)
    real = st.floats(width=32)
    match draw(st.integers(0, 8)):
        case 0:
            return count(draw(WHOLE16), kind)
        case 1:
            return clear(kind)
        case 2:
            short = st.integers(-(2**15), 2**15 - 1) | st.integers(-1, 4)
            return partial(draw(short), draw(short), kind)
        case 3:
            return ask_list(kind)
        case 4:
            return ask(draw(WHOLE16), kind)
        case 5:
            return dialect.MAVLink_mission_request_message(1, 1, draw(WHOLE16), kind)
        case 6:
            return ack(draw(st.integers(0, 255)), kind)
        case form:
            make = dialect.MAVLink_mission_item_message if form == 7 else dialect.MAVLink_mission_item_int_message
            xy = real if form == 7 else st.integers(-(2**31), 2**31 - 1)
            fields = [draw(real) for _ in range(4)]
            command = draw(st.sampled_from([5001, 5003, 666, 667]) | WHOLE16)
            return make(
                1, 1, draw(WHOLE16), draw(st.integers(0, 20)), command, 0, 1, *fields, draw(xy), draw(xy), draw(real),
                kind,
            )  # fmt: skip


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_random_messages_neither_raise_nor_block_the_protocol(data: st.DataObject) -> None:
    """A list only ever changes by a commit that was stored, every answer goes to who asked, and when all fall silent
    the protocol comes to rest."""
    plans, now = mission_protocol(), 0.0
    clients = [ME, OTHER, peer(1, 0, ARDUPILOT, "c")]
    waiting: list[Commit] = []

    def take(effects: Any, asker: Peer | None) -> None:
        for effect in effects:
            if isinstance(effect, Commit):
                waiting.append(effect)
            if isinstance(effect, Reply):
                message = effect.message
                assert (message.target_system, message.target_component) == (effect.peer.sysid, effect.peer.compid)
                message.pack(dialect.MAVLink(None, 1, 1))  # every field fits

    for _ in range(data.draw(st.integers(1, 60))):
        now += data.draw(st.sampled_from([0.0, 0.01, 0.3, 2.0, 10.0]))
        before = {kind: transfer.items for kind, transfer in plans.transfers.items()}
        step = data.draw(st.integers(0, 9))
        if step == 0 and waiting:
            commit = waiting.pop(0)
            take(plans.stored(commit, now), None)
            continue
        if step == 1:
            take(plans.expire(now), None)
        elif step == 2:
            gone = data.draw(st.sampled_from(clients))
            plans.leave(lambda client, gone=gone: client == gone.client)  # type: ignore[misc]
        else:
            asker = data.draw(st.sampled_from(clients))
            take(plans.receive(some_message(data.draw), asker, now), asker)
        assert {kind: transfer.items for kind, transfer in plans.transfers.items()} == before
    while waiting:
        take(plans.stored(waiting.pop(0), now), None)
    for _ in range(200):
        if (deadline := plans.deadline()) is None:
            break
        take(plans.expire(deadline), None)
        while waiting:
            take(plans.stored(waiting.pop(0), deadline), None)
    assert plans.deadline() is None
    assert all(transfer.state is State.IDLE for transfer in plans.transfers.values())


# Items.


def test_float_item_becomes_integers_giving_the_float_back() -> None:
    """48.8789 in single precision is 48.87889862060547; the nearest 1e-7 degrees to it are 488788986."""
    message = dialect.MAVLink_mission_item_message(1, 1, 0, 3, 5100, 0, 1, 0, 0, 0, 0, 48.87889862060547, 2.3677, 10, 2)
    taken = item_of(message)
    assert isinstance(taken, PlanItem)
    assert (taken.x, taken.y, taken.z) == (488788986, 23677000, 10)
    assert (taken.latitude, taken.longitude) == pytest.approx((48.8788986, 2.3677))
    back = item_float(taken, 0, 255, 190, 2)
    assert back.x == pytest.approx(48.8788986, abs=1e-12)


def test_numbers_without_a_place_are_not_scaled() -> None:
    """DO_GIMBAL_MANAGER_PITCHYAW carries flags in x; an unset one is NaN in floats, INT32_MAX in integers."""
    taken = item_of(dialect.MAVLink_mission_item_message(1, 1, 0, 2, 1000, 0, 1, -30, 0, 0, 0, 12.0, math.nan, 0, 0))
    assert isinstance(taken, PlanItem)
    assert (taken.x, taken.y) == (12, 2**31 - 1)
    back = item_float(taken, 0, 255, 190, 0)
    assert back.x == 12.0
    assert math.isnan(back.y)


@pytest.mark.parametrize("value", [math.inf, -math.inf, 1e30, 215.0])
def test_unconvertible_float_is_refused(value: float) -> None:
    bad = item_of(dialect.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, 1.0, value, 0, 0))
    assert isinstance(bad, PlanFault)
    assert bad.result == dialect.MAV_MISSION_INVALID_PARAM6_Y


def test_unset_parameters_stay_unset() -> None:
    sent = PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 6, (math.nan, 1.0, math.nan, math.nan), 1, 2, math.nan)
    for kept in (item_of(item_int(sent, 0, 1, 1, 0)), item_of(item_float(sent, 0, 1, 1, 0))):
        assert isinstance(kept, PlanItem)
        assert [math.isnan(value) for value in (*kept.params, kept.z)] == [True, False, True, True, True]


def test_opaque_ids() -> None:
    """The same for the same content, another for every difference but the progress."""
    base = [an_item(0), an_item(1)]
    assert opaque_id([]) == 0
    assert opaque_id(base) == opaque_id(list(base)) != 0
    others = [
        PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 3, (0.0, 0.0, 0.0, 0.0), 1, 2, 3.0),
        PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 3, (0.0, 0.0, 0.0, 0.0), 1, 2, 3.5),
        PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 3, (0.0, 0.0, 0.0, 0.0), 1, 2, 3.0, autocontinue=0),
        PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 6, (0.0, 0.0, 0.0, 0.0), 1, 2, 3.0),
        PlanItem(dialect.MAV_CMD_NAV_LOITER_UNLIM, 3, (0.0, 0.0, 0.0, 0.0), 1, 2, 3.0),
        PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 3, (0.0, 0.0, 0.0, math.nan), 1, 2, 3.0),
    ]
    assert len({opaque_id([one]) for one in others}) == len(others)
    assert opaque_id([others[0]]) == opaque_id(
        [PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 3, (0.0, 0.0, 0.0, 0.0), 1, 2, 3.0, current=1)]
    )
    assert opaque_id(base) != opaque_id(base[::-1])


def test_the_base_kind_takes_everything() -> None:
    kind = PlanKind()
    assert kind.check_item(an_item(0)) is None
    assert kind.check_plan(items(3)) is None
    assert kind.taken(kind.shown(items(3), PX4), PX4) == items(3)

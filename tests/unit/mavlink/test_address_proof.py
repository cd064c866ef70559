"""Limit of an address without proof: bytes, kinds and turns, counted by hand."""

from __future__ import annotations

import pytest

from anafi_mav.mavlink.address_proof import (
    FACTOR,
    INTRODUCE_EVERY,
    MAX_INTRODUCED,
    PROOF_WINDOW,
    AddressProof,
    Introductions,
)
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.dialect import MAVLink_attitude_message, MAVLink_command_ack_message, MAVLink_heartbeat_message
from anafi_mav.mavlink.frames import pack

BEAT = pack(MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3))
SIZE = 21
"""Bytes of a heartbeat: 9 and 12."""

FLEET = [(sysid, compid) for sysid in range(1, 16) for compid in (1, 100)]


def offer(proof: AddressProof) -> list[tuple[int, int]]:
    """The sources of the heartbeats that leave when each of the fleet's components offers one."""
    left = []
    for source in FLEET:
        proof.heartbeat(source, BEAT)
        left += [shown for shown, _ in proof.heartbeats()]
    return left


def test_heartbeats_leave_in_turn_within_ten_times() -> None:
    proof = AddressProof()
    assert offer(proof) == []
    assert not proof.received(SIZE, addressed=False, broadcast=True, now=0.0)
    first = [source for source, _ in proof.heartbeats()]
    assert first == FLEET[:10]
    assert offer(proof) == []
    proof.received(SIZE, addressed=False, broadcast=True, now=20.0)
    second = [source for source, _ in proof.heartbeats()]
    assert second == FLEET[10:20]
    proof.received(SIZE, addressed=False, broadcast=True, now=40.0)
    assert [source for source, _ in proof.heartbeats()] == FLEET[20:30]
    assert not proof.answer(1)  # no frame named a system


def test_addressed_frame_opens_its_answer_and_no_heartbeat() -> None:
    proof = AddressProof()
    proof.received(45, addressed=True, broadcast=False, now=0.0)
    assert offer(proof) == []
    assert proof.answer(FACTOR * (45 + 28) - 48 - 28)
    assert not proof.answer(21)
    assert proof.answer(20)
    assert not proof.answer(1)


def test_short_answers_to_a_long_frame_stay_within_ten_times() -> None:
    proof = AddressProof()
    proof.received(280, addressed=True, broadcast=False, now=0.0)
    count = 0
    while proof.answer(15):
        count += 1
    assert count == 71  # 10 * 308 / 43, where 10 * 280 / 15 are 186: 26 times as many bytes on the wire


@pytest.mark.parametrize(
    ("times", "proved"),
    [
        ([0.0, 1.0, 2.0], True),
        ([0.0, 0.0, 0.0], True),
        ([0.0, 5.0, PROOF_WINDOW], True),
        ([0.0, 5.0, PROOF_WINDOW + 0.1], False),
        ([0.0, 9.0, 18.0, 18.5], True),
        ([0.0, 9.0, 18.0, 27.0], False),
        ([0.0, 1.0], False),
    ],
)
def test_third_datagram_within_ten_seconds_is_the_proof(times: list[float], proved: bool) -> None:
    proof = AddressProof()
    assert [proof.received(SIZE, addressed=False, broadcast=True, now=at) for at in times][-1] is proved


def test_channel_without_proof_sends_heartbeats_and_answers_only() -> None:
    written: list[bytes] = []
    channel = Channel("from 192.0.2.7", written.append, datagrams=True)
    channel.proof = AddressProof()
    attitude = pack(MAVLink_attitude_message(1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1))
    ack = pack(MAVLink_command_ack_message(400, 0, 255, 0, 255, 190))
    channel.proof.received(SIZE, addressed=True, broadcast=True, now=0.0)
    channel.send_packed(attitude, 1, 1, give_way=True)
    channel.send_packed(ack, 1, 1)
    channel.forward(bytes(20))
    assert written == []
    assert channel.counters["withheld_frames"] == 3
    channel.send_packed(ack, 1, 1, is_answer=True)
    assert len(written) == 1
    for _ in range(20):
        channel.send_packed(BEAT, 1, 1, give_way=True)
    assert SIZE * 9 < sum(map(len, written)) <= SIZE * FACTOR
    assert not channel.ready  # long lists wait
    channel.proof = None
    channel.send_packed(attitude, 1, 1, give_way=True)
    assert len(written[-1]) == 40


def test_flood_of_few_addresses_takes_no_introduction_of_others() -> None:
    introductions = Introductions()
    flood = [introductions.allow(f"forger {number % 20}", 0.0) for number in range(1000)]
    assert sum(flood) == 20
    assert introductions.allow("station", 0.0)
    assert not introductions.allow("station", 0.5 * INTRODUCE_EVERY - 0.01)
    assert introductions.allow("station", 1.5 * INTRODUCE_EVERY)


def test_introductions_of_all_addresses_are_bounded() -> None:
    introductions = Introductions()
    assert sum(introductions.allow(f"forger {number}", 0.0) for number in range(10_000)) == MAX_INTRODUCED

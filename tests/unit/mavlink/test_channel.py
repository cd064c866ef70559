"""A channel: contiguous sequence numbers, and a queue that is bounded and knows what to drop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.address_proof import AddressProof
from anafi_mav.mavlink.channel import Channel, total
from anafi_mav.mavlink.frames import FRAME_BYTES, Batch, Parser, ReceivedFrame, frame, pack

ATTITUDE = dialect.MAVLink_attitude_message(1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
ACK = dialect.MAVLink_command_ack_message(400, 0)


class Wire:
    """What a channel wrote."""

    def __init__(self, *, joins: bool = False, **options: Any) -> None:
        self.written: list[bytes] = []
        self.lots: list[int] = []
        """Frames of each lot that was written at once."""
        self.channel = Channel("a wire", self.written.append, write_all=self._write_all if joins else None, **options)

    def _write_all(self, frames: Sequence[bytes]) -> None:
        self.lots.append(len(frames))
        self.written += frames

    def read(self) -> list[ReceivedFrame]:
        """The frames written since the last call."""
        data = b"".join(self.written)
        self.written.clear()
        return Parser().receive(data)


def sequence(frames: list[ReceivedFrame], source: tuple[int, int]) -> list[int]:
    return [received.raw[4] for received in frames if (received.sysid, received.compid) == source]


def test_sequence_numbers_are_contiguous_per_sender_and_wrap() -> None:
    wire = Wire()
    for _ in range(300):
        wire.channel.send(ATTITUDE, 1, 1)
        wire.channel.send(ACK, 1, 154)
        wire.channel.send(ACK, 2, 1)
    frames = wire.read()
    expected = [n % 256 for n in range(300)]
    for source in ((1, 1), (1, 154), (2, 1)):
        assert sequence(frames, source) == expected
    assert wire.channel.counters == {"sent_frames": 900}


def test_channels_count_for_themselves() -> None:
    one, other = Wire(), Wire()
    packed = pack(ATTITUDE)
    one.channel.send_packed(packed, 1, 1)
    one.channel.send_packed(packed, 1, 1)
    other.channel.send_packed(packed, 1, 1)
    assert sequence(one.read(), (1, 1)) == [0, 1]
    assert sequence(other.read(), (1, 1)) == [0]


def test_channels_at_one_number_share_a_frame() -> None:
    one, other, third = Wire(), Wire(), Wire()
    third.channel.send(ATTITUDE, 1, 1)
    packed = pack(ATTITUDE)
    for wire in (one, other, third, one):
        wire.channel.send_packed(packed, 1, 1)
    one.channel.send_packed(packed, 2, 1)
    assert frame(packed, 7, 1, 1) is frame(packed, 7, 1, 1)
    frames = one.read()
    assert (sequence(frames, (1, 1)), sequence(frames, (2, 1))) == ([0, 1], [0])
    assert sequence(other.read(), (1, 1)) == [0]
    assert sequence(third.read(), (1, 1)) == [0, 1]


def test_batch_leaves_at_once_with_the_frames_of_single_messages() -> None:
    joined, single = Wire(joins=True), Wire()
    messages = [pack(ATTITUDE), pack(ACK), pack(ATTITUDE)]
    for _ in range(100):  # the numbers wrap within a batch
        joined.channel.send_batch(Batch(messages, 1, 1))
        for packed in messages:
            single.channel.send_packed(packed, 1, 1, give_way=True)
    joined.channel.send(ACK, 1, 1)
    single.channel.send(ACK, 1, 1)
    assert joined.written == single.written
    assert joined.lots == [3] * 100
    assert (joined.channel.sent_frames, joined.channel.sent_bytes) == (301, sum(map(len, joined.written)))


def test_batch_is_framed_once_for_channels_at_one_number() -> None:
    batch = Batch([pack(ATTITUDE), pack(ACK)], 1, 1)
    assert batch.framed(7) is batch.framed(7)
    assert [raw[4] for raw in batch.framed(255)] == [255, 0]
    assert batch.size == sum(map(len, batch.framed(3))) == sum(len(one.payload) + FRAME_BYTES for one in batch.messages)


def test_batch_waits_as_streams_while_the_peer_is_held() -> None:
    wire = Wire(joins=True)
    wire.channel.pause()
    wire.channel.send_batch(Batch([pack(ATTITUDE), pack(ATTITUDE)], 1, 1))
    wire.channel.send(ACK, 1, 1)
    assert wire.written == []
    wire.channel.resume()
    assert [received.message.get_type() for received in wire.read()] == ["COMMAND_ACK", "ATTITUDE", "ATTITUDE"]
    wire.channel.close()
    wire.channel.send_batch(Batch([pack(ATTITUDE), pack(ATTITUDE)], 1, 1))
    assert wire.channel.counters == {"sent_frames": 3, "dropped_frames": 2}


def test_batch_to_a_peer_without_proof_is_withheld() -> None:
    wire = Wire(joins=True)
    wire.channel.proof = AddressProof()
    wire.channel.send_batch(Batch([pack(ATTITUDE), pack(ATTITUDE)], 1, 1))
    assert wire.written == []
    assert wire.channel.counters == {"withheld_frames": 2}


def test_batch_counts_in_a_byte_budget() -> None:
    wire = Wire(joins=True, bytes_per_second=1000.0)
    wire.channel.send_batch(Batch([pack(ATTITUDE), pack(ACK)], 1, 1))
    assert (wire.lots, len(wire.read())) == ([], 2)


def test_full_socket_queues_frames_and_answers_leave_first() -> None:
    wire = Wire()
    wire.channel.pause()
    wire.channel.forward(frame(pack(ATTITUDE), 98, 43, 1), give_way=True)
    wire.channel.send(ATTITUDE, 1, 1, give_way=True)
    wire.channel.send(ACK, 1, 1)
    wire.channel.forward(frame(pack(ACK), 99, 42, 1))
    assert wire.written == []
    wire.channel.resume()
    frames = wire.read()
    assert [(received.id, received.sysid) for received in frames] == [(77, 1), (77, 42), (30, 43), (30, 1)]
    assert sequence(frames, (1, 1)) == [0, 1]
    assert sequence(frames, (42, 1)) == [99]
    assert sequence(frames, (43, 1)) == [98]


def test_the_oldest_telemetry_is_dropped_first_and_counted() -> None:
    size = len(pack(ATTITUDE).payload) + FRAME_BYTES
    wire = Wire(queue_bytes=10 * size)
    wire.channel.pause()
    wire.channel.send(ACK, 1, 1)
    for n in range(100):
        wire.channel.send(dialect.MAVLink_attitude_message(n, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5), 1, 1, give_way=True)
    wire.channel.resume()
    frames = wire.read()
    assert frames[0].id == 77
    assert [received.message.time_boot_ms for received in frames[1:]] == list(range(91, 100))
    assert sequence(frames, (1, 1)) == list(range(10))
    assert wire.channel.counters == {"sent_frames": 10, "dropped_frames": 91}


def test_answers_are_dropped_last() -> None:
    size = len(pack(ACK).payload) + FRAME_BYTES
    wire = Wire(queue_bytes=3 * size)
    wire.channel.pause()
    wire.channel.send(ATTITUDE, 1, 1, give_way=True)
    for command in range(400, 405):
        wire.channel.send(dialect.MAVLink_command_ack_message(command, 0), 1, 1)
    wire.channel.resume()
    assert [received.message.command for received in wire.read()] == [402, 403, 404]
    assert wire.channel.counters["dropped_frames"] == 3


def test_socket_filling_again_while_the_queue_leaves_stops_it() -> None:
    written: list[bytes] = []

    def write(raw: bytes) -> None:
        written.append(raw)
        channel.pause()

    channel = Channel("one at a time", write)
    channel.pause()
    for _ in range(3):
        channel.send(ACK, 1, 1)
    for count in (1, 2, 3, 3):
        channel.resume()
        assert len(written) == count


def test_a_closed_channel_only_counts() -> None:
    wire = Wire()
    wire.channel.pause()
    wire.channel.send(ATTITUDE, 1, 1, give_way=True)
    wire.channel.close()
    wire.channel.send(ACK, 1, 1)
    wire.channel.forward(b"whatever")
    wire.channel.resume()
    assert wire.written == []
    assert not wire.channel.is_open
    assert wire.channel.counters == {"dropped_frames": 3}


def test_invalid_field_costs_no_sequence_number() -> None:
    wire = Wire()
    with pytest.raises(LocalProtocolError):
        wire.channel.send(dialect.MAVLink_command_ack_message(70000, 0), 1, 1)
    wire.channel.send(ACK, 1, 1)
    assert sequence(wire.read(), (1, 1)) == [0]


def test_datagrams_and_streams_treat_a_torn_frame_differently() -> None:
    raw = frame(pack(ACK), 0, 255, 190)
    stream, datagrams = Wire(), Wire(datagrams=True)
    assert [len(stream.channel.receive(part)) for part in (raw[:5], raw[5:])] == [0, 1]
    assert [len(datagrams.channel.receive(part)) for part in (raw[:5], raw[5:])] == [0, 0]


def test_counters_are_summed() -> None:
    wires = [Wire(), Wire()]
    for wire in wires:
        wire.channel.send(ACK, 1, 1)
        wire.channel.receive(b"rubbish")
    assert total(wire.channel for wire in wires) == {"sent_frames": 2, "garbage_bytes": 14}

"""The transport's rules one by one, then all of them together on a bad link and under garbage."""

from __future__ import annotations

import random

import pytest
from support.faulty_wire import Faults, FaultyWire

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import unpacked
from anafi_mav.arsdk.link.frame import Frame, FrameType, decode_frames, encode_frame, with_length
from anafi_mav.arsdk.link.transport import (
    MAX_QUEUED,
    MAX_QUEUED_NOACK,
    MAX_REPLIES,
    MAX_RETRIES_V1,
    Delivered,
    Event,
    Garbage,
    LinkDown,
    Rank,
    ReceivedMessages,
    Role,
    Silent,
    Speaks,
    Transport,
    Undelivered,
)
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.errors import LocalProtocolError

VERSIONS = [1, 2, 3]
STICKS = ardrone3.PCMD(1, 0, 50, 0, -20, 0)
HOVERING = ardrone3.FlyingStateChanged(ardrone3.FlyingState.HOVERING)


def tilt(value: float) -> ardrone3.MaxTilt:
    """An acknowledged command with its number."""
    return ardrone3.MaxTilt(value)


def custom(number: int, payload: bytes) -> wire.UnknownMessage:
    """An acknowledged message of any length."""
    return wire.UnknownMessage(wire.MessageId(250, 0, number), payload)


def frames(transport: Transport, datagrams: list[bytes]) -> list[Frame]:
    result = []
    for datagram in datagrams:
        decoded, garbage = decode_frames(transport.version, datagram)
        assert garbage is None
        result += decoded
    return result


def data_frame(version: int, id: int, seq: int, message: wire.Message, type: FrameType = FrameType.WITHACK) -> bytes:
    return encode_frame(version, type, id, seq, with_length(version, wire.encode(message)))


def ack(version: int, id: int, seq: int) -> bytes:
    return encode_frame(version, FrameType.ACK, id + 128, 0, seq.to_bytes(1 if version == 1 else 2, "little"))


def messages(events: list[Event]) -> list[object]:
    frames = [event.messages for event in events if isinstance(event, ReceivedMessages)]
    return [message for frame in frames for message in unpacked(frame)]


# -- queues


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("role", "message", "type", "id"),
    [
        (Role.CONTROLLER, STICKS, FrameType.NOACK, 10),
        (Role.CONTROLLER, common.AllStates(), FrameType.WITHACK, 11),
        (Role.CONTROLLER, ardrone3.Emergency(), FrameType.WITHACK, 11),
        (Role.CONTROLLER, wire.UnknownMessage(wire.MessageId(250, 1, 2), b"\1"), FrameType.WITHACK, 11),
        (Role.DEVICE, ardrone3.AltitudeChanged(1.0), FrameType.NOACK, 127),
        (Role.DEVICE, HOVERING, FrameType.WITHACK, 126),
    ],
)
def test_message_travels_in_the_queue_of_its_buffer(
    version: int, role: Role, message: wire.Message, type: FrameType, id: int
) -> None:
    transport = Transport(role, version, 0.0)
    transport.send(message, 0.0)
    (frame,) = frames(transport, transport.outgoing(0.0))
    assert frame == Frame(type, id, 0, with_length(version, wire.encode(message)))
    peer = Transport(Role.DEVICE if role is Role.CONTROLLER else Role.CONTROLLER, version, 0.0)
    assert messages(peer.receive(encode_frame(version, *frame), 0.0)) == [message]


def test_low_priority_events_have_their_own_queue(monkeypatch: pytest.MonkeyPatch) -> None:
    # Parrot's XML knows the buffer, but no message of it uses it.
    monkeypatch.setattr(ardrone3.FlyingStateChanged, "BUFFER", wire.Buffer.LOW_PRIO)
    transport = Transport(Role.DEVICE, 3, 0.0)
    token = transport.send(HOVERING, 0.0)
    transport.send(common.AllStatesChanged(), 0.0)
    assert [frame.id for frame in frames(transport, transport.outgoing(0.0))] == [126, 125]
    assert transport.receive(ack(3, 125, 0), 0.0) == [Delivered(token)]


def test_unused_high_priority_queue_is_received() -> None:
    transport = Transport(Role.DEVICE, 3, 0.0)
    assert messages(transport.receive(data_frame(3, 12, 0, ardrone3.Emergency()), 0.0)) == [ardrone3.Emergency()]
    assert frames(transport, transport.outgoing(0.0)) == [Frame(FrameType.ACK, 140, 0, b"\0\0")]


@pytest.mark.parametrize("version", [2, 3])
def test_messages_of_one_turn_share_a_frame(version: int) -> None:
    transport = Transport(Role.DEVICE, version, 0.0)
    for _ in range(3):
        transport.send(ardrone3.AltitudeChanged(1.0), 0.0)
        transport.send(HOVERING, 0.0)
    assert [frame.id for frame in frames(transport, transport.outgoing(0.0))] == [127, 126]


@pytest.mark.parametrize("version", [1, 2, 3])
def test_emergency_replaces_all_undelivered_commands(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    flying = transport.send(tilt(1), 0.0)
    transport.outgoing(0.0)
    waiting = transport.send(tilt(2), 0.0)
    transport.send(STICKS, 0.0)
    transport.send(ardrone3.Emergency(), 0.0)
    (frame,) = frames(transport, transport.outgoing(0.0))  # without waiting for the acknowledgement of the first
    assert wire.encode(ardrone3.Emergency()) in frame.payload
    events = transport.receive(ack(version, 11, 1), 0.01)
    assert {event.token for event in events if isinstance(event, Undelivered)} == {flying, waiting}
    assert frames(transport, transport.outgoing(1.0)) == []


def test_emergency_does_not_cut_a_split_command() -> None:
    left, right = Transport(Role.CONTROLLER, 3, 0.0), Transport(Role.DEVICE, 3, 0.0)
    link = FaultyWire(0, Faults(), left, right)
    long = custom(1, bytes(2500))
    left.send(long, 0.0)
    link.run(0.0015)
    left.send(ardrone3.Emergency(), link.now)
    link.run(0.1)
    assert messages(link.heard[1]) == [long, ardrone3.Emergency()]


# -- acknowledgements and sequence windows


@pytest.mark.parametrize(
    ("type", "version", "earlier", "seq", "taken"),
    [
        (FrameType.NOACK, 3, [], 0, True),  # the first frame
        (FrameType.NOACK, 3, [], 65530, True),
        (FrameType.NOACK, 3, [20], 21, True),
        (FrameType.NOACK, 3, [20], 25, True),  # frames were lost
        (FrameType.NOACK, 3, [20], 20, False),  # a repetition
        (FrameType.NOACK, 3, [20], 10, False),  # ten below: late
        (FrameType.NOACK, 3, [20], 9, True),  # eleven below: the peer began again
        (FrameType.NOACK, 3, [100, 65530], 2, True),  # wrapped
        (FrameType.NOACK, 1, [], 0, True),
        (FrameType.NOACK, 1, [100, 250], 3, True),
        (FrameType.NOACK, 1, [100, 250], 245, False),
        (FrameType.NOACK, 1, [100, 250], 239, True),
        (FrameType.WITHACK, 3, [], 0, True),
        (FrameType.WITHACK, 3, [], 40000, True),  # a peer that counts on from an earlier connection
        (FrameType.WITHACK, 1, [], 200, True),
        (FrameType.WITHACK, 3, [20], 21, True),
        (FrameType.WITHACK, 3, [20], 25, True),  # a peer that speaks version 1 gives some up
        (FrameType.WITHACK, 3, [20], 20, False),
        (FrameType.WITHACK, 3, [2000], 9, False),  # however late, it is a copy
        (FrameType.WITHACK, 3, [20000, 40000, 65530], 2, True),
        (FrameType.WITHACK, 3, [20000, 40000, 65530, 2], 65530, False),  # a copy from before the wrap
        (FrameType.WITHACK, 1, [], 0, True),
        (FrameType.WITHACK, 1, [100, 200, 250], 3, True),
        (FrameType.WITHACK, 1, [100, 200, 250, 3], 250, False),
        (FrameType.WITHACK, 1, [100, 200], 80, False),
    ],
)
def test_sequence_window(type: FrameType, version: int, earlier: list[int], seq: int, taken: bool) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    for number in earlier:
        assert messages(transport.receive(data_frame(version, 126, number, HOVERING, type), 0.0)) == [HOVERING]
    transport.outgoing(0.0)
    got = messages(transport.receive(data_frame(version, 126, seq, HOVERING, type), 0.0))
    assert got == ([HOVERING] if taken else [])
    assert transport.counters["duplicate"] == (not taken)
    # A repetition is acknowledged again: it is the acknowledgement that was lost.
    answers = [frame.payload for frame in frames(transport, transport.outgoing(0.0))]
    width = 1 if version == 1 else 2
    assert answers == ([seq.to_bytes(width, "little")] if type == FrameType.WITHACK else [])


@pytest.mark.parametrize("version", VERSIONS)
def test_queues_count_separately_and_acknowledgements_share_a_counter(version: int) -> None:
    device = Transport(Role.DEVICE, version, 0.0)
    controller = Transport(Role.CONTROLLER, version, 0.0)
    for turn in range(2):
        device.send(HOVERING, 0.0)
        device.send(ardrone3.AltitudeChanged(0.0), 0.0)
        sent = device.outgoing(0.0)
        assert [(frame.id, frame.seq) for frame in frames(device, sent)] == [(127, turn), (126, turn)]
        for datagram in sent:
            controller.receive(datagram, 0.0)
        controller.receive(data_frame(version, 125, turn, HOVERING), 0.0)
        answers = controller.outgoing(0.0)
        assert [(frame.id, frame.seq) for frame in frames(controller, answers)] == [
            (254, 2 * turn),
            (253, 2 * turn + 1),
        ]
        for datagram in answers:
            device.receive(datagram, 0.0)


@pytest.mark.parametrize("version", [1, 3])
def test_sequence_numbers_wrap(version: int) -> None:
    left, right = Transport(Role.CONTROLLER, version, 0.0), Transport(Role.DEVICE, version, 0.0)
    last = 0xFF if version == 1 else 0xFFFF
    for count in range(last + 3):
        left.send(tilt(count), 0.0)
        (datagram,) = left.outgoing(0.0)
        assert messages(right.receive(datagram, 0.0)) == [tilt(float(count))]
        (answer,) = right.outgoing(0.0)
        assert len(left.receive(answer, 0.0)) == 1
    assert frames(left, [datagram])[0].seq == 1


@pytest.mark.parametrize("version", VERSIONS)
def test_stop_and_wait(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    first = transport.send(tilt(1), 0.0)
    (sent,) = transport.outgoing(0.0)
    second = transport.send(tilt(2), 0.01)
    assert transport.outgoing(0.01) == []
    # acknowledgements of another queue, of another frame, or without a number change nothing
    assert transport.receive(ack(version, 11, 7), 0.02) == []
    assert transport.receive(ack(version, 10, 0), 0.02) == [Garbage("queue")]
    assert transport.receive(encode_frame(version, FrameType.ACK, 139, 0, b""), 0.02) == [Garbage("ack")]
    assert transport.outgoing(0.02) == []
    assert transport.receive(ack(version, 11, 0), 0.03) == [Delivered(first)]
    (frame,) = frames(transport, transport.outgoing(0.03))
    assert frame.seq == 1
    assert frame.payload == with_length(version, wire.encode(tilt(2)))
    # a second acknowledgement of the first frame is no acknowledgement of the second
    assert transport.receive(ack(version, 11, 0), 0.04) == []
    assert transport.counters["stale ack"] == 2
    assert transport.receive(ack(version, 11, 1), 0.04) == [Delivered(second)]
    assert transport.outgoing(1.0) == []
    assert frames(transport, [sent])[0].seq == 0


@pytest.mark.parametrize("version", VERSIONS)
def test_a_frame_is_repeated_unchanged_after_150_ms(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 10.0)
    transport.send(tilt(1), 10.0)
    sent = transport.outgoing(10.0)
    assert transport.deadline() == pytest.approx(10.15)
    assert transport.expire(10.149) == []
    assert transport.outgoing(10.149) == []
    assert transport.expire(10.151) == []
    assert transport.outgoing(10.151) == sent
    assert transport.deadline() == pytest.approx(10.301)
    assert transport.counters["retransmitted"] == 1


def sendings(transport: Transport, token: int) -> tuple[int, list[Event]]:
    """How often the frame is sent within 5 s in which the peer says something, but acknowledges nothing."""
    count, events = 0, []
    for step in range(500):
        now = step / 100
        if step % 50 == 0:
            transport.receive(encode_frame(transport.version, FrameType.NOACK, 1, step // 50, bytes(8)), now)
        events += transport.expire(now)
        count += sum(frame.type == FrameType.WITHACK for frame in frames(transport, transport.outgoing(now)))
    return count, events


def test_version_1_controller_gives_up_after_five_repetitions() -> None:
    transport = Transport(Role.CONTROLLER, 1, 0.0)
    token = transport.send(tilt(1), 0.0)
    assert sendings(transport, token) == (6, [Undelivered(token, "no acknowledgement")])
    # the next command has the next number
    transport.send(tilt(2), 5.0)
    assert frames(transport, transport.outgoing(5.0))[0].seq == 1


def test_version_1_controller_with_unlimited_retries_continues() -> None:
    transport = Transport(Role.CONTROLLER, 1, 0.0, gives_up=False)
    token = transport.send(tilt(1), 0.0)
    count, events = sendings(transport, token)
    assert count > 30
    assert events == []
    transport.cancel(token)
    assert frames(transport, transport.outgoing(60.0)) == []


@pytest.mark.parametrize("message", [common.AllStates(), common.AllSettings(), ardrone3.Emergency()])
def test_version_1_repeats_parrots_marked_messages_without_limit(message: wire.Message) -> None:
    transport = Transport(Role.CONTROLLER, 1, 0.0)
    count, events = sendings(transport, transport.send(message, 0.0))
    assert count > 30
    assert events == []


@pytest.mark.parametrize(("role", "version"), [(Role.DEVICE, 1), (Role.CONTROLLER, 2), (Role.CONTROLLER, 3)])
def test_all_others_repeat_for_ever(role: Role, version: int) -> None:
    transport = Transport(role, version, 0.0)
    count, events = sendings(transport, transport.send(tilt(1), 0.0))
    assert count > 30
    assert events == []


# -- cancel


@pytest.mark.parametrize("version", VERSIONS)
def test_cancelled_waiting_message_is_never_sent(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    transport.cancel(transport.send(tilt(1), 0.0))
    transport.cancel(transport.send(STICKS, 0.0))
    transport.cancel(12345)
    assert transport.outgoing(0.0) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_a_cancelled_message_in_flight_is_not_repeated(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    token = transport.send(tilt(1), 0.0)
    transport.outgoing(0.0)
    transport.cancel(token)
    assert transport.outgoing(0.2) == []
    # what follows does not wait for it, and has the next number: the late frame then counts as old
    transport.send(tilt(2), 0.3)
    (datagram,) = transport.outgoing(0.3)
    peer = Transport(Role.DEVICE, version, 0.0)
    assert messages(peer.receive(datagram, 0.3)) == [tilt(2)]
    assert messages(peer.receive(data_frame(version, 11, 0, tilt(1)), 0.4)) == []
    assert transport.receive(ack(version, 11, 0), 0.5) == []


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("arrived", [True, False])
def test_frame_is_repeated_without_its_cancelled_message(version: int, arrived: bool) -> None:
    left, right = Transport(Role.CONTROLLER, version, 0.0), Transport(Role.DEVICE, version, 0.0)
    tokens = [left.send(tilt(count), 0.0) for count in range(3)]
    (first,) = left.outgoing(0.0)
    got = messages(right.receive(first, 0.0)) if arrived else []
    left.cancel(tokens[1])
    (second,) = left.outgoing(0.2)
    got += messages(right.receive(second, 0.2))
    assert got == ([tilt(0), tilt(1), tilt(2)] if arrived else [tilt(0), tilt(2)])
    events = [event for answer in right.outgoing(0.2) for event in left.receive(answer, 0.2)]
    assert events == [Delivered(tokens[0]), Delivered(tokens[2])]


def test_cancelled_split_command_in_progress_is_completed() -> None:
    left, right = Transport(Role.CONTROLLER, 3, 0.0), Transport(Role.DEVICE, 3, 0.0)
    link = FaultyWire(0, Faults(), left, right)
    long = custom(1, bytes(2500))
    token = left.send(long, 0.0)
    last = left.send(tilt(1), 0.0)
    link.run(0.0015)
    left.cancel(token)
    link.run(0.1)
    assert messages(link.heard[1]) == [long, tilt(1)]
    assert [event for event in link.heard[0] if isinstance(event, Delivered)] == [Delivered(token), Delivered(last)]


def test_cancelled_part_of_a_split_command_is_repeated() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0)
    token = transport.send(custom(1, bytes(2500)), 0.0)
    lost = transport.outgoing(0.0)
    transport.cancel(token)
    assert transport.outgoing(0.2) == lost


# -- pings


@pytest.mark.parametrize("version", VERSIONS)
def test_ping_is_answered_with_its_number_and_payload(version: int) -> None:
    transport = Transport(Role.DEVICE, version, 0.0)
    ping = encode_frame(version, FrameType.NOACK, 0, 77, b"\1\2\3\4\5\6\7\x08")
    assert transport.receive(ping, 0.0) == []
    assert frames(transport, transport.outgoing(0.0)) == [Frame(FrameType.NOACK, 1, 77, b"\1\2\3\4\5\6\7\x08")]


def test_three_unanswered_pings_in_silence_end_the_link() -> None:
    transport = Transport(Role.DEVICE, 3, 100.0, ping_after=2.0)
    pings = []
    events: list[Event] = []
    for _ in range(4):
        deadline = transport.deadline()
        assert deadline is not None
        events += transport.expire(deadline)
        pings += [(deadline, frame.seq) for frame in frames(transport, transport.outgoing(deadline))]
    assert pings == [(102.0, 0), (104.0, 1), (106.0, 2)]
    assert events == [LinkDown("3 pings unanswered, nothing received for 8.0 s")]
    assert transport.deadline() is None


@pytest.mark.parametrize("version", VERSIONS)
def test_controller_that_sends_sticks_measures_the_round_trip(version: int) -> None:
    """One ping a second beside them; a pong that is not one of ours measures nothing, and nothing ends the session."""
    transport = Transport(Role.CONTROLLER, version, 0.0, ping_after=0.5)
    pings: list[tuple[float, Frame]] = []
    for step in range(1, 61):
        now = step * 0.05
        transport.receive(data_frame(version, 127, step, HOVERING, FrameType.NOACK), now)
        transport.send(STICKS, now)
        pings += [(now, frame) for frame in frames(transport, transport.outgoing(now)) if frame.id == 0]
    assert [at for at, _ in pings] == [pytest.approx(at) for at in (1.0, 2.0, 3.0)]
    assert transport.round_trip.seconds == 0.0

    def pong(payload: bytes, now: float) -> None:
        assert transport.receive(encode_frame(version, FrameType.NOACK, 1, 7, payload), now) == []

    for payload in (b"", b"\1\2\3", bytes(8), b"\xff" * 8, b"\xff" * 9):
        pong(payload, 3.1)
        assert transport.round_trip.seconds == 0.0
    pong(pings[2][1].payload, 3.4)
    assert transport.round_trip.seconds == pytest.approx(0.4, abs=0.001)
    pong(pings[2][1].payload, 3.1)  # a shorter one is believed in steps
    assert transport.round_trip.seconds == pytest.approx(0.31, abs=0.001)
    pong(pings[0][1].payload, 3.4)  # late: a longer one at once
    assert transport.round_trip.seconds == pytest.approx(2.4, abs=0.001)
    assert transport.expire(4.0) == []


def test_any_frame_restarts_the_silence_timer() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0, ping_after=0.5, silence_limit=2.5)
    for step in range(40):
        now = step * 0.45
        assert transport.expire(now) == []
        assert [frame for frame in frames(transport, transport.outgoing(now)) if frame.id == 0] == []
        transport.receive(data_frame(3, 127, step, ardrone3.AltitudeChanged(0.0), FrameType.NOACK), now)
    # two pings unanswered, then a pong: three more are needed
    for _ in range(2):
        assert transport.expire(transport.deadline() or 0.0) == []
    now = 40 * 0.45 + 0.6
    transport.receive(encode_frame(3, FrameType.NOACK, 1, 1, bytes(8)), now)
    for count in (1, 2, 3):
        assert transport.deadline() == pytest.approx(now + 0.5 * count)
        assert transport.expire(now + 0.5 * count) == []
    assert transport.expire(now + 2.0) == [LinkDown("3 pings unanswered, nothing received for 2.0 s")]


def test_silence_limit_ends_the_link_before_the_pings_do() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0, ping_after=2.0, silence_limit=2.5)
    assert transport.expire(2.0) == []
    assert transport.deadline() == 2.5
    assert transport.expire(2.5) == [LinkDown("nothing received for 2.5 s")]


def test_unreadable_bytes_are_no_sign_of_life() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0, silence_limit=1.0)
    assert transport.receive(b"\xff" * 20, 0.9) == [Garbage("version")]
    assert transport.deadline() == 1.0


def test_link_that_is_down_sends_and_receives_nothing() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0, silence_limit=1.0)
    transport.send(tilt(1), 0.0)
    transport.outgoing(0.0)
    transport.send(STICKS, 0.5)
    transport.expire(1.0)
    transport.send(ardrone3.Emergency(), 1.0)
    assert transport.outgoing(1.2) == []
    assert transport.receive(data_frame(3, 126, 0, HOVERING), 1.2) == []
    assert transport.expire(9.0) == []
    assert transport.counters["dropped.down"] == 1


# -- bounds, garbage and wrong arguments


def test_a_full_acknowledged_queue_refuses_the_newest() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0)
    tokens = [transport.send(tilt(1), 0.0) for _ in range(MAX_QUEUED + 1)]
    assert transport.deadline() == 0.0
    assert transport.expire(0.0) == [Undelivered(tokens[-1], "queue full")]


def test_a_full_unacknowledged_queue_drops_the_oldest() -> None:
    transport = Transport(Role.CONTROLLER, 1, 0.0)
    for count in range(MAX_QUEUED_NOACK + 1):
        transport.send(ardrone3.PCMD(1, 0, 0, 0, 0, count), 0.0)
    sent = [wire.decode(frame.payload) for frame in frames(transport, transport.outgoing(0.0))]
    assert len(sent) == MAX_QUEUED_NOACK
    assert sent[0] == ardrone3.PCMD(1, 0, 0, 0, 0, 1)
    assert transport.counters["dropped.noack"] == 1


def test_a_flood_of_pings_is_not_answered_in_full() -> None:
    transport = Transport(Role.DEVICE, 3, 0.0)
    transport.receive(encode_frame(3, FrameType.NOACK, 0, 0, b"") * 5000, 0.0)
    assert len(transport.outgoing(0.0)) == MAX_REPLIES
    assert transport.counters["dropped.reply"] == 5000 - MAX_REPLIES


@pytest.mark.parametrize(
    ("datagram", "reason"),
    [
        (b"\x0d\x02", "header"),
        (bytes.fromhex("0d 02 7f 0000 05 00"), "size"),
        (bytes.fromhex("0c 02 7f 0000 00"), "version"),
        (bytes.fromhex("0d 07 7f 0000 00"), "type"),
        (data_frame(3, 11, 0, tilt(1)), "queue"),  # what we send ourselves
        (data_frame(3, 50, 0, tilt(1)), "queue"),
        (encode_frame(3, FrameType.ACK, 126, 0, b"\0\0"), "queue"),
        (encode_frame(3, FrameType.ACK, 139, 0, b"\0"), "ack"),
        (bytes.fromhex("0d 02 7f 0000 01 09"), "payload"),
        (bytes.fromhex("0d 02 7f 0000 05 04 01 04 0100"), "command"),  # FlyingStateChanged without its argument
    ],
)
def test_garbage_is_counted_by_reason(datagram: bytes, reason: str) -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0)
    assert transport.receive(datagram, 0.0) == [Garbage(reason)]
    assert transport.counters == {"garbage." + reason: 1}


def test_our_own_wrong_arguments_raise() -> None:
    with pytest.raises(LocalProtocolError, match="version 4"):
        Transport(Role.CONTROLLER, 4, 0.0)
    with pytest.raises(LocalProtocolError, match="positive"):
        Transport(Role.CONTROLLER, 3, 0.0, ping_after=0.0)
    transport = Transport(Role.CONTROLLER, 2, 0.0)
    with pytest.raises(LocalProtocolError, match="1398"):
        transport.send(custom(1, bytes(1400)), 0.0)
    with pytest.raises(LocalProtocolError, match="PCMD"):
        transport.send(ardrone3.PCMD(1, 1000, 0, 0, 0, 0), 0.0)
    assert transport.outgoing(0.0) == []


# -- all together

BAD_AIR = Faults(loss=0.3, duplicate=0.1, delay=(0.005, 0.05))


def story(rng: random.Random, count: int) -> list[wire.UnknownMessage]:
    """Acknowledged messages, some of them long enough to be split."""
    result = []
    for number in range(count):
        size = rng.choice([0, 0, 0, 10, 900, 1300])
        result.append(custom(number, rng.randbytes(size)))
    return result


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("version", VERSIONS)
def test_each_acknowledged_message_arrives_once_and_in_order(version: int, seed: int) -> None:
    rng = random.Random(seed)
    controller = Transport(Role.CONTROLLER, version, 0.0, ping_after=60.0)
    device = Transport(Role.DEVICE, version, 0.0, ping_after=60.0)
    link = FaultyWire(seed, BAD_AIR, controller, device)
    spoken = (story(rng, 200), story(rng, 200))
    tokens: list[list[int]] = [[], []]
    for pair in zip(*spoken, strict=True):
        for end, message in enumerate(pair):
            tokens[end].append(link.ends[end].send(message, link.now))
        link.ends[1].send(ardrone3.AltitudeChanged(0.0), link.now)
        link.run(link.now + rng.uniform(0.0, 0.1))
    link.run(link.now + 120.0)
    for end in (0, 1):
        got = [message for message in messages(link.heard[1 - end]) if isinstance(message, wire.UnknownMessage)]
        delivered = [event.token for event in link.heard[end] if isinstance(event, Delivered)]
        given_up = {event.token for event in link.heard[end] if isinstance(event, Undelivered)}
        # A version 1 controller gives up now and then; such a message may have arrived all the same, or not.
        assert not given_up or (version == 1 and end == 0), f"seed {seed}"
        by_token = dict(zip(tokens[end], spoken[end], strict=True))
        assert delivered == [token for token in tokens[end] if token not in given_up], f"seed {seed}"
        arrived = [message for message in spoken[end] if message in got]
        assert got == arrived, f"seed {seed}"
        assert all(by_token[token] in got for token in delivered), f"seed {seed}"
    assert controller.counters["retransmitted"] > 10
    assert device.counters["duplicate"] > 10


@pytest.mark.parametrize("seed", range(4))
def test_cancelled_message_is_not_resent_on_bad_link(seed: int) -> None:
    rng = random.Random(seed)
    controller, device = Transport(Role.CONTROLLER, 3, 0.0, ping_after=60.0), Transport(Role.DEVICE, 3, 0.0)
    link = FaultyWire(seed, BAD_AIR, controller, device)
    cancelled_at: dict[int, tuple[float, int]] = {}
    for number in range(100):
        token = controller.send(tilt(number), link.now)
        link.run(link.now + rng.uniform(0.0, 0.3))
        if rng.random() < 0.5:
            controller.cancel(token)
            heard_before = len(messages(link.heard[1]))
            # a copy that is in the air already may still arrive
            link.run(link.now + BAD_AIR.delay[1])
            cancelled_at[number] = (link.now, heard_before)
            later = len(messages(link.heard[1]))
            link.run(link.now + 0.5)
            assert tilt(number) not in messages(link.heard[1])[later:], f"seed {seed}"
    assert len(cancelled_at) > 30
    kept = [tilt(number) for number in range(100) if number not in cancelled_at]
    link.run(link.now + 60.0)
    got = messages(link.heard[1])
    assert [message for message in got if message in kept] == kept, f"seed {seed}"
    assert len(got) == len({message.current for message in got if isinstance(message, ardrone3.MaxTilt)})


def mutated(rng: random.Random, datagram: bytes) -> bytes:
    data = bytearray(datagram)
    for _ in range(rng.randrange(1, 4)):
        kind = rng.randrange(4)
        position = rng.randrange(len(data) + 1)
        if kind == 0 and data:
            data[position % len(data)] = rng.randrange(256)
        elif kind == 1:
            del data[position:]
        elif kind == 2:
            data[position:position] = rng.randbytes(rng.randrange(8))
        else:
            data += rng.choice([b"", bytes(data), rng.randbytes(4)])
    return bytes(data)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("role", Role)
def test_no_bytes_of_a_peer_raise(role: Role, version: int, seed: int) -> None:
    """Whatever arrives, the transport does not raise, and it still answers a ping afterwards."""
    rng = random.Random(seed)
    speaker = Transport(Role.DEVICE if role is Role.CONTROLLER else Role.CONTROLLER, version, 0.0)
    victim = Transport(role, version, 0.0)
    corpus = [encode_frame(version, FrameType.NOACK, 0, 0, bytes(8)), ack(version, 11, 0), ack(version, 126, 0)]
    spoken: list[wire.Message | wire.UnknownMessage] = [STICKS, HOVERING, tilt(1), common.ProductNameChanged("ANAFI")]
    for message in spoken + list(story(rng, 10)):
        speaker.send(message, 0.0)
        for datagram in speaker.outgoing(0.0):
            corpus.append(datagram)
            for frame in frames(speaker, [datagram]):
                speaker.receive(ack(version, frame.id, frame.seq), 0.0)
    for number in range(6000):
        now = number / 5000
        if number % 3 == 0:
            datagram = rng.randbytes(rng.randrange(64))
            if rng.random() < 0.7:
                head = rng.choice([1, 2, 4]) if version == 1 else version + 10
                datagram = bytes([head]) + datagram
        else:
            datagram = mutated(rng, rng.choice(corpus))
        if number % 10 == 0:
            victim.send(tilt(number), now)
        for event in victim.receive(datagram, now):
            assert isinstance(event, ReceivedMessages | Delivered | Garbage), f"seed {seed}"
        victim.outgoing(now)
        victim.expire(now)
    assert sum(count for name, count in victim.counters.items() if name.startswith("garbage.")) > 100
    victim.receive(corpus[0], 1.2)
    assert any(frame.id == 1 for frame in frames(victim, victim.outgoing(1.2)))


def test_fading_link_drops_waiting_messages_and_recovers() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0, ping_after=0.5, silence_limit=2.5, fades=True)
    transport.send(tilt(1.0), 0.0)
    transport.outgoing(0.0)
    waiting = transport.send(tilt(2.0), 0.1)
    for now in (0.5, 1.0, 1.5):
        assert transport.expire(now) == []
        transport.outgoing(now)
    events = transport.expire(2.0)
    assert events[0] == Silent("3 pings unanswered, nothing received for 2.0 s")
    assert Undelivered(waiting, "the link is silent") in events
    # Nothing, however long: a peer that hears us has to miss us.
    transport.send(tilt(3.0), 2.1)
    transport.send(STICKS, 2.1)
    for step in range(1, 20):
        now = 2.0 + 0.5 * step
        assert transport.expire(now) == []
        assert transport.outgoing(now) == []
    spoken = transport.receive(data_frame(3, 126, 0, HOVERING), 12.0)
    assert spoken == [Speaks(), ReceivedMessages([HOVERING])]
    (answer,) = frames(transport, transport.outgoing(12.0))
    assert answer.type == FrameType.ACK
    transport.send(tilt(4.0), 12.0)
    (frame,) = frames(transport, transport.outgoing(12.0))
    assert (frame.seq, frame.payload[1:]) == (1, wire.encode(tilt(4.0)))


@pytest.mark.parametrize("version", VERSIONS)
def test_commands_to_a_silent_peer_are_all_sent_in_their_time(version: int) -> None:
    """In version 1 each has a frame of its own, and no acknowledgement makes room for the next one."""
    transport = Transport(Role.CONTROLLER, version, 0.0, ping_after=9.0, silence_limit=2.5, gives_up=False, fades=True)
    assert Silent("nothing received for 2.5 s") in transport.expire(2.5)
    stops = [ardrone3.CancelMoveTo(), ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0), ardrone3.StopPilotedPOI(), tilt(1.0)]
    for message in stops:
        transport.send(message, 2.5, unheard=1.0)
    sent: list[bytes] = []
    for step in range(80):
        now = 2.5 + 0.05 * step
        transport.expire(now)
        sent += [frame.payload for frame in frames(transport, transport.outgoing(now))]
    for message in stops:
        assert sum(wire.encode(message) in payload for payload in sent) > MAX_RETRIES_V1


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("count", [1, 2])
def test_last_command_to_a_silent_peer_is_sent_until_it_is_cancelled(version: int, count: int) -> None:
    """It may hear us again at any moment."""
    transport = Transport(Role.CONTROLLER, version, 0.0, ping_after=9.0, silence_limit=2.5, gives_up=False, fades=True)
    assert Silent("nothing received for 2.5 s") in transport.expire(2.5)
    for _ in range(count - 1):
        transport.send(ardrone3.CancelMoveTo(), 2.5, unheard=4.0 / count)
    stop = ardrone3.StopPilotedPOI()
    token = transport.send(stop, 2.5, unheard=4.0 / count)
    sent_at: list[float] = []
    for step in range(160):
        now = 2.5 + 0.05 * step
        if step == 80:
            transport.cancel(token)
        transport.expire(now)
        datagrams = frames(transport, transport.outgoing(now))
        sent_at += [now for frame in datagrams if wire.encode(stop) in frame.payload]
    assert 6.3 < sent_at[-1] < 6.5


# What another process sends for us.


@pytest.mark.parametrize("version", VERSIONS)
def test_frames_encoded_ahead_equal_the_next_frames_sent(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    transport.send(tilt(1.0), 0.0)
    transport.outgoing(0.0)
    transport.receive(ack(version, 11, 0), 0.0)
    ahead = transport.encode_ahead((tilt(2.0), tilt(3.0)))
    assert [seq for seq, _ in ahead] == ([1, 2] if version == 1 else [1])
    transport.send(tilt(2.0), 0.0)
    transport.send(tilt(3.0), 0.0)
    assert transport.outgoing(0.0) == [ahead[0][1]]


@pytest.mark.parametrize("version", VERSIONS)
def test_abandoned_commands_are_undelivered_and_their_numbers_unused(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    tokens = [transport.send(tilt(1.0), 0.0)]
    transport.outgoing(0.0)
    tokens.append(transport.send(tilt(2.0), 0.0))
    transport.abandon("the host stalled", skip=2)
    assert transport.outgoing(10.0) == []
    assert transport.receive(b"", 0.1) == [Undelivered(token, "the host stalled") for token in tokens]
    transport.send(tilt(3.0), 0.2)
    assert [frame.seq for frame in frames(transport, transport.outgoing(0.2))] == [3]


@pytest.mark.parametrize("version", VERSIONS)
def test_stops_of_after_a_stall_are_kept_of_abandoned_commands(version: int) -> None:
    """One of before the stall is as old as that: the pilot may have the sticks since."""
    transport = Transport(Role.CONTROLLER, version, 0.0)
    in_flight = transport.send(ardrone3.Landing(), 0.0, Rank.URGENT)
    transport.outgoing(0.0)
    old = transport.send(ardrone3.Landing(), 0.1, Rank.URGENT)
    other = transport.send(tilt(2.0), 1.5)
    landing = transport.send(ardrone3.Landing(), 1.5, Rank.URGENT)
    transport.abandon("the host stalled", skip=2, stops_since=0.6)
    assert transport.receive(b"", 1.6) == [Undelivered(token, "the host stalled") for token in (in_flight, old, other)]
    assert [frame.seq for frame in frames(transport, transport.outgoing(1.7))] == [3]
    assert transport.receive(ack(version, 11, 3), 1.8) == [Delivered(landing)]


@pytest.mark.parametrize("version", VERSIONS)
def test_emergency_is_kept_of_abandoned_commands(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    emergency = transport.send(ardrone3.Emergency(), 1.5)
    transport.abandon("the host stalled", stops_since=0.6)
    transport.outgoing(1.6)
    assert transport.receive(ack(version, 11, 0), 1.7) == [Delivered(emergency)]


def test_silence_while_the_host_stalls_is_not_the_peers() -> None:
    transport = Transport(Role.CONTROLLER, 3, 0.0, ping_after=0.5, silence_limit=2.5)
    assert transport.expire(5.0) == []  # 4.5 s late
    assert transport.deadline() == pytest.approx(5.5)
    for now in (5.5, 6.0):
        assert transport.expire(now) == []
    assert [type(event) for event in transport.expire(6.5)] == [LinkDown]


@pytest.mark.parametrize("version", VERSIONS)
def test_urgent_command_goes_before_settings_that_wait_and_before_nothing_else(version: int) -> None:
    transport = Transport(Role.CONTROLLER, version, 0.0)
    first = transport.send(tilt(1), 0.0, Rank.SETTING)
    transport.outgoing(0.0)  # in flight
    before = transport.send(common.AllStates(), 0.0)
    settings = [transport.send(tilt(value), 0.0, Rank.SETTING) for value in (2, 3)]
    urgent = transport.send(ardrone3.CancelMoveTo(), 0.0, Rank.URGENT)
    later = transport.send(ardrone3.Landing(), 0.0)
    last = transport.send(ardrone3.CancelMoveTo(), 0.0, Rank.URGENT)
    delivered, seq = [], 0
    while len(delivered) < 7:
        delivered += [e.token for e in transport.receive(ack(version, 11, seq), 0.0) if isinstance(e, Delivered)]
        transport.outgoing(0.0)
        seq += 1
    assert delivered == [first, before, urgent, *settings, later, last]

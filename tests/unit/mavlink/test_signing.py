"""Signatures: pymavlink's own signer as the reference, and each rule about timestamps."""

from __future__ import annotations

import hashlib
import random

import pytest
from pymavlink.dialects.v20 import common as stock

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import SIGNED, Batch, Parser, Verdict, frame, pack, with_flags
from anafi_mav.mavlink.signing import (
    LATEST,
    MAX_RECENT,
    MAX_STREAMS,
    NEW_STREAM_AGE,
    SAVED_AHEAD,
    SAVED_AHEAD_BURST,
    TICKS,
    Signing,
    key_of_passphrase,
    ticks,
)

SECRET = bytes(range(32))
HEARTBEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
START = ticks(1_800_000_000.0)


def signing(secret: bytes = SECRET, timestamp: int = START) -> Signing:
    return Signing("field", secret + timestamp.to_bytes(8, "little"))


class Peer:
    """A client as pymavlink signs."""

    def __init__(
        self, *, secret: bytes = SECRET, timestamp: int = START, link: int = 7, sysid: int = 255, signs: bool = True
    ) -> None:
        self.mav = stock.MAVLink(None, sysid, 190)
        self.mav.signing.secret_key = secret
        self.mav.signing.link_id = link
        self.mav.signing.timestamp = timestamp
        self.mav.signing.sign_outgoing = signs

    def frame(self, message: stock.MAVLink_message | None = None) -> bytes:
        data: bytes = (message or stock.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)).pack(self.mav)
        self.mav.seq = (self.mav.seq + 1) % 256
        return data


def judged(key: Signing, raw: bytes) -> Verdict:
    """The verdict on a channel of its own."""
    return key.judge(raw, raw[7] | raw[8] << 8 | raw[9] << 16, {})


def test_signature_is_the_one_captured_from_pymavlink() -> None:
    # pymavlink 2.4.49: system 255, component 190, key 00 01 … 1f, link id 7, timestamp 0x0102030405.
    captured = "fd09010000ffbe000000000000000608000403dab007050403020100ebe3ff0a9ac0"
    key = signing(timestamp=0x0102030404)
    raw = frame(pack(HEARTBEAT), 0, 255, 190, SIGNED)
    assert key.sign(raw, 7).hex() == captured
    assert judged(signing(timestamp=0), bytes.fromhex(captured)) is Verdict.VERIFIED


def test_ticks_count_from_2015() -> None:
    assert ticks(1_420_070_400.0) == 0
    assert ticks(1_420_070_401.5) == 150_000
    assert ticks(0.0) == 0


def test_frame_of_pymavlink_is_verified_once() -> None:
    key, peer = signing(), Peer(timestamp=START + 1)
    raw = peer.frame()
    assert judged(key, raw) is Verdict.VERIFIED
    assert judged(key, raw) is Verdict.REPLAYED
    assert judged(key, peer.frame()) is Verdict.VERIFIED


def test_each_changed_bit_of_a_signed_frame_is_refused() -> None:
    key, raw = signing(timestamp=0), Peer(timestamp=START).frame()
    for bit in range(8, 8 * len(raw)):
        if bit // 8 == 2:  # the flags: without the right one it is not a signed frame
            continue
        changed = bytearray(raw)
        changed[bit // 8] ^= 1 << bit % 8
        assert judged(key, bytes(changed)) is Verdict.FORGED
    assert judged(key, raw) is Verdict.VERIFIED


def test_frame_of_another_key_moves_no_timestamp() -> None:
    key = signing()
    assert judged(key, Peer(secret=bytes(32), timestamp=START + 99 * TICKS).frame()) is Verdict.FORGED
    assert key.timestamp == START
    assert judged(key, Peer(timestamp=START + 1).frame()) is Verdict.VERIFIED


def test_streams_have_their_own_timestamps() -> None:
    key = signing()
    assert judged(key, Peer(timestamp=START + 50 * TICKS).frame()) is Verdict.VERIFIED
    for other in (Peer(timestamp=START + 1, link=8), Peer(timestamp=START + 1, sysid=254)):
        assert judged(key, other.frame()) is Verdict.VERIFIED
    assert judged(key, Peer(timestamp=START + 1).frame()) is Verdict.REPLAYED


def test_new_stream_more_than_a_minute_behind_is_refused() -> None:
    key = signing(timestamp=0)
    key.advance(1_800_000_000.0)
    assert judged(key, Peer(timestamp=START - NEW_STREAM_AGE - 1).frame()) is Verdict.REPLAYED
    assert judged(key, Peer(timestamp=START - NEW_STREAM_AGE).frame()) is Verdict.VERIFIED


def test_own_timestamp_follows_a_verified_frame() -> None:
    key = signing()
    judged(key, Peer(timestamp=START + 5000).frame())
    assert key.timestamp == START + 5000
    sent = key.sign(frame(pack(HEARTBEAT), 0, 1, 1, SIGNED), 3)
    assert int.from_bytes(sent[-12:-6], "little") == START + 5001
    assert sent[-13] == 3


def test_timestamp_near_the_end_of_its_48_bits_is_refused() -> None:
    key = signing()
    assert judged(key, Peer(timestamp=LATEST).frame()) is Verdict.REPLAYED
    assert key.timestamp == START


def test_frame_ten_years_ahead_leaves_timestamps_for_others() -> None:
    key = signing()
    key.advance(1_800_000_000.0)
    ten_years = 10 * 365 * 86_400 * TICKS
    assert judged(key, Peer(timestamp=LATEST - 1, sysid=9).frame()) is Verdict.REPLAYED
    assert judged(key, Peer(timestamp=START + ten_years, sysid=9).frame()) is Verdict.REPLAYED
    assert judged(key, Peer(timestamp=START + ten_years - 1, sysid=9).frame()) is Verdict.VERIFIED
    assert key.timestamp == START + ten_years - 1
    key.replace(SECRET, LATEST - 1)
    assert key.timestamp == START + ten_years - 1
    assert judged(key, Peer(timestamp=key.timestamp + 1).frame()) is Verdict.VERIFIED  # follows ours
    assert judged(key, Peer(timestamp=START, sysid=9).frame()) is Verdict.REPLAYED


def test_own_frame_that_is_sent_back_is_refused() -> None:
    key = signing()
    sent = key.sign(frame(pack(HEARTBEAT), 0, 1, 1, SIGNED), 3)
    assert judged(key, sent) is Verdict.REPLAYED


def test_frames_before_a_restart_are_refused_after_it() -> None:
    key, peer = signing(), Peer(timestamp=START + 1)
    key.advance(1_800_000_001.0)
    due = key.due(1_800_000_001.0)
    assert due == START + TICKS + SAVED_AHEAD
    recorded = [peer.frame() for _ in range(3)]
    assert [judged(key, raw) for raw in recorded] == [Verdict.VERIFIED] * 3
    again = Signing("field", key.content(due))  # after a crash: the file holds the timestamp that was saved ahead
    assert [judged(again, raw) for raw in recorded] == [Verdict.REPLAYED] * 3
    sent = again.sign(frame(pack(HEARTBEAT), 0, 1, 1, SIGNED), 1)
    assert int.from_bytes(sent[-12:-6], "little") == due + 1
    # pymavlink follows our timestamp, as the specification has it: its next frame is accepted.
    peer.mav.robust_parsing = True
    assert peer.mav.parse_buffer(sent)[0].get_signed()
    peer.mav.signing.timestamp += 1
    assert judged(again, peer.frame()) is Verdict.VERIFIED


def test_saving_is_due_before_the_saved_timestamp_is_reached() -> None:
    now = 1_800_000_000.0
    key = signing()
    key.saved = key.due(now) or 0
    assert key.due(now) is None
    key.advance(now + 9.5)
    assert key.due(now + 9.5) == ticks(now + 9.5) + SAVED_AHEAD
    # A timestamp that is ahead of the clock, by restarts or by a client, is saved in small steps.
    ahead = signing(timestamp=START + 3600 * TICKS)
    assert ahead.due(now) == START + 3600 * TICKS + 4 * SAVED_AHEAD_BURST


def test_timestamp_beyond_the_file_is_refused_until_it_is_saved() -> None:
    now, asked = 1_800_000_000.0, []
    key = signing()
    key.on_due = lambda: asked.append(key.due(now))
    key.saved, key.is_kept = key.due(now) or 0, True  # 10 s ahead
    assert judged(key, Peer(timestamp=START + 8 * TICKS - 1, sysid=1).frame()) is Verdict.VERIFIED
    assert asked == []
    # Within two seconds of the saved timestamp it is due, within one second it is refused until it is saved.
    assert judged(key, Peer(timestamp=START + 8 * TICKS, sysid=2).frame()) is Verdict.VERIFIED
    assert asked == [START + 12 * TICKS]
    ahead = Peer(timestamp=START + 30 * TICKS, sysid=3)
    assert judged(key, ahead.frame()) is Verdict.UNSAVED
    assert asked[1:] == [START + 34 * TICKS]
    assert key.timestamp == START + 8 * TICKS
    key.saved = asked[-1] or 0
    assert judged(key, ahead.frame()) is Verdict.VERIFIED
    # A disk that is not written in time refuses no frame.
    key.is_kept = False
    assert judged(key, Peer(timestamp=START + 3600 * TICKS, sysid=4).frame()) is Verdict.VERIFIED


def test_own_timestamp_waits_for_the_file_behind_a_clock_that_leaps() -> None:
    now = 1_800_000_000.0
    key = signing()
    key.saved, key.is_kept = key.due(now) or 0, True
    key.advance(now + 3600.0)
    assert key.timestamp == START + SAVED_AHEAD - SAVED_AHEAD_BURST
    key.saved = key.due(now + 3600.0) or 0
    assert key.saved == START + 3600 * TICKS + SAVED_AHEAD
    key.advance(now + 3600.0)
    assert key.timestamp == START + 3600 * TICKS


def test_another_key_keeps_the_timestamp_and_forgets_the_streams() -> None:
    key, old = signing(), Peer(timestamp=START + 10)
    recorded = old.frame()
    assert judged(key, recorded) is Verdict.VERIFIED
    key.replace(bytes(reversed(SECRET)), 5)
    assert judged(key, old.frame()) is Verdict.FORGED
    assert key.timestamp == START + 10
    key.replace(SECRET)
    assert judged(key, recorded) is Verdict.REPLAYED
    key.replace(bytes(32))
    assert not key.is_on


def test_unsigned_frames_of_radios_and_receivers_are_allowed() -> None:
    key, peer = signing(), Peer(signs=False)
    assert judged(key, peer.frame()) is Verdict.UNSIGNED
    assert judged(key, peer.frame(stock.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7))) is Verdict.ALLOWED
    collision = stock.MAVLink_collision_message(0, 1, 0, 0, 1.0, 1.0, 1.0)
    assert judged(key, peer.frame(collision)) is Verdict.ALLOWED


@pytest.mark.parametrize("length", [0, 39, 41])
def test_content_of_another_length_raises(length: int) -> None:
    with pytest.raises(LocalProtocolError):
        Signing("field", bytes(length))


def test_passphrase_is_hashed_as_mavproxy_does() -> None:
    assert key_of_passphrase("correct horse") == hashlib.sha256(b"correct horse").digest()


def test_flags_change_with_the_checksum_of_any_message() -> None:
    unsigned, signed = frame(pack(HEARTBEAT), 9, 1, 1), frame(pack(HEARTBEAT), 9, 1, 1, SIGNED)
    assert with_flags(unsigned, SIGNED) == signed
    assert with_flags(signed + bytes(13), 0) == unsigned


class Link:
    """A channel of ours and pymavlink at the other end."""

    def __init__(self, key: Signing, *, is_local: bool = False) -> None:
        self.written: list[bytes] = []
        self.channel = Channel("a link", self.written.append, write_all=self.written.extend, datagrams=True)
        self.channel.is_local = is_local
        self.channel.protect(key)


def test_each_frame_of_a_batch_is_signed() -> None:
    link, key = Link(signing()), signing()
    link.channel.send_batch(Batch([pack(HEARTBEAT), pack(HEARTBEAT)], 1, 1))
    assert [judged(key, raw) for raw in link.written] == [Verdict.VERIFIED, Verdict.VERIFIED]


def test_channel_with_a_key_delivers_verified_frames_only() -> None:
    key = signing()
    channel = Link(key).channel
    peer, other, plain = Peer(timestamp=START + 1), Peer(secret=bytes(32)), Peer(signs=False)
    wanted = peer.frame()
    frames = channel.receive(plain.frame() + other.frame() + wanted + wanted)
    assert [received.raw for received in frames] == [wanted]
    refusals = {"refused_unsigned": 1, "refused_signature": 1, "refused_replay": 1}
    assert refusals.items() <= channel.parser.counters.items()
    assert key.refused == refusals
    assert key.last_refused == "a link"
    assert channel.is_proved_by(frames)
    radio = channel.receive(plain.frame(stock.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)))
    assert len(radio) == 1
    assert not channel.is_proved_by(radio)


def test_channel_signs_what_pymavlink_verifies() -> None:
    one, other = Link(signing()), Link(signing(), is_local=True)
    other.channel.signing = one.channel.signing
    client = Peer()
    for _ in range(3):
        one.channel.send(HEARTBEAT, 1, 1)
        other.channel.send(HEARTBEAT, 1, 1)
    messages = [client.mav.parse_buffer(raw)[0] for raw in one.written + other.written]
    assert all(message.get_signed() for message in messages)
    assert [message.get_link_id() for message in messages] == [1, 1, 1, 2, 2, 2]
    assert client.mav.signing.goodsig_count == 6


def test_forwarded_frame_is_signed_for_verified_and_local_senders() -> None:
    key, other_key = signing(), signing(bytes(reversed(SECRET)))
    signed, same, elsewhere = Link(key), Link(key), Link(other_key)
    local, remote = Link(Signing("none"), is_local=True), Link(Signing("none"))
    raw = Peer(timestamp=START + 1).frame()
    (received,) = signed.channel.receive(raw)
    assert same.channel.prepare_forward(received, signed.channel) == raw
    assert remote.channel.prepare_forward(received, signed.channel) == with_flags(raw, 0)
    elsewhere.channel.forward(elsewhere.channel.prepare_forward(received, signed.channel) or b"")
    assert judged(signing(bytes(reversed(SECRET)), START - 1), elsewhere.written[0]) is Verdict.VERIFIED
    for source, expected in ((local, True), (remote, False)):
        (plain,) = source.channel.receive(Peer(signs=False).frame())
        assert (signed.channel.prepare_forward(plain, source.channel) is not None) is expected
    assert signed.channel.counters["refused_forwards"] == 1


def test_two_stations_with_equal_ids_lose_no_frame() -> None:
    key = signing()
    links = [Link(key).channel for _ in range(2)]
    near, far = Peer(timestamp=START + 200_000), Peer(timestamp=START)
    taken = [0, 0]
    recorded: list[list[bytes]] = [[], []]
    for turn in range(100):  # 25 frames/s each, the other station 100 ms behind
        for index, peer in enumerate((near, far)):
            peer.mav.signing.timestamp = START + 200_000 + 4000 * turn - 10_000 * index
            recorded[index].append(peer.frame())
            taken[index] += len(links[index].receive(recorded[index][-1]))
    assert taken == [100, 97]  # the first three are older than the first frame of the stream
    for raw in recorded[0] + recorded[1]:
        for channel in (*links, Link(key).channel):
            assert channel.receive(raw) == []


def test_two_senders_with_equal_timestamps_lose_no_frame() -> None:
    key = signing()
    one, other = Link(key).channel, Link(key).channel
    near, far = Peer(timestamp=START + 1), Peer(timestamp=START + 1)
    assert len(one.receive(near.frame())) == 1
    far.frame()
    for _ in range(5):
        raw, raws = near.frame(), far.frame(stock.MAVLink_system_time_message(0, 0))
        assert raw[-12:-6] == raws[-12:-6]
        assert [len(one.receive(raw)), len(other.receive(raws))] == [1, 1]
        assert one.receive(raws) == other.receive(raw) == []


def test_frame_that_was_held_back_is_refused_elsewhere() -> None:
    key = signing()
    one, other, peer = Link(key).channel, Link(key).channel, Peer(timestamp=START + 1)
    assert len(one.receive(peer.frame())) == 1
    held = peer.frame()
    peer.mav.signing.timestamp += 5 * TICKS + 1
    assert len(one.receive(peer.frame())) == 1
    assert one.receive(held) == other.receive(held) == []


def test_timestamps_of_one_stream_are_bounded_and_stay_refused() -> None:
    key, peer = signing(), Peer(timestamp=START + 1)
    one, other = Link(key).channel, Link(key).channel
    recorded = [peer.frame() for _ in range(3 * MAX_RECENT)]
    assert len(one.receive(b"".join(recorded))) == len(recorded)
    assert other.receive(b"".join(recorded)) == []


def test_streams_are_bounded_for_signed_and_received_frames() -> None:
    key = signing()
    first = key.sign(frame(pack(HEARTBEAT), 0, 201, 1, SIGNED), 1, is_own=False)
    for number in range(MAX_STREAMS):
        key.sign(frame(pack(HEARTBEAT), 0, 202 + number // 250, number % 250, SIGNED), 1, is_own=False)
    assert judged(key, first) is Verdict.REPLAYED


def test_signing_for_a_foreign_sender_refuses_none_of_its_frames() -> None:
    key = signing()
    remote, local = Link(key).channel, Link(Signing("none"), is_local=True).channel
    sent = Link(key)
    peer = Peer(timestamp=START + 1, link=1)
    assert len(remote.receive(peer.frame())) == 1
    in_flight = [peer.frame() for _ in range(3)]
    (plain,) = local.receive(Peer(signs=False).frame())
    key.advance(1_800_000_000.1)
    sent.channel.forward(sent.channel.prepare_forward(plain, local) or b"")
    assert (sent.written[0][5], sent.written[0][-13]) == (255, 1)
    assert [len(remote.receive(raw)) for raw in in_flight] == [1, 1, 1]
    assert remote.receive(sent.written[0]) == []  # our own frames are refused


def test_link_id_of_a_closed_channel_is_given_again() -> None:
    key = signing()
    links = [Link(key) for _ in range(3)]
    for link in links:
        link.channel.send(HEARTBEAT, 1, 1)
    links[1].channel.close()
    again = [Link(key) for _ in range(254)]
    for link in again:
        link.channel.send(HEARTBEAT, 1, 1)
    assert [link.written[0][-13] for link in (*links, *again)] == [1, 2, 3, 2, *range(4, 255), 255, 255]


def test_unknown_message_needs_a_signature() -> None:
    key, peer = signing(), Peer(timestamp=START + 1)
    channel = Link(key).channel
    known = peer.frame()
    unknown = bytearray(peer.frame())
    unknown[7:10] = (0xEE, 0xEE, 0x01)
    stamped = bytes(unknown[:-6])
    unknown[-6:] = hashlib.sha256(SECRET + stamped).digest()[:6]
    assert [received.message is None for received in channel.receive(known + bytes(unknown))] == [False, True]
    unknown[-1] ^= 1
    assert channel.receive(bytes(unknown)) == []


def test_ten_thousand_hostile_frames_are_refused() -> None:
    randoms = random.Random(14)
    key, peer = signing(), Peer(timestamp=START + 1)
    channel = Link(key).channel
    recorded = [peer.frame() for _ in range(50)]
    assert len(channel.receive(b"".join(recorded))) == 50
    plain, other = Peer(signs=False), Peer(secret=randoms.randbytes(32), timestamp=START + 10**6)
    for _ in range(3300):
        cut = bytearray(peer.frame())
        cut[-randoms.randint(1, 6)] ^= randoms.randint(1, 255)
        hostile = plain.frame() + other.frame() + bytes(cut) + randoms.choice(recorded)
        assert channel.receive(hostile) == []


def test_no_text_of_a_key_holds_its_secret() -> None:
    key = signing()
    texts = [
        repr(key),
        str(key),
        f"{key!r:}",
        repr(Link(key).channel),
        repr(Parser(lambda raw, id: key.judge(raw, id, {}))),
    ]
    for text in texts:
        assert SECRET.hex() not in text
        assert repr(SECRET) not in text
        assert str(list(SECRET)) not in text

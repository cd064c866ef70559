"""Frames: packed as pymavlink packs them, and found again in whatever arrives."""

from __future__ import annotations

import random
import re
import struct
from typing import Any

import pytest
from support.each import failures

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import MAX_FRAME, Packed, Parser, ReceivedFrame, frame, pack

# HEARTBEAT, quadrotor, PX4, custom mode 0x00030000 (Position), active, from 1/1 with sequence number 7, written out
# by hand from MAVLink serialization.md §packet_format and common.xml; the checksum by its §checksum with CRC extra 50.
HEARTBEAT = bytes.fromhex("fd 09 00 00 07 01 01 00 00 00  00 00 03 00 02 0c 01 04 03  9e 99")
# The same from a ground station 255/190 in version 1.
HEARTBEAT_1 = bytes.fromhex("fe 09 07 ff be 00  00 00 00 00 06 08 00 00 03  af 32")


def heartbeat() -> Any:
    return dialect.MAVLink_heartbeat_message(2, 12, 1, 0x00030000, 4, 3)


def crc(data: bytes) -> int:
    """X.25 as MAVLink computes it, bit by bit (MAVLink serialization.md §checksum)."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ 0x8408 if value & 1 else value >> 1
    return value


def random_message(kind: Any, source: random.Random) -> Any:
    """A message of this class with random fields of full range; texts of any bytes."""
    values = []
    formats = re.findall(r"(\d*)([a-zA-Z])", kind.unpacker.format)
    by_name = dict(zip(kind.ordered_fieldnames, formats, strict=True))
    for name in kind.fieldnames:
        count, code = by_name[name]
        if code in "sc":
            values.append(source.randbytes(int(count or 1)))
            continue
        numbers = [
            struct.unpack("<" + code, source.randbytes(struct.calcsize(code)))[0] for _ in range(int(count or 1))
        ]
        values.append(numbers if count else numbers[0])
    return kind(*values)


def test_golden_frame() -> None:
    assert frame(pack(heartbeat()), 7, 1, 1) == HEARTBEAT
    assert crc(HEARTBEAT[1:-2] + b"\x32") == int.from_bytes(HEARTBEAT[-2:], "little")
    [received] = Parser().receive(HEARTBEAT)
    assert (received.id, received.sysid, received.compid) == (0, 1, 1)
    assert (received.message.type, received.message.autopilot, received.message.custom_mode) == (2, 12, 0x00030000)


def test_version_1_is_parsed_and_forwarded_as_version_2() -> None:
    assert crc(HEARTBEAT_1[1:-2] + b"\x32") == int.from_bytes(HEARTBEAT_1[-2:], "little")
    [received] = Parser().receive(HEARTBEAT_1)
    assert (received.sysid, received.compid, received.message.type) == (255, 190, 6)
    again = received.version_2()
    assert again[:7] == bytes.fromhex("fd 09 00 00 07 ff be")
    [once_more] = Parser().receive(again)
    assert once_more.message.to_dict() == received.message.to_dict()
    assert once_more.version_2() is once_more.raw


def test_version_1_with_pymavlinks_extension_fields_is_parsed() -> None:
    sender = dialect.MAVLink(None, 9, 8)
    message = dialect.MAVLink_mission_count_message(1, 1, 5, 2)
    raw = message.pack(sender, force_mavlink1=True)
    [received] = Parser().receive(raw)
    assert (received.message.count, received.message.mission_type) == (5, 2)
    # Passed on without the zeros at its end: opaque_id is 0.
    assert len(received.version_2()) == 10 + 5 + 2


def name_of(id: int) -> str:
    return str(dialect.mavlink_map[id].msgname)


def test_each_message_is_framed_like_pymavlink() -> None:
    assert failures(sorted(dialect.mavlink_map), require_framed_alike, name_of) == ""


def require_framed_alike(id: int) -> None:
    source = random.Random(id)
    sender = dialect.MAVLink(None, 17, 18)
    parser = Parser()
    kind = dialect.mavlink_map[id]
    first = source.randrange(256)
    for number, message in enumerate(random_message(kind, source) for _ in range(3)):
        sender.seq = (first + number) % 256
        theirs = message.pack(sender)
        assert frame(pack(message), sender.seq, 17, 18) == theirs
        [received] = parser.receive(theirs)
        assert (received.id, received.sysid, received.compid, received.raw) == (id, 17, 18, theirs)
        assert type(received.message) is kind
        assert frame(pack(received.message), sender.seq, 17, 18) == theirs
    assert parser.counters == {"frames": 3}


def test_truncated_or_extended_message_is_read_like_pymavlink() -> None:
    assert failures(sorted(dialect.mavlink_map), require_read_alike, name_of) == ""


def require_read_alike(id: int) -> None:
    source, theirs, parser = random.Random(id), dialect.MAVLink(None), Parser()
    size = dialect.mavlink_map[id].unpacker.size
    for number, length in enumerate({1, size // 2 or 1, size, min(size + 3, 255)}):
        # Half of the bytes are zeros, which end texts.
        payload = bytes(source.choice((0, source.randrange(256))) for _ in range(length))
        raw = frame(Packed(id, payload), number, 17, 18)
        [received] = parser.receive_datagram(raw)
        wanted = theirs.decode(bytearray(raw))
        assert vars(received.message.get_header()) == vars(wanted.get_header())
        for name in (*wanted.fieldnames, "_signed", "_link_id", "_type"):
            ours, expected = getattr(received.message, name), getattr(wanted, name)
            assert type(ours) is type(expected)
            assert repr(ours) == repr(expected)  # NaN is not equal to itself
        assert str(received.message) == str(wanted)
        assert pack(received.message) == pack(wanted)


def test_lost_frames_are_counted_for_each_sender() -> None:
    parser = Parser()
    ping = pack(dialect.MAVLink_ping_message(1, 2, 0, 0))
    for seq, sysid in ((250, 7), (251, 7), (3, 9), (2, 7), (3, 7), (3, 9)):  # 252 to 1, and all but one number of 9's
        parser.receive(frame(ping, seq, sysid, 1))
    assert parser.counters["frames"] == 6
    assert parser.counters["lost_frames"] == 6 + 255


def test_trailing_zeros_are_cut_but_for_one_byte() -> None:
    assert pack(dialect.MAVLink_system_time_message(0, 0)).payload == b"\0"
    assert pack(dialect.MAVLink_system_time_message(1, 0)).payload == b"\x01"
    # A field named "id" is not the message's id.
    assert pack(dialect.MAVLink_battery_status_message(3, 1, 1, 0, [0] * 10, 0, 0, 0, 0)).id == 147


@pytest.mark.parametrize(
    "message",
    [
        dialect.MAVLink_heartbeat_message(256, 0, 0, 0, 0, 0),
        dialect.MAVLink_heartbeat_message(2.5, 0, 0, 0, 0, 0),
        dialect.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 9, 0, 0, 0, 0),
        dialect.MAVLink_battery_status_message(0, 0, 0, 0, 5, 0, 0, 0, 0),
        dialect.MAVLink_attitude_message(0, None, 0.0, 0.0, 0.0, 0.0, 0.0),
        dialect.MAVLink_bad_data(b"", "no message at all"),
    ],
)
def test_value_out_of_range_raises_local_error(message: Any) -> None:
    with pytest.raises(LocalProtocolError, match="cannot encode"):
        pack(message)


# Bytes that are no frame.


def noise(source: random.Random, size: int) -> bytes:
    """Random bytes in which start marks are frequent."""
    return bytes(source.choice((0xFD, 0xFE, 0x00, 0x01, source.randrange(256))) for _ in range(size))


def mixed_stream(source: random.Random, frames: int) -> tuple[bytes, list[bytes]]:
    """A stream of frames of both versions with noise between, and the frames in it."""
    senders = [dialect.MAVLink(None, sysid, 1) for sysid in (11, 12, 255)]
    kinds = [dialect.mavlink_map[id] for id in (0, 30, 76, 147, 253, 435)]
    stream, sent = b"", []
    for _ in range(frames):
        sender = source.choice(senders)
        message = random_message(source.choice(kinds), source)
        version_1 = message.get_msgId() < 256 and source.random() < 0.3
        raw = message.pack(sender, force_mavlink1=version_1)
        sender.seq = (sender.seq + 1) % 256
        stream += noise(source, source.choice((0, 0, 1, 3, 40))) + raw
        sent.append(raw)
    return stream, sent


def in_chunks(stream: bytes, source: random.Random, largest: int) -> tuple[Parser, list[bytes]]:
    parser, found = Parser(), []
    position = 0
    while position < len(stream):
        size = source.randint(1, largest)
        found += [received.raw for received in parser.receive(stream[position : position + size])]
        position += size
    return parser, found


@pytest.mark.parametrize("seed", range(5))
def test_any_stream_split_gives_the_same_frames(seed: int) -> None:
    source = random.Random(seed)
    stream, sent = mixed_stream(source, 60)
    # What a start mark in the noise makes the parser wait for.
    stream += bytes(MAX_FRAME)
    whole = Parser()
    frames = [received.raw for received in whole.receive(stream)]
    assert [raw for raw in frames if raw in sent] == sent
    for largest in (1, 2, 7, 100, 5000):
        parser, found = in_chunks(stream, random.Random(seed), largest)
        assert found == frames
        assert parser.counters == whole.counters


def test_a_false_start_mark_hides_no_frame() -> None:
    false = bytes.fromhex("fd ff 00 00 00 01 01 1e 00 00")  # it claims to be an ATTITUDE of 255 bytes
    parser = Parser()
    assert parser.receive(false + HEARTBEAT) == []
    [received] = parser.receive(bytes(MAX_FRAME))
    assert received.raw == HEARTBEAT
    assert parser.counters["bad_checksums"] == 1


def test_a_datagram_is_a_whole() -> None:
    parser = Parser()
    false = bytes.fromhex("fd ff 00 00 00 01 01 1e 00 00")  # it claims to be an ATTITUDE of 255 bytes
    assert [received.raw for received in parser.receive_datagram(false + HEARTBEAT + HEARTBEAT)] == [HEARTBEAT] * 2
    assert parser.receive_datagram(HEARTBEAT[:-1]) == []
    assert [received.raw for received in parser.receive_datagram(HEARTBEAT)] == [HEARTBEAT]
    assert parser.counters["garbage_bytes"] == len(false) + len(HEARTBEAT) - 1
    assert parser.receive_datagram(b"") == []


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_counted_and_bounded(seed: int) -> None:
    source = random.Random(seed)
    parser = Parser()
    for _ in range(200):
        assert parser.receive(noise(source, 500)) == []
        assert len(parser._pending) <= MAX_FRAME
    assert parser.counters["garbage_bytes"] + len(parser._pending) == 200 * 500
    assert parser.counters["frames"] == 0


def test_a_damaged_frame_is_no_frame() -> None:
    for position in range(len(HEARTBEAT)):
        damaged = bytearray(HEARTBEAT)
        damaged[position] ^= 0x40
        assert Parser().receive_datagram(bytes(damaged)) == []


def test_unknown_incompatibility_flag_is_refused() -> None:
    # serialization.md §incompat_flags: a packet with a flag that is not understood must be discarded.
    for flag in (0x02, 0x80):
        body = HEARTBEAT[1:2] + bytes((flag,)) + HEARTBEAT[3:-2]
        assert Parser().receive(b"\xfd" + body + crc(body + b"\x32").to_bytes(2, "little")) == []


def test_signed_frame_is_parsed_and_forwarded_with_signature() -> None:
    sender = dialect.MAVLink(None, 255, 190)
    sender.signing.secret_key = bytes(range(32))
    sender.signing.sign_outgoing = True
    raw = heartbeat().pack(sender)
    assert len(raw) == len(HEARTBEAT) + 13
    [received] = Parser().receive(raw)
    assert received.message.custom_mode == 0x00030000
    assert received.version_2() == raw


def unknown(sysid: int, compid: int) -> bytes:
    """A frame whose message id 0x0FFFFF no one has defined."""
    return bytes((0xFD, 3, 0, 0, 5, sysid, compid, 0xFF, 0xFF, 0x0F)) + b"abc" + b"\x12\x34"


def test_unknown_message_passes_only_from_a_verified_source() -> None:
    parser = Parser()
    assert parser.receive_datagram(unknown(1, 1)) == []
    parser.receive(HEARTBEAT)
    assert parser.receive_datagram(unknown(1, 2)) == []
    assert parser.receive_datagram(unknown(1, 1) + b"x") == []
    [received] = parser.receive_datagram(unknown(1, 1))
    assert received == ReceivedFrame(None, 0x0FFFFF, 1, 1, unknown(1, 1))
    assert received.version_2() == unknown(1, 1)
    assert parser.counters["unknown_frames"] == 1
    # In a stream the next start mark must follow, in the same read or a later one.
    assert parser.receive(unknown(1, 1)) == []
    assert [received.id for received in parser.receive(HEARTBEAT)] == [0x0FFFFF, 0]
    assert parser.receive(unknown(1, 1) + b"x") == []


def test_longer_payload_of_a_later_definition_is_cut() -> None:
    body = bytes((12, 0, 0, 7, 1, 1, 0, 0, 0)) + HEARTBEAT[10:-2] + b"new"
    [received] = Parser().receive(b"\xfd" + body + crc(body + b"\x32").to_bytes(2, "little"))
    assert received.message.system_status == 4

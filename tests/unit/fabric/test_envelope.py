"""Attachments in bytes, calculated by hand from docs/fabric.md, and frames in a sample."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from anafi_mav.fabric.envelope import FrameNumbers, Ping, Pong, UpEnvelope, micros, sender_of, split_frames
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import SIGNATURE, SIGNED, frame, pack, with_flags

SESSION = 0x1122334455667788
HEARTBEAT = frame(pack(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)), 5, 255, 190)
SIGNED_FRAME = with_flags(HEARTBEAT, SIGNED) + bytes(range(SIGNATURE))
VERSION_1 = bytes.fromhex("fe 09 00 01 01 00 00000000 02 03 51 03 03 0000".replace(" ", ""))


def test_up_envelope_has_these_bytes() -> None:
    # 1.5 s = 1 500 000 µs = 0x16E360
    data = bytes.fromhex("018877665544332211020100000000000060e3160000000000")
    assert UpEnvelope(SESSION, 258, micros(1.5)).encode() == data
    assert UpEnvelope.decode(data) == (SESSION, 258, 1_500_000)


def test_ping_and_pong_have_these_bytes() -> None:
    ping = bytes.fromhex("01887766554433221160e3160000000000")
    pong = ping + bytes.fromhex("ffffffffffffffff")
    assert Ping(SESSION, 1_500_000).encode() == ping
    assert Ping.decode(ping) == (SESSION, 1_500_000)
    assert Pong(SESSION, 1_500_000, -1).encode() == pong
    assert Pong.decode(pong) == (SESSION, 1_500_000, -1)


@pytest.mark.parametrize("kind", [UpEnvelope, Ping, Pong])
@pytest.mark.parametrize("data", [b"", bytes(17), bytes(25), b"\x02" + bytes(16), b"\x02" + bytes(24), b"\x01" * 26])
def test_bytes_of_another_version_or_length_are_no_envelope(
    kind: type[UpEnvelope] | type[Ping] | type[Pong], data: bytes
) -> None:
    assert kind.decode(data) is None


def test_sample_is_split_into_its_frames() -> None:
    parts = [HEARTBEAT, SIGNED_FRAME, VERSION_1, HEARTBEAT]
    assert list(split_frames(b"".join(parts))) == parts
    assert sender_of(HEARTBEAT) == 255


def test_rest_behind_a_damaged_frame_is_dropped() -> None:
    assert list(split_frames(HEARTBEAT + b"\x00" + HEARTBEAT)) == [HEARTBEAT]
    assert list(split_frames(HEARTBEAT + HEARTBEAT[:-1])) == [HEARTBEAT]


@given(st.binary(max_size=600))
def test_any_bytes_split_into_parts_of_themselves(data: bytes) -> None:
    assert data.startswith(b"".join(split_frames(data)))


def test_missing_frames_are_counted_for_each_sender() -> None:
    beat, numbers = pack(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)), FrameNumbers()
    sent = [(254, 1, 1), (255, 1, 1), (7, 1, 100), (2, 1, 1), (7, 2, 1), (9, 1, 100), (2, 1, 1)]
    assert [numbers.missing(frame(beat, *one)) for one in sent] == [0, 0, 0, 2, 0, 1, 255]
    assert [numbers.missing(raw) for raw in (VERSION_1, VERSION_1[:2] + b"\4" + VERSION_1[3:])] == [253, 3]

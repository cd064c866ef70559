"""Frames and payloads against bytes worked out by hand from arsdk-ng's encoders (nothing of ours made them)."""

from __future__ import annotations

import pytest

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.link.frame import (
    Frame,
    FrameType,
    Unpacker,
    Waiting,
    decode_frames,
    decode_varint,
    encode_frame,
    encode_varint,
    pack,
    with_length,
)
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.errors import LocalProtocolError

ALL_STATES = wire.encode(common.AllStates())
PCMD = wire.encode(ardrone3.PCMD(1, 0, 50, 0, -20, 0))
HOVERING = wire.encode(ardrone3.FlyingStateChanged(ardrone3.FlyingState.HOVERING))
CLOCK = bytes(range(1, 9))

VECTORS = [
    # AllStates, controller to device: queue 11, the first frame
    (1, "04 0b 00 0b000000  00 04 0000", Frame(FrameType.WITHACK, 11, 0, ALL_STATES)),
    (2, "0c 04 0b 0000 06  0400 00 04 0000", Frame(FrameType.WITHACK, 11, 0, b"\4\0" + ALL_STATES)),
    (3, "0d 04 0b 0000 05  04 00 04 0000", Frame(FrameType.WITHACK, 11, 0, b"\4" + ALL_STATES)),
    # its acknowledgement: queue 11 + 128, the number of the acknowledged frame as payload
    (1, "01 8b 00 08000000  00", Frame(FrameType.ACK, 139, 0, b"\0")),
    (2, "0c 01 8b 0000 02  0000", Frame(FrameType.ACK, 139, 0, b"\0\0")),
    (3, "0d 01 8b 0000 02  0000", Frame(FrameType.ACK, 139, 0, b"\0\0")),
    # PCMD: queue 10
    (1, "02 0a 00 14000000  01 00 0200 01 00 32 00 ec 00000000", Frame(FrameType.NOACK, 10, 0, PCMD)),
    (3, "0d 02 0a 0000 0e  0d 01 00 0200 01 00 32 00 ec 00000000", Frame(FrameType.NOACK, 10, 0, b"\x0d" + PCMD)),
    # FlyingStateChanged(hovering), device to controller: queue 126
    (1, "04 7e 00 0f000000  01 04 0100 02000000", Frame(FrameType.WITHACK, 126, 0, HOVERING)),
    (2, "0c 04 7e 0000 0a  0800 01 04 0100 02000000", Frame(FrameType.WITHACK, 126, 0, b"\x08\0" + HOVERING)),
    (3, "0d 04 7e 0000 09  08 01 04 0100 02000000", Frame(FrameType.WITHACK, 126, 0, b"\x08" + HOVERING)),
    # ping and pong
    (3, "0d 02 00 0000 08  0102030405060708", Frame(FrameType.NOACK, 0, 0, CLOCK)),
    (3, "0d 02 01 3412 08  0102030405060708", Frame(FrameType.NOACK, 1, 0x1234, CLOCK)),
    # 200 payload bytes need a length of two groups: 200 = 0b1_1001000
    (3, "0d 02 7f ffff c801" + "aa" * 200, Frame(FrameType.NOACK, 127, 0xFFFF, b"\xaa" * 200)),
]


@pytest.mark.parametrize(("version", "text", "frame"), VECTORS)
def test_known_bytes(version: int, text: str, frame: Frame) -> None:
    data = bytes.fromhex(text)
    assert encode_frame(version, *frame) == data
    assert decode_frames(version, data) == ([frame], None)


@pytest.mark.parametrize(("version", "text", "frame"), VECTORS)
def test_every_shorter_prefix_is_unreadable(version: int, text: str, frame: Frame) -> None:
    data = bytes.fromhex(text)
    assert decode_frames(version, b"") == ([], None)
    for size in range(1, len(data)):
        assert decode_frames(version, data[:size]) in (([], "header"), ([], "size"))


@pytest.mark.parametrize("version", [1, 2, 3])
def test_frames_in_front_of_an_unreadable_one_are_kept(version: int) -> None:
    row = [frame for vector, _, frame in VECTORS if vector == version]
    data = b"".join(encode_frame(version, *frame) for frame in row)
    assert decode_frames(version, data) == (row, None)
    assert decode_frames(version, data + b"\xff" * 8) == (row, "type" if version == 1 else "version")
    assert decode_frames(version, data + b"\x02") == (row, "header")


@pytest.mark.parametrize(
    ("version", "text", "reason"),
    [
        (1, "02 0a 00 06000000", "size"),  # a frame shorter than its own header
        (1, "02 0a 00 ffffffff 00", "size"),
        (1, "05 0a 00 07000000", "type"),
        (2, "0d 02 0a 0000 00", "version"),  # version 3 on a version 2 link
        (3, "0d 05 0a 0000 00", "type"),
        (3, "0d 02 0a 0000 ffffffffff01", "header"),  # a length of more than 32 bits
        (3, "0d 02 0a 0000 ffffffff0f", "size"),
        (3, "02 0a 00 0b000000 00 04 0000", "version"),  # version 1 on a version 3 link
    ],
)
def test_bad_headers_have_a_reason(version: int, text: str, reason: str) -> None:
    assert decode_frames(version, bytes.fromhex(text)) == ([], reason)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "00"),
        (1, "01"),
        (127, "7f"),
        (128, "8001"),
        (300, "ac02"),  # 300 = 0b10_0101100
        (16384, "808001"),
        (0xFFFFFFFF, "ffffffff0f"),
    ],
)
def test_varint(value: int, text: str) -> None:
    data = bytes.fromhex(text)
    assert encode_varint(value) == data
    assert decode_varint(b"\xff" + data, 1) == (value, 1 + len(data))
    assert decode_varint(data[:-1], 0) is None


@pytest.mark.parametrize(("version", "seq"), [(1, 256), (2, 65536), (3, -1)])
def test_our_own_wrong_numbers_raise(version: int, seq: int) -> None:
    with pytest.raises(LocalProtocolError, match=f"seq {seq}"):
        encode_frame(version, FrameType.NOACK, 10, seq, b"")


def waiting(*sizes: int) -> list[Waiting]:
    return [Waiting(token, bytes([token]) * size) for token, size in enumerate(sizes, 1)]


def test_version_1_carries_one_command_per_frame() -> None:
    queue = waiting(10, 20)
    assert [(piece.source.token, piece.data, piece.last) for piece in pack(1, queue)] == [(1, b"\1" * 10, True)]
    assert len(queue) == 1


@pytest.mark.parametrize(("version", "sizes"), [(2, (698, 698, 698)), (3, (498, 498, 498))])
def test_as_many_commands_are_packed_as_fit(version: int, sizes: tuple[int, ...]) -> None:
    # twice (2 bytes of length + command) is exactly the limit of 1400 or 1000 bytes
    queue = waiting(*sizes)
    assert [piece.source.token for piece in pack(version, queue)] == [1, 2]
    assert [piece.source.token for piece in pack(version, queue)] == [3]
    assert not queue


def test_version_3_splits_a_command_longer_than_a_frame() -> None:
    # 2 bytes of length + 998 + 1000 + 502 = a command of 2500 bytes; the next command follows in the third frame
    queue = waiting(2500, 8)
    frames = []
    while queue:
        frames.append(pack(3, queue))
    assert [[(p.source.token, len(p.data), p.last) for p in frame] for frame in frames] == [
        [(1, 1000, False)],
        [(1, 1000, False)],
        [(1, 502, True), (2, 9, True)],
    ]
    assert frames[0][0].data[:2] == bytes.fromhex("c413")  # 2500 = 0b10011_1000100
    unpacker = Unpacker(3)
    payloads = [b"".join(piece.data for piece in frame) for frame in frames]
    assert unpacker.unpack(126, True, payloads[0]) == ([], True)
    # another queue is not disturbed
    assert unpacker.unpack(125, True, with_length(3, b"quiet")) == ([b"quiet"], True)
    assert unpacker.unpack(126, True, payloads[1]) == ([], True)
    assert unpacker.unpack(126, True, payloads[2]) == ([b"\1" * 2500, b"\2" * 8], True)


def test_command_fitting_the_next_frame_is_not_split() -> None:
    queue = waiting(600, 600)
    assert [(p.source.token, p.last) for p in pack(3, queue)] == [(1, True)]
    assert [(p.source.token, p.last) for p in pack(3, queue)] == [(2, True)]


@pytest.mark.parametrize(
    ("version", "acknowledged", "text"),
    [
        (2, True, "04"),  # half a length
        (2, True, "0500 00 04 0000"),  # version 2 never splits
        (3, False, "05 00 04 0000"),  # nor does the unacknowledged queue
        (3, True, "80"),
        (3, True, "00 00 00"),  # no command is shorter than its header
        (3, True, "80 80 04 00"),  # 65536 bytes announced
    ],
)
def test_unreadable_payloads(version: int, acknowledged: bool, text: str) -> None:
    good = with_length(version, ALL_STATES)
    assert Unpacker(version).unpack(11, acknowledged, good + bytes.fromhex(text)) == ([ALL_STATES], False)

"""RTP and RTCP: bytes by hand, pictures in packets, and packets that are lost, late, double or noise."""

from __future__ import annotations

import random

import pytest

from anafi_mav.arsdk.video import rtcp
from anafi_mav.arsdk.video.rtp import (
    MAX_WAIT,
    Extension,
    Packet,
    ReorderWindow,
    decode_packet,
    encode_packet,
    sequence_distance,
)
from anafi_mav.arsdk.video.rtp_h264 import MAX_PACKET, Picture, PictureReceiver, PictureSender, split_proto, split_units
from anafi_mav.arsdk.video.video_metadata import (
    PROTO_PROFILE,
    V3_PROFILE,
    FlyingState,
    FrameMetadata,
    LinkInfo,
    LinkStatus,
    LinkType,
    Ned,
    StarfishLink,
)
from anafi_mav.arsdk.video.video_metadata_proto import encode_proto
from anafi_mav.errors import LocalProtocolError

METADATA = FrameMetadata(
    ground_distance=1.5, speed=Ned(0.0, 0.0, -1.0), battery_percentage=80, flying_state=FlyingState.HOVERING
)
SPS, PPS = bytes.fromhex("6742c01f"), bytes.fromhex("68ce3c80")


# -------------------------------------------------------------------------------------------------------- packets


def test_a_packet_by_hand() -> None:
    packet = Packet(96, 7, 0x15F90, 1, b"\x65\x01", marker=True, extension=Extension(0x5033, b"\xaa\xbb\xcc\xdd"))
    data = bytes.fromhex("90 e0 0007 00015f90 00000001  5033 0001 aabbccdd  6501")
    assert encode_packet(packet) == data
    assert decode_packet(data) == packet


def test_sources_and_padding_are_not_payload() -> None:
    # 0xa1: padding and one contributing source; the last byte counts the padding.
    data = bytes.fromhex("a1 60 ffff 00000000 00000001  11111111  6501 0002")
    assert decode_packet(data) == Packet(96, 0xFFFF, 0, 1, b"\x65\x01")


@pytest.mark.parametrize(
    "broken",
    [
        "80 60 0007 00015f90 000000",  # cut off
        "40 60 0007 00015f90 00000001",  # version 1
        "81 60 0007 00015f90 00000001",  # a source that is not there
        "90 60 0007 00015f90 00000001 5033",  # half an extension
        "90 60 0007 00015f90 00000001 5033 0002 00000000",  # too short for its length
        "a0 60 0007 00015f90 00000001 65 03",  # more padding than there is
        "a0 60 0007 00015f90 00000001 65 00",  # no padding where it says so
    ],
)
def test_bytes_that_are_no_rtp_packet_are_dropped(broken: str) -> None:
    assert decode_packet(bytes.fromhex(broken)) is None


@pytest.mark.parametrize(
    "wrong",
    [
        Packet(128, 0, 0, 0, b""),
        Packet(96, 1 << 16, 0, 0, b""),
        Packet(96, 0, -1, 0, b""),
        Packet(96, 0, 0, 0, b"", extension=Extension(0x5033, b"123")),
    ],
)
def test_our_own_wrong_packets_raise(wrong: Packet) -> None:
    with pytest.raises(LocalProtocolError):
        encode_packet(wrong)


# ---------------------------------------------------------------------------------------------------------- order


@pytest.mark.parametrize(
    ("one", "other", "distance"),
    [(5, 7, 2), (7, 5, -2), (0xFFFF, 0, 1), (0, 0xFFFF, -1), (0, 0x7FFF, 0x7FFF), (0, 0x8000, -0x8000)],
)
def test_numbers_wrap(one: int, other: int, distance: int) -> None:
    assert sequence_distance(one, other) == distance


def packet(sequence: int, ssrc: int = 1) -> Packet:
    return Packet(96, sequence & 0xFFFF, 0, ssrc, b"")


def order(window: ReorderWindow, packets: list[Packet], now: float = 0.0) -> list[tuple[int, bool]]:
    return [(one.packet.sequence, one.gap) for each in packets for one in window.receive(each, now)]


def test_overtaken_packets_come_in_order() -> None:
    window = ReorderWindow()
    assert order(window, [packet(0xFFFE), packet(1), packet(0), packet(0xFFFF), packet(2)]) == [
        (0xFFFE, False),
        (0xFFFF, False),
        (0, False),
        (1, False),
        (2, False),
    ]
    assert window.counts == {"received": 5}
    assert window.deadline() is None


def test_a_missing_packet_is_waited_for_and_then_a_gap() -> None:
    window = ReorderWindow()
    assert order(window, [packet(1), packet(4)]) == [(1, False)]
    assert window.deadline() == pytest.approx(MAX_WAIT)
    assert window.expire(MAX_WAIT - 0.001) == []
    assert [(one.packet.sequence, one.gap) for one in window.expire(MAX_WAIT)] == [(4, True)]
    assert order(window, [packet(3), packet(5), packet(5)]) == [(5, False)]
    assert window.counts == {"received": 3, "lost": 2, "late": 2}


def test_one_stray_packet_is_dropped_and_two_restart_the_stream() -> None:
    window = ReorderWindow()
    packets = [packet(10), packet(40000), packet(11), packet(500, ssrc=2), packet(501, ssrc=2), packet(502, ssrc=2)]
    assert order(window, packets) == [(10, False), (11, False), (501, True), (502, False)]
    assert window.ssrc == 2
    assert window.counts == {"received": 4, "stray": 2, "restarted": 1}


def test_reorder_window_is_bounded() -> None:
    window = ReorderWindow()
    assert order(window, [packet(0)]) == [(0, False)]
    given = order(window, [packet(number) for number in range(2, 1000)])
    assert given[0] == (2, True)
    assert len(given) == 998


# ------------------------------------------------------------------------------------------------------- pictures


def test_small_units_share_a_packet() -> None:
    units = [SPS, PPS, b"\x25\xcc"]
    # 0x78: the highest importance of the three, type 24; each unit behind its length.
    assert split_units(units) == [bytes.fromhex("78 0004 6742c01f 0004 68ce3c80 0002 25cc")]
    assert split_units([b"\x41\xff"]) == [b"\x41\xff"]


def test_a_large_unit_is_cut() -> None:
    unit = b"\x65" + bytes(2999)
    parts = split_units([unit])
    # 1400 bytes without 12 of header and 2 of fragment; importance 3 (0x60), type 28; first, middle, last of type 5.
    assert [(part[:2].hex(), len(part) - 2) for part in parts] == [("7c85", 1386), ("7c05", 1386), ("7c45", 227)]


def test_an_extension_takes_room() -> None:
    parts = split_units([b"\x65" + bytes(2999)], [304, 304])
    assert [len(part) - 2 for part in parts] == [1082, 1082, 835]


def test_a_picture_by_hand() -> None:
    sender = PictureSender(ssrc=0x01020304, sequence=0xFFFF)
    assert sender.send([b"\x41\x9a"], 1 << 32 | 5) == [bytes.fromhex("80 e0 ffff 00000005 01020304 419a")]
    (datagram,) = sender.send([b"\x41\x9a"], 6, METADATA, V3_PROFILE)
    assert datagram[:16] == bytes.fromhex("90 e0 0000 00000006 01020304 5033 0011")  # 17 words of metadata
    assert (sender.packets, sender.octets) == (2, 4)


def test_parts_of_the_protocol_buffer_by_hand() -> None:
    # last << 9 | this << 2 | padding, offset (vstrm_rtp_h264.h).
    assert split_proto(b"\x01\x02\x03\x04\x05", 1) == [
        Extension(PROTO_PROFILE, bytes.fromhex("0003 0000 0102030405 000000"))
    ]
    first, second = split_proto(bytes(304), 2)
    assert first.body == bytes.fromhex("0200 0000") + bytes(300)
    assert second.body == bytes.fromhex("0204 012c") + bytes(4)
    (whole,) = split_proto(bytes(304), 1)
    assert whole.body == bytes(4) + bytes(304)


LONG = FrameMetadata(
    battery_percentage=80,
    flying_state=FlyingState.FLYING,
    starfish=StarfishLink(links=(LinkInfo(type=LinkType.WLAN, status=LinkStatus.UP),) * 60),
)


def receive(datagrams: list[bytes]) -> tuple[list[Picture], PictureReceiver]:
    receiver = PictureReceiver()
    pictures = [picture for datagram in datagrams for picture in receiver.receive(datagram, 0.0)]
    return pictures, receiver


@pytest.mark.parametrize("profile", [V3_PROFILE, PROTO_PROFILE])
@pytest.mark.parametrize("size", [10, 1387, 1388, 1389, 5000])
def test_pictures_arrive_as_they_were_sent(profile: int, size: int) -> None:
    sender = PictureSender(1)
    key, other = [SPS, PPS, b"\x65" + bytes(range(256)) * (size // 256 + 1)], [b"\x41" + bytes(size)]
    datagrams = sender.send(key, 3000, METADATA, profile) + sender.send(other, 6000)
    assert max(map(len, datagrams)) <= MAX_PACKET

    pictures, receiver = receive(datagrams)

    assert pictures == [Picture(3000, tuple(key), METADATA, True), Picture(6000, tuple(other), None, True)]
    assert [picture.is_key for picture in pictures] == [True, False]
    assert not +receiver.counts


def test_metadata_is_spread_over_a_pictures_packets() -> None:
    assert len(encode_proto(LONG)) > 300
    large = PictureSender(1).send([b"\x41" + bytes(3000)], 0, LONG, PROTO_PROFILE)
    assert [bool(data[0] & 0x10) for data in large] == [True, True, False]
    small = PictureSender(1).send([b"\x41\x9a"], 0, LONG, PROTO_PROFILE)
    assert len(small) == 1
    for datagrams in (large, small):
        ((picture,), _) = receive(datagrams)
        assert picture.metadata == LONG
    # The second part is lost: half of the metadata is none of it.
    pictures, _ = receive(large[:1] + large[2:])
    assert pictures == []


def test_a_lost_packet_leaves_an_incomplete_picture() -> None:
    sender, receiver = PictureSender(1), PictureReceiver()
    first = sender.send([b"\x41" + bytes(3000)], 3000, METADATA)
    second = sender.send([b"\x41\x01"], 6000, METADATA)
    for datagram in first[:1] + first[2:] + second:
        assert receiver.receive(datagram, 1.0) == []
    deadline = receiver.deadline()
    assert deadline == pytest.approx(1.0 + MAX_WAIT)
    pictures = receiver.expire(deadline)
    assert pictures == [Picture(3000, (), METADATA, False), Picture(6000, (b"\x41\x01",), METADATA, True)]
    assert receiver.window.counts["lost"] == 1


def test_a_lost_end_is_noticed_by_the_next_picture() -> None:
    sender, receiver = PictureSender(1), PictureReceiver()
    first = sender.send([b"\x41" + bytes(3000)], 3000)
    second = sender.send([b"\x41\x01"], 6000)
    for datagram in first[:-1] + second:
        assert receiver.receive(datagram, 0.0) == []
    done, doubted = receiver.expire(MAX_WAIT)
    assert (done.timestamp, done.complete) == (3000, False)
    assert (doubted.timestamp, doubted.units, doubted.complete) == (6000, (b"\x41\x01",), False)


@pytest.mark.parametrize(
    "payload",
    [b"", b"\x00", b"\x78\x00", b"\x78\x00\x05\x41", b"\x78\x00\x00", b"\x7c\x05\x00", b"\x7c\x85", b"\x7d\x80\x01"],
)
def test_payloads_that_cannot_be_read_are_counted(payload: bytes) -> None:
    pictures, receiver = receive([encode_packet(Packet(96, 0, 0, 1, payload, marker=True))])
    assert [picture.complete for picture in pictures] == [False]
    assert receiver.counts["unit"] == 1


def test_a_picture_without_end_is_bounded() -> None:
    receiver = PictureReceiver()
    receiver.receive(encode_packet(Packet(96, 0, 0, 1, b"\x7c\x85" + bytes(1000))), 0.0)
    for number in range(1, 6000):
        receiver.receive(encode_packet(Packet(96, number, 0, 1, b"\x7c\x05" + bytes(1000))), 0.0)
    assert receiver.counts["oversized"] == 1
    for number in range(6000, 7000):
        receiver.receive(encode_packet(Packet(96, number, 0, 1, b"\x41\x01")), 0.0)
    assert receiver.counts["oversized"] > 1
    (picture,) = receiver.receive(encode_packet(Packet(96, 7000, 0, 1, b"\x41\x01", marker=True)), 0.0)
    assert not picture.complete
    assert sum(map(len, picture.units)) < 2048


def test_noise_never_raises() -> None:
    generator = random.Random(11)
    receiver, sender = PictureReceiver(), PictureSender(9)
    for _ in range(3000):
        (datagram, *_) = sender.send([b"\x41" + bytes(20)], 0, METADATA, PROTO_PROFILE)
        broken = bytearray(datagram)
        for _ in range(generator.randrange(4)):
            broken[generator.randrange(len(broken))] = generator.randrange(256)
        receiver.receive(bytes(broken[: generator.randrange(len(broken) + 1)]), 0.0)
        receiver.receive(generator.randbytes(generator.randrange(60)), 0.0)
    assert receiver.counts["malformed"] > 0


# ----------------------------------------------------------------------------------------------------------- RTCP


def test_a_sender_report_by_hand() -> None:
    report = rtcp.SenderReport(ssrc=1, time=1_500_000, timestamp=135000, packets=3, octets=70)
    data = bytes.fromhex(
        "80 c8 0006 00000001 00000001 80000000 00020f58 00000003 00000046"
        "81 ca 0003 00000001 01 04 616e6166 00 00"  # CNAME "anaf", ended and filled with zeros
    )
    assert rtcp.encode_sender_report(report, "anaf") == data
    assert rtcp.decode_reports(data) == [report]
    assert rtcp.middle_of(1_500_000) == 0x00018000


def test_a_receiver_report_by_hand() -> None:
    block = rtcp.ReportBlock(1, fraction_lost=64, lost=-2, highest_sequence=0x10007, jitter=90, last_report=5, delay=6)
    report = rtcp.ReceiverReport(2, (block,))
    data = bytes.fromhex(
        "81 c9 0007 00000002 00000001 40 fffffe 00010007 0000005a 00000005 00000006"
        "81 ca 0002 00000002 01 01 78 00"
        "81 cb 0001 00000002"
    )
    assert rtcp.encode_receiver_report(report, "x", goodbye=True) == data
    assert rtcp.decode_reports(data) == [report, rtcp.Goodbye(2)]


@pytest.mark.parametrize("time", [0, 1, 999_999, 1_000_000, 1_234_567_890_123])
def test_times_survive(time: int) -> None:
    (report,) = rtcp.decode_reports(rtcp.encode_sender_report(rtcp.SenderReport(1, time, 0, 0, 0), "x"))
    assert isinstance(report, rtcp.SenderReport)
    assert report.time == time


def test_noise_is_no_report() -> None:
    generator = random.Random(3)
    good = rtcp.encode_sender_report(rtcp.SenderReport(1, 5, 0, 0, 0), "x", goodbye=True)
    for _ in range(3000):
        broken = bytearray(good)
        broken[generator.randrange(len(broken))] = generator.randrange(256)
        rtcp.decode_reports(bytes(broken[: generator.randrange(len(broken) + 1)]))
    assert rtcp.decode_reports(good[:27]) == []


def test_our_own_wrong_reports_raise() -> None:
    with pytest.raises(LocalProtocolError):
        rtcp.encode_sender_report(rtcp.SenderReport(-1, 0, 0, 0, 0), "x")
    with pytest.raises(LocalProtocolError):
        rtcp.encode_receiver_report(rtcp.ReceiverReport(1), "")
    with pytest.raises(LocalProtocolError):
        rtcp.encode_receiver_report(rtcp.ReceiverReport(1, (rtcp.ReportBlock(1, 0, 0, 0, 0),) * 32), "x")

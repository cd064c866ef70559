"""RTSP and SDP: lines by hand, streams cut anywhere, and what is refused."""

from __future__ import annotations

import random
import time

import pytest

from anafi_mav.arsdk.video import rtsp, sdp
from anafi_mav.arsdk.video.rtsp import (
    InterleavedData,
    MalformedRtsp,
    MessageReader,
    Response,
    RtpInfo,
    RtspRequest,
    RtspTransport,
    Status,
    encode,
    encode_interleaved,
    format_range,
    format_rtp_info,
    format_session,
    format_transport,
    join_url,
    parse_range,
    parse_rtp_info,
    parse_session,
    parse_transport,
    split_url,
)
from anafi_mav.arsdk.video.sdp import MediaDescription, SessionDescription, format_description, parse_description
from anafi_mav.errors import LocalProtocolError

DESCRIBE = RtspRequest("DESCRIBE", "rtsp://192.168.42.1/live", (("CSeq", "2"), ("Accept", "application/sdp")))
DESCRIBE_BYTES = b"DESCRIBE rtsp://192.168.42.1/live RTSP/1.0\r\nCSeq: 2\r\nAccept: application/sdp\r\n\r\n"
ANSWER = Response(200, (("CSeq", "2"), ("Content-Type", "application/sdp")), b"v=0\r\n", "OK")
ANSWER_BYTES = b"RTSP/1.0 200 OK\r\nCSeq: 2\r\nContent-Type: application/sdp\r\nContent-Length: 5\r\n\r\nv=0\r\n"


def test_messages_by_hand() -> None:
    assert encode(DESCRIBE) == DESCRIBE_BYTES
    assert encode(ANSWER) == ANSWER_BYTES
    assert MessageReader().feed(DESCRIBE_BYTES) == [DESCRIBE]
    (answer,) = MessageReader().feed(ANSWER_BYTES)
    assert isinstance(answer, Response)
    assert (answer.status, answer.cseq, answer.header("content-type"), answer.body) == (
        200, 2, "application/sdp", b"v=0\r\n",
    )  # fmt: skip


def test_a_stream_may_be_cut_anywhere() -> None:
    stream = DESCRIBE_BYTES + ANSWER_BYTES + b"\r\n" + DESCRIBE_BYTES.replace(b"\r\n", b"\n")
    whole = MessageReader().feed(stream)
    assert len(whole) == 3
    generator = random.Random(1)
    for _ in range(50):
        reader, position, events = MessageReader(), 0, []
        while position < len(stream):
            size = generator.randrange(1, 40)
            events += reader.feed(stream[position : position + size])
            position += size
        assert events == whole
    assert whole[2] == DESCRIBE


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"\x16\x03\x01\x00", Status.BAD_REQUEST),
        (b"$\x00\x00\x10", Status.BAD_REQUEST),
        (b"HELLO\r\n\r\n", Status.BAD_REQUEST),
        (b"GET / HTTP/1.1\r\n\r\n", Status.VERSION_NOT_SUPPORTED),
        (b"PLAY rtsp://a/b RTSP/2.0\r\n\r\n", Status.VERSION_NOT_SUPPORTED),
        (b"PLAY rtsp://a/b RTSP/1.0\r\nnonsense\r\n\r\n", Status.BAD_REQUEST),
        (b"PLAY rtsp://a/\xff RTSP/1.0\r\n\r\n", Status.BAD_REQUEST),
        (b"PLAY rtsp://a/\xc3\xa9 RTSP/1.0\r\n\r\n", Status.BAD_REQUEST),
        (b"PLAY rtsp://a/\rb RTSP/1.0\r\n\r\n", Status.BAD_REQUEST),
        (b"PLAY rtsp://a/b RTSP/1.0\r\nA: b\rc\r\n\r\n", Status.BAD_REQUEST),
        (b"PLAY  RTSP/1.0\r\n\r\n", Status.BAD_REQUEST),
        (b"PLAY rtsp://a/b RTSP/1.0\r\nContent-Length: -1\r\n\r\n", Status.BAD_REQUEST),
        (b"PLAY rtsp://a/b RTSP/1.0\r\nContent-Length: 65536\r\n\r\n", Status.ENTITY_TOO_LARGE),
        (b"PLAY rtsp://a/b RTSP/1.0\r\n" + b"A: b\r\n" * 65 + b"\r\n", Status.ENTITY_TOO_LARGE),
        (b"PLAY rtsp://" + b"a" * 9000, Status.ENTITY_TOO_LARGE),
        (b"RTSP/1.0 abc OK\r\n\r\n", Status.BAD_REQUEST),
        (b"RTSP/1.0 20 OK\r\n\r\n", Status.BAD_REQUEST),
    ],
)
def test_bytes_that_are_no_rtsp_are_answered_and_end_reading(data: bytes, status: Status) -> None:
    reader = MessageReader()
    (event,) = reader.feed(data)
    assert isinstance(event, MalformedRtsp)
    assert event.status == status
    assert reader.feed(DESCRIBE_BYTES) == []


def test_interleaved_packets_are_read_between_messages() -> None:
    stream = b"$\x00\x00\x03abc" + DESCRIBE_BYTES + b"$\x01\x00\x00" + b"$\xff\x00\x01$" + DESCRIBE_BYTES
    expected = [InterleavedData(0, b"abc"), DESCRIBE, InterleavedData(1, b""), InterleavedData(255, b"$"), DESCRIBE]
    assert MessageReader(interleaved=True).feed(stream) == expected
    reader = MessageReader(interleaved=True)
    assert [event for byte in stream for event in reader.feed(bytes((byte,)))] == expected
    assert encode_interleaved(1, b"abc") == b"$\x01\x00\x03abc"
    for channel, size in ((256, 1), (-1, 1), (0, 65536)):
        with pytest.raises(LocalProtocolError):
            encode_interleaved(channel, bytes(size))


def test_interleaved_transport_by_hand() -> None:
    line = "RTP/AVP/TCP;unicast;interleaved=2-3"
    assert format_transport(RtspTransport(lower="TCP", channels=(2, 3))) == line
    assert parse_transport(line) == [RtspTransport(lower="TCP", channels=(2, 3))]
    assert parse_transport("RTP/AVP/TCP;interleaved=0")[0].channels == (0, 1)
    for text in ("256-257", "255", "x", ""):
        assert parse_transport(f"RTP/AVP/TCP;interleaved={text}")[0].channels is None


def test_response_carries_the_reason_it_is_given() -> None:
    answer = Response(Status.SERVICE_UNAVAILABLE, (("CSeq", "2"),), reason="alpha shows its thermal stream")
    assert encode(answer).startswith(b"RTSP/1.0 503 alpha shows its thermal stream\r\n")
    assert encode(Response(Status.SERVICE_UNAVAILABLE)).startswith(b"RTSP/1.0 503 Service Unavailable\r\n")
    with pytest.raises(LocalProtocolError):
        encode(Response(Status.SERVICE_UNAVAILABLE, reason="a\r\nb"))


def test_noise_never_raises() -> None:
    generator = random.Random(2)
    for _ in range(3000):
        broken = bytearray(DESCRIBE_BYTES + ANSWER_BYTES)
        for _ in range(generator.randrange(1, 5)):
            broken[generator.randrange(len(broken))] = generator.randrange(256)
        MessageReader().feed(bytes(broken))
        MessageReader().feed(generator.randbytes(60))
        MessageReader(interleaved=True).feed(b"$" + generator.randbytes(60))


def test_a_line_end_in_our_own_lines_raises() -> None:
    with pytest.raises(LocalProtocolError):
        encode(RtspRequest("PLAY", "rtsp://a/b\r\nX: y"))
    with pytest.raises(LocalProtocolError):
        format_description(SessionDescription(name="a\nb"))


def test_transport_by_hand() -> None:
    text = "RTP/AVP;unicast;client_port=55004-55005"
    assert parse_transport(text) == [RtspTransport(client_ports=(55004, 55005))]
    answer = RtspTransport(client_ports=(55004, 55005), server_ports=(5004, 5005), ssrc=0x0A)
    line = "RTP/AVP/UDP;unicast;client_port=55004-55005;server_port=5004-5005;ssrc=0000000A"
    assert format_transport(answer) == line
    assert parse_transport(line) == [answer]
    offers = parse_transport("RTP/AVP/MUX;unicast;mode=PLAY, RTP/SAVP;unicast, RTP/AVP/TCP;interleaved=0-1")
    assert [(offer.lower, offer.unicast, offer.channels, offer.others) for offer in offers] == [
        ("MUX", True, None, (("mode", "PLAY"),)),
        ("TCP", False, (0, 1), ()),
    ]


@pytest.mark.parametrize("ports", ["0-1", "65536-65537", "abc", "-5", ""])
def test_ports_that_are_none(ports: str) -> None:
    assert parse_transport(f"RTP/AVP;unicast;client_port={ports}") == [RtspTransport()]


def test_session_range_and_rtp_info_by_hand() -> None:
    assert parse_session("abc;timeout=60") == ("abc", 60)
    assert parse_session("abc") == ("abc", None)
    assert format_session("abc", 60) == "abc;timeout=60"
    assert format_range(None) == "npt=now-"
    assert format_range(0.0, 12.5) == "npt=0.000-12.500"
    assert parse_range("npt=now-") == (None, None)
    assert parse_range("npt=0.000-12.500") == (0.0, 12.5)
    assert parse_range("npt=0:01:02.5-") == (62.5, None)
    assert parse_range("smpte=0:00:00-") is None
    assert parse_range("npt=1.2.3-") is None
    infos = [RtpInfo("rtsp://a/live/1", 7, 4294967295), RtpInfo("rtsp://a/live/2")]
    line = "url=rtsp://a/live/1;seq=7;rtptime=4294967295,url=rtsp://a/live/2"
    assert format_rtp_info(infos) == line
    assert parse_rtp_info(line) == infos
    assert parse_rtp_info("seq=1;;,=") == []


def test_urls() -> None:
    assert split_url("rtsp://192.168.42.1/live") == ("192.168.42.1", 554, "live")
    assert split_url("rtsp://user:word@127.0.0.1:8554/replay/1.MP4") == ("127.0.0.1", 8554, "replay/1.MP4")
    assert split_url("rtsp://192.168.42.1") == ("192.168.42.1", 554, "")
    assert split_url("http://192.168.42.1/live") is None
    assert split_url("rtsp://a:70000/live") is None
    assert join_url("rtsp://a/live", "stream=0") == "rtsp://a/live/stream=0"
    assert join_url("rtsp://a/live/", "stream=0") == "rtsp://a/live/stream=0"
    assert join_url("rtsp://a/live", "rtsp://b/other") == "rtsp://b/other"
    assert join_url("rtsp://a/live", "*") == "rtsp://a/live"


LIVE = SessionDescription(
    name="live",
    info="ANAFI-A000001",
    tool="anafi 1.8.2",
    address="192.168.42.1",
    session_id=5,
    control="rtsp://192.168.42.1/live",
    attributes=((sdp.MODEL_ID, "091a"), (sdp.SERIAL, "PI040416AA")),
    media=(
        MediaDescription(
            title="Front camera",
            control="front",
            sps=bytes.fromhex("6742c01fda"),
            pps=bytes.fromhex("68ce3c80"),
            attributes=((sdp.DEFAULT_MEDIA, "1"), (sdp.CAMERA_TYPE, "front")),
        ),
        MediaDescription(title="Disparity map", control="disparity"),
    ),
)
LIVE_LINES = """v=0
o=- 5 1 IN IP4 192.168.42.1
s=live
i=ANAFI-A000001
c=IN IP4 192.168.42.1
t=0 0
a=tool:anafi 1.8.2
a=control:rtsp://192.168.42.1/live
a=X-com-parrot-model-id:091a
a=X-com-parrot-serial:PI040416AA
m=video 0 RTP/AVP 96
i=Front camera
a=control:front
a=rtpmap:96 H264/90000
a=fmtp:96 packetization-mode=1;profile-level-id=42c01f;sprop-parameter-sets=Z0LAH9o=,aM48gA==
a=X-com-parrot-default-media:1
a=X-com-parrot-camera-type:front
m=video 0 RTP/AVP 96
i=Disparity map
a=control:disparity
a=rtpmap:96 H264/90000
"""


def test_longest_line_of_a_description_is_read_at_once() -> None:
    line = (b"a=fmtp:96 " + b"sprop-parameter-sets=" * rtsp.MAX_BODY)[: rtsp.MAX_BODY - 40]
    began = time.process_time()
    described = parse_description(b"v=0\r\nm=video 0 RTP/AVP 96\r\n" + line)
    assert time.process_time() - began < 1.0
    assert described is not None
    assert described.media[0].sps == b""


def test_a_description_by_hand() -> None:
    data = LIVE_LINES.replace("\n", "\r\n").encode()
    assert format_description(LIVE) == data
    assert parse_description(data) == LIVE
    assert LIVE.attribute(sdp.MODEL_ID) == "091a"
    assert LIVE.media[0].attribute(sdp.CAMERA_TYPE) == "front"
    assert LIVE.media[1].attribute(sdp.CAMERA_TYPE) is None


def test_a_recording_has_a_length() -> None:
    data = format_description(SessionDescription(duration=12.5))
    assert b"a=range:npt=0-12.500\r\n" in data
    described = parse_description(data)
    assert described is not None
    assert described.duration == 12.5


def test_streams_that_are_no_video_are_left_out() -> None:
    described = parse_description(
        b"v=0\ns=x\nm=audio 0 RTP/AVP 97\ni=Sound\na=control:a\nm=video 0 RTP/AVP 96\ni=Eye\n"
    )
    assert described is not None
    assert [(media.title, media.control, media.encoding) for media in described.media] == [("Eye", "", "")]


@pytest.mark.parametrize("data", [b"", b"v=1\n", b"HTTP/1.1 200 OK", b"v=0\n" + b"m=video 0 RTP/AVP 96\n" * 17])
def test_invalid_sdp_is_none(data: bytes) -> None:
    assert parse_description(data) is None


def test_broken_descriptions_never_raise() -> None:
    generator = random.Random(4)
    data = format_description(LIVE)
    for _ in range(3000):
        broken = bytearray(data)
        for _ in range(generator.randrange(1, 8)):
            broken[generator.randrange(len(broken))] = generator.randrange(256)
        parse_description(bytes(broken))
    assert len(data) < rtsp.MAX_BODY

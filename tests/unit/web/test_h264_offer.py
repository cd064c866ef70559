"""Offers of browsers, reduced to the codec of the drone's pictures."""

from __future__ import annotations

import random

import pytest

from anafi_mav.web.h264_offer import OfferError, finish_answer, reduce_offer

# The codecs of Chromium 156, shortened.
OFFER = "\r\n".join(
    (
        "v=0",
        "o=- 5 2 IN IP4 127.0.0.1",
        "s=-",
        "t=0 0",
        "a=group:BUNDLE 0",
        "m=video 9 UDP/TLS/RTP/SAVPF 96 97 102 103 104 105 106 107 39 40 108 109",
        "c=IN IP4 0.0.0.0",
        "a=candidate:1 1 udp 2113937151 b4a55292-9dc0.local 52428 typ host",
        "a=end-of-candidates",
        "a=ice-ufrag:abcd",
        "a=ice-pwd:0123456789abcdef01234567",
        f"a=fingerprint:sha-256 {':'.join(['5A'] * 32)}",
        "a=mid:0",
        "a=recvonly",
        "a=rtcp-mux",
        "a=rtpmap:96 VP8/90000",
        "a=rtcp-fb:96 nack",
        "a=rtpmap:97 rtx/90000",
        "a=fmtp:97 apt=96",
        "a=rtpmap:102 H264/90000",
        "a=rtcp-fb:102 nack",
        "a=fmtp:102 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42001f",
        "a=rtpmap:103 rtx/90000",
        "a=fmtp:103 apt=102",
        "a=rtpmap:104 H264/90000",
        "a=fmtp:104 level-asymmetry-allowed=1;packetization-mode=0;profile-level-id=42e01f",
        "a=rtpmap:106 H264/90000",
        "a=rtcp-fb:106 nack pli",
        "a=fmtp:106 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f",
        "a=rtpmap:107 rtx/90000",
        "a=fmtp:107 apt=106",
        "a=rtpmap:39 H264/90000",
        "a=fmtp:39 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=4d001f",
        "a=rtpmap:108 H264/90000",
        "a=fmtp:108 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=f4001f",
        "",
    )
)


def sps(profile: str) -> bytes:
    return b"\x67" + bytes.fromhex(profile) + b"\x95"


@pytest.mark.parametrize(
    ("stream", "payload_types", "answered"),
    [
        ("42c01f", "106 107", "42c01f"),  # constrained baseline, as the simulator
        ("42001e", "102 103", "42001e"),
        ("4d4028", "39", "4d4028"),
        ("640028", "108", "f4001f"),  # high: only the decoder of High 4:4:4 shows it
        ("", "106 107", "42e01f"),
    ],
)
def test_offer_keeps_the_codec_that_shows_the_stream(stream: str, payload_types: str, answered: str) -> None:
    reduced = reduce_offer(OFFER, sps(stream) if stream else b"")
    first = payload_types.split()[0]
    assert f"m=video 9 UDP/TLS/RTP/SAVPF {payload_types}\r\n" in reduced.sdp
    assert f"a=fmtp:{first} level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f\r\n" in reduced.sdp
    kept = {line.split(":")[1].split()[0] for line in reduced.sdp.splitlines() if line.startswith("a=rtpmap")}
    assert kept == set(payload_types.split())
    assert reduced.profile == answered
    assert f"profile-level-id={answered}" in finish_answer(reduced.sdp, reduced.profile)


def test_addresses_of_the_browser_are_removed() -> None:
    reduced = reduce_offer(OFFER, b"")
    assert "candidate" not in reduced.sdp
    assert ".local" not in reduced.sdp
    assert "a=ice-pwd:0123456789abcdef01234567\r\n" in reduced.sdp


@pytest.mark.parametrize(
    "wrong",
    [
        "",
        OFFER + "m=audio 9 UDP/TLS/RTP/SAVPF 111\r\n",
        OFFER.replace("UDP/TLS/RTP/SAVPF", "RTP/AVP"),
        OFFER.replace("a=recvonly", "a=sendonly"),
        OFFER.replace("a=fingerprint:", "a=x:"),
        OFFER.replace("H264", "H265"),
        OFFER.replace("packetization-mode=1", "packetization-mode=0"),
        OFFER + "a=x\r\n" * 3000,
    ],
)
def test_offer_that_shows_no_h264_is_refused(wrong: str) -> None:
    with pytest.raises(OfferError):
        reduce_offer(wrong, b"")


def test_damaged_offer_is_refused_or_reduced() -> None:
    chance = random.Random(1)
    for _ in range(2000):
        text = list(OFFER)
        for _ in range(chance.randrange(1, 30)):
            text[chance.randrange(len(text))] = chance.choice(":=; \r\na0m/")
        try:
            reduce_offer("".join(text), sps("42c01f"))
        except OfferError:
            continue

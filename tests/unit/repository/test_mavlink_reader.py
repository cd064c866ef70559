"""The reader of the test clients: what pymavlink's own parser reads of the same bytes, however they are cut."""

from __future__ import annotations

import itertools
import random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mavlink_reader import Frame, Reader, Received

from anafi_mav.mavlink import dialect as newer

ATTITUDE = dialect.MAVLink_attitude_message(1000, 0.1, -0.2, 0.3, 0.0, 0.0, 0.0)
BEAT = dialect.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3)
TEXT = dialect.MAVLink_statustext_message(6, b"landing")
OURS = newer.MAVLink_anafi_link_message(5, 6, -40, 4, 1)
"""Of a message that the stock dialect does not have."""

KEY = bytes(range(32))


def frame(message: Any, seq: int = 0, *, component: int = 1, v1: bool = False, key: bytes | None = None) -> bytes:
    sender = (newer if message is OURS else dialect).MAVLink(None, 1, component)
    sender.seq = seq
    if key is not None:
        sender.signing.secret_key, sender.signing.sign_outgoing, sender.signing.timestamp = key, True, 10**12
    data: bytes = message.pack(sender, force_mavlink1=v1)
    return data


def wrong(data: bytes) -> bytes:
    """The frame with a checksum that is off by one bit."""
    return data[:-1] + bytes((data[-1] ^ 1,))


def by_pymavlink(data: bytes) -> tuple[list[dict[str, Any]], list[bytes], int]:
    """Messages with their bytes, and pieces that were none: of the stock parser, and of ours for what it lacks."""
    parser, ours = dialect.MAVLink(None), newer.MAVLink(None)
    parser.robust_parsing = True
    messages, bad = [], 0
    for message in parser.parse_buffer(data) or ():
        if message.get_type() == "BAD_DATA":
            bad += 1
        else:
            known = not message.get_type().startswith("UNKNOWN_")
            messages.append(message if known else ours.parse_buffer(message.get_msgbuf())[0])
    return [m.to_dict() for m in messages], [bytes(m.get_msgbuf()) for m in messages], bad


def read(*pieces: bytes) -> tuple[Received, Reader]:
    reader, received = Reader(255, 190), Received()
    for at, piece in enumerate(pieces):
        reader.read(piece, float(at), received)
    return received, reader


STREAMS = {
    "frames": frame(BEAT) + frame(ATTITUDE, 1) + frame(TEXT, 2),
    "unknown to the stock dialect": frame(BEAT) + frame(OURS, 1) + frame(BEAT, 2),
    "MAVLink 1": frame(ATTITUDE) + frame(BEAT, 1, v1=True) + frame(ATTITUDE, 2),
    "noise": frame(BEAT) + b"\x00\x01\x02" + frame(ATTITUDE, 1) + b"\x07",
    "wrong checksum": frame(BEAT) + wrong(frame(ATTITUDE, 1)) + frame(TEXT, 2),
    "signed": frame(BEAT) + frame(ATTITUDE, 1, key=KEY) + frame(TEXT, 2),
    "unknown flag": frame(BEAT) + b"\xfd\x09\x02" + frame(BEAT, 1)[3:] + frame(TEXT, 2),
    "half a frame": frame(BEAT) + frame(TEXT, 1)[:-3],
}


@pytest.mark.parametrize("data", STREAMS.values(), ids=STREAMS)
def test_whole_and_in_pieces_as_pymavlink_reads_it(data: bytes) -> None:
    expected = by_pymavlink(data)
    rng = random.Random(1)
    cuts = [
        [],
        *([one] for one in range(1, len(data))),
        sorted(rng.sample(range(1, len(data)), 9)),
        range(1, len(data)),
    ]
    for cut in cuts:
        edges = [0, *cut, len(data)]
        pieces = [data[begin:end] for begin, end in itertools.pairwise(edges)]
        received, reader = read(*pieces)
        messages = [message for _, message in received]
        found = [m.to_dict() for m in messages], [bytes(m.get_msgbuf()) for m in messages]
        assert found == expected[:2], cut
        assert received.kinds == [message.get_type() for message in messages], cut
        if not cut:  # how much noise makes one piece depends on how it comes, in pymavlink too
            assert reader.bad == expected[2]


def test_only_what_is_taken_is_decoded() -> None:
    received, _ = read(STREAMS["frames"])
    assert received.kinds == ["HEARTBEAT", "ATTITUDE", "STATUSTEXT"]
    assert [type(message) for _, message in received._elements] == [Frame] * 3
    at, text = received[2]
    assert (at, text.text) == (0.0, "landing")
    assert received[-1][1] is text, "one object, however often it is taken"
    assert [type(message) for _, message in received._elements] == [Frame, Frame, type(text)]


def test_heartbeat_of_a_camera_is_another_kind() -> None:
    for data in (frame(BEAT, component=100), frame(BEAT, component=100, v1=True)):
        received, _ = read(data)
        assert received.kinds == ["CAMERA_HEARTBEAT"]


def test_with_a_key_unsigned_and_wrongly_signed_frames_are_bad() -> None:
    reader, received = Reader(255, 190), Received()
    reader.parser.signing.secret_key = KEY
    reader.parser.signing.timestamp = 10**12 - 1
    reader.read(frame(BEAT) + frame(TEXT, 1, key=KEY) + frame(ATTITUDE, 2, key=bytes(32)), 0.0, received)
    assert received.kinds == ["STATUSTEXT"]
    assert received[0][1].get_signed()
    assert reader.bad == 2


def test_elements_and_kinds_stay_side_by_side() -> None:
    received, _ = read(STREAMS["frames"])
    assert received != []
    received[1:] = [one for one in received[1:] if one[1].get_type() != "ATTITUDE"]
    assert received.kinds == ["HEARTBEAT", "STATUSTEXT"]
    assert received.pop(0)[1].get_type() == "HEARTBEAT"
    assert [message.get_type() for _, message in received] == received.kinds == ["STATUSTEXT"]
    received.clear()
    assert received == []
    assert received.kinds == []

"""Frames of values that are read as a whole give the messages that reading each command gives."""

from __future__ import annotations

import random

import pytest
from support.values import arrived

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Message, Values, receive, unpacked
from anafi_mav.arsdk.link.frame import VERSIONS, FrameType, Unpacker, decode_frames, encode_frame, with_length
from anafi_mav.arsdk.link.known_frames import MAX_OF_SIZE, KnownFrames
from anafi_mav.arsdk.messages import ardrone3, camera, common, gimbal

FRAMES = (gimbal.FrameOfReference.RELATIVE,) * 3


def telemetry(value: float, *, camera_id: int = 0, gimbal_id: int = 0) -> list[Message]:
    return [
        ardrone3.AttitudeChanged(value, 0.0, 0.0),
        ardrone3.SpeedChanged(1.0, 2.0, 3.0),
        gimbal.Attitude(gimbal_id, *FRAMES, 0.0, value, 0.0, 0.0, 0.0, 0.0),
        camera.ZoomLevel(camera_id, 2.0),
    ]


def encode(version: int, messages: list[Message], *, seq: int = 200) -> bytes:
    """Return a datagram of one frame."""
    commands = messages[:1] if version == 1 else messages
    payload = b"".join(with_length(version, wire.encode(message)) for message in commands)
    return encode_frame(version, FrameType.NOACK, 127, seq, payload)


def read(version: int, known: KnownFrames, data: bytes) -> Values | None:
    """Read a datagram as a transport does."""
    found = known.read(data)
    if found is None:
        ((frame,), garbage) = decode_frames(version, data)
        commands, readable = Unpacker(version).unpack(127, False, frame.payload)
        if readable and garbage is None:
            known.learn(data, frame, commands, receive(commands))
        return None
    return found[2]


@pytest.mark.parametrize("version", VERSIONS)
def test_frame_of_the_same_events_is_read_as_a_whole(version: int) -> None:
    known = KnownFrames(version)
    assert read(version, known, encode(version, telemetry(1.0))) is None
    values = read(version, known, encode(version, telemetry(2.0)))
    assert values is not None
    assert list(values.messages()) == telemetry(2.0)[: 1 if version == 1 else 4]
    assert values.message(ardrone3.AttitudeChanged) == ardrone3.AttitudeChanged(2.0, 0.0, 0.0)
    assert [list(one.messages()) for one in values.split()] == [[message] for message in values.messages()]


@pytest.mark.parametrize("version", VERSIONS)
def test_frame_read_as_a_whole_has_the_messages_of_its_commands(version: int) -> None:
    rng = random.Random(version)
    known = KnownFrames(version)
    read(version, known, encode(version, telemetry(1.0)))
    whole = 0
    for number in range(20_000):
        data = bytearray(encode(version, telemetry(rng.random()), seq=number & 0xFF))
        for _ in range(rng.randrange(3)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        found = known.read(bytes(data))
        if found is not None:
            whole += 1
            ((frame,), garbage) = decode_frames(version, bytes(data))
            assert garbage is None
            commands, readable = Unpacker(version).unpack(127, False, frame.payload)
            assert readable
            assert found[:2] == (frame.id, frame.seq)
            assert repr(list(found[2].messages())) == repr(list(unpacked(receive(commands))))
    assert 0 < whole < 20_000


@pytest.mark.parametrize("other", [telemetry(1.0, camera_id=1), telemetry(1.0, gimbal_id=1)], ids=["camera", "gimbal"])
def test_values_of_another_camera_or_gimbal_have_another_layout(other: list[Message]) -> None:
    known = KnownFrames(3)
    first, second = encode(3, telemetry(1.0)), encode(3, other)
    for datagram in (first, second):
        assert read(3, known, datagram) is None
    found = [read(3, known, datagram) for datagram in (first, second)]
    assert [list(values.messages()) for values in found if values is not None] == [telemetry(1.0), other]
    assert found[0] is not None
    assert found[1] is not None
    assert found[0].layout is not found[1].layout


def test_values_do_not_keep_what_the_socket_has_read() -> None:
    known = KnownFrames(3)
    datagram = encode(3, telemetry(1.0))
    read(3, known, datagram)
    values = read(3, known, datagram)
    assert values is not None
    assert len(values.data) < len(datagram)


@pytest.mark.parametrize(
    "messages",
    [
        [ardrone3.AttitudeChanged(1.0, 0.0, 0.0), ardrone3.AttitudeChanged(2.0, 0.0, 0.0)],
        [ardrone3.AttitudeChanged(1.0, 0.0, 0.0), common.BatteryStateChanged(50)],
    ],
    ids=["repeated", "no value"],
)
def test_frame_with_a_repeated_kind_or_another_message_is_not_read_as_a_whole(messages: list[Message]) -> None:
    known = KnownFrames(3)
    datagram = encode(3, messages)
    assert [read(3, known, datagram) for _ in range(3)] == [None] * 3


def test_frames_of_one_size_that_are_remembered_are_limited() -> None:
    known = KnownFrames(3)
    datagrams = [encode(3, telemetry(1.0, camera_id=number)) for number in range(MAX_OF_SIZE + 1)]
    for datagram in datagrams:
        read(3, known, datagram)
    assert [known.read(datagram) is not None for datagram in datagrams] == [True] * MAX_OF_SIZE + [False]


def test_joined_values_are_those_of_each() -> None:
    messages = telemetry(1.0)
    values = arrived(*messages)
    assert list(values.messages()) == messages
    assert values.command(ardrone3.SpeedChanged) == wire.encode(messages[1])
    assert arrived(*telemetry(2.0)).layout is values.layout

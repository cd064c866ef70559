"""The protobuf codec and the envelope, against bytes worked out by hand from Protocol Buffers' encoding guide."""

from __future__ import annotations

import math
import struct
from typing import Annotated, ClassVar

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anafi_mav.arsdk.codec import protobuf, wire
from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import ENUM, RECORD, UINT32, Field, FieldType, Map, Submessage, Wrapped
from anafi_mav.arsdk.messages.proto import camera2, connectivity, device_manager, logsync, network, piloting, pointnfly
from anafi_mav.errors import LocalProtocolError


class Colour(wire.OpenEnum):
    RED = 0
    BLUE = 2


class Leaf(Submessage, frozen=True, kw_only=True):
    number: Annotated[int, Field(1, FieldType.INT32)] = 0


class All(Submessage, frozen=True, kw_only=True):
    int32: Annotated[int, Field(1, FieldType.INT32)] = 0
    int64: Annotated[int, Field(2, FieldType.INT64)] = 0
    uint32: Annotated[int, Field(3, FieldType.UINT32)] = 0
    uint64: Annotated[int, Field(4, FieldType.UINT64)] = 0
    sint32: Annotated[int, Field(5, FieldType.SINT32)] = 0
    sint64: Annotated[int, Field(6, FieldType.SINT64)] = 0
    flag: Annotated[bool, Field(7, FieldType.BOOL)] = False
    colour: Annotated[Colour, Field(8, FieldType.ENUM)] = Colour.RED
    fixed32: Annotated[int, Field(9, FieldType.FIXED32)] = 0
    sfixed32: Annotated[int, Field(10, FieldType.SFIXED32)] = 0
    float32: Annotated[float, Field(11, FieldType.FLOAT)] = 0.0
    fixed64: Annotated[int, Field(12, FieldType.FIXED64)] = 0
    sfixed64: Annotated[int, Field(13, FieldType.SFIXED64)] = 0
    float64: Annotated[float, Field(14, FieldType.DOUBLE)] = 0.0
    text: Annotated[str, Field(15, FieldType.STRING)] = ""
    blob: Annotated[bytes, Field(16, FieldType.BYTES)] = b""
    leaf: Annotated[Leaf | None, Field(17, FieldType.RECORD)] = None
    numbers: Annotated[tuple[int, ...], Field(18, FieldType.SINT32)] = ()
    floats: Annotated[tuple[float, ...], Field(19, FieldType.FLOAT)] = ()
    texts: Annotated[tuple[str, ...], Field(20, FieldType.STRING)] = ()
    leaves: Annotated[tuple[Leaf, ...], Field(21, FieldType.RECORD)] = ()
    named: Annotated[dict[str, int], Map(22, FieldType.STRING, FieldType.FIXED32)] = msgspec.field(default_factory=dict)
    perhaps: Annotated[float | None, Wrapped(23, FieldType.DOUBLE)] = None
    this: Annotated[int | None, Field(24, FieldType.UINT32, "choice")] = None
    that: Annotated[Leaf | None, Field(25, FieldType.RECORD, "choice")] = None


class Chain(Submessage, frozen=True, kw_only=True):
    next: Annotated[Chain | None, Field(1, RECORD)] = None


class Picked(Submessage, frozen=True, kw_only=True):
    SELECTED: ClassVar[int] = 2
    number: Annotated[int | None, Field(1, UINT32)] = None
    colour: Annotated[Colour | None, Field(3, ENUM)] = None
    colours: Annotated[tuple[Colour, ...] | None, Field(4, ENUM)] = None
    leaf: Annotated[Leaf | None, Field(5, RECORD)] = None


VECTORS: list[tuple[str, Submessage]] = [
    ("", All()),
    # the guide's first example: field 1, varint 150
    ("08 9601", All(int32=150)),
    # negative numbers of the plain kinds are ten bytes long
    ("08 ffffffffffffffffff01", All(int32=-1)),
    ("10 80808080808080808001", All(int64=-(1 << 63))),
    ("18 ffffffff0f", All(uint32=(1 << 32) - 1)),
    ("20 ffffffffffffffffff01", All(uint64=(1 << 64) - 1)),
    # zigzag: 0, -1, 1, -2 are 0, 1, 2, 3
    ("28 01", All(sint32=-1)),
    ("28 02", All(sint32=1)),
    ("28 ffffffff0f", All(sint32=-(1 << 31))),
    ("30 feffffffffffffffff01", All(sint64=(1 << 63) - 1)),
    ("38 01", All(flag=True)),
    ("40 02", All(colour=Colour.BLUE)),
    ("40 4d", All(colour=Colour(77))),
    ("4d 01000000", All(fixed32=1)),
    ("55 feffffff", All(sfixed32=-2)),
    ("5d 0000c03f", All(float32=1.5)),
    ("5d 00000080", All(float32=-0.0)),
    ("61 0100000000000000", All(fixed64=1)),
    ("69 feffffffffffffff", All(sfixed64=-2)),
    ("71 000000000000f83f", All(float64=1.5)),
    # the guide's second: text "testing"
    ("7a 07 74657374696e67", All(text="testing")),
    ("8201 02 00ff", All(blob=b"\0\xff")),
    ("8a01 03 08 9601", All(leaf=Leaf(number=150))),
    ("8a01 00", All(leaf=Leaf())),
    ("9201 03 01 00 06", All(numbers=(-1, 0, 3))),
    ("9a01 08 0000803f 000000c0", All(floats=(1.0, -2.0))),
    ("a201 01 61 a201 00", All(texts=("a", ""))),
    ("aa01 00 aa01 02 08 05", All(leaves=(Leaf(), Leaf(number=5)))),
    ("b201 08 0a01 61 15 07000000", All(named={"a": 7})),
    ("ba01 09 09 000000000000f83f", All(perhaps=1.5)),
    ("ba01 00", All(perhaps=0.0)),
    # a member of a oneof shows that it is there even at its default
    ("c001 00", All(this=0)),
    ("ca01 00", All(that=Leaf())),
    ("", Picked()),
    ("12 04 08 01 12 00", Picked(number=0)),
    ("08 05  12 04 08 01 12 00", Picked(number=5)),
    ("12 04 08 03 12 00  12 04 08 04 12 00  22 02 00 02", Picked(colour=Colour.RED, colours=(Colour.RED, Colour.BLUE))),
]


@pytest.mark.parametrize(("text", "record"), VECTORS)
def test_known_bytes(text: str, record: Submessage) -> None:
    data = bytes.fromhex(text)
    assert protobuf.serialize(record) == data
    back = protobuf.parse(type(record), data)
    assert back == record
    assert math.copysign(1, getattr(back, "float32", 0)) == math.copysign(1, getattr(record, "float32", 0))


@pytest.mark.parametrize(
    ("text", "record"),
    [
        # unknown numbers of every encoding are skipped
        ("08 05  c03e 01  c23e 02 0808  c53e 01020304  c13e 0102030405060708", All(int32=5)),
        # known numbers with an encoding that is not theirs too
        ("0d 01000000  5a 04 0000c03f  8801 01", All()),
        # repeated numbers may come unpacked, or both ways
        ("9001 01  9201 02 00 06  9001 02", All(numbers=(-1, 0, 3, 1))),
        # the last of a scalar counts, messages are merged, the last of a oneof counts
        ("08 05 08 06", All(int32=6)),
        ("8a01 02 08 05  8a01 00", All(leaf=Leaf(number=5))),
        ("c001 07  ca01 02 08 05", All(that=Leaf(number=5))),
        ("ca01 02 08 05  c001 07", All(this=7)),
        # numbers too large for their kind are cut
        ("18 ffffffffffffffffff01", All(uint32=(1 << 32) - 1)),
        ("08 ffffffff1f", All(int32=-1)),
        ("38 80808008", All(flag=True)),
        # entries of maps without key or value have defaults, the last of a key counts
        ("b201 00  b201 03 0a01 61  b201 08 0a01 61 15 07000000", All(named={"": 0, "a": 7})),
        # text that is no UTF-8 is replaced
        ("7a 02 ff41", All(text="\ufffdA")),
        # what is not listed does not count, what is listed and not sent is at its default; a message is not there
        ("08 05  18 02", Picked()),
        (
            "12 04 08 01 12 00  12 02 08 03  12 04 08 04 12 00  12 04 08 05 12 00  12 04 08 63 12 00",
            Picked(number=0, colour=Colour.RED, colours=()),
        ),
    ],
)
def test_unknown_fields_and_other_encodings_are_accepted(text: str, record: Submessage) -> None:
    assert protobuf.parse(type(record), bytes.fromhex(text)) == record


@pytest.mark.parametrize(
    "text",
    [
        "08",  # no value
        "08 ff",  # a varint without an end
        "08 ffffffffffffffffffff01",  # one of eleven bytes
        "00 01",  # number 0
        "0b 0c",  # a group
        "0e",  # no such encoding
        "7a 05 61",  # text longer than the message
        "7a ffffffffffffffffff01 61",
        "4d 000000",
        "61 00000000000000",
        "9201 01 ff",  # packed numbers cut off
        "9a01 03 000000",
        "a201 01 61 a0",
        "8a01 01 08",  # inside of a message
        "ba01 01 09",  # of a wrapper
        "b201 02 0a05",  # of a map
        "8080808080808080808001 00",  # a tag of more than 32 bits
    ],
)
def test_invalid_protobuf_bytes_are_refused(text: str) -> None:
    assert protobuf.parse(All, bytes.fromhex(text)) is None


def test_cut_message_is_refused_or_a_shorter_message() -> None:
    data = b"".join(bytes.fromhex(text) for text, record in VECTORS if isinstance(record, All))
    assert protobuf.parse(All, data) is not None
    for size in range(len(data)):
        protobuf.parse(All, data[:size])


def test_nesting_is_bounded() -> None:
    data = b""
    for _ in range(protobuf.MAX_NESTING):
        data = protobuf.chunk(1, data)
    assert protobuf.parse(Chain, data) is not None
    assert protobuf.parse(Chain, protobuf.chunk(1, data)) is None
    for _ in range(20_000):
        data = protobuf.chunk(1, data)
    assert protobuf.parse(Chain, data) is None
    chain = Chain()
    for _ in range(protobuf.MAX_NESTING + 1):
        chain = Chain(next=chain)
    with pytest.raises(LocalProtocolError, match="in one another"):
        protobuf.serialize(chain)


@pytest.mark.parametrize(
    "record",
    [
        All(int32=1 << 31),
        All(uint32=-1),
        All(sint64=1 << 63),
        All(int32=1.5),  # type: ignore[arg-type]
        All(int32="1"),  # type: ignore[arg-type]
        All(int32=None),  # type: ignore[arg-type]
        All(flag=2),  # type: ignore[arg-type]
        All(float32=1e300),
        All(float64="1"),  # type: ignore[arg-type]
        All(text=b"a"),  # type: ignore[arg-type]
        All(text="\ud800"),
        All(blob="a"),  # type: ignore[arg-type]
        All(leaf=All()),  # type: ignore[arg-type]
        All(leaves=(None,)),  # type: ignore[arg-type]
        All(numbers=3),  # type: ignore[arg-type]
        All(named={1: 1}),  # type: ignore[dict-item]
        All(this=1, that=Leaf()),
    ],
)
def test_our_own_wrong_values_raise(record: Submessage) -> None:
    with pytest.raises(LocalProtocolError, match="cannot encode"):
        protobuf.serialize(record)


def test_wrong_declarations_raise() -> None:
    class Bare(Submessage, frozen=True):
        number: int = 0

    class Twice(Submessage, frozen=True):
        one: Annotated[int, Field(1, UINT32)] = 0
        two: Annotated[int, Field(1, UINT32)] = 0

    for wrong in (Bare(), Twice()):
        with pytest.raises(LocalProtocolError):
            protobuf.serialize(wrong)
    with pytest.raises(LocalProtocolError, match=r"arsdk\.camera\.Command has a field 26 already"):

        @camera2.COMMAND.message("Again", 26)
        class Again(ProtobufMessage, frozen=True):
            pass


# ------------------------------------------------------------------------------------------------------- the envelope


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("arsdk.camera.Command", 45798),
        ("arsdk.camera.Event", 45089),
        ("arsdk.network.Event", 17623),
        ("arsdk.storage.Command", 55827),
        ("arsdk.controllernetwork.Command", 23238),
    ],
)
def test_service_ids(name: str, number: int) -> None:
    assert ProtobufEnvelope(name, "").id == number


ENVELOPES = [
    # generic.custom_cmd 133-0-1, service 45798 (b2e6), number 26, payload {26: {1: 2}}
    ("85 00 0100  e6b2 1a00 05000000  d201 02 08 02", camera2.ResetZoom(camera_id=2)),
    # custom_cmd_non_ack 133-0-2: field 1; velocity, -0.5
    (
        "85 00 0200  e6b2 0100 0d000000  0a 0b 10 01 19 000000000000e0bf",
        camera2.SetZoomTarget(control_mode=camera2.ZoomControlMode.VELOCITY, target=-0.5),
    ),
    # custom_evt_non_ack 133-0-4: service 45089 (b021), field 2
    (
        "85 00 0400  21b0 0200 16000000  12 14 11 0000000000000040 1a 09 09 0000000000004e40",
        camera2.ZoomLevel(level=2.0, hfov=60.0),
    ),
    # custom_evt 133-0-3: a map of camera models by id
    (
        "85 00 0300  21b0 1000 0f000000  8201 0c 0a 04 08 00 10 00 0a 04 08 01 10 01",
        camera2.CameraList(
            cameras={0: camera2.CameraModel.MAIN, 1: camera2.CameraModel.THERMAL_BLENDED},
        ),
    ),
    # a configuration: the mode is listed although PHOTO is 0
    (
        "85 00 0100  e6b2 1200 0b000000  9201 08 12 06 0a 04 08 02 12 00",
        camera2.Configure(config=camera2.Config(camera_mode=camera2.CameraMode.PHOTO)),
    ),
    # a message that is empty is still there
    ("85 00 0100  e6b2 1000 03000000  8201 00", camera2.ListCameras()),
    (
        "85 00 0300  d744 1300 07000000  9a01 04 1a 02 08 05",
        network.State(global_link_quality=network.GlobalLinkQuality(quality=5)),
    ),
]


@pytest.mark.parametrize(("text", "message"), ENVELOPES)
def test_known_envelopes(text: str, message: ProtobufMessage) -> None:
    data = bytes.fromhex(text)
    assert wire.encode(message) == data
    assert wire.decode(data) == message
    assert wire.decode(data + b"\1") == message
    for size in range(len(data)):
        assert wire.decode(data[:size]) is None


def test_names_and_queues() -> None:
    assert camera2.Configure.NAME == "camera2.Command.Configure"
    assert camera2.Configure.DIRECTION is wire.Direction.COMMAND
    assert camera2.Configure.BUFFER is wire.Buffer.ACK
    assert camera2.SetZoomTarget.BUFFER is wire.Buffer.NON_ACK
    assert camera2.ZoomLevel.DIRECTION is wire.Direction.EVENT
    assert logsync.SyncRequest.NAME == "logsync.Command.SyncRequest"
    assert piloting.SetTakeoffHoveringAltitude.NUMBER == 19


@pytest.mark.parametrize(
    "text",
    [
        "3412 1a00 05000000  d201 02 08 02",  # a service no one knows
        "e6b2 fff0 05000000  d201 02 08 02",  # a number it does not have
        "e6b2 1a00 00000000",  # no message inside
        "e6b2 1a00 05000000  ca01 02 08 02",  # another one inside
        "e6b2 1a00 02000000  d001",  # not a message
        "e6b2 1a00 04000000  d201 02 08",  # cut off
        "e6b2 1a00 04000000  d201 01 08",  # cut off inside
    ],
)
def test_undecodable_envelope_is_kept_undecoded(text: str) -> None:
    packed = bytes.fromhex(text)
    data = bytes.fromhex("85 00 0100") + packed
    message = wire.decode(data)
    assert message == wire.UnknownMessage(wire.MessageId(133, 0, 1), packed)
    assert wire.encode(message) == data


def test_our_own_wrong_message_raises() -> None:
    with pytest.raises(LocalProtocolError, match="ResetZoom"):
        wire.encode(camera2.ResetZoom(camera_id=-1))


PROTOBUF = [message for message in wire.declared_messages() if issubclass(message, ProtobufMessage)]
WORTH_BREAKING: list[ProtobufMessage] = [
    camera2.State(camera_id=1, config=camera2.Config(image_contrast=0.5), zoom=camera2.StateZoom(zoom_level_max=6.0)),
    connectivity.State(radio_id=1, rssi=-40, access_point=connectivity.AccessPointState()),
    device_manager.State(connected=device_manager.ConnectionStateConnected()),
    pointnfly.Execute(fly=pointnfly.Fly(latitude=1.0, custom_during=0.0)),
    camera2.CameraList(cameras={7: camera2.CameraModel.MAIN}),
]


@given(st.sampled_from(PROTOBUF), st.binary(max_size=200))
def test_random_payloads_never_raise(message: type[ProtobufMessage], data: bytes) -> None:
    payload = protobuf.chunk(message.NUMBER, data)
    packed = struct.pack("<HHI", message.SERVICE.id, message.NUMBER, len(payload)) + payload
    assert wire.decode(struct.pack("<BBH", *message.ID) + packed) is not None


@given(st.sampled_from(WORTH_BREAKING), st.lists(st.tuples(st.integers(12, 300), st.integers(0, 255)), max_size=5))
def test_mutated_payload_decodes_without_error_and_encodes_equal(
    message: ProtobufMessage, changes: list[tuple[int, int]]
) -> None:
    data = bytearray(wire.encode(message))
    for place, value in changes:
        data[12 + (place - 12) % (len(data) - 12)] = value
    heard = wire.decode(bytes(data))
    assert heard is not None
    if isinstance(heard, ProtobufMessage):
        again = wire.decode(wire.encode(heard))
        assert repr(again) == repr(heard)  # not a number is not equal to itself


@given(st.binary(max_size=64))
def test_random_bytes_after_the_header_never_raise(data: bytes) -> None:
    for number in (1, 2, 3, 4):
        wire.decode(struct.pack("<BBH", 133, 0, number) + data)

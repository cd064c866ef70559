"""The metadata of pictures: bytes by hand, what is unknown, and noise."""

from __future__ import annotations

import math
import random
import struct

import msgspec
import pytest

from anafi_mav.arsdk.video.video_metadata import (
    FlyingState,
    FrameMetadata,
    LinkInfo,
    LinkStatus,
    LinkType,
    Location,
    Ned,
    PilotingMode,
    Quaternion,
    StarfishLink,
    Vector3,
    WifiLink,
    decode_v3,
    encode_v3,
)
from anafi_mav.arsdk.video.video_metadata_proto import decode_proto, encode_proto
from anafi_mav.errors import LocalProtocolError

FLOWN = FrameMetadata(
    drone_quat=Quaternion(0.5, -0.5, 0.5, 0.5),
    location=Location(latitude=48.5, longitude=2.25, altitude_amsl=60.25, satellites=14),
    ground_distance=12.5,
    speed=Ned(1.5, -2.25, 0.5),
    battery_percentage=54,
    flying_state=FlyingState.FLYING,
    piloting_mode=PilotingMode.MOVE_TO,
    base_quat=Quaternion(1.0, 0.0, 0.0, 0.0),
    quat=Quaternion(0.0, 0.0, 1.0, 0.0),
    exposure_time=16.5,
    iso_gain=318,
    awb_r_gain=1.5,
    awb_b_gain=2.0 - 2.0**-14,
    hfov=math.radians(69.0),
    vfov=math.radians(42.25),
    wifi=WifiLink(goodput=19330, quality=5, rssi=-15),
)

V3_BYTES = bytes.fromhex(
    "000c8000"  # 12.5 * 2^16
    "0c200000 00900000"  # 48.5 and 2.25 * 2^22
    "003c400e"  # 60.25 * 2^8 = 0x3c40, 14 satellites
    "0180 fdc0 0080 ff00"  # 1.5, -2.25, 0.5 * 2^8; no airspeed
    "2000 e000 2000 2000  4000 0000 0000 0000  0000 0000 4000 0000"  # * 2^14
    "1080 013e 6000 7fff"  # 16.5 * 2^8, 318, 1.5 and 1.99994 * 2^14
    "4500 2a40"  # 69 and 42.25 * 2^8
    "004b8205 f1 36 03 05"  # 19330 kbit/s, 5 of 5; -15 dBm; 54 %; flying; version 3's number of moveTo
)


def same(one: FrameMetadata | None, other: FrameMetadata) -> bool:
    """Equal, but for what degrees and radians make of a number."""
    assert one is not None
    assert one.hfov == pytest.approx(other.hfov, rel=1e-6)
    assert one.vfov == pytest.approx(other.vfov, rel=1e-6)
    return msgspec.structs.replace(one, hfov=None, vfov=None) == msgspec.structs.replace(other, hfov=None, vfov=None)


def test_version_3_by_hand() -> None:
    assert encode_v3(FLOWN) == V3_BYTES
    assert same(decode_v3(V3_BYTES), FLOWN)


def test_version_3_with_its_timestamp_behind_an_unknown_extension() -> None:
    stamped = msgspec.structs.replace(FLOWN, timestamp=0x0102030405)
    extension = bytes.fromhex("4531 0002 00000001 02030405")
    assert encode_v3(stamped) == V3_BYTES + extension
    assert same(decode_v3(V3_BYTES + bytes.fromhex("4599 0001 ffffffff") + extension), stamped)
    assert same(decode_v3(V3_BYTES + extension[:-1]), FLOWN)  # cut off: the rest counts


@pytest.mark.parametrize(
    ("number", "mode"),
    [
        (0, PilotingMode.MANUAL),
        (1, PilotingMode.RETURN_HOME),
        (2, PilotingMode.FLIGHT_PLAN),
        (3, PilotingMode.TRACKING),
        (4, PilotingMode.MAGIC_CARPET),
        (5, PilotingMode.MOVE_TO),
        (6, None),
        (99, None),
    ],
)
def test_the_modes_of_version_3_have_other_numbers(number: int, mode: PilotingMode | None) -> None:
    # libvideo-metadata vmeta_frame.h and vmeta.proto order them differently.
    metadata = decode_v3(V3_BYTES[:-1] + bytes((number,)))
    assert metadata is not None
    assert metadata.piloting_mode == mode
    animated = decode_v3(V3_BYTES[:-1] + bytes((0x80 | number,)))
    assert animated == msgspec.structs.replace(metadata, animation_in_progress=True)


def test_unknown_values_of_version_3_are_none() -> None:
    grounded = FrameMetadata(
        ground_distance=0.0, speed=Ned(0.0, 0.0, 0.0), battery_percentage=0, flying_state=FlyingState.LANDED
    )
    data = encode_v3(grounded)
    assert data[4:12] == bytes.fromhex("7d000000 7d000000")  # 500 deg
    assert decode_v3(data) == grounded


@pytest.mark.parametrize("field", ["ground_distance", "speed", "battery_percentage", "flying_state"])
def test_required_values_of_version_3_are_demanded(field: str) -> None:
    with pytest.raises(LocalProtocolError, match="unknown"):
        encode_v3(msgspec.structs.replace(FLOWN, **{field: None}))


@pytest.mark.parametrize(
    "wrong",
    [
        {"speed": Ned(128.0, 0.0, 0.0)},
        {"exposure_time": 256.0},
        {"drone_quat": Quaternion(math.nan, 0.0, 0.0, 0.0)},
        {"wifi": WifiLink(goodput=1 << 24, quality=0, rssi=0)},
        {"timestamp": -1},
        {"location": Location(latitude=1.0, longitude=1.0)},
    ],
)
def test_our_own_numbers_that_do_not_fit_raise(wrong: dict[str, object]) -> None:
    with pytest.raises(LocalProtocolError):
        encode_v3(msgspec.structs.replace(FLOWN, **wrong))


def test_the_protocol_buffer_by_hand() -> None:
    metadata = FrameMetadata(
        drone_quat=Quaternion(0.5, 0.0, 0.0, 0.0),
        battery_percentage=54,
        flying_state=FlyingState.FLYING,
        timestamp=300,
        wifi=WifiLink(goodput=300, quality=5, rssi=-15),
    )
    data = bytes.fromhex(
        "0a 0b  0a 05 0d 0000003f  28 6c  38 03"  # drone: quaternion w = 0.5; sint 54 is 108; state 3
        "12 03  08 ac02"  # camera: 300 µs
        "1a 09  0a 07 08 ac02 10 05 18 1d"  # a link, wifi: 300, 5, sint -15 is 29
    )
    assert encode_proto(metadata) == data
    assert decode_proto(data) == metadata


def test_the_protocol_buffer_keeps_what_version_3_cannot_say() -> None:
    flown = msgspec.structs.replace(
        FLOWN,
        altitude_ato=12.25,
        position=Ned(1.0, 2.0, -12.25),
        local_position=Vector3(3.0, 4.0, -12.25),
        zoom_level=1.5,
        awb_b_gain=2.25,
        starfish=StarfishLink(
            links=(
                LinkInfo(type=LinkType.WLAN, status=LinkStatus.RUNNING, quality=5, active=True),
                LinkInfo(type=LinkType.CELLULAR, status=LinkStatus.DOWN),
            ),
            quality=5,
        ),
    )
    assert same(decode_proto(encode_proto(flown)), flown)


def test_missing_measures_are_none_and_missing_counts_zero() -> None:
    assert decode_proto(b"") == FrameMetadata()
    # An empty drone, and a camera with a NaN as Parrot's library fills in what version 3 has not (zoom_level 16).
    landed = decode_proto(bytes.fromhex("0a 00  12 06 8501 0000c07f"))
    assert landed == FrameMetadata(battery_percentage=0, flying_state=FlyingState.LANDED)


def test_places_off_the_earth_and_broken_vectors_are_unknown() -> None:
    nowhere = struct.pack("<BdBd", 0x09, 500.0, 0x11, 500.0)
    drone = b"\x12" + bytes((len(nowhere),)) + nowhere + bytes.fromhex("2205 0d 0000c07f")  # speed: NaN
    metadata = decode_proto(b"\x0a" + bytes((len(drone),)) + drone)
    assert metadata is not None
    assert metadata.location is None
    assert metadata.speed is None


def test_measure_that_no_float_of_32_bits_holds_is_unknown() -> None:
    # ground distance and height above take-off: fields 3 and 13 of the drone, doubles; its speed is field 4.
    drone = b"\x19" + struct.pack("<d", 1e300) + b"\x69" + struct.pack("<d", -1e300)
    drone += b"\x22\x05\x0d" + struct.pack("<f", 3.4e38)
    metadata = decode_proto(b"\x0a" + bytes((len(drone),)) + drone)
    assert metadata is not None
    assert (metadata.ground_distance, metadata.altitude_ato, metadata.speed) == (None, None, None)


@pytest.mark.parametrize("fov", [7.0, -1.0, 1e30, math.nan, math.inf])
def test_impossible_field_of_view_is_unknown(fov: float) -> None:
    # hfov and vfov: fields 8 and 9 of the camera, floats.
    camera = b"\x45" + struct.pack("<f", fov) + b"\x4d" + struct.pack("<f", fov)
    metadata = decode_proto(b"\x12" + bytes((len(camera),)) + camera)
    assert metadata is not None
    assert (metadata.hfov, metadata.vfov) == (None, None)


def test_noise_never_raises() -> None:
    generator = random.Random(5)
    pb = encode_proto(FLOWN)
    for _ in range(2000):
        noise = generator.randbytes(generator.randrange(120))
        decode_proto(noise)
        assert (decode_v3(noise) is None) == (len(noise) < 68)
        broken = bytearray(pb)
        broken[generator.randrange(len(broken))] = generator.randrange(256)
        decode_proto(bytes(broken))

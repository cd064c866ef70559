"""Metadata of each picture of a Parrot camera, in its two formats.

`FrameMetadata` is the record; on the wire it is one of (libvideo-metadata vmeta_frame_v3.c, vmeta.proto):

* version 3, "P3": a big-endian structure of fixed-point numbers, in ANAFI 4K, Thermal and USA;
* "Pb": the protocol buffer `TimedMetadata`, in ANAFI Ai and later (`video_metadata_proto`).

Both travel beside the video as bodies of RTP header extensions, whose profile names the format; `rtp_h264` puts them
there. A body of a peer that cannot be read is None, never an error. A value that a format does not have, or that is
marked unknown, is None in the record.

Quaternions turn the frame of the drone or of the picture (x forward, y right, z down) into north, east, down.
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple, TypeVar

import msgspec

from anafi_mav.arsdk.codec.wire import OpenEnum
from anafi_mav.errors import LocalProtocolError

V3_PROFILE = 0x5033
"""Profile of an RTP header extension that holds version 3: "P3"."""
PROTO_PROFILE = 0x5062
"""Profile of one that holds a part of the protocol buffer: "Pb"."""

UNKNOWN_DEGREES = 500.0
"""Latitude and longitude of an unknown place in version 3."""
UNKNOWN_SATELLITES = 255
"""Their number when it is not known (VMETA_LOCATION_INVALID_SV_COUNT)."""


class FlyingState(OpenEnum):
    """Flying state of the drone; the numbers are the same in both formats."""

    LANDED = 0
    TAKINGOFF = 1
    HOVERING = 2
    FLYING = 3
    LANDING = 4
    EMERGENCY = 5
    USER_TAKEOFF = 6
    MOTOR_RAMPING = 7
    EMERGENCY_LANDING = 8


class PilotingMode(OpenEnum):
    """Piloting mode, by the numbers of the protocol buffer.

    Version 3 has others (`_V3_MODES`).
    """

    UNKNOWN = 0
    MANUAL = 1
    RETURN_HOME = 2
    FLIGHT_PLAN = 3
    TRACKING = 4
    MOVE_TO = 5
    MAGIC_CARPET = 6


class LinkType(OpenEnum):
    UNKNOWN = 0
    LO = 1
    LAN = 2
    WLAN = 3
    CELLULAR = 4


class LinkStatus(OpenEnum):
    DOWN = 0
    UP = 1
    RUNNING = 2
    """A session of Parrot's link protocol stands on it."""
    READY = 3
    CONNECTING = 4
    ERROR = 5


class Quaternion(NamedTuple):
    """A rotation from the frame of drone or picture to north, east, down.

    That frame is x forward, y right, z down.
    """

    w: float
    x: float
    y: float
    z: float


class Ned(NamedTuple):
    """A vector, m or m/s as the field states."""

    north: float
    east: float
    down: float


class Vector3(NamedTuple):
    """Metres; x and y point anywhere, z points down."""

    x: float
    y: float
    z: float


class Location(msgspec.Struct, frozen=True, kw_only=True):
    """Place of the drone."""

    latitude: float
    """deg."""
    longitude: float
    """deg."""
    altitude_amsl: float | None = None
    """m above the EGM96 geoid; None: unknown."""
    altitude_wgs84: float | None = None
    """m above the ellipsoid; None: unknown, as always in version 3."""
    horizontal_accuracy: float | None = None
    """m; None: unknown, as always in version 3."""
    vertical_accuracy: float | None = None
    """m; None: unknown, as always in version 3."""
    satellites: int | None = None
    """Number of satellites used; None: unknown."""


class WifiLink(msgspec.Struct, frozen=True, kw_only=True):
    """The Wi-Fi link."""

    goodput: int
    """kbit/s, estimated."""
    quality: int
    """0 (worst) .. 5 (best)."""
    rssi: int
    """dBm."""


class LinkInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One radio of the Ai."""

    type: LinkType
    status: LinkStatus
    quality: int = 0
    """1 (worst) .. 5 (best), 0: not available."""
    active: bool = False


class StarfishLink(msgspec.Struct, frozen=True, kw_only=True):
    """The link of an Ai, which may use Wi-Fi and the mobile network at once."""

    links: tuple[LinkInfo, ...] = ()
    quality: int = 0
    """1 (worst) .. 5 (best), 0: not available."""


class FrameMetadata(msgspec.Struct, frozen=True, kw_only=True):
    """State of drone and camera when a picture was taken. None: unknown."""

    drone_quat: Quaternion | None = None
    location: Location | None = None
    ground_distance: float | None = None
    """m, the drone's best estimation of its height above the ground."""
    altitude_ato: float | None = None
    """m above the take-off point; not in version 3."""
    speed: Ned | None = None
    """m/s."""
    battery_percentage: int | None = None
    flying_state: FlyingState | None = None
    """An enum of the video's own with the numbers of ARSDK's: compare with `==`."""
    piloting_mode: PilotingMode | None = None
    animation_in_progress: bool = False
    position: Ned | None = None
    """m from where the drone first took off; jumps when a better fix arrives. Not in version 3."""
    local_position: Vector3 | None = None
    """m in a frame of the drone's own; never jumps. Not in version 3."""
    timestamp: int | None = None
    """µs on the drone's own clock, when the picture was taken."""
    base_quat: Quaternion | None = None
    """The picture's frame without what the user tilted."""
    quat: Quaternion | None = None
    """The picture's frame."""
    exposure_time: float | None = None
    """ms."""
    iso_gain: int | None = None
    awb_r_gain: float | None = None
    awb_b_gain: float | None = None
    hfov: float | None = None
    """rad, horizontal field of view."""
    vfov: float | None = None
    """rad, vertical field of view."""
    zoom_level: float | None = None
    """Not in version 3."""
    wifi: WifiLink | None = None
    starfish: StarfishLink | None = None
    """Not in version 3."""


# ------------------------------------------------------------------------------------------------------- version 3

_V3 = struct.Struct(">iiii 4h 4h 4h 4h HHHHHH I bBBB")
"""ground distance, latitude, longitude, altitude and satellites, speed and airspeed, three quaternions, exposure,
gain, white balance, fields of view, goodput and quality, RSSI, battery, state, mode."""
_EXTENSION = struct.Struct(">HH")
"""id, length in words of what follows."""
_TIMESTAMP_EXTENSION = 0x4531
_NO_AIRSPEED = -256
"""-1 m/s: airspeed is not measured."""

_V3_MODES = (
    PilotingMode.MANUAL,
    PilotingMode.RETURN_HOME,
    PilotingMode.FLIGHT_PLAN,
    PilotingMode.TRACKING,
    PilotingMode.MAGIC_CARPET,
    PilotingMode.MOVE_TO,
    PilotingMode.UNKNOWN,
)
"""By number in version 3."""

_Known = TypeVar("_Known")


def _known(value: _Known | None, name: str) -> _Known:
    if value is None:
        raise LocalProtocolError(f"version 3 of the metadata cannot say that {name} is unknown")
    return value


def _fixed(value: float | None, shift: int) -> int:
    """A number with `shift` bits behind the point; unknown is 0."""
    return 0 if value is None else round(value * (1 << shift))


def _fixed_quat(quat: Quaternion | None) -> tuple[int, ...]:
    # No rotation has all four zero: that is how an unknown one travels (vmeta_utils.c, vmeta_quat_to_euler).
    return (0, 0, 0, 0) if quat is None else tuple(_fixed(part, 14) for part in quat)


def encode_v3(metadata: FrameMetadata) -> bytes:
    """Encode the body of a header extension of profile `V3_PROFILE`.

    Numbers are rounded to what the format can hold. Raises `LocalProtocolError` when a number does not fit, or ground
    distance, speed, battery or state is None.
    """
    speed = _known(metadata.speed, "the speed")
    place = metadata.location
    if place is None:
        latitude = longitude = altitude = UNKNOWN_DEGREES
        satellites = 0
    else:
        latitude, longitude, altitude = place.latitude, place.longitude, _known(place.altitude_amsl, "the altitude")
        satellites = UNKNOWN_SATELLITES if place.satellites is None else place.satellites
    mode = metadata.piloting_mode or PilotingMode.UNKNOWN
    wifi = metadata.wifi or WifiLink(goodput=0, quality=0, rssi=0)
    try:
        if not (0 <= satellites < 1 << 8 and 0 <= wifi.goodput < 1 << 24 and 0 <= wifi.quality < 1 << 8):
            raise ValueError("satellites, goodput or quality")
        body = _V3.pack(
            _fixed(_known(metadata.ground_distance, "the ground distance"), 16),
            _fixed(latitude, 22),
            _fixed(longitude, 22),
            _fixed(altitude, 8) << 8 | satellites,
            *(_fixed(value, 8) for value in speed),
            _NO_AIRSPEED,
            *_fixed_quat(metadata.drone_quat),
            *_fixed_quat(metadata.base_quat),
            *_fixed_quat(metadata.quat),
            _fixed(metadata.exposure_time, 8),
            metadata.iso_gain or 0,
            _fixed(metadata.awb_r_gain, 14),
            _fixed(metadata.awb_b_gain, 14),
            _fixed(_degrees(metadata.hfov), 8),
            _fixed(_degrees(metadata.vfov), 8),
            wifi.goodput << 8 | wifi.quality,
            wifi.rssi,
            _known(metadata.battery_percentage, "the battery"),
            _known(metadata.flying_state, "the flying state"),
            metadata.animation_in_progress << 7 | _V3_MODES.index(mode),
        )
        if metadata.timestamp is not None:
            body += _EXTENSION.pack(_TIMESTAMP_EXTENSION, 2) + metadata.timestamp.to_bytes(8, "big")
    except (struct.error, ValueError, OverflowError) as error:
        raise LocalProtocolError(f"cannot encode {metadata!r}: {error}") from error
    return body


def decode_v3(body: bytes) -> FrameMetadata | None:
    """Decode the body of a header extension of profile `V3_PROFILE`; None if it is too short.

    Extensions of the structure that we do not know are skipped.
    """
    if len(body) < _V3.size:
        return None
    values = _V3.unpack_from(body)
    distance, latitude, longitude, altitude = values[:4]
    satellites = altitude & 0xFF
    location = Location(
        latitude=latitude / (1 << 22),
        longitude=longitude / (1 << 22),
        altitude_amsl=(altitude >> 8) / 256.0,
        satellites=None if satellites == UNKNOWN_SATELLITES else satellites,
    )
    exposure, gain, red, blue, hfov, vfov, link, rssi, battery, state, mode = values[20:]
    number = mode & 0x7F
    return FrameMetadata(
        drone_quat=_quat(values[8:12]),
        location=location if on_earth(location.latitude, location.longitude) else None,
        ground_distance=distance / (1 << 16),
        speed=Ned(values[4] / 256.0, values[5] / 256.0, values[6] / 256.0),
        battery_percentage=battery,
        flying_state=FlyingState(state),
        piloting_mode=said_mode(_V3_MODES[number] if number < len(_V3_MODES) else PilotingMode.UNKNOWN),
        animation_in_progress=bool(mode & 0x80),
        timestamp=_timestamp(body),
        base_quat=_quat(values[12:16]),
        quat=_quat(values[16:20]),
        exposure_time=exposure / 256.0 or None,
        iso_gain=gain or None,
        awb_r_gain=red / (1 << 14) or None,
        awb_b_gain=blue / (1 << 14) or None,
        hfov=said_fov(math.radians(hfov / 256.0)),
        vfov=said_fov(math.radians(vfov / 256.0)),
        wifi=WifiLink(goodput=link >> 8, quality=link & 0xFF, rssi=rssi) if link or rssi else None,
    )


def _quat(values: tuple[int, ...]) -> Quaternion | None:
    w, x, y, z = (value / (1 << 14) for value in values)
    return Quaternion(w, x, y, z) if any(values) else None


def on_earth(latitude: float, longitude: float) -> bool:
    """Unknown places and NaN are not."""
    return abs(latitude) <= 90.0 and abs(longitude) <= 180.0


def _degrees(radians: float | None) -> float | None:
    return None if radians is None else math.degrees(radians)


def said_mode(mode: PilotingMode) -> PilotingMode | None:
    return None if mode is PilotingMode.UNKNOWN else mode


def said_fov(radians: float) -> float | None:
    """Return a field of view; None, unknown, for NaN and what no lens has."""
    return radians if 0.0 < radians <= 2.0 * math.pi else None


def _timestamp(body: bytes) -> int | None:
    position = _V3.size
    while position + _EXTENSION.size <= len(body):
        id, words = _EXTENSION.unpack_from(body, position)
        position += _EXTENSION.size
        if id == _TIMESTAMP_EXTENSION and words == 2 and position + 8 <= len(body):
            return int.from_bytes(body[position : position + 8], "big")
        position += 4 * words
    return None

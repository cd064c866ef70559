"""Metadata of pictures as a protocol buffer: vmeta.proto's `TimedMetadata`.

It is converted to and from `FrameMetadata`, as far as that has its fields.
"""

from __future__ import annotations

import math
from typing import Annotated, TypeVar

from anafi_mav.arsdk.codec.protobuf import (
    BOOL,
    DOUBLE,
    ENUM,
    FLOAT,
    INT32,
    RECORD,
    SINT32,
    UINT32,
    UINT64,
    Field,
    Submessage,
    parse,
    serialize,
)
from anafi_mav.arsdk.video.video_metadata import (
    UNKNOWN_SATELLITES,
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
    on_earth,
    said_fov,
    said_mode,
)
from anafi_mav.units import LARGEST


class _Quaternion(Submessage, frozen=True):
    w: Annotated[float, Field(1, FLOAT)] = 0.0
    x: Annotated[float, Field(2, FLOAT)] = 0.0
    y: Annotated[float, Field(3, FLOAT)] = 0.0
    z: Annotated[float, Field(4, FLOAT)] = 0.0


class _Triple(Submessage, frozen=True):
    """NED and Vector3 look alike on the wire."""

    first: Annotated[float, Field(1, FLOAT)] = 0.0
    second: Annotated[float, Field(2, FLOAT)] = 0.0
    third: Annotated[float, Field(3, FLOAT)] = 0.0


class _Location(Submessage, frozen=True, kw_only=True):
    latitude: Annotated[float, Field(1, DOUBLE)] = 0.0
    longitude: Annotated[float, Field(2, DOUBLE)] = 0.0
    altitude_wgs84: Annotated[float, Field(3, DOUBLE)] = 0.0
    satellites: Annotated[int, Field(4, UINT32)] = 0
    horizontal_accuracy: Annotated[float, Field(5, FLOAT)] = 0.0
    vertical_accuracy: Annotated[float, Field(6, FLOAT)] = 0.0
    altitude_amsl: Annotated[float, Field(7, DOUBLE)] = 0.0


class _Drone(Submessage, frozen=True, kw_only=True):
    quat: Annotated[_Quaternion | None, Field(1, RECORD)] = None
    location: Annotated[_Location | None, Field(2, RECORD)] = None
    ground_distance: Annotated[float, Field(3, DOUBLE)] = 0.0
    speed: Annotated[_Triple | None, Field(4, RECORD)] = None
    battery_percentage: Annotated[int, Field(5, SINT32)] = 0
    flying_state: Annotated[FlyingState, Field(7, ENUM)] = FlyingState.LANDED
    position: Annotated[_Triple | None, Field(9, RECORD)] = None
    local_position: Annotated[_Triple | None, Field(10, RECORD)] = None
    animation_in_progress: Annotated[bool, Field(11, BOOL)] = False
    piloting_mode: Annotated[PilotingMode, Field(12, ENUM)] = PilotingMode.UNKNOWN
    altitude_ato: Annotated[float, Field(13, DOUBLE)] = 0.0


class _Camera(Submessage, frozen=True, kw_only=True):
    timestamp: Annotated[int, Field(1, UINT64)] = 0
    base_quat: Annotated[_Quaternion | None, Field(2, RECORD)] = None
    quat: Annotated[_Quaternion | None, Field(3, RECORD)] = None
    exposure_time: Annotated[float, Field(4, FLOAT)] = 0.0
    iso_gain: Annotated[int, Field(5, UINT32)] = 0
    awb_r_gain: Annotated[float, Field(6, FLOAT)] = 0.0
    awb_b_gain: Annotated[float, Field(7, FLOAT)] = 0.0
    hfov: Annotated[float, Field(8, FLOAT)] = 0.0
    vfov: Annotated[float, Field(9, FLOAT)] = 0.0
    zoom_level: Annotated[float, Field(16, FLOAT)] = 0.0


class _Wifi(Submessage, frozen=True, kw_only=True):
    goodput: Annotated[int, Field(1, UINT32)] = 0
    quality: Annotated[int, Field(2, UINT32)] = 0
    rssi: Annotated[int, Field(3, SINT32)] = 0


class _LinkInfo(Submessage, frozen=True, kw_only=True):
    type: Annotated[LinkType, Field(1, ENUM)] = LinkType.UNKNOWN
    status: Annotated[LinkStatus, Field(2, ENUM)] = LinkStatus.DOWN
    quality: Annotated[int, Field(3, INT32)] = 0
    active: Annotated[bool, Field(4, BOOL)] = False


class _Starfish(Submessage, frozen=True, kw_only=True):
    links: Annotated[tuple[_LinkInfo, ...], Field(1, RECORD)] = ()
    quality: Annotated[int, Field(2, INT32)] = 0


class _Link(Submessage, frozen=True, kw_only=True):
    wifi: Annotated[_Wifi | None, Field(1, RECORD, "protocol")] = None
    starfish: Annotated[_Starfish | None, Field(2, RECORD, "protocol")] = None


class _TimedMetadata(Submessage, frozen=True, kw_only=True):
    drone: Annotated[_Drone | None, Field(1, RECORD)] = None
    camera: Annotated[_Camera | None, Field(2, RECORD)] = None
    links: Annotated[tuple[_Link, ...], Field(3, RECORD)] = ()


def encode_proto(metadata: FrameMetadata) -> bytes:
    """The serialized `TimedMetadata`.

    Raises `LocalProtocolError` when a number does not fit its field.

    proto3 encodes a number that is zero as one that is missing.
    """
    drone = _Drone(
        quat=_Quaternion(*metadata.drone_quat) if metadata.drone_quat else None,
        location=_location(metadata.location),
        ground_distance=metadata.ground_distance or 0.0,
        altitude_ato=metadata.altitude_ato or 0.0,
        speed=_Triple(*metadata.speed) if metadata.speed else None,
        battery_percentage=metadata.battery_percentage or 0,
        flying_state=metadata.flying_state or FlyingState.LANDED,
        piloting_mode=metadata.piloting_mode or PilotingMode.UNKNOWN,
        animation_in_progress=metadata.animation_in_progress,
        position=_Triple(*metadata.position) if metadata.position else None,
        local_position=_Triple(*metadata.local_position) if metadata.local_position else None,
    )
    camera = _Camera(
        timestamp=metadata.timestamp or 0,
        base_quat=_Quaternion(*metadata.base_quat) if metadata.base_quat else None,
        quat=_Quaternion(*metadata.quat) if metadata.quat else None,
        exposure_time=metadata.exposure_time or 0.0,
        iso_gain=metadata.iso_gain or 0,
        awb_r_gain=metadata.awb_r_gain or 0.0,
        awb_b_gain=metadata.awb_b_gain or 0.0,
        hfov=metadata.hfov or 0.0,
        vfov=metadata.vfov or 0.0,
        zoom_level=metadata.zoom_level or 0.0,
    )
    links: list[_Link] = []
    if metadata.wifi:
        wifi = metadata.wifi
        links.append(_Link(wifi=_Wifi(goodput=wifi.goodput, quality=wifi.quality, rssi=wifi.rssi)))
    if metadata.starfish:
        radios = tuple(
            _LinkInfo(type=link.type, status=link.status, quality=link.quality, active=link.active)
            for link in metadata.starfish.links
        )
        links.append(_Link(starfish=_Starfish(links=radios, quality=metadata.starfish.quality)))
    return serialize(_TimedMetadata(drone=drone, camera=camera, links=tuple(links)))


def _location(place: Location | None) -> _Location | None:
    if place is None:
        return None
    return _Location(
        latitude=place.latitude,
        longitude=place.longitude,
        altitude_wgs84=place.altitude_wgs84 or 0.0,
        altitude_amsl=place.altitude_amsl or 0.0,
        horizontal_accuracy=place.horizontal_accuracy or 0.0,
        vertical_accuracy=place.vertical_accuracy or 0.0,
        satellites=place.satellites or 0,
    )


def decode_proto(data: bytes) -> FrameMetadata | None:
    """The record in a serialized `TimedMetadata`; None if it is no protocol buffer.

    A measure that is missing, NaN or beyond `LARGEST` is None. Battery, state and the numbers of a vector that is there
    are zero then, which is what proto3 says by their absence. Of several links of one kind the first counts.
    """
    timed = parse(_TimedMetadata, data)
    if timed is None:
        return None
    drone, camera = timed.drone or _Drone(), timed.camera or _Camera()
    wifi = next((link.wifi for link in timed.links if link.wifi), None)
    starfish = next((link.starfish for link in timed.links if link.starfish), None)
    return FrameMetadata(
        drone_quat=_said_quat(drone.quat),
        location=_said_location(drone.location),
        ground_distance=_said(drone.ground_distance),
        altitude_ato=_said(drone.altitude_ato),
        speed=_said_triple(Ned, drone.speed),
        battery_percentage=drone.battery_percentage if timed.drone else None,
        flying_state=drone.flying_state if timed.drone else None,
        piloting_mode=said_mode(drone.piloting_mode),
        animation_in_progress=drone.animation_in_progress,
        position=_said_triple(Ned, drone.position),
        local_position=_said_triple(Vector3, drone.local_position),
        timestamp=camera.timestamp or None,
        base_quat=_said_quat(camera.base_quat),
        quat=_said_quat(camera.quat),
        exposure_time=_said(camera.exposure_time),
        iso_gain=camera.iso_gain or None,
        awb_r_gain=_said(camera.awb_r_gain),
        awb_b_gain=_said(camera.awb_b_gain),
        hfov=said_fov(camera.hfov),
        vfov=said_fov(camera.vfov),
        zoom_level=_said(camera.zoom_level),
        wifi=WifiLink(goodput=wifi.goodput, quality=wifi.quality, rssi=wifi.rssi) if wifi else None,
        starfish=_said_starfish(starfish),
    )


def _said_starfish(link: _Starfish | None) -> StarfishLink | None:
    if link is None:
        return None
    radios = tuple(
        LinkInfo(type=radio.type, status=radio.status, quality=radio.quality, active=radio.active)
        for radio in link.links
    )
    return StarfishLink(links=radios, quality=link.quality)


def _said(value: float) -> float | None:
    return value if value and abs(value) <= LARGEST else None


def _said_quat(quat: _Quaternion | None) -> Quaternion | None:
    if quat is None:
        return None
    parts = Quaternion(quat.w, quat.x, quat.y, quat.z)
    return parts if any(parts) and all(map(math.isfinite, parts)) else None


_Vector = TypeVar("_Vector", Ned, Vector3)


def _said_triple(vector: type[_Vector], triple: _Triple | None) -> _Vector | None:
    if triple is None:
        return None
    parts = (triple.first, triple.second, triple.third)
    return vector(*parts) if all(abs(part) <= LARGEST for part in parts) else None


def _said_location(place: _Location | None) -> Location | None:
    if place is None or not on_earth(place.latitude, place.longitude):
        return None
    return Location(
        latitude=place.latitude,
        longitude=place.longitude,
        altitude_amsl=_said(place.altitude_amsl),
        altitude_wgs84=_said(place.altitude_wgs84),
        horizontal_accuracy=_said(place.horizontal_accuracy),
        vertical_accuracy=_said(place.vertical_accuracy),
        satellites=None if place.satellites in (0, UNKNOWN_SATELLITES) else place.satellites,
    )

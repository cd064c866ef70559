"""Session descriptions (SDP, RFC 4566) of Parrot's video streams.

They list the cameras that a drone shows, and how.

Each stream is an ``m=`` line of its own; its title ("Front camera"), by which Olympe chooses it, is the ``i=`` line
below. Parrot's additions are attributes ``a=X-com-parrot-*`` (libvideo-metadata vmeta_session.h), named here as
there.
"""

from __future__ import annotations

import base64
import binascii
import re
from dataclasses import dataclass, replace

from anafi_mav.errors import LocalProtocolError

PREFIX = "X-com-parrot-"
MAKER = PREFIX + "maker"
MODEL = PREFIX + "model"
MODEL_ID = PREFIX + "model-id"
"""Four hexadecimal digits."""
SERIAL = PREFIX + "serial"
BUILD_ID = PREFIX + "build-id"
BOOT_ID = PREFIX + "boot-id"
BOOT_DATE = PREFIX + "boot-date"
RUN_ID = PREFIX + "run-id"
MEDIA_DATE = PREFIX + "media-date"
DEFAULT_MEDIA = PREFIX + "default-media"
"""The stream of who does not ask for another: "1"."""
CAMERA_TYPE = PREFIX + "camera-type"
"""front, disparity, …"""
CAMERA_SPECTRUM = PREFIX + "camera-spectrum"
"""visible, thermal, blended."""
CAMERA_MODEL_TYPE = PREFIX + "camera-model-type"
PICTURE_FOV = PREFIX + "picture-fov"
"""Horizontal and vertical, deg: "69.00,42.00"."""
PERSPECTIVE_DISTORTION = PREFIX + "perspective-distortion"
"""r1, r2, r3, t1, t2."""
PRINCIPAL_POINT = PREFIX + "principal-point"
VIDEO_MODE = PREFIX + "video-mode"
DYNAMIC_RANGE = PREFIX + "dynamic-range"
TONE_MAPPING = PREFIX + "tone-mapping"

MAX_LINES = 512
"""A description of Parrot's has some 20 lines a stream."""
MAX_MEDIA = 16
"""An Ai has two streams."""

Attributes = tuple[tuple[str, str], ...]
"""(name, value); a flag has an empty value."""


@dataclass(frozen=True)
class MediaDescription:
    """One stream."""

    title: str = ""
    control: str = ""
    """URL for SETUP, relative to the session's URL or absolute."""
    payload_type: int = 96
    encoding: str = "H264"
    clock_rate: int = 90000
    sps: bytes = b""
    """Sequence parameter set, a NAL unit; empty: not said."""
    pps: bytes = b""
    """Picture parameter set."""
    attributes: Attributes = ()

    def attribute(self, name: str) -> str | None:
        return next((value for key, value in self.attributes if key == name), None)


@dataclass(frozen=True)
class SessionDescription:
    """All streams of one URL."""

    name: str = ""
    info: str = ""
    """Parrot's "friendly name" of the product."""
    tool: str = ""
    """The software and its version."""
    address: str = "0.0.0.0"
    """Source address of the streams; 0.0.0.0: the sender of the description."""
    session_id: int = 0
    control: str = ""
    duration: float | None = None
    """s of a recording; None: live."""
    attributes: Attributes = ()
    media: tuple[MediaDescription, ...] = ()

    def attribute(self, name: str) -> str | None:
        return next((value for key, value in self.attributes if key == name), None)


def format_description(session: SessionDescription) -> bytes:
    """Raises `LocalProtocolError` when a text holds a line end."""
    lines = [
        "v=0",
        f"o=- {session.session_id} 1 IN IP4 {session.address}",
        f"s={session.name or ' '}",
        *([f"i={session.info}"] if session.info else []),
        f"c=IN IP4 {session.address}",
        "t=0 0",
        *([f"a=tool:{session.tool}"] if session.tool else []),
        *([f"a=control:{session.control}"] if session.control else []),
        # Live streams have no range: Parrot's reader refuses "now" in a description (libsdp sdp.c).
        *([] if session.duration is None else [f"a=range:npt=0-{session.duration:.3f}"]),
        *_attribute_lines(session.attributes),
    ]
    for media in session.media:
        lines += [
            f"m=video 0 RTP/AVP {media.payload_type}",
            *([f"i={media.title}"] if media.title else []),
            *([f"a=control:{media.control}"] if media.control else []),
            f"a=rtpmap:{media.payload_type} {media.encoding}/{media.clock_rate}",
        ]
        if media.sps and media.pps:
            sets = ",".join(base64.b64encode(unit).decode() for unit in (media.sps, media.pps))
            lines.append(
                f"a=fmtp:{media.payload_type} packetization-mode=1;profile-level-id={media.sps[1:4].hex()};"
                f"sprop-parameter-sets={sets}"
            )
        lines += _attribute_lines(media.attributes)
    if any("\r" in line or "\n" in line for line in lines):
        raise LocalProtocolError(f"a line end inside a line of {session!r}")
    return "".join(f"{line}\r\n" for line in lines).encode()


def _attribute_lines(attributes: Attributes) -> list[str]:
    return [f"a={name}:{value}" if value else f"a={name}" for name, value in attributes]


def parse_description(data: bytes) -> SessionDescription | None:
    """Return the readable parts of a description, or None when it is not a description.

    Streams that are no video are left out.
    """
    lines = data.decode(errors="replace").splitlines()
    if not lines or lines[0] != "v=0" or len(lines) > MAX_LINES:
        return None
    session = SessionDescription()
    found: list[MediaDescription | None] = []
    for line in lines[1:]:
        kind, equals, value = line[:1], line[1:2], line[2:].strip()
        if equals != "=":
            continue
        if kind == "m":
            found.append(_media(value))
            if len(found) > MAX_MEDIA:
                return None
        elif found:
            if found[-1] is not None:
                found[-1] = _media_line(found[-1], kind, value)
        else:
            session = _session_line(session, kind, value)
    return replace(session, media=tuple(media for media in found if media is not None))


def _media(value: str) -> MediaDescription | None:
    match = re.fullmatch(r"video [0-9]+(?:/[0-9]+)? RTP/AVP ([0-9]{1,3})(?: .*)?", value)
    return MediaDescription(payload_type=int(match[1]), encoding="", clock_rate=0) if match else None


def _session_line(session: SessionDescription, kind: str, value: str) -> SessionDescription:
    if kind == "s":
        return replace(session, name=value)
    if kind == "i":
        return replace(session, info=value)
    if kind == "c" and (match := re.fullmatch(r"IN IP4 ([0-9.]+)(?:/.*)?", value)):
        return replace(session, address=match[1])
    if kind == "o" and (match := re.fullmatch(r"\S+ ([0-9]{1,20}) .*", value)):
        return replace(session, session_id=int(match[1]))
    if kind != "a":
        return session
    name, _, text = value.partition(":")
    if name == "tool":
        return replace(session, tool=text)
    if name == "control":
        return replace(session, control=text)
    if name == "range":
        match = re.fullmatch(r"npt=[0-9.]+-([0-9]{1,9}(?:\.[0-9]{0,9})?)", text)
        return replace(session, duration=float(match[1]) if match else None)
    return replace(session, attributes=(*session.attributes, (name, text)))


def _media_line(media: MediaDescription, kind: str, value: str) -> MediaDescription:
    if kind == "i":
        return replace(media, title=value)
    if kind != "a":
        return media
    name, _, text = value.partition(":")
    if name == "control":
        return replace(media, control=text)
    if name == "rtpmap" and (match := re.fullmatch(rf"{media.payload_type} ([^/]+)/([0-9]{{1,9}})(?:/.*)?", text)):
        return replace(media, encoding=match[1], clock_rate=int(match[2]))
    if name == "fmtp" and text.startswith(f"{media.payload_type} "):
        # Not by a search: many beginnings in one line would take it seconds.
        options = dict(option.strip().partition("=")[::2] for option in text.partition(" ")[2].split(";"))
        units = [_unit(one.strip()) for one in options.get("sprop-parameter-sets", "").split(",")[:2]]
        if all(units) and len(units) == 2:
            return replace(media, sps=units[0], pps=units[1])
        return media
    return replace(media, attributes=(*media.attributes, (name, text)))


def _unit(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        return b""

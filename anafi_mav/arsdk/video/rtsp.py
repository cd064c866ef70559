"""RTSP 1.0 (RFC 2326), as far as a drone's video needs it: requests, responses, headers.

No I/O. Both ends may send requests: a drone announces a changed description and ends sessions itself. Bytes of a
peer never raise: `MessageReader` answers with a `MalformedRtsp` that has the status to send before hanging up.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from anafi_mav.errors import LocalProtocolError

VERSION = "RTSP/1.0"
DEFAULT_PORT = 554

MAX_HEAD = 8192
"""Bytes of a message's lines; Parrot's own have a few hundred."""
MAX_BODY = 0xFFFF
"""Bytes of a body (librtsp RTSP_SESSION_DESCRIPTION_MAX_LEN)."""
MAX_HEADERS = 64

METHODS = ("OPTIONS", "DESCRIBE", "SETUP", "PLAY", "PAUSE", "TEARDOWN", "GET_PARAMETER", "ANNOUNCE")
"""The methods of Parrot's streams; ANNOUNCE and TEARDOWN go from the drone to its client too."""


class Status(enum.IntEnum):
    """The answers used here; any other number of three digits is read too."""

    OK = 200
    BAD_REQUEST = 400
    UNAUTHORIZED = 401
    NOT_FOUND = 404
    METHOD_NOT_ALLOWED = 405
    ENTITY_TOO_LARGE = 413
    URI_TOO_LARGE = 414
    NOT_ENOUGH_BANDWIDTH = 453
    SESSION_NOT_FOUND = 454
    METHOD_NOT_VALID = 455
    INVALID_RANGE = 457
    ONLY_AGGREGATE_ALLOWED = 460
    UNSUPPORTED_TRANSPORT = 461
    INTERNAL_ERROR = 500
    NOT_IMPLEMENTED = 501
    SERVICE_UNAVAILABLE = 503
    VERSION_NOT_SUPPORTED = 505


REASONS = {
    Status.OK: "OK",
    Status.BAD_REQUEST: "Bad Request",
    Status.UNAUTHORIZED: "Unauthorized",
    Status.NOT_FOUND: "Not Found",
    Status.METHOD_NOT_ALLOWED: "Method Not Allowed",
    Status.ENTITY_TOO_LARGE: "Request Entity Too Large",
    Status.URI_TOO_LARGE: "Request-URI Too Large",
    Status.NOT_ENOUGH_BANDWIDTH: "Not Enough Bandwidth",
    Status.SESSION_NOT_FOUND: "Session Not Found",
    Status.METHOD_NOT_VALID: "Method Not Valid In This State",
    Status.INVALID_RANGE: "Invalid Range",
    Status.ONLY_AGGREGATE_ALLOWED: "Only Aggregate Operation Allowed",
    Status.UNSUPPORTED_TRANSPORT: "Unsupported Transport",
    Status.INTERNAL_ERROR: "Internal Server Error",
    Status.NOT_IMPLEMENTED: "Not Implemented",
    Status.SERVICE_UNAVAILABLE: "Service Unavailable",
    Status.VERSION_NOT_SUPPORTED: "RTSP Version Not Supported",
}

Headers = tuple[tuple[str, str], ...]


def _find(headers: Headers, name: str) -> str | None:
    return next((value for key, value in headers if key.lower() == name.lower()), None)


def _number(text: str | None) -> int | None:
    """A number of at most 9 digits."""
    return int(text) if text is not None and re.fullmatch(r"[0-9]{1,9}", text) else None


@dataclass(frozen=True)
class RtspRequest:
    method: str
    uri: str
    headers: Headers = ()
    body: bytes = b""

    def header(self, name: str) -> str | None:
        """The first header of that name, in whatever case."""
        return _find(self.headers, name)

    @property
    def cseq(self) -> int | None:
        """Which request this is; the response repeats it."""
        return _number(self.header("CSeq"))


@dataclass(frozen=True)
class Response:
    status: int
    headers: Headers = ()
    body: bytes = b""
    reason: str = ""
    """For people; empty: `encode` writes the standard's own."""

    def header(self, name: str) -> str | None:
        """The first header of that name, in whatever case."""
        return _find(self.headers, name)

    @property
    def cseq(self) -> int | None:
        """The request this answers."""
        return _number(self.header("CSeq"))


@dataclass(frozen=True)
class MalformedRtsp:
    """Input that is not RTSP; nothing behind it is read."""

    status: Status
    reason: str


@dataclass(frozen=True)
class InterleavedData:
    """A packet of RTP or RTCP inside the RTSP connection (RFC 2326 10.12)."""

    channel: int
    data: bytes


Message = RtspRequest | Response
Event = RtspRequest | Response | InterleavedData | MalformedRtsp

_DOLLAR = 0x24
_FRAME_HEAD = 4
"""Bytes before an interleaved packet: "$", channel, and its length in 16 bits."""


def encode_interleaved(channel: int, data: bytes) -> bytes:
    """Return a packet as it travels inside the RTSP connection."""
    if not 0 <= channel <= 0xFF or len(data) > 0xFFFF:
        raise LocalProtocolError(f"{len(data)} bytes on channel {channel}")
    return bytes((_DOLLAR, channel)) + len(data).to_bytes(2, "big") + data


def encode(message: Message) -> bytes:
    """The bytes of a message; Content-Length is added.

    Raises `LocalProtocolError` when a line holds a line end.
    """
    if isinstance(message, RtspRequest):
        first = f"{message.method} {message.uri} {VERSION}"
    else:
        reason = message.reason or REASONS.get(message.status) or "Unknown"  # type: ignore[call-overload]
        first = f"{VERSION} {message.status:d} {reason}"
    lines = [first, *(f"{name}: {value}" for name, value in message.headers)]
    if message.body:
        lines.append(f"Content-Length: {len(message.body)}")
    if any("\r" in line or "\n" in line for line in lines):
        raise LocalProtocolError(f"a line end inside a line of {message!r}")
    return "\r\n".join([*lines, "", ""]).encode() + message.body


class MessageReader:
    """Cuts a stream of bytes into messages, and into the packets between them."""

    def __init__(self, *, interleaved: bool = False) -> None:
        """Create a reader; with `interleaved` packets of RTP and RTCP may stand between messages."""
        self._interleaved = interleaved
        self._buffer = bytearray()
        self._head: tuple[Message, int] | None = None
        """A message whose body is awaited, and how long that is."""
        self._dead = False

    def feed(self, data: bytes) -> list[Event]:
        """The messages that are whole now; behind a `MalformedRtsp` nothing comes any more."""
        if self._dead:
            return []
        self._buffer += data
        events: list[Event] = []
        while (event := self._next()) is not None:
            events.append(event)
            if isinstance(event, MalformedRtsp):
                self._dead = True
                self._buffer.clear()
                break
        return events

    def _next(self) -> Event | None:
        if self._head is None:
            # Empty lines between messages are to be ignored (RFC 2326 4.1).
            self._buffer = self._buffer.lstrip(b"\r\n")
            if self._interleaved and self._buffer[:1] == b"$":
                return self._packet()
            if self._buffer and not 0x41 <= self._buffer[0] <= 0x5A:
                return MalformedRtsp(Status.BAD_REQUEST, "no message begins so")
            end = re.search(rb"\r?\n\r?\n", self._buffer[: MAX_HEAD + 4])
            if end is None:
                if len(self._buffer) > MAX_HEAD:
                    return MalformedRtsp(Status.ENTITY_TOO_LARGE, f"more than {MAX_HEAD} bytes without an empty line")
                return None
            head = bytes(self._buffer[: end.start()])
            del self._buffer[: end.end()]
            message = parse_head(head)
            if isinstance(message, MalformedRtsp):
                return message
            length = message.header("Content-Length")
            size = 0 if length is None else _number(length)
            if size is None:
                return MalformedRtsp(Status.BAD_REQUEST, "Content-Length is no number")
            if size > MAX_BODY:
                return MalformedRtsp(Status.ENTITY_TOO_LARGE, f"a body of {size} bytes")
            self._head = (message, size)
        message, size = self._head
        if len(self._buffer) < size:
            return None
        body = bytes(self._buffer[:size])
        del self._buffer[:size]
        self._head = None
        return replace(message, body=body)

    def _packet(self) -> InterleavedData | None:
        if len(self._buffer) < _FRAME_HEAD:
            return None
        size = int.from_bytes(self._buffer[2:_FRAME_HEAD], "big")
        if len(self._buffer) < _FRAME_HEAD + size:
            return None
        packet = InterleavedData(self._buffer[1], bytes(self._buffer[_FRAME_HEAD : _FRAME_HEAD + size]))
        del self._buffer[: _FRAME_HEAD + size]
        return packet


def parse_head(head: bytes) -> Message | MalformedRtsp:
    """A message without its body, from its lines."""
    try:
        lines = head.decode().replace("\r\n", "\n").split("\n")
    except UnicodeDecodeError:
        return MalformedRtsp(Status.BAD_REQUEST, "not UTF-8")
    if re.search(r"[\x00-\x08\x0a-\x1f\x7f]", "".join(lines)):
        return MalformedRtsp(Status.BAD_REQUEST, "control characters")
    if len(lines) > MAX_HEADERS + 1:
        return MalformedRtsp(Status.ENTITY_TOO_LARGE, f"more than {MAX_HEADERS} headers")
    headers: list[tuple[str, str]] = []
    for line in lines[1:]:
        if line[:1] in (" ", "\t") and headers:  # folded
            headers[-1] = (headers[-1][0], f"{headers[-1][1]} {line.strip()}")
            continue
        name, colon, value = line.partition(":")
        if not colon or not re.fullmatch(r"[!-9;-~]+", name):
            return MalformedRtsp(Status.BAD_REQUEST, "a header without a name")
        headers.append((name, value.strip()))
    words = lines[0].split(" ", 2)
    if len(words) == 3 and words[0].startswith("RTSP/"):
        status = _number(words[1])
        if words[0] != VERSION or status is None or not 100 <= status <= 999:
            return MalformedRtsp(Status.BAD_REQUEST, "no status line")
        return Response(status, tuple(headers), reason=words[2])
    if len(words) != 3 or not re.fullmatch(r"[A-Z_]{1,20} [!-~]+", f"{words[0]} {words[1]}"):
        return MalformedRtsp(Status.BAD_REQUEST, "no request line")
    if words[2] != VERSION:
        return MalformedRtsp(Status.VERSION_NOT_SUPPORTED, "another version")
    return RtspRequest(words[0], words[1], tuple(headers))


# ------------------------------------------------------------------------------------------------------- headers


@dataclass(frozen=True)
class RtspTransport:
    """How a stream travels (header Transport)."""

    lower: str = "UDP"
    """"UDP", "TCP" (inside the RTSP connection) or Parrot's own "MUX" (through a Skycontroller's mux)."""
    unicast: bool = True
    client_ports: tuple[int, int] | None = None
    """(RTP, RTCP)."""
    server_ports: tuple[int, int] | None = None
    ssrc: int | None = None
    channels: tuple[int, int] | None = None
    """(RTP, RTCP) inside the RTSP connection."""
    others: tuple[tuple[str, str], ...] = field(default=())
    """Further parameters: "destination", "source", "mode", …"""


def format_transport(transport: RtspTransport) -> str:
    pieces = [f"RTP/AVP/{transport.lower}", "unicast" if transport.unicast else "multicast"]
    pieces += [f"{key}={value}" if value else key for key, value in transport.others]
    if transport.channels:
        pieces.append("interleaved={}-{}".format(*transport.channels))
    if transport.client_ports:
        pieces.append("client_port={}-{}".format(*transport.client_ports))
    if transport.server_ports:
        pieces.append("server_port={}-{}".format(*transport.server_ports))
    if transport.ssrc is not None:
        pieces.append(f"ssrc={transport.ssrc:08X}")
    return ";".join(pieces)


def parse_transport(value: str) -> list[RtspTransport]:
    """Return the transports that a header Transport offers, best first.

    Those that are not RTP/AVP are left out.
    """
    found = []
    for offer in value.split(","):
        first, *parameters = offer.strip().split(";")
        spec = first.upper().split("/")
        if spec[:2] != ["RTP", "AVP"] or len(spec) > 3:
            continue
        transport = RtspTransport(lower=spec[2] if len(spec) == 3 else "UDP", unicast=False)
        others: list[tuple[str, str]] = []
        for parameter in parameters:
            key, _, text = parameter.strip().partition("=")
            if key == "unicast":
                transport = replace(transport, unicast=True)
            elif key in ("client_port", "port"):
                transport = replace(transport, client_ports=_ports(text))
            elif key == "server_port":
                transport = replace(transport, server_ports=_ports(text))
            elif key == "interleaved":
                transport = replace(transport, channels=_channels(text))
            elif key == "ssrc" and re.fullmatch(r"[0-9A-Fa-f]{1,8}", text):
                transport = replace(transport, ssrc=int(text, 16))
            elif key and key != "multicast":
                others.append((key, text))
        found.append(replace(transport, others=tuple(others)))
    return found


def _ports(text: str) -> tuple[int, int] | None:
    first, _, second = text.partition("-")
    rtp = _number(first)
    rtcp = _number(second) if second else rtp and rtp + 1
    return (rtp, rtcp) if rtp and rtcp and rtp < 1 << 16 and rtcp < 1 << 16 else None


def _channels(text: str) -> tuple[int, int] | None:
    first, _, second = text.partition("-")
    rtp = _number(first)
    rtcp = _number(second) if second else rtp if rtp is None else rtp + 1
    return (rtp, rtcp) if rtp is not None and rtcp is not None and rtp <= 0xFF and rtcp <= 0xFF else None


def format_session(id: str, timeout: int | None = None) -> str:
    return id if timeout is None else f"{id};timeout={timeout}"


def parse_session(value: str) -> tuple[str, int | None]:
    """(id, s after which a silent client is forgotten: None means 60)."""
    id, _, rest = value.partition(";")
    key, _, text = rest.strip().partition("=")
    return id.strip(), _number(text.strip()) if key == "timeout" else None


def format_range(start: float | None, stop: float | None = None) -> str:
    """Seconds of a recording; None is "now" of a live stream as start, the end as stop."""
    return f"npt={'now' if start is None else f'{start:.3f}'}-{'' if stop is None else f'{stop:.3f}'}"


def parse_range(value: str) -> tuple[float | None, float | None] | None:
    """Return (start, stop) of a header Range in s, or None when it is not readable.

    Start is None for "now" or when absent, stop is None for the end.
    """
    match = re.fullmatch(r"npt\s*=\s*([0-9.:]+|now)?\s*-\s*([0-9.:]+)?\s*(?:;.*)?", value.strip())
    if match is None:
        return None
    times: list[float | None] = []
    for text in match.groups():
        if text in (None, "now"):
            times.append(None)
            continue
        seconds = 0.0
        for part in text.split(":"):
            if not re.fullmatch(r"[0-9]{1,9}(\.[0-9]{0,9})?", part):
                return None
            seconds = 60.0 * seconds + float(part)
        times.append(seconds)
    return times[0], times[1]


@dataclass(frozen=True)
class RtpInfo:
    """Start of a stream (header RTP-Info): its URL, first sequence number and timestamp."""

    url: str
    sequence: int | None = None
    timestamp: int | None = None


def format_rtp_info(infos: Sequence[RtpInfo]) -> str:
    pieces = []
    for info in infos:
        piece = f"url={info.url}"
        if info.sequence is not None:
            piece += f";seq={info.sequence}"
        if info.timestamp is not None:
            piece += f";rtptime={info.timestamp}"
        pieces.append(piece)
    return ",".join(pieces)


def parse_rtp_info(value: str) -> list[RtpInfo]:
    """Return the readable entries of a header RTP-Info."""
    infos = []
    for piece in value.split(","):
        parameters = dict(part.strip().partition("=")[::2] for part in piece.split(";"))
        if parameters.get("url"):
            timestamp = parameters.get("rtptime", "")
            infos.append(
                RtpInfo(
                    parameters["url"],
                    _number(parameters.get("seq")),
                    int(timestamp) if re.fullmatch(r"[0-9]{1,10}", timestamp) else None,
                )
            )
    return infos


# ---------------------------------------------------------------------------------------------------------- URLs


def split_url(url: str) -> tuple[str, int, str] | None:
    """Return (host, port, path without its first slash) of an rtsp:// URL, or None.

    None when it is not such a URL.
    """
    match = re.fullmatch(
        r"rtsp://(?:[^@/]*@)?(?:\[([0-9A-Fa-f:.%\w]+)\]|([^/:@\[\]]+))(?::([0-9]{1,5}))?(?:/(.*))?", url
    )
    if match is None:
        return None
    port = int(match[3]) if match[3] else DEFAULT_PORT
    return (match[1] or match[2], port, match[4] or "") if 0 < port < 1 << 16 else None


def join_url(base: str, control: str) -> str:
    """Return the URL of a stream from its control attribute (RFC 2326 C.1.1).

    `base` is the URL of the description.
    """
    if control in ("", "*"):
        return base
    if control.lower().startswith("rtsp://"):
        return control
    return f"{base.rstrip('/')}/{control.lstrip('/')}"

"""The JSON that opens an ARSDK connection. No I/O.

Discovery (TCP 44445): the device says who it is, NUL-terminated, and keeps the socket open as long as it is there.
Handshake (TCP 44444): the controller names its UDP port and protocol versions, the device answers with its own
(arsdk-ng libarsdk/src/net/arsdk_publisher_net.c and arsdk_backend_net.c).

A parser returns None as long as the text is incomplete and raises `RemoteProtocolError` when it can never become
a valid one.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from anafi_mav.arsdk.link.frame import VERSIONS
from anafi_mav.errors import LocalProtocolError, RemoteProtocolError

DISCOVERY_PORT = 44445
HANDSHAKE_PORT = 44444
C2D_PORT = 2233
"""UDP port on which a device listens unless it says otherwise (arsdk-ng ARSDK_NET_DEFAULT_C2D_DATA_PORT)."""

MAX_JSON = 4096
"""Longest text accepted. Parrot's own are about 150 bytes; its publisher composes them in 255."""

MAX_MODEL_ID = 0xFFFF

REJECTED = -1
"""`status` of a refusal (arsdk-ng arsdk_backend_net_reject_peer_conn)."""


@dataclass(frozen=True)
class DeviceInfo:
    """Description that a device sends in discovery."""

    model_id: int
    """Parrot's product number, e.g. 0x0914 = ANAFI 4K."""
    serial: str
    port: int
    """TCP port of the handshake."""
    name: str


@dataclass(frozen=True)
class ConnectRequest:
    """The controller's part of the handshake."""

    controller_name: str
    controller_type: str
    d2c_port: int
    """UDP port on which the controller listens."""
    device_id: str = ""
    """Serial number of the wanted device; empty: any device."""
    qos_mode: int = 0
    proto_v_min: int = 1
    proto_v_max: int = 1


@dataclass(frozen=True)
class ConnectReply:
    """The device's part; every `status` but 0 is a refusal."""

    status: int
    c2d_port: int
    """UDP port on which the device listens; 0 in a refusal."""
    qos_mode: int = 0
    proto_v: int = 1


def format_discovery(info: DeviceInfo) -> bytes:
    """Return the text that a device sends to each client of its discovery port."""
    text = {"model.id": f"0x{info.model_id:04x}", "serial": info.serial, "port": info.port, "name": info.name}
    return _format(text) + b"\0"


def parse_discovery(data: bytes) -> DeviceInfo | None:
    """A device's announcement."""
    members = _parse(data, "discovery")
    if members is None:
        return None
    return DeviceInfo(
        _model_id(members.get("model.id")),
        _text(members, "serial"),
        _port(members, "port", "discovery"),
        _text(members, "name"),
    )


def format_request(request: ConnectRequest) -> bytes:
    """The controller's text; without NUL, as libarsdk sends it."""
    return _format(
        {
            "controller_name": request.controller_name,
            "controller_type": request.controller_type,
            "d2c_port": request.d2c_port,
            "device_id": request.device_id,
            "qos_mode": request.qos_mode,
            "proto_v_min": request.proto_v_min,
            "proto_v_max": request.proto_v_max,
        }
    )


def parse_request(data: bytes) -> ConnectRequest | None:
    """A controller's request; one that names no protocol versions speaks version 1 only."""
    members = _parse(data, "connection request")
    if members is None:
        return None
    return ConnectRequest(
        controller_name=_text(members, "controller_name"),
        controller_type=_text(members, "controller_type"),
        d2c_port=_port(members, "d2c_port", "connection request"),
        device_id=_text(members, "device_id"),
        qos_mode=_number(members, "qos_mode", 0),
        proto_v_min=_number(members, "proto_v_min", 1),
        proto_v_max=_number(members, "proto_v_max", 1),
    )


def format_reply(reply: ConnectReply) -> bytes:
    """The device's text. It has to leave in one piece: libarsdk reads it once."""
    return _format(
        {"status": reply.status, "c2d_port": reply.c2d_port, "qos_mode": reply.qos_mode, "proto_v": reply.proto_v}
    )


def parse_reply(data: bytes) -> ConnectReply | None:
    """A device's answer; one that names no protocol version means version 1."""
    members = _parse(data, "connection reply")
    if members is None:
        return None
    status = _number(members, "status", 0)
    return ConnectReply(
        status=status,
        c2d_port=_port(members, "c2d_port", "connection reply") if status == 0 else 0,
        qos_mode=_number(members, "qos_mode", 0),
        proto_v=_number(members, "proto_v", 1),
    )


def check_versions(versions: tuple[int, int]) -> None:
    """Raise `LocalProtocolError` unless this is a (lowest, highest) of our own versions."""
    low, high = versions
    if not VERSIONS[0] <= low <= high <= VERSIONS[-1]:
        raise LocalProtocolError(f"protocol versions {low} to {high}, we speak {VERSIONS[0]} to {VERSIONS[-1]}")


def pick_version(request: ConnectRequest, versions: tuple[int, int]) -> int | None:
    """Return the highest protocol version that both ends support, or None.

    The controller's range is in `request`, ours is `versions` (lowest, highest).
    """
    low = max(request.proto_v_min, versions[0])
    high = min(request.proto_v_max, versions[1])
    return high if low <= high else None


def _format(members: dict[str, object]) -> bytes:
    return json.dumps(members).encode()


def _parse(data: bytes, what: str) -> dict[str, Any] | None:
    text, terminator, _ = data.partition(b"\0")
    try:
        members = json.loads(text)
    except (ValueError, RecursionError):
        if terminator or len(data) >= MAX_JSON:
            raise RemoteProtocolError(f"unreadable {what}: {data[:200]!r}") from None
        return None
    if not isinstance(members, dict):
        raise RemoteProtocolError(f"{what} is no JSON object: {data[:200]!r}")
    return members


def _text(members: dict[str, Any], key: str) -> str:
    r"""Return a text that has an encoding.

    JSON may escape half of a character, like `\ud800`, of which UTF-8 has no bytes.
    """
    value = members.get(key)
    return value.encode(errors="replace").decode() if isinstance(value, str) else ""


def _number(members: dict[str, Any], key: str, default: int) -> int:
    value = members.get(key, default)
    if isinstance(value, str):
        # json-c, which Parrot reads with, takes numbers in quotes as well.
        try:
            return int(value)
        except ValueError:
            return default
    return value if isinstance(value, int) else default


def _port(members: dict[str, Any], key: str, what: str) -> int:
    port = _number(members, key, 0)
    if not 0 < port < 65536:
        raise RemoteProtocolError(f"{what} without a usable {key}: {members.get(key)!r}")
    return port


def _model_id(value: object) -> int:
    """Return a model number, of which Parrot has 16 bits; 0 for what is none."""
    try:
        number = int(value, 16) if isinstance(value, str) else 0
    except ValueError:
        return 0
    return number if 0 <= number <= MAX_MODEL_ID else 0

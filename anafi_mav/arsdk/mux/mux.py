"""Parrot's mux: several channels over one TCP connection, used by the Skycontroller 4.

No I/O here.

A frame is ``"MUX!", channel u32, size u32`` (with these 12 bytes) and a payload, little-endian. Channel 0 is the
mux's own: ``id u32, channel u32, six u32`` (libmux mux_priv.h); both ends begin with a handshake that carries the
version. Discovery and connection are messages of libpomp, ``"POMP", id u32, size u32`` and typed arguments (libpomp
pomp_prot.h, pomp_encoder.c); on the transport channel there is one ARSDK frame in each (arsdk-ng
arsdk_transport_mux.c). The sockets are in `mux_link`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from anafi_mav.arsdk.link.frame import decode_varint, encode_varint
from anafi_mav.errors import LocalProtocolError

PORT = 4321
"""TCP, of a Skycontroller (Olympe, olympe/connection/backend.py)."""

VERSION = 2
"""Of the mux protocol (libmux.h MUX_PROTOCOL_VERSION)."""

CONTROL, TRANSPORT, DISCOVERY, BACKEND = 0, 1, 2, 3
"""Channels (libmux-arsdk.h)."""

DISCOVER, DEVICE_ADDED, DEVICE_REMOVED = 1, 2, 3
"""Messages of the discovery channel: (), (name %s, type %u, id %s), the same."""
CONN_REQ, CONN_RESP = 1, 2
"""Messages of the backend channel: (controller %s, its type %s, device id %s, json %s), (status %d, json %s)."""

HANDSHAKE = 127
"""Control message: args are (is an answer, version)."""
RESET = 6
"""Control message: every channel restarts."""

MAX_FRAME = 1 << 18
"""Longest frame accepted: an ARSDK frame has up to 64 KiB, what the proxies of libmux read at once as much."""

_MAGIC, _POMP = b"MUX!", b"POMP"
_HEADER = struct.Struct("<4sII")
_CONTROL = struct.Struct("<8I")
CONTROL_SIZE = _CONTROL.size
"""Bytes of a control message before its payload."""
_I32, _U32, _STR = 0x05, 0x06, 0x09
_MAX_TEXT = 0xFFFF

Argument: TypeAlias = int | str


class MuxFrame(NamedTuple):
    """One frame of the mux."""

    channel: int
    payload: bytes


class MuxControl(NamedTuple):
    """One message of channel 0."""

    id: int
    channel: int
    args: tuple[int, ...]


def encode_frame(channel: int, payload: bytes) -> bytes:
    """The bytes of one frame."""
    return _HEADER.pack(_MAGIC, channel, _HEADER.size + len(payload)) + payload


def encode_control(id: int, channel: int = 0, *args: int, payload: bytes = b"") -> bytes:
    """The bytes of a control message as a whole frame; some have a `payload` behind them."""
    return encode_frame(CONTROL, _CONTROL.pack(id, channel, *args, *[0] * (6 - len(args))) + payload)


def decode_control(payload: bytes) -> MuxControl | None:
    """A control message; None when it is too short."""
    if len(payload) < _CONTROL.size:
        return None
    id, channel, *args = _CONTROL.unpack_from(payload)
    return MuxControl(id, channel, tuple(args))


class Decoder:
    """Finds the frames in a stream, however it is cut.

    Never raises; what is no frame is skipped and counted.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.skipped = 0
        """Bytes that belonged to no frame."""

    def feed(self, data: bytes) -> list[MuxFrame]:
        """The frames that are complete with these bytes."""
        buffer = self._buffer
        buffer += data
        frames: list[MuxFrame] = []
        position = 0
        while True:
            found = buffer.find(_MAGIC, position)
            if found < 0:
                # The end may be the beginning of a magic word.
                keep = max(position, len(buffer) - len(_MAGIC) + 1)
                self.skipped += keep - position
                position = keep
                break
            self.skipped += found - position
            position = found
            if len(buffer) - position < _HEADER.size:
                break
            _, channel, size = _HEADER.unpack_from(buffer, position)
            if not _HEADER.size <= size <= MAX_FRAME:
                self.skipped += len(_MAGIC)
                position += len(_MAGIC)
                continue
            if len(buffer) - position < size:
                break
            frames.append(MuxFrame(channel, bytes(buffer[position + _HEADER.size : position + size])))
            position += size
        del buffer[:position]
        return frames


def encode_pomp(id: int, arguments: Sequence[tuple[str, Argument]] = ()) -> bytes:
    """A message of libpomp; arguments are ("%s" or "%u" or "%d", value)."""
    parts = []
    for form, value in arguments:
        match form, value:
            case "%s", str():
                text = value.encode() + b"\0"
                if len(text) > _MAX_TEXT or "\0" in value:
                    raise LocalProtocolError(f"{value[:40]!r}… is no text for libpomp")
                parts.append(bytes((_STR,)) + encode_varint(len(text)) + text)
            case "%u", int() if 0 <= value < 1 << 32:
                parts.append(bytes((_U32,)) + encode_varint(value))
            case "%d", int() if -(1 << 31) <= value < 1 << 31:
                parts.append(bytes((_I32,)) + encode_varint((value << 1 ^ value >> 31) & 0xFFFFFFFF))
            case _:
                raise LocalProtocolError(f"{value!r} is no {form}")
    body = b"".join(parts)
    return _HEADER.pack(_POMP, id, _HEADER.size + len(body)) + body


def decode_pomp(data: bytes) -> tuple[int, list[Argument]] | None:
    """Return (id, arguments) of a libpomp message, or None.

    None when the data is not such a message or has arguments of other types.
    """
    if len(data) < _HEADER.size:
        return None
    magic, id, size = _HEADER.unpack_from(data)
    if magic != _POMP or not _HEADER.size <= size <= len(data):
        return None
    arguments: list[Argument] = []
    position = _HEADER.size
    while position < size:
        type = data[position]
        read = decode_varint(data, position + 1)
        if read is None or type not in (_I32, _U32, _STR):
            return None
        value, position = read
        if type == _STR:
            if value == 0 or position + value > size:
                return None
            arguments.append(data[position : position + value - 1].decode(errors="replace"))
            position += value
        else:
            arguments.append((value >> 1) ^ -(value & 1) if type == _I32 else value)
    return id, arguments

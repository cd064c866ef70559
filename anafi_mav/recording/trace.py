"""The ARSDK trace: each message of a drone as one line of JSON. No I/O.

    {"t": 1763848000.123456, "drone": "alpha", "kind": "event", "name": "ardrone3.…", "args": {…}}

`t` is in s since 1970, on the clock of the tlog beside it. Kinds: command (sent to the drone), event (reported by it).
The other fields are those of the simulator's log.
"""

from __future__ import annotations

from typing import Any

import msgspec

from anafi_mav.arsdk.codec.secret_fields import without_secrets
from anafi_mav.drone.events import Message

COMMAND, EVENT = "command", "event"


class TraceEntry(msgspec.Struct, frozen=True):
    """One message."""

    t: float
    drone: str
    kind: str
    name: str
    args: dict[str, Any]


_ENCODER = msgspec.json.Encoder()
_DECODER = msgspec.json.Decoder(TraceEntry)


def trace_line(time: float, drone: str, kind: str, message: Message) -> bytes:
    """Return the line of a message; `time`: s since 1970."""
    message = without_secrets(message)
    args = {name: getattr(message, name) for name in message.__struct_fields__}
    return _ENCODER.encode(TraceEntry(round(time, 6), drone, kind, message.NAME, args)) + b"\n"


def read_line(line: bytes) -> TraceEntry | None:
    """Return the entry of a line; None for a line that is none, as the last one of a power cut."""
    try:
        return _DECODER.decode(line)
    except (ValueError, RecursionError):
        return None

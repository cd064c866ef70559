"""Reads MAVLink as pymavlink does, and lets it decode only the messages that a test looks at.

Decoding is what a client of the tests costs, and most of what it receives is telemetry that no test asks for. Every
frame is checked when it arrives: its length, its flags and its checksum, with the dialects' own CRC_EXTRA. What this
module does not know for a plain frame of MAVLink 2 (a signature to verify, MAVLink 1, noise, an unknown message, a
wrong checksum) goes through pymavlink's parser at once, and so does everything behind it until nothing is left there.
"""

from __future__ import annotations

from collections.abc import MutableSequence
from typing import Any, NamedTuple

import fastcrc
from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav.mavlink import dialect as newer

CAMERA = 100
"""Component id of a vehicle's camera."""

CAMERA_HEARTBEAT = "CAMERA_HEARTBEAT"
"""Kind of a heartbeat that is a camera's."""

_HEADER = 10
"""Bytes of a MAVLink 2 frame before its payload."""

_CHECKSUM = 2

_CLASSES = {**newer.mavlink_map, **dialect.mavlink_map}
"""Message id -> class; the stock dialect's wherever it knows the message."""

_crc = fastcrc.crc16.mcrf4xx

_KINDS = {id: (message.msgname, bytes((message.crc_extra,))) for id, message in _CLASSES.items()}
"""Message id -> name and CRC_EXTRA."""


def kind_of(message: Any) -> str:
    """Return the name of a message, and CAMERA_HEARTBEAT for a heartbeat that is not the vehicle's own.

    Tests of flights wait for HEARTBEAT, and mean the autopilot's.
    """
    name: str = message.get_type()
    return CAMERA_HEARTBEAT if name == "HEARTBEAT" and message.get_srcComponent() == CAMERA else name


class Frame(NamedTuple):
    """A frame with a right checksum that nobody has looked into yet."""

    data: bytes


class Received(MutableSequence[Any]):
    """(monotonic time, message), oldest first: whoever takes an element gets it decoded, the same object each time."""

    def __init__(self) -> None:
        self.kinds: list[str] = []
        """The kind of each element, for which none has to be decoded."""
        self._elements: list[tuple[float, Any]] = []

    def add(self, at: float, message: Any, kind: str) -> None:
        """Append a message, or the frame of one."""
        self._elements.append((at, message))
        self.kinds.append(kind)

    def __len__(self) -> int:
        return len(self._elements)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[place] for place in range(*index.indices(len(self)))]
        at, message = self._elements[index]
        if type(message) is not Frame:
            return at, message
        self._elements[index] = decoded = at, _decode(message.data)
        return decoded

    def __setitem__(self, index: Any, value: Any) -> None:
        assert isinstance(index, slice), "elements are what was received: some may be left out"
        self._elements[index] = value
        self.kinds[index] = [kind_of(message) for _, message in value]

    def __delitem__(self, index: Any) -> None:
        del self._elements[index], self.kinds[index]

    def insert(self, index: int, value: Any) -> None:
        self._elements.insert(index, value)
        self.kinds.insert(index, kind_of(value[1]))

    def __eq__(self, other: object) -> bool:
        return self[:] == other

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr(self[:])


class Reader:
    """Bytes from a gateway to messages with their kinds."""

    def __init__(self, sysid: int, compid: int) -> None:
        self.parser = dialect.MAVLink(None, sysid, compid)
        """Whoever gives it a key has every signature verified."""
        self.parser.robust_parsing = True
        self.bad = 0
        """Pieces that were no messages."""
        self._newer = newer.MAVLink(None, sysid, compid)

    def read(self, data: bytes, at: float, received: Received) -> None:
        """Append what is complete with these bytes."""
        position, end = 0, len(data)
        parser = self.parser
        if parser.signing.secret_key is None and not parser.buf_len():
            while end - position >= _HEADER + _CHECKSUM:
                if data[position] != dialect.PROTOCOL_MARKER_V2 or data[position + 2]:
                    break
                crc_at = position + _HEADER + data[position + 1]
                after = crc_at + _CHECKSUM
                if after > end:
                    break
                id = data[position + 7] | data[position + 8] << 8 | data[position + 9] << 16
                known = _KINDS.get(id)
                if known is None:
                    break
                kind, crc_extra = known
                if _crc(data[position + 1 : crc_at] + crc_extra) != data[crc_at] | data[crc_at + 1] << 8:
                    break
                if id == dialect.MAVLINK_MSG_ID_HEARTBEAT and data[position + 6] == CAMERA:
                    kind = CAMERA_HEARTBEAT
                received.add(at, Frame(data[position:after]), kind)
                position = after
        if position < end:
            self._parse(data[position:], at, received)

    def _parse(self, data: bytes, at: float, received: Received) -> None:
        """All of it by pymavlink."""
        for message in self.parser.parse_buffer(data) or ():
            if message.get_type().startswith("UNKNOWN_"):
                message = self._newer.parse_buffer(message.get_msgbuf())[0]
            if message.get_type() == "BAD_DATA":
                self.bad += 1
            else:
                received.add(at, message, kind_of(message))


_stock, _own = dialect.MAVLink(None), newer.MAVLink(None)


def _decode(data: bytes) -> Any:
    """Return the message of a frame that has been checked; it carries its bytes in `get_msgbuf()`."""
    id = data[7] | data[8] << 8 | data[9] << 16
    return (_stock if id in dialect.mavlink_map else _own).decode(bytearray(data))

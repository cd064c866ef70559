"""Messages of protobuf services (Ai and later, Skycontroller 4).

Feature 133, generic, carries them. It has four messages of the form ``service id u16, number u16, payload binary``:
commands and events, with and without acknowledgement. The service id is a hash of the service's name; the payload is
the service's own message, a oneof of all its alternatives, with the one field `number` set (Olympe,
olympe/messaging/arsdk_messages.py). A declared message is a `Submessage` and a `wire.Message` at once, and is sent and
received as any other::

    COMMAND = Service("arsdk.camera.Command", "camera2.Command")

    @COMMAND.message("ResetZoom", 26)
    class ResetZoom(ProtobufMessage, frozen=True, kw_only=True):
        camera_id: Annotated[int, Field(1, UINT64)] = 0
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, TypeVar

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.protobuf import MalformedProtobuf, Submessage, chunk, parse, serialize, walk
from anafi_mav.arsdk.codec.wire import HEADER, Buffer, Direction, Message, MessageId, UnknownMessage
from anafi_mav.errors import LocalProtocolError

FIRST_ACKNOWLEDGED = 16
"""The lowest field number of a service that is sent with acknowledgement."""

ENVELOPE = struct.Struct("<HHI")
"""service id, number, length of the payload."""


class ProtobufMessage(Message, Submessage, frozen=True):
    """Base of the messages of a service."""

    SERVICE: ClassVar[ProtobufEnvelope]
    NUMBER: ClassVar[int]
    """The field of the service's message that this one is."""


ProtobufMessageT = TypeVar("ProtobufMessageT", bound=ProtobufMessage)


@dataclass(frozen=True)
class ProtobufEnvelope:
    """One of the two top-level messages of a .proto file, `Command` or `Event`.

    It carries all other messages. Named by its full name: "arsdk.camera.Command".
    """

    proto: str
    olympe: str
    """Its name in Olympe, which is what log files and people know: "camera2.Command"."""

    @cached_property
    def id(self) -> int:
        """The lower half of the name's Jenkins one-at-a-time hash."""
        value = 0
        for byte in self.proto.encode():
            value = value + byte & 0xFFFFFFFF
            value = value + (value << 10) & 0xFFFFFFFF
            value ^= value >> 6
        value = value + (value << 3) & 0xFFFFFFFF
        value ^= value >> 11
        return value + (value << 15) & 0xFFFF

    @property
    def direction(self) -> Direction:
        return Direction.COMMAND if self.proto.endswith(".Command") else Direction.EVENT

    def message(self, name: str, number: int) -> Callable[[type[ProtobufMessageT]], type[ProtobufMessageT]]:
        """Declare the message that is field `number` of this service."""

        def register(declared: type[ProtobufMessageT]) -> type[ProtobufMessageT]:
            if (self.id, number) in _MESSAGES:
                raise LocalProtocolError(f"{name}: {self.proto} has a field {number} already")
            acknowledged = number >= FIRST_ACKNOWLEDGED
            first = 1 if self.direction is Direction.COMMAND else 3
            declared.NAME, declared.SERVICE, declared.NUMBER = f"{self.olympe}.{name}", self, number
            declared.ID = MessageId(133, 0, first if acknowledged else first + 1)
            declared.BUFFER = Buffer.ACK if acknowledged else Buffer.NON_ACK
            declared.DIRECTION = self.direction
            _MESSAGES[self.id, number] = declared
            return declared

        return register


_MESSAGES: dict[tuple[int, int], type[ProtobufMessage]] = {}


class _Envelope:
    """Codec of one of generic's four messages.

    Service id and number identify the record inside.
    """

    def __init__(self, id: MessageId) -> None:
        self._id = id
        self._header = HEADER.pack(*id)

    def declared(self) -> Iterable[type[Message]]:
        return [message for message in _MESSAGES.values() if self._id == message.ID]

    def encode(self, message: Message) -> bytes:
        assert isinstance(message, ProtobufMessage)
        payload = chunk(message.NUMBER, serialize(message))
        return self._header + ENVELOPE.pack(message.SERVICE.id, message.NUMBER, len(payload)) + payload

    def decode(self, data: bytes) -> Message | UnknownMessage | None:
        start = HEADER.size + ENVELOPE.size
        if len(data) < start:
            return None
        service, number, size = ENVELOPE.unpack_from(data, HEADER.size)
        if len(data) < start + size:
            return None
        declared = _MESSAGES.get((service, number))
        message = None if declared is None else _open(declared, bytes(data[start : start + size]))
        if message is not None:
            return message
        return UnknownMessage(self._id, bytes(data[HEADER.size :]))


def _open(declared: type[ProtobufMessage], payload: bytes) -> ProtobufMessage | None:
    """The message in a payload, None if it is not there.

    Parts of it are merged by reading them as one.
    """
    try:
        parts = [raw for number, _, raw in walk(payload) if number == declared.NUMBER and isinstance(raw, bytes)]
    except MalformedProtobuf:
        return None
    return parse(declared, b"".join(parts)) if parts else None


for _number in (1, 2, 3, 4):
    wire.carry(MessageId(133, 0, _number), _Envelope(MessageId(133, 0, _number)))
del _number

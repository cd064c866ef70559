"""How an ARSDK command looks in bytes: the wire types, the message record and its codec.

A message is a frozen `msgspec.Struct` (decoding is hot: a hundred drones send ten thousand a second) whose
annotations carry the wire type::

    @event("ardrone3.PilotingState.AltitudeChanged", 1, 4, 8, Buffer.NON_ACK)
    class AltitudeChanged(Message, frozen=True):
        altitude: Annotated[float, F64]

Command bytes are ``project u8, class u8, command u16`` followed by the packed arguments, little-endian; an enum
travels as i32, a string NUL-terminated, a binary behind a u32 length (arsdk-ng libarsdk/src/arsdk_encoder.c).
Frames, acknowledgements and splitting are one floor up, in `frame` and `transport`.

A drone sends attitude, speed and height again and again, and most of them are replaced before they are read. These
events of values stay bytes until then (`Values`). All that are in a frame wait together, as one object, and are the
same few in the same places each time.
"""

from __future__ import annotations

import enum
import functools
import inspect
import struct
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Protocol, TypeAlias, TypeVar, final, get_args, get_origin

import msgspec

from anafi_mav.errors import LocalProtocolError


class MessageId(NamedTuple):
    """Parrot's three numbers of a message; features have class 0."""

    project: int
    cls: int
    command: int

    def __str__(self) -> str:
        return f"{self.project}-{self.cls}-{self.command}"


class Buffer(enum.Enum):
    """Which queue a message travels in (the XML's ``buffer`` attribute; ACK is its default)."""

    NON_ACK = "non_ack"
    ACK = "ack"
    HIGH_PRIO = "high_prio"
    LOW_PRIO = "low_prio"


class Direction(enum.Enum):
    """Direction of a message: command of a controller or event of a device."""

    COMMAND = "controller to device"
    EVENT = "device to controller"


class OpenEnum(enum.IntEnum):
    """An enum whose unknown values survive as integers: firmware is newer than our tables."""

    @classmethod
    def _missing_(cls, value: object) -> OpenEnum | None:
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"UNKNOWN_{value}"
        member._value_ = value
        return member


@dataclass(frozen=True)
class Scalar:
    """A number of fixed size.

    `code` is its letter in the struct module, `parrot` its name in Parrot's XML.
    """

    code: str
    parrot: str


@dataclass(frozen=True)
class Text:
    """UTF-8, NUL-terminated. Bytes that are no UTF-8 are replaced, never refused."""

    parrot: str = "string"


@dataclass(frozen=True)
class Blob:
    """u32 length, then as many bytes."""

    parrot: str = "binary"


@dataclass(frozen=True)
class Bits:
    """An integer in which bit n stands for value n of `names`."""

    base: Scalar
    names: type[enum.IntEnum]


U8, I8 = Scalar("B", "u8"), Scalar("b", "i8")
U16, I16 = Scalar("H", "u16"), Scalar("h", "i16")
U32, I32 = Scalar("I", "u32"), Scalar("i", "i32")
U64, I64 = Scalar("Q", "u64"), Scalar("q", "i64")
F32, F64 = Scalar("f", "float"), Scalar("d", "double")
ENUM = Scalar("i", "enum")
STRING, BINARY = Text(), Blob()

WireType = Scalar | Text | Blob | Bits

HEADER = struct.Struct("<BBH")
"""project, class, command."""


class Message(msgspec.Struct, frozen=True):
    """Base of every declared message."""

    NAME: ClassVar[str]
    """Parrot's own dotted name: "ardrone3.Piloting.PCMD", "rth.state"."""
    ID: ClassVar[MessageId]
    BUFFER: ClassVar[Buffer]
    DIRECTION: ClassVar[Direction]


@final
class UnknownMessage(msgspec.Struct, frozen=True):
    """A message that is not declared here.

    It is kept as received so that it can be logged, recorded or forwarded.
    """

    id: MessageId
    payload: bytes
    """The packed arguments, without the four header bytes."""


MessageT = TypeVar("MessageT", bound=Message)


class Codec(Protocol):
    """Encoder and decoder of the messages of one id."""

    def declared(self) -> Iterable[type[Message]]: ...

    def encode(self, message: Message) -> bytes: ...

    def decode(self, data: bytes) -> Message | UnknownMessage | None: ...


_CODECS: dict[bytes, Codec] = {}
"""By the four bytes of the header."""


class ValueEvent(NamedTuple):
    """Declaration of an event of values."""

    kind: type[Message]
    size: int
    """Bytes of its command; later firmware may append more."""
    name_size: int
    """Bytes that say what it replaces: the header, and the number of a camera or gimbal."""


_VALUES: dict[bytes, ValueEvent] = {}
"""By the four bytes of the header."""

MAX_LAYOUTS = 512
"""Layouts of one event, or of joined ones, that are remembered; a drone in operation sends a dozen."""

ValueReader: TypeAlias = Callable[[bytes], Any]
"""Decodes an event at a known place in bytes."""


def command(
    name: str, project: int, cls: int, number: int, buffer: Buffer = Buffer.ACK
) -> Callable[[type[MessageT]], type[MessageT]]:
    """Declare a message that a controller sends."""
    return _declare(Direction.COMMAND, name, MessageId(project, cls, number), buffer)


def event(
    name: str, project: int, cls: int, number: int, buffer: Buffer = Buffer.ACK
) -> Callable[[type[MessageT]], type[MessageT]]:
    """Declare a message that a device sends."""
    return _declare(Direction.EVENT, name, MessageId(project, cls, number), buffer)


def value(
    name: str, project: int, cls: int, number: int, *, of: str | None = None
) -> Callable[[type[MessageT]], type[MessageT]]:
    """Declare an event of values, which replaces the one before and has a fixed size.

    A device sends it without acknowledgement. `of`: the first argument, a byte, when it is the number of a camera or
    gimbal whose values these are.
    """
    declare = event(name, project, cls, number, Buffer.NON_ACK)

    def register(declared: type[MessageT]) -> type[MessageT]:
        fields = wire_fields(declared)
        scalars = [wire for _, wire, _ in fields if isinstance(wire, Scalar)]
        if len(scalars) < len(fields) or of not in (None, fields[0][0] if scalars[0] is U8 else None):
            raise LocalProtocolError(f"{name}: its arguments are not those of an event of values")
        size = struct.calcsize("<" + "".join(scalar.code for scalar in scalars))
        declare(declared)
        _VALUES[HEADER.pack(*declared.ID)] = ValueEvent(declared, HEADER.size + size, HEADER.size + (of is not None))
        return declared

    return register


def _declare(
    direction: Direction, name: str, id: MessageId, buffer: Buffer
) -> Callable[[type[MessageT]], type[MessageT]]:
    def register(declared: type[MessageT]) -> type[MessageT]:
        known = _CODECS.get(HEADER.pack(*id))
        if known is not None:
            owner = next(iter(known.declared()), None)
            raise LocalProtocolError(f"{name}: id {id} belongs to {owner.NAME if owner else known} already")
        declared.NAME, declared.ID, declared.BUFFER, declared.DIRECTION = name, id, buffer, direction
        carry(id, _Codec(declared))
        return declared

    return register


def carry(id: MessageId, codec: Codec) -> None:
    """Register the codec of an id.

    It is the codec of one message, or one that distinguishes the messages carried under this id.
    """
    _CODECS[HEADER.pack(*id)] = codec


def value_events() -> Mapping[bytes, ValueEvent]:
    """Return the events of values declared so far, by the four bytes of their headers."""
    return _VALUES


def value_reader(kind: type[MessageT], position: int) -> Callable[[bytes], MessageT]:
    """Return the reader of an event of values whose command begins at a position.

    The bytes that it reads have to be long enough.
    """
    codec = _CODECS[HEADER.pack(*kind.ID)]
    assert isinstance(codec, _Codec)
    return codec.reader(position)


def declared_messages() -> Iterator[type[Message]]:
    """Return every message class declared so far.

    Import `anafi_mav.arsdk.messages` to have all of them.
    """
    return (message for codec in _CODECS.values() for message in codec.declared())


def wire_fields(message: type[Message]) -> list[tuple[str, WireType, type]]:
    """(Parrot's argument name, wire type, Python type) of each argument in wire order."""
    hints = {
        name: _evaluated(base.__module__, annotation)
        for base in reversed(message.__mro__)
        if issubclass(base, Message) and base is not Message
        for name, annotation in inspect.get_annotations(base).items()
    }
    fields: list[tuple[str, WireType, type]] = []
    for name in message.__struct_fields__:
        hint = hints[name]
        wire = [extra for extra in get_args(hint)[1:] if isinstance(extra, Scalar | Text | Blob | Bits)]
        if get_origin(hint) is not Annotated or len(wire) != 1:
            raise LocalProtocolError(f"{message.__name__}.{name}: annotate it with one wire type")
        fields.append((name, wire[0], get_args(hint)[0]))
    return fields


@functools.cache
def _evaluated(module: str, annotation: object) -> Any:
    """Return what an annotation of a module means.

    `typing.get_type_hints` compiles each annotation of each class, and those of `Message` every time: that took a
    seventh of the start of the program.
    """
    return eval(annotation, vars(sys.modules[module])) if isinstance(annotation, str) else annotation


class _Codec:
    """Packs and unpacks one message class; one struct call when every argument has a fixed size."""

    __slots__ = ("_converters", "_header", "_parts", "_size", "_struct", "message")

    def __init__(self, message: type[Message]) -> None:
        self.message: type[Message] = message
        self._header = HEADER.pack(*message.ID)
        fields = wire_fields(message)
        self._parts: list[struct.Struct | Text | Blob] = []
        codes: list[str] = []
        for _, wire, _ in fields:
            if isinstance(wire, Scalar | Bits):
                code = wire.base.code if isinstance(wire, Bits) else wire.code
                codes.append(code)
                self._parts.append(struct.Struct("<" + code))
            else:
                self._parts.append(wire)
        fixed = len(codes) == len(fields)
        self._struct = struct.Struct("<" + "".join(codes)) if fixed else None
        self._size = HEADER.size + (self._struct.size if self._struct is not None else 0)
        self._converters: list[tuple[int, type[OpenEnum], dict[int, OpenEnum]]] = [
            (index, python, {int(member): member for member in python})
            for index, (_, _, python) in enumerate(fields)
            if issubclass(python, OpenEnum)
        ]
        """(place among the values, enum, its members by number: an enum called takes four times as long)."""

    def declared(self) -> Iterable[type[Message]]:
        return (self.message,)

    def encode(self, message: Message) -> bytes:
        values = msgspec.structs.astuple(message)
        try:
            if self._struct is not None:
                return self._header + self._struct.pack(*values)
            pieces = [self._header]
            for part, value in zip(self._parts, values, strict=True):
                if isinstance(part, struct.Struct):
                    pieces.append(part.pack(value))
                elif isinstance(part, Text):
                    if "\0" in value:
                        raise ValueError("a string holds NUL, which ends it on the wire")
                    pieces.append(value.encode() + b"\0")
                else:
                    pieces.append(struct.pack("<I", len(value)) + bytes(value))
            return b"".join(pieces)
        except (struct.error, TypeError, ValueError, OverflowError) as error:
            raise LocalProtocolError(f"cannot encode {message!r}: {error}") from error

    def decode(self, data: bytes) -> Message | None:
        values: list[Any]
        if self._struct is not None:
            if len(data) < self._size:
                return None
            values = list(self._struct.unpack_from(data, HEADER.size))
        else:
            values = []
            position = HEADER.size
            for part in self._parts:
                if isinstance(part, struct.Struct):
                    if len(data) < position + part.size:
                        return None
                    values += part.unpack_from(data, position)
                    position += part.size
                elif isinstance(part, Text):
                    end = data.find(b"\0", position)
                    if end < 0:
                        return None
                    values.append(data[position:end].decode(errors="replace"))
                    position = end + 1
                else:
                    if len(data) < position + 4:
                        return None
                    (size,) = struct.unpack_from("<I", data, position)
                    position += 4
                    if len(data) < position + size:
                        return None
                    values.append(data[position : position + size])
                    position += size
        self._convert(values)
        return self.message(*values)

    def reader(self, position: int) -> Callable[[bytes], Any]:
        """Return the reader of a message of fixed size whose command begins at a position.

        The bytes that it reads have to be long enough.
        """
        assert self._struct is not None
        message, unpack, place = self.message, self._struct.unpack_from, position + HEADER.size

        def read(data: bytes) -> Message:
            return message(*unpack(data, place))

        def read_enums(data: bytes) -> Message:
            values = list(unpack(data, place))
            self._convert(values)
            return message(*values)

        return read_enums if self._converters else read

    def _convert(self, values: list[Any]) -> None:
        """Put the members of enums in place of their numbers."""
        for index, python, members in self._converters:
            member = members.get(values[index])
            values[index] = python(values[index]) if member is None else member


def encode(message: Message | UnknownMessage) -> bytes:
    """The command bytes of a message.

    Raises `LocalProtocolError` when an argument does not fit its wire type.
    """
    if type(message) is UnknownMessage:  # not by isinstance, which takes longer than the lookup below
        return HEADER.pack(*message.id) + message.payload
    return _CODECS[HEADER.pack(*message.ID)].encode(message)


def decode(data: bytes) -> Message | UnknownMessage | None:
    """Decode the message in these command bytes; None when they are too short.

    They are too short when they end before the last argument of the message that their header names. Bytes after the
    last argument are ignored: later firmware appends arguments to old messages.
    """
    if len(data) < HEADER.size:
        return None
    codec = _CODECS.get(data[: HEADER.size])
    if codec is None:
        return UnknownMessage(MessageId(*HEADER.unpack_from(data)), bytes(data[HEADER.size :]))
    return codec.decode(data)


class ValueLayout:
    """Places of events of values in some bytes, one of each kind.

    One object serves all bytes with these events in the same places.
    """

    __slots__ = ("_readers", "kinds", "places")

    def __init__(self, places: Mapping[type[Message], slice]) -> None:
        """`places`: the command bytes of each kind, in their sequence."""
        self.places = places
        self.kinds = tuple(places)
        self._readers: dict[int, tuple[Mapping[type[Message], Any], Sequence[tuple[Any, ValueReader]]]] = {}

    def shares(self, other: ValueLayout) -> bool:
        """Return True if both have events of one kind."""
        return not self.places.keys().isdisjoint(other.kinds)

    def readers(self, table: Mapping[type[Message], Any]) -> Sequence[tuple[Any, ValueReader]]:
        """Return the entries of a table for these events, each with the reader of its event."""
        known = self._readers.get(id(table))
        if known is None:
            entries = [
                (table[kind], value_reader(kind, place.start)) for kind, place in self.places.items() if kind in table
            ]
            known = self._readers[id(table)] = table, entries  # a kept table keeps its identity
        return known[1]


@final
class Values(msgspec.Struct, frozen=True, gc=False):
    """Events of values that arrived together, one of each kind, not decoded yet."""

    layout: ValueLayout
    data: bytes

    def __contains__(self, kind: object) -> bool:
        return kind in self.layout.places

    def command(self, kind: type[Message]) -> bytes:
        """Return the command bytes of a kind that is among them, as for `decode`."""
        return self.data[self.layout.places[kind]]

    def message(self, kind: type[MessageT]) -> MessageT:
        """Decode the event of a kind that is among them."""
        return value_reader(kind, self.layout.places[kind].start)(self.data)

    def messages(self) -> Iterator[Message]:
        """Decode them."""
        return map(self.message, self.layout.kinds)

    def split(self) -> Iterator[Values]:
        """Return them one by one."""
        return (Values(_layout_of(command), command) for command in map(self.command, self.layout.kinds))


Received: TypeAlias = Message | UnknownMessage | Values

_layouts: dict[tuple[bytes, int], ValueLayout] = {}
"""Layouts of one event, by the bytes that say what it replaces, and its length."""

_joined: dict[tuple[ValueLayout, ...], ValueLayout] = {}
"""By the layouts of each."""


def receive(commands: Iterable[bytes]) -> list[Received]:
    """Decode the messages in these command bytes, but for events of values.

    Those that are too short are left out, as `decode` returns None for them.
    """
    messages: list[Received] = []
    known = _VALUES
    for data in commands:
        value = known.get(data[: HEADER.size])
        if value is None:
            if (message := decode(data)) is not None:
                messages.append(message)
        elif len(data) >= value.size:
            messages.append(Values(_layout_of(data), data))
    return messages


def join(values: Sequence[Values]) -> Values:
    """Return events that arrived one after another, of which no kind is repeated, as one object."""
    if len(values) == 1:
        return values[0]
    layouts = tuple(each.layout for each in values)
    layout = _joined.get(layouts)
    if layout is None:
        places: dict[type[Message], slice] = {}
        begin = 0
        for each in values:
            for kind, place in each.layout.places.items():
                places[kind] = slice(begin + place.start, begin + place.stop)
            begin += len(each.data)
        if len(_joined) >= MAX_LAYOUTS:
            _joined.clear()
        layout = _joined[layouts] = ValueLayout(places)
    return Values(layout, b"".join([each.data for each in values]))


def unpacked(received: Iterable[Received]) -> Iterator[Message | UnknownMessage]:
    """Return received messages, decoded."""
    for message in received:
        if isinstance(message, Values):
            yield from message.messages()
        else:
            yield message


def _layout_of(command: bytes) -> ValueLayout:
    """Return the layout of one event of values."""
    value = _VALUES[command[: HEADER.size]]
    key = command[: value.name_size], len(command)
    layout = _layouts.get(key)
    if layout is None:
        if len(_layouts) >= MAX_LAYOUTS:
            _layouts.clear()
        layout = _layouts[key] = ValueLayout({value.kind: slice(0, len(command))})
    return layout

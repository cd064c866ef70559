"""Protocol buffers (proto3, and of it what Parrot uses): records and their codec.

A record is a frozen `msgspec.Struct` whose annotations carry number and type of each field, as the annotations of
`wire` do; every field has a default, so an absent one needs no case of its own::

    class Config(Record, frozen=True, kw_only=True):
        SELECTED: ClassVar[int] = 1
        camera_mode: Annotated[CameraMode | None, Field(2, ENUM)] = None

* ``X | None`` is a field whose presence shows: a message, a wrapper (`Wrapped`), a member of a oneof.
* ``tuple[X, ...]`` is repeated, ``dict[K, V]`` a map (`Map`).
* `SELECTED` is the number of Parrot's ``map<uint32, Empty> selected_fields``, which lists the fields that count. It
  is no field of the record: what is not None is listed when the record is sent, and what a peer did not list is None
  when it arrives. A message that is listed and not there is None too, as Olympe has it.
"""

from __future__ import annotations

import enum
import struct
import types
from collections.abc import Iterator
from dataclasses import dataclass
from operator import index
from typing import Annotated, Any, ClassVar, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec

from anafi_mav.errors import LocalProtocolError

MAX_NESTING = 16
"""How deep messages may stand in one another. Parrot's deepest has 5 levels; ours and a peer's stack are bounded."""

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5


class FieldType(enum.Enum):
    """The type of a field, by its name in a .proto file; all messages are RECORD."""

    INT32 = "int32"
    INT64 = "int64"
    UINT32 = "uint32"
    UINT64 = "uint64"
    SINT32 = "sint32"
    SINT64 = "sint64"
    BOOL = "bool"
    ENUM = "enum"
    FIXED32 = "fixed32"
    SFIXED32 = "sfixed32"
    FLOAT = "float"
    FIXED64 = "fixed64"
    SFIXED64 = "sfixed64"
    DOUBLE = "double"
    STRING = "string"
    BYTES = "bytes"
    RECORD = "message"


INT32, INT64, UINT32, UINT64, SINT32, SINT64 = (
    FieldType.INT32,
    FieldType.INT64,
    FieldType.UINT32,
    FieldType.UINT64,
    FieldType.SINT32,
    FieldType.SINT64,
)
BOOL, ENUM, FLOAT, DOUBLE, STRING, BYTES, RECORD = (
    FieldType.BOOL,
    FieldType.ENUM,
    FieldType.FLOAT,
    FieldType.DOUBLE,
    FieldType.STRING,
    FieldType.BYTES,
    FieldType.RECORD,
)

_FIXED = {
    FieldType.FIXED32: struct.Struct("<I"),
    FieldType.SFIXED32: struct.Struct("<i"),
    FieldType.FLOAT: struct.Struct("<f"),
    FieldType.FIXED64: struct.Struct("<Q"),
    FieldType.SFIXED64: struct.Struct("<q"),
    FieldType.DOUBLE: struct.Struct("<d"),
}
_RANGES = {
    FieldType.INT32: (-(1 << 31), (1 << 31) - 1),
    FieldType.SINT32: (-(1 << 31), (1 << 31) - 1),
    FieldType.ENUM: (-(1 << 31), (1 << 31) - 1),
    FieldType.INT64: (-(1 << 63), (1 << 63) - 1),
    FieldType.SINT64: (-(1 << 63), (1 << 63) - 1),
    FieldType.UINT32: (0, (1 << 32) - 1),
    FieldType.UINT64: (0, (1 << 64) - 1),
    FieldType.BOOL: (0, 1),
}


@dataclass(frozen=True)
class Field:
    """Number and type of a field, and the oneof it belongs to if any."""

    number: int
    kind: FieldType
    oneof: str = ""


@dataclass(frozen=True)
class Wrapped:
    """A google.protobuf wrapper (DoubleValue, StringValue, …): a scalar whose presence shows."""

    number: int
    kind: FieldType
    oneof: ClassVar[str] = ""


@dataclass(frozen=True)
class Map:
    """A map field: the types of its key and of its value."""

    number: int
    key: FieldType
    kind: FieldType
    oneof: ClassVar[str] = ""


class Submessage(msgspec.Struct, frozen=True):
    """Base of the messages that stand inside others."""

    SELECTED: ClassVar[int] = 0
    """Number of the field `selected_fields`; 0: the message has none."""


class Empty(Submessage, frozen=True):
    """google.protobuf.Empty."""


RecordT = TypeVar("RecordT", bound=Submessage)


# ------------------------------------------------------------------------------------------------ how a class is laid


@dataclass(frozen=True)
class FieldPlan:
    """A field of a record class with everything its annotation says."""

    name: str
    wire: Field | Wrapped | Map
    python: type
    """The class of one element."""
    repeated: bool
    optional: bool

    @property
    def number(self) -> int:
        return self.wire.number


@dataclass(frozen=True)
class _Plan:
    fields: tuple[FieldPlan, ...]
    """By rising number, the order they are sent in."""
    by_number: dict[int, FieldPlan]
    oneofs: dict[str, tuple[str, ...]]


def record_fields(record: type[Submessage]) -> tuple[FieldPlan, ...]:
    """The fields of a record class by rising number."""
    return _plan(record).fields


_PLANS: dict[type[Submessage], _Plan] = {}


def _plan(record: type[Submessage]) -> _Plan:
    plan = _PLANS.get(record)
    if plan is None:
        plan = _PLANS[record] = _make_plan(record)
    return plan


def _make_plan(record: type[Submessage]) -> _Plan:
    hints = get_type_hints(record, include_extras=True)
    fields = []
    for name in record.__struct_fields__:
        hint = hints[name]
        extras = [extra for extra in get_args(hint)[1:] if isinstance(extra, Field | Wrapped | Map)]
        if get_origin(hint) is not Annotated or len(extras) != 1:
            raise LocalProtocolError(f"{record.__name__}.{name}: annotate it with one Field, Wrapped or Map")
        fields.append(_field_plan(name, extras[0], get_args(hint)[0]))
    fields.sort(key=lambda field: field.number)
    by_number = {field.number: field for field in fields}
    if len(by_number) != len(fields) or record.SELECTED in by_number:
        raise LocalProtocolError(f"{record.__name__}: a field number stands twice")
    oneofs: dict[str, tuple[str, ...]] = {}
    for field in fields:
        if field.wire.oneof:
            oneofs[field.wire.oneof] = (*oneofs.get(field.wire.oneof, ()), field.name)
    return _Plan(tuple(fields), by_number, oneofs)


def _field_plan(name: str, annotation: Field | Wrapped | Map, hint: Any) -> FieldPlan:
    optional = False
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (arg for arg in get_args(hint) if arg is not type(None))
        optional = True
    repeated = get_origin(hint) is tuple
    if repeated:
        hint = get_args(hint)[0]
    elif isinstance(annotation, Map):
        hint = get_args(hint)[1]
    return FieldPlan(name, annotation, hint, repeated, optional)


# ------------------------------------------------------------------------------------------------------ to bytes


def serialize(record: Submessage) -> bytes:
    """The bytes of a record. Raises `LocalProtocolError` when a value does not fit its field."""
    try:
        return _serialize(record, 0)
    except (struct.error, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise LocalProtocolError(f"cannot encode {record!r}: {error}") from error


def _serialize(record: Submessage, depth: int) -> bytes:
    if depth > MAX_NESTING:
        raise ValueError(f"more than {MAX_NESTING} messages in one another")
    plan = _plan(type(record))
    for oneof, names in plan.oneofs.items():
        if sum(getattr(record, name) is not None for name in names) > 1:
            raise ValueError(f"more than one of {oneof} is set")
    pieces: list[tuple[int, bytes]] = []
    selected: list[int] = []
    for field in plan.fields:
        value = getattr(record, field.name)
        if value is None:
            if not field.optional:
                raise ValueError(f"{field.name} is None")
            continue
        selected.append(field.number)
        pieces.append((field.number, _field_bytes(field, value, bool(record.SELECTED), depth)))
    if record.SELECTED:
        listed = b"".join(
            chunk(record.SELECTED, b"\x08" + _varint(number) + b"\x12\x00")  # key = number, value = Empty
            for number in selected
        )
        pieces.append((record.SELECTED, listed))
        pieces.sort()
    return b"".join(piece for _, piece in pieces)


def _field_bytes(field: FieldPlan, value: Any, selected: bool, depth: int) -> bytes:
    spec, number, kind = field.wire, field.number, field.wire.kind
    if isinstance(spec, Map):
        return b"".join(
            chunk(number, _element(1, spec.key, key, int, depth) + _element(2, kind, one, field.python, depth))
            for key, one in value.items()
        )
    if field.repeated:
        if kind in (FieldType.STRING, FieldType.BYTES, FieldType.RECORD):
            return b"".join(_element(number, kind, one, field.python, depth) for one in value)
        packed = b"".join(_scalar(kind, one) for one in value)
        return chunk(number, packed) if packed else b""
    if isinstance(spec, Wrapped):
        inner = _element(1, kind, value, field.python, depth)
        return chunk(number, b"" if _is_default(kind, value) else inner)
    # A scalar at its default stays away, except where its being there is what it says.
    if kind is not FieldType.RECORD and (selected or not field.optional) and _is_default(kind, value):
        _scalar(kind, value)
        return b""
    return _element(number, kind, value, field.python, depth)


def _is_default(kind: FieldType, value: Any) -> bool:
    if kind in _FIXED:
        return not any(_FIXED[kind].pack(value))  # minus zero is no default
    return not value


def _element(number: int, kind: FieldType, value: Any, python: type, depth: int) -> bytes:
    if kind is FieldType.RECORD:
        if not isinstance(value, python) or not isinstance(value, Submessage):
            raise TypeError(f"{value!r} is no {python.__name__}")
        return chunk(number, _serialize(value, depth + 1))
    if kind in (FieldType.STRING, FieldType.BYTES):
        return chunk(number, _scalar(kind, value))
    return _varint(number << 3 | _wire_type(kind)) + _scalar(kind, value)


def _scalar(kind: FieldType, value: Any) -> bytes:
    if kind in _FIXED:
        return _FIXED[kind].pack(value)
    if kind is FieldType.STRING:
        if not isinstance(value, str):
            raise TypeError(f"{value!r} is no text")
        return value.encode()
    if kind is FieldType.BYTES:
        if not isinstance(value, bytes | bytearray | memoryview):
            raise TypeError(f"{value!r} is no bytes")
        return bytes(value)
    number = index(value)
    low, high = _RANGES[kind]
    if not low <= number <= high:
        raise ValueError(f"{number} is no {kind.value}")
    if kind in (FieldType.SINT32, FieldType.SINT64):
        number = number << 1 if number >= 0 else ~(number << 1)
    return _varint(number & (1 << 64) - 1)


def _wire_type(kind: FieldType) -> int:
    if kind in (FieldType.STRING, FieldType.BYTES, FieldType.RECORD):
        return _BYTES
    fixed = _FIXED.get(kind)
    if fixed is None:
        return _VARINT
    return _FIXED32 if fixed.size == 4 else _FIXED64


def chunk(number: int, content: bytes) -> bytes:
    """A field whose content has a length: text, bytes, a message, packed numbers."""
    return _varint(number << 3 | _BYTES) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    result = bytearray()
    while value > 0x7F:
        result.append(value & 0x7F | 0x80)
        value >>= 7
    result.append(value)
    return bytes(result)


# ---------------------------------------------------------------------------------------------------- from bytes


class MalformedProtobuf(Exception):
    """Bytes that are no protocol buffer. It never leaves this package."""


def parse(record: type[RecordT], data: bytes) -> RecordT | None:
    """The record in these bytes, None if they are no protocol buffer.

    Fields of unknown number, or whose encoding is not that of their type, are skipped; unknown enum values stay.
    """
    try:
        return _parse(record, data, 0)
    except MalformedProtobuf:
        return None


def _parse(record: type[RecordT], data: bytes, depth: int) -> RecordT:
    if depth > MAX_NESTING:
        raise MalformedProtobuf
    plan = _plan(record)
    values: dict[str, Any] = {}
    parts: dict[str, bytes] = {}
    selected: set[int] = set()
    for number, wire_type, raw in walk(data):
        field = plan.by_number.get(number)
        if field is None:
            if number == record.SELECTED and record.SELECTED and isinstance(raw, bytes):
                selected.add(_entry(raw, FieldType.UINT32)[0])
            continue
        spec, kind, name = field.wire, field.wire.kind, field.name
        if field.repeated:
            if wire_type == _wire_type(kind):
                values.setdefault(name, []).append(_value(kind, raw, field.python, depth))
            elif isinstance(raw, bytes):
                values.setdefault(name, []).extend(_value(kind, one, field.python, depth) for one in _packed(kind, raw))
            continue
        whole = isinstance(spec, Wrapped | Map) or kind is FieldType.RECORD
        if wire_type != (_BYTES if whole else _wire_type(kind)):
            continue
        if isinstance(spec, Map):
            assert isinstance(raw, bytes)
            key, value = _entry(raw, spec.key, kind)
            if value is None:
                value = b"" if _wire_type(kind) == _BYTES else 0 if kind not in _FIXED else bytes(_FIXED[kind].size)
            values.setdefault(name, {})[key] = _value(kind, value, field.python, depth)
            continue
        for other in plan.oneofs.get(spec.oneof, ()):
            if other != name:
                values.pop(other, None)
                parts.pop(other, None)
        if whole:
            # Parts of one message are merged by reading them as one.
            assert isinstance(raw, bytes)
            parts[name] = parts.get(name, b"") + raw
        else:
            values[name] = _value(kind, raw, field.python, depth)
    for name, part in parts.items():
        field = next(field for field in plan.fields if field.name == name)
        values[name] = (
            _unwrap(field, part) if isinstance(field.wire, Wrapped) else _parse(field.python, part, depth + 1)
        )
    for field in plan.fields:
        if field.repeated and field.name in values:
            values[field.name] = tuple(values[field.name])
    if record.SELECTED:
        values = {
            field.name: values[field.name] if field.name in values else _absent(field)
            for field in plan.fields
            if field.number in selected
        }
    return record(**values)


def _absent(field: FieldPlan) -> Any:
    """Return the default of a field that its message lists as meaningful and does not carry."""
    if field.repeated:
        return ()
    if isinstance(field.wire, Map):
        return {}
    if isinstance(field.wire, Wrapped) or field.wire.kind is FieldType.RECORD or field.wire.oneof:
        return None
    return field.python(0) if issubclass(field.python, int | float) else field.python()


def _unwrap(field: FieldPlan, data: bytes) -> Any:
    kind = field.wire.kind
    value = field.python()
    for number, wire_type, raw in walk(data):
        if number == 1 and wire_type == _wire_type(kind):
            value = _value(kind, raw, field.python, 0)
    return value


def _entry(
    data: bytes, key_kind: FieldType, value_kind: FieldType = FieldType.RECORD
) -> tuple[Any, int | bytes | None]:
    """Key and raw value of an entry of a map; a missing key is its type's default."""
    key: Any = "" if key_kind is FieldType.STRING else 0
    value: int | bytes | None = None
    for number, wire_type, raw in walk(data):
        if number == 1 and wire_type == _wire_type(key_kind):
            key = _value(key_kind, raw, str if key_kind is FieldType.STRING else int, 0)
        elif number == 2 and wire_type == _wire_type(value_kind):
            value = raw
    return key, value


def _packed(kind: FieldType, data: bytes) -> Iterator[int | bytes]:
    wire_type = _wire_type(kind)
    if wire_type == _BYTES:
        raise MalformedProtobuf
    position = 0
    while position < len(data):
        if wire_type == _VARINT:
            number, position = _read_varint(data, position)
            yield number
        else:
            size = 4 if wire_type == _FIXED32 else 8
            if position + size > len(data):
                raise MalformedProtobuf
            yield data[position : position + size]
            position += size


def _value(kind: FieldType, raw: int | bytes, python: type, depth: int) -> Any:
    if isinstance(raw, bytes):
        if kind in _FIXED:
            return _FIXED[kind].unpack(raw)[0]
        if kind is FieldType.STRING:
            return raw.decode(errors="replace")
        return raw if kind is FieldType.BYTES else _parse(python, raw, depth + 1)
    if kind is FieldType.BOOL:
        return bool(raw)
    if kind in (FieldType.INT32, FieldType.ENUM):
        number = (raw & 0xFFFFFFFF ^ 1 << 31) - (1 << 31)
        return python(number) if kind is FieldType.ENUM else number
    if kind is FieldType.INT64:
        return (raw ^ 1 << 63) - (1 << 63)
    if kind in (FieldType.UINT32, FieldType.SINT32):
        raw &= 0xFFFFFFFF
    return raw >> 1 ^ -(raw & 1) if kind in (FieldType.SINT32, FieldType.SINT64) else raw


def walk(data: bytes) -> Iterator[tuple[int, int, int | bytes]]:
    """(number, wire type, value) of each field: an integer of a varint, else the bytes.

    Raises `MalformedProtobuf`.
    """
    position, end = 0, len(data)
    while position < end:
        tag, position = _read_varint(data, position)
        number, wire_type = tag >> 3, tag & 7
        if not 0 < number < 1 << 29:
            raise MalformedProtobuf
        if wire_type == _VARINT:
            value, position = _read_varint(data, position)
            yield number, wire_type, value
            continue
        if wire_type == _BYTES:
            size, position = _read_varint(data, position)
        elif wire_type in (_FIXED32, _FIXED64):
            size = 4 if wire_type == _FIXED32 else 8
        else:
            raise MalformedProtobuf  # groups are of proto2, the others are undefined
        if size > end - position:
            raise MalformedProtobuf
        yield number, wire_type, data[position : position + size]
        position += size


def _read_varint(data: bytes, position: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if position >= len(data):
            raise MalformedProtobuf
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & (1 << 64) - 1, position
    raise MalformedProtobuf

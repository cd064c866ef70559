"""Events of a drone with any values: the largest numbers, NaN, unknown enums, long texts and texts that mean something.

`random_event` makes one of a declared kind.
"""

from __future__ import annotations

import math
import random
from typing import Any

import anafi_mav.arsdk.messages as tables
from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.envelope import ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import FieldPlan, FieldType, Map, Submessage, record_fields
from anafi_mav.arsdk.codec.wire import Bits, Blob, Direction, Message, OpenEnum, Scalar, Text
from anafi_mav.arsdk.messages.common import Disconnection

assert tables.__doc__  # every message is declared

EVENTS = tuple(
    message
    for message in wire.declared_messages()
    if message.DIRECTION is Direction.EVENT and message is not Disconnection
)
"""All but the one that ends the connection."""

TEXTS = (
    *("", "PI04", "x" * 300, "9" * 5000, "²", "ü" * 60, "\N{REPLACEMENT CHARACTER}" * 30),
    *("\x1b[2J", "[red]", "a;b;c", "%s{}", "../../x", "20261301T999999+9999"),
)
REALS = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-40, 1e30, -1e30, 3.4e38, -3.4e38, 48.8, 2.3, 500.0)
HUGE = 1e300
"""Of a double only."""

MAX_DEPTH = 5

_RANGES = {
    code: (-(1 << 8 * size - 1), (1 << 8 * size - 1) - 1) for code, size in zip("bhiq", (1, 2, 4, 8), strict=True)
}
_RANGES |= {code: (0, (1 << 8 * size) - 1) for code, size in zip("BHIQ", (1, 2, 4, 8), strict=True)}
_INTEGERS = {
    FieldType.INT32: "i",
    FieldType.SINT32: "i",
    FieldType.ENUM: "i",
    FieldType.UINT32: "I",
    FieldType.INT64: "q",
    FieldType.SINT64: "q",
    FieldType.UINT64: "Q",
}


def random_event(kind: type[Message], source: random.Random) -> Message:
    """Return an event of this kind."""
    if issubclass(kind, ProtobufMessage):
        return _record(kind, source, 0)
    arguments: list[Any] = []
    for _, type, python in wire.wire_fields(kind):
        if isinstance(type, Text):
            arguments.append(source.choice(TEXTS))
        elif isinstance(type, Blob):
            arguments.append(source.randbytes(source.randrange(40)))
        else:
            scalar = type.base if isinstance(type, Bits) else type
            arguments.append(_number(scalar, python, source))
    return kind(*arguments)


def _number(scalar: Scalar, python: type, source: random.Random) -> Any:
    if scalar.code in "fd":
        return _real(source, is_double=scalar.code == "d")
    return _integer(scalar.code, python, source)


def _real(source: random.Random, *, is_double: bool) -> float:
    return source.choice((*REALS, source.uniform(-200.0, 200.0), *([HUGE, -HUGE] if is_double else [])))


def _integer(code: str, python: type, source: random.Random) -> Any:
    low, high = _RANGES[code]
    number = source.choice((low, high, 0, 1, max(low, -1), source.randint(0, 5), source.randint(low, high)))
    return python(number) if issubclass(python, OpenEnum) else number


def _record(kind: type[Any], source: random.Random, depth: int) -> Any:
    values: dict[str, Any] = {}
    oneofs: set[str] = set()
    for field in record_fields(kind):
        is_record = field.wire.kind is FieldType.RECORD
        if field.wire.oneof in oneofs or (
            field.optional and (source.random() < 0.4 or (is_record and depth > MAX_DEPTH))
        ):
            continue
        if field.wire.oneof:
            oneofs.add(field.wire.oneof)
        count = source.randrange(4)
        if field.repeated:
            values[field.name] = tuple(_element(field, source, depth) for _ in range(count))
        elif isinstance(field.wire, Map):
            values[field.name] = {
                _integer("i", int, source) & 0x7FFFFFFF: _element(field, source, depth) for _ in range(count)
            }
        else:
            values[field.name] = _element(field, source, depth)
    return kind(**values)


def _element(field: FieldPlan, source: random.Random, depth: int) -> Any:
    kind = field.wire.kind
    if issubclass(field.python, Submessage):
        return _record(field.python, source, depth + 1)
    if kind is FieldType.STRING:
        return source.choice(TEXTS)
    if kind is FieldType.BYTES:
        return source.randbytes(8)
    if kind is FieldType.BOOL:
        return source.random() < 0.5
    if kind in _INTEGERS:
        return _integer(_INTEGERS[kind], field.python, source)
    return _real(source, is_double=kind is FieldType.DOUBLE)

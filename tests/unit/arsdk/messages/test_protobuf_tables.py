"""Our protobuf records against Parrot's own descriptors and Google's codec, which the parrot-olympe wheel brings."""

from __future__ import annotations

import importlib
import importlib.util
import json
import random
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import anafi_mav.arsdk.messages
from anafi_mav.arsdk.codec import protobuf, wire
from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import Empty, FieldPlan, FieldType, Map, Submessage, Wrapped

FILES = [
    "antiflicker",
    "camera2",
    "connectivity",
    "controller_network",
    "developer",
    "device_manager",
    "logsync",
    "network",
    "piloting",
    "pointnfly",
    "privacy",
    "storage",
]
"""Parrot's .proto files whose services are declared whole."""


def find_folder() -> Path | None:
    spec = importlib.util.find_spec("olympe")
    for place in (spec.submodule_search_locations or []) if spec else []:
        folder = Path(place).parent / "olympe_protobuf"
        if folder.is_dir():
            return folder
    return None


FOLDER = find_folder()
pytestmark = pytest.mark.skipif(
    FOLDER is None, reason="Parrot's descriptors are not installed: package parrot-olympe (x86-64 Linux, Python < 3.12)"
)

MESSAGES = [
    message
    for message in wire.declared_messages()
    if issubclass(message, ProtobufMessage) and message.__module__.startswith(anafi_mav.arsdk.messages.__name__)
]
by_name = pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.NAME)


@pytest.fixture(scope="module")
def services() -> dict[str, Any]:
    """Google's class of each service's message, by full name."""
    # The folder's packages are named as some of this environment's; they are found last and not left behind.
    sys.path.append(str(FOLDER))
    try:
        modules = [importlib.import_module(f"arsdk.{name}_pb2") for name in FILES]
    finally:
        sys.path.remove(str(FOLDER))
    return {
        service.DESCRIPTOR.full_name: service
        for module in modules
        for service in (getattr(module, "Command", None), getattr(module, "Event", None))
        if service is not None
    }


def described(message: type[ProtobufMessage], services: dict[str, Any]) -> Any:
    return services[message.SERVICE.proto].DESCRIPTOR.fields_by_number[message.NUMBER]


# ---------------------------------------------------------------------------------------------------------- the tables


def compare(ours: type[Submessage], theirs: Any, seen: set[tuple[str, str]]) -> None:
    """A record class and a descriptor, and everything below them."""
    pair = (ours.__qualname__, theirs.full_name)
    if pair in seen:
        return
    seen.add(pair)
    numbers = {field.name: field.number for field in theirs.fields}
    assert numbers.pop("selected_fields", 0) == ours.SELECTED, pair
    fields = protobuf.record_fields(ours)
    assert {field.name: field.number for field in fields} == numbers, pair
    for field in fields:
        compare_field(field, theirs.fields_by_number[field.number], bool(ours.SELECTED), seen)


def compare_field(field: FieldPlan, theirs: Any, selected: bool, seen: set[tuple[str, str]]) -> None:
    spec, where = field.wire, theirs.full_name
    inner = theirs.message_type
    if isinstance(spec, Map):
        assert inner is not None, where
        assert inner.GetOptions().map_entry, where
        assert spec.key.value == type_name(inner.fields_by_name["key"]), where
        assert field.optional is selected, where
        theirs = inner.fields_by_name["value"]
    elif isinstance(spec, Wrapped):
        assert inner is not None, where
        assert inner.file.name == "google/protobuf/wrappers.proto", where
        assert field.optional, where
        assert not field.repeated, where
        theirs = inner.fields_by_name["value"]
    else:
        assert field.repeated is (theirs.label == theirs.LABEL_REPEATED), where
        assert spec.oneof == (theirs.containing_oneof.name if theirs.containing_oneof else ""), where
        shows = spec.kind is FieldType.RECORD and not field.repeated
        assert field.optional is (selected or bool(spec.oneof) or shows), where
    assert spec.kind.value == type_name(theirs), where
    if spec.kind is FieldType.ENUM:
        compare_enum(field.python, theirs.enum_type)
    elif spec.kind is FieldType.RECORD:
        assert issubclass(field.python, Submessage)
        if theirs.message_type.full_name == "google.protobuf.Empty":
            assert field.python is Empty, where
        else:
            assert not theirs.message_type.file.name.startswith("google/"), where
            compare(field.python, theirs.message_type, seen)
    else:
        python = {
            FieldType.STRING: str,
            FieldType.BYTES: bytes,
            FieldType.BOOL: bool,
            FieldType.FLOAT: float,
            FieldType.DOUBLE: float,
        }
        assert field.python is python.get(spec.kind, int), where


def type_name(field: Any) -> str:
    numbers = {getattr(field, name): name[5:].lower() for name in dir(field) if name.startswith("TYPE_")}
    return numbers[field.type]


def compare_enum(ours: type, theirs: Any) -> None:
    assert issubclass(ours, wire.OpenEnum)
    bare = {int(member): re.sub(r"[\W_]", "", member.name) for member in ours}
    full = {value.number: re.sub(r"[\W_]", "", value.name) for value in theirs.values}
    assert set(bare) == set(full), theirs.full_name
    prefixes = {full[number].removesuffix(name) for number, name in bare.items()}
    assert len(prefixes) == 1, (theirs.full_name, prefixes)
    assert theirs.name.upper().startswith(prefixes.pop()), theirs.full_name


@by_name
def test_protobuf_message_agrees_with_parrots_description(
    message: type[ProtobufMessage], services: dict[str, Any]
) -> None:
    field = described(message, services)
    assert field.containing_oneof.name == "id"
    if field.message_type.full_name == "google.protobuf.Empty":
        assert protobuf.record_fields(message) == ()
    else:
        compare(message, field.message_type, set())


def test_no_message_of_these_services_is_missing(services: dict[str, Any]) -> None:
    wanted = {(name, number) for name, service in services.items() for number in service.DESCRIPTOR.fields_by_number}
    assert {(message.SERVICE.proto, message.NUMBER) for message in MESSAGES} == wanted
    assert len(MESSAGES) > 90


def test_olympe_agrees_on_service_numbers_and_names() -> None:
    script = (
        "import json, os, sys; out = os.dup(1); os.dup2(2, 1)\n"
        "import olympe\n"
        "from olympe.messaging.arsdk_messages import ArsdkMessages\n"
        "known = ArsdkMessages.get('olympe').service_messages\n"
        "text = json.dumps([[*key, message.fullName] for key, message in known.items()])\n"
        "os.write(out, text.encode()); os._exit(0)\n"  # Olympe's threads take seconds to end by themselves
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, timeout=60, check=True)
    known = {(service, number): name for service, number, name in json.loads(done.stdout)}
    for message in MESSAGES:
        assert known[message.SERVICE.id, message.NUMBER] == message.NAME


# ------------------------------------------------------------------------------------------------- the bytes, both ways


def sample(record: type[Submessage], rng: random.Random) -> Any:
    """A record with something in each field, or nothing in some."""
    values = {}
    for field in protobuf.record_fields(record):
        if rng.random() < 0.2:
            continue
        if field.wire.oneof and any(
            other.wire.oneof == field.wire.oneof and other.name in values for other in protobuf.record_fields(record)
        ):
            continue
        values[field.name] = sample_field(field, rng)
    return record(**values)


def sample_field(field: FieldPlan, rng: random.Random) -> Any:
    if isinstance(field.wire, Map):
        keys = sorted(rng.sample(range(1000), rng.randrange(4)))
        return {key: sample_one(field, rng) for key in keys}
    if field.repeated:
        return tuple(sample_one(field, rng) for _ in range(rng.randrange(4)))
    return sample_one(field, rng)


def sample_one(field: FieldPlan, rng: random.Random) -> Any:
    kind = field.wire.kind
    if kind is FieldType.RECORD:
        return sample(field.python, rng)
    if kind is FieldType.ENUM:
        return field.python(rng.choice([*map(int, field.python), 77]))
    if kind is FieldType.BOOL:
        return rng.random() < 0.5
    if kind in (FieldType.FLOAT, FieldType.DOUBLE):
        return rng.choice([0.0, -0.5, 1.25, 1e6])
    if kind is FieldType.STRING:
        return rng.choice(["", "é", "text " * rng.randrange(50)])
    if kind is FieldType.BYTES:
        return rng.choice([b"", b"\0\xff", rng.randbytes(200)])
    bits = 64 if kind.value.endswith("64") else 32
    numbers = [0, 1, 127, 128, (1 << bits) - 1] if kind.value.startswith("u") else [0, 1, -1, -(1 << bits - 1)]
    return rng.choice(numbers)


def fill(theirs: Any, record: Submessage) -> None:
    """Put a record into Google's message, as Olympe does it: what is given is listed in `selected_fields`."""
    theirs.SetInParent()
    for field in protobuf.record_fields(type(record)):
        value = getattr(record, field.name)
        if value is None:
            continue
        if record.SELECTED:
            theirs.selected_fields[field.number].SetInParent()
        if isinstance(field.wire, Wrapped):
            inner = getattr(theirs, field.name)
            inner.SetInParent()
            inner.value = value
        elif isinstance(field.wire, Map):
            assert field.wire.kind is not FieldType.RECORD
            getattr(theirs, field.name).update(value)
        elif field.repeated and field.wire.kind is FieldType.RECORD:
            for one in value:
                fill(getattr(theirs, field.name).add(), one)
        elif field.repeated:
            getattr(theirs, field.name).extend(value)
        elif field.wire.kind is FieldType.RECORD:
            fill(getattr(theirs, field.name), value)
        else:
            setattr(theirs, field.name, value)


@by_name
def test_google_writes_and_reads_the_same_bytes(message: type[ProtobufMessage], services: dict[str, Any]) -> None:
    rng = random.Random(message.NAME)
    for _ in range(25):
        ours = sample(message, rng)
        theirs = services[message.SERVICE.proto]()
        fill(getattr(theirs, described(message, services).name), ours)
        payload = theirs.SerializeToString(deterministic=True)
        data = wire.encode(ours)
        assert data[12:] == payload
        assert wire.decode(data) == ours


def test_service_names_equal_their_file_names(services: dict[str, Any]) -> None:
    for proto in services:
        assert ProtobufEnvelope(proto, "").direction is (
            wire.Direction.COMMAND if proto.endswith(".Command") else wire.Direction.EVENT
        )

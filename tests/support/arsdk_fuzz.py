"""Throws frames at a transport that no peer would send, and watches what it keeps of them."""

from __future__ import annotations

import gc
import random
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from types import FunctionType, ModuleType

import anafi_mav.arsdk.messages as tables
from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Bits, Blob, Buffer, Message, MessageId, Scalar, Text, UnknownMessage, unpacked
from anafi_mav.arsdk.link.frame import FrameType, encode_frame
from anafi_mav.arsdk.link.known_frames import KnownFrames
from anafi_mav.arsdk.link.transport import (
    MAX_QUEUED,
    Delivered,
    Event,
    Garbage,
    ReceivedMessages,
    Role,
    Transport,
    Undelivered,
)
from anafi_mav.arsdk.messages import ardrone3

WARM_UP = 20_000
"""Frames until everything that may be kept is: a long split command begun on each queue, every counter once."""

assert tables.__doc__  # every message is declared


@dataclass(frozen=True)
class Outcome:
    """What a run came to."""

    messages: int
    """Taken out of the noise."""
    garbage: int
    held: int
    """Bytes that the transport holds more than after `WARM_UP`."""
    blocks: int
    """Pieces of memory that the whole process has more than then, whoever holds them."""


def throw(role: Role, version: int, count: int, seed: str) -> Outcome:
    """`count` random or mutated datagrams at a transport of this role, in virtual time, with sends in between.

    Raises what the transport raises, and AssertionError when it reports what cannot be.
    """
    rng = random.Random(seed)
    victim = Transport(role, version, 0.0)
    corpus = list(_corpus(role, version, rng))
    for _ in range(MAX_QUEUED + 1):  # as full as it gets, or what we send ourselves would look like a leak
        victim.send(ardrone3.MaxTilt(0.0), 0.0)
    messages, garbage = 0, 0
    held, blocks = 0, 0
    for number in range(count):
        now = number / 5000
        if number == WARM_UP:
            held, blocks = _memory(victim)
        events: list[Event] = victim.receive(_datagram(rng, version, corpus), now)
        if number % 50 == 0:
            victim.send(ardrone3.MaxTilt(float(number)), now)
        victim.outgoing(now)
        events += victim.expire(now)
        for event in events:
            assert isinstance(event, ReceivedMessages | Delivered | Undelivered | Garbage), event
            if isinstance(event, ReceivedMessages):
                messages += len(list(unpacked(event.messages)))
            garbage += isinstance(event, Garbage)
    end = _memory(victim)
    # It is as it was: it answers a ping.
    victim.receive(encode_frame(version, FrameType.NOACK, 0, 0, bytes(8)), count / 5000)
    assert victim.outgoing(count / 5000)
    return Outcome(messages, garbage, end[0] - held, end[1] - blocks)


def _memory(victim: Transport) -> tuple[int, int]:
    """Return the bytes of what can be reached from the transport, and the pieces of memory that the process has.

    Left out are code, and what all transports share, which has a limit. Called twice this costs nothing, where
    tracemalloc makes every frame take six times as long.
    """
    gc.collect()
    blocks = sys.getallocatedblocks()
    found: dict[int, object] = {}
    waiting: list[object] = [victim]
    while waiting:
        thing = waiting.pop()
        if id(thing) not in found and not isinstance(thing, type | ModuleType | FunctionType | KnownFrames):
            found[id(thing)] = thing
            waiting += gc.get_referents(thing)
    return sum(map(sys.getsizeof, found.values())), blocks


def _corpus(role: Role, version: int, rng: random.Random) -> Iterator[bytes]:
    """Datagrams as a peer sends them: every message there is, acknowledgements, pings, a split command."""
    ids = (125, 126, 127) if role is Role.CONTROLLER else (10, 11, 12)
    yield encode_frame(version, FrameType.NOACK, 0, 0, bytes(8))
    for id in (11, 125, 126):
        yield encode_frame(version, FrameType.ACK, id + 128, 0, bytes(2))
    for declared in wire.declared_messages():
        message = _message(declared, rng)
        speaker = Transport(Role.DEVICE if role is Role.CONTROLLER else Role.CONTROLLER, version, 0.0)
        speaker.send(message, 0.0)
        yield from speaker.outgoing(0.0)
    if version == 3:
        speaker = Transport(Role.DEVICE if role is Role.CONTROLLER else Role.CONTROLLER, version, 0.0)
        speaker.send(UnknownMessage(MessageId(250, 0, 0), bytes(3000)), 0.0)
        yield from speaker.outgoing(0.0)
        for id in ids:  # begun, and never ended: the longest that is put together
            yield encode_frame(3, FrameType.WITHACK, id, 1, b"\xff\xff\x03" + rng.randbytes(900))


def _message(declared: type[Message], rng: random.Random) -> Message | UnknownMessage:
    if declared.ID.project == 133:
        return UnknownMessage(declared.ID, rng.randbytes(12)) if declared.BUFFER is Buffer.ACK else ardrone3.Landing()
    arguments: list[object] = []
    for _, type, python in wire.wire_fields(declared):
        if isinstance(type, Text):
            arguments.append("PI04")
        elif isinstance(type, Blob):
            arguments.append(rng.randbytes(rng.randrange(20)))
        else:
            scalar = type.base if isinstance(type, Bits) else type
            assert isinstance(scalar, Scalar)
            arguments.append(rng.random() if scalar.code in "fd" else python(rng.randrange(4)))
    return declared(*arguments)


def _datagram(rng: random.Random, version: int, corpus: list[bytes]) -> bytes:
    kind = rng.random()
    if kind < 0.25:
        head = rng.choice([1, 2, 4]) if version == 1 else version + 10
        return bytes([head]) + rng.randbytes(rng.randrange(40))
    if kind < 0.3:
        return rng.randbytes(rng.randrange(64))
    if kind < 0.5:
        # A frame whose header is right and whose payload is noise.
        id = rng.choice([0, 1, 10, 11, 12, 125, 126, 127, 139, 253, 254, rng.randrange(256)])
        seq = rng.randrange(256 if version == 1 else 65536)
        return encode_frame(version, rng.randrange(1, 5), id, seq, rng.randbytes(rng.randrange(60)))
    data = bytearray(rng.choice(corpus))
    if rng.random() < 0.7 and len(data) > 6:
        # Another sequence number, so that it is no copy of the last one.
        where = slice(2, 3) if version == 1 else slice(3, 5)
        data[where] = rng.randbytes(where.stop - where.start)
    for _ in range(rng.randrange(4)):
        position = rng.randrange(len(data) + 1)
        match rng.randrange(4):
            case 0 if data:
                data[position % len(data)] = rng.randrange(256)
            case 1:
                del data[position:]
            case 2:
                data[position:position] = rng.randbytes(rng.randrange(8))
            case _:
                data += rng.choice(corpus)
    return bytes(data)

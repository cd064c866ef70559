"""Every command there is, with any value, at any time: a simulated drone neither raises nor says what has no bytes."""

from __future__ import annotations

import math
import random
import struct
from typing import Any

import pytest
from support.sim_bench import Bench

import anafi_mav.arsdk.messages
import anafi_mav.arsdk.messages.proto  # noqa: F401 # declares the protobuf ones too
from anafi_mav.arsdk.codec.envelope import ProtobufMessage
from anafi_mav.arsdk.codec.wire import (
    Bits,
    Blob,
    Direction,
    Message,
    OpenEnum,
    Text,
    declared_messages,
    decode,
    encode,
    wire_fields,
)
from anafi_mav.sim.world.motion import STEP

ROUNDS = 4
"""Times that each command is sent to each model; thousands were run when this was written."""

COMMANDS = sorted((m for m in declared_messages() if m.DIRECTION is Direction.COMMAND), key=lambda m: m.NAME)

NUMBERS = (0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, 1e30, -1e30, 500.0)
TEXTS = ("", "x", "x" * 300, "é", "../..", "20261121T101112+0100")


def any_value(chance: random.Random, wire: Any, python: type) -> Any:
    if isinstance(wire, Text):
        return chance.choice(TEXTS)
    if isinstance(wire, Blob):
        return chance.randbytes(chance.randrange(20))
    code = wire.base.code if isinstance(wire, Bits) else wire.code
    if code in "fd":
        return chance.choice((*NUMBERS, chance.uniform(-200.0, 200.0), chance.uniform(-1.0, 1.0)))
    if issubclass(python, OpenEnum):
        return python(chance.choice((0, 1, 2, 3, 4, 5, 6, -1, 99, 2**31 - 1)))
    bits = 8 * struct.calcsize("<" + code)
    low, high = (0, 2**bits - 1) if code.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return chance.choice((0, 0, 1, 2, low, high, chance.randint(low, high)))


def any_command(chance: random.Random, command: type[Message]) -> bytes:
    if issubclass(command, ProtobufMessage):
        # Its default, then perhaps with bytes that were something else or nothing.
        data = bytearray(encode(command()))
        for _ in range(chance.randrange(3)):
            data.insert(chance.randrange(8, len(data) + 1), chance.randrange(256))
        return bytes(data)
    return encode(command(*(any_value(chance, wire, python) for _, wire, python in wire_fields(command))))


@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
def test_random_commands_never_stop_the_simulator(model: str) -> None:
    seed = random.randrange(2**32)
    chance = random.Random(seed)
    print(f"seed {seed}")  # noqa: T201 # shown when it fails
    bench = Bench(model)
    for _ in range(ROUNDS):
        for command in chance.sample(COMMANDS, len(COMMANDS)):
            message = decode(any_command(chance, command))
            if message is not None:
                bench.firmware.receive(message, bench.now)
            if chance.random() < 0.2:
                bench.run(chance.choice((STEP, 0.1, 0.3)))
    bench.run(5.0)
    pose = bench.pose
    assert all(math.isfinite(value) for value in (pose.north, pose.east, pose.up, pose.roll, pose.pitch, pose.yaw))
    for message in bench.firmware.payload.states_report():
        encode(message)

"""Whatever arrives: no exception, no pause of the heartbeat, and no motion but what is on a list.

Frames of every message of the dialect with random content and a right checksum, frames that are damaged, and every
command with numbers that make no sense. What moves the drone is read from the simulator's own log.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
import random
import struct
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.generator.mavcrc import x25crc
from support.mav import NAN
from support.missions import ROUND, put
from support.world import World, world

from anafi_mav.mavlink import dialect as newer

FLAVOURS = ("px4", "ardupilot")
FRAMES = 100_000
"""In each flavour."""

BATCH = 500
"""Frames at once."""

BATCH_EVERY, COMMAND_EVERY = 0.02, 0.001
"""s: a storm, and all the same time goes on."""

LOST = 3.0
"""s without a heartbeat after which the most impatient client, MAVSDK, takes a vehicle for lost. Client, gateway and
simulator share one process here, and a storm goes through it: the heartbeat's own jitter is measured elsewhere."""

LONGEST = 280
"""Bytes of a frame with the longest payload and a signature (MAVLink serialization.md)."""

UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED

MOTION = {
    "ardrone3.Piloting.TakeOff",
    "ardrone3.Piloting.UserTakeOff",
    "ardrone3.Piloting.Landing",
    "ardrone3.Piloting.Emergency",
    "ardrone3.Piloting.moveTo",
    "ardrone3.Piloting.StartPilotedPOIV2",
    "move.extended_move_to",
    "move.extended_move_by",
    "rth.return_to_home",
    "common.Mavlink.Start",
    "follow_me.start",
    "gimbal.set_target",
}
"""Commands of Parrot's that move something. A moveBy of zeros is a stop; others count too, and so do sticks."""


def motions(w: World, since: float) -> list[str]:
    """What the drone was told to do after a moment of the log."""
    return [
        entry.name
        for entry in w.drone.log
        if entry.kind == "command"
        and entry.t > since
        and (
            entry.name in MOTION
            or (entry.name == "ardrone3.Piloting.moveBy" and any(entry.args[key] for key in ("dX", "dY", "dZ", "dPsi")))
            or (entry.name == "ardrone3.Piloting.PCMD" and any(entry.args[k] for k in ("roll", "pitch", "yaw", "gaz")))
        )
    ]


def framed(id: int, payload: bytes, sequence: int) -> bytes:
    """A frame of MAVLink 2 with a right checksum (MAVLink serialization.md)."""
    head = struct.pack("<BBBBBBB", len(payload), 0, 0, sequence, 255, 190, id & 0xFF) + struct.pack("<H", id >> 8)
    crc = x25crc(head + payload)
    crc.accumulate(bytes([newer.mavlink_map[id].crc_extra]))
    return b"\xfd" + head + payload + struct.pack("<H", crc.crc)


def random_frames(source: random.Random) -> Iterator[bytes]:
    """Well-formed frames of any message, two thirds of them to our system, and damaged ones."""
    ids = sorted(newer.mavlink_map)
    for count in itertools.count():
        id = source.choice(ids)
        kind = newer.mavlink_map[id]
        size = struct.calcsize(kind.unpacker.format)
        payload = bytearray(source.randbytes(size))
        for name, target in (("target_system", 1), ("target_component", 1)):
            if name in kind.ordered_fieldnames and source.random() < 0.67:
                payload[offset(kind, name)] = target
        frame = framed(id, bytes(payload).rstrip(b"\0") or b"\0", count % 256)
        if source.random() < 0.2:
            damaged = bytearray(frame)
            for _ in range(source.randint(1, 3)):
                damaged[source.randrange(len(damaged))] = source.randrange(256)
            frame = bytes(damaged[: source.randint(1, len(damaged))])
        yield frame


SIZES = {"char": 1, "int8_t": 1, "uint8_t": 1, "int16_t": 2, "uint16_t": 2, "int32_t": 4, "uint32_t": 4, "float": 4}
SIZES |= {"int64_t": 8, "uint64_t": 8, "double": 8, "uint8_t_mavlink_version": 1}


def offset(kind: Any, name: str) -> int:
    """Where a field of one byte stands in the payload."""
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    place = 0
    for field, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
        if field == name:
            return place
        place += SIZES[types[field]] * (length or 1)
    raise KeyError(name)


class Mistakes(logging.Handler):
    """Errors that somebody logged: an exception that was caught is one all the same."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.seen: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.seen.append(self.format(record))


@pytest.fixture
def mistakes() -> Iterator[list[str]]:
    handler = Mistakes()
    logging.getLogger().addHandler(handler)
    yield handler.seen
    logging.getLogger().removeHandler(handler)
    assert handler.seen == []


@pytest.mark.timeout(300)
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_random_frames_on_the_ground(flavour: str, mistakes: list[str]) -> None:
    async with world(flavour=flavour) as w:
        source = random.Random(f"anafi {flavour}")
        frames = random_frames(source)
        began, mark = w.drone.log[-1].t, w.client.mark()
        for _ in range(FRAMES // BATCH):
            # What was cut off at the end swallows what follows, up to the longest frame.
            w.client.send_raw(b"".join(itertools.islice(frames, BATCH)) + bytes(LONGEST))
            # An unsupported command is answered behind all of it: the gateway has worked it off.
            assert (await w.client.command(211, timeout=20.0)).result == UNSUPPORTED
            await asyncio.sleep(BATCH_EVERY)
        beats = [at for at, _ in w.client.since(mark, "HEARTBEAT")]
        gaps = [b - a for a, b in itertools.pairwise(beats)]
        assert gaps
        assert max(gaps) < LOST, max(gaps)
        assert motions(w, began) == []
        assert w.drone.flying_state.name == "LANDED"
        assert mistakes == []


EXTREMES = (NAN, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-40, 0.0)
"""What each parameter is in turn; 1e-40 is a denormal number, as an integer in the place of a float looks."""

GOING_DOWN = (dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, dialect.MAV_CMD_NAV_LAND)
"""They mean what they mean whatever their parameters are, so these are tried out on the ground."""

Parameters = tuple[float, ...]

MAY_MOVE: dict[int, Callable[[Parameters], bool]] = {
    # A heading alone turns the drone (QGroundControl); 0 and 1e-40 are headings.
    dialect.MAV_CMD_DO_REPOSITION: lambda p: abs(p[3]) < 1.0 and all(math.isnan(v) for v in p[4:]),
    # An angle to turn to, or by.
    dialect.MAV_CMD_CONDITION_YAW: lambda p: abs(p[0]) <= 360.0,
    # All default: a circle around where the drone is. Its yaw behaviour and its angle may be given.
    dialect.MAV_CMD_DO_ORBIT: lambda p: all(math.isnan(v) for v in (*p[:2], *p[4:])),
}
"""The commands that move the drone with parameters like these, and with which of them."""


async def handled(w: World) -> list[int]:
    """The commands that the gateway knows."""
    known = []
    for id in sorted(newer.enums["MAV_CMD"]):
        if (await w.client.command(id, NAN, NAN, NAN, NAN)).result != UNSUPPORTED:
            known.append(id)
    return known


@pytest.mark.timeout(400)
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_commands_with_numbers_that_make_no_sense(flavour: str, mistakes: list[str]) -> None:
    async with world(flavour=flavour, speed=5.0) as w:
        known = await handled(w)
        assert {*GOING_DOWN, *MAY_MOVE} <= set(known)
        began = w.drone.log[-1].t
        for id in GOING_DOWN:
            await each(w, id, began, lambda p: False)
        assert w.drone.flying_state.name == "LANDED"
        # Whatever take-off some of it asked for is not carried out: arming is a step of its own.
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)).result == 0
        await w.take_off()
        mark = w.client.mark()
        for id in known:
            if id not in GOING_DOWN:
                await each(w, id, w.drone.log[-1].t, MAY_MOVE.get(id, lambda p: False))
                assert w.drone.flying_state.name in ("HOVERING", "FLYING"), id
        beats = [at for at, _ in w.client.since(mark, "HEARTBEAT")]
        assert max(b - a for a, b in itertools.pairwise(beats)) < LOST
        assert mistakes == []


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_commands_about_a_mission_with_numbers_that_make_no_sense(flavour: str, mistakes: list[str]) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        began = w.drone.log[-1].t
        for id in (dialect.MAV_CMD_MISSION_START, dialect.MAV_CMD_DO_SET_MISSION_CURRENT):
            await each(w, id, began, lambda p: False)  # nobody arms
        assert w.drone.flying_state.name == "LANDED"
        assert mistakes == []


async def each(w: World, id: int, since: float, may_move: Callable[[Parameters], bool]) -> None:
    """Send a command with each parameter at each extreme, the others unset or 0; nothing moves but what may."""
    for others, slot, extreme in itertools.product((NAN, 0.0), range(7), EXTREMES):
        p = [others] * 7
        p[slot] = extreme
        ack = await w.client.command(id, *p[:4], x=p[4], y=p[5], z=p[6], timeout=20.0)
        assert ack.result != dialect.MAV_RESULT_FAILED, (id, p)
        await asyncio.sleep(COMMAND_EVERY)
        if moved := motions(w, since):
            assert may_move(tuple(p)), (id, p, moved)
            since = w.drone.log[-1].t

"""No bytes of a peer raise anything or pile up: random or mutated frames, and what is below and beside.

The input is another one in each run (`support.fuzz_seed`).
"""

from __future__ import annotations

import contextlib
import random

import pytest
from support.arsdk_fuzz import throw

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link import handshake
from anafi_mav.arsdk.link.frame import MAX_COMMAND, VERSIONS, decode_frames
from anafi_mav.arsdk.link.transport import Role
from anafi_mav.errors import RemoteProtocolError

FRAMES = [60_000, pytest.param(1_000_000 // 6, marks=pytest.mark.full)]
"""Of each role and version; a million together with `-m full`."""

SPLIT = 3 * MAX_COMMAND * 9 // 8
"""Bytes that may be held of commands that are being put together, one in each queue, with a bytearray's spare room. A
leak of the smallest object there is, one for every frame, is three times this, and ten times with `-m full`."""


@pytest.mark.parametrize("frames", FRAMES)
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("role", Role)
def test_no_frame_raises_or_leaks(role: Role, version: int, frames: int, fuzz_seed: int) -> None:
    outcome = throw(role, version, frames, seed=f"{fuzz_seed} {version}")
    assert outcome.held < (SPLIT if version == 3 else 1000)
    assert outcome.blocks < 1000  # the process is not the transport's alone
    # The noise got behind the frames: some of it was read as messages, some of it was not.
    # In version 3 split commands swallow what follows.
    assert outcome.messages > (0.01 if version == 3 else 0.09) * frames
    assert outcome.garbage > 0.6 * frames


def test_no_command_bytes_raise(fuzz_seed: int) -> None:
    rng = random.Random(fuzz_seed)
    ids = [message.ID for message in wire.declared_messages()]
    read = 0
    for _ in range(60_000):
        data = wire.HEADER.pack(*rng.choice(ids)) + rng.randbytes(rng.randrange(60))
        message = wire.decode(data)
        assert message is None or isinstance(message, Message | UnknownMessage)
        if isinstance(message, Message):
            read += 1
            repr(message)  # what the log does
    assert read > 10_000


NOISE = [b"[", b"{", b"1e999", b'"', b"\xff", b"null", b""]


def test_random_handshake_bytes_raise_protocol_errors_only(fuzz_seed: int) -> None:
    rng = random.Random(fuzz_seed)
    info = handshake.DeviceInfo(0x0914, "PI040416DA9H000001", 44444, "ANAFI")
    reply = handshake.ConnectReply(0, 2233, 0, 3)
    request = handshake.ConnectRequest("olympe", "desktop", 9988, "", 0, 1, 3)
    corpus = [handshake.format_discovery(info), handshake.format_reply(reply), handshake.format_request(request)]
    for _ in range(20_000):
        data = bytearray(rng.choice(corpus))
        for _ in range(rng.randrange(4)):
            position = rng.randrange(len(data) + 1)
            data[position : position + rng.randrange(3)] = rng.choice(NOISE)
        for parse in (handshake.parse_discovery, handshake.parse_reply, handshake.parse_request):
            with contextlib.suppress(RemoteProtocolError):
                parse(bytes(data))


def test_frames_of_noise(fuzz_seed: int) -> None:
    rng = random.Random(fuzz_seed)
    for _ in range(30_000):
        data = rng.randbytes(rng.randrange(80))
        for version in (1, 2, 3):
            frames, _ = decode_frames(version, data)
            assert sum(len(frame.payload) for frame in frames) <= len(data)

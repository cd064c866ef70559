"""Parrot's libarsdk reads the frames that we pack, and we read those that it packs, whatever the sizes of commands."""

from __future__ import annotations

import errno
import importlib.util
import json
import os
import random
import socket
import struct
import subprocess
import sys
from collections.abc import Iterable, Iterator
from itertools import product
from pathlib import Path
from typing import NamedTuple

import pytest
from support.olympe_server import CONTROLLER_PORT

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import MessageId, UnknownMessage, unpacked
from anafi_mav.arsdk.link.frame import FrameType, decode_frames, encode_frame, longest_command
from anafi_mav.arsdk.link.transport import ACK_TIMEOUT, Delivered, ReceivedMessages, Role, Transport
from anafi_mav.arsdk.messages import common

SCRIPT = Path(__file__).with_name("parrot_link.py")
VERSIONS = [1, 2, 3]

SIZES = [4, 5, 20, 126, 127, 128, 129, 255, 256, 496, 497, 498, 499, 500, *range(867, 875), *range(990, 1003)]
SIZES += [*range(1266, 1272), *range(1393, 1401), 1995, 1996, 1997, 1998, 1999, 2996, 3000, 16383, 16384, 16385]
"""Bytes of a command: around each further byte of its length, and full frames (1000 or 1400 bytes), alone, beside one
of 127 or 128 bytes, and in several pieces."""

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)


class Caused(NamedTuple):
    commands: list[bytes]
    datagrams: list[bytes]


class Parrot:
    """A controller's ends of links, as Parrot made them."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def give(
        self, version: int, datagrams: Iterable[bytes] = (), commands: Iterable[tuple[bool, bytes]] = ()
    ) -> Caused:
        """Let datagrams arrive, then send commands; return what was received and sent."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        request = {
            "version": version,
            "datagrams": [datagram.hex() for datagram in datagrams],
            "commands": [(acknowledged, command.hex()) for acknowledged, command in commands],
        }
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        caused = json.loads(self._process.stdout.readline())
        return Caused(*([bytes.fromhex(text) for text in caused[key]] for key in ("commands", "datagrams")))


@pytest.fixture
def parrot() -> Iterator[Parrot]:
    words = [sys.executable, SCRIPT, *map(str, VERSIONS)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield Parrot(process)


class Drone:
    """Our end of a link to Parrot's, through air that loses and doubles datagrams."""

    def __init__(self, parrot: Parrot, version: int, chance: random.Random, loss: float) -> None:
        self._parrot, self._version, self._chance, self._loss = parrot, version, chance, loss
        self._transport = Transport(Role.DEVICE, version, 0.0, ping_after=1e6)
        self._now = 0.0
        self._expected: dict[int, bytes] = {}
        """Acknowledged commands by token, of this exchange."""
        self.received: list[bytes] = []

    def send(self, size: int, acknowledged: bool) -> None:
        filling = self._chance.randbytes(size)
        if acknowledged:
            message: UnknownMessage | common.ProductNameChanged = UnknownMessage(MessageId(250, 7, 9), filling[4:])
        else:
            message = common.ProductNameChanged(filling[5:].hex()[: size - 5])
        token = self._transport.send(message, self._now)
        if acknowledged:
            self._expected[token] = wire.encode(message)

    def exchange(self) -> list[bytes]:
        """Send until all is acknowledged; return the acknowledged commands that Parrot's end has to receive."""
        is_lost_so_far = True
        while datagrams := self._transport.outgoing(self._now):
            for datagram in datagrams:
                ((type, id, seq, _),), garbage = decode_frames(self._version, datagram)
                assert garbage is None
                if type != FrameType.WITHACK:
                    self.received += self._parrot.give(self._version, [datagram]).commands
                    continue
                if self._chance.random() < self._loss:
                    if is_lost_so_far:
                        self._cancel()
                    continue
                is_lost_so_far = False
                self.received += self._parrot.give(self._version, [datagram]).commands
                if self._chance.random() < self._loss:
                    continue
                number = bytes((seq,)) if self._version == 1 else struct.pack("<H", seq)
                ack = encode_frame(self._version, FrameType.ACK, id + 128, 0, number)
                assert all(isinstance(event, Delivered) for event in self._transport.receive(ack, self._now))
                is_lost_so_far = True
            self._now += ACK_TIMEOUT
        commands, self._expected = list(self._expected.values()), {}
        return commands

    def _cancel(self) -> None:
        """Cancel a command that no frame has carried to the other end, at times."""
        arrived = set(self.received)
        able = [
            token
            for token, command in self._expected.items()
            if len(command) <= 900 and command not in arrived and self._chance.random() < 0.1
        ]
        for token in able:
            self._transport.cancel(token)
            del self._expected[token]


@pytest.fixture
def unacknowledged_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """Send names of products in the queue of measurements: no message there has a length of its own."""
    monkeypatch.setattr(common.ProductNameChanged, "BUFFER", wire.Buffer.NON_ACK)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.usefixtures("unacknowledged_names")
def test_commands_of_every_size_are_read_by_parrot(version: int, parrot: Parrot) -> None:
    """Alone, and behind one of each length that a full frame may begin with."""
    drone = Drone(parrot, version, random.Random(7), loss=0.0)
    for acknowledged in (True, False):
        longest = longest_command(version, acknowledged)
        for first, size in product([0, 4, 127, 128, 500], SIZES):
            if size > longest or (size < 5 and not acknowledged):
                continue
            sizes = [size] if not first else [first, size] if acknowledged else [max(first, 5), size]
            for each in sizes:
                drone.send(each, acknowledged)
            expected = drone.exchange()
            received, drone.received = drone.received, []
            if acknowledged:
                assert received == expected, sizes
            assert [len(command) for command in received] == sizes


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.usefixtures("unacknowledged_names")
def test_random_rows_of_commands_are_read_by_parrot(version: int, parrot: Parrot) -> None:
    """Frames that are lost, repeated, or repeated without a command that was cancelled."""
    chance = random.Random(version)
    drone = Drone(parrot, version, chance, loss=0.3)
    longest = longest_command(version, True), longest_command(version, False)
    for _ in range(60):
        names = 0
        for _ in range(chance.randint(1, 12)):
            acknowledged = chance.random() < 0.7
            size = min(chance.choice([chance.choice(SIZES), chance.randint(5, 140)]), longest[not acknowledged])
            drone.send(max(size, 5), acknowledged)
            names += not acknowledged
        expected = drone.exchange()
        received, drone.received = drone.received, []
        assert [command for command in received if command[0] == 250] == expected
        assert len(received) - len(expected) == names


@pytest.mark.parametrize("version", VERSIONS)
def test_commands_of_every_size_are_read_from_parrot(version: int, parrot: Parrot) -> None:
    """In rows, so that libarsdk packs them; it begins a split command in what is left of a frame, which we never do."""
    transport = Transport(Role.DEVICE, version, 0.0, ping_after=1e6)
    chance = random.Random(11)
    for acknowledged in (True, False):
        # A longer one of no more than 1000 or 1400 bytes is not sent by libarsdk at all, nor what waits behind it.
        sizes = [size for size in SIZES if size <= longest_command(version, acknowledged)]
        for _ in range(2):
            row = chance.sample(sizes, len(sizes))
            sent = [bytes((250, 7, 9, 0)) + chance.randbytes(size - 4) for size in row]
            received: list[bytes] = []
            datagrams = parrot.give(version, commands=[(acknowledged, command) for command in sent]).datagrams
            while True:
                for datagram in datagrams:
                    for event in transport.receive(datagram, 0.0):
                        assert isinstance(event, ReceivedMessages), event
                        received += map(wire.encode, unpacked(event.messages))
                assert received == sent[: len(received)], row
                datagrams = parrot.give(version, transport.outgoing(0.0)).datagrams
                if len(received) == len(sent):
                    break  # copies that are on their way are lost
                datagrams += parrot.give(version).datagrams


def test_parrot_takes_frames_of_another_drone_for_its_own(parrot: Parrot) -> None:
    """Neither their source nor their version is compared: frames of version 2 on a link of version 3.

    With the frames of a Skycontroller 3 that another program had left, Olympe reported these ids. Hence the port that
    is reserved in `support.olympe_server`.
    """
    attitude = bytes.fromhex("1400 04080400 0000803f 00000000 00000000 00000000")  # 4-8-4
    memory = bytes.fromhex("0c00 91000200 007841cb02000000")  # 145-0-2
    frames = [encode_frame(2, FrameType.NOACK, 127, seq, payload) for seq, payload in enumerate([attitude, memory])]
    commands = parrot.give(3, frames).commands
    assert [command[:4].hex(" ") for command in commands] == ["00 04 08 04", "00 91 00 02"]


def test_default_port_of_parrots_controllers_is_reserved() -> None:
    """A second Olympe never gets the port of one that has ended, to which a drone may still send."""
    probe = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with probe, pytest.raises(OSError, match=os.strerror(errno.EADDRINUSE)):
        probe.bind(("", CONTROLLER_PORT))

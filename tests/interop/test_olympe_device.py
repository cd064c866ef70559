"""Parrot's libarsdk is the referee of our controller's wire format, message by message, both ways."""

from __future__ import annotations

import asyncio
import ctypes
import importlib.util
import json
import os
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any, TypeAlias

import pytest
from support import olympe_server

import anafi_mav.arsdk.messages
from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.envelope import ProtobufMessage
from anafi_mav.arsdk.codec.wire import Message, MessageId, UnknownMessage
from anafi_mav.arsdk.link import transport
from anafi_mav.arsdk.link.controller import ControllerSession, connect
from anafi_mav.arsdk.messages import ardrone3, common, mission
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.proto import camera2

CLONE_NEWNET = 0x40000000
SCRIPT = Path(__file__).with_name("olympe_device.py")

LIMIT = 500.0
"""s of one conversation: a busy machine makes it slow, and the limit of a whole test is 600 s."""

pytestmark = [
    pytest.mark.third_party,
    pytest.mark.skipif(sys.platform != "linux", reason=f"network namespaces are Linux's, this is {sys.platform}"),
    pytest.mark.skipif(
        importlib.util.find_spec("olympe") is None,
        reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
    ),
    pytest.mark.skipif(
        not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may make a network namespace"
    ),
]


class Referee:
    """The process with Olympe in it."""

    def __init__(self) -> None:
        self.process = (
            olympe_server.Script(SCRIPT)
            if olympe_server.is_running()
            else Popen([sys.executable, str(SCRIPT)], stdin=PIPE, stdout=PIPE, text=True)
        )
        assert self.process.stdout is not None
        if not self.process.stdout.readline():
            if self.process.wait(10) == 77:
                pytest.skip("this root may not make a network namespace")
            pytest.fail("Olympe's device did not start")

    def send(self, name: str, args: list[Any]) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"send": name, "args": args}) + "\n")
        self.process.stdin.flush()

    def received(self) -> dict[str, Any]:
        """The next message Olympe got; blocks."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, "Olympe's device is gone"
        result = json.loads(line)
        assert isinstance(result, dict)
        return result

    def run(self, body: Callable[[], Awaitable[None]]) -> None:
        """Run a coroutine in the referee's network. A namespace belongs to a thread, so it gets one."""
        failures: list[BaseException] = []

        async def bounded() -> None:
            try:
                await asyncio.wait_for(body(), LIMIT)
            except BaseException:
                self.process.kill()  # ends a thread that still waits for a line; asyncio.run waits for that thread
                raise

        def enter() -> None:
            try:
                with Path(f"/proc/{self.process.pid}/ns/net").open() as namespace:
                    assert ctypes.CDLL(None).setns(namespace.fileno(), CLONE_NEWNET) == 0
                asyncio.run(bounded())
            except BaseException as error:
                failures.append(error)

        thread = threading.Thread(target=enter)
        thread.start()
        thread.join()
        if failures:
            raise failures[0]

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(10)
        finally:
            self.process.kill()
            self.process.wait()
            if self.process.stdout is not None:
                self.process.stdout.close()


@pytest.fixture
def referee() -> Iterator[Referee]:
    referee = Referee()
    try:
        yield referee
    finally:
        referee.close()


Queue: TypeAlias = "asyncio.Queue[Message | UnknownMessage]"


async def join(version: int, **options: Any) -> tuple[ControllerSession, Queue]:
    heard: Queue = asyncio.Queue()
    session = await connect(
        "127.0.0.1", versions=(version, version), on_message=lambda message, now: heard.put_nowait(message), **options
    )
    assert session.version == version
    assert (session.device.model_id, session.device.serial) == (0x0914, "12345678")
    return session, heard


def sample(message: type[Message]) -> tuple[Message, list[Any]]:
    """A message with a different value in each argument, and the same as plain values for the other side."""
    values: list[Any] = []
    plain: list[Any] = []
    for number, (_, kind, python) in enumerate(wire.wire_fields(message), 1):
        if isinstance(kind, wire.Text):
            value: Any = f"text {number} é"
        elif isinstance(kind, wire.Blob):
            value = bytes([number, 0, 255])
        elif isinstance(kind, wire.Bits) and kind.names is ListFlags:
            value = 1 << ListFlags.FIRST | 1 << ListFlags.LAST  # Olympe trips over REMOVE in a list without keys
        elif isinstance(kind, wire.Bits):
            value = 1 | 1 << len(kind.names) - 1
        elif issubclass(python, wire.OpenEnum):
            value = list(python)[-1]
        elif kind.code in "fd":
            value = -0.5 * number
        else:
            value = -number if kind.code.islower() else number
        values.append(value)
        plain.append({"hex": value.hex()} if isinstance(value, bytes) else value)
    return message(*values), [int(value) if isinstance(value, wire.OpenEnum) else value for value in plain]


def declared(direction: wire.Direction) -> list[type[Message]]:
    home = anafi_mav.arsdk.messages.__name__
    return [
        message
        for message in wire.declared_messages()
        if message.DIRECTION is direction
        and message.__module__.startswith(home)
        and not issubclass(message, ProtobufMessage)
    ]


@pytest.mark.parametrize("version", [1, 2, 3])
def test_olympe_understands_us_and_we_understand_olympe(
    referee: Referee, version: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Olympe's process shares the machine with others: it acknowledges, if not always as soon as a drone.
    monkeypatch.setattr(transport, "ACK_TIMEOUT", 5.0)
    payload = bytes(range(256)) * (10 if version == 3 else 5)  # 2560 bytes are split in version 3, 1280 never

    async def body() -> None:
        session, heard = await join(version)
        for message in (common.AllStates(), ardrone3.MoveBy(1.0, -2.0, 0.5, 0.25)):
            session.send(message)
            assert await asyncio.to_thread(referee.received) == {
                "received": message.NAME,
                "args": [getattr(message, name) for name in message.__struct_fields__],
            }
        session.send(ardrone3.PCMD(1, 0, 50, 0, -20, 0))
        assert await asyncio.to_thread(referee.received) == {
            "received": "ardrone3.Piloting.PCMD",
            "args": [1, 0, 50, 0, -20, 0],
        }
        # generic.custom_cmd(service_id, msg_num, payload) of a service that no table of ours has
        packed = bytes.fromhex("3412 0100") + len(payload).to_bytes(4, "little") + payload
        session.send(UnknownMessage(MessageId(133, 0, 1), packed))
        got = await asyncio.to_thread(referee.received)
        assert got["args"] == [{"hex": payload.hex()}]

        referee.send("ardrone3.PilotingState.FlyingStateChanged", [2])
        assert await heard.get() == ardrone3.FlyingStateChanged(ardrone3.FlyingState.HOVERING)
        referee.send("ardrone3.PilotingState.AltitudeChanged", [1.5])
        assert await heard.get() == ardrone3.AltitudeChanged(1.5)
        referee.send("generic.custom_evt", [0x1234, 1, {"hex": payload.hex()}])
        assert await heard.get() == UnknownMessage(MessageId(133, 0, 3), packed)
        # All is acknowledged, nothing is unreadable, nothing was sent twice; but libarsdk does so, where the machine
        # lets it wait for our acknowledgement longer than 150 ms.
        assert {name for name in session.counters if name not in ("sent", "received")} <= {"ping", "duplicate"}
        await session.close()

    referee.run(body)


def test_every_message_of_our_tables_passes_libarsdk(referee: Referee) -> None:
    async def body() -> None:
        session, heard = await join(3)
        # All of a queue at once, for its order is kept; between queues there is none.
        for buffer in wire.Buffer:
            samples = [sample(message) for message in declared(wire.Direction.COMMAND) if message.BUFFER is buffer]
            for message, _ in samples:
                session.send(message)
            for message, plain in samples:
                expected = {"received": message.NAME, "args": plain}
                if isinstance(message, mission.CustomCmd):  # Olympe opens this envelope and knows no such mission
                    expected = {"received": "UnknownMissionMessageEvent", "args": plain[-1:]}
                assert await asyncio.to_thread(referee.received) == expected
        for buffer in wire.Buffer:
            samples = [sample(message) for message in declared(wire.Direction.EVENT) if message.BUFFER is buffer]
            for message, plain in samples:
                referee.send(message.NAME, plain)
            for message, _ in samples:
                assert await heard.get() == message
        await session.close()

    assert len(declared(wire.Direction.COMMAND)) > 30
    assert len(declared(wire.Direction.EVENT)) > 100
    referee.run(body)


def test_every_protobuf_message_passes_libarsdk(referee: Referee) -> None:
    """Commands by our names as Olympe understands them; events as Olympe's raw envelopes, which we open."""
    messages = [message for message in wire.declared_messages() if issubclass(message, ProtobufMessage)]

    async def body() -> None:
        session, heard = await join(3)
        for buffer in (wire.Buffer.ACK, wire.Buffer.NON_ACK):
            commands = [
                message()
                for message in messages
                if message.DIRECTION is wire.Direction.COMMAND and message.BUFFER is buffer
            ]
            for command in commands:
                session.send(command)
            for command in commands:
                assert (await asyncio.to_thread(referee.received))["received"] == command.NAME
        session.send(camera2.Configure(camera_id=1, config=camera2.Config(camera_mode=camera2.CameraMode.PHOTO)))
        assert await asyncio.to_thread(referee.received) == {
            "received": "camera2.Command.Configure",
            "args": ["camera_id", "config"],
        }
        events = [message() for message in messages if message.DIRECTION is wire.Direction.EVENT]
        for event in events:
            payload = wire.encode(event)[12:]
            name = "generic.custom_evt" if event.BUFFER is wire.Buffer.ACK else "generic.custom_evt_non_ack"
            referee.send(name, [event.SERVICE.id, event.NUMBER, {"hex": payload.hex()}])
            assert await heard.get() == event
        await session.close()

    assert len(messages) > 90
    referee.run(body)


@pytest.mark.parametrize("version", [1, 3])
def test_olympe_answers_our_pings(referee: Referee, version: int) -> None:
    async def body() -> None:
        session, _ = await join(version)
        while session.counters["ping"] < 5:
            await asyncio.sleep(0.05)
            assert not session.lost.done()
        await session.close()

    referee.run(body)


def test_olympe_gone_is_a_lost_link(referee: Referee) -> None:
    async def body() -> None:
        session, _ = await join(3)
        referee.process.kill()
        assert await session.lost in ("the drone closed the connection", "the drone's UDP port is closed")
        await session.close()

    referee.run(body)

"""A drone that does what a test commands, over real sockets: our device role, no firmware behind it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any, TypeVar

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link.device import DeviceServer, DeviceSession
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.link.session import OnMessage
from anafi_mav.arsdk.messages import ardrone3, common, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.clock import Clock
from anafi_mav.drone import Drone

STICK_PERIOD = 0.05
"""s between two PCMD of a controller, as Parrot's send them."""

MessageT = TypeVar("MessageT", bound=Message)

STATES: list[Message] = [
    ardrone3.FlyingStateChanged(FlyingState.LANDED),
    rth.State(rth.RthState.AVAILABLE, rth.StateReason.ENABLED),
    common.BatteryStateChanged(80),
]
# The firmware's defaults: 10 degrees, 40 deg/s, 3 m/s.
SETTINGS: list[Message] = [
    common.ProductVersionChanged("1.8.2", "HW_01"),
    ardrone3.MaxTiltChanged(10.0, 1.0, 40.0),
    ardrone3.MaxRotationSpeedChanged(40.0, 3.0, 200.0),
    ardrone3.MaxVerticalSpeedChanged(3.0, 0.1, 4.0),
    rth.MinAltitude(20.0, 20.0, 100.0),
]


class ScriptedDevice:
    """Keeps every command it receives; `script` says which events answer a kind of command."""

    def __init__(self, model_id: int = 0x0914, versions: tuple[int, int] = (1, 3)) -> None:
        self._info = DeviceInfo(model_id, "PI040416DA9H000001", 0, "ANAFI-H000001")
        self.received: list[tuple[float, Message | UnknownMessage]] = []
        """(loop time, command), oldest first."""
        self.script: dict[type[Message], Callable[[Any], Sequence[Message]]] = {
            common.AllStates: lambda _: [*STATES, common.AllStatesChanged()],
            common.AllSettings: lambda _: [*SETTINGS, common.AllSettingsChanged()],
        }
        self._versions = versions
        self.sessions: list[DeviceSession] = []
        self._updated = asyncio.Event()
        self._server: DeviceServer

    async def __aenter__(self) -> ScriptedDevice:
        self._server = await DeviceServer.start(
            "127.0.0.1",
            discovery_port=0,
            handshake_port=0,
            c2d_port=0,
            info=self._info,
            versions=self._versions,
            on_session=self._on_session,
        )
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._server.close()

    def drone(self, clock: Clock | None = None, http_port: int = 80, rtsp_port: int = 554) -> Drone:
        """A drone of ours that would connect here."""
        return Drone(
            "127.0.0.1",
            discovery_port=self._server.discovery_port,
            http_port=http_port,
            rtsp_port=rtsp_port,
            name="scripted",
            clock=clock,
        )

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[Drone]:
        """A drone of ours, connected; at the end no one may wait for anything any more."""
        drone = self.drone()
        await drone.connect()
        yield drone
        await drone.close()
        await asyncio.sleep(0)
        commander = drone._commander
        assert not commander._open, "somebody still waits for an answer"
        assert not commander.waiting
        assert not commander.pending_stops
        assert not commander.begins

    @property
    def session(self) -> DeviceSession:
        """The newest."""
        return self.sessions[-1]

    def _on_session(self, session: DeviceSession) -> OnMessage:
        self.sessions.append(session)
        return self._on_message

    def _on_message(self, message: Message | UnknownMessage, now: float) -> None:
        self.received.append((now, message))
        for answer in self.script.get(type(message), lambda _: ())(message):  # type: ignore[arg-type]
            self.session.send(answer)
        self._updated.set()

    def say(self, *events: Message) -> None:
        """Send these events."""
        for event in events:
            self.session.send(event)

    async def acknowledged(self, event: Message) -> None:
        """Send an event, and wait until it and all before it are acknowledged."""
        received = asyncio.Event()
        token = self.session.send(event)
        self.session.on_delivered = lambda one, has_arrived: received.set() if one == token and has_arrived else None
        await asyncio.wait_for(received.wait(), 10.0)

    def got(self, kind: type[MessageT]) -> list[MessageT]:
        """The commands of this kind so far."""
        return [message for _, message in self.received if isinstance(message, kind)]

    def times(self, kind: type[Message]) -> list[float]:
        """When they came."""
        return [now for now, message in self.received if isinstance(message, kind)]

    async def quiet(self, kind: type[Message] = Message) -> None:
        """Three periods of the sticks in which no command of this kind may come: a timer each, so that however late the
        machine is, the loop has run whatever was due before, and the last one for what that has put on the wire."""
        before = len(self.got(kind))
        for _ in range(4):
            await asyncio.sleep(STICK_PERIOD)
        assert self.got(kind)[before:] == []

    async def until(self, kind: type[MessageT], count: int = 1, timeout: float = 10.0) -> MessageT:
        """Wait for the `count`th command of this kind. `timeout` in s only ends what hangs."""

        async def wait() -> MessageT:
            while len(self.got(kind)) < count:
                self._updated.clear()
                await self._updated.wait()
            return self.got(kind)[count - 1]

        return await asyncio.wait_for(wait(), timeout)

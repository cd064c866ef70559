"""Controller and device over real sockets on the loopback."""

from __future__ import annotations

import asyncio

import pytest

from anafi_mav.arsdk.controller import ControllerSession, connect
from anafi_mav.arsdk.device import DeviceServer, DeviceSession
from anafi_mav.arsdk.handshake import DeviceInfo
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.arsdk.session import OnMessage

INFO = DeviceInfo(0x0914, "PI040416DA9H000001", 0, "ANAFI-H000001")


class Drone:
    """A device that records what it gets and answers AllStates."""

    def __init__(self) -> None:
        self.sessions: list[DeviceSession] = []
        self.received: asyncio.Queue[object] = asyncio.Queue()

    def on_session(self, session: DeviceSession) -> OnMessage:
        self.sessions.append(session)

        def on_message(message: object, now: float) -> None:
            self.received.put_nowait(message)
            if isinstance(message, common.AllStates):
                session.send(ardrone3.FlyingStateChanged(ardrone3.FlyingState.HOVERING))
                session.send(ardrone3.AltitudeChanged(1.5))
                session.send(common.AllStatesChanged())

        return on_message


@pytest.mark.parametrize("version", [1, 2, 3])
async def test_messages_go_both_ways(version: int) -> None:
    drone = Drone()
    heard: asyncio.Queue[object] = asyncio.Queue()
    server = await DeviceServer.start(
        "127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, info=INFO, on_session=drone.on_session
    )
    session: ControllerSession = await connect(
        "127.0.0.1",
        discovery_port=server.discovery_port,
        versions=(version, version),
        on_message=lambda message, now: heard.put_nowait(message),
    )
    try:
        assert session.version == version
        assert session.device == server.info
        session.send(common.AllStates())
        session.send(ardrone3.PCMD(1, 0, 50, 0, -20, 0))
        got = [await asyncio.wait_for(drone.received.get(), 2) for _ in range(2)]
        assert common.AllStates() in got
        assert ardrone3.PCMD(1, 0, 50, 0, -20, 0) in got
        answers = [await asyncio.wait_for(heard.get(), 2) for _ in range(3)]
        assert ardrone3.AltitudeChanged(1.5) in answers
        acknowledged = [message for message in answers if not isinstance(message, ardrone3.AltitudeChanged)]
        assert acknowledged == [
            ardrone3.FlyingStateChanged(ardrone3.FlyingState.HOVERING),
            common.AllStatesChanged(),
        ]
    finally:
        await session.close()
        await server.close()
    assert session.lost.result() == "closed"

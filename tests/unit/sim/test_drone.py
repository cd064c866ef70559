"""A simulated drone on its sockets: the link's faults, a second controller, telemetry and its rates."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable

import pytest

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link.controller import ControllerSession, connect
from anafi_mav.arsdk.messages import ardrone3, battery, common
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.errors import LinkLost
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator


class Heard:
    """What a controller received, and when."""

    def __init__(self) -> None:
        self.messages: list[Message | UnknownMessage] = []
        self.times: list[float] = []
        self._more = asyncio.Event()

    def __call__(self, message: Message | UnknownMessage, now: float) -> None:
        self.messages.append(message)
        self.times.append(now)
        self._more.set()

    async def until(self, enough: Callable[[list[Message | UnknownMessage]], bool]) -> None:
        while not enough(self.messages):
            self._more.clear()
            await asyncio.wait_for(self._more.wait(), 10.0)

    def when(self, kind: type[Message]) -> list[float]:
        return [now for now, message in zip(self.times, self.messages, strict=True) if type(message) is kind]


@pytest.fixture
async def real() -> AsyncIterator[SimulatedDrone]:
    spec = DroneSpec(address="127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, http_port=None)
    async with Simulator([spec], speed=5.0, seed=1) as simulator:
        yield simulator.drones[0]


async def join(real: SimulatedDrone, timeout: float = 3.0) -> tuple[ControllerSession, Heard]:
    heard = Heard()
    session = await connect(
        "127.0.0.1",
        discovery_port=real.discovery_port,
        on_message=heard,
        timeout=timeout,
    )
    return session, heard


async def test_connection_without_a_radio_link_fails(real: SimulatedDrone) -> None:
    real.faults.mute = True
    with pytest.raises(LinkLost):
        await join(real, timeout=0.3)
    assert real.session is None
    real.faults.mute = False
    session, _ = await join(real)
    await session.close()


async def test_a_second_controller_takes_over_in_flight(real: SimulatedDrone) -> None:
    first, _ = await join(real)
    first.send(ardrone3.TakeOff())
    await real.wait_log(lambda entry: entry.kind == "state" and entry.args["to"] == "hovering", 10.0)
    second, heard = await join(real)
    assert await asyncio.wait_for(first.lost, 5.0)
    assert real.session is not None
    second.send(common.AllStates())
    await heard.until(lambda messages: common.AllStatesChanged() in messages)
    states = [message.state for message in heard.messages if isinstance(message, ardrone3.FlyingStateChanged)]
    assert states[0] is FlyingState.HOVERING
    assert [entry.name for entry in real.log.find("session")] == ["up", "lost", "up"]
    assert real.log.find("session", "lost")[0].args == {"reason": "another controller connected"}
    await first.close()
    await second.close()


async def test_telemetry_leaves_at_the_aircrafts_rates(real: SimulatedDrone) -> None:
    session, heard = await join(real)
    await heard.until(lambda messages: [type(m) for m in messages].count(ardrone3.GpsLocationChanged) == 3)
    await session.close()

    # Hz of the machine's clock, whatever the speed of the simulation; the first second may lack its beginning.
    span = heard.when(ardrone3.GpsLocationChanged)
    assert span[2] - span[0] == pytest.approx(2.0, abs=0.2)
    for kind, rate in ((ardrone3.AttitudeChanged, 5), (ardrone3.SpeedChanged, 5), (ardrone3.AltitudeChanged, 5)):
        count = sum(span[0] < now <= span[2] for now in heard.when(kind))
        assert count == pytest.approx(2 * rate, abs=2)
    assert sum(span[0] < now <= span[2] + 0.05 for now in heard.when(battery.Voltage)) == pytest.approx(2, abs=1)

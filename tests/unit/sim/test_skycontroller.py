"""The simulated Skycontroller over real sockets: what it answers, what it lets through, and who flies."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Callable
from typing import Any, TypeVar

import aiohttp
import pytest
from support.world import loopback

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link.controller import ControllerSession, connect
from anafi_mav.arsdk.messages import ardrone3, common, drone_manager, mapper, skyctrl
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.arsdk.messages.mapper import ButtonEvent
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.errors import ConfigError
from anafi_mav.sim import DroneSpec, LogEntry, SimulatedDrone, Simulator
from anafi_mav.sim.skycontroller import PITCH, RETURN_HOME, ROLL, TAKEOFF_LAND, YAW, Skycontroller

M = TypeVar("M", bound=Message)


class Station:
    """What is connected to the controller."""

    def __init__(self, drone: SimulatedDrone) -> None:
        self.drone = drone
        assert drone.skycontroller is not None
        self.sc: Skycontroller = drone.skycontroller
        self.heard: list[Message | UnknownMessage] = []
        self.session: ControllerSession
        self._news = asyncio.Event()

    async def connect(self) -> None:
        self.session = await connect(self.drone.address, on_message=self._receive)

    def _receive(self, message: Message | UnknownMessage, now: float) -> None:
        self.heard.append(message)
        self._news.set()
        self._news = asyncio.Event()

    def of(self, kind: type[M]) -> list[M]:
        return [message for message in self.heard if isinstance(message, kind)]

    async def wait(self, kind: type[M], accept: Callable[[M], bool] = lambda message: True, since: int = 0) -> M:
        async def find() -> M:
            while True:
                for message in self.heard[since:]:
                    if isinstance(message, kind) and accept(message):
                        return message
                await self._news.wait()

        return await asyncio.wait_for(find(), 8.0)

    async def ask(self, command: Message, answer: type[M]) -> M:
        mark = len(self.heard)
        self.session.send(command)
        return await self.wait(answer, since=mark)

    def commands(self, name: str) -> list[dict[str, Any]]:
        """What the drone was commanded."""
        return [entry.args for entry in self.drone.log if entry.kind == "command" and entry.name.endswith(name)]


@contextlib.asynccontextmanager
async def flying(model: str = "4k", http_port: int | None = None, speed: float = 5.0) -> AsyncIterator[Station]:
    spec = DroneSpec(model=model, address=loopback(), http_port=http_port, skycontroller=3)
    async with Simulator([spec], speed=speed, seed=1) as simulator:
        station = Station(simulator.drones[0])
        await station.connect()
        try:
            yield station
        finally:
            await station.session.close()


async def hovering(station: Station) -> None:
    station.session.send(ardrone3.TakeOff())
    await station.wait(ardrone3.FlyingStateChanged, lambda event: event.state is FlyingState.HOVERING)


def is_stick(entry: LogEntry) -> bool:
    return entry.kind == "command" and entry.name == "ardrone3.Piloting.PCMD"


async def test_skycontroller_reports_its_model_and_the_drone_behind_it() -> None:
    async with flying("thermal") as station:
        device = station.session.device
        assert device.model_id == 0x0918
        assert device.serial != station.drone.identity.serial
        await station.ask(skyctrl.AllStates(), skyctrl.AllStatesChanged)
        (connection,) = station.of(drone_manager.ConnectionState)
        assert connection.state is Connection.CONNECTED
        assert (connection.serial, connection.model) == (station.drone.identity.serial, 0x0919)
        assert [event.product for event in station.of(mapper.ActiveProduct)] == [0x0919]
        assert [event.source for event in station.of(skyctrl.PilotingSource)] == [Source.SKY_CONTROLLER]
        assert [event.percent for event in station.of(skyctrl.BatteryChanged)] == [87]
        assert station.of(mapper.GrabState) == [mapper.GrabState(0, 0, 0)]
        assert len(station.of(mapper.AxisMappingItem)) == 6
        assert station.of(drone_manager.KnownDroneItem)
        await station.ask(skyctrl.AllSettings(), skyctrl.AllSettingsChanged)
        assert [event.serialNumber for event in station.of(skyctrl.ProductSerialChanged)] == [device.serial]
        assert station.of(skyctrl.ProductVersionChanged)
        item = await station.ask(drone_manager.DiscoverDrones(), drone_manager.DroneListItem)
        assert item.serial == station.drone.identity.serial
        date = "20260101T120000+0100"
        assert (await station.ask(skyctrl.CurrentDateTime(date), skyctrl.CurrentDateTimeChanged)).datetime == date
        # None of it reached the drone; what is the drone's does, on the same link.
        assert station.commands("") == []
        await station.ask(common.AllStates(), common.AllStatesChanged)
        assert station.of(ardrone3.FlyingStateChanged)
        await station.ask(common.AllSettings(), common.AllSettingsChanged)
        assert station.of(common.ProductSerialHighChanged)
        assert not [message for message in station.heard if isinstance(message, UnknownMessage)]


async def test_its_attitude_comes_twenty_times_a_second() -> None:
    async with flying() as station:
        station.sc.attitude = (0.0, 0.0, math.pi / 2)
        await station.wait(skyctrl.AttitudeChanged, lambda event: event.q3 == pytest.approx(math.sqrt(0.5)))
        mark = len(station.of(skyctrl.AttitudeChanged))
        began = asyncio.get_running_loop().time()
        await station.wait(skyctrl.AttitudeChanged, lambda event: len(station.of(skyctrl.AttitudeChanged)) >= mark + 20)
        assert asyncio.get_running_loop().time() - began == pytest.approx(1.0, abs=0.35)


async def test_the_sticks_fly_until_the_source_is_the_controller() -> None:
    async with flying() as station:
        await hovering(station)
        forward = ardrone3.PCMD(1, 0, 30, 0, 0, 0)
        for _ in range(5):
            station.session.send(forward)
        await station.drone.wait_log(lambda entry: station.sc.dropped == 5)
        assert station.commands("PCMD") == []

        station.sc.stick(ROLL, 40)
        station.sc.stick(YAW, -20)
        await station.drone.wait_log(is_stick)
        assert {key: station.commands("PCMD")[-1][key] for key in ("flag", "roll", "pitch", "yaw", "gaz")} == {
            "flag": 1, "roll": 40, "pitch": 0, "yaw": -20, "gaz": 0,
        }  # fmt: skip

        observed = await station.ask(skyctrl.SetPilotingSource(Source.CONTROLLER), skyctrl.PilotingSource)
        assert observed.source is Source.CONTROLLER
        count = len(station.commands("PCMD"))
        station.session.send(forward)
        await station.drone.wait_log(lambda entry: is_stick(entry) and entry.args["pitch"] == 30)
        assert len(station.commands("PCMD")) == count + 1  # the sticks are still deflected, and dead
        # Olympe waits for an answer also when nothing changes.
        await station.ask(skyctrl.SetPilotingSource(Source.CONTROLLER), skyctrl.PilotingSource)
        await station.ask(skyctrl.SetPilotingSource(Source.SKY_CONTROLLER), skyctrl.PilotingSource)
        assert station.sc.source is Source.SKY_CONTROLLER


async def test_grabbed_axes_and_buttons_are_reported_without_effect() -> None:
    async with flying() as station:
        await hovering(station)
        state = await station.ask(mapper.Grab(1 << RETURN_HOME | 1 << 11, 1 << PITCH), mapper.GrabState)
        assert (state.buttons, state.axes) == (1 << RETURN_HOME | 1 << 11, 1 << PITCH)
        station.sc.stick(PITCH, 100)
        await station.wait(mapper.GrabAxisEvent, lambda event: (event.axis, event.value) == (PITCH, 100))
        await station.wait(mapper.GrabButtonEvent, lambda event: event == mapper.GrabButtonEvent(11, ButtonEvent.PRESS))
        station.sc.press(RETURN_HOME)
        await station.wait(mapper.GrabButtonEvent, lambda event: event.button == RETURN_HOME)
        assert station.commands("return_to_home") == []
        assert station.commands("PCMD") == []
        # Given back, both work again.
        await station.ask(mapper.Grab(0, 0), mapper.GrabState)
        await station.drone.wait_log(is_stick)
        station.sc.stick(PITCH, 0)
        station.sc.press(RETURN_HOME)
        await station.drone.wait_log(lambda entry: entry.kind == "command" and "return_to_home" in entry.name)


async def test_the_take_off_button_lands_too() -> None:
    async with flying() as station:
        station.sc.press(TAKEOFF_LAND)
        station.sc.release(TAKEOFF_LAND)
        await station.wait(ardrone3.FlyingStateChanged, lambda event: event.state is FlyingState.HOVERING)
        station.sc.press(TAKEOFF_LAND)
        await station.wait(ardrone3.FlyingStateChanged, lambda event: event.state is FlyingState.LANDING)


async def test_sticks_fly_the_drone_after_the_computer_disconnects() -> None:
    async with flying() as station:
        await hovering(station)
        await station.ask(skyctrl.SetPilotingSource(Source.CONTROLLER), skyctrl.PilotingSource)
        await station.ask(mapper.Grab(0, 0x0F), mapper.GrabState)
        await station.session.close()
        mark = station.drone.log[-1].t
        station.sc.stick(ROLL, 30)
        await station.drone.wait_log(lambda entry: entry.kind == "session" and entry.name == "lost", 12.0)
        assert station.sc.source is Source.SKY_CONTROLLER
        assert (station.sc.grabbed_axes, station.sc.grabbed_buttons) == (0, 0)
        await station.drone.wait_log(is_stick, since=mark)
        assert station.drone.flying_state in (FlyingState.HOVERING, FlyingState.FLYING)


async def test_out_of_the_controllers_reach_the_drone_is_not_heard() -> None:
    async with flying() as station:
        await station.ask(skyctrl.AllStates(), skyctrl.AllStatesChanged)
        station.sc.radio = False
        await station.wait(drone_manager.ConnectionState, lambda event: event.state is Connection.SEARCHING)
        count = len(station.commands(""))
        station.session.send(common.AllStates())
        await station.ask(skyctrl.AllStates(), skyctrl.AllStatesChanged)
        assert len(station.commands("")) == count
        mark = len(station.heard)
        station.sc.radio = True
        await station.wait(drone_manager.ConnectionState, lambda event: event.state is Connection.CONNECTED, mark)
        await station.ask(common.AllStates(), common.AllStatesChanged)


async def test_the_drones_web_server_is_a_hundred_ports_up() -> None:
    async with flying(http_port=8080) as station:
        assert station.drone.http_port == 8180
        async with (
            aiohttp.ClientSession() as web,
            web.get(f"http://{station.drone.address}:8180/api/v1/info/properties") as answer,
        ):
            assert (await answer.json())["serial"] == station.drone.identity.serial


@pytest.mark.parametrize(("model", "generation"), [("ai", 3), ("4k", 2)])
def test_controllers_that_do_not_exist(model: str, generation: int) -> None:
    with pytest.raises(ConfigError, match="skycontroller: expected"):
        DroneSpec(model=model, skycontroller=generation)


async def test_sticks_that_do_not_exist() -> None:
    async with flying() as station:
        for axis, percent in ((6, 0), (-1, 0), (0, 101)):
            with pytest.raises(ValueError, match="axis"):
                station.sc.stick(axis, percent)

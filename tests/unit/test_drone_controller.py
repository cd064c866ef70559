"""The drone behind a Skycontroller: what is read of the controller, and who flies when."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass

import pytest
from support.world import loopback

from anafi_mav.arsdk.messages import animation, ardrone3, drone_manager, mapper, rth, skyctrl
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.arsdk.wire import Message
from anafi_mav.drone import Drone, PilotingCommand
from anafi_mav.drone.controller import PILOT_KEEPS, STICKS, TILT, is_motion
from anafi_mav.drone.moves import MoveEnd
from anafi_mav.errors import CommandRejected, LinkLost, LocalProtocolError, NotSupported
from anafi_mav.sim import DroneSpec, LogEntry, SimulatedDrone, Simulator
from anafi_mav.sim.skycontroller import PITCH, RETURN_HOME, ROLL, TAKEOFF_LAND, Skycontroller

FORWARD = PilotingCommand(pitch_deg=-5.0)


@dataclass
class Crew:
    """The aircraft with its pilot on one side, our drone on the other."""

    real: SimulatedDrone
    sc: Skycontroller
    drone: Drone

    async def take_off(self) -> None:
        await self.drone.piloting.take_off()
        if self.drone.piloting.state.flying != FlyingState.HOVERING:
            await self.drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.HOVERING, 10.0)

    @contextlib.asynccontextmanager
    async def piloting(self) -> AsyncIterator[None]:
        """A user who moves the sticks of a ground station and does not stop."""

        async def fly() -> None:
            while True:
                self.drone.piloting.pilot(FORWARD)
                await asyncio.sleep(0.05)

        task = asyncio.create_task(fly())
        try:
            yield
        finally:
            task.cancel()

    async def until(self, accept: Callable[[LogEntry], bool], since: float = -math.inf) -> LogEntry:
        return await self.real.wait_log(accept, 8.0, since=since)

    async def grabbed(self, axes: int) -> None:
        await until(lambda: self.sc.grabbed_axes == axes)

    def sticks(self, since: float = -math.inf) -> list[int]:
        """Pitch of each PCMD that reached the drone."""
        return [entry.args["pitch"] for entry in self.real.log.find("command", since=since) if "PCMD" in entry.name]

    def told(self, name: str) -> list[LogEntry]:
        """What the controller itself was told."""
        return [entry for entry in self.real.log.find("controller") if entry.name.endswith(name)]


async def until(true: Callable[[], bool], timeout: float = 8.0) -> None:
    deadline = now() + timeout
    while not true():
        assert now() < deadline
        await asyncio.sleep(0.01)


def now() -> float:
    return asyncio.get_running_loop().time()


@pytest.fixture(params=[3, 4])
async def crew(request: pytest.FixtureRequest) -> AsyncIterator[Crew]:
    """Over UDP and over the mux."""
    spec = DroneSpec(model="thermal", address=loopback(), http_port=None, skycontroller=request.param)
    async with Simulator([spec], speed=3.0, seed=1) as simulator:
        real = simulator.drones[0]
        assert real.skycontroller is not None
        drone = Drone(real.address, name="behind")
        await drone.connect()
        yield Crew(real, real.skycontroller, drone)
        await drone.close()


async def test_both_are_read(crew: Crew) -> None:
    identity, state = crew.drone.identity, crew.drone.controller.state
    assert identity.model.key == "thermal"
    assert identity.serial == crew.real.identity.serial
    assert crew.drone.controller.present
    assert (state.serial, state.firmware) == (crew.sc.info.serial, "1.8.2")
    assert state.battery_percent == 87
    assert state.battery is skyctrl.BatteryStatus.DISCHARGING
    assert state.link is Connection.CONNECTED
    assert (state.drone_serial, state.drone_model) == (identity.serial, 0x0919)
    assert state.source is Source.SKY_CONTROLLER
    assert (state.grabbed_axes, state.grabbed_buttons) == (0, 0)
    assert list(state.known) == [identity.serial]
    assert state.known[identity.serial].has_key
    crew.sc.attitude = (0.0, 0.0, math.pi / 2)
    # Turned to the east: w = z = cos 45 degrees.
    await crew.drone.expect(skyctrl.AttitudeChanged, lambda m: m.q3 > 0.7)
    attitude = crew.drone.controller.state.attitude
    assert attitude is not None
    assert (attitude.w, attitude.x, attitude.y, attitude.z) == pytest.approx((0.7071, 0, 0, 0.7071), abs=1e-4)
    assert crew.drone.counters["unknown message"] == 0


async def test_connecting_and_taking_off_leaves_the_sticks_to_the_pilot(crew: Crew) -> None:
    await crew.take_off()
    crew.drone.piloting.hover()
    await asyncio.sleep(0.3)
    assert crew.told("setPilotingSource") == []
    assert crew.told("grab") == []
    crew.sc.stick(PITCH, 50)
    await crew.until(lambda entry: entry.kind == "command" and "PCMD" in entry.name)


async def test_a_setpoint_takes_the_source_and_silence_gives_it_back(crew: Crew) -> None:
    await crew.take_off()
    async with crew.piloting():
        await crew.grabbed(STICKS)
        await until(lambda: crew.sc.source is Source.CONTROLLER)
        await until(lambda: 50 in crew.sticks())  # 5 of 10 degrees, nose down
        await until(lambda: crew.drone.controller.state.source is Source.CONTROLLER)
        await until(lambda: crew.drone.controller.state.grabbed_axes == STICKS)
        assert crew.sc.grabbed_buttons == 0
    quiet = now()
    await until(lambda: crew.sc.source is Source.SKY_CONTROLLER)
    assert now() - quiet < 1.3  # the sticks hold for 0.5 s, then it is quiet for 0.5 s
    await crew.grabbed(0)
    assert [entry.args["axes"] for entry in crew.told("grab")] == [STICKS, 0]


async def test_a_stick_of_the_pilot_takes_the_drone_at_once(crew: Crew) -> None:
    await crew.take_off()
    async with crew.piloting():
        await until(lambda: crew.sc.source is Source.CONTROLLER)
        await until(lambda: 50 in crew.sticks())
        crew.sc.stick(ROLL, 10)  # touched, not meant
        await asyncio.sleep(0.3)
        assert crew.sc.source is Source.CONTROLLER
        moved = now()
        crew.sc.stick(ROLL, 11)
        await until(lambda: crew.sc.source is Source.SKY_CONTROLLER)
        await crew.grabbed(0)
        assert now() - moved < 0.25
        assert crew.drone.controller.pilot_flies
        # The user goes on, and is not heard: it is the pilot who flies.
        flown = now()
        await asyncio.sleep(PILOT_KEEPS + 0.5)
        assert crew.sc.source is Source.SKY_CONTROLLER
        assert set(crew.sticks(flown)) == {0}
    crew.sc.stick(ROLL, 0)
    await until(lambda: not crew.drone.controller.pilot_flies)
    # After a pause the user may have it again.
    async with crew.piloting():
        await until(lambda: crew.sc.source is Source.CONTROLLER)


async def test_a_move_holds_the_source_to_its_end(crew: Crew) -> None:
    await crew.take_off()
    began = now()
    flight = asyncio.create_task(crew.drone.piloting.move_by(12.0, 0.0, 0.0, 0.0))
    await until(lambda: crew.sc.source is Source.CONTROLLER)
    flown = await flight
    assert now() - began > 1.0  # longer than the quiet time
    assert crew.sc.source is Source.CONTROLLER
    assert flown.front == pytest.approx(12.0, abs=0.5)
    await until(lambda: crew.sc.source is Source.SKY_CONTROLLER, 1.5)
    await crew.grabbed(0)


async def test_a_stick_of_the_pilot_ends_a_move(crew: Crew) -> None:
    await crew.take_off()
    latitude, longitude = crew.real.spec.home[0] + 0.001, crew.real.spec.home[1]
    move = await crew.drone.piloting.move_to(latitude, longitude, 5.0)
    await crew.grabbed(STICKS)
    crew.sc.stick(PITCH, -60)
    assert await asyncio.wait_for(move.result(), 3.0) is MoveEnd.CANCELED
    await until(lambda: crew.sc.source is Source.SKY_CONTROLLER)
    await crew.until(lambda entry: entry.kind == "command" and entry.name.endswith("CancelMoveTo"))
    await until(lambda: -60 in crew.sticks())
    with pytest.raises(CommandRejected, match="the pilot"):
        await crew.drone.piloting.move_to(latitude, longitude, 5.0)
    # What is not motion is not refused.
    await crew.drone.piloting.land()


async def test_the_pilots_buttons_work_while_a_user_flies(crew: Crew) -> None:
    await crew.take_off()
    async with crew.piloting():
        await crew.grabbed(STICKS)
        crew.sc.press(RETURN_HOME)
        await crew.drone.expect(rth.State, lambda m: m.state != rth.RthState.AVAILABLE)
    crew.sc.press(TAKEOFF_LAND)
    await crew.drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.LANDING, 5.0)


async def test_the_end_of_the_program_gives_everything_back(crew: Crew) -> None:
    await crew.take_off()
    async with crew.piloting():
        await until(lambda: crew.sc.source is Source.CONTROLLER)
        mark = now()
        await crew.drone.close()
    await until(lambda: crew.sc.source is Source.SKY_CONTROLLER, 1.0)
    # It was told so, and did not find it out by itself.
    assert [entry.args for entry in crew.told("setPilotingSource") if entry.t >= mark] == [
        {"source": Source.SKY_CONTROLLER}
    ]
    assert crew.sc.grabbed_axes == 0


async def test_a_controller_that_loses_the_drone_is_a_lost_link(crew: Crew) -> None:
    crew.sc.radio = False
    reason = await asyncio.wait_for(asyncio.shield(crew.drone.lost), 3.0)
    assert reason == "the Skycontroller lost the drone: searching"
    assert not crew.drone.connected
    with pytest.raises(LinkLost, match="the Skycontroller has no drone: searching"):
        await crew.drone.connect()
    attempt = asyncio.create_task(crew.drone.connect())
    await crew.until(lambda entry: entry.kind == "controller" and "AllStates" in entry.name)
    await asyncio.sleep(0.3)
    crew.sc.radio = True
    await attempt
    assert crew.drone.identity.model.key == "thermal"


async def test_what_may_be_grabbed(crew: Crew) -> None:
    controller = crew.drone.controller
    await controller.grab(axes=1 << TILT, buttons=1 << 2)
    crew.sc.stick(TILT, 30)
    crew.sc.press(2)
    await until(lambda: controller.state.pressed == {2})
    assert controller.state.axes == {TILT: 30}
    crew.sc.release(2)
    await until(lambda: controller.state.pressed == frozenset())
    # A motion grabs the sticks besides, and its end leaves the rest as it was.
    await crew.take_off()
    async with crew.piloting():
        await crew.grabbed(STICKS | 1 << TILT)
    await crew.grabbed(1 << TILT)
    assert crew.sc.grabbed_buttons == 1 << 2
    await controller.grab()
    assert (controller.state.grabbed_axes, controller.state.grabbed_buttons) == (0, 0)
    for axes, buttons in ((STICKS, 0), (0, 1 << RETURN_HOME), (0, 1 << TAKEOFF_LAND)):
        with pytest.raises(LocalProtocolError):
            await controller.grab(axes, buttons)


async def test_its_drones(crew: Crew) -> None:
    controller, serial = crew.drone.controller, crew.real.identity.serial
    seen = await controller.discover_drones()
    assert seen[serial].active
    assert seen[serial].rssi_dbm == -40
    await controller.connect_drone(serial)
    with pytest.raises(CommandRejected, match="knows no drone X"):
        await controller.forget_drone("X")
    await controller.forget_drone(serial)
    assert controller.state.known == {}


@pytest.mark.parametrize("generation", [3, 4])
async def test_the_web_server_of_the_drone_is_reached(generation: int) -> None:
    spec = DroneSpec(address=loopback(), http_port=8080, skycontroller=generation)
    async with Simulator([spec], speed=3.0, seed=1) as simulator:
        drone = Drone(spec.address, name="behind", http_port=8080)
        await drone.connect()
        body = b"QGC WPL 120\n" + b"# padding\n" * 150_000  # more than is sent without an acknowledgement
        with contextlib.suppress(CommandRejected):  # too large for a flight plan; it has to arrive to be refused
            await drone._rest.json("PUT", "/api/v1/upload/flightplan", data=body)
        answer = await drone._rest.json("GET", "/api/v1/info/properties")
        assert answer["serial"] == simulator.drones[0].identity.serial
        await drone.close()


async def test_without_a_controller_there_is_none() -> None:
    async with Simulator([DroneSpec(address=loopback(), http_port=None)], speed=3.0, seed=1) as simulator:
        drone = Drone(simulator.drones[0].address, name="direct")
        await drone.connect()
        assert not drone.controller.present
        assert drone.controller.state.serial is None
        with pytest.raises(NotSupported, match="no Skycontroller"):
            await drone.controller.discover_drones()
        await drone.piloting.take_off()
        await drone.close()
        assert not [entry for entry in simulator.drones[0].log if entry.name.startswith(("skyctrl.", "mapper."))]


@pytest.mark.parametrize(
    ("message", "motion"),
    [
        (ardrone3.PCMD(1, 0, 0, 0, 1, 0), True),
        (ardrone3.PCMD(1, 0, 0, 0, 0, 7), False),
        (ardrone3.MoveBy(0.0, 0.0, 0.0, 0.1), True),
        (ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0), False),
        (ardrone3.MoveTo(48.0, 2.0, 5.0, ardrone3.OrientationMode.NONE, 0.0), True),
        (ardrone3.CancelMoveTo(), False),
        (ardrone3.TakeOff(), False),
        (ardrone3.Landing(), False),
        (rth.ReturnToHome(), False),
        (animation.Cancel(), False),
    ],
)
def test_what_motion_is(message: Message, motion: bool) -> None:
    assert is_motion(message) is motion


async def test_odd_words_of_a_controller_are_survived(crew: Crew) -> None:
    real = crew.real.session
    assert real is not None
    for event in (
        mapper.GrabAxisEvent(0xFFFFFFFF, 100),
        mapper.GrabButtonEvent(0xFFFFFFFF, mapper.ButtonEvent.PRESS),
        skyctrl.AttitudeChanged(math.nan, 0.0, 0.0, 0.0),
        skyctrl.BatteryChanged(255),
        drone_manager.DroneListItem("", 0, "", 0, 0, 0, drone_manager.Security.NONE, 0, 0, 4),
    ):
        real.send(event)
    await until(lambda: crew.drone.controller.state.battery_percent is None)
    await until(lambda: crew.drone.controller.state.visible == {})
    assert crew.drone.controller.state.axes == {}
    assert crew.drone.connected

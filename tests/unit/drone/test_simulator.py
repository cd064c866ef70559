"""The drone and the simulator, which share no line above the wire: every verb flown, judged by the true pose."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from support.fault_scenarios import watched
from support.world import loopback

from anafi_mav import geo
from anafi_mav.arsdk.messages import alarms, ardrone3, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.rth import RthState
from anafi_mav.drone import Drone, MoveEnd, PilotingCommand
from anafi_mav.errors import CommandRejected, CommandTimeout
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator

HOME = (48.8789, 2.3677, 35.0)


@pytest.fixture
async def real() -> AsyncIterator[SimulatedDrone]:
    """The aircraft, in a world that runs five times as fast."""
    spec = DroneSpec(address="127.0.0.1", home=HOME, discovery_port=0, handshake_port=0, c2d_port=0, http_port=None)
    async with Simulator([spec], speed=5.0, seed=1) as simulator:
        yield simulator.drones[0]


@pytest.fixture
async def drone(real: SimulatedDrone) -> AsyncIterator[Drone]:
    drone = Drone("127.0.0.1", discovery_port=real.discovery_port, name="simulated")
    await drone.connect()
    yield drone
    await drone.close()


async def flying(drone: Drone) -> None:
    await drone.piloting.take_off()
    if drone.piloting.state.flying != FlyingState.HOVERING:
        await drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.HOVERING, 10.0)


def commands(real: SimulatedDrone, since: float = -math.inf) -> list[str]:
    return [entry.name.rpartition(".")[2] for entry in real.log.find("command", since=since)]


def now() -> float:
    return asyncio.get_running_loop().time()


async def test_simulator_reports_everything_the_elements_read(drone: Drone) -> None:
    assert drone.identity.model.key == "4k"
    assert drone.identity.serial
    assert drone.identity.firmware
    piloting, home = drone.piloting.state, drone.home.state
    assert piloting.flying == FlyingState.LANDED
    assert piloting.max_tilt is not None
    # the firmware's defaults
    assert piloting.max_tilt.current == 10.0
    assert drone.piloting.limits is not None
    assert home.location is None
    assert home.min_altitude is not None
    assert home.rth is not None
    assert drone.gps.state.fixed
    assert drone.gps.state.satellites
    assert drone.battery.state.percent
    assert drone.link.state.quality in range(1, 6)
    assert drone.calibration.state.magneto_required is False
    assert drone.calibration.state.sensors_ok
    assert drone.takeoff_blockers() == []
    await drone.expect(ardrone3.AttitudeChanged)
    if drone.gps.state.location is None:
        await drone.expect(ardrone3.GpsLocationChanged)
    assert drone.gps.state.location is not None
    assert drone.gps.state.location.latitude == pytest.approx(HOME[0], abs=1e-6)


async def test_take_off_and_land(drone: Drone, real: SimulatedDrone) -> None:
    await drone.piloting.take_off()
    assert drone.piloting.state.flying == FlyingState.TAKINGOFF
    await drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.HOVERING, 10.0)
    assert real.pose.up > 0.7
    assert drone.home.state.location is not None
    said = asyncio.ensure_future(
        drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.LANDING, 10.0)
    )
    landed = asyncio.ensure_future(
        drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.LANDED, 10.0)
    )
    await drone.piloting.land()
    await said
    await landed
    assert real.pose.up < 0.05


async def test_take_off_without_a_calibrated_magnetometer(drone: Drone, real: SimulatedDrone) -> None:
    real.faults.magneto_required = True
    await real.wait_log(lambda e: e.name == "alarms.takeoff_checklist" and e.args["state"] is alarms.State.ON)
    with pytest.raises(CommandRejected, match="magneto"):
        await drone.piloting.take_off(timeout=0.5)
    assert real.flying_state == FlyingState.LANDED


async def test_move_by(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    start = real.pose
    flown = await drone.piloting.move_by(4.0, 3.0, -2.0, math.pi / 2)
    assert (flown.front, flown.right, flown.down) == pytest.approx((4.0, 3.0, -2.0), abs=0.3)
    assert flown.turn == pytest.approx(math.pi / 2, abs=0.1)
    pose = real.pose
    # Heading north at the start: front is north, right is east.
    assert start.yaw == pytest.approx(0.0, abs=0.05)
    assert (pose.north - start.north, pose.east - start.east) == pytest.approx((4.0, 3.0), abs=0.5)
    assert pose.up - start.up == pytest.approx(2.0, abs=0.3)
    assert drone.moves_started == ()


async def test_move_by_on_the_ground_is_refused(drone: Drone) -> None:
    with pytest.raises(CommandRejected, match="not available"):
        await drone.piloting.move_by(1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("speed", [None, 3.0])
async def test_move_to(drone: Drone, real: SimulatedDrone, speed: float | None) -> None:
    await flying(drone)
    latitude, longitude = geo.destination(HOME[0], HOME[1], 20.0, 10.0)
    journey = await drone.piloting.move_to(latitude, longitude, 5.0, heading_deg=90.0, horizontal_speed=speed)
    assert drone.moves_started == (journey,)
    assert await asyncio.wait_for(journey.result(), 20.0) is MoveEnd.DONE
    assert (real.pose.north, real.pose.east, real.pose.up) == pytest.approx((20.0, 10.0, 5.0), abs=0.5)
    assert math.degrees(real.pose.yaw) == pytest.approx(90.0, abs=3.0)


async def test_move_to_above_the_ceiling_is_refused(drone: Drone) -> None:
    await flying(drone)
    with pytest.raises(CommandRejected):
        await drone.piloting.move_to(HOME[0], HOME[1], 1000.0)


async def test_hover_stops_a_move_to_and_logs_it(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    latitude, longitude = geo.destination(HOME[0], HOME[1], 80.0, 0.0)
    journey = await drone.piloting.move_to(latitude, longitude, 5.0)
    await real.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 10.0)
    began = now()
    drone.piloting.hover()
    assert await asyncio.wait_for(journey.result(), 5.0) is MoveEnd.CANCELED
    await drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.HOVERING, 10.0)
    assert real.pose.north < 40.0
    await real.wait_log(
        lambda e: e.name.endswith(".moveToChanged") and e.args["status"] is ardrone3.MoveToStatus.CANCELED, since=began
    )
    sent = commands(real, since=began)
    assert sent.count("CancelMoveTo") == 1
    assert set(sent) == {"CancelMoveTo", "PCMD"}


async def test_stop_ends_a_move_by_and_a_return(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    relative = asyncio.ensure_future(drone.piloting.move_by(60.0, 0.0, 0.0, 0.0))
    await real.wait_log(lambda e: e.name == "ardrone3.Piloting.moveBy")
    await drone.piloting.stop()
    with pytest.raises(CommandRejected):
        await relative
    assert real.pose.north < 30.0
    home = await drone.piloting.return_home()
    assert home is not None
    await drone.piloting.stop()
    assert await home.result() is MoveEnd.CANCELED
    assert drone.home.state.rth == RthState.AVAILABLE


@asynccontextmanager
async def held(drone: Drone, command: PilotingCommand) -> AsyncIterator[None]:
    """A person holds the sticks: a deflection has to be renewed."""

    async def renew() -> None:
        while True:
            drone.piloting.pilot(command)
            await asyncio.sleep(0.1)

    task = asyncio.ensure_future(renew())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


async def test_sticks_move_the_drone_in_their_direction(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    start = real.pose
    # Nose down, right, and up: heading north that is north, east and up.
    async with held(drone, PilotingCommand(roll_deg=5.0, pitch_deg=-5.0, climb_mps=1.5)):
        await real.wait_log(lambda e: e.kind == "pose" and e.args["north"] > start.north + 2.0, 10.0)
        await real.wait_log(lambda e: e.kind == "pose" and e.args["east"] > start.east + 2.0, 10.0)
    assert real.pose.up > start.up + 1.0
    async with held(drone, PilotingCommand(yaw_rate_dps=20.0)):
        await real.wait_log(lambda e: e.kind == "pose" and e.args["yaw"] > 0.5, 10.0)
    drone.piloting.pilot(None)
    await drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == FlyingState.HOVERING, 10.0)
    last = real.log.find("command", "PCMD")[-1].args
    assert [last[name] for name in ("flag", "roll", "pitch", "yaw", "gaz")] == [0, 0, 0, 0, 0]


async def test_no_pcmd_while_landing(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    async with held(drone, PilotingCommand(climb_mps=2.0)):
        await real.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 8.0, 10.0)
    land = asyncio.ensure_future(drone.piloting.land())
    ordered = await real.wait_log(lambda e: e.name == "ardrone3.Piloting.Landing")
    drone.piloting.pilot(PilotingCommand(climb_mps=2.0))
    await land
    while drone.piloting.state.flying != FlyingState.LANDED:
        drone.piloting.pilot(PilotingCommand(climb_mps=2.0))
        drone.piloting.hover()
        await asyncio.sleep(0.02)  # a program that streams setpoints, whatever the drone does
    assert list(real.log.find("command", "PCMD", since=ordered.t)) == []
    assert real.pose.up < 0.05


async def test_return_home_flies_home(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    latitude, longitude = geo.destination(HOME[0], HOME[1], 30.0, 0.0)
    journey = await drone.piloting.move_to(latitude, longitude, 5.0)
    assert await asyncio.wait_for(journey.result(), 20.0) is MoveEnd.DONE
    assert await drone.piloting.set_min_altitude(25.0) == 25.0
    home = await drone.piloting.return_home()
    assert home is not None
    await real.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 24.0, 10.0)
    assert await asyncio.wait_for(home.result(), 30.0) is MoveEnd.DONE
    assert (real.pose.north, real.pose.east) == pytest.approx((0.0, 0.0), abs=1.0)


async def test_return_home_right_after_the_sticks(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    async with held(drone, PilotingCommand(pitch_deg=-8.0)):
        await real.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 10.0)
    home = await drone.piloting.return_home()
    assert home is not None
    if drone.home.state.rth != RthState.IN_PROGRESS:
        await drone.expect(rth.State, lambda m: m.state == RthState.IN_PROGRESS, 10.0)


async def test_settings_are_clamped_by_the_drone(drone: Drone) -> None:
    assert await drone.piloting.set_max_tilt(90.0) == 40.0
    assert await drone.piloting.set_max_tilt(20.0) == 20.0
    assert await drone.piloting.set_max_tilt(20.0) == 20.0
    assert await drone.piloting.set_max_altitude(60.0) == 60.0
    assert await drone.piloting.set_max_distance(1.0) == 10.0
    assert await drone.piloting.set_max_vertical_speed(2.0) == 2.0
    assert await drone.piloting.set_max_rotation_speed(500.0) == 200.0
    assert await drone.piloting.set_min_altitude(5.0) == 20.0
    limits = drone.piloting.limits
    assert limits is not None
    assert (limits.tilt_deg, limits.climb_mps, limits.yaw_rate_dps) == (20.0, 2.0, 200.0)


async def test_emergency_cuts_the_motors(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    await drone.piloting.emergency()
    assert drone.piloting.state.motors_on is False
    await real.wait_log(lambda e: e.kind == "pose" and e.args["up"] < 0.05, 5.0)


async def test_timed_out_verb_is_never_carried_out(drone: Drone, real: SimulatedDrone) -> None:
    real.faults.mute = True
    with pytest.raises(CommandTimeout):
        await drone.piloting.take_off(timeout=0.4)
    real.faults.mute = False
    assert await drone.piloting.set_max_tilt(15.0) == 15.0
    assert "TakeOff" not in commands(real)


async def test_the_link_is_lost_in_silence_and_found_again(drone: Drone, real: SimulatedDrone) -> None:
    await flying(drone)
    latitude, longitude = geo.destination(HOME[0], HOME[1], 80.0, 0.0)
    journey = await drone.piloting.move_to(latitude, longitude, 5.0)
    drone.piloting.state  # noqa: B018
    lost = drone.lost
    real.faults.mute = True
    # Half a second more than the silence of 2.5 s. However late the machine is, it runs its timers in their order.
    await asyncio.wait([lost], timeout=3.0)
    for _ in range(5):
        await asyncio.sleep(0)  # what the timer has set off takes some event-loop iterations to be reported
    assert lost.done()
    assert "nothing received for" in lost.result()
    assert drone.fading
    assert await journey.result() is MoveEnd.LINK_LOST
    real.faults.mute = False
    reconnected = now()
    await drone.connect()
    assert drone.connected
    assert drone.moves_started == ()
    assert drone.piloting.state.in_air
    # The session of before goes on; what flew is stopped, once more than in the silence, and nothing resumes.
    await real.wait_log(lambda entry: entry.name.endswith("moveBy"), since=reconnected)
    sent = commands(real, since=reconnected)
    assert [name for name in sent if name != "PCMD"] == ["CancelMoveTo", "CancelMoveTo", "moveBy"]


@pytest.mark.parametrize("is_same", [True, False])
async def test_hover_after_a_silence_is_for_the_aircraft_that_was_silent(is_same: bool) -> None:
    """Each ANAFI has 192.168.42.1 in its own Wi-Fi: another one that flies there was not this program's to stop."""
    address = loopback()

    def aircraft(serial: str) -> Simulator:
        spec = DroneSpec(address=address, home=HOME, serial=serial, http_port=None, rtsp_port=None)
        return Simulator([spec], speed=5.0, seed=1)

    drone = Drone(address)
    async with aircraft("PI040416AA0A000001") as simulator:
        await drone.connect()
        await flying(drone)
        simulator.drones[0].faults.mute = True
        await asyncio.wait([drone.lost])
    async with aircraft("PI040416AA0A000001" if is_same else "PI040416AA0A000002") as simulator:
        real = simulator.drones[0]
        real.firmware.receive(ardrone3.TakeOff(), now())  # another controller's command
        await real.wait_log(lambda entry: entry.name == "flying" and entry.args["to"] == "hovering")
        await drone.connect()
        await real.wait_log(lambda entry: entry.name.endswith("AllSettings"))
        await watched(0.2)  # the first PCMDs
        assert ("PCMD" in commands(real)) == is_same
        await drone.close()

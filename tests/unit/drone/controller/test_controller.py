"""The drone behind a Skycontroller: what is read of the controller, and who flies when."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass

import pytest
from support.clock import everybodys
from support.scripted_device import STATES, ScriptedDevice
from support.world import loopback

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import (
    animation,
    ardrone3,
    common,
    drone_manager,
    flight_plan,
    follow_me,
    mapper,
    move,
    rth,
    skyctrl,
)
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.arsdk.messages.proto import controller_network, device_manager, network
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.drone import Drone, PilotingCommand
from anafi_mav.drone.controller.controller import PILOT_KEEPS, STICKS, TILT, is_motion
from anafi_mav.drone.piloting.moves import Move, MoveEnd
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, LocalProtocolError, NotSupported
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

    async def sees(self, true: Callable[[], bool], timeout: float = 8.0) -> None:
        """Wait until this is true of the aircraft or its controller: looked at with every line of the log."""
        if not true():
            await self.real.wait_log(lambda entry: true(), timeout, since=now())

    async def hears(self, true: Callable[[], bool]) -> None:
        """Wait until this is true of our drone: looked at with every message."""
        if true():
            return
        found = asyncio.get_running_loop().create_future()
        undo = self.drone.subscribe(
            lambda message, now: found.set_result(None) if true() and not found.done() else None
        )
        try:
            await asyncio.wait_for(found, 8.0)
        finally:
            undo()

    async def grabbed(self, axes: int) -> None:
        await self.sees(lambda: self.sc.grabbed_axes == axes)

    def sticks(self, since: float = -math.inf) -> list[int]:
        """Pitch of each PCMD that reached the drone."""
        return [entry.args["pitch"] for entry in self.real.log.find("command", since=since) if "PCMD" in entry.name]

    def observed(self, name: str) -> list[LogEntry]:
        """Commands that the controller itself received."""
        return [entry for entry in self.real.log.find("controller") if entry.name.endswith(name)]


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


async def test_connecting_hover_and_return_leave_sticks_to_the_pilot(crew: Crew) -> None:
    """A take-off takes them until the first hover."""
    assert crew.observed("setPilotingSource") == []
    assert crew.observed("grab") == []
    await crew.take_off()
    await crew.hears(lambda: crew.drone.controller.pilot_has_source)
    taken = [entry.args["source"] for entry in crew.observed("setPilotingSource")]
    assert taken == [Source.CONTROLLER, Source.SKY_CONTROLLER]
    crew.drone.piloting.hover()
    await crew.drone.piloting.return_home()
    assert len(crew.observed("setPilotingSource")) == 2
    crew.sc.stick(PITCH, 50)
    await crew.until(lambda entry: entry.kind == "command" and "PCMD" in entry.name)
    assert crew.sc.dropped == 0  # no stick position of ours, level or not


async def test_setpoint_acquires_the_source_and_silence_releases_it(crew: Crew) -> None:
    await crew.take_off()
    async with crew.piloting():
        await crew.grabbed(STICKS)
        await crew.sees(lambda: crew.sc.source is Source.CONTROLLER)
        await crew.sees(lambda: 50 in crew.sticks())  # 5 of 10 degrees, nose down
        await crew.hears(lambda: crew.drone.controller.state.source is Source.CONTROLLER)
        await crew.hears(lambda: crew.drone.controller.state.grabbed_axes == STICKS)
        assert crew.sc.grabbed_buttons == 0
    quiet = now()
    await crew.sees(lambda: crew.sc.source is Source.SKY_CONTROLLER)
    assert now() - quiet < 1.3  # the sticks hold for 0.5 s, then it is quiet for 0.5 s
    await crew.grabbed(0)
    assert [entry.args["axes"] for entry in crew.observed("grab")] == [STICKS, 0]


async def test_pilots_stick_acquires_the_drone_immediately(crew: Crew) -> None:
    await crew.take_off()
    async with crew.piloting():
        await crew.sees(lambda: crew.sc.source is Source.CONTROLLER)
        await crew.sees(lambda: 50 in crew.sticks())
        touched = now()
        crew.sc.stick(ROLL, 10)  # not meant
        await crew.sees(lambda: len(crew.sticks(touched)) >= 6)
        assert crew.sc.source is Source.CONTROLLER
        moved = now()
        crew.sc.stick(ROLL, 11)
        await crew.sees(lambda: crew.sc.source is Source.SKY_CONTROLLER)
        await crew.grabbed(0)
        assert now() - moved < 0.25
        assert crew.drone.controller.pilot_acquired_control
        # The user goes on, and is not heard: it is the pilot who flies.
        flown = now()
        await crew.until(lambda entry: entry.t > flown + PILOT_KEEPS + 0.5)
        assert crew.sc.source is Source.SKY_CONTROLLER
        assert set(crew.sticks(flown)) == {0}
    crew.sc.stick(ROLL, 0)
    await crew.hears(lambda: not crew.drone.controller.pilot_acquired_control)
    # After a pause the user may have it again.
    async with crew.piloting():
        await crew.sees(lambda: crew.sc.source is Source.CONTROLLER)


async def test_move_holds_the_source_until_its_end(crew: Crew) -> None:
    await crew.take_off()
    began = now()
    flight = asyncio.create_task(crew.drone.piloting.move_by(12.0, 0.0, 0.0, 0.0))
    await crew.sees(lambda: crew.sc.source is Source.CONTROLLER)
    flown = await flight
    assert now() - began > 1.0  # longer than the quiet time
    assert crew.sc.source is Source.CONTROLLER
    assert flown.front == pytest.approx(12.0, abs=0.5)
    await crew.sees(lambda: crew.sc.source is Source.SKY_CONTROLLER, 1.5)
    await crew.grabbed(0)


async def test_a_stick_of_the_pilot_ends_a_move(crew: Crew) -> None:
    await crew.take_off()
    latitude, longitude = crew.real.spec.home[0] + 0.001, crew.real.spec.home[1]
    move = await crew.drone.piloting.move_to(latitude, longitude, 5.0)
    await crew.grabbed(STICKS)
    crew.sc.stick(PITCH, -60)
    assert await asyncio.wait_for(move.result(), 3.0) is MoveEnd.CANCELED
    await crew.sees(lambda: crew.sc.source is Source.SKY_CONTROLLER)
    await crew.until(lambda entry: entry.kind == "command" and entry.name.endswith("CancelMoveTo"))
    await crew.sees(lambda: -60 in crew.sticks())
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
        await crew.sees(lambda: crew.sc.source is Source.CONTROLLER)
        mark = now()
        await crew.drone.close()
    await crew.sees(lambda: crew.sc.source is Source.SKY_CONTROLLER, 1.0)
    # It received a report, and did not find it out by itself.
    assert [entry.args for entry in crew.observed("setPilotingSource") if entry.t >= mark] == [
        {"source": Source.SKY_CONTROLLER}
    ]
    assert crew.sc.grabbed_axes == 0


async def test_controller_losing_its_drone_is_a_lost_link(crew: Crew) -> None:
    crew.sc.radio = False
    reason = await asyncio.wait_for(asyncio.shield(crew.drone.lost), 3.0)
    assert reason == "the Skycontroller lost the drone: searching"
    assert not crew.drone.connected
    with pytest.raises(LinkLost, match="the Skycontroller has no drone: searching"):
        await crew.drone.connect()
    attempt = asyncio.create_task(crew.drone.connect())
    await crew.hears(lambda: crew.drone.controller.state.link is Connection.SEARCHING)
    crew.sc.radio = True
    await attempt
    assert crew.drone.identity.model.key == "thermal"


async def test_grab_of_axes_and_buttons(crew: Crew) -> None:
    controller = crew.drone.controller
    await controller.grab(axes=1 << TILT, buttons=1 << 2)
    crew.sc.stick(TILT, 30)
    crew.sc.press(2)
    await crew.hears(lambda: controller.state.pressed == {2})
    assert controller.state.axes == {TILT: 30}
    crew.sc.release(2)
    await crew.hears(lambda: controller.state.pressed == frozenset())
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


async def test_controller_lists_connects_and_forgets_drones(crew: Crew) -> None:
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


async def test_controller_with_protobuf_alone_is_supported() -> None:
    def device_info(uid: str) -> device_manager.DeviceInfo:
        return device_manager.DeviceInfo(uid=uid, model=0x091A, network_id="ANAFI-Ai")

    def known(*uids: str) -> device_manager.StateKnownDevices:
        secret = device_manager.WifiInfo(security=device_manager.WifiSecurity.WPA2, saved_key=True)
        return device_manager.StateKnownDevices(
            devices=tuple(device_manager.KnownDevice(info=device_info(uid), wifi=secret) for uid in uids)
        )

    def connected(uid: str) -> device_manager.State:
        return device_manager.State(connected=device_manager.ConnectionStateConnected(device=device_info(uid)))

    async with ScriptedDevice(0x091D) as device:
        device.script[skyctrl.AllStates] = lambda _: [skyctrl.AllStatesChanged()]
        device.script[skyctrl.AllSettings] = lambda _: [skyctrl.AllSettingsChanged()]
        device.script[device_manager.GetState] = lambda _: [
            device_manager.State(known_devices=known("A", "B"), searching=device_manager.ConnectionStateSearching()),
            connected("A"),
        ]
        cellular = network.LinksStatusLinkInfo(type=network.LinkType.CELLULAR, status=network.LinkStatus.UP)
        device.script[controller_network.GetState] = lambda _: [
            controller_network.State(links_status=network.LinksStatus(links=(cellular,)))
        ]
        drone = device.drone()
        await drone.connect()
        controller = drone.controller
        assert (drone.identity.model.key, drone.identity.serial, drone.identity.name) == ("ai", "A", "ANAFI-Ai")
        assert set(controller.state.known) == {"A", "B"}
        assert controller.state.known["B"].has_key
        assert controller.state.links == {network.LinkType.CELLULAR: network.LinkStatus.UP}

        seen = device_manager.DiscoveredDevice(
            info=device_info("B"), known=True, wifi_visibility=device_manager.DiscoveredDeviceWifiVisibility(rssi=-60)
        )
        device.script[device_manager.DiscoverDevices] = lambda _: [device_manager.DiscoveredDevices(devices=(seen,))]
        found = (await controller.discover_drones())["B"]
        assert (found.model, found.rssi_dbm, found.has_key, found.active) == (0x091A, -60, True, False)

        device.script[device_manager.ForgetDevice] = lambda m: [device_manager.State(known_devices=known("A"))]
        await controller.forget_drone("B")
        assert set(controller.state.known) == {"A"}
        refused = device_manager.ConnectionFailureReason.AUTHENTICATION_FAILED
        device.script[device_manager.ConnectDevice] = lambda m: [
            device_manager.ConnectionFailure(device=device_info(m.uid), reason=refused)
        ]
        with pytest.raises(CommandRejected, match="passphrase"):
            await controller.connect_drone("B", "wrong")
        sent = device.got(device_manager.ConnectDevice)[-1]
        assert sent == device_manager.ConnectDevice(
            uid="B", wifi=device_manager.ConnectDeviceWifi(security_key="wrong")
        )

        device.say(device_manager.State(idle=device_manager.ConnectionStateIdle()))
        assert await asyncio.wait_for(asyncio.shield(drone.lost), 3.0) == "the Skycontroller lost the drone: idle"
        assert device.got(drone_manager.DiscoverDrones) == []


async def test_drone_without_controller_reports_no_controller() -> None:
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
        (move.ExtendedMoveTo(48.0, 2.0, 5.0, move.OrientationMode.NONE, 0.0, 1.0, 1.0, 1.0), True),
        (move.ExtendedMoveBy(1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0), True),
        (ardrone3.StartPilotedPOIV2(48.0, 2.0, 5.0, ardrone3.PoiMode.FREE_GIMBAL), True),
        (common.Start("abc", common.MavlinkType.FLIGHT_PLAN), True),
        (flight_plan.StartAt("abc", "abc", flight_plan.MavlinkType.FLIGHT_PLAN, 0), True),
        (flight_plan.StartAtV2("abc", "abc", flight_plan.MavlinkType.FLIGHT_PLAN, 0, 0), True),
        (follow_me.Start(follow_me.Mode.LOOK_AT), True),
        (animation.StartFlip(animation.FlipType.FRONT), True),
        (common.Stop(), False),
        (common.Pause(), False),
        (follow_me.Stop(), False),
        (ardrone3.CancelMoveTo(), False),
        (ardrone3.TakeOff(), False),
        (ardrone3.Landing(), False),
        (rth.ReturnToHome(), False),
        (animation.Cancel(), False),
    ],
)
def test_is_motion_of_controller_messages(message: Message, motion: bool) -> None:
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
    await crew.hears(lambda: crew.drone.controller.state.battery_percent is None)
    await crew.hears(lambda: crew.drone.controller.state.visible == {})
    assert crew.drone.controller.state.axes == {}
    assert crew.drone.connected


# -- scripted: what the simulated controller never does


LOOK_AT = follow_me.Mode.LOOK_AT


@contextlib.asynccontextmanager
async def behind() -> AsyncIterator[tuple[Drone, ScriptedDevice]]:
    """A drone that hovers behind a Skycontroller 3 which obeys, and says nothing by itself."""
    async with ScriptedDevice(0x0918) as device:
        device.script[skyctrl.AllStates] = lambda _: [
            drone_manager.ConnectionState(Connection.CONNECTED, "PI040416DA9H000001", 0x0914, "ANAFI"),
            skyctrl.PilotingSource(Source.SKY_CONTROLLER),
            skyctrl.AllStatesChanged(),
        ]
        device.script[skyctrl.AllSettings] = lambda _: [skyctrl.AllSettingsChanged()]
        device.script[skyctrl.SetPilotingSource] = lambda m: [skyctrl.PilotingSource(m.source)]
        device.script[mapper.Grab] = lambda m: [mapper.GrabState(m.buttons, m.axes, 0)]
        device.script[common.AllStates] = lambda _: [
            *STATES,
            ardrone3.FlyingStateChanged(FlyingState.HOVERING),
            common.MavlinkFilePlayingStateChanged(common.PlayingState.STOPPED, "", common.MavlinkType.FLIGHT_PLAN),
            follow_me.State(follow_me.Mode.NONE, follow_me.Behavior.IDLE, follow_me.Animation.NONE, 0),
            follow_me.ModeInfo(follow_me.Mode.LOOK_AT, 0, 0),
            common.AllStatesChanged(),
        ]
        drone = device.drone()
        await drone.connect()
        try:
            yield drone, device
        finally:
            await drone.close()


def sources(device: ScriptedDevice) -> list[Source]:
    return [m.source for m in device.got(skyctrl.SetPilotingSource)]


async def test_place_of_a_controller_that_loses_its_fix_is_unknown() -> None:
    async with behind() as (drone, device):
        device.say(skyctrl.GpsPositionChanged(48.0, 2.0, 100.0, 0.0))
        await drone.wait_until(lambda: drone.controller.state.position is not None, "a place")
        device.say(skyctrl.GpsFixChanged(0))
        await drone.wait_until(lambda: drone.controller.state.position is None, "no place", 2.0)
        device.say(skyctrl.GpsPositionChanged(48.0, 2.1, 100.0, 0.0))
        await drone.wait_until(lambda: drone.controller.state.position is not None, "a place")


async def test_motor_cut_leaves_the_sticks_to_the_pilot() -> None:
    """An Emergency takes the place of what waits to be sent, also of what gives the sticks back."""
    async with behind() as (drone, device):
        device.script[ardrone3.Emergency] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.EMERGENCY)]
        drone.piloting.pilot(FORWARD)
        await drone.expect(skyctrl.PilotingSource, lambda m: m.source == Source.CONTROLLER)
        drone.controller.give_back()
        await drone.piloting.emergency()
        await device.until(skyctrl.SetPilotingSource, 2)
        assert sources(device)[-1] is Source.SKY_CONTROLLER
        await device.until(mapper.Grab, 2)
        assert device.got(mapper.Grab)[-1].axes == 0


def connected_to(serial: str) -> drone_manager.ConnectionState:
    return drone_manager.ConnectionState(Connection.CONNECTED, serial, 0x0914, "ANAFI")


async def test_drone_exchanged_in_a_silence_has_a_new_connection() -> None:
    """The Skycontroller's report of another drone is the first that is heard again."""
    other = "PI040416DA9H000002"
    async with behind() as (drone, device):
        device.script[skyctrl.AllStates] = lambda _: [connected_to(other), skyctrl.AllStatesChanged()]
        await device.acknowledged(skyctrl.BatteryChanged(60))  # nothing of before is repeated after the silence
        device.session.mute = True
        await asyncio.wait_for(asyncio.shield(drone.lost), 10.0)
        attempt = asyncio.create_task(drone.connect())
        device.session.mute = False
        device.say(connected_to(other))
        await attempt
        assert drone.identity.serial == other
        assert len(device.sessions) == 2


async def test_drone_exchanged_while_its_states_are_read_is_not_connected() -> None:
    async with behind() as (drone, device):
        await drone.close()
        states = device.script[common.AllStates]
        device.script[common.AllStates] = lambda m: [connected_to("PI040416DA9H000002"), *states(m)]
        with pytest.raises(LinkLost, match="another drone, PI040416DA9H000002"):
            await drone.connect()
        assert not drone.connected


def under_way(command: ardrone3.MoveTo) -> list[Message]:
    fields = (getattr(command, name) for name in command.__struct_fields__)
    return [ardrone3.MoveToChanged(*fields, ardrone3.MoveToStatus.RUNNING)]


def ended(move: Move) -> Message:
    assert move.target is not None
    place = (move.target.latitude, move.target.longitude, move.target.altitude)
    none, canceled = ardrone3.OrientationMode.NONE, ardrone3.MoveToStatus.CANCELED
    return ardrone3.MoveToChanged(*place, none, 0.0, canceled)


async def test_controller_acquiring_the_source_ends_a_move() -> None:
    async with behind() as (drone, device):
        device.script[ardrone3.MoveTo] = under_way
        move = await drone.piloting.move_to(48.0, 2.0, 5.0)
        if drone.controller.state.source != Source.CONTROLLER:
            await drone.expect(skyctrl.PilotingSource, lambda m: m.source == Source.CONTROLLER)
        device.say(skyctrl.PilotingSource(Source.SKY_CONTROLLER))
        await device.until(ardrone3.CancelMoveTo)
        assert drone.piloting.move is None
        assert drone.controller.pilot_acquired_control
        device.say(ended(move))
        assert await asyncio.wait_for(move.result(), 3.0) is MoveEnd.CANCELED
        # The axes of the sticks are given back too: otherwise no one would fly.
        await device.until(mapper.Grab, 2)
        assert device.got(mapper.Grab)[-1].axes == 0
        with pytest.raises(CommandRejected, match="the pilot"):
            await drone.piloting.move_to(48.0, 2.0, 5.0)


async def test_the_answer_to_an_earlier_giving_back_ends_nothing() -> None:
    async with behind() as (drone, device):
        device.script[ardrone3.MoveTo] = under_way
        drone.piloting.pilot(FORWARD)
        await drone.expect(skyctrl.PilotingSource, lambda m: m.source == Source.CONTROLLER)
        drone.controller.give_back()
        await drone.piloting.move_to(48.0, 2.0, 5.0)  # at once: both orders are on their way
        if drone.controller.state.source != Source.CONTROLLER:
            await drone.expect(skyctrl.PilotingSource, lambda m: m.source == Source.CONTROLLER)
        assert sources(device) == [Source.CONTROLLER, Source.SKY_CONTROLLER, Source.CONTROLLER]
        assert drone.piloting.move is not None
        assert device.got(ardrone3.CancelMoveTo) == []


@pytest.mark.parametrize("what", ["flight plan", "follow me", "following"])
async def test_the_pilot_is_seen_while_something_is_to_begin(what: str) -> None:
    """And as long as it goes on: his stick ends it."""
    async with behind() as (drone, device):
        if what == "following":
            device.script[follow_me.Start] = lambda m: [
                follow_me.State(m.mode, follow_me.Behavior.LOOK_AT, follow_me.Animation.NONE, 0)
            ]
        verb = drone.flight_plan.start("abc") if what == "flight plan" else drone.follow_me.start(LOOK_AT)
        task = asyncio.ensure_future(verb)
        await device.until(skyctrl.SetPilotingSource)
        await asyncio.sleep(1.2)  # more than twice the quiet time, in which nothing may come
        assert sources(device) == [Source.CONTROLLER]
        device.say(mapper.GrabAxisEvent(PITCH, 60))
        await device.until(common.Stop if what == "flight plan" else follow_me.Stop)
        assert sources(device) == [Source.CONTROLLER, Source.SKY_CONTROLLER]
        await asyncio.wait([task])
        assert (task.exception() is None) == (what == "following")


async def test_return_without_start_does_not_hold_the_source() -> None:
    async with behind() as (drone, device):
        drone.piloting.pilot(FORWARD)
        await device.until(skyctrl.SetPilotingSource)
        with pytest.raises(CommandTimeout):
            await drone.piloting.return_home(timeout=0.2)
        await device.until(skyctrl.SetPilotingSource, 2)
        assert sources(device) == [Source.CONTROLLER, Source.SKY_CONTROLLER]


def times_of(device: ScriptedDevice, kind: type[Message]) -> float:
    return device.times(kind)[-1]


async def test_axes_return_within_half_a_second_of_a_move() -> None:
    async with behind() as (drone, device):
        device.script[ardrone3.MoveTo] = under_way
        move = await drone.piloting.move_to(48.0, 2.0, 5.0)
        await asyncio.sleep(1.73)  # no multiple of any period
        assert device.got(mapper.Grab)[-1].axes == STICKS
        device.say(ended(move))
        end = now()
        await device.until(mapper.Grab, 2)
        assert device.got(mapper.Grab)[-1].axes == 0
        assert times_of(device, mapper.Grab) - end <= 0.5


async def test_axes_while_level_setpoints_hold_the_sticks_stay_grabbed() -> None:
    """Only so is a stick of the pilot seen against a program that happens to hover."""
    async with behind() as (drone, device):
        drone.piloting.pilot(FORWARD)
        await device.until(mapper.Grab)
        for _ in range(30):
            drone.piloting.pilot(PilotingCommand())
            await asyncio.sleep(0.05)
        assert [m.axes for m in device.got(mapper.Grab)] == [STICKS]
        device.say(mapper.GrabAxisEvent(PITCH, 60))
        await device.until(mapper.Grab, 2)
        assert device.got(mapper.Grab)[-1].axes == 0


async def test_source_of_an_earlier_connection_is_given_back() -> None:
    async with behind() as (_, device):
        device.say(skyctrl.PilotingSource(Source.CONTROLLER))
        await device.until(skyctrl.SetPilotingSource)
        assert sources(device) == [Source.SKY_CONTROLLER]
        assert device.got(mapper.Grab)[-1].axes == 0


async def test_sticks_of_the_pilot_that_are_found_grabbed_are_released() -> None:
    """By an earlier connection, or another program: the pilot's sticks are dead, and nothing of ours flies."""
    async with behind() as (_, device):
        device.say(mapper.GrabState(0, STICKS, 0))
        released = await device.until(mapper.Grab)
        assert (released.buttons, released.axes) == (0, 0)


async def test_wheels_that_are_found_grabbed_stay_so() -> None:
    async with behind() as (drone, device):
        await device.acknowledged(mapper.GrabState(0, 1 << TILT, 0))
        await device.quiet(mapper.Grab)
        assert drone.controller.state.grabbed_axes == 1 << TILT
        assert device.got(mapper.Grab) == []


async def test_host_stall_ends_the_active_flight_task() -> None:
    async with behind() as (drone, device):
        device.script[ardrone3.MoveTo] = under_way
        await drone.piloting.move_to(48.0, 2.0, 5.0)
        drone.controller.stalled()
        await device.until(ardrone3.CancelMoveTo)
        assert drone.controller.pilot_acquired_control
        assert not drone.controller.taken


async def test_sticks_stay_grabbed_when_the_host_stalled_during_a_flight() -> None:
    """Given back for it, they were taken again from the pilot, who has them since, by the task that flies."""
    async with behind() as (drone, device):
        drone.piloting.pilot(FORWARD)
        await device.until(mapper.Grab)
        with everybodys():
            await asyncio.sleep(0)  # the next callbacks run on the clock of everybody
            time.sleep(1.5)  # noqa: ASYNC251
            await device.quiet(mapper.Grab)
            drone.piloting.pilot(FORWARD)
            await device.quiet(mapper.Grab)
        assert [m.axes for m in device.got(mapper.Grab)] == [STICKS]


async def test_grab_without_confirmation_leaves_the_former_masks() -> None:
    async with behind() as (drone, device):
        obey = device.script[mapper.Grab]
        await drone.controller.grab(buttons=1 << 3)
        device.script[mapper.Grab] = lambda _: []
        with pytest.raises(CommandTimeout):
            await drone.controller.grab(axes=1 << TILT, timeout=0.05)
        # It may have been received all the same.
        undone = await device.until(mapper.Grab, 3)
        assert (undone.buttons, undone.axes) == (1 << 3, 0)
        device.script[mapper.Grab] = obey
        drone.piloting.pilot(FORWARD)
        flown = await device.until(mapper.Grab, 4)
        assert (flown.buttons, flown.axes) == (1 << 3, STICKS)
        drone.controller.give_back()
        back = await device.until(mapper.Grab, 5)
        assert (back.buttons, back.axes) == (1 << 3, 0)


async def test_grab_confirmed_during_a_motion_is_kept() -> None:
    async with behind() as (drone, device):
        obey = device.script[mapper.Grab]
        device.script[mapper.Grab] = lambda _: []
        attempt = asyncio.create_task(drone.controller.grab(axes=1 << TILT))
        grabbed = await device.until(mapper.Grab)
        drone.piloting.pilot(FORWARD)  # grabs the sticks, with the masks of before
        assert (await device.until(mapper.Grab, 2)).axes == STICKS
        device.script[mapper.Grab] = obey
        device.say(mapper.GrabState(grabbed.buttons, grabbed.axes, 0))
        await attempt
        assert (await device.until(mapper.Grab, 3)).axes == STICKS | 1 << TILT

"""`connect`: what a block leaves behind on the drone when it ends; and waiting for a state."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import msgspec
import pytest
from support.world import loopback

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import drone_manager
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState
from anafi_mav.arsdk.messages.proto import device_manager
from anafi_mav.arsdk.mux import mux
from anafi_mav.drone import CommandTimeout, Drone, FlyingState, LinkLost, LocalProtocolError, connect
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator

HOME = (48.8789, 2.3677, 35.0)


def spec(skycontroller: int | None = None) -> DroneSpec:
    return DroneSpec(
        address="127.0.0.1",
        home=HOME,
        discovery_port=0,
        handshake_port=0,
        c2d_port=0,
        http_port=None,
        rtsp_port=None,
        skycontroller=skycontroller,
    )


@pytest.fixture
async def simulator() -> AsyncIterator[Simulator]:
    async with Simulator([spec()], speed=4.0, seed=1) as simulator:
        yield simulator


@pytest.fixture
def real(simulator: Simulator) -> SimulatedDrone:
    return simulator.drones[0]


def commands(real: SimulatedDrone, *names: str) -> list[str]:
    """Which of these commands the drone received, in their order."""
    received = [entry.name.rpartition(".")[2] for entry in real.log if entry.kind == "command"]
    return [name for name in received if name in names]


def sources(real: SimulatedDrone) -> list[str]:
    """Whose sticks flew the drone behind a Skycontroller, one after the other."""
    return [entry.args["source"] for entry in real.log if entry.name == "piloting source"]


async def lift(drone: Drone) -> None:
    await drone.piloting.take_off()
    await drone.wait_for(FlyingState.HOVERING)


async def test_block_on_the_ground_commands_nothing(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port, name="alpha") as drone:
        assert (drone.connected, drone.name) == (True, "alpha")
    assert not drone.connected
    assert commands(real, "PCMD", "Landing", "TakeOff", "CancelMoveTo", "moveBy") == []


async def test_block_ending_during_a_move_stops_the_move(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        await lift(drone)
        await drone.piloting.move_to(HOME[0] + 0.001, HOME[1], 20.0)
        began = asyncio.get_running_loop().time()
    assert asyncio.get_running_loop().time() - began >= 2.0  # the sticks are centred for two seconds
    assert commands(real, "CancelMoveTo") == ["CancelMoveTo"]
    assert real.flying_state == FlyingState.HOVERING


async def test_exception_in_the_block_stops_the_move(real: SimulatedDrone) -> None:
    async def fly() -> None:
        async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
            await lift(drone)
            await drone.piloting.move_to(HOME[0] + 0.001, HOME[1], 20.0)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fly()
    assert commands(real, "CancelMoveTo") == ["CancelMoveTo"]


async def test_cancelled_block_stops_the_move(real: SimulatedDrone) -> None:
    """Ctrl-C cancels the main task."""
    moving = asyncio.Event()

    async def fly() -> None:
        async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
            await lift(drone)
            await drone.piloting.move_to(HOME[0] + 0.001, HOME[1], 20.0)
            moving.set()
            await asyncio.Event().wait()

    task = asyncio.ensure_future(fly())
    await moving.wait()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert commands(real, "CancelMoveTo") == ["CancelMoveTo"]


async def test_flight_plan_is_paused_when_the_block_ends() -> None:
    address, plan = loopback(), Path(__file__).parents[3] / "missions" / "delivery.v1.mavlink"
    spec = DroneSpec(address=address, home=HOME, http_port=8080, rtsp_port=None)
    async with Simulator([spec], speed=4.0, seed=1) as simulator:
        async with connect(address, http_port=8080) as drone:
            await drone.flight_plan.start(await drone.flight_plan.upload(plan.read_bytes()))
            await drone.wait_for(FlyingState.FLYING)
        assert commands(simulator.drones[0], "Pause", "Stop") == ["Pause"]


async def test_landing_continues_after_the_block(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        await lift(drone)
        await drone.piloting.land()
        sticks = len(commands(real, "PCMD"))
    assert len(commands(real, "PCMD")) == sticks
    await real.wait_log(lambda entry: entry.kind == "state" and entry.args.get("to") == "landed", 20.0)


async def test_return_home_continues_after_the_block(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        await lift(drone)
        move = await drone.piloting.move_to(HOME[0] + 0.0005, HOME[1], 10.0)
        await move.result()
        await drone.piloting.return_home()
        await drone.wait_until(lambda: drone.home.state.returning, "return home")
    assert commands(real, "Abort", "abort") == []


async def test_block_ending_while_motors_ramp_lands(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        taking_off = asyncio.ensure_future(drone.piloting.take_off())
        await drone.wait_for(FlyingState.MOTOR_RAMPING)
        taking_off.cancel()
    assert "Landing" in commands(real, "Landing")
    assert real.flying_state in (FlyingState.LANDED, FlyingState.LANDING)


async def test_block_ending_during_a_hand_launch_stops_motors(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        await drone.piloting.hand_launch()
        assert real.flying_state == FlyingState.USERTAKEOFF
    assert real.flying_state == FlyingState.LANDED


async def test_block_behind_skycontroller_leaves_the_drone_to_its_pilot() -> None:
    async with Simulator([spec(skycontroller=3)], speed=4.0, seed=1) as simulator:
        real = simulator.drones[0]
        async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
            await lift(drone)
            await real.wait_log(lambda entry: drone.controller.pilot_has_source)
        assert commands(real, "TakeOff", "PCMD", "CancelMoveTo", "Landing") == ["TakeOff"]
        assert sources(real) == ["CONTROLLER", "SKY_CONTROLLER"]


async def test_block_behind_skycontroller_leaves_the_takeoff_of_its_pilot() -> None:
    async with Simulator([spec(skycontroller=3)], speed=1.0, seed=1) as simulator:
        real = simulator.drones[0]
        assert real.skycontroller is not None
        async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
            real.skycontroller.press(1)
            await drone.wait_for(FlyingState.MOTOR_RAMPING)
        assert commands(real, "TakeOff", "UserTakeOff", "Landing") == ["TakeOff"]


async def test_block_behind_skycontroller_stops_the_motors_of_its_hand_launch() -> None:
    async with Simulator([spec(skycontroller=3)], speed=4.0, seed=1) as simulator:
        real = simulator.drones[0]
        async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
            await drone.piloting.hand_launch()
        assert real.flying_state == FlyingState.LANDED


async def test_move_behind_skycontroller_is_stopped_and_sticks_are_released() -> None:
    async with Simulator([spec(skycontroller=3)], speed=4.0, seed=1) as simulator:
        real = simulator.drones[0]
        async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
            await lift(drone)
            await drone.piloting.move_to(HOME[0] + 0.001, HOME[1], 20.0)
        assert commands(real, "CancelMoveTo") == ["CancelMoveTo"]
        assert sources(real) == ["CONTROLLER", "SKY_CONTROLLER"]


async def test_block_behind_skycontroller_4_ends_without_event_loop_error() -> None:
    """The web server is reached through a proxy of the mux, whose open connections end with the block."""
    problems: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: problems.append(context))
    address = loopback()
    behind = DroneSpec(address=address, home=HOME, http_port=8080, rtsp_port=None, skycontroller=4)
    async with Simulator([behind], speed=4.0, seed=1):
        async with connect(address, http_port=8080) as drone:
            assert await drone.media.list() == ()
        await asyncio.sleep(0.0)
    assert problems == []


async def test_lost_link_ends_the_block_without_another_error(simulator: Simulator, real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        await lift(drone)
        await simulator.close()
        with pytest.raises(LinkLost):
            await drone.wait_for(FlyingState.LANDED)


@pytest.mark.parametrize(
    "report",
    [
        drone_manager.ConnectionState(DroneManagerConnectionState.IDLE, "", 0, ""),
        drone_manager.ConnectionState(DroneManagerConnectionState.CONNECTED, "PI040416DA9H000009", 0x0914, "other"),
        device_manager.State(idle=device_manager.ConnectionStateIdle()),
    ],
    ids=["idle", "another", "protobuf"],
)
async def test_direct_link_survives_a_report_of_a_skycontroller(real: SimulatedDrone, report: Message) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        heard = asyncio.ensure_future(drone.expect(type(report), lambda message: message == report))
        await asyncio.sleep(0)
        real.inject(report)
        await heard
        await lift(drone)
        assert drone.connected


async def test_log_line_of_a_connection_names_model_serial_and_firmware(
    simulator: Simulator, real: SimulatedDrone, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "anafi_mav")
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        lines = [record.getMessage() for record in caplog.records if "connected to" in record.getMessage()]
        assert lines == [f"127.0.0.1: connected to ANAFI 4K {drone.identity.serial}, firmware 1.8.2, protocol 3"]
        assert str(msgspec.structs.replace(drone.identity, firmware=None)).endswith("firmware not reported")


async def test_connect_without_a_drone_raises_link_lost(real: SimulatedDrone) -> None:
    with pytest.raises(LinkLost):
        async with connect("127.0.0.1", discovery_port=1):
            pytest.fail("nothing answers there")


async def test_connect_to_what_is_no_host_name_raises_link_lost() -> None:
    """Python's UnicodeError about such a name is no OSError."""
    with pytest.raises(LinkLost, match=r"cannot connect to a..b:44445: 'a..b' is no host name"):
        async with connect("a..b"):
            pass


async def test_expired_wait_names_the_state_and_the_time(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        await drone.wait_for(FlyingState.LANDED, timeout=0.0)  # it is in that state
        with pytest.raises(CommandTimeout, match=r"the state hovering or flying within 0\.5 s"):
            await drone.wait_for(FlyingState.HOVERING, FlyingState.FLYING, timeout=0.5)


async def test_raising_condition_ends_the_wait_with_its_error(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        answers = [False]
        with pytest.raises(IndexError):  # from the second look on
            await drone.wait_until(answers.pop, "anything", 10.0)


async def test_wait_after_the_link_is_lost_raises(real: SimulatedDrone) -> None:
    async with connect("127.0.0.1", discovery_port=real.discovery_port) as drone:
        pass
    with pytest.raises(LinkLost):
        await drone.wait_for(FlyingState.LANDED)


@pytest.mark.parametrize("name", ["discovery_port", "http_port", "rtsp_port"])
@pytest.mark.parametrize("port", [-1, 0, 70000])
async def test_port_out_of_range_is_an_error_of_the_program(name: str, port: int) -> None:
    with pytest.raises(LocalProtocolError, match=rf"expected a port from 1 to 65535, got {port}"):
        async with connect(loopback(), **{name: port}):
            pass


async def test_skycontroller_4_that_falls_silent_after_its_handshake_is_a_lost_link_with_its_reason() -> None:
    found: list[tuple[str, mux.Argument]] = [("%s", "ANAFI"), ("%u", 0x0914), ("%s", "PI040416AA0A000001")]
    accepted: list[tuple[str, mux.Argument]] = [("%d", 0), ("%s", '{"proto_v": 1}')]

    async def fall_silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        for channel, id, arguments in (
            (mux.DISCOVERY, mux.DEVICE_ADDED, found),
            (mux.BACKEND, mux.CONN_RESP, accepted),
        ):
            received = b""
            while b"POMP" not in received:  # the request for it
                received += await reader.readexactly(1)
            writer.write(mux.encode_frame(channel, mux.encode_pomp(id, arguments)))
        while await reader.read(4096):
            pass
        writer.close()

    address = loopback()
    async with await asyncio.start_server(fall_silent, address, mux.PORT):
        drone = Drone(address)
        with pytest.raises(LinkLost, match="nothing received"):
            await drone.connect()
        await drone.close()

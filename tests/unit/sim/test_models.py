"""The four simulated models: the table of the paper as data, what each reports at the connection, the Ai's services."""

from __future__ import annotations

import math

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.codec.protobuf import Empty
from anafi_mav.arsdk.codec.wire import Message, decode, encode
from anafi_mav.arsdk.link.controller import connect
from anafi_mav.arsdk.messages import flight_plan, move, obstacle_avoidance
from anafi_mav.arsdk.messages.proto import antiflicker, connectivity, developer, network, piloting, pointnfly, privacy
from anafi_mav.errors import ConfigError
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.states import all_settings, all_states
from anafi_mav.sim.world.model import MODELS

ALL = ["4k", "thermal", "usa", "ai"]


@pytest.mark.parametrize(
    ("name", "id", "size", "mass", "battery", "speed", "wind", "ceiling", "flight", "cells", "mah", "zoom"),
    [
        ("4k", 0x0914, (242, 315, 65), 320, 125, 15.0, 13.9, 4500, 25, 2, 2700, 3),
        ("thermal", 0x0919, (242, 315, 64), 315, 125, 15.0, 13.9, 4500, 26, 2, 2700, 3),
        ("usa", 0x091E, (303, 398, 84), 499, 195, 14.7, 14.7, 6000, 32, 3, 3400, 32),
        ("ai", 0x091A, (378, 498, 118), 898, 366, 16.0, 12.7, 5000, 32, 3, 6800, 6),
    ],
)
def test_the_table(
    name: str,
    id: int,
    size: tuple[int, int, int],
    mass: int,
    battery: int,
    speed: float,
    wind: float,
    ceiling: float,
    flight: float,
    cells: int,
    mah: int,
    zoom: float,
) -> None:
    model = MODELS[name]
    envelope = model.envelope
    assert (model.name, model.product_id, model.zoom_max) == (name, id, zoom)
    assert (envelope.size_mm, envelope.mass_g, envelope.battery_g) == (size, mass, battery)
    assert (envelope.wind_resistance, envelope.ceiling) == (wind, ceiling)
    assert (model.airframe.max_speed, model.airframe.flight_time) == (speed, flight * 60.0)
    assert (model.battery.cells, model.battery.capacity_mah) == (cells, mah)
    assert model.airframe.yaw_delay == (0.2 if name == "ai" else 0.1)
    assert all(lens.zoom_max in (zoom, 1.0) for lens in model.lenses)
    tilt = (-116.0, 176.0) if name == "ai" else (-90.0, 90.0)
    assert model.gimbals[0].pitch == tilt
    assert (model.plan_version, model.modern) == ((2, True) if name == "ai" else (1, False))


def features(messages: list[Message]) -> set[str]:
    return {message.NAME.split(".")[0] for message in messages}


@pytest.mark.parametrize("name", ALL)
def test_states_at_connection_are_those_of_the_model(name: str) -> None:
    firmware = Bench(name).firmware
    states, settings = all_states(firmware), all_settings(firmware)
    for message in states + settings:
        assert decode(encode(message)) is not None
    observed = features(states)
    old = {"camera", "user_storage"}
    new = {"user_storage_v2", "obstacle_avoidance", "move", "poi", "flight_plan"}
    assert old & observed == (set() if name == "ai" else old)
    assert new & observed == (new if name == "ai" else set())
    assert ("thermal" in observed) == (name in ("thermal", "usa"))
    assert {"gimbal", "battery", "rth", "mediastore", "alarms"} <= observed


@pytest.mark.parametrize("name", ALL)
async def test_simulated_drone_announces_its_model(name: str) -> None:
    spec = DroneSpec(
        model=name, address="127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, http_port=None, storage=1000
    )
    async with Simulator([spec], seed=1) as simulator:
        (drone,) = simulator.drones
        session = await connect(
            "127.0.0.1", discovery_port=drone.discovery_port, on_message=lambda message, now: None, timeout=5.0
        )
        assert session.device.model_id == MODELS[name].product_id
        assert session.device.serial.startswith(MODELS[name].serial_prefix)
        assert len(session.device.serial) == 18
        await session.close()
        assert drone.firmware.payload.storage.place.free == 1000


def test_only_these() -> None:
    with pytest.raises(ConfigError, match="expected one of 4k, thermal, usa, ai, got 'bebop'"):
        DroneSpec(model="bebop")
    with pytest.raises(ConfigError, match="expected a number of bytes, got -1"):
        DroneSpec(storage=-1)


# -- the Ai's services


def test_missing_inputs_of_a_move_are_reported_on_change() -> None:
    bench = Bench("ai")
    gps, magneto, flying = (1 << bit for bit in (0, 1, 5))
    assert bench.of(move.Info) == [move.Info(flying)]
    bench.take_off()
    bench.run(0.1)
    assert bench.of(move.Info)[1:] == [move.Info(0)]
    bench.faults.gps = False
    bench.run(0.2)
    bench.faults.magneto_required = True
    bench.run(0.2)
    assert bench.of(move.Info)[2:] == [move.Info(gps), move.Info(gps | magneto)]
    assert bench.of(flight_plan.Info)[-1] == flight_plan.Info(gps | magneto)
    assert Bench("4k").of(move.Info) == []


QUESTIONS: list[tuple[Message, type[Message]]] = [
    (antiflicker.GetState(include_default_capabilities=True), antiflicker.State),
    (developer.GetState(), developer.State),
    (network.GetState(include_default_capabilities=True), network.State),
    (connectivity.ListRadios(), connectivity.RadioList),
    (connectivity.GetState(include_default_capabilities=True), connectivity.State),
    (privacy.GetState(include_default_capabilities=True), privacy.State),
    (pointnfly.GetState(), pointnfly.State),
    (piloting.GetState(), piloting.State),
    (piloting.GetCapabilities(), piloting.Capabilities),
]


@pytest.mark.parametrize(("question", "answer"), QUESTIONS)
def test_a_question_is_answered(question: Message, answer: type[Message]) -> None:
    (observed,) = Bench("ai").send(question)
    assert type(observed) is answer
    assert decode(encode(observed)) == observed
    assert Bench("usa").send(question) == []


def test_settings_of_the_services() -> None:
    bench = Bench("ai")
    assert bench.send(antiflicker.SetMode(mode=antiflicker.Mode._60_HZ)) == [
        antiflicker.State(fixed=antiflicker.Frequency._60_HZ)
    ]
    assert bench.send(antiflicker.SetMode(mode=antiflicker.Mode.DISABLED)) == [antiflicker.State(disabled=Empty())]
    assert bench.send(antiflicker.SetMode(mode=antiflicker.Mode(9))) == [antiflicker.State(disabled=Empty())]
    (state,) = bench.send(network.SetRoutingPolicy(policy=network.RoutingPolicy.WLAN))
    assert isinstance(state, network.State)
    assert state.routing_info == network.RoutingInfo(
        policy=network.RoutingPolicy.WLAN, current_link=network.RoutingLink.WLAN
    )
    (state,) = bench.send(network.SetCellularMaxBitrate(max_bitrate=99_999))
    assert isinstance(state, network.State)
    assert state.cellular_max_bitrate == network.CellularMaxBitrate(max_bitrate=10_000)
    (shell,) = bench.send(developer.EnableShell(public_key="key"))
    assert isinstance(shell, developer.State)
    assert shell.shell == developer.Shell(enabled=True, public_key="key")
    for wanted, altitude in ((3.0, 3.0), (99.0, 10.0), (math.nan, 10.0)):
        (pilot,) = bench.send(piloting.SetTakeoffHoveringAltitude(altitude=wanted))
        assert isinstance(pilot, piloting.State)
        assert pilot.takeoff_hovering_altitude == altitude
    (private,) = bench.send(privacy.AuthorizePairing(value=privacy.Authorization.ONCE))
    assert isinstance(private, privacy.State)
    assert private.pairing_authorization == privacy.PairingAuthorization(value=privacy.Authorization.ONCE)
    assert bench.send(connectivity.GetState(radio_id=3)) == []
    off = obstacle_avoidance.Mode.DISABLED
    assert bench.send(obstacle_avoidance.SetMode(off)) == [
        obstacle_avoidance.Status(off, obstacle_avoidance.State.INACTIVE, obstacle_avoidance.Availability.AVAILABLE)
    ]

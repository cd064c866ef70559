"""Faults of the simulated drone's link, datagram by datagram and on real sockets; what it does when no one is there."""

from __future__ import annotations

import random
from collections.abc import AsyncIterator, Callable
from dataclasses import replace

import pytest
from support.listener import MessageListener
from support.sim_bench import Bench

from anafi_mav.arsdk.link.controller import ControllerSession, connect
from anafi_mav.arsdk.messages import ardrone3, common, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.proto import camera2
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from anafi_mav.sim.world.faults import CLEAR, Faults, Impairment
from anafi_mav.sim.world.link_emulation import HELD, MAX_UNDER_WAY, LinkEmulation


class Sky:
    """An `LinkEmulation` whose clock the test turns."""

    def __init__(self, **faults: Impairment) -> None:
        self.now = 0.0
        self.arrived: list[tuple[float, int]] = []
        self._waiting: list[tuple[float, int, Callable[[], None]]] = []
        self.air = LinkEmulation(Faults(**faults), random.Random(7), self._later)

    def _later(self, seconds: float, function: Callable[[], None]) -> None:
        self._waiting.append((self.now + seconds, len(self._waiting), function))

    def send(self, number: int, *, inbound: bool = True) -> None:
        self.air(number.to_bytes(2, "little"), inbound, self._deliver)

    def _deliver(self, data: bytes) -> None:
        self.arrived.append((round(self.now, 6), int.from_bytes(data, "little")))

    def run(self, until: float) -> None:
        while due := [entry for entry in self._waiting if entry[0] <= until]:
            first = min(due)
            self._waiting.remove(first)
            self.now = first[0]
            first[2]()
        self.now = until

    @property
    def numbers(self) -> list[int]:
        return [number for _, number in self.arrived]


def test_clear_air_changes_nothing() -> None:
    sky = Sky()
    for number in range(5):
        sky.send(number)
    assert sky.arrived == [(0.0, number) for number in range(5)]
    assert CLEAR.clear


def test_each_direction_has_its_own_faults() -> None:
    sky = Sky(up=Impairment(loss=1.0))
    sky.send(1)
    sky.send(2, inbound=False)
    assert sky.numbers == [2]


def test_loss_and_duplication_have_the_requested_frequency() -> None:
    sky = Sky(up=Impairment(loss=0.3))
    for number in range(4000):
        sky.send(number)
    assert len(sky.numbers) == pytest.approx(2800, abs=90)  # three standard deviations
    sky = Sky(up=Impairment(duplicate=0.25))
    for number in range(4000):
        sky.send(number)
    assert len(sky.numbers) == pytest.approx(5000, abs=90)
    assert set(sky.numbers) == set(range(4000))


def test_delay_keeps_the_order() -> None:
    sky = Sky(up=Impairment(delay=0.2))
    for number in range(3):
        sky.send(number)
        sky.run(sky.now + 0.01)
    assert sky.arrived == []
    sky.run(1.0)
    assert sky.arrived == [(0.2, 0), (0.21, 1), (0.22, 2)]


def test_jitter_stays_within_its_bound() -> None:
    sky = Sky(up=Impairment(delay=0.1, jitter=0.05))
    for number in range(300):
        sky.send(number)
    sky.run(1.0)
    times = [time for time, _ in sky.arrived]
    assert 0.1 <= min(times) < 0.105
    assert 0.145 < max(times) <= 0.15


def test_one_is_overtaken_by_the_next() -> None:
    sky = Sky(up=Impairment(reorder=1.0))
    for number in range(6):
        sky.send(number)
    sky.run(1.0)
    assert sky.numbers == [1, 0, 3, 2, 5, 4]


def test_the_last_one_is_not_held_for_ever() -> None:
    sky = Sky(up=Impairment(reorder=1.0))
    sky.send(9)
    sky.run(HELD / 2)
    assert sky.arrived == []
    sky.run(1.0)
    assert sky.arrived == [(HELD, 9)]


def test_the_air_holds_only_so_much() -> None:
    sky = Sky(up=Impairment(delay=1.0))
    for number in range(MAX_UNDER_WAY + 10):
        sky.send(number)
    sky.run(2.0)
    assert len(sky.arrived) == MAX_UNDER_WAY
    sky.send(1)
    sky.run(4.0)
    assert len(sky.arrived) == MAX_UNDER_WAY + 1


# -- on the wire


@pytest.fixture
async def real() -> AsyncIterator[SimulatedDrone]:
    spec = DroneSpec(address="127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, http_port=None)
    async with Simulator([spec], speed=5.0, seed=1) as simulator:
        yield simulator.drones[0]


async def join(real: SimulatedDrone) -> tuple[ControllerSession, MessageListener]:
    ear = MessageListener()
    session = await connect("127.0.0.1", discovery_port=real.discovery_port, on_message=ear, silence_limit=None)
    return session, ear


BAD_AIR = Impairment(loss=0.25, delay=0.005, jitter=0.02, duplicate=0.2, reorder=0.2)


async def test_commands_arrive_once_in_order_on_a_bad_link(real: SimulatedDrone) -> None:
    session, ear = await join(real)
    real.faults.up = real.faults.down = BAD_AIR
    names = [f"drone {number}" for number in range(20)]
    for name in names:
        session.send(common.ProductName(name))
    await real.wait_log(lambda entry: entry.args.get("name") == names[-1], 30.0)
    received = [entry.args["name"] for entry in real.log.find("command", "ProductName")]
    assert received == names

    def answers() -> list[str]:
        return [message.name for message in ear.heard if isinstance(message, common.ProductNameChanged)]

    await ear.until(lambda: len(answers()) >= len(names), 20.0)
    assert answers() == names
    await session.close()


async def test_one_direction_alone_can_be_dead(real: SimulatedDrone) -> None:
    session, ear = await join(real)
    real.faults.down = Impairment(loss=1.0)
    session.send(common.ProductName("still heard"))
    await real.wait_log(lambda entry: entry.args.get("name") == "still heard", 10.0)
    assert common.ProductNameChanged("still heard") not in ear.heard
    await session.close()


# -- no one is there


def test_link_loss_without_home_keeps_the_place() -> None:
    bench = Bench()
    bench.faults.gps = False
    bench.take_off()
    bench.send(rth.SetDelay(2))
    bench.firmware.link_lost()
    bench.run(6.0)
    assert bench.state is FlyingState.HOVERING
    assert [event for event in bench.of(rth.State) if event.state is rth.RthState.IN_PROGRESS] == []


def test_reboot_clears_the_flight_and_keeps_settings() -> None:
    bench = Bench("ai")
    bench.take_off()
    bench.send(ardrone3.MaxTilt(25.0))
    bench.send(camera2.StartRecording())
    bench.run(3.0)
    bench.send(ardrone3.Landing())
    bench.run_until(lambda: bench.state is FlyingState.LANDED)
    firmware = bench.firmware
    charge, flights = firmware.battery.charge, firmware.flights_report()
    uid = firmware.plans.put(b"QGC WPL 120\n")
    firmware.reboot(replace(firmware.identity, boot_id="second", run_id="next"))
    bench.run(0.1)
    assert firmware.homing.takeoff is None
    assert firmware.battery.charge == pytest.approx(charge, abs=0.01)
    assert firmware.flights_report() == flights
    assert firmware.settings.number("max_tilt") == 25.0
    assert firmware.plans.get(uid)
    assert not firmware.payload.cameras.busy
    (film,) = firmware.payload.media
    assert (film.video, film.run_id) == (True, "run")
    bench.take_off()
    firmware = bench.firmware
    bench.send(ardrone3.Landing())
    bench.run_until(lambda: bench.state is FlyingState.LANDED)
    firmware.reboot(firmware.identity, factory=True)
    assert (len(firmware.payload.media), firmware.plans.list()) == (0, ())
    assert firmware.settings.number("max_tilt") == 10.0


def test_sticks_are_let_go_with_the_link() -> None:
    bench = Bench()
    bench.take_off()
    bench.sticks(2.0, pitch=100)
    bench.send(ardrone3.PCMD(1, 0, 100, 0, 0, 0))
    bench.firmware.link_lost()
    bench.rest()
    assert bench.pose.ground_speed < 0.2


def test_second_link_loss_waits_its_full_delay() -> None:
    bench = Bench()
    bench.take_off()
    bench.send(rth.SetDelay(4))
    bench.firmware.link_lost()
    bench.run(3.0)
    bench.firmware.link_up()  # another controller, or the same again
    bench.firmware.link_lost()
    began = bench.run_until(lambda: any(e.reason is rth.StateReason.CONNECTION_LOST for e in bench.of(rth.State)))
    assert began == pytest.approx(4.0, abs=0.1)

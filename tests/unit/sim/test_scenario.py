"""Scenario files of the simulator: what triggers a step, what it does, and what is wrong with a bad one."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MotorError, TakeOff, WarningLevel
from anafi_mav.arsdk.messages.common import FlightPlanComponent
from anafi_mav.errors import ConfigError
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from anafi_mav.sim.scenario import from_text, load
from anafi_mav.sim.world.faults import CLEAR, Impairment
from anafi_mav.sim.world.wind import CALM, WindSpec


class World:
    """Drones that no one started: time goes by when the test says so."""

    def __init__(self, text: str, drones: int = 1) -> None:
        specs = [DroneSpec(address=f"127.0.42.{n + 1}") for n in range(drones)]
        scenario = from_text(text, "test.yaml")
        self.simulator = Simulator(specs, seed=1, scenarios={spec.address: scenario for spec in specs})

    @property
    def drone(self) -> SimulatedDrone:
        return self.simulator.drones[0]

    def run(self, seconds: float) -> None:
        self.simulator.advance(seconds)


async def test_at_a_time_and_for_a_while() -> None:
    world = World("steps: [{at: 2, gps: false, for: 3}]")
    world.run(1.9)
    assert world.drone.faults.gps
    world.run(0.2)
    assert not world.drone.faults.gps
    world.run(2.8)
    assert not world.drone.faults.gps
    world.run(0.2)
    assert world.drone.faults.gps
    observed = [entry.args for entry in world.drone.log.find("scenario", "step")]
    assert observed == [{"step": 0, "ends": False}, {"step": 0, "ends": True}]


async def test_overlapping_steps_of_one_key_end_as_before_both() -> None:
    world = World("steps: [{at: 1, battery: 50, for: 4}, {at: 2, battery: 40, for: 6}, {at: 3, battery: 30, for: 1}]")
    world.run(0.5)
    levels = []
    for _ in range(9):
        world.run(1.0)
        levels.append(world.drone.faults.battery)
    assert levels == [50, 40, 30, 40, 40, 40, 40, None, None]


async def test_lasting_step_stays_when_an_earlier_one_ends() -> None:
    world = World("steps: [{at: 1, gps: false, for: 2}, {at: 2, gps: false}]")
    world.run(5.0)
    assert not world.drone.faults.gps


async def test_when_a_state_is_reached() -> None:
    world = World("steps: [{when: hovering, after: 1, battery: 42}]")
    world.run(5.0)
    assert world.drone.faults.battery is None
    world.drone.firmware.receive(TakeOff(), 0.0)
    while world.drone.flying_state is not FlyingState.HOVERING:
        world.run(0.1)
    world.run(0.8)
    assert world.drone.faults.battery is None
    world.run(0.3)
    assert world.drone.faults.battery == 42


async def test_conditions_hold_together() -> None:
    text = "steps: [{when: {state: landed, battery_below: 50}, storage_full: true}]"
    world = World(text)
    world.run(1.0)
    assert not world.drone.faults.storage_full
    world.drone.faults.battery = 49
    world.run(0.2)
    assert world.drone.faults.storage_full


async def test_scenario_step_counts_for_each_drone() -> None:
    world = World("steps: [{at: 1, drone: 127.0.42.2, gps: false}, {at: 2, calibration_required: true}]", 2)
    world.run(1.1)
    assert [drone.faults.gps for drone in world.simulator.drones] == [True, False]
    world.run(1.0)
    assert [drone.faults.magneto_required for drone in world.simulator.drones] == [True, True]


async def test_everything_there_is() -> None:
    world = World(
        """
        steps:
          - at: 0
            silence: true
            link: {up: {loss: 0.1, delay: 0.2}, both: {jitter: 0.3, duplicate: 0.4, reorder: 0.5}}
            motor_error: mosfet
            motors: [1, 4]
            vibration: critical
            refuse_take_off: [update_ongoing, vcam]
            refuse_plan: [camera_available]
            wind: {speed: 7, direction: 90}
            for: 1
        """
    )
    world.run(0.1)
    faults = world.drone.faults
    assert faults.mute
    assert faults.up == Impairment(loss=0.1, delay=0.2)
    assert faults.down == Impairment(jitter=0.3, duplicate=0.4, reorder=0.5)
    assert (faults.motor_error, faults.motors) == (MotorError.ERROR_MOSFET, 0b1001)
    assert faults.vibration is WarningLevel.CRITICAL
    assert faults.refuse_take_off == {TakeoffChecklistType.UPDATE_ONGOING, TakeoffChecklistType.VCAM}
    assert faults.refuse_plan == {FlightPlanComponent.CAMERA_AVAILABLE}
    assert world.drone.wind.spec == WindSpec(7.0, 90.0)
    world.run(1.0)
    assert not faults.mute
    assert (faults.up, faults.down) == (CLEAR, CLEAR)
    assert faults.motor_error is MotorError.NO_ERROR
    assert faults.refuse_plan == frozenset()
    assert world.drone.wind.spec == CALM


BAD = {
    "[]": "test.yaml: expected `object`, got `array`",
    "steps: []": "steps: expected `array` of length >= 1",
    "steps: [{at: 1}]": "steps[0]: expected something to happen: gps, silence, ",
    "steps: [{gps: false}]": "steps[0]: expected one trigger, at or when",
    "steps: [{at: 1, when: flying, gps: false}]": "steps[0]: expected one trigger, at or when",
    "steps: [{at: 1, after: 1, gps: false}]": "steps[0].after: expected only with when",
    "steps: [{at: -1, gps: false}]": "steps[0].at: expected `float` >= 0.0",
    "steps: [{at: 1, gps: 3}]": "steps[0].gps: expected `bool`, got `int`",
    "steps: [{at: 1, gpx: true}]": "steps[0]: object contains unknown field `gpx`",
    "steps: [{at: 1, gps: true}, {at: 1, link: {up: {loss: 2}}}]": "steps[1].link.up.loss: expected `float` <= 1.0",
    "steps: [{when: gone, gps: false}]": "steps[0].when: expected one of landed, takingoff, ",
    "steps: [{when: {state: gone}, gps: false}]": "steps[0].when.state: expected one of landed, takingoff, ",
    "steps: [{when: {}, gps: false}]": "steps[0].when: expected a condition",
    "steps: [{at: 1, motor_error: tired}]": "steps[0].motor_error: expected one of no_error, eeprom, ",
    "steps: [{at: 1, refuse_take_off: [vcam, mood]}]": "steps[0].refuse_take_off[1]: expected one of ",
    "steps: [{at: 1, refuse_plan: [mood]}]": "steps[0].refuse_plan[0]: expected one of gps, calibration, ",
    "steps: [{at: 1, motors: [5]}]": "steps[0].motors[0]: expected `int` <= 4",
    "steps: [{at: 1, motors: [2]}]": "steps[0].motors: expected only with motor_error",
    "steps: [{at: 1, motor_error: mosfet, motors: []}]": "steps[0].motors: expected `array` of length >= 1",
    "steps: [{at: 1, link: {}}]": "steps[0].link: expected up, down or both",
    "steps: [{at: 1, throw: false}]": "steps[0].throw: expected true",
    "steps: [{when: {height_above: .nan}, gps: false}]": "steps[0].when.height_above: expected `float` >= -10000.0",
    "steps: [{when: {distance_beyond: .inf}, gps: false}]": "steps[0].when.distance_beyond: expected `float` <= ",
    "steps: [{at: 1, battery: 101}]": "steps[0].battery: expected `int` <= 100",
    "steps: [{at: 1, gps: false, gps: true}]": "test.yaml, line 1, column 29: the key 'gps' stands twice",
    "steps: [": "test.yaml, line 1, column 9: ",
    "a: \x00": "test.yaml: ",
}


@pytest.mark.parametrize("text", BAD)
def test_a_bad_file_is_one_line(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        from_text(text, "test.yaml")
    assert str(caught.value).startswith(BAD[text])
    assert "\n" not in str(caught.value)


def test_unknown_drone_in_a_scenario_is_refused() -> None:
    scenario = from_text("steps: [{at: 1, drone: 10.0.0.1, gps: false}]", "x")
    with pytest.raises(ConfigError, match=r"steps\[0\].drone: expected the address of a drone \(127.0.42.1\)"):
        Simulator([DroneSpec()], scenarios={"127.0.42.1": scenario})


async def test_each_drone_uses_its_own_scenario_file() -> None:
    specs = [DroneSpec(address=f"127.0.42.{n}", wind=WindSpec(float(n), 90.0, 0.0)) for n in (1, 2, 3)]
    files = {"127.0.42.2": "steps: [{at: 1, gps: false}]", "127.0.42.3": "steps: [{at: 1, battery: 50}]"}
    scenarios = {address: from_text(text, "x") for address, text in files.items()}
    simulator = Simulator(specs, scenarios=scenarios)
    simulator.advance(1.1)
    assert [drone.faults.gps for drone in simulator.drones] == [True, False, True]
    assert [drone.battery.percent for drone in simulator.drones] == [100, 100, 50]
    assert [drone.wind.spec.speed for drone in simulator.drones] == [1.0, 2.0, 3.0]


def test_unreadable_scenario_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read"):
        load(tmp_path / "none.yaml")
    (tmp_path / "big.yaml").write_bytes(b"#" * ((1 << 20) + 1))
    with pytest.raises(ConfigError, match="at most"):
        load(tmp_path / "big.yaml")


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--scenario", "bad.yaml"], "--scenario: bad.yaml: steps[0].gps: expected `bool`, got `str`"),
        (["--scenario", "none.yaml"], "--scenario: cannot read none.yaml"),
        (["--wind", "8"], "--wind: expected SPEED,DIRECTION or SPEED,DIRECTION,GUSTS like 8,270,0.15, got '8'"),
        (["--wind", "8,x"], "--wind: expected SPEED,DIRECTION or"),
        (["--wind", "80,0"], "--wind: expected m/s from 0 to 40, got 80"),
    ],
)
async def test_invalid_scenario_is_one_line_on_the_terminal(tmp_path: Path, options: list[str], line: str) -> None:
    (tmp_path / "bad.yaml").write_text("steps: [{at: 1, gps: maybe}]")
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "anafi_mav", "sim", *options),
        cwd=tmp_path,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    out, err = await asyncio.wait_for(process.communicate(), 30.0)
    assert process.returncode == 2
    assert line in err.decode()
    assert len(err.decode().strip().splitlines()) == 1
    assert out == b""

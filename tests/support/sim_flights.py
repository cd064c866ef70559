"""Flights of the simulated drone in virtual time, and the record of them in `sim_flights.json`.

The record was made by the simulator with steps of 5 ms. Run this module to make it again, which is right only when the
motion is meant to change:

    PYTHONPATH=tests .venv/bin/python -m support.sim_flights

Commands leave and poses are noted at multiples of 0.05 s, which is a whole number of steps at 200 Hz and at 60 Hz.
"""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from anafi_mav import geo
from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, move
from anafi_mav.arsdk.messages.ardrone3 import PCMD, OrientationMode
from anafi_mav.drone import Limits
from anafi_mav.drone.piloting.sticks import percent
from anafi_mav.sim.world.motion import STEP
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.velocity_loop import MotionEstimate, VelocityController
from anafi_mav.vehicle.circle import Circle, Lap
from support.sim_bench import HOME, Bench

RECORD = Path(__file__).with_suffix(".json")

TICK = 0.05
"""s between two looks at what is to be sent."""
NOTED = 0.2
"""s between two poses of the record."""

Row: TypeAlias = tuple[float, float, float, float, float]
"""s after the first command; north, east, up in m from home; heading in deg, not wrapped."""

Pilot: TypeAlias = Callable[[Bench, float], PCMD | None]
"""Sticks for a time (s); None: no PCMD."""


@dataclass(frozen=True)
class Flight:
    """Commands by time (s after the first), sent beside the sticks."""

    duration: float
    commands: Mapping[float, Message]
    settings: tuple[Message, ...] = ()
    pilot: Callable[[], Pilot] = field(default=lambda: lambda bench, t: None)
    """Makes the pilot of one flight, who may remember things."""
    model: str = "4k"

    def fly(self) -> list[Row]:
        bench, pilot = Bench(self.model), self.pilot()
        for setting in self.settings:
            bench.send(setting)
        commands = {round(at / TICK): message for at, message in self.commands.items()}
        rows = []
        for tick in range(round(self.duration / TICK)):
            if tick % round(NOTED / TICK) == 0:
                pose = bench.pose
                heading = math.degrees(bench.body.heading)
                rows.append((round(tick * TICK, 3), pose.north, pose.east, pose.up, heading))
            if tick in commands:
                bench.send(commands[tick])
            if (sticks := pilot(bench, tick * TICK)) is not None:
                bench.send(sticks)
            bench.run(TICK)
        return rows


def _place(north: float, east: float) -> tuple[float, float]:
    return geo.destination(*HOME[:2], north, east)


def _goto(north: float, east: float, up: float, orientation: OrientationMode, heading: float = 0.0) -> ardrone3.MoveTo:
    return ardrone3.MoveTo(*_place(north, east), up, orientation, heading)


def _sticks(*parts: tuple[float, float, tuple[int, int, int, int]]) -> Callable[[], Pilot]:
    """Parts: from, to (s), and roll, pitch, yaw, gaz in percent; afterwards the sticks are centred until the next."""

    def pilot(bench: Bench, t: float) -> PCMD | None:
        if t < parts[0][0] - TICK / 2:
            return None
        for begin, end, (roll, pitch, yaw, gaz) in parts:
            if begin - TICK / 2 <= t < end - TICK / 2:
                return PCMD(int(bool(roll or pitch)), roll, pitch, yaw, gaz, 0)
        return PCMD(0, 0, 0, 0, 0, 0)

    return lambda: pilot


def _orbit() -> Pilot:
    """The gateway's orbit from 12 s on: clockwise, 20 m around a place, 4 m/s, with the aircraft's report rates."""
    motion, limits = MotionEstimate(), Limits(tilt_deg=25.0, yaw_rate_dps=90.0, climb_mps=3.0)
    lap = Lap(Circle(GeoPoint(*_place(20.0, 0.0)), 20.0, 1, 4.0, 15.0))
    controller = VelocityController(motion)
    last: list[PCMD] = []

    def pilot(bench: Bench, t: float) -> PCMD | None:
        pose, tick = bench.pose, round(t / TICK)
        if tick % 20 == 0:
            motion.on_place(*bench.firmware.place())
        if tick % 4 == 0:
            motion.on_attitude(pose.roll, pose.pitch, pose.yaw, t)
            motion.on_velocity(pose.vn, pose.ve, pose.vd, t)
            motion.on_height(pose.up, t)
            demand = None if t < 12.0 - TICK / 2 else lap.demand(motion)
            command = None if demand is None else controller.sticks(demand, limits, t)
            if command is not None:
                roll, pitch, yaw, gaz = percent(command, limits)
                last[:] = [PCMD(1, roll, pitch, yaw, gaz, 0)]
        return last[0] if last else None

    return pilot


_TAKE_OFF = {0.0: ardrone3.TakeOff()}
_CLIMB = {**_TAKE_OFF, 5.0: ardrone3.MoveBy(0.0, 0.0, -14.0, 0.0)}
_FAST = (
    ardrone3.MaxTilt(40.0),
    ardrone3.MaxVerticalSpeed(4.0),
    ardrone3.MaxRotationSpeed(200.0),
    ardrone3.MaxPitchRollRotationSpeed(300.0),
)
_ORBIT_LIMITS = (ardrone3.MaxTilt(25.0), ardrone3.MaxRotationSpeed(90.0))
_FAST_GOTO = move.ExtendedMoveTo(
    *_place(-60.0, 60.0), 30.0, OrientationMode.TO_TARGET, 0.0, max_horizontal_speed=12.0, max_vertical_speed=4.0,
    max_yaw_rotation_speed=90.0,
)  # fmt: skip

FLIGHTS: dict[str, Flight] = {
    "take-off": Flight(8.0, _TAKE_OFF),
    "landing": Flight(28.0, {**_CLIMB, 14.0: ardrone3.Landing()}),
    "goto": Flight(30.0, {**_CLIMB, 12.0: _goto(30.0, 40.0, 25.0, OrientationMode.NONE)}),
    "goto, nose first": Flight(30.0, {**_CLIMB, 12.0: _goto(30.0, -40.0, 8.0, OrientationMode.TO_TARGET)}),
    "goto, nose on the way": Flight(
        30.0, {**_CLIMB, 12.0: _goto(-40.0, 20.0, 15.0, OrientationMode.HEADING_DURING, 120.0)}
    ),
    "goto at 12 m/s": Flight(30.0, {**_CLIMB, 12.0: _FAST_GOTO}, _FAST, model="ai"),
    "moveBy with heading": Flight(24.0, {**_CLIMB, 12.0: ardrone3.MoveBy(20.0, -10.0, -5.0, math.pi / 2)}),
    "orbit": Flight(50.0, _CLIMB, _ORBIT_LIMITS, _orbit),
    "orbit, yaw delay of the Ai": Flight(50.0, _CLIMB, _ORBIT_LIMITS, _orbit, model="ai"),
    "step of each stick": Flight(
        40.0,
        _CLIMB,
        pilot=_sticks(
            (12.0, 14.0, (0, 50, 0, 0)),
            (18.0, 20.0, (-50, 0, 0, 0)),
            (24.0, 26.0, (0, 0, 50, 0)),
            (29.0, 31.0, (0, 0, 0, 100)),
            (34.0, 36.0, (30, 40, -60, -50)),
        ),
    ),
    "full steps both ways": Flight(
        40.0,
        _CLIMB,
        _FAST,
        _sticks(
            (12.0, 14.0, (0, 100, 0, 0)),
            (14.0, 16.0, (0, -100, 0, 0)),
            (22.0, 24.0, (0, 0, 0, 100)),
            (24.0, 26.0, (0, 0, 0, -100)),
            (31.0, 33.0, (0, 0, 100, 0)),
            (33.0, 35.0, (0, 0, -100, 0)),
        ),
    ),
    "long run at full tilt": Flight(30.0, _CLIMB, _FAST, _sticks((12.0, 18.0, (100, 0, 0, 0)))),
}


def recorded() -> dict[str, list[Row]]:
    """The flights of the record."""
    flights: dict[str, list[Row]] = json.loads(RECORD.read_text())["flights"]
    return flights


def main() -> None:
    """Fly everything and write the record, a pose a line, to the millimetre and the tenth of a degree."""
    commit = subprocess.run(("git", "rev-parse", "HEAD"), capture_output=True, text=True, check=True).stdout.strip()
    flights = []
    for name, flight in FLIGHTS.items():
        rows = ",\n".join(
            json.dumps([t, *(round(v, 3) + 0.0 for v in place), round(heading, 1) + 0.0])
            for t, *place, heading in flight.fly()
        )
        flights.append(f"{json.dumps(name)}: [\n{rows}\n]")
    head = (
        f'{{\n"commit": "{commit}",\n"step": {STEP!r},\n"columns": ["s", "north m", "east m", "up m", "heading deg"],'
    )
    RECORD.write_text(f'{head}\n"flights": {{\n' + ",\n".join(flights) + "\n}\n}\n")


if __name__ == "__main__":
    main()

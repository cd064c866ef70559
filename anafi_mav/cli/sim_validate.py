"""`anafi-mav sim validate`: fly section IV of the anafi_ros paper with simulated drones and compare.

Everything goes over real sockets: a simulator of its own, and Parrot's controller role at the other end. The paper
reads 30 Hz frame metadata; here the drone's own events come at a higher rate than an aircraft sends them.
"""

from __future__ import annotations

import argparse
import asyncio
import importlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from anafi_mav.arsdk.controller import ControllerSession, connect
from anafi_mav.arsdk.messages import ardrone3, gimbal
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.gimbal import ControlMode, FrameOfReference
from anafi_mav.arsdk.wire import Message, UnknownMessage
from anafi_mav.cli import options
from anafi_mav.cli.terminal import complain, say
from anafi_mav.errors import CommandTimeout, ConfigError
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from anafi_mav.sim.model import MODELS
from anafi_mav.sim.validation import (
    AFTER,
    CLIMB,
    HOLD,
    SPIN,
    TILT,
    Result,
    Series,
    Track,
    climb_results,
    gimbal_results,
    tilt_results,
    yaw_results,
)

RATE = 100.0
"""Hz of attitude, speed and height; an aircraft sends 5, its video carries 30."""

PERIOD = 0.05
"""s of the machine's clock between two PCMD, as Parrot's own controllers send them."""

HEIGHT = 30.0
"""m above take-off that everything is flown at."""

LIMIT = 60.0
"""Simulated s for a take-off or a climb."""

REST = 1.0
"""Simulated s of hover before the first test."""

MAX_LOST = 0.1
"""Simulated s that may be missing from all flights together: the shortest time that the paper tells."""

GIMBAL_SPEED = 180.0
"""deg/s"""

GIMBAL_TIME = 2.2
"""Simulated s that a gimbal gets from one limit to the other."""

ADDRESS = "127.0.0.1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav sim validate`."""
    parser.add_argument("--model", default="all", help=f"{', '.join(MODELS)} or all (%(default)s)")
    parser.add_argument(
        "--speed",
        default="1.0",
        metavar="FACTOR",
        help="simulated seconds per second; below 1 a busy machine disturbs less (%(default)s)",
    )
    parser.add_argument(
        "--plots", type=Path, metavar="DIR", help="draw the figures of the paper into DIR (needs matplotlib)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Fly and compare; 1 when something does not agree or the flights are invalid. Raises `ConfigError`."""
    if arguments.model != "all" and arguments.model not in MODELS:
        raise ConfigError("--model", f"expected one of {', '.join(MODELS)} or all, got {arguments.model!r}")
    models = list(MODELS) if arguments.model == "all" else [arguments.model]
    speed = options.speed(arguments.speed)
    if arguments.plots is not None:
        _plotter()
        try:
            arguments.plots.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError("--plots", f"expected a folder, got {arguments.plots}: {error.strerror}") from error
    flights, lost = asyncio.run(_fly_all(models, speed))
    if lost > MAX_LOST:
        complain(
            f"the flights are invalid: this machine was too slow for them and {lost:.1f} simulated s are missing; "
            f"a lower --speed than {speed:g} may help"
        )
        return 1
    agreed = True
    for flight in flights:
        say(f"{flight.model}, against section IV of the anafi_ros paper")
        for result in flight.results:
            agreed = agreed and result.agrees
            verdict = "agrees" if result.agrees else "DIFFERS"
            number = f"{result.measured:>9.2f} {result.unit:<6}"
            line = f"  {result.what:<34}{number} published {result.published:<24} {verdict}"
            say(line, "" if result.agrees else "red")
    say(
        f"from the drone's own events at {RATE:g} Hz over the wire, speed {speed:g}; "
        "the paper used 30 Hz frame metadata"
    )
    if arguments.plots is not None:
        for path in _plot(flights, arguments.plots):
            say(f"drawn {path}")
    return 0 if agreed else 1


class Flight:
    """One model in the air, its controller, and what was measured; all times are simulated seconds."""

    def __init__(self, drone: SimulatedDrone, speed: float) -> None:
        self.drone = drone
        self._speed = speed
        self.model = drone.spec.model
        self.results: list[Result] = []
        self.series: dict[str, tuple[Series, Series]] = {}
        """By figure: what was commanded, what was measured."""
        self._session: ControllerSession | None = None
        self._track = Track()
        self._zero = 0.0
        self._waiting: list[tuple[Callable[[Message], bool], asyncio.Future[None]]] = []

    async def fly(self) -> None:
        """All tests, one after the other. Raises `LinkLost`, `CommandTimeout`."""
        self._session = await connect(
            ADDRESS, discovery_port=self.drone.discovery_port, on_message=self._hear, silence_limit=None
        )
        try:
            await self._take_off()
            await self._pitch_and_roll()
            await self._climb()
            await self._yaw()
            await self._gimbal()
        finally:
            await self._session.close()

    def _send(self, message: Message) -> None:
        assert self._session is not None
        self._session.send(message)

    def _hear(self, message: Message | UnknownMessage, now: float) -> None:
        t, track = (now - self._zero) * self._speed, self._track
        match message:
            case ardrone3.AttitudeChanged(roll, pitch, yaw):
                track.attitude.append((t, roll, pitch, yaw))
            case ardrone3.SpeedChanged(north, east, down):
                track.speed.append((t, north, east, down))
            case ardrone3.AltitudeChanged(height):
                track.height.append((t, height))
            case gimbal.Attitude() if message.gimbal_id == 0:
                track.gimbal.append((t, message.pitch_absolute, message.roll_absolute))
        if isinstance(message, Message):
            for met, future in self._waiting:
                if not future.done() and met(message):
                    future.set_result(None)

    def _begin(self) -> None:
        """Forget what was heard; time counts from now on."""
        self._track, self._zero = Track(), asyncio.get_running_loop().time()

    async def _pass(self, seconds: float) -> None:
        await asyncio.sleep(seconds / self._speed)

    async def _until(self, what: str, met: Callable[[Message], bool]) -> None:
        future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.append((met, future))
        try:
            await asyncio.wait_for(future, LIMIT / self._speed)
        except asyncio.TimeoutError:
            raise CommandTimeout(what, LIMIT) from None
        finally:
            self._waiting.remove((met, future))

    async def _take_off(self) -> None:
        for setting in (
            ardrone3.MaxTilt(TILT),
            ardrone3.MaxVerticalSpeed(CLIMB),
            ardrone3.MaxRotationSpeed(SPIN),
            ardrone3.MaxPitchRollRotationSpeed(300.0),
            gimbal.SetMaxSpeed(0, GIMBAL_SPEED, GIMBAL_SPEED, GIMBAL_SPEED),
            ardrone3.TakeOff(),
        ):
            self._send(setting)
        await self._until("a take-off", _hovers)
        self._send(ardrone3.MoveBy(0.0, 0.0, -HEIGHT, 0.0))
        await self._until("a climb", lambda message: isinstance(message, ardrone3.MoveByEnd))
        await self._pass(REST)

    async def _test(self, *, roll: int = 0, pitch: int = 0, yaw: int = 0, gaz: int = 0) -> Track:
        """Full stick one way, the other way, nothing; what was heard meanwhile, time counted from the first PCMD."""
        loop = asyncio.get_running_loop()
        self._begin()
        end = 2 * HOLD + AFTER
        while (t := (loop.time() - self._zero) * self._speed) < end:
            sign = 1 if t < HOLD else -1 if t < 2 * HOLD else 0
            self._send(ardrone3.PCMD(1, sign * roll, sign * pitch, sign * yaw, sign * gaz, 0))
            changes = [moment for moment in (HOLD, 2 * HOLD, end) if moment > t]
            await self._pass(max(0.0, min(PERIOD * self._speed, changes[0] - t)))
        return self._track

    async def _pitch_and_roll(self) -> None:
        track = await self._test(pitch=100)
        self.results += tilt_results("pitch", track.pitch(), track, 8.0)
        self.series["pitch, deg"] = (_steps(TILT), track.pitch())
        track = await self._test(roll=100)
        self.results += tilt_results("roll", track.roll(), track, 10.0)
        self.series["roll, deg"] = (_steps(TILT), track.roll())

    async def _climb(self) -> None:
        track = await self._test(gaz=100)
        self.results += climb_results(track)
        self.series["vertical speed, m per s"] = (_steps(CLIMB), track.climb())

    async def _yaw(self) -> None:
        track = await self._test(yaw=100)
        self.results += yaw_results(track, self.model)
        self.series["yaw rate, deg per s"] = (_steps(SPIN), track.yaw_rate())

    async def _gimbal(self) -> None:
        model = MODELS[self.model].gimbals[0]
        for name, limits, column in (("roll", model.roll, 2), ("pitch", model.pitch, 1)):
            if limits == (0.0, 0.0):
                continue
            await self._aim(name, ControlMode.POSITION, limits[0])
            position = _column(await self._aim(name, ControlMode.POSITION, limits[1]), column)
            await self._aim(name, ControlMode.POSITION, limits[0])
            velocity = _column(await self._aim(name, ControlMode.VELOCITY, 1.0), column)
            self.results += gimbal_results(name, position, velocity, limits, GIMBAL_SPEED)
            wanted = [(0.0, limits[1]), (GIMBAL_TIME, limits[1])]
            self.series[f"gimbal {name} by orientation, deg"] = (wanted, position)
            self.series[f"gimbal {name} by velocity, deg"] = (wanted, velocity)

    async def _aim(self, axis: str, mode: ControlMode, value: float) -> Track:
        none, absolute = FrameOfReference.NONE, FrameOfReference.ABSOLUTE
        pitch, roll = (absolute, none) if axis == "pitch" else (none, absolute)
        self._begin()
        self._send(gimbal.SetTarget(0, mode, none, 0.0, pitch, value, roll, value))
        await self._pass(GIMBAL_TIME)
        return self._track


async def _fly_all(models: list[str], speed: float) -> tuple[list[Flight], float]:
    """Each model in the air at the same time; and how much simulated time the machine was too slow for."""
    specs = [
        DroneSpec(
            model=model,
            address=ADDRESS,
            discovery_port=0,
            handshake_port=0,
            c2d_port=0,
            http_port=None,
            telemetry_rate=RATE,
        )
        for model in models
    ]
    async with Simulator(specs, speed=speed, seed=1, remember=False) as simulator:
        flights = [Flight(drone, speed) for drone in simulator.drones]
        tasks = [asyncio.create_task(flight.fly()) for flight in flights]
        try:
            await asyncio.gather(*tasks)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)
    return flights, simulator.lost_time


def _hovers(message: Message) -> bool:
    return isinstance(message, ardrone3.FlyingStateChanged) and message.state is FlyingState.HOVERING


def _column(track: Track, column: int) -> Series:
    return [(sample[0], sample[column]) for sample in track.gimbal]


def _steps(value: float) -> Series:
    end = 2 * HOLD + AFTER
    corners = ((0.0, value), (HOLD, value), (HOLD, -value), (2 * HOLD, -value), (2 * HOLD, 0.0), (end, 0.0))
    return [(0.0, 0.0), *corners]


def _plotter() -> Any:
    try:
        importlib.import_module("matplotlib").use("Agg")
        return importlib.import_module("matplotlib.pyplot")
    except ImportError as error:
        raise ConfigError("--plots", "expected matplotlib to be installed: pip install 'anafi-mav[plots]'") from error


def _plot(flights: list[Flight], folder: Path) -> Iterable[Path]:
    """The paper's figures, a file each, all models in one."""
    plotter = _plotter()
    names = dict.fromkeys(name for flight in flights for name in flight.series)
    for name in names:
        figure, axes = plotter.subplots(figsize=(6.0, 3.5))
        commanded = next(flight.series[name][0] for flight in flights if name in flight.series)
        axes.plot(*zip(*commanded, strict=True), "k--", linewidth=1.0, label="commanded")
        for flight in flights:
            if name in flight.series and flight.series[name][1]:
                axes.plot(*zip(*flight.series[name][1], strict=True), linewidth=1.0, label=flight.model)
        what, _, unit = name.rpartition(", ")
        axes.set_xlabel("time, s")
        axes.set_ylabel(unit.replace(" per ", "/"))
        axes.set_title(what)
        axes.legend()
        axes.grid(True, linewidth=0.3)
        path = folder / f"{what.replace(' ', '-')}.svg"
        figure.savefig(path, bbox_inches="tight", metadata={"Date": None})
        plotter.close(figure)
        yield path

"""`anafi-mav sim validate`: compares simulated drones with the anafi_ros paper.

It flies the tests of the paper's section IV. Everything goes over real sockets: a simulator of its own, and a
`Drone` as the gateway has it at the other end. As in the paper the numbers are the metadata of each picture of the
drone's video, 30 times a second. All times are those of the drone's own clock, from the moment on when a command
has reached it, so that a busy host makes nothing longer.
"""

from __future__ import annotations

import argparse
import asyncio
import importlib
import math
from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from anafi_mav.arsdk.messages import ardrone3, gimbal
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.gimbal import FrameOfReference
from anafi_mav.cli import interrupts, options
from anafi_mav.cli.terminal import complain, say
from anafi_mav.drone import Drone, PilotingCommand
from anafi_mav.drone.payload.gimbal import Aim
from anafi_mav.drone.piloting.sticks import HOLD_LIMIT
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.errors import CommandTimeout, ConfigError
from anafi_mav.sim import DroneSpec, LogEntry, SimulatedDrone, Simulator
from anafi_mav.sim.validation import (
    AFTER,
    CLIMB,
    HOLD,
    SPIN,
    TILT,
    Comparison,
    MeasuredTrack,
    Series,
    climb_results,
    gimbal_results,
    tilt_results,
    yaw_results,
)
from anafi_mav.sim.world.model import MODELS

HEIGHT = 30.0
"""m above take-off that everything is flown at."""

LIMIT = 60.0
"""Simulated s for a take-off or a climb."""

REST = 1.0
"""Simulated s of hover before the first test."""

PATIENCE = 10.0
"""s of the host's clock for a picture, or for a command to arrive.

A video that stopped has restarted by then.
"""

STANDSTILL = HOLD_LIMIT - 0.1
"""s of the host's clock between two pictures from which a test is invalid.

The stick input has timed out by then, since its sender has not renewed it.
"""

RARE = 0.12
"""Simulated s between two pictures from which a test is invalid: the delays that it measures are as long. They are to
come every 0.033 s."""

TRIES = 5
"""Times that a test is flown until it is valid."""

GIMBAL_SPEED = 180.0
"""deg/s"""

GIMBAL_TIME = 2.2
"""Simulated s that a gimbal gets from one limit to the other."""

ADDRESS = "127.0.0.1"


def run(arguments: argparse.Namespace) -> int:
    """Fly and compare; 1 when something does not agree or the flights are invalid.

    Raises `ConfigError`.
    """
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
    return interrupts.run(validate(models, speed, arguments.plots))


async def validate(models: list[str], speed: float, plots: Path | None) -> int:
    """Fly and compare these models and print the results; return the exit status.

    `plots` is an existing folder for the drawings.
    """
    try:
        flights = await _fly_all(models, speed)
    except HostStalled as error:
        complain(f"the flights are invalid: {error}; try again when it is less busy, or one --model at a time")
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
    rate = sum(flight.rate for flight in flights) / len(flights)
    say(f"from the frame metadata of the video, {rate:.0f} times a simulated second, speed {speed:g}")
    if plots is not None:
        for path in _plot(flights, plots):
            say(f"drawn {path}")
    return 0 if agreed else 1


class HostStalled(Exception):
    """The machine was too slow for a test, as often as it was flown."""


class ValidationFlight:
    """Flight of one model: its controller and the measured values.

    All times are seconds of the drone's own clock.
    """

    def __init__(self, real: SimulatedDrone, speed: float) -> None:
        self.real = real
        self.model = real.spec.model
        self.results: list[Comparison] = []
        self.series: dict[str, tuple[Series, Series]] = {}
        """By figure: what was commanded, what was measured."""
        self._speed = speed
        self._frames: list[VideoFrame] = []
        """Since the test began."""
        self._came = asyncio.Event()
        self._drone = Drone(
            ADDRESS, discovery_port=real.discovery_port, rtsp_port=real.rtsp_port or 0, name=f"simulated {self.model}"
        )

    async def fly(self) -> None:
        """All tests, one after the other.

        Raises `LinkLost`, `CommandTimeout`, `CommandRejected`, `HostStalled`.
        """
        await self._drone.connect()
        try:
            self._drone.video.subscribe(self._see)
            async with self._drone.video.watching():
                await self._take_off()
                await self._pitch_and_roll()
                await self._climb()
                await self._yaw()
                await self._gimbal()
        finally:
            await self._drone.close()

    async def _take_off(self) -> None:
        piloting, patience = self._drone.piloting, LIMIT / self._speed
        await piloting.set_max_tilt(TILT)
        await piloting.set_max_vertical_speed(CLIMB)
        await piloting.set_max_rotation_speed(SPIN)
        await piloting.set_max_tilt_speed(300.0)
        await self._drone.gimbal.set_max_speed(GIMBAL_SPEED)
        await piloting.take_off()
        if piloting.state.flying is not FlyingState.HOVERING:
            await self._drone.expect(
                ardrone3.FlyingStateChanged, lambda message: message.state is FlyingState.HOVERING, patience
            )
        await piloting.move_by(0.0, 0.0, -HEIGHT, 0.0, timeout=patience)
        await self._watch(self.real.time, REST)

    def _see(self, frame: VideoFrame) -> None:
        self._frames.append(frame)
        self._came.set()

    @property
    def rate(self) -> float:
        """Pictures a simulated second, in the last test."""
        span = self._frames[-1].taken - self._frames[0].taken
        return (len(self._frames) - 1) / span

    async def _watch(self, zero: float, until: float, each: Callable[[float], None] = lambda t: None) -> MeasuredTrack:
        """Return the metadata of the pictures until `until` s after `zero`.

        `each` is called with the time of every picture. Raises `CommandTimeout` when the pictures stop arriving.
        """
        t = 0.0
        while t < until:
            each(t)
            self._came.clear()
            try:
                await asyncio.wait_for(self._came.wait(), PATIENCE)
            except asyncio.TimeoutError:
                raise CommandTimeout("a picture", PATIENCE) from None
            t = self._frames[-1].taken - zero
        track = MeasuredTrack()
        for frame in self._frames:
            track.add(frame.taken - zero, frame.metadata)
        return track

    async def _order(self, means: Callable[[LogEntry], bool], send: Callable[[], None]) -> float:
        """Send a command; when the drone received it, by its own clock."""
        moments: list[float] = []

        def comes(entry: LogEntry) -> bool:
            if entry.kind != "command" or not means(entry):
                return False
            moments.append(self.real.time)
            return True

        self._frames.clear()
        coming = asyncio.ensure_future(self.real.wait_log(comes, PATIENCE))
        await asyncio.sleep(0)  # it listens from now on
        send()
        await coming
        return moments[0]

    async def _test(self, stick: PilotingCommand) -> MeasuredTrack:
        """Full stick one way, the other way, nothing; what the pictures said meanwhile."""
        piloting = self._drone.piloting
        back = PilotingCommand(-stick.roll_deg, -stick.pitch_deg, -stick.yaw_rate_dps, -stick.climb_mps)

        def hold(t: float) -> None:
            piloting.pilot(stick if t < HOLD else back if t < 2 * HOLD else PilotingCommand())

        for _ in range(TRIES):
            zero = await self._order(_is_deflected, partial(hold, 0.0))
            track = await self._watch(zero, 2 * HOLD + AFTER, hold)
            why = _standstill([frame.arrived for frame in self._frames if frame.taken - zero < 2 * HOLD]) or self._gap()
            if why is None:
                return track
        raise HostStalled(why)

    async def _pitch_and_roll(self) -> None:
        track = await self._test(PilotingCommand(pitch_deg=-TILT))
        self.results += tilt_results("pitch", track.pitch(), track, 8.0)
        self.series["pitch, deg"] = (_steps(TILT), track.pitch())
        track = await self._test(PilotingCommand(roll_deg=TILT))
        self.results += tilt_results("roll", track.roll(), track, 10.0)
        self.series["roll, deg"] = (_steps(TILT), track.roll())

    async def _climb(self) -> None:
        track = await self._test(PilotingCommand(climb_mps=CLIMB))
        self.results += climb_results(track)
        self.series["vertical speed, m per s"] = (_steps(CLIMB), track.climb())

    async def _yaw(self) -> None:
        track = await self._test(PilotingCommand(yaw_rate_dps=SPIN))
        self.results += yaw_results(track, MODELS[self.model].airframe.yaw_delay)
        self.series["yaw rate, deg per s"] = (_steps(SPIN), track.yaw_rate())

    async def _gimbal(self) -> None:
        model, mount = MODELS[self.model].gimbals[0], self._drone.gimbal
        for name, limits, column in (("roll", model.roll, 2), ("pitch", model.pitch, 1)):
            if limits == (0.0, 0.0):
                continue
            low, high, fast = (Aim(value, FrameOfReference.ABSOLUTE) for value in (*limits, GIMBAL_SPEED))
            position = _column(await self._turn_from(low, mount.aim, name, high), column)
            velocity = _column(await self._turn_from(low, mount.turn, name, fast), column)
            self.results += gimbal_results(name, position, velocity, limits, GIMBAL_SPEED)
            wanted = [(0.0, limits[1]), (GIMBAL_TIME, limits[1])]
            self.series[f"gimbal {name} by orientation, deg"] = (wanted, position)
            self.series[f"gimbal {name} by velocity, deg"] = (wanted, velocity)

    async def _turn_from(self, begin: Aim, send: Callable[..., None], axis: str, aim: Aim) -> MeasuredTrack:
        for _ in range(TRIES):
            await self._turn(self._drone.gimbal.aim, axis, begin)
            track = await self._turn(send, axis, aim)
            why = self._gap()
            if why is None:
                return track
        raise HostStalled(why)

    def _gap(self) -> str | None:
        """Why the pictures of this test are too few to measure by; None when they are not."""
        times = [frame.taken for frame in self._frames]
        gap = max((after - before for before, after in pairwise(times)), default=math.inf)
        return None if gap < RARE else f"this machine was too slow for them, two pictures were {gap:.2f} s apart"

    async def _turn(self, send: Callable[..., None], axis: str, aim: Aim) -> MeasuredTrack:
        zero = await self._order(lambda entry: entry.name == gimbal.SetTarget.NAME, partial(send, **{axis: aim}))
        return await self._watch(zero, GIMBAL_TIME)


def _standstill(arrivals: list[float]) -> str | None:
    """Why the sticks were not held all the time; None when they were."""
    wait = max((after - before for before, after in pairwise(arrivals)), default=PATIENCE)
    return None if wait < STANDSTILL else f"this machine was too slow for them, the host stalled for {wait:.1f} s"


async def _fly_all(models: list[str], speed: float) -> list[ValidationFlight]:
    """Each model in the air at the same time."""
    specs = [
        DroneSpec(
            model=model,
            address=ADDRESS,
            discovery_port=0,
            handshake_port=0,
            c2d_port=0,
            http_port=None,
            rtsp_port=0,
        )
        for model in models
    ]
    async with Simulator(specs, speed=speed, seed=1, remember=False) as simulator:
        flights = [ValidationFlight(drone, speed) for drone in simulator.drones]
        tasks = [asyncio.create_task(flight.fly()) for flight in flights]
        try:
            await asyncio.gather(*tasks)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)
    return flights


def _is_deflected(entry: LogEntry) -> bool:
    sticks = ("roll", "pitch", "yaw", "gaz")
    return entry.name == ardrone3.PCMD.NAME and any(entry.args[stick] for stick in sticks)


def _column(track: MeasuredTrack, column: int) -> Series:
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


def _plot(flights: list[ValidationFlight], folder: Path) -> Iterable[Path]:
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

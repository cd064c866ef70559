"""Simulator of any number of drones in one process.

One timer advances the world of all.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

from anafi_mav.errors import ConfigError
from anafi_mav.sim.drone import DroneSpec, SimulatedDrone
from anafi_mav.sim.log import Log, LogFile
from anafi_mav.sim.scenario import Scenario
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.model import model_of
from anafi_mav.sim.world.motion import STEP

TURN, FAST_TURN = STEP, 0.005
"""s of the machine's clock between two turns of the world; the second when telemetry is wanted that fast. At `speed` 1
a turn is one step of the motion, or none of the fast ones."""

MAX_CATCH_UP = 0.25
"""s of the machine's clock that one turn makes up for; what is beyond (a stopped process, a machine too slow for
the fleet) is lost to the simulated world, whose drones must not leap."""

MAX_TURN = 2
"""Times the usual length of a turn that one turn may be. A world that is behind catches up in pieces and looks at its
sockets in between: on a busy machine its drones would else be deaf for longer than a controller waits."""

LOG_CAPACITY = 40_000
"""Log entries kept in memory for the whole fleet (about 50 MB): an hour of one drone, poses ten times a second."""

MIN_CAPACITY = 1000
"""Log entries kept in memory for each drone, however many there are."""


class Simulator:
    """The world. `async with Simulator([DroneSpec()]) as simulator:` opens and closes it."""

    def __init__(
        self,
        specs: Sequence[DroneSpec],
        *,
        speed: float = 1.0,
        seed: int | None = None,
        log: Path | None = None,
        remember: bool = True,
        scenarios: Mapping[str, Scenario] | None = None,
    ) -> None:
        """Create the drones of `specs`.

        `speed` runs the world faster than the clock, `seed` makes ids the same in every run, `log` is a file of
        JSON lines, `remember` keeps the log in memory too, `scenarios` maps a drone's address to its scenario.

        Raises `ConfigError` for specs that exclude each other, `OSError` when the log cannot be written.
        """
        if not specs:
            raise ConfigError("drones", "expected at least one")
        self._period = TURN if all(spec.telemetry_rate <= 0.5 / TURN for spec in specs) else FAST_TURN
        self.speed = speed
        self._file = None if log is None else LogFile(log)
        self._next_turn: asyncio.TimerHandle | None = None
        self._stopped: asyncio.Future[None] | None = None
        """Has the error that stopped the world, if one did; None before the start."""
        self._last = self._due = 0.0
        """Times of the last turn, and of the one that is due (s, loop clock)."""
        self._debt = 0.0
        """Simulated seconds by which the world is behind the clock."""
        self.lost_time = 0.0
        """Simulated seconds that were skipped because the process did not get to run."""
        chance = random.Random(seed)
        capacity = max(MIN_CAPACITY, LOG_CAPACITY // len(specs)) if remember else 0
        self._airframes = [Airframe(model_of(spec.model).airframe) for spec in specs]
        self.drones = [
            SimulatedDrone(
                spec,
                airframe,
                Log(spec.address, capacity, self._file),
                _clock,
                random.Random(chance.getrandbits(64)),
                phase=index / len(specs),
            )
            for index, (spec, airframe) in enumerate(zip(specs, self._airframes, strict=True))
        ]
        self._scenarios = scenarios or {}
        for scenario in self._scenarios.values():
            scenario.check_drones({spec.address for spec in specs})

    @property
    def speed(self) -> float:
        """How much faster than the clock the world runs; it can be changed at any time."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not 0.0 < speed <= 100.0:
            raise ConfigError("speed", f"expected more than 0 and at most 100, got {speed:g}")
        self._speed = speed
        self._most_steps = max(1, round(MAX_TURN * self._period * speed / STEP))

    async def __aenter__(self) -> Simulator:
        await self.start()
        return self

    async def __aexit__(
        self, type: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    async def start(self) -> None:
        """Open every drone's sockets and let time run.

        Raises `ConfigError` naming the drone that cannot listen.
        """
        self._turn(_clock(), 0)
        try:
            for index, drone in enumerate(self.drones):
                try:
                    await drone.start()
                except OSError as error:
                    raise ConfigError(
                        f"drones[{index}].address", f"expected free ports on {drone.address}: {error}"
                    ) from error
        except BaseException:
            await self.close()
            raise
        self._stopped = asyncio.get_running_loop().create_future()
        self._last = self._due = _clock()
        self._wait_for_turn()

    async def close(self) -> None:
        """Stop time and close all sockets. Idempotent."""
        if self._next_turn is not None:
            self._next_turn.cancel()
            self._next_turn = None
        for drone in self.drones:
            await drone.close()
        if self._file is not None:
            self._file.close()

    async def wait(self) -> None:
        """Return never; raise what stopped the world, if anything does."""
        if self._stopped is not None:
            await asyncio.shield(self._stopped)

    def _wait_for_turn(self) -> None:
        """Set the timer to the next turn; at once while the world is behind."""
        if self._debt < STEP:
            # From turn to turn on the clock, not from a late one on: else some would make two steps, others none.
            self._due += self._period
            if self._due < self._last:
                self._due = self._last + self._period
        self._next_turn = asyncio.get_running_loop().call_at(self._due, self._run)

    def _run(self) -> None:
        """Make the turn that is due."""
        now, speed = _clock(), self._speed
        debt = self._debt + (now - self._last) * speed
        self._last = now
        if debt > MAX_CATCH_UP * speed:
            self.lost_time += debt - MAX_CATCH_UP * speed
            debt = MAX_CATCH_UP * speed
        steps = min(round(debt / STEP), self._most_steps)
        self._debt = debt - steps * STEP  # negative when the last step began early, by half of it at most
        try:
            self._turn(now, steps)
        except Exception as error:
            assert self._stopped is not None, "it runs from the start on"
            self._stopped.set_exception(error)
            return
        self._wait_for_turn()

    def advance(self, seconds: float) -> None:
        """Advance the simulated world by hand, before it has been started.

        Needs a running event loop for its clock.
        """
        now = _clock()
        for _ in range(round(seconds / STEP)):
            now += STEP
            self._turn(now, 1)

    def _turn(self, now: float, steps: int) -> None:
        scenarios = self._scenarios
        elapsed = steps * STEP
        passed = elapsed / self._speed
        for drone, airframe in zip(self.drones, self._airframes, strict=True):
            for _ in range(steps):
                airframe.step()
            drone.tick(now, elapsed, passed, airframe.pose, airframe.has_arrived, airframe.is_still)
            if scenarios and (scenario := scenarios.get(drone.address)) is not None:
                scenario.tick(drone)
        if self._file is not None:
            self._file.flush()


def _clock() -> float:
    return asyncio.get_running_loop().time()

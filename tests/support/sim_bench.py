"""A simulated drone without its sockets: firmware and motion on a clock that the test turns."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any, TypeVar

from anafi_mav.arsdk.codec.wire import Message, encode
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.sim.autopilot.firmware import Firmware, Identity
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.faults import Faults
from anafi_mav.sim.world.model import MODELS
from anafi_mav.sim.world.motion import STEP, Pose
from anafi_mav.sim.world.place import WorldOrigin

HOME = (48.8789, 2.3677, 35.0)

M = TypeVar("M", bound=Message)


class Bench:
    """One drone at HOME, heading north. `now` is the machine's clock and the simulated one at once."""

    def __init__(self, model_name: str = "4k") -> None:
        model = MODELS[model_name]
        self.body = Airframe(model.airframe)
        self.events: list[Message] = []
        self.notes: list[dict[str, Any]] = []
        self.faults = Faults()
        self.now = 1000.0
        self.firmware = Firmware(
            model,
            Identity("PI040416DA9H000001", "ANAFI-H000001", "boot", "run"),
            self.body,
            WorldOrigin(*HOME),
            self._hear,
            lambda name, args: self.notes.append(args),
            self.faults,
            random.Random(1),
        )
        self.run(0.1)

    def _hear(self, event: Message) -> None:
        encode(event)  # raises when it does not fit the wire
        self.events.append(event)

    @property
    def pose(self) -> Pose:
        return self.firmware.pose

    @property
    def state(self) -> FlyingState:
        return self.firmware.state

    def turn(self) -> None:
        """One step of the motion."""
        self.body.step()
        self.now += STEP
        self.firmware.tick(self.now, STEP, self.body.pose, self.body.has_arrived, self.body.is_still)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            self.turn()

    def run_until(self, happened: Callable[[], bool], limit: float = 60.0) -> float:
        """Turn until it has happened; the seconds that took."""
        began = self.now
        while not happened():
            assert self.now - began < limit, "it does not happen"
            self.turn()
        return self.now - began

    def send(self, message: Message) -> list[Message]:
        """A command; what it is answered with at once."""
        before = len(self.events)
        self.firmware.receive(message, self.now)
        return self.events[before:]

    def of(self, kind: type[M]) -> list[M]:
        """Every event of a kind so far."""
        return [event for event in self.events if isinstance(event, kind)]

    def states(self) -> list[FlyingState]:
        return [event.state for event in self.of(ardrone3.FlyingStateChanged)]

    def sticks(
        self, seconds: float, *, roll: int = 0, pitch: int = 0, yaw: int = 0, gaz: int = 0, flag: int = 1
    ) -> None:
        """Hold the sticks, a PCMD every 50 ms."""
        for _ in range(round(seconds / 0.05)):
            self.send(ardrone3.PCMD(flag, roll, pitch, yaw, gaz, 0))
            self.run(0.05)

    def rest(self) -> None:
        """Until it hovers."""
        self.run_until(lambda: self.state is FlyingState.HOVERING)

    def take_off(self) -> None:
        self.send(ardrone3.TakeOff())
        self.rest()

    def climb(self, height: float) -> None:
        self.send(ardrone3.MoveBy(0.0, 0.0, self.pose.up - height, 0.0))
        self.run_until(lambda: bool(self.of(ardrone3.MoveByEnd)))
        self.rest()
        self.events.clear()

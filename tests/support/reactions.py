"""Which commands the simulator reacts to: each one is sent in every situation in which it could mean something.

A reaction is an event that leaves the drone, or its Skycontroller, at once. What is not answered that way stands in
`silent_commands` with the reason, which is where docs/silence.md comes from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import anafi_mav.arsdk.messages
import anafi_mav.arsdk.messages.proto  # noqa: F401 # declares the protobuf ones too
from anafi_mav.arsdk.codec.envelope import ProtobufMessage
from anafi_mav.arsdk.codec.wire import (
    Bits,
    Blob,
    Direction,
    Message,
    OpenEnum,
    Text,
    UnknownMessage,
    WireType,
    declared_messages,
    wire_fields,
)
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.messages import animation, ardrone3, common, follow_me, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MoveToStatus, PoiMode
from anafi_mav.sim.skycontroller import Skycontroller
from anafi_mav.sim.world.place import WorldOrigin
from support.sim_bench import HOME, Bench

MODELS = ("4k", "thermal", "usa", "ai")
COMMANDS = sorted((m for m in declared_messages() if m.DIRECTION is Direction.COMMAND), key=lambda m: m.NAME)
CONTROLLERS = (3, 4)
OF_A_CONTROLLER = ("skyctrl.", "drone_manager.", "mapper.", "devicemanager.", "controllerNetwork.")
"""What a Skycontroller keeps to itself."""

PLAN = b"QGC WPL 120\n0\t0\t3\t22\t0\t0\t0\tnan\t0\t0\t0\t1\n1\t0\t3\t93\t9\t0\t0\t0\t0\t0\t0\t1\n"


# -- commands with some sense in them


def _value(wire: WireType, python: type, number: int, uid: str) -> Any:
    if isinstance(wire, Text):
        return (uid, "", "x")[number % 3]
    if isinstance(wire, Blob):
        return b""
    code = wire.base.code if isinstance(wire, Bits) else wire.code
    if code in "fd":
        return float(number)
    return python(number) if issubclass(python, OpenEnum) else number


def variants(command: type[Message], uid: str) -> Iterator[Message]:
    """With zeros, ones and twos; `uid` is that of a flight plan."""
    if issubclass(command, ProtobufMessage):
        yield command()
        return
    for number in (1, 0, 2):
        yield command(*(_value(wire, python, number, uid) for _, wire, python in wire_fields(command)))


# -- situations


def _standing(model: str) -> Bench:
    bench = Bench(model)
    bench.run(0.2)
    return bench


def _flying(model: str) -> Bench:
    bench = Bench(model)
    bench.take_off()
    bench.climb(5.0)
    return bench


def _idling(model: str) -> Bench:
    bench = Bench(model)
    bench.send(ardrone3.UserTakeOff(1))
    bench.run_until(lambda: bench.state is FlyingState.USERTAKEOFF)
    return bench


def _moving(model: str) -> Bench:
    bench = _flying(model)
    place = WorldOrigin(*HOME).place(80.0, 0.0)
    bench.send(ardrone3.MoveTo(*place, 10.0, ardrone3.OrientationMode.NONE, 0.0))
    bench.run(0.5)
    return bench


def _looking(model: str) -> Bench:
    bench = _flying(model)
    place = WorldOrigin(*HOME).place(20.0, 0.0)
    bench.send(ardrone3.StartPilotedPOIV2(*place, 0.0, PoiMode.LOCKED_GIMBAL))
    bench.run(0.5)
    return bench


def _going_home(model: str) -> Bench:
    bench = _flying(model)
    bench.sticks(4.0, pitch=60)
    bench.rest()
    bench.send(rth.ReturnToHome())
    bench.run(0.5)
    return bench


def _low(model: str) -> Bench:
    """A return by itself is announced."""
    bench = _flying(model)
    bench.sticks(6.0, pitch=100)
    bench.rest()
    bench.faults.battery = 13
    bench.run_until(lambda: any(e.reason for e in bench.of(rth.RthAutoTrigger)))
    return bench


SITUATIONS: tuple[tuple[Callable[[str], Bench], Callable[[Bench], bool]], ...] = (
    (_standing, lambda bench: bench.state is FlyingState.LANDED),
    (_flying, lambda bench: bench.state is FlyingState.HOVERING),
    (_looking, lambda bench: bench.firmware.poi.running),
    (_moving, lambda bench: bench.of(ardrone3.MoveToChanged)[-1].status is MoveToStatus.RUNNING),
    (_going_home, lambda bench: bench.firmware.homing.flying),
    (_low, lambda bench: bench.firmware.endurance.return_report() != rth.RthAutoTrigger(rth.AutoTriggerReason.NONE, 0)),
    (_idling, lambda bench: bench.state is FlyingState.USERTAKEOFF),
)
"""How to get there, and whether it still is so."""

_ONE_WAY = (ardrone3.Emergency, ardrone3.TakeOff, ardrone3.Landing, common.Start)
"""Sent last, so that a situation is not repeated more often than needed."""


def unanswered(model: str) -> set[str]:
    """Names of the commands that this model does not answer in any situation."""
    left = sorted(
        (command for command in COMMANDS if not command.NAME.startswith(OF_A_CONTROLLER)),
        key=lambda command: (command in _ONE_WAY, command.NAME),
    )
    for make, holds in SITUATIONS:
        bench = make(model)
        uid = bench.firmware.plans.put(PLAN)
        silent = []
        for command in left:
            answered = False
            for message in variants(command, uid):
                if not holds(bench):
                    bench = make(model)
                    uid = bench.firmware.plans.put(PLAN)
                answered = answered or bool(bench.send(message))
                bench.turn()
            if not answered:
                silent.append(command)
            _calm(bench)
        left = silent
    return {command.NAME for command in left}


def _calm(bench: Bench) -> None:
    """End what a command may have begun and the next would be deaf to."""
    for order in (animation.Cancel(), follow_me.Stop(), common.Stop()):
        bench.send(order)
    bench.run(0.1)


def unanswered_by_controller(generation: int) -> set[str]:
    """Names of the commands for a controller that this one does not answer, and does not let through to its drone."""
    passed: list[Message | UnknownMessage] = []
    said: list[Message] = []
    controller = Skycontroller(
        generation,
        DeviceInfo(0x0914, "PI040416DA9H000001", 44444, "ANAFI-H000001"),
        lambda message, now: passed.append(message),
        lambda name, args: None,
        lambda up: None,
    )
    controller.link_up(said.append)
    silent = set()
    for command in COMMANDS:
        if not command.NAME.startswith(OF_A_CONTROLLER):
            continue
        answered = False
        for message in variants(command, controller.drone.serial):
            before = len(said)
            mine = controller.receive(message, 0.0)
            controller.tick(10.0)
            heard = [one for one in said[before:] if not one.NAME.endswith("AttitudeChanged")]
            answered = answered or (mine and bool(heard))
        if not answered:
            silent.add(command.NAME)
    return silent

"""`anafi-mav info ADDRESS`: what is there: model, serial, firmware, battery, features, limits.

It connects as the gateway does. A drone has one controller at a time: whoever was connected is not any more.
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from anafi_mav.arsdk.wire import Message
from anafi_mav.cli.addresses import spot
from anafi_mav.cli.terminal import say
from anafi_mav.drone import Drone
from anafi_mav.drone.element import Range

LISTEN = 1.2
"""s to listen after the connection: what the drone tells once a second has come by then."""

OLD_PROJECTS = {"ardrone3", "common", "skyctrl", "generic"}
"""Parrot's first families of messages; everything else is called a feature."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav info`."""
    parser.add_argument(
        "address", metavar="ADDRESS", help="of the drone or Skycontroller; 192.168.42.1%%wlan1 names the interface too"
    )


def run(arguments: argparse.Namespace) -> int:
    """Connect, tell, disconnect. Raises `LinkLost` when nobody is there."""
    for line in asyncio.run(_ask(**spot(arguments.address))):
        say(line)
    return 0


async def _ask(address: str, interface: str | None = None) -> list[str]:
    drone = Drone(address, interface=interface)
    features: set[str] = set()

    def hear(message: Message, now: float) -> None:
        features.add(message.NAME.partition(".")[0])

    drone.subscribe(hear)
    await drone.connect()
    try:
        await asyncio.wait([drone.lost], timeout=LISTEN)
        return [*_who(drone), f"features: {', '.join(sorted(features - OLD_PROJECTS))}", *_limits(drone)]
    finally:
        await drone.close()


def _who(drone: Drone) -> Iterator[str]:
    identity, battery, gps, product = drone.identity, drone.battery.state, drone.gps.state, drone.product.state
    yield f"model: {identity.model.title}"
    yield f"name: {identity.name}"
    yield f"serial: {identity.serial}"
    yield f"firmware: {identity.firmware or 'not told'}, hardware {identity.hardware or 'not told'}"
    details = [
        f"{value:g} {unit}"
        for value, unit in (
            (battery.percent, "%"),
            (None if battery.voltage_mv is None else battery.voltage_mv / 1000.0, "V"),
            (battery.health_percent, "% health"),
            (battery.cycles, "charges"),
        )
        if value is not None
    ]
    yield f"battery: {', '.join(details) or 'not told'}"
    if gps.fixed is not None:
        sight = "" if gps.satellites is None else f", {gps.satellites} satellites"
        yield f"GPS: {'fix' if gps.fixed else 'no fix'}{sight}"
    if product.flights is not None and product.total_flight_s is not None:
        yield f"flown: {product.flights} times, {product.total_flight_s / 3600.0:.1f} h"
    blockers = drone.takeoff_blockers()
    yield f"take-off: {'refused: ' + ', '.join(blockers) if blockers else 'possible'}"
    if drone.controller.present:
        state = drone.controller.state
        charge = "charging or not told" if state.battery_percent is None else f"{state.battery_percent} %"
        yield f"controller: {state.serial}, firmware {state.firmware}, battery {charge}"


def _limits(drone: Drone) -> Iterator[str]:
    """Every setting with a range that the drone has reported."""
    yield "limits (value, lowest to highest):"
    for element in (drone.piloting, drone.home, drone.gimbal, drone.camera):
        yield from _ranges("", element.state)


def _ranges(name: str, value: Any) -> Iterator[str]:
    """The ranges in a state, by the path to each."""
    if isinstance(value, Range):
        yield f"  {name.strip()}: {value.current:g}, {value.min:g} to {value.max:g}"
    elif isinstance(value, msgspec.Struct):
        for key in value.__struct_fields__:
            yield from _ranges(f"{name} {key.replace('_', ' ')}", getattr(value, key))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _ranges(f"{name} {getattr(key, 'name', key)}".lower(), item)

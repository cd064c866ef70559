"""`anafi-mav info ADDRESS`: prints the properties of one drone.

They are model, serial number, firmware, battery, features and limits. It connects as the gateway does, which
disconnects any other controller: see `consent`.
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.mux.mux_link import look_either
from anafi_mav.cli import consent, interrupts, log, options
from anafi_mav.cli.addresses import spot
from anafi_mav.cli.terminal import complain, say, say_json
from anafi_mav.drone import Drone
from anafi_mav.drone.element import Range
from anafi_mav.errors import AnafiMavError, ConfigError

LISTEN = 1.2
"""s to listen after the connection: values that the drone sends once a second have arrived by then."""

OLD_PROJECTS = {"ardrone3", "common", "skyctrl", "generic"}
"""Parrot's first families of messages; everything else is called a feature."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav info`."""
    parser.add_argument(
        "address", metavar="ADDRESS", help="of the drone or Skycontroller; 192.168.42.1%%wlan1 names the interface too"
    )
    consent.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Connect, print, disconnect. Raises `LinkLost` when no drone answers."""
    log.set_up()
    place = spot(arguments.address)
    options.host("ADDRESS", place["address"], options.ADDRESS)
    held = consent.gateway_of(arguments.state, place["address"], place.get("interface"))
    if held is None and consent.holder_of(arguments.state) is not None:  # perhaps by another address
        held = consent.gateway_of(arguments.state, "", None, interrupts.run(_serial(**place)))
    if held is not None:
        complain(f"{arguments.address}: not connected: {held}{consent.GATEWAY_RETRIES}")
        return 1
    may = consent.may_connect(arguments.address, take=arguments.take)
    if may is None:
        without = "`anafi-mav discover` shows what is there without it"
        raise ConfigError("--take", f"expected it, because {consent.WARNING}; {without}")
    if not may:
        return 1
    facts = interrupts.run(_ask(**place))
    if arguments.json:
        say_json(facts)
    else:
        for line in _lines(facts):
            say(line)
    return 0


async def _serial(address: str, interface: str | None = None) -> str:
    """Return the serial number in a device's discovery description; empty when it has none."""
    try:
        return (await look_either(address, interface=interface)).serial
    except (AnafiMavError, OSError):
        return ""


async def _ask(address: str, interface: str | None = None) -> dict[str, Any]:
    drone = Drone(address, interface=interface)
    features: set[str] = set()

    def hear(message: Message, now: float) -> None:
        features.add(message.NAME.partition(".")[0])

    drone.subscribe(hear)
    await drone.connect()
    try:
        await asyncio.wait([drone.lost], timeout=LISTEN)
        return {**_facts(drone), "features": sorted(features - OLD_PROJECTS), "limits": dict(_limits(drone))}
    finally:
        await drone.close()


def _facts(drone: Drone) -> dict[str, Any]:
    """Return the properties that the drone has reported; None for the others."""
    identity, battery, gps, product = drone.identity, drone.battery.state, drone.gps.state, drone.product.state
    controller = drone.controller.state
    return {
        "model": identity.model.title,
        "name": identity.name,
        "serial": identity.serial,
        "firmware": identity.firmware or None,
        "hardware": identity.hardware or None,
        "battery": {
            "percent": battery.percent,
            "volts": None if battery.voltage_mv is None else battery.voltage_mv / 1000.0,
            "health_percent": battery.health_percent,
            "charges": battery.cycles,
        },
        "gps": {"fix": gps.fixed, "satellites": gps.satellites},
        "flights": product.flights,
        "flown_s": product.total_flight_s,
        "takeoff_blockers": drone.takeoff_blockers(),
        "takeoff_checklist": bool(drone.alerts.state.checklist),
        "controller": {
            "serial": controller.serial,
            "firmware": controller.firmware,
            "battery_percent": controller.battery_percent,
        }
        if drone.controller.present
        else None,
    }


_UNITS = {"percent": "%", "volts": "V", "health_percent": "% health", "charges": "charges"}


def _lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """The same for people."""
    for key in ("model", "name", "serial"):
        yield f"{key}: {facts[key]}"
    yield f"firmware: {facts['firmware'] or 'not reported'}, hardware {facts['hardware'] or 'not reported'}"
    battery = [f"{value:g} {_UNITS[key]}" for key, value in facts["battery"].items() if value is not None]
    yield f"battery: {', '.join(battery) or 'not reported'}"
    gps = facts["gps"]
    if gps["fix"] is not None:
        sight = "" if gps["satellites"] is None else f", {gps['satellites']} satellites"
        yield f"GPS: {'fix' if gps['fix'] else 'no fix'}{sight}"
    if facts["flights"] is not None and facts["flown_s"] is not None:
        yield f"flown: {facts['flights']} times, {facts['flown_s'] / 3600.0:.1f} h"
    blockers = facts["takeoff_blockers"]
    if blockers:
        yield f"take-off: refused: {', '.join(blockers)}"
    else:  # without the drone's own list nothing is known of most reasons
        yield f"take-off: {'possible' if facts['takeoff_checklist'] else 'no reason against it reported'}"
    if (controller := facts["controller"]) is not None:
        percent = controller["battery_percent"]
        charge = "charging or not reported" if percent is None else f"{percent} %"
        yield f"controller: {controller['serial']}, firmware {controller['firmware']}, battery {charge}"
    yield f"features: {', '.join(facts['features'])}"
    yield "limits (value, lowest to highest):"
    for name, limit in facts["limits"].items():
        yield f"  {name}: {limit['value']:g}, {limit['min']:g} to {limit['max']:g}"


def _limits(drone: Drone) -> Iterator[tuple[str, dict[str, float]]]:
    """Every setting with a range that the drone has reported, by its name."""
    for element in (drone.piloting, drone.home, drone.gimbal, drone.camera):
        yield from _ranges("", element.state)


def _ranges(name: str, value: Any) -> Iterator[tuple[str, dict[str, float]]]:
    """The ranges in a state, by the path to each."""
    if isinstance(value, Range):
        yield name.strip(), {"value": value.current, "min": value.min, "max": value.max}
    elif isinstance(value, msgspec.Struct):
        for key in value.__struct_fields__:
            yield from _ranges(f"{name} {key.replace('_', ' ')}", getattr(value, key))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _ranges(f"{name} {getattr(key, 'name', key)}".lower(), item)

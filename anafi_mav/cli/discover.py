"""`anafi-mav discover`: lists reachable aircraft and controllers, as configuration lines.

Only the discovery description of a device is requested, so a controller that is connected to it is not disturbed. The
usual addresses are tried on the interfaces that are in their networks, so nothing is sent to routers.
"""

from __future__ import annotations

import argparse
import asyncio
import ipaddress
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.link.interface import networks
from anafi_mav.arsdk.mux.mux_link import look_either
from anafi_mav.cli import interrupts, log
from anafi_mav.cli.addresses import spot
from anafi_mav.cli.terminal import complain, say, say_json
from anafi_mav.drone.controller.controller import MODELS as CONTROLLERS
from anafi_mav.drone.status.product import MODELS
from anafi_mav.errors import AnafiMavError, ConfigError
from anafi_mav.printable import printable

USUAL = {
    "192.168.42.1": "the Wi-Fi of an ANAFI",
    "192.168.43.1": "an ANAFI by USB",
    "192.168.53.1": "a Skycontroller by USB",
    "10.202.0.1": "Parrot's own simulator",
}
"""Usual addresses of Parrot's devices (Olympe, olympe/connection)."""

MAX_TIMEOUT = 60.0
MAX_NAME = 32
"""Characters of a drone's name in a configuration."""


@dataclass(frozen=True)
class SearchAddress:
    """An address to try, through one interface or as the routes say."""

    address: str
    interface: str | None = None

    def __str__(self) -> str:
        return f"{self.address} on {self.interface}" if self.interface else self.address


@dataclass(frozen=True)
class Find:
    """Device that answered, and its place."""

    place: SearchAddress
    device: DeviceInfo


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav discover`."""
    usual = ", ".join(USUAL)
    parser.add_argument(
        "addresses",
        nargs="*",
        metavar="ADDRESS",
        help=f"look here besides the usual places ({usual}); 192.168.42.1%%wlan1 names the network interface too",
    )
    parser.add_argument("--json", action="store_true", help="print a JSON list instead of a configuration")
    parser.add_argument("--timeout", default="2", metavar="SECONDS", help="to wait for an answer (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Look everywhere at once. 1 when nothing is there."""
    log.set_up()
    timeout = _timeout(arguments.timeout)
    wanted = [_place(text) for text in arguments.addresses]
    finds = interrupts.run(discover(places(wanted, networks()), timeout))
    if arguments.json:
        say_json([_facts(find) for find in finds])
        return 0 if finds else 1
    if not finds:
        complain("nothing found; is the machine in the Wi-Fi of the drone, or a Skycontroller plugged in?")
        return 1
    for line in configuration(finds):
        say(line)
    return 0


def _facts(find: Find) -> dict[str, object]:
    device, place = find.device, find.place
    kind = "drone" if device.model_id in MODELS else "controller" if device.model_id in CONTROLLERS else "unknown"
    known = CONTROLLERS.get(device.model_id) or (MODELS[device.model_id].title if device.model_id in MODELS else None)
    return {
        "address": place.address,
        "interface": place.interface,
        "kind": kind,
        "model": known,
        "model_id": device.model_id,
        "name": device.name,
        "serial": device.serial,
    }


def _timeout(text: str) -> float:
    try:
        timeout = float(text)
    except ValueError:
        timeout = 0.0
    if not 0.0 < timeout <= MAX_TIMEOUT:
        raise ConfigError("--timeout", f"expected seconds up to {MAX_TIMEOUT:g}, got {text!r}")
    return timeout


def _place(text: str) -> SearchAddress:
    place = SearchAddress(**spot(text))
    try:
        ipaddress.IPv4Address(place.address)
    except ValueError:
        raise ConfigError("ADDRESS", f"expected an IPv4 address like 192.168.42.1, got {text!r}") from None
    return place


def places(wanted: Sequence[SearchAddress], here: Sequence[tuple[str, ipaddress.IPv4Network]]) -> list[SearchAddress]:
    """Return the places to try: the requested ones, and each address on its interfaces.

    Those are the interfaces that are in the network of the address.
    """
    result = list(wanted)
    for address in [*USUAL, *(place.address for place in wanted if place.interface is None)]:
        on = [interface for interface, network in here if ipaddress.IPv4Address(address) in network]
        result += [SearchAddress(address, interface) for interface in on]
        if address in USUAL and not here:  # not Linux: no way to know
            result.append(SearchAddress(address))
    return list(dict.fromkeys(result))


async def discover(where: Collection[SearchAddress], timeout: float) -> list[Find]:
    """Try all these places at once and return each device once.

    It is listed with its interface if known, since two devices may answer to one address.
    """
    answers = await asyncio.gather(*(_look(place, timeout) for place in where))
    finds: dict[tuple[str, int], Find] = {}
    for find in answers:
        if find is not None:
            key = (find.device.serial or str(find.place), find.device.model_id)
            # Found with and without naming the interface: the former says more.
            if key not in finds or finds[key].place.interface is None:
                finds[key] = find
    return sorted(finds.values(), key=lambda find: str(find.place))


async def _look(place: SearchAddress, timeout: float) -> Find | None:
    try:
        device = await look_either(place.address, interface=place.interface, timeout=timeout)
    except (AnafiMavError, OSError):
        return None
    return Find(place, device)


def configuration(finds: Sequence[Find]) -> list[str]:
    """A configuration with a drone for each find, to be written to a file as it is."""
    shared = Counter(find.place.address for find in finds)
    names: set[str] = set()
    lines = ["drones:"]
    for sysid, find in enumerate(finds, 1):
        device, place = find.device, find.place
        lines.append(f"  # {title(device)} {printable(device.serial)[:MAX_NAME]}, found at {place}")
        keys = [f'name: "{_name(device, names)}"', f"sysid: {sysid}", f"address: {place.address}"]
        if place.interface is not None and shared[place.address] > 1:
            keys.append(f"interface: {place.interface}")
        lines.append(f"  - {{{', '.join(keys)}}}")
    return lines


def title(device: DeviceInfo) -> str:
    """Return the display name of a device's model."""
    if device.model_id in CONTROLLERS:
        return f"{CONTROLLERS[device.model_id]} with the drone behind it,"
    model = MODELS.get(device.model_id)
    return f"unknown device 0x{device.model_id:04x}" if model is None else model.title


def _name(device: DeviceInfo, taken: set[str]) -> str:
    """The device's own name as a configuration may say it, unlike those before."""
    base = re.sub(r"[^A-Za-z0-9_.-]+", "-", device.name or device.serial).strip("-_.")[: MAX_NAME - 4] or "drone"
    name, number = base, 2
    while name in taken:
        name, number = f"{base}-{number}", number + 1
    taken.add(name)
    return name

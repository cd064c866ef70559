"""`anafi-mav doctor ADDRESS`: checks the conditions for flying a drone, a line each.

A line for a failed check contains its repair. Everything up to the drone's discovery description disturbs no other
controller. The handshake does, so the rest needs permission: see `consent`. docs/troubleshooting.md explains each
line.
"""

from __future__ import annotations

import argparse
import asyncio
import ipaddress
import socket
from collections.abc import Iterator
from typing import NamedTuple

from anafi_mav.arsdk.link.handshake import DISCOVERY_PORT, HANDSHAKE_PORT, DeviceInfo
from anafi_mav.arsdk.link.interface import bind_to_interface, networks, open_connection
from anafi_mav.arsdk.mux import mux
from anafi_mav.arsdk.mux.mux_link import look_either
from anafi_mav.arsdk.video.rtsp import DEFAULT_PORT as RTSP_PORT
from anafi_mav.cli import consent, interrupts, log, options
from anafi_mav.cli.addresses import spot
from anafi_mav.cli.terminal import say, say_json
from anafi_mav.drone import Drone
from anafi_mav.drone.controller.controller import MODELS as CONTROLLERS
from anafi_mav.drone.drone import CONTROLLER_PORTS, HANDSHAKE_AFTER
from anafi_mav.drone.rest import HTTP_PORT
from anafi_mav.drone.status.product import MODELS
from anafi_mav.errors import AnafiMavError, ConfigError, LinkLost
from anafi_mav.services.version_numbers import version_numbers
from anafi_mav.vehicle.failsafe_settings import FailsafeLimits, warnings_of

ANSWER_LIMIT = 2.0
"""s for a port to answer, and again for the introduction: an aircraft in range takes some milliseconds."""

LISTEN = HANDSHAKE_AFTER + 4.0
"""s to stay connected. Another controller tries again within two, another gateway after `HANDSHAKE_AFTER` of silence;
what it takes is noticed by a silence of 2.5."""

LOWEST_CEILING, SMALLEST_FENCE = 10.0, 30.0
"""m: an aircraft with less than that refuses nearly every flight."""

UNASKED = ("controller", "firmware", "settings", "failsafes")


class Finding(NamedTuple):
    """The result of one check."""

    check: str
    wrong: bool
    fact: str
    mend: str = ""
    """Repair, as an instruction; empty when nothing is wrong."""

    def __str__(self) -> str:
        return f"{self.check}: WRONG: {self.fact}; {self.mend}" if self.wrong else f"{self.check}: ok: {self.fact}"


def ok(check: str, fact: str) -> Finding:
    return Finding(check, False, fact)


def wrong(check: str, fact: str, mend: str) -> Finding:
    return Finding(check, True, fact, mend)


class DroneAddress(NamedTuple):
    """Address, interface and ports that are examined."""

    address: str
    interface: str | None = None
    http_port: int = HTTP_PORT
    rtsp_port: int = RTSP_PORT


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav doctor`."""
    parser.add_argument(
        "address", metavar="ADDRESS", help="of the drone or Skycontroller; 192.168.42.1%%wlan1 names the interface too"
    )
    consent.add_arguments(parser)
    parser.add_argument("--http-port", default=str(HTTP_PORT), metavar="PORT", help="of its web server (%(default)s)")
    parser.add_argument("--rtsp-port", default=str(RTSP_PORT), metavar="PORT", help="of its video (%(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Examine, print a line for each check; 1 when one of them is wrong."""
    log.set_up()
    place = DroneAddress(
        **spot(arguments.address),
        http_port=_port("--http-port", arguments.http_port),
        rtsp_port=_port("--rtsp-port", arguments.rtsp_port),
    )
    options.host("ADDRESS", place.address, options.ADDRESS)
    findings, device = interrupts.run(before_handshake(place))
    held = consent.gateway_of(arguments.state, place.address, place.interface, "" if device is None else device.serial)
    if held is not None:
        findings.append(
            ok("gateway", str(held))
            if held.drone.serial
            else wrong("gateway", str(held), "its own lines say why" + consent.GATEWAY_RETRIES)
        )
    if not arguments.json:
        for finding in findings:
            _print(finding)
    unasked: tuple[str, ...] = UNASKED
    if held is None and device is not None and consent.may_connect(arguments.address, take=arguments.take):
        unasked = ()
        more = interrupts.run(with_handshake(place))
        findings += more
        if not arguments.json:
            for finding in more:
                _print(finding)
    if arguments.json:
        say_json({"findings": [finding._asdict() for finding in findings], "not_asked": list(unasked)})
    elif unasked:
        why = "" if device is None else f"; {consent.WARNING}: with --take it is done"
        if held is not None:
            why = "; the gateway has the drone, and its drones are left to it"
        say(f"{', '.join(unasked)}: not asked{why}")
    return 1 if any(finding.wrong for finding in findings) else 0


def _print(finding: Finding) -> None:
    say(str(finding), "red" if finding.wrong else "")


def _port(flag: str, text: str) -> int:
    port = options.integer(flag, text, "a port from 1 to 65535")
    if not 0 < port < 65536:
        raise ConfigError(flag, f"expected a port from 1 to 65535, got {port}")
    return port


# Before the handshake.


async def before_handshake(place: DroneAddress) -> tuple[list[Finding], DeviceInfo | None]:
    """Examine what no other controller notices; also the device's introduction, if it gave one."""
    findings = [adapter(place), route(place)]
    if any(finding.wrong for finding in findings):
        return findings, None
    usual = (DISCOVERY_PORT, HANDSHAKE_PORT, mux.PORT, place.http_port, place.rtsp_port)
    states = dict(zip(usual, await asyncio.gather(*(_try_port(place, port) for port in usual)), strict=True))
    device, problem = None, ""
    if OPEN in (states[DISCOVERY_PORT], states[mux.PORT]):
        try:
            device = await look_either(place.address, interface=place.interface, timeout=ANSWER_LIMIT)
        except AnafiMavError as error:
            problem = str(error)
    if device is not None and device.model_id in CONTROLLERS and states[DISCOVERY_PORT] == OPEN:
        web = place.http_port + CONTROLLER_PORTS
        states[web] = await _try_port(place, web)
    return [*findings, *ports(place, states, device), *model(device, problem)], device


def adapter(place: DroneAddress) -> Finding:
    """Is this machine in the network of that address?"""
    there = [name for _, name in socket.if_nameindex()]
    if place.interface is not None:
        if place.interface in there:
            return ok("adapter", place.interface)
        return wrong("adapter", f"there is no network adapter {place.interface}", f"expected one of {', '.join(there)}")
    try:
        address = ipaddress.IPv4Address(place.address)
    except ValueError:
        return ok("adapter", f"{place.address} is a name: as the routes say")
    if address.is_loopback:
        return ok("adapter", "this machine itself")
    known = networks()
    on = [interface for interface, network in known if address in network]
    if len(on) > 1:
        choice = f"{place.address}%{on[0]}"
        return wrong("adapter", f"{' and '.join(on)} are both in the network of {address}", f"name one: {choice}")
    if on or not known:
        return ok("adapter", on[0] if on else "cannot be seen on this system")
    if address.is_private and str(address).startswith("192.168."):
        return wrong(
            "adapter",
            f"no network adapter of this machine is in the network of {address}",
            "join the drone's Wi-Fi, or plug in the Skycontroller and wait until it is ready",
        )
    return ok("adapter", f"none is in the network of {address}: through a router")


def route(place: DroneAddress) -> Finding:
    """Can a packet leave for that address?"""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            bind_to_interface(probe, place.interface)
            probe.connect((place.address, DISCOVERY_PORT))  # sends nothing
        except (OSError, LinkLost) as error:
            reason = getattr(error, "strerror", "") or str(error)
            return wrong(
                "route", f"none to {place.address}: {reason}", "check the address and the adapter's own address"
            )
        return ok("route", f"from {probe.getsockname()[0]}")


OPEN, REFUSED, SILENT = "open", "refused", "no answer"


async def _try_port(place: DroneAddress, port: int) -> str:
    """Open a TCP connection and close it again; nothing is sent."""
    try:
        connection = open_connection(place.address, port, interface=place.interface)
        _, writer = await asyncio.wait_for(connection, ANSWER_LIMIT)
    except (asyncio.TimeoutError, TimeoutError):
        return SILENT
    except ConnectionRefusedError:
        return REFUSED
    except OSError as error:
        return error.strerror or str(error)
    writer.close()
    return OPEN


_RESTART = "restart the drone and wait until its light is steady"


def ports(place: DroneAddress, states: dict[int, str], device: DeviceInfo | None) -> Iterator[Finding]:
    """Judge the ports by the kind of device.

    A Skycontroller 4 has everything behind its mux.
    """
    if OPEN not in states.values():
        if REFUSED in states.values():
            fact = f"{place.address} answers, and none of {', '.join(map(str, states))} is open"
            yield wrong("ports", fact, "it is no drone, or one that still starts: check the address, wait a minute")
        else:
            fact = f"{place.address} does not answer ({', '.join(sorted(set(states.values())))})"
            yield wrong("ports", fact, "switch the drone on, come closer, and let no firewall stop TCP to it")
        return
    by_mux = states[mux.PORT] == OPEN and states[DISCOVERY_PORT] != OPEN
    if by_mux:
        yield ok(f"port {mux.PORT}", "open, Parrot's mux: a Skycontroller 4")
        for port in (DISCOVERY_PORT, HANDSHAKE_PORT, place.http_port, place.rtsp_port):
            yield ok(f"port {port}", "behind the mux")
        return
    shift = CONTROLLER_PORTS if device is not None and device.model_id in CONTROLLERS else 0
    needed = (
        (DISCOVERY_PORT, "discovery", _RESTART),
        (HANDSHAKE_PORT, "handshake", _RESTART),
        (place.http_port + shift, "web server", f"media and missions need it: {_RESTART}, or name it by --http-port"),
        (place.rtsp_port, "live video", f"only video needs it: {_RESTART}, or name it by --rtsp-port"),
    )
    for port, what, mend in needed:
        state = states[port]
        yield ok(f"port {port}", f"open, {what}") if state == OPEN else wrong(f"port {port}", f"{what}: {state}", mend)
    yield ok(f"port {mux.PORT}", "not needed: only a Skycontroller 4 has it")


def model(device: DeviceInfo | None, problem: str) -> Iterator[Finding]:
    """Is it a device that this program flies?"""
    if device is None:
        if problem:
            yield wrong("model", f"no introduction: {problem}", f"the drone hangs, or is no Parrot drone: {_RESTART}")
        return
    title = CONTROLLERS.get(device.model_id) or (MODELS[device.model_id].title if device.model_id in MODELS else "")
    if title:
        yield ok("model", f"{title} {device.name}, serial number {device.serial}")
        return
    known = ", ".join([model.title for model in MODELS.values()] + list(CONTROLLERS.values()))
    yield wrong("model", f"0x{device.model_id:04x} ({device.name}) is not supported", f"supported are {known}")


# With the handshake.


async def with_handshake(place: DroneAddress) -> list[Finding]:
    """Connect as the gateway does, and look at what the drone reports."""
    drone = Drone(place.address, interface=place.interface, http_port=place.http_port, rtsp_port=place.rtsp_port)
    try:
        await drone.connect()
    except AnafiMavError as error:
        return [_no_connection(str(error))]
    try:
        await asyncio.wait([drone.lost], timeout=LISTEN)
        if drone.lost.done():
            return [_no_connection(f"connected and lost at once: {drone.lost.result()}")]
        controller = ok("controller", f"connected, no other controller took it back within {LISTEN:.0f} s")
        return [controller, firmware(drone), *settings(drone), *failsafes(drone)]
    finally:
        await drone.close()


def _no_connection(problem: str) -> Finding:
    if "Skycontroller" in problem:
        mend = "switch the drone on and pair it with this Skycontroller"
    elif "refused" in problem or "lost at once" in problem:
        mend = "another controller has the drone: end FreeFlight, Olympe or the other gateway, or switch its device off"
    else:
        mend = _RESTART
    return wrong("controller", problem, mend)


def firmware(drone: Drone) -> Finding:
    """Is it a version that this program is written for?"""
    version, wanted = drone.identity.firmware, drone.identity.model.firmware
    if not version:
        return wrong("firmware", "not reported", _RESTART)
    if version_numbers(version) >= wanted:
        return ok("firmware", version)
    need = ".".join(map(str, wanted))
    return wrong("firmware", f"{version}, older than {need}", "update it by Parrot's FreeFlight")


def settings(drone: Drone) -> Iterator[Finding]:
    """Look for what keeps a drone on the ground, or near it."""
    state, blockers = drone.piloting.state, drone.takeoff_blockers()
    for blocker in blockers:
        yield wrong("settings", f"take-off is refused: {blocker}", "docs/troubleshooting.md has the mend of each")
    ceiling, distance = state.max_altitude, state.max_distance
    if ceiling is not None and ceiling.current < LOWEST_CEILING:
        yield wrong("settings", f"highest altitude {ceiling.current:g} m", "raise the parameter ANF_MAX_ALT")
    if state.geofence and distance is not None and distance.current < SMALLEST_FENCE:
        mend = "raise the parameter ANF_MAX_DIST, or set ANF_GEOFENCE to 0"
        yield wrong("settings", f"the drone's geofence has a radius of {distance.current:g} m", mend)
    if not blockers:
        fence = f"{distance.current:g} m" if state.geofence and distance is not None else "off"
        top = "not reported" if ceiling is None else f"{ceiling.current:g} m"
        takeoff = "take-off is possible" if drone.alerts.state.checklist else "no reason against a take-off reported"
        yield ok("settings", f"{takeoff}, highest altitude {top}, geofence {fence}")


def failsafes(drone: Drone) -> Iterator[Finding]:
    """Look for settings that leave a failsafe without effect.

    By the limits of a configuration without `warnings`.
    """
    found = warnings_of(drone, FailsafeLimits())
    for warning in found:
        yield wrong("failsafes", warning.text, warning.mend)
    if not found:
        yield ok("failsafes", "no dangerous setting")

"""`anafi-mav status`: shows the drones, clients and refused commands of a running gateway.

It asks the gateway's web server, whose address and token it finds in the state folder. That token is sent to this
computer only: a gateway elsewhere has another one, which the user gives. On a terminal the tables are shown again every
second until Ctrl-C, also while the gateway does not answer or is started again; elsewhere once. Nothing is commanded.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, NoReturn
from urllib.parse import urlsplit

import aiohttp
import msgspec

from anafi_mav import access_token
from anafi_mav.access_token import AccessToken, read_token
from anafi_mav.cli import interrupts, log, options
from anafi_mav.cli.consent import holder_of
from anafi_mav.cli.terminal import TableRows, is_live, live_tables, say, say_json, say_table
from anafi_mav.clock import SystemClock
from anafi_mav.errors import AnafiMavError, ConfigError
from anafi_mav.relay.uri_host import is_loopback
from anafi_mav.state_lock import state_folder
from anafi_mav.status_record import PATH, VERSION, ClientStatus, DroneStatus, GatewayStatus, Quantiles
from anafi_mav.web.server import QUERY

EVERY = 1.0
"""s between two requests."""

LIMIT = 5.0
"""s for an answer."""

URL = "a URL like http://192.168.1.7:8088/"
"""Expected address of another gateway."""

MAX_REFUSED = 10
"""Refused commands that are shown."""


class AskedGateway(NamedTuple):
    """Web server of the gateway that is asked."""

    url: str
    """Ends in "/"."""
    token: AccessToken | None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav status`."""
    parser.add_argument("--state", metavar="FOLDER", help="state folder of the gateway, if it is not the usual one")
    parser.add_argument("--url", metavar="URL", help="web server of the gateway, like http://192.168.1.7:8088/")
    parser.add_argument(
        "--token",
        metavar="TEXT",
        help=f"token of that gateway, if it is another computer's; better in {access_token.VARIABLE}",
    )
    parser.add_argument("--json", action="store_true", help="print the record once, as JSON")
    parser.add_argument(
        "--link", action="store_true", help="print the link that opens the page in a browser; it holds the token"
    )


def run(arguments: argparse.Namespace) -> int:
    """Show the status. Raises `AnafiMavError` when no gateway answers."""
    log.set_up()
    source = _asked(arguments)
    if arguments.link:
        query = "" if source.token is None else f"?{QUERY}={source.token.text}"
        say(f"{source.url}status{query}")
        return 0
    interrupts.run(_show(arguments, source))
    return 0


def find(state: str | None, url: str | None, token: str | None = None) -> AskedGateway:
    """Return where the gateway of a state folder, or of a URL, is asked. Raises `ConfigError`.

    `token`: of the gateway, as the user gave it.
    """
    folder = state_folder(state)
    if token is not None and not (token.isascii() and token.isprintable()):
        raise ConfigError("--token", "expected a text of ASCII characters")
    given = AccessToken(token) if token else None
    holder = holder_of(state)
    if url is not None:
        host = _host_of(url)
        if not host or not url.startswith(("http://", "https://")):
            raise ConfigError("--url", f"expected {URL}, got {url!r}")
        options.host("--url", host, f"the host of {URL}")
        url = url.rstrip("/") + "/"
        if given is None and not is_loopback(host) and (holder is None or holder.web != url):
            raise ConfigError(
                "--url", f"{host} is another computer: expected its token in {access_token.VARIABLE} or --token"
            )
        return AskedGateway(url, given or read_token(folder))
    if holder is None:
        raise ConfigError("--state", f"expected the folder of a running gateway; no gateway holds {folder}")
    if not holder.web:
        raise ConfigError("--state", f"expected a gateway with a web server; {holder.title} names none")
    return AskedGateway(holder.web, given or read_token(folder))


def _host_of(url: str) -> str | None:
    try:
        parts = urlsplit(url)
        return None if parts.port == 0 else parts.hostname
    except ValueError:  # also of a port beyond 65535
        return None


async def fetch(session: aiohttp.ClientSession, source: AskedGateway) -> bytes:
    """Return the record as the gateway sends it. Raises `AnafiMavError`."""
    headers = {} if source.token is None else {"Authorization": f"Bearer {source.token.text}"}
    try:
        # A redirection would take the token to another server.
        async with session.get(source.url + PATH.lstrip("/"), headers=headers, allow_redirects=False) as answer:
            body = await answer.read()
            if answer.status != 200:
                raise AnafiMavError(f"{source.url}: {answer.status} {body.decode(errors='replace').strip()[:200]}")
            return body
    except (aiohttp.ClientError, OSError, asyncio.TimeoutError) as error:
        raise AnafiMavError(f"{source.url} does not answer: {error or 'no answer'}") from error


def decode(body: bytes) -> GatewayStatus:
    """Return the record in an answer. Raises `AnafiMavError` for one of another version."""
    try:
        status = msgspec.json.decode(body, type=GatewayStatus)
    except msgspec.ValidationError as error:
        raise AnafiMavError(f"the gateway's status is not of version {VERSION}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise AnafiMavError(f"the gateway's status is no JSON: {error}") from error
    if status.version != VERSION:
        raise AnafiMavError(f"expected a status of version {VERSION}, the gateway sent {status.version}")
    return status


async def _show(arguments: argparse.Namespace, source: AskedGateway) -> None:
    async with aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=LIMIT)) as session:
        body = await fetch(session, source)
        if arguments.json:
            decode(body)
            say_json(json.loads(body))
            return
        if not is_live():
            for line in head(decode(body)):
                say(line)
            for table in tables(decode(body)):
                say_table(*table)
            return
        with live_tables() as show:
            await follow(session, lambda: _asked(arguments), decode(body), show)


def _asked(arguments: argparse.Namespace) -> AskedGateway:
    """Return the gateway that the arguments name. Raises `ConfigError`."""
    return find(arguments.state, arguments.url, arguments.token or os.environ.get(access_token.VARIABLE))


async def follow(
    session: aiohttp.ClientSession,
    find_source: Callable[[], AskedGateway],
    status: GatewayStatus,
    show: Callable[[Sequence[str], Sequence[TableRows]], None],
) -> NoReturn:
    """Request the status every second and show it, without an end.

    While no answer arrives the last values stay, below a line with their age and the reason. `find_source` is called
    before each request: a gateway that was started again may have another address.
    """
    clock = SystemClock()
    received_at, reason = clock.monotonic(), ""

    def draw() -> None:
        age = clock.monotonic() - received_at
        missed = [f"no answer for {age:.0f} s, the values are of before: {reason}"] if reason else []
        show([*missed, *head(status)], tables(status))

    while True:
        draw()
        await asyncio.sleep(EVERY)
        request = asyncio.ensure_future(_request(session, find_source))
        try:
            while not (await asyncio.wait({request}, timeout=EVERY))[0]:
                reason = reason or "the gateway is slow"
                draw()
            status, received_at, reason = request.result(), clock.monotonic(), ""
        except AnafiMavError as error:
            reason = str(error)
        finally:
            request.cancel()


async def _request(session: aiohttp.ClientSession, find_source: Callable[[], AskedGateway]) -> GatewayStatus:
    """Return the present status. Raises `AnafiMavError`."""
    return decode(await fetch(session, find_source()))


def head(status: GatewayStatus) -> list[str]:
    """Return the lines above the tables."""
    lines = [
        f"anafi-mav {status.program}, process {status.pid}, up {status.uptime_s:.0f} s, "
        f"timers late {_quantiles(status.loop_delay)}"
    ]
    if status.web is not None:
        lines.append(f"page {status.web.url}status")
    return [*lines, *(endpoint.state for endpoint in status.endpoints), *status.problems]


def tables(status: GatewayStatus) -> list[TableRows]:
    """Return drones, clients and refused commands as tables."""
    result = [
        TableRows(
            (
                "drone",
                "id",
                "state",
                "mode",
                "battery",
                "GPS",
                "height",
                "radio",
                "heard",
                "operator",
                "commands",
                "warnings",
            ),
            [_drone(drone) for drone in status.drones],
        ),
        TableRows(
            ("client", "systems", "heard", "out", "in", "dropped"),
            [_client(client) for endpoint in status.endpoints for client in endpoint.clients]
            or [("no client", "", "", "", "", "")],
        ),
    ]
    if refused := list(_refused(status))[:MAX_REFUSED]:
        result.append(TableRows(("ago", "drone", "from", "refused command", "result", "reason"), refused))
    peers = [
        (endpoint.url, reason, str(count))
        for endpoint in status.endpoints
        for reason, count in sorted(endpoint.refused.items())
    ]
    if peers:
        result.append(TableRows(("endpoint", "refused", "count"), peers))
    return result


def _drone(drone: DroneStatus) -> Sequence[str]:
    if not drone.connected:
        return (drone.name, str(drone.sysid), "not connected", *("",) * 8, drone.problem)
    radio = " ".join(
        part for part in (_number(drone.radio_quality, "/5"), _number(drone.radio_dbm, " dBm")) if part != "-"
    )
    return (
        drone.name,
        str(drone.sysid),
        f"{(drone.flying or '').lower().replace('_', ' ')}{', armed' if drone.armed else ''}",
        drone.mode or "",
        _number(drone.battery_percent, " %"),
        ("fix " if drone.gps_fix else "no fix ") + _number(drone.satellites),
        _number(drone.height_m, " m"),
        radio or "-",
        _number(drone.silence_s, " s"),
        _operator(drone),
        _quantiles(drone.commands.latency),
        "; ".join(drone.warnings),
    )


def _operator(drone: DroneStatus) -> str:
    """Return the operator, with the secondaries in parentheses."""
    if not drone.operator:
        return "-"
    beside = ", ".join(map(str, drone.secondaries))
    return f"{drone.operator} ({beside})" if beside else str(drone.operator)


def _client(client: ClientStatus) -> Sequence[str]:
    return (
        client.name,
        " ".join(client.systems),
        _number(client.silence_s, " s"),
        f"{client.sent_rate / 1000.0:.1f} kB/s",
        f"{client.received_rate / 1000.0:.1f} kB/s",
        f"{client.dropped_bytes} B",
    )


def _refused(status: GatewayStatus) -> Iterator[Sequence[str]]:
    refused = [(one, drone.name) for drone in status.drones for one in drone.commands.refused]
    for one, name in sorted(refused, key=lambda pair: pair[0].age_s):
        yield f"{one.age_s:.0f} s", name, one.sender, one.command, one.result, one.reason


def _number(value: float | None, unit: str = "") -> str:
    return "-" if value is None else f"{value:g}{unit}"


def _quantiles(found: Quantiles) -> str:
    if found.p50_ms is None or found.p99_ms is None:
        return "-"
    return f"p50 {found.p50_ms:.0f} p99 {found.p99_ms:.0f} ms"

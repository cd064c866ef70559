"""Endpoint URLs: their grammar and the table of schemes.

Endpoints and the command line's help are made from that table.

    udpout://HOST:PORT      udpin://HOST:PORT      tcpin://HOST:PORT      tcpout://HOST:PORT
    serial://DEVICE:BAUD    each with ?flavour=NAME, one of those that the caller knows
    The two of UDP also with frames=one or frames=many; two options are joined by &.

The names are MAVSDK's. An endpoint listens on the address in its URL and no other: beyond loopback only if that says
so.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import parse_qsl

from anafi_mav.clock import Clock
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.base import Endpoint, EndpointUrl, Sink
from anafi_mav.mavlink.serial_line import SerialLine
from anafi_mav.mavlink.tcp import TcpIn, TcpOut
from anafi_mav.mavlink.udp import UdpIn, UdpOut

FRAMES = ("one", "many")
"""MAVLink frames per UDP datagram."""

MAX_PORT = 65535
MAX_BAUD = 4_000_000
"""Fastest rate of common USB bridges."""


@dataclass(frozen=True)
class Scheme:
    """One kind of endpoint."""

    arguments: str
    """Form of the part after "scheme://"."""
    description: str
    factory: Callable[[EndpointUrl, Sink, Clock], Endpoint]
    listens: bool = False
    """It waits for clients at an address of this machine. Port 0, any free one, makes sense."""
    datagrams: bool = False
    """It sends datagrams, so that `frames` makes sense."""

    def options(self, flavours: Sequence[str]) -> dict[str, Sequence[str]]:
        """Option name → its possible values."""
        return {"flavour": flavours, "frames": FRAMES} if self.datagrams else {"flavour": flavours}


SCHEMES: dict[str, Scheme] = {
    "udpout": Scheme(
        "HOST:PORT", "send to HOST:PORT and hear its answers (QGroundControl, MAVSDK)", UdpOut, datagrams=True
    ),
    "udpin": Scheme(
        "HOST:PORT", "listen on HOST:PORT, answer whoever speaks MAVLink there", UdpIn, listens=True, datagrams=True
    ),
    "tcpin": Scheme("HOST:PORT", "serve TCP clients on HOST:PORT (MAVProxy, Mission Planner)", TcpIn, listens=True),
    "tcpout": Scheme("HOST:PORT", "connect to a TCP server, again and again", TcpOut),
    "serial": Scheme("DEVICE:BAUD", "a serial line, e.g. serial:///dev/ttyUSB0:57600", SerialLine),
}

_URL = re.compile(r"(?P<scheme>[a-z]+)://(?P<rest>[^?#\s]*)(?:\?(?P<query>[^#\s]*))?")
_LABEL = r"[A-Za-z0-9_](?:[A-Za-z0-9_-]{0,62})"
_PLACE = re.compile(
    rf"(?:\[(?P<v6>[0-9A-Fa-f:.]+(?:%\w+)?)\]|(?P<host>{_LABEL}(?:\.{_LABEL})*\.?)):(?P<number>[0-9]{{1,5}})"
)
_LINE = re.compile(r"(?P<device>[^:]+):(?P<number>[0-9]{1,7})")


def parse_endpoint(url: str, flavours: Sequence[str] = ()) -> EndpointUrl:
    """The parts of a URL. Raises `ConfigError`, without a key path, that says what was expected.

    `flavours` are the names of the autopilots that a client can be shown: what they mean is the business of services.
    """
    parts = _URL.fullmatch(url)
    scheme = SCHEMES.get(parts["scheme"]) if parts else None
    if parts is None or scheme is None:
        kinds = ", ".join(f"{name}://" for name in SCHEMES)
        raise ConfigError("", f"{url!r}: expected a URL that begins with one of {kinds}")
    name = parts["scheme"]
    form, known = f"{name}://{scheme.arguments}", scheme.options(flavours)
    if name == "serial":
        place = _LINE.fullmatch(parts["rest"])
        if place is None or not 0 < int(place["number"]) <= MAX_BAUD:
            raise ConfigError("", f"{url!r}: expected {form}, e.g. serial:///dev/ttyUSB0:57600")
        return EndpointUrl(url, name, place["device"], int(place["number"]), **_options(url, known, parts["query"]))
    place = _PLACE.fullmatch(parts["rest"])
    if place is None:
        raise ConfigError("", f"{url!r}: expected {form}, e.g. {name}://127.0.0.1:14550")
    port, lowest = int(place["number"]), 0 if scheme.listens else 1
    if not lowest <= port <= MAX_PORT:
        raise ConfigError("", f"{url!r}: expected a port from {lowest} to {MAX_PORT}")
    return EndpointUrl(url, name, place["v6"] or place["host"], port, **_options(url, known, parts["query"]))


def is_open_to_network(url: EndpointUrl) -> bool:
    """True when other machines can send to this endpoint.

    It listens, and on more than this machine's loopback.
    """
    if not SCHEMES[url.scheme].listens or url.place.rstrip(".").lower() == "localhost":
        return False
    try:
        return not ipaddress.ip_address(url.place.partition("%")[0]).is_loopback
    except ValueError:
        return True


def make_endpoint(url: EndpointUrl, sink: Sink, clock: Clock) -> Endpoint:
    """The endpoint of a parsed URL, not open yet."""
    return SCHEMES[url.scheme].factory(url, sink, clock)


def _options(url: str, known: Mapping[str, Sequence[str]], query: str | None) -> dict[str, str]:
    """The options after "?". Raises `ConfigError` for an unknown, repeated or wrong one."""
    if query is None:
        return {}
    try:
        pairs = parse_qsl(query, strict_parsing=True, keep_blank_values=True)
    except ValueError:
        pairs = []
    options = dict(pairs)
    if not pairs or len(options) != len(pairs) or not options.keys() <= known.keys():
        forms = " and ".join(f"{name}={'|'.join(values)}" for name, values in known.items())
        raise ConfigError("", f"{url!r}: expected no option but ?{forms}, each once")
    for name, value in options.items():
        if value not in known[name]:
            raise ConfigError("", f"{url!r}: expected {name} {' or '.join(known[name])}, got {value!r}")
    return options

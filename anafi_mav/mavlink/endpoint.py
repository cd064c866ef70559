"""Endpoint URLs: their grammar and the table of schemes.

Endpoints and the command line's help are made from that table.

    udpout://HOST:PORT      udpin://HOST:PORT      tcpin://HOST:PORT      tcpout://HOST:PORT
    serial://DEVICE:BAUD    zenoh://HOST:PORT
    each with ?option=value, those of `endpoint_options` that make sense for it
    Several options are joined by &, the elements of a list by commas.

The names are MAVSDK's. An endpoint listens on the address in its URL and no other: beyond loopback only if that says
so.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from urllib.parse import parse_qsl

from anafi_mav.clock import Clock
from anafi_mav.endpoint_options import DEFAULTS, EndpointConfig, EndpointOptions, from_texts
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.access import MESSAGE_IDS
from anafi_mav.mavlink.base import Endpoint, EndpointUrl, Sink
from anafi_mav.mavlink.serial_line import SerialLine
from anafi_mav.mavlink.tcp import TcpIn, TcpOut
from anafi_mav.mavlink.udp import UdpIn, UdpOut

COMMON = (
    *("flavour", "access", "systems", "allow_messages", "block_messages", "bytes_per_second", "signing"),
    *("operator_control", "secondaries"),
)
"""Options of every endpoint."""

OF_DATAGRAMS = ("frames", "datagram_bytes")
"""Options of an endpoint that sends datagrams."""

OF_LISTENERS = ("max_clients", "idle_limit", "allowed_peers")
"""Options of an endpoint that waits for clients."""

OF_FABRIC = ("prefix", "link", "listen", "ca", "certificate", "private_key", "max_clients")
"""Options of an endpoint on a zenoh network."""

ENCRYPTED_LINKS = ("tls", "quic")
"""Values of `link` with TLS."""

MAX_PORT = 65535
MAX_BAUD = 4_000_000
"""Fastest rate of common USB bridges."""


EndpointFactory = Callable[[EndpointUrl, Sink, Clock], Endpoint]


@dataclass(frozen=True)
class Scheme:
    """One kind of endpoint."""

    arguments: str
    """Form of the part after "scheme://"."""
    description: str
    factory: EndpointFactory | None
    """None: the factory is the program's, which knows more than MAVLink."""
    listens: bool = False
    """It waits for clients at an address of this machine. Port 0, any free one, makes sense."""
    datagrams: bool = False
    """It sends datagrams."""
    own: tuple[str, ...] = ()
    """Options of this scheme alone."""

    @property
    def options(self) -> tuple[str, ...]:
        """The names of the options that make sense for it."""
        return (*COMMON, *(OF_DATAGRAMS if self.datagrams else ()), *(OF_LISTENERS if self.listens else ()), *self.own)


SCHEMES: dict[str, Scheme] = {
    "udpout": Scheme(
        "HOST:PORT", "send to HOST:PORT and hear its answers (QGroundControl, MAVSDK)", UdpOut, datagrams=True
    ),
    "udpin": Scheme(
        "HOST:PORT", "listen on HOST:PORT, answer all MAVLink peers there", UdpIn, listens=True, datagrams=True
    ),
    "tcpin": Scheme("HOST:PORT", "serve TCP clients on HOST:PORT (MAVProxy, Mission Planner)", TcpIn, listens=True),
    "tcpout": Scheme("HOST:PORT", "connect to a TCP server, again and again", TcpOut),
    "serial": Scheme("DEVICE:BAUD", "a serial line, e.g. serial:///dev/ttyUSB0:57600", SerialLine),
    "zenoh": Scheme("HOST:PORT", "connect to a zenoh router, for stations anywhere (fabric.md)", None, own=OF_FABRIC),
}

_URL = re.compile(r"(?P<scheme>[a-z]+)://(?P<rest>[^?#\s]*)(?:\?(?P<query>[^#\s]*))?")
_LABEL = r"[A-Za-z0-9_](?:[A-Za-z0-9_-]{0,62})"
_PLACE = re.compile(
    rf"(?:\[(?P<v6>[0-9A-Fa-f:.]+(?:%\w+)?)\]|(?P<host>{_LABEL}(?:\.{_LABEL})*\.?)):(?P<number>[0-9]{{1,5}})"
)
_LINE = re.compile(r"(?P<device>[^:]+):(?P<number>[0-9]{1,7})")


def parse_endpoint(entry: str | EndpointConfig, flavours: Sequence[str] = ()) -> EndpointUrl:
    """Return the parts of a URL, or of a mapping with one.

    Raises `ConfigError` that says what was expected. Its key path is the wrong key of a mapping, and empty for a URL,
    which is in the text. `flavours` are the names of the autopilots that a client can be shown: what they mean is the
    business of services.
    """
    if isinstance(entry, str):
        url = _parse_url(entry)
        try:
            return _checked(url, flavours)
        except ConfigError as error:
            raise _of_url(entry, error) from error
    try:
        url = _parse_url(entry.url)
    except ConfigError as error:
        raise ConfigError("url", error.problem) from error
    if "?" in entry.url:
        raise ConfigError("url", f"{entry.url!r}: expected the options as keys beside url, or all of them in one URL")
    return _checked(replace(url, options=entry.options), flavours)


def _parse_url(url: str) -> EndpointUrl:
    """Return the parts of a URL, with unchecked options."""
    parts = _URL.fullmatch(url)
    scheme = SCHEMES.get(parts["scheme"]) if parts else None
    if parts is None or scheme is None:
        kinds = ", ".join(f"{name}://" for name in SCHEMES)
        raise ConfigError("", f"{url!r}: expected a URL that begins with one of {kinds}")
    name = parts["scheme"]
    form = f"{name}://{scheme.arguments}"
    if name == "serial":
        place = _LINE.fullmatch(parts["rest"])
        if place is None or not 0 < int(place["number"]) <= MAX_BAUD:
            raise ConfigError("", f"{url!r}: expected {form}, e.g. serial:///dev/ttyUSB0:57600")
        return EndpointUrl(url, name, place["device"], int(place["number"]), _options(url, parts["query"]))
    place = _PLACE.fullmatch(parts["rest"])
    if place is None:
        raise ConfigError("", f"{url!r}: expected {form}, e.g. {name}://127.0.0.1:14550")
    port, lowest = int(place["number"]), 0 if scheme.listens else 1
    if not lowest <= port <= MAX_PORT:
        raise ConfigError("", f"{url!r}: expected a port from {lowest} to {MAX_PORT}")
    return EndpointUrl(url, name, place["v6"] or place["host"], port, _options(url, parts["query"]))


def _options(url: str, query: str | None) -> EndpointOptions:
    """Return the options after "?". Raises `ConfigError` for an unknown, repeated or wrong one."""
    if query is None:
        return DEFAULTS
    try:
        # "+" is a sign of file names here, and no space as in the forms of web pages.
        pairs = parse_qsl(query.replace("+", "%2B"), strict_parsing=True, keep_blank_values=True)
    except ValueError:
        pairs = []
    if not pairs or len(dict(pairs)) != len(pairs):
        raise ConfigError("", f"{url!r}: expected options like ?flavour=px4&access=observe, each once")
    try:
        return from_texts(dict(pairs))
    except ConfigError as error:
        raise _of_url(url, error) from error


def _of_url(url: str, error: ConfigError) -> ConfigError:
    return ConfigError("", f"{url!r}: {error.key_path}: {error.problem}")


def _checked(url: EndpointUrl, flavours: Sequence[str]) -> EndpointUrl:
    """Return the URL if its options fit it.

    Raises `ConfigError` with the option's name as key path.
    """
    options, scheme = url.options, SCHEMES[url.scheme]
    for name in options.changed():
        if name not in scheme.options:
            known = ", ".join(scheme.options)
            raise ConfigError(name, f"expected none for {url.scheme}://, whose options are {known}")
    if options.flavour is not None and options.flavour not in flavours:
        *most, last = flavours or ("",)
        wanted = f"{', '.join(most)} or {last}" if most else last
        raise ConfigError("flavour", f"expected {wanted}, got {options.flavour!r}")
    for name in ("allow_messages", "block_messages"):
        for message in getattr(options, name):
            if message not in MESSAGE_IDS:
                raise ConfigError(name, f"expected the name of a message like ATTITUDE, got {message!r}")
    options.system_ids, options.secondary_ids, options.networks  # noqa: B018  # raise for what patterns let through
    if options.secondaries and not options.operator_control:
        raise ConfigError("secondaries", "expected it together with operator_control true")
    if options.operator_control and options.access == "observe":
        raise ConfigError("operator_control", "expected false with access observe, whose clients control nothing")
    if options.link not in ENCRYPTED_LINKS and (options.ca or options.certificate or options.private_key):
        raise ConfigError("link", f"expected tls or quic together with certificates, got {options.link}")
    if (options.certificate is None) != (options.private_key is None):
        raise ConfigError("certificate", "expected it together with private_key")
    if options.datagram_bytes != DEFAULTS.datagram_bytes and options.frames == "one":
        raise ConfigError("datagram_bytes", "expected it together with frames many")
    return url


def is_open_to_network(url: EndpointUrl) -> bool:
    """True when other machines can send to this endpoint.

    It listens, and on more than this machine's loopback.
    """
    return SCHEMES[url.scheme].listens and not url.is_loopback


def is_readable_on_the_way(url: EndpointUrl) -> bool:
    """True for a zenoh endpoint that crosses a network without TLS."""
    return url.scheme == "zenoh" and not url.is_loopback_address and url.options.link not in ENCRYPTED_LINKS


def make_endpoint(
    url: EndpointUrl, sink: Sink, clock: Clock, factories: Mapping[str, EndpointFactory] | None = None
) -> Endpoint:
    """Return the endpoint of a parsed URL, not open yet.

    Raises `ConfigError` for a scheme that neither this table nor `factories` makes.
    """
    factory = SCHEMES[url.scheme].factory or (factories or {}).get(url.scheme)
    if factory is None:
        raise ConfigError("", f"{url.text}: expected another scheme: {url.scheme}:// is for run, and --zenoh of ground")
    return factory(url, sink, clock)

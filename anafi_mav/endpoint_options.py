"""Options of a MAVLink endpoint, as data. No I/O.

One record for both forms: the keys of an endpoint in the configuration file, and what follows "?" in a URL, where a
list is joined by commas. `config` reads the first form, `mavlink.endpoint` the second; a channel has the record as
`Channel.options`. A new option is one field here.
"""

from __future__ import annotations

import difflib
import functools
import ipaddress
from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_type_hints

import msgspec
from msgspec import Meta

from anafi_mav.documents import expected
from anafi_mav.errors import ConfigError

CLIENTS = 32
"""Clients of one listening endpoint by default. Each costs a frame per message; a field has a handful."""

MAX_CLIENTS = 250
"""Most clients that can be configured: as many as a network has systems."""

MIN_BUDGET = 100
"""bytes/s. The heartbeats of a drone, 42 bytes/s, and an answer beside them."""

MIN_DATAGRAM, DATAGRAM, MAX_DATAGRAM = 280, 512, 1400
"""Bytes of frames in a datagram. The longest frame has 280. Receivers have buffers of 512 (gomavlib
pkg/frame/reader.go), 1120 (mavlink-router endpoint.cpp) or 2048 (MAVSDK udp_connection.hpp); a smaller one loses the
rest. 1400 pass an Ethernet network, a tunnel and a mobile network in one packet."""

MAX_LIST = 256
"""Elements of a list: as many as there are system ids."""

MAX_SYSTEM = 255

MAX_KEY_NAME = 64
"""Characters of the name of a signing key, which is the name of a file."""

KEY_NAME = rf"\A[A-Za-z0-9][A-Za-z0-9_.-]{{0,{MAX_KEY_NAME - 1}}}\Z"

PREFIX = r"\A[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*\Z"
"""Parts of a zenoh key, without zenoh's own signs."""

MAX_FILE = 400
"""Characters of a path."""

MAX_URL = 1000
"""Characters of a URL with its options."""


SystemIds = Annotated[
    Annotated[int, Meta(ge=1, le=MAX_SYSTEM)] | Annotated[str, Meta(pattern=r"\A\d{1,3}(-\d{1,3})?\Z")],
    Meta(extra=expected("a system id from 1 to 255, or a range like 1-9")),
]


class EndpointOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The options of one endpoint."""

    flavour: Annotated[
        Annotated[str, Meta(max_length=32)] | None,
        Meta(
            description="The autopilot that the endpoint shows its clients. Default: px4.",
            extra=expected("px4, ardupilot or standard"),
        ),
    ] = None
    access: Annotated[
        Literal["observe", "control", "all"],
        Meta(
            description="What its clients may do: read only, also fly and use the payload, or everything "
            "([below](#access)).",
            extra=expected("observe, control or all"),
        ),
    ] = "all"
    systems: Annotated[
        tuple[SystemIds, ...],
        Meta(
            max_length=MAX_LIST,
            description="The systems that this endpoint shows and that its clients reach; frames from and to others "
            "do not pass. Empty: all.",
            extra=expected("a list of system ids and ranges, like [1, 3, 7-9]"),
        ),
    ] = ()
    allow_messages: Annotated[
        tuple[Annotated[str, Meta(max_length=64, extra=expected("the name of a message"))], ...],
        Meta(
            max_length=MAX_LIST,
            description="The only messages that are streamed to its clients, beside HEARTBEAT. Answers are not "
            "filtered. Empty: all.",
            extra=expected("a list of message names like [ATTITUDE, SYS_STATUS]"),
        ),
    ] = ()
    block_messages: Annotated[
        tuple[Annotated[str, Meta(max_length=64, extra=expected("the name of a message"))], ...],
        Meta(
            max_length=MAX_LIST,
            description="Messages that are not streamed to its clients.",
            extra=expected("a list of message names like [ATTITUDE, SYS_STATUS]"),
        ),
    ] = ()
    bytes_per_second: Annotated[
        Annotated[int, Meta(ge=MIN_BUDGET, le=10**9)] | None,
        Meta(
            description="Byte budget of each client: streams are slowed down until they fit. Default: none, and "
            "on a serial line what the line carries ([below](#byte-budget)).",
            extra=expected(f"a whole number of bytes/s from {MIN_BUDGET}"),
        ),
    ] = None
    frames: Annotated[
        Literal["one", "many"],
        Meta(
            description="MAVLink frames in one datagram. `udpin` and `udpout` only.",
            extra=expected("one or many"),
        ),
    ] = "one"
    datagram_bytes: Annotated[
        int,
        Meta(
            ge=MIN_DATAGRAM,
            le=MAX_DATAGRAM,
            description="Most bytes in a datagram of `frames: many`. `udpin` and `udpout` only.",
            extra=expected(f"a whole number of bytes from {MIN_DATAGRAM} to {MAX_DATAGRAM}"),
        ),
    ] = DATAGRAM
    max_clients: Annotated[
        int,
        Meta(
            ge=1,
            le=MAX_CLIENTS,
            description="Most clients at a time. When all places are taken, a new client replaces the one that has "
            "been silent for longest, if that is at least 5 s. Clients without [proof](#forged-addresses) or key have "
            "as many places of their own. `udpin`, `tcpin` and `zenoh` only.",
            extra=expected(f"a whole number from 1 to {MAX_CLIENTS}"),
        ),
    ] = CLIENTS
    idle_limit: Annotated[
        Annotated[float, Meta(ge=0, le=86400)] | None,
        Meta(
            description="Seconds without a frame after which a client is dropped; 0: never. Default: 30 for `udpin`, "
            "600 for `tcpin`. `udpin` and `tcpin` only.",
            extra=expected("a number of seconds from 0 to 86400"),
        ),
    ] = None
    allowed_peers: Annotated[
        tuple[Annotated[str, Meta(max_length=64, extra=expected("an IP address or a network"))], ...],
        Meta(
            max_length=MAX_LIST,
            description="The addresses that may connect. Empty: all. `udpin` and `tcpin` only.",
            extra=expected("a list of IP addresses and networks like [192.168.1.20, 10.8.0.0/24]"),
        ),
    ] = ()

    signing: Annotated[
        Annotated[str, Meta(pattern=KEY_NAME)] | None,
        Meta(
            description="Name of the MAVLink 2 signing key, which `anafi-mav keygen NAME` makes. Only frames with its "
            "signature are accepted, and every frame that is sent is signed ([security](security.md)). Default: no "
            "signatures, unless a client of a loopback endpoint has set a key by SETUP_SIGNING.",
            extra=expected("the name of a key: 1 to 64 letters, digits, '-', '_' or '.'"),
        ),
    ] = None

    prefix: Annotated[
        str,
        Meta(
            max_length=64,
            pattern=PREFIX,
            description="First part of the keys on the zenoh network. Gateways and stations with the same one see each "
            "other. `zenoh` only.",
            extra=expected("letters, digits, '-', '_' and '.', with '/' between parts"),
        ),
    ] = "anafi"
    link: Annotated[
        Literal["tcp", "udp", "tls", "quic"],
        Meta(
            description="Transport of the link to the zenoh router. `tls` and `quic` encrypt. `udp` repeats nothing "
            "that is lost: stations and drones may be seen seconds late, so use it on a wire only. `zenoh` only.",
            extra=expected("tcp, udp, tls or quic"),
        ),
    ] = "tcp"
    listen: Annotated[
        bool,
        Meta(
            description="Listen at the address instead of connecting to it: for one gateway without a router. "
            "`zenoh` only.",
            extra=expected("true or false"),
        ),
    ] = False
    ca: Annotated[
        Annotated[str, Meta(min_length=1, max_length=MAX_FILE)] | None,
        Meta(
            description="File with the certificate of the authority that signed the other end's (PEM). `zenoh` with "
            "`tls` or `quic` only.",
            extra=expected("the path of a file"),
        ),
    ] = None
    certificate: Annotated[
        Annotated[str, Meta(min_length=1, max_length=MAX_FILE)] | None,
        Meta(
            description="File with the gateway's own certificate (PEM): by its name a router grants keys. `zenoh` "
            "with `tls` or `quic` only.",
            extra=expected("the path of a file"),
        ),
    ] = None
    private_key: Annotated[
        Annotated[str, Meta(min_length=1, max_length=MAX_FILE)] | None,
        Meta(
            description="File with the private key of that certificate (PEM). `zenoh` with `tls` or `quic` only.",
            extra=expected("the path of a file"),
        ),
    ] = None
    operator_control: Annotated[
        bool,
        Meta(
            description="Its clients may request to be the operator of a drone, and receive CONTROL_STATUS "
            "([operator control](security.md#operator-control)).",
            extra=expected("true or false"),
        ),
    ] = False
    secondaries: Annotated[
        tuple[SystemIds, ...],
        Meta(
            max_length=MAX_LIST,
            description="The ids of clients that may command beside an operator. Only together with "
            "`operator_control`.",
            extra=expected("a list of system ids and ranges, like [251, 253-254]"),
        ),
    ] = ()

    @property
    def system_ids(self) -> frozenset[int] | None:
        """The ids in `systems`; None: all. Raises `ConfigError` with the key's name."""
        return _system_ids("systems", self.systems) if self.systems else None

    @property
    def secondary_ids(self) -> frozenset[int]:
        """The ids in `secondaries`. Raises `ConfigError` with the key's name."""
        return _system_ids("secondaries", self.secondaries)

    @property
    def networks(self) -> tuple[Network, ...] | None:
        """The networks of `allowed_peers`; None: all. Raises `ConfigError` with the key's name."""
        return _networks(self.allowed_peers) if self.allowed_peers else None

    def changed(self) -> list[str]:
        """Return the names of the options that differ from their defaults."""
        return [name for name in OPTIONS if getattr(self, name) != getattr(DEFAULTS, name)]


class EndpointConfig(EndpointOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An endpoint as a mapping. Each key but `url` may also stand in a URL as `?key=value`."""

    url: Annotated[
        str,
        Meta(
            min_length=1,
            max_length=MAX_URL,
            description="The URL without options.",
            extra=expected("a URL like udpin://0.0.0.0:14550"),
        ),
    ]

    @property
    def options(self) -> EndpointOptions:
        """The options alone."""
        return EndpointOptions(**{name: getattr(self, name) for name in OPTIONS})


Network = ipaddress.IPv4Network | ipaddress.IPv6Network

DEFAULTS = EndpointOptions()

_TYPES: dict[str, Any] = get_type_hints(EndpointOptions, include_extras=True)

OPTIONS: tuple[str, ...] = EndpointOptions.__struct_fields__
"""The names of all options, in the order of the manual."""


def expectation(name: str) -> str:
    """Return what a value of this option must be, as it reads after the word "expected"."""
    info = msgspec.inspect.type_info(EndpointOptions)
    assert isinstance(info, msgspec.inspect.StructType)
    kind = next(field.type for field in info.fields if field.name == name)
    assert isinstance(kind, msgspec.inspect.Metadata)
    assert kind.extra is not None
    return str(kind.extra["expected"])


def unknown(name: str, known: tuple[str, ...] = OPTIONS) -> str:
    """Return the problem with an option that does not exist."""
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(known)}"
    return f"unknown option; {hint}"


def from_texts(values: Mapping[str, str]) -> EndpointOptions:
    """Return the options of a URL. Raises `ConfigError` with the option's name as key path."""
    options: dict[str, Any] = {}
    for name, text in values.items():
        if name not in OPTIONS:
            raise ConfigError(name, unknown(name))
        is_list = isinstance(getattr(DEFAULTS, name), tuple)
        try:
            options[name] = msgspec.convert(text.split(",") if is_list else text, _TYPES[name], strict=False)
        except msgspec.ValidationError as error:
            raise ConfigError(name, f"expected {expectation(name)}, got {text!r}") from error
    return EndpointOptions(**options)


@functools.lru_cache(maxsize=64)
def _system_ids(name: str, systems: tuple[int | str, ...]) -> frozenset[int]:
    ids: set[int] = set()
    for entry in systems:
        first, _, last = str(entry).partition("-")
        low, high = int(first), int(last or first)
        if not 1 <= low <= high <= MAX_SYSTEM:
            raise ConfigError(name, f"expected a system id from 1 to 255, or a range like 1-9, got {entry!r}")
        ids.update(range(low, high + 1))
    return frozenset(ids)


MAPPED_PREFIX = 96
"""Bits before the IPv4 address in an IPv6 one that stands for it."""


@functools.lru_cache(maxsize=64)
def _networks(peers: tuple[str, ...]) -> tuple[Network, ...]:
    found = []
    for text in peers:
        try:
            found.append(_as_ipv4(ipaddress.ip_network(text)))
        except ValueError as error:
            raise ConfigError("allowed_peers", f"expected an IP address or a network, got {text!r}: {error}") from error
    return tuple(found)


def _as_ipv4(network: Network) -> Network:
    """Return the IPv4 network that an IPv6 one stands for, or the same network.

    ::ffff:a.b.c.d stands for a.b.c.d (RFC 4291 §2.5.5.2).
    """
    mapped = network.network_address.ipv4_mapped if isinstance(network, ipaddress.IPv6Network) else None
    if mapped is None or network.prefixlen < MAPPED_PREFIX:
        return network
    return ipaddress.IPv4Network((mapped, network.prefixlen - MAPPED_PREFIX))

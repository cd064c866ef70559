"""The grammar of endpoint URLs."""

from __future__ import annotations

import re

import msgspec
import pytest
from msgspec.structs import replace

from anafi_mav.clock import SystemClock
from anafi_mav.endpoint_options import OPTIONS, EndpointConfig, EndpointOptions
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.base import EndpointUrl
from anafi_mav.mavlink.endpoint import SCHEMES, is_open_to_network, make_endpoint, parse_endpoint
from anafi_mav.mavlink.node import Node

FLAVOURS = ("px4", "ardupilot", "standard")


@pytest.mark.parametrize(
    ("url", "scheme", "place", "number", "flavour"),
    [
        ("udpout://127.0.0.1:14550", "udpout", "127.0.0.1", 14550, None),
        ("udpin://0.0.0.0:14550", "udpin", "0.0.0.0", 14550, None),
        ("udpin://127.0.0.1:0", "udpin", "127.0.0.1", 0, None),
        ("udpin://[::1]:14550", "udpin", "::1", 14550, None),
        ("tcpin://[fe80::1%eth0]:5760", "tcpin", "fe80::1%eth0", 5760, None),
        ("tcpin://127.0.0.1:5760?flavour=px4", "tcpin", "127.0.0.1", 5760, "px4"),
        ("tcpout://relay.example.org:65535", "tcpout", "relay.example.org", 65535, None),
        ("udpout://ground-station.local.:1", "udpout", "ground-station.local.", 1, None),
        ("serial:///dev/ttyUSB0:57600", "serial", "/dev/ttyUSB0", 57600, None),
        ("serial:///dev/serial/by-id/usb-1:921600?flavour=px4", "serial", "/dev/serial/by-id/usb-1", 921600, "px4"),
        ("serial://COM3:115200", "serial", "COM3", 115200, None),
    ],
)
def test_good_urls(url: str, scheme: str, place: str, number: int, flavour: str | None) -> None:
    assert parse_endpoint(url, FLAVOURS) == EndpointUrl(url, scheme, place, number, EndpointOptions(flavour=flavour))


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("", "begins with one of udpout://, udpin://, tcpin://, tcpout://, serial://"),
        ("127.0.0.1:14550", "begins with one of"),
        ("udp://127.0.0.1:14550", "begins with one of"),
        ("UDPOUT://127.0.0.1:14550", "begins with one of"),
        ("udpout://127.0.0.1:14550#x", "begins with one of"),
        (" udpout://127.0.0.1:14550", "begins with one of"),
        ("udpout://127.0.0.1", "expected udpout://HOST:PORT"),
        ("udpin://:14550", "expected udpin://HOST:PORT"),
        ("tcpin://*:5760", "expected tcpin://HOST:PORT"),
        ("tcpin://a..b:5760", "expected tcpin://HOST:PORT"),
        ("tcpin://::1:5760", "expected tcpin://HOST:PORT"),
        ("tcpin://me@127.0.0.1:5760", "expected tcpin://HOST:PORT"),
        ("tcpin://127.0.0.1:5760/", "expected tcpin://HOST:PORT"),
        ("tcpin://127.0.0.1:port", "expected tcpin://HOST:PORT"),
        (f"tcpin://{'a' * 64}:1", "expected tcpin://HOST:PORT"),
        ("tcpin://127.0.0.1:65536", "a port from 0 to 65535"),
        ("udpout://127.0.0.1:0", "a port from 1 to 65535"),
        ("serial:///dev/ttyUSB0", "expected serial://DEVICE:BAUD"),
        ("serial:///dev/ttyUSB0:0", "expected serial://DEVICE:BAUD"),
        ("serial:///dev/ttyUSB0:9999999", "expected serial://DEVICE:BAUD"),
        ("serial://loop://:57600", "expected serial://DEVICE:BAUD"),
        ("serial://:57600", "expected serial://DEVICE:BAUD"),
        (
            "tcpin://127.0.0.1:5760?flavour=betaflight",
            "flavour: expected px4, ardupilot or standard, got 'betaflight'",
        ),
        ("tcpin://127.0.0.1:5760?flavour=", "flavour: expected px4, ardupilot or standard, got ''"),
        ("tcpin://127.0.0.1:5760?flavor=px4", "flavor: unknown option; did you mean flavour?"),
        (
            "tcpin://127.0.0.1:5760?flavour=px4&flavour=px4",
            "expected options like ?flavour=px4&access=observe, each once",
        ),
        ("tcpin://127.0.0.1:5760?", "expected options like"),
        ("tcpin://127.0.0.1:5760?px4", "expected options like"),
        ("tcpin://127.0.0.1:5760?frames=many", "frames: expected none for tcpin://, whose options are flavour"),
        ("serial:///dev/ttyUSB0:57600?frames=many", "frames: expected none for serial://"),
        ("udpin://127.0.0.1:1?frames=2", "frames: expected one or many, got '2'"),
        ("udpin://127.0.0.1:1?frames=", "frames: expected one or many, got ''"),
        ("udpout://127.0.0.1:1?frames=many&frames=one", "each once"),
        ("udpout://127.0.0.1:1?flavour=px4&x=many", "x: unknown option; expected one of flavour, access, systems"),
        ("udpout://127.0.0.1:1?max_clients=3", "max_clients: expected none for udpout://"),
        ("udpout://127.0.0.1:1?allowed_peers=10.0.0.1", "allowed_peers: expected none for udpout://"),
        ("udpout://127.0.0.1:1?access=fly", "access: expected observe, control or all, got 'fly'"),
        ("udpout://127.0.0.1:1?systems=0", "systems: expected a system id from 1 to 255, or a range like 1-9, got '0'"),
        ("udpout://127.0.0.1:1?systems=1,9-7", "a range like 1-9, got '9-7'"),
        ("udpout://127.0.0.1:1?systems=1,", "systems: expected a list of system ids and ranges"),
        ("udpout://127.0.0.1:1?allow_messages=ATTITUDES", "expected the name of a message like ATTITUDE"),
        ("udpout://127.0.0.1:1?block_messages=30", "expected the name of a message like ATTITUDE, got '30'"),
        ("udpout://127.0.0.1:1?frames=many&datagram_bytes=1401", "expected a whole number of bytes from 280 to 1400"),
        ("udpout://127.0.0.1:1?datagram_bytes=1400", "datagram_bytes: expected it together with frames many"),
        ("udpin://127.0.0.1:1?max_clients=0", "max_clients: expected a whole number from 1 to 250, got '0'"),
        ("udpin://127.0.0.1:1?idle_limit=-1", "idle_limit: expected a number of seconds from 0 to 86400"),
        ("udpin://127.0.0.1:1?allowed_peers=10.0.0.1/8", "expected an IP address or a network, got '10.0.0.1/8'"),
        ("udpin://127.0.0.1:1?allowed_peers=gcs.local", "expected an IP address or a network, got 'gcs.local'"),
    ],
)
def test_bad_urls(url: str, expected: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_endpoint(url, FLAVOURS)
    assert caught.value.key_path == ""
    assert expected in caught.value.problem
    assert repr(url) in caught.value.problem


@pytest.mark.parametrize(
    ("query", "flavour", "frames"),
    [
        ("", None, "one"),
        ("?frames=one", None, "one"),
        ("?frames=many", None, "many"),
        ("?flavour=ardupilot&frames=many", "ardupilot", "many"),
        ("?frames=many&flavour=px4", "px4", "many"),
    ],
)
@pytest.mark.parametrize("scheme", ["udpin", "udpout"])
def test_udp_url_with_options_keeps_each(scheme: str, query: str, flavour: str | None, frames: str) -> None:
    url = parse_endpoint(f"{scheme}://127.0.0.1:14550{query}", FLAVOURS)
    assert (url.options.flavour, url.options.frames) == (flavour, frames)


def test_mapping_and_url_give_the_same_options() -> None:
    options = {
        "flavour": "ardupilot",
        "access": "control",
        "systems": [1, "7-9"],
        "allow_messages": ["ATTITUDE", "SYS_STATUS"],
        "frames": "many",
        "datagram_bytes": 1400,
        "max_clients": 3,
        "idle_limit": 0.5,
        "allowed_peers": ["10.8.0.0/24", "::1"],
        "operator_control": True,
        "secondaries": ["250-252", 254],
    }
    query = "&".join(
        f"{name}={','.join(map(str, value)) if isinstance(value, list) else value}" for name, value in options.items()
    )
    mapping = msgspec.convert({"url": "udpin://0.0.0.0:14550", **options}, EndpointConfig)
    by_key = parse_endpoint(mapping, FLAVOURS)
    by_url = parse_endpoint(f"udpin://0.0.0.0:14550?{query}", FLAVOURS)
    assert by_key.options.system_ids == by_url.options.system_ids == {1, 7, 8, 9}
    assert by_key.options.secondary_ids == by_url.options.secondary_ids == {250, 251, 252, 254}
    lists = {"systems": by_key.options.systems, "secondaries": by_key.options.secondaries}
    assert replace(by_url.options, **lists) == by_key.options
    assert by_key.options.changed() == list(options)
    assert str(by_key.options.networks[0] if by_key.options.networks else None) == "10.8.0.0/24"


@pytest.mark.parametrize(
    ("peers", "networks"),
    [
        ("::ffff:10.0.0.1", ["10.0.0.1/32"]),
        ("::ffff:10.9.0.0/112,::1", ["10.9.0.0/16", "::1/128"]),
        ("::ffff:0:0/96", ["0.0.0.0/0"]),
        ("::/0", ["::/0"]),
    ],
)
def test_ipv4_peers_in_the_form_of_ipv6_are_ipv4_peers(peers: str, networks: list[str]) -> None:
    """A socket of both families names them so; their addresses are compared as IPv4."""
    options = parse_endpoint(f"udpin://[::]:14550?allowed_peers={peers}", FLAVOURS).options
    assert [str(network) for network in options.networks or ()] == networks


@pytest.mark.parametrize(
    ("mapping", "key", "problem"),
    [
        ({"url": "udpin:0.0.0.0:1"}, "url", "expected a URL that begins with one of"),
        ({"url": "udpin://0.0.0.0:1?access=all"}, "url", "expected the options as keys beside url"),
        ({"url": "udpin://0.0.0.0:1", "flavour": "x"}, "flavour", "expected px4, ardupilot or standard, got 'x'"),
        ({"url": "tcpin://0.0.0.0:1", "frames": "many"}, "frames", "expected none for tcpin://"),
        ({"url": "tcpin://0.0.0.0:1", "secondaries": [7]}, "secondaries", "together with operator_control true"),
        ({"url": "serial:///x:9", "operator_control": True, "access": "observe"}, "operator_control", "expected false"),
        ({"url": "udpin://0.0.0.0:1", "operator_control": True, "secondaries": ["9-7"]}, "secondaries", "a range like"),
    ],
)
async def test_error_in_a_mapping_names_its_key(mapping: dict[str, object], key: str, problem: str) -> None:
    entry = msgspec.convert(mapping, EndpointConfig)
    with pytest.raises(ConfigError) as caught:
        parse_endpoint(entry, FLAVOURS)
    assert caught.value.key_path == key
    assert problem in caught.value.problem
    with pytest.raises(ConfigError) as caught:
        await Node(flavours=FLAVOURS).start(["udpout://127.0.0.1:9", entry])
    assert caught.value.key_path == f"endpoints[1].{key}"


def test_every_option_belongs_to_a_scheme() -> None:
    assert {name for scheme in SCHEMES.values() for name in scheme.options} == set(OPTIONS)


OWN = {name: scheme for name, scheme in SCHEMES.items() if scheme.factory is not None}
"""The schemes whose endpoints this room makes."""


def test_scheme_makes_its_endpoint_with_a_description() -> None:
    assert set(SCHEMES) - set(OWN) == {"zenoh"}
    for name, scheme in OWN.items():
        url = parse_endpoint(f"{name}://{'/dev/null:57600' if name == 'serial' else '127.0.0.1:1'}")
        endpoint = make_endpoint(url, Node(), SystemClock())
        assert endpoint.describe().startswith(url.text)
        assert endpoint.local_port is None
        assert scheme.arguments
        assert scheme.description


@pytest.mark.parametrize(
    ("url", "name"),
    [
        ("udpout://127.0.0.1:14550", "udpout-127.0.0.1-14550"),
        ("udpin://[::1]:14550?flavour=px4", "udpin--1-14550"),
        ("tcpin://0.0.0.0:5760?signing=field", "field"),
        ("serial:///dev/ttyUSB0:57600", "serial--dev-ttyUSB0-57600"),
        (
            "serial:///dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0:57600",
            "serial--dev-serial-by-id-usb-FTDI_FT232R_USB_UART_A5028-",
        ),
    ],
)
def test_key_of_an_endpoint_is_named_by_option_or_url(url: str, name: str) -> None:
    found = parse_endpoint(url, FLAVOURS).key_name
    assert re.fullmatch(re.escape(name) + "[0-9a-f]{8}" if name.endswith("-") else re.escape(name), found)
    assert len(found) <= 64


async def test_closing_an_unopened_endpoint_does_nothing() -> None:
    for name in OWN:
        url = parse_endpoint(f"{name}://{'/dev/null:57600' if name == 'serial' else '127.0.0.1:1'}")
        await make_endpoint(url, Node(), SystemClock()).close()


@pytest.mark.parametrize(
    ("url", "is_open"),
    [
        ("tcpin://127.0.0.1:5760", False),
        ("udpin://127.9.9.9:14550?flavour=ardupilot", False),
        ("udpin://[::1]:14550", False),
        ("tcpin://localhost:5760", False),
        ("udpout://192.168.1.20:14550", False),  # hears that address only
        ("tcpout://192.168.1.20:5760", False),
        ("serial:///dev/ttyUSB0:57600", False),
        ("udpin://0.0.0.0:14550", True),
        ("tcpin://192.168.1.7:5760", True),
        ("tcpin://[::]:5760", True),
        ("tcpin://[fe80::1%eth0]:5760", True),
        ("tcpin://gateway.local:5760", True),
    ],
)
def test_endpoint_beyond_loopback_is_open_to_the_network(url: str, is_open: bool) -> None:
    assert is_open_to_network(parse_endpoint(url, FLAVOURS)) is is_open


@pytest.mark.parametrize(
    "url", ["tcpin://127.0.0.1:0?flavour=ardupilot", "udpin://127.0.0.1:0", "tcpin://127.0.0.1:00"]
)
async def test_endpoint_with_port_0_shows_its_real_port(url: str) -> None:
    node = Node(clock=SystemClock(), flavours=FLAVOURS)
    await node.start([url])
    (endpoint,) = node.endpoints
    port = endpoint.local_port
    assert port
    scheme, _, query = url.partition("?")
    shown = f"{scheme.rpartition(':')[0]}:{port}" + (f"?{query}" if query else "")
    assert endpoint.describe().startswith(f"{shown}: 0 ")
    assert endpoint.url == url
    await node.close()

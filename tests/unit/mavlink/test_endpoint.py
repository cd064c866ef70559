"""The grammar of endpoint URLs."""

from __future__ import annotations

import pytest

from anafi_mav.clock import SystemClock
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
    assert parse_endpoint(url, FLAVOURS) == EndpointUrl(url, scheme, place, number, flavour)


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
            "expected flavour px4 or ardupilot or standard, got",
        ),
        ("tcpin://127.0.0.1:5760?flavour=", "expected flavour px4 or ardupilot or standard, got ''"),
        ("tcpin://127.0.0.1:5760?flavor=px4", "no option but ?flavour=px4|ardupilot|standard"),
        ("tcpin://127.0.0.1:5760?flavour=px4&flavour=px4", "no option but"),
        ("tcpin://127.0.0.1:5760?", "no option but"),
        ("tcpin://127.0.0.1:5760?px4", "no option but"),
        ("tcpin://127.0.0.1:5760?frames=many", "no option but ?flavour=px4|ardupilot|standard, each once"),
        ("serial:///dev/ttyUSB0:57600?frames=one", "no option but ?flavour=px4|ardupilot|standard, each once"),
        ("udpin://127.0.0.1:1?frames=2", "expected frames one or many, got '2'"),
        ("udpin://127.0.0.1:1?frames=", "expected frames one or many, got ''"),
        ("udpout://127.0.0.1:1?frames=many&frames=one", "frames=one|many, each once"),
        ("udpout://127.0.0.1:1?flavour=px4&datagrams=many", "and frames=one|many, each once"),
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
    assert (url.flavour, url.frames) == (flavour, frames)


def test_scheme_makes_its_endpoint_with_a_description() -> None:
    for name, scheme in SCHEMES.items():
        url = parse_endpoint(f"{name}://{'/dev/null:57600' if name == 'serial' else '127.0.0.1:1'}")
        endpoint = make_endpoint(url, Node(), SystemClock())
        assert endpoint.describe().startswith(url.text)
        assert endpoint.local_port is None
        assert scheme.arguments
        assert scheme.description


async def test_closing_an_unopened_endpoint_does_nothing() -> None:
    for name in SCHEMES:
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

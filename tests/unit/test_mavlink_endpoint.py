"""The grammar of endpoint URLs."""

from __future__ import annotations

import pytest

from anafi_mav.clock import SystemClock
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.base import EndpointUrl
from anafi_mav.mavlink.endpoint import SCHEMES, make_endpoint, parse_endpoint
from anafi_mav.mavlink.node import Node


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
    assert parse_endpoint(url) == EndpointUrl(url, scheme, place, number, flavour)


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
        parse_endpoint(url)
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
    url = parse_endpoint(f"{scheme}://127.0.0.1:14550{query}")
    assert (url.flavour, url.frames) == (flavour, frames)


def test_every_scheme_makes_its_endpoint_and_says_what_it_is() -> None:
    for name, scheme in SCHEMES.items():
        url = parse_endpoint(f"{name}://{'/dev/null:57600' if name == 'serial' else '127.0.0.1:1'}")
        endpoint = make_endpoint(url, Node(), SystemClock())
        assert endpoint.describe().startswith(url.text)
        assert endpoint.local_port is None
        assert scheme.arguments
        assert scheme.description


async def test_closing_what_was_never_opened_does_no_harm() -> None:
    for name in SCHEMES:
        url = parse_endpoint(f"{name}://{'/dev/null:57600' if name == 'serial' else '127.0.0.1:1'}")
        await make_endpoint(url, Node(), SystemClock()).close()

"""Hosts in the URIs of streams."""

from __future__ import annotations

import pytest

from anafi_mav.relay.uri_host import is_loopback, uri_host


@pytest.mark.parametrize(
    ("bound", "local_host", "public_host", "host"),
    [
        ("127.0.0.1", "127.0.0.1", None, "127.0.0.1"),
        ("127.0.0.1", "127.9.8.7", None, "127.0.0.1"),
        ("localhost", "127.0.0.1", None, "localhost"),
        ("127.0.0.1", "192.168.1.2", None, None),
        ("127.0.0.1", None, None, None),
        ("0.0.0.0", "192.168.1.2", None, "192.168.1.2"),
        ("0.0.0.0", "127.0.0.1", None, "127.0.0.1"),
        ("0.0.0.0", None, None, None),
        ("192.168.1.2", "127.0.0.1", None, "192.168.1.2"),
        ("192.168.1.2", None, None, "192.168.1.2"),
        # What is configured decides, also for a MAVLink router on this computer.
        ("0.0.0.0", "127.0.0.1", "gateway.example", "gateway.example"),
        ("0.0.0.0", None, "10.0.0.7", "10.0.0.7"),
        ("127.0.0.1", "192.168.1.2", "10.0.0.7", "10.0.0.7"),
    ],
)
def test_host_of_a_uri(bound: str, local_host: str | None, public_host: str | None, host: str | None) -> None:
    assert uri_host(bound, local_host, public_host) == host


def test_loopback_is_known_by_address_and_name() -> None:
    assert [host for host in ("127.9.9.9", "::1", "LocalHost", "gateway", "10.0.0.1") if is_loopback(host)] == [
        "127.9.9.9",
        "::1",
        "LocalHost",
    ]

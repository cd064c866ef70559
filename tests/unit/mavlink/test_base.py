"""Our address as a peer sees it: for the URIs that a client of that link can open."""

from __future__ import annotations

import pytest

from anafi_mav.mavlink.base import routed_host, seen_host


@pytest.mark.parametrize(
    ("own", "peer", "host"),
    [
        (("192.168.1.5", 14550), ("192.168.1.9", 40000), "192.168.1.5"),
        (("127.0.0.1", 5760), ("127.0.0.1", 40000), "127.0.0.1"),
        (("127.0.7.1", 5760), ("127.0.0.1", 40000), "127.0.7.1"),
        (("192.168.1.5", 14550), ("192.168.1.5", 40000), "127.0.0.1"),
        (("::1", 5760, 0, 0), ("::1", 40000, 0, 0), "::1"),
        (("fe80::1%eth0", 5760, 0, 2), ("fe80::9%eth0", 40000, 0, 2), "fe80::1"),
        (None, None, None),
        ("", "/dev/ttyUSB0", None),
    ],
)
def test_own_address_is_that_of_the_peers_link(own: object, peer: object, host: str | None) -> None:
    assert seen_host(own, peer) == host


def test_route_to_a_peer_names_our_address() -> None:
    assert routed_host(("127.0.0.1", 40000)) == "127.0.0.1"
    assert routed_host(("nonsense", 40000)) is None

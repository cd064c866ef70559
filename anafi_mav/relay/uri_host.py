"""The host in the URI of a stream or a file, as one client can reach it. No I/O."""

from __future__ import annotations

import ipaddress

EVERY_ADDRESS = "0.0.0.0"
"""A server that listens here is open to every network of this computer."""


def uri_host(bound: str, local_host: str | None, public_host: str | None) -> str | None:
    """Return the host for a client whose link shows us as `local_host`; None without one.

    `bound` is the address that the server listens on. `public_host` is configured and decides: behind a router of
    MAVLink, NAT or a container the link shows an address that the station cannot use.
    """
    if public_host is not None:
        return public_host
    if bound == EVERY_ADDRESS:
        return local_host
    if is_loopback(bound):
        return bound if local_host is not None and is_loopback(local_host) else None
    return bound


def is_loopback(host: str) -> bool:
    """Return True for an address, or the name, that never leaves this computer."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False

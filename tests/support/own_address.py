"""An address of this computer that is not loopback."""

from __future__ import annotations

import ipaddress
import socket

import pytest

ELSEWHERE = "198.51.100.1"
"""No computer has it (RFC 5737)."""


def own_address() -> str:
    """The address of this computer towards others; nothing is sent. Skips the test where there is none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((ELSEWHERE, 9))
        except OSError:
            pytest.skip("this computer has no network: every connection comes from loopback")
        address: str = probe.getsockname()[0]
    if ipaddress.ip_address(address).is_loopback:
        pytest.skip("this computer has loopback addresses only")
    return address

"""The autopilots that an endpoint can show: a mark for tests of both, and which of them a test has spoken to."""

from __future__ import annotations

import re

import pytest

both = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])

SHOWN: set[str] = set()
"""Of what endpoints were opened; tests/conftest.py notes it beside the result."""

_ENDPOINT = re.compile(r"(?:udpout|udpin|tcpin|tcpout|serial)://[^\s\"',\]?]+(?:\?flavour=(\w+))?")


def note(*urls: str) -> None:
    """Endpoints that are being opened, or text that has their URLs in it."""
    for text in urls:
        SHOWN.update(match[1] or "px4" for match in _ENDPOINT.finditer(text))

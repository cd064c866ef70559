"""Which flavours the running test has opened an endpoint of; tests/conftest.py notes it beside the result."""

from __future__ import annotations

import re

SHOWN: set[str] = set()

_ENDPOINT = re.compile(r"(?:udpout|udpin|tcpin|tcpout|serial)://[^\s\"',\]?]+(?:\?flavour=(\w+))?")


def note(*urls: str) -> None:
    """Endpoints that are being opened, or text that has their URLs in it."""
    for text in urls:
        SHOWN.update(match[1] or "px4" for match in _ENDPOINT.finditer(text))

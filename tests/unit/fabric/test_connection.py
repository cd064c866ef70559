"""Opening a connection to the fabric: without zenoh, and at an address that is taken."""

from __future__ import annotations

import socket
import sys
from collections import Counter

import pytest

from anafi_mav.fabric.connection import FabricConnection
from anafi_mav.mavlink.endpoint import parse_endpoint


async def test_connection_without_zenoh_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "anafi_mav.fabric.zenoh_session", raising=False)
    monkeypatch.setitem(sys.modules, "zenoh", None)
    connection = FabricConnection(parse_endpoint("zenoh://127.0.0.1:7447"), Counter(), print)
    with pytest.raises(OSError, match=r"needs eclipse-zenoh: pip install 'anafi-mav\[fabric\]'"):
        await connection.open()
    await connection.close()


async def test_connection_at_a_taken_address_is_refused() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        url = parse_endpoint(f"zenoh://127.0.0.1:{taken.getsockname()[1]}?listen=true")
        connection = FabricConnection(url, Counter(), print)
        with pytest.raises(OSError, match="Address already in use"):
            await connection.open()
        await connection.close()

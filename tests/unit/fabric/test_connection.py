"""Opening a connection to the fabric: without zenoh, and at an address that is taken."""

from __future__ import annotations

import asyncio
import socket
import sys
from collections import Counter
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization
from support.certificates import Authority

from anafi_mav.fabric.arrivals import Arrival, FabricSample, TokensListed
from anafi_mav.fabric.connection import MAX_TAKEN, FabricConnection
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


@pytest.mark.parametrize("option", ["ca", "certificate", "private_key"])
async def test_unreadable_file_of_a_link_is_named(tmp_path: Path, option: str) -> None:
    files = {name: tmp_path / name for name in ("ca", "certificate", "private_key")}
    for name, file in files.items():
        if name != option:
            file.write_text("PEM")
    options = "&".join(f"{name}={file}" for name, file in files.items())
    connection = FabricConnection(parse_endpoint(f"zenoh://127.0.0.1:7447?link=tls&{options}"), Counter(), print)
    with pytest.raises(OSError, match=f"{files[option]}: No such file or directory"):
        await connection.open()
    await connection.close()


@pytest.mark.parametrize("wrong", ["ca", "certificate", "private_key", "another's key", "key with a password"])
async def test_file_that_is_no_certificate_or_key_is_named(tmp_path: Path, wrong: str) -> None:
    """zenoh reports no more than that the router does not answer."""
    authority = Authority(tmp_path)
    certificate, key = authority.issue("north")
    files = {"ca": authority.path, "certificate": certificate, "private_key": key}
    if wrong in files:
        files[wrong] = tmp_path / "wrong.pem"
        files[wrong].write_text("-----BEGIN NOTHING-----")
    elif wrong == "another's key":
        files["private_key"] = authority.issue("south")[1]
    else:
        locked = serialization.BestAvailableEncryption(b"secret")
        loaded = serialization.load_pem_private_key(key.read_bytes(), None)
        key.write_bytes(loaded.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, locked))
    options = "&".join(f"{name}={file}" for name, file in files.items())
    connection = FabricConnection(parse_endpoint(f"zenoh://127.0.0.1:7447?link=tls&{options}"), Counter(), print)
    named = files[wrong] if wrong in ("ca", "certificate") else files["private_key"]
    with pytest.raises(OSError, match=f"{named}: expected "):
        await connection.open()
    await connection.close()


async def test_report_that_fails_does_not_lose_the_others() -> None:
    seen: list[Arrival] = []

    def receive(arrival: Arrival) -> None:
        if isinstance(arrival, TokensListed):
            raise ValueError
        seen.append(arrival)

    connection = FabricConnection(parse_endpoint("zenoh://127.0.0.1:7447"), Counter(), receive)
    connection._arrivals.put(TokensListed())
    samples = [FabricSample(str(number), b"", b"") for number in range(MAX_TAKEN + 1)]
    for sample in samples:
        connection._arrivals.put(sample)
    await asyncio.sleep(0)
    assert seen == samples[: MAX_TAKEN - 1]
    await asyncio.sleep(0)
    assert seen == samples

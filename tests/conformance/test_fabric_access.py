"""The router configuration of docs/fabric-router.json5: what each certificate may do, and each refusal.

The router is the Python package in mode `router`, in a process of its own.
"""

from __future__ import annotations

import asyncio
import json
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.certificates import Authority
from support.fabric import FabricStation, RouterProcess, ground, router
from support.world import world

FILE = Path(__file__).resolve().parents[2] / "docs" / "fabric-router.json5"
SETTLED = 1.5
"""s after which the network has passed on what it will: that something does not arrive is no event."""

STATION = "0123456789abcdef-1"
EXPRESSIONS = ("anafi/1/up/**", "anafi/3/up/**", "anafi/*/down/**", "anafi/*/down", "anafi/*/state")
KEYS = (f"anafi/1/up/{STATION}", f"anafi/3/up/{STATION}", f"anafi/1/down/{STATION}", "anafi/1/down", "anafi/3/down")


def settings(authority: Authority) -> dict[str, str]:
    certificate, key = authority.issue("router")
    tls = "transport/link/tls/"
    files = {"root_ca_certificate": authority.path, "listen_certificate": certificate, "listen_private_key": key}
    return {f"{tls}{name}": str(path) for name, path in files.items()}


class Member:
    """A program with a certificate: it subscribes, publishes and holds tokens wherever it is let."""

    def __init__(self, name: str, node: RouterProcess, authority: Authority, signer: Authority | None) -> None:
        """`signer` of its certificate; None: it has none."""
        self.name = name
        self.received: set[tuple[str, str]] = set()
        """(sender, key)."""
        self.tokens: set[tuple[str, str]] = set()
        config = zenoh.Config()
        tls: dict[str, Any] = {"root_ca_certificate": str(authority.path)}
        if signer is not None:
            certificate, key = signer.issue(name)
            tls |= {"connect_certificate": str(certificate), "connect_private_key": str(key), "enable_mtls": True}
        connect = {"endpoints": [f"tls/127.0.0.1:{node.port}"], "timeout_ms": 1000, "exit_on_failure": True}
        values = {"mode": "client", "scouting/multicast/enabled": False}
        values |= {f"connect/{key}": value for key, value in connect.items()}
        values |= {f"transport/link/tls/{key}": value for key, value in tls.items()}
        for key, value in values.items():
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)

    def join(self) -> None:
        """Declare everything."""
        self._held: list[Any] = [self.session.declare_subscriber(one, self._sample) for one in EXPRESSIONS]
        liveliness = self.session.liveliness()
        self._held += [
            liveliness.declare_token(f"anafi/{kind}/{self.name}") for kind in ("station/v1", "1/drone/v1", "3/drone/v1")
        ]
        self._held.append(liveliness.declare_subscriber("anafi/**", self._token, history=True))

    def speak(self) -> None:
        """Publish everything."""
        for key in KEYS:
            self.session.put(key, self.name)

    def _sample(self, sample: zenoh.Sample) -> None:
        if (sender := sample.payload.to_string()) != self.name:
            self.received.add((sender, str(sample.key_expr)))

    def _token(self, sample: zenoh.Sample) -> None:
        kind, _, name = str(sample.key_expr).removeprefix("anafi/").rpartition("/")
        if name != self.name:
            self.tokens.add((name, kind))


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    return Authority(tmp_path)


async def test_router_lets_each_certificate_do_what_it_may_and_no_more(authority: Authority, tmp_path: Path) -> None:
    def run(node: RouterProcess) -> dict[str, Member]:
        strangers = {"gateway-north": Authority(tmp_path, "other"), "station": None}
        for name, signer in strangers.items():
            with pytest.raises(zenoh.ZError):
                Member(name, node, authority, signer)
        with ExitStack() as stack:
            names = ("gateway-north", "station", "observer", "stranger")
            members = [Member(name, node, authority, authority) for name in names]
            for member in members:
                stack.enter_context(member.session)
                member.join()
            time.sleep(SETTLED)
            for member in members:
                member.speak()
            time.sleep(SETTLED)
            return dict(zip(names, members, strict=True))

    async with router(settings(authority), "tls", FILE) as node:
        members = await asyncio.to_thread(run, node)
    north, station, observer, stranger = members.values()
    # A station flies each drone and reads none of another station's keys; a gateway receives its own ids only.
    assert north.received == {("station", KEYS[0])}
    assert station.received == {("gateway-north", f"anafi/1/down/{STATION}"), ("gateway-north", "anafi/1/down")}
    assert observer.received == {("gateway-north", "anafi/1/down")}
    assert stranger.received == set()
    # No program takes the system id of a gateway, and an observer is no station.
    assert north.tokens == {("station", "station/v1")}
    assert station.tokens == {("gateway-north", "1/drone/v1")}
    assert observer.tokens == station.tokens | north.tokens
    assert stranger.tokens == set()


async def test_gateway_and_station_with_certificates_work_together(authority: Authority) -> None:
    def url(node: RouterProcess, name: str) -> str:
        certificate, key = authority.issue(name)
        return f"{node.url}?link=tls&ca={authority.path}&certificate={certificate}&private_key={key}"

    async with (
        router(settings(authority), "tls", FILE) as node,
        world(endpoints=(url(node, "gateway-north"),)) as w,
        ground(url(node, "station")) as port,
    ):
        station = w.take(await FabricStation().join(port))
        ack = await station.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED

"""Rules that hold for every endpoint, page, metric and key; what is added later is found here.

Warnings beyond loopback, port 0, and the text of peers. The lists are read from the product, so that a new scheme, key
or field needs a decision.
"""

from __future__ import annotations

import re
import types
import typing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from prometheus_client.parser import text_string_to_metric_families
from support.statuses import NASTY

from anafi_mav.cli import status as status_command
from anafi_mav.cli.terminal import say, say_table
from anafi_mav.config import schema
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.endpoint import SCHEMES, is_open_to_network, is_readable_on_the_way, parse_endpoint
from anafi_mav.services.flavours import FLAVOURS
from anafi_mav.status_record import GatewayStatus
from anafi_mav.web import metrics

PAGES = sorted((Path(metrics.__file__).parent / "page").iterdir())

# Endpoints.

WARNED = {"udpin": True, "tcpin": True, "zenoh": True, "udpout": False, "tcpout": False, "serial": False}
"""Schemes and whether an unprotected one beyond loopback is warned about: those that others can send to, or read."""


@pytest.mark.parametrize("name", SCHEMES)
def test_scheme_beyond_loopback_has_a_decided_warning(name: str) -> None:
    place = "/dev/ttyUSB0:57600" if name == "serial" else "192.168.1.20:7000"
    url = parse_endpoint(f"{name}://{place}", tuple(FLAVOURS))
    assert (is_open_to_network(url) or is_readable_on_the_way(url)) is WARNED[name]


@pytest.mark.parametrize("name", [name for name in SCHEMES if name != "serial"])
def test_port_0_is_for_schemes_that_listen(name: str) -> None:
    if SCHEMES[name].listens:
        assert parse_endpoint(f"{name}://127.0.0.1:0").number == 0
    else:
        with pytest.raises(ConfigError, match="expected a port from 1"):
            parse_endpoint(f"{name}://127.0.0.1:0")


# Keys.

LISTENING_PORTS = {"HttpConfig.port", "VideoConfig.rtsp_port"}
"""Keys of ports that the gateway itself opens: 0 is any free one."""


def port_keys() -> list[tuple[str, Any]]:
    """Return the keys of the configuration that are ports, with their types."""
    structs = [one for one in vars(schema).values() if isinstance(one, type) and issubclass(one, msgspec.Struct)]
    return [
        (f"{struct.__name__}.{key}", kind)
        for struct in structs
        for key, kind in typing.get_type_hints(struct, include_extras=True).items()
        if key.endswith("port")
    ]


def test_port_0_is_for_keys_of_servers() -> None:
    assert {key for key, _ in port_keys()} > LISTENING_PORTS
    for key, kind in port_keys():
        if key in LISTENING_PORTS:
            assert msgspec.convert(0, kind) == 0, key
        else:
            with pytest.raises(msgspec.ValidationError):
                msgspec.convert(0, kind)


# Pages.

UNSAFE = re.compile(
    r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|createContextualFragment|\beval\(|Function\("
)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_shows_text_of_peers_as_text(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert UNSAFE.findall(text) == []
    if page.suffix == ".html":
        assert re.findall(r"<script(?![^>]*\bsrc=)|\son\w+=|javascript:", text) == []


# Status.


def filled(kind: Any) -> Any:
    """Return a value of a type with a hostile text at each place for a text."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if kind is str:
        return NASTY
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return kind(**{name: filled(hint) for name, hint in typing.get_type_hints(kind).items()})
    if origin is tuple:
        return (filled(arguments[0]),)
    if origin is dict:
        return {filled(arguments[0]): filled(arguments[1])}
    if origin in (typing.Union, types.UnionType):
        return filled(arguments[0])
    return kind(1)


HOSTILE: GatewayStatus = filled(GatewayStatus)


def test_every_text_of_the_status_stays_within_its_label() -> None:
    exposed = metrics.exposition(HOSTILE)
    assert [
        line for line in exposed.splitlines() if not re.match(r"# (HELP|TYPE) anafi_mav_|anafi_mav_\w+[ {]", line)
    ] == []
    labels = {
        value
        for family in text_string_to_metric_families(exposed)
        for sample in family.samples
        for value in sample.labels.values()
    }
    assert NASTY in labels


def test_every_text_of_the_status_controls_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    for line in status_command.head(HOSTILE):
        say(line)
    for table in status_command.tables(HOSTILE):
        say_table(*table)
    out = capsys.readouterr().out
    assert r"\x1b[31m" in out
    assert [character for character in out if not character.isprintable() and character != "\n"] == []

"""Rules that hold for every endpoint, page, metric and key; what is added later is found here.

Warnings beyond loopback, port 0, the text of peers, and folders with files of the gateway. The lists are read from the
product, so that a new scheme, option, key, field or file needs a decision.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import types
import typing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from prometheus_client.parser import text_string_to_metric_families
from support.statuses import NASTY
from support.world import loopback

from anafi_mav.cli import COMMANDS, main
from anafi_mav.cli import status as status_command
from anafi_mav.cli.start_warnings import warnings_of, warnings_of_ground
from anafi_mav.cli.terminal import say, say_table
from anafi_mav.clock import SystemClock
from anafi_mav.config import Config, load, schema
from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.errors import ConfigError
from anafi_mav.fabric.ground import FABRIC_OPTIONS, LOCAL_OPTIONS, FabricGround
from anafi_mav.gateway import Gateway
from anafi_mav.mavlink.endpoint import SCHEMES, is_open_to_network, is_readable_on_the_way, parse_endpoint
from anafi_mav.mavlink.key_ring import write_key
from anafi_mav.services.flavours import FLAVOURS
from anafi_mav.services.memory import Memory
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


# Endpoints of `anafi-mav ground`.

ROUTER = parse_endpoint("zenoh://127.0.0.1:7447")


@pytest.mark.parametrize("name", [name for name in SCHEMES if name != "zenoh"])
def test_scheme_of_ground_beyond_loopback_has_a_decided_warning(name: str) -> None:
    place = "/dev/ttyUSB0:57600" if name == "serial" else "192.168.1.20:7000"
    warnings = list(warnings_of_ground(ROUTER, [parse_endpoint(f"{name}://{place}")]))
    assert bool(warnings) is WARNED[name]


@pytest.mark.parametrize(
    ("options", "styles"),
    [("", ["red"]), ("?link=udp", ["red"]), ("?link=tls&ca=ca.pem", []), ("?link=quic&ca=ca.pem", [])],
)
def test_network_of_ground_beyond_loopback_warns_without_tls(options: str, styles: list[str]) -> None:
    warnings = warnings_of_ground(parse_endpoint(f"zenoh://192.168.1.20:7447{options}"), [])
    assert [warning.style for warning in warnings] == styles


async def test_ground_takes_every_scheme_but_the_network_and_port_0_where_it_listens() -> None:
    for name, scheme in SCHEMES.items():
        place = "/dev/ttyUSB0:57600" if name == "serial" else "127.0.0.1:0" if scheme.listens else "127.0.0.1:7000"
        url = parse_endpoint(f"{name}://{place}")
        if name == "zenoh":
            with pytest.raises(ConfigError):
                FabricGround(ROUTER, [url], SystemClock())
        else:
            assert len(FabricGround(ROUTER, [url], SystemClock()).endpoints) == 1


OPTION_VALUES = {
    "flavour": "ardupilot",
    "access": "observe",
    "systems": "1",
    "allow_messages": "HEARTBEAT",
    "block_messages": "HEARTBEAT",
    "signing": "field",
    "operator_control": "true",
    "secondaries": "255",
}
"""Options that are the gateways' to decide, with a value that is not their default."""


async def test_each_option_is_of_ground_or_left_to_the_gateways() -> None:
    assert OPTION_VALUES.keys() | LOCAL_OPTIONS | FABRIC_OPTIONS == set(EndpointOptions.__struct_fields__)
    assert not OPTION_VALUES.keys() & (LOCAL_OPTIONS | FABRIC_OPTIONS)
    for option, value in OPTION_VALUES.items():
        more = "&operator_control=true" if option == "secondaries" else ""
        url = parse_endpoint(f"udpin://127.0.0.1:0?{option}={value}{more}", tuple(FLAVOURS))
        with pytest.raises(ConfigError, match="the gateway's endpoint has it"):
            FabricGround(ROUTER, [url], SystemClock())


# Options of commands.

PORT_OPTIONS = {"sim --http-port": 0, "sim --rtsp-port": 0, "doctor --http-port": 1, "doctor --rtsp-port": 1}
"""Options that are ports, with the least value: 0 is any free one, for those on which the command listens."""


def test_port_0_is_for_options_of_servers(capsys: pytest.CaptureFixture[str]) -> None:
    found = set()
    for command in COMMANDS:
        parser = argparse.ArgumentParser()
        importlib.import_module(f"anafi_mav.cli.{command}").add_arguments(parser)
        options = (option for action in parser._actions for option in action.option_strings)
        found |= {f"{command} {option}" for option in options if option.endswith("port")}
    assert found == PORT_OPTIONS.keys()
    for words, least in PORT_OPTIONS.items():
        command, option = words.split()
        address = ["--address", "192.0.2.1"] if command == "sim" else ["192.0.2.1"]
        assert main([command, *address, option, str(least - 1)]) == 2
        assert f"{option}: expected a port from {least} to 65535" in capsys.readouterr().err


# Keys.

HOSTS = {"HttpConfig.host": {"http": schema.HttpConfig(host="192.168.1.20")},
         "VideoConfig.host": {"video": schema.VideoConfig(host="192.168.1.20")},
         "VideoConfig.public_host": {}}  # fmt: skip
"""Keys of hosts, and what opens each of them to the network; nothing for one that is not listened on."""


def keys_of(ending: str) -> set[str]:
    """Return the keys of the configuration with this ending."""
    structs = [one for one in vars(schema).values() if isinstance(one, type) and issubclass(one, msgspec.Struct)]
    return {f"{one.__name__}.{key}" for one in structs for key in one.__struct_fields__ if key.endswith(ending)}


def test_host_beyond_loopback_is_warned_about() -> None:
    assert keys_of("host") == HOSTS.keys()
    for key, opened in HOSTS.items():
        assert bool(list(warnings_of(Config(**opened)))) is bool(opened), key


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


# Folders.

FOLDERS = {"Config.state": ("state", "{}"),
           "MediaConfig.download_folder": ("media.download_folder", "{{download_folder: {}}}"),
           "RecordingConfig.folder": ("recording.folder", "{{folder: {}}}")}  # fmt: skip
"""Keys of folders that are written into, with their place in the file and how they are written there."""


def configuration(folder: Path, **more: str) -> Path:
    """Write a configuration with all that is in the state folder, and a drone that does not answer."""
    path = folder / "fleet.yaml"
    keys = {
        "state": f"{folder / 'state'}",
        "endpoints": '["tcpin://127.0.0.1:0?signing=field", "tcpin://127.0.0.1:0"]',
        "drones": f"[{{name: alpha, sysid: 1, address: {loopback()}}}]",
        "http": "{host: 0.0.0.0, port: 0}",
        "video": "{host: 0.0.0.0, rtsp_port: 0}",
        **more,
    }
    path.write_text("\n".join(f"{key}: {value}" for key, value in keys.items()))
    write_key(folder / "state" / "keys", "field", bytes(range(40)))
    return path


def test_folder_that_cannot_be_used_is_named_by_the_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert keys_of("folder") | keys_of("state") == FOLDERS.keys()
    (tmp_path / "file").write_text("")
    for key, value in FOLDERS.values():
        unusable = {key.partition(".")[0]: value.format(tmp_path / "file" / "below")}
        path = configuration(tmp_path, endpoints="[tcpin://127.0.0.1:0]", **unusable)
        assert main(["run", "-c", str(path), "--check"]) == 1
        assert any(line.startswith(f"{key}: WRONG: ") for line in capsys.readouterr().out.splitlines()), key


def files_below(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.rglob("*")) if path.is_file()]


STATE_FILES = {"gateway.lock": False, "keys/field.key": True, "web.token": True, "PI0404": True}
"""Files in a state folder, by their beginnings, and whether they are for this user alone."""


@pytest.mark.skipif(os.name != "posix", reason="permission bits are those of POSIX")
async def test_each_file_of_the_state_folder_is_decided_and_the_folder_is_for_one_gateway(tmp_path: Path) -> None:
    config = load(configuration(tmp_path))
    async with Gateway(config):
        memory = Memory(tmp_path / "state")
        await memory.load("PI040443BA8K000123")
        assert await memory.save() is None
        files = files_below(tmp_path / "state")
        names = [path.relative_to(tmp_path / "state").as_posix() for path in files]
        assert [next((start for start in STATE_FILES if name.startswith(start)), name) for name in names] == sorted(
            STATE_FILES, key=lambda start: next(name for name in names if name.startswith(start))
        )
        for path, name in zip(files, names, strict=True):
            is_private = next(private for start, private in STATE_FILES.items() if name.startswith(start))
            assert (path.stat().st_mode & 0o077 == 0) is is_private, name
        with pytest.raises(ConfigError, match="expected a folder that no other gateway uses"):
            await Gateway(config).open()


async def test_ground_writes_into_no_state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("zenoh")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    ground = FabricGround(ROUTER, [parse_endpoint("udpin://127.0.0.1:0")], SystemClock())
    await ground.start()
    await ground.close()
    assert not files_below(tmp_path)


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

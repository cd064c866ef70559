"""The configuration: its defaults, and the exact line that each mistake is answered with."""

# ruff: noqa: E501 - a mistake and the line it is answered with stand side by side

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from anafi_mav.config import Config, DroneConfig, HttpConfig, SimConfig, VideoConfig, from_text, load, remarks
from anafi_mav.config.schema import WindConfig
from anafi_mav.errors import ConfigError

REPOSITORY = Path(__file__).parents[3]

HOST = "expected an IPv4 address or a host name, like 192.168.42.1, got"
NAME = "expected 1 to 32 letters, digits, '-', '_' or '.', beginning with a letter or digit, got"
SYSID = "expected a whole number from 1 to 250"
KEYS = ", ".join(Config.__struct_fields__)
ENDPOINT = "expected a URL like udpout://127.0.0.1:14550, or a mapping with a url and options"
KEYS_OF_A_DRONE = "name, sysid, serial, address, interface, sim, discovery_port, http_port, rtsp_port, allow_kill"


def problem(text: str | bytes) -> str:
    with pytest.raises(ConfigError) as caught:
        from_text(text, "fleet.yaml")
    assert str(caught.value).splitlines() == [str(caught.value)], "one line"
    return str(caught.value)


def test_an_empty_file_is_the_default_fleet() -> None:
    config = from_text("", "fleet.yaml")
    assert config == Config()
    assert config.endpoints == (
        "udpout://127.0.0.1:14550",
        "udpout://127.0.0.1:14540",
        "tcpin://127.0.0.1:5760?flavour=ardupilot",
    )
    assert config.drones == (DroneConfig(name="anafi", sysid=1, sim=SimConfig()),)
    assert config.allow_kill is False
    assert config.drones[0].allow_kill is None


def test_the_example_of_the_manual(tmp_path: Path) -> None:
    manual = (REPOSITORY / "docs" / "configuration.md").read_text(encoding="utf-8")
    path = tmp_path / "fleet.yaml"
    path.write_text(manual.split("```yaml\n")[1].split("```")[0], encoding="utf-8")
    alpha, bravo = load(path).drones
    assert (alpha.name, alpha.sysid, alpha.address, alpha.sim) == ("alpha", 1, "192.168.42.1", None)
    assert (bravo.name, bravo.sysid, bravo.address) == ("bravo", 2, None)
    assert bravo.sim == SimConfig(model="4k", home=(48.8789, 2.3677, 35.0))


def test_a_hundred_drones_are_a_longer_list() -> None:
    text = "drones:\n" + "".join(f"  - {{name: d{n}, sysid: {n}, sim: {{}}}}\n" for n in range(1, 101))
    assert [drone.sysid for drone in from_text(text, "fleet.yaml").drones] == list(range(1, 101))


def test_one_address_on_two_interfaces_is_two_drones() -> None:
    drones = [f"  - {{name: d{n}, sysid: {n}, address: 192.168.42.1, interface: wlan{n}}}" for n in (1, 2)]
    config = from_text("\n".join(["drones:", *drones]), "fleet.yaml")
    assert [drone.interface for drone in config.drones] == ["wlan1", "wlan2"]


def test_every_value_survives() -> None:
    config = from_text(
        "endpoints: ['udpin://0.0.0.0:14550']\nallow_kill: true\ndrones:\n"
        "  - {name: a.b-c_1, sysid: 250, address: anafi.local, discovery_port: 44447, allow_kill: false, http_port: 81,"
        " rtsp_port: 555}\n"
        "  - {name: b, sysid: 2, sim: {home: [-33, 151, -2], address: 127.0.42.9, speed: 4, telemetry_rate: 30,"
        " seed: 7, protocol: 1, http_port: 8080, rtsp_port: 8555, skycontroller: 4, storage: 500k, scenario: bad-day.yaml,"
        " wind: {speed: 8, direction: 270, gusts: 0.2}, firmware_quirks: [roll-inverted]}}\n",
        "fleet.yaml",
    )
    assert config == Config(
        endpoints=("udpin://0.0.0.0:14550",),
        allow_kill=True,
        drones=(
            DroneConfig(
                name="a.b-c_1",
                sysid=250,
                address="anafi.local",
                discovery_port=44447,
                allow_kill=False,
                http_port=81,
                rtsp_port=555,
            ),
            DroneConfig(
                name="b",
                sysid=2,
                sim=SimConfig(
                    home=(-33.0, 151.0, -2.0),
                    address="127.0.42.9",
                    speed=4.0,
                    telemetry_rate=30.0,
                    seed=7,
                    protocol=1,
                    http_port=8080,
                    rtsp_port=8555,
                    skycontroller=4,
                    storage="500k",
                    scenario="bad-day.yaml",
                    wind=WindConfig(speed=8.0, direction=270.0, gusts=0.2),
                    firmware_quirks=("roll-inverted",),
                ),
            ),
        ),
    )


def test_anchors_and_merges_are_no_duplicate_keys() -> None:
    text = (
        "drones:\n  - &a {name: a, sysid: 1, sim: {seed: 1}}\n"
        "  - &b {<<: *a, name: b, sysid: 2}\n  - {<<: *b, sysid: 3, name: c}\n"
    )
    drones = from_text(text, "fleet.yaml").drones
    assert [(drone.name, drone.sysid, drone.sim) for drone in drones] == [
        ("a", 1, SimConfig(seed=1)),
        ("b", 2, SimConfig(seed=1)),
        ("c", 3, SimConfig(seed=1)),
    ]


def test_web_server_is_configured_left_out_or_off() -> None:
    assert from_text("http: {host: 0.0.0.0, port: 0}", "f").http_server == HttpConfig(host="0.0.0.0", port=0)
    assert from_text("http: off", "f").http_server is None
    assert from_text("video: {host: 0.0.0.0, rtsp_port: 0, public_host: gw.example}", "f").video_server == VideoConfig(
        host="0.0.0.0", rtsp_port=0, public_host="gw.example"
    )
    assert from_text("video: off", "f").video_server is None
    assert from_text("video: on", "f").video_server == from_text("", "f").video_server == VideoConfig()
    assert from_text("http: on", "f").http_server == from_text("", "f").http_server == HttpConfig()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("http: 8088", "http: expected a mapping like {host: 127.0.0.1, port: 8088}, or off, got 8088"),
        ("http: {port: 65536}", "http.port: expected a port from 0 to 65535, got 65536"),
        ("http: {host: 1.2.3}", "http.host: expected an IPv4 address or a host name of this computer, like 0.0.0.0"),
        ("video: 8555", "video: expected a mapping like {host: 0.0.0.0, rtsp_port: 8555}, or off, got 8555"),
        ("video: {rtsp_port: -1}", "video.rtsp_port: expected a port from 0 to 65535, got -1"),
        ("video: {public_host: 1.2.3}", "video.public_host: expected an IPv4 address or a host name, like 10.0.0.7"),
        ("http: {address: x}", "http.address: unknown key; expected one of host, port"),
    ],
)
def test_web_server_of_wrong_kind_is_named_with_its_key(text: str, line: str) -> None:
    assert problem(text).startswith(f"fleet.yaml: {line}")


def test_scenario_path_is_relative_to_the_configuration(tmp_path: Path) -> None:
    path = tmp_path / "fleet.yaml"
    path.write_text(
        "drones: [{name: a, sysid: 1, sim: {scenario: days/bad.yaml}}, {name: b, sysid: 2, sim: {scenario: /bad.yaml}}]"
    )
    found = [drone.sim.scenario for drone in load(path).drones if drone.sim is not None]
    assert found == [str(tmp_path / "days" / "bad.yaml"), "/bad.yaml"]


def test_system_id_245_is_legal_and_remarked_upon() -> None:
    config = from_text("drones: [{name: a, sysid: 1, sim: {}}, {name: b, sysid: 245, sim: {}}]", "fleet.yaml")
    assert remarks(config) == [
        "drones[1].sysid: 245 is the default system id of MAVSDK: such a client will not see this drone"
    ]
    assert remarks(Config()) == []


def one(drone: str) -> str:
    """A file with one drone."""
    return f"drones: [{{name: a, {drone}}}]"


def sim(keys: str) -> str:
    """A file with one simulated drone."""
    return one(f"sysid: 1, sim: {{{keys}}}")


def two(first: str, second: str) -> str:
    """A file with two drones."""
    return f"drones: [{{{first}}}, {{{second}}}]"


MISTAKES = {
    # Whole file
    "[]": f"expected a mapping with the keys {KEYS}, got []",
    "just text": f"expected a mapping with the keys {KEYS}, got 'just text'",
    # Unknown keys, at each level
    "drons: []": "drons: unknown key; did you mean drones?",
    "x: 1": f"x: unknown key; expected one of {KEYS}",
    "3: 4": f"3: unknown key; expected one of {KEYS}",
    "'a b': 4": f"'a b': unknown key; expected one of {KEYS}",
    one("sysid: 1, sim: {}, adress: x"): "drones[0].adress: unknown key; did you mean address?",
    sim("hme: 1"): "drones[0].sim.hme: unknown key; did you mean home?",
    # Wrong types
    "endpoints: tcpin://127.0.0.1:5760": "endpoints: expected a list of 1 to 32 URLs, got 'tcpin://127.0.0.1:5760'",
    "endpoints: null": "endpoints: expected a list of 1 to 32 URLs, got nothing",
    "endpoints: [5760]": f"endpoints[0]: {ENDPOINT}, got 5760",
    "drones: {a: 3}": "drones: expected a list of 1 to 250 drones, got {'a': 3}",
    "drones: [3]": f"drones[0]: expected a mapping with the keys {KEYS_OF_A_DRONE}, got 3",
    "allow_kill: please": "allow_kill: expected true or false, got 'please'",
    one("sysid: x, sim: {}"): f"drones[0].sysid: {SYSID}, got 'x'",
    one("sysid: 1.0, sim: {}"): f"drones[0].sysid: {SYSID}, got 1.0",
    one("sysid: true, sim: {}"): f"drones[0].sysid: {SYSID}, got true",
    one("sysid: 1, sim: {}, allow_kill: 1"): "drones[0].allow_kill: expected true or false, got 1",
    one("sysid: 1, sim: 4k"): "drones[0].sim: expected a mapping with the keys of a simulated drone, or {}, got '4k'",
    one("sysid: 1, address: 42"): f"drones[0].address: {HOST} 42",
    "endpoints: [{url: 'udpin://0.0.0.0:1', acces: all}]": "endpoints[0].acces: unknown key; did you mean access?",
    "endpoints: [{access: all}]": "endpoints[0].url: missing; expected a URL like udpin://0.0.0.0:14550",
    "endpoints: [{url: 'udpin://0.0.0.0:1', access: fly}]": "endpoints[0].access: expected observe, control or all, got 'fly'",
    "endpoints: [{url: 'udpin://0.0.0.0:1', systems: [1, x]}]": "endpoints[0].systems[1]: expected a system id from 1 to 255, or a range like 1-9, got 'x'",
    "endpoints: [{url: 'udpin://0.0.0.0:1', max_clients: 0}]": "endpoints[0].max_clients: expected a whole number from 1 to 250, got 0",
    # Missing
    one("sim: {}"): f"drones[0].sysid: missing; {SYSID}",
    one("sysid: 1"): "drones[0]: expected either address or sim, got neither",
    one("sysid: 1, sim: {}, address: 1.2.3.4"): "drones[0]: expected either address or sim, got both",
    one("sysid: 1, sim: {}, rtsp_port: 8554"): "drones[0].rtsp_port: expected it in sim, got 8554 here",
    one("sysid: 1, sim: {}, http_port: 80"): "drones[0].http_port: expected it in sim, got 80 here",
    # Out of range
    "drones: []": "drones: expected a list of 1 to 250 drones, got []",
    "endpoints: []": "endpoints: expected a list of 1 to 32 URLs, got []",
    "endpoints: ['']": f"endpoints[0]: {ENDPOINT}, got ''",
    one("sysid: 0, sim: {}"): f"drones[0].sysid: {SYSID}, got 0",
    one("sysid: 251, sim: {}"): f"drones[0].sysid: {SYSID}, got 251",
    "drones: [{name: 'a b', sysid: 1, sim: {}}]": f"drones[0].name: {NAME} 'a b'",
    "drones: [{name: '', sysid: 1, sim: {}}]": f"drones[0].name: {NAME} ''",
    one("sysid: 1, sim: {}, discovery_port: 0"): "drones[0].discovery_port: expected a port from 1 to 65535, got 0",
    sim("http_port: 65536"): "drones[0].sim.http_port: expected a port from 1 to 65535, got 65536",
    sim("home: [1, 2]"): "drones[0].sim.home: expected [latitude, longitude, height], got [1, 2]",
    sim("home: [91, 2, 3]"): "drones[0].sim.home[0]: expected a latitude from -90 to 90 degrees, got 91",
    sim("home: [1, -180.5, 3]"): "drones[0].sim.home[1]: expected a longitude from -180 to 180 degrees, got -180.5",
    sim("home: [1, 2, 9001]"): "drones[0].sim.home[2]: expected a height of -500 to 9000 m above sea level, got 9001",
    sim("home: [.nan, 2, 3]"): "drones[0].sim.home[0]: expected a latitude from -90 to 90 degrees, got nan",
    sim("model: bebop"): "drones[0].sim.model: expected 4k, thermal, usa or ai, got 'bebop'",
    sim("protocol: 4"): "drones[0].sim.protocol: expected 1, 2 or 3, got 4",
    sim("speed: 0"): "drones[0].sim.speed: expected a number from 0.1 to 20, got 0",
    sim("speed: .inf"): "drones[0].sim.speed: expected a number from 0.1 to 20, got inf",
    sim("telemetry_rate: 0.5"): "drones[0].sim.telemetry_rate: expected a number of events per second from 1 to 200, got 0.5",
    sim("storage: 16T"): "drones[0].sim.storage: expected a number of bytes like 500k or 16G, got '16T'",
    sim("storage: -1"): "drones[0].sim.storage: expected a number of bytes like 500k or 16G, got -1",
    sim("storage: 1.5"): "drones[0].sim.storage: expected a number of bytes like 500k or 16G, got 1.5",
    sim("wind: 8"): "drones[0].sim.wind: expected a mapping like {speed: 8, direction: 270}, got 8",
    sim("wind: {}"): "drones[0].sim.wind.speed: missing; expected a speed from 0 to 40 m/s",
    sim("wind: {speed: 41}"): "drones[0].sim.wind.speed: expected a speed from 0 to 40 m/s, got 41",
    sim("wind: {speed: 1, direction: -1}"): "drones[0].sim.wind.direction: expected degrees from 0 to 360, got -1",
    sim("wind: {speed: 1, gusts: 15}"): "drones[0].sim.wind.gusts: expected a share from 0 to 1, got 15",
    sim("wind: {speed: 1, gust: 1}"): "drones[0].sim.wind.gust: unknown key; did you mean gusts?",
    sim("scenario: {steps: []}"): "drones[0].sim.scenario: expected the path of a scenario file, got {'steps': []}",
    sim("seed: -1"): "drones[0].sim.seed: expected a whole number from 0 to 4294967295, got -1",
    # Addresses
    one("sysid: 1, address: 192.168.42.300"): f"drones[0].address: {HOST} '192.168.42.300'",
    one("sysid: 1, address: 192.168.42"): f"drones[0].address: {HOST} '192.168.42'",
    one("sysid: 1, address: my drone"): f"drones[0].address: {HOST} 'my drone'",
    one("sysid: 1, address: -a.local"): f"drones[0].address: {HOST} '-a.local'",
    one("sysid: 1, address: ''"): f"drones[0].address: {HOST} ''",
    sim("address: localhost"): "drones[0].sim.address: expected an IPv4 address of this machine, like 127.0.42.1, got 'localhost'",
    # Things that must differ, or agree
    two("name: a, sysid: 7, sim: {}", "name: b, sysid: 7, sim: {}"): "drones[1].sysid: expected a sysid of its own, 7 is already at drones[0].sysid",
    "sysids: 1-80\n" + two("name: a, sysid: 80, sim: {}", "name: b, sysid: 81, sim: {}"): "drones[1].sysid: expected one of sysids, 1-80, got 81",
    two("name: a, sysid: 1, serial: PI040416AA0A000001, address: h", "name: b, sysid: 2, serial: PI040416AA0A000001, address: i"): "drones[1].serial: expected a serial of its own, 'PI040416AA0A000001' is already at drones[0].serial",
    one("sysid: 1, serial: PI-04, address: h"): "drones[0].serial: expected 5 to 32 letters and digits, got 'PI-04'",
    one("sysid: 1, serial: PI040416AA0A000001, sim: {}"): "drones[0].serial: expected none for a simulated drone, whose serial number follows from its address",
    "sysids: 80": "sysids: expected a range like 1-80, got 80",
    "sysids: 0-300": "sysids: expected a range like 1-80 from 1 to 250, got '0-300'",
    "sysids: 9-1\n" + one("sysid: 1, sim: {}"): "sysids: expected a range like 1-80 from 1 to 250, got '9-1'",
    two("name: a, sysid: 1, sim: {}", "name: a, sysid: 2, sim: {}"): "drones[1].name: expected a name of its own, 'a' is already at drones[0].name",
    two("name: a, sysid: 1, address: h", "name: b, sysid: 2, address: h"): "drones[1].address: expected an address and discovery_port of its own, 'h:44445' is already at drones[0].address",
    two("name: a, sysid: 1, address: h, interface: w", "name: b, sysid: 2, address: h, interface: w"): "drones[1].address: expected an address and discovery_port of its own, 'h:44445 on w' is already at drones[0].address",
    "drones: [{name: a, sysid: 1, address: h, interface: 'wlan 1'}]": "drones[0].interface: expected the name of a network interface, like wlan1, got 'wlan 1'",
    "drones: [{name: a, sysid: 1, address: h, interface: longer_than_linux}]": "drones[0].interface: expected the name of a network interface, like wlan1, got 'longer_than_linux'",
    "drones: [{name: a, sysid: 1, sim: {skycontroller: 2}}]": "drones[0].sim.skycontroller: expected 3 or 4, got 2",
    "drones: [{name: a, sysid: 1, sim: {model: ai, skycontroller: 3}}]": "drones[0].sim.skycontroller: expected 4: a Skycontroller 3 cannot fly an ai",
    "drones: [{name: a, sysid: 1, sim: {}, interface: wlan1}]": "drones[0].interface: expected none for a simulated drone, which lives on this machine",
    two("name: a, sysid: 1, address: 127.0.42.1", "name: b, sysid: 2, sim: {address: 127.0.42.1}"): "drones[1].sim.address: expected an address and discovery_port of its own, '127.0.42.1:44445' is already at drones[0].address",
    two("name: a, sysid: 1, sim: {address: 127.0.42.1}", "name: b, sysid: 2, discovery_port: 5, sim: {address: 127.0.42.1}"): "drones[1].sim.address: expected an address of its own, '127.0.42.1' is already at drones[0].sim.address",
    two("name: a, sysid: 1, sim: {speed: 2}", "name: b, sysid: 2, sim: {}"): "drones[1].sim.speed: expected 2 as at drones[0].sim.speed, got 1",
    two("name: a, sysid: 1, sim: {seed: 2}", "name: b, sysid: 2, sim: {seed: 3}"): "drones[1].sim.seed: expected 2 as at drones[0].sim.seed, got 3",
    "endpoints: [udpin://0.0.0.0:1, udpin://0.0.0.0:1]": "endpoints[1]: expected an endpoint of its own, 'udpin://0.0.0.0:1' is already at endpoints[0]",
    # YAML itself
    "a: [": "fleet.yaml, line 1, column 5: expected the node content, but found '<stream end>'",
    "drones:\n  - a: b: c": "fleet.yaml, line 2, column 9: mapping values are not allowed here",
    "allow_kill: true\nallow_kill: false": "fleet.yaml, line 2, column 1: the key 'allow_kill' stands twice in one mapping",
    "a: !!python/object:os.system x": "fleet.yaml, line 1, column 4: could not determine a constructor for the tag 'tag:yaml.org,2002:python/object:os.system'",
    'pose: "\\ud800"': "fleet.yaml, line 1, column 7: half a character (surrogate)",
    "allow_kill: true\na: 2026-02-31": "fleet.yaml, line 2, column 4: expected a value of type timestamp, got '2026-02-31'",
    "a: 0b_": "fleet.yaml, line 1, column 4: expected a value of type int, got '0b_'",
    "a: !!bool x": "fleet.yaml, line 1, column 4: expected a value of type bool, got 'x'",
    "a: !!timestamp x": "fleet.yaml, line 1, column 4: expected a value of type timestamp, got 'x'",
    "[" * 5000: "fleet.yaml: lists or mappings inside each other without end",
}  # fmt: skip


@pytest.mark.parametrize("text", MISTAKES, ids=lambda text: text[:60])
def test_configuration_mistake_is_one_line_with_its_place(text: str) -> None:
    wanted = MISTAKES[text]
    assert problem(text) == (wanted if wanted.startswith("fleet.yaml") else f"fleet.yaml: {wanted}")


def test_undecodable_configuration_is_one_line() -> None:
    assert problem(b"a: \xff").startswith("fleet.yaml: unacceptable character #x00ff")
    assert problem("a: \x00").startswith("fleet.yaml: unacceptable character #x0000")


def test_a_huge_wrong_value_makes_a_short_line() -> None:
    assert len(problem(one("sysid: " + "9" * 4000 + ", sim: {}"))) < 300
    assert len(problem("x" * 4000 + ": 1")) < 300
    deep = "a: &a [x, x]\n" + "".join(
        f"{chr(98 + n)}: &{chr(98 + n)} [*{chr(97 + n)}, *{chr(97 + n)}]\n" for n in range(20)
    )
    assert len(problem(deep + "allow_kill: *u")) < 300  # a million elements once unfolded


def test_the_error_keeps_the_key_path() -> None:
    with pytest.raises(ConfigError) as caught:
        from_text(one("sysid: 0, sim: {}"), "fleet.yaml")
    assert caught.value.key_path == "drones[0].sysid"


def test_unreadable_configuration_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^cannot read .*missing\.yaml: No such file or directory$"):
        load(tmp_path / "missing.yaml")
    with pytest.raises(ConfigError, match=r"^cannot read .*: Is a directory$"):
        load(tmp_path)


def test_oversized_configuration_is_not_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(b"#" * (1 << 20) + b"#")
    with pytest.raises(ConfigError, match=r"expected a file of at most 1048576 bytes$"):
        load(path)


def test_the_generated_pages_are_up_to_date() -> None:
    done = subprocess.run(
        [sys.executable, REPOSITORY / "docs" / "generate.py", "--check"], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_stale_page_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    main = runpy.run_path(str(REPOSITORY / "docs" / "generate.py"))["main"]
    monkeypatch.setitem(main.__globals__, "HERE", tmp_path)
    assert main(["--check"]) == 1
    assert main([]) == 0
    assert main(["--check"]) == 0

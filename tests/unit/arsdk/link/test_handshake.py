"""The JSON of discovery and handshake, as Parrot's own ends write it."""

from __future__ import annotations

import contextlib
import json
import random

import pytest

from anafi_mav.arsdk.link import handshake
from anafi_mav.arsdk.link.handshake import ConnectReply, ConnectRequest, DeviceInfo
from anafi_mav.errors import LocalProtocolError, RemoteProtocolError

# What arsdk-ng's printf and json-c make of it, spaces included.
DISCOVERY = b'{ "model.id": "0x0914","serial": "PI040416DA9H000001", "port": 44444,"name": "ANAFI-H000001"}\0'
REQUEST = (
    b'{ "controller_name": "olympe", "controller_type": "desktop", "d2c_port": 9988, "device_id": "", '
    b'"qos_mode": 0, "proto_v_min": 1, "proto_v_max": 3 }'
)
REPLY = b'{ "status": 0, "c2d_port": 2233, "qos_mode": 0, "proto_v": 3 }'

INFO = DeviceInfo(0x0914, "PI040416DA9H000001", 44444, "ANAFI-H000001")
OLYMPE = ConnectRequest("olympe", "desktop", 9988, "", 0, 1, 3)
WELCOME = ConnectReply(0, 2233, 0, 3)


def test_handshake_json_of_parrot_is_read() -> None:
    assert handshake.parse_discovery(DISCOVERY) == INFO
    assert handshake.parse_request(REQUEST) == OLYMPE
    assert handshake.parse_request(REQUEST + b"\0") == OLYMPE
    assert handshake.parse_reply(REPLY) == WELCOME


def test_handshake_json_has_the_members_of_parrot() -> None:
    assert handshake.format_discovery(INFO).endswith(b"\0")
    assert json.loads(handshake.format_discovery(INFO)[:-1]) == json.loads(DISCOVERY[:-1])
    # libarsdk's ends read one JSON text and know no NUL
    assert json.loads(handshake.format_request(OLYMPE)) == json.loads(REQUEST)
    assert json.loads(handshake.format_reply(WELCOME)) == json.loads(REPLY)


@pytest.mark.parametrize("parse", [handshake.parse_discovery, handshake.parse_request, handshake.parse_reply])
def test_every_shorter_prefix_is_incomplete(parse: object) -> None:
    assert callable(parse)
    for text in (DISCOVERY[:-1], REQUEST, REPLY):
        for size in range(len(text)):
            assert parse(text[:size]) is None


def test_peers_of_old_speak_version_1() -> None:
    request = handshake.parse_request(b'{"controller_name": "old", "controller_type": "phone", "d2c_port": 43210}')
    assert request == ConnectRequest("old", "phone", 43210, "", 0, 1, 1)
    assert handshake.parse_reply(b'{"status": 0, "c2d_port": 54321}') == ConnectReply(0, 54321, 0, 1)
    # json-c takes numbers in quotes
    assert handshake.parse_reply(b'{"status": "0", "c2d_port": "54321"}') == ConnectReply(0, 54321, 0, 1)


def test_a_refusal_needs_no_port() -> None:
    assert handshake.parse_reply(b'{"status": -1, "c2d_port": 0}') == ConnectReply(-1, 0, 0, 1)
    assert handshake.parse_reply(b'{"status": -3}') == ConnectReply(-3, 0, 0, 1)


@pytest.mark.parametrize(
    "text",
    [
        b'{"status": 0, "c2d_port": 0}',
        b'{"status": 0, "c2d_port": 65536}',
        b'{"status": 0, "c2d_port": "port"}',
        b'{"status": 0}',
        b"[]",
        b"7",
        b"{}x\0",
        b"\0",
        b"GET / HTTP/1.1\r\n\r\n\0",
        b"[" * handshake.MAX_JSON,
        b"\xff" * handshake.MAX_JSON,
        b'{"a":' + b" " * handshake.MAX_JSON,
    ],
)
@pytest.mark.parametrize("parse", [handshake.parse_discovery, handshake.parse_request, handshake.parse_reply])
def test_invalid_handshake_reply_raises_remote_error(parse: object, text: bytes) -> None:
    assert callable(parse)
    with pytest.raises(RemoteProtocolError):
        parse(text)


def test_invalid_model_number_is_an_unknown_model() -> None:
    for model in ("null", '"anafi"', "2324", '""', '"-0x0914"', '"0x10914"', f'"0x{"9" * 4000}"'):
        info = handshake.parse_discovery(b'{"model.id": %s, "port": 1}' % model.encode())
        assert info == DeviceInfo(0, "", 1, "")


def test_half_a_character_in_handshake_json_is_replaced() -> None:
    device = handshake.parse_discovery(b'{"serial": "PI04\\ud8000001", "name": "\\udc00\\ud83d\\ude80", "port": 1}')
    assert device == DeviceInfo(0, "PI04?0001", 1, "?\N{ROCKET}")
    request = handshake.parse_request(b'{"controller_name": "\\ud800", "device_id": "\\udfff", "d2c_port": 1}')
    assert request == ConnectRequest("?", "", 1, "?")


@pytest.mark.parametrize("seed", range(4))
def test_no_bytes_of_a_peer_raise_anything_else(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(2000):
        data = bytearray(rng.choice([DISCOVERY, REQUEST, REPLY]))
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.choice(b'\0"{}[]0x9,:\\ue\xff-.')
        for parse in (handshake.parse_discovery, handshake.parse_request, handshake.parse_reply):
            with contextlib.suppress(RemoteProtocolError):
                parse(bytes(data))


@pytest.mark.parametrize(
    ("theirs", "ours", "picked"),
    [
        ((1, 3), (1, 3), 3),
        ((1, 1), (1, 3), 1),
        ((1, 3), (2, 2), 2),
        ((2, 9), (1, 3), 3),
        ((4, 9), (1, 3), None),
        ((1, 1), (2, 3), None),
        ((3, 1), (1, 3), None),
    ],
)
def test_the_highest_common_version_is_picked(
    theirs: tuple[int, int], ours: tuple[int, int], picked: int | None
) -> None:
    request = ConnectRequest("", "", 1, proto_v_min=theirs[0], proto_v_max=theirs[1])
    assert handshake.pick_version(request, ours) == picked


@pytest.mark.parametrize("versions", [(0, 3), (1, 4), (3, 1)])
def test_our_own_wrong_versions_raise(versions: tuple[int, int]) -> None:
    with pytest.raises(LocalProtocolError, match="we speak 1 to 3"):
        handshake.check_versions(versions)

"""Keys of the fabric, as docs/fabric.md lists them."""

from __future__ import annotations

import pytest

from anafi_mav.fabric.keys import FabricKey, FabricKeys, KeyKind, session_of, session_text, station_id

KEYS = FabricKeys("field/north")
SESSION = 0x00AB_CDEF_0123_4567
GATEWAY = "00abcdef01234567"
STATION = "00abcdef01234567-2"


def test_ids_are_sixteen_digits_and_the_number_of_a_peer() -> None:
    assert session_text(SESSION) == GATEWAY
    assert station_id(SESSION, 2) == STATION
    assert session_of(STATION) == session_of(GATEWAY) == SESSION


@pytest.mark.parametrize(
    ("key", "text", "parts"),
    [
        (KEYS.down(7), "field/north/7/down", FabricKey(KeyKind.DOWN, 7)),
        (KEYS.down(7, STATION), f"field/north/7/down/{STATION}", FabricKey(KeyKind.DOWN, 7, STATION)),
        (KEYS.up(250, STATION), f"field/north/250/up/{STATION}", FabricKey(KeyKind.UP, 250, STATION)),
        (KEYS.ping(7, STATION), f"field/north/7/down/{STATION}/ping", FabricKey(KeyKind.PING, 7, STATION)),
        (KEYS.pong(7, STATION), f"field/north/7/up/{STATION}/pong", FabricKey(KeyKind.PONG, 7, STATION)),
        (KEYS.state(7), "field/north/7/state", FabricKey(KeyKind.STATE, 7)),
        (KEYS.gateway_token(GATEWAY), f"field/north/gateway/v1/{GATEWAY}", FabricKey(KeyKind.GATEWAY, 0, GATEWAY)),
        (KEYS.drone_token(7, GATEWAY), f"field/north/7/drone/v1/{GATEWAY}", FabricKey(KeyKind.DRONE, 7, GATEWAY)),
        (KEYS.station_token(STATION), f"field/north/station/v1/{STATION}", FabricKey(KeyKind.STATION, 0, STATION)),
    ],
)
def test_key_is_the_documented_one_and_is_parsed(key: str, text: str, parts: FabricKey) -> None:
    assert key == text
    assert KEYS.parse(text) == parts


@pytest.mark.parametrize(
    "text",
    [
        "",
        "field/north",
        "field/7/down",
        "field/northern/7/down",
        "field/north/0/state",
        "field/north/256/state",
        "field/north/07/state",
        "field/north/7/up",
        "field/north/7/up/station",
        f"field/north/7/up/{STATION}/ping",
        f"field/north/7/drone/v2/{GATEWAY}",
        f"field/north/station/v1/{GATEWAY}",
        f"field/north/7/down/{STATION}\n",
    ],
)
def test_key_of_another_form_is_none(text: str) -> None:
    assert KEYS.parse(text) is None

"""A client's side of the extended parameter protocol."""

from __future__ import annotations

import struct
from typing import Any

from anafi_mav.mavlink import dialect
from support.mav import CAMERA, Client

CODES = {
    dialect.MAV_PARAM_EXT_TYPE_INT32: "i",
    dialect.MAV_PARAM_EXT_TYPE_UINT32: "I",
    dialect.MAV_PARAM_EXT_TYPE_REAL32: "f",
}
"""struct code by MAV_PARAM_EXT_TYPE: no other type is used."""

CHOICE = dialect.MAV_PARAM_EXT_TYPE_INT32
"""MAV_PARAM_EXT_TYPE of a setting with named options."""

FINAL = frozenset({dialect.PARAM_ACK_ACCEPTED, dialect.PARAM_ACK_VALUE_UNSUPPORTED, dialect.PARAM_ACK_FAILED})


def value_of(message: Any) -> float:
    """The value in a PARAM_EXT_VALUE or PARAM_EXT_ACK, from its bytes on the wire."""
    # Behind a header of 10 bytes: count and index in the first of the two, the name of 16 characters, the value.
    start = 30 if message.get_type() == "PARAM_EXT_VALUE" else 26
    field = bytes(message.get_msgbuf())[start : start + 4]
    (value,) = struct.unpack_from("<" + CODES[message.param_type], field)
    return float(value)


async def fetch(client: Client, timeout: float = 10.0) -> dict[str, Any]:
    """PARAM_EXT_REQUEST_LIST, until all have come: name -> PARAM_EXT_VALUE."""
    mark = client.mark()
    client.send(dialect.MAVLink_param_ext_request_list_message(1, CAMERA))
    last = await client.wait(
        "PARAM_EXT_VALUE", lambda m: m.param_index == m.param_count - 1, since=mark, timeout=timeout
    )
    found = {m.param_id: m for _, m in client.since(mark, "PARAM_EXT_VALUE")}
    assert len(found) == last.param_count
    return found


async def read(client: Client, name: str = "", index: int = -1) -> Any:
    """PARAM_EXT_REQUEST_READ by name or index."""
    mark = client.mark()
    client.send(dialect.MAVLink_param_ext_request_read_message(1, CAMERA, name.encode(), index))
    return await client.wait("PARAM_EXT_VALUE", lambda m: name in ("", m.param_id), since=mark)


def send_set(client: Client, name: str, value: float, kind: int) -> None:
    """PARAM_EXT_SET."""
    number = value if CODES[kind] == "f" else round(value)
    field = struct.pack("<" + CODES[kind], number).ljust(128, b"\0")
    client.send(dialect.MAVLink_param_ext_set_message(1, CAMERA, name.encode(), field, kind))


async def write(client: Client, name: str, value: float, kind: int) -> Any:
    """PARAM_EXT_SET, and its final PARAM_EXT_ACK."""
    mark = client.mark()
    send_set(client, name, value, kind)
    return await client.wait(
        "PARAM_EXT_ACK", lambda m: m.param_id == name and m.param_result in FINAL, since=mark, timeout=8.0
    )

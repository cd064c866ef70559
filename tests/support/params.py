"""A client's side of the parameter protocol, both encodings, fed with nothing but the messages."""

from __future__ import annotations

import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from support.mav import Client

CODES = {2: "b", 4: "h", 6: "i", 9: "f", 5: "I"}
"""struct code by MAV_PARAM_TYPE."""


def value_of(message: Any, flavour: str = "px4") -> float:
    """The value in a PARAM_VALUE, from its bytes on the wire."""
    raw = message.get_msgbuf()[10:14]  # the float field is the first of the payload, behind a header of 10 bytes
    code = CODES[message.param_type] if flavour == "px4" else "f"
    (value,) = struct.unpack_from("<" + code, raw)
    return float(value)


def carrier(value: float, kind: int, flavour: str = "px4") -> float:
    """The float field that carries a value."""
    if flavour != "px4":
        return value
    whole = CODES[kind] != "f"
    (field,) = struct.unpack("<f", struct.pack("<" + CODES[kind], int(value) if whole else value).ljust(4, b"\0"))
    return float(field)


async def fetch(client: Client, flavour: str = "px4", timeout: float = 10.0) -> dict[str, Any]:
    """PARAM_REQUEST_LIST, until all have come: name -> PARAM_VALUE."""
    mark = client.mark()
    client.send(dialect.MAVLink_param_request_list_message(1, 0))
    first = await client.wait("PARAM_VALUE", lambda m: m.param_index != 65535, since=mark, timeout=timeout)
    await client.wait("PARAM_VALUE", lambda m: m.param_index == first.param_count - 1, since=mark, timeout=timeout)
    return {m.param_id: m for _, m in client.since(mark, "PARAM_VALUE") if m.param_index != 65535}


async def read(client: Client, name: str) -> Any:
    """PARAM_REQUEST_READ by name."""
    mark = client.mark()
    client.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    return await client.wait("PARAM_VALUE", lambda m: m.param_id == name, since=mark)


def send_set(client: Client, name: str, value: float, kind: int, flavour: str = "px4") -> None:
    """PARAM_SET."""
    field = carrier(value, kind, flavour)
    client.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), field, kind))


async def write(
    client: Client, name: str, value: float, kind: int = 9, flavour: str = "px4", timeout: float = 5.0
) -> Any:
    """PARAM_SET, and the PARAM_VALUE of that name that follows."""
    mark = client.mark()
    send_set(client, name, value, kind, flavour)
    return await client.wait("PARAM_VALUE", lambda m: m.param_id == name, since=mark, timeout=timeout)

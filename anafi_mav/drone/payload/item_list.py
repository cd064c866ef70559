"""Lists of the drone's web server, of which the readable items count."""

from __future__ import annotations

from typing import Annotated, TypeVar

import msgspec

from anafi_mav.drone.rest import UNREADABLE
from anafi_mav.errors import RemoteProtocolError

MAX_ITEMS = 20_000
"""Items of a list: one of media has a thousand, and twice ten thousand fill `ANSWER_LIMIT`. Each unreadable item takes
microseconds, and the event loop, which controls all drones, waits for them."""

MAX_OBJECTS, MAX_VALUES = 160_000, 1_000_000
"""Objects and values of a whole list: the longest one of media has half of them. It is decoded in a few steps, in which
the event loop waits even for a thread. So a list is refused by the number of its brackets and commas, which takes
milliseconds, before it is decoded."""

T = TypeVar("T")

_PARTS = msgspec.json.Decoder(Annotated[list[msgspec.Raw], msgspec.Meta(max_length=MAX_ITEMS)])


def decode_items(body: bytes, decoder: msgspec.json.Decoder[T], what: str) -> tuple[list[T], int]:
    """Return the readable items of a JSON list, and the number of the others.

    `what` the items are, as "media". Raises `RemoteProtocolError` for what is no list, and for one that is too long.
    """
    if body.count(b"{") + body.count(b"[") > MAX_OBJECTS or body.count(b",") > MAX_VALUES:
        raise RemoteProtocolError(f"the drone's list of {what} is too long")
    try:
        parts = _PARTS.decode(body)
    except UNREADABLE as error:
        raise RemoteProtocolError(f"the drone's list of {what} is not readable: {error}") from error
    items = []
    for part in parts:
        try:
            items.append(decoder.decode(part))
        except UNREADABLE:
            continue
    return items, len(parts) - len(items)

"""A station that repeats what is not answered, as MAVLink's protocols want it: for links that lose frames."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

from support.ftp import ACK, BURST, OPEN, TERMINATE, Ftp, Reply, taken_apart
from support.mav import Client
from support.plans import REQUESTS, Item, send_count, send_item

EVERY = 1.0
"""s without an answer after which a message is sent again."""

ATTEMPTS = 8
"""With a tenth of the round trips lost, one of 10^8 gets no answer."""

PART = 239
"""Bytes of a file in one message."""


class Unanswered(AssertionError):
    """Every attempt was without an answer."""


async def command(client: Client, id: int, *params: float, **place: Any) -> tuple[Any, int]:
    """Send a command until its final COMMAND_ACK arrives; return it and the number of attempts."""
    mark = client.mark()
    for attempt in range(ATTEMPTS):
        client.send_command(id, *params, confirmation=attempt if "frame" not in place else 0, **place)
        ack = await _next(client, "COMMAND_ACK", lambda m: m.command == id and m.result != 5, mark)
        if ack is not None:
            return ack, attempt + 1
    raise Unanswered(f"command {id}")


async def upload(client: Client, items: Sequence[Item], kind: int) -> Any:
    """Upload a plan; return the MISSION_ACK that ends it."""
    mark = send_count(client, len(items), kind)
    last: int | None = None
    silent = 0
    while silent < ATTEMPTS:
        message = await _next(client, (*REQUESTS, "MISSION_ACK"), lambda m: m.mission_type == kind, mark)
        if message is None:
            silent += 1
            if last is None:
                send_count(client, len(items), kind)
            else:
                send_item(client, items[last], last, kind)
            continue
        silent = 0
        mark = next(i for i in range(mark, client.mark()) if client.received[i][1] is message) + 1
        if message.get_type() == "MISSION_ACK":
            return message
        last = message.seq
        send_item(client, items[message.seq], message.seq, kind)
    raise Unanswered("upload")


async def download(client: Client, path: str, component: int = 100) -> bytes:
    """Read a file by bursts; what a burst lost is read by another one."""
    ftp = Ftp(client, component=component)
    opened = await _request(ftp, OPEN, path.encode())
    (size,) = struct.unpack("<I", opened.data)
    parts: dict[int, bytes] = {}
    silent = 0
    while missing := [offset for offset in range(0, size, PART) if offset not in parts]:
        assert silent < ATTEMPTS, "no part of a burst arrives"
        mark = client.mark()
        ftp.send(BURST, session=opened.session, size=PART, offset=missing[0], seq=ftp.seq)
        silent += 1
        while (message := await _next(client, "FILE_TRANSFER_PROTOCOL", lambda m: True, mark)) is not None:
            mark = next(i for i in range(mark, client.mark()) if client.received[i][1] is message) + 1
            part = taken_apart(message)
            ftp.seq = part.seq + 1
            if part.req_opcode != BURST or part.opcode != ACK:
                break
            parts[part.offset] = part.data
            silent = 0
            if part.complete or part.offset + part.size >= size:
                break
    await _request(ftp, TERMINATE, session=opened.session)
    return b"".join(parts[offset] for offset in sorted(parts))


async def _request(ftp: Ftp, opcode: int, data: bytes = b"", **more: Any) -> Reply:
    seq = ftp.seq
    for _ in range(ATTEMPTS):
        try:
            reply = await ftp.ask(opcode, data, seq=seq, timeout=EVERY, **more)
        except AssertionError:
            continue
        assert reply.opcode == ACK, reply
        return reply
    raise Unanswered(f"file request {opcode}")


async def _next(client: Client, kind: str | tuple[str, ...], accept: Any, mark: int) -> Any:
    try:
        return await client.wait(kind, accept, since=mark, timeout=EVERY)
    except AssertionError:
        return None

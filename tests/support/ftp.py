"""A client's side of MAVLink FTP, fed with nothing but the messages."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from support.mav import Client

ACK, NAK = 128, 129
TERMINATE, RESET, LIST, OPEN, READ, REMOVE, BURST, CRC, LIST_TIMED = 1, 2, 3, 4, 5, 8, 15, 14, 16
FAIL, EOF, PROTECTED, NOT_FOUND, NO_SESSION, SESSIONS_FULL = 1, 6, 9, 10, 4, 5


ANSWER_LIMIT = 20.0
"""s until a test gives up: beside other processes the clock is everybody's, and the machine may be busy."""


class Reply(NamedTuple):
    """The payload of an answer."""

    seq: int
    session: int
    opcode: int
    size: int
    req_opcode: int
    complete: int
    offset: int
    data: bytes

    @property
    def error(self) -> int:
        assert self.opcode == NAK, self
        return self.data[0]


def taken_apart(message: Any) -> Reply:
    payload = bytes(message.payload)
    seq, session, opcode, size, req_opcode, complete, _, offset = struct.unpack_from("<HBBBBBBI", payload)
    return Reply(seq, session, opcode, size, req_opcode, complete, offset, payload[12 : 12 + size])


class Ftp:
    """One client's conversation."""

    def __init__(self, client: Client, sender: tuple[int, int] | None = None, component: int = 1) -> None:
        """`sender`: another system and component that speak over the same connection; `component`: whose files."""
        self.client = client
        self.component = component
        self.ids = sender or (client.sysid, client.compid)
        self.seq = 0
        self._out = dialect.MAVLink(None, *self.ids)

    def send(
        self, opcode: int, data: bytes = b"", *, session: int = 0, size: int | None = None, offset: int = 0, seq: int
    ) -> None:
        header = struct.pack("<HBBBBBBI", seq, session, opcode, len(data) if size is None else size, 0, 0, 0, offset)
        payload = (header + data).ljust(251, b"\0")
        message = dialect.MAVLink_file_transfer_protocol_message(0, 1, self.component, list(payload))
        self.client.send_raw(message.pack(self._out))

    async def ask(self, opcode: int, data: bytes = b"", *, timeout: float = ANSWER_LIMIT, **more: Any) -> Reply:
        """Send a request and wait for its answer, which has the next sequence number."""
        seq = more.pop("seq", self.seq)
        self.seq = seq + 2
        mark = self.client.mark()
        self.send(opcode, data, seq=seq, **more)
        message = await self.client.wait(
            "FILE_TRANSFER_PROTOCOL",
            lambda m: (taken_apart(m).seq, taken_apart(m).req_opcode) == (seq + 1 & 0xFFFF, opcode),
            since=mark,
            timeout=timeout,
        )
        assert (message.target_system, message.target_component) == self.ids
        assert message.get_srcComponent() == self.component
        return taken_apart(message)

    async def download(self, path: str, *, session: int = 0) -> bytes:
        """A whole file by bursts."""
        opened = await self.ask(OPEN, path.encode(), session=session)
        assert opened.opcode == ACK, opened
        (size,) = struct.unpack("<I", opened.data)
        content = b""
        while len(content) < size:
            mark, seq = self.client.mark(), self.seq
            self.send(BURST, session=opened.session, size=239, offset=len(content), seq=seq)
            while True:
                mark, part = await self._part(len(content), mark)
                assert part.opcode == ACK, part
                content += part.data
                self.seq = part.seq + 1
                if part.complete:
                    break
        assert (await self.ask(TERMINATE, session=opened.session)).opcode == ACK
        return content

    async def names(self, path: str) -> list[str]:
        """The lines of a directory, as the server sends them."""
        lines: list[str] = []
        while (reply := await self.ask(LIST, path.encode(), offset=len(lines))).opcode == ACK:
            lines += reply.data.decode().split("\0")[:-1]
        assert reply.error == EOF
        return lines

    async def _part(self, offset: int, mark: int) -> tuple[int, Reply]:
        """The part of a burst that begins at this offset, behind where it stands in what was received.

        Parts come in order: the next one stands later.
        """
        place = await self.client.place(
            "FILE_TRANSFER_PROTOCOL",
            lambda m: (taken_apart(m).req_opcode, taken_apart(m).offset) == (BURST, offset),
            since=mark,
            timeout=ANSWER_LIMIT,
        )
        return place, taken_apart(self.client.received[place][1])

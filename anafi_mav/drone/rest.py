"""Client of the drone's web server, which provides media and flight plans.

These are not available over ARSDK. A connection is open only during requests; `close` ends the remaining ones. A
drone that refuses is a `CommandRejected` with its status, one that does not answer a `CommandTimeout`, one that is
not reachable a `LinkLost`, and one that sends an invalid answer a `RemoteProtocolError`. Redirections are not
followed: all the drone's content is on the drone.
"""

from __future__ import annotations

import asyncio
import re
import socket
from collections.abc import AsyncGenerator, AsyncIterator, Mapping
from contextlib import aclosing, asynccontextmanager, suppress
from typing import Any, NamedTuple

import aiohttp
import msgspec

from anafi_mav.arsdk.link.interface import bind_to_interface
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, RemoteProtocolError
from anafi_mav.receive_buffer import read_after_clients

HTTP_PORT = 80
"""Of the drone's web server when nothing stands between."""

ANSWER_LIMIT = 1 << 24
"""Bytes of an answer that is read as a whole: the list of ten thousand media is a third of it."""

JSON_LIMIT = 1 << 20
"""Bytes of an answer that is decoded in the event loop, which controls all drones: the worst content takes 0.1 s. A
media with a thousand files is half of it."""

ANSWER_TIMEOUT = 10.0
"""s for an answer, and between two pieces of a file: the drone reads a slow card."""

WHOLE_TIMEOUT = 60.0
"""s for all of an answer that is read as a whole: the start of a mission waits for some. The longest list of media
takes half of it at 5 Mbit/s."""

CONNECTIONS = 8
"""At a time: two files, notifications, a list, a checksum and a flight plan, which must not wait for them."""

NOT_INDEXED = 541
"""Parrot's status for a question about media while there is no index yet (developer.parrot.com, media API)."""


NOT_FOUND = 404

UNAVAILABLE = 503
"""Status of a server that will answer later (RFC 9110 §15.6.4): of a gateway whose drone is not connected."""

PARTIAL = 206
"""Status of an answer with one range of a file (RFC 9110 §15.3.7)."""

UNREADABLE = (ValueError, RecursionError)
"""Errors of msgspec for what is no JSON: also `UnicodeDecodeError`, for a text in it that is no UTF-8."""

UNSIZED_LIMIT = 1 << 32
"""Bytes of a file whose size the drone does not report: no file on its card is larger (FAT32). A web server that sends
on for ever would fill the disk of the gateway."""

MUX_RANGE = 1 << 19
"""Bytes of a file that are requested at a time behind a Skycontroller's mux.

It passes on what the drone sends, whether it is read or not: a whole video would fill the gateway's memory, and the
radio of a flying drone.
"""

_CONTENT_RANGE = re.compile(r"bytes ([0-9]{1,18})-([0-9]{1,18})/([0-9]{1,18})")


class _Range(NamedTuple):
    """Bytes of a file in an answer."""

    start: int
    end: int | None
    """Behind the last byte; None: the rest of the file."""


class NotFound(CommandRejected):
    """The web server has no such thing (status 404)."""


class MediaNotIndexed(CommandRejected):
    """The drone has not indexed its media yet (status 541)."""

    def __init__(self) -> None:
        super().__init__("the drone has not indexed its media yet")


class Rest:
    """One drone's web server."""

    def __init__(
        self,
        address: str,
        port: int = HTTP_PORT,
        local_address: str | None = None,
        interface: str | None = None,
        prefix: str = "",
        token: str = "",
    ) -> None:
        """`prefix` of all paths, as "/drone/1" at a gateway of several drones.

        `token`: of a gateway that is open to the network.
        """
        self.address = address
        self._prefix = prefix
        self._headers = {"Authorization": f"Bearer {token}"} if token else None
        self.port = port
        self._local_address = local_address
        self._interface = interface
        self._is_behind_mux = False
        self._client: aiohttp.ClientSession | None = None

    @property
    def base(self) -> str:
        return f"http://{self.address}:{self.port}{self._prefix}"

    async def aim(self, address: str, port: int, *, is_behind_mux: bool = False) -> None:
        """Ask there from now on.

        `is_behind_mux`: the address is on this machine, where no interface has to be named, and leads through the mux
        of a Skycontroller.
        """
        await self.close()
        self.address, self.port, self._is_behind_mux = address, port, is_behind_mux

    async def close(self) -> None:
        """End everything that is open. Idempotent."""
        client, self._client = self._client, None
        if client is not None:
            await client.close()

    async def json(
        self,
        method: str,
        path: str,
        data: bytes | None = None,
        query: Mapping[str, str] | None = None,
        work: float = 0.0,
    ) -> Any:
        """Return the decoded answer to a request; None for an empty one. `work` as in `read`."""
        body = await self.read(method, path, data, query, JSON_LIMIT, work)
        if not body:
            return None
        try:
            return msgspec.json.decode(body)
        except UNREADABLE as error:
            raise RemoteProtocolError(f"{method} {path}: the drone answers no JSON: {error}") from error

    async def read(
        self,
        method: str,
        path: str,
        data: bytes | None = None,
        query: Mapping[str, str] | None = None,
        limit: int | None = None,
        work: float = 0.0,
    ) -> bytes:
        """Return the body of an answer of at most `limit` bytes; None: `ANSWER_LIMIT`.

        `work`: s that it may take longer. Raises `CommandTimeout` also for one that arrives bit by bit for longer than
        `WHOLE_TIMEOUT`.
        """
        limit = ANSWER_LIMIT if limit is None else limit
        silence = ANSWER_TIMEOUT + work
        timeout = aiohttp.ClientTimeout(total=WHOLE_TIMEOUT + work, sock_connect=ANSWER_TIMEOUT, sock_read=silence)
        pieces, size = [], 0
        async with self._request(method, path, data, query, timeout=timeout) as response:
            async for piece in response.content.iter_any():
                size += len(piece)
                if size > limit:
                    raise RemoteProtocolError(f"{method} {path}: the answer has more than {limit} bytes")
                pieces.append(piece)
        return b"".join(pieces)

    @asynccontextmanager
    async def open_file(self, path: str, offset: int, size: int) -> AsyncIterator[tuple[int, AsyncIterator[bytes]]]:
        """Open a file of `size` bytes (0: unknown) at `offset`; yield its start and its pieces.

        The answer begins at 0 when the web server has no ranges (RFC 9110 §14.2). Raises `RemoteProtocolError` when
        the file has another size by now, and at `UNSIZED_LIMIT`. The caller counts the bytes: an answer may end too
        early.
        """
        end = offset + MUX_RANGE if self._is_behind_mux and offset + MUX_RANGE < size else None
        async with self._open_range(path, offset, end, size) as (found, pieces):
            if not size:
                async with aclosing(_bounded(path, pieces)) as bounded:
                    yield found.start, bounded
            elif end is None or found.end is None:
                yield found.start, pieces
            else:
                async with aclosing(self._following_ranges(path, pieces, found.end, size)) as all_pieces:
                    yield found.start, all_pieces

    async def _following_ranges(
        self, path: str, pieces: AsyncIterator[bytes], offset: int, size: int
    ) -> AsyncGenerator[bytes, None]:
        """Yield the pieces of an open range, then those of the ranges behind it.

        Each of these is requested when it is read.
        """
        async for piece in pieces:
            yield piece
        while offset < size:
            async with self._open_range(path, offset, min(offset + MUX_RANGE, size), size) as (found, pieces):
                async for piece in pieces:
                    yield piece
            offset = size if found.end is None else found.end

    @asynccontextmanager
    async def _open_range(
        self, path: str, offset: int, end: int | None, size: int
    ) -> AsyncIterator[tuple[_Range, AsyncIterator[bytes]]]:
        """Open the bytes from `offset` to before `end`; yield what is answered.

        `end` None: the end of the file.
        """
        headers = None
        if offset or end is not None:
            last = "" if end is None else str(end - 1)
            headers = {"Range": f"bytes={offset}-{last}", "Accept-Encoding": "identity"}
        async with self._request("GET", path, headers=headers) as response:
            found, total = _Range(0, None), response.content_length
            if response.status == PARTIAL:
                part = _CONTENT_RANGE.fullmatch(response.headers.get("Content-Range", ""))
                if part is None or int(part[1]) != offset or int(part[2]) < offset:
                    raise RemoteProtocolError(f"GET {path}: not the range that begins at {offset}")
                found, total = _Range(offset, int(part[2]) + 1), int(part[3])
            if size and total is not None and total != size:
                raise RemoteProtocolError(f"GET {path}: expected {size} bytes, the file has {total}")
            yield found, response.content.iter_any()

    @asynccontextmanager
    async def _request(
        self,
        method: str,
        path: str,
        data: bytes | None = None,
        query: Mapping[str, str] | None = None,
        headers: Mapping[str, str] | None = None,
        timeout: aiohttp.ClientTimeout | None = None,
    ) -> AsyncIterator[aiohttp.ClientResponse]:
        if not path.startswith("/") or path.startswith("//"):
            raise RemoteProtocolError(f"{path!r} is no place on the drone")
        what = f"{method} {path}"
        options: dict[str, Any] = {} if timeout is None else {"timeout": timeout}  # else the session's
        with _Translated(what, self.base, timeout):
            async with self._session().request(
                method,
                self.base + path,
                data=data,
                params=query,
                headers=headers,
                allow_redirects=False,
                **options,
            ) as response:
                if response.status == UNAVAILABLE:
                    raise LinkLost(await _refusal(what, response))
                if response.status == NOT_INDEXED:
                    raise MediaNotIndexed
                if response.status == NOT_FOUND:
                    raise NotFound(await _refusal(what, response))
                if response.status >= 300:
                    raise CommandRejected(await _refusal(what, response))
                yield response

    @asynccontextmanager
    async def websocket(self, path: str, limit: int) -> AsyncIterator[aiohttp.ClientWebSocketResponse[Any]]:
        """Frames of at most `limit` bytes."""
        with _Translated(f"websocket {path}", self.base):
            connecting = self._session().ws_connect(self.base + path, max_msg_size=limit, heartbeat=ANSWER_TIMEOUT)
            async with await asyncio.wait_for(connecting, ANSWER_TIMEOUT) as opened:
                yield opened

    def _session(self) -> aiohttp.ClientSession:
        if self._client is None or self._client.closed:
            options: dict[str, Any] = {"limit_per_host": CONNECTIONS, "socket_factory": self._make_socket}
            if self._local_address is not None and not self._is_behind_mux:
                options["local_addr"] = (self._local_address, 0)
            timeout = aiohttp.ClientTimeout(total=None, sock_connect=ANSWER_TIMEOUT, sock_read=ANSWER_TIMEOUT)
            connector = aiohttp.TCPConnector(**options)
            self._client = aiohttp.ClientSession(connector=connector, timeout=timeout, headers=self._headers)
        return self._client

    def _make_socket(self, address: Any) -> socket.socket:
        family, kind, protocol, _, _ = address
        sock = socket.socket(family, kind, protocol)
        try:
            sock.setblocking(False)
            bind_to_interface(sock, None if self._is_behind_mux else self._interface)
            read_after_clients(sock)
        except BaseException:
            sock.close()
            raise
        return sock


async def _bounded(path: str, pieces: AsyncIterator[bytes]) -> AsyncGenerator[bytes, None]:
    """Yield pieces of a file of unknown size. Raises `RemoteProtocolError` at `UNSIZED_LIMIT`."""
    size = 0
    async for piece in pieces:
        size += len(piece)
        if size > UNSIZED_LIMIT:
            raise RemoteProtocolError(f"GET {path}: the file has no size, and more than {UNSIZED_LIMIT} bytes")
        yield piece


async def _refusal(what: str, response: aiohttp.ClientResponse) -> str:
    reason = ""
    with suppress(aiohttp.ClientError, asyncio.TimeoutError, AttributeError, *UNREADABLE):
        answer = msgspec.json.decode(await response.content.read(1 << 12))
        reason = f": {answer['error']}" if isinstance(answer, dict) and "error" in answer else ""
    # aiohttp keeps bytes of the status line that are no UTF-8 as halves of characters, which have no encoding.
    status = (response.reason or "").encode(errors="replace").decode()
    return f"{what}: HTTP {response.status} {status}".rstrip() + reason


class _Translated:
    """Errors of the web server, translated to ours."""

    def __init__(self, what: str, base: str, timeout: aiohttp.ClientTimeout | None = None) -> None:
        self._what = what
        self._base = base
        self._timeout = timeout

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, traceback: Any) -> None:
        if isinstance(error, CommandRejected | CommandTimeout | LinkLost | RemoteProtocolError):
            return
        if isinstance(error, asyncio.TimeoutError):
            raise CommandTimeout(self._what, self._limit_of(error)) from error
        if isinstance(error, aiohttp.ClientConnectionError | aiohttp.ClientPayloadError):  # also in mid-answer
            raise LinkLost(f"the drone's web server {self._base}: {error}") from error
        if isinstance(error, aiohttp.ClientError):
            raise RemoteProtocolError(f"{self._what}: {error}") from error

    def _limit_of(self, error: asyncio.TimeoutError) -> float:
        """Return the limit (s) that was exceeded: that of a silence, or that of the whole answer."""
        timeout = self._timeout or aiohttp.ClientTimeout(sock_read=ANSWER_TIMEOUT)
        exceeded = timeout.sock_read if isinstance(error, aiohttp.ServerTimeoutError) else timeout.total
        return ANSWER_TIMEOUT if exceeded is None else exceeded

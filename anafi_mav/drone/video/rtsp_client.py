"""One RTSP connection of a client: requests and their answers, and requests of the server.

A server that refuses is a `CommandRejected` with its status, one that does not answer a `CommandTimeout`, one that is
not reachable a `LinkLost`, and one that sends an invalid answer a `RemoteProtocolError`.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import Iterable

from anafi_mav.arsdk.link.interface import open_connection
from anafi_mav.arsdk.link.session import reason_of
from anafi_mav.arsdk.video import rtsp
from anafi_mav.arsdk.video.rtsp import MalformedRtsp, Response, RtspRequest, Status
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, RemoteProtocolError

log = logging.getLogger("anafi_mav")
message_log = logging.getLogger("anafi_mav.message")

ANSWER_TIMEOUT = 4.0
"""s for an answer (librtsp RTSP_CLIENT_DEFAULT_RESP_TIMEOUT_MS)."""

READ_SIZE = 1 << 14

MAX_WAITING = 1 << 16
"""Bytes that may wait for a server that does not read: hundreds of requests, of which we send one at a time."""

_POLITE = ("OPTIONS", "GET_PARAMETER", "ANNOUNCE", "TEARDOWN")
"""Methods that a server may request of its client; any other is answered "not implemented"."""


class RtspClient:
    """A connection; `connect` makes it."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.counters: Counter[str] = Counter()
        """Unexpected answers ("stray"), and the server's requests by method."""
        self.ended: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        """Done when the connection is over, or the server is done with us, with the reason."""
        self.here: str = writer.get_extra_info("sockname")[0]
        self.there: str = writer.get_extra_info("peername")[0]
        self.url = f"rtsp://{self.there}:{writer.get_extra_info('peername')[1]}"
        self._writer = writer
        self._number = 0
        self._asked: tuple[int, asyncio.Future[Response]] | None = None
        self._turn = asyncio.Lock()
        self._task = asyncio.create_task(self._read(reader))

    @classmethod
    async def connect(
        cls, address: str, port: int, *, local_address: str | None = None, interface: str | None = None
    ) -> RtspClient:
        """Raises `LinkLost`."""
        where = f"the drone's video server {address}:{port}"
        opening = open_connection(address, port, local_address=local_address, interface=interface)
        try:
            reader, writer = await asyncio.wait_for(opening, ANSWER_TIMEOUT)
        except asyncio.TimeoutError:
            raise LinkLost(f"{where}: no answer within {ANSWER_TIMEOUT:g} s") from None
        except LinkLost:
            raise
        except OSError as error:
            raise LinkLost(f"{where}: {reason_of(error)}") from error
        if None in (writer.get_extra_info("sockname"), writer.get_extra_info("peername")):
            writer.close()
            raise LinkLost(f"{where} closed the connection")
        return cls(reader, writer)

    async def ask(
        self, method: str, uri: str, headers: Iterable[tuple[str, str]] = (), timeout: float = ANSWER_TIMEOUT
    ) -> Response:
        """The answer to a request that was granted; one at a time. Raises as the module says."""
        async with self._turn:
            self._number += 1
            answer: asyncio.Future[Response] = asyncio.get_running_loop().create_future()
            if self.ended.done():
                raise LinkLost(self.ended.result())
            self._asked = self._number, answer
            try:
                self._send(RtspRequest(method, uri, (("CSeq", str(self._number)), *headers)))
                done, _ = await asyncio.wait({answer}, timeout=timeout)
            finally:
                self._asked = None
            if not done:
                raise CommandTimeout(f"RTSP {method}", timeout)
            response = answer.result()
        if response.status >= 300:
            raise CommandRejected(f"{method} {uri}: RTSP {response.status} {response.reason}".rstrip())
        return response

    async def close(self) -> None:
        """End the connection, whether the server reads what is left or not. Idempotent."""
        self._end(LinkLost("closed"))
        self._writer.transport.abort()
        self._task.cancel()
        await asyncio.wait({self._task})

    # -- inside

    def _send(self, message: rtsp.Message) -> None:
        if message_log.isEnabledFor(logging.DEBUG):
            message_log.debug("RTSP to %s: %r", self.there, message)
        self._writer.write(rtsp.encode(message))

    async def _read(self, reader: asyncio.StreamReader) -> None:
        messages = rtsp.MessageReader()
        try:
            while data := await reader.read(READ_SIZE):
                for event in messages.feed(data):
                    if message_log.isEnabledFor(logging.DEBUG):
                        message_log.debug("RTSP from %s: %r", self.there, event)
                    if isinstance(event, MalformedRtsp):
                        self._end(RemoteProtocolError(f"the drone's video server talks no RTSP: {event.reason}"))
                        return
                    if isinstance(event, Response):
                        self._answered(event)
                    elif isinstance(event, RtspRequest):
                        self._asks(event)
            self._end(LinkLost("the drone's video server closed the connection"))
        except OSError as error:
            self._end(LinkLost(f"the drone's video server: {reason_of(error)}"))

    def _answered(self, response: Response) -> None:
        if self._asked is None or response.cseq != self._asked[0] or self._asked[1].done():
            self.counters["stray"] += 1
        elif response.status >= 200:  # below: there is more to come
            self._asked[1].set_result(response)

    def _asks(self, request: RtspRequest) -> None:
        if self._writer.transport.get_write_buffer_size() > MAX_WAITING:
            self._end(RemoteProtocolError("the drone's video server asks and does not listen"))
            return
        known = request.method in _POLITE
        self.counters[request.method if known else "unknown request"] += 1
        headers = () if request.cseq is None else (("CSeq", str(request.cseq)),)
        self._send(Response(Status.OK if known else Status.NOT_IMPLEMENTED, headers))
        if request.method == "TEARDOWN" and not self.ended.done():
            self.ended.set_result("the drone ended the video")
        if request.method == "ANNOUNCE" and not self.ended.done():
            # What it shows has changed: a new DESCRIBE says how.
            self.ended.set_result("the drone changed the video")

    def _end(self, error: LinkLost | RemoteProtocolError) -> None:
        self._writer.close()
        if not self.ended.done():
            self.ended.set_result(str(error))
        if self._asked is not None and not self._asked[1].done():
            self._asked[1].set_exception(error)

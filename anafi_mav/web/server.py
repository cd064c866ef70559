"""The one HTTP server of the gateway, on aiohttp.

    server = HttpServer("127.0.0.1", 8088)
    server.add_get("/", page)
    await server.start()

`gateway` registers the routes before the start; a handler takes an `aiohttp.web.Request` and returns a response.

It is open to this computer only unless it is configured otherwise; a request to a server that is open to the network
needs the gateway's token. Even on this computer a web page of another site must not reach it through the user's
browser:

- The Host header has to be an IP address or a name of this gateway. A page whose own name was made to point to
  127.0.0.1 (DNS rebinding) sends that name.
- A request with an Origin has to come from a page of this server. A WebSocket knows no other protection.
- A request that a browser marks as made by another site (Sec-Fetch-Site) is refused: a picture in that site's page
  has no Origin, and would transfer a video over the radio of a flying drone. Links to the pages work.
- Responses permit no other page to embed or read them: no CORS, Cross-Origin-Resource-Policy, no frames.

A path with ".." is refused, and a handler looks names up in what it serves; it never joins them to a folder.
"""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import socket
from collections import Counter
from collections.abc import Awaitable, Callable, Collection
from typing import Final
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.typedefs import Handler
from aiohttp.web_protocol import RequestHandler

from anafi_mav.access_token import AccessToken
from anafi_mav.errors import ConfigError, LocalProtocolError
from anafi_mav.relay.uri_host import EVERY_ADDRESS, is_loopback, uri_host

log = logging.getLogger("anafi_mav.web")

DEFAULT_PORT = 8088
"""Where the configuration names none. 8080 is the simulated drones' and much else's."""

LOOPBACK_HOST = "127.0.0.1"

MAX_CONNECTIONS = 64
"""At a time. A browser opens six, a ground station one; each costs a file descriptor, which MAVLink needs too."""

MAX_BODY = 64 * 1024
"""Bytes of a request's body. The largest is an SDP offer of a browser, some 6 kB."""

FIRST_REQUEST_LIMIT = 10.0
"""s that a connection may stay without a complete request."""

BODY_LIMIT = 10.0
"""s from the headers of a request to the end of its body."""

LINGER_LIMIT = 1.0
"""s that a refused request may still send its body, so that its client can read the answer."""

STALL_LIMIT, STALL_PERIOD = 30.0, 1.0
"""s without reading after which a client's connection is closed, and s between two looks: a video that is paused
in a browser holds one of the two reads that a drone allows. Linux announces room in a full socket only when a third of
some 2.5 MB is free, so a client has to read 30 kB/s."""

KEEP_ALIVE = 30.0
"""s that a connection waits for its next request."""

CLOSE_LIMIT = 1.0
"""s that closing waits for running responses: the drones still have to be left in a hover."""

HEADERS: Final = {
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
"""Of every response."""

FOREIGN_SITES: Final = ("cross-site", "same-site")
"""Sec-Fetch-Site of another site, and of another port of this host (Fetch Metadata, W3C)."""

COOKIE, QUERY = "anafi_mav_token", "token"
"""Names under which a request has the token: of the cookie, and in the query of the first link."""

COOKIE_AGE = 30 * 24 * 3600
"""s that a browser keeps the cookie."""

NO_TOKEN = "token missing or wrong: open the link that `anafi-mav status --link` prints, or send it as Bearer\n"

RequestCallback = Callable[[web.Request], Awaitable[web.StreamResponse]]
"""Answers one request."""

_NO_HTTP = (HttpProcessingError, web.RequestPayloadError)


def _is_ours(record: logging.LogRecord) -> bool:
    """False for the log line of a request or body that is no HTTP: not an error of ours."""
    return record.exc_info is None or not isinstance(record.exc_info[1], _NO_HTTP)


log.addFilter(_is_ours)


class _Refusing(asyncio.Protocol):
    """A connection for which there is no room."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        transport.abort()


class HttpServer:
    """Routes, and the socket that serves them. `start` once, `close` once (twice does no harm)."""

    def __init__(
        self,
        host: str = LOOPBACK_HOST,
        port: int | None = None,
        *,
        names: Collection[str] = (),
        public_host: str | None = None,
    ) -> None:
        """`port` 0 is a free one; None is `DEFAULT_PORT`, or a free one where that is taken.

        `names` are host names of this gateway besides its own, as users write them in a URL. `public_host` stands in
        every URI of a server that is open to the network, as in the video server's.
        """
        self.host = host
        self.port = 0
        """TCP port while it is open, else 0."""
        self.refused_connections = 0
        """Connections closed because there were too many."""
        self.refused: Counter[str] = Counter()
        """Refused requests by reason: host, origin, site, token."""
        self.token: AccessToken | None = None
        """With one, each request needs it, also one of this computer: a reverse proxy makes all requests look like
        that. Set before `start`."""
        own = socket.gethostname().lower()
        self._names = {"localhost", own, f"{own}.local", host.lower(), *(name.lower() for name in names)}
        if public_host is not None:
            self._names.add(public_host.lower())
        self._public_host = public_host
        self._wanted_port = port
        self._app = web.Application(client_max_size=MAX_BODY, middlewares=[self._guard])
        self._app.on_response_prepare.append(_add_headers)
        self._runner: web.AppRunner | None = None
        self._server: asyncio.Server | None = None
        self._arriving: set[RequestHandler] = set()
        """Accepted connections that aiohttp counts from the next event-loop iteration on."""
        self._silent: set[RequestHandler] = set()
        """Connections of the last `FIRST_REQUEST_LIMIT` that have sent no request."""
        self._pages: set[str] = set()
        """Paths, with their placeholders, that a link of another site may open."""
        self._watcher: asyncio.Task[None] | None = None

    def add_get(self, path: str, handler: RequestCallback) -> None:
        """Serve GET and HEAD of a path, which may contain placeholders: "/media/{date}/{name}"."""
        self._app.router.add_get(path, handler)

    def add_page(self, path: str, handler: RequestCallback) -> None:
        """`add_get` for a page, which a link of another site may open."""
        resource = self._app.router.add_get(path, handler).resource
        assert resource is not None
        self._pages.add(resource.canonical)

    def add_post(self, path: str, handler: RequestCallback) -> None:
        """Serve POST of a path; the body is at most `MAX_BODY` long."""
        self._app.router.add_post(path, handler)

    def add_delete(self, path: str, handler: RequestCallback) -> None:
        """Serve DELETE of a path."""
        self._app.router.add_delete(path, handler)

    def on_close(self, callback: Callable[[], Awaitable[None]]) -> None:
        """Await `callback` before the connections are closed: it ends what would go on for ever."""

        async def close(_: web.Application) -> None:
            await callback()

        self._app.on_shutdown.append(close)

    async def start(self) -> None:
        """Open the port.

        Raises `ConfigError` at `http.port` or `http.host`; nothing is then left open.
        """
        runner = web.AppRunner(
            self._app,
            handle_signals=False,
            access_log=None,
            logger=log,
            keepalive_timeout=KEEP_ALIVE,
            lingering_time=LINGER_LIMIT,
            shutdown_timeout=CLOSE_LIMIT,
        )
        await runner.setup()
        self._runner = runner
        try:
            self._server = await self._listen()
        except OSError as error:
            await self.close()
            raise self._explain(error) from error
        except BaseException:
            await self.close()
            raise
        self.port = self._server.sockets[0].getsockname()[1]
        self._watcher = asyncio.create_task(self._end_stalled(runner), name="web")

    async def _listen(self) -> asyncio.Server:
        loop = asyncio.get_running_loop()
        port = DEFAULT_PORT if self._wanted_port is None else self._wanted_port
        try:
            return await loop.create_server(self._accept, self.host, port, family=socket.AF_INET)
        except OSError as error:
            if self._wanted_port is not None or error.errno != errno.EADDRINUSE:
                raise
        return await loop.create_server(self._accept, self.host, 0, family=socket.AF_INET)

    def _explain(self, error: OSError) -> ConfigError:
        place = f"{self.host}:{DEFAULT_PORT if self._wanted_port is None else self._wanted_port}"
        if error.errno == errno.EADDRINUSE:
            return ConfigError("http.port", f"{place} is in use by another program; expected a free port, or 0")
        if error.errno in (errno.EACCES, errno.EPERM):
            return ConfigError("http.port", f"this user may not open {place}; expected a port from 1024 to 65535")
        # asyncio of Python 3.13 has no number for an address of another computer.
        if isinstance(error, socket.gaierror) or error.errno in (errno.EADDRNOTAVAIL, None):
            return ConfigError("http.host", f"expected an address of this computer, got {self.host}")
        return ConfigError("http", f"cannot open {place}: {error.strerror or error}")

    async def close(self) -> None:
        """Close the port and every connection."""
        server, self._server = self._server, None
        runner, self._runner = self._runner, None
        self.port = 0
        watcher, self._watcher = self._watcher, None
        if watcher is not None:
            watcher.cancel()
            await asyncio.wait([watcher])
        if server is not None:
            server.close()
        if runner is not None:
            await runner.cleanup()

    def url_for(self, local_host: str | None, path: str) -> str | None:
        """Return the URL of a path for a client that sees this computer as `local_host`.

        None when such a client cannot reach it: the server is closed, open to this computer only, or its address
        towards the client is not known (`local_host` None).
        """
        if not path.startswith("/"):
            raise LocalProtocolError(f"expected a path from the root, got {path!r}")
        if not self.port:
            return None
        host = uri_host(self.host, local_host, self._public_host if self.is_open_to_network else None)
        return None if host is None else f"http://{host}:{self.port}{path}"

    @property
    def routes(self) -> list[tuple[str, str]]:
        """Method and path, with its placeholders, of everything that is served."""
        resources = ((route.method, route.resource) for route in self._app.router.routes())
        return [(method, resource.canonical) for method, resource in resources if resource is not None]

    @property
    def connections(self) -> int:
        """Number of open connections."""
        server = self._runner.server if self._runner is not None else None
        return 0 if server is None else len(server.connections)

    @property
    def is_open_to_network(self) -> bool:
        """True when other computers can connect."""
        return not is_loopback(self.host)

    def describe(self) -> str:
        """One line for people: the URL on this computer."""
        return f"http://{LOOPBACK_HOST if self.host == EVERY_ADDRESS else self.host}:{self.port}/"

    # -- connections

    def _accept(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        server = self._runner.server if self._runner is not None else None
        if server is None or len(self._arriving.union(server.connections)) >= MAX_CONNECTIONS:
            self.refused_connections += 1
            return _Refusing()
        connection = server()
        # asyncio accepts a backlog of connections in one iteration, and reports each to aiohttp in the next.
        self._arriving.add(connection)
        self._silent.add(connection)
        loop = asyncio.get_running_loop()
        loop.call_soon(self._arriving.discard, connection)
        loop.call_later(FIRST_REQUEST_LIMIT, self._end_silent, connection)
        return connection

    def _end_silent(self, connection: RequestHandler) -> None:
        if connection in self._silent:
            self._silent.discard(connection)
            connection.force_close()

    async def _end_stalled(self, runner: web.AppRunner) -> None:
        """Abort the connections of clients that do not read what is sent."""
        loop = asyncio.get_running_loop()
        stalls: dict[asyncio.Transport, tuple[int, float]] = {}
        """Bytes that wait for a client, and the time since when they have been so many."""
        while runner.server is not None:
            await asyncio.sleep(STALL_PERIOD)
            now = loop.time()
            # A connection that is being closed has no transport in its handler; those of the last look are kept.
            transports = {*stalls, *(handler.transport for handler in runner.server.connections)}
            former, stalls = stalls, {}
            for transport in transports:
                waiting = 0 if transport is None else transport.get_write_buffer_size()
                if transport is None or not waiting:
                    continue
                # While a client reads nothing, the handler waits and adds nothing.
                before, since = former.get(transport, (waiting, now))
                stalls[transport] = (waiting, since if before == waiting else now)
                if now - stalls[transport][1] >= STALL_LIMIT:
                    transport.abort()
                    del stalls[transport]

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse a request that a foreign page could have made a browser send."""
        self._silent.discard(request.protocol)
        host = request.headers.get("Host", "")
        if not self._is_own(host):
            self.refused["host"] += 1
            raise self._forbidden(f"{host[:100]!r} is no name of this gateway; use its address\n")
        origin = request.headers.get("Origin")
        if origin is not None and _place_of(origin) != host.lower():
            self.refused["origin"] += 1
            raise self._forbidden("a page of another server may not use this one\n")
        if request.headers.get("Sec-Fetch-Site") in FOREIGN_SITES and not self._is_link_to_page(request):
            self.refused["site"] += 1
            raise self._forbidden("a page of another server may not use this one\n")
        if self.token is not None:
            self._admit(request, self.token)
        if "\0" in request.path or ".." in request.path.replace("\\", "/").split("/"):
            raise web.HTTPNotFound
        if request.can_read_body:
            try:
                await asyncio.wait_for(request.read(), BODY_LIMIT)  # kept for the handler
            except asyncio.TimeoutError:
                raise _ending(web.HTTPRequestTimeout()) from None
            except (web.RequestPayloadError, ConnectionError) as error:
                # A body that is not in its encoding, or a client that has left: no error of ours.
                raise _ending(web.HTTPBadRequest(text="the body cannot be read\n")) from error
        return await handler(request)

    def _forbidden(self, reason: str) -> web.HTTPException:
        """Return a refusal; where a token is needed, it ends the connection."""
        refusal = web.HTTPForbidden(text=reason)
        return refusal if self.token is None else _ending(refusal)

    def _admit(self, request: web.Request, token: AccessToken) -> None:
        """Raise an answer, unless cookie or Authorization header have the token.

        The link to a page has it in its query once: the answer is the cookie, and the same page without the query.
        """
        if token.is_in(request.cookies.get(COOKIE), request.headers.get("Authorization")):
            return
        given, resource = request.query.get(QUERY), request.match_info.route.resource
        is_page = resource is not None and resource.canonical in self._pages
        if given is not None and is_page and token.equals(given):
            answer = web.HTTPSeeOther(request.path)
            answer.set_cookie(COOKIE, token.text, max_age=COOKIE_AGE, path="/", httponly=True, samesite="Lax")
            answer.headers["Cache-Control"] = "no-store"
            raise answer
        self.refused["token"] += 1
        refusal = web.HTTPUnauthorized(text=NO_TOKEN, headers={"WWW-Authenticate": 'Bearer realm="anafi-mav"'})
        raise _ending(refusal)  # its place is for those who have the token

    def _is_link_to_page(self, request: web.Request) -> bool:
        """True for a page that is opened as such, and not as a part of another one."""
        resource = request.match_info.route.resource
        is_opened = request.headers.get("Sec-Fetch-Mode") == "navigate"
        is_whole = request.headers.get("Sec-Fetch-Dest") == "document"
        return is_opened and is_whole and resource is not None and resource.canonical in self._pages

    def _is_own(self, host: str) -> bool:
        """True for the Host header of a client that knows this gateway."""
        try:
            name = urlsplit(f"//{host}").hostname
        except ValueError:
            return False
        return name is not None and (_is_address(name) or name.rstrip(".") in self._names)


def _ending(refusal: web.HTTPException) -> web.HTTPException:
    """Return an answer as one that ends its connection."""
    refusal.force_close()
    return refusal


async def _add_headers(request: web.Request, response: web.StreamResponse) -> None:
    for name, value in HEADERS.items():
        response.headers.setdefault(name, value)


def _place_of(origin: str) -> str | None:
    """Return host and port of an Origin header; None when it has none, as "null"."""
    try:
        return urlsplit(origin).netloc.lower() or None
    except ValueError:
        return None


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True

"""A connection to the fabric for code of the event loop."""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import logging
import secrets
import ssl
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from anafi_mav.documents import open_file
from anafi_mav.fabric.arrivals import Arrival, ArrivalQueue, FabricSample, LinkChange, SampleQueue
from anafi_mav.fabric.keys import SESSION_BYTES, FabricKeys, session_text
from anafi_mav.fabric.settings import session_settings
from anafi_mav.mavlink.base import EndpointUrl

if TYPE_CHECKING:
    from anafi_mav.fabric.zenoh_session import ZenohSession

logger = logging.getLogger(__name__)

MISSING = "the fabric needs eclipse-zenoh: pip install 'anafi-mav[fabric]'"

MAX_QUEUED = 2048
"""Samples that may wait to be published: half a second of 20 drones with 60 messages a second each for three
stations. Telemetry that waits longer is history."""

MAX_TAKEN = 100
"""Reports handled in one event-loop iteration: the drones' links are served between them."""

OPEN_LIMIT = 5.0
"""s to open a listening address."""

CLOSE_LIMIT = 3.0
"""s to close a session. It is left alone after that."""


def check_readable(path: str) -> None:
    """Raise `OSError` for a file that cannot be read, which zenoh does not say."""
    try:
        open_file(Path(path)).close()
    except (OSError, ValueError) as error:
        raise OSError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def check_certificates(ca: str | None, certificate: str | None, private_key: str | None) -> None:
    """Raise `OSError` for files that are no certificate or key.

    zenoh's only report of them is that the router does not answer.
    """
    for path in (ca, certificate):
        if path is not None and not _accepts(partial(ssl.SSLContext.load_verify_locations, cafile=path)):
            raise OSError(f"{path}: expected a certificate (PEM)")
    if certificate is not None and private_key is not None:
        # An empty password, or OpenSSL asks for that of an encrypted key at the terminal. zenoh reads none.
        pair = partial(ssl.SSLContext.load_cert_chain, certfile=certificate, keyfile=private_key, password="")
        if not _accepts(pair):
            raise OSError(f"{private_key}: expected the private key of {certificate} (PEM, without a password)")


def _accepts(load: Callable[[ssl.SSLContext], None]) -> bool:
    try:
        load(ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT))
    except (ssl.SSLError, ValueError):
        return False
    return True


class FabricConnection:
    """A zenoh session, its keys, and the queues to and from it. `open` once, `close` once."""

    def __init__(self, url: EndpointUrl, counters: Counter[str], receive: Callable[[Arrival], None]) -> None:
        """Create it, closed. The queues count into `counters`.

        `receive` is called in the event loop with each report of the session.
        """
        self.session = int.from_bytes(secrets.token_bytes(SESSION_BYTES), "big")
        """Of this process; another one after each start."""
        self.session_text = session_text(self.session)
        self.keys = FabricKeys(url.options.prefix)
        self.is_up = False
        """True while there is a link to another zenoh program, or a listening address."""
        self.problem = "not tried yet"
        """Why there is no link."""
        self._url = url
        self._receive = receive
        self._loop = asyncio.get_running_loop()
        self._queue = SampleQueue(MAX_QUEUED, counters)
        self._arrivals = ArrivalQueue(self._wake, counters)
        self._zenoh: ZenohSession | None = None
        self._is_closed = False

    @property
    def zenoh(self) -> ZenohSession:
        """The session. Only after `open`."""
        assert self._zenoh is not None
        return self._zenoh

    async def open(self) -> None:
        """Begin to connect, or listen.

        Raises OSError without zenoh, or where the address cannot be listened on.
        """
        try:
            module = importlib.import_module("anafi_mav.fabric.zenoh_session")
        except ImportError as error:
            raise OSError(MISSING) from error
        options = self._url.options
        for file in (options.ca, options.certificate, options.private_key):
            if file is not None:
                check_readable(file)
        check_certificates(options.ca, options.certificate, options.private_key)
        if options.link == "udp":
            logger.warning("%s: udp repeats nothing that is lost: drones and stations may be seen late", self._url.text)
        self._zenoh = module.ZenohSession(
            session_settings(self._url),
            self._queue,
            self._arrivals.put,
            retries=not options.listen,
            is_lossy=options.link == "udp" and not options.listen,
        )
        assert self._zenoh is not None
        self._zenoh.start()
        if options.listen:
            await self._loop.run_in_executor(None, self._zenoh.opened.wait, OPEN_LIMIT)
            if self._zenoh.failure:
                raise OSError(self._zenoh.failure)

    async def close(self) -> None:
        """Close the session: its tokens end."""
        self._is_closed = True
        if self._zenoh is not None:
            self._zenoh.stop()
            await self._loop.run_in_executor(None, self._zenoh.ended.wait, CLOSE_LIMIT)

    def publish(self, key: str, payload: bytes, attachment: bytes = b"", *, is_urgent: bool = False) -> None:
        """Queue a sample to be published. `is_urgent`: a ping or pong."""
        self._queue.add_sample(FabricSample(key, payload, attachment), is_urgent=is_urgent)

    def _wake(self) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has been closed
            self._loop.call_soon_threadsafe(self._take)

    def _take(self) -> None:
        for arrival in self._arrivals.take(MAX_TAKEN):
            if self._is_closed:
                return
            if isinstance(arrival, LinkChange):
                self.is_up, self.problem = arrival.is_up, arrival.problem
                if not arrival.is_up:
                    self._queue.clear_samples()
            try:
                self._receive(arrival)
            except Exception:  # the others of this iteration count all the same
                logger.exception("%s: %s not handled", self._url.text, type(arrival).__name__)
        if self._arrivals.is_waiting:
            self._loop.call_soon(self._take)

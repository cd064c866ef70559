"""Base class of endpoints: the owner of a URL that opens channels.

`udp`, `tcp` and `serial_line` are the kinds. Endpoints are the only asyncio code of this room beside `node`, which is
their sink.
"""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import os
import re
import socket
import zlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from anafi_mav.clock import Alarm, Clock
from anafi_mav.endpoint_options import DEFAULTS, MAX_KEY_NAME, EndpointOptions
from anafi_mav.mavlink.byte_budget import ByteBudget
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import ReceivedFrame
from anafi_mav.mavlink.signing import Signing
from anafi_mav.receive_buffer import limit_reads

logger = logging.getLogger(__name__)

RETRY_FIRST, RETRY_LAST = 0.25, 4.0
"""s between attempts to open what the other side must provide: doubled from the first to the last. A ground station
that restarts is back at once, one that is away for the night costs four system calls a minute."""

WRITE_AHEAD = 16 * 1024
"""Bytes that asyncio may hold for a full socket before the channel's own queue, which knows what to drop, begins."""

QUEUE_S, MIN_QUEUE = 0.5, 2048
"""s of a byte budget that may wait in a channel: streams that left it later would be history. And bytes: a burst of
answers, however small the budget, not of streams."""

LEAVE_TOGETHER = 4 * 1024
"""Most bytes of a stream that are gathered within one event-loop iteration."""

INDIRECT = ("serial", "zenoh")
"""Schemes whose address does not limit who is at the other end: a line, and a router with links of its own."""

CANCEL_WAIT = 0.1
"""s until a task that has not ended is cancelled once more."""

CLOSE_WAIT = 1.0
"""s that closing waits for transports to say that they are closed."""


@dataclass(frozen=True)
class EndpointUrl:
    """A parsed URL."""

    text: str
    """As the user wrote it."""
    scheme: str
    place: str
    """Host name or address; the device of a serial line."""
    number: int
    """Port, 0 for any free one; the baud rate of a serial line."""
    options: EndpointOptions = DEFAULTS

    @property
    def is_loopback(self) -> bool:
        """True when only programs of this computer can be at the other end."""
        return self.scheme not in INDIRECT and self.is_loopback_address

    @property
    def is_loopback_address(self) -> bool:
        """True when its address is one of this computer that no other can reach."""
        try:
            return self.place.rstrip(".").lower() == "localhost" or is_loopback(self.place)
        except ValueError:
            return False

    @property
    def key_name(self) -> str:
        """Name of the endpoint's signing key.

        Without a configured one it is that of the file that SETUP_SIGNING makes.
        """
        if self.options.signing is not None:
            return self.options.signing
        name = re.sub(r"[^A-Za-z0-9_.-]+", "-", f"{self.scheme}-{self.place}-{self.number}")
        return name if len(name) <= MAX_KEY_NAME else f"{name[: MAX_KEY_NAME - 9]}-{zlib.crc32(name.encode()):08x}"


class Sink(Protocol):
    """Receiver of opened and closed channels and of the frames that arrive on them."""

    def opened(self, channel: Channel) -> None: ...

    def closed(self, channel: Channel) -> None: ...

    def proved(self, channel: Channel) -> None:
        """Serve the peer of this channel, which has proved to be at its address, as every other."""

    def received(self, channel: Channel, frames: list[ReceivedFrame], reached: Collection[int] | None = None) -> None:
        """Deliver frames, after `Channel.hear`.

        `reached`: the only systems of ours that they may reach; None: those of the channel.
        """

    def introduce(self, channel: Channel) -> None:
        """Send one heartbeat over a channel that is not open."""


class Endpoint(ABC):
    """One URL. `open` once, `close` once; between them it brings channels and takes them away."""

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        self.parsed = url
        self.counters: Counter[str] = Counter()
        """refused_peers, garbage_bytes and bad_checksums of senders that are no peer, reopened, send_errors."""
        self.signing: Signing | None = None
        """Its key, set before `open`; None where there is no place for keys."""
        self._sink = sink
        self._clock = clock

    @property
    def signing_note(self) -> str:
        """For the end of a line for people; empty while frames are not signed."""
        return f", signed with key {self.signing.name}" if self.signing is not None and self.signing.is_on else ""

    def _protect(self, channel: Channel) -> None:
        """Give a new channel the endpoint's key."""
        channel.is_local = self.parsed.is_loopback
        if self.signing is not None:
            channel.protect(self.signing)

    @property
    def url(self) -> str:
        """As in the configuration."""
        return self.parsed.text

    @property
    def shown_url(self) -> str:
        """As in the configuration, with the real port in place of 0."""
        if self.parsed.number or self.local_port is None:
            return self.url
        return re.sub(r":0+(?=\?|$)", f":{self.local_port}", self.url, count=1)

    @property
    def local_port(self) -> int | None:
        """The port that it listens on; None where it listens on none."""
        return None

    @abstractmethod
    async def open(self) -> None:
        """Begin.

        Raises OSError if what the URL asks of this machine cannot be had; nothing is then left open.
        """

    @abstractmethod
    async def close(self) -> None:
        """End every channel and release every socket."""

    async def problems(self) -> list[str]:
        """Return what keeps it from its work though it is open, once that is known."""
        return []

    @abstractmethod
    def describe(self) -> str:
        """One line for people: the URL and how it stands."""


class Outbox:
    """Sends the frames of one event-loop iteration together.

    A fleet's telemetry is thousands of small frames a second. At most `limit` bytes go at once; the frame that would
    exceed them begins the next lot. With a limit of 0 nothing is gathered: each frame leaves alone and at once. An
    answer to what has just been read does not wait for the next iteration: reading is done `with` the outbox, and at
    the end of that block everything leaves. With a `pause`, what follows a lot within that time (s) leaves at its end,
    or when the limit is reached.
    """

    def __init__(self, write: Callable[[bytes], None], limit: int, pause: float = 0.0) -> None:
        self._write = write
        self._limit = limit
        self._pause = pause
        self._frames: list[bytes] = []
        self._size = 0
        self._due: asyncio.Handle | None = None
        self._held = False
        self._next = 0.0
        """End of the pause after the last lot (s, loop time)."""

    def __enter__(self) -> None:
        self._held = True

    def __exit__(self, *_: object) -> None:
        self._held = False
        if self._frames:
            self.flush()

    def add(self, raw: bytes) -> None:
        """Add a frame that is to leave."""
        if self._frames and self._size + len(raw) <= self._limit:  # it leaves with those before
            self._frames.append(raw)
            self._size += len(raw)
        else:
            self.add_all((raw,))

    def add_all(self, frames: Sequence[bytes]) -> None:
        """Add frames that are to leave."""
        if not self._limit:
            for raw in frames:
                self._write(raw)
            return
        size = sum(map(len, frames))
        if self._size + size <= self._limit:
            self._frames += frames
            self._size += size
        else:
            for raw in frames:
                if self._size + len(raw) > self._limit and self._frames:
                    self._give()
                self._frames.append(raw)
                self._size += len(raw)
        if self._due is None and not self._held:
            loop = asyncio.get_running_loop()
            is_paused = self._pause > 0.0 and loop.time() < self._next
            self._due = loop.call_at(self._next, self.flush) if is_paused else loop.call_soon(self.flush)

    def flush(self) -> None:
        """Let everything leave now."""
        if self._due is not None:
            self._due.cancel()
            self._due = None
        if self._frames:
            self._give()

    def _give(self) -> None:
        frames, self._frames, self._size = self._frames, [], 0
        if self._pause:
            self._next = asyncio.get_running_loop().time() + self._pause
        self._write(frames[0] if len(frames) == 1 else b"".join(frames))


class Shaper:
    """Writes a channel's frames, and holds the channel back while its byte budget is spent.

    The channel then queues, as for any slow line, and drops streams before answers.
    """

    def __init__(self, write: Callable[[bytes], None], bytes_per_second: float) -> None:
        self.channel: Channel | None = None
        """Set right after the channel is made, which needs `write`."""
        self._write = write
        self._budget = ByteBudget(bytes_per_second)
        self._alarm = Alarm(self._resume)

    def write(self, raw: bytes) -> None:
        """Write a frame."""
        self._write(raw)
        assert self.channel is not None
        assert self.channel.pace is not None
        now = asyncio.get_running_loop().time()
        wait = self._budget.spend(len(raw), now)
        self.channel.pace.adjust(now)
        if wait:
            self.channel.pause(self)
            self._alarm.set(now + wait)

    def _resume(self) -> None:
        if self.channel is not None:
            self.channel.resume(self)


def shaped_channel(
    name: str,
    write: Callable[[bytes], None],
    options: EndpointOptions,
    *,
    write_all: Callable[[Sequence[bytes]], None] | None = None,
    datagrams: bool = False,
    line: float | None = None,
) -> Channel:
    """Return a channel that keeps to the byte budget of its options.

    `line`: bytes/s of the line that it leads to; None where that is not known.
    """
    rate = options.bytes_per_second if line is None else min(line, options.bytes_per_second or line)
    if rate is None:
        return Channel(name, write, write_all=write_all, options=options, datagrams=datagrams)
    shaper = Shaper(write, rate)
    shaper.channel = Channel(
        name,
        shaper.write,
        options=options,
        datagrams=datagrams,
        queue_bytes=max(MIN_QUEUE, round(rate * QUEUE_S)),
        stream_bytes=round(rate * QUEUE_S),
        bytes_per_second=rate,
    )
    return shaper.channel


class StreamPeer(asyncio.Protocol):
    """A byte stream to one peer: glue between an asyncio transport and a channel."""

    def __init__(
        self,
        url: EndpointUrl,
        name: str,
        sink: Sink,
        *,
        write_ahead: int = WRITE_AHEAD,
        line: float | None = None,
    ) -> None:
        self.lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._sink = sink
        self._write_ahead = write_ahead
        self._transport: asyncio.Transport | None = None
        self._outbox = Outbox(self._write, min(LEAVE_TOGETHER, write_ahead))
        self.channel = shaped_channel(name, self._outbox.add, url.options, write_all=self._outbox.add_all, line=line)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # Duck-typed by pyserial-asyncio-fast's transport, too.
        assert hasattr(transport, "set_write_buffer_limits")
        self._transport = transport  # type: ignore[assignment]
        self.channel.local_host = seen_host(transport.get_extra_info("sockname"), transport.get_extra_info("peername"))
        transport.set_write_buffer_limits(high=self._write_ahead)
        limit_reads(transport)
        self._sink.opened(self.channel)

    def data_received(self, data: bytes) -> None:
        frames = self.channel.receive(data)
        with self._outbox:
            self._sink.received(self.channel, frames)

    def pause_writing(self) -> None:
        self.channel.pause()

    def resume_writing(self) -> None:
        self.channel.resume()

    def connection_lost(self, error: Exception | None) -> None:
        if error is not None:
            logger.debug("%s: %s", self.channel.name, error)
        self.channel.close()
        self._sink.closed(self.channel)
        if not self.lost.done():
            self.lost.set_result(None)

    def abort(self) -> None:
        """Close without waiting for what is still buffered."""
        self._outbox.flush()
        if self._transport is not None and not self._transport.is_closing():
            self._transport.abort()

    def _write(self, raw: bytes) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(raw)


def reason(error: Exception) -> str:
    """Return an operating system's error text without asyncio's and pyserial's additions."""
    number = getattr(error, "errno", None)
    # Name resolution numbers its errors below 0 and has its own text.
    return os.strerror(number) if number is not None and number > 0 else getattr(error, "strerror", "") or str(error)


def seen_host(own: Any, peer: Any) -> str | None:
    """Return this computer's address as a peer sees it, from the two socket addresses.

    A loopback address for a peer on this computer; None where there are no addresses.
    """
    if not own or not peer or isinstance(own, str) or isinstance(peer, str):
        return None
    here, there = str(own[0]).partition("%")[0], str(peer[0]).partition("%")[0]
    if here != there:
        return here
    return here if ipaddress.ip_address(here).is_loopback else "127.0.0.1"


def routed_host(peer: Any) -> str | None:
    """Return this computer's address as a peer sees it, by the route to it. Nothing is sent."""
    family = socket.AF_INET6 if ":" in str(peer[0]) else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect(peer)
            return seen_host(probe.getsockname(), peer)
    except OSError:
        return None


def is_loopback(host: str) -> bool:
    """Return True for an address of this computer that no other can send from."""
    address = ipaddress.ip_address(host.partition("%")[0])
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return (mapped or address).is_loopback


async def close_peers(peers: Iterable[StreamPeer]) -> None:
    """Abort these streams and wait, for a moment, until they are gone."""
    peers = list(peers)
    for peer in peers:
        peer.abort()
    if peers:
        await asyncio.wait([peer.lost for peer in peers], timeout=CLOSE_WAIT)


UNTRIED = "not tried yet"


class Reopening(Endpoint):
    """An endpoint with at most one stream, opened again whenever it ends."""

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._peer: StreamPeer | None = None
        self._problem = UNTRIED
        self._task: asyncio.Task[None] | None = None

    @abstractmethod
    async def _connect(self) -> StreamPeer:
        """One attempt. Raises OSError."""

    async def open(self) -> None:
        self._task = asyncio.get_running_loop().create_task(self._keep_open())

    async def close(self) -> None:
        if self._task is not None:
            # Before Python 3.12 wait_for forgets a cancellation that comes when what it waits for is just done.
            while not self._task.done():
                self._task.cancel()
                await asyncio.wait([self._task], timeout=CANCEL_WAIT)
            self._task = None
        if self._peer is not None:
            await close_peers([self._peer])
            self._peer = None

    def describe(self) -> str:
        if self._peer is not None:
            return f"{self.url}: connected"
        return f"{self.url}: not connected ({self._problem}), retrying"

    async def _keep_open(self) -> None:
        pause = RETRY_FIRST
        while True:
            begun = self._clock.monotonic()
            if self._peer is None:
                try:
                    self._peer = await self._connect()
                except OSError as error:
                    self._note(reason(error))
            if self._peer is not None:
                # As loud as the loss that it ends.
                logger.log(logging.WARNING if self._problem != UNTRIED else logging.INFO, "%s: connected", self.url)
                self._problem = ""
                await asyncio.shield(self._peer.lost)
                self._peer = None
                self._note("the connection ended")
                # Who lets us in and hangs up at once is no better than who does not let us in.
                if self._clock.monotonic() - begun > RETRY_LAST:
                    pause = RETRY_FIRST
            await asyncio.sleep(pause)
            pause = min(2 * pause, RETRY_LAST)
            self.counters["reopened"] += 1

    def _note(self, problem: str) -> None:
        if problem != self._problem:
            logger.warning("%s: %s", self.url, problem)
        self._problem = problem

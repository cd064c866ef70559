"""The asyncio shell around one `Transport`: a UDP socket and one timer.

Messages that are sent within one event-loop iteration leave together, which packs them into few frames, unless they are
sent `at_once`. The timer is restarted only when the next deadline is earlier; when it fires too early it is set again.
At a hundred drones with a hundred events a second each, that is what keeps the loop idle.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias, cast

from typing_extensions import assert_never

from anafi_mav.arsdk.codec.wire import Message, Received, UnknownMessage, unpacked
from anafi_mav.arsdk.link.transport import (
    Delivered,
    Event,
    Garbage,
    LinkDown,
    Rank,
    ReceivedMessages,
    Silent,
    Speaks,
    Transport,
    Undelivered,
)
from anafi_mav.clock import RoundTrip
from anafi_mav.receive_buffer import limit_reads, read_after_clients, read_waiting

log = logging.getLogger("anafi_mav.arsdk")
raw_log = logging.getLogger("anafi_mav.raw")

OnMessage: TypeAlias = Callable[[Message | UnknownMessage, float], None]
"""Called with each message and the loop time of its arrival."""

OnMessages: TypeAlias = Callable[[Sequence[Received], float], None]
"""Called with the messages of a frame and the loop time of their arrival."""

Air: TypeAlias = Callable[[bytes, bool, Callable[[bytes], None]], None]
"""Called with each datagram, whether it came in, and what hands it on, which may be called later, twice or never."""

STALL_PAUSE = 0.01
"""s between two questions to a guard that does not let datagrams leave."""

LOOK_AFTER = 8
"""Datagrams after which one looks whether more wait. A look takes 2 us, which is much at a hundred drones."""

SOCKET_BUFFER = 1 << 18
"""Bytes the kernel may hold for us while the loop is busy: some seconds of a drone's telemetry."""


def reason_of(error: OSError) -> str:
    """The system's own words for an error; asyncio hides them behind "Connect call failed"."""
    return os.strerror(error.errno) if error.errno is not None and error.errno > 0 else error.strerror or str(error)


class SendGuard(Protocol):
    """Interface of what may delay the datagrams of a session."""

    def may_send(self) -> bool:
        """Return False while no datagram may leave."""

    def sent(self) -> None:
        """Note that datagrams have left."""


class Session(asyncio.DatagramProtocol):
    """One ARSDK connection over UDP. `open` makes one from a transport and a bound socket.

    `peer` is for a socket that is not connected: where datagrams go, and the only source that is heard. Messages arrive
    at `on_message`, one at a time; an exception in it is reported to the loop's exception handler and does not cost the
    messages behind it. A receiver of many values sets `on_messages` in its place.
    """

    def __init__(self, transport: Transport, on_message: OnMessage, peer: tuple[str, int] | None = None) -> None:
        self._loop = asyncio.get_running_loop()
        self._transport = transport
        self.on_message = on_message
        self.on_messages: OnMessages | None = None
        self.mute = False
        """True: everything is dropped, both ways, as if the air were gone (faults of the simulator)."""
        self.air: Air | None = None
        """Simulated faults of datagrams on their way; None: none."""
        self.lost: asyncio.Future[str] = self._loop.create_future()
        """Done when the link is down or closed; its result says why."""
        self._peer = peer
        self.on_delivered: Callable[[int, bool], None] = lambda token, arrived: None
        """Callback with the result of each acknowledged command.

        Arguments: the token of `send`; True when received, False when dropped after all retries (version 1).
        """
        self.on_silent: Callable[[str], None] = lambda reason: None
        """Called when the peer is not heard any more.

        Nothing but answers, and what is sent `unheard`, leaves until it speaks.
        """
        self.on_speaks: Callable[[], None] = lambda: None
        """Called when it is heard again, before its messages."""
        self._endpoint: asyncio.DatagramTransport | None = None
        self._closed = asyncio.Event()
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = float("inf")
        self._flush_due = False
        self._until_look = LOOK_AFTER
        self._is_reading = False
        self._after_read: list[Callable[[], None]] = []
        self._congested = False
        self._guard: SendGuard | None = None

    async def open(self, sock: socket.socket) -> None:
        """Begin on this bound socket, which belongs to the session from now on."""
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BUFFER)
        read_after_clients(sock)
        await self._loop.create_datagram_endpoint(lambda: self, sock=sock)
        self._flush()

    @property
    def address(self) -> tuple[str, int]:
        """Our own UDP address, once open."""
        assert self._endpoint is not None
        ip, port = self._endpoint.get_extra_info("sockname")
        return ip, port

    @property
    def version(self) -> int:
        """Negotiated protocol version."""
        return self._transport.version

    @property
    def last_received(self) -> float:
        """Loop time at which the peer was heard last; the beginning of the session if never."""
        return self._transport.last_received

    @property
    def has_received(self) -> bool:
        """True once the peer has sent anything but acknowledgements and pings."""
        return self._transport.has_received

    @property
    def round_trip(self) -> RoundTrip:
        """Measured while sticks are sent."""
        return self._transport.round_trip

    @property
    def silent(self) -> bool:
        """The peer is not heard, and commands are dropped."""
        return self._transport.silent

    @property
    def counters(self) -> Counter[str]:
        """See `Transport.counters`."""
        return self._transport.counters

    def send(
        self,
        message: Message | UnknownMessage,
        rank: Rank = Rank.NORMAL,
        *,
        at_once: bool = False,
        unheard: float = 0.0,
    ) -> int:
        """Send a message at the end of this event-loop iteration; the token is for `cancel`.

        `at_once`: it leaves now with all that waits, or when the messages that are read together are handled.
        `unheard`: see `Transport.send`.

        Raises `LocalProtocolError` when it cannot be encoded. On a link that is lost it does nothing.
        """
        token = self._transport.send(message, self._loop.time(), rank, unheard=unheard)
        if at_once and not self._is_reading:
            self._flush()
        else:
            self._flush_soon()
        return token

    def flush(self) -> None:
        """Send all that waits: now, or when the messages that are read together are handled."""
        if not self._is_reading:
            self._flush()

    def cancel(self, token: int) -> None:
        """See `Transport.cancel`: the message is not sent (again)."""
        self._transport.cancel(token)
        self._flush_soon()

    def after_read(self, call: Callable[[], None]) -> None:
        """Call a function when the messages that are read together are handled.

        Soon, if none are being read. What the messages were about is in the processor's caches then, and no longer
        after the datagrams of many other drones.
        """
        if self._is_reading:
            self._after_read.append(call)
        else:
            self._loop.call_soon(call)

    async def close(self) -> None:
        """Send what is queued, once, then end the session and free its port. Idempotent."""
        self._flush()
        self.end("closed")
        if self._endpoint is not None:
            await self._closed.wait()

    def end(self, reason: str) -> None:
        """End at once: nothing is sent or received any more, `lost` is done with this reason.

        Idempotent.
        """
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._endpoint is not None:
            self._endpoint.abort()
        if not self.lost.done():
            self.lost.set_result(reason)

    # -- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        limit_reads(transport)
        self._endpoint = cast(asyncio.DatagramTransport, transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self._closed.set()
        self.end("closed" if exc is None else f"UDP socket failed: {exc}")

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._is_reading = True
        try:
            self._receive(data, addr)
            self._until_look -= 1
            if self._until_look == 0:
                self._until_look = LOOK_AFTER
                read_waiting(self._endpoint, self._receive, self.error_received)
        finally:
            self._is_reading = False
        if self._after_read:
            self._call_after_read()

    def _read_waiting(self) -> None:
        """Read what waits in the socket."""
        self._is_reading = True
        try:
            read_waiting(self._endpoint, self._receive, self.error_received)
        finally:
            self._is_reading = False
        if self._after_read:
            self._call_after_read()

    def _call_after_read(self) -> None:
        calls, self._after_read = self._after_read, []
        for call in calls:
            try:
                call()
            except Exception as error:
                self._loop.call_exception_handler({"message": f"{call!r} failed", "exception": error, "protocol": self})

    def _receive(self, data: bytes, addr: tuple[str, int]) -> None:
        if self.mute or self.lost.done():
            return
        if self._peer is not None and addr != self._peer:
            self._transport.counters["foreign"] += 1
            return
        if raw_log.isEnabledFor(logging.DEBUG):
            raw_log.debug("%s > %s", addr, data.hex())
        if self.air is None:
            self._take(data)
        else:
            self.air(data, True, self._take)

    def _take(self, data: bytes) -> None:
        if self.mute or self.lost.done():
            return
        now = self._loop.time()
        # Whatever the receivers send leaves in the flush below.
        self._flush_due = True
        self._handle(self._transport.receive(data, now), now)
        self._flush()

    def error_received(self, exc: Exception) -> None:
        # ICMP "port unreachable" on a connected socket: the port is closed. libarsdk ends the link on it too.
        if isinstance(exc, ConnectionRefusedError):
            self.end("the drone's UDP port is closed")
        else:
            log.debug("UDP error: %s", exc)

    def pause_writing(self) -> None:
        # The network takes nothing and asyncio's buffer is full: telemetry that waits is telemetry that is old.
        self._congested = True

    def resume_writing(self) -> None:
        self._congested = False

    # -- inside

    def _handle(self, events: list[Event], now: float) -> None:
        for event in events:
            if self.lost.done():
                return
            if type(event) is ReceivedMessages:  # nearly all
                (self.on_messages or self._hand_on)(event.messages, now)
                continue
            match event:
                case ReceivedMessages():
                    pass
                case Delivered(token):
                    self.on_delivered(token, True)
                case Undelivered(token, reason):
                    self.on_delivered(token, False)
                    log.debug("message %d undelivered: %s", token, reason)
                case Garbage(reason):
                    log.debug("unreadable bytes from the peer: %s", reason)
                case Silent(reason):
                    self.on_silent(reason)
                case Speaks():
                    self.on_speaks()
                case LinkDown(reason):
                    self.end(reason)
                case _:
                    assert_never(event)

    def _hand_on(self, messages: Sequence[Received], now: float) -> None:
        for message in unpacked(messages):
            if self.lost.done():
                return
            try:
                self.on_message(message, now)
            except Exception as error:
                self.report(error, message)

    def report(self, error: Exception, message: Message | UnknownMessage) -> None:
        """Report to the loop's exception handler that a receiver failed on a message."""
        self._loop.call_exception_handler(
            {"message": f"receiver of {message!r} failed", "exception": error, "protocol": self}
        )

    def _flush_soon(self) -> None:
        if not self._flush_due:
            self._flush_due = True
            self._loop.call_soon(self._flush)

    def _flush(self) -> None:
        self._flush_due = False
        endpoint = self._endpoint
        if endpoint is None or self.lost.done():
            return
        guard = self._guard
        if guard is None and self._timer is not None and self._transport.is_idle:
            return  # nearly always after telemetry, which puts the next ping off
        if guard is not None and not guard.may_send():
            self._flush_due = True
            self._loop.call_later(STALL_PAUSE, self._flush)
            return
        for datagram in self._transport.outgoing(self._loop.time()):
            if self._congested:
                self.counters["dropped.congested"] += 1
            elif self.air is None:
                self._give(datagram)
            else:
                self.air(datagram, False, self._give)
        self._set_timer()
        if guard is not None:
            guard.sent()

    def _set_timer(self) -> None:
        deadline = self._transport.deadline()
        if deadline is not None and deadline < self._timer_at:
            if self._timer is not None:
                self._timer.cancel()
            self._timer_at = deadline
            self._timer = self._loop.call_at(deadline, self._expire)

    def _give(self, datagram: bytes) -> None:
        if not self.mute and self._endpoint is not None and not self.lost.done():
            self._endpoint.sendto(datagram, self._peer)

    def _expire(self) -> None:
        self._timer = None
        self._timer_at = float("inf")
        deadline = self._transport.deadline()
        if deadline is not None and deadline > self._loop.time():  # nearly always: telemetry puts the next ping off
            self._set_timer()
            return
        self._read_waiting()  # a busy event loop runs timers before it has read each socket: that is no silence
        if self.lost.done():
            return
        now = self._loop.time()
        self._flush_due = True
        self._handle(self._transport.expire(now), now)
        self._flush()

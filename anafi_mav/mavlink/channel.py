"""A channel: one remote peer on one endpoint. No I/O.

It has its own parser, sequence numbers and outgoing queue. The endpoint that owns it hands in bytes and takes frames
through `write`; it calls `pause` and `resume` when its socket is full and empty again. Sequence numbers are given
when
a frame leaves, so that they are contiguous for each sender whatever was dropped before.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import Packed, Parser, ReceivedFrame, frame, pack

QUEUE_BYTES = 64 * 1024
"""Bytes that may wait for a slow peer: some seconds of a small fleet. A serial line, being slow, gets less."""

FRAME_BYTES = 12
"""A version 2 frame has so much more than its payload (MAVLink serialization.md §mavlink2_packet_format)."""

_Waiting = tuple[Packed, int, int] | bytes
"""Entry of a queue: a message with its sender's system and component, or another system's finished frame."""


class Channel:
    """One remote peer. Sending never blocks and never raises for the peer's sake.

    When the queue is full, frames sent with `give_way` are dropped first: the next one of their kind replaces them.
    """

    def __init__(
        self,
        name: str,
        write: Callable[[bytes], None],
        *,
        flavour: str | None = None,
        datagrams: bool = False,
        queue_bytes: int = QUEUE_BYTES,
        bytes_per_second: float | None = None,
    ) -> None:
        self.name = name
        """For people: the endpoint's URL and, where it has several peers, which one."""
        self.flavour = flavour
        """The autopilot that clients of this endpoint want to see; None: as configured for all."""
        self.bytes_per_second = bytes_per_second
        """Capacity of the line, None when it is not limited."""
        self.local_host: str | None = None
        """This computer's address as the peer sees it, for the URIs that it is sent: a loopback address for a peer on
        this computer, None for a line without addresses."""
        self.counters: Counter[str] = Counter()
        """sent_frames, dropped_frames (queue full, or sent after the channel had closed)."""
        self.sent_bytes = 0
        self.received_bytes = 0
        self.dropped_bytes = 0
        self.is_open = True
        self.parser = Parser()
        self._write = write
        self._datagrams = datagrams
        self._queue_bytes = queue_bytes
        self._paused = False
        self._waiting_bytes = 0
        self._answers: deque[_Waiting] = deque()
        self._telemetry: deque[_Waiting] = deque()
        self._sequence: dict[tuple[int, int], int] = {}

    def __repr__(self) -> str:
        return f"<Channel {self.name}>"

    @property
    def ready(self) -> bool:
        """True when the peer takes frames now.

        A sender of many frames that can wait, waits for this.
        """
        return self.is_open and not self._paused

    def receive(self, data: bytes) -> list[ReceivedFrame]:
        """Return the frames in received bytes; the parser counts other bytes."""
        self.received_bytes += len(data)
        return self.parser.receive_datagram(data) if self._datagrams else self.parser.receive(data)

    @property
    def free(self) -> float:
        """The share of the outgoing queue that is free, 0..1."""
        return max(0.0, 1.0 - self._waiting_bytes / self._queue_bytes)

    def send(self, message: dialect.MAVLink_message, sysid: int, compid: int, *, give_way: bool = False) -> None:
        """Send as this system and component.

        Raises `LocalProtocolError` for a field that does not fit.
        """
        self.send_packed(pack(message), sysid, compid, give_way=give_way)

    def send_packed(self, packed: Packed, sysid: int, compid: int, *, give_way: bool = False) -> None:
        """Send a message that was packed already, for several channels at once."""
        if self.is_open and not self._paused:
            self._leave(packed, sysid, compid)
        else:
            self._wait((packed, sysid, compid), give_way)

    def forward(self, raw: bytes, *, give_way: bool = False) -> None:
        """Send another system's version 2 frame as it is."""
        if self.is_open and not self._paused:
            self._give(raw)
        else:
            self._wait(raw, give_way)

    def pause(self) -> None:
        """Queue frames from now on, because the peer accepts none at present.

        When the queue is full, the oldest frame that gives way is dropped first.
        """
        self._paused = True

    def resume(self) -> None:
        """The peer takes frames again. What gives way leaves last."""
        self._paused = False
        for queue in (self._answers, self._telemetry):
            while queue and not self._paused:  # a write may fill the socket again
                waiting = queue.popleft()
                self._waiting_bytes -= _size(waiting)
                if isinstance(waiting, bytes):
                    self._give(waiting)
                else:
                    self._leave(*waiting)

    def close(self) -> None:
        """The peer is gone. What waits is forgotten, what is still sent is counted and dropped."""
        self.is_open = False
        for waiting in (*self._answers, *self._telemetry):
            self._drop(waiting)
        self._answers.clear()
        self._telemetry.clear()
        self._waiting_bytes = 0

    def _leave(self, packed: Packed, sysid: int, compid: int) -> None:
        sender = (sysid, compid)
        sequence = self._sequence.get(sender, 0)
        self._sequence[sender] = (sequence + 1) & 0xFF
        self._give(frame(packed, sequence, sysid, compid))

    def _give(self, raw: bytes) -> None:
        self.counters["sent_frames"] += 1
        self.sent_bytes += len(raw)
        self._write(raw)

    def _wait(self, waiting: _Waiting, give_way: bool) -> None:
        if not self.is_open:
            self._drop(waiting)
            return
        (self._telemetry if give_way else self._answers).append(waiting)
        self._waiting_bytes += _size(waiting)
        while self._waiting_bytes > self._queue_bytes:
            oldest = (self._telemetry or self._answers).popleft()
            self._waiting_bytes -= _size(oldest)
            self._drop(oldest)

    def _drop(self, waiting: _Waiting) -> None:
        self.counters["dropped_frames"] += 1
        self.dropped_bytes += _size(waiting)


def _size(waiting: _Waiting) -> int:
    return len(waiting) if isinstance(waiting, bytes) else len(waiting[0].payload) + FRAME_BYTES


def total(channels: Iterable[Channel]) -> Counter[str]:
    """The sum of the counters of channels and their parsers."""
    result: Counter[str] = Counter()
    for channel in channels:
        result.update(channel.counters)
        result.update(channel.parser.counters)
    return result

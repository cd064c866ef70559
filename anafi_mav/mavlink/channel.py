"""A channel: one remote peer on one endpoint. No I/O.

It has its own parser, sequence numbers and outgoing queue. The endpoint that owns it hands in bytes and takes frames
through `write`; it calls `pause` and `resume` when its socket is full and empty again. Sequence numbers are given
when
a frame leaves, so that they are contiguous for each sender whatever was dropped before. Signatures are given then, too.
"""

from __future__ import annotations

from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterable, Sequence

from anafi_mav.endpoint_options import DEFAULTS, EndpointOptions
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import Access, MessageFilter
from anafi_mav.mavlink.address_proof import AddressProof
from anafi_mav.mavlink.byte_budget import StreamPace
from anafi_mav.mavlink.frames import (
    FRAME_BYTES,
    HEADER_2,
    SIGNATURE,
    SIGNED,
    Batch,
    Packed,
    Parser,
    ReceivedFrame,
    Verdict,
    frame,
    pack,
    with_flags,
)
from anafi_mav.mavlink.signing import Signing, Stream

QUEUE_BYTES = 64 * 1024
"""Bytes that may wait for a slow peer: some seconds of a small fleet. A serial line, being slow, gets less."""

MAX_HEARTBEATS = 512
"""Components whose newest heartbeat may wait: two of each of 250 systems. They need no more than 12 KB."""

_HEARTBEAT_ID = dialect.MAVLINK_MSG_ID_HEARTBEAT.to_bytes(3, "little")

_Waiting = tuple[Packed, int, int] | bytes
"""Entry of a queue: a message with its sender's system and component, or another system's finished frame."""


class Channel:
    """One remote peer. Sending never blocks and never raises for the peer's sake.

    When the queue is full, frames sent with `give_way` are dropped first: the next one of their kind replaces them. A
    heartbeat waits beside the queue until the next one of its component replaces it.
    """

    def __init__(
        self,
        name: str,
        write: Callable[[bytes], None],
        *,
        write_all: Callable[[Sequence[bytes]], None] | None = None,
        options: EndpointOptions = DEFAULTS,
        datagrams: bool = False,
        queue_bytes: int = QUEUE_BYTES,
        stream_bytes: int = QUEUE_BYTES,
        bytes_per_second: float | None = None,
    ) -> None:
        """Create it with a queue of `queue_bytes`.

        Frames that give way have `stream_bytes` of it, and at least one frame. `write` takes a frame; `write_all`,
        where there is one, several at once.
        """
        self.name = name
        """For people: the endpoint's URL and, where it has several peers, which one."""
        self.endpoint = name.partition(" from ")[0]
        """URL of the endpoint, which holds no space."""
        self.options = options
        """Those of its endpoint."""
        self.access = Access.of(options.access)
        self.system_ids = options.system_ids
        """The systems that it shows and that its peer reaches; None: all."""
        filtered = options.allow_messages or options.block_messages
        self.message_filter = MessageFilter(options) if filtered else None
        self.bytes_per_second = bytes_per_second
        """Byte budget, or capacity of the line; None when it is not limited."""
        self.pace = None if bytes_per_second is None else StreamPace(bytes_per_second)
        """How far the streams are slowed down to fit; None when it is not limited."""
        self.local_host: str | None = None
        """This computer's address as the peer sees it, for the URIs that it is sent: a loopback address for a peer on
        this computer, None for a line without addresses."""
        self.proof: AddressProof | None = None
        """While the peer has not proved to be at its address: what may be sent to it. None: everything."""
        self.when_proved: set[Callable[[], None]] = set()
        """Called by `prove`."""
        self._counters: Counter[str] = Counter()
        self.sent_frames = 0
        self.sent_bytes = 0
        self.received_bytes = 0
        self.dropped_bytes = 0
        self.heard_at: float | None = None
        """When its last frame arrived, s, monotonic; None: none has."""
        self.proved_at: float | None = None
        """When the last frame arrived that shows that its peer may be served: on a signed endpoint, a verified one."""
        self.is_unrestricted = self.access is Access.ALL and self.system_ids is None
        """True when every frame of its peer may reach all systems."""
        self.is_open = True
        self.is_local = False
        """True when only programs of this computer can be its peer."""
        self.ends_with_station = False
        """True when the channel closes as soon as its station is gone, and only then."""
        self.has_ages = False
        """True when its endpoint judges the age of each frame: none is dropped because the host stalled."""
        self.parser = Parser()
        self.signing: Signing | None = None
        """The key of the endpoint; None where there is no place for one."""
        self._link_id = 0
        """0 until the first frame is signed."""
        self._newest: dict[Stream, int] = {}
        """Newest timestamps that were verified."""
        self._write = write
        self._write_all = write_all
        self._datagrams = datagrams
        self._queue_bytes = queue_bytes
        self._stream_bytes = stream_bytes
        self._held_by: set[object] = set()
        """Why the peer takes no frames at present; empty while it does."""
        self._waiting_bytes = 0
        """In both queues."""
        self._answers: deque[_Waiting] = deque()
        self._telemetry: deque[_Waiting] = deque()
        self._telemetry_bytes = 0
        self._heartbeats: OrderedDict[tuple[int, int], _Waiting] = OrderedDict()
        """The newest of each component. They leave in turn with answers, and before streams."""
        self._heartbeat_left = False
        """True when the last frame that has waited was a heartbeat."""
        self._sequence: dict[tuple[int, int], int] = {}

    def __repr__(self) -> str:
        return f"<Channel {self.name}>"

    @property
    def counters(self) -> Counter[str]:
        """Return sent_frames and what else happened, by kind.

        dropped_frames (queue full, or sent after the channel had closed), refused_access (frames that need more than
        its access, also by name), refused_operator (of a station while another one is the operator, also by name),
        refused_forwards (from senders that the gateway does not sign for), refused_observer (what observers send to
        all, in the name of others, or to change a link of others), filtered_frames (forwarded frames that `systems` or
        a message filter keeps off), withheld_frames (the peer has not proved to be at its address).
        """
        if self.sent_frames:
            self._counters["sent_frames"] = self.sent_frames
        return self._counters

    def protect(self, signing: Signing) -> None:
        """Sign what is sent and verify what is received while `signing` is on."""
        self.signing = signing
        self.parser = Parser(self._judge)

    @property
    def is_signed(self) -> bool:
        """True while frames of this channel are signed and verified."""
        return self.signing is not None and self.signing.is_on

    def is_proved_by(self, frames: Iterable[ReceivedFrame]) -> bool:
        """Return True if the sender of these received frames may be served: one of them is verified.

        Without a key each frame is good enough.
        """
        is_signed = self.is_signed
        return any(not is_signed or received.verdict is Verdict.VERIFIED for received in frames)

    @property
    def ready(self) -> bool:
        """True when the peer takes frames now.

        A sender of many frames that can wait, waits for this.
        """
        return self.is_open and not self._held_by and self.proof is None

    def prove(self) -> None:
        """The peer has proved to be at its address."""
        self.proof = None
        for call in tuple(self.when_proved):
            call()

    def has_system(self, sysid: int) -> bool:
        """Return True for a system that the peer may see."""
        return self.system_ids is None or sysid in self.system_ids

    def can_stream(self, id: int) -> bool:
        """Return True for a message that may be streamed to the peer."""
        return self.message_filter is None or self.message_filter.passes(id)

    def hear(self, frames: Iterable[ReceivedFrame], now: float) -> None:
        """Note that frames have arrived."""
        self.heard_at = now
        if self.signing is None or not self.signing.is_on or self.is_proved_by(frames):
            self.proved_at = now

    def receive(self, data: bytes) -> list[ReceivedFrame]:
        """Return the frames in received bytes; the parser counts other bytes."""
        self.received_bytes += len(data)
        return self.parser.receive_datagram(data) if self._datagrams else self.parser.receive(data)

    @property
    def free(self) -> float:
        """The share of the outgoing queue that is free, 0..1."""
        return max(0.0, 1.0 - self._waiting_bytes / self._queue_bytes)

    def send(
        self,
        message: dialect.MAVLink_message,
        sysid: int,
        compid: int,
        *,
        give_way: bool = False,
        is_answer: bool = False,
    ) -> None:
        """Send as this system and component.

        Raises `LocalProtocolError` for a field that does not fit.
        """
        self.send_packed(pack(message), sysid, compid, give_way=give_way, is_answer=is_answer)

    def send_packed(
        self, packed: Packed, sysid: int, compid: int, *, give_way: bool = False, is_answer: bool = False
    ) -> None:
        """Send a message that was packed already, for several channels at once.

        `is_answer`: it is for this peer alone.
        """
        if self.proof is not None:
            if packed.id == dialect.MAVLINK_MSG_ID_HEARTBEAT:
                self.proof.heartbeat((sysid, compid), packed)
                self.send_heartbeats()
                return
            if not self._may_answer(len(packed.payload) + FRAME_BYTES, is_answer):
                return
        if self.pace is not None:
            overhead = FRAME_BYTES + SIGNATURE if self.is_signed else FRAME_BYTES
            self.pace.count(len(packed.payload) + overhead, is_stream=give_way)
        if self.is_open and not self._held_by:
            self._leave(packed, sysid, compid)
        else:
            self._wait((packed, sysid, compid), give_way)

    def send_batch(self, batch: Batch) -> None:
        """Send messages of streams, which give way.

        Together, where nothing distinguishes one frame from the next: neither a budget nor a queue nor a signature.
        """
        if (
            self._write_all is None
            or self.pace is not None
            or self.proof is not None
            or self._held_by
            or not self.is_open
            or (self.signing is not None and self.signing.is_on)
        ):
            for packed in batch.messages:
                self.send_packed(packed, batch.sysid, batch.compid, give_way=True)
            return
        sequence = self._sequence.get(batch.sender, 0)
        frames = batch.framed(sequence)
        self._sequence[batch.sender] = (sequence + len(frames)) & 0xFF
        self.sent_frames += len(frames)
        self.sent_bytes += batch.size
        self._write_all(frames)

    def send_heartbeats(self) -> None:
        """Send the heartbeats that wait, as far as a peer without proof may get them."""
        if self.proof is not None and self.is_open and not self._held_by:
            for (sysid, compid), packed in self.proof.heartbeats():
                self._leave(packed, sysid, compid)

    def prepare_forward(self, received: ReceivedFrame, source: Channel) -> bytes | None:
        """Return a frame from `source` as it may be forwarded here; None if it may not.

        A signature is valid for the endpoints with its key only. The gateway signs for senders that it has verified,
        and for programs of this computer.
        """
        raw = received.version_2()
        is_verified = received.verdict is Verdict.VERIFIED
        if is_verified and self.signing is source.signing:
            return raw
        if self.is_signed and not is_verified and not source.is_local:
            self.counters["refused_forwards"] += 1
            return None
        return with_flags(raw, 0) if is_verified or self.is_signed else raw

    def forward(self, raw: bytes, *, give_way: bool = False, is_answer: bool = False) -> None:
        """Send another system's version 2 frame. `is_answer`: it is for this peer alone.

        It keeps its signature; on a signed channel one without a signature gets ours.
        """
        if self.proof is not None and not self._may_answer(len(raw), is_answer):
            return
        if self.pace is not None:
            self.pace.count(len(raw), is_stream=give_way)
        if self.is_open and not self._held_by:
            self._pass_on(raw)
        else:
            self._wait(raw, give_way)

    def pause(self, by: object = None) -> None:
        """Queue frames from now on, because the peer accepts none at present.

        `by`: the reason; `resume` is called for each. When the queue is full, the oldest frame that gives way is
        dropped first.
        """
        self._held_by.add(by)

    def resume(self, by: object = None) -> None:
        """End a reason to queue; without another one the peer takes frames again.

        What gives way leaves last.
        """
        self._held_by.discard(by)
        while not self._held_by and (waiting := self._next()) is not None:  # a write may fill the socket again
            if isinstance(waiting, bytes):
                self._pass_on(waiting)
            else:
                self._leave(*waiting)

    def close(self) -> None:
        """The peer is gone. What waits is forgotten, what is still sent is counted and dropped."""
        self.is_open = False
        while (waiting := self._next()) is not None:
            self._drop(waiting)
        if self.signing is not None and self._link_id:
            self.signing.give_back_link_id(self._link_id)
            self._link_id = 0

    def _may_answer(self, size: int, is_answer: bool) -> bool:
        if self.proof is not None and is_answer and self.proof.answer(size):
            return True
        self.counters["withheld_frames"] += 1
        return False

    def _leave(self, packed: Packed, sysid: int, compid: int) -> None:
        sender = (sysid, compid)
        sequence = self._sequence.get(sender, 0)
        self._sequence[sender] = (sequence + 1) & 0xFF
        if self.signing is None or not self.signing.is_on:
            raw = frame(packed, sequence, sysid, compid)
        else:
            raw = self._signed(frame(packed, sequence, sysid, compid, SIGNED), is_own=True)
        self.sent_frames += 1
        self.sent_bytes += len(raw)
        self._write(raw)

    def _pass_on(self, raw: bytes) -> None:
        if self.is_signed and not raw[2] & SIGNED:
            raw = self._signed(with_flags(raw, SIGNED), is_own=False)
        self.sent_frames += 1
        self.sent_bytes += len(raw)
        self._write(raw)

    def _signed(self, raw: bytes, *, is_own: bool) -> bytes:
        assert self.signing is not None
        self._link_id = self._link_id or self.signing.take_link_id()
        return self.signing.sign(raw, self._link_id, is_own=is_own)

    def _judge(self, raw: bytes, id: int) -> Verdict:
        signing = self.signing
        if signing is None or not signing.is_on:
            return Verdict.UNCHECKED
        verdict = signing.judge(raw, id, self._newest)
        if verdict.is_refusal:
            signing.refused[verdict.value] += 1
            signing.last_refused = self.name
        return verdict

    def _wait(self, waiting: _Waiting, give_way: bool) -> None:
        if not self.is_open:
            self._drop(waiting)
            return
        if (source := _heartbeat_source(waiting)) is not None:
            if (older := self._heartbeats.get(source)) is not None:
                self._drop(older)
            self._heartbeats[source] = waiting  # in the turn of the older one
            if len(self._heartbeats) > MAX_HEARTBEATS:
                self._drop(self._heartbeats.popitem(last=False)[1])
            return
        (self._telemetry if give_way else self._answers).append(waiting)
        self._waiting_bytes += _size(waiting)
        self._telemetry_bytes += _size(waiting) if give_way else 0
        while self._telemetry_bytes > self._stream_bytes and len(self._telemetry) > 1:
            self._drop(self._oldest(self._telemetry))
        while self._waiting_bytes > self._queue_bytes:
            self._drop(self._oldest(self._telemetry or self._answers))

    def _next(self) -> _Waiting | None:
        """Remove and return the frame whose turn it is; None when none waits.

        Neither many heartbeats nor many answers hold the others back.
        """
        self._heartbeat_left = bool(self._heartbeats) and not (self._heartbeat_left and self._answers)
        if self._heartbeat_left:
            return self._heartbeats.popitem(last=False)[1]
        queue = self._answers or self._telemetry
        return self._oldest(queue) if queue else None

    def _oldest(self, queue: deque[_Waiting]) -> _Waiting:
        waiting = queue.popleft()
        self._waiting_bytes -= _size(waiting)
        self._telemetry_bytes -= _size(waiting) if queue is self._telemetry else 0
        return waiting

    def _drop(self, waiting: _Waiting) -> None:
        self.counters["dropped_frames"] += 1
        self.dropped_bytes += _size(waiting)


def _heartbeat_source(waiting: _Waiting) -> tuple[int, int] | None:
    """Return the system and component of a heartbeat; None for any other frame."""
    if isinstance(waiting, bytes):
        return (waiting[5], waiting[6]) if waiting[7:HEADER_2] == _HEARTBEAT_ID else None
    packed, sysid, compid = waiting
    return (sysid, compid) if packed.id == dialect.MAVLINK_MSG_ID_HEARTBEAT else None


def _size(waiting: _Waiting) -> int:
    return len(waiting) if isinstance(waiting, bytes) else len(waiting[0].payload) + FRAME_BYTES


def total(channels: Iterable[Channel]) -> Counter[str]:
    """The sum of the counters of channels and their parsers."""
    result: Counter[str] = Counter()
    for channel in channels:
        result.update(channel.counters)
        result.update(channel.parser.counters)
    return result

"""The ARSDK transport: queues, acknowledgements, retries and pings. No I/O.

It serves both ends of the link: the same object acts as controller or device; `Role` picks the queue ids.
The shell passes datagrams and the time to `receive`, sends what `outgoing` returns and calls `expire` at `deadline`.

Rules (arsdk-ng libarsdk/src/cmd_itf/arsdk_cmd_itf{1,2,3}.c and arsdk_transport.c):

- an acknowledged queue is stop-and-wait: one frame is in flight and is repeated with its sequence number until it
  is acknowledged; versions 2 and 3 repeat for ever, in version 1 a controller drops it after five repetitions;
- a receiver takes an unacknowledged frame when its sequence number is above the last one, or more than ten below it
  (a wrap, or a peer that restarted). DEVIATION: libarsdk has the same rule for acknowledged frames, and so takes a
  copy that is eleven frames late, or from before a wrap, for a new one; here the numbers of acknowledged frames, of
  which one is in flight, are compared around the wrap and what is behind is a copy. A copy is acknowledged too, since
  it is the acknowledgement that got lost;
- a side that has received nothing for a while pings; three pings without any answer end the link.
"""

from __future__ import annotations

import enum
import itertools
import math
import struct
from collections import Counter
from collections.abc import Sequence
from typing import TypeAlias

import msgspec

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Buffer, Message, MessageId, Received, UnknownMessage, receive
from anafi_mav.arsdk.link.frame import (
    PACK_LIMIT,
    VERSIONS,
    Frame,
    FrameType,
    Piece,
    Unpacker,
    Waiting,
    decode_frames,
    encode_frame,
    frame_type,
    longest_command,
    pack,
    with_length,
)
from anafi_mav.arsdk.link.known_frames import KnownFrames
from anafi_mav.clock import RoundTrip
from anafi_mav.errors import LocalProtocolError

PING, PONG = 0, 1
"""Queue ids of the link check (arsdk-ng libarsdk/src/arsdk_transport_ids.h, as all ids here)."""

ACK_OFFSET = 128
"""The acknowledgement of queue n travels as id n + 128."""

ACK_TIMEOUT = 0.15
"""s until a frame in flight is repeated (arsdk-ng libarsdkctrl/src/arsdk_device.c, ack_timeout_ms)."""

MAX_RETRIES_V1 = 5
"""Repetitions after which a version 1 controller gives a command up (same file, default_max_retry_count)."""

MEASURE_EVERY = 1.0
"""s between two pings of a controller whose unacknowledged commands, the sticks, are on their way.

The loops that fly by them have to know the delay of the link. libARNetwork pings all the time for that.
"""

MAX_UNANSWERED_PINGS = 3
"""arsdk-ng arsdk_transport.c, send_ping."""

RETRIED_FOR_EVER = frozenset(MessageId(*numbers) for numbers in [(0, 2, 0), (0, 4, 0), (1, 0, 4), (4, 4, 0), (4, 6, 0)])
"""AllSettings and AllStates (of drone and Skycontroller) and Emergency: commands with timeout="RETRY" in Parrot's
XML; version 1 does not give them up either."""

STALL = 0.3
"""s that a ping may be late before the host counts as stalled."""

MAX_QUEUED = 4096
"""Messages waiting in an acknowledged queue. All states and settings of a drone are a few hundred; a queue this
long means that the peer is gone, and the pings will say so."""

MAX_QUEUED_NOACK = 512
"""Messages waiting in the unacknowledged queue; beyond it the oldest is dropped, as the newest value counts."""

MAX_REPLIES = 512
"""Acknowledgements and pongs waiting to be sent: a datagram can hold thousands of pings, we need not answer all."""


class Role(enum.Enum):
    """Which end of the link."""

    CONTROLLER = "controller"
    DEVICE = "device"


class Rank(enum.Enum):
    """Place of a command among those that wait in its queue."""

    SETTING = "it moves nothing: an urgent command that is sent later goes before it"
    NORMAL = "commands go in the order in which they were sent"
    URGENT = "it goes before the settings that wait directly before it, but before nothing else"


class ReceivedMessages(msgspec.Struct, frozen=True):
    """The peer sent messages in one frame; each acknowledged one arrives once and in order."""

    messages: Sequence[Received]


class Delivered(msgspec.Struct, frozen=True):
    """The peer acknowledged the frame that carried the last byte of this message."""

    token: int


class Undelivered(msgspec.Struct, frozen=True):
    """This message was dropped: "no acknowledgement" (version 1 only) or "queue full"."""

    token: int
    reason: str


class Garbage(msgspec.Struct, frozen=True):
    """The peer sent something unreadable; `reason` is the key it is counted under."""

    reason: str


class Silent(msgspec.Struct, frozen=True):
    """The peer is not heard any more.

    Commands are dropped until it speaks, and only answers are sent, unless `send` says otherwise.
    """

    reason: str


class Speaks(msgspec.Struct, frozen=True):
    """The peer is heard again after a silence."""


class LinkDown(msgspec.Struct, frozen=True):
    """The link is dead.

    Nothing is sent or received any more; a new connection needs a new transport.
    """

    reason: str


Event: TypeAlias = ReceivedMessages | Delivered | Undelivered | Garbage | Silent | Speaks | LinkDown

_ACK, _NOACK, _WITHACK = int(FrameType.ACK), int(FrameType.NOACK), int(FrameType.WITHACK)
_NEVER_ACKNOWLEDGED = (bytes((FrameType.NOACK,)), bytes((FrameType.LOWLAT,)))

_NOACK_ID = {Role.CONTROLLER: 10, Role.DEVICE: 127}
_ACK_ID = {Role.CONTROLLER: 11, Role.DEVICE: 126}
_LOW_PRIO_ID = {Role.CONTROLLER: 11, Role.DEVICE: 125}
_RECEIVED_IDS = {Role.CONTROLLER: frozenset({125, 126, 127}), Role.DEVICE: frozenset({10, 11, 12})}

_known_frames = {(role, version): KnownFrames(version) for role in Role for version in VERSIONS}
"""All drones send the same."""

_U16 = struct.Struct("<H")
_U64 = struct.Struct("<Q")
_NEVER = float("inf")


class _AckQueue:
    """Sending side of one acknowledged queue."""

    __slots__ = ("due", "flight", "id", "sendings", "seq", "waiting")

    def __init__(self, id: int) -> None:
        self.id = id
        self.waiting: list[Waiting] = []
        self.flight: list[Piece] = []
        """The frame that waits for its acknowledgement; empty: none does."""
        self.seq = -1
        self.due = _NEVER
        """When the frame in flight has to be sent (again)."""
        self.sendings = 0

    def land(self) -> None:
        """Nothing is in flight any more."""
        self.flight = []
        self.due = _NEVER


class Transport:
    """One connection.

    Construct it when the handshake is done; `version` is the negotiated protocol version.

    A ping goes out when nothing was received for `ping_after` seconds, and again every `ping_after`. The link is
    down after three unanswered pings, or when nothing was received for `silence_limit` seconds. With `fades` it is
    silent then: everything queued is dropped, and the session goes on when the peer speaks again. Until then no pings
    are sent: a peer that hears us, though we do not hear it, has to notice the loss, or its failsafe would never begin.

    Call `outgoing` after every `receive`, `send`, `cancel` and `expire`.
    """

    def __init__(
        self,
        role: Role,
        version: int,
        now: float,
        *,
        ping_after: float = 2.0,
        silence_limit: float | None = None,
        gives_up: bool = True,
        fades: bool = False,
    ) -> None:
        """`gives_up` False: a controller of version 1 repeats every command for ever, too."""
        if version not in VERSIONS:
            raise LocalProtocolError(f"protocol version {version}, expected one of {VERSIONS}")
        if ping_after <= 0 or (silence_limit is not None and silence_limit <= 0):
            raise LocalProtocolError("ping_after and silence_limit must be positive")
        self.role = role
        self.version = version
        self.counters: Counter[str] = Counter()
        """Events by kind: "received", "sent", "retransmitted", "duplicate", "garbage.<reason>", …"""
        self.round_trip = RoundTrip()
        """Measured by the pongs to our pings."""
        self._gives_up = gives_up and version == 1 and role is Role.CONTROLLER
        self._ping_after = ping_after
        self._silence_limit = _NEVER if silence_limit is None else silence_limit
        self._tokens = itertools.count(1)
        self._seq_mask = 0xFF if version == 1 else 0xFFFF
        self._received_ids = _RECEIVED_IDS[role]
        self._last_seq: dict[int, int] = {}
        """By queue. A first frame is new whatever its number is; to libarsdk but for the highest eleven numbers."""
        self._unpacker = Unpacker(version)
        self._known = _known_frames[role, version]
        self._type_place = frame_type(version)
        self._longest = (longest_command(version, False), longest_command(version, True))
        """Bytes of a command in the unacknowledged queue, and in an acknowledged one."""
        self._noack: list[tuple[int, bytes]] = []
        self._noack_seq = -1
        self._queues = {id: _AckQueue(id) for id in (_ACK_ID[role], _LOW_PRIO_ID[role])}
        self._ack_seq = -1
        self._replies: list[bytes] = []
        self._pending: list[Event] = []
        self._last_received = now
        self._ping_due = now + ping_after
        self._ping_seq = -1
        self._unanswered = 0
        self._measure_due = now + MEASURE_EVERY
        self._fades = fades
        self._silent = False
        self._down = False

    @property
    def last_received(self) -> float:
        """When the peer was heard last, s; the beginning of the session if never."""
        return self._last_received

    @property
    def has_received(self) -> bool:
        """True once the peer has sent anything but acknowledgements and pings."""
        return bool(self._last_seq)

    @property
    def silent(self) -> bool:
        """The peer has not been heard for too long, and commands are dropped."""
        return self._silent

    # -- receiving

    def receive(self, data: bytes, now: float) -> list[Event]:
        """Process a datagram and return its events. Never raises, whatever the bytes are."""
        if self._down:
            return []
        events = self._take_pending()
        known = self._known.read(data) if data[self._type_place] in _NEVER_ACKNOWLEDGED else None
        if known is not None:
            self._hear(now, events)
            id, seq, values = known
            if self._is_new(_NOACK, id, seq):
                self.counters["received"] += len(values.layout.kinds)
                events.append(ReceivedMessages((values,)))
            return events
        frames, garbage = decode_frames(self.version, data)
        if frames:
            self._hear(now, events)
        for frame in frames:
            type, id, seq, payload = frame
            if id in self._received_ids and type != _ACK:
                if type == _WITHACK:
                    self._acknowledge(id, seq)
                if self._is_new(type, id, seq):
                    self._unpack(frame, events, data if len(frames) == 1 and garbage is None else None)
            elif type == _ACK and id - ACK_OFFSET in self._queues:
                self._acknowledged(self._queues[id - ACK_OFFSET], payload, events)
            elif id == PING and type != _ACK:
                self._reply(encode_frame(self.version, type, PONG, seq, payload))
            elif id == PONG and type != _ACK:
                if len(payload) == _U64.size:  # the time of our ping
                    self.round_trip.measure(now - _U64.unpack(payload)[0] / 1e6)
            else:
                self._garbage("queue", events)
        if garbage is not None:
            self._garbage(garbage, events)
        return events

    def _hear(self, now: float, events: list[Event]) -> None:
        """Any frame proves that the peer lives, not the pong alone."""
        self._last_received = now
        self._ping_due = now + self._ping_after
        self._unanswered = 0
        if self._silent:
            self._silent = False
            events.append(Speaks())

    def _is_new(self, type: int, id: int, seq: int) -> bool:
        """Return False for the copy of a frame, which is counted."""
        last = self._last_seq.get(id)
        if last is not None and self._is_behind(type, seq, last):
            self.counters["duplicate"] += 1
            return False
        self._last_seq[id] = seq
        return True

    def _is_behind(self, type: int, seq: int, last: int) -> bool:
        """Return True for a number that the last one has passed."""
        if type == _WITHACK:
            return (last - seq) & self._seq_mask <= self._seq_mask >> 1
        return -10 <= seq - last <= 0

    def _unpack(self, frame: Frame, events: list[Event], datagram: bytes | None) -> None:
        """Read the commands of a frame.

        `datagram`: the one that has this frame alone; None: it has others.
        """
        is_acknowledged = frame.type == _WITHACK
        commands, readable = self._unpacker.unpack(frame.id, is_acknowledged, frame.payload)
        messages = self._commands(commands, events)
        if not readable:
            self._garbage("payload", events)
        elif datagram is not None and not is_acknowledged:
            self._known.learn(datagram, frame, commands, messages)

    def _commands(self, commands: list[bytes], events: list[Event]) -> Sequence[Received]:
        messages = receive(commands)
        if messages:
            self.counters["received"] += len(messages)
            events.append(ReceivedMessages(messages))
        for _ in range(len(commands) - len(messages)):
            self._garbage("command", events)
        return messages

    def _acknowledge(self, id: int, seq: int) -> None:
        self._ack_seq = (self._ack_seq + 1) & self._seq_mask
        payload = bytes((seq,)) if self.version == 1 else _U16.pack(seq)
        self._reply(encode_frame(self.version, _ACK, id + ACK_OFFSET, self._ack_seq, payload))

    def _reply(self, frame: bytes) -> None:
        if len(self._replies) < MAX_REPLIES:
            self._replies.append(frame)
        else:
            self.counters["dropped.reply"] += 1

    def _acknowledged(self, queue: _AckQueue, payload: bytes, events: list[Event]) -> None:
        width = 1 if self.version == 1 else 2
        if len(payload) < width:
            self._garbage("ack", events)
        elif not queue.flight or int.from_bytes(payload[:width], "little") != queue.seq:
            # It answers another copy of a frame that is done with.
            self.counters["stale ack"] += 1
        else:
            events.extend(Delivered(piece.source.token) for piece in queue.flight if piece.last)
            queue.land()

    def _garbage(self, reason: str, events: list[Event]) -> None:
        self.counters["garbage." + reason] += 1
        events.append(Garbage(reason))

    # -- sending

    def send(
        self, message: Message | UnknownMessage, now: float, rank: Rank = Rank.NORMAL, *, unheard: float = 0.0
    ) -> int:
        """Queue a message; the token names it in `cancel`, `Delivered` and `Undelivered`.

        An unknown message travels in the acknowledged queue. A HIGH_PRIO message takes the place of everything that was
        not delivered, in the same queue: its own (12) is read by no Parrot program that we know.
        `rank` is of an acknowledged message. In version 1 each takes a round trip of its own, and a stop must not wait
        behind a list of settings that a client loads.
        `unheard` (s): it is sent to a silent peer, too, which may hear us; the caller cancels it. In version 1, where a
        frame holds one command, the next one has its turn after this time at most, and without an acknowledgement; the
        last one is sent on.
        Raises `LocalProtocolError` when it cannot be encoded or is too long for its queue. On a link that is down
        the message is counted and forgotten.
        """
        data = wire.encode(message)
        buffer = message.BUFFER if isinstance(message, Message) else Buffer.ACK
        longest = self._longest[buffer is not Buffer.NON_ACK]
        if len(data) > longest:
            raise LocalProtocolError(f"{type(message).__name__} has {len(data)} bytes, its queue takes {longest}")
        token = next(self._tokens)
        if self._down or (self._silent and not unheard):
            self.counters["dropped.down" if self._down else "dropped.silent"] += 1
        elif buffer is Buffer.NON_ACK:
            if len(self._noack) >= MAX_QUEUED_NOACK:
                self._noack.pop(0)
                self.counters["dropped.noack"] += 1
            self._noack.append((token, data))
        else:
            self._enqueue(buffer, token, data, now, rank, unheard)
        return token

    def _enqueue(self, buffer: Buffer, token: int, data: bytes, now: float, rank: Rank, unheard: float) -> None:
        if buffer is Buffer.HIGH_PRIO:
            # Nothing of before may follow it, nor may it wait for the acknowledgement of what is in flight.
            self.abandon("overtaken")
        queue = self._queues[(_LOW_PRIO_ID if buffer is Buffer.LOW_PRIO else _ACK_ID)[self.role]]
        if len(queue.waiting) >= MAX_QUEUED:
            self.counters["dropped.full"] += 1
            self._pending.append(Undelivered(token, "queue full"))
            return
        sendings = math.inf
        if self._silent and self.version == 1:
            sendings = min(1.0 + MAX_RETRIES_V1, max(1.0, unheard // ACK_TIMEOUT))
        elif self._gives_up and MessageId(*wire.HEADER.unpack_from(data)) not in RETRIED_FOR_EVER:
            sendings = 1.0 + MAX_RETRIES_V1
        stops_from = now if rank is Rank.URGENT or buffer is Buffer.HIGH_PRIO else -math.inf
        entry = Waiting(token, data, sendings, yields=rank is Rank.SETTING, stops_from=stops_from)
        if buffer is not Buffer.HIGH_PRIO:
            place = len(queue.waiting)
            while (
                rank is Rank.URGENT
                and place
                and queue.waiting[place - 1].yields
                and not queue.waiting[place - 1].packed
            ):
                place -= 1
            queue.waiting.insert(place, entry)
        else:
            # In front of all, but not between the parts of a split command.
            queue.waiting.insert(1 if queue.waiting and queue.waiting[0].packed else 0, entry)

    def cancel(self, token: int) -> None:
        """Forget a message that is not yet acknowledged: it is never sent (again).

        Unknown tokens are ignored.

        A frame in flight is repeated without it, under the same number: a peer that has the frame drops the
        repetition, one that has not never sees the message. The exception is a command too long for one frame
        (1000 bytes in version 3) of which a part was sent: the peer would take whatever follows for its rest, so
        it is completed.
        """
        for index, (queued, _) in enumerate(self._noack):
            if queued == token:
                del self._noack[index]
                return
        for queue in self._queues.values():
            for index, entry in enumerate(queue.waiting):
                if entry.token == token and not entry.packed:
                    del queue.waiting[index]
                    return
            kept = [piece for piece in queue.flight if piece.source.token != token or piece.source.packed]
            if len(kept) != len(queue.flight):
                queue.flight = kept
                if not kept:
                    queue.land()
                return

    def encode_ahead(self, messages: Sequence[Message]) -> list[tuple[int, bytes]]:
        """Return the frames that would carry these messages next, without sending them.

        Each is (sequence number, bytes).
        """
        queue = self._queues[_ACK_ID[self.role]]
        waiting = [Waiting(0, wire.encode(message)) for message in messages]
        frames = []
        seq = queue.seq
        while waiting:
            seq = (seq + 1) & self._seq_mask
            payload = b"".join([piece.data for piece in pack(self.version, waiting)])
            frames.append((seq, encode_frame(self.version, _WITHACK, queue.id, seq, payload)))
        return frames

    @property
    def next_seq(self) -> int:
        """Sequence number of the next frame that carries acknowledged commands."""
        return (self._queues[_ACK_ID[self.role]].seq + 1) & self._seq_mask

    def abandon(self, reason: str, skip: int = 0, *, stops_since: float = math.inf) -> None:
        """Drop everything that was not delivered; skip `skip` sequence numbers.

        Those are the numbers that another process used. Urgent commands that were given at `stops_since` (s) or later
        stay, if no frame has them yet.
        """
        self._noack.clear()
        for queue in self._queues.values():
            # Of a split command that was begun the peer would take whatever follows for the rest: it is completed.
            begun = [entry for entry in queue.waiting if entry.packed]
            dropped = [piece.source for piece in queue.flight if piece.last] if not begun else []
            unsent = [entry for entry in queue.waiting if not entry.packed]
            dropped += [entry for entry in unsent if entry.stops_from < stops_since]
            self._pending.extend(Undelivered(entry.token, reason) for entry in dropped)
            queue.waiting = begun + [entry for entry in unsent if entry.stops_from >= stops_since]
            if not begun:
                queue.land()
        queue = self._queues[_ACK_ID[self.role]]
        queue.seq = (queue.seq + skip) & self._seq_mask

    @property
    def is_idle(self) -> bool:
        """True while nothing waits to be sent, acknowledged or returned by `expire`.

        Only pings become due then.
        """
        for queue in self._queues.values():
            if queue.flight or queue.waiting:
                return False
        return not (self._replies or self._noack or self._pending)

    def outgoing(self, now: float) -> list[bytes]:
        """The datagrams to send now; they are forgotten here, repetitions come by themselves."""
        if self._down:
            return []
        if self._noack and now >= self._measure_due and self.role is Role.CONTROLLER:
            self._measure_due = now + MEASURE_EVERY
            self._ping(now)
        datagrams = self._replies
        self._replies = []
        while self._noack:
            datagrams.append(self._next_noack())
        for queue in self._queues.values():
            if queue.flight and now >= queue.due:
                self._give_up(queue)
            if not queue.flight:
                if not queue.waiting:
                    continue
                queue.seq = (queue.seq + 1) & self._seq_mask
                queue.flight = pack(self.version, queue.waiting)
                queue.sendings = 0
                queue.due = now
            if now >= queue.due:
                datagrams.append(self._sending(queue, now))
        return datagrams

    def _next_noack(self) -> bytes:
        version, queue = self.version, self._noack
        payload = with_length(version, queue.pop(0)[1])
        sent, limit = 1, PACK_LIMIT[version]
        while queue and version > 1:
            more = with_length(version, queue[0][1])
            if len(payload) + len(more) > limit:
                break
            payload += more
            queue.pop(0)
            sent += 1
        self.counters["sent"] += sent
        self._noack_seq = (self._noack_seq + 1) & self._seq_mask
        return encode_frame(self.version, _NOACK, _NOACK_ID[self.role], self._noack_seq, payload)

    def _sending(self, queue: _AckQueue, now: float) -> bytes:
        if queue.sendings:
            self.counters["retransmitted"] += 1
        else:
            self.counters["sent"] += sum(piece.last for piece in queue.flight)
        queue.sendings += 1
        queue.due = now + ACK_TIMEOUT
        payload = b"".join([piece.data for piece in queue.flight])
        return encode_frame(self.version, _WITHACK, queue.id, queue.seq, payload)

    def _give_up(self, queue: _AckQueue) -> None:
        """Version 1, controller: a command is sent so often, then the next one has its turn.

        The last one to a silent peer is sent until the caller cancels it.
        """
        if queue.sendings >= queue.flight[0].source.sendings and (queue.waiting or not self._silent):
            self.counters["undelivered"] += 1
            self._pending.append(Undelivered(queue.flight[0].source.token, "no acknowledgement"))
            queue.land()

    # -- time

    def deadline(self) -> float | None:
        """When `expire` wants to be called; None when the link is down.

        It may move later without notice.
        """
        if self._down:
            return None
        if self._pending:
            return self._last_received
        deadline = _NEVER
        if not self._silent:
            deadline = min(self._ping_due, self._last_received + self._silence_limit)
        for queue in self._queues.values():
            if queue.due < deadline:
                deadline = queue.due
        return deadline

    def expire(self, now: float) -> list[Event]:
        """Process the time that has passed and return the events.

        They are undelivered messages, silence and a dead link; pings and repetitions are prepared for `outgoing`.
        """
        if self._down:
            return []
        for queue in self._queues.values():
            if queue.flight and now >= queue.due:
                self._give_up(queue)
        events = self._take_pending()
        if self._silent:
            return events
        late = now - self._ping_due
        if late >= STALL:
            # The host stalled, and what arrived meanwhile may not have been read yet: that is no silence of the peer's.
            self._last_received += late
        silence = now - self._last_received
        if silence >= self._silence_limit:
            self._lose(f"nothing received for {silence:.1f} s", events)
        elif now >= self._ping_due:
            if self._unanswered >= MAX_UNANSWERED_PINGS:
                self._lose(f"{self._unanswered} pings unanswered, nothing received for {silence:.1f} s", events)
            else:
                self._send_ping(now)
        return events

    def _lose(self, reason: str, events: list[Event]) -> None:
        """The peer is not heard any more."""
        if not self._fades:
            self._go_down(reason, events)
            return
        self._silent = True
        events.append(Silent(reason))  # first: that the link is silent explains the others
        self.abandon("the link is silent")
        events.extend(self._take_pending())

    def _send_ping(self, now: float) -> None:
        self._unanswered += 1
        self._ping_due = now + self._ping_after
        self._ping(now)

    def _ping(self, now: float) -> None:
        self._ping_seq = (self._ping_seq + 1) & self._seq_mask
        payload = _U64.pack(int(now * 1e6) & 0xFFFF_FFFF_FFFF_FFFF)
        self.counters["ping"] += 1
        self._reply(encode_frame(self.version, _NOACK, PING, self._ping_seq, payload))

    def _go_down(self, reason: str, events: list[Event]) -> None:
        self._down = True
        self._noack.clear()
        self._replies.clear()
        for queue in self._queues.values():
            queue.waiting.clear()
            queue.land()
        events.append(LinkDown(reason))

    def _take_pending(self) -> list[Event]:
        events = self._pending
        if events:
            self._pending = []
            return events
        return []

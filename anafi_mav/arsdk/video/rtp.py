"""RTP packets (RFC 3550) and the order they arrive in.

What a packet holds of a picture is in `rtp_h264`.

No I/O: bytes and the time go in, packets come out. A peer's bytes never raise; what cannot be used is counted.
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import NamedTuple

from anafi_mav.errors import LocalProtocolError

VERSION = 2
HEADER = struct.Struct(">BBHII")
"""version, padding, extension and number of sources; marker and payload type; sequence; timestamp; source."""
_EXTENSION = struct.Struct(">HH")

MAX_WAIT = 0.03
"""s to wait for a packet that others have overtaken, as Parrot's own receiver does (vstrm_receiver.c)."""
MAX_HELD = 256
"""Packets held back at once: a picture of 300 kB, which an ANAFI needs 0.5 s of its 5 Mbit/s for."""
MAX_DROPOUT = 3000
"""A packet so many numbers ahead is still taken for the same row (RFC 3550 appendix A.1)."""
MAX_MISORDER = 100
"""A packet up to so many numbers behind is late; any other distance is a restarted sender."""


class Extension(NamedTuple):
    """A header extension: its profile and its body, whole words of 4 bytes."""

    profile: int
    body: bytes


class Packet(NamedTuple):
    """One RTP packet, without padding and contributing sources."""

    payload_type: int
    sequence: int
    """16 bits, wraps."""
    timestamp: int
    """32 bits, wraps; 90 kHz for video."""
    ssrc: int
    payload: bytes
    marker: bool = False
    """Last packet of a picture."""
    extension: Extension | None = None


def encode_packet(packet: Packet) -> bytes:
    """Encode a packet.

    Raises `LocalProtocolError` when a number does not fit, or the extension is not in whole words.
    """
    first, extension = VERSION << 6, b""
    try:
        if packet.extension is not None:
            words, rest = divmod(len(packet.extension.body), 4)
            if rest:
                raise ValueError("an extension is in words of 4 bytes")
            first |= 0x10
            extension = _EXTENSION.pack(packet.extension.profile, words) + packet.extension.body
        if not 0 <= packet.payload_type < 0x80:
            raise ValueError(f"payload type {packet.payload_type}")
        second = packet.marker << 7 | packet.payload_type
        return HEADER.pack(first, second, packet.sequence, packet.timestamp, packet.ssrc) + extension + packet.payload
    except (struct.error, ValueError) as error:
        raise LocalProtocolError(f"cannot encode {packet!r}: {error}") from error


def decode_packet(data: bytes) -> Packet | None:
    """Return the packet in a datagram, or None when it holds no RTP packet."""
    if len(data) < HEADER.size:
        return None
    first, second, sequence, timestamp, ssrc = HEADER.unpack_from(data)
    if first >> 6 != VERSION:
        return None
    position, end = HEADER.size + 4 * (first & 0x0F), len(data)
    extension = None
    if first & 0x10:
        if end < position + _EXTENSION.size:
            return None
        profile, words = _EXTENSION.unpack_from(data, position)
        position += _EXTENSION.size
        if end < position + 4 * words:
            return None
        extension = Extension(profile, bytes(data[position : position + 4 * words]))
        position += 4 * words
    if first & 0x20:
        padding = data[-1]
        if not 0 < padding <= end - position:
            return None
        end -= padding
    if position > end:
        return None
    payload = bytes(data[position:end])
    return Packet(second & 0x7F, sequence, timestamp, ssrc, payload, bool(second & 0x80), extension)


def sequence_distance(from_sequence: int, to_sequence: int) -> int:
    """How far ahead `to` is, -32768..32767: numbers wrap at 65536."""
    return (to_sequence - from_sequence + 0x8000 & 0xFFFF) - 0x8000


class ReceivedPacket(NamedTuple):
    """A packet in its place."""

    packet: Packet
    gap: bool
    """Packets before it are missing."""


class ReorderWindow:
    """Puts the packets of one sender back in order, waiting `MAX_WAIT` for what is missing."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        """"received", and what became of the rest: "lost", "late" (or double), "stray", "restarted"."""
        self.ssrc: int | None = None
        """The sender; another one that speaks twice in a row takes its place."""
        self._next = 0
        self._held: dict[int, tuple[Packet, float]] = {}
        """By sequence number, with the time of arrival."""
        self._stray: tuple[int, int] | None = None
        """(sender, number) that would confirm a new beginning."""
        self._gap = False

    def receive(self, packet: Packet, now: float) -> list[ReceivedPacket]:
        """Add a packet; return the packets that are in sequence now."""
        if self.ssrc is None:
            self._begin(packet)
        ahead = sequence_distance(self._next, packet.sequence)
        if packet.ssrc != self.ssrc or not -MAX_MISORDER <= ahead <= MAX_DROPOUT:
            # A stray datagram must not end a good row: only two in sequence are believed.
            if self._stray != (packet.ssrc, packet.sequence):
                self._stray = (packet.ssrc, packet.sequence + 1 & 0xFFFF)
                self.counts["stray"] += 1
                return self.expire(now)
            self.counts["restarted"] += 1
            self._held.clear()
            self._begin(packet)
            self._gap = True
            ahead = 0
        self._stray = None
        if ahead < 0 or packet.sequence in self._held:
            self.counts["late"] += 1
            return self.expire(now)
        self.counts["received"] += 1
        self._held[packet.sequence] = (packet, now)
        return self.expire(now)

    def _begin(self, packet: Packet) -> None:
        self.ssrc, self._next = packet.ssrc, packet.sequence

    def expire(self, now: float) -> list[ReceivedPacket]:
        """Return the packets that are in sequence, or have waited for `MAX_WAIT`."""
        ready: list[ReceivedPacket] = []
        while self._held:
            held = self._held.pop(self._next, None)
            if held is None:
                oldest = min(self._held, key=lambda sequence: sequence_distance(self._next, sequence))
                # The first that arrived behind the gap says how long it has been waited for.
                waited = now - min(arrival for _, arrival in self._held.values())
                if waited < MAX_WAIT and len(self._held) < MAX_HELD:
                    break
                self.counts["lost"] += sequence_distance(self._next, oldest)
                self._next, self._gap = oldest, True
                continue
            ready.append(ReceivedPacket(held[0], self._gap))
            self._next, self._gap = self._next + 1 & 0xFFFF, False
        return ready

    def deadline(self) -> float | None:
        """When `expire` is to be called, if nothing arrives before; None: nothing is held back."""
        return min(arrival for _, arrival in self._held.values()) + MAX_WAIT if self._held else None

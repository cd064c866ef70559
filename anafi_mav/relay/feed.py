"""Pictures of one stream as packets for its viewers. No I/O.

A picture is packed once. Its packets are the same for every viewer that has missed none; the others' are numbered
again, so that a player sees no gap in the numbers and waits for nothing. Pictures are passed on whole or not at all.

Nothing is decoded. Decoding can begin at an entry: an IDR picture, or one with a recovery point, as encoders send it
that refresh their picture part by part and have no IDR pictures (H.264 D.2.8).
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from anafi_mav.arsdk.video.rtcp import SenderReport
from anafi_mav.arsdk.video.rtp import HEADER, VERSION
from anafi_mav.arsdk.video.rtp_h264 import CLOCK_RATE, PAYLOAD_TYPE, Picture, split_units
from anafi_mav.arsdk.video.rtsp import encode_interleaved
from anafi_mav.arsdk.video.sdp import MediaDescription, SessionDescription, format_description
from anafi_mav.relay.admission import Admission, PictureGate

MAX_KEPT_BYTES = 4 << 20
"""Bytes of packets kept for new viewers: six seconds of an ANAFI's 5 Mbit/s, and no less than one picture may have. The
NAL units are kept beside them, twice as much in all."""
MAX_KEPT_PICTURES = 300
"""Pictures kept for new viewers: ten seconds. What has no entry for longer is not kept."""

BURST_STEP = CLOCK_RATE // 1000
"""Between the timestamps of the pictures that a new viewer gets at once: 1 ms. With their own a player would show them
at their own speed and remain up to a second behind."""

MAX_JUMP = 2.0
"""s by which timestamps and arrival may disagree; beyond it the drone's clock has another zero than before."""

_SPS, _PPS, _SEI, _IDR = 7, 8, 6, 5
_RECOVERY_POINT = 6
"""Type of a supplemental message (H.264 D.1)."""

_FIRST_BYTE = VERSION << 6
_MARKER = 0x80
_WRAP32, _WRAP16 = 0xFFFFFFFF, 0xFFFF


@dataclass
class PackedPicture:
    """One picture, ready to be sent."""

    datagrams: tuple[bytes, ...]
    sequence: int
    """Of the first packet."""
    timestamp: int
    is_entry: bool
    size: int
    """Bytes of all datagrams."""
    units: tuple[bytes, ...]
    """NAL units, for viewers that pack them in their own way."""
    _framed: dict[int, bytes] = field(default_factory=dict)

    def framed(self, channel: int) -> bytes:
        """Return all packets as they travel inside an RTSP connection; made once for all viewers."""
        if channel not in self._framed:
            self._framed[channel] = frame(self.datagrams, channel)
        return self._framed[channel]


def frame(datagrams: Iterable[bytes], channel: int) -> bytes:
    """Return packets as they travel inside an RTSP connection."""
    return b"".join(encode_interleaved(channel, datagram) for datagram in datagrams)


def is_entry(units: Sequence[bytes]) -> bool:
    """Return True when decoding can begin at a picture of these NAL units."""
    for unit in units:
        kind = unit[0] & 0x1F
        if kind == _IDR or (kind == _SEI and len(unit) > 1 and unit[1] == _RECOVERY_POINT):
            return True
    return False


class Feed:
    """One stream, from its first picture to the change to another one."""

    def __init__(self, ssrc: int, sequence: int, timestamp: int) -> None:
        """The three begin anywhere (RFC 3550 5.1)."""
        self.ssrc = ssrc
        self.sps = b""
        """Sequence parameter set, a NAL unit; empty until it is known."""
        self.pps = b""
        self.counts: Counter[str] = Counter()
        """pictures, incomplete (packets of it were lost on the way from the drone), empty."""
        self._sequence = sequence
        self._timestamp = timestamp
        """Of the newest picture."""
        self._at = 0.0
        """Arrival of the newest picture."""
        self._shot = 0.0
        """When it was taken (s, monotonic)."""
        self._offset: int | None = None
        """From the drone's timestamps to ours; None: set at the next picture."""
        self._kept: deque[PackedPicture] = deque()
        self._kept_bytes = 0

    @property
    def kept(self) -> Sequence[PackedPicture]:
        """The pictures since the last entry, that one first; empty when there was none lately."""
        return self._kept

    @property
    def sequence(self) -> int:
        """Of the next packet."""
        return self._sequence

    @property
    def timestamp(self) -> int:
        """Of the newest picture."""
        return self._timestamp

    def burst_time(self, number: int) -> int:
        """Return the timestamp of a kept picture for a viewer that gets all of them at once."""
        return self._kept[-1].timestamp - (len(self._kept) - 1 - number) * BURST_STEP & _WRAP32

    def set_parameters(self, sps: bytes, pps: bytes) -> None:
        """Take the parameter sets of the drone's description, unless pictures have brought others."""
        if not self.sps and sps and pps:
            self.sps, self.pps = sps, pps

    def interrupt(self) -> None:
        """Note that pictures are missing: the drone's session has ended, another one may follow."""
        self._offset = None
        self._drop_kept()

    def add(self, picture: Picture, now: float, shot: float | None = None) -> PackedPicture | None:
        """Pack a picture that arrived `now` (s, monotonic); None when nothing of it can be used.

        `shot`: when it was taken; None: unknown.
        """
        units = [unit for unit in picture.units if unit]
        if not units:
            self.counts["empty"] += 1
            return None
        self.counts["pictures"] += 1
        self.counts["incomplete"] += not picture.complete
        present = {unit[0] & 0x1F: unit for unit in units}
        if _SPS in present and _PPS in present:
            self.sps, self.pps = present[_SPS], present[_PPS]
        entry = picture.complete and is_entry(units)
        if entry and _SPS not in present and self.sps:
            units = [self.sps, self.pps, *units]
        packed = self._pack(units, self._time(picture.timestamp, now), entry)
        self._shot = now if shot is None else shot
        self._keep(packed)
        return packed

    def parameters(self, sequence: int, timestamp: int) -> list[bytes]:
        """Return the packets of the parameter sets alone, for a viewer that begins without an entry."""
        if not self.sps:
            return []
        return self._encode(split_units([self.sps, self.pps]), sequence, timestamp, ends=False)

    def report(self, now: float, time: float, packets: int, octets: int) -> SenderReport:
        """Return the sender report of a viewer's packets; `time` is `now` in s since 1970.

        A timestamp is the moment when its picture was taken: with SYSTEM_TIME a viewer finds the pose of that moment.
        """
        timestamp = self._timestamp + round((now - self._shot) * CLOCK_RATE)
        return SenderReport(self.ssrc, round(time * 1e6), timestamp & _WRAP32, packets & _WRAP32, octets & _WRAP32)

    def description(self, name: str, info: str, tool: str, control: str) -> bytes:
        """Return the SDP of the stream; `control` is the last part of the URL for SETUP."""
        media = MediaDescription(info, control, PAYLOAD_TYPE, sps=self.sps, pps=self.pps)
        return format_description(SessionDescription(name=name, tool=tool, control="*", media=(media,)))

    def _time(self, timestamp: int, now: float) -> int:
        """Return our timestamp of a picture: the drone's steps without the jumps of its restarts."""
        due = self._timestamp + round((now - self._at) * CLOCK_RATE) if self._at else self._timestamp
        if self._offset is not None:
            ours = timestamp + self._offset & _WRAP32
            ahead = (ours - due + 0x80000000 & _WRAP32) - 0x80000000
            if abs(ahead) > MAX_JUMP * CLOCK_RATE:
                self._offset = None
        if self._offset is None:
            self._offset = due - timestamp & _WRAP32
        self._at = now
        self._timestamp = timestamp + self._offset & _WRAP32
        return self._timestamp

    def _pack(self, units: Sequence[bytes], timestamp: int, entry: bool) -> PackedPicture:
        datagrams = tuple(self._encode(split_units(units), self._sequence, timestamp, ends=True))
        packed = PackedPicture(datagrams, self._sequence, timestamp, entry, sum(map(len, datagrams)), tuple(units))
        self._sequence = self._sequence + len(datagrams) & _WRAP16
        return packed

    def _encode(self, payloads: Sequence[bytes], sequence: int, timestamp: int, *, ends: bool) -> list[bytes]:
        last = len(payloads) - 1 if ends else -1
        return [
            HEADER.pack(
                _FIRST_BYTE,
                PAYLOAD_TYPE | (_MARKER if number == last else 0),
                sequence + number & _WRAP16,
                timestamp,
                self.ssrc,
            )
            + payload
            for number, payload in enumerate(payloads)
        ]

    def _keep(self, packed: PackedPicture) -> None:
        if packed.is_entry:
            self._drop_kept()
        elif not self._kept:
            return
        self._kept.append(packed)
        self._kept_bytes += packed.size
        if len(self._kept) > MAX_KEPT_PICTURES or self._kept_bytes > MAX_KEPT_BYTES:
            self._drop_kept()

    def _drop_kept(self) -> None:
        self._kept.clear()
        self._kept_bytes = 0


class FeedReader:
    """One viewer's part of a feed: its beginning, the pictures it misses, its packet numbers."""

    def __init__(self, feed: Feed) -> None:
        self.counts: Counter[str] = Counter()
        """pictures, dropped pictures (it was too slow)."""
        self.packets = 0
        """Sent so far, as sender reports say it."""
        self.octets = 0
        """Bytes of payload sent so far."""
        self._feed = feed
        self._shift = 0
        """Added to the feed's sequence numbers."""
        self._gate = PictureGate()

    @property
    def start(self) -> tuple[int, int] | None:
        """Return sequence number and timestamp of the first packet of `begin`, or None."""
        kept = self._feed.kept
        return (kept[0].sequence, self._feed.burst_time(0)) if kept else None

    def begin(self, now: float) -> list[bytes]:
        """Return what the viewer gets at once: everything since the last entry."""
        self._shift = 0
        self._gate.begin(now, has_entry=bool(self._feed.kept))
        datagrams = [
            _renumbered(datagram, 0, self._feed.burst_time(number))
            for number, picture in enumerate(self._feed.kept)
            for datagram in picture.datagrams
        ]
        self.counts["pictures"] += len(self._feed.kept)
        return list(self._sent(datagrams))

    def take(self, picture: PackedPicture, waiting: int, now: float) -> Sequence[bytes]:
        """Return the datagrams of a new picture for this viewer, or none.

        `waiting` bytes wait for it already. The datagrams are the picture's own where they fit as they are.
        """
        admission = self._gate.admit(picture.is_entry, waiting, now)
        if admission is Admission.DROP:
            if self.packets:
                self.counts["dropped pictures"] += 1
            self._shift -= len(picture.datagrams)
            return ()
        extra: list[bytes] = []
        if admission is Admission.PASS_WITHOUT_ENTRY:
            extra = self._feed.parameters(picture.sequence + self._shift & _WRAP16, picture.timestamp)
            self._shift += len(extra)
        self.counts["pictures"] += 1
        if not extra and not self._shift & _WRAP16:
            return self._sent(picture.datagrams)
        return self._sent([*extra, *(_renumbered(one, self._shift, picture.timestamp) for one in picture.datagrams)])

    def _sent(self, datagrams: Sequence[bytes]) -> Sequence[bytes]:
        self.packets += len(datagrams)
        self.octets += sum(map(len, datagrams)) - HEADER.size * len(datagrams)
        return datagrams


def _renumbered(datagram: bytes, shift: int, timestamp: int) -> bytes:
    first, second, sequence, _, ssrc = HEADER.unpack_from(datagram)
    return HEADER.pack(first, second, sequence + shift & _WRAP16, timestamp, ssrc) + datagram[HEADER.size :]

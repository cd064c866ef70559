"""Pictures in RTP: H.264 (RFC 6184, packetization mode 1) with Parrot's metadata.

A picture is a sequence of NAL units, without start codes. One that is small goes into a packet of its own or with
others (STAP-A), one that is large into several (FU-A); the last packet of a picture has the marker.

Metadata travels in the header extensions. Version 3 is the extension of the first packet of its picture. Of the
protocol buffer each packet carries a part behind a header of four bytes: the numbers of the last and of this part and
the padding in 16 bits, and the offset of the part (libvideo-streaming vstrm_rtp_h264.h, vstrm_rtp_h264_tx.c).
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from anafi_mav.arsdk.video.rtp import (
    HEADER,
    Extension,
    Packet,
    ReceivedPacket,
    ReorderWindow,
    decode_packet,
    encode_packet,
)
from anafi_mav.arsdk.video.video_metadata import PROTO_PROFILE, V3_PROFILE, FrameMetadata, decode_v3, encode_v3
from anafi_mav.arsdk.video.video_metadata_proto import decode_proto, encode_proto
from anafi_mav.errors import LocalProtocolError

PAYLOAD_TYPE = 96
CLOCK_RATE = 90000
"""Hz of the timestamps."""
MAX_PACKET = 1400
"""Bytes of a packet sent, so that Wi-Fi and tunnels do not cut it."""
MAX_PICTURE = 4 << 20
"""Bytes of a received picture: an ANAFI streams 5 Mbit/s, a whole second of it is 0.6 MB."""
SMALLEST_FRAGMENT = 256
"""Bytes that a fragment counts at least against `MAX_PICTURE`: many tiny ones cost memory too."""
MAX_UNITS = 512
"""NAL units of a received picture; Parrot's encoders cut a picture into at most 45 slices."""

_STAP_A, _FU_A = 24, 28

_PART = struct.Struct(">HH")
"""last part << 9 | this part << 2 | bytes of padding; where the part begins."""
PART_SIZE = 300
"""Bytes of metadata in one packet (VSTRM_METADATA_FRAGMENT_MAX_LEN)."""
MAX_PARTS = 64
"""The numbers of parts have 6 usable bits."""


# ------------------------------------------------------------------------------------------------------- sending


def split_proto(data: bytes, count: int) -> list[Extension]:
    """A serialized `TimedMetadata` in at most `count` parts.

    Raises `LocalProtocolError` when that is not 1..`MAX_PARTS`.
    """
    if not 0 < count <= MAX_PARTS:
        raise LocalProtocolError(f"metadata in {count} parts")
    # Whole words: only the last part is padded.
    size = PART_SIZE if len(data) <= count * PART_SIZE else -(-len(data) // count) + 3 & ~3
    parts = [data[start : start + size] for start in range(0, len(data), size)] or [b""]
    extensions = []
    for number, part in enumerate(parts):
        padding = -len(part) % 4
        header = _PART.pack(len(parts) - 1 << 9 | number << 2 | padding, number * size)
        extensions.append(Extension(PROTO_PROFILE, header + part + bytes(padding)))
    return extensions


def split_units(units: Sequence[bytes], sizes: Sequence[int] = ()) -> list[bytes]:
    """The payloads of a picture's packets, of at most `MAX_PACKET` bytes with their headers.

    `sizes`: bytes that the header extensions of the first packets take. Raises `LocalProtocolError` for an empty unit,
    and when an extension leaves no room.
    """
    if any(size > MAX_PACKET // 2 for size in sizes):
        raise LocalProtocolError(f"a header extension of {max(sizes)} bytes leaves no room for the picture")
    payloads: list[bytes] = []
    together: list[bytes] = []

    def room() -> int:
        return MAX_PACKET - HEADER.size - (sizes[len(payloads)] if len(payloads) < len(sizes) else 0)

    def flush() -> None:
        if len(together) == 1:
            payloads.append(together[0])
        elif together:
            # The indicator of an aggregate has the highest importance of its units (RFC 6184 5.7).
            importance = max(unit[0] & 0x60 for unit in together)
            parts = b"".join(len(unit).to_bytes(2, "big") + unit for unit in together)
            payloads.append(bytes((importance | _STAP_A,)) + parts)
        together.clear()

    for unit in units:
        if not unit:
            raise LocalProtocolError("a NAL unit has at least its header")
        if together and 1 + sum(2 + len(one) for one in together) + 2 + len(unit) > room():
            flush()
        if len(unit) <= room():
            together.append(unit)
            continue
        flush()
        position = 1
        while position < len(unit):
            part = unit[position : position + room() - 2]
            ends = (position == 1) << 7 | (position + len(part) == len(unit)) << 6
            payloads.append(bytes((unit[0] & 0xE0 | _FU_A, ends | unit[0] & 0x1F)) + part)
            position += len(part)
    flush()
    return payloads


def _pack(units: Sequence[bytes], metadata: FrameMetadata | None, profile: int) -> tuple[list[Extension], list[bytes]]:
    """The extensions and payloads of a picture's packets."""
    if metadata is None:
        return [], split_units(units)
    if profile == V3_PROFILE:
        extensions = [Extension(V3_PROFILE, encode_v3(metadata))]
        return extensions, split_units(units, [4 + len(extensions[0].body)])
    if profile != PROTO_PROFILE:
        raise LocalProtocolError(f"no metadata has profile {profile:#x}")
    data = encode_proto(metadata)
    count = max(1, -(-len(data) // PART_SIZE))
    while True:
        extensions = split_proto(data, count)
        payloads = split_units(units, [4 + len(extension.body) for extension in extensions])
        if len(payloads) >= count:
            return extensions, payloads
        count = len(payloads)  # a picture of fewer packets than its metadata has parts: the parts grow


class PictureSender:
    """The sending end of one stream; pictures in, datagrams out."""

    def __init__(self, ssrc: int, sequence: int = 0) -> None:
        self.ssrc = ssrc
        self.sequence = sequence
        """Number of the next packet."""
        self.packets = 0
        """Sent so far, as sender reports say it."""
        self.octets = 0
        """Bytes of payload sent so far."""

    def send(
        self, units: Sequence[bytes], timestamp: int, metadata: FrameMetadata | None = None, profile: int = V3_PROFILE
    ) -> list[bytes]:
        """The packets of a picture taken at `timestamp` (of `CLOCK_RATE`; wraps)."""
        extensions, payloads = _pack(units, metadata, profile)
        datagrams = []
        for number, payload in enumerate(payloads):
            packet = Packet(
                PAYLOAD_TYPE,
                self.sequence,
                timestamp & 0xFFFFFFFF,
                self.ssrc,
                payload,
                marker=number == len(payloads) - 1,
                extension=extensions[number] if number < len(extensions) else None,
            )
            datagrams.append(encode_packet(packet))
            self.sequence = self.sequence + 1 & 0xFFFF
            self.packets += 1
            self.octets += len(payload)
        return datagrams


# ------------------------------------------------------------------------------------------------------ receiving


@dataclass(frozen=True)
class Picture:
    """One picture of the video, H.264."""

    timestamp: int
    """RTP timestamp, 90 kHz; wraps."""
    units: tuple[bytes, ...]
    """NAL units without start codes."""
    metadata: FrameMetadata | None
    """None: absent or incomplete."""
    complete: bool
    """True when none of its packets was lost."""

    @property
    def is_key(self) -> bool:
        """True when decoding can begin here."""
        return any(unit[0] & 0x1F == 5 for unit in self.units)


@dataclass
class _Parts:
    """The protocol buffer of one picture, as far as it has come."""

    data: bytearray = field(default_factory=bytearray)
    seen: set[int] = field(default_factory=set)
    size: int = -1
    last: int = -1

    def add(self, body: bytes) -> bytes | None:
        """The whole, once every part is there."""
        if len(body) < _PART.size:
            return None
        packed, offset = _PART.unpack_from(body)
        last, number, padding = packed >> 9 & 0x3F, packed >> 2 & 0x3F, packed & 3
        part = body[_PART.size : len(body) - padding]
        if number in self.seen or number > last or offset + len(part) > MAX_PARTS * PART_SIZE:
            return None
        self.seen.add(number)
        if len(self.data) < offset + len(part):
            self.data.extend(bytes(offset + len(part) - len(self.data)))
        self.data[offset : offset + len(part)] = part
        if number == last:
            self.last, self.size = last, offset + len(part)
        if self.last < 0 or len(self.seen) != self.last + 1:
            return None
        return bytes(self.data[: self.size])


class PictureReceiver:
    """The receiving end of one stream; datagrams in, pictures out."""

    def __init__(self) -> None:
        self.window = ReorderWindow()
        self.counts: Counter[str] = Counter()
        """Dropped items.

        "malformed" packets, "unit"s that could not be read, "metadata", "oversized" pictures.
        """
        self._timestamp: int | None = None
        self._ended = True
        """The picture in progress has had its marker."""
        self._reset()

    def _reset(self) -> None:
        self._units: list[bytes] = []
        self._size = 0
        self._fragments: list[bytes] | None = None
        self._fragments_size = 0
        self._metadata: FrameMetadata | None = None
        self._parts = _Parts()
        self._complete = True
        self._gathering = False

    def receive(self, data: bytes, now: float) -> list[Picture]:
        """The pictures that are whole, or ended by what came after them."""
        packet = decode_packet(data)
        if packet is None:
            self.counts["malformed"] += 1
            return []
        return self._take(self.window.receive(packet, now))

    def expire(self, now: float) -> list[Picture]:
        """Call it at `deadline`."""
        return self._take(self.window.expire(now))

    def deadline(self) -> float | None:
        return self.window.deadline()

    def _take(self, received: list[ReceivedPacket]) -> list[Picture]:
        pictures: list[Picture] = []
        for packet, gap in received:
            if self._gathering and packet.timestamp != self._timestamp:
                self._complete = False  # its marker is missing
                pictures.append(self._finish())
            if gap:
                self._complete = False
                self._fragments = None
            self._timestamp, self._gathering = packet.timestamp, True
            if packet.extension is not None:
                self._extension(packet.extension)
            self._payload(packet.payload)
            if packet.marker:
                pictures.append(self._finish())
        return pictures

    def _finish(self) -> Picture:
        assert self._timestamp is not None
        if self._fragments is not None:
            self._complete = False
        picture = Picture(self._timestamp, tuple(self._units), self._metadata, self._complete)
        self._reset()
        return picture

    def _extension(self, extension: Extension) -> None:
        if extension.profile == V3_PROFILE:
            self._metadata = decode_v3(extension.body)
            self.counts["metadata"] += self._metadata is None
        elif extension.profile == PROTO_PROFILE:
            whole = self._parts.add(extension.body)
            if whole is not None:
                self._metadata = decode_proto(whole)
                self.counts["metadata"] += self._metadata is None

    def _payload(self, payload: bytes) -> None:
        kind = payload[0] & 0x1F if payload else 0
        if 0 < kind < _STAP_A:
            self._unit(payload)
        elif kind == _STAP_A:
            position = 1
            while position + 2 < len(payload):
                size = int.from_bytes(payload[position : position + 2], "big")
                unit = payload[position + 2 : position + 2 + size]
                if not unit or len(unit) != size:
                    break
                self._unit(unit)
                position += 2 + size
            if position != len(payload):
                self._drop("unit")
        elif kind == _FU_A and len(payload) > 2:
            self._fragment(payload)
        else:
            self._drop("unit")

    def _fragment(self, payload: bytes) -> None:
        first, last = payload[1] & 0x80, payload[1] & 0x40
        if first:
            if self._fragments is not None:
                self._drop("unit")
            self._fragments, self._fragments_size = [bytes((payload[0] & 0xE0 | payload[1] & 0x1F,))], 0
        elif self._fragments is None:
            self._drop("unit")
            return
        self._fragments_size += max(len(payload), SMALLEST_FRAGMENT)
        if self._size + self._fragments_size > MAX_PICTURE:
            self._fragments = None
            self._drop("oversized")
            return
        self._fragments.append(payload[2:])
        if last:
            unit, self._fragments = b"".join(self._fragments), None
            self._unit(unit)

    def _unit(self, unit: bytes) -> None:
        self._size += len(unit)
        if self._size > MAX_PICTURE or len(self._units) >= MAX_UNITS:
            self._drop("oversized")
            return
        self._units.append(unit)

    def _drop(self, reason: str) -> None:
        self.counts[reason] += 1
        self._complete = False

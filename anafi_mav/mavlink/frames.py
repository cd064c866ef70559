"""MAVLink frames: messages into version 2 frames, any bytes into messages. No I/O.

Going out, a message is packed once (`pack`) and framed per channel (`frame`), for only the sequence number and with it
the checksum differ. Coming in, `Parser` finds frames of version 1 and 2 between whatever else arrives and makes
messages of them (`unpack`). Next floor: `channel`.
"""

from __future__ import annotations

import inspect
import re
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from enum import Enum
from operator import attrgetter
from typing import Any

import fastcrc
import msgspec

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink import dialect

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
_MAGICS = (MAGIC_1, MAGIC_2)
HEADER_1, HEADER_2 = 6, 10
"""Bytes before the payload (MAVLink serialization.md §packet_format)."""
CHECKSUM, SIGNATURE = 2, 13
SIGNED = 0x01
"""The only incompatibility flag there is; a frame with another one must be discarded (serialization.md)."""

FRAME_BYTES = HEADER_2 + CHECKSUM
"""A version 2 frame has so much more than its payload (MAVLink serialization.md §mavlink2_packet_format)."""

MAX_FRAME = HEADER_2 + 255 + CHECKSUM + SIGNATURE
"""The most that a parser holds back while it waits for what comes next."""

MAX_SOURCES = 256
"""Systems and components that one channel may bring: a fleet behind a radio is tens. More are not remembered."""

_BODY = struct.Struct("<BBBBBBHB")
_CHECKSUM = struct.Struct("<H")
_crc: Callable[..., int] = fastcrc.crc16.mcrf4xx
_EXTRA = {id: bytes((kind.crc_extra,)) for id, kind in dialect.mavlink_map.items()}
_NEXT_MAGIC = re.compile(rb"[\xfd\xfe]")


class Verdict(Enum):
    """Result of looking at a frame's signature. The values of refusals are names of counters."""

    UNCHECKED = ""
    """The endpoint has no key."""
    VERIFIED = "verified"
    ALLOWED = "allowed"
    """Without a valid signature, but accepted: its sender cannot sign."""
    UNSIGNED = "refused_unsigned"
    FORGED = "refused_signature"
    """The signature is of another key, or of another frame."""
    REPLAYED = "refused_replay"
    """The signature is right and the timestamp is not newer than one that was accepted."""
    UNSAVED = "refused_unsaved"
    """The signature is right and the timestamp is beyond the one in the key file, which is being written."""

    is_refusal: bool

    def __init__(self, counter: str) -> None:
        self.is_refusal = counter.startswith("refused")


Judge = Callable[[bytes, int], Verdict]
"""Takes a frame with a right checksum and its message id."""


class Packed:
    """A message as payload bytes, not yet of a sender."""

    __slots__ = ("framed", "header", "id", "payload")

    def __init__(self, id: int, payload: bytes) -> None:
        self.id = id
        self.payload = payload
        """Without the trailing zeros, but at least one byte (serialization.md §payload_truncation)."""
        self.header = (-1, -1, -1, 0)
        """Sequence number, sender and flags of the last frame."""
        self.framed = b""
        """The last frame."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Packed) and (self.id, self.payload) == (other.id, other.payload)

    def __hash__(self) -> int:
        return hash((self.id, self.payload))


class Batch:
    """Messages of one sender that leave together, packed once for all channels."""

    __slots__ = ("_frames", "_sequence", "compid", "messages", "sender", "size", "sysid")

    def __init__(self, messages: Sequence[Packed], sysid: int, compid: int) -> None:
        self.messages = messages
        self.sysid = sysid
        self.compid = compid
        self.sender = (sysid, compid)
        self.size = 0
        """Bytes of the frames that `framed` returned."""
        self._sequence = -1
        self._frames: Sequence[bytes] = ()
        """The last unsigned frames, of which the first has this sequence number."""

    def framed(self, sequence: int) -> Sequence[bytes]:
        """Return the unsigned frames.

        Channels with the same streams are at the same sequence numbers: one frame is made for all of them.
        """
        if sequence != self._sequence:
            self._sequence = sequence
            self._frames = [
                frame(packed, sequence + place & 0xFF, self.sysid, self.compid)
                for place, packed in enumerate(self.messages)
            ]
            self.size = sum(map(len, self._frames))
        return self._frames


def pack(message: dialect.MAVLink_message) -> Packed:
    """The payload of a message.

    Raises `LocalProtocolError` when a field does not fit its wire type.
    """
    kind = type(message)
    try:
        packer = _packers.get(kind) or _payload_packer(kind)
        payload = packer(message)
    except (struct.error, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise LocalProtocolError(f"cannot encode {message.get_type()}: {error}") from error
    # Not message.id: some messages have a field of that name.
    return Packed(kind.id, payload.rstrip(b"\0") or payload[:1])


def frame(packed: Packed, seq: int, sysid: int, compid: int, flags: int = 0) -> bytes:
    """Return the version 2 frame of a packed message.

    With the flag `SIGNED` a signature has to follow. Channels with the same streams are at the same sequence numbers:
    one frame is made for all of them.
    """
    header = (seq, sysid, compid, flags)
    if header != packed.header:
        id, payload = packed.id, packed.payload
        body = _BODY.pack(len(payload), flags, 0, seq, sysid, compid, id & 0xFFFF, id >> 16) + payload
        packed.header, packed.framed = header, b"\xfd" + body + _CHECKSUM.pack(_crc(body + _EXTRA[id]))
    return packed.framed


def with_flags(raw: bytes, flags: int) -> bytes:
    """Return a version 2 frame without its signature and with these incompatibility flags.

    A CRC is linear, so the checksum changes by that of the changed bit, whatever the message's CRC_EXTRA is: frames
    with ids that are in none of our definitions are no exception.
    """
    end = HEADER_2 + raw[1]
    if raw[2] == flags:
        return raw[: end + CHECKSUM]
    change = bytes((0, raw[2] ^ flags)) + bytes(end - 2)
    checksum = (raw[end] | raw[end + 1] << 8) ^ _crc(change, 0)
    return raw[:2] + bytes((flags,)) + raw[3:end] + _CHECKSUM.pack(checksum)


_packers: dict[type[dialect.MAVLink_message], Callable[[Any], bytes]] = {}
"""One per message class, made when it is first sent."""


def _payload_packer(kind: type[dialect.MAVLink_message]) -> Callable[[Any], bytes]:
    """Return a function that packs messages of this class.

    pymavlink's own builds a header and copies on each call.
    """
    if kind.id not in dialect.mavlink_map:
        raise TypeError("it is no message of the dialect")
    codes = re.findall(r"(\d*)([a-zA-Z])", kind.unpacker.format)
    # pymavlink keeps the bytes of a text, which it decodes for its readers, under another name.
    fields = zip(kind.ordered_fieldnames, codes, strict=True)
    names = [f"_{name}_raw" if code in "cs" else name for name, (_, code) in fields]
    lengths = [int(count) if count and code != "s" else None for count, code in codes]
    packer, values = kind.unpacker.pack, attrgetter(*names)

    def pack_one(message: Any) -> bytes:
        return packer(values(message))

    def pack_scalars(message: Any) -> bytes:
        return packer(*values(message))

    def pack_array(message: Any) -> bytes:
        fields = values(message)
        array = fields[first]
        if len(array) != lengths[first]:
            raise ValueError(f"{names[first]} has {len(array)} elements, not {lengths[first]}")
        return packer(*fields[:first], *array, *fields[first + 1 :])

    def pack_arrays(message: Any) -> bytes:
        flat: list[Any] = []
        for name, length in zip(names, lengths, strict=True):
            value = getattr(message, name)
            if length is None:
                flat.append(value)
            elif len(value) != length:
                raise ValueError(f"{name} has {len(value)} elements, not {length}")
            else:
                flat += value
        return packer(*flat)

    arrays = [place for place, length in enumerate(lengths) if length is not None]
    first = arrays[0] if arrays else 0
    if arrays:
        _packers[kind] = pack_array if len(arrays) == 1 and len(names) > 1 else pack_arrays
    else:
        _packers[kind] = pack_one if len(names) == 1 else pack_scalars
    return _packers[kind]


_Reader = Callable[[bytes], dict[str, Any]]
_readers: dict[int, _Reader] = {}
"""One per message id, made when it first arrives."""


def unpack(id: int, payload: bytes) -> dialect.MAVLink_message:
    """Return the message in a payload of any length.

    Absent bytes are zero; surplus bytes belong to a newer dialect than ours. `id` is one of the dialect's.
    pymavlink's own
    decoder tests the checksum a second time and sorts the fields again for each frame; this one knows each class's
    fields
    once, and gives the same message.
    """
    message: dialect.MAVLink_message = object.__new__(dialect.mavlink_map[id])
    message.__dict__ = (_readers.get(id) or _reader(id))(payload)
    return message


def _reader(id: int) -> _Reader:
    """A function from a payload to the attributes of a message with this id."""
    kind: Any = dialect.mavlink_map[id]
    size, unpacker, names = kind.unpacker.size, kind.unpacker.unpack_from, tuple(kind.ordered_fieldnames)
    codes = [code for _, code in re.findall(r"(\d*)([a-zA-Z])", kind.unpacker.format)]
    has_texts = bool({"c", "s"}.intersection(codes))
    attributes = {} if has_texts else vars(kind(*([0] * len(names))))

    def read_numbers(payload: bytes) -> dict[str, Any]:
        result = attributes.copy()
        result.update(zip(names, unpacker(payload.ljust(size, b"\0")), strict=True))
        return result

    def read_arrays(payload: bytes) -> dict[str, Any]:
        result = attributes.copy()
        flat = unpacker(payload.ljust(size, b"\0"))
        for name, first, length in zip(names, starts, kind.lengths, strict=True):
            result[name] = flat[first] if length == 1 else list(flat[first : first + length])
        return result

    def read_any(payload: bytes) -> dict[str, Any]:
        flat = unpacker(payload.ljust(size, b"\0"))
        values: list[Any] = []
        for order in kind.orders:
            first, length = starts[order], kind.lengths[order]
            value = flat[first]
            if isinstance(value, bytes):
                values.append(value.rstrip(b"\0"))
            else:
                values.append(value if length == 1 else list(flat[first : first + length]))
        message: dialect.MAVLink_message = kind(*values)
        return vars(message)

    starts = [sum(kind.lengths[:order]) for order in range(len(kind.lengths))]
    if has_texts:
        _readers[id] = read_any
    else:
        _readers[id] = read_numbers if all(length == 1 for length in kind.lengths) else read_arrays
    return _readers[id]


class ReceivedFrame(msgspec.Struct, frozen=True):
    """One frame that arrived whole."""

    message: Any
    """A message of the dialect, or None: its id is in none of our definitions, and so its checksum means nothing."""
    id: int
    sysid: int
    compid: int
    raw: bytes
    verdict: Verdict = Verdict.UNCHECKED
    """Of its signature."""

    @property
    def identity(self) -> bytes:
        """Return what no router on its way changes: sequence number, sender and message."""
        raw = self.version_2()
        return raw[4 : HEADER_2 + raw[1]]

    def version_2(self) -> bytes:
        """Return the frame in MAVLink 2, as it is forwarded.

        A version 1 frame is framed again; its sequence number is kept.
        """
        if self.raw[0] == MAGIC_2:
            return self.raw
        payload = self.raw[HEADER_1:-CHECKSUM]
        return frame(Packed(self.id, payload.rstrip(b"\0") or payload[:1]), self.raw[2], self.sysid, self.compid)


class Parser:
    """Finds frames in bytes.

    Other bytes cost a counter, and at most one checksum per start mark in them. After a frame with a wrong checksum
    the
    search goes on one byte later, not behind its length, so a false start mark never hides the real frame behind it.
    Ids
    that we do not know have no checksum to test; they pass only from a source that has sent a message with a good
    one, and
    only if another start mark, or the end of the datagram, follows.

    Of an endpoint with a key, `judge` decides about each frame with a good checksum; ids that we do not know need a
    valid signature there. Refused frames are counted, and are no frames for what follows.
    """

    def __init__(self, judge: Judge | None = None) -> None:
        self.counters: Counter[str] = Counter()
        """frames, unknown_frames, bad_checksums (start marks with a plausible header that were none), garbage_bytes,
        lost_frames (by the gaps in their senders' numbers), and the refusals among `Verdict`."""
        self._judge = judge
        self._pending = b""
        self._sources: dict[tuple[int, int], int] = {}
        """(system, component) that has sent a good frame -> sequence number of its last one."""

    def receive(self, data: bytes) -> list[ReceivedFrame]:
        """The frames that end in `data`; the beginning of another is kept for the next call."""
        buffer = self._pending + data
        found, end = self._scan(buffer, whole=False)
        self._pending = buffer[end:]
        return found

    def receive_datagram(self, data: bytes) -> list[ReceivedFrame]:
        """Return the frames in a whole datagram; a frame that does not end in it is invalid."""
        self._pending = b""
        found, end = self._scan(data, whole=True)
        while end < len(data):
            # What looked like a beginning is given up by one byte, too: a real frame may be in it.
            self.counters["garbage_bytes"] += 1
            data = data[end + 1 :]
            more, end = self._scan(data, whole=True)
            found += more
        return found

    def _scan(self, buffer: bytes, *, whole: bool) -> tuple[list[ReceivedFrame], int]:
        """Return the frames in `buffer` and the start of the incomplete one.

        Without an incomplete frame the second value is the buffer's length.
        """
        found: list[ReceivedFrame] = []
        position, size = 0, len(buffer)
        while position < size:
            if buffer[position] not in _MAGICS:
                start = _NEXT_MAGIC.search(buffer, position)
                next_position = size if start is None else start.start()
                self.counters["garbage_bytes"] += next_position - position
                position = next_position
                continue
            length = self._length(buffer, position, size)
            if length is None:
                return found, position
            end = position + length
            if length and end > size:
                return found, position
            received = self._decode(buffer[position:end]) if length else None
            if received is not None and received.verdict.is_refusal:
                self.counters[received.verdict.value] += 1
                position = end
                continue
            if received is not None and received.message is None:
                is_certain = received.verdict is Verdict.VERIFIED
                if end == size and not whole and not is_certain:
                    return found, position
                if end < size and buffer[end] not in _MAGICS and not is_certain:
                    received = None
                else:
                    self.counters["unknown_frames"] += 1
            if received is None:
                self.counters["garbage_bytes"] += 1
                position += 1
            else:
                found.append(received)
                position = end
        return found, size

    def _length(self, buffer: bytes, position: int, size: int) -> int | None:
        """Return the length of the frame that begins here.

        Returns 0 if its header cannot be one, None if too few bytes have arrived to decide.
        """
        if buffer[position] == MAGIC_1:
            if size < position + HEADER_1:
                return None
            payload, id = buffer[position + 1], buffer[position + 5]
            limits = _VERSION_1_LENGTHS.get(id)
            return HEADER_1 + payload + CHECKSUM if limits and limits[0] <= payload <= limits[1] else 0
        if size < position + 3:
            return None
        flags = buffer[position + 2]
        if flags & ~SIGNED:
            return 0
        if size < position + HEADER_2:
            return None
        id = buffer[position + 7] | buffer[position + 8] << 8 | buffer[position + 9] << 16
        if id not in _EXTRA and (buffer[position + 5], buffer[position + 6]) not in self._sources:
            return 0
        return HEADER_2 + buffer[position + 1] + CHECKSUM + (SIGNATURE if flags else 0)

    def _decode(self, raw: bytes) -> ReceivedFrame | None:
        """Return the message in a frame of the right length, or None if its checksum is wrong."""
        if raw[0] == MAGIC_1:
            _, size, seq, sysid, compid, id = raw[:HEADER_1]
            begin, flags, compatible = HEADER_1, 0, 0
        else:
            _, size, flags, compatible, seq, sysid, compid, low, middle, high = raw[:HEADER_2]
            begin, id = HEADER_2, low | middle << 8 | high << 16
        extra = _EXTRA.get(id)
        if extra is None:
            verdict = Verdict.UNCHECKED if self._judge is None else self._judge(raw, id)
            # Without a checksum that can be tested, nothing but a good signature says that this is a frame.
            return None if verdict.is_refusal else ReceivedFrame(None, id, sysid, compid, raw, verdict)
        end = begin + size
        if _crc(raw[1:end] + extra) != raw[end] | raw[end + 1] << 8:
            self.counters["bad_checksums"] += 1
            return None
        verdict = Verdict.UNCHECKED if self._judge is None else self._judge(raw, id)
        if verdict.is_refusal:
            return ReceivedFrame(None, id, sysid, compid, raw, verdict)
        message = unpack(id, raw[begin:end])
        message._header = dialect.MAVLink_header(id, flags, compatible, size, seq, sysid, compid)
        self.counters["frames"] += 1
        source = (sysid, compid)
        last = self._sources.get(source)
        if last is not None and (gap := (seq - last - 1) & 0xFF):
            self.counters["lost_frames"] += gap
        if last is not None or len(self._sources) < MAX_SOURCES:
            self._sources[source] = seq
        return ReceivedFrame(message, id, sysid, compid, raw, verdict)


def _base_length(kind: type[dialect.MAVLink_message]) -> int:
    """Length without extension fields: those are the ones that a constructor gives a default."""
    parameters = inspect.signature(kind.__init__).parameters.values()
    extensions = sum(parameter.default is not parameter.empty for parameter in parameters)
    codes = re.findall(r"\d*[a-zA-Z]", kind.unpacker.format)
    return struct.calcsize("<" + "".join(codes[: len(codes) - extensions]))


_VERSION_1_LENGTHS = {
    id: (_base_length(kind), kind.unpacker.size) for id, kind in dialect.mavlink_map.items() if id <= 0xFF
}
"""Version 1 knows neither truncation nor extensions, but pymavlink sends the latter in it."""


def char_field(text: str | None, size: int) -> bytes:
    """Return the characters of a text that fit into a field of `size` bytes, in UTF-8.

    No character is divided: half of one is no UTF-8, and strict readers reject the text. Empty for None.
    """
    return (text or "").encode(errors="replace")[:size].decode(errors="ignore").encode()

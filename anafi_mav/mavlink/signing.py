"""Signatures of MAVLink 2: signs and verifies the frames of one key. No I/O.

A signature is the first 48 bits of SHA-256 over key, frame, link id and timestamp (MAVLink message_signing.md). Time
stamps count 10 µs since 2015 and only grow, so that a recorded frame cannot be sent again. They are saved ahead: the
file holds a timestamp that has not been reached yet, and after a crash everything up to it counts as used. What is
beyond it is not used before the file is written. A shell, `key_ring`, keeps the time and the file. Next floor:
`channel`.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
from collections import Counter
from collections.abc import Callable

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import MAGIC_2, SIGNED, Verdict

KEY_BYTES = 32

EPOCH = 1_420_070_400
"""s from 1970 to 2015 (message_signing.md §timestamp)."""

TICKS = 100_000
"""Timestamps in a second."""

NEW_STREAM_AGE = 60 * TICKS
"""How far the first frame of a stream may be behind our own timestamp (message_signing.md §timestamp)."""

LATEST = 0xF000_0000_0000
"""Timestamps from here on, of the year 2098, are refused: a sender must not use up the 48 bits."""

RELEASED = (1_790_000_000 - EPOCH) * TICKS
"""A moment of 2026. A computer without a clock counts as not older than this program."""

FARTHEST_AHEAD = 10 * 365 * 86_400 * TICKS
"""How far a frame or SETUP_SIGNING may be ahead of our clock. One station with a wrong clock then leaves timestamps for
everybody else. Ten years: the clock of a computer without a battery may be that late, and must lock no station out."""

SAVED_AHEAD = 10 * TICKS
"""How far the saved timestamp is ahead. After a crash a station that hears nothing of us waits so long at most."""

SAVED_AHEAD_BURST = TICKS
"""How far our timestamp stays behind the saved one: 100 000 frames that we sign while a slow disk is written. While our
timestamp is ahead of the clock already, four times this is saved ahead: restarts in quick succession do not carry the
timestamp further and further away from the clock."""

MAX_STREAMS = 1024
"""Streams whose timestamps are remembered: those of 250 systems with four components."""

LONGEST_LAG = 5 * TICKS
"""How far a frame may be behind the newest of its stream on another channel. Two stations may have the same ids; each
follows our timestamps, so it is behind by one round trip."""

MAX_RECENT = 512
"""Timestamps of one stream that are remembered one by one: 5 s of two stations with a joystick."""

UNSIGNED_ALLOWED = frozenset(
    {
        dialect.MAVLINK_MSG_ID_RADIO_STATUS,
        dialect.MAVLINK_MSG_ID_ADSB_VEHICLE,
        dialect.MAVLINK_MSG_ID_COLLISION,
    }
)
"""Messages that are accepted without a signature, because their senders, radios and receivers, cannot sign: those of
PX4's mavlink_sign_control.cpp. DEVIATION: PX4's documentation of 2026 has HEARTBEAT, too; here an unsigned heartbeat
would keep a lost station alive."""

_NO_KEY = bytes(KEY_BYTES)
_TAIL = struct.Struct("<BQ")
_CONTENT = struct.Struct(f"<{KEY_BYTES}sQ")
CONTENT_BYTES = _CONTENT.size
"""Of a key file, 40: the key, then the timestamp (uint64, little-endian), as PX4's message_signing.md has it."""

_SIGNATURE = 6
_sha256 = hashlib.sha256

Stream = tuple[int, int, int]
"""System, component and link id."""


class _StreamMemory:
    """Timestamps that one stream has used, on whichever channel: each is accepted once."""

    def __init__(self, stamp: int) -> None:
        self.newest = stamp
        self._floor = stamp
        """What is not above it is refused."""
        self._recent: dict[bytes, int] = {}
        """Those above it by timestamp and signature, in the order of their arrival. Not by timestamp alone: two senders
        that follow the same frame of ours go on with the same one."""

    def has_used(self, stamp: int, tail: bytes) -> bool:
        """Return True for a frame that was used, or is too old to be known."""
        return stamp <= self._floor or stamp + LONGEST_LAG < self.newest or tail in self._recent

    def use(self, stamp: int, tail: bytes) -> None:
        self.newest = max(self.newest, stamp)
        self._recent[tail] = stamp
        while len(self._recent) > MAX_RECENT or next(iter(self._recent.values())) + LONGEST_LAG < self.newest:
            self._floor = max(self._floor, self._recent.pop(next(iter(self._recent))))


def ticks(now: float) -> int:
    """Return the timestamp of a moment (s since 1970); 0 for a clock that was never set."""
    return max(0, int((now - EPOCH) * TICKS))


def key_of_passphrase(passphrase: str) -> bytes:
    """Return the key that MAVProxy makes of a passphrase.

    So do Mission Planner and QGroundControl up to 5.0.
    """
    return hashlib.sha256(passphrase.encode()).digest()


def qgroundcontrol_key_of_passphrase(passphrase: str) -> bytes:
    """Return the key that QGroundControl's list of keys makes of a passphrase.

    MAVLinkSigningKeys.h of 2026: PBKDF2 with a fixed salt, so that all stations make the same key.
    """
    salt = b"QGroundControl-MAVLink-Signing-v1"
    return hashlib.pbkdf2_hmac("sha256", passphrase.encode(), salt, 600_000, KEY_BYTES)


class Signing:
    """The key of the endpoints that name it, with its timestamps.

    Without a key, `is_on` is False and frames are neither signed nor verified. SETUP_SIGNING may set, replace and
    remove the key while endpoints are open.
    """

    def __init__(self, name: str, content: bytes = bytes(CONTENT_BYTES)) -> None:
        """`content` is that of a key file. Raises `LocalProtocolError` for another length."""
        if len(content) != CONTENT_BYTES:
            raise LocalProtocolError(f"a key file has {CONTENT_BYTES} bytes, not {len(content)}")
        self.name = name
        self.refused: Counter[str] = Counter()
        """Refused frames by `Verdict` value, of all endpoints with this key."""
        self.last_refused = ""
        """Channel of the newest of them."""
        secret, timestamp = _CONTENT.unpack(content)
        self._secret: bytes = secret
        self.is_on: bool = secret != _NO_KEY
        """True while frames are signed and verified."""
        self.saved: int = timestamp
        """The timestamp in the file."""
        self.is_kept = False
        """True while the file is written in time: then no timestamp beyond it is used, and no crash repeats one."""
        self.on_due: Callable[[], None] | None = None
        """Called when `due` has a timestamp to save, once or more often until it is saved."""
        self._wanted = 0
        """The newest timestamp of a verified frame that was refused because it is not covered by the file."""
        self.timestamp: int = timestamp
        """The newest that was used by us or seen in a verified frame."""
        self._floor = self.saved
        """A stream that is not remembered begins above it: what was recorded before a restart is not accepted again."""
        self._latest: int = min(max(RELEASED, timestamp) + FARTHEST_AHEAD, LATEST)
        """Timestamps from here on are too far ahead of the clock."""
        self._streams: dict[Stream, _StreamMemory] = {}
        """Of senders that are not ours, by what they signed and by what we signed for them."""
        self._own: dict[tuple[int, int], int] = {}
        """The newest timestamp of each of our systems and components."""
        self._link_ids: set[int] = set()

    def __repr__(self) -> str:
        return f"<Signing {self.name}: {'on' if self.is_on else 'off'}>"

    def is_key(self, secret: bytes) -> bool:
        """Return True for the present key."""
        return hmac.compare_digest(self._secret, secret)

    def content(self, timestamp: int | None = None) -> bytes:
        """Return the content of the key file, with this timestamp in place of the newest one."""
        return _CONTENT.pack(self._secret, self.timestamp if timestamp is None else timestamp)

    def replace(self, secret: bytes, timestamp: int = 0) -> None:
        """Use another key, zeros for none.

        Timestamps never step back, and one that is too far ahead is ignored.
        Raises `LocalProtocolError` for a key of another length.
        """
        if len(secret) != KEY_BYTES:
            raise LocalProtocolError(f"a key has {KEY_BYTES} bytes, not {len(secret)}")
        self._secret, self.is_on = secret, secret != _NO_KEY
        self._wanted = 0
        self._streams.clear()
        self._floor = self.timestamp
        if timestamp < self._limit:
            self.timestamp = max(self.timestamp, timestamp)

    def take_link_id(self) -> int:
        """Return the lowest free link id for a channel: a station remembers 16 streams of ours only.

        Not 0: pymavlink, which has 0 itself, then takes ours, so that two clients with the same ids are two streams.
        255 is shared when all are taken.
        """
        link_id = next((number for number in range(1, 255) if number not in self._link_ids), 255)
        self._link_ids.add(link_id)
        return link_id

    def give_back_link_id(self, link_id: int) -> None:
        """The channel with this link id is closed."""
        self._link_ids.discard(link_id)

    # Time.

    def advance(self, now: float) -> None:
        """Let the timestamp follow the clock (s since 1970). It never steps back.

        Behind a clock that leaps it waits until the file is written.
        """
        clock = ticks(now)
        if clock < LATEST:
            reached = min(clock, self.saved - SAVED_AHEAD_BURST) if self.is_kept else clock
            self.timestamp = max(self.timestamp, reached)
            self._latest = max(self._latest, min(clock + FARTHEST_AHEAD, LATEST))

    def due(self, now: float) -> int | None:
        """Return the timestamp to save, or None while the saved one is far enough ahead."""
        clock = ticks(now) if ticks(now) < LATEST else 0
        reached = max(self.timestamp, self._wanted)
        if not self.is_on or max(reached, clock) + 2 * SAVED_AHEAD_BURST < self.saved:
            return None
        return max(reached + 4 * SAVED_AHEAD_BURST, clock + SAVED_AHEAD)

    @property
    def _limit(self) -> int:
        """Timestamps from here on are refused.

        A station that follows ours is a second ahead at most.
        """
        return min(max(self._latest, self.timestamp + TICKS), LATEST)

    # Frames.

    def sign(self, raw: bytes, link_id: int, *, is_own: bool = True) -> bytes:
        """Return a frame that has the flag `SIGNED` with its signature.

        `is_own`: its sender is one of our systems. A frame that comes back to us is an old one.
        """
        self.timestamp = stamp = self.timestamp + 1
        raw += _TAIL.pack(link_id, stamp)[:7]
        raw += _sha256(self._secret + raw).digest()[:_SIGNATURE]
        if is_own:
            self._own[raw[5], raw[6]] = stamp
        else:
            self._use((raw[5], raw[6], link_id), stamp, raw[-12:])
        return raw

    def judge(self, raw: bytes, id: int, newest: dict[Stream, int]) -> Verdict:
        """Return the verdict on a frame whose checksum is right.

        `newest`: the newest timestamps of its channel by stream. That of a verified frame is written there, and is
        accepted on no other channel.
        """
        if raw[0] != MAGIC_2 or not raw[2] & SIGNED:
            return Verdict.ALLOWED if id in UNSIGNED_ALLOWED else Verdict.UNSIGNED
        if not hmac.compare_digest(_sha256(self._secret + raw[:-_SIGNATURE]).digest()[:_SIGNATURE], raw[-_SIGNATURE:]):
            return Verdict.FORGED
        stamp = int.from_bytes(raw[-12:-6], "little")
        stream = (raw[5], raw[6], raw[-13])
        if stamp >= self._limit or stamp <= self._own.get(stream[:2], -1) or stamp <= newest.get(stream, -1):
            return Verdict.REPLAYED
        memory = self._streams.get(stream)
        if memory is None:
            if stamp <= self._floor or stamp + NEW_STREAM_AGE < self.timestamp:
                return Verdict.REPLAYED
        elif memory.has_used(stamp, raw[-12:]):
            return Verdict.REPLAYED
        if self.is_kept and stamp + 2 * SAVED_AHEAD_BURST >= self.saved:
            is_covered = stamp + SAVED_AHEAD_BURST < self.saved
            self._wanted = max(self._wanted, stamp)
            if self.on_due is not None:
                self.on_due()
            if not is_covered:
                return Verdict.UNSAVED
        self._use(stream, stamp, raw[-12:])
        if len(newest) >= MAX_STREAMS:
            newest.clear()  # the memories of the streams still refuse what was used
        newest[stream] = stamp
        self.timestamp = max(self.timestamp, stamp)
        return Verdict.VERIFIED

    def _use(self, stream: Stream, stamp: int, tail: bytes) -> None:
        """Remember a timestamp.

        If there are too many streams, the oldest is forgotten: what it sent remains refused.
        """
        memory = self._streams.get(stream)
        if memory is not None:
            memory.use(stamp, tail)
            return
        if len(self._streams) >= MAX_STREAMS:
            oldest = min(self._streams, key=lambda each: self._streams[each].newest)
            self._floor = max(self._floor, self._streams.pop(oldest).newest)
        self._streams[stream] = _StreamMemory(stamp)

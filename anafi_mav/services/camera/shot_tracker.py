"""Pictures of photos, bursts and series, from the drone's events about them. No I/O.

A drone reports that a photo begins, that the shutter has opened (with a count, or without), and that the media is
stored. A burst is one media of many pictures, and some reports of its shots are left out: the times of those are spread
between the reports. Reports may come twice, late or not at all.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import msgspec

from anafi_mav.drone.payload.camera_state import CaptureProgress, CaptureUpdate

COUNT = 256
"""The drone's count of pictures is modulo this (u8)."""

MOST = 1000
"""Pictures that wait for a report: a burst has 14, and those of a series leave while it lasts."""

UNSAVED = 0.8
"""s after the shutter at which a picture of a series is reported without its media.

A drone of the newer feature reports the media of a series only at its end.
"""

LOST = 10.0
"""s after the end of a photo at which a picture that is not reported as stored counts as lost."""


T = TypeVar("T")


class CapturedShot(msgspec.Struct, frozen=True):
    """One picture that is stored, or lost."""

    capture: int
    """Number of the photo, burst or series that it belongs to."""
    number: int
    """From 1 within that."""
    at: float
    """When the shutter opened: s, on the clock of the events."""
    is_saved: bool


class ShotTracker:
    """Pictures of one camera. Times are those of the events, s."""

    def __init__(self, capture: int = 0) -> None:
        self.capture = capture
        """Number of the photo, burst or series under way, or of the last one."""
        self._is_open = False
        self._since = 0.0
        """When the last report of a shot was received, or the capture began."""
        self._shots: list[float] = []
        """Shutter times of all pictures of the capture that are not reported yet."""
        self._taken = 0
        """Pictures of the capture."""
        self._reported = 0
        self._ended: float | None = None
        self.media = ""
        """Media id of the capture; empty until it is reported."""
        self._media_before = ""
        """Media id of the capture before, which may be reported again."""

    @property
    def pending(self) -> tuple[float, ...]:
        """The shutter times of pictures that are not reported yet."""
        return tuple(self._shots)

    @property
    def taken(self) -> int:
        """Pictures of the capture under way, or of the last one."""
        return self._taken

    def receive(self, update: CaptureUpdate, now: float) -> list[CapturedShot]:
        """Take an event about a photo; return the pictures that it completes."""
        match update.progress:
            case CaptureProgress.STARTED:
                return self._open(now)
            case CaptureProgress.TAKEN:
                lost = self._open(now)
                self._take(1 if update.count is None else self._more(update.count), now)
                return lost
            case CaptureProgress.SAVED:
                return self._save(update, now)
            case CaptureProgress.FAILED:
                return [] if update.is_refused else self._fail(now)
            case CaptureProgress.ENDED:
                if self._is_open:
                    self._is_open, self._ended = False, now
        return []

    def expire(self, now: float, *, is_series: bool) -> list[CapturedShot]:
        """Return the pictures that are not waited for any longer.

        `is_series`: a series of single pictures is under way.
        """
        if self._ended is not None and now - self._ended >= LOST:
            self._ended = None
            return self._report(len(self._shots), is_saved=False)
        if is_series and self._is_open:
            late = sum(1 for at in self._shots if now - at >= UNSAVED)
            return self._report(late, is_saved=True)
        return []

    def _open(self, now: float) -> list[CapturedShot]:
        """Begin a capture, unless one is under way; return the lost pictures of the one before."""
        if self._is_open:
            return []
        lost = self._report(len(self._shots), is_saved=False)
        self.capture += 1
        self._is_open, self._since, self._ended = True, now, None
        self._shots, self._taken, self._reported = [], 0, 0
        self.media, self._media_before = "", self.media or self._media_before
        return lost

    def _open_unreported(self, update: CaptureUpdate, now: float) -> None:
        """Begin the capture of a media whose other reports were lost, but for those of its pictures."""
        was_open, shots = self._is_open, self._shots
        self._is_open, self._shots = False, []
        self._open(now)
        self._shots = shots or ([now] if was_open else [])
        self._taken = len(self._shots)
        if was_open and update.count is not None:
            self._taken = update.count  # it may continue the count of the media before

    def _more(self, count: int) -> int:
        """Return how many pictures a count adds; none for one that is older than the last."""
        more = (count - self._taken) % COUNT
        return more if more < COUNT // 2 else 0

    def _take(self, pictures: int, now: float) -> None:
        step = (now - self._since) / max(pictures, 1)
        room = max(MOST - len(self._shots), 0)
        self._shots += [self._since + step * number for number in range(1, min(pictures, room) + 1)]
        self._taken += pictures
        if pictures:
            self._since = now

    def _save(self, update: CaptureUpdate, now: float) -> list[CapturedShot]:
        if update.media and update.media == self._media_before:
            return []  # the same report again
        is_known = self._is_open or bool(self._shots) or self._ended is not None
        if update.media and self.media not in ("", update.media):
            self._open_unreported(update, now)
        elif not is_known:
            if self._taken and (not update.media or update.media == self.media):
                return []  # the same report again
            self._open(now)
        self.media = update.media or self.media
        if update.count is not None:
            self._take(self._more(update.count), now)
        elif not self._taken:
            self._take(1, now)
        found = self._report(len(self._shots), is_saved=True)
        self._ended = None
        self._is_open = self._is_open and not update.is_last
        return found

    def _fail(self, now: float) -> list[CapturedShot]:
        if not self._is_open and not self._shots:
            return []  # a photo that never began
        if not self._taken:
            self._take(1, now)
        self._is_open, self._ended = False, None
        return self._report(len(self._shots), is_saved=False)

    def _report(self, count: int, *, is_saved: bool) -> list[CapturedShot]:
        shots, self._shots = self._shots[:count], self._shots[count:]
        first = self._reported + 1
        self._reported += len(shots)
        return [CapturedShot(self.capture, first + n, at, is_saved) for n, at in enumerate(shots)]


def named(files: Iterable[tuple[str, T]]) -> list[T]:
    """Return the files of the pictures of a media, in their sequence.

    `files` are pairs of name and file. A picture may have a JPEG and a DNG; the JPEG is its file.
    """
    found: dict[str, tuple[bool, T]] = {}
    for name, file in files:
        stem, _, kind = name.rpartition(".")
        is_jpeg = kind.upper() in ("JPG", "JPEG")
        known = found.get(stem)
        if known is None or (is_jpeg and not known[0]):
            found[stem] = (is_jpeg, file)
    return [file for _, (_, file) in sorted(found.items(), key=lambda pair: pair[0])]

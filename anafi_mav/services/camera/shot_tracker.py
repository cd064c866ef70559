"""Pictures of photos, bursts and series, from the drone's events about them. No I/O.

A drone reports that a photo begins, that the shutter has opened (with a count, or without), and that the media is
stored. A burst is one media of many pictures, and some reports of its shots are left out: the times of those are spread
between the reports. Reports may come twice, late or not at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypeVar

import msgspec

from anafi_mav.drone.payload.camera_state import CaptureProgress, CaptureUpdate

COUNT = 256
"""The drone's count of pictures is modulo this (u8)."""

OLDER = 4
"""Pictures by which a count may be older than the last one at the begin of a connection: pictures are stored after the
next ones are taken. Otherwise such a count is one of many pictures that were taken without a connection."""

MOST = 1000
"""Pictures that wait for a report: a burst has 14, and those of a series leave while it lasts."""

UNSAVED = 0.8
"""s after the shutter at which a picture of a series is reported without its media.

A drone of the newer feature reports the media of a series only at its end.
"""

LOST = 10.0
"""s after the end of a photo at which a picture that is not reported as stored counts as lost."""

UNANNOUNCED = 1.0
"""s after a shutter without a count in which the begin of its photo is reported. A later begin is that of the next one:
the shutter was that of the photo before, reported again."""

LATE = 1.2
"""s by which a report may be late."""

REPEATED = 4
"""Media ids that are remembered, because the drone may report them again."""

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


class _Capture:
    """A photo, burst or series, and its pictures."""

    def __init__(self, number: int, now: float = 0.0, camera: int = 0, *, is_open: bool = False) -> None:
        self.number = number
        self.camera = camera
        self.is_open = is_open
        self.is_announced = True
        """False when a shutter without a count has begun it, which may be that of the photo before."""
        self.begun = now
        """When it began, s; -inf: before the connection."""
        self.since = now
        """When the last report of a shot was received, or the capture began."""
        self.shots: list[float] = []
        """Shutter times of the pictures that are not reported yet."""
        self.taken = 0
        self.overdue = 0
        """Pictures of a time-lapse that were due before the last one: their reports may follow it at once."""
        self.reported: int | None = 0
        """Pictures that are reported; None: not known yet, of a capture that was under way at the connection."""
        self.ended: float | None = None
        """When the drone reported the end of a capture whose media is not reported yet."""
        self.media = ""
        """Media id; empty until it is reported."""

    def more(self, count: int) -> int:
        """Return how many pictures a count adds; none for one that is older than the last."""
        more = (count - self.taken) % COUNT
        if self.reported is None:
            if more >= COUNT - OLDER:
                return 0
            self.taken += max(more - 1, 0)  # without a connection
            return min(more, 1)
        return more if more < COUNT // 2 else 0

    def has_taken(self, count: int | None) -> bool:
        """Return True for a count that adds nothing."""
        return count is not None and bool(self.taken) and self.reported is not None and not self.more(count)

    def counts(self, update: CaptureUpdate) -> bool:
        """Return True for a report that counts as many pictures as this capture has."""
        return update.count is not None and update.count == self.taken % COUNT

    def has_reported(self, now: float, most: int | None, interval: float | None) -> bool:
        """Return True for a shutter without a count that is one of before, reported again.

        `most` pictures are taken, or one each `interval` s.
        """
        if most is not None and self.taken >= most:
            return True
        if interval is None or not self.taken or self.reported is None:
            return False
        follows = now - self.since < interval - LATE and not self.overdue
        return follows or self.taken > (now - self.begun + LATE) / interval

    def _overdue_after(self, now: float, interval: float) -> int:
        """Return `overdue` after a picture that is reported now."""
        since = now - self.since
        due = int(since / interval) - (1 if self.taken else 0)
        left = self.overdue - 1 if since < interval - LATE else 0
        return max(due, left, 0)

    def continues(self, update: CaptureUpdate) -> bool:
        """Return True for the shutter of a picture of this capture, whose end was reported before."""
        if self.ended is None or self.camera != update.camera or update.count is None or not self.taken:
            return False
        return self.reported is not None and self.more(update.count) > 0

    def announce(self, now: float) -> None:
        """Note the reported begin, which may be later than the first shutter."""
        if not self.is_announced and now - self.since > UNANNOUNCED:
            self.shots, self.taken, self.since = [], 0, now
        self.is_announced = True

    def take(self, pictures: int, now: float, interval: float | None = None) -> None:
        """Add pictures, spread over the time since the last report; `interval` as in `has_reported`."""
        if pictures and interval is not None:
            self.overdue = self._overdue_after(now, interval)
        if self.reported is None and pictures:
            self.reported = self.taken
        step = (now - self.since) / max(pictures, 1)
        room = max(MOST - len(self.shots), 0)
        self.shots += [self.since + step * number for number in range(1, min(pictures, room) + 1)]
        self.taken += pictures
        if pictures:
            self.since = now

    def end(self, now: float) -> None:
        """Note that nothing more is taken."""
        if self.is_open:
            self.is_open, self.ended = False, now

    def expire(self, now: float) -> list[CapturedShot]:
        """Return the pictures that are not waited for any longer after the end."""
        if self.is_open and not self.is_announced and now - self.since > LOST:
            self.is_open, self.shots, self.taken = False, [], 0  # no photo of its own
        if self.ended is None or now - self.ended < LOST:
            return []
        self.ended = None
        return self.report_all(is_saved=False)

    def report_all(self, *, is_saved: bool) -> list[CapturedShot]:
        """Return all pictures that are not reported yet."""
        return self.report(len(self.shots), is_saved=is_saved)

    def report(self, count: int, *, is_saved: bool) -> list[CapturedShot]:
        """Return the first of the pictures that are not reported yet."""
        shots, self.shots = self.shots[:count], self.shots[count:]
        first = (self.reported or 0) + 1
        if shots:
            self.reported = first - 1 + len(shots)
        return [CapturedShot(self.number, first + n, at, is_saved) for n, at in enumerate(shots)]


class ShotTracker:
    """Pictures of one camera at a time. Times are those of the events, s.

    The drone may report a photo as stored when the next one has begun, so the capture before is kept.
    """

    def __init__(self, capture: int = 0) -> None:
        self._now = _Capture(capture)
        """The capture under way, or the last one."""
        self._before = _Capture(capture)
        """The one before that."""
        self._captures: dict[str, int] = {}
        """Numbers of the captures of the last media ids, each of which may be reported again."""

    def join(self, camera: int, taken: int, since: float) -> None:
        """Follow a photo that is under way when a connection begins.

        `taken`: its pictures so far, or fewer; a report may count on. They were taken on an earlier connection, or
        without one. `since`: when the last of them was reported, or now.
        """
        self._now = _Capture(self.capture + 1, since, camera, is_open=True)
        self._now.taken, self._now.reported, self._now.begun = taken, None, -math.inf

    @property
    def is_open(self) -> bool:
        """True while a photo, burst or series is under way."""
        return self._now.is_open

    @property
    def since(self) -> float:
        """Time of the last picture of that capture that was reported, or of its begin."""
        return self._now.since

    @property
    def capture(self) -> int:
        """Number of the photo, burst or series under way, or of the last one."""
        return self._now.number

    @property
    def camera(self) -> int | None:
        """Camera of the photo under way, or whose pictures are not all reported; None: none."""
        return self._now.camera if self._now.is_open or self._now.shots else None

    @property
    def media(self) -> str:
        """Media id of that capture; empty until it is reported."""
        return self._now.media

    @property
    def pending(self) -> tuple[float, ...]:
        """The shutter times of pictures that are not reported yet."""
        return (*self._before.shots, *self._now.shots)

    @property
    def taken(self) -> int:
        """Pictures of the capture under way; 0 without one."""
        return self._now.taken if self._now.is_open else 0

    def capture_of(self, media: str) -> int:
        """Return the number of the capture that is stored as this media; 0: not known."""
        return self._captures.get(media, 0)

    def media_of(self, capture: int) -> str:
        """Return the media that a capture is stored as; empty until it is reported."""
        return next((media for media, number in self._captures.items() if number == capture), "")

    @property
    def awaits_capture_before(self) -> bool:
        """True while the capture before has pictures to report: they are stored, or fail, first."""
        return bool(self._before.shots)

    def is_over(self, media: str) -> bool:
        """Return True when the pictures of this media are all taken."""
        return not self._now.is_open or self.capture_of(media) != self.capture

    def receive(
        self, update: CaptureUpdate, now: float, most: int | None = None, interval: float | None = None
    ) -> list[CapturedShot]:
        """Take an event about a photo; return the pictures that it completes.

        For events without a count: `most` pictures of the capture under way, and the `interval` (s) of a time-lapse;
        None: not known.
        """
        if interval is not None and interval <= 0.0:
            interval = None
        match update.progress:
            case CaptureProgress.STARTED:
                return self._open(update, now)
            case CaptureProgress.TAKEN:
                if not self._now.is_open and self._now.has_taken(update.count):
                    return []  # the same report again; of another photo its media is reported too
                lost = [] if self._now.continues(update) else self._open(update, now)
                is_repeated = update.count is None and self._now.has_reported(now, most, interval)
                more = 1 if update.count is None else self._now.more(update.count)
                self._now.take(0 if is_repeated else more, now, interval)
                return lost
            case CaptureProgress.SAVED:
                return self._save(update, now)
            case CaptureProgress.FAILED:
                return [] if update.is_refused else self._fail(now)
            case CaptureProgress.ENDED:
                self._now.end(now)
        return []

    def expire(self, now: float, *, is_series: bool) -> list[CapturedShot]:
        """Return the pictures that are not waited for any longer.

        `is_series`: a series of single pictures is under way.
        """
        lost = self._before.expire(now) + self._now.expire(now)
        if is_series and self._now.is_open:
            late = sum(1 for at in self._now.shots if now - at >= UNSAVED)
            return lost + self._now.report(late, is_saved=True)
        return lost

    def _open(self, update: CaptureUpdate, now: float) -> list[CapturedShot]:
        """Begin a capture, unless one is under way; return lost pictures of an earlier one.

        One of another camera is over, although its end was not reported: a drone takes photos with one at a time. One
        without a picture has been ended by the late state of the photo before, and goes on.
        """
        last = self._now
        if last.camera == update.camera:
            if last.is_open and not self._is_next(update):
                if update.progress is CaptureProgress.STARTED:
                    last.announce(now)
                return []
            if update.is_state and last.ended is not None and last.shots:
                return []  # further reports of that one may follow; the next one's progress begins it
            if last.ended is not None and last.reported == 0 and not last.taken:
                last.is_open, last.ended, last.since = True, None, now
                return []
        last.end(now)
        lost = self._before.report_all(is_saved=False)
        self._before, self._now = self._now, _Capture(self._now.number + 1, now, update.camera, is_open=True)
        self._now.is_announced = update.progress is not CaptureProgress.TAKEN or update.count is not None
        return lost

    def _is_next(self, update: CaptureUpdate) -> bool:
        """Return True for the begin of another capture than the open one, which is stored.

        The state reports the end of that one, and that may arrive after the progress of the next.
        """
        is_begin = update.progress is CaptureProgress.STARTED and not update.is_state
        return is_begin and self._now.media != "" and not self._now.shots

    def _open_unreported(self, update: CaptureUpdate, now: float) -> list[CapturedShot]:
        """Begin the capture of a media whose other reports were lost, but for those of its pictures.

        Return the lost pictures of the capture before the last.
        """
        last = self._now
        was_open, shots = last.is_open, last.shots
        last.is_open, last.shots = False, []
        lost = self._open(update, now)
        self._now.shots = shots or ([now] if was_open else [])
        self._now.taken = len(self._now.shots)
        if was_open and update.count is not None:
            self._now.taken = update.count  # it may continue the count of the media before
        return lost

    def _is_of_capture_before(self, update: CaptureUpdate) -> bool:
        """Return True for a report that the capture before is stored, if its pictures wait for it.

        The next one is not stored before it has pictures, nor as two media, nor with the other's count.
        """
        before, last, known = self._before, self._now, self.capture_of(update.media)
        if not before.shots or before.media not in ("", update.media):
            return False
        if known:
            return known == before.number
        return not last.taken or last.media != "" or (before.counts(update) and not last.counts(update))

    def _save(self, update: CaptureUpdate, now: float) -> list[CapturedShot]:
        if self._is_of_capture_before(update):
            before, last = self._before, self._now
            is_last = before.taken == last.taken or (last.counts(update) and not before.counts(update))
            rest: list[CapturedShot] = []
            if not before.media and last.media and is_last:
                self._exchange(update.media)
                last.ended = None
                rest = last.report_all(is_saved=True)
            else:
                self._name(before, update.media)
            before.ended = None
            return rest + before.report_all(is_saved=True)
        if self.capture_of(update.media) not in (0, self.capture):
            return self._save_before(update, now)
        last, lost = self._now, list[CapturedShot]()
        is_known = last.is_open or bool(last.shots) or last.ended is not None
        if update.media and last.media not in ("", update.media):
            lost = self._open_unreported(update, now)
        elif not is_known:
            if last.taken and (not update.media or update.media == last.media):
                return []  # the same report again
            lost = self._open(update, now)
        capture = self._now
        self._name(capture, update.media)
        if update.count is not None:
            capture.take(capture.more(update.count), now)
        elif not capture.taken:
            capture.take(1, now)
        capture.ended = None
        capture.is_open = capture.is_open and not update.is_last
        return lost + capture.report_all(is_saved=True)

    def _save_before(self, update: CaptureUpdate, now: float) -> list[CapturedShot]:
        """Return pictures of the capture before that are reported after its end.

        None of those that have been reported.

        The report of their shutter has begun another capture then, with a count that belongs to the one before.
        """
        before, late = self._before, self._now
        if update.count is None or self.capture_of(update.media) != before.number or before.reported is None:
            return []
        more = before.more(update.count)
        if not more:
            return []  # the same report again
        if late.taken == update.count and not late.reported and not late.media:
            before.shots, before.taken = late.shots[-more:], update.count
            self._now, self._before = before, _Capture(before.number)
        else:
            before.take(more, now)
        return before.report_all(is_saved=True)

    def _name(self, capture: _Capture, media: str) -> None:
        """Note the media id of a capture."""
        if not media:
            return
        capture.media = media
        self._captures[media] = capture.number
        if len(self._captures) > REPEATED:
            del self._captures[next(iter(self._captures))]

    def _exchange(self, media: str) -> None:
        """Note this media as the last capture's, and the media of that as the one before's.

        The first was taken for the last one's, because that had pictures already. A drone stores them in sequence.
        """
        first = self._now.media
        self._name(self._now, media)
        self._name(self._before, first)

    def _fail(self, now: float) -> list[CapturedShot]:
        capture = self._before if self.awaits_capture_before else self._now
        if not capture.is_open and not capture.shots:
            return []  # a photo that never began
        if not capture.taken:
            capture.take(1, now)
        capture.is_open, capture.ended = False, None
        return capture.report_all(is_saved=False)


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

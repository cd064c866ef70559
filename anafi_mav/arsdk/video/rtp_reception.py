"""Reception statistics of one RTP sender, as its receiver reports them. No I/O.

RFC 3550 sections 6.4.1, A.3 and A.8.
"""

from __future__ import annotations

from anafi_mav.arsdk.video.rtcp import ReportBlock, SenderReport, middle_of
from anafi_mav.arsdk.video.rtp import HEADER, sequence_distance


class Reception:
    """Counts the packets of one sender."""

    def __init__(self, ssrc: int, clock_rate: int) -> None:
        self.ssrc = ssrc
        self._clock_rate = clock_rate
        self._base: int | None = None
        self._highest = 0
        """Extended: the sequence number plus 65536 for each time it wrapped."""
        self._received = 0
        self._reported = (0, 0)
        """(expected, received) at the last report."""
        self._jitter = 0.0
        self._transit: float | None = None
        self._report: tuple[int, float] | None = None
        """The name of the last sender report, and when it came."""

    def receive(self, datagram: bytes, now: float) -> None:
        """A packet of this sender, at `now` in s."""
        if len(datagram) < HEADER.size:
            return
        _, _, sequence, timestamp, ssrc = HEADER.unpack_from(datagram)
        if ssrc != self.ssrc:
            return
        if self._base is None:
            self._base = self._highest = sequence
        ahead = sequence_distance(self._highest & 0xFFFF, sequence)
        if ahead > 0:
            self._highest += ahead
        self._received += 1
        transit = now * self._clock_rate - timestamp
        if self._transit is not None:
            # Timestamps wrap, and so does the difference.
            step = (transit - self._transit + (1 << 31)) % (1 << 32) - (1 << 31)
            self._jitter += (abs(step) - self._jitter) / 16.0
        self._transit = transit

    def hear(self, report: SenderReport, now: float) -> None:
        """A report of this sender."""
        if report.ssrc == self.ssrc:
            self._report = middle_of(report.time), now

    def block(self, now: float) -> ReportBlock | None:
        """Return the report block that is due, or None before the first packet."""
        if self._base is None:
            return None
        expected = self._highest - self._base + 1
        new, came = expected - self._reported[0], self._received - self._reported[1]
        self._reported = expected, self._received
        name, delay = 0, 0
        if self._report is not None:
            name, delay = self._report[0], int((now - self._report[1]) * 65536)
        return ReportBlock(
            ssrc=self.ssrc,
            fraction_lost=max(0, min(255, (new - came) * 256 // new)) if new > 0 else 0,
            lost=expected - self._received,
            highest_sequence=self._highest & 0xFFFFFFFF,
            jitter=int(self._jitter) & 0xFFFFFFFF,
            last_report=name,
            delay=delay & 0xFFFFFFFF,
        )

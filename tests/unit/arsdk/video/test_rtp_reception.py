"""Receiver reports, worked out by hand."""

from __future__ import annotations

import pytest

from anafi_mav.arsdk.video.rtcp import ReportBlock, SenderReport
from anafi_mav.arsdk.video.rtp import Packet, encode_packet
from anafi_mav.arsdk.video.rtp_reception import Reception


def packet(sequence: int, timestamp: int = 0, ssrc: int = 7) -> bytes:
    return encode_packet(Packet(96, sequence & 0xFFFF, timestamp & 0xFFFFFFFF, ssrc, b"x"))


def test_losses_are_counted_over_the_wrap() -> None:
    reception = Reception(7, 90_000)
    assert reception.block(0.0) is None
    for sequence in (65534, 65535, 0, 1):
        reception.receive(packet(sequence), 0.0)
    assert reception.block(0.0) == ReportBlock(7, 0, 0, 65537, 0)
    # 2 and 4 never come, 5 comes before 3: of four expected, two.
    for sequence in (5, 3):
        reception.receive(packet(sequence), 0.0)
    reception.receive(packet(9, ssrc=8), 0.0)
    reception.receive(b"\x80", 0.0)
    assert reception.block(0.0) == ReportBlock(7, 128, 2, 65541, 0)
    # A double makes up for one of them, and the share since the last report is none.
    reception.receive(packet(5), 0.0)
    assert reception.block(0.0) == ReportBlock(7, 0, 1, 65541, 0)


def test_jitter_of_one_that_was_late() -> None:
    # 3000 units between two at 30 Hz. The third is 10 ms late, which is 900 units, the fourth 10 ms early after it:
    # 900/16, then (900 - 56.25)/16 more.
    reception = Reception(7, 90_000)
    first = (1 << 32) - 3000
    for number, late in enumerate((0.0, 0.0, 0.01, 0.0)):
        reception.receive(packet(number, first + 3000 * number), number / 30 + late)
    block = reception.block(1.0)
    assert block is not None
    assert block.jitter == int(56.25 + (900 - 56.25) / 16)


def test_the_last_sender_report_is_named() -> None:
    reception = Reception(7, 90_000)
    reception.receive(packet(1), 0.0)
    reception.hear(SenderReport(7, 3_500_000, 0, 1, 1), 10.0)
    reception.hear(SenderReport(8, 9_000_000, 0, 1, 1), 11.0)
    block = reception.block(12.5)
    assert block is not None
    # 3.5 s: the middle 32 bits of 32.32 are 16.16. And 2.5 s have passed since.
    assert block.last_report == 0x00038000
    assert block.delay == pytest.approx(2.5 * 65536)

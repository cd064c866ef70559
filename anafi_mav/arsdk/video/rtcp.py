"""Reports between the two ends of an RTP stream (RTCP, RFC 3550 section 6).

The sender reports which of its timestamps is what time, which Olympe needs to place pictures in time; the receiver
reports what arrived. Parrot's own statistics and clock exchange (APP packets) are not read and not sent.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from anafi_mav.errors import LocalProtocolError

SENDER_REPORT, RECEIVER_REPORT, SDES, BYE, APP = 200, 201, 202, 203, 204
MAX_REPORTS = 31
"""Blocks of one report: the field has 5 bits."""

_HEADER = struct.Struct(">BBH")
"""version, padding and count; type; words that follow."""
_SENDER = struct.Struct(">IQIII")
_BLOCK = struct.Struct(">IB3sIIII")
_CNAME = 1
_MICROSECONDS = 1_000_000


@dataclass(frozen=True)
class ReportBlock:
    """Reception report about one sender."""

    ssrc: int
    fraction_lost: int
    """Of 256, since the last report."""
    lost: int
    """Packets since the beginning; negative if there were doubles."""
    highest_sequence: int
    """Extended to 32 bits."""
    jitter: int
    """In units of the timestamps."""
    last_report: int = 0
    """The middle 32 bits of the time in the last sender report; 0: none came."""
    delay: int = 0
    """Since that one, in 1/65536 s."""


@dataclass(frozen=True)
class SenderReport:
    """Which moment a timestamp is, and what was sent by then."""

    ssrc: int
    time: int
    """µs of the sender's clock, whose zero is anything."""
    timestamp: int
    packets: int
    octets: int


@dataclass(frozen=True)
class ReceiverReport:
    ssrc: int
    blocks: tuple[ReportBlock, ...] = ()


@dataclass(frozen=True)
class Goodbye:
    ssrc: int


Report = SenderReport | ReceiverReport | Goodbye


def encode_sender_report(report: SenderReport, cname: str, *, goodbye: bool = False) -> bytes:
    """A datagram with the report, the sender's name and, if it ends, its goodbye."""
    ntp = _ntp(report.time)
    try:
        body = _SENDER.pack(report.ssrc, ntp, report.timestamp, report.packets & 0xFFFFFFFF, report.octets & 0xFFFFFFFF)
    except struct.error as error:
        raise LocalProtocolError(f"cannot encode {report!r}: {error}") from error
    return _whole(SENDER_REPORT, 0, body, report.ssrc, cname, goodbye)


def encode_receiver_report(report: ReceiverReport, cname: str, *, goodbye: bool = False) -> bytes:
    """A datagram with the report, the receiver's name and, if it leaves, its goodbye."""
    if len(report.blocks) > MAX_REPORTS:
        raise LocalProtocolError(f"{len(report.blocks)} reports in one")
    try:
        body = report.ssrc.to_bytes(4, "big")
        for block in report.blocks:
            lost = max(-(1 << 23), min(block.lost, (1 << 23) - 1)).to_bytes(3, "big", signed=True)
            body += _BLOCK.pack(
                block.ssrc,
                block.fraction_lost,
                lost,
                block.highest_sequence,
                block.jitter,
                block.last_report,
                block.delay,
            )
    except (struct.error, OverflowError) as error:
        raise LocalProtocolError(f"cannot encode {report!r}: {error}") from error
    return _whole(RECEIVER_REPORT, len(report.blocks), body, report.ssrc, cname, goodbye)


def middle_of(time: int) -> int:
    """Return the name by which a receiver refers to a sender report of this time (µs).

    It is the middle 32 bits of the report's NTP time.
    """
    return _ntp(time) >> 16 & 0xFFFFFFFF


def _ntp(microseconds: int) -> int:
    """Return µs as 32.32 bits, rounded up.

    So Parrot's integers, which truncate, read the same number back.
    """
    seconds, rest = divmod(microseconds, _MICROSECONDS)
    return (seconds & 0xFFFFFFFF) << 32 | -(-(rest << 32) // _MICROSECONDS)


def _whole(kind: int, count: int, body: bytes, ssrc: int, cname: str, goodbye: bool) -> bytes:
    name = cname.encode()
    if not 0 < len(name) < 256:
        raise LocalProtocolError(f"{cname!r} is no name for a source of RTP")
    item = bytes((_CNAME, len(name))) + name + b"\0"
    chunk = ssrc.to_bytes(4, "big") + item + bytes(-len(item) % 4)
    whole = _packet(kind, count, body) + _packet(SDES, 1, chunk)
    return whole + _packet(BYE, 1, ssrc.to_bytes(4, "big")) if goodbye else whole


def _packet(kind: int, count: int, body: bytes) -> bytes:
    return _HEADER.pack(2 << 6 | count, kind, len(body) // 4) + body


def decode_reports(data: bytes) -> list[Report]:
    """Return the reports and goodbyes in a datagram, up to the first unreadable packet.

    Packets of other types are skipped.
    """
    reports: list[Report] = []
    position = 0
    while position + _HEADER.size <= len(data):
        first, kind, words = _HEADER.unpack_from(data, position)
        body = bytes(data[position + _HEADER.size : position + _HEADER.size + 4 * words])
        if first >> 6 != 2 or len(body) != 4 * words:
            break
        report = _report(kind, first & 0x1F, body)
        if report is not None:
            reports.append(report)
        position += _HEADER.size + len(body)
    return reports


def _report(kind: int, count: int, body: bytes) -> Report | None:
    if kind == SENDER_REPORT and len(body) >= _SENDER.size:
        ssrc, ntp, timestamp, packets, octets = _SENDER.unpack_from(body)
        time = (ntp >> 32) * _MICROSECONDS + ((ntp & 0xFFFFFFFF) * _MICROSECONDS >> 32)
        return SenderReport(ssrc, time, timestamp, packets, octets)
    if kind == RECEIVER_REPORT and len(body) >= 4 + count * _BLOCK.size:
        blocks = []
        for number in range(count):
            ssrc, fraction, lost, highest, jitter, last, delay = _BLOCK.unpack_from(body, 4 + number * _BLOCK.size)
            amount = int.from_bytes(lost, "big", signed=True)
            blocks.append(ReportBlock(ssrc, fraction, amount, highest, jitter, last, delay))
        return ReceiverReport(int.from_bytes(body[:4], "big"), tuple(blocks))
    if kind == BYE and count and len(body) >= 4:
        return Goodbye(int.from_bytes(body[:4], "big"))
    return None

"""The tlog format against pymavlink's reader, and any bytes against ours."""

from __future__ import annotations

import random
from pathlib import Path

from pymavlink import mavutil

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import frame, pack
from anafi_mav.recording.tlog import TlogEntry, TlogReader, encode

BEAT = frame(pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), 7, 1, 1)
ENTRIES = [TlogEntry(1.7e9 + number * 0.25, BEAT) for number in range(4)]
DATA = b"".join(map(encode, ENTRIES))


def test_tlog_is_read_by_pymavlink(tmp_path: Path) -> None:
    path = tmp_path / "gateway.0001.tlog"
    path.write_bytes(DATA)
    log = mavutil.mavlink_connection(str(path))
    for entry in ENTRIES:
        assert log.recv_match(type="HEARTBEAT").get_srcSystem() == 1
        assert log.timestamp == entry.time


def test_tlog_in_any_pieces_gives_the_same_entries() -> None:
    for size in (1, 2, 7, 30, len(DATA)):
        reader = TlogReader()
        pieces = [DATA[start : start + size] for start in range(0, len(DATA), size)]
        assert [entry for piece in pieces for entry in reader.receive(piece)] == ENTRIES
        assert reader.skipped == 0


def test_tlog_with_a_damaged_beginning_is_read_from_the_next_entry() -> None:
    reader = TlogReader()
    assert list(reader.receive(DATA[5:])) == ENTRIES[1:]
    assert reader.skipped > 0


def test_random_bytes_are_no_error() -> None:
    reader = TlogReader()
    for entry in reader.receive(random.Random(1).randbytes(100_000)):
        assert len(entry.frame) >= 8

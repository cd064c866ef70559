"""The files of recorded sessions: parts, the bound of them all, and a disk that is full."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from support.hanging_disk import hanging

from anafi_mav.disk_writer import HANGS
from anafi_mav.recording import session_folder
from anafi_mav.recording.session_folder import ARSDK, MAVLINK, SessionFolder, parts_of


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_folder, "PART_BYTES", 1000)


async def written(folder: Path, *pieces: int, max_bytes: int = 1_000_000) -> SessionFolder:
    """A closed session to which so many bytes were written, one after another."""
    session = SessionFolder(folder, max_bytes)
    session.start()
    for size in pieces:
        session.append(MAVLINK, b"x" * size)
        await session.flush()
    await session.close()
    return session


async def test_session_is_written_in_parts_of_bounded_size(tmp_path: Path) -> None:
    session = await written(tmp_path, 600, 300, 600, 2000, 10)
    sizes = {part.name: part.stat().st_size for part in session.path.iterdir()}
    assert sizes == {
        "gateway.0001.tlog": 900,
        "gateway.0002.tlog": 600,
        "gateway.0003.tlog": 2000,
        "gateway.0004.tlog": 10,
    }
    assert session.counters["written_bytes"] == 3510


async def test_oldest_parts_of_all_sessions_are_deleted(tmp_path: Path) -> None:
    first = await written(tmp_path, 900, 900)
    for age, part in enumerate(parts_of(tmp_path)):
        os.utime(part, (1000 + age, 1000 + age))
    strange = tmp_path / "holiday.tlog"
    strange.write_bytes(b"x" * 5000)
    second = await written(tmp_path, 900, 900, 900, max_bytes=3000)
    assert not first.path.exists()
    assert sum(part.stat().st_size for part in parts_of(tmp_path)) <= 3000
    assert strange.exists()
    assert {part.name for part in second.path.iterdir()} >= {"gateway.0003.tlog"}


async def test_full_disk_is_a_problem_and_no_error(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path, 1_000_000)
    session.start()
    (session.path / "gateway.0001.tlog").symlink_to("/dev/full")  # an exclusive open fails on it
    session.append(MAVLINK, b"x" * 100)
    session.append(ARSDK, b"y" * 10)
    await session.close()
    assert session.problem == "File exists"
    assert session.counters["dropped_bytes"] == 110


async def test_bytes_beyond_what_may_wait_are_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_folder, "MAX_WAITING", 150)
    session = SessionFolder(tmp_path, 1_000_000)
    session.start()
    session.append(MAVLINK, b"x" * 100)
    session.append(MAVLINK, b"x" * 100)
    await session.close()
    assert session.counters == {"written_bytes": 100, "dropped_bytes": 100}
    assert session.problem == "the disk is too slow"


async def test_hanging_disk_does_not_hold_up_the_end(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path, 1_000_000)
    session.start()
    with hanging(session.writer):
        session.append(MAVLINK, b"x" * 100)
        await session.close()
        assert session.problem == HANGS

"""The files of recorded sessions: parts, the bound of them all, and a disk that is full."""

from __future__ import annotations

import errno
import resource
from collections.abc import Iterator
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


async def test_session_without_a_byte_leaves_no_folder(tmp_path: Path) -> None:
    session = await written(tmp_path)
    assert session.path.parent == tmp_path
    assert [*parts_of(tmp_path)] == []
    assert not session.path.exists()


def sizes(session: SessionFolder) -> dict[str, int]:
    """Bytes of each part of a session."""
    return {part.name: part.stat().st_size for part in parts_of(session.path.parent) if part.parent == session.path}


async def test_flood_in_one_session_deletes_its_own_oldest_parts_only(tmp_path: Path) -> None:
    flight = await written(tmp_path, 900, 900, 900, max_bytes=16_000)
    before = sizes(flight)
    flood = await written(tmp_path, *[900] * 40, max_bytes=16_000)
    assert sizes(flight) == before == {f"gateway.{number:04}.tlog": 900 for number in (1, 2, 3)}
    assert sizes(flood) == {f"gateway.{number:04}.tlog": 900 for number in (37, 38, 39, 40)}
    assert flood.counters["deleted_files"] == 36


async def test_flood_in_every_session_leaves_the_four_newest(tmp_path: Path) -> None:
    strange = tmp_path / "holiday.tlog"
    strange.write_bytes(b"x" * 50_000)
    floods = []
    for day in range(7):
        flood = await written(tmp_path, *[900] * 8, max_bytes=16_000)
        flood.path = flood.path.rename(tmp_path / f"2026010{day}T120000Z")
        floods.append(flood)
    newest = await written(tmp_path, 900, max_bytes=16_000)
    assert [sum(sizes(flood).values()) for flood in floods[-3:]] == [3600, 3600, 3600]
    assert sizes(newest) == {"gateway.0001.tlog": 900}
    assert not floods[0].path.exists()
    assert sum(part.stat().st_size for part in parts_of(tmp_path)) <= 16_000
    assert strange.exists()


async def test_restarts_delete_nothing_while_there_is_room(tmp_path: Path) -> None:
    flight = await written(tmp_path, 900, 900, 900, max_bytes=16_000)
    for _ in range(20):
        await written(tmp_path, 50, max_bytes=16_000)
    assert len(sizes(flight)) == 3


async def test_session_of_a_computer_with_a_late_clock_stays(tmp_path: Path) -> None:
    """Without a clock of its own a computer starts in the past: the running session then looks like the oldest one."""
    future = tmp_path / "20991231T235959Z"
    future.mkdir()
    for number in range(1, 19):
        (future / f"gateway.{number:04}.tlog").write_bytes(b"x" * 900)
    session = await written(tmp_path, 900, 900, 900, max_bytes=16_000)
    assert len(sizes(session)) == 3
    assert sum(part.stat().st_size for part in parts_of(tmp_path)) <= 16_000


async def test_session_of_another_user_is_no_reason_to_record_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a gateway that root has started once: its folder is root's."""
    foreign, listing = tmp_path / "20260101T120000Z", Path.iterdir
    foreign.mkdir()

    def listed(path: Path) -> Iterator[Path]:
        if path == foreign:
            raise PermissionError(errno.EACCES, "Permission denied")
        return listing(path)

    monkeypatch.setattr(Path, "iterdir", listed)
    session = await written(tmp_path, 600)
    assert session.problem == ""
    assert sizes(session) == {"gateway.0001.tlog": 600}


async def test_full_disk_is_a_problem_and_no_error(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path, 1_000_000)
    session.start()
    (session.path / "gateway.0001.tlog").symlink_to("/dev/full")  # an exclusive open fails on it
    session.append(MAVLINK, b"x" * 100)
    session.append(ARSDK, b"y" * 10)
    await session.close()
    assert session.problem == "File exists"
    assert session.counters["dropped_bytes"] == 110


async def test_full_disk_leaves_no_empty_parts_and_recording_goes_on(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path, 1_000_000)
    session.start()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, limits[1]))  # as a full disk: files can be made and take no more
    try:
        for _ in range(5):
            session.append(MAVLINK, b"x" * 600)
            await session.flush()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert sizes(session) == {"gateway.0001.tlog": 200}
    assert session.counters == {"written_bytes": 200, "dropped_bytes": 2800}
    assert session.problem == "File too large"
    session.append(MAVLINK, b"y" * 600)
    await session.close()
    assert sizes(session) == {"gateway.0001.tlog": 800}


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

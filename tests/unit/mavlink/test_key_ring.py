"""Key files and their ring: permissions, timestamps saved ahead, and what a failed write means."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from support.hanging_disk import hanging

from anafi_mav.clock import SystemClock
from anafi_mav.disk_writer import HANGS
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import SIGNED, Verdict, frame, pack
from anafi_mav.mavlink.key_ring import OLD_SUFFIX, KeyRing, path_of, read_key, write_key
from anafi_mav.mavlink.signing import SAVED_AHEAD, TICKS, Signing, ticks
from anafi_mav.state_lock import STATE_WRITER

SECRET = bytes(range(32))
CONTENT = SECRET + bytes(8)

posix = pytest.mark.skipif(os.name != "posix", reason="permission bits are those of POSIX")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_key(tmp_path / "keys", "field", CONTENT)
    return tmp_path / "keys"


def ring(folder: Path | None) -> KeyRing:
    return KeyRing(folder, SystemClock())


def opened(one: KeyRing, name: str = "field") -> Signing:
    signing = one.open(name, is_required=True)
    assert signing is not None
    return signing


def saved(folder: Path) -> int:
    return saved_of(folder, "field")


def saved_of(folder: Path, name: str) -> int:
    return int.from_bytes((read_key(folder, name) or b"")[32:], "little")


async def until(ready: Callable[[], bool]) -> None:
    for _ in range(2000):
        if ready():
            return
        await asyncio.sleep(0.01)  # the disk has no event of its own
    raise AssertionError


@posix
def test_key_file_and_folder_are_for_their_owner_only(folder: Path) -> None:
    assert folder.stat().st_mode & 0o777 == 0o700
    assert path_of(folder, "field").stat().st_mode & 0o777 == 0o600


@posix
@pytest.mark.parametrize(("what", "mode", "expected"), [("field.key", 0o640, "600"), (".", 0o750, "700")])
def test_key_that_others_can_read_is_refused(folder: Path, what: str, mode: int, expected: str) -> None:
    (folder / what).chmod(mode)
    for is_required in (True, False):
        with pytest.raises(ConfigError, match=f"expected mode {expected}, got {mode:o}"):
            ring(folder).open("field", is_required=is_required)


@posix
def test_pipe_in_place_of_a_key_is_refused(folder: Path) -> None:
    write_key(folder, "field", CONTENT)
    path_of(folder, "field").unlink()
    os.mkfifo(path_of(folder, "field"), 0o600)
    with pytest.raises(OSError, match="expected a file, got a pipe"):
        read_key(folder, "field")


@pytest.mark.parametrize("content", [b"", CONTENT[:39], CONTENT + b"\n"])
def test_key_file_of_another_length_is_refused(folder: Path, content: bytes) -> None:
    write_key(folder, "field", content)
    with pytest.raises(ConfigError, match="expected a key file of 40 bytes"):
        ring(folder).open("field", is_required=True)


@pytest.mark.parametrize("name", ["", "../field", "a b", ".field", "x" * 65])
def test_key_name_that_is_no_file_name_is_refused(folder: Path, name: str) -> None:
    with pytest.raises(ConfigError, match="expected the name of a key"):
        ring(folder).open(name, is_required=False)


def test_absent_key_is_off_or_an_error(folder: Path) -> None:
    found = ring(folder).open("other", is_required=False)
    assert found is not None
    assert not found.is_on
    with pytest.raises(ConfigError, match="anafi-mav keygen other"):
        ring(folder).open("other", is_required=True)
    assert ring(None).open("other", is_required=False) is None
    with pytest.raises(ConfigError, match="no state folder"):
        ring(None).open("other", is_required=True)


def test_endpoints_with_one_name_share_the_key(folder: Path) -> None:
    one = ring(folder)
    assert opened(one) is opened(one)


async def test_timestamp_in_the_file_is_ahead_until_the_end(folder: Path) -> None:
    one = ring(folder)
    signing = opened(one)
    before = ticks(time.time())
    await one.start()
    assert before + SAVED_AHEAD <= saved(folder) <= ticks(time.time()) + SAVED_AHEAD
    assert signing.timestamp >= before
    # A crash here: what was used and received until now is below the timestamp that the next start reads.
    assert opened(ring(folder)).timestamp == saved(folder) > signing.timestamp
    await one.close()
    assert saved(folder) == signing.timestamp


async def test_replaced_key_is_stored_and_the_old_one_kept(folder: Path) -> None:
    one = ring(folder)
    signing = opened(one)
    await one.start()
    seen: list[bool] = []

    def before_use() -> bool:
        seen.append(signing.is_key(SECRET))
        return True

    assert await one.replace(signing, bytes(reversed(SECRET)), 0, before_use=before_use)
    assert seen == [True]
    assert signing.is_key(bytes(reversed(SECRET)))
    assert (read_key(folder, "field") or b"")[:32] == bytes(reversed(SECRET))
    assert (read_key(folder, "field", OLD_SUFFIX) or b"")[:32] == SECRET
    assert saved(folder) > signing.timestamp
    await one.close()
    assert (read_key(folder, "field") or b"")[:32] == bytes(reversed(SECRET))


async def test_key_that_cannot_be_written_stays_in_use(folder: Path) -> None:
    one = ring(folder)
    signing = opened(one)
    await one.start()
    path_of(folder, "field", OLD_SUFFIX).mkdir()
    with pytest.raises(OSError):  # noqa: PT011  # which one is the system's matter
        await one.replace(
            signing, bytes(reversed(SECRET)), 0, before_use=lambda: pytest.fail("the new key is announced")
        )
    assert signing.is_key(SECRET)
    await one.close()


async def test_problem_of_one_key_stays_while_another_key_is_saved(folder: Path) -> None:
    """A folder in the place of its file stands for one that this user may not write."""
    write_key(folder, "other", CONTENT)
    one = ring(folder)
    for name in ("field", "other"):
        opened(one, name)
    path_of(folder, "field").unlink()
    path_of(folder, "field").mkdir()
    await one.start()
    assert saved_of(folder, "other") > 0
    assert one.problem.startswith("key field: ")
    await one.close()
    assert one.problem.startswith("key field: ")


async def test_timestamp_that_cannot_be_saved_is_a_problem(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    one = ring(folder)
    opened(one)
    path_of(folder, "field").unlink()
    path_of(folder, "field").mkdir()
    await one.start()
    assert "old frames may be accepted after a restart" in one.problem
    assert one.problem in caplog.text
    await one.close()


async def test_refused_frames_are_one_line_in_the_log(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    one = ring(folder)
    signing = opened(one)
    await one.start()
    for _ in range(1000):
        signing.refused["refused_unsigned"] += 1
    signing.refused["refused_replay"] += 1
    signing.last_refused = "udpin://0.0.0.0:14550 from 10.0.0.9:5"
    await asyncio.sleep(2.5)
    assert [record.getMessage() for record in caplog.records] == [
        "key field: frames refused: 1 replay, 1000 unsigned; newest on udpin://0.0.0.0:14550 from 10.0.0.9:5"
    ]
    await one.close()


async def test_hanging_disk_at_the_end_leaves_the_timestamp_ahead(folder: Path) -> None:
    one = ring(folder)
    signing = opened(one)
    await one.start()
    ahead = saved(folder)
    with hanging(STATE_WRITER):
        await one.close()
        assert one.problem.startswith("key field: the disk does not answer")
    assert await STATE_WRITER.drain(30.0)
    assert saved(folder) == ahead > signing.timestamp  # what was not begun in time is not written later


async def test_hanging_disk_refuses_frames_ahead_of_it_for_a_second_only(folder: Path) -> None:
    one = ring(folder)
    signing = opened(one)
    await one.start()
    station = Signing("station", SECRET + (ticks(time.time()) + 3600 * TICKS).to_bytes(8, "little"))
    beat = pack(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def verdict() -> Verdict:
        return signing.judge(station.sign(frame(beat, 0, 255, 190, SIGNED), 1), 0, {})

    with hanging(STATE_WRITER):
        assert verdict() is Verdict.UNSAVED
        await until(lambda: not signing.is_kept)
        assert HANGS in one.problem
        assert verdict() is Verdict.VERIFIED
    await until(lambda: signing.is_kept)
    assert one.problem == ""
    assert verdict() is Verdict.VERIFIED
    await one.close()


async def test_hanging_disk_locks_out_stations_of_no_key(folder: Path) -> None:
    """The timestamp of one key is late: that of the other must not wait for its turn meanwhile."""
    write_key(folder, "office", CONTENT)
    one = ring(folder)
    keys = [opened(one), opened(one, "office")]
    await one.start()
    stations = [Signing("station", SECRET + (ticks(time.time()) + 3600 * TICKS).to_bytes(8, "little")) for _ in keys]
    beat = pack(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def verdicts() -> list[Verdict]:
        return [
            signing.judge(station.sign(frame(beat, 0, 255, 190, SIGNED), 1), 0, {})
            for signing, station in zip(keys, stations, strict=True)
        ]

    with hanging(STATE_WRITER):
        assert verdicts() == 2 * [Verdict.UNSAVED]
        await until(lambda: not any(signing.is_kept for signing in keys))
        assert verdicts() == 2 * [Verdict.VERIFIED]
    await until(lambda: all(signing.is_kept for signing in keys))
    assert one.problem == ""
    assert verdicts() == 2 * [Verdict.VERIFIED]
    await one.close()

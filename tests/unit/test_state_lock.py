"""The lock file of a state folder: one gateway at a time, and what other programs read there."""

from __future__ import annotations

import errno
import importlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from support.hanging_disk import PATIENCE, hanging

from anafi_mav.cli import main
from anafi_mav.errors import ConfigError
from anafi_mav.gateway import state_in_use
from anafi_mav.mavlink.key_ring import folder_of, write_key
from anafi_mav.mavlink.signing import CONTENT_BYTES
from anafi_mav.state_lock import (
    FILE,
    STATE_WRITER,
    HeldDrone,
    Holder,
    StateLock,
    read_holder,
    replace_file,
    state_folder,
)

ALPHA = HeldDrone("alpha", "192.168.42.1", "wlan1", "PI040416DA9H839157")


def held(folder: Path) -> Holder:
    holder = read_holder(folder)
    assert holder is not None
    return holder


def test_state_lock_while_held_names_process_and_drones(tmp_path: Path) -> None:
    folder = tmp_path / "state"
    lock = StateLock(folder)
    assert read_holder(folder) is None
    assert lock.acquire() is None
    assert held(folder) == Holder(1, os.getpid(), ())
    lock.write([ALPHA, HeldDrone("bravo", "192.168.42.1", "wlan2")])
    assert held(folder).drones[0] == ALPHA
    lock.write([ALPHA])  # shorter than before
    assert held(folder).drones == (ALPHA,)
    assert json.loads((folder / FILE).read_text()) == {
        "version": 1,
        "pid": os.getpid(),
        "drones": [{"name": "alpha", "address": "192.168.42.1", "interface": "wlan1", "serial": "PI040416DA9H839157"}],
        "web": "",
    }
    lock.release()
    lock.release()
    assert read_holder(folder) is None


def test_state_lock_of_a_second_gateway_is_refused(tmp_path: Path) -> None:
    first, second = StateLock(tmp_path), StateLock(tmp_path)
    assert first.acquire() is None
    first.write([ALPHA])
    assert second.acquire() == Holder(1, os.getpid(), (ALPHA,))
    assert held(tmp_path).drones == (ALPHA,)  # looking changed nothing
    first.release()
    assert second.acquire() is None
    second.release()


@contextmanager
def another_user() -> Iterator[None]:
    """Root is another user for the length of a block. The permissions in the test bind any other user anyway.

    What the commands import is imported before: another user may not be able to read it.
    """
    for name in ("encodings.idna", *(f"anafi_mav.cli.{command}" for command in ("doctor", "info", "status"))):
        importlib.import_module(name)
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_lock_that_root_makes_belongs_to_the_owner_of_its_folder(tmp_path: Path) -> None:
    """A gateway that root starts once must not keep that of a service from its folder ever after.

    Any other user has folders of its own only.
    """
    if os.name == "posix" and os.geteuid() == 0:
        os.chown(tmp_path, 65534, 65534)
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    lock.release()
    assert (tmp_path / FILE).stat().st_uid == tmp_path.stat().st_uid


@pytest.mark.skipif(os.name != "posix", reason="another user and permissions of a file exist on POSIX alone")
def test_holder_is_found_by_a_user_who_may_only_read() -> None:
    """A service's: `info` and `doctor` must not take its drones."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        lock = StateLock(folder)
        assert lock.acquire() is None
        lock.write([ALPHA])
        (folder / FILE).chmod(0o444)
        with another_user():
            assert read_holder(folder) == Holder(1, os.getpid(), (ALPHA,))
        lock.release()


@pytest.mark.skipif(os.name != "posix", reason="another user and permissions of a file exist on POSIX alone")
@pytest.mark.parametrize("words", [["info", "127.0.0.1", "--take"], ["doctor", "127.0.0.1", "--take"], ["status"]])
def test_state_folder_that_cannot_be_read_is_an_error_of_the_option(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        (folder / FILE).touch(0o000)
        with another_user():
            assert main([*words, "--state", name]) == 2
            assert read_holder(folder) is None
    expected = f"anafi-mav: --state: expected a folder that this user can read, got {folder}: Permission denied"
    assert capsys.readouterr().err.strip() == expected


@pytest.mark.skipif(os.name != "posix", reason="deletes a file that is open, which Windows refuses")
@pytest.mark.parametrize("words", [["info", "127.0.0.1", "--take"], ["doctor", "127.0.0.1", "--take"], ["keygen", "k"]])
def test_gateway_whose_lock_file_was_deleted_keeps_its_drones_and_keys(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A handshake would take a drone from it in the air."""
    write_key(folder_of(tmp_path), "k", bytes(range(CONTENT_BYTES)))
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    (tmp_path / FILE).unlink()
    assert main([*words, "--state", str(tmp_path)]) == 2
    assert "a gateway whose lock file was deleted or damaged " in capsys.readouterr().err
    lock.release()


@pytest.mark.skipif(os.name != "posix", reason="deletes a file that is open, which Windows refuses")
def test_state_lock_whose_file_was_deleted_is_still_held(tmp_path: Path) -> None:
    first, second = StateLock(tmp_path), StateLock(tmp_path)
    assert first.acquire() is None
    (tmp_path / FILE).unlink()  # by a person who takes it for a leftover
    holder = second.acquire()
    assert holder == Holder(1, 0)
    assert "a gateway whose lock file was deleted or damaged holds " in str(state_in_use(tmp_path, holder))
    assert read_holder(tmp_path) == Holder(1, 0)  # there is a file again, which nothing locks
    (tmp_path / FILE).unlink()
    assert read_holder(tmp_path) == Holder(1, 0)
    first.release()
    assert read_holder(tmp_path) is None
    assert second.acquire() is None
    second.release()


@pytest.mark.skipif(os.name != "posix", reason="shares a lock by fcntl.flock, which Windows does not have")
@pytest.mark.parametrize("is_deleted", [False, True])
def test_two_programs_that_look_at_the_same_moment_find_no_holder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_deleted: bool
) -> None:
    """The file says what a gateway wrote that was killed."""
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    lock.write((ALPHA,))
    content = (tmp_path / FILE).read_bytes()
    lock.release()
    (tmp_path / FILE).write_bytes(content)
    if is_deleted:
        (tmp_path / FILE).unlink()
    close = os.close

    def look_before(file: int) -> None:
        monkeypatch.setattr(os, "close", close)
        assert read_holder(tmp_path) is None
        close(file)

    monkeypatch.setattr(os, "close", look_before)
    assert read_holder(tmp_path) is None


def test_state_lock_that_is_released_while_it_is_written_closes_no_other_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thread writes the file, and the event loop releases it."""
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    releasing, lseek = threading.Thread(target=lock.release), os.lseek

    def release_meanwhile(file: int, *where: int) -> int:
        place = lseek(file, *where)
        releasing.start()
        releasing.join(0.1)  # it waits for the write
        return place

    monkeypatch.setattr(os, "lseek", release_meanwhile)
    lock.write((ALPHA,))
    releasing.join()
    assert (tmp_path / FILE).read_bytes() == b""


def test_state_lock_behind_a_hanging_disk_keeps_the_newest_content_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fleet whose links come and go must not fill the memory meanwhile."""
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    written, write = [], StateLock.write

    def note(self: StateLock, drones: Iterable[HeldDrone], web: str = "") -> None:
        written.append(web)
        write(self, drones, web)

    monkeypatch.setattr(StateLock, "write", note)
    with hanging(STATE_WRITER):
        for number in range(1000):
            lock.write_later([ALPHA], f"http://127.0.0.1:{number}/")
    assert STATE_WRITER.wait(PATIENCE)
    assert written == ["http://127.0.0.1:999/"]
    assert held(tmp_path).web == "http://127.0.0.1:999/"
    lock.release()


def test_state_lock_of_a_killed_process_is_free(tmp_path: Path) -> None:
    script = (
        "import sys, time; from pathlib import Path; from anafi_mav.state_lock import StateLock\n"
        "lock = StateLock(Path(sys.argv[1])); lock.acquire(); print('held', flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", script, str(tmp_path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        assert held(tmp_path).pid == process.pid
        process.kill()
    assert (tmp_path / FILE).read_text() != ""
    assert read_holder(tmp_path) is None  # what a process of the past wrote counts for nothing
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    lock.release()


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"version": 1, "pid": "x"}', b"\xff" * 100])
def test_state_lock_with_unreadable_content_is_still_held(tmp_path: Path, content: bytes) -> None:
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    (tmp_path / FILE).write_bytes(content)
    assert held(tmp_path) == Holder(1, 0, ())
    lock.release()


def test_state_lock_of_an_unusable_folder_raises(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file")
    with pytest.raises(OSError, match="File exists"):
        StateLock(tmp_path / "state").acquire()
    assert read_holder(tmp_path / "state") is None
    assert read_holder(None) is None


def test_holder_finds_a_drone_by_address_interface_or_serial() -> None:
    bravo = HeldDrone("bravo", "192.168.42.1", "wlan2")
    charlie = HeldDrone("charlie", "10.0.0.1")
    holder = Holder(1, 1, (ALPHA, bravo, charlie))
    assert holder.find("192.168.42.1", "wlan2") == bravo
    assert holder.find("192.168.42.1") == ALPHA
    assert holder.find("192.168.42.1", "wlan3") is None
    assert holder.find("10.0.0.1", "eth0") == charlie
    assert holder.find("192.168.53.1", serial=ALPHA.serial) == ALPHA
    assert holder.find("192.168.53.1", serial="") is None


@pytest.mark.parametrize("folder", ["~nobody-has-this-name/state", "state\0"])
def test_state_folder_that_is_none_is_named_with_its_key(folder: str) -> None:
    with pytest.raises(ConfigError, match=r"^state: expected the path of a folder, got "):
        state_folder(folder)


@pytest.mark.skipif(os.name != "posix", reason="Windows has no SIGKILL")
def test_file_that_a_killed_gateway_did_not_complete_is_deleted_by_the_next(tmp_path: Path) -> None:
    kept = [tmp_path / name for name in ("alpha.json", ".alpha.json", "alpha.json.unreadable", ".other.partfile")]
    for path in kept:
        path.write_bytes(b"{}")
    # Killed in the sync to the disk, which is between the making of the file and its renaming.
    code = (
        "import os, signal, sys; from pathlib import Path; from anafi_mav.state_lock import replace_file\n"
        "os.fsync = lambda file: os.kill(os.getpid(), signal.SIGKILL)\n"
        "replace_file(Path(sys.argv[1]), b'new')\n"
    )
    killed = subprocess.run([sys.executable, "-c", code, str(tmp_path / "alpha.json")], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == len(kept) + 1
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    assert STATE_WRITER.wait(PATIENCE)
    lock.release()
    assert sorted(tmp_path.iterdir()) == sorted([*kept, tmp_path / FILE])


def test_state_file_that_root_may_not_give_away_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A container without CAP_CHOWN; a network disk."""

    def refuse(file: int, user: int, group: int) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    if os.name == "posix" and os.geteuid() == 0:  # any other user has folders of its own only
        os.chown(tmp_path, 65534, 65534)
    monkeypatch.setattr(os, "geteuid", lambda: 0, raising=False)
    monkeypatch.setattr(os, "fchown", refuse, raising=False)
    replace_file(tmp_path / "alpha.json", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["alpha.json"]
    assert (tmp_path / "alpha.json").read_bytes() == b"content"
    write_key(folder_of(tmp_path), "k", b"content")
    assert [path.read_bytes() for path in folder_of(tmp_path).iterdir()] == [b"content"]

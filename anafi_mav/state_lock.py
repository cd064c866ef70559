"""The state folder of a gateway, and the lock file that keeps it to one gateway at a time.

The file `gateway.lock` says which process holds the folder and which drones it connects to: one line of JSON,

    {"version": 1, "pid": 4711, "drones": [{"name": "alpha", "address": "192.168.42.1", "interface": null,
     "serial": "PI040416DA9H839157"}], "web": "http://127.0.0.1:8088/"}

`web` is where `anafi-mav status` asks. `serial` is empty while that drone is not connected. What counts is the
operating system's lock on the file, which ends with its process however that ends; the content of a file that nothing
locks is of the past.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import re
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from anafi_mav.disk_writer import DiskWriter
from anafi_mav.errors import ConfigError

logger = logging.getLogger(__name__)

FILE = "gateway.lock"

VERSION = 1

MAX_BYTES = 256 * 1024
"""Of the file: 250 drones take a quarter of this."""

TRIES, TRY_EVERY = 5, 0.05
"""Attempts and s between them: a program that looks whether the folder is held locks it for an instant, and a file
that is being written may be read half."""

STATE_WRITER = DiskWriter("anafi-mav-state")
"""Writes the files of the state folder, in the order of their changes, and not in the event loop: a memory card may
take a second."""

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
"""Errors of locking on a file system without locks, like some network drives."""

_UNFINISHED = re.compile(r"\.[A-Za-z0-9_-]{1,64}\.json\.[a-z0-9_]{8}")
"""Name of a file of a drone before it is complete: see `replace_file`; `mkstemp` appends the last eight characters."""

_HELD = (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK)
"""Errors of locking when another process holds the lock: flock, fcntl on some systems, msvcrt."""


def state_folder(configured: str | None) -> Path | None:
    """Return the state folder, or None when the user has no home (XDG).

    Raises `ConfigError` for a configured one that cannot be a folder.
    """
    given = os.environ.get("XDG_STATE_HOME", "")
    if configured is not None:
        if "\0" in configured:
            raise ConfigError("state", f"expected the path of a folder, got {configured!r}")
        try:
            return Path(configured).expanduser()
        except RuntimeError as error:
            raise ConfigError("state", f"expected the path of a folder, got {configured!r}: {error}") from error
    try:
        return (Path(given) if Path(given).is_absolute() else Path.home() / ".local" / "state") / "anafi-mav"
    except RuntimeError as error:
        logger.warning("nothing will outlive the gateway: %s", error)
        return None


class HeldDrone(msgspec.Struct, frozen=True):
    """A drone of a running gateway."""

    name: str
    address: str
    interface: str | None = None
    serial: str = ""
    """Serial number while connected; of the drone, also behind a Skycontroller."""


class Holder(msgspec.Struct, frozen=True):
    """The gateway that holds a state folder."""

    version: int
    pid: Annotated[int, Meta(ge=0)]
    drones: tuple[HeldDrone, ...] = ()
    web: str = ""
    """URL of its web server on this computer; empty: none."""

    @property
    def title(self) -> str:
        """The gateway as a message names it."""
        if self.pid == 0:
            return "a gateway whose lock file was deleted or damaged"
        return f"the gateway with process id {self.pid}"

    def find(self, address: str, interface: str | None = None, serial: str = "") -> HeldDrone | None:
        """Return its drone at this address or with this serial number.

        Without an interface any one matches.
        """
        for drone in self.drones:
            if serial and drone.serial == serial:
                return drone
            if drone.address == address and (interface is None or drone.interface in (None, interface)):
                return drone
        return None


class StateLock:
    """The lock of one state folder.

    `acquire`, `write` whenever a drone connects or disconnects, `release`.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file: int | None = None
        self._own: int | None = None
        """The folder itself, where it can be locked: a person may delete a lock file that looks old."""
        self._newest: deque[tuple[tuple[HeldDrone, ...], str]] = deque(maxlen=1)
        """Content that is to be written: what follows replaces it while the disk is busy."""
        self._access = threading.Lock()
        """Held while the file is written, by a thread, or closed: its descriptor may be another file's later."""

    def acquire(self) -> Holder | None:
        """Lock the folder and return None, or return the gateway that holds it.

        Raises `OSError` for a folder that cannot be used.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        file = _make_lock(self._folder / FILE)
        try:
            for attempt in range(TRIES):
                if try_lock(file) and self._lock_folder():
                    self._file, file = file, -1
                    self.write(())
                    STATE_WRITER.post(partial(_delete_unfinished, self._folder))  # behind what is being written
                    return None
                if attempt + 1 < TRIES:
                    time.sleep(TRY_EVERY)
            return _read(file)
        finally:
            if file >= 0:
                os.close(file)

    def _lock_folder(self) -> bool:
        """Lock the folder itself; False when another gateway has it, whose lock file was deleted."""
        try:
            self._own = _try_lock_folder(self._folder)
        except OSError:
            return True
        return self._own is not None

    def write_later(self, drones: Iterable[HeldDrone], web: str = "") -> None:
        """Have the thread of files replace what the file says.

        Behind a slow disk the newest content counts.
        """
        self._newest.append((tuple(drones), web))
        STATE_WRITER.post(self._write_newest)

    def _write_newest(self) -> None:
        with contextlib.suppress(IndexError):  # it was written together with what followed it
            drones, web = self._newest.pop()
            self.write(drones, web)

    def write(self, drones: Iterable[HeldDrone], web: str = "") -> None:
        """Replace what the file says. A full disk is no reason to end a flight."""
        line = msgspec.json.encode(Holder(VERSION, os.getpid(), tuple(drones), web)) + b"\n"
        with self._access, contextlib.suppress(OSError):
            if self._file is None:
                return
            os.lseek(self._file, 0, os.SEEK_SET)
            os.write(self._file, line)  # readers take the first line: what follows it for an instant is old
            os.ftruncate(self._file, len(line))

    def release(self) -> None:
        """Unlock the folder. Safe to call twice."""
        with self._access:
            if self._file is not None:
                with contextlib.suppress(OSError):
                    os.ftruncate(self._file, 0)
                os.close(self._file)
                self._file = None
        if self._own is not None:
            os.close(self._own)
            self._own = None


def read_holder(folder: Path | None) -> Holder | None:
    """Return the gateway that holds a folder now; None where none does, or it cannot be known."""
    if folder is None:
        return None
    try:
        return find_holder(folder)
    except OSError:
        return None


def find_holder(folder: Path) -> Holder | None:
    """Return the gateway that holds a folder now; None where none does.

    None also where the file system has no locks. Raises `OSError` where it cannot be known, as `PermissionError` for a
    folder that this user may not read.
    """
    try:
        file = _open_lock(folder / FILE)
    except (FileNotFoundError, NotADirectoryError):
        return _holder_without_file(folder)
    try:
        return _holder_without_file(folder) if try_lock(file, is_shared=True) else _read(file)
    except OSError as error:
        if error.errno in NO_LOCKS:
            return None
        raise
    finally:
        os.close(file)  # which unlocks it


def _holder_without_file(folder: Path) -> Holder | None:
    """Return the gateway that holds the folder itself, whose lock file was deleted.

    None where none does.
    """
    try:
        own = _try_lock_folder(folder, is_shared=True)
    except OSError:
        return None
    if own is None:
        return Holder(VERSION, 0)
    os.close(own)
    return None


def _try_lock_folder(folder: Path, *, is_shared: bool = False) -> int | None:
    """Open and lock a folder itself; None when another holds it.

    Raises `OSError` for an absent one, and where folders cannot be locked.
    """
    if os.name != "posix":
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    own = os.open(folder, os.O_RDONLY)
    try:
        if not try_lock(own, is_shared=is_shared):
            os.close(own)
            return None
    except OSError:
        os.close(own)
        raise
    return own


def _make_lock(path: Path) -> int:
    """Open the lock file, and make it where it is absent.

    One that root makes belongs to the owner of its folder, whose gateway could not lock it otherwise.
    """
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError:
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    if os.name == "posix" and os.geteuid() == 0 and (owner := path.parent.stat()).st_uid != 0:
        with contextlib.suppress(OSError):  # a container or a network disk may forbid it: it stays root's
            os.fchown(file, owner.st_uid, owner.st_gid)
    return file


def _open_lock(path: Path) -> int:
    try:
        return os.open(path, os.O_RDWR)
    except PermissionError:  # another user's, as a service's: to look at it, reading is enough (flock(2))
        return os.open(path, os.O_RDONLY)


def _read(file: int) -> Holder:
    """Return what a locked file says; process id 0 where it says nothing."""
    for _ in range(TRIES):
        os.lseek(file, 0, os.SEEK_SET)
        line = os.read(file, MAX_BYTES).partition(b"\n")[0]
        with contextlib.suppress(ValueError, RecursionError):
            return msgspec.json.decode(line, type=Holder)
        time.sleep(TRY_EVERY)
    return Holder(VERSION, 0)


def check_folder(folder: Path, *names: str) -> None:
    """Raise `OSError` unless files can be made in a folder.

    Those with these `names` can then be replaced; the error names the one that cannot. The folder may be absent.
    Nothing is made.
    """
    present = folder
    while not _exists(present):
        present = present.parent
    if not present.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
    if not os.access(present, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    for file in (folder / name for name in names):
        if file.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(file))
        if file.exists() and not os.access(file, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(file))


def _exists(path: Path) -> bool:
    """Return True for what exists, also a link that leads nowhere.

    Raises `OSError` for a name that cannot exist, as one that is too long.
    """
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _delete_unfinished(folder: Path) -> None:
    """Delete the files of drones that a gateway has begun to write when it was killed.

    For the holder of the folder, which alone writes files of drones. Keys, in a folder below, have other writers, too.
    """
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            if _UNFINISHED.fullmatch(path.name):
                with contextlib.suppress(OSError):
                    path.unlink()


def replace_file(path: Path, data: bytes) -> None:
    """Replace a file of the state folder, so that it survives a power cut at any moment.

    Only this user can read it. One that root writes belongs to the owner of its folder, as that of a service: root may
    make a key for it. Raises `OSError`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            if os.name == "posix" and os.geteuid() == 0 and (owner := path.parent.stat()).st_uid != 0:
                with contextlib.suppress(OSError):  # a container or a network disk may forbid it: it stays root's
                    os.fchown(file.fileno(), owner.st_uid, owner.st_gid)
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise
    with contextlib.suppress(OSError):  # not every system can do this, and the file itself is complete
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


if sys.platform == "win32":
    import msvcrt

    _BEYOND = 1 << 30
    """Place of the byte that is locked: Windows lets no other process read locked bytes."""

    def try_lock(file: int, *, is_shared: bool = False) -> bool:
        os.lseek(file, _BEYOND, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            if error.errno in _HELD:
                return False
            raise
        return True

else:
    import fcntl

    def try_lock(file: int, *, is_shared: bool = False) -> bool:
        """Lock an open file; False when another holds it.

        `is_shared`: for a look only, beside others that look; Windows has no such locks. Raises `OSError` where the
        file system has no locks.
        """
        try:
            fcntl.flock(file, (fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in _HELD:
                return False
            raise
        return True

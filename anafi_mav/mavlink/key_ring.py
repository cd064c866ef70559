"""The signing keys of a node: loads them, advances their timestamps, saves them ahead.

A key is a file of 40 bytes in the folder `keys` of the state folder. Only its owner may read it: a file or folder that
others can read is refused, as SSH refuses such keys. Windows has no such permissions; there the folder inherits those
of the user's profile. `Signing` is the core. The ring looks at its keys once a second; with no key in use it does
nothing. Frames that are refused are reported by one line every ten seconds, however many they are.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import os
import re
import stat
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

from anafi_mav.clock import Alarm, Clock
from anafi_mav.disk_writer import HANGS
from anafi_mav.documents import open_file
from anafi_mav.endpoint_options import KEY_NAME
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.signing import CONTENT_BYTES, KEY_BYTES, Signing
from anafi_mav.state_lock import STATE_WRITER, replace_file

logger = logging.getLogger(__name__)

FOLDER = "keys"
SUFFIX, OLD_SUFFIX = ".key", ".key.old"
"""Of the present key, and of the one before it, to which `keygen --undo` returns."""

NAME = re.compile(KEY_NAME)
NAME_EXPECTED = "the name of a key: 1 to 64 letters, digits, '-', '_' or '.', beginning with a letter or digit"

_OTHERS = stat.S_IRWXG | stat.S_IRWXO

LOOK_EVERY = 1.0
"""s between looks at timestamps and refused frames."""

REPORT_EVERY = 10.0
"""s between two lines in the log about refused frames of one key."""

SAVE_LIMIT = 1.0
"""s in which a timestamp is written. Behind a slower disk frames are accepted without it, so that a disk that hangs
stops no pilot."""

REPLACE_LIMIT = 3.0
"""s in which another key is written. QGroundControl waits 5 s for a frame that verifies (qgroundcontrol#14268)."""

CLOSE_LIMIT = 1.0
"""s that closing waits for the disk."""


class KeyRing:
    """The keys in one folder. `open` them, `start`, `close`.

    A folder of None has no keys: nothing can be signed.
    """

    def __init__(self, folder: Path | None, clock: Clock, *, saves: bool = True) -> None:
        """Without `saves` the files are read only.

        A program beside the gateway then uses its key with the clock's timestamps.
        """
        self._problems: dict[str, str] = {}
        """Why the newest timestamp of a key could not be saved, by the key's name; empty while they can."""
        self._folder = folder
        self._saves = saves
        self._clock = clock
        self._keys: dict[str, Signing] = {}
        self._alarm = Alarm(self._look)
        self._saving: asyncio.Task[None] | None = None
        self._replaced: set[str] = set()
        """Keys that are being replaced: their timestamps are not saved meanwhile."""
        self._reported: dict[str, Counter[str]] = {}
        self._report_at = 0.0

    @property
    def problem(self) -> str:
        """Why timestamps could not be saved; empty while they can."""
        names: dict[str, list[str]] = {}
        for name, reason in self._problems.items():
            names.setdefault(reason, []).append(name)
        return "; ".join(_problem(keys, reason) for reason, keys in names.items())

    def open(self, name: str, *, is_required: bool) -> Signing | None:
        """Return the key with this name, off if there is no such key.

        One name is one object. Raises `ConfigError`, without a key path, for a key that cannot be used, or is required
        and absent.
        """
        if NAME.fullmatch(name) is None:
            raise ConfigError("", f"expected {NAME_EXPECTED}, got {name!r}")
        if name in self._keys:
            return self._keys[name]
        if self._folder is None:
            if is_required:
                raise ConfigError("", f"no key {name}: there is no state folder")
            return None
        try:
            content = read_key(self._folder, name)
        except OSError as error:
            if is_required:
                raise ConfigError("", f"{self._folder}: {error.strerror}") from error
            logger.warning("%s: %s; SETUP_SIGNING is refused", self._folder, error.strerror)
            return None
        if content is None and is_required:
            raise ConfigError("", f"no key {name} in {self._folder}; make it with: anafi-mav keygen {name}")
        content = content or bytes(CONTENT_BYTES)
        if not self._saves:
            content = content[:KEY_BYTES] + bytes(CONTENT_BYTES - KEY_BYTES)
        signing = self._keys[name] = Signing(name, content)
        signing.on_due = self._save_soon
        if is_required and not signing.is_on:
            logger.warning("key %s: switched off by SETUP_SIGNING, its endpoints do not sign", name)
        return signing

    async def start(self) -> None:
        """Save timestamps ahead, before anything is signed, and begin to look after them."""
        await self._save_due()
        self._look()

    async def close(self) -> None:
        """Save the reached timestamps, where the next start continues. Safe to call twice.

        Behind a disk that hangs the next start continues at those that were saved ahead, as after a crash.
        """
        self._alarm.cancel()
        keys = [signing for signing in self._keys.values() if signing.is_on and self._saves]
        self._keys.clear()
        if not keys:
            return
        saving = asyncio.get_running_loop().create_task(self._save_last(keys, self._saving))
        self._saving = None
        done, _ = await asyncio.wait([saving], timeout=CLOSE_LIMIT)
        if not done:
            saving.cancel()
            await asyncio.wait([saving])  # what has not begun is not written later
            for signing in keys:
                self._warn(signing.name, HANGS)

    async def _save_last(self, keys: list[Signing], saving: asyncio.Task[None] | None) -> None:
        if saving is not None:
            await asyncio.wait([saving])
        for signing in keys:
            await self._write(signing, signing.timestamp)

    async def replace(self, signing: Signing, secret: bytes, timestamp: int, *, before_use: Callable[[], bool]) -> bool:
        """Store another key and keep the old one's file; return True if the new one is used.

        Zeros stand for no key. `before_use` is called when the files are written; False keeps the old key. Raises
        `OSError`, for a disk that does not answer in time, too; the old key then remains in use.
        """
        assert self._folder is not None
        self._replaced.add(signing.name)
        try:
            if self._saving is not None:
                await _in_time(self._saving)
            is_used = await self._replace(self._folder, signing, secret, timestamp, before_use)
        finally:
            self._replaced.discard(signing.name)
        self._look()
        return is_used

    async def _replace(
        self, folder: Path, signing: Signing, secret: bytes, timestamp: int, before_use: Callable[[], bool]
    ) -> bool:
        now = self._clock.time()
        new = Signing(signing.name, signing.content())
        new.replace(secret, timestamp)
        new.advance(now)
        saved, old = max(new.due(now) or new.timestamp, signing.saved), signing.content(signing.saved)
        arguments = (folder, signing.name, new.content(saved), old)
        writing = asyncio.get_running_loop().run_in_executor(STATE_WRITER, write_new_key, *arguments)
        is_used, is_written = False, True
        try:
            await _in_time(writing)
            is_written = writing.exception() is None
            writing.result()
            is_used = before_use()
            if is_used:
                signing.replace(secret, timestamp)
                signing.saved, signing.is_kept = saved, True
        finally:
            if is_written and not is_used:
                writing.cancel()
                STATE_WRITER.post(partial(_write_again, folder, signing.name, old))  # behind what is late
        return is_used

    def _look(self) -> None:
        now = self._clock.time()
        due = False
        for signing in self._keys.values():
            if signing.is_on:
                signing.advance(now)
                due = due or (self._saves and signing.due(now) is not None)
        if due:
            self._save_soon()
        self._report()
        if any(signing.is_on for signing in self._keys.values()):
            self._alarm.set_in(LOOK_EVERY)

    def _save_soon(self) -> None:
        """Begin to save the timestamps that are due, unless that is going on."""
        if self._saving is None or self._saving.done():
            self._saving = asyncio.get_running_loop().create_task(self._save_due())

    async def _save_due(self) -> None:
        now, writing = self._clock.time(), []
        for signing in self._keys.values():
            signing.advance(now)
            if self._saves and signing.name not in self._replaced and (timestamp := signing.due(now)) is not None:
                writing.append(self._write(signing, timestamp))
        # Not one after the other: behind a disk that hangs each key has to learn of it.
        await asyncio.gather(*writing)

    async def _write(self, signing: Signing, timestamp: int) -> None:
        assert self._folder is not None
        arguments = (self._folder, signing.name, signing.content(timestamp))
        writing = asyncio.get_running_loop().run_in_executor(STATE_WRITER, write_key, *arguments)
        try:
            done, _ = await asyncio.wait([writing], timeout=SAVE_LIMIT)
            if not done:
                signing.is_kept = False
                self._warn(signing.name, HANGS)
            await asyncio.wait([writing])
            writing.result()
        except OSError as error:
            signing.is_kept = False
            self._warn(signing.name, error.strerror or str(error))
        except asyncio.CancelledError:
            writing.cancel()
            raise
        else:
            signing.saved, signing.is_kept = max(timestamp, signing.saved), True
            self._problems.pop(signing.name, None)

    def _warn(self, name: str, reason: str) -> None:
        """Note and log that a key's timestamp could not be saved."""
        if self._problems.get(name) != reason:
            logger.warning("%s", _problem([name], reason))
        self._problems[name] = reason

    def _report(self) -> None:
        """Write how many frames were refused since the last line."""
        now = self._clock.monotonic()
        if now < self._report_at:
            return
        for signing in self._keys.values():
            new = signing.refused - self._reported.get(signing.name, Counter())
            if new:
                kinds = ", ".join(f"{count} {kind.removeprefix('refused_')}" for kind, count in sorted(new.items()))
                logger.warning("key %s: frames refused: %s; newest on %s", signing.name, kinds, signing.last_refused)
                self._reported[signing.name] = signing.refused.copy()
                self._report_at = now + REPORT_EVERY


def _problem(names: list[str], reason: str) -> str:
    return f"key {', '.join(names)}: {reason}; old frames may be accepted after a restart"


def folder_of(state: Path) -> Path:
    """Return the folder of the keys in a state folder."""
    return state / FOLDER


def path_of(folder: Path, name: str, suffix: str = SUFFIX) -> Path:
    """Return the file of a key."""
    return folder / f"{name}{suffix}"


def read_key(folder: Path, name: str, suffix: str = SUFFIX) -> bytes | None:
    """Return the content of a key file; None if there is no such file.

    Raises `ConfigError`, without a key path, for a file that cannot be used, and `OSError` for one that cannot be read.
    No message holds anything of the content.
    """
    path = path_of(folder, name, suffix)
    try:
        _check(folder, folder.stat(), "700")
        with open_file(path) as file:
            _check(path, os.fstat(file.fileno()), "600")
            content = file.read(CONTENT_BYTES + 1)
    except FileNotFoundError:
        return None
    if len(content) != CONTENT_BYTES:
        raise ConfigError("", f"{path}: expected a key file of {CONTENT_BYTES} bytes, got {len(content)} or more")
    return content


def has_key(folder: Path, name: str) -> bool:
    """Return True if there is a key with this name that can be used, and it is not switched off."""
    try:
        content = read_key(folder, name)
    except (ConfigError, OSError):
        return False
    return content is not None and Signing(name, content).is_on


def write_key(folder: Path, name: str, content: bytes, suffix: str = SUFFIX) -> None:
    """Replace a key file, and make the folder if it is absent.

    What root makes belongs to the owner of the state folder. Raises `OSError`.
    """
    if not folder.exists():
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if os.name == "posix" and os.geteuid() == 0:
            # Not by its name: the owner may have put another file there meanwhile.
            owner, made = folder.parent.stat(), os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            with contextlib.suppress(OSError):  # a container or a network disk may forbid it
                os.fchown(made, owner.st_uid, owner.st_gid)
            os.close(made)
    replace_file(path_of(folder, name, suffix), content)


def write_new_key(folder: Path, name: str, content: bytes, old: bytes) -> None:
    """Replace a key and keep the old one. Raises `OSError`; the key is then the old one."""
    write_key(folder, name, old, OLD_SUFFIX)
    write_key(folder, name, content)


async def _in_time(work: asyncio.Future[None]) -> None:
    """Wait for the disk. Raises `TimeoutError`."""
    await asyncio.wait([work], timeout=REPLACE_LIMIT)
    if not work.done():
        raise TimeoutError(errno.ETIMEDOUT, HANGS)


def _write_again(folder: Path, name: str, content: bytes) -> None:
    """Write the key that remains in use over another one. In the thread of files."""
    with contextlib.suppress(OSError):
        write_key(folder, name, content)


def _check(path: Path, status: os.stat_result, mode: str) -> None:
    if os.name != "posix":
        return
    if status.st_mode & _OTHERS:
        found = f"{stat.S_IMODE(status.st_mode):o}"
        raise ConfigError("", f"{path}: expected mode {mode}, got {found}: others could read the key; chmod {mode} it")

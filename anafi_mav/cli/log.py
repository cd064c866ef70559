"""Log of the long-running commands: one line per event, with time, level and source.

Text of peers is cleaned, and a line that repeats is written once every few seconds with a count: a program that sends
a refused command ten times a second must not hide other events.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import io
import itertools
import json
import logging
import os
import re
import stat
import time
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from types import TracebackType

from anafi_mav.cli.terminal import END_LIMIT, MAX_WAITING, STDERR_WRITER, complain_later, write_stderr
from anafi_mav.disk_writer import DiskWriter
from anafi_mav.errors import ConfigError
from anafi_mav.printable import printable
from anafi_mav.state_lock import check_folder
from anafi_mav.subject import DRONE

FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"

REPEAT_EVERY = 5.0
"""s for which a line is not written again."""

TEXT, JSON = FORMATS = ("text", "json")

FILE_BYTES, OLD_FILES = 10_000_000, 5
"""Bytes of a log file before it is put aside as FILE.1, and files that are put aside: 60 MB in all, which is months of
warnings, or some hours with -vv."""

MAX_LINES = 200
"""Different lines whose repetition is noticed."""

_NUMBER = re.compile(r"\d+(\.\d+)?")


class CleanFormatter(logging.Formatter):
    """Formats a record as one line of printable text that names its drone.

    A traceback follows line by line.
    """

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        subject = DRONE.get()
        if subject and not record.message.startswith(subject):
            record.message = f"{subject}: {record.message}"
        record.message = printable(record.message)
        return super().formatMessage(record)

    def formatException(  # noqa: N802
        self, ei: tuple[type[BaseException], BaseException, TracebackType | None] | tuple[None, None, None]
    ) -> str:
        return "\n".join(printable(line) for line in super().formatException(ei).split("\n"))


class RepeatFilter(logging.Filter):
    """Drops a line that differs from an earlier one in its numbers only, and counts it.

    The first argument of a record is its drone by convention, or `subject` knows it: two drones never count as one.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lines: dict[tuple[str, int, str, str], tuple[float, int]] = {}
        """When each line was written, and how often it was dropped since."""

    def filter(self, record: logging.LogRecord) -> bool:
        if record.levelno < logging.INFO or record.exc_info:
            return True
        first = str(record.args[0]) if isinstance(record.args, tuple) and record.args else ""
        key = (record.name, record.levelno, DRONE.get() + first, _NUMBER.sub("#", record.getMessage()))
        now = self._clock()
        written, dropped = self._lines.get(key, (None, 0))
        if written is not None and now - written < REPEAT_EVERY:
            self._lines[key] = (written, dropped + 1)
            return False
        if len(self._lines) >= MAX_LINES:
            self._lines.clear()
        self._lines[key] = (now, 0)
        if dropped:
            record.msg, record.args = f"{record.getMessage()} (and {dropped} times before)", ()
        return True


class JsonFormatter(logging.Formatter):
    """Formats a record as one JSON object on one line."""

    def format(self, record: logging.LogRecord) -> str:
        moment = datetime.fromtimestamp(record.created, timezone.utc)
        entry = {
            "time": moment.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "level": record.levelname,
            "logger": record.name,
            "drone": DRONE.get(),
            "message": record.getMessage(),
        }
        if record.exc_info:
            entry["exception"] = self.formatException(record.exc_info)
        # In ASCII: what a peer sent can then do nothing to a terminal.
        return json.dumps(entry).replace("\x7f", "\\u007f")


class LogOutputs(logging.Handler):
    """Passes each record to several handlers. What repeats is counted once for all of them."""

    def __init__(self, handlers: Sequence[logging.Handler]) -> None:
        super().__init__()
        self._handlers = handlers
        self.addFilter(RepeatFilter())

    def emit(self, record: logging.LogRecord) -> None:
        for handler in self._handlers:
            handler.handle(record)


class BoundedLogFile:
    """A log file of bounded size. A full disk is reported once, and ends nothing.

    No `logging.Handler`: `logging` closes those at its end, and would wait for a disk that hangs.
    """

    def __init__(self, path: Path) -> None:
        """Open the file for appending. Raises OSError."""
        self._path = path
        self._file = self._open()
        if self._is_regular:
            self._path = path.resolve()  # what is put aside is the file, never a link to it, as /dev/stderr
        self._reported: set[str] = set()

    def write(self, line: str) -> None:
        """Append a line."""
        data = line.encode(errors="backslashreplace") + b"\n"
        try:
            # Of a device, as /dev/null or a pipe, nothing is full, and no other file may get its name.
            if self._is_regular and self._size and self._size + len(data) > FILE_BYTES:
                self._file.close()
                try:
                    self._put_aside()
                except OSError as error:  # as a file in /var/log, whose folder is root's
                    self._complain("begins again, because it cannot be put aside", error)
                    os.truncate(self._path, 0)
            if self._file.closed:
                self._file = self._open()
            self._size += len(data)
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            self._complain("cannot be written", error)

    def _complain(self, problem: str, error: OSError) -> None:
        """Report the first error of each kind."""
        if problem not in self._reported:
            self._reported.add(problem)
            complain_later(f"--log-file: {self._path} {problem}: {error}")

    def _open(self) -> io.FileIO:
        file = io.FileIO(self._path, "ab")
        status = os.fstat(file.fileno())
        self._size, self._is_regular = status.st_size, stat.S_ISREG(status.st_mode)
        return file

    def _put_aside(self) -> None:
        """Rename FILE to FILE.1, FILE.1 to FILE.2 and so on; the oldest one is replaced."""
        names = [self._path, *(Path(f"{self._path}.{number}") for number in range(1, OLD_FILES + 1))]
        for older, newer in reversed([*itertools.pairwise(names)]):
            with contextlib.suppress(FileNotFoundError):
                older.replace(newer)


class LogThreadHandler(logging.Handler):
    """Passes lines to a thread that writes them: a disk or a terminal that hangs stops no drone.

    What cannot be taken is dropped and counted; a line says how many lines are lost.
    """

    def __init__(self, writer: DiskWriter, write: Callable[[str], None], slow: str) -> None:
        """`slow`: what was too slow, for that line."""
        super().__init__()
        self._writer = writer
        self._write = write
        self._slow = slow
        self._lost = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record later, or count it."""
        try:
            line = self.format(record)
        except Exception:
            self.handleError(record)
            return
        self._post_lost()
        if self._lost or not self._writer.post(partial(self._write, line)):
            self._lost += 1
            self._note_loss()

    def end(self, timeout: float = END_LIMIT) -> None:
        """Wait until everything is written, `timeout` s at most."""
        self._writer.wait(timeout)
        self._post_lost()
        self._writer.wait(timeout)

    def _note_loss(self) -> None:
        """Handle the loss of a line, beside counting it."""

    def _post_lost(self) -> None:
        """Write how many lines were lost, when there is room for it."""
        if not self._lost:
            return
        text, lost = "%d lines lost: %s too slow", (self._lost, self._slow)
        record = logging.LogRecord(__name__, logging.WARNING, "", 0, text, lost, None)
        if self._writer.post(partial(self._write, self.format(record))):
            self._lost = 0


class LogFileHandler(LogThreadHandler):
    """Passes lines to a log file, and reports once on stderr that lines are lost."""

    def __init__(self, path: Path) -> None:
        """Open the file for appending. Raises OSError."""
        file = BoundedLogFile(path)
        super().__init__(DiskWriter("anafi-mav-log", max_waiting=MAX_WAITING), file.write, "disk")
        self._path = path
        self._has_complained = False

    def _note_loss(self) -> None:
        if not self._has_complained:
            self._has_complained = True
            complain_later(f"--log-file: {self._path} is too slow: lines are lost")


def check(option: str, path: Path) -> None:
    """Raise `ConfigError` for an option's file that cannot be written. Nothing is made."""
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if path.exists():  # a device, or a file in a folder of another user, is written where it is
            if not os.access(path, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            return
        if not path.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        check_folder(path.parent)
    except OSError as error:
        raise _unusable(option, path, error) from error


def _unusable(option: str, path: Path, error: OSError) -> ConfigError:
    return ConfigError(option, f"expected a file that can be written, got {path}: {error.strerror}")


def set_up(level: int = logging.WARNING, *, path: Path | None = None, kind: str = TEXT) -> None:
    """Write the log of this process to stderr, and to a file as well, from this level on.

    `kind`: of `FORMATS`. Raises `ConfigError` for a file that cannot be written.
    """
    handlers: list[LogThreadHandler] = [LogThreadHandler(STDERR_WRITER, write_stderr, "terminal")]
    if path is not None:
        try:
            handlers.append(LogFileHandler(path))
        except OSError as error:
            raise _unusable("--log-file", path, error) from error
    for handler in handlers:
        atexit.register(handler.end)
        handler.setFormatter(JsonFormatter() if kind == JSON else CleanFormatter(FORMAT))
    logging.basicConfig(level=level, handlers=[LogOutputs(handlers)])

"""Log of the long-running commands: one line per event, with time, level and source.

Text of peers is cleaned, and a line that repeats is written once every few seconds with a count: a program that sends
a refused command ten times a second must not hide other events.
"""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable
from types import TracebackType

from anafi_mav.printable import printable
from anafi_mav.subject import DRONE

FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"

REPEAT_EVERY = 5.0
"""s for which a line is not written again."""

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


def set_up(level: int = logging.WARNING) -> None:
    """Write the log of this process to stderr, from this level on."""
    handler = logging.StreamHandler()
    handler.setFormatter(CleanFormatter(FORMAT))
    handler.addFilter(RepeatFilter())
    logging.basicConfig(level=level, handlers=[handler])

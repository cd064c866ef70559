"""A disk that hangs: as a pipe that is full, or as a writer that is busy."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

from anafi_mav.disk_writer import DiskWriter

PATIENCE = 30.0
"""s for a thread of a busy machine."""


def hanging_file(path: Path) -> tuple[Path, int]:
    """Make a file whose writers wait; return it and its end to read from, which lets them go on.

    The pipe is full of line ends.
    """
    os.mkfifo(path)
    reading = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    writing = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    with contextlib.suppress(BlockingIOError):
        while os.write(writing, b"\n"):
            pass
    os.close(writing)
    os.set_blocking(reading, True)
    return path, reading


@contextlib.contextmanager
def hanging(writer: DiskWriter) -> Iterator[threading.Event]:
    """Let the disk of a writer hang until the event is set, or until the end of the block."""
    begun, disk = threading.Event(), threading.Event()
    work = writer.submit(lambda: (begun.set(), disk.wait()))
    assert begun.wait(PATIENCE)
    try:
        yield disk
    finally:
        disk.set()
        work.result(PATIENCE)

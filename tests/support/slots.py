"""Limits how many tests run at once on this machine, in all runs together, to the workers of one run.

Two runs beside each other would let each test wait twice as long for the processor, and clients of other projects give
up meanwhile. Before each test a worker locks one of some files in the system's temporary folder. A run that is alone
never waits. The system unlocks what a killed run has held.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

SLOTS = max(6, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))
"""Tests that run at once: 6 as in pyproject.toml, or as many as this run has workers."""

LOOK_EVERY = 0.02
"""s between two looks for a free slot."""

FOLDER = Path(tempfile.gettempdir()) / f"anafi-mav-tests-{os.getuid() if hasattr(os, 'getuid') else 0}"

_IS_WITHIN_TEST = "PYTEST_CURRENT_TEST" in os.environ
"""This run is part of a test, whose slot it shares."""


def lock(folder: Path, slots: int) -> int | None:
    """Return the descriptor of a locked file, or None when all of so many are locked."""
    for number in range(slots):
        descriptor = os.open(folder / str(number), os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
        else:
            return descriptor
    return None


@contextmanager
def slot(folder: Path = FOLDER, slots: int = SLOTS) -> Iterator[None]:
    """Hold one of so many slots within the block; wait for one before."""
    folder.mkdir(mode=0o700, exist_ok=True)
    while (descriptor := lock(folder, slots)) is None:
        time.sleep(LOOK_EVERY)  # no event tells of another process' lock
    try:
        yield
    finally:
        os.close(descriptor)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol() -> Generator[None, object, object]:
    """Run a test in a slot; its time limit begins then."""
    if fcntl is None or _IS_WITHIN_TEST:
        return (yield)
    with slot():
        return (yield)

"""The clock of tests runs like that of other processes as long as there is a child."""

from __future__ import annotations

import os
import subprocess
import sys

from support import clock


def test_child_is_seen_from_its_start_to_its_end() -> None:
    assert clock.childless()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE):
        assert not clock.childless()
    assert clock.childless()


def test_fork_is_seen() -> None:
    assert clock.childless()
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(writer)
        os.read(reader, 1)
        os._exit(0)
    try:
        assert not clock.childless()
    finally:
        os.close(writer)
        os.close(reader)
        os.waitpid(child, 0)
    assert clock.childless()

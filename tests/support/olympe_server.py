"""Pytest plugin: beside workers, scripts written against Olympe are forked from a process that has imported it.

That is `interop/olympe_fork.py`. Without workers each script is a process of its own: the tests' clock does not leave
out any time while the process that runs the tests has a child.

Each script gets a UDP port of its own from the system, because Olympe's default port is reserved.
"""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest

PROGRAM = Path(__file__).parents[1] / "interop" / "olympe_fork.py"

VARIABLE = "OLYMPE_SERVER"
"""Environment variable with the path of the program's socket; absent without the program."""

ANSWER = 64
"""Bytes of an answer at most."""


CONTROLLER_PORT = 9988
"""UDP port of Parrot's controllers (libarsdk's arsdk_net.h); one that is in use is replaced by any free one."""


def pytest_configure(config: pytest.Config) -> None:
    """Reserve Olympe's port, and start the program before the workers."""
    if hasattr(config, "workerinput"):
        return
    config.add_cleanup(_reserve_port().close)
    if not config.getoption("numprocesses", None):
        return
    if importlib.util.find_spec("olympe") is None or not hasattr(os, "pidfd_open"):
        return
    folder = tempfile.TemporaryDirectory(prefix="olympe")
    path = f"{folder.name}/socket"
    words = [sys.executable, str(PROGRAM), path]
    with _log(path).open("w") as log:
        server = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True)
    assert server.stdout is not None
    assert server.stdout.readline() == "ready\n"
    os.environ[VARIABLE] = path

    def end() -> None:
        del os.environ[VARIABLE]
        with server:  # closes its stdin, and waits
            pass
        folder.cleanup()

    config.add_cleanup(end)


def _reserve_port() -> socket.socket:
    """Keep Olympe's port from every script.

    A drone sends for up to 8 s to a controller that has left, and libarsdk takes a datagram from any source: the next
    controller with that port would read the frames of a drone that is not its own. Other runs of the tests may hold
    the port, too.
    """
    held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    with suppress(OSError):  # an Olympe outside of the tests has it
        held.bind(("", CONTROLLER_PORT))
    return held


def _log(path: str) -> Path:
    return Path(path).with_name("log")


def is_running() -> bool:
    """Return True when scripts can be forked."""
    return VARIABLE in os.environ


def start(argv: Sequence[str], files: tuple[int, int, int]) -> socket.socket:
    """Fork a script; `argv`: its path first, `files`: its stdin, stdout and stderr.

    The connection receives its process id and its exit status. To close it before kills the script.
    """
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        connection.connect(os.environ[VARIABLE])
        request = {"argv": argv, "folder": str(Path.cwd()), "environment": dict(os.environ)}
        socket.send_fds(connection, [json.dumps(request).encode()], files)
    except BaseException:
        connection.close()
        raise
    return connection


def number(answer: bytes) -> int:
    """Return an answer; fails with what the program says when it has ended."""
    assert answer, _log(os.environ[VARIABLE]).read_text()
    return int(answer)


class Script:
    """A forked script with pipes, with what is used of `subprocess.Popen`."""

    def __init__(self, path: Path) -> None:
        theirs, ours = os.pipe()
        self.stdin = os.fdopen(ours, "w", encoding="utf-8")
        ours, written = os.pipe()
        self.stdout = os.fdopen(ours, encoding="utf-8")
        self._connection = start([str(path)], (theirs, written, 2))
        os.close(theirs)
        os.close(written)
        self.pid = number(self._connection.recv(ANSWER))
        self._status: int | None = None

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status. Raises `TimeoutError`."""
        if self._status is None:
            self._connection.settimeout(timeout)
            self._status = number(self._connection.recv(ANSWER))
            self._connection.close()
        return self._status

    def kill(self) -> None:
        if self._status is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

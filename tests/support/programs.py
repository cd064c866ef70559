"""Starts `python -m anafi_mav` from a process that has imported it already (`program_server.py`).

A test sees no difference: the program is a child of the process that runs the test, with the command line's words, the
folder, the environment and the streams that `subprocess` was asked for. What asks for more (another Python, a session
of its own, variables that Python reads when it starts) is started by `subprocess` itself, as are all programs outside
of Linux. `tests/unit/cli/test_program.py` starts the program itself.
"""

from __future__ import annotations

import atexit
import ctypes
import inspect
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from support import clock

SERVER = Path(__file__).with_name("program_server.py")

PROGRAM = [sys.executable, "-m", "anafi_mav"]

HONOURED = ("PYTHONFAULTHANDLER", "PYTHONUNBUFFERED")
"""Variables that Python reads when it starts, and the server in a program's place."""

ANSWER = 64
"""Bytes of an answer at most."""

NEUTRAL = {
    "cwd": None, "env": None, "close_fds": True, "pass_fds": (), "preexec_fn": None, "shell": False, "gid": None,
    "gids": None, "uid": None, "umask": -1, "start_new_session": False, "process_group": -1, "restore_signals": True,
}  # fmt: skip
"""What `subprocess` hands on to the start of a process when a caller asks for nothing."""

PR_SET_CHILD_SUBREAPER = 36
"""Of prctl(2)."""


class ProgramServer:
    """The process that forks, from the first start on."""

    def __init__(self) -> None:
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._environment = _read_at_start(os.environ)
        self._lock = threading.Lock()
        with theirs:
            self._process = subprocess.Popen([sys.executable, str(SERVER)], stdin=theirs)
        assert self._channel.recv(ANSWER) == b"ready"
        atexit.register(self.close)

    def can_start(self, environment: Mapping[str, str]) -> bool:
        """Whether Python has nothing else to read when it starts."""
        return self._process.returncode is None and _read_at_start(environment) == self._environment

    def start(self, words: list[str], folder: str, environment: Mapping[str, str], files: list[int]) -> int:
        """Start the program as a child of this process; returns its process id."""
        request = {"words": words, "folder": folder, "environment": dict(environment)}
        prctl = ctypes.CDLL(None, use_errno=True).prctl
        with self._lock:
            prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
            try:
                socket.send_fds(self._channel, [json.dumps(request).encode()], files)
                pid = int(self._channel.recv(ANSWER))
                assert self._channel.recv(ANSWER) == b"orphan"
                clock.note_child(pid)
            finally:
                prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)
        return pid

    def close(self) -> None:
        """End the process."""
        self._channel.close()
        self._process.wait()


def _read_at_start(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables that Python, or a library while it is imported, reads."""
    read = ("PYTHON", "LC_", "LANG", "LD_", "MALLOC", "OPENSSL", "SSL_", "AIOHTTP", "YARL", "COVERAGE")
    return {key: value for key, value in environment.items() if key.startswith(read) and key not in HONOURED}


def install() -> None:
    """From here on `subprocess` starts the program by the server."""
    start = subprocess.Popen._execute_child  # type: ignore[attr-defined]
    parameters = list(inspect.signature(start).parameters)[1:]
    if sys.platform != "linux":
        return
    server: list[ProgramServer] = []

    def forked_start(self: Any, *values: Any) -> None:
        asked = dict(zip(parameters, values, strict=True))
        words = asked["args"]
        changed = {name for name, value in NEUTRAL.items() if asked.get(name, value) != value} - {"cwd", "env"}
        if not isinstance(words, (list, tuple)) or [*words[:3]] != PROGRAM or changed or asked["executable"]:
            return start(self, *values)
        if not server:
            server.append(ProgramServer())
        environment = os.environ if asked["env"] is None else asked["env"]
        if not server[0].can_start(environment):
            return start(self, *values)
        ends = [asked[name] for name in ("p2cread", "c2pwrite", "errwrite")]
        files = [number if end == -1 else end for number, end in enumerate(ends)]
        folder = str(Path(asked["cwd"] or ".").absolute())
        self.pid = server[0].start([*map(str, words[3:])], folder, environment, files)
        self._child_created = True
        self._close_pipe_fds(*(asked[name] for name in PIPES))
        return None

    subprocess.Popen._execute_child = forked_start  # type: ignore[attr-defined]


PIPES = ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite")

"""Imports `anafi-mav` once and forks for each start of it: ``program_server.py``, with a Unix socket as stdin.

Importing the product takes most of a second of processor time, and the suite starts it some two hundred times. A fork
has what its own imports would give it: no thread runs and nothing is open in this process when it forks.

A request is one datagram: JSON with `words` (of the command line, after the program's name), `folder` (the current
one) and `environment`, with three files, which become stdin, stdout and stderr. The answers are the process id of the
program, and then the word "orphan": the program's parent has ended. Who has made itself the reaper of orphans
(PR_SET_CHILD_SUBREAPER) is the program's parent from then on, as if it had started it.

This process has a session of its own, and each program a process group of its own in it. When a process ends whose
child is in another group of the same session, the kernel sends SIGHUP to all of that group if one of it is stopped: in
the group of pytest that would end the run, for tests stop their gateways. This process ends when the other end of the
socket is closed.
"""

from __future__ import annotations

import faulthandler
import gc
import importlib
import io
import json
import os
import runpy
import socket
import sys
import time
from pathlib import Path
from typing import Any

COMMANDS = ("discover", "doctor", "ground", "info", "keygen", "media", "plan", "replay", "run", "sim", "status")

MODULES = [*(f"anafi_mav.cli.{name}" for name in COMMANDS), "anafi_mav.cli.plan_fly", "anafi_mav.web.webrtc"]
"""Not zenoh's: a program that has imported it ends in another way."""

MAX_REQUEST = 1 << 18
"""Bytes, most of them the environment."""


def main() -> None:
    os.setsid()
    sys.path[0] = str(Path.cwd())  # as -m does
    with socket.socket(fileno=os.dup(0)) as channel:
        for name in MODULES:
            importlib.import_module(name)
        (only,) = Path("/proc/self/task").iterdir()
        assert int(only.name) == os.getpid(), "a fork would lose threads"
        gc.freeze()
        channel.send(b"ready")
        request, files = serve(channel)
    if request:
        become(json.loads(request), files)


def serve(channel: socket.socket) -> tuple[bytes, list[int]]:
    """Fork for each request; returns in a fork with its request, and with none at the end."""
    while True:
        request, files, _, _ = socket.recv_fds(channel, MAX_REQUEST, 3)
        if not request:
            return b"", []
        parent = os.fork()
        if parent == 0:
            program = os.fork()
            if program == 0:
                return request, files
            os.setpgid(program, program)
            channel.send(str(program).encode())
            os._exit(0)
        for file in files:
            os.close(file)
        os.waitpid(parent, 0)
        channel.send(b"orphan")


def become(request: dict[str, Any], files: list[int]) -> None:
    """Be the program: returns or raises as it does."""
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    time.tzset()
    open_streams()
    if "PYTHONFAULTHANDLER" in os.environ:
        faulthandler.enable()
    sys.argv[1:] = request["words"]
    runpy.run_module("anafi_mav", run_name="__main__", alter_sys=True)


def open_streams() -> None:
    """Make the objects of the standard streams as Python's start does."""
    sys.stdin = sys.__stdin__ = io.TextIOWrapper(open(0, "rb", closefd=False))  # noqa: SIM115
    raw = bool(os.environ.get("PYTHONUNBUFFERED"))
    for number, name, errors in (1, "stdout", "strict"), (2, "stderr", "backslashreplace"):
        file: Any = open(number, "wb", 0 if raw else -1, closefd=False)  # noqa: SIM115
        lines = number == 2 or os.isatty(number)
        stream = io.TextIOWrapper(file, errors=errors, line_buffering=lines, write_through=raw)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)


if __name__ == "__main__":
    main()

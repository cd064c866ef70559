"""Imports Olympe once and forks for each script: ``olympe_fork.py SOCKET``.

To import Olympe takes seconds of processor time: it makes a class of each of Parrot's messages. This program does that
with the first request. Olympe's one thread after its import writes its log, and looks for a line a thousand times a
second, most of a script's processor time: the log is written without it here. All other threads begin with Olympe's
objects, so a script finds what its own import would give it.

A client connects to the Unix socket SOCKET and sends one datagram: JSON with `argv` (the script's path first),
`folder` (the current one) and `environment`, with three files, which become stdin, stdout and stderr. The answers are
the script's process id and its exit status. The script is killed when the client closes the connection before its end.
This program ends with its stdin.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import random
import runpy
import select
import signal
import socket
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any

MODULES = ("olympe", "olympe.controllers.device", "olympe.features.media.media", "olympe.features.video.pdraw")
"""Modules that several scripts import. Not Olympe's examples: they read the environment when they are imported."""

MAX_REQUEST = 1 << 18
"""Bytes, most of them the environment."""


def main(path: str) -> None:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(path)
    listener.listen(64)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    os.dup2(2, 1)  # Olympe logs to stdout, where a script has its report
    while sys.stdin not in select.select([listener, sys.stdin], [], [])[0]:
        client = listener.accept()[0]
        if "olympe" not in sys.modules:
            import_olympe()
        if os.fork() == 0:
            listener.close()
            attend(client)
        client.close()
        collect(os.WNOHANG)
    collect(0)


def import_olympe() -> None:
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # numpy's threads
    for module in MODULES:
        importlib.import_module(module)
    sys.modules["olympe"].log.update_config({"handlers": {"console": {"class": "logging.StreamHandler"}}})
    (only,) = Path("/proc/self/task").iterdir()
    assert int(only.name) == os.getpid(), "a fork would lose threads"
    gc.freeze()


def collect(options: int) -> None:
    """Collect the processes that have ended: their processor time counts as this one's."""
    with suppress(ChildProcessError):
        while os.waitpid(-1, options)[0]:
            pass


def attend(client: socket.socket) -> None:
    """Run the script of a client; never returns."""
    try:
        request, files, _, _ = socket.recv_fds(client, MAX_REQUEST, 3)
        pid = os.fork()
        if pid == 0:
            client.close()
            run(json.loads(request), files)
        client.send(str(pid).encode())
        end = os.pidfd_open(pid)
        if end not in select.select([end, client], [], [])[0]:
            os.kill(pid, signal.SIGKILL)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        with suppress(OSError):
            client.send(str(status).encode())
    finally:
        os._exit(0)


def run(request: dict[str, Any], files: list[int]) -> None:
    """Be the script; never returns."""
    status = 1
    try:
        for number, file in enumerate(files):
            os.dup2(file, number)
            os.close(file)
        os.chdir(request["folder"])
        os.environ.clear()
        os.environ.update(request["environment"])
        sys.argv = request["argv"]
        sys.path[0] = str(Path(sys.argv[0]).parent)
        random.seed()
        runpy.run_path(sys.argv[0], run_name="__main__")
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            sys.stderr.write(f"{end.code}\n")
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


if __name__ == "__main__":
    main(sys.argv[1])

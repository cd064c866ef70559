"""Simulator in its own process: `anafi-mav sim` with a configuration's simulated drones."""

from __future__ import annotations

import asyncio
import collections
import contextlib
import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import anafi_mav
from anafi_mav.cli.terminal import complain, complain_later
from anafi_mav.errors import AnafiMavError, ConfigError

START_LIMIT = 30.0
"""s until a simulator has to be ready: it takes one, a small computer with a hundred drones several."""

LEAVE_LIMIT = 3.0
"""s that it gets to end by itself once its stdin is closed, and again after SIGTERM."""

MAX_COMPLAINTS = 100
"""Lines kept of what it says on stderr before it is ready: room for a traceback."""

REFUSED = 2
"""Its exit status when it cannot use what it was given; its last line on stderr says why."""


class SimulatorProcess:
    """Started by `start`, ended by `close`.

    It ends itself when its stdin closes, so it cannot outlive us.
    """

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._readers: list[asyncio.Task[None]] = []
        self._complaints: collections.deque[str] = collections.deque(maxlen=MAX_COMPLAINTS)
        self._ready: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    async def start(self, fleet: Mapping[str, object], log: Path | None = None) -> None:
        """Start the simulator with the drones of `fleet` and wait until it is ready.

        `fleet` is the JSON of `anafi-mav sim --fleet`. The simulator writes its log to `log`, an absolute path
        because it runs in another directory. Raises `ConfigError` if it refuses the fleet, `AnafiMavError` if it
        fails otherwise.
        """
        logging = () if log is None else ("--log", str(log))
        self._process = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "anafi_mav", "sim", "--fleet", "-", "--stdin-watch", *logging),
            cwd=Path(anafi_mav.__file__).parents[1],  # -m looks here first: it has to find this very package
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for us: a drone in the air must not lose its simulator by it
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),  # the same on Windows
        )
        assert process.stdin is not None
        with contextlib.suppress(ConnectionError):  # it has ended already: its status is looked at below
            process.stdin.write(json.dumps(fleet).encode() + b"\n")
            await process.stdin.drain()
        self._readers = [asyncio.create_task(self._read_lines()), asyncio.create_task(self._read_complaints())]
        exited = asyncio.create_task(process.wait())
        either: set[asyncio.Future[Any]] = {exited, self._ready}
        try:
            await asyncio.wait(either, timeout=START_LIMIT, return_when=asyncio.FIRST_COMPLETED)
            if self._ready.done():
                return
            if not exited.done():
                raise AnafiMavError(f"the simulator was not ready within {START_LIMIT:g} s")
            await asyncio.wait(self._readers, timeout=LEAVE_LIMIT)
            if exited.result() == REFUSED and self._complaints:
                raise ConfigError("", self._complaints.pop())
            raise AnafiMavError(f"the simulator ended with status {exited.result()} before it was ready")
        finally:
            exited.cancel()
            for line in self._complaints:
                complain(line)

    async def wait(self) -> int:
        """Its exit status, once it has ended."""
        assert self._process is not None, "wait() belongs after start()"
        return await self._process.wait()

    async def close(self) -> None:
        """End it: politely, then less so. Safe to call twice, and before `start`."""
        process = self._process
        if process is None:
            return
        assert process.stdin is not None
        process.stdin.close()
        for end in (process.terminate, process.kill):
            try:
                await asyncio.wait_for(process.wait(), LEAVE_LIMIT)
                break
            except asyncio.TimeoutError:
                with contextlib.suppress(ProcessLookupError):
                    end()
        await process.wait()
        for reader in self._readers:
            reader.cancel()
        await asyncio.gather(*self._readers, return_exceptions=True)

    async def _read_lines(self) -> None:
        """Wait for the line that begins with `ready`, and read on so that the pipe never fills."""
        assert self._process is not None
        assert self._process.stdout is not None
        async for line in self._process.stdout:
            if line.startswith(b"ready") and not self._ready.done():
                self._ready.set_result(None)

    async def _read_complaints(self) -> None:
        assert self._process is not None
        assert self._process.stderr is not None
        async for line in self._process.stderr:
            text = line.decode(errors="replace").strip().removeprefix("anafi-mav: ")
            if self._ready.done():
                complain_later(text)  # drones fly
            else:
                self._complaints.append(text)

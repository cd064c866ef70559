"""The simulator as a process of its own, the way users run it; its log is a file."""

from __future__ import annotations

import asyncio
import json
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any


class SimulatorProcess:
    """`anafi-mav sim` with its log."""

    def __init__(self, process: asyncio.subprocess.Process, log: Path) -> None:
        self.process = process
        self.log = log

    def signal(self, number: int) -> None:
        self.process.send_signal(number)

    async def kill(self) -> None:
        """End it at once, as a power cut would."""
        self.process.kill()
        await self.process.wait()

    def commands(self) -> list[dict[str, Any]]:
        """Every command it has received, oldest first."""
        whole = self.log.read_bytes().rpartition(b"\n")[0] if self.log.exists() else b""
        return [entry for entry in map(json.loads, whole.splitlines()) if entry["kind"] == "command"]


async def start_simulator(address: str, log: Path, *arguments: str) -> SimulatorProcess:
    """Start it and wait for its line that begins with "ready"."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "anafi_mav", "sim", "--address", address, "--log", str(log), *arguments,
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None
    while not (line := await asyncio.wait_for(process.stdout.readline(), 100.0)).startswith(b"ready"):
        assert line, "the simulator ended before it was ready"
    return SimulatorProcess(process, log)


@asynccontextmanager
async def simulator_process(address: str, log: Path, *arguments: str) -> AsyncIterator[SimulatorProcess]:
    """The simulator for the length of a block."""
    held = await start_simulator(address, log, *arguments)
    try:
        yield held
    finally:
        if held.process.returncode is None:
            held.process.send_signal(signal.SIGCONT)
            held.process.terminate()
            await held.process.wait()


@asynccontextmanager
async def gateway_process(config: Path, limit: float) -> AsyncIterator[asyncio.subprocess.Process]:
    """A gateway for the length of a block, whose event loop may stall for `limit` s behind a Skycontroller.

    Real time counts for it: the limit is longer than the machine makes it wait.
    """
    imports = "from anafi_mav.arsdk.link import watchdog; from anafi_mav.cli import main"
    code = f"import sys; {imports}; watchdog.LIMIT = {limit}"
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", f"{code}; sys.exit(main(sys.argv[1:]))", "run", "-c", str(config),
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        while not (line := await asyncio.wait_for(process.stdout.readline(), 100.0)).startswith(b"ready"):
            assert line, "the gateway ended before it was ready"
        yield process
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            await process.wait()

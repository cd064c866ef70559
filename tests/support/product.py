"""The product as users run it: `anafi-mav run` as a process, with the simulator that it starts."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from typing_extensions import Self

from support import flavours

START_LIMIT = 30.0
"""s until a process has to say its first word: two of them share two busy cores."""


def free_udp_port(address: str) -> int:
    """A port of an address that only we use, so that no one else takes it in the meantime."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((address, 0))
        port: int = probe.getsockname()[1]
        return port


class Process:
    """A child whose output is kept line by line as it comes."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.lines: list[str] = []
        """stdout."""
        self.complaints: list[str] = []
        """stderr."""
        self._updated = asyncio.Event()
        loop = asyncio.get_running_loop()
        self._readers = [
            loop.create_task(self._read(process.stdout, self.lines)),
            loop.create_task(self._read(process.stderr, self.complaints)),
        ]

    @classmethod
    async def start(
        cls,
        *words: str,
        stdin: int = asyncio.subprocess.DEVNULL,
        env: Mapping[str, str] | None = None,
        cwd: Path | None = None,
    ) -> Self:
        """`env` is added to our own environment."""
        pipe = asyncio.subprocess.PIPE
        whole = {**os.environ, "PYTHONFAULTHANDLER": "1", **(env or {})}
        return cls(
            await asyncio.create_subprocess_exec(*words, stdin=stdin, stdout=pipe, stderr=pipe, env=whole, cwd=cwd)
        )

    async def _read(self, stream: asyncio.StreamReader | None, lines: list[str]) -> None:
        assert stream is not None
        while line := await stream.readline():
            lines.append(line.decode(errors="replace").rstrip())
            self._tell()
        self._tell()

    def _tell(self) -> None:
        self._updated.set()
        self._updated = asyncio.Event()

    async def look(self, accept: Callable[[str], bool], *, since: int, timeout: float) -> str | None:
        """The first line of stdout, from a place on, that `accept` likes; None when none comes in time."""

        async def find() -> str:
            position = since
            while True:
                for line in self.lines[position:]:
                    position += 1
                    if accept(line):
                        return line
                assert not all(reader.done() for reader in self._readers), f"ended: {self.process.returncode}{self}"
                await self._updated.wait()

        try:
            return await asyncio.wait_for(find(), timeout)
        except asyncio.TimeoutError:
            return None

    async def line(self, accept: Callable[[str], bool], *, since: int = 0, timeout: float = START_LIMIT) -> str:
        """As `look`, where the line has to come. A program that is late is ended: where its threads stand is its last
        word, if it is Python's."""
        found = await self.look(accept, since=since, timeout=timeout)
        if found is None:
            with suppress(ProcessLookupError, asyncio.TimeoutError):
                self.process.send_signal(signal.SIGABRT)
                await asyncio.wait_for(asyncio.shield(asyncio.gather(*self._readers)), 5.0)
            raise AssertionError(f"no such line within {timeout} s: {self}")
        return found

    def said(self, words: str) -> list[str]:
        """What followed these words on stdout, line by line."""
        return [line.removeprefix(words).strip() for line in self.lines if line.startswith(words + " ")]

    def say(self, line: str) -> None:
        """A line to its stdin."""
        assert self.process.stdin is not None
        self.process.stdin.write(line.encode() + b"\n")

    async def end(self, timeout: float = START_LIMIT) -> int:
        """Its exit status, once it has ended and all that it said is read."""
        status = await asyncio.wait_for(self.process.wait(), timeout)
        await asyncio.wait_for(asyncio.gather(*self._readers), timeout)
        return status

    async def put_away(self) -> None:
        """End it whatever it does."""
        if self.process.returncode is None:
            self.process.kill()
        await self.process.wait()
        for reader in self._readers:
            reader.cancel()
        await asyncio.gather(*self._readers, return_exceptions=True)

    def __str__(self) -> str:
        return "\n".join(["", *self.lines, "stderr:", *self.complaints])


@asynccontextmanager
async def program(
    *words: str,
    stdin: int = asyncio.subprocess.DEVNULL,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
) -> AsyncIterator[Process]:
    """Any program for the length of a block."""
    held = await Process.start(*words, stdin=stdin, env=env, cwd=cwd)
    try:
        yield held
    finally:
        await held.put_away()


class Product(Process):
    """`anafi-mav run` with a configuration file."""

    log: Path

    def entries(self, kind: str, name: str = "") -> list[dict[str, Any]]:
        """What its simulator noted: entries of a kind whose name ends in `name`, oldest first."""
        whole = self.log.read_bytes().rpartition(b"\n")[0] if self.log.exists() else b""
        found = map(json.loads, whole.splitlines())
        return [entry for entry in found if entry["kind"] == kind and entry["name"].endswith(name)]

    async def entry(
        self, kind: str, name: str, accept: Callable[[dict[str, Any]], bool] = lambda args: True, timeout: float = 20.0
    ) -> dict[str, Any]:
        """Wait until the newest such entry has arguments that `accept` likes; that entry."""
        deadline = asyncio.get_running_loop().time() + timeout
        while True:
            found = self.entries(kind, name)
            if found and accept(found[-1]["args"]):
                return found[-1]
            assert asyncio.get_running_loop().time() < deadline, (kind, name, found[-3:], str(self))
            await asyncio.sleep(0.05)  # another process writes the file

    async def flying_state(self, wanted: str, timeout: float = 20.0) -> dict[str, Any]:
        """Wait until the drone's own state is this; the entry that says so."""
        return await self.entry("state", "flying", lambda args: args["to"] == wanted, timeout)

    def child(self) -> int | None:
        """Process id of the simulator that it started; None if it has no child."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        assert len(children) <= 1
        return int(children[0]) if children else None


@asynccontextmanager
async def product(
    folder: Path, config: str, *arguments: str, ready: bool = True, env: Mapping[str, str] | None = None
) -> AsyncIterator[Product]:
    """The gateway and its simulator for the length of a block; by default it begins when both are ready."""
    path, log = folder / "fleet.yaml", folder / "sim.jsonl"
    path.write_text(config)
    flavours.note(config)
    words = (sys.executable, "-m", "anafi_mav", "run", "-c", str(path), "--sim-log", str(log), *arguments)
    held = await Product.start(*words, env=env)
    held.log = log
    try:
        if ready:
            await held.line(lambda line: line.startswith("ready"))
        yield held
    finally:
        if held.process.returncode is None:
            held.process.send_signal(signal.SIGTERM)
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(held.process.wait(), 10.0)
        await held.put_away()

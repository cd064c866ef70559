"""Ctrl-C while a command starts: exit status 130 and not a word, wherever it comes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from support.fabric import free_port
from support.product import Process, program
from support.world import loopback

from anafi_mav.cli.ground_client import Ground

MISSIONS = Path(__file__).parents[3] / "missions"

DRIVER = r"""
import os, runpy, signal, sys, tempfile

def interrupted():
    "Fork here: the child gets SIGINT and goes on as the program would."
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            os.kill(os.getpid(), signal.SIGINT)
            return
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said.seek(0)
        text = said.read().decode(errors="replace")
        if (status, text) != (130, ""):
            wrong.append((Finder.seen, status, text[-2000:]))

class Finder:
    "Sees each import of a module that is not loaded yet."
    seen, parent = 0, os.getpid()
    def find_spec(self, name, path=None, target=None):
        if (name == "anafi_mav.cli" or Finder.seen) and os.getpid() == Finder.parent:
            if Finder.seen % step == 0:
                interrupted()
            Finder.seen += 1
        return None

wrong, step = [], int(sys.argv[1])
sys.argv[:] = ["anafi-mav", *sys.argv[2:]]
sys.meta_path.insert(0, Finder())
try:
    runpy.run_module("anafi_mav", run_name="__main__", alter_sys=True)
except SystemExit as end:
    if os.getpid() != Finder.parent:
        os._exit(end.code)
print(Finder.seen, "imports")
for one in wrong:
    print("wrong:", *one)
sys.stdout.flush()
os._exit(bool(wrong))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="it interrupts a copy of the process at each import")
@pytest.mark.parametrize(
    "words",
    [
        ["run", "-c", "none.yaml"],
        ["sim", "--count", "0"],
        ["info", "127.0.0.1"],
        ["doctor", "127.0.0.1", "--http-port", "0"],
        ["discover", "--timeout", "0"],
        ["plan", "show", "none.plan"],
        ["plan", "upload", "none.plan"],
    ],
    ids=" ".join,
)
def test_ctrl_c_at_any_import_ends_without_a_word(tmp_path: Path, words: list[str]) -> None:
    """Every 25th import of each command, some forty of them: a copy of the process gets SIGINT there."""
    driver = tmp_path / "driver.py"
    driver.write_text(DRIVER)
    done = subprocess.run(
        [sys.executable, str(driver), "25", *words],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split()[-2]) > 100, done.stdout
    assert "Traceback" not in done.stderr


@contextlib.asynccontextmanager
async def silent_device() -> AsyncIterator[tuple[str, asyncio.Event]]:
    """A device that accepts a connection and says nothing."""
    address, accepted, held = loopback(), asyncio.Event(), []

    def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        held.append(writer)
        accepted.set()

    server = await asyncio.start_server(take, address, 44445)
    try:
        yield address, accepted
    finally:
        for writer in held:
            writer.close()
        server.close()


async def interrupted(p: Process, number: int = signal.SIGINT) -> int:
    p.process.send_signal(number)
    return await p.end(10.0)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("words", [["info", "ADDRESS", "--take"], ["doctor", "ADDRESS"], ["discover", "ADDRESS"]])
async def test_signal_while_awaiting_a_drone_ends_the_command(words: list[str], number: int, status: int) -> None:
    """As it ends by itself: with SIGTERM, too, `status` gives the terminal back."""
    async with silent_device() as (address, accepted):
        words = [address if word == "ADDRESS" else word for word in words]
        async with program(sys.executable, "-m", "anafi_mav", *words) as p:
            await asyncio.wait_for(accepted.wait(), 30.0)
            assert await interrupted(p, number) == status
            assert (p.lines, p.complaints) == ([], [])


async def test_ctrl_c_that_is_repeated_to_the_end_keeps_the_exit_status() -> None:
    async with (
        silent_device() as (address, accepted),
        program(sys.executable, "-m", "anafi_mav", "info", address, "--take") as p,
    ):
        await asyncio.wait_for(accepted.wait(), 30.0)
        while p.process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(p.process.pid, signal.SIGINT)  # send_signal of asyncio may take the exit status (cpython#87744)
            await asyncio.sleep(0)  # as many as it can take
        assert await p.end(10.0) == 130, str(p)


async def test_ctrl_c_while_awaiting_a_vehicle_ends_the_upload() -> None:
    connected = asyncio.Event()
    address = loopback()
    server = await asyncio.start_server(lambda reader, writer: connected.set(), address, 5760)
    words = ("plan", "upload", str(MISSIONS / "loop.plan"), "--endpoint", f"tcpout://{address}:5760")
    async with program(sys.executable, "-m", "anafi_mav", *words) as p:
        await asyncio.wait_for(connected.wait(), 30.0)
        assert await interrupted(p) == 130
        assert (p.lines, p.complaints) == ([], [])
    server.close()


async def test_ctrl_c_with_a_ready_simulator_ends_it_cleanly() -> None:
    words = ("sim", "--address", loopback(), "--http-port", "0", "--rtsp-port", "0")
    async with program(sys.executable, "-m", "anafi_mav", *words) as p:
        await p.line(lambda line: line.startswith("ready"))
        assert await interrupted(p) == 0
        assert p.complaints == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_signal_with_a_ready_ground_process_ends_it_cleanly(number: int) -> None:
    words = ("ground", "--zenoh", f"zenoh://127.0.0.1:{free_port()}", "--endpoint", "udpin://127.0.0.1:0")
    async with program(sys.executable, "-m", "anafi_mav", *words) as p:
        await p.line(lambda line: line.startswith("ready"))
        assert await interrupted(p, number) == 0, str(p)


async def test_ignored_ctrl_c_stays_ignored() -> None:
    """A shell starts its background jobs so: Ctrl-C is for the job in front."""
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "import runpy; sys.argv[:] = ['anafi-mav', *sys.argv[1:]]\n"
        "runpy.run_module('anafi_mav', run_name='__main__', alter_sys=True)"
    )
    async with silent_device() as (address, accepted):
        async with program(sys.executable, "-c", code, "info", address, "--take") as p:
            await asyncio.wait_for(accepted.wait(), 30.0)
            assert await interrupted(p) == 1
        assert p.complaints == [f"anafi-mav: no answer from {address} within 3 s"]


class UpdatedGround(Ground):
    """A ground that hears something when the test says so."""

    def update(self) -> None:
        self._tell()


async def test_ctrl_c_together_with_a_message_is_not_lost() -> None:
    """asyncio.wait_for returns then, until Python 3.12, and the command would go on."""
    ground = UpdatedGround("udpin://127.0.0.1:0")
    waiting = asyncio.create_task(ground.wait_for_update(10.0))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    ground.update()
    await asyncio.sleep(0)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting

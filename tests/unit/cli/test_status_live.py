"""`anafi-mav status` on a terminal: what is shown while the gateway does not answer."""

from __future__ import annotations

import asyncio
import io
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import aiohttp
import msgspec
import pytest
from aiohttp import web
from support.statuses import STATUS

from anafi_mav.cli.status import LIMIT, find, follow, head
from anafi_mav.cli.terminal import TableRows, is_live, live_tables
from anafi_mav.state_lock import StateLock
from anafi_mav.status_record import PATH
from anafi_mav.web.server import HttpServer


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def picture(monkeypatch: pytest.MonkeyPatch, table: TableRows, *, columns: int, lines: int) -> list[str]:
    """What a terminal of this size shows of a table, line by line."""
    screen = _Terminal()
    monkeypatch.setattr("sys.stdout", screen)
    for name, value in ("COLUMNS", str(columns)), ("LINES", str(lines)), ("TERM", "xterm"):
        monkeypatch.setenv(name, value)
    assert is_live()
    with live_tables() as show:
        show(["first"], [table])
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue()).splitlines()


def test_table_on_a_narrow_terminal_loses_no_column(monkeypatch: pytest.MonkeyPatch) -> None:
    """Warnings are the last column: on 80 columns they were beyond the edge."""
    table = TableRows(("x", "y"), [("a" * 30, "w" * 40)])
    text = "".join(picture(monkeypatch, table, columns=40, lines=25))
    assert (text.count("a"), text.count("w")) == (30, 40)


def test_table_on_a_low_terminal_tells_what_is_below(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = picture(monkeypatch, TableRows(("x",), [(f"row {number}",) for number in range(30)]), columns=80, lines=10)
    assert [line.strip() for line in shown[-2:]] == [
        "row 5",
        "and 24 more lines: make the window higher, or add | cat",
    ]


def test_dumb_terminal_is_not_live(monkeypatch: pytest.MonkeyPatch) -> None:
    """No line can be replaced there: the status is printed once."""
    monkeypatch.setattr("sys.stdout", _Terminal())
    monkeypatch.setenv("TERM", "dumb")
    assert not is_live()


class Screen:
    """Keeps the lines above the tables, as they were shown."""

    def __init__(self) -> None:
        self.shown: list[Sequence[str]] = []
        self._updated = asyncio.Event()

    def show(self, lines: Sequence[str], tables: Sequence[TableRows]) -> None:
        assert [row[0] for row in tables[0].rows] == ["alpha", "bravo"]
        self.shown.append(lines)
        self._updated.set()

    async def until(self, accept: Callable[[str], bool]) -> str:
        """Return the first line of the next picture whose first line `accept` likes."""
        while True:
            self._updated.clear()
            await self._updated.wait()
            if accept(self.shown[-1][0]):
                return self.shown[-1][0]


async def gateway(lock: StateLock, answer: Callable[[], web.Response]) -> HttpServer:
    """Return the web server of a gateway that holds a state folder."""
    server = HttpServer(port=0)

    async def status(request: web.Request) -> web.Response:
        return answer()

    server.add_get(PATH, status)
    await server.start()
    lock.write((), server.describe())
    return server


def present() -> web.Response:
    return web.Response(body=msgspec.json.encode(STATUS))


def is_current(line: str) -> bool:
    return line == head(STATUS)[0]


async def test_status_goes_on_after_missed_answers_and_a_restart(tmp_path: Path) -> None:
    answers = [present]

    def refuse() -> web.Response:
        raise web.HTTPServiceUnavailable(text="busy")

    lock, screen = StateLock(tmp_path), Screen()
    assert lock.acquire() is None
    first = await gateway(lock, lambda: answers[0]())
    async with aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=LIMIT)) as session:
        following = asyncio.create_task(follow(session, lambda: find(str(tmp_path), None), STATUS, screen.show))
        try:
            await screen.until(is_current)
            answers[0] = refuse
            line = await screen.until(lambda line: not is_current(line))
            assert line.startswith("no answer for 1 s, the values are of before: ")
            assert line.endswith(": 503 busy")
            assert (await screen.until(lambda line: "for 3 s" in line)).endswith(": 503 busy")
            answers[0] = present
            await screen.until(is_current)
            await first.close()
            lock.release()
            assert "no gateway holds" in await screen.until(lambda line: not is_current(line))
            assert lock.acquire() is None
            second = await gateway(lock, present)
            await screen.until(is_current)
            await second.close()
        finally:
            following.cancel()
            with suppress(asyncio.CancelledError):
                await following
            lock.release()


async def test_status_shows_the_age_while_a_gateway_hangs(tmp_path: Path) -> None:
    """A gateway that is stopped accepts the connection and sends nothing: the values must not look current."""
    lock, screen = StateLock(tmp_path), Screen()
    assert lock.acquire() is None
    kept: list[asyncio.StreamWriter] = []  # Python 3.13 closes the connection of a writer that nothing holds
    hanging = await asyncio.start_server(lambda reader, writer: kept.append(writer), "127.0.0.1", 0)
    lock.write((), f"http://127.0.0.1:{hanging.sockets[0].getsockname()[1]}/")
    async with aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=LIMIT)) as session:
        following = asyncio.create_task(follow(session, lambda: find(str(tmp_path), None), STATUS, screen.show))
        try:
            assert "for 2 s" in await screen.until(lambda line: not is_current(line))
            assert "does not answer" in await screen.until(lambda line: "slow" not in line)
        finally:
            following.cancel()
            with suppress(asyncio.CancelledError):
                await following
            hanging.close()
            for writer in kept:
                writer.close()
            lock.release()

"""Flight logs: listed, copied and deleted on the simulator; and lists that are not readable."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest
from aiohttp import web
from support.simulated import connected
from support.web_answers import serving

from anafi_mav.drone.payload.item_list import MAX_ITEMS
from anafi_mav.drone.rest import JSON_LIMIT
from anafi_mav.errors import CommandRejected, LinkLost, NotSupported, RemoteProtocolError

DATE = "20261121T101112+0100"
TIME = 1795252272
"""The same in s since 1970, by hand: 20778 days, 9 h 11 min 12 s."""


async def test_log_is_listed_copied_and_deleted(tmp_path: Path) -> None:
    async with connected("4k") as pair:
        logs, store = pair.drone.flight_logs, pair.real.firmware.flight_logs
        late, early = store.add(DATE, 3.0), store.add("20261120T101112+0100", 200.0)
        assert [(log.name, log.size, log.time) for log in await logs.list()] == [
            ("log-2.bin", early.size, TIME - 86400),
            ("log-1.bin", late.size, TIME),
        ]
        first, second = await logs.list()
        path = await logs.download(first, tmp_path)
        assert path == tmp_path / "log-2.bin"
        assert path.read_bytes() == b"".join(early.parts(0, early.size, early.size))
        assert await logs.read(second, 1000, 100) == next(late.parts(1000, 1100, 100))
        await logs.delete(first)
        assert await logs.list() == (second,)
        assert [log.name for log in store] == ["log-1.bin"]
        with pytest.raises(CommandRejected, match="404"):
            await logs.delete(first)
    with pytest.raises(LinkLost):
        await logs.list()


async def test_log_that_is_not_readable_is_left_out(caplog: pytest.LogCaptureFixture) -> None:
    listed = [
        {"name": "log-10.bin", "size": 90, "date": DATE, "url": "data/fdr/log-10.bin"},
        {"name": "log-9.bin", "size": 180, "date": DATE, "url": "/data/fdr/log-9.bin", "new": [None]},
        {"name": "log-1.bin", "size": 70, "date": "99999999T999999+9999"},
        {"name": "../log", "size": 90},
        {"name": "log-2.bin", "size": 0},
        {"name": "log-2.bin", "size": -1},
        {"name": "log-2.bin", "size": "many"},
        {"name": "log-2.bin", "size": 90, "date": 7},
        {"size": 90},
        [1],
        None,
    ]
    body = json.dumps(listed).encode()[:-1] + b', {"name": "log-3.bin", "size": 90, "date": "\xe9"}]'
    with caplog.at_level(logging.WARNING):
        async with serving(lite_records=web.Response(body=body)) as (drone, _):
            found = await drone.flight_logs.list()
    assert [(log.name, log.time, log.file.url) for log in found] == [
        ("log-1.bin", 0, "/"),
        ("log-9.bin", TIME, "/data/fdr/log-9.bin"),
        ("log-10.bin", TIME, "/data/fdr/log-10.bin"),
    ]
    assert "9 flight logs are not readable and left out" in caplog.text


@pytest.mark.parametrize("body", [b"", b"{}", b"7", b"[", b"\xff", b"[" * 4096])
async def test_list_that_is_not_readable_is_an_error(body: bytes) -> None:
    async with serving(lite_records=web.Response(body=body)) as (drone, _):
        with pytest.raises(RemoteProtocolError, match="list of flight logs"):
            await drone.flight_logs.list()


@pytest.mark.parametrize("body", [b"[" + b"0," * MAX_ITEMS + b"0]", b" " * JSON_LIMIT + b"[]"])
async def test_list_that_would_stop_the_event_loop_is_refused(body: bytes) -> None:
    async with serving(lite_records=web.Response(body=body)) as (drone, _):
        with pytest.raises(RemoteProtocolError, match=f"length <= {MAX_ITEMS}|more than {JSON_LIMIT} bytes"):
            await drone.flight_logs.list()


async def test_drone_without_a_list_has_no_flight_logs() -> None:
    async with serving() as (drone, _):
        with pytest.raises(NotSupported, match="flight logs"):
            await drone.flight_logs.list()

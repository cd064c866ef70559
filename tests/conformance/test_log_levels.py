"""The log says loss and return of a link at one level, with the drone's or the endpoint's name."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Iterator

from support.world import loopback, world

from anafi_mav.clock import SystemClock
from anafi_mav.mavlink.node import Node


class Lines(logging.Handler):
    """Lines of warning or worse that begin with a name, as they are written."""

    def __init__(self, beginning: str) -> None:
        super().__init__(logging.WARNING)
        self._beginning = beginning
        self._queue: asyncio.Queue[tuple[int, str]] = asyncio.Queue()

    def emit(self, record: logging.LogRecord) -> None:
        if record.getMessage().startswith(self._beginning):
            self._queue.put_nowait((record.levelno, record.getMessage()))

    async def next(self) -> tuple[int, str]:
        return await asyncio.wait_for(self._queue.get(), 20.0)

    def none(self) -> bool:
        return self._queue.empty()


@contextlib.contextmanager
def listening(beginning: str) -> Iterator[Lines]:
    handler = Lines(beginning)
    logging.getLogger().addHandler(handler)
    try:
        yield handler
    finally:
        logging.getLogger().removeHandler(handler)


async def test_drone_link_loss_and_recovery_have_one_log_level() -> None:
    with listening("alpha: ") as lines:
        async with world() as w:
            assert lines.none()  # a first connection is nothing to warn of
            w.drone.faults.mute = True
            level, text = await lines.next()
            assert level == logging.WARNING
            assert text.startswith("alpha: link lost: ")
            w.drone.faults.mute = False
            while text != "alpha: connected":
                level, text = await lines.next()
            assert level == logging.WARNING


async def test_endpoint_loss_and_recovery_are_logged_at_one_level() -> None:
    address, port = loopback(), 5760
    accepted: asyncio.Queue[asyncio.StreamWriter] = asyncio.Queue()
    server = await asyncio.start_server(lambda reader, writer: accepted.put_nowait(writer), address, port)
    node = Node(clock=SystemClock())
    url = f"tcpout://{address}:{port}"
    with listening(url) as lines:
        await node.start([url])
        first = await asyncio.wait_for(accepted.get(), 10.0)
        assert lines.none()
        first.close()
        second = await asyncio.wait_for(accepted.get(), 10.0)
        assert await lines.next() == (logging.WARNING, f"{url}: the connection ended")
        assert await lines.next() == (logging.WARNING, f"{url}: connected")
        second.close()
        server.close()
        await node.close()

"""The process that gives a Skycontroller's axes back, beside a gateway with many open files."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest

from anafi_mav.arsdk.link.frame import FrameType, encode_frame
from anafi_mav.arsdk.link.watchdog import Watchdog
from anafi_mav.cli import open_files

pytestmark = pytest.mark.skipif(
    os.name != "posix", reason="a process gets pipes of its parent by pass_fds, which subprocess has on POSIX alone"
)

SELECTABLE = 1024
"""Descriptors that select(2) knows."""

FRAME = encode_frame(1, FrameType.WITHACK, 11, 7, b"give the axes back")


@contextmanager
def many_open_files() -> Iterator[None]:
    """Leave no descriptor below `SELECTABLE` free for the length of a block."""
    open_files.allow_many()
    with ExitStack() as stack:
        while (taken := os.open(os.devnull, os.O_RDONLY)) < SELECTABLE:
            stack.callback(os.close, taken)
        os.close(taken)
        yield


async def test_watchdog_beside_a_gateway_with_many_open_files_acts_in_a_stall() -> None:
    with many_open_files(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
        drone.bind(("127.0.0.1", 0))
        drone.settimeout(20.0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.connect(drone.getsockname())
            link.setblocking(False)
            watchdog = Watchdog(lambda: None, 0.3)
            await watchdog.start(link, 1)
            watchdog.stand_by([(7, FRAME)])
            frame, sender = drone.recvfrom(100)  # this blocks the event loop
            drone.sendto(encode_frame(1, FrameType.ACK, 11 + 128, 1, bytes([7])), sender)
            watchdog.close()
            await watchdog.ended()
    assert frame == FRAME

"""Watch the event loop of a gateway that has grabbed a Skycontroller's axes.

A stalled loop must not leave the pilot without control. A child process (`watchdog_child`) shares the link's socket.
While standby frames are set, the loop writes to the child's pipe every `KICK`; when it has not for `LIMIT`, the child
sends these frames, which release the axes, and ends nothing else. A suspended computer suspends the child too.

Only one of both may use the next sequence number, or write to a stream: the one that holds the token, a byte in a
pipe.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from anafi_mav.arsdk.link import watchdog_child
from anafi_mav.arsdk.link.watchdog_child import FRAME, RECORD

log = logging.getLogger("anafi_mav.arsdk")

LIMIT: float | None = 1.0
"""s that the event loop may stall before the child acts; None: no watchdog."""

KICK = 0.2
"""s between two signs of life."""

STALL = 0.5
"""Share of the limit after which the loop makes sure of the token before it sends anything."""

END_LIMIT = watchdog_child.TRY_FOR + 1.0
"""s that the child gets to end once its pipe is closed: it may be sending."""

_TOKEN = b"T"


class Watchdog:
    """One child process beside one link. All methods are called on the event loop's thread."""

    def __init__(self, on_stall: Callable[[], None], limit: float) -> None:
        """`on_stall` is called once the child has given the axes back and sends nothing more."""
        self._loop = asyncio.get_running_loop()
        self._on_stall = on_stall
        self._limit = limit
        self._process: asyncio.subprocess.Process | None = None
        self._pipe = self._token_in = self._token_out = self._report = -1
        self._whole: Callable[[], bool] = lambda: True
        self._frames: Sequence[tuple[int, bytes]] = ()
        self._holding = False
        self._orphaned = False
        """The child has ended before us."""
        self._kicked = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._closed = False

    async def start(self, sock: socket.socket, version: int, whole: Callable[[], bool] | None = None) -> None:
        """Start the child beside this socket. Raises `OSError` when it cannot be started.

        `whole`, for a stream: True while no part of a frame waits to be written.
        """
        stream = whole is not None
        self._whole = whole or self._whole
        link = os.dup(sock.fileno())  # of our own: the link may be closed meanwhile, and its number used again
        pipe, self._pipe = os.pipe()
        self._token_out, self._token_in = os.pipe()
        self._report, report = os.pipe()
        for descriptor in (self._pipe, self._token_in, self._token_out, self._report):
            os.set_blocking(descriptor, False)
        os.write(self._token_in, _TOKEN)
        given = (link, pipe, self._token_out, report)
        try:
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", watchdog_child.__name__, *map(str, given), str(version)),
                *(str(self._limit), str(int(stream))),
                cwd=Path(__file__).parents[3],  # -m looks here first: it has to find this very package
                stdin=asyncio.subprocess.DEVNULL,
                pass_fds=given,
                start_new_session=True,  # what stops or ends the gateway's group must not reach it
            )
        except BaseException:
            self._close_pipes()
            raise
        finally:
            for descriptor in (link, pipe, report):
                os.close(descriptor)
        self._process = process
        if self._closed:
            self._close_pipes()
        elif self._frames:
            self.stand_by(self._frames)

    @property
    def standing_by(self) -> bool:
        """Frames are with the child, or will be when it has started."""
        return bool(self._frames)

    @property
    def in_stall(self) -> float:
        """A moment (loop time, s) at which the loop stood still, in the stall of `on_stall`."""
        return self._kicked + self._limit * STALL

    def stand_by(self, frames: Sequence[tuple[int, bytes]]) -> None:
        """Set the standby frames of the child, (sequence number, bytes).

        They replace the previous ones; with an empty sequence the child stands down.
        """
        began, self._frames = not self._frames, frames
        if self._process is None or self._closed:
            return
        content = b"".join(FRAME.pack(seq, len(frame)) + frame for seq, frame in frames)
        now = self._loop.time()
        if began or now - self._kicked < self._limit * STALL:  # else `secure` has to find a stall first
            self._kicked = now
        self._say(b"F", content)
        if frames and self._timer is None:
            self._timer = self._loop.call_later(KICK, self._kick)
        elif not frames and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def acquire(self) -> bool:
        """Acquire the token, to write to the link.

        False when the child has it: nothing may be written now.
        """
        if self._process is None or self._closed or not self._frames or self._holding:
            return True
        try:
            self._holding = bool(os.read(self._token_out, 1))
        except BlockingIOError:
            self._holding = False
        if not self._holding:
            self._look_for_report()
        return self._holding

    def release(self) -> None:
        """Put the token back, if what was written is whole."""
        if self._holding and self._whole():
            self._holding = False
            os.write(self._token_in, _TOKEN)

    def secure(self) -> bool:
        """After a stall, make sure that the child has not acted.

        False: it has, and nothing may be sent now.
        """
        if self._process is None or not self._frames or self._holding:
            return True
        if self._loop.time() - self._kicked < self._limit * STALL:
            return True
        if not self.acquire():
            return False
        self._kick_now()
        self.release()
        return True

    def close(self) -> None:
        """Stand down and let the child end. Idempotent."""
        if self._closed:
            return
        self.stand_by(())
        self._closed, self._holding = True, False
        if self._process is not None:
            self._close_pipes()

    async def ended(self) -> None:
        """Wait for the child's end after `close`."""
        process = self._process
        if process is None:
            return
        try:
            await asyncio.wait_for(process.wait(), END_LIMIT)
        except asyncio.TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    def _kick(self) -> None:
        self._timer = None
        if self._frames and not self._closed:
            self.release()
            if self.secure():
                self._kick_now()
            if self._timer is None and self._frames:
                self._timer = self._loop.call_later(KICK, self._kick)

    def _kick_now(self) -> None:
        self._kicked = self._loop.time()
        self._say(b"K")

    def _say(self, kind: bytes, content: bytes = b"") -> None:
        try:
            os.write(self._pipe, RECORD.pack(kind, len(content)) + content)
        except BlockingIOError:
            pass  # the child does not read, and will find enough in the full pipe when it does
        except BrokenPipeError:
            if not self._orphaned:
                log.warning("the watchdog over the axes of the Skycontroller has ended")
            self._orphaned = True

    def _look_for_report(self) -> None:
        """The child has the token: go on once it says that it sends nothing more."""
        self._say(b"K")  # it then stops repeating
        try:
            os.read(self._report, 1)  # nothing at its end: the child has ended
        except BlockingIOError:
            return
        self._frames = ()
        os.write(self._token_in, _TOKEN)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._on_stall()

    def _close_pipes(self) -> None:
        for descriptor in (self._pipe, self._token_in, self._token_out, self._report):
            with contextlib.suppress(OSError):
                os.close(descriptor)
        self._pipe = self._token_in = self._token_out = self._report = -1

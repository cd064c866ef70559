"""One drone as a source for viewers: runs its video while they need it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
from collections.abc import Callable
from typing import Protocol

from anafi_mav.arsdk.video.rtp_h264 import Picture
from anafi_mav.clock import Alarm
from anafi_mav.drone import Drone
from anafi_mav.drone.video.stream_choice import StreamKind
from anafi_mav.errors import AnafiMavError
from anafi_mav.relay.feed import Feed, PackedPicture

log = logging.getLogger(__name__)

LINGER = 5.0
"""s that the drone's session goes on without a viewer: between DESCRIBE and PLAY, and for a player that opens a stream
twice, once to look at it."""

FEED_WAIT = 8.0
"""s that a viewer waits for the first picture: RTSP at the drone takes five round trips, and a key picture up to a
second. Players give up after 10 s and more."""

PARAMETERS_WAIT = 1.0
"""s of pictures without parameter sets after which a description is made without them."""

RETRY = 1.0
"""s until a video that did not start is tried again, while there are viewers."""


class NotShown(AnafiMavError):
    """A stream that cannot be watched now; the text says why."""


class FeedViewer(Protocol):
    """A viewer as its source sees it."""

    def show(self, picture: PackedPicture, now: float) -> None:
        """Send a picture, or drop it."""

    def end(self, reason: str) -> None:
        """Close, because the stream is not shown any longer."""


class DroneSource:
    """The streams of one drone. Make it once, `close` it once."""

    def __init__(self, sysid: int, name: str, drone: Drone) -> None:
        self.sysid = sysid
        self.name = name
        self._drone = drone
        self._viewers: tuple[FeedViewer, ...] = ()
        self._feed: Feed | None = None
        self._kind = StreamKind.VISIBLE
        """Of the feed."""
        self._linger = Alarm(self._expire)
        """Runs while the video is needed without a viewer."""
        self._first_picture: float | None = None
        """Loop time of the feed's first picture since the video was started."""
        self._problem = ""
        """Why the last attempt to start the video failed."""
        self._task: asyncio.Task[None] | None = None
        self._ending: set[asyncio.Task[None]] = set()
        """Tasks that only say goodbye."""
        self._waits: set[asyncio.Future[None]] = set()
        self._undo: list[Callable[[], None]] = [
            drone.video.subscribe_pictures(self._on_picture),
            drone.streams.subscribe(self._on_switch),
        ]

    @property
    def viewers(self) -> int:
        """Number of viewers that play."""
        return len(self._viewers)

    @property
    def shown(self) -> StreamKind:
        """The stream that the drone shows."""
        return self._drone.streams.shown.kind

    def refusal(self, kind: StreamKind) -> str | None:
        """Return why a stream cannot be watched now, or None."""
        if not self._drone.connected:
            return f"{self.name} is not connected"
        shown = self._drone.streams.shown.kind
        return None if shown is kind else f"{self.name} shows its {shown.value} stream"

    def has(self, kind: StreamKind) -> bool:
        """Return False when the drone is known to have no such stream."""
        return not self._drone.connected or any(stream.kind is kind for stream in self._drone.streams.offered)

    async def open(self, kind: StreamKind) -> Feed:
        """Start the video where it does not run; return the feed once it has pictures.

        Raises `NotShown`.
        """
        loop = asyncio.get_running_loop()
        give_up = loop.time() + FEED_WAIT
        if self.refusal(kind) is None:
            self._start()
        while True:
            reason = self.refusal(kind)
            if reason is not None:
                raise NotShown(reason)
            self._linger.set_in(LINGER)
            if self._feed is not None and self._is_ready(self._feed, loop.time()):
                return self._feed
            if self._problem:
                raise NotShown(f"{self.name}: {self._problem}")
            if loop.time() >= give_up:
                raise NotShown(f"{self.name}: {self._drone.video.state.problem or 'no picture'}")
            await self._wait(min(PARAMETERS_WAIT, give_up - loop.time()))

    def _is_ready(self, feed: Feed, now: float) -> bool:
        """True when pictures arrive now: those that are kept from before a pause would look live."""
        first = self._first_picture
        is_described = first is not None and (bool(feed.sps) or now - first >= PARAMETERS_WAIT)
        return is_described and self._drone.video.state.playing

    def join(self, viewer: FeedViewer) -> None:
        """Show pictures to this viewer from now on."""
        self._viewers = (*self._viewers, viewer)
        self._start()

    def leave(self, viewer: FeedViewer) -> None:
        """Show it none any more. Idempotent."""
        if viewer in self._viewers:
            self._viewers = tuple(other for other in self._viewers if other is not viewer)
            self._linger.set_in(LINGER)

    async def close(self) -> None:
        """End the drone's session; the viewers are their server's. Idempotent."""
        for undo in self._undo:
            undo()
        self._undo.clear()
        self._viewers = ()
        self._linger.cancel()
        self._expire()
        if self._ending:
            await asyncio.wait(tuple(self._ending))

    # -- the drone's session

    def _is_needed(self) -> bool:
        return bool(self._viewers) or self._linger.is_set

    def _start(self) -> None:
        """Let the video run for `LINGER`, and as long as there are viewers."""
        if not self._undo:
            return
        self._linger.set_in(LINGER)
        if self._task is None or self._task.done():
            self._problem = ""
            self._task = asyncio.create_task(self._run(), name=f"relay {self.name}")

    def _expire(self) -> None:
        """End the video, unless it has viewers."""
        if self._viewers or self._task is None:
            return
        task, self._task = self._task, None
        self._ending.add(task)
        task.add_done_callback(self._ending.discard)
        task.cancel()
        self._first_picture = None
        if self._feed is not None:
            self._feed.interrupt()
        self._notify()

    async def _run(self) -> None:
        """Watch the video until cancelled, or until it does not start and no viewer waits for it."""
        while True:
            try:
                async with self._drone.video.watching():
                    self._problem = ""
                    await asyncio.Event().wait()
            except AnafiMavError as error:
                if str(error) != self._problem:
                    log.info("%s: no video for %d viewers: %s", self.name, len(self._viewers), error)
                self._problem = str(error)
                self._notify()
                if not self._viewers:
                    return
                await asyncio.sleep(RETRY)

    async def _wait(self, seconds: float) -> None:
        """Wait until something has changed."""
        future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waits.add(future)
        try:
            await asyncio.wait({future}, timeout=seconds)
        finally:
            self._waits.discard(future)

    def _notify(self) -> None:
        for future in self._waits:
            if not future.done():
                future.set_result(None)

    # -- what the drone shows

    def _on_switch(self) -> None:
        """The drone shows another stream: the viewers of the former one have nothing to see."""
        shown = self._drone.streams.shown.kind
        if self._feed is not None and shown is not self._kind:
            self._feed, self._first_picture = None, None
            viewers, self._viewers = self._viewers, ()
            for viewer in viewers:
                with contextlib.suppress(OSError):
                    viewer.end(f"{self.name} shows its {shown.value} stream")
        self._notify()

    def _on_picture(self, picture: Picture) -> None:
        if not self._is_needed():
            return  # the video runs for its telemetry only
        now = asyncio.get_running_loop().time()
        feed = self._feed
        if feed is None:
            feed = self._feed = Feed(random.getrandbits(32), random.getrandbits(16), random.getrandbits(32))
            self._kind = self._drone.streams.shown.kind
        if not feed.sps and (shown := self._drone.video.state.shown) is not None:
            feed.set_parameters(shown.sps, shown.pps)
        frame = self._drone.video.state.frame
        is_timed = frame is not None and frame.timestamp == picture.timestamp
        packed = feed.add(picture, now, frame.shot if frame is not None and is_timed else None)
        if packed is None:
            return
        if self._first_picture is None:
            self._first_picture = now
        if self._waits:
            self._notify()
        for viewer in self._viewers:
            try:
                viewer.show(packed, now)
            except Exception:
                log.exception("%s: a viewer failed on a picture", self.name)

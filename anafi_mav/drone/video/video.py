"""Element video: the pictures of the drone, undecoded, and their metadata.

The metadata of a picture is the only source of white-balance gains, exact exposure and gain, fields of view and
goodput, and contains attitude and speed 30 times a second. The video runs while it has a user; else the events of the
other elements serve, 5 times a second.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any, ClassVar, TypeAlias

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.video.rtp_h264 import CLOCK_RATE, Picture
from anafi_mav.arsdk.video.video_metadata import FrameMetadata
from anafi_mav.drone.element import Element, Reducer
from anafi_mav.drone.expectation import require_number
from anafi_mav.drone.piloting.state import Attitude
from anafi_mav.drone.video.route import VideoRoute
from anafi_mav.drone.video.stream import Shown, VideoStream
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, LinkLost
from anafi_mav.units import euler_from_quaternion, unit_quaternion

log = logging.getLogger("anafi_mav")

START_TIMEOUT = 10.0
"""s to wait for a first picture: RTSP takes five round trips, and a key picture comes every second or so."""

STALE = 1.0
"""s after which what the last picture said is forgotten: its attitude is not the drone's any more."""

RATE_WINDOW = 1.0
"""s over which the rate is taken."""
MAX_RATE = 240
"""Pictures a second that are counted; an ANAFI streams 30."""

RETRY, MAX_RETRY = 0.5, 8.0
"""s between two attempts while the video does not come: at first, and at most."""
HEALTHY = 5.0
"""s of pictures after which the next attempt is a first one again."""

_CLOCK_WRAP = 1 << 32


Rotation: TypeAlias = tuple[float, float, float, float]
"""Quaternion (w, x, y, z)."""


class VideoFrame(msgspec.Struct, frozen=True):
    """Metadata of one picture."""

    metadata: FrameMetadata
    arrived: float
    """s on the loop's clock."""
    taken: float
    """s on a clock of the drone, whose zero is arbitrary: differences between two are exact, whatever delayed the
    pictures on their way."""
    timestamp: int
    """RTP timestamp of the picture, 90 kHz; wraps."""
    shot: float
    """s on the loop's clock when the picture was taken, as far as it is known: never after `arrived`, and never before
    the `shot` of an earlier picture of the stream."""
    is_clock_known: bool
    """True when the drone has reported its clock: `shot` is then late by the radio's delay at most. Otherwise the
    fastest picture counts as one without delay."""

    @property
    def rotation(self) -> Rotation | None:
        """Rotation of the drone's axes to north, east, down; None: unknown."""
        return rotation(self.metadata.drone_quat)

    @property
    def camera_rotation(self) -> Rotation | None:
        """Rotation of the picture's axes to north, east, down; None: unknown."""
        return rotation(self.metadata.quat)

    @property
    def attitude(self) -> Attitude | None:
        """Attitude of the drone, as in `PilotingState`; None: unknown."""
        return attitude(self.metadata.drone_quat)

    @property
    def camera_attitude(self) -> Attitude | None:
        """Attitude of the picture; None: unknown."""
        return attitude(self.metadata.quat)


class VideoState(msgspec.Struct, frozen=True):
    """The live video."""

    playing: bool = False
    """True while pictures arrive."""
    shown: Shown | None = None
    """The stream, as the drone describes it."""
    frame: VideoFrame | None = None
    """The newest; None when none arrived within the last second."""
    rate_hz: float | None = None
    """Pictures with metadata per second, over the last second."""
    problem: str = ""
    """Reason why no pictures arrive for a watcher; empty: none, or not known yet."""


FrameCallback: TypeAlias = Callable[[VideoFrame], None]
PictureCallback: TypeAlias = Callable[[Picture], None]


def rotation(quat: Rotation | None) -> Rotation | None:
    """The quaternion of the metadata with length 1; None when it is no rotation."""
    if quat is None:
        return None
    try:
        return unit_quaternion(*quat)
    except ValueError:
        return None


def attitude(quat: Rotation | None) -> Attitude | None:
    """The angles of a quaternion of the metadata; None when it is no rotation."""
    turned = rotation(quat)
    return None if turned is None else Attitude(*euler_from_quaternion(*turned))


class Video(Element[VideoState]):
    """The live video, undecoded, with the metadata of each picture.

    One stream at a time, shared by all its users.
    """

    NOTHING = VideoState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {}

    def __init__(self) -> None:
        super().__init__()
        self.counters: Counter[str] = Counter()
        """Pictures, packets and what became of them, since this was made."""
        self._route: VideoRoute | None = None
        self._users = 0
        self._wanted: str | None = None
        """The stream that a user has named; None: the selected one."""
        self._selected: str | None = None
        """The stream of all users who name none; None: the drone's own choice."""
        self._task: asyncio.Task[None] | None = None
        self._stream: VideoStream | None = None
        self._ending: set[asyncio.Task[None]] = set()
        """Tasks that only say goodbye."""
        self._firsts: set[asyncio.Future[None]] = set()
        """Those who wait for a first picture."""
        self._frame_callbacks: tuple[FrameCallback, ...] = ()
        self._picture_callbacks: tuple[PictureCallback, ...] = ()
        self._stale: asyncio.TimerHandle | None = None
        self._arrivals: list[float] = []
        self._sizes: list[tuple[float, int]] = []
        """Arrival and bytes of the pictures of the last second."""
        self._clock: tuple[int, float] | None = None
        """The timestamp of RTP of the last picture, and when that was taken."""
        self._newest_shot = -math.inf
        """`shot` of the last picture: it never goes back."""

    # -- the connection

    def link_up(self, route: VideoRoute) -> None:
        """Note that the drone is connected and its video is reached by `route`.

        Users that watched before continue to watch.
        """
        self._route = route
        if self._users:
            self._start()

    def link_lost(self) -> None:
        """The drone is gone: nothing that its video said holds any longer."""
        self._route = None
        self._end()
        self._fail(LinkLost("not connected"))
        self.reset()

    async def close(self) -> None:
        """As `link_lost`, and wait until the drone has been notified."""
        self.link_lost()
        await self._ended()

    # -- use

    @asynccontextmanager
    async def watching(self, title: str | None = None, timeout: float = START_TIMEOUT) -> AsyncIterator[None]:
        """Run the video for the length of a block, which begins with the first picture.

        It continues through interruptions, of the link too, until the last block has ended.

        `title` names a stream ("DefaultVideo", "Front camera"); None: what runs already, or the selected stream.
        Raises `CommandRejected` when another stream is being watched, `NotSupported` when the drone has no such
        stream, `CommandTimeout` when no picture comes, `LinkLost`.
        """
        require_number(timeout)
        if self._route is None:
            raise LinkLost("not connected")
        if self._users and title is not None and title != self._wanted:
            shown = self.state.shown
            if self._wanted is not None or shown is None or shown.title != title:
                other = self._wanted or (shown.title if shown else "the drone's choice")
                raise CommandRejected(f"the video shows {other!r}: one stream at a time")
        if not self._users:
            self._wanted = title
        self._users += 1
        try:
            await self._first(timeout)
            yield
        finally:
            self._users -= 1
            if not self._users:
                self._end()
                self.reset()
                await self._ended()

    def select(self, title: str | None) -> None:
        """Show this stream to all users who name none; None is the drone's own choice.

        A running stream is replaced, unless a user has named it.
        """
        if title == self._selected:
            return
        self._selected = title
        if self._users and self._wanted is None:
            self._end()
            self.set_state(replace(self.state, shown=None, problem=""))
            self._start()

    def subscribe(self, callback: FrameCallback) -> Callable[[], None]:
        """Call `callback` with the metadata of every picture, after the state is updated.

        Returns the function that ends it. It does not start the video. What the callback raises is logged.
        """
        self._frame_callbacks = (*self._frame_callbacks, callback)

        def undo() -> None:
            self._frame_callbacks = tuple(other for other in self._frame_callbacks if other is not callback)

        return undo

    def subscribe_pictures(self, callback: PictureCallback) -> Callable[[], None]:
        """Call `callback` with every picture, H.264, undecoded; return the function that ends it."""
        self._picture_callbacks = (*self._picture_callbacks, callback)

        def undo() -> None:
            self._picture_callbacks = tuple(other for other in self._picture_callbacks if other is not callback)

        return undo

    @property
    def bits_per_second(self) -> int:
        """Measured rate of the stream over the last second; 0 without pictures."""
        return 8 * sum(size for _, size in self._sizes) if self.state.playing else 0

    async def next_frame(self, timeout: float = STALE) -> VideoFrame:
        """Return the metadata of the next picture. Raises `CommandTimeout` when none arrives."""
        require_number(timeout)
        came: asyncio.Future[VideoFrame] = asyncio.get_running_loop().create_future()
        undo = self.subscribe(lambda frame: None if came.done() else came.set_result(frame))
        try:
            return await asyncio.wait_for(came, timeout)
        except asyncio.TimeoutError:
            raise CommandTimeout("video metadata", timeout) from None
        finally:
            undo()

    # -- the stream

    async def _first(self, timeout: float) -> None:
        """Wait until pictures come."""
        if self.state.playing:
            return
        first: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._firsts.add(first)
        self._start()
        try:
            done, _ = await asyncio.wait({first}, timeout=timeout)
        finally:
            self._firsts.discard(first)
        if not done:
            raise CommandTimeout("a picture", timeout)
        first.result()

    def _fail(self, error: AnafiMavError) -> None:
        for first in self._firsts:
            if not first.done():
                first.set_exception(error)

    def _start(self) -> None:
        if self._route is not None and (self._task is None or self._task.done()):
            self._task = asyncio.create_task(self._run(self._route), name="video")

    def _end(self) -> None:
        """End the stream. Its task still says goodbye."""
        task, self._task = self._task, None
        self._stream = None
        if task is not None:
            self._ending.add(task)
            task.add_done_callback(self._ending.discard)
            task.cancel()
        self._forget()

    async def _ended(self) -> None:
        if self._ending:
            await asyncio.wait(tuple(self._ending))

    async def _run(self, route: VideoRoute) -> None:
        """One stream after the other."""
        await self._ended()  # a drone is not asked for two at once
        task, loop = asyncio.current_task(), asyncio.get_running_loop()
        delay = RETRY / 2.0
        while self._task is task:
            begun = loop.time()
            title = self._selected if self._wanted is None else self._wanted
            played = await self._play(VideoStream(route, title, self._take, lambda: self._task is task))
            delay = RETRY if played and loop.time() - begun > HEALTHY else min(2.0 * delay, MAX_RETRY)
            await asyncio.sleep(delay)

    async def _play(self, stream: VideoStream) -> bool:
        """One stream to its end; whether there were pictures at last."""
        self._stream = stream
        problem: AnafiMavError | None = None
        try:
            await stream.run()
        except AnafiMavError as error:
            problem = error
        finally:
            self._count(stream)
        if self._stream is not stream or problem is None:
            return False
        if str(problem) != self.state.problem:
            log.info("video: %s", problem)
        played = self.state.playing
        self._forget()
        self.set_state(replace(self.state, shown=stream.shown, problem=str(problem)))
        self._fail(problem)
        return played

    def _count(self, stream: VideoStream) -> None:
        self.counters.update(stream.counters)
        self.counters.update(stream.receiver.counts)
        self.counters.update(stream.receiver.window.counts)

    def _forget(self) -> None:
        """Forget the contents of the last picture."""
        if self._stale is not None:
            self._stale.cancel()
            self._stale = None
        self._arrivals.clear()
        self._sizes.clear()
        self._clock = None
        self.set_state(replace(self.state, playing=False, frame=None, rate_hz=None))

    # -- the hot path

    def _take(self, picture: Picture, now: float) -> None:
        loop = asyncio.get_running_loop()
        if self._stale is not None:
            self._stale.cancel()
        self._stale = loop.call_at(now + STALE, self._forget)
        self._sizes.append((now, sum(map(len, picture.units))))
        del self._sizes[:-MAX_RATE]
        while now - self._sizes[0][0] > RATE_WINDOW:
            self._sizes.pop(0)
        taken = self._taken(picture)
        if not self.state.playing:
            shown = None if self._stream is None else self._stream.shown
            self.set_state(replace(self.state, playing=True, shown=shown, problem=""))
            for first in self._firsts:
                if not first.done():
                    first.set_result(None)
        metadata = picture.metadata
        if metadata is not None:
            self._arrivals.append(now)
            del self._arrivals[:-MAX_RATE]
            while now - self._arrivals[0] > RATE_WINDOW:
                self._arrivals.pop(0)
            span = now - self._arrivals[0]
            rate = (len(self._arrivals) - 1) / span if span > 0.0 else None
            frame = VideoFrame(metadata, now, taken, picture.timestamp, *self._shot(picture, now))
            self.set_state(replace(self.state, frame=frame, rate_hz=rate))
            self._tell(self._frame_callbacks, frame)
        self._tell(self._picture_callbacks, picture)

    def _taken(self, picture: Picture) -> float:
        """Return the time of a picture, s, on the camera's clock.

        If the camera does not report it, it is the time since the stream began, by the timestamps of RTP, which wrap.
        """
        before, taken = self._clock or (picture.timestamp, 0.0)
        taken += ((picture.timestamp - before + _CLOCK_WRAP // 2) % _CLOCK_WRAP - _CLOCK_WRAP // 2) / CLOCK_RATE
        if picture.metadata is not None and picture.metadata.timestamp is not None:
            taken = picture.metadata.timestamp / 1e6
        self._clock = picture.timestamp, taken
        return taken

    def _shot(self, picture: Picture, now: float) -> tuple[float, bool]:
        """Return when a picture was taken, s on the loop's clock.

        The second value is `is_clock_known`.
        """
        clock = None if self._stream is None else self._stream.clock
        shot = now if clock is None else clock.on_picture(picture.timestamp, now)
        self._newest_shot = max(shot, self._newest_shot)
        return self._newest_shot, clock is not None and clock.has_reports

    @staticmethod
    def _tell(callbacks: tuple[Callable[[Any], None], ...], value: object) -> None:
        for callback in callbacks:
            try:
                callback(value)
            except Exception:
                log.exception("a subscriber failed on the video")

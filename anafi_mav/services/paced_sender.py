"""Paced sender of many messages that can wait: parameter lists and bursts of files.

A few are sent at a time, beside the telemetry. A line with a known rate gets half of it filled with these; any other
as many as its peer accepts without queueing, at the pace of each source.
"""

from __future__ import annotations

import asyncio
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import FRAME_BYTES, pack
from anafi_mav.services.service import Host

SHARE = 0.5
"""Of a slow line (MAVLink parameter.md §Read All Parameters asks for 30 to 50 percent)."""

PACE = 800.0
"""Messages of one source in a second where the line is fast, unless its owner says otherwise: as PX4 sends its list."""

PAUSE = 0.002
"""s between two batches where the line is fast: more can leave in that time than is lost to a timer of 1 ms."""

BATCH = 32
"""Messages of all sources in one event-loop iteration: about 1 ms, which nothing else has to wait for longer."""

FIRST = 8.0
"""Messages of a source that leave at once."""

BUSY = 0.02
"""s until a peer that accepts nothing at present is checked again."""


_turns: WeakKeyDictionary[Channel, asyncio.Lock] = WeakKeyDictionary()
"""The turn on each slow line: its share is one for the senders of all services, components and systems."""


@dataclass
class _Source:
    messages: Iterator[dialect.MAVLink_message]
    pace: float
    """Messages in a second where the line is fast."""
    credit: float = FIRST
    """Messages that may leave now."""


class PacedSender:
    """The long answers under way on every channel, one message of each in turn."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._sources: dict[Channel, dict[Hashable, _Source]] = {}
        self._tasks: dict[Channel, asyncio.Task[None]] = {}

    def start(
        self, channel: Channel, key: Hashable, messages: Iterator[dialect.MAVLink_message], pace: float = PACE
    ) -> None:
        """Send these on a channel; they replace what is still to come of the same key.

        `pace`: messages in a second where the line is fast.
        """
        self._sources.setdefault(channel, {})[key] = _Source(messages, pace)
        if channel not in self._tasks:
            self._tasks[channel] = self._host.spawn(self._run(channel))

    def stop(self, channel: Channel, key: Hashable) -> None:
        """Nothing more of this key."""
        self._sources.get(channel, {}).pop(key, None)

    def closed(self, channel: Channel) -> None:
        """Nothing more to this channel."""
        self._sources.pop(channel, None)
        if (task := self._tasks.pop(channel, None)) is not None:
            task.cancel()

    def clear(self) -> None:
        """Send nothing more."""
        for channel in list(self._sources):
            self.closed(channel)

    async def _run(self, channel: Channel) -> None:
        sources, rate = self._sources[channel], channel.bytes_per_second
        try:
            await _until_proved(channel)
            if rate is None:
                await self._run_fast(channel, sources)
            else:
                await self._run_slow(channel, sources, rate)
        finally:
            if self._tasks.get(channel) is asyncio.current_task():
                del self._tasks[channel]
                self._sources.pop(channel, None)

    async def _run_fast(self, channel: Channel, sources: dict[Hashable, _Source]) -> None:
        """Send as many messages as the pace of each source permits, and as the peer accepts."""
        clock = asyncio.get_running_loop().time
        before = clock()
        while sources and channel.is_open:
            count = 0
            while count < BATCH and channel.ready and (message := _take(sources)) is not None:
                self._host.send(message, channel)
                count += 1
            if not sources:
                return
            now = clock()
            wait = PAUSE if channel.ready else BUSY
            await asyncio.sleep(max(wait - (now - before), 0.0) if count else wait)
            now = clock()
            for source in sources.values():
                source.credit = min(source.credit + (now - before) * source.pace, BATCH)
            before = now

    async def _run_slow(self, channel: Channel, sources: dict[Hashable, _Source], rate: float) -> None:
        """Send one message at a time, in turn with the other senders of the line."""
        turn = _turns.setdefault(channel, asyncio.Lock())
        while sources and channel.is_open:
            async with turn:
                message = None
                if channel.ready:
                    for source in sources.values():
                        source.credit = 1.0
                    message = _take(sources)
                if message is None:
                    await asyncio.sleep(BUSY)
                else:
                    self._host.send(message, channel)
                    await asyncio.sleep((len(pack(message).payload) + FRAME_BYTES) / (SHARE * rate))


async def _until_proved(channel: Channel) -> None:
    """Wait for the proof of the peer's address: lists to made-up addresses must cost nothing."""
    if channel.proof is None:
        return
    proved = asyncio.Event()
    channel.when_proved.add(proved.set)
    try:
        await proved.wait()
    finally:
        channel.when_proved.discard(proved.set)


def _take(sources: dict[Hashable, _Source]) -> dialect.MAVLink_message | None:
    """Return the next message of the source whose turn it is.

    None when none has any more, or may send one now.
    """
    for key in list(sources):
        source = sources[key]
        if source.credit < 1.0:
            continue
        del sources[key]
        message = next(source.messages, None)
        if message is not None:
            source.credit -= 1.0
            sources[key] = source
            return message
    return None

"""Paced sender of many messages that can wait: parameter lists and bursts of files.

A few are sent at a time, beside the telemetry. A line with a known rate gets half of it filled with these; any other
as many as it takes without queueing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Hashable, Iterator

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import FRAME_BYTES, Channel
from anafi_mav.mavlink.frames import pack
from anafi_mav.services.service import Host

SHARE = 0.5
"""Of a slow line (MAVLink parameter.md §Read All Parameters asks for 30 to 50 percent)."""

BATCH, PAUSE = 8, 0.01
"""Messages at a time, and s between them, where the line is fast: some 800 a second, as PX4 sends its list."""

BUSY = 0.02
"""s until a peer that accepts nothing at present is checked again."""


class PacedSender:
    """The long answers under way on every channel, one message of each in turn."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._sources: dict[Channel, dict[Hashable, Iterator[dialect.MAVLink_message]]] = {}
        self._tasks: dict[Channel, asyncio.Task[None]] = {}

    def start(self, channel: Channel, key: Hashable, messages: Iterator[dialect.MAVLink_message]) -> None:
        """Send these on a channel; they replace what is still to come of the same key."""
        self._sources.setdefault(channel, {})[key] = messages
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
        """Nothing more to anybody."""
        for channel in list(self._sources):
            self.closed(channel)

    async def _run(self, channel: Channel) -> None:
        sources, rate = self._sources[channel], channel.bytes_per_second
        batch = BATCH if rate is None else 1
        try:
            while sources and channel.is_open:
                count, size = 0, 0
                while count < batch and channel.ready and (message := _take(sources)) is not None:
                    self._host.send(message, channel)
                    count, size = count + 1, size + len(pack(message).payload) + FRAME_BYTES
                if not count:
                    await asyncio.sleep(BUSY)
                else:
                    await asyncio.sleep(PAUSE if rate is None else size / (SHARE * rate))
        finally:
            if self._tasks.get(channel) is asyncio.current_task():
                del self._tasks[channel]
                self._sources.pop(channel, None)


def _take(sources: dict[Hashable, Iterator[dialect.MAVLink_message]]) -> dialect.MAVLink_message | None:
    """The next message of the source whose turn it is; None when none has any more."""
    while sources:
        key = next(iter(sources))
        source = sources.pop(key)
        message = next(source, None)
        if message is not None:
            sources[key] = source
            return message
    return None

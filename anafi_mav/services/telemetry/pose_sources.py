"""Decides for each channel whether its pose is made of events or of pictures. No I/O.

A channel whose client requests a pose message more often than events are reported has pictures as the one source of all
its pose messages, while pictures arrive. Events are a tenth of a second newer than pictures: at the change to pictures
the channel waits until a picture is newer than its last event, so that no time goes back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

ChannelT = TypeVar("ChannelT")

SILENCE = 0.5
"""s without a picture after which events are the source again: with the events' own 0.2 s that is within a second."""


class PoseSources(Generic[ChannelT]):
    """The source of the pose messages of every channel.

    A request that a command makes for a channel after its end is removed with the channel.
    """

    def __init__(self) -> None:
        self.requests: WeakKeyDictionary[ChannelT, set[int]] = WeakKeyDictionary()
        """The messages for which a channel wants pictures."""
        self.is_used = False
        """False: no channel wants pictures, and events are the only source."""
        self._floors: dict[ChannelT, float] = {}
        """Of each channel with pictures: the time (s) after which a picture is newer than its last event."""
        self._shots: dict[ChannelT, float] = {}
        """Of each channel: when the newest picture was taken that was sent there."""
        self._arrived = -math.inf
        self._split: tuple[Sequence[ChannelT], list[ChannelT], list[ChannelT]] | None = None
        """All channels, and those with events and with pictures among them."""

    def is_wanted(self, channels: Sequence[ChannelT]) -> bool:
        """Return True when one of these channels wants pictures."""
        return self.is_used and any(channel in self.requests for channel in channels)

    def request(self, channel: ChannelT, id: int, *, wanted: bool) -> None:
        """Note that a channel wants a message from pictures, or does not any longer."""
        ids = self.requests.get(channel, set())
        if (id in ids) == wanted:
            return
        ids = ids | {id} if wanted else ids - {id}
        if ids:
            self.requests[channel] = ids
        else:
            del self.requests[channel]
        self._changed()

    def close(self, channel: ChannelT) -> None:
        """The channel is closed."""
        self.requests.pop(channel, None)
        self._floors.pop(channel, None)
        self._shots.pop(channel, None)
        self._changed()

    def _changed(self) -> None:
        self._split, self.is_used = None, bool(self.requests)

    def link_down(self) -> None:
        """The drone is disconnected: its pictures ended."""
        self._arrived = -math.inf
        self._split = None

    def on_picture(self, now: float) -> None:
        """Note a picture, before `on_pictures` is read."""
        if not self._runs(now):
            self._split = None
        self._arrived = now

    def on_pictures(self, channels: Sequence[ChannelT], shot: float, event_at: float, now: float) -> list[ChannelT]:
        """Return the channels to which a picture taken at `shot` is sent.

        `event_at` is the time of the newest pose message that was made of events. A list of channels that has changed
        must be another object.
        """
        pictured = self._divide(channels, now)[2]
        for channel in pictured:
            self._floors.setdefault(channel, event_at)
        newer = [channel for channel in pictured if shot > self._floors[channel]]
        for channel in newer:
            self._shots[channel] = shot
        return pictured if len(newer) == len(pictured) else newer

    def newest(self, channel: ChannelT) -> float:
        """Return when the newest picture was taken that was sent to this channel; -inf: none was."""
        return self._shots.get(channel, -math.inf)

    def on_answer(self, channel: ChannelT, event_at: float) -> None:
        """Note that a pose made of events of `event_at` was sent to a channel on request."""
        if channel in self._floors:
            self._floors[channel] = max(self._floors[channel], event_at)

    def on_events(self, channels: Sequence[ChannelT], now: float) -> Sequence[ChannelT]:
        """Return the channels whose pose is made of events."""
        return self._divide(channels, now)[1] if self.is_used else channels

    def has_pictures(self, channel: ChannelT, channels: Sequence[ChannelT], now: float) -> bool:
        """Return True when the channel's pose is made of pictures."""
        return self.is_used and channel in self._divide(channels, now)[2]

    def _runs(self, now: float) -> bool:
        return now - self._arrived <= SILENCE

    def _divide(
        self, channels: Sequence[ChannelT], now: float
    ) -> tuple[Sequence[ChannelT], list[ChannelT], list[ChannelT]]:
        runs = self._runs(now)
        split = self._split
        if split is None or split[0] is not channels or (split[2] and not runs):
            pictured = [channel for channel in channels if channel in self.requests] if runs else []
            split = channels, [channel for channel in channels if channel not in pictured], pictured
            for channel in tuple(self._floors):
                if channel not in pictured:
                    del self._floors[channel]
            self._split = split
        return split

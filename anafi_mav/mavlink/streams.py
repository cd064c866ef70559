"""Intervals of the messages on each channel. No I/O, no clock.

A vehicle's telemetry calls `due` with its own time. The defaults are shortest intervals: a message leaves when its
values are updated, and not more often than this.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink.byte_budget import StreamPace

ChannelT = TypeVar("ChannelT")

_NEVER = float("inf")

MAX_AUDIENCES = 4
"""Lists of channels that are asked about in turn: all, those with events, those with pictures, and one that changes."""

TOGETHER = 0.1
"""s between two moments at which messages become due. Intervals are multiples of it by default: the same update then
makes several messages due, which are made of one pose and leave together."""

MAX_GROUPS = 256
"""Groups of messages that are asked about together, and of which it is remembered when one is due next."""


class _Stream:
    """One message at one interval, on the channels that share it."""

    __slots__ = ("interval", "next", "pace", "users")

    def __init__(self, interval: float | None, pace: StreamPace | None) -> None:
        self.interval = interval
        self.pace = pace
        self.next = _NEVER if interval is None else -_NEVER
        self.users = 1
        """Channels that share it: they have the same interval, no pace, and got the last message together."""

    def leave(self, now: float, phase: float, *, is_repeated: bool) -> None:
        """Count the message, which is due, as sent.

        Times are kept on a grid, not from message to message, so that jitter of the source costs no rate: an
        interval equal to the source's passes all but perhaps one of its messages. `phase`: a moment of the grid that
        all messages share.
        """
        interval = self.interval
        assert interval is not None
        if self.pace is not None:
            interval *= self.pace.slowdown
        late = now - self.next
        if late <= interval:
            self.next += interval
        elif is_repeated:
            self.next = now + interval
        else:
            # After a silence the grid begins again; half an interval early, so that the next update may jitter.
            earliest = now + interval / 2
            self.next = earliest if interval < TOGETHER else earliest + (phase - earliest) % TOGETHER

    def part(self, users: int) -> _Stream:
        """Return the stream of some of its channels, which share it no longer."""
        part = _Stream(self.interval, self.pace)
        part.next, part.users = self.next, users
        self.users -= users
        return part


class _Lane(Generic[ChannelT]):
    """One message on the channels that stream it, and when it is due next on one of them."""

    __slots__ = ("id", "streams", "until")

    def __init__(self, id: int, streams: tuple[tuple[_Stream, Sequence[ChannelT]], ...]) -> None:
        self.id = id
        self.streams = streams
        self.until = -_NEVER


_NO_LANE: _Lane[Any] = _Lane(0, ())
"""Of a message that is streamed on none of the channels: one object for all."""


class _Group(Generic[ChannelT]):
    """Messages that are asked about together; those that are streamed on a channel."""

    __slots__ = ("lanes", "until")

    def __init__(self, lanes: tuple[_Lane[ChannelT], ...]) -> None:
        self.lanes = lanes
        self.until = -_NEVER
        """None of them is due before: this alone answers most questions of a fast drone."""


class _Audience(Generic[ChannelT]):
    """Channels that are asked about together, and what is known of them."""

    __slots__ = ("channels", "groups", "lanes", "parts")

    def __init__(self, channels: Sequence[ChannelT]) -> None:
        self.channels = channels
        self.parts: dict[tuple[ChannelT, ...], Sequence[ChannelT]] = {tuple(channels): channels}
        """One list for the same channels: messages for one list are sent together."""
        self.lanes: dict[int, _Lane[ChannelT]] = {}
        self.groups: dict[tuple[int, ...], _Group[ChannelT]] = {}


class Streams(Generic[ChannelT]):
    """The intervals of one vehicle's messages on every channel.

    A channel is removed when it is closed, or no longer exists.
    """

    def __init__(
        self,
        defaults: Mapping[int, float],
        has: Callable[[ChannelT, int], bool] = lambda channel, id: True,
        pace: Callable[[ChannelT], StreamPace | None] = lambda channel: None,
    ) -> None:
        """Create streams with `defaults`, the intervals in s by message id.

        `has` returns False for a message that a channel does not have by default, `pace` how far it is slowed down.
        """
        self._pace = pace
        self._defaults = defaults
        self._has = has
        self._channels: WeakKeyDictionary[ChannelT, dict[int, _Stream]] = WeakKeyDictionary()
        self._phase: float | None = None
        """A moment (s) of the grid that all messages share; None before the first one."""
        self._audiences: list[_Audience[ChannelT]] = []

    def interval(self, channel: ChannelT, id: int) -> float | None:
        """Seconds between two messages on this channel; None: not streamed."""
        stream = self._channels.get(channel, {}).get(id)
        return self._default(channel, id) if stream is None else stream.interval

    def set(self, channel: ChannelT, id: int, interval: float | None) -> None:
        """Stream at this interval (s, above 0) on this channel, or not at all (None)."""
        if interval is not None and not 0.0 < interval < float("inf"):
            raise LocalProtocolError(f"an interval is a positive number of seconds or None, not {interval}")
        streams = self._channels.setdefault(channel, {})
        known = streams.get(id)
        # A client that says again what it has (QGroundControl does 35 times, for ArduPilot) must not get more by it.
        if known is None or known.interval != interval:
            if known is not None:
                known.users -= 1
            streams[id] = _Stream(interval, self._pace(channel))
            self._forget(id)

    def without_off(self, channels: Sequence[ChannelT], id: int) -> Sequence[ChannelT]:
        """Return those of these channels on which no client has ended this message.

        One that is not streamed by default is not off.
        """
        off = [
            channel
            for channel, streams in self._channels.items()
            if (stream := streams.get(id)) is not None and stream.interval is None
        ]
        return [channel for channel in channels if channel not in off] if off else channels

    def reset(self, channel: ChannelT, id: int) -> None:
        """Stream at the default interval again."""
        stream = self._channels.get(channel, {}).pop(id, None)
        if stream is not None:
            stream.users -= 1
            self._forget(id)

    def due_on(
        self, channels: Sequence[ChannelT], ids: tuple[int, ...], now: float, *, is_repeated: bool = False
    ) -> list[tuple[int, Sequence[ChannelT]]]:
        """Return the messages that may leave now with their channels; they count as sent there.

        A list of channels that has changed must be another object, as `Node.channels` is. Messages for the same
        channels have one list. `is_repeated`: they leave at their times, and not with updates.
        """
        audience = self._audience(channels)
        group = audience.groups.get(ids) or self._new_group(audience, ids)
        if now < group.until:
            return []
        if self._phase is None:
            self._phase = now + TOGETHER / 2
        found: list[tuple[int, Sequence[ChannelT]]] = []
        soonest = _NEVER
        for lane in group.lanes:
            until = lane.until
            if now >= until:
                if len(lane.streams) == 1:  # nearly always: channels with the same interval share one
                    ((stream, due),) = lane.streams
                    if now >= stream.next:
                        stream.leave(now, self._phase, is_repeated=is_repeated)
                        found.append((lane.id, due))
                    until = lane.until = stream.next
                else:
                    due = self._leave(audience, lane, now, is_repeated=is_repeated)
                    if due:
                        found.append((lane.id, due))
                    until = lane.until
            if until < soonest:
                soonest = until
        group.until = soonest
        return found

    def _leave(
        self, audience: _Audience[ChannelT], lane: _Lane[ChannelT], now: float, *, is_repeated: bool
    ) -> Sequence[ChannelT]:
        """Return the channels on which a message of several streams may leave now.

        It counts as sent there.
        """
        assert self._phase is not None
        due: Sequence[ChannelT] = ()
        until, has_first = _NEVER, False
        for stream, channels in lane.streams:
            if now >= stream.next:
                has_first = has_first or stream.next == -_NEVER
                stream.leave(now, self._phase, is_repeated=is_repeated)
                due = [*due, *channels] if due else channels
            if stream.next < until:
                until = stream.next
        lane.until = until
        if has_first:
            self._share(audience, lane)
        return due

    def next_on(self, channels: Sequence[ChannelT], ids: tuple[int, ...]) -> float:
        """Return when the first of these messages may leave next (s); inf when none is streamed.

        About their list see `due_on`.
        """
        audience = self._audience(channels)
        return (audience.groups.get(ids) or self._new_group(audience, ids)).until

    def is_streamed(self, channels: Sequence[ChannelT], id: int) -> bool:
        """Return True if a message is streamed on one of these channels.

        About their list see `due_on`.
        """
        return bool(self._lane(self._audience(channels), id).streams)

    def channel_closed(self, channel: ChannelT) -> None:
        """Forget a channel, and the lists of channels, which keep it alive.

        Its intervals are a table for each component of each drone. What still refers to the channel, a command of its
        client for example, must not keep them.
        """
        for stream in self._channels.pop(channel, {}).values():
            stream.users -= 1
        self._audiences.clear()

    def _forget(self, id: int) -> None:
        """Something about this message has changed."""
        for audience in self._audiences:
            audience.lanes.pop(id, None)
            audience.groups.clear()

    def _audience(self, channels: Sequence[ChannelT]) -> _Audience[ChannelT]:
        for audience in self._audiences:
            if audience.channels is channels:
                return audience
        audience = _Audience(channels)
        self._audiences = [audience, *self._audiences[: MAX_AUDIENCES - 1]]
        return audience

    def _new_group(self, audience: _Audience[ChannelT], ids: tuple[int, ...]) -> _Group[ChannelT]:
        if len(audience.groups) >= MAX_GROUPS:
            audience.groups.clear()
        lanes = [self._lane(audience, id) for id in ids]
        group = audience.groups[ids] = _Group(tuple([lane for lane in lanes if lane.streams]))
        return group

    def _lane(self, audience: _Audience[ChannelT], id: int) -> _Lane[ChannelT]:
        lane = audience.lanes.get(id)
        if lane is None:
            streams = self._streams(audience, id)
            lane = audience.lanes[id] = _Lane(id, streams) if streams else _NO_LANE
        return lane

    def _streams(self, audience: _Audience[ChannelT], id: int) -> tuple[tuple[_Stream, Sequence[ChannelT]], ...]:
        """Return the streams of a message with their channels.

        None is shared with a channel elsewhere.
        """
        found: dict[_Stream, list[ChannelT]] = {}
        for channel in audience.channels:
            stream = self._stream(channel, id)
            if stream is not None and stream.interval is not None:
                found.setdefault(stream, []).append(channel)
        result: list[tuple[_Stream, Sequence[ChannelT]]] = []
        for stream, channels in found.items():
            if len(channels) < stream.users:
                self._forget(id)
                stream = self._adopt(channels, id, stream.part(len(channels)))
            result.append((stream, audience.parts.setdefault(tuple(channels), channels)))
        return tuple(result)

    def _share(self, audience: _Audience[ChannelT], lane: _Lane[ChannelT]) -> None:
        """Let channels with the same interval share a stream.

        The next message comes to all of them when it is due to the first.
        """
        id = lane.id
        shared: dict[float | None, _Stream] = {}
        for stream, channels in lane.streams:
            if stream.pace is None:
                first = shared.setdefault(stream.interval, stream)
                if first is not stream:
                    first.next = min(first.next, stream.next)
                    first.users += len(channels)
                    self._adopt(channels, id, first)
        lane.streams = self._streams(audience, id)
        lane.until = min(stream.next for stream, _ in lane.streams)

    def _adopt(self, channels: Sequence[ChannelT], id: int, stream: _Stream) -> _Stream:
        for channel in channels:
            self._channels[channel][id] = stream
        return stream

    def _stream(self, channel: ChannelT, id: int) -> _Stream | None:
        """Return the stream of a message on a channel; None for one that is off by default."""
        streams = self._channels.get(channel)
        if streams is None:
            streams = self._channels.setdefault(channel, {})
        stream = streams.get(id)
        if stream is None:
            interval = self._default(channel, id)
            if interval is not None:
                stream = streams[id] = _Stream(interval, self._pace(channel))
        return stream

    def _default(self, channel: ChannelT, id: int) -> float | None:
        interval = self._defaults.get(id)
        return interval if interval is not None and self._has(channel, id) else None

"""MAVLink service for messages on request and for the streams of all services.

MAV_CMD_REQUEST_MESSAGE and the older commands that request one message are here, too. Rules: conformance R7, R8, B1,
C3.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Hashable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from msgspec.structs import replace

from anafi_mav.drone.events import Message
from anafi_mav.drone.values import VALUES, Values
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import Packed, pack
from anafi_mav.mavlink.node import Inbound
from anafi_mav.mavlink.streams import Streams
from anafi_mav.services.commands import Command
from anafi_mav.services.flavours import by_flavour, flavour_of
from anafi_mav.services.pose import UNKNOWN_POSE, VehiclePose, reported_pose
from anafi_mav.services.service import Answer, Host, MessageHandler, Query, Request, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.services.telemetry import data_streams
from anafi_mav.services.telemetry.pose_sources import PoseSources
from anafi_mav.services.telemetry.update_tracker import UpdateTracker
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueInterest, ValueSubscriptions

logger = logging.getLogger(__name__)

LEGACY_REQUESTS: Mapping[int, tuple[int, bool]] = {
    dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: (dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION, False),
    dialect.MAV_CMD_REQUEST_PROTOCOL_VERSION: (dialect.MAVLINK_MSG_ID_PROTOCOL_VERSION, False),
    dialect.MAV_CMD_GET_HOME_POSITION: (dialect.MAVLINK_MSG_ID_HOME_POSITION, False),
    dialect.MAV_CMD_REQUEST_CAMERA_INFORMATION: (dialect.MAVLINK_MSG_ID_CAMERA_INFORMATION, False),
    dialect.MAV_CMD_REQUEST_CAMERA_SETTINGS: (dialect.MAVLINK_MSG_ID_CAMERA_SETTINGS, False),
    dialect.MAV_CMD_REQUEST_STORAGE_INFORMATION: (dialect.MAVLINK_MSG_ID_STORAGE_INFORMATION, True),
    dialect.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: (dialect.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS, False),
    dialect.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE: (dialect.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED, True),
    dialect.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION: (dialect.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION, True),
    dialect.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS: (dialect.MAVLINK_MSG_ID_VIDEO_STREAM_STATUS, True),
}
"""Commands of before REQUEST_MESSAGE, the message that each requests, and True where param1 is its id or index.

A component has those of its own messages. MAVSDK falls back on them, MAVProxy knows no other.
"""

LOG_EVERY = 5.0
"""s before it is logged again that a message cannot be made."""

SHARED = 16
"""Tables of streams that are remembered: all drones share those of the autopilot and of the camera."""

REPEATED = 0.1
"""s between two repetitions of a message without updates; an update leaves at once, as often as `fastest` allows."""

VIDEO_BELOW = 0.1
"""s. A pose that is requested more often than ten times a second is one that events cannot give."""

SMALL_LINE = 5000.0
"""bytes/s of a budget below which messages are left out that repeat another one. All streams of a drone take 2000."""

LONGEST = 2**31 - 1
"""us. An interval is reported as an INT32; a longer one is reported as the largest INT32."""


class MessageService(Service):
    """Sends messages by their intervals and on request.

    Updates that are read together are gathered (see `update_tracker`).
    """

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self.intervals: Streams[Channel] = Streams({})
        """Of the messages on each channel."""
        self._table: Mapping[int, MessageStream] = {}
        self._requests: Mapping[int, Request] = {}
        self._tracker = UpdateTracker({})
        self.index = _index_of(())
        """What follows from the streams: shared with the components that have the same ones."""
        self._repeat_at = -math.inf
        """When messages may be repeated next (s)."""
        self._linked_at = 0.0
        self._stamped: dict[int, float] = {}
        """The time (s, monotonic) in the last message of each kind: it never goes back."""
        self._moment: tuple[float, Times] = (math.nan, Times(0, 0, 0))
        """The moment (s, monotonic) of the last message, and its times: the next one is often of the same moment."""
        self._gathered: list[Packed] = []
        """Messages that are made and leave together."""
        self._gathered_for: Sequence[Channel] = ()
        """The channels that they are for."""
        self._failed: dict[int, float] = {}
        """When it was last logged that a message cannot be made."""
        self._sources: PoseSources[Channel] = PoseSources()
        self._picture: VehiclePose | None = None
        """The newest picture's."""
        self._stamped_pictures = -math.inf
        """The time (s, monotonic) of that picture."""
        self._without: set[int] = set()
        """Messages whose fields the pictures lack: events are their source."""
        self._held: dict[int, float] = {}
        """Of messages that were among these: the time (s) after which a picture is newer than the last event."""

    def take_tables(self, streams: Mapping[int, MessageStream], requests: Mapping[int, Request]) -> None:
        """Adopt the streams and the request handlers of all services of the component.

        The queries follow from them.
        """
        self._table, self._requests = streams, requests
        self.index = _index_of(tuple(StreamRow.of(id, stream) for id, stream in streams.items()))
        self.intervals = Streams(self.index.defaults, has=self._is_streamed, pace=lambda channel: channel.pace)
        self._tracker = UpdateTracker(self.index.affected)

    def queries(self) -> Mapping[int, Query]:
        return {
            dialect.MAV_CMD_REQUEST_MESSAGE: lambda inbound, command: self._request(
                inbound, command.params[0], command
            ),
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            dialect.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            **dict.fromkeys((old for old, (id, _) in LEGACY_REQUESTS.items() if self.has(id)), self._legacy),
        }

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: self._data_stream}

    def requests(self) -> Mapping[int, Request]:
        return {
            dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL: lambda inbound, command: self._interval(inbound, command.params[1])
        }

    def has(self, id: float) -> bool:
        """True for a message that this component streams or sends on request."""
        return id in self._table or id in self._requests

    def link_up(self) -> None:
        self._linked_at = self.host.clock.monotonic()
        self._tracker.reset(self._linked_at)

    def link_down(self) -> None:
        self._tracker.reset(self.host.clock.monotonic())
        self._sources.link_down()
        self._picture = None
        self._without.clear()
        self._held.clear()

    def channel_closed(self, channel: Channel) -> None:
        self._sources.close(channel)
        self.intervals.channel_closed(channel)

    def subscriptions(self) -> Subscriptions:
        return dict.fromkeys(self.index.events, self._on_update)

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_values: ValueInterest(self.index.values)}

    def _on_values(self, values: Values, now: float) -> None:
        """Send the messages that they update, soon; without one that is due they are counted."""
        tracker, kinds = self._tracker, values.layout.kinds
        if not (tracker.has_updates or self._sources.is_used):
            bundle = tracker.bundle(kinds)
            if now < self.intervals.next_on(self.host.channels, bundle.ids):
                bundle.add(now)
                return
        if tracker.mark_all(kinds, now):
            self.host.drone.after_read(self._send_updated)

    def _on_update(self, message: Message, now: float) -> None:
        if self._tracker.mark(type(message), now):
            self.host.drone.after_read(self._send_updated)

    def mark_updated(self, id: int, at: float) -> None:
        """Send this message soon, with what else is updated at the same time."""
        if self._tracker.mark(id, at):
            self.host.drone.after_read(self._send_updated)

    @property
    def needs_pictures(self) -> bool:
        """True while a client wants pose from pictures."""
        return self._sources.is_wanted(self.host.channels)

    @property
    def needs_video(self) -> bool:
        """True while a client has a stream whose fields are in the video only."""
        channels = self.host.channels
        return any(self.intervals.is_streamed(channels, id) for id in self.index.of_video)

    def show_picture(self, pose: VehiclePose, shot: float, now: float) -> None:
        """Send the pose that a picture reports to the channels that want it.

        `shot`: when the picture was taken (s, monotonic).
        """
        if self._picture is not None and self._stamped_pictures >= shot:
            return  # what is known of the drone's clock has changed: the picture seems no newer than the last
        self._picture, self._stamped_pictures = pose, shot
        self._sources.on_picture(now)
        newest_event = max((self._stamped.get(id, -math.inf) for id in self.index.poses), default=-math.inf)
        channels = self._sources.on_pictures(self.host.channels, shot, newest_event, now)
        if channels:
            times = self.host.times(shot, pose)
            for id, due in self.intervals.due_on(channels, self.index.poses, shot):
                self._show(id, due, times, shot)
            self._flush()

    def _show(self, id: int, to: Sequence[Channel], times: Times, shot: float) -> None:
        """Send a message made of a picture.

        Where the picture lacks its fields, events remain its source.
        """
        if id not in self._without:
            if shot > self._held.get(id, -math.inf) and not self._leave(id, to, times):
                self._without.add(id)
        elif self._table[id].build(self.host.vehicle, times) is not None:
            self._without.discard(id)
            self._held[id] = self._stamped.get(id, -math.inf)

    def tick(self, now: float) -> float:
        self._tracker.pass_time(now)
        if now < self._repeat_at:
            return self._repeat_at
        self._repeat_at = now + REPEATED
        channels = self.host.channels
        for id, due in self.intervals.due_on(channels, self.index.repeated, now, is_repeated=True):
            self._leave(id, due, self._times(id))
        self._flush()
        return max(self._repeat_at, self.intervals.next_on(channels, self.index.repeated))

    def state_changed(self) -> None:
        """They leave at once, except to clients that have switched them off."""
        for id in self.index.on_change:
            to = [channel for channel in self.host.channels if channel.can_stream(id)]
            self._leave(id, self.intervals.without_off(to, id), self._times(id))
        self._flush()

    # Streams.

    def _send_updated(self) -> None:
        ids, at = self._tracker.take()
        everyone = self.host.channels
        if not self._sources.is_used:
            due = self.intervals.due_on(everyone, ids, at)
        else:
            channels = self._sources.on_events(everyone, at)
            others = tuple(id for id in ids if not self._is_pictured(id))
            poses = tuple(id for id in ids if self._is_pictured(id))
            due = [*self.intervals.due_on(everyone, others, at), *self.intervals.due_on(channels, poses, at)]
        pose: VehiclePose | None = None
        for id, to in due:
            if self._table[id].from_pictures:  # one moment for all of them
                pose = pose or reported_pose(self.host.vehicle)
                self._leave(id, to, self._stamp(id, at, pose))
            else:
                self._leave(id, to, self._stamp(id, at))
        self._flush()

    def _times(self, id: int) -> Times:
        """When the newest of the fields of a message was true.

        A state that has not changed is true now.
        """
        stream = self._table[id]
        at = self.host.clock.monotonic() if stream.is_repeated else self._tracker.at(id) or self._linked_at
        return self._stamp(id, at, reported_pose(self.host.vehicle) if stream.from_pictures else UNKNOWN_POSE)

    def _times_for(self, channel: Channel, id: int) -> Times:
        """As `_times`, for an answer on one channel: of the picture where pictures are the source."""
        if not self._is_pictured(id):
            return self._times(id)
        now, newest = self.host.clock.monotonic(), self._sources.newest(channel)
        has_pictures = self._sources.has_pictures(channel, self.host.channels, now)
        if has_pictures and self._picture is not None and newest == self._stamped_pictures:
            return self.host.times(newest, self._picture)
        at = max(self._tracker.at(id) or self._linked_at, newest)
        self._sources.on_answer(channel, at)
        return self._stamp(id, at, reported_pose(self.host.vehicle))

    def _is_pictured(self, id: int) -> bool:
        """Return True when this message is made of pictures where a channel has them."""
        return self._table[id].from_pictures and id not in self._without

    def _stamp(self, id: int, at: float, pose: VehiclePose = UNKNOWN_POSE) -> Times:
        """The time for a message of this kind; an event that was handled late does not put it back."""
        last = self._stamped.get(id)
        if last is not None and last > at:
            at = last
        else:
            self._stamped[id] = at
        moment, times = self._moment
        if at != moment or pose is not times.pose:
            times = self.host.times(at, pose)
            self._moment = at, times
        return times

    def _leave(self, id: int, to: Sequence[Channel], times: Times) -> bool:
        """Send a message with the next `_flush`; return False when a value that it needs is unknown."""
        stream = self._table[id]
        try:
            if stream.flavoured:
                for flavour, channels in by_flavour(to):
                    self._gather(stream.build(self.host.vehicle, times.for_flavour(flavour)), channels)
            else:
                return self._gather(stream.build(self.host.vehicle, times), to)
        except Exception as error:
            # An unforeseen value of the drone's. The other messages, and the heartbeat, are sent without it.
            now = self.host.clock.monotonic()
            if now - self._failed.get(id, -math.inf) >= LOG_EVERY:
                self._failed[id] = now
                logger.error("%s: message %d cannot be made: %r", self.host.drone.name, id, error)
        return True

    def _gather(self, message: dialect.MAVLink_message | None, to: Sequence[Channel]) -> bool:
        """Have a message sent with the next `_flush`; return False if there is none."""
        if message is None:
            return False
        packed = pack(message)
        if to is not self._gathered_for:
            self._flush()
            self._gathered_for = to
        self._gathered.append(packed)
        return True

    def _flush(self) -> None:
        """Send the gathered messages."""
        if self._gathered:
            messages, self._gathered = self._gathered, []
            self.host.send_streams(messages, self._gathered_for)

    def _is_streamed(self, channel: Channel, id: int) -> bool:
        """Return True for a message that a channel gets by default."""
        stream = self._table[id]
        if id in flavour_of(channel).unstreamed or not (channel.can_stream(id) and stream.is_offered(channel.options)):
            return False
        return not stream.spared or channel.bytes_per_second is None or channel.bytes_per_second >= SMALL_LINE

    def _exists(self, channel: Channel, stream: MessageStream) -> bool:
        """Return True for a message that exists for clients of this channel and for this drone."""
        return stream.is_offered(channel.options) and stream.is_supported(self.host.vehicle)

    def _data_stream(self, inbound: Inbound) -> None:
        """REQUEST_DATA_STREAM, from clients of flavours with `data_streams`."""
        if not flavour_of(inbound.channel).data_streams:
            return
        request = inbound.message
        rate = request.req_message_rate if request.start_stop else 0
        for id in data_streams.members(request.req_stream_id):
            if id in self._table and inbound.channel.can_stream(id):
                self._ask(inbound.channel, id, 1.0 / rate if rate else None)

    def _ask(self, channel: Channel, id: int, interval: float | None, *, wants_pictures: bool = False) -> None:
        stream = self._table[id]
        if interval is not None and stream.is_repeated:
            interval = max(interval, stream.fastest)
        self.intervals.set(channel, id, interval)
        if stream.from_pictures:
            self._sources.request(channel, id, wanted=wants_pictures and self.host.has_picture_pose)

    # Requests: answered at once, every time.

    def _request(self, inbound: Inbound, id: float, command: Command) -> int:
        answer = self._answer(inbound, id, command)
        if isinstance(answer, int):
            return answer
        for message in [answer] if isinstance(answer, dialect.MAVLink_message) else answer:
            self.host.send(message, inbound.channel)
        return dialect.MAV_RESULT_ACCEPTED

    def _answer(self, inbound: Inbound, id: float, command: Command) -> Answer:
        """The message that a client asks for, or the MAV_RESULT that says why not."""
        if not math.isfinite(id):
            return dialect.MAV_RESULT_UNSUPPORTED
        if (request := self._requests.get(int(id))) is not None and id == int(id):
            return request(inbound, command)
        stream = self._table.get(int(id)) if id == int(id) else None
        if stream is None or not self._exists(inbound.channel, stream):
            return dialect.MAV_RESULT_UNSUPPORTED
        if not inbound.channel.can_stream(int(id)):
            return dialect.MAV_RESULT_DENIED
        times = self._times_for(inbound.channel, int(id)).for_flavour(flavour_of(inbound.channel))
        message = stream.build(self.host.vehicle, times)
        return dialect.MAV_RESULT_TEMPORARILY_REJECTED if message is None else message

    def _legacy(self, inbound: Inbound, command: Command) -> int:
        """Answer a command of `LEGACY_REQUESTS` as REQUEST_MESSAGE, with the index in its param2."""
        id, has_index = LEGACY_REQUESTS[command.id]
        index = command.params[0] if has_index else math.nan
        return self._request(inbound, id, replace(command, params=(float(id), index, math.nan, math.nan)))

    def _set_interval(self, inbound: Inbound, command: Command) -> int:
        id, interval = command.params[0], command.params[1]
        stream = self._table.get(int(id)) if math.isfinite(id) and id == int(id) else None
        if stream is None or not self._exists(inbound.channel, stream):
            return dialect.MAV_RESULT_UNSUPPORTED
        if not inbound.channel.can_stream(int(id)):  # what is accepted would have no effect
            return dialect.MAV_RESULT_DENIED
        if math.isnan(interval) or interval == 0:
            self.intervals.reset(inbound.channel, int(id))
            self._sources.request(inbound.channel, int(id), wanted=False)
        elif interval == -1:
            self._ask(inbound.channel, int(id), None)
        elif interval > 0 and math.isfinite(interval):
            interval = min(interval, LONGEST) / 1e6
            wants_pictures = interval < VIDEO_BELOW or self._table[int(id)].needs_video
            self._ask(inbound.channel, int(id), interval, wants_pictures=wants_pictures)
        else:
            return dialect.MAV_RESULT_DENIED
        return dialect.MAV_RESULT_ACCEPTED

    def _get_interval(self, inbound: Inbound, command: Command) -> int:
        answer = self._interval(inbound, command.params[0])
        if isinstance(answer, int):
            return answer
        self.host.send(answer, inbound.channel)
        return dialect.MAV_RESULT_ACCEPTED

    def _interval(self, inbound: Inbound, id: float) -> dialect.MAVLink_message | int:
        """Return MESSAGE_INTERVAL with the real interval on this channel.

        It is neither shorter than requested nor shorter than the interval of the drone's updates. 0 for a message
        that is never sent, as common.xml demands it.
        """
        if not 0 <= id <= 0xFFFF or id != int(id):
            return dialect.MAV_RESULT_DENIED
        microseconds = 0
        if int(id) in self._table and self._exists(inbound.channel, self._table[int(id)]):
            asked = self.intervals.interval(inbound.channel, int(id))
            source = self._source(inbound.channel, int(id))
            if asked is not None and inbound.channel.pace is not None:
                asked *= inbound.channel.pace.slowdown
            microseconds = -1 if asked is None else min(round(max(asked, source) * 1e6), LONGEST)
        return dialect.MAVLink_message_interval_message(int(id), microseconds)

    def _source(self, channel: Channel, id: int) -> float:
        """Return the mean time (s) between two updates of this message; 0 when unknown."""
        now = self.host.clock.monotonic()
        if self._is_pictured(id) and self._sources.has_pictures(channel, self.host.channels, now):
            rate = self.host.drone.video.state.rate_hz
            return 1.0 / rate if rate else 0.0
        interval = self._tracker.interval(id, now)
        if self._table[id].is_repeated:
            return REPEATED if interval is None else 1.0 / (1.0 / REPEATED + 1.0 / interval)
        return interval or 0.0


class StreamRow(NamedTuple):
    """The part of a message's stream that does not depend on the drone."""

    id: int
    updates: tuple[type[Message], ...]
    every: float | None
    on_change: bool
    is_repeated: bool
    from_pictures: bool
    needs_video: bool

    @classmethod
    def of(cls, id: int, stream: MessageStream) -> StreamRow:
        """Return the row of a message."""
        flags = stream.on_change, stream.is_repeated, stream.from_pictures, stream.needs_video
        return cls(id, stream.updates, stream.every, *flags)


class StreamIndex(NamedTuple):
    """Everything that follows from the rows of a component's streams."""

    events: tuple[type[Message], ...]
    """Events that update some message, without those of values."""
    values: tuple[type[Message], ...]
    """Events of values that update some message."""
    affected: Mapping[Hashable, tuple[int, ...]]
    """The messages that each source affects. Sources are these events and the messages themselves."""
    defaults: Mapping[int, float]
    """Intervals (s) of the messages that are streamed by default."""
    on_change: tuple[int, ...]
    repeated: tuple[int, ...]
    poses: tuple[int, ...]
    """The messages that can be made of pictures."""
    of_video: tuple[int, ...]
    """The messages whose fields are in the video only."""


@lru_cache(maxsize=SHARED)
def _index_of(rows: tuple[StreamRow, ...]) -> StreamIndex:
    """Return the index of these streams; drones with the same ones share it."""
    affected: dict[Hashable, tuple[int, ...]] = {}
    for row in rows:
        for kind in dict.fromkeys(row.updates):
            affected[kind] = (*affected.get(kind, ()), row.id)
    updates = tuple(kind for kind in affected if isinstance(kind, type))
    affected.update((row.id, (row.id,)) for row in rows)
    return StreamIndex(
        events=tuple(kind for kind in updates if kind not in VALUES),
        values=tuple(kind for kind in updates if kind in VALUES),
        affected=affected,
        defaults={row.id: row.every for row in rows if row.every is not None},
        on_change=tuple(row.id for row in rows if row.on_change),
        repeated=tuple(row.id for row in rows if row.is_repeated),
        poses=tuple(row.id for row in rows if row.from_pictures),
        of_video=tuple(row.id for row in rows if row.needs_video and not row.from_pictures),
    )

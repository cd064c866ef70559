"""Which message goes to which channel how often. No I/O, no clock: a vehicle's telemetry asks `due` with its own time.

The defaults are intervals at most: a message leaves when there is news, and no more often than this.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink import dialect as mav

ChannelT = TypeVar("ChannelT")

DEFAULT_INTERVALS: Mapping[int, float] = {
    mav.MAVLINK_MSG_ID_ATTITUDE: 0.1,
    mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 0.1,
    mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.2,
    mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 0.2,
    mav.MAVLINK_MSG_ID_ALTITUDE: 0.2,
    mav.MAVLINK_MSG_ID_VFR_HUD: 0.2,
    mav.MAVLINK_MSG_ID_GPS_RAW_INT: 0.5,
    mav.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mav.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 0.5,
    mav.MAVLINK_MSG_ID_HOME_POSITION: 2.0,
    mav.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mav.MAVLINK_MSG_ID_FENCE_STATUS: 1.0,
    mav.MAVLINK_MSG_ID_RC_CHANNELS: 1.0,
    mav.MAVLINK_MSG_ID_RADIO_STATUS: 1.0,
    mav.MAVLINK_MSG_ID_DISTANCE_SENSOR: 0.2,
    mav.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mav.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 1.0,
    mav.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 1.0,
    mav.MAVLINK_MSG_ID_CURRENT_MODE: 2.0,
    mav.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: 0.8,
    mav.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: 3.3,
    mav.MAVLINK_MSG_ID_CURRENT_EVENT_SEQUENCE: 1.0,
    # Only while setpoints or moves are flown.
    mav.MAVLINK_MSG_ID_ATTITUDE_TARGET: 0.5,
    mav.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 0.5,
    mav.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 0.5,
}
"""Seconds by message id: what ground stations need to look alive, and a 57600 baud radio can carry."""

ON_REQUEST = frozenset(
    {
        mav.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mav.MAVLINK_MSG_ID_FLIGHT_INFORMATION,
        mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mav.MAVLINK_MSG_ID_BATTERY_INFO,
        mav.MAVLINK_MSG_ID_ONBOARD_COMPUTER_STATUS,
        mav.MAVLINK_MSG_ID_HIGH_LATENCY2,
        mav.MAVLINK_MSG_ID_RANGEFINDER,
        mav.MAVLINK_MSG_ID_ODOMETRY,
        *(id for id in mav.mavlink_map if 61400 <= id <= 61499),
    }
)
"""Messages that are streamed only to a client that asks for them. The last ones are our own dialect's."""

TELEMETRY = frozenset(DEFAULT_INTERVALS) | ON_REQUEST
"""Message ids that the next one of their kind makes worthless."""


class _Stream:
    __slots__ = ("interval", "next")

    def __init__(self, interval: float | None) -> None:
        self.interval = interval
        self.next = -float("inf")


class Pace:
    """How often a source has news: the mean of about its last eight pauses."""

    __slots__ = ("_breaks", "_last", "interval")

    SHARE = 0.125
    """Weight of the newest pause."""

    BREAK = 4.0
    """A pause so many times longer than the mean is a break and says nothing about the pace."""

    NEW_PACE = 3
    """So many breaks in a row are no breaks: the source has become slower."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._breaks = 0
        self.interval: float | None = None
        """s; None before there are two."""

    def note(self, now: float) -> None:
        """There is news."""
        last, self._last = self._last, now
        if last is None or now <= last:
            return
        pause, mean = now - last, self.interval
        if mean is None:
            self.interval = pause
        elif pause <= self.BREAK * mean:
            self.interval = mean + self.SHARE * (pause - mean)
            self._breaks = 0
        else:
            self._breaks += 1
            if self._breaks == self.NEW_PACE:
                self.interval, self._breaks = pause, 0


class Streams(Generic[ChannelT]):
    """The intervals of one vehicle's messages on every channel. A channel that is gone is forgotten by itself."""

    def __init__(self, defaults: Mapping[int, float] = DEFAULT_INTERVALS) -> None:
        self._defaults = dict(defaults)
        self._channels: WeakKeyDictionary[ChannelT, dict[int, _Stream]] = WeakKeyDictionary()
        self._quiet: dict[int, tuple[Sequence[ChannelT], float]] = {}
        """Message id -> the channels last asked about, and until when none of them is due: most questions of a fast
        drone are answered by this alone."""

    def interval(self, channel: ChannelT, id: int) -> float | None:
        """Seconds between two messages on this channel; None: not streamed."""
        stream = self._channels.get(channel, {}).get(id)
        return self._defaults.get(id) if stream is None else stream.interval

    def set(self, channel: ChannelT, id: int, interval: float | None) -> None:
        """Stream at this interval (s, above 0) on this channel, or not at all (None)."""
        if interval is not None and not 0.0 < interval < float("inf"):
            raise LocalProtocolError(f"an interval is a positive number of seconds or None, not {interval}")
        streams = self._channels.setdefault(channel, {})
        known = streams.get(id)
        # A client that says again what it has (QGroundControl does 35 times, for ArduPilot) must not get more by it.
        if known is None or known.interval != interval:
            streams[id] = _Stream(interval)
            self._quiet.pop(id, None)

    def reset(self, channel: ChannelT, id: int) -> None:
        """Stream at the default interval again."""
        self._channels.get(channel, {}).pop(id, None)
        self._quiet.pop(id, None)

    def due_on(self, channels: Sequence[ChannelT], id: int, now: float) -> list[ChannelT]:
        """Those channels on which a message of this kind may leave now; it counts as sent there.

        A list of channels that has changed must be another object, as `Node.channels` is.
        """
        asked, until = self._quiet.get(id, (None, 0.0))
        if asked is channels and now < until:
            return []
        due = [channel for channel in channels if self.due(channel, id, now)]
        self._quiet[id] = (channels, min((self._next(channel, id) for channel in channels), default=now))
        return due

    def _next(self, channel: ChannelT, id: int) -> float:
        stream = self._channels[channel][id]
        return float("inf") if stream.interval is None else stream.next

    def due(self, channel: ChannelT, id: int, now: float) -> bool:
        """Whether a message of this kind may leave now; if so, it counts as sent.

        Times are kept on a grid, not from message to message, so that jitter of the source costs no rate: an
        interval equal to the source's passes all but perhaps one of its messages.
        """
        streams = self._channels.get(channel)
        if streams is None:
            streams = self._channels.setdefault(channel, {})
        stream = streams.get(id)
        if stream is None:
            stream = streams[id] = _Stream(self._defaults.get(id))
        interval = stream.interval
        if interval is None or now < stream.next:
            return False
        late = now - stream.next
        # After a silence the grid begins anew; half an interval early, so that the next message may jitter.
        stream.next = stream.next + interval if late <= interval else now + interval / 2
        return True

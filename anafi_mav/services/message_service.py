"""Messages on request and at intervals: MAV_CMD_REQUEST_MESSAGE and its older cousins, the streams of all services.

Rules: conformance R7, R8, B1, C3.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence

from anafi_mav.drone.events import Message
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.mavlink.streams import Streams
from anafi_mav.services.commands import Command
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.service import Answer, Host, Query, Request, Service
from anafi_mav.services.stream import Stream

logger = logging.getLogger(__name__)

LEGACY_REQUESTS = {
    dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    dialect.MAV_CMD_REQUEST_PROTOCOL_VERSION: dialect.MAVLINK_MSG_ID_PROTOCOL_VERSION,
    dialect.MAV_CMD_GET_HOME_POSITION: dialect.MAVLINK_MSG_ID_HOME_POSITION,
}
"""Commands of before REQUEST_MESSAGE, and the message each asks for. MAVSDK falls back on them, MAVProxy knows no
other."""

LOG_EVERY = 5.0
"""s before it is logged again that a message cannot be made."""


class MessageService(Service):
    """What leaves by itself, and what leaves because somebody asked."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._intervals: Streams[Channel] = Streams()
        self._table: Mapping[int, Stream] = {}
        self._requests: Mapping[int, Request] = {}
        self._by_news: dict[type[Message], list[int]] = {}
        self._periodic: list[int] = []
        self._on_change: list[int] = []
        self._failed: dict[int, float] = {}
        """When it was last logged that a message cannot be made."""

    def take_tables(self, streams: Mapping[int, Stream], requests: Mapping[int, Request]) -> None:
        """What all services of the system send by themselves, and what they can be asked for."""
        self._table, self._requests = streams, requests
        for id, stream in streams.items():
            for event in stream.news:
                self._by_news.setdefault(event, []).append(id)
            if not stream.news:
                self._periodic.append(id)
            if stream.on_change:
                self._on_change.append(id)

    def queries(self) -> Mapping[int, Query]:
        return {
            dialect.MAV_CMD_REQUEST_MESSAGE: lambda inbound, command: self._request(
                inbound, command.params[0], command
            ),
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            dialect.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            **{old: self._legacy(id) for old, id in LEGACY_REQUESTS.items()},
        }

    def on_event(self, message: Message, now: float) -> None:
        for id in self._by_news.get(type(message), ()):
            self._stream(id, now)

    def tick(self, now: float) -> None:
        for id in self._periodic:
            self._stream(id, now)

    def state_changed(self) -> None:
        """Mode, armed state, health or something else that clients wait for has changed: they are told at once."""
        for id in self._on_change:
            self._leave(id, self.host.channels)

    # Streams.

    def _stream(self, id: int, now: float) -> None:
        """Send a stream message to each channel on which it is due."""
        if due := self._intervals.due_on(self.host.channels, id, now):
            self._leave(id, due)

    def _leave(self, id: int, to: Sequence[Channel]) -> None:
        stream, times = self._table[id], self.host.times()
        try:
            if stream.flavoured:
                vehicle = self.host.vehicle
                self.host.send_by_flavour(lambda flavour: stream.build(vehicle, times.for_flavour(flavour)), to)
            elif (message := stream.build(self.host.vehicle, times)) is not None:
                self.host.send(message, to)
        except Exception as error:
            # A value of the drone's that nobody foresaw. The other messages, and the heartbeat, go on without it.
            now = self.host.clock.monotonic()
            if now - self._failed.get(id, -math.inf) >= LOG_EVERY:
                self._failed[id] = now
                logger.error("message %d of system %d cannot be made: %r", id, self.host.sysid, error)

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
        if stream is None:
            return dialect.MAV_RESULT_UNSUPPORTED
        times = self.host.times().for_flavour(flavour_of(inbound.channel))
        message = stream.build(self.host.vehicle, times)
        return dialect.MAV_RESULT_TEMPORARILY_REJECTED if message is None else message

    def _legacy(self, id: int) -> Query:
        return lambda inbound, command: self._request(inbound, id, command)

    def _set_interval(self, inbound: Inbound, command: Command) -> int:
        id, interval = command.params[0], command.params[1]
        if id not in self._table:
            return dialect.MAV_RESULT_UNSUPPORTED
        if math.isinf(interval) or interval < -1:
            return dialect.MAV_RESULT_DENIED
        if math.isnan(interval) or interval == 0:
            self._intervals.reset(inbound.channel, int(id))
        else:
            # An interval is told as an INT32 of microseconds: a longer one is as long as that can say.
            self._intervals.set(inbound.channel, int(id), None if interval < 0 else min(interval, 2**31 - 1) / 1e6)
        return dialect.MAV_RESULT_ACCEPTED

    def _get_interval(self, inbound: Inbound, command: Command) -> int:
        id = command.params[0]
        if not 0 <= id <= 0xFFFF:
            return dialect.MAV_RESULT_DENIED
        microseconds = 0
        if id in self._table:
            interval = self._intervals.interval(inbound.channel, int(id))
            microseconds = -1 if interval is None else round(interval * 1e6)
        self.host.send(dialect.MAVLink_message_interval_message(int(id), microseconds), inbound.channel)
        return dialect.MAV_RESULT_ACCEPTED

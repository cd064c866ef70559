"""Operator control: MAV_CMD_REQUEST_OPERATOR_CONTROL and CONTROL_STATUS, after mavlink#2313.

For clients of endpoints with `operator_control`; for the others both do not exist, because stations of before 2026 take
CONTROL_STATUS for a damaged frame. `vehicle.operator_control` decides. The role that a message needs is in
`operator_need`, that of a flight task in `operator_refusal_of`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import Access
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Command
from anafi_mav.services.service import LOOK_EVERY, Host, MessageHandler, Query, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.operator_control import (
    LONGEST,
    MAX_SHOWN,
    SHORTEST,
    SILENT,
    USUAL,
    ControlRequest,
    RequestOutcome,
    WaitingRequest,
)
from anafi_mav.vehicle.vehicle import Vehicle

MAX_PLACES = 64
"""Places of stations that are remembered, the newest ones: an address is easily made up."""

RELEASE, REQUEST = 0.0, 1.0
"""param1."""

RESULTS = {
    RequestOutcome.GRANTED: dialect.MAV_RESULT_ACCEPTED,
    RequestOutcome.KEPT: dialect.MAV_RESULT_ACCEPTED,
    RequestOutcome.RELEASED: dialect.MAV_RESULT_ACCEPTED,
    RequestOutcome.ASKED: dialect.MAV_RESULT_FAILED,
    RequestOutcome.NOT_OPERATOR: dialect.MAV_RESULT_NOT_IN_CONTROL,
}
"""FAILED is what mavlink#2313 wants while the operator is asked, and what keeps QGroundControl's countdown running."""


class OperatorControlService(Service):
    """Manages the operator of one system."""

    is_watch = True

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._control = host.vehicle.operators
        self._control.own = host.sysid
        self._places: dict[tuple[Channel, int], tuple[int, float]] = {}
        """(channel, system) -> component and time of its newest message; the newest is at the end."""
        self._shown: tuple[object, ...] = ()
        """Content of the last CONTROL_STATUS that announced a change."""

    def queries(self) -> Mapping[int, Query]:
        return {dialect.MAV_CMD_REQUEST_OPERATOR_CONTROL: self._receive}

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_COMMAND_ACK: self._acknowledged}

    def streams(self) -> Mapping[int, MessageStream]:
        return {
            dialect.MAVLINK_MSG_ID_CONTROL_STATUS: MessageStream(
                self._status, every=1.0, is_offered=lambda options: options.operator_control
            )
        }

    def link_up(self) -> None:
        self._control.restart(self.host.clock.monotonic())

    def channel_closed(self, channel: Channel) -> None:
        self._places = {place: known for place, known in self._places.items() if place[0] is not channel}

    # Stations.

    def received(self, inbound: Inbound) -> None:
        self._hear(inbound)

    def heartbeat(self, inbound: Inbound) -> None:
        self._hear(inbound)

    def _hear(self, inbound: Inbound) -> None:
        """Note where a station is. An observer has no role, whatever its system id is."""
        channel, system = inbound.channel, inbound.sysid
        if channel.access is Access.OBSERVE or not (self._control.operator or channel.options.operator_control):
            return
        place = (channel, system)
        self._places.pop(place, None)
        self._places[place] = (inbound.compid, inbound.now)
        if len(self._places) > MAX_PLACES:
            del self._places[next(iter(self._places))]
        self._control.hear(system, inbound.now, is_secondary=system in channel.options.secondary_ids)

    def _places_of(self, system: int) -> list[tuple[Channel, int]]:
        """Return the channels on which a system is heard, with its component there."""
        now = self.host.clock.monotonic()
        return [
            (channel, compid)
            for (channel, known), (compid, at) in self._places.items()
            if known == system and now - at < SILENT
        ]

    def _text_to(self, system: int, severity: Severity, text: OperatorText) -> None:
        for channel, _ in self._places_of(system):
            self.host.text(severity, text, channel)

    # Requests.

    def _receive(self, inbound: Inbound, command: Command) -> int:
        """Run MAV_CMD_REQUEST_OPERATOR_CONTROL.

        param1 action, param2 takeover allowed, param3 timeout (s), param4 lowest id that the sender asks for (its own,
        or unset), param5 highest one; 0 or unset: its own alone.
        """
        if not inbound.channel.options.operator_control:
            return dialect.MAV_RESULT_UNSUPPORTED
        self._tick_control(inbound.now)
        before, action = self._control.operator, command.params[0]
        if action == RELEASE:
            outcome = self._control.release(inbound.sysid)
            if before and outcome is RequestOutcome.RELEASED:
                self._changed(texts.OPERATOR_RELEASED.fill(system=before))
        elif action == REQUEST:
            asked = _request(inbound.sysid, command)
            if isinstance(asked, OperatorText):
                return self._deny(inbound, asked)
            outcome = self._control.request(asked, inbound.now)
            if outcome is RequestOutcome.GRANTED:
                replaced = texts.OPERATOR_REPLACED.fill(system=inbound.sysid, before=before)
                self._changed(replaced if before else texts.OPERATOR_IS.fill(system=inbound.sysid))
            elif outcome is RequestOutcome.ASKED:
                self._tick_control(inbound.now)
            for system in self._control.take_offered() if outcome is RequestOutcome.KEPT else ():
                self._text_to(system, Severity.NOTICE, texts.CONTROL_OFFERED.fill(system=inbound.sysid))
        else:
            return self._deny(inbound, texts.PARAM1_BINARY)
        if outcome in (RequestOutcome.ASKED, RequestOutcome.NOT_OPERATOR):
            self._refuse(inbound, texts.OTHER_OPERATOR.fill(system=before))
        self._show()
        return RESULTS[outcome]

    def _deny(self, inbound: Inbound, reason: OperatorText) -> int:
        self._refuse(inbound, reason)
        return dialect.MAV_RESULT_DENIED

    def _refuse(self, inbound: Inbound, reason: OperatorText) -> None:
        text = texts.REFUSED.fill(what=texts.CONTROL_REQUEST, reason=reason)
        self.host.text(Severity.WARNING, text, inbound.channel)

    def _notify(self, waiting: WaitingRequest) -> None:
        """Send the operator the command of a request.

        It may make way by a request or a release of its own.
        """
        asked, operator = waiting.request, self._control.operator
        for channel, compid in self._places_of(operator):
            self.host.send(
                dialect.MAVLink_command_long_message(
                    operator,
                    compid,
                    dialect.MAV_CMD_REQUEST_OPERATOR_CONTROL,
                    waiting.sent - 1,
                    REQUEST,
                    float(asked.allows_takeover),
                    asked.timeout,
                    float(asked.system),
                    0.0,
                    0.0,
                    0.0,
                ),
                channel,
            )
        if waiting.sent == 1:
            text = texts.CONTROL_REQUESTED.fill(system=asked.system, seconds=asked.timeout)
            self._text_to(operator, Severity.WARNING, text)

    def _acknowledged(self, inbound: Inbound) -> None:
        """Take COMMAND_ACK: whatever its result is, the operator knows of the request."""
        if inbound.message.command == dialect.MAV_CMD_REQUEST_OPERATOR_CONTROL:
            self._control.acknowledge(inbound.sysid)

    # Time.

    def host_stalled(self, seconds: float) -> None:
        self._control.skip(seconds)

    def tick(self, now: float) -> float:
        self._tick_control(now)
        self._show()
        return NEVER if self._control.is_free else now + LOOK_EVERY

    def _tick_control(self, now: float) -> None:
        operator = self._control.operator
        passed = self._control.tick(now)
        for waiting in passed.notify:
            self._notify(waiting)
        for system in passed.expired:
            self._text_to(system, Severity.NOTICE, texts.CONTROL_NOT_OFFERED.fill(system=operator))
        if passed.lost:
            self._changed(texts.OPERATOR_SILENT.fill(system=passed.lost))

    # Status.

    def _changed(self, text: OperatorText) -> None:
        """Announce another operator to all; what others fly by sticks and setpoints ends."""
        self.host.text(Severity.WARNING, text)
        self.host.vehicle.end_inputs_of_others()

    def _show(self) -> None:
        """Send CONTROL_STATUS at once when it has changed; the stream repeats it."""
        shown = self._control.state, self._control.operator, self._secondaries()
        if shown == self._shown:
            return
        self._shown = shown
        id = dialect.MAVLINK_MSG_ID_CONTROL_STATUS
        offered = [one for one in self.host.channels if one.options.operator_control and one.can_stream(id)]
        if offered:
            self.host.send(self._status(self.host.vehicle, self.host.times()), offered)

    def _secondaries(self) -> tuple[int, ...]:
        return tuple(self._control.shown_secondaries(self.host.clock.monotonic()))

    def _status(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        flags = dialect.GCS_CONTROL_STATUS_FLAGS_SYSTEM_MANAGER
        if self._control.grants_requests:
            flags |= dialect.GCS_CONTROL_STATUS_FLAGS_TAKEOVER_ALLOWED
        return dialect.MAVLink_control_status_message(flags, self._control.operator, _filled(self._secondaries()))


def _filled(systems: Sequence[int]) -> list[int]:
    return [*systems, *([0] * (MAX_SHOWN - len(systems)))]


def _request(sender: int, command: Command) -> ControlRequest | OperatorText:
    """Return the request in a command, or the reason for which it is none."""
    _, takeover, timeout, lowest = command.params
    if not (math.isnan(takeover) or takeover in (0.0, 1.0)):
        return texts.PARAM2_BINARY
    first = sender if math.isnan(lowest) or lowest == 0.0 else lowest
    last = first if math.isnan(command.x) or command.x == 0.0 else command.x
    if not (1 <= first <= sender <= last <= 255 and first == int(first) and last == int(last)):
        return texts.SENDER_NOT_IN_RANGE
    return ControlRequest(
        sender,
        allows_takeover=takeover == 1.0,
        timeout=min(max(timeout, SHORTEST), LONGEST) if timeout > 0.0 else USUAL,
        secondaries=range(int(first), int(last) + 1),
    )

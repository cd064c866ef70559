"""The EVENT interface of one vehicle, for clients that read events.json.

It reports health and arming checks, and events of the vehicle. Texts for people are still sent as STATUSTEXT; an
event is not repeated there, except for the checks, which are requested.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone import events as parrot
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import Access
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Command
from anafi_mav.services.component_metadata import to_json
from anafi_mav.services.event import event_table as table
from anafi_mav.services.event.event_table import Event, events_file
from anafi_mav.services.event.events import EventLog, HealthReport, report
from anafi_mav.services.files import Query as FileQuery
from anafi_mav.services.files import ServedFile
from anafi_mav.services.flavours import Flavour
from anafi_mav.services.service import Host, MessageHandler, Query, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions
from anafi_mav.vehicle.vehicle import Landed, Vehicle

RESET_FOR = 3.0
"""s after the start for which CURRENT_EVENT_SEQUENCE reports a restarted sequence.

That makes three messages, of which one may be lost.
"""

LOOK_EVERY = 0.9
"""s, at least, between looks at causes without an update from the drone: the services tick once a second.

For example a changed fence, or a place on the wrong side of it.
"""

OBSERVED_EVERY = 1.0
"""s, at least, between two reports that observers request: all clients receive them."""

PAUSE = 0.3
"""s between two reports, so that values that change together are reported together."""

_RELEVANT = (
    parrot.AlertStateChanged,
    parrot.BatteryAlertChanged,
    parrot.FlyingStateChanged,
    parrot.GPSFixStateChanged,
    parrot.MagnetoCalibrationRequiredState,
    parrot.MagnetoCalibrationStartedChanged,
    parrot.MotorErrorStateChanged,
    parrot.SensorsStatesListChanged,
    parrot.TakeoffChecklist,
)
"""Messages of the drone that may change the report."""


class EventService(Service):
    """Service for EVENT, its sequence and requests, and MAV_CMD_RUN_PREARM_CHECKS.

    Messages: EVENT, CURRENT_EVENT_SEQUENCE, REQUEST_EVENT, RESPONSE_EVENT_ERROR.
    """

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._log = EventLog()
        self._report: HealthReport | None = None
        self._stale = False
        self._next_report = 0.0
        self._observed_at = -math.inf
        """When an observer last got a report."""
        self._armed: bool | None = None
        self._landed = Landed.UNKNOWN
        """The last known one of this connection."""
        self._reset_until: float | None = None

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_REQUEST_EVENT: self._again}

    def queries(self) -> Mapping[int, Query]:
        return {dialect.MAV_CMD_RUN_PREARM_CHECKS: self._run_checks}

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_CURRENT_EVENT_SEQUENCE: MessageStream(self._current, every=1.0)}

    def files(self) -> Mapping[str, ServedFile]:
        return {"/events.json": ServedFile(self._described, metadata=dialect.COMP_METADATA_TYPE_EVENTS)}

    def link_up(self) -> None:
        """Continue the sequence after a loss of the link: a client that stayed has missed nothing."""
        if self._reset_until is None:
            self._reset_until = self.host.clock.monotonic() + RESET_FOR
        self._armed, self._landed = self.host.vehicle.armed, self.host.vehicle.landed
        self._report, self._stale, self._next_report = None, True, 0.0

    def subscriptions(self) -> Subscriptions:
        return dict.fromkeys(_RELEVANT, self._on_relevant)

    def _on_relevant(self, message: object, now: float) -> None:
        self._stale = True

    def state_changed(self) -> None:
        """Send the landing event before the heartbeat that reports the vehicle disarmed.

        Stations take that heartbeat as the end of a flight.
        """
        self._stale = True
        if self._armed and self.host.vehicle.landed is Landed.ON_GROUND:
            self._report_landed()

    def tick(self, now: float) -> float:
        self._tell_changes()
        if now >= self._next_report + (0.0 if self._stale else LOOK_EVERY - PAUSE):
            self._stale, self._next_report = False, now + PAUSE
            found = report(self.host.vehicle)
            if found != self._report:
                self._tell(found)
        return self._next_report if self._stale else NEVER

    def _tell(self, found: HealthReport) -> None:
        self._report = found
        for event, arguments in found.events:
            self._send(event, arguments)

    def _tell_changes(self) -> None:
        armed = self.host.vehicle.armed
        if armed != self._armed:
            self._armed = armed
            self._send(table.ARMED if armed else table.DISARMED)
        self._report_landed()

    def _report_landed(self) -> None:
        landed, before = self.host.vehicle.landed, self._landed
        if landed in (before, Landed.UNKNOWN):
            return
        self._landed = landed
        if landed is Landed.IN_AIR and before is Landed.TAKEOFF:
            self._send(table.TAKEOFF)
        elif landed is Landed.ON_GROUND and before is not Landed.UNKNOWN:  # else no flight is known to end
            self._send(table.LANDED)

    def _send(self, event: Event, arguments: bytes | None = None) -> None:
        self.host.send(self._log.add(event, event.pack() if arguments is None else arguments, self._boot_ms()))

    def _boot_ms(self) -> int:
        return self.host.times().boot_ms

    def _current(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        fresh = self._reset_until is not None and self.host.clock.monotonic() < self._reset_until
        flags = dialect.MAV_EVENT_CURRENT_SEQUENCE_FLAGS_RESET if fresh else 0
        return dialect.MAVLink_current_event_sequence_message(self._log.sequence, flags)

    def _again(self, inbound: Inbound) -> None:
        message = inbound.message
        for answer in self._log.again(message.first_sequence, message.last_sequence, inbound.sysid, inbound.compid):
            self.host.send(answer, inbound.channel)

    def _run_checks(self, inbound: Inbound, command: Command) -> int:
        """MAV_CMD_RUN_PREARM_CHECKS: send the report again, and a text for each reason not to arm.

        An armed vehicle has no checks to run and answers so (common.xml), but a station that connects in flight has no
        other way to the report, which is sent when it changes.
        """
        vehicle = self.host.vehicle
        is_armed, observes = vehicle.armed, inbound.channel.access is Access.OBSERVE
        if not is_armed:
            to = inbound.channel if observes else None
            for problem in vehicle.prearm_problems():
                self.host.text(Severity.WARNING, texts.PREARM.fill(reason=problem), to)
        if not observes or inbound.now - self._observed_at >= OBSERVED_EVERY:
            if observes:
                self._observed_at = inbound.now
            self._tell(report(vehicle))
        return dialect.MAV_RESULT_TEMPORARILY_REJECTED if is_armed else dialect.MAV_RESULT_ACCEPTED

    def _described(self, flavour: Flavour, query: FileQuery) -> bytes:
        return to_json(events_file(flavour))

"""What a vehicle reports, as one table of streams: message → builder and the drone's events that make it new.

A stream message leaves when one of its fields is new, never to fill a rate: an ANAFI's attitude comes five times a
second, and so do the messages built from it, at most. State messages (battery, system status, home) repeat at their
interval because a client that just connected needs them; a time in one that is repeated is that of its sending, for
what has not changed is still true, and an old time looks like a restart (MAVProxy: "Time has wrapped").
"""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav import texts
from anafi_mav.drone import events
from anafi_mav.drone.events import Message
from anafi_mav.services.service import Host, Service
from anafi_mav.services.stream import Stream
from anafi_mav.services.telemetry import telemetry_anafi, telemetry_flight, telemetry_link, telemetry_status
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.vehicle import POSITION_OLD

CHANGES: frozenset[type[Message]] = frozenset(
    {
        events.HomeChanged,
        events.TakeoffLocation,
        events.ReturnStateChanged,
        events.MavlinkFilePlayingStateChanged,
        events.BatteryAlertChanged,
        events.GPSFixStateChanged,
        events.ForcedLandingAutoTrigger,
        events.SensorsStatesListChanged,
        events.MagnetoCalibrationRequiredState,
        events.MotorErrorStateChanged,
    }
)
"""Events after which the state messages marked `on_change` leave at once."""


class TelemetryService(Service):
    """The streams that are made of the drone's states alone."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._position_is_old = False

    def link_down(self) -> None:
        self._position_is_old = False

    def tick(self, now: float) -> None:
        """Say when positions stop, which leaves the station with the last one, and when they continue."""
        is_old = self.host.vehicle.position_is_old
        if is_old != self._position_is_old:
            self._position_is_old = is_old
            if is_old:
                self.host.text(Severity.WARNING, texts.POSITION_LOST.fill(seconds=POSITION_OLD))
            else:
                self.host.text(Severity.NOTICE, texts.POSITION_FOUND)

    def streams(self) -> Mapping[int, Stream]:
        return {
            **telemetry_flight.STREAMS,
            **telemetry_status.STREAMS,
            **telemetry_link.STREAMS,
            **telemetry_anafi.STREAMS,
        }

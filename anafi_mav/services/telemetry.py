"""What a vehicle reports, as one table of streams: message → builder and the drone's events that make it new.

A stream message leaves when one of its fields is new, never to fill a rate: an ANAFI's attitude comes five times a
second, and so do the messages built from it, at most. State messages (battery, system status, home) repeat at their
interval because a client that just connected needs them; a time in one that is repeated is that of its sending, for
what has not changed is still true, and an old time looks like a restart (MAVProxy: "Time has wrapped").
"""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.drone import events
from anafi_mav.drone.events import Message
from anafi_mav.services import telemetry_anafi, telemetry_flight, telemetry_link, telemetry_status
from anafi_mav.services.service import Service
from anafi_mav.services.stream import Stream

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

    def streams(self) -> Mapping[int, Stream]:
        return {
            **telemetry_flight.STREAMS,
            **telemetry_status.STREAMS,
            **telemetry_link.STREAMS,
            **telemetry_anafi.STREAMS,
        }

"""The table of telemetry streams: message → builder and the drone's events that update it.

A stream message is sent when one of its fields is updated, never to fill a rate: an ANAFI's attitude arrives five
times a second, and so do the messages built from it, at most. State messages (battery, system status, home) repeat at
their interval because a client that just connected needs them; the time in a repeated one is that of its sending, for
an unchanged state is still true, and an old time looks like a restart (MAVProxy: "Time has wrapped").
"""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav import texts
from anafi_mav.drone import events
from anafi_mav.drone.events import Message
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host, MessageHandler, Service
from anafi_mav.services.stream import MessageStream
from anafi_mav.services.telemetry import telemetry_anafi, telemetry_flight, telemetry_link, telemetry_status
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions
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

    is_watch = True

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._is_lost = False
        """The clients have the text that the position is unknown, and not yet that it is known again."""
        self._lost_from = 0.0
        """Before this time (s) no text is due: the host stalled, and could receive no location."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: self._keep_origin}

    def _keep_origin(self, inbound: Inbound) -> None:
        """SET_GPS_GLOBAL_ORIGIN: refuse it with a text, and answer with the origin in force.

        The local frame counts from the take-off point. MAVLink has GPS_GLOBAL_ORIGIN as the answer whether the origin
        changes or not (common.xml), by which a client sees that it did not.
        """
        host = self.host
        host.text(Severity.WARNING, texts.ORIGIN_KEPT, inbound.channel)
        if (origin := telemetry_flight.gps_global_origin(host.vehicle, host.times())) is not None:
            host.send(origin, inbound.channel)

    def link_down(self) -> None:
        self._is_lost = False

    def host_stalled(self, seconds: float) -> None:
        self._lost_from = self.host.clock.monotonic() + POSITION_OLD

    def subscriptions(self) -> Subscriptions:
        return {events.GpsLocationChanged: self._on_location}

    def _on_location(self, message: Message, now: float) -> None:
        if self._is_lost:
            self.host.look_soon()

    def tick(self, now: float) -> float:
        """Send a text when positions stop, and when they continue.

        Without positions a station keeps showing the last one.
        """
        vehicle = self.host.vehicle
        is_old = vehicle.position_is_old
        if is_old or self._is_lost:
            # No event reports that the fix of GPS_RAW_INT is gone; repeated for clients that connect later.
            self.host.mark_updated(dialect.MAVLINK_MSG_ID_GPS_RAW_INT, now)
        if is_old and not self._is_lost and now < self._lost_from:
            return self._lost_from
        if is_old and not self._is_lost:
            self._is_lost = True
            self.host.text(Severity.WARNING, texts.POSITION_LOST.fill(seconds=POSITION_OLD))
        elif self._is_lost and vehicle.place is not None:  # else the drone has lost its fix, too
            self._is_lost = False
            self.host.text(Severity.NOTICE, texts.POSITION_FOUND)
        return vehicle.position_expires_at(now)

    def streams(self) -> Mapping[int, MessageStream]:
        return {
            **telemetry_flight.STREAMS,
            **telemetry_status.STREAMS,
            **telemetry_link.STREAMS,
            **telemetry_anafi.STREAMS,
        }

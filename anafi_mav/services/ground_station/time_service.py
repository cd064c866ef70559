"""MAVLink service for clocks and round trips: PING, TIMESYNC, SYSTEM_TIME.

MAVLink ping.md, timesync.md; conformance C11.
"""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import MessageHandler, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.vehicle import Vehicle


class TimeService(Service):
    """Answers PING and TIMESYNC.

    One clock is in all our messages: the gateway's, from its start on.
    """

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_PING: self._ping, dialect.MAVLINK_MSG_ID_TIMESYNC: self._timesync}

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_SYSTEM_TIME: MessageStream(self._system_time, every=1.0)}

    def _system_time(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        """Return SYSTEM_TIME: the clock of the host beside our own.

        The drone's clock was set by the host's when it connected.
        """
        return dialect.MAVLink_system_time_message(round(self.host.clock.time() * 1e6), times.boot_ms)

    def _ping(self, inbound: Inbound) -> None:
        ping = inbound.message
        if ping.target_system == 0 and ping.target_component == 0:  # otherwise it is an answer
            self.host.send(
                dialect.MAVLink_ping_message(ping.time_usec, ping.seq, inbound.sysid, inbound.compid), inbound.channel
            )

    def _timesync(self, inbound: Inbound) -> None:
        if inbound.message.tc1 == 0:
            self.host.send(
                dialect.MAVLink_timesync_message(
                    self.host.times().boot_ns, inbound.message.ts1, inbound.sysid, inbound.compid
                ),
                inbound.channel,
            )

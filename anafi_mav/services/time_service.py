"""Clocks and round trips: PING and TIMESYNC (MAVLink ping.md, timesync.md; conformance C11)."""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import MessageHandler, Service


class TimeService(Service):
    """Answers whoever measures."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_PING: self._ping, dialect.MAVLINK_MSG_ID_TIMESYNC: self._timesync}

    def _ping(self, inbound: Inbound) -> None:
        ping = inbound.message
        if ping.target_system == 0 and ping.target_component == 0:  # otherwise it is somebody's answer
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

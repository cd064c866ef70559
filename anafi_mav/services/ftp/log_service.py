"""LOG_REQUEST_*: an ANAFI's flight logs are not served over MAVLink.

The client gets an empty list at once. MAVSDK waits five seconds for a first LOG_ENTRY and takes `num_logs` 0 for
"none" (log_files_impl.cpp); Mission Planner and QGroundControl likewise. Erasing nothing needs no answer, nor does
the end of a download.
"""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import MessageHandler, Service

LOG_BYTES = 90
"""Length of the data field of LOG_DATA."""


class LogService(Service):
    """An empty list of logs."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_LOG_REQUEST_LIST: self._list,
            dialect.MAVLINK_MSG_ID_LOG_REQUEST_DATA: self._data,
        }

    def _list(self, inbound: Inbound) -> None:
        self.host.send(dialect.MAVLink_log_entry_message(0, 0, 0, 0, 0), inbound.channel)

    def _data(self, inbound: Inbound) -> None:
        """Answer with LOG_DATA without bytes: a missing log is at its end at any offset."""
        request = inbound.message
        self.host.send(dialect.MAVLink_log_data_message(request.id, request.ofs, 0, [0] * LOG_BYTES), inbound.channel)

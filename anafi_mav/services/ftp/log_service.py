"""LOG_REQUEST_* and LOG_ERASE: the drone's flight logs.

`/@MAV_LOG` of MAVLink FTP shows the same files.

A client's ids refer to the list that it was sent last: a flight or another client may change the list meanwhile. A list
that cannot be had is not answered, and a text to its client says why: LOG_ENTRY has no error, and an empty list means
that there are no logs. MAVSDK requests a log in pieces of 46 kB (log_files_impl.cpp) and QGroundControl too
(LogProtocolTransport.cc), Mission Planner as a whole; all of them request again what they miss. LOG_ERASE and the end
of a download need no answer.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from anafi_mav import texts
from anafi_mav.drone.payload.flight_logs import FlightLog
from anafi_mav.errors import AnafiMavError, NotSupported
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.files import Folder
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.ftp.log_folder import DIRECTORY, LogFolder, erase_objection
from anafi_mav.services.paced_sender import PacedSender
from anafi_mav.services.service import Host, MessageHandler, Service, channel_of
from anafi_mav.vehicle.base.severity import Severity

LOG_BYTES = 90
"""Length of the data field of LOG_DATA."""

READ_BYTES = 512 * LOG_BYTES
"""Bytes of a log that are read and sent at a time: what MAVSDK and QGroundControl request."""

MAX_LOGS = 0xFFFF
"""Logs that LOG_ENTRY can count."""

MAX_SIZE = 0xFFFFFFFF
"""Bytes of a log that LOG_ENTRY and LOG_DATA can name."""

DATA_PACE = 6000.0
"""LOG_DATA in a second where the line is fast: 540 kB/s."""


@dataclass(frozen=True)
class _Work:
    task: asyncio.Task[None]
    is_list: bool


class LogService(Service):
    """Lists, sends and erases the drone's flight logs."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._sender = PacedSender(host)
        self._lists: dict[Hashable, tuple[FlightLog, ...]] = {}
        """By client, the list that it was sent last."""
        self._work: dict[Hashable, _Work] = {}
        """By client, the list or the bytes that it waits for."""
        self._erasing = asyncio.Lock()
        """A list that is requested behind LOG_ERASE, as QGroundControl does, shows what is left."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_LOG_REQUEST_LIST: self._request_list,
            dialect.MAVLINK_MSG_ID_LOG_REQUEST_DATA: self._request_data,
            dialect.MAVLINK_MSG_ID_LOG_REQUEST_END: self._request_end,
            dialect.MAVLINK_MSG_ID_LOG_ERASE: self._request_erase,
        }

    def folders(self) -> Mapping[str, Folder]:
        return {DIRECTORY: LogFolder(self.host)}

    def link_down(self) -> None:
        self._sender.clear()
        self._work.clear()  # the host has cancelled it
        self._lists.clear()

    def channel_closed(self, channel: Channel) -> None:
        self._sender.closed(channel)
        for client in [client for client in (*self._work, *self._lists) if channel_of(client) is channel]:
            self._end(client)
            self._lists.pop(client, None)

    # Requests.

    def _request_list(self, inbound: Inbound) -> None:
        work = self._work.get(inbound.client)
        if work is not None and work.is_list:  # a repetition: the drone's answer takes longer than the client waits
            return
        if inbound.client in self._lists and inbound.message.start > self._first_id(inbound):
            self._send_list(inbound)  # what the client has missed of it
        else:
            self._begin(inbound.client, self._list(inbound), is_list=True)

    def _request_data(self, inbound: Inbound) -> None:
        self._begin(inbound.client, self._send_data(inbound))

    def _request_end(self, inbound: Inbound) -> None:
        self._end(inbound.client)

    def _request_erase(self, inbound: Inbound) -> None:
        self.host.spawn(self._erase(inbound))

    def _begin(self, client: Hashable, work: Coroutine[Any, Any, None], *, is_list: bool = False) -> None:
        """Run what a client has requested; it replaces what it has requested before."""
        self._end(client)
        task = self.host.spawn(work)
        self._work[client] = _Work(task, is_list)
        task.add_done_callback(partial(self._ended, client))

    def _ended(self, client: Hashable, task: asyncio.Task[None]) -> None:
        if client in self._work and self._work[client].task is task:
            del self._work[client]

    def _end(self, client: Hashable) -> None:
        work = self._work.pop(client, None)
        if work is not None:
            work.task.cancel()
        channel = channel_of(client)
        if channel is not None:
            self._sender.stop(channel, client)

    # Work.

    async def _list(self, inbound: Inbound) -> None:
        try:
            async with self._erasing:
                self._lists[inbound.client] = await self._logs()
        except AnafiMavError as error:
            self._explain(inbound, error)
        else:
            self._send_list(inbound)

    async def _logs(self) -> tuple[FlightLog, ...]:
        """Return the newest logs that LOG_ENTRY can name, oldest first."""
        try:
            logs = await self.host.drone.flight_logs.list()
        except NotSupported:
            return ()
        return tuple(log for log in logs if log.size <= MAX_SIZE)[-MAX_LOGS:]

    def _send_list(self, inbound: Inbound) -> None:
        logs, first = self._lists[inbound.client], self._first_id(inbound)
        request = inbound.message
        if not logs:
            self.host.send(dialect.MAVLink_log_entry_message(0, 0, 0, 0, 0), inbound.channel)
            return
        last = first + len(logs) - 1
        wanted = range(max(request.start, first), min(request.end, last) + 1)
        entries = (
            dialect.MAVLink_log_entry_message(id, len(logs), last, log.time & MAX_SIZE, log.size)
            for id, log in ((id, logs[id - first]) for id in wanted)
        )
        self._sender.start(inbound.channel, inbound.client, entries)

    async def _send_data(self, inbound: Inbound) -> None:
        request, client = inbound.message, inbound.client
        try:
            if client not in self._lists:  # the gateway, or the link, has been restarted since
                self._lists[client] = await self._logs()
            logs, index = self._lists[client], request.id - self._first_id(inbound)
            log = logs[index] if 0 <= index < len(logs) else None
            end = 0 if log is None else min(request.ofs + request.count, log.size)
            if log is None or request.ofs >= end:  # a missing log is at its end at any offset
                self.host.send(_data(request.id, request.ofs, b""), inbound.channel)
                return
            for offset in range(request.ofs, end, READ_BYTES):
                data = await self.host.drone.flight_logs.read(log, offset, min(READ_BYTES, end - offset))
                sent = asyncio.Event()
                self._sender.start(inbound.channel, client, _parts(request.id, offset, data, sent), DATA_PACE)
                await sent.wait()
        except AnafiMavError as error:
            self._explain(inbound, error)

    async def _erase(self, inbound: Inbound) -> None:
        try:
            async with self._erasing:
                logs = await self._logs()
                for log in (None, *logs):
                    objection = erase_objection(self.host) or self.host.change_objection(inbound)
                    if objection is not None:
                        self._text(inbound, texts.REFUSED.fill(what=texts.ERASE_LOGS, reason=objection))
                        return
                    if log is not None:
                        await self.host.drone.flight_logs.delete(log)
        except AnafiMavError as error:
            self._explain(inbound, error)
        else:
            if logs:  # else it is a copy of the request, and would seem to have failed
                self._text(inbound, texts.LOGS_ERASED.fill(count=len(logs)), Severity.INFO)

    def _first_id(self, inbound: Inbound) -> int:
        return flavour_of(inbound.channel).first_log_id

    def _explain(self, inbound: Inbound, error: AnafiMavError) -> None:
        self._text(inbound, texts.LOGS_UNAVAILABLE.fill(error=texts.from_below(error)))

    def _text(self, inbound: Inbound, text: texts.OperatorText, severity: Severity = Severity.WARNING) -> None:
        self.host.text(severity, text, inbound.channel)


def _parts(id: int, offset: int, data: bytes, sent: asyncio.Event) -> Iterator[dialect.MAVLink_message]:
    """Yield the messages with these bytes of a log; set `sent` when the last one has left."""
    for start in range(0, len(data), LOG_BYTES):
        yield _data(id, offset + start, data[start : start + LOG_BYTES])
    sent.set()


def _data(id: int, offset: int, part: bytes) -> dialect.MAVLink_message:
    filled: Sequence[int] = part.ljust(LOG_BYTES, b"\0")
    return dialect.MAVLink_log_data_message(id, offset, len(part), filled)

"""The drone's flight logs as the directory `@MAV_LOG` of MAVLink FTP.

QGroundControl looks for logs there before it uses LOG_REQUEST_LIST (FtpTransport.cc); it shows files that end in .bin.
A file is read from the drone while a client reads it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import aclosing, contextmanager
from dataclasses import dataclass

from anafi_mav import texts
from anafi_mav.drone import Drone
from anafi_mav.drone.payload.flight_logs import FlightLog
from anafi_mav.drone.rest import NotFound
from anafi_mav.errors import AnafiMavError, NotSupported
from anafi_mav.services.checksum import crc32
from anafi_mav.services.files import MAX_SIZE, Entry, FileError, FileRefused, FileSource
from anafi_mav.services.service import Host

DIRECTORY = "/@MAV_LOG"
"""Directory with the logs of a vehicle, wherever it has them (MAVLink ftp.md)."""


class LogFolder:
    """All flight logs of one drone."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._summing = asyncio.Lock()
        """A checksum reads a whole file: one at a time."""

    async def list(self, path: str) -> Sequence[Entry]:
        if path:
            raise FileRefused(FileError.FILE_NOT_FOUND)
        return [Entry(log.name, log.size, log.time) for log in await self._logs()]

    async def open(self, path: str) -> FileSource:
        log = await self._find(path)
        if log.size > MAX_SIZE:
            raise FileRefused(FileError.FAIL, texts.LOG_TOO_LARGE)
        return _OpenLog(self._host.drone, log)

    async def checksum(self, path: str) -> int:
        """Return the CRC of a log, for which all of it is read."""
        log = await self._find(path)
        crc = 0
        with _refusing():
            async with self._summing, aclosing(self._host.drone.flight_logs.read_from(log)) as pieces:
                async for piece in pieces:
                    crc = crc32(piece, crc)
        return crc

    async def remove(self, path: str, may_change: Callable[[], bool]) -> None:
        """Delete a log on the drone. Refused while the drone is not on the ground.

        Also to a client that may not change anything any longer: the list may take seconds.
        """
        log = await self._find(path)
        if (objection := erase_objection(self._host)) is not None:
            raise FileRefused(FileError.FAIL, texts.REFUSED.fill(what=texts.ERASE_LOGS, reason=objection))
        if not may_change():
            raise FileRefused(FileError.FILE_PROTECTED)
        with _refusing():
            await self._host.drone.flight_logs.delete(log)

    async def _logs(self) -> Sequence[FlightLog]:
        with _refusing():
            try:
                return await self._host.drone.flight_logs.list()
            except NotSupported:
                return ()

    async def _find(self, name: str) -> FlightLog:
        for log in await self._logs():
            if log.name == name:
                return log
        raise FileRefused(FileError.FILE_NOT_FOUND)


@dataclass(frozen=True)
class _OpenLog:
    drone: Drone
    log: FlightLog

    @property
    def size(self) -> int:
        return self.log.size

    async def read(self, offset: int, size: int) -> bytes:
        with _refusing():
            return await self.drone.flight_logs.read(self.log, offset, size)


def erase_objection(host: Host) -> texts.OperatorText | None:
    """Return the reason why logs must not be erased now; None when they may be."""
    return None if host.vehicle.on_ground else texts.NOT_ON_GROUND


@contextmanager
def _refusing() -> Iterator[None]:
    """Turn the errors of the drone's web server into those of FTP."""
    try:
        yield
    except FileRefused:
        raise
    except NotFound as error:
        raise FileRefused(FileError.FILE_NOT_FOUND) from error
    except AnafiMavError as error:
        raise FileRefused(FileError.FAIL, texts.LOGS_UNAVAILABLE.fill(error=texts.from_below(error))) from error

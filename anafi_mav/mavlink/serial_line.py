"""Serial lines: telemetry radios, USB, pseudo-terminals.

A device that is away is opened when it comes.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
from functools import partial

import serial
import serial_asyncio_fast

from anafi_mav.clock import Clock
from anafi_mav.mavlink.base import EndpointUrl, Reopening, Sink, StreamPeer, reason

BITS_PER_BYTE = 10
"""8 data bits, start and stop."""

WRITE_AHEAD_S = 0.1
"""s of the line's own speed that may wait outside the channel. The kernel holds some 4 KB more."""

MIN_WRITE_AHEAD = 280
"""Bytes: one frame, on however slow a line."""

RADIO_BAUD, RADIO_BYTES = 57_600, 2000
"""A line at this rate or slower is taken for a SiK radio, whose factory setting it is, and which carries so many bytes
in a second: the air is shared by both directions and error correction."""

_AWAY = {errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO}
"""Errors of opening an absent device. Any other error is a mistake or a port in use."""


class _Port(serial.Serial):  # type: ignore[misc]  # pyserial has no annotations
    """A port whose reads and writes never wait.

    pyserial's own `write` tries again, without end, while the line's buffer is full; in an event loop that stops
    everything. Its `read` uses select, which knows only the first 1024 files of a process.
    """

    def read(self, size: int = 1) -> bytes:
        try:
            data = os.read(self.fd, size)
        except (BlockingIOError, InterruptedError):
            return b""
        except OSError as error:
            raise serial.SerialException(error.errno, str(error)) from error
        if not data:
            raise serial.SerialException("the device is gone")
        return data

    def write(self, data: bytes) -> int:
        """Number of bytes taken.

        Raises BlockingIOError if the line takes none, as the transport expects.
        """
        try:
            return os.write(self.fd, data)
        except (BlockingIOError, InterruptedError):
            raise
        except OSError:
            return len(data)  # the device is gone, which reading notices and reports


class _Transport(serial_asyncio_fast.SerialTransport):
    """A transport that stops waiting for the line once everything is written.

    The library's own, up to 0.16, goes on: after a line has once been full, its callback fails in each iteration of the
    event loop.
    """

    def _write_ready(self) -> None:
        super()._write_ready()
        if not self.get_write_buffer_size():
            self.flush()


class SerialLine(Reopening):
    """One device at one speed."""

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._port: serial.Serial | None = None

    async def open(self) -> None:
        try:
            self._peer = await self._connect()
        except OSError as error:
            if error.errno not in _AWAY:
                raise
            self._note(reason(error))
        await super().open()

    async def close(self) -> None:
        if self._port is not None and self._port.is_open:
            # Or else closing waits until a line that may be stuck has taken the rest. When the device has gone,
            # pyserial lets termios.error through, which is no OSError and exists on POSIX only.
            with contextlib.suppress(Exception):
                self._port.reset_output_buffer()
        await super().close()

    async def _connect(self) -> StreamPeer:
        loop = asyncio.get_running_loop()
        device, baud = self.parsed.place, self.parsed.number
        kind = _Port if os.name == "posix" else serial.Serial
        # Opening may wait for a modem line. Exclusive: two processes on one line would both get half of each frame.
        opening = partial(kind, device, baudrate=baud, exclusive=True, timeout=0, write_timeout=0)
        try:
            self._port = await loop.run_in_executor(None, opening)
        except ValueError as error:
            raise OSError(f"{baud} baud: {error}") from error
        except OSError:
            raise
        except Exception as error:  # termios.error, which POSIX alone has: the device has vanished meanwhile
            raise OSError(*error.args) from error
        line = baud / BITS_PER_BYTE
        budget = line
        if baud <= RADIO_BAUD and self.parsed.options.bytes_per_second is None:
            budget = min(line, RADIO_BYTES)

        made = StreamPeer(
            self.parsed,
            self.url,
            self._sink,
            write_ahead=max(MIN_WRITE_AHEAD, round(line * WRITE_AHEAD_S)),
            line=budget,
        )
        self._protect(made.channel)
        _Transport(loop, made, self._port)
        await asyncio.sleep(0)  # the transport calls connection_made in the loop's next turn; from then on it is usable
        return made

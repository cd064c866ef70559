"""Process that gives a Skycontroller's axes back when the gateway stalls.

Run by `watchdog`, never imported by it.

It shares the link's socket. The gateway writes records to its pipe; while frames are on stand-by and the pipe is
silent
for the limit, or ends, the child takes the token and sends the frames until they are acknowledged, 2 s at most.
Without
the token, which the gateway holds while it writes to a stream, the child sends nothing.

Records: kind (1 byte), length (u16), content. "F": frames to stand by with, each ``seq u16, size u16, bytes``; none:
stand down. "K": the gateway is alive.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import struct
import sys
import time

from anafi_mav.arsdk.link.frame import FrameType, decode_frames

REPEAT = 0.15
"""s between two sendings of a frame, as `transport.ACK_TIMEOUT`."""

TRY_FOR = 4.0
"""s that the frames are repeated without their acknowledgements.

Two of them need 0.8 s on a link of 0.2 s each way. Where it loses a quarter of all datagrams, 2 s are too few in 4
cases of a thousand (calculated), and the pilot then waits until the Skycontroller misses the gateway.
"""

RECORD = struct.Struct("<cH")
FRAME = struct.Struct("<HH")

ACK_OFFSET = 128


class Child:
    """The stand-by frames, and the descriptors that were inherited."""

    def __init__(self, link: int, pipe: int, token: int, report: int, version: int, limit: float, stream: bool) -> None:
        kind = socket.SOCK_STREAM if stream else socket.SOCK_DGRAM
        self._link = socket.socket(socket.AF_INET, kind, fileno=link)
        self._pipe, self._token, self._report = pipe, token, report
        self._version = version
        self._limit = limit
        self._stream = stream
        self._frames: list[tuple[int, bytes]] = []
        self._records = b""

    def run(self) -> None:
        """Watch until the gateway closes the pipe."""
        while True:
            if self._readable(self._limit if self._frames else None):
                if not self._read():
                    break
            elif self._frames and self._take_token():
                self._send_all()
        if self._frames:  # the gateway has ended without standing down
            self._take_token()
            self._send_all()

    def _readable(self, timeout: float | None) -> bool:
        return bool(_ready({self._pipe: select.POLLIN}, timeout))

    def _read(self) -> bool:
        """Take the records that have arrived. False: the pipe has ended."""
        data = os.read(self._pipe, 1 << 16)
        self._records += data
        while len(self._records) >= RECORD.size:
            kind, length = RECORD.unpack_from(self._records)
            end = RECORD.size + length
            if len(self._records) < end:
                break
            if kind == b"F":
                self._frames = _frames(self._records[RECORD.size : end])
            self._records = self._records[end:]
        return bool(data)

    def _take_token(self) -> bool:
        """False: the gateway has it."""
        try:
            os.read(self._token, 1)
        except BlockingIOError:
            return False
        return True

    def _send_all(self) -> None:
        deadline = time.monotonic() + TRY_FOR
        if self._stream:
            self._write_all(deadline)
        else:
            for seq, frame in self._frames:
                if not self._deliver(seq, frame, deadline):
                    break
        self._frames = []
        with contextlib.suppress(OSError):  # the gateway may have ended
            os.write(self._report, b"X")

    def _write_all(self, deadline: float) -> None:
        """Write the frames to a stream, each whole, until the gateway is alive again.

        The acknowledgements in it are the gateway's to read. TCP repeats what is lost on the radio, but a frame may
        be lost behind it.
        """
        content = b"".join(frame for _, frame in self._frames)
        while self._write(content, deadline) and time.monotonic() < deadline:
            if self._readable(REPEAT) and self._read():
                break
            time.sleep(REPEAT)  # the pipe of a gateway that has ended stays readable

    def _write(self, frame: bytes, deadline: float) -> bool:
        """Write all of it; False: the stream takes nothing."""
        while frame and (left := deadline - time.monotonic()) > 0.0:
            try:
                frame = frame[self._link.send(frame) :]
            except BlockingIOError:
                _ready({self._link.fileno(): select.POLLOUT}, left)
            except OSError:
                return False
        return not frame

    def _deliver(self, seq: int, frame: bytes, deadline: float) -> bool:
        """Send a frame until it is acknowledged, or until the gateway is alive again."""
        link, next_sending = self._link.fileno(), 0.0
        while (now := time.monotonic()) < deadline:
            if now >= next_sending:
                next_sending = now + REPEAT
                with contextlib.suppress(OSError):
                    self._link.send(frame)
            readable = _ready({link: select.POLLIN, self._pipe: select.POLLIN}, max(next_sending - now, 0.0))
            if self._pipe in readable and self._read():
                return False
            if link in readable and self._acknowledged(seq):
                return True
            if self._pipe in readable:  # the gateway is gone for good: its end stays readable
                time.sleep(REPEAT / 10)
        return False

    def _acknowledged(self, seq: int) -> bool:
        try:
            data = self._link.recv(1 << 16)
        except OSError:
            return False
        width = 1 if self._version == 1 else 2
        return any(
            type == FrameType.ACK and id >= ACK_OFFSET and int.from_bytes(payload[:width], "little") == seq
            for type, id, _, payload in decode_frames(self._version, data)[0]
        )


def _ready(events: dict[int, int], timeout: float | None) -> set[int]:
    """Return the descriptors that are ready, or have ended, after `timeout` s at most.

    None: after any time. Descriptors keep the gateway's numbers, which select(2) does not know from 1024 on.
    """
    poll = select.poll()
    for descriptor, event in events.items():
        poll.register(descriptor, event)
    return {descriptor for descriptor, _ in poll.poll(None if timeout is None else timeout * 1000.0)}


def _frames(data: bytes) -> list[tuple[int, bytes]]:
    frames, position = [], 0
    while position < len(data):
        seq, size = FRAME.unpack_from(data, position)
        position += FRAME.size
        frames.append((seq, data[position : position + size]))
        position += size
    return frames


def main() -> None:
    """Arguments: the four descriptors, protocol version, limit (s), 1 for a stream."""
    link, pipe, token, report, version = map(int, sys.argv[1:6])
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.set_blocking(token, False)
    Child(link, pipe, token, report, version, float(sys.argv[6]), sys.argv[7] == "1").run()


if __name__ == "__main__":
    main()

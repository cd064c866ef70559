"""Records both sides of a gateway, for `anafi-mav replay` and for a report of a bug.

Telemetry is recorded as a client of its own receives it, at the default rates and once, however many clients there
are. Answers to single clients and the frames of clients are recorded beside it. Messages with a key or password
(`WITH_SECRETS`) are never recorded.
"""

from __future__ import annotations

from pathlib import Path

from anafi_mav.clock import Clock
from anafi_mav.drone import Drone
from anafi_mav.drone.events import Message
from anafi_mav.mavlink.access import WITH_SECRETS
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import MAGIC_1, Packed, ReceivedFrame, with_flags
from anafi_mav.mavlink.node import Node
from anafi_mav.recording.session_folder import ARSDK, MAVLINK, SessionFolder
from anafi_mav.recording.tlog import TlogEntry, encode
from anafi_mav.recording.trace import COMMAND, EVENT, trace_line


class RecordingChannel(Channel):
    """The channel of a client that only listens.

    Forwarded frames are recorded where they arrive.
    """

    def forward(self, raw: bytes, *, give_way: bool = False, is_answer: bool = False) -> None:
        """Drop a frame of another system."""


class Recorder:
    """One session. `start` once, `close` once."""

    def __init__(self, node: Node, clock: Clock, folder: Path, max_bytes: int) -> None:
        self.files = SessionFolder(folder, max_bytes)
        self._node = node
        self._clock = clock
        self._since_1970 = clock.time() - self._elapsed
        """The session's clock does not step when the computer's clock is set."""
        self._channel = RecordingChannel("recording", self._write)

    def start(self) -> None:
        """Begin. Raises OSError when the folder cannot be made."""
        self.files.start()
        self._node.tap = self
        self._node.opened(self._channel)

    def add(self, drone: Drone) -> None:
        """Record the messages of a drone."""
        name = drone.name
        drone.on_event = lambda message: self._trace(name, EVENT, message)
        drone.on_command = lambda message: self._trace(name, COMMAND, message)

    async def close(self) -> None:
        """Write what waits. Idempotent."""
        if self._node.tap is self:
            self._node.tap = None
            self._channel.close()
            self._node.closed(self._channel)
        await self.files.close()

    def sent(self, packed: Packed, sysid: int, compid: int) -> None:
        """Record a message that leaves to one client."""
        self._channel.send_packed(packed, sysid, compid)

    def received(self, frame: ReceivedFrame) -> None:
        """Record a frame of a client, without its signature.

        Many signatures would help to find the key (MAVLink message_signing.md §logging).
        """
        if frame.id not in WITH_SECRETS:
            self._write(frame.raw if frame.raw[0] == MAGIC_1 else with_flags(frame.raw, 0))

    @property
    def _elapsed(self) -> float:
        """Time since an arbitrary moment, s; goes on while the computer is suspended."""
        return self._clock.boottime()

    def _now(self) -> float:
        return self._since_1970 + self._elapsed

    def _write(self, raw: bytes) -> None:
        self.files.append(MAVLINK, encode(TlogEntry(self._now(), raw)))

    def _trace(self, name: str, kind: str, message: Message) -> None:
        self.files.append(ARSDK, trace_line(self._now(), name, kind, message))

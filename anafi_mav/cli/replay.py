"""`anafi-mav replay`: plays a recorded session, or any tlog, to MAVLink endpoints.

A ground station then shows the flight again. Only frames of vehicles are sent: those of the clients of then would
look like other stations. What a client sends back is dropped: nothing flies. With --trace the ARSDK messages of the
session are printed at their times.
"""

from __future__ import annotations

import argparse
import asyncio
import heapq
import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from anafi_mav.cli import interrupts, log, options
from anafi_mav.cli.terminal import say
from anafi_mav.disk_writer import DiskWriter
from anafi_mav.errors import AnafiMavError, ConfigError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import Parser, ReceivedFrame
from anafi_mav.mavlink.node import Node
from anafi_mav.recording.tlog import TlogEntry, TlogReader
from anafi_mav.recording.trace import TraceEntry, read_line
from anafi_mav.services.flavours import FLAVOURS

CHUNK = 64 * 1024
"""Bytes of a file that are read at once."""

BATCH = 500
"""Entries that are read ahead."""

LONGEST_LINE = 1_000_000
"""Bytes of a line of a trace."""

LONGEST_PAUSE = 5.0
"""s: a longer gap, as between two flights, is shortened to this. A time that is earlier by more is that of a clock
which was set back."""

FROM_START = "a number of seconds, 0 or more"

_Timed = tuple[float, int, TlogEntry | TraceEntry]
"""An entry with its time, and 1 for one of the trace."""

DEFAULT_ENDPOINT = "udpout://127.0.0.1:14550"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav replay`."""
    parser.add_argument("path", type=Path, metavar="SESSION", help="folder of a recorded session, or a .tlog file")
    parser.add_argument(
        "--endpoint", action="append", metavar="URL", help=f"where to send ({DEFAULT_ENDPOINT}); repeatable"
    )
    parser.add_argument("--speed", default="1", metavar="N", help="recorded seconds per second, from 0.1 to 20")
    parser.add_argument("--start", default="0", metavar="S", help="begin so many seconds after the first frame")
    parser.add_argument("--trace", action="store_true", help="print the ARSDK messages of the session")


def run(arguments: argparse.Namespace) -> int:
    """Play to the end or to Ctrl-C.

    Raises `ConfigError` for a path without a recording and a start after its end, and `AnafiMavError` for a file that
    cannot be read or has no frame.
    """
    log.set_up()
    tlogs, traces = files_of(arguments.path)
    speed = options.speed(arguments.speed)
    start = options.number("--start", arguments.start, FROM_START)
    if start < 0:
        raise ConfigError("--start", f"expected {FROM_START}, got {arguments.start}")
    endpoints = arguments.endpoint or [DEFAULT_ENDPOINT]
    count = interrupts.run(play(tlogs, traces if arguments.trace else [], endpoints, speed, start))
    say(f"{count} frames played")
    return 0


def files_of(path: Path) -> tuple[list[Path], list[Path]]:
    """Return the parts of a session's tlog and of its trace. Raises `ConfigError`."""
    if path.is_dir():
        tlogs = sorted(path.glob("gateway.*.tlog"), key=_in_order)
        traces = sorted(path.glob("arsdk.*.jsonl"), key=_in_order)
    else:
        tlogs, traces = ([path] if path.is_file() else []), []
    if not tlogs:
        raise ConfigError("SESSION", f"expected the folder of a recorded session or a .tlog file, got {path}")
    return tlogs, traces


def _in_order(part: Path) -> tuple[int, str]:
    """Return the key by which part 10000 follows part 9999."""
    return len(part.name), part.name


def read_tlogs(paths: Sequence[Path]) -> Iterator[TlogEntry]:
    """Yield the entries of some files, one after another."""
    for path in paths:
        reader = TlogReader()
        with path.open("rb") as file:
            while data := file.read(CHUNK):
                yield from reader.receive(data)


def read_traces(paths: Sequence[Path]) -> Iterator[TraceEntry]:
    """Yield the entries of some files, one after another."""
    for path in paths:
        with path.open("rb") as file:
            while line := file.readline(LONGEST_LINE):
                if (entry := read_line(line)) is not None:
                    yield entry


class VehicleFrames:
    """Chooses the frames of vehicles: systems that have sent a HEARTBEAT with an autopilot."""

    def __init__(self) -> None:
        self.seen = 0
        """Frames of any system."""
        self._parser = Parser()
        self._vehicles: set[int] = set()

    def choose(self, raw: bytes) -> ReceivedFrame | None:
        """Return the frame of a vehicle; None for another one, and for what is no frame."""
        found = self._parser.receive_datagram(raw)
        if not found:
            return None
        self.seen += 1
        frame = found[0]
        message = frame.message
        if frame.id == dialect.MAVLINK_MSG_ID_HEARTBEAT and message.autopilot != dialect.MAV_AUTOPILOT_INVALID:
            self._vehicles.add(frame.sysid)
        return frame if frame.sysid in self._vehicles else None


class RecordedClock:
    """Counts the seconds of a recording, whose clock may have been set meanwhile."""

    def __init__(self) -> None:
        self.elapsed = 0.0
        """s since the first entry; never less than before."""
        self._newest: float | None = None
        """Time of the newest entry, s since 1970."""

    def advance(self, at: float) -> float:
        """Return the seconds from the first entry to one of this time."""
        step = 0.0 if self._newest is None else at - self._newest
        if self._newest is None or step > 0.0 or step < -LONGEST_PAUSE:
            self._newest = at
        self.elapsed += max(step, 0.0)
        return self.elapsed


async def play(
    tlogs: Sequence[Path], traces: Sequence[Path], endpoints: Sequence[str], speed: float, start: float
) -> int:
    """Send everything at its time; return the number of frames.

    Raises `AnafiMavError` as `run` does.
    """
    node = Node(flavours=tuple(FLAVOURS), forwards=False)
    try:
        await node.start(endpoints)
    except ConfigError as error:
        raise ConfigError("--endpoint", error.problem) from error
    try:
        return await _send(node, tlogs, traces, speed, start)
    finally:
        await node.close()


async def _send(node: Node, tlogs: Sequence[Path], traces: Sequence[Path], speed: float, start: float) -> int:
    loop = asyncio.get_running_loop()
    vehicles, count = VehicleFrames(), 0
    frames: Iterator[_Timed] = ((entry.time, 0, entry) for entry in read_tlogs(tlogs))
    messages: Iterator[_Timed] = ((entry.t, 1, entry) for entry in read_traces(traces))
    merged: Iterator[_Timed] = iter(heapq.merge(frames, messages, key=lambda one: one[:2]))
    clock = RecordedClock()
    played, due = start, loop.time()
    # A file that is long, or none of ours, is searched for minutes: in a thread, so that Ctrl-C ends that.
    reader = DiskWriter("anafi-mav-replay")
    try:
        while batch := await loop.run_in_executor(reader, _read_ahead, merged):
            for at, _, entry in batch:
                elapsed = clock.advance(at)
                frame = vehicles.choose(entry.frame) if isinstance(entry, TlogEntry) else None
                if elapsed < start:
                    continue
                due += min(elapsed - played, LONGEST_PAUSE) / speed
                played = elapsed
                if due > loop.time():
                    await asyncio.sleep(due - loop.time())
                if isinstance(entry, TraceEntry):
                    say(f"{elapsed:.3f} {entry.drone} {entry.kind} {entry.name} {json.dumps(entry.args)}")
                elif frame is not None:
                    raw = frame.version_2()
                    for channel in node.channels:
                        if channel.has_system(frame.sysid) and channel.can_stream(frame.id):
                            channel.forward(raw)
                    count += 1
    finally:
        reader.shutdown()
    if not vehicles.seen:
        raise AnafiMavError(f"{tlogs[0]}: no MAVLink frame: expected a tlog")
    if start > clock.elapsed:
        raise ConfigError("--start", f"expected at most the {clock.elapsed:.0f} s of the recording, got {start:g}")
    return count


def _read_ahead(entries: Iterator[_Timed]) -> list[_Timed]:
    """Return the next entries; none at the end.

    Raises `AnafiMavError` for a file that cannot be read.
    """
    try:
        return list(itertools.islice(entries, BATCH))
    except OSError as error:
        raise AnafiMavError(f"{error.filename}: cannot be read: {error.strerror}") from error

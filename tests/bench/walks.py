"""Counts what six values pass on their way through the gateway: calls, files, rooms and event-loop iterations.

    python tests/bench/walks.py [--json FILE] [--against FILE] [--observers] [--path NAME]

Gateway, simulated drone and client run in one process in virtual time (`tests/support/virtual_time.py`); a walk is what
the package does, without its simulator, at the instant of its stimulus until nothing is left to do at that instant. A
telemetry walk is a datagram of the drone, so its figures hold all messages of that datagram.

A call is a function of the package that is entered, once however often it is resumed. A change is a call in another
file, or another room, than the call before. An observer is what the drone's and the system's delivery of an event
calls, in a later iteration too, and the services that learn of a changed mode or armed state; for telemetry the service
that sends messages is one of them. A room is a folder of the package; in `services` each folder is one, below
`system.py` and `component.py`, and above the modules beside it.
`--against` prints an earlier result of `--json` beside this one, its files in the rooms in which git finds them today:
in one folder of a hundred files no walk would change its room.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Mapping
from contextvars import ContextVar, Token
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, FrameType, MethodType
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "anafi_mav"

Call = tuple[str, str, str, str]
"""File, function, file of the caller (empty: the event loop), observer below which it is called (empty: none)."""

RANKS = {"arsdk": 1, "mavlink": 1, "plans": 1, "config": 1, "drone": 2, "vehicle": 3, "services": 4}
FLOOR, ROOM, SYSTEM, GATEWAY, CLI = 4, 5, 6, 7, 8
PARTNERS = ("sim/", "tests/")
"""Simulated drone and MAVLink client: what they call of the package is no part of a walk."""

LOOP = ROOT / "tests/support/virtual_time.py"
"""Below it are the functions that the package runs in threads."""

DISPATCHERS = ("drone/drone.py", "services/system.py")
"""They deliver the drone's events."""

DEFERRAL, DEFERRED = "after_read", "_call_after_read"
"""Of `arsdk/link/session.py`: takes a function, and calls it when the messages that are read together are handled."""

CHANGE = ("services/system.py", "_changed")
"""It delivers a change of mode, armed state or health."""

OBSERVER: ContextVar[str] = ContextVar("observer", default="")
"""The observer that works: what it schedules on the event loop is its own, too."""

COMPOSERS = ("system", "component")
"""Modules above the rooms of `services`."""

ANONYMOUS = ("<genexpr>", "<listcomp>", "<dictcomp>", "<setcomp>")
"""Parts of a function that Python versions make functions of, or not."""

NEWER = ("GIMBAL_DEVICE_ATTITUDE_STATUS",)
"""Messages of the telemetry walk that the first result did not have. The client stops them: seven messages leave."""

INSTANT = 1e-9
"""s of a timer that is due when nothing is left to do at this instant."""


def room(path: str) -> str:
    """Return the room of a file of the package."""
    folders = path.split("/")[:-1]
    name = path.rpartition("/")[2].removesuffix(".py")
    if not folders:
        return name if name in ("gateway", "__main__") else "kit"
    if folders[0] != "services":
        return folders[0]
    return "/".join(folders[:2]) if len(folders) > 1 else "services/system" if name in COMPOSERS else "services"


def rank(name: str) -> int:
    """Return how high a room is: it may call rooms that are not higher."""
    if name.startswith("services/"):
        return SYSTEM if name == "services/system" else ROOM
    return {"kit": 0, "gateway": GATEWAY, "cli": CLI, "__main__": CLI}.get(name) or RANKS.get(name, 0)


@dataclass
class Walk:
    """What was traced of one walk."""

    iterations: list[list[Call]]
    """The calls of each event-loop iteration in which the package worked."""

    def figures(self, moved: Mapping[str, str]) -> dict[str, int]:
        """Return the figures, with files where they are today."""
        calls = [call for iteration in self.iterations for call in iteration]
        files = [call[0] for call in calls]
        rooms = [room(moved.get(file, file)) for file in files]
        callers = [room(moved.get(call[2], call[2])) if call[2] else "" for call in calls]
        return {
            "calls": len(calls),
            "of observers": sum(bool(call[3]) for call in calls),
            "files": len(set(files)),
            "without observers": len({call[0] for call in calls if not call[3]}),
            "file changes": _changes(files),
            "iterations": len(self.iterations),
            "room changes": _changes(rooms),
            "calls into a higher room": sum(
                caller != "" and rank(callee) > rank(caller) for callee, caller in zip(rooms, callers, strict=True)
            ),
        }

    def observers(self) -> Counter[str]:
        """Return the calls below each observer."""
        return Counter(call[3] for iteration in self.iterations for call in iteration if call[3])


def _changes(values: list[str]) -> int:
    return sum(a != b for a, b in itertools.pairwise(values))


@dataclass
class Iteration:
    """One iteration of the event loop."""

    at: float
    calls: list[Call] = field(default_factory=list)


class Tracer:
    """Notes the package's calls while it is on."""

    def __init__(self) -> None:
        self.iterations: list[Iteration] = []
        self._stack: list[tuple[FrameType, str, str, bool, str]] = []
        """(frame, file of package or tests or "", nearest file of the package, part of the drone's side, observer)."""
        self._observing: tuple[FrameType, Token[str]] | None = None
        """The frame with which the present observer began."""
        self._seen: set[FrameType] = set()
        self._files: dict[CodeType, str] = {}
        self._deferred: dict[CodeType, str] = {}
        """What an observer has deferred -> that observer."""

    def start(self, now: float) -> None:
        self.iterations = [Iteration(now)]
        self._stack.clear()
        self._seen.clear()
        sys.setprofile(self._profile)

    def stop(self) -> list[Iteration]:
        sys.setprofile(None)
        self._seen.clear()
        return [iteration for iteration in self.iterations if iteration.calls]

    def iterate(self, now: float) -> None:
        """Begin an iteration of the event loop."""
        self.iterations.append(Iteration(now))

    def _file(self, code: CodeType) -> str:
        if code not in self._files:
            path = Path(code.co_filename)
            is_of_client = path.is_relative_to(ROOT / "tests") and path != LOOP
            root = PACKAGE if path.is_relative_to(PACKAGE) else ROOT if is_of_client else None
            self._files[code] = "" if root is None else path.relative_to(root).as_posix()
        return self._files[code]

    def _profile(self, frame: FrameType, event: str, argument: object) -> None:
        if event == "return":
            if self._stack and self._stack[-1][0] is frame:
                self._stack.pop()
                if self._observing is not None and self._observing[0] is frame:
                    OBSERVER.reset(self._observing[1])
                    self._observing = None
            return
        if event != "call":
            return
        code = frame.f_code
        file = self._file(code)
        _, _, caller, foreign, observer = self._stack[-1] if self._stack else (None, "", "", False, "")
        observer = observer or OBSERVER.get()
        foreign = foreign or file.startswith(PARTNERS) or _of_the_drone(frame, file)
        if file and not foreign and code.co_name not in ANONYMOUS:
            if not observer and caller in DISPATCHERS and self._delivers(file):
                observer = f"{file}:{code.co_qualname if sys.version_info >= (3, 11) else code.co_name}"
                self._observing = frame, OBSERVER.set(observer)
            if code.co_name == DEFERRAL and observer and isinstance(call := frame.f_locals.get("call"), MethodType):
                self._deferred[call.__func__.__code__] = observer
            elif not observer and self._stack and self._stack[-1][0].f_code.co_name == DEFERRED:
                observer = self._deferred.pop(code, "")
                self._observing = frame, OBSERVER.set(observer)
            if frame not in self._seen:
                self._seen.add(frame)
                self.iterations[-1].calls.append((file, code.co_name, caller, observer))
        self._stack.append((frame, file, file or caller, foreign, observer))

    def _delivers(self, file: str) -> bool:
        """True when the drone delivers an event, and not to a part of itself."""
        if file in DISPATCHERS or rank(room(file)) <= RANKS["drone"]:
            return False
        caller = self._stack[-1][0].f_code.co_name
        is_change = file.startswith("services/") and (self._stack[-1][1], caller) == CHANGE
        return is_change or any(entry[1] == DISPATCHERS[0] for entry in self._stack)


def _of_the_drone(frame: FrameType, file: str) -> bool:
    """True for code that gateway and simulator share, while it is the simulator's: the device's role of ARSDK."""
    if not file.startswith("arsdk/"):
        return False
    return file.endswith("device.py") or type(frame.f_locals.get("self")).__name__.startswith("Device")


TRACER = Tracer()


def _now() -> float:
    return asyncio.get_running_loop().time()


async def traced(act: Callable[[], Awaitable[object]]) -> list[Iteration]:
    """Do something, and return what was traced until nothing is left to do at the instant of its end."""
    TRACER.start(_now())
    try:
        await act()
        await asyncio.sleep(INSTANT)
    finally:
        iterations = TRACER.stop()
    return iterations


def at(iterations: Iterable[Iteration], instant: float) -> Walk:
    """Return the walk of one instant."""
    return Walk([iteration.calls for iteration in iterations if iteration.at == instant])


# -- the walks


async def telemetry(w: Any) -> Walk:
    """Walk 1: a datagram of telemetry, of which seven messages are made; the vehicle hovers."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    client = w.client
    for name in NEWER:
        id = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
        assert (await client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, id, -1)).result == 0
    mark = client.mark()
    iterations = await traced(lambda: asyncio.sleep(5.0))
    arrived: dict[float, list[str]] = {}
    for when, message in client.received[mark:]:
        arrived.setdefault(when, []).append(message.get_type())
    usual = Counter(tuple(sorted(kinds)) for kinds in arrived.values() if "ATTITUDE" in kinds).most_common(1)[0][0]
    return at(iterations, next(when for when, kinds in arrived.items() if tuple(sorted(kinds)) == usual))


async def quiet(w: Any) -> None:
    """Wait for a moment between two datagrams of telemetry."""
    await w.client.wait("ATTITUDE")
    await asyncio.sleep(0.052)


async def reposition(w: Any) -> Walk:
    """Walk 2: DO_REPOSITION until its acknowledgement."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect
    from support.world import HOME

    from anafi_mav import geo

    command = (dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, math.nan)
    north, east = geo.destination(*HOME[:2], 20.0, 0.0)  # the client's own work is no part of the walk
    await quiet(w)

    async def send() -> None:
        assert (await w.client.command(*command, frame=6, x=north, y=east, z=8.0)).result == 0

    return Walk([iteration.calls for iteration in await traced(send)])


async def attitude(w: Any) -> Walk:
    """Walk 3: one SET_ATTITUDE_TARGET of a stream."""
    from support import setpoints

    message = setpoints.attitude(-0.05)
    for _ in range(10):
        w.client.send(message)
        await asyncio.sleep(0.05)
    await setpoints.engage(w.client, "px4")
    for _ in range(20):
        w.client.send(message)
        await asyncio.sleep(0.05)
    w.client.send(message)
    await quiet(w)

    async def send() -> None:
        w.client.send(message)

    return Walk([iteration.calls for iteration in await traced(send)])


async def warm_up(w: Any) -> None:
    """Fly the beginning of another mission: what is done once only, codecs for instance, is in no walk."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect
    from support.missions import CORNERS, put

    await asyncio.sleep(3.0)
    await put(w, CORNERS)
    await start(w)
    await w.client.wait("MISSION_ITEM_REACHED", since=0, timeout=60.0)
    assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == 0
    await w.drone.wait_log(lambda entry: entry.name == "flying" and entry.args["to"] == "landed", 60.0)
    await asyncio.sleep(3.0)


async def upload(w: Any) -> Walk:
    """Walk 4a: a mission of five items until MISSION_ACK."""
    from support.missions import ROUND, put

    await quiet(w)
    return Walk([iteration.calls for iteration in await traced(lambda: put(w, ROUND))])


async def start(w: Any) -> Walk:
    """Walk 4b: MISSION_START until the drone plays and the command is acknowledged."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == 0
    await quiet(w)

    async def begin() -> None:
        ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
        assert ack.result == 0, ack
        await w.drone.wait_log(lambda entry: entry.name == "plan" and entry.args["state"] == "playing")

    return Walk([iteration.calls for iteration in await traced(begin)])


async def reached(w: Any) -> Walk:
    """Walk 4c: an item that the drone has executed, until MISSION_ITEM_REACHED."""
    client = w.client
    await client.wait("MISSION_ITEM_REACHED", timeout=60.0)
    while True:
        mark = client.mark()
        iterations = await traced(lambda: client.wait("MISSION_ITEM_REACHED", timeout=60.0))
        when = client.since(mark, "MISSION_ITEM_REACHED")[0][0]
        if not [kind for at, kind in client.since(mark, "ATTITUDE") if at == when]:
            return at(iterations, when)


async def all_walks() -> dict[str, Walk]:
    """Return every walk by its title."""
    from support.fault_scenarios import goto
    from support.world import world

    walks: dict[str, Walk] = {}
    async with world(speed=1.0, web=True) as w:
        await warm_up(w)
        walks["4a upload of 5 items"] = await upload(w)
        walks["4b MISSION_START ... drone plays"] = await start(w)
        walks["4c MissionItemExecuted ... MISSION_ITEM_REACHED"] = await reached(w)
    async with world(speed=1.0, web=True) as w:
        await w.take_off(8.0)
        await goto(w, 5.0, 8.0)
        await w.drone.wait_log(lambda entry: entry.kind == "pose" and abs(w.drone.pose.north - 5.0) < 0.1, 30.0)
        await asyncio.sleep(2.0)
        walks["1 AttitudeChanged ... ATTITUDE"] = await telemetry(w)
        walks["2 DO_REPOSITION ... COMMAND_ACK"] = await reposition(w)
        walks["3 SET_ATTITUDE_TARGET ... sticks"] = await attitude(w)
    return dict(sorted(walks.items()))


# -- output


def moved_since(commit: str) -> dict[str, str]:
    """Return where git finds the package's files of a commit today, by their path then."""
    words = ["git", "-C", str(ROOT), "diff", "--name-status", "-M30%", commit, "--", "anafi_mav"]
    rows = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    renamed = (row.split("\t") for row in rows if row.startswith("R"))
    return {old.removeprefix("anafi_mav/"): new.removeprefix("anafi_mav/") for _, old, new in renamed}


def head() -> str:
    """Return the last commit that changed the package."""
    words = ["git", "-C", str(ROOT), "log", "-1", "--format=%H", "--", "anafi_mav"]
    return subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def table(walks: Mapping[str, Walk], before: Mapping[str, Walk], moved: Mapping[str, str]) -> Iterable[str]:
    """Yield the rows; with earlier walks each cell is `then -> now`, and `!` where it is worse."""
    columns = list(Walk([]).figures({}))
    yield f"| walk | {' | '.join(columns)} |"
    yield "|---" * (len(columns) + 1) + "|"
    for title, walk in walks.items():
        now = walk.figures({})
        cells = [str(now[column]) for column in columns]
        if title in before:
            then = before[title].figures(moved)
            cells = [f"{then[c]} -> {now[c]}{' !' if now[c] > then[c] else ''}" for c in columns]
        yield f"| {title} | {' | '.join(cells)} |"


def observers(walks: Mapping[str, Walk]) -> Iterable[str]:
    """Yield the observers of each walk with their calls."""
    for title, walk in walks.items():
        for name, calls in walk.observers().most_common():
            yield f"{title}: {name}: {calls} calls"


def loaded(path: Path) -> tuple[str, dict[str, Walk]]:
    """Return commit and walks of a file."""
    content = json.loads(path.read_text(encoding="utf-8"))
    walks = {title: Walk([[tuple(call) for call in one] for one in walk]) for title, walk in content["walks"].items()}
    return content["commit"], walks


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every call")
    parser.add_argument("--against", type=Path, metavar="FILE", help="an earlier result of --json")
    parser.add_argument("--observers", action="store_true", help="list them with their calls")
    parser.add_argument("--path", metavar="NAME", help="print every call of the walk whose title begins so")
    options = parser.parse_args()
    if os.environ.get("PYTHONHASHSEED") != "0":
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "PYTHONHASHSEED": "0"})
    sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
    from support import virtual_time

    from anafi_mav.arsdk.link import watchdog

    class Loop(virtual_time.Loop):
        """Notifies the tracer of its iterations."""

        def __init__(self) -> None:
            super().__init__()
            selector = self._selector
            select = selector.select

            def selected(timeout: float | None = None) -> Any:
                ready = select(timeout)
                TRACER.iterate(virtual_time.now())
                return ready

            selector.select = selected

    watchdog.LIMIT = None  # gateway and drone share one process
    virtual_time.install(1)
    with tempfile.TemporaryDirectory() as state:
        os.environ["XDG_STATE_HOME"] = state
        loop = Loop()
        try:
            walks = loop.run_until_complete(all_walks())
        finally:
            loop.close()
    if options.json is not None:
        content = {"commit": head(), "walks": {title: walk.iterations for title, walk in walks.items()}}
        options.json.write_text(json.dumps(content), encoding="utf-8")
    commit, before = ("", {}) if options.against is None else loaded(options.against)
    for row in table(walks, before, moved_since(commit) if commit else {}):
        print(row)
    for row in observers(walks) if options.observers else ():
        print(row)
    for title, walk in walks.items():
        if options.path is not None and title.startswith(options.path):
            for number, iteration in enumerate(walk.iterations, 1):
                for file, function, caller, observer in iteration:
                    print(f"{number} {room(file):16} {file}:{function}  <- {caller or 'loop'}  {observer}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

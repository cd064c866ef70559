"""Many drones and clients for a long time: memory, leaks and answers of the gateway's process.

    .venv/bin/python tests/bench/endurance.py                   # 30 minutes, 20 drones, 4 clients
    .venv/bin/python tests/bench/endurance.py --minutes 5       # in a sixth of the time: not the goal's figures
    .venv/bin/python tests/bench/endurance.py --seed 4711       # the same plan of steps again
    .venv/bin/python tests/bench/endurance.py --keep FOLDER     # with the logs of clients, simulators and gateway

Simulated drones, clients and gateway are separate processes; the drones are in two, each of which is killed and started
again now and then. Their links are interrupted for up to 10 s, and clients drop their connection without a goodbye. The
steps of the clients are drawn from the printed seed: flight commands, setpoints, missions, camera, files, requests.

The gateway is measured at rest, after a sixth, a third and the whole of the time, in which rests do not count. At rest
all drones are on the ground and connected, the same clients are connected, and every command has its final result.
After a rest both simulators are started again.

| judged | limit |
|---|---|
| memory at the end against that after a third | 5 % more |
| tasks, files and sockets at the end | as after a sixth |
| final results of each command (IN_PROGRESS before it is allowed) | one |
| a command that FAILED while its drone was silent | with a text of that drone |
| accepted take-offs of PX4's and of ArduPilot's clients | some of each |
| a command without a result | none; queries that were sent while the drone was not connected excepted |
| the gateway's process and its stderr | runs, no traceback |

A command that changes something is answered in a silence, too: with FAILED and a text, or its sender could not know
whether it is flown later. A query has no answer then: stations send queries by themselves, and an answer would look to
them like a sign of the drone.

Exit status 1 when one of these is exceeded. A run in which this computer lost datagrams between a client and the
gateway is void.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import random
import signal
import socket
import struct
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

import yaml
from common import ROOT, loopback, machine
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from anafi_mav import mav_enums as enums

GROUPS = 2
"""Simulator processes."""
PORTS = (5760, 5761, 14550, 14551)
URLS = ("tcpin", "tcpin", "udpin", "udpin")
"""One endpoint for each client in turn; the second of each kind has the ArduPilot flavour."""

GAP = (0.0, 0.4)
"""s between two steps of one client."""
CUT_EVERY, CUT_LIMIT = 45.0, 10.0
"""s between two cuts of one drone's link on average, and the longest cut."""
CRASH_EVERY = 100.0
"""s between two crashes of a simulator on average."""
DROP_EVERY = 60.0
"""s between two lost connections of one client on average."""

ANSWER_LIMIT = 150.0
"""s for a final result: a landing from the greatest height is one."""
QUERY_LIMIT = 10.0
"""s for the result of a query, which is answered at once or never."""
FILE_LIMIT = 5.0
"""s for an answer to a request of the file or mission protocol, before it is sent again."""
REST_LIMIT = 240.0
"""s for the drones to land and for what is left of the steps to end."""
LAND_AGAIN = 10.0
"""s without a final result after which a rest sends Land again. A drone must land whatever became of the first one."""
TEXT_WITHIN = 5.0
"""s before or after a FAILED in which its text has arrived."""
SILENT_AFTER = 3.0
"""s of silence after which open commands are answered (docs/connecting.md)."""
SILENT_FOR, RECONNECTED_AFTER = 2.0, 12.0
"""s of silence after which a link may count as lost, and after its end until the drone is connected again."""
MEMORY_LIMIT = 1.05
PHASES = (1 / 6, 1 / 6, 2 / 3)
"""Shares of the time, each of which ends with a rest."""

QUERIES = {mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_USER_1}
"""Commands of the steps that change nothing."""

HOME = (48.8789, 2.3677, 35.0)
NAN = float("nan")
KINDS = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK,
    mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
}
"""Messages that are decoded: decoding all of them would take the core that the gateway needs."""
LOGGED = {"HEARTBEAT", "STATUSTEXT", "COMMAND_LONG", "COMMAND_INT", "COMMAND_ACK"}


# -- the gateway's process


def report(number: int, frame: FrameType | None) -> None:
    """Write what the process holds to the file descriptor that the parent reads."""
    tasks: Counter[str] = Counter()
    with contextlib.suppress(RuntimeError):
        for task in asyncio.all_tasks(asyncio.get_running_loop()):
            tasks[getattr(task.get_coro(), "__qualname__", "?")] += 1
    files: Counter[str] = Counter()
    for entry in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            files[str(entry.readlink()).partition(":")[0]] += 1
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    held = {"mebibytes": pages * os.sysconf("SC_PAGE_SIZE") / 2**20, "tasks": tasks, "files": files}
    os.write(int(os.environ["ENDURANCE_REPORT"]), json.dumps(held).encode() + b"\n")


def gateway(arguments: list[str]) -> None:
    """Run `anafi-mav` with a report on SIGUSR1."""
    from anafi_mav.cli import main as command

    signal.signal(signal.SIGUSR1, report)
    sys.exit(command(arguments))


# -- clients


def lost_datagrams(host: str, port: int) -> int:
    """Return how many datagrams the kernel did not keep for a UDP socket that did not read them in time."""
    local = f"{int.from_bytes(socket.inet_aton(host), sys.byteorder):08X}:{port:04X}"
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return sum(int(row[12]) for row in rows if row[1] == local)


@dataclass
class Commanded:
    """A command of a client and its answers."""

    at: float
    drone: int
    command: int
    results: list[tuple[float, int]] = field(default_factory=list)
    """(time, MAV_RESULT), without IN_PROGRESS."""
    is_abandoned: bool = False
    """A lost connection of the client left it without an answer."""
    repeated: int = 0
    """How often it was sent again because no final result had arrived."""

    def is_open(self, now: float) -> bool:
        """Whether its final result is awaited."""
        limit = QUERY_LIMIT if self.command in QUERIES else ANSWER_LIMIT
        return not self.results and not self.is_abandoned and now - self.at < limit


class BenchClient(asyncio.DatagramProtocol):
    """One MAVLink client of all drones, over TCP or UDP."""

    def __init__(self, host: str, number: int, log: TextIO | None) -> None:
        self._log = log
        self.number, self.host, self.port = number, host, PORTS[number]
        self.sysid = 251 + number
        self.is_ardupilot = number % 2 == 1
        self.armed: dict[int, bool] = {}
        self.states: dict[int, str] = {}
        self._beaten: dict[int, float] = {}
        self.gaps: dict[int, list[tuple[float, float]]] = defaultdict(list)
        """Times between two heartbeats of a drone that are further apart than while it is connected."""
        self.commands: dict[tuple[int, int], list[Commanded]] = defaultdict(list)
        """By drone and MAV_CMD."""
        self.texts: list[tuple[float, int, str]] = []
        self.unexpected: list[str] = []
        """Final results without a command."""
        self.lost_datagrams = 0
        self.waiting: dict[tuple[str, int], asyncio.Queue[Any]] = {}
        """Answers of a protocol of a drone, while a step waits for them."""
        self._out = mavlink.MAVLink(None, self.sysid, 190)
        self._in = mavlink.MAVLink(None)
        self._in.robust_parsing = True
        self._data = b""
        self._transport: Any = None
        self._tasks: list[asyncio.Task[None]] = []

    async def connect(self) -> None:
        loop = asyncio.get_running_loop()
        if URLS[self.number] == "tcpin":
            reader, self._transport = await asyncio.open_connection(self.host, self.port)
            self._tasks.append(asyncio.create_task(self._read(reader)))
        else:
            sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
            sock.setblocking(False)
            sock.connect((self.host, self.port))
            self._transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=sock)
        self._tasks.append(asyncio.create_task(self._beat()))

    async def drop(self, rest: float) -> None:
        """Lose the connection without a goodbye, and connect again after a while."""
        self.close()
        for one in [one for sent in self.commands.values() for one in sent]:
            one.is_abandoned = one.is_abandoned or not one.results
        await asyncio.sleep(rest)
        await self.connect()

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()
        self._tasks.clear()
        if URLS[self.number] == "tcpin":
            self._transport.transport.abort()
        else:
            self.lost_datagrams += self._lost()
            self._transport.close()
        self._data = b""

    def count_lost(self) -> int:
        """Datagrams that this computer did not keep for the client."""
        return self.lost_datagrams + (0 if URLS[self.number] == "tcpin" else self._lost())

    def _lost(self) -> int:
        address, port = self._transport.get_extra_info("sockname")
        return lost_datagrams(address, port)

    def send(self, message: Any) -> None:
        if not self._tasks:  # the connection is lost: what a step still sends goes nowhere
            return
        self._note("out", message)
        data = message.pack(self._out)
        if URLS[self.number] == "tcpin":
            self._transport.write(data)
        else:
            self._transport.sendto(data)

    def _note(self, way: str, m: Any) -> None:
        if self._log is not None and m.get_type() in LOGGED:
            entry = {"t": round(time.monotonic(), 3), "client": self.number, "way": way, **m.to_dict()}
            if way == "in":
                entry["from"] = f"{m.get_srcSystem()}/{m.get_srcComponent()}"
            print(json.dumps(entry, default=str), file=self._log, flush=True)

    async def _beat(self) -> None:
        while True:
            self.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
            await asyncio.sleep(1.0)

    async def _read(self, reader: asyncio.StreamReader) -> None:
        while data := await reader.read(1 << 16):
            self._take(data)

    def datagram_received(self, data: bytes, address: Any) -> None:
        self._take(data)

    def _take(self, data: bytes) -> None:
        data = self._data + data
        at = 0
        while len(data) - at >= 12 and data[at] == 0xFD and len(data) - at >= (end := 12 + data[at + 1]):
            if int.from_bytes(data[at + 7 : at + 10], "little") in KINDS:
                self._in.buf.clear()
                self._in.buf_index = 0
                for message in self._in.parse_buffer(data[at : at + end]) or ():
                    self._receive(message, time.monotonic())
            at += end
        self._data = data[at:]
        if self._data and self._data[0] != 0xFD:
            raise SystemExit(f"client {self.number} received no frame of MAVLink 2: {self._data[:8]!r}")

    def _receive(self, m: Any, now: float) -> None:
        kind, drone = m.get_type(), m.get_srcSystem()
        if kind == "HEARTBEAT":
            if m.get_srcComponent() == 1:
                if now - self._beaten.get(drone, now) > SILENT_FOR:
                    self.gaps[drone].append((self._beaten[drone], now))
                self._beaten[drone] = now
                if self.states.get(drone) != f"mode {m.custom_mode:#x}, status {m.system_status}":
                    self._note("in", m)
                self.armed[drone] = bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                self.states[drone] = f"mode {m.custom_mode:#x}, status {m.system_status}"
        elif kind == "STATUSTEXT":
            self._note("in", m)
            self.texts.append((now, drone, m.text))
        elif m.target_system != self.sysid:
            return
        elif kind == "COMMAND_ACK":
            self._note("in", m)
            if m.result == mavlink.MAV_RESULT_IN_PROGRESS:
                return
            sent = self.commands[drone, m.command]
            for one in reversed(sent):
                if not one.results and not one.is_abandoned:
                    one.results.append((now, m.result))
                    return
            if any(one.is_abandoned for one in sent):
                return
            self.unexpected.append(f"drone {drone}: {m.command} is answered once more, with {m.result}")
        else:
            family = "mission" if kind.startswith("MISSION") else "file"
            if (queue := self.waiting.get((family, drone))) is not None:
                queue.put_nowait(m)

    # -- what a client does

    def is_open(self, drone: int, command: int) -> bool:
        """Whether a command of the same kind to the drone waits for its result."""
        now = time.monotonic()
        return any(one.is_open(now) for one in self.commands[drone, command])

    def command(self, drone: int, command: int, *params: float, component: int = 1) -> None:
        if not self._tasks or self.is_open(drone, command):
            return
        self.commands[drone, command].append(Commanded(time.monotonic(), drone, command))
        values = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(drone, component, command, 0, *values))

    def land(self, drone: int) -> None:
        """Send Land; one without a final result again after a while, as the command protocol has it."""
        now, land = time.monotonic(), mavlink.MAV_CMD_NAV_LAND
        for one in self.commands[drone, land]:
            if not one.is_open(now):
                continue
            if now - one.at > LAND_AGAIN * (one.repeated + 1):
                one.repeated += 1
                self.send(mavlink.MAVLink_command_long_message(drone, 1, land, min(one.repeated, 255), *[0.0] * 7))
            return
        self.command(drone, land)

    def place_command(
        self, drone: int, command: int, params: tuple[float, ...], place: tuple[float, float, float]
    ) -> None:
        if not self._tasks or self.is_open(drone, command):
            return
        self.commands[drone, command].append(Commanded(time.monotonic(), drone, command))
        where = (round(place[0] * 1e7), round(place[1] * 1e7), place[2])
        self.send(mavlink.MAVLink_command_int_message(drone, 1, 6, command, 0, 0, *params, *where))

    @contextlib.contextmanager
    def answers(self, family: str, drone: int) -> Iterator[asyncio.Queue[Any] | None]:
        """Answers of a protocol within the block; None when another step of this client uses it."""
        key = (family, drone)
        if key in self.waiting:
            yield None
            return
        self.waiting[key] = asyncio.Queue()
        try:
            yield self.waiting[key]
        finally:
            del self.waiting[key]

    async def upload(self, drone: int, items: list[tuple[int, float, float, float]]) -> str:
        """Upload a mission; how it ended."""
        with self.answers("mission", drone) as queue:
            if queue is None:
                return "busy"
            first = [(mavlink.MAV_CMD_NAV_WAYPOINT, *HOME)] if self.is_ardupilot else []
            whole = [*first, *items]
            for _ in range(3):
                self.send(mavlink.MAVLink_mission_count_message(drone, 1, len(whole)))
                try:
                    while True:
                        m = await asyncio.wait_for(queue.get(), FILE_LIMIT)
                        if m.get_type() == "MISSION_ACK":
                            return f"type {m.type}"
                        command, lat, lon, up = whole[m.seq]
                        place = (round(lat * 1e7), round(lon * 1e7), up)
                        frame = 0 if up == HOME[2] else 6
                        self.send(mavlink.MAVLink_mission_item_int_message(
                            drone, 1, m.seq, frame, command, 0, 1, 0, 0, 0, NAN, *place, 0))  # fmt: skip
                except asyncio.TimeoutError:
                    continue
        return "no answer"

    async def ask_file(
        self, drone: int, queue: asyncio.Queue[Any], seq: int, opcode: int, data: bytes, **more: int
    ) -> bytes:
        """Send a file request until it is answered; the answer's payload, empty without one."""
        size = more.get("size", len(data))
        header = struct.pack("<HBBBBBBI", seq, more.get("session", 0), opcode, size, 0, 0, 0, more.get("offset", 0))
        for _ in range(4):
            self.send(
                mavlink.MAVLink_file_transfer_protocol_message(0, drone, 1, list((header + data).ljust(251, b"\0")))
            )
            end = time.monotonic() + FILE_LIMIT
            while (left := end - time.monotonic()) > 0:
                try:
                    m = await asyncio.wait_for(queue.get(), left)
                except asyncio.TimeoutError:
                    break
                payload = bytes(m.payload)
                if payload[:2] == struct.pack("<H", seq + 1 & 0xFFFF):
                    return payload
        return b""

    async def read_files(self, drone: int, chance: random.Random) -> str:
        """List the drone's media, and read the beginning of a file of the gateway; how it ended."""
        listing, opening, reading, ending = 3, 4, 5, 1
        with self.answers("file", drone) as queue:
            if queue is None:
                return "busy"
            seq = chance.randrange(1 << 15) * 2
            for path in ("/media", "/"):
                if not await self.ask_file(drone, queue, seq, listing, path.encode()):
                    return "no answer"
                seq = seq + 2 & 0xFFFF
            opened = await self.ask_file(drone, queue, seq, opening, b"@PARAM/param.pck")
            if not opened or opened[3] != 128:
                return "refused" if opened else "no answer"
            session, answered = opened[2], True
            for part in range(chance.randrange(1, 8)):
                seq = seq + 2 & 0xFFFF
                answered = answered and bool(
                    await self.ask_file(drone, queue, seq, reading, b"", session=session, size=239, offset=239 * part)
                )
            if chance.random() < 0.2:
                return "left open"  # as a client that ends in the middle
            seq = seq + 2 & 0xFFFF
            answered = answered and bool(await self.ask_file(drone, queue, seq, ending, b"", session=session))
            return "read" if answered else "no answer"


# -- the whole


def near(chance: random.Random, height: float) -> tuple[float, float, float]:
    """A place within 25 m of home."""
    return HOME[0] + chance.uniform(-2e-4, 2e-4), HOME[1] + chance.uniform(-3e-4, 3e-4), height


class Endurance:
    """One run."""

    def __init__(self, seed: int, minutes: float, drones: int, folder: Path, keeps_logs: bool = False) -> None:
        self.chance = random.Random(seed)
        self.minutes, self.drones, self.folder = minutes, drones, folder
        self.keeps_logs, self._starts = keeps_logs, 0
        self.host = loopback()
        self.log = (folder / "clients.jsonl").open("w") if keeps_logs else None
        self.network = loopback().rpartition(".")[0]
        self.clients = [BenchClient(self.host, number, self.log) for number in range(len(PORTS))]
        self.running = asyncio.Event()
        self.cuts: list[tuple[float, float, int]] = []
        """(begin, end, drone) in monotonic time, crashes included."""
        self.wrong: list[str] = []
        self.tally: Counter[str] = Counter()
        self.simulators: list[asyncio.subprocess.Process | None] = [None] * GROUPS
        self.reports: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._steps: set[asyncio.Task[None]] = set()
        self._phase_ends = time.monotonic() + 60.0 * minutes * PHASES[0]
        self._crash: asyncio.Task[None] | None = None
        self.gateway: asyncio.subprocess.Process | None = None

    def group(self, index: int) -> list[int]:
        return [drone for drone in range(1, self.drones + 1) if drone % GROUPS == index]

    def address(self, drone: int) -> str:
        return f"{self.network}.{drone}"

    async def start_simulator(self, index: int) -> None:
        """Start a group of drones, with cuts of their links until the next rest."""
        steps: list[dict[str, Any]] = [{"at": 0, "battery": 90}]
        begun, until = time.monotonic(), self._phase_ends - CUT_LIMIT
        for drone in self.group(index):
            at = self.chance.expovariate(1.0 / CUT_EVERY) + 5.0
            while begun + at < until:
                long = self.chance.choice([self.chance.uniform(0.3, 2.0), self.chance.uniform(2.0, CUT_LIMIT)])
                steps.append({"at": round(at, 2), "for": round(long, 2), "drone": self.address(drone), "silence": True})
                self.cuts.append((begun + at, begun + at + long, drone))
                at += long + self.chance.expovariate(1.0 / CUT_EVERY) + 1.0
        scenario, fleet = self.folder / f"{index}.yaml", self.folder / f"{index}.json"
        scenario.write_text(yaml.safe_dump({"steps": steps}))
        spec = [
            {"address": self.address(drone), "http_port": 8080, "rtsp_port": None, "home": HOME, "name": f"D{drone}"}
            for drone in self.group(index)
        ]
        scenarios = {self.address(drone): str(scenario) for drone in self.group(index)}
        fleet.write_text(json.dumps({"drones": spec, "scenarios": scenarios}))
        self.simulators[index] = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "anafi_mav", "sim", "--fleet", str(fleet)), *self._sim_log(index),
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip
        assert process.stdout is not None
        while not (line := await process.stdout.readline()).startswith(b"ready"):
            if not line:
                raise SystemExit("a simulator ended before it was ready")

    def _sim_log(self, index: int) -> tuple[str, ...]:
        """Return the option for the simulator's log, each start with a file of its own, in a run that is kept."""
        if not self.keeps_logs:
            return ()
        self._starts += 1
        return "--log", str(self.folder / f"sim{index}-{self._starts}-{time.monotonic():.0f}.jsonl")

    async def crash(self, index: int) -> None:
        """Kill a group of drones as a power cut does, and start it again."""
        process = self.simulators[index]
        assert process is not None
        begun = time.monotonic()
        process.kill()
        await process.wait()
        await asyncio.sleep(self.chance.uniform(0.5, 8.0))
        # The cuts that were to come have ended with it.
        self.cuts = [cut for cut in self.cuts if cut[2] % GROUPS != index or cut[0] < begun]
        await self.start_simulator(index)
        ended = time.monotonic() + 8.0  # the gateway tries again every 0.5 to 2 s, and asks for all states
        self.cuts += [(begun, ended, drone) for drone in self.group(index)]
        self.tally["simulators killed"] += 1

    # -- steps

    async def fly(self, client: BenchClient) -> None:
        """Random steps of one client, whenever the run is not at rest."""
        chance = random.Random(self.chance.random())
        next_drop = time.monotonic() + chance.expovariate(1.0 / DROP_EVERY)
        while True:
            await self.running.wait()
            if time.monotonic() > next_drop:
                next_drop = time.monotonic() + chance.expovariate(1.0 / DROP_EVERY)
                self.tally["connections lost by clients"] += 1
                await client.drop(chance.uniform(0.2, 3.0))
                continue
            self.step(client, chance)
            await asyncio.sleep(chance.uniform(*GAP))

    def step(self, client: BenchClient, chance: random.Random) -> None:
        drone = chance.randint(1, self.drones)
        kind = chance.choice(list(STEPS))
        self.tally[kind] += 1
        STEPS[kind](self, client, drone, chance)

    def spawn(self, kind: str, work: Any) -> None:
        async def run() -> None:
            self.tally[f"{kind}: {await work}"] += 1

        task = asyncio.create_task(run())
        self._steps.add(task)
        task.add_done_callback(self._steps.discard)

    def take_off(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        client.command(drone, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        height = chance.uniform(2.0, 6.0)
        # The height of PX4's clients is above mean sea level.
        up = height if client.is_ardupilot else HOME[2] + height
        client.command(drone, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, up)

    def go_to(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        place = near(chance, chance.uniform(2.0, 15.0))
        client.place_command(drone, mavlink.MAV_CMD_DO_REPOSITION, (-1, 1, 0, NAN), place)

    def orbit(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        up = 8.0 if client.is_ardupilot else HOME[2] + 8.0
        client.place_command(drone, mavlink.MAV_CMD_DO_ORBIT, (10.0, 2.0, 0, 0), near(chance, up))

    def mode(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        if client.is_ardupilot:
            client.command(drone, mavlink.MAV_CMD_DO_SET_MODE, 1, chance.choice([17, 5, 3, 6, 9]))
        else:
            client.command(
                drone, mavlink.MAV_CMD_DO_SET_MODE, 1, *chance.choice([(4, 3), (3, 0), (4, 4), (4, 5), (4, 6)])
            )

    def setpoints(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        velocity = [chance.uniform(-3.0, 3.0), chance.uniform(-3.0, 3.0), 0.0]

        async def send() -> str:
            for _ in range(20):
                client.send(mavlink.MAVLink_set_position_target_local_ned_message(
                    0, drone, 1, 1, 0b0000_1101_1100_0111, 0, 0, 0, *velocity, 0, 0, 0, 0, 0))  # fmt: skip
                await asyncio.sleep(0.1)
            return "sent"

        self.spawn("setpoints", send())

    def mission(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        items = [(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 5.0)]
        items += [(mavlink.MAV_CMD_NAV_WAYPOINT, *near(chance, 6.0)) for _ in range(chance.randint(2, 30))]
        items.append((mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, 0.0, 0.0))
        self.spawn("mission", client.upload(drone, items))

    def files(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        self.spawn("files", client.read_files(drone, random.Random(chance.random())))

    def parameters(self, client: BenchClient, drone: int, chance: random.Random) -> None:
        client.send(mavlink.MAVLink_param_request_list_message(drone, 1))

    # -- rest

    async def rest(self) -> dict[str, Any]:
        """Land everything, wait until nothing is open, and return what the gateway's process holds then."""
        self.running.clear()
        end = time.monotonic() + REST_LIMIT
        pilot = self.clients[0]
        while time.monotonic() < end:
            await asyncio.sleep(2.0)  # other processes work
            flying = [drone for drone in range(1, self.drones + 1) if pilot.armed.get(drone, True)]
            for drone in flying:
                pilot.land(drone)
            if not flying and not self._steps and not self._open():
                break
        else:
            states = [f"{drone} ({pilot.states.get(drone)}, {self._landings(drone)})" for drone in flying]
            self.wrong.append(f"no rest within {REST_LIMIT:g} s: armed {states}, open {self._open()}")
        await asyncio.sleep(35.0)  # beyond the idle limit of UDP clients that a lost connection has left
        assert self.gateway is not None
        self.gateway.send_signal(signal.SIGUSR1)
        return await asyncio.wait_for(self.reports.get(), 10.0)

    def _landings(self, drone: int) -> str:
        """Return the results of the last commands to land, and the last texts of a drone."""
        pilot = self.clients[0]
        results = [
            one.results[0][1] if one.results else None for one in pilot.commands[drone, mavlink.MAV_CMD_NAV_LAND]
        ]
        texts = [text for _, system, text in pilot.texts if system == drone]
        return f"land {results[-5:]} of {len(results)}, {texts[-4:]}"

    def _open(self) -> list[str]:
        """Commands without a final result, whose limit has not passed."""
        now = time.monotonic()
        return [
            f"{one.command} of client {client.number} to drone {one.drone}"
            for client in self.clients
            for sent in client.commands.values()
            for one in sent
            if one.is_open(now)
        ]

    async def run(self) -> bool:
        """Run it; True when nothing is wrong."""
        config, errors = self.folder / "fleet.yaml", self.folder / "stderr"
        drones = [
            {"name": f"d{drone}", "sysid": drone, "address": self.address(drone), "http_port": 8080}
            for drone in range(1, self.drones + 1)
        ]
        endpoints = [
            f"{kind}://{self.host}:{port}{'?flavour=ardupilot' if number % 2 else ''}"
            for number, (kind, port) in enumerate(zip(URLS, PORTS, strict=True))
        ]
        config.write_text(
            yaml.safe_dump(
                {"endpoints": endpoints, "drones": drones, "video": False, "state": str(self.folder / "state")}
            )
        )
        out, into = os.pipe()
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader()
        await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(out, "rb"))

        async def read_reports() -> None:
            while line := await reader.readline():
                self.reports.put_nowait(json.loads(line))

        work = [asyncio.create_task(read_reports())]
        await asyncio.gather(*(self.start_simulator(index) for index in range(GROUPS)))
        with errors.open("wb") as complaints:
            self.gateway = await asyncio.create_subprocess_exec(
                *(sys.executable, __file__, "gateway", "run", "-c", str(config), *(["-v"] if self.keeps_logs else [])),
                stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=complaints,
                env={**os.environ, "ENDURANCE_REPORT": str(into), "PYTHONPATH": str(ROOT)}, pass_fds=(into,),
            )  # fmt: skip
        os.close(into)
        assert self.gateway.stdout is not None
        while not (line := await self.gateway.stdout.readline()).startswith(b"ready"):
            if not line:
                raise SystemExit(f"the gateway ended before it was ready: {errors.read_text()[-2000:]}")
        try:
            for client in self.clients:
                await client.connect()
            work += [asyncio.create_task(self.fly(client)) for client in self.clients]
            work.append(asyncio.create_task(self._crashes()))
            held: list[dict[str, Any]] = []
            spent = 0.0
            for share in PHASES:
                self._phase_ends = time.monotonic() + 60.0 * self.minutes * share
                if held:
                    await asyncio.gather(*(self.crash(index) for index in range(GROUPS)))
                self.running.set()
                await asyncio.sleep(max(0.0, self._phase_ends - time.monotonic()))
                if self._crash is not None:
                    await self._crash
                held.append(await self.rest())
                spent += self.minutes * share
                tasks, files = held[-1]["tasks"], held[-1]["files"]
                counts = f"{sum(tasks.values())} tasks, {sum(files.values())} files"
                print(f"after {spent:.1f} min: {held[-1]['mebibytes']:.1f} MiB, {counts}: {tasks} {files}", flush=True)
            self.judge(held, errors.read_text(errors="replace"))
        finally:
            for task in work:
                task.cancel()
            for process in (self.gateway, *self.simulators):
                if process is not None and process.returncode is None:
                    process.terminate()
                    await process.wait()
        return not self.wrong

    async def _crashes(self) -> None:
        while True:
            await self.running.wait()
            await asyncio.sleep(self.chance.expovariate(1.0 / CRASH_EVERY))
            if self.running.is_set() and self._phase_ends - time.monotonic() > 20.0:
                self._crash = asyncio.create_task(self.crash(self.chance.randrange(GROUPS)))
                await self._crash

    # -- judgement

    def judge(self, held: list[dict[str, Any]], errors: str) -> None:
        early, third, end = held
        ratio = end["mebibytes"] / third["mebibytes"]
        print(f"memory: {third['mebibytes']:.1f} -> {end['mebibytes']:.1f} MiB, ratio {ratio:.3f}")
        if ratio > MEMORY_LIMIT:
            self.wrong.append(f"memory grew by {ratio - 1.0:.1%}")
        for what in ("tasks", "files"):
            if early[what] != end[what]:
                before, after = Counter(early[what]), Counter(end[what])
                self.wrong.append(f"{what}: more {dict(after - before)}, fewer {dict(before - after)}")
        results: Counter[int] = Counter()
        total = absent = left = 0
        for client in self.clients:
            self.wrong += client.unexpected[:10]
            for one in [one for sent in client.commands.values() for one in sent]:
                total += 1
                left += one.is_abandoned
                if one.repeated or not (one.results or one.is_abandoned):
                    if one.command in QUERIES and self._is_absent(client, one):
                        absent += 1
                    else:
                        again = f", sent {one.repeated} times more" if one.repeated else ""
                        what = f"{one.command} of client {client.number} to drone {one.drone}{self._when(one)}"
                        self.wrong.append(f"no result: {what}{again}")
                if not one.results:
                    continue
                at, result = one.results[0]
                results[result] += 1
                if result == mavlink.MAV_RESULT_FAILED and self._cut(one, at) and not self._text(client, one.drone, at):
                    self.wrong.append(
                        f"FAILED without text: {one.command} of client {client.number}, drone {one.drone}"
                    )
            if URLS[client.number] == "udpin" and (lost := lost_datagrams(self.host, client.port)):
                self.wrong.append(f"void: this computer lost {lost} datagrams of client {client.number}")
            if lost := client.count_lost():
                self.wrong.append(f"void: this computer lost {lost} datagrams for client {client.number}")
        self._judge_take_offs()
        names = {getattr(enums, name): name[11:] for name in dir(enums) if name.startswith("MAV_RESULT_")}
        named = {names[key]: count for key, count in results.most_common()}
        print(
            f"{total} commands, {left} of them left by clients that lost their connection, "
            f"{absent} queries to an absent drone; results {named}; {len(self.cuts)} cuts"
        )
        print(f"steps: {dict(sorted(self.tally.items()))}")
        if "Traceback" in errors:
            self.wrong.append(f"traceback: {errors[errors.index('Traceback') :][:2000]}")
        assert self.gateway is not None
        if self.gateway.returncode is not None:
            self.wrong.append(f"the gateway ended with status {self.gateway.returncode}")

    def _judge_take_offs(self) -> None:
        """Count the take-offs of each family of clients: one whose take-offs are all refused tests little."""
        for family, is_ardupilot in (("PX4", False), ("ArduPilot", True)):
            ends = [
                one.results[0][1]
                for client in self.clients
                if client.is_ardupilot is is_ardupilot
                for (_, command), sent in client.commands.items()
                if command == mavlink.MAV_CMD_NAV_TAKEOFF
                for one in sent
                if one.results
            ]
            accepted = ends.count(mavlink.MAV_RESULT_ACCEPTED)
            print(f"take-offs of {family}'s clients: {accepted} of {len(ends)} accepted")
            if not accepted:
                self.wrong.append(f"no take-off of {family}'s clients was accepted")

    def _cut(self, one: Commanded, at: float) -> bool:
        """Whether the drone was silent between a command and its result."""
        return any(drone == one.drone and begin < at and one.at < end + SILENT_AFTER for begin, end, drone in self.cuts)

    def _is_absent(self, client: BenchClient, one: Commanded) -> bool:
        """Whether a command was sent to a drone that was not connected, by its cuts or by its heartbeats."""
        return any(begin <= one.at <= end for begin, end in client.gaps[one.drone]) or any(
            drone == one.drone and begin + SILENT_FOR <= one.at <= end + RECONNECTED_AFTER
            for begin, end, drone in self.cuts
        )

    def _when(self, one: Commanded) -> str:
        """When a command was sent in terms of the cut of its drone's link, if there was one."""
        near = [(one.at - begin, end - begin) for begin, end, drone in self.cuts
                if drone == one.drone and begin - SILENT_AFTER < one.at < end + SILENT_AFTER]  # fmt: skip
        return "".join(f", {after:.1f} s into a silence of {length:.1f} s" for after, length in near)

    def _text(self, client: BenchClient, drone: int, at: float) -> bool:
        return any(system == drone and abs(when - at) < TEXT_WITHIN for when, system, _ in client.texts)


Step = Callable[[Endurance, BenchClient, int, random.Random], None]


def simple(command: int, *params: float, component: int = 1) -> Step:
    return lambda run, client, drone, chance: client.command(drone, command, *params, component=component)


STEPS: dict[str, Step] = {
    "take-off": Endurance.take_off,
    "take-off again": Endurance.take_off,
    "go to": Endurance.go_to,
    "go to elsewhere": Endurance.go_to,
    "orbit": Endurance.orbit,
    "mode": Endurance.mode,
    "setpoints": Endurance.setpoints,
    "mission": Endurance.mission,
    "mission start": simple(mavlink.MAV_CMD_MISSION_START),
    "files": Endurance.files,
    "parameters": Endurance.parameters,
    "land": simple(mavlink.MAV_CMD_NAV_LAND),
    "return": simple(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    "pause": simple(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0),
    "continue": simple(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1),
    "photo": simple(mavlink.MAV_CMD_IMAGE_START_CAPTURE, 0, 0, 1, 0, component=100),
    "record": simple(mavlink.MAV_CMD_VIDEO_START_CAPTURE, 0, 0, component=100),
    "record end": simple(mavlink.MAV_CMD_VIDEO_STOP_CAPTURE, 0, component=100),
    "zoom": simple(mavlink.MAV_CMD_SET_CAMERA_ZOOM, 1, 2, component=100),
    "message": simple(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
    "unknown": simple(mavlink.MAV_CMD_USER_1),
}
"""Kinds of steps, each as likely as another."""


def main() -> int:
    if sys.argv[1:2] == ["gateway"]:
        gateway(sys.argv[2:])
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--minutes", type=float, default=30.0)
    options.add_argument("--drones", type=int, default=20)
    options.add_argument("--seed", type=int, default=None)
    options.add_argument("--keep", type=Path, help="write the logs of clients, simulators and gateway to this folder")
    given = options.parse_args()
    seed = random.SystemRandom().randrange(10**6, 10**9) if given.seed is None else given.seed
    print(f"{machine()}; seed {seed}, {given.minutes:g} min, {given.drones} drones, {len(PORTS)} clients", flush=True)
    with tempfile.TemporaryDirectory() if given.keep is None else contextlib.nullcontext(given.keep) as folder:
        Path(folder).mkdir(parents=True, exist_ok=True)

        async def whole() -> bool:
            task = asyncio.current_task()
            assert task is not None
            asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
            run = Endurance(seed, given.minutes, given.drones, Path(folder), given.keep is not None)
            good = await run.run()
            for text, count in Counter(run.wrong).most_common(30):
                print(f"WRONG: {count} × {text}")
            return good

        good = asyncio.run(whole())
    print("nothing wrong" if good else "something is wrong")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

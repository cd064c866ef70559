"""Rounds of random flight that also change what a flight depends on, judged by the drone's log and by read-backs.

    python tests/bench/explorer.py                         # 50 rounds from a printed seed
    python tests/bench/explorer.py --seed 4711 --rounds 1  # one round once more
    python tests/bench/explorer.py --seed 4711 --rounds 1 -v  # with what was sent, answered and flown

Beside the steps of `support.soak`: missions as files over MAVLink FTP, partial and abandoned uploads, fences and rally
points in flight, home, speeds, parameters, the battery, a client that is killed, and a gateway that is restarted. At
the end each client reads the lists and parameters back.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import math
import os
import random
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from support import clock

clock.install()

from pymavlink.dialects.v20 import ardupilotmega as dialect  # noqa: E402 (the clock comes first)
from support import flavours, soak  # noqa: E402
from support.fault_scenarios import watched  # noqa: E402
from support.ftp import ACK, TERMINATE, Ftp  # noqa: E402
from support.missions import RTL, takeoff, way  # noqa: E402
from support.params import read, send_set, value_of  # noqa: E402
from support.plans import (  # noqa: E402  # noqa: E402
    ACCEPTED,
    FENCE,
    MISSION,
    RALLY,
    Item,
    content,
    download,
    rally,
    send_count,
    send_item,
    square,
    upload,
)
from support.soak import Draw, Flight, Step, now  # noqa: E402
from support.world import HOME, VIDEO_PORT, WEB_PORT, World, loopback  # noqa: E402

from anafi_mav import geo  # noqa: E402
from anafi_mav.arsdk.link import watchdog  # noqa: E402
from anafi_mav.config import Config, DroneConfig, HttpConfig  # noqa: E402
from anafi_mav.gateway import Gateway  # noqa: E402
from anafi_mav.services.plan.plan_files import PATHS  # noqa: E402
from anafi_mav.sim import DroneSpec, Simulator  # noqa: E402
from anafi_mav.sim.autopilot import power  # noqa: E402
from anafi_mav.sim.world.faults import CLEAR  # noqa: E402
from anafi_mav.sim.world.quirks import Quirk  # noqa: E402

watchdog.LIMIT = None

QUIRKS = [quirk.value for quirk in Quirk if quirk not in (Quirk.GPS_LOCATION_STOPS, Quirk.ROLL_INVERTED)]
"""Those that do not refuse the steps."""

CREATE, WRITE = 6, 7
SAME_AS_BEFORE = 5.0
"""s before a command in which the drone may have begun what it wants already."""

BRAKES_WITHIN = 3.0
"""s after an accepted Hold."""

OUTSIDE = 2.0 * soak.SPEED
"""m beyond the fence that count as left: the drone flies `soak.SPEED` times as far while its reports are under way."""

CONNECTED_WITHIN = 20.0
"""s after a restart of the gateway: the drone may refuse its handshake for 8 s."""

FEWEST_EVERY = 0.5
"""s between positions that are a stream, at most (docs/setpoints.md)."""

SETTINGS: dict[str, tuple[float, float, int]] = {
    "ANF_RTH_ALT": (20.0, 60.0, 9),
    "ANF_MAX_TILT": (8.0, 35.0, 9),
    "ANF_YAW_RATE": (20.0, 150.0, 9),
    "ANF_CRUISE_SPEED": (0.5, 10.0, 9),
    "ANF_CLIMB_SPEED": (0.5, 4.0, 9),
    "ANF_YAW_MODE": (0.0, 2.0, 6),
    "ANF_RTL_END": (0.0, 1.0, 6),
    "ANF_MAX_ALT": (15.0, 100.0, 9),
    "ANF_RTL_TYPE": (0.0, 5.0, 6),
    "ANF_GUIDED_T": (0.5, 1.5, 9),
    "ANF_FENCE_ACTION": (1.0, 5.0, 6),
}
"""Range and MAV_PARAM_TYPE of the parameters that steps write."""

WEIGHTS = {
    "ftp": 3,
    "partial": 2,
    "abandon": 2,
    "clear": 1,
    "fence": 3,
    "fence_off": 1,
    "rally": 1,
    "home": 3,
    "speed": 2,
    "param": 4,
    "current": 2,
    "yaw": 1,
    "rc": 2,
    "low": 1,
    "empty": 0.3,
    "kill": 3,
    "restart_gateway": 0.5,
}


@dataclass
class Explored(Flight):
    """A round with further steps."""

    gateway: Any = None
    killed: list[tuple[int, float, float]] = field(default_factory=list)
    """Client, time of its end, time of its return."""
    restarts: list[tuple[float, float]] = field(default_factory=list)
    fences: list[tuple[float, float]] = field(default_factory=list)
    """Time and half side of each accepted fence; 0 none."""
    own: dict[int, list[asyncio.Task[None]]] = field(default_factory=dict)
    lists: dict[int, list[tuple[float, str, Any]]] = field(default_factory=dict)
    busy: set[int] = field(default_factory=set)
    battery: bool = False
    reacts_otherwise: bool = False
    """True when the action at the fence was changed, perhaps to a text alone."""

    async def _watch(self) -> None:
        while not self.w.gateway.systems or len(flying := soak.pilots(self.w)) < 2:
            await watched(soak.WATCH_EVERY)  # samples of what flies; without a system while the gateway restarts
        self.wrong.append(f"two pilots: {', '.join(flying)}")

    def spawn_of(self, index: int, work: Any) -> None:
        before = set(self._tasks)
        self.spawn(work)
        self.own.setdefault(index, []).extend(self._tasks - before)

    def stream(self, index: int, *args: Any, **more: Any) -> None:
        before = set(self._tasks)
        super().stream(index, *args, **more)
        self.own.setdefault(index, []).extend(self._tasks - before)

    def gaps(self) -> list[tuple[float, float]]:
        found = []
        for index, client in enumerate(self.w.clients[: len(self.drawn.flavours)]):
            if index in self.dead:
                continue
            times = [at for at, m in client.since(0, "HEARTBEAT") if m.get_srcComponent() == 1]
            found += [(a, b) for a, b in itertools.pairwise(times) if b - a > 1.6]
        return [*found, *((a - 25.0, b) for a, b in self.restarts)]

    @property
    def dead(self) -> set[int]:
        """Clients that were killed at any time: what they would have received is unknown."""
        return {index for index, _, _ in self.killed}

    def unanswered(self) -> list[soak.Sent]:
        return [s for s in super().unanswered() if s.client not in self.dead]

    async def step(self, step: Step) -> None:
        n, (first, second, third) = step.client, step.args
        if self.is_dead(n):
            return
        copter = self.flavour(n) == "ardupilot"
        client = self.client(n)
        place = geo.destination(*HOME[:2], first, second)
        height = 3.0 + 4.0 * third
        match step.kind:
            case "ftp":
                if copter and n not in self.busy:
                    self.spawn_of(n, self._ftp(n, self._mission(first, second, height, copter)))
            case "partial":
                self.spawn_of(n, self._partial(n, first, second, height))
            case "abandon":
                send_count(client, 5, MISSION if first > 0 else FENCE)
            case "clear":
                client.send(dialect.MAVLink_mission_clear_all_message(1, 1, MISSION))
            case "fence":
                self.spawn_of(n, self._fence(n, 12.0 + 8.0 * third))
            case "fence_off":
                self.command(n, dialect.MAV_CMD_DO_FENCE_ENABLE, float(first > 0))
                self.fences.append((now(), 0.0))
            case "rally":
                self.spawn_of(n, self._rally(n, place, 20.0))
            case "home":
                if first > 0:
                    self.command(n, dialect.MAV_CMD_DO_SET_HOME, 1.0)
                else:
                    self.command(n, dialect.MAV_CMD_DO_SET_HOME, 0.0, frame=0, x=place[0], y=place[1], z=HOME[2])
            case "speed":
                self.command(n, dialect.MAV_CMD_DO_CHANGE_SPEED, 1.0 if first > 0 else 2.0, 0.5 + third, -1.0)
            case "param":
                names = list(SETTINGS)
                name = names[int(abs(first * 1000.0)) % len(names)]
                low, high, kind = SETTINGS[name]
                value = low + (high - low) * abs(second) / 30.0
                if kind == 6:
                    value = round(value)
                if name == "ANF_FENCE_ACTION":
                    self.reacts_otherwise = True
                    self.fences.append((now(), 0.0))
                send_set(client, name, value, kind, self.flavour(n))
            case "current":
                client.send(dialect.MAVLink_mission_set_current_message(1, 1, int(abs(first)) % 3 + copter))
            case "yaw":
                self.command(n, dialect.MAV_CMD_CONDITION_YAW, abs(first) * 6.0, 0.0, 1.0, float(second > 0))
            case "rc":
                if second > 0.0:
                    self.mode(n, "position")
                channels = [1500 + int(first * 10), 1500 + int(second * 10), 1500, 1500, *[65535] * 4]
                self.stream(n, dialect.MAVLink_rc_channels_override_message(1, 1, *channels), third, lasts=soak.SILENCE)
            case "low":
                self.battery = True
                firmware = self.w.drone.firmware
                needed = firmware.endurance.needed(self.w.drone.pose, (0.0, 0.0)) if firmware.homing.home else None
                if needed is not None:
                    firmware.battery.charge = power.CRITICAL + needed
            case "empty":
                self.battery = True
                self.w.drone.firmware.battery.charge = float(power.EMPTY)
            case "kill":
                self._kill(n, third)
            case "restart_gateway":
                await self._restart()
            case _:
                before = set(self._tasks)
                await super().step(step)
                self.own.setdefault(n, []).extend(self._tasks - before)

    def is_dead(self, index: int) -> bool:
        return any(i == index and at <= now() < back for i, at, back in self.killed)

    def _kill(self, index: int, seconds: float) -> None:
        client = self.client(index)
        for task in self.own.pop(index, []):
            task.cancel()
            self._tasks.discard(task)
        for stream in self.streams:
            if stream.client == index and now() < stream.ended:
                stream.ended = now()
                if self.drawn.flavours[index] == "ardupilot" and now() - stream.begun < FEWEST_EVERY:
                    stream.place = None  # a single position in Guided is a goto, which is flown to its end
        assert client._writer is not None
        client._writer.transport.abort()
        entry = (index, now(), now() + seconds)
        self.killed.append(entry)
        self.busy.discard(index)

        async def back() -> None:
            await asyncio.sleep(seconds)
            while True:
                try:
                    await client.connect(self.port(index), self.w.address)
                    return
                except OSError:
                    await asyncio.sleep(0.3)

        self.spawn(back())

    def port(self, index: int) -> int:
        return 5760 if self.flavour(index) == self.drawn.flavours[0] else 5761

    async def _restart(self) -> None:
        """End the gateway and start another one; the clients connect again."""
        begun = now()
        for index in range(len(self.drawn.flavours)):
            for task in self.own.pop(index, []):
                task.cancel()
                self._tasks.discard(task)
        for stream in self.streams:
            stream.ended = min(stream.ended, now())
        await self.gateway.replace()
        self.w.gateway = self.gateway.now
        for index in range(len(self.drawn.flavours)):
            client = self.client(index)
            if client._task is not None:
                client._task.cancel()
            await client.connect(self.port(index), self.w.address)
        self.restarts.append((begun, now()))

    # Uploads.

    def _mission(self, first: float, second: float, height: float, copter: bool) -> list[Item]:
        items = [takeoff(height), way(first, second, height), way(second, first, height + 1.0), RTL]
        return [Item(dialect.MAV_CMD_NAV_WAYPOINT, *HOME), *items] if copter else items

    async def _ftp(self, index: int, items: Sequence[Item]) -> None:
        self.busy.add(index)
        rows = [
            struct.pack(
                "<ffffiifHHBBBBBB", i.p1, i.p2, i.p3, i.p4, *i.content[6:8], i.z,
                seq, i.command, 1, 1, i.frame, 0, 1, MISSION,
            )
            for seq, i in enumerate(items)
        ]  # fmt: skip
        data = struct.pack("<HHHHH", 0x763D, MISSION, 0, 0, len(items)) + b"".join(rows)
        ftp = Ftp(self.client(index))
        try:
            opened = await ftp.ask(CREATE, PATHS[MISSION].encode())
            if opened.opcode == ACK:
                for offset in range(0, len(data), 200):
                    part = await ftp.ask(WRITE, data[offset : offset + 200], offset=offset, session=opened.session)
                    if part.opcode != ACK:
                        break
                end = await ftp.ask(TERMINATE, session=opened.session)
                self.note(MISSION, index, items if end.opcode == ACK else None)
        except AssertionError as error:
            if not self.gaps():
                self.wrong.append(f"FTP upload of client {index} has no end: {str(error)[:80]}")
        finally:
            self.busy.discard(index)

    def note(self, kind: int, index: int, items: Sequence[Item] | None) -> None:
        self.lists.setdefault(kind, []).append((now(), str(index), items))

    async def _partial(self, index: int, first: float, second: float, height: float) -> None:
        client = self.client(index)
        mark = client.mark()
        client.send(dialect.MAVLink_mission_write_partial_list_message(1, 1, 2, 2, MISSION))
        items = {2: way(first, second, height)}
        try:
            while True:
                m = await client.wait(
                    ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"),
                    lambda m: m.mission_type == MISSION,
                    since=mark,
                    timeout=10.0,
                )
                mark = next(i for i in range(mark, client.mark()) if client.received[i][1] is m) + 1
                if m.get_type() == "MISSION_ACK":
                    return
                if m.seq != 2:
                    return
                send_item(client, items[2], 2, MISSION)
        except AssertionError as error:
            if not self.gaps():
                self.wrong.append(f"partial upload of client {index} has no end: {str(error)[:80]}")

    async def _fence(self, index: int, half: float) -> None:
        if await self._put(index, FENCE, square(HOME[:2], half)) and not self.reacts_otherwise:
            self.fences.append((now(), half))

    async def _rally(self, index: int, place: tuple[float, float], height: float) -> None:
        await self._put(index, RALLY, [rally(place, height)])

    async def _put(self, index: int, kind: int, items: Sequence[Item]) -> bool:
        """Upload a list; return True when it is accepted."""
        try:
            ack = await upload(self.client(index), items, kind, timeout=10.0)
        except AssertionError as error:
            if not self.gaps():
                self.wrong.append(f"upload {kind} of client {index} has no end: {str(error)[:80]}")
            return False
        if ack.type == ACCEPTED:
            self.note(kind, index, items)
        return bool(ack.type == ACCEPTED)

    # End.

    async def read_back(self) -> None:
        """All clients read the same lists and values, and the values are the drone's."""
        w = self.w
        for index in range(len(self.drawn.flavours)):
            await self.client(index).heartbeat(lambda beat: True, timeout=CONNECTED_WITHIN)
        for kind in (MISSION, FENCE, RALLY):
            found = []
            for index, flavour in enumerate(self.drawn.flavours):
                try:
                    items = await download(self.client(index), kind)
                except AssertionError as error:
                    self.wrong.append(f"list {kind} of client {index} is not read: {str(error)[:100]}")
                    return
                shown = [content(m)[:1] + content(m)[6:] for m in items]
                found.append(shown[1:] if kind == MISSION and flavour == "ardupilot" else shown)
            if any(one != found[0] for one in found):
                self.wrong.append(f"list {kind} differs between clients: {found}")
        home = w.drone.firmware.homing.home
        for index in range(len(self.drawn.flavours)):
            client = self.client(index)
            mark = client.mark()
            ack = await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_HOME_POSITION)
            if ack.result == dialect.MAV_RESULT_ACCEPTED and home is not None:
                shown = await client.wait("HOME_POSITION", since=mark)
                apart = math.dist((shown.latitude / 1e7, shown.longitude / 1e7), home[:2]) * 111_195.0
                if apart > 2.0:
                    self.wrong.append(f"HOME_POSITION of client {index} is {apart:.0f} m from the drone's home")
        for name in SETTINGS:
            values = set()
            for index, flavour in enumerate(self.drawn.flavours):
                try:
                    values.add(round(value_of(await read(self.client(index), name), flavour), 3))
                except AssertionError:
                    self.wrong.append(f"{name} is not read by client {index}")
            settings = w.drone.firmware.settings
            truth = {
                "ANF_RTH_ALT": "rth_min_altitude",
                "ANF_MAX_TILT": "max_tilt",
                "ANF_YAW_RATE": "max_rotation_speed",
                "ANF_MAX_ALT": "max_altitude",
            }.get(name)
            if len(values) != 1:
                self.wrong.append(f"{name} differs between clients: {values}")
            elif truth is not None:
                try:
                    real = settings.number(truth)
                except KeyError:
                    continue
                if abs(real - next(iter(values))) > 0.01:
                    self.wrong.append(f"{name} is read as {values}, drone has {real}")


def draw(seed: int, steps: int, only: Sequence[str] = ()) -> Draw:
    chance = random.Random(seed ^ 0x5EED)
    drawn = soak.draw(seed, steps)
    kinds, weights = list(WEIGHTS), list(WEIGHTS.values())
    mixed = []
    for step in drawn.steps:
        if chance.random() < 0.5:
            kind = chance.choices(kinds, weights)[0]
            gap = chance.choice([0.0, 0.05, chance.uniform(0.0, 2.0), chance.uniform(0.0, 6.0)])
            step = Step(gap, step.client, kind, step.args)
        elif chance.random() < 0.4:
            step = Step(chance.uniform(1.0, 8.0), step.client, step.kind, step.args)
        mixed.append(step)
    up = CLEAR if chance.random() < 0.5 else drawn.up
    begins = chance.choice(["ground", "hover", "hover", "hover", "mission", "mission", "mission"])
    return Draw(seed, drawn.model, drawn.flavours, drawn.skycontroller, begins, up, drawn.down, tuple(mixed))


def quirks_of(seed: int) -> tuple[str, ...]:
    """Return the ways in which the firmware of a round differs: half of them scramble events, a third has a quirk."""
    chance = random.Random(seed ^ 0xF1)
    scrambled = (f"scramble:{seed % 10**9}",) if chance.random() < 0.5 else ()
    return (*scrambled, chance.choice(QUIRKS)) if chance.random() < 0.35 else scrambled


class Replaceable:
    """A gateway that can be restarted."""

    def __init__(self, config: Config, stack: AsyncExitStack) -> None:
        self.config = config
        self.now: Gateway | None = None

    async def start(self) -> Gateway:
        self.now = Gateway(self.config)
        await self.now.__aenter__()
        return self.now

    async def end(self) -> None:
        if self.now is not None:
            gateway, self.now = self.now, None
            await gateway.__aexit__(None, None, None)

    async def replace(self) -> None:
        await self.end()
        gateway = await self.start()
        await gateway.ready(20.0)


@asynccontextmanager
async def explored(drawn: Draw) -> AsyncIterator[tuple[World, Replaceable]]:
    first = drawn.flavours[0]
    other = next(flavour for flavour in drawn.flavours if flavour != first)
    drone, address = loopback(), loopback()
    spec = DroneSpec(
        model=drawn.model, address=drone, home=HOME, http_port=WEB_PORT, rtsp_port=VIDEO_PORT,
        telemetry_rate=5.0, skycontroller=drawn.skycontroller, firmware_quirks=quirks_of(drawn.seed),
    )  # fmt: skip
    config = Config(
        endpoints=(f"tcpin://{address}:5760?flavour={first}", f"tcpin://{address}:5761?flavour={other}"),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone, http_port=WEB_PORT, rtsp_port=VIDEO_PORT),),
        http=HttpConfig(port=0),
    )
    flavours.note(*config.endpoints)
    async with AsyncExitStack() as stack:
        simulator = await stack.enter_async_context(Simulator([spec], speed=soak.SPEED, seed=1))
        gateway = Replaceable(config, stack)
        w = World(simulator, await gateway.start(), address, first)
        try:
            await w.connect()
            assert await w.gateway.ready(10.0)
            await w.client.heartbeat(lambda beat: True, since=0)
            await w.client.wait("GLOBAL_POSITION_INT", since=0)
            yield w, gateway
        finally:
            for client in w.clients:
                await client.close()
            await simulator.close()
            await gateway.end()


def judge_fence(flight: Explored) -> None:
    """Setpoints and sticks do not fly out of an accepted fence; the Skycontroller's pilot may.

    Not judged with late or lost events and commands: the drone flies `soak.SPEED` times as fast as the link, so they
    count that much more.
    """
    up, down = flight.drawn.up, flight.drawn.down
    late = down.delay > 0.0 or any("scramble" in quirk for quirk in quirks_of(flight.drawn.seed))
    if late or up.loss or down.loss or flight.drawn.skycontroller is not None:
        return
    for (at, half), (until, _) in itertools.pairwise([*flight.fences, (math.inf, 0.0)]):
        inside, tilted = False, -math.inf
        for entry in flight.w.drone.log:
            if entry.name.endswith("PCMD") and entry.args["flag"]:
                tilted = entry.t
            if not half or entry.kind != "pose" or not at + 1.0 < entry.t < until:
                continue
            away = max(abs(entry.args["north"]), abs(entry.args["east"]))
            inside = inside or away < half - 8.0
            if inside and away > half + OUTSIDE and entry.t - tilted < 1.0:
                flight.wrong.append(f"{entry.t - at:.1f} s after a fence of {half:.0f} m the drone is at {away:.1f} m")
                return


def accepted(flight: Explored) -> Iterator[tuple[soak.Sent, float]]:
    """Return the commands whose own final result was ACCEPTED, with its time."""
    for s in flight.sent:
        finals = [(at, ack.result) for at, ack in flight.acks(s.client) if ack.command == s.command and at >= s.at]
        final = next(((at, result) for at, result in finals if result != soak.IN_PROGRESS), None)
        if s.client in flight.dead or final is None or final[1] != soak.ACCEPTED:
            continue
        if not any(o.client == s.client and o.command == s.command and s.at < o.at <= final[0] for o in flight.sent):
            yield s, final[0]


def judge_truth(flight: Explored) -> None:
    """An acceptance follows what the drone did."""
    log = list(flight.w.drone.log)
    states = [(e.t, e.args["to"]) for e in log if (e.kind, e.name) == ("state", "flying")]
    for s, at in accepted(flight):
        state = next((to for t, to in reversed(states) if t <= at), "landed")
        since = {e.name.rpartition(".")[2] for e in log if s.at - SAME_AS_BEFORE <= e.t <= at}
        problem = ""
        if s.command == soak.GOTO and not since & {"moveToChanged", "info"}:
            problem = "no move is reported"
        elif (s.command == soak.LAND and state not in ("landing", "landed", "emergency", "emergency_landing")) or (
            s.command == soak.TAKEOFF and state == "motor_ramping"
        ):
            problem = f"the drone is {state}"
        elif s.command == dialect.MAV_CMD_DO_SET_HOME and "set_custom_location" not in since:
            problem = "no home is set"
        if problem:
            flight.wrong.append(f"{name(s.command)} of client {s.client} is accepted, and {problem}")


def judge_hold(flight: Explored) -> None:
    """After an accepted Hold the drone stands, unless something newer is sent."""
    log = list(flight.w.drone.log)
    states = [(e.t, e.args["to"]) for e in log if (e.kind, e.name) == ("state", "flying")]
    newest = sorted([s.at for s in flight.sent] + [s.begun for s in flight.streams])
    for s, at in accepted(flight):
        if s.command != soak.SET_MODE or s.values[1:] not in ((4.0, 3.0), (17.0,)) or flight.battery:
            continue
        if any(s.at < x.begun < at < x.ended + 3.0 for x in flight.streams):
            continue
        if next((to for t, to in reversed(states) if t <= at), "landed") in ("landing", "takingoff"):
            continue
        until = min([at + 8.0, *(t for t in newest if t > s.at)])
        poses = [e for e in log if e.kind == "pose" and at + BRAKES_WITHIN + flight.delay < e.t < until]
        if fast := [e for e in poses if soak._speed(e) > 1.0]:
            flight.wrong.append(
                f"{fast[0].t - at:.1f} s after an accepted Hold the drone flies {soak._speed(fast[0])} m/s"
            )


async def fly(drawn: Draw) -> list[str]:
    with soak.errors_logged() as logged:
        async with explored(drawn) as (w, gateway):
            for index, flavour in enumerate(drawn.flavours[1:], 1):
                await w.connect(sysid=255 - index, port=5760 if flavour == drawn.flavours[0] else 5761)
            await soak.begin(w, drawn.begins)
            flight = Explored(w, drawn, gateway=gateway)
            w.drone.faults.up, w.drone.faults.down = drawn.up, drawn.down
            async with flight.watched():
                for step in drawn.steps:
                    if step.gap:
                        await asyncio.sleep(step.gap)
                    await flight.step(step)
                await flight.streams_end()
                w.drone.faults.mute = False
                await soak.settle(flight)
            await soak.compare(flight)
            soak.judge(flight)
            for index in flight.dead:
                flight.wrong[:] = [text for text in flight.wrong if not text.startswith(f"client {index} ")]
            judge_truth(flight)
            judge_hold(flight)
            judge_fence(flight)
            await flight.read_back()
            await soak.hold(flight)
            await soak.land(flight)
            if "-v" in sys.argv:
                show(flight)
    return flight.wrong + [f"logged: {record}" for record in logged]


def show(flight: Explored) -> None:
    """Print what was sent, answered and flown, in order."""
    lines: list[tuple[float, str]] = [
        (s.at, f"client {s.client} sends {name(s.command)} {s.values}") for s in flight.sent
    ]
    for s in flight.streams:
        lines.append((s.begun, f"client {s.client} stream until {s.ended:.2f} {s.place}"))
    for index in range(len(flight.drawn.flavours)):
        client, mode = flight.client(index), None
        for at, m in client.received:
            kind = m.get_type()
            if kind == "COMMAND_ACK":
                lines.append((at, f"  client {index} <- {name(m.command)} result {m.result}"))
            elif kind == "STATUSTEXT" and index == 0:
                lines.append((at, f"  text {m.text!r}"))
            elif kind == "MISSION_ACK":
                lines.append((at, f"  client {index} <- MISSION_ACK {m.mission_type} {m.type}"))
            elif kind == "HEARTBEAT" and m.get_srcComponent() == 1 and (m.custom_mode, m.base_mode) != mode:
                mode = (m.custom_mode, m.base_mode)
                lines.append((at, f"  client {index} mode {m.custom_mode:#x} base {m.base_mode:#x}"))
    last = None
    for e in flight.w.drone.log:
        if e.kind in ("command", "state", "event") and not e.name.endswith(("PCMD",)) and e.t >= flight.began - 1:
            if e.kind == "event" and not any(
                k in e.name for k in ("FlyingState", "moveTo", "Flight", "rth", "Home", "Forced")
            ):
                continue
            lines.append((e.t, f"    drone {e.kind} {e.name} {e.args}"))
        elif e.name.endswith("PCMD") and e.t >= flight.began - 1 and list(e.args.values())[:5] != last:
            last = list(e.args.values())[:5]
            lines.append((e.t, f"    drone PCMD {e.args}"))
    for at, index, items in ((a, i, x) for k in flight.lists.values() for a, i, x in k):
        lines.append((at, f"client {index} list accepted {items is not None}"))
    for at, half in flight.fences:
        lines.append((at, f"fence {half}"))
    for index, at, back in flight.killed:
        lines += [(at, f"client {index} KILLED"), (back, f"client {index} back")]
    for a, b in flight.restarts:
        lines += [(a, "gateway restarts"), (b, "gateway back")]
    for at, text in sorted(lines):
        print(f"{at - flight.began:8.3f} {text}")


def name(command: int) -> str:
    return dialect.enums["MAV_CMD"][command].name.removeprefix("MAV_CMD_")


async def flown(seed: int, steps: int) -> list[str]:
    try:
        return await fly(draw(seed, steps))
    except Exception as error:
        return [f"the round breaks off: {error!r}"]


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=50)
    options.add_argument("--steps", type=int, default=14)
    options.add_argument("--seed", type=int, default=None, help="of the first round, the others follow")
    options.add_argument("-v", action="store_true", help="print what was sent, answered and flown")
    given = options.parse_args()
    first = random.SystemRandom().randrange(10**6, 10**9) if given.seed is None else given.seed
    print(f"seeds {first} to {first + given.rounds - 1}", flush=True)
    tally: Counter[str] = Counter()
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + given.rounds):
            os.environ["XDG_STATE_HOME"] = f"{folder}/{seed}"
            with asyncio.Runner(loop_factory=clock.Loop) as runner:
                wrong = runner.run(flown(seed, given.steps))
            tally["failed" if wrong else "passed"] += 1
            if tally.total() % 25 == 0:
                print(dict(tally), flush=True)
            if wrong:
                print("\n".join([f"{seed}:", *(f"  {text}" for text in wrong)]), flush=True)
                print(quirks_of(seed), draw(seed, given.steps), flush=True)
    print(dict(tally), f"{time.process_time() - began:.0f} s of CPU")
    return 1 if tally["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())

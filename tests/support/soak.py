"""Rounds of random flight through MAVLink, judged by the simulated drone's log and by what the clients receive.

A round is drawn from its seed alone: the drone's model, the clients with their flavours, the link and the steps. After
the steps all streams end, every command gets its final acknowledgement, the modes that the clients see are compared
with the drone, a Hold must bring it to a stand, and a Land to the ground. `judge` names everything that is wrong.
"""

from __future__ import annotations

import asyncio
import gc
import itertools
import logging
import math
import random
from collections.abc import AsyncIterator, Coroutine, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav import geo
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.mavlink import dialect as newer
from anafi_mav.services.command.orbit_service import OrbitService
from anafi_mav.sim.world.faults import CLEAR, Impairment
from anafi_mav.vehicle.offboard.moves import MOVE_EVERY
from support.fault_scenarios import watched
from support.mav import NAN, Client
from support.missions import ACTIVE, COMPLETE, CORNERS, NO_MISSION, NOT_STARTED, PAUSED, put, start, state, way, whole
from support.missions import RTL as ITEM_RTL
from support.missions import takeoff as item_takeoff
from support.plans import MISSION, Item, upload
from support.setpoints import EVERY, POSITION_ONLY, VELOCITY_ONLY, attitude, earth, local
from support.world import HOME, TAKE_OFF_SPEED, World, world

MODELS = ("4k", "usa", "thermal", "ai")
STEPS = 10
"""Steps of a round."""

SPEED, SETTLING_SPEED, WATCHING_SPEED = 3.0, 8.0, 2.0
"""Simulated seconds in one: while steps run, while the end is awaited, while modes and drone are compared."""

SILENCE, GUIDED_TIMEOUT, TARGET_SILENCE = 0.5, 1.5, 2.6
"""s after the last setpoint, stick or target within which the sticks are centred."""

WATCH_EVERY = 0.1
"""s between two looks at what flies."""

SLACK = 0.2
"""s of the simulator's and the gateway's own timers, and of a host that is slow for a moment."""

FINAL_WITHIN = 45.0
"""s for the final acknowledgement of every command, after the last step."""

GAZ_FOR = 1.0
"""s of full gaz at most that end a landing (arsdk: ardrone3.xml 1-0-3)."""

RESENT_WITHIN = 0.5
"""s in which a command reaches the drone though datagrams are lost."""

LONGEST_CUT = 1.3
"""s that the link is interrupted at most; below the time after which it counts as lost."""

STANDS_WITHIN = 20.0
"""s after a Hold within which the drone stands still."""

LANDS_WITHIN = 20.0

SAME_HEIGHT = 0.1
"""m between a position's height and that of its moveTo. A command to the same place has another height."""

RESEND = 3.6
"""s after a final acknowledgement within which an equal command is a retransmission."""

RESEND_REFUSED = 0.9
"""The same after a refusal, whose reason may end: a mission is there now (`services.commands.REFUSAL_WINDOW`)."""

ARM, TAKEOFF, LAND, RETURN = (
    dialect.MAV_CMD_COMPONENT_ARM_DISARM,
    dialect.MAV_CMD_NAV_TAKEOFF,
    dialect.MAV_CMD_NAV_LAND,
    dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH,
)
SET_MODE, GOTO, ALTITUDE, PAUSE, ORBIT, START = (
    dialect.MAV_CMD_DO_SET_MODE,
    dialect.MAV_CMD_DO_REPOSITION,
    dialect.MAV_CMD_DO_CHANGE_ALTITUDE,
    dialect.MAV_CMD_DO_PAUSE_CONTINUE,
    dialect.MAV_CMD_DO_ORBIT,
    dialect.MAV_CMD_MISSION_START,
)
SET_CURRENT, ROI, NO_ROI, PANORAMA = (
    dialect.MAV_CMD_DO_SET_MISSION_CURRENT,
    dialect.MAV_CMD_DO_SET_ROI_LOCATION,
    dialect.MAV_CMD_DO_SET_ROI_NONE,
    dialect.MAV_CMD_PANORAMA_CREATE,
)

ONCE = (TAKEOFF, GOTO, ALTITUDE, ORBIT, SET_CURRENT)
"""Commands that a retransmission never executes again (`services.commands.Effect`): its result is the first one's."""

ACCEPTED, IN_PROGRESS = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS

YAW_STICK, PITCH_STICK = 0, 3
"""Axes of a Skycontroller."""

PX4_MODES = {
    "hold": (4, 3),
    "position": (3, 0),
    "offboard": (6, 0),
    "mission": (4, 4),
    "return": (4, 5),
    "land": (4, 6),
    "takeoff": (4, 2),
    "follow": (4, 8),
}
COPTER_MODES = {
    "hold": 17,
    "position": 5,
    "offboard": 4,
    "mission": 3,
    "return": 6,
    "land": 9,
    "takeoff": 4,
    "follow": 23,
}

SHOWN = {
    "px4": {0x04040000: "mission", 0x04050000: "return", 0x05040000: "return", 0x06040000: "land"}
    | {0x02040000: "takeoff", 0x00060000: "offboard", 0x01030000: "orbit"},
    "ardupilot": {3: "mission", 6: "return", 9: "land", 7: "orbit"},
}
"""Modes in heartbeats that say that the vehicle does something by itself."""

MAY_SHOW = {
    "ground": {"other"},
    "hover": {"other"},
    "fly": {"other", "orbit", "takeoff"},
    "takeoff": {"other", "takeoff", "mission"},
    "mission": {"mission"},
    "return": {"return"},
    "land": {"land", "return"},
}
"""Modes that agree with what the drone does; `other` are those in which only a client's input moves it."""

_NOT_ACTIVE = {NO_MISSION, NOT_STARTED, PAUSED, COMPLETE}

MISSION_STATES = dict.fromkeys(MAY_SHOW, _NOT_ACTIVE | {ACTIVE}) | {
    "mission": {ACTIVE},
    "hover": _NOT_ACTIVE,
    "ground": _NOT_ACTIVE,
}
"""States of the mission that agree with what the drone does."""

DIFFERS_AT_MOST = 20.0
"""s that a mode may differ. A commanded return hovers at home for 5 s before it lands, and for 13 s more where the
drone reports no end of it."""

BEGINNINGS = ("ground", "hover", "hover", "mission")

WEIGHTS = {
    "arm": 2,
    "takeoff": 3,
    "goto": 4,
    "altitude": 2,
    "hold": 3,
    "pause": 2,
    "continue": 2,
    "orbit": 2,
    "offboard": 3,
    "velocity": 2,
    "position": 2,
    "positions": 2,
    "attitude": 1,
    "follow": 2,
    "stick": 3,
    "pilot": 2,
    "roi": 1,
    "panorama": 1,
    "upload": 2,
    "start": 3,
    "restart": 2,
    "return": 2,
    "land": 2,
    "disarm": 1,
    "cancel": 3,
    "withdraw": 2,
    "again": 3,
    "cut": 1,
}
"""Kinds of steps, and how often each is drawn."""


@dataclass(frozen=True)
class Step:
    """One action of a client, `gap` s after the one before."""

    gap: float
    client: int
    kind: str
    args: tuple[float, ...] = ()

    def __str__(self) -> str:
        return f"+{self.gap:.2f} s client {self.client} {self.kind} {' '.join(f'{a:.2f}' for a in self.args)}"


@dataclass(frozen=True)
class Draw:
    """Everything random in a round."""

    seed: int
    model: str
    flavours: tuple[str, ...]
    """Of each client."""
    skycontroller: int | None
    begins: str
    """On the ground, in a hover or on a mission."""
    up: Impairment
    down: Impairment
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        head = f"seed {self.seed}: {self.model}, clients {', '.join(self.flavours)}, Skycontroller {self.skycontroller}"
        link = f"  {self.begins}, up {self.up}, down {self.down}"
        return "\n".join([head, link, *(f"  {step}" for step in self.steps)])


def draw(seed: int, steps: int = STEPS) -> Draw:
    """Return the round of a seed, the same on every machine."""
    chance = random.Random(seed)
    flavours = ["px4", "ardupilot"]
    chance.shuffle(flavours)
    for _ in range(chance.choice([0, 0, 0, 1, 1, 2])):
        flavours.append(chance.choice(flavours))
    up = down = CLEAR
    if chance.random() < 0.7:
        loss = chance.choice([0.0, 0.1])
        up = Impairment(loss=loss, delay=chance.choice([0.0, 0.0, 0.1]))
        down = Impairment(loss=loss, delay=chance.choice([0.0, 0.2, 0.5, chance.uniform(0.0, 1.0)]))
    kinds, weights = list(WEIGHTS), list(WEIGHTS.values())
    drawn = []
    for _ in range(steps):
        kind = chance.choices(kinds, weights)[0]
        gap = chance.choice([0.0, 0.0, 0.005, 0.1, chance.uniform(0.0, 1.5), chance.uniform(0.0, 1.5)])
        args = (chance.uniform(-30.0, 30.0), chance.uniform(-30.0, 30.0), chance.uniform(0.2, 2.5))
        drawn.append(Step(gap, chance.randrange(len(flavours)), kind, args))
    model = chance.choice(MODELS)
    skycontroller = 3 if chance.random() < 0.35 and model != "ai" else None
    return Draw(seed, model, tuple(flavours), skycontroller, chance.choice(BEGINNINGS), up, down, tuple(drawn))


@dataclass(frozen=True)
class Sent:
    """A command that a client has sent."""

    at: float
    client: int
    command: int
    values: tuple[Any, ...]
    """Its parameters, NaN as None."""
    confirmation: int
    """Above 0: a retransmission of the same client's command before."""


@dataclass
class Stream:
    """Setpoints or sticks of one client: nothing of it moves the drone for longer than `lasts` after its end."""

    begun: float
    lasts: float
    client: int | None
    """None: the pilot at the Skycontroller."""
    ended: float = math.inf
    place: tuple[float, float, float] | None = None
    """Of a stream of positions: deg, deg, m above take-off."""


@dataclass
class Flight:
    """A round under way, and what has been seen of it."""

    w: World
    drawn: Draw
    sent: list[Sent] = field(default_factory=list)
    streams: list[Stream] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    """Everything that is wrong with it."""
    began: float = field(default_factory=lambda: now())
    """When the steps began; what is before is no part of what is judged."""
    _tasks: set[asyncio.Task[None]] = field(default_factory=set)
    _last: dict[int, tuple[int, tuple[Any, ...], dict[str, Any]]] = field(default_factory=dict)

    def client(self, index: int) -> Client:
        return self.w.clients[index]

    def flavour(self, index: int) -> str:
        return self.drawn.flavours[index]

    @property
    def delay(self) -> float:
        """s that the link may hold back what the gateway sends."""
        return self.drawn.up.delay + self.drawn.up.jitter

    # Sending.

    def command(self, index: int, id: int, *params: float, confirmation: int = 0, **where: Any) -> None:
        values = tuple(None if isinstance(v, float) and math.isnan(v) else v for v in (*params, *where.values()))
        self.sent.append(Sent(now(), index, id, values, confirmation))
        self._last[index] = (id, params, where)
        self.client(index).send_command(id, *params, confirmation=confirmation, **where)

    def mode(self, index: int, name: str) -> None:
        if self.flavour(index) == "px4":
            self.command(index, SET_MODE, 1.0, *map(float, PX4_MODES[name]))
        else:
            self.command(index, SET_MODE, 1.0, float(COPTER_MODES[name]))

    def spawn(self, work: Coroutine[Any, Any, None]) -> None:
        self._tasks.add(asyncio.ensure_future(work))

    def stream(
        self,
        index: int,
        message: Any,
        seconds: float,
        every: float = EVERY,
        lasts: float = SILENCE,
        place: tuple[float, float, float] | None = None,
    ) -> None:
        entry = Stream(now(), lasts, index, place=place)
        self.streams.append(entry)

        async def send() -> None:
            end = now() + seconds
            while True:
                self.client(index).send(message)
                entry.ended = math.inf if now() < end else now()
                if now() >= end:
                    return
                await asyncio.sleep(every)  # the program's own rate

        self.spawn(send())

    def pilot(self, axis: int, percent: int, seconds: float) -> None:
        """Let the pilot at the Skycontroller hold a stick, where there is one."""
        controller = self.w.drone.skycontroller
        if controller is None:
            return
        controller.stick(axis, percent)
        self.streams.append(Stream(now(), SILENCE, None, now() + seconds))
        asyncio.get_running_loop().call_later(seconds, controller.stick, axis, 0)

    @asynccontextmanager
    async def watched(self) -> AsyncIterator[None]:
        """See that at most one flight task flies within the block."""
        watch = asyncio.ensure_future(self._watch())
        try:
            yield
        finally:
            watch.cancel()
            with suppress(asyncio.CancelledError):
                await watch

    async def _watch(self) -> None:
        while len(flying := pilots(self.w)) < 2:
            await watched(WATCH_EVERY)  # samples of what flies
        self.wrong.append(f"two pilots: {', '.join(flying)}")

    async def streams_end(self) -> None:
        if self._tasks:
            await asyncio.wait(self._tasks)
            for task in self._tasks:
                task.result()

    # Steps.

    async def step(self, step: Step) -> None:
        """Do what a step says; returns when it is sent."""
        n, (first, second, third) = step.client, step.args
        place = geo.destination(*HOME[:2], first, second)
        height = 3.0 + 4.0 * third
        copter = self.flavour(n) == "ardupilot"
        lasts = GUIDED_TIMEOUT if copter else SILENCE
        match step.kind:
            case "arm":
                self.command(n, ARM, 1.0)
            case "takeoff":
                if first > 0.0:
                    if copter:
                        self.mode(n, "offboard")
                    self.command(n, ARM, 1.0)
                self.command(n, TAKEOFF, x=0.0, y=0.0, z=height)
            case "goto":
                self.command(n, GOTO, -1.0, 1.0, 0.0, NAN, frame=6, x=place[0], y=place[1], z=height)
            case "altitude":
                self.command(n, ALTITUDE, height, 3.0)
            case "hold":
                self.mode(n, "hold")
            case "pause":
                self.command(n, PAUSE, 0.0)
            case "continue":
                self.command(n, PAUSE, 1.0)
            case "orbit":
                self.command(n, ORBIT, 8.0, 3.0, 5.0, NAN, frame=6, x=place[0], y=place[1], z=height)
            case "offboard":
                self.stream(n, local(VELOCITY_ONLY, v=(first / 10.0, second / 10.0, 0.0)), third, lasts=lasts)
                self.mode(n, "offboard")
            case "velocity":
                self.stream(n, local(VELOCITY_ONLY, v=(first / 10.0, second / 10.0, 0.0)), 0.0, lasts=lasts)
            case "position":
                self.stream(n, earth(POSITION_ONLY, 6, first, second, height), 0.0)
            case "positions":
                message = earth(POSITION_ONLY, 6, first, second, height)
                self.stream(n, message, 0.5 + third, place=(message.lat_int / 1e7, message.lon_int / 1e7, height))
                self.mode(n, "offboard")
            case "attitude":
                self.stream(n, attitude(first / 300.0, 0.5), third)
                self.mode(n, "offboard")
            case "follow":
                self.mode(n, "follow")
                self.stream(n, target(place), third, every=0.4, lasts=TARGET_SILENCE)
            case "pilot":
                self.pilot(PITCH_STICK if second > 0.0 else YAW_STICK, int(first * 3.0), third / 2.0)
            case "roi":
                if second > 0.0:
                    self.command(n, ROI, NAN, NAN, NAN, NAN, frame=6, x=place[0], y=place[1], z=0.0)
                else:
                    self.command(n, NO_ROI)
            case "panorama":
                self.command(n, PANORAMA, 360.0, 0.0, 10.0, 10.0)
            case "stick":
                if second > 0.0:
                    self.mode(n, "position")
                x, y = int(first * 30.0), int(second * 30.0)
                self.stream(n, dialect.MAVLink_manual_control_message(1, x, y, 500, 0, 0), third)
            case "upload":
                items = [item_takeoff(height), way(first, second, height), way(second, first, height + 1.0), ITEM_RTL]
                listed = [Item(dialect.MAV_CMD_NAV_WAYPOINT, *HOME), *items] if copter else items
                self.spawn(self._upload(n, listed))
            case "start":
                if first > 0.0:
                    self.command(n, ARM, 1.0)
                if second > 0.0:
                    self.mode(n, "mission")
                else:
                    self.command(n, START, 0.0, 0.0)
            case "restart":
                self.command(n, SET_CURRENT, 1.0 + copter)
            case "return":
                if first > 0.0:
                    self.command(n, RETURN)
                else:
                    self.mode(n, "return")
            case "land":
                if first > 0.0:
                    self.command(n, LAND)
                else:
                    self.mode(n, "land")
            case "disarm":
                self.command(n, ARM, 0.0)
            case "cancel":
                other = int(abs(first)) % len(self.drawn.flavours)
                if other in self._last:
                    self.client(n).send(newer.MAVLink_command_cancel_message(1, 1, self._last[other][0]))
            case "withdraw":
                self.command(n, SET_CURRENT, 1.0 + copter)
                cancel = newer.MAVLink_command_cancel_message(1, 1, SET_CURRENT)
                asyncio.get_running_loop().call_later(third / 4.0, self.client(n).send, cancel)
            case "again":
                if n in self._last:
                    id, params, where = self._last[n]
                    long = "frame" not in where  # COMMAND_INT has no such field
                    self.command(n, id, *params, confirmation=int(long and first > 0.0), **where)
            case "cut":
                self.w.drone.faults.mute = True
                asyncio.get_running_loop().call_later(third / 2.0, setattr, self.w.drone.faults, "mute", False)

    async def _upload(self, index: int, items: Sequence[Item]) -> None:
        try:
            await upload(self.client(index), items, MISSION, timeout=10.0)
        except AssertionError as error:
            if not self.gaps():
                self.wrong.append(f"mission upload of client {index} has no end: {str(error)[:80]}")

    # What was received.

    def acks(self, index: int) -> list[tuple[float, Any]]:
        return [(at, ack) for at, ack in self.client(index).since(0, "COMMAND_ACK") if at >= self.began]

    def gaps(self) -> list[tuple[float, float]]:
        """Times without the system: its link was down, and it answers nothing."""
        found = []
        for client in self.w.clients:
            beats = [at for at, m in client.since(0, "HEARTBEAT") if m.get_srcComponent() == 1]
            found += [(a, b) for a, b in itertools.pairwise(beats) if b - a > 1.6]
        return found

    def unanswered(self) -> list[Sent]:
        """Commands that still need a final acknowledgement."""
        missing = []
        for (index, command), (sends, finals) in self.by_command().items():
            if len(finals) < len(instances(sends, finals)):
                missing.append(self.sent_of(index, command)[-1])
        return missing

    def _is_unsupported(self, s: Sent) -> bool:
        results = [ack.result for _, ack in self.acks(s.client) if ack.command == s.command]
        return dialect.MAV_RESULT_UNSUPPORTED in results

    def sent_of(self, index: int, command: int) -> list[Sent]:
        return [s for s in self.sent if (s.client, s.command) == (index, command)]

    def by_command(self) -> dict[tuple[int, int], tuple[list[tuple[Sent, bool]], list[tuple[float, int]]]]:
        """Per client and MAV_CMD: its sends, each with whether it is a repetition, and the final results."""
        table: dict[tuple[int, int], tuple[list[tuple[Sent, bool]], list[tuple[float, int]]]] = {}
        newest: dict[int, Sent] = {}
        for s in self.sent:
            before = newest.get(s.client)
            same = before is not None and (before.command, before.values) == (s.command, s.values)
            table.setdefault((s.client, s.command), ([], []))[0].append((s, same))
            if s.command != PANORAMA or not self._is_unsupported(s):  # such a command ends no other one
                newest[s.client] = s
        for index in range(len(self.drawn.flavours)):
            for at, ack in self.acks(index):
                if ack.result != IN_PROGRESS and (index, ack.command) in table:
                    table[index, ack.command][1].append((at, ack.result))
        return table


def now() -> float:
    return asyncio.get_running_loop().time()


def instances(sends: list[tuple[Sent, bool]], finals: list[tuple[float, int]]) -> list[Sent]:
    """The sends that need a final acknowledgement of their own: the others are retransmissions."""
    own = []
    for s, same in sends:
        recent = [at for at, _ in finals if at < s.at]
        if same and (len(recent) < len(own) or s.at - recent[-1] < RESEND):
            continue
        own.append(s)
    return own


class Logged(logging.Handler):
    """Keeps what is logged as an error, or with an exception."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.records: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        cause = record.exc_info[1] if record.exc_info else None
        if record.name == "aiohttp.server" and isinstance(cause, ConnectionResetError):
            return  # an upload to the simulated drone's web server was cancelled
        if record.levelno >= logging.ERROR or record.exc_info:
            self.records.append(f"{record.name}: {record.getMessage().splitlines()[0]} {cause!r}")


@contextmanager
def errors_logged() -> Iterator[list[str]]:
    """What is logged within the block, complaints of the garbage collector about what was made in it included.

    To collect is cheap, for it looks through nothing that was made before (as in `support.heap`).
    """
    gc.collect()  # the complaints about what was made before
    gc.freeze()
    handler = Logged()
    logging.getLogger().addHandler(handler)
    try:
        yield handler.records
        gc.collect()
    finally:
        logging.getLogger().removeHandler(handler)


async def fly(drawn: Draw) -> list[str]:
    """Fly a round; everything that is wrong with it."""
    first = drawn.flavours[0]
    other = next(flavour for flavour in drawn.flavours if flavour != first)
    with errors_logged() as logged:
        async with world(
            speed=SPEED,
            model=drawn.model,
            flavour=first,
            also=other,
            skycontroller=drawn.skycontroller,
            web=True,
        ) as w:
            for index, flavour in enumerate(drawn.flavours[1:], 1):
                await w.connect(sysid=255 - index, port=5760 if flavour == first else 5761)
            await begin(w, drawn.begins)
            flight = Flight(w, drawn)
            w.drone.faults.up, w.drone.faults.down = drawn.up, drawn.down
            async with flight.watched():
                for step in drawn.steps:
                    if step.gap:
                        await asyncio.sleep(step.gap)  # a client's own time
                    await flight.step(step)
                await flight.streams_end()
                w.drone.faults.mute = False
                await settle(flight)
            await compare(flight)
            judge(flight)
            await hold(flight)
            await land(flight)
    return flight.wrong + [f"logged: {record}" for record in logged]


async def begin(w: World, how: str) -> None:
    """Bring the drone to where the steps begin."""
    if how == "hover":
        await w.take_off()
    elif how == "mission":
        w.simulator.speed = TAKE_OFF_SPEED
        await put(w, CORNERS)
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.simulator.speed = SPEED


async def settle(flight: Flight) -> None:
    """Wait until each command has its final acknowledgement and the last stream is over."""
    w = flight.w
    w.simulator.speed = 1.0
    await asyncio.sleep(GUIDED_TIMEOUT + flight.delay + SLACK)
    w.simulator.speed = SETTLING_SPEED
    limit = now() + FINAL_WITHIN
    while flight.unanswered() and now() < limit and not (flight.gaps() and now() > limit - FINAL_WITHIN + 10.0):
        await watched(0.2)  # acknowledgements of many commands, in any order
    w.drone.faults.up = w.drone.faults.down = CLEAR
    w.simulator.speed = 1.0
    await asyncio.sleep(1.0)


def doing(w: World) -> str:
    """What the simulated drone does by itself."""
    firmware = w.drone.firmware
    state = w.drone.flying_state
    if state in (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING):
        return "land"
    if state == FlyingState.LANDED:
        return "ground"
    if state in (FlyingState.TAKINGOFF, FlyingState.USERTAKEOFF, FlyingState.MOTOR_RAMPING):
        return "takeoff"
    if firmware.homing.active:
        return "return"
    if firmware.flight_plan.playing:
        return "mission"
    return "hover" if state == FlyingState.HOVERING else "fly"


async def compare(flight: Flight) -> None:
    """Compare the heartbeats' mode and armed state with the drone: a difference may not last."""
    flight.w.simulator.speed = WATCHING_SPEED
    limit = now() + DIFFERS_AT_MOST
    while differences := await _differences(flight):
        if now() > limit:
            flight.wrong += differences
            return


async def _differences(flight: Flight, seconds: float = 2.4) -> list[str]:
    """What the clients see and the drone does not do, where neither changes for some seconds."""
    w, found = flight.w, []
    marks = [client.mark() for client in w.clients]
    seen, begun = set(), now()
    for _ in range(round(seconds / 0.2)):
        seen.add(doing(w))
        await watched(0.2)  # samples of what the drone does
    if len(seen) > 1 or any(end > begun for _, end in flight.gaps()):
        return []
    (truth,) = seen
    for index, mark in enumerate(marks):
        beats = [m for _, m in w.clients[index].since(mark, "HEARTBEAT") if m.get_srcComponent() == 1]
        modes = {SHOWN[flight.flavour(index)].get(m.custom_mode, "other") for m in beats}
        armed = {bool(m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED) for m in beats}
        if len(modes) == 1 and not modes <= MAY_SHOW[truth]:
            found.append(f"mode of client {index} is {modes} while the drone's state is {truth}")
        states = {whole(m).mission_state for _, m in w.clients[index].since(mark, "MISSION_CURRENT")}
        if states and states.isdisjoint(MISSION_STATES[truth]):
            found.append(f"mission state of client {index} is {states} while the drone's state is {truth}")
        if truth != "ground" and armed != {True}:
            found.append(f"armed of client {index} is {armed} while the drone's state is {truth}")
    return found


def judge(flight: Flight) -> None:
    """What the log and the acknowledgements of the steps say."""
    _judge_acks(flight)
    _judge_retransmissions(flight)
    texts = [m.text for client in flight.w.clients for _, m in client.since(0, "STATUSTEXT")]
    if flight.drawn.skycontroller is None and any("resumed by another controller" in text for text in texts):
        flight.wrong.append("mission is continued by another controller, and there is none")
    _judge_sticks(flight)
    _judge_moves(flight)
    _judge_motors(flight)


def _judge_acks(flight: Flight) -> None:
    gaps = flight.gaps()
    for (index, command), (sends, finals) in flight.by_command().items():
        lowest, most = len(instances(sends, finals)), len(sends)
        name = dialect.enums["MAV_CMD"][command].name
        lost = sum(any(a - 1.0 < s.at < b + 1.0 for a, b in gaps) for s, _ in sends)
        if not lowest - lost <= len(finals) <= most:
            flight.wrong.append(
                f"client {index} {name}: {lowest} to {most} commands, {len(finals)} final results {finals}"
            )
        for at, ack in flight.acks(index):
            if ack.command == command and ack.result == IN_PROGRESS:
                begun = sum(s.at <= at for s, _ in sends)
                if sum(final < at for final, _ in finals) >= begun:
                    flight.wrong.append(f"client {index} {name}: IN_PROGRESS after the final result")


def _judge_retransmissions(flight: Flight) -> None:
    """A retransmission gets the result of its command, unless another client has intervened."""
    for (index, command), (sends, finals) in flight.by_command().items():
        if command not in ONCE:
            continue
        for (original, _), (again, _) in itertools.pairwise(sends):
            if not again.confirmation or original.confirmation or again.values != original.values:
                continue
            before = [result for at, result in finals if original.at <= at < again.at]
            after = [result for at, result in finals if at >= again.at][:1]
            others = _interventions(flight, index, original.at, again.at + 1.0)
            is_done = before in ([ACCEPTED], [newer.MAV_RESULT_CANCELLED])
            recent = again.at - original.at < (RESEND if is_done else RESEND_REFUSED)
            if len(before) == 1 and recent and not others and after != before:
                name = dialect.enums["MAV_CMD"][command].name
                flight.wrong.append(f"client {index} {name}: result {before}, of its retransmission {after}")


def _interventions(flight: Flight, index: int, begin: float, end: float) -> list[Sent | Stream]:
    """Commands and streams of others than client `index` that were under way between two times."""
    commands = [
        s
        for s in flight.sent
        if s.client != index and s.at <= end and not any(at < begin for at, _ in _finals(flight, s))
    ]
    streams = [s for s in flight.streams if s.client != index and s.begun <= end and s.ended + s.lasts >= begin]
    return [*commands, *streams]


def _judge_sticks(flight: Flight) -> None:
    spans = [(s.begun, s.ended + s.lasts) for s in flight.streams]
    for s in flight.sent:
        if s.command == ORBIT:
            ends = [
                at
                for other in flight.sent
                if other.at > s.at
                for at, ack in flight.acks(other.client)
                if (ack.command, ack.result) == (other.command, ACCEPTED) and other.command in (LAND, RETURN, PAUSE)
                if at > other.at and not (other.command == PAUSE and other.values[:1] == (1.0,))  # a continuation
            ]
            spans.append((s.at, min(ends, default=math.inf)))
    late = flight.delay + SLACK
    landings = _landings(flight.w)
    # A client's TAKEOFF ends a landing with gaz until it is answered, also one whose end has not been reported yet.
    takeoffs = [
        (s.at, min((at for at, _ in _finals(flight, s)), default=math.inf)) for s in flight.sent if s.command == TAKEOFF
    ]
    for entry in flight.w.drone.log:
        if entry.kind != "command" or entry.name != "ardrone3.Piloting.PCMD" or entry.t < flight.began:
            continue
        args = entry.args
        gaz_alone = args["gaz"] == 100 and not (args["roll"] or args["pitch"] or args["yaw"])
        if gaz_alone and any(a <= entry.t <= b + GAZ_FOR + late + flight.drawn.down.delay for a, b in landings):
            continue  # it ends a landing
        if gaz_alone and any(a <= entry.t <= b + late for a, b in takeoffs):
            continue
        tilted = args["flag"] and (args["roll"] or args["pitch"])
        if (tilted or args["yaw"] or args["gaz"]) and not any(a <= entry.t <= b + late for a, b in spans):
            last = max((b for a, b in spans if a <= entry.t), default=-math.inf)
            flight.wrong.append(f"PCMD {args} is received {entry.t - last:.2f} s after the end of the last stream")
            return


def _judge_moves(flight: Flight) -> None:
    """A move that a stream of positions has commanded ends with the stream."""
    log = [e for e in flight.w.drone.log if e.t >= flight.began]
    # The acknowledged buffer of ARSDK has one command on its way: a stop leaves after the acknowledgement of the one
    # before, for which a round trip is needed.
    late = 2.0 * flight.delay + flight.drawn.down.delay + SLACK
    if flight.drawn.up.loss or any(step.kind == "cut" for step in flight.drawn.steps):
        late += LONGEST_CUT + RESENT_WITHIN
    for stream in flight.streams:
        if stream.place is None:
            continue
        over = stream.ended + stream.lasts + late
        if any(other.place and other.begun < stream.ended < other.ended for other in flight.streams):
            # Another client's positions are flown instead, once the drone has answered the move before: at most one
            # is on its way.
            over += MOVE_EVERY + SLACK
        begun = [e for e in log if e.kind == "command" and e.t <= over and _flies_to(e, stream.place)]
        if begun and not any(begun[-1].t < e.t <= over and _ends_move(e) for e in log):
            flight.wrong.append(f"a move of a stream is flown {over - stream.ended:.2f} s after its end")


def _flies_to(entry: Any, place: tuple[float, float, float]) -> bool:
    if not entry.name.lower().replace("_", "").endswith("moveto") or entry.name.endswith("CancelMoveTo"):
        return False
    away = math.dist((entry.args["latitude"], entry.args["longitude"]), place[:2])
    return away < 1e-6 and abs(entry.args["altitude"] - place[2]) < SAME_HEIGHT


def target(place: tuple[float, float]) -> Any:
    """Return a FOLLOW_TARGET that stands at a place."""
    unknown, sure = [NAN] * 3, [1.0, NAN, NAN, NAN]
    where = (round(place[0] * 1e7), round(place[1] * 1e7), HOME[2])
    return dialect.MAVLink_follow_target_message(0, 1, *where, unknown, unknown, sure, unknown, unknown, 0)


def pilots(w: World) -> list[str]:
    """Return the flight tasks that fly the drone at this moment."""
    (system,) = w.gateway.systems
    vehicle: Any = system.vehicle
    (orbit,) = (service for service in system.services if isinstance(service, OrbitService))
    tasks = {
        "offboard": vehicle.offboard.engaged,
        "follow": vehicle.follow.engaged,
        "mission": vehicle.mission.flying,
        "orbit": orbit.circle is not None,
        "sticks": vehicle.manual.holder is not None,
    }
    return [name for name, flies in tasks.items() if flies]


def _ends_move(entry: Any) -> bool:
    """Return True for what ends a move: its own end, a stop, or anything else that flies the drone."""
    if entry.kind == "event":
        return entry.name.endswith("moveToChanged") and entry.args["status"] != 0
    if entry.kind == "state":
        return entry.name == "flying" and entry.args["to"] in ("landing", "landed", "emergency")
    name = entry.name.rpartition(".")[2]
    moves = ("CancelMoveTo", "moveTo", "extended_move_to", "moveBy", "extended_move_by")
    return entry.kind == "command" and name in (*moves, "Landing", "return_to_home", "Start")


def _landings(w: World) -> list[tuple[float, float]]:
    """When the drone landed, each time from the beginning of the landing to its end."""
    states = [(e.t, e.args["to"]) for e in w.drone.log if (e.kind, e.name) == ("state", "flying")]
    ends = [at for at, _ in states[1:]] + [math.inf]
    return [(at, end) for (at, state), end in zip(states, ends, strict=False) if state == "landing"]


def _finals(flight: Flight, s: Sent) -> list[tuple[float, int]]:
    """The first final result of a command that was received after it was sent."""
    return [
        (at, ack.result)
        for at, ack in flight.acks(s.client)
        if ack.command == s.command and ack.result != IN_PROGRESS and at >= s.at
    ][:1]


def _judge_motors(flight: Flight) -> None:
    began = flight.began
    landed_at, flying = -math.inf, False
    for entry in flight.w.drone.log:
        if entry.kind == "state" and entry.name == "flying":
            flying = entry.args["to"] != "landed"
            # Motors that a disarming or LAND stopped, which a newer command has replaced: the vehicle stayed armed.
            if not flying and not (entry.args["from"] == "motor_ramping" and _stop_replaced(flight, entry.t)):
                landed_at = entry.t
        if entry.kind != "command" or entry.t < began or flying:
            continue
        name = entry.name.rpartition(".")[2]
        if not (
            name == "TakeOff" or (name == "UserTakeOff" and entry.args["state"]) or entry.name.endswith("Mavlink.Start")
        ):
            continue
        arms = [s for s in flight.sent if s.command == ARM and s.values[:1] == (1.0,) and s.at <= entry.t]
        usable = [
            s
            for s in arms
            if not (f := _finals(flight, s)) or f[0][0] >= entry.t or (f[0][1] == ACCEPTED and f[0][0] > landed_at)
        ]
        if not usable and name == "TakeOff" and _crossed(flight, entry.t):
            if not _stopped(flight, entry.t):
                flight.wrong.append("TakeOff against a landing is received after the touchdown, nothing stops it")
            continue
        if not usable:
            flight.wrong.append(f"{name} is received without an armed vehicle")
        stops = [
            (s.at, f[0][0])
            for s in flight.sent
            if (s.command == LAND or (s.command == ARM and s.values[:1] == (0.0,)))
            and (f := _finals(flight, s))
            and f[0][1] == ACCEPTED
            and f[0][0] < entry.t
        ]
        if stops:
            newer = [
                s.at
                for s in flight.sent
                if s.at >= stops[-1][0]
                and s.at <= entry.t
                and s.command in (ARM, TAKEOFF, START, SET_MODE, SET_CURRENT)
                and not (s.command == ARM and s.values[:1] == (0.0,))
            ] + [s.begun for s in flight.streams if s.ended + s.lasts >= stops[-1][0]]
            if not newer:
                flight.wrong.append(f"{name} is received after an accepted landing, without a newer command")


def _stop_replaced(flight: Flight, at: float) -> bool:
    """Whether the newest disarming or LAND before motors stopped at `at` was cancelled by a newer command.

    Of a LAND only by a TAKEOFF that was sent before the gateway could know of the stopped motors: it then takes the
    vehicle for armed.
    """
    stops = [
        s for s in flight.sent if (s.command == LAND or (s.command == ARM and s.values[:1] == (0.0,))) and s.at <= at
    ]
    if not stops or [result for _, result in _finals(flight, stops[-1])] != [newer.MAV_RESULT_CANCELLED]:
        return False
    known = at + _until_known(flight)
    return stops[-1].command == ARM or any(s.command == TAKEOFF and stops[-1].at <= s.at <= known for s in flight.sent)


def _until_known(flight: Flight) -> float:
    """Seconds within which the gateway has received what the drone reports."""
    return flight.drawn.down.delay + flight.delay + LONGEST_CUT + 1.0


def _crossed(flight: Flight, at: float) -> bool:
    """Whether a TakeOff was meant to end a landing: sent before the gateway could know of the touchdown."""
    late = _until_known(flight)
    return any(
        begun <= s.at <= over + late and over <= at <= over + late + 1.0
        for s in flight.sent
        if s.command == TAKEOFF
        for begun, over in _landings(flight.w)
    )


def _stopped(flight: Flight, at: float) -> bool:
    """Whether the drone is commanded to stop what a TakeOff has started, as soon as the gateway can know of it."""
    limit = at + _until_known(flight)
    commands = [e for e in flight.w.drone.log if e.kind == "command" and at < e.t < limit]
    return any(e.name.rpartition(".")[2] in ("Landing", "UserTakeOff", "Emergency") for e in commands)


def _speed(entry: Any) -> float:
    return math.hypot(entry.args["vn"], entry.args["ve"], entry.args["vd"])


async def stands(w: World, within: float) -> bool:
    """Wait until the drone stands still for a simulated second, in the air or on the ground."""
    begun = now()
    while now() < begun + within:
        poses = [e for e in list(w.drone.log)[-400:] if e.kind == "pose" and e.t > begun]
        if len(poses) > 10:
            span = [e for e in poses if e.args["time"] > poses[-1].args["time"] - 2.0]
            full = poses[-1].args["time"] - poses[0].args["time"] > 2.0
            if full and all(_speed(e) < 0.3 for e in span) and doing(w) in ("hover", "fly", "ground"):
                return True
        await watched(0.2)  # samples of where the drone is
    return False


async def hold(flight: Flight) -> None:
    """A Hold of a client leads to a drone that stands, with two tries."""
    w = flight.w
    w.simulator.speed = SETTLING_SPEED
    client = await w.connect(sysid=240)
    number = (1.0, *map(float, PX4_MODES["hold"])) if w.flavour == "px4" else (1.0, float(COPTER_MODES["hold"]))
    seen = []
    for _ in range(2):
        ack = await client.command(SET_MODE, *number, timeout=20.0)
        seen.append(ack.result)
        if await stands(w, STANDS_WITHIN / 2.0):
            return
    texts = [m.text for _, m in client.since(0, "STATUSTEXT")]
    flight.wrong.append(f"Hold answered {seen} leads to no stand: the drone's state is {doing(w)}; {texts[-4:]}")


async def land(flight: Flight) -> None:
    """A Land of a client leads to a landed and disarmed drone."""
    w, client = flight.w, flight.w.clients[-1]
    ack = await client.command(LAND, timeout=20.0)
    limit = now() + LANDS_WITHIN
    while now() < limit and doing(w) != "ground":
        await watched(0.2)  # samples of what the drone does
    if doing(w) != "ground":
        flight.wrong.append(f"Land answered {ack.result} leads to no landing: the drone's state is {doing(w)}")
        return
    w.simulator.speed = 1.0  # it stands, only the gateway's time counts
    mark, disarmed = client.mark(), not dialect.MAV_MODE_FLAG_SAFETY_ARMED
    try:  # on the ground before, an armed vehicle disarms itself after 10 s
        await client.heartbeat(
            lambda beat: bool(beat.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED) is disarmed, since=mark, timeout=12.0
        )
    except AssertionError:
        flight.wrong.append(f"Land answered {ack.result} leaves the vehicle armed on the ground")


async def rounds_flown(seed: int) -> list[str]:
    """Fly the round of a seed; everything that is wrong with it."""
    try:
        return await fly(draw(seed))
    except Exception as error:
        return [f"the round breaks off: {error!r}"]


def without_steps(drawn: Draw, *indices: int) -> Draw:
    """The same round without some of its steps, to find what matters in it."""
    return replace(drawn, steps=tuple(s for i, s in enumerate(drawn.steps) if i not in indices))

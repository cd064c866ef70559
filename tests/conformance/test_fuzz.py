"""Whatever arrives: no exception, no pause of the heartbeat, and no motion but what is on a list.

Frames of every message of the dialect with random content and a right checksum, frames that are damaged, messages that
fly a drone with some of their bytes changed, every command with numbers that make no sense, and events of the drone
with any values. What moves the drone is read from the simulator's own log.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
import random
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import aiohttp
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import clock
from support.drone_events import EVENTS, random_event
from support.fuzz import LONGEST, framed, offset, random_frames
from support.mav import CAMERA, NAN
from support.missions import ROUND, put
from support.setpoints import COPTER_BRAKE, COPTER_GUIDED, POSITION_ONLY, VELOCITY_ONLY, ZERO, attitude, earth, local
from support.world import HOME, World, world

from anafi_mav.arsdk.messages import battery
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim.world.motion import Pose

FLAVOURS = ("px4", "ardupilot")
ON_THE_GROUND, IN_THE_AIR = 10_000, {"hold": 10_000, "brake": 5_000, "guided": 5_000}
"""Frames, by the mode that the drone hovers in: 20 000 in each flavour, other ones in each run."""

TIMES = [1, pytest.param(25, marks=pytest.mark.full)]
"""A million frames with `-m full`."""

BATCH = 500
"""Frames at once."""

BATCH_EVERY, FRAME_EVERY, COMMAND_EVERY = 0.25, 0.05, 0.001
"""s: a storm, and all the same time goes on: several heartbeats are due in it."""

EVENT_BATCHES, EVENTS_AT_ONCE = 25, 60
"""Events of a drone with random values: 1500 of 337 kinds."""

LOST = 3.0
"""s without a heartbeat after which the most impatient client, MAVSDK, takes a vehicle for lost. The clock of tests
hardly goes on while callbacks run (tests/support/clock.py), so that this finds a timer that was lost, not one that had
to wait: `LONGEST_TURN` is for that. The heartbeat's own jitter is measured by tests/bench/heartbeat.py."""

LONGEST_TURN = 0.5
"""s of processor time in one turn of the loop, of client, gateway and simulator together. A heartbeat that is due waits
for the turn that runs; half a second on top of its second is far from `LOST`. On two cores of a Xeon at 2.5 GHz the
longest one takes 0.03 s, for a batch."""

HEIGHT = 20.0
"""m: room for what moves."""

UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED

MOTION = {
    "ardrone3.Piloting.TakeOff",
    "ardrone3.Piloting.UserTakeOff",
    "ardrone3.Piloting.Landing",
    "ardrone3.Piloting.Emergency",
    "ardrone3.Piloting.moveTo",
    "ardrone3.Piloting.StartPilotedPOIV2",
    "move.extended_move_to",
    "move.extended_move_by",
    "rth.return_to_home",
    "common.Mavlink.Start",
    "follow_me.start",
    "gimbal.set_target",
}
"""Commands of Parrot's that move something. A moveBy of zeros is a stop; others count too, and so do sticks."""


def motions(w: World, since: float) -> list[str]:
    """What the drone was commanded to do after a moment of the log."""
    return [
        entry.name
        for entry in w.drone.log
        if entry.kind == "command"
        and entry.t > since
        and (
            entry.name in MOTION
            or (entry.name == "ardrone3.Piloting.moveBy" and any(entry.args[key] for key in ("dX", "dY", "dZ", "dPsi")))
            or (entry.name == "ardrone3.Piloting.PCMD" and any(entry.args[k] for k in ("roll", "pitch", "yaw", "gaz")))
        )
    ]


FLYING = (
    attitude(pitch=-0.1),
    local(VELOCITY_ONLY, v=(1.0, 0.0, 0.0)),
    local(POSITION_ONLY, frame=9, at=(5.0, 0.0, 0.0)),
    earth(POSITION_ONLY, 6, north=20.0, height=10.0),
    dialect.MAVLink_manual_control_message(1, 500, 0, 500, 0, 0),
    dialect.MAVLink_rc_channels_override_message(1, 1, 1500, 1300, 1500, 1500, 0, 0, 0, 0),
    dialect.MAVLink_follow_target_message(
        0, 1, round(HOME[0] * 1e7), round(HOME[1] * 1e7), HOME[2], [1.0] * 3, ZERO, [1.0, 0.0, 0.0, 0.0], ZERO, ZERO, 0
    ),
    dialect.MAVLink_mission_count_message(1, 1, 2),
    dialect.MAVLink_mission_set_current_message(1, 1, 0),
    dialect.MAVLink_mission_item_int_message(
        1, 1, 0, 6, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, round(HOME[0] * 1e7), round(HOME[1] * 1e7), 10.0
    ),
)
"""What clients fly a drone with, besides commands and modes, each of which has a test for all of its values."""

MUTATED = 0.01
"""Share of the frames in the air that are one of these with up to three other bytes, and a right checksum."""


def frames_in_the_air(source: random.Random) -> Iterator[bytes]:
    """What flies a drone as it is, then random frames and mutated ones."""
    packer = dialect.MAVLink(None, 255, 190)
    payloads = [(message.get_msgId(), message.pack(packer)[10:-2]) for message in FLYING]
    others = random_frames(source)
    yield from (framed(id, payload, 0) for id, payload in payloads)
    for count in itertools.count():
        if source.random() >= MUTATED:
            yield next(others)
            continue
        id, payload = source.choice(payloads)
        changed = bytearray(payload)
        for _ in range(source.randint(0, 3)):
            changed[source.randrange(len(changed))] = source.randrange(256)
        yield framed(id, bytes(changed), count % 256)


def is_guided_item(frame: bytes) -> bool:
    """Whether a frame is a mission item with `current` 2 or 3: a goto or a change of altitude of a PX4, and of an
    ArduPilot in Guided (conformance 141), with tests of its own."""
    id = message_id(frame)
    if id not in (dialect.MAVLINK_MSG_ID_MISSION_ITEM, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT):
        return False
    place = 10 + offset(newer.mavlink_map[id], "current")
    return place < len(frame) and frame[place] in (2, 3)


def is_region_of_interest(frame: bytes) -> bool:
    """Whether a frame makes places of the targets in MOUNT_CONTROL: a flight task with tests of its own."""
    if message_id(frame) != dialect.MAVLINK_MSG_ID_MOUNT_CONFIGURE:
        return False
    place = 10 + offset(newer.mavlink_map[dialect.MAVLINK_MSG_ID_MOUNT_CONFIGURE], "mount_mode")
    return place < len(frame) and frame[place] >= dialect.MAV_MOUNT_MODE_GPS_POINT


TO_GIMBAL = (
    newer.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_ATTITUDE,
    newer.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_PITCHYAW,
    newer.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_MANUAL_CONTROL,
    newer.MAVLINK_MSG_ID_MOUNT_CONTROL,
)
"""They turn the gimbal while no client has control of it (docs/gimbal.md), and have a test of their own."""


def is_to_gimbal(frame: bytes) -> bool:
    return message_id(frame) in TO_GIMBAL


def message_id(frame: bytes) -> int | None:
    """Of a whole frame; None for what was cut off before it."""
    return int.from_bytes(frame[7:10], "little") if len(frame) >= 10 else None


class Mistakes(logging.Handler):
    """Errors in the log: an exception that was caught is one all the same."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.seen: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.seen.append(self.format(record))


@pytest.fixture
def mistakes() -> Iterator[list[str]]:
    handler = Mistakes()
    logging.getLogger().addHandler(handler)
    yield handler.seen
    logging.getLogger().removeHandler(handler)
    assert handler.seen == []


@contextmanager
def steady(w: World) -> Iterator[None]:
    """The heartbeat goes on within the block, and nothing keeps it waiting."""
    mark = w.client.mark()
    with clock.turns() as turns:
        yield
    beats = [at for at, _ in w.client.since(mark, "HEARTBEAT")]
    gaps = [b - a for a, b in itertools.pairwise(beats)]
    assert gaps
    assert max(gaps) < LOST, max(gaps)
    assert turns.longest < LONGEST_TURN, turns.longest


async def throw(w: World, frames: list[bytes], pause: float = BATCH_EVERY) -> None:
    """Send them, and return when the gateway has worked them off and the pause is over."""
    # What was cut off at the end swallows what follows, up to the longest frame.
    w.client.send_raw(b"".join(frames) + bytes(LONGEST))
    # An unsupported command is answered behind all of it.
    assert (await w.client.command(dialect.MAV_CMD_DO_GRIPPER, timeout=20.0)).result == UNSUPPORTED
    await asyncio.sleep(pause)


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_random_frames_on_the_ground(flavour: str, times: int, fuzz_seed: int, mistakes: list[str]) -> None:
    async with world(flavour=flavour) as w:
        frames = itertools.filterfalse(is_to_gimbal, random_frames(random.Random(f"{fuzz_seed} {flavour}")))
        began = w.drone.log[-1].t
        with steady(w):
            for _ in range(times * ON_THE_GROUND // BATCH):
                await throw(w, list(itertools.islice(frames, BATCH)))
        assert motions(w, began) == []
        assert w.drone.flying_state.name == "LANDED"
        assert mistakes == []


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_random_frames_to_the_gimbal_turn_only_that(flavour: str, fuzz_seed: int, mistakes: list[str]) -> None:
    """Beside random ones are some whose numbers are angles, so that they turn it."""
    source = random.Random(f"{fuzz_seed} gimbal {flavour}")
    async with world(flavour=flavour) as w:
        await w.take_off(HEIGHT)
        place, began = w.drone.pose, w.drone.log[-1].t
        frames = random_frames(source, TO_GIMBAL)
        with steady(w):
            for _ in range(12):
                batch = list(itertools.islice(frames, BATCH // 4))
                for sequence in range(20):
                    angles = struct.pack("<4f", *(source.uniform(-1.0, 1.0) for _ in range(4)))
                    payload = source.randbytes(4) + angles + bytes((1, source.choice((1, 154)), source.randint(0, 2)))
                    batch.append(framed(newer.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_PITCHYAW, payload, sequence))
                source.shuffle(batch)
                await throw(w, batch)
        assert set(motions(w, began)) == {"gimbal.set_target"}
        assert apart(place, w.drone.pose) < STIRRED
        assert mistakes == []


TO_CAMERA = (
    newer.MAVLINK_MSG_ID_COMMAND_LONG,
    newer.MAVLINK_MSG_ID_COMMAND_INT,
    newer.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
    newer.MAVLINK_MSG_ID_PARAM_EXT_REQUEST_LIST,
    newer.MAVLINK_MSG_ID_PARAM_EXT_REQUEST_READ,
    newer.MAVLINK_MSG_ID_PARAM_EXT_SET,
)


async def test_random_frames_to_the_camera_are_survived(fuzz_seed: int, mistakes: list[str]) -> None:
    source = random.Random(f"{fuzz_seed} camera")
    known = [newer.MAVLink_param_ext_set_message(1, 100, name, bytes(128), 6) for name in (b"CAM_MODE", b"CAM_VIDMODE")]
    async with world(model="thermal") as w:
        frames = random_frames(source, TO_CAMERA, CAMERA)
        began = w.drone.log[-1].t
        with steady(w):
            for _ in range(12):
                batch = list(itertools.islice(frames, BATCH // 2))
                for message in (source.choice(known) for _ in range(20)):
                    payload = bytearray(message.pack(newer.MAVLink(None))[10:-2].ljust(message.unpacker.size, b"\0"))
                    payload[18:22] = source.randbytes(4)
                    payload[146] = source.choice((1, 1, 6, 9, source.randrange(256)))
                    batch.append(framed(message.get_msgId(), bytes(payload), source.randrange(256)))
                await throw(w, batch)
        assert motions(w, began) == []
        assert mistakes == []


@pytest.mark.parametrize(("model", "skycontroller"), [("4k", None), ("thermal", 3), ("ai", 4)])
async def test_random_events_of_the_drone_are_survived(
    model: str, skycontroller: int | None, fuzz_seed: int, mistakes: list[str]
) -> None:
    source = random.Random(f"{fuzz_seed} {model}")
    async with world(model=model, skycontroller=skycontroller, web=True) as w, aiohttp.ClientSession() as browser:
        assert w.gateway.web is not None
        await w.take_off(5.0)
        with steady(w):
            for _ in range(EVENT_BATCHES):
                for kind in source.choices(EVENTS, k=EVENTS_AT_ONCE):
                    w.drone.inject(random_event(kind, source))
                await asyncio.sleep(BATCH_EVERY)
                for id in source.choices(tuple(dialect.mavlink_map), k=10):
                    component = source.choice((1, 100, 154))
                    w.client.send(
                        dialect.MAVLink_command_long_message(
                            1, component, dialect.MAV_CMD_REQUEST_MESSAGE, 0, float(id), 0, 0, 0, 0, 0, 0
                        )
                    )
                for path in ("drones", "status.json", "metrics"):
                    async with browser.get(f"{w.gateway.web.describe()}{path}") as answer:
                        assert answer.status == 200
                assert w.gateway.lines()


async def test_charge_that_no_field_holds_leaves_battery_status(mistakes: list[str]) -> None:
    async with world(model="ai") as w:
        w.drone.inject(battery.Capacity(0xFFFFFFFF, 0))
        mark = w.client.mark()
        await w.client.wait("BATTERY_STATUS", lambda status: status.current_consumed == 0x7FFFFFFF, since=mark)


async def test_fields_named_id_are_not_taken_for_message_ids(mistakes: list[str]) -> None:
    """A field `id` hides pymavlink's attribute of that name: STATUSTEXT with id 76 is no COMMAND_LONG."""
    named = [kind for kind in newer.mavlink_map.values() if "id" in kind.fieldnames]
    assert newer.MAVLink_distance_sensor_message in named
    frames = []
    for kind, number in itertools.product(named, range(128)):
        payload = bytearray(LONGEST)
        payload[offset(kind, "id")] = number
        frames.append(framed(kind.id, bytes(payload[: kind.unpacker.size]), number))
    async with world() as w:
        began = w.drone.log[-1].t
        await throw(w, frames)
        assert motions(w, began) == []
        assert mistakes == []


MAY_FLY: dict[str, dict[int, str]] = {
    "hold": {},  # setpoints fly a PX4 in mode Offboard, sticks in mode Position, targets in mode Follow Me
    "brake": {},  # neither do they fly an ArduPilot in Brake
    "guided": {
        dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: "an attitude and a climb of a vehicle in Guided",
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: "dronekit's and MAVProxy's velocities and offsets",
        dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: "Mission Planner's Fly to Here",
    },
}
"""The messages that move a drone in each mode, and why they may: ArduPilot's Guided is the mode that setpoints fly in
(ArduPilot copter-commands-in-guided-mode.rst)."""

STIRRED = 0.5
"""m that no one notices in the air."""


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize(("flavour", "mode"), [("px4", "hold"), ("ardupilot", "brake"), ("ardupilot", "guided")])
async def test_random_frames_in_the_air(
    flavour: str, mode: str, times: int, fuzz_seed: int, mistakes: list[str]
) -> None:
    """Frames that may move the drone are thrown one by one, the others together: none of those moves it."""
    async with world(flavour=flavour) as w:
        await w.take_off(HEIGHT)
        custom_mode = COPTER_BRAKE if mode == "brake" else w.modes.hold
        if mode == "brake":
            assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, COPTER_BRAKE)).result == 0
        frames = itertools.filterfalse(is_region_of_interest, frames_in_the_air(random.Random(f"{fuzz_seed} {mode}")))
        frames = itertools.filterfalse(is_to_gimbal, frames)
        if mode != "brake":
            frames = itertools.filterfalse(is_guided_item, frames)
        moved: set[int] = set()
        with steady(w):
            for _ in range(times * IN_THE_AIR[mode] // BATCH):
                flying, others = [], []
                for frame in itertools.islice(frames, BATCH):
                    (flying if message_id(frame) in MAY_FLY[mode] else others).append(frame)
                place, began = w.drone.pose, w.drone.log[-1].t
                await throw(w, others)
                assert motions(w, began) == []
                assert apart(place, w.drone.pose) < STIRRED
                for frame in flying:
                    began = w.drone.log[-1].t
                    await throw(w, [frame], FRAME_EVERY)
                    if motions(w, began):
                        moved.add(message_id(frame) or 0)
                        await stop(w)
                assert w.drone.flying_state.name in ("HOVERING", "FLYING")
        mark = w.client.mark()
        await w.client.heartbeat(lambda beat: beat.custom_mode == custom_mode, since=mark)
        assert moved == set(MAY_FLY[mode])
        assert mistakes == []


def apart(one: Pose, other: Pose) -> float:
    """m."""
    return math.dist((one.north, one.east, one.up), (other.north, other.east, other.up))


async def stop(w: World) -> None:
    """What a setpoint in Guided has begun is ended; the drone stands still, in Guided."""
    for mode in (COPTER_BRAKE, COPTER_GUIDED):
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, mode)).result == 0
    await w.client.wait("LOCAL_POSITION_NED", lambda m: math.hypot(m.vx, m.vy, m.vz) < 0.05, timeout=10.0)


EXTREMES = (NAN, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-40, 0.0)
"""What each parameter is in turn; 1e-40 is a denormal number, as an integer in the place of a float looks."""

GOING_DOWN = (dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, dialect.MAV_CMD_NAV_LAND)
"""They mean what they mean whatever their parameters are, so these are tried out on the ground."""

Parameters = tuple[float, ...]

MAY_MOVE: dict[int, Callable[[Parameters], bool]] = {
    # A heading alone turns the drone (QGroundControl); 0 and 1e-40 are headings.
    dialect.MAV_CMD_DO_REPOSITION: lambda p: abs(p[3]) < 1.0 and all(math.isnan(v) for v in p[4:]),
    # An angle to turn to, or by.
    dialect.MAV_CMD_CONDITION_YAW: lambda p: abs(p[0]) <= 360.0,
    # All default: a circle around where the drone is. Its yaw behaviour and its angle may be given.
    dialect.MAV_CMD_DO_ORBIT: lambda p: all(math.isnan(v) for v in (*p[:2], *p[4:])),
    # Angles of the gimbal, or a rate of its pitch.
    dialect.MAV_CMD_DO_MOUNT_CONTROL: lambda p: any(abs(v) < 1.0 for v in p[:2]),
    dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: lambda p: abs(p[0]) < 1.0 or abs(p[2]) < 1.0,
}
"""The commands that move the drone or its gimbal with parameters like these, and with which of them."""


async def handled(w: World) -> list[int]:
    """The commands that the gateway knows."""
    known = []
    for id in sorted(newer.enums["MAV_CMD"]):
        if (await w.client.command(id, NAN, NAN, NAN, NAN)).result != UNSUPPORTED:
            known.append(id)
    return known


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_commands_with_invalid_numbers_are_answered(flavour: str, mistakes: list[str]) -> None:
    async with world(flavour=flavour, speed=5.0) as w:
        known = await handled(w)
        assert {*GOING_DOWN, *MAY_MOVE} <= set(known)
        began = w.drone.log[-1].t
        for id in GOING_DOWN:
            # A Landing leaves on the ground, too: another controller's take-off may not be reported yet.
            await each(w, id, began, lambda p: False, harmless=frozenset({"ardrone3.Piloting.Landing"}))
        assert w.drone.flying_state.name == "LANDED"
        # Whatever take-off some of it asked for is not carried out: arming is a step of its own.
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)).result == 0
        await w.take_off()
        with steady(w):
            for id in known:
                if id not in GOING_DOWN:
                    await each(w, id, w.drone.log[-1].t, MAY_MOVE.get(id, lambda p: False))
                    assert w.drone.flying_state.name in ("HOVERING", "FLYING"), id
        assert mistakes == []


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_mission_commands_with_invalid_numbers_are_answered(flavour: str, mistakes: list[str]) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ROUND)
        began = w.drone.log[-1].t
        for id in (dialect.MAV_CMD_MISSION_START, dialect.MAV_CMD_DO_SET_MISSION_CURRENT):
            await each(w, id, began, lambda p: False)  # no one arms
        assert w.drone.flying_state.name == "LANDED"
        assert mistakes == []


async def each(
    w: World,
    id: int,
    since: float,
    may_move: Callable[[Parameters], bool],
    *,
    harmless: frozenset[str] = frozenset(),
) -> None:
    """Send a command with each parameter at each extreme, the others unset or 0; nothing moves but what may.

    `harmless`: commands that move nothing here.
    """
    for others, slot, extreme in itertools.product((NAN, 0.0), range(7), EXTREMES):
        p = [others] * 7
        p[slot] = extreme
        ack = await w.client.command(id, *p[:4], x=p[4], y=p[5], z=p[6], timeout=20.0)
        assert ack.result != dialect.MAV_RESULT_FAILED, (id, p)
        await asyncio.sleep(COMMAND_EVERY)
        if moved := [name for name in motions(w, since) if name not in harmless]:
            assert may_move(tuple(p)), (id, p, moved)
            since = w.drone.log[-1].t

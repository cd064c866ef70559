"""What is flying, and what arrives meanwhile: one cell of a matrix, judged by the simulated drone's log.

`tests/bench/flight_matrix.py` prints all cells, `tests/conformance/test_flight_matrix.py` runs a selection. A finding:
no final answer or two of them, an acceptance that the drone does not follow, a refusal that changes the flight, a
climb or task that ends without acceptance and text, or a person who can no longer hold, land and disarm.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav import geo
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim.skycontroller import TAKEOFF_LAND
from anafi_mav.vehicle.hold_rule import APART
from support.fault_scenarios import return_by_itself
from support.mav import NAN, Client
from support.missions import ACTIVE, CORNERS, PAUSED, put, start, state
from support.missions import PLACE as HERE
from support.params import send_set
from support.plans import FENCE, MISSION, Item, clear, square, upload
from support.setpoints import VELOCITY_ONLY, attitude, engage, local, streaming, texts
from support.world import HOME, World, world

Cmd = dialect
NAMES = {0: "ACCEPTED", 1: "REJECTED", 2: "DENIED", 3: "UNSUPPORTED", 4: "FAILED", 6: "CANCELLED"}
ACTING = ("TakeOff", "Landing", "Emergency", "moveBy", "moveTo", "CancelMoveBy", "CancelMoveTo", "extended_move_to",
          "extended_move_by", "return_to_home", "abort", "Start", "Pause", "Stop", "StartPilotedPOIV2",
          "StopPilotedPOI", "UserTakeOff")  # fmt: skip
"""Commands that fly, stop or lead the drone, by the last part of Parrot's names; PCMD with a deflection is one too."""

DOWN = (FlyingState.LANDING, FlyingState.LANDED, FlyingState.EMERGENCY_LANDING)
WINDOW = 4.0
"""s after the answer in which its effect is looked for."""

PATIENCE = 45.0
"""s for an answer: a command waits 30 s for the end of a take-off at most."""


@dataclass
class Cell:
    """One flight, and what came of it."""

    w: World
    stack: AsyncExitStack
    program: Client
    """Streams, when something is flown by setpoints."""
    answers: list[str] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)

    @property
    def px4(self) -> bool:
        return self.w.flavour == "px4"

    @property
    def mode(self) -> int:
        return next(int(m.custom_mode) for _, m in reversed(self.w.client.received) if m.get_type() == "HEARTBEAT")

    @property
    def speed(self) -> float:
        return float(self.w.drone.pose.ground_speed)

    @property
    def returns(self) -> bool:
        return self.w.drone.firmware.homing.active

    def acts(self, since: float) -> list[str]:
        """Commands that the drone received since a moment and that change its flight."""
        found = [e for e in self.w.drone.log if e.kind == "command" and e.t > since]
        names = [(e.name.rpartition(".")[2], e.args) for e in found]
        return [n for n, a in names if n in ACTING or (n == "PCMD" and any(a[k] for k in _AXES))]

    def climb_ended(self, since: float) -> bool:
        """True when a moveBy has ended short of its end since a moment."""
        ends = [e for e in self.w.drone.log if e.t > since and e.name.endswith("moveByEnd")]
        return any(e.args["error"] != 0 for e in ends)

    async def until(self, holds: Callable[[], bool], timeout: float) -> bool:
        """Wait for a state of the drone; False when it does not come."""
        if holds():
            return True
        try:
            await self.w.drone.wait_log(lambda e: holds(), timeout)
        except (AssertionError, TimeoutError, asyncio.TimeoutError):
            return False
        return True

    async def flows(self, message: Any) -> None:
        await self.stack.enter_async_context(streaming(self.program, message))

    async def done(self, command: int, *params: float, **more: Any) -> None:
        """A command of the preparation, which must be accepted."""
        ack = await self.program.command(command, *params, timeout=PATIENCE, **more)
        assert ack.result == 0, (command, ack.result, texts(self.w.client)[-3:])

    async def mode_of(self, px4: tuple[int, ...], copter: int) -> None:
        await self.done(Cmd.MAV_CMD_DO_SET_MODE, *((1, *px4) if self.px4 else (1, copter)))


_AXES = ("roll", "pitch", "yaw", "gaz")


def north(meters: float) -> dict[str, float]:
    latitude, longitude = geo.destination(*HOME[:2], meters, 0.0)
    return {"x": latitude, "y": longitude}


# What is flying.


async def _armed(c: Cell, height: float) -> None:
    if not c.px4:
        await c.done(Cmd.MAV_CMD_DO_SET_MODE, 1, 4)
    await c.done(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    c.program.send_command(Cmd.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=height)


async def ground(c: Cell) -> None: ...


async def motors(c: Cell) -> None:
    await _armed(c, 6.0)
    await c.until(lambda: c.w.drone.flying_state is FlyingState.MOTOR_RAMPING, 9.0)


async def climb(c: Cell) -> None:
    await _armed(c, 30.0)
    await c.until(lambda: c.w.drone.pose.up > 3.0, 20.0)


async def hover(c: Cell) -> None:
    await c.w.take_off(12.0)


async def goto(c: Cell) -> None:
    await hover(c)
    await c.done(Cmd.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6, **north(90.0), z=12.0)
    await c.until(lambda: c.w.drone.pose.north > 5.0, 20.0)


async def orbit(c: Cell) -> None:
    await hover(c)
    await c.done(Cmd.MAV_CMD_DO_ORBIT, 15.0, 3.0, x=NAN, y=NAN, z=NAN)
    await c.until(lambda: abs(c.w.drone.pose.east) > 3.0, 40.0)


async def region(c: Cell) -> None:
    await hover(c)
    await c.done(Cmd.MAV_CMD_DO_SET_ROI_LOCATION, frame=6, **north(40.0), z=0.0)


async def velocity(c: Cell) -> None:
    await hover(c)
    await c.flows(local(VELOCITY_ONLY, v=(3.0, 0.0, 0.0)))
    await engage(c.program, c.w.flavour)
    await c.until(lambda: c.speed > 1.5, 20.0)


async def attitudes(c: Cell) -> None:
    await hover(c)
    await c.flows(attitude(-0.1))
    await engage(c.program, c.w.flavour)
    await c.until(lambda: c.speed > 1.5, 20.0)


async def joystick(c: Cell) -> None:
    await hover(c)
    await c.mode_of((3, 0), 5)
    await c.flows(Cmd.MAVLink_manual_control_message(1, 400, 0, 500, 0, 0))
    await c.until(lambda: c.speed > 1.5, 20.0)


async def mission(c: Cell) -> None:
    far = [Item(Cmd.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, z=8.0, p4=NAN, frame=3), *(_way(80.0, e) for e in (0.0, 80.0))]
    await put(c.w, far)
    await start(c.w)
    await state(c.w, ACTIVE, seq=1, since=0)
    await c.until(lambda: c.w.drone.pose.north > 3.0, 20.0)


async def paused_mission(c: Cell) -> None:
    await mission(c)
    await c.done(Cmd.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    await state(c.w, PAUSED, since=0)
    flown = c.mode
    await c.w.client.heartbeat(lambda beat: beat.custom_mode != flown, since=0)
    await c.w.client.heartbeat(lambda beat: True)


async def homeward(c: Cell) -> None:
    await goto(c)
    await c.until(lambda: c.w.drone.pose.north > 70.0, 60.0)
    await c.done(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    await c.until(lambda: c.returns and c.speed > 1.0, 20.0)


async def own_return(c: Cell) -> None:
    await goto(c)
    await c.until(lambda: c.w.drone.pose.north > 70.0, 60.0)
    return_by_itself(c.w)
    await c.w.client.heartbeat(lambda beat: beat.custom_mode == c.w.modes.returning)


async def landing(c: Cell) -> None:
    await hover(c)
    await c.done(Cmd.MAV_CMD_NAV_LAND)
    await c.until(lambda: c.w.drone.flying_state in DOWN, 9.0)


async def follow(c: Cell) -> None:
    await hover(c)
    await c.mode_of((4, 8), 23)
    latitude, longitude = geo.destination(*HOME[:2], 60.0, 0.0)
    place = (round(latitude * 1e7), round(longitude * 1e7), HOME[2])
    message = (0, 1, *place, [0.0] * 3, [NAN] * 3, [1.0, NAN, NAN, NAN], [NAN] * 3, [NAN] * 3, 0)
    await c.flows(Cmd.MAVLink_follow_target_message(*message))
    await c.until(lambda: c.speed > 1.0, 20.0)


def _way(n: float, e: float) -> Item:
    latitude, longitude = geo.destination(*geo.destination(*HERE, n, 0.0), 0.0, e)
    return Item(Cmd.MAV_CMD_NAV_WAYPOINT, latitude, longitude, z=8.0, p4=NAN, frame=3)


SITUATIONS: Mapping[str, Callable[[Cell], Awaitable[None]]] = {
    "ground": ground, "motors": motors, "climb": climb, "hover": hover, "goto": goto, "orbit": orbit, "region": region,
    "velocity": velocity, "attitude": attitudes, "joystick": joystick, "mission": mission, "paused": paused_mission,
    "return": homeward, "own return": own_return, "landing": landing, "follow": follow,
}  # fmt: skip
STREAMED = ("velocity", "attitude", "joystick", "follow", "orbit")
"""What is flown by sticks of the gateway: PCMD is no sign of a change there."""
WAITING = ("REPOSITION", "YAW", "ROI", "ORBIT")
"""What follows a take-off instead of ending it."""
PASSING = ("motors", "landing")
"""What goes on to another state by itself."""


# What arrives.


@dataclass(frozen=True)
class Arrival:
    """A message of a station, and what the drone does when it is accepted."""

    send: Callable[[Cell], Awaitable[None]]
    effect: Callable[[Cell, float], bool] | None = None
    """True when the drone does it, given the moment of its arrival; None: nothing is to be seen."""
    harmless: bool = False
    """It never changes what is flown, accepted or not."""


def _command(id: int, *params: float, **more: Any) -> Callable[[Cell], Awaitable[None]]:
    """A command, whose only final acknowledgement is waited for; a second one is a finding."""

    async def send(c: Cell) -> None:
        client, mark = c.w.client, c.w.client.mark()
        try:
            ack = await client.command(id, *params, timeout=PATIENCE, **more)
        except AssertionError:
            c.findings.append("no final answer")
            return
        c.answers.append(NAMES.get(ack.result, str(ack.result)))
        await asyncio.sleep(WINDOW)  # the time in which a second answer, or the effect, may show
        finals = [m for _, m in client.since(mark, "COMMAND_ACK") if m.command == id and m.result != 5]
        if len(finals) != 1:
            c.findings.append(f"{len(finals)} final answers")

    return send


def _mode(px4: tuple[int, ...], copter: int | None) -> Callable[[Cell], Awaitable[None]]:
    async def send(c: Cell) -> None:
        numbers = (1, *px4) if c.px4 else (1, 4 if copter is None else copter)
        await _command(Cmd.MAV_CMD_DO_SET_MODE, *numbers)(c)

    return send


def _write(name: str, value: float, kind: int = 9) -> Callable[[Cell], Awaitable[None]]:
    async def send(c: Cell) -> None:
        mark = c.w.client.mark()
        send_set(c.w.client, name, value, kind, c.w.flavour)
        await c.w.client.wait("PARAM_VALUE", lambda m: m.param_id == name, since=mark, timeout=PATIENCE)
        c.answers.append("answered")
        await asyncio.sleep(WINDOW)

    return send


def _plan(kind: int, items: list[Item]) -> Callable[[Cell], Awaitable[None]]:
    async def send(c: Cell) -> None:
        ack = await (upload(c.w.client, items, kind, timeout=PATIENCE) if items else clear(c.w.client, kind))
        c.answers.append(f"plan {ack.type}")
        await asyncio.sleep(WINDOW)

    return send


async def _cancel(c: Cell) -> None:
    for command in (Cmd.MAV_CMD_NAV_TAKEOFF, Cmd.MAV_CMD_DO_REPOSITION, Cmd.MAV_CMD_NAV_LAND):
        c.w.client.send(newer.MAVLink_command_cancel_message(1, 1, command))
    await asyncio.sleep(WINDOW)


def _controller(do: Callable[[Any], None]) -> Callable[[Cell], Awaitable[None]]:
    async def send(c: Cell) -> None:
        do(c.w.drone.skycontroller)
        await asyncio.sleep(WINDOW)

    return send


def _stopped(c: Cell, since: float) -> bool:
    return c.speed < 0.5 and abs(c.w.drone.pose.vd) < 0.3 and not c.returns


def _heard(*names: str) -> Callable[[Cell, float], bool]:
    return lambda c, since: any(name in names for name in c.acts(since))


_down = lambda c, since: c.w.drone.flying_state in DOWN  # noqa: E731
_moves = _heard("moveBy", "moveTo", "extended_move_to", "extended_move_by")
_looks = _heard("StartPilotedPOIV2")
_rests = lambda c, since: c.w.drone.flying_state is FlyingState.LANDED  # noqa: E731

ARRIVALS: Mapping[str, Arrival] = {
    "ARM": Arrival(_command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1), harmless=True),
    "DISARM": Arrival(_command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 0), _rests),
    "TAKEOFF": Arrival(_command(Cmd.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=9.0)),
    "LAND": Arrival(_command(Cmd.MAV_CMD_NAV_LAND), _down),
    "RETURN": Arrival(_command(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH), lambda c, since: c.returns or _down(c, since)),
    "REPOSITION": Arrival(_command(Cmd.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6, **north(-30.0), z=14.0), _moves),
    "REPOSITION stop": Arrival(_command(Cmd.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6), _stopped),
    "SPEED": Arrival(_command(Cmd.MAV_CMD_DO_CHANGE_SPEED, 1, 4.0, -1)),
    "ALTITUDE": Arrival(_command(Cmd.MAV_CMD_DO_CHANGE_ALTITUDE, 16.0, 3), _moves),
    "YAW": Arrival(_command(Cmd.MAV_CMD_CONDITION_YAW, 120.0, 0.0, 0.0, 0.0), _moves),
    "ORBIT": Arrival(_command(Cmd.MAV_CMD_DO_ORBIT, 10.0, 2.0, x=NAN, y=NAN, z=NAN), _heard("moveTo", "PCMD")),
    "ROI": Arrival(
        _command(Cmd.MAV_CMD_DO_SET_ROI_LOCATION, frame=6, **north(30.0), z=0.0), _heard("StartPilotedPOIV2")
    ),
    "ROI none": Arrival(_command(Cmd.MAV_CMD_DO_SET_ROI_NONE)),
    "GIMBAL": Arrival(_command(Cmd.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -30.0, 0.0, NAN, NAN, x=0.0, z=0.0)),
    "PHOTO": Arrival(_command(Cmd.MAV_CMD_IMAGE_START_CAPTURE, 0, 0, 1, 0), harmless=True),
    "PAUSE": Arrival(_command(Cmd.MAV_CMD_DO_PAUSE_CONTINUE, 0), _stopped),
    "CONTINUE": Arrival(_command(Cmd.MAV_CMD_DO_PAUSE_CONTINUE, 1)),
    "HOME here": Arrival(_command(Cmd.MAV_CMD_DO_SET_HOME, 1), harmless=True),
    "MISSION_START": Arrival(_command(Cmd.MAV_CMD_MISSION_START, 0, 0)),
    "SET_CURRENT": Arrival(_command(Cmd.MAV_CMD_DO_SET_MISSION_CURRENT, 1)),
    "TERMINATE": Arrival(_command(Cmd.MAV_CMD_DO_FLIGHTTERMINATION, 1), harmless=True),
    "CALIBRATE": Arrival(_command(Cmd.MAV_CMD_PREFLIGHT_CALIBRATION, 0, 1), harmless=True),
    "REBOOT": Arrival(_command(Cmd.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)),
    "mode hold": Arrival(_mode((4, 3), 17), _stopped),
    "mode position": Arrival(_mode((3, 0), 5)),
    "mode guided": Arrival(_mode((6, 0), None)),
    "mode mission": Arrival(_mode((4, 4), 3)),
    "mode return": Arrival(_mode((4, 5), 6), lambda c, since: c.returns or _down(c, since)),
    "mode land": Arrival(_mode((4, 6), 9), _down),
    "mode follow": Arrival(_mode((4, 8), 23)),
    "mode none": Arrival(_mode((11, 0), 1), harmless=True),
    "param tilt": Arrival(_write("ANF_MAX_TILT", 20.0), harmless=True),
    "param ceiling": Arrival(_write("ANF_MAX_ALT", 60.0), harmless=True),
    "param distance": Arrival(_write("ANF_MAX_DIST", 500.0), harmless=True),
    "param camera": Arrival(_write("ANF_CAM_RELATIVE", 1, 6)),
    "plan upload": Arrival(_plan(MISSION, CORNERS)),
    "plan clear": Arrival(_plan(MISSION, [])),
    "fence upload": Arrival(_plan(FENCE, square(HERE, 300.0)), harmless=True),
    "COMMAND_CANCEL": Arrival(_cancel, harmless=True),
    "pilot stick": Arrival(_controller(lambda pilot: pilot.stick(3, 40))),
    "pilot land": Arrival(_controller(lambda pilot: pilot.press(TAKEOFF_LAND))),
}


# The judgement.


async def _stop(c: Cell, *, holds: bool) -> None:
    """Whatever came before, a person can hold the drone, land it and disarm it.

    `holds` is False for the landing of the Skycontroller's pilot, which no Hold ends.
    """
    pilot = c.w.drone.skycontroller
    if pilot is not None:
        pilot.stick(3, 0)
    client = c.w.client
    for _ in range(2 if holds else 0):  # a Hold ends a return of the drone's own when no other preceded it by 5 s
        hold = await client.command(Cmd.MAV_CMD_DO_SET_MODE, *((1, 4, 3) if c.px4 else (1, 17)), timeout=PATIENCE)
        if hold.result == 0:
            break
        await asyncio.sleep(APART)
    if holds and (hold.result != 0 or not await c.until(lambda: c.speed < 0.5 and not c.returns, 8.0)):
        c.findings.append(f"hold: {NAMES[hold.result]}, {c.speed:.1f} m/s {texts(client)[-1:]}")
    land = await client.command(Cmd.MAV_CMD_NAV_LAND, timeout=PATIENCE)
    if land.result != 0 or not await c.until(lambda: c.w.drone.flying_state is FlyingState.LANDED, 60.0):
        c.findings.append(f"land: {NAMES[land.result]} {c.w.drone.flying_state.name} {texts(client)[-1:]}")
    else:  # what the client's disarm may overtake
        await client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == dialect.MAV_LANDED_STATE_ON_GROUND)
    disarm = await client.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 0, timeout=PATIENCE)
    if disarm.result != 0:
        c.findings.append(f"disarm: {NAMES[disarm.result]} {texts(client)[-1:]}")


async def fly(situation: str, name: str, flavour: str) -> tuple[str, list[str]]:
    """Fly one cell; return its line and its findings."""
    arrival = ARRIVALS[name]
    options: dict[str, Any] = {"skycontroller": 3} if name.startswith("pilot") else {}
    async with AsyncExitStack() as stack:
        w = await stack.enter_async_context(world(flavour=flavour, web=True, speed=1.0, **options))
        c = Cell(w, stack, await w.connect(sysid=240))
        await SITUATIONS[situation](c)
        mark, mode, began, height = w.client.mark(), c.mode, asyncio.get_running_loop().time(), w.drone.pose.up
        await arrival.send(c)
        acts, said = c.acts(began), [text for text in texts(w.client, mark) if text[:5].lower() != "anafi"]
        accepted = c.answers == ["ACCEPTED"]
        if accepted and arrival.effect is not None and situation != "ground" and not arrival.effect(c, began):
            c.findings.append("accepted, not done")
        others = [one for one in acts if one != "PCMD" or situation not in STREAMED]
        untouched = situation in PASSING or (c.mode == mode and not others)
        if (arrival.harmless or not accepted) and not name.startswith(("pilot", "p")) and not untouched:
            c.findings.append("changed all the same")
        if name != "pilot land" and c.climb_ended(began) and not any("Climb" in text for text in said):
            c.findings.append("climb ended without a text")
        if name in WAITING and any("Climb" in text for text in said):
            c.findings.append("climb ended by what follows it")
        line = f"{'/'.join(c.answers) or '-'} | {mode:x}>{c.mode:x} | {height:.0f}>{w.drone.pose.up:.0f} m, "
        line += f"{c.speed:.1f} m/s | {' '.join(_runs(acts)) or '-'} | {'; '.join(said[-2:])}"
        if not (name == "REBOOT" and accepted):
            await _stop(c, holds=name != "pilot land")
        return f"{situation} | {name} | {line}", c.findings


def _runs(names: list[str]) -> list[str]:
    """Equal names in a row as one."""
    return [name for index, name in enumerate(names) if index == 0 or names[index - 1] != name]

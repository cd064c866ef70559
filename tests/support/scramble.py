"""One flight by commands of a client while the firmware scrambles its events, with another quirk beside it.

The flight is a take-off, a goto, an orbit, a mission, a return and a landing. It is judged by the simulated drone's own
log and state, by the acknowledgements, and by the texts that would be false. `ENDS` has the quirks that change an end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav import geo
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.vehicle.base.roll_sign import RollSign
from support.mav import NAN
from support.missions import ACTIVE, COMPLETE, MISSION_MODE, put, reached, takeoff, way, whole
from support.roll_records import remember_roll
from support.soak import errors_logged
from support.world import ARMED, HOME, World, world

SEEDS = 50

SPEED, CRUISE_SPEED = 1.0, 4.0
"""Simulated seconds in one: an event that is a second late is that late for the gateway. The second on the way home and
down, where nothing happens."""

MODELS, FLAVOURS = ("4k", "thermal", "usa", "ai"), ("px4", "ardupilot")

CIRCLING = {"px4": 0x01030000, "ardupilot": 7}

NORTH, RADIUS = 8.0, 5.0
"""m from where it takes off to the place of the goto, and of the orbit that begins there."""

HEIGHT = 6.0
"""m of all legs."""


@dataclass(frozen=True)
class Ends:
    """The end of each part of the flight that a quirk may change."""

    orbits: bool = True
    """False: the orbit is refused."""
    has_position: bool = True
    """False: goto, orbit and mission are refused, the return ends in a hover."""
    lands_at_home: bool = True
    """False: the return ends in a hover with a text, and a Land follows."""


ENDS = {
    Quirk.ROLL_INVERTED: Ends(orbits=False),
    Quirk.RTH_FINISHED_MISSING: Ends(lands_at_home=False),
    Quirk.GPS_LOCATION_STOPS: Ends(orbits=False, has_position=False, lands_at_home=False),
}
"""Quirks with other ends than without a quirk."""

HOVERS = "Return ended, hovering"

FALSE = (
    "another controller",
    "paused: drone stopped it",
    "Connection lost",
    HOVERS,
    "refused",
    "failed",
    "not this mission",
)
"""Parts of texts that are false in this flight."""


def quirk_of(seed: int) -> Quirk:
    """Return the quirk of a seed: each in turn."""
    return list(Quirk)[seed % len(Quirk)]


@dataclass
class ScrambledFlight:
    """A flight under way, and what is wrong with it."""

    w: World
    ends: Ends
    wrong: list[str] = field(default_factory=list)

    async def command(self, name: str, id: int, *params: float, accepted: bool = True, **where: Any) -> None:
        """Send a command; its result is part of the judgement."""
        ack = await self.w.client.command(id, *params, **where, timeout=30.0)
        if (ack.result == dialect.MAV_RESULT_ACCEPTED) is not accepted:
            self.wrong.append(f"{name} is answered {ack.result}")

    async def until(self, name: str, true: Any, timeout: float = 40.0) -> bool:
        """Wait until the simulated drone's state makes `true` true."""
        try:
            await self.w.drone.wait_log(lambda entry: bool(true()), timeout)
        except Exception as error:
            self.wrong.append(f"{name}: {error!r}"[:160])
            return False
        return True

    async def shows(self, name: str, mode: int, since: int, *, armed: bool = True) -> None:
        """Wait until the heartbeat has a mode."""

        def accept(beat: Any) -> bool:
            return bool(beat.base_mode & ARMED) is armed and (not armed or beat.custom_mode == mode)

        try:
            await self.w.client.heartbeat(accept, since=since, timeout=10.0)
        except AssertionError:
            beats = [m.custom_mode for _, m in self.w.client.since(since, "HEARTBEAT")]
            self.wrong.append(f"{name}: mode {mode:#x} is not shown: {[hex(b) for b in beats[-3:]]}")

    def near(self, north: float, east: float, up: float) -> bool:
        pose = self.w.drone.pose
        return math.dist((pose.north, pose.east, pose.up), (north, east, up)) < 0.8

    @property
    def hovering(self) -> bool:
        return self.w.drone.flying_state is FlyingState.HOVERING

    async def take_off(self) -> None:
        w = self.w
        if w.flavour == "ardupilot":
            await self.command("mode Guided", dialect.MAV_CMD_DO_SET_MODE, 1, w.modes.hold)
        await self.command("arm", dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        mark = w.client.mark()
        await self.command("take-off", dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=HEIGHT)
        await self.until("take-off", lambda: self.hovering and abs(w.drone.pose.up - HEIGHT) < 0.5)
        await self.shows("after take-off", w.modes.hold, mark)

    async def goto(self) -> None:
        w, mark = self.w, self.w.client.mark()
        place = geo.destination(*HOME[:2], NORTH, 0.0)
        await self.command(
            "goto",
            dialect.MAV_CMD_DO_REPOSITION,
            *(-1, 1, 0, NAN),
            frame=6,
            x=place[0],
            y=place[1],
            z=HEIGHT,
            accepted=self.ends.has_position,
        )
        if not self.ends.has_position:
            return
        await self.until("goto", lambda: self.near(NORTH, 0.0, HEIGHT) and self.hovering)
        await self.shows("after goto", w.modes.hold, mark)

    async def orbit(self) -> None:
        w, mark = self.w, self.w.client.mark()
        centre = geo.destination(*HOME[:2], NORTH, RADIUS)
        await self.command(
            "orbit",
            dialect.MAV_CMD_DO_ORBIT,
            *(RADIUS, 2.0, 5.0, NAN),
            frame=dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
            x=centre[0],
            y=centre[1],
            z=HOME[2] + HEIGHT if w.flavour == "px4" else HEIGHT,
            accepted=self.ends.orbits,
        )
        if not self.ends.orbits:
            return
        await self.shows("orbit", CIRCLING[w.flavour], mark)
        flown = await self.until("orbit", lambda: w.drone.pose.east > 0.7 * RADIUS, 20.0)
        if flown:
            away = math.dist((w.drone.pose.north, w.drone.pose.east), (NORTH, RADIUS))
            if abs(away - RADIUS) > 2.0:
                self.wrong.append(f"orbit: {away:.1f} m from the centre")
        mark = w.client.mark()
        await self.command("stop of the orbit", dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN)
        await self.shows("after the orbit", w.modes.hold, mark)
        await self.until("stop of the orbit", lambda: self.hovering)

    async def mission(self) -> None:
        w = self.w
        await put(w, [takeoff(HEIGHT), way(NORTH, 6.0, HEIGHT), way(NORTH, -2.0, HEIGHT)])
        mark = w.client.mark()
        await self.command("mission", dialect.MAV_CMD_MISSION_START, 0, 0, accepted=self.ends.has_position)
        if not self.ends.has_position:
            return
        await self.shows("mission", MISSION_MODE[w.flavour], mark)
        try:
            await w.client.wait(
                "MISSION_CURRENT", lambda m: whole(m).mission_state == COMPLETE, since=mark, timeout=40.0
            )
        except AssertionError:
            states = [(m.seq, whole(m).mission_state) for _, m in w.client.since(mark, "MISSION_CURRENT")]
            self.wrong.append(f"mission does not end: {states[-3:]}")
        if sorted(set(reached(w, mark))) != [0, 1, 2]:
            self.wrong.append(f"mission: items {reached(w, mark)} are reached")
        states = [whole(m).mission_state for _, m in w.client.since(mark, "MISSION_CURRENT")]
        if ACTIVE in states and set(states[states.index(ACTIVE) :]) != {ACTIVE, COMPLETE}:
            self.wrong.append(f"mission: states {states}")
        await self.until("mission", lambda: self.near(NORTH, -2.0, HEIGHT))
        await self.shows("after the mission", w.modes.idle, mark)

    async def go_home(self) -> None:
        w, mark = self.w, self.w.client.mark()
        await self.command("return", dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH)
        await self.shows("return", w.modes.returning, mark)
        w.simulator.speed = CRUISE_SPEED
        await self.until("return", lambda: math.hypot(w.drone.pose.north, w.drone.pose.east) < 2.0)
        w.simulator.speed = SPEED
        if self.ends.lands_at_home:
            await self.until("return", lambda: w.drone.flying_state is FlyingState.LANDING, 60.0)
        else:
            try:
                await w.client.wait("STATUSTEXT", lambda m: HOVERS in m.text, since=mark, timeout=60.0)
            except AssertionError:
                self.wrong.append("return: no text of its end")
            await self.until("return", lambda: self.hovering)
            await self.command("land", dialect.MAV_CMD_NAV_LAND)
        w.simulator.speed = CRUISE_SPEED
        await self.until("landing", lambda: w.drone.pose.up < 1.0)
        w.simulator.speed = SPEED
        await self.until("landing", lambda: w.drone.flying_state is FlyingState.LANDED)
        if math.hypot(w.drone.pose.north, w.drone.pose.east) > 1.5:
            self.wrong.append(f"landed at {w.drone.pose.north:.1f}, {w.drone.pose.east:.1f}")
        await self.shows("after the landing", 0, w.client.mark(), armed=False)

    def judge(self) -> None:
        """Texts that are false, and commands that the drone received for no reason."""
        w = self.w
        texts = [m.text for _, m in w.client.since(0, "STATUSTEXT")]
        allowed = [] if self.ends.lands_at_home else [HOVERS]
        allowed += [] if self.ends.orbits else ["Orbit refused", "Roll sign inverted"]
        allowed += [] if self.ends.has_position else ["Goto refused", "Mission refused"]
        self.wrong += [
            f"text: {text}"
            for text in texts
            if any(part in text for part in FALSE) and not any(part in text for part in allowed)
        ]
        for name, most in (("TakeOff", 1), ("Mavlink.Start", 1), ("return_to_home", 1)):
            commands = [e for e in w.drone.log if e.kind == "command" and e.name.endswith(name)]
            if len(commands) > most:
                self.wrong.append(f"{len(commands)} times {name}")


async def flown(seed: int, quirk: Quirk, folder: Path) -> list[str]:
    """Fly; return everything that is wrong. `folder` is XDG_STATE_HOME, and does not exist yet."""
    sign = RollSign.INVERTED if quirk is Quirk.ROLL_INVERTED else RollSign.NORMAL

    def before(drone: SimulatedDrone) -> None:
        state = folder / "anafi-mav"
        state.mkdir(parents=True)
        remember_roll(state, drone, sign)

    model, flavour = MODELS[seed % len(MODELS)], FLAVOURS[seed // len(MODELS) % len(FLAVOURS)]
    quirks = (f"scramble:{seed}",)
    with errors_logged() as logged:
        async with world(speed=SPEED, model=model, flavour=flavour, web=True, quirks=quirks, before=before) as w:
            w.drone.faults.quirks |= {quirk}
            flight = ScrambledFlight(w, ENDS.get(quirk, Ends()))
            for part in (flight.take_off, flight.goto, flight.orbit, flight.mission, flight.go_home, flight.judge):
                if (work := part()) is not None:
                    await work
    return [f"seed {seed}, {quirk.value}, {flavour}: {text}" for text in [*flight.wrong, *logged]]

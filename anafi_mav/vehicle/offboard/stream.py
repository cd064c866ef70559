"""Offboard: a program's setpoints fly the drone while they keep arriving. No I/O.

`OffboardStream` is one value: the newest setpoint of each client, and the `Engagement` of the client whose setpoints
fly the drone. What is known of an engagement is a part of it and ends with it. `OffboardFlight` stores the value and
flies the setpoint; what setpoints mean is in `setpoints` and `goals`. Positions and headings that count from the drone
are resolved once: the same setpoint again means the same place (`Steering`).

A session has one pilot: the client that engages it. Setpoints of others change nothing while it lasts. PX4's way to
engage is mode Offboard, refused without setpoints. ArduPilot's way is to send setpoints in mode Guided, and there a
single position is a move of its own, which nothing but its end or another order ends; a second setpoint of the same
program within `TOGETHER` makes a stream of it, whose end is silence. After that end a position of the same program is
a part of the stream for `LATE_AFTER_STREAM` longer: what a bad link delivers late must not send the drone off for good.

On the ground only a climb that one and the same client requests without a gap for `CLIMB_FOR` takes the drone off, and
every client is warned in that time: one packet, or the setpoint of a client that did not arm, starts no motor.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Hashable, Mapping
from typing import Any, NamedTuple

from msgspec import Struct, field
from msgspec.structs import replace

from anafi_mav import texts, units
from anafi_mav.drone import Limits, PilotingCommand
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.velocity_loop import STILL, YAW_GAIN, VelocityController
from anafi_mav.vehicle.offboard.goals import Goal, demand, resolve
from anafi_mav.vehicle.offboard.setpoints import NOTHING, AttitudeSetpoint, MotionSetpoint, Setpoint
from anafi_mav.vehicle.offboard.silence import SILENCE
from anafi_mav.vehicle.offboard.takeoff import CLIMB_FOR

SHORTEST_TIMEOUT, LONGEST_TIMEOUT = 0.5, 3.0
"""s that `FlightSettings.guided_timeout` can be set to."""

ANNOUNCED_EARLY = 0.5 - SILENCE
"""s before the end of a timeout at which the drone is commanded to hover."""

TOGETHER = 0.5
"""s within which a second setpoint makes a stream of the first."""

LATE_AFTER_STREAM = 3.0
"""s after the silence for which a position may still be one of the stream's; the time after which ArduCopter takes a
stream of velocities for ended."""

MAX_PILOTS = 8
"""Programs whose setpoints are listened to at once."""


class AskedHeading(NamedTuple):
    """A heading as it was asked for, and what it meant when it first arrived (rad from north)."""

    body: bool
    asked: float | None
    yaw: float | None


NO_HEADING = AskedHeading(False, None, None)


class Steering(Struct, frozen=True):
    """Flight by an engagement's newest setpoint; replaced as a whole by the next one's."""

    controller: VelocityController
    """Remembers the demands of this engagement."""
    goal: Goal | None = None
    """The position, resolved; None when the setpoint has none."""
    heading: AskedHeading = NO_HEADING
    sticks: PilotingCommand | None = None
    """The sticks that are held; None while the drone makes a move by itself."""
    warned_of: float = STILL
    """m/s of velocity up to which it has been said whether MaxTilt is enough."""

    def lean(self, setpoint: AttitudeSetpoint, limits: Limits, now: float) -> Steering:
        """Return the flight by an attitude."""
        motion, turn = self.controller.motion, setpoint.yaw_rate
        if motion.yaw is not None and motion.knows_heading(now):
            turn += motion.gain(YAW_GAIN) * units.wrap_pi(setpoint.yaw - motion.yaw)
        sticks = PilotingCommand(
            roll_deg=setpoint.roll * units.DEG_PER_RAD,
            pitch_deg=setpoint.pitch * units.DEG_PER_RAD,
            yaw_rate_dps=turn * units.DEG_PER_RAD,
            climb_mps=setpoint.climb * limits.climb_mps,
        )
        return replace(self, goal=None, heading=AskedHeading(False, setpoint.yaw, setpoint.yaw), sticks=sticks)

    def resolve(self, setpoint: MotionSetpoint, vehicle: Aircraft) -> Steering:
        """Return the flight to a setpoint's position and heading, without sticks.

        Both are as resolved when they first arrived. Raises `Refused`.
        """
        motion, goal, heading = self.controller.motion, self.goal, self.heading
        if setpoint.position == NOTHING:
            goal = None
        elif goal is None or not goal.is_of(setpoint):
            goal = resolve(setpoint, vehicle, motion)
        if heading[:2] != (setpoint.body, setpoint.yaw):
            yaw = setpoint.yaw
            if yaw is not None and setpoint.body:
                if motion.yaw is None:
                    raise Refused(texts.SETPOINT, texts.HEADING_UNKNOWN)
                yaw = units.wrap_pi(motion.yaw + yaw)
            heading = AskedHeading(setpoint.body, setpoint.yaw, yaw)
        return replace(self, goal=goal, heading=heading, sticks=None)

    def close_loop(self, setpoint: MotionSetpoint, limits: Limits, now: float, *, located: bool) -> Steering:
        """Return the flight by the sticks of the velocity loop.

        `located`: GPS locates the drone. Raises `Refused` when the loop lacks a value.
        """
        wanted = demand(setpoint, self.goal, self.heading.yaw, located=located)
        sticks = self.controller.sticks(wanted, limits, now)
        if sticks is None:
            raise Refused(texts.SETPOINT, texts.MOTION_UNKNOWN)
        return replace(self, sticks=sticks)

    @property
    def is_short_of_tilt(self) -> bool:
        """True when MaxTilt has been costing speed for a while."""
        return self.controller.short_of is not None and self.controller.motion.trusts_tilt


class State(enum.Enum):
    """State of an offboard session."""

    IDLE = "setpoints may arrive, but fly nothing"
    COUNTING = "a client in Guided asks to climb from the ground, every client is warned"
    ENGAGED = "a stream of setpoints flies the drone, or stands by on the ground"
    CLIMBING = "an engaged client asks to climb from the ground, every client is warned"
    LIFTING = "a take-off by setpoints, which are flown from the first hover on"
    JOINED = "another take-off is under way, the setpoints are flown at its end"
    SINGLE = "a single setpoint is flown to its end"


class Event(enum.Enum):
    """Event that changes the state."""

    ENGAGE = "mode Offboard is requested, or a stream arrives in mode Guided"
    ENGAGE_SINGLE = "a single position in mode Guided"
    JOIN = "mode Offboard is requested during a take-off"
    CLIMB = "a client that may take off asks to climb"
    STAY = "it asks to climb no longer"
    LIFT = "it has asked for long enough"
    RISEN = "the drone hovers, or the take-off has ended"
    DISENGAGE = "another mode is active"
    SILENCE = "no setpoint for too long"


_ANYWHERE = {
    Event.ENGAGE: State.ENGAGED,
    Event.ENGAGE_SINGLE: State.SINGLE,
    Event.JOIN: State.JOINED,
    Event.LIFT: State.LIFTING,
    Event.DISENGAGE: State.IDLE,
}

TRANSITIONS: dict[State, dict[Event, State]] = {
    State.IDLE: {**_ANYWHERE, Event.CLIMB: State.COUNTING},
    State.COUNTING: {**_ANYWHERE, Event.CLIMB: State.COUNTING, Event.STAY: State.IDLE, Event.SILENCE: State.IDLE},
    State.ENGAGED: {**_ANYWHERE, Event.CLIMB: State.CLIMBING, Event.SILENCE: State.IDLE},
    State.CLIMBING: {**_ANYWHERE, Event.CLIMB: State.CLIMBING, Event.STAY: State.ENGAGED, Event.SILENCE: State.IDLE},
    State.LIFTING: {**_ANYWHERE, Event.RISEN: State.ENGAGED, Event.SILENCE: State.IDLE},
    State.JOINED: {**_ANYWHERE, Event.RISEN: State.ENGAGED, Event.SILENCE: State.IDLE},
    State.SINGLE: dict(_ANYWHERE),
}
"""A pair that is missing changes nothing. A single setpoint is followed by silence."""

COUNTS = (State.COUNTING, State.CLIMBING)
"""States in which a client asks to climb, and the second has not passed."""

STREAMS = (State.ENGAGED, State.CLIMBING, State.LIFTING, State.JOINED)
"""States in which a stream flies the drone, or is about to: setpoints of other clients are not flown."""


SILENCED = (*STREAMS, *COUNTS)
"""States that silence of the pilot ends."""

FLYING = (*STREAMS, State.SINGLE)
"""States in which setpoints fly the drone, a stream of them or a single one."""


def is_position(setpoint: Setpoint) -> bool:
    """It can be flown to its end: a position can, a velocity has none."""
    return isinstance(setpoint, MotionSetpoint) and setpoint.moves


def lasts(setpoint: Setpoint, guided_timeout: float | None) -> float:
    """Return the s of silence after which a setpoint is over.

    `guided_timeout`: of ArduPilot's Guided; None elsewhere.

    It counts for velocities and yaw rates alone: a tilt or an acceleration that outlives its sender gains speed.
    """
    if guided_timeout is None or not isinstance(setpoint, MotionSetpoint):
        return SILENCE
    steers = setpoint.velocity != NOTHING or setpoint.yaw_rate is not None
    alone = setpoint.position == NOTHING and setpoint.acceleration == NOTHING
    return guided_timeout - ANNOUNCED_EARLY if steers and alone else SILENCE


class Received(Struct, frozen=True):
    """A client's newest setpoint."""

    setpoint: Setpoint
    at: float
    lasts: float
    """s of silence after which it is over."""
    is_single: bool
    """A position that is a part of no stream: Guided flies it to its end."""

    @property
    def over(self) -> float:
        """When it is over."""
        return self.at + self.lasts


class Engagement(Struct, frozen=True):
    """Flight by the setpoints of one client, or its wish to take off; ends as a whole."""

    pilot: Hashable
    state: State = State.IDLE
    chosen_by: Hashable = None
    """Client that chose mode Offboard; None in Guided."""
    climbs_since: float = -math.inf
    climbed_at: float = -math.inf
    """When the newest setpoint arrived that asks to climb."""
    steering: Steering | None = None
    """Flight by the newest setpoint; None before it begins."""


class OffboardStream(Struct, frozen=True):
    """The newest setpoints, their age, and whose of them fly the drone."""

    received: Mapping[Hashable, Received] = field(default_factory=dict)
    engagement: Engagement | None = None
    fell_silent: tuple[Hashable, float] | None = None
    """Whose stream of positions silence ended last, and when it had lasted too long."""

    @property
    def state(self) -> State:
        return State.IDLE if self.engagement is None else self.engagement.state

    @property
    def flying(self) -> bool:
        """Setpoints fly the drone, a stream of them or a single one."""
        return self.engagement is not None and self.engagement.state in FLYING

    @property
    def _flown(self) -> Received | None:
        """The pilot's newest setpoint as it was received; None while none is flown."""
        engagement = self.engagement
        return self.received[engagement.pilot] if engagement is not None and engagement.state in FLYING else None

    @property
    def pilot(self) -> Hashable:
        """Client whose setpoints fly the drone, or ask to climb."""
        return None if self.engagement is None else self.engagement.pilot

    @property
    def steering(self) -> Steering | None:
        """Flight by the pilot's newest setpoint; None before it begins."""
        return None if self.engagement is None else self.engagement.steering

    @property
    def setpoint(self) -> Setpoint | None:
        """The pilot's newest setpoint; None while none is flown."""
        return None if (flown := self._flown) is None else flown.setpoint

    @property
    def deadline(self) -> float | None:
        """When the pilot's silence will have lasted too long; None without a stream."""
        engagement = self.engagement
        if engagement is None or engagement.state not in SILENCED:
            return None
        return self.received[engagement.pilot].over

    @property
    def climbs_since(self) -> float | None:
        """Begin of the second in which the pilot asks to climb; None outside of it."""
        return self.engagement.climbs_since if self.engagement is not None and self.state in COUNTS else None

    def stick_age(self, now: float) -> float:
        """Return the s since the pilot's newest setpoint; less when it lasts longer than `SILENCE`.

        Sticks expire `SILENCE` after an age of 0.
        """
        return 0.0 if (flown := self._flown) is None else max(0.0, now - flown.over + SILENCE)

    # Setpoints.

    def receive(self, sender: Hashable, setpoint: Setpoint, now: float, lasts: float = SILENCE) -> OffboardStream:
        """A usable setpoint arrived; it is over after `lasts` s of silence."""
        before, received = self.received.get(sender), self.received
        if before is None and len(received) >= MAX_PILOTS:
            received = {one: kept for one, kept in received.items() if now < kept.over or one == self.pilot}
            if len(received) >= MAX_PILOTS:
                return self
        follows = before is not None and now - before.at < TOGETHER
        ended, since = self.fell_silent or (None, -math.inf)
        is_late = ended == sender and now < since + LATE_AFTER_STREAM
        newest = Received(setpoint, now, lasts, not (follows or is_late) and is_position(setpoint))
        return replace(self, received={**received, sender: newest})

    def objection(self, sender: Hashable) -> OperatorText | None:
        """Return why the setpoints of a client do not count at present; None: they do."""
        engagement = self.engagement
        if engagement is not None and engagement.state in STREAMS and sender != engagement.pilot:
            return texts.OTHER_PROGRAM
        return None if sender in self.received else texts.TOO_MANY_PROGRAMS

    def candidate(self, client: Hashable, now: float) -> Hashable | None:
        """Return the client whose setpoints mode Offboard would fly if this client chose it.

        Its own have priority, then the newest of all. Returns None if no client has fresh setpoints: mode Offboard is
        to be refused.
        """
        fresh = {sender: received.at for sender, received in self.received.items() if now < received.over}
        return client if client in fresh else max(fresh, key=fresh.__getitem__, default=None)

    # The engagement.

    def after(self, event: Event, engagement: Engagement | None = None) -> OffboardStream:
        """Return the stream after an event; `engagement`: instead of the present one."""
        engagement = engagement or self.engagement
        state = TRANSITIONS[self.state].get(event, self.state)
        if engagement is None or state is State.IDLE:
            return replace(self, engagement=None)
        return replace(self, engagement=replace(engagement, state=state))

    def engage(self, event: Event, pilot: Hashable, chosen_by: Hashable = None) -> OffboardStream:
        """Begin an engagement of a client with setpoints; one of before is over."""
        return self.after(event, Engagement(pilot, chosen_by=chosen_by))

    def note(self, **facts: Any) -> OffboardStream:
        """Return the stream with newer facts of its engagement, if it has one."""
        return replace(self, engagement=self.engagement and replace(self.engagement, **facts))

    def climb(self, client: Hashable, now: float) -> OffboardStream:
        """A setpoint of a client arrived that may take the drone off.

        The second begins at `climbs_since`, and again after a gap of `SILENCE`. At its end the state is LIFTING.
        """
        engagement = self.engagement
        is_counted = engagement is not None and self.state in COUNTS and now - engagement.climbed_at < SILENCE
        if engagement is None or not is_counted:
            own = engagement if engagement is not None and engagement.pilot == client else Engagement(client)
            return self.after(Event.CLIMB, replace(own, climbs_since=now, climbed_at=now))
        if client != engagement.pilot:
            return self
        event = Event.LIFT if now - engagement.climbs_since >= CLIMB_FOR else Event.CLIMB
        return self.after(event, replace(engagement, climbed_at=now))

    def expire(self, now: float) -> OffboardStream:
        """Return the stream without its engagement if that has been silent for too long."""
        if self.deadline is None or now < self.deadline:
            return self
        silent = (self.pilot, now) if is_position(self.received[self.pilot].setpoint) else self.fell_silent
        return replace(self.after(Event.SILENCE), fell_silent=silent)

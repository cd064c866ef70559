"""The fence in force, and the action when the vehicle leaves it or is about to.

No I/O.

    watch.look(sight, now) -> the action to carry out now, or None

An action is carried out once each time the vehicle reaches a boundary; a client that then acquires the vehicle may
fly it back. Zones, floor and ceiling are separate boundaries: beyond one of them the others hold. For a vehicle that
returns or lands, commanded or not, there is a warning and nothing else. For one that takes off there is a warning, and
the action once it hovers, unless something newer is commanded.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from anafi_mav import geo, mav_enums, texts
from anafi_mav.errors import AnafiMavError
from anafi_mav.plans.zones import CircleZone, Fence, LatLon, Margin
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.fence.fence import fence_of
from anafi_mav.vehicle.fence.plan_items import PlanItem, PlanItems

REACTION = 0.6
"""s from a motion to the drone's response to our action.

Telemetry is received five times a second, a stick takes 0.1 s to be obeyed, and radio takes the rest. The round trip
of the link, where it is measured, comes on top.
"""

BRAKING = 2.5
"""m/s², lowest deceleration of a braking drone: 15° of tilt."""

BACK_INSIDE = 2.0
"""m inside the boundary from which the vehicle counts as back.

Two readings of GPS differ by a metre.
"""

STALE = 3.0
"""s after which a position counts as unknown: it is reported once a second."""

HIGHEST_FLOOR = 1000.0
"""m above take-off."""

SLACK = 1.0
"""m beyond floor or ceiling that are no breach yet.

The barometer drifts, and climbs overshoot.
"""

CALM = 2.0
"""s without danger until a vehicle that left, or was about to, counts as inside again.

Its position between two reports is an estimate, which each report corrects; and values that a busy host reads late
look like a way back.
"""

RETRY = 2.0
"""s until an action that was not carried out is tried again."""


class Reaction(enum.Enum):
    """Action at the boundary."""

    NONE = "nothing"
    WARN = "warning"
    HOLD = "hold"
    RETURN = "return"
    LAND = "landing"
    TERMINATE = "motor cut"


PX4_ACTIONS = {
    0: Reaction.NONE,
    1: Reaction.WARN,
    2: Reaction.HOLD,
    3: Reaction.RETURN,
    4: Reaction.TERMINATE,
    5: Reaction.LAND,
}
"""GF_ACTION (PX4-Autopilot src/modules/navigator/geofence_params.c)."""

ARDUPILOT_ACTIONS = {
    0: Reaction.WARN,
    1: Reaction.RETURN,
    2: Reaction.LAND,
    3: Reaction.RETURN,
    4: Reaction.HOLD,
    5: Reaction.RETURN,
}
"""FENCE_ACTION of ArduCopter: report only, RTL, land, SmartRTL, brake, SmartRTL (ardupilot AC_Fence.h). A motor cut has
no number there."""

NO_NUMBER = -1
"""FENCE_ACTION while the action is one that ArduPilot has no number for."""


class Breach(enum.Enum):
    """Kind of boundary (MAVLink FENCE_BREACH)."""

    NONE = mav_enums.FENCE_BREACH_NONE
    FLOOR = mav_enums.FENCE_BREACH_MINALT
    CEILING = mav_enums.FENCE_BREACH_MAXALT
    BOUNDARY = mav_enums.FENCE_BREACH_BOUNDARY


CEILING, HOME_CIRCLE, ZONES, FLOOR = (
    mav_enums.FENCE_TYPE_ALT_MAX,
    mav_enums.FENCE_TYPE_CIRCLE,
    mav_enums.FENCE_TYPE_POLYGON,
    mav_enums.FENCE_TYPE_ALT_MIN,
)
"""Kinds of boundaries (MAVLink FENCE_TYPE): the drone's own ceiling, a circle around home, uploaded zones, a floor."""

EVERYTHING = CEILING | HOME_CIRCLE | ZONES | FLOOR


class State(enum.Enum):
    INSIDE = "inside"
    LEAVING = "about to leave"
    OUTSIDE = "outside"


class Event(enum.Enum):
    SAFE = "well inside, and not about to leave"
    AHEAD = "too fast to stop before the boundary"
    BREACH = "beyond the boundary"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.INSIDE: {Event.AHEAD: State.LEAVING, Event.BREACH: State.OUTSIDE},
    State.LEAVING: {Event.AHEAD: State.LEAVING, Event.BREACH: State.OUTSIDE, Event.SAFE: State.INSIDE},
    State.OUTSIDE: {Event.SAFE: State.INSIDE},
}
"""State transitions of zones, floor and ceiling, each for itself.

A missing pair changes nothing: outside, the vehicle may fly freely until it is back.
"""


class OutsideFence(AnafiMavError):
    """A place, a height or the way to a place is not inside the fence.

    The text is a clause: "12 m beyond …".
    """

    def __init__(self, reason: OperatorText, *, lasting: bool = True) -> None:
        super().__init__(reason)
        self.reason = reason
        self.lasting = lasting
        """True when the same request would be refused again."""


class Sight(msgspec.Struct, frozen=True):
    """Observed state of the vehicle."""

    place: LatLon | None
    """By the newest position, however old; None without a GPS fix."""
    age: float
    """Of that position, s."""
    velocity: tuple[float, float]
    """North, east, m/s."""
    ato: float | None
    """m above the take-off point."""
    ceiling: float | None
    """m above the take-off point; the drone's own, which it keeps to by itself."""
    home: LatLon | None
    airborne: bool
    """Off the ground."""
    flying: bool
    """Neither taking off nor landing nor returning, so that its motion may be stopped."""
    steering: bool
    """Flown by sticks or setpoints, so that its motion continues.

    A move stops at its commanded target.
    """
    orders: int
    """The vehicle's `orders` count, which each new action raises.

    An action of ours that is still the newest need not be repeated.
    """
    takes_off: bool = False
    round_trip: float = 0.0
    """s that the link delays the sight of the drone, and then an action."""


@dataclass(frozen=True)
class FenceFinding:
    """Problem found by a look."""

    breach: Breach
    text: OperatorText
    """A clause: "3 m beyond inclusion 0-4"."""
    ahead: bool = False
    """It is not beyond yet."""


Finding = tuple[Event | None, FenceFinding | None]
"""Observation of one boundary; the event is None when nothing can be concluded."""

SAFE: Finding = (Event.SAFE, None)


class _Side:
    """State of the vehicle relative to one kind of boundary, and the action taken."""

    def __init__(self) -> None:
        self.state = State.INSIDE
        self.verdict: FenceFinding | None = None
        """Reason of the state; None when all is well."""
        self.orders: int | None = None
        """The vehicle's `orders` count when our action was carried out."""
        self.retry_at: float | None = None
        """When an action that failed is tried again."""
        self.delayed: int | None = None
        """The vehicle's `orders` count when a take-off delayed our action."""
        self._calm_since: float | None = None
        """Time since when nothing ahead was seen."""

    @property
    def rests(self) -> bool:
        """True when nothing is left of an earlier breach or action."""
        return self.state is State.INSIDE and self.orders is None and self.retry_at is None and self.delayed is None

    def see(self, event: Event | None, verdict: FenceFinding | None, now: float) -> State:
        """Take an observation, or None without one; return the state before."""
        before = self.state
        if event is not Event.SAFE:
            self._calm_since = None
        elif before is not State.INSIDE:
            if self._calm_since is None:
                self._calm_since = now
            if now - self._calm_since < CALM:
                return before
        if event is None:
            return before
        self.state, self.verdict = TRANSITIONS[before].get(event, before), verdict
        if verdict is None:
            self.orders = self.retry_at = self.delayed = None
        return before


class FenceWatch:
    """The fence of one vehicle: its zones, settings, and the vehicle's state relative to it."""

    def __init__(self) -> None:
        self.action = Reaction.HOLD
        """PX4's default."""
        self.types = EVERYTHING
        """Kinds of boundaries that are chosen."""
        self._on = EVERYTHING
        """Kinds that are switched on."""
        self.enabled = EVERYTHING
        """Kinds that are both."""
        self.predict = True
        """Act when the vehicle is too fast to stop before the boundary, not only when it is beyond."""
        self.floor = 0.0
        """m above the take-off point; counts once the vehicle has been above it. 0: no floor."""
        self.items = PlanItems()
        self.fence = Fence()
        self.verdict: FenceFinding | None = None
        """Reason of the action that `look` returned; without an action, of the present state."""
        self.breach = Breach.NONE
        """The last one."""
        self.breaches = 0
        self.breached_at = 0.0
        """By the clock that `look` is given."""
        self.blind = False
        """True in the air with a fence and without a position."""
        self._above_floor = False
        self._sides = _sides()
        """In the sequence in which they are checked: an action at the zones is the most informative."""
        self._acting: _Side | None = None
        """Boundary for which an action is being carried out."""

    # Settings.

    def take(self, items: Sequence[PlanItem]) -> None:
        """Set the fence in force."""
        self.items, self.fence = PlanItems(items), fence_of(items)
        self._sides, self.verdict = _sides(), None

    def choose(self, types: int) -> None:
        """Choose the kinds of boundaries that the fence has; which are switched on does not change."""
        self.types, self.enabled = types, types & self._on

    def enable(self, types: int = EVERYTHING) -> None:
        """Switch some kinds of boundaries on; those that are not chosen stay without effect.

        As in ArduPilot, whose FENCE_ENABLE and DO_FENCE_ENABLE leave FENCE_TYPE as it is (AC_Fence::enable).
        """
        self._on |= types & EVERYTHING
        self.enabled = self.types & self._on

    def disable(self, types: int = EVERYTHING) -> None:
        """Switch some kinds of boundaries off."""
        self._on &= ~types
        self.enabled = self.types & self._on

    @property
    def is_on(self) -> bool:
        """True when some kind of boundary is switched on besides the ceiling.

        The drone enforces the ceiling by itself, whatever is switched on.
        """
        return bool(self._on & ~CEILING)

    @property
    def present(self) -> bool:
        """True when a boundary of ours exists that could be enabled."""
        return bool(self.fence.zones) or self.floor > 0.0

    @property
    def in_force(self) -> bool:
        """True when a boundary of ours exists and is enabled."""
        return bool(self.zones.zones) or self._has_floor

    @property
    def state(self) -> State:
        """The worst state of zones, floor and ceiling."""
        states = {side.state for side in self._sides.values()}
        return next(state for state in (State.OUTSIDE, State.LEAVING, State.INSIDE) if state in states)

    @property
    def rests(self) -> bool:
        """True when a look at a vehicle on the ground would change nothing."""
        if self._acting is not None or self.verdict is not None or self.blind or self._above_floor:
            return False
        return all(side.rests for side in self._sides.values())

    @property
    def healthy(self) -> bool:
        """True when no boundary is breached, and this is known."""
        return self.state is not State.OUTSIDE and not self.blind

    @property
    def zones(self) -> Fence:
        """Those that are enabled."""
        if self.enabled & HOME_CIRCLE and self.enabled & ZONES:
            return self.fence
        return Fence(
            zone
            for zone in self.fence.zones
            if self.enabled & (HOME_CIRCLE if isinstance(zone, CircleZone) and zone.centre is None else ZONES)
        )

    @property
    def _has_floor(self) -> bool:
        return bool(self.enabled & FLOOR) and self.floor > 0.0

    # Asking before.

    def check_height(self, ato: float) -> None:
        """Raise `OutsideFence` for a height (m above take-off) below the floor."""
        if self._has_floor and self.action is not Reaction.NONE and ato < self.floor:
            raise OutsideFence(texts.BELOW_FENCE.fill(height=ato, floor=self.floor))

    def check_place(self, place: LatLon | None, home: LatLon | None, start: LatLon | None = None) -> None:
        """Raise `OutsideFence` unless a place is inside, and the straight way to it from `start`.

        From outside every way that ends inside is allowed. An unknown place counts as not inside.
        """
        zones = self.zones
        if not zones.zones or self.action is Reaction.NONE:
            return
        if place is None:
            raise OutsideFence(texts.FENCE_NO_FIX, lasting=False)
        margin = zones.margin(place, home)
        if margin.metres < 0.0:
            raise OutsideFence(_beyond(margin))
        if start is not None and zones.margin(start, home).metres >= 0.0:
            way = zones.leaves(start, place, home)
            if way is not None:
                raise OutsideFence(texts.WAY_LEAVES_ZONE.fill(zone=way.zone))

    # Watching.

    def look(self, sight: Sight, now: float) -> Reaction | None:
        """Evaluate the observed state of the vehicle; return the action to carry out now, or None.

        Call `done` or `failed` with its outcome.
        """
        zones = self.zones
        if not sight.airborne:
            self._above_floor = False
        elif sight.ato is not None and sight.ato >= self.floor:
            self._above_floor = True
        elif not sight.flying:
            self._above_floor = False  # a landing or return has led below it: nothing to act against where that ends
        self.blind = bool(zones.zones) and sight.airborne and (sight.place is None or sight.age > STALE)
        for breach, side in self._sides.items():
            event, verdict = self._judge(breach, zones, sight)
            before = side.see(event, verdict, now)
            if side.state is State.OUTSIDE and before is not State.OUTSIDE:
                self.breach, self.breached_at = breach, now
                self.breaches += 1
            action = None if verdict is None else self._answer(side, before, verdict, sight, now)
            if action is not None:
                self.verdict = verdict
                return action  # the next look sees to the other boundaries
        self.verdict = next((side.verdict for side in self._sides.values() if side.verdict is not None), None)
        return None

    def _answer(self, side: _Side, before: State, verdict: FenceFinding, sight: Sight, now: float) -> Reaction | None:
        """Return the action for an observation of one boundary, or None."""
        if self.action is Reaction.NONE:
            return None
        if self._acting is not None:
            # What is under way serves all boundaries, but one that is crossed meanwhile is reported.
            crossed = side.state is State.OUTSIDE and before is not State.OUTSIDE
            return Reaction.WARN if crossed and side is not self._acting else None
        if side.retry_at is not None:
            return self._act(side, verdict, sight) if now >= side.retry_at else None
        if side.delayed is not None and not sight.takes_off:
            delayed, side.delayed = side.delayed, None
            return self._act(side, verdict, sight) if sight.flying and sight.orders == delayed else None
        if before is State.OUTSIDE:
            return None
        if before is State.LEAVING and side.orders == sight.orders:
            # It brakes already; should it not come to rest in time, nothing better can be done.
            return Reaction.WARN if side.state is State.OUTSIDE else None
        return self._act(side, verdict, sight)

    def _act(self, side: _Side, verdict: FenceFinding, sight: Sight) -> Reaction:
        side.retry_at = None
        if not sight.flying or verdict.breach is Breach.CEILING or self.action is Reaction.WARN:
            side.orders = sight.orders
            side.delayed = sight.orders if sight.takes_off and self.action is not Reaction.WARN else None
            return Reaction.WARN
        self._acting = side
        return self.action

    def done(self, orders: int) -> None:
        """Note that the action was carried out; `orders` is the vehicle's count after it."""
        self._acting = None
        for side in self._sides.values():
            side.orders, side.retry_at, side.delayed = orders, None, None

    def failed(self, now: float, *, replaced: bool = False) -> None:
        """The action was not carried out: it is tried again while the vehicle is outside.

        `replaced`: a client's order has ended it. Beyond a boundary it is not tried again then.
        """
        self._acting = None
        for side in self._sides.values():
            if side.state is State.LEAVING or (side.state is State.OUTSIDE and not replaced):
                side.retry_at = now + RETRY

    def link_down(self) -> None:
        """End the action under way, and forget that the floor was reached.

        The drone may land and take off unseen. The rest of the vehicle's state relative to the fence ends when the
        fence is taken at the next connection.
        """
        self._acting, self._above_floor = None, False

    def _judge(self, breach: Breach, zones: Fence, sight: Sight) -> Finding:
        """Return the observation of one kind of boundary."""
        if not sight.airborne:
            return SAFE
        if breach is Breach.BOUNDARY:
            return self._judge_zones(zones, sight)
        if sight.ato is None or not sight.flying:
            return SAFE
        if breach is Breach.FLOOR:
            below = self.floor - sight.ato
            if self._has_floor and self._above_floor and below > SLACK:
                return Event.BREACH, FenceFinding(
                    breach, texts.FENCE_UNDER_FLOOR.fill(distance=below, floor=self.floor)
                )
        elif self.enabled & CEILING and sight.ceiling is not None:
            above = sight.ato - sight.ceiling
            if above > SLACK:
                return Event.BREACH, FenceFinding(
                    breach, texts.FENCE_OVER_CEILING.fill(distance=above, ceiling=sight.ceiling)
                )
        return SAFE

    def _judge_zones(self, zones: Fence, sight: Sight) -> Finding:
        if not zones.zones:
            return SAFE
        if sight.place is None or sight.age > STALE:
            return None, None
        north, east = sight.velocity
        here = geo.destination(*sight.place, north * sight.age, east * sight.age)
        margin = zones.margin(here, sight.home)
        if margin.metres < 0.0:
            return Event.BREACH, FenceFinding(Breach.BOUNDARY, _beyond(margin))
        speed = math.hypot(north, east)
        if self.predict and sight.steering and sight.flying and speed > 0.0:
            stopping = REACTION + sight.round_trip + speed / (2.0 * BRAKING)
            way = zones.leaves(here, geo.destination(*here, north * stopping, east * stopping), sight.home)
            if way is not None:
                return Event.AHEAD, FenceFinding(Breach.BOUNDARY, texts.FENCE_TOO_FAST.fill(zone=way.zone), ahead=True)
        return SAFE if margin.metres >= BACK_INSIDE else (None, None)


def _sides() -> dict[Breach, _Side]:
    return {breach: _Side() for breach in (Breach.BOUNDARY, Breach.FLOOR, Breach.CEILING)}


def _beyond(margin: Margin) -> OperatorText:
    return texts.BEYOND_ZONE.fill(distance=-margin.metres, zone=margin.zone)

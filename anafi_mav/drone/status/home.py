"""Element home: where home is, and how and why the drone flies there.

The verbs that fly home are in `piloting`; those here change what a return does. Each returns what the drone confirms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, precise_home, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.precise_home import PreciseHomeMode, PreciseHomeState
from anafi_mav.arsdk.messages.rth import (
    AutoTriggerReason,
    Indicator,
    RthAutoTriggerMode,
    RthEndingBehavior,
    RthHomeReachability,
    RthHomeType,
    RthState,
    StateReason,
)
from anafi_mav.drone.element import Position, Range, Reducer, members, position, setting
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, require_number
from anafi_mav.drone.settings import ANSWERED_WITHIN, Commanding, same_as
from anafi_mav.errors import CommandRejected, CommandTimeout, LocalProtocolError, NotSupported

_SAME_PLACE_DEG = 1e-7
"""About a centimetre: an echo that went through single precision is further off than that."""

BY_ITSELF = "drone is returning by itself"
"""Reason of a command that is rejected during a return of the drone's own."""

_RETURNING = (RthState.IN_PROGRESS, RthState.PENDING)
_ASKED_FOR = (StateReason.USER_REQUEST, StateReason.FLIGHTPLAN)
_NO_CAUSE = (StateReason.FINISHED, StateReason.STOPPED, StateReason.DISABLED, StateReason.ENABLED)
"""Reasons of other states. A drone may report one of them with a return that was under way before the connection."""


class HomeState(msgspec.Struct, frozen=True):
    """Home, the return to it, and its settings."""

    location: Position | None = None
    """Home as the drone reports it; None on the ground before the first take-off.

    Parrot does not say what its altitude counts from: for display only.
    """
    takeoff_location: Position | None = None
    """Place of the take-off; altitude above the take-off point."""
    fixed_before_takeoff: bool | None = None
    """`takeoff_location` was measured before the take-off, not with the first fix in the air."""
    custom_location: Position | None = None
    """The place a user chose; altitude above the take-off point."""
    type: RthHomeType | None = None
    """Which kind of home the drone would fly to now."""
    preferred_type: RthHomeType | None = None
    """Which kind the user prefers."""
    rth: RthState | None = None
    reason: StateReason | None = None
    """Why `rth` changed last."""
    reachability: RthHomeReachability | None = None
    auto_trigger: AutoTriggerReason | None = None
    """Why the drone is about to fly home by itself; NONE when it is not."""
    auto_trigger_delay_s: int | None = None
    """Seconds until it does; None while `auto_trigger` is NONE."""
    min_altitude: Range | None = None
    """Height that a return climbs to first, m above take-off."""
    ending: RthEndingBehavior | None = None
    """End of a return: landing or hovering."""
    ending_altitude: Range | None = None
    """Height at which a return that ends in hovering stays, m above ground."""
    delay_s: int | None = None
    """Seconds between the loss of the link and the return."""
    delay_range_s: tuple[int, int] | None = None
    """Shortest and longest `delay_s`."""
    types: frozenset[RthHomeType] | None = None
    """The kinds that can be preferred."""
    by_itself: bool | None = None
    """True when the drone returns by itself at low battery."""
    missing: frozenset[Indicator] | None = None
    """Requirements that a return lacks; empty: available. Ai only."""
    precise_mode: PreciseHomeMode | None = None
    """STANDARD: a return ends by the picture of the take-off place."""
    precise: PreciseHomeState | None = None
    precise_modes: frozenset[PreciseHomeMode] | None = None

    @property
    def returning(self) -> bool:
        """True when a return is running or pending."""
        return self.rth in _RETURNING

    @property
    def returning_by_itself(self) -> bool:
        """True when the drone began the return for a reason of its own (battery, lost link, …).

        A return that a user or the end of a flight plan commanded is not, nor one whose cause is not reported, so that
        a person can end it like any other.
        """
        return self.rth in _RETURNING and self.reason not in (*_ASKED_FOR, *_NO_CAUSE)


def modern(message: ardrone3.NavigateHomeStateChanged) -> rth.State:
    """Return what rth.state would report, of a firmware that sends the older event alone."""
    legacy = message.reason == ardrone3.NavigateHomeReason.ICING
    return rth.State(RthState(message.state), StateReason.ICING if legacy else StateReason(message.reason))


def _auto_trigger(state: HomeState, message: rth.RthAutoTrigger) -> HomeState:
    planned = message.reason != AutoTriggerReason.NONE
    return replace(state, auto_trigger=message.reason, auto_trigger_delay_s=message.delay if planned else None)


def _flying_state(state: HomeState, message: ardrone3.FlyingStateChanged) -> HomeState:
    """End a return on the ground: without a report of its end it would go on in the next flight."""
    if message.state != FlyingState.LANDED or not state.returning:
        return state
    return replace(state, rth=None, reason=None)


class Home(Commanding[HomeState]):
    """Home and the settings of a return. `Piloting.return_home` flies there."""

    NOTHING = HomeState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        ardrone3.FlyingStateChanged: _flying_state,
        ardrone3.HomeChanged: lambda state, message: replace(
            state, location=position(message.latitude, message.longitude, message.altitude)
        ),
        rth.HomeLocation: lambda state, message: replace(
            state, location=position(message.latitude, message.longitude, message.altitude)
        ),
        rth.TakeoffLocation: lambda state, message: replace(
            state,
            takeoff_location=position(message.latitude, message.longitude, message.altitude),
            fixed_before_takeoff=message.fixed_before_takeoff != 0,
        ),
        rth.CustomLocation: lambda state, message: replace(
            state, custom_location=position(message.latitude, message.longitude, message.altitude)
        ),
        rth.HomeType: lambda state, message: replace(state, type=message.type),
        rth.PreferredHomeType: lambda state, message: replace(state, preferred_type=message.type),
        # The firmware repeats this one as the legacy NavigateHomeStateChanged, which says nothing more.
        rth.State: lambda state, message: replace(state, rth=message.state, reason=message.reason),
        rth.HomeReachability: lambda state, message: replace(state, reachability=message.status),
        rth.RthAutoTrigger: _auto_trigger,
        rth.MinAltitude: lambda state, message: replace(state, min_altitude=setting(message)),
        rth.EndingBehavior: lambda state, message: replace(state, ending=message.ending_behavior),
        rth.EndingHoveringAltitude: lambda state, message: replace(state, ending_altitude=setting(message)),
        rth.Delay: lambda state, message: replace(
            state, delay_s=message.delay, delay_range_s=(message.min, message.max)
        ),
        rth.HomeTypeCapabilities: lambda state, message: replace(state, types=members(message.values, RthHomeType)),
        rth.AutoTriggerMode: lambda state, message: replace(state, by_itself=message.mode == RthAutoTriggerMode.ON),
        rth.Info: lambda state, message: replace(state, missing=members(message.missing_inputs, Indicator)),
        precise_home.Mode: lambda state, message: replace(state, precise_mode=message.mode),
        precise_home.State: lambda state, message: replace(state, precise=message.state),
        precise_home.Capabilities: lambda state, message: replace(
            state, precise_modes=members(message.modes, PreciseHomeMode)
        ),
    }

    def request_states(self) -> None:
        """Make the drone report all its states again, that of a return among them.

        Raises `LinkLost`.
        """
        self._commander.send(common.AllStates())

    async def set_min_altitude(self, metres: float) -> float:
        """Set the height that a return climbs to first, m above take-off."""
        return await self._set(rth.SetMinAltitude(metres), rth.MinAltitude, self.state.min_altitude)

    async def set_ending(self, ending: RthEndingBehavior) -> RthEndingBehavior:
        """Set the end of a return: landing or hovering."""
        self._commander.require_feature(self.state.ending, rth.SetEndingBehavior.NAME)
        return await self._change(
            rth.SetEndingBehavior(ending),
            rth.EndingBehavior,
            lambda message: RthEndingBehavior(message.ending_behavior),
            same_as(ending),
        )

    async def set_ending_altitude(self, metres: float) -> float:
        """Set the height at which a return that ends in hovering stays, m above ground."""
        return await self._set(
            rth.SetEndingHoveringAltitude(metres), rth.EndingHoveringAltitude, self.state.ending_altitude
        )

    async def set_delay(self, seconds: int) -> int:
        """Set the time between the loss of the link and the return, s."""
        self._commander.require_feature(self.state.delay_s, rth.SetDelay.NAME)
        return await self._change(rth.SetDelay(seconds), rth.Delay, lambda m: int(m.delay), same_as(seconds))

    async def set_by_itself(self, allowed: bool) -> bool:
        """Allow or forbid the drone's own return at low battery."""
        self._commander.require_feature(self.state.by_itself, rth.SetAutoTriggerMode.NAME)
        return await self._change(
            rth.SetAutoTriggerMode(RthAutoTriggerMode.ON if allowed else RthAutoTriggerMode.OFF),
            rth.AutoTriggerMode,
            lambda message: message.mode == RthAutoTriggerMode.ON,
            same_as(allowed),
        )

    async def cancel_auto_trigger(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Cancel the return that the drone has announced; returns when it announces none."""
        if self.state.auto_trigger in (None, AutoTriggerReason.NONE):
            return
        await self._change(
            rth.CancelAutoTrigger(),
            rth.RthAutoTrigger,
            lambda message: True if message.reason == AutoTriggerReason.NONE else None,
            timeout=timeout,
        )

    async def set_preferred_type(self, kind: RthHomeType) -> RthHomeType:
        """Choose the kind of home to prefer; `HomeState.type` is the one the drone would use now.

        Raises `NotSupported` for a kind that this drone does not have.
        """
        self._commander.require_feature(self.state.preferred_type, rth.SetPreferredHomeType.NAME)
        if self.state.types is not None and kind not in self.state.types:
            raise NotSupported(f"home of type {kind.name.lower()}")
        return await self._change(
            rth.SetPreferredHomeType(kind),
            rth.PreferredHomeType,
            lambda message: RthHomeType(message.type),
            same_as(kind),
        )

    async def set_custom_location(
        self, latitude: float, longitude: float, altitude: float, timeout: float = ANSWER_TIMEOUT
    ) -> Position:
        """Choose a place (deg, deg, m above take-off) for homes of type custom.

        The drone flies there only while `preferred_type` is CUSTOM. One that does not accept the place (it is too far
        away, or the drone does not know where it is itself) reports its old one: `CommandRejected`, `ANSWERED_WITHIN`
        after it has received the command, for a report of the old place may be from before that. `CommandTimeout` when
        it reports none until then, for it may have obeyed, and when the command did not arrive.
        """
        require_number(timeout)
        wanted = position(latitude, longitude, altitude)
        if wanted is None:
            raise LocalProtocolError(f"no place on earth: {latitude}, {longitude}, {altitude}")
        self._commander.require_feature(self.state.types, rth.SetCustomLocation.NAME)
        if self.state.types is not None and RthHomeType.CUSTOM not in self.state.types:
            raise NotSupported("home of type custom")

        def is_wanted(place: Position) -> bool:
            return math.isclose(place.latitude, latitude, rel_tol=0.0, abs_tol=_SAME_PLACE_DEG) and math.isclose(
                place.longitude, longitude, rel_tol=0.0, abs_tol=_SAME_PLACE_DEG
            )

        command = rth.SetCustomLocation(latitude, longitude, altitude)
        place = await self._change(
            command,
            rth.CustomLocation,
            lambda message: position(message.latitude, message.longitude, message.altitude),
            is_wanted,
            timeout=timeout,
            silence=CommandTimeout(command.NAME, ANSWERED_WITHIN),
        )
        if not is_wanted(place):
            raise CommandRejected("Home refused: the drone does not accept the place")
        return place

    async def set_precise(self, on: bool) -> bool:
        """Switch the precise return, which looks for the picture of the take-off place."""
        self._commander.require_feature(self.state.precise_mode, precise_home.SetMode.NAME)
        return await self._change(
            precise_home.SetMode(PreciseHomeMode.STANDARD if on else PreciseHomeMode.DISABLED),
            precise_home.Mode,
            lambda message: message.mode == PreciseHomeMode.STANDARD,
            same_as(on),
        )

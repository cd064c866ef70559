"""Element home: where home is, and how and why the drone flies there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.rth import (
    AutoTriggerReason,
    RthEndingBehavior,
    RthHomeReachability,
    RthHomeType,
    RthState,
    StateReason,
)
from anafi_mav.arsdk.wire import Message
from anafi_mav.drone.element import Element, Position, Range, Reducer, position, setting

_RETURNING = (RthState.IN_PROGRESS, RthState.PENDING)
_ASKED_FOR = (StateReason.USER_REQUEST, StateReason.FLIGHTPLAN)


class HomeState(msgspec.Struct, frozen=True):
    location: Position | None = None
    """Home as the drone reports it; None on the ground before the first take-off.

    Parrot does not say what its altitude counts from: for display only.
    """
    takeoff_location: Position | None = None
    """Where the drone took off; altitude above the take-off point."""
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
    """What the drone does when it arrives."""
    ending_altitude: Range | None = None
    """Height at which a return that ends in hovering stays, m above ground."""
    delay_s: int | None = None
    """Seconds between the loss of the link and the return."""

    @property
    def returning(self) -> bool:
        """Is a return running or about to?"""
        return self.rth in _RETURNING

    @property
    def returning_by_itself(self) -> bool:
        """Did the drone begin the running return on its own account (battery, lost link, ...)?

        A return that a user or the end of a flight plan asked for is none of its own.
        """
        return self.rth in _RETURNING and self.reason not in _ASKED_FOR


def _auto_trigger(state: HomeState, message: rth.RthAutoTrigger) -> HomeState:
    planned = message.reason != AutoTriggerReason.NONE
    return replace(state, auto_trigger=message.reason, auto_trigger_delay_s=message.delay if planned else None)


class Home(Element[HomeState]):
    NOTHING = HomeState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        ardrone3.HomeChanged: lambda state, message: replace(
            state, location=position(message.latitude, message.longitude, message.altitude)
        ),
        rth.HomeLocation: lambda state, message: replace(
            state, location=position(message.latitude, message.longitude, message.altitude)
        ),
        rth.TakeoffLocation: lambda state, message: replace(
            state, takeoff_location=position(message.latitude, message.longitude, message.altitude)
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
        rth.Delay: lambda state, message: replace(state, delay_s=message.delay),
    }

"""Progress of a mission: current item, finished items and state. No I/O.

The drone reports the lines of its file that it has executed; a `FlightPlanFile` maps them to items of the mission. An
item is done when the drone has reported it, or when the gateway has flown it itself, and never because time or other
items passed.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence

from anafi_mav import mav_enums
from anafi_mav.plans.plan import DO_JUMP, Item
from anafi_mav.plans.translation.translate import FlightPlanFile
from anafi_mav.vehicle.mission.payload_items import PayloadItems

ENDINGS = (mav_enums.MAV_CMD_NAV_LAND, mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)
"""Items that end in a landing or a return, which is the plan's own and no take-over of the drone's."""


class State(enum.Enum):
    NONE = "no mission stored"
    READY = "not begun"
    ACTIVE = "the drone flies the mission"
    PAUSED = "begun and then stopped"
    COMPLETE = "flown completely"


class Event(enum.Enum):
    TAKE = "a mission is uploaded"
    CLEAR = "the mission is deleted"
    CHOOSE = "a client sets the current item"
    BEGIN = "the drone starts or resumes the mission"
    STOP = "the drone stops flying the mission"
    FINISH = "the last item is completed"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.NONE: {Event.TAKE: State.READY, Event.CLEAR: State.NONE},
    State.READY: {
        Event.TAKE: State.READY,
        Event.CLEAR: State.NONE,
        Event.CHOOSE: State.READY,
        Event.BEGIN: State.ACTIVE,
    },
    State.ACTIVE: {
        Event.TAKE: State.READY,
        Event.CLEAR: State.NONE,
        Event.BEGIN: State.ACTIVE,
        Event.STOP: State.PAUSED,
        Event.FINISH: State.COMPLETE,
    },
    State.PAUSED: {
        Event.TAKE: State.READY,
        Event.CLEAR: State.NONE,
        Event.CHOOSE: State.PAUSED,
        Event.BEGIN: State.ACTIVE,
    },
    State.COMPLETE: {
        Event.TAKE: State.READY,
        Event.CLEAR: State.NONE,
        Event.CHOOSE: State.READY,
        Event.BEGIN: State.ACTIVE,
    },
}
"""A missing pair cannot occur: an active mission is stopped before another item begins."""

MAVLINK_STATES = {
    State.NONE: mav_enums.MISSION_STATE_NO_MISSION,
    State.READY: mav_enums.MISSION_STATE_NOT_STARTED,
    State.ACTIVE: mav_enums.MISSION_STATE_ACTIVE,
    State.PAUSED: mav_enums.MISSION_STATE_PAUSED,
    State.COMPLETE: mav_enums.MISSION_STATE_COMPLETE,
}


class MissionProgress:
    """One mission, and how far it is."""

    def __init__(self) -> None:
        self.state = State.NONE
        self.items: tuple[Item, ...] = ()
        self._payload = PayloadItems()
        self.current = 0
        """The item that is flown, or will be when it goes on."""
        self.leg: FlightPlanFile | None = None
        """The file that the drone flies, or flew last; None: none since the mission or its current item was chosen."""
        self.line = -1
        """Of it, the one that was executed last."""
        self.jumps: dict[int, int] = {}
        """Items that jump, and how often each was done since the mission or its current item was chosen."""
        self._chosen = False
        """A client has set the current item since the mission was uploaded."""
        self._skipped: set[int] = set()
        """Lines that the drone has left out."""

    @property
    def is_untouched(self) -> bool:
        """True while the mission has not begun and no client has set its current item."""
        return self.state is State.READY and not self._chosen

    @property
    def first(self) -> int:
        """The item that a start begins with: the current one, and the first again after the end."""
        return 0 if self.state is State.COMPLETE else self.current

    @property
    def leg_done(self) -> bool:
        """The drone has executed the whole file."""
        return self.leg is not None and self.line == len(self.leg.origins) - 1

    @property
    def ending(self) -> bool:
        """The drone is at the item that lands or returns: that it does so is no surprise."""
        leg = self.leg
        if self.state is not State.ACTIVE or leg is None or self.leg_done:
            return False
        return self.items[leg.origins[self.line + 1]].command in ENDINGS

    @property
    def returned(self) -> bool:
        """The drone has executed the whole file, and its last line was a return."""
        leg = self.leg
        if leg is None or not self.leg_done or self.state not in (State.ACTIVE, State.COMPLETE):
            return False
        return self.items[leg.origins[-1]].command == mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH

    @property
    def needs_gimbal(self) -> bool:
        """True while the mission is flown and an item to come needs the gimbal."""
        return self.state is State.ACTIVE and self._payload.needs_gimbal(self.current, self.jumps)

    @property
    def needs_camera(self) -> bool:
        """True while the mission is flown and an item to come needs the camera."""
        return self.state is State.ACTIVE and self._payload.needs_camera(self.current, self.jumps)

    @property
    def at_last_line(self) -> bool:
        """All but one line of the file are executed."""
        return self.leg is not None and self.line == len(self.leg.origins) - 2

    def take(self, items: Sequence[Item]) -> None:
        """A mission was uploaded, or none any more."""
        self.state = TRANSITIONS[self.state][Event.TAKE if items else Event.CLEAR]
        self.items = tuple(items)
        self._payload = PayloadItems(self.items)
        self._forget()
        self.current, self.jumps, self._chosen = 0, {}, False

    def choose(self, item: int, *, anew: bool = True) -> None:
        """Select the item at which the mission begins next.

        Loop counters restart, unless the keyword argument is False (the mission continues at this item anyway).

        Raises `ValueError` on wrong arguments of ours: `item` must be one of the mission's, which does not fly.
        """
        if not 0 <= item < len(self.items):
            raise ValueError(f"the mission has no item {item}")
        self.state = TRANSITIONS[self.state][Event.CHOOSE]
        self._forget()
        self.current, self._chosen = item, True
        if anew:
            self.jumps = {}

    def begin(self, leg: FlightPlanFile | None, line: int = -1) -> None:
        """Record that the mission is flown, by a file or (None) by the gateway for now.

        `line` is the line of the file that was executed last.
        """
        self.state = TRANSITIONS[self.state][Event.BEGIN]
        if leg is not self.leg:
            self._skipped.clear()
        self.leg, self.line = leg, line
        if leg is not None and not self.leg_done:
            self.current = leg.origins[line + 1]

    def fly(self, item: int) -> None:
        """The gateway flies this item itself."""
        self.state = TRANSITIONS[self.state][Event.BEGIN]
        self.leg, self.line, self.current = None, -1, item

    def stop(self) -> None:
        """It does not go on by itself."""
        self.state = TRANSITIONS[self.state][Event.STOP]

    def finish(self) -> None:
        """Nothing is left of it."""
        self.state = TRANSITIONS[self.state][Event.FINISH]
        self.jumps = {}

    def did(self, items: Sequence[int]) -> None:
        """Items are done: jumps among them count."""
        for item in items:
            if self.items[item].command == DO_JUMP:
                self.jumps[item] = self.jumps.get(item, 0) + 1

    def skip(self, line: int) -> int | None:
        """The drone leaves a line out; the item that this spoils."""
        leg = self.leg
        if leg is None or not self.line < line < len(leg.origins):
            return None
        self._skipped.add(line)
        return leg.origins[line]

    def executed(self, line: int) -> tuple[int, ...]:
        """Record that the drone has executed a line; returns the items that are done with it.

        A line that was reported before, or that the file does not have, is ignored. Lines in between that were never
        reported, because the link was lost, may have been flown: that they were is not claimed.
        """
        leg = self.leg
        if self.state is not State.ACTIVE or leg is None or not self.line < line < len(leg.origins):
            return ()
        for passed in leg.done[self.line + 1 : line + 1]:
            self.did(passed)
        self.line = line
        done = leg.done[line]
        if line in self._skipped:
            done = tuple(item for item in done if item != leg.origins[line])
        if line + 1 < len(leg.origins):
            self.current = leg.origins[line + 1]
        return done

    def _forget(self) -> None:
        self.leg, self.line = None, -1
        self._skipped.clear()

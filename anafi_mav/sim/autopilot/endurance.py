"""Endurance: reachability of home, times of the automatic return and the forced landing.

Everything is counted in percent of the battery. A hover takes 100 % per flight time of the model, and a way is flown
at the speeds of `homing`. Parrot publishes neither thresholds nor times; all of them are assumed, but the events and
their rhythm are those of ardrone3.xml and rth.xml: on change, and once a second while something is announced.
"""

from __future__ import annotations

import math

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.ardrone3 import BatteryCapacityStatus, ForcedLandingReason
from anafi_mav.arsdk.messages.rth import AutoTriggerReason, RthAutoTriggerMode, RthHomeReachability
from anafi_mav.sim.autopilot import homing, power
from anafi_mav.sim.features.settings import DroneSettings
from anafi_mav.sim.world.model import AircraftModel
from anafi_mav.sim.world.motion import Pose

PERIOD = 1.0
"""s between two looks, and between two announcements (ardrone3.xml: "then every seconds")."""

NOTICE = 30.0
"""s before a return or a landing by itself that it is announced."""

SHORTEST_NOTICE = 10.0
"""s that a pilot gets to cancel a return, even if it is already overdue."""

DESCENT_SPEED = 2.0
"""m/s down, the landing included."""

MANOEUVRE = 10.0
"""s for turning, speeding up and braking on the way."""

AT_HOME = 15.0
"""m from home within which a return would bring nothing."""

CRITICAL_MARGIN = 2.0
"""Percent beyond what the way home takes below which home is only just in reach."""

_HYSTERESIS = 15.0
"""s that the time left must grow by before an announcement is withdrawn."""

_DOWN = power.EMPTY + 0.5
"""Percent at which the drone comes down: reported percentages are rounded."""

_ROUNDING = 1e-6
"""s: ten seconds are announced as ten, not as eleven."""


class Endurance:
    """Looks at charge and distance.

    `return_due` and `landing_due` are for the firmware to act on.
    """

    def __init__(self, model: AircraftModel, settings: DroneSettings) -> None:
        self._settings = settings
        self.rate = 100.0 / model.airframe.flight_time
        """Percent per second."""
        self.reachability = RthHomeReachability.UNKNOWN
        self.capacity = BatteryCapacityStatus.UNKNOWN
        self._return = _Countdown()
        self._landing = _Countdown()
        self._forced = False
        self._cancelled = False
        self._next = 0.0
        self._time = 0.0

    # -- what others ask

    def needed(self, pose: Pose, home: tuple[float, float]) -> float:
        """Percent that the way to `home` (north, east) and down to the ground takes."""
        ceiling = self._settings.number("max_altitude")
        height = max(pose.up, min(self._settings.number("rth_min_altitude"), ceiling))
        _, distance = pose.bearing(*home)
        seconds = (height - pose.up) / homing.CLIMB_SPEED + distance / homing.SPEED + height / DESCENT_SPEED + MANOEUVRE
        return seconds * self.rate

    @property
    def return_due(self) -> bool:
        """The announced time has come."""
        return self._return.over

    @property
    def landing_due(self) -> bool:
        """The battery carries the drone no longer."""
        return self._landing.over

    # -- time

    def looks(self, time: float) -> bool:
        """`tick` will look at the way home."""
        return time >= self._next

    def tick(
        self,
        time: float,
        charge: float,
        pose: Pose,
        home: tuple[float, float] | None,
        *,
        flying: bool,
        returning: bool,
    ) -> list[Message]:
        """Update the predictions and return the messages to send.

        `home` is (north, east) in m, None if unknown; `flying`: in the air, but not in a forced landing; `returning`:
        on the way home already.
        """
        self._time = time
        if flying and charge < _DOWN:
            self._landing.now(time)
        for countdown in (self._return, self._landing):
            countdown.tick(time)
        if time < self._next or self._landing.over:
            return []
        self._next = time + PERIOD
        if flying:
            return self._look(time, charge, pose, home, returning)
        forced = [self.landing_report()] if self._forced else []
        return forced + self._judge(RthHomeReachability.UNKNOWN, BatteryCapacityStatus.UNKNOWN)

    def _look(
        self, time: float, charge: float, pose: Pose, home: tuple[float, float] | None, returning: bool
    ) -> list[Message]:
        messages: list[Message] = []
        if self._landing.follow(time, (charge - _DOWN) / self.rate):
            messages.append(self.landing_report())
        if home is None:
            messages += self._withdraw()
            return messages + self._judge(RthHomeReachability.UNKNOWN, BatteryCapacityStatus.UNKNOWN)
        needed = self.needed(pose, home)
        left = (charge - power.CRITICAL - needed) / self.rate
        wanted = self._settings["rth_auto_trigger"] is RthAutoTriggerMode.ON and not (self._cancelled or returning)
        if not wanted or pose.bearing(*home)[1] < AT_HOME:
            messages += self._withdraw()
        elif not self._return.over and self._return.follow(time, left, SHORTEST_NOTICE):
            messages.append(self.return_report())
        usable = charge - _DOWN
        if usable < needed:
            return messages + self._judge(RthHomeReachability.NOT_REACHABLE, BatteryCapacityStatus.CRITICAL)
        close = usable < needed + CRITICAL_MARGIN
        reach = RthHomeReachability.CRITICAL if close else RthHomeReachability.REACHABLE
        low = close or left <= NOTICE
        return messages + self._judge(reach, BatteryCapacityStatus.WARNING if low else BatteryCapacityStatus.OK)

    def _judge(self, reachability: RthHomeReachability, capacity: BatteryCapacityStatus) -> list[Message]:
        messages: list[Message] = []
        if reachability is not self.reachability:
            self.reachability = reachability
            messages.append(rth.HomeReachability(reachability))
        if capacity is not self.capacity:
            self.capacity = capacity
            messages.append(ardrone3.ReturnHomeBatteryCapacity(capacity))
        return messages

    # -- reports of the firmware

    def took_off(self) -> None:
        """A new flight: look at once."""
        self._next = 0.0

    def landed(self) -> list[Message]:
        """The flight is over, and so is everything that was announced."""
        self._cancelled = False
        self._next = 0.0
        messages = self._withdraw()
        if self._landing.clear() or self._forced:
            self._forced = False
            messages.append(self.landing_report())
        return messages

    def cancel(self) -> list[Message]:
        """rth.cancel_auto_trigger: not again in this flight.

        Without such a plan it has no effect (rth.xml).
        """
        self._cancelled = self._cancelled or self._return.due is not None
        return self._withdraw()

    def aborted(self) -> None:
        """The pilot put an end to the return that the battery began: not again in this flight."""
        self._cancelled = True

    def returned(self) -> list[Message]:
        """The return that was announced has begun (or cannot): it is announced no longer."""
        return self._withdraw()

    def forced(self) -> list[Message]:
        """The landing that was announced has begun."""
        self._forced = True
        self._landing.clear()
        self._next = self._time + PERIOD
        return [*self._withdraw(), self.landing_report()]

    def _withdraw(self) -> list[Message]:
        return [self.return_report()] if self._return.clear() else []

    def return_report(self) -> Message:
        planned = self._return.due is not None
        reason = AutoTriggerReason.BATTERY_CRITICAL_SOON if planned else AutoTriggerReason.NONE
        return rth.RthAutoTrigger(reason, self._return.left)

    def landing_report(self) -> Message:
        planned = self._forced or self._landing.due is not None
        reason = ForcedLandingReason.BATTERY_CRITICAL_SOON if planned else ForcedLandingReason.NONE
        return ardrone3.ForcedLandingAutoTrigger(reason, 0 if self._forced else self._landing.left)

    def states_report(self) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        return [
            rth.HomeReachability(self.reachability),
            ardrone3.ReturnHomeBatteryCapacity(self.capacity),
            self.return_report(),
            self.landing_report(),
        ]


class _Countdown:
    """Something that happens at `due` unless there is more time after all."""

    def __init__(self) -> None:
        self.due: float | None = None
        self.left = 0
        """Whole seconds, as announced."""
        self.over = False
        self._earliest = 0.0

    def now(self, time: float) -> None:
        """It has come to that without further notice."""
        self.due = time
        self.left = 0

    def tick(self, time: float) -> None:
        self.over = self.due is not None and time >= self.due

    def follow(self, time: float, seconds: float, shortest: float = 0.0) -> bool:
        """Plan, update or withdraw the countdown; return True when it must be reported.

        `seconds` are left by the latest prediction. Once planned the action is not postponed, however long a
        battery is held at its level, and does not happen sooner than `shortest`.
        """
        if self.due is None:
            if seconds > NOTICE + _ROUNDING:
                return False
            self._earliest = time + shortest
            self.due = max(time + seconds, self._earliest)
        elif seconds > NOTICE + _HYSTERESIS:
            return self.clear()
        else:
            self.due = max(min(self.due, time + seconds), self._earliest)
        self.left = math.ceil(max(self.due - time - _ROUNDING, 0.0))
        return True

    def clear(self) -> bool:
        """Forget it; True when it was planned."""
        planned, self.due, self.left, self.over = self.due is not None, None, 0, False
        return planned

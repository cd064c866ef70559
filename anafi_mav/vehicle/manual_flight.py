"""Flight by the sticks of ground stations.

They fly the drone in mode Position (Loiter in ArduPilot's words) and in no other: a joystick that lies on the table is
streamed all the time, and a goto or a mission is not ended by it. A stick of PX4's clients that leaves the middle takes
over and selects that mode (`joystick_override`). A stick asks for a share of the drone's own MaxTilt,
MaxVerticalSpeed and MaxRotationSpeed (arsdk 2.2). `services.setpoint.stick_messages` reads them from messages.

The sticks are centred `SILENCE` after the last message of the client that flies them.
"""

from __future__ import annotations

import asyncio
import contextlib
import enum
import math
from collections.abc import Callable, Coroutine, Hashable
from dataclasses import dataclass, replace
from typing import Any

from anafi_mav import texts
from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import PilotingCommand
from anafi_mav.errors import LinkLost
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.clients import system_of
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.silence import SILENCE
from anafi_mav.vehicle.joystick_override import JoystickOverride, Override

MEANT = 0.2
"""Share of the way from which a stick that does nothing is worth a word."""

GESTURE = 0.95
"""Share of the way from which a stick is at its end: throttle down and yaw right arm an ArduPilot and a PX4."""


class State(enum.Enum):
    """State of the sticks."""

    IDLE = "sticks centred or not received"
    HELD = "a client holds deflected sticks"


class Event(enum.Enum):
    """Event that changes the state of the sticks."""

    CENTRED = "the holding client's sticks are centred, or another client's are"
    DEFLECTED = "a client deflects its sticks"
    SILENCE = "no stick input of the holding client for too long"
    END = "another flight task is active"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.IDLE: {Event.CENTRED: State.IDLE, Event.DEFLECTED: State.HELD, Event.END: State.IDLE},
    State.HELD: {
        Event.CENTRED: State.IDLE,
        Event.DEFLECTED: State.HELD,
        Event.SILENCE: State.IDLE,
        Event.END: State.IDLE,
    },
}
"""The pair that is missing cannot happen: the silence of centred sticks is not noticed."""


@dataclass(frozen=True)
class Sticks:
    """Stick positions as fractions of full deflection, -1..1."""

    forward: float = 0.0
    right: float = 0.0
    turn: float = 0.0
    """Clockwise +."""
    climb: float = 0.0

    @property
    def centred(self) -> bool:
        return not any((self.forward, self.right, self.turn, self.climb))


class ManualFlight:
    """Flies one vehicle by the sticks of ground stations."""

    def __init__(self, vehicle: Aircraft, clock: Clock, overridable: Callable[[], Override]) -> None:
        """Create the flight by sticks for one vehicle.

        `overridable` returns the kind of flight that is active now, as far as a joystick may override it.
        """
        self.run_action: Callable[[Hashable, Coroutine[Any, Any, None]], asyncio.Task[None]]
        """Runs an action of a client, in its turn among the commands; set by the service."""
        self.override = JoystickOverride()
        self._overridable = overridable
        self._overriding = False
        self.warn_throttled: Callable[[OperatorText], None] = lambda text: vehicle.text(Severity.WARNING, text)
        self.state = State.IDLE
        self._vehicle = vehicle
        self._clock = clock
        self._pilot: Hashable = None
        self._said = -math.inf
        self._silence = Alarm(self._expired)

    def receive(self, sender: Hashable, sticks: Sticks, *, overrides: bool = False) -> None:
        """Take a client's stick positions.

        With `overrides` they may take the drone over from what flies it.
        """
        vehicle = self._vehicle
        if overrides and self._takes_over(sender, sticks):
            self._overriding = True
            self.run_action(sender, self._override(sender, sticks)).add_done_callback(self._overridden)
        if self._overriding:
            return
        sticks = replace(sticks, climb=self.override.climb(sender, sticks.climb))
        if self.state is State.HELD and sender != self._pilot:
            if not sticks.centred:
                self.warn_throttled(texts.STICKS_IGNORED.fill(reason=texts.OTHER_STICKS))
            return
        if sticks.centred:
            self._let_go(Event.CENTRED)
            return
        if not self._may_fly(sticks):
            self._let_go(Event.END)
            return
        limits = vehicle.drone.piloting.limits
        if limits is None:
            return
        self.state, self._pilot = TRANSITIONS[self.state][Event.DEFLECTED], sender
        self._said = self._clock.monotonic()
        if self._silence.at is None:
            self._watch()
        vehicle.drone.piloting.pilot(
            PilotingCommand(
                roll_deg=sticks.right * limits.tilt_deg,
                pitch_deg=-sticks.forward * limits.tilt_deg,
                yaw_rate_dps=sticks.turn * limits.yaw_rate_dps,
                climb_mps=sticks.climb * limits.climb_mps,
            )
        )

    def _takes_over(self, sender: Hashable, sticks: Sticks) -> bool:
        """True at the moment at which this client's joystick takes the drone over."""
        largest = max(abs(sticks.forward), abs(sticks.right), abs(sticks.turn))
        if not self.override.moved(sender, largest, self._clock.monotonic()) or self._overriding:
            return False
        if self._vehicle.drone.controller.pilot_acquired_control:
            return False
        return bool(self._overridable() & self.override.sources)

    async def _override(self, sender: Hashable, sticks: Sticks) -> None:
        """Stop what flies, in mode Position, and let the joystick fly. Raises as `Vehicle.hold`."""
        await self._vehicle.hold(FlightMode.POSITION, Right(sender, Extent.COMMANDED))
        self.override.take_over(sender, sticks.climb)
        self._vehicle.text(Severity.WARNING, texts.JOYSTICK_OVERRIDE.fill(system=system_of(sender) or 0))

    def _overridden(self, task: asyncio.Task[None]) -> None:
        """Sticks count again: the drone was taken over, or another action came in between."""
        self._overriding = False

    def silent(self, sender: Hashable) -> None:
        """Centre the sticks when this client holds them: it has released all its channels."""
        if sender == self._pilot:
            self._let_go(Event.CENTRED)

    def _may_fly(self, sticks: Sticks) -> bool:
        """Return True when these sticks may fly the drone: in the air and in mode Position.

        A refusal is sent as a text only when the deflection looks deliberate: a throttle may rest at its end.
        """
        vehicle, mode = self._vehicle, self._vehicle.mode
        meant = max(abs(sticks.forward), abs(sticks.right), abs(sticks.turn)) >= MEANT
        reason: OperatorText | None = None
        if vehicle.on_ground:
            if sticks.climb <= -GESTURE and sticks.turn >= GESTURE:
                reason = texts.STICKS_DO_NOT_ARM
        elif mode is not FlightMode.POSITION:
            reason = texts.STICKS_IGNORED_MODE.fill(mode=mode.value) if meant else None
        elif vehicle.drone.controller.pilot_acquired_control:
            reason = texts.PILOT
        else:
            return True
        if reason is not None:
            self.warn_throttled(texts.STICKS_IGNORED.fill(reason=reason))
        return False

    def end(self) -> list[asyncio.Task[None]]:
        """End this flight task: something else flies the drone now."""
        self._let_go(Event.END)
        return []

    def link_down(self) -> None:
        """Release the sticks when the drone is disconnected."""
        self._silence.cancel()
        self.override.forget()
        self._overriding = False
        self.state, self._pilot, self._said = State.IDLE, None, -math.inf

    def _let_go(self, event: Event) -> None:
        """Centre the sticks if a client held them."""
        held = self.state is State.HELD
        self.state, self._pilot = TRANSITIONS[self.state][event], None
        if held:
            self._silence.cancel()
            with contextlib.suppress(LinkLost):
                self._vehicle.drone.piloting.pilot(None)

    def _expired(self) -> None:
        if self._clock.monotonic() - self._said < SILENCE:
            self._watch()
        elif self.state is State.HELD:
            self._let_go(Event.SILENCE)
            self._vehicle.text(Severity.WARNING, texts.STICKS_SILENT)

    def _watch(self) -> None:
        """Come back when they have been silent for too long."""
        self._silence.set(self._said + SILENCE)

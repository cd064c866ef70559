"""Flight by the sticks of ground stations.

They fly the drone in mode Position (Loiter in ArduPilot's words) and in no other: a joystick that lies on the table is
streamed all the time, and a goto or a mission is not ended by it. A stick of PX4's clients that leaves the middle takes
over and selects that mode (`joystick_override`). A stick asks for a share of the drone's own MaxTilt,
MaxVerticalSpeed and MaxRotationSpeed (arsdk 2.2). `services.setpoint.stick_messages` reads them from messages.

The sticks are centred `SILENCE` after the last message of the client that flies them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

from anafi_mav import texts
from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import PilotingCommand
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.flight_task import PlainTask, stop_rules
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.right import Extent, system_of
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.joystick_override import JoystickOverride, Override
from anafi_mav.vehicle.offboard.silence import SILENCE

GESTURE = 0.95
"""Share of the way from which a stick is at its end: throttle down and yaw right arm an ArduPilot and a PX4."""


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


class ManualFlight(PlainTask):
    """Flies one vehicle by the sticks of ground stations: the hovering mode Position."""

    rules = stop_rules(texts.Subject(FlightMode.POSITION.value), Extent.ALL, Extent.ALL)
    mode = FlightMode.POSITION

    def __init__(
        self,
        vehicle: Aircraft,
        clock: Clock,
        overridable: Callable[[], Override],
        refused: Callable[[], OperatorText | None],
    ) -> None:
        """Create the flight by sticks for one vehicle.

        `overridable` returns the kind of flight that is active now, as far as a joystick may override it; `refused`
        returns the reason for which sticks of clients do not fly the drone, whatever the mode is.
        """
        self._refused = refused
        self.override = JoystickOverride()
        self._overridable = overridable
        self._vehicle = vehicle
        self._clock = clock
        self.holder: Hashable = None
        """The client that holds deflected sticks; None: no client does."""
        self._overriding: asyncio.Task[None] | None = None
        """The newest action by which a joystick takes the drone over: no sticks count until it has ended."""
        self._silence = Alarm(self._expired)

    @property
    def _is_overriding(self) -> bool:
        return self._overriding is not None and not self._overriding.done()

    def receive(self, sender: Hashable, sticks: Sticks, *, overrides: bool = False) -> OperatorText | None:
        """Take a client's stick positions; return why they do not fly the drone, or None.

        With `overrides` they may take the drone over from what flies it. Centred sticks ask for nothing.
        """
        vehicle = self._vehicle
        if overrides and self._takes_over(sender, sticks):
            self._centre()
            self._overriding = vehicle.control.run(sender, self._override(sender, sticks))
        if self._is_overriding:
            return None
        sticks = replace(sticks, climb=self.override.climb(sender, sticks.climb))
        if self.holder not in (None, sender):
            return None if sticks.centred else texts.OTHER_STICKS
        if sticks.centred:
            self._centre()
            return None
        if (reason := self._objection(sticks)) is not None:
            self._centre()
            return reason
        limits = vehicle.drone.piloting.limits
        if limits is None:
            return texts.TILT_UNKNOWN
        self.holder = sender
        self._silence.set(self._clock.monotonic() + SILENCE)
        vehicle.drone.piloting.pilot(
            PilotingCommand(
                roll_deg=sticks.right * limits.tilt_deg,
                pitch_deg=-sticks.forward * limits.tilt_deg,
                yaw_rate_dps=sticks.turn * limits.yaw_rate_dps,
                climb_mps=sticks.climb * limits.climb_mps,
            )
        )
        return None

    def _takes_over(self, sender: Hashable, sticks: Sticks) -> bool:
        """True at the moment at which this client's joystick takes the drone over."""
        largest = max(abs(sticks.forward), abs(sticks.right), abs(sticks.turn))
        if not self.override.moved(sender, largest, self._clock.monotonic()) or self._is_overriding:
            return False
        if self._vehicle.drone.controller.pilot_acquired_control or self._refused() is not None:
            return False
        return bool(self._overridable() & self.override.sources)

    async def _override(self, sender: Hashable, sticks: Sticks) -> None:
        """Stop what flies, in mode Position, and let the joystick fly. Raises as `Vehicle.hold`."""
        await self._vehicle.hold(FlightMode.POSITION, self._vehicle.right(sender, Extent.COMMANDED))
        self.override.take_over(sender, sticks.climb)
        self._vehicle.text(Severity.WARNING, texts.JOYSTICK_OVERRIDE.fill(system=system_of(sender) or 0))

    def silent(self, sender: Hashable) -> None:
        """Centre the sticks when this client holds them: it has released all its channels."""
        if sender == self.holder:
            self._centre()

    def _objection(self, sticks: Sticks) -> OperatorText | None:
        """Return why deflected sticks may not fly the drone; None in the air, in mode Position."""
        vehicle, mode = self._vehicle, self._vehicle.mode
        if vehicle.on_ground:
            is_gesture = sticks.climb <= -GESTURE and sticks.turn >= GESTURE
            return texts.STICKS_DO_NOT_ARM if is_gesture else texts.TAKE_OFF_FIRST
        if (reason := self._refused()) is not None:
            return reason
        if mode is not FlightMode.POSITION:
            return texts.STICKS_IGNORED_MODE.fill(mode=mode.value)
        return texts.PILOT if vehicle.drone.controller.refuse_sticks() else None

    def end(self) -> list[asyncio.Task[None]]:
        """End this flight task: something else flies the drone now."""
        self._centre()
        return []

    def link_down(self) -> None:
        """Forget where the joysticks were; control has ended the flight by them."""
        self.override.forget()

    def _centre(self) -> None:
        """Centre the sticks if a client holds them."""
        if self.holder is not None:
            self.holder = None
            self._silence.cancel()
            self._vehicle.centre_sticks()

    def _expired(self) -> None:
        self._centre()
        self._vehicle.text(Severity.WARNING, texts.STICKS_SILENT)

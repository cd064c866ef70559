"""Flies the drone by the pilot's setpoints for as long as mode Offboard is engaged: the shell around `offboard`.

A setpoint reaches the sticks the moment it arrives, and again whenever the drone tells its attitude; a timer turns the
pilot's silence into a hover.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Hashable
from typing import TYPE_CHECKING

from anafi_mav import units
from anafi_mav.clock import Clock
from anafi_mav.drone import PilotingCommand
from anafi_mav.errors import LinkLost
from anafi_mav.services.modes import FlightMode
from anafi_mav.services.offboard import AttitudeSetpoint, OffboardStream, State, yaw_rate_towards
from anafi_mav.services.refusal import Refused
from anafi_mav.services.statustext import Severity

if TYPE_CHECKING:
    from anafi_mav.services.vehicle import Vehicle

HEADING_AGE = 1.0
"""s after which the drone's heading is not known any more: it comes five times a second. A heading loop that closes on
an older one turns for ever."""


class OffboardFlight:
    """The setpoints of programs on one vehicle, and the drone flown by those of its pilot."""

    def __init__(self, vehicle: Vehicle, clock: Clock) -> None:
        self._vehicle = vehicle
        self._clock = clock
        self._stream = OffboardStream()
        self._timer: asyncio.TimerHandle | None = None
        self._attitude_at = -math.inf

    @property
    def engaged(self) -> bool:
        """Setpoints fly the drone."""
        return self._stream.state is State.ENGAGED

    def setpoint(self, sender: Hashable, setpoint: AttitudeSetpoint) -> bool:
        """A program's newest setpoint; flies the drone at once when mode Offboard is engaged and it is the pilot.

        False: it is not listened to, another program flies.
        """
        if not self._stream.receive(sender, setpoint, self._clock.monotonic()):
            return False
        if self._timer is None:
            self._watch()
        if self.engaged:
            self._fly()
        return True

    async def engage(self, client: Hashable) -> None:
        """Mode Offboard begins for this client; returns when its setpoints fly the drone, or raises `Refused`."""
        vehicle = self._vehicle
        if not vehicle.in_air:
            raise Refused("Offboard refused: take off first, setpoints do not lift an ANAFI off the ground")
        if vehicle.returning:
            raise Refused("Offboard refused: the drone returns home")
        if vehicle.drone.controller.pilot_flies:
            raise Refused("Offboard refused: the pilot at the Skycontroller flies")
        if vehicle.drone.piloting.limits is None:
            raise Refused("Offboard refused: the drone has not reported what full tilt and speed are")
        if self._stream.candidate(client, self._clock.monotonic()) is None:
            raise Refused("Offboard refused: no setpoints arrive")
        await vehicle.take_over()
        await vehicle.drone.piloting.cancel_return_home()
        pilot = self._stream.candidate(client, self._clock.monotonic())
        if pilot is None or not vehicle.in_air or vehicle.returning:
            raise Refused("Offboard refused: the setpoints stopped, or the drone is not free to fly them")
        self._stream.engage(pilot)
        self._watch()  # the pilot's, which may be older than the newest of all
        vehicle.drone.piloting.hover()  # ends a moveTo or moveBy of ours, which would ignore sticks
        vehicle.select(FlightMode.OFFBOARD)
        self._fly()

    def end(self) -> None:
        """Whoever flew by setpoints flies no more, and the last one does not fly on."""
        if self.engaged:
            self._stream.disengage()
            self._vehicle.forget_mode()
            with contextlib.suppress(LinkLost):
                self._vehicle.drone.piloting.pilot(None)

    def on_attitude(self) -> None:
        """The drone told its attitude: the heading loop closes on it."""
        self._attitude_at = self._clock.monotonic()
        if self.engaged:
            self._fly()

    def link_down(self) -> None:
        """Setpoints of before count for nothing."""
        self._cancel_timer()
        self._stream = OffboardStream()
        self._attitude_at = -math.inf

    def _fly(self) -> None:
        """Send the pilot's newest setpoint, with what the heading loop makes of it at this moment."""
        now, drone = self._clock.monotonic(), self._vehicle.drone
        setpoint, limits = self._stream.setpoint, drone.piloting.limits
        if setpoint is None or limits is None:
            return
        if drone.controller.pilot_flies:
            # He moved a stick. That he let go of it again does not give the drone back to the program.
            self._vehicle.select(FlightMode.HOLD)
            self._vehicle.text(Severity.WARNING, "Offboard ended: the pilot at the Skycontroller flies")
            return
        attitude = drone.piloting.state.attitude
        turn = setpoint.yaw_rate
        if attitude is not None and now - self._attitude_at < HEADING_AGE:
            turn = yaw_rate_towards(setpoint, attitude.yaw)
        drone.piloting.pilot(
            PilotingCommand(
                roll_deg=setpoint.roll * units.DEG_PER_RAD,
                pitch_deg=setpoint.pitch * units.DEG_PER_RAD,
                yaw_rate_dps=turn * units.DEG_PER_RAD,
                climb_mps=setpoint.climb * limits.climb_mps,
            ),
            age=self._stream.age(now),
        )

    def _expired(self) -> None:
        self._timer = None
        if self._stream.expire(self._clock.monotonic()):
            self._vehicle.drone.piloting.hover()
            self._vehicle.select(FlightMode.HOLD)
            self._vehicle.text(Severity.WARNING, "Offboard setpoints stopped: hovering")
        self._watch()

    def _watch(self) -> None:
        """Come back when those that matter have been silent for too long."""
        self._cancel_timer()
        deadline = self._stream.deadline()
        if deadline is not None:
            delay = max(deadline - self._clock.monotonic(), 0.0)
            self._timer = asyncio.get_running_loop().call_later(delay, self._expired)

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

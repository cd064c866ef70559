"""Faults that a test or a scenario can set on a simulated drone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.ardrone3 import MotorError, WarningLevel
from anafi_mav.arsdk.messages.common import FlightPlanComponent
from anafi_mav.sim.world.quirks import Quirk, Scramble


@dataclass(frozen=True)
class Impairment:
    """Impairment of the datagrams of one direction. Probabilities are per datagram."""

    loss: float = 0.0
    delay: float = 0.0
    """s that every datagram is late."""
    jitter: float = 0.0
    """s at most that one is later than that, evenly spread; more than the gap between two lets them overtake."""
    duplicate: float = 0.0
    reorder: float = 0.0
    """Share that is held back until the next one has passed (or `HELD` s)."""

    @property
    def clear(self) -> bool:
        """Nothing happens to anything."""
        return not (self.loss or self.delay or self.jitter or self.duplicate or self.reorder)


CLEAR = Impairment()


@dataclass
class Faults:
    """Set an attribute to break something, set it back to mend it.

    `mute` takes effect at once, `up` and `down` with the next datagram, the others within 50 simulated ms.
    """

    on_mute: Callable[[bool], None] = field(default=lambda mute: None, repr=False, compare=False)
    """Called with each new value of `mute`; the owner of the sockets sets it."""
    mute: bool = False
    """Total loss of the link: no datagram passes either way, and no controller can connect."""
    up: Impairment = CLEAR
    """From the controller to the drone."""
    down: Impairment = CLEAR
    """From the drone to the controller."""
    gps: bool = True
    """False: the receiver has no fix."""
    magneto_required: bool = False
    """The magnetometer needs calibration; a calibration puts it back to False."""
    battery: int | None = None
    """Percent that the battery is held at; None lets it empty from where it is."""
    motor_error: MotorError = MotorError.NO_ERROR
    """A motor fails: in the air that ends in an emergency landing, on the ground it forbids the take-off."""
    motors: int = 0b0001
    """Which motors `motor_error` concerns: bit 0 front left, then clockwise."""
    vibration: WarningLevel = WarningLevel.OK
    refuse_take_off: frozenset[TakeoffChecklistType] = frozenset()
    """Further lines of the take-off checklist that prevent it."""
    refuse_plan: frozenset[FlightPlanComponent] = frozenset()
    """Further components of a flight plan that are reported as not ready.

    Those that depend on the file are checked when the plan is started.
    """
    no_pictures: bool = False
    """The live video shows nothing, as while a camera changes its mode; its sessions stay open."""
    storage_full: bool = False
    """No room for a photo more."""
    quirks: frozenset[Quirk | Scramble] = frozenset()
    """Ways in which this firmware differs from the simulated one."""
    unreported: frozenset[str] = frozenset()
    """Names of events that this firmware does not send, at once, telemetry included: what is not written down another
    one may not tell."""
    late: Mapping[str, float] = field(default_factory=dict)
    """s by which events of these names are sent later, telemetry not included; the order of one kind stays."""

    def __setattr__(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)
        if name == "mute":
            self.on_mute(bool(value))

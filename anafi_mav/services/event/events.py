"""The event interface: sequence of events, retransmission, and health report. No I/O.

Protocol: MAVLink events.md, mavlink/libevents; conformance C12.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from anafi_mav.drone.events import BlockerKind, FlyingState, TakeoffChecklistType
from anafi_mav.mavlink import dialect
from anafi_mav.services.event import event_table as table
from anafi_mav.services.event.event_table import ALL_MODES, Event, HealthComponent, Level, mode_bits
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.vehicle import Vehicle

KEPT = 128
"""Number of events that can be requested again: a dozen reports of the health checks."""

MAX_REQUEST = 64
"""Number of events sent for one request; a client that missed more requests again."""

NEED_POSITION = frozenset({FlightMode.RETURN, FlightMode.MISSION, FlightMode.FOLLOW, FlightMode.ORBIT})
"""Modes that cannot be flown without a GPS fix."""


class EventLog:
    """The events of one component, numbered."""

    def __init__(self) -> None:
        self.sequence = 0
        """Of the newest event; the first is 1."""
        self._kept: deque[dialect.MAVLink_event_message] = deque(maxlen=KEPT)

    def add(self, event: Event, arguments: bytes, boot_ms: int) -> dialect.MAVLink_message:
        """Add an event; return the message to send to all clients."""
        self.sequence = (self.sequence + 1) & 0xFFFF
        message = dialect.MAVLink_event_message(
            0, 0, event.id, boot_ms, self.sequence, event.log_levels, list(arguments)
        )
        self._kept.append(message)
        return message

    def again(self, first: int, last: int, sysid: int, compid: int) -> Iterator[dialect.MAVLink_message]:
        """Yield the events from `first` to `last`, and an error for each that is not kept.

        `last` may lie beyond the wrap.
        """
        kept = {message.sequence: message for message in self._kept}
        oldest = self._kept[0].sequence if self._kept else self.sequence
        for number in range(min((last - first & 0xFFFF) + 1, MAX_REQUEST)):
            sequence = first + number & 0xFFFF
            message = kept.get(sequence)
            yield message or dialect.MAVLink_response_event_error_message(
                sysid, compid, sequence, oldest, dialect.MAV_EVENT_ERROR_REASON_UNAVAILABLE
            )


@dataclass(frozen=True)
class HealthReport:
    """The reasons that keep the vehicle on the ground, and the health of its components.

    They are events, in the sequence in which they are sent.
    """

    events: tuple[tuple[Event, bytes], ...]


_PART_OF_CHECK = {
    TakeoffChecklistType.GYRO: HealthComponent.SENSORS,
    TakeoffChecklistType.MAGNETO: HealthComponent.MAGNETOMETER,
    TakeoffChecklistType.BARO: HealthComponent.SENSORS,
    TakeoffChecklistType.GPS: HealthComponent.GPS,
    TakeoffChecklistType.ULTRASOUND: HealthComponent.SENSORS,
    TakeoffChecklistType.VCAM: HealthComponent.SENSORS,
    TakeoffChecklistType.VERTICAL_TOF: HealthComponent.SENSORS,
    TakeoffChecklistType.MAGNETO_CALIBRATION: HealthComponent.MAGNETOMETER,
    TakeoffChecklistType.MOTOR_DOWN: HealthComponent.MOTORS,
    TakeoffChecklistType.NO_SMARTBATTERY: HealthComponent.BATTERY,
    TakeoffChecklistType.TAKEOFF_FORBIDDEN_BY_BATTERY: HealthComponent.BATTERY,
    TakeoffChecklistType.PITOT: HealthComponent.SENSORS,
}

_EVENTS = {
    BlockerKind.CHECK: (table.CHECKLIST, HealthComponent.SYSTEM),
    BlockerKind.MAGNETOMETER: (table.MAGNETOMETER, HealthComponent.MAGNETOMETER),
    BlockerKind.CALIBRATING: (table.CALIBRATING, HealthComponent.MAGNETOMETER),
    BlockerKind.SENSOR: (table.SENSOR, HealthComponent.SENSORS),
    BlockerKind.BATTERY: (table.BATTERY, HealthComponent.BATTERY),
    BlockerKind.ALERT: (table.ALERT, HealthComponent.SYSTEM),
    BlockerKind.MOTOR: (table.MOTOR, HealthComponent.MOTORS),
}


def part_of(check: TakeoffChecklistType) -> HealthComponent:
    """Return the component that a line of the checklist concerns."""
    if check.name.startswith("BATTERY_"):
        return HealthComponent.BATTERY
    return _PART_OF_CHECK.get(check, HealthComponent.SYSTEM)


def _checks(vehicle: Vehicle) -> Iterator[tuple[Event, HealthComponent, int, tuple[int, ...]]]:
    """Yield the checks that did not pass: (event, component, modes it concerns, values).

    The values are empty for a check that has none.
    """
    if vehicle.flying_state is None:
        yield table.SILENT, HealthComponent.SYSTEM, ALL_MODES, ()
    if vehicle.flying_state == FlyingState.EMERGENCY:
        yield table.EMERGENCY, HealthComponent.SYSTEM, ALL_MODES, ()
    for blocker in vehicle.drone.blockers():
        event, part = _EVENTS[blocker.kind]
        if isinstance(blocker.value, TakeoffChecklistType):
            part = part_of(blocker.value)
            if blocker.value == TakeoffChecklistType.MAGNETO_CALIBRATION:
                event = table.MAGNETOMETER  # says what to do
        has_value = len(event.arguments) > len(table.CHECK_ARGUMENTS) and blocker.value is not None
        # A value that is newer than our tables may not fit into a byte; 255 reads as unknown, too.
        yield event, part, ALL_MODES, (min(max(int(blocker.value or 0), 0), 255),) if has_value else ()
    if vehicle.fence_problem is not None:
        yield table.FENCE, HealthComponent.SYSTEM, ALL_MODES, ()
    if vehicle.place is None:
        yield table.NO_FIX, HealthComponent.GPS, mode_bits(NEED_POSITION), ()


def _present(vehicle: Vehicle) -> HealthComponent:
    """Return the components whose state the drone has reported."""
    drone = vehicle.drone
    present = HealthComponent.SYSTEM
    if drone.gps.state.fixed is not None:
        present |= HealthComponent.GPS
    if drone.battery.state.percent is not None:
        present |= HealthComponent.BATTERY
    if drone.calibration.state.magneto_required is not None:
        present |= HealthComponent.MAGNETOMETER
    if drone.alerts.state.motor_error is not None:
        present |= HealthComponent.MOTORS
    if drone.calibration.state.sensors:
        present |= HealthComponent.SENSORS
    return present


def report(vehicle: Vehicle) -> HealthReport:
    """Return the report for the present state.

    The checks are `Vehicle.prearm_problems`, component by component; arming obeys the same.
    """
    found = list(_checks(vehicle))
    if vehicle.prearm_problems() and all(event.level != Level.ERROR for event, *_ in found):
        found.append(
            (table.OTHER, HealthComponent.SYSTEM, ALL_MODES, ())
        )  # what is not in the table keeps it down all the same
    errors = warnings = HealthComponent(0)
    for event, part, _, _ in found:
        if event.level == Level.ERROR:
            errors |= part
        else:
            warnings |= part
    # Of an armed vehicle whose mode is not among them QGroundControl shows that it cannot fly. An orbit is begun by a
    # command, and so is never among those that a client may choose.
    can_run = mode_bits(vehicle.enterable_modes | {vehicle.mode, FlightMode.ORBIT})
    if vehicle.place is None:
        can_run &= ~mode_bits(NEED_POSITION)
    can_arm = 0 if errors else can_run
    checks = [(event, event.pack(modes, part.index, *value)) for event, part, modes, value in found]
    return HealthReport(
        (
            (table.ARMING_SUMMARY, table.ARMING_SUMMARY.pack(0, errors, warnings, can_arm, can_run)),
            *checks,
            (table.HEALTH_SUMMARY, table.HEALTH_SUMMARY.pack(0, _present(vehicle), errors, warnings)),
        )
    )

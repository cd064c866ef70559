"""Messages of our own dialect: reports of an ANAFI that MAVLink has no field for.

The dialect is dialect/anafi.xml. They are streamed to clients that request them. Enums keep Parrot's numbers; 255 is
"not reported".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from anafi_mav import units
from anafi_mav.drone import events
from anafi_mav.drone.controller.controller import Controller
from anafi_mav.drone.controller.state import MAX_AXIS
from anafi_mav.drone.element import Range
from anafi_mav.drone.piloting.state import REDUCERS as PILOTING
from anafi_mav.drone.status.alerts import Alerts
from anafi_mav.drone.status.home import Home
from anafi_mav.drone.video.stream_intrinsics import IntrinsicsSource, shown_intrinsics
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import char_field
from anafi_mav.services.stream import INPUT_FASTEST, MessageStream, Times
from anafi_mav.services.telemetry.telemetry_link import INPUT_EVENTS
from anafi_mav.vehicle.vehicle import Vehicle

NAN = math.nan
UNKNOWN_U8, UNKNOWN_U16, UNKNOWN_I32 = 0xFF, 0xFFFF, 0x7FFFFFFF
NO_AXIS = -128


def _u8(value: int | None) -> int:
    """Return a number of Parrot's, or 255 when it is unknown or does not fit into a byte."""
    return value if value is not None and 0 <= value < UNKNOWN_U8 else UNKNOWN_U8


def _seconds(value: int | None, unknown: int) -> int:
    return unknown if value is None else min(value, unknown - 1)


def _current(setting: Range | None) -> float:
    return NAN if setting is None else setting.current


def _mask(members: Iterable[int]) -> int:
    """Bit n for each n; what later firmware adds beyond 32 bits is left out."""
    return sum(1 << member for member in set(members) if 0 <= member < 32)


def flight_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ANAFI_FLIGHT_STATUS."""
    piloting, alerts = vehicle.drone.piloting.state, vehicle.drone.alerts.state
    hover = dialect.ANAFI_HOVER_WARNING_NOT_REPORTED
    if alerts.too_dark_to_hover is not None:
        hover = (dialect.ANAFI_HOVER_WARNING_TOO_DARK if alerts.too_dark_to_hover else 0) | (
            dialect.ANAFI_HOVER_WARNING_TOO_HIGH if alerts.too_high_to_hover else 0
        )
    return dialect.MAVLink_anafi_flight_status_message(
        times.boot_ms,
        _u8(piloting.flying),
        UNKNOWN_U8 if piloting.steady is None else int(piloting.steady),
        _u8(piloting.plan),
        _u8(alerts.alert),
        _u8(alerts.forced_landing),
        _seconds(alerts.forced_landing_delay_s, UNKNOWN_U8),
        hover,
        _u8(alerts.wind),
        _u8(alerts.vibration),
        _u8(alerts.icing),
        _u8(alerts.motor_error),
        (alerts.motors or 0) & 0xFF,
    )


def home(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ANAFI_HOME."""
    state = vehicle.drone.home.state
    return dialect.MAVLink_anafi_home_message(
        times.boot_ms,
        UNKNOWN_I32 if state.location is None else units.deg_e7(state.location.latitude),
        UNKNOWN_I32 if state.location is None else units.deg_e7(state.location.longitude),
        _current(state.min_altitude),
        _current(state.ending_altitude),
        _seconds(state.delay_s, UNKNOWN_U16),
        _seconds(state.auto_trigger_delay_s, UNKNOWN_U16),
        _u8(state.type),
        _u8(state.preferred_type),
        _u8(state.rth),
        _u8(state.reason),
        _u8(state.auto_trigger),
        _u8(state.reachability),
        _u8(state.ending),
    )


def checklist(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ANAFI_CHECKLIST."""
    state = vehicle.drone.alerts.state
    return dialect.MAVLink_anafi_checklist_message(
        times.boot_ms,
        _mask(state.checklist),
        _mask(check for check, blocks in state.checklist.items() if blocks),
        _mask(state.alarms),
        _mask(alarm for alarm, raised in state.alarms.items() if raised),
    )


def controller_input(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ANAFI_CONTROLLER_INPUT; none without a Skycontroller."""
    controller = vehicle.drone.controller
    if not controller.present:
        return None
    state = controller.state
    grabbed = state.grabbed_axes or 0
    axes = [state.axes.get(axis, NO_AXIS) if grabbed >> axis & 1 else NO_AXIS for axis in range(MAX_AXIS + 1)]
    return dialect.MAVLink_anafi_controller_input_message(
        times.boot_ms,
        state.grabbed_buttons or 0,
        _mask(state.pressed),
        grabbed & 0xFF,
        axes,
        _u8(state.source),
    )


def controller_attitude(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ANAFI_CONTROLLER_ATTITUDE; none without a Skycontroller."""
    attitude = vehicle.drone.controller.state.attitude
    if attitude is None:
        return None
    return dialect.MAVLink_anafi_controller_attitude_message(
        times.boot_ms, [attitude.w, attitude.x, attitude.y, attitude.z]
    )


def controller_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ANAFI_CONTROLLER_STATUS; none without a Skycontroller."""
    controller = vehicle.drone.controller
    if not controller.present:
        return None
    state = controller.state
    place = state.position
    return dialect.MAVLink_anafi_controller_status_message(
        times.boot_ms,
        UNKNOWN_I32 if place is None else units.deg_e7(place.latitude),
        UNKNOWN_I32 if place is None else units.deg_e7(place.longitude),
        UNKNOWN_I32 if place is None else units.millimetres(place.altitude),
        controller.model or 0,
        -1 if state.battery_percent is None else state.battery_percent,
        _u8(state.battery),
        _u8(state.magnetometer),
        _u8(state.source),
        char_field(state.serial, 20),
        char_field(state.firmware, 16),
    )


_SOURCES = {
    IntrinsicsSource.MODEL: dialect.ANAFI_INTRINSICS_SOURCE_MODEL,
    IntrinsicsSource.STREAM: dialect.ANAFI_INTRINSICS_SOURCE_STREAM,
    IntrinsicsSource.FOV: dialect.ANAFI_INTRINSICS_SOURCE_FOV,
}


def camera_intrinsics(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ANAFI_CAMERA_INTRINSICS of the shown stream; None where nothing is known of it."""
    drone = vehicle.drone
    shown = drone.video.state.shown if drone.video.state.playing else None
    found = shown_intrinsics(shown, drone.streams.shown, drone.identity.model.lens)
    if found is None:
        return None
    lens = found.lens
    return dialect.MAVLink_anafi_camera_intrinsics_message(
        lens.fx,
        lens.fy,
        lens.cx,
        lens.cy,
        lens.k1,
        lens.k2,
        lens.k3,
        lens.p1,
        lens.p2,
        lens.width,
        lens.height,
        _u8(found.camera),
        _SOURCES[found.source],
    )


def _state(build: Callable[[Vehicle, Times], dialect.MAVLink_message | None], *tables: Iterable[type]) -> MessageStream:
    """Return the stream of a state message that any event of these tables updates."""
    return MessageStream(build, tuple(dict.fromkeys(event for table in tables for event in table)), repeated=True)


_MOTION = (
    events.AttitudeChanged,
    events.SpeedChanged,
    events.AltitudeChanged,
    events.AltitudeAboveGroundChanged,
)
"""Reported all the time; nothing of it is in ANAFI_FLIGHT_STATUS."""

_INPUT = (*INPUT_EVENTS, events.PilotingSource)

STREAMS: Mapping[int, MessageStream] = {
    dialect.MAVLINK_MSG_ID_ANAFI_FLIGHT_STATUS: _state(
        flight_status, [event for event in PILOTING if event not in _MOTION], Alerts.REDUCERS
    ),
    dialect.MAVLINK_MSG_ID_ANAFI_HOME: _state(home, Home.REDUCERS),
    dialect.MAVLINK_MSG_ID_ANAFI_CHECKLIST: _state(checklist, Alerts.REDUCERS),
    dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_INPUT: replace(_state(controller_input, _INPUT), fastest=INPUT_FASTEST),
    dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_ATTITUDE: MessageStream(
        controller_attitude, (events.ControllerAttitudeChanged,)
    ),
    dialect.MAVLINK_MSG_ID_ANAFI_CONTROLLER_STATUS: _state(
        controller_status,
        [e for e in Controller.REDUCERS if e not in (events.ControllerAttitudeChanged, *_INPUT)],
    ),
    dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_INTRINSICS: MessageStream(camera_intrinsics),
}

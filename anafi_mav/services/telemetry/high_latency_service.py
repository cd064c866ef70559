"""HIGH_LATENCY2 for links on which every byte costs (high_latency.md; conformance C14).

MAV_CMD_CONTROL_HIGH_LATENCY applies to the channel that it is received on. Until the same command ends it or the
channel closes, no heartbeat, stream or text is sent there, but HIGH_LATENCY2 every five seconds, and answers to
commands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav import units
from anafi_mav.clock import NEVER
from anafi_mav.drone import events
from anafi_mav.drone.values import Values
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Command
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.pose import reported_pose
from anafi_mav.services.service import Host, Query, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.services.telemetry.telemetry_flight import target
from anafi_mav.services.telemetry.telemetry_status import percent, sensor_bits
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.subscriptions import ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.vehicle import Vehicle

EVERY = 5.0
"""s between two HIGH_LATENCY2 (high_latency.md)."""

UNKNOWN_U8, UNKNOWN_U16 = 0xFF, 0xFFFF

_FAILURES: Mapping[int, int] = {
    dialect.MAV_SYS_STATUS_SENSOR_GPS: dialect.HL_FAILURE_FLAG_GPS,
    dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE: dialect.HL_FAILURE_FLAG_ABSOLUTE_PRESSURE,
    dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL: dialect.HL_FAILURE_FLAG_3D_ACCEL,
    dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO: dialect.HL_FAILURE_FLAG_3D_GYRO,
    dialect.MAV_SYS_STATUS_SENSOR_3D_MAG: dialect.HL_FAILURE_FLAG_3D_MAG,
    dialect.MAV_SYS_STATUS_SENSOR_BATTERY: dialect.HL_FAILURE_FLAG_BATTERY,
    dialect.MAV_SYS_STATUS_SENSOR_RC_RECEIVER: dialect.HL_FAILURE_FLAG_RC_RECEIVER,
    dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS: dialect.HL_FAILURE_FLAG_ENGINE,
    dialect.MAV_SYS_STATUS_GEOFENCE: dialect.HL_FAILURE_FLAG_GEOFENCE,
}


def failures(vehicle: Vehicle) -> int:
    """Return the HL_FAILURE_FLAG bits of what is enabled and not healthy, and of a missing fix."""
    _, enabled, healthy = sensor_bits(vehicle)
    if vehicle.place is None:  # also of a drone that does not list its sensors
        enabled |= dialect.MAV_SYS_STATUS_SENSOR_GPS
    return sum(flag for bit, flag in _FAILURES.items() if enabled & bit and not healthy & bit)


def _half_degrees(radians: float) -> int:
    return round(units.wrap_360(radians * units.DEG_PER_RAD) / 2.0) % 180


def _mode(vehicle: Vehicle, flavour: Flavour) -> int:
    """Return the 16 bits of custom_mode: of a packed number the upper half (px4_custom_mode.h)."""
    number = flavour.custom_mode(vehicle.mode)
    return number >> 16 if flavour.packed_modes else number


def _base_mode(vehicle: Vehicle) -> int:
    """HEARTBEAT.base_mode as a signed byte."""
    base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if vehicle.armed:
        base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED
    return int(base - 256 if base > 127 else base)


def high_latency(
    vehicle: Vehicle, times: Times, climb: float, last_place: GeoPoint | None = None
) -> dialect.MAVLink_message | None:
    """Return HIGH_LATENCY2; None while attitude or speed is unknown.

    Without the message a client sees no vehicle, or goes on showing an old mode and an old battery. So `last_place`
    stands for a position that is lost, and latitude, longitude and altitude are 0 before the first fix, as PX4 and
    ArduPilot send them. HL_FAILURE_FLAG_GPS and unknown accuracies report both.
    `climb` is the fastest climb or descent since the last message (m/s). Without a target the drone's own position is
    sent as the target. Throttle, airspeed and wind are not reported and have no "unknown": 0.
    """
    pose, gps = reported_pose(vehicle), vehicle.drone.gps.state
    if pose.attitude is None or pose.velocity is None:
        return None
    place, height = pose.place or last_place or GeoPoint(0.0, 0.0), pose.amsl(vehicle) or 0.0
    horizontal = [a for a in (gps.latitude_accuracy, gps.longitude_accuracy) if a is not None and pose.place]
    vertical = gps.altitude_accuracy if pose.place else None
    heading = _half_degrees(pose.attitude.yaw)
    goal = target(vehicle)
    goal_height = None if goal is None else vehicle.height.amsl(goal.altitude)
    return dialect.MAVLink_high_latency2_message(
        timestamp=times.boot_ms,
        type=dialect.MAV_TYPE_QUADROTOR,
        autopilot=times.flavour.autopilot,
        custom_mode=_mode(vehicle, times.flavour),
        latitude=units.deg_e7(place.latitude),
        longitude=units.deg_e7(place.longitude),
        altitude=units.saturate(height, 16),
        target_altitude=units.saturate(height if goal_height is None else goal_height, 16),
        heading=heading,
        target_heading=heading if goal is None else _half_degrees(math.radians(goal.bearing)),
        target_distance=0 if goal is None else units.saturate(goal.distance / 10.0, 16, signed=False),
        throttle=0,
        airspeed=0,
        airspeed_sp=0,
        groundspeed=units.saturate(math.hypot(pose.velocity.north, pose.velocity.east) * 5.0, 8, signed=False),
        windspeed=0,
        wind_heading=0,
        eph=UNKNOWN_U8 if not horizontal else min(max(horizontal) * 10, UNKNOWN_U8 - 1),
        epv=UNKNOWN_U8 if vertical is None else min(vertical * 10, UNKNOWN_U8 - 1),
        temperature_air=0,
        climb_rate=units.saturate(climb * 10.0, 8),
        battery=percent(vehicle.drone.battery.state.percent),
        wp_num=_item(vehicle, times.flavour),
        failure_flags=failures(vehicle),
        custom0=_base_mode(vehicle) if times.flavour.base_mode_in_custom0 else 0,
        custom1=0,
        custom2=0,
    )


def _item(vehicle: Vehicle, flavour: Flavour) -> int:
    """Return the number of the current item as this flavour counts; unknown without a mission."""
    if not vehicle.mission.there:
        return UNKNOWN_U16
    machine = vehicle.mission.machine
    if flavour.zero_home:
        return 0 if machine.is_untouched else machine.progress.current + 1
    return machine.progress.current


class HighLatencyService(Service):
    """Keeps the channels in high-latency mode, and sends HIGH_LATENCY2 on them."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._next: dict[Channel, float] = {}
        """When the next HIGH_LATENCY2 is due, for each channel in high-latency mode."""
        self._interest = ValueInterest((events.SpeedChanged,), is_on=False)
        """On while a channel is in high-latency mode."""
        self._climbs: dict[Channel, float] = {}
        """Fastest climb or descent since the last message on each of these channels, m/s."""
        self._last_place: GeoPoint | None = None
        """The drone's newest known position; None before the first one."""

    def queries(self) -> Mapping[int, Query]:
        return {dialect.MAV_CMD_CONTROL_HIGH_LATENCY: self._control}

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_HIGH_LATENCY2: MessageStream(self._build, flavoured=True)}

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_speed: self._interest}

    def _on_speed(self, values: Values, now: float) -> None:
        if math.isfinite(climb := values.message(events.SpeedChanged).speedZ):
            self._climbs = {channel: max(self._climbs.get(channel, 0.0), abs(climb)) for channel in self._next}

    def link_down(self) -> None:
        self._last_place = None

    def tick(self, now: float) -> float:
        self._last_place = self.host.vehicle.place or self._last_place
        due = [channel for channel, at in self._next.items() if now >= at]
        for channel in due:
            self._next[channel] = now + EVERY
            times = self.host.times().for_flavour(flavour_of(channel))
            message = self._message(self.host.vehicle, times, self._climbs.pop(channel, 0.0))
            if message is not None:
                self.host.send(message, channel)
        return min(self._next.values(), default=NEVER)

    def channel_closed(self, channel: Channel) -> None:
        self._next.pop(channel, None)
        self._climbs.pop(channel, None)
        self._interest.switch(bool(self._next))

    def _build(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
        """Return it for a channel that is in no high-latency mode: with the present climb."""
        return self._message(vehicle, times, 0.0)

    def _message(self, vehicle: Vehicle, times: Times, climb: float) -> dialect.MAVLink_message | None:
        velocity = vehicle.drone.piloting.state.velocity
        climb = climb if velocity is None else max(climb, abs(velocity.down))
        return high_latency(vehicle, times, climb, self._last_place or vehicle.origin)

    def _control(self, inbound: Inbound, command: Command) -> int:
        wanted = command.params[0]
        if wanted not in (0.0, 1.0):
            return dialect.MAV_RESULT_DENIED
        self.host.set_muted(inbound.channel, muted=wanted == 1.0)
        if wanted == 0.0:
            self._next.pop(inbound.channel, None)
        else:
            self._next.setdefault(inbound.channel, self.host.clock.monotonic())
        self._interest.switch(bool(self._next))
        return dialect.MAV_RESULT_ACCEPTED

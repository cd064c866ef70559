"""Simulated autopilot: state machine, time and automatic behaviour.

`Firmware` adds the handling of commands. No I/O and no clock. There are two times: `now` is the host's clock, used by
the link and its watchdogs; `time` is the simulated one, which runs `--speed` times as fast and is used for everything
about the aircraft.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType, Type
from anafi_mav.arsdk.messages.ardrone3 import AlertState, FlyingState
from anafi_mav.arsdk.messages.rth import RthEndingBehavior, StateReason
from anafi_mav.sim.autopilot import power
from anafi_mav.sim.autopilot.animation import Animations
from anafi_mav.sim.autopilot.animation_paths import Target
from anafi_mav.sim.autopilot.compass import Compass
from anafi_mav.sim.autopilot.endurance import Endurance
from anafi_mav.sim.autopilot.flight_plan import FlightPlan
from anafi_mav.sim.autopilot.follow_me import FollowMe
from anafi_mav.sim.autopilot.guidance import Guidance
from anafi_mav.sim.autopilot.homing import UNKNOWN, Homing
from anafi_mav.sim.autopilot.machine import AIRBORNE, GUIDED, LANDED, Event, next_state
from anafi_mav.sim.autopilot.poi import Poi
from anafi_mav.sim.autopilot.power import Battery
from anafi_mav.sim.autopilot.safety import Alarms, Warnings, check_changed, checklist
from anafi_mav.sim.features.settings import DroneSettings
from anafi_mav.sim.payload.camera_operator import CameraOperator
from anafi_mav.sim.payload.flight_log_store import FlightLogStore
from anafi_mav.sim.payload.gimbal import Gimbals
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.payload import Payload
from anafi_mav.sim.plan.plan_store import FlightPlanStore
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.faults import Faults
from anafi_mav.sim.world.model import AircraftModel
from anafi_mav.sim.world.motion import Pose
from anafi_mav.sim.world.place import WorldOrigin
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.sim.world.wind import WindWatch

RAMP_TIME = 1.0
"""s that the motors need; one or two on the aircraft."""
SETTLE_TIME = 1.0
"""s from the fall's end to landed. Assumed."""
SENSOR_PERIOD = 0.05
"""s between two looks at battery, GPS and what else does not fly."""
STRAY = 1.0
"""m/s from which a hovering drone counts as flying although it gets no stick input."""
SATELLITES = 14

_REST = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Identity:
    serial: str
    name: str
    boot_id: str
    run_id: str


class Autopilot:
    """One drone's autopilot."""

    def __init__(
        self,
        model: AircraftModel,
        identity: Identity,
        body: Airframe,
        origin: WorldOrigin,
        emit: Callable[[Message], None],
        note: Callable[[str, dict[str, Any]], None],
        faults: Faults,
        chance: random.Random,
    ) -> None:
        self.model = model
        self.identity = identity
        self.faults = faults
        self.settings = DroneSettings(model, identity.name)
        self.battery = Battery(model)
        self.payload = Payload(model, identity.name, identity.run_id, emit, self._scene)
        self.flight_logs = FlightLogStore()
        self.plans = FlightPlanStore()
        self.plans.refuses = lambda: (
            Quirk.UPLOAD_REFUSED_WHILE_PAUSED in faults.quirks and self.flight_plan.state is common.PlayingState.PAUSED
        )
        self.pose = _REST
        self.time = 0.0
        self._body = body
        self._origin = origin
        self._emit = emit
        self._note = note
        self._chance = chance
        self._flights, self._last_flight, self._flown = 0, 0.0, 0.0
        self._wake()

    def _wake(self) -> None:
        """All that a drone has forgotten when it is switched on."""
        model, body, origin, emit, note = self.model, self._body, self._origin, self._emit, self._note
        self.compass = Compass()
        self.gimbal = Gimbals(model)
        self.operator = CameraOperator(self.gimbal, self.payload, lambda: (self.time, self.pose), emit, note)
        self.alarms = Alarms()
        self.warnings = Warnings()
        self.endurance = Endurance(model, self.settings)
        self.homing = Homing(body, origin, self.settings, emit, self.faults)
        self.guidance = Guidance(model, body, origin, self.settings, self.homing, emit, self.faults)
        self.flight_plan = FlightPlan(model, body, origin, self.settings, self, self.operator, emit, note, self.faults)
        self.poi = Poi(origin, emit, self.operator.aim, lambda: self.settings.yaw_rate, model.modern)
        self.follow = FollowMe(body, origin, self.settings, emit, self.operator.aim, model.airframe.max_speed)
        self.animations = Animations(model, body, self.operator, emit)
        self.state = LANDED
        self.fix = self.faults.gps
        self.flight_id = ""
        self.datetime = "19700101T000000+0000"
        self.sound = ardrone3.AlertSoundState.STOPPED
        self._wind = WindWatch(model.envelope.wind_resistance)
        self._alert = AlertState.NONE
        self._blockers: frozenset[TakeoffChecklistType] = frozenset()
        self._ready: tuple[object, ...] = ()
        self._by_hand = False
        self._timer = 0.0
        """End of the motors' ramp, or of the pause after an emergency."""
        self._grounded = False
        self._late_take_off: float | None = None
        """When a TakeOff is executed that this firmware executes late."""
        self._return_at: float | None = None
        self._alone = False
        """True when no controller is connected and a flight plan plays on."""
        self._took_off_at: float | None = None
        self._unseen = SENSOR_PERIOD
        """Simulated seconds since the sensors were last looked at."""
        self.guidance.apply_limits()

    def reboot(self, identity: Identity, *, factory: bool = False) -> None:
        """Switched off and on again, on the ground.

        What is on the card and in the settings stays, unless `factory`.
        """
        self.identity = identity
        self.payload.reboot(identity.run_id, self.time, wipe=factory)
        if factory:
            self.settings.reset()
            self.plans.clear()
            self.flight_logs.clear()
        self._body.off()
        self._wake()

    # -- what others ask

    @property
    def satellites(self) -> int:
        return SATELLITES if self.fix else 0

    @property
    def alert(self) -> AlertState:
        if self.state is FlyingState.EMERGENCY:
            return AlertState.USER
        return self.battery.alert if self.warnings.motors == 0 else AlertState.CUT_OUT

    def sensor_ok(self, sensor: common.Sensor) -> bool:
        if sensor is common.Sensor.GPS:
            return self.fix
        return sensor is not common.Sensor.MAGNETOMETER or not self.compass.required

    def blockers(self) -> frozenset[TakeoffChecklistType]:
        """Return the reasons for which a take-off would be refused."""
        found = self.faults.refuse_take_off
        if self.warnings.motors:
            found = found | {TakeoffChecklistType.MOTOR_DOWN}
        if self.compass.required:
            found = found | {TakeoffChecklistType.MAGNETO_CALIBRATION}
        if self.battery.percent <= power.CRITICAL:
            found = found | {TakeoffChecklistType.BATTERY_CRITICAL}
        return found

    def flights_report(self) -> Message:
        return ardrone3.MotorFlightsStatusChanged(self._flights, round(self._last_flight), round(self._flown))

    def place(self) -> tuple[float, float]:
        """True latitude and longitude."""
        return self._origin.place(self.pose.north, self.pose.east)

    @property
    def altitude(self) -> float:
        """True height in m above mean sea level."""
        return self._origin.altitude + self.pose.up

    def _scene(self) -> Scene:
        """Return the scene that the first gimbal's camera sees."""
        self.gimbal.advance(self.time)
        looks = self.gimbal.attitude(self.pose)
        place = (*self.place(), self.altitude) if self.fix else (UNKNOWN, UNKNOWN, UNKNOWN)
        return Scene(
            *place, looks.pitch_absolute, looks.roll_absolute, self.pose.north, self.pose.east, looks.yaw_absolute
        )

    def position_report(self) -> list[Message]:
        """Report the GPS position: deg, deg, m above mean sea level."""
        if not self.fix:
            return [
                ardrone3.PositionChanged(UNKNOWN, UNKNOWN, UNKNOWN),
                ardrone3.GpsLocationChanged(UNKNOWN, UNKNOWN, UNKNOWN, -1, -1, -1),
            ]
        latitude, longitude = self.place()
        return [
            ardrone3.PositionChanged(latitude, longitude, self.altitude),
            ardrone3.GpsLocationChanged(latitude, longitude, self.altitude, 1, 1, 2),
        ]

    def motion_report(self) -> list[Message]:
        pose = self.pose
        roll = -pose.roll if Quirk.ROLL_INVERTED in self.faults.quirks else pose.roll
        return [
            ardrone3.AttitudeChanged(roll, pose.pitch, pose.yaw),
            ardrone3.SpeedChanged(pose.vn, pose.ve, pose.vd),
            ardrone3.AltitudeChanged(pose.up),
        ]

    # -- the link

    def link_lost(self) -> None:
        """Handle the loss of the controller: hover, then return home after a delay if home is known.

        A flight plan that continues without a controller plays to its end first.
        """
        if self.flight_plan.survives_disconnection:
            self._alone = True
            return
        self.flight_plan.stop(hover=True)
        self.guidance.release_sticks()
        self._free()
        if self.state in GUIDED | {FlyingState.TAKINGOFF} and not self.homing.flying:
            self.guidance.cancel(self.pose)
            self._return_at = self.time + self.settings.number("rth_delay")

    def link_up(self) -> None:
        """Handle the connection of a controller. A return that has begun continues."""
        self._return_at = None
        self._alone = False

    # -- time

    def tick(self, now: float, elapsed: float, pose: Pose, arrived: bool, still: bool) -> None:
        """Advance by `elapsed` simulated seconds, after which the drone is at `pose`.

        `arrived`: the body has reached its target; `still`: it does not move.
        """
        self.pose = pose
        self.time += elapsed
        self.guidance.watch_sticks(now)
        self._unseen += elapsed
        before = self.state
        if self._late_take_off is not None and self.time >= self._late_take_off:
            self._late_take_off = None
            self._execute_take_off()
        if self._unseen >= SENSOR_PERIOD:
            self._update_sensors(self._unseen)
            self._unseen = 0.0
        if self.state is LANDED or self.state is not before:
            return  # `arrived` is about the target of before
        if self.state in GUIDED:
            self._fly(arrived, still)
        elif self.state is FlyingState.MOTOR_RAMPING:
            if self.time >= self._timer:
                self._fire(Event.IDLING if self._by_hand else Event.RAMPED_UP)
        elif self.state is FlyingState.TAKINGOFF:
            if arrived:
                self._body.hover()
                self._fire(Event.AIRBORNE)
        elif self.state in (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING):
            if arrived:
                self._fire(Event.TOUCHDOWN)
        elif self.state is FlyingState.EMERGENCY:
            if arrived and not self._grounded:
                self._grounded, self._timer = True, self.time + SETTLE_TIME
            elif self._grounded and self.time >= self._timer:
                self._fire(Event.SETTLED)
        if self.state in AIRBORNE:
            self._watch_limits()

    def _fly(self, arrived: bool, still: bool) -> None:
        hovering = self.state is FlyingState.HOVERING
        ending = None
        if self.flight_plan.playing:
            self.flight_plan.tick(self.time, self.pose, arrived)
            if self.state not in GUIDED:
                return
        elif self.animations.running:
            self.animations.tick(self.time, self.pose, arrived, still)
        else:
            ending = self.guidance.tick(self.time, self.pose, arrived, hovering)
            if self._alone:
                self.link_lost()
                self._alone = False
        if ending is RthEndingBehavior.LANDING:
            self._fire(Event.LAND)
            return
        if self._return_at is not None and self.time >= self._return_at:
            self._return_at = None
            self._go_home(StateReason.CONNECTION_LOST)
        if not self.animations.running:
            rate = self.poi.tick(self.time, self.pose, hovering)
            self.guidance.stare(self.follow.tick(self.time, self.pose) if rate is None else rate)
        # A drone that hovers stays HOVERING while a gust shakes it, but not while it is carried off.
        moving = math.hypot(self.pose.ground_speed, self.pose.vd) > STRAY if hovering else not still
        busy = self.guidance.busy or self.flight_plan.playing or self.animations.running or self.follow.flies
        if (self.state is FlyingState.HOVERING) == (busy or moving):  # else the event does not count
            self._fire(Event.BUSY if busy or moving else Event.AT_REST)

    def _update_sensors(self, elapsed: float) -> None:
        for message in self.battery.drain(elapsed, self.state in AIRBORNE, self.faults.battery):
            self._emit(message)
        for message in self.compass.require(self.faults.magneto_required):
            self._emit(message)
        self.payload.storage.place.full = self.faults.storage_full
        payload = self.payload.tick(self.time, self.state in AIRBORNE)
        self.faults.storage_full = self.payload.storage.place.full
        for messages in (self.compass.tick(self.time), self.gimbal.tick(self.time), payload):
            for message in messages:
                self._emit(message)
        self.faults.magneto_required = self.compass.required
        self._look_after_aircraft(elapsed)
        if self.fix != self.faults.gps:
            self._set_fix(self.faults.gps)
        self.homing.sensors(self.fix, not self.compass.required)
        self._tell_readiness()
        self._look_at_targets()
        for message in self.payload.lacks(self.fix, not self.compass.required, self.state in GUIDED):
            self._emit(message)
        if self.alert is not self._alert:
            self._alert = self.alert
            self._emit(ardrone3.AlertStateChanged(self._alert))
        blockers = self.blockers()
        if blockers != self._blockers:
            for check in sorted(blockers ^ self._blockers):
                self._emit(check_changed(check, check in blockers))
            self._blockers = blockers
        self._mind_the_battery()

    def _tell_readiness(self) -> None:
        """Update the conditions for starting a flight plan or a point of interest."""
        rising = (FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF)
        can_fly = self.state in GUIDED or self.state in rising or (self.state is LANDED and not self.blockers())
        fix, calibrated, guided = self.fix, not self.compass.required, self.state in GUIDED
        ready = (fix, calibrated, can_fly, guided, self.faults.refuse_plan)
        if ready == self._ready:
            return
        self._ready = ready
        self.flight_plan.sensors(fix, calibrated, can_fly)
        self.poi.sensors(fix, calibrated, guided)

    def _look_at_targets(self) -> None:
        """Update the conditions that follow me and animations need."""
        calibrated, guided = not self.compass.required, self.state in GUIDED
        self.follow.sensors(self.fix, calibrated, guided, self.pose, self.time)
        free = not self.flight_plan.playing and not self.homing.flying
        self.animations.sensors(self.fix, calibrated, guided, free, self.target is not None)

    def _look_after_aircraft(self, elapsed: float) -> None:
        """Update the warnings: motors, vibration, wind, and being carried."""
        warnings, faults = self.warnings, self.faults
        place = (self.pose.north, self.pose.east)
        messages = warnings.set_motors(faults.motor_error, faults.motors)
        messages += warnings.set_vibration(faults.vibration)
        wind = self._body.wind if self.state in AIRBORNE else 0.0
        messages += warnings.set_wind(self._wind.feel(wind, elapsed))
        messages += warnings.carried(place, self.time, self.state is LANDED)
        for message in messages:
            self._emit(message)
        self._sound_alarm(Type.MOTOR_CUTOUT, warnings.motors != 0)
        if warnings.motors and self.state in AIRBORNE:
            self._fire(Event.FORCED_LANDING)

    def _mind_the_battery(self) -> None:
        """Announce and begin what a battery that runs out makes the drone do."""
        endurance, forced = self.endurance, self.state is FlyingState.EMERGENCY_LANDING
        flying = self.state in AIRBORNE and not forced
        home = self.homing.home_offset if endurance.looks(self.time) else None
        for message in endurance.tick(
            self.time, self.battery.charge, self.pose, home, flying=flying, returning=self.homing.active
        ):
            self._emit(message)
        if endurance.landing_due and self._fire(Event.FORCED_LANDING):
            for message in endurance.forced():
                self._emit(message)
        elif endurance.return_due and self.state in GUIDED:
            for message in endurance.returned():
                self._emit(message)
            self._go_home(StateReason.LOW_BATTERY)

    def _set_fix(self, fix: bool) -> None:
        self.fix = fix
        self._emit(ardrone3.GPSFixStateChanged(int(fix)))
        self._emit(ardrone3.NumberOfSatelliteChanged(self.satellites))
        self._emit(common.SensorsStatesListChanged(common.Sensor.GPS, int(fix)))
        if not fix:
            self.guidance.gps_lost(self.pose)
        if fix and self.state in AIRBORNE and self.homing.takeoff is None:
            self.homing.took_off(self.pose, fix, in_flight=True)

    def _watch_limits(self) -> None:
        at_fence = self.guidance.fence_margin(self.pose.north, self.pose.east) < 1.0
        self._sound_alarm(Type.HORIZONTAL_GEOFENCE_REACHED, at_fence)
        self._sound_alarm(Type.VERTICAL_GEOFENCE_REACHED, self.pose.up > self.settings.number("max_altitude") - 0.5)

    def _sound_alarm(self, type: Type, on: bool) -> None:
        for message in self.alarms.set(type, on):
            self._emit(message)

    # -- the state machine

    def _fire(self, event: Event) -> bool:
        """Let something happen; False when it does not count in the present state."""
        state = next_state(self.state, event)
        if state is None:
            return False
        before, self.state = self.state, state
        self._note("flying", {"from": before.name.lower(), "to": state.name.lower(), "event": event.name.lower()})
        match event:
            case Event.TAKE_OFF | Event.USER_TAKE_OFF:
                self._by_hand, self._timer = event is Event.USER_TAKE_OFF, self.time + RAMP_TIME
            case Event.LAND | Event.FORCED_LANDING:
                self._stop_guidance()
                self._body.land()
            case Event.EMERGENCY:
                self._stop_guidance()
                self._grounded = False
                if before in AIRBORNE:
                    self._body.fall()
                self._sound_alarm(Type.USER_EMERGENCY, True)
            case Event.CLIMB | Event.ABORT_LANDING:
                self._body.hover()
            case Event.RAMPED_UP | Event.THROWN:
                self._body.take_off()
            case _:
                pass
        self._emit(ardrone3.FlyingStateChanged(state))
        if state is FlyingState.TAKINGOFF:
            self._begin_flight()
        elif state is LANDED:
            self._end_flight()
            for message in self.endurance.landed():
                self._emit(message)
        self._tell_readiness()
        return True

    def _begin_flight(self) -> None:
        self._took_off_at = self.time
        self.guidance.take_off_place = (self.pose.north, self.pose.east)
        self.guidance.apply_limits()
        self.flight_id = f"{self._chance.getrandbits(128):032X}"
        self._emit(common.FlightId(self.flight_id))
        self.homing.took_off(self.pose, self.fix)
        self.endurance.took_off()

    def _end_flight(self) -> None:
        self._body.off()
        self.guidance.release_sticks()
        self.guidance.forget_flag()
        self._return_at = None
        for type in (Type.HORIZONTAL_GEOFENCE_REACHED, Type.VERTICAL_GEOFENCE_REACHED, Type.USER_EMERGENCY):
            self._sound_alarm(type, False)
        if self._took_off_at is None:
            return
        self._flights += 1
        self._last_flight = self.time - self._took_off_at
        self._flown += self._last_flight
        self.flight_logs.add(self.payload.calendar.date(self.time), self._last_flight)
        self._took_off_at = None
        self.flight_id = ""
        self._emit(common.FlightId(""))
        self._emit(self.flights_report())

    def _stop_guidance(self) -> None:
        """End a move and a return, and say so."""
        self.flight_plan.stop(hover=False)
        self.guidance.cancel(self.pose)
        self._free()
        self.homing.abort()

    def _go_home(self, reason: StateReason) -> None:
        if self.state not in GUIDED:
            return
        hovering = self.state is FlyingState.HOVERING
        waits = reason is StateReason.USER_REQUEST and Quirk.RETURN_WAITS_FOR_MOVES in self.faults.quirks
        if self.homing.home is not None and not self.homing.flying and not waits:
            self.flight_plan.stop(hover=True)
            self.guidance.cancel(self.pose)
            self._free()
        self.homing.request(reason, self.pose, hovering)

    def _free(self) -> None:
        """Stop animations, follow me and points of interest, because another flight task starts."""
        if self.animations.running:
            self.animations.end()
            self._body.hover()
        self.follow.stop()
        self.poi.stop()
        self.guidance.stare(None)

    @property
    def target(self) -> Target | None:
        """Return the target of an animation: the point of interest or the follow-me target.

        Follow me has a target even before it is started.
        """
        point = self.poi.point if self.poi.running else self.follow.target(self.time)
        return None if point is None else Target(*point)

    # -- what a flight plan needs

    @property
    def airborne(self) -> bool:
        """True in the air, when the drone accepts guided commands."""
        return self.state in GUIDED

    def _execute_take_off(self) -> None:
        """Take off from the ground, or end a landing."""
        if self.state is FlyingState.LANDING and Quirk.LANDING_IGNORES_TAKEOFF not in self.faults.quirks:
            self._fire(Event.ABORT_LANDING)
        elif self.state is LANDED and self.blockers():
            for event in checklist(self.blockers()):
                self._emit(event)
        elif self.state is LANDED:
            self._fire(Event.TAKE_OFF)

    def fence_margin(self, north: float, east: float) -> float:
        """m between a place and the fence of this flight, or of the one that begins here."""
        here = None if self.state in AIRBORNE else (self.pose.north, self.pose.east)
        return self.guidance.fence_margin(north, east, here)

    def plan_take_off(self) -> None:
        self._fire(Event.TAKE_OFF)

    def plan_land(self) -> None:
        self._fire(Event.LAND)

    def plan_return(self) -> None:
        self._body.hover()
        self._go_home(StateReason.FLIGHTPLAN)

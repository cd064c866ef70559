"""The simulated firmware: commands in, events out, with a `Airframe` that flies.

No I/O and no clock: `receive` takes a command and the time of its arrival, `tick` (see `flight`) lets time pass, events
leave through `emit`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.messages import animation, ardrone3, common, flight_plan, follow_me, gimbal, move, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.rth import StateReason
from anafi_mav.sim.autopilot.animation_paths import STARTS as ANIMATIONS
from anafi_mav.sim.autopilot.flight import Autopilot
from anafi_mav.sim.autopilot.flight import Identity as Identity
from anafi_mav.sim.autopilot.follow_me import COMMANDS as FOLLOW_ME
from anafi_mav.sim.autopilot.machine import AIRBORNE, GUIDED, LANDED, Event
from anafi_mav.sim.features import wireless
from anafi_mav.sim.world.quirks import Quirk

LATE_TAKE_OFF = 1.0
"""s by which a firmware with the quirk `takeoff-from-ground-late` executes a TakeOff late."""


class Firmware(Autopilot):
    """One drone's brain."""

    # -- commands

    def receive(self, message: Message | UnknownMessage, now: float) -> bool:
        """Take a command; False when this firmware has no idea of it, which it keeps to itself."""
        if isinstance(message, UnknownMessage):
            return False
        if isinstance(message, ardrone3.PCMD):
            self._pilot(message, now)
            return True
        handler = _HANDLERS.get(type(message))
        if handler is not None:
            handler(self, message)
            return True
        if isinstance(message, gimbal.SetTarget) and self.poi.holds_gimbal and message.gimbal_id == 0:
            return True
        answer = self.settings.handle(message)
        if answer is not None:
            self.guidance.apply_limits()
        for part in (self.compass, self.payload):
            answer = part.handle(message, self.time) if answer is None else answer
        if answer is None:
            answer = wireless.classic(message)
        if answer is None:
            answer = self.gimbal.handle(message, self.pose, self.time, self.state in AIRBORNE)
        if answer is None:
            return False
        for event in answer:
            self._emit(event)
        if isinstance(message, rth.SetPreferredHomeType | ardrone3.HomeType):
            self.homing.preference_changed()
        return True

    def _pilot(self, sticks: ardrone3.PCMD, now: float) -> None:
        deaf = self.flight_plan.playing or self.animations.running or self.follow.flies
        if self.state not in AIRBORNE or self.state is FlyingState.TAKINGOFF or deaf:
            return
        ignores_gaz = Quirk.LANDING_IGNORES_GAZ in self.faults.quirks
        if sticks.gaz > 0 and self.state is FlyingState.LANDING and not ignores_gaz:
            self._fire(Event.CLIMB)
        self.guidance.pilot(sticks, now)

    def throw(self) -> None:
        """Throw the drone, as after UserTakeOff."""
        self._fire(Event.THROWN)

    def _take_off(self, message: Message) -> None:
        if Quirk.TAKEOFF_FROM_GROUND_LATE in self.faults.quirks:
            self._late_take_off = self.time + LATE_TAKE_OFF
        else:
            self._execute_take_off()

    def _user_take_off(self, message: ardrone3.UserTakeOff) -> None:
        if not message.state:
            if not self._ramps_on:
                self._fire(Event.USER_TAKE_OFF_CANCEL)
        elif self.state is LANDED and self.blockers():
            self._execute_take_off()
        else:
            self._fire(Event.USER_TAKE_OFF)

    def _smart(self, message: Message) -> None:
        takes_off = self.state is LANDED or (self.state is FlyingState.LANDING and self.model.modern)
        if takes_off:
            self._take_off(message)
        else:
            self._land(message)

    def _land(self, message: Message) -> None:
        if not self._ramps_on:
            self._fire(Event.LAND)

    @property
    def _ramps_on(self) -> bool:
        """True when nothing but an Emergency stops the motors that ramp up."""
        return self.state is FlyingState.MOTOR_RAMPING and Quirk.RAMPING_IGNORES_LANDING in self.faults.quirks

    def _emergency(self, message: Message) -> None:
        self._fire(Event.EMERGENCY)

    def _navigate_home(self, message: ardrone3.NavigateHome) -> None:
        if message.start:
            self._return_home(message)
        else:
            self._abort(message)

    def _return_home(self, message: Message) -> None:
        self._go_home(StateReason.USER_REQUEST)

    def _abort(self, message: Message) -> None:
        if self.homing.active and self.homing.reason is StateReason.LOW_BATTERY:
            self.endurance.aborted()
        self.homing.abort()

    def _custom_location(self, message: rth.SetCustomLocation) -> None:
        self.homing.set_custom(message.latitude, message.longitude, message.altitude, self.pose)

    def _controller_gps(self, message: ardrone3.SendControllerGPS) -> None:
        self.homing.set_pilot(message.latitude, message.longitude, message.altitude)
        self.guidance.apply_limits()

    def _cancel_auto_trigger(self, message: Message) -> None:
        for event in self.endurance.cancel():
            self._emit(event)

    def _move_by(self, message: ardrone3.MoveBy | move.ExtendedMoveBy) -> None:
        self._make_way()
        self.guidance.move_by(message, self.pose, self.state in GUIDED)

    def _move_to(self, message: ardrone3.MoveTo | move.ExtendedMoveTo) -> None:
        self._make_way()
        ready = self.state in GUIDED and self.fix and not self.compass.required
        self.guidance.move_to(message, self.pose, ready)

    def _make_way(self) -> None:
        """A move is about to begin, unless what flies does not let it."""
        self.guidance.taken = self.flight_plan.playing or self.animations.running
        if not self.guidance.taken:
            self._free()

    def _cancel_move_to(self, message: Message) -> None:
        self.guidance.cancel_move_to(self.pose)

    def _start_poi(self, message: ardrone3.StartPilotedPOI | ardrone3.StartPilotedPOIV2) -> None:
        if self._taken:
            return
        if self.poi.start(message, self.state is FlyingState.HOVERING, self.time):
            self.guidance.cancel(self.pose)
            self.follow.stop()

    def _stop_poi(self, message: Message) -> None:
        self.poi.stop()
        self.guidance.stare(None)

    @property
    def _taken(self) -> bool:
        """True while a flight is active that a point of interest or a target does not replace."""
        return self.homing.flying or self.flight_plan.playing or self.animations.running

    def _follow_me(self, message: Message) -> None:
        starts = isinstance(message, follow_me.Start)
        if starts and self._taken:
            message = follow_me.Start(follow_me.Mode.NONE)
        for event in self.follow.handle(message, self.pose, self.time) or ():
            self._emit(event)
        if starts and self.follow.engaged and not self._taken:
            self.guidance.cancel(self.pose)
            self.poi.stop()

    def _animate(self, message: Message) -> None:
        if self.homing.flying or self.flight_plan.playing:
            return
        if self.animations.start(message, self.pose, self.target, self.model.airframe.max_speed):
            self.guidance.cancel(self.pose)

    def _cancel_animation(self, message: Message) -> None:
        self.animations.cancel()

    # -- the rest

    def _set_datetime(self, message: common.CurrentDateTime) -> None:
        self.datetime = message.datetime
        self.payload.calendar.set(message.datetime, self.time)
        self._emit(common.CurrentDateTimeChanged(message.datetime))

    def _set_date(self, message: common.CurrentDate) -> None:
        self._emit(common.CurrentDateChanged(message.date))

    def _set_time(self, message: common.CurrentTime) -> None:
        self._emit(common.CurrentTimeChanged(message.time))

    def _reset(self, message: Message) -> None:
        self.settings.reset()
        self.guidance.apply_limits()
        for event in self.settings.report():
            self._emit(event)
        self._emit(common.ResetChanged())

    def _sound(self, message: Message) -> None:
        playing = isinstance(message, ardrone3.StartAlertSound)
        self.sound = ardrone3.AlertSoundState.PLAYING if playing else ardrone3.AlertSoundState.STOPPED
        self._emit(ardrone3.AlertSound(self.sound))

    # -- flight plans

    def _start_plan(self, message: common.Start) -> None:
        self._play(message.filepath, message.type)

    def _start_plan_at(self, message: flight_plan.StartAt | flight_plan.StartAtV2) -> None:
        goes_on = bool(message.continue_on_disconnect) if isinstance(message, flight_plan.StartAtV2) else None
        type = common.MavlinkType(int(message.type))
        self._play(message.flightplan_id, type, name=message.custom_id, item=message.item, goes_on=goes_on)

    def _play(
        self, uid: str, type: common.MavlinkType, *, name: str = "", item: int = 0, goes_on: bool | None = None
    ) -> None:
        data = self.plans.get(uid)
        if self.flight_plan.start(uid, type, data, self.pose, self.time, name=name, item=item, goes_on=goes_on):
            self.guidance.cancel(self.pose)
            self._free()
            self.homing.abort()

    def _pause_plan(self, message: Message) -> None:
        self.flight_plan.pause()

    def _stop_plan(self, message: Message) -> None:
        if self.flight_plan.state is common.PlayingState.STOPPED:
            self.flight_plan.report_stopped()
        else:
            self.flight_plan.stop(hover=True)

    def _clear_recovery(self, message: Message) -> None:
        self.flight_plan.clear_recovery()


_HANDLERS: dict[type[Message], Callable[[Firmware, Any], None]] = {
    ardrone3.TakeOff: Firmware._take_off,
    ardrone3.Landing: Firmware._land,
    ardrone3.Emergency: Firmware._emergency,
    ardrone3.UserTakeOff: Firmware._user_take_off,
    ardrone3.SmartTakeOffLand: Firmware._smart,
    ardrone3.MoveBy: Firmware._move_by,
    move.ExtendedMoveBy: Firmware._move_by,
    ardrone3.MoveTo: Firmware._move_to,
    move.ExtendedMoveTo: Firmware._move_to,
    ardrone3.CancelMoveTo: Firmware._cancel_move_to,
    ardrone3.StartPilotedPOI: Firmware._start_poi,
    ardrone3.StartPilotedPOIV2: Firmware._start_poi,
    ardrone3.StopPilotedPOI: Firmware._stop_poi,
    ardrone3.NavigateHome: Firmware._navigate_home,
    rth.ReturnToHome: Firmware._return_home,
    rth.Abort: Firmware._abort,
    rth.SetCustomLocation: Firmware._custom_location,
    rth.CancelAutoTrigger: Firmware._cancel_auto_trigger,
    ardrone3.SendControllerGPS: Firmware._controller_gps,
    ardrone3.StartAlertSound: Firmware._sound,
    ardrone3.StopAlertSound: Firmware._sound,
    common.CurrentDateTime: Firmware._set_datetime,
    common.CurrentDate: Firmware._set_date,
    common.CurrentTime: Firmware._set_time,
    common.Reset: Firmware._reset,
    common.Start: Firmware._start_plan,
    common.Pause: Firmware._pause_plan,
    common.Stop: Firmware._stop_plan,
    flight_plan.StartAt: Firmware._start_plan_at,
    flight_plan.StartAtV2: Firmware._start_plan_at,
    flight_plan.ClearRecoveryInfo: Firmware._clear_recovery,
    **dict.fromkeys(FOLLOW_ME, Firmware._follow_me),
    **dict.fromkeys(ANIMATIONS, Firmware._animate),
    animation.Cancel: Firmware._cancel_animation,
}

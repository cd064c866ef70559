"""Take-off and landing: what prevents a take-off, and the verbs that end a flight.

A take-off that was aborted may have reached the drone all the same: a landing and an emergency have to stop motors
that may still start.
"""

from __future__ import annotations

import asyncio
import enum
import math
from collections.abc import Callable
from typing import NamedTuple

from anafi_mav.arsdk.codec.wire import Message, OpenEnum
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.ardrone3 import AlertState, FlyingState, MotorError
from anafi_mav.arsdk.messages.battery import AlertLevel, BatteryAlert
from anafi_mav.arsdk.messages.common import Sensor
from anafi_mav.drone.element import Element
from anafi_mav.drone.expectation import Commander, loop_time, require_number
from anafi_mav.drone.piloting.state import MOTORS_OFF, PilotingState, in_state
from anafi_mav.drone.piloting.stick_stream import StickStream
from anafi_mav.drone.sent_commands import AUTOMATIC, QUIET, TAKEN_OFF, Phase, SentCommand, Slot
from anafi_mav.drone.status.alerts import AlertsState, spoken
from anafi_mav.drone.status.battery import BatteryState
from anafi_mav.drone.status.calibration import CalibrationState
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout

RAMPING_TIMEOUT = 10.0
"""s that the motors may take from their first turn to the take-off."""

LAND_INSISTS = 10.0
"""s for which a Landing is repeated while the motors ramp up or the drone rises: ardrone3.xml 1-0-3 promises a landing
to a drone that takes off, hovers or flies, and none to one whose motors ramp up."""

LAND_MEMORY = 3.0
"""s after the verb of a Landing was ended in which the drone may land all the same, and after a landing was to be ended
in which the reported landing may be over."""

STANDS_FOR = 2.0
"""s after a drone that is said to stand was commanded to land in which motors that start are against that: the take-off
of another controller was not reported yet."""

STOP_MOTORS_TIMEOUT = 15.0
"""s until propellers that turn near the ground stand still: the way down from half a metre is in it."""

FORCED_AFTER = 0.3
"""s that motors may go on ramping up after a forced disarm before they are cut."""

STANDS_BELOW = 0.3
"""m above the ground below which motors that are said to ramp up may be cut."""

EMERGENCY_TIMEOUT = 30.0
"""s that cutting the motors is tried for while the link seems to live but delivers nothing."""

TURNING = frozenset({FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF})
"""The motors turn and the drone is not in the air."""
_RISING = frozenset({FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF})
_LANDING = frozenset({FlyingState.LANDING, FlyingState.LANDED, FlyingState.EMERGENCY_LANDING, FlyingState.EMERGENCY})
_MOTORS_CUT = frozenset({FlyingState.EMERGENCY, FlyingState.LANDED})

_FLIES_WITHOUT = (Sensor.GPS,)
"""Sensors that a drone takes off without."""

_HARMLESS = (None, AlertState.NONE, AlertState.USER, AlertState.LOW_BATTERY)
"""Alerts with which a drone takes off. USER is a past emergency stop; the flying state EMERGENCY reports it better. A
firmware that kept it would stay on the ground until it is switched off."""


class BlockerKind(enum.Enum):
    """Kind of a reason that prevents a take-off; the value is the beginning of its text."""

    CHECK = ""
    """A line of the take-off checklist."""
    MAGNETOMETER = "magnetometer calibration required"
    CALIBRATING = "the magnetometer is being calibrated"
    SENSOR = "sensor "
    BATTERY = "battery "
    ALERT = "alert "
    MOTOR = "motor "


class Blocker(NamedTuple):
    """One reported reason that can prevent a take-off; `str` gives it in words."""

    kind: BlockerKind
    value: OpenEnum | None = None
    """Which check, sensor, alert or error."""

    def __str__(self) -> str:
        if self.kind is BlockerKind.BATTERY and self.value == BatteryAlert.POWER_LEVEL:
            return "battery critical"
        return self.kind.value + ("" if self.value is None else spoken(self.value))

    @property
    def is_charge(self) -> bool:
        """True when the reason is a low charge, which a drone reports in three ways at once."""
        return (self.kind, self.value) in _CHARGE


_CHARGE: tuple[tuple[BlockerKind, OpenEnum], ...] = (
    (BlockerKind.CHECK, TakeoffChecklistType.BATTERY_CRITICAL),
    (BlockerKind.BATTERY, BatteryAlert.POWER_LEVEL),
    (BlockerKind.ALERT, AlertState.CRITICAL_BATTERY),
    (BlockerKind.ALERT, AlertState.ALMOST_EMPTY_BATTERY),
)


def takeoff_blockers(alerts: AlertsState, battery: BatteryState, calibration: CalibrationState) -> list[Blocker]:
    """Return the reported reasons that can prevent a take-off; empty when nothing is known.

    ARSDK refuses a take-off without an answer. The take-off checklist (alarms.xml 175-0-2) is the drone's own list of
    reasons and decides alone about alerts and sensors, whose last report may be old; firmware without it leaves the
    alert, the calibration and the sensors. A critical battery counts in any case.
    """
    reasons = [Blocker(BlockerKind.CHECK, check) for check, blocks in alerts.checklist.items() if blocks]
    if TakeoffChecklistType.MAGNETO_CALIBRATION not in alerts.checklist and calibration.magneto_required:
        reasons.append(Blocker(BlockerKind.MAGNETOMETER))
    if calibration.started:
        reasons.append(Blocker(BlockerKind.CALIBRATING))
    if not alerts.checklist:
        failed = [sensor for sensor, ok in calibration.sensors.items() if not ok and sensor not in _FLIES_WITHOUT]
        reasons += [Blocker(BlockerKind.SENSOR, sensor) for sensor in failed]
    critical = [alert for alert, level in battery.alerts.items() if level == AlertLevel.CRITICAL]
    reasons += [Blocker(BlockerKind.BATTERY, alert) for alert in critical]
    if not alerts.checklist:
        if alerts.alert not in _HARMLESS:
            reasons.append(Blocker(BlockerKind.ALERT, alerts.alert))
        if BatteryAlert.POWER_LEVEL not in battery.alerts and battery.charge_level == AlertLevel.CRITICAL:
            reasons.append(Blocker(BlockerKind.BATTERY, BatteryAlert.POWER_LEVEL))
    if alerts.motor_error not in (None, MotorError.NO_ERROR):
        reasons.append(Blocker(BlockerKind.MOTOR, alerts.motor_error))
    charge = [reason for reason in reasons if reason.is_charge]
    return [reason for reason in reasons if reason not in charge[1:]]


class Motors:
    """Take-off, hand launch, landing, emergency.

    `Piloting` says what its verbs of the same names promise.
    """

    def __init__(
        self,
        commander: Commander,
        flight: Element[PilotingState],
        sticks: StickStream,
        takeoff_blockers: Callable[[], list[str]],
    ) -> None:
        self._commander = commander
        self._flight = flight
        self._sticks = sticks
        self._takeoff_blockers = takeoff_blockers
        self._sent = commander.sent
        self._may_land_until = -math.inf
        """Until when a Landing that was withdrawn, or whose verb has ended, may be reported to have begun."""
        self._doubtful_until = -math.inf
        """Until when the reported LANDING may be over: its end was asked for."""
        self._stands_until = -math.inf
        """Until when motors that no newer launch of ours has started are to stop again."""

    def link_lost(self) -> None:
        """Commands of before do not count for the next connection."""
        self._may_land_until = self._doubtful_until = self._stands_until = -math.inf

    def on_flying_state(self, message: ardrone3.FlyingStateChanged, now: float) -> None:
        """Stop motors that a withdrawn command, or another controller, starts after a landing."""
        if message.state != FlyingState.LANDING:
            self._doubtful_until = -math.inf
        sent = self._sent.attribute(message, now)
        # What ramps up may ignore the Landing (`LAND_INSISTS`): the state that follows is answered as well.
        is_against_landing = now < self._stands_until and not self.has_launched and message.state in TURNING | TAKEN_OFF
        if is_against_landing and message.state in TURNING:
            self._stands_until = now + STANDS_FOR
        # A hand launch that was withdrawn is undone before the throw; one that is thrown all the same hovers.
        can_be_undone = sent is not None and (sent.undo is None or message.state in TURNING)
        if is_against_landing or (sent is not None and can_be_undone and self._sent.is_unwanted(sent, now)):
            if message.state in TURNING:
                self._commander.send_stop_if_connected(ardrone3.UserTakeOff(0))
            self._commander.send_stop_if_connected(ardrone3.Landing())

    def landing_doubtful(self) -> None:
        """The landing is about to be ended: until a state is reported, LANDING proves nothing."""
        self._doubtful_until = loop_time() + LAND_MEMORY

    async def settle_landing(self, timeout: float) -> bool:
        """Return True when a withdrawn Landing has begun all the same; False when it will not.

        That is known once the drone has received a later command, and then reports nothing.
        """
        may_land = self._flight.state.flying in TAKEN_OFF | TURNING  # motors that ramp up stop
        if loop_time() >= self._may_land_until or not may_land:
            return self._flight.state.flying == FlyingState.LANDING
        answer = self._commander.expect(
            (ardrone3.FlyingStateChanged,), lambda message: True if message.state in _LANDING else None
        )
        try:
            began = await answer.wait_or_quiet(
                self._commander.send_stop(ardrone3.CancelMoveTo()), ardrone3.CancelMoveTo.NAME, timeout
            )
            self._may_land_until = -math.inf
        finally:
            answer.close()
        return began

    @property
    def about_to_fly(self) -> bool:
        return self._flight.state.flying == FlyingState.LANDED and self._sent.may_start_motors(loop_time())

    @property
    def has_launched(self) -> bool:
        executed = any(self._sent.is_executed(slot) for slot in (Slot.LAUNCH, Slot.PLAN))
        return executed or self._sent.has_started_motors(loop_time())

    @property
    def may_launch_late(self) -> bool:
        """True when a launch of ours that has failed may be what starts the motors now."""
        return not self.has_launched and self._sent.has_failed_launch(loop_time())

    @property
    def rises(self) -> bool:
        """True while the drone starts its motors or rises to its first hover, by a take-off of ours."""
        return self.has_launched and self._flight.state.flying in _RISING

    async def take_off(self, timeout: float) -> None:
        self._commander.require_link()
        flying = self._flight.state.flying
        if flying in TAKEN_OFF:
            return
        if flying not in (FlyingState.LANDED, FlyingState.MOTOR_RAMPING):
            raise CommandRejected(in_state(flying))
        sent = SentCommand(Slot.LAUNCH, TAKEN_OFF, answered=flying != FlyingState.LANDED)
        await self._launch(sent, ardrone3.TakeOff(), timeout)

    async def hand_launch(self, timeout: float) -> None:
        self._commander.require_link()
        flying = self._flight.state.flying
        if flying == FlyingState.USERTAKEOFF:
            return
        if flying != FlyingState.LANDED:
            raise CommandRejected(in_state(flying))
        if self._sent.awaited(Slot.LAUNCH):
            raise CommandRejected("the drone is about to take off")
        # Undone when it fails: the motors of a drone in a hand must not start a moment later.
        states = TAKEN_OFF | {FlyingState.USERTAKEOFF}
        sent = SentCommand(Slot.LAUNCH, states, ardrone3.UserTakeOff(0), undo_refused=True)
        await self._launch(sent, ardrone3.UserTakeOff(1), timeout)

    async def _launch(self, sent: SentCommand, command: Message, timeout: float) -> None:
        """Send a command that starts the motors; return once a target state is reported."""
        self._sticks.silence()

        def judge(message: ardrone3.FlyingStateChanged) -> bool | AnafiMavError | None:
            if message.state == FlyingState.MOTOR_RAMPING:
                sent.answer.expire_after(RAMPING_TIMEOUT, command.NAME)
            elif sent.phase is Phase.REFUSED:
                return CommandRejected(self._why_on_the_ground("the motors stopped again"))
            return True if sent.phase is Phase.CONFIRMED else None

        try:
            await self._commander.begin(sent, command, (ardrone3.FlyingStateChanged,), judge, timeout)
        except CommandTimeout:
            if reasons := self._why_on_the_ground(""):
                raise CommandRejected(reasons) from None
            raise

    async def cancel_hand_launch(self, timeout: float) -> None:
        self._commander.require_link()
        if self.about_to_fly:
            await self.land(timeout)
            return
        if self._flight.state.flying in MOTORS_OFF:
            return
        if self._flight.state.in_air:
            raise CommandRejected("the drone flies")
        await self._commander.confirm(
            ardrone3.UserTakeOff(0),
            (ardrone3.FlyingStateChanged,),
            lambda message: True if message.state in MOTORS_OFF else None,
            timeout,
        )

    def _why_on_the_ground(self, otherwise: str) -> str:
        return ", ".join(self._takeoff_blockers()) or otherwise

    async def land(self, timeout: float) -> None:
        require_number(timeout)
        self._commander.require_link()
        self._commander.abort_pending("the drone is to land")
        if self._lands and not self.about_to_fly:
            # What is reported may be old: another controller's take-off, or its end of a landing, is not reported yet.
            self._commander.deliver(ardrone3.Landing())
            self._note_standing()
            return
        # Level at once, then nothing, from here on and not from the drone's answer on: a positive gaz would cancel
        # the landing.
        self._sticks.let_go()
        self._sticks.silence()
        self._sticks.landings_asked += 1
        try:
            if self.about_to_fly:
                await self._catch_take_off(timeout)
            if self._lands:
                self._note_standing()
                return
            self._end_hand_launch()
            await self._insist(timeout)
        finally:
            self._sticks.landings_asked -= 1

    def _note_standing(self) -> None:
        """A landing was commanded that has nothing to do, as far as the drone has reported."""
        if self._flight.state.flying == FlyingState.LANDED:
            self._stands_until = loop_time() + STANDS_FOR

    @property
    def _lands(self) -> bool:
        """True while the drone certainly lands, or has landed."""
        state = self._flight.state.flying
        return state in _LANDING and (state != FlyingState.LANDING or loop_time() >= self._doubtful_until)

    async def _insist(self, timeout: float) -> None:
        """Send Landing until the drone lands.

        It is repeated at each state that shows that the previous one had no effect. It is withdrawn when this is
        cancelled or fails; the drone may have received it all the same (`settle_landing`).
        """
        doubtful = self._flight.state.flying == FlyingState.LANDING
        rising = self._flight.state.flying in TURNING or self._flight.state.flying == FlyingState.TAKINGOFF
        sent: list[asyncio.Future[None]] = []

        def send() -> None:
            if not sent or sent[-1].done():
                sent.append(self._commander.deliver(ardrone3.Landing()))

        def judge(message: ardrone3.FlyingStateChanged) -> bool | None:
            if message.state in TAKEN_OFF:
                send()
            elif message.state == FlyingState.USERTAKEOFF:  # it may have ignored this one as its motors ramped up
                self._commander.send_stop_if_connected(ardrone3.UserTakeOff(0))
            return True if message.state in _LANDING else None

        answer = self._commander.expect((ardrone3.FlyingStateChanged,), judge)
        seconds = max(timeout, LAND_INSISTS) if rising else timeout
        answer.expire_after(seconds, ardrone3.Landing.NAME)
        try:
            send()
            began = doubtful and await answer.wait_or_quiet(sent[0], ardrone3.Landing.NAME, timeout)
            if doubtful and not began and self._flight.state.flying in _LANDING:
                self._doubtful_until = -math.inf  # it has received the Landing, and reports nothing else
                return
            await answer.wait()
        except BaseException:
            self._may_land_until = loop_time() + LAND_MEMORY
            for delivery in sent:
                self._commander.withdraw(delivery, CommandRejected("the landing was withdrawn"))
            raise
        finally:
            answer.close()

    async def stop_motors(self, *, force: bool) -> None:
        self._commander.require_link()
        self._commander.abort_pending("the motors are to stop", *AUTOMATIC, Slot.LAUNCH)
        self._sticks.let_go()
        self._sticks.silence()
        cut: asyncio.Future[None] | None = None

        def judge(message: ardrone3.FlyingStateChanged) -> bool | None:
            if message.state in TAKEN_OFF:
                self._commander.send_stop(ardrone3.Landing())
                if cut is not None:  # from here on it would fall
                    self._commander.withdraw(cut, CommandRejected("the drone has left the ground"))
            elif message.state == FlyingState.USERTAKEOFF:  # it may have ignored this one as its motors ramped up
                self._commander.send_stop_if_connected(ardrone3.UserTakeOff(0))
            return True if message.state in MOTORS_OFF else None

        answer = self._commander.expect((ardrone3.FlyingStateChanged,), judge)
        answer.expire_after(STOP_MOTORS_TIMEOUT, ardrone3.Landing.NAME)
        self._sticks.landings_asked += 1
        try:
            if self._flight.state.flying in TURNING:
                self._commander.send_stop(ardrone3.UserTakeOff(0))
            self._commander.send_stop(ardrone3.Landing())
            if force:
                await asyncio.wait({answer.future}, timeout=FORCED_AFTER)
                if self._flight.state.flying == FlyingState.MOTOR_RAMPING and not self._is_high:
                    cut = self._commander.deliver(ardrone3.Emergency())
            await answer.wait()
            self._sent.rule_out()
        except BaseException:
            self._may_land_until = loop_time() + LAND_MEMORY
            raise
        finally:
            self._sticks.landings_asked -= 1
            answer.close()

    @property
    def _is_high(self) -> bool:
        """True for a measured height at which no drone stands.

        It is fresh while the flying state may be late. Without a height above the ground that above the take-off point
        counts. A drone that a hand holds for its launch has any height; a launch of an earlier flight is no reason.
        """
        state, launch = self._flight.state, self._sent.newest(Slot.LAUNCH)
        height = state.altitude if state.height is None else state.height
        is_held = launch is not None and launch.undo is not None and launch.lasts(loop_time())
        return height is not None and height >= STANDS_BELOW and not is_held

    def _end_hand_launch(self) -> None:
        """A drone that idles in a hand has no use for a Landing: it waits to be thrown, or for this."""
        if self.about_to_fly or self._flight.state.flying in TURNING:
            self._commander.send_stop(ardrone3.UserTakeOff(0))

    async def _catch_take_off(self, timeout: float) -> None:
        """Return when the drone is off the ground, or when it certainly stays there.

        That is known once it has received a Landing, behind any take-off of ours, and then reports nothing. LANDED
        that is reported while a take-off may still begin is older than it. Raises `CommandTimeout` while it is not
        known; the Landing is not withdrawn.
        """
        self._end_hand_launch()
        answer = self._commander.expect(
            (ardrone3.FlyingStateChanged,),
            lambda message: None if message.state in TURNING or self.about_to_fly else True,
        )
        try:
            delivery = self._commander.deliver(ardrone3.Landing())
            if not await answer.wait_or_quiet(delivery, ardrone3.Landing.NAME, timeout):
                self._sent.rule_out()
        except BaseException:
            self._may_land_until = loop_time() + LAND_MEMORY
            raise
        finally:
            answer.close()

    async def emergency(self) -> None:
        self._commander.require_link()
        self._sticks.silence()
        cut = self._flight.state.flying in _MOTORS_CUT and not self.about_to_fly
        # Emergency overtakes what waits in the queue: nothing of that may follow it.
        self._commander.abort_pending("the motors are cut", *AUTOMATIC, Slot.LAUNCH)
        answer = self._commander.expect(
            (ardrone3.FlyingStateChanged,), lambda message: True if message.state in _MOTORS_CUT else None
        )
        try:
            delivery = self._commander.deliver(ardrone3.Emergency())
            said = await answer.wait_or_quiet(delivery, ardrone3.Emergency.NAME, EMERGENCY_TIMEOUT)
        except CommandTimeout as error:
            self._commander.withdraw(delivery, error)  # said to have failed, it must not be carried out later
            raise
        finally:
            answer.close()
        if not said and not cut:
            raise CommandTimeout(ardrone3.Emergency.NAME, QUIET)
        self._sent.rule_out()

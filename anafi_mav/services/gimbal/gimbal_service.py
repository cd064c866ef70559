"""Gimbal manager of component 1 (MAVLink gimbal_v2.md, device id 1), and older mounts.

`control` says which client may move the gimbal, `rates` how long a rate goes on, `targets` reads angles and rates,
`roi` looks at places. A command is ACCEPTED when the drone reports that the gimbal turns as commanded, or has arrived:
stations send the next command after the acknowledgement, and operators turn on before the gimbal rests.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping
from typing import TypedDict

from anafi_mav import texts, units
from anafi_mav.drone import Aim, GimbalState
from anafi_mav.drone.events import Axis, GimbalAttitudeChanged
from anafi_mav.errors import AnafiMavError, LinkLost
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.mavlink.stall import STALL
from anafi_mav.services.command_targets import height, place
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect, ProgressPolicy
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.gimbal import gimbal_messages, mount, targets
from anafi_mav.services.gimbal.control import Answer, ClientId, GimbalControl, Heartbeats
from anafi_mav.services.gimbal.rates import GimbalRates
from anafi_mav.services.gimbal.roi import RegionOfInterest
from anafi_mav.services.gimbal.targets import Frames, GimbalTarget
from anafi_mav.services.service import Host, MessageHandler, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.refusal import Refused, Unsupported
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.vehicle import Vehicle

STOPS = 4
"""Zero rates sent after a stop is confirmed. Targets are not acknowledged by the drone, and a gimbal that turns slowly
looks as if it stood."""

REPEATS = 3
"""Times that the angles of a message are sent again: the drone may have lost the first."""

REPEAT_EVERY = 0.3
"""s between them; not while further messages arrive."""


def client_id(client: object) -> ClientId:
    """Return system and component of a `Command.client`."""
    if isinstance(client, tuple) and len(client) == 3:
        return (client[1], client[2])
    raise ValueError(f"not a client: {client!r}")


class _ByAxis(TypedDict):
    """Arguments of the gimbal's verbs."""

    yaw: Aim | None
    pitch: Aim | None
    roll: Aim | None


def _by_axis(aims: Mapping[Axis, Aim]) -> _ByAxis:
    return {"yaw": aims.get(Axis.YAW), "pitch": aims.get(Axis.PITCH), "roll": aims.get(Axis.ROLL)}


class GimbalService(Service):
    """Gimbal of one vehicle, as a MAVLink gimbal manager."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._heartbeats = Heartbeats()
        self._control = GimbalControl(self._heartbeats)
        self._rates = GimbalRates(self._heartbeats)
        self._roi = RegionOfInterest(host)
        self._mount_mode = dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING
        """Of MOUNT_CONFIGURE: decides what a MOUNT_CONTROL means."""
        self._neutral = False
        """The last target was the reference orientation."""
        self._command: asyncio.Task[None] | None = None
        """The gimbal command that has not been answered yet."""
        self._halt: asyncio.Task[None] | None = None
        """Stops the gimbal, and makes sure of it."""
        self._zeros = 0
        """Zero rates that are still to be sent."""
        self._repeat: tuple[Mapping[Axis, Aim], int, float] | None = None
        """Angles of a message, how often they are to be sent again, and when next."""
        self._ticked = math.inf
        self._status: tuple[object, ...] = ()
        """Content of the last GIMBAL_MANAGER_STATUS."""
        self._was_turning = False
        """A rate was in force when the link was lost: the drone may still turn its gimbal."""

    # Tables.

    def capabilities(self) -> int:
        return dialect.MAV_PROTOCOL_CAPABILITY_COMPONENT_IMPLEMENTS_GIMBAL_MANAGER

    def actions(self) -> Mapping[int, Action]:
        # MAVSDK's gimbal plugin takes an IN_PROGRESS for a failure (gimbal_impl.cpp, receive_command_result).
        late = ProgressPolicy.LATE

        def aim(handler: mount.Handler) -> Action:
            return Action(
                handler,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.TARGET,
                progress=late,
                group=ActionGroup.GIMBAL,
            )

        def look(
            handler: mount.Handler, altitude: Altitude = Altitude.UNUSED, effect: Effect = Effect.CHANGE
        ) -> Action:
            has_location = altitude is not Altitude.UNUSED
            return Action(handler, location=has_location, altitude=altitude, effect=effect, progress=late)

        return {
            dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: aim(self._pitch_yaw),
            dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: aim(self._configure),
            dialect.MAV_CMD_DO_MOUNT_CONFIGURE: aim(self._mount_configure),
            dialect.MAV_CMD_DO_MOUNT_CONTROL: aim(self._mount_control),
            dialect.MAV_CMD_DO_SET_ROI_LOCATION: look(self._look_at, Altitude.AMSL),
            dialect.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET: look(self._look_beside),
            dialect.MAV_CMD_DO_SET_ROI_SYSID: look(self._look_at_system),
            dialect.MAV_CMD_DO_SET_ROI_NONE: look(self._look_anywhere, effect=Effect.STOP),
            dialect.MAV_CMD_DO_SET_ROI: look(self._legacy_roi, Altitude.BY_FRAME),
        }

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_ATTITUDE: self._set_attitude,
            dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_PITCHYAW: self._set_pitch_yaw,
            dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_SET_MANUAL_CONTROL: self._set_manual,
            dialect.MAVLINK_MSG_ID_MOUNT_CONFIGURE: self._mount_configured,
            dialect.MAVLINK_MSG_ID_MOUNT_CONTROL: self._mount_controlled,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._roi.receive,
        }

    def streams(self) -> Mapping[int, MessageStream]:
        def gimbal(vehicle: Vehicle) -> GimbalState:
            return vehicle.drone.gimbal.main

        attitude = (GimbalAttitudeChanged,)
        return {
            dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION: MessageStream(
                lambda vehicle, times: gimbal_messages.information(gimbal(vehicle), times)
            ),
            dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS: MessageStream(
                lambda vehicle, times: self._manager_status(times), every=1.0
            ),
            dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_INFORMATION: MessageStream(
                lambda vehicle, times: gimbal_messages.device_information(vehicle, gimbal(vehicle), times)
            ),
            dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: MessageStream(
                lambda vehicle, times: gimbal_messages.attitude_status(gimbal(vehicle), times, neutral=self._neutral),
                attitude,
                every=0.1,
                from_pictures=True,
            ),
            dialect.MAVLINK_MSG_ID_MOUNT_ORIENTATION: MessageStream(
                lambda vehicle, times: gimbal_messages.mount_orientation(gimbal(vehicle), times), attitude, every=0.2
            ),
            dialect.MAVLINK_MSG_ID_MOUNT_STATUS: MessageStream(
                lambda vehicle, times: gimbal_messages.mount_status(gimbal(vehicle), self._mount_mode), attitude
            ),
        }

    # The link, clients and time.

    def link_up(self) -> None:
        self._ticked = math.inf
        if self._was_turning:
            self._was_turning = False
            self._stop_turning()

    def link_down(self) -> None:
        self._was_turning = self._rates.turns or self._halt is not None
        with contextlib.suppress(AnafiMavError):
            if self._rates.turns:  # the gateway ends, and the drone is still connected
                for _ in range(STOPS):
                    self._turn({axis: Aim(0.0, aim.frame) for axis, aim in self._rates.rates.items()})
        self._rates.end_unless(())
        self._control = GimbalControl(self._heartbeats)
        self._roi.link_down()
        self._command = self._halt = self._repeat = None
        self._zeros, self._neutral, self._status = 0, False, ()

    def heartbeat(self, inbound: Inbound) -> None:
        self._heartbeats.receive((inbound.sysid, inbound.compid), inbound.now)

    def tick(self, now: float) -> None:
        if (
            gap := now - self._ticked
        ) >= STALL:  # heartbeats that arrived meanwhile were not read: no silence of theirs
            self._heartbeats.add_stall(gap)
            self._control.add_stall(gap)
            self._rates.add_stall(gap)
        self._ticked = now
        self._watch_control(now)
        self._watch_rates(now)
        self._roi.tick(now)
        self._announce()
        with contextlib.suppress(AnafiMavError):
            self._send_again(now)

    def _watch_control(self, now: float) -> None:
        self._watch_mission()
        silent = self._control.expire(now)
        if silent is not None:
            self.host.text(Severity.NOTICE, texts.GIMBAL_RELEASED.fill(system=silent[0]))
            if self._rates.client == silent and self._rates.end_unless(()):
                self._stop_turning()

    def _watch_mission(self) -> None:
        """Give the gimbal to the mission that is flown while it needs it."""
        if self._control.mission(needs_gimbal=self.host.vehicle.mission_needs_gimbal) and self._control.is_of_mission:
            self._roi.forget_system()
            turns = self._rates.end_unless(()) or self._halt is not None
            self._begin()
            self._neutral, self._zeros = False, STOPS if turns else 0  # soon: its first target may follow

    def _watch_rates(self, now: float) -> None:
        client = self._rates.client
        by_command = self._rates.is_by_command
        if client is not None and self._rates.expire(now):
            self._stop_turning()
            if by_command:
                reason = texts.RATE_CLIENT_SILENT.fill(system=client[0])
                self.host.text(Severity.NOTICE, texts.GIMBAL_STOPPED.fill(reason=reason))
            return
        if self._command is not None:
            return  # the command ends when the gimbal turns, or is at the end of its range
        gimbal = self.host.drone.gimbal.main
        at_end = [axis for axis, aim in self._rates.rates.items() if aim.value and gimbal.is_at_end(axis, aim.value)]
        if at_end and self._rates.limit(at_end):
            self._stop_turning()

    def _send_again(self, now: float) -> None:
        """Repeat what the drone may have lost: rates in force, a stop, the angles of a message."""
        if self._command is not None or self._halt is not None:
            return  # they repeat it themselves
        if self._rates.turns:
            self._turn(self._rates.rates)
        elif self._zeros > 0:
            self._zeros -= 1
            self.host.drone.gimbal.halt()
        if self._repeat is not None and now >= self._repeat[2]:
            angles, left, _ = self._repeat
            self.host.drone.gimbal.aim(**_by_axis(angles))
            self._repeat = (angles, left - 1, now + REPEAT_EVERY) if left > 1 else None

    def _manager_status(self, times: Times) -> dialect.MAVLink_message | None:
        gimbal = self.host.drone.gimbal.main
        return gimbal_messages.manager_status(gimbal, self._control, self.host.sysid, times, neutral=self._neutral)

    def _announce(self) -> None:
        """Send GIMBAL_MANAGER_STATUS at once when control or a flag has changed."""
        control, gimbal = self._control, self.host.drone.gimbal.main
        flags = gimbal_messages.device_flags(gimbal, neutral=self._neutral)
        status = (control.state, control.primary, control.secondary, flags)
        if status != self._status:
            self._status = status
            message = self._manager_status(self.host.times())
            if message is not None:
                self.host.send(message)

    # Control.

    async def _configure(self, command: Command) -> None:
        """Run MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: param1 to 4 are ids of the two clients."""
        _check_device(command.z)
        self._watch_mission()
        now = self.host.clock.monotonic()
        answer = self._control.configure(client_id(command.client), command.params, now)
        if answer is Answer.MISSION:
            raise Refused(texts.GIMBAL, texts.GIMBAL_OF_MISSION)
        if answer is Answer.INVALID:
            raise Refused(texts.GIMBAL, texts.GIMBAL_IDS, lasting=True)
        self._end_rates_of_others(client_id(command.client))
        self._announce()

    def _end_rates_of_others(self, sender: ClientId) -> None:
        """Stop a rate whose client has control no longer, or has just released it."""
        turner = self._rates.client
        if turner is None:
            return
        released = turner == sender and turner not in (self._control.primary, self._control.secondary)
        if (released or not self._control.allows(turner)) and self._rates.end_unless(()):
            self._stop_turning()

    def _require_control(self, client: object) -> ClientId:
        """Return the id of a client that may move the gimbal. Raises `Refused` for another one."""
        known = client_id(client)
        self._watch_mission()
        if not self._control.allows(known):
            raise Refused(texts.GIMBAL, self._holder)
        return known

    @property
    def _holder(self) -> OperatorText:
        if self._control.is_of_mission:
            return texts.GIMBAL_OF_MISSION
        return texts.GIMBAL_OF_CLIENT.fill(system=self._control.primary[0])

    # Angles and rates by command.

    async def _pitch_yaw(self, command: Command) -> None:
        """Run MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: pitch, yaw (deg), their rates (deg/s), flags."""
        _check_device(command.z)
        pitch, yaw, pitch_rate, yaw_rate = command.params
        frames = self._frames(command.x, command.flavour)
        target = targets.read(frames, {Axis.PITCH: pitch, Axis.YAW: yaw}, {Axis.PITCH: pitch_rate, Axis.YAW: yaw_rate})
        await self._move(command, target)

    def _frames(self, flags: float, flavour: Flavour) -> Frames:
        attitude = self.host.drone.piloting.state.attitude
        heading = None if attitude is None else attitude.yaw * units.DEG_PER_RAD
        known = int(flags) if math.isfinite(flags) and flags >= 0.0 else 0
        return Frames(known, flavour.gimbal_keeps_horizon, heading)

    async def _move(self, command: Command, target: GimbalTarget | OperatorText) -> None:
        """Carry out the target of a command; return when the drone turns the gimbal."""
        if isinstance(target, str):
            raise _refusal(target)
        client = self._require_control(command.client)
        gimbal = self.host.drone.gimbal
        if gimbal.main.axes is None:
            raise Unsupported(texts.GIMBAL, texts.NO_GIMBAL)
        target = target.on(gimbal.main.axes)
        if not (target.angles or target.rates or target.neutral):
            return  # yaw alone, of a gimbal without this axis
        self._begin()
        task = self._command = asyncio.current_task()
        try:
            await self._roi.free_gimbal()
            self._neutral = target.neutral
            if target.rates:
                self._rates.take(client, target.rates, self.host.clock.monotonic(), by_message=False)
            else:
                self._rates.replace_by_angles()
            if target.neutral:
                await gimbal.reset_orientation()
            elif target.is_zero_rate:
                await gimbal.stop()
            else:
                if target.angles:
                    await gimbal.steer(**_by_axis(target.angles))
                if self._rates.turns:
                    await gimbal.sweep(**_by_axis(self._rates.rates))
        except BaseException:
            if self._command is task and self._rates.end_unless(()):  # nothing newer, and it has not been confirmed
                self._command = None
                self._stop_turning()
            raise
        finally:
            if self._command is task:
                self._command = None
                self._zeros = STOPS if target.is_zero_rate else 0

    def _begin(self) -> None:
        """End what moves the gimbal: a newer target replaces it."""
        if self._command is not None and self._command is not asyncio.current_task():
            self._command.cancel()
            self._command = None
        if self._halt is not None:
            self._halt.cancel()
            self._halt = None
        self._zeros, self._repeat = 0, None

    def _turn(self, rates: Mapping[Axis, Aim]) -> None:
        self.host.drone.gimbal.turn(**_by_axis(rates))

    def _stop_turning(self) -> None:
        """Stop the gimbal in the background, until the drone reports that it stands."""
        self._begin()
        self._halt = self.host.spawn(self._stop())

    async def _stop(self) -> None:
        task = asyncio.current_task()
        try:
            await self.host.drone.gimbal.stop()
        except LinkLost:
            return
        except AnafiMavError as error:
            self.host.text(Severity.WARNING, texts.GIMBAL_STOP_FAILED.fill(error=error))
        finally:
            if self._halt is task:
                self._halt, self._zeros = None, STOPS

    # Angles and rates by message.

    def _set_attitude(self, inbound: Inbound) -> None:
        message = inbound.message
        frames = self._frames(message.flags, flavour_of(inbound.channel))
        self._stream(inbound, message.gimbal_device_id, targets.from_attitude(message, frames))

    def _set_pitch_yaw(self, inbound: Inbound) -> None:
        message = inbound.message
        frames = self._frames(message.flags, flavour_of(inbound.channel))
        self._stream(inbound, message.gimbal_device_id, targets.from_pitch_yaw(message, frames))

    def _set_manual(self, inbound: Inbound) -> None:
        message, gimbal = inbound.message, self.host.drone.gimbal.main
        frames = self._frames(message.flags, flavour_of(inbound.channel))
        speeds = {axis: speed.current for axis, speed in gimbal.max_speed.items()}
        target = targets.from_manual(message, frames, gimbal_messages.ranges(gimbal), speeds)
        self._stream(inbound, message.gimbal_device_id, target)

    def _stream(self, inbound: Inbound, device: float, target: GimbalTarget | OperatorText) -> None:
        """Carry out the target of a message, which has no acknowledgement: a refusal is a text."""
        client, reason = (inbound.sysid, inbound.compid), None
        if not targets.is_device(device):
            reason = texts.NO_SUCH_GIMBAL.fill(number=device)
        elif isinstance(target, str):
            reason = target
        elif not self._control.allows(client):
            reason = self._holder
        if reason is not None or isinstance(target, str):
            self.host.warn_throttled(texts.REFUSED.fill(what=texts.GIMBAL, reason=reason))
            return
        target = target.on(self.host.drone.gimbal.main.axes or frozenset())
        if self._roi.holds_gimbal:
            if self._command is None and (target.angles or target.rates or target.neutral):
                self._command = self.host.spawn(self._free_gimbal())
            return  # the next message moves it
        try:
            self._apply(client, target)
        except AnafiMavError as error:
            self.host.warn_throttled(texts.from_below(error))

    async def _free_gimbal(self) -> None:
        task = asyncio.current_task()
        try:
            await self._roi.free_gimbal()
        except AnafiMavError as error:
            self.host.warn_throttled(texts.from_below(error))
        finally:
            if self._command is task:
                self._command = None

    def _apply(self, client: ClientId, target: GimbalTarget) -> None:
        now = self.host.clock.monotonic()
        if target.neutral:
            if not self._neutral:
                self._begin()
                self._rates.replace_by_angles()
                self._neutral = True
                self._halt = self.host.spawn(self._reset())
            return
        if target.is_zero_rate:
            stands = self._halt is not None or self._zeros > 0
            self._rates.take(client, target.rates, now, by_message=True)
            self._neutral = False
            if not stands:
                self._stop_turning()
            return
        if not (target.angles or target.rates):
            return
        before = self._rates.rates
        self._begin()
        self._neutral = False
        if target.rates:
            self._rates.take(client, target.rates, now, by_message=True)
        else:
            self._rates.replace_by_angles()
        if target.angles:
            self.host.drone.gimbal.aim(**_by_axis(target.angles))
            self._repeat = (target.angles, REPEATS, now + REPEAT_EVERY)
        if self._rates.turns and self._rates.rates != before:
            self._turn(self._rates.rates)

    async def _reset(self) -> None:
        task = asyncio.current_task()
        try:
            await self.host.drone.gimbal.reset_orientation()
        except AnafiMavError as error:
            self.host.warn_throttled(texts.from_below(error))
        finally:
            if self._halt is task:
                self._halt = None

    # Regions of interest.

    async def _look_at(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI_LOCATION: nose and camera follow the place.

        They do so until something else is flown (Parrot's piloted POI, which needs a hovering drone and waits for
        it). An unset height is that of the take-off point.
        """
        _check_device(command.params[0], texts.ROI)
        await self._look_at_place(command)

    async def _look_at_place(self, command: Command) -> None:
        where = place(command)
        if where is None:
            raise Refused(texts.ROI, texts.NO_PLACE, lasting=True)
        await self._look(command, where, height(self.host.vehicle, command) or 0.0)

    async def _look(self, command: Command, where: GeoPoint, ato: float) -> None:
        self._require_control(command.client)
        await self._rest()
        await self._roi.look_at(where, ato)

    async def _rest(self) -> None:
        """End what moves the gimbal, before the drone aims it: a stop sent later could end that."""
        turns = self._rates.end_unless(()) or self._halt is not None
        self._begin()
        self._neutral = False
        if turns:
            await self.host.drone.gimbal.stop()

    async def _look_at_system(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI_SYSID: param1 system, param2 gimbal device."""
        _check_device(command.params[1], texts.ROI)
        await self._look_at_number(command, command.params[0])

    async def _look_at_number(self, command: Command, system: float) -> None:
        self._require_control(command.client)
        await self._rest()
        await self._roi.look_at_system(system)

    async def _look_anywhere(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI_NONE: param1 gimbal device."""
        _check_device(command.params[0], texts.ROI)
        self._require_control(command.client)
        await self._roi.stop()

    async def _legacy_roi(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI: param1 MAV_ROI; none or a location.

        With a place it looks there, also if param1 is 0: Mission Planner and dronekit send it so, and ArduPilot does
        not read param1. At 0/0 MAVProxy means none.
        """
        kind = command.params[0]
        is_none = kind == dialect.MAV_ROI_NONE or math.isnan(kind)
        if not is_none and kind != dialect.MAV_ROI_LOCATION:
            raise Refused(texts.ROI, texts.ROI_KINDS, lasting=True)
        if (is_none and place(command) is None) or (command.x == 0.0 and command.y == 0.0):
            self._require_control(command.client)
            await self._roi.stop()
        else:
            await self._look_at_place(command)

    async def _look_beside(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET: param5, 6, 7 deg of pitch, roll, yaw from the path.

        The path is that of the goto under way: the nose turns, and the gimbal looks along it. It is straight.
        """
        _check_device(command.params[0], texts.ROI)
        self._require_control(command.client)
        vehicle, piloting = self.host.vehicle, self.host.drone.piloting.state
        offsets = [0.0 if math.isnan(value) else value for value in (command.x, command.y, command.z)]
        pitch, roll, yaw = offsets
        if any(abs(value) > targets.WIDEST for value in offsets):
            raise Refused(texts.ROI, texts.GIMBAL_ANGLE, lasting=True)
        if vehicle.mission.flying:
            raise Refused(texts.ROI, texts.GIMBAL_OF_MISSION)
        goto, here = vehicle.guided.goto, vehicle.place
        if goto is None or here is None or piloting.altitude is None:
            raise Refused(texts.ROI, texts.ROI_NO_WAYPOINT)
        bearing, elevation = mount.direction(here, goto.place, goto.ato - piloting.altitude)
        await vehicle.guided.go(goto.with_heading(units.wrap_pi(bearing + yaw * units.RAD_PER_DEG)))
        ahead = {Axis.PITCH: elevation * units.DEG_PER_RAD + pitch, Axis.ROLL: roll, Axis.YAW: 0.0}
        await self._move(command, targets.read(mount.HORIZON, ahead, {}))

    # The mount protocol.

    async def _mount_configure(self, command: Command) -> None:
        """Run MAV_CMD_DO_MOUNT_CONFIGURE: param1 MAV_MOUNT_MODE.

        The stabilisation of the picture is always on.
        """
        self._require_control(command.client)
        mode = self._require_mode(command.params[0])
        if mode == dialect.MAV_MOUNT_MODE_NEUTRAL:
            await self._move(command, GimbalTarget(neutral=True))
        elif mode == dialect.MAV_MOUNT_MODE_HOME_LOCATION:
            await self._look_at_home(command)
        self._mount_mode = mode

    async def _mount_control(self, command: Command) -> None:
        """Run MAV_CMD_DO_MOUNT_CONTROL: param7 MAV_MOUNT_MODE, angles (deg) or a place."""
        pitch, roll, yaw, ato = command.params
        mode = self._require_mode(command.z)
        if mode == dialect.MAV_MOUNT_MODE_NEUTRAL:
            await self._move(command, GimbalTarget(neutral=True))
        elif mode == dialect.MAV_MOUNT_MODE_GPS_POINT:
            where = mount.point(command.x, command.y)
            if where is None:
                raise Refused(texts.ROI, texts.NO_PLACE, lasting=True)
            await self._look(command, where, 0.0 if math.isnan(ato) else ato)
        elif mode == dialect.MAV_MOUNT_MODE_SYSID_TARGET:
            await self._look_at_number(command, pitch)
        elif mode == dialect.MAV_MOUNT_MODE_HOME_LOCATION:
            await self._look_at_home(command)
        else:
            angles = {Axis.PITCH: pitch, Axis.ROLL: roll, Axis.YAW: yaw}
            await self._move(command, targets.read(mount.HORIZON, angles, {}))
        self._mount_mode = mode

    def _require_mode(self, mode: float) -> int:
        """Return the MAV_MOUNT_MODE in a parameter; unset, it is that of angles.

        Raises `Unsupported`.
        """
        if mode == dialect.MAV_MOUNT_MODE_RETRACT:
            raise Unsupported(texts.GIMBAL, texts.NO_RETRACT)
        known = dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING if math.isnan(mode) else mode
        if known not in mount.MODES:
            raise Unsupported(texts.GIMBAL, texts.GIMBAL_MODE.fill(mode=mode))
        return int(known)

    async def _look_at_home(self, command: Command) -> None:
        home = self.host.vehicle.home
        if home is None:
            raise Refused(texts.ROI, texts.POSITION_UNKNOWN)
        await self._look(command, home, 0.0)

    def _mount_configured(self, inbound: Inbound) -> None:
        """MOUNT_CONFIGURE has no acknowledgement; it decides what the next MOUNT_CONTROL means."""
        message = inbound.message
        if message.mount_mode == dialect.MAV_MOUNT_MODE_NEUTRAL:
            self._stream(inbound, targets.DEVICES[0], GimbalTarget(neutral=True))
        if message.mount_mode in mount.MODES:
            self._mount_mode = message.mount_mode
        else:
            reason = texts.GIMBAL_MODE.fill(mode=message.mount_mode)
            self.host.warn_throttled(texts.REFUSED.fill(what=texts.GIMBAL, reason=reason))

    def _mount_controlled(self, inbound: Inbound) -> None:
        """MOUNT_CONTROL: cdeg of pitch, roll, yaw; or degE7 and cm above home of a place."""
        message = inbound.message
        if self._mount_mode == dialect.MAV_MOUNT_MODE_GPS_POINT:
            where = GeoPoint(message.input_a / 1e7, message.input_b / 1e7)
            self.host.spawn(self._mount_looks(inbound, where, message.input_c / 100.0))
            return
        angles = {
            Axis.PITCH: message.input_a / 100.0,
            Axis.ROLL: message.input_b / 100.0,
            Axis.YAW: message.input_c / 100.0,
        }
        self._stream(inbound, targets.DEVICES[0], targets.read(mount.HORIZON, angles, {}))

    async def _mount_looks(self, inbound: Inbound, where: GeoPoint, ato: float) -> None:
        try:
            if not self._control.allows((inbound.sysid, inbound.compid)):
                raise Refused(texts.ROI, self._holder)
            await self._rest()
            await self._roi.look_at(where, ato)
        except AnafiMavError as error:
            self.host.warn_throttled(error.text if isinstance(error, Refused) else texts.from_below(error))


def _check_device(id: float, subject: OperatorText = texts.GIMBAL) -> None:
    """Raise `Refused` for a gimbal device that there is not."""
    if not targets.is_device(id):
        raise Refused(subject, texts.NO_SUCH_GIMBAL.fill(number=id), lasting=True)


def _refusal(reason: OperatorText) -> Refused:
    if reason is texts.NO_RETRACT:
        return Unsupported(texts.GIMBAL, reason)
    return Refused(texts.GIMBAL, reason, lasting=reason is not texts.HEADING_UNKNOWN)

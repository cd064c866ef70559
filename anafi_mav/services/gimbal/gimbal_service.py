"""Gimbal manager of component 1 (MAVLink gimbal_v2.md, device id 1), and older mounts.

`control` decides which client may move the gimbal, `targets` reads angles and rates, `motion` carries them out, `rates`
ends a rate, `roi` looks at places. A command is ACCEPTED when the drone reports that the gimbal turns as commanded, or
has arrived: stations send the next command after the acknowledgement, and operators turn on before the gimbal rests.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping

from msgspec.structs import replace

from anafi_mav import texts, units
from anafi_mav.drone import GimbalState
from anafi_mav.drone.events import Axis, GimbalAttitudeChanged
from anafi_mav.drone.values import Values
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect, ProgressPolicy
from anafi_mav.services.dropped_inputs import InputStream
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.gimbal import gimbal_messages, mount, targets
from anafi_mav.services.gimbal.control import NO_CLIENT, Answer, ClientId, GimbalControl, Heartbeats
from anafi_mav.services.gimbal.motion import GimbalMotion
from anafi_mav.services.gimbal.roi import Region, RegionOfInterest
from anafi_mav.services.gimbal.targets import Frames, GimbalTarget
from anafi_mav.services.service import LOOK_EVERY, Host, MessageHandler, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import NotInControl, Refused, Unsupported, reason_of
from anafi_mav.vehicle.base.right import Extent
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.operator_control import Need
from anafi_mav.vehicle.vehicle import Vehicle

HOVERING = (FlightMode.HOLD, FlightMode.GUIDED, FlightMode.POSITION)
"""Modes without a flight of the drone's own."""


def client_id(client: object) -> ClientId:
    """Return system and component of a `Command.client`."""
    if isinstance(client, tuple) and len(client) == 3:
        return (client[1], client[2])
    raise ValueError(f"not a client: {client!r}")


class GimbalService(Service):
    """Gimbal of one vehicle, as a MAVLink gimbal manager."""

    is_watch = True

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._heartbeats = Heartbeats()
        self._control = GimbalControl(self._heartbeats)
        self._roi = RegionOfInterest(host)
        self._motion = GimbalMotion(host, self._heartbeats, self._roi)
        self._mount_mode = dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING
        """Of MOUNT_CONFIGURE: decides what a MOUNT_CONTROL means."""
        self._mount_place: tuple[Inbound, GeoPoint, float] | None = None
        """The newest MOUNT_CONTROL that is still to be looked at, its place and height (m above take-off)."""
        self._mount_look: asyncio.Task[None] | None = None
        self._status: tuple[object, ...] = ()
        """Content of the last GIMBAL_MANAGER_STATUS."""

    # Tables.

    def capabilities(self) -> int:
        return dialect.MAV_PROTOCOL_CAPABILITY_COMPONENT_IMPLEMENTS_GIMBAL_MANAGER

    def actions(self) -> Mapping[int, Action]:
        # MAVSDK's gimbal plugin takes an IN_PROGRESS for a failure (gimbal_impl.cpp, receive_command_result).
        late = ProgressPolicy.LATE

        def aim(
            handler: mount.Handler, group: ActionGroup | Callable[[Command], ActionGroup] = ActionGroup.GIMBAL
        ) -> Action:
            return Action(
                handler,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.TARGET,
                progress=late,
                group=group,
            )

        def look(
            handler: mount.Handler, altitude: Altitude = Altitude.UNUSED, effect: Effect = Effect.TARGET
        ) -> Action:
            has_location = altitude is not Altitude.UNUSED
            return Action(handler, location=has_location, altitude=altitude, effect=effect, progress=late)

        return {
            dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: aim(self._pitch_yaw),
            dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: aim(self._configure),
            dialect.MAV_CMD_DO_MOUNT_CONFIGURE: aim(self._mount_configure, mount.group_of_configure),
            dialect.MAV_CMD_DO_MOUNT_CONTROL: aim(self._mount_control, mount.group_of_control),
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

        def heading(vehicle: Vehicle) -> float | None:
            body = vehicle.drone.piloting.state.attitude
            return None if body is None else body.yaw

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
                lambda vehicle, times: gimbal_messages.attitude_status(
                    gimbal(vehicle), times, neutral=self._motion.is_neutral
                ),
                attitude,
                every=0.1,
                from_pictures=True,
            ),
            dialect.MAVLINK_MSG_ID_MOUNT_ORIENTATION: MessageStream(
                lambda vehicle, times: gimbal_messages.mount_orientation(gimbal(vehicle), heading(vehicle), times),
                attitude,
                every=0.2,
                spared=True,
            ),
            dialect.MAVLINK_MSG_ID_MOUNT_STATUS: MessageStream(
                lambda vehicle, times: gimbal_messages.mount_status(gimbal(vehicle), self._mount_mode), attitude
            ),
        }

    # The link, clients and time.

    def uses_target(self, inbound: Inbound) -> bool:
        """Return True for the position of the system at which the gimbal looks."""
        return inbound.id == dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT and self._roi.looks_at(inbound.sysid)

    def link_up(self) -> None:
        self._motion.link_up()
        self._roi.link_up()

    def link_down(self) -> None:
        self._motion.link_down()
        self._control = GimbalControl(self._heartbeats)
        self._roi.link_down()
        self._mount_look = self._mount_place = None
        self._status = ()

    def heartbeat(self, inbound: Inbound) -> None:
        kept = {self._control.primary, self._control.secondary, self._motion.turner}
        self._heartbeats.receive((inbound.sysid, inbound.compid), inbound.now, kept)

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_attitude: ValueInterest((GimbalAttitudeChanged,))}

    def _on_attitude(self, values: Values, now: float) -> None:
        if self._motion.watch_attitude(values):
            self.host.look_soon()

    def host_stalled(self, seconds: float) -> None:
        self._heartbeats.add_stall(seconds)
        self._control.add_stall(seconds)
        self._motion.add_stall(seconds)

    def tick(self, now: float) -> float:
        self._watch_control(now)
        self._motion.tick(now)
        self._roi.tick(now)
        self._announce()
        moves = self._motion.is_active or self._roi.follows
        return now + LOOK_EVERY if moves else self._control.expires_at

    def _watch_control(self, now: float) -> None:
        self._watch_mission()
        silent = self._control.expire(now)
        if silent is not None:
            self.host.text(Severity.NOTICE, texts.GIMBAL_RELEASED.fill(system=silent[0]))
            if self._motion.turner == silent:
                self._motion.end_rates()

    def _watch_mission(self) -> None:
        """Give the gimbal to the mission that is flown while it needs it."""
        if self._control.mission(needs_gimbal=self.host.vehicle.mission_needs_gimbal) and self._control.is_of_mission:
            self._roi.forget_system()
            self._motion.leave_to_mission()

    def _manager_status(self, times: Times) -> dialect.MAVLink_message | None:
        gimbal = self.host.drone.gimbal.main
        return gimbal_messages.manager_status(
            gimbal, self._control, self.host.sysid, times, neutral=self._motion.is_neutral
        )

    def _announce(self) -> None:
        """Send GIMBAL_MANAGER_STATUS at once when control or a flag has changed."""
        control, gimbal = self._control, self.host.drone.gimbal.main
        flags = gimbal_messages.device_flags(gimbal, neutral=self._motion.is_neutral)
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
        if answer is Answer.NO_PRIMARY:
            raise Refused(texts.GIMBAL, texts.GIMBAL_NO_PRIMARY)
        self._end_of_others(client_id(command.client))
        self._announce()

    def _end_of_others(self, sender: ClientId) -> None:
        """End a rate that its sender releases, and the targets of clients without control."""
        if self._motion.turner == sender and sender not in (self._control.primary, self._control.secondary):
            self._motion.end_rates()
        self._motion.end_unless(self._control.allows)

    def _require_control(self, client: object) -> ClientId:
        """Return the id of a client that may move the gimbal. Raises `Refused` for another one."""
        known = client_id(client)
        self._watch_mission()
        if not self._control.allows(known):
            raise Refused(texts.GIMBAL, self._objection(known))
        return known

    def _objection(self, client: ClientId) -> OperatorText:
        """Return why this client may not move the gimbal."""
        if self._control.is_of_mission:
            return texts.GIMBAL_OF_MISSION
        if client == NO_CLIENT:
            return texts.GIMBAL_NO_CLIENT
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
        """Return the reading of GIMBAL_MANAGER_FLAGS.

        The heading is the gimbal's own: of the same moment and north as the yaw that it reports and takes.
        """
        attitude = self.host.drone.gimbal.main.attitude
        heading = None if attitude is None else targets.wrap_180(attitude.absolute.yaw - attitude.relative.yaw)
        known = int(flags) if math.isfinite(flags) and flags >= 0.0 else 0
        return Frames(known, flavour.gimbal_keeps_horizon, heading)

    async def _move(self, command: Command, target: GimbalTarget | OperatorText) -> None:
        """Carry out the target of a command; return when the drone turns the gimbal."""
        if isinstance(target, str):
            raise _refusal(target)
        await self._motion.move(self._require_control(command.client), target)

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
        """Carry out the target of a message; a refusal is a text to its sender.

        Zero rates of a client that may not move the gimbal are not refused: they are those of centred sticks.
        """
        client = (inbound.sysid, inbound.compid)
        if not targets.is_device(device):
            self._drop(inbound, texts.NO_SUCH_GIMBAL.fill(number=device))
        elif isinstance(target, OperatorText):
            self._drop(inbound, target)
        elif not self._control.allows(client) or self._motion.is_calibrating:
            if not target.is_zero_rate:
                allowed = self._control.allows(client)
                self._drop(inbound, texts.GIMBAL_CALIBRATES if allowed else self._objection(client))
        else:
            try:
                self._motion.stream(client, target, lambda reason: self._drop(inbound, reason))
            except AnafiMavError as error:
                self._drop(inbound, reason_of(error))
            else:
                self.host.use_input(inbound.client, InputStream.GIMBAL)

    def _drop(self, inbound: Inbound, reason: OperatorText) -> None:
        self.host.drop_input(inbound.client, InputStream.GIMBAL, reason)

    # Regions of interest.

    async def _look_at(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI_LOCATION: nose and camera follow the place.

        They do so until something else is flown (Parrot's piloted POI, which needs a hovering drone and waits for
        it). An unset height is that of the take-off point.
        """
        _check_device(command.params[0], texts.ROI)
        await self._look_at_place(command)

    async def _look_at_place(self, command: Command) -> None:
        where = command.place()
        if where is None:
            raise Refused(texts.ROI, texts.NO_PLACE, lasting=True)
        if command.frame is None and command.flavour.relative_long_regions:
            command = replace(command, frame=dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT)
        await self._look(command, where, command.height(self.host.vehicle, flown=False) or 0.0)

    async def _look(self, command: Command, where: GeoPoint, ato: float) -> None:
        region = await self._prepare_region(command)
        await self._roi.look_at(region, where, ato)

    async def _prepare_region(self, command: Command) -> Region:
        """Return an attempt to look at a place, once no take-off is under way and the gimbal rests."""
        self._require_control(command.client)
        await self._roi.takeoff_over()
        self._require_control(command.client)
        region = self._roi.prepare(command.right)
        await self._motion.rest()
        return region

    async def _look_at_system(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI_SYSID: param1 system, param2 gimbal device."""
        _check_device(command.params[1], texts.ROI)
        await self._look_at_number(command, command.params[0])

    async def _look_at_number(self, command: Command, system: float) -> None:
        self._require_control(command.client)
        self._roi.position_of(system)
        region = await self._prepare_region(command)
        await self._roi.look_at_system(region, system)

    async def _look_anywhere(self, command: Command) -> None:
        """Run MAV_CMD_DO_SET_ROI_NONE: param1 gimbal device."""
        _check_device(command.params[0], texts.ROI)
        await self._end_region(command)

    async def _end_region(self, command: Command) -> None:
        """End a region of interest, a flight task that needs a role, too."""
        system = self._require_control(command.client)[0]
        reason = self.host.vehicle.operators.objection(system, Need.COMMAND) if self._roi.is_active else None
        if reason is not None:
            raise NotInControl(texts.ROI, reason)
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
        if (is_none and command.place() is None) or (command.x == 0.0 and command.y == 0.0):
            await self._end_region(command)
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
        if vehicle.control.active is vehicle.mission:
            raise Refused(texts.ROI, texts.GIMBAL_OF_MISSION)
        goto, here = vehicle.guided.goto, vehicle.place
        if goto is None or here is None or piloting.altitude is None:
            raise Refused(texts.ROI, texts.ROI_NO_WAYPOINT)
        self._motion.require_ready()
        bearing, elevation = mount.direction(here, goto.place, goto.ato - piloting.altitude)
        turned = goto.with_heading(units.wrap_pi(bearing + yaw * units.RAD_PER_DEG))
        await vehicle.guided.go(turned, by=command.right)
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
        mode, client = inbound.message.mount_mode, (inbound.sysid, inbound.compid)
        if not self._control.allows(client):
            self._drop(inbound, self._objection(client))
            return
        if mode == dialect.MAV_MOUNT_MODE_NEUTRAL:
            self._stream(inbound, targets.DEVICES[0], GimbalTarget(neutral=True))
        if mode in mount.MESSAGE_MODES:
            self._mount_mode = mode
        else:
            self._drop(inbound, texts.GIMBAL_MODE.fill(mode=mode))

    def _mount_controlled(self, inbound: Inbound) -> None:
        """MOUNT_CONTROL: cdeg of pitch, roll, yaw; or degE7 and cm above home of a place."""
        message = inbound.message
        if self._mount_mode == dialect.MAV_MOUNT_MODE_GPS_POINT:
            where = GeoPoint(message.input_a / 1e7, message.input_b / 1e7)
            self._mount_place = inbound, where, message.input_c / 100.0
            if self._mount_look is None or self._mount_look.done():
                self._mount_look = self.host.run_action(inbound.client, self._look_for_mount())
        elif self._mount_mode == dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING:
            angles = {
                Axis.PITCH: message.input_a / 100.0,
                Axis.ROLL: message.input_b / 100.0,
                Axis.YAW: message.input_c / 100.0,
            }
            self._stream(inbound, targets.DEVICES[0], targets.read(mount.HORIZON, angles, {}))
        else:
            self._drop(inbound, texts.GIMBAL_MODE.fill(mode=self._mount_mode))

    async def _look_for_mount(self) -> None:
        """Look at the newest place of MOUNT_CONTROL, which may arrive often; at the same place once.

        A stream of them never ends what flies the drone, which would begin again with each command of a client.
        """
        task, inbound = asyncio.current_task(), None
        try:
            while self._mount_place is not None:
                inbound, where, ato = self._mount_place
                self._mount_place = None
                client = (inbound.sysid, inbound.compid)
                if not self._control.allows(client):
                    raise Refused(texts.ROI, self._objection(client))
                if not self._roi.is_locked_on(where, ato):
                    region = self._roi.prepare(self.host.vehicle.right(inbound.client, Extent.COMMANDED))
                    vehicle = self.host.vehicle
                    if not self._roi.is_active and (vehicle.mode not in HOVERING or vehicle.overridable):
                        raise Refused(texts.ROI, texts.DRONE_FLIES)
                    await self._motion.rest()
                    await self._roi.look_at(region, where, ato)
                self.host.use_input(inbound.client, InputStream.REGION)
        except AnafiMavError as error:
            if inbound is not None:
                self.host.drop_input(inbound.client, InputStream.REGION, reason_of(error))
        finally:
            if self._mount_look is task:
                self._mount_look = self._mount_place = None


def _check_device(id: float, subject: OperatorText = texts.GIMBAL) -> None:
    """Raise `Refused` for a gimbal device that there is not."""
    if not targets.is_device(id):
        raise Refused(subject, texts.NO_SUCH_GIMBAL.fill(number=id), lasting=True)


def _refusal(reason: OperatorText) -> Refused:
    if reason is texts.NO_RETRACT:
        return Unsupported(texts.GIMBAL, reason)
    return Refused(texts.GIMBAL, reason, lasting=reason is not texts.HEADING_UNKNOWN)

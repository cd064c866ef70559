"""One MAVLink system: the components of one drone on every channel while its link is up.

Messages come in from the node by their addressing, answers go back to the asking channel alone, streams go to
every channel at its own rate. While the drone's link is down the system sends no heartbeat and no telemetry, and
commands are answered with FAILED.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Coroutine, Hashable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from anafi_mav import texts
from anafi_mav.clock import NEVER, Alarm, Clock, Schedule, YieldingCall
from anafi_mav.drone import Drone, events
from anafi_mav.drone.events import Message
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.status.battery import Battery
from anafi_mav.drone.status.link import Link
from anafi_mav.drone.values import VALUES
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import COMMANDS
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import Batch
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.services.camera.camera_service import CameraService
from anafi_mav.services.camera.capture_service import CaptureService
from anafi_mav.services.camera.panorama_service import PanoramaService
from anafi_mav.services.camera.storage_service import StorageService
from anafi_mav.services.camera_definition.param_ext_service import ParamExtService
from anafi_mav.services.command.calibration_service import CalibrationService
from anafi_mav.services.command.command_service import SETTLE, RunningActions
from anafi_mav.services.command.compass_service import CompassService
from anafi_mav.services.command.flight_service import FlightService
from anafi_mav.services.command.guided_service import GuidedService
from anafi_mav.services.command.modes_service import ModesService
from anafi_mav.services.command.operator_need import stop_of
from anafi_mav.services.command.orbit_service import OrbitService
from anafi_mav.services.commands import Effect
from anafi_mav.services.component import BY_AUTOPILOT, Component, joined
from anafi_mav.services.dropped_inputs import DroppedInputs, InputStream
from anafi_mav.services.event.event_service import EventService
from anafi_mav.services.ftp.log_service import LogService
from anafi_mav.services.gateway_uris import GatewayUris
from anafi_mav.services.gimbal.gimbal_service import GimbalService
from anafi_mav.services.ground_station.banner_service import BannerService
from anafi_mav.services.ground_station.identity_service import IdentityService
from anafi_mav.services.ground_station.node_status_service import NodeStatusService
from anafi_mav.services.ground_station.operator_control_service import OperatorControlService
from anafi_mav.services.ground_station.shell_service import ShellService
from anafi_mav.services.ground_station.time_service import TimeService
from anafi_mav.services.ground_station.tune_service import TuneService
from anafi_mav.services.media.download_service import DownloadService
from anafi_mav.services.media.media_service import MediaService
from anafi_mav.services.memory import Memory
from anafi_mav.services.monitor import takeoff_point_service
from anafi_mav.services.monitor.aborted_return_service import AbortedReturnService
from anafi_mav.services.monitor.controller_input_service import ControllerInputService
from anafi_mav.services.monitor.link_loss_service import LinkLossService
from anafi_mav.services.monitor.pilot_service import PilotService
from anafi_mav.services.monitor.roll_sign_service import RollSignService
from anafi_mav.services.monitor.takeoff_point_service import TakeoffPointService
from anafi_mav.services.monitor.warning_service import WarningService
from anafi_mav.services.parameter.parameter_service import ParameterService
from anafi_mav.services.payload_history import PayloadHistory
from anafi_mav.services.plan.fence_service import FenceService
from anafi_mav.services.plan.mission_service import MissionService
from anafi_mav.services.plan.plan_service import PlanService
from anafi_mav.services.plan.rally_service import RallyService
from anafi_mav.services.pose import UNKNOWN_POSE, VehiclePose, reported_pose
from anafi_mav.services.service import LOOK_EVERY, Service, channel_of
from anafi_mav.services.setpoint.follow_service import FollowService
from anafi_mav.services.setpoint.manual_control_service import ManualControlService
from anafi_mav.services.setpoint.offboard_service import OffboardService
from anafi_mav.services.statustext import TextNumbers
from anafi_mav.services.stream import Times
from anafi_mav.services.system_position import PositionOf, SystemPosition, unknown_position
from anafi_mav.services.telemetry.flight_record_service import FlightRecordService
from anafi_mav.services.telemetry.high_latency_service import HighLatencyService
from anafi_mav.services.telemetry.telemetry_service import CHANGES, TelemetryService
from anafi_mav.services.telemetry.video_service import VideoTelemetryService
from anafi_mav.services.video.video_stream_service import VideoStreamService
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.height import TakeoffRecord
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.right import system_of
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import (
    EventHandler,
    Subscriptions,
    ValueHandlers,
    ValueSubscriptions,
    in_order,
)
from anafi_mav.vehicle.failsafe_settings import FailsafeLimits
from anafi_mav.vehicle.vehicle import Vehicle, VehicleStatus

logger = logging.getLogger(__name__)

AUTOPILOT_SERVICES: tuple[type[Service], ...] = (
    FlightService,
    IdentityService,
    ModesService,
    GuidedService,
    CalibrationService,
    CompassService,
    OrbitService,
    GimbalService,
    TelemetryService,
    ParameterService,
    LinkLossService,
    EventService,
    PlanService,
    MissionService,
    FenceService,
    RallyService,
    RollSignService,
    OffboardService,
    ManualControlService,
    FollowService,
    TimeService,
    BannerService,
    WarningService,
    AbortedReturnService,
    HighLatencyService,
    LogService,
    ShellService,
    TuneService,
    NodeStatusService,
    FlightRecordService,
    TakeoffPointService,
    VideoTelemetryService,
    PilotService,
    ControllerInputService,
    OperatorControlService,
)
"""Services of component 1, beside commands, messages and files themselves."""

CAMERA_SERVICES: tuple[type[Service], ...] = (
    CameraService,
    CaptureService,
    PanoramaService,
    StorageService,
    VideoStreamService,
    ParamExtService,
    MediaService,
    DownloadService,
)
"""Services of component 100."""

AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1
CAMERA = dialect.MAV_COMP_ID_CAMERA

ABSENT = frozenset({dialect.MAV_COMP_ID_WINCH})
"""Components that no ANAFI has and whose commands are answered all the same: MAVSDK sends DO_WINCH to the winch, waits
for an answer from there and repeats it for seconds. Not a camera or a gimbal: clients take an answer for its presence.
"""

HEARTBEAT_EVERY = 1.0
"""s (MAVLink heartbeat.md)."""

MISSION_OVER = 0.25
"""s after the end of a mission before a heartbeat says Hold. A return or landing that follows by itself, at the end of
the plan or for a low battery, is reported by then, and stations announce one change of mode instead of two."""

SAMPLES: frozenset[type[Message]] = frozenset(
    {
        events.AltitudeAboveGroundChanged,
        events.AltitudeChanged,
        events.AttitudeChanged,
        events.GimbalAttitudeChanged,
        events.GpsLocationChanged,
        events.SpeedChanged,
        *Battery.SAMPLES,
        *Camera.SAMPLES,
        *Link.SAMPLES,
    }
)
"""Events that a drone sends all the time. What follows from one is done by its handlers."""

EARLY = 1e-6
"""s by which a timer may call too early: asyncio compares times with its clock's resolution."""

SHORTEST = 0.001
"""s between two ticks of a service, however often it wants to be called."""

DESCENT_WAIT = 1.5
"""s that a landing or return may take to be confirmed when the gateway ends: it is not withdrawn."""

STATUS_EVERY = 5.0
"""s before the same throttled warning is repeated."""

MAX_WARNINGS = 100
"""Different throttled warnings whose age is remembered."""


class System:
    """The MAVLink side of one drone."""

    def __init__(
        self,
        node: Node,
        drone: Drone,
        sysid: int,
        clock: Clock,
        started: float,
        *,
        allow_kill: bool,
        state: Path | None = None,
        download_folder: Path | None = None,
        uris: GatewayUris = GatewayUris(),  # noqa: B008  # frozen
        has_picture_pose: bool = True,
        failsafe_limits: FailsafeLimits = FailsafeLimits(),  # noqa: B008  # frozen
        position_of: PositionOf = unknown_position,
    ) -> None:
        """`state`: folder of stored state.

        `download_folder`: for copies of the drone's media after a landing; None: they are not copied.
        """
        self.sysid = sysid
        self.has_picture_pose = has_picture_pose
        self.failsafe_limits = failsafe_limits
        self.position_of = position_of
        self.payload_history = PayloadHistory()
        self.notices: dict[OperatorText, None] = {}
        """Texts that are true whatever the drone does: a client that connects later gets them with its banner."""
        self.drone = drone
        self.clock = clock
        self.memory = Memory(state, partial(self.text, Severity.WARNING))
        self.download_folder = download_folder
        self.uris = uris
        self.active = False
        self.absence: OperatorText | None = None
        """Text to senders of commands about why the drone is not connected, where there is more to say."""
        self._node = node
        self._started = started
        self._texts = TextNumbers()
        self._undo: Sequence[Callable[[], None]] = ()
        """Functions that end the subscriptions to the drone's events."""
        self._ticker = Alarm(self._tick)
        self._turn = YieldingCall(self._tick_others)
        self._waits_for_turn = False
        self._stalled = 0.0
        """How long the host had stalled at the last tick, s."""
        self._tasks: set[asyncio.Task[None]] = set()
        self._last_status: VehicleStatus | None = None
        self._next_heartbeat = 0.0
        self._mission_over = Alarm(self._show_mode)
        """Runs while heartbeats still say Mission."""
        self._warned_at: dict[str, float] = {}
        self._dropped = DroppedInputs()
        self.use_input = self._dropped.use
        self._muted: set[Channel] = set()
        self._addressed: tuple[Sequence[Channel], Sequence[Channel]] = ([], [])
        """The open channels when it was last looked, and those of them that this system sends to."""
        self._unproved: Sequence[Channel] = []
        """The channels whose peers have not proved to be at their address: they get heartbeats and answers alone."""
        self._has_filters = False
        """True while one of these has a filter of messages."""
        self.vehicle = Vehicle(
            drone,
            clock,
            allow_kill=allow_kill,
            text=self.text,
            changed=self._changed,
        )
        self.running = RunningActions(self.vehicle.control.actions)
        self._autopilot: Component = Component(self, AUTOPILOT, AUTOPILOT_SERVICES)
        camera = Component(self, CAMERA, CAMERA_SERVICES)
        self.definition = camera.definition
        """The definition of the camera."""
        self.components = (self._autopilot, camera)
        """The autopilot is the first: the others' services build on what its services make of an event."""
        self.services: list[Service] = [service for component in self.components for service in component.services]
        camera.take_tables({})
        self._autopilot.take_tables(joined(service.autopilot_actions() for service in camera.services))
        for component in self.components:
            node.add_telemetry(component.telemetry)
        for service in self._autopilot.services:
            if isinstance(service, PlanService):
                service.take_tables(joined(service.item_commands() for service in self._autopilot.services))
        ticking = [service for service in self.services if type(service).tick is not Service.tick]
        self._watches = Schedule(service for service in ticking if service.is_watch)
        self._others = Schedule(service for service in ticking if not service.is_watch)
        self._on_change = [
            service for service in self.services if type(service).state_changed is not Service.state_changed
        ]
        self._subscribed: dict[type[Message], tuple[EventHandler, ...]] = {}
        """The handlers of each kind of event, in the order in which they are called."""
        self._on_command: Callable[[Inbound], None] | None = None
        """Called with each command while the drone is not connected."""
        node.add_absent_host(sysid, self._receive_absent)

    @property
    def position(self) -> SystemPosition | None:
        """Position of the drone by its newest events; None while it is disconnected or unplaced."""
        pose = reported_pose(self.vehicle)
        place, amsl = pose.place, pose.amsl(self.vehicle)
        if not self.active or place is None or amsl is None:
            return None
        return SystemPosition(place, amsl, self.clock.monotonic())

    # Link up, link down.

    async def load_memory(self) -> OperatorText | None:
        """Read what is stored about the connected drone, before `link_up`.

        Returns a line for people when that could not be read.
        """
        return await self.memory.load(self.drone.identity.serial)

    def link_up(self, memory_problem: OperatorText | None) -> None:
        """Make the system appear: the drone is connected and has sent all its states.

        `memory_problem`: see `load_memory`.
        """
        self.active = True
        for component in self.components:
            self._node.add_host(self.sysid, component.compid, component.receive)
        for compid in ABSENT:
            self._node.add_host(self.sysid, compid, self._refuse)
        self._last_status = None
        if memory_problem is not None:
            self.text(Severity.WARNING, memory_problem)
        self.vehicle.link_up(TakeoffRecord.read(self.memory.settings.get(takeoff_point_service.KEY)))
        for service in self.services:
            service.link_up()
        self._subscribe()
        self._changed()
        now, self._stalled = self.clock.monotonic(), self._node.stalled
        self._next_heartbeat = NEVER  # a second after the first tick: with the messages that are repeated every second
        self._bring_forward(now)
        self._ticker.set(now)

    async def settle(self) -> None:
        """End the commands that wait for the drone: the link is lost, but the system still exists."""
        await self._settle()

    def link_down(self) -> None:
        """Notify waiting clients that the link is lost, then make the system silent."""
        if not self.active:
            return
        for undo in self._undo:
            undo()
        self._undo = ()
        self._ticker.cancel()
        self._turn.cancel()
        self._waits_for_turn = False
        self._mission_over.cancel()
        for service in self.services:
            service.link_down()
        for task in tuple(self._tasks):
            task.cancel()
        self.vehicle.link_down()
        self._dropped.forget(lambda client: True)
        self.active = False
        self._node.remove_hosts(self.sysid)

    async def let_go(self) -> None:
        """Prepare for the end of the gateway: leave a flying drone hovering, returning or landing.

        It returns or lands only where it does that already. Messages of clients must not be received any longer.
        """
        if not self.active:
            return
        if self.vehicle.descends:
            await self._settle(DESCENT_WAIT)
        else:
            await asyncio.gather(*(component.commands.end_all() for component in self.components))
        await self.vehicle.let_go()

    async def _settle(self, limit: float = SETTLE) -> None:
        await asyncio.gather(*(component.commands.settle(limit) for component in self.components))

    # For its components.

    @property
    def channels(self) -> Sequence[Channel]:
        """The open channels that have this system.

        Without the muted ones, and without those whose peers have not proved to be at their address.
        """
        everybody, sending = self._addressed
        if everybody is not self._node.channels:  # a new list whenever they change
            everybody = self._node.channels
            shown = [channel for channel in everybody if channel.has_system(self.sysid) and channel not in self._muted]
            sending = [channel for channel in shown if channel.proof is None]
            self._addressed, self._unproved = (
                (everybody, sending),
                [channel for channel in shown if channel.proof is not None],
            )
            self._has_filters = any(channel.message_filter is not None for channel in sending)
        return sending

    def set_muted(self, channel: Channel, *, muted: bool) -> None:
        """Send only answers on this channel; with False everything again."""
        if muted:
            self._muted.add(channel)
        else:
            self._muted.discard(channel)
        self._addressed = ([], [])
        self.look_soon()

    def stop_of(self, inbound: Inbound) -> Effect | None:
        """Return the effect of a message that stops the flight; None for any other."""
        is_command = inbound.id in COMMANDS
        component = self.owner(inbound.message) if is_command else self._autopilot
        return stop_of(inbound, component.commands.action_of)

    def uses_target(self, inbound: Inbound) -> bool:
        """Return True while the drone follows this target or looks at it; the message names none."""
        return any(service.uses_target(inbound) for service in self.services)

    def owner(self, message: Any) -> Component:
        """Return the component that answers this message to component 0.

        It is a command, or a message that several components handle. The autopilot answers for commands that no
        component has.
        """
        if message.get_msgId() in BY_AUTOPILOT:
            return self._autopilot
        return next((component for component in self.components if component.owns(message)), self._autopilot)

    def send_as(
        self, compid: int, message: dialect.MAVLink_message, to: Channel | Sequence[Channel] | None, *, give_way: bool
    ) -> None:
        """Send as this component to one channel, to some, or to all (None).

        Nothing is sent while the link is down.
        """
        if self.active:
            channels = self.channels if to is None else to
            if give_way and self._has_filters and not isinstance(channels, Channel):
                channels = [channel for channel in channels if channel.can_stream(message.get_msgId())]
            self._node.send(message, sysid=self.sysid, compid=compid, to=channels, give_way=give_way)

    def send_batch(self, batch: Batch, to: Sequence[Channel]) -> None:
        """Send messages of streams to channels that have them.

        Nothing is sent while the link is down.
        """
        if self.active:
            self._node.send_batch(batch, to)

    def text(self, severity: Severity, text: OperatorText, to: Channel | None = None) -> None:
        """A STATUSTEXT to all channels, and a line in the log; or to one channel alone."""
        if to is None:
            logger.log(
                logging.WARNING if severity <= Severity.WARNING else logging.INFO, "%s: %s", self.drone.name, text
            )
        if self.active:
            for message in self._texts.messages(severity, text):
                self._autopilot.send(message, to)

    def announce(self, severity: Severity, text: OperatorText) -> None:
        """Send a STATUSTEXT about the drone's link to every client, also while that link is down."""
        for message in self._texts.messages(severity, text):
            self._node.send(message, sysid=self.sysid, compid=AUTOPILOT, to=self.channels)

    def set_notice(self, text: OperatorText, *, is_true: bool) -> None:
        """Send a critical text to every client, and to those that connect later while it is true."""
        if is_true:
            self.notices[text] = None
            self.announce(Severity.CRITICAL, text)
        else:
            self.notices.pop(text, None)

    def warn_throttled(self, text: OperatorText) -> None:
        """Send a warning on a frequent event, at most every `STATUS_EVERY` seconds.

        Such an event arrives many times a second.
        """
        now = self.clock.monotonic()
        if now - self._warned_at.get(text, -math.inf) < STATUS_EVERY:
            return
        if len(self._warned_at) >= MAX_WARNINGS:
            self._warned_at.clear()
        self._warned_at[text] = now
        self.text(Severity.WARNING, text)

    def drop_input(self, client: Hashable, stream: InputStream, reason: OperatorText) -> None:
        """Note that an input of a stream is not flown; its sender alone gets a text, if due."""
        report = self._dropped.drop(client, stream, reason, self.clock.monotonic())
        if report is None:
            return
        logger.warning("%s: system %s: %s", self.drone.name, system_of(client), report.text)
        if (channel := channel_of(client)) is not None:
            self.text(report.severity, report.text, channel)

    def spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Run in the background; cancelled when the drone's link goes down."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._done)
        return task

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        self.look_soon()

    def look_soon(self) -> None:
        """Have the services tick within `LOOK_EVERY`: something has happened."""
        at = self.clock.monotonic() + LOOK_EVERY
        is_sooner = at < self._watches.all_at or at < self._others.all_at
        if is_sooner and self.active and self._bring_forward(at):
            self._set_ticker()

    def times(self, at: float | None = None, pose: VehiclePose = UNKNOWN_POSE) -> Times:
        """A moment of the monotonic clock (None: now) in the clock of this system's messages."""
        ns = round(((self.clock.monotonic() if at is None else at) - self._started) * 1e9)
        return Times(ns, ns // 1_000, ns // 1_000_000 & 0xFFFFFFFF, pose=pose)

    # The heart.

    @property
    def _greeted(self) -> Sequence[Channel]:
        """The channels that get heartbeats."""
        channels = self.channels
        return [*channels, *self._unproved] if self._unproved else channels

    def send_heartbeat(self, status: VehicleStatus | None = None) -> None:
        """Send one more HEARTBEAT of the autopilot to all.

        `status`: that of this moment, where it is known.
        """
        self._send_heartbeat(self._greeted, status or self.vehicle.status)

    def _send_heartbeat(self, to: Sequence[Channel], status: VehicleStatus) -> None:
        base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if status.is_armed:
            base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED
        mode = FlightMode.MISSION if self._mission_over.at is not None else status.mode
        health = status.health.value
        self._autopilot.send_by_flavour(
            lambda flavour: dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_QUADROTOR, flavour.autopilot, base, flavour.custom_mode(mode), health, 3
            ),
            to,
        )

    def _send_heartbeats(self) -> None:
        """Send the heartbeats of all components, the autopilot's last.

        pymavlink's `set_mode` takes the flavour from the latest heartbeat of a system, whatever component it is of.
        """
        for component in self.components:
            if component is not self._autopilot:
                component.send(
                    dialect.MAVLink_heartbeat_message(
                        dialect.MAV_TYPE_CAMERA, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
                    ),
                    self._greeted,
                )
        self.send_heartbeat()

    def _tick(self) -> None:
        """Send due heartbeats and run due watches. The other services wait for their turn."""
        if not self.active:
            return
        now = self.clock.monotonic() + EARLY
        try:
            if self._next_heartbeat == NEVER:
                self._next_heartbeat = now + HEARTBEAT_EVERY
            elif now >= self._next_heartbeat:
                self._next_heartbeat = max(self._next_heartbeat + HEARTBEAT_EVERY, now + HEARTBEAT_EVERY / 2)
                self._send_heartbeats()
                self._bring_forward(now)
            self._note_stall()
            self._run(self._watches, now)
            if self.active and now >= self._others.next and not self._waits_for_turn:
                self._waits_for_turn = True
                self._turn.request()
        finally:
            if self.active:
                self._set_ticker()

    def _tick_others(self) -> None:
        """Run the services that wait for their turn among the drones.

        Nearly all of them send messages.
        """
        self._waits_for_turn = False
        if not self.active:
            return
        try:
            self._run(self._others, self.clock.monotonic() + EARLY)
        finally:
            if self.active:
                self._set_ticker()

    def _run(self, schedule: Schedule[Service], now: float) -> None:
        if now >= schedule.next:
            schedule.run(now, lambda service: self._tick_service(service, now))

    def _bring_forward(self, at: float) -> bool:
        """Make every service due at this time (s) at the latest.

        Return True if the time of the next tick may change.
        """
        watches, others = self._watches.bring_forward(at), self._others.bring_forward(at)
        return watches or others

    def _tick_service(self, service: Service, now: float) -> float:
        if not self.active:  # an earlier one has ended the link
            return NEVER
        try:
            return max(service.tick(now), now + SHORTEST)
        except Exception:  # the heartbeat goes on whatever happens to one service
            logger.exception("%s: %s failed", self.drone.name, type(service).__name__)
            return now + LOOK_EVERY

    def _set_ticker(self) -> None:
        at = min(self._next_heartbeat, self._watches.next, NEVER if self._waits_for_turn else self._others.next)
        if at != self._ticker.at:
            self._ticker.set(at)

    def _note_stall(self) -> None:
        """Let the services leave out a stall of the host before they tick."""
        stalled = self._node.stalled
        if stalled > self._stalled:
            seconds, self._stalled = stalled - self._stalled, stalled
            for service in self.services:
                service.host_stalled(seconds)

    # What the drone reports.

    def _subscribe(self) -> None:
        """Begin to receive the drone's events."""
        self._subscribed = in_order(self.subscriptions())
        self._undo = (
            self.drone.subscribe(self._on_event, without=VALUES - self._subscribed.keys()),
            self.drone.subscribe_values(ValueHandlers(self.value_subscriptions()).call),
        )

    def _on_event(self, message: Message, now: float) -> None:
        kind = type(message)
        for handler in self._subscribed.get(kind, ()):
            handler(message, now)
        if kind not in SAMPLES:
            self.look_soon()

    def subscriptions(self) -> Iterator[Subscriptions]:
        """Yield all tables of event handlers, in the sequence in which the handlers are called.

        The vehicle is first, because services read its state. Services follow in their order in `self.services`.
        State messages that leave `on_change` are last, because they contain what the services make of the event.
        """
        yield self.vehicle.subscriptions()
        for service in self.services:
            yield service.subscriptions()
        yield dict.fromkeys(CHANGES, lambda message, now: self._changed(force=True))

    def value_subscriptions(self) -> Iterator[ValueSubscriptions]:
        """Yield all tables of handlers of values, in the sequence in which the handlers are called."""
        for service in self.services:
            yield service.value_subscriptions()

    def _changed(self, *, force: bool = False) -> None:
        """Mode, armed state or health may have changed: clients wait for it, so notify them at once.

        The heartbeat is first, but for a disarming: QGroundControl believes a landing of an armed vehicle only
        (Vehicle::_setLanding), so EXTENDED_SYS_STATE and the landing event leave before it.
        """
        if not self.active:
            return
        self.look_soon()
        status, last = self.vehicle.status, self._last_status
        changed = status != last
        if not changed and not force:
            return
        self._last_status = status
        disarmed = last is not None and last.is_armed and not status.is_armed
        if changed:
            self._hold_mode(status, last)
            if not disarmed:
                self.send_heartbeat(status)
        for service in self._on_change:
            service.state_changed()
        if disarmed:
            self.send_heartbeat()

    def _hold_mode(self, status: VehicleStatus, last: VehicleStatus | None) -> None:
        """Keep the mode Mission in HEARTBEAT a little longer after a mission that ended in the air.

        This applies while the drone hovers.
        """
        hovers = status.is_armed and status.mode in (FlightMode.HOLD, FlightMode.GUIDED)
        if self._mission_over.at is not None:
            if not hovers:
                self._mission_over.cancel()
        elif hovers and last is not None and last.mode is FlightMode.MISSION:
            self._mission_over.set_in(MISSION_OVER)

    def _show_mode(self) -> None:
        """The mission is over and nothing has followed."""
        if self.active:
            self.send_heartbeat()

    # What clients send.

    def listen(self, on_command: Callable[[Inbound], None] | None) -> None:
        """Call `on_command` with each command to the system while the drone is not connected.

        Queries are excluded. None ends this. Commands to any of its components count, but not those to all systems.
        """
        self._on_command = on_command

    def _receive_absent(self, inbound: Inbound) -> None:
        """Answer a command, while the drone is not connected, with FAILED and a text.

        A sender without an answer could not know whether its Land is repeated, flown later or lost. Queries are not
        answered: stations send them by themselves, and would take each answer for a sign of the drone.
        """
        message = inbound.message
        if not self._commands_us(message):
            return
        if inbound.is_permitted and self._on_command is not None:
            self._on_command(inbound)
        for text in (texts.COMMAND_WITHOUT_DRONE, self.absence):
            for part in self._texts.messages(Severity.WARNING, text) if text is not None else ():
                self._node.send(part, sysid=self.sysid, compid=AUTOPILOT, to=inbound.channel)
        if inbound.id in COMMANDS:
            compid = message.target_component or self.owner(message).compid
            answer = _answer(inbound, dialect.MAV_RESULT_FAILED)
            self._node.send(answer, sysid=self.sysid, compid=compid, to=inbound.channel)

    def _commands_us(self, message: Any) -> bool:
        """Return True for a command to this system by its id that is no query."""
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_SET_MODE:
            return bool(message.target_system == self.sysid)
        known = message.get_msgId() in COMMANDS and message.target_system == self.sysid
        return known and any(component.commands.acts_on(message.command) for component in self.components)

    def _refuse(self, inbound: Inbound) -> None:
        """Answer a command to one of the components in `ABSENT` alone: it is unsupported."""
        message = inbound.message
        if inbound.id in COMMANDS and message.target_system == self.sysid and message.target_component:
            answer = _answer(inbound, dialect.MAV_RESULT_UNSUPPORTED)
            self._node.send(answer, sysid=self.sysid, compid=message.target_component, to=inbound.channel)

    def channel_opened(self, channel: Channel) -> None:
        """Send the autopilot's heartbeat on a channel that is open, or has a proved address.

        pymavlink's `wait_heartbeat` returns with the first of any component. With the camera's, `target_system` stays
        0: the program's next commands are then for every vehicle.
        """
        self.look_soon()
        if self.active and channel in self._greeted:
            self._send_heartbeat([channel], self.vehicle.status)

    def channel_closed(self, channel: Channel) -> None:
        """A client's channel is gone."""
        self.look_soon()
        self._muted.discard(channel)

        def is_gone(client: Hashable) -> bool:
            return channel_of(client) is channel

        self._dropped.forget(is_gone)
        self.payload_history.forget_clients(is_gone)
        self.vehicle.holds.forget_clients(is_gone)
        for component in self.components:
            component.channel_closed(channel)


def _answer(inbound: Inbound, result: int) -> dialect.MAVLink_command_ack_message:
    return dialect.MAVLink_command_ack_message(
        inbound.message.command, result, target_system=inbound.sysid, target_component=inbound.compid
    )

"""A drone: one connection at a time, and the elements that its events fill.

A value flows: session -> `Drone._receive` -> reducers (new frozen states) -> waiting verbs -> subscribers.
"""

from __future__ import annotations

import asyncio
import contextlib
import enum
import logging
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import Any, TypeAlias, TypeVar

from anafi_mav import models
from anafi_mav.arsdk.codec.secret_fields import without_secrets
from anafi_mav.arsdk.codec.wire import MAX_LAYOUTS, Message, Received, UnknownMessage, ValueLayout, join
from anafi_mav.arsdk.link.controller import ControllerSession, look
from anafi_mav.arsdk.link.handshake import DISCOVERY_PORT, DeviceInfo
from anafi_mav.arsdk.messages import animation, ardrone3, common, drone_manager, follow_me, rth, skyctrl
from anafi_mav.arsdk.messages import flight_plan as modern_plan
from anafi_mav.arsdk.messages.animation import Type as AnimationType
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, PoiStatus
from anafi_mav.arsdk.messages.common import MavlinkType, PlayingState
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.arsdk.messages.follow_me import Mode as FollowMeMode
from anafi_mav.arsdk.messages.proto import device_manager
from anafi_mav.arsdk.mux import mux_link
from anafi_mav.arsdk.video.rtsp import DEFAULT_PORT as RTSP_PORT
from anafi_mav.clock import Clock, RoundTrip, SystemClock
from anafi_mav.drone import startup_queries
from anafi_mav.drone.automatic.animations import Animations
from anafi_mav.drone.automatic.flight_plan import FlightPlan
from anafi_mav.drone.automatic.follow_me import FollowMe
from anafi_mav.drone.automatic.poi import Poi
from anafi_mav.drone.controller.controller import MODELS as CONTROLLERS
from anafi_mav.drone.controller.controller import Controller, is_motion
from anafi_mav.drone.element import Element, Reducer, defer
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, loop_time, require_number
from anafi_mav.drone.features import Feature, Support, features
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.flight_logs import FlightLogs
from anafi_mav.drone.payload.gimbal import Gimbal
from anafi_mav.drone.payload.media import Media
from anafi_mav.drone.payload.storage import Storage
from anafi_mav.drone.payload.thermal import Thermal
from anafi_mav.drone.piloting.motors import Blocker, takeoff_blockers
from anafi_mav.drone.piloting.moves import Move
from anafi_mav.drone.piloting.piloting import Piloting
from anafi_mav.drone.piloting.state import MOTORS_OFF
from anafi_mav.drone.rest import HTTP_PORT, Rest
from anafi_mav.drone.status.alerts import Alerts, spoken
from anafi_mav.drone.status.battery import Battery
from anafi_mav.drone.status.calibration import Calibration
from anafi_mav.drone.status.gps import Gps
from anafi_mav.drone.status.home import Home, modern
from anafi_mav.drone.status.link import Link
from anafi_mav.drone.status.product import MODELS, Identity, Product
from anafi_mav.drone.status.sound import Sound
from anafi_mav.drone.values import OnValues, Values
from anafi_mav.drone.video.route import Direct, Mux, VideoRoute
from anafi_mav.drone.video.stream_choice import StreamChoice
from anafi_mav.drone.video.video import Video
from anafi_mav.errors import (
    CommandRejected,
    CommandTimeout,
    LinkLost,
    LocalProtocolError,
    RemoteProtocolError,
    WrongAircraft,
)

log = logging.getLogger("anafi_mav")
message_log = logging.getLogger("anafi_mav.message")

MessageT = TypeVar("MessageT", bound=Message)

Callback: TypeAlias = Callable[[Message, float], None]
"""(message, loop time of its arrival)."""

REBOOT_TIMEOUT = 15.0
"""s within which the link to a drone that reboots is lost; silence is noticed after 2.5 s."""

WAIT_TIMEOUT = 30.0
"""s that `wait_until` and `wait_for` wait unless the caller says otherwise: a take-off or landing takes about ten."""

MAX_PORT = 65535

CONTROLLER_PORTS = 100
"""A Skycontroller 3 has the TCP ports of its drone this much higher (Olympe, libarsdkctrl arsdk_device.c)."""

HANDSHAKE_AFTER = 4.0
"""s of silence before the first new handshake. libarsdk keeps a silent session for 8 s, and an earlier handshake could
throw out one that was only fading."""

HEARD_WITHIN = 0.5
"""s after an answer to discovery within which a drone that is in reach again, and has no other controller, is heard: it
sends several datagrams a second."""

UNHEARD_FOR = 4.0
"""s for which a drone that is not heard is sent what ends its motion, and gives a Skycontroller's pilot the sticks."""

CONTROLLER_TIMEOUT = 5.0
"""s that a Skycontroller may take to find its drone.

After that the attempt fails, and the next one queries the Skycontroller again, so that its own state is current.
"""


SWITCHED_OFF = frozenset({common.DisconnectionCause.OFF_BUTTON, common.DisconnectionCause.RESET_FACTORY})
"""Announced ends of a connection that have nothing to do with another controller."""


class LossCause(enum.Enum):
    """How a link was lost, as far as that shows another controller."""

    OTHER = "no sign of another controller"
    SILENCED = "the drone was heard, and is silent: as after another handshake, or out of reach"
    DISPLACED = "closed or announced as by another handshake"


class Drone:
    """An ANAFI at a network address; `connect` makes one.

    It can be connected again after the link is lost.
    """

    def __init__(
        self,
        address: str,
        *,
        discovery_port: int = DISCOVERY_PORT,
        handshake_port: int | None = None,
        local_address: str | None = None,
        interface: str | None = None,
        http_port: int = HTTP_PORT,
        rtsp_port: int = RTSP_PORT,
        name: str = "",
        serial: str | None = None,
        clock: Clock | None = None,
    ) -> None:
        """Create a drone at an address, not connected yet.

        With `handshake_port` None the port from discovery is used. `interface` binds every socket to that network
        interface. `name` is ours, for the log. With `serial` only the aircraft with that serial number is connected.
        Raises `LocalProtocolError` for a port that is none.
        """
        for port in (discovery_port, handshake_port, http_port, rtsp_port):
            if port is not None and not 0 < port <= MAX_PORT:
                raise LocalProtocolError(f"expected a port from 1 to {MAX_PORT}, got {port}")
        self.address = address
        self._wanted_serial = serial
        self.name = name or address
        self._discovery_port = discovery_port
        self._handshake_port = handshake_port
        self._local_address = local_address
        self._interface = interface
        self._clock = clock or SystemClock()

        self._commander = Commander()
        self._commander.name = self.name
        self._http_port = http_port
        self._rtsp_port = rtsp_port
        self._rest = Rest(address, http_port, local_address, interface)
        self.alerts = Alerts()
        self.animations = Animations(self._commander)
        self.battery = Battery()
        self.calibration = Calibration(self._commander)
        self.camera = Camera(self._commander)
        self.flight_plan = FlightPlan(self._commander, self._rest)
        self.follow_me = FollowMe(self._commander)
        self.gimbal = Gimbal(self._commander)
        self.gps = Gps()
        self.home = Home(self._commander)
        self.link = Link()
        self.media = Media(self._commander, self._rest, lambda: self.piloting.state.flying not in MOTORS_OFF)
        self.flight_logs = FlightLogs(
            self._commander, self._rest, self.media.reader, lambda: self.piloting.state.flying
        )
        self.poi = Poi(self._commander)
        self.product = Product()
        self.sound = Sound(self._commander)
        self.storage = Storage(self._commander)
        self.thermal = Thermal(self._commander)
        self.video = Video()
        self.streams = StreamChoice(lambda: self._model, self.thermal, self.camera, self.video)
        self.piloting = Piloting(self._commander, self.home, self.takeoff_blockers)
        self.controller = Controller(self._commander, self._user_moves, self._pilot_takes_over, self._stand_by)
        self.piloting.pilot_has_source = lambda: self.controller.pilot_has_source
        self.piloting.end_unreported = self._end_unreported
        self.flight_plan.end_unreported = lambda: self._plan_ended(PlayingState.STOPPED)
        self.flight_plan.model = lambda: self._model
        self.piloting.is_modern = lambda: self._model.protobuf
        self._commander.gate = self._allows
        self._elements: tuple[Element[Any], ...] = (
            self.alerts,
            self.animations,
            self.battery,
            self.calibration,
            self.camera,
            self.controller,
            self.flight_plan,
            self.follow_me,
            self.gimbal,
            self.gps,
            self.home,
            self.link,
            self.media,
            self.poi,
            self.product,
            self.sound,
            self.storage,
            self.thermal,
            self.video,
            self.piloting,
        )
        self._routes = _routes([element.REDUCERS for element in self._elements])
        self._reactions: dict[type[Message], Callable[[Any, float], object]] = {
            **self.piloting.reactions(),
            **self.controller.reactions(),
            **self.streams.reactions(),
            ardrone3.FlyingStateChanged: self._flying_state_says,
            common.MavlinkFilePlayingStateChanged: self._plan_says,
            common.StartingErrorEvent: self._commander.sent.attribute,
            common.Disconnection: self._on_dismissal,
            drone_manager.ConnectionState: self._controller_says,
            device_manager.State: self._controller_says,
        }
        self._subscriptions: tuple[tuple[Callback, frozenset[type[Message]]], ...] = ()
        """Each callback with the kinds of messages that it is not called with."""
        self._holders: dict[ValueLayout, Sequence[Element[Any]] | None] = {}
        """The elements that keep events of values; None for those with an event that a callback is called with."""
        self._on_values: tuple[OnValues, ...] = ()
        self._set_subscriptions(())
        self.on_event: Callable[[Message], None] | None = None
        """Called with each event as the drone sends it; None: nothing is.

        What `subscribe` calls also receives the end of a plan, for example, that the drone does not report.
        """

        self._session: ControllerSession | None = None
        self._fading: ControllerSession | None = None
        """A session that is silent, and goes on when the drone is heard again before a new handshake has succeeded."""
        self._heard: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        """Done when the fading session is heard again, or has ended."""
        self.handshake_at = -math.inf
        """Loop time of the newest handshake."""
        self.last_heard = -math.inf
        """Loop time at which the drone was heard last before its link was lost."""
        self._loss = LossCause.OTHER
        """How the link was lost last."""
        self._dismissed: common.DisconnectionCause | None = None
        """Cause with which the drone announced the end of the connection."""
        self._hover_due: str | None = None
        """Serial number of the aircraft whose motion is to be stopped when it is connected again; None: of none."""
        self._opening = False
        self._complete = False
        self._counters: Counter[str] = Counter()
        self.round_trip = RoundTrip()
        """Of the present or last connection, measured while sticks are sent.

        Behind a Skycontroller it is the way to that alone.
        """
        self._model = models.NO_MODEL
        self._reports_rth_state = False
        """rth.state has been received on this connection, so that its legacy twin says nothing more."""
        self._announced_serial = ""
        self._announced_name = ""
        self._lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    # -- the connection

    async def connect(self) -> None:
        """Connect and read all states and settings; returns when the drone has sent them.

        States of an earlier connection are dropped, and none of its commands is sent again. After a silence the first
        new handshake waits until `HANDSHAKE_AFTER`; if the drone is heard before one has succeeded, its session and
        states are kept, and it hovers. Raises `LinkLost`, which `HandshakeRefused` is too, `RemoteProtocolError`
        when what answers there is no drone, or `WrongAircraft`.
        """
        if self._session is not None or self._opening:
            raise LocalProtocolError(f"{self.name} is connected, or about to be")
        self._opening = True
        try:
            session = await self._open()
            if session is None:
                log.info("%s: heard again", self.name)
                return
            self._reset()
            self._begin(session)
            try:
                await self._find_web_server(session)
                await self._read_states()
                if self._model.protobuf:
                    await startup_queries.ask(
                        self._commander, self.name, [*self.camera.questions(), *self.storage.questions()]
                    )
                    await startup_queries.ask(
                        self._commander, self.name, [*self.camera.details(), *self.storage.details()]
                    )
                if (reason := self._end_behind_controller()) is not None:
                    raise LinkLost(reason)
            except BaseException:
                await self.close()
                raise
            self._complete = True
            self.streams.link_up()
            self.video.link_up(self._video_route(session))
            self._hover_after_loss()
        finally:
            self._opening = False
        log.info("%s: connected to %s, protocol %d", self.name, self.identity, session.version)

    async def _open(self) -> ControllerSession | None:
        """Open a session; None when the previous, silent session resumes.

        It resumes when the drone is heard again. The drone may keep a silent session for 8 s (libarsdk) and a
        handshake would end it, so that the first one waits. Until one has succeeded the silent session is listened
        to. Raises as `connect`.
        """
        fading = self._fading
        if fading is not None:
            rest = fading.last_received + HANDSHAKE_AFTER - loop_time()
            await asyncio.wait({self._heard}, timeout=max(rest, 0.0))
            if self._resume(fading):
                return None
        attempt = asyncio.ensure_future(
            mux_link.connect_either(
                self.address,
                discovery_port=self._discovery_port,
                handshake_port=self._handshake_port,
                local_address=self._local_address,
                interface=self._interface,
                on_message=_ignore,
                check_device=self._check_device,
                fades=True,
            )
        )
        try:
            either: set[asyncio.Future[Any]] = {attempt} if fading is None else {attempt, self._heard}
            await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
            if not attempt.done() and fading is not None and self._resume(fading):
                await _abandon(attempt)
                return None
            session = await attempt
        except BaseException:
            await _abandon(attempt)
            raise
        self._drop_fading("replaced by a new session")
        self.handshake_at, self._dismissed, self._loss = loop_time(), None, LossCause.OTHER
        session.on_messages = partial(self._receive, session)
        return session

    def _check_device(self, device: DeviceInfo) -> None:
        """Raise `WrongAircraft` before the handshake, which would displace a controller.

        A Skycontroller describes itself: its aircraft is known once it is connected.
        """
        if device.model_id not in CONTROLLERS:
            self._check_serial(device.serial)

    def _check_serial(self, serial: str) -> None:
        if self._wanted_serial not in (None, serial):
            raise WrongAircraft(serial, str(self._wanted_serial))

    def _resume(self, session: ControllerSession) -> bool:
        """Go on with a session that was silent. False: it is still silent, or has ended."""
        if session is not self._fading or session.silent or session.lost.done():
            return False
        if (reason := self._end_behind_controller()) is not None:  # reported during the silence
            session.end(reason)
            return False
        self._fading = None
        self._session = session
        self._lost = asyncio.get_running_loop().create_future()
        self._commander.attach(session)
        self._complete = True
        self.controller.link_heard()
        self.video.link_up(self._video_route(session))
        self._hover_after_loss()
        return True

    def _note_hover_due(self) -> None:
        """Note that motion is to be stopped once the drone is connected again.

        Where the pilot at a Skycontroller has control, nothing of ours flies, and a hover would be against him. What
        the drone has not reported as ended goes on all the same: the stop that his stick caused may not have arrived.
        """
        is_pilots = self.controller.pilot_has_source and not self.piloting.stopping()
        self._hover_due = None if is_pilots else self.identity.serial

    def _hover_after_loss(self) -> None:
        """Stop motion that continues from before a silence, or before the end of a connection.

        A flight plan, a landing and a return are not stopped, and neither is another aircraft that answers there now.
        """
        due, self._hover_due = self._hover_due, None
        if due == self.identity.serial and self._has_motion_to_stop:
            with contextlib.suppress(LinkLost):
                self.piloting.hover()

    @property
    def _has_motion_to_stop(self) -> bool:
        """True while the drone flies, and neither a flight plan, nor a landing nor a return."""
        piloting = self.piloting.state
        free = piloting.flying in (FlyingState.HOVERING, FlyingState.FLYING) and not self.home.state.returning
        return free and piloting.plan != PlayingState.PLAYING

    def _on_silent(self, session: ControllerSession, reason: str) -> None:
        """The drone is not heard. For all others the link is lost; the session may go on.

        It may hear us: it is sent what ends motion, for `UNHEARD_FOR` s.
        """
        self._note_loss(session, silent=True)
        if session is not self._session or not self._complete:
            session.end(reason)
            return
        self._fading = session
        self._heard = asyncio.get_running_loop().create_future()
        self._note_hover_due()
        stops = self.piloting.stopping() if self._hover_due is not None and self._has_motion_to_stop else ()
        last = (*stops, *self.controller.hand_back_due)
        self._disconnected(reason, silent=True)
        for message in last:
            token = session.send(message, unheard=UNHEARD_FOR / len(last))
            asyncio.get_running_loop().call_later(UNHEARD_FOR, session.cancel, token)

    def _on_speaks(self, session: ControllerSession) -> None:
        if session is self._fading and not self._heard.done():
            self._heard.set_result(None)

    def _drop_fading(self, reason: str) -> None:
        fading, self._fading = self._fading, None
        if fading is not None:
            fading.end(reason)

    def _note_loss(self, session: ControllerSession, *, silent: bool) -> None:
        """Keep the facts that distinguish another controller's handshake from other losses.

        Such a handshake silences us. The one connection of a Skycontroller 4 is closed by it. A Skycontroller that
        loses its drone, and a drone that is switched off, do not count as one. Neither does one that was never heard
        after the handshake: its UDP does not arrive here.
        """
        self.last_heard = session.last_received
        closed = session.closed_by_peer and isinstance(session, mux_link.MuxControllerSession)
        if self._dismissed in SWITCHED_OFF:
            self._loss = LossCause.OTHER
        elif closed or self._dismissed is not None:
            self._loss = LossCause.DISPLACED
        else:
            self._loss = LossCause.SILENCED if silent and session.has_received else LossCause.OTHER

    def _on_dismissal(self, message: common.Disconnection, now: float) -> None:
        self._dismissed = message.cause
        log.warning("%s: the drone ends the connection: %s", self.name, spoken(message.cause))

    @property
    def dismissed(self) -> bool:
        """The drone announced the end of the connection, and not because it is switched off."""
        return self._dismissed is not None and self._dismissed not in SWITCHED_OFF

    async def is_displaced(self) -> bool:
        """Return True when another controller seems to have ended the lost connection.

        A drone that fell silent is looked for by discovery, which disturbs no controller: one that answers that, and
        is not heard by `HEARD_WITHIN`, has another one. One that does not answer is out of reach.
        """
        if self._loss is not LossCause.SILENCED:
            return self._loss is LossCause.DISPLACED
        try:
            await look(
                self.address,
                discovery_port=self._discovery_port,
                local_address=self._local_address,
                interface=self._interface,
            )
        except (LinkLost, RemoteProtocolError):
            return False
        if self._fading is not None:
            await asyncio.wait({self._heard}, timeout=HEARD_WITHIN)
        return self._fading is None or self._fading.silent

    async def heard_again(self) -> bool:
        """Wait until a silent session is heard again, or a new handshake is due.

        False: it is not heard.
        """
        if self._fading is None:
            return False
        rest = self._fading.last_received + HANDSHAKE_AFTER - loop_time()
        await asyncio.wait({self._heard}, timeout=max(rest, 0.0))
        return self._fading is not None and not self._fading.silent

    async def pause(self, seconds: float) -> None:
        """Wait before the next `connect`, no longer than until a silent session is heard again."""
        require_number(seconds)
        if self._fading is None:
            await asyncio.sleep(seconds)
        else:
            await asyncio.wait({self._heard}, timeout=seconds)

    def _reset(self) -> None:
        for element in self._elements:
            element.reset()
        self._commander.sent.clear()
        self._complete = self._reports_rth_state = False
        if self._lost.done():
            self._lost = asyncio.get_running_loop().create_future()

    def _begin(self, session: ControllerSession) -> None:
        device = session.device
        self.controller.present = device.model_id in CONTROLLERS
        self.controller.model = device.model_id if self.controller.present else 0
        self._model = _model(device.model_id)
        self._announced_serial, self._announced_name = device.serial, device.name
        self._session = session
        self._counters, self.round_trip = session.counters, session.round_trip
        self._commander.attach(session)
        if self.controller.present:
            session.on_stall = self.controller.stalled
            session.watch()
        session.lost.add_done_callback(partial(self._on_lost, session))
        session.on_silent = partial(self._on_silent, session)
        session.on_speaks = partial(self._on_speaks, session)

    async def _find_web_server(self, session: ControllerSession) -> None:
        """Set the web server's address: the drone's own, or that of its Skycontroller.

        It is a hundred ports up at a Skycontroller 3, and behind the mux of a Skycontroller 4.
        """
        if isinstance(session, mux_link.MuxControllerSession):
            try:
                address, port = await session.open_tcp("drone", self._http_port)
            except LinkLost as error:
                if session.lost.done():
                    raise LinkLost(session.lost.result()) from error
                log.warning("%s: no web server: %s", self.name, error)
            else:
                await self._rest.aim(address, port, is_behind_mux=True)
        else:
            shift = CONTROLLER_PORTS if self.controller.present else 0
            await self._rest.aim(self.address, self._http_port + shift)

    def _video_route(self, session: ControllerSession) -> VideoRoute:
        """The drone's own video server, or that of its Skycontroller, which hands it on."""
        if isinstance(session, mux_link.MuxControllerSession):
            return Mux(session, self._rtsp_port)
        return Direct(self.address, self._rtsp_port, self._local_address, self._interface)

    async def _read_states(self) -> None:
        """Set the clock and request all states and settings.

        This is what Parrot's own SDK does first (olympe arsdkng/drone); for the Skycontroller first, if one is
        present, then for the drone behind it.
        """
        date = datetime.fromtimestamp(self._clock.time()).astimezone().strftime("%Y%m%dT%H%M%S%z")
        if self.controller.present:
            await startup_queries.read(
                self._commander,
                "Skycontroller",
                (skyctrl.CurrentDateTime(date), skyctrl.AllStates(), skyctrl.AllSettings()),
                (skyctrl.AllStatesChanged, skyctrl.AllSettingsChanged),
            )
            for question in self.controller.questions():
                self._commander.send(question)
            await self._find_drone()
        await startup_queries.read(
            self._commander,
            "drone",
            (common.CurrentDateTime(date), common.AllStates(), common.AllSettings()),
            (common.AllStatesChanged, common.AllSettingsChanged),
        )
        self._check_serial(self.identity.serial)

    async def _find_drone(self) -> None:
        """Wait until the Skycontroller is connected to its drone."""
        state = self.controller.state
        if state.link != Connection.CONNECTED:
            try:
                answer = self._commander.expect(
                    (drone_manager.ConnectionState, device_manager.State),
                    lambda message: True if self.controller.state.link == Connection.CONNECTED else None,
                )
                answer.expire_after(CONTROLLER_TIMEOUT, "a drone behind it")
                await answer.wait()
            except CommandTimeout:
                what = "says nothing of a drone" if state.link is None else f"has no drone: {spoken(state.link)}"
                raise LinkLost(f"the Skycontroller {what}") from None
        state = self.controller.state
        self._model = _model(state.drone_model or 0)
        self._announced_serial, self._announced_name = state.drone_serial or "", state.drone_name or ""
        if self._announced_serial:  # else the drone's own settings have it
            self._check_serial(self._announced_serial)

    def _controller_says(self, message: Message, now: float) -> None:
        """End the connection when the Skycontroller has lost its drone, or has another one."""
        if not self._complete or self._session is None:
            return
        if (reason := self._end_behind_controller()) is not None:
            self._session.end(reason)

    def _end_behind_controller(self) -> str | None:
        """Return why the Skycontroller has ended the connection; None: it goes on, or is direct."""
        state = self.controller.state
        if not self.controller.present or state.link is None:
            return None
        if state.link != Connection.CONNECTED:
            return f"the Skycontroller lost the drone: {spoken(state.link)}"
        if state.drone_serial and self._announced_serial not in ("", state.drone_serial):
            return f"the Skycontroller is connected to another drone, {state.drone_serial}"
        return None

    def _flying_state_says(self, message: ardrone3.FlyingStateChanged, now: float) -> None:
        self.piloting.on_flying_state(message, now)
        if self.piloting.state.plan is None and self.flight_plan.state.playing == PlayingState.PLAYING:
            self._plan_ended(PlayingState.STOPPED)  # on the ground

    def _plan_ended(self, state: PlayingState) -> None:
        """Handle the end of a flight plan that the drone does not report as if it had reported it."""
        plan = self.flight_plan.state
        kind = MavlinkType.FLIGHT_PLAN if plan.type is None else plan.type
        self._handle(common.MavlinkFilePlayingStateChanged(state, plan.uid or "", kind), loop_time())

    def _end_unreported(self, kind: type[Message]) -> None:
        """Handle an end that the drone does not report, of a plan, an animation or a following."""
        if kind is follow_me.State:
            self._handle(
                follow_me.State(FollowMeMode.NONE, follow_me.Behavior.IDLE, follow_me.Animation.NONE, 0), loop_time()
            )
        elif kind is animation.State:
            self._handle(animation.State(AnimationType.NONE, 0), loop_time())
        else:
            self._plan_ended(PlayingState.PAUSED)

    def _plan_says(self, message: common.MavlinkFilePlayingStateChanged, now: float) -> None:
        self.piloting.on_plan(message)
        self.flight_plan.on_playing(message, now)

    def _allows(self, message: Message) -> bool:
        """The gate of every command: see `Commander.gate`."""
        if type(message) is not ardrone3.PCMD and is_motion(message):  # the sticks know by themselves
            self.piloting.require_free()
        if self.calibration.state.started and _starts_motors(message):
            raise CommandRejected("the magnetometer is being calibrated: the drone is turned by hand")
        if type(message) is common.MagnetoCalibration and message.calibrate:
            self._require_standing("calibrated")
        return self.controller.allows(message)

    def _require_standing(self, what: str) -> None:
        """Raise `CommandRejected` unless the drone is landed and is going to stay so.

        Landed: on the ground with its motors off.
        """
        if self.piloting.state.flying != FlyingState.LANDED:
            raise CommandRejected(f"a drone that does not stand with its motors off is not {what}")
        if self.piloting.about_to_fly:
            raise CommandRejected(f"a drone that is about to take off is not {what}")

    def retire(self, tasks: Iterable[asyncio.Task[Any]]) -> None:
        """From now on let these tasks send only commands that stop something.

        Newer commands have replaced them.
        """
        self._commander.retire(tasks)

    def silence(self, tasks: Iterable[asyncio.Task[Any]]) -> None:
        """From now on these tasks send nothing at all."""
        self._commander.silence(tasks)

    def _user_moves(self) -> bool:
        """Does something fly the drone that a user of ours ordered?"""
        piloting = self.piloting
        return (
            piloting.moving
            or piloting.rises
            or piloting.sticks_held
            or self._commander.begins
            or self._commander.launches
            or piloting.state.plan == PlayingState.PLAYING
            or piloting.state.poi in (PoiStatus.RUNNING, PoiStatus.PENDING)
            or piloting.state.following not in (None, FollowMeMode.NONE)
            or piloting.state.animation not in (None, AnimationType.NONE)
        )

    def _stand_by(self, messages: Sequence[Message]) -> None:
        """Have these sent when the host stalls; none: nothing is sent."""
        if self._session is not None:
            self._session.stand_by(messages)

    def _pilot_takes_over(self) -> None:
        """The pilot at the Skycontroller moved a stick: what our user ordered ends here."""
        with contextlib.suppress(LinkLost):
            self.piloting.hover()

    def _on_lost(self, session: ControllerSession, reason: asyncio.Future[str]) -> None:
        if session is self._fading:
            self._fading = None
            if not self._heard.done():
                self._heard.set_result(None)
        if session is not self._session:
            return
        if not session.silent:
            self._note_loss(session, silent=False)
            if self._complete:  # behind a Skycontroller the drone does not notice, and flies its move on
                self._note_hover_due()
        self._disconnected("closed" if reason.cancelled() else reason.result(), silent=False)

    def _disconnected(self, why: str, *, silent: bool) -> None:
        """Every wait ends, and nothing of before is sent again."""
        log.info("%s: link lost: %s", self.name, why)
        self._session = None
        self._complete = False
        self._commander.detach(why)
        self.piloting.link_lost()
        if silent:
            self.controller.link_silent()
        else:
            self.controller.link_lost()
        self.streams.link_lost()
        self.video.link_lost()
        if not self._lost.done():
            self._lost.set_result(why)

    async def close(self) -> None:
        """End the connection; commands sent just before still leave. Does nothing without one.

        After a link loss this waits for no answer of the drone, or the next attempt to connect would begin late: the
        goodbye of its video goes on in the background, see `Video.close`.
        """
        fading = self._fading
        self._drop_fading("closed")
        if fading is not None:
            await fading.close()
        session = self._session
        if session is not None:
            try:
                await self.controller.release()
            finally:
                await self.video.close()
                await asyncio.sleep(0)  # a session sends at the end of a turn of the loop
                await session.close()
                self._on_lost(session, session.lost)
                self._hover_due = None  # it ends by our will
        self.streams.link_lost()
        self.video.link_lost()
        await self.media.close()
        await self._rest.close()

    @property
    def connected(self) -> bool:
        """True when the link is up and the drone has sent all its states."""
        return self._complete

    @property
    def fading(self) -> bool:
        """The drone is not heard, and its session goes on if it is heard again."""
        return self._fading is not None

    @property
    def lost(self) -> asyncio.Future[str]:
        """Done when this connection is lost or closed, with the reason; `connect` makes a new one.

        Wait for it with `asyncio.wait` or a shield: cancelling a bare wait would cancel it for all waiters.
        """
        return self._lost

    @property
    def counters(self) -> Counter[str]:
        """Transport counters of the present or last connection."""
        return self._counters

    @property
    def on_command(self) -> Callable[[Message], None] | None:
        """Called with each command that is sent; None: nothing is."""
        return self._commander.on_command

    @on_command.setter
    def on_command(self, callback: Callable[[Message], None] | None) -> None:
        self._commander.on_command = callback

    @property
    def silent_for(self) -> float | None:
        """Time since the last datagram of the drone, s; None while it is not connected."""
        return None if self._session is None else max(0.0, loop_time() - self._session.last_received)

    @property
    def identity(self) -> Identity:
        """Model, serial number and versions; empty before the first connection."""
        product = self.product.state
        return Identity(
            model=self._model,
            serial=product.serial or self._announced_serial,
            firmware=product.firmware,
            hardware=product.hardware,
            name=product.name or self._announced_name,
        )

    async def request_reboot(self, timeout: float = REBOOT_TIMEOUT) -> None:
        """Send the command to restart; return when the drone has acknowledged its receipt.

        There is no other confirmation. Raises `CommandRejected` unless the drone has reported that it is landed;
        `LinkLost` or `CommandTimeout` when the command was not acknowledged. When this is cancelled, the command is
        not sent again.
        """
        require_number(timeout)
        if not self.connected:
            raise LinkLost("not connected")
        self._require_standing("rebooted")
        lost, delivery = self._lost, self._commander.deliver(common.Reboot())
        timed_out = CommandTimeout(common.Reboot.NAME, timeout)
        try:
            either: tuple[asyncio.Future[Any], ...] = (lost, delivery)
            await asyncio.wait(either, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
        finally:
            if not (lost.done() or delivery.done()):
                self._commander.withdraw(delivery, timed_out)
        delivery.result()

    async def reboot(self, timeout: float = REBOOT_TIMEOUT) -> None:
        """Restart the drone; return when it has received the command and the link is lost.

        Raises as `request_reboot`, and `CommandTimeout` when the drone stays connected.
        """
        lost = self._lost
        await self.request_reboot(timeout)
        await asyncio.wait({lost}, timeout=timeout)
        if not lost.done():
            raise CommandTimeout(common.Reboot.NAME, timeout)

    # -- what others may look at

    @property
    def features(self) -> Mapping[Feature, Support]:
        """Features of this drone, from what it reported when it connected."""
        return features(self)

    @property
    def moves_started(self) -> tuple[Move, ...]:
        """See `Piloting.moves_started`."""
        return self.piloting.moves_started

    def blockers(self) -> list[Blocker]:
        """Return the reported reasons that can prevent a take-off."""
        return takeoff_blockers(self.alerts.state, self.battery.state, self.calibration.state)

    def takeoff_blockers(self) -> list[str]:
        """Return `blockers` in words."""
        return [str(blocker) for blocker in self.blockers()]

    def subscribe(self, callback: Callback, *, without: Collection[type[Message]] = frozenset()) -> Callable[[], None]:
        """Call `callback(message, time)` with every message, after the states are updated.

        Returns the function that ends it. `time` is the event loop's. Messages during `connect` are included. What the
        callback raises is logged. It is not called with messages of the kinds `without`: events of values are decoded
        for it, which `subscribe_values` avoids.
        """
        subscription = callback, frozenset(without)
        self._set_subscriptions((*self._subscriptions, subscription))

        def undo() -> None:
            self._set_subscriptions(tuple(other for other in self._subscriptions if other is not subscription))

        return undo

    def _set_subscriptions(self, subscriptions: tuple[tuple[Callback, frozenset[type[Message]]], ...]) -> None:
        self._subscriptions = subscriptions
        self._holders = {}

    def subscribe_values(self, callback: OnValues) -> Callable[[], None]:
        """Call `callback(values, time)` with the events of values, which arrive often.

        It is called once for those that arrive together: before the next message of another kind, before the next of
        the same kind, and at the end of a frame. The states contain them. Otherwise as `subscribe`.
        """
        self._on_values = (*self._on_values, callback)

        def undo() -> None:
            self._on_values = tuple(other for other in self._on_values if other is not callback)

        return undo

    def after_read(self, call: Callable[[], None]) -> None:
        """Call a function when the messages that are read together are handled.

        See `Session.after_read`.
        """
        if self._session is None:
            asyncio.get_running_loop().call_soon(call)
        else:
            self._session.after_read(call)

    async def expect(
        self,
        answer: type[MessageT],
        predicate: Callable[[MessageT], bool] | None = None,
        timeout: float = ANSWER_TIMEOUT,
    ) -> MessageT:
        """Return the next message of a class that the predicate accepts.

        Raises `CommandTimeout` or `LinkLost`.
        """

        def judge(message: MessageT) -> MessageT | None:
            return message if predicate is None or predicate(message) else None

        expectation = self._commander.expect((answer,), judge)
        expectation.expire_after(timeout, answer.NAME)
        return await expectation.wait()

    async def wait_until(self, condition: Callable[[], bool], what: str, timeout: float = WAIT_TIMEOUT) -> None:
        """Return when a condition on the drone's states is true.

        The condition is evaluated now and after each message. Raises `CommandTimeout` about `what` after `timeout` s,
        `LinkLost`, and what the condition raises.
        """
        require_number(timeout)
        self._commander.require_link()
        if condition():
            return
        met: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        def look(message: Message, now: float) -> None:
            if met.done():
                return
            try:
                if condition():
                    met.set_result(None)
            except Exception as error:
                met.set_exception(error)

        lost, undo = self._lost, self.subscribe(look)
        either: set[asyncio.Future[Any]] = {met, lost}
        try:
            await asyncio.wait(either, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
        finally:
            undo()
        if met.done():
            met.result()
        elif lost.done():
            raise LinkLost(lost.result())
        else:
            raise CommandTimeout(what, timeout)

    async def wait_for(self, *states: FlyingState, timeout: float = WAIT_TIMEOUT) -> None:
        """Return when the drone reports one of these flying states, at once when it is in one.

        Raises `CommandTimeout` after `timeout` s, `LinkLost`.
        """
        words = " or ".join(spoken(state) for state in states)
        await self.wait_until(lambda: self.piloting.state.flying in states, f"the state {words}", timeout)

    # -- the hot path

    def _return_state(self, message: Message) -> Message:
        """Return the state of a return as `rth.State`, unless the drone reports that itself."""
        if isinstance(message, rth.State):
            self._reports_rth_state = True
        elif isinstance(message, ardrone3.NavigateHomeStateChanged) and not self._reports_rth_state:
            return modern(message)
        return message

    def _receive(self, session: ControllerSession, messages: Sequence[Received], now: float) -> None:
        """Handle the messages of a frame.

        Events of values wait undecoded in their elements, unless their messages are wanted.
        """
        together: list[Values] = []
        """To be reported: of each kind one."""
        lost = session.lost
        unpacked: Message | UnknownMessage
        for message in messages:  # only what is called from here can end the session
            if type(message) is Values:  # not by isinstance, which takes as long for these classes as a reducer
                holders = self._holders_of(message.layout)
                if together and (holders is None or _has_kind(together, message.layout)):
                    self._report(together, now)
                    together = []
                    if lost.done():
                        return
                if holders is not None:
                    together.append(message)
                    for element in holders:
                        defer(element, message)
                    continue
                first, *others = message.split()
                if others:
                    self._receive(session, (first, *others), now)
                    if lost.done():
                        return
                    continue
                together.append(message)
                (unpacked,) = message.messages()
            else:
                if together:
                    self._report(together, now)
                    together = []
                    if lost.done():
                        return
                unpacked = message
            if self.on_event is not None:
                self._show(unpacked, self.on_event)
            try:
                self._handle(unpacked, now)
            except Exception as error:
                session.report(error, unpacked)
            if lost.done():
                return
        if together:
            self._report(together, now)

    def _show(self, message: Message | UnknownMessage, on_event: Callable[[Message], None]) -> None:
        if type(message) is UnknownMessage:
            return
        try:
            on_event(message)
        except Exception:  # what listens must not keep an event from the states
            log.exception("%s: %s not recorded", self.name, message.NAME)

    def _holders_of(self, layout: ValueLayout) -> Sequence[Element[Any]] | None:
        """Return the elements that keep events of values; None if one of them is wanted."""
        if self.on_event is not None or message_log.isEnabledFor(logging.DEBUG):
            return None
        waiting = self._commander.waiting
        if waiting and not waiting.keys().isdisjoint(layout.kinds):
            return None
        try:
            return self._holders[layout]
        except KeyError:
            if len(self._holders) >= MAX_LAYOUTS:
                self._holders.clear()
            is_deferrable = all(without.issuperset(layout.kinds) for _, without in self._subscriptions)
            places = {place for kind in layout.kinds for place, _ in self._routes.get(kind, ())}
            holders = [self._elements[place] for place in sorted(places)] if is_deferrable else None
            self._holders[layout] = holders
            return holders

    def _report(self, together: Sequence[Values], now: float) -> None:
        values = join(together)
        for callback in self._on_values:
            try:
                callback(values, now)
            except Exception:
                names = ", ".join(kind.NAME for kind in values.layout.kinds)
                log.exception("%s: a subscriber failed on %s", self.name, names)

    def _handle(self, message: Message | UnknownMessage, now: float) -> None:
        """Update the states by a message, then call what waits for it."""
        if type(message) is UnknownMessage:
            self._counters["unknown message"] += 1
            return
        if type(message) in _OF_RETURN:
            message = self._return_state(message)
        kind = type(message)
        for place, reducer in self._routes.get(kind, ()):
            element = self._elements[place]
            element.set_state(reducer(element.state, message))
        reaction = self._reactions.get(kind)
        if reaction is not None:
            reaction(message, now)
        if waiting := self._commander.waiting.get(kind):
            for expectation in tuple(waiting):
                expectation.offer(message)
        for callback, without in self._subscriptions:
            if kind in without:
                continue
            try:
                callback(message, now)
            except Exception:
                log.exception("%s: a subscriber failed on %s", self.name, message.NAME)
        if message_log.isEnabledFor(logging.DEBUG):
            message_log.debug("%s: %r", self.name, without_secrets(message))


Routes: TypeAlias = Mapping[type[Message], Sequence[tuple[int, Reducer]]]
"""The reducers of each event, with the place of their element among all elements."""

_known_routes: dict[tuple[int, ...], tuple[Sequence[Mapping[type[Message], Reducer]], Routes]] = {}
"""By the identities of the elements' tables: all drones share the one entry, which was 40 kB of each."""


def _routes(tables: Sequence[Mapping[type[Message], Reducer]]) -> Routes:
    """Return the reducers of each event, from the tables of all elements."""
    key = tuple(map(id, tables))
    if key not in _known_routes:
        routes: dict[type[Message], list[tuple[int, Reducer]]] = {}
        for place, table in enumerate(tables):
            for message, reducer in table.items():
                routes.setdefault(message, []).append((place, reducer))
        _known_routes[key] = tables, routes
    return _known_routes[key][1]


_OF_RETURN = frozenset({rth.State, ardrone3.NavigateHomeStateChanged})
"""The state of a return, and its legacy twin."""


def _has_kind(together: Sequence[Values], layout: ValueLayout) -> bool:
    """Return True if an event of one of these kinds waits to be reported."""
    return any(kind in values for values in together for kind in layout.kinds)


def _ignore(message: Message | UnknownMessage, now: float) -> None:
    """Ignore messages of a session before it is ours; all states are requested afterwards."""


def _starts_motors(message: Message) -> bool:
    """Do the motors of a drone on the ground start by this command?"""
    if isinstance(message, ardrone3.UserTakeOff):
        return message.state != 0
    starts = ardrone3.TakeOff | ardrone3.SmartTakeOffLand | common.Start | modern_plan.StartAt | modern_plan.StartAtV2
    return isinstance(message, starts)


def _model(id: int) -> models.Model:
    return MODELS.get(id) or models.unknown(id)


async def _abandon(attempt: asyncio.Future[ControllerSession]) -> None:
    """Cancel an attempt to connect and wait for it; close a session that it still opened."""
    attempt.cancel()
    await asyncio.wait([attempt])
    if not attempt.cancelled() and attempt.exception() is None:
        await attempt.result().close()

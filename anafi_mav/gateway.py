"""The gateway: a configuration becomes endpoints, drones and systems, and is kept running.

    async with Gateway(config) as gateway:
        await gateway.ready(10.0)

One supervisor per drone connects, hands the drone to its `System`, waits for the link to end and connects again. The
gateway knows addresses only; that some of them are simulated is the command line's business.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections import Counter
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import TracebackType

from typing_extensions import Self

from anafi_mav import texts
from anafi_mav.access_token import load_token
from anafi_mav.arsdk.video.rtsp import DEFAULT_PORT as RTSP_PORT
from anafi_mav.clock import Clock, SystemClock
from anafi_mav.config import Config, DroneConfig, MediaConfig
from anafi_mav.disk_writer import HANGS
from anafi_mav.drone import Drone, events
from anafi_mav.drone.contention import SHORT, Contention
from anafi_mav.drone.rest import HTTP_PORT
from anafi_mav.drone.values import VALUES
from anafi_mav.errors import AnafiMavError, ConfigError, HandshakeRefused, WrongAircraft
from anafi_mav.fabric.endpoint import FabricEndpoint
from anafi_mav.fabric.sample_age import StopKind
from anafi_mav.fabric.system_state import StatePosition, SystemState
from anafi_mav.gateway_status import ReportedDrone, StatusReport
from anafi_mav.mavlink.base import Endpoint, EndpointUrl, Sink
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.key_ring import KeyRing, folder_of
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.recording.recorder import Recorder
from anafi_mav.relay.server import RelayServer
from anafi_mav.relay.source import DroneSource
from anafi_mav.services.commands import Effect
from anafi_mav.services.flavours import FLAVOURS
from anafi_mav.services.gateway_uris import GatewayUris
from anafi_mav.services.ground_station.signing_setup import SigningSetup
from anafi_mav.services.system import System
from anafi_mav.services.system_position import SystemPosition
from anafi_mav.state_lock import (
    FILE,
    NO_LOCKS,
    STATE_WRITER,
    HeldDrone,
    Holder,
    StateLock,
    check_folder,
    read_holder,
    state_folder,
)
from anafi_mav.status_record import GatewayStatus
from anafi_mav.subject import DRONE
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.flying import ON_GROUND
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.failsafe_settings import FailsafeLimits
from anafi_mav.web.definition_routes import DefinitionRoutes
from anafi_mav.web.live_page import DroneEntry, LivePage
from anafi_mav.web.live_video import LiveVideo
from anafi_mav.web.media_routes import MediaRoutes
from anafi_mav.web.server import HttpServer
from anafi_mav.web.status_routes import StatusRoutes

logger = logging.getLogger(__name__)

RETRY_FIRST, RETRY_LAST = 0.5, 2.0
"""s between attempts to connect: doubled from the first to the last, so that a drone that comes back is a system
again within five seconds."""

RETRY_WRONG = 10.0
"""s until an address where another aircraft answered is tried again: behind a Skycontroller each attempt ends the
connection of another program."""

REPORT_EVERY = 60.0
"""s between two texts about another aircraft at the address: for clients that have connected meanwhile."""

MAX_SERIAL = 18
"""Characters of a serial number that fit the text; Parrot's have as many."""

CANCEL_WAIT = 0.1
"""s until a task that has not ended is cancelled once more."""

DISK_LIMIT = 1.0
"""s that closing, and `ready`, wait for files of the state folder that are being written."""

HOVER_TIME = 2.0
"""s that closing stays with a flying drone after its moves have ended: as long as hover centres the sticks."""


def state_in_use(folder: Path, holder: Holder) -> ConfigError:
    """Return the error of a gateway whose state folder another one holds."""
    drones = "".join(f", {drone.name} at {drone.address}" for drone in holder.drones)
    who = f"{holder.title}{drones}," if drones else holder.title
    return ConfigError(
        "state",
        f"expected a folder that no other gateway uses, but {who} holds {folder / FILE}; "
        "end that gateway, or name another folder for this one",
    )


def download_folder(media: MediaConfig) -> Path | None:
    """Return the folder for copies of media; None: they are not copied. Raises `ConfigError`."""
    if "\0" in (media.download_folder or ""):
        raise ConfigError("media.download_folder", f"expected the path of a folder, got {media.download_folder!r}")
    try:
        return None if media.download_folder is None else Path(media.download_folder).expanduser()
    except RuntimeError as error:  # no such home
        raise ConfigError("media.download_folder", f"expected the path of a folder: {error}") from error


async def _guarded(name: str, ending: Awaitable[None]) -> None:
    """Wait for the end of one part, and log a failure: it must not keep the others from ending."""
    try:
        await ending
    except AnafiMavError as error:
        logger.info("ending %s: %s", name, error)
    except Exception:
        logger.exception("ending %s failed: a mistake of ours", name)


class _Supervised:
    """A drone with its system and the task that keeps them connected."""

    def __init__(
        self,
        config: DroneConfig,
        drone: Drone,
        system: System,
        changed: Callable[[], None],
        on_first_connection: Callable[[], None],
    ) -> None:
        """`changed` is called whenever the drone has connected or disconnected."""
        self.config = config
        self.drone = drone
        self.system = system
        self._changed = changed
        self._on_first_connection: Callable[[], None] | None = on_first_connection
        """None once it was called."""
        self.first_attempt = asyncio.Event()
        self.problem = ""
        """Why the last attempt to connect failed; empty while connected."""
        self.connections = 0
        """Handshakes that led to a connection, and silent sessions that went on."""
        self.task: asyncio.Task[None] | None = None
        self.is_lost_in_air = False
        """True from a loss of the link in the air until one on the ground; it counts while there is no link."""
        self._is_closing = False
        """True while the drone's connection is closed, which must not be interrupted."""
        self._reported_at = -math.inf
        """Time of the last text about another aircraft at the address."""
        self._contention = Contention()
        self._judged = (drone.handshake_at, self.connections)
        """The handshake whose loss was judged last, and how many connections there were: a silent session may go on."""
        drone.subscribe(self._on_event, without=VALUES)

    async def run(self) -> None:
        """Keep the drone connected until cancelled."""
        DRONE.set(self.config.name)
        try:
            await self._run()
        finally:
            await self._close()
            await self.drone.video.close()  # after a link loss its goodbye may still be under way

    async def stop(self) -> None:
        """Cancel `run`, and wait until it has closed the drone's connection."""
        task = self.task
        # Before Python 3.12 wait_for forgets a cancellation that comes when what it waits for is just done.
        while task is not None and not task.done():
            if not self._is_closing:
                task.cancel()
            await asyncio.wait([task], timeout=CANCEL_WAIT)

    async def _close(self) -> None:
        self._is_closing = True
        try:
            await self.drone.close()
        finally:
            self._is_closing = False

    async def _run(self) -> None:
        pause = RETRY_FIRST
        while True:
            try:
                await self.drone.connect()
                self.connections += 1
                self._contention.connected(airborne=self.drone.piloting.state.flying not in ON_GROUND)
                if self.problem:  # it was reported at this level
                    logger.warning("%s: connected", self.config.name)
                self.problem, pause = "", RETRY_FIRST
                self._report_aircraft(None)
                try:
                    memory_problem = await self.system.load_memory()
                    if self.drone.connected:
                        self.system.link_up(memory_problem)
                        self._changed()
                        self.first_attempt.set()
                        if self._on_first_connection is not None:
                            self._on_first_connection()
                            self._on_first_connection = None
                    reason = await asyncio.shield(self.drone.lost)
                    logger.warning("%s: link lost: %s", self.config.name, reason)
                    self.problem = f"link lost: {reason}"
                    self.is_lost_in_air = not self.system.vehicle.on_ground
                    await self.system.settle()
                finally:
                    self.system.link_down()
                    self._changed()
                    if not self.drone.fading:
                        await self._close()
            except Exception as error:
                # Whatever it is, the drone must not be out of reach until the gateway is restarted.
                problem = str(error) or repr(error)
                if not isinstance(error, AnafiMavError):
                    logger.exception("%s: a mistake of ours", self.config.name)
                elif problem != self.problem:
                    logger.warning("%s: %s", self.config.name, problem)
                    if isinstance(error, HandshakeRefused):
                        self.system.announce(Severity.WARNING, texts.CONNECTION_REFUSED.fill(status=error.status))
                self._report_aircraft(error if isinstance(error, WrongAircraft) else None)
                self.problem = problem
                self.first_attempt.set()
                await self.drone.pause(RETRY_WRONG if isinstance(error, WrongAircraft) else pause)
                pause = min(2.0 * pause, RETRY_LAST)
            await self._contend()

    def _report_aircraft(self, wrong: WrongAircraft | None) -> None:
        """Report the aircraft that an attempt has found, unless it is the right one (None)."""
        if wrong is None:
            self.system.absence, self._reported_at = None, -math.inf
            return
        text = texts.WRONG_AIRCRAFT.fill(serial=wrong.serial[-MAX_SERIAL:] or "unknown")
        now = asyncio.get_running_loop().time()
        if text != self.system.absence or now - self._reported_at >= REPORT_EVERY:
            self._reported_at = now
            self.system.announce(Severity.CRITICAL, text)
        self.system.absence = text

    async def _contend(self) -> None:
        """Stay away for a while if another controller has taken the drone of a lost connection."""
        drone, contention = self.drone, self._contention
        connection = (drone.handshake_at, self.connections)
        if connection == self._judged or await drone.heard_again():
            return
        self._judged = connection
        age = drone.last_heard - drone.handshake_at
        displaced = age <= SHORT and await drone.is_displaced()
        if not contention.lost(age, displaced=displaced, dismissed=drone.dismissed):
            return
        self._report(Severity.CRITICAL, texts.OTHER_CONTROLLER)
        away = contention.stay_away()
        if away is None:
            return
        await drone.close()
        self._report(Severity.NOTICE, texts.RECONNECTING_IN.fill(seconds=away))
        self.problem = f"another controller has taken the drone, staying away for {away:.0f} s"
        asked: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        self.system.listen(lambda inbound: None if asked.done() else asked.set_result(inbound.sysid))
        try:
            await asyncio.wait({asked}, timeout=away)
        finally:
            self.system.listen(None)
        if asked.done():
            self._report(Severity.NOTICE, texts.RECONNECTING_BY.fill(system=asked.result()))

    def _report(self, severity: Severity, text: OperatorText) -> None:
        logger.log(logging.WARNING, "%s: %s", self.config.name, text)
        self.system.announce(severity, text)

    def _on_event(self, message: events.Message, now: float) -> None:
        if type(message) is events.FlyingStateChanged and message.state in ON_GROUND:
            self._contention.on_ground()

    def held(self) -> HeldDrone:
        """Return what the lock file says of this drone."""
        assert self.config.address is not None
        serial = self.drone.identity.serial if self.system.active else ""
        return HeldDrone(self.config.name, self.config.address, self.config.interface, serial)

    def reported(self) -> ReportedDrone:
        """Return the drone as the status record needs it."""
        assert self.config.address is not None
        where = (self.config.name, self.config.sysid, self.config.address, self.config.interface)
        return ReportedDrone(*where, self.problem, self.connections, self.drone, self.system)

    def entry(self, *, has_video: bool) -> DroneEntry:
        """Return the drone as the page for browsers lists it."""
        connected = self.system.active
        return DroneEntry(
            name=self.config.name,
            sysid=self.config.sysid,
            model=self.drone.identity.model.title if connected else "",
            connected=connected,
            problem="" if connected else self.problem or "no answer yet",
            stream=self.drone.streams.shown.kind.value if connected and has_video else "",
        )

    def line(self) -> str:
        """Return one line for people: the drone, its address and its state."""
        where = f" on {self.config.interface}" if self.config.interface else ""
        head = f"drone {self.config.name}: system {self.config.sysid} at {self.config.address}{where}"
        if not self.system.active:
            return f"{head}: not connected ({self.problem or 'no answer yet'}), retrying"
        identity = self.drone.identity
        percent = self.drone.battery.state.percent
        battery = "" if percent is None else f", battery {percent} %"
        line = f"{head}: {identity}{battery}"
        if self.drone.controller.present:
            charge = self.drone.controller.state.battery_percent
            line += ", through a Skycontroller" + ("" if charge is None else f" with {charge} % battery")
        return line


class Gateway:
    """Drones on one side, MAVLink endpoints on the other.

    Every drone of the configuration needs an address.
    """

    def __init__(
        self,
        config: Config,
        *,
        clock: Clock | None = None,
        saves: bool = True,
        on_first_connection: Callable[[], None] = lambda: None,
    ) -> None:
        """Without `saves` nothing is written to a disk, and the state folder is not locked.

        `anafi-mav run --check` opens and closes such a gateway. `on_first_connection` is called once for each drone.
        """
        for index, drone in enumerate(config.drones):
            if drone.address is None:
                raise ConfigError(f"drones[{index}].address", "the gateway connects to addresses; expected one")
        self.config = config
        self._clock: Clock = clock or SystemClock()
        state = state_folder(config.state)
        self._saves = saves
        self._on_first_connection = on_first_connection
        self._keys = KeyRing(None if state is None else folder_of(state), self._clock, saves=saves)
        self._signing_setup = SigningSetup(self._keys, lambda: self._node.channels, lambda: self.systems)
        self._node = Node(
            on_channel=self._on_channel,
            clock=self._clock,
            flavours=tuple(FLAVOURS),
            keys=self._keys,
            on_setup_signing=self._signing_setup.receive,
            factories={"zenoh": self._fabric_endpoint},
        )
        video = config.video_server
        self.relay = (
            None
            if video is None
            else RelayServer(video.host, video.rtsp_port, self._clock, public_host=video.public_host)
        )
        """The video server; None when it is configured off."""
        self._supervised: list[_Supervised] = []
        self._state: Path | None = None
        self._lock: StateLock | None = None
        self._state_problem = ""
        """Why the state folder cannot be used; empty while it can."""
        http = config.http_server
        self.web = (
            None if http is None else HttpServer(http.host, http.port, public_host=video.public_host if video else None)
        )
        """The web server; None when it is configured off. Routes are added before `open`."""
        self._live: LiveVideo | None = None
        if self.web is not None:
            LivePage(self.web, self._entries)
            if self.relay is not None:
                self._live = LiveVideo(self.web, self.relay.source)
            MediaRoutes(self.web, self._drone)
            DefinitionRoutes(self.web, self._definition)
            StatusRoutes(self.web, self.status)
        self._report = StatusReport(self._node, self._clock)
        self._recorder: Recorder | None = None
        self._downloads: Path | None = None
        """Folder for copies of media, once `open` has found it."""

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def open(self) -> None:
        """Lock the state folder, open every endpoint, the video and the web server.

        Raises `ConfigError`; nothing is then left open or locked.

        `start` does it where this has not. It is a step of its own for the command line, which starts a simulator
        only when all endpoints are open.
        """
        if self._node.endpoints:
            return
        self._downloads = download_folder(self.config.media)
        # Lock, keys and token are read and written in the event loop: no drone is connected yet that could wait, and
        # nothing may begin before the folder is this gateway's. Later on all files are the threads' of `disk_writer`.
        self._lock_state()
        try:
            self._recorder = self._start_recording()
            await self._node.start(self.config.endpoints)
            if any(one is not None and one.is_open_to_network for one in (self.relay, self.web)):
                token = load_token(self._state if self._saves else None)
                if self.relay is not None and self.relay.is_open_to_network:
                    self.relay.token = token
                if self.web is not None and self.web.is_open_to_network:
                    self.web.token = token
            if self.relay is not None:
                await self.relay.start()
            if self.web is not None:
                await self.web.start()
            if self._live is not None:
                await self._live.load()
        except BaseException:
            if self.web is not None:
                await self.web.close()
            if self.relay is not None:
                await self.relay.close()
            await self._close_node()
            raise
        self._write_lock()  # the web server answers already, and the simulator may need seconds yet

    def _start_recording(self) -> Recorder | None:
        """Begin to record, where that is configured. Raises `ConfigError`."""
        recording = self.config.recording
        if recording.folder is None:
            return None
        try:
            folder = Path(recording.folder).expanduser()
            if not self._saves:
                check_folder(folder)
                return None
            recorder = Recorder(self._node, self._clock, folder, recording.max_megabytes * 1_000_000)
            recorder.start()
        except (OSError, RuntimeError, ValueError) as error:  # no such home; no path
            problem = f"expected a folder that can be written: {getattr(error, 'strerror', None) or error}"
            raise ConfigError("recording.folder", problem) from error
        return recorder

    def _lock_state(self) -> None:
        """Lock the state folder: two gateways would take each other's drones and overwrite plans."""
        self._state = state_folder(self.config.state)
        if self._state is None:
            self._state_problem = "this user has no home: name a folder by the key state"
            return
        lock = StateLock(self._state)
        try:
            if self._saves:
                holder = lock.acquire()
            else:
                holder = read_holder(self._state)
                check_folder(self._state, FILE)
        except OSError as error:
            if error.errno in NO_LOCKS:  # the folder itself may be as good as any
                logger.warning("%s: cannot be locked: %s", self._state, error.strerror)
                return
            self._state_problem = f"{error.filename or self._state}: {error.strerror or error}"
            logger.warning("state folder cannot be used: %s", self._state_problem)
            return
        if holder is not None:
            raise state_in_use(self._state, holder)
        if self._saves:
            self._lock = lock

    def _unlock_state(self) -> None:
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _write_lock(self) -> None:
        """Have the thread of files write the drones into the lock file: some may be in the air."""
        if self._lock is not None:
            web = "" if self.web is None else self.web.describe()
            self._lock.write_later([supervised.held() for supervised in self._supervised], web)

    def state_problems(self) -> list[str]:
        """Return a line for each problem with reading or storing state; empty without problems."""
        problems = [problem for problem in (self._state_problem, self._keys.problem) if problem]
        return problems + [s.system.memory.problem for s in self._supervised if s.system.memory.problem]

    async def endpoint_problems(self) -> list[str]:
        """Return a line for each problem of an open endpoint, once they are known."""
        found = await asyncio.gather(*(endpoint.problems() for endpoint in self._node.endpoints))
        return [problem for problems in found for problem in problems]

    def _recording_problems(self) -> list[str]:
        problem = "" if self._recorder is None else self._recorder.files.problem
        return [f"recording has gaps: {problem}"] if problem else []

    async def start(self) -> None:
        """Open every endpoint, then begin to connect to every drone.

        Raises `ConfigError`; nothing is left open.
        """
        await self.open()
        self._report.start()
        started = self._clock.monotonic()
        for config in self.config.drones:
            assert config.address is not None
            drone = Drone(
                config.address,
                discovery_port=config.discovery_port,
                http_port=HTTP_PORT if config.http_port is None else config.http_port,
                rtsp_port=RTSP_PORT if config.rtsp_port is None else config.rtsp_port,
                interface=config.interface,
                name=config.name,
                serial=config.serial,
            )
            allow_kill = self.config.allow_kill if config.allow_kill is None else config.allow_kill
            system = System(
                self._node,
                drone,
                config.sysid,
                self._clock,
                started,
                allow_kill=allow_kill,
                state=self._state,
                download_folder=self._downloads,
                uris=self._uris(),
                has_picture_pose=self.config.pose == "video",
                failsafe_limits=FailsafeLimits(self.config.warnings.return_height, self.config.warnings.radio_range),
                position_of=self._position_of,
            )
            if self.relay is not None:
                self.relay.add(DroneSource(config.sysid, config.name, drone))
            if self._recorder is not None:
                self._recorder.add(drone)
            supervised = _Supervised(config, drone, system, self._write_lock, self._on_first_connection)
            supervised.task = asyncio.get_running_loop().create_task(supervised.run())
            self._supervised.append(supervised)
        self._write_lock()

    def _position_of(self, sysid: int) -> SystemPosition | None:
        found = (supervised.system for supervised in self._supervised if supervised.config.sysid == sysid)
        return next((system.position for system in found), None)

    def _fabric_endpoint(self, url: EndpointUrl, sink: Sink, clock: Clock) -> Endpoint:
        return FabricEndpoint(url, sink, clock, _FabricSystems(self))

    def supervised(self, sysid: int) -> _Supervised | None:
        """Return the drone with this system id; None before `start`."""
        return next((supervised for supervised in self._supervised if supervised.config.sysid == sysid), None)

    def system_state(self, sysid: int, session: str) -> bytes | None:
        """Return the state of a system for the fabric, as JSON; None before `start`."""
        supervised = self.supervised(sysid)
        if supervised is None:
            return None
        found = supervised.system.position
        position = None
        if found is not None:
            latitude, longitude = found.place
            age = round(self._clock.monotonic() - found.at, 2)
            position = StatePosition(latitude=latitude, longitude=longitude, amsl_m=round(found.amsl, 2), age_s=age)
        drone = self._report.drone(supervised.reported(), self.relay)
        return SystemState(gateway=session, drone=drone, position=position).encode()

    def _uris(self) -> GatewayUris:
        """Return the addresses of the servers, which are open."""
        if self.relay is None:
            return GatewayUris()
        hint = texts.VIDEO_NEEDS_PUBLIC_HOST if self.relay.is_open_to_network else texts.VIDEO_NEEDS_HOST
        return GatewayUris(rtsp=self.relay.url_for, rtsp_hint=hint)

    def _entries(self) -> list[DroneEntry]:
        return [supervised.entry(has_video=self.relay is not None) for supervised in self._supervised]

    async def ready(self, timeout: float) -> bool:
        """Wait until each drone is connected or one attempt has failed.

        True when all of them are connected. The lock of the state folder has their serial numbers then, unless the disk
        needs more than `DISK_LIMIT`.
        """
        waits = [asyncio.ensure_future(s.first_attempt.wait()) for s in self._supervised]
        if waits:
            _, pending = await asyncio.wait(waits, timeout=timeout)
            for wait in pending:
                wait.cancel()
        if self._lock is not None:
            await STATE_WRITER.drain(DISK_LIMIT)
        return all(s.system.active for s in self._supervised)

    async def close(self) -> None:
        """Hover what flies by our doing, then close every socket. Safe to call twice.

        Clients are not heard any more, or one of them would fly on what has just been stopped.
        """
        self._node.stop_delivering()
        self._report.stop()
        # The drones first: nothing that a viewer, a browser or a video server does may delay their hover.
        await asyncio.gather(*(self._leave(s) for s in self._supervised))
        self._supervised.clear()
        if self.relay is not None:
            await _guarded("the video server", self.relay.close())
        if self.web is not None:
            await _guarded("the web server", self.web.close())
        await self._close_node()

    async def _close_node(self) -> None:
        """Close endpoints and files. What waits for a disk comes last, each within a bound."""
        await self._signing_setup.close()
        await self._node.close()
        if await STATE_WRITER.drain(DISK_LIMIT):
            self._unlock_state()
        else:  # what is late would overwrite the next gateway's files: the lock ends with this process
            logger.warning("state folder: %s", HANGS)
            self._state_problem = self._state_problem or f"{self._state}: {HANGS}"
        if self._recorder is not None:
            await _guarded("the recording", self._recorder.close())

    async def _leave(self, supervised: _Supervised) -> None:
        drone, system = supervised.drone, supervised.system
        if system.active:
            await _guarded(f"the flight of {supervised.config.name}", system.let_go())
        if system.active and not system.vehicle.on_ground:
            # Centred sticks are not acknowledged: stay while they are repeated.
            await asyncio.wait([drone.lost], timeout=HOVER_TIME)
        await _guarded(f"the connection of {supervised.config.name}", supervised.stop())

    @property
    def systems(self) -> tuple[System, ...]:
        """MAVLink system of each drone, listed as in the configuration; empty before `start`."""
        return tuple(supervised.system for supervised in self._supervised)

    def _drone(self, sysid: int) -> Drone | None:
        """Return the drone with this system id."""
        return next((supervised.drone for supervised in self._supervised if supervised.config.sysid == sysid), None)

    def _definition(self, sysid: int) -> tuple[bytes, bytes] | None:
        """Return the camera definition of a connected drone, plain and compressed."""
        systems = [supervised.system for supervised in self._supervised if supervised.config.sysid == sysid]
        content = next((system.definition.content for system in systems if system.active), None)
        return (content.plain, content.packed) if content is not None and content.plain else None

    def lines(self) -> list[str]:
        """One line per drone and per endpoint, one for the video and one for the web server."""
        lines = [s.line() for s in self._supervised]
        lines += [f"endpoint {endpoint.describe()}{endpoint.signing_note}" for endpoint in self._node.endpoints]
        if self.relay is not None:
            lines.append(f"video {self.relay.describe()}")
        if self._recorder is not None:
            lines.append(f"recording {self._recorder.files.path}")
        return lines if self.web is None else [*lines, f"web page {self.web.describe()}"]

    def counters(self) -> Counter[str]:
        """Return all counters: MAVLink's under their own names, each drone's behind its name."""
        result = self._node.counters()
        for s in self._supervised:
            result.update({f"{s.config.name}.{name}": count for name, count in s.drone.counters.items()})
        return result

    def status(self) -> GatewayStatus:
        """Return the record that page, metrics and `anafi-mav status` show."""
        return self._report.gateway(
            [supervised.reported() for supervised in self._supervised],
            problems=[*self.state_problems(), *self._recording_problems()],
            counters=self.counters(),
            relay=self.relay,
            web=self.web,
        )

    def drones_in_air(self) -> list[str]:
        """For each flying drone one sentence on what it will do by itself when the gateway ends.

        What a drone does whose link was lost in the air is not known: it is named as such.
        """
        sentences = []
        for s in self._supervised:
            if not s.system.active:
                if s.is_lost_in_air:
                    sentences.append(f"{s.config.name} was in the air when its link was lost: the gateway looks for it")
                continue
            if s.system.vehicle.on_ground:
                continue
            if (ending := s.system.vehicle.alone) is not None:
                sentences.append(f"{s.config.name} {ending}")
                continue
            delay = s.drone.home.state.delay_s
            after = "after its own delay" if delay is None else f"{delay} s after it lost the link"
            home = "fly home " + after if s.system.vehicle.home is not None else "stay there, for it knows no home"
            sentences.append(f"{s.config.name} is in the air: it will hover and {home}")
        return sentences

    def _on_channel(self, channel: Channel, opened: bool) -> None:
        for supervised in self._supervised:
            if opened:
                supervised.system.channel_opened(channel)
            else:
                supervised.system.channel_closed(channel)


_STOP_KINDS = {
    Effect.STOP: StopKind.IN_PLACE,
    Effect.HOLD: StopKind.IN_PLACE,
    Effect.LAND: StopKind.IN_PLACE,
    Effect.RETURN: StopKind.HOME,
}
"""A late KILL is none of them: motors are cut for what its sender sees at that moment."""


class _FabricSystems:
    """The systems of a gateway, as its fabric endpoints see them."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    def sysids(self) -> list[int]:
        return [drone.sysid for drone in self._gateway.config.drones]

    def state(self, sysid: int, session: str) -> bytes | None:
        return self._gateway.system_state(sysid, session)

    def is_on_ground(self, sysid: int) -> bool:
        supervised = self._gateway.supervised(sysid)
        return supervised is not None and supervised.system.active and supervised.system.vehicle.on_ground

    def stop_kind(self, sysid: int, inbound: Inbound) -> StopKind | None:
        supervised = self._gateway.supervised(sysid)
        effect = None if supervised is None else supervised.system.stop_of(inbound)
        return None if effect is None else _STOP_KINDS.get(effect)

    def uses_target(self, sysid: int, inbound: Inbound) -> bool:
        supervised = self._gateway.supervised(sysid)
        return supervised is not None and supervised.system.uses_target(inbound)

    def is_started(self) -> bool:
        return bool(self._gateway.systems)

    def report_id(self, sysid: int, *, is_taken: bool) -> bool:
        supervised = self._gateway.supervised(sysid)
        if supervised is not None:
            supervised.system.set_notice(texts.SYSTEM_ID_TAKEN.fill(sysid=sysid), is_true=is_taken)
        return supervised is not None

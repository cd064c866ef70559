"""One simulated drone: its firmware behind the real sockets of an ANAFI."""

from __future__ import annotations

import asyncio
import ipaddress
import os
import random
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from anafi_mav.arsdk.codec.wire import Buffer, Message, UnknownMessage
from anafi_mav.arsdk.link import handshake
from anafi_mav.arsdk.link.device import DeviceServer, DeviceSession
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.link.session import OnMessage
from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.mux.mux_link import MuxServer
from anafi_mav.arsdk.video.rtsp import DEFAULT_PORT as RTSP_PORT
from anafi_mav.errors import ConfigError
from anafi_mav.sim.autopilot.firmware import Firmware, Identity
from anafi_mav.sim.autopilot.power import Battery
from anafi_mav.sim.http import WebServer
from anafi_mav.sim.log import Log, LogEntry
from anafi_mav.sim.skycontroller import MODELS as SKYCONTROLLERS
from anafi_mav.sim.skycontroller import Skycontroller
from anafi_mav.sim.states import all_settings, all_states
from anafi_mav.sim.telemetry import RATE, Telemetry
from anafi_mav.sim.video.rtsp import VideoServer
from anafi_mav.sim.world import quirks
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.faults import Faults
from anafi_mav.sim.world.link_emulation import LinkEmulation
from anafi_mav.sim.world.model import model_of
from anafi_mav.sim.world.motion import Pose
from anafi_mav.sim.world.place import WorldOrigin
from anafi_mav.sim.world.quirks import Quirk, Scramble
from anafi_mav.sim.world.scramble import Scrambler
from anafi_mav.sim.world.wind import CALM, Wind, WindSpec

POSE_PERIOD = 0.1
"""s between two poses in the log."""

HTTP_PORT = 80
SKYCONTROLLER_PORTS = 100
"""A Skycontroller offers the TCP ports of its drone this much higher: HTTP at 180."""

SESSION_KEPT = 8.0
"""s of silence after which a session of the quirk `handshake-refused-8s` is no obstacle (libarsdk: four times 2 s)."""

SHUTDOWN_TIME, REBOOT_TIME = 1.0, 10.0
"""s from the order to reboot until the drone is gone, and until it is back. Assumed: an aircraft takes longer."""

HIGHEST = 10_000.0
"""m above or below the sea that a drone may stand at; the ground of the earth does not reach as far."""
MAX_LATENCY = 2.0
"""s that a camera may take for a picture; at more, a program gives up before the first one."""
MAX_RATE = 200.0
"""Hz. The motion is computed 60 times a second; what is sent more often is sent again."""


@dataclass(frozen=True)
class DroneSpec:
    """Configuration of a simulated drone. Raises `ConfigError` for impossible values."""

    model: str = "4k"
    address: str = "127.0.42.1"
    home: tuple[float, float, float] = (48.8789, 2.3677, 35.0)
    """deg, deg, and the height of the ground in m above mean sea level; the drone stands there."""
    serial: str | None = None
    """18 characters; None makes one of the address."""
    name: str | None = None
    """None makes one of the serial number, as Parrot does."""
    discovery_port: int = handshake.DISCOVERY_PORT
    handshake_port: int = handshake.HANDSHAKE_PORT
    c2d_port: int = handshake.C2D_PORT
    http_port: int | None = HTTP_PORT
    """None: no web server."""
    rtsp_port: int | None = RTSP_PORT
    """None: no video."""
    video_latency: float = 0.0
    """s from a picture to its first packet: exposure and encoder."""
    versions: tuple[int, int] = (1, 3)
    """Lowest and highest ARSDK protocol version offered."""
    telemetry_rate: float = RATE
    """Hz of attitude, speed and height."""
    storage: int | None = None
    """Bytes of its memory card; None: as large as the model's."""
    skycontroller: int | None = None
    """The generation of the Skycontroller in front of it, whose address `address` then is; None: there is none."""
    wind: WindSpec = CALM
    """Wind at the start."""
    firmware_quirks: tuple[str, ...] = ()
    """Names of the `Quirk`s that its firmware has from the start."""

    def __post_init__(self) -> None:
        model = model_of(self.model)
        try:
            ipaddress.IPv4Address(self.address)
        except ValueError:
            raise ConfigError("address", f"expected an IPv4 address, got {self.address!r}") from None
        latitude, longitude, altitude = self.home
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and abs(altitude) <= HIGHEST):
            wanted = f"latitude, longitude (deg) and altitude (up to {HIGHEST:g} m)"
            raise ConfigError("home", f"expected {wanted}, got {self.home}")
        for key in ("discovery_port", "handshake_port", "c2d_port", "http_port", "rtsp_port"):
            port = getattr(self, key)
            if port is not None and not 0 <= port < 65536:
                raise ConfigError(key, f"expected a port from 0 to 65535, got {port}")
        lowest, highest = self.versions
        if not 1 <= lowest <= highest <= 3:
            raise ConfigError("versions", f"expected the lowest and the highest of 1 to 3, got {self.versions}")
        if not 0.0 <= self.video_latency <= MAX_LATENCY:
            raise ConfigError("video_latency", f"expected up to {MAX_LATENCY:g} s, got {self.video_latency:g}")
        if not 0.0 < self.telemetry_rate <= MAX_RATE:
            raise ConfigError("telemetry_rate", f"expected up to {MAX_RATE:g} Hz, got {self.telemetry_rate:g}")
        if self.storage is not None and not 0 <= self.storage < 1 << 63:
            raise ConfigError("storage", f"expected a number of bytes, got {self.storage}")
        if self.skycontroller is not None:
            if self.skycontroller not in SKYCONTROLLERS:
                expected = " or ".join(map(str, SKYCONTROLLERS))
                raise ConfigError("skycontroller", f"expected {expected}, got {self.skycontroller}")
            if self.skycontroller not in model.record.skycontrollers:
                problem = f"which a Skycontroller {self.skycontroller} cannot fly"
                raise ConfigError("skycontroller", f"expected another model than {self.model}, {problem}")
        quirks.named(self.firmware_quirks, "firmware_quirk")
        if self.serial is not None and not 5 <= len(self.serial) <= 32:
            raise ConfigError("serial", f"expected 5 to 32 characters, got {self.serial!r}")


class SimulatedDrone:
    """A drone on the network. `log` says what it went through, `faults` is where to break it."""

    def __init__(
        self, spec: DroneSpec, body: Airframe, log: Log, clock: Callable[[], float], chance: random.Random, phase: float
    ) -> None:
        model = model_of(spec.model)
        serial = spec.serial or _serial(model.serial_prefix, spec.address)
        identity = Identity(
            serial=serial,
            name=spec.name or f"{model.title}-{serial[-7:]}",
            boot_id=f"{chance.getrandbits(128):032X}",
            run_id=f"{chance.getrandbits(128):032X}",
        )
        self.spec = spec
        self.identity = identity
        self.log = log
        self.faults = Faults(quirks=quirks.named(spec.firmware_quirks, "firmware_quirk"))
        self.faults.on_mute = self._mute_link
        self.wind = Wind(spec.wind, random.Random(chance.getrandbits(64)))
        """Set its `spec` to let it blow."""
        self._air = LinkEmulation(self.faults, random.Random(chance.getrandbits(64)), _later)
        self.http_problem = ""
        """Reason why the requested web server does not run; empty when it runs or was not requested."""
        self.rtsp_problem = ""
        """The same of the video."""
        self._clock = clock
        self._body = body
        self.firmware = Firmware(
            model, identity, body, WorldOrigin(*spec.home), self._emit, self._note, self.faults, chance
        )
        self.firmware.payload.calendar.begin(time.time())
        if spec.storage is not None:
            self.firmware.payload.storage.place.capacity = spec.storage
        self._telemetry = Telemetry(self.firmware, spec.telemetry_rate, phase)
        self._info = DeviceInfo(model.product_id, serial, spec.handshake_port, identity.name)
        self.skycontroller: Skycontroller | None = None
        """The controller in front of it, if there is one."""
        if spec.skycontroller is not None:
            self.skycontroller = Skycontroller(
                spec.skycontroller, self._info, self._on_command, self._note, self._radio_changed
            )
            self._info = self.skycontroller.info
        self._server: DeviceServer | MuxServer | None = None
        self._web: WebServer | None = None
        # The video has luck of its own, so that what else happens is the same whether it is watched or not.
        luck = random.Random(identity.boot_id)
        video_air = LinkEmulation(self.faults, luck, _later)
        self._video = VideoServer(
            self.firmware,
            luck,
            lambda name, args: log.add(clock(), "video", name, args),
            lambda: self._audible,
            lambda data, deliver: video_air(data, False, deliver) if self._shows_pictures else None,
            latency=spec.video_latency,
        )
        self._session: DeviceSession | None = None
        self._quirks: frozenset[Quirk | Scramble] = frozenset()
        """Quirks that `_scrambler` is made for."""
        self._scrambler: Scrambler | None = None
        self._next_pose = 0.0
        self._closing = False
        self._off_at: float | None = None
        self._off_until: float | None = None
        """Simulated times at which a drone that reboots is gone, and back."""
        self._factory = False
        """It comes back as from the factory."""
        self._chance = chance

    # -- what tests and scenarios use

    @property
    def address(self) -> str:
        return self.spec.address

    @property
    def time(self) -> float:
        """Simulated seconds since the world began."""
        return self.firmware.time

    @property
    def battery(self) -> Battery:
        return self.firmware.battery

    @property
    def pose(self) -> Pose:
        """The true pose."""
        return self.firmware.pose

    @property
    def powered(self) -> bool:
        """False while it reboots."""
        return self._off_until is None

    @property
    def flying_state(self) -> FlyingState:
        return self.firmware.state

    @property
    def session(self) -> DeviceSession | None:
        """The controller's session while its link is up."""
        return self._session

    @property
    def discovery_port(self) -> int:
        return 0 if self._server is None else self._server.discovery_port

    @property
    def handshake_port(self) -> int:
        return 0 if self._server is None else self._server.handshake_port

    @property
    def http_port(self) -> int | None:
        """Return the web server's port, or None without a web server."""
        return None if self._web is None else self._web.port

    @property
    def web(self) -> WebServer | None:
        """The web server; None without one."""
        return self._web

    @property
    def rtsp_port(self) -> int | None:
        """Return the video server's port, or None without a video server."""
        return self._video.port or None

    def throw(self) -> None:
        """Hand launch: counts after UserTakeOff."""
        self.firmware.throw()

    def inject(self, event: Message) -> None:
        """Send an event as the drone's firmware does, although nothing of it has happened.

        The state of the simulated drone stays as it is, and what the drone reports next may contradict the event. Like
        every event it is logged, unless its buffer is not acknowledged, and is subject to `faults.unreported`.
        """
        self._emit(event)

    def note(self, name: str, args: dict[str, Any]) -> None:
        """Leave a line of kind "scenario" in the log."""
        self.log.add(self._clock(), "scenario", name, args)

    def place(self, north: float, east: float, heading: float = 0.0) -> None:
        """Carry the drone to another spot (m from home, rad). It must be on the ground."""
        self._body.place(north, east, heading)

    async def wait_log(
        self, predicate: Callable[[LogEntry], bool], timeout: float = 5.0, *, since: float = float("-inf")
    ) -> LogEntry:
        """See `Log.wait`."""
        return await self.log.wait(predicate, timeout, since=since)

    # -- life

    async def start(self) -> None:
        """Open the sockets. Raises `OSError` when a port but the web or video server's is taken."""
        spec = self.spec
        if self.skycontroller is not None:
            self.firmware.link_up()
        if spec.skycontroller == 4:
            self._server = await MuxServer.start(
                spec.address,
                info=self._info,
                versions=spec.versions,
                on_session=self._on_session,
                tcp_port=self._tcp_port,
            )
        else:
            self._server = await DeviceServer.start(
                spec.address,
                discovery_port=spec.discovery_port,
                handshake_port=spec.handshake_port,
                c2d_port=spec.c2d_port,
                info=self._info,
                versions=spec.versions,
                on_session=self._on_session,
            )
        self._server.refuses = self._refuses
        self._mute_link(self.faults.mute)
        if spec.http_port is not None:
            await self._start_web(spec.http_port)
        if spec.rtsp_port is not None:
            # A Skycontroller offers its drone's video at the same port.
            try:
                await self._video.start(spec.address, spec.rtsp_port)
            except OSError as error:
                self.rtsp_problem = f"no video on port {spec.rtsp_port}: {os.strerror(error.errno or 0)}"

    async def _start_web(self, port: int) -> None:
        web = self._make_web()
        if self.skycontroller is not None and port:
            port += SKYCONTROLLER_PORTS
        try:
            await web.start(self.spec.address, port)
        except OSError as error:
            self.http_problem = f"no HTTP on port {port}: {os.strerror(error.errno or 0)}"
        else:
            self._web = web

    def _tcp_port(self, port: int) -> int:
        """Return the port at the Skycontroller's address that forwards to a port of the drone.

        `port` may be the number on the real drone or this simulation's own.
        """
        if port in (HTTP_PORT, self.spec.http_port):
            return self.http_port or port
        if port in (RTSP_PORT, self.spec.rtsp_port):
            return self.rtsp_port or port
        return port

    def _make_web(self) -> WebServer:
        firmware, model = self.firmware, self.firmware.model
        properties = {
            "model": model.name,
            "serial": self.identity.serial,
            "name": self.identity.name,
            "software": model.software,
            "hardware": model.hardware,
        }
        calendar = firmware.payload.calendar
        return WebServer(
            firmware.payload.media,
            firmware.plans,
            firmware.flight_logs,
            properties,
            lambda: calendar.date(firmware.time),
            lambda: Quirk.NO_HTTP_RANGE not in self.faults.quirks,
        )

    async def close(self) -> None:
        """Close the sockets, without a word to the controller: ARSDK has no goodbye. Idempotent."""
        self._closing = True
        if self._server is not None:
            await self._server.close()
        if self._web is not None:
            await self._web.close()
        await self._video.close()

    def tick(self, now: float, elapsed: float, passed: float, pose: Pose, arrived: bool, still: bool) -> None:
        """Called by the simulation after each of its turns; see `Firmware.tick`.

        The world has moved on by `elapsed` simulated seconds, for which it takes `passed` s of the host's clock.
        """
        self.firmware.tick(now, elapsed, pose, arrived, still)
        if self._off_at is not None and self.time >= self._off_at:
            self._go_off()
        elif self._off_until is not None and self.time >= self._off_until:
            self._boot()
        if elapsed and (self.wind.spec is not CALM or self._body.windy):
            self._body.blow(*self.wind.advance(elapsed))
        if self.skycontroller is not None:
            self.skycontroller.tick(now)
        self._video.tick(now, passed)
        scrambler = self._scrambling()
        if scrambler is not None and self.time >= scrambler.next:
            scrambler.advance(self.time)
        session = self._session
        if session is not None and now >= self._telemetry.next and self._in_reach:
            unreported = self.faults.unreported
            for message in self._telemetry.due(now):
                if message.NAME not in unreported:
                    self._report(message, session.send)
            session.flush()  # each drone's own, and not those of a fleet together when all have been computed
        if now >= self._next_pose:
            self._next_pose = max(self._next_pose + POSE_PERIOD, now)
            if self.log.used:
                self._log_pose(now, pose)

    def _log_pose(self, now: float, pose: Pose) -> None:
        latitude, longitude = self.firmware.place()
        args = {
            "time": self.firmware.time,
            "north": pose.north,
            "east": pose.east,
            "up": pose.up,
            "lat": latitude,
            "lon": longitude,
            "ato": pose.up,
            "roll": pose.roll,
            "pitch": pose.pitch,
            "yaw": pose.yaw,
            "vn": pose.vn,
            "ve": pose.ve,
            "vd": pose.vd,
            "gimbal_pitch": self.firmware.gimbal.attitude(pose).pitch_absolute,
        }
        self.log.add(now, "pose", "true", args)

    # -- the link

    def _refuses(self) -> bool:
        """Return True when the handshake of another controller must be refused.

        A firmware with this quirk keeps a controller's session, silent or not.
        """
        session = self._session
        keeps = Quirk.HANDSHAKE_REFUSED_8S in self.faults.quirks
        return keeps and session is not None and self._clock() - session.last_received < SESSION_KEPT

    def _mute_link(self, mute: bool) -> None:
        if self._server is not None:
            self._server.mute = mute or (self.skycontroller is None and not self.powered)
        if self._web is not None:
            self._web.mute = not self._audible

    @property
    def _shows_pictures(self) -> bool:
        """True when datagrams of the video leave the drone."""
        return self._audible and not self.faults.no_pictures

    @property
    def _audible(self) -> bool:
        """Whatever the drone says goes through the air."""
        return self._in_reach and not self.faults.mute

    # -- its power

    def _reboot(self, factory: bool) -> None:
        """Be gone soon, and for a while."""
        self._off_at, self._factory = self.time + SHUTDOWN_TIME, factory

    def _go_off(self) -> None:
        """Power off without notice: the link is silent from here on."""
        if self.firmware.state is not FlyingState.LANDED:
            self._off_at = None
            return
        self._off_at, self._off_until = None, self.time + REBOOT_TIME
        self.log.add(self._clock(), "state", "power", {"on": False, "factory": self._factory})
        if self.skycontroller is not None:
            self.skycontroller.radio = False
        self._mute_link(self.faults.mute)

    def _boot(self) -> None:
        chance = self._chance
        ids = (f"{chance.getrandbits(128):032X}", f"{chance.getrandbits(128):032X}")
        self.identity = replace(self.identity, boot_id=ids[0], run_id=ids[1])
        self.firmware.reboot(self.identity, factory=self._factory)
        self._off_until = None
        self.log.add(self._clock(), "state", "power", {"on": True, "boot_id": ids[0]})
        if self.skycontroller is not None:
            self.skycontroller.radio = True
        elif self._session is not None:
            self._session.end("the drone has rebooted")
        self._mute_link(self.faults.mute)

    def _on_session(self, session: DeviceSession) -> OnMessage:
        now = self._clock()
        if self._scrambler is not None:
            self._scrambler.flush()  # the new session gets all states, and nothing older after them
        self._session = session
        session.mute = self.faults.mute or (self.skycontroller is None and not self.powered)
        session.air = self._air
        session.lost.add_done_callback(lambda lost: self._on_lost(session, lost.result()))
        self.log.add(now, "session", "up", {"peer": session.peer, "version": session.version})
        if self.skycontroller is None:
            self.firmware.link_up()
        else:
            self.skycontroller.link_up(session.send)

        def on_message(message: Message | UnknownMessage, now: float) -> None:
            self._on_message(session, message, now)

        return on_message

    def _on_lost(self, session: DeviceSession, reason: str) -> None:
        if self._session is not session:
            return
        self._session = None
        self.log.add(self._clock(), "session", "lost", {"reason": reason})
        if self.skycontroller is not None:
            self.skycontroller.link_lost()
        elif not self._closing:
            self.firmware.link_lost()

    @property
    def _in_reach(self) -> bool:
        return self.powered and (self.skycontroller is None or self.skycontroller.radio)

    def _radio_changed(self, up: bool) -> None:
        """The Skycontroller is in reach again, or not any more."""
        if up:
            self.firmware.link_up()
        else:
            self.firmware.link_lost()
        self._mute_link(self.faults.mute)

    def _on_message(self, session: DeviceSession, message: Message | UnknownMessage, now: float) -> None:
        if self.skycontroller is not None and self.skycontroller.receive(message, now):
            self.log.add_message(now, "controller", message)
            return
        self.log.add_message(now, "command", message)
        if isinstance(message, common.AllStates):
            self._send_all(session, all_states(self.firmware), common.AllStatesChanged())
        elif isinstance(message, common.AllSettings):
            self._send_all(session, all_settings(self.firmware), common.AllSettingsChanged())
        elif isinstance(message, common.Reboot | common.FactoryReset):
            if self.firmware.state is FlyingState.LANDED and self._off_at is None:
                self._reboot(isinstance(message, common.FactoryReset))
        else:
            self.firmware.receive(message, now)

    def _on_command(self, message: Message | UnknownMessage, now: float) -> None:
        """A command of the Skycontroller's own."""
        if self._in_reach:
            self.log.add_message(now, "command", message)
            self.firmware.receive(message, now)

    def _send_all(self, session: DeviceSession, messages: list[Message], end: Message) -> None:
        for message in messages:
            if not self._unreported(message):
                self._report(message, session.send)
        self._report(end, session.send)

    def _unreported(self, message: Message) -> bool:
        """True for an event that this firmware does not send."""
        if isinstance(message, common.FlightId) and Quirk.NO_FLIGHT_ID in self.faults.quirks:
            return True
        return message.NAME in self.faults.unreported

    def _emit(self, message: Message) -> None:
        if self._unreported(message):
            return
        if late := self.faults.late.get(message.NAME, 0.0):
            asyncio.get_running_loop().call_later(late, self._report, message, self._send)
        else:
            self._report(message, self._send)

    def _report(self, message: Message, send: Callable[[Message], object]) -> None:
        """Send a message, unless the quirk `scramble` drops it, holds it back or repeats it."""
        scrambler = self._scrambling()
        if scrambler is None:
            send(message)
        elif message.BUFFER is not Buffer.NON_ACK:
            scrambler.add(message, send, self.time)
            scrambler.advance(self.time)
        elif scrambler.keeps(message):
            send(message)

    def _scrambling(self) -> Scrambler | None:
        """Return what scrambles the events of this firmware, or None when nothing does."""
        if self.faults.quirks is not self._quirks:
            self._quirks = self.faults.quirks
            seed = next((quirk.seed for quirk in self._quirks if isinstance(quirk, Scramble)), None)
            if self._scrambler is not None and self._scrambler.seed != seed:
                self._scrambler.flush()
                self._scrambler = None
            if self._scrambler is None and seed is not None:
                self._scrambler = Scrambler(seed)
        return self._scrambler

    def _send(self, message: Message) -> None:
        if message.BUFFER is not Buffer.NON_ACK:
            self.log.add_message(self._clock(), "event", message)
        if self.skycontroller is not None:
            self.skycontroller.heard_from_drone(message)
        if self._session is not None and self._in_reach:
            self._session.send(message)

    def _note(self, name: str, args: dict[str, Any]) -> None:
        self.log.add(self._clock(), "state" if name == "flying" else "plan", name, args)


def _later(seconds: float, function: Callable[[], None]) -> None:
    asyncio.get_running_loop().call_later(seconds, function)


def _serial(prefix: str, address: str) -> str:
    """A serial number that belongs to the address, so that a drone keeps it from run to run."""
    return f"{prefix}{int(ipaddress.IPv4Address(address)) % 1_000_000:06d}"

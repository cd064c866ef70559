"""Ten sessions of clients that together use every service, each recorded by `tests/bench/sessions.py`.

A session waits for acknowledgements, heartbeats and what the simulated drone itself does, never for a text: texts may
change between two recordings.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import lzma
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav import geo
from anafi_mav.errors import CommandTimeout
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim.world.faults import Impairment
from support import setpoints
from support.ftp import LIST, OPEN, READ, RESET, TERMINATE, Ftp
from support.mav import NAN, Client, kind_of
from support.missions import LAND as LAND_ITEM
from support.missions import PLACE, RTL, takeoff, way
from support.params import fetch, send_set
from support.plans import FENCE, MISSION, RALLY, Item, circle, clear, download, rally, square, upload
from support.recording import FILES, Line, file_transfer, joined, kept, printed, rebased
from support.world import HOME, UDP_PORT, World, world

Cmd = dialect
PARAM_INT32, PARAM_REAL32 = dialect.MAV_PARAM_TYPE_INT32, dialect.MAV_PARAM_TYPE_REAL32

PAGES: list[dict[str, Any]] = json.loads((Path(__file__).parent / "qgroundcontrol.json").read_text())["pages"]

RECORDED = ("command", "state", "plan", "session", "scenario")
"""Kinds of entries of the simulator's log that are recorded."""

IN_PIECES = {"STATUSTEXT": joined, "SERIAL_CONTROL": printed}
"""Messages whose texts are recorded whole: into how many they are cut follows from the text."""

PX4 = {
    "manual": (1, 1, 0),
    "altitude": (1, 2, 0),
    "position": (1, 3, 0),
    "takeoff": (1, 4, 2),
    "hold": (1, 4, 3),
    "mission": (1, 4, 4),
    "return": (1, 4, 5),
    "land": (1, 4, 6),
    "follow": (1, 4, 8),
    "offboard": (1, 6, 0),
}
"""Parameters of DO_SET_MODE."""

COPTER = {"auto": 3, "guided": 4, "loiter": 5, "rtl": 6, "circle": 7, "land": 9, "brake": 17, "smart rtl": 21}

EVERY = 0.05
"""s between two setpoints."""


class Session:
    """One session under way: what happens in its worlds becomes lines."""

    def __init__(self, number: int) -> None:
        self.lines: list[Line] = []
        self._number = number
        self._start = now()
        self._worlds = 0
        self._stations: list[asyncio.Task[None]] = []
        self.w: World
        """The world under way."""

    @asynccontextmanager
    async def world(self, **options: Any) -> AsyncIterator[World]:
        """A world whose clients and drone are recorded; its clients send heartbeats as ground stations do."""
        self._worlds += 1
        # The serial number of a simulated drone follows from its address.
        address = f"127.62.{self._number}.{self._worlds}"
        async with world(speed=1.0, drone_address=address, **options) as self.w:
            for client in self.w.clients:
                self.station(client)
            try:
                yield self.w
            finally:
                for task in self._stations:
                    task.cancel()
                await asyncio.gather(*self._stations, return_exceptions=True)
                self._stations.clear()
                self._collect()

    def station(self, client: Client) -> None:
        """Let a client send a heartbeat every second."""

        async def beat() -> None:
            while True:
                client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
                await asyncio.sleep(1.0)  # the station's own rate

        self._stations.append(asyncio.ensure_future(beat()))

    def note(self, text: str, **fields: Any) -> None:
        """Leave a line that says what the session does."""
        self.lines.append(Line(now(), "session", text, fields))

    def _collect(self) -> None:
        drone = self.w.drone
        for index, client in enumerate(self.w.clients):
            recipient = f"mavlink {client.sysid}/{client.compid} #{self._worlds}.{index}"
            whole: dict[tuple[tuple[int, int], str], list[tuple[float, dict[str, Any]]]] = {}
            for at, message in client.received:
                name = kind_of(message)
                source = (message.get_srcSystem(), message.get_srcComponent())
                fields = {key: value for key, value in message.to_dict().items() if key != "mavpackettype"}
                if name == FILES:
                    fields = file_transfer(bytes(message.payload))
                if name in IN_PIECES:
                    whole.setdefault((source, name), []).append((at, fields))
                    continue
                self.lines.append(Line(at, recipient, name, {"from": list(source), **kept(name, fields)}))
            for (source, name), pieces in whole.items():
                for at, fields in IN_PIECES[name](pieces):
                    self.lines.append(Line(at, recipient, name, {"from": list(source), **fields}))
            if client.bad:
                self.lines.append(Line(now(), recipient, "BAD_DATA", {"count": client.bad}))
        entries = list(drone.log)
        if len(entries) >= 40_000:
            raise AssertionError("the simulator's log has forgotten its beginning")
        for entry in entries:
            if entry.kind in RECORDED:
                recipient = f"drone #{self._worlds}" if entry.kind == "command" else f"simulator #{self._worlds}"
                plain = msgspec.json.decode(msgspec.json.encode(entry.args))
                self.lines.append(Line(entry.t, recipient, entry.name, kept(entry.name, plain)))

    def result(self) -> list[Line]:
        """Return the recording."""
        written = [Line.read(str(line)) for line in self.lines]  # numbers as a file holds them
        return rebased(written, self._start)

    # -- what clients do

    async def command(self, id: int, *params: float, client: Client | None = None, **more: Any) -> int:
        """Send a command; its final result, -1 without one."""
        try:
            ack = await (client or self.w.client).command(id, *params, **more)
        except AssertionError:
            result = -1
        else:
            result = int(ack.result)
        self.note(f"MAV_CMD {id}", result=result)
        return result

    async def mode(self, name: str, client: Client | None = None) -> int:
        """Command a mode by DO_SET_MODE."""
        numbers = PX4[name] if self.w.flavour == "px4" else (1, COPTER[name])
        return await self.command(Cmd.MAV_CMD_DO_SET_MODE, *numbers, client=client)

    async def take_off(self, height: float = 6.0) -> None:
        """Arm, take off, and wait until the drone has climbed."""
        if self.w.flavour == "ardupilot":
            await self.mode("guided")
        await self.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        await self.command(Cmd.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=height)
        await self.until(lambda pose: abs(pose.up - height) < 0.4 and abs(pose.vd) < 0.2, 20.0)

    async def until(self, true: Callable[[Any], bool], timeout: float) -> None:
        """Wait until the drone's true pose is as wanted, at most so long."""
        drone = self.w.drone
        with contextlib.suppress(CommandTimeout):
            await drone.wait_log(lambda entry: entry.kind == "pose" and true(drone.pose), timeout, since=now())

    async def landed(self, timeout: float = 30.0) -> None:
        """Wait until the drone has landed, at most so long, and for the vehicle to disarm."""
        drone = self.w.drone
        with contextlib.suppress(CommandTimeout):
            if drone.flying_state.name != "LANDED":
                await drone.wait_log(lambda entry: drone.flying_state.name == "LANDED", timeout, since=now())
        await asyncio.sleep(1.5)  # it disarms

    async def stream(self, message: Any | Callable[[float], Any], seconds: float, every: float = EVERY) -> None:
        """Send a message at a rate for so long; a function gets the s since the beginning."""
        begun = now()
        while (elapsed := now() - begun) < seconds:
            self.w.client.send(message(elapsed) if callable(message) else message)
            await asyncio.sleep(every)  # the program's own rate

    async def request(self, *ids: int, client: Client | None = None) -> None:
        """Request messages once, each by REQUEST_MESSAGE."""
        for id in ids:
            await self.command(Cmd.MAV_CMD_REQUEST_MESSAGE, id, client=client, timeout=2.0)

    async def file(self, path: str) -> bytes:
        """Download a file by FTP bursts; its content becomes lines."""
        content = await Ftp(self.w.client).download(path)
        plain = lzma.decompress(content) if path.endswith(".xz") else content
        name = path.removesuffix(".xz")
        if name.endswith(".json"):
            for number, row in enumerate(json.dumps(without_checksums(json.loads(plain)), indent=0).split("\n")):
                self.lines.append(Line(now(), f"file {path}", str(number), {"text": row}))
        else:
            self.lines.append(Line(now(), f"file {path}", "content", {"hex": plain.hex()}))
        return content

    async def ask(self, ftp: Ftp, opcode: int, data: bytes = b"", **more: Any) -> Any:
        """Send one FTP request; None when nothing answers."""
        with contextlib.suppress(AssertionError):
            return await ftp.ask(opcode, data, **more)
        return None

    async def upload(self, items: list[Item], kind: int = MISSION, **more: Any) -> int:
        """Upload a plan in the manner of the flavour; the type of the MISSION_ACK."""
        listed = (
            [Item(dialect.MAV_CMD_NAV_WAYPOINT, *HOME), *items]
            if kind == MISSION and self.w.flavour == "ardupilot"
            else items
        )
        ack = await upload(self.w.client, listed, kind, **more)
        self.note("upload", kind=kind, type=int(ack.type))
        return int(ack.type)

    async def goto(self, north: float, east: float, height: float, *, yaw: float = NAN, **more: Any) -> int:
        """DO_REPOSITION to m north, east and above home."""
        place = geo.destination(*HOME[:2], north, east)
        words = (-1, 1, 0, yaw)
        return await self.command(Cmd.MAV_CMD_DO_REPOSITION, *words, frame=6, x=place[0], y=place[1], z=height, **more)


def now() -> float:
    return asyncio.get_running_loop().time()


def without_checksums(document: Any) -> Any:
    """Return a document of component metadata without the checksums of other files, which hold texts."""
    if isinstance(document, Mapping):
        return {key: without_checksums(value) for key, value in document.items() if "crc" not in key.lower()}
    return [without_checksums(value) for value in document] if isinstance(document, list) else document


# -- the sessions


async def qgroundcontrol_px4(s: Session) -> None:
    """The connect sequence of QGroundControl, its pages, and the housekeeping of a long connection."""
    async with s.world(web=True, udp=True) as w:
        client = w.client
        s.station(w.take(Client(250).connect_udp(w.address, UDP_PORT)))
        await asyncio.sleep(1.3)
        await s.request(148, 300, 435, 436, 242, 397, 395, 396, 259, 269, 280, 99999)
        await fetch(client)
        for kind in (MISSION, FENCE, RALLY):
            await download(client, kind)
        ftp = Ftp(client)
        await s.ask(ftp, RESET)
        await s.ask(ftp, LIST, b"/")
        await s.ask(ftp, LIST, b"/log")
        await s.ask(ftp, OPEN, b"/nothing.here")
        await s.ask(ftp, 6, b"/written.txt")  # CreateFile
        for path in ("/general.json.xz", "/general.json", "/parameter.json.xz", "/events.json.xz"):
            await s.file(path)
        opened = await s.ask(ftp, OPEN, b"/events.json")
        if opened is not None:
            await s.ask(ftp, READ, session=opened.session, size=120, offset=240)
            await s.ask(ftp, TERMINATE, session=opened.session)
        for page in PAGES:
            if page["flavour"] == "px4":
                for name in page["names"]:
                    client.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
                await asyncio.sleep(0.4)
        for index in (0, 5, 1000):
            client.send(dialect.MAVLink_param_request_read_message(1, 1, b"", index))
        client.send(dialect.MAVLink_param_request_read_message(1, 1, b"CAL_MAG7_ROT", -1))
        for name, value, kind in (
            ("ANF_MAX_TILT", 22.0, PARAM_REAL32),
            ("MPC_XY_VEL_MAX", 6.0, PARAM_REAL32),
            ("RTL_RETURN_ALT", 25.0, PARAM_REAL32),
            ("ANF_GCS_LOSS", 2, PARAM_INT32),
            ("ANF_GCS_LOSS", 77, PARAM_INT32),
            ("COM_RC_LOSS_T", 3.0, PARAM_REAL32),
            ("NOT_THERE", 1.0, PARAM_REAL32),
        ):
            send_set(client, name, value, kind)
            await asyncio.sleep(0.7)
        for id, interval in ((30, 200_000), (33, 500_000), (24, -1), (74, 1_000_000), (85, 0), (99999, 1_000_000)):
            await s.command(Cmd.MAV_CMD_SET_MESSAGE_INTERVAL, id, interval)
            await s.command(Cmd.MAV_CMD_GET_MESSAGE_INTERVAL, id)
        for number in range(3):
            client.send(dialect.MAVLink_timesync_message(0, 1000 + number))
            client.send(dialect.MAVLink_ping_message(77, number, 0, 0))
            await asyncio.sleep(0.31)
        client.send(newer.MAVLink_request_event_message(1, 1, 0, 3))
        client.send(dialect.MAVLink_system_time_message(round(1.8e15), 0))
        await s.command(newer.MAV_CMD_RUN_PREARM_CHECKS)
        await s.command(Cmd.MAV_CMD_DO_SEND_BANNER)
        every = [id for id in (*range(1, 1000), *range(12900, 12921), *newer.mavlink_map) if id in newer.mavlink_map]
        await s.request(*dict.fromkeys(id for id in every if id not in (0, 22, 43, 44, 47, 51, 69, 70, 76, 75)))
        await s.command(newer.MAV_CMD_CONTROL_HIGH_LATENCY, 1)
        await asyncio.sleep(6.0)
        await s.command(newer.MAV_CMD_CONTROL_HIGH_LATENCY, 0)
        await asyncio.sleep(2.0)


async def ground_station_ardupilot(s: Session) -> None:
    """MAVProxy and Mission Planner at the ArduPilot flavour: data streams, parameters, a flight by modes."""
    async with s.world(flavour="ardupilot", model="usa", web=True) as w:
        client = w.client
        await asyncio.sleep(1.2)
        client.send(dialect.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
        for command in (
            Cmd.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
            Cmd.MAV_CMD_REQUEST_PROTOCOL_VERSION,
            Cmd.MAV_CMD_GET_HOME_POSITION,
        ):
            await s.command(command, 1)
        await fetch(client, "ardupilot")
        await s.file("/@PARAM/param.pck")
        for path in ("/general.json", "/parameter.json.xz", "/events.json"):
            await s.file(path)
        for page in PAGES:
            if page["flavour"] == "ardupilot":
                for name in page["names"]:
                    client.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
                await asyncio.sleep(0.4)
        for stream, rate in ((0, 0), (10, 5), (6, 2), (2, 2), (11, 3)):
            client.send(dialect.MAVLink_request_data_stream_message(1, 1, stream, rate, 1))
            await asyncio.sleep(1.0)
        for name, value in (("ANGLE_MAX", 2200.0), ("WPNAV_SPEED", 400.0), ("RTL_ALT", 2000.0), ("GUID_TIMEOUT", 2.0)):
            send_set(client, name, value, 9, "ardupilot")
            await asyncio.sleep(0.6)
        await s.upload([takeoff(6.0), way(10.0, 0.0, 6.0), RTL], as_float=True)
        await download(client, MISSION, as_float=True)
        client.send(dialect.MAVLink_mission_set_current_message(1, 1, 2))
        await s.request(148, 242, 245, 253)
        await s.take_off(5.0)
        for name in ("loiter", "brake", "circle", "smart rtl"):
            await s.mode(name)
            await asyncio.sleep(0.8)
        client.send(dialect.MAVLink_set_mode_message(1, 1, COPTER["guided"]))
        await asyncio.sleep(1.0)
        await s.command(Cmd.MAV_CMD_DO_SET_HOME, 1)
        client.send(dialect.MAVLink_set_mode_message(1, 1, COPTER["land"]))
        await s.landed()
        await s.command(Cmd.MAV_CMD_DO_START_MAG_CAL, 0, 1, 1, 0, x=0.0, y=0.0, z=0.0)
        await asyncio.sleep(2.0)
        await s.command(Cmd.MAV_CMD_DO_CANCEL_MAG_CAL, 0)
        await s.command(Cmd.MAV_CMD_DO_ACCEPT_MAG_CAL, 0)
        await asyncio.sleep(1.0)


async def mavsdk_flight(s: Session) -> None:
    """A program in MAVSDK's manner: take-off, goto, region of interest, orbit, follow, return, land."""
    async with s.world() as w:
        client = w.client
        await s.request(148, 242, 435)
        await s.command(Cmd.MAV_CMD_NAV_TAKEOFF)  # PX4 waits for arming
        await asyncio.sleep(1.0)
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        await s.until(lambda pose: pose.up > 2.2 and abs(pose.vd) < 0.2, 15.0)
        await s.goto(15.0, 5.0, 9.0)
        await asyncio.sleep(2.0)
        await s.goto(15.0, 5.0, 9.0, yaw=1.0)
        await s.until(lambda pose: abs(pose.north - 15.0) < 0.4, 15.0)
        away = geo.destination(*HOME[:2], 25.0, 5.0)
        await s.command(Cmd.MAV_CMD_DO_SET_ROI_LOCATION, frame=6, x=away[0], y=away[1], z=0.0)
        await asyncio.sleep(2.0)
        await s.command(Cmd.MAV_CMD_DO_SET_ROI_NONE)
        await s.command(newer.MAV_CMD_DO_CHANGE_ALTITUDE, 11.0, 3)
        await asyncio.sleep(1.0)
        await s.command(Cmd.MAV_CMD_DO_CHANGE_SPEED, 1, 4.0, -1, 0)
        await s.command(Cmd.MAV_CMD_DO_ORBIT, 8, 3, 0, 0, frame=0, x=away[0], y=away[1], z=HOME[2] + 10.0)
        await asyncio.sleep(12.0)
        await s.mode("hold")
        await asyncio.sleep(2.0)

        def target(elapsed: float) -> Any:
            place = geo.destination(*HOME[:2], 20.0 + 1.5 * elapsed, 5.0)
            places = round(place[0] * 1e7), round(place[1] * 1e7)
            vel, nan3 = [1.5, 0.0, 0.0], [NAN] * 3
            return dialect.MAVLink_follow_target_message(
                0, 3, *places, HOME[2], vel, nan3, [1.0, NAN, NAN, NAN], nan3, nan3, 0
            )

        await s.mode("follow")
        await s.stream(target, 7.0, 0.25)
        await asyncio.sleep(3.0)
        await s.command(newer.MAV_CMD_DO_SET_STANDARD_MODE, newer.MAV_STANDARD_MODE_SAFE_RECOVERY)
        await asyncio.sleep(3.0)
        await s.mode("hold")
        await s.goto(4.0, 0.0, 5.0)
        await s.until(lambda pose: math.hypot(pose.north - 4.0, pose.east) < 0.6, 20.0)
        await s.command(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)
        await s.until(lambda pose: math.hypot(pose.north, pose.east) < 0.6, 20.0)
        await s.command(Cmd.MAV_CMD_NAV_LAND)
        await s.landed()
        client.send(dialect.MAVLink_set_mode_message(1, 1, 0))
        await s.take_off(3.0)  # a second flight
        await s.mode("land")
        await s.landed()


async def offboard(s: Session) -> None:
    """Setpoints of every kind at the PX4 flavour."""
    no_p, no_v, no_a = setpoints.NO_POSITION, setpoints.NO_VELOCITY, setpoints.NO_ACCELERATION
    no_yaw, no_rate = setpoints.NO_YAW, setpoints.NO_YAW_RATE
    where, how_fast = setpoints.POSITION_ONLY, setpoints.VELOCITY_ONLY
    async with s.world(telemetry_rate=10.0) as w:
        await s.take_off(8.0)
        await s.mode("offboard")  # no setpoints yet
        await s.stream(setpoints.local(where, at=(6.0, 0.0, -8.0)), 0.4)
        engage = asyncio.ensure_future(s.mode("offboard"))
        kinds = [
            ("position", setpoints.local(where, at=(6.0, 0.0, -8.0)), 4.0),
            ("position and yaw", setpoints.local(no_v | no_a | no_rate, at=(6.0, 4.0, -9.0), yaw=1.2), 4.0),
            ("velocity", setpoints.local(how_fast, v=(0.0, 2.0, 0.0)), 2.5),
            ("velocity and yaw rate", setpoints.local(no_p | no_a | no_yaw, v=(1.0, 0.0, 0.5), yaw_rate=0.4), 2.5),
            ("velocity of the body", setpoints.local(how_fast, 8, v=(1.5, 0.0, 0.0)), 2.0),
            ("velocity and height", setpoints.local(no_a | no_yaw | no_rate | 0x3, at=(0, 0, -8.0), v=(1, 0, 0)), 2.0),
            ("position and velocity", setpoints.local(no_a | no_yaw | no_rate, at=(8, 8, -8.0), v=(1, 0, 0)), 2.0),
            ("acceleration", setpoints.local(no_p | no_v | no_yaw | no_rate, a=(0.5, 0.0, 0.0)), 1.0),
            ("offset of the body", setpoints.local(where, 9, at=(3.0, 0.0, 0.0)), 2.0),
            ("place", setpoints.earth(where, 6, 5.0, 5.0, 8.0), 3.0),
            ("place above the sea", setpoints.earth(where, 5, 5.0, 5.0, HOME[2] + 7.0), 2.0),
            ("velocity in the global frame", setpoints.earth(how_fast, 6, v=(-1.0, 0.0, 0.0)), 2.0),
            ("attitude", setpoints.attitude(-0.15), 2.0),
            ("attitude and thrust", setpoints.attitude(0.1, 0.7), 2.0),
            (
                "rates",
                dialect.MAVLink_set_attitude_target_message(0, 1, 1, 0b10000011, [1, 0, 0, 0], 0, 0, 0.5, 0.5),
                2,
            ),
            ("nothing", setpoints.local(0xDFF), 1.0),
            ("numbers that are none", setpoints.local(how_fast, v=(NAN, 0.0, 0.0)), 1.0),
        ]
        for name, message, seconds in kinds:
            s.note(name)
            await s.stream(message, seconds)
        await engage
        await asyncio.sleep(2.0)  # silence: it hovers
        s.note("again, then a mode of the client ends it")
        streaming = asyncio.ensure_future(s.stream(setpoints.local(how_fast, v=(1.0, 0.0, 0.0)), 4.0))
        await asyncio.sleep(0.5)
        await s.mode("offboard")
        await asyncio.sleep(1.0)
        await s.mode("hold")
        await streaming
        s.note("and a landing")
        streaming = asyncio.ensure_future(s.stream(setpoints.local(how_fast, v=(0.0, 1.0, 0.0)), 6.0))
        await asyncio.sleep(0.5)
        await s.mode("offboard")
        await asyncio.sleep(1.0)
        await s.command(Cmd.MAV_CMD_NAV_LAND)
        await streaming
        await s.landed()
        s.note("a take-off by setpoints")
        streaming = asyncio.ensure_future(s.stream(setpoints.local(where, at=(0.0, 0.0, -4.0)), 9.0))
        await asyncio.sleep(0.5)
        await s.mode("offboard")
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        await streaming
        await s.mode("land")
        await s.landed()
        assert w.drone.session is not None


async def guided(s: Session) -> None:
    """ArduPilot's Guided: single positions, velocities with their timeout, speed, yaw, pause."""
    where, how_fast = setpoints.POSITION_ONLY, setpoints.VELOCITY_ONLY
    async with s.world(flavour="ardupilot") as w:
        client = w.client
        client.send(dialect.MAVLink_request_data_stream_message(1, 1, 0, 5, 1))
        await s.take_off(7.0)
        client.send(setpoints.earth(where, 6, 12.0, 0.0, 7.0))  # flown to its end
        await s.until(lambda pose: pose.north > 11.6, 12.0)
        client.send(setpoints.local(where, at=(12.0, 10.0, -8.0)))
        await asyncio.sleep(2.0)
        await s.command(Cmd.MAV_CMD_DO_CHANGE_SPEED, 1, 2.0, -1, 0)
        await asyncio.sleep(2.0)
        client.send(setpoints.local(how_fast, v=(-1.0, 0.0, 0.0)))  # one only: GUID_TIMEOUT ends it
        await asyncio.sleep(3.0)
        await s.stream(setpoints.local(how_fast, v=(-1.0, 1.0, 0.0)), 4.0, 0.9)
        await asyncio.sleep(3.0)
        await s.command(Cmd.MAV_CMD_CONDITION_YAW, 90.0, 20.0, 1, 0)
        await asyncio.sleep(2.0)
        await s.command(Cmd.MAV_CMD_CONDITION_YAW, 30.0, 20.0, -1, 1)
        await asyncio.sleep(2.0)
        # A way point in the manner of Mission Planner and dronekit: MISSION_ITEM with current = 2, then a height by 3.
        place = geo.destination(*HOME[:2], 6.0, 6.0)
        for current, height in ((2, 8.0), (3, 10.0)):
            client.send(dialect.MAVLink_mission_item_message(1, 1, 0, 3, 16, current, 1, 0, 0, 0, 0, *place, height, 0))
            await asyncio.sleep(3.0)
        await s.goto(6.0, 6.0, 9.0)
        await s.command(Cmd.MAV_CMD_DO_PAUSE_CONTINUE, 0)
        await asyncio.sleep(1.5)
        await s.command(Cmd.MAV_CMD_DO_PAUSE_CONTINUE, 1)
        await s.command(Cmd.MAV_CMD_DO_SET_ROI, 0, 0, 0, 0, x=HOME[0], y=HOME[1], z=0.0)
        await asyncio.sleep(1.0)
        await s.command(Cmd.MAV_CMD_DO_SET_ROI_NONE)
        await s.command(Cmd.MAV_CMD_NAV_LOITER_TO_ALT)
        await s.stream(setpoints.attitude(-0.1), 2.0)
        await asyncio.sleep(2.0)
        await s.goto(6.0, 6.0, 500.0)  # above every ceiling
        await s.mode("circle")
        await asyncio.sleep(2.0)
        await s.mode("rtl")
        await s.until(lambda pose: math.hypot(pose.north, pose.east) < 0.6, 15.0)
        await s.mode("land")
        await s.landed()


async def mission(s: Session) -> None:
    """A mission from upload to its end, with pauses, jumps, another item, and items that are refused."""
    items = [
        takeoff(6.0),
        way(10.0, 0.0, 6.0),
        Item(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=4.0, p3=-1.0, frame=2),
        way(10.0, 10.0, 7.0),
        Item(dialect.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=1.5, frame=2),
        Item(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, p3=1.0, frame=2),
        Item(dialect.MAV_CMD_VIDEO_START_CAPTURE, 0.0, 0.0, frame=2),
        way(0.0, 10.0, 6.0),
        Item(dialect.MAV_CMD_VIDEO_STOP_CAPTURE, 0.0, 0.0, frame=2),
        Item(dialect.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=3.0, p2=1.0, frame=2),
        RTL,
    ]
    async with s.world(web=True) as w:
        client = w.client
        await s.mode("mission")  # none is there
        await s.upload([takeoff(6.0), Item(dialect.MAV_CMD_NAV_VTOL_TAKEOFF, *PLACE, z=5.0, frame=3)])  # VTOL take-off
        for left in ((5, 6), (5, 6, 8), ()):
            if await s.upload([item for index, item in enumerate(items) if index not in left]) == 0:
                break
        await download(client, MISSION)
        await s.mode("mission")
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        await s.until(lambda pose: pose.north > 5.0, 25.0)
        await s.mode("hold")
        await asyncio.sleep(2.0)
        await s.command(Cmd.MAV_CMD_DO_PAUSE_CONTINUE, 1)
        await s.until(lambda pose: pose.east > 3.0, 15.0)
        client.send(dialect.MAVLink_mission_set_current_message(1, 1, 1))
        await asyncio.sleep(4.0)
        await s.command(Cmd.MAV_CMD_DO_PAUSE_CONTINUE, 0)
        await asyncio.sleep(1.5)
        await s.command(newer.MAV_CMD_DO_SET_MISSION_CURRENT, 3, 0)
        await s.mode("mission")
        await asyncio.sleep(4.0)
        await s.goto(5.0, 5.0, 8.0)
        await asyncio.sleep(2.0)
        await s.mode("mission")
        await s.until(lambda pose: math.hypot(pose.north, pose.east) < 1.0, 40.0)
        await asyncio.sleep(2.0)
        await s.mode("land")
        await s.landed()
        await s.upload([takeoff(4.0), way(4.0, 0.0, 4.0), LAND_ITEM])
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        await s.command(Cmd.MAV_CMD_MISSION_START, 0, 1)  # not to the end
        await s.command(Cmd.MAV_CMD_MISSION_START, 0, 0)
        await s.until(lambda pose: pose.up > 3.0, 15.0)
        await s.landed(25.0)
        await clear(client, MISSION)
        await asyncio.sleep(1.0)


async def fence_and_rally(s: Session) -> None:
    """Fences and rally points: uploaded, loaded, refused, breached, switched off, used by a return."""
    async with s.world(web=True) as w:
        client = w.client
        await s.upload(square(PLACE, 20.0), FENCE)
        await s.upload(square(PLACE, 20.0)[:2], FENCE)
        await s.upload([rally(geo.destination(*PLACE, 8.0, 0.0), 5.0)], RALLY)
        await download(client, FENCE)
        await download(client, RALLY)
        for name, value in (("GF_ACTION", 2), ("RTL_TYPE", 0), ("ANF_FENCE_ACTION", 3)):
            send_set(client, name, value, PARAM_INT32)
            await asyncio.sleep(0.5)
        await s.upload([takeoff(5.0), way(60.0, 0.0, 5.0), RTL])  # a way point outside
        await s.take_off(6.0)
        await s.goto(60.0, 0.0, 6.0)  # refused
        await s.goto(17.0, 0.0, 6.0)
        await s.until(lambda pose: pose.north > 16.5, 15.0)
        s.note("a velocity that leads out")
        streaming = asyncio.ensure_future(s.stream(setpoints.local(setpoints.VELOCITY_ONLY, v=(3.0, 0.0, 0.0)), 5.0))
        await asyncio.sleep(0.5)
        await s.mode("offboard")
        await streaming
        await s.request(162)
        await asyncio.sleep(1.0)
        await s.command(Cmd.MAV_CMD_DO_FENCE_ENABLE, 0)
        await s.goto(24.0, 0.0, 6.0)
        await s.until(lambda pose: pose.north > 23.0, 10.0)
        await s.command(Cmd.MAV_CMD_DO_FENCE_ENABLE, 1)
        await asyncio.sleep(4.0)
        await s.mode("return")
        await asyncio.sleep(8.0)
        await s.mode("hold")
        await s.upload([circle(PLACE, 30.0), circle(geo.destination(*PLACE, 0.0, 15.0), 4.0, inclusion=False)], FENCE)
        await s.goto(0.0, 15.0, 6.0)  # in the excluded circle
        await clear(client, FENCE)
        await clear(client, RALLY)
        await s.goto(3.0, 12.0, 6.0)
        await asyncio.sleep(3.0)
        await s.mode("land")
        await s.landed()


async def joystick(s: Session) -> None:
    """Sticks of a ground station, their override of what flies, and modes by every way."""

    def sticks(x: int = 0, y: int = 0, z: int = 500, r: int = 0) -> Any:
        return dialect.MAVLink_manual_control_message(1, x, y, z, r, 0)

    async with s.world(also="ardupilot", web=True) as w:
        await w.connect(sysid=254, port=5761)
        await s.stream(sticks(), 1.2, 0.04)
        await s.take_off(6.0)
        await s.mode("position")
        for moved in (
            sticks(x=500),
            sticks(y=-400),
            sticks(r=600),
            sticks(z=900),
            sticks(z=200),
            sticks(x=1000, r=-300),
        ):
            await s.stream(moved, 1.5, 0.04)
        await asyncio.sleep(1.2)
        for channels in ((1600, 1300, 1750, 1450), (0, 0, 1250, 0), (65535,) * 4):
            filled = (*channels, *[65535] * 4)
            await s.stream(dialect.MAVLink_rc_channels_override_message(1, 1, *filled), 1.0, 0.1)
        await asyncio.sleep(1.0)
        s.note("a goto that the sticks take over")
        await s.stream(sticks(), 1.5, 0.04)
        await s.goto(20.0, 0.0, 8.0)
        await s.stream(sticks(), 2.0, 0.04)
        await s.stream(sticks(y=700), 2.0, 0.04)
        await s.stream(sticks(), 1.5, 0.04)
        s.note("a return that they take over")
        await s.mode("return")
        await s.stream(sticks(), 1.5, 0.04)
        await s.stream(sticks(x=-800), 1.5, 0.04)
        await asyncio.sleep(1.0)
        for mode in ("manual", "altitude", "hold", "takeoff", "offboard"):
            await s.mode(mode)
            await asyncio.sleep(0.5)
        for standard in range(10):
            if standard != newer.MAV_STANDARD_MODE_SAFE_RECOVERY and standard != newer.MAV_STANDARD_MODE_LAND:
                await s.command(newer.MAV_CMD_DO_SET_STANDARD_MODE, standard)
        await s.request(436, 437)
        for index in range(4):
            await s.command(Cmd.MAV_CMD_REQUEST_MESSAGE, 435, index)
        copter = w.clients[1]
        for number in (COPTER["guided"], COPTER["loiter"], 0, 2, COPTER["brake"]):
            await s.command(Cmd.MAV_CMD_DO_SET_MODE, 1, number, client=copter)
            await asyncio.sleep(0.4)
        await s.mode("land")
        await s.stream(sticks(), 1.0, 0.04)
        await s.stream(sticks(x=600), 1.0, 0.04)
        await s.mode("land")
        await s.landed()


async def collisions(s: Session) -> None:
    """Two clients that command at once, cancel, and lose the drone."""
    async with s.world(clients=2, also="standard") as w:
        first, second = w.clients
        await w.connect(sysid=253, port=5761)
        await s.command(60000)
        await s.command(Cmd.MAV_CMD_NAV_LAND)
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1, target=(1, 0))
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 1, target=(9, 1), timeout=1.0)
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 0)
        await s.command(Cmd.MAV_CMD_DO_SET_HOME, 0, frame=0, x=NAN, y=NAN, z=NAN)
        await s.take_off(6.0)
        s.note("two gotos at once")
        await asyncio.gather(s.goto(15.0, 0.0, 6.0), s.goto(0.0, 15.0, 6.0, client=second))
        await asyncio.sleep(2.0)
        s.note("a goto and a land, then a take-off against it")
        await asyncio.gather(s.goto(5.0, 5.0, 6.0), s.command(Cmd.MAV_CMD_NAV_LAND, client=second))
        await asyncio.sleep(0.5)
        await s.goto(5.0, 5.0, 6.0)
        await s.command(Cmd.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=6.0, client=second)
        await asyncio.sleep(3.0)
        s.note("the same command twice, and a repeated one")
        place = geo.destination(*HOME[:2], 10.0, 10.0)
        places = [round(v * 1e7) for v in place]
        words = (1, 1, 6, Cmd.MAV_CMD_DO_REPOSITION, 0, 0, -1, 1, 0, NAN, *places, 7.0)
        for _ in range(3):
            first.send(dialect.MAVLink_command_int_message(*words))
        for confirmation in range(3):
            first.send(
                dialect.MAVLink_command_long_message(1, 1, Cmd.MAV_CMD_DO_SET_MODE, confirmation, 1, 4, 3, 0, 0, 0, 0)
            )
            await asyncio.sleep(0.2)
        await asyncio.sleep(2.0)
        s.note("the drone hears nothing: cancel")
        w.drone.faults.up = Impairment(loss=1.0)
        going = asyncio.ensure_future(s.goto(20.0, 0.0, 6.0))
        await asyncio.sleep(0.7)
        first.send(newer.MAVLink_command_cancel_message(1, 1, Cmd.MAV_CMD_DO_REPOSITION))
        await going
        returning = asyncio.ensure_future(s.command(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH))
        await asyncio.sleep(0.4)
        w.drone.faults.up = Impairment()
        await returning
        await asyncio.sleep(1.0)
        await s.mode("hold", second)
        s.note("a poor link")
        w.drone.faults.up = Impairment(delay=0.12)
        w.drone.faults.down = Impairment(delay=0.08)
        await asyncio.gather(s.goto(5.0, 0.0, 6.0), s.mode("hold", second))
        await s.goto(5.0, -5.0, 6.0)
        w.drone.faults.up = w.drone.faults.down = Impairment()
        s.note("the link is lost in a goto, and comes back")
        await s.goto(40.0, 0.0, 6.0)
        await asyncio.sleep(1.5)
        w.drone.faults.mute = True
        await asyncio.sleep(2.5)
        await s.command(Cmd.MAV_CMD_NAV_LAND, timeout=3.0)
        await asyncio.sleep(3.0)
        w.drone.faults.mute = False
        await first.heartbeat(lambda beat: True, timeout=20.0)
        await asyncio.sleep(3.0)
        s.note("warnings of the drone")
        w.drone.faults.battery = 8
        await asyncio.sleep(3.0)
        w.drone.faults.gps = False
        await asyncio.sleep(2.0)
        await s.goto(1.0, 1.0, 6.0)
        w.drone.faults.gps = True
        await asyncio.sleep(1.0)
        await s.mode("land")
        await s.landed()


async def skycontroller_and_others(s: Session) -> None:
    """A Skycontroller, an ANAFI Ai, an ANAFI Thermal: calibration, logs, shell, tune, motor cut, reboot."""

    async def say(client: Client, words: bytes) -> None:
        piece = list(words.ljust(70, b"\0"))
        client.send(newer.MAVLink_serial_control_message(10, 2, 1000, 0, len(words), piece, 1, 1))
        await asyncio.sleep(0.8)

    async with s.world(skycontroller=3, model="thermal", web=True) as w:
        client = w.client
        pilot = w.drone.skycontroller
        assert pilot is not None
        send_set(client, "ANF_GCS_LOSS", 2, PARAM_INT32)
        send_set(client, "ANF_GCS_LOSS_T", 2.0, PARAM_REAL32)
        await s.take_off(5.0)
        await asyncio.sleep(2.0)
        pilot.stick(3, 50)
        await asyncio.sleep(2.0)
        await s.goto(10.0, 0.0, 6.0)
        await asyncio.sleep(1.0)
        pilot.stick(3, 0)
        await s.goto(10.0, 0.0, 6.0)
        await asyncio.sleep(3.0)
        await s.command(Cmd.MAV_CMD_SET_CAMERA_ZOOM, 1, 2.0)
        await s.command(Cmd.MAV_CMD_DO_MOUNT_CONTROL, -30, 0, 0, 0, x=0.0, y=0.0, z=2.0)
        await s.command(Cmd.MAV_CMD_IMAGE_START_CAPTURE, 0, 0, 1)
        await s.command(newer.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -20.0, 0.0, 0, 0)
        await s.mode("land")
        await s.landed()
    async with s.world(model="ai", flavour="px4") as w:
        client = w.client
        calibrate = Cmd.MAV_CMD_PREFLIGHT_CALIBRATION
        await s.request(148)
        for words in (b"version\n", b"help\n", b"status\n", b"features\n", b"nothing\n"):
            await say(client, words)
        client.send(newer.MAVLink_play_tune_v2_message(1, 1, newer.TUNE_FORMAT_QBASIC1_1, b"MFT200L8AAAA"))
        client.send(dialect.MAVLink_play_tune_message(1, 1, b"AB", b""))
        await asyncio.sleep(1.0)
        await s.command(calibrate, 0, 1, 0, 0, x=0.0, y=0.0, z=0.0, timeout=20.0)
        await s.command(calibrate, 1, 0, 0, 0, x=0.0, y=0.0, z=0.0)
        await s.command(calibrate, 0, 0, 0, 0, x=2.0, y=0.0, z=0.0, timeout=20.0)
        await s.command(newer.MAV_CMD_GIMBAL_REQUEST_AXIS_CALIBRATION, timeout=20.0)
        client.send_command(calibrate, 0, 1, 0, 0, x=0.0, y=0.0, z=0.0)
        await asyncio.sleep(0.6)
        client.send(newer.MAVLink_command_cancel_message(1, 1, calibrate))
        await asyncio.sleep(1.0)
        ftp = Ftp(client)
        for path in (b"/", b"/log", b"/nothing"):
            await s.ask(ftp, LIST, path)
        client.send(dialect.MAVLink_log_request_list_message(1, 1, 0, 65535))
        await asyncio.sleep(1.0)
        await s.command(Cmd.MAV_CMD_DO_FLIGHTTERMINATION, 1)
        await s.command(Cmd.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
        await asyncio.sleep(3.0)
        with contextlib.suppress(AssertionError):
            await client.heartbeat(lambda beat: True, timeout=40.0)
        await s.request(148)
    async with s.world(model="4k", allow_kill=True) as w:
        await s.take_off(4.0)
        await s.command(Cmd.MAV_CMD_COMPONENT_ARM_DISARM, 0)
        await s.command(Cmd.MAV_CMD_DO_FLIGHTTERMINATION, 1)
        await asyncio.sleep(3.0)
        await s.request(148)


SESSIONS: dict[str, Callable[[Session], Awaitable[None]]] = {
    "01-qgroundcontrol-px4": qgroundcontrol_px4,
    "02-ground-station-ardupilot": ground_station_ardupilot,
    "03-mavsdk-flight": mavsdk_flight,
    "04-offboard": offboard,
    "05-guided": guided,
    "06-mission": mission,
    "07-fence-and-rally": fence_and_rally,
    "08-joystick": joystick,
    "09-collisions": collisions,
    "10-skycontroller-and-others": skycontroller_and_others,
}
"""By the name of the recording."""


async def recorded(name: str) -> list[Line]:
    """Return the recording of one session."""
    session = Session(list(SESSIONS).index(name) + 1)
    await SESSIONS[name](session)
    return session.result()

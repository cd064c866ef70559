"""Small ground station on one endpoint: receives messages, transfers plans, sends commands.

For `anafi-mav plan`.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from types import TracebackType
from typing import Any

from typing_extensions import Self

from anafi_mav.clock import SystemClock
from anafi_mav.errors import CommandRejected, ConfigError, LinkLost
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.key_ring import KeyRing, folder_of
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.mavlink.plan_client import Download, Message, Upload
from anafi_mav.mavlink.router import EVERY_COMPONENT
from anafi_mav.services.flavours import FLAVOURS
from anafi_mav.state_lock import state_folder

SYSID, COMPID = 252, dialect.MAV_COMP_ID_MISSIONPLANNER
"""Ours: beyond the drones of a fleet, and neither QGroundControl's 255 nor MAVSDK's 245."""

VEHICLE_LIMIT = 6.0
"""s until a vehicle's heartbeat has been heard, which comes once a second, over an endpoint that has to open first."""

OTHERS = 1.5
"""s after the first vehicle's heartbeat in which others show themselves."""

BEAT = 1.0

ACK_LIMIT, PROGRESS_LIMIT, COMMAND_TRIES = 1.5, 30.0, 3
"""s for an acknowledgement, s between two of them while a command is in progress, and attempts."""

CHUNK = 50
"""Bytes of a STATUSTEXT; a shorter one is the last of a text in chunks."""

MAX_TEXT = 10 * CHUNK


class Ground:
    """`async with Ground(url) as ground: vehicle = await ground.vehicle(None)`."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.on_message: Callable[[Inbound], None] = lambda inbound: None
        """Called with each message of the vehicle that was chosen."""
        self.target: tuple[int, int] = (0, 0)
        """System and component of that vehicle."""
        self.heartbeat: Any = None
        """Its last."""
        self._beats: dict[int, Inbound] = {}
        self._updated = asyncio.Event()
        self._clock = SystemClock()
        state = state_folder(None)
        keys = KeyRing(None if state is None else folder_of(state), self._clock, saves=False)
        self._node = Node(clock=self._clock, flavours=tuple(FLAVOURS), keys=keys)
        self._beating: asyncio.Task[None] | None = None
        self._transfer: Upload | Download | None = None
        self._acks: list[Any] = []

    async def __aenter__(self) -> Self:
        try:
            await self._node.start([self.url])
        except ConfigError as error:
            raise ConfigError("--endpoint", error.problem) from error
        self._node.add_host(SYSID, EVERY_COMPONENT, self._receive)
        self._beating = asyncio.create_task(self._beat())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._beating is not None:
            self._beating.cancel()
            await asyncio.gather(self._beating, return_exceptions=True)
        await self._node.close()

    def send(self, message: Message) -> None:
        """Send a message to every peer of the endpoint."""
        self._node.send(message, sysid=SYSID, compid=COMPID)

    async def _beat(self) -> None:
        while True:
            self.send(
                dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
                )
            )
            await asyncio.sleep(BEAT)

    def _receive(self, inbound: Inbound) -> None:
        message = inbound.message
        if isinstance(message, dialect.MAVLink_heartbeat_message):
            if message.autopilot == dialect.MAV_AUTOPILOT_INVALID:
                return
            self._beats[inbound.sysid] = inbound
            if (inbound.sysid, inbound.compid) == self.target:
                self.heartbeat = message
        if (inbound.sysid, inbound.compid) == self.target:
            if isinstance(message, dialect.MAVLink_command_ack_message):
                self._acks.append(message)
            if self._transfer is not None:
                for answer in self._transfer.receive(message, inbound.sysid, inbound.compid, inbound.now):
                    self.send(answer)
            self.on_message(inbound)
        self._tell()

    def _tell(self) -> None:
        self._updated.set()
        self._updated = asyncio.Event()

    async def wait_for_update(self, timeout: float) -> None:
        """Return when something has come, or after so many seconds.

        Not by asyncio.wait_for, which until Python 3.12 loses a Ctrl-C that comes together with a message.
        """
        update = asyncio.ensure_future(self._updated.wait())
        try:
            await asyncio.wait({update}, timeout=max(timeout, 0.0))
        finally:
            update.cancel()

    # Who is there.

    async def vehicle(self, sysid: int | None) -> None:
        """Wait for the vehicle with this system id, or for the only one.

        Raises `LinkLost` and `ConfigError`.
        """
        now = self._clock.monotonic()
        limit = now + VEHICLE_LIMIT
        first: float | None = None
        while now < limit and (sysid not in self._beats if sysid is not None else True):
            if self._beats and first is None:
                first = now
            if sysid is None and first is not None and now >= first + OTHERS:
                break
            await self.wait_for_update(min(limit, limit if first is None else first + OTHERS) - now)
            now = self._clock.monotonic()
        there = ", ".join(map(str, sorted(self._beats)))
        if not self._beats:
            raise LinkLost(f"no vehicle within {VEHICLE_LIMIT:g} s on {self._node.endpoints[0].describe()}")
        if sysid is not None and sysid not in self._beats:
            raise LinkLost(f"no vehicle with system id {sysid} on {self.url}; there is {there}")
        if sysid is None and len(self._beats) > 1:
            raise ConfigError("--sysid", f"expected one of {there}: there are several vehicles")
        beat = self._beats[sysid if sysid is not None else next(iter(self._beats))]
        self.target, self.heartbeat = (beat.sysid, beat.compid), beat.message

    @property
    def first_item_is_home(self) -> bool:
        """In its missions, as ArduPilot has them."""
        return any(flavour.zero_home for flavour in FLAVOURS.values() if flavour.autopilot == self.heartbeat.autopilot)

    # What is done with it.

    async def run(self, transfer: Upload | Download, progress: Callable[[int, int], None]) -> None:
        """Run a transfer to its end; `progress` is called with (items transferred, items in total)."""
        self._transfer = transfer
        try:
            for message in transfer.start(self._clock.monotonic()):
                self.send(message)
            while (deadline := transfer.deadline()) is not None:
                await self.wait_for_update(deadline - self._clock.monotonic())
                for message in transfer.expire(self._clock.monotonic()):
                    self.send(message)
                progress(transfer.done, transfer.total)
        except BaseException:
            for message in transfer.cancel():
                self.send(message)
            raise
        finally:
            self._transfer = None

    async def command(self, id: int, *params: float) -> None:
        """Send a command and wait for its acknowledgement.

        Raises `CommandRejected` and `LinkLost`.
        """
        values = [*params, *([0.0] * (7 - len(params)))]
        name = dialect.enums["MAV_CMD"][id].name.removeprefix("MAV_CMD_")
        for confirmation in range(COMMAND_TRIES):
            self._acks.clear()
            self.send(dialect.MAVLink_command_long_message(*self.target, id, confirmation, *values))
            limit = self._clock.monotonic() + ACK_LIMIT
            while (now := self._clock.monotonic()) < limit:
                acks, self._acks = [ack for ack in self._acks if ack.command == id], []
                for ack in acks:
                    if ack.result == dialect.MAV_RESULT_ACCEPTED:
                        return
                    if ack.result != dialect.MAV_RESULT_IN_PROGRESS:
                        entry = dialect.enums["MAV_RESULT"].get(ack.result)
                        result = str(ack.result) if entry is None else entry.name.removeprefix("MAV_RESULT_")
                        raise CommandRejected(f"{name} refused: {result}")
                    limit = now + PROGRESS_LIMIT
                await self.wait_for_update(limit - now)
        raise LinkLost(f"the vehicle did not answer {name}")


class Texts:
    """STATUSTEXT as a person reads it: texts in chunks put together."""

    def __init__(self) -> None:
        self._number = 0
        self._parts = b""

    def add(self, message: Any) -> str | None:
        """The text that is whole now."""
        part: bytes = message._text_raw.rstrip(b"\0")  # how long a chunk is counts in bytes
        if message.id == 0:
            return part.decode(errors="replace")
        if message.id != self._number:
            self._number, self._parts = message.id, b""
        self._parts += part
        if len(part) == CHUNK and len(self._parts) < MAX_TEXT:
            return None
        whole, self._number, self._parts = self._parts, 0, b""
        return whole.decode(errors="replace")


@contextlib.asynccontextmanager
async def connected(url: str, sysid: int | None) -> AsyncIterator[Ground]:
    """A ground station that has found its vehicle."""
    async with Ground(url) as ground:
        await ground.vehicle(sysid)
        yield ground

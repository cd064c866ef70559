"""The mission protocol on the wire: a desk of transfers (`plan_desk`, without I/O), its clock, its channels, its file.

A plan is stored before its upload is acknowledged, and is what the vehicle goes by from then on: `Vehicle.fence` and
`Vehicle.rally` take theirs.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from anafi_mav import units
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Command
from anafi_mav.services.fence import FenceKind, summary
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.guided import fly_item, is_guided_item
from anafi_mav.services.mission_kind import MissionKind, Version, offset
from anafi_mav.services.plan_desk import MESSAGES, PlanDesk
from anafi_mav.services.plan_items import PlanItem
from anafi_mav.services.plan_transfer import Changed, Commit, Effect, Peer, Reply, Say
from anafi_mav.services.rally import RallyKind, Return
from anafi_mav.services.service import Host, MessageHandler, Query, Service, client_of
from anafi_mav.services.statustext import Severity
from anafi_mav.services.stream import Stream, Times
from anafi_mav.services.vehicle import Vehicle

logger = logging.getLogger(__name__)

NO_TOTAL = 0xFFFF
"""`total` of a MISSION_CURRENT where there is no mission (common.xml)."""

_ITEMS = (dialect.MAVLINK_MSG_ID_MISSION_ITEM, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT)


@dataclass(frozen=True)
class _ChannelPeer(Peer):
    """A client and the way to it."""

    channel: Channel


class PlanService(Service):
    """Missions, fences and rally points: up, down and away."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._desk = PlanDesk([MissionKind(self._home_item, self._version), FenceKind(), RallyKind()])
        self._timer: asyncio.TimerHandle | None = None

    def capabilities(self) -> int:
        return (
            dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
            | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
        )

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            **dict.fromkeys(MESSAGES, self._receive),
            dialect.MAVLINK_MSG_ID_MISSION_SET_CURRENT: lambda inbound: self._no_mission(),
        }

    def queries(self) -> Mapping[int, Query]:
        return {dialect.MAV_CMD_DO_SET_MISSION_CURRENT: self._set_current}

    def streams(self) -> Mapping[int, Stream]:
        return {dialect.MAVLINK_MSG_ID_MISSION_CURRENT: Stream(self._mission_current, on_change=True, flavoured=True)}

    def link_up(self) -> None:
        memory = self.host.memory
        for kind, transfer in self._desk.transfers.items():
            items = memory.plans.get(kind, ())
            fault = transfer.kind.refusal if items else None
            for number, item in enumerate(items):
                fault = fault or transfer.kind.check_item(item)
                if fault is not None:
                    self.host.text(Severity.WARNING, f"{transfer.kind.name} in {memory.path}, item {number}: ignored")
                    break
            if fault is None and (fault := transfer.kind.check_plan(items)) is not None:
                self.host.text(Severity.WARNING, f"{transfer.kind.name} in {memory.path}: ignored, {fault.reason}")
            transfer.put(() if fault is not None else items)
            self._take(kind, transfer.items)

    def link_down(self) -> None:
        self._desk.reset()
        self._set_timer()

    def channel_closed(self, channel: Channel) -> None:
        self._desk.leave(lambda client: isinstance(client, tuple) and client[0] is channel)
        self._set_timer()

    # What arrives.

    def _receive(self, inbound: Inbound) -> None:
        message = inbound.message
        if message.get_msgId() in _ITEMS and is_guided_item(message):
            fly_item(self.host, inbound)
            return
        peer = _ChannelPeer(
            client_of(inbound), inbound.sysid, inbound.compid, flavour_of(inbound.channel), inbound.channel
        )
        self._perform(self._desk.receive(message, peer, self.host.clock.monotonic()))

    def _perform(self, effects: Sequence[Effect]) -> None:
        for effect in effects:
            match effect:
                case Reply():
                    self._reply(effect)
                case Commit():
                    self.host.spawn(self._store(effect))
                case Changed():
                    self._changed(effect.mission_type)
                case Say():
                    if effect.severity <= Severity.WARNING:
                        self.host.complain(effect.text)
                    else:
                        self.host.text(effect.severity, effect.text)
        self._set_timer()

    def _reply(self, reply: Reply) -> None:
        assert isinstance(reply.peer, _ChannelPeer)
        self.host.send(reply.message, reply.peer.channel)

    async def _store(self, commit: Commit) -> None:
        for kind, items in commit.plans.items():
            self.host.memory.put(kind, items)
        problem = await self.host.memory.save()
        if problem is not None:
            self.host.complain(problem)
        self._perform(self._desk.stored(commit, self.host.clock.monotonic()))

    def _set_timer(self) -> None:
        """Come back when something is to be said again."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        deadline = self._desk.deadline()
        if deadline is not None:
            delay = max(deadline - self.host.clock.monotonic(), 0.0)
            self._timer = asyncio.get_running_loop().call_later(delay, self._expire)

    def _expire(self) -> None:
        self._timer = None
        self._perform(self._desk.expire(self.host.clock.monotonic()))

    # What missions need.

    def _home_item(self) -> PlanItem:
        """Home as an item; all zeros while it is not known."""
        vehicle = self.host.vehicle
        home = vehicle.home
        x, y = (0, 0) if home is None else map(units.deg_e7, home.point)
        z = vehicle.height.amsl(0.0)
        return PlanItem(
            dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), x, y, 0.0 if z is None else z
        )

    def _version(self) -> Version:
        return 1 if self.host.drone.flight_plan.version == 1 else 2

    # Plans in force.

    def _changed(self, kind: int) -> None:
        """Another plan is in force: the vehicle goes by it, everybody is told."""
        self._take(kind, self._desk.transfers[kind].items)
        times = self.host.times()
        self.host.send_by_flavour(lambda flavour: self._mission_current(self.host.vehicle, times.for_flavour(flavour)))

    def _take(self, kind: int, items: Sequence[PlanItem]) -> None:
        vehicle = self.host.vehicle
        if kind == FenceKind.mission_type:
            if tuple(items) != vehicle.fence.items:
                self.host.text(Severity.INFO, f"Fence: {summary(items)}" if items else "No fence")
            vehicle.fence.take(items)
        elif kind == RallyKind.mission_type:
            if items and vehicle.rally.purpose is Return.HOME and tuple(items) != vehicle.rally.items:
                self.host.text(Severity.INFO, f"{len(items)} rally points kept and not used: RTL_TYPE says home")
            vehicle.rally.take(items)

    def _mission_current(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        """MISSION_CURRENT: whether there is a mission, and which plans there are."""
        identities = [transfer.opaque_id for _, transfer in sorted(self._desk.transfers.items())]
        total = len(self._desk.transfers[MissionKind.mission_type].items)
        if total == 0:
            return dialect.MAVLink_mission_current_message(
                0, NO_TOTAL, dialect.MISSION_STATE_NO_MISSION, 0, *identities
            )
        return dialect.MAVLink_mission_current_message(
            offset(times.flavour), total, dialect.MISSION_STATE_NOT_STARTED, 0, *identities
        )

    # What needs a mission, and what needs none.

    def _no_mission(self) -> None:
        self.host.complain("Current item refused: there is no mission")

    def _set_current(self, inbound: Inbound, command: Command) -> int:
        """MAV_CMD_DO_SET_MISSION_CURRENT."""
        self._no_mission()
        return dialect.MAV_RESULT_DENIED

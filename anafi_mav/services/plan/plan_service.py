"""The mission protocol on the wire: the shell around `plan_protocol`.

A plan is stored before its upload is acknowledged, and is what the vehicle goes by from then on: `Vehicle.fence` and
`Vehicle.rally` take theirs.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial

from anafi_mav import texts, units
from anafi_mav.clock import Alarm
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import Access
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.services.files import Query, ServedFile
from anafi_mav.services.flavours import PX4, Flavour, flavour_of
from anafi_mav.services.memory import NOT_KEPT
from anafi_mav.services.plan import plan_files
from anafi_mav.services.plan.fence_kind import FenceKind, summary
from anafi_mav.services.plan.mission_kind import MissionKind
from anafi_mav.services.plan.mission_service import RECORD
from anafi_mav.services.plan.plan_protocol import MESSAGES, MissionProtocol
from anafi_mav.services.plan.plan_transfer import Changed, Commit, Effect, Peer, PlanKind, Reply, Say
from anafi_mav.services.plan.rally_kind import RallyKind
from anafi_mav.services.service import Host, MessageHandler, Service
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.fence.plan_items import MAX_ITEMS, PlanFault, PlanItem, opaque_id
from anafi_mav.vehicle.fence.rally import Return
from anafi_mav.vehicle.operator_control import Need

logger = logging.getLogger(__name__)

_ITEMS = (dialect.MAVLINK_MSG_ID_MISSION_ITEM, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT)

_CHANGES = (
    dialect.MAVLINK_MSG_ID_MISSION_COUNT,
    dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
    dialect.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST,
)
"""Messages that begin a change of a list."""


class _ChannelPeer(Peer, frozen=True, kw_only=True):
    """A client and the way to it."""

    channel: Channel


class PlanService(Service):
    """Missions, fences and rally points: up, down and away."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._mission = MissionKind(self._home_item, self._version)
        self._protocol = MissionProtocol([self._mission, FenceKind(), RallyKind()])
        self._alarm = Alarm(self._expire)
        self._item_commands: Mapping[int, MessageHandler] = {}

    def take_tables(self, item_commands: Mapping[int, MessageHandler]) -> None:
        """Receive the handlers of items that belong to no plan, by their `current`."""
        self._item_commands = item_commands

    def capabilities(self) -> int:
        return (
            dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT  # MISSION_ITEM and MISSION_REQUEST are accepted too
            | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
            | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
        )

    def messages(self) -> Mapping[int, MessageHandler]:
        return dict.fromkeys(MESSAGES, self._receive)

    def denials(self) -> Mapping[int, MessageHandler]:
        """A client whose endpoint does not permit a change gets MISSION_ACK."""

        def deny(inbound: Inbound) -> None:
            answer = dialect.MAVLink_mission_ack_message(
                inbound.sysid, inbound.compid, dialect.MAV_MISSION_DENIED, inbound.message.mission_type
            )
            self.host.send(answer, inbound.channel)

        return dict.fromkeys((*_CHANGES, *_ITEMS), deny)

    def files(self) -> Mapping[str, ServedFile]:
        return {
            path: ServedFile(
                partial(self._packed, kind),
                packed=True,
                write=partial(self._written, kind),
                room=plan_files.size_of(MAX_ITEMS),
            )
            for kind, path in plan_files.PATHS.items()
        }

    def _packed(self, kind: int, flavour: Flavour, query: Query) -> bytes:
        transfer = self._protocol.transfers[kind]
        return plan_files.pack_plan(transfer.kind.shown(transfer.items, flavour), kind)

    def _written(self, kind: int, inbound: Inbound, content: bytes) -> bool | Awaitable[bool]:
        """Replace a list by a client's file; False, at once or when awaited, if it is refused.

        The reason is a text; the list then stays.
        """
        transfer = self._protocol.transfers[kind]
        items = plan_files.unpack_plan(content, kind)
        if isinstance(items, PlanFault):
            outcome: list[Effect] | PlanFault = items
        else:
            outcome = transfer.replace(items, self._peer(inbound), self.host.clock.monotonic())
        if isinstance(outcome, PlanFault):
            self.host.warn_throttled(texts.REFUSED.fill(what=transfer.kind.name.capitalize(), reason=outcome.reason))
            return False
        stored: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        for effect in outcome:
            if isinstance(effect, Commit):
                self.host.spawn(self._commit(effect, stored))
            else:
                self._perform([effect])
        return stored

    def _peer(self, inbound: Inbound) -> _ChannelPeer:
        operators, system = self.host.vehicle.operators, inbound.sysid
        is_other = operators.operator not in (0, system)
        is_refused = is_other and operators.objection(system, Need.COMMAND) is not None
        return _ChannelPeer(
            inbound.client,
            system,
            inbound.compid,
            flavour_of(inbound.channel),
            channel=inbound.channel,
            may_change=inbound.channel.access is not Access.OBSERVE and not is_refused,
        )

    def link_up(self) -> None:
        memory = self.host.memory
        for kind, transfer in self._protocol.transfers.items():
            items = memory.plans.get(kind, ())
            wrong = self._wrong(transfer.kind, items)
            if wrong is not None:
                self.host.text(
                    Severity.WARNING,
                    texts.PLAN_IGNORED.fill(kind=transfer.kind.name.capitalize(), path=memory.path, reason=wrong),
                )
            transfer.put(() if wrong is not None else items)
            self._take(kind)

    def _wrong(self, kind: PlanKind, items: Sequence[PlanItem]) -> OperatorText | None:
        """Why a plan that was kept is not taken."""
        for number, item in enumerate(items):
            if (fault := kind.check_item(item)) is not None:
                return texts.ITEM_REASON.fill(number=kind.label(number, PX4), reason=fault.reason)
        fault = self._mission.examine(items) if kind is self._mission else kind.check_plan(items)
        return None if fault is None else fault.reason

    def link_down(self) -> None:
        self._protocol.reset()
        self._set_timer()

    def channel_closed(self, channel: Channel) -> None:
        self._protocol.leave(lambda client: isinstance(client, tuple) and client[0] is channel)
        self._set_timer()

    # What arrives.

    def _receive(self, inbound: Inbound) -> None:
        message = inbound.message
        if inbound.id in _ITEMS and (handler := self._item_commands.get(message.current)) is not None:
            handler(inbound)
            return
        self._perform(self._protocol.receive(message, self._peer(inbound), inbound.now))

    def _perform(self, effects: Sequence[Effect]) -> None:
        for effect in effects:
            match effect:
                case Reply():
                    self._reply(effect)
                case Commit():
                    self.host.spawn(self._commit(effect))
                case Changed():
                    self._changed(effect.mission_type)
                case Say():
                    if effect.severity <= Severity.WARNING:
                        self.host.warn_throttled(effect.text)
                    else:
                        self.host.text(effect.severity, effect.text)
        self._set_timer()

    def _reply(self, reply: Reply) -> None:
        assert isinstance(reply.peer, _ChannelPeer)
        self.host.send(reply.message, reply.peer.channel)

    async def _commit(self, commit: Commit, stored: asyncio.Future[bool] | None = None) -> None:
        """Store a plan; `stored` gets True if it is in force then."""
        fault = await self._store(commit)
        if stored is not None and not stored.done():  # else its client is disconnected
            stored.set_result(fault is None)

    async def _store(self, commit: Commit) -> PlanFault | None:
        """Store a plan, and put it in force; return the fault of it, None if it is in force."""
        concerned = self._mission.mission_type in commit.plans
        with self.host.vehicle.mission.storing.going_on() if concerned else nullcontext():
            try:
                fault = await self._put(commit)
            except Exception:
                # Whatever went wrong, clients must not wait for ever for what comes after it.
                logger.exception("%s: a plan could not be stored", self.host.drone.name)
                fault = PlanFault(dialect.MAV_MISSION_ERROR, texts.NOT_STORED)
            if fault is not None:
                transfer = self._protocol.transfers.get(commit.mission_type)
                what = "Plans" if transfer is None else transfer.kind.name.capitalize()
                self.host.warn_throttled(texts.REFUSED.fill(what=what, reason=fault.reason))
            self._perform(self._protocol.stored(commit, self.host.clock.monotonic(), fault))
        return fault

    @property
    def _flown_identity(self) -> int:
        """Identity of the mission in force."""
        return self.host.vehicle.mission.machine.mission.identity

    async def _put(self, commit: Commit) -> PlanFault | None:
        """Keep plans; what is wrong with the mission, if anything is."""
        settings, mission = self.host.memory.settings, commit.plans.get(self._mission.mission_type)
        if mission:
            fault = await asyncio.to_thread(self._mission.examine, mission, commit.peer.flavour)
            if fault is not None:
                return fault
        for kind, items in commit.plans.items():
            self.host.memory.put(kind, items)
        if mission is not None and RECORD in settings and opaque_id(mission) != self._flown_identity:
            del settings[RECORD]  # of the mission that this one replaces: one file is written, not two
        problem = await self.host.memory.save()
        if problem is not None:
            logger.warning("%s: %s", self.host.drone.name, problem)
            assert isinstance(commit.peer, _ChannelPeer)
            self.host.text(Severity.WARNING, NOT_KEPT, commit.peer.channel)
        return None

    def _set_timer(self) -> None:
        """Come back when something is to be said again.

        A timer that ends too early is let run, for the deadline goes on with each item of an upload; it looks again.
        """
        deadline = self._protocol.deadline()
        if deadline is None:
            self._alarm.cancel()
        elif self._alarm.at is None or deadline < self._alarm.at:
            self._alarm.set(deadline)

    def _expire(self) -> None:
        self._perform(self._protocol.expire(self.host.clock.monotonic()))

    # What missions need.

    def _home_item(self) -> PlanItem:
        """Home as an item; all zeros while it is not known."""
        vehicle = self.host.vehicle
        home = vehicle.home
        x, y = (0, 0) if home is None else map(units.deg_e7, home)
        z = vehicle.height.amsl(0.0)
        return PlanItem(
            dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), x, y, 0.0 if z is None else z
        )

    def _version(self) -> Version:
        return 1 if self.host.drone.flight_plan.version == 1 else 2

    # Plans in force.

    def _changed(self, kind: int) -> None:
        """Put an uploaded plan in force and notify all clients."""
        mission = self.host.vehicle.mission
        if kind == MissionKind.mission_type and self._protocol.transfers[kind].opaque_id == self._flown_identity:
            mission.taken_again()
        self._take(kind)
        if kind != MissionKind.mission_type:
            mission.outlet.mission_changed()

    def _take(self, kind: int) -> None:
        vehicle, transfer = self.host.vehicle, self._protocol.transfers[kind]
        items, identity = transfer.items, transfer.opaque_id
        if kind == MissionKind.mission_type:
            if identity != self._flown_identity:
                examined = self._mission.examined(items)
                self.host.text(Severity.INFO, examined.words)
                vehicle.mission.take(examined.neutral, identity)
        elif kind == FenceKind.mission_type:
            if items != vehicle.fence.items:
                self.host.text(Severity.INFO, summary(items))
            vehicle.fence.take(items)
        elif kind == RallyKind.mission_type:
            if items and vehicle.rally.purpose is Return.HOME and items != vehicle.rally.items:
                self.host.text(Severity.INFO, texts.RALLY_BY_TYPE.fill(count=len(items)))
            vehicle.rally.take(items)

"""Sorts messages of the mission protocol to the transfers of the three lists. No I/O.

    protocol.receive(message, peer, now) -> effects;  protocol.stored(commit, now) -> effects
    protocol.deadline() -> when to call protocol.expire(now)

A message about a list as a whole waits while that list is being stored: clients send it once. dronekit does not wait
for the acknowledgement of its upload before it requests the list, and must not receive the old one.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import Any

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.services.plan.plan_transfer import Commit, Effect, Peer, PlanKind, PlanTransfer, Reply, Say, State
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.fence.plan_items import PlanFault

ALL = dialect.MAV_MISSION_TYPE_ALL

MAX_WAITING = 16
"""Messages that wait for a plan to be stored, which takes milliseconds: a handful of clients, one or two of each."""

_WHOLE = frozenset(
    {
        dialect.MAVLINK_MSG_ID_MISSION_COUNT,
        dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
        dialect.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST,
        dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
    }
)
"""Messages that begin something with a list."""

MESSAGES = (
    *_WHOLE,
    dialect.MAVLINK_MSG_ID_MISSION_ITEM,
    dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT,
    dialect.MAVLINK_MSG_ID_MISSION_ACK,
    dialect.MAVLINK_MSG_ID_MISSION_REQUEST,
    dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    dialect.MAVLINK_MSG_ID_MISSION_REQUEST_PARTIAL_LIST,
)
"""Messages of a transfer."""


class MissionProtocol:
    """All transfers of one vehicle."""

    def __init__(self, kinds: Iterable[PlanKind]) -> None:
        self.transfers = {kind.mission_type: PlanTransfer(kind) for kind in kinds}
        """By MAV_MISSION_TYPE."""
        self._waiting: list[tuple[Any, int, Peer]] = []

    def receive(self, message: Any, peer: Peer, now: float) -> list[Effect]:
        """A message of `MESSAGES` from a client."""
        id = message.get_msgId()
        if id == dialect.MAVLINK_MSG_ID_MISSION_ACK:  # it gives up what it has asked for
            self._waiting = [
                (other, its_id, who)
                for other, its_id, who in self._waiting
                if (other.mission_type, who.client) != (message.mission_type, peer.client)
            ]
        if id not in _WHOLE:
            return self._handle(message, id, peer, now)
        for kind, transfer in self.transfers.items():
            if kind != message.mission_type:
                transfer.gone_on(peer)
        if not self._waiting and not self._storing(message.mission_type):
            return self._handle(message, id, peer, now)
        if len(self._waiting) >= MAX_WAITING:
            return [_ack(peer, dialect.MAV_MISSION_ERROR, message.mission_type)]
        self._waiting.append((message, id, peer))
        return []

    def _handle(self, message: Any, id: int, peer: Peer, now: float) -> list[Effect]:
        kind = message.mission_type
        if kind == ALL and id == dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
            return self._clear_all(peer, now)
        transfer = self.transfers.get(kind)
        if id == dialect.MAVLINK_MSG_ID_MISSION_ACK:
            return [] if transfer is None else transfer.cancel(peer)
        if transfer is None:
            return [_ack(peer, dialect.MAV_MISSION_UNSUPPORTED, kind)]
        match id:
            case dialect.MAVLINK_MSG_ID_MISSION_COUNT:
                return transfer.count(message.count, peer, now)
            case dialect.MAVLINK_MSG_ID_MISSION_ITEM | dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT:
                return transfer.item(message, peer, now)
            case dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
                return transfer.clear(peer, now)
            case dialect.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST:
                return transfer.partial(message.start_index, message.end_index, peer, now)
            case dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
                return transfer.request_list(peer, now)
            case dialect.MAVLINK_MSG_ID_MISSION_REQUEST | dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT:
                return transfer.request(message.seq, id == dialect.MAVLINK_MSG_ID_MISSION_REQUEST, peer, now)
        return [_ack(peer, dialect.MAV_MISSION_UNSUPPORTED, kind)]  # MISSION_REQUEST_PARTIAL_LIST: no client has it

    def _clear_all(self, peer: Peer, now: float) -> list[Effect]:
        """All three lists or none."""
        if not all(transfer.may_clear(peer, now) for transfer in self.transfers.values()):
            return [
                _ack(peer, dialect.MAV_MISSION_DENIED, ALL),
                Say(Severity.WARNING, texts.PLANS_NOT_CLEARED),
            ]
        cancelled = [effect for transfer in self.transfers.values() for effect in transfer.begin_clear(peer, now)]
        return [*cancelled, Commit(dict.fromkeys(self.transfers, ()), peer, ALL)]

    def stored(self, commit: Commit, now: float, fault: PlanFault | None = None) -> list[Effect]:
        """Finish a `Commit`; with a fault the new plan is invalid and the old one stays."""
        effects: list[Effect] = []
        open_still = any(self.transfers[kind].state is State.STORING for kind in commit.plans)
        for kind, items in commit.plans.items():
            effects += self.transfers[kind].stored(items, now, fault)
        if open_still and commit.acknowledged:
            result = dialect.MAV_MISSION_ACCEPTED if fault is None else fault.result
            transfer = self.transfers.get(commit.mission_type)
            identity = transfer.opaque_id if fault is None and transfer is not None else 0
            effects.append(_ack(commit.peer, result, commit.mission_type, identity))
        while self._waiting and not self._storing(self._waiting[0][0].mission_type):
            effects += self._handle(*self._waiting.pop(0), now)
        return effects

    def deadline(self) -> float | None:
        """When `expire` has something to do; None: never."""
        deadlines = [transfer.deadline() for transfer in self.transfers.values()]
        return min([deadline for deadline in deadlines if deadline is not None], default=None)

    def expire(self, now: float) -> list[Effect]:
        """Time has passed."""
        return [effect for transfer in self.transfers.values() for effect in transfer.expire(now)]

    def leave(self, gone: Callable[[Hashable], bool]) -> None:
        """Some clients' channel is gone; whatever they transferred ends."""
        self._waiting = [waiting for waiting in self._waiting if not gone(waiting[-1].client)]
        for transfer in self.transfers.values():
            transfer.leave(gone)

    def reset(self) -> None:
        """No transfer is under way any more; the plans stay."""
        self._waiting.clear()
        for transfer in self.transfers.values():
            transfer.reset()

    def _storing(self, mission_type: int) -> bool:
        touched = self.transfers.values() if mission_type == ALL else filter(None, [self.transfers.get(mission_type)])
        return any(transfer.state is State.STORING for transfer in touched)


def _ack(peer: Peer, result: int, mission_type: int, identity: int = 0) -> Reply:
    return Reply(dialect.MAVLink_mission_ack_message(peer.sysid, peer.compid, result, mission_type, identity), peer)

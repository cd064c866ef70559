"""A plan protocol and scripted clients, with a bad link between them, in virtual time."""

from __future__ import annotations

import heapq
import random
from dataclasses import dataclass, field
from typing import Any

from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.services.plan.item_messages import item_float, item_int, item_of
from anafi_mav.services.plan.plan_protocol import MissionProtocol
from anafi_mav.services.plan.plan_transfer import Changed, Commit, Effect, Peer, PlanKind, Reply, Say
from anafi_mav.vehicle.fence.plan_items import PlanFault, PlanItem

MISSION, FENCE, RALLY = range(3)


class Kind(PlanKind):
    """A list that takes everything but command 666, and no plan whose last item has command 667."""

    def __init__(self, mission_type: int = FENCE, name: str = "fence") -> None:
        self.mission_type, self.name = mission_type, name

    def check_item(self, item: PlanItem) -> Any:
        return PlanFault(dialect.MAV_MISSION_UNSUPPORTED, "nobody wants it") if item.command == 666 else None

    def check_plan(self, items: Any, flavour: Any = None) -> Any:
        return PlanFault(dialect.MAV_MISSION_INVALID, "it ends badly") if items and items[-1].command == 667 else None


def mission_protocol() -> MissionProtocol:
    return MissionProtocol([Kind(MISSION, "mission"), Kind(FENCE, "fence"), Kind(RALLY, "rally")])


def an_item(number: int, command: int = 5001) -> PlanItem:
    return PlanItem(command, 0, (4.0, 0.25, 0.0, -1.5), 488789000 + number, -23677000, 12.5)


def items(count: int) -> tuple[PlanItem, ...]:
    return tuple(an_item(number) for number in range(count))


def peer(sysid: int = 255, compid: int = 190, flavour: Flavour = PX4, channel: str = "a") -> Peer:
    return Peer((channel, sysid, compid), sysid, compid, flavour)


def replies(effects: list[Effect]) -> list[Any]:
    return [effect.message for effect in effects if isinstance(effect, Reply)]


def texts(effects: list[Effect]) -> list[str]:
    return [effect.text for effect in effects if isinstance(effect, Say)]


@dataclass
class Client:
    """A ground station in the manner of MAVSDK and QGroundControl: answers what it is asked, repeats what it asks."""

    peer: Peer
    plan: tuple[PlanItem, ...] = ()
    """To upload."""
    as_float: bool = False
    """Knows MISSION_REQUEST and MISSION_ITEM only, as dronekit; else the INT forms only."""
    patience: float = 2.5
    """s without a word until it gives up: MAVSDK's 5 times 0.5 s."""
    repeat: float = 0.5
    """s until it says a question again."""
    kind: int = FENCE
    result: int | None = None
    """Of the MISSION_ACK that ended the upload."""
    opaque: int = 0
    downloaded: dict[int, PlanItem] = field(default_factory=dict)
    count: int | None = None
    done: bool = False
    acks: list[int] = field(default_factory=list)
    _question: Any = None
    _ask_at: float = 0.0
    _heard: float = 0.0
    _tries: int = 0

    def upload(self, now: float) -> list[Any]:
        self._heard = now
        return self._ask(dialect.MAVLink_mission_count_message(1, 1, len(self.plan), self.kind), now)

    def download(self, now: float) -> list[Any]:
        self._heard = now
        self.patience = 1e9
        return self._ask(dialect.MAVLink_mission_request_list_message(1, 1, self.kind), now)

    def _ask(self, question: Any, now: float) -> list[Any]:
        self._question, self._ask_at, self._tries = question, now + self.repeat, 1
        return [question]

    def receive(self, message: Any, now: float) -> list[Any]:
        if message.mission_type != self.kind or (message.target_system, message.target_component) != (
            self.peer.sysid,
            self.peer.compid,
        ):
            raise AssertionError(f"not for this client: {message}")
        self._heard = now
        match message.get_type():
            case "MISSION_REQUEST_INT" if not self.as_float:
                self._question = None
                return [item_int(self.plan[message.seq], message.seq, 1, 1, self.kind)]
            case "MISSION_REQUEST" if self.as_float:
                self._question = None
                return [item_float(self.plan[message.seq], message.seq, 1, 1, self.kind)]
            case "MISSION_ACK":
                self.acks.append(message.type)
                if not self.done:
                    self.result, self.opaque, self.done = message.type, message.opaque_id, True
                    self._question = None
            case "MISSION_COUNT" if self.count is None:
                self.count = message.count
                return self._next(now)
            case "MISSION_ITEM_INT" | "MISSION_ITEM" if message.seq == len(self.downloaded):
                item = item_of(message)
                assert isinstance(item, PlanItem)
                self.downloaded[message.seq] = item
                return self._next(now)
        return []

    def _next(self, now: float) -> list[Any]:
        seq = len(self.downloaded)
        if seq == self.count:
            self.done, self._question = True, None
            return [dialect.MAVLink_mission_ack_message(1, 1, 0, self.kind)]
        form = dialect.MAVLink_mission_request_message if self.as_float else dialect.MAVLink_mission_request_int_message
        return self._ask(form(1, 1, seq, self.kind), now)

    def deadline(self) -> float:
        return 1e9 if self.done else min(self._ask_at if self._question else 1e9, self._heard + self.patience)

    def expire(self, now: float) -> list[Any]:
        if self.done:
            return []
        if now >= self._heard + self.patience:
            self.done, self._question = True, None
            return []
        if self._question is not None and now >= self._ask_at:
            self._ask_at = now + self.repeat
            self._tries += 1
            if self._tries > 20:
                self.done = True
                return []
            return [self._question]
        return []


class Wire:
    """One protocol, some clients, and what happens between them."""

    def __init__(
        self,
        plans: MissionProtocol,
        clients: list[Client],
        *,
        seed: int = 0,
        loss: float = 0.0,
        duplicate: float = 0.0,
        delay: tuple[float, float] = (0.005, 0.005),
        storing: float = 0.002,
    ) -> None:
        self.protocol, self.clients, self.now = plans, clients, 0.0
        self.sent: list[Any] = []
        """What the protocol sent, in order."""
        self._random = random.Random(seed)
        self._loss, self._duplicate, self._delay, self._storing = loss, duplicate, delay, storing
        self._air: list[tuple[float, int, Any, Any]] = []
        self._count = 0

    def to_protocol(self, client: Client, messages: list[Any]) -> None:
        for message in messages:
            self._throw(client, message, False)

    def _perform(self, effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Reply):
                self.sent.append(effect.message)
                (client,) = (c for c in self.clients if c.peer == effect.peer)
                self._throw(client, effect.message, True)
            elif isinstance(effect, Commit):
                self._push(self.now + self._storing, effect, None)
            else:
                assert isinstance(effect, Changed | Say)

    def _throw(self, client: Client, message: Any, down: bool) -> None:
        for _ in range(2 if self._random.random() < self._duplicate else 1):
            if self._random.random() >= self._loss:
                self._push(self.now + self._random.uniform(*self._delay), message, (client, down))

    def _push(self, at: float, what: Any, way: Any) -> None:
        self._count += 1
        heapq.heappush(self._air, (at, self._count, what, way))

    def run(self, until: float = 1e6) -> None:
        """Let time pass until every client is done, or `until`."""
        while not all(client.done for client in self.clients):
            times = [client.deadline() for client in self.clients]
            times += [at for at in (self.protocol.deadline(),) if at is not None]
            times += [self._air[0][0]] if self._air else []
            if min(times) > until:
                self.now = until
                return
            self.now = max(self.now, min(times))
            self._perform(self.protocol.expire(self.now))
            for client in self.clients:
                self.to_protocol(client, client.expire(self.now))
            while self._air and self._air[0][0] <= self.now:
                _, _, what, way = heapq.heappop(self._air)
                if way is None:
                    self._perform(self.protocol.stored(what, self.now))
                elif way[1]:
                    self.to_protocol(way[0], way[0].receive(what, self.now))
                else:
                    self._perform(self.protocol.receive(what, way[0].peer, self.now))

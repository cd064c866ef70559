"""The state machine of the transfer of one plan: mission, fence or rally points. No I/O.

A client's upload replaces the plan as a whole, once all of it has arrived, was found good and is stored; whatever goes
wrong before leaves the old plan as it was. A download is answered from the plan as it was when the client asked for
its list. `MissionProtocol` (plan_protocol) holds the three lists and sorts the messages.

Rules: MAVLink mission.md; conformance A7, C5, D1, items 46, 61-72.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import msgspec

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.services.plan.item_messages import item_float, item_int, item_of
from anafi_mav.services.plan.plan_requests import REQUEST_EVERY, Requests
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.fence.plan_items import MAX_ITEMS, PlanFault, PlanItem, opaque_id

PATIENCE = 1.5
"""s of silence after which a client no longer keeps others away (the "1500 ms others" of conformance C5)."""

RECENT = 5.0
"""s after which a transfer is history: what comes late of it is answered as if it had never been."""

ECHOES = 6
"""How often the final acknowledgement is repeated, `REQUEST_EVERY` apart, after a transfer that lost something:
clients wait 1.5 to 2.5 s for it and do not ask. One that lost nothing is acknowledged once, for a repetition could
meet the client's next transfer."""

MAX_DOWNLOADS = 16
"""Clients whose download is remembered; an address is easily made up."""


class State(enum.Enum):
    IDLE = "no client uploads"
    RECEIVING = "a client uploads"
    STORING = "a complete or an empty plan is being stored"


class Event(enum.Enum):
    BEGIN = "MISSION_COUNT above 0, or MISSION_WRITE_PARTIAL_LIST"
    ITEM = "the expected item"
    LAST_ITEM = "the last expected item"
    CLEAR = "MISSION_CLEAR_ALL, or MISSION_COUNT of 0"
    REFUSE = "an item or the plan is invalid"
    CANCEL = "the client aborts, or its channel is closed"
    SILENCE = "the requested item was not received"
    STORED = "stored"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.IDLE: {Event.BEGIN: State.RECEIVING, Event.CLEAR: State.STORING},
    State.RECEIVING: {
        Event.BEGIN: State.RECEIVING,
        Event.ITEM: State.RECEIVING,
        Event.LAST_ITEM: State.STORING,
        Event.CLEAR: State.STORING,
        Event.REFUSE: State.IDLE,
        Event.CANCEL: State.IDLE,
        Event.SILENCE: State.IDLE,
    },
    State.STORING: {Event.STORED: State.IDLE},
}
"""A missing pair cannot occur: `PlanTransfer` ignores, refuses or defers the event."""


class Peer(msgspec.Struct, frozen=True):
    """A client, identified by `client` and addressed exactly (conformance R11)."""

    client: Hashable
    sysid: int
    compid: int
    flavour: Flavour
    may_change: bool = True
    """False for a client that only reads plans: its downloads keep no other client away."""

    def is_copy_of(self, other: Peer) -> bool:
        """Return True for the ids of `other` over another link, as of a router with two links to us."""
        return self.client != other.client and (self.sysid, self.compid) == (other.sysid, other.compid)


class Reply(msgspec.Struct, frozen=True):
    """Send this to one client."""

    message: dialect.MAVLink_message
    peer: Peer


@dataclass(frozen=True)
class Commit:
    """Store these lists, then say so to `MissionProtocol.stored`."""

    plans: dict[int, tuple[PlanItem, ...]]
    """By MAV_MISSION_TYPE."""
    peer: Peer
    mission_type: int
    """Of the acknowledgement: a list's own, or that of all of them."""
    acknowledged: bool = True
    """A MISSION_ACK follows; not for a list that came as a file."""


@dataclass(frozen=True)
class Changed:
    """Another plan is in force."""

    mission_type: int


@dataclass(frozen=True)
class Say:
    """A text to all clients."""

    severity: Severity
    text: OperatorText


Effect: TypeAlias = Reply | Commit | Changed | Say


class PlanKind:
    """Rules of one of the three lists: the items it accepts.

    Subclasses override what differs.
    """

    mission_type: int
    name: str
    """For people: "fence"."""
    capacity = MAX_ITEMS
    refusal: PlanFault | None = None
    """Why no plan of this kind is taken at all; None: they are."""

    def check_item(self, item: PlanItem) -> PlanFault | None:
        """Return the fault of one item by itself."""
        return None

    def check_plan(self, items: Sequence[PlanItem], flavour: Flavour = PX4) -> PlanFault | None:
        """Return the fault of a list whose items are valid by themselves.

        Its reason numbers items as clients of this flavour do.
        """
        return None

    def shown(self, items: Sequence[PlanItem], flavour: Flavour) -> Sequence[PlanItem]:
        """The list as clients of this flavour see it."""
        return items

    def taken(self, items: Sequence[PlanItem], flavour: Flavour) -> Sequence[PlanItem]:
        """The plan in a list that a client of this flavour sent; the inverse of `shown`."""
        return items

    def remarks(self, items: Sequence[PlanItem]) -> Sequence[OperatorText]:
        """Return warnings about an accepted list: items that `taken` leaves out."""
        return ()

    def label(self, seq: int, flavour: Flavour) -> int:
        """Return the number of an item of this seq in texts."""
        return seq

    def always_shown(self, seq: int, flavour: Flavour) -> PlanItem | None:
        """Return the item at a place of the list that exists even when the list is empty, or None."""
        return None


@dataclass
class _Upload:
    peer: Peer
    items: list[PlanItem]
    """The list as it will be: for a partial one with the items that stay."""
    requests: Requests
    heard: float
    as_float: bool = False
    """The form of the newest request, which sticks while it is answered."""
    lossy: bool = False
    """Something had to be said twice."""


@dataclass
class _Download:
    items: Sequence[PlanItem]
    asked: float
    keeps_away: bool
    """False for a client that may not change plans: it must not keep those who may from doing so."""
    left: set[int] = field(default_factory=set)
    """Items that were not asked for yet."""

    @property
    def under_way(self) -> bool:
        """True after the first requested item and before the last one.

        A client that requests only the count blocks no other client.
        """
        return self.keeps_away and 0 < len(self.left) < len(self.items)


@dataclass
class _Done:
    """A transfer that ended, with an acknowledgement or without."""

    peer: Peer
    at: float
    last: int
    """The last item it brought, which is acknowledged again when it comes again; -1 for none."""
    echoes: int = 0
    due: float = 0.0
    result: int = dialect.MAV_MISSION_ACCEPTED
    """Of the acknowledgement: a refusal can be lost as well, and is to be heard, not another one."""


class PlanTransfer:
    """One list and the transfers of it.

    Every method returns what is to be done; messages of peers never raise.
    """

    def __init__(self, kind: PlanKind) -> None:
        self.kind = kind
        self.state = State.IDLE
        self.items: tuple[PlanItem, ...] = ()
        self.opaque_id = 0
        self._upload: _Upload | None = None
        self._downloads: dict[Hashable, _Download] = {}
        self._done: _Done | None = None
        self._cleared: tuple[Peer, float] | None = None
        """Client that has cleared the list last, and when."""
        self._committing: _Done | None = None

    def put(self, items: Sequence[PlanItem]) -> None:
        """The plan in force, without a transfer."""
        self.items, self.opaque_id = tuple(items), opaque_id(items)

    def reset(self) -> None:
        """No transfer is under way any more; the plan stays."""
        self.state = State.IDLE
        self._upload = self._done = self._committing = self._cleared = None
        self._downloads.clear()

    # Uploads.

    def count(self, count: int, peer: Peer, now: float) -> list[Effect]:
        """MISSION_COUNT: an upload of so many items begins, or the list becomes empty."""
        if count == 0:
            return self.clear(peer, now)
        if self.kind.refusal is not None:
            return self._deny(self.kind.refusal, peer)
        if count > self.kind.capacity:
            return self._deny(
                PlanFault(
                    dialect.MAV_MISSION_NO_SPACE, texts.TOO_MANY_ITEMS.fill(count=count, capacity=self.kind.capacity)
                ),
                peer,
            )
        return self._begin(_Upload(peer, [], Requests(0, count - 1), now), now)

    def partial(self, first: int, last: int, peer: Peer, now: float) -> list[Effect]:
        """MISSION_WRITE_PARTIAL_LIST: some items are replaced, or one follows the last.

        ArduPilot has it, PX4 not.

        MAVProxy names as `last` the one after it; it has no such item and never sends it.
        """
        if not peer.flavour.partial_plans:
            return [self._ack(peer, dialect.MAV_MISSION_UNSUPPORTED)]
        if self.kind.refusal is not None:
            return self._deny(self.kind.refusal, peer)
        items = list(self.kind.shown(self.items, peer.flavour))
        if last == len(items) > first:
            last -= 1
        if not 0 <= first <= last < max(len(items), first + 1) or first > len(items):
            fault = PlanFault(
                dialect.MAV_MISSION_INVALID_SEQUENCE, texts.NO_ITEMS_TO_REPLACE.fill(first=first, last=last)
            )
            return self._deny(fault, peer)
        if first >= self.kind.capacity:
            return self._deny(PlanFault(dialect.MAV_MISSION_NO_SPACE, texts.LIST_FULL.fill(count=first)), peer)
        return self._begin(_Upload(peer, items, Requests(first, last), now), now)

    def _begin(self, upload: _Upload, now: float) -> list[Effect]:
        if self._busy(upload.peer, now):
            return self._occupied(upload.peer)
        effects: list[Effect] = []
        old = self._upload
        if old is not None and old.peer.client == upload.peer.client:
            before, after = old.requests, upload.requests
            if before.expected == before.first and (before.first, before.last, old.items) == (
                after.first,
                after.last,
                upload.items,
            ):
                # A copy. The first item has been requested, and will be again: the client need not hear of it twice.
                before.tries, old.heard, old.lossy = 1, now, True
                return []
            upload.as_float = old.as_float
            upload.lossy = True  # repeated, or restarted because a message was lost
        elif old is not None:
            effects += [self._ack(old.peer, dialect.MAV_MISSION_OPERATION_CANCELLED)]
        else:
            upload.as_float = upload.peer.flavour.float_plans
        self._downloads.pop(upload.peer.client, None)
        self._forget_done(upload.peer)
        self.state = TRANSITIONS[self.state][Event.BEGIN]
        self._upload = upload
        return [*effects, self._request(upload, now)]

    def item(self, message: Any, peer: Peer, now: float) -> list[Effect]:
        """MISSION_ITEM or MISSION_ITEM_INT, in whichever form it was requested.

        One that is not expected is ignored: the expected one has been requested and will be again. Answering copies
        with requests would double the traffic with every copy.
        """
        upload = self._upload
        if upload is None:
            return self._late_item(message.seq, peer, now)
        if peer.client != upload.peer.client:
            return [self._ack(peer, dialect.MAV_MISSION_DENIED)]
        upload.heard = now
        if message.seq != upload.requests.expected:
            upload.lossy = True
            return []
        item = item_of(message)
        fault = item if isinstance(item, PlanFault) else self.kind.check_item(item)
        if fault is not None:
            number = self.kind.label(message.seq, peer.flavour)
            return self._refuse(
                PlanFault(fault.result, texts.ITEM_REASON.fill(number=number, reason=fault.reason)), now
            )
        assert isinstance(item, PlanItem)
        upload.items[message.seq : message.seq + 1] = [item]
        if upload.requests.came():
            self.state = TRANSITIONS[self.state][Event.ITEM]
            return [self._request(upload, now)]
        items = tuple(self.kind.taken(upload.items, peer.flavour))
        fault = self.kind.check_plan(items, peer.flavour)
        if fault is not None:
            return self._refuse(fault, now)
        self.state = TRANSITIONS[self.state][Event.LAST_ITEM]
        self._upload = None
        self._committing = _Done(peer, now, upload.requests.last, ECHOES if upload.lossy else 0)
        remarks = [Say(Severity.WARNING, text) for text in self.kind.remarks(upload.items)]
        return [*remarks, Commit({self.kind.mission_type: items}, peer, self.kind.mission_type)]

    def replace(self, sent: Sequence[PlanItem], peer: Peer, now: float) -> list[Effect] | PlanFault:
        """A client has sent the whole list at once, as a file: what to do, or why it is refused."""
        if self.kind.refusal is not None:
            return self.kind.refusal
        if self.state is State.STORING or self._busy(peer, now):
            return PlanFault(dialect.MAV_MISSION_DENIED, texts.ANOTHER_CLIENT_TRANSFERS)
        if len(sent) > self.kind.capacity:
            return PlanFault(
                dialect.MAV_MISSION_NO_SPACE, texts.TOO_MANY_ITEMS.fill(count=len(sent), capacity=self.kind.capacity)
            )
        for seq, item in enumerate(sent):
            if (fault := self.kind.check_item(item)) is not None:
                return PlanFault(fault.result, texts.ITEM_REASON.fill(number=seq, reason=fault.reason))
        items = tuple(self.kind.taken(sent, peer.flavour))
        if (fault := self.kind.check_plan(items, peer.flavour)) is not None:
            return fault
        cancelled = self._begin_commit(peer, now, acknowledged=False)
        remarks = [Say(Severity.WARNING, text) for text in self.kind.remarks(sent)]
        commit = Commit({self.kind.mission_type: items}, peer, self.kind.mission_type, acknowledged=False)
        return [*cancelled, *remarks, commit]

    def clear(self, peer: Peer, now: float) -> list[Effect]:
        """Handle MISSION_CLEAR_ALL, or MISSION_COUNT of 0; an empty list is acknowledged, too."""
        if not self.may_clear(peer, now):
            return self._occupied(peer)
        cancelled = self.begin_clear(peer, now)
        return [*cancelled, Commit({self.kind.mission_type: ()}, peer, self.kind.mission_type)]

    def may_clear(self, peer: Peer, now: float) -> bool:
        """Return True if no other client transfers this list, and the request is no late copy."""
        return not self._busy(peer, now) and not (self.items and self._may_be_late_copy(peer, now))

    def _may_be_late_copy(self, peer: Peer, now: float) -> bool:
        """Return True if the client's ids have cleared this list over another link a moment ago.

        A late copy must not delete what was uploaded since. Another program with the same ids is refused then, and may
        clear that a moment later.
        """
        if self._cleared is None:
            return False
        by, at = self._cleared
        return peer.is_copy_of(by) and now - at < PATIENCE

    def begin_clear(self, peer: Peer, now: float) -> list[Effect]:
        """The list becomes empty with the commit that the caller makes; see `_begin_commit`."""
        if not self._may_be_late_copy(peer, now):
            self._cleared = peer, now
        return self._begin_commit(peer, now, acknowledged=True)

    def _begin_commit(self, peer: Peer, now: float, *, acknowledged: bool) -> list[Effect]:
        """Store a whole list at once, and return the end of the upload that it replaces.

        A client whose new list is `acknowledged` would take that end for the acknowledgement.
        """
        upload, self._upload = self._upload, None
        self._downloads.pop(peer.client, None)
        self._forget_done(peer)
        self.state = TRANSITIONS[self.state][Event.CLEAR]
        self._committing = _Done(peer, now, -1)
        if upload is None or (acknowledged and upload.peer.client == peer.client):
            return []
        return [self._ack(upload.peer, dialect.MAV_MISSION_OPERATION_CANCELLED)]

    def stored(self, items: tuple[PlanItem, ...], now: float, fault: PlanFault | None = None) -> list[Effect]:
        """Finish a `Commit`: it is stored, or has a fault.

        The caller sends the acknowledgement.
        """
        if self.state is not State.STORING:
            return []  # the link was lost meanwhile
        self.state = TRANSITIONS[self.state][Event.STORED]
        done, self._committing = self._committing, None
        if done is not None:
            done.at, done.due = now, now + REQUEST_EVERY
            done.result = dialect.MAV_MISSION_ACCEPTED if fault is None else fault.result
            self._done = done
        if fault is not None:
            self._cleared = None  # nothing was deleted
            return []
        self.put(items)
        return [Changed(self.kind.mission_type)]

    def cancel(self, peer: Peer) -> list[Effect]:
        """MISSION_ACK from a client: it has all it asked for, or gives its upload up."""
        self._downloads.pop(peer.client, None)
        self._forget_done(peer)
        if self._upload is not None and self._upload.peer.client == peer.client:
            self._end(Event.CANCEL)
        return []

    def leave(self, gone: Callable[[Hashable], bool]) -> None:
        """Some clients' channel is gone: whatever they transferred ends."""
        self._downloads = {client: download for client, download in self._downloads.items() if not gone(client)}
        if self._upload is not None and gone(self._upload.peer.client):
            self._end(Event.CANCEL)
        if self._done is not None and gone(self._done.peer.client):
            self._done = None

    # Downloads.

    def request_list(self, peer: Peer, now: float) -> list[Effect]:
        """Answer MISSION_REQUEST_LIST with the number of items.

        A client that requests the list during its own upload has aborted the upload.
        """
        self.cancel(peer)
        items = self.kind.shown(self.items, peer.flavour)
        if items:
            while len(self._downloads) >= MAX_DOWNLOADS:
                del self._downloads[next(iter(self._downloads))]
            self._downloads[peer.client] = _Download(items, now, peer.may_change, set(range(len(items))))
        return [
            Reply(
                dialect.MAVLink_mission_count_message(
                    peer.sysid, peer.compid, len(items), self.kind.mission_type, self.opaque_id
                ),
                peer,
            )
        ]

    def request(self, seq: int, as_float: bool, peer: Peer, now: float) -> list[Effect]:
        """Answer MISSION_REQUEST_INT or MISSION_REQUEST: in any sequence, repeated, several at once."""
        self._forget_done(peer)
        download = self._downloads.get(peer.client)
        if download is not None and now - download.asked > RECENT:
            del self._downloads[peer.client]
            download = None
        if download is None:
            items = self.kind.shown(self.items, peer.flavour)
        else:
            items = download.items
            download.asked = now
            download.left.discard(seq)
        item = items[seq] if seq < len(items) else self.kind.always_shown(seq, peer.flavour)
        if item is None:
            return [self._ack(peer, dialect.MAV_MISSION_INVALID_SEQUENCE)]
        build = item_float if as_float else item_int
        return [Reply(build(item, seq, peer.sysid, peer.compid, self.kind.mission_type), peer)]

    # Time.

    def deadline(self) -> float | None:
        """When `expire` has something to do; None: never."""
        if self._upload is not None:
            return self._upload.requests.due
        return self._done.due if self._done is not None and self._done.echoes > 0 else None

    def expire(self, now: float) -> list[Effect]:
        """Time has passed."""
        upload, done = self._upload, self._done
        if upload is not None and now >= upload.requests.due:
            upload.lossy = True
            if upload.requests.in_vain:
                self._end(Event.SILENCE)
                return [
                    self._ack(upload.peer, dialect.MAV_MISSION_OPERATION_CANCELLED),
                    Say(
                        Severity.WARNING,
                        texts.UPLOAD_ABORTED.fill(
                            kind=self.kind.name.capitalize(),
                            number=self.kind.label(upload.requests.expected, upload.peer.flavour),
                        ),
                    ),
                ]
            return [self._request(upload, now)]
        if upload is None and done is not None and done.echoes > 0 and now >= done.due:
            done.echoes -= 1
            done.due = now + REQUEST_EVERY
            return [self._ack(done.peer, done.result)]
        return []

    # Machinery.

    def _request(self, upload: _Upload, now: float) -> Reply:
        """Ask for the expected item.

        MAVSDK knows MISSION_REQUEST_INT alone, dronekit MISSION_REQUEST alone. A flavour says which one its clients
        know; a client of component 0, which is pymavlink's default, may be either, so each try takes the other form.
        """
        requests, peer = upload.requests, upload.peer
        if requests.between_tries and requests.tries > 0 and peer.compid == 0 and not peer.flavour.float_plans:
            upload.as_float = not upload.as_float
        kind = (
            dialect.MAVLink_mission_request_message if upload.as_float else dialect.MAVLink_mission_request_int_message
        )
        return Reply(kind(peer.sysid, peer.compid, requests.again(now), self.kind.mission_type), peer)

    def _ack(self, peer: Peer, result: int) -> Reply:
        identity = self.opaque_id if result == dialect.MAV_MISSION_ACCEPTED else 0
        return Reply(
            dialect.MAVLink_mission_ack_message(peer.sysid, peer.compid, result, self.kind.mission_type, identity), peer
        )

    def _busy(self, peer: Peer, now: float) -> bool:
        """Return True if another client transfers this list and has sent something recently."""
        upload = self._upload
        if upload is not None and upload.peer.client != peer.client and now - upload.heard < PATIENCE:
            return True
        return any(
            client != peer.client and download.under_way and now - download.asked < PATIENCE
            for client, download in self._downloads.items()
        )

    def _occupied(self, peer: Peer) -> list[Effect]:
        return self._deny(PlanFault(dialect.MAV_MISSION_DENIED, texts.ANOTHER_CLIENT_TRANSFERS), peer)

    def _deny(self, fault: PlanFault, peer: Peer) -> list[Effect]:
        """No transfer begins."""
        text = texts.REFUSED.fill(what=self.kind.name.capitalize(), reason=fault.reason)
        return [self._ack(peer, fault.result), Say(Severity.WARNING, text)]

    def _refuse(self, fault: PlanFault, now: float) -> list[Effect]:
        """The upload ends, the old plan stays."""
        upload = self._upload
        assert upload is not None
        self._end(Event.REFUSE)
        echoes = ECHOES if upload.lossy else 0
        self._done = _Done(upload.peer, now, upload.requests.expected, echoes, now + REQUEST_EVERY, fault.result)
        return self._deny(fault, upload.peer)

    def _end(self, event: Event) -> None:
        self.state = TRANSITIONS[self.state][event]
        upload, self._upload = self._upload, None
        if upload is not None:
            self._done = _Done(upload.peer, upload.heard, -1)

    def _late_item(self, seq: int, peer: Peer, now: float) -> list[Effect]:
        """Handle an item without an upload: a copy of a received item, or an error."""
        committing, done = self._committing, self._done
        if committing is not None and committing.peer.client == peer.client:
            return []
        if done is None or done.peer.client != peer.client or now - done.at > RECENT:
            return [self._ack(peer, dialect.MAV_MISSION_ERROR)]
        if seq != done.last:
            return []
        return [self._ack(peer, done.result)]  # the client has not heard it: it says its last item again

    def gone_on(self, peer: Peer) -> None:
        """The client begins with another list, so it has heard of this one.

        MAVSDK takes an acknowledgement of any list for one of that which it transfers.
        """
        for done in (self._done, self._committing):
            if done is not None and done.peer.client == peer.client:
                done.echoes = 0

    def _forget_done(self, peer: Peer) -> None:
        """The client goes on to something else: nothing late of its last transfer must meet it."""
        if self._done is not None and self._done.peer.client == peer.client:
            self._done = None

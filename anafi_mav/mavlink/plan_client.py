"""The mission protocol from a ground station's side: uploads and downloads. No I/O.

Both transfers are driven alike: `start`, then `receive` for each message of the vehicle and `expire` at `deadline`,
until `result` is set; each returns the messages that are to be sent. Rules and times: MAVLink mission.md.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from anafi_mav.mavlink import dialect

ITEM_TIMEOUT = 0.25
"""s after which an item is requested again (mission.md §timeouts_retries)."""

TIMEOUT = 1.5
"""s after which anything else is said again (the same section)."""

ITEM_TRIES = 20
"""Requests of one item: with a quarter lost each way, five, which mission.md recommends, fail every sixtieth time."""

TRIES = 8
"""Attempts of anything else. mission.md recommends five; with a quarter lost each way these fail once in 750 times."""

MAX_ITEMS = 5000
"""Of a list that is downloaded: more is a vehicle that makes them up."""

Message = dialect.MAVLink_message
Build = Callable[[int], Message]
"""Makes the MISSION_ITEM_INT of an item by its number."""


class Outcome(enum.Enum):
    """How a transfer ended."""

    DONE = "done"
    REFUSED = "the vehicle said no"
    SILENT = "the vehicle did not answer"
    UNCONFIRMED = "the vehicle has had everything, and did not say whether it keeps it"
    TOO_MANY = "the vehicle has more items than can be"


@dataclass(frozen=True)
class TransferResult:
    """The end of a transfer."""

    outcome: Outcome
    code: int = dialect.MAV_MISSION_ACCEPTED
    """MAV_MISSION_RESULT of a refusal."""

    @property
    def reason(self) -> str:
        """For people."""
        if self.outcome is not Outcome.REFUSED:
            return str(self.outcome.value)
        entry = dialect.enums["MAV_MISSION_RESULT"].get(self.code)
        return str(self.code) if entry is None else str(entry.name).removeprefix("MAV_MISSION_")


class Transfer:
    """Base class of an upload and a download."""

    def __init__(self, sysid: int, compid: int, mission_type: int) -> None:
        self.sysid, self.compid = sysid, compid
        self.mission_type = mission_type
        self.result: TransferResult | None = None
        self.total = 0
        self.done = 0
        """Items that have been transferred."""
        self._due = 0.0
        self._tries = 0

    def deadline(self) -> float | None:
        """When `expire` is due; None when the transfer has ended."""
        return None if self.result is not None else self._due

    def _ours(self, message: Any, sysid: int, compid: int) -> bool:
        return (
            self.result is None
            and (sysid, compid) == (self.sysid, self.compid)
            and getattr(message, "mission_type", None) == self.mission_type
        )

    def _end(self, outcome: Outcome, code: int = dialect.MAV_MISSION_ACCEPTED) -> list[Message]:
        self.result = TransferResult(outcome, code)
        return []

    def _ack(self, code: int) -> Message:
        return dialect.MAVLink_mission_ack_message(self.sysid, self.compid, code, self.mission_type)


class Upload(Transfer):
    """A list sent to a vehicle, which requests each item; an empty list clears its list."""

    def __init__(self, build: Sequence[Build], sysid: int, compid: int, mission_type: int) -> None:
        super().__init__(sysid, compid, mission_type)
        self.total = len(build)
        self._build = build
        self._last: int | None = None
        """The item that was sent last; None before the first request."""

    def start(self, now: float) -> list[Message]:
        """Announce it."""
        self._due, self._tries = now + TIMEOUT, 1
        if not self._build:
            return [dialect.MAVLink_mission_clear_all_message(self.sysid, self.compid, self.mission_type)]
        return [dialect.MAVLink_mission_count_message(self.sysid, self.compid, self.total, self.mission_type)]

    def receive(self, message: Any, sysid: int, compid: int, now: float) -> list[Message]:
        """A message of any sender."""
        if not self._ours(message, sysid, compid):
            return []
        match message.get_msgId():
            case dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT | dialect.MAVLINK_MSG_ID_MISSION_REQUEST:
                # Who asks by the older message takes either form (common.xml MISSION_REQUEST).
                return self._item(message.seq, now)
            case dialect.MAVLINK_MSG_ID_MISSION_ACK:
                return self._acked(message.type)
        return []

    def _item(self, seq: int, now: float) -> list[Message]:
        if seq >= self.total:
            return []
        if seq != self._last:
            self._tries = 1
        self._last, self._due = seq, now + TIMEOUT
        self.done = max(self.done, seq + 1)
        return [self._build[seq](seq)]

    def _acked(self, code: int) -> list[Message]:
        if code == dialect.MAV_MISSION_INVALID_SEQUENCE:
            return []  # ArduPilot's answer to an item that came twice: it goes on
        if code != dialect.MAV_MISSION_ACCEPTED:
            return self._end(Outcome.REFUSED, code)
        if self.done < self.total:
            return []  # of another transfer: this one has not been had
        return self._end(Outcome.DONE)

    def expire(self, now: float) -> list[Message]:
        """Say again what was not answered, or give up."""
        if self.result is not None or now < self._due:
            return []
        if self._tries >= TRIES:
            return self._end(Outcome.UNCONFIRMED if self._build and self.done == self.total else Outcome.SILENT)
        if self._last is None:
            tries = self._tries
            messages = self.start(now)
            self._tries = tries + 1
            return messages
        # The vehicle asks again for what it lacks; one that does not gets the last item once more.
        self._due, self._tries = now + TIMEOUT, self._tries + 1
        return [self._build[self._last](self._last)]

    def cancel(self) -> list[Message]:
        """Give it up: the vehicle keeps what it had."""
        if self.result is not None:
            return []
        self.result = TransferResult(Outcome.REFUSED, dialect.MAV_MISSION_OPERATION_CANCELLED)
        return [self._ack(dialect.MAV_MISSION_OPERATION_CANCELLED)]


class Download(Transfer):
    """A list from a vehicle, item after item.

    `items` are its MISSION_ITEM_INT, or MISSION_ITEM from older ones.
    """

    def __init__(self, sysid: int, compid: int, mission_type: int) -> None:
        super().__init__(sysid, compid, mission_type)
        self.items: list[Any] = []
        self._begun = False

    def start(self, now: float) -> list[Message]:
        """Ask how many there are."""
        self._due, self._tries = now + TIMEOUT, self._tries + 1
        return [dialect.MAVLink_mission_request_list_message(self.sysid, self.compid, self.mission_type)]

    def receive(self, message: Any, sysid: int, compid: int, now: float) -> list[Message]:
        """A message of any sender."""
        if not self._ours(message, sysid, compid):
            return []
        match message.get_msgId():
            case dialect.MAVLINK_MSG_ID_MISSION_COUNT if not self._begun:
                if message.count > MAX_ITEMS:
                    return [self._ack(dialect.MAV_MISSION_NO_SPACE), *self._end(Outcome.TOO_MANY)]
                self._begun, self.total = True, message.count
                return self._next(now)
            case dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT | dialect.MAVLINK_MSG_ID_MISSION_ITEM if self._begun:
                if message.seq != self.done:
                    return []
                self.items.append(message)
                self.done += 1
                return self._next(now)
            case dialect.MAVLINK_MSG_ID_MISSION_ACK if message.type != dialect.MAV_MISSION_ACCEPTED:
                return self._end(Outcome.REFUSED, message.type)
        return []

    def _next(self, now: float) -> list[Message]:
        self._tries = 0
        if self.done == self.total:
            self._end(Outcome.DONE)
            return [self._ack(dialect.MAV_MISSION_ACCEPTED)]
        return self._request(now)

    def _request(self, now: float) -> list[Message]:
        self._due, self._tries = now + ITEM_TIMEOUT, self._tries + 1
        return [
            dialect.MAVLink_mission_request_int_message(self.sysid, self.compid, self.done, self.mission_type),
        ]

    def expire(self, now: float) -> list[Message]:
        """Ask again, or give up."""
        if self.result is not None or now < self._due:
            return []
        if self._tries >= (ITEM_TRIES if self._begun else TRIES):
            return self._end(Outcome.SILENT)
        return self._request(now) if self._begun else self.start(now)

    def cancel(self) -> list[Message]:
        """Give it up."""
        if self.result is not None:
            return []
        self.result = TransferResult(Outcome.REFUSED, dialect.MAV_MISSION_OPERATION_CANCELLED)
        return [self._ack(dialect.MAV_MISSION_OPERATION_CANCELLED)]

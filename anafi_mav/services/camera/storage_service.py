"""STORAGE_INFORMATION and MAV_CMD_STORAGE_FORMAT for the storages of photos and videos.

Storages are counted from 1 in the sequence of the drone's own numbers. A card that is removed keeps its number and is
reported as EMPTY.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone import events
from anafi_mav.drone.element import StateWatch
from anafi_mav.drone.events import FormattingType, FsState, PhyState, StorageFeature
from anafi_mav.drone.payload.camera import BEGUN, Camera
from anafi_mav.drone.payload.storage import StorageState
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import char_field
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.camera.camera_messages import MEBIBYTE
from anafi_mav.services.camera.camera_targets import PASSING, media_storage, require_idle, storage_problem
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect, ProgressPolicy
from anafi_mav.services.service import Answer, Host, Request, Service
from anafi_mav.texts import Reason
from anafi_mav.vehicle.base.refusal import Refused, Unsupported
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions

logger = logging.getLogger(__name__)

PERIOD = 5
"""s between the drone's reports of free space. A video of 100 Mbit/s fills 60 MiB meanwhile."""

MAX_STORAGES = 8
"""Storages that are counted; the Ai has two, more is a confused peer."""

STATUSES: Mapping[FsState, int] = {
    FsState.READY: dialect.STORAGE_STATUS_READY,
    FsState.FORMAT_NEEDED: dialect.STORAGE_STATUS_UNFORMATTED,
    FsState.FORMATTING: dialect.STORAGE_STATUS_UNFORMATTED,
}
"""Others (error, password, check) are NOT_SUPPORTED, as is a card that is too small or too slow."""


def status(state: StorageState) -> int:
    """Return the STORAGE_STATUS of a storage."""
    if state.physical == PhyState.UNDETECTED:
        return dialect.STORAGE_STATUS_EMPTY
    if state.physical != PhyState.AVAILABLE or state.file_system is None:
        return dialect.STORAGE_STATUS_NOT_SUPPORTED
    return STATUSES.get(state.file_system, dialect.STORAGE_STATUS_NOT_SUPPORTED)


def can_format(state: StorageState) -> bool:
    """Return True for a storage that the drone can format as it is now."""
    if state.feature is None or state.formats == frozenset():
        return False
    if state.features is None or StorageFeature.FORMAT_WHEN_READY_ALLOWED in state.features:
        return True
    return state.file_system != FsState.READY


class StorageService(Service):
    """The storages of one drone."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._ids: tuple[int, ...] = ()
        """The drone's numbers of all storages that it has reported since the connection."""
        self._sent: dict[int, tuple[object, ...]] = {}
        """Content of the last STORAGE_INFORMATION to all, by the drone's number."""
        self._is_empty = False
        """A storage has been formatted, and nothing has been taken or recorded since."""
        self._problems: dict[int, Reason | None] = {}
        """Reason why nothing can be stored, as last reported in a text."""
        self._generation = -1
        """Of the host's memory: which drone has these storages."""
        self._reported = StateWatch(host.drone.storage, host.drone.camera)
        """The camera says which storage it writes to."""

    def link_up(self) -> None:
        self._reported.reset()
        if self.host.memory.generation != self._generation:  # the first connection of this drone
            self._generation = self.host.memory.generation
            self._ids, self._sent, self._problems = (), {}, {}
            self._note_storages()
            for id in self.host.drone.storage.state:
                self._sent[id], self._problems[id] = self._content(id), storage_problem(self.host.drone, id)
        self._send_changed()  # without a link a card may have been changed
        self.host.spawn(self._monitor())

    async def _monitor(self) -> None:
        """Have the drone report the free space."""
        storage = self.host.drone.storage
        for id in self._ids:
            if storage[id].feature is None or storage[id].monitoring:
                continue
            try:
                await storage.start_monitoring(PERIOD, id)
            except AnafiMavError as error:
                logger.debug("%s: free space of storage %d not reported: %s", self.host.drone.name, id, error)

    def _note_storages(self) -> None:
        """Add storages to the list of known ones; a removed card stays in it."""
        self._ids = tuple(sorted({*self._ids, *self.host.drone.storage.state})[:MAX_STORAGES])

    def _state(self, id: int) -> StorageState:
        state = self.host.drone.storage.state.get(id)
        return StorageState(removable=True, physical=PhyState.UNDETECTED) if state is None else state

    # Messages.

    def requests(self) -> Mapping[int, Request]:
        return {dialect.MAVLINK_MSG_ID_STORAGE_INFORMATION: self._information}

    def _information(self, inbound: Inbound, command: Command) -> Answer:
        """Return one storage by its number, all for 0."""
        number = command.params[1]
        if math.isnan(number) or number == 0.0:
            return [self._message(id) for id in self._ids] or dialect.MAV_RESULT_TEMPORARILY_REJECTED
        id = self._id(number)
        return dialect.MAV_RESULT_DENIED if id is None else self._message(id)

    def _id(self, number: float) -> int | None:
        """Return the drone's number of a storage; None for one that does not exist."""
        known = number in range(1, len(self._ids) + 1)
        return self._ids[int(number) - 1] if known else None

    def _content(self, id: int) -> tuple[object, ...]:
        state = self._state(id)
        is_used = id == media_storage(self.host.drone)
        return (status(state), state.capacity, state.available, state.name, len(self._ids), is_used)

    def _message(self, id: int) -> dialect.MAVLink_message:
        state = self._state(id)
        shown = status(state)
        has_medium = shown != dialect.STORAGE_STATUS_EMPTY
        capacity = math.nan if state.capacity is None else state.capacity / MEBIBYTE
        free = math.nan if state.available is None else state.available / MEBIBYTE
        removable = state.removable is not False
        usage = dialect.STORAGE_USAGE_FLAG_PHOTO | dialect.STORAGE_USAGE_FLAG_VIDEO
        if id == media_storage(self.host.drone):
            usage |= dialect.STORAGE_USAGE_FLAG_SET
        return dialect.MAVLink_storage_information_message(
            self.host.times().boot_ms,
            self._ids.index(id) + 1,
            len(self._ids),
            shown,
            capacity if has_medium else 0.0,
            max(capacity - free, 0.0) if has_medium else 0.0,
            free if has_medium else 0.0,
            math.nan,
            math.nan,
            dialect.STORAGE_TYPE_MICROSD if removable else dialect.STORAGE_TYPE_OTHER,
            char_field(state.name, 31),
            usage,
        )

    def tick(self, now: float) -> float:
        """Send what has changed, and the reason why nothing can be stored."""
        if self._reported.has_changed():
            self._send_changed()
        return NEVER

    def _send_changed(self) -> None:
        count = len(self._ids)
        self._note_storages()
        if len(self._ids) != count:
            self.host.spawn(self._monitor())
        for number, id in enumerate(self._ids, 1):
            content = self._content(id)
            if content != self._sent.get(id):
                self._sent[id] = content
                self.host.send(self._message(id))
            problem = self._problem(id)
            if problem != self._problems.get(id):
                self._problems[id] = problem
                self._explain(number, problem)

    def _problem(self, id: int) -> Reason | None:
        return texts.NO_STORAGE if id not in self.host.drone.storage.state else storage_problem(self.host.drone, id)

    def _explain(self, number: int, problem: Reason | None) -> None:
        if problem in PASSING:
            return
        if problem is None:
            self.host.text(Severity.INFO, texts.STORAGE_READY.fill(number=number))
        else:
            self.host.text(Severity.WARNING, texts.STORAGE_STATE.fill(number=number, state=problem))

    # Format.

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_STORAGE_FORMAT: Action(
                self._format,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.ONCE,
                progress=ProgressPolicy.LATE,
                group=ActionGroup.STORAGE,
                still_holds=lambda command: self._is_empty,
            )
        }

    def subscriptions(self) -> Subscriptions:
        return dict.fromkeys((*Camera.PHOTO_EVENTS, *Camera.RECORDING_EVENTS), self._on_capture)

    def _on_capture(self, message: events.Message, now: float) -> None:
        """Note a photo or recording that has begun: a format command from now on is a new one."""
        is_photo = isinstance(message, Camera.PHOTO_EVENTS)
        update = Camera.photo_update(message) if is_photo else Camera.recording_update(message)
        if update is not None and update.progress in BEGUN:
            self._is_empty = False

    async def _format(self, command: Command) -> None:
        """MAV_CMD_STORAGE_FORMAT: param1 storage, param2 1. Returns when the drone has formatted it."""
        number, act = command.params[0], command.params[1]
        if act != 1.0:
            raise Refused(texts.FORMAT, texts.FORMAT_VALUE, lasting=True)
        if math.isnan(number) or number == 0.0:
            if len(self._ids) > 1:
                raise Refused(texts.FORMAT, texts.STORAGE_ID, lasting=True)
            number = 1.0
        id = self._id(number)
        if id is None:
            raise Refused(texts.FORMAT, texts.NO_SUCH_STORAGE.fill(number=f"{number:g}"), lasting=True)
        drone, state = self.host.drone, self._state(id)
        if state.physical == PhyState.UNDETECTED:
            raise Refused(texts.FORMAT, texts.NO_STORAGE)
        if not can_format(state):
            raise Unsupported(texts.FORMAT, texts.STORAGE_NOT_FORMATTABLE)
        if self.host.vehicle.armed:
            raise Refused(texts.FORMAT, texts.DRONE_FLIES)
        require_idle(drone, texts.FORMAT)
        quick = state.formats is None or FormattingType.QUICK in state.formats
        await drone.storage.format(FormattingType.QUICK if quick else FormattingType.FULL, id=id)
        self._is_empty = True

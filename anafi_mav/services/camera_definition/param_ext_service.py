"""MAVLink service for the camera's settings: extended parameters and their definition file.

The values are the drone's: a write is acknowledged with what the drone reported after it, and whatever else changes a
setting (the pilot's application, another client, a mission) is sent to all clients. Rules: MAVLink parameter_ext.md,
camera_def.md.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone import Camera, Thermal
from anafi_mav.drone.events import Message
from anafi_mav.errors import AnafiMavError, NotSupported
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.camera_definition.camera_setting import Guard, View
from anafi_mav.services.camera_definition.catalogue import Catalogue, CatalogueEntry
from anafi_mav.services.camera_definition.definition_file import DefinitionFile, definition_file
from anafi_mav.services.camera_definition.param_ext_codec import FIELD_LENGTH, VALUE_LENGTH
from anafi_mav.services.component_metadata import COMPRESSED, compress
from anafi_mav.services.definition_link import DefinitionContent
from anafi_mav.services.files import Query, ServedFile
from anafi_mav.services.flavours import Flavour
from anafi_mav.services.paced_sender import PacedSender
from anafi_mav.services.service import Host, MessageHandler, Service
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.refusal import reason_of
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions

PATH = "/camera_definition.xml"
"""In the root directory of the component's files: MAVSDK looks for a download without the folders of its address
(camera_impl.cpp check_camera_definition_with_lock)."""

URI = f"mftp://{PATH.lstrip('/')}{COMPRESSED}"
"""For CAMERA_INFORMATION. Without a slash and a component for the same reason; QGroundControl and MAVProxy take the
component that announces it. Compressed it is a tenth, and all three unpack it."""

SETTLE = 0.5
"""s after a report until the definition is made again: a list of capabilities is several events."""

PROGRESS_AFTER = 0.25
"""s after which a write that the drone has not answered is reported as IN_PROGRESS: MAVSDK repeats after 0.5 s."""

MAX_WAITING = 128
"""Writes that wait for their turn: all settings from two clients. What comes beyond that is repeated by its client."""

REPEAT_AFTER = 1.0
"""s after which a changed value is sent once more: no client acknowledges it, and only MAVProxy reads values again."""

REFUSAL_EVERY = 5.0
"""s between texts to one channel about refused writes: QGroundControl repeats a failed one three times."""

SHARED = 16
"""Definitions that drones share. A model has one, or a few that differ by the settings of its firmware."""

EVENTS = tuple(kind for kind in (*Camera.REDUCERS, *Thermal.REDUCERS) if kind not in Camera.FREQUENT)


@dataclass
class Write:
    """A requested change that has no final answer yet."""

    inbound: Inbound
    name: str
    value: float
    since: float
    """s, monotonic; when it was received."""
    is_reported: bool = False
    """IN_PROGRESS was sent."""

    @property
    def key(self) -> tuple[Hashable, str]:
        """Client and setting: a newer write of the same replaces one that waits."""
        return self.inbound.client, self.name


class ParamExtService(Service):
    """Answers PARAM_EXT_REQUEST_LIST, _READ and PARAM_EXT_SET, and serves the definition."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._catalogue = Catalogue()
        self._sender = PacedSender(host)
        self._sent: dict[str, float] = {}
        """The value of each setting that was last reported to all clients."""
        self._repeats: dict[str, float] = {}
        """When the value of a changed setting is sent once more, s, monotonic."""
        self._learn_at = math.inf
        """When the definition is made again, s, monotonic."""
        self._waiting: list[Write] = []
        self._current: Write | None = None
        """The write that the drone is carrying out."""
        self._worker: asyncio.Task[None] | None = None
        self._refused_at: dict[Channel, float] = {}

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_PARAM_EXT_REQUEST_LIST: self._request_list,
            dialect.MAVLINK_MSG_ID_PARAM_EXT_REQUEST_READ: self._request_read,
            dialect.MAVLINK_MSG_ID_PARAM_EXT_SET: self._set,
        }

    def files(self) -> Mapping[str, ServedFile]:
        return {PATH: ServedFile(self._plain_file), PATH + COMPRESSED: ServedFile(self._packed_file)}

    def link_up(self) -> None:
        self._catalogue = Catalogue()
        self._learn()
        self._report_changes()

    def link_down(self) -> None:
        self._sender.clear()
        self._repeats.clear()
        self._waiting.clear()
        self._current = self._worker = None  # the task ends with the host's
        self._learn_at = math.inf

    def channel_closed(self, channel: Channel) -> None:
        self._sender.closed(channel)
        self._refused_at.pop(channel, None)

    def subscriptions(self) -> Subscriptions:
        return dict.fromkeys(EVENTS, self._on_report)

    def _on_report(self, message: Message, now: float) -> None:
        self._learn_at = min(self._learn_at, now + SETTLE)
        self._report_changes()

    def tick(self, now: float) -> float:
        if now >= self._learn_at:
            self._learn()
            self._report_changes()
        for name in [name for name, due in self._repeats.items() if now >= due]:
            del self._repeats[name]
            if name in self._catalogue.index:
                self.host.send(self._message(self._catalogue.index[name]))
        unreported: list[float] = []
        for write in (*([self._current] if self._current else []), *self._waiting):
            if write.is_reported:
                continue
            if now >= write.since + PROGRESS_AFTER:
                write.is_reported = True
                self._acknowledge(write, dialect.PARAM_ACK_IN_PROGRESS)
            else:
                unreported.append(write.since + PROGRESS_AFTER)
        return min(self._learn_at, *self._repeats.values(), *unreported, NEVER)

    # The definition.

    def _learn(self) -> None:
        """Make the list of settings and the definition from what the drone reports now."""
        self._learn_at = math.inf
        drone = self.host.drone
        if not self._catalogue.learn(drone.camera.state, drone.thermal.state) or not self._catalogue.entries:
            return
        made = definition_file(self._catalogue, drone.identity.model.title)
        self.host.definition.update(_content(made))

    def _plain_file(self, flavour: Flavour, query: Query) -> bytes | None:
        return self.host.definition.content.plain or None

    def _packed_file(self, flavour: Flavour, query: Query) -> bytes | None:
        return self.host.definition.content.packed or None

    # Values.

    def _value(self, entry: CatalogueEntry) -> float:
        """Return the value to send.

        The default stands for a setting that no camera reports now, as the interval of a series in another photo mode.
        """
        reported = self._reported(entry)
        return entry.default if reported is None else reported

    def _reported(self, entry: CatalogueEntry) -> float | None:
        """Return the value of the camera at work; of another one where it has no such setting.

        None: no camera reports it.
        """
        drone = self.host.drone
        cameras, thermal = drone.camera.state, drone.thermal.state
        active = drone.camera.active_id
        for id in (active, *(other for other in sorted(cameras.cameras) if other != active)):
            value = entry.setting.value_of(View(drone.camera[id], cameras, thermal))
            if value is not None:
                return value
        return None

    def _message(self, place: int) -> dialect.MAVLink_message:
        """PARAM_EXT_VALUE of one setting."""
        entry = self._catalogue.entries[place]
        kind = entry.setting.kind
        return dialect.MAVLink_param_ext_value_message(
            entry.setting.name.encode(),
            kind.encode(self._value(entry)),
            kind.mav,
            len(self._catalogue.entries),
            place,
        )

    def _report_changes(self) -> None:
        """Send each changed value to all clients, now and once more later."""
        repeat_at = self.host.clock.monotonic() + REPEAT_AFTER
        for place, entry in enumerate(self._catalogue.entries):
            name, value = entry.setting.name, self._value(entry)
            if self._sent.get(name, value) != value:
                self.host.send(self._message(place))
                self._repeats[name] = repeat_at
            self._sent[name] = value

    # Reading.

    def _request_list(self, inbound: Inbound) -> None:
        def messages() -> Iterator[dialect.MAVLink_message]:
            place = 0
            while place < len(self._catalogue.entries):
                yield self._message(place)
                place += 1

        self._sender.start(inbound.channel, inbound.client, messages())

    def _request_read(self, inbound: Inbound) -> None:
        message = inbound.message
        place = message.param_index
        if place < 0:
            place = self._catalogue.index.get(message.param_id, -1)
        if 0 <= place < len(self._catalogue.entries):
            self.host.send(self._message(place), inbound.channel)

    # Writing.

    def denials(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_PARAM_EXT_SET: self._deny}

    def _deny(self, inbound: Inbound) -> None:
        """Send the value in effect to a client whose endpoint does not permit the write."""
        name = inbound.message.param_id
        if name in self._catalogue.index:
            self._acknowledge(Write(inbound, name, math.nan, inbound.now), dialect.PARAM_ACK_FAILED)
        else:
            self._answer(inbound, name, bytes(VALUE_LENGTH), inbound.message.param_type, dialect.PARAM_ACK_FAILED)

    def _set(self, inbound: Inbound) -> None:
        message = inbound.message
        name = message.param_id
        if name not in self._catalogue.index:
            self._answer(inbound, name, bytes(VALUE_LENGTH), message.param_type, dialect.PARAM_ACK_FAILED)
            return
        entry = self._catalogue[name]
        kind = entry.setting.kind
        value = kind.decode(message._param_value_raw) if message.param_type == kind.mav else None
        write = Write(inbound, name, math.nan if value is None else value, self.host.clock.monotonic())
        if value is None or not _accepts(entry, value):
            self._acknowledge(write, dialect.PARAM_ACK_VALUE_UNSUPPORTED)
            return
        under_way = [self._current, *self._waiting] if self._current is not None else [*self._waiting]
        for other in under_way:
            if other.key == write.key and other.value == value:  # its answer was lost, or is late
                other.is_reported = True
                self._acknowledge(write, dialect.PARAM_ACK_IN_PROGRESS)
                return
        drone = self.host.drone
        is_settled = drone.camera.is_settled and drone.thermal.is_settled  # else it may have another value
        if is_settled and not any(other.name == name for other in under_way) and self._reported(entry) == value:
            self._acknowledge(write, dialect.PARAM_ACK_ACCEPTED)
            return
        self._queue(write)

    def _queue(self, write: Write) -> None:
        """Carry it out when it is its turn.

        One at a time: a command of the drone carries several settings.
        """
        for place, other in enumerate(self._waiting):
            if other.key == write.key:
                self._waiting[place] = write
                return
        if len(self._waiting) < MAX_WAITING:
            self._waiting.append(write)
        if self._worker is None:
            self._worker = self.host.spawn(self._work())

    async def _work(self) -> None:
        try:
            while self._waiting:
                self._current = self._waiting.pop(0)
                await self._write(self._current)
        finally:
            if self._worker is asyncio.current_task():  # otherwise the link is lost, and another may be at work
                self._current = self._worker = None

    async def _write(self, write: Write) -> None:
        entry = self._catalogue[write.name]
        if self.host.change_objection(write.inbound) is not None:  # another station has become the operator meanwhile
            self._deny(write.inbound)
            return
        reason = self._refusal(entry.setting.guard)
        result = dialect.PARAM_ACK_FAILED
        if reason is None:
            try:
                await entry.setting.write(self.host.drone, self.host.drone.camera.active_id, write.value)
            except NotSupported as error:
                result, reason = dialect.PARAM_ACK_VALUE_UNSUPPORTED, reason_of(error)
            except AnafiMavError as error:
                reason = reason_of(error)
            else:
                if entry.setting.is_set(self._reported(entry), write.value):
                    result = dialect.PARAM_ACK_ACCEPTED
                elif (reason := self._capturing()) is None:
                    result, reason = dialect.PARAM_ACK_VALUE_UNSUPPORTED, texts.VALUE_KEPT
        elif entry.setting.is_set(self._reported(entry), write.value):  # nothing may change it now
            result, reason = dialect.PARAM_ACK_ACCEPTED, None
        self._acknowledge(write, result)
        if reason is not None:
            self._explain(write, reason)

    def _refusal(self, guard: Guard) -> OperatorText | None:
        """Return the reason for which the drone is not asked; None when it is."""
        if guard is Guard.NONE:
            return None
        if self.host.vehicle.mission_needs_camera:
            return texts.MISSION_USES_CAMERA
        return self._capturing() if guard is Guard.CAPTURE else None

    def _capturing(self) -> OperatorText | None:
        cameras = self.host.drone.camera.state.cameras.values()
        if any(camera.recording_now for camera in cameras):
            return texts.CAMERA_RECORDS
        return texts.CAMERA_TAKES_PHOTOS if any(camera.taking for camera in cameras) else None

    def _explain(self, write: Write, reason: OperatorText) -> None:
        """Send the value in effect and the reason to the client whose write has failed.

        QGroundControl keeps showing the refused value after FAILED until it receives another one.
        """
        channel = write.inbound.channel
        self.host.send(self._message(self._catalogue.index[write.name]), channel)
        now = self.host.clock.monotonic()
        if channel.is_open and now - self._refused_at.get(channel, -math.inf) >= REFUSAL_EVERY:
            self._refused_at[channel] = now
            text = texts.PARAMETER_NOT_SET.fill(name=write.name, reason=reason)
            self.host.text(Severity.WARNING, text, channel)

    def _acknowledge(self, write: Write, result: int) -> None:
        """PARAM_EXT_ACK with the value in effect."""
        entry = self._catalogue[write.name]
        kind = entry.setting.kind
        self._answer(write.inbound, write.name, kind.encode(self._value(entry)), kind.mav, result)

    def _answer(self, inbound: Inbound, name: str, value: bytes, kind: int, result: int) -> None:
        message = dialect.MAVLink_param_ext_ack_message(
            name.encode(errors="replace")[:FIELD_LENGTH], value, kind, result
        )
        self.host.send(message, inbound.channel)


@lru_cache(maxsize=SHARED)
def _content(made: DefinitionFile) -> DefinitionContent:
    """Return a definition with its compressed file; equal drones share it."""
    return DefinitionContent(URI, made.version, made.content, compress(made.content))


def _accepts(entry: CatalogueEntry, value: float) -> bool:
    """Return True for a value of the definition."""
    if entry.options:
        return any(option.value == value for option in entry.options)
    assert entry.limits is not None
    low, high, step = entry.limits
    return low <= value <= high and (step is None or math.isclose(math.remainder(value - low, step), 0.0, abs_tol=1e-6))

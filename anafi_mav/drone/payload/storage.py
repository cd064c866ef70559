"""Element storage: the memory card, and the internal memory of the Ai.

Three features say the same: user_storage (4K, Thermal, USA: one card, without an id), user_storage_v2 (Ai) and, in
later firmware, the protobuf service storage. Values of their enums are the same numbers, so that the words of the
first serve for all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import user_storage as v1
from anafi_mav.arsdk.messages import user_storage_v2 as v2
from anafi_mav.arsdk.messages.proto import storage as v3
from anafi_mav.arsdk.messages.user_storage import (
    Attribute,
    Feature,
    FormattingResult,
    FormattingStep,
    FormattingType,
    FsState,
    PhyState,
)
from anafi_mav.drone.element import EMPTY, REMOVE, Reducer, members, with_item
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, require_number
from anafi_mav.drone.payload.camera_enums import StoragePolicy
from anafi_mav.drone.settings import Commanding, Question
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.errors import AnafiMavError, CommandRejected, LocalProtocolError, NotSupported

FORMAT_TIMEOUT = 120.0
"""s without news from a drone that formats. A full format of a large card is minutes, but it reports its progress."""

LONGEST_PERIOD = 255
"""s between two reports of the free space; it travels as u8."""


class StorageState(msgspec.Struct, frozen=True):
    """One memory card or internal memory."""

    feature: str | None = None
    """Parrot's feature that reports it."""
    removable: bool | None = None
    """True for a card; None: the only one, not reported."""
    name: str | None = None
    capacity: int | None = None
    """Bytes."""
    available: int | None = None
    """Bytes free, as last reported: see `Storage.start_monitoring`."""
    physical: PhyState | None = None
    file_system: FsState | None = None
    attributes: frozenset[Attribute] | None = None
    monitoring: bool | None = None
    period_s: int | None = None
    """Seconds between two reports of the free space."""
    features: frozenset[Feature] | None = None
    formats: frozenset[FormattingType] | None = None
    uuid: str | None = None
    step: FormattingStep | None = None
    """Step of a format under way."""
    percent: int | None = None
    """Progress of that step."""

    @property
    def ready(self) -> bool | None:
        """True when media can be stored; None when the drone has not reported it."""
        if self.physical is None or self.file_system is None:
            return None
        return self.physical == PhyState.AVAILABLE and self.file_system == FsState.READY

    @property
    def has_format_result(self) -> bool:
        """True when the end of a format is an event; else the file system's state shows it."""
        return self.features is None or Feature.FORMAT_RESULT_EVT_SUPPORTED in self.features


Storages = Mapping[int, StorageState]


class _Speech(msgspec.Struct, frozen=True):
    """How one of the three features asks."""

    name: str
    start: Callable[[int, int], Message]
    stop: Callable[[int], Message]
    format: Callable[[int, str, FormattingType], Message]
    monitors: tuple[type[Message], ...]
    states: tuple[type[Message], ...]
    results: tuple[type[Message], ...]
    progress: tuple[type[Message], ...]


V1 = _Speech(
    "user_storage",
    lambda id, period: v1.StartMonitoring(period),
    lambda id: v1.StopMonitoring(),
    lambda id, label, kind: v1.FormatWithType(label, kind),
    (v1.Monitor,),
    (v1.State,),
    (v1.FormatResult,),
    (v1.FormatProgress,),
)
V2 = _Speech(
    "user_storage_v2",
    lambda id, period: v2.StartMonitoring(id, period),
    lambda id: v2.StopMonitoring(id),
    lambda id, label, kind: v2.FormatWithType(id, label, v2.FormattingType(kind)),
    (v2.Monitor,),
    (v2.State,),
    (v2.FormatResult,),
    (v2.FormatProgress,),
)
V3 = _Speech(
    "storage",
    lambda id, period: v3.StartMonitoring(id=id, period=period),
    lambda id: v3.StopMonitoring(id=id),
    lambda id, label, kind: v3.Format(id=id, label=label, type=v3.ErasingType(kind)),
    (v3.Monitor,),
    (v3.State,),
    (v3.FormattingResult,),
    (v3.FormattingProgress,),
)


SPEECHES = {speech.name: speech for speech in (V1, V2, V3)}


def _id(message: Any) -> int:
    """Which storage an event is about; the card of the first feature has the id 0."""
    if isinstance(message, v2.State | v2.Monitor | v2.FormatResult | v2.FormatProgress):
        return message.storage_id
    return int(getattr(message, "id", 0))


def _result(message: Any) -> FormattingResult:
    return FormattingResult(message.status if isinstance(message, v3.FormattingResult) else message.result)


def _with(state: Storages, id: int, flags: int = 0, **changes: object) -> Storages:
    """The storages after an event about one of them.

    Every list of user_storage_v2 names all storages, each one with another part of what is known: the first of a list
    must not make the others forgotten.
    """
    if flags & EMPTY:
        return state
    return with_item(state, id, replace(state.get(id, StorageState()), **changes), flags & REMOVE)


def _removable(kind: int) -> bool:
    return kind == v2.StorageType.REMOVABLE_STORAGE


def _v3_state(state: Storages, message: v3.State) -> Storages:
    changes: dict[str, Any] = {}
    if message.storage_info is not None:
        changes |= {"name": message.storage_info.name, "capacity": message.storage_info.capacity}
    if message.storage_state is not None:
        now = message.storage_state
        changes |= {
            "feature": V3.name,
            "physical": PhyState(now.physical_state),
            "file_system": FsState(now.file_system_state),
            "attributes": frozenset(Attribute(one) for one in now.attributes),
            "monitoring": now.is_monitoring_enabled,
            "period_s": now.monitoring_period,
        }
    if message.storage_uuid is not None:
        changes["uuid"] = message.storage_uuid.uuid
    if message.default_capabilities is not None:
        can = message.default_capabilities
        changes["features"] = frozenset(Feature(one) for one in can.supported_features)
        changes["formats"] = frozenset(FormattingType(one) for one in can.supported_erasing_types)
    return _with(state, message.id, **changes)


def _v3_list(state: Storages, message: v3.StorageList) -> Storages:
    for one in message.storages:
        state = _with(state, one.id, removable=_removable(one.type))
    return state


class Storage(Commanding[Storages]):
    """All storages of the drone by id; the verbs use the card unless `id` says another."""

    NOTHING: ClassVar[Storages] = {}
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        v1.Info: lambda state, m: _with(state, 0, name=m.name, capacity=m.capacity),
        v1.Monitor: lambda state, m: _with(state, 0, available=m.available_bytes),
        v1.State: lambda state, m: _with(
            state,
            0,
            feature=V1.name,
            physical=m.physical_state,
            file_system=m.file_system_state,
            attributes=members(m.attribute, Attribute),
            monitoring=m.monitor_enabled != 0,
            period_s=m.monitor_period,
        ),
        v1.Capabilities: lambda state, m: _with(state, 0, features=members(m.supported_features, Feature)),
        v1.SupportedFormattingTypes: lambda state, m: _with(
            state, 0, formats=members(m.supported_types, FormattingType)
        ),
        v1.SdcardUuid: lambda state, m: _with(state, 0, uuid=m.uuid),
        v1.FormatProgress: lambda state, m: _with(state, 0, step=m.step, percent=m.percentage),
        v1.FormatResult: lambda state, m: _with(state, 0, step=None, percent=None),
        v2.Info: lambda state, m: _with(state, m.storage_id, m.list_flags, name=m.name, capacity=m.capacity),
        v2.Monitor: lambda state, m: _with(state, m.storage_id, m.list_flags, available=m.available_bytes),
        v2.State: lambda state, m: _with(
            state,
            m.storage_id,
            m.list_flags,
            feature=V2.name,
            physical=PhyState(m.physical_state),
            file_system=FsState(m.file_system_state),
            attributes=members(m.attribute, Attribute),
            monitoring=m.monitor_enabled != 0,
            period_s=m.monitor_period,
        ),
        v2.Capabilities: lambda state, m: _with(
            state,
            m.storage_id,
            m.list_flags,
            features=members(m.supported_features, Feature),
            removable=_removable(m.storage_type),
        ),
        v2.SupportedFormattingTypes: lambda state, m: _with(
            state, m.storage_id, m.list_flags, formats=members(m.supported_types, FormattingType)
        ),
        v2.StorageUuid: lambda state, m: _with(state, m.storage_id, m.list_flags, uuid=m.uuid),
        v2.FormatProgress: lambda state, m: _with(
            state, m.storage_id, m.list_flags, step=FormattingStep(m.step), percent=m.percentage
        ),
        v2.FormatResult: lambda state, m: _with(state, m.storage_id, m.list_flags, step=None, percent=None),
        v3.StorageList: _v3_list,
        v3.State: _v3_state,
        v3.Monitor: lambda state, m: _with(state, m.id, available=m.available_space),
        v3.FormattingProgress: lambda state, m: _with(state, m.id, step=FormattingStep(m.step), percent=m.percentage),
        v3.FormattingResult: lambda state, m: _with(state, m.id, step=None, percent=None),
    }

    RESULT_EVENTS: ClassVar[tuple[type[Message], ...]] = (v1.FormatResult, v2.FormatResult, v3.FormattingResult)
    """Events at the end of a format; `formatted` reads them."""

    STATE_EVENTS: ClassVar[tuple[type[Message], ...]] = (v1.State, v2.State, v3.State)
    """Events with the state of the file system."""

    @staticmethod
    def formatted(message: Message) -> int | None:
        """Return the id of the storage that a result reports as formatted; None: it was not."""
        return _id(message) if _result(message) == FormattingResult.SUCCESS else None

    def __getitem__(self, id: int) -> StorageState:
        """The state of this storage, an empty one when the drone has not reported it."""
        return self.state.get(id, StorageState())

    @property
    def main(self) -> int:
        """Id of the storage that the verbs use: the card if there is one, else the first."""
        ids = [id for id, one in self.state.items() if one.removable]
        return min(ids or self.state or [0])

    def for_media(self, policy: StoragePolicy | None) -> int | None:
        """Return the id of the storage that a camera with this policy writes to.

        None: the policy allows no storage that exists. A card without a file system is still the storage: the drone
        does not write past it.
        """
        if not self.state:
            return self.main  # not reported
        cards = sorted(id for id, one in self.state.items() if one.removable is not False)
        built_in = sorted(id for id, one in self.state.items() if one.removable is False)
        match policy:
            case StoragePolicy.REMOVABLE:
                allowed = cards
            case StoragePolicy.INTERNAL:
                allowed = built_in
            case StoragePolicy.PRIORITY_INTERNAL:
                allowed = [*(id for id in built_in if self[id].available != 0), *cards, *built_in]
            case _:
                allowed = [*cards, *built_in]
        present = (id for id in allowed if self[id].physical in (None, PhyState.AVAILABLE))
        return next(iter((*present, *allowed)), None)

    def questions(self) -> list[Question]:
        """Return the queries for a drone that speaks protobuf and has reported no storage."""
        return [] if self.state else [(v3.ListStorages(), v3.StorageList, lambda message: True)]

    def details(self) -> list[Question]:
        """Return the queries to send once those storages are known."""

        def about(id: int) -> Question:
            command = v3.GetState(id=id, include_default_capabilities=True)
            return command, v3.State, lambda message: True if _id(message) == id else None

        return [about(id) for id, one in self.state.items() if one.feature is None]

    async def start_monitoring(self, period_s: int = 1, id: int | None = None) -> int:
        """Have the free space reported every `period_s` seconds; return the free bytes now."""
        if not 1 <= period_s <= LONGEST_PERIOD:
            raise LocalProtocolError(f"expected a period of 1 to {LONGEST_PERIOD} s, got {period_s}")
        speech, storage = self._addressed(id)
        return await self._change(
            speech.start(storage, period_s),
            speech.monitors[0],
            lambda message: self[storage].available if _id(message) == storage else None,
            timeout=ANSWER_TIMEOUT + period_s,
        )

    async def stop_monitoring(self, id: int | None = None) -> None:
        """End the reports of the free space."""
        speech, storage = self._addressed(id)
        await self._change(
            speech.stop(storage),
            speech.states[0],
            lambda message: True if _id(message) == storage and not self[storage].monitoring else None,
        )

    async def format(
        self,
        kind: FormattingType = FormattingType.FULL,
        label: str = "",
        id: int | None = None,
        timeout: float = FORMAT_TIMEOUT,
    ) -> None:
        """Erase everything; returns when that is complete.

        `timeout` counts from the last report of progress.

        Raises `CommandRejected` when the drone refuses (it flies or records) or fails.
        """
        require_number(timeout)
        speech, storage = self._addressed(id)
        known = self[storage]
        if known.formats is not None and kind not in known.formats:
            raise NotSupported(f"{kind.name.lower()} format")
        tells = known.has_format_result
        began = False

        def judge(message: Any) -> bool | AnafiMavError | None:
            nonlocal began
            if _id(message) != storage:
                return None
            if isinstance(message, speech.results):
                result = _result(message)
                if result == FormattingResult.SUCCESS:
                    return True
                return CommandRejected(f"format: {spoken(result)}")
            answer.expire_after(timeout, command.NAME)
            state = self[storage].file_system
            began = began or state == FsState.FORMATTING
            if tells or not began:
                return None
            if state == FsState.READY:
                return True
            return CommandRejected("format: error") if state == FsState.ERROR else None

        command = speech.format(storage, label, kind)
        answer = self._commander.expect((*speech.results, *speech.progress, *speech.states), judge)
        self._commander.dispatch(answer, command, min(timeout, 2 * ANSWER_TIMEOUT))
        await answer.wait()

    def _addressed(self, id: int | None) -> tuple[_Speech, int]:
        """How to ask, and the id of a storage that there is."""
        self._commander.require_feature(self.state, "storage")
        storage = self.main if id is None else id
        speech = SPEECHES.get(self[storage].feature or "")
        if speech is None:
            raise NotSupported(f"storage {storage}")
        return speech, storage

"""The places for media: what they are, how much is free, and their formatting.

The older models have one memory card and speak `user_storage` of it; the Ai has two places and speaks
`user_storage_v2`, which says the same with the number of the place. Media are written to the last place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import user_storage as v1
from anafi_mav.arsdk.messages import user_storage_v2 as v2
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.user_storage import FormattingResult, FormattingStep, FormattingType, FsState, PhyState
from anafi_mav.sim.payload.media import MediaStore
from anafi_mav.sim.world.model import AircraftModel, Card

DEFAULT_PERIOD = 1
"""s between two reports of free space if the client requests 0 (Parrot's user_storage.xml)."""

STEP_TIMES = {
    FormattingStep.PARTITIONING: 0.5,
    FormattingStep.CLEARING_DATA: 2.0,
    FormattingStep.CREATING_FS: 0.5,
}
"""s of each step of a formatting; the second belongs to a full one only. Assumed, a real card takes longer."""
_PARTS = 4
"""Reports of progress in each step."""

_FEATURES = (
    1 << v1.Feature.FORMAT_WHEN_READY_ALLOWED
    | 1 << v1.Feature.FORMAT_RESULT_EVT_SUPPORTED
    | 1 << v1.Feature.FORMAT_PROGRESS_EVT_SUPPORTED
)
_TYPES = 1 << FormattingType.FULL | 1 << FormattingType.QUICK
_ONLY = 1 << ListFlags.FIRST | 1 << ListFlags.LAST


class MediaVolume:
    """One place for media. `words` makes its messages of those of `user_storage`."""

    def __init__(self, id: int, card: Card, media: MediaStore | None, words: Callable[[Message], Message]) -> None:
        self.id = id
        self.capacity = card.capacity
        self.reserved = 0
        """Bytes of a file that is being written."""
        self.full = False
        """True when it is filled with other data: nothing is free."""
        self.busy: Callable[[], bool] = lambda: False
        """Returns True while a camera is writing, which forbids formatting."""
        self._card = card
        self._name = card.name
        self._media = media
        self._words = words
        self._period = 0
        self._next = 0.0
        self._steps: list[tuple[float, FormattingStep, int]] = []
        """Future steps of a formatting: (time, step, percent); the last one ends it."""

    @property
    def formatting(self) -> bool:
        return bool(self._steps)

    @property
    def free(self) -> int:
        """Bytes."""
        if self.full:
            return 0
        used = 0 if self._media is None else self._media.used
        return max(0, self.capacity - used - self.reserved)

    def monitor(self, period: int, time: float) -> list[Message]:
        self._period = period or DEFAULT_PERIOD
        self._next = time + self._period
        return [self._words(self._state()), self._words(v1.Monitor(self.free))]

    def stop_monitor(self) -> list[Message]:
        self._period = 0
        return [self._words(self._state())]

    def format(self, label: str, type: FormattingType, time: float) -> list[Message]:
        """Begin; the answer when it cannot."""
        if self.formatting or self.busy():
            return [self._words(v1.FormatResult(FormattingResult.DENIED))]
        if type not in tuple(FormattingType):
            return [self._words(v1.FormatResult(FormattingResult.ERROR))]
        for step, seconds in STEP_TIMES.items():
            if step is FormattingStep.CLEARING_DATA and type is FormattingType.QUICK:
                continue
            for part in range(1, _PARTS + 1):
                self._steps.append((time + seconds * part / _PARTS, step, 100 * part // _PARTS))
            time += seconds
        self._name = label or self._card.name
        if self._media is not None:
            self._media.unplug()
        first = v1.FormatProgress(FormattingStep.PARTITIONING, 0)
        return [self._words(message) for message in (self._state(), v1.Info(self._name, self.capacity), first)]

    def refuse(self) -> list[Message]:
        """The answer to what needs an encrypted card."""
        return [self._words(v1.FormatResult(FormattingResult.DENIED))]

    def refuse_password(self) -> list[Message]:
        return [self._words(v1.Decryption(v1.PasswordResult.WRONG_USAGE))]

    def tick(self, time: float) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        messages: list[Message] = []
        while self._steps and time >= self._steps[0][0]:
            _, step, percent = self._steps.pop(0)
            messages.append(v1.FormatProgress(step, percent))
            if not self._steps:
                self.full = False
                if self._media is not None:
                    self._media.remove_all()
                    self._media.index(time)
                messages += [
                    v1.Info(self._name, self.capacity),
                    self._state(),
                    v1.FormatResult(FormattingResult.SUCCESS),
                ]
        if self._period and time >= self._next:
            self._next = max(self._next + self._period, time)
            messages.append(v1.Monitor(self.free))
        return [self._words(message) for message in messages]

    def _state(self) -> Message:
        state = FsState.FORMATTING if self.formatting else FsState.READY
        return v1.State(PhyState.AVAILABLE, state, 0, int(self._period > 0), self._period)

    def states_report(self) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        return [
            v1.Capabilities(_FEATURES),
            v1.SupportedFormattingTypes(_TYPES),
            v1.Info(self._name, self.capacity),
            self._state(),
            v1.SdcardUuid("00000000000000000000000000000000"),
        ]


class Storage:
    """All places of a model."""

    def __init__(self, model: AircraftModel, media: MediaStore) -> None:
        self._numbered = model.modern
        last = len(model.cards) - 1
        self._places = [
            MediaVolume(id, card, media if id == last else None, _words(id) if self._numbered else _as_it_is)
            for id, card in enumerate(model.cards)
        ]

    @property
    def place(self) -> MediaVolume:
        """Return the storage that the cameras write to."""
        return self._places[-1]

    def tick(self, time: float) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        return [message for place in self._places for message in place.tick(time)]

    def forget(self) -> None:
        """Stop all reports of the free space."""
        for place in self._places:
            place.stop_monitor()

    def handle(self, message: Message, time: float) -> list[Message] | None:
        """Return the answer to a command of this feature, or None for one this model does not know."""
        if type(message) not in (_NUMBERED if self._numbered else _PLAIN):
            return None
        id: int = getattr(message, "storage_id", 0)
        if id >= len(self._places):
            return []
        place = self._places[id]
        match message:
            case v1.StartMonitoring() | v2.StartMonitoring():
                return place.monitor(message.period, time)
            case v1.StopMonitoring() | v2.StopMonitoring():
                return place.stop_monitor()
            case v1.Format() | v2.Format():
                return place.format(message.label, FormattingType.QUICK, time)
            case v1.FormatWithType() | v2.FormatWithType():
                return place.format(message.label, FormattingType(int(message.type)), time)
            case v1.EncryptionPassword() | v2.EncryptionPassword():
                return place.refuse_password()
        return place.refuse()

    def states_report(self) -> list[Message]:
        """Return the storage messages of the AllStates answer.

        When storages are numbered, each message is a list with one entry for each storage.
        """
        if not self._numbered:
            return self.place.states_report()
        last = len(self._places) - 1
        columns = zip(*(place.states_report() for place in self._places), strict=True)
        return [
            _number(message, id, (id == 0) << ListFlags.FIRST | (id == last) << ListFlags.LAST)
            for column in columns
            for id, message in enumerate(column)
        ]


def _as_it_is(message: Message) -> Message:
    return message


def _words(id: int) -> Callable[[Message], Message]:
    return lambda message: _number(message, id, 0)


def _number(message: Message, id: int, flags: int) -> Message:
    """Convert a message of the older feature to the newer one."""
    values: dict[str, Any] = {name: getattr(message, name) for name in message.__struct_fields__}
    match message:
        case v1.Capabilities():
            removable = v2.StorageType.REMOVABLE_STORAGE if id else v2.StorageType.INTERNAL_STORAGE
            return v2.Capabilities(storage_id=id, storage_type=removable, list_flags=flags, **values)
        case v1.State():
            return v2.State(
                storage_id=id,
                physical_state=v2.PhyState(int(message.physical_state)),
                file_system_state=v2.FsState(int(message.file_system_state)),
                attribute=message.attribute,
                monitor_enabled=message.monitor_enabled,
                monitor_period=message.monitor_period,
                fstype="ext4",
                list_flags=flags,
            )
        case v1.SdcardUuid():
            return v2.StorageUuid(id, message.uuid, flags)
    kind: Any = getattr(v2, type(message).__name__)
    return kind(storage_id=id, list_flags=flags, **values)  # type: ignore[no-any-return]


_NAMES = (
    "StartMonitoring",
    "StopMonitoring",
    "Format",
    "FormatWithType",
    "FormatWithEncryption",
    "EncryptionPassword",
)
_PLAIN: frozenset[type[Message]] = frozenset(getattr(v1, name) for name in _NAMES)
_NUMBERED: frozenset[type[Message]] = frozenset(getattr(v2, name) for name in _NAMES)

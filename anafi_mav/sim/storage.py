"""The memory card, as far as a controller asks for it when it connects: what it is, and how much is free."""

from __future__ import annotations

from anafi_mav.arsdk.messages import mediastore, user_storage
from anafi_mav.arsdk.messages.user_storage import Feature, FormattingType, FsState, PhyState
from anafi_mav.arsdk.wire import Message

CAPACITY = 64_000_000_000
"""Bytes on the card."""


class Storage:
    """An empty card."""

    def __init__(self) -> None:
        self._period = 0
        self._next = 0.0

    def handle(self, message: Message, time: float) -> list[Message] | None:
        """The answer to a command of this feature; None when it is none."""
        match message:
            case user_storage.StartMonitoring():
                self._period, self._next = message.period, time + message.period
                return [self._state(), self._monitor()]
            case user_storage.StopMonitoring():
                self._period = 0
                return [self._state()]
        return None

    def tick(self, time: float) -> list[Message]:
        """What has come due by now (s)."""
        if self._period == 0 or time < self._next:
            return []
        self._next = time + self._period
        return [self._monitor()]

    def _monitor(self) -> Message:
        return user_storage.Monitor(CAPACITY)

    def _state(self) -> Message:
        return user_storage.State(PhyState.AVAILABLE, FsState.READY, 0, int(self._period > 0), self._period)

    def states_report(self) -> list[Message]:
        """What AllStates tells of the card and of what is on it."""
        return [
            user_storage.Capabilities(1 << Feature.FORMAT_RESULT_EVT_SUPPORTED),
            user_storage.SupportedFormattingTypes(1 << FormattingType.FULL | 1 << FormattingType.QUICK),
            user_storage.Info("SD", CAPACITY),
            self._state(),
            user_storage.SdcardUuid("00000000000000000000000000000000"),
            mediastore.State(mediastore.MediastoreState.INDEXED),
            mediastore.Counters(0, 0, 0, 0),
        ]

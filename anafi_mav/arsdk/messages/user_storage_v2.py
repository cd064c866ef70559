"""Feature 166, user_storage_v2: the storages of the Ai.

Each has an id, as a rule 0 internal, 1 memory card.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, STRING, U8, U16, U64, Bits, Buffer, Message, OpenEnum, command, event
from anafi_mav.arsdk.messages.generic import ListFlags


class Feature(OpenEnum):
    FORMAT_WHEN_READY_ALLOWED = 0
    FORMAT_RESULT_EVT_SUPPORTED = 1
    FORMAT_PROGRESS_EVT_SUPPORTED = 2
    ENCRYPTION_SUPPORTED = 3


class StorageType(OpenEnum):
    INTERNAL_STORAGE = 0
    REMOVABLE_STORAGE = 1


class FormattingType(OpenEnum):
    FULL = 0
    QUICK = 1


class PhyState(OpenEnum):
    UNDETECTED = 0
    TOO_SMALL = 1
    TOO_SLOW = 2
    AVAILABLE = 3
    USB_MASS_STORAGE = 4


class FsState(OpenEnum):
    UNKNOWN = 0
    FORMAT_NEEDED = 1
    FORMATTING = 2
    READY = 3
    ERROR = 4
    PASSWORD_NEEDED = 5
    CHECKING = 6
    EXTERNAL_ACCESS_OK = 7


class Attribute(OpenEnum):
    LOW_PERF = 0
    ENCRYPTED = 1
    CHECK_ERROR = 2


class PasswordUsage(OpenEnum):
    RECORD = 0
    USB = 1


class FormattingResult(OpenEnum):
    ERROR = 0
    DENIED = 1
    SUCCESS = 2


class PasswordResult(OpenEnum):
    WRONG_PASSWORD = 0
    SUCCESS = 1
    WRONG_USAGE = 2


class FormattingStep(OpenEnum):
    PARTITIONING = 0
    CLEARING_DATA = 1
    CREATING_FS = 2


@event("user_storage_v2.capabilities", 166, 0, 8)
class Capabilities(Message, frozen=True):
    storage_id: Annotated[int, U8]
    supported_features: Annotated[int, Bits(U16, Feature)]
    storage_type: Annotated[StorageType, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("user_storage_v2.supported_formatting_types", 166, 0, 9)
class SupportedFormattingTypes(Message, frozen=True):
    storage_id: Annotated[int, U8]
    supported_types: Annotated[int, Bits(U8, FormattingType)]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("user_storage_v2.info", 166, 0, 1)
class Info(Message, frozen=True):
    storage_id: Annotated[int, U8]
    name: Annotated[str, STRING]
    capacity: Annotated[int, U64]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("user_storage_v2.monitor", 166, 0, 2, Buffer.NON_ACK)
class Monitor(Message, frozen=True):
    storage_id: Annotated[int, U8]
    available_bytes: Annotated[int, U64]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("user_storage_v2.state", 166, 0, 3)
class State(Message, frozen=True):
    storage_id: Annotated[int, U8]
    physical_state: Annotated[PhyState, ENUM]
    file_system_state: Annotated[FsState, ENUM]
    attribute: Annotated[int, Bits(U8, Attribute)]
    monitor_enabled: Annotated[int, U8]
    monitor_period: Annotated[int, U8]
    fstype: Annotated[str, STRING]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("user_storage_v2.storage_uuid", 166, 0, 15)
class StorageUuid(Message, frozen=True):
    storage_id: Annotated[int, U8]
    uuid: Annotated[str, STRING]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@command("user_storage_v2.format", 166, 0, 4)
class Format(Message, frozen=True):
    storage_id: Annotated[int, U8]
    label: Annotated[str, STRING]


@command("user_storage_v2.format_with_type", 166, 0, 10)
class FormatWithType(Message, frozen=True):
    storage_id: Annotated[int, U8]
    label: Annotated[str, STRING]
    type: Annotated[FormattingType, ENUM]


@command("user_storage_v2.format_with_encryption", 166, 0, 13)
class FormatWithEncryption(Message, frozen=True):
    storage_id: Annotated[int, U8]
    label: Annotated[str, STRING]
    password: Annotated[str, STRING]
    type: Annotated[FormattingType, ENUM]


@command("user_storage_v2.start_monitoring", 166, 0, 5)
class StartMonitoring(Message, frozen=True):
    storage_id: Annotated[int, U8]
    period: Annotated[int, U8]


@command("user_storage_v2.stop_monitoring", 166, 0, 6)
class StopMonitoring(Message, frozen=True):
    storage_id: Annotated[int, U8]


@command("user_storage_v2.encryption_password", 166, 0, 12)
class EncryptionPassword(Message, frozen=True):
    storage_id: Annotated[int, U8]
    password: Annotated[str, STRING]
    type: Annotated[PasswordUsage, ENUM]


@event("user_storage_v2.format_result", 166, 0, 7)
class FormatResult(Message, frozen=True):
    storage_id: Annotated[int, U8]
    result: Annotated[FormattingResult, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("user_storage_v2.decryption", 166, 0, 14)
class Decryption(Message, frozen=True):
    storage_id: Annotated[int, U8]
    result: Annotated[PasswordResult, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("user_storage_v2.format_progress", 166, 0, 11)
class FormatProgress(Message, frozen=True):
    storage_id: Annotated[int, U8]
    step: Annotated[FormattingStep, ENUM]
    percentage: Annotated[int, U8]
    list_flags: Annotated[int, Bits(U8, ListFlags)]

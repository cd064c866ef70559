"""storage: internal storage and memory card, firmware 8.5 and later.

Older Ai have user_storage_v2.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, ENUM, RECORD, STRING, UINT32, UINT64, Field, Submessage, Wrapped
from anafi_mav.arsdk.codec.wire import OpenEnum

COMMAND = ProtobufEnvelope("arsdk.storage.Command", "storage.Command")
EVENT = ProtobufEnvelope("arsdk.storage.Event", "storage.Event")


class Attribute(OpenEnum):
    LOW_PERFORMANCE = 0
    ENCRYPTED = 1
    CHECK_ERROR = 2


class EncryptionType(OpenEnum):
    NONE = 0
    LEGACY = 1
    SECURE_STORAGE_V1 = 2


class ErasingType(OpenEnum):
    FULL = 0
    QUICK = 1


class Feature(OpenEnum):
    FORMAT_WHEN_READY_ALLOWED = 0
    FORMAT_RESULT_EVENT_SUPPORTED = 1
    FORMAT_PROGRESS_EVENT_SUPPORTED = 2
    ENCRYPTION_SUPPORTED = 3


class FileSystemState(OpenEnum):
    UNKNOWN = 0
    FORMAT_NEEDED = 1
    FORMATTING = 2
    READY = 3
    ERROR = 4
    PASSPHRASE_NEEDED = 5
    CHECKING = 6
    FORMAT_EXTERNAL_ACCESS_OK = 7


class FormattingStatus(OpenEnum):
    ERROR = 0
    DENIED = 1
    SUCCESS = 2


class FormattingStep(OpenEnum):
    PARTITIONING = 0
    CLEARING_DATA = 1
    CREATING_FILE_SYSTEM = 2


class PassphraseErrorCode(OpenEnum):
    OK = 0
    TOO_SHORT = 1
    UNSUPPORTED_CHARS = 2
    UNSUPPORTED_OPERATION = 3
    UNKNOWN = 4


class PhysicalState(OpenEnum):
    UNDETECTED = 0
    TOO_SMALL = 1
    TOO_SLOW = 2
    AVAILABLE = 3
    USB_MASS_STORAGE = 4


class StorageType(OpenEnum):
    INTERNAL = 0
    REMOVABLE = 1


class UnlockStatus(OpenEnum):
    RESULT_WRONG_PASSPHRASE = 0
    RESULT_SUCCESS = 1


class Storage(Submessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    type: Annotated[StorageType, Field(2, ENUM)] = StorageType.INTERNAL


class Capabilities(Submessage, frozen=True, kw_only=True):
    supported_features: Annotated[tuple[Feature, ...], Field(1, ENUM)] = ()
    supported_erasing_types: Annotated[tuple[ErasingType, ...], Field(2, ENUM)] = ()


class StorageInfo(Submessage, frozen=True, kw_only=True):
    name: Annotated[str, Field(1, STRING)] = ""
    capacity: Annotated[int, Field(2, UINT64)] = 0


class StorageState(Submessage, frozen=True, kw_only=True):
    physical_state: Annotated[PhysicalState, Field(1, ENUM)] = PhysicalState.UNDETECTED
    file_system_state: Annotated[FileSystemState, Field(2, ENUM)] = FileSystemState.UNKNOWN
    file_system_type: Annotated[str, Field(3, STRING)] = ""
    attributes: Annotated[tuple[Attribute, ...], Field(4, ENUM)] = ()
    is_monitoring_enabled: Annotated[bool, Field(5, BOOL)] = False
    monitoring_period: Annotated[int, Field(6, UINT32)] = 0
    encryption_state: Annotated[EncryptionState | None, Field(7, RECORD)] = None


class EncryptionState(Submessage, frozen=True, kw_only=True):
    encryption_type: Annotated[EncryptionType, Field(1, ENUM)] = EncryptionType.NONE
    is_locked: Annotated[bool, Field(2, BOOL)] = False
    has_passphrase: Annotated[bool, Field(3, BOOL)] = False
    can_add_passphrase: Annotated[bool, Field(4, BOOL)] = False
    can_change_passphrase: Annotated[bool, Field(5, BOOL)] = False
    can_remove_passphrase: Annotated[bool, Field(6, BOOL)] = False


class StorageUUID(Submessage, frozen=True, kw_only=True):
    uuid: Annotated[str, Field(1, STRING)] = ""


@COMMAND.message("ListStorages", 16)
class ListStorages(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("GetState", 17)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    include_default_capabilities: Annotated[bool, Field(2, BOOL)] = False


@COMMAND.message("Format", 18)
class Format(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    label: Annotated[str, Field(2, STRING)] = ""
    type: Annotated[ErasingType, Field(3, ENUM)] = ErasingType.FULL
    passphrase: Annotated[str | None, Wrapped(4, STRING)] = None
    encryption: Annotated[bool, Field(5, BOOL)] = False


@COMMAND.message("StartMonitoring", 19)
class StartMonitoring(ProtobufMessage, frozen=True, kw_only=True):
    """Seconds between two `Monitor`, 0 for one."""

    id: Annotated[int, Field(1, UINT32)] = 0
    period: Annotated[int, Field(2, UINT32)] = 0


@COMMAND.message("StopMonitoring", 20)
class StopMonitoring(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0


@COMMAND.message("Unlock", 21)
class Unlock(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    passphrase: Annotated[str, Field(2, STRING)] = ""


@COMMAND.message("SetPassphrase", 22)
class SetPassphrase(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    new_passphrase: Annotated[str, Field(2, STRING)] = ""
    current_passphrase: Annotated[str, Field(3, STRING)] = ""


@EVENT.message("Monitor", 1)
class Monitor(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    available_space: Annotated[int, Field(3, UINT64)] = 0


@EVENT.message("StorageList", 16)
class StorageList(ProtobufMessage, frozen=True, kw_only=True):
    storages: Annotated[tuple[Storage, ...], Field(1, RECORD)] = ()


@EVENT.message("State", 17)
class State(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    default_capabilities: Annotated[Capabilities | None, Field(2, RECORD)] = None
    storage_info: Annotated[StorageInfo | None, Field(3, RECORD)] = None
    storage_state: Annotated[StorageState | None, Field(4, RECORD)] = None
    storage_uuid: Annotated[StorageUUID | None, Field(5, RECORD)] = None


@EVENT.message("FormattingProgress", 18)
class FormattingProgress(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    step: Annotated[FormattingStep, Field(2, ENUM)] = FormattingStep.PARTITIONING
    percentage: Annotated[int, Field(3, UINT32)] = 0


@EVENT.message("FormattingResult", 19)
class FormattingResult(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    status: Annotated[FormattingStatus, Field(2, ENUM)] = FormattingStatus.ERROR


@EVENT.message("UnlockResult", 20)
class UnlockResult(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    status: Annotated[UnlockStatus, Field(2, ENUM)] = UnlockStatus.RESULT_WRONG_PASSPHRASE


@EVENT.message("PassphraseResult", 21)
class PassphraseResult(ProtobufMessage, frozen=True, kw_only=True):
    id: Annotated[int, Field(1, UINT32)] = 0
    error: Annotated[PassphraseErrorCode, Field(2, ENUM)] = PassphraseErrorCode.OK

"""Feature 145, user_storage: the memory card of 4K, Thermal and USA."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, STRING, U8, U16, U64, Bits, Buffer, Message, OpenEnum, command, event


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


class FormattingResult(OpenEnum):
    ERROR = 0
    DENIED = 1
    SUCCESS = 2


class PasswordResult(OpenEnum):
    WRONG_PASSWORD = 0
    SUCCESS = 1
    WRONG_USAGE = 2


class Feature(OpenEnum):
    FORMAT_WHEN_READY_ALLOWED = 0
    FORMAT_RESULT_EVT_SUPPORTED = 1
    FORMAT_PROGRESS_EVT_SUPPORTED = 2
    ENCRYPTION_SUPPORTED = 3


class FormattingType(OpenEnum):
    FULL = 0
    QUICK = 1


class FormattingStep(OpenEnum):
    PARTITIONING = 0
    CLEARING_DATA = 1
    CREATING_FS = 2


class PasswordUsage(OpenEnum):
    RECORD = 0
    USB = 1


@event("user_storage.capabilities", 145, 0, 8)
class Capabilities(Message, frozen=True):
    supported_features: Annotated[int, Bits(U16, Feature)]


@event("user_storage.supported_formatting_types", 145, 0, 9)
class SupportedFormattingTypes(Message, frozen=True):
    supported_types: Annotated[int, Bits(U8, FormattingType)]


@event("user_storage.info", 145, 0, 1)
class Info(Message, frozen=True):
    name: Annotated[str, STRING]
    capacity: Annotated[int, U64]


@event("user_storage.monitor", 145, 0, 2, Buffer.NON_ACK)
class Monitor(Message, frozen=True):
    available_bytes: Annotated[int, U64]


@event("user_storage.state", 145, 0, 3)
class State(Message, frozen=True):
    physical_state: Annotated[PhyState, ENUM]
    file_system_state: Annotated[FsState, ENUM]
    attribute: Annotated[int, Bits(U8, Attribute)]
    monitor_enabled: Annotated[int, U8]
    monitor_period: Annotated[int, U8]


@event("user_storage.sdcard_uuid", 145, 0, 15)
class SdcardUuid(Message, frozen=True):
    uuid: Annotated[str, STRING]


@command("user_storage.format", 145, 0, 4)
class Format(Message, frozen=True):
    label: Annotated[str, STRING]


@command("user_storage.format_with_type", 145, 0, 10)
class FormatWithType(Message, frozen=True):
    label: Annotated[str, STRING]
    type: Annotated[FormattingType, ENUM]


@command("user_storage.format_with_encryption", 145, 0, 13)
class FormatWithEncryption(Message, frozen=True):
    label: Annotated[str, STRING]
    password: Annotated[str, STRING]
    type: Annotated[FormattingType, ENUM]


@command("user_storage.start_monitoring", 145, 0, 5)
class StartMonitoring(Message, frozen=True):
    period: Annotated[int, U8]


@command("user_storage.stop_monitoring", 145, 0, 6)
class StopMonitoring(Message, frozen=True):
    pass


@command("user_storage.encryption_password", 145, 0, 12)
class EncryptionPassword(Message, frozen=True):
    password: Annotated[str, STRING]
    type: Annotated[PasswordUsage, ENUM]


@event("user_storage.format_result", 145, 0, 7)
class FormatResult(Message, frozen=True):
    result: Annotated[FormattingResult, ENUM]


@event("user_storage.decryption", 145, 0, 14)
class Decryption(Message, frozen=True):
    result: Annotated[PasswordResult, ENUM]


@event("user_storage.format_progress", 145, 0, 11)
class FormatProgress(Message, frozen=True):
    step: Annotated[FormattingStep, ENUM]
    percentage: Annotated[int, U8]

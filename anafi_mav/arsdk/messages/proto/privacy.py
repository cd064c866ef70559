"""privacy: log storage of the Ai and pairing permissions."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, ENUM, RECORD, STRING, Field, Submessage
from anafi_mav.arsdk.codec.wire import OpenEnum

COMMAND = ProtobufEnvelope("arsdk.privacy.Command", "privacy.Command")
EVENT = ProtobufEnvelope("arsdk.privacy.Event", "privacy.Event")


class Authorization(OpenEnum):
    NEVER = 0
    ALWAYS = 1
    ONCE = 2


class LogConfigPersistence(OpenEnum):
    PERSISTENT = 0
    ONESHOT = 1


class LogStorage(OpenEnum):
    PERSISTENT = 0
    VOLATILE = 1
    NONE = 2


class Capabilities(Submessage, frozen=True, kw_only=True):
    supported_log_storage: Annotated[tuple[LogStorage, ...], Field(1, ENUM)] = ()
    supported_log_config_persistence: Annotated[tuple[LogConfigPersistence, ...], Field(2, ENUM)] = ()
    supported_authorizations: Annotated[tuple[Authorization, ...], Field(3, ENUM)] = ()


class LogEncryption(Submessage, frozen=True, kw_only=True):
    enabled: Annotated[bool, Field(1, BOOL)] = False


class PairingAuthorization(Submessage, frozen=True, kw_only=True):
    value: Annotated[Authorization, Field(1, ENUM)] = Authorization.NEVER


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    include_default_capabilities: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("SetLogMode", 17)
class SetLogMode(ProtobufMessage, frozen=True, kw_only=True):
    log_storage: Annotated[LogStorage, Field(1, ENUM)] = LogStorage.PERSISTENT
    log_config_persistence: Annotated[LogConfigPersistence, Field(2, ENUM)] = LogConfigPersistence.PERSISTENT


@COMMAND.message("EnableLogEncryption", 18)
class EnableLogEncryption(ProtobufMessage, frozen=True, kw_only=True):
    public_key: Annotated[str, Field(1, STRING)] = ""


@COMMAND.message("DisableLogEncryption", 19)
class DisableLogEncryption(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("AuthorizePairing", 20)
class AuthorizePairing(ProtobufMessage, frozen=True, kw_only=True):
    value: Annotated[Authorization, Field(1, ENUM)] = Authorization.NEVER


@EVENT.message("State", 16)
class State(ProtobufMessage, frozen=True, kw_only=True):
    default_capabilities: Annotated[Capabilities | None, Field(1, RECORD)] = None
    log_storage: Annotated[LogStorage, Field(2, ENUM)] = LogStorage.PERSISTENT
    log_config_persistence: Annotated[LogConfigPersistence, Field(3, ENUM)] = LogConfigPersistence.PERSISTENT
    log_encryption: Annotated[LogEncryption | None, Field(4, RECORD)] = None
    pairing_authorization: Annotated[PairingAuthorization | None, Field(5, RECORD)] = None

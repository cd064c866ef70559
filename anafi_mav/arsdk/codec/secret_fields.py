"""Passwords and keys in messages, which no log and no recording may hold. No I/O.

A drone reports its Wi-Fi password at each connection (wifi.xml security_changed). The names of the fields are
Parrot's; a test looks for others that read like a secret.
"""

from __future__ import annotations

import functools
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

StructT = TypeVar("StructT", bound=msgspec.Struct)

SECRETS = frozenset({"key", "password", "passphrase", "new_passphrase", "current_passphrase", "security_key"})
"""Names of text fields that hold a secret."""

HIDDEN = "***"


def without_secrets(message: StructT) -> StructT:
    """Return the message with `HIDDEN` in place of each secret.

    It is the same object where it holds none.
    """
    if not may_hold_secret(type(message)):
        return message
    changes: dict[str, Any] = {}
    for name in message.__struct_fields__:
        value = getattr(message, name)
        if name in SECRETS and isinstance(value, str):
            changes[name] = HIDDEN
        elif isinstance(value, msgspec.Struct):
            changes[name] = without_secrets(value)
        elif isinstance(value, tuple):
            changes[name] = tuple(without_secrets(one) if isinstance(one, msgspec.Struct) else one for one in value)
    return msgspec.structs.replace(message, **changes)


@functools.cache
def may_hold_secret(kind: type[msgspec.Struct]) -> bool:
    """Return True for a kind of message with a secret in it or in one of its parts."""
    return bool(SECRETS.intersection(kind.__struct_fields__)) or any(map(may_hold_secret, parts_of(kind)))


def parts_of(kind: type[msgspec.Struct]) -> set[type[msgspec.Struct]]:
    """Return the kinds of records that a message has as fields."""
    found: set[type[msgspec.Struct]] = set()
    waiting: list[Any] = list(get_type_hints(kind).values())
    while waiting:
        hint = waiting.pop()
        if isinstance(hint, type) and issubclass(hint, msgspec.Struct) and hint is not kind:
            found.add(hint)
        waiting += get_args(hint)
    return found

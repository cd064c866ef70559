"""No field that reads like a secret is missing from the list, and what is listed is hidden."""

from __future__ import annotations

import importlib
import pkgutil
import re

import msgspec

from anafi_mav.arsdk import messages
from anafi_mav.arsdk.codec.secret_fields import HIDDEN, SECRETS, may_hold_secret, without_secrets
from anafi_mav.arsdk.messages import wifi
from anafi_mav.arsdk.messages.ardrone3 import AttitudeChanged
from anafi_mav.arsdk.messages.proto import connectivity

SUSPICIOUS = re.compile(r"key|pass|secret|credential|token")
HARMLESS = {"public_key", "key_type"}
"""A key for everybody; a kind of key. Flags (has_passphrase, saved_key) are no text."""


def structs() -> set[type[msgspec.Struct]]:
    found = set()
    for info in pkgutil.walk_packages(messages.__path__, "anafi_mav.arsdk.messages."):
        for value in vars(importlib.import_module(info.name)).values():
            if isinstance(value, type) and issubclass(value, msgspec.Struct):
                found.add(value)
    return found


def test_text_field_that_reads_like_a_secret_is_listed() -> None:
    found = set()
    for kind in structs():
        for name, hint in kind.__annotations__.items():
            if SUSPICIOUS.search(name) and re.search(r"\bstr\b|\bbytes\b", str(hint)):
                found.add(name)
    assert found - HARMLESS == SECRETS


def test_wifi_password_is_hidden_and_the_rest_stays() -> None:
    message = wifi.SecurityChanged(wifi.SecurityType.WPA2, "my password", wifi.SecurityKeyType.PLAIN)
    assert without_secrets(message) == wifi.SecurityChanged(message.type, HIDDEN, message.key_type)


def test_passphrase_in_a_part_is_hidden() -> None:
    part = connectivity.NetworkSecurityMode(passphrase="my password")
    holders = [kind for kind in structs() if may_hold_secret(kind) and "security" in kind.__struct_fields__]
    assert holders
    for kind in holders:
        assert without_secrets(kind(security=part)).security.passphrase == HIDDEN


def test_message_without_a_secret_is_the_same_object() -> None:
    message = AttitudeChanged(0.1, 0.2, 0.3)
    assert without_secrets(message) is message

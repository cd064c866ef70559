"""`anafi-mav keygen`: makes, shows and restores the keys of signed endpoints.

A secret is read from the terminal or from stdin, never from the command line, which other users of the computer can
read; it is printed only with `--show`.
"""

from __future__ import annotations

import argparse
import getpass
import secrets
import sys
import time
from pathlib import Path

from anafi_mav.cli import interrupts
from anafi_mav.cli.terminal import complain, say
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.key_ring import (
    NAME,
    NAME_EXPECTED,
    OLD_SUFFIX,
    folder_of,
    path_of,
    read_key,
    write_key,
    write_new_key,
)
from anafi_mav.mavlink.signing import (
    CONTENT_BYTES,
    KEY_BYTES,
    Signing,
    key_of_passphrase,
    qgroundcontrol_key_of_passphrase,
)
from anafi_mav.state_lock import read_holder, state_folder

SHORTEST, LONG_ENOUGH = 8, 20
"""Characters of a passphrase: QGroundControl's own limit, and a length that is not found by trying. A recorded frame is
enough to try passphrases against."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `anafi-mav keygen`."""
    parser.add_argument("name", metavar="NAME", help="name of the key, as an endpoint has it in `signing`")
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--passphrase", action="store_true", help="make the key of a passphrase, asked for or on stdin")
    source.add_argument("--hex", action="store_true", help="take a key of 64 hexadecimal digits, asked for or on stdin")
    source.add_argument("--show", action="store_true", help="print the key in hexadecimal digits and change nothing")
    source.add_argument("--undo", action="store_true", help="return to the key before this one; twice: back again")
    parser.add_argument(
        "--station",
        choices=("mavproxy", "qgroundcontrol"),
        default="mavproxy",
        help="program whose way from a passphrase to a key is followed; mavproxy: Mission Planner's and that of "
        "QGroundControl up to 5.0, too",
    )
    parser.add_argument("--replace", action="store_true", help="replace a key that exists; --undo returns to it")
    parser.add_argument("--state", metavar="FOLDER", help="state folder of the gateway, as in its configuration")


def run(arguments: argparse.Namespace) -> int:
    """Raises `ConfigError`."""
    interrupts.raise_on_interrupt()  # a terminal that hides what is typed has to show it again
    interrupts.raise_on_termination()
    name: str = arguments.name
    if NAME.fullmatch(name) is None:
        raise ConfigError("NAME", f"expected {NAME_EXPECTED}, got {name!r}")
    state = state_folder(arguments.state)
    if state is None:
        raise ConfigError("--state", "expected a folder: this user has no home")
    folder = folder_of(state)
    try:
        present = read_key(folder, name)
        if arguments.show:
            say(_signing(folder, name, present).content()[:KEY_BYTES].hex())
            return 0
        if present is not None and (holder := read_holder(state)) is not None:
            problem = f"{holder.title} has this key in use and writes its file; end it first"
            raise ConfigError("NAME", problem)
        if arguments.undo:
            _undo(folder, name, _signing(folder, name, present))
        else:
            _make(folder, name, present, arguments)
    except OSError as error:
        raise ConfigError("--state", f"{folder}: {error.strerror}") from error
    return 0


def _signing(folder: Path, name: str, content: bytes | None) -> Signing:
    if content is None:
        raise ConfigError("NAME", f"no key {name} in {folder}")
    return Signing(name, content)


def _make(folder: Path, name: str, present: bytes | None, arguments: argparse.Namespace) -> None:
    old = Signing(name, present or bytes(CONTENT_BYTES))
    if old.is_on and not arguments.replace:
        problem = f"{path_of(folder, name)} exists; --replace makes another key, and --undo then returns to this one"
        raise ConfigError("NAME", problem)
    # A key that a person chose may have been used before: what was recorded then is too old. A random one is new: it
    # begins at the clock, even where a station with a wrong clock has moved the old one's timestamp far ahead.
    is_chosen = arguments.hex or arguments.passphrase
    new = Signing(name, old.content() if is_chosen else bytes(CONTENT_BYTES))
    new.replace(_secret(arguments))
    new.advance(time.time())
    if present is None:
        write_key(folder, name, new.content())
    else:
        write_new_key(folder, name, new.content(), old.content())
    say(f"key {name}: {path_of(folder, name)}")
    say(f"endpoint: udpin://0.0.0.0:14550?signing={name}")
    if not arguments.passphrase:
        say(f"QGroundControl: add the key by its hexadecimal digits; anafi-mav keygen {name} --show prints them")
        say("MAVProxy and Mission Planner accept a passphrase only: make the key with --passphrase")
    elif arguments.station == "qgroundcontrol":
        say("QGroundControl: add the key by the passphrase")
        say("MAVProxy and Mission Planner make another key of this passphrase: use --station mavproxy")
    else:
        say("MAVProxy: signing key PASSPHRASE")
        say("Mission Planner, QGroundControl up to 5.0: type the passphrase")
        say(f"newer QGroundControl: add the key by its hexadecimal digits; anafi-mav keygen {name} --show prints them")


def _undo(folder: Path, name: str, present: Signing) -> None:
    content = read_key(folder, name, OLD_SUFFIX)
    if content is None:
        raise ConfigError("NAME", f"no key before {name} in {folder}")
    old = Signing(name, content)
    latest = max(old.timestamp, present.timestamp)
    write_new_key(folder, name, old.content(latest), present.content(latest))
    say(f"key {name}: {'the key before is in use' if old.is_on else 'signing is off'} from the next start")


def _secret(arguments: argparse.Namespace) -> bytes:
    if arguments.hex:
        try:
            secret = bytes.fromhex(_ask("key, 64 hexadecimal digits"))
        except ValueError:
            secret = b""
        if len(secret) != KEY_BYTES or not any(secret):  # never with what was typed
            raise ConfigError("--hex", "expected 64 hexadecimal digits that are not all 0")
        return secret
    if not arguments.passphrase:
        return secrets.token_bytes(KEY_BYTES)
    passphrase = _ask("passphrase")
    if len(passphrase) < SHORTEST or not passphrase.isascii() or not passphrase.isprintable() or " " in passphrase:
        raise ConfigError("--passphrase", f"expected at least {SHORTEST} ASCII characters without a space")
    if len(passphrase) < LONG_ENOUGH:
        complain(f"warning: a passphrase of less than {LONG_ENOUGH} characters can be found by trying", "yellow")
    return (qgroundcontrol_key_of_passphrase if arguments.station == "qgroundcontrol" else key_of_passphrase)(
        passphrase
    )


def _ask(what: str) -> str:
    try:
        if not sys.stdin.isatty():
            return sys.stdin.readline().strip()
        typed = getpass.getpass(f"{what}: ").strip()
        again = getpass.getpass("the same again: ").strip()
    except (EOFError, UnicodeError):
        raise ConfigError(
            "NAME", f"expected the {what.partition(',')[0]} as a line of text; nothing was changed"
        ) from None
    if again != typed:
        raise ConfigError("NAME", "the two inputs differ; nothing was changed")
    return typed

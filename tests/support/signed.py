"""Signing in tests: keys, their files, and SETUP_SIGNING."""

from __future__ import annotations

import os
import time
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav.mavlink.key_ring import folder_of, write_key
from anafi_mav.mavlink.signing import TICKS, ticks

SECRET = bytes(range(100, 132))
OTHER = bytes(range(200, 232))


def keys() -> Path:
    """The folder of the keys in the test's state folder."""
    return folder_of(Path(os.environ["XDG_STATE_HOME"]) / "anafi-mav")


def make_key(name: str, secret: bytes = SECRET) -> None:
    """A key file as `anafi-mav keygen` makes it, a minute ago."""
    write_key(keys(), name, secret + (ticks(time.time()) - 60 * TICKS).to_bytes(8, "little"))


def setup_signing(secret: bytes, *, system: int = 1, timestamp: int | None = None) -> dialect.MAVLink_message:
    """SETUP_SIGNING as QGroundControl sends it."""
    stamp = (ticks(time.time()) if timestamp is None else timestamp) if any(secret) else 0
    return dialect.MAVLink_setup_signing_message(system, 1, list(secret), stamp)

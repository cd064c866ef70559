"""The token of web and video server that are open to the network: a random text in a file.

It stands in `web.token` of the state folder, readable by its owner only, so that a bookmark, the URL in a player or the
configuration of a Prometheus server survives a restart of the gateway. To withdraw it, delete the file and restart.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import os
import re
import secrets
import stat
from pathlib import Path

from anafi_mav.documents import open_file

logger = logging.getLogger(__name__)

FILE = "web.token"

VARIABLE = "ANAFI_MAV_TOKEN"
"""Variable of the environment with the token of another gateway: arguments are readable by all users of a computer."""

MAX_BYTES = 256
"""Of the file: more is no token."""

BYTES = 32
"""Of randomness: it cannot be guessed over a network."""

_VALID = re.compile(r"[A-Za-z0-9_-]{32,128}")


class AccessToken:
    """A secret that requests are compared with. It has no text of its own for logs."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return "<AccessToken>"

    def equals(self, given: str) -> bool:
        """Compare in a time that does not depend on the text."""
        return hmac.compare_digest(self.text.encode(), given.encode(errors="replace"))

    def is_in(self, cookie: str | None, authorization: str | None) -> bool:
        """True when the cookie or the Authorization header of a request has it."""
        if cookie is not None and self.equals(cookie):
            return True
        scheme, _, given = (authorization or "").partition(" ")
        return scheme.lower() == "bearer" and self.equals(given.strip())


def read_token(folder: Path | None) -> AccessToken | None:
    """Return the token of a state folder; None where there is none that this user may read."""
    if folder is None:
        return None
    try:
        with open_file(folder / FILE) as file:
            text = file.read(MAX_BYTES).decode("ascii").strip()
    except (OSError, ValueError):
        return None
    return AccessToken(text) if _VALID.fullmatch(text) else None


def load_token(folder: Path | None) -> AccessToken:
    """Return the token of a state folder, made and stored where there is none.

    One that other users could read is replaced.
    """
    found = read_token(folder)
    if found is not None and folder is not None and _is_readable_by_others(folder / FILE):
        logger.warning("%s: other users could read it: another token replaces it", folder / FILE)
        found = None
    if found is not None:
        return found
    made = AccessToken(secrets.token_urlsafe(BYTES))
    if folder is not None:
        try:
            _store(folder / FILE, made.text)
        except OSError as error:
            logger.warning("%s: %s: the token of web and video ends with the gateway", folder, error.strerror)
    return made


def _is_readable_by_others(path: Path) -> bool:
    """Windows has no such permissions; there the folder is the user's own."""
    return os.name == "posix" and bool(path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO))


def _store(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(FileNotFoundError):
        path.unlink()  # one that is not valid, perhaps with other permissions
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(file, "w", encoding="ascii") as stream:
        stream.write(text + "\n")

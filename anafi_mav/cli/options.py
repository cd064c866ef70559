"""Numbers of the command line; each mistake is reported in one line that names the option."""

from __future__ import annotations

import math

from anafi_mav.errors import ConfigError

SLOWEST, FASTEST = 0.1, 20.0
"""Simulated seconds per second that a world is let run at."""


ADDRESS = "an IPv4 address or a host name, like 192.168.42.1"
"""Expected address of a drone."""

_UNITS = {"k": 1000, "M": 1000**2, "G": 1000**3}


def integer(flag: str, text: str, wanted: str) -> int:
    """Raises `ConfigError`."""
    try:
        return int(text)
    except ValueError:
        raise ConfigError(flag, f"expected {wanted}, got {text!r}") from None


def number(flag: str, text: str, wanted: str) -> float:
    """A finite number. Raises `ConfigError`."""
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ConfigError(flag, f"expected {wanted}, got {text!r}")
    return found


def host(flag: str, text: str, wanted: str) -> str:
    """Return an address or name that a name server can be asked for. Raises `ConfigError`."""
    try:
        known = bool(text.encode("idna"))  # as `socket.getaddrinfo`, whose UnicodeError is no OSError
    except UnicodeError:
        known = False
    if not known:
        raise ConfigError(flag, f"expected {wanted}, got {text!r}")
    return text


def size(flag: str, text: str) -> int:
    """Bytes, with k, M or G behind for a thousand, a million or a billion of them.

    Raises `ConfigError`.
    """
    factor = _UNITS.get(text[-1:], 1)
    return integer(flag, text if factor == 1 else text[:-1], "a number of bytes like 500k or 16G") * factor


def speed(text: str) -> float:
    """Simulated seconds per second. Raises `ConfigError`."""
    wanted = f"a number from {SLOWEST:g} to {FASTEST:g}"
    found = number("--speed", text, wanted)
    if not SLOWEST <= found <= FASTEST:
        raise ConfigError("--speed", f"expected {wanted}, got {text}")
    return found

"""Keys of the fabric: of frames, states and liveliness tokens. No I/O.

docs/fabric.md has the layout. Keys of the liveliness tokens hold its version, so that programs with another layout do
not meet.
"""

from __future__ import annotations

import re
from enum import Enum
from typing import NamedTuple

LAYOUT = "v1"
"""Version of the layout, of the envelope and of the times in it."""

SESSION_BYTES = 8


class KeyKind(Enum):
    """Kind of a key. The values are in the keys."""

    DOWN = "down"
    """Frames of a system: to all, or to one station."""
    UP = "up"
    """Frames of one station to a system."""
    PING = "ping"
    PONG = "pong"
    STATE = "state"
    GATEWAY = "gateway"
    DRONE = "drone"
    STATION = "station"


class FabricKey(NamedTuple):
    """A key taken apart."""

    kind: KeyKind
    sysid: int = 0
    """0 for tokens of gateways and stations."""
    owner: str = ""
    """A station; of the token of a gateway or a drone the session of the gateway."""


_SESSION = r"[0-9a-f]{16}"
_STATION = rf"{_SESSION}-[0-9]{{1,6}}"
_SYSID = r"(?P<sysid>[1-9][0-9]{0,2})"
_FORMS = {
    KeyKind.DOWN: re.compile(rf"{_SYSID}/down(?:/(?P<owner>{_STATION}))?"),
    KeyKind.UP: re.compile(rf"{_SYSID}/up/(?P<owner>{_STATION})"),
    KeyKind.PING: re.compile(rf"{_SYSID}/down/(?P<owner>{_STATION})/ping"),
    KeyKind.PONG: re.compile(rf"{_SYSID}/up/(?P<owner>{_STATION})/pong"),
    KeyKind.STATE: re.compile(rf"{_SYSID}/state"),
    KeyKind.GATEWAY: re.compile(rf"gateway/{LAYOUT}/(?P<owner>{_SESSION})"),
    KeyKind.DRONE: re.compile(rf"{_SYSID}/drone/{LAYOUT}/(?P<owner>{_SESSION})"),
    KeyKind.STATION: re.compile(rf"station/{LAYOUT}/(?P<owner>{_STATION})"),
}


def session_text(session: int) -> str:
    """Return a session id as it is in keys."""
    return f"{session:016x}"


def station_id(session: int, number: int) -> str:
    """Return the id of a station: of the session of its ground process and its number there."""
    return f"{session_text(session)}-{number}"


def session_of(owner: str) -> int:
    """Return the session id in the id of a station, or of a gateway."""
    return int(owner.partition("-")[0], 16)


class FabricKeys:
    """The keys of one prefix. `*` in the place of an id makes an expression for all of them."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.everything = f"{prefix}/**"
        """Expression of all keys."""

    def down(self, sysid: int | str, station: str | None = None) -> str:
        """Return the key of a system's frames: to one station, or to all."""
        key = f"{self.prefix}/{sysid}/down"
        return key if station is None else f"{key}/{station}"

    def up(self, sysid: int | str, station: str) -> str:
        """Return the key of a station's frames to a system."""
        return f"{self.prefix}/{sysid}/up/{station}"

    def ping(self, sysid: int | str, station: str) -> str:
        """Return the key of the gateway's pings to a station."""
        return f"{self.prefix}/{sysid}/down/{station}/ping"

    def pong(self, sysid: int | str, station: str) -> str:
        """Return the key of a station's answers to pings."""
        return f"{self.prefix}/{sysid}/up/{station}/pong"

    def state(self, sysid: int | str) -> str:
        """Return the key of a system's state."""
        return f"{self.prefix}/{sysid}/state"

    def gateway_token(self, session: str) -> str:
        """Return the key of a gateway's liveliness token."""
        return f"{self.prefix}/gateway/{LAYOUT}/{session}"

    def drone_token(self, sysid: int | str, session: str) -> str:
        """Return the key of the liveliness token by which a gateway holds a system id."""
        return f"{self.prefix}/{sysid}/drone/{LAYOUT}/{session}"

    def station_token(self, station: str) -> str:
        """Return the key of a station's liveliness token."""
        return f"{self.prefix}/station/{LAYOUT}/{station}"

    def parse(self, key: str) -> FabricKey | None:
        """Return the parts of a key; None for one of another prefix or layout."""
        if not key.startswith(f"{self.prefix}/"):
            return None
        rest = key[len(self.prefix) + 1 :]
        for kind, form in _FORMS.items():
            if (found := form.fullmatch(rest)) is not None:
                parts = found.groupdict()
                sysid = int(parts.get("sysid") or 0)
                return FabricKey(kind, sysid, parts.get("owner") or "") if sysid <= 255 else None
        return None

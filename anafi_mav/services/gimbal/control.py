"""Control of the gimbal: the client that has it, how it is taken and how it ends. No I/O.

While no client has control, every client moves the gimbal. MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE takes it, also from
another client, and releases it. It ends by itself when the owner's heartbeats stop. A mission that is flown and needs
the gimbal has it before every client (MAVLink gimbal_v2.md; conformance C7).

Clients are known by their system and component, as in GIMBAL_MANAGER_STATUS: several channels of one station are one
client.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Collection, Sequence
from typing import TypeAlias

from anafi_mav.clock import NEVER

ClientId: TypeAlias = tuple[int, int]
"""MAVLink system and component."""

NO_CLIENT: ClientId = (0, 0)

OWNER_SILENCE = 5.0
"""s without heartbeats of a client after which it has control no longer. They are sent once a second."""

MAX_CLIENTS = 64
"""Clients whose heartbeats are remembered; there are a handful, and an address is easily made up."""

_UNCHANGED, _SENDER, _REMOVED = -1, -2, -3
"""Ids of DO_GIMBAL_MANAGER_CONFIGURE that are no ids (MAVLink common.xml)."""


class State(enum.Enum):
    FREE = "no client has control: every client moves the gimbal"
    CLIENT = "a client has control"
    MISSION = "the mission that is flown has control"


class Event(enum.Enum):
    TAKE = "a client takes control"
    RELEASE = "the primary client releases control, or is removed"
    SILENCE = "the primary client's heartbeats have stopped"
    MISSION_BEGINS = "the mission that is flown needs the gimbal from now on"
    MISSION_ENDS = "it needs it no longer, or is paused"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.FREE: {Event.TAKE: State.CLIENT, Event.MISSION_BEGINS: State.MISSION},
    State.CLIENT: {
        Event.TAKE: State.CLIENT,
        Event.RELEASE: State.FREE,
        Event.SILENCE: State.FREE,
        Event.MISSION_BEGINS: State.MISSION,
    },
    State.MISSION: {Event.MISSION_ENDS: State.FREE},
}
"""A missing pair cannot occur: what is free is not released, and a client takes nothing from a mission."""


class Answer(enum.Enum):
    """Answer to DO_GIMBAL_MANAGER_CONFIGURE."""

    DONE = "in force"
    MISSION = "the mission has control"
    INVALID = "not ids of a client"
    NO_PRIMARY = "secondary control without a primary client"


class Heartbeats:
    """When each client was last heard."""

    def __init__(self) -> None:
        self._heard: dict[ClientId, float] = {}

    def receive(self, client: ClientId, now: float, kept: Collection[ClientId | None] = ()) -> None:
        """Note a heartbeat of a client; those in `kept` are never forgotten for it."""
        self._heard.pop(client, None)
        self._heard[client] = now
        if len(self._heard) > MAX_CLIENTS:
            oldest = next((one for one in self._heard if one not in kept), client)
            del self._heard[oldest]

    def last(self, client: ClientId) -> float | None:
        """Return when a client was last heard; None if it has sent none."""
        return self._heard.get(client)

    def add_stall(self, seconds: float) -> None:
        """Leave out a time in which the host could not receive heartbeats."""
        self._heard = {client: at + seconds for client, at in self._heard.items()}


class GimbalControl:
    """Primary and secondary control of one gimbal. Both clients move it."""

    def __init__(self, heartbeats: Heartbeats) -> None:
        self.state = State.FREE
        self.primary = NO_CLIENT
        self.secondary = NO_CLIENT
        self._heartbeats = heartbeats
        self._since: dict[ClientId, float] = {}
        """When each of the two took control."""

    @property
    def is_of_mission(self) -> bool:
        """True while the mission that is flown has control."""
        return self.state is State.MISSION

    def allows(self, client: ClientId) -> bool:
        """Return True when this client may move the gimbal; `NO_CLIENT` never may."""
        if client == NO_CLIENT:
            return False
        if self.state is State.CLIENT:
            return client in (self.primary, self.secondary)
        return self.state is State.FREE

    def configure(self, client: ClientId, ids: Sequence[float], now: float) -> Answer:
        """Take, release or hand on control: system, component of primary and secondary client.

        -1 and NaN leave one unchanged, -2 is the sender, -3 removes the sender, 0 removes any. Secondary control
        exists beside primary control only: without a primary client every client moves the gimbal.
        """
        if client == NO_CLIENT:
            return Answer.INVALID
        if self.state is State.MISSION:
            return Answer.MISSION
        primary = _named(ids[:2], client, self.primary)
        secondary = _named(ids[2:4], client, self.secondary)
        if primary is None or secondary is None:
            return Answer.INVALID
        if primary not in (self.primary, NO_CLIENT) and secondary == self.primary:
            secondary = NO_CLIENT  # MAVSDK takes both; whom another client replaces moves nothing any longer
        if primary == NO_CLIENT:
            if secondary not in (self.secondary, NO_CLIENT):
                return Answer.NO_PRIMARY
            secondary = NO_CLIENT
        for taken in {primary, secondary} - {self.primary, self.secondary, NO_CLIENT}:
            self._since[taken] = now
        if client in (primary, secondary):
            self._since[client] = now
        if primary != NO_CLIENT:
            self._enter(Event.TAKE, primary, secondary)
        elif self.state is State.CLIENT:
            self._enter(Event.RELEASE, NO_CLIENT, NO_CLIENT)
        return Answer.DONE

    def mission(self, *, needs_gimbal: bool) -> bool:
        """Note whether the mission that is flown needs the gimbal; True when that changes control."""
        if needs_gimbal and self.state is not State.MISSION:
            self._enter(Event.MISSION_BEGINS, NO_CLIENT, NO_CLIENT)
            return True
        if not needs_gimbal and self.state is State.MISSION:
            self._enter(Event.MISSION_ENDS, NO_CLIENT, NO_CLIENT)
            return True
        return False

    def expire(self, now: float) -> ClientId | None:
        """End the control of a client whose heartbeats have stopped; return that client."""
        if self.state is not State.CLIENT:
            return None
        if self._is_silent(self.primary, now):
            silent = self.primary
            self._enter(Event.SILENCE, NO_CLIENT, NO_CLIENT)
            return silent
        if self.secondary != NO_CLIENT and self._is_silent(self.secondary, now):
            silent, self.secondary = self.secondary, NO_CLIENT
            return silent
        return None

    @property
    def expires_at(self) -> float:
        """When the control of a client ends without further heartbeats (s), or `NEVER`."""
        if self.state is not State.CLIENT:
            return NEVER
        return min(self._silent_at(client) for client in (self.primary, self.secondary) if client != NO_CLIENT)

    def add_stall(self, seconds: float) -> None:
        """Leave out a time in which the host could not receive heartbeats."""
        self._since = {client: at + seconds for client, at in self._since.items()}

    def _is_silent(self, client: ClientId, now: float) -> bool:
        return now >= self._silent_at(client)

    def _silent_at(self, client: ClientId) -> float:
        last = self._heartbeats.last(client)
        return max(self._since[client], -math.inf if last is None else last) + OWNER_SILENCE

    def _enter(self, event: Event, primary: ClientId, secondary: ClientId) -> None:
        self.state = TRANSITIONS[self.state][event]
        self.primary, self.secondary = primary, secondary
        self._since = {client: at for client, at in self._since.items() if client in (primary, secondary)}


def _named(ids: Sequence[float], sender: ClientId, present: ClientId) -> ClientId | None:
    """Return the client that two ids name; None when they are no ids."""
    named = []
    for own, now, value in zip(sender, present, ids, strict=True):
        if math.isnan(value) or value == _UNCHANGED:
            named.append(now)
        elif value == _SENDER:
            named.append(own)
        elif value == _REMOVED:
            named.append(0 if present == sender else now)
        elif 0 <= value <= 255 and value == int(value):
            named.append(int(value))
        else:
            return None
    system, component = named
    if (system == 0) != (component == 0):
        return None
    return system, component

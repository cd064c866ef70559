"""Retransmissions and order of a system's payload actions, at all its components.

A remembered answer must still be true when it is sent again. A pilot, the drone itself or a command to another
component may have changed the camera meanwhile, so only actions that count are remembered. One that sets a target
is carried out again each time: that is harmless, and the drone confirms it. Rules: conformance R10, MAVLink command.md.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable, Hashable

from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import (
    MAX_CLIENTS,
    ActionGroup,
    Command,
    Effect,
    Execution,
    is_in_window,
)

_Key = tuple[Hashable, int, int]
"""Client, component, MAV_CMD."""


class PayloadHistory:
    """Newest payload action of each client, component and MAV_CMD of one system.

    An action is overtaken when another one of its group has begun since, by any client and at any component.
    """

    def __init__(self) -> None:
        self._newest: dict[_Key, Execution] = {}
        """In the order of use, at most `MAX_CLIENTS`."""
        self._turns: dict[ActionGroup, asyncio.Lock] = defaultdict(asyncio.Lock)

    def turn(self, group: ActionGroup) -> asyncio.Lock:
        """Return the lock that an action of a group in order holds while it runs."""
        return self._turns[group]

    def retransmission(self, command: Command, now: float) -> int | None:
        """Return the MAV_RESULT that answers a retransmission; None: execute the command."""
        newest = self._newest.get(_key(command))
        if newest is None or not newest.command.same_as(command):
            return None
        effect = command.effect
        if newest.result == dialect.MAV_RESULT_IN_PROGRESS:
            return None if effect.is_repeatable and newest.overtaken else newest.result
        if effect.is_repeatable or not is_in_window(newest, now):
            return None
        is_numbered = effect is Effect.NUMBERED
        is_new = (effect is Effect.EACH and not command.confirmation) or newest.overtaken or not newest.still_holds
        if is_new and not is_numbered:
            return None
        if newest.succeeded:
            newest.ended = now  # the client may not receive this answer either: Mission Planner repeats for 6 s
        return newest.result

    def begin(self, command: Command) -> Execution:
        """Note that an action begins; it overtakes all others of its group."""
        for other in self._newest.values():
            if other.command.group is command.group:
                other.overtaken = True
        key = _key(command)
        self._newest.pop(key, None)  # so that the dictionary is in the order of use
        execution = self._newest[key] = Execution(command.client, command)
        if len(self._newest) > MAX_CLIENTS:
            del self._newest[next(iter(self._newest))]
        return execution

    def forget_clients(self, is_gone: Callable[[Hashable], bool]) -> None:
        """Forget the actions of the clients for which `is_gone` returns True."""
        self._newest = {key: execution for key, execution in self._newest.items() if not is_gone(key[0])}

    def forget(self) -> None:
        """Forget all actions: the link is lost, and the drone may restart."""
        self._newest.clear()


def _key(command: Command) -> _Key:
    return command.client, command.component, command.id

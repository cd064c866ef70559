"""Running actions of all components of a system.

The aircraft, the camera and its zoom exist once, whichever component a command is addressed to: an action of the camera
component that moves the aircraft ends older flight commands to the autopilot, and newer ones end it.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Hashable

from msgspec import Struct

from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import ActionGroup, CommandHistory, Execution
from anafi_mav.vehicle.base.flight_task import FlightAction, FlightActions

MAX_WAITING = 32
"""Actions of one group that run one after another: a drone that answers none of them takes seconds for each."""


class RunningAction(Struct, eq=False):
    """A running action that changes the vehicle's state."""

    client: Hashable
    answer: tuple[Inbound, Execution] | None
    """Client and command to acknowledge; None for messages without acknowledgement."""
    group: ActionGroup = ActionGroup.FLIGHT


class RunningActions:
    """Running actions of one system, and the histories of its components."""

    def __init__(self, flight: FlightActions | None = None) -> None:
        """`flight`: the actions of the vehicle, whose control ends those that fly."""
        self.flight = flight or FlightActions()
        self.flight.on_begun(self.forget)
        self.flight.on_replaced(self._supersede)
        self.tasks: dict[asyncio.Task[None], RunningAction] = {}
        """In the sequence of their arrival, which is not that of their first steps."""
        self.histories: list[CommandHistory] = []

    @property
    def current(self) -> RunningAction | None:
        """The action that calls; None outside of them."""
        task = asyncio.current_task()
        return None if task is None else self.tasks.get(task)

    def add(self, task: asyncio.Task[None], running: RunningAction, *, is_order: bool) -> None:
        """Note an action that begins."""
        self.tasks[task] = running
        self.flight.add(task, FlightAction(running.client, is_order, flies=running.group is ActionGroup.FLIGHT))

    def is_full(self, group: ActionGroup) -> bool:
        """Return True when a group whose actions run in order takes no further one."""
        return group.in_order and sum(one.group is group for one in self.tasks.values()) >= MAX_WAITING

    def end_others(self, group: ActionGroup) -> list[asyncio.Task[None]]:
        """Cancel all actions of a group that are older than the calling one.

        Their senders get CANCELLED. A newer action than the calling one continues: it will replace this one.
        """
        if group is ActionGroup.FLIGHT:
            return self.flight.end_older()
        task, current = asyncio.current_task(), self.current
        older = itertools.takewhile(lambda other: other is not task, self.tasks)
        others = [other for other in older if self.tasks[other].group is group]
        for other in others:
            other.cancel()
        self._supersede(None if current is None else current.client, group)
        return others

    def _supersede(self, client: Hashable, group: ActionGroup = ActionGroup.FLIGHT) -> None:
        """Note in all components that an action of this client has replaced those of all others."""
        for history in self.histories:
            history.supersede(client, group)

    def forget(self, client: Hashable, group: ActionGroup = ActionGroup.FLIGHT) -> None:
        """Forget this client's newest action of a group in all components."""
        for history in self.histories:
            history.forget(client, group)

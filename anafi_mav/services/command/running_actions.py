"""Running actions of all components of a system.

The aircraft, the camera and its zoom exist once, whichever component a command is addressed to: an action of the camera
component that moves the aircraft ends older flight commands to the autopilot, and newer ones end it.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Hashable
from dataclasses import dataclass

from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import ActionGroup, CommandHistory, Execution

MAX_WAITING = 32
"""Actions of one group that run one after another: a drone that answers none of them takes seconds for each."""


@dataclass
class RunningAction:
    """A running action that changes the vehicle's state."""

    client: Hashable
    answer: tuple[Inbound, Execution] | None
    """Client and command to acknowledge; None for messages without acknowledgement."""
    is_order: bool = True
    """A client has commanded it; neither the gateway began it, nor a stream of setpoints."""
    group: ActionGroup = ActionGroup.FLIGHT
    replaced_by_order: bool = False
    """A newer order has ended it."""


class RunningActions:
    """Running actions of one system, and the histories of its components."""

    def __init__(self) -> None:
        self.tasks: dict[asyncio.Task[None], RunningAction] = {}
        """In the sequence of their arrival, which is not that of their first steps."""
        self.histories: list[CommandHistory] = []

    @property
    def current(self) -> RunningAction | None:
        """The action that calls; None outside of them."""
        task = asyncio.current_task()
        return None if task is None else self.tasks.get(task)

    def is_full(self, group: ActionGroup) -> bool:
        """Return True when a group whose actions run in order takes no further one."""
        return group.in_order and sum(one.group is group for one in self.tasks.values()) >= MAX_WAITING

    def end_others(self, group: ActionGroup) -> list[asyncio.Task[None]]:
        """Cancel all actions of a group that are older than the calling one.

        Their senders get CANCELLED. A newer action than the calling one continues: it will replace this one.
        """
        task, current = asyncio.current_task(), self.current
        older = itertools.takewhile(lambda other: other is not task, self.tasks)
        others = [other for other in older if self.tasks[other].group is group]
        for other in others:
            if current is not None and current.is_order:
                self.tasks[other].replaced_by_order = True
            other.cancel()
        for history in self.histories:
            history.supersede(None if current is None else current.client, group)
        return others

    def forget(self, client: Hashable, group: ActionGroup) -> None:
        """Forget this client's newest action of a group in all components."""
        for history in self.histories:
            history.forget(client, group)

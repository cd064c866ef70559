"""Queries sent after connecting, with their timeouts."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.drone.expectation import Commander
from anafi_mav.drone.settings import Question
from anafi_mav.errors import CommandTimeout, LinkLost

log = logging.getLogger("anafi_mav")

STATES_TIMEOUT = 5.0
"""s that a drone may take to send all its states, and all its settings: a few hundred messages."""

DETAILS_TIMEOUT = 3.0
"""s to wait for what may never come; as Olympe (arsdkng/drone: optional, at most 3 s)."""


async def read(commander: Commander, who: str, questions: Sequence[Message], markers: Sequence[type[Message]]) -> None:
    """Ask this device for all its states and settings, and wait for the marker that ends each.

    Raises `LinkLost` when one of them does not come in time.
    """
    waits = [
        (what, commander.expect((marker,), lambda message: True))
        for what, marker in zip(("states", "settings"), markers, strict=True)
    ]
    try:
        for question in questions:
            commander.send(question)
        for what, wait in waits:
            wait.expire_after(STATES_TIMEOUT, f"all {what}")
        for what, wait in waits:
            try:
                await wait.wait()
            except CommandTimeout:
                raise LinkLost(f"the {who} did not send all its {what} within {STATES_TIMEOUT:g} s") from None
    finally:
        for _, wait in waits:
            wait.close()


async def ask(commander: Commander, name: str, questions: list[Question]) -> None:
    """Query the states that the drone reports only on request.

    A missing answer is a feature that this drone does not have.
    """
    waits = [(command, commander.expect((answer,), judge)) for command, answer, judge in questions]
    try:
        for command, wait in waits:
            wait.token = commander.send(command)
            wait.expire_after(DETAILS_TIMEOUT, command.NAME)
        for command, wait in waits:
            try:
                await wait.wait()
            except CommandTimeout:
                log.info("%s: no answer to %s", name, command.NAME)
    finally:
        for _, wait in waits:
            wait.close()

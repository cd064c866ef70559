"""Looks at what a zenoh router knows, for sessions over a link that loses datagrams.

It uses a session of its own. zenoh sends each declaration once, and its sessions remember what they have declared and
heard: within a session what was lost on the way stays lost. Imports zenoh: `zenoh_session` starts it.
"""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Callable, Collection, Mapping
from typing import Any

import zenoh

TRIES = 3
"""Attempts of one look: each may lose a datagram, too."""

ANSWER_LIMIT = 0.6
"""s for the router's list of tokens."""

PROBE_PAUSE = 0.4
"""s for a probe to go to the router and on to the session that is looked at."""

PROBE = "look"
"""Last part of the key of a probe, a sample without bytes."""


def probe_of(expression: str) -> str:
    """Return a key that a subscription to this expression covers.

    It ends with "/**", and no station or system has the names that stand for "*" and "**".
    """
    return f"{expression.removesuffix('**').replace('*', '0')}{PROBE}"


def is_probe(key: str) -> bool:
    """Return True for the key of a probe."""
    return key.endswith(f"/{PROBE}")


class DeclarationCheck:
    """One look: the tokens there are, and the declarations that the router does not know."""

    def __init__(self, settings: Mapping[str, Any], watched: Collection[str]) -> None:
        """`watched`: expressions of the tokens that the session watches."""
        self._settings = settings
        self._watched = watched
        self.tokens: set[str] = set()
        """Those that the router knows."""

    def missing(
        self,
        tokens: Collection[str],
        probes: Collection[str],
        arrived: Callable[[str], bool],
        stopping: threading.Event,
    ) -> set[str]:
        """Return those of the tokens and probes that were never seen; nothing without a session.

        `arrived` returns True for a probe that the session has received. Blocks for some seconds at most.
        """
        left: set[str] = set()
        config = zenoh.Config()
        for key, value in self._settings.items():
            config.insert_json5(key, json.dumps(value))
        with contextlib.suppress(zenoh.ZError), zenoh.open(config) as session:
            for _ in range(TRIES):
                for expression in self._watched:
                    self._list(session, expression)
                for token in tokens:
                    if token not in self.tokens:
                        self._list(session, token)
                for probe in probes:
                    if not arrived(probe):
                        session.put(probe, b"")
                stopping.wait(PROBE_PAUSE)
                left = {token for token in tokens if token not in self.tokens}
                left |= {probe for probe in probes if not arrived(probe)}
                if not left or stopping.is_set():
                    break
        return left

    def _list(self, session: zenoh.Session, expression: str) -> None:
        for reply in session.liveliness().get(expression, timeout=ANSWER_LIMIT):
            if reply.ok is not None:
                self.tokens.add(str(reply.ok.key_expr))

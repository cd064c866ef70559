"""Looks at what a zenoh router knows, and at what a link that loses datagrams has lost.

It uses sessions of its own, another one for each try. zenoh sends each declaration, and the end of each, once, and its
sessions remember what they have declared and heard: within a session what was lost on the way stays lost. Imports
zenoh: `zenoh_session` starts it.
"""

from __future__ import annotations

import contextlib
import json
import threading
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import zenoh

TRIES = 3
"""Attempts of one look: each may lose a datagram, too."""

COMPLETE_TRIES = 2
"""Attempts that the router has to answer before a token counts as absent: of an answer, too, a part may be lost."""

ANSWER_LIMIT = 0.6
"""s for the router's list of tokens."""

PROBE_PAUSE = 0.4
"""s for a probe to go to the router and on to the session that is looked at."""

LIST_LIMIT = 2.0
"""s for the router's list of all tokens."""

LIST_TRIES = 3
"""Attempts to get a list that is known to be the router's."""

LIST_PAUSE = 0.2
"""s between them: the router may not have heard of the witness yet."""

LOOKS_TO_END = 2
"""Looks in turn that must agree before an end is reported: a station that is reported as lost stops its drone."""

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


def configured(settings: Mapping[str, Any]) -> zenoh.Config:
    """Return zenoh's configuration with these settings."""
    config: zenoh.Config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


def list_proven(settings: Mapping[str, Any], expression: str, witness: str, stopping: threading.Event) -> set[str]:
    """Return the tokens that the router knows; none when it named no complete list.

    `witness`: a token of another session, which the expression covers. A list without it is not the router's: zenoh
    answers for a router that it has no link to, or loses meanwhile, with an empty list that counts as complete.
    Blocks for some seconds at most.
    """
    for _ in range(LIST_TRIES):
        if stopping.is_set():
            break
        with contextlib.suppress(zenoh.ZError), zenoh.open(configured(settings)) as session:
            replies = list(session.liveliness().get(expression, timeout=LIST_LIMIT))
            tokens = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
            if witness in tokens and all(reply.ok is not None for reply in replies):
                return tokens
        stopping.wait(LIST_PAUSE)
    return set()


class AgreedLooks:
    """Keys for which several looks in turn found the same."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()

    def add(self, found: Collection[str]) -> set[str]:
        """Note what one look found; return the keys that `LOOKS_TO_END` looks in turn have found.

        Those are counted from the beginning after that.
        """
        self._counts = Counter({key: self._counts[key] + 1 for key in found})
        agreed = {key for key, count in self._counts.items() if count >= LOOKS_TO_END}
        for key in agreed:
            del self._counts[key]
        return agreed


class KnownKeys(NamedTuple):
    """The keys that a session has declared and heard."""

    own: Collection[str]
    """Liveliness tokens."""
    probes: Collection[str]
    """Of its subscriptions."""
    tokens: Collection[str]
    """Tokens of others, and own ones that it has ended."""
    read: Collection[str]
    """Keys that have readers, among those that it publishes."""


class DeclarationCheck:
    """One look at the router, compared with the keys that a session knows. `look` once."""

    def __init__(self, settings: Mapping[str, Any], watched: Collection[str], published: Collection[str]) -> None:
        """Create it, before its look.

        `watched`: expressions of the tokens that the session watches. `published`: keys whose readers it follows.
        """
        self._settings = settings
        self._watched = watched
        self._published = published
        self._answered: Counter[str] = Counter()
        """How often the router completed its answer about a token."""
        self.tokens: set[str] = set()
        """Those that the router knows."""
        self.read: set[str] = set()
        """Published keys that have a reader."""
        self.missing: set[str] = set()
        """Own tokens and probes that were not seen."""
        self.absent: set[str] = set()
        """Tokens and keys with readers that were not seen, though the session knows of them."""

    def look(self, known: KnownKeys, arrived: Callable[[str], bool], stopping: threading.Event) -> None:
        """Look at the router. Without a link to it everything stays empty.

        `arrived` returns True for a probe that the session has received. Blocks for some seconds at most.
        """
        expected = {*known.own, *known.tokens}
        tries = 0
        for _ in range(TRIES):
            with contextlib.suppress(zenoh.ZError), zenoh.open(configured(self._settings)) as session:
                publishers = [session.declare_publisher(key) for key in self._published]
                for expression in self._watched:
                    self._list(session, expression)
                for token in expected - self.tokens:
                    self._list(session, token)
                for probe in known.probes:
                    if not arrived(probe):
                        session.put(probe, b"")
                stopping.wait(PROBE_PAUSE)
                self.read |= {str(one.key_expr) for one in publishers if one.matching_status.matching}
                tries += 1
            if stopping.is_set():
                return
            if expected <= self.tokens and set(known.read) <= self.read and all(map(arrived, known.probes)):
                return
        if tries:
            self.missing = set(known.own) - self.tokens
            self.missing |= {probe for probe in known.probes if not arrived(probe)}
            self.absent = {key for key in set(known.tokens) - self.tokens if self._answered[key] >= COMPLETE_TRIES}
            self.absent |= set(known.read) - self.read if tries >= COMPLETE_TRIES else set()

    def _list(self, session: zenoh.Session, expression: str) -> None:
        is_complete = True
        for reply in session.liveliness().get(expression, timeout=ANSWER_LIMIT):
            if reply.ok is not None:
                self.tokens.add(str(reply.ok.key_expr))
            else:
                is_complete = False
        self._answered[expression] += is_complete

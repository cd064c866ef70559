"""One zenoh session, in threads of its own.

The only module that imports zenoh, an optional dependency; `connection` loads it. One thread opens the session,
declares and publishes: each of these may block. zenoh calls back in threads of its own, which only hand bytes on.
"""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from anafi_mav.fabric.arrivals import (
    Arrival,
    FabricSample,
    LinkChange,
    ReadersChange,
    SampleQueue,
    StateQuery,
    TokenChange,
    TokensListed,
)
from anafi_mav.fabric.envelope import MAX_SAMPLE

logger = logging.getLogger(__name__)

LOOK_EVERY = 0.5
"""s between looks whether the session has a link."""

RETRY_PAUSE = 0.5
"""s between attempts to open."""

LIST_LIMIT = 2.0
"""s for a list of the tokens that exist."""

MAX_QUERIES = 64
"""Queries that may be open at once: each waits for the event loop and for the thread that publishes."""

MAX_ATTACHMENT = 64
"""Bytes; an envelope has fewer. What is larger is not copied."""

NO_LINK = "no answer"


class ZenohSession:
    """A session from `start` to `stop`. Everything asked of it before it is open is done then."""

    def __init__(
        self, settings: Mapping[str, Any], queue: SampleQueue, report: Callable[[Arrival], bool], *, retries: bool
    ) -> None:
        """`report` is called in other threads, and returns False for what has no room.

        `retries`: the first attempt to open may fail.
        """
        self.opened = threading.Event()
        """Set when the first attempt to open has ended."""
        self.failure = ""
        """Why it failed, where it is not repeated; empty otherwise."""
        self.ended = threading.Event()
        """Set when everything is closed."""
        self._settings = settings
        self._queue = queue
        self._report = report
        self._retries = retries
        self._stopping = threading.Event()
        self._free_queries = threading.BoundedSemaphore(MAX_QUERIES)
        self._declared: dict[tuple[str, str], Any] = {}
        """Subscribers, tokens, publishers and queryables, by kind and key."""
        self._is_up: bool | None = None
        self._looked = 0
        self._thread = threading.Thread(target=self._run, name="zenoh", daemon=True)

    def start(self) -> None:
        """Begin to open the session."""
        self._thread.start()

    def stop(self) -> None:
        """Begin to close it; `ended` is set afterwards."""
        self._stopping.set()
        self._queue.add_work(lambda session: None)

    # Called in the event loop; carried out by the thread.

    def watch_tokens(self, expression: str) -> None:
        """Report the liveliness tokens of these keys, those that exist already included."""
        self._declare(
            "tokens",
            expression,
            lambda session: session.liveliness().declare_subscriber(expression, self._token, history=True),
        )

    def list_tokens(self, *expressions: str) -> None:
        """Report the tokens of these keys once, and then the end of the list."""

        def work(session: zenoh.Session) -> None:
            for expression in expressions:
                for reply in session.liveliness().get(expression, timeout=LIST_LIMIT):
                    if reply.ok is not None:
                        self._token(reply.ok)
            self._report(TokensListed())

        self._queue.add_work(work)

    def subscribe(self, expression: str) -> None:
        """Report samples with these keys."""
        self._declare("subscriber", expression, lambda session: session.declare_subscriber(expression, self._sample))

    def publish_on(self, key: str) -> None:
        """Report when a key gets its first reader and loses its last.

        Without a reader its samples are not sent.
        """

        def declare(session: zenoh.Session) -> Any:
            publisher = session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP)

            def report(status: zenoh.MatchingStatus) -> None:
                self._report(ReadersChange(key, bool(status.matching)))

            publisher.declare_matching_listener(report)
            return publisher

        self._declare("publisher", key, declare)

    def answer_queries(self, expression: str) -> None:
        """Report queries for this key, `MAX_QUERIES` at once; further ones end without an answer.

        Each that is reported has to be ended by `finish`.
        """

        def report(query: zenoh.Query) -> None:
            if not self._free_queries.acquire(blocking=False):
                query.drop()  # type: ignore[no-untyped-call]
            elif not self._report(StateQuery(expression, query)):
                self._end_query(query)

        self._declare("queries", expression, lambda session: session.declare_queryable(expression, report))

    def declare_token(self, key: str) -> None:
        """Hold a liveliness token."""
        self._declare("token", key, lambda session: session.liveliness().declare_token(key))

    def end(self, key: str) -> None:
        """Undo what was declared for this key or expression."""
        for kind in ("token", "subscriber", "publisher", "queries"):
            self._end(kind, key)

    def reply(self, query: Any, key: str, payload: bytes) -> None:
        """Answer a query."""
        self._queue.add_work(lambda session: query.reply(key, payload))

    def finish(self, query: Any) -> None:
        """End a query after its answers."""
        self._queue.add_work(lambda session: self._end_query(query))

    # In the thread.

    def _end_query(self, query: zenoh.Query) -> None:
        self._free_queries.release()
        query.drop()  # type: ignore[no-untyped-call]

    def _declare(self, kind: str, key: str, declare: Callable[[zenoh.Session], Any]) -> None:
        def work(session: zenoh.Session) -> None:
            if (kind, key) not in self._declared:
                self._declared[kind, key] = declare(session)

        self._queue.add_work(work)

    def _end(self, kind: str, key: str) -> None:
        def work(session: zenoh.Session) -> None:
            declared = self._declared.pop((kind, key), None)
            if declared is not None:
                declared.undeclare()

        self._queue.add_work(work)

    def _run(self) -> None:
        session: zenoh.Session | None = None
        try:
            session = self._open()
            if session is not None:
                self._serve(session)
        except Exception as error:
            # Without this thread nothing is published: better off the fabric, and said so, than half on it.
            logger.exception("the zenoh session has ended: a mistake of ours")
            self._note(is_up=False, problem=f"ended by {error!r}")
        finally:
            self.opened.set()
            if session is not None:
                self._declared.clear()
                session.close()  # type: ignore[no-untyped-call]
            self.ended.set()

    def _open(self) -> zenoh.Session | None:
        while not self._stopping.is_set():
            try:
                config = zenoh.Config()
                for key, value in self._settings.items():
                    config.insert_json5(key, json.dumps(value))
                session = zenoh.open(config)
            except zenoh.ZError as error:
                # Its text goes on with the place in zenoh's sources.
                problem = str(error).partition(" at /")[0]
                if not self._retries:
                    self.failure = problem
                    return None
                self._note(is_up=False, problem=problem)
                self.opened.set()
                self._stopping.wait(RETRY_PAUSE)
            else:
                self.opened.set()
                return session
        return None

    def _serve(self, session: zenoh.Session) -> None:
        drop = zenoh.CongestionControl.DROP
        count = 0
        self._look(session)
        while not self._stopping.is_set():
            due = self._queue.next(LOOK_EVERY)
            count += 1
            if due is None or count >= 1000:
                self._look(session)
                count = 0
            if isinstance(due, FabricSample):
                try:
                    publisher = self._declared.get(("publisher", due.key))
                    if publisher is not None:
                        publisher.put(due.payload)
                    else:
                        session.put(due.key, due.payload, congestion_control=drop, attachment=due.attachment or None)
                except zenoh.ZError as error:
                    self._note(is_up=False, problem=str(error).partition(" at /")[0])
            elif due is not None:
                try:
                    due(session)
                except zenoh.ZError as error:
                    self._note(is_up=False, problem=str(error).partition(" at /")[0])

    def _look(self, session: zenoh.Session) -> None:
        info = session.info
        is_up = bool(info.routers_zid() or info.peers_zid()) or self._settings["mode"] == "peer"
        self._note(is_up=is_up, problem="" if is_up else NO_LINK)

    def _note(self, *, is_up: bool, problem: str) -> None:
        if is_up != self._is_up:
            self._is_up = is_up
            self._report(LinkChange(is_up, problem))

    # In zenoh's threads.

    def _sample(self, sample: zenoh.Sample) -> None:
        attachment = sample.attachment
        if len(sample.payload) > MAX_SAMPLE or (attachment is not None and len(attachment) > MAX_ATTACHMENT):
            self._report(FabricSample(str(sample.key_expr), b"", b""))  # an empty one counts as bad
            return
        raw = b"" if attachment is None else attachment.to_bytes()
        self._report(FabricSample(str(sample.key_expr), sample.payload.to_bytes(), raw))

    def _token(self, sample: zenoh.Sample) -> None:
        self._report(TokenChange(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))

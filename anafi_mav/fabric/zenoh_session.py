"""One zenoh session, in threads of its own.

Only this module and `declaration_check` import zenoh, an optional dependency; `connection` loads it. One thread opens
the session, declares and publishes: each of these may block. zenoh calls back in threads of its own, which only hand
bytes on.

Over a link that loses datagrams a third thread looks regularly at what the router knows. It reports tokens and ends
of tokens that were lost on the way here, and the readers of published keys. It opens another session where a
declaration of ours, or its end, was lost on the way there: in place of the first one, or beside it while that one is
in use, because its end would end all its tokens.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Collection, Mapping
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
from anafi_mav.fabric.declaration_check import (
    AgreedLooks,
    DeclarationCheck,
    KnownKeys,
    configured,
    is_probe,
    list_proven,
    probe_of,
)
from anafi_mav.fabric.envelope import MAX_SAMPLE

logger = logging.getLogger(__name__)

LOOK_EVERY = 0.5
"""s between looks whether the session has a link."""

RETRY_PAUSE = 0.5
"""s between attempts to open."""

LIST_LIMIT = 2.0
"""s for a list of the tokens that exist."""

LIST_TRIES = 3
"""Requests of such a list: a router that lists nothing to us must not keep us off the fabric."""

CHECK_FIRST, CHECK_EVERY = 1.0, 3.0
"""s until the first look at what the router knows, and between further ones."""

MAX_BESIDE = 4
"""Sessions beside the first one: each is a link of its own."""

MAX_QUERIES = 64
"""Queries that may be open at once: each waits for the event loop and for the thread that publishes."""

MAX_ATTACHMENT = 64
"""Bytes; an envelope has fewer. What is larger is not copied."""

NO_LINK = "no answer"
LOST_DECLARATION = "a declaration was lost"


class ZenohSession:
    """A session from `start` to `stop`. Everything asked of it before it is open is done then."""

    def __init__(
        self,
        settings: Mapping[str, Any],
        queue: SampleQueue,
        report: Callable[[Arrival], bool],
        *,
        retries: bool,
        is_lossy: bool = False,
    ) -> None:
        """`report` is called in other threads, and returns False for what has no room.

        `retries`: the first attempt to open may fail. `is_lossy`: the link to the router loses datagrams.
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
        self._declarations: dict[tuple[str, str], Callable[[zenoh.Session], Any]] = {}
        """How each of these is declared again in another session."""
        self._alive: set[str] = set()
        """Tokens that were reported and have not ended."""
        self._heard: set[str] = set()
        """Tokens of programs that were heard since the last look."""
        self._is_in_use = False
        self._ended: set[str] = set()
        """Tokens whose end was reported since the present look began: it may have seen them before."""
        self._former: set[str] = set()
        """Our own tokens that ended in this session, while the router may know them."""
        self._read: set[str] = set()
        """Published keys that were reported as read: with a lossy link only."""
        self._probed: set[str] = set()
        """Probes that have arrived in this session."""
        self._is_lossy = is_lossy
        self._beside: list[zenoh.Session] = []
        """Sessions that hold what the link of the first one lost."""
        self._reopens = False
        """True when another session is to be opened."""
        self._is_up: bool | None = None
        self._looked = 0
        self._thread = threading.Thread(target=self._run, name="zenoh", daemon=True)
        self._checker = threading.Thread(target=self._check_regularly, name="zenoh check", daemon=True)

    def start(self) -> None:
        """Begin to open the session."""
        self._thread.start()
        if self._is_lossy:
            self._checker.start()

    def stop(self) -> None:
        """Begin to close it; `ended` is set afterwards."""
        self._stopping.set()
        self._queue.add_work(lambda session: None)

    def note_heard(self, *tokens: str, is_in_use: bool) -> None:
        """Note that the programs with these tokens are heard: the tokens have not ended.

        `is_in_use`: they use this session, and the next look does not open another one.
        """
        if self._is_lossy:
            self._heard.update(tokens)
            self._is_in_use |= is_in_use

    # Called in the event loop; carried out by the thread.

    def watch_tokens(self, expression: str) -> None:
        """Report the liveliness tokens of these keys, those that exist already included."""
        self._declare(
            "tokens",
            expression,
            lambda session: session.liveliness().declare_subscriber(expression, self._token, history=True),
        )

    def list_tokens(self, *expressions: str) -> None:
        """Report the tokens of these keys once, and then the end of the list.

        A list that the router does not complete in time is requested again. It may still lack tokens (`list_proven`):
        those of others are reported when they come, and an id that two hold is decided then.
        """

        def work(session: zenoh.Session) -> None:
            for _ in range(LIST_TRIES):
                is_complete = True
                for expression in expressions:
                    for reply in session.liveliness().get(expression, timeout=LIST_LIMIT):
                        if reply.ok is not None:
                            self._token(reply.ok)
                        else:
                            is_complete = False  # an error: "Timeout"
                if is_complete or self._stopping.is_set():
                    break
            self._report(TokensListed())

        self._queue.add_work(work)

    def proven_tokens(self, expression: str, witness: str) -> set[str]:
        """Return the tokens that the router knows; none without a complete list.

        Blocks, in any thread. Another session looks, and finds `witness`, a token of this one.
        """
        return list_proven(self._settings, expression, witness, self._stopping)

    def subscribe(self, expression: str) -> None:
        """Report samples with these keys."""
        self._declare("subscriber", expression, lambda session: session.declare_subscriber(expression, self._sample))

    def publish_on(self, key: str) -> None:
        """Report when a key gets its first reader and loses its last.

        Without a reader its samples are not sent. Over a lossy link nothing is declared, and the looks find readers:
        zenoh would send the samples under the number of a key that the router may never have heard, and only while it
        has heard of a reader.
        """

        def declare(session: zenoh.Session) -> Any:
            if self._is_lossy:
                return None
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
                self._former.discard(key)
                self._declarations[kind, key] = declare
                self._declared[kind, key] = declare(session)

        self._queue.add_work(work)

    def _end(self, kind: str, key: str) -> None:
        def work(session: zenoh.Session) -> None:
            self._declarations.pop((kind, key), None)
            declared = self._declared.pop((kind, key), None)
            if declared is not None:
                declared.undeclare()
                if self._is_lossy and kind == "token":
                    self._former.add(key)

        self._queue.add_work(work)

    def _run(self) -> None:
        session: zenoh.Session | None = None
        try:
            session = self._open()
            while session is not None:
                self._serve(session)
                if self._stopping.is_set():
                    break
                session = self._open_again(session)
        except Exception as error:
            # Without this thread nothing is published: better off the fabric, and said so, than half on it.
            logger.exception("the zenoh session has ended: a mistake of ours")
            self._note(is_up=False, problem=f"ended by {error!r}")
        finally:
            self.opened.set()
            if session is not None:
                self._declared.clear()
                session.close()  # type: ignore[no-untyped-call]
            if self._checker.is_alive():
                self._checker.join(CHECK_EVERY)
            self._close_beside()
            self.ended.set()

    def _open(self) -> zenoh.Session | None:
        while not self._stopping.is_set():
            try:
                session = zenoh.open(configured(self._settings))
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

    def _open_again(self, session: zenoh.Session) -> zenoh.Session | None:
        """Close a session and open another one with the same declarations."""
        self._declared.clear()
        session.close()  # type: ignore[no-untyped-call]
        self._close_beside()
        self._note(is_up=False, problem=LOST_DECLARATION)
        for token in tuple(self._alive):
            self._note_token(token, is_alive=False)
        self._probed.clear()
        self._former.clear()
        self._reopens = False
        opened = self._open()
        if opened is not None:
            for key, declare in self._declarations.items():
                self._declared[key] = declare(opened)
        return opened

    def _check_regularly(self) -> None:
        pause = CHECK_FIRST
        ends, lingering, unseen = AgreedLooks(), AgreedLooks(), AgreedLooks()
        while not self._stopping.wait(pause):
            pause = CHECK_EVERY
            if not self._is_up or self._reopens:
                continue
            self._ended.clear()
            declarations = tuple(self._declarations)
            published = {key for kind, key in declarations if kind == "publisher"}
            self._read &= published
            own = {key for kind, key in declarations if kind == "token"}
            probes = {probe_of(key) for kind, key in declarations if kind == "subscriber"}
            check = DeclarationCheck(self._settings, [key for kind, key in declarations if kind == "tokens"], published)
            known = KnownKeys(own, probes, (self._alive | self._former) - own, self._read)
            check.look(known, self._probed.__contains__, self._stopping)
            heard, self._heard = self._heard, set()
            is_in_use, self._is_in_use = self._is_in_use, False
            for token in check.tokens - own - self._former - self._ended:
                self._note_token(token, is_alive=True)
            for key in check.read - self._read:
                self._note_readers(key, has_readers=True)
            for key in ends.add(check.absent - heard):
                self._former.discard(key)
                if key in self._read:
                    self._note_readers(key, has_readers=False)
                elif key in self._alive:
                    self._note_token(key, is_alive=False)
            lost = check.missing - {key if kind == "token" else probe_of(key) for kind, key in declarations
                                    if (kind, key) not in self._declarations}  # fmt: skip
            agreed, remaining = unseen.add(lost), lingering.add(check.tokens & self._former)
            if self._stopping.is_set():
                return
            if is_in_use:
                self._declare_beside(agreed)
            elif lost := lost | remaining:
                logger.warning("declarations lost on the way, opening another session: %s", ", ".join(sorted(lost)))
                self._reopens, pause = True, CHECK_FIRST
                self._queue.add_work(lambda session: None)

    def _declare_beside(self, lost: Collection[str]) -> None:
        """Declare in a session of their own what these tokens and probes stand for."""
        places = [
            (kind, key)
            for kind, key in tuple(self._declarations)
            if (kind == "token" and key in lost) or (kind == "subscriber" and probe_of(key) in lost)
        ]
        if not places or len(self._beside) >= MAX_BESIDE:
            return
        with contextlib.suppress(zenoh.ZError):  # the next look tries it again
            session = zenoh.open(configured(self._settings))
            self._beside.append(session)
            made = {place: self._declarations[place](session) for place in places if place in self._declarations}
            self._queue.add_work(lambda _: self._replace(session, made))
            logger.warning("declarations lost on the way, made beside: %s", ", ".join(sorted(lost)))

    def _replace(self, session: zenoh.Session, made: Mapping[tuple[str, str], Any]) -> None:
        """Hold these declarations of a session in place of those that were lost."""
        if session not in self._beside:
            return
        for place, declared in made.items():
            if place in self._declarations:
                declared, self._declared[place] = self._declared[place], declared
            declared.undeclare()

    def _close_beside(self) -> None:
        while self._beside:
            self._beside.pop().close()  # type: ignore[no-untyped-call]

    def _note_readers(self, key: str, *, has_readers: bool) -> None:
        if has_readers:
            self._read.add(key)
        else:
            self._read.discard(key)
        self._report(ReadersChange(key, has_readers))

    def _note_token(self, key: str, *, is_alive: bool) -> None:
        if is_alive:
            self._alive.add(key)
        else:
            self._alive.discard(key)
            self._ended.add(key)
        self._report(TokenChange(key, is_alive))

    def _serve(self, session: zenoh.Session) -> None:
        drop = zenoh.CongestionControl.DROP
        count = 0
        self._look(session)
        while not (self._stopping.is_set() or self._reopens):
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
        if self._is_lossy and is_probe(str(sample.key_expr)):
            self._probed.add(str(sample.key_expr))
            return
        attachment = sample.attachment
        if len(sample.payload) > MAX_SAMPLE or (attachment is not None and len(attachment) > MAX_ATTACHMENT):
            self._report(FabricSample(str(sample.key_expr), b"", b""))  # an empty one counts as bad
            return
        raw = b"" if attachment is None else attachment.to_bytes()
        self._report(FabricSample(str(sample.key_expr), sample.payload.to_bytes(), raw))

    def _token(self, sample: zenoh.Sample) -> None:
        self._note_token(str(sample.key_expr), is_alive=sample.kind == zenoh.SampleKind.PUT)

"""What zenoh's threads may hand to the event loop: a number of open queries, and samples of a size."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

import zenoh

from anafi_mav.fabric.arrivals import Arrival, FabricSample, SampleQueue, StateQuery, TokenChange, TokensListed
from anafi_mav.fabric.zenoh_session import MAX_QUERIES, ZenohSession


class Query:
    """A query as zenoh's, which knows if it has ended."""

    has_ended = False

    def drop(self) -> None:
        self.has_ended = True


class Session:
    """zenoh's session, as far as declarations need it: it keeps their callbacks."""

    def __init__(self) -> None:
        self.callbacks: list[Any] = []

        self.lists: list[list[Any]] = []
        """Replies to requests for tokens, in turn."""

    def liveliness(self) -> Session:
        return self

    def get(self, expression: str, timeout: float) -> list[Any]:
        return self.lists.pop(0)

    def declare_queryable(self, expression: str, callback: Any) -> None:
        self.callbacks.append(callback)

    def declare_subscriber(self, expression: str, callback: Any) -> None:
        self.callbacks.append(callback)


def perform(queue: SampleQueue, session: Session) -> None:
    """Do what waits for the publishing thread."""
    while (due := queue.next(0.0)) is not None:
        assert callable(due)
        due(session)


def test_queries_beyond_the_limit_end_at_once_until_another_has_ended() -> None:
    reported: list[Arrival] = []
    queue, zenohs, has_room = SampleQueue(8, Counter()), Session(), True

    def report(arrival: Arrival) -> bool:
        if has_room:
            reported.append(arrival)
        return has_room

    session = ZenohSession({}, queue, report, retries=False)
    session.answer_queries("state")
    perform(queue, zenohs)
    (ask,) = zenohs.callbacks
    queries = [Query() for _ in range(MAX_QUERIES + 2)]
    for query in queries[: MAX_QUERIES + 1]:
        ask(query)
    assert reported == [StateQuery("state", query) for query in queries[:MAX_QUERIES]]
    assert [query for query in queries if query.has_ended] == [queries[MAX_QUERIES]]

    session.finish(queries[0])
    perform(queue, zenohs)
    assert queries[0].has_ended
    ask(queries[-1])
    assert reported[-1] == StateQuery("state", queries[-1])

    session.finish(queries[1])
    perform(queue, zenohs)
    has_room = False
    for refused in (Query(), Query()):  # what has no room gives its place back
        ask(refused)
        assert refused.has_ended


def test_content_of_oversized_samples_is_not_copied() -> None:
    reported: list[Arrival] = []
    queue, zenohs = SampleQueue(8, Counter()), Session()
    session = ZenohSession({}, queue, lambda arrival: reported.append(arrival) is None, retries=False)
    session.subscribe("up")
    perform(queue, zenohs)
    (receive,) = zenohs.callbacks
    for payload, attachment in ((1400, 64), (1401, 25), (12, 65), (12, None)):
        attached = None if attachment is None else zenoh.ZBytes(bytes(attachment))
        receive(SimpleNamespace(key_expr="up", payload=zenoh.ZBytes(bytes(payload)), attachment=attached))
    assert reported == [
        FabricSample("up", bytes(1400), bytes(64)),
        FabricSample("up", b"", b""),
        FabricSample("up", b"", b""),
        FabricSample("up", bytes(12), b""),
    ]


def test_list_of_tokens_that_the_router_has_not_completed_is_requested_again() -> None:
    """zenoh's reply is an error "Timeout" then: an id would count as free that another gateway holds."""
    reported: list[Arrival] = []
    queue, zenohs = SampleQueue(8, Counter()), Session()
    session = ZenohSession({}, queue, lambda arrival: reported.append(arrival) is None, retries=False)
    late = SimpleNamespace(ok=None)
    held = SimpleNamespace(ok=SimpleNamespace(key_expr="1/drone", kind=zenoh.SampleKind.PUT))
    zenohs.lists = [[late], [held]]
    session.list_tokens("*/drone")
    perform(queue, zenohs)
    assert reported == [TokenChange("1/drone", True), TokensListed()]

    zenohs.lists = [[late]] * 3
    session.list_tokens("*/drone")
    perform(queue, zenohs)  # and with one that never answers it ends
    assert (zenohs.lists, reported[2:]) == ([], [TokensListed()])

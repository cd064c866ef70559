"""Places of clients: who gives way to a new one, and who is idle."""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.mavlink.peer_table import REPLACEABLE, PeerTable

NEVER_HEARD: Mapping[str, float] = {}


def table(
    *peers: str, places: int = 3, idle_limit: float = 30.0, heard: Mapping[str, float] = NEVER_HEARD
) -> PeerTable[str]:
    """A table with these known clients, added one second apart from 0 on; `heard`: when they were heard last."""
    held = PeerTable[str](places, idle_limit, heard.get)
    for second, peer in enumerate(peers):
        held.add(peer, float(second), known=True)
    return held


def test_longest_silent_client_gives_way() -> None:
    held = table("a", "b", "c", heard={"a": 4.0, "b": 3.0, "c": 5.0})
    assert held.is_full(known=True)
    assert held.replaceable(3.0 + REPLACEABLE - 0.01, known=True) is None
    assert held.replaceable(3.0 + REPLACEABLE, known=True) == "b"
    held.remove("b")
    held.remove("b")
    assert not held.is_full(known=True)
    assert len(held) == 2


def test_unknown_clients_give_way_to_each_other_at_once() -> None:
    held = table("pilot", places=2)
    for number in range(5):
        if held.is_full(known=False):
            other = held.replaceable(100.0, known=False)
            assert other == f"made up {number - 2}"  # the pilot has been silent for longer
            held.remove(other)
        held.add(f"made up {number}", 100.0 + number, known=False)
    assert "pilot" in held
    assert len(held) == 3


def test_unknown_client_that_proves_itself_takes_a_known_place() -> None:
    held = table("a", places=2)
    held.add("b", 1.0, known=False)
    held.add("c", 2.0, known=False)
    assert held.is_full(known=False)
    held.add("b", 3.0, known=True)
    assert held.is_full(known=True)
    assert not held.is_full(known=False)
    assert held.replaceable(4.0, known=True) is None  # neither for one that has not proved itself


def test_idle_clients_are_those_beyond_the_limit() -> None:
    heard: dict[str, float] = {}
    held = table("a", "b", "c", heard=heard)
    assert held.idle(30.0) == []
    assert held.idle(31.5) == ["a", "b"]
    heard.update(a=31.0, stranger=31.0)
    assert held.idle(31.5) == ["b"]
    assert held.silence("a", 31.5) == 0.5
    assert "stranger" not in held
    assert table("a", idle_limit=0.0).idle(1e9) == []

"""What a file of tests leaves behind is no work for the garbage collector while the next files run."""

from __future__ import annotations

import gc
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.heap import pytest_runtest_protocol


class Left:
    """Something that the garbage collector keeps a record of."""


def run(left: list[Left], path: str, following: str | None) -> None:
    """Run a test of a file that leaves one thing behind, and is followed by a test of another."""
    item: Any = SimpleNamespace(path=Path(path))
    nextitem: Any = None if following is None else SimpleNamespace(path=Path(following))
    steps = pytest_runtest_protocol(item, nextitem)
    next(steps)
    left.append(Left())
    with pytest.raises(StopIteration):
        steps.send(True)


def is_looked_through(thing: object) -> bool:
    return any(found is thing for found in gc.get_objects())


def test_things_left_by_the_last_test_of_a_file_are_not_looked_through_again() -> None:
    left: list[Left] = []
    run(left, "test_a.py", "test_b.py")
    assert not is_looked_through(left[0])


@pytest.mark.parametrize("following", ["test_a.py", None])
def test_things_left_inside_a_file_can_still_be_collected(following: str | None) -> None:
    left: list[Left] = []
    run(left, "test_a.py", following)
    assert is_looked_through(left[0])

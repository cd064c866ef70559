"""One test of many small items: cheaper than a test of each, and a failure names every item that fails."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

T = TypeVar("T")


def failures(items: Iterable[T], check: Callable[[T], None], name: Callable[[T], object] = str) -> str:
    """Check each item; return one paragraph for each that fails, with its name and reason; empty: none fails.

    Raises `AssertionError` without any item: such a test could not fail.
    """
    found, count = [], 0
    for item in items:
        count += 1
        try:
            check(item)
        except Exception as error:
            found.append(f"{name(item)}: {type(error).__name__}: {error}")
    assert count, "no items"
    return "\n\n".join(found)

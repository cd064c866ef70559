"""A test of many items names each one that fails."""

from __future__ import annotations

import pytest
from support.each import failures


def require_even(number: int) -> None:
    assert number % 2 == 0, f"{number} is odd"
    if number == 4:
        raise KeyError("four")


def test_each_failing_item_is_named_with_its_reason() -> None:
    found = failures([1, 2, 3, 4], require_even, lambda number: f"item {number}")
    assert [text.splitlines()[0] for text in found.split("\n\n")] == [
        "item 1: AssertionError: 1 is odd",
        "item 3: AssertionError: 3 is odd",
        "item 4: KeyError: 'four'",
    ]


def test_items_without_failure_give_no_text() -> None:
    assert failures([2], require_even) == ""


def test_check_without_items_fails() -> None:
    with pytest.raises(AssertionError, match="no items"):
        failures([], require_even)

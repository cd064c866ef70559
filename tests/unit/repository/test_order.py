"""The table of the longest tests is of tests that exist, and puts them first."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.order import LONGEST, WORKERS, pytest_collection_modifyitems

TESTS = next(folder for folder in Path(__file__).parents if folder.name == "tests")


def test_longest_tests_exist() -> None:
    names = {
        node.name
        for folder in ("clients", "interop")
        for path in (TESTS / folder).glob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert set(LONGEST) - names == set()


def ordered(names: list[str], workers: str | None, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.delenv(WORKERS, raising=False)
    if workers is not None:
        monkeypatch.setenv(WORKERS, workers)
    items: list[Any] = [SimpleNamespace(name=f"{name}[px4]") for name in names]
    pytest_collection_modifyitems(items)
    return [item.name.partition("[")[0] for item in items]


FIRST, SECOND, THIRD = (
    name for _, name in sorted({seconds: name for name, seconds in LONGEST.items()}.items())[:-4:-1]
)


def test_collection_with_a_long_test_begins_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["test_a", SECOND, "test_b", FIRST]
    assert ordered(names, None, monkeypatch) == [FIRST, SECOND, "test_a", "test_b"]


def test_parts_of_half_of_the_workers_begin_with_long_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["test_a", THIRD, "test_b", "test_c", SECOND, "test_d", "test_e", "test_f", FIRST, "test_g"]
    parts = [[FIRST, THIRD], [SECOND, "test_a"], ["test_b", "test_c", "test_d"], ["test_e", "test_f", "test_g"]]
    assert ordered(names, "4", monkeypatch) == [name for part in parts for name in part]


def test_more_long_tests_than_a_part_holds_are_all_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    names = [FIRST, SECOND, THIRD, "test_a"]
    assert sorted(ordered(names, "4", monkeypatch)) == sorted(names)

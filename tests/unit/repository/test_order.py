"""The table of the longest tests is of tests that exist, and puts them first."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from support.order import LONGEST, pytest_collection_modifyitems

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


def test_collection_with_a_long_test_begins_with_it() -> None:
    names = ["test_a", "test_mavsdk_offboard", "test_b", "test_conf_075_121_every_sample_once_by_mavsdk"]
    items: list[Any] = [SimpleNamespace(name=f"{name}[px4]") for name in names]
    pytest_collection_modifyitems(items)
    assert [item.name.partition("[")[0] for item in items] == [names[3], names[1], "test_a", "test_b"]

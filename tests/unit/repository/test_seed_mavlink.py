"""The table of the paper's rows over MAVLink is whole, and the tests that it names are there."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest
from support.seed_mavlink import PAYLOAD, REACHED
from support.seed_rows import ROWS

TESTS = Path(__file__).parents[2]


@cache
def functions(file: str) -> set[str]:
    tree = ast.parse((TESTS / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}


def test_every_row_is_there() -> None:
    assert list(REACHED) == [row.name for row in ROWS]


@pytest.mark.parametrize("name", REACHED)
def test_row_is_reached_or_waits_for_its_issue(name: str) -> None:
    reach = REACHED[name]
    if reach.test:
        file, _, function = reach.test.partition("::")
        assert reach.mavlink
        assert function in functions(file)
    else:
        assert name.partition("/")[0] in ("camera", "gimbal", "storage")
        assert reach.waits == PAYLOAD

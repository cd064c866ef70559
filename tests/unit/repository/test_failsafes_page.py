"""The table of docs/failsafes.md: each failure has a row, and each row names tests that exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from anafi_mav import texts
from anafi_mav.texts import OperatorText

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "failsafes.md").read_text(encoding="utf-8")

FAILURES = (
    *("commander silent", "station lost", "drone link lost", "drone link back", "battery low", "battery critical"),
    *("fence of a client", "fence of the drone", "GPS lost", "another controller", "gateway stopped"),
    *("gateway killed", "gateway hung"),
)
"""Beginnings of rows that must be there."""


def rows(heading: str) -> list[list[str]]:
    """The cells of the table below a heading, without its first two lines."""
    section = PAGE.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[2:]]


TABLE = rows("Table")


@pytest.mark.parametrize("failure", FAILURES)
def test_failure_has_a_row(failure: str) -> None:
    assert [row for row in TABLE if row[0].startswith(failure)]


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row[0])
def test_row_of_the_failsafe_table_names_existing_tests(row: list[str]) -> None:
    named = re.findall(r"`([\w/]+\.py)::(\w+)`", row[-1])
    assert named
    assert len(named) == row[-1].count("`") // 2
    for file, name in named:
        tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}
        assert name in functions


def test_dangerous_settings_of_the_page_are_the_texts() -> None:
    shown = [row[0].strip("`") for row in rows("Dangerous settings")]
    filled: list[OperatorText] = [
        texts.NO_HOME,
        texts.RETURN_OFF,
        texts.RETURN_LOW.fill(height=15.0, limit=20.0),
        texts.RETURN_AT_ONCE,
        texts.HOME_FAR.fill(distance=1200.0, limit=100.0),
        texts.GEOFENCE_OFF.fill(distance=2000.0, limit=100.0),
    ]
    assert shown == filled

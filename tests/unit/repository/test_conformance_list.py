"""The conformance table of the documentation is of this code: every item in scope is shown, by tests that exist."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

from support.conformance_items import ITEMS
from support.each import failures

TESTS = Path(__file__).parents[2]
TABLE = TESTS.parent / "docs" / "conformance.md"

FOLDERS = ("conformance", "clients")
"""Of the tests that the table is made from. A unit test may have the same file name."""

ROW = re.compile(r"\| (\d+) \| .* \| ([^|]+) \| ([^|]+) \| ([^|]*) \|")


@functools.cache
def rows() -> dict[int, tuple[str, str, str]]:
    found = (ROW.fullmatch(line) for line in TABLE.read_text(encoding="utf-8").splitlines())
    return {int(m[1]): (m[2], m[3], m[4]) for m in found if m}


@functools.cache
def named_in(path: Path) -> set[int]:
    """Numbers of the tests in a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = (node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    return {int(match[1]) for name in names if (match := re.match(r"test_conf_(\d{3})", name))}


def test_the_table_has_every_item() -> None:
    assert list(rows()) == sorted(ITEMS)


def test_every_item_is_shown() -> None:
    assert failures(ITEMS, require_shown) == ""


def require_shown(number: int) -> None:
    px4, copter, files = rows()[number]
    item = ITEMS[number]
    for flavour, cell in (("px4", px4), ("ardupilot", copter)):
        if flavour in item.flavours or not item.flavours:
            assert cell.isdecimal(), f"item {number}, {flavour}: {cell}"
        else:
            assert cell == "–", f"item {number}, {flavour}: {cell}"
    places = re.findall(r"`([^`]+)`", files)
    assert places
    for place in places:
        (path,) = (path for folder in FOLDERS for path in (TESTS / folder).rglob(place))
        assert number in named_in(path), path

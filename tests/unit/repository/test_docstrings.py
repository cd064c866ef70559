"""Docstrings of the package begin as CONTRIBUTING.md (Language) asks; what a test can see of it."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.words import forbidden_in

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = ROOT / "anafi_mav"
GENERATED = {"mavlink/dialect.py", "mav_enums.py"}
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).as_posix() not in GENERATED)

LONGEST = 90
"""Characters of a first line."""

CLAUSE = re.compile(r"(?:What|Where|Who|Whether)\b")
"""A headless clause does not say what a thing is or does."""

Described = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def docstrings(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """(line, text) of the docstring of each module, class and function."""
    for node in ast.walk(tree):
        if isinstance(node, Described) and ast.get_docstring(node) is not None:
            first = node.body[0]
            assert isinstance(first, ast.Expr)
            assert isinstance(first.value, ast.Constant)
            yield first.lineno, inspect.cleandoc(str(first.value.value))


def faults(text: str) -> list[str]:
    """Return what is wrong with a docstring's first line; empty when nothing is."""
    first, _, rest = text.partition("\n")
    found = [f"forbidden: {word}" for word in forbidden_in(first)]
    if len(first) > LONGEST:
        found.append(f"{len(first)} characters")
    if rest and not rest.startswith("\n"):
        found.append("the first line goes on in the second")
    if CLAUSE.match(first):
        found.append("begins with What, Where, Who or Whether")
    return found


def test_first_line_of_docstring_follows_the_writing_rules() -> None:
    found = [
        (path, line, text) for path in MODULES for line, text in docstrings(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert len(found) > 2000
    assert [f"{path.relative_to(ROOT)}:{line}: {fault}" for path, line, text in found for fault in faults(text)] == []


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("What a drone is asked.", "What"),
        ("Whether it flies.", "Whether"),
        ("The drone tells its height.", "tells"),
        ("x" * 91, "91 characters"),
        ("A sentence that is wrapped\nin the middle.", "second"),
    ],
)
def test_first_line_with_a_fault_is_found(text: str, fault: str) -> None:
    assert any(fault in found for found in faults(text))


def test_first_line_without_fault_is_accepted() -> None:
    assert faults("Return the height above take-off (m).\n\nWhat `tells` means is quoted, and below.") == []

"""The hand-written pages: links lead somewhere, words are those of the field, README and gate have one test command."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.words import forbidden_in

from anafi_mav.sim.world.quirks import Quirk

ROOT = Path(__file__).resolve().parents[3]
ALL = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "missions" / "README.md",
]
GENERATED = re.compile(r"^<!-- Made by ", re.MULTILINE)
WRITTEN = [page for page in ALL if not GENERATED.search(page.read_text(encoding="utf-8"))]
LARGEST_PICTURE = 300_000
"""Bytes: a page has to load over a phone's connection at an airfield."""


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def prose(page: Path) -> str:
    """The text without blocks of code."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, by GitHub's rule."""
    found = re.findall(r"^#+ (.*)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in found}


def dead_links(page: Path) -> Iterator[str]:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists() or (anchor and path.suffix == ".md" and anchor not in anchors(path)):
            yield target


@pytest.mark.parametrize("page", ALL, ids=named)
def test_page_links_lead_to_files_and_headings(page: Path) -> None:
    assert list(dead_links(page)) == []


@pytest.mark.parametrize("page", WRITTEN, ids=named)
def test_page_contains_no_forbidden_word(page: Path) -> None:
    assert list(forbidden_in(prose(page))) == []


def test_tests_of_the_threat_table_exist() -> None:
    named = set(re.findall(r"`(test_\w+)`", (ROOT / "docs" / "security.md").read_text(encoding="utf-8")))
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    assert len(named) > 20
    assert sorted(named - set(re.findall(r"def (test_\w+)", code))) == []


BEGIN = [page for page in ALL if page.parent.name == "docs" and page.name not in ("changelog.md", "conformance.md")]
"""The changelog has its own form; docs/conformance.md is made by a whole run (tests/conftest.py)."""


@pytest.mark.parametrize("page", BEGIN, ids=named)
def test_page_begins_with_its_readers(page: Path) -> None:
    title, *rest = re.sub(r"<!--.*?-->", "", page.read_text(encoding="utf-8"), flags=re.DOTALL).split("\n\n")
    assert title.startswith("# ")
    assert next(part for part in rest if part.strip()).strip().startswith("For ")


def test_forbidden_words_are_found_and_quotations_are_exempt() -> None:
    text = 'It is told by nobody. `told` and "told" and [a](told.md) are quoted.\nUntold and deskjob are other words.'
    found = list(forbidden_in(text))
    assert len(found) == 2
    assert all("told by nobody" in one for one in found)


def test_tables_of_the_extending_page_exist() -> None:
    """A name in capitals that begins a line of the package is a table to which a newcomer adds."""
    text = re.sub(r"^\|.*$", "", prose(ROOT / "docs" / "extending.md"), flags=re.MULTILINE)
    tables = set(re.findall(r"`([A-Z][A-Z_]{4,})`", text)) - set(re.findall(r"`(MAV\w+)`", text))
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "anafi_mav").rglob("*.py"))
    assert len(tables) > 5
    assert sorted(name for name in tables if not re.search(rf"^ *(?:class )?{name}\b", code, re.MULTILINE)) == []


def test_command_of_one_quirk_finds_a_test_of_each_quirk() -> None:
    """CONTRIBUTING.md's command; without a file it would start the whole suite."""
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert "grep -rli 'roll[-_]inverted' tests --include='test_*.py'" in page
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    names = [quirk.value for quirk in Quirk]
    missing = [name for name in names if not re.search(name.replace("-", "[-_]"), code, re.IGNORECASE)]
    assert missing == []


def test_pictures_are_small() -> None:
    pictures = [path for path in (ROOT / "docs").rglob("*") if path.suffix in (".png", ".jpg")]
    assert pictures
    assert [path.name for path in pictures if path.stat().st_size > LARGEST_PICTURE] == []


def test_readme_has_the_test_command_of_the_gate() -> None:
    (command,) = re.findall(r"^    (python3 .*pytest)$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert command in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()

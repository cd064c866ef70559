"""The table of texts: each fits a STATUSTEXT with its longest values, and is written as pilots read it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.words import forbidden_in

from anafi_mav import texts
from anafi_mav.services.event.event_table import EVENTS, Event
from anafi_mav.texts import (
    REASON_BYTES,
    STATUSTEXT_BYTES,
    Notice,
    NoticeTemplate,
    OperatorText,
    Reason,
    ReasonTemplate,
    Template,
)

PACKAGE = Path(texts.__file__).parent
TABLE = {name: value for name, value in vars(texts).items() if isinstance(value, OperatorText | Template)}
RELATIVE = re.compile(r"\b(who|whom|whose|which)\b")


def longest(entry: OperatorText | Template) -> str:
    return entry if isinstance(entry, OperatorText) else entry.fill(**entry.longest)


def refusals() -> Iterator[tuple[str, str]]:
    """(subject, reason) of each refusal whose texts both stand in its call."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and ast.unparse(call.func).endswith(("Refused", "Unsupported", "TooLow")):
                names = [re.match(r"texts\.([A-Z]\w+)", ast.unparse(argument)) for argument in call.args[:2]]
                found = [name[1] for name in names if name is not None and name[1] in TABLE]
                if len(found) == 2:
                    yield found[0], found[1]


REFUSALS = sorted(set(refusals()))


@pytest.mark.parametrize("name", TABLE)
def test_text_with_its_longest_values_fits_a_statustext(name: str) -> None:
    entry = TABLE[name]
    if not isinstance(entry, Notice | NoticeTemplate):
        limit = REASON_BYTES if isinstance(entry, Reason | ReasonTemplate) else STATUSTEXT_BYTES
        assert len(longest(entry).encode()) <= limit


@pytest.mark.parametrize("name", TABLE)
def test_text_is_plain(name: str) -> None:
    text = longest(TABLE[name])
    assert not list(forbidden_in(text))
    assert not RELATIVE.search(text)
    assert not text.endswith((".", " "))


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: event.name)
def test_event_is_plain(event: Event) -> None:
    for text in (event.message, event.description):
        assert not list(forbidden_in(text))
        assert not RELATIVE.search(text)


def test_refusals_of_the_code_fit_a_statustext() -> None:
    filled = [f"{longest(TABLE[what])} refused: {longest(TABLE[reason])}" for what, reason in REFUSALS]
    assert len(filled) > 60
    assert [text for text in filled if len(text.encode()) > STATUSTEXT_BYTES] == []


def test_texts_of_the_table_are_used() -> None:
    code = "\n".join(path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py") if path.name != "dialect.py")
    table = (PACKAGE / "texts.py").read_text(encoding="utf-8")
    used = set(re.findall(r"texts\.([A-Z]\w+)", code)) | {
        name for name in TABLE if len(re.findall(rf"\b{name}\b", table)) > 1
    }
    assert sorted(set(TABLE) - used) == []


def test_texts_are_different() -> None:
    values = [entry if isinstance(entry, OperatorText) else entry.pattern for entry in TABLE.values()]
    same = {value for value in values if values.count(value) > 1}
    assert sorted(same) == []

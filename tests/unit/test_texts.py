"""The table of texts: each fits a STATUSTEXT with its longest values, and is written as pilots read it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from support.words import forbidden_in

from anafi_mav import texts
from anafi_mav.services.event.event_table import EVENTS
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
        source = path.read_text(encoding="utf-8")
        for call in ast.walk(ast.parse(source)) if "texts." in source else ():
            if isinstance(call, ast.Call) and ast.unparse(call.func).endswith(("Refused", "Unsupported", "TooLow")):
                names = [re.match(r"texts\.([A-Z]\w+)", ast.unparse(argument)) for argument in call.args[:2]]
                found = [name[1] for name in names if name is not None and name[1] in TABLE]
                if len(found) == 2:
                    yield found[0], found[1]


def limit(entry: OperatorText | Template) -> int:
    """Return the bytes that a text may have."""
    return REASON_BYTES if isinstance(entry, Reason | ReasonTemplate) else STATUSTEXT_BYTES


def faults(text: str) -> list[str]:
    """Return what is not plain in a text."""
    relative = RELATIVE.search(text)
    return [*forbidden_in(text), *([relative[0]] if relative else [])]


def test_text_with_its_longest_values_fits_a_statustext() -> None:
    limited = {name: entry for name, entry in TABLE.items() if not isinstance(entry, Notice | NoticeTemplate)}
    assert len(limited) > 300
    assert {
        name: longest(entry) for name, entry in limited.items() if len(longest(entry).encode()) > limit(entry)
    } == {}


def test_text_is_plain() -> None:
    texts = {name: longest(entry) for name, entry in TABLE.items()}
    assert {name: found for name, text in texts.items() if (found := faults(text))} == {}
    assert {name: text for name, text in texts.items() if text.endswith((".", " "))} == {}


def test_event_is_plain() -> None:
    assert len(EVENTS) > 10
    texts = {event.name: (event.message, event.description) for event in EVENTS}
    assert {name: found for name, both in texts.items() if (found := [*faults(both[0]), *faults(both[1])])} == {}


def test_text_that_is_not_plain_is_found() -> None:
    assert faults("Goto refused by somebody") != []
    assert faults("Goto refused: the drone which lands") == ["which"]
    assert faults("Goto refused: drone is landing") == []


def test_refusals_of_the_code_fit_a_statustext() -> None:
    found = sorted(set(refusals()))
    filled = [f"{longest(TABLE[what])} refused: {longest(TABLE[reason])}" for what, reason in found]
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

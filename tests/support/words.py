"""The words that writing for readers may not contain (CONTRIBUTING.md, Language), with the exceptions.

Words that a person has to judge in their context (order, leg, course, come, gone, there, away, none, machine, says) are
not here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

FORBIDDEN = (
    r"helm",
    r"desk",
    r"hush\w*",
    r"trickle\w*",
    r"somebody|nobody|whoever",
    r"who (?:asks|flies|sent)",
    r"told|tells",
    r"given up|called off|taken back",
    r"anew",
    r"no more",
    r"turn of the loop",
)
"""Each has a plainer word: the table of docs/glossary.md, or the verb of the field (report, command, release)."""

_PATTERN = re.compile(rf"\b(?:{'|'.join(FORBIDDEN)})\b", re.IGNORECASE)
_QUOTED = re.compile(r"`[^`]*`|\"[^\"]*\"|“[^”]*”|\]\([^)]*\)")


def forbidden_in(text: str) -> Iterator[str]:
    """Each forbidden word of a text with its surroundings. Code, quotations and link targets are exempt."""
    plain = _QUOTED.sub(" … ", text)
    for match in _PATTERN.finditer(plain):
        yield plain[max(0, match.start() - 30) : match.end() + 30].replace("\n", " ")

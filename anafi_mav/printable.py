"""Text of a peer, made safe for a terminal and for a log.

A drone's name, a STATUSTEXT, a parameter's or a file's name may hold any character. Escape sequences would move the
cursor, change the title or answer for the user; a line break would forge a line of the log.
"""

from __future__ import annotations

import unicodedata

_UNSAFE = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""General categories: controls, formats (among them the marks that reverse the direction of writing), halves of
surrogate pairs, and separators of lines and paragraphs (Unicode Standard, table 4-4)."""


def printable(text: str) -> str:
    r"""Return `text` with each character that controls a terminal as its escape, like `\x1b`."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        _escaped(character) if unicodedata.category(character) in _UNSAFE else character for character in text
    )


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")

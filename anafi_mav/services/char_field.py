"""Texts of the drone as fields of characters of a message. No I/O."""

from __future__ import annotations


def char_field(text: str | None, size: int) -> bytes:
    """Return the characters of a text that fit into `size` bytes of UTF-8.

    No character is divided: half of one is no UTF-8, and strict readers reject the text. Empty for None.
    """
    return (text or "").encode(errors="replace")[:size].decode(errors="ignore").encode()

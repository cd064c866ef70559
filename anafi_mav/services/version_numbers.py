"""The numbers of the drone's firmware version, as messages of MAVLink have them."""

from __future__ import annotations

import re

HIGHEST = 255
"""Of a number: MAVLink has a byte for each."""

_DIGITS = 9
"""Digits that are read of a number: the drone sends any text, and Python converts no number of 4301 digits."""


def version_numbers(text: str | None) -> tuple[int, int, int]:
    """Return the first three numbers of a text like "1.8.2-rc4", each `HIGHEST` at most.

    Those that are absent are 0.
    """
    found = re.findall(r"\d+", text or "")
    first, second, third = (min(int(number[:_DIGITS]), HIGHEST) for number in [*found, "0", "0", "0"][:3])
    return first, second, third

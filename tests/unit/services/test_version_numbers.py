"""The numbers of a firmware version, which is any text of the drone."""

from __future__ import annotations

import pytest

from anafi_mav.services.version_numbers import version_numbers


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("1.8.2", (1, 8, 2)),
        ("7.7.0-rc4", (7, 7, 0)),
        ("1.8", (1, 8, 0)),
        ("1.8.2.9", (1, 8, 2)),
        ("v300.0.256", (255, 0, 255)),
        ("", (0, 0, 0)),
        (None, (0, 0, 0)),
        ("1.²", (1, 0, 0)),
        (f"1.{'9' * 5000}.3", (1, 255, 3)),
    ],
)
def test_version_numbers_are_three_of_a_byte(text: str | None, numbers: tuple[int, int, int]) -> None:
    assert version_numbers(text) == numbers

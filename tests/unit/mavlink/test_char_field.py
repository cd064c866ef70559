from __future__ import annotations

import pytest

from anafi_mav.mavlink.frames import char_field


@pytest.mark.parametrize(
    ("text", "size", "field"),
    [
        (None, 4, b""),
        ("1.8.2", 8, b"1.8.2"),
        ("1.8.2", 3, b"1.8"),
        ("karté", 6, "karté".encode()),
        ("karté", 5, b"kart"),
        ("照片", 5, "照".encode()),
        ("a\ud800b", 8, b"a?b"),
    ],
)
def test_char_field_holds_whole_characters(text: str | None, size: int, field: bytes) -> None:
    assert char_field(text, size) == field

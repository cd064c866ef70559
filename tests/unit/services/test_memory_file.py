"""The file of a drone: what is here counts while the gateway runs, whatever became of the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from anafi_mav.services.memory import Memory

SERIAL, OTHER = "PI040416DA9H839157", "PI040416DA9H839158"


async def test_unwritten_value_is_in_memory_after_a_link_loss(tmp_path: Path) -> None:
    (tmp_path / "a file").touch()
    memory = Memory(tmp_path / "a file" / "state")
    assert await memory.load(SERIAL) is not None  # the line for people
    memory = Memory(tmp_path)
    assert await memory.load(SERIAL) is None
    memory.settings["fence"] = 1
    assert memory.path is not None
    memory.path.mkdir()
    assert await memory.save() is not None
    assert await memory.load(SERIAL) is None
    assert memory.settings == {"fence": 1}


@pytest.mark.parametrize("kept", [True, False])
async def test_another_drone_has_its_own_settings(tmp_path: Path, kept: bool) -> None:
    memory = Memory(tmp_path if kept else None)
    await memory.load(SERIAL)
    memory.settings["fence"] = 1
    assert await memory.save() is None
    await memory.load(OTHER)
    assert memory.settings == {}
    await memory.load(SERIAL)
    assert memory.settings == ({"fence": 1} if kept else {})

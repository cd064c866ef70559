"""What docs/extending.md says is added by registration alone: its blocks are run, and seen to work through MAVLink."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.params import read
from support.world import world

from anafi_mav import models
from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.messages.ardrone3 import MotorFlightsStatusChanged, VibrationLevelChanged, WarningLevel
from anafi_mav.drone.status import battery
from anafi_mav.mavlink import dialect
from anafi_mav.services import flavours, system
from anafi_mav.services.parameter import parameter_service
from anafi_mav.services.telemetry import telemetry_status
from anafi_mav.sim.world import model

PAGE = Path(__file__).parents[2] / "docs" / "extending.md"

KNOWN: dict[str, Any] = {
    **{name: value for name, value in vars(dialect).items() if name.startswith("MAV")},
    "RELATIVE": dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    "MotorFlightsStatusChanged": MotorFlightsStatusChanged,
    "VibrationLevelChanged": VibrationLevelChanged,
    "WarningLevel": WarningLevel,
    "read": read,
    "world": world,
}
"""What the second block of a section takes from the test's surroundings."""


def sections() -> dict[str, list[str]]:
    """The Python blocks of each section by its title."""
    parts = re.split(r"^## (.*)$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    blocks = {
        title: re.findall(r"^```python\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)
        for title, text in zip(parts[1::2], parts[2::2], strict=True)
    }
    return {title: found for title, found in blocks.items() if found}


@pytest.fixture
def _restored(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The tables of the program are as before when a test ends."""
    monkeypatch.setattr(system, "AUTOPILOT_SERVICES", system.AUTOPILOT_SERVICES)
    monkeypatch.setattr(parameter_service, "NATIVE_NAMES", parameter_service.NATIVE_NAMES)
    monkeypatch.setattr(telemetry_status, "STREAMS", telemetry_status.STREAMS)
    monkeypatch.setattr(battery.Battery, "NOTHING", battery.Battery.NOTHING)
    monkeypatch.setattr(battery.Battery, "REDUCERS", battery.Battery.REDUCERS)
    tables: list[dict[Any, Any]] = [
        wire._CODECS,
        parameter_service.NAME_TABLES,
        flavours.FLAVOURS,
        models.MODELS,
        models.BY_ID,
        model.MODELS,
    ]
    before = [dict(table) for table in tables]
    yield
    for table, content in zip(tables, before, strict=True):
        table.clear()
        table.update(content)


def test_page_has_an_example_of_each_kind() -> None:
    titles = ["Add a command", "Add a parameter", "Add a message", "Change a default rate", "Show a new ARSDK value"]
    titles += ["Add a flavour", "Add a drone model"]
    assert list(sections()) == titles
    assert all(len(blocks) == 2 for blocks in sections().values())


@pytest.mark.usefixtures("_restored")
@pytest.mark.parametrize("title", sections())
async def test_example_of_the_page_works_through_mavlink(title: str) -> None:
    addition, shown = sections()[title]
    added: dict[str, Any] = {"__name__": "addition"}
    exec(compile(addition, f"{PAGE.name}: {title}", "exec", dont_inherit=True), added)
    scope = {**added, **KNOWN}
    exec(compile(shown, f"{PAGE.name}: {title}, shown", "exec", dont_inherit=True), scope)
    (test,) = (value for name, value in scope.items() if name.startswith("test_"))
    await test()

"""Firmware quirks: their names, where they are written, and that a wrong name is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.world import loopback

from anafi_mav.cli.addresses import Reservations
from anafi_mav.cli.run import place
from anafi_mav.config import from_text
from anafi_mav.errors import ConfigError
from anafi_mav.sim import DroneSpec, scenario
from anafi_mav.sim.world import quirks
from anafi_mav.sim.world.quirks import QUIRKS, Quirk

PAGE = Path(__file__).resolve().parents[4] / "docs" / "simulator.md"


def test_quirk_page_lists_each_quirk_with_its_description() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert [quirk for quirk in Quirk if f"| `{quirk.value}` | {quirk.description} |" not in page] == []


def test_unknown_quirk_is_refused_with_the_known_names() -> None:
    assert quirks.named(["no-flight-id"], "x") == {Quirk.NO_FLIGHT_ID}
    with pytest.raises(ConfigError, match=r"x: expected one of landing-ignores-takeoff, .*, got 'no-wings'"):
        quirks.named(["no-flight-id", "no-wings"], "x")
    with pytest.raises(ConfigError, match=r"^firmware_quirk: expected one of"):
        DroneSpec(firmware_quirks=("no-wings",))


def test_configuration_with_unknown_quirk_names_the_key() -> None:
    text = f"drones: [{{name: a, sysid: 1, sim: {{address: {loopback()}, firmware_quirks: [no-wings]}}}}]"
    with Reservations() as reservations, pytest.raises(ConfigError, match=r"^drones\[0\]\.sim\.firmware_quirks: "):
        place(from_text(text, "fleet.yaml"), reservations)


def test_scenario_step_with_quirks_names_unknown_ones() -> None:
    assert scenario.from_text("steps: [{at: 1, firmware_quirks: [flag-remembered]}]", "s.yaml").steps
    with pytest.raises(ConfigError, match=r"^steps\[0\]\.firmware_quirks\[1\]: expected one of"):
        scenario.from_text(f"steps: [{{at: 1, firmware_quirks: [{next(iter(QUIRKS))}, no-wings]}}]", "s.yaml")

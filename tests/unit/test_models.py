"""A drone model is one record, from which every room takes what it needs before the drone has reported anything."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import msgspec
import pytest

from anafi_mav import models
from anafi_mav.config import from_mapping
from anafi_mav.drone import MODELS as ANNOUNCED
from anafi_mav.errors import ConfigError
from anafi_mav.plans.plan import WAYPOINT, Item, Plan
from anafi_mav.plans.translation.check import check
from anafi_mav.sim import DroneSpec
from anafi_mav.sim.world.model import MODELS as SIMULATED
from anafi_mav.sim.world.model import model_of


@pytest.fixture
def _restored() -> Iterator[None]:
    """The tables of models; what a test adds to them is removed at its end."""
    tables: tuple[dict[Any, Any], ...] = (models.MODELS, models.BY_ID, SIMULATED)
    before = [dict(table) for table in tables]
    yield
    for table, content in zip(tables, before, strict=True):
        table.clear()
        table.update(content)


def scout(**more: Any) -> models.Model:
    """A model that Parrot does not sell: as the 4K, but for its key and number."""
    return msgspec.structs.replace(models.MODELS["4k"], id=0x09FF, key="scout", title="ANAFI Scout", **more)


def configured(model: str, skycontroller: int | None = None) -> object:
    sim = {"model": model} if skycontroller is None else {"model": model, "skycontroller": skycontroller}
    return from_mapping({"drones": [{"name": "a", "sysid": 1, "sim": sim}]}).drones[0].sim


def test_models_are_known_by_key_and_by_number() -> None:
    assert list(models.MODELS) == ["4k", "thermal", "usa", "ai", "ua"]
    assert [f"{id:04x}" for id in models.BY_ID] == ["0914", "0919", "091a", "091b", "091e"]
    assert ANNOUNCED is models.BY_ID
    assert models.simulated() == list(models.planned()) == list(SIMULATED) == ["4k", "thermal", "usa", "ai"]


@pytest.mark.usefixtures("_restored")
@pytest.mark.parametrize("change", [{}, {"id": 0x09FE}, {"key": "other"}])
def test_model_with_a_known_key_or_number_is_refused(change: dict[str, Any]) -> None:
    models.add(scout())
    with pytest.raises(ValueError, match="there is one with this key or number"):
        models.add(msgspec.structs.replace(scout(), **change))


@pytest.mark.usefixtures("_restored")
def test_added_model_is_known_in_every_room() -> None:
    models.add(scout(skycontrollers=(4,)))
    SIMULATED["scout"] = replace(SIMULATED["4k"], name="scout")
    assert ANNOUNCED[0x09FF].title == "ANAFI Scout"
    assert configured("scout", 4)
    with pytest.raises(ConfigError, match="expected 4: a Skycontroller 3 cannot fly an scout"):
        configured("scout", 3)
    assert model_of("scout").product_id == 0x09FF
    with pytest.raises(ConfigError, match="expected another model than scout, which a Skycontroller 3 cannot fly"):
        DroneSpec(model="scout", skycontroller=3)
    plan = Plan((Item(WAYPOINT, 3, (0.0, None, None, None, 48.0, 2.0, 20.0)),))
    assert check(plan, models.planned()["scout"]).distance


@pytest.mark.usefixtures("_restored")
def test_simulated_model_without_figures_names_the_missing_ones() -> None:
    models.add(scout())
    with pytest.raises(
        ConfigError, match=re.escape("no figures of 'scout': anafi_mav/sim/world/model.py lacks its entry")
    ):
        DroneSpec(model="scout")
    with pytest.raises(ValueError, match="scout: a simulated drone needs lenses"):
        replace(SIMULATED["4k"], name="scout", lenses=())


@pytest.mark.usefixtures("_restored")
def test_simulated_model_with_incomplete_record_names_the_gaps() -> None:
    models.add(scout(lens=None, plan_figures=None))
    with pytest.raises(ValueError, match="scout: a simulated drone needs plan_figures and lens"):
        replace(SIMULATED["4k"], name="scout")
    with pytest.raises(ValueError, match=r"ua: anafi_mav/models.py has no record that says `simulated=True`"):
        replace(SIMULATED["4k"], name="ua")


@pytest.mark.parametrize("name", ["ua", "bebop"])
def test_model_without_simulation_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=f"expected 4k, thermal, usa or ai, got '{name}'"):
        configured(name)
    with pytest.raises(ConfigError, match=f"expected one of 4k, thermal, usa, ai, got '{name}'"):
        DroneSpec(model=name)


def test_plan_of_a_model_without_figures_is_not_checked() -> None:
    with pytest.raises(ValueError, match="ANAFI UA: it is not known what plans it flies"):
        check(Plan((Item(WAYPOINT, 3, (0.0, None, None, None, 48.0, 2.0, 20.0)),)), models.MODELS["ua"])


def test_unknown_product_number_gets_a_neutral_record() -> None:
    unknown = models.unknown(0x0ABC)
    assert (unknown.key, unknown.title, unknown.plan_version) == ("0x0abc", "unknown model", None)
    assert (unknown.lens, unknown.battery_cells, unknown.firmware) == (None, None, ())

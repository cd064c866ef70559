"""Scenario files of `anafi-mav sim` and `run`."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from anafi_mav.errors import ConfigError
from anafi_mav.sim import scenario
from anafi_mav.sim.scenario import Scenario


def load(key_path: str, path: Path, addresses: Collection[str]) -> Scenario:
    """Return the scenario in a file, for drones at these addresses.

    Raises `ConfigError` that names key and file.
    """
    try:
        found = scenario.load(path)
        found.check_drones(addresses)
    except ConfigError as error:
        said = str(error)
        raise ConfigError(key_path, said if str(path) in said else f"{path}: {said}") from error
    return found

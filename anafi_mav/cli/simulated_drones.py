"""Simulated drones of a configuration: their addresses, and the fleet for the simulator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from anafi_mav.cli import options
from anafi_mav.cli.addresses import SHARED, Ports, Reservations
from anafi_mav.cli.scenarios import load as load_scenario
from anafi_mav.config import Config, DroneConfig, SimConfig
from anafi_mav.errors import ConfigError
from anafi_mav.sim.world import quirks
from anafi_mav.sim.world.model import MODELS


def place(config: Config, reservations: Reservations) -> tuple[Config, dict[str, Any]]:
    """Give each simulated drone an address; there is one at least. Raises `ConfigError`.

    Returns the configuration for the gateway, which knows addresses only, and the fleet for the simulator.
    """
    simulated = {index: drone.sim for index, drone in enumerate(config.drones) if drone.sim is not None}
    real = {drone.address for drone in config.drones}
    places: dict[int, tuple[str, Ports]] = {}
    # Addresses that the user wrote down come first, so that none of them is chosen for another drone.
    for index, sim in sorted(simulated.items(), key=lambda item: item[1].address is None):
        key_path, port = f"drones[{index}].sim", config.drones[index].discovery_port
        if sim.address is None:
            places[index] = reservations.choose(key_path, port, sim.http_port, sim.rtsp_port, avoid=real)
        else:
            places[index] = (
                sim.address,
                reservations.take_configured(f"{key_path}.address", sim.address, port, sim.http_port, sim.rtsp_port),
            )
    drones = tuple(
        _placed(drone, *places[index]) if index in places else drone for index, drone in enumerate(config.drones)
    )
    shared = {address for address, count in Counter(address for address, _ in places.values()).items() if count > 1}
    for index, sim in simulated.items():
        if sim.scenario is not None and places[index][0] in shared:
            problem = f"expected none: the drone shares {SHARED} with others, and a scenario is for an address"
            raise ConfigError(f"drones[{index}].sim.scenario", problem)
        quirks.named(sim.firmware_quirks, f"drones[{index}].sim.firmware_quirks")
    first = next(iter(simulated.values()))
    fleet = {
        "speed": first.speed,
        "seed": next((sim.seed for sim in simulated.values() if sim.seed is not None), None),
        "drones": [_entry(config.drones[index], sim, *places[index]) for index, sim in simulated.items()],
        "scenarios": _scenarios(simulated, {index: address for index, (address, _) in places.items()}),
    }
    return msgspec.structs.replace(config, drones=drones), fleet


def _placed(drone: DroneConfig, address: str, ports: Ports) -> DroneConfig:
    """A simulated drone as the gateway sees it: one like any other."""
    return msgspec.structs.replace(
        drone, address=address, discovery_port=ports.discovery, http_port=ports.http, rtsp_port=ports.rtsp, sim=None
    )


def _entry(drone: DroneConfig, sim: SimConfig, address: str, ports: Ports) -> dict[str, Any]:
    """A drone as `anafi-mav sim --fleet` reads it.

    One with ports of its own has any free ports for its datagrams, and a serial number of its system id: that of its
    address would be another drone's too.
    """
    own_ports = ports.discovery != drone.discovery_port
    free = {"handshake_port": 0, "c2d_port": 0, "serial": f"{MODELS[sim.model].serial_prefix}{drone.sysid:06d}"}
    return {
        **(free if own_ports else {}),
        "name": drone.name,
        "model": sim.model,
        "address": address,
        "home": sim.home,
        "discovery_port": ports.discovery,
        "http_port": ports.http,
        "rtsp_port": ports.rtsp,
        "versions": (1, sim.protocol),
        "telemetry_rate": sim.telemetry_rate,
        "skycontroller": sim.skycontroller,
        "storage": options.size("storage", sim.storage) if isinstance(sim.storage, str) else sim.storage,
        "wind": {} if sim.wind is None else _without_none(msgspec.structs.asdict(sim.wind)),
        "firmware_quirks": sim.firmware_quirks,
    }


def _without_none(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _scenarios(simulated: Mapping[int, SimConfig], addresses: Mapping[int, str]) -> dict[str, str]:
    """Return the scenario files by address.

    Each file is read now, so that a mistake is reported before anything is started.
    """
    paths: dict[str, str] = {}
    for index, sim in simulated.items():
        if sim.scenario is None:
            continue
        load_scenario(f"drones[{index}].sim.scenario", Path(sim.scenario), set(addresses.values()))
        paths[addresses[index]] = str(Path(sim.scenario).absolute())
    return paths

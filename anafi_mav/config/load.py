"""Reads a configuration: YAML text → mapping → the structs of `schema`, checked as a whole.

Whatever is wrong becomes one `ConfigError` of one line, "drones[1].sysid: expected a whole number from 1 to 250,
got 'x'". Of msgspec's own error only the place is used; what was expected there stands in the schema.
"""

from __future__ import annotations

import difflib
import ipaddress
import re
import reprlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec

from anafi_mav import documents, models
from anafi_mav.config.schema import (
    MAVSDK_SYSID,
    MAX_SYSID,
    Config,
    DroneConfig,
    HttpConfig,
    SimConfig,
    VideoConfig,
    alternatives,
)
from anafi_mav.errors import ConfigError

_HOST_NAME = re.compile(r"(?!-)[A-Za-z0-9-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9-]{1,63}(?<!-))*\.?")
"""RFC 1123 §2.1, without the limit on the whole length: the schema has a smaller one."""


def load(path: Path) -> Config:
    """The configuration in the file at `path`; paths in it are made relative to its folder.

    Raises `ConfigError`.
    """
    config = _from_document(documents.read(path), str(path))
    return msgspec.structs.replace(config, drones=tuple(_in_folder(path.parent, drone) for drone in config.drones))


def _in_folder(folder: Path, drone: DroneConfig) -> DroneConfig:
    if drone.sim is None or drone.sim.scenario is None:
        return drone
    sim = msgspec.structs.replace(drone.sim, scenario=str(folder / drone.sim.scenario))
    return msgspec.structs.replace(drone, sim=sim)


def from_text(text: str | bytes, source: str) -> Config:
    """The configuration in YAML `text`; `source` names it in messages. Raises `ConfigError`."""
    return _from_document(documents.parse(text, source), source)


def _from_document(document: object, source: str) -> Config:
    try:
        return from_mapping({} if document is None else document)
    except ConfigError as error:
        raise ConfigError(error.key_path, error.problem, source) from error


def from_mapping(document: object) -> Config:
    """The configuration in a mapping of plain values, as a YAML or JSON parser returns it.

    Raises `ConfigError`.
    """
    try:
        config = msgspec.convert(document, Config)
    except msgspec.ValidationError as error:
        raise _explain(document, _steps(str(error))) from error
    for key_path, problem in _contradictions(config):
        raise ConfigError(key_path, problem)
    return config


def remarks(config: Config) -> list[str]:
    """Return a line for each value that is legal but probably not meant."""
    return [
        f"drones[{index}].sysid: {MAVSDK_SYSID} is the default system id of MAVSDK: "
        "such a client will not see this drone"
        for index, drone in enumerate(config.drones)
        if drone.sysid == MAVSDK_SYSID
    ]


_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = 60
_short.maxdict = _short.maxlist = _short.maxlevel = 3


def _shown(value: object) -> str:
    """`value` as the user wrote it, nearly: bounded however large it is."""
    match value:
        case None:
            return "nothing"
        case bool():
            return "true" if value else "false"
        case _:
            return documents.one_line(_short.repr(value))


def _key_path(steps: list[str | int]) -> str:
    """["drones", 1, "sysid"] → "drones[1].sysid"."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).removeprefix(".")


def _steps(message: str) -> list[str | int]:
    """Return the place that a message of msgspec names, step by step.

    "… - at `$.drones[1].sysid`" → ["drones", 1, "sysid"].
    """
    place = re.search(r"`\$([^`]*)`$", message)
    found = re.findall(r"\.([A-Za-z_]\w*)|\[(\d+)\]", place[1] if place else "")
    return [name or int(index) for name, index in found]


def _inner(node: Any, value: object = None) -> Any:
    """Return the type below its annotations and below "or None".

    Of several types the one that `value`, a mapping, needs.
    """
    while isinstance(node, msgspec.inspect.Metadata | msgspec.inspect.UnionType):
        if isinstance(node, msgspec.inspect.Metadata):
            node = node.type
            continue
        kinds = [kind for kind in node.types if not isinstance(kind, msgspec.inspect.NoneType)]
        structs = [kind for kind in kinds if isinstance(_inner(kind), msgspec.inspect.StructType)]
        node = (structs if structs and isinstance(value, Mapping) else kinds)[0]
    return node


def _expected(node: Any) -> str:
    """Return the schema's description of what a value of this type must be."""
    while isinstance(node, msgspec.inspect.Metadata | msgspec.inspect.UnionType):
        if isinstance(node, msgspec.inspect.Metadata) and node.extra and "expected" in node.extra:
            return str(node.extra["expected"])
        node = node.type if isinstance(node, msgspec.inspect.Metadata) else _inner(node)
    if isinstance(node, msgspec.inspect.StructType):
        return f"a mapping with the keys {', '.join(field.name for field in node.fields)}"
    raise AssertionError(f"the schema does not say what {node} must be")


def _explain(document: object, steps: list[str | int]) -> ConfigError:
    """Walks schema and document side by side to `steps`, where msgspec refused the value."""
    node: Any = msgspec.inspect.type_info(Config)
    value: Any = document
    for step in steps:
        kind = _inner(node, value)
        if isinstance(step, int):
            node = kind.item_types[step] if isinstance(kind, msgspec.inspect.TupleType) else kind.item_type
        else:
            node = next(field.type for field in kind.fields if field.name == step)
        value = value[step]
    kind = _inner(node, value)
    if isinstance(kind, msgspec.inspect.StructType) and isinstance(value, Mapping):
        names = [field.name for field in kind.fields]
        for key in value:
            if key not in names:
                near = difflib.get_close_matches(str(key), names, n=1)
                hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(names)}"
                return ConfigError(_key_path([*steps, _plain_key(key)]), f"unknown key; {hint}")
        for field in kind.fields:
            if field.required and field.name not in value:
                return ConfigError(_key_path([*steps, field.name]), f"missing; expected {_expected(field.type)}")
    return ConfigError(_key_path(steps), f"expected {_expected(node)}, got {_shown(value)}")


def _plain_key(key: object) -> str:
    """A key the user invented, fit for a key path."""
    text = key if isinstance(key, str) else _shown(key)
    return text if re.fullmatch(r"[\w-]{1,60}", text) else _shown(text)


def _is_ipv4(text: str) -> bool:
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True


def _is_host(text: str) -> bool:
    """True for an IPv4 address or a host name.

    A text that ends in a number is an address or wrong (WHATWG URL §3.5, ends in a number).
    """
    if text.rstrip(".").rpartition(".")[2].isdigit():
        return _is_ipv4(text)
    return _HOST_NAME.fullmatch(text) is not None


def _twice(what: str, values: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    first: dict[object, str] = {}
    for key_path, value in values.items():
        if value in first:
            yield key_path, f"expected {what} of its own, {_shown(value)} is already at {first[value]}"
        first.setdefault(value, key_path)


def _contradictions(config: Config) -> Iterator[tuple[str, str]]:
    """Yield (key path, problem) of each broken rule that no single value shows."""
    drones = {f"drones[{index}]": drone for index, drone in enumerate(config.drones)}
    for key_path, drone in drones.items():
        yield from _of_one_drone(key_path, drone)
    endpoints = {
        f"endpoints[{index}]": entry if isinstance(entry, str) else entry.url
        for index, entry in enumerate(config.endpoints)
    }
    yield from _twice("an endpoint", endpoints)
    yield from _twice("a sysid", {f"{key_path}.sysid": drone.sysid for key_path, drone in drones.items()})
    if config.sysids is not None:
        low, high = map(int, config.sysids.split("-"))
        if not 1 <= low <= high <= MAX_SYSID:
            yield "sysids", f"expected a range like 1-80 from 1 to {MAX_SYSID}, got {_shown(config.sysids)}"
        for key_path, drone in drones.items():
            if not low <= drone.sysid <= high:
                yield f"{key_path}.sysid", f"expected one of sysids, {config.sysids}, got {drone.sysid}"
    serials = {f"{key_path}.serial": drone.serial for key_path, drone in drones.items() if drone.serial is not None}
    yield from _twice("a serial", serials)
    yield from _twice("a name", {f"{key_path}.name": drone.name for key_path, drone in drones.items()})
    simulated = {f"{path}.sim": drone.sim for path, drone in drones.items() if drone.sim is not None}
    bound = {f"{path}.address": sim.address for path, sim in simulated.items() if sim.address is not None}
    met = {
        (f"{path}.sim.address" if drone.sim else f"{path}.address"): _place(address, drone)
        for path, drone in drones.items()
        if (address := drone.sim.address if drone.sim else drone.address) is not None
    }
    yield from _twice("an address", bound)
    yield from _twice("an address and discovery_port", met)
    http = config.http_server
    if http is not None and not _is_host(http.host):
        yield "http.host", _wrong(HttpConfig, "host", http.host)
    video = config.video_server
    for key in ("host", "public_host"):
        host = None if video is None else getattr(video, key)
        if host is not None and not _is_host(host):
            yield f"video.{key}", _wrong(VideoConfig, key, host)
    yield from _agree("speed", {path: sim.speed for path, sim in simulated.items()})
    yield from _agree("seed", {path: sim.seed for path, sim in simulated.items() if sim.seed is not None})


def _place(address: str, drone: DroneConfig) -> str:
    """Return the text that identifies a drone's address.

    The same address on another interface is another place.
    """
    return f"{address}:{drone.discovery_port}" + (f" on {drone.interface}" if drone.interface else "")


def _agree(key: str, values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """All simulated drones live in one process with one clock and one source of randomness."""
    for key_path, value in values.items():
        first, common = next(iter(values.items()))
        if value != common:
            yield f"{key_path}.{key}", f"expected {common:g} as at {first}.{key}, got {value:g}"


def _of_one_drone(key_path: str, drone: DroneConfig) -> Iterator[tuple[str, str]]:
    if (drone.address is None) == (drone.sim is None):
        got = "neither" if drone.sim is None else "both"
        yield key_path, f"expected either address or sim, got {got}"
    for key in ("http_port", "rtsp_port"):
        if drone.sim is not None and getattr(drone, key) is not None:
            yield f"{key_path}.{key}", f"expected it in sim, got {getattr(drone, key)} here"
    if drone.address is not None and not _is_host(drone.address):
        yield f"{key_path}.address", _wrong(DroneConfig, "address", drone.address)
    if drone.sim is not None:
        yield from _of_model(f"{key_path}.sim", drone.sim)
    if drone.sim is not None and drone.serial is not None:
        yield f"{key_path}.serial", "expected none for a simulated drone, whose serial number follows from its address"
    if drone.sim is not None and drone.interface is not None:
        yield f"{key_path}.interface", "expected none for a simulated drone, which lives on this machine"
    if drone.sim is not None and drone.sim.address is not None and not _is_ipv4(drone.sim.address):
        yield f"{key_path}.sim.address", _wrong(SimConfig, "address", drone.sim.address)


def _of_model(key_path: str, sim: SimConfig) -> Iterator[tuple[str, str]]:
    known = models.simulated()
    if sim.model not in known:
        yield f"{key_path}.model", f"expected {alternatives(known)}, got {_shown(sim.model)}"
        return
    controllers = models.MODELS[sim.model].skycontrollers
    if sim.skycontroller is not None and sim.skycontroller not in controllers:
        wanted = alternatives([str(one) for one in controllers])
        problem = f"a Skycontroller {sim.skycontroller} cannot fly an {sim.model}"
        yield f"{key_path}.skycontroller", f"expected {wanted}: {problem}"


def _wrong(struct: type[msgspec.Struct], key: str, value: object) -> str:
    info = msgspec.inspect.type_info(struct)
    assert isinstance(info, msgspec.inspect.StructType)
    wanted = next(_expected(field.type) for field in info.fields if field.name == key)
    return f"expected {wanted}, got {_shown(value)}"

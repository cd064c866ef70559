"""`anafi-mav run --check`: looks whether a gateway could start, without starting one.

It opens what a start opens (keys, endpoints, video and web server) and closes it again, so that it and a start cannot
disagree. Nothing is written: of the folders it looks whether they could be. No drone is connected to. An endpoint that
connects (`tcpout`, `serial`) is open for a moment.
"""

from __future__ import annotations

import importlib.util
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

from anafi_mav import __version__
from anafi_mav.cli import start_warnings
from anafi_mav.cli.addresses import Reservations
from anafi_mav.cli.doctor import Finding, ok, wrong
from anafi_mav.config import Config
from anafi_mav.errors import ConfigError
from anafi_mav.gateway import Gateway, download_folder
from anafi_mav.state_lock import check_folder
from anafi_mav.units import counted

__all__ = ["findings", "wrong"]

Place = Callable[[Config, Reservations], tuple[Config, dict[str, Any] | None]]
"""Gives simulated drones their addresses. Raises `ConfigError`."""


async def findings(
    config: Config, place: Place, located: Callable[[ConfigError], ConfigError] = lambda error: error
) -> list[Finding]:
    """Return a line for each thing that a start needs.

    `located` returns an error with the option of the command line that its key is from.
    """
    drones, endpoints = counted(len(config.drones), "drone"), counted(len(config.endpoints), "endpoint")
    found = [versions(), ok("configuration", f"{drones}, {endpoints}")]
    found += [ok("configuration", f"warning: {warning.text}") for warning in start_warnings.warnings_of(config)]
    with Reservations() as reservations:
        try:
            placed, _ = place(config, reservations)
        except ConfigError as error:
            return [*found, wrong(located(error).key_path, error.problem, "mend it at that key")]
    gateway = Gateway(placed, saves=False)
    try:
        await gateway.open()
    except ConfigError as error:
        return [*found, wrong(located(error).key_path, error.problem, "mend it at that key, or free what it names")]
    try:
        problems = gateway.state_problems()
        found += [wrong("state", problem, "give the gateway a folder that it can write") for problem in problems]
        if not problems:
            found.append(ok("state", "folder can be written, and no other gateway uses it"))
        found += [
            wrong("fabric", problem, "a gateway needs its router, and each drone an id of its own")
            for problem in await gateway.endpoint_problems()
        ]
        found += [ok("open", line) for line in gateway.lines()]
        if config.recording.folder is not None:
            found.append(ok("recording", f"folder can be written: {config.recording.folder}"))
        downloads = download_folder(config.media)
        if downloads is not None:
            found.append(_writable("media.download_folder", downloads))
    finally:
        await gateway.close()
    return found


def _writable(key: str, folder: Path) -> Finding:
    """Return whether files can be made in a folder, which may be absent."""
    try:
        check_folder(folder)
    except OSError as error:
        return wrong(key, f"{folder}: {error.strerror}", "name a folder that this user can write")
    return ok(key, f"folder can be written: {folder}")


def versions() -> Finding:
    """Return the versions of what runs."""
    picture = "with" if importlib.util.find_spec("aiortc") else "without"
    facts = f"anafi-mav {__version__}, Python {platform.python_version()}, {platform.system()} {platform.release()}"
    return ok("versions", f"{facts}, {picture} live picture in browsers (aiortc)")

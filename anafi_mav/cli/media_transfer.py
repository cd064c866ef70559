"""The actions of `anafi-mav media`."""

from __future__ import annotations

import argparse
import os
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

from anafi_mav import access_token
from anafi_mav.cli import consent, options
from anafi_mav.cli.media import GATEWAY
from anafi_mav.cli.plan_options import sysid_of
from anafi_mav.cli.terminal import complain, progress, say, say_json, say_table
from anafi_mav.drone.payload.media import MediaClient, MediaItem, Resource
from anafi_mav.drone.payload.media_copy import copy, iso_time
from anafi_mav.drone.payload.media_index import by_day
from anafi_mav.drone.rest import Rest
from anafi_mav.errors import AnafiMavError, CommandRejected, ConfigError, LinkLost, RemoteProtocolError
from anafi_mav.relay.uri_host import is_loopback
from anafi_mav.state_lock import state_folder

MAX_PORT = 65535


async def list_media(arguments: argparse.Namespace) -> int:
    """Print the files."""
    async with _client(arguments) as client:
        files = _chosen(await client.list(newest_first=False), arguments.names)
    if arguments.json:
        say_json([_facts(file) for file in files])
        return 0
    rows = [
        (file.date, file.resource_id, f"{file.size / 1e6:.1f}", iso_time(file.datetime) or "", _place(file))
        for file in files
    ]
    say_table(("day", "file", "MB", "time", "place"), rows, right={2})
    say(f"{len(files)} files, {sum(file.size for file in files) / 1e6:.1f} MB")
    return 0


async def download_media(arguments: argparse.Namespace) -> int:
    """Copy the files; 1 when one of them could not be copied."""
    failed = copied = 0
    async with _client(arguments) as client:
        files = _chosen(await client.list(newest_first=False), arguments.names)
        for number, file in enumerate(files, 1):
            try:
                with progress(f"{number}/{len(files)} {file.resource_id}", file.size) as show:
                    path = await copy(client, file, arguments.folder, show, _say_interruption)
            except (CommandRejected, RemoteProtocolError) as error:
                complain(f"{file.resource_id}: {error}")
                failed += 1
                continue
            except LinkLost as error:
                raise LinkLost(f"{error.reason}; call it again to continue at this place") from error
            except OSError as error:  # ours that are no errors of the disk are above
                if isinstance(error, AnafiMavError):
                    raise
                raise ConfigError("FOLDER", f"cannot write to {arguments.folder}: {error.strerror}") from error
            if path is not None:
                say(str(path))
                copied += 1
    say(
        f"{copied} files copied, {len(files) - copied - failed} were there already"
        + f", {failed} failed" * bool(failed)
    )
    return 1 if failed else 0


def _say_interruption(error: AnafiMavError, pause: float) -> None:
    complain(f"{error}; again in {pause:g} s", style="yellow")


async def delete_media(arguments: argparse.Namespace) -> int:
    """Delete the files, once the user has agreed."""
    if bool(arguments.names) == arguments.all:
        raise ConfigError("NAME", "expected files or days to delete, or --all")
    async with _client(arguments) as client:
        files = _chosen(await client.list(newest_first=False), arguments.names)
        if files and not arguments.yes:
            size = sum(file.size for file in files) / 1e6
            if not consent.confirmed(f"delete {len(files)} files ({size:.1f} MB) on the drone?"):
                complain("no file deleted", style="yellow")
                return 1
        for file in files:
            await client.delete_resource(file.resource_id)
            say(f"deleted {file.resource_id}")
    say(f"{len(files)} files deleted")
    return 0


def _chosen(items: Sequence[MediaItem], names: Sequence[str]) -> list[Resource]:
    """Return the files with these names or days, oldest first.

    Raises `ConfigError` for a name that no file has.
    """
    files = [
        file for day in by_day([file for item in items for file in item.resources]).values() for file in day.values()
    ]
    known = {file.resource_id for file in files} | {file.date for file in files}
    if unknown := [name for name in names if name not in known]:
        raise ConfigError("NAME", f"the drone has no file or day {', '.join(unknown)}")
    return [file for file in files if not names or file.resource_id in names or file.date in names]


def _facts(file: Resource) -> dict[str, Any]:
    place = file.gps if file.gps is not None and file.gps.is_known else None
    return {
        "day": file.date,
        "file": file.resource_id,
        "media_id": file.media_id,
        "type": file.type,
        "format": file.format,
        "size": file.size,
        "time": iso_time(file.datetime),
        "md5": file.md5,
        "storage": file.storage,
        "duration": None if file.duration is None else file.duration / 1000.0,
        "place": None
        if place is None
        else {"latitude": place.latitude, "longitude": place.longitude, "altitude_amsl": place.altitude_amsl},
    }


def _place(file: Resource) -> str:
    if file.gps is None or not file.gps.is_known:
        return ""
    height = "" if file.gps.altitude_amsl is None else f", {file.gps.altitude_amsl:.0f} m"
    return f"{file.gps.latitude:.6f} {file.gps.longitude:.6f}{height}"


# -- the way to the drone


@asynccontextmanager
async def _client(arguments: argparse.Namespace) -> AsyncIterator[MediaClient]:
    sysid = sysid_of(arguments)
    host, port = _gateway_of(arguments.gateway or GATEWAY)
    token = _token_for(host)
    rest = Rest(host, port, prefix=f"/drone/{await _connected(host, port, sysid, token)}", token=token)
    try:
        yield MediaClient(rest)
    finally:
        await rest.close()


async def _connected(host: str, port: int, sysid: int | None, token: str) -> int:
    """Return the system id of a gateway's drone; None: of its only connected one."""
    rest = Rest(host, port, token=token)
    try:
        listed = await rest.json("GET", "/drones")
    except LinkLost as error:
        # The reason of a `Rest` names a drone's web server, which this is not.
        problem = error.__cause__ or error.reason
        raise LinkLost(f"no gateway answers at {host}:{port} ({problem}); its port is `http.port`") from error
    finally:
        await rest.close()
    drones = [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []
    found = [one["sysid"] for one in drones if one.get("connected") and isinstance(one.get("sysid"), int)]
    if len(found) != 1 if sysid is None else sysid not in found:
        known = ", ".join(str(sysid) for sysid in found) or "none"
        raise ConfigError("--sysid", f"expected the system id of a connected drone (connected: {known})")
    return found[0] if sysid is None else sysid


def _token_for(host: str) -> str:
    """Return the token of the gateway there; empty where none is known.

    That of this computer's gateway goes to this computer only.
    """
    given = os.environ.get(access_token.VARIABLE, "")
    if given or not is_loopback(host):
        return given
    own = access_token.read_token(state_folder(None))
    return "" if own is None else own.text


def _gateway_of(text: str) -> tuple[str, int]:
    """Return host and port. Raises `ConfigError`."""
    host, _, tail = text.rpartition(":")
    port = options.integer("--gateway", tail, "HOST:PORT")
    if not host or not 0 < port <= MAX_PORT:
        raise ConfigError("--gateway", f"expected HOST:PORT, got {text!r}")
    return options.host("--gateway", host, "HOST:PORT"), port

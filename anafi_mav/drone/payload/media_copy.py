"""Copies of the drone's media in folders of this computer.

A copy is `<day>/<file>`. Its sidecar is `<file>.json`: what the file is, when and where it was made, and the attitude
of the camera. A file that was copied before is not copied again.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
from collections.abc import AsyncGenerator, Callable, Iterator
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any, Protocol, TypeVar

from msgspec.structs import replace

from anafi_mav.disk_writer import DiskWriter
from anafi_mav.drone.payload.media_file import UNKNOWN, Place, Resource, fetch, file_name
from anafi_mav.drone.payload.media_part import WRITTEN
from anafi_mav.errors import AnafiMavError, CommandTimeout, LinkLost

TRIES = 6
"""Attempts at a file without a byte more than before: with their pauses a minute, in which a drone restarts."""

PAUSE = 2.0
"""s before the second attempt; doubled for each further one."""

XMP_LIMIT = 1 << 18
"""Bytes at the beginning of a photo that are searched for XMP; each segment before it has at most 64 KiB."""

_DISK = DiskWriter("media-disk", threads=4)
"""The threads for the folder of copies: a disk that sleeps must not block the pool that flying uses."""

T = TypeVar("T")

_XMP_BEGIN, _XMP_END = b"<x:xmpmeta", b"</x:xmpmeta>"

# Each looks at few bytes at few places: a search holds the interpreter, and a file may hold anything.
_XMP_ATTRIBUTE = re.compile(r'(?<=[\w-]):(\w{1,100})="([^"<>]{0,200})"')
_XMP_ELEMENT = re.compile(r"<[\w-]{1,100}:(\w{1,100})>([^<>]{0,200})</")
_ANGLES = {"roll": "CameraRollDegree", "pitch": "CameraPitchDegree", "yaw": "CameraYawDegree"}
"""Parrot's names in the namespace drone-parrot."""


class MediaSource(Protocol):
    """The drone, or the gateway before it."""

    def read_from(self, resource: Resource, offset: int = 0) -> AsyncGenerator[bytes, None]:
        """Iterate over the bytes of a file from `offset` on."""

    async def known_md5(self, resource: Resource) -> str | None:
        """Return the MD5 of a file; None when the drone has none."""


async def copy(
    source: MediaSource,
    resource: Resource,
    folder: Path,
    progress: Callable[[int, int], None] | None = None,
    interrupted: Callable[[AnafiMavError, float], None] = lambda error, pause: None,
) -> Path | None:
    """Copy a file to `<folder>/<day>` and write its sidecar.

    Returns its path, None when it was copied before.

    After an interruption it continues: `interrupted` is called with the error and the pause in s. It gives up after
    `TRIES` attempts without a byte. A file with other content under the same name stays, and the copy gets the
    beginning of its MD5 in its name: after a format the drone's ids begin again.
    """
    most = attempts = 0

    def advanced(done: int, size: int) -> None:
        nonlocal most, attempts
        if done > most:
            most, attempts = done, 0
        if progress is not None:
            progress(done, size)

    while True:
        try:
            return await _copy(source, resource, folder, advanced)
        except (LinkLost, CommandTimeout) as error:
            attempts += 1
            if attempts >= TRIES:
                raise
            pause = PAUSE * 2 ** (attempts - 1)
            interrupted(error, pause)
            await asyncio.sleep(pause)


async def _copy(
    source: MediaSource, resource: Resource, folder: Path, progress: Callable[[int, int], None]
) -> Path | None:
    directory = folder / resource.date
    if await _on_disk(_is_known, directory, resource):
        return None
    md5 = await source.known_md5(resource)
    name = await _on_disk(_free_name, directory, resource, md5)
    if name is None:
        return None
    path = await fetch(resource, directory, source.read_from, md5, progress, name)
    await _on_disk(_write_sidecar, path, resource, md5)
    return path


async def _on_disk(job: Callable[..., T], *arguments: Any) -> T:
    """Run a job that reads or writes files in a thread for such jobs."""
    return await asyncio.get_running_loop().run_in_executor(_DISK, job, *arguments)


def sidecar_of(path: Path) -> Path:
    """Return the path of a file's sidecar."""
    return path.with_name(path.name + ".json")


def _is_known(directory: Path, resource: Resource) -> bool:
    """Return True when a sidecar shows the file to be copied: no MD5 has to be requested."""
    name = file_name(resource.resource_id)
    if iso_time(resource.datetime) is None or not resource.size:
        return False
    if _describes(directory / name, resource):
        return True
    if not (directory / name).exists():
        return False
    stem, ending = _split(name)
    return any(
        _describes(found.with_name(found.name.removesuffix(".json")), resource)
        for found in directory.glob(f"{stem}-*{ending}.json")
    )


def _describes(path: Path, resource: Resource) -> bool:
    """Return True when the sidecar of a copy has this file's id, time and size.

    Also its MD5, where the list has it.
    """
    try:
        size, known = path.stat().st_size, _read_sidecar(path)
    except OSError:
        return False
    wanted = {"resource_id": resource.resource_id, "time": iso_time(resource.datetime), "size": resource.size or size}
    if resource.md5:
        wanted["md5"] = resource.md5.lower()
    return size == wanted["size"] and all(known.get(key, "") == value for key, value in wanted.items())


def _read_sidecar(path: Path) -> dict[str, Any]:
    """Return the content of a file's sidecar; empty when it is not readable."""
    try:
        known = json.loads(sidecar_of(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return known if isinstance(known, dict) else {}


def _free_name(directory: Path, resource: Resource, md5: str | None) -> str | None:
    """Return the name for a copy; None when it is there already."""
    directory.mkdir(parents=True, exist_ok=True)
    for candidate in _names(file_name(resource.resource_id), (md5 or f"{resource.size:x}")[:6]):
        path = directory / candidate
        if not path.exists():
            return candidate
        if _is_copy(path, resource, md5):
            if not sidecar_of(path).exists():
                _write_sidecar(path, resource, md5)
            return None
    raise AssertionError("the names do not end")


def _names(name: str, mark: str) -> Iterator[str]:
    """Yield "a.JPG", "a-1b2c3d.JPG", "a-1b2c3d-2.JPG", …"""
    yield name
    stem, ending = _split(name)
    yield f"{stem}-{mark}{ending}"
    for number in count(2):
        yield f"{stem}-{mark}-{number}{ending}"


def _split(name: str) -> tuple[str, str]:
    """Return ("a", ".JPG")."""
    stem, dot, ending = name.rpartition(".")
    return (stem, dot + ending) if dot else (name, "")


def _is_copy(path: Path, resource: Resource, md5: str | None) -> bool:
    if resource.size and path.stat().st_size != resource.size:
        return False
    if md5 is None:  # a file without a sidecar may be any of the same size
        return _describes(path, resource)
    return (_read_sidecar(path).get("md5") or _md5(path)) == md5


def _md5(path: Path) -> str:
    digest = hashlib.md5(usedforsecurity=False)
    with path.open("rb") as file:
        while data := file.read(WRITTEN):
            digest.update(data)
    return digest.hexdigest()


def _write_sidecar(path: Path, resource: Resource, md5: str | None) -> None:
    with path.open("rb") as file:
        xmp = read_xmp(file.read(XMP_LIMIT)) if resource.format.upper() in ("JPG", "DNG") else {}
    written = replace(resource, size=path.stat().st_size)
    text = json.dumps(sidecar(path.name, written, md5 or _md5(path), xmp, md5), indent=2) + "\n"
    part = sidecar_of(path).with_suffix(".json.part")
    part.write_text(text, encoding="utf-8")
    part.replace(sidecar_of(path))


def sidecar(
    name: str, resource: Resource, md5: str, xmp: dict[str, str], md5_of_drone: str | None = None
) -> dict[str, Any]:
    """Return the content of a sidecar; None: unknown.

    s, m, degrees, heights above mean sea level. `md5` is that of the copy, `md5_of_drone` the one it was compared with.
    """
    place, source = resource.gps, "drone"
    if place is None or not place.is_known:
        place, source = _place_in(xmp), "photo"
    angles = {key: _number(xmp.get(name)) for key, name in _ANGLES.items()}
    return {
        "file": name,
        "media_id": resource.media_id,
        "resource_id": resource.resource_id,
        "type": resource.type or None,
        "format": resource.format or None,
        "size": resource.size,
        "md5": md5,
        "md5_of_drone": md5_of_drone,
        "time": iso_time(resource.datetime),
        "place": None
        if place is None
        else {
            "latitude": place.latitude,
            "longitude": place.longitude,
            "altitude_amsl": place.altitude_amsl,
            "source": source,
        },
        "camera_attitude": None if None in angles.values() else angles,
        "duration": None if resource.duration is None else resource.duration / 1000.0,
    }


def read_xmp(data: bytes) -> dict[str, str]:
    """Return the simple values of the first XMP packet, by their names without a namespace.

    They are elements or attributes of the one description (ISO 16684-1).
    """
    begin = data.find(_XMP_BEGIN)
    end = data.find(_XMP_END, begin)
    if begin < 0 or end < 0:
        return {}
    text = data[begin:end].decode("utf-8", "replace")
    return dict(_XMP_ATTRIBUTE.findall(text)) | dict(_XMP_ELEMENT.findall(text))


def _place_in(xmp: dict[str, str]) -> Place | None:
    """Return the place in XMP's Exif schema: degrees and minutes, "48,52.734000N"."""
    latitude, longitude = (_degrees(xmp.get(f"GPS{name}")) for name in ("Latitude", "Longitude"))
    if latitude is None or longitude is None:
        return None
    whole, _, parts = xmp.get("GPSAltitude", "").partition("/")
    height, divisor = _number(whole), _number(parts or "1")
    altitude = UNKNOWN if height is None or not divisor else height / divisor
    return Place(latitude, longitude, -altitude if xmp.get("GPSAltitudeRef") == "1" else altitude)


def _degrees(text: str | None) -> float | None:
    found = re.fullmatch(r"([0-9]{1,3}),([0-9]{1,2}(?:\.[0-9]{1,9})?)([NSEW])", text or "")
    if found is None:
        return None
    value = int(found[1]) + float(found[2]) / 60.0
    return -value if found[3] in "SW" else value


def _number(text: str | None) -> float | None:
    return float(text) if text is not None and re.fullmatch(r"-?[0-9]{1,12}(\.[0-9]{1,9})?", text) else None


def iso_time(text: str) -> str | None:
    """Return a time of the drone as ISO 8601 extended."""
    try:
        return datetime.strptime(text, "%Y%m%dT%H%M%S%z").isoformat()
    except ValueError:
        return None

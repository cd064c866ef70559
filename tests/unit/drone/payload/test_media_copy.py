"""Copies of media with their sidecars: values by hand, names, interruptions, and what lies in the folder already."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import sys
import threading
import time
from collections.abc import AsyncGenerator
from pathlib import Path

import pytest
from msgspec.structs import replace

from anafi_mav.drone.payload.media_copy import TRIES, XMP_LIMIT, copy, read_xmp, sidecar, sidecar_of
from anafi_mav.drone.payload.media_file import Place, Resource, fetch
from anafi_mav.errors import AnafiMavError, CommandRejected, LinkLost, RemoteProtocolError

PHOTO = b"\xff\xd8 a photo \xff\xd9" * 1000
DAY = "2026-11-22"


class Source:
    """A drone with one file in memory. `cuts` are the bytes after which its answers end, one after the other."""

    def __init__(self, content: bytes = PHOTO, *, cuts: tuple[int, ...] = ()) -> None:
        self.content = content
        self.cuts = list(cuts)
        self.offsets: list[int] = []
        self.md5_requests = 0

    async def known_md5(self, resource: Resource) -> str | None:
        self.md5_requests += 1
        return hashlib.md5(self.content).hexdigest()

    async def read_from(self, resource: Resource, offset: int = 0) -> AsyncGenerator[bytes, None]:
        self.offsets.append(offset)
        end = self.cuts.pop(0) if self.cuts else len(self.content)
        yield self.content[offset:end]
        if end < len(self.content):
            raise LinkLost("the drone restarts")


def resource(content: bytes = PHOTO, name: str = "100000010001.JPG") -> Resource:
    return Resource(name, "10000001", "PHOTO", "JPG", len(content), datetime="20261122T101112+0100")


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


async def test_copy_has_a_sidecar_and_is_made_once(tmp_path: Path) -> None:
    source = Source()
    path = await copy(source, resource(), tmp_path)
    assert path == tmp_path / DAY / "100000010001.JPG"
    assert path.read_bytes() == PHOTO
    assert names(tmp_path) == [f"{DAY}/100000010001.JPG", f"{DAY}/100000010001.JPG.json"]
    record = json.loads(sidecar_of(path).read_text())
    assert (record["md5"], record["size"]) == (hashlib.md5(PHOTO).hexdigest(), len(PHOTO))
    assert record["md5_of_drone"] == record["md5"]
    assert record["time"] == "2026-11-22T10:11:12+01:00"
    assert await copy(source, resource(), tmp_path) is None
    assert source.md5_requests == 1  # the second time the sidecar was enough
    sidecar_of(path).unlink()  # the copy was ended before it was written
    assert await copy(source, resource(), tmp_path) is None
    assert sidecar_of(path).exists()
    assert source.offsets == [0]


async def test_copy_of_other_content_with_one_name_keeps_both(tmp_path: Path) -> None:
    await copy(Source(), resource(), tmp_path)
    other = PHOTO[::-1]
    later = replace(resource(other), datetime="20261122T111213+0100")
    mark = hashlib.md5(other).hexdigest()[:6]
    assert await copy(Source(other), later, tmp_path) == tmp_path / DAY / f"100000010001-{mark}.JPG"
    assert (tmp_path / DAY / "100000010001.JPG").read_bytes() == PHOTO
    edited = tmp_path / DAY / f"100000010001-{mark}.JPG"
    edited.write_bytes(b"edited by the user")
    assert await copy(Source(other), later, tmp_path) == tmp_path / DAY / f"100000010001-{mark}-2.JPG"
    assert await copy(Source(other), later, tmp_path) is None
    assert edited.read_bytes() == b"edited by the user"


async def test_copy_continues_after_interruptions(tmp_path: Path) -> None:
    source = Source(cuts=(300, 300, 5000))
    seen: list[tuple[AnafiMavError, float]] = []
    path = await copy(source, resource(), tmp_path, interrupted=lambda error, pause: seen.append((error, pause)))
    assert path is not None
    assert path.read_bytes() == PHOTO
    assert source.offsets == [0, 300, 300, 5000]
    assert [pause for _, pause in seen] == [2.0, 4.0, 2.0]  # bytes that arrive begin the count again
    assert names(tmp_path) == [f"{DAY}/{path.name}", f"{DAY}/{path.name}.json"]


async def test_copy_ends_after_attempts_without_bytes(tmp_path: Path) -> None:
    source = Source(cuts=(300,) * 20)
    with pytest.raises(LinkLost):
        await copy(source, resource(), tmp_path)
    assert source.offsets == [0] + [300] * (TRIES - 1)
    (part,) = names(tmp_path)
    assert part.endswith(".part")
    later = Source()
    assert await copy(later, resource(), tmp_path) is not None
    assert later.offsets == [300]


async def test_copy_of_a_file_that_is_written_is_refused(tmp_path: Path) -> None:
    begun, more = asyncio.Event(), asyncio.Event()

    class Slow(Source):
        async def read_from(self, resource: Resource, offset: int = 0) -> AsyncGenerator[bytes, None]:
            yield self.content[:100]
            begun.set()
            await more.wait()
            yield self.content[100:]

    first = asyncio.ensure_future(copy(Slow(), resource(), tmp_path))
    await begun.wait()
    with pytest.raises(CommandRejected, match="another download"):
        await copy(Source(), resource(), tmp_path)
    more.set()
    path = await first
    assert path is not None
    assert path.read_bytes() == PHOTO


async def test_copy_with_another_md5_is_deleted(tmp_path: Path) -> None:
    class Damaged(Source):
        async def known_md5(self, resource: Resource) -> str | None:
            return "0" * 32

    with pytest.raises(RemoteProtocolError, match="MD5"):
        await copy(Damaged(), resource(), tmp_path)
    assert names(tmp_path) == []


async def test_copy_of_too_many_bytes_is_not_kept(tmp_path: Path) -> None:
    with pytest.raises(RemoteProtocolError, match="more than its 10 bytes"):
        await copy(Source(), resource(PHOTO[:10]), tmp_path)
    assert all(not name.endswith("JPG") for name in names(tmp_path))


@pytest.mark.parametrize("name", ["../a.JPG", "/etc/a", "", "a/b", ".hidden", "a\0b", "ä.JPG"])
async def test_name_that_leads_elsewhere_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(RemoteProtocolError, match="no id"):
        await copy(Source(), resource(name=name), tmp_path / "copies")
    assert names(tmp_path) == []


XMP = (
    b'noise<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF><rdf:Description drone-parrot:CameraRollDegree="-1.5">'
    b"<drone-parrot:CameraPitchDegree>-10.25</drone-parrot:CameraPitchDegree>"
    b"<drone-parrot:CameraYawDegree>30</drone-parrot:CameraYawDegree><exif:GPSLatitude>48,52.734000N</exif:GPSLatitude>"
    b"<exif:GPSLongitude>2,22.062000W</exif:GPSLongitude><exif:GPSAltitude>85500/1000</exif:GPSAltitude>"
    b"</rdf:Description></rdf:RDF></x:xmpmeta> more"
)


def test_sidecar_takes_the_pose_of_the_photo() -> None:
    record = sidecar("a.JPG", resource(), "0" * 32, read_xmp(XMP))
    assert record["camera_attitude"] == {"roll": -1.5, "pitch": -10.25, "yaw": 30.0}
    # 52.734 / 60 = 0.8789; 22.062 / 60 = 0.3677
    assert record["place"]["latitude"] == pytest.approx(48.8789)
    assert record["place"]["longitude"] == pytest.approx(-2.3677)
    assert (record["place"]["altitude_amsl"], record["place"]["source"]) == (85.5, "photo")


def test_sidecar_prefers_the_place_that_the_drone_reports() -> None:
    reported = Resource("a.JPG", gps=Place(48.0, 2.0, 90.0))
    record = sidecar("a.JPG", reported, "0" * 32, read_xmp(XMP))
    assert record["place"] == {"latitude": 48.0, "longitude": 2.0, "altitude_amsl": 90.0, "source": "drone"}


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"<x:xmpmeta",
        b"<x:xmpmeta></x:xmpmeta>",
        b"<x:xmpmeta><a:GPSLatitude>91;5</a:GPSLatitude></x:xmpmeta>",
        b"<x:xmpmeta>" + b'<a:CameraRollDegree="nan">' * 99 + b"</x:xmpmeta>",
        XMP.replace(b"-10.25", b"1e999"),
        bytes(range(256)) * 10,
    ],
)
def test_sidecar_of_unreadable_data_is_unknown(data: bytes) -> None:
    record = sidecar("a.JPG", Resource("a.JPG", datetime="yesterday"), "0" * 32, read_xmp(data))
    assert record["camera_attitude"] is None
    assert record["time"] is None
    assert json.dumps(record, allow_nan=False)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no os.mkfifo for the slow disk")
async def test_cancelled_download_to_blocked_disk_ends_at_once(tmp_path: Path) -> None:
    """A part that is a pipe takes 64 KiB and then no byte, like a disk that sleeps."""
    content = bytes(3 << 20)
    part = tmp_path / f"a.MP4.{'0' * 12}.part"
    os.mkfifo(part)
    pipe = os.open(part, os.O_RDONLY | os.O_NONBLOCK)
    begun, ended, drained = asyncio.Event(), threading.Event(), []

    def drain() -> None:
        ended.wait(10.0)  # without the mend the event loop waits for this
        os.set_blocking(pipe, True)
        with os.fdopen(pipe, "rb") as reader:
            drained.append(len(reader.read()))

    loop = asyncio.get_running_loop()
    loop.add_reader(pipe, begun.set)
    copying = asyncio.ensure_future(fetch(resource(content, "a.MP4"), tmp_path, Source(content).read_from, "0" * 32))
    disk = threading.Thread(target=drain)
    disk.start()
    await begun.wait()
    loop.remove_reader(pipe)
    copying.cancel()
    with pytest.raises(asyncio.CancelledError):
        await copying
    assert not drained  # the loop went on while the disk took nothing
    ended.set()
    disk.join()
    assert drained == [len(content)]  # the thread has written the rest and closed the file


class Unknowing(Source):
    """A drone without MD5."""

    async def known_md5(self, resource: Resource) -> str | None:
        return None


async def test_copy_that_was_not_compared_says_so(tmp_path: Path) -> None:
    path = await copy(Unknowing(), resource(), tmp_path)
    assert path is not None
    record = json.loads(sidecar_of(path).read_text())
    assert (record["md5"], record["md5_of_drone"]) == (hashlib.md5(PHOTO).hexdigest(), None)
    assert await copy(Unknowing(), resource(), tmp_path) is None
    sidecar_of(path).unlink()  # now it may be any file of this size
    again = await copy(Unknowing(), resource(), tmp_path)
    assert again not in (None, path)
    assert await copy(Unknowing(), resource(), tmp_path) is None


async def test_part_of_a_file_of_another_time_is_not_continued(tmp_path: Path) -> None:
    """Ids begin again after a format, and sizes can be equal."""
    with pytest.raises(LinkLost):
        await copy(Unknowing(cuts=(300,) * TRIES), resource(), tmp_path)
    other = Unknowing(PHOTO[::-1])
    path = await copy(other, replace(resource(), datetime="20261122T111213+0100"), tmp_path)
    assert path is not None
    assert (path.read_bytes(), other.offsets) == (PHOTO[::-1], [0])
    untimed = Unknowing(cuts=(300, len(PHOTO)))
    assert await copy(untimed, replace(resource(), datetime=""), tmp_path) is not None
    assert untimed.offsets == [0, 0]


async def test_failed_md5_request_fails_the_copy(tmp_path: Path) -> None:
    class Failing(Source):
        async def known_md5(self, resource: Resource) -> str | None:
            raise CommandRejected("GET: HTTP 500")

    with pytest.raises(CommandRejected, match="500"):
        await copy(Failing(), resource(), tmp_path)
    assert names(tmp_path) == []


async def test_copies_of_unknown_size_are_made_once(tmp_path: Path) -> None:
    unknown = replace(resource(), size=0)
    assert await copy(Unknowing(), unknown, tmp_path) is not None
    assert await copy(Unknowing(), unknown, tmp_path) is None
    assert await copy(Source(), unknown, tmp_path) is None
    with pytest.raises(RemoteProtocolError, match="no bytes"):
        await copy(Source(b""), replace(unknown, resource_id="empty.JPG"), tmp_path)
    assert names(tmp_path) == [f"{DAY}/{unknown.resource_id}", f"{DAY}/{unknown.resource_id}.json"]


@pytest.mark.parametrize("repeated", [b"<x:xmpmeta>", b"a", b"<a", b"a:", b":a", b':a="', b"<a:a>", b"<a:a>b"])
@pytest.mark.parametrize("end", [b"", b"</x:xmpmeta>"])
def test_metadata_of_any_photo_are_read_at_once(repeated: bytes, end: bytes) -> None:
    """A search holds the interpreter, and with it the event loop that flies the other drones."""
    data = b"<x:xmpmeta>" + repeated * (XMP_LIMIT // len(repeated))
    began = time.process_time()
    read_xmp(data[: XMP_LIMIT - len(end)] + end)
    assert time.process_time() - began < 1.0

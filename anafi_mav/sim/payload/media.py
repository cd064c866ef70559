"""Index of the cameras' media, each of one or more files, as Parrot's web server lists them.

A file is generated when it is requested (`Resource.content`) from the stored data of the moment it shows, always
the same bytes; so a card may be full without filling the simulator's memory.
"""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import mediastore
from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.sim.payload import jpeg_scene, xmp
from anafi_mav.sim.payload.jpeg_scene import Scene

FIRST_ID = 10_000_001
INDEXING_TIME = 0.5
"""s that an empty card is indexed. Assumed."""
PART = 1 << 20
"""Bytes of a file that are made at a time."""
MAX_RESOURCES = 9999
"""Files of one media: their number has four digits."""

Notify = Callable[[str, dict[str, Any]], None]


class MediaKind(enum.Enum):
    """A file by the end of its name."""

    JPG = "JPG"
    DNG = "DNG"
    MP4 = "MP4"


@dataclass(frozen=True)
class Resource:
    """One file."""

    media_id: str
    kind: MediaKind
    number: int
    """1 is a media's first shot."""
    scene: Scene
    date: str
    """ISO 8601 basic."""
    camera: str
    storage: int
    seconds: float = 0.0
    """Length of a video."""
    captured: float = 0.0
    """s after the drone's start that a photo was taken."""
    size: int = field(init=False)
    """Bytes."""

    def __post_init__(self) -> None:
        video = self.kind is MediaKind.MP4
        size = jpeg_scene.mp4_size(self.scene, self.seconds) if video else len(self.content())
        object.__setattr__(self, "size", size)

    @property
    def id(self) -> str:
        return f"{self.media_id}{self.number:04d}.{self.kind.value}"

    def content(self) -> bytes:
        """The file."""
        if self.kind is MediaKind.MP4:
            return jpeg_scene.mp4(self.scene, self.seconds)
        packet = xmp.packet(self.scene, self.camera, self.captured)
        if self.kind is MediaKind.DNG:
            return jpeg_scene.dng(self.scene, self.number, self.camera, _exif_date(self.date), packet)
        note = jpeg_scene.exif(self.scene, self.camera, _exif_date(self.date))
        return jpeg_scene.jpeg(self.scene, self.number, exif=note, xmp=xmp.HEADER + packet)

    def thumbnail(self) -> bytes:
        """A smaller JPEG of it."""
        return jpeg_scene.thumbnail(self.scene, self.number)

    def parts(self, first: int, end: int, size: int = PART) -> Iterator[bytes]:
        """Bytes `first` to `end` of the file, `size` at a time. A video is never made as a whole."""
        whole = None if self.kind is MediaKind.MP4 else self.content()
        for offset in range(first, end, size):
            stop = min(offset + size, end)
            if whole is None:
                yield jpeg_scene.mp4(self.scene, self.seconds, offset, stop - offset)
            else:
                yield whole[offset:stop]

    def md5(self) -> str:
        digest = hashlib.md5(usedforsecurity=False)
        for part in self.parts(0, self.size):
            digest.update(part)
        return digest.hexdigest()

    @property
    def thumbnail_name(self) -> str:
        return f"{self.media_id}{self.number:04d}.JPG"

    def describe(self) -> dict[str, Any]:
        """As in the answers of the web server."""
        video = self.kind is MediaKind.MP4
        width, height = jpeg_scene.WIDTH, jpeg_scene.HEIGHT
        if self.kind is MediaKind.DNG:
            width, height = jpeg_scene.RAW_WIDTH, jpeg_scene.RAW_HEIGHT
        description: dict[str, Any] = {
            "media_id": self.media_id,
            "resource_id": self.id,
            "type": "VIDEO" if video else "PHOTO",
            "format": self.kind.value,
            "datetime": self.date,
            "size": self.size,
            "url": f"/data/media/{self.id}",
            "path": f"DCIM/100PARRO/{self.id}",
            "width": width,
            "height": height,
            "thumbnail": f"/data/thumb/{self.thumbnail_name}",
            "gps": _gps(self.scene),
            "storage": str(self.storage),
        }
        if video:
            description |= {"duration": round(self.seconds * 1000.0), "replay_url": f"replay/{self.id}"}
        return description


@dataclass
class Media:
    """Result of one press of the shutter button: one or more files."""

    id: str
    video: bool
    mode: str
    """SINGLE, BURST, …; STANDARD, HYPERLAPSE, … of a video."""
    date: str
    run_id: str
    thermal: bool = False
    panorama: str = ""
    """SPHERICAL, …; empty: it is none."""
    expected: int = 0
    """Pictures that a panorama is made of."""
    resources: list[Resource] = field(default_factory=list)

    @property
    def size(self) -> int:
        return sum(resource.size for resource in self.resources)

    def describe(self) -> dict[str, Any]:
        """As in the answers of the web server."""
        first = self.resources[0]
        description: dict[str, Any] = {
            "media_id": self.id,
            "type": "VIDEO" if self.video else "PHOTO",
            "datetime": self.date,
            "size": self.size,
            "run_id": self.run_id,
            "thumbnail": f"/data/thumb/{first.thumbnail_name}",
            "gps": _gps(first.scene),
            "thermal": self.thermal,
            "resources": [resource.describe() for resource in self.resources],
        }
        if self.video:
            seconds = sum(resource.seconds for resource in self.resources)
            description |= {
                "video_mode": self.mode,
                "duration": round(seconds * 1000.0),
                "replay_url": f"replay/{first.id}",
            }
        else:
            description["photo_mode"] = self.mode
        if self.panorama:
            description["panorama_type"] = self.panorama
        if self.expected:
            description["expected_count"] = self.expected
        return description


class MediaStore:
    """All media, oldest first.

    `notify` receives the notifications of Parrot's websocket; `emit` takes ARSDK events.
    """

    def __init__(self, run_id: str, camera: str, storage: int, emit: Callable[[Message], None]) -> None:
        self.notify: Notify = lambda name, data: None
        self.state = MediastoreState.INDEXED
        self._emit = emit
        self._run_id = run_id
        self._camera = camera
        self._storage = storage
        self._media: dict[str, Media] = {}
        self._resources: dict[str, Resource] = {}
        self._next_id = FIRST_ID
        self._indexed_at: float | None = None
        self.used = 0
        """Bytes of all files."""

    def begin_run(self, run_id: str) -> None:
        """Assign all media taken from now on to this run."""
        self._run_id = run_id

    def __iter__(self) -> Iterator[Media]:
        return iter(list(self._media.values()))

    def __len__(self) -> int:
        return len(self._media)

    @property
    def indexed(self) -> bool:
        return self.state is MediastoreState.INDEXED

    def media(self, id: str) -> Media | None:
        return self._media.get(id)

    def resource(self, id: str) -> Resource | None:
        return self._resources.get(id)

    def by_thumbnail(self, name: str) -> Resource | None:
        stem = name.removesuffix(".JPG")
        return next(
            (self._resources[id] for kind in MediaKind if (id := f"{stem}.{kind.value}") in self._resources), None
        )

    # -- writing

    def begin(
        self, *, video: bool, mode: str, date: str, thermal: bool = False, panorama: str = "", expected: int = 0
    ) -> Media:
        """Create a media without files; it is not announced before `add`."""
        media = Media(str(self._next_id), video, mode, date, self._run_id, thermal, panorama, expected)
        self._next_id += 1
        return media

    def develop(
        self,
        media: Media,
        kind: MediaKind,
        number: int,
        scene: Scene,
        date: str,
        seconds: float = 0.0,
        captured: float = 0.0,
    ) -> Resource:
        """A file of `media` that is not written yet: its size is known."""
        return Resource(media.id, kind, number, scene, date, self._camera, self._storage, seconds, captured)

    def add(self, media: Media, resources: list[Resource]) -> None:
        """Write files and announce them.

        A new media is announced with the files of its first shot, those of the others follow one by one, as Parrot
        describes a burst (Olympe 8.5, examples/media_ai.py).
        """
        new = media.id not in self._media
        self._media[media.id] = media
        first = resources[0].number if new else None
        for resource in resources:
            if resource.number == first:
                self._write(media, resource)
        self.notify("media_created" if new else "media_updated", {"media_id": media.id, "media": media.describe()})
        for resource in resources:
            if resource.number != first:
                self._write(media, resource)
                self.notify("resource_created", {"resource": resource.describe()})
        self._emit(self._counters())

    def _write(self, media: Media, resource: Resource) -> None:
        media.resources.append(resource)
        self._resources[resource.id] = resource
        self.used += resource.size

    def remove_resource(self, id: str) -> bool:
        """Delete a file, and its media with the last one; return False when the file does not exist."""
        resource = self._resources.pop(id, None)
        if resource is None:
            return False
        self.used -= resource.size
        media = self._media[resource.media_id]
        media.resources.remove(resource)
        self.notify("resource_removed", {"resource_id": id})
        if not media.resources:
            del self._media[media.id]
            self.notify("media_removed", {"media_id": media.id})
        self._emit(self._counters())
        return True

    def remove(self, id: str) -> bool:
        """Delete a media with its files; return False when it does not exist."""
        media = self._media.pop(id, None)
        if media is None:
            return False
        for resource in media.resources:
            del self._resources[resource.id]
            self.used -= resource.size
            self.notify("resource_removed", {"resource_id": resource.id})
        media.resources.clear()  # a lapse may go on writing to it
        self.notify("media_removed", {"media_id": id})
        self._emit(self._counters())
        return True

    def remove_all(self) -> None:
        """Delete everything."""
        for media in self._media.values():
            media.resources.clear()
        self._media.clear()
        self._resources.clear()
        self.used = 0
        self.notify("all_media_removed", {})
        self._emit(self._counters())

    # -- the index

    def unplug(self) -> None:
        """The card is not there for the moment: nothing can be listed."""
        self._set_state(MediastoreState.NOT_AVAILABLE)
        self._indexed_at = None

    def index(self, time: float) -> None:
        """The card is back: its index takes a while."""
        self._set_state(MediastoreState.INDEXING)
        self._indexed_at = time + INDEXING_TIME

    def tick(self, time: float) -> None:
        if self._indexed_at is not None and time >= self._indexed_at:
            self._indexed_at = None
            self._set_state(MediastoreState.INDEXED)
            self._emit(self._counters())

    def _set_state(self, state: MediastoreState) -> None:
        before, self.state = self.state, state
        self._emit(mediastore.State(state))
        self.notify("indexing_state_changed", {"new_state": _INDEXING[state], "old_state": _INDEXING[before]})

    def _counters(self) -> Message:
        if not self.indexed:
            return mediastore.Counters(-1, -1, -1, -1)
        videos = [media for media in self._media.values() if media.video]
        photos = [media for media in self._media.values() if not media.video]
        return mediastore.Counters(
            len(videos),
            len(photos),
            sum(len(media.resources) for media in videos),
            sum(len(media.resources) for media in photos),
        )

    def states_report(self) -> list[Message]:
        """Return the messages of the index in the AllStates answer."""
        return [mediastore.State(self.state), self._counters()]


_INDEXING = {
    MediastoreState.NOT_AVAILABLE: "NOT_INDEXED",
    MediastoreState.INDEXING: "INDEXING",
    MediastoreState.INDEXED: "INDEXED",
}


def _gps(scene: Scene) -> dict[str, float]:
    return {"latitude": scene.latitude, "longitude": scene.longitude, "altitude": scene.altitude}


def _exif_date(date: str) -> str:
    """YYYYMMDDTHHMMSS… as Exif writes it."""
    return f"{date[0:4]}:{date[4:6]}:{date[6:8]} {date[9:11]}:{date[11:13]}:{date[13:15]}"

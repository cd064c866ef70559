"""The simulator's files are what their names say, and its index of them is right after every change."""

from __future__ import annotations

import hashlib
import io
import struct
from typing import Any

import cv2
import pytest
from PIL import Image

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import mediastore
from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.sim.payload import jpeg_scene
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.media import Media, MediaKind, MediaStore
from anafi_mav.sim.plan.plan_store import MAX_PLANS, FlightPlanStore
from anafi_mav.sim.world.calendar import Calendar

PARIS = Scene(48.8789, 2.3677, 85.5, pitch=0.0, roll=0.0)
DATE = "20261121T101112+0100"


# -- files


def test_a_photo_is_a_jpeg_of_what_was_seen() -> None:
    def pixel(scene: Scene, x: int, y: int) -> str:
        opened = Image.open(io.BytesIO(jpeg_scene.jpeg(scene)))
        opened.load()
        assert (opened.size, opened.mode) == ((160, 120), "RGB")
        red, _, blue = opened.getpixel((x, y))
        return "sky" if blue > red else "ground"

    assert (pixel(PARIS, 80, 50), pixel(PARIS, 80, 70)) == ("sky", "ground")
    # Looking down 30 of 43 degrees, the horizon is above the picture; up, below it.
    assert pixel(Scene(pitch=-30.0), 80, 5) == "ground"
    assert pixel(Scene(pitch=30.0), 80, 105) == "sky"
    # Rolled to the right, the ground rises on the right.
    rolled = Scene(roll=30.0)
    assert (pixel(rolled, 5, 70), pixel(rolled, 155, 50)) == ("sky", "ground")


def test_a_photo_knows_where_and_when() -> None:
    store = MediaStore("run", "ANAFI", 0, lambda message: None)
    media = store.begin(video=False, mode="SINGLE", date=DATE)
    resource = store.develop(media, MediaKind.JPG, 1, PARIS, DATE)
    exif = Image.open(io.BytesIO(resource.content())).getexif()
    assert (exif[0x010F], exif[0x0110], exif[0x0132]) == ("Parrot", "ANAFI", "2026:11:21 10:11:12")
    place = exif.get_ifd(0x8825)
    # 48.8789 degrees are 48 d 52 m 44.04 s, 2.3677 are 2 d 22 m 3.72 s.
    assert (place[1], place[2]) == ("N", pytest.approx((48.0, 52.0, 44.04)))
    assert (place[3], place[4]) == ("E", pytest.approx((2.0, 22.0, 3.72)))
    assert (place[5], place[6]) == (b"\0", 85.5)
    nowhere = store.develop(media, MediaKind.JPG, 1, Scene(), DATE)
    assert 0x8825 not in Image.open(io.BytesIO(nowhere.content())).getexif()
    south = store.develop(media, MediaKind.JPG, 1, Scene(-33.5, -151.25, -2.0), DATE)
    place = Image.open(io.BytesIO(south.content())).getexif().get_ifd(0x8825)
    assert (place[1], place[2], place[3], place[4]) == ("S", (33.0, 30.0, 0.0), "W", (151.0, 15.0, 0.0))
    assert (place[5], place[6]) == (b"\1", 2.0)


def test_a_raw_photo_is_a_tiff_with_a_version() -> None:
    data = jpeg_scene.dng(PARIS, 1, "ANAFI", "2026:11:21 10:11:12", b"<x/>")
    assert struct.unpack_from("<2sHI", data) == (b"II", 42, 8)
    (count,) = struct.unpack_from("<H", data, 8)
    tags = {}
    for index in range(count):
        tag, kind, number, value = struct.unpack_from("<HHI4s", data, 10 + 12 * index)
        tags[tag] = (kind, number, value)
    assert list(tags) == sorted(tags)
    assert tags[0xC612] == (1, 4, bytes((1, 4, 0, 0)))  # DNGVersion
    offset, size = (struct.unpack("<I", tags[tag][2])[0] for tag in (0x0111, 0x0117))
    assert size == jpeg_scene.RAW_WIDTH * jpeg_scene.RAW_HEIGHT * 3
    assert offset + size == len(data)
    # The first sample is the sky: more blue than red.
    assert data[offset + 2] > data[offset]


@pytest.mark.parametrize(("seconds", "frames"), [(0.0, 1), (0.4, 1), (1.0, 1), (2.5, 3), (60.0, 60)])
def test_a_video_has_a_frame_a_second(seconds: float, frames: int) -> None:
    data = jpeg_scene.mp4(PARIS, seconds)
    assert len(data) == jpeg_scene.mp4_size(PARIS, seconds)
    boxes = []
    place = 0
    while place < len(data):
        size, kind = struct.unpack_from(">I4s", data, place)
        boxes.append(kind)
        if kind == b"mdat":
            assert data.count(jpeg_scene.jpeg(PARIS), place + 8) == frames
        place += size
    assert boxes == [b"ftyp", b"moov", b"mdat"]
    assert place == len(data)


def test_a_video_plays(tmp_path: Any) -> None:
    file = tmp_path / "video.mp4"
    file.write_bytes(jpeg_scene.mp4(PARIS, 3.5))
    video = cv2.VideoCapture(str(file))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    assert len(frames) == 4
    assert frames[0].shape == (120, 160, 3)
    blue, _, red = frames[0][20, 80]
    assert blue > red


# -- the index


class Told:
    """A store and what it said."""

    def __init__(self) -> None:
        self.events: list[Message] = []
        self.notes: list[tuple[str, dict[str, Any]]] = []
        self.store = MediaStore("run", "ANAFI", 0, self.events.append)
        self.store.notify = lambda name, data: self.notes.append((name, data))

    def photo(self, shots: int = 1) -> Media:
        media = self.store.begin(video=False, mode="BURST" if shots > 1 else "SINGLE", date=DATE)
        files = [self.store.develop(media, MediaKind.JPG, number + 1, PARIS, DATE) for number in range(shots)]
        self.store.add(media, files)
        return media

    def names(self) -> list[str]:
        names = [name for name, _ in self.notes]
        self.notes.clear()
        return names


def test_ids_and_description() -> None:
    observed = Told()
    observed.photo()
    media = observed.photo(2)
    assert media.id == "10000002"
    description = media.describe()
    assert [resource["resource_id"] for resource in description["resources"]] == [
        "100000020001.JPG",
        "100000020002.JPG",
    ]
    assert description["type"] == "PHOTO"
    assert description["photo_mode"] == "BURST"
    assert description["size"] == sum(resource["size"] for resource in description["resources"])
    assert description["gps"] == {"latitude": 48.8789, "longitude": 2.3677, "altitude": 85.5}
    first = description["resources"][0]
    assert (first["format"], first["url"], first["thumbnail"]) == (
        "JPG",
        "/data/media/100000020001.JPG",
        "/data/thumb/100000020001.JPG",
    )
    resource = observed.store.resource("100000020001.JPG")
    assert resource is not None
    assert resource.md5() == hashlib.md5(resource.content()).hexdigest()
    assert resource.content() != media.resources[1].content()
    assert observed.store.by_thumbnail("100000020001.JPG") is resource
    assert observed.store.by_thumbnail("nothing") is None


def test_each_media_change_is_notified() -> None:
    observed = Told()
    first, burst = observed.photo(), observed.photo(3)
    assert observed.names() == ["media_created", "media_created", *["resource_created"] * 2]
    assert observed.events[-1] == mediastore.Counters(0, 2, 0, 4)
    observed.store.add(first, [observed.store.develop(first, MediaKind.JPG, 2, PARIS, DATE)])
    assert observed.names() == ["media_updated", "resource_created"]
    assert observed.store.remove_resource("100000010001.JPG")
    assert observed.names() == ["resource_removed"]
    assert observed.store.remove_resource("100000010002.JPG")
    assert observed.names() == ["resource_removed", "media_removed"]
    assert observed.store.remove(burst.id)
    assert observed.names() == [*["resource_removed"] * 3, "media_removed"]
    assert observed.store.used == 0
    assert observed.events[-1] == mediastore.Counters(0, 0, 0, 0)
    assert not observed.store.remove(burst.id)
    assert not observed.store.remove_resource("100000010001.JPG")
    observed.photo()
    observed.names()
    observed.store.remove_all()
    assert observed.names() == ["all_media_removed"]
    assert observed.photo().id == "10000004"  # a number is never given twice


def test_an_index_takes_its_time() -> None:
    observed = Told()
    observed.store.unplug()
    observed.store.index(10.0)
    observed.store.tick(10.4)
    assert observed.store.state is MediastoreState.INDEXING
    observed.store.tick(10.6)
    assert observed.store.indexed
    states = [(data["old_state"], data["new_state"]) for _, data in observed.notes]
    assert states == [("INDEXED", "NOT_INDEXED"), ("NOT_INDEXED", "INDEXING"), ("INDEXING", "INDEXED")]


# -- the calendar and the plans


def test_a_calendar_goes_on() -> None:
    calendar = Calendar()
    assert calendar.date(0.0) == "19700101T000000+0000"
    assert calendar.set("20180616T141516+0130", 100.0)
    assert calendar.date(160.0) == "20180616T141616+0130"
    # 14:15:16 at +01:30 is 12:45:16 UTC.
    assert calendar.milliseconds(100.0) == 1_529_153_116_000
    for odd in ("", "2018-06-16", "20181316T141516+0100", "20180616T141516+9900"):
        assert not calendar.set(odd, 0.0)
    assert calendar.date(100.0) == "20180616T141516+0130"


def test_plans_have_an_end() -> None:
    store = FlightPlanStore()
    first = store.put(b"QGC WPL 120\n", DATE)
    assert store.get(first) == b"QGC WPL 120\n"
    assert store.put(b"QGC WPL 120\n") != first
    assert [plan.date for plan in store.list()] == [DATE, ""]
    for number in range(MAX_PLANS):
        store.put(b"%d" % number)
    assert len(store.list()) == MAX_PLANS
    assert store.get(first) is None
    last = store.list()[-1].uid
    assert store.remove(last)
    assert not store.remove(last)

"""The XMP of simulated photos, read as programs of Parrot's users read it: the children of the one description."""

from __future__ import annotations

import io
import struct
from xml.etree import ElementTree

import pytest
from PIL import Image

from anafi_mav.sim.payload import jpeg_scene
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.media import MediaKind, MediaStore

DATE = "20261121T101112+0100"
PARIS = Scene(48.8789, 2.3677, 85.5, pitch=-30.0, roll=1.25, heading=200.0)

PARROT, EXIF = "{http://www.parrot.com/drone-parrot/1.0/}", "{http://ns.adobe.com/exif/1.0/}"


def photo(scene: Scene, kind: MediaKind = MediaKind.JPG, captured: float = 12.5) -> bytes:
    store = MediaStore("run", "ANAFI", 0, lambda message: None)
    media = store.begin(video=False, mode="SINGLE", date=DATE)
    return store.develop(media, kind, 1, scene, DATE, captured=captured).content()


def tags(data: bytes) -> dict[str, str]:
    """Qualified names and values of a packet that stands somewhere in a file."""
    begin, end = data.index(b"<x:xmpmeta"), data.index(b"</x:xmpmeta>")
    (description,) = ElementTree.fromstring(data[begin : end + len(b"</x:xmpmeta>")])[0]
    return {child.tag: child.text or "" for child in description}


@pytest.mark.parametrize("kind", [MediaKind.JPG, MediaKind.DNG])
def test_photo_has_the_attitude_time_and_place_of_its_camera(kind: MediaKind) -> None:
    found = tags(photo(PARIS, kind))
    assert float(found[PARROT + "CameraRollDegree"]) == 1.25
    assert float(found[PARROT + "CameraPitchDegree"]) == -30.0
    assert float(found[PARROT + "CameraYawDegree"]) == -160.0
    assert found[PARROT + "CaptureTsUs"] == "12500000"
    # 48.8789 degrees are 48 degrees and 52.734 minutes, 2.3677 are 2 degrees and 22.062 minutes.
    assert found[EXIF + "GPSLatitude"] == "48,52.734000N"
    assert found[EXIF + "GPSLongitude"] == "2,22.062000E"
    assert found[EXIF + "GPSAltitude"] == "85500/1000"


def test_photo_without_fix_has_no_place() -> None:
    found = tags(photo(Scene()))
    assert PARROT + "CameraYawDegree" in found
    assert not [name for name in found if name.startswith(EXIF)]


def test_photo_of_the_south_west_below_the_sea_has_its_signs() -> None:
    found = tags(photo(Scene(-33.5, -151.25, -2.0)))
    assert (found[EXIF + "GPSLatitude"], found[EXIF + "GPSLongitude"]) == ("33,30.000000S", "151,15.000000W")
    assert (found[EXIF + "GPSAltitude"], found[EXIF + "GPSAltitudeRef"]) == ("2000/1000", "1")


def test_photo_with_xmp_is_a_jpeg_with_exif_that_opens() -> None:
    data = photo(PARIS)
    opened = Image.open(io.BytesIO(data))
    opened.load()
    assert opened.size == (jpeg_scene.WIDTH, jpeg_scene.HEIGHT)
    assert opened.getexif()[0x010F] == "Parrot"
    assert b"x:xmpmeta" in opened.info["xmp"]
    markers, place = [], 2
    while data[place : place + 2] != b"\xff\xda":
        marker, length = struct.unpack_from(">HH", data, place)
        markers.append(marker)
        place += 2 + length
    assert markers[:2] == [0xFFE1, 0xFFE1]

"""Photos and videos on a simulated drone's card, without a flight."""

from __future__ import annotations

from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.payload import jpeg_scene
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.media import MediaKind, Resource

DAY = "2026-11-21"
DATE = "20261121T101112+0100"
TIME = 1795252272
"""The same in s since 1970, by hand: 20778 days, 9 h 11 min 12 s."""

SCENE = Scene(latitude=48.8789, longitude=2.3677, altitude=85.0, heading=30.0, roll=1.0, pitch=-10.0)


def add_photo(drone: SimulatedDrone, date: str = DATE, scene: Scene = SCENE) -> Resource:
    """A photo that the drone took earlier."""
    store = drone.firmware.payload.media
    media = store.begin(video=False, mode="SINGLE", date=date)
    photo = store.develop(media, MediaKind.JPG, 1, scene, date)
    store.add(media, [photo])
    return photo


def add_video(drone: SimulatedDrone, size: int, date: str = DATE) -> Resource:
    """A video of about `size` bytes. Its bytes repeat."""
    store = drone.firmware.payload.media
    one, two = (jpeg_scene.mp4_size(SCENE, n * jpeg_scene.FRAME_TIME) for n in (1, 2))
    media = store.begin(video=True, mode="STANDARD", date=date)
    seconds = jpeg_scene.FRAME_TIME * (1 + max(size - one, 0) // (two - one))
    video = store.develop(media, MediaKind.MP4, 1, SCENE, date, seconds)
    store.add(media, [video])
    return video

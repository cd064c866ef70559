"""Places where a plan takes photos and videos, for pictures of it. Jumps are not followed."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from anafi_mav import mav_enums
from anafi_mav.plans import path
from anafi_mav.plans.path import Stop
from anafi_mav.plans.plan import Item, Plan

Place = tuple[float, float]
"""Latitude and longitude, deg."""


class ShotKind(enum.Enum):
    """Activity of the camera."""

    PHOTO = "photo"
    PHOTOS = "photos on the way"
    VIDEO = "video"


@dataclass(frozen=True)
class Shots:
    """Photos and videos of a plan.

    Single photos by their place, ways with photos or video, and targets with the place that looks at them.
    """

    photos: tuple[Place, ...]
    ways: tuple[tuple[ShotKind, Place, Place], ...]
    looks: tuple[tuple[Place | None, Place], ...]
    """From where, None: not known; and at what."""


_STOPS = {mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE: ShotKind.PHOTOS, mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE: ShotKind.VIDEO}
_TRIGGERS = (mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL)


def shots(plan: Plan) -> Shots:
    """Follow the items in sequence and return their photos and videos."""
    stops = {stop.item: stop for stop in path.way(plan)}
    here: Place | None = None if plan.home is None else (plan.home.latitude, plan.home.longitude)
    running: set[ShotKind] = set()
    photos: list[Place] = []
    ways: list[tuple[ShotKind, Place, Place]] = []
    looks: list[tuple[Place | None, Place]] = []
    for number, item in enumerate(plan.items):
        stop = stops.get(number)
        if stop is not None:
            there = _place(stop)
            if here is not None and here != there:
                ways += [(kind, here, there) for kind in ShotKind if kind in running]
            here = there
        elif item.command in path.LOOKS:
            target = path.place_of(item)
            if target is not None:
                looks.append((here, target))
        else:
            _camera(item, running)
            if _is_photo(item) and here is not None:
                photos.append(here)
    return Shots(tuple(photos), tuple(ways), tuple(looks))


def _place(stop: Stop) -> Place:
    return stop.latitude, stop.longitude


def _camera(item: Item, running: set[ShotKind]) -> None:
    """Begin or end photos on the way, or a video."""
    value = item.params[0] or 0.0
    match item.command:
        case mav_enums.MAV_CMD_VIDEO_START_CAPTURE:
            running.add(ShotKind.VIDEO)
        case mav_enums.MAV_CMD_IMAGE_START_CAPTURE if not item.params[2]:
            running.add(ShotKind.PHOTOS)
        case command if command in _TRIGGERS:
            (running.add if value > 0.0 else running.discard)(ShotKind.PHOTOS)
        case command if command in _STOPS:
            running.discard(_STOPS[command])


def _is_photo(item: Item) -> bool:
    """True for what takes a counted number of photos where it stands."""
    match item.command:
        case mav_enums.MAV_CMD_IMAGE_START_CAPTURE:
            return bool(item.params[2])
        case mav_enums.MAV_CMD_DO_DIGICAM_CONTROL:
            return item.params[4] == 1.0
        case mav_enums.MAV_CMD_PANORAMA_CREATE:
            return True
        case command if command in _TRIGGERS:
            return item.params[2] == 1.0  # one at once
        case _:
            return False

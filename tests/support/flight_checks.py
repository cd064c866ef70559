"""A mission that was flown, judged by the simulator's own log: way points, photos, videos and the gimbal, in order."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from anafi_mav import geo, mav_enums
from anafi_mav.drone.settings import REPEAT
from anafi_mav.plans.plan import GLOBAL, Item, Plan
from support.missions import apart
from support.world import HOME

WITHIN = 2.0
"""m from a way point."""

REGION, AHEAD, DISTANCE, PHOTOS, PANORAMA = (
    mav_enums.MAV_CMD_DO_SET_ROI_LOCATION,
    mav_enums.MAV_CMD_DO_SET_ROI_NONE,
    mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    mav_enums.MAV_CMD_IMAGE_START_CAPTURE,
    mav_enums.MAV_CMD_PANORAMA_CREATE,
)

LINES = {
    16: ("waypoint",), 17: ("waypoint",), 19: ("waypoint",),
    205: ("mount_control",), 1000: ("mount_control",), 197: ("mount_control",),
    206: ("trigger_distance", "start_photo", "stop_photo"),
    2000: ("start_photo",), 2001: ("stop_photo",), 2500: ("start_video",), 2501: ("stop_video",), 2800: ("panorama",),
    195: ("set_roi", "set_roi_location"), 196: ("mount_control",),
    20: ("return_to_launch",), 21: ("land",), 22: ("takeoff",),
}  # fmt: skip
"""Item of a mission -> what the drone says of it, in the words of its log."""

GIMBAL = (196, 205, 1000)
CAMERA = (DISTANCE, PHOTOS, 2001, 2500, 2501, PANORAMA)
ENDS = (20, 21)

PHOTO_EVENTS = {"camera.photo_progress": "result", "camera2.Event.Photo": "type"}
"""What drones say of photos -> the argument that says what, in the words of the older cameras and of the Ai's."""

TAKEN = 1
"""That a photo was taken, in the words of both."""

ZOOM_ORDERS = ("set_zoom_target", "SetZoomTarget")
"""To the older cameras and to the Ai's."""

REPEATED = 0.9 * REPEAT
"""s after which the same zoom is no second one: the first was not answered."""

FOLLOWED = 2.5
"""deg that it may be beside a region of interest that it passes, up and down and to the side."""

TURNED = 4.0
"""s until it looks at one."""

LATE = 0.2
"""m that a photo of a lapse in distance is late: the camera looks how far it has come 20 times a second, at 8 m/s."""

SET_ANEW = ("set_view_mode", "set_roi_none", "mount_control")
"""Lines that a file may have besides, for a mode that holds or has to."""


MAVSDKS_JUMPS = 1
"""Items behind its target that a jump of a plan goes when MAVSDK imports it: it sends QGroundControl's jump ids, which
count from 1, as they are."""


def executed(plan: Plan, jump_beyond: int = 0) -> Iterator[Item]:
    """The items in the order in which they are flown, jumps followed, so many items beyond their targets."""
    left: dict[int, int] = {}
    number = 0
    while number < len(plan.items):
        item = plan.items[number]
        if item.command == 177:
            target, times = int(item.params[0] or 0), int(item.params[1] or 0)
            if left.setdefault(number, times) > 0:
                left[number] -= 1
                number = target + jump_beyond
                continue
        else:
            yield item
        number += 1


def place(item: Item) -> tuple[float, float, float]:
    """m north, east and up of the take-off."""
    latitude, longitude, height = item.params[4:]
    north, east = geo.offset(*HOME[:2], latitude or 0.0, longitude or 0.0)
    return (north, east, (height or 0.0) - (HOME[2] if item.frame == GLOBAL else 0.0))


class Log:
    """What the simulator says of one drone, oldest first."""

    def __init__(self, entries: list[dict[str, Any]]) -> None:
        self.entries = entries

    def poses(self) -> list[tuple[float, dict[str, float]]]:
        """Ten times a second."""
        return [(entry["t"], entry["args"]) for entry in self.entries if entry["kind"] == "pose"]

    def track(self) -> list[tuple[float, tuple[float, float, float]]]:
        """(s, m north, east and up) ten times a second."""
        return [(t, (pose["north"], pose["east"], pose["up"])) for t, pose in self.poses()]

    def photos(self) -> list[float]:
        """When pictures were taken."""
        events = [(entry["t"], entry["name"], entry["args"]) for entry in self.entries if entry["kind"] == "event"]
        return [t for t, name, args in events if args.get(PHOTO_EVENTS.get(name, "")) == TAKEN]

    def simulated(self, begin: float, end: float) -> float:
        """s that went by in the simulated world meanwhile, which a busy machine slows down."""
        times = [pose["time"] for t, pose in self.poses() if begin <= t <= end]
        return times[-1] - times[0]

    def lines(self) -> list[tuple[float, str]]:
        """Lines of its plan that do something, when they began. Others set what they need: speed, view, modes."""
        known = {name for names in LINES.values() for name in names}
        items = [(entry["t"], entry["args"]["command"]) for entry in self.entries if entry["name"] == "item"]
        return [(t, name) for t, name in items if name in known]

    def starts(self) -> list[float]:
        """When files were begun."""
        observed = [(entry["t"], entry["args"]) for entry in self.entries if entry["kind"] == entry["name"] == "plan"]
        return [t for t, args in observed if args["state"] == "playing"]

    def camera(self) -> list[str]:
        """What plan and gateway had the camera do."""
        orders = [entry["args"] for entry in self.entries if entry["name"] == "payload"]
        names = [order["command"].rpartition(".")[2] if "command" in order else "panorama" for order in orders]
        return [name for name in names if not name.startswith("set_")]

    def zooms(self) -> list[float]:
        """What the camera was asked to zoom to, 1 is not at all; what is repeated for want of an answer once."""
        orders = [
            (entry["t"], entry["args"]["target"])
            for entry in self.entries
            if entry["kind"] == "command" and entry["name"].rpartition(".")[2] in ZOOM_ORDERS
        ]
        pairs = itertools.pairwise([(-math.inf, math.nan), *orders])
        return [target for (then, last), (t, target) in pairs if target != last or t - then <= REPEATED]


def check(log: Log, plan: Plan, jump_beyond: int = 0) -> list[tuple[float, Item]]:
    """Each way point was passed within 2 m, and what is between two of them was done between them, in order.

    Returns the items and when they were begun. `jump_beyond`: see `executed`.
    """
    track, lines = log.track(), log.lines()
    wanted = [item for item in executed(plan, jump_beyond) if item.command in LINES]
    begun: list[tuple[float, Item]] = []
    position = 0

    def passed(where: tuple[float, float, float], number: int) -> None:
        nonlocal position
        began, name = lines[position]
        assert name == "waypoint", (number, lines[position:])
        position += 1
        end = lines[position][0]
        behind = next((t for t, _ in track if t > end), end)  # later than usual on a busy machine
        flown = [at for t, at in track if began <= t <= max(end + 0.2, behind)]
        closest = min(itertools.starmap(partial(apart, where), itertools.pairwise(flown)))
        assert closest < WITHIN, (number, closest)

    def stays() -> bool:
        """A way point where the drone is: an Ai begins a file over its first one, whatever stands in front of that.

        In the air it climbs first, to its return height if that is higher (Parrot's flight plan page), and comes back.
        """
        began, name = lines[position]
        start = max(t for t in log.starts() if t <= began)
        points = [at for t, at in track if start <= t <= lines[position + 1][0]]
        return (
            name == "waypoint"
            and math.dist(points[0], points[-1]) < WITHIN
            and all(math.dist(points[0][:2], at[:2]) < WITHIN for at in points)
        )

    for number, item in enumerate(wanted):
        names = LINES[item.command]
        while lines[position][1] not in names and (lines[position][1] in SET_ANEW or stays()):
            position += 1
        begun.append((lines[position][0], item))
        if names == ("waypoint",):
            passed(place(item), number)
            continue
        if item.command == DISTANCE and item.params[0] == 0.0 and item.params[2] == 1.0:
            assert lines[position][1] == "stop_photo"  # and one more
            position += 1
        assert lines[position][1] in names, (number, item, lines[position:])
        position += 1
        if names == ("takeoff",):
            passed((0.0, 0.0, item.params[6] or 0.0), number)
    assert position == len(lines), lines[position:]
    return begun


def until_next(begun: Sequence[tuple[float, Item]], commands: Sequence[int]) -> Iterator[tuple[int, float, float]]:
    """Of each item with one of these commands: its place among all, when it was begun, and when the next such was."""
    chosen = [(number, t) for number, (t, item) in enumerate(begun) if item.command in commands]
    for (number, t), (_, end) in itertools.pairwise([*chosen, (len(begun), math.inf)]):
        yield number, t, end


def tilts(log: Log, begun: Sequence[tuple[float, Item]]) -> list[float]:
    """What the gimbal items came to, deg: where the camera pointed just before anything else aimed it."""
    held = []
    for number, t, end in until_next(begun, (*GIMBAL, REGION, AHEAD, *ENDS)):
        if begun[number][1].command in GIMBAL:
            held.append([pose["gimbal_pitch"] for at, pose in log.poses() if t <= at < end][-1])
    return held


def looked(log: Log, begun: Sequence[tuple[float, Item]]) -> bool:
    """Nose and camera are on the region of interest for as long as it holds; False when there is none."""
    found = False
    for number, t, end in until_next(begun, (*GIMBAL, REGION, AHEAD, *ENDS)):
        if begun[number][1].command != REGION:
            continue
        region = place(begun[number][1])
        seen = [pose for at, pose in log.poses() if t + TURNED <= at < end]
        assert seen
        found = True
        for pose in seen:
            north, east, up = (a - pose[key] for a, key in zip(region, ("north", "east", "up"), strict=True))
            elevation = math.degrees(math.atan2(up, math.hypot(north, east)))
            aside = math.degrees(math.atan2(east, north) - pose["yaw"])
            assert abs(pose["gimbal_pitch"] - elevation) < FOLLOWED, pose
            assert abs((aside + 180.0) % 360.0 - 180.0) < FOLLOWED, pose
    return found


def distance_photos(way: Sequence[Sequence[float]], step: float) -> int:
    """Photos on a way: one where it begins, and one wherever the last is `step` m away, as the crow flies."""
    count, last = 1, way[0][:2]
    for begin, end in itertools.pairwise(way):
        parts = math.ceil(math.dist(begin[:2], end[:2]) / 0.1)
        for part in range(1, parts + 1):
            here = [a + (b - a) * part / parts for a, b in zip(begin[:2], end[:2], strict=True)]
            if math.dist(here, last) >= step:
                count, last = count + 1, here
    return count


def photos(log: Log, begun: Sequence[tuple[float, Item]]) -> list[tuple[int, int]]:
    """(taken, expected) from each item of the camera until the next; panoramas are left out.

    A lapse in time takes one photo at once and one in each interval of the time until it is ended, a lapse in distance
    as many as the way that the drone was on meanwhile has room for.
    """
    counts = []
    for number, t, end in until_next(begun, CAMERA):
        item = begun[number][1]
        if item.command == PANORAMA:
            continue
        if item.command == DISTANCE and item.params[0]:
            expected = distance_photos([at for time, at in log.track() if t <= time <= end], item.params[0] + LATE)
        elif item.command == PHOTOS and item.params[2] == 0.0:
            expected = 1 + int(log.simulated(t, end) / (item.params[1] or math.inf))
        else:
            expected = int(item.command == PHOTOS or (item.command == DISTANCE and item.params[2] == 1.0))
        counts.append((sum(t <= at < end for at in log.photos()), expected))
    return counts

"""Flight-plan writer: `rules` use it to write the lines of the drone's files.

A `FlightPlanFile` is one file. Settings made before its start that still hold (speed, region of interest, gimbal) are
written again at its beginning, because no setting of one file holds in the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NoReturn

from anafi_mav import geo, mav_enums
from anafi_mav.plans.formats import parrot
from anafi_mav.plans.formats.parrot import SET_STILL_MODE, SET_VIEW_MODE, Version
from anafi_mav.plans.plan import (
    GLOBAL,
    GLOBAL_INT,
    MISSION,
    RELATIVE,
    RELATIVE_INT,
    TERRAIN,
    TERRAIN_INT,
    WAYPOINT,
    Item,
    Loss,
    Params,
    Point,
)
from anafi_mav.plans.rules.parts import (
    FaultKind,
    FlightPlanFile,
    GatewayStep,
    ItemSettings,
    Start,
    TranslationFault,
    TranslationRefused,
    UnknownHeight,
)
from anafi_mav.units import DEG_PER_RAD, wrap_360

ACCEPTANCE = 1.0
"""m from a way point that names no radius: with Parrot's own 5 m one counts as reached that has not been flown over."""

SAME_PLACE = 1.0
"""m: to a point this near there is no direction to look in."""

RECTILINEAR = 12.0
"""Format of photos (Parrot's flight plan page): MAVLink has no word for it, and this is what the camera begins with."""

HIGHEST = 20_000.0
"""m, above and below: a height beyond is a number in the wrong field. The highest ground is 9 km above the sea."""

SLOWEST_TURN = 0.1
"""deg/s. A full turn takes an hour then, longer than an ANAFI flies."""

LARGEST_HEADING = 720.0
"""deg: two turns. A larger heading or angle is a number in the wrong field."""

SHORTEST_INTERVAL, SHORTEST_STEP = 2.0, 1.0
"""s and m between photos (capability messages of the cameras, arsdk camera feature)."""

ABSOLUTE, LOOK_AT_ROI = 0.0, 2.0
"""Of SET_VIEW_MODE: each way point's own heading; a region of interest."""

TIMELAPSE, GPSLAPSE = 0.0, 1.0
"""Of SET_STILL_MODE."""

_SET_ROI, _ROI_PLACE = mav_enums.MAV_CMD_DO_SET_ROI, float(mav_enums.MAV_ROI_LOCATION)
_DELAY = {1: mav_enums.MAV_CMD_CONDITION_DELAY, 2: mav_enums.MAV_CMD_NAV_DELAY}
_TAKE_TIME = frozenset({*_DELAY.values(), mav_enums.MAV_CMD_PANORAMA_CREATE})
_SETS = frozenset(
    {
        mav_enums.MAV_CMD_DO_CHANGE_SPEED,
        mav_enums.MAV_CMD_DO_MOUNT_CONTROL,
        mav_enums.MAV_CMD_DO_SET_ROI_LOCATION,
        mav_enums.MAV_CMD_DO_SET_ROI_NONE,
        SET_VIEW_MODE,
        SET_STILL_MODE,
    }
)
"""Commands that are the same wherever they are done."""

_GLOBAL_FRAMES = frozenset({GLOBAL, GLOBAL_INT, RELATIVE, RELATIVE_INT, TERRAIN, TERRAIN_INT})

_TARGETING = float(mav_enums.MAV_MOUNT_MODE_MAVLINK_TARGETING)


class FlightPlanWriter:
    """Writes legs; knows where the drone will be."""

    def __init__(
        self, version: Version, start: Start, items: Sequence[Item] = (), settings: ItemSettings | None = None
    ) -> None:
        """`items` is the whole mission, whose regions of interest are numbered."""
        self.version = version
        self.settings = settings or ItemSettings()
        self.films_again = False
        """The first file begins the photos or the video that the settings have."""
        self.regions = tuple(item for item in items if item.command == _SET_ROI and item.params[0] == _ROI_PLACE)
        self.numbers_regions = any(item.command == SET_VIEW_MODE and item.params[0] == LOOK_AT_ROI for item in items)
        """SET_ROI only numbers them, as in Parrot's version 1."""
        self.place = Point(start.latitude, start.longitude, start.ato)
        """Position of the drone after the lines written so far; height above take-off."""
        self.heading = start.heading
        self.flying = start.flying
        self.item = 0
        """Number of the item that is being written."""
        self.muted = False
        """Only settings are taken; nothing is flown."""
        self.parts: list[FlightPlanFile | GatewayStep] = []
        self.notes: dict[Loss, None] = {}
        """A set that keeps its order: an item that is flown again says the same again."""
        self.written = 0
        """Lines and steps of all parts."""
        self.flown = 0
        """Of them, those that take their time: ways to another place, waits, turns, panoramas."""
        self.photographed = 0
        """Lines that take photos; their duration is not documented."""
        self._amsl = start.takeoff_amsl
        self._is_assumed = start.is_assumed
        self._stopped = False
        """No photo has been taken since they were stopped."""
        self._mode_wanted: int | None = None
        """The item that set the camera's mode, until something is photographed."""
        self.waiting: list[int] = []
        """Items that are done with what is written next, for nothing has been."""
        self._lines: list[Item] = []
        self._origins: list[int] = []
        self._done: list[list[int]] = []
        self._began, self._began_heading = self.place, self.heading
        """Position and heading of the drone at the start of this file."""
        self._rois: list[Point] = []
        """Of this file, by their number in it."""
        self._still: tuple[float, float, float] | None = None
        """Values of SET_STILL_MODE that this file has set: mode, step, format."""

    # -- what rules say

    def say(self, what: str) -> None:
        """Something of the item is not flown as the mission has it."""
        self.notes[Loss(what, self.item)] = None

    def refuse(self, reason: str, param: int | None = None, kind: FaultKind | None = None) -> NoReturn:
        """The item cannot be flown."""
        kind = kind or (FaultKind.COMMAND if param is None else FaultKind.PARAM)
        raise TranslationRefused(TranslationFault(self.item, reason, kind, param))

    # -- parts

    def finish(self) -> None:
        """The present item has been written."""
        if self.muted:
            return
        if self._done:
            self._done[-1].append(self.item)
        elif not self.parts:
            self.waiting.append(self.item)
        else:
            last = self.parts[-1]
            if isinstance(last, GatewayStep):
                self.parts[-1] = replace(last, done=(*last.done, self.item))
            else:
                self.parts[-1] = replace(last, done=(*last.done[:-1], (*last.done[-1], self.item)))

    def step(self) -> None:
        """The gateway flies the present item."""
        if self.muted:
            return
        self.close()
        self.written += 1
        self.parts.append(GatewayStep(self.item, tuple(self.waiting)))
        self.waiting.clear()

    def close(self) -> None:
        """End the current file; the next line begins another one."""
        if self._lines:
            self._stay()
            content, lost = parrot.write_items(self._lines, self.version)
            if lost or len(self._lines) != len(content.splitlines()) - 1:
                raise AssertionError(f"lines that version {self.version} cannot hold: {lost}")
            self.parts.append(FlightPlanFile(content, tuple(self._origins), tuple(map(tuple, self._done))))
        self._lines, self._origins, self._done = [], [], []
        self._rois, self._still = [], None

    def _stay(self) -> None:
        """Put in front of a file for an Ai in the air that it is to be here.

        Before anything else it goes to above its first way point (Parrot's flight plan page): what stands before that
        one would be done there.
        """
        commands = [line.command for line in self._lines]
        if self.version == 1 or commands[0] == mav_enums.MAV_CMD_NAV_TAKEOFF or WAYPOINT not in commands:
            return
        if not all(command in _SETS for command in commands[: commands.index(WAYPOINT)]):
            here = self._began
            values: Params = (0.0, ACCEPTANCE, None, self._began_heading, here.latitude, here.longitude, here.height)
            self._lines.insert(0, Item(WAYPOINT, RELATIVE, values))
            self._origins.insert(0, self._origins[0])
            self._done.insert(0, [])
            self.written += 1

    def line(self, command: int, *params: float | None, at: Point | None = None) -> None:
        """One line; `params` from the first on."""
        if self.muted:
            return
        if not self._lines:
            self._open()
        self._put(command, *params, at=at)

    def _put(self, command: int, *params: float | None, at: Point | None = None) -> None:
        unset: list[float | None] = [None] * (7 - len(params))
        one, two, three, four, five, six, seven = [*params, *unset]
        values: Params = (one, two, three, four, five, six, seven)
        if at is not None:
            values = (one, two, three, four, at.latitude, at.longitude, at.height)
        self._lines.append(Item(command, MISSION if at is None else RELATIVE, values))
        self._origins.append(self.item)
        self._done.append([*self.waiting])
        self.waiting.clear()
        self.written += 1
        self.flown += command in _TAKE_TIME
        self.photographed += command == mav_enums.MAV_CMD_IMAGE_START_CAPTURE

    def _open(self) -> None:
        """Before the first line of a file: the way up, and what holds."""
        self._began, self._began_heading = self.place, self.heading
        if not self.flying:
            self.flying = True
            self._put(mav_enums.MAV_CMD_NAV_TAKEOFF)
        holds = self.settings
        if holds.speed is not None:
            self._put_speed(*holds.speed)
        if holds.view is not None:
            self._put_view(holds.view)
        if holds.gimbal is not None:
            self._put_gimbal(*holds.gimbal)
        if holds.roi is not None:
            self._put_roi(holds.roi)
        if self.films_again:
            self.films_again = False
            if holds.photos is not None:
                mode, step = holds.photos
                self.stop_photos()
                self._many(mode, step, 0.0)
            elif holds.films:
                self._put(mav_enums.MAV_CMD_VIDEO_START_CAPTURE)

    def take_off(self, climb: Point | None) -> None:
        """From the ground; `climb`: at once to there."""
        if not self._lines:
            self._open()
        if climb is not None:
            self.fly(climb, None, None)

    # -- places

    def height(self, item: Item) -> float | None:
        """The height that an item names, above take-off."""
        value = item.params[6]
        if value is None:
            return None
        if abs(value) > HIGHEST:
            self.refuse(f"invalid height of {value:g} m", 7)
        if item.frame in (RELATIVE, RELATIVE_INT):
            return value
        if item.frame in (TERRAIN, TERRAIN_INT):
            self.refuse("heights above terrain are unsupported", kind=FaultKind.FRAME)
        self._require_global(item)
        if self._amsl is None:
            problem = "height above mean sea level, but that of the take-off point is unknown"
            raise UnknownHeight("mission", problem, self.item)
        return value - self._amsl

    def is_judgeable(self, item: Item) -> bool:
        """Return False for a height above sea level when the take-off point's is assumed."""
        return not (self._is_assumed and item.frame in (GLOBAL, GLOBAL_INT))

    def names_place(self, item: Item) -> bool:
        """Return True when the item has a position.

        Absent coordinates and 0, 0 mean "here" (MAVLink mission.md, ArduPilot). Other invalid coordinates are
        refused, and metres of a local frame.
        """
        latitude, longitude = item.params[4:6]
        if (latitude or 0.0, longitude or 0.0) == (0.0, 0.0):
            return False
        self._require_global(item)
        if latitude is None or not abs(latitude) <= 90.0:
            self.refuse("no latitude" if latitude is None else f"invalid latitude {latitude:g}", 5)
        if longitude is None or not abs(longitude) <= 180.0:
            self.refuse("no longitude" if longitude is None else f"invalid longitude {longitude:g}", 6)
        return True

    def _require_global(self, item: Item) -> None:
        """Refuse an item whose coordinates are no latitude and longitude."""
        if item.frame not in _GLOBAL_FRAMES:
            self.refuse(f"frame {item.frame} is not global", kind=FaultKind.FRAME)

    def destination(self, item: Item) -> Point:
        """Return the destination of an item.

        Values that it does not set are those at its beginning, also a height of 0 without place.
        """
        latitude, longitude, height = item.params[4:]
        if not self.names_place(item):
            up = self.height(item) if height else None
            return replace(self.place, height=self.place.height if up is None else up)
        up = self.height(item)
        return Point(latitude or 0.0, longitude or 0.0, self.place.height if up is None else up)

    # -- lines

    def fly(self, to: Point, heading: float | None, radius: float | None) -> None:
        """Fly to a point; `heading` deg from north, None: as the drone is set to look.

        MAVSDK's headings are in [-180, 180). The drone's reader is not documented to take a negative one.
        """
        if heading is not None and abs(heading) > LARGEST_HEADING:
            self.refuse(f"invalid heading of {heading:g} deg", 4)
        if self.muted:
            return
        if not self._lines:
            self._open()
        north, east = geo.offset(self.place.latitude, self.place.longitude, to.latitude, to.longitude)
        moves = math.hypot(north, east) >= SAME_PLACE
        self.flown += math.hypot(north, east, to.height - self.place.height) > max(radius or 0.0, ACCEPTANCE)
        bearing = wrap_360(math.atan2(east, north) * DEG_PER_RAD) if moves else self.heading
        wanted = None if heading is None else wrap_360(heading)
        if self.settings.roi is not None:
            wanted = None
        elif self.settings.beside is not None and moves:
            wanted = wrap_360(bearing + self.settings.beside)
        self.place = to
        self.heading = bearing if wanted is None else wanted
        number = self.heading if self.version == 1 else wanted
        self._put(WAYPOINT, 0.0, radius or ACCEPTANCE, None, number, at=to)

    def fly_on(self, to: Point, heading: float | None) -> None:
        """Fly to a point unless the drone is there."""
        if geo.distance(self.place.latitude, self.place.longitude, to.latitude, to.longitude) >= SAME_PLACE:
            self.fly(to, heading, None)

    def turn(self, angle: float, *, relative: bool) -> None:
        """The gateway turns the nose: by so many deg, clockwise +, or to so many from north."""
        if self.muted:
            return
        heading = wrap_360(self.heading + angle if relative else angle)
        self.flown += bool(angle) if relative else heading != self.heading
        self.heading = heading

    def wait(self, seconds: float) -> None:
        if seconds > 0.0:
            # GroundSDK, which made the flight plans of version 1, knows CONDITION_DELAY only (MavlinkCommand.java).
            self.line(_DELAY[self.version], seconds)

    def set_speed(self, kind: float, speed: float) -> None:
        self._set(lambda: self._put_speed(kind, speed), replace(self.settings, speed=(kind, speed)))

    def look_at(self, point: Point) -> None:
        """Nose and camera look at a point from now on."""
        self._set(lambda: self._put_roi(point), replace(self.settings, roi=point, beside=None))

    def look_ahead(self) -> None:
        """Back to what way points say."""
        looked, self.settings = self.settings.roi, replace(self.settings, roi=None, beside=None)
        if looked is None:
            return
        if self.version == 1:
            self.line(SET_VIEW_MODE, *((self.settings.view or (ABSOLUTE, 0.0))[:2]))
        else:
            self.line(mav_enums.MAV_CMD_DO_SET_ROI_NONE)

    def look_beside(self, angle: float) -> None:
        self.settings = replace(self.settings, beside=angle)

    def aim(self, pitch: float | None, roll: float | None = None, yaw: float | None = None) -> None:
        """Turn the camera; an angle of None does not change."""
        was = self.settings.gimbal or (None, None, None)
        pitch = was[0] if pitch is None else pitch
        roll = was[1] if roll is None else roll
        yaw = was[2] if yaw is None else yaw
        self._set(lambda: self._put_gimbal(pitch, roll, yaw), replace(self.settings, gimbal=(pitch, roll, yaw)))

    def view(self, mode: float, gimbal: float | None) -> None:
        values = (mode, 0.0, gimbal)
        self._set(lambda: self._put_view(values), replace(self.settings, roi=None, view=values))

    def _set(self, put: Callable[[], None], settings: ItemSettings) -> None:
        """Set something; at the beginning of a file that is what `_open` does."""
        if not self.muted and not self._lines:
            self.settings = settings
            self._open()
            return
        self.settings = settings
        if not self.muted:
            put()

    def _put_speed(self, kind: float, speed: float) -> None:
        if self.version == 1:
            self._put(mav_enums.MAV_CMD_DO_CHANGE_SPEED, kind, speed)
        else:
            self._put(mav_enums.MAV_CMD_DO_CHANGE_SPEED, kind, speed, -1.0, 0.0)

    def _put_view(self, values: tuple[float | None, float | None, float | None]) -> None:
        self._put(SET_VIEW_MODE, *values[: 2 if self.version == 1 else 3])

    def _put_gimbal(self, pitch: float | None, roll: float | None, yaw: float | None) -> None:
        command = mav_enums.MAV_CMD_DO_MOUNT_CONTROL
        if self.version == 1 and pitch is None:  # that version has no word for "as it is"
            return
        values = (pitch,) if self.version == 1 else (pitch, roll, yaw, None, None, None, _TARGETING)
        last = self._lines[-1] if self._lines else None
        if last is not None and last.command == command and last.params[: len(values)] == values:
            return  # once is enough: a file of ours that is read again has the line that looking ahead brings
        self._put(command, *values)

    def _put_roi(self, point: Point) -> None:
        if self.version == 2:
            self._put(mav_enums.MAV_CMD_DO_SET_ROI_LOCATION, at=point)
            return
        if point not in self._rois:
            self._rois.append(point)
            self._put(_SET_ROI, _ROI_PLACE, at=point)
        self._put(SET_VIEW_MODE, LOOK_AT_ROI, float(self._rois.index(point)))

    # -- photos and video

    def want_mode(self) -> None:
        """The present item is to set the camera's mode: the next photo or video does."""
        self.end_modes()
        self._mode_wanted = self.item

    def end_modes(self) -> None:
        """Nothing is photographed any more before the mode is set again, or before the end."""
        if self._mode_wanted is not None:
            what = "the camera mode changes only with a photo or video, and none follows"
            self.notes[Loss(what, self._mode_wanted)] = None
        self._mode_wanted = None

    def set_still(self, mode: float, step: float, form: float) -> None:
        """How photos are taken from now on; the line stands before the first that needs it."""
        self.settings = replace(self.settings, still=(mode, step, form))

    def photo(self) -> None:
        """One."""
        self._idle("photo")
        # A count of 1 without an interval is one photo in the still mode that holds (StartPhotoCaptureCommand.java).
        held = self._still is not None and self._still[0] == TIMELAPSE
        self._still_mode(TIMELAPSE, self._still[1] if held and self._still else SHORTEST_INTERVAL)
        self._photos(0.0, 1.0)

    def photos_in_time(self, seconds: float, count: float) -> None:
        """A photo every so often; a count of 0 is without end."""
        self._many(TIMELAPSE, seconds, count)

    def photos_on_the_way(self, metres: float, count: float) -> None:
        """A photo every so far."""
        self._many(GPSLAPSE, metres, count)

    def stop_photos(self) -> None:
        """Stop taking photos.

        No line is written when they are already stopped: ground stations stop twice, in two ways.
        """
        self.settings = replace(self.settings, photos=None)
        if not self._stopped:
            self.line(mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE)
            self._stopped = not self.muted

    def film(self) -> None:
        if self.settings.photos is not None:
            self.refuse("video during photos: the camera does one at a time", kind=FaultKind.PLAN)
        self._mode_wanted = None
        self.line(mav_enums.MAV_CMD_VIDEO_START_CAPTURE)
        self.settings = replace(self.settings, films=True)

    def stop_film(self) -> None:
        self.settings = replace(self.settings, films=False)
        self.line(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE)

    def panorama(self, *params: float | None) -> None:
        self._idle("panorama")
        self.line(mav_enums.MAV_CMD_PANORAMA_CREATE, *params)

    def _idle(self, what: str) -> None:
        """Refuse what the camera cannot begin now."""
        if self.settings.films:
            self.refuse(f"{what} during a video: the camera does one at a time", kind=FaultKind.PLAN)
        if self.settings.photos is not None:
            self.refuse(f"{what} during photos: stop them first", kind=FaultKind.PLAN)
        self._mode_wanted = None

    def _many(self, mode: float, step: float, count: float) -> None:
        if self.settings.photos is not None:
            self.stop_photos()
        self._idle("photo")
        self._still_mode(mode, step)
        self._photos(step if mode == TIMELAPSE else 0.0, count)
        if count == 0.0:
            self.settings = replace(self.settings, photos=(mode, step))

    def _still_mode(self, mode: float, step: float) -> None:
        form = self.settings.still[2] if self.settings.still else RECTILINEAR
        wanted = (mode, step, form)
        if not self.muted and self._still != wanted:
            self.line(SET_STILL_MODE, *wanted)
            self._still = wanted

    def _photos(self, interval: float, count: float) -> None:
        self._stopped = False
        sequence = 1.0 if self.version == 2 and count == 1.0 else None
        self.line(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, None, interval, count, sequence)

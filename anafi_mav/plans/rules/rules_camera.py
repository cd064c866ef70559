"""Commands of the camera and the gimbal, and what is looked at: see `rules`."""

from __future__ import annotations

from anafi_mav import mav_enums
from anafi_mav.plans.formats.parrot import SET_STILL_MODE, SET_VIEW_MODE
from anafi_mav.plans.plan import Item, Point
from anafi_mav.plans.rules.flight_plan_writer import (
    LARGEST_HEADING,
    SHORTEST_INTERVAL,
    SHORTEST_STEP,
    SLOWEST_TURN,
    FlightPlanWriter,
)
from anafi_mav.plans.rules.rule import Fidelity, Rule, only

_CAMERAS = frozenset({None, 0.0, 1.0, 100.0})
"""Camera ids that mean the one of the flight plan: all, the first, and its component."""

_GIMBALS = frozenset({None, 0.0, 1.0, 154.0})

_TILT = {1: (-90.0, 90.0), 2: (-116.0, 176.0)}
"""deg that the camera tilts, by version of the flight plan (data sheets of the 4K, Thermal, USA; of the Ai)."""

_FORMATS = frozenset({None, 0.0, 12.0, 13.0, 14.0, 15.0})
_UNSET = frozenset({None, 0.0, -1.0})


def _camera(writer: FlightPlanWriter, item: Item, number: int) -> None:
    only(writer, item, number, "only the main camera, component 100, is supported", _CAMERAS)


LONGEST_INTERVAL = 3600.0
"""s between photos. No ANAFI flies for as long: a longer interval is a number in the wrong field or unit."""

FASTEST_PANORAMA = 720.0
"""deg/s. Faster than any drone or gimbal turns: a number in the wrong field."""


def _gimbal(writer: FlightPlanWriter, item: Item, number: int) -> None:
    only(writer, item, number, "the gimbal is device 1, not this", _GIMBALS)


def _require_angles(writer: FlightPlanWriter, item: Item, *numbers: int) -> None:
    """Refuse an angle beyond two turns in one of these params."""
    for number in numbers:
        angle = item.params[number - 1]
        if angle is not None and abs(angle) > LARGEST_HEADING:
            writer.refuse(f"invalid angle of {angle:g} deg", number)


# What is looked at.


def _look(writer: FlightPlanWriter, item: Item) -> None:
    if not writer.names_place(item):
        writer.refuse("no place", 5)
    latitude, longitude = item.params[4:6]
    writer.look_at(Point(latitude or 0.0, longitude or 0.0, writer.height(item) or 0.0))


def _roi_location(writer: FlightPlanWriter, item: Item) -> None:
    _gimbal(writer, item, 1)
    _look(writer, item)


def _roi_beside(writer: FlightPlanWriter, item: Item) -> None:
    _gimbal(writer, item, 1)
    pitch, roll, yaw = item.params[4:]
    if roll not in (None, 0.0):
        writer.refuse("camera roll is unsupported", 6)
    _require_angles(writer, item, 7)
    writer.look_ahead()
    writer.look_beside(yaw or 0.0)
    _tilt(writer, pitch or 0.0, 5)


def _roi_none(writer: FlightPlanWriter, item: Item) -> None:
    _gimbal(writer, item, 1)
    _look_ahead(writer)


def _look_ahead(writer: FlightPlanWriter) -> None:
    looked = writer.settings.roi is not None or writer.settings.beside is not None
    writer.look_ahead()
    if looked:
        writer.aim(0.0)


def _roi(writer: FlightPlanWriter, item: Item) -> None:
    mode = item.params[0]
    if mode not in (None, 0.0, float(mav_enums.MAV_ROI_LOCATION)):
        writer.refuse("only a place can be a region of interest", 1)
    if writer.numbers_regions:
        if not writer.names_place(item):
            writer.refuse("no place", 5)
        writer.height(item)
        return
    if mode or writer.names_place(item):
        _look(writer, item)
    else:
        _look_ahead(writer)


def _view_mode(writer: FlightPlanWriter, item: Item) -> None:
    mode, number, gimbal = item.params[:3]
    if mode in (0.0, 1.0):
        writer.view(mode, gimbal)
        return
    if mode != 2.0:
        writer.refuse("unknown view mode", 1)
    if number is None or not number.is_integer() or not 0 <= number < len(writer.regions):
        writer.refuse("unknown region of interest", 2)
    _look(writer, writer.regions[int(number)])


# The gimbal.


def _tilt(
    writer: FlightPlanWriter, pitch: float | None, number: int, roll: float | None = None, yaw: float | None = None
) -> None:
    lowest, highest = _TILT[writer.version]
    if pitch is not None and not lowest <= pitch <= highest:
        writer.refuse(f"pitch of {pitch:g} deg, the camera has {lowest:g} to {highest:g} deg", number)
    if writer.settings.roi is not None:
        writer.look_ahead()
    writer.aim(pitch, roll, yaw)


def _mount(writer: FlightPlanWriter, item: Item) -> None:
    pitch, roll, yaw = item.params[:3]
    mode = item.params[6]
    if mode == mav_enums.MAV_MOUNT_MODE_NEUTRAL:
        _tilt(writer, 0.0, 1, 0.0, 0.0)
        return
    if mode not in (None, float(mav_enums.MAV_MOUNT_MODE_RETRACT), float(mav_enums.MAV_MOUNT_MODE_MAVLINK_TARGETING)):
        writer.refuse("only angles are supported", 7)
    if mode == mav_enums.MAV_MOUNT_MODE_RETRACT:
        writer.say("the gimbal cannot retract: it is aimed")
    if writer.version == 1:
        only(writer, item, 2, "camera roll is unsupported")
        only(writer, item, 3, "the camera does not pan: turn the drone")
    _require_angles(writer, item, 2, 3)
    _tilt(writer, pitch, 1, roll, yaw)


def _mount_mode(writer: FlightPlanWriter, item: Item) -> None:
    mode = item.params[0]
    if mode not in (None, 0.0, 1.0, float(mav_enums.MAV_MOUNT_MODE_MAVLINK_TARGETING)):
        writer.refuse("only angles are supported", 1)
    if mode == mav_enums.MAV_MOUNT_MODE_NEUTRAL:
        _tilt(writer, 0.0, 1, 0.0, 0.0)


def _pitch_yaw(writer: FlightPlanWriter, item: Item) -> None:
    pitch, yaw, _, _, flags = item.params[:5]
    _gimbal(writer, item, 7)
    only(writer, item, 3, "gimbal rates are unsupported")
    only(writer, item, 4, "gimbal rates are unsupported")
    bits = int(flags or 0.0)
    if bits & (mav_enums.GIMBAL_MANAGER_FLAGS_RETRACT | mav_enums.GIMBAL_MANAGER_FLAGS_NEUTRAL):
        _tilt(writer, 0.0, 1, 0.0, 0.0)
        if bits & mav_enums.GIMBAL_MANAGER_FLAGS_RETRACT:
            writer.say("the gimbal cannot retract: it looks ahead")
        return
    earth = bits & (mav_enums.GIMBAL_MANAGER_FLAGS_YAW_LOCK | mav_enums.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME)
    if yaw is not None and (earth or (yaw != 0.0 and writer.version == 1)):
        writer.refuse("the camera does not pan: turn the drone" if writer.version == 1
                   else "the camera's yaw from north is unsupported", 2)  # fmt: skip
    _require_angles(writer, item, 2)
    _tilt(writer, pitch, 1, None, yaw)


def _gimbal_owner(writer: FlightPlanWriter, item: Item) -> None:
    _gimbal(writer, item, 7)


# The camera.


def _camera_mode(writer: FlightPlanWriter, item: Item) -> None:
    _camera(writer, item, 1)
    if item.params[1] not in (0.0, 1.0, 2.0):
        writer.refuse("unknown camera mode", 2)
    writer.want_mode()


def _still_mode(writer: FlightPlanWriter, item: Item) -> None:
    mode, step, form = item.params[:3]
    if mode not in (0.0, 1.0):
        writer.refuse("photos need an interval or a distance", 1)
    only(writer, item, 3, "unknown photo format", _FORMATS)
    writer.set_still(mode, step or 0.0, form or 0.0)


def _interval(writer: FlightPlanWriter, seconds: float, number: int) -> None:
    if seconds < SHORTEST_INTERVAL:
        writer.refuse(f"the camera needs {SHORTEST_INTERVAL:g} s between photos, not {seconds:g}", number)
    if seconds > LONGEST_INTERVAL:
        writer.refuse(f"invalid interval of {seconds:g} s", number)


def _distance(writer: FlightPlanWriter, metres: float, number: int) -> None:
    if metres < SHORTEST_STEP:
        writer.refuse(f"the camera needs {SHORTEST_STEP:g} m between photos, not {metres:g}", number)


def _photos(writer: FlightPlanWriter, item: Item) -> None:
    interval, count = item.params[1:3]
    _camera(writer, item, 1)
    if count is None or count < 0.0 or not count.is_integer():
        writer.refuse("no number of photos", 3)
    if count == 1.0:
        writer.photo()
    elif interval:
        _interval(writer, interval, 2)
        writer.photos_in_time(interval, count)
    elif writer.settings.still is None:
        writer.refuse("no interval", 2)
    elif writer.settings.still[0] == 1.0:
        _distance(writer, writer.settings.still[1], 2)
        writer.photos_on_the_way(writer.settings.still[1], count)
    else:
        _interval(writer, writer.settings.still[1], 2)
        writer.photos_in_time(writer.settings.still[1], count)


def _stop_photos(writer: FlightPlanWriter, item: Item) -> None:
    _camera(writer, item, 1)
    writer.stop_photos()


def _trigger_distance(writer: FlightPlanWriter, item: Item) -> None:
    metres, shutter, at_once = item.params[:3]
    _camera(writer, item, 4)
    if metres is None or metres < 0.0:
        writer.refuse("no distance", 1)
    if metres == 0.0:
        writer.stop_photos()
        if at_once:
            writer.photo()
        return
    _distance(writer, metres, 1)
    if shutter not in _UNSET:
        writer.say(f"shutter time of {shutter:g} ms is ignored")
    if not at_once:
        writer.say("the first photo is taken immediately")
    writer.photos_on_the_way(metres, 0.0)


def _trigger_interval(writer: FlightPlanWriter, item: Item) -> None:
    period, shutter = item.params[:2]
    _camera(writer, item, 3)
    if period in _UNSET:
        return
    _interval(writer, (period or 0.0) / 1000.0, 1)
    if shutter not in _UNSET:
        writer.say(f"shutter time of {shutter:g} ms is ignored")
    writer.photos_in_time((period or 0.0) / 1000.0, 0.0)


def _digicam(writer: FlightPlanWriter, item: Item) -> None:
    for number, what in ((1, "lens control is unsupported"), (2, "zoom by SET_CAMERA_ZOOM"),
                         (3, "zoom by SET_CAMERA_ZOOM"), (4, "focus is unsupported")):  # fmt: skip
        only(writer, item, number, what)
    only(writer, item, 5, "unknown shooting command", frozenset({None, 0.0, 1.0}))
    if item.params[4] == 1.0:
        writer.photo()


def _video(writer: FlightPlanWriter, item: Item) -> None:
    _camera(writer, item, 3)
    writer.film()


def _stop_video(writer: FlightPlanWriter, item: Item) -> None:
    _camera(writer, item, 3)
    writer.stop_film()


def _panorama(writer: FlightPlanWriter, item: Item) -> None:
    if not item.params[0] and not item.params[1]:
        writer.refuse("no angles", 1)
    _require_angles(writer, item, 1, 2)
    for number in (3, 4):
        speed = item.params[number - 1]
        if speed and not SLOWEST_TURN <= speed <= FASTEST_PANORAMA:
            writer.refuse(f"invalid speed of {speed:g} deg/s", number)
    writer.panorama(*item.params[:4])


def _zoom(writer: FlightPlanWriter, item: Item) -> None:
    kind, value = item.params[:2]
    _camera(writer, item, 3)
    if kind != float(mav_enums.ZOOM_TYPE_RANGE):
        writer.refuse("only a zoom range in percent is supported", 1)
    if value is None or not 0.0 <= value <= 100.0:
        writer.refuse("zoom range is not 0 to 100 %", 2)


_EXACT, _NEARLY, _STEPPED = Fidelity.EXACT, Fidelity.APPROXIMATED, Fidelity.STEPPED

_ONE_CAMERA = "Another camera than the main one (0, 1 or 100) is refused."
_ONE_GIMBAL = "Another gimbal device than 0, 1 or 154, which all mean the one, is refused."

CAMERA = (
    Rule(195, _EXACT, "Version 1: a numbered region of interest, and the view mode that looks at it. "
        f"Version 2: itself. Headings of way points count for nothing meanwhile. {_ONE_GIMBAL}", _roi_location),
    Rule(196, _EXACT, "Gimbal to param5, and each way point's heading is the way to it and param7 more. A roll is "
        f"refused. {_ONE_GIMBAL}", _roi_beside),
    Rule(197, _EXACT, "Version 1: the view mode of way points. Version 2: itself. The camera looks ahead again if "
        f"something was looked at. {_ONE_GIMBAL}", _roi_none),
    Rule(201, _EXACT, "As 195 with a place, also with param1 = 0, as ArduPilot has it; as 197 without. Way points and "
        "targets are refused. Where SET_VIEW_MODE numbers them, it only numbers.", _roi),
    Rule(203, _EXACT, "One photo with param5 = 1, nothing with 0. Lens, zoom and focus are refused.", _digicam),
    Rule(204, _EXACT, "Nothing, for the gimbal is always aimed by angles; param1 = 1 looks ahead. Other modes are "
        "refused.", _mount_mode),
    Rule(205, _EXACT, "Gimbal. Version 1 refuses roll and yaw. Angles beyond -90 to 90 deg (Ai: -116 to 176) and "
        "modes 3 to 6 are refused; param7 = 0 aims too, which is said.", _mount),
    Rule(206, _NEARLY, "Photos by distance (GPS lapse), which begin with one: said if param3 is 0. With 0 m they end, "
        "and param3 = 1 then takes one more. Less than 1 m is refused; a shutter time is left out and said. "
        f"{_ONE_CAMERA}", _trigger_distance),
    Rule(214, _EXACT, "Photos by time, which begin with one. Less than 2000 ms is refused; a shutter time is left out "
        f"and said. {_ONE_CAMERA}", _trigger_interval),
    Rule(530, _NEARLY, "Nothing: photos and videos of a plan set the mode themselves; it is said where none comes "
        f"after it. {_ONE_CAMERA}", _camera_mode),
    Rule(531, _STEPPED, "The gateway zooms: a flight plan cannot. Other types than a range (2) are refused. "
        f"{_ONE_CAMERA}", _zoom, moves=True),
    Rule(1000, _EXACT, "Gimbal. Speeds, a yaw from north and, in version 1, any yaw are refused; putting it away looks "
        f"ahead, which is said. {_ONE_GIMBAL}", _pitch_yaw),
    Rule(1001, _EXACT, f"Nothing: the flight plan aims the gimbal itself. {_ONE_GIMBAL}", _gimbal_owner),
    Rule(2000, _EXACT, "Photos, with the still mode before them: one (param3 = 1), or every param2 s. Less than 2 s is "
        f"refused. {_ONE_CAMERA}", _photos),
    Rule(2001, _EXACT, f"Itself. {_ONE_CAMERA}", _stop_photos),
    Rule(2500, _EXACT, "Itself. Photos while it runs, and video while photos are taken without end, are refused: the "
        f"camera does one of them. {_ONE_CAMERA}", _video),
    Rule(2501, _EXACT, f"Itself. {_ONE_CAMERA}", _stop_video),
    Rule(2800, _EXACT, "Itself.", _panorama, moves=True),
    Rule(SET_VIEW_MODE, _EXACT, "Itself, or with param1 = 2 as 195 with the 201 of that number.", _view_mode),
    Rule(SET_STILL_MODE, _EXACT, "Put in front of the next photos.", _still_mode),
)  # fmt: skip

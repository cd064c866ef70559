"""Commands that fly, wait, and say how fast: see `rules`."""

from __future__ import annotations

from dataclasses import replace

from anafi_mav import mav_enums
from anafi_mav.models import MODELS
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.plan import DO_JUMP, FASTEST, SLOWEST, WAYPOINT, Item, Point
from anafi_mav.plans.rules.flight_plan_writer import LARGEST_HEADING, SLOWEST_TURN, FlightPlanWriter
from anafi_mav.plans.rules.rule import Fidelity, Rule

LONGEST_WAIT = 3600.0
"""s. No ANAFI flies for as long; a longer wait is a number in the wrong field, or in another unit."""

WIDEST = 4000.0
"""m of an acceptance radius: the maximum of the drone's MaxDistance. Wider, an item is reached where it begins."""

# What flies.


def _wait(writer: FlightPlanWriter, seconds: float) -> float:
    """Return the wait of param1; refuse the item when it is none."""
    if not 0.0 <= seconds <= LONGEST_WAIT:
        writer.refuse(f"invalid wait of {seconds:g} s", 1)
    return seconds


def _fly(writer: FlightPlanWriter, item: Item, heading: float | None, radius: float | None = None) -> None:
    writer.fly(writer.destination(item), heading, radius)


def _waypoint(writer: FlightPlanWriter, item: Item) -> None:
    hold, radius, beside, heading = item.params[:4]
    seconds = _wait(writer, hold or 0.0)
    if not 0.0 <= (radius or 0.0) <= WIDEST:
        writer.refuse(f"invalid radius of {radius:g} m", 2)
    if not writer.names_place(item):
        writer.say("no place: the drone's position is used")
    if beside:
        writer.say(f"flown over, not passed at {abs(beside):g} m")
    _fly(writer, item, heading, radius)
    writer.wait(seconds)


def _loiter(writer: FlightPlanWriter, item: Item) -> None:
    _fly(writer, item, item.params[3])


def _loiter_time(writer: FlightPlanWriter, item: Item) -> None:
    seconds = _wait(writer, item.params[0] or 0.0)
    _fly(writer, item, None)
    writer.wait(seconds)


def _loiter_to_height(writer: FlightPlanWriter, item: Item) -> None:
    _fly(writer, item, None)


def _take_off(writer: FlightPlanWriter, item: Item) -> None:
    heading, height = item.params[3], writer.height(item) if item.params[6] else None
    away = writer.names_place(item)
    if height is None:
        writer.say("no height: the drone climbs to its default height")
    elif height < 0.0 and writer.is_judgeable(item):
        writer.refuse(f"invalid take-off height of {height:g} m above take-off", 7)
    else:
        up = replace(writer.place, height=max(height, writer.place.height))
        if height > writer.place.height or heading is not None:
            writer.fly(up, heading, None)
    if away:
        there = writer.destination(item)
        writer.fly_on(replace(there, height=max(there.height, writer.place.height)), heading)


def _land(writer: FlightPlanWriter, item: Item) -> None:
    precision, heading = item.params[1], item.params[3]
    if precision == mav_enums.PRECISION_LAND_MODE_REQUIRED:
        writer.refuse("precision landing is unsupported", 2)
    if precision:
        writer.say("lands without precision landing")
    if writer.names_place(item):
        latitude, longitude = item.params[4:6]
        over = Point(latitude or 0.0, longitude or 0.0, writer.place.height)
        if heading is None:
            writer.fly_on(over, None)
        else:
            writer.fly(over, heading, None)
    elif heading:
        writer.say(f"lands with its current heading, not {heading:g} deg")
    writer.line(mav_enums.MAV_CMD_NAV_LAND)


def _return(writer: FlightPlanWriter, item: Item) -> None:
    writer.line(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)


# What waits.


def _delay(writer: FlightPlanWriter, item: Item) -> None:
    seconds = item.params[0]
    if seconds is None or seconds < 0.0:
        writer.refuse("waiting for a time of day is unsupported" if seconds == -1.0 else "no delay", 1)
    writer.wait(_wait(writer, seconds))


def _condition_delay(writer: FlightPlanWriter, item: Item) -> None:
    seconds = _wait(writer, item.params[0] or 0.0)
    if seconds:
        writer.say("the drone waits in place, not on the way to the next waypoint")
    writer.wait(seconds)


def is_relative(reference: float | None) -> bool:
    """True when param4 of a CONDITION_YAW item makes its angle count from the present heading.

    MAVLink has 1 for that. ArduPilot stores a byte and takes every number but 0 so (ArduCopter mode_auto.cpp do_yaw).
    """
    return bool(reference)


def _turn(writer: FlightPlanWriter, item: Item) -> None:
    """Only what the drone looks at then: the gateway turns it."""
    angle, rate, way, reference = item.params[:4]
    if rate and rate < SLOWEST_TURN:
        writer.refuse(f"invalid rate of {rate:g} deg/s", 2)
    if angle is None or abs(angle) > LARGEST_HEADING:
        writer.refuse("no angle" if angle is None else f"invalid angle of {angle:g} deg", 1)
    if reference is not None and not (reference.is_integer() and 0.0 <= reference <= 0xFF):
        writer.refuse(f"invalid reference {reference:g}", 4)
    if way not in (None, -1.0, 0.0, 1.0):
        writer.refuse(f"invalid direction {way:g}", 3)
    relative = is_relative(reference)
    writer.turn(-angle if relative and way == -1.0 else angle, relative=relative)


# What sets.

_AIRSPEED, _GROUNDSPEED = float(mav_enums.SPEED_TYPE_AIRSPEED), float(mav_enums.SPEED_TYPE_GROUNDSPEED)
_SAME = -1.0


def _highest_speed(version: Version) -> float:
    """Return the speed (m/s over ground) of the fastest model that flies files of this version."""
    return max(model.plans().max_speed for model in MODELS.values() if model.plan_version == version)


def _speed(writer: FlightPlanWriter, item: Item) -> None:
    kind, speed, throttle, relative = item.params[:4]
    if kind not in (None, _AIRSPEED, _GROUNDSPEED):
        writer.refuse("climb and descent speeds cannot be set", 1)
    if relative == 1.0:
        writer.refuse("relative speeds are unsupported", 4)
    if throttle not in (None, 0.0, _SAME):
        writer.say(f"throttle of {throttle:g} % is ignored")
    if speed == _SAME:
        return
    if speed is None or not SLOWEST <= speed <= FASTEST:
        writer.refuse("no speed" if speed is None else f"invalid speed of {speed:g} m/s", 2)
    highest = _highest_speed(writer.version)
    if speed > highest:
        writer.say(f"speed {speed:g} m/s: the drone flies {highest:g} m/s at most")
    writer.set_speed(_GROUNDSPEED if kind is None else kind, speed)


def _nothing(writer: FlightPlanWriter, item: Item) -> None:
    """No line."""


_EXACT, _NEARLY, _STEPPED, _REFUSED = Fidelity.EXACT, Fidelity.APPROXIMATED, Fidelity.STEPPED, Fidelity.REFUSED

FLIGHT = (
    Rule(WAYPOINT, _EXACT, "Way point, and a delay of param1 s. A param3 is left out and said: it is flown over. No "
        "place, or 0, 0, is where the drone is then, which is said; half a place is refused.", _waypoint, moves=True,
        place=True),
    Rule(17, _EXACT, "Way point, with which the plan ends: the drone hovers there.", _loiter, moves=True, place=True,
        ends=True),
    Rule(18, _REFUSED, "The drone flies straight lines: draw the circle as way points."),
    Rule(19, _EXACT, "Way point, and a delay of param1 s. A multicopter needs no radius to wait.", _loiter_time,
        moves=True, place=True),
    Rule(20, _EXACT, "Return, with which the plan ends.", _return, moves=True, ends=True),
    Rule(21, _EXACT, "Way point over its place at the height that the drone has there, if it names one, and landing, "
        "with which the plan ends. param2 = 2 is refused, 1 is left out and said; so is a heading without a place.",
        _land, moves=True, ends=True),
    Rule(22, _EXACT, "Take-off (nothing when it flies already), way point straight above at its height, and one at its "
        "place if it names another. Without a height the drone rises as it does by itself, which is said.", _take_off,
        moves=True),
    Rule(31, _EXACT, "Way point.", _loiter_to_height, moves=True, place=True),
    Rule(93, _EXACT, "Delay: CONDITION_DELAY in version 1. Waiting for a time of day is refused.", _delay, moves=True),
    Rule(112, _NEARLY, "Delay: the drone waits where it is, not on the way.", _condition_delay, moves=True),
    Rule(115, _STEPPED, "The gateway turns the drone: a flight plan turns on the way only.", _turn, moves=True),
    Rule(DO_JUMP, _EXACT, "Written out as often as it jumps; what becomes too long, or has no end, is flown file after "
        "file by the gateway (stepped). Its count is that of the whole mission: a loop in a loop is flown so often, "
        "not so often each time, as in PX4 and ArduPilot. One without end in which the drone neither goes to another "
        "place, nor waits, turns or makes a panorama, is refused: photos are not waited for; so is one that goes round "
        "very often for nothing."),
    Rule(178, _EXACT, "Speed. Other types than air and ground speed, -2 (the default) and differences are refused; a "
        "throttle is left out and said. Above its highest speed the drone flies that, which is said.", _speed),
    Rule(189, _EXACT, "Nothing: a mark for aeroplanes that break off a landing.", _nothing),
)  # fmt: skip

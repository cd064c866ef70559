"""Commands that fly, wait, and say how fast: see `rules`."""

from __future__ import annotations

from dataclasses import replace

from anafi_mav import mav_enums
from anafi_mav.plans.plan import DO_JUMP, WAYPOINT, Item, Point
from anafi_mav.plans.rules.flight_plan_writer import Pen
from anafi_mav.plans.rules.rule import Fidelity, Rule

# What flies.


def _fly(pen: Pen, item: Item, heading: float | None, radius: float | None = None) -> None:
    pen.fly(pen.destination(item), heading, radius)


def _waypoint(pen: Pen, item: Item) -> None:
    hold, radius, beside, heading = item.params[:4]
    if (hold or 0.0) < 0.0:
        pen.refuse(f"it waits for {hold:g} s", 1)
    if (radius or 0.0) < 0.0:
        pen.refuse(f"a radius of {radius:g} m", 2)
    if not pen.names_place(item):
        pen.say("it names no place: it is where the drone is then")
    if beside:
        pen.say(f"it is flown over, not passed at {abs(beside):g} m")
    _fly(pen, item, heading, radius)
    pen.wait(hold or 0.0)


def _loiter(pen: Pen, item: Item) -> None:
    _fly(pen, item, item.params[3])


def _loiter_time(pen: Pen, item: Item) -> None:
    seconds = item.params[0] or 0.0
    if seconds < 0.0:
        pen.refuse(f"it waits for {seconds:g} s", 1)
    _fly(pen, item, None)
    pen.wait(seconds)


def _loiter_to_height(pen: Pen, item: Item) -> None:
    _fly(pen, item, None)


def _take_off(pen: Pen, item: Item) -> None:
    heading, height = item.params[3], pen.height(item) if item.params[6] else None
    away = pen.names_place(item)
    if height is None:
        pen.say("it says no height: the drone rises as high as it does by itself")
    elif height < 0.0:
        pen.refuse(f"it rises to {height:g} m above take-off", 7)
    else:
        up = replace(pen.place, height=max(height, pen.place.height))
        if height > pen.place.height or heading is not None:
            pen.fly(up, heading, None)
    if away:
        there = pen.destination(item)
        pen.fly_on(replace(there, height=max(there.height, pen.place.height)), heading)


def _land(pen: Pen, item: Item) -> None:
    precision, heading = item.params[1], item.params[3]
    if precision == mav_enums.PRECISION_LAND_MODE_REQUIRED:
        pen.refuse("the drone cannot land by a mark on the ground", 2)
    if precision:
        pen.say("it lands without looking for a mark on the ground")
    if pen.names_place(item):
        latitude, longitude = item.params[4:6]
        over = Point(latitude or 0.0, longitude or 0.0, pen.place.height)
        if heading is None:
            pen.fly_on(over, None)
        else:
            pen.fly(over, heading, None)
    elif heading:
        pen.say(f"it lands with the heading that it has, not {heading:g} deg")
    pen.line(mav_enums.MAV_CMD_NAV_LAND)


def _return(pen: Pen, item: Item) -> None:
    pen.line(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)


# What waits.


def _delay(pen: Pen, item: Item) -> None:
    seconds = item.params[0]
    if seconds is None or seconds < 0.0:
        pen.refuse("it waits for a time of day, which the drone cannot" if seconds == -1.0 else "it says no time", 1)
    pen.wait(seconds)


def _condition_delay(pen: Pen, item: Item) -> None:
    seconds = item.params[0] or 0.0
    if seconds < 0.0:
        pen.refuse(f"it waits for {seconds:g} s", 1)
    if seconds:
        pen.say("the drone waits where it is, not on the way to the next way point")
    pen.wait(seconds)


def is_relative(reference: float | None) -> bool:
    """True when param4 of a CONDITION_YAW item makes its angle count from the present heading.

    MAVLink has 1 for that. ArduPilot stores a byte and takes every number but 0 so (ArduCopter mode_auto.cpp do_yaw).
    """
    return bool(reference)


def _turn(pen: Pen, item: Item) -> None:
    """Only what the drone looks at then: the gateway turns it."""
    angle, _, way, reference = item.params[:4]
    if angle is None:
        pen.refuse("it says no angle", 1)
    if reference is not None and not (reference.is_integer() and 0.0 <= reference <= 0xFF):
        pen.refuse(f"{reference:g} is neither relative nor absolute", 4)
    if way not in (None, -1.0, 0.0, 1.0):
        pen.refuse(f"{way:g} is no direction to turn in", 3)
    relative = is_relative(reference)
    pen.turn(-angle if relative and way == -1.0 else angle, relative=relative)


# What sets.

_AIRSPEED, _GROUNDSPEED = float(mav_enums.SPEED_TYPE_AIRSPEED), float(mav_enums.SPEED_TYPE_GROUNDSPEED)
_SAME = -1.0


def _speed(pen: Pen, item: Item) -> None:
    kind, speed, throttle, relative = item.params[:4]
    if kind not in (None, _AIRSPEED, _GROUNDSPEED):
        pen.refuse("a flight plan has a speed over ground only, not one for climbing and sinking", 1)
    if relative == 1.0:
        pen.refuse("it says how much faster, not how fast", 4)
    if throttle not in (None, 0.0, _SAME):
        pen.say(f"there is no throttle to be set to {throttle:g} %")
    if speed == _SAME:
        return
    if speed is None or speed <= 0.0:
        pen.refuse("it says no speed" if speed is None else f"it says a speed of {speed:g} m/s", 2)
    pen.set_speed(_GROUNDSPEED if kind is None else kind, speed)


def _nothing(pen: Pen, item: Item) -> None:
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
        "throttle is left out and said.", _speed),
    Rule(189, _EXACT, "Nothing: a mark for aeroplanes that break off a landing.", _nothing),
)  # fmt: skip

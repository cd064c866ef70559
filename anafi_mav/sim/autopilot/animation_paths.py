"""Geometry of the animations: converts their commands into legs, which `animation` flies.

animation.xml describes a figure in one sentence without numbers; the defaults, how many pictures a panorama has, and
the geometry beyond that sentence are assumed. Metres, m/s, rad; tilt of the camera in deg above the horizon.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import animation
from anafi_mav.arsdk.messages.animation import PlayMode, Type
from anafi_mav.sim.world.motion import Pose
from anafi_mav.units import DEG_PER_RAD, RAD_PER_DEG, clip, wrap_pi

CLIMB = 2.0
"""m/s up and down of a figure that names no speed for it."""
TURN = 60.0 * RAD_PER_DEG
"""rad/s of a figure that names none."""
SUBJECT = 10.0
"""m to what a camera without a target is taken to look at."""

_STEPS = 24
"""Legs of a full turn of a spiral, and of a parabola."""
_DOWN, _LEVEL = -90.0, 0.0

_LONGEST = 500.0
"""m of any leg, and s of a vertigo: what is beyond is a mistake."""
_TURNS = 20.0
"""Turns of a spiral or of a panorama at most."""


class Target(NamedTuple):
    """Target of an animation: m from the simulator's origin."""

    north: float
    east: float
    up: float


@dataclass(frozen=True)
class Leg:
    """One straight part of a figure: position and heading (not wrapped) of its end.

    The camera and its zoom reach their values at its end.
    """

    north: float
    east: float
    up: float
    yaw: float
    speed: float = CLIMB
    climb: float = CLIMB
    yaw_rate: float = TURN
    tilt: float | None = None
    zoom: float | None = None
    radius: float = 0.0
    """m from its end at which the next leg begins; 0: not before the drone has come to rest there."""
    photo: bool = False
    """A picture is taken at its end."""


class Figure(NamedTuple):
    """An animation about to be flown."""

    type: Type
    values: Mapping[str, Any]
    """Further values of its state event: those of the command or the defaults."""
    legs: tuple[Leg, ...]
    panorama: str
    """Web server's name of the pictures that it takes; empty: it takes no pictures."""


class Stage(NamedTuple):
    """State of the drone at the start of a figure."""

    pose: Pose
    heading: float
    """rad, not wrapped."""
    tilt: float
    target: Target | None
    fastest: float
    """m/s of the model."""
    zoom_max: float

    def leg(self, forward: float = 0.0, right: float = 0.0, up: float = 0.0, turn: float = 0.0, **more: Any) -> Leg:
        """Relative to the beginning: m, and rad clockwise."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        pose = self.pose
        return Leg(
            pose.north + forward * cos - right * sin,
            pose.east + forward * sin + right * cos,
            pose.up + up,
            self.heading + turn,
            **more,
        )


_DEFAULTS: Mapping[type[Message], Mapping[str, Any]] = {
    animation.StartHorizontalPanorama: {"rotation_angle": 2.0 * math.pi, "rotation_speed": 20.0 * RAD_PER_DEG},
    animation.StartDronie: {"speed": 2.5, "distance": 20.0, "play_mode": PlayMode.NORMAL},
    animation.StartHorizontalReveal: {"speed": 2.0, "distance": 15.0, "play_mode": PlayMode.NORMAL},
    animation.StartVerticalReveal: {
        "speed": 1.5,
        "vertical_distance": 10.0,
        "rotation_angle": 2.0 * math.pi,
        "rotation_speed": 20.0 * RAD_PER_DEG,
        "play_mode": PlayMode.NORMAL,
    },
    animation.StartSpiral: {
        "speed": 2.5,
        "radius_variation": 2.0,
        "vertical_distance": 5.0,
        "revolution_nb": 1.0,
        "play_mode": PlayMode.NORMAL,
    },
    animation.StartParabola: {"speed": 3.0, "vertical_distance": 10.0, "play_mode": PlayMode.NORMAL},
    animation.StartCandle: {"speed": 3.0, "vertical_distance": 10.0, "play_mode": PlayMode.NORMAL},
    animation.StartDollySlide: {
        "speed": 3.0,
        "angle": 60.0 * RAD_PER_DEG,
        "horizontal_distance": 15.0,
        "play_mode": PlayMode.NORMAL,
    },
    animation.StartVertigo: {
        "duration": 8.0,
        "max_zoom_level": 2.0,
        "finish_action": animation.VertigoFinishAction.NONE,
        "play_mode": PlayMode.NORMAL,
    },
    animation.StartTwistUp: {
        "speed": 1.5,
        "vertical_distance": 10.0,
        "rotation_angle": 2.0 * math.pi,
        "rotation_speed": 20.0 * RAD_PER_DEG,
        "play_mode": PlayMode.NORMAL,
    },
}

NEEDS_TARGET = frozenset({Type.SPIRAL, Type.PARABOLA, Type.CANDLE, Type.DOLLY_SLIDE, Type.POSITION_TWIST_UP})
"""Figures around something: a point of interest, or who is followed."""


def values_of(command: Message) -> dict[str, Any] | None:
    """Return the provided values and the defaults of the others, or None when one is unusable."""
    kind = animation.StartTwistUp if isinstance(command, animation.StartPositionTwistUp) else type(command)
    defaults = _DEFAULTS.get(kind, {})
    names = [name for name in command.__struct_fields__ if name != "provided_params"]
    provided: int = getattr(command, "provided_params", 0)
    values = {}
    for bit, name in enumerate(names):
        values[name] = getattr(command, name) if provided >> bit & 1 else defaults[name]
    return values if all(_usable(name, value) for name, value in values.items()) else None


def _usable(name: str, value: Any) -> bool:
    if isinstance(value, PlayMode | animation.VertigoFinishAction):
        return value in tuple(type(value))
    if not math.isfinite(value):
        return False
    if name in ("speed", "rotation_speed", "duration", "max_zoom_level", "distance"):
        return bool(0.0 < value <= _LONGEST)
    turns = {"rotation_angle": 2.0 * math.pi, "revolution_nb": 1.0}.get(name)
    return bool(abs(value) <= (_LONGEST if turns is None else _TURNS * turns))


def figure(command: Message, stage: Stage) -> Figure | None:
    """The figure of a start command; None when it cannot be flown from here."""
    kind, draw, panorama = _FIGURES[type(command)]
    values = values_of(command)
    if values is None or (kind in NEEDS_TARGET and stage.target is None):
        return None
    legs = draw(stage, **{name: value for name, value in values.items() if name != "play_mode"})
    legs = [replace(leg, speed=min(leg.speed, stage.fastest)) for leg in legs]
    if values.get("play_mode") is PlayMode.ONCE_THEN_MIRRORED:
        legs += _mirrored(legs, stage)
    return Figure(kind, values, tuple(legs), panorama)


def _mirrored(legs: list[Leg], stage: Stage) -> list[Leg]:
    """The way back: each leg flown to where it began."""
    start = stage.leg(tilt=stage.tilt, zoom=1.0 if any(leg.zoom is not None for leg in legs) else None)
    ends = [start, *legs[:-1]]
    return [
        replace(leg, north=end.north, east=end.east, up=end.up, yaw=end.yaw, tilt=end.tilt, zoom=end.zoom)
        for leg, end in zip(reversed(legs), reversed(ends), strict=True)
    ]


# -- without a target


def _horizontal_panorama(stage: Stage, rotation_angle: float, rotation_speed: float) -> list[Leg]:
    return [stage.leg(turn=rotation_angle, yaw_rate=rotation_speed)]


def _dronie(stage: Stage, speed: float, distance: float) -> list[Leg]:
    """Backwards and up along the line of sight; away from the target, if there is one."""
    elevation = clip(-stage.tilt, 15.0, 60.0) * RAD_PER_DEG
    legs = []
    if stage.target is not None:
        bearing, _ = stage.pose.bearing(stage.target.north, stage.target.east)
        legs.append(stage.leg(turn=wrap_pi(bearing - stage.pose.yaw)))
    turn = legs[0].yaw - stage.heading if legs else 0.0
    back = distance * math.cos(elevation)
    rise = distance * math.sin(elevation)
    flown = stage.leg(
        -back * math.cos(turn), -back * math.sin(turn), rise, turn, speed=speed, climb=max(speed * rise / distance, 0.1)
    )
    return [*legs, flown]


def _horizontal_reveal(stage: Stage, speed: float, distance: float) -> list[Leg]:
    return [stage.leg(tilt=_DOWN), stage.leg(distance, speed=speed, tilt=_LEVEL)]


def _vertical_reveal(
    stage: Stage, speed: float, vertical_distance: float, rotation_angle: float, rotation_speed: float
) -> list[Leg]:
    return [
        stage.leg(tilt=_DOWN),
        stage.leg(up=vertical_distance, climb=speed, tilt=_LEVEL),
        stage.leg(up=vertical_distance, turn=rotation_angle, yaw_rate=rotation_speed),
    ]


def _vertigo(
    stage: Stage, duration: float, max_zoom_level: float, finish_action: animation.VertigoFinishAction
) -> list[Leg]:
    """The subject stays as large: twice the zoom from twice as far."""
    zoom = clip(max_zoom_level, 1.0, stage.zoom_max)
    subject = SUBJECT
    if stage.target is not None:
        subject = stage.pose.bearing(stage.target.north, stage.target.east)[1]
    away = min(subject * (zoom - 1.0), _LONGEST)
    legs = [stage.leg(-away, speed=max(away / duration, 0.1), zoom=zoom)]
    if finish_action is animation.VertigoFinishAction.UNZOOM:
        legs.append(replace(legs[0], zoom=1.0))
    return legs


def _twist_up(
    stage: Stage, speed: float, vertical_distance: float, rotation_angle: float, rotation_speed: float
) -> list[Leg]:
    """Up while turning, looking down; then up to the horizon. Climb and turn end together."""
    climb = min(speed, abs(vertical_distance) * rotation_speed / max(abs(rotation_angle), 1e-3))
    turned = replace(
        stage.leg(up=vertical_distance, turn=rotation_angle, tilt=_DOWN), climb=max(climb, 0.1), yaw_rate=rotation_speed
    )
    return [stage.leg(tilt=_DOWN), turned, replace(turned, tilt=_LEVEL)]


# -- around a target


def _towards(stage: Stage) -> tuple[Target, float, float]:
    """(target, direction of it in rad, m over ground to it)."""
    assert stage.target is not None, "looked at before"
    bearing, distance = stage.pose.bearing(stage.target.north, stage.target.east)
    return stage.target, bearing, distance


def _facing(point: tuple[float, float, float], target: Target, heading: float, **more: Any) -> Leg:
    """Return the leg to a point at whose end nose and camera face the target.

    The heading of its end is reached by the shortest turn from `heading`.
    """
    north, east, up = point
    away = math.hypot(target.north - north, target.east - east)
    yaw = heading + wrap_pi(math.atan2(target.east - east, target.north - north) - heading) if away > 0.5 else heading
    tilt = math.atan2(target.up - up, away) * DEG_PER_RAD
    return Leg(north, east, up, yaw, tilt=tilt, **more)


def _spiral(
    stage: Stage, speed: float, radius_variation: float, vertical_distance: float, revolution_nb: float
) -> list[Leg]:
    target, bearing, radius = _towards(stage)
    radius = max(radius, 1.0)
    grown = abs(radius_variation) if radius_variation > 0.0 else 1.0 / max(abs(radius_variation), 0.1)
    count = max(1, math.ceil(abs(revolution_nb) * _STEPS))
    legs: list[Leg] = []
    heading = stage.heading
    for step in range(1, count + 1):
        share = step / count
        angle = bearing + math.pi + share * revolution_nb * 2.0 * math.pi
        reach = min(radius * (1.0 + (grown - 1.0) * share), _LONGEST)
        point = (
            target.north + reach * math.cos(angle),
            target.east + reach * math.sin(angle),
            stage.pose.up + vertical_distance * share,
        )
        legs.append(_facing(point, target, heading, speed=speed, radius=0.6 * 2.0 * math.pi * reach / _STEPS))
        heading = legs[-1].yaw
    legs[-1] = replace(legs[-1], radius=0.0)
    return legs


def _parabola(stage: Stage, speed: float, vertical_distance: float) -> list[Leg]:
    """Over the target to its other side, the nose along the way."""
    target, bearing, distance = _towards(stage)
    yaw = stage.heading + wrap_pi(bearing - stage.heading)
    legs = [replace(stage.leg(), yaw=yaw)]
    for step in range(1, _STEPS + 1):
        share = 2.0 * step / _STEPS - 1.0
        point = (
            target.north + share * distance * math.cos(bearing),
            target.east + share * distance * math.sin(bearing),
            stage.pose.up + vertical_distance * (1.0 - share * share),
        )
        passing = 0.8 * 2.0 * distance / _STEPS
        legs.append(replace(_facing(point, target, yaw, speed=speed, climb=speed, radius=passing), yaw=yaw))
    legs[-1] = replace(legs[-1], radius=0.0)
    return legs


def _candle(stage: Stage, speed: float, vertical_distance: float) -> list[Leg]:
    """Up to two metres before the target, then up."""
    target, bearing, distance = _towards(stage)
    on = max(distance - 2.0, 0.0)
    near = (stage.pose.north + on * math.cos(bearing), stage.pose.east + on * math.sin(bearing), stage.pose.up)
    high = (near[0], near[1], stage.pose.up + vertical_distance)
    first = _facing(near, target, stage.heading, speed=speed)
    return [first, _facing(high, target, first.yaw, speed=speed, climb=speed)]


def _dolly_slide(stage: Stage, speed: float, angle: float, horizontal_distance: float) -> list[Leg]:
    """Fly straight towards the place that a turn about the target by `angle` would lead to.

    The leg is `horizontal_distance` long.
    """
    target, bearing, distance = _towards(stage)
    turned = bearing + math.pi + angle
    north = target.north + distance * math.cos(turned) - stage.pose.north
    east = target.east + distance * math.sin(turned) - stage.pose.east
    length = max(math.hypot(north, east), 1e-6)
    share = horizontal_distance / length
    point = (stage.pose.north + north * share, stage.pose.east + east * share, stage.pose.up)
    yaw = stage.heading + wrap_pi(bearing - stage.heading)
    return [replace(stage.leg(), yaw=yaw), replace(_facing(point, target, yaw, speed=speed), yaw=yaw)]


def _position_twist_up(stage: Stage, speed: float, **values: float) -> list[Leg]:
    target, bearing, _ = _towards(stage)
    yaw = stage.heading + wrap_pi(bearing - stage.heading)
    above = Leg(target.north, target.east, stage.pose.up, yaw, speed=max(speed, CLIMB), tilt=_DOWN)
    there = stage._replace(pose=stage.pose._replace(north=target.north, east=target.east), heading=yaw)
    return [above, *_twist_up(there, speed, **values)]


# -- panoramas of photos


def _look(stage: Stage, turn: float, tilt: float) -> Leg:
    return stage.leg(turn=turn * RAD_PER_DEG, tilt=tilt, photo=True)


def _horizontal_photos(stage: Stage) -> list[Leg]:
    return [*(_look(stage, -90.0 + 22.5 * step, _LEVEL) for step in range(9)), stage.leg(tilt=_LEVEL)]


def _vertical_photos(stage: Stage) -> list[Leg]:
    return [*(_look(stage, 0.0, 90.0 - 22.5 * step) for step in range(9)), stage.leg(tilt=_LEVEL)]


def _spherical_photos(stage: Stage) -> list[Leg]:
    legs = [_look(stage, 0.0, 90.0)]
    for column in range(8):
        tilts = (60.0, 30.0, 0.0, -30.0, -60.0)
        legs += [_look(stage, 45.0 * column, tilt) for tilt in (reversed(tilts) if column % 2 else tilts)]
    return [*legs, _look(stage, 360.0, -90.0), stage.leg(turn=2.0 * math.pi, tilt=_LEVEL)]


def _super_wide_photos(stage: Stage) -> list[Leg]:
    looks = [_look(stage, turn, tilt) for tilt in (20.0, 0.0, -20.0) for turn in (-35.0, 0.0, 35.0)]
    return [*looks, stage.leg(tilt=_LEVEL)]


Draw = Callable[..., list[Leg]]

_FIGURES: Mapping[type[Message], tuple[Type, Draw, str]] = {
    animation.StartHorizontalPanorama: (Type.HORIZONTAL_PANORAMA, _horizontal_panorama, ""),
    animation.StartDronie: (Type.DRONIE, _dronie, ""),
    animation.StartHorizontalReveal: (Type.HORIZONTAL_REVEAL, _horizontal_reveal, ""),
    animation.StartVerticalReveal: (Type.VERTICAL_REVEAL, _vertical_reveal, ""),
    animation.StartSpiral: (Type.SPIRAL, _spiral, ""),
    animation.StartParabola: (Type.PARABOLA, _parabola, ""),
    animation.StartCandle: (Type.CANDLE, _candle, ""),
    animation.StartDollySlide: (Type.DOLLY_SLIDE, _dolly_slide, ""),
    animation.StartVertigo: (Type.VERTIGO, _vertigo, ""),
    animation.StartTwistUp: (Type.TWIST_UP, _twist_up, ""),
    animation.StartPositionTwistUp: (Type.POSITION_TWIST_UP, _position_twist_up, ""),
    animation.StartHorizontal180PhotoPanorama: (
        Type.HORIZONTAL_180_PHOTO_PANORAMA,
        _horizontal_photos,
        "HORIZONTAL_180",
    ),
    animation.StartVertical180PhotoPanorama: (Type.VERTICAL_180_PHOTO_PANORAMA, _vertical_photos, "VERTICAL_180"),
    animation.StartSphericalPhotoPanorama: (Type.SPHERICAL_PHOTO_PANORAMA, _spherical_photos, "SPHERICAL"),
    animation.StartSuperWidePhotoPanorama: (Type.SUPER_WIDE_PHOTO_PANORAMA, _super_wide_photos, "SUPER_WIDE"),
}

STARTS = frozenset(_FIGURES)
"""The commands that begin one. A flip is none: no ANAFI makes it."""

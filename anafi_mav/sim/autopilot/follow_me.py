"""Feature follow_me: the drone looks at a target, or follows it.

The target is the controller, if it requests so and sends its position (controller_info.gps), or the object that it
has found in the picture (target_image_detection), taken to stand on the ground. The numbers are assumed: Parrot
publishes none. The sticks fly the drone while it only looks; that they do nothing while it follows, and that any
other guided flight ends it, is assumed too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import controller_info, follow_me
from anafi_mav.arsdk.messages.follow_me import Animation, Behavior, GeoRelConfigureParam, Input, Mode
from anafi_mav.sim.autopilot.poi import look
from anafi_mav.sim.features.settings import DroneSettings
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.motion import Pose
from anafi_mav.sim.world.place import WorldOrigin
from anafi_mav.units import DEG_PER_RAD, RAD_PER_DEG, clip, wrap_pi

MODES = (Mode.LOOK_AT, Mode.GEOGRAPHIC, Mode.RELATIVE)
"""A leash is in the feature's XML and on no ANAFI."""

FRESH = 3.0
"""s that a controller's position counts."""
SEEN = 1.0
"""s that a picture with the target in it counts."""
ACCURATE = 10.0
"""m that a position may be off."""
FAR, NEAR = 2.0, 50.0
"""m over ground: from a target closer than the first nothing is followed, beyond the second it is not done well."""
HIGH = 1.5
"""m above the ground from which a target is followed."""
FAST = 12.0
"""m/s: faster than this a target is not followed well."""
CONFIDENT = 50
"""Of 255: a detection that counts."""

STEP = 0.1
"""s between two corrections of the way."""
LEAD = 1.1
"""s that the way leads a moving target by: a move slows down before it arrives."""
WALKING = 0.5
"""m/s from which a target has a direction that it goes in."""

_HIGHEST, _FASTEST = 20_000.0, 100.0
"""m and m/s: no target is beyond."""

_ALL = (1 << len(Input)) - 1


@dataclass
class _Fix:
    """Position and velocity of the target at a time: m, m/s."""

    time: float
    north: float
    east: float
    up: float
    vn: float = 0.0
    ve: float = 0.0
    vu: float = 0.0

    def at(self, time: float) -> tuple[float, float, float]:
        seconds = time - self.time
        return self.north + self.vn * seconds, self.east + self.ve * seconds, self.up + self.vu * seconds

    @property
    def speed(self) -> float:
        return math.hypot(self.vn, self.ve)


class _Conditions(NamedTuple):
    """Conditions of following."""

    fix: bool
    calibrated: bool
    guided: bool
    high: bool
    by_controller: bool
    satellite: bool
    """The target's own place is known."""
    picture: bool
    """The target is seen."""
    barometer: bool
    too_near: bool
    too_far: bool
    too_fast: bool


class _Vector(NamedTuple):
    """Vector from the target to the drone: m, rad above the horizon, rad from north.

    In the RELATIVE mode the azimuth is from the target's direction of motion.
    """

    distance: float
    elevation: float
    azimuth: float


class FollowMe:
    """One drone's.

    `aim` points the camera (deg above the horizon), `fastest` is the greatest yaw rate (rad/s).
    """

    def __init__(
        self,
        body: Airframe,
        origin: WorldOrigin,
        settings: DroneSettings,
        emit: Callable[[Message], None],
        aim: Callable[[float], None],
        top_speed: float,
    ) -> None:
        """`top_speed` in m/s."""
        self._body = body
        self._origin = origin
        self._settings = settings
        self._emit = emit
        self._aim = aim
        self._top_speed = top_speed
        self.mode = Mode.NONE
        self.behavior = Behavior.IDLE
        self._controller: _Fix | None = None
        self._accuracy = math.inf
        self._barometer_at = -math.inf
        self._sight: _Fix | None = None
        self._sighted: tuple[float, float] | None = None
        """Azimuth and elevation (rad) of the last detection."""
        self._by_controller = False
        self._vector: _Vector | None = None
        self._wanted: tuple[int, _Vector] | None = None
        """A configuration, and which of its values are left to the drone (bits of GeoRelConfigureParam)."""
        self._framing = (50, 50)
        self._course = 0.0
        self._next = 0.0
        self._infos: dict[Mode, tuple[int, int]] = dict.fromkeys(MODES, (0, 0))
        self._conditions: _Conditions | None = None
        """Those that `_infos` is of."""
        self._valid = False
        self._time = 0.0
        self._pose: Pose | None = None
        self._guided = False

    # -- what others ask

    @property
    def engaged(self) -> bool:
        return self.mode is not Mode.NONE

    @property
    def flies(self) -> bool:
        """It has the drone."""
        return self.behavior is Behavior.FOLLOW

    def target(self, time: float) -> tuple[float, float, float] | None:
        """m from the simulator's origin; None: not known."""
        found = self._target(time)
        return None if found is None else found.at(time)

    def _target(self, time: float) -> _Fix | None:
        if self._by_controller and self._has_controller(time):
            return self._controller
        return self._sight if self._sees(time) else None

    def _has_controller(self, time: float) -> bool:
        return self._controller is not None and time - self._controller.time <= FRESH and self._accuracy <= ACCURATE

    def _sees(self, time: float) -> bool:
        return self._sight is not None and time - self._sight.time <= SEEN

    # -- commands

    def handle(self, message: Message, pose: Pose, time: float) -> list[Message] | None:
        """Return the answer to a command of this feature, or None for any other message."""
        handler = _HANDLERS.get(type(message))
        if handler is None:
            return None
        self._pose, self._time = pose, time
        return list(handler(self, message))

    def _start(self, m: follow_me.Start) -> Iterable[Message]:
        if m.mode not in MODES or not self._guided:
            yield self._state()
            return
        self._release()
        self.mode, self._wanted = m.mode, None
        self._behave()
        yield self._state()
        yield from self._configuration()

    def _stop(self, m: Message) -> Iterable[Message]:
        self._release()
        yield self._state()

    def _configure(self, m: follow_me.ConfigureGeographic | follow_me.ConfigureRelative) -> Iterable[Message]:
        mode = Mode.GEOGRAPHIC if isinstance(m, follow_me.ConfigureGeographic) else Mode.RELATIVE
        if mode is self.mode and self.flies and all(map(math.isfinite, (m.distance, m.elevation, m.azimuth))):
            left = m.use_default & 0b111
            self._wanted = (left, _Vector(clip(m.distance, FAR, NEAR), clip(m.elevation, -1.5, 1.5), m.azimuth))
            self._take_vector()
        yield from self._configuration(mode)

    def _frame(self, m: follow_me.TargetFramingPosition) -> Iterable[Message]:
        if 0 <= m.horizontal <= 100 and 0 <= m.vertical <= 100:
            self._framing = (m.horizontal, m.vertical)
        yield follow_me.TargetFramingPositionChanged(*self._framing)

    def _set_by_controller(self, m: follow_me.SetTargetIsController) -> Iterable[Message]:
        self._by_controller = bool(m.target_is_controller)
        yield follow_me.TargetIsController(int(self._by_controller))
        yield from self._judge()

    def _detect(self, m: follow_me.TargetImageDetection) -> Iterable[Message]:
        pose = self._pose
        assert pose is not None, "set by handle"
        usable = math.isfinite(m.target_azimuth) and -math.pi / 2.0 <= m.target_elevation < -0.03
        if m.confidence_index < CONFIDENT or not usable:
            yield follow_me.TargetImageDetectionState(follow_me.ImageDetectionStatus.LOST)
            return
        away = min(pose.up / math.tan(-m.target_elevation), 1000.0)
        north = pose.north + away * math.cos(m.target_azimuth)
        east = pose.east + away * math.sin(m.target_azimuth)
        fresh = not self._sees(self._time) or bool(m.is_new_selection)
        self._sight = _Fix(self._time, north, east, 0.0)
        if fresh:
            yield follow_me.TargetImageDetectionState(follow_me.ImageDetectionStatus.OK)

    def _hear(self, m: controller_info.Gps) -> Iterable[Message]:
        speeds = (m.north_speed, m.east_speed, m.down_speed)
        somewhere = abs(m.latitude) <= 90.0 and abs(m.longitude) <= 180.0 and abs(m.altitude) <= _HIGHEST
        if not somewhere or not all(abs(speed) <= _FASTEST for speed in speeds) or not m.horizontal_accuracy >= 0.0:
            return ()
        north, east = self._origin.offset(m.latitude, m.longitude)
        up = m.altitude - self._origin.altitude
        self._controller = _Fix(self._time, north, east, up, m.north_speed, m.east_speed, -m.down_speed)
        self._accuracy = m.horizontal_accuracy
        return self._judge_controller()

    def _barometer(self, m: Message) -> Iterable[Message]:
        self._barometer_at = self._time
        return ()

    # -- conditions

    def sensors(self, fix: bool, calibrated: bool, guided: bool, pose: Pose, time: float) -> None:
        """Look at what following needs, and say what has changed."""
        self._time, self._pose, self._guided = time, pose, guided
        if not guided:
            self.stop()
        conditions = self._look(fix, calibrated, pose, time)
        if conditions != self._conditions:
            self._conditions = conditions
            for mode in MODES:
                info = _info(mode, conditions)
                if info != self._infos[mode]:
                    self._infos[mode] = info
                    self._emit(follow_me.ModeInfo(mode, *info))
        for message in (*self._judge_controller(), *self._judge()):
            self._emit(message)

    def _look(self, fix: bool, calibrated: bool, pose: Pose, time: float) -> _Conditions:
        target = self._target(time)
        away = None if target is None else pose.bearing(*target.at(time)[:2])[1]
        return _Conditions(
            fix=fix,
            calibrated=calibrated,
            guided=self._guided,
            high=pose.up >= HIGH,
            by_controller=self._by_controller,
            satellite=self._has_controller(time),
            picture=self._sees(time),
            barometer=time - self._barometer_at <= FRESH,
            too_near=away is not None and away < FAR,
            too_far=away is not None and away > NEAR,
            too_fast=target is not None and target.speed > FAST,
        )

    def _judge_controller(self) -> list[Message]:
        valid = self._has_controller(self._time)
        if valid is self._valid:
            return []
        self._valid = valid
        return [controller_info.ValidityFromDrone(int(valid))]

    def _judge(self) -> list[Message]:
        """Begin or pause as what it needs comes and goes."""
        before = self.behavior
        if self.engaged:
            self._behave()
        return [] if self.behavior is before else [self._state()]

    def _behave(self) -> None:
        ready = self._infos[self.mode][0] == _ALL
        wanted = Behavior.IDLE
        if ready and self._target(self._time) is not None:
            wanted = Behavior.LOOK_AT if self.mode is Mode.LOOK_AT else Behavior.FOLLOW
        if wanted is self.behavior:
            return
        if self.flies:
            self._body.hover()
        self.behavior = wanted
        if self.flies:
            self._take_vector()
            self._next = self._time

    def _take_vector(self) -> None:
        """Keep what lies between target and drone now, or what was asked for."""
        target, pose = self._target(self._time), self._pose
        assert target is not None, "a drone that follows has a target"
        assert pose is not None, "looked at before"
        if target.speed > WALKING:
            self._course = math.atan2(target.ve, target.vn)
        north, east, up = target.at(self._time)
        away = math.hypot(pose.north - north, pose.east - east)
        azimuth = math.atan2(pose.east - east, pose.north - north)
        if self.mode is Mode.RELATIVE:
            azimuth = wrap_pi(azimuth - self._course)
        own = _Vector(math.hypot(away, pose.up - up), math.atan2(pose.up - up, away), azimuth)
        if self._wanted is not None:
            left, asked = self._wanted
            pairs = enumerate(zip(own, asked, strict=True))
            own = _Vector(*(mine if left >> bit & 1 else theirs for bit, (mine, theirs) in pairs))
        self._vector = own

    # -- time

    def tick(self, time: float, pose: Pose) -> float | None:
        """Fly; the yaw rate (rad/s) that looking at the target asks for, None when it does not."""
        self._time, self._pose = time, pose
        target = self._target(time) if self.behavior is not Behavior.IDLE else None
        if target is None:
            return None
        north, east, up = target.at(time)
        seen = look(pose, north, east, up)
        self._aim(seen.elevation * DEG_PER_RAD)
        if not self.flies:
            return seen.yaw_rate(pose.yaw, self._settings.yaw_rate)
        if time >= self._next:
            self._next = time + STEP
            self._follow(target, time, seen.bearing)
        return None

    def _follow(self, target: _Fix, time: float, bearing: float) -> None:
        assert self._vector is not None, "taken when it began to follow"
        if self.mode is Mode.RELATIVE and target.speed > WALKING:
            self._course = math.atan2(target.ve, target.vn)
        distance, elevation, azimuth = self._vector
        if self.mode is Mode.RELATIVE:
            azimuth += self._course
        north, east, up = target.at(time + LEAD)
        away = distance * math.cos(elevation)
        self._body.move(
            north + away * math.cos(azimuth),
            east + away * math.sin(azimuth),
            max(up + distance * math.sin(elevation), HIGH),
            yaw=self._body.nearest(bearing),
            speed=self._top_speed,
            climb=self._settings.number("max_vertical_speed"),
            yaw_rate=max(self._settings.yaw_rate, 60.0 * RAD_PER_DEG),
        )

    def stop(self) -> None:
        """Something else takes the drone; without a target nothing is said."""
        if self.engaged:
            self._release()
            self._emit(self._state())

    def _release(self) -> None:
        if self.flies and self._guided:
            self._body.hover()
        self.mode, self.behavior, self._vector = Mode.NONE, Behavior.IDLE, None

    # -- reports

    def _state(self) -> Message:
        return follow_me.State(self.mode, self.behavior, Animation.NONE, 0)

    def _configuration(self, mode: Mode | None = None) -> Iterable[Message]:
        left = self._wanted[0] if self._wanted is not None else (1 << len(GeoRelConfigureParam)) - 1
        vector = self._vector or _Vector(0.0, 0.0, 0.0)
        if (mode or self.mode) is Mode.GEOGRAPHIC:
            yield follow_me.GeographicConfig(left, *vector)
        elif (mode or self.mode) is Mode.RELATIVE:
            yield follow_me.RelativeConfig(left, *vector)

    def telemetry(self) -> list[Message]:
        """Report the estimated position of the target, regularly while engaged."""
        target = self._target(self._time) if self.engaged else None
        if target is None:
            return []
        north, east, up = target.at(self._time)
        latitude, longitude = self._origin.place(north, east)
        altitude = self._origin.altitude + up
        return [follow_me.TargetTrajectory(latitude, longitude, altitude, target.vn, target.ve, -target.vu)]

    def states_report(self) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        return [
            self._state(),
            *(follow_me.ModeInfo(mode, *info) for mode, info in self._infos.items()),
            follow_me.TargetIsController(int(self._by_controller)),
            follow_me.TargetFramingPositionChanged(*self._framing),
            controller_info.Capabilities(1 << controller_info.SupportedCommand.GPS),
            controller_info.ValidityFromDrone(int(self._valid)),
        ]


def _info(mode: Mode, now: _Conditions) -> tuple[int, int]:
    """Return the bits of the required and of the improving conditions that are met.

    A set bit is a met condition (followme.xml mode_info).
    """
    satellite, picture = Input.TARGET_GPS_GOOD_ACCURACY, Input.IMAGE_DETECTION
    needed, welcome = (satellite, picture) if now.by_controller else (picture, satellite)
    has = {satellite: now.satellite, picture: now.picture}
    missing = {
        Input.DRONE_CALIBRATED: not now.calibrated,
        Input.DRONE_GPS_GOOD_ACCURACY: not now.fix,
        Input.DRONE_HIGH_ENOUGH: not now.guided or (mode is not Mode.LOOK_AT and not now.high),
        Input.DRONE_FAR_ENOUGH: mode is not Mode.LOOK_AT and now.too_near,
        needed: not has[needed],
    }
    better = {
        Input.TARGET_BAROMETER_OK: not now.barometer,
        Input.DRONE_CLOSE_ENOUGH: now.too_far,
        Input.TARGET_GOOD_SPEED: now.too_fast,
        welcome: not has[welcome],
    }
    return _ok(missing), _ok(better)


def _ok(missing: dict[Input, bool]) -> int:
    return _ALL & ~sum(1 << input for input, lacks in missing.items() if lacks)


_HANDLERS: dict[type[Message], Callable[[FollowMe, Any], Iterable[Message]]] = {
    follow_me.Start: FollowMe._start,
    follow_me.Stop: FollowMe._stop,
    follow_me.ConfigureGeographic: FollowMe._configure,
    follow_me.ConfigureRelative: FollowMe._configure,
    follow_me.TargetFramingPosition: FollowMe._frame,
    follow_me.SetTargetIsController: FollowMe._set_by_controller,
    follow_me.TargetImageDetection: FollowMe._detect,
    controller_info.Gps: FollowMe._hear,
    controller_info.Barometer: FollowMe._barometer,
}

COMMANDS = frozenset(_HANDLERS)

"""Execution of an uploaded flight plan, item by item (features common and flight_plan).

MissionItemExecuted reports the file's own index (0 is the first line after the header). What Parrot does not
publish is assumed, with a note at its place: the speed without DO_CHANGE_SPEED, that a way point which cannot be
reached is skipped, what ends a plan from outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common, flight_plan
from anafi_mav.arsdk.messages.common import FlightPlanComponent as Part
from anafi_mav.arsdk.messages.common import MavlinkType, PlayError, PlayingState
from anafi_mav.sim.autopilot.poi import look
from anafi_mav.sim.features.settings import DroneSettings
from anafi_mav.sim.payload.camera_operator import CameraOperator
from anafi_mav.sim.plan.panorama import Panorama
from anafi_mav.sim.plan.plan_camera import COMMANDS, PlanCamera
from anafi_mav.sim.plan.plan_file import PlanCommand, PlanFileError, PlanLine, read
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.faults import Faults
from anafi_mav.sim.world.model import AircraftModel
from anafi_mav.sim.world.motion import Pose, Turn
from anafi_mav.sim.world.place import WorldOrigin
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.units import DEG_PER_RAD, RAD_PER_DEG

CRUISE = 5.0
"""m/s until DO_CHANGE_SPEED says otherwise. Assumed."""

ACCEPTANCE = 5.0
"""m from a way point that names no radius (Parrot's flight plan page)."""

TURN_SPEED = 60.0 * RAD_PER_DEG
"""rad/s. Assumed."""

STALL = 4.0
"""s without progress after which a way point counts as out of reach."""

CAMERA_LIMIT = 5.0
"""s that a single photo is waited for."""

_LOOKED_AT = (Part.MAVLINK_FILE, Part.WAYPOINTS_BEYOND_GEOFENCE, Part.FIRST_WAYPOINT_TOO_FAR)
"""Components that depend on the file: known from one start to the next."""

_MOVED = 0.05
_LAND_SAFE = 1.0
"""m: no way point is flown lower than this."""


class Pilot(Protocol):
    """Interface of the firmware that a plan uses."""

    @property
    def airborne(self) -> bool:
        """True in the air, when the drone accepts guided commands."""
        ...

    def fence_margin(self, north: float, east: float) -> float: ...

    def plan_take_off(self) -> None: ...

    def plan_land(self) -> None: ...

    def plan_return(self) -> None: ...


class FlightPlan:
    """The plan that plays, or played last."""

    def __init__(
        self,
        model: AircraftModel,
        body: Airframe,
        origin: WorldOrigin,
        settings: DroneSettings,
        pilot: Pilot,
        operator: CameraOperator,
        emit: Callable[[Message], None],
        note: Callable[[str, dict[str, Any]], None],
        faults: Faults,
    ) -> None:
        self._model = model
        self._body = body
        self._origin = origin
        self._settings = settings
        self._pilot = pilot
        self._operator = operator
        self._camera = PlanCamera(operator)
        self._emit = emit
        self._note = note
        self._faults = faults
        self.state = PlayingState.STOPPED
        self._uid = ""
        self._name = ""
        """Name in events: the uid, or the custom id of start_at."""
        self._type = MavlinkType.FLIGHT_PLAN_V2 if model.plan_version == 2 else MavlinkType.FLIGHT_PLAN
        self._items: tuple[PlanLine, ...] = ()
        self._index = 0
        self._parts = dict.fromkeys(Part, True)
        self._goes_on: bool | None = None
        self._recovery: Message = flight_plan.RecoveryInfo("", "", 0, 0, "")
        self._began = 0.0
        self._time = 0.0
        self._begun = False
        """The present item has been begun."""
        self._due = 0.0
        self._legs: list[tuple[float, float, float]] = []
        """Points to fly to before the present item: the way in of the newer models."""
        self._target: tuple[float, float, float] | None = None
        self._progress: tuple[float, Pose] | None = None
        self._speed = CRUISE
        self._rois: list[tuple[float, float, float]] = []
        self._roi: tuple[float, float, float] | None = None
        self._panning: Panorama | None = None

    # -- what others ask

    @property
    def playing(self) -> bool:
        return self.state is PlayingState.PLAYING

    @property
    def items(self) -> tuple[PlanLine, ...]:
        """Return the items of the plan that plays, or played last.

        Their index is that of MissionItemExecuted.
        """
        return self._items

    @property
    def available(self) -> bool:
        """A plan could be started."""
        return all(self._parts[part] for part in (Part.GPS, Part.CALIBRATION, Part.TAKE_OFF, Part.CAMERA_AVAILABLE))

    @property
    def survives_disconnection(self) -> bool:
        """True when the plan plays on after the loss of the controller."""
        if not self.playing:
            return False
        return self._goes_on if self._goes_on is not None else not self._settings["return_on_disconnect"]

    def states_report(self) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        messages: list[Message] = [
            self._playing_report(),
            common.AvailabilityStateChanged(int(self.available)),
            *(common.ComponentStateListChanged(part, int(ok)) for part, ok in self._parts.items()),
        ]
        if self._model.modern:
            messages.append(self._recovery)  # what is missing is reported by `services`
        return messages

    def _playing_report(self) -> Message:
        name = "" if self.state is PlayingState.STOPPED else self._name
        return common.MavlinkFilePlayingStateChanged(self.state, name, self._type)

    # -- conditions

    def sensors(self, fix: bool, magneto: bool, can_fly: bool) -> None:
        """Update the conditions that a plan needs.

        They are a fix, a calibrated magnetometer, and a drone that flies or may take off.
        """
        was = self.available
        seen = {Part.GPS: fix, Part.CALIBRATION: magneto, Part.TAKE_OFF: can_fly}
        for part in Part:
            if part not in _LOOKED_AT:
                self._mark(part, seen.get(part, True) and part not in self._faults.refuse_plan)
        if self.available is not was:
            self._emit(common.AvailabilityStateChanged(int(self.available)))
        if self.playing and not (fix and magneto):
            error = PlayError.NOT_CALIBRATED if fix else PlayError.GPS_NOT_FIXED
            self._emit(common.MavlinkPlayErrorStateChanged(error))
            self.stop(hover=True)

    def _mark(self, part: Part, ok: bool) -> None:
        if self._parts[part] is not ok:
            self._parts[part] = ok
            self._emit(common.ComponentStateListChanged(part, int(ok)))

    # -- commands

    def start(
        self,
        uid: str,
        type: MavlinkType,
        data: bytes | None,
        pose: Pose,
        time: float,
        *,
        name: str = "",
        item: int = 0,
        goes_on: bool | None = None,
    ) -> bool:
        """Start at an item, or resume after a pause; return False when it is refused.

        Events report the reason of a refusal.
        """
        if uid == self._uid and self.state is PlayingState.PAUSED:
            self._begun, self._progress = False, None
            self._set(PlayingState.PLAYING)
            return True
        for part in _LOOKED_AT:
            self._mark(part, part not in self._faults.refuse_plan)
        items = self._read(data, type)
        if items is None or item >= len(items):
            self._mark(Part.MAVLINK_FILE, False)
        elif not all(self._within(found) for found in items[item:]):
            self._mark(Part.WAYPOINTS_BEYOND_GEOFENCE, False)
        on_ground = not self._pilot.airborne
        no_way_up = type is MavlinkType.FLIGHT_PLAN_V2 and items is not None and on_ground and not _lifts(items[item:])
        if not all(self._parts.values()) or items is None or no_way_up:
            self._refuse(uid, type)
            return False
        self._uid, self._name, self._type = uid, name or uid, type
        self._items, self._index, self._goes_on = items, item, goes_on
        self._begun, self._progress, self._began, self._time = False, None, time, time
        self._speed, self._roi = CRUISE, None
        self._camera.start(type)
        self._rois = [self._point(found) for found in items if found.command is PlanCommand.SET_ROI and found.p1 == 3]
        self._legs = self._way_in(pose) if self._model.modern and not on_ground else []
        self._set(PlayingState.PLAYING)
        if on_ground:
            self._pilot.plan_take_off()
        return True

    def _read(self, data: bytes | None, type: MavlinkType) -> tuple[PlanLine, ...] | None:
        known = (MavlinkType.FLIGHT_PLAN,) if self._model.plan_version == 1 else tuple(MavlinkType)
        if data is None or type not in known or type is MavlinkType.MAP_MY_HOUSE:
            self._note("plan", {"refused": "no such file" if data is None else f"type {int(type)}"})
            return None
        try:
            return read(data, 2 if type is MavlinkType.FLIGHT_PLAN_V2 else 1)
        except PlanFileError as error:
            self._note("plan", {"refused": str(error)})
            return None

    def _refuse(self, uid: str, type: MavlinkType) -> None:
        if not self._parts[Part.GPS]:
            self._emit(common.MavlinkPlayErrorStateChanged(PlayError.GPS_NOT_FIXED))
        elif not self._parts[Part.CALIBRATION]:
            self._emit(common.MavlinkPlayErrorStateChanged(PlayError.NOT_CALIBRATED))
        self._emit(common.StartingErrorEvent())
        if not self.playing:
            self._emit(common.MavlinkFilePlayingStateChanged(PlayingState.STOPPED, uid, type))

    def pause(self) -> None:
        """Hover, and remember where it was; without a plan that plays its state is repeated."""
        if self.playing:
            self._leave()
            self._set(PlayingState.PAUSED)
        else:
            self._emit(self._playing_report())

    def stop(self, *, hover: bool) -> None:
        """End the plan. `hover`: no other flight task follows, so the drone hovers."""
        if self.state is PlayingState.STOPPED:
            return
        if hover and self.playing:
            self._leave()
        self._end()

    def report_stopped(self) -> None:
        """The answer to Stop when nothing plays."""
        self._emit(self._playing_report())

    def clear_recovery(self) -> None:
        self._recovery = flight_plan.RecoveryInfo("", "", 0, 0, "")
        self._emit(self._recovery)

    def _leave(self) -> None:
        self._stop_panning()
        if self._pilot.airborne:
            self._body.hover()
        self._target = None

    def _end(self) -> None:
        self._stop_panning()
        self._target = None
        self._set(PlayingState.STOPPED)
        if self._model.modern:
            custom = "" if self._name == self._uid else self._name
            seconds = round(self._time - self._began)
            self._recovery = flight_plan.RecoveryInfo(self._uid, custom, self._index, seconds, "")
            self._emit(self._recovery)

    def _set(self, state: PlayingState) -> None:
        self.state = state
        self._note("plan", {"state": state.name.lower(), "item": self._index})
        self._emit(common.MavlinkFilePlayingStateChanged(state, self._name, self._type))

    # -- time

    def tick(self, time: float, pose: Pose, arrived: bool) -> None:
        """Go on; called while it plays and the drone flies."""
        self._time = time
        self._camera.tick()
        if self._legs:
            self._fly_in(pose, time)
            return
        while self.playing:
            item = self._items[self._index]
            if not self._begun:
                self._begun, self._due, self._progress = True, time, None
                self._note("item", {"index": self._index, "command": item.command.name.lower()})
                if _BEGIN[item.command](self, item, pose, time) is False:
                    return  # the plan is over
            self._stare(pose)
            if not self._done(item, pose, arrived, time):
                return
            if item.command is PlanCommand.LAND:  # the way point before it has been reached
                self._finish(self._pilot.plan_land)
                return
            self._next()

    def _next(self) -> None:
        self._begun = False
        if self._index + 1 < len(self._items):
            self._emit(common.MissionItemExecuted(self._index))
            self._index += 1
        else:
            self._leave()
            self._end_with_last_line()

    def _end_with_last_line(self) -> None:
        """End the plan and report its last line.

        Real firmware may report that line before the end, afterwards, or not at all.
        """
        quirks, report = self._faults.quirks, common.MissionItemExecuted(self._index)
        late = Quirk.STOPPED_BEFORE_EXECUTED in quirks
        reported = Quirk.LAST_ITEM_NOT_REPORTED not in quirks
        if reported and not late:
            self._emit(report)
        self._end()
        if reported and late:
            self._emit(report)

    def _done(self, item: PlanLine, pose: Pose, arrived: bool, time: float) -> bool:
        if self._target is not None and item.command in _MOVING and item.command is not PlanCommand.PANORAMA:
            if self._near(item, pose):
                return True
            if not self._stalled(pose, time):
                return False
            if self._model.modern:
                self._emit(flight_plan.WaypointSkipped(self._index))
            return True
        if item.command is PlanCommand.PANORAMA:
            assert self._panning is not None, "begun with the item"
            over = self._panning.tick(time, arrived)
            if over:
                self._stop_panning()
            return over
        if item.command is PlanCommand.START_PHOTO and self._camera.count(item) == 1:
            return not self._operator.camera_busy or time >= self._due + CAMERA_LIMIT
        return time >= self._due

    def _near(self, item: PlanLine, pose: Pose) -> bool:
        assert self._target is not None
        radius = item.p2 if item.command is PlanCommand.WAYPOINT and item.p2 > 0.0 else ACCEPTANCE
        return math.dist((pose.north, pose.east, pose.up), self._target) <= radius

    def _stalled(self, pose: Pose, time: float) -> bool:
        if self._progress is None or _way(pose, self._progress[1]) > _MOVED:
            self._progress = (time, pose)
        return time - self._progress[0] > STALL

    # -- places

    def _point(self, item: PlanLine) -> tuple[float, float, float]:
        return (*self._origin.offset(item.latitude, item.longitude), item.up(self._origin.altitude))

    def _within(self, item: PlanLine) -> bool:
        """Inside the fence and under the ceiling."""
        if item.command is not PlanCommand.WAYPOINT:
            return True
        north, east, up = self._point(item)
        if up > self._settings.number("max_altitude"):
            return False
        return self._pilot.fence_margin(north, east) >= 0.0

    def _way_in(self, pose: Pose) -> list[tuple[float, float, float]]:
        """Up here, then over to above the first way point (Parrot's flight plan page, for the Ai)."""
        first = next((item for item in self._items[self._index :] if item.command is PlanCommand.WAYPOINT), None)
        if first is None:
            return []
        north, east, up = self._point(first)
        height = max(self._settings.number("rth_min_altitude"), up, pose.up)
        height = min(height, self._settings.number("max_altitude"))
        return [(pose.north, pose.east, height), (north, east, height)]

    def _fly_in(self, pose: Pose, time: float) -> None:
        leg = self._legs[0]
        if self._target != leg:
            self._go(leg, pose, math.nan)
        if self._stalled(pose, time):
            self._legs.clear()
            self._progress = None
        elif math.dist((pose.north, pose.east, pose.up), leg) < 1.0:
            self._legs.pop(0)

    def _go(self, target: tuple[float, float, float], pose: Pose, yaw: float) -> None:
        """Fly there; `yaw` in deg from north, NaN: towards it."""
        self._target = target
        north, east, up = target
        bearing, distance = pose.bearing(north, east)
        wanted = yaw * RAD_PER_DEG if math.isfinite(yaw) else bearing
        turns = math.isfinite(yaw) or distance > 1.0
        self._body.move(
            north,
            east,
            max(up, _LAND_SAFE),
            yaw=self._body.nearest(wanted) if turns else None,
            turn=Turn.STICK if self._roi is not None else Turn.DURING,
            speed=min(self._speed, self._model.airframe.max_speed),
            climb=self._settings.number("max_vertical_speed"),
            yaw_rate=TURN_SPEED,
        )

    def _stare(self, pose: Pose) -> None:
        if self._roi is None:
            return
        seen = look(pose, *self._roi)
        self._body.stick_yaw(seen.yaw_rate(pose.yaw, TURN_SPEED))
        self._operator.aim(seen.elevation * DEG_PER_RAD)

    def _look_at(self, point: tuple[float, float, float] | None, pose: Pose) -> None:
        self._roi = point
        if self._target is None:
            self._target = (pose.north, pose.east, pose.up)
        self._go(self._target, pose, pose.yaw * DEG_PER_RAD)

    # -- items

    def _waypoint(self, item: PlanLine, pose: Pose, time: float) -> None:
        # In "continue" the nose turns to the way point's heading on the way, which is what a move does anyway.
        self._go(self._point(item), pose, item.p4)

    def _take_off(self, item: PlanLine, pose: Pose, time: float) -> None:
        # Version 1 ignores all parameters; 2 flies to the position, if there is one.
        self._target = None
        if self._type is MavlinkType.FLIGHT_PLAN_V2 and item.placed:
            self._go(self._point(item), pose, item.p4)

    def _land(self, item: PlanLine, pose: Pose, time: float) -> bool | None:
        if self._type is not MavlinkType.FLIGHT_PLAN_V2 or not item.placed:
            return self._finish(self._pilot.plan_land)
        north, east, up = self._point(item)
        self._go((north, east, max(up, _LAND_SAFE)), pose, item.p4)
        return None

    def _return(self, item: PlanLine, pose: Pose, time: float) -> bool:
        return self._finish(self._pilot.plan_return)

    def _finish(self, then: Callable[[], None]) -> bool:
        self._end_with_last_line()
        then()
        return False

    def _delay(self, item: PlanLine, pose: Pose, time: float) -> None:
        self._due = time + (item.p1 if item.p1 > 0.0 else 0.0)

    def _change_speed(self, item: PlanLine, pose: Pose, time: float) -> None:
        if item.p2 > 0.0:
            self._speed = item.p2
            if self._target is not None:
                self._go(self._target, pose, pose.yaw * DEG_PER_RAD)

    def _set_roi(self, item: PlanLine, pose: Pose, time: float) -> None:
        if item.command is PlanCommand.SET_ROI and self._type is not MavlinkType.FLIGHT_PLAN_V2:
            return  # version 1 only numbers them; SET_VIEW_MODE looks at one
        wanted = item.command is PlanCommand.SET_ROI_LOCATION or item.p1 == 3
        self._look_at(self._point(item) if wanted else None, pose)

    def _view_mode(self, item: PlanLine, pose: Pose, time: float) -> None:
        index = int(item.p2) if item.p2 == item.p2 else -1
        looks = item.p1 == 2 and 0 <= index < len(self._rois)
        self._look_at(self._rois[index] if looks else None, pose)

    def _mount(self, item: PlanLine, pose: Pose, time: float) -> None:
        neutral = self._type is MavlinkType.FLIGHT_PLAN_V2 and item.altitude == 1
        if neutral or math.isfinite(item.p1):
            self._operator.aim(0.0 if neutral else item.p1)

    def _photograph(self, item: PlanLine, pose: Pose, time: float) -> None:
        self._camera.carry_out(item)

    def _panorama(self, item: PlanLine, pose: Pose, time: float) -> None:
        self._target = (pose.north, pose.east, pose.up)
        self._panning = Panorama(item, self._body, self._operator, pose, time, CRUISE)

    def _stop_panning(self) -> None:
        if self._panning is not None:
            self._panning.end()
            self._panning = None


def _lifts(items: tuple[PlanLine, ...]) -> bool:
    return bool(items) and items[0].command is PlanCommand.TAKEOFF


def _way(pose: Pose, before: Pose) -> float:
    return math.dist((pose.north, pose.east, pose.up), (before.north, before.east, before.up))


_MOVING = frozenset({PlanCommand.WAYPOINT, PlanCommand.TAKEOFF, PlanCommand.LAND, PlanCommand.PANORAMA})

_BEGIN: dict[PlanCommand, Callable[[FlightPlan, PlanLine, Pose, float], bool | None]] = {
    PlanCommand.WAYPOINT: FlightPlan._waypoint,
    PlanCommand.RETURN_TO_LAUNCH: FlightPlan._return,
    PlanCommand.LAND: FlightPlan._land,
    PlanCommand.TAKEOFF: FlightPlan._take_off,
    PlanCommand.DELAY: FlightPlan._delay,
    PlanCommand.CONDITION_DELAY: FlightPlan._delay,
    PlanCommand.CHANGE_SPEED: FlightPlan._change_speed,
    PlanCommand.SET_ROI_LOCATION: FlightPlan._set_roi,
    PlanCommand.SET_ROI_NONE: FlightPlan._set_roi,
    PlanCommand.SET_ROI: FlightPlan._set_roi,
    PlanCommand.MOUNT_CONTROL: FlightPlan._mount,
    PlanCommand.PANORAMA: FlightPlan._panorama,
    PlanCommand.SET_VIEW_MODE: FlightPlan._view_mode,
    **dict.fromkeys(COMMANDS, FlightPlan._photograph),
}

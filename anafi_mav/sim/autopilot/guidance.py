"""Selection of the active flight task: the sticks, a moveBy, a moveTo or the return home.

A move leaves the sticks without effect, but for yaw in a moveTo without orientation (ardrone3.xml moveTo). A new
moveTo replaces a running one silently, a new moveBy interrupts a running one (both ardrone3.xml). While a return home
flies, moves are refused and the sticks do nothing; that is assumed.
"""

from __future__ import annotations

from collections.abc import Callable

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, move
from anafi_mav.arsdk.messages.ardrone3 import MoveByError, MoveToStatus
from anafi_mav.arsdk.messages.rth import RthEndingBehavior
from anafi_mav.sim.autopilot.homing import Homing
from anafi_mav.sim.autopilot.moves import MoveBy, MoveTo, asked_speeds, own_speeds
from anafi_mav.sim.features.settings import DroneSettings
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.faults import Faults
from anafi_mav.sim.world.model import AircraftModel
from anafi_mav.sim.world.motion import Pose
from anafi_mav.sim.world.place import WorldOrigin
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.units import RAD_PER_DEG, clip

STICK_TIMEOUT = 0.5
"""s of the machine's clock without a PCMD after which the sticks count as released. Parrot publishes no number."""

STALL = 3.0
"""s without progress after which a move or return gives up: a fence or the ceiling is in the way."""


class Guidance:
    """Steers the body while the drone is HOVERING or FLYING."""

    def __init__(
        self,
        model: AircraftModel,
        body: Airframe,
        origin: WorldOrigin,
        settings: DroneSettings,
        homing: Homing,
        emit: Callable[[Message], None],
        faults: Faults,
    ) -> None:
        self._model = model
        self._body = body
        self._origin = origin
        self._settings = settings
        self._homing = homing
        self._emit = emit
        self._faults = faults
        self._tilting = False
        """The last PCMD had flag 1: counts only for a firmware that remembers it."""
        self._move: MoveBy | MoveTo | None = None
        self._sticks_until = 0.0
        self._sticks_used = False
        self._stare: float | None = None
        self.taken = False
        """True while another flight task is active: moves are refused."""
        self._progress: tuple[float, Pose, float] | None = None
        """When, where and with which heading a move was last seen to get on."""
        self.take_off_place = (0.0, 0.0)
        """North, east."""

    @property
    def busy(self) -> bool:
        """True while stick input, a move or a return home requests motion."""
        remembered = self._tilting and Quirk.FLAG_REMEMBERED in self._faults.quirks
        return self._move is not None or self._homing.flying or self._sticks_used or remembered

    @property
    def heading_for_place(self) -> bool:
        """A moveTo is flown."""
        return isinstance(self._move, MoveTo)

    def apply_limits(self) -> None:
        """Hand the settings that bound a flight to the body."""
        settings = self._settings
        self._body.limits(
            tilt_rate=settings.number("max_tilt_rate") * RAD_PER_DEG, ceiling=settings.number("max_altitude")
        )
        self._body.fence(settings.number("max_distance") if settings["geofence"] else None, self.fence_centre)

    @property
    def fence_centre(self) -> tuple[float, float]:
        """North, east: where the controller is, or where the drone took off."""
        pilot = self._homing.pilot
        return self.take_off_place if pilot is None else self._origin.offset(pilot.latitude, pilot.longitude)

    def fence_margin(self, north: float, east: float, take_off: tuple[float, float] | None = None) -> float:
        """m between a place and the fence; infinite without one.

        `take_off`: the place of a take-off to come; None: of the last one.
        """
        if not self._settings["geofence"]:
            return float("inf")
        centre = self.fence_centre if take_off is None or self._homing.pilot is not None else take_off
        off_north, off_east = north - centre[0], east - centre[1]
        return self._settings.number("max_distance") - float((off_north**2 + off_east**2) ** 0.5)

    # -- time

    def watch_sticks(self, now: float) -> None:
        """Release the sticks when no PCMD has come for a while."""
        if self._sticks_used and now > self._sticks_until:
            self.release_sticks()

    def tick(self, time: float, pose: Pose, arrived: bool, hovering: bool) -> RthEndingBehavior | None:
        """Go on with what flies the drone. At the end of a return: what is to be done there."""
        if self._move is not None:
            if arrived:
                self._end(MoveByError.OK, MoveToStatus.DONE, pose)
            elif self._stalled(time, pose):
                self._end(MoveByError.UNKNOWN, MoveToStatus.ERROR, pose)
        elif self._homing.active:
            ending = self._homing.tick(pose, arrived, hovering)
            if self._homing.flying and self._stalled(time, pose):
                self._homing.abort()
            return ending
        else:
            self._progress = None
        return None

    def _stalled(self, time: float, pose: Pose) -> bool:
        heading = self._body.heading
        if self._progress is not None:
            since, where, old_heading = self._progress
            way = abs(pose.north - where.north) + abs(pose.east - where.east) + abs(pose.up - where.up)
            if way < 0.05 and abs(heading - old_heading) < RAD_PER_DEG:
                return time - since > STALL
        self._progress = (time, pose, heading)
        return False

    # -- sticks

    def pilot(self, sticks: ardrone3.PCMD, now: float) -> None:
        """PCMD: percent of the limits; pitch + is nose down.

        Without `flag` roll and pitch do not count.
        """
        if self._homing.flying:
            return
        self._tilting = bool(sticks.flag & 1)
        settings = self._settings
        tilt = settings.number("max_tilt") * RAD_PER_DEG if sticks.flag & 1 else 0.0
        yaw_rate = _share(sticks.yaw) * settings.number("max_rotation_speed") * RAD_PER_DEG
        self._sticks_until = now + STICK_TIMEOUT
        if self._stare is not None:
            yaw_rate = self._stare
        if self._move is not None:
            if isinstance(self._move, MoveTo) and self._move.takes_yaw:
                self._body.stick_yaw(yaw_rate)
                self._sticks_used = yaw_rate != 0.0
            return
        wanted = (
            _share(sticks.roll) * tilt,
            -_share(sticks.pitch) * tilt,
            yaw_rate,
            _share(sticks.gaz) * settings.number("max_vertical_speed"),
        )
        self._sticks_used = any(wanted) if self._stare is None else bool(wanted[0] or wanted[1] or wanted[3])
        self._body.sticks(*wanted)

    def stare(self, yaw_rate: float | None) -> None:
        """A point of interest turns the drone (rad/s) in place of the yaw stick; None gives it back."""
        if yaw_rate is not None or self._stare is not None:
            self._stare = yaw_rate
            self._body.stick_yaw(yaw_rate or 0.0)

    def forget_flag(self) -> None:
        """No PCMD of the flight that has ended counts in the next one."""
        self._tilting = False

    def release_sticks(self) -> None:
        self._sticks_used = False
        self._body.sticks(0.0, 0.0, 0.0, 0.0)

    # -- moves

    def move_by(self, message: ardrone3.MoveBy | move.ExtendedMoveBy, pose: Pose, guided: bool) -> None:
        """Start a relative move, or say why not. `guided`: the drone is in a state that takes moves."""
        if isinstance(message, ardrone3.MoveBy):
            wanted = MoveBy(message.dX, message.dY, message.dZ, message.dPsi, own_speeds(self._settings))
        else:
            speeds = asked_speeds(message, self._model.airframe, self._settings)
            wanted = MoveBy(message.d_x, message.d_y, message.d_z, message.d_psi, speeds)
        if not guided:
            error = MoveByError.NOT_AVAILABLE
        elif self._homing.active or self.taken:
            error = MoveByError.BUSY
        elif wanted.cancels:
            self.cancel(pose)
            error = MoveByError.OK
        elif not wanted.possible:
            error = MoveByError.UNKNOWN
        else:
            self.cancel(pose)
            self._begin(wanted)
            wanted.begin(self._body, pose)
            return
        self._emit(wanted.end(error, self._body, pose))

    def move_to(self, message: ardrone3.MoveTo | move.ExtendedMoveTo, pose: Pose, ready: bool) -> None:
        """Start a move to a place, or say ERROR.

        `ready`: the drone takes moves and knows its own place.
        """
        if isinstance(message, ardrone3.MoveTo):
            wanted = MoveTo(message, own_speeds(self._settings))
        else:
            wanted = MoveTo(message, asked_speeds(message, self._model.airframe, self._settings))
        if not ready or self._homing.active or self.taken or not wanted.possible:
            self._emit(wanted.changed(MoveToStatus.ERROR))
            return
        latitude, longitude, altitude = wanted.place
        north, east = self._origin.offset(latitude, longitude)
        if altitude > self._settings.number("max_altitude") or self.fence_margin(north, east) < 0.0:
            self._emit(wanted.changed(MoveToStatus.ERROR))
            return
        if isinstance(self._move, MoveBy):
            self.cancel(pose)
        self._begin(wanted)
        self._emit(wanted.changed(MoveToStatus.RUNNING))
        wanted.begin(self._body, pose, north, east)

    def _begin(self, wanted: MoveBy | MoveTo) -> None:
        self._move = wanted
        self._progress = None
        self._sticks_used = False

    def cancel_move_to(self, pose: Pose) -> None:
        """CancelMoveTo; without a moveTo it has no effect."""
        if isinstance(self._move, MoveTo):
            self.cancel(pose)

    def gps_lost(self, pose: Pose) -> None:
        """A moveTo cannot go on; a moveBy can."""
        if isinstance(self._move, MoveTo):
            self._end(MoveByError.UNKNOWN, MoveToStatus.ERROR, pose)

    def cancel(self, pose: Pose) -> None:
        """End a move that runs because something else begins, and say so."""
        self._end(MoveByError.INTERRUPTED, MoveToStatus.CANCELED, pose)

    def _end(self, error: MoveByError, status: MoveToStatus, pose: Pose) -> None:
        ended, self._move = self._move, None
        if ended is None:
            return
        self._sticks_used = False
        self._body.hover()
        if isinstance(ended, MoveBy):
            self._emit(ended.end(error, self._body, pose))
        else:
            self._emit(ended.changed(status))


def _share(percent: int) -> float:
    return clip(percent, -100, 100) / 100.0

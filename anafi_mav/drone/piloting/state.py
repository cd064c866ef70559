"""Flight state that the drone reports: attitude, motion, flying state, limits.

The verbs are in `piloting`.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import animation, ardrone3, common, follow_me, move, obstacle_avoidance, piloting_style
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, Motion, MoveToStatus, PoiStatus
from anafi_mav.arsdk.messages.common import PlayingState
from anafi_mav.arsdk.messages.follow_me import Mode as FollowMeMode
from anafi_mav.arsdk.messages.piloting_style import PilotingStyleStyle
from anafi_mav.drone.element import Position, Range, Reducer, finite, members, position, setting
from anafi_mav.drone.piloting.sticks import Limits
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.drone.status.home import BY_ITSELF, HomeState
from anafi_mav.errors import CommandRejected
from anafi_mav.units import LARGEST

MOTORS_OFF = frozenset({FlyingState.LANDED, FlyingState.EMERGENCY})
ON_THE_GROUND = MOTORS_OFF | {FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF}


class Attitude(msgspec.Struct, frozen=True):
    """Attitude, rad: roll + right wing down, pitch + nose up, yaw clockwise from north."""

    roll: float
    pitch: float
    yaw: float


class Velocity(msgspec.Struct, frozen=True):
    """Velocity over ground, m/s."""

    north: float
    east: float
    down: float


class Avoidance(msgspec.Struct, frozen=True):
    """Obstacle avoidance: requested mode, state, availability."""

    mode: obstacle_avoidance.Mode
    state: obstacle_avoidance.State
    availability: obstacle_avoidance.Availability


class PilotingState(msgspec.Struct, frozen=True):
    """Flying state, attitude, motion and limits of the drone."""

    flying: FlyingState | None = None
    attitude: Attitude | None = None
    velocity: Velocity | None = None
    altitude: float | None = None
    """m above the take-off point."""
    height: float | None = None
    """m above the ground below."""
    steady: bool | None = None
    """True when the drone lies or hovers still."""
    move_to: MoveToStatus | None = None
    """Status of the last moveTo; None also after one whose end was not reported."""
    move_target: Position | None = None
    """Target of that moveTo; altitude above the take-off point."""
    poi: PoiStatus | None = None
    plan: PlayingState | None = None
    """State of the flight plan; None also after one whose end was not reported."""
    animation: animation.Type | None = None
    """The animation under way; NONE: none is flown."""
    following: FollowMeMode | None = None
    """Mode of follow me; NONE: no target is followed."""
    move_missing: int | None = None
    """Requirements that a guided move lacks, bits of `move.Indicator`; 0: available. Ai only."""
    max_tilt: Range | None = None
    """deg."""
    max_vertical_speed: Range | None = None
    """m/s."""
    max_rotation_speed: Range | None = None
    """deg/s, of the heading."""
    max_tilt_speed: Range | None = None
    """deg/s, of roll and pitch."""
    max_altitude: Range | None = None
    """m above the take-off point; always enforced."""
    max_distance: Range | None = None
    """m from `geofence_centre`; enforced when `geofence` is on."""
    geofence: bool | None = None
    geofence_centre: tuple[float, float] | None = None
    """deg, deg: what `max_distance` counts from, a controller's GPS or the last take-off (ardrone3.xml 1-2-4)."""
    banked_turn: bool | None = None
    max_horizontal_speed: Range | None = None
    """m/s; reported by later generations only."""
    style: PilotingStyleStyle | None = None
    """Frame of the sticks."""
    styles: frozenset[PilotingStyleStyle] | None = None
    avoidance: Avoidance | None = None
    """Ai only."""
    ready_for_hand_launch: bool = False
    """True when the motors idle and the drone waits to be thrown or released."""

    @property
    def motors_on(self) -> bool | None:
        """True when the motors turn; None when the drone has not reported it."""
        return None if self.flying is None else self.flying not in MOTORS_OFF

    @property
    def in_air(self) -> bool | None:
        """True when the drone is off the ground; None when it has not reported it."""
        return None if self.flying is None else self.flying not in ON_THE_GROUND

    @property
    def limits(self) -> Limits | None:
        """Values at full stick; None before the drone has reported all of them."""
        tilt, yaw, climb = self.max_tilt, self.max_rotation_speed, self.max_vertical_speed
        if tilt is None or yaw is None or climb is None:
            return None
        return Limits(tilt.current, yaw.current, climb.current)


def in_state(flying: FlyingState | None) -> str:
    """The flying state as the reason of a refusal."""
    return (
        "the drone has not reported its flying state"
        if flying is None
        else f"the drone is in the state {spoken(flying)}"
    )


def require_free(flight: PilotingState, home: HomeState) -> None:
    """Raise `CommandRejected` while the drone returns by itself or lands.

    A move of ours must not interfere with these.
    """
    if home.returning_by_itself:
        raise CommandRejected(BY_ITSELF)
    if flight.flying in (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING):
        raise CommandRejected(in_state(flight.flying))


def _attitude(state: PilotingState, message: ardrone3.AttitudeChanged) -> PilotingState:
    if not abs(message.roll) + abs(message.pitch) + abs(message.yaw) <= LARGEST:
        return replace(state, attitude=None)
    return replace(state, attitude=Attitude(message.roll, message.pitch, message.yaw))


def _velocity(state: PilotingState, message: ardrone3.SpeedChanged) -> PilotingState:
    if not abs(message.speedX) + abs(message.speedY) + abs(message.speedZ) <= LARGEST:
        return replace(state, velocity=None)
    return replace(state, velocity=Velocity(message.speedX, message.speedY, message.speedZ))


def _centre(state: PilotingState, message: ardrone3.GeofenceCenterChanged) -> PilotingState:
    centre = position(message.latitude, message.longitude, 0.0)
    return replace(state, geofence_centre=None if centre is None else (centre.latitude, centre.longitude))


def _move_to(state: PilotingState, message: ardrone3.MoveToChanged) -> PilotingState:
    target = position(message.latitude, message.longitude, message.altitude)
    return replace(state, move_to=message.status, move_target=target)


def _flying(state: PilotingState, message: ardrone3.FlyingStateChanged) -> PilotingState:
    """Motors that stand end a moveTo and a flight plan, whose ends may not be reported.

    A plan that plays before the motors start has yet to begin.
    """
    stands = message.state in MOTORS_OFF
    return replace(
        state,
        flying=message.state,
        ready_for_hand_launch=state.ready_for_hand_launch and message.state == FlyingState.USERTAKEOFF,
        move_to=None if stands and state.move_to == MoveToStatus.RUNNING else state.move_to,
        plan=None if stands and state.in_air and state.plan == PlayingState.PLAYING else state.plan,
    )


REDUCERS: Mapping[type[Message], Reducer] = {
    ardrone3.FlyingStateChanged: _flying,
    ardrone3.UserTakeoffReady: lambda state, message: replace(state, ready_for_hand_launch=True),
    ardrone3.AttitudeChanged: _attitude,
    ardrone3.SpeedChanged: _velocity,
    ardrone3.AltitudeChanged: lambda state, message: replace(state, altitude=finite(message.altitude)),
    ardrone3.AltitudeAboveGroundChanged: lambda state, message: replace(state, height=finite(message.altitude)),
    ardrone3.MotionState: lambda state, message: replace(state, steady=message.state == Motion.STEADY),
    ardrone3.MoveToChanged: _move_to,
    ardrone3.PilotedPOIV2: lambda state, message: replace(state, poi=message.status),
    common.MavlinkFilePlayingStateChanged: lambda state, message: replace(state, plan=message.state),
    animation.State: lambda state, message: replace(state, animation=message.type),
    follow_me.State: lambda state, message: replace(state, following=message.mode),
    move.Info: lambda state, message: replace(state, move_missing=message.missing_inputs),
    ardrone3.MaxTiltChanged: lambda state, message: replace(state, max_tilt=setting(message)),
    ardrone3.MaxVerticalSpeedChanged: lambda state, message: replace(state, max_vertical_speed=setting(message)),
    ardrone3.MaxRotationSpeedChanged: lambda state, message: replace(state, max_rotation_speed=setting(message)),
    ardrone3.MaxPitchRollRotationSpeedChanged: lambda state, message: replace(state, max_tilt_speed=setting(message)),
    ardrone3.MaxAltitudeChanged: lambda state, message: replace(state, max_altitude=setting(message)),
    ardrone3.MaxDistanceChanged: lambda state, message: replace(state, max_distance=setting(message)),
    ardrone3.NoFlyOverMaxDistanceChanged: lambda state, message: replace(state, geofence=message.shouldNotFlyOver != 0),
    ardrone3.GeofenceCenterChanged: _centre,
    ardrone3.BankedTurnChanged: lambda state, message: replace(state, banked_turn=message.state != 0),
    ardrone3.MaxHorizontalSpeedChanged: lambda state, message: replace(state, max_horizontal_speed=setting(message)),
    piloting_style.Style: lambda state, message: replace(state, style=message.style),
    piloting_style.Capabilities: lambda state, message: replace(
        state, styles=members(message.styles, PilotingStyleStyle)
    ),
    obstacle_avoidance.Status: lambda state, message: replace(
        state, avoidance=Avoidance(message.mode, message.state, message.availability)
    ),
}

"""The native parameters `ANF_*`, which every client sees, whatever autopilot it is shown.

Settings of the drone are written through to it and read as last reported; their ranges are the drone's own. Sources:
ardrone3.xml, rth.xml, precise_home.xml, gimbal.xml, obstacle_avoidance.xml, and which of them the anafi_ros paper
uses. Camera settings are no parameters: they travel by the camera's own protocol.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any

from anafi_mav import texts
from anafi_mav.drone import MODELS, Drone, Range, events
from anafi_mav.drone.events import Axis, PilotingStyleStyle, PreciseHomeMode, RthEndingBehavior, RthHomeType
from anafi_mav.drone.events import ObstacleAvoidanceMode as AvoidanceMode
from anafi_mav.services.parameter.parameter import Limits, Parameter, bounds, current, number, own
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.service import Host
from anafi_mav.vehicle.base.aircraft import FlightSettings
from anafi_mav.vehicle.base.bounds import LOWEST, SLOWEST
from anafi_mav.vehicle.base.move_heading import MoveHeading
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.requester import Source
from anafi_mav.vehicle.flight_policy import BY_NUMBER, NUMBERS
from anafi_mav.vehicle.joystick_override import Override
from anafi_mav.vehicle.link_loss import LossAction
from anafi_mav.vehicle.offboard.stream import LONGEST_TIMEOUT, SHORTEST_TIMEOUT
from anafi_mav.vehicle.return_end import LONGEST_WAIT, SHORTEST_WAIT, EndOfReturn

OFF_ON = {0: "Off", 1: "On"}


def _range(
    name: str,
    short: str,
    setting: Callable[[Drone], Range | None],
    verb: Callable[[Drone], Callable[[float], Awaitable[Any]]],
    update: Any,
    *,
    unit: str,
    step: float,
    decimals: int = 0,
    group: str,
    long: str = "",
    models: str = "all",
) -> Parameter:
    """Return the parameter of a setting that the drone reports with its range."""
    return Parameter(
        name,
        ParamType.REAL32,
        short,
        read=lambda host: current(setting(host.drone)),
        write=lambda host, value: verb(host.drone)(value),
        limits=lambda host: bounds(setting(host.drone)),
        updates=(update,),
        present=lambda drone: setting(drone) is not None,
        unit=unit,
        step=step,
        decimals=decimals,
        group=group,
        long=long,
        source=update.NAME,
        models=models,
    )


def _switch(
    name: str,
    short: str,
    state: Callable[[Drone], bool | None],
    verb: Callable[[Drone], Callable[[bool], Awaitable[Any]]],
    update: Any,
    *,
    group: str,
    long: str = "",
    models: str = "all",
) -> Parameter:
    """Return the parameter of a setting of the drone that is on or off."""
    return Parameter(
        name,
        ParamType.INT32,
        short,
        read=lambda host: number(state(host.drone)),
        write=lambda host, value: verb(host.drone)(value == 1),
        values=OFF_ON,
        updates=(update,),
        present=lambda drone: state(drone) is not None,
        group=group,
        long=long,
        source=update.NAME,
        models=models,
    )


FLIGHT, HOME, GIMBAL, CONTROLLER = "ANAFI flight", "ANAFI home", "ANAFI gimbal", "Skycontroller"
GATEWAY = "Gateway"

MAX_TILT = _range(
    "ANF_MAX_TILT",
    "Maximum tilt",
    lambda drone: drone.piloting.state.max_tilt,
    lambda drone: drone.piloting.set_max_tilt,
    events.MaxTiltChanged,
    unit="deg",
    step=1.0,
    group=FLIGHT,
    long="Tilt at full stick deflection, and the largest tilt of setpoints.",
)
TILT_RATE = _range(
    "ANF_TILT_RATE",
    "Maximum rate of roll and pitch",
    lambda drone: drone.piloting.state.max_tilt_speed,
    lambda drone: drone.piloting.set_max_tilt_speed,
    events.MaxPitchRollRotationSpeedChanged,
    unit="deg/s",
    step=1.0,
    group=FLIGHT,
)
YAW_RATE = _range(
    "ANF_YAW_RATE",
    "Maximum yaw rate",
    lambda drone: drone.piloting.state.max_rotation_speed,
    lambda drone: drone.piloting.set_max_rotation_speed,
    events.MaxRotationSpeedChanged,
    unit="deg/s",
    step=1.0,
    group=FLIGHT,
)
VERTICAL_SPEED = _range(
    "ANF_VERT_SPEED",
    "Maximum vertical speed",
    lambda drone: drone.piloting.state.max_vertical_speed,
    lambda drone: drone.piloting.set_max_vertical_speed,
    events.MaxVerticalSpeedChanged,
    unit="m/s",
    step=0.1,
    decimals=1,
    group=FLIGHT,
)
HORIZONTAL_SPEED = _range(
    "ANF_HORI_SPEED",
    "Maximum horizontal speed",
    lambda drone: drone.piloting.state.max_horizontal_speed,
    lambda drone: drone.piloting.set_max_horizontal_speed,
    events.MaxHorizontalSpeedChanged,
    unit="m/s",
    step=0.1,
    decimals=1,
    group=FLIGHT,
    long="Later firmware generations only. Otherwise each move carries its speed (ANF_CRUISE_SPEED).",
    models="none of these",
)
MAX_ALTITUDE = _range(
    "ANF_MAX_ALT",
    "Ceiling above take-off",
    lambda drone: drone.piloting.state.max_altitude,
    lambda drone: drone.piloting.set_max_altitude,
    events.MaxAltitudeChanged,
    unit="m",
    step=1.0,
    decimals=1,
    group=FLIGHT,
    long="The drone enforces it against every command.",
)
MAX_DISTANCE = _range(
    "ANF_MAX_DIST",
    "Radius of the drone's own geofence",
    lambda drone: drone.piloting.state.max_distance,
    lambda drone: drone.piloting.set_max_distance,
    events.MaxDistanceChanged,
    unit="m",
    step=10.0,
    group=FLIGHT,
    long="In force while ANF_GEOFENCE is on.",
)
GEOFENCE = _switch(
    "ANF_GEOFENCE",
    "The drone stays within ANF_MAX_DIST",
    lambda drone: drone.piloting.state.geofence,
    lambda drone: drone.piloting.set_geofence,
    events.NoFlyOverMaxDistanceChanged,
    group=FLIGHT,
)
CAMERA_RELATIVE = Parameter(
    "ANF_CAM_RELATIVE",
    ParamType.INT32,
    "Stick input is relative to the direction of the camera",
    read=lambda host: number(host.drone.piloting.state.style),
    write=lambda host, value: host.drone.piloting.set_style(PilotingStyleStyle(int(value))),
    values=OFF_ON,
    updates=(events.PilotingStyle,),
    present=lambda drone: drone.piloting.state.style is not None,
    group=FLIGHT,
    long="Also of a Skycontroller. On: velocity setpoints, follow and orbit are refused, since their loops need the "
    "drone's own axes.",
    source=events.PilotingStyle.NAME,
)
BANKED_TURN = _switch(
    "ANF_BANKED_TURN",
    "The drone banks in a turn",
    lambda drone: drone.piloting.state.banked_turn,
    lambda drone: drone.piloting.set_banked_turn,
    events.BankedTurnChanged,
    group=FLIGHT,
)


def _avoidance(drone: Drone) -> bool | None:
    avoidance = drone.piloting.state.avoidance
    return None if avoidance is None else avoidance.mode == AvoidanceMode.STANDARD


AVOIDANCE = _switch(
    "ANF_OBS_AVOID",
    "The drone flies around obstacles",
    _avoidance,
    lambda drone: drone.piloting.set_obstacle_avoidance,
    events.ObstacleAvoidanceStatus,
    group=FLIGHT,
    long="Requested state. Availability depends on the light and on the stereo camera.",
    models="ai",
)
RETURN_ALTITUDE = _range(
    "ANF_RTH_ALT",
    "Height to which a return climbs first",
    lambda drone: drone.home.state.min_altitude,
    lambda drone: drone.home.set_min_altitude,
    events.ReturnMinAltitude,
    unit="m",
    step=1.0,
    decimals=1,
    group=HOME,
)
RETURN_END_ALTITUDE = _range(
    "ANF_RTH_END_ALT",
    "Height of the hover at the end of a return",
    lambda drone: drone.home.state.ending_altitude,
    lambda drone: drone.home.set_ending_altitude,
    events.ReturnEndingAltitude,
    unit="m",
    step=1.0,
    decimals=1,
    group=HOME,
)
RETURN_ENDING = Parameter(
    "ANF_RTH_END",
    ParamType.INT32,
    "End of a return begun by the drone",
    read=lambda host: number(host.drone.home.state.ending),
    write=lambda host, value: host.drone.home.set_ending(RthEndingBehavior(int(value))),
    values={int(RthEndingBehavior.LANDING): "Landing", int(RthEndingBehavior.HOVERING): "Hovering"},
    updates=(events.ReturnEnding,),
    present=lambda drone: drone.home.state.ending is not None,
    group=HOME,
    source=events.ReturnEnding.NAME,
    long="Applies to returns that the drone begins, and to every return if gateway or link is lost on the way. "
    "Landing: every return lands.",
)


def _delay_limits(host: Host) -> Limits | None:
    found = host.drone.home.state.delay_range_s
    return None if found is None else (float(found[0]), float(found[1]))


RETURN_DELAY = Parameter(
    "ANF_RTH_DELAY",
    ParamType.INT32,
    "Time from the loss of the drone's link to its return",
    read=lambda host: number(host.drone.home.state.delay_s),
    write=lambda host, value: host.drone.home.set_delay(int(value)),
    limits=_delay_limits,
    updates=(events.ReturnDelay,),
    present=lambda drone: drone.home.state.delay_s is not None,
    unit="s",
    step=1.0,
    group=HOME,
    long="The link between gateway and drone, or Skycontroller and drone. For ground stations see ANF_GCS_LOSS.",
    source=events.ReturnDelay.NAME,
)
RETURN_BY_ITSELF = _switch(
    "ANF_RTH_AUTO",
    "The drone returns when its battery is just sufficient for the return",
    lambda drone: drone.home.state.by_itself,
    lambda drone: drone.home.set_by_itself,
    events.ReturnAutoTriggerMode,
    group=HOME,
)


def _precise(drone: Drone) -> bool | None:
    mode = drone.home.state.precise_mode
    return None if mode is None else mode == PreciseHomeMode.STANDARD


MISSION_RETURN = _switch(
    "ANF_MIS_RTH",
    "A lost link ends a mission with a return home",
    lambda drone: drone.flight_plan.state.returns_on_disconnect,
    lambda drone: drone.flight_plan.set_returns_on_disconnect,
    events.ReturnHomeOnDisconnectChanged,
    group=HOME,
    long="Off: after link loss, or without the gateway, the drone flies its flight-plan file to the end. Behind a "
    "Skycontroller it does so without the gateway in any case.",
)
PRECISE_HOME = _switch(
    "ANF_RTH_PRECISE",
    "A return uses the picture of the take-off place",
    _precise,
    lambda drone: drone.home.set_precise,
    events.PreciseHomeModeChanged,
    group=HOME,
)


async def _set_home_type(host: Host, value: float) -> None:
    async with host.vehicle.home_choice:  # else a rally point may be reported as the home afterwards
        await host.drone.home.set_preferred_type(RthHomeType(int(value)))


HOME_TYPE = Parameter(
    "ANF_HOME_TYPE",
    ParamType.INT32,
    "Preferred home",
    read=lambda host: number(host.drone.home.state.preferred_type),
    write=_set_home_type,
    values={
        int(RthHomeType.TAKEOFF): "Take-off",
        int(RthHomeType.FOLLOWEE): "Followed target",
        int(RthHomeType.CUSTOM): "Custom place",
        int(RthHomeType.PILOT): "Pilot",
    },
    updates=(events.PreferredHomeType,),
    present=lambda drone: drone.home.state.preferred_type is not None,
    group=HOME,
    long="The take-off point if the drone does not know that place. Some models support fewer kinds.",
    source=events.PreferredHomeType.NAME,
)


def _gimbal_speed(drone: Drone) -> Range | None:
    """Return the speed range of the main gimbal's pitch axis, which stands for all axes.

    The drone has one number for all axes, and pitch is an axis of every model.
    """
    return drone.gimbal[0].max_speed.get(Axis.PITCH)


GIMBAL_SPEED = _range(
    "ANF_GMB_SPEED",
    "Maximum speed of the gimbal",
    _gimbal_speed,
    lambda drone: drone.gimbal.set_max_speed,
    events.GimbalMaxSpeed,
    unit="deg/s",
    step=1.0,
    group=GIMBAL,
)
CONTROLLER_WHEELS = Parameter(
    "ANF_SC_WHEELS",
    ParamType.INT32,
    "Clients read the Skycontroller's two wheels",
    read=lambda host: number(host.vehicle.controller_inputs.wheels),
    write=lambda host, value: host.vehicle.controller_inputs.request_wheels(value == 1),
    values=OFF_ON,
    updates=(events.GrabState,),
    present=lambda drone: drone.controller.present,
    group=CONTROLLER,
    long="On: RC_CHANNELS 5 (tilt) and 6 (zoom) and ANAFI_CONTROLLER_INPUT report them. They do not move camera and "
    "zoom.",
    source=events.GrabState.NAME,
    models="behind a Skycontroller",
)
CONTROLLER_BUTTONS = Parameter(
    "ANF_SC_BUTTONS",
    ParamType.INT32,
    "Clients read the two buttons at the Skycontroller's back",
    read=lambda host: number(host.vehicle.controller_inputs.buttons),
    write=lambda host, value: host.vehicle.controller_inputs.request_buttons(value == 1),
    values=OFF_ON,
    updates=(events.GrabState,),
    present=lambda drone: drone.controller.present,
    group=CONTROLLER,
    long="On: RC_CHANNELS 7 (left) and 8 (right) and ANAFI_CONTROLLER_INPUT report them. They do not reset camera "
    "and zoom. Return home and take-off/land are always the pilot's.",
    source=events.GrabState.NAME,
    models="behind a Skycontroller",
)
PILOT_SWITCH = Parameter(
    "ANF_SC_OFFBOARD",
    ParamType.INT32,
    "Aircraft is the Skycontroller pilot's or the programs'",
    read=lambda host: NUMBERS[host.vehicle.pilot_switch.state],
    write=lambda host, value: host.vehicle.pilot_switch.request(BY_NUMBER[int(value)]),
    values={0: "Pilot: programs only stop, land and return", 1: "Program", 2: "Automatic"},
    polled=True,
    present=lambda drone: drone.controller.present,
    group=CONTROLLER,
    long="Automatic: a stick and a command take the aircraft from each other. Program: sticks and piloting source are "
    "kept for programs until the pilot moves a stick, which sets Pilot. Pilot: flight commands, setpoints and sticks "
    "of clients are refused; Hold, pause, Land, Return and disarm are not.",
    default=2,
    source="anafi_ros skycontroller/offboard",
    models="behind a Skycontroller",
)
MODEL = Parameter(
    "ANF_MODEL",
    ParamType.INT32,
    "Model of the drone",
    read=lambda host: float(host.drone.identity.model.id),
    values={model.id: model.title for model in MODELS.values()},
    group=FLIGHT,
    source="discovery",
)


# The gateway's own.


def _set(host: Host, **changes: Any) -> None:
    host.vehicle.settings = replace(host.vehicle.settings, **changes)


def _put_takeoff_height(host: Host, value: float) -> None:
    _set(host, takeoff_height=value)


def _takeoff_limits(host: Host) -> Limits:
    ceiling = host.drone.piloting.state.max_altitude
    return LOWEST, math.inf if ceiling is None else ceiling.current


TAKEOFF_HEIGHT = Parameter(
    "ANF_TKOFF_ALT",
    ParamType.REAL32,
    "Height of a take-off without a height",
    read=lambda host: host.vehicle.settings.takeoff_height,
    write=own(_put_takeoff_height),
    put=_put_takeoff_height,
    limits=_takeoff_limits,
    polled=True,
    unit="m",
    step=0.5,
    decimals=1,
    group=GATEWAY,
    default=2.5,
    source="gateway; up to ANF_MAX_ALT",
)


async def _set_hand_launch(host: Host, value: float) -> None:
    _set(host, hand_launch=value == 1)


HAND_LAUNCH = Parameter(
    "ANF_HAND_LAUNCH",
    ParamType.INT32,
    "Arming starts the motors",
    read=lambda host: number(host.vehicle.settings.hand_launch),
    write=_set_hand_launch,
    values=OFF_ON,
    polled=True,
    group=GATEWAY,
    long="Off: the motors stay off until a take-off (an ANAFI has no armed state). On: arming starts the motors, "
    "which idle until the drone leaves the hand.",
    default=0.0,
    source="gateway",
)

MAX_CRUISE_SPEED = 15.0
"""m/s: the maximum of anafi_ros (its max_horizontal_speed); no model reports its own limit."""


def _move_speed(value: float) -> float | None:
    """Return the speed (m/s) of moves, None for the drone's own.

    Raises `Refused` for one at which no move would end.
    """
    if 0.0 < value < SLOWEST:
        raise Refused(texts.SPEED, texts.SPEED_RANGE.fill(slowest=SLOWEST, fastest=MAX_CRUISE_SPEED), lasting=True)
    return value or None


async def _set_cruise_speed(host: Host, value: float) -> None:
    _set(host, cruise_speed=_move_speed(value))
    host.vehicle.commanded_speeds = replace(host.vehicle.commanded_speeds, cruise=None)
    await _go_on(host)


async def _set_climb_speed(host: Host, value: float) -> None:
    _set(host, climb_speed=_move_speed(value))
    host.vehicle.commanded_speeds = replace(host.vehicle.commanded_speeds, climb=None)
    await _go_on(host)


async def _go_on(host: Host) -> None:
    """A move under way changes its speed, as it does for MAV_CMD_DO_CHANGE_SPEED.

    Not while a command is carried out: a Hold that has arrived would be ended by it.
    """
    vehicle = host.vehicle
    if vehicle.control.is_settled and (goto := vehicle.guided.goto) is not None:
        await vehicle.control.perform(vehicle.guided.go(goto, by=Source.GATEWAY))


def _climb_limits(host: Host) -> Limits | None:
    setting = host.drone.piloting.state.max_vertical_speed
    return None if setting is None else (0.0, setting.max)


CRUISE_SPEED = Parameter(
    "ANF_CRUISE_SPEED",
    ParamType.REAL32,
    "Ground speed of moves",
    read=lambda host: host.vehicle.settings.cruise_speed or 0.0,
    write=_set_cruise_speed,
    limits=lambda host: (0.0, MAX_CRUISE_SPEED),
    polled=True,
    unit="m/s",
    step=0.1,
    decimals=1,
    group=GATEWAY,
    long="0: the drone's default; else 0.1 at least. MAV_CMD_DO_CHANGE_SPEED replaces it until the landing.",
    default=0.0,
    source="gateway",
)
CLIMB_SPEED = Parameter(
    "ANF_CLIMB_SPEED",
    ParamType.REAL32,
    "Vertical speed of moves",
    read=lambda host: host.vehicle.settings.climb_speed or 0.0,
    write=_set_climb_speed,
    limits=_climb_limits,
    polled=True,
    unit="m/s",
    step=0.1,
    decimals=1,
    group=GATEWAY,
    long="0: the drone's default; else 0.1 at least. MAV_CMD_DO_CHANGE_SPEED replaces it until the landing.",
    default=0.0,
    source="gateway; up to the maximum of ANF_VERT_SPEED",
)


def _put_yaw_mode(host: Host, value: float) -> None:
    _set(host, move_heading=MoveHeading(int(value)))


YAW_MODE = Parameter(
    "ANF_YAW_MODE",
    ParamType.INT32,
    "Heading of a move to a place whose command names none",
    read=lambda host: float(host.vehicle.settings.move_heading),
    write=own(_put_yaw_mode),
    put=_put_yaw_mode,
    values={
        int(MoveHeading.KEEP): "Keep the heading",
        int(MoveHeading.TO_TARGET): "Turn to the target on the way",
        int(MoveHeading.TO_TARGET_FIRST): "Turn to the target, then move",
    },
    polled=True,
    group=GATEWAY,
    long="From the next move on. With 2, a heading that a command names is also turned to before the drone moves. "
    "Not for PX4's Offboard, which keeps the heading, nor for missions, whose way points look to the next one.",
    default=float(MoveHeading.KEEP),
    source="gateway",
)


def _put_loss_action(host: Host, value: float) -> None:
    host.vehicle.gcs_loss.action = LossAction(int(value))


def _put_loss_time(host: Host, value: float) -> None:
    host.vehicle.gcs_loss.after = value


GCS_LOSS = Parameter(
    "ANF_GCS_LOSS",
    ParamType.INT32,
    "Action in the air when all ground stations are lost",
    read=lambda host: float(host.vehicle.gcs_loss.action),
    write=own(_put_loss_action),
    put=_put_loss_action,
    values={action.value: action.name.capitalize() for action in LossAction},
    polled=True,
    group=GATEWAY,
    long="Only after a ground station has been heard. Behind a Skycontroller without an active flight task of the "
    "gateway, only a text is sent. The time restarts when the drone's link is restored. While they are lost, a drone "
    "on the ground is not armed.",
    default=float(LossAction.NOTHING),
    source="gateway",
)
GCS_LOSS_TIME = Parameter(
    "ANF_GCS_LOSS_T",
    ParamType.REAL32,
    "Time without heartbeats of any ground station that counts as loss",
    read=lambda host: host.vehicle.gcs_loss.after,
    write=own(_put_loss_time),
    put=_put_loss_time,
    limits=lambda host: (2.0, 300.0),
    polled=True,
    unit="s",
    step=1.0,
    decimals=1,
    group=GATEWAY,
    default=10.0,
    source="gateway",
)


def put_end_of_return(host: Host, value: float) -> None:
    """Set the end of a commanded return."""
    host.vehicle.return_end.ending = EndOfReturn(int(value))


def put_return_wait(host: Host, value: float) -> None:
    """Set the wait above home, s."""
    host.vehicle.return_end.wait = value


RETURN_LANDING = Parameter(
    "ANF_RTL_END",
    ParamType.INT32,
    "End of a return commanded by a client or the gateway",
    read=lambda host: float(host.vehicle.return_end.ending),
    write=own(put_end_of_return),
    put=put_end_of_return,
    values={int(EndOfReturn.LAND): "Land", int(EndOfReturn.HOVER): "Hover"},
    polled=True,
    group=GATEWAY,
    long="The gateway lands the drone above a home that is certain. Otherwise the drone hovers, and a text gives the "
    "reason. The drone's own ANF_RTH_END does not change.",
    default=float(EndOfReturn.LAND),
    source="gateway",
)
RETURN_WAIT = Parameter(
    "ANF_RTL_WAIT",
    ParamType.REAL32,
    "Wait above home before the landing of ANF_RTL_END",
    read=lambda host: host.vehicle.return_end.wait,
    write=own(put_return_wait),
    put=put_return_wait,
    limits=lambda host: (0.0, LONGEST_WAIT),
    polled=True,
    unit="s",
    step=1.0,
    decimals=1,
    group=GATEWAY,
    long=f"At least {SHORTEST_WAIT:g} s, even if this is less.",
    default=SHORTEST_WAIT,
    source="gateway",
)


def _put_guided_time(host: Host, value: float) -> None:
    _set(host, guided_timeout=value)


GUIDED_TIME = Parameter(
    "ANF_GUIDED_T",
    ParamType.REAL32,
    "Timeout of velocity setpoints in ArduPilot's Guided; a hover follows",
    read=lambda host: host.vehicle.settings.guided_timeout,
    write=own(_put_guided_time),
    put=_put_guided_time,
    limits=lambda host: (SHORTEST_TIMEOUT, LONGEST_TIMEOUT),
    polled=True,
    unit="s",
    step=0.1,
    decimals=1,
    group=GATEWAY,
    long="Velocities and yaw rates only. Attitudes, accelerations and all setpoints of PX4's Offboard time out after "
    "0.5 s.",
    default=FlightSettings.guided_timeout,
    source="gateway",
)


def _put_override(host: Host, value: float) -> None:
    host.vehicle.manual.override.sources = Override(int(value))


def _put_override_stick(host: Host, value: float) -> None:
    host.vehicle.manual.override.threshold = value / 100.0


RC_OVERRIDE = Parameter(
    "ANF_RC_OVERRIDE",
    ParamType.INT32,
    "Flight tasks that a joystick of PX4's clients overrides",
    read=lambda host: float(host.vehicle.manual.override.sources),
    write=own(_put_override),
    put=_put_override,
    values={0: "Nothing", 1: "Goto, mission, follow, orbit, return, landing", 2: "Offboard", 3: "All of these"},
    polled=True,
    group=GATEWAY,
    long="A stick that is deflected after half a second at rest selects Position. The throttle alone does not. "
    "Returns and landings only if a client commanded them. Not for ArduPilot's clients, as in ArduCopter.",
    default=float(Override.AUTO),
    source="gateway",
)
RC_OVERRIDE_STICK = Parameter(
    "ANF_RC_STICK_OV",
    ParamType.REAL32,
    "Stick deflection of a joystick override",
    read=lambda host: host.vehicle.manual.override.threshold * 100.0,
    write=own(_put_override_stick),
    put=_put_override_stick,
    limits=lambda host: (10.0, 80.0),
    polled=True,
    unit="%",
    step=1.0,
    decimals=0,
    group=GATEWAY,
    default=30.0,
    source="gateway",
)

NATIVE: tuple[Parameter, ...] = (
    MAX_TILT,
    TILT_RATE,
    YAW_RATE,
    VERTICAL_SPEED,
    HORIZONTAL_SPEED,
    MAX_ALTITUDE,
    MAX_DISTANCE,
    GEOFENCE,
    BANKED_TURN,
    CAMERA_RELATIVE,
    AVOIDANCE,
    RETURN_ALTITUDE,
    RETURN_END_ALTITUDE,
    RETURN_ENDING,
    RETURN_DELAY,
    RETURN_BY_ITSELF,
    MISSION_RETURN,
    PRECISE_HOME,
    HOME_TYPE,
    GIMBAL_SPEED,
    CONTROLLER_WHEELS,
    CONTROLLER_BUTTONS,
    PILOT_SWITCH,
    MODEL,
    TAKEOFF_HEIGHT,
    HAND_LAUNCH,
    CRUISE_SPEED,
    CLIMB_SPEED,
    YAW_MODE,
    GCS_LOSS,
    GCS_LOSS_TIME,
    RETURN_LANDING,
    RETURN_WAIT,
    GUIDED_TIME,
    RC_OVERRIDE,
    RC_OVERRIDE_STICK,
)
